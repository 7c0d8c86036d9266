"""The hidden effects against closed forms, the cases against what they promise, detectability against arithmetic."""

import numpy as np
import pytest

from . import draw
from .cases import PROTOCOLS, draw_case, null_case, protocol
from .effects import EFFECTS, Build
from .effects.curves import Foam, MooneyRivlin, Rounded, TwoSlope
from .effects.plant import Plant, acceleration
from .effects.plant import simulate as fine_steps
from .effects.registry import Samples
from .effects.structure import _stretched
from .laws import Exponential, Power
from .motion import Path, rich, sampled, sinusoids
from .pad import Pad, simulate
from .sets import shapes_of

SPRING = Pad(Power(3.0, 0.0))  # 3 N/mm, no relaxation
SHORT = rich(2.0, (60.0, 8.0), hold_s=0.15, long_hold_s=0.6)


def hidden(id, shape, size=1.0, pad=SPRING, motion=SHORT, seed=0, depth=2.0):
    """One effect in a plant: (fine steps, the contract's parameters, build)."""
    drawn = draw.DrawnPad(pad, depth, float(pad.law.force(depth)))
    rng = np.random.default_rng(seed)
    build = Build(drawn, Plant(pad, motion, motion.duration_s), pad, 0.01, 1000.0, rng)
    told = EFFECTS[id].hide(build, shape, size)
    return fine_steps(build.plant), told, build


def numbers(motion, pad=SPRING, **told):
    return fine_steps(Plant(pad, motion, motion.duration_s, numbers=told))


# --- no effect ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(8))
def test_without_effects_it_is_the_exact_pad(seed):
    rng = np.random.default_rng(seed)
    drawn = draw.pad(rng, laws=draw.LAWS + draw.OTHER_LAWS)
    motion = protocol(rng, PROTOCOLS[seed % 4], drawn.depth_mm)
    t = np.arange(0, 20, 0.0103)
    exact = simulate(drawn.pad, motion, t).force_N
    for told in ({}, {"frame_form": 1, "frame_mm_N": 1e-9}):
        fine = fine_steps(Plant(drawn.pad, motion, 20.0, numbers=told))
        assert np.max(np.abs(fine.at(t) - exact)) < 1e-4
        assert np.array_equal(fine.reported_mm, motion.position(fine.time_s))


def test_acceleration_is_the_derivative_of_velocity():
    motion = sinusoids(0.3, 1.5, [2.0, 3.1], periods=3)
    t = np.linspace(0.2, motion.duration_s - 0.1, 3000)
    t = t[np.min(np.abs(t[:, None] - motion.corners_s()), axis=1) > 1e-4]
    slope = (motion.velocity(t + 1e-5) - motion.velocity(t - 1e-5)) / 2e-5
    assert np.allclose(slope, acceleration(motion, t), atol=1e-3 * np.max(np.abs(slope)))


# --- frame, play, guide ------------------------------------------------------------------------------------------


def test_two_springs_in_series():
    fine = numbers(Path(-0.5).to(2.0, 20.0).hold(0.2).motion(), frame_form=1, frame_mm_N=0.02)
    x = np.maximum(fine.reported_mm, 0)
    assert np.allclose(fine.force_N, 3 * x / (1 + 3 * 0.02), atol=1e-7)


@pytest.mark.parametrize("shape", shapes_of("frame_compliance", "first", "second"))
def test_the_frame_gives_way_by_what_the_cell_feels(shape):
    pad = Pad(Exponential(1.5, 0.6), (0.3, 0.2), (20.0, 1.0))
    fine, told, build = hidden("frame_compliance", shape, pad=pad)
    given, force = fine.reported_mm - fine.probe_mm, fine.cell_N
    at = 0.6 * build.force_N
    assert np.interp(at, np.sort(force), given[np.argsort(force)]) / at == pytest.approx(told["compliance"], rel=5e-3)
    if shape == "linear":
        assert np.allclose(given, told["compliance"] * force, atol=1e-9)
    else:
        hard, soft = given[np.argmax(force)] / force.max(), told["compliance"]
        assert hard > 1.03 * soft if shape == "joint_opens" else hard < 0.97 * soft
    # The pad behind the frame is the plain pad at the probe's own position.
    some = fine.time_s[::20]
    exact = simulate(pad, sampled(fine.time_s[::2], fine.probe_mm[::2]), some).force_N
    assert np.max(np.abs(exact - fine.at(some, "pad_N"))) < 3e-4


