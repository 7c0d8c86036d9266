"""The law through points: exact derivatives, the pads it is for, and those it must leave alone."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from bench.identify import FitResult, fit
from bench.identify.points import Points, through
from tests.truth import draw
from tests.truth.dataset import make
from tests.truth.draw import DrawnPad
from tests.truth.motion import staircase
from tests.truth.noise import Noise, White

from .closed_form import of_dataset


@functools.cache
def fitted(seed: int, law: str, asked: str, noise: float = 0.001) -> tuple[FitResult, DrawnPad]:
    rng = np.random.default_rng(seed)
    drawn = draw.pad(rng, laws=(law,), orders=(1, 2))
    D = drawn.depth_mm
    motion = staircase([0.25 * D, 0.5 * D, 0.75 * D, D, 0.5 * D, 0.2 * D, -0.5, 0.4 * D, 0.9 * D], 80.0, 2.0)
    data = of_dataset(make(drawn.pad, motion, 250.0, Noise(White(noise * drawn.force_N)), rng))
    return fit(data, law=asked, order=len(drawn.pad.rates), contact=drawn.pad.contact), drawn


def family() -> Points:
    return through(np.array([0.1, 0.25, 0.45, 0.7, 1.0]), 2.0)


def test_its_shape_is_one_at_the_greatest_depth_and_derivatives_are_exact() -> None:
    f = family()
    u = np.linspace(-0.2, 1.1, 131)
    for theta in (*f.starts, np.array([1e-6, 0.3, 2.0, 0.1])):
        s, ds = f.shape(u, theta)
        assert f.shape(np.array([1.0]), theta)[0][0] == pytest.approx(1.0)
        assert np.all(s[u <= 0] == 0) and np.all(ds[u <= 0] == 0) and np.all(np.diff(s) >= 0)
        for j, value in enumerate(theta):
            h = np.zeros(len(theta))
            h[j] = 1e-6 * max(value, 1e-3)
            numeric = (f.shape(u, theta + h)[0] - f.shape(u, theta - h)[0]) / (2 * h[j])
            np.testing.assert_allclose(ds[:, j], numeric, atol=1e-5 * max(1.0, float(np.abs(numeric).max())))


def test_its_numbers_are_the_forces_at_its_depths() -> None:
    f = family()
    theta = np.array([0.2, 0.4, 0.6, 0.8])
    numbers = f.physical_numbers(theta, 6.0, 2.0)
    assert [name for name, _, _ in numbers] == [f"force_{i}" for i in range(1, 6)]
    np.testing.assert_allclose([v for _, v, _ in numbers], 6.0 * np.cumsum([0.2, 0.4, 0.6, 0.8, 1.0]) / 3.0)
    assert f.entry(numbers)["delta_mm"] == [0.2, 0.5, 0.9, 1.4, 2.0]


def test_a_pad_without_a_formula_is_followed() -> None:
    z = []
    for seed in range(5):
        result, drawn = fitted(seed, "tanh", "spline")
        u = np.linspace(0.05, 1.0, 40) * drawn.depth_mm * 0.99
        miss = result.model.pad.law.force(u) - drawn.pad.law.force(u)
        assert np.max(np.abs(miss)) < 0.01 * drawn.force_N
        assert result.rmse < 1.05 * 0.001 * drawn.force_N
        z += [
            (result.parameters[name].value - value) / result.parameters[name].std
            for name, value in drawn.pad.parameters().items()
            if name.startswith(("c_", "nu_"))
        ]
    assert np.sqrt(np.mean(np.square(z))) < 2.0


def test_the_model_file_has_its_points() -> None:
    result, drawn = fitted(0, "tanh", "spline")
    entry = result.model_dict["pad"]["elastic"]
    forces = [result.parameters[f"force_{i}"].value for i in range(1, len(entry["force_N"]) + 1)]
    assert entry["law"] == result.law == "spline" and entry["force_N"] == forces
    assert np.all(np.diff([0.0, *forces]) > 0) and np.all(np.diff([0.0, *entry["delta_mm"]]) > 0)
    assert entry["delta_mm"][-1] == pytest.approx(drawn.depth_mm, rel=1e-3)
    assert 6 <= len(forces) <= 10 and all(p.std > 0 and p.unit for p in result.parameters.values())
    np.testing.assert_allclose(
        result.model.simulate_at(result.time_s, result.traces[0].position_mm, result.time_s),
        result.simulated,
        atol=0.03 * drawn.force_N,  # corners between samples are not in the plain simulation
    )


def test_auto_takes_it_where_formulas_fail_and_nowhere_else() -> None:
    taken = [fitted(seed, "tanh", "auto", 0.0005)[0].law for seed in range(4)]
    assert taken.count("spline") >= 3
    for law in ("exponential", "power", "polynomial"):
        assert [fitted(seed, law, "auto")[0].law for seed in range(3)].count("spline") == 0
