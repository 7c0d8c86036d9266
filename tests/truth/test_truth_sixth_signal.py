"""The sixth shapes from the cell to the sample, and of the channel's faults, against closed forms."""

import numpy as np
import pytest

from .cases import draw_case
from .effects.registry import SATURATION, Samples
from .effects.sixth_signal import _dry, windowed_sinc
from .motion import Path
from .sets import shapes_of
from .test_truth_effects import SHORT, disturbed, hidden
from .test_truth_fourth_signal import MANY, QUIET

pytestmark = pytest.mark.long


def test_a_joint_whose_damping_is_dry():
    t, omega = 1e-4 * np.arange(5000), 2 * np.pi * 40.0
    out = _dry(np.where(t > 1e-4, 1.0, 0.0), 1e-4, np.full(5000, omega), 0.0, 0.03)
    turns = np.flatnonzero(np.diff(np.sign(np.diff(out))) != 0) + 1
    # Each half swing loses twice what the joint holds, until it stays within that.
    left = np.abs(out[turns][:14] - 1)
    assert np.allclose(left, 1 - 0.06 * np.arange(14), atol=2e-3)
    assert np.allclose(np.diff(turns[:10]) * 1e-4, 1 / 80, rtol=0.02)
    assert np.ptp(out[-100:]) == 0 and abs(out[-1] - 1) <= 0.03
    _, told, build = hidden("resonance", "dry_joint")
    f, z, t = told["frequency"], told["damping_ratio"], 1e-4 * np.arange(60_000)
    for swing, least, most in ((0.03, 0.7, 1.35), (0.3, 1.6, 2.1)):
        drive = 2 * z * swing * 6 * np.sin(2 * np.pi * f * t)
        peak = np.max(np.abs(build.plant.sensor[0][1](t, drive)[30_000:])) / (swing * 6)
        assert least < peak < most


@pytest.mark.parametrize("seed", range(3))
def test_a_path_that_works_loose(seed):
    _, told, build = hidden("resonance", "works_loose", seed=seed)
    duration = SHORT.duration_s
    t = 1e-4 * np.arange(int(duration * 1e4))
    # A ramp is late by 2 ζ/ω.
    late = t - build.plant.sensor[0][1](t, t)
    at = np.array([0.2, 0.5, 0.9]) * duration
    ratio = 2 * told["damping_ratio"] / (2 * np.pi * told["frequency"]) / np.interp(at, t, late)
    assert ratio[1] == pytest.approx(1.0, rel=0.01)
    assert (ratio[0] - ratio[1]) / 0.3 == pytest.approx((ratio[1] - ratio[2]) / 0.4, rel=0.1)
    assert 0.15 < (ratio[0] - ratio[2]) / 0.7 < 0.34


def test_a_filter_of_finite_response():
    for steps in (0.4, 1.5, 30.0):
        weights = windowed_sinc(steps)
        assert weights.sum() == pytest.approx(1.0) and np.allclose(weights, weights[::-1])
    for size in (0.05, 1.0):
        motion = Path(0.0, np.inf).to(2.0, 10.0).hold(0.2).motion()
        fine, told, _ = hidden("sensor_lag", "finite_response", size, motion=motion)
        tau, t = told["time_constant"], fine.time_s
        ramp = (t > 3 * tau + 1e-3) & (t < 0.2 - 1e-3)
        assert np.allclose(fine.force_N[ramp], 30 * (t[ramp] - tau), atol=1e-3)
    _, told, build = hidden("sensor_lag", "finite_response", 2.0)
    t, tau = 1e-4 * np.arange(2000), told["time_constant"]
    out = build.plant.sensor[0][1](t, np.where(t >= 0.1, 1.0, 0.0))
    s = np.linspace(0, 2 * tau, 50)
    after, before = (np.interp(0.1 - 5e-5 + tau + side * s, t, out) for side in (1, -1))
    # Even about its delay, over after that, and done after twice of it.
    assert np.allclose(after + before, 1.0, atol=1e-3) and 1.003 < out.max() < 1.1
    assert np.allclose(out[t > 0.1 + 2 * tau + 2e-4], 1.0) and np.allclose(out[t < 0.0998], 0.0)


@pytest.mark.parametrize("seed", range(3))
def test_a_cell_that_drains_more_slowly(seed):
    _, told, build = hidden("sensor_lag", "hydraulic", seed=seed)
    t = 1e-4 * np.arange(4000)
    out = build.plant.sensor[0][1](t, np.where((t > 0.1) & (t < 0.25), 1.0, 0.0))
    times = []
    for begin, left in ((0.102, 1 - out), (0.252, out)):
        some = (t > begin) & (t < begin + 0.01)
        times.append(-1 / np.polyfit(t[some], np.log(left[some]), 1)[0] / told["time_constant"])
    assert sum(times) == pytest.approx(2.0, rel=1e-3) and 0.69 < times[0] < 0.86


