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


@pytest.mark.parametrize("seed", range(5))
def test_a_servo_that_swings_is_no_noise(seed: int) -> None:
    """It is motion, which the pad feels."""
    t = STEP_S * np.arange(6000)
    x = staircase(6000) + 2.0 * NOISE_MM * np.sin(2.0 * np.pi * 60.0 * t)
    x += NOISE_MM * np.random.default_rng(seed).standard_normal(6000)
    assert position_noise(x).of_means_mm == jitter(x)
