"""The third shapes of the catalogue's effects against closed forms."""

import numpy as np
import pytest

from .cases import draw_case
from .effects.third_machine import Asperities, _bouc_wen, _fundamental, _gms, _lip
from .laws import Power
from .motion import Path, rich
from .sets import shapes_of
from .test_truth_effects import SHORT, disturbed, hidden, numbers

pytestmark = pytest.mark.long

QUIET = {"noise_N": 1e-6, "jitter": "none", "own_clock": False, "rate_hz": 1000.0, "motion": SHORT, "law": "power"}


# --- frame, play, guide ---------------------------------------------------------------------------------------------


def test_joints():
    ramp = Path(-0.5).to(2.0, 20.0).hold(0.2).motion()
    closing = {"frame_form": 3, "frame_mm_N": 0.01, "frame_force_N": 1.0, "frame_stiff_share": 2.5}
    fine = numbers(ramp, **closing)
    given, force = fine.reported_mm - fine.probe_mm, fine.cell_N
    assert np.allclose(given, 0.01 * force + 0.015 * np.minimum(force, 1.0), atol=1e-9) and force.max() > 4
    fine = numbers(ramp, frame_form=4, frame_mm_N=0.05, frame_force_N=0.3)
    given, force = fine.reported_mm - fine.probe_mm, fine.cell_N
    assert np.allclose(given, 1.5 * 0.05 * 0.3 * ((1 + force / 0.3) ** (2 / 3) - 1), atol=1e-9)


@pytest.mark.parametrize("shape", shapes_of("frame_compliance", "third"))
def test_the_compliance_stated_is_the_secant(shape):
    fine, told, build = hidden("frame_compliance", shape, motion=Path(-0.5).to(2.0, 20.0).hold(0.1).motion())
    given, at = fine.reported_mm - fine.probe_mm, 0.6 * build.force_N
    order = np.argsort(fine.cell_N)
    assert np.interp(at, fine.cell_N[order], given[order]) / at == pytest.approx(told["compliance"], rel=2e-3)
    # Stiffer the greater the force.
    assert given[-1] / fine.cell_N[-1] < 0.97 * told["compliance"]


@pytest.mark.parametrize("shape", shapes_of("frame_compliance", "third"))
@pytest.mark.parametrize("id", ["friction", "adhesion", "viscous_damping", "stress_softening", "damage"])
def test_the_frame_goes_with_other_effects(shape, id):
    shapes = {"frame_compliance": shape, id: shapes_of(id, "third")[-1]}
    plain = {"motion": SHORT, "rate_hz": 500.0, "law": "power", "contact": "unilateral"}
    truth = draw_case(7, ("frame_compliance", id), 1.0, shapes, **plain).truth
    fine, compliance = truth.fine, truth.parameters["frame_compliance"]["compliance"]
    given, at = fine.reported_mm - fine.probe_mm, 0.6 * truth.drawn.force_N
    # One curve of deflection over force, whatever else there is, and the one stated.
    order = np.argsort(fine.cell_N)
    force, curve = fine.cell_N[order], given[order]
    assert np.min(np.diff(curve)[np.diff(force) > 1e-9]) > -1e-8
    if force[-1] > at:
        assert np.interp(at, force, curve) / at == pytest.approx(compliance, rel=5e-3)


def test_worn_and_wound_up_plays():
    motion = Path(-0.5).to(1.5, 5.0).to(-0.5, 5.0).motion()
    fine, told, _ = hidden("backlash", "worn", motion=motion, depth=1.5)
    back = (fine.time_s > 0.42) & (fine.reported_mm > 0) & (fine.time_s < 0.79)
    x, lost = fine.reported_mm[back], (fine.probe_mm - fine.reported_mm)[back]
    assert lost[np.argmin(np.abs(x - 0.75))] > 1.19 * told["gap"]
    assert np.trapezoid(lost[::-1], x[::-1]) / np.ptp(x) == pytest.approx(told["gap"], rel=0.02)
    fine, told, _ = hidden("backlash", "wind_up", motion=motion)
    x, lost = fine.reported_mm, fine.probe_mm - fine.reported_mm
    turned = np.argmax(x)
    way, open_share = x[turned] - x[turned:], lost[turned:] / told["gap"]
    length = -way[20] / np.log1p(-open_share[20])
    assert 0.49 < length / told["gap"] < 1.01 and np.allclose(open_share, -np.expm1(-way / length), atol=1e-7)
    assert np.all(np.abs(lost[:turned]) < 1e-12) and lost[-2] == pytest.approx(told["gap"])


