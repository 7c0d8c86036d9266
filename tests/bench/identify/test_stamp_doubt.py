"""Stamps of the position that may all be off together are in the standard errors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.identify import fit
from bench.recording.types import Measurement
from tests.truth.laws import Exponential
from tests.truth.motion import staircase
from tests.truth.pad import Pad, simulate

PAD = Pad(Exponential(2.24, 0.69), (0.25, 0.15), (4.0, 0.35))
LATE_S = 1e-3


def measured(rng: np.random.Generator) -> Measurement:
    """A staircase of 5 mm/s: slow enough that a path of straight lines is the motion."""
    motion = staircase([0.6, 1.2, 1.8, 2.4, 1.2, -0.5], 5.0, 3.0)
    t = np.arange(int(200 * motion.duration_s)) / 200
    force = simulate(PAD, motion, t, max_step_s=0.05).force_N + 0.01 * rng.standard_normal(len(t))
    return Measurement("slow", t, motion.position(t), t, force)


def test_standard_errors_grow_by_what_late_stamps_move_the_numbers() -> None:
    certain = measured(np.random.default_rng(7))
    given: dict[str, object] = {"law": "exponential", "order": 2, "contact": "unilateral"}
    base = fit(certain, **given).parameters  # type: ignore[arg-type]
    doubtful = fit(replace(certain, stamp_std_s=LATE_S), **given).parameters  # type: ignore[arg-type]
    late = replace(certain, position_time_s=certain.position_time_s + LATE_S)
    moved = fit(late, **given).parameters  # type: ignore[arg-type]
    for name, one in base.items():
        assert doubtful[name].value == pytest.approx(one.value, rel=1e-9)
        added = np.sqrt(doubtful[name].std ** 2 - one.std**2)
        # What is far below the noise's own share is told by the stamps' no better than that.
        assert added == pytest.approx(abs(moved[name].value - one.value), rel=0.15, abs=0.15 * one.std)
    assert doubtful["c_1"].std > 1.5 * base["c_1"].std  # the doubt is no trifle here: else nothing was tested
