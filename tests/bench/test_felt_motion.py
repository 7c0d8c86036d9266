"""Motion without its noise: rests stay at rest, moves stay whole."""

import numpy as np
import pytest
from numpy.typing import NDArray

from bench.felt_motion import felt
from bench.fitted_moves import fitted_moves
from bench.motion_between import _carried_on
from tests.truth.cases import draw_case

Array = NDArray[np.float64]

STEP_S, NOISE_MM = 2e-3, 1e-3


def trapezoid(t: Array, begins_s: float, way_mm: float, speed_mm_s: float, acceleration_mm_s2: float) -> Array:
    """A move from rest to rest."""
    rises, whole = speed_mm_s / acceleration_mm_s2, way_mm / speed_mm_s + speed_mm_s / acceleration_mm_s2
    s = np.clip(t - begins_s, 0.0, whole)
    ends = np.minimum(s, whole - s)
    ramp = 0.5 * acceleration_mm_s2 * np.minimum(ends, rises) ** 2 + speed_mm_s * np.maximum(ends - rises, 0.0)
    return np.where(s <= whole / 2, ramp, way_mm - ramp)


def staircase(t: Array) -> Array:
    """Five moves of 0.4 mm, 12 s apart."""
    return np.sum([trapezoid(t, 6.0 + 12.0 * k, 0.4, 20.0, 1000.0) for k in range(5)], axis=0)


@pytest.mark.parametrize("seed", range(4))
def test_a_rest_has_one_level_whatever_its_noise(seed: int) -> None:
    """Among so many samples some are far off, and some of their neighbours too; a mass would feel each as a blow."""
    t = np.arange(0.0, 66.0, STEP_S)
    x = staircase(t)
    told = felt(t, x + NOISE_MM * np.random.default_rng(seed).standard_normal(t.size))
    off = np.interp(t, told.time_s, told.position_mm) - x
    assert np.abs(off[np.gradient(x) == 0.0]).max() < 0.3 * NOISE_MM


@pytest.mark.parametrize("seed", range(4))
def test_creep_within_a_rest_is_followed_though_it_is_less_than_the_noise(seed: int) -> None:
    """Friction in its presliding answers to it: a tenth of a micrometre can be a tenth of what there is."""
    t = np.arange(0.0, 66.0, STEP_S)
    x = staircase(t)
    since = np.mod(t - 6.0, 12.0)
    creep_mm = np.where((t > 6.2) & (since < 0.6), 0.7 * NOISE_MM, 0.0)
    told = felt(t, x + creep_mm + NOISE_MM * np.random.default_rng(seed).standard_normal(t.size))
    followed = np.interp(t, told.time_s, told.position_mm) - x
    for k in range(5):
        early, late = (t > 6.15 + 12.0 * k) & (t < 6.55 + 12.0 * k), (t > 7.0 + 12.0 * k) & (t < 17.5 + 12.0 * k)
        assert abs(followed[early].mean() - followed[late].mean() - 0.7 * NOISE_MM) < 0.3 * NOISE_MM


def test_a_short_step_out_of_a_rest_is_motion() -> None:
    t = np.arange(0.0, 66.0, STEP_S)
    x = staircase(t)
    out = (t > 20.0) & (t < 20.05)
    x[out] += 6 * NOISE_MM
    told = felt(t, x + NOISE_MM * np.random.default_rng(1).standard_normal(t.size))
    assert np.mean(np.interp(t[out], told.time_s, told.position_mm) - staircase(t)[out]) > 5 * NOISE_MM


def test_rests_are_numbered_and_moves_are_not() -> None:
    t = np.arange(0.0, 66.0, STEP_S)
    told = felt(t, staircase(t) + NOISE_MM * np.random.default_rng(1).standard_normal(t.size))
    number = told.rest_at(np.array([3.0, 4.0, 6.015, 12.0, 24.0]))
    assert number[0] == number[1] > 0 and number[2] == 0 and len({*number.tolist()}) == 4


@pytest.mark.parametrize("seed", range(3))
def test_a_slow_move_is_one_whatever_its_noise(seed: int) -> None:
    """A mass would feel each piece of it stop and start."""
    t = np.arange(0.0, 40.0, STEP_S)
    x = trapezoid(t, 5.0, 3.0, 0.6, 1000.0) + sum(trapezoid(t, 18.0 + 4 * k, 0.3, 20.0, 1000.0) for k in range(5))
    told = felt(t, x + NOISE_MM * np.random.default_rng(seed).standard_normal(t.size))
    cruising = (told.time_s > 5.1) & (told.time_s < 9.9)
    speed = np.diff(told.position_mm[cruising]) / np.diff(told.time_s[cruising])
    assert np.abs(speed - 0.6).max() < 2e-3


