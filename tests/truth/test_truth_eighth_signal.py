"""The eighth shapes from the cell to the sample, against closed forms."""

import numpy as np
import pytest

from .cases import draw_case
from .effects.eighth_signal import _opens, _squeezed, _with_air, beam_modes, characters, governed, locked
from .motion import Path
from .test_truth_effects import SHORT, disturbed, hidden
from .test_truth_fourth_signal import QUIET
from .test_truth_seventh_signal import swung

pytestmark = pytest.mark.long

# --- resonance --------------------------------------------------------------------------------------------------------


def test_a_beam_that_bends():
    shares, ratios = beam_modes()
    for share in (0.1, 0.5, 0.8, 1.5, 3.0, 5.0, 8.0):
        # Moment at the root of a cantilever for a force at its tip, over what it is at rest.
        wave = 1.8751040687 * np.sqrt(share)
        exact = (np.sin(wave) + np.sinh(wave)) / (wave * (1 + np.cos(wave) * np.cosh(wave)))
        mine = 1 - shares.sum() + np.sum(shares / (1 - (share / ratios) ** 2))
        assert mine == pytest.approx(exact, abs=0.015)
    assert ratios == pytest.approx([1.0, 6.267, 17.55], rel=1e-3)


@pytest.mark.parametrize("seed", range(2))
def test_gauges_at_the_root_of_a_beam(seed):
    _, told, build = hidden("resonance", "bending_beam", seed=seed)
    f, z = told["frequency"], told["damping_ratio"]
    assert 40 <= f <= 80 and 0.05 <= z <= 0.2 and swung(build, 0.5) == pytest.approx(1.0, abs=0.01)
    # At the first mode 4/1.875² of it over 2 ζ, late by a quarter of a turn, and the higher ones take 0.14 off.
    first = swung(build, f)
    assert -first.imag == pytest.approx(4 / 1.8751**2 / (2 * z), rel=0.02)
    assert first.real == pytest.approx(-0.14, abs=0.03)
    # At the second the other way, −4/4.694² over 2 ζ, where the first does next to nothing any more.
    second = swung(build, 6.267 * f)
    assert second.imag == pytest.approx(4 / 4.6941**2 / (2 * z), rel=0.05)


def test_a_film_whose_gap_the_load_closes():
    h, omega, t = 1e-4, 2 * np.pi * 50.0, 1e-4 * np.arange(40_000)
    late = t - _squeezed(t, h, omega, 0.1, 0.4, 4.0)
    # A ramp is late by 2 ζ/ω: the damping at half load is the one stated, and it goes with the gap's −3rd power.
    for load in (0.5, 1.0, 2.0, 3.0, 3.8):
        ratio = ((1 - 0.2) / (1 - 0.4 * load / 4)) ** 3
        assert np.interp(load, t, late) == pytest.approx(0.2 / omega * ratio, rel=5e-3)
    # Off its rest it swings with 50 Hz and loses what a damping of 0.02 takes in each turn.
    swing = _squeezed(np.where(t > 1e-4, 2.01, 2.0), h, omega, 0.02, 0.4, 4.0) - 2.01
    tops = np.flatnonzero((np.diff(swing)[1:] < 0) & (np.diff(swing)[:-1] > 0))[:8] + 1
    assert np.allclose(np.diff(tops) * h, 0.02, atol=1.1 * h)
    assert np.allclose(swing[tops][1:] / swing[tops][:-1], np.exp(-2 * np.pi * 0.02), rtol=0.02)
    for seed in range(3):
        _, told, build = hidden("resonance", "squeeze_film", seed=seed)
        late = t - build.plant.sensor[0][1](t, t)
        air, half = np.interp([0.3, 0.5 * build.force_N], t, late)
        assert half == pytest.approx(told["damping_ratio"] / np.pi / told["frequency"], rel=5e-3)
        # 1 − q/20 of the gap at 0.3 of 6 N, 1 − q/2 at half load.
        assert build.force_N == 6.0 and (0.75 / 0.975) ** 3 - 0.01 < air / half < (0.85 / 0.985) ** 3 + 0.01


