"""The fourth shapes from the cell to the sample, and of the channel's faults, against closed forms."""

import numpy as np
import pytest

from .cases import draw_case
from .effects.registry import SATURATION, Samples
from .motion import Path, rich
from .sets import shapes_of
from .test_truth_effects import SHORT, disturbed, hidden

pytestmark = pytest.mark.long

QUIET = {"noise_N": 1e-6, "jitter": "none", "own_clock": False, "rate_hz": 1000.0, "motion": SHORT, "law": "power"}
MANY = {"motion": rich(2.0, (60.0, 8.0)), "rate_hz": 1000.0, "noise_kind": "white", "jitter": "none"}


def gain(build, frequency_Hz, t=None):
    """Of the first stage of the sensor, long after the start."""
    t = 1e-4 * np.arange(40_000) if t is None else t
    out = build.plant.sensor[0][1](t, np.sin(2 * np.pi * frequency_Hz * t))
    late = t > t[-1] / 2
    waves = np.stack([f(2 * np.pi * frequency_Hz * t[late]) for f in (np.sin, np.cos)], axis=1)
    return float(np.hypot(*np.linalg.lstsq(waves, out[late], rcond=None)[0]))


def test_a_damper_in_the_path_passes_force_on():
    _, told, build = hidden("resonance", "transmitted")
    f, z = told["frequency"], told["damping_ratio"]
    for ratio in (0.1, 0.7, 1.0, 1.5, 4.0):
        swing = np.hypot(1 - ratio**2, 2 * z * ratio)
        assert gain(build, ratio * f) == pytest.approx(np.hypot(1, 2 * z * ratio) / swing, rel=0.02)


def test_a_third_pole_after_a_resonance():
    _, told, build = hidden("resonance", "amplifier")
    f, z = told["frequency"], told["damping_ratio"]
    omega, t = 2 * np.pi * f, 1e-4 * np.arange(20_000)
    late = float(t[-1] - build.plant.sensor[0][1](t, t)[-1])  # of a ramp: 2 ζ/ω and the pole's own
    pole = 1 / (late - 2 * z / omega)
    assert 1.99 < pole / omega < 4.01
    for ratio in (0.2, 1.0, 2.0):
        wanted = 1 / np.hypot(1 - ratio**2, 2 * z * ratio) / np.hypot(1, ratio * omega / pole)
        assert gain(build, ratio * f) == pytest.approx(wanted, rel=0.02)


@pytest.mark.parametrize("shape", shapes_of("sensor_lag", "fourth"))
@pytest.mark.parametrize("size", [0.05, 1.0])
def test_a_filter_is_late_by_its_delay(shape, size):
    motion = Path(0.0, np.inf).to(2.0, 10.0).hold(0.2).motion()
    fine, told, _ = hidden("sensor_lag", shape, size, motion=motion)
    tau, t = told["time_constant"], fine.time_s
    ramp = (t > 20 * tau + 1e-3) & (t < 0.2)
    assert np.allclose(fine.force_N[ramp], 30 * (t[ramp] - tau), atol=1e-3) and ramp.sum() > 200
    assert fine.force_N[-1] == pytest.approx(6.0, abs=1e-6)


def test_a_part_passes_at_once_and_a_filter_has_its_ripple():
    _, told, build = hidden("sensor_lag", "partly")
    passes = gain(build, 2000.0)
    late_s = told["time_constant"] / (1 - passes)
    assert 0.19 < passes < 0.41
    for frequency in (5.0, 30.0, 100.0):
        s = 2j * np.pi * frequency * late_s
        assert gain(build, frequency) == pytest.approx(abs((1 + passes * s) / (1 + s)), rel=0.01)
    _, told, build = hidden("sensor_lag", "chebyshev", 2.5)
    gains = [gain(build, f) for f in np.linspace(0.02, 1.0, 60) / told["time_constant"]]
    # Half a decibel above that of a constant, twice with four poles, then down.
    assert max(gains) == pytest.approx(10 ** (0.5 / 20), rel=5e-3) and gains[-1] < 0.1
    rises = np.flatnonzero((np.diff(gains)[:-1] > 0) & (np.diff(gains)[1:] < 0))
    assert len(rises) == 2


