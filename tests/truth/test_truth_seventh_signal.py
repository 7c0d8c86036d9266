"""The seventh shapes from the cell to the sample, and of the channel's faults, against closed forms."""

import numpy as np
import pytest

from .cases import draw_case
from .effects.registry import SATURATION, Samples
from .effects.seventh_channel import swapped
from .effects.seventh_signal import _slewed, echoes, fractional, pulled
from .motion import Path
from .sets import shapes_of
from .test_truth_effects import SHORT, disturbed, hidden
from .test_truth_fourth_signal import MANY, QUIET

pytestmark = pytest.mark.long


def swung(build, frequency_Hz):
    """What the first stage of the sensor makes of a sine of amplitude 1, as a complex number."""
    t = 1e-4 * np.arange(40_000)
    turn = np.exp(2j * np.pi * frequency_Hz * t)
    out = build.plant.sensor[0][1](t, turn.imag)
    late = t >= 2.0
    whole = np.linalg.lstsq(np.stack([turn.imag, turn.real], axis=1)[late], out[late], rcond=None)[0]
    return complex(whole[0], whole[1])


def test_a_line_that_throws_back():
    t = 1e-4 * np.arange(3000)
    out = echoes(t, np.where(t > 0.01, 1.0, 0.0), 0.004, 0.8)
    # Nothing for a while, then 1.8, 0.36, 1.512 and so on: each time it misses one by −r of the last.
    for k in range(6):
        inside = (t > 0.0102 + 0.004 * (2 * k + 1)) & (t < 0.0098 + 0.004 * (2 * k + 3))
        assert np.allclose(out[inside], 1 - (-0.8) ** (k + 1), atol=1e-6)
    assert np.all(np.abs(out[t < 0.0138]) < 1e-6)
    for seed in range(2):
        _, told, build = hidden("resonance", "line", seed=seed)
        f, z = told["frequency"], told["damping_ratio"]
        lost = np.pi * z / np.sqrt(1 - z**2)
        for share in (0.3, 1.0, 2.0, 3.0):
            angle = np.hypot(lost, np.pi) / 2 * share
            wanted = (1 + np.exp(-lost)) / (np.exp(1j * angle) + np.exp(-lost - 1j * angle))
            assert abs(swung(build, share * f)) == pytest.approx(abs(wanted), rel=0.03)


@pytest.mark.parametrize("seed", range(3))
def test_a_damper_of_a_polymer(seed):
    for power in (0.4, 0.7):
        num, den, apart, damping = fractional(power, 0.1)
        for w in (0.5, 0.9, 1.0, 1.2, 2.0):
            exact = 1 / (1 - w**2 + 0.2 * (1j * w) ** power)
            mine = np.polyval(num, 1j * w) / np.polyval(den, 1j * w)
            # Slow signals come through unchanged, since what s^α has left there is divided out.
            assert abs(num[0] / mine - 1 / exact) < 0.06
        assert np.min(np.abs(np.roots(den) - apart * (-damping + 1j * np.sqrt(1 - damping**2)))) < 1e-9
    _, told, build = hidden("resonance", "fractional_damper", seed=seed)
    f, z = told["frequency"], told["damping_ratio"]
    assert 40 <= f <= 80 and 0.04 < z < 0.25 and abs(swung(build, 0.5)) == pytest.approx(1.0, abs=0.01)
    peak = max(abs(swung(build, share * f)) for share in (0.9, 0.95, 1.0, 1.05))
    assert peak == pytest.approx(1 / (2 * z), rel=0.2)


@pytest.mark.parametrize("seed", range(2))
def test_a_filter_after_cauer(seed):
    _, told, build = hidden("sensor_lag", "cauer", seed=seed)
    stage, t, tau = build.plant.sensor[0][1], 1e-4 * np.arange(4000), told["time_constant"]
    assert np.allclose((t - stage(t, t))[2000:], tau, rtol=1e-6)
    # Even ripples of 0.5 dB, and 40 dB less than their top from some frequency on.
    swings = np.array([abs(swung(build, f)) for f in np.linspace(5, 1500, 150)])
    passes = np.argmax(swings < 0.99)
    low = swings[:passes]
    assert low.max() == pytest.approx(10 ** (0.5 / 20), rel=5e-3) and low.min() > 0.99
    stops = np.argmax(swings < 10 ** ((0.5 - 40) / 20))
    assert np.all(swings[stops:] < 1.1 * 10 ** ((0.5 - 40) / 20)) and stops < 120


