"""Runs with so few samples that no test of structure is made: they are not called consistent for that."""

from __future__ import annotations

import numpy as np
import pytest

from bench.diagnose import diagnose
from bench.diagnose.words import lines
from bench.recording.types import Measurement
from sim.model import Model
from tests.truth.laws import Exponential
from tests.truth.motion import staircase
from tests.truth.pad import Pad, simulate

PAD = Pad(Exponential(2.24, 0.69), (0.25, 0.15), (4.0, 0.35))


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("swings_N", [0.0, 0.3])
def test_a_run_killed_in_its_first_ramp(seed: int, swings_N: float) -> None:
    """35 samples of a ramp, on which the force swings by twenty times its noise, or not."""
    rng = np.random.default_rng(seed)
    motion = staircase([1.5], 20.0, 2.0)
    begun_s = float(next(t for t in np.arange(0.0, 2.0, 1e-3) if motion.position(t) > 0.0))
    t = np.arange(begun_s - 1.0, begun_s + 0.07, 0.002)
    force = simulate(PAD, motion, t).force_N + 0.01 * rng.standard_normal(len(t))
    force += np.where(t > begun_s, swings_N * np.sin(2 * np.pi * 30.0 * (t - begun_s)), 0.0)
    x = motion.position(t)
    m = Measurement("killed", t - t[0], x, t - t[0], force, fit_from_s=1.0)
    d = diagnose(m, Model.from_dict(PAD.model()))
    if swings_N:
        assert d.verdict == "unexplained" or d.causes
    else:
        assert d.verdict == "consistent"
    assert any("too few" in line for line in lines(d))
