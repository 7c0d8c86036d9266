"""Shapes that mains hum takes: each against its closed form."""

import math

import numpy as np
from numpy.testing import assert_allclose

from sim.effects.mains_hum import RISE_RAD, first_of_dimmed, let_through
from tests.sim.effect_tools import active, sense


def test_hum_of_a_dimmer() -> None:
    t = np.arange(20_000) * 1e-5
    for fires in (0.5, 1.3, 2.4):
        hum = active("mains_hum", "dimmed", amplitude=0.1, frequency=50.0, phase=0.7, fires=fires)
        out = sense(hum, t, np.zeros(t.size))
        wave = np.sin(2 * math.pi * 50 * t + 0.7)
        since = (2 * math.pi * 50 * t + 0.7) % math.pi - fires
        dark, lit = since < 0.0, since > RISE_RAD
        assert np.all(out[dark] == 0.0) and np.ptp(out[lit] / wave[lit]) < 1e-9
        assert 0.9e-4 < RISE_RAD / (2 * math.pi * 55) < 1.3e-4, "of a tenth of a millisecond"
        assert_allclose(np.abs(np.fft.rfft(out))[10] / 10_000, 0.1, rtol=5e-3)
        angle = (np.arange(100_000) + 0.5) / 100_000 * 2 * math.pi
        cut = np.sin(angle) * let_through(angle, fires)
        assert_allclose(
            first_of_dimmed(fires), [2 * np.mean(cut * np.sin(angle)), 2 * np.mean(cut * np.cos(angle))], atol=1e-4
        )


def test_hum_in_bursts() -> None:
    t = np.arange(0.0, 2.0, 1e-4)
    hum = active("mains_hum", "bursts", amplitude=0.03, frequency=50.0, phase=0.5, waves=20, fed=12, first=3)
    wave = sense(hum, t, np.zeros(t.size))
    turns = 50.0 * t + 0.5 / (2 * math.pi)
    on = np.isin(np.floor(turns) % 20, np.arange(3, 15))
    assert_allclose(wave, np.where(on, 0.05 * np.sin(2 * math.pi * turns), 0.0), atol=1e-6)
    first = abs(np.mean(2 * wave * np.exp(-2j * math.pi * 50.0 * t)))
    assert_allclose(first, 0.03, rtol=0.01)


def test_hum_with_all_its_harmonics() -> None:
    t = np.arange(20_000) * 1e-5
    names = ("second", "third", "fourth", "fifth", "sixth", "seventh")
    shares = dict(zip(names, (0.5, 0.2, 0.0, 0.1, 0.05, 0.3), strict=True))
    phases = {f"{name}_phase": 0.3 * k for k, name in enumerate(names)}
    hum = active("mains_hum", "distorted", amplitude=0.1, frequency=50.0, phase=0.7, **shares, **phases)
    spectrum = np.fft.rfft(sense(hum, t, np.zeros(t.size))) / 10_000
    assert_allclose(np.abs(spectrum[10:80:10]), 0.1 * np.array([1.0, *shares.values()]), atol=1e-9)
    assert_allclose(np.angle(spectrum[[20, 70]]) + math.pi / 2, [0.0, 1.5], atol=1e-6)
