"""Effects of the pad, and of the frame before it, further forms: each against a closed form."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import brentq

from sim.effects import effect
from sim.elastic import Exponential
from sim.pad import Pad
from sim.relaxation import Relaxation
from tests.sim.effect_tools import AIR, GEL, LINEAR, SOFT, K, active, ramp, simulate


class TestTheSpeedThatADashpotFeels:
    t = np.arange(200) * 1e-3

    @pytest.mark.parametrize(
        ("form", "more", "factor"),
        [
            ("linear", {}, lambda v: v),
            ("power", {"exponent": 2.0}, lambda v: v * np.abs(v) / 20.0),  # an orifice
        ],
    )
    def test_is_that_at_the_end_of_the_step_where_it_grows_steadily(
        self, form: str, more: dict[str, float], factor
    ) -> None:
        x = 0.3 + 0.5 * 400.0 * self.t**2  # up to 80 mm/s
        extra = simulate(LINEAR, [active("viscous_damping", form, coefficient=0.05, **more)], self.t, x) - K * x
        assert_allclose(extra[10:], 0.05 * factor(400.0 * self.t[10:]), rtol=1e-4)

    def test_steps_of_any_length(self) -> None:
        t = np.cumsum(np.random.default_rng(1).uniform(0.2e-3, 2e-3, 200))
        x = 0.3 + 0.5 * 400.0 * t**2
        extra = simulate(LINEAR, [active("viscous_damping", coefficient=0.05)], t, x) - K * x
        assert_allclose(extra[5:], 0.05 * 400.0 * t[5:], rtol=1e-9)

    def test_is_never_beyond_the_mean_of_a_step_at_a_corner(self) -> None:
        x = np.concatenate(
            [np.full(20, 0.3), 0.3 + 0.03 * np.arange(1, 31), np.full(20, 1.2), 1.2 - 0.02 * np.arange(40)]
        )
        t = np.arange(x.size) * 1e-3
        extra = simulate(LINEAR, [active("viscous_damping", coefficient=0.05)], t, x) - K * x
        assert_allclose(extra, 0.05 * np.diff(x, prepend=x[0]) / 1e-3, atol=1e-9)


class TestADampedMount:
    def test_a_step_of_force_comes_late(self) -> None:
        damped = effect("frame_compliance").form("damped")
        state, compliance, late = [0.0, 0.0], 0.01, 0.02
        block, numbers = damped.blocks["frame"], damped.vector({"compliance": compliance, "time_constant": late})
        block(0.0, 5.0, state, numbers)
        state[1] = 5.0  # the force stands from here on
        times = np.cumsum(np.random.default_rng(2).uniform(1e-4, 5e-3, 50))
        got = [block(float(d), 5.0, state, numbers) for d in np.diff(times, prepend=0.0)]
        assert_allclose(got, compliance * 5.0 * -np.expm1(-times / late), rtol=1e-12)

    def test_under_a_ramp_it_is_a_spring_and_a_dashpot_in_series_with_the_pad(self) -> None:
        # (1 + C K) F + τ F' = K (x + τ x'), from F = 0
        compliance, late, speed = 0.05, 0.01, 10.0
        t = np.arange(0, 4001) * 2e-5
        force = simulate(
            LINEAR, [active("frame_compliance", "damped", compliance=compliance, time_constant=late)], t, speed * t
        )
        whole = 1.0 + compliance * K
        rate = whole / late
        # F = a t + b (1 − e^(−rate t))
        a = K * speed / whole
        b = (K * speed * late - late * a) / whole
        assert_allclose(force, a * t - b * np.expm1(-rate * t), atol=1e-6)
        assert math.isclose(force[-1], a * t[-1] + b, rel_tol=1e-3)


class TestWaysThatWaterGoes:
    @pytest.mark.parametrize(("form", "power"), [("hyperbolic", 1), ("layer", 2)])
    @pytest.mark.parametrize("slope", [-0.3, 0.4])
    def test_the_slope_is_the_mean_to_the_reach(self, form: str, power: int, slope: float) -> None:
        block = effect("depth_dependent_relaxation").form(form).blocks["rate"]
        depths = np.array([0.0, 0.6, 1.2, 2.4])
        factors = np.array([block(0.0, float(d), [], [slope, 2.4]) for d in depths])
        assert_allclose(factors[[0, -1]], [1.0, 1.0 + slope * 2.4], rtol=1e-12)
        left = factors ** (-1 / power)  # of the way that water goes: straight in depth
        assert_allclose(left, 1.0 + (left[-1] - 1.0) * depths / 2.4, rtol=1e-12)

    @pytest.mark.parametrize("form", ["hyperbolic", "layer"])
    def test_relaxation_at_a_depth_runs_on_that_clock(self, form: str) -> None:
        t = np.linspace(0.0, 3.0, 301)
        effects = [active("depth_dependent_relaxation", form, slope=0.25, reach=1.5)]
        force = simulate(SOFT, effects, t, np.full(t.size, 1.5))
        assert_allclose(force / force[0], GEL.reduced(1.375 * t), rtol=1e-10)

    @pytest.mark.parametrize("form", ["hyperbolic", "layer"])
    def test_rates_stay_above_0_and_finite(self, form: str) -> None:
        block = effect("depth_dependent_relaxation").form(form).blocks["rate"]
        for slope in (-5.0, -0.5, 0.0, 0.5, 5.0):
            factors = np.array([block(0.0, float(d), [], [slope, 2.0]) for d in np.linspace(0, 10, 2001)])
            assert np.isfinite(factors).all() and (factors > 0).all()
            assert factors[0] == 1.0


class TestColdFlow:
    def test_it_goes_with_the_logarithm_of_the_time_under_load(self) -> None:
        """Held at 2 mm, in air for as long, and held again: the surface sinks on from where it was left."""
        hold, air = np.full(1000, 2.0), np.full(1000, -1.0)
        x = np.concatenate([hold, air, hold])
        t = 0.01 * np.arange(x.size)
        force = simulate(LINEAR, [active("permanent_set", "flowing", set=0.05, flows=0.2)], t, x)
        loaded = np.concatenate([t[:1000], np.full(1000, t[999]), t[999] + 0.01 * np.arange(1, 1001)])
        sunk = 0.05 * 2.0 * (1.0 + 0.2 * np.log(1.0 + loaded))
        assert_allclose(force, np.where(x > 0.0, K * (2.0 - sunk), 0.0), rtol=1e-9)

    def test_half_as_deep_it_takes_twice_the_time(self) -> None:
        t = 0.01 * np.arange(2001)
        x = np.where(t > 0.0, 1.0, 2.0)  # 2 mm for a moment, then half of it
        force = simulate(LINEAR, [active("permanent_set", "flowing", set=0.05, flows=0.2)], t, x)
        assert_allclose(force[1:], K * (1.0 - 0.1 * (1.0 + 0.2 * np.log1p(0.5 * t[1:]))), rtol=1e-9)


class TestSofteningFurther:
    def test_by_the_spread_of_strengths(self) -> None:
        x = ramp(2.0, 201)
        numbers = {"share": 0.3, "depth": 0.4, "exponent": 2.0}
        force = simulate(LINEAR, [active("stress_softening", "weibull", **numbers)], np.arange(x.size) * 0.01, x)
        assert_allclose(force[:201], K * x[:201], rtol=1e-12)  # the virgin curve
        below = 2.0 - x[201:]
        assert_allclose(force[201:], K * x[201:] * (1.0 - 0.3 * (1.0 - np.exp(-((below / 0.4) ** 2)))), rtol=1e-9)

    def test_each_cycle_adds_less(self) -> None:
        cycle = ramp(2.0, 101)[:-1]
        x = np.concatenate([np.tile(cycle, 4), [0.0]])
        numbers = {"share": 0.3, "depth": 0.4, "lacks": 0.5, "takes": 1.5}
        force = simulate(LINEAR, [active("stress_softening", "conditioning", **numbers)], np.arange(x.size) * 0.01, x)
        for cycles in range(4):  # on the way back at 1 mm
            at = cycles * 200 + 150
            share = 0.3 * (1.0 - 0.5 * math.exp(-cycles / 1.5))
            assert x[at] == pytest.approx(1.0)
            assert_allclose(force[at], K * (1.0 - share * (1.0 - math.exp(-2.5))), rtol=1e-9)


class TestAGel:
    def test_water_leaves_it_as_under_a_sphere(self) -> None:
        """Hu, Zhao, Vlassak and Suo's curve, of which 1/e is left at 1/rate."""
        t = np.concatenate([[0.0], np.geomspace(1e-3, 3.0, 300)])
        effects = [active("missing_relaxation_mode", "gel", share=0.5, rate=2.0)]
        left = 2.0 * simulate(LINEAR, effects, t, np.full(t.size, 1.0)) / K - 1.0
        lasts = brentq(lambda s: gel_left(s) - math.exp(-1.0), 0.01, 10.0)
        seen = t > 0.005
        assert_allclose(left[seen], gel_left(2.0 * lasts * t[seen]), atol=0.01)
        assert np.interp(0.5, t, left) == pytest.approx(math.exp(-1.0), abs=2e-3)