def test_delays_of_blocks_and_of_a_busy_bus():
    motion = Path(-0.5).to(1.5, 2.0).hold(3.0).to(-0.5, 2.0).hold(200.0).motion()
    _, told, build = hidden("force_delay", "blocks", motion=motion)
    t = np.arange(200_000) / 1000
    late = (t - build.delays[0](t, None)) / told["delay"]
    assert np.mean(late) == pytest.approx(1.0, abs=0.03) and np.std(late) == pytest.approx(0.2, rel=0.15)
    lengths = np.diff(np.flatnonzero(np.abs(np.diff(late)) > 1e-9)) / 1000
    assert 0.015 < np.median(lengths) < 0.065 and np.std(lengths) < 0.15 * np.mean(lengths)
    _, told, build = hidden("force_delay", "busy_bus", motion=motion)
    late = (t - build.delays[0](t, None)) / told["delay"]
    moves = np.abs(motion.velocity(t)) > 0.01
    assert np.allclose(late[moves], 1.0) and np.ptp(late[~moves & (t > 5)]) < 1e-9 and 0.49 < late[-1] < 0.81


def test_samples_that_slip():
    _, told, build = hidden("clock_skew", "slipped_samples")
    t = np.arange(60_000) / build.rate_hz
    off = (t - build.delays[0](t, None)) * build.rate_hz * np.sign(told["skew"])
    # Each sample is a whole number of samples off, ever more: by the skew in the mean.
    assert np.allclose(off, np.round(off), atol=1e-6) and np.all(np.diff(np.round(off)) >= 0)
    assert np.all(np.abs(off - 1e-6 * abs(told["skew"]) * t * build.rate_hz) < 1.001) and off[-1] >= 4


def test_a_clock_that_is_slewed():
    long = QUIET | {"own_clock": True, "motion": Path(-0.5).to(1.0, 1.0).hold(60.0).to(-0.5, 1.0).motion()}
    case = draw_case(3, ("clock_skew",), 1.0, "slewed", **long)
    t, off = case.truth.force_true_time_s, case.force_time_s - case.truth.force_true_time_s
    skew, rates = 1e-6 * case.truth.parameters["clock_skew"]["skew"], np.diff(off) / np.diff(t)
    assert off[-1] - off[0] == pytest.approx(skew * (t[-1] - t[0]), rel=0.01)
    fast, slow = np.quantile(np.abs(rates), [0.95, 0.05])
    assert slow / fast == pytest.approx(0.4 / 1.4, rel=1e-3)
    assert np.mean(np.abs(rates) > 0.99 * fast) == pytest.approx(0.6, abs=0.1)


def test_a_cable_that_pulls():
    fine, told, build = hidden("force_bias", "cable")
    x, added = fine.reported_mm, fine.force_N - fine.pad_N
    order = np.argsort(x)
    assert np.interp(1.0, x[order], added[order]) == pytest.approx(told["bias"])
    ends = np.interp([0.0, 2.0], x[order], added[order]) / told["bias"]
    assert 0.09 < abs(ends[1] - ends[0]) < 0.21 and np.mean(ends) == pytest.approx(1.0)


def test_drift_of_a_battery_and_of_a_door():
    t = np.linspace(0, SHORT.duration_s, 20_000)
    for shape in ("battery", "door"):
        samples, told = disturbed("force_drift", shape, t)
        slope = np.diff(samples.clean_N) / np.diff(t) / told["rate"]
        assert samples.clean_N[0] == 0 and slope[0] == pytest.approx(1.0, rel=1e-3)
        if shape == "battery":
            assert np.allclose(np.diff(slope), np.diff(slope)[0], atol=1e-7) and 1.49 < slope[-1] < 2.26
        else:
            assert np.all(
                np.isclose(slope, 1.0) | np.isclose(slope, 0.25) | (np.arange(len(slope)) == np.sum(slope > 0.9))
            )
            assert 0.39 < np.mean(slope > 0.5) < 0.71


