"""The judge's shapes of pad and contact against closed forms and the exact pad."""

import numpy as np
import pytest
from scipy.special import erfcx, exp1

from . import draw
from .cases import draw_case
from .effects import EFFECTS, Build
from .effects.judge_pad_contact import box, consolidation, gap_mm, mittag_leffler
from .effects.plant import Plant
from .effects.plant import simulate as fine_steps
from .laws import Exponential, Power
from .motion import Path
from .pad import Pad, simulate

SPRING = Pad(Power(3.0, 0.0))  # 3 N/mm, no relaxation
SOFT = Pad(Power(3.0, 0.0), (0.5,), (3.0,))
SHAPES = {
    "separation": ("edge_first", "lifted_pad"),
    "adhesion": ("jkr_curve", "lennard_jones", "willett_bridge"),
    "missing_relaxation_mode": ("fung_box", "fractional_zener", "drained_layer"),
    "depth_dependent_relaxation": ("growing_contact", "thinning_layer", "stress_activated"),
    "viscous_damping": ("tsuji", "sprung_dashpot", "open_cell"),
}


def hidden(id, shape, motion, pad=SPRING, size=1.0, seed=0, depth=2.0):
    """One effect in a plant: (fine steps, the contract's parameters, build)."""
    drawn = draw.DrawnPad(pad, depth, float(pad.law.force(depth)))
    build = Build(drawn, Plant(pad, motion, motion.duration_s), pad, 0.01, 1000.0, np.random.default_rng(seed))
    told = EFFECTS[id].hide(build, shape, size)
    return fine_steps(build.plant), told, build


@pytest.mark.parametrize(("id", "shape"), [(id, shape) for id, shapes in SHAPES.items() for shape in shapes])
def test_it_is_of_the_judge_and_comes_again(id, shape):
    assert shape in EFFECTS[id].judge and shape not in (*EFFECTS[id].shapes, *EFFECTS[id].drawn)
    motion = Path(-0.3).to(1.5, 20.0).hold(0.3).to(-0.3, 20.0).hold(0.1).motion()
    first, again = (draw_case(5, (id,), 1.0, shape, motion=motion) for _ in range(2))
    assert first.force_N.tobytes() == again.force_N.tobytes() and np.isfinite(first.force_N).all()
    stated = {
        "separation": set(),
        "adhesion": {"pull_off", "range"},
        "missing_relaxation_mode": {"share", "rate"},
        "depth_dependent_relaxation": {"slope"},
        "viscous_damping": {"coefficient"},
    }[id]
    assert set(first.truth.parameters[id]) == stated


# --- separation -----------------------------------------------------------------------------------------------------

AWAY = Path(0.0).to(2.0, 50.0).hold(2.0).to(-0.2, 5.0).hold(0.3).motion()


def test_the_edge_goes_first():
    fine, _, build = hidden("separation", "edge_first", AWAY, SOFT)
    assert build.believed.contact == "bonded" and build.plant.pad.contact == "unilateral"
    # Up to its let-go a part is the bonded pad; the first lets go at a quarter of the mean tension.
    mean = 4 * build.plant.numbers["stick_N"]
    bonded = simulate(Pad(SOFT.law, SOFT.shares, SOFT.rates, "bonded"), AWAY, fine.time_s[::5]).force_N
    pulled = np.maximum.accumulate(np.maximum(-bonded, 0))
    held = np.mean([pulled < mean * share for share in (0.25, 0.75, 1.25, 1.75)], axis=0)
    expected = held * bonded
    off = np.abs(fine.force_N[::5] - expected)
    assert np.mean(off < 1e-3) > 0.999  # but for the instants at which one lets go
    assert set(np.unique(held)) == {0, 0.25, 0.5, 0.75, 1} and expected.min() < -0.5 * mean


def test_a_lifted_pad_hangs_by_its_weight():
    motion = Path(-0.1).hold(0.1).to(2.0, 50.0).hold(2.0).to(-0.2, 5.0).hold(0.3).to(2.0, 50.0).hold(0.1).motion()
    fine, _, build = hidden("separation", "lifted_pad", motion, SOFT)
    weight, force, t = -fine.force_N.min(), fine.force_N, fine.time_s
    assert 0.015 * 0.7 <= weight <= 0.015 * 1.4 and build.believed.contact == "bonded"
    assert not force[t < 0.09].any()
    air = (fine.probe_mm < -0.01) & (t > 2)
    assert np.allclose(force[air], -weight) and air.sum() > 3000
    bonded = simulate(Pad(SOFT.law, SOFT.shares, SOFT.rates, "bonded"), motion, t).force_N
    lifts = int(np.argmax(bonded < -weight))
    assert np.allclose(force[: lifts - 1], bonded[: lifts - 1], atol=1e-3) and force[lifts + 1] == -weight
    assert force[-1] > 3  # it lands


