"""A pad that is bonded to the probe, believed to let go: the word of the model that is wrong is said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bench.diagnose import diagnose
from bench.diagnose.words import lines
from bench.recording.types import Measurement
from sim.model import Model
from tests.bench.diagnose.test_few import PAD
from tests.truth.motion import staircase
from tests.truth.pad import simulate


def test_a_bonded_pad_is_told_from_one_that_lets_go() -> None:
    said = {}
    for contact in ("bonded", "unilateral"):
        rng = np.random.default_rng(5)
        motion = staircase([0.8, -0.3, 1.2, -0.3, 0.6], 5.0, 1.5)
        t = np.arange(0.0, motion.duration_s, 0.02)
        force = simulate(replace(PAD, contact=contact), motion, t).force_N + 0.01 * rng.standard_normal(len(t))
        d = diagnose(Measurement(contact, t, motion.position(t), t, force), Model.from_dict(PAD.model()))
        said[contact] = any("contact: bonded" in line for line in lines(d))
        assert (d.verdict == "consistent") == (contact == "unilateral")
    assert said == {"bonded": True, "unilateral": False}