def test_tips_of_exponential_height():
    law = Asperities(Power(3.0, 0.0), 0.01)
    heights = np.linspace(0, 4, 100_001)
    mean = np.trapezoid(heights * np.exp(-heights), heights) / np.trapezoid(np.exp(-heights), heights)
    assert law.mean_mm == pytest.approx(0.01 * (4 - mean))
    # Far in it is a plane at the mean height; at first the few highest tips alone are met.
    assert law.force(1.0) == pytest.approx(3 * (1 - law.mean_mm)) and law.force(0.0) == 0
    assert 0 < law.force(0.01) < 0.1 * 3 * 0.01


def test_friction_by_direction_and_by_load():
    motion = Path(-1.5).hold(0.1).to(-0.5, 20.0).hold(0.1).to(-1.5, 20.0).hold(0.1).motion()
    fine, told, _ = hidden("friction", "asymmetric", motion=motion)
    v = motion.velocity(fine.time_s)
    there, back = (fine.force_N[np.sign(v) == s][50:-1] for s in (1, -1))
    assert np.ptp(there) < 1e-9 and np.ptp(back) < 1e-9
    assert (there[0] - back[0]) / 2 == pytest.approx(told["coulomb"])
    assert 0.14 < abs(there[0] + back[0]) / 2 / told["coulomb"] < 0.36
    motion = Path(-0.5).to(2.0, 5.0).to(-0.5, 5.0).motion()
    fine, told, _ = hidden("friction", "loaded", motion=motion)
    friction, x, up = fine.force_N - fine.pad_N, fine.reported_mm, motion.velocity(fine.time_s) > 0
    levels = [np.interp(d, x[up], friction[up]) / told["coulomb"] for d in (-0.2, 1.0, 1.9)]
    assert levels[1] == pytest.approx(1.0, abs=1e-3) and 0.69 < levels[0] < 0.81
    assert levels[2] - levels[1] == pytest.approx(0.9 * (levels[1] - levels[0]), rel=1e-2)  # a spring's load


def test_bouc_wen_in_closed_form():
    x = np.concatenate([np.linspace(0, 3, 301), np.linspace(3, 0, 301)[1:]])
    z = _bouc_wen(x, 1.0)
    assert np.allclose(z[:301], np.tanh(x[:301]), atol=1e-9)
    back = 3 - x[301:]
    straight = back <= z[300]
    assert np.allclose(z[301:][straight], z[300] - back[straight], atol=1e-9)
    assert np.allclose(z[301:][~straight], -np.tanh(back[~straight] - z[300]), atol=1e-9)
    assert np.allclose(_bouc_wen(x, 1.0)[::50], _bouc_wen(x[::50], 1.0), atol=1e-9)  # whatever the step


def test_maxwell_slip_with_a_memory():
    ends, shares, h = np.array([0.002, 0.02]), np.array([0.7, 0.3]), 1e-4
    x = np.concatenate([np.linspace(0, 0.02, 4001), 0.02 + 0.002 * np.arange(1, 4001)])
    z = _gms(x, h, ends, shares, 0.4, 2.0, 0.01)
    # 0.05 mm/s: as at rest, the weak element slips later. Then 20 mm/s: the level falls within the memory.
    assert z[300] == pytest.approx(0.7 * 0.75 + 0.3 * 0.075, rel=1e-3)
    assert z[2000] == pytest.approx(0.7 * 1.4 + 0.3 * 0.5, rel=1e-3)
    assert z[-1] == pytest.approx(1.0, abs=1e-6) and z[4101] == pytest.approx(1 + 0.4 / np.e, rel=0.01)


def test_a_rubber_lip_lets_go_at_rest():
    x = np.concatenate([np.linspace(0, 1, 1001), np.full(20_000, 1.0)])
    z = _lip(x, 1e-4, 0.004, 0.7, 0.5)
    assert z[1000] == pytest.approx(1.0, abs=1e-3)
    assert z[-1] == pytest.approx(0.7 + 0.3 * np.exp(-2.0 / 0.5), rel=1e-3)


def test_a_chain_has_a_mass_for_each_place():
    # The energy of m(x) v²/2 and nothing else: force times speed is its rate.
    motion = Path(-0.5, 500.0).to(2.0, 30.0).motion()
    fine, told, build = hidden("inertia", "cable_chain", motion=motion)
    mass = np.array([build.plant.felt[0](0, x, 0.0, 1.0) for x in (0.0, 1.0, 2.0)])
    assert mass[1] == pytest.approx(1e-3 * told["mass"]) and mass[2] - mass[1] == pytest.approx(mass[1] - mass[0])
    t = np.linspace(0, motion.duration_s, 20_001)
    x, v = motion.position(t), motion.velocity(t)
    energy = np.array([build.plant.felt[0](0, p, 0.0, 1.0) for p in x]) * v**2 / 2
    a = np.gradient(v, t)
    power = build.plant.felt[0](t, x, v, a) * v
    gained = np.concatenate([[0.0], np.cumsum((power[1:] + power[:-1]) / 2 * np.diff(t))])
    assert np.max(np.abs(gained - energy)) < 2e-3 * energy.max()


