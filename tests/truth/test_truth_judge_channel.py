"""The judge's shapes of the channel's faults, against closed forms and counts."""

import numpy as np
import pytest
from scipy.special import j0

from .cases import draw_case
from .effects.judge_channel import busy, envelope, flipped, torn
from .effects.registry import SATURATION, Samples
from .sets import shapes_of
from .test_truth_effects import hidden
from .test_truth_eighth_channel import runs
from .test_truth_fourth_signal import MANY


def test_they_are_of_the_judge():
    assert "limiter" in shapes_of("saturation", "judge")
    assert len(shapes_of("outliers", "judge")) >= 2 and len(shapes_of("stuck_samples", "judge")) >= 2


@pytest.mark.parametrize("seed", range(3))
def test_a_gain_that_is_turned_down(seed):
    _, told, build = hidden("saturation", "limiter", seed=seed)
    h = 1e-3
    force = np.concatenate([np.linspace(0.0, 10.0, 501), np.full(500, 4.0), np.full(500, -2.0)])
    samples = Samples(h * np.arange(1501), force + 0.002, force.copy(), 0.01)
    ((order, stage),) = build.samples
    stage(samples, np.random.default_rng(0))
    limit, clean = told["limit"], samples.clean_N
    assert order == SATURATION and 7.5 < limit < 8.5 and np.max(clean) == pytest.approx(limit)
    assert np.allclose(clean[:501], np.minimum(force[:501], limit), rtol=1e-12)
    # It begins where it was turned down to at last, and what it lacks falls by e within one time.
    lacks = 1 - clean[501:1001] / 4.0
    taus = -h / np.log(lacks[1:300] / lacks[:299])
    assert lacks[0] == pytest.approx((1 - limit / 10.0) * np.exp(-h / taus[0]))
    assert np.allclose(taus, taus[0], rtol=1e-4) and 0.03 <= taus[0] <= 0.15
    gain = samples.force_N / (force + 0.002)
    assert np.allclose(gain[1301:], 1.0, atol=1.5e-3) and np.max(samples.force_N) <= limit + 1e-12
    # Too small by a hundredth: above the limit, and ln(100 less) times later.
    flags = np.flatnonzero(samples.flags["saturated"])
    assert np.all(np.diff(flags) == 1) and 10.0 * flags[0] / 500 == pytest.approx(limit / 0.99, abs=0.03)
    assert (flags[-1] - 500) * h == pytest.approx(taus[0] * np.log(100 * (1 - limit / 10.002)), abs=2.1 * h)


def test_words_that_are_torn():
    counts = np.array([250.0, 255.0, 256.0, 260.0, 255.0, 780.0, -1.0, 0.0])
    # Upper bytes 0 0 1 1 0 3 −1 0: each is read with that of the one before.
    assert np.allclose(torn(0.002 * counts), 0.512 * np.array([0, 0, -1, 0, 1, -3, 4, -1.0]))


@pytest.mark.parametrize("seed", range(3))
def test_a_word_that_is_read_as_it_is_written(seed):
    case = draw_case(seed, ("outliers",), 1.0, "torn_word", **MANY)
    truth, hit = case.truth, np.flatnonzero(case.truth.flags["outlier"])
    fraction = truth.parameters["outliers"]["fraction"]
    assert len(hit) == pytest.approx(fraction * len(case.force_N)) and 0.001 < fraction < 0.008
    steps = truth.fault_N / 0.512
    assert np.allclose(steps, np.round(steps)) and np.array_equal(np.flatnonzero(np.round(steps)), hit)
    # The lower byte is the new one's; the upper one the old one's, which lies on the side it came from.
    was = case.force_N - truth.fault_N
    old, new, read = (np.round(part / 0.002).astype(int) for part in (was[hit - 1], was[hit], case.force_N[hit]))
    assert np.array_equal(read & 255, new & 255) and np.array_equal(read >> 8, old >> 8)
    assert np.array_equal(np.sign(truth.fault_N[hit]), np.sign(was[hit - 1] - was[hit]))


def test_bits_of_a_float():
    # 5 = 1.25 · 2²: the exponent's last bit makes 2³ or 2¹, the mantissa's first 1.75, the second 1.
    for bit, value in ((31, -5.0), (23, 2.5), (24, 20.0), (22, 7.0), (21, 4.0)):
        assert flipped(np.array([5.0]), np.array([bit]))[0] == value


@pytest.mark.parametrize("seed", range(3))
def test_a_bit_that_flips_in_a_float(seed):
    case = draw_case(seed, ("outliers",), 1.0, "float_bit", **MANY)
    truth, hit = case.truth, case.truth.flags["outlier"]
    fraction = truth.parameters["outliers"]["fraction"]
    assert (
        hit.mean() == pytest.approx(fraction) and hit.sum() == round(fraction * len(hit)) and 0.003 < fraction < 0.008
    )
    assert np.all(truth.fault_N[~hit] == 0) and np.all(np.abs(truth.fault_N[hit]) > 19.9 * truth.noise.std)
    was, read = (
        (part[hit]).astype(np.float32).view(np.uint32) for part in (case.force_N - truth.fault_N, case.force_N)
    )
    # One bit, but for what rounding makes of the last ones of the mantissa; and not always the same.
    ones = [bin((int(a) >> 19) ^ (int(b) >> 19)).count("1") for a, b in zip(was, read, strict=True)]
    assert np.mean(np.array(ones) == 1) > 0.98 and np.max(np.abs(case.force_N[hit])) < 50
    assert len({(int(a) ^ int(b)).bit_length() for a, b in zip(was, read, strict=True)}) >= 4


