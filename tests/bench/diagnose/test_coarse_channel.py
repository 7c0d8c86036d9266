"""A channel whose steps are larger than its noise stands, leaps by a step and stands again: none of that is a fault."""

from __future__ import annotations

import numpy as np
import pytest

from bench.diagnose.channel import faults, standing_off
from bench.diagnose.pulses import pulses

SEEDS = range(8)
STEP_N, RATE_HZ = 0.02, 250.0


def relaxing(seed: int) -> np.ndarray:
    """Force (n,) of moves of 0.3 s and holds of 4 s, in which it relaxes by a quarter."""
    rng = np.random.default_rng(seed)
    t, pieces = np.arange(0.0, 4.0, 1.0 / RATE_HZ), [np.zeros(500)]
    for peak in rng.uniform(0.5, 6.0, 12):
        pieces += [np.linspace(pieces[-1][-1], peak, 75), peak * (0.75 + 0.25 * np.exp(-t / 1.5))]
    return np.concatenate(pieces)


def read(force: np.ndarray, noise_steps: float, seed: int) -> np.ndarray:
    noise = noise_steps * STEP_N * np.random.default_rng([seed, 1]).standard_normal(len(force))
    return np.round((force + noise) / STEP_N) * STEP_N


@pytest.mark.parametrize("noise_steps", [0.1, 0.15, 0.25, 0.4])
def test_a_value_that_stands_in_a_hold_neither_sticks_nor_stands_off(noise_steps):
    for seed in SEEDS:
        force = relaxing(seed)
        said = read(force, noise_steps, seed)
        found, every = faults(said), np.ones(len(force), dtype=bool)
        assert not found.stuck.any() and not found.outlier.any()
        assert not standing_off(said - force, every, ~every, STEP_N).any()
        assert not pulses(said - force, every, STEP_N).any()


def test_a_channel_that_stays_for_moves_and_catches_up_has_stuck():
    for seed in SEEDS:
        said = read(relaxing(seed), 0.15, seed)
        begin = 500 + 4 * 1075 - 600  # within a hold, over the next move, into the hold after it
        said[begin : begin + 1100] = said[begin - 1]
        stuck = faults(said).stuck
        assert stuck[begin + 5 : begin + 1100].all() and not stuck[begin + 1100 :].any()