def gel_left(time):
    """Share of the water's force that is left at Hu's time."""
    return 0.491 * np.exp(-0.908 * np.sqrt(time)) + 0.509 * np.exp(-1.679 * time)


class TestWhatTheNinthShowed:
    def test_a_load_that_lifts_what_hangs_in_the_play(self) -> None:
        x = ramp(2.0, 401)
        lifted = active("backlash", "lifted", gap=0.1, lifts=1.0, rubs=0.2)
        force = simulate(LINEAR, [lifted], np.arange(x.size) * 0.01, x)
        up, down = x[:401], x[400:]
        way_in = np.where(up <= 0.8, up, np.maximum(up - 0.1, 0.8))
        way_back = np.where(down >= 1.3, down - 0.1, np.minimum(down, 1.2))
        assert_allclose(force[:401], K * way_in, atol=1e-9)
        assert_allclose(force[400:], K * way_back, atol=1e-9)

    def test_a_set_that_flows_back_in_part(self) -> None:
        x = ramp(2.0, 401)
        springs = active("permanent_set", "springing", set=0.1, limit=0.5)
        force = simulate(LINEAR, [springs], np.arange(x.size) * 0.01, x)
        up, down = x[:401], x[400:]
        assert_allclose(force[:401], K * (up - 0.2 * np.maximum(up - 0.5, 0.0)), atol=1e-9)
        sunk = 0.2 * np.minimum(1.5, down + 0.5)  # 0.3 mm under the deepest, 0.1 mm at the end: 0.1 · 2 in the mean
        assert_allclose(force[400:], K * np.maximum(down - sunk, 0.0), atol=1e-9)

    @pytest.mark.parametrize("within", [0.05, 0.3, 20.0])
    def test_what_stays_of_a_stroke_to_reach_is_the_set_however_soon_it_comes(self, within: float) -> None:
        x = ramp(2.0, 401)
        lifts = active("permanent_set", "lifting", set=0.1, within=within, reach=2.0)
        force = simulate(LINEAR, [lifts], np.arange(x.size) * 0.01, x)
        assert_allclose(force[:401], K * x[:401], atol=1e-9)  # nothing, until it is let go
        down = x[400:]
        come = np.expm1((down - 2.0) / within) / np.expm1(-2.0 / within)
        assert come[-1] == pytest.approx(1.0)
        assert_allclose(force[400:], K * np.maximum(down - 0.2 * come, 0.0), atol=1e-9)

    def test_water_that_stays_away_until_the_pad_is_let_go(self) -> None:
        t = 0.01 * np.arange(6000)
        x = np.select([t < 1.0, t < 2.0, t < 52.0], [2.0, 1.0, -1.0], 1.0)
        drained = active("depth_dependent_relaxation", "drained", slope=0.3)
        pad = Pad(Exponential(K, 0.0), GEL, unilateral=True)
        force = simulate(pad, [drained], t, x)
        for factor, part in ((1.6, t < 2.0), (1.3, t >= 51.99)):
            quick = Pad(Exponential(K, 0.0), Relaxation(GEL.shares, tuple(factor * r for r in GEL.rates)), True)
            alone = simulate(quick, [], t[part] - t[part][0], x[part])
            assert_allclose(force[part], alone, rtol=1e-3)  # the factor grows along the step in which it touches

    def test_surfaces_that_are_charged_by_touching(self) -> None:
        t, x = np.arange(8.0), np.array([0.0, -0.1, -0.1, -0.1, -0.1, 0.0, 0.0, -0.1])
        force = simulate(LINEAR, [active("adhesion", "charging", pull_off=0.2, range=0.1, takes=0.5, leaks=8.0)], t, x)
        before = 0.5 * np.exp(-t / 8.0)
        again = before[4] + 0.5 * (1.0 - before[4])
        charge = np.array([*before[:5], again, again, again * math.exp(-1.0 / 8.0)])
        # At the range 1/e of what it is in contact.
        assert_allclose(force, -0.2 * charge**2 * np.where(x < 0.0, math.exp(-1.0), 1.0), rtol=1e-9)

    def test_a_springpot_is_a_fractional_derivative(self) -> None:
        """At an even speed v t^{1−α}/Γ(2−α), from 5 ms to 4 s; and stated is the force over speed after 0.1 s."""
        t = np.linspace(0.0, 4.0, 8001)
        for order in (0.5, 0.8, 0.95):
            pot = active("viscous_damping", "springpot", coefficient=0.01, order=order)
            soft = Pad(Exponential(1e-9, 0.0), Relaxation(), unilateral=True)
            force = simulate(soft, [pot], t, 0.5 * t)
            assert_allclose(force[10:], 0.01 * 0.5 * (t[10:] / 0.1) ** (1.0 - order), rtol=0.02)

    def test_a_filling_that_is_met_at_a_depth(self) -> None:
        """Nothing before it, and all of it a tenth of the depth later."""
        t = 1e-3 * np.arange(201)
        oil = active("viscous_damping", "filled", coefficient=0.01, begins=0.4, at_depth=0.5)
        soft = Pad(Exponential(1e-9, 0.0), Relaxation(), unilateral=True)
        force = simulate(soft, [oil], t, 5.0 * t)
        assert_allclose(force[[50, 80]], 0.0, atol=1e-7)
        assert_allclose(force[[90, 100, 150, 200]], [0.025, 0.05, 0.05, 0.05], rtol=1e-5)

    def test_a_filling_that_motion_thins_and_rest_sets_again(self) -> None:
        """Moved evenly λ goes to 1/(1 + sets |v|/way) as e^{−t(1/sets + |v|/way)}; after a rest of `sets` the rest of
        it is less by 1/e."""
        way, sets, v, stays = 0.5, 2.0, 1.0, 0.2
        t = 1e-3 * np.arange(4001)
        x = np.where(t < 1.0, v * t, np.where(t < 3.0, v, v * (4.0 - t)))
        oil = active("viscous_damping", "thixotropic", coefficient=0.01, stays=stays, way=way, sets=sets)
        soft = Pad(Exponential(1e-9, 0.0), Relaxation(), unilateral=False)
        force = simulate(soft, [oil], t, x)
        rate, end = 1.0 / sets + v / way, 1.0 / (1.0 + sets * v / way)
        first = end + (1.0 - end) * np.exp(-rate * t[1:1001])
        rested = 1.0 - (1.0 - first[-1]) * math.exp(-1.0)
        assert_allclose(force[1:1001], 0.01 * (stays + (1.0 - stays) * first) * v, rtol=2e-3)
        assert_allclose(force[1005:3000], 0.0, atol=1e-7)
        assert force[3002] == pytest.approx(-0.01 * (stays + (1.0 - stays) * rested) * v, rel=0.01)


