"""The ninth shapes of the channel's faults, against closed forms and counts."""

import numpy as np
import pytest

from .cases import draw_case
from .effects.ninth_channel import impulse, resets
from .effects.registry import SATURATION, Samples
from .sets import shapes_of
from .test_truth_effects import hidden
from .test_truth_eighth_channel import runs
from .test_truth_fourth_signal import MANY

pytestmark = pytest.mark.long


def test_they_are_of_the_ninth():
    assert "folds_back" in shapes_of("saturation", "ninth")
    assert len(shapes_of("outliers", "ninth")) >= 2 and len(shapes_of("stuck_samples", "ninth")) >= 2


@pytest.mark.parametrize("seed", range(3))
def test_an_output_that_folds_back(seed):
    _, told, build = hidden("saturation", "folds_back", seed=seed)
    ramp = np.concatenate([np.linspace(0.0, 10.0, 2001), np.linspace(10.0, 0.0, 2001)])
    samples = Samples(np.arange(4002.0), ramp + 0.01, ramp.copy(), 0.01)
    ((order, stage),) = build.samples
    stage(samples, np.random.default_rng(0))
    limit, clean = told["limit"], samples.clean_N
    assert order == SATURATION and 7.5 < limit < 8.5
    assert np.array_equal(samples.flags["saturated"], ramp + 0.01 > limit)
    assert np.array_equal(clean[ramp < limit], ramp[ramp < limit]) and np.max(clean) == pytest.approx(limit, abs=0.006)
    # A straight line down from the limit, the same on the way back.
    beyond = ramp > limit
    slope, at = np.polyfit(ramp[beyond] - limit, clean[beyond], 1)
    assert np.allclose(at + slope * (ramp[beyond] - limit), clean[beyond], atol=1e-9)
    assert at == pytest.approx(limit) and 0.08 <= -slope <= 0.25 and np.allclose(clean, clean[::-1])
    assert np.allclose(samples.force_N[2:1500], clean[2:1500] + 0.01)


@pytest.mark.parametrize("seed", range(3))
def test_values_from_the_turn_before(seed):
    case = draw_case(seed, ("outliers",), 1.0, "stale", **MANY)
    truth, hit = case.truth, case.truth.flags["outlier"]
    fraction = truth.parameters["outliers"]["fraction"]
    assert (
        hit.mean() == pytest.approx(fraction) and hit.sum() == round(fraction * len(hit)) and 0.003 < fraction < 0.008
    )
    assert np.all(truth.fault_N[~hit] == 0) and np.all(np.abs(truth.fault_N[hit]) > 19.9 * truth.noise.std)
    # One age for all of them.
    was, where = case.force_N - truth.fault_N, np.flatnonzero(hit)
    ages = [np.flatnonzero(np.abs(was[:k] - case.force_N[k]) < 1e-9) - k for k in where]
    age = [a for a in range(-1500, -199) if all(a in found for found in ages)]
    assert len(age) == 1


def test_a_surge_has_two_exponentials():
    s = np.linspace(-0.01, 0.1, 110_001)
    wave = impulse(s, 0.007)
    assert np.all(wave[s < 0] == 0) and np.max(wave) == pytest.approx(1.0, abs=1e-6)
    # It is at its top after τ ln 10/9, and falls by e within τ later on.
    assert s[np.argmax(wave)] == pytest.approx(0.007 * np.log(10) / 9, abs=2e-6)
    assert np.interp(0.047, s, wave) / np.interp(0.04, s, wave) == pytest.approx(np.exp(-1), rel=1e-3)


