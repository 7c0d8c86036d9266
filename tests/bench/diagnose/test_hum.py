"""Lines found in holds: which are mains hum, how they are shaped, in bursts of whole waves, and always there."""

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
from bench.diagnose.words import lines
from bench.recording.types import Measurement
from sim.model import Model
from tests.bench.diagnose.small import measurement
from tests.bench.diagnose.test_few import PAD
from tests.truth.cases import draw_case
from tests.truth.motion import staircase
from tests.truth.pad import simulate

Array = np.ndarray

SEEDS = range(12)


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


@pytest.mark.parametrize(("frequency_Hz", "sample_s", "mains"), [
    (50.0, 0.001, True), (60.02, 0.001, True), (100.0, 0.002, True), (150.0, 0.001, True),
    (8.0, 0.001, False), (23.0, 0.001, False), (75.0, 0.001, False),
    (40.0, 0.01, True),  # 60 Hz at 100 samples a second
    (9.95, 0.02, True),  # 59.95 Hz at 50
    (45.2, 0.005, False), (24.6, 0.02, False),  # of 124.6 Hz at the nearest: no large grid is so far off
])  # fmt: skip
def test_a_line_is_of_the_mains_by_its_frequency_alone(frequency_Hz, sample_s, mains):
    line = Line(frequency_Hz, 0.01, 0.0, 0.0, 0.0, sample_s)
    assert line.of_the_mains is mains


def _holds(stamp_s: np.ndarray, error_N: np.ndarray, length: int) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Parts as of holds of so many samples with nothing between them, and no curve taken out."""
    cuts = range(0, len(stamp_s) - length + 1, length)
    return [(stamp_s[k : k + length], error_N[k : k + length], np.zeros((length, 0))) for k in cuts]


@pytest.mark.parametrize(("frequency_Hz", "rate_Hz", "jitter"), [
    (60.0, 114.0, 0.02), (60.0, 114.0, 0.0), (49.98, 103.0, 0.0), (60.0, 100.0, 0.02), (50.03, 1000.0, 0.1),
    (100.0, 130.0, 0.02),
])  # fmt: skip
def test_a_line_is_found_at_the_mains_own_frequency_however_it_is_folded(frequency_Hz, rate_Hz, jitter):
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        t = (np.arange(4000) + jitter * rng.standard_normal(4000)) / rate_Hz
        t -= t[0]
        e = 0.02 * np.sin(2 * np.pi * frequency_Hz * t + 0.3) + 0.01 * rng.standard_normal(len(t))
        line = find(0.0, _holds(t, e, 500), t, e)
        assert line is not None
        assert line.frequency_Hz == pytest.approx(frequency_Hz, abs=0.01)
        assert line.amplitude_N == pytest.approx(0.02, rel=0.05)
        assert line.growth_1_N == 0.0


def test_a_line_that_grows_with_the_load_is_stated_at_the_mean_force():
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        t = np.arange(8000) / 500.0
        load = np.repeat([0.0, 2.0, 4.0, 10.0], 2000)
        e = 0.02 * (0.7 + 0.1 * load) * np.sin(2 * np.pi * 50.0 * t) + 0.01 * rng.standard_normal(len(t))
        line = find(0.0, _holds(t, e, 1000), t, load + e)
        assert line is not None
        assert line.amplitude_N == pytest.approx(0.02 * 1.1, rel=0.05)
        assert line.growth_1_N * line.amplitude_N == pytest.approx(0.002, rel=0.15)
        assert np.std(e - line.force_N(t, load)) == pytest.approx(0.01, rel=0.03)


@pytest.mark.parametrize(
    "shape",
    [
        "wanders with its harmonics",
        *(
            pytest.param(s, marks=pytest.mark.long)
            for s in ("sine", "odd harmonics", "one way", "swells", "wanders", "let through late")
        ),
    ],
)
def test_the_shape_of_a_line_is_found_and_not_more_than_that(shape):
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        t = np.arange(36_500) / 730.0
        slow = np.sin(2 * np.pi * t / 23.0 + 0.4)
        swells = 1.0 + (0.3 * slow if shape == "swells" else 0.0)
        angle = 2 * np.pi * 50.0 * t + (0.4 * slow if shape.startswith("wanders") else 0.0)
        tops = np.sin(3 * angle) / 5 - np.sin(5 * angle + 0.2) / 10 if "harmonics" in shape else 0.0
        clean = 0.03 * (swells * np.sin(angle + 0.5) + tops)
        if shape == "one way":  # a rectifier of half waves, from a quarter of the crest on
            clean = 0.06 * np.maximum(np.sin(angle + 0.5) - 0.25, 0.0)
            clean -= np.mean(clean)
        if shape == "let through late":
            mains = 2 * np.pi * 50.0 * t + 2.1
            clean = 0.03 * np.sin(mains) * (mains % np.pi > 1.2)
        e = clean + 0.01 * rng.standard_normal(len(t))
        line = find(0.0, _holds(t, e, 4500), t, e)
        assert line is not None
        assert bool(line.swing) == (shape == "swells" or shape.startswith("wanders"))
        others = {
            "odd harmonics": [5],
            "wanders with its harmonics": [5],
            "one way": [2, 4, 5, 7],
        }  # its sixth is 0.01 of the noise
        assert [order for order, _, _ in line.higher] == others.get(shape, [])
        assert line.growth_1_N == 0.0
        assert line.fires_rad == pytest.approx(1.2 if shape == "let through late" else 0.0, abs=0.05)
        assert np.std(line.force_N(t, np.zeros(len(t))) - clean) < 1.5e-3


@pytest.mark.long
def test_a_line_is_told_by_the_times_at_which_forces_were_felt():
    """A clock that gains 200 microseconds a second turns a hum by half a wave within a minute of its stamps."""
    for seed in (1, 2):
        kinds = {"protocol": "staircase", "noise_kind": "white", "own_clock": True}
        c = draw_case(seed, ("clock_skew", "mains_hum"), 1.0, rate_hz=240.0, **kinds)
        found = {cause.id: cause for cause in diagnose(measurement(c), Model.from_dict(c.believed)).causes}
        for name, true in c.truth.parameters["mains_hum"].items():
            assert found["mains_hum"].parameters[name].value == pytest.approx(true, rel=0.02)
        assert found["clock_skew"].parameters["skew"].value == pytest.approx(
            c.truth.parameters["clock_skew"]["skew"], rel=0.1
        )


@pytest.mark.parametrize("seed", [1, 2])
def test_hum_at_half_the_rate_is_named_or_said_to_be_unseen(seed: int) -> None:
    """49.97 Hz at 100 samples a second turn their sign with each sample, as noise may: what would tell it is said."""
    rng = np.random.default_rng(seed)
    motion = staircase([0.6, 1.2, 1.8, 0.9], 10.0, 8.0)
    t = np.arange(0.0, motion.duration_s, 0.01)
    clean = simulate(PAD, motion, t).force_N + 0.005 * rng.standard_normal(len(t))
    for hum_N in (0.0, 0.03):
        force = clean + hum_N * np.sin(2 * np.pi * 49.97 * t + rng.uniform(0, 6))
        d = diagnose(Measurement("mains", t, motion.position(t), t, force), Model.from_dict(PAD.model()))
        said = any("half the rate of the samples" in line for line in lines(d))
        named = [c.parameters["frequency"].value for c in d.causes if c.id == "mains_hum"]
        assert said == (hum_N > 0 and not named)
        # folded, 49.97 and 50.03 Hz are one frequency, and thrice the mains is no likelier
        assert all(abs(f - 50.0) < 0.05 for f in named)