# --- adhesion -------------------------------------------------------------------------------------------------------

TOUCH = Path(-0.5).to(1.0, 2.0).hold(0.1).to(-0.5, 2.0).motion()


def test_the_gap_is_that_of_the_free_surface():
    motion = Path(0.0).to(2.0, 50.0).hold(2.0).to(-0.2, 50.0).hold(0.5).motion()
    drawn = Pad(Exponential(1.5, 0.6), (0.4, 0.2), (15.0, 2.0))
    plant = Plant(drawn, motion, motion.duration_s)
    fine = fine_steps(plant)
    some = fine.time_s[::25]
    exact = simulate(drawn, motion, some)
    surface = np.log1p(exact.elastic_N * 0.6 / 1.5) / 0.6
    expected = np.where(exact.let_go, surface, np.maximum(fine.probe_mm[::25], 0)) - fine.probe_mm[::25]
    assert np.allclose(gap_mm(plant, fine)[::25], np.maximum(expected, 0), atol=1e-3) and expected.max() > 0.3


@pytest.mark.parametrize("shape", SHAPES["adhesion"])
def test_adhesion_by_its_gap(shape):
    fine, told, _ = hidden("adhesion", shape, TOUCH)
    pull, reach, x = told["pull_off"], told["range"], fine.probe_mm
    half = int(np.argmax(x))
    inwards = -np.interp(np.array([0.5, 1.0]) * -reach, x[:half], fine.force_N[:half])
    out = slice(half, None)

    def at(gap):
        return -np.interp(gap, -x[out], fine.force_N[out])

    assert fine.force_N.min() == pytest.approx(-pull, rel=2e-3)
    if shape == "jkr_curve":
        # Johnson, Kendall, Roberts by the radius of contact, from snap-off (a³ = 1/6) to no depth (a³ = 8/3).
        a = np.linspace(0.5504, (8 / 3) ** (1 / 3) - 1e-3, 20)
        load, depth = a**3 - np.sqrt(6 * a**3), a**2 - 2 / 3 * np.sqrt(6 * a)
        # Steps of 0.2 µm do not resolve its vertical tangent at snap-off.
        assert at(-depth[1:] / 0.9086 * reach) == pytest.approx(-load[1:] / 1.5 * pull, rel=5e-3)
        assert at(1.01 * reach) == 0 and np.all(inwards == 0)
        # Pressed, the same: P under that of Hertz at the same depth, δ^{3/2}; here at a = 3.
        hertz = (9 - 2 / 3 * np.sqrt(18)) ** 1.5
        part = slice(int(np.argmax(x > 0.01)), half)
        less = np.interp(hertz * pull / 1.5, 3 * x[part], fine.force_N[part] - 3 * x[part])
        assert less == pytest.approx((27 - np.sqrt(6 * 27) - hertz) / 1.5 * pull, rel=1e-3)
    else:
        assert at(reach) == pytest.approx(pull / np.e, rel=1e-2) and at(0.0) == pytest.approx(pull, rel=1e-2)
        assert fine.force_N[half] == pytest.approx(3 * x[half] - pull, abs=1e-6)
    if shape == "lennard_jones":
        assert np.allclose(inwards, [at(0.5 * reach), at(reach)], atol=1e-6)
        # Far off it goes with the inverse square: two places tell where it would be infinite.
        near, far = (at(gap * reach) ** -0.5 for gap in (3, 6))
        begin = 3 * reach - near * 3 * reach / (far - near)
        assert begin == pytest.approx(-reach / 0.899, rel=1e-2)
    if shape == "willett_bridge":
        assert np.all(inwards == 0)
        root = reach / 0.6452  # 1 + 1.05 s + 2.5 s² = e
        assert at(2 * root) == pytest.approx(pull / 13.1, rel=1e-2)
        broken = -x[out][np.flatnonzero(fine.force_N[out])[-1]]
        assert broken**3 / root**2 == pytest.approx(5.5, abs=2.6)  # V = R V/R: R is 3 to 8 mm


# --- relaxation -----------------------------------------------------------------------------------------------------


def test_spectra_in_closed_form():
    t = np.geomspace(0.03, 20, 60)
    for width in (10.0, 60.0):
        weights, rates = box(width)
        exact = (exp1(t / np.sqrt(width)) - exp1(t * np.sqrt(width))) / np.log(width)
        assert np.allclose(np.exp(-np.outer(t, rates)) @ weights, exact, atol=2e-3)
    weights, rates = mittag_leffler(0.5)  # E_½(−√t) = e^t erfc √t
    assert np.allclose(np.exp(-np.outer(t, rates)) @ weights, erfcx(np.sqrt(t)), atol=1e-2)
    weights, rates = consolidation()  # early, the degree of consolidation is √(4 T/π), T = π² t/4 turned round
    T = np.array([0.05, 0.1, 0.15])
    left = np.exp(-np.outer(T * np.pi**2 / 4, rates)) @ weights
    assert np.allclose(left, 1 - np.sqrt(4 * T / np.pi), atol=2e-3)