# --- lag --------------------------------------------------------------------------------------------------------------


def test_air_in_the_oil():
    t = 1e-4 * np.arange(60_000)
    out = _with_air(t, 1e-4, 0.004, 5.0, 3.0)
    # A ramp is late by the time there: the root of its inverse is a straight line of the load, and 1 at half load.
    for load in (1.0, 3.0, 5.5):
        slower = np.sqrt(np.interp(load, out, t - out) / 0.004)
        assert 1 / slower == pytest.approx((1 + load / 5) / (1 + 3 / 5), rel=2e-3)
    # From nothing to a little and from a little to nothing within one time constant of e.
    out = _with_air(np.where(t >= 0.1, 0.01, 0.0), 1e-4, 0.004, 5.0, 3.0)
    left = np.log(1 - out[(t > 0.102) & (t < 0.12)] / 0.01)
    assert -1 / np.polyfit(np.arange(len(left)) * 1e-4, left, 1)[0] == pytest.approx(0.004 * 1.6**2, rel=5e-3)
    for seed in range(3):
        _, told, build = hidden("sensor_lag", "trapped_air", seed=seed)
        late = t - build.plant.sensor[0][1](t, t)
        assert np.interp(3.0, t, late) == pytest.approx(told["time_constant"], rel=5e-3) and build.force_N == 6.0
        assert 1.75 < np.interp(0.05, t, late) / told["time_constant"] < 3.0


def test_a_filter_that_opens():
    t, tau, band = 1e-4 * np.arange(3000), 0.005, 1.5
    out = _opens(np.where(t >= 0.0099, 6.0, 0.0), 1e-4, tau, band)
    # e' = −(e + e²/b)/τ: 1/e + 1/b goes with e^{t/τ}.
    some = (t > 0.0105) & (t < 0.05)
    risen = np.log(1 / (6 - out[some]) + 1 / band)
    assert np.allclose(np.diff(risen), 1e-4 / tau, rtol=1e-6) and out.max() <= 6.0
    # Begun from 6 half a step before or behind.
    assert tau * (risen[0] - np.log(1 / 6 + 1 / band)) == pytest.approx(t[some][0] - 0.0099, abs=1.5e-4)
    # Along a ramp of r what is missing is e (1 + e/b) = r τ.
    for rate in (1.0, 100.0, 1000.0):
        ramp = rate * t
        missing = (ramp - _opens(ramp, 1e-4, tau, band))[-1]
        assert missing * (1 + missing / band) == pytest.approx(rate * tau, rel=0.02)
    for seed in range(3):
        _, told, build = hidden("sensor_lag", "adaptive", seed=seed)
        stage, tau = build.plant.sensor[0][1], told["time_constant"]
        assert 2.1e-3 <= tau <= 4.5e-3 and (t - stage(t, t))[-1] == pytest.approx(tau, rel=0.02)
        missing = (1000 * t - stage(t, 1000 * t))[-1]
        assert 0.08 <= missing / (1000 * tau / missing - 1) / build.force_N <= 0.21


# --- delay and clock --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(3))
def test_a_backlog(seed):
    motion = Path(-0.5).to(1.0, 50.0).hold(60.0).motion()
    _, told, build = hidden("force_delay", "backlog", motion=motion, seed=seed)
    t = np.arange(0, 60, 2e-4)
    late = t - build.delays[0](t, None)
    assert np.mean(late) == pytest.approx(told["delay"], rel=0.01) and np.all(np.diff(t - late) > 0)
    rest = late.min()
    # Up for 20 to 60 ms, then down for twice as long, to where it stays.
    up, down = np.diff(late) > 1e-9, np.diff(late) < -1e-9
    assert np.sum(down) / np.sum(up) == pytest.approx(2.0, rel=0.03)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], up.astype(int), [0]])))
    lengths, tops = (edges[1::2] - edges[::2]) * 2e-4, late[edges[1::2]] / rest
    assert 0.019 < lengths.min() < 0.03 and 0.05 < lengths.max() < 0.061
    assert 1.97 < tops.min() < 2.3 and 2.7 < tops.max() <= 3.0 and np.mean(late < 1.001 * rest) > 0.5
    # Apart by waits of 0.2 to 0.6 s in the mean, which have no memory.
    waits = np.diff(edges[::2]) * 2e-4 - 3 * lengths[:-1]
    assert waits.min() > -1e-3 and 0.15 < waits.mean() < 0.75
    assert np.std(waits) / np.mean(waits) == pytest.approx(1.0, abs=0.3)


