"""The noise floor: what is noise in the holds, and what only looks like it."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from bench.diagnose import swing
from bench.diagnose.channel import faults
from bench.diagnose.diagnose import _apart
from bench.diagnose.noise import Colour, _about_curve, _matched, force_noise
from bench.recording.types import Measurement
from tests.truth.cases import Case, draw_case

SEEDS = (1, 2, 3)


def _told(case: Case) -> float:
    """Noise told over noise put in."""
    assert case.force_time_s is None
    time, first = np.unique(case.time_s, return_index=True)
    force = case.force_N[first]
    m = Measurement("case", time, case.position_mm[first], time, force)
    return force_noise(m, faults(force).good).force_N / case.truth.noise.std


@pytest.mark.parametrize(
    "kind", ["coloured", "quantised", *(pytest.param(k, marks=pytest.mark.long) for k in ("white", "heavy"))]
)
def test_noise_of_any_kind_is_told_by_the_holds(kind):
    for seed in SEEDS:
        assert _told(draw_case(seed, (), noise_kind=kind, own_clock=False)) == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("width", [3, *(pytest.param(w, marks=pytest.mark.long) for w in (5, 7, 12))])
def test_noise_of_a_running_mean_forgets_all_at_once(width: int) -> None:
    """It has less power than what fades has where that is slow, which would be taken for something beside the noise."""
    told = []
    for seed in range(40):
        rng, parts = np.random.default_rng(seed), []
        for _ in range(int(rng.integers(8, 25))):
            n = int(rng.integers(80, 1000))
            e = np.convolve(rng.standard_normal(n + width - 1), np.full(width, 1.0 / np.sqrt(width)), "valid")
            parts.append(_about_curve(0.0025 * np.arange(n), e))
        told.append(_matched(parts, 0.0025).air_N)
    assert np.mean(np.abs(np.array(told) - 1.0) < 0.1) >= 0.95


@pytest.mark.parametrize("seed", SEEDS)
def test_where_no_part_of_a_hold_is_as_calm_as_the_others_all_of_it_is_noise(seed: int) -> None:
    """One part is loud from sample to sample, one over some, one over many: once nothing was left to tell noise by."""
    rng = np.random.default_rng(seed)
    e = 0.2 * rng.standard_normal(1200)
    e[:400] *= 12.0
    e[400:800] += 3.0 * np.repeat(rng.standard_normal(50), 8)
    e[800:] += 3.0 * np.repeat(rng.standard_normal(7), 64)[:400]
    noise = _matched([_about_curve(0.001 * np.arange(1200), e)], 0.001)
    assert 0.5 < noise.air_N / float(np.std(e)) < 2.0


def _flicker(rng: np.random.Generator, n: int, sample_s: float, from_Hz: float) -> np.ndarray:
    """Unit noise (n,) of a power of 1/f from a frequency on, and even below: a cosine of random size and phase at each
    frequency of a record eight times as long."""
    f = np.fft.rfftfreq(8 * n, sample_s)
    size = 1.0 / np.sqrt(np.maximum(f, from_Hz))
    size[0] = 0.0
    noise = np.fft.irfft(size * (rng.standard_normal(len(f)) + 1j * rng.standard_normal(len(f))))
    return noise[:n] * 8 * n / (2.0 * np.sqrt(np.sum(size**2)))


def _told_of_flicker(from_Hz: tuple[float, float]) -> np.ndarray:
    """Noise told over noise put in, of 20 runs of ten holds of 0.5 to 2.5 s."""
    told = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        n, begins_Hz, white = 12_000, float(rng.uniform(*from_Hz)), float(rng.uniform(0.0, 0.6))
        noise = np.sqrt(1 - white) * _flicker(rng, n, 0.0025, begins_Hz) + np.sqrt(white) * rng.standard_normal(n)
        ends = np.cumsum(rng.integers(200, 1000, 12))
        parts = [
            _about_curve(0.0025 * np.arange(e - b), noise[b:e]) for b, e in zip(ends, ends[1:], strict=False) if e < n
        ]
        told.append(_matched(parts, 0.0025).air_N)
    return np.array(told)


def test_noise_of_as_much_power_in_each_octave_is_told() -> None:
    """As of an amplifier for direct current: one memory is far from it, which was a structure of the holds then."""
    assert np.mean(np.abs(_told_of_flicker((0.02, 0.1)) - 1.0) < 0.1) >= 0.9


def test_noise_that_holds_are_too_short_to_see_the_end_of_is_taken_to_go_on() -> None:
    """More noise than there is finds less; a diagnosis lowers it to what its model leaves."""
    told = _told_of_flicker((1.0, 4.0))
    assert np.mean(told > 0.9) >= 0.95 and told.max() < 1.5


@pytest.mark.parametrize(("id", "shape"), [
    pytest.param("knocks", "thump", marks=pytest.mark.long),  # in some holds, for a while
    pytest.param("knocks", "table", marks=pytest.mark.long),
    ("rocking_bench", "one_way"),  # swings after each move, at a few Hz
    pytest.param("rocking_bench", "two_ways", marks=pytest.mark.long),
    pytest.param("loose_cable", "two_level", marks=pytest.mark.long),  # jumps
    pytest.param("probe_tilt", "reseats", marks=pytest.mark.long),
])  # fmt: skip
def test_what_moves_in_the_holds_and_is_no_noise_is_kept_out_of_the_noise(id, shape):
    for seed in SEEDS:
        case = draw_case(seed, (id,), 1.0, shape, noise_kind="white", own_clock=False)
        assert _told(case) == pytest.approx(1.0, abs=0.15)


def test_noise_does_not_swing_however_few_its_samples_are():
    for seed in range(60):
        noise = np.round(np.random.default_rng(seed).standard_normal(2500))
        assert swing.find(0.008 * np.arange(2500), noise, 0.008) is None


def test_noise_in_short_holds_far_apart_does_not_swing():
    """Gaps smear each ordinate of the spectrum over its neighbours: they are fewer than they look."""
    n, alarms = 4634, 0
    held = np.arange(n) % (n // 8) < 79
    for seed in range(300):
        noise = np.random.default_rng(seed).standard_normal(n)
        alarms += swing.find(0.008 * np.arange(n)[held], noise[held], 0.008) is not None
    assert alarms <= 3


def test_noise_that_is_sampled_more_coarsely_from_a_moment_on_does_not_swing():
    """What is slow in it stands again at the fine samples' high frequencies."""
    for seed in range(20):
        noise = lfilter([1.0], [1.0, -0.9], np.random.default_rng(seed).standard_normal(12000))
        time_s = np.cumsum(np.where(np.arange(12000) < 9000, 1.0 / 600.0, 1.0 / 150.0))
        assert swing.find(time_s, noise, 1.0 / 600.0) is None


