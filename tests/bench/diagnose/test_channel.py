"""What the force channel shows by itself: repeats in a coarse channel, lines that are no mains hum, and what swings."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from bench.diagnose import hum, swing
from bench.diagnose.channel import faults

SAMPLE_s = 0.002
SEEDS = range(12)


def _steps(rng: np.random.Generator, step_N: float, noise_N: float) -> np.ndarray:
    """Ramps and holds between random forces, with white noise, as a coarse channel has them."""
    pieces = [np.zeros(200)]
    for _ in range(60):
        here, there = pieces[-1][-1], rng.uniform(0.5, 6.0)
        pieces += [np.linspace(here, there, 80), np.full(300, there)]
    force = np.concatenate(pieces)
    return np.round((force + noise_N * rng.standard_normal(len(force))) / step_N) * step_N


def _repeated(rng: np.random.Generator, force: np.ndarray, share: float) -> np.ndarray:
    stuck = rng.random(len(force)) < share
    stuck[0] = False
    return np.where(stuck, np.concatenate([[0.0], force[:-1]]), force)


def test_repeats_in_a_coarse_channel_are_told_by_how_often_they_come():
    """A channel with steps of its noise's size repeats itself anyway: 5 % more of it still show."""
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        clean = _steps(rng, 0.01, 0.015)
        assert not faults(clean).stuck.any()
        again = _repeated(rng, clean, 0.05)
        found = faults(again)
        assert found.stuck_share == pytest.approx(0.05, abs=0.015)
        assert found.stuck.any()
        repeats = np.concatenate([[False], again[1:] == again[:-1]])
        assert not (found.stuck & ~repeats).any()


@pytest.mark.parametrize(("frequency_Hz", "sample_s", "mains"), [
    (50.0, 0.001, True), (60.02, 0.001, True), (100.0, 0.002, True), (150.0, 0.001, True),
    (8.0, 0.001, False), (23.0, 0.001, False), (75.0, 0.001, False),
    (40.0, 0.01, True),  # 60 Hz at 100 samples a second
])  # fmt: skip
def test_a_line_is_of_the_mains_by_its_frequency_alone(frequency_Hz, sample_s, mains):
    line = hum.Line(frequency_Hz, 0.01, 0.0, 0.0, 0.0, sample_s)
    assert line.of_the_mains is mains


def test_what_sways_at_a_frequency_of_its_own_is_seen_and_noise_is_not():
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        n = 20_000
        t = SAMPLE_s * np.arange(n)
        white = rng.standard_normal(n)
        for noise in (white, lfilter([1.0], [1.0, -0.9], white), rng.standard_t(4, n), np.round(white)):
            assert swing.find(t, noise, SAMPLE_s) is None
        # an oscillator of 5 Hz and 2 % damping, pushed at random
        turn = np.exp((-0.02 + 1j) * 2.0 * np.pi * 5.0 * SAMPLE_s)
        pushes = rng.standard_normal(n) + 1j * rng.standard_normal(n)
        sway = np.real(lfilter([1.0], [1.0, -turn], pushes))
        sway *= 1.5 / sway.std()
        found = swing.find(t, white + sway, SAMPLE_s)
        assert found is not None
        assert found.frequency_Hz == pytest.approx(5.0, rel=0.1)
        assert found.share == pytest.approx(1.5**2 / (1.0 + 1.5**2), abs=0.12)