def test_a_slow_move_is_met_as_well_as_all_its_samples_tell() -> None:
    """Noise hides how it begins and ends: so it is seen to be shorter than it is, and is not faster for that."""
    t = np.arange(0.0, 20.0, STEP_S)
    fine = np.arange(0.0, 20.0, 1e-4)
    late = np.exp(-np.arange(0.0, 0.02, 1e-4) / 2.4e-3)  # a servo behind its command
    off, lines = [], []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        speed = rng.uniform(0.3, 0.6)
        x = trapezoid(fine, 1.0, 2.5, speed, 3000.0) - trapezoid(fine, 11.0, 2.5, speed, 3000.0)
        noisy = np.interp(t, fine, np.convolve(x, late / late.sum())[: len(x)])
        noisy += 0.5 * NOISE_MM * rng.standard_normal(t.size)
        told = felt(t, noisy)
        assert len(told.planned) == 2
        for begins, ends, move in told.planned:
            inside = (t >= begins) & (t <= ends)
            left = (noisy - move.position(t))[inside] / (0.5 * NOISE_MM)
            line = np.linspace(-1.0, 1.0, len(left))
            off.append(left.sum() / np.sqrt(len(left)))
            lines.append(left @ line / np.sqrt(line @ line))
    assert np.abs(off).max() < 3.0 and np.abs(lines).max() < 3.0


def test_two_moves_with_a_short_rest_between_stay_two() -> None:
    t = np.arange(0.0, 40.0, STEP_S)
    x = sum(trapezoid(t, 6.0 + 6 * k + late, 0.4, 20.0, 1000.0) for k in range(5) for late in (0.0, 0.08))
    told = felt(t, x + NOISE_MM * np.random.default_rng(3).standard_normal(t.size))
    off = np.interp(t, told.time_s, told.position_mm) - x
    assert np.abs(off).max() < 5 * NOISE_MM


@pytest.mark.parametrize(
    ("steps", "pauses"),
    [
        ([7.0, 7.0, 5.5, 7.5, 7.0], []),  # a move hardly faster than its noise goes on
        ([7.0, 7.0, 5.5, 5.8, 7.0], []),
        ([7.0, 7.0, 0.1, 7.5, 7.0], [2]),  # a rest, however short
        ([7.0, 7.0, 5.5, -7.5, -7.0], [2]),  # a turn
        ([7.0, 7.0, 5.5, 5.5, 5.5, 7.0], [2, 3, 4]),
    ],
)
def test_a_move_is_not_cut_where_it_hardly_slows_down(steps: list[float], pauses: list[int]) -> None:
    position = np.concatenate([[0.0], np.cumsum(steps)])
    for sign in (1.0, -1.0):
        moving = _carried_on(np.abs(np.diff(position)) > 6.0, sign * position)
        assert np.flatnonzero(~moving).tolist() == pauses


def test_a_step_within_the_noise_between_rests_of_one_level_is_no_move():
    """Three samples that rise by 0.1 µm each, and the next rest is where the last one was."""
    time, x = np.arange(60) * 0.01, np.zeros(60)
    x[21:24] = [1e-4, 2e-4, 3e-4]
    moving, resting = np.zeros(59, dtype=bool), np.zeros(60, dtype=bool)
    moving[20:23], resting[:20], resting[24:] = True, True, True
    assert fitted_moves(time, x, moving, [(20, 23)], 1.0, 1e-4, x, resting=resting) == {}


@pytest.mark.parametrize(("frequency_Hz", "noise_mm"), [(0.3, 1e-3), (1.5, 1e-3), (1.5, 2e-3)])
def test_a_motion_of_no_planner_is_off_by_what_is_said(frequency_Hz: float, noise_mm: float) -> None:
    """Over eight draws: the mean square of the errors over what they are said to be, within a third of one."""
    t, squares = np.arange(0.0, 10.0, STEP_S), []
    for seed in range(8):
        x = np.sin(2.0 * np.pi * frequency_Hz * t + seed)
        told = felt(t, x + noise_mm * np.random.default_rng(seed).standard_normal(t.size))
        said = np.interp(t, told.time_s, told.std_mm)
        squares.append(np.mean(((told.at(t) - x) / said) ** 2))
    assert np.mean(squares) == pytest.approx(1.0, abs=0.33)