def test_answers_that_are_asked_for_again():
    _, told, build = hidden("force_delay", "asked_again")
    t = np.arange(40_000) / 1000
    late = (t - build.delays[0](t, np.random.default_rng(3))) / told["delay"]
    again = late > 1.2
    assert np.mean(late) == pytest.approx(1.0, abs=0.01) and np.mean(again) == pytest.approx(1 / 8, abs=0.006)
    assert np.ptp(late[again]) < 1e-6 and late[again][0] / late[~again][0] == pytest.approx(2.0)
    runs = np.mean(again[1:] & again[:-1])
    assert runs == pytest.approx(1 / 64, abs=0.004)  # one by one


def test_a_network_more_and_less_busy():
    motion = Path(-0.5).to(1.0, 50.0).hold(600.0).motion()
    _, told, build = hidden("force_delay", "congestion", motion=motion)
    t = np.arange(0, 600, 0.05)
    late = (t - build.delays[0](t, None)) / told["delay"]
    assert np.mean(late) == pytest.approx(1.0, abs=0.07) and np.std(late) == pytest.approx(0.2, rel=0.3)
    off = late - np.mean(late)
    # Of what there is, 0.5 s later nine tenths are left, and 25 s later nothing.
    assert np.mean(off[10:] * off[:-10]) / np.var(off) > 0.7
    assert abs(np.mean(off[500:] * off[:-500])) / np.var(off) < 0.35
    assert np.all(np.diff(t - told["delay"] * late) > 0)


def test_clocks():
    motion = Path(-0.5).to(1.0, 0.5).hold(30.0).to(-0.5, 0.5).hold(10.0).motion()
    told = QUIET | {"own_clock": True, "motion": motion}
    case = draw_case(3, ("clock_skew",), 1.0, "holdover", **told)
    t, off = case.truth.force_true_time_s, case.force_time_s - case.truth.force_true_time_s
    skew, end = 1e-6 * case.truth.parameters["clock_skew"]["skew"], t[-1]
    assert off[-1] == pytest.approx(skew * end, rel=5e-3)
    free = np.argmax(np.abs(off) > 1e-9)
    assert 0.09 < t[free] / end < 0.34 and np.all(np.abs(off[:free]) < 1e-9)
    rates = np.diff(off[free:]) / np.diff(t[free:])
    assert np.allclose(rates, skew / (1 - t[free] / end), rtol=0.01)
    _, told, build = hidden("clock_skew", "tuning_fork", motion=motion)
    t = np.linspace(0, motion.duration_s, 1001)
    off = t - build.delays[0](t, None)
    assert off[-1] == pytest.approx(1e-6 * told["skew"] * t[-1]) and off[0] == 0
    # The root of the rate is straight.
    root = np.sqrt(np.diff(off) / np.diff(t) / (1e-6 * told["skew"]))
    assert np.ptp(np.diff(root)) < 1e-6 and 2.6 < root[-1] / root[0] < 4.4
    assert build.stamps == [] and not build.own_clock


def test_a_zero_that_returns_late():
    motion = Path(-0.5).to(2.0, 50.0).hold(60.0).to(-0.5, 50.0).hold(60.0).motion()
    fine, told, build = hidden("force_bias", "returns_late", motion=motion)
    zero = fine.force_N - fine.cell_N
    loaded, air = np.interp([59.0, 119.0], fine.time_s, zero)
    assert zero[0] / loaded == pytest.approx(0.9 / 1.15, rel=1e-3) and air == pytest.approx(zero[0], rel=0.01)
    assert told["bias"] == pytest.approx(np.mean(zero), rel=1e-3) and zero[0] / told["bias"] > 0.8
    left = np.log(np.interp([63.0, 66.0], fine.time_s, zero) / zero[0] - 1)
    assert 3.0 <= 3 / (left[0] - left[1]) <= 10.0


def test_drifts():
    duration = SHORT.duration_s
    t, offs = np.linspace(0, duration, 4000), []
    for seed in range(12):
        samples, told = disturbed("force_drift", "walks", t, seed=seed)
        assert samples.clean_N[0] == 0
        offs.append(samples.clean_N / told["rate"] - t)
    # About the line, the further the more: as the root of time.
    spreads = np.sqrt(np.mean(np.square(offs), axis=0))[[1000, 3999]] / duration
    assert spreads[1] == pytest.approx(0.12, abs=0.06) and spreads[0] < 0.9 * spreads[1]
    t = np.linspace(0, 200, 200_000)
    samples, told = disturbed("force_drift", "coarse_correction", t)
    changes = np.flatnonzero(np.diff(samples.clean_N))
    steps, every = np.diff(samples.clean_N)[changes], np.diff(t[changes])
    assert np.ptp(steps) < 1e-9 and np.ptp(every) < 3e-3 and 3.0 <= every[0] <= 8.01
    assert steps[0] / every[0] == pytest.approx(told["rate"], rel=2e-3) and samples.clean_N[0] == 0