class TestWhatGoesOnByItself:
    def test_a_part_that_friction_slows_down(self) -> None:
        """Stopped from 10 mm/s, at 400 mm/s² it goes v²/2a = 125 µm; a play of 50 µm ends it before."""
        t = 1e-3 * np.arange(400)
        x = np.minimum(10.0 * t, 1.0)
        for gap, ends in ((0.3, 1.125), (0.05, 1.05)):
            coasts = active("backlash", "coasting", gap=gap, slows=400.0)
            force = simulate(LINEAR, [coasts], t, x)
            assert_allclose(force[:101], K * x[:101], atol=1e-9)
            assert force[-1] == pytest.approx(K * ends, rel=1e-3)

    def test_current_sensors_whose_gains_differ(self) -> None:
        x = ramp(2.0, 401)
        numbers = {"amplitude": 0.1, "period": 0.7, "phase": 0.3, "ratio": 0.8, "second_phase": -1.1, "exponent": 2.0}
        force = simulate(
            AIR, [active("cogging", "unbalanced", at_depth=1.0, **numbers)], 0.01 * np.arange(x.size), x - 1
        )
        angle, load = 2 * np.pi * (x - 1) / 0.7, np.maximum(x - 1, 0.0) ** 2
        assert_allclose(force, 0.1 * (np.sin(angle + 0.3) + 0.8 * load * np.sin(2 * angle - 1.1)), atol=1e-9)

    def test_magnets_that_the_load_weakens(self) -> None:
        x = ramp(2.0, 401)
        wave = active("cogging", "weakening", amplitude=0.1, period=0.7, phase=0.3, lost=0.5, reach=2.0)
        force = simulate(AIR, [wave], np.arange(x.size) * 0.01, x)
        deepest = np.maximum.accumulate(x)
        assert_allclose(force, 0.1 * (1.5 - 0.25 * deepest) * np.sin(2 * np.pi * x / 0.7 + 0.3), atol=1e-9)


