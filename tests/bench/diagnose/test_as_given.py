"""A belief whose structure is right and whose numbers are not: consistent, and said to be so refitted only."""

from __future__ import annotations

import numpy as np
import pytest

from bench.diagnose import diagnose
from bench.diagnose.words import headline, lines
from bench.recording.types import Measurement
from bench.report.diagnosis import diagnosis_page
from sim.model import Model
from tests.truth.laws import Exponential
from tests.truth.motion import staircase
from tests.truth.pad import Pad, simulate

PAD = Pad(Exponential(2.24, 0.69), (0.25, 0.15), (4.0, 0.35))
SOFTER = Pad(Exponential(1.9, 0.69), (0.25, 0.15), (4.0, 0.35))


def measured(pad: Pad, seed: int) -> Measurement:
    motion = staircase([0.8, 1.6, 2.2, 1.4, 0.0, 1.8, 0.6, 0.0], 20.0, 3.0)
    t = np.arange(0.0, motion.duration_s, 0.005)
    force = simulate(pad, motion, t).force_N + 0.01 * np.random.default_rng(seed).standard_normal(len(t))
    return Measurement("pad", t, np.asarray(motion.position(t)), t, force)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_softer_pad_than_believed_is_said_to_be_softer(seed: int) -> None:
    d = diagnose(measured(SOFTER, seed), Model.from_dict(PAD.model()))
    assert d.verdict == "consistent" and "with its numbers refitted" in headline(d)
    said = lines(d)[1]
    assert "m 2.24 → 1.9" in said and "b " not in said  # the one that is another, and no other
    assert "m 2.24 → 1.9" in diagnosis_page(d)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_belief_with_the_right_numbers_is_not(seed: int) -> None:
    d = diagnose(measured(PAD, seed), Model.from_dict(PAD.model()))
    assert d.verdict == "consistent" and d.as_given == ""
    assert "refitted" not in "\n".join(lines(d)) + headline(d)