def test_ripples_have_their_first_harmonic():
    assert _fundamental(np.sin) == pytest.approx(1) and _fundamental(lambda a: np.sign(np.sin(a))) == pytest.approx(
        4 / np.pi, rel=1e-3
    )
    for shape in shapes_of("cogging", "third"):
        _, told, build = hidden("cogging", shape)
        x = np.linspace(0, 20 * told["period"], 40_000, endpoint=False)
        wave = build.plant.felt[0](0.0, x, 0.0, 0.0)[20_000:]  # sliding one way
        spectrum = 2 * np.abs(np.fft.rfft(wave)) / len(wave)
        assert spectrum[10] == pytest.approx(told["amplitude"], rel=2e-3)
        assert spectrum[30] > 0.08 * spectrum[10] if shape == "slotted" else spectrum[30] < 1e-3 * spectrum[10]
    there, back = wave, build.plant.felt[0](0.0, x[::-1].copy(), 0.0, 0.0)[:20_000][::-1]
    turn = np.angle(np.fft.rfft(there)[10] / np.fft.rfft(back)[10])
    assert 2 * np.pi * 0.039 < -turn < 2 * np.pi * 0.101  # trails by 2 to 5 % of a period either way
    for shape in shapes_of("encoder_error", "third"):
        _, told, build = hidden("encoder_error", shape)
        x = np.linspace(0, 10 * told["period"], 20_000, endpoint=False)
        spectrum = 2 * np.abs(np.fft.rfft(build.plant.encoder[0](0.0, x) - x)) / len(x)
        assert spectrum[10] == pytest.approx(told["amplitude"], rel=0.02) and spectrum[20] > 0.1 * spectrum[10]


# --- sensor ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", shapes_of("sensor_lag", "third"))
@pytest.mark.parametrize("size", [0.05, 1.0])
def test_a_filter_is_late_by_its_delay(shape, size):
    motion = Path(0.0, np.inf).to(2.0, 10.0).hold(0.2).motion()
    fine, told, _ = hidden("sensor_lag", shape, size, motion=motion)
    tau, t = told["time_constant"], fine.time_s
    ramp = (t > 15 * tau + 1e-3) & (t < 0.2)
    assert np.allclose(fine.force_N[ramp], 30 * (t[ramp] - tau), atol=1e-3)
    assert fine.force_N[-1] == pytest.approx(6.0, abs=1e-6)


def test_filters_are_those_of_bessel_and_butterworth():
    for shape in ("butterworth", "bessel"):
        _, told, build = hidden("sensor_lag", shape, 2.5)
        t = np.arange(0, 2, 1e-4)
        # Butterworth of three poles has −3 dB at ω = 2/τ; Bessel's polynomial of four is that of Thomson.
        omega = (2.0 if shape == "butterworth" else 1.0) / told["time_constant"]
        out = build.plant.sensor[0][1](t, np.sin(omega * t))[t > 1]
        drop = 1 / np.sqrt(2) if shape == "butterworth" else 105 / abs(1j**4 + 10 * 1j**3 + 45 * 1j**2 + 105j + 105)
        assert np.max(np.abs(out)) == pytest.approx(drop, rel=2e-3)


def test_a_loaded_resonance_goes_with_the_load():
    _, told, build = hidden("resonance", "loaded")
    (_, stage), t, most = build.plant.sensor[0], np.arange(0, 0.6, 1e-4), build.force_N
    rings = []
    for load in (0.0, 0.5 * most, most):
        step = np.where(t > 0.01, load + 1e-4, load)
        out = (stage(t, step) - load)[t > 0.0101] / 1e-4 - 1
        crossings = np.flatnonzero(np.diff(np.sign(out)))[:6]
        rings.append(0.5 / np.mean(np.diff(t[crossings])))
    damped = told["frequency"] * np.sqrt(1 - told["damping_ratio"] ** 2)
    assert rings[1] == pytest.approx(damped, rel=0.02) and rings[0] < rings[1] < rings[2]
    assert 1.09 < rings[2] / rings[0] < 1.24  # the root of 0.8/1.2 to 0.9/1.1
    assert stage(t, np.full_like(t, 2.0))[-1] == 2.0


def test_a_close_pair_beats():
    _, told, build = hidden("resonance", "close_pair", 0.5)
    (_, stage), t = build.plant.sensor[0], np.arange(0, 4, 1e-4)
    out = stage(t, np.where(t > 0.1, 1.0, 0.0)) - 1
    spectrum, at = np.abs(np.fft.rfft(out[t > 0.1])), np.fft.rfftfreq(int(np.sum(t > 0.1)), 1e-4)
    near = (at > 0.5 * told["frequency"]) & (at < 2 * told["frequency"])
    assert out[-1] == pytest.approx(0, abs=1e-3)
    assert 0.95 < at[near][np.argmax(spectrum[near])] / told["frequency"] < 1.1


