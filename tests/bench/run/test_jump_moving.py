"""A force that jumps while the axis moves evenly, and all that a pad does on the way that looks like it."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from bench.run.watch import JumpWatch

SIGMA_N = 0.01
RATES_HZ = (10.0, 60.0, 555.0)
MOTOR_HZ = 250.0

Of = Callable[[float], float]


def told(force: Of, motion: Of, rate_Hz: float = 555.0, seed: int = 1, until_s: float = 4.0) -> str | None:
    """The cause, if any, where `force(t)` (N) is read while the axis goes along `motion(t)` (mm); its limit is 6 N."""
    random = np.random.default_rng(seed)
    watch = JumpWatch(0.12)
    watch.in_air(SIGMA_N)
    events = [(k / MOTOR_HZ, "motor") for k in range(round(until_s * MOTOR_HZ))]
    events += [(k / rate_Hz, "cell") for k in range(round(until_s * rate_Hz))]
    for time_s, what in sorted(events):
        if what == "motor":
            watch.motor(time_s, motion(time_s), motion(time_s) + float(random.normal(0.0, 0.0005)))
            continue
        cause = watch.cell(time_s, force(time_s) + float(random.normal(0.0, SIGMA_N)))
        if cause is not None:
            return cause
    return None


def line(start: float, per_s: float) -> Of:
    """A straight line over time."""
    return lambda t: start + per_s * t


def steps_of(height_mm: float, every_s: float, within_s: float) -> Of:
    """A staircase down, each step in so short a time."""

    def motion(t: float) -> float:
        n = math.floor(t / every_s)
        return height_mm * (n + min(1.0, (t - n * every_s) / within_s))

    return motion


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("by_N", [-2.0, 3.0])
@pytest.mark.parametrize("speed_mm_s", [0.05, 0.5, 2.0])
def test_a_jump_on_the_way(speed_mm_s, by_N, seed):
    """On a pad of 1 N/mm that is pressed with 2.5 N when it happens."""
    motion = line(2.5 - speed_mm_s, speed_mm_s)
    cause = told(lambda t: motion(t) + (by_N if t >= 1.0 else 0.0), motion, seed=seed)
    assert cause is not None and "jumped" in cause and "while the axis moved evenly" in cause


@pytest.mark.parametrize("seed", range(3))
def test_a_jump_while_it_creeps(seed):
    """A servo whose integral takes up the pad's force goes some micrometres on, and the command stands."""
    random = np.random.default_rng(seed)
    watch = JumpWatch(0.12)
    watch.in_air(SIGMA_N)
    causes = []
    for k in range(1110):
        time_s = k / 555.0
        watch.motor(time_s, 1.04, 1.04 - 0.04 * math.exp(-time_s) + float(random.normal(0.0, 0.0005)))
        causes.append(watch.cell(time_s, (2.5 if time_s < 1.0 else 0.5) + float(random.normal(0.0, SIGMA_N))))
    (cause,) = [cause for cause in causes if cause is not None]
    assert "while the axis stood still" in cause


@pytest.mark.parametrize("rate_Hz", RATES_HZ)
@pytest.mark.parametrize("stiffness_N_mm", [0.5, 5.0, 50.0])
@pytest.mark.parametrize("speed_mm_s", [0.1, 1.0, 10.0])
def test_a_pad_that_is_touched_pressed_and_left_is_no_jump(speed_mm_s, stiffness_N_mm, rate_Hz):
    slope = stiffness_N_mm * speed_mm_s
    assert told(lambda t: slope * max(0.0, t - 1.0), line(0.0, speed_mm_s), rate_Hz) is None
    assert told(lambda t: slope * max(0.0, 1.0 - t), line(0.0, -speed_mm_s), rate_Hz) is None


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("rate_N_s", [0.05, 0.2, 1.0, 5.0, 20.0, 100.0])
def test_a_slope_in_noise_is_no_jump(rate_N_s, seed):
    """However the noise falls: the median of six goes with the slope by eight readings."""
    for rate_Hz in RATES_HZ:
        assert told(line(1.0, rate_N_s), line(0.0, 0.2), rate_Hz, seed, until_s=10.0) is None


@pytest.mark.parametrize("rate_Hz", RATES_HZ)
@pytest.mark.parametrize("delay_s", [0.0, 0.02, 0.1])
@pytest.mark.parametrize("within_s", [0.005, 0.02, 0.2])
def test_a_step_of_the_motion_is_no_jump_of_the_force(within_s, delay_s, rate_Hz):
    """Each 0.3 mm, on 2 N/mm, as a cell sees it that is up to 0.1 s late."""
    motion = steps_of(0.3, 1.0, within_s)
    assert told(lambda t: 1.0 + 2.0 * motion(max(0.0, t - delay_s)), motion, rate_Hz) is None


def test_a_pad_that_lets_go_is_no_jump():
    """Sticky: it pulls with up to half a newton, and is off within a reading."""
    assert told(lambda t: 0.5 * (1.0 - t) if t < 2.0 else 0.0, line(0.0, -0.5)) is None


@pytest.mark.parametrize("conversions_Hz", [5.0, 10.0, 50.0])
def test_a_cell_that_repeats_its_readings_does_not_jump_on_the_way(conversions_Hz):
    """Asked more often than it measures: its readings are stairs."""
    random = np.random.default_rng(2)
    noise = random.normal(0.0, SIGMA_N, 10_000)
    watch = JumpWatch(0.12)
    watch.in_air(SIGMA_N)
    for k in range(2000):
        time_s = k / 555.0
        watch.motor(time_s, time_s, time_s)
        converted = math.floor(time_s * conversions_Hz)
        assert watch.cell(time_s, 2.0 + 3.0 * converted / conversions_Hz + noise[converted]) is None


def test_nothing_is_said_where_the_axis_speeds_up_brakes_or_turns():
    """A jump of 2 N in the middle of it is not told: no force could be, within 0.15 s of such a change."""
    for motion in (lambda t: 2.0 * t * t, lambda t: 3.0 * t - t * t, lambda t: abs(t - 1.0), lambda t: max(t, 1.0)):
        assert told(lambda t: 2.0 - (2.0 if t >= 1.05 else 0.0), motion, until_s=1.15) is None


@pytest.mark.parametrize("conversions_Hz", [3.0, 5.0, 10.0])
@pytest.mark.parametrize("tau_s", [0.05, 0.15, 0.5])
def test_stairs_of_a_pad_that_relaxes_are_no_jump(tau_s, conversions_Hz):
    """What a slow cell that is asked often makes of the time after a ramp, which ends after 0.7 s at the latest."""
    for ramp_s in (0.5, 0.6, 0.7):
        random = np.random.default_rng(3)
        noise = random.normal(0.0, SIGMA_N, 100)
        watch = JumpWatch(0.12)
        watch.in_air(SIGMA_N)
        for k in range(2200):
            time_s = k / 555.0
            converted = math.floor(time_s * conversions_Hz)
            since_s = converted / conversions_Hz - ramp_s
            pad_N = 2.0 * math.exp(-since_s / tau_s) if since_s > 0.0 else 2.0
            position_mm = min(time_s, ramp_s)
            watch.motor(time_s, position_mm, position_mm)
            assert watch.cell(time_s, 1.0 + pad_N + float(noise[converted])) is None