def test_numbers_sent_as_text():
    assert characters(np.array([0.0, 9e-4, 0.001, 0.0099, 0.01, -0.1, 0.999, 1.0, 9.9999, 10.0])).tolist() == (
        [1, 1, 1, 1, 2, 3, 3, 4, 4, 5]
    )
    motion = Path(-0.5).to(4.0, 1.0).hold(0.5).motion()
    _, told, build = hidden("force_delay", "text_length", motion=motion, depth=4.0)
    t = np.arange(0, motion.duration_s, 1e-3)
    late = t - build.delays[0](t, None)
    assert np.mean(late) == pytest.approx(told["delay"], rel=1e-6)
    # 3 N/mm: a depth of 1/3000, 1/300, 1/30, 1/3 and 10/3 mm has one to five digits, just beyond.
    depths = np.array([-0.1, 0.002, 0.02, 0.2, 2.0, 3.9])
    levels = np.interp(np.interp(depths, motion.position(t), t), t, late)
    digits = np.array([1, 1, 2, 3, 4, 5])
    others = (digits[-1] * levels[0] - digits[0] * levels[-1]) / (levels[-1] - levels[0])
    assert others == pytest.approx(round(others)) and 3 <= round(others) <= 6
    assert np.allclose(levels / levels[0], (others + digits) / (others + 1))


def test_a_loop_that_locks_in():
    t = np.linspace(0, 20, 200_001)
    omega, damping = 2.0, 0.3
    phase = locked(t, omega, damping)
    rate = np.gradient(phase, t)
    assert phase[0] == pytest.approx(0.0, abs=1e-12) and abs(rate[0]) < 1e-4
    # y'' + 2 ζ ω y' + ω² (y − t) = 0, and late by 2 ζ/ω in the end.
    left = np.gradient(rate, t) + 2 * damping * omega * rate + omega**2 * (phase - t) - 2 * damping * omega
    assert np.allclose(left[2:-2] + 2 * damping * omega, 0.0, atol=1e-3)
    assert t[-1] - phase[-1] == pytest.approx(2 * damping / omega, abs=1e-4)
    motion = Path(-0.5).to(1.0, 0.5).hold(50.0).to(-0.5, 0.5).hold(10.0).motion()
    for seed in range(3):
        case = draw_case(seed, ("clock_skew",), 1.0, "locks_in", **(QUIET | {"own_clock": True, "motion": motion}))
        t, off = case.truth.force_true_time_s, case.force_time_s - case.truth.force_true_time_s
        skew = 1e-6 * case.truth.parameters["clock_skew"]["skew"]
        assert off[-1] == pytest.approx(skew * t[-1], rel=0.02)
        rates, t = np.diff(off[::50]) / np.diff(t[::50]), (t[50::50] + t[:-50:50]) / 2
        assert abs(rates[0]) < 0.01 * abs(skew)
        turns = np.flatnonzero(np.diff(np.sign(np.diff(rates))) != 0) + 1
        # It swings about what it comes to, each time less by the same share.
        tops = rates[turns[:3]]
        ends = (tops[0] * tops[2] - tops[1] ** 2) / (tops[0] + tops[2] - 2 * tops[1])
        over = np.abs(tops / ends - 1)
        assert 0.19 < over[0] < 0.52 and over[1] == pytest.approx(over[0] ** 2, rel=0.02)
        assert 0.15 <= (t[turns[2]] - t[turns[0]]) / motion.duration_s <= 0.351
        assert 0.6 < ends / skew < 1.25 and np.sign(ends) == np.sign(skew)


