"""A zero that wanders, far more than the noise: in air that is seen, whatever a refit has made of the pad."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from bench.diagnose import diagnose
from bench.diagnose.channel import faults
from bench.diagnose.data import prepare
from bench.diagnose.diagnose import believed_structure
from bench.diagnose.drift_in_air import told_in_air
from bench.diagnose.reach import Reach
from bench.diagnose.refit import refit
from bench.diagnose.starts import Signatures
from bench.recording.types import Measurement
from sim import effects
from sim.model import Model
from tests.bench.diagnose.small import measurement
from tests.truth.cases import Case, draw_case

Array = NDArray[np.float64]

SWING_N, TURNS_S = 0.3, 9.0  # of the warmth of a room: a sine whose quarter takes so long


def told(m: Measurement, believed: Model) -> tuple[Signatures, Array, Reach]:
    """What a drift is looked for with: what a refit leaves, the believed pad's vector, and how far the data reach."""
    prepared = prepare(m, faults(m.force_N).good)
    structure = believed_structure(believed, prepared)
    x = structure.pad.x()
    at = Signatures(prepared.short, refit(prepared.short, structure, x, 12, 1e-5))
    return at, x, Reach.of(prepared.short, structure, prepared.sample_s)


def wandering(seed: int) -> tuple[Case, Measurement]:
    """Nothing hidden but a zero that swings slowly."""
    how = {"contact": "unilateral", "protocol": "rate_sweep", "rate_hz": 200.0}
    c = draw_case(seed, (), 1.0, **how)
    m = measurement(c)
    more_N = SWING_N * np.sin(0.5 * np.pi * (m.force_time_s - m.force_time_s[0]) / TURNS_S)
    return c, replace(m, force_N=m.force_N + more_N)


def test_a_drift_is_told_by_the_forces_in_air():
    for seed in range(5):
        c, m = wandering(seed)
        at, pad, reach = told(m, Model.from_dict(c.believed))
        begun = told_in_air(at, effects.effect("force_drift"), pad, reach)
        assert begun is not None and begun.cause.form.name == "turning"
        assert begun.cause.start["time_constant"] == pytest.approx(TURNS_S, rel=0.3)
        assert begun.cause.start["rate"] == pytest.approx(0.5 * np.pi * SWING_N / TURNS_S, rel=0.5)
        calm = replace(at.data, force_N=at.force)  # as the model has it: nothing moves in air
        assert told_in_air(Signatures(calm, at.fit), effects.effect("force_drift"), pad, reach) is None
        assert told_in_air(at, effects.effect("force_bias"), pad, reach) is None


def test_a_drift_that_bends_is_begun_within_what_the_data_tell():
    """Not at the first sample: a rate that is another one for a moment is a step, and a bias beside a drift."""
    for seed in range(5):
        c = draw_case(seed, (), 1.0, contact="unilateral", protocol="rate_sweep", rate_hz=200.0)
        m = measurement(c)
        since_s = m.force_time_s - m.force_time_s[0]
        m = replace(m, force_N=m.force_N + 0.02 * np.minimum(since_s, 0.4 * since_s[-1]))
        at, pad, reach = told(m, Model.from_dict(c.believed))
        begun = told_in_air(at, effects.effect("force_drift"), pad, reach)
        assert begun is not None
        for p in begun.cause.form.parameters:
            assert p.unit != "s" or p.fixed or p.upper <= 100.0 * reach.span_s
            assert p.name != "bends_at" or 0.1 * reach.span_s < p.lower < begun.cause.start["bends_at"]


@pytest.mark.slow
@pytest.mark.long
def test_a_zero_that_wanders_far_is_called_a_drift():
    right = 0
    for seed in range(5):
        c, m = wandering(seed)
        found = diagnose(m, Model.from_dict(c.believed))
        right += [cause.id for cause in found.causes] == ["force_drift"] and found.verdict == "explained"
    assert right == 5