@pytest.mark.parametrize("seed", range(3))
def test_waves_that_fade(seed):
    t, rng = 0.02 * np.arange(60_000), np.random.default_rng(seed)
    power = np.concatenate([envelope(t[:6_000], 3.0, rng) ** 2 for _ in range(10)])
    # Rayleigh: the power is exponential; in the mean its correlation is J_0² (Clarke).
    for level in (0.1, 0.5, 2.0):
        assert np.mean(power < level) == pytest.approx(-np.expm1(-level), rel=0.12)
    off = power.reshape(10, -1) - 1
    for lag in (1, 4, 6):
        together = np.mean(off[:, lag:] * off[:, :-lag])
        assert together == pytest.approx(j0(2 * np.pi * 3.0 * 0.02 * lag) ** 2, abs=0.13)


@pytest.mark.parametrize("seed", range(3))
def test_a_radio_that_fades(seed):
    case = draw_case(seed, ("stuck_samples",), 2.0, "fading", **MANY)
    truth, stuck = case.truth, case.truth.flags["stuck"]
    where, t = np.flatnonzero(stuck), truth.force_true_time_s
    fraction = truth.parameters["stuck_samples"]["fraction"]
    assert stuck.mean() == pytest.approx(fraction) and stuck.sum() == round(fraction * len(stuck))
    assert 0.013 < fraction < 0.029 and np.array_equal(case.force_N[stuck], case.force_N[where - 1])
    begins, lengths = runs(stuck)
    # Rice: in the mean √(fraction)/(√(2π) f) long, f of 2 to 8 Hz; they differ, and come at random.
    length = np.mean(lengths) * (t[1] - t[0])
    assert 0.6 * np.sqrt(fraction / (2 * np.pi)) / 8 < length < 1.6 * np.sqrt(fraction / (2 * np.pi)) / 2
    assert (
        len(begins) > 4
        and np.ptp(lengths) > 0.3 * np.mean(lengths)
        and np.std(np.diff(begins)) > 0.4 * np.mean(np.diff(begins))
    )


def test_who_comes_late_waits():
    t = 0.01 * np.arange(100) + 0.005
    # Asked at 0.1 for 0.1, at 0.15 for 0.2, at 0.38 for 0.1; at 0.7 for 0.1. The second waits, the third does so too.
    at = busy(t, np.array([0.7, 0.1, 0.38, 0.15]), np.array([0.1, 0.1, 0.1, 0.2]))
    assert np.array_equal(at, ((t > 0.1) & (t < 0.5)) | ((t > 0.7) & (t < 0.8)))


def comb(times):
    """What the times are apart, by ever more of them."""
    apart = np.min(np.diff(times)[np.diff(times) > 0.3])
    for n in (4, 10, 25, len(times)):
        counts = np.round((times[:n] - times[0]) / apart)
        apart = np.polyfit(counts, times[:n], 1)[0]
    return apart


@pytest.mark.parametrize("seed", range(3))
def test_two_tasks_that_go_first(seed):
    case = draw_case(seed, ("stuck_samples",), 2.0, "two_tasks", **MANY)
    truth, stuck = case.truth, case.truth.flags["stuck"]
    where, t = np.flatnonzero(stuck), truth.force_true_time_s
    fraction = truth.parameters["stuck_samples"]["fraction"]
    assert stuck.mean() == pytest.approx(fraction) and 0.0135 < fraction < 0.03
    assert np.array_equal(case.force_N[stuck], case.force_N[where - 1])
    begins, lengths = runs(stuck)
    # Two combs make all that there is: each is as long as one of the tasks, or both in a row.
    kinds = np.sort(lengths[1:-1])
    short = int(np.median(kinds[kinds < 1.15 * kinds[len(kinds) // 4]]))
    quick = t[begins[np.abs(lengths - short) <= 1]]
    long = begins[(lengths > 1.2 * short) & (lengths < 2.05 * short)]
    every, other = comb(quick), comb(t[long])
    assert 0.599 <= every <= 1.201 and 1.29 <= other / every <= 1.91
    step = np.median(np.diff(t))
    assert short * step / every == pytest.approx(fraction / 2, rel=0.1)
    assert np.median(lengths[np.isin(begins, long)]) * step / other == pytest.approx(fraction / 2, rel=0.1)
    # Each at whole numbers of its own time, but for those few that had to wait.
    for times, apart in ((quick, every), (t[long], other)):
        count = (times - times[len(times) // 2]) / apart
        assert np.mean(np.abs(count - np.round(count)) * apart < 4e-3) > 0.8
        assert len(times) >= 0.8 * (t[-1] - t[0]) / apart - 2