@pytest.mark.parametrize("shape", [0.6, 1.0, 3.0])
def test_fibres_that_break_cost_the_rate_in_the_mean_up_to_a_travel(shape: float) -> None:
    """Two strokes of 1 mm: what they take of the stiffness, as a logarithm, is 0.2 at 2 mm whatever the shape."""
    x = np.concatenate([ramp(1.0, 501), ramp(1.0, 501)[1:]])
    fibres = active("damage", "weibull", rate=0.1, shape=shape, at_travel=2.0, dead_band=0.0)
    force = simulate(LINEAR, [fibres], np.arange(x.size) * 1e-3, x)
    assert_allclose(force[500], K * math.exp(-0.2 * 0.5**shape), rtol=1e-9)
    assert_allclose(force[1500], K * math.exp(-0.2), rtol=1e-9)


def test_damage_with_the_time_under_load_goes_on_while_it_is_held() -> None:
    """A stroke to two thirds of `reach` that is held for `lasts` costs `rate` a mm; half as deep, 2^n times less."""
    t, held = np.linspace(0.0, 6.0, 601), np.array([0.4, 0.8])
    force = [
        simulate(
            LINEAR, [active("damage", "creep", rate=0.1, exponent=3.0, reach=1.2, lasts=6.0)], t, np.full(t.size, x)
        )
        for x in held
    ]
    kept = np.array([f[-1] / f[0] for f in force])
    assert_allclose(np.log(kept), [-0.1 * 0.8 / 8.0, -0.1 * 0.8], rtol=2e-3)
    assert_allclose(np.diff(np.log(force[1])), np.log(kept[1]) / 600, rtol=1e-2)


