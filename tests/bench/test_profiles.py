"""Profiles of planned moves, smoothed or not: against numerical integration, and found again in noisy positions."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import lsim

from bench.diagnose import diagnose
from bench.felt_motion import felt
from bench.profiles import PLAIN, Smoothing, Trapezoid, profile
from sim.model import Model
from tests.bench.diagnose.small import measurement
from tests.truth.cases import draw_case

SMOOTHINGS = [Smoothing(0.012, 0.0), Smoothing(0.0, 0.003), Smoothing(0.006, 0.002)]


def smoothed(t: np.ndarray, x: np.ndarray, smoothing: Smoothing) -> np.ndarray:
    """By a mean and a lag, one after the other, on an even grid."""
    n = round(smoothing.width_s / (t[1] - t[0]))
    if n:
        whole = np.concatenate([[0.0], np.cumsum((x[1:] + x[:-1]) / 2)])
        x = (whole - np.interp(np.arange(len(t)) - n, np.arange(len(t)), whole, left=0.0)) / n
    tau = smoothing.lag_s
    return lsim(([1.0], [tau * tau, 2 * tau, 1.0]), x, t)[1] if tau else x


@pytest.mark.parametrize("smoothing", SMOOTHINGS)
@pytest.mark.parametrize("speed", [20.0, 60.0])  # it cruises; it has just got there
def test_a_smoothed_move_is_the_trapezoid_s_after_the_smoothing(smoothing: Smoothing, speed: float) -> None:
    t = np.arange(0.0, 0.5, 1e-5)
    plain = Trapezoid(0.0, 1.2, 0.2, speed, 3000.0)
    late = Trapezoid(0.0, 1.2, 0.2 + smoothing.delay_s, speed, 3000.0, smoothing)
    assert_allclose(late.position(t), smoothed(t, plain.position(t), smoothing), atol=2e-6)
    begin_s, end_s = late.span_s()
    assert np.all(late.position(t[t < begin_s]) == 0.0)
    assert_allclose(late.position(t[t > end_s]), 1.2, atol=3e-5)


@pytest.mark.parametrize("smoothing", [PLAIN, *SMOOTHINGS])
def test_derivatives_are_those_of_the_way(smoothing: Smoothing) -> None:
    tau, way = np.linspace(-0.06, 0.06, 241), np.array(0.9)
    _, by_middle, by_speed = profile(tau, way, np.array(24.0), 2500.0, smoothing)
    h = 1e-6
    assert_allclose(
        by_middle,
        (profile(tau - h, way, np.array(24.0), 2500.0, smoothing)[0]
         - profile(tau + h, way, np.array(24.0), 2500.0, smoothing)[0]) / (2 * h),
        atol=3e-3,
    )  # fmt: skip
    assert_allclose(
        by_speed,
        (profile(tau, way, np.array(24.0 + h), 2500.0, smoothing)[0]
         - profile(tau, way, np.array(24.0 - h), 2500.0, smoothing)[0]) / (2 * h),
        atol=1e-7,
    )  # fmt: skip


@pytest.mark.parametrize(
    "smoothing", [PLAIN, SMOOTHINGS[2], *(pytest.param(s, marks=pytest.mark.long) for s in SMOOTHINGS[:2])]
)
@pytest.mark.parametrize("seed", [0, *(pytest.param(s, marks=pytest.mark.long) for s in (1, 2))])
def test_what_smooths_the_moves_is_found_in_noisy_positions(smoothing: Smoothing, seed: int) -> None:
    rng, t = np.random.default_rng(seed), np.arange(0.0, 12.0, 2e-3)
    ways = rng.uniform(0.4, 1.5, 5) * [1, -1, 1, 1, -1]
    speeds = np.minimum(rng.uniform(20, 60, 5), 0.95 * np.sqrt(2500.0 * np.abs(ways)))
    begins = 1.5 + 2.0 * np.arange(5) + rng.uniform(0, 0.01, 5)
    moves = [Trapezoid(0.0, w, at, v, 2500.0, smoothing) for w, at, v in zip(ways, begins, speeds, strict=True)]
    told = felt(t, sum(m.position(t) for m in moves) + 3e-4 * rng.standard_normal(len(t)))
    assert len(told.planned) == len(moves)
    fine = np.arange(0.5, 11.0, 1e-4)
    off = told.at(fine) - sum(m.position(fine) for m in moves)
    assert np.abs(off).max() < 5e-4 and np.sqrt(np.mean(off**2)) < 1.5e-4
    # and the acceleration, which a mass feels: its error over a hundredth of a second
    bent, true = (np.diff(x[::20], 2) / 4e-6 for x in (told.at(fine), sum(m.position(fine) for m in moves)))
    assert np.sqrt(np.mean((bent - true) ** 2)) < 0.02 * 2500.0


def test_a_hop_of_a_coarse_scale_is_no_move() -> None:
    rng, t = np.random.default_rng(2), np.arange(0.0, 12.0, 1e-3)
    x = Trapezoid(0.0, 1.0005, 2.0, 40.0, 2500.0).position(t) + 1e-4 * rng.standard_normal(len(t))
    told = felt(t, 1e-3 * np.round(x / 1e-3))
    assert [round(move.way_mm, 1) for _, _, move in told.planned] == [1.0]


@pytest.mark.long
def test_a_mass_is_told_right_where_the_servo_smooths_the_moves() -> None:
    ratios = []
    for seed in range(5):
        case = draw_case(seed, ("inertia",), 2.0, "rigid", rate_hz=400.0, servo_s=0.003, protocol="rich", jitter="none")
        cause = next(iter(diagnose(measurement(case), Model.from_dict(case.believed)).causes), None)
        if cause is not None and cause.id == "inertia":
            ratios.append(cause.parameters["mass"].value / case.truth.parameters["inertia"]["mass"])
    assert len(ratios) >= 4
    assert np.median(np.abs(np.array(ratios) - 1.0)) < 0.03 and np.abs(np.array(ratios) - 1.0).max() < 0.1, ratios
