"""The judge's shapes of the force path against closed forms."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import gamma

from .cases import draw_case
from .draw import DrawnPad
from .effects import EFFECTS, Build
from .effects.plant import Plant
from .effects.registry import Samples
from .motion import Path
from .sets import shapes_of
from .test_truth_effects import SPRING, hidden

IDS = ("resonance", "force_delay", "clock_skew", "sensor_lag", "force_bias", "force_drift", "mains_hum")
LONG = Path(-0.5).hold(60.0).motion()
RAMP = Path(0.0, np.inf).to(2.0, 10.0).hold(0.2).motion()  # 30 N/s on the spring of 3 N/mm


def stages(id, shape, size=1.0, seed=0):
    """What was registered, in a recording of a minute, and what is stated."""
    drawn = DrawnPad(SPRING, 2.0, 6.0)
    build = Build(drawn, Plant(SPRING, LONG, 60.0), SPRING, 0.01, 1000.0, np.random.default_rng(seed))
    return build, EFFECTS[id].hide(build, shape, size)


def test_each_id_has_two_shapes_of_its_own():
    for id in IDS:
        shapes = shapes_of(id, "judge")
        assert len(shapes) >= 2 and not set(shapes) & set(EFFECTS[id].shapes)


# --- resonance ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(3))
def test_a_ramp_through_a_damped_mount(seed):
    # 1 − s²/(s² + 2ζω s + ω²): a ramp is not late, it only rings.
    fine, told, _ = hidden("resonance", "mount_transmissibility", motion=RAMP, seed=seed)
    om, z = 2 * np.pi * told["frequency"], told["damping_ratio"]
    t, od = fine.time_s[fine.time_s < 0.2], om * np.sqrt(1 - z**2)
    assert np.allclose(fine.force_N[: len(t)], 30 * (t - np.exp(-z * om * t) * np.sin(od * t) / od), atol=1e-6)


def test_the_moment_at_the_root_of_a_cantilever():
    # Without damping M(0)/(P L) = (sin b + sinh b) / (b (1 + cos b cosh b)), b⁴ = m ω² L³/EI per length.
    build, told = min(
        (stages("resonance", "bending_cantilever", seed=s) for s in range(60)), key=lambda p: p[1]["damping_ratio"]
    )
    (_, stage), t = build.plant.sensor[0], np.arange(0, 3.0, 1e-4)
    assert told["damping_ratio"] < 0.06
    for b in (0.8, 1.2, 3.0, 3.5):
        omega = 2 * np.pi * told["frequency"] * (b / 1.875104) ** 2
        late = t > 1.5
        waves = np.stack([np.sin(omega * t), np.cos(omega * t)], axis=1)[late]
        there = np.linalg.lstsq(waves, stage(t, np.sin(omega * t))[late], rcond=None)[0]
        assert there[0] == pytest.approx((np.sin(b) + np.sinh(b)) / (b * (1 + np.cos(b) * np.cosh(b))), rel=0.015)
    assert np.allclose(stage(t, np.full_like(t, 2.0)), 2.0)


# --- lag, delay, clock ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("size", [0.05, 1.0, 2.5])
def test_lags_of_a_ramp_in_closed_form(size):
    fine, told, _ = hidden("sensor_lag", "bessel_two_pole", size, motion=RAMP)
    tau, t = told["time_constant"], fine.time_s[fine.time_s < 0.2]
    b = np.sqrt(3) / (2 * tau)
    swing = np.exp(-1.5 * t / tau) * (tau * np.cos(b * t) + tau / np.sqrt(3) * np.sin(b * t))
    assert np.allclose(fine.force_N[: len(t)], 30 * (t - tau + swing), atol=1e-6)
    fine, told, _ = hidden("sensor_lag", "sinc3_converter", size, motion=RAMP)
    width = 2 * told["time_constant"] / 3
    x = fine.time_s[fine.time_s < 0.2] / width
    # The ramp of slope 1 through three uniform averages: the integral of the distribution of Irwin and Hall.
    spline = sum(c * np.maximum(x - k, 0) ** 4 for k, c in enumerate((1, -3, 3, -1))) / 24
    assert np.allclose(fine.force_N[: len(x)], 30 * width * spline, atol=30 * 3e-5)
    assert fine.force_N[-1] == pytest.approx(6.0, abs=1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_a_held_value_is_as_old_as_its_conversion(seed):
    build, told = stages("force_delay", "sample_and_hold", seed=seed)
    t = np.arange(1, 20, 1.7e-5)
    of = build.delays[0](t, None)
    beats = np.unique(np.round(of, 9))
    period, age = np.diff(beats).mean(), t - of
    assert np.allclose(np.diff(beats), period, atol=1e-8) and 0.6 < period / told["delay"] < 1.2
    assert age.min() == pytest.approx(told["delay"] - period / 2, abs=2e-5)
    assert age.max() == pytest.approx(told["delay"] + period / 2, abs=2e-5)
    assert age.mean() == pytest.approx(told["delay"], rel=1e-3)


def test_waits_in_the_queue_are_of_a_gamma_distribution():
    means, shares, least = [], [], []
    for seed in range(40):
        build, told = stages("force_delay", "queued_link", seed=seed)
        age = (np.arange(0, 60, 0.05) - build.delays[0](np.arange(0, 60, 0.05), None)) / told["delay"]
        means.append(age.mean())
        wait = age - age.min()
        shares.append([np.mean(wait < gamma.ppf(q, 2) / 2 * wait.mean()) for q in (0.25, 0.5, 0.9)])
        least.append(age.min())
    assert np.std(means) < 0.03 and np.mean(means) == pytest.approx(1.0, abs=0.01)
    assert np.allclose(np.mean(shares, axis=0), (0.25, 0.5, 0.9), atol=0.02)
    assert np.all((np.array(least) > 0.49) & (np.array(least) < 0.78))


def test_a_count_that_loses_samples():
    for seed in range(4):
        build, told = stages("clock_skew", "lost_samples", seed=seed)
        t = np.arange(0, 60, 1e-3)
        behind = build.delays[0](t, None) - t
        jumps = np.diff(behind)
        gap = jumps.max()
        assert np.all(np.isclose(jumps, 0, atol=1e-9) | np.isclose(jumps, gap, atol=1e-9)) and behind[0] == 0
        # The count has told t when t (1 + losses per second of it × gap) had passed; off by one loss at most.
        assert told["skew"] < 0
        assert abs(t[-1] / (1 + 1e-6 * told["skew"]) - t[-1] - behind[-1]) < gap


def test_clocks_that_agree_midway_and_one_that_walks():
    quiet = {"noise_N": 1e-6, "jitter": "none", "own_clock": False, "rate_hz": 700.0, "motion": LONG}
    truth = draw_case(3, ("clock_skew",), 1.0, "aligned_midway", **quiet).truth
    build, told = stages("clock_skew", "aligned_midway")
    t = np.linspace(0, 60, 6001)
    of = build.delays[0](t, None)
    assert np.allclose(np.diff(t) / np.diff(of) - 1, 1e-6 * told["skew"], atol=1e-9)
    assert 20 < np.interp(0, np.sign(told["skew"]) * (t - of), t) < 40
    assert truth.shapes == {"clock_skew": "aligned_midway"}
    steps = []
    for seed in range(60):
        build, told = stages("clock_skew", "random_walk_fm", seed=seed)
        assert build.own_clock
        stamps = build.stamps[0](t)
        assert stamps[0] == 0 and stamps[-1] / 60 - 1 == pytest.approx(1e-6 * told["skew"], rel=1e-6)
        rate = np.diff(stamps)[::1000] / 0.01 - 1  # each 10 s
        steps.append(np.diff(rate) / (1e-6 * told["skew"]))
    # A walk of a quarter in a minute goes that by the root of 1/6 in ten seconds.
    assert np.std(steps) == pytest.approx(0.25 / np.sqrt(6), rel=0.15) and abs(np.mean(steps)) < 0.03


# --- what is added --------------------------------------------------------------------------------------------------


def added(id, shape, t, seed=0):
    build, told = stages(id, shape, seed=seed)
    samples = Samples(t, np.zeros_like(t), np.zeros_like(t), 0.01)
    for _, stage in build.samples:
        stage(samples, np.random.default_rng(seed))
    assert np.array_equal(samples.clean_N, samples.force_N)
    return samples.clean_N, told


def test_a_zero_that_flickers():
    t, size, spectra = np.arange(0, 60, 0.02), [], []
    for seed in range(30):
        force, told = added("force_bias", "flicker_zero", t, seed)
        assert force.mean() == pytest.approx(told["bias"], rel=1e-3) and 0.029 < abs(told["bias"]) < 0.081
        off = force / told["bias"] - 1
        size.append(off.std())
        spectra.append(np.abs(np.fft.rfft(off * np.hanning(len(t)))) ** 2)
    assert 0.03 < np.mean(size) < 0.05 and max(size) < 0.08
    f, power = np.fft.rfftfreq(len(t), 0.02), np.mean(spectra, axis=0)
    band = (f > 0.04) & (f < 0.6)
    assert np.polyfit(np.log(f[band]), np.log(power[band]), 1)[0] == pytest.approx(-1.0, abs=0.25)


def test_a_zero_that_breathes():
    t = np.arange(0, 60, 0.1)
    for seed in range(4):
        force, told = added("force_bias", "breathing_zero", t, seed)
        off, bend = force - told["bias"], np.gradient(np.gradient(force, 0.1), 0.1)
        omega2 = -np.polyfit(off[5:-5], bend[5:-5], 1)[0]  # a sine about the bias
        assert 20 < 2 * np.pi / np.sqrt(omega2) < 50
        swing = np.hypot(off[5:-5], np.gradient(off, 0.1)[5:-5] / np.sqrt(omega2))
        assert np.allclose(swing, 0.08 * abs(told["bias"]), rtol=0.01)


@pytest.mark.parametrize("seed", range(4))
def test_drifts_by_the_equations_they_solve(seed):
    t = np.arange(0, 60, 1e-3)
    for shape in ("two_stage_warmup", "room_swing"):
        force, told = added("force_drift", shape, t, seed)
        assert force[0] == 0 and force[1] / 1e-3 == pytest.approx(told["rate"], rel=1e-3)
        # Prony: rates 3 s apart go on as the two roots of their recursion say.
        rates = (np.diff(force) / 1e-3)[::3000]
        now = np.stack([rates[1:-1], rates[:-2]], axis=1)
        first, second = np.linalg.lstsq(now, rates[2:], rcond=None)[0]
        roots = np.roots([1, -first, -second])
        if shape == "room_swing":
            assert np.allclose(np.abs(roots), 1, atol=1e-4)
            assert 150 < 2 * np.pi * 3 / abs(np.angle(roots[0])) < 400
        else:
            quick, slow = np.sort(-3 / np.log(roots))
            shares = np.linalg.lstsq(
                np.exp(-np.outer(3.0 * np.arange(20), 1 / np.array([quick, slow]))), rates, rcond=None
            )[0]
            assert 2.9 < quick < 10.1 and 59 < slow < 201
            assert 0.24 < shares[0] / told["rate"] < 0.46 and shares.sum() == pytest.approx(told["rate"], rel=1e-3)


def line(force, t, frequency):
    """Amplitude of one line over the whole of a long recording."""
    window = np.hanning(len(t))
    return 2 * abs(np.sum(window * force * np.exp(-2j * np.pi * frequency * t))) / window.sum()


@pytest.mark.parametrize("seed", range(4))
def test_lines_of_a_supply_and_of_a_rectifier(seed):
    t = np.arange(0, 20, 5e-5)
    force, told = added("mains_hum", "supply_ripple", t, seed)
    lines = [line(force, t, n * told["frequency"]) / told["amplitude"] for n in (0.5, 1, 1.5, 2, 3, 4, 5)]
    assert np.allclose(lines, [0, 1, 0, 1 / 2, 1 / 3, 1 / 4, 0], atol=1e-4)
    assert min(abs(told["frequency"] - 100), abs(told["frequency"] - 120)) < 0.11
    force, told = added("mains_hum", "rectifier_pulses", t, seed)
    assert min(abs(told["frequency"] - 50), abs(told["frequency"] - 60)) < 0.051
    half = np.pi / 2 * np.mean(force != 0)
    pulse = [quad(lambda a, n=n: np.cos(np.pi * a / (2 * half)) * np.cos(n * a), 0, half)[0] for n in (1, 3, 5)]
    lines = [line(force, t, n * told["frequency"]) / told["amplitude"] for n in (1, 2, 3, 5)]
    assert np.allclose(lines, [1, 0, pulse[1] / pulse[0], abs(pulse[2]) / pulse[0]], atol=3e-3)
    assert np.max(np.abs(force)) == pytest.approx(np.pi / 4 / pulse[0] * told["amplitude"], rel=1e-3)
