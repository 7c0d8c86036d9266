"""Ramps from rest to rest: they arrive, and never exceed what they were given."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bench.trajectory import Profile, braking_distance

ends = st.floats(-10, 10).map(lambda x: round(x, 4))
speeds = st.floats(0.01, 200)
accelerations = st.floats(10, 20_000)
jerks = st.none() | st.floats(1e3, 1e7)


@settings(max_examples=150, deadline=None)
@given(ends, ends, speeds, accelerations, jerks)
def test_a_ramp_arrives_and_exceeds_nothing(
    start: float, end: float, speed: float, acceleration: float, jerk: float | None
) -> None:
    ramp = Profile(start, end, speed, acceleration, jerk)
    assert ramp.position(0.0) == start
    assert ramp.position(ramp.duration_s) == end
    assert ramp.position(ramp.duration_s + 1.0) == end
    t = np.linspace(0.0, ramp.duration_s, 2001)
    h = ramp.duration_s / 2000
    x, v = ramp.position(t), ramp.velocity(t)
    assert x[0] == start and x[-1] == end
    forward = 1.0 if end >= start else -1.0
    assert (forward * np.diff(x) >= 0).all()
    assert (forward * v >= -1e-9 * speed).all()
    assert np.abs(v).max() <= min(speed, ramp.peak_speed_mm_s) * (1 + 1e-9)
    assert ramp.peak_speed_mm_s <= speed * (1 + 1e-9)
    assert ramp.peak_acceleration_mm_s2 <= acceleration * (1 + 1e-9)
    # Change of velocity over h is at most a·h, and of that change over another h at most j·h².
    assert np.abs(np.diff(v)).max() <= acceleration * h * (1 + 1e-6) + 1e-9 * speed
    if jerk is not None:
        assert np.abs(np.diff(v, 2)).max() <= jerk * h * h * (1 + 1e-6) + 1e-9 * speed
    # Velocity is the derivative of position: its integral is the way (trapezoid rule, error ~ a h² a corner).
    assert np.sum((v[1:] + v[:-1]) / 2) * h == pytest.approx(end - start, abs=8 * acceleration * h * h + 1e-9)


@settings(max_examples=100, deadline=None)
@given(ends, ends, speeds, accelerations, jerks, st.lists(st.floats(-0.1, 1.1), max_size=5))
def test_one_time_gives_what_an_array_gives(
    start: float, end: float, speed: float, acceleration: float, jerk: float | None, shares: list[float]
) -> None:
    ramp = Profile(start, end, speed, acceleration, jerk)
    for t in [*(ramp.duration_s * share for share in shares), 0.0, ramp.duration_s]:
        assert ramp.position(t) == ramp.position(np.array([t]))[0]
        assert ramp.velocity(t) == pytest.approx(ramp.velocity(np.array([t]))[0], rel=1e-12, abs=1e-12)


def test_a_trapezoid_s_closed_form() -> None:
    ramp = Profile(1.0, 5.0, 80.0, 5000.0)
    # 80²/5000 = 1.28 mm go into rise and fall, so the speed is reached: T = d/v + v/a
    assert ramp.duration_s == pytest.approx(4 / 80 + 80 / 5000, rel=1e-12)
    assert ramp.peak_speed_mm_s == 80.0
    assert ramp.position(0.008) == pytest.approx(1.0 + 5000 * 0.008**2 / 2, rel=1e-12)
    assert ramp.velocity(0.03) == 80.0


def test_a_triangle_s_closed_form() -> None:
    ramp = Profile(1.2, 0.6, 80.0, 5000.0)
    assert ramp.duration_s == pytest.approx(2 * math.sqrt(0.6 / 5000), rel=1e-12)
    assert ramp.peak_speed_mm_s == pytest.approx(math.sqrt(0.6 * 5000), rel=1e-12)
    assert ramp.position(ramp.duration_s / 2) == pytest.approx(0.9, rel=1e-12)
    assert ramp.velocity(ramp.duration_s / 2) == pytest.approx(-math.sqrt(0.6 * 5000), rel=1e-12)


def test_an_s_curve_s_closed_forms() -> None:
    # Speed and acceleration reached: T = d/v + v/a + a/j (Biagiotti and Melchiorri, 3.4).
    ramp = Profile(0.0, 10.0, 80.0, 5000.0, 1e6)
    assert ramp.duration_s == pytest.approx(10 / 80 + 80 / 5000 + 5000 / 1e6, rel=1e-12)
    # Neither reached: four equal jerks, d = 2 j T_j³.
    short = Profile(0.0, 0.01, 80.0, 5000.0, 1e6)
    turn = (0.01 / 2e6) ** (1 / 3)
    assert short.duration_s == pytest.approx(4 * turn, rel=1e-12)
    assert short.peak_speed_mm_s == pytest.approx(1e6 * turn**2, rel=1e-12)


def test_no_way_takes_no_time() -> None:
    for jerk in (None, 1e6):
        ramp = Profile(2.0, 2.0, 1.0, 1.0, jerk)
        assert ramp.duration_s == 0.0
        assert ramp.position(0.0) == 2.0
        assert ramp.position(np.array([-1.0, 0.0, 1.0])).tolist() == [2.0, 2.0, 2.0]
        assert ramp.velocity(0.5) == 0.0


@pytest.mark.parametrize(
    "numbers",
    [(0, 1, 0, 1), (0, 1, -1, 1), (0, 1, 1, math.nan), (0, 1, math.inf, 1), (math.nan, 1, 1, 1), (0, 1, 1, 1, 0)],
)
def test_what_is_no_ramp(numbers: tuple[float, ...]) -> None:
    with pytest.raises(ValueError):
        Profile(*numbers)


def test_braking() -> None:
    assert braking_distance(80.0, 5000.0) == pytest.approx(0.64)
