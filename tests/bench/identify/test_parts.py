"""Noise, holds, shorter stand-ins, left-out blocks, the search: each alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.identify import fit, objective, problem
from bench.identify.condense import condensed
from bench.identify.held_out import FOLDS, folds_of
from bench.identify.laws import exponential
from bench.identify.motion import holds, jitter
from bench.identify.noise import noise_of
from bench.identify.objective import Structure
from bench.identify.problem import Problem, Run
from bench.identify.solver import minimise
from bench.recording.types import Measurement
from tests.truth.laws import Exponential
from tests.truth.motion import staircase
from tests.truth.pad import Pad, simulate

from .closed_form import measured, measurement

PAD = Pad(Exponential(2.24, 0.69), (0.25, 0.15), (4.0, 0.35))


def stairs(rate_hz: float, force_N: float = 0.0, position_mm: float = 0.0, seed: int = 0) -> Measurement:
    rng = np.random.default_rng(seed)
    motion = staircase([0.6, 1.2, 1.8, 2.4, 1.2, -0.5], 80.0, 3.0)
    time = np.arange(0, motion.duration_s, 1 / rate_hz)
    n = len(time)
    F = simulate(PAD, motion, time).force_N + force_N * rng.standard_normal(n)
    return measurement(time, motion.position(time) + position_mm * rng.standard_normal(n), F)


def test_noise_of_the_force_is_found_under_relaxation() -> None:
    noise = noise_of([stairs(500, force_N=0.02)])
    assert noise.from_holds and noise.force_N == pytest.approx(0.02, rel=0.05)
    assert noise.floor_N == pytest.approx(noise.force_N)


def test_noise_of_the_position_counts_through_the_stiffness() -> None:
    noise = noise_of([stairs(500, force_N=0.001, position_mm=0.002)])
    assert noise.position_mm == pytest.approx(0.002, rel=0.1)
    # K = m e^{bδ}, over the samples; the force between ramps only hints at it.
    m = stairs(500)
    K = np.where(m.position_mm > 0, 2.24 * np.exp(0.69 * m.position_mm), 0.0)
    assert noise.floor_N == pytest.approx(np.hypot(0.001, 0.002 * np.sqrt(np.mean(K**2))), rel=0.25)


def test_resolution_is_noise_too() -> None:
    m = stairs(200)
    m.force_N = np.round(m.force_N / 0.1) * 0.1
    assert noise_of([m]).force_N >= 0.099 / np.sqrt(12)


def test_holds_are_found_and_slow_ramps_are_not() -> None:
    time = np.arange(0, 30, 0.01)
    position = np.interp(time, [0, 5, 5.1, 10, 20, 30], [0, 0, 1, 1, 2, 2])
    for noise in (0.0, 0.001):
        x = position + noise * np.random.default_rng(1).standard_normal(len(time))
        found = holds(time, x)
        spans = [(time[s.start], time[s.stop - 1]) for s in found if s.stop - s.start > 100]
        assert [(round(a), round(b)) for a, b in spans] == [(0, 5), (5, 10), (20, 30)]
        in_ramp = sum(s.stop - s.start for s in found if 10.2 < time[s.start] < 19.8)
        assert in_ramp < 150  # of 1000
        assert jitter(x) == pytest.approx(noise, rel=0.1, abs=1e-9)


def test_condensed_data_weigh_and_mean_the_same() -> None:
    data = problem.build([stairs(1000, force_N=0.01)])
    short, owners = condensed(data)
    assert short.size < 0.2 * data.size
    assert short.weight == data.weight
    assert short.runs[0].y @ short.runs[0].weight == pytest.approx(data.runs[0].y @ data.runs[0].weight)
    assert len(owners[0]) == data.size and owners[0][-1] == short.size - 1


def test_the_model_is_the_same_on_condensed_data() -> None:
    m = stairs(1000)
    data = problem.build([m])
    short, _ = condensed(data)
    structure = Structure(exponential(), 2, True)
    gain = float(PAD.law.force(data.depth_mm)) / data.force_N
    x = np.concatenate([[0.69 * data.depth_mm], np.log([4.0, 0.35]), gain * np.array([0.6, 0.25, 0.15])])
    assert np.sqrt(objective.cost(short, structure, x) / short.weight) * data.force_N < 1e-3


def test_folds_are_blocks_and_none_holds_a_whole_ramp_hold() -> None:
    data = problem.build([stairs(200)])
    (fold,) = folds_of(data)
    assert set(fold) == set(range(FOLDS))
    assert np.count_nonzero(np.diff(fold)) == 19  # twenty contiguous blocks
    rising = np.flatnonzero(np.diff(data.runs[0].u) > 0.01)
    assert len(set(fold[rising])) == FOLDS


def test_search_stays_within_bounds_and_ends_on_them() -> None:
    """A line through points, slope at most 1: least squares with the slope held there has the mean for its level."""
    t = np.linspace(0, 1, 50)
    y = 3 * t + 1
    J = np.stack([np.ones(50), t], axis=1)

    def normal(x):
        e = y - J @ x
        return float(e @ e), J.T @ e, J.T @ J

    s = minimise(normal, lambda x: normal(x)[0], np.array([0.0, 0.0]), np.array([-9.0, -9.0]), np.array([9.0, 1.0]))
    assert s.converged
    np.testing.assert_allclose(s.x, [y.mean() - t.mean(), 1.0], atol=1e-6)


def test_search_follows_a_curved_valley() -> None:
    """Rosenbrock's function as a sum of squares: residuals 1 − x and 10 (y − x²)."""

    def normal(x):
        e = np.array([1 - x[0], -10 * (x[1] - x[0] ** 2)])
        J = np.array([[1.0, 0.0], [-20 * x[0], 10.0]])
        return float(e @ e), J.T @ e, J.T @ J

    wide = np.full(2, 100.0)
    s = minimise(normal, lambda x: normal(x)[0], np.array([-1.2, 1.0]), -wide, wide)
    assert s.converged
    np.testing.assert_allclose(s.x, [1, 1], atol=1e-8)