def test_an_amplifier_that_is_no_faster():
    t = 1e-4 * np.arange(2000)
    out = _slewed(np.where(t > 0.01, 6.0, 0.0), 1e-4, 0.003, 200.0)
    begin = 0.01 + (6.0 - 0.6) / 200  # until what is left is τ times the rate
    straight, bent = (t > 0.0102) & (t < begin - 1e-3), (t > begin + 1e-3) & (t < begin + 0.01)
    assert np.allclose(out[straight], 200 * (t[straight] - 0.01), atol=0.03)
    assert -1 / np.polyfit(t[bent], np.log(6 - out[bent]), 1)[0] == pytest.approx(0.003, rel=0.01)
    _, told, build = hidden("sensor_lag", "slew_rate")
    stage = build.plant.sensor[0][1]
    assert np.allclose((t - stage(t, t))[1000:], told["time_constant"], rtol=1e-3)
    quickest = np.max(np.diff(stage(t, np.where(t > 0.01, 60.0, 0.0)))) / 1e-4
    assert 6.0 / 0.0251 <= quickest <= 6.0 / 0.0119


def test_two_tasks_with_cycles_of_their_own():
    _, told, build = hidden("force_delay", "two_cycles")
    t = np.arange(1, 4, 1e-5)
    read, delay = build.delays[0](t, None), told["delay"]
    late = (t - read) / delay
    assert np.all(np.diff(read) > -1e-12) and np.mean(late) == pytest.approx(1.0, abs=0.02)
    # Two saws that do not go together: a sum of two even spreads.
    assert 0.25 * np.sqrt(0.52 / 3) < np.std(late) < 0.5 * np.sqrt(1.17 / 3) and np.min(late) > 0
    places = np.unique(np.round(read, 9))
    steps = np.diff(places) / delay
    slow = np.max(steps)
    assert len(places) < 3 / delay / 0.39 and 0.39 < slow < 1.3


def test_a_link_that_dozes():
    motion = Path(-0.5).hold(3.0).to(1.5, 0.5).hold(5.0).to(-0.5, 0.5).hold(5.0).motion()
    _, told, build = hidden("force_delay", "saves_power", motion=motion)
    t = np.arange(0, motion.duration_s, 0.002)
    late = (t - build.delays[0](t, None)) / told["delay"]
    assert np.mean(late) == pytest.approx(1.0, abs=0.01) and np.all(np.diff(t - told["delay"] * late) > 0)
    rests, moves = np.interp([2.9, 6.9], t, late)
    assert 1.5 <= rests / moves <= 2.0
    left = (np.interp(3 + np.array([0.1, 0.3, 0.5]), t, late) - moves) / (rests - moves)
    assert left[1] / left[0] == pytest.approx(left[2] / left[1], rel=0.05) and 0.1 <= -0.1 / np.log(left[0]) <= 0.41
    assert np.interp(11.9, t, late) == pytest.approx(rests, rel=1e-3)


