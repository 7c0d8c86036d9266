"""A pad that lets go comes back between samples: with nodes there the model is that of the independent simulator."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.identify import fit, objective, problem
from bench.identify.condense import condensed
from bench.identify.estimate import Estimate, over_the_edge, polish
from bench.identify.laws import exponential
from bench.identify.objective import Structure
from bench.identify.returns import PIECES, STEP_S, with_returns
from bench.identify.starts import bounds_of
from bench.recording.types import Measurement
from tests.truth.laws import Exponential
from tests.truth.motion import staircase
from tests.truth.pad import Pad, simulate

LEVELS = [0.6, 1.3, 2.4, 1.1, 0.3, -0.5]


def fast(nu: float, share: float = 0.6) -> Pad:
    return Pad(Exponential(2.24, 0.69), (share,), (nu,))


def staircase_of(pad: Pad, rate_hz: float, lead_s: float = 0.5, noise_N: float = 0.0) -> Measurement:
    motion = staircase(LEVELS, 80.0, 0.7, lead_s=lead_s)
    t = np.arange(0, motion.duration_s, 1 / rate_hz)
    noise = noise_N * np.random.default_rng(2).standard_normal(len(t))
    return Measurement("data", t, motion.position(t), t, simulate(pad, motion, t, 0.01).force_N + noise)


def off(pad: Pad, m: Measurement) -> float:
    """Largest error of the estimator's model at the true numbers, N."""
    made = problem.build([m], between=True)
    gain = float(pad.law.force(np.array([made.depth_mm]))[0]) / made.force_N
    (c,), (nu,) = pad.shares, pad.rates
    x = np.array([0.69 * made.depth_mm, np.log(nu), (1 - c) * gain, c * gain])
    ((force, gone, _),) = objective.forces(made, Structure(exponential(), 1, True), x)
    assert gone.any()
    return float(np.max(np.abs(force[made.where[0]] * made.force_N - m.force_N)))


@pytest.mark.parametrize("nu", [15.0, 60.0])
def test_the_model_at_the_true_numbers_comes_to_the_truth(nu: float, monkeypatch: pytest.MonkeyPatch) -> None:
    many = [staircase_of(fast(nu), 100.0, lead_s) for lead_s in np.linspace(0.5, 0.51, 6)]
    with_nodes = [off(fast(nu), m) for m in many]
    monkeypatch.setattr(problem, "with_returns", lambda m, time_s, position_mm: (time_s, position_mm))
    without = [off(fast(nu), m) for m in many]
    assert max(with_nodes) < 0.35 * max(without)


def test_samples_stay_and_new_nodes_lie_where_the_pad_has_let_go() -> None:
    m = staircase_of(fast(15.0), 100.0, noise_N=0.01)
    time, position = with_returns(m, m.position_time_s, m.position_mm)
    assert np.all(np.diff(time) > 0)
    at = np.searchsorted(time, m.position_time_s)
    np.testing.assert_array_equal(time[at], m.position_time_s)
    np.testing.assert_array_equal(position[at], m.position_mm)
    np.testing.assert_allclose(position, np.interp(time, m.position_time_s, m.position_mm))
    fresh = np.setdiff1d(np.arange(len(time)), at)
    before = np.searchsorted(m.position_time_s, time[fresh]) - 1
    assert len(fresh) > 0 and np.all(np.diff(time)[fresh] <= 0.01 / PIECES + 1e-12)
    near = np.minimum(np.abs(m.force_N[before]), np.abs(m.force_N[before + 1]))
    assert float(near.max()) < 0.1 and np.all(position[fresh] > -0.5)


@pytest.mark.parametrize("case", ["bonded", "fast stamps", "in the noise", "never pressed"])
def test_nothing_is_added_where_nothing_is_told(case: str) -> None:
    m = staircase_of(fast(15.0), 1.25 / STEP_S if case == "fast stamps" else 100.0, noise_N=0.01)
    if case == "bonded":
        m = replace(m, force_N=m.force_N + np.where(m.position_mm > 0, 1.0, 0.0))
    elif case == "in the noise":
        m = replace(m, force_N=1e-3 * m.force_N + 0.01 * np.random.default_rng(3).standard_normal(len(m.force_N)))
    elif case == "never pressed":
        m = replace(m, position_mm=m.position_mm - 5.0)
    time, position = with_returns(m, m.position_time_s, m.position_mm)
    assert time is m.position_time_s and position is m.position_mm


def test_a_fit_is_no_worse_than_the_truth_where_the_pad_comes_back_fast() -> None:
    for lead_s in np.linspace(0.5, 0.51, 5):
        pad, noise_N = fast(60.0), 0.003
        m, clean = (staircase_of(pad, 100.0, lead_s, n) for n in (noise_N, 0.0))
        result = fit(m, law="exponential", order=1, contact="unilateral")
        assert float(np.mean((m.force_N - clean.force_N) ** 2)) > result.V


def test_a_minimum_beyond_a_return_is_found() -> None:
    """A pad that comes back just before the next move, or just not: a minimum on either side, and a ridge between."""
    pad, depth_mm = Pad(Exponential(1.13, 0.87), (0.105, 0.488), (14.4, 0.224)), 2.4
    motion = staircase([*(depth_mm * np.array([0.25, 0.5, 0.75, 1.0, 0.5, 0.2])).tolist(), -0.5], 80.0, 3.0)
    t = np.arange(0, motion.duration_s, 0.005)
    clean, structure = simulate(pad, motion, t, 0.01).force_N, Structure(exponential(), 2, True)
    stuck = []
    for seed in range(6):
        force = clean + 0.027 * np.random.default_rng(seed).standard_normal(len(t))
        made, _ = condensed(problem.build([Measurement("data", t, motion.position(t), t, force)], between=True))
        gain = float(pad.law.force(np.array([made.depth_mm]))[0]) / made.force_N
        ends = []
        for factor in (0.8, 1.0, 1.2, 1.5):
            shares = gain * np.array([0.407, 0.105, 0.488])
            x = np.concatenate([[0.87 * made.depth_mm], np.log([14.4, 0.224 * factor]), shares])
            ends.append(polish(made, Estimate(structure, x, 0.0, np.eye(6), True, bounds_of(made))))
        least = min(e.cost for e in ends)
        stuck.append(max(e.cost for e in ends) > (1 + 1e-3) * least)
        assert max(over_the_edge(made, e).cost for e in ends) < (1 + 1e-5) * least
    assert any(stuck)
