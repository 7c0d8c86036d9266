"""Noise that is louder in motion, or at times, is told, and nothing else is taken for it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from bench.diagnose import diagnose
from bench.diagnose.louder import Loudness, loudness
from bench.diagnose.words import lines
from bench.recording.types import Measurement
from sim.model import Model
from tests.bench.diagnose.small import measurement
from tests.truth.cases import Case, draw_case

SEEDS = range(12)
NOISE_N = 0.005


def quiet(seed: int, ids: tuple[str, ...] = (), shape: str = "", **told: object) -> Case:
    told = {"rate_hz": 500.0, "jitter": "none", "position_noise_mm": 0.0, "protocol": "rate_sweep"} | told
    return draw_case(seed, ids, 1.0, shape, **told) if shape else draw_case(seed, ids, **told)


def shaken(case: Case, seed: int, times: float) -> Measurement:
    """The case's force without its noise, and noise that is `times` as loud above 1 mm/s as at rest."""
    clean = np.asarray(case.truth.clean_N)
    m = measurement(case)
    speed = np.abs(np.gradient(m.position_mm, m.position_time_s))
    noise = NOISE_N * (1.0 + (times - 1.0) * np.clip(speed, 0.0, 1.0))
    return replace(m, force_N=clean + noise * np.random.default_rng([seed, 3]).standard_normal(clean.size))


def pumped(case: Case, seed: int, times: float) -> Measurement:
    """The case's force without its noise, and noise that is `times` as loud for 4 of 9 s as for the rest."""
    clean = np.asarray(case.truth.clean_N)
    m = measurement(case)
    noise = NOISE_N * np.where((m.force_time_s + 2.0 * seed) % 9.0 < 4.0, times, 1.0)
    return replace(m, force_N=clean + noise * np.random.default_rng([seed, 6]).standard_normal(clean.size))


def heard(m: Measurement) -> Loudness:
    return loudness(m, np.ones(len(m.force_N), dtype=bool))


def told(m: Measurement) -> float:
    """By how much it is louder in motion; at rest it must be as loud at all times."""
    out = heard(m)
    assert np.ptp(out.in_time) == 0.0
    return float(out.in_motion.max())


@pytest.mark.parametrize("times", [2.0, 3.0])
def test_how_much_louder_it_is_in_motion(times: float) -> None:
    """Within a fifth in ten of twelve runs, and never by half more than it is."""
    found = np.array([told(shaken(quiet(seed), seed, times)) for seed in SEEDS])
    assert np.mean(np.abs(found / times - 1.0) < 0.2) >= 10 / 12
    assert found.max() < 1.5 * times


@pytest.mark.parametrize("times", [2.0, 3.0])
def test_how_much_louder_it_is_at_times(times: float) -> None:
    """Within a fifth in eleven of twelve runs."""
    found = np.array([heard(pumped(quiet(seed), seed, times)).loud_over_quiet for seed in SEEDS])
    assert np.mean(np.abs(found / times - 1.0) < 0.2) >= 11 / 12


@pytest.mark.parametrize("kind", ["white", "coloured", "quantised", "heavy"])
def test_noise_of_other_kinds_is_as_loud_everywhere(kind: str) -> None:
    for seed in SEEDS:
        assert told(measurement(quiet(seed, noise_kind=kind, position_noise_mm=0.001))) == 1.0


@pytest.mark.parametrize(
    ("ids", "most"),
    [
        (("friction", "inertia", "sensor_lag"), 1),
        pytest.param(("cogging", "encoder_error", "resonance", "mains_hum"), 0, marks=pytest.mark.long),
    ],
)
def test_hardly_any_cause_that_acts_with_the_motion_is_noise(ids: tuple[str, ...], most: int) -> None:
    """One of 84 at the most: a mass on a spring may ring as fast as samples come."""
    loud = sum(told(measurement(quiet(seed, (id,), noise_kind="white"))) > 1.0 for id in ids for seed in SEEDS)
    assert loud <= most


def test_a_force_that_is_felt_at_uncertain_times_is_no_louder() -> None:
    """It scatters with the force's own rate."""
    for seed in SEEDS:
        case = quiet(seed)
        m, clean = measurement(case), np.asarray(case.truth.clean_N)
        rng = np.random.default_rng([seed, 4])
        late = m.force_time_s + 0.004 * rng.uniform(-1.0, 1.0, len(clean))
        force = np.interp(late, m.force_time_s, clean) + NOISE_N * rng.standard_normal(len(clean))
        assert told(replace(m, force_N=force)) == 1.0


@pytest.mark.parametrize(
    ("make", "words"),
    [(shaken, "as noisy in motion"), pytest.param(pumped, "as noisy as at others", marks=pytest.mark.long)],
)
def test_it_is_no_cause_and_is_said(make: Callable[[Case, int, float], Measurement], words: str) -> None:
    consistent = 0
    for seed in range(3):
        case = quiet(seed)
        d = diagnose(make(case, seed, 2.5), Model.from_dict(case.believed))
        consistent += d.verdict == "consistent"
        assert any(words in line for line in lines(d))
    assert consistent == 3