@pytest.mark.parametrize("shape", shapes_of("backlash", "first", "second"))
def test_play_is_as_wide_as_stated(shape):
    motion = Path(-0.5).to(1.5, 5.0).to(0.5, 5.0).to(1.5, 5.0).to(-0.5, 5.0).motion()
    fine, told, _ = hidden("backlash", shape, motion=motion)
    behind = fine.probe_mm - fine.reported_mm
    down = (fine.time_s > 0.5) & (fine.time_s < 0.59)
    shift = -told["gap"] / 2 if shape == "centred" else 0.0
    assert np.allclose(behind[(fine.time_s > 0.2) & (fine.time_s < 0.39)], shift, atol=1e-9)
    assert np.allclose(behind[down], told["gap"] + shift, atol=1e-9)


@pytest.mark.parametrize("shape", shapes_of("friction", "first", "second"))
def test_friction_has_its_amplitude_on_either_side(shape):
    motion = Path(-1.5).hold(0.1).to(-0.5, 20.0).hold(0.1).to(-1.5, 20.0).hold(0.1).motion()
    fine, told, _ = hidden("friction", shape, motion=motion)
    v = motion.velocity(fine.time_s)
    steady = np.abs(np.abs(v) - 20.0) < 1e-6
    slid = np.abs(fine.reported_mm + 1.0) < 0.4
    for sign in (1, -1):
        force = fine.force_N[steady & slid & (np.sign(v) == sign)]
        assert np.allclose(force, sign * told["coulomb"], rtol=0.1) and len(force) > 100
    assert fine.force_N[fine.time_s < 0.09].any() == 0
    lug = fine.force_N[(fine.time_s > 0.2) & (fine.time_s < 0.25)]
    assert np.all(lug > 0.85 * told["coulomb"])  # at rest it stays where it was


def test_friction_before_slip_in_closed_form():
    motion = Path(-1.0).to(-0.97, 0.5).motion()
    xs = 4e-3
    for form, expected in ((1, lambda s: np.minimum(s, 1)), (3, lambda s: -np.expm1(-s))):
        fine = numbers(motion, friction_form=form, coulomb_N=0.2, presliding_mm=xs)
        assert np.allclose(fine.force_N, 0.2 * expected((fine.reported_mm + 1) / xs), atol=1e-9)


def test_stribeck_friction_falls_with_speed():
    told = {"coulomb_N": 0.1, "static_share": 0.5, "stribeck_mm_s": 3.0, "presliding_mm": 1e-3}
    for form in (2, 4):
        for speed in (0.2, 2.0, 30.0):
            fine = numbers(Path(-2.0).to(-1.0, speed).motion(), friction_form=form, **told)
            expected = 0.1 * (1 + 0.5 * np.exp(-((speed / 3.0) ** 2)))
            assert fine.at(fine.time_s[-1] * 0.6) == pytest.approx(expected, rel=1e-3)


def test_inertia_cogging_and_encoder_error_in_closed_form():
    motion = sinusoids(-1.5, -0.5, [3.0], periods=4, start_mm=-1.6)
    fine, told, _ = hidden("inertia", "rigid", motion=motion)
    assert np.allclose(fine.force_N, 1e-3 * told["mass"] * acceleration(motion, fine.time_s), atol=1e-12)
    fine, told, _ = hidden("cogging", "sine", motion=motion)
    assert np.max(np.abs(fine.force_N)) == pytest.approx(told["amplitude"], rel=0.2)
    ramp = Path(-9.0, np.inf).to(-0.5, 10.0).motion()
    fine, told, _ = hidden("cogging", "sine", motion=ramp)
    x = fine.reported_mm
    waves = np.stack([np.sin(2 * np.pi * x / told["period"]), np.cos(2 * np.pi * x / told["period"])], axis=1)
    fit = np.linalg.lstsq(waves, fine.force_N, rcond=None)[0]
    assert np.hypot(*fit) == pytest.approx(told["amplitude"]) and np.allclose(waves @ fit, fine.force_N, atol=1e-9)
    for shape in ("reported", "servo"):
        fine, told, _ = hidden("encoder_error", shape, motion=SHORT)
        error = fine.reported_mm - fine.probe_mm
        angle = 2 * np.pi * fine.probe_mm / told["period"]
        waves = np.stack([np.sin(angle), np.cos(angle)], axis=1)
        fit = np.linalg.lstsq(waves, error, rcond=None)[0]
        assert np.hypot(*fit) == pytest.approx(told["amplitude"]) and np.allclose(waves @ fit, error, atol=1e-9)
    assert np.allclose(fine.reported_mm, SHORT.position(fine.time_s), atol=1e-9)  # servo


