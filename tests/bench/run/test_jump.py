"""A force that jumps while the axis stands, and all that does not: relaxation, drift, hum, outliers, knocks."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from bench.run.touchoff import unsteady_N
from bench.run.watch import JumpWatch

SIGMA_N = 0.01
AT_S = 1.0
RATES_HZ = (10.0, 60.0, 555.0)


def told(force: Callable[[float], float], rate_Hz: float = 555.0, seed: int = 1, until_s: float = 4.0) -> str | None:
    """The cause, if any, of a force while an axis stands from 0 on, in noise of 10 mN; its limit is 6 N."""
    random = np.random.default_rng(seed)
    watch = JumpWatch(0.12)
    watch.in_air(SIGMA_N)
    for k in range(round(until_s * rate_Hz)):
        time_s = k / rate_Hz
        watch.motor(time_s, 1.0, 1.0 + float(random.normal(0.0, 0.0005)))
        cause = watch.cell(time_s, force(time_s) + float(random.normal(0.0, SIGMA_N)))
        if cause is not None:
            return cause
    return None


def from_then_on(after: Callable[[float], float]) -> Callable[[float], float]:
    """3 N that relax, and from one second on what `after` makes of them."""

    def force(time_s: float) -> float:
        pad_N = 3.0 * (0.7 + 0.3 * math.exp(-time_s / 0.5))
        return pad_N if time_s < AT_S else after(pad_N)

    return force


@pytest.mark.parametrize("rate_Hz", RATES_HZ)
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    "after",
    [lambda f: f - 2.0, lambda f: -f, lambda f: 0.1 * f, lambda f: f + 1.0],
    ids=["falls", "sign", "decimals", "rises"],
)
def test_a_jump_that_stays(after, seed, rate_Hz):
    cause = told(from_then_on(after), rate_Hz, seed)
    assert cause is not None and "jumped" in cause and "while the axis stood still" in cause


@pytest.mark.parametrize("rate_Hz", RATES_HZ)
@pytest.mark.parametrize("tau_s", [0.002, 0.01, 0.03, 0.1, 0.5, 3.0])
def test_a_pad_that_relaxes_does_not_jump(tau_s, rate_Hz):
    """From the end of the ramp on, as fast as any, and by more than half of its force."""
    assert told(lambda t: 2.0 + 3.0 * math.exp(-t / tau_s), rate_Hz) is None


@pytest.mark.parametrize("rate_Hz", RATES_HZ)
@pytest.mark.parametrize("rate_N_s", [-2.0, 0.5, 20.0])
def test_a_drift_is_no_jump(rate_N_s, rate_Hz):
    assert told(lambda t: 2.0 + rate_N_s * t, rate_Hz) is None


@pytest.mark.parametrize("frequency_Hz", [1.0, 5.0, 9.7, 16.7, 20.0, 25.0, 28.0, 33.0, 40.0, 50.0, 50.3, 60.0, 100.0])
@pytest.mark.parametrize("rate_Hz", RATES_HZ)
def test_hum_that_was_not_there_in_air_is_no_jump(frequency_Hz, rate_Hz):
    """Of any phase against the samples, and of twenty times the noise."""
    assert told(lambda t: 2.0 + 0.2 * math.sin(2.0 * math.pi * frequency_Hz * t), rate_Hz, until_s=20.0) is None


@pytest.mark.parametrize("seed", range(3))
def test_outliers_are_no_jump(seed):
    """One sample in fifty, by a newton or so."""
    random = np.random.default_rng(seed + 50)
    assert told(lambda t: 2.0 + (random.exponential(1.0) if random.random() < 0.02 else 0.0), seed=seed) is None


def test_a_knock_is_no_jump():
    """Half a newton for 60 ms."""
    assert told(lambda t: 2.0 + (0.5 if 1.0 <= t < 1.06 else 0.0)) is None


def test_nothing_is_said_of_an_axis_that_moves():
    """It is commanded on and on; the force jumps in the middle of it."""
    watch = JumpWatch(0.12)
    watch.in_air(SIGMA_N)
    for k in range(2000):
        watch.motor(0.002 * k, 0.001 * k, 0.001 * k)
        assert watch.cell(0.002 * k, 1.0 if k < 1000 else 4.0) is None


def test_nothing_is_said_before_the_tare():
    watch = JumpWatch(0.12)
    for k in range(2000):
        watch.motor(0.002 * k, 0.0, 0.0)
        assert watch.cell(0.002 * k, 1.0 if k < 1000 else 4.0) is None


@pytest.mark.parametrize("share", [0.1, 0.35, 0.5, 0.8])
def test_a_jump_in_the_tare_is_not_taken_for_noise(share):
    """A jump J at the share p of a stretch of 1 s has the slope 6 J p (1 − p): more than the noise alone explains."""
    n, jump_N = 548, 0.5
    noise = np.random.default_rng(3).normal(0.0, SIGMA_N, n)
    stepped = noise + jump_N * (np.arange(n) >= share * n)
    slope_N = 6.0 * jump_N * share * (1.0 - share)
    assert 0.04 < unsteady_N(noise) < 0.06, "five sigma"
    assert unsteady_N(stepped) < 0.5 * slope_N


def test_a_coarse_digit_that_turns_once_is_steady():
    """One step of a digit makes a slope of 1.5 digits at the most."""
    assert unsteady_N(np.where(np.arange(200) < 100, 0.0, 0.05)) >= 1.5 * 0.05