@pytest.mark.parametrize("seed", range(40))
def test_the_turn_of_a_slow_sine_is_no_rest(seed: int) -> None:
    """For a tenth of a second it goes by some deviations of the noise and no more."""
    t = np.arange(0.0, 10.0, STEP_S)
    x = np.sin(0.6 * np.pi * t + seed)
    assert not felt(t, x + NOISE_MM * np.random.default_rng(seed).standard_normal(t.size)).rest.any()


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("planner", ["least jerk", "raised cosine", "trapezoid"])
def test_quick_moves_of_any_planner_are_off_by_what_is_said(planner: str, seed: int) -> None:
    """Sixty samples of each: one by itself is like a trapezoid within its noise, seven that miss it alike are not."""

    def gone(s: Array) -> Array:
        s = np.clip(s, 0.0, 1.0)
        if planner == "least jerk":
            return np.asarray(s**3 * (10.0 - 15.0 * s + 6.0 * s**2))
        return np.asarray(s - np.sin(2.0 * np.pi * s) / (2.0 * np.pi))

    t = np.arange(0.0, 8.0, 0.5e-3)
    begins = 0.6 + np.arange(7)
    if planner == "trapezoid":
        x = np.sum([trapezoid(t, b, 0.55, 36.0, 2400.0) for b in begins], axis=0)
    else:
        x = np.sum([0.55 * gone((t - b) / 0.030) for b in begins], axis=0)
    told = felt(t, x + 1.3e-3 * np.random.default_rng(seed).standard_normal(t.size))
    moving = np.abs(np.gradient(x, t)) > 0.1
    off, said = told.at(t) - x, np.interp(t, told.time_s, told.std_mm)
    assert np.sqrt(np.mean(off[moving] ** 2)) < 1.0e-3
    assert np.mean((off[moving] / said[moving]) ** 2) < 5.0  # what a rest keeps of a gentle start made it hundreds
    # where it shows what its planner plans, all the samples of a move tell one
    assert told.planned_at(t[moving]).mean() > 0.9 or planner != "trapezoid"


def test_noise_that_lasts_does_not_hide_that_a_servo_rounds_the_corners() -> None:
    """A rate sweep at 120 samples a second behind a servo of 3 ms, with 1 µm that lasts for five samples: plain
    trapezoids would be off by most of a sample's noise in most of eight draws."""
    off = []
    for seed in range(8):
        told = {"servo_s": 3e-3, "position_noise_mm": 1e-3, "position_memory": 5.0, "position_step_mm": 0.0}
        case = draw_case(seed, (), protocol="rate_sweep", rate_hz=120.0, jitter="none", **told)
        x, moving = case.truth.reported_mm, np.abs(np.gradient(case.truth.reported_mm, case.time_s)) > 0.1
        off.append(np.sqrt(np.mean((felt(case.time_s, case.position_mm).at(case.time_s) - x)[moving] ** 2)))
    assert np.median(off) < 0.5e-3


@pytest.mark.parametrize("width_s", [5e-3, 8e-3])
def test_corners_rounded_by_little_more_than_the_noise_are_met_or_doubted(width_s: float) -> None:
    """Moving means of a planner that limits the jerk, at 250 samples a second: by eye they are trapezoids of a lower
    acceleration, which miss the corners by several times what noise leaves. Over eight draws the worst sample is off by
    less than four times what is said, but for two of them."""
    fine, noise_mm = np.arange(0.0, 18.0, 1e-4), 0.4e-3
    speeds = [4.0, 2.0, 6.0, 1.5, 3.0, 5.0, 1.0, 6.5]
    x = np.sum([trapezoid(fine, 1.0 + 2.0 * k, 0.6, v, 3000.0) for k, v in enumerate(speeds)], axis=0)
    many = int(width_s / 1e-4)
    x = np.convolve(np.pad(x, (many - 1, 0), mode="edge"), np.ones(many) / many, "valid")
    t, x = fine[::40], x[::40]
    worst = []
    for seed in range(8):
        told = felt(t, x + noise_mm * np.random.default_rng(seed).standard_normal(t.size))
        said = np.interp(t, told.time_s, np.hypot(told.std_mm, told.doubt_mm))
        worst.append(np.max(np.abs(told.at(t) - x) / said))
    assert np.sum(np.array(worst) < 4.0) >= 6


def test_no_stray_of_a_slow_swing_is_felt() -> None:
    """Less than two counts of the scale, in seconds: no rest, and no window agrees with one sample in a thousand.
    Friction that has slid to its end keeps what a stray would push it by until the axis turns."""
    t = np.arange(0.0, 4.0, 1e-3)
    true = 1.0 + 6e-4 * np.sin(2.0 * np.pi * t / 3.0)
    off = []
    for seed in range(30):
        x = np.round(true + 5e-4 * np.random.default_rng(seed).standard_normal(t.size), 3)
        off.append(float(np.abs(felt(t, x).at(t) - true)[100:-100].max()))
    assert np.quantile(off, 0.9) < NOISE_MM / 3
