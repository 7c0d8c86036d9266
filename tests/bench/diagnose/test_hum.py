"""Mains hum found in holds: bursts of whole waves, and hum that is always there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from bench.diagnose import diagnose
from bench.diagnose.data import prepare
from bench.diagnose.diagnose import believed_structure
from bench.diagnose.hum import Line, find
from bench.diagnose.needed import _with_hum
from bench.diagnose.noise import Part
from bench.diagnose.refit import onto, refit
from sim.model import Model
from tests.bench.diagnose.small import measurement
from tests.truth.cases import draw_case

Array = np.ndarray


def hummed(fed: Array, rng: np.random.Generator, rate_hz: float = 700.0) -> tuple[Array, Array, Array, list[Part]]:
    """(stamps, hum, force with noise of 10 mN, holds of 4 s): 40 mN at 50.02 Hz, its waves fed or not by turns."""
    t = np.arange(0.0, 48.0, 1.0 / rate_hz)
    turns = 50.02 * t + 0.3
    hum = 0.04 * np.sin(2 * np.pi * turns) * fed[np.floor(turns).astype(int) % len(fed)]
    force = 2.0 + hum + 0.01 * rng.standard_normal(t.size)
    holds = [(t >= k) & (t < k + 4.0) for k in np.arange(1.0, 47.0, 6.0)]
    return t, hum, force, [(t[h], force[h] - 2.0, float(force[h].mean())) for h in holds]


@pytest.mark.parametrize("seed", range(4))
def test_bursts_of_whole_waves_are_found_with_their_period(seed):
    fed = np.arange(37) < 21
    t, hum, force, parts = hummed(np.roll(fed, 5 + seed), np.random.default_rng(seed))
    line = find(0.0, parts, t, force)
    assert line is not None and line.bursts[:2] == (37, 21)
    assert line.amplitude_N == pytest.approx(0.04 * 21 / 37, rel=0.05)
    assert np.sqrt(np.mean((line.force_N(t, force) - hum) ** 2)) < 0.1 * 0.04


@pytest.mark.parametrize("seed", range(4))
def test_hum_that_is_always_there_comes_in_no_bursts(seed):
    t, _, force, parts = hummed(np.ones(1), np.random.default_rng(seed))
    line = find(0.0, parts, t, force)
    assert line is not None and not line.bursts and line.amplitude_N == pytest.approx(0.04, rel=0.05)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("rate_hz", [250.0, 300.0, 350.0])
def test_a_sine_has_no_harmonics_where_they_would_be_folded_beside_it(rate_hz, seed):
    t, hum, force, parts = hummed(np.ones(1), np.random.default_rng(seed), rate_hz)
    line = find(0.0, parts, t, force)
    assert line is not None
    assert (line.ratio, line.higher, line.fires_rad) == (0.0, (), 0.0)
    assert np.sqrt(np.mean((line.force_N(t, force) - hum) ** 2)) < 0.02 * 0.04


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, *(pytest.param(s, marks=pytest.mark.long) for s in (2, 3, 4, 5, 6))])
def test_how_sure_the_numbers_of_a_dimmer_are_is_told(seed):
    """Their edges lie between samples: an edge without length would leave open when they come, and all with it."""
    c = draw_case(seed, ("mains_hum",), 0.7, "dimmer", protocol="staircase", rate_hz=390.0)
    found = diagnose(measurement(c), Model.from_dict(c.believed)).causes[0]
    amplitude_N, told = c.truth.parameters["mains_hum"]["amplitude"], found.parameters["amplitude"]
    assert (found.id, found.form) == ("mains_hum", "dimmed")
    assert 0.0 < told.std < 0.05 * amplitude_N
    assert told.value == pytest.approx(amplitude_N, rel=0.05)
    assert 1e-4 < found.parameters["fires"].std < 0.1


@pytest.mark.parametrize("seed", range(3))
def test_what_swings_in_the_holds_alone_is_no_hum(seed):
    """A ceiling ripples, and where the force is at it in the holds a line is found there."""
    for size_N, hummed in ((0.02, True), (0.0, False)):
        c = draw_case(seed, (), protocol="staircase", rate_hz=300.0, noise_N=0.005)
        m = measurement(c)
        line = Line(50.0, 0.02, 0.3, 0.0, 0.0)
        m = replace(m, force_N=m.force_N + size_N * np.sin(2 * np.pi * 50.0 * m.force_time_s + 0.3))
        prepared = prepare(m, np.ones(len(m.force_N), dtype=bool))
        structure = believed_structure(Model.from_dict(c.believed), prepared)
        fit = refit(prepared.short, structure, structure.x(structure.pad.x()), 30, 1e-8)
        found = _with_hum(prepared, onto(fit, prepared.full), line)
        assert (found is not None) == hummed
        if found is not None:
            assert found.structure.values(found.x)[-1]["amplitude"] == pytest.approx(size_N, rel=0.1)


@pytest.mark.parametrize("seed", [0, *(pytest.param(s, marks=pytest.mark.long) for s in (1, 2, 3))])
def test_hum_by_a_clock_that_wanders_is_found_once_the_clock_is_known(seed: int) -> None:
    """Its stamps smear the line, and what is found of it is little."""
    m = measurement(draw_case(seed, (), noise_kind="white", noise_N=0.004, rate_hz=400.0, own_clock=False))
    t, rng = m.force_time_s, np.random.default_rng(seed)
    u, (one, other) = t / t[-1], rng.uniform(0, 6, 2)
    stamps = t + 0.03 * u * (np.sin(5 * np.pi * u + one) + np.sin(11 * np.pi * u + other))
    hum = 0.003 * np.sin(2 * np.pi * 50.0 * t + 1.0)
    m = replace(m, force_time_s=stamps, force_N=m.force_N + hum)

    def left(felt_at: Callable[[Array], Array] | None) -> float:
        told = prepare(m, np.ones(len(t), dtype=bool), felt_at)
        assert felt_at is None or told.mains is not None
        return float(np.std(hum[told.kept] - told.hum_N[told.at]) / np.std(hum))

    assert left(None) > 0.8
    assert left(lambda stamp_s: np.interp(stamp_s, stamps, t)) < 0.2