def test_clocks():
    angle = np.linspace(0, 6 * np.pi, 60_001)
    phase = pulled(angle, 0.6)
    rate = np.gradient(phase, angle)
    # Adler: φ' = (1 − κ sin φ)/√(1 − κ²), and once around in each turn.
    assert np.allclose(rate[1:-1], (1 - 0.6 * np.sin(phase[1:-1])) / 0.8, atol=1e-6)
    assert phase[-1] - phase[0] == pytest.approx(6 * np.pi)
    motion = Path(-0.5).to(1.0, 0.5).hold(60.0).to(-0.5, 0.5).hold(10.0).motion()
    case = draw_case(3, ("clock_skew",), 1.0, "pulled", **(QUIET | {"own_clock": True, "motion": motion}))
    t, off = case.truth.force_true_time_s, case.force_time_s - case.truth.force_true_time_s
    skew = 1e-6 * case.truth.parameters["clock_skew"]["skew"]
    assert off[-1] == pytest.approx(skew * t[-1], rel=0.02)
    rates = np.gradient(off, t) / (off[-1] / t[-1])
    # The quickest and the slowest are (1 ± κ)/√(1 − κ²), whose product is one.
    assert rates.max() * rates.min() == pytest.approx(1.0, abs=0.12) and 1.6 < rates.max() < 3.1
    _, told, build = hidden("clock_skew", "governor", motion=motion)
    t = np.linspace(0, motion.duration_s, 20_001)
    off = t - build.delays[0](t, None)
    assert off[-1] == pytest.approx(1e-6 * told["skew"] * t[-1]) and off[0] == 0
    rates = np.diff(off) / np.diff(t)
    levels = np.sort(np.abs(np.array([np.quantile(rates, 0.02), np.quantile(rates, 0.98)])))
    two = np.min(np.abs(np.abs(rates)[:, None] - levels), axis=1) < 1e-3 * levels[1]
    assert levels[1] / levels[0] == pytest.approx(4.0, rel=1e-3) and np.mean(two) > 0.99
    changes = np.sum(np.abs(np.diff(rates)) > levels[0])
    assert t[-1] / 10 < changes < t[-1] / 1 and build.stamps == [] and not build.own_clock


def test_zero_and_drift():
    duration = SHORT.duration_s
    t = np.linspace(0, duration, 40_000)
    samples, told = disturbed("force_bias", "rectified", t)
    moves = np.abs(SHORT.velocity(t)) > 1e-6
    assert np.ptp(samples.clean_N[moves]) == 0 and np.ptp(samples.clean_N[~moves]) == 0
    assert np.mean(samples.clean_N) == pytest.approx(told["bias"], rel=2e-3)
    assert 0.1 <= (samples.clean_N[moves][0] - samples.clean_N[~moves][0]) / told["bias"] <= 0.2
    t = np.linspace(0, 14, 140_001)
    for seed in range(4):
        samples, told = disturbed("force_drift", "clouds", t, seed=seed)
        rates = np.diff(samples.clean_N) / 1e-4 / told["rate"]
        assert samples.clean_N[0] == 0 and rates[0] == pytest.approx(1.0)
        assert np.mean((np.abs(rates - 1) < 1e-6) | (np.abs(rates + 0.5) < 1e-6)) > 0.999
        samples, told = disturbed("force_drift", "found_anew", t, seed=seed)
        drops = np.flatnonzero(np.diff(samples.clean_N) * np.sign(told["rate"]) < 0)
        every = np.diff(t[np.concatenate([[0], drops + 1])])
        assert np.allclose(every, every[0], atol=2e-4) and 0.24 <= every[0] / duration <= 0.41
        assert np.max(np.abs(samples.clean_N)) == pytest.approx(abs(told["rate"]) * every[0], rel=1e-3)


@pytest.mark.parametrize("seed", range(3))
def test_hum_in_bursts(seed):
    t = np.linspace(0, 24, 480_000)
    samples, told = disturbed("mains_hum", "bursts", t, seed=seed)
    hum, turn = samples.clean_N, 2 * np.pi * told["frequency"] * t
    # Of whole waves: it is nothing where it begins and ends, and the mean line is what is stated.
    assert np.max(np.abs(np.diff(hum))) < 1.1 * 2 * np.pi * told["frequency"] * np.max(np.abs(hum)) * (t[1] - t[0])
    line = 2 * np.abs(np.mean(hum * np.exp(-1j * turn)))
    assert line == pytest.approx(told["amplitude"], rel=0.05)
    fed = told["amplitude"] / np.max(np.abs(hum))
    assert 0.37 <= fed <= 0.73 and np.mean(np.abs(hum) > 1e-9) == pytest.approx(fed, abs=0.03)
    begins = np.flatnonzero(np.diff((np.convolve(np.abs(hum) > 1e-9, np.ones(9), "same") > 0).astype(int)) == 1)
    waves = np.diff(t[begins]) * told["frequency"]
    assert np.allclose(waves, np.round(waves), atol=0.02) and 19.9 < waves[0] < 60.1