@pytest.mark.parametrize("shape", SHAPES["missing_relaxation_mode"])
def test_what_is_added_has_its_share_and_falls_to_one_e(shape):
    motion = Path(1.6).hold(2.0).motion()
    for seed in range(3):
        fine, told, build = hidden("missing_relaxation_mode", shape, motion, SOFT, seed=seed)
        known = Pad(SOFT.law, build.believed.shares, build.believed.rates)
        at = 1 / told["rate"]
        less = known.relaxation(np.array([at, 1e6])) - build.plant.pad.relaxation(np.array([at, 1e6]))
        assert less == pytest.approx(told["share"] * np.array([1 - np.exp(-1), 1]), rel=1e-6)
        wanted = 4.8 * build.plant.pad.relaxation(fine.time_s)
        assert np.allclose(fine.force_N[5:], wanted[5:], rtol=2e-2) and len(build.believed.rates) == 1


# --- rates ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", SHAPES["depth_dependent_relaxation"])
def test_rates_follow_depth(shape):
    pad, depths = Pad(Power(3.0, 1.0), (0.4,), (2.0,)), np.linspace(0.125, 1.875, 8)
    factor, told = [], {}
    for depth in depths:
        motion = Path(depth).hold(1.0).motion()
        fine, told, _ = hidden("depth_dependent_relaxation", shape, motion, pad, seed=1)
        elastic = float(pad.law.force(depth))
        factor.append(-np.diff(np.log(fine.at(np.array([0.3, 0.8])) / elastic - 0.6))[0])
    factor = np.array(factor)  # a rate of 2 over half a second
    line = np.sum((factor - 1) * depths) / np.sum(depths**2)
    assert told["slope"] == pytest.approx(line, rel=0.02)
    # What is a straight line through zero in each shape.
    straight = {"growing_contact": 1 / factor - 1, "thinning_layer": 1 - factor**-0.5}.get(shape, np.log(factor))
    over = straight / (depths**2 if shape == "stress_activated" else depths)
    assert np.allclose(over, over.mean(), rtol=1e-2)


# --- damping --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", SHAPES["viscous_damping"])
def test_damping_beside_a_spring(shape):
    motion = Path(-0.5, np.inf).to(1.9, 20.0).hold(0.1).to(0.5, 20.0).hold(0.1).motion()
    fine, told, _ = hidden("viscous_damping", shape, motion)
    t, x = fine.time_s, fine.probe_mm
    added, full = fine.force_N - 3 * np.maximum(x, 0), 20 * told["coefficient"]
    assert not added[x < -1e-3].any()

    def at(depth, first, last):
        part = (t > first) & (t < last)
        order = np.argsort(x[part])
        return np.interp(depth, x[part][order], added[part][order])

    # In from 0.025 to 0.12 s, out from 0.22 to 0.29 s; half the greatest depth is 1 mm.
    inwards = at(np.array([0.6, 1.0, 1.8]), 0.03, 0.118)
    assert inwards[1] == pytest.approx(full, rel=1e-3)
    if shape == "tsuji":
        assert inwards / full == pytest.approx(np.array([0.6, 1.0, 1.8]) ** 0.25, rel=1e-3)
        assert at(1.0, 0.222, 0.288) == pytest.approx(-full, rel=1e-3)
    elif shape == "open_cell":
        # 1/force is linear in depth, and 0 at the thickness.
        inverse = 1 / inwards
        assert np.diff(inverse)[1] == pytest.approx(2 * np.diff(inverse)[0], rel=1e-2)
        thickness = 0.6 + 0.4 * inverse[0] / (inverse[0] - inverse[1])
        assert thickness / 2 == pytest.approx(2.05, abs=0.46)
    else:
        # The same time constant while it comes up and while it fades.
        fades = np.diff(np.log(fine.at(np.array([0.121, 0.124])) - 5.7))[0]
        tau = -0.003 / fades
        assert 0.8e-3 <= tau <= 2.5e-3
        up = np.array([0.001, 0.002, 0.004])
        assert np.interp(0.025 + up, t, added) == pytest.approx(-full * np.expm1(-up / tau), abs=0.04 * full)


@pytest.mark.parametrize("shape", SHAPES["viscous_damping"])
def test_a_pad_that_is_left_does_not_pull(shape):
    motion = Path(-0.5).to(1.0, 50.0).to(-0.5, 100.0).motion()
    fine, _, _ = hidden("viscous_damping", shape, motion, size=2.5)
    assert fine.force_N.min() == 0
    bonded = Pad(Power(3.0, 0.0), (), (), "bonded")
    fine, _, _ = hidden("viscous_damping", shape, motion, bonded, size=2.5)
    assert fine.force_N.min() < -0.02