@pytest.mark.parametrize("seed", range(3))
def test_a_crystal_with_an_activity_dip(seed):
    motion = Path(-0.5).to(1.0, 0.5).hold(50.0).to(-0.5, 0.5).hold(10.0).motion()
    _, told, build = hidden("clock_skew", "activity_dip", motion=motion, seed=seed)
    duration = motion.duration_s
    t = np.linspace(0, duration, 40_001)
    off = t - build.delays[0](t, None)
    assert off[-1] == pytest.approx(1e-6 * told["skew"] * t[-1]) and off[0] == pytest.approx(0.0, abs=1e-15)
    rates = np.diff(off) / np.diff(t)
    lowest = np.argmin(rates)
    at = t[lowest]
    assert 0.29 < at / duration < 0.71 and build.stamps == [] and not build.own_clock
    # A Lorentzian, whose depth and width are told by what it has lost at two distances from the middle.
    one, two = np.interp(at + np.array([0.05, 0.1]) * duration, t[1:], rates) - rates[lowest]
    deep = 0.75 / (1 / two - 0.25 / one)  # since 1/one = (1 + (w/s)²)/d and 1/two = (1 + (w/2 s)²)/d
    wide = 0.05 * duration * np.sqrt(deep / one - 1)
    assert 0.039 < wide / duration < 0.081
    skew = rates[lowest] + deep
    assert 0.99 <= deep / abs(skew) <= 2.01
    assert np.allclose(rates, skew - deep / (1 + ((t[1:] - at) / wide) ** 2), atol=2e-3 * abs(skew))


# --- zero, drift and hum ----------------------------------------------------------------------------------------------


def test_popcorn():
    dwells = []
    for seed in range(6):
        motion = Path(-0.5).to(1.0, 50.0).hold(99.0).motion()
        _, told, build = hidden("force_bias", "popcorn", motion=motion, seed=seed)
        t = np.arange(0, motion.duration_s, 1e-3)
        samples, _ = disturbed("force_bias", "popcorn", np.linspace(0, SHORT.duration_s, 500), seed=seed)
        assert len(np.unique(samples.clean_N)) <= 2
        zero = applied(build, t)
        low, high = np.min(np.abs(zero)), np.max(np.abs(zero))
        assert np.all(np.isclose(np.abs(zero), low) | np.isclose(np.abs(zero), high))
        assert np.mean(zero) == pytest.approx(told["bias"], rel=1e-3) and 0.1 <= (high - low) / abs(told["bias"]) <= 0.2
        stays = np.diff(t[np.flatnonzero(np.diff(zero))])
        assert 0.3 < np.mean(stays) < 4.5
        dwells.append(stays / np.mean(stays))
    # Without memory: the deviation is the mean, and e^{−1} of them last longer.
    dwells = np.concatenate(dwells)
    assert np.std(dwells) == pytest.approx(1.0, abs=0.15) and np.mean(dwells > 1) == pytest.approx(np.exp(-1), abs=0.06)


def applied(build, t):
    """What the one stage on samples adds to nothing."""
    samples = type("Nothing", (), {"time_s": t, "force_N": np.zeros_like(t), "clean_N": np.zeros_like(t)})()
    ((_, stage),) = build.samples
    stage(samples, None)
    return samples.clean_N