def test_what_relaxes_is_lost_in_holds_too() -> None:
    """A step down to two thirds of `reach` and one back, each held: together as a mm of travel is said to cost. A mode
    that has no time to relax costs nothing, however far it goes."""
    t = np.concatenate([np.arange(0.0, 8.0, 0.002), 8.0 + np.arange(0.0, 8.0, 0.002), [16.0]])
    x = np.where((t >= 1.0) & (t < 8.0), 2.0, -0.1)
    x[-1] = 2.0
    numbers = {"rate": 0.1, "exponent": 1.7, "time_constant": 0.5, "reach": 3.0}
    force = simulate(LINEAR, [active("damage", "loss", **numbers)], t, x)
    assert_allclose(force[t == 7.0], 2.0 * K * math.exp(-0.1), rtol=1e-4)  # half of 2 mm · 0.1/mm
    assert_allclose(force[-1], 2.0 * K * math.exp(-0.2), rtol=5e-3)
    # held for 2 s by a mode of 4 s, and at rest for long: again as a mm of travel is said to cost
    t2 = np.concatenate([np.arange(0.0, 2.0, 0.002), 2.0 + np.arange(0.0, 40.0, 0.01)])
    slow = active("damage", "loss", **(numbers | {"time_constant": 4.0, "lasts": 2.0}))
    x2 = np.where((t2 < 2.0) | (t2 > 41.98), 2.0, -0.1)
    assert_allclose(simulate(LINEAR, [slow], t2, x2)[-1], 2.0 * K * math.exp(-0.2), rtol=2e-2)
    quick = active("damage", "loss", **(numbers | {"time_constant": 500.0}))
    assert_allclose(simulate(LINEAR, [quick], t, x)[t == 7.0], 2.0 * K, rtol=5e-3)


def test_fatigue_goes_with_a_power_of_the_stroke_and_faster_the_weaker_the_pad_is() -> None:
    """Of two strokes to 1 mm, one to half of it between: with the cube of the depth, and d(s²) constant in that."""
    strokes = [ramp(1.0, 501), ramp(0.5, 501)[1:], ramp(1.0, 501)[1:]]
    x = np.concatenate(strokes)
    numbers = {"rate": 0.1, "exponent": 2.0, "power": -2.0, "reach": 1.0, "dead_band": 0.0}
    force = simulate(LINEAR, [active("damage", "fatigue", **numbers)], np.arange(x.size) * 1e-3, x)
    assert_allclose(force[500], K * math.sqrt(1 - 0.2), rtol=1e-9)
    assert_allclose(force[1500], 0.5 * K * math.sqrt(1 - 0.2 * 1.125), rtol=1e-9)
    assert_allclose(force[2500], K * math.sqrt(1 - 0.2 * 2.125), rtol=1e-9)