# --- sensor ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", shapes_of("sensor_lag", "first", "second"))
def test_a_lag_is_late_by_its_time_constant(shape):
    motion = Path(0.0, np.inf).to(2.0, 10.0).hold(0.2).motion()
    fine, told, _ = hidden("sensor_lag", shape, motion=motion)
    tau, t = told["time_constant"], fine.time_s
    ramp = (t > 12 * tau) & (t < 0.2)
    assert np.allclose(fine.force_N[ramp], 30 * (t[ramp] - tau), atol=1e-3)
    if shape == "first_order":
        assert np.allclose(fine.force_N[t < 0.2], (30 * (t + tau * np.expm1(-t / tau)))[t < 0.2], atol=1e-6)
    assert fine.force_N[-1] == pytest.approx(6.0, abs=1e-6)


def test_resonance_of_a_ramp_in_closed_form():
    # y = k [t − 2ζ/ω + e^{−ζωt} (2ζ/ω cos ω_d t + (2ζ² − 1)/ω_d sin ω_d t)]
    motion = Path(0.0, np.inf).to(2.0, 10.0).motion()
    fine, told, _ = hidden("resonance", "second_order", motion=motion)
    om, z = 2 * np.pi * told["frequency"], told["damping_ratio"]
    t = fine.time_s[fine.time_s < 0.2]
    od = om * np.sqrt(1 - z**2)
    ring = np.exp(-z * om * t) * (2 * z / om * np.cos(od * t) + (2 * z**2 - 1) / od * np.sin(od * t))
    assert np.allclose(fine.force_N[: len(t)], 30 * (t - 2 * z / om + ring), atol=1e-6)


def test_smaller_resonances_are_faster():
    small, large = (hidden("resonance", "second_order", size)[1]["frequency"] for size in (0.3, 2.0))
    assert small > 2 * large


def disturbed(id, shape, t, size=1.0, seed=0):
    _, told, build = hidden(id, shape, size, seed=seed)
    samples = Samples(t, np.zeros_like(t), np.zeros_like(t), 0.01)
    for _, stage in build.samples:
        stage(samples, np.random.default_rng(seed))
    return samples, told


def test_bias_drift_and_hum():
    t = np.linspace(0, SHORT.duration_s, 20_000)
    samples, told = disturbed("force_bias", "constant", t)
    assert np.all(samples.clean_N == told["bias"]) and np.array_equal(samples.clean_N, samples.force_N)
    for shape in shapes_of("force_drift", "first", "second"):
        samples, told = disturbed("force_drift", shape, t)
        assert samples.clean_N[0] == 0
        assert samples.clean_N[5] / t[5] == pytest.approx(told["rate"], rel=2e-3)
        assert np.all(np.diff(np.sign(told["rate"]) * samples.clean_N) > 0)
    for shape in shapes_of("mains_hum", "first", "second"):
        samples, told = disturbed("mains_hum", shape, t)
        waves = np.stack([f(2 * np.pi * told["frequency"] * t) for f in (np.sin, np.cos)], axis=1)
        fit = np.linalg.lstsq(waves, samples.clean_N, rcond=None)[0]
        assert np.hypot(*fit) == pytest.approx(told["amplitude"], rel=0.35 if shape in ("wavering", "grid") else 1e-2)


def test_delay_and_skew_say_when_it_was_measured():
    quiet = {"noise_N": 1e-6, "jitter": "none", "own_clock": False, "rate_hz": 1000.0, "motion": SHORT}
    plain = null_case(3, law="power", **quiet).truth
    late = draw_case(3, ("force_delay",), 1.0, "pure", law="power", **quiet).truth
    wanted = plain.fine.at(plain.row_time_s - late.parameters["force_delay"]["delay"])
    assert np.allclose(late.clean_N, wanted, atol=1e-9)
    merged = draw_case(3, ("clock_skew",), 1.0, "merged", law="power", **quiet).truth
    skew = 1e-6 * merged.parameters["clock_skew"]["skew"]
    assert np.allclose(merged.clean_N, plain.fine.at(plain.row_time_s / (1 + skew)), atol=1e-9)
    case = draw_case(3, ("clock_skew",), 1.0, "stamped", law="power", **quiet)
    assert np.allclose(case.force_time_s, case.truth.force_true_time_s * (1 + skew), atol=1e-12)
    assert np.allclose(case.truth.clean_N, plain.fine.at(case.truth.force_true_time_s), atol=1e-9)


