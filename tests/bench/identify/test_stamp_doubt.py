"""Stamps of the position that may all be off together: estimated with the pad, or in the standard errors."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np
import pytest

from bench.identify import fit
from bench.identify.estimate import polish, search
from bench.identify.laws import exponential
from bench.identify.objective import Structure
from bench.identify.parameters import parameters
from bench.identify.problem import build
from bench.identify.result import Parameter
from bench.identify.starts import Starter, bounds_of
from bench.identify.uncertainty import spread_of
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


def taken_as_stamped(m: Measurement) -> dict[str, Parameter]:
    """The numbers of a fit whose runs' own doubts are not estimated with them."""
    problem, family = build([m]), exponential()
    bounds = bounds_of(problem)
    rough = search(problem, Structure(family, 2, True), Starter(problem, family, True, bounds).first(2), bounds)
    best = polish(problem, rough)
    return parameters(problem, best, spread_of(problem, best))[0]


def test_standard_errors_grow_by_what_late_stamps_move_the_numbers() -> None:
    certain = measured(np.random.default_rng(7))
    base = taken_as_stamped(certain)
    doubtful = taken_as_stamped(replace(certain, stamp_std_s=LATE_S))
    moved = taken_as_stamped(replace(certain, position_time_s=certain.position_time_s + LATE_S))
    for name, one in base.items():
        assert doubtful[name].value == pytest.approx(one.value, rel=1e-9)
        added = np.sqrt(doubtful[name].std ** 2 - one.std**2)
        # What is far below the noise's own share is told by the stamps' no better than that.
        assert added == pytest.approx(abs(moved[name].value - one.value), rel=0.15, abs=0.15 * one.std)
    assert doubtful["c_1"].std > 1.5 * base["c_1"].std  # the doubt is no trifle here: else nothing was tested


def test_standard_errors_grow_by_what_an_axis_gives_way_moves_the_numbers() -> None:
    """Behind each step of the staircase the positions may be off by 3 µm, which die away, all of them together."""
    certain = measured(np.random.default_rng(7))
    t, x = certain.position_time_s, certain.position_mm
    off_mm = np.zeros(t.size)
    for n in range(1, t.size):
        off_mm[n] = 0.9 * (off_mm[n - 1] + 5e-3 * (x[n] - x[n - 1]))
    base = taken_as_stamped(certain)
    doubtful = taken_as_stamped(replace(certain, way_doubt=(t, off_mm)))
    moved = taken_as_stamped(replace(certain, position_mm=x + off_mm))
    for name, one in base.items():
        assert doubtful[name].value == pytest.approx(one.value, rel=1e-9)
        added = np.sqrt(doubtful[name].std ** 2 - one.std**2)
        assert added == pytest.approx(abs(moved[name].value - one.value), rel=0.15, abs=0.15 * one.std)
    assert doubtful["c_1"].std > 1.5 * base["c_1"].std  # the doubt is no trifle here: else nothing was tested


def test_doubtful_stamps_are_estimated_with_the_pad() -> None:
    fitted_as = functools.partial(fit, law="exponential", order=2, contact="unilateral")
    deviations, taken_as_they_are = [], []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        m = measured(rng)
        late_s = LATE_S * float(rng.standard_normal())
        m = replace(m, position_time_s=m.position_time_s - late_s)  # measured later than stamped
        found, certain = fitted_as(replace(m, stamp_std_s=LATE_S)), fitted_as(m)
        for fitted, z in ((found, deviations), (certain, taken_as_they_are)):
            share = fitted.parameters["c_1"]
            z.append((share.value - 0.25) / share.std)
        said = [note for note in found.notes if "than their stamps say" in note]
        assert bool(said) == (abs(late_s) > 0.5 * LATE_S) or abs(abs(late_s) / LATE_S - 0.5) < 0.2
        assert all((" later " if late_s > 0 else " earlier ") in note for note in said)
    assert max(np.abs(deviations)) < 3.0
    assert max(np.abs(taken_as_they_are)) > 5.0  # what was to be corrected


def test_late_positions_buy_no_mode() -> None:
    """The order is left to the choice: a late force is not taken for a pad that relaxes within a few samples."""
    orders = []
    for seed in range(4):
        m = measured(np.random.default_rng(100 + seed))
        m = replace(m, position_time_s=m.position_time_s + 2 * LATE_S, stamp_std_s=LATE_S)
        orders.append(fit(m, law="exponential").order)
    assert orders == [2, 2, 2, 2]
