"""The surface estimate against pads of the independent simulator: its error, and whether it knows its error."""

from collections.abc import Callable

import numpy as np
import pytest

from bench.run.touchoff import air_of, find_surface, threshold_N
from tests.truth import draw
from tests.truth.motion import Path
from tests.truth.pad import simulate

SIGMA_N = 0.01
SPEED_MM_S = 0.25


def no_pull(gap_mm: np.ndarray) -> np.ndarray:
    return np.zeros_like(gap_mm)


PULLS = {
    "dies_out": lambda gap_mm: 0.1 * np.exp(-gap_mm / 0.06),
    "of_a_sphere": lambda gap_mm: 0.12 / (1.0 + gap_mm / 0.08) ** 2,
    "short": lambda gap_mm: 0.06 * np.exp(-gap_mm / 0.015),
}
"""Of adhesion, N over the gap; in contact they stay."""


def approach(seed: int, pull: Callable[[np.ndarray], np.ndarray] = no_pull) -> tuple[np.ndarray, np.ndarray, float]:
    """Positions (motor frame), noisy forces of a slow approach that stops at 0.1 N, and the true surface."""
    rng = np.random.default_rng(seed)
    pad = draw.pad(rng).pad
    surface = 1.0 + rng.uniform(-0.05, 0.05)
    motion = Path(-0.1 - rng.uniform(0, 0.05), 5000.0).to(4.0, SPEED_MM_S).motion()
    time_s = np.arange(0.0, motion.duration_s, 1 / 550)
    force = simulate(pad, motion, time_s).force_N + rng.normal(0.0, SIGMA_N, time_s.size)
    force -= pull(np.maximum(-motion.position(time_s), 0.0))
    both = np.flatnonzero((force[1:] >= 0.1) & (force[:-1] >= 0.1))
    end = int(both[0]) + 2
    return motion.position(time_s)[:end] + surface, force[:end], surface


@pytest.mark.parametrize("seeds", [range(20), pytest.param(range(20, 140), marks=pytest.mark.long)])
def test_error_and_stated_deviation_agree(seeds):
    errors, stated = [], []
    for seed in seeds:
        x, force, truth = approach(seed)
        found = find_surface(x, force, SIGMA_N)
        assert found is not None
        errors.append(found.position_mm - truth)
        stated.append(found.std_mm)
    z = np.array(errors) / np.array(stated)
    # A normal z within ±2 holds 95 %; the law near the surface is not known, so the estimate may be cautious.
    assert np.mean(np.abs(z) < 2) >= 0.90
    assert np.mean(np.abs(z) < 3) >= 0.95
    assert np.median(np.abs(errors)) < 0.02


@pytest.mark.parametrize(
    "shape", ["dies_out", *(pytest.param(s, marks=pytest.mark.long) for s in PULLS if s != "dies_out")]
)
def test_a_pad_that_pulls_begins_where_it_is_touched(shape):
    """Not where it is felt first, and not where the force is zero again."""
    errors, stated = [], []
    for seed in range(12):
        x, force, truth = approach(seed, PULLS[shape])
        found = find_surface(x, force, SIGMA_N)
        assert found is not None
        errors.append(found.position_mm - truth)
        stated.append(found.std_mm)
    z = np.array(errors) / np.array(stated)
    assert np.mean(np.abs(z) < 3) >= 0.9, z
    assert np.median(np.abs(errors)) < 0.005


@pytest.mark.long
def test_where_a_pull_is_there_at_once_the_surface_is_within_its_range():
    """It is told less well: what is soft at first is like what pulls the same over a gap."""
    errors = []
    for seed in range(12):
        x, force, truth = approach(seed, lambda gap_mm: 0.08 * (gap_mm < 0.05))
        found = find_surface(x, force, SIGMA_N)
        assert found is not None
        errors.append(found.position_mm - truth)
    assert np.max(np.abs(errors)) < 0.06
    assert np.median(np.abs(errors)) < 0.03


def test_a_wave_in_the_air_is_no_pull_and_the_doubt_knows_of_it():
    """Cogging: no shape of a pull meets it, and what none meets is doubt."""
    z, stated = [], []
    for seed in range(12):
        x, force, truth = approach(seed)
        phase = np.random.default_rng(seed + 1000).uniform(0.0, 2.0 * np.pi)
        found = find_surface(x, force + 0.04 * np.sin(2.0 * np.pi * x / 0.06 + phase), SIGMA_N)
        if found is not None:
            z.append((found.position_mm - truth) / found.std_mm)
            stated.append(found.std_mm)
    assert np.mean(np.abs(z) < 3) >= 0.9, z
    assert np.median(stated) > 0.005


@pytest.mark.parametrize("gain", [-1.0, 0.0])
def test_a_force_that_never_rises_tells_no_surface(gain):
    """A cell wired the wrong way shows a pad that pulls ever more."""
    for seed in range(6):
        x, force, truth = approach(seed)
        noise = np.random.default_rng(seed + 1000).normal(0.0, SIGMA_N, x.size)
        found = find_surface(x, gain * force + noise, SIGMA_N)
        assert found is None or found.std_mm > 0.02


def test_known_exponent_reaches_the_bound():
    """On a straight contact line, not knowing the exponent costs at most a factor 5 over who knows that it is 1."""
    rng = np.random.default_rng(5)
    x = np.linspace(0.0, 0.15, 330)
    truth, stiffness = 0.1, 2.0
    rise = np.maximum(x - truth, 0.0)
    # Level, stiffness, its growth with depth (which is estimated, and is 0 here), surface.
    jacobian = np.column_stack([np.ones_like(x), rise, rise**2, -stiffness * (rise > 0)])
    bound = SIGMA_N * np.sqrt(np.linalg.inv(jacobian.T @ jacobian)[3, 3])
    errors = []
    for _ in range(100):
        found = find_surface(x, stiffness * rise + rng.normal(0, SIGMA_N, x.size), SIGMA_N)
        assert found is not None
        errors.append(found.position_mm - truth)
    assert np.sqrt(np.mean(np.square(errors))) < 5 * bound


def test_air_of_trend_and_noise():
    rng = np.random.default_rng(1)
    t = np.arange(600) / 550
    air = air_of(t, 0.4 + 0.02 * (t - t.mean()) + rng.normal(0, SIGMA_N, t.size))
    assert air.mean_N == pytest.approx(0.4, abs=5 * SIGMA_N / np.sqrt(t.size))
    assert air.sigma_N == pytest.approx(SIGMA_N, rel=0.15)
    assert air.drift_N_s == pytest.approx(0.02, abs=0.006)


def test_threshold_is_at_least_five_sigma():
    air = air_of(np.arange(100) / 100, np.random.default_rng(2).normal(0, 0.02, 100))
    assert threshold_N(0.001, air) == 5 * air.sigma_N
    assert threshold_N(1.0, air) == 1.0


def test_quiet_cell_still_has_the_noise_of_its_steps():
    """A reading that mostly repeats itself is not noise-free: its last digit is."""
    force = np.zeros(200)
    force[::50] = 0.001
    assert air_of(np.arange(200) / 100, force).sigma_N >= 0.001 / np.sqrt(12)


def test_all_in_air_gives_no_surface():
    rng = np.random.default_rng(3)
    results = [find_surface(np.linspace(0, 1, 200), rng.normal(0, SIGMA_N, 200), SIGMA_N) for _ in range(20)]
    # Noise alone may look like a rise somewhere, but then it is told with a deviation as large as the approach.
    assert np.mean([found is None or found.std_mm > 0.02 for found in results]) >= 0.9