# --- material -------------------------------------------------------------------------------------------------------


def cycles(*depths, speed=5.0):
    path = Path(0.0)
    for depth in depths:
        path.to(depth, speed)
    return path.motion()


def test_adhesion():
    motion = Path(-0.5).to(1.0, 2.0).hold(0.1).to(-0.5, 2.0).motion()
    for shape in shapes_of("adhesion", "first", "second"):
        fine, told, _ = hidden("adhesion", shape, motion=motion)
        assert fine.force_N.min() == pytest.approx(-told["pull_off"], rel=0.02)
        half = fine.time_s < 0.8
        x = fine.reported_mm
        there = np.interp(-0.4 * told["range"], x[half], fine.force_N[half])
        back = np.interp(0.4 * told["range"], -x[~half], fine.force_N[~half])
        if shape == "exponential":
            out = (x < 0) & (fine.time_s > 0)
            assert np.allclose(fine.force_N[out], -told["pull_off"] * np.exp(x[out] / told["range"]), atol=1e-9)
            assert back == pytest.approx(there, abs=1e-6)
        else:
            assert there == 0 and back < -0.5 * told["pull_off"]
            assert np.all(fine.force_N[~half & (x < -1.01 * told["range"])] == 0)


@pytest.mark.parametrize("shape", shapes_of("stress_softening", "first", "second"))
def test_softening_spares_the_virgin_curve(shape):
    fine, told, _ = hidden("stress_softening", shape, motion=cycles(1.0, 0.0, 1.6, 0.0, 2.0))
    x, force = fine.reported_mm, fine.force_N
    deepest = np.maximum.accumulate(x)
    virgin = deepest - x < 1e-9
    assert np.allclose(force[virgin], 3 * x[virgin], atol=1e-6)
    below = ~virgin & (x > 0.05)
    assert np.all(force[below] < 3 * x[below])
    lost = 1 - force[below] / (3 * x[below])
    depth = (deepest - x)[below]
    if shape == "exponential":
        assert np.allclose(lost, -told["share"] * np.expm1(-depth / told["depth"]), atol=1e-6)
    elif shape == "dorfmann_ogden":
        # Energies of a spring go with the square of depth; w is that of the last `depth` mm before 2 mm.
        spent = deepest[below] ** 2 - x[below] ** 2
        assert np.allclose(lost, told["share"] * np.tanh(spent / (4 - (2 - told["depth"]) ** 2)), atol=1e-4)
    elif shape == "ogden_roxburgh":
        assert np.max(lost) <= told["share"] and np.max(lost) > 0.8 * told["share"]
    else:
        assert np.interp(2 * told["depth"], depth[np.argsort(depth)], np.sort(lost)) == pytest.approx(
            told["share"], rel=1e-3
        )


@pytest.mark.parametrize("shape", shapes_of("damage", "first", "second"))
def test_damage_goes_with_the_path_of_loading(shape):
    fine, told, build = hidden("damage", shape, 2.0, motion=cycles(2.0, 0.0, 2.0, 0.0, 2.0, 0.0, 2.0))
    x, rate = fine.reported_mm, told["rate"]
    path = np.concatenate([[0.0], np.cumsum(np.maximum(np.diff(x), 0))])
    kept = fine.force_N[x > 0.1] / (3 * x[x > 0.1])
    limit = build.plant.numbers["damage_limit"]
    expected = {
        "exponential": np.exp(-rate * path),
        "kachanov": (1 - 3 * rate * path) ** (1 / 3),
        "saturating": 1 + limit * np.expm1(-rate * path / limit),
        "logarithmic": 1 - rate * limit * np.log1p(path / limit),
    }[shape]
    assert np.allclose(kept, expected[x > 0.1], atol=1e-6)


@pytest.mark.parametrize("shape", shapes_of("permanent_set", "first", "second"))
def test_the_surface_sinks(shape):
    fine, told, build = hidden("permanent_set", shape, motion=cycles(1.0, 0.0, 2.0, 0.0))
    deepest, s = np.maximum.accumulate(fine.reported_mm), told["set"]
    limit = build.plant.numbers["set_limit_mm"]
    sunk = {
        "linear": s * deepest,
        "saturating": -limit * np.expm1(-s * deepest / limit),
        "yield": s * np.maximum(deepest - limit, 0),
        "progressive": s * np.maximum(deepest, 0) * np.sqrt(np.maximum(deepest, 0) / 2),
    }[shape]
    assert np.allclose(fine.force_N, 3 * np.maximum(fine.reported_mm - sunk, 0), atol=1e-6)