@pytest.mark.parametrize("seed", range(3))
def test_surges(seed):
    case = draw_case(seed, ("outliers",), 1.5, "surges", **MANY)
    truth, hit = case.truth, case.truth.flags["outlier"]
    sizes = truth.fault_N / truth.noise.std
    fraction = truth.parameters["outliers"]["fraction"]
    assert (
        hit.mean() == pytest.approx(fraction) and hit.sum() == round(fraction * len(hit)) and 0.005 < fraction < 0.011
    )
    assert np.all(sizes[~hit] == 0) and np.all(np.abs(sizes[hit]) > 15) and np.max(np.abs(sizes)) <= 150.01
    assert {-1.0, 1.0} == set(np.sign(sizes[hit]))
    begins, lengths = runs(hit)
    assert 5 < np.mean(lengths) < 25
    falls = []
    for i, n in zip(begins, lengths, strict=True):
        if n > 6:
            t, wave = truth.force_true_time_s[i + 3 : i + n], np.abs(sizes[i + 3 : i + n])
            falls.append(np.log(wave[-1] / wave[0]) / (t[-1] - t[0]))
    # All by the same τ, but where two meet.
    tau = -1 / np.median(falls)
    assert 0.0029 <= tau <= 0.0102 and np.mean(np.abs(np.array(falls) * tau + 1) < 0.05) > 0.8


def test_where_it_starts_anew():
    power = np.array([0.0, 1.0, 3.0, 3.0, 3.0, 3.0, 1.0, 0.0, 4.0, 0.0])
    assert list(resets(power, 2.0, 3)) == [2, 5, 8]
    assert list(resets(power, 0.5, 20)) == [1] and list(resets(power, 5.0, 3)) == []
    assert list(resets(np.array([3.0, 3.0]), 2.0, 1)) == [1]


@pytest.mark.parametrize("seed", range(3))
def test_a_supply_that_dips(seed):
    case = draw_case(seed, ("stuck_samples",), 1.0, "supply_dips", **MANY)
    truth, stuck = case.truth, case.truth.flags["stuck"]
    where = np.flatnonzero(stuck)
    assert stuck.mean() == pytest.approx(truth.parameters["stuck_samples"]["fraction"]) and 0.006 < stuck.mean() < 0.015
    assert np.array_equal(case.force_N[stuck], case.force_N[where - 1])
    t = truth.force_true_time_s
    power = np.maximum(truth.clean_N * truth.motion.velocity(t), 0.0)
    # As it begins the power is above a level, and nowhere where it does not, but after the last one.
    begins, lengths = runs(stuck)
    level = np.min(power[begins])
    alone = ~stuck[: begins[-1]]
    assert np.all(power[: begins[-1]][alone] <= level) and 0.09 <= level / power.max() <= 0.5
    # All as long, or several times as long where it is above the level still.
    single = np.min(lengths[:-1])
    assert 2 <= single <= 150 and np.all(lengths[:-1] % single == 0) and len(begins) >= 3
    # A smaller fraction is as often, and shorter.
    few = draw_case(seed, ("stuck_samples",), 0.4, "supply_dips", **MANY).truth.flags["stuck"]
    others, shorter = runs(few)
    assert set(begins[:3]) <= set(others) and np.min(shorter[:-1]) < 0.7 * single


@pytest.mark.parametrize("seed", range(3))
def test_packets_that_are_lost(seed):
    case = draw_case(seed, ("stuck_samples",), 2.0, "lost_packets", **MANY)
    truth, stuck = case.truth, case.truth.flags["stuck"]
    where = np.flatnonzero(stuck)
    fraction = truth.parameters["stuck_samples"]["fraction"]
    assert stuck.mean() == pytest.approx(fraction) and 0.013 < fraction < 0.029
    assert stuck.sum() == max(3, round(fraction * len(stuck)))
    assert np.array_equal(case.force_N[stuck], case.force_N[where - 1])
    begins, lengths = runs(stuck)
    # Of whole packets, and all on one grid, but for the one that is cut short.
    packet = int(np.bincount(lengths).argmax())
    assert 6 <= packet <= 24 and np.sum(lengths % packet != 0) <= 1
    assert np.ptp(begins % packet) == 0 and len(set(begins // packet)) > 8
    assert np.std(np.diff(begins)) > 0.5 * np.mean(np.diff(begins))
