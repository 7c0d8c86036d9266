"""Effects of the pad: its law, its relaxation, what wears and softens it."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.special import erfcx

from sim.effects import effect
from sim.effects.missing_relaxation_mode import _stretched_rates
from sim.elastic import Exponential, Polynomial, Power, Spline
from sim.model import Model
from sim.pad import Cascade, Pad
from sim.relaxation import Relaxation
from tests.sim.effect_tools import GEL, LINEAR, SOFT, K, active, ramp, simulate
from tests.sim.test_pad import walk


class TestElasticLaw:
    def test_each_form_is_the_law_of_its_name(self) -> None:
        t, x = walk(200)
        rises = {f"rise_{i}": 0.3 * i for i in range(1, 8)}
        forces = tuple(0.3 * i * (i + 1) / 2 for i in range(1, 8))
        cases = (
            ("exponential", {"m": 1.5, "b": 0.2}, Exponential(1.5, 0.2)),
            ("power", {"p": 3.0, "q": 0.8}, Power(3.0, 0.8)),
            ("polynomial_2", {"alpha_1": 1.0, "alpha_2": 0.5}, Polynomial((0.0, 1.0, 0.5))),
            ("polynomial_3", {"alpha_0": 0.1, "alpha_1": 1.0, "alpha_2": 0.5, "alpha_3": 0.2},
             Polynomial((0.1, 1.0, 0.5, 0.2))),
            ("spline", {"reach": 2.1, **rises}, Spline(tuple(0.3 * i for i in range(1, 8)), forces)),
        )  # fmt: skip
        for form, values, law in cases:
            assert_allclose(
                simulate(SOFT, [active("elastic_law", form, **values)], t, x),
                simulate(replace(SOFT, law=law), [], t, x),
                atol=1e-12,
            )


class TestMissingMode:
    def relaxed(self, pad: Pad, effects: list, t: np.ndarray) -> np.ndarray:
        """Force over that of the first instant, of a step at t = 0."""
        force = simulate(pad, effects, t, np.ones(t.size))
        return force / force[0]

    t = np.concatenate([[0.0], np.geomspace(1e-4, 1e3, 200)])

    def test_it_takes_from_what_never_relaxes(self) -> None:
        out = self.relaxed(SOFT, [active("missing_relaxation_mode", share=0.2, rate=30.0)], self.t)
        assert_allclose(out, GEL.reduced(self.t) - 0.2 * (1 - np.exp(-30.0 * self.t)), atol=1e-12)

    def test_where_that_is_not_enough_the_others_give_way(self) -> None:
        out = self.relaxed(SOFT, [active("missing_relaxation_mode", share=0.8, rate=30.0)], self.t)
        others = 0.2 / 0.4 * (0.25 * np.exp(-4.0 * self.t) + 0.15 * np.exp(-0.35 * self.t))
        assert_allclose(out, others + 0.8 * np.exp(-30.0 * self.t), atol=1e-12)

    @pytest.mark.parametrize("stretch", [0.35, 0.5, 0.7, 0.95, 1.0])
    def test_stretched(self, stretch: float) -> None:
        numbers = {"share": 0.5, "rate": 2.0, "stretch": stretch}
        out = self.relaxed(LINEAR, [active("missing_relaxation_mode", "stretched", **numbers)], self.t)
        expected = 0.5 + 0.5 * np.exp(-((2.0 * self.t) ** stretch))
        assert_allclose(out, expected, atol=0.5 * 0.05)
        middle = (self.t > 0.02) & (self.t < 5)
        assert_allclose(out[middle], expected[middle], atol=0.5 * 0.01)

    def test_rates_of_the_stretched_form_are_quantiles_of_levys_law_at_one_half(self) -> None:
        """e^(−√t) is the transform of the density e^(−1/4k)/(2√π k^(3/2)), whose distribution is erfc(1/(2√k))."""
        nodes, _ = np.polynomial.legendre.leggauss(10)
        below = [math.erfc(0.5 / math.sqrt(k)) for k in _stretched_rates(0.5)[1]]
        assert_allclose(below, 0.5 * (1 + nodes), atol=1e-6)

    def test_box(self) -> None:
        numbers = {"share": 0.6, "rate": 2.0, "decades": 2.0}
        out = self.relaxed(LINEAR, [active("missing_relaxation_mode", "box", **numbers)], self.t)
        rates = np.geomspace(0.2, 20.0, 4001)
        even = np.exp(-np.outer(self.t, 0.5 * (rates[1:] + rates[:-1]))).mean(axis=1)
        assert_allclose(out, 0.4 + 0.6 * even, atol=1e-4)

    @pytest.mark.parametrize("power", [0.7, 1.5, 4.0])
    def test_power(self, power: float) -> None:
        numbers = {"share": 0.5, "rate": 2.0, "power": power}
        out = self.relaxed(LINEAR, [active("missing_relaxation_mode", "power", **numbers)], self.t)
        tau = 1 / (2.0 * math.expm1(1 / power))
        seen = self.t < 10
        assert_allclose(out[seen], 0.5 + 0.5 * (1 + self.t[seen] / tau) ** -power, atol=0.5 * 0.01)

    def test_consolidation_of_a_layer(self) -> None:
        """The mean pressure of water in a layer: a third of its way out by the root of time at first (Terzaghi)."""
        numbers = {"share": 0.5, "rate": 2.0}
        out = self.relaxed(LINEAR, [active("missing_relaxation_mode", "consolidation", **numbers)], self.t)
        gone = (1.0 - out) / 0.5
        early = (self.t > 0.02) & (self.t < 0.2)  # time factor T = 4 rate t/π², U = 2 √(T/π)
        assert_allclose(gone[early], 2 * np.sqrt(4 * 2.0 * self.t[early] / math.pi**3), atol=0.01)
        late = (self.t > 0.5) & (self.t < 3)
        assert_allclose(1 - gone[late], 8 / math.pi**2 * np.exp(-2.0 * self.t[late]), rtol=2e-3)

    def test_fractional_at_one_half(self) -> None:
        """E_½(−√t) = e^t erfc(√t)."""
        numbers = {"share": 0.5, "rate": 2.0, "order": 0.5}
        out = self.relaxed(LINEAR, [active("missing_relaxation_mode", "fractional", **numbers)], self.t)
        seen = (self.t > 0.01) & (self.t < 10)
        assert_allclose(out[seen], 0.5 + 0.5 * erfcx(np.sqrt(2.0 * self.t[seen])), atol=0.5 * 0.02)


CYCLES = np.concatenate([ramp(1.0, 501), ramp(1.0, 501)[1:], ramp(1.5, 751)[1:]])
TIME = np.arange(CYCLES.size) * 1e-3
UP_1, DOWN_1, UP_2, DOWN_2, UP_3 = (
    slice(0, 501), slice(1000, 499, -1), slice(1000, 1501), slice(2000, 1499, -1), slice(2000, 2501)
)  # fmt: skip
"""In to 1 mm, out, in to 1 mm, out, in to 1.5 mm: each part in the order of depth."""


class TestStressSoftening:
    @pytest.mark.parametrize(
        "form", ["exponential", "linear", "ogden_roxburgh", "discontinuous_damage", "ratio", "root", "virgin"]
    )
    def test_softer_below_the_deepest_and_the_same_at_every_return(self, form: str) -> None:
        force = simulate(LINEAR, [active("stress_softening", form, share=0.3, depth=0.4)], TIME, CYCLES)
        inside = slice(20, 480)
        assert (force[UP_1][inside] > force[UP_2][inside] + 1e-3).all()
        assert_allclose(force[DOWN_1], force[UP_2], atol=1e-12)  # no loop of its own
        assert_allclose(force[DOWN_2], force[UP_2], atol=1e-12)
        assert_allclose(force[UP_3], force[UP_2], atol=1e-12)
        virgin = simulate(
            LINEAR, [active("stress_softening", form, share=0.3, depth=0.4)], TIME[:751], ramp(1.5, 751, False)
        )
        assert_allclose(force[2500:2751], virgin[500:], atol=1e-12)  # beyond, as if never unloaded

    def test_closed_forms(self) -> None:
        x = CYCLES[UP_2]
        share, depth, growth = 0.3, 0.4, 0.5
        factors = {
            "exponential": 1 - share * (1 - np.exp(-(1.0 - x) / depth)),
            "linear": 1 - share * np.minimum(1, (1.0 - x) / (2 * depth)),
            # W = x²/2 of a linear spring; at the reach, 1 mm, the argument is 1 at `depth` below it
            "ogden_roxburgh": 1 - share * np.vectorize(math.erf)((1 - x**2) / (1 - (1 - depth) ** 2)),
            "discontinuous_damage": np.full(x.size, 1 - share * (1 - math.exp(-1.0 / depth))),
        }
        damage = share * -np.expm1(-x / depth)
        factors["virgin"] = (1 - damage[-1]) / (1 - damage)
        # by a power of x over 1 mm that has taken the share at 2 depth below that
        factors["ratio"] = x ** (math.log(1 - share) / math.log(1 - 2 * depth))
        factors["root"] = (1 - share) ** np.sqrt((1.0 - x) / (2 * depth))
        for form, factor in factors.items():
            more = {"growth": growth, "power": 2.0, "reach": 1.0} if form == "ogden_roxburgh" else {}
            more = {"reach": 1.0} if form == "ratio" else more
            force = simulate(LINEAR, [active("stress_softening", form, share=share, depth=depth, **more)], TIME, CYCLES)
            assert_allclose(force[UP_2], K * x * factor, atol=1e-12)

    def test_a_preconditioned_pad_is_soft_from_the_start(self) -> None:
        before = active("stress_softening", "preconditioned", share=0.3, depth=0.4, already=1.0)
        fresh = active("stress_softening", share=0.3, depth=0.4)
        assert_allclose(
            simulate(LINEAR, [before], TIME, CYCLES)[UP_1], simulate(LINEAR, [fresh], TIME, CYCLES)[UP_2], atol=1e-12
        )


class TestPermanentSet:
    def surface(self, form: str, deepest: float, **values: float) -> float:
        """Depth at which the pad is met again."""
        x = np.concatenate([ramp(deepest, 2001), ramp(deepest, 2001)[1:2001]])
        force = simulate(LINEAR, [active("permanent_set", form, **values)], np.arange(x.size) * 1e-3, x)
        again = force[4001:]
        k = int(np.argmax(again > 0))
        return float(x[4001:][k] - again[k] / K)

    def test_linear_power_and_yielding(self) -> None:
        for deepest in (0.5, 2.0):
            assert_allclose(self.surface("linear", deepest, set=0.1), 0.1 * deepest, rtol=1e-9)
            assert_allclose(self.surface("power", deepest, set=0.1, exponent=1.7), 0.1 * deepest**1.7, rtol=1e-9)
            whole = self.surface("power", deepest, set=0.1, exponent=1.7, reach=deepest)
            assert_allclose(whole, 0.1 * deepest, rtol=1e-9)
            sunk = 0.15 * (1 - math.exp(-0.1 * deepest / 0.15))
            assert_allclose(self.surface("saturating", deepest, set=0.1, limit=0.15), sunk, rtol=1e-9)
        assert_allclose(self.surface("yielding", 2.0, set=0.1, limit=0.8), 0.12, rtol=1e-9)
        assert_allclose(self.surface("yielding", 0.7, set=0.1, limit=0.8), 0.0, atol=1e-12)

    def test_what_is_pounded_sinks_with_the_way_pressed(self) -> None:
        for deepest in (0.5, 2.0):
            once = 0.1 * deepest * (1 - math.exp(-deepest / 1.5))
            assert_allclose(self.surface("pounded", deepest, set=0.1, way=1.5), once, rtol=1e-3)
        x = np.tile(np.concatenate([ramp(1.0, 201)[:201], ramp(1.0, 201)[200:-1]]), 30)
        force = simulate(LINEAR, [active("permanent_set", "pounded", set=0.1, way=1.5)], np.arange(x.size) * 1e-3, x)
        tops = force[200::401][:30] / K
        assert np.all(np.diff(tops[:8]) < -1e-4) and tops[-1] == pytest.approx(0.9, abs=1e-4)

    def test_gradual(self) -> None:
        plant = Cascade(LINEAR, [active("permanent_set", "gradual", set=0.2, rate=0.5)]).plant()
        plant.step(0.0, 1.0)
        for n in (1, 2, 5):
            plant_n = plant.copy()
            for _ in range(n):
                force = plant_n.step(2.0 / n, 1.0)
            assert_allclose(force, K * (1 - 0.2 * (1 - math.exp(-1.0))), rtol=1e-12)
        plant.step(100.0, 1.0)
        sunk = plant.copy()
        sunk.step(1e-3, -1.0)
        sunk.step(100.0, -1.0)
        assert_allclose(sunk.step(1e-3, 0.5), K * (0.5 - 0.2), rtol=1e-9)

    def test_a_part_of_it_comes_back_while_nothing_presses(self) -> None:
        told, back, rate = 0.1, 0.4, 0.5
        plant = Cascade(LINEAR, [active("permanent_set", "rebounding", set=told, back=back, rate=rate)]).plant()
        at_once = told / (1 - back / 2)
        plant.step(0.0, 0.0)
        assert_allclose(plant.step(1.0, 1.0), K * (1 - at_once), rtol=1e-12)
        plant.step(50.0, 1.0)  # pressed it stays as it is
        assert_allclose(plant.step(1e-9, 0.5), K * (0.5 - at_once), rtol=1e-9)
        for waited in (2.0, 1e3):
            free = plant.copy()
            for _ in range(4):
                free.step(waited / 4, -0.2)
            stays = at_once * (1 - back + back * math.exp(-rate * waited))
            assert_allclose(free.step(1e-9, 0.5), K * (0.5 - stays), rtol=1e-8)
        # What is stated is the mean of both ends.
        assert_allclose((at_once + stays) / 2, told, rtol=1e-9)


class TestDamage:
    def test_softer_with_all_travel(self) -> None:
        rate, band = 0.05, 0.004
        cycles = np.concatenate([ramp(1.0, 501)] + [ramp(1.0, 501)[1:]] * 3)
        t = np.arange(cycles.size) * 1e-3
        crests = 500 + 1000 * np.arange(4)
        travel = np.arange(1, 5) * (1.0 - band)
        for form, factor in (
            ("exponential", np.exp(-rate * travel)),
            ("hyperbolic", 1 / (1 + rate * travel)),
            ("linear", 1 - rate * travel),
            ("by_way", np.exp(-rate * travel)),
        ):
            force = simulate(LINEAR, [active("damage", form, rate=rate)], t, cycles)
            assert_allclose(force[crests], K * factor, rtol=1e-9)
        floor = simulate(LINEAR, [active("damage", rate=rate, floor=0.6)], t, cycles)
        assert_allclose(floor[crests], K * (0.6 + 0.4 * np.exp(-rate / 0.4 * travel)), rtol=1e-9)

    def test_the_way_counts_where_the_pad_has_not_come_back_too(self) -> None:
        slow = replace(LINEAR, relaxation=Relaxation((0.5,), (0.05,)))
        x = np.tile(np.concatenate([ramp(1.0, 201)[:201], ramp(1.0, 201)[200:-1]]), 8)
        t = 1e-3 * np.arange(x.size)
        whole = simulate(slow, [], t, x)
        assert np.any(whole[402:] == 0.0)  # it lets go at each lift
        by_way, travel = (
            simulate(slow, [active("damage", form, rate=0.05, dead_band=0.0)], t, x)[200::401] / whole[200::401]
            for form in ("by_way", "exponential")
        )
        assert_allclose(by_way[0], travel[0], rtol=1e-12)
        assert np.all(by_way[1:] < travel[1:])
        loose = replace(slow, relaxation=Relaxation())  # what does not relax is met where it was left
        by_way, travel = (
            simulate(loose, [active("damage", form, rate=0.05, dead_band=0.0)], t, x)
            for form in ("by_way", "exponential")
        )
        assert_allclose(by_way, travel, rtol=1e-12)

    @pytest.mark.parametrize("power", [-3.0, -1.0, 0.0, 1.0, 6.0])
    def test_the_power_form_solves_its_law(self, power: float) -> None:
        """d(factor)/d(travel) = −rate · factor^(1 + k): each mm takes what is left to a power."""
        x = ramp(2.0, 4001, False)
        numbers = {"rate": 0.05, "power": power, "dead_band": 0.0}
        force = simulate(LINEAR, [active("damage", "power", **numbers)], np.arange(x.size) * 1e-3, x)
        factor = force[1:] / (K * x[1:])
        slope = np.gradient(factor, x[1:])[1:-1]
        assert_allclose(slope, -0.05 * factor[1:-1] ** (1 + power), rtol=1e-5)

    @pytest.mark.parametrize(
        ("form", "more"),
        [("exponential", {"floor": 0.7}), ("power", {"power": 4.0}), ("energy", {"exponent": 1.5, "floor": 0.5})],
    )
    def test_the_first_stroke_costs_the_rate(self, form: str, more: dict[str, float]) -> None:
        """Down to 1 mm, where the weight by energy has its mean."""
        numbers = {"rate": 1e-4, "dead_band": 0.0, **more}
        force = simulate(LINEAR, [active("damage", form, **numbers)], TIME[:501], ramp(1.0, 501, False))
        assert_allclose(1 - force[-1] / K, 1e-4, rtol=1e-3)

    def test_what_stays_above_a_threshold_does_no_harm(self) -> None:
        numbers = {"rate": 0.1, "spared": 0.4, "reach": 1.0, "dead_band": 0.0}
        cycles = np.concatenate([ramp(0.4, 201), ramp(1.0, 501)[1:], ramp(1.0, 501)[1:]])
        force = simulate(LINEAR, [active("damage", "threshold", **numbers)], np.arange(cycles.size) * 1e-3, cycles)
        assert_allclose(force[200], K * 0.4, rtol=1e-12)
        assert_allclose(force[[900, 1900]], K * np.exp(-0.1 * np.array([1, 2])), rtol=1e-9)

    def test_by_energy_deep_travel_counts_more(self) -> None:
        for deepest in (1.0, 2.0):
            force = simulate(
                LINEAR, [active("damage", "energy", rate=0.1, exponent=1.0, dead_band=0.0)], TIME[:501],
                ramp(deepest, 501, False),
            )  # fmt: skip
            assert_allclose(force[-1], K * deepest * math.exp(-0.1 * deepest**2), rtol=1e-9)

    def test_a_pad_that_has_let_go_is_loaded_from_its_own_surface_on(self) -> None:
        """It has relaxed at 1 mm, and stays sunk for a while: off and on again at once loads next to nothing of it."""
        pad = Pad(Exponential(K, 0.0), Relaxation((0.99,), (100.0,)), unilateral=True)
        x = np.concatenate([ramp(1.0, 101, False), np.full(1000, 1.0), ramp(1.0, 11)[10:], ramp(1.0, 11, False)])
        plant = Cascade(pad, [active("damage", rate=0.2)]).plant()
        force, elastic = np.array([(plant.step(1e-3, float(p)), plant.elastic_force_N) for p in x]).T
        assert force[1111] == 0.0
        assert_allclose(elastic[1100], K * math.exp(-0.2 * 0.996), rtol=1e-6)
        surface = 0.99 * math.exp(-0.01 * 100 * 0.02)  # it comes up as what is left of the modes lets it
        assert_allclose(elastic[-1], K * math.exp(-0.2 * (1.992 - surface)), rtol=2e-3)

    def test_noise_of_position_does_not_wear_the_pad(self) -> None:
        noise = 5e-4 * np.random.default_rng(4).standard_normal(60000)
        x = 1.0 + noise
        force = simulate(LINEAR, [active("damage", rate=0.1)], np.arange(x.size) * 1e-3, x)
        lost = 1 - force[-1] / (K * x[-1])
        assert 0.09 < lost < 0.1  # one press of 1 mm


class TestRates:
    @pytest.mark.parametrize("form", ["linear", "exponential", "free_volume", "knee"])
    def test_relaxation_at_a_depth_runs_on_a_clock_of_its_own(self, form: str) -> None:
        slope, depth = -0.25, 1.5
        factors = {"linear": 0.625, "exponential": math.exp(-0.375), "knee": 0.625}  # at the knee
        factor = factors.get(form, math.exp(-0.375 / 1.375))  # with half the slope left at 4 mm
        t = np.linspace(0.0, 3.0, 301)
        force = simulate(SOFT, [active("depth_dependent_relaxation", form, slope=slope)], t, np.full(t.size, depth))
        assert_allclose(force / force[0], GEL.reduced(factor * t), rtol=1e-10)

    @pytest.mark.parametrize("form", ["linear", "exponential", "free_volume", "knee"])
    def test_rates_stay_above_0_and_finite(self, form: str) -> None:
        block = effect("depth_dependent_relaxation").form(form).blocks["rate"]
        for slope in (-5.0, -0.5, 0.0, 0.5, 5.0):
            factors = np.array([block(0.0, float(d), [], [slope, 4.0]) for d in np.linspace(0, 10, 2001)])
            assert np.isfinite(factors).all() and (factors > 0).all()
            assert factors[0] == 1.0
            assert_allclose(factors[1] - 1, slope * 0.005, rtol=0.03, atol=1e-12)


class TestViscousDamping:
    x = np.concatenate([np.full(10, -0.5), -0.5 + 4.0 * np.arange(1, 501) * 1e-3, np.full(100, 1.5)])
    t = np.arange(x.size) * 1e-3

    @pytest.mark.parametrize(
        ("form", "more", "factor"),
        [
            ("linear", {}, lambda x: 4.0),
            ("hunt_crossley", {"exponent": 1.5, "at_depth": 0.8}, lambda x: 4.0 * (x / 0.8) ** 1.5),
            ("with_stiffness", {"growth": 0.7, "at_depth": 0.8}, lambda x: 4.0 * np.exp(0.7 * (x - 0.8))),
            ("with_load", {"growth": 0.7, "at_depth": 0.8}, lambda x: 4.0 * (np.exp(0.7 * x) - 1) / (np.exp(0.56) - 1)),
            ("with_load", {"growth": 0.0, "at_depth": 0.8}, lambda x: 4.0 * x / 0.8),
            ("power", {"exponent": 0.5}, lambda x: 4.0 * (4.0 / 20.0) ** -0.5),
            ("thermal", {"linear_to": 400.0}, lambda x: 4.0),
            ("thermal", {"linear_to": 5.0}, lambda x: 20.0 * np.log(0.8 + 1.64**0.5) / np.log(4.0 + 17.0**0.5)),
            ("one_sided", {"differs": 0.3}, lambda x: 4.0 * 1.3),
        ],
    )
    def test_force_at_a_steady_speed(self, form: str, more: dict[str, float], factor) -> None:
        damper = active("viscous_damping", form, coefficient=0.05, **more)
        force = simulate(LINEAR, [damper], self.t, self.x)
        moving = slice(140, 510)
        x = self.x[moving]
        assert_allclose(force[moving] - K * x, 0.05 * factor(x), rtol=1e-3)
        assert_allclose(force[512:], K * 1.5, rtol=1e-12)
        assert_allclose(force[:10], 0.0)

    @pytest.mark.parametrize("unilateral", [True, False])
    def test_the_surface_is_met_at_full_speed_wherever_samples_fall(self, unilateral: bool) -> None:
        pad, t = replace(LINEAR, unilateral=unilateral), 1e-3 * np.arange(10)
        for first in np.linspace(-0.0299, -0.0001, 7):  # of the last sample before the surface
            x = first + 30.0 * (t - t[4])
            force = simulate(pad, [active("viscous_damping", coefficient=0.05)], t, x) - simulate(pad, [], t, x)
            assert_allclose(force, np.where(x > 0.0, 0.05 * 30.0, 0.0), rtol=1e-9)

    @pytest.mark.parametrize("form", [f.name for f in effect("viscous_damping").forms])
    @pytest.mark.parametrize("unilateral", [True, False])
    def test_it_takes_energy_in_every_loop(self, form: str, unilateral: bool) -> None:
        t = np.arange(2001) * 1e-3
        x = 0.6 - 0.5 * np.cos(2 * math.pi * t)
        pad = replace(LINEAR, unilateral=unilateral)
        extra = simulate(pad, [active("viscous_damping", form, coefficient=0.05)], t, x) - simulate(pad, [], t, x)
        steps = extra[1:] * np.diff(x)
        # A springpot gives back some of what it takes: no more than that.
        assert (steps > -1e-9).all() if form != "springpot" else (np.cumsum(steps) > -1e-9).all()
        assert steps[1000:].sum() > 1e-3


def test_a_law_that_falls_with_the_depth_makes_a_force_that_is_a_number() -> None:
    """Below its crest no surface is free of force: there is none to be sought."""
    model = Model.from_dict(
        {
            "pad": {
                "elastic": {"law": "polynomial", "alpha": [0.0, 2.8, 0.67, 0.41, -0.083]},
                "relaxation": {"shares": [0.6, 0.2], "rates": [2.5, 0.2]},
                "contact": "unilateral",
            },
            "effects": [{"id": "viscous_damping", "form": "power", "coefficient": 0.13, "exponent": 0.6}],
        }
    )
    time = np.arange(0.0, 30.0, 0.1)
    press = np.minimum(time, 6.8) + 2e-6 * np.random.default_rng(3).normal(size=time.size) * (time > 6.8)
    force = model.simulate(time, press)
    assert np.isfinite(force).all()
    assert force.min() >= 0.0 and 5.0 < force.max() < 100.0