@pytest.mark.parametrize("shape", shapes_of("viscous_damping", "first", "second"))
def test_damping_on_a_spring(shape):
    motion = Path(-0.5).to(1.9, 20.0).hold(0.1).to(0.5, 20.0).hold(0.1).motion()
    fine, told, _ = hidden("viscous_damping", shape, motion=motion)
    v, x = motion.velocity(fine.time_s), np.maximum(fine.reported_mm, 0)
    sliding = np.abs(np.abs(v) - 20) < 1e-9
    steady = sliding & np.roll(sliding, 3) & (x > 0.05)
    factor = x[steady] / 1.0 if shape == "with_depth" else 1.0
    added = np.sign(v[steady]) * 20 * told["coefficient"] * factor
    assert np.allclose(fine.force_N[steady], 3 * x[steady] + added, atol=1e-4)
    away, told, _ = hidden("viscous_damping", shape, 2.5, motion=Path(-0.5).to(1.0, 50.0).to(-0.5, 100.0).motion())
    assert away.force_N.min() == 0


@pytest.mark.parametrize("shape", shapes_of("depth_dependent_relaxation", "first", "second"))
def test_rates_change_with_depth(shape):
    pad = Pad(Power(3.0, 0.0), (0.4,), (2.0,))
    for seed in (0, 1, 2):
        fine, told, _ = hidden(
            "depth_dependent_relaxation", shape, pad=pad, motion=Path(1.6).hold(2.0).motion(), seed=seed
        )
        s = told["slope"]
        factor = {
            "linear": 1 + 1.6 * s,
            "exponential": np.exp(1.6 * s),
            "saturating": 1 + 1.6 * s / 1.4,
            "free_volume": np.exp(1.6 * s / 1.4),
        }[shape]
        # Pressed within the first step: the relaxed share follows one exponential from there.
        rate = -np.diff(np.log(fine.at(np.array([0.5, 1.0])) / 4.8 - 0.6)) / 0.5
        assert rate[0] == pytest.approx(2.0 * factor, rel=1e-3)


def test_a_stretched_exponential_of_modes():
    for beta in (0.45, 0.65):
        weights, rates = _stretched(beta, 2.0)
        t = np.geomspace(0.02, 5, 50)
        assert weights.sum() == pytest.approx(1) and len(weights) >= 3
        assert np.allclose(np.exp(-np.outer(t, rates)) @ weights, np.exp(-((2.0 * t) ** beta)), atol=0.04)


def test_laws_outside_the_catalogue():
    d = np.linspace(0.01, 2.0, 500)
    for law in (MooneyRivlin(1.0, 0.4, 5.0), TwoSlope(1.0, 2.0, 0.9, 0.08), Foam(2.0, 0.5, 3.0, 2.0)):
        force = law.force(np.array([-1.0, 0.0, *d]))
        assert force[0] == force[1] == 0 and np.all(np.diff(force[1:]) > 0)
    slopes = np.gradient(TwoSlope(1.0, 2.0, 0.9, 0.03).force(d), d)
    assert slopes[5] == pytest.approx(1.0, rel=1e-3) and slopes[-5] == pytest.approx(3.0, rel=1e-3)
    # A block of the first kind alone: 3 A δ/H while the stretch is near one.
    assert MooneyRivlin(2.0, 0.0, 50.0).force(0.01) == pytest.approx(3 * 2.0 * 0.01 / 50, rel=1e-3)
    assert Rounded(Power(3.0, 0.0), 0.05).force(1.0) == pytest.approx(3 * 0.95)


def test_separation_and_its_tension():
    pad = Pad(Power(3.0, 0.0), (0.5,), (3.0,))
    motion = Path(0.0).to(2.0, 50.0).hold(2.0).to(0.0, 50.0).hold(0.5).motion()
    clean, _, build = hidden("separation", "clean", pad=pad, motion=motion)
    assert build.believed.contact == "bonded" and clean.force_N.min() == 0
    late, _, _ = hidden("separation", "late", pad=pad, motion=motion)
    assert -0.05 < late.force_N.min() < -0.03
