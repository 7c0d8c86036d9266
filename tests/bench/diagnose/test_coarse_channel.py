"""A channel whose steps are larger than its noise stands, leaps by a step and stands again: none of that is a fault."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.diagnose import diagnose
from bench.diagnose.channel import faults, standing_off
from bench.diagnose.coarse import coarse_repeats, noise_steps, rounded
from bench.diagnose.pulses import pulses
from sim.model import Model
from tests.bench.diagnose.small import measurement
from tests.truth.cases import draw_case
from tests.truth.motion import Path

SEEDS = range(8)
STEP_N, RATE_HZ = 0.02, 250.0


def relaxing(seed: int) -> np.ndarray:
    """Force (n,) of moves of 0.3 s and holds of 4 s, in which it relaxes by a quarter."""
    rng = np.random.default_rng(seed)
    t, pieces = np.arange(0.0, 4.0, 1.0 / RATE_HZ), [np.zeros(500)]
    for peak in rng.uniform(0.5, 6.0, 12):
        pieces += [np.linspace(pieces[-1][-1], peak, 75), peak * (0.75 + 0.25 * np.exp(-t / 1.5))]
    return np.concatenate(pieces)


def read(force: np.ndarray, steps: float, seed: int) -> np.ndarray:
    noise = steps * STEP_N * np.random.default_rng([seed, 1]).standard_normal(len(force))
    return np.round((force + noise) / STEP_N) * STEP_N


@pytest.mark.parametrize("steps", [0.1, 0.15, 0.25, 0.4])
def test_a_value_that_stands_in_a_hold_neither_sticks_nor_stands_off(steps):
    for seed in SEEDS:
        force = relaxing(seed)
        said = read(force, steps, seed)
        found, every = faults(said), np.ones(len(force), dtype=bool)
        assert not found.stuck.any() and not found.outlier.any()
        assert not standing_off(said - force, every, ~every, STEP_N).any()
        assert not pulses(said - force, every, STEP_N).any()


def test_a_channel_whose_noise_is_many_steps_does_not_stick():
    """A cell's millinewtons under noise of ten: changes of one to four steps are as many as each other but for chance,
    which tells nothing of how far they scatter."""
    time_s = np.arange(18000) / 549.0
    force = 4.0 * np.abs(np.sin(0.4 * time_s)) * (time_s > 3.0)
    none = np.zeros(len(force), dtype=bool)
    noise = (0.01 * np.random.default_rng(seed).standard_normal(len(force)) for seed in range(1000))
    assert not any(coarse_repeats(np.round(force + n, 3), none)[0].any() for n in noise)


def test_a_channel_that_stays_for_moves_and_catches_up_has_stuck():
    for seed in SEEDS:
        said = read(relaxing(seed), 0.15, seed)
        begin = 500 + 4 * 1075 - 600  # within a hold, over the next move, into the hold after it
        said[begin : begin + 1100] = said[begin - 1]
        stuck = faults(said).stuck
        assert stuck[begin + 5 : begin + 1100].all() and not stuck[begin + 1100 :].any()


@pytest.mark.parametrize("steps", [0.15, 0.3, 0.5, 0.8])
@pytest.mark.parametrize("seed", range(5))
def test_noise_below_a_step_is_told_where_the_force_moves(steps, seed):
    """Within three tenths; two seconds of rest at either end say nothing of it."""
    rng = np.random.default_rng(seed)
    levels = [0.0, 0.0, *rng.uniform(0.0, 60.0, 12), 0.0, 0.0]
    force = np.interp(np.arange(12000) / 12000 * (len(levels) - 1), np.arange(len(levels)), levels)
    said = 0.02 * np.round(force + steps * rng.standard_normal(len(force)))
    assert noise_steps(said, 0.02) == pytest.approx(steps, rel=0.3)


def test_nothing_tells_of_the_noise_of_a_coarse_channel_at_rest():
    assert np.isnan(noise_steps(np.zeros(1000), 0.02))
    assert rounded(np.zeros(1000), 0.02) == pytest.approx(0.02 / np.sqrt(12.0))


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, *(pytest.param(s, marks=pytest.mark.long) for s in (2, 3, 4, 5, 6))])
def test_a_force_that_stands_in_a_wide_step_is_not_stuck(seed):
    """Pressed to and fro without end most neighbours differ; where the axis rests, noise of a fifth of a step is
    nowhere near its edges."""
    path = Path(-0.5, 3000.0).hold(2.0)
    for _ in range(6):
        path = path.to(3.0, 1.5).hold(0.4).to(-0.3, 1.5)
    c = draw_case(seed, (), motion=path.hold(2.0).motion(), rate_hz=300.0, position_noise_mm=0.0002, jitter="none")
    step_N = 0.004 * float(np.abs(c.truth.clean_N).max())
    noise_N = 0.2 * step_N * np.random.default_rng(seed).standard_normal(len(c.force_N))
    m = replace(measurement(c), force_N=step_N * np.round((c.truth.clean_N + noise_N) / step_N))
    d = diagnose(m, Model.from_dict(c.believed))
    assert d.verdict == "consistent" and not any(mask.any() for mask in d.flags.values())


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("noise", [0.0, 0.2, 0.4, 0.6], ids=lambda noise: f"noise of {noise} steps")
def test_bad_frames_show_in_a_channel_of_which_most_values_are_their_neighbours_middle(noise, seed):
    """Then no tail of the noise is foretold; and a channel as coarse without bad frames has none."""
    rng = np.random.default_rng(seed)
    t = np.arange(6000) / 300.0
    force_steps = 60.0 * np.clip(np.sin(0.6 * t), 0.0, 0.7) + noise * rng.standard_normal(t.size)
    channel_N = 0.008 * np.round(force_steps)
    assert not faults(channel_N).outlier.any()
    bad = rng.choice(t.size, 40, replace=False)
    channel_N[bad] = -10.5
    found = faults(channel_N).outlier
    assert found[bad].mean() > 0.9 and found.sum() <= len(bad)