def test_delays_have_their_mean():
    for shape in shapes_of("force_delay", "third"):
        _, told, build = hidden("force_delay", shape)
        t = np.arange(100_000) / 1000
        late = t - build.delays[0](t, np.random.default_rng(0))
        assert np.mean(late) == pytest.approx(told["delay"], rel=0.03) and np.std(late) > 0.1 * told["delay"]
        assert late.min() > 0.69 * told["delay"]


def test_clocks_that_are_set():
    case = draw_case(3, ("clock_skew",), 1.0, "resynchronised", **(QUIET | {"own_clock": True}))
    t, off = case.truth.force_true_time_s, case.force_time_s - case.truth.force_true_time_s
    skew, jump = 1e-6 * case.truth.parameters["clock_skew"]["skew"], np.argmax(np.diff(off))
    assert skew < 0 and np.allclose(np.diff(off)[:jump], skew * np.diff(t)[:jump], atol=1e-12)
    assert 0.19 < -(off[jump + 1] - off[jump]) / (skew * t[jump]) < 0.34
    case = draw_case(3, ("clock_skew",), 1.0, "thermostat", **(QUIET | {"own_clock": True}))
    t, off = case.truth.force_true_time_s, case.force_time_s - case.truth.force_true_time_s
    skew = 1e-6 * case.truth.parameters["clock_skew"]["skew"]
    assert off[-1] == pytest.approx(skew * t[-1], rel=0.1)
    assert np.ptp(np.diff(off) / np.diff(t)) > 0.1 * abs(skew)


def test_bias_drift_and_hum():
    t = np.linspace(0, SHORT.duration_s, 20_000)
    samples, told = disturbed("force_bias", "wavers", t)
    assert np.all(np.abs(samples.clean_N / told["bias"] - 1) < 0.101) and np.ptp(samples.clean_N) > 0
    for shape in shapes_of("force_drift", "third"):
        samples, told = disturbed("force_drift", shape, t)
        assert samples.clean_N[0] == 0 and samples.clean_N[5] / t[5] == pytest.approx(told["rate"], rel=2e-3)
    assert np.all(np.diff(samples.clean_N, 2) * np.sign(told["rate"]) < 1e-12)  # the last one turns
    for shape in shapes_of("mains_hum", "third"):
        samples, told = disturbed("mains_hum", shape, t)
        waves = np.stack([f(2 * np.pi * told["frequency"] * t) for f in (np.sin, np.cos)], axis=1)
        fit = np.linalg.lstsq(waves, samples.clean_N, rcond=None)[0]
        assert np.hypot(*fit) == pytest.approx(told["amplitude"], rel=0.03)
        assert np.std(samples.clean_N - waves @ fit) > 0.08 * told["amplitude"]


# --- faults ---------------------------------------------------------------------------------------------------------


def test_faults():
    plain = {"motion": rich(2.0, (60.0, 8.0)), "rate_hz": 1000.0, "noise_kind": "white"}
    for shape in shapes_of("stuck_samples", "third"):
        case = draw_case(2, ("stuck_samples",), 1.0, shape, **plain)
        stuck, fraction = case.truth.flags["stuck"], case.truth.parameters["stuck_samples"]["fraction"]
        assert stuck.mean() == pytest.approx(fraction) and 0.004 < fraction < 0.016
        where = np.flatnonzero(stuck)
        assert np.array_equal(case.force_N[stuck], case.force_N[where - 1])
        alone = np.mean(~stuck[where - 1])
        assert alone > 0.95 if shape == "half_rate" else alone < 0.5
    for shape in shapes_of("outliers", "third"):
        case = draw_case(2, ("outliers",), 1.0, shape, **plain)
        hit, std = case.truth.flags["outlier"], case.truth.noise.std
        assert hit.mean() == pytest.approx(case.truth.parameters["outliers"]["fraction"])
        assert np.all(case.truth.fault_N[~hit] == 0)
        if shape == "dropouts":
            assert np.all(case.force_N[hit] == 0) and np.all(np.abs(case.truth.clean_N[hit]) > 20 * std)
        else:
            sizes = np.abs(case.truth.fault_N[hit]) / std
            assert sizes.min() > 14.9 and np.mean(sizes > 2**0.5 * 15) == pytest.approx(2**-0.75, abs=0.15)
    case = draw_case(2, ("saturation",), 1.0, "sags", **plain)
    limit, over = case.truth.parameters["saturation"]["limit"], case.truth.flags["saturated"]
    assert case.truth.clean_N.max() <= limit and over.any() and case.force_N[over].min() > 0.965 * limit
