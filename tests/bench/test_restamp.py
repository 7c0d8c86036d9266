"""Stamps that are off by chance, and moves that put them right; cases of the independent simulator."""

from dataclasses import replace

import numpy as np
import pytest

from bench.felt_motion import smoothed
from bench.motion_between import planned_moves
from bench.position_noise import position_noise
from bench.recording.types import Measurement
from bench.restamp import restamped
from tests.bench.diagnose.small import measurement
from tests.truth.cases import Case, draw_case

SEEDS = range(6)
ROW = ("position_time_s", "position_mm", "force_time_s", "force_N")


def drawn(seed: int, jitter: str, protocol: str = "staircase") -> Case:
    return draw_case(
        seed, (), None, protocol=protocol, rate_hz=400.0, jitter=jitter, own_clock=False, position_noise_mm=3e-4
    )


def off_mm(c: Case, m: Measurement) -> float:
    """RMS by which positions are off the motion at their stamps, in fast motion."""
    motion = c.truth.motion
    fast = np.abs(motion.velocity(m.position_time_s)) > 20.0
    return float(np.sqrt(np.mean((m.position_mm - motion.position(m.position_time_s))[fast] ** 2)))


@pytest.mark.parametrize("lost", [0.0, 0.02])
def test_samples_of_an_even_clock_get_its_times(lost: float) -> None:
    rates = []
    for seed in SEEDS:
        c = drawn(seed, "stamp", "random_steps")
        m = measurement(c)
        kept = np.random.default_rng(seed).random(len(m.force_N)) >= lost
        if lost:
            m = replace(m, **{name: getattr(m, name)[kept] for name in ROW})
        told = restamped(m)
        assert np.array_equal(told.position_mm, m.position_mm) and np.array_equal(told.force_N, m.force_N)
        true = c.truth.row_time_s[kept]
        errors = [float(np.sqrt(np.mean((t - true) ** 2))) for t in (m.position_time_s, told.position_time_s)]
        rates.append(errors[1] / errors[0])
    # of a line through some 25,000 stamps; where moves are all corners and few samples, the moves alone tell
    assert np.median(rates) < 0.03 and max(rates) < 1.01, rates


def test_samples_move_to_where_the_motion_passed_them(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where no clock is even."""
    monkeypatch.setattr("bench.restamp.even_times", lambda *_: None)
    better = []
    for seed in SEEDS:
        c = drawn(seed, "stamp")
        m = measurement(c)
        told = restamped(m)
        assert np.array_equal(told.position_mm, m.position_mm) and np.array_equal(told.force_N, m.force_N)
        assert np.array_equal(told.position_time_s, told.force_time_s)
        assert (np.diff(told.position_time_s) > 0).all()
        assert np.abs(told.position_time_s - m.position_time_s).max() < 0.45 / 400.0
        better.append(off_mm(c, told) / off_mm(c, m))
    assert np.median(better) < 0.7, better
    assert max(better) < 1.1, better


@pytest.mark.parametrize(
    ("jitter", "protocol"),
    [
        ("none", "random_steps"),
        ("sampling", "staircase"),
        pytest.param("none", "staircase", marks=pytest.mark.long),
        pytest.param("sampling", "random_steps", marks=pytest.mark.long),
    ],
)
def test_honest_stamps_stay(jitter: str, protocol: str) -> None:
    for seed in SEEDS:
        m = measurement(drawn(seed, jitter, protocol))
        assert restamped(m) is m


def test_a_motion_that_no_planner_made_says_nothing() -> None:
    t = np.arange(0.0, 20.0, 2.5e-3)
    rng = np.random.default_rng(1)
    x = 1.0 - np.cos(2.0 * np.pi * 0.5 * t) + 0.02 * np.sin(2.0 * np.pi * 40.0 * t) + 3e-4 * rng.standard_normal(t.size)
    m = Measurement("swing", t, x, t, np.zeros(t.size))
    assert restamped(m) is m


def test_two_clocks_are_left_alone() -> None:
    m = measurement(drawn(0, "stamp"))
    apart = Measurement("apart", m.position_time_s, m.position_mm, m.force_time_s + 1e-4, m.force_N)
    assert restamped(apart) is apart


@pytest.mark.long
def test_moves_between_noisy_rests_are_found() -> None:
    """Wiggles of a smoothed rest beside a move do not hide that it begins and ends there."""
    missed = moves = 0
    for seed in SEEDS:
        c = draw_case(
            seed, (), None, protocol="random_steps", rate_hz=500.0, jitter="none", own_clock=False,
            position_noise_mm=6e-4,
        )  # fmt: skip
        m = measurement(c)
        read = position_noise(m.position_mm)
        clean, std = smoothed(m.position_time_s, m.position_mm, read)
        found, _ = planned_moves(m.position_time_s, m.position_mm, clean, read, float(np.median(std)))
        at = c.truth.motion.breaks_s
        speed = np.abs(c.truth.motion.velocity(0.5 * (at[1:] + at[:-1])))
        fast = at[:-1][(speed > 5.0)]
        known = [(m.position_time_s[a], m.position_time_s[b]) for a, b in found]
        moves += len(fast)
        missed += sum(not any(a <= t <= b for a, b in known) for t in fast)
    assert moves > 100
    assert missed < 0.03 * moves, (missed, moves)
