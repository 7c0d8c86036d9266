"""The pieces under the discrete methods: grid, model, sensitivities, ramps."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.signal import lfilter

from bench.errors import InputError
from bench.identify.discrete import phases, system
from bench.identify.discrete.series import sampled
from bench.identify.discrete.system import Structure, simulate
from bench.identify.laws import exponential, polynomial, power
from bench.recording.types import Measurement, StepMark

from .discrete_data import GEL, T, exact, measurement, steps

LAWS = pytest.mark.parametrize("family", [exponential(), power(), polynomial(3)], ids=lambda f: f.name)


def zero_order_hold(shares, rates, T):
    """(a, b) of 1 + Σ c_i (z⁻¹ stuff), by multiplying out: independent of sim."""
    p = np.exp(-np.array(rates) * T)
    a = np.poly(p)
    b = (1 - sum(shares)) * a
    for i, c in enumerate(shares):
        b = b + c * np.convolve([1, -1], np.poly(np.delete(p, i)))
    return a, b


def test_data_at_their_own_times_stay_as_they_are():
    m = exact(0, 200, 0.02)
    data = sampled([m], T)
    run = data.runs[0]
    assert np.allclose(run.time_s, m.force_time_s) and np.allclose(run.y * data.force_N, m.force_N)
    assert np.allclose(run.u * data.depth_mm, m.position_mm)


def test_a_coarser_grid_is_the_mean_and_keeps_noise_white():
    rng = np.random.default_rng(0)
    t = np.arange(40_000) * 1e-3
    noise = rng.standard_normal(t.size)
    data = sampled([Measurement("noise", t, np.ones(t.size), t, noise)], 0.01)
    y = data.runs[0].y * data.force_N
    assert np.allclose(y[:4000], noise.reshape(-1, 10).mean(axis=1))
    r = np.correlate(y, y, "full")[len(y) - 1 :][1:20] / np.dot(y, y)
    assert np.abs(r).max() < 4 / math.sqrt(len(y))


def test_what_is_quicker_than_the_grid_does_not_come_back_as_something_slow():
    t = np.arange(20_000) * 1e-3
    hum = np.sin(2 * np.pi * 102.0 * t)  # would be a 2 Hz wave in every tenth sample
    y = sampled([Measurement("hum", t, np.ones(t.size), t, hum)], 0.01).runs[0].y
    assert np.std(y) < 0.03 * np.std(hum)


def test_the_mean_of_the_elastic_force_is_taken_behind_the_law():
    # One cell with the whole ramp in it: F^e of the mean depth is far from the mean of F^e.
    t = np.arange(4000) * 1e-3
    depth = np.clip((t - 1.0) / 0.05, 0, 1) * 2.0
    data = sampled([Measurement("ramp", t, depth, t, 1 + depth)], 0.2)
    s, _ = data.runs[0].elastic(exponential(), np.array([3.0]))
    u = depth.reshape(-1, 200) / 2.0
    assert np.allclose(s, (np.expm1(3 * u) / np.expm1(3.0)).mean(axis=1), atol=1e-4)


def test_gaps_and_history_do_not_count():
    m = exact(0, 200, 0.0)
    keep = np.abs(m.force_time_s - 5.0) > 0.6
    holey = Measurement("gap", m.position_time_s, m.position_mm, m.force_time_s[keep], m.force_N[keep], fit_from_s=2.0)
    data = sampled([holey], T)
    run = data.runs[0]
    assert (~run.has).sum() == np.sum(~keep) and np.all(run.weight[run.time_s < 1.99] == 0)
    assert any("no measured force" in note for note in data.notes)


@pytest.mark.parametrize("bad", [0.0, -1.0, float("nan"), 0.01, 3.0])
def test_a_sample_time_that_cannot_be_is_refused(bad):
    with pytest.raises(InputError, match="sample-time"):
        sampled([exact(0, 200, 0.02)], bad)


@pytest.mark.parametrize("r", [1, 2, 3])
def test_the_model_is_the_papers_filter(r):
    shares, rates = [0.2, 0.15, 0.1][:r], [8.0, 2.0, 0.3][:r]
    a, b = zero_order_hold(shares, rates, T)
    data = sampled([exact(1, 300, 0.02)], T)
    structure = Structure(exponential(), r, unilateral=False)
    v = structure.vector(1.3, np.array([1.5]), a[1:], b[1:])
    assert np.allclose(structure.filter(v).a, a) and np.allclose(structure.filter(v).b, b)
    u = 1.3 * np.expm1(1.5 * data.runs[0].u) / np.expm1(1.5)
    assert np.allclose(simulate(data.runs[0], structure, v).force, lfilter(b, a, u), atol=1e-10)


@LAWS
@pytest.mark.parametrize("unilateral", [False, True])
def test_gradients_are_exact(family, unilateral):
    a, b = zero_order_hold([0.3, 0.2], [5.0, 0.5], T)
    data = sampled([exact(2, 300, 0.02)], T)
    structure = Structure(family, 2, unilateral)
    v = structure.vector(1.1, family.starts[len(family.starts) // 2] + 0.01, a[1:], b[1:])
    run = data.runs[0]
    out = simulate(run, structure, v, "all")
    assert out.let_go.any() == unilateral
    for j in range(structure.size):
        h = 1e-6 * max(abs(v[j]), 1e-2)
        near = [v + sign * h * np.eye(structure.size)[j] for sign in (1, -1)]
        slope = (simulate(run, structure, near[0]).force - simulate(run, structure, near[1]).force) / (2 * h)
        assert np.allclose(out.jacobian[:, j], slope, rtol=2e-4, atol=2e-4 * np.abs(slope).max()), j


def test_a_filter_that_runs_away_costs_infinity():
    data = sampled([exact(0, 2000, 0.02)], T)
    structure = Structure(exponential(), 1, unilateral=False)
    v = structure.vector(1.0, np.array([1.0]), np.array([-1.2]), np.array([0.0]))
    assert math.isinf(system.cost(data, structure, v))


def test_ramps_are_found_where_nothing_names_them():
    m = measurement(steps())
    ramps = phases.ramps_of(m)
    assert [round(r.end_mm, 2) for r in ramps] == [0.6, 1.2, 1.8, 2.4, 1.8, 1.2, 0.6]
    assert [r.rising for r in ramps] == [True] * 4 + [False] * 3
    assert [r.recovered for r in ramps] == [True] + [False] * 6
    assert all(r.end_s - r.begin_s < 0.05 for r in ramps)


def test_marks_name_the_ramps_where_a_recording_has_them():
    m = measurement(steps())
    m.marks = [
        StepMark(0.0, "air", "finish", "air"),
        StepMark(0.5, "steps[0]", "steps", "ramp"),
        StepMark(0.55, "steps[0]", "steps", "hold"),
        StepMark(3.5, "steps[1]", "steps", "ramp"),
        StepMark(3.6, "steps[1]", "steps", "hold"),
    ]
    assert [(r.begin_s, r.end_s) for r in phases.ramps_of(m)] == [(0.5, 0.55), (3.5, 3.6)]


@pytest.mark.parametrize(("rest_s", "recovered"), [(2.0, False), (15.0, True)])
def test_a_pad_recovers_with_rest(rest_s, recovered):
    from tests.truth.dataset import make
    from tests.truth.motion import Path
    from tests.truth.noise import Noise

    path = Path(-0.5).hold(0.5).to(1.0, 80.0).hold(1.0).to(-0.5, 80.0).hold(rest_s).to(1.0, 80.0).hold(1.0).motion()
    m = measurement(make(GEL, path, 200.0, Noise(None), np.random.default_rng(0)))
    assert [r.recovered for r in phases.ramps_of(m) if r.rising] == [True, recovered]