@pytest.mark.parametrize("seed", range(3))
def test_hum_of_half_waves(seed):
    t = np.linspace(0, 10, 400_000)
    samples, told = disturbed("mains_hum", "half_wave", t, seed=seed)
    hum, turn = samples.clean_N, 2 * np.pi * told["frequency"] * t
    line = 2 * np.abs(np.mean(hum * np.exp(-1j * turn)))
    assert line == pytest.approx(told["amplitude"], rel=2e-3) and np.mean(hum) == pytest.approx(0, abs=1e-4)
    rests = np.isclose(hum, hum.min(), atol=1e-9)
    fed = 1 - np.mean(rests)
    assert 0.245 < fed < 0.51
    # Top of a wave over its foot by (1 − cos) of half the angle in which it is fed.
    half = np.pi * fed
    first = (half - np.sin(half) * np.cos(half)) / np.pi
    assert np.ptp(hum) / told["amplitude"] == pytest.approx((1 - np.cos(half)) / first, rel=5e-3)


# --- faults ---------------------------------------------------------------------------------------------------------


def test_an_alarm_that_shows_the_limit():
    _, told, build = hidden("saturation", "alarm")
    ramp = np.concatenate([np.linspace(0.0, 10.0, 2001), np.linspace(10.0, 0.0, 2001)])
    samples = Samples(np.arange(4002.0), ramp.copy(), ramp.copy(), 0.01)
    ((order, stage),) = build.samples
    stage(samples, np.random.default_rng(0))
    limit, held = told["limit"], samples.flags["saturated"]
    assert order == SATURATION and 7.0 < limit < 8.9
    up, down = np.arange(4002) <= 2000, np.arange(4002) > 2000
    assert np.array_equal(held[up], ramp[up] > limit) and np.all(samples.clean_N[held] == limit)
    ends = ramp[down & held].min() / limit
    assert 0.92 <= ends <= 0.971 and np.all(np.diff(held[down].astype(int)) <= 0)
    assert np.array_equal(samples.force_N[~held], ramp[~held])


@pytest.mark.parametrize("shape", shapes_of("outliers", "sixth"))
def test_outliers(shape):
    case = draw_case(2, ("outliers",), 1.0, shape, **MANY)
    truth, hit = case.truth, case.truth.flags["outlier"]
    sizes = np.abs(truth.fault_N) / truth.noise.std
    assert hit.mean() == pytest.approx(truth.parameters["outliers"]["fraction"]) and 0.002 < hit.mean() < 0.01
    assert np.all(sizes[~hit] == 0) and np.all(sizes[hit] >= 20)
    if shape == "rings":
        where = np.flatnonzero(hit).reshape(-1, 3)
        parts = truth.fault_N[where]
        assert np.all(np.diff(where, axis=1) == 1) and np.allclose(parts[:, 1:] / parts[:, :-1], -0.7)
        assert np.all(sizes[where[:, 0]] >= 50) and 0.2 < np.mean(parts[:, 0] > 0) < 0.8
    else:
        assert np.allclose(case.force_N[hit], -truth.clean_N[hit], atol=6 * truth.noise.std)


@pytest.mark.parametrize("shape", shapes_of("stuck_samples", "sixth"))
def test_stuck_samples(shape):
    case = draw_case(2, ("stuck_samples",), 1.0, shape, **MANY)
    stuck = case.truth.flags["stuck"]
    where = np.flatnonzero(stuck)
    assert stuck.mean() == pytest.approx(case.truth.parameters["stuck_samples"]["fraction"])
    assert 0.004 < stuck.mean() < 0.017 and np.array_equal(case.force_N[stuck], case.force_N[where - 1])
    if shape == "checksum":
        case = draw_case(2, ("stuck_samples",), 4.0, shape, **MANY)
        moves = np.abs(case.truth.motion.velocity(case.truth.force_true_time_s)) > 1e-6
        stuck = case.truth.flags["stuck"]
        assert np.mean(stuck[moves]) / np.mean(stuck[~moves]) == pytest.approx(10.0, rel=0.35)
    else:
        seen = 0
        for seed in range(6):
            stuck = draw_case(seed, ("stuck_samples",), 2.5, shape, **MANY).truth.flags["stuck"]
            edges = np.flatnonzero(np.diff(np.concatenate([[0], stuck.astype(int), [0]])))
            begins, lengths = edges[::2], edges[1::2] - edges[::2]
            for k in range(len(begins) - 4):
                if np.array_equal(lengths[k : k + 5], [10, 20, 40, 80, 160]):
                    seen += 1
                    assert np.array_equal(np.diff(begins[k : k + 5]), lengths[k : k + 4] + 1)
        assert seen >= 6
