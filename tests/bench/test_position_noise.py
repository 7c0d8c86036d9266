"""How noisy positions are: of noise with a memory what counts is how means over many samples scatter."""

import numpy as np
import pytest

from bench.identify.motion import jitter
from bench.position_noise import position_noise
from tests.truth.noise import Coloured

STEP_S = 1e-3
NOISE_MM = 1.5e-3


def staircase(n: int) -> np.ndarray:
    """Holds of 700 samples (n,), with moves of 40 between them, mm."""
    k = np.arange(n)
    return 0.3 * (k // 740 + np.minimum(k % 740 / 40.0, 1.0))


def noise_of(kept: float, n: int, rng: np.random.Generator) -> np.ndarray:
    """Noise (n,) of which a share is kept from sample to sample, mm."""
    return Coloured(NOISE_MM, -STEP_S / np.log(kept)).draw(STEP_S * np.arange(n), rng)


@pytest.mark.parametrize("seed", range(10))
def test_noise_without_memory_is_as_loud_as_its_samples(seed: int) -> None:
    x = staircase(6000) + NOISE_MM * np.random.default_rng(seed).standard_normal(6000)
    assert position_noise(x).of_means_mm == position_noise(x).each_mm == jitter(x) == pytest.approx(NOISE_MM, rel=0.1)


@pytest.mark.parametrize("kept", [0.4, 0.6, 0.75, 0.85])
def test_noise_with_a_memory_is_as_loud_as_its_means(kept: float) -> None:
    """Means over 600 samples scatter by σ √((1 + ρ)/(1 − ρ)) / √600, less what is lost where no hold is seen."""
    noise = [position_noise(staircase(8000) + noise_of(kept, 8000, np.random.default_rng(seed))) for seed in range(10)]
    wanted, told = NOISE_MM * np.sqrt((1.0 + kept) / (1.0 - kept)), [one.of_means_mm for one in noise]
    assert np.median([one.each_mm for one in noise]) == pytest.approx(NOISE_MM, rel=0.05)
    assert np.median(told) == pytest.approx(wanted, rel=0.08)
    assert np.all(np.abs(np.log(np.array(told) / wanted)) < 0.4)


@pytest.mark.parametrize("many", [2, 3, 5, 8])
def test_moving_means_are_as_loud_as_what_they_are_of(many: int) -> None:
    """An encoder that reports the mean of its last readings: in nine of ten draws within an eighth."""
    near = 0
    for seed in range(10):
        white = np.sqrt(many) * NOISE_MM * np.random.default_rng([seed, many]).standard_normal(8000 + many - 1)
        noise = position_noise(staircase(8000) + np.convolve(white, np.ones(many) / many, "valid"))
        each, of_means = noise.each_mm / NOISE_MM, noise.of_means_mm / (np.sqrt(many) * NOISE_MM)
        near += abs(each - 1.0) < 0.125 and abs(of_means - 1.0) < 0.125
    assert near >= 9


@pytest.mark.parametrize("seed", range(8))
def test_a_few_short_holds_tell_of_a_memory(seed: int) -> None:
    """Ten holds of 125 samples amid moves as long: within a third, and most of the draws far nearer."""
    k = np.arange(2500)
    x = 0.3 * (k // 250 + np.minimum(k % 250 / 125.0, 1.0))
    noise = position_noise(x + noise_of(0.8, 2500, np.random.default_rng(seed)))
    assert noise.of_means_mm == pytest.approx(3.0 * NOISE_MM, rel=1.0 / 3.0)


@pytest.mark.parametrize("seed", range(5))
def test_a_servo_that_swings_is_no_noise(seed: int) -> None:
    """It is motion, which the pad feels."""
    t = STEP_S * np.arange(6000)
    x = staircase(6000) + 2.0 * NOISE_MM * np.sin(2.0 * np.pi * 60.0 * t)
    x += NOISE_MM * np.random.default_rng(seed).standard_normal(6000)
    assert position_noise(x).of_means_mm == jitter(x)