def test_progress_is_told() -> None:
    from bench.identify import fit

    said: list[str] = []
    fit(measured(PAD, noise_N=0.05), order=1, progress=said.append)
    assert any("power" in line for line in said) and any("bonded" in line for line in said)


def test_nodes_without_force_move_no_block() -> None:
    """Nodes between samples cut a ramp to steps that are each no more than jitter."""
    t = np.arange(200) * 0.1
    u = np.interp(t, [0, 2, 2.5, 10, 10.5, 20], [0, 0, 1, 1, 0.2, 0.2])
    plain = problem_of(t, u, np.ones(200))
    fine = np.unique(np.concatenate([t, *(t[:-1] + k * 0.1 / 64 for k in range(1, 64))]))
    at = np.searchsorted(fine, t)
    weight = np.zeros(len(fine))
    weight[at] = 1.0
    rebuilt = problem_of(fine, np.interp(fine, t, u), weight)
    np.testing.assert_array_equal(folds_of(rebuilt)[0][at], folds_of(plain)[0])
    assert len(set(folds_of(plain)[0][20:26])) > 1  # the ramp of half a second is in more than one block


def problem_of(t: np.ndarray, u: np.ndarray, weight: np.ndarray) -> Problem:
    return Problem((Run(t, np.diff(t, prepend=t[0]), u, np.zeros(len(t)), weight),), 1.0, 1.0)


def test_a_search_ends_where_sums_of_sensitivities_overflow() -> None:
    """f = x²; beyond x = 1 the derivatives are said to be infinite."""

    def normal(x: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        slope = np.inf if x[0] < 1 else 1.0
        return float(x @ x), -x * slope, np.full((1, 1), slope)

    s = minimise(normal, lambda x: float(x @ x), np.array([4.0]), np.array([-9.0]), np.array([9.0]))
    assert not s.converged and s.x[0] < 1 and s.cost == pytest.approx(s.x[0] ** 2) and s.matrix[0, 0] == 0


def test_a_run_that_is_given_twice_counts_once() -> None:
    first, other = stairs(100, force_N=0.02, seed=1), stairs(100, force_N=0.02, seed=2)
    copy = replace(first, name="copy")
    told = {"law": "exponential", "order": 2, "contact": "unilateral"}
    once, twice = fit([first, other], **told), fit([first, copy, other], **told)
    assert twice.parameters == once.parameters and twice.samples == once.samples
    assert [note for note in twice.notes if note not in once.notes] == [
        "copy holds the samples of data once more, and was left out."
    ]
