"""Many draws of random pads from tests.truth: how near to the Cramér-Rao bound, how honest the standard errors."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
import pytest

from bench.identify import FitResult, fit
from tests.truth import crb, draw
from tests.truth.dataset import Dataset, make
from tests.truth.laws import Exponential
from tests.truth.motion import staircase
from tests.truth.noise import Coloured, Noise, White
from tests.truth.pad import Pad, simulate

from .closed_form import of_dataset

DRAWS = 24


@dataclass(frozen=True)
class Draw:
    data: Dataset
    result: FitResult
    bound: dict[str, float]


def recorded(seed: int, colour_s: float = 0.0) -> Dataset:
    """A staircase on a random pad at 200 Hz, noise of 0.3 % of the force."""
    rng = np.random.default_rng(seed)
    drawn = draw.pad(rng)
    D, std = drawn.depth_mm, 0.003 * drawn.force_N
    path = staircase([0.25 * D, 0.5 * D, 0.75 * D, D, 0.5 * D, 0.2 * D, -0.5], 80.0, 3.0)
    return make(drawn.pad, path, 200.0, Noise(Coloured(std, colour_s) if colour_s else White(std)), rng)


@functools.cache
def draws(colour_s: float) -> list[Draw]:
    out = []
    for seed in range(DRAWS):
        data = recorded(seed, colour_s)
        pad = data.truth.pad
        degree = 3 if pad.law.name == "polynomial" else None
        result = fit(of_dataset(data), law=pad.law.name, order=len(pad.rates), contact=pad.contact, degree=degree)
        out.append(Draw(data, result, crb.bound(data.truth)))
    return out


def told(one: Draw) -> list[tuple[float, float, float]]:
    """(error, standard error given, bound) of the parameters whose bound is below a fifth of the value."""
    truth = one.data.truth.pad.parameters()
    return [
        (one.result.parameters[name].value - value, one.result.parameters[name].std, one.bound[name])
        for name, value in truth.items()
        if one.bound[name] < 0.2 * abs(value)
    ]


def test_pooled_error_is_near_the_bound() -> None:
    ratios = np.array([error / bound for one in draws(0.0) for error, _, bound in told(one)])
    # 24 pads of some six parameters, which move together within a pad: the pooled ratio scatters by some 8 %.
    assert 0.8 < np.sqrt(np.mean(ratios**2)) < 1.25
    assert abs(np.mean(ratios)) < 0.35


def test_standard_errors_cover() -> None:
    inside = [abs(error) < 1.96 * std for one in draws(0.0) for error, std, _ in told(one)]
    assert 0.88 < np.mean(inside) <= 1.0


@pytest.mark.long
def test_standard_errors_cover_under_coloured_noise() -> None:
    inside = [abs(error) < 1.96 * std for one in draws(0.03) for error, std, _ in told(one)]
    assert np.mean(inside) > 0.83


def test_cost_is_never_above_that_of_the_truth() -> None:
    for one in draws(0.0):
        truth = one.data.truth
        error = one.data.force_N - simulate(truth.pad, truth.motion, one.data.time_s).force_N
        assert np.mean(error**2) * (1 + 1e-6) >= one.result.V


@pytest.mark.parametrize("colour_s", [0.0, pytest.param(0.03, marks=pytest.mark.long)])
def test_noise_floor_is_the_noise(colour_s: float) -> None:
    ratios = [one.result.noise_floor / one.data.truth.noise.force.std for one in draws(colour_s)]
    assert 0.85 < np.median(ratios) < 1.1


def test_undetermined_where_the_bound_says_so() -> None:
    for one in draws(0.0):
        for name, value in one.data.truth.pad.parameters().items():
            relative = one.bound[name] / abs(value) if value else 0.0
            if relative > 1.0:
                assert name in one.result.undetermined, (name, relative)
            if 0 < relative < 0.2:
                assert name not in one.result.undetermined, (name, relative)


@pytest.mark.parametrize(
    "pad",
    [
        # a time constant of four minutes, in 20 s
        pytest.param(Pad(Exponential(2.24, 0.69), (0.25, 0.2), (4.0, 0.004)), marks=pytest.mark.long),
        pytest.param(Pad(Exponential(2.24, 0.69), (0.25, 0.1), (4.0, 0.001)), marks=pytest.mark.long),
        Pad(Exponential(2.24, 0.69), (0.25, 0.15), (4.0, 3.4)),  # two rates that are one
    ],
    ids=["slow", "slower", "near"],
)
def test_weak_modes_are_called_undetermined_and_strong_ones_not(pad: Pad) -> None:
    path = staircase([0.6, 1.2, 1.8, 2.4, 1.2, 0.5, -0.5], 80.0, 3.0)
    missed, false, weak, strong = 0, 0, 0, 0
    for seed in range(4):
        data = make(pad, path, 200.0, Noise(White(0.03)), np.random.default_rng(seed))
        bound = crb.bound(data.truth)
        result = fit(of_dataset(data), law="exponential", order=2)
        for name, value in pad.parameters().items():
            if bound[name] > abs(value):
                weak, missed = weak + 1, missed + (name not in result.undetermined)
            if bound[name] < 0.3 * abs(value):
                strong, false = strong + 1, false + (name in result.undetermined)
    assert weak >= 4 and strong >= 8
    assert missed <= 0.25 * weak and false <= 0.1 * strong