@pytest.mark.parametrize("seed", range(3))
def test_gauges_that_warm_first(seed):
    duration = SHORT.duration_s
    t = np.linspace(0, 3 * duration, 30_001)
    samples, told = disturbed("force_drift", "gradient", t, seed=seed)
    zero, rate = samples.clean_N, told["rate"]
    assert zero[0] == 0 and zero[1] / t[1] == pytest.approx(rate, rel=2e-3) and 0.0023 < abs(rate) < 0.0065
    top = np.argmax(np.abs(zero))
    # r t e^{−t/τ} is greatest at τ, r τ/e there, and 3 e^{−2} of that at 3 τ.
    assert 0.299 < t[top] / duration < 0.601 and zero[top] == pytest.approx(rate * t[top] / np.e, rel=1e-3)
    assert np.interp(3 * t[top], t, zero) == pytest.approx(3 * np.exp(-2) * zero[top], rel=2e-3)


@pytest.mark.parametrize("seed", range(3))
def test_a_motor_that_warms_by_what_it_holds(seed):
    times, ends = [], {}
    for depth in (-0.5, 1.0, 2.0):
        motion = Path(-0.5).hold(1.0).to(depth, 500.0).hold(100.0).motion()
        _, told, build = hidden("force_drift", "motor_heat", motion=motion, seed=seed)
        t = np.linspace(0, motion.duration_s, 4001)
        zero, rate = applied(build, t), told["rate"]
        assert zero[0] == 0 and np.interp(0.5, t, zero) == pytest.approx(0.5 * rate, rel=0.01)
        # Toward some end by the same share in each 20 s.
        a, b, c = np.interp([5.0, 45.0, 85.0], t, zero)
        keeps = (c - b) / (b - a)
        times.append(-40 / np.log(keeps) / motion.duration_s)
        ends[depth] = (b - keeps * a) / (1 - keeps) / (rate * times[-1] * motion.duration_s)
    assert np.allclose(times, times[0], rtol=0.01) and 0.59 < times[0] < 1.51
    # 1 in air, 1 + g at the greatest load and a quarter of g at half of it.
    assert ends[-0.5] == pytest.approx(1.0, rel=2e-3) and 2.0 < ends[2.0] < 3.02
    assert (ends[1.0] - 1) / (ends[2.0] - 1) == pytest.approx(0.25, rel=0.02)


@pytest.mark.parametrize("seed", range(3))
def test_hum_of_a_generator(seed):
    motion = Path(-0.5).to(1.0, 50.0).hold(60.0).motion()
    _, told, build = hidden("mains_hum", "generator", motion=motion, seed=seed)
    t = np.arange(0, 60, 1e-3)
    hum, f = applied(build, t), told["frequency"]
    assert np.max(np.abs(hum)) == pytest.approx(told["amplitude"], rel=2e-3)
    assert min(abs(f - 50), abs(f - 60)) <= 0.05
    # A frequency that is never off by more than Δf, and by that where the first load goes on.
    window = np.convolve(np.blackman(81), np.blackman(81))
    phase = np.unwrap(np.angle(np.convolve(hum * np.exp(-2j * np.pi * f * t), window, "valid")))
    off = np.gradient(phase, 1e-3) / (2 * np.pi)
    assert 0.085 < -off.min() < 0.2 and 0.05 < off.max() < 0.2
    first = np.argmax(np.abs(off) > 0.03)
    assert off[first] < 0 and np.all(np.abs(off[: max(first - 100, 0)]) < 1e-3)
    assert np.sum(np.abs(np.diff(np.sign(off[np.abs(off) > 0.01]))) > 0) >= 4


def test_a_governor():
    t, switched = np.linspace(0, 20, 20_001), np.array([2.0, 5.5, 6.1, 13.0])
    turns = governed(t, switched, 0.15, 0.8)
    # φ' + φ/τ is −Δf while the load is on, and nothing while it is off.
    load = (np.gradient(turns, t) + turns / 0.8) / -0.15
    on = ((t > 2.0) & (t < 5.5)) | ((t > 6.1) & (t < 13.0))
    away = np.min(np.abs(t[:, None] - switched), axis=1) > 2e-3
    assert np.allclose(load[away], on[away], atol=1e-3)