def test_hum_that_grows_with_the_load():
    _, told, build = hidden("mains_hum", "excitation")
    (_, stage), t = build.plant.sensor[0], 1e-4 * np.arange(40_000)
    swings, stated = [], []
    for load in (0.0, 0.5, 1.0):
        force = np.full_like(t, load * build.force_N)
        swings.append(np.sqrt(2) * np.std(stage(t, force) - force))
        stated.append(told["amplitude"])
    assert np.allclose(swings, stated, rtol=1e-2) and np.allclose(
        np.array(swings) / swings[1], [0.7, 1.0, 1.3], rtol=0.01
    )
    stage(t, np.where(t < 1.0, build.force_N, 0.0))  # a quarter of the time at the greatest load
    assert told["amplitude"] == pytest.approx((0.25 * 1.3 + 0.75 * 0.7) * stated[1], rel=1e-3)


# --- faults ---------------------------------------------------------------------------------------------------------


def test_a_stop_bears_with_the_cell():
    _, told, build = hidden("saturation", "overload_stop")
    ramp = np.linspace(0, 10.0, 1001)
    samples = Samples(ramp, ramp.copy(), ramp.copy(), 0.01)
    ((order, stage),) = build.samples
    stage(samples, np.random.default_rng(0))
    limit = told["limit"]
    below, slope = ramp <= limit, np.diff(samples.clean_N[ramp > limit + 0.02]) / 0.01
    assert order == SATURATION and 7.0 < limit < 8.9 and np.array_equal(samples.flags["saturated"], ~below)
    assert np.array_equal(samples.clean_N[below], ramp[below]) and np.allclose(slope, slope[0])
    assert 0.019 < slope[0] < 0.061 and np.allclose(samples.force_N, samples.clean_N)


@pytest.mark.parametrize("shape", shapes_of("outliers", "fourth"))
def test_outliers(shape):
    case = draw_case(2, ("outliers",), 1.0, shape, **MANY)
    truth, hit = case.truth, case.truth.flags["outlier"]
    sizes = np.abs(truth.fault_N) / truth.noise.std
    assert hit.mean() == pytest.approx(truth.parameters["outliers"]["fraction"]) and 0.002 < hit.mean() < 0.01
    assert np.all(sizes[~hit] == 0)
    where = np.flatnonzero(hit)
    if shape == "doublets":
        first, second = truth.fault_N[where[::2]], truth.fault_N[where[1::2]]
        assert np.all(np.diff(where)[::2] == 1) and np.all(first * second < 0) and np.all(sizes[hit] > 14.9)
        assert np.all(np.abs(first) >= 19.9 * truth.noise.std) and np.all(np.abs(second) < np.abs(first))
    elif shape == "switching":
        v = np.abs(truth.motion.velocity(truth.force_true_time_s)) > 0
        changes = truth.force_true_time_s[1:][np.diff(v.astype(int)) != 0]
        since = truth.force_true_time_s[hit, None] - changes
        assert np.all(np.min(np.where(since > -2e-3, since, 1.0), axis=1) < 0.0205) and sizes[hit].min() > 19.9
    else:
        assert np.allclose(case.force_N[hit] * 10, truth.clean_N[hit], atol=6 * truth.noise.std)
        assert sizes[hit].min() > 17


@pytest.mark.parametrize("shape", shapes_of("stuck_samples", "fourth"))
def test_stuck_samples(shape):
    case = draw_case(2, ("stuck_samples",), 1.0, shape, **MANY)
    stuck = case.truth.flags["stuck"]
    where = np.flatnonzero(stuck)
    assert stuck.mean() == pytest.approx(case.truth.parameters["stuck_samples"]["fraction"])
    assert 0.005 < stuck.mean() < 0.017 and np.array_equal(case.force_N[stuck], case.force_N[where - 1])
    begins = where[~stuck[where - 1]]
    if shape == "self_calibration":
        lengths = [int(np.argmin(stuck[b:])) for b in begins[:-1]]
        assert np.ptp(np.diff(begins)) == 0 and np.ptp(lengths) == 0 and 10 <= lengths[0] <= 25
    else:
        # Two of three within a bad time: runs of three in the mean, close to each other.
        lengths = [int(np.argmin(stuck[b:])) for b in begins[:-1]]
        assert 2.0 < np.mean(lengths) < 4.5 and np.median(np.diff(begins)) < 12
