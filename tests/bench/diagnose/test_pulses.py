"""Pulses in the force channel: surges that last some samples."""

import numpy as np
import pytest

from bench.diagnose.pulses import LONGEST, pulses
from bench.readings import resolution
from tests.truth.cases import draw_case

SEEDS = range(6)


def still(seed: int, n: int = 4000) -> tuple[np.ndarray, np.random.Generator]:
    rng = np.random.default_rng(seed)
    return 3.0 + rng.normal(0.0, 0.01, n), rng


def surge(length: int) -> np.ndarray:
    """From 100 deviations of the noise down to 15."""
    return 0.01 * np.geomspace(100.0, 15.0, length)


@pytest.mark.parametrize("seed", SEEDS)
def test_surges_are_told_by_how_they_begin_and_end(seed: int) -> None:
    force, rng = still(seed)
    made = np.zeros(len(force), dtype=bool)
    for k, begin in enumerate(range(100, 3900, 200)):
        length = int(rng.integers(3, LONGEST - 5))
        made[begin : begin + length] = True
        force[begin : begin + length] += (-1.0) ** k * surge(length)
    found = pulses(force, np.ones(len(force), dtype=bool), resolution(force))
    assert np.array_equal(found, made)


@pytest.mark.parametrize("seed", SEEDS)
def test_bursts_of_wrong_readings_go_both_ways(seed: int) -> None:
    force, rng = still(seed)
    made = np.zeros(len(force), dtype=bool)
    for begin in range(100, 3900, 200):
        length = int(rng.integers(4, 16))
        made[begin : begin + length] = True
        force[begin : begin + length] += rng.choice([-1.0, 1.0], length) * rng.uniform(0.3, 0.8, length)
    found = pulses(force, np.ones(len(force), dtype=bool), resolution(force))
    assert np.array_equal(found, made)


@pytest.mark.parametrize("seed", SEEDS)
def test_steps_ramps_and_rings_are_none(seed: int) -> None:
    force, rng = still(seed)
    step, ramp = np.where(np.arange(4000) < 1000, 0.0, 2.0), np.clip((np.arange(4000) - 2000) / 15.0, 0.0, 1.0)
    back = -np.clip((np.arange(4000) - 2025) / 15.0, 0.0, 1.0)
    since = np.maximum(np.arange(4000) - 3000, 0)
    rings = 0.8 * np.exp(-since / 25.0) * np.sin(2 * np.pi * since / 9.0)
    noise = 0.03 * rng.standard_t(4.0, 4000)
    for motion in (step, ramp + back, rings, noise):
        assert not pulses(force + motion, np.ones(4000, dtype=bool), resolution(force + motion)).any()


@pytest.mark.parametrize("seed", range(3))
def test_the_force_of_a_pad_has_none(seed: int) -> None:
    case = draw_case(seed, (), 1.0)
    assert not pulses(case.force_N, np.ones(len(case.force_N), dtype=bool), resolution(case.force_N)).any()