# --- faults ---------------------------------------------------------------------------------------------------------


def test_a_limit_with_a_ripple():
    _, told, build = hidden("saturation", "ripple")
    t = np.arange(0, 2, 1e-4)
    ramp = np.interp(t, [0, 1, 2], [0.0, 10.0, 0.0])
    samples = Samples(t, ramp.copy(), ramp.copy(), 0.01)
    ((order, stage),) = build.samples
    stage(samples, np.random.default_rng(0))
    limit, held = told["limit"], samples.flags["saturated"]
    assert order == SATURATION and 7.0 < limit < 8.9 and np.array_equal(samples.clean_N < ramp, held)
    rail = samples.clean_N[ramp > 9.5] / limit
    assert np.mean(rail) == pytest.approx(1.0, abs=2e-3)
    # |sin| over its mean: its whole way is 1, and it comes to a cusp 100 or 120 times a second.
    assert 0.04 <= np.ptp(rail) <= 0.1
    cusps = np.flatnonzero((np.diff(rail)[1:] > 0) & (np.diff(rail)[:-1] < 0))
    assert np.mean(np.diff(cusps)) == pytest.approx(100, abs=1) or np.mean(np.diff(cusps)) == pytest.approx(83.3, abs=1)
    assert np.array_equal(samples.force_N[~held], ramp[~held])


def test_bytes_in_the_wrong_order():
    unit = 50.0 / 32767
    read = swapped(np.array([0.0, 1.0, 256.0, 0x1234, -1.0, -256.0]) * unit, 50.0)
    assert read / unit == pytest.approx([0, 256, 1, 0x3412, -1, 255])


@pytest.mark.parametrize("shape", shapes_of("outliers", "seventh"))
def test_outliers(shape):
    case = draw_case(2, ("outliers",), 1.0, shape, **MANY)
    truth, hit = case.truth, case.truth.flags["outlier"]
    sizes = np.abs(truth.fault_N) / truth.noise.std
    assert hit.mean() == pytest.approx(truth.parameters["outliers"]["fraction"]) and 0.003 < hit.mean() < 0.008
    assert np.all(sizes[~hit] == 0) and np.all(sizes[hit] >= 20 - 1e-9)
    where = np.flatnonzero(hit)
    if shape == "by_the_clock":
        assert np.ptp(np.diff(where)) <= 1 and np.all(sizes[hit] <= 60 + 1e-9)
        assert abs(np.sum(np.sign(truth.fault_N[hit]))) == len(where)
    else:
        # Back again by the same way.
        was = case.force_N[hit] - truth.fault_N[hit]
        assert np.allclose(swapped(case.force_N[hit], 50.0), was, atol=0.51 * 50 / 32767)
        assert np.max(np.abs(case.force_N)) <= 50.01 and np.std(np.diff(where)) > 0.5 * np.mean(np.diff(where))


@pytest.mark.parametrize("shape", shapes_of("stuck_samples", "seventh"))
def test_stuck_samples(shape):
    case = draw_case(2, ("stuck_samples",), 1.5, shape, **MANY)
    stuck = case.truth.flags["stuck"]
    where, n = np.flatnonzero(stuck), len(stuck)
    assert stuck.mean() == pytest.approx(case.truth.parameters["stuck_samples"]["fraction"])
    assert 0.009 < stuck.mean() < 0.024 and np.array_equal(case.force_N[stuck], case.force_N[where - 1])
    edges = np.flatnonzero(np.diff(np.concatenate([[0], stuck.astype(int), [0]])))
    begins, lengths = edges[::2], edges[1::2] - edges[::2]
    if shape == "file_grows":
        assert 6 <= len(begins) <= 10 and np.ptp(np.diff(begins)) <= 1
        wanted = np.arange(1, len(lengths) + 1) / np.arange(len(lengths) + 1).sum()
        assert np.max(np.abs(lengths - lengths.sum() * wanted)) <= 1
    else:
        assert set(lengths) == {1, 2, 3, 4}
        # As the square of time: half of them in the last fifth.
        assert np.median(begins) / n == pytest.approx(0.5 ** (1 / 3), abs=0.06) and np.quantile(begins / n, 0.125) > 0.4
