"""Pads that are loaded when the data begin: the state they were in is fitted with them."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np
import pytest

from bench.identify import FitResult, fit, objective, problem
from bench.identify.laws import exponential
from bench.identify.noise import Noise
from bench.identify.objective import Structure
from bench.identify.past import begins_loaded, with_pasts
from bench.recording.types import Measurement
from tests.truth import draw
from tests.truth.draw import DrawnPad
from tests.truth.laws import Exponential
from tests.truth.motion import staircase
from tests.truth.pad import Pad, simulate

from .closed_form import measured, measurement

NOISE = Noise(0.01, 0.0, 0.01, True)
SAID = "The data begin at"


def tail(seed: int, from_s: float = 6.0) -> tuple[Measurement, DrawnPad]:
    """Steps on a random pad of one or two modes, whole in the simulator, and what was left of them from a hold on."""
    rng = np.random.default_rng(seed)
    drawn = draw.pad(rng, orders=(1, 2))
    levels = (drawn.depth_mm * np.array([0.5, 1.0, 0.6, 0.9, 0.3])).tolist()
    motion = staircase([*levels, -0.5, 0.8 * drawn.depth_mm], 60.0, 4.0)
    t = np.arange(0, motion.duration_s, 0.005)
    F = simulate(drawn.pad, motion, t).force_N + 0.002 * drawn.force_N * rng.standard_normal(len(t))
    late = t >= from_s + rng.uniform(-1, 1) * (from_s > 0)
    return measurement(t[late], motion.position(t[late]), F[late]), drawn


@functools.cache
def cut(seed: int) -> tuple[FitResult, DrawnPad]:
    data, drawn = tail(seed)
    pad = drawn.pad
    degree = 3 if pad.law.name == "polynomial" else None
    return fit(data, law=pad.law.name, order=len(pad.rates), contact=pad.contact, degree=degree), drawn


@pytest.mark.long
def test_parameters_are_unbiased_and_honest() -> None:
    z = []
    for seed in range(12):
        result, drawn = cut(seed)
        for name, value in drawn.pad.parameters().items():
            if name not in result.undetermined:
                z.append((result.parameters[name].value - value) / result.parameters[name].std)
        assert result.rmse < 1.1 * 0.002 * drawn.force_N  # from rest it is some ten times the noise
    assert len(z) > 40
    assert np.sqrt(np.mean(np.square(z))) < 1.35
    assert np.mean(np.abs(z) < 1.96) > 0.87


def test_it_is_said_once() -> None:
    result, _ = cut(0)
    assert sum(SAID in note for note in result.notes) == 1


def test_from_air_never() -> None:
    for seed in range(3):
        data, _ = tail(seed, from_s=0.0)
        assert not any(SAID in note for note in fit(data, law="power", order=1).notes)
    pad = Pad(Exponential(2.24, 0.69), (0.25, 0.15), (4.0, 0.35))
    data = measured(pad, noise_N=0.02)
    assert not begins_loaded(data, 2.5, 10.0, NOISE)
    offset = replace(data, force_N=data.force_N + 0.5)  # not even with an offset of the force
    assert not begins_loaded(offset, 2.5, 10.0, NOISE)


@pytest.mark.parametrize(
    ("level_mm", "force_N", "fall_N", "loaded"),
    [
        (1.0, 3.0, 0.0, True),
        (1.0, 0.0, 0.0, False),  # deep by the position, and no force at all: the surface is elsewhere
        (0.001, 3.0, 0.0, False),
        (-0.5, 3.0, 1.0, False),
        (1.0, -0.4, 0.8, True),  # no force on average, but it relaxes
    ],
)
def test_what_counts_as_loaded(level_mm: float, force_N: float, fall_N: float, loaded: bool) -> None:
    t = np.arange(0, 6, 0.01)
    x = np.where(t < 3, level_mm, 2.0)
    F = np.where(t < 3, force_N + fall_N * np.exp(-t), 8.0) + 0.01 * np.random.default_rng(0).standard_normal(len(t))
    assert begins_loaded(measurement(t, x, F), 2.0, 8.0, NOISE) == loaded


def test_two_runs_have_each_their_own_past() -> None:
    pad = Pad(Exponential(2.24, 0.69), (0.25, 0.15), (4.0, 0.35))
    whole = measured(pad, seed=1, samples=3000)
    parts = []
    for from_s in (4.0, 15.0):
        late = whole.force_time_s > from_s
        t, x, F = whole.force_time_s[late], whole.position_mm[late], whole.force_N[late]
        parts.append(measurement(t, x, F, f"from {from_s}"))
    result = fit(parts, law="exponential", order=2)
    for name, value in pad.parameters().items():
        assert result.parameters[name].value == pytest.approx(value, rel=1e-5), name
    assert result.rmse < 1e-6


@pytest.mark.parametrize("unilateral", [True, False])
def test_derivatives_by_the_past_are_exact(unilateral: bool) -> None:
    whole = measured(Pad(Exponential(2.24, 0.69), (0.3, 0.2), (5.0, 0.4)), samples=600)
    late = whole.force_time_s > 4.0
    data = problem.build([measurement(whole.force_time_s[late], whole.position_mm[late], whole.force_N[late])])
    data = with_pasts(data, NOISE)
    structure = Structure(exponential(), 2, unilateral, data.pasts)
    assert data.pasts == 1 and structure.size == 1 + 2 + 2 + 3
    x = np.concatenate([[1.2], [-0.4, -0.2], np.log([5.0, 0.4]), [0.5, 0.3, 0.2]])
    (piece,) = objective.simulate(data.runs[0], structure, x, derivatives=True)
    for j in range(structure.size):
        h = np.zeros(structure.size)
        h[j] = 1e-6
        (up,), (down,) = (objective.simulate(data.runs[0], structure, x + s * h) for s in (1, -1))
        same = up.let_go == down.let_go
        numeric = (up.force - down.force) / 2e-6
        np.testing.assert_allclose(piece.jacobian[same, j], numeric[same], atol=2e-7 * max(1.0, np.abs(numeric).max()))


@pytest.mark.parametrize("seed", range(4))
def test_a_relaxation_alone_tells_rates_and_nothing_else(seed: int) -> None:
    """The probe stands in the pad from the first row on: the law chosen is any, the order that of the data."""
    rng = np.random.default_rng(seed)
    rates = (rng.uniform(2.0, 4.0), rng.uniform(0.15, 0.3))
    pad = Pad(Exponential(2.0, 0.5), (0.3, 0.12), rates)
    motion = staircase([2.0], 60.0, 42.0)
    t = np.arange(0.0, motion.duration_s, 0.005)
    F = simulate(pad, motion, t).force_N + 0.006 * rng.standard_normal(len(t))
    late = (t > 1.2) & (t < 41.0)
    result = fit(measurement(t[late] - t[late][0], motion.position(t[late]), F[late]))
    assert result.order == 2 and result.rmse < 1.05 * 0.006
    assert set(result.undetermined) == {name for name in result.parameters if not name.startswith("nu_")}
    for i, rate in enumerate(rates, 1):
        found = result.parameters[f"nu_{i}"]
        assert abs(found.value - rate) < 3.5 * found.std < 0.1 * rate
    assert any("does not move" in note for note in result.notes)