def test_what_stands_beside_a_swing_is_told():
    rng, t = np.random.default_rng(5), 0.002 * np.arange(20_000)
    turn = np.exp((-0.02 + 1j) * 2.0 * np.pi * 5.0 * 0.002)
    state, sway = 0j, np.zeros(len(t))
    for k in range(len(t)):
        state = turn * state + rng.standard_normal() + 1j * rng.standard_normal()
        sway[k] = state.real
    found = swing.find(t, 0.3 * rng.standard_normal(len(t)) + 2.0 * sway / sway.std(), 0.002)
    assert found is not None
    assert 0.06 < found.beside_N2 < 0.1 * 2.0**2


@pytest.mark.parametrize(("beside_N2", "floor_N"), [
    (4.0, 1.0),  # far more is left than noise, in which something swings besides: the floor is what it was
    (0.5, np.sqrt(0.5)),  # the holds took the swing for noise
    (0.0, np.sqrt(0.4)),  # and no more of the floor can have swung than its share
])  # fmt: skip
def test_a_swing_takes_from_the_floor_what_the_floor_held_of_it(beside_N2, floor_N):
    floor, squares, excess = _apart(SimpleNamespace(hum=None), swing.Swing(5.0, 0.6, beside_N2), 1.0, [9.0], [8.0])
    assert floor == pytest.approx(floor_N)
    assert squares == [9.0]
    assert excess[0] == pytest.approx(9.0 - floor**2)


def test_levels_of_detail_that_few_samples_tell_are_left_out():
    """Holds of some tens of samples, coloured so that every kind of noise is tried."""
    for seed in range(20):
        rng = np.random.default_rng(seed)
        parts = []
        for n in (int(rng.integers(14, 40)), int(rng.integers(14, 40)), int(rng.integers(14, 60))):
            e = lfilter([1.0], [1.0, -0.7], rng.standard_normal(n))
            t = np.arange(n) * 0.01
            parts.append(_about_curve(t, e))
        found = _matched(parts, 0.01)
        assert np.isfinite(found.air_N) and found.air_N > 0.2


def test_the_memory_of_a_change_is_that_of_noise_along_it():
    """Of a slow one nearly all of the noise's; of one that turns with each sample, less than white noise has."""
    colour, n = Colour(((0.3, 0.8), (0.2, 0.98))), np.arange(400)
    rho = 0.3 * 0.8 ** abs(n[:, None] - n) + 0.2 * 0.98 ** abs(n[:, None] - n) + 0.5 * np.eye(400)
    for change in (np.ones(400), np.sin(0.3 * n), (-1.0) ** n, np.random.default_rng(1).standard_normal(400)):
        wanted = change @ rho @ change / (change @ change)
        assert colour.memory_of(change) == pytest.approx(wanted, rel=1e-9)
    assert colour.memory_of(np.ones(400)) > 0.8 * colour.memory and colour.memory_of((-1.0) ** n) < 0.7
    assert Colour().memory_of(np.sin(n)) == pytest.approx(1.0)
