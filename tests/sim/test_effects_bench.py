"""Effects between motor and load cell: frame, play, friction, mass, magnets, encoder."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from sim.elastic import Exponential
from sim.pad import Cascade, Pad
from sim.relaxation import Relaxation
from tests.sim.effect_tools import AIR, GEL, LINEAR, SOFT, K, active, ramp, simulate
from tests.sim.test_pad import walk


class TestFrameCompliance:
    def test_a_linear_pad_looks_softer_by_the_series_spring(self) -> None:
        K, C = 12.0, 0.02
        cascade = Cascade(
            Pad(Exponential(K, 0.0), Relaxation(), unilateral=True), [active("frame_compliance", compliance=C)]
        )
        t = np.arange(400) * 1e-3
        x = 1.0 - 1.2 * np.cos(30 * t)
        force, probe = cascade.probe(t, x)
        assert_allclose(force, np.maximum(x, 0.0) * K / (1 + C * K), atol=1e-13)
        assert_allclose(probe, x - C * force, atol=1e-13)

    def test_two_springs_in_series_add(self) -> None:
        pad = Pad(Exponential(2.24, 0.69), GEL, unilateral=False)
        t, x = walk(300)
        two = [active("frame_compliance", compliance=0.01), active("frame_compliance", compliance=0.015)]
        one = [active("frame_compliance", compliance=0.025)]
        assert_allclose(Cascade(pad, two).simulate(t, x), Cascade(pad, one).simulate(t, x), atol=1e-12)

    def test_the_force_lies_on_the_law_at_the_probe(self) -> None:
        law = Exponential(2.24, 0.69)
        cascade = Cascade(Pad(law, Relaxation(), unilateral=True), [active("frame_compliance", compliance=0.05)])
        force, probe = cascade.probe(*walk(300))
        assert_allclose(force, law.force(probe), atol=1e-11)


class TestFriction:
    def test_up_and_down_differ_by_twice_the_coulomb_force(self) -> None:
        t = np.arange(4001) * 1e-3
        x = 2.0 - np.abs(t - 2.0)
        law = Exponential(2.0, 0.5)
        for form in ("coulomb", "presliding"):
            friction = active("friction", form, coulomb=0.07, presliding=0.005)
            force = Cascade(Pad(law, Relaxation(), True), [friction]).simulate(t, x)
            up, down = force[200:1900], force[::-1][200:1900]
            assert_allclose(up - down, 2 * 0.07, atol=1e-12)
            assert_allclose((up + down) / 2, law.force(x[200:1900]), atol=1e-12)

    def test_rest_keeps_the_force_and_the_first_sample_has_none(self) -> None:
        for form in ("coulomb", "presliding", "stribeck"):
            plant = Cascade(AIR, [active("friction", form, coulomb=0.07)]).plant()
            assert plant.step(0.0, 3.0) == 0.0
            plant.step(0.01, 3.5)
            held = plant.step(0.1, 3.5)
            assert held >= 0.07 - 1e-12
            assert plant.step(10.0, 3.5) == held

    def test_coulomb_builds_up_along_a_spring(self) -> None:
        plant = Cascade(AIR, [active("friction", "coulomb", coulomb=0.1, presliding=0.002)]).plant()
        plant.step(0.0, 0.0)
        assert_allclose(plant.step(1e-3, 0.001), 0.05)
        assert_allclose(plant.step(1e-3, 0.1), 0.1)
        assert_allclose(plant.step(1e-3, 0.1 - 0.002), 0.0, atol=1e-13)
        assert_allclose(plant.step(1e-3, 0.1 - 0.004), -0.1)

    def test_dahl_is_exact_for_any_step(self) -> None:
        F, d = 0.1, 0.02
        expected = F * (1 - math.exp(-0.03 / d))
        for n in (1, 7, 300):
            plant = Cascade(AIR, [active("friction", "presliding", coulomb=F, presliding=d)]).plant()
            plant.step(0.0, 0.0)
            for i in range(1, n + 1):
                force = plant.step(1e-3, 0.03 * i / n)
            assert_allclose(force, expected, rtol=1e-12)

    def test_stribeck_falls_from_static_to_coulomb_and_rises_with_viscosity(self) -> None:
        numbers = {"coulomb": 0.1, "static_ratio": 1.5, "stribeck_speed": 2.0, "viscous": 0.001}
        for speed in (1e-4, 2.0, 50.0):
            plant = Cascade(AIR, [active("friction", "stribeck", **numbers)]).plant()
            plant.step(0.0, 0.0)
            dt = 0.05 / speed  # well beyond presliding
            plant.step(dt, 0.05)
            expected = 0.1 * (1 + 0.5 * math.exp(-((speed / 2.0) ** 2))) + 0.001 * speed
            assert_allclose(plant.step(dt, 0.1), expected, rtol=1e-12)

    def test_force_is_a_continuous_function_of_position(self) -> None:
        """What the implicit step needs: no jump at a reversal."""
        for form in ("coulomb", "presliding", "stribeck"):
            plant = Cascade(AIR, [active("friction", form, coulomb=1.0)]).plant()
            plant.step(0.0, 0.0)
            plant.step(1e-3, 0.2)
            before = plant.copy().step(1e-3, 0.2 + 1e-12)
            after = plant.copy().step(1e-3, 0.2 - 1e-12)
            assert abs(before - after) < 1e-8

    def test_friction_reaches_the_frame_too(self) -> None:
        """In air the deflection is that of friction alone: y = x − C F_c while sliding."""
        both = [active("friction", coulomb=0.5), active("frame_compliance", compliance=0.1)]
        force, probe = Cascade(AIR, both).probe([0.0, 0.1, 0.2], [0.0, 1.0, 0.0])
        assert_allclose(force, [0.0, 0.5, -0.5], atol=1e-13)
        assert_allclose(probe, [0.0, 0.95, 0.05], atol=1e-13)

    def test_grease_is_worked_in_along_the_way_and_comes_back_at_rest(self) -> None:
        numbers = {"coulomb": 0.1, "stiffness": 0.5, "way": 2.0, "rest": 30.0, "presliding": 1e-3}
        for n in (60, 3000):
            plant = Cascade(AIR, [active("friction", "worked_in", **numbers)]).plant()
            plant.step(0.0, 0.0)
            for x in np.linspace(0.0, 6.0, n + 1)[1:]:
                force = plant.step(3.0 / n, x)  # 2 mm/s
            settled = (1 / 30) / (1 / 30 + 2 / 2)
            grease = settled + (1 - settled) * math.exp(-3.0 / 30.0 - 6.0 / 2.0)
            assert_allclose(force, 0.1 * (1 + 0.5 * grease), rtol=1e-9)
            plant.step(20.0, 6.0)
            grease = 1 - (1 - grease) * math.exp(-20.0 / 30.0)
            assert_allclose(plant.step(1e-9, 6.01), 0.1 * (1 + 0.5 * grease), rtol=0.01)

    def test_friction_that_is_another_at_each_place(self) -> None:
        terms = {"sine_1": 0.2, "cosine_1": -0.1, "sine_2": 0.1, "cosine_2": 0.15}
        plant = Cascade(AIR, [active("friction", "uneven", coulomb=0.1, reach=2.0, presliding=1e-3, **terms)]).plant()
        plant.step(0.0, 0.0)
        x = np.linspace(0.0, 2.0, 401)[1:]
        forth = np.array([plant.step(1e-3, p) for p in x])
        back = np.array([plant.step(1e-3, p) for p in x[-2::-1]])
        assert_allclose(forth[:-1], -back[::-1], atol=1e-12)
        assert_allclose(forth.mean(), 0.1, rtol=1e-9)
        angle = np.pi * x
        level = 0.2 * np.sin(angle) - 0.1 * np.cos(angle) + 0.1 * np.sin(2 * angle) + 0.15 * np.cos(2 * angle)
        assert_allclose(forth, 0.1 * (1 + level), atol=1e-12)

    def test_friction_of_polymers_goes_with_the_logarithm_of_speed(self) -> None:
        for speed, factor in ((1.0, 1.0), (1.1 * math.e - 0.1, 1.05), (0.0, 1 + 0.05 * math.log(0.1 / 1.1))):
            plant = Cascade(AIR, [active("friction", "logarithmic", coulomb=0.1, growth=0.05, presliding=1e-3)]).plant()
            plant.step(0.0, 0.0)
            plant.step(1.0, 5.0)
            assert_allclose(plant.step(0.5, 5.0 + 0.5 * speed), 0.1 * factor, rtol=1e-12)

    def test_friction_that_differs_between_the_ways_is_one_beside_a_bias(self) -> None:
        x = np.concatenate([np.linspace(0.0, 1.0, 101), np.linspace(1.0, 0.2, 81)])
        force = simulate(AIR, [active("friction", "one_way", coulomb=0.1, differs=0.3)], np.arange(x.size) * 1e-3, x)
        beside = simulate(
            AIR, [active("friction", coulomb=0.1), active("force_bias", bias=0.03)], np.arange(x.size) * 1e-3, x
        )
        assert force[0] == 0.0
        assert_allclose(force[1:], beside[1:], atol=1e-12)

    @pytest.mark.parametrize(("form", "came"), [("tared_out", -1.0), ("tared_in", 1.0)])
    def test_friction_under_a_tare_is_that_which_went_on_less_what_was_there(self, form: str, came: float) -> None:
        before = np.linspace(-0.1 * came, 0.0, 11)
        x = np.concatenate([np.linspace(0.0, 1.0, 101), np.linspace(1.0, -0.8, 181)])
        whole = simulate(AIR, [active("friction", coulomb=0.1)], np.arange(11 + x.size) * 1e-3, np.append(before, x))
        force = simulate(AIR, [active("friction", form, coulomb=0.1)], np.arange(x.size) * 1e-3, x)
        assert_allclose(force, whole[11:] - whole[10], atol=1e-12)

    def test_load_dependent_friction_grows_with_depth(self) -> None:
        x = ramp(2.0, 2001)
        grows = active("friction", "load_dependent", coulomb=0.05, load=0.5)
        force = simulate(LINEAR, [grows], np.arange(x.size) * 1e-3, x)
        up, down = force[:2001], force[:1999:-1]
        assert_allclose((up - down)[100:1900], 2 * 0.05 * (1 + 0.5 * x[100:1900]), rtol=1e-9)

    @pytest.mark.parametrize("form", ["coulomb", "presliding", "stribeck", "load_dependent", "one_way"])
    def test_a_closed_loop_takes_energy(self, form: str) -> None:
        x = np.concatenate([0.4 * np.sin(np.linspace(0, 2 * np.pi, 3001)) + 0.5] * 2)
        force = simulate(AIR, [active("friction", form)], np.arange(x.size) * 1e-3, x)
        around = slice(x.size // 2, None)  # the second loop begins as it ends
        work = np.sum(0.5 * (force[around][1:] + force[around][:-1]) * np.diff(x[around]))
        assert work > 0.9 * 0.05 * 1.6 * 0.5


class TestOtherFrames:
    @pytest.mark.parametrize(
        ("form", "shape"),
        [("stiffening", [4.0]), ("power", [2 / 3]), ("joint", [3.0, 0.3, 0.1]), ("closing", [3.0, 2.5, 0.1])],
        ids=lambda v: str(v),
    )
    def test_the_compliance_is_the_secant_at_its_force(self, form: str, shape: list[float]) -> None:
        block = active("frame_compliance", form).form.blocks["frame"]
        for at_force in (1.0, 5.0, 20.0):
            p = [0.02, *shape, at_force]
            assert_allclose(block(0.0, at_force, [], p), 0.02 * at_force)
            force = np.linspace(-20.0, 20.0, 41)
            deflection = np.array([block(0.0, f, [], p) for f in force])
            assert np.all(np.diff(deflection) > 0)
            assert_allclose(deflection, -deflection[::-1])

    def test_stiffening(self) -> None:
        block = active("frame_compliance", "stiffening").form.blocks["frame"]
        small, large = (block(0.0, f, [], [0.02, 4.0, 5.0]) / f for f in (1e-6, 4.0))
        assert_allclose(small / large, 2.0, rtol=1e-5)  # half the compliance at the stiffening force

    def test_the_power_form_is_hertzian_at_large_forces(self) -> None:
        block = active("frame_compliance", "power").form.blocks["frame"]
        large = [block(0.0, f, [], [0.01, 2 / 3, 5.0]) for f in (1e3, 8e3)]
        assert_allclose(large[1] / large[0], 4.0, rtol=1e-5)

    @pytest.mark.parametrize(("form", "before_over_after"), [("joint", 0.3), ("closing", 2.5)])
    def test_a_joint_is_two_straight_lines_that_meet_at_its_force(self, form: str, before_over_after: float) -> None:
        block = active("frame_compliance", form).form.blocks["frame"]

        def deflection(force: float) -> float:
            return block(0.0, force, [], [0.02, 2.0, before_over_after, 0.05, 5.0])

        before, after = deflection(0.5) / 0.5, (deflection(40.0) - deflection(20.0)) / 20.0
        assert_allclose(before / after, before_over_after, rtol=0.01)
        assert_allclose(deflection(20.0) - after * 18.0, before * 2.0, rtol=0.01)  # the lines meet at 2 N

    def test_joints_that_slip_make_a_loop_about_the_spring(self) -> None:
        """Half way between turns far apart both ways are the spring's, less and more by the share of the play."""
        block = active("frame_compliance", "slipping").form.blocks["frame"]
        state, p = np.zeros(1), [0.02, 0.3, 0.5]
        force = 5.0 - np.abs(np.linspace(-5.0, 5.0, 2001))
        deflection = np.array([block(1e-3, f, state, p) for f in force])
        up, down = deflection[200:780], deflection[::-1][200:780]
        assert_allclose(0.5 * (up + down), 0.02 * force[200:780], rtol=1e-9)
        assert_allclose(down - up, 2 * 0.02 * 0.3 * 0.5, rtol=1e-9)

    @pytest.mark.parametrize("n", [4, 400])
    def test_a_frame_that_creeps(self, n: int) -> None:
        """Under a force that rises for 1 s and stays, at any step."""
        block = active("frame_compliance", "creeping").form.blocks["frame"]
        compliance, share, tau = 0.02, 0.2, 0.7
        t = np.arange(4 * n + 1) / n
        state, p = np.zeros(2), [compliance, share, tau]
        deflection = [block(dt, f, state, p) for dt, f in zip(np.diff(t, prepend=0.0), np.minimum(t, 1.0), strict=True)]
        late = np.where(
            t <= 1.0, t - tau * -np.expm1(-t / tau), 1.0 - tau * -np.expm1(-1.0 / tau) * np.exp(-(t - 1.0) / tau)
        )
        wanted = compliance * ((1 - share) * np.minimum(t, 1.0) + share * late) / (1 - share / 2)
        assert_allclose(deflection, wanted, atol=1e-14)

    @pytest.mark.parametrize("form", ["stiffening", "power", "joint", "closing"])
    def test_the_frame_is_solved_with_the_pad(self, form: str) -> None:
        frame = active("frame_compliance", form, compliance=0.05)
        t, x = walk(300)
        force, probe = Cascade(SOFT, [frame]).probe(t, x)
        p = frame.form.vector(frame.values)
        assert_allclose(probe, [a - frame.form.blocks["frame"](0.0, f, [], p) for a, f in zip(x, force, strict=True)])
        assert_allclose(force, simulate(SOFT, [], t, probe), atol=1e-11)


class TestBacklash:
    def loop(self, form: str, **values: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Motor and probe over in, out, in."""
        x = np.concatenate([ramp(1.0, 1001), ramp(1.0, 1001)[1:]])
        _, probe = Cascade(AIR, [active("backlash", form, **values)]).probe(np.arange(x.size) * 1e-3, x)
        return x, probe, np.arange(x.size)

    def test_the_probe_stays_behind_by_the_gap(self) -> None:
        x, probe, n = self.loop("play", gap=0.1)
        assert_allclose(probe[n <= 1000], x[n <= 1000], atol=1e-12)
        assert_allclose(probe[1000:1101], 1.0, atol=1e-12)  # the way back begins in the play
        assert_allclose(probe[1100:2001], x[1100:2001] + 0.1, atol=1e-12)
        assert_allclose(probe[2000:2100], 0.1, atol=1e-12)
        assert_allclose(probe[2100:3001], x[2100:3001], atol=1e-12)

    def test_counted_from_the_middle_it_is_half_the_gap_on_either_side(self) -> None:
        x, probe, _ = self.loop("centred", gap=0.1)
        assert_allclose(probe[50:1001], x[50:1001] - 0.05, atol=1e-12)
        assert_allclose(probe[1100:2001], x[1100:2001] + 0.05, atol=1e-12)

    def test_where_in_the_play_the_data_begin(self) -> None:
        for start in (0.0, 0.3, 1.0):
            _, probe = Cascade(AIR, [active("backlash", gap=0.1, start=start)]).probe([0.0, 1.0], [2.0, 2.0])
            assert_allclose(probe, 2.0 + 0.1 * start, rtol=1e-14)

    def test_the_gradual_form_takes_the_gap_on_the_mean_and_closes_in_steps(self) -> None:
        x, probe, _ = self.loop("gradual", gap=0.1, spread=0.6)
        assert_allclose(probe[1000 + 161 : 2001], x[1000 + 161 : 2001] + 0.1, atol=1e-12)
        first = 0.1 * (1 - 0.6)
        closing = np.diff(probe[1000:1200]) / np.diff(x[1000:1200])
        assert_allclose(closing[: round(first / 1e-3)], 0.0, atol=1e-9)
        assert_allclose(np.unique(np.round(closing, 9)), [0.0, 0.25, 0.5, 0.75, 1.0])

    def test_a_play_that_runs_out_is_as_wide_as_its_place_says(self) -> None:
        x, probe, _ = self.loop("running_out", gap=0.1, swell=0.3, turn=0.7, angle=0.5)
        gap = 0.1 * (1 + 0.3 * np.sin(2 * np.pi * x / 0.7 + 0.5))
        back = slice(1150, 2001)
        assert_allclose(probe[back] - x[back], gap[back], atol=1e-12)

    @pytest.mark.parametrize(("name", "none"), [("running_out", {"swell": 0.0}), ("wearing", {"growth": 0.0})])
    def test_a_play_that_changes_is_counted_from_where_a_plain_one_is(self, name: str, none: dict[str, float]) -> None:
        for side, plain in ((0.0, "play"), (0.5, "centred")):
            _, probe, _ = self.loop(name, gap=0.1, side=side, **none)
            assert_allclose(probe[50:], self.loop(plain, gap=0.1)[1][50:], atol=1e-12)

    def test_what_has_opened_closes_again_by_itself(self) -> None:
        _, probe = Cascade(AIR, [active("backlash", "closing", gap=0.1, time_constant=0.5)]).probe(
            [0.0, 1.0, 1.01, 1.51, 1.52, 2.02], [0.0, 1.0, 0.8, 0.8, 0.78, 0.78]
        )
        once = 0.1 * np.exp(-1.0)  # of what the stop left
        twice = (once * np.exp(-0.02) + 0.02) * np.exp(-1.0)
        assert_allclose(probe[:2], [0.0, 1.0], atol=1e-14)
        assert_allclose(probe[2:4], [0.9, 0.8 + once], atol=1e-14)
        assert_allclose(probe[5], 0.78 + twice, atol=1e-14)

    def test_a_loaded_joint_seats_within_the_closing_force(self) -> None:
        _, probe = Cascade(LINEAR, [active("backlash", "loaded", gap=0.05, closing_force=0.1)]).probe([0, 1], [0, 3.0])
        assert_allclose(probe, [0.0, 3.0 - 0.05], atol=1e-12)
        force, probe = Cascade(LINEAR, [active("backlash", "loaded", gap=0.05, closing_force=5.0)]).probe([0], [1.0])
        assert_allclose(probe, 1.0 - 0.05 * (1 - np.exp(-force / 5.0)), atol=1e-12)

    def test_the_pad_sees_a_loop_as_wide_as_the_gap(self) -> None:
        x = ramp(1.0, 1001)
        force = simulate(LINEAR, [active("backlash", gap=0.04)], np.arange(x.size) * 1e-3, x)
        assert_allclose(force[1000:1041], K * 1.0, rtol=1e-12)
        assert_allclose(force[1100:] - K * x[1100:], K * 0.04, rtol=1e-9)


class TestInertia:
    t = np.arange(800) * 1e-3

    @pytest.mark.parametrize("form", ["rigid", "damped"])
    def test_steady_acceleration(self, form: str) -> None:
        x = -100.0 + 0.5 * 1000.0 * self.t**2
        drag = {"damping_rate": 20.0} if form == "damped" else {}
        force = simulate(AIR, [active("inertia", form, mass=0.2, **drag)], self.t, x)
        expected = 0.2e-3 * (1000.0 + drag.get("damping_rate", 0.0) * 1000.0 * self.t)
        assert_allclose(force[20:], expected[20:], rtol=1e-7)

    @pytest.mark.parametrize(("lead", "least", "most"), [(0.0, 0.75, 1.4), (0.5, 0.4, 0.75)])
    def test_the_lag_is_a_window_less_what_is_carried_on(self, lead: float, least: float, most: float) -> None:
        x = 300.0 * self.t**3
        for window in (1e-3, 4e-3):
            force = simulate(AIR, [active("inertia", mass=0.5, window=window, lead=lead)], self.t, x)
            lag = self.t - force / (0.5e-3 * 1800.0)
            assert (lag[40:] > least * window).all()
            assert (lag[40:] < most * window).all()

    def test_a_planned_acceleration_is_felt_at_once(self) -> None:
        """Two nodes in the new phase are enough for the third to be exact."""
        t = np.array([0.0, 1e-3, 2e-3, 2.4e-3, 2.6e-3, 2.8e-3, 3e-3, 4e-3, 5e-3])
        x = 0.5 * 5000.0 * np.maximum(t - 2.4e-3, 0.0) ** 2
        force = simulate(AIR, [active("inertia", mass=0.4, window=1e-5, lead=0.0)], t, x)
        assert_allclose(force[:4], 0.0, atol=1e-12)
        assert_allclose(force[5:], 0.4e-3 * 5000.0, rtol=1e-9)

    def test_uneven_times(self) -> None:
        rng = np.random.default_rng(2)
        t = np.cumsum(rng.uniform(1e-4, 4e-3, 2000))
        x = 3.0 * np.sin(2 * np.pi * 1.5 * t)
        force = simulate(AIR, [active("inertia", mass=0.5)], t, x)
        crest = 0.5e-3 * 3.0 * (2 * np.pi * 1.5) ** 2
        assert_allclose(force[20:], -crest * np.sin(2 * np.pi * 1.5 * t[20:]), atol=0.03 * crest)

    def test_stamps_of_two_clocks_do_not_make_spikes(self) -> None:
        """Force samples a hair beside the position samples: the union of both has steps of 50 ns."""
        x = 3.0 * np.sin(2 * np.pi * 1.5 * self.t)
        cascade = Cascade(AIR, [active("inertia", mass=0.5)])
        beside = cascade.simulate_at(self.t, x, self.t + 5e-8)
        assert_allclose(beside[20:], cascade.simulate(self.t, x)[20:], atol=1e-3)

    def test_a_sprung_mass_swings_at_its_frequency_and_decays(self) -> None:
        frequency, damping, mass = 25.0, 0.05, 0.3
        t = np.arange(4000) * 2.5e-4
        x = np.where(t > 0.1, 40.0 * (t - 0.1), 0.0)  # a speed that begins at once
        force = simulate(
            AIR, [active("inertia", "sprung", mass=mass, frequency=frequency, damping_ratio=damping)], t, x
        )
        s = t - 0.1  # the change of speed takes a step; this is its middle
        w = 2 * np.pi * frequency
        w_d = w * np.sqrt(1 - damping**2)
        # the deflection starts from rest with the speed −40; the mass's acceleration is that of a free swing
        e = -40.0 * np.exp(-damping * w * s) * np.sin(w_d * s) / w_d
        de = -40.0 * np.exp(-damping * w * s) * (np.cos(w_d * s) - damping * w / w_d * np.sin(w_d * s))
        expected = np.where(s > 0, -mass * 1e-3 * (w**2 * e + 2 * damping * w * de), 0.0)
        assert_allclose(force[402:], expected[402:], atol=1e-3 * np.abs(expected).max())

    @pytest.mark.parametrize("damping_felt", [0.0, 1.0])
    def test_a_cell_that_is_the_spring_reads_its_deflection_alone(self, damping_felt: float) -> None:
        """Under a steady acceleration from rest, at any spacing of the samples."""
        frequency, damping, mass = 30.0, 0.4, 0.2
        t = np.sort(np.concatenate([self.t, self.t[100:] + 3e-4, [0.1 + 1e-5]]))
        x = np.where(t > 0.1, 0.5 * 1000.0 * (t - 0.1) ** 2, 0.0) - 1000.0
        numbers = {"mass": mass, "frequency": frequency, "damping_ratio": damping, "damping_felt": damping_felt}
        force = simulate(AIR, [active("inertia", "sprung", **numbers)], t, x)
        w = 2 * np.pi * frequency
        s, w_d = np.maximum(t - 0.1, 0.0), w * np.sqrt(1 - damping**2)
        fades = np.exp(-damping * w * s)
        read = 1 - fades * (np.cos(w_d * s) + damping * w / w_d * np.sin(w_d * s))
        read += damping_felt * 2 * damping * w / w_d * fades * np.sin(w_d * s)
        apart = np.abs(force - mass * read)[t > 0.1 + 2e-3]  # the speed's first change is rounded
        assert apart.max() < 4e-3 * mass

    def test_a_stiff_spring_is_the_rigid_mass(self) -> None:
        x = -100.0 + 0.5 * 1000.0 * self.t**2
        force = simulate(AIR, [active("inertia", "sprung", mass=0.2, frequency=60.0, damping_ratio=0.7)], self.t, x)
        assert_allclose(force[100:], 0.2, rtol=1e-6)

    def test_a_mass_that_grows_along_the_way_keeps_the_balance_of_energy(self) -> None:
        """Work done on it from rest is its kinetic energy at the end."""
        t = np.arange(20001) * 1e-4
        x = 1.0 - np.cos(np.pi * t)
        chain = active("inertia", "growing", mass=0.3, growth=0.4, at_depth=0.8, window=1e-4)
        force = simulate(AIR, [chain], t, x)
        speed = np.pi * np.sin(np.pi * t)
        work = np.concatenate([[0.0], np.cumsum(0.5 * (force[1:] + force[:-1]) * np.diff(x))])
        energy = 0.5e-3 * 0.3 * (1 + 0.4 * (x - 0.8)) * speed**2
        assert_allclose(work, energy, atol=2e-3 * energy.max())

    def test_a_bench_that_recoils_takes_a_share_of_a_sudden_acceleration(self) -> None:
        """s²/(s² + 2 ζ ω s + ω²) of a step is e^(−ζωt) (cos ω_d t − ζω/ω_d sin ω_d t)."""
        share, frequency, damping = 0.15, 8.0, 0.1
        t = np.arange(2001) * 5e-4
        x = 10.0 * np.maximum(t - 0.01, 0.0) ** 2
        numbers = {"mass": 0.5, "share": share, "frequency": frequency, "damping_ratio": damping, "lead": 0.0}
        force = simulate(AIR, [active("inertia", "recoiling", window=5e-4, **numbers)], t, x)
        omega = 2 * math.pi * frequency
        swung = omega * math.sqrt(1 - damping**2)
        since = t[40:] - 0.01
        ground = np.exp(-damping * omega * since) * (
            np.cos(swung * since) - damping * omega / swung * np.sin(swung * since)
        )
        assert_allclose(force[40:], 0.5e-3 * 20.0 * (1 - share * ground), rtol=3e-3)

    def test_a_part_that_hangs_is_so_much_of_the_sprung_mass_and_of_the_rigid_one(self) -> None:
        x = 3.0 * np.sin(2 * np.pi * 4.0 * self.t)
        sprung = {"frequency": 20.0, "damping_ratio": 0.3}
        parts = [
            simulate(AIR, [active("inertia", mass=0.2)], self.t, x),
            simulate(AIR, [active("inertia", "sprung", mass=0.2, **sprung)], self.t, x),
        ]
        both = simulate(AIR, [active("inertia", "hung", mass=0.2, share=0.3, **sprung)], self.t, x)
        assert_allclose(both, 0.7 * parts[0] + 0.3 * parts[1], atol=1e-12)


class TestPeriodic:
    def test_cogging(self) -> None:
        x = np.linspace(-5.0, -1.0, 801)
        sine = simulate(AIR, [active("cogging", amplitude=0.2, period=1.6, phase=0.3)], x + 5, x)
        assert_allclose(sine, 0.2 * np.sin(2 * np.pi * x / 1.6 + 0.3), atol=1e-14)
        numbers = {"amplitude": 0.2, "period": 1.6, "phase": 0.3, "ratio": 0.4, "second_phase": 1.0}
        both = simulate(AIR, [active("cogging", "harmonics", **numbers)], x + 5, x)
        assert_allclose(both - sine, 0.08 * np.sin(4 * np.pi * x / 1.6 + 1.0), atol=1e-14)

    def test_a_ripple_that_swells(self) -> None:
        x = np.linspace(-5.0, -1.0, 801)
        numbers = {"amplitude": 0.2, "period": 1.6, "phase": 0.3, "growth": 0.1, "at_depth": 1.0}
        force = simulate(AIR, [active("cogging", "swelling", **numbers)], x + 5, x)
        assert_allclose(force, 0.2 * (1 + 0.1 * (x - 1)) * np.sin(2 * np.pi * x / 1.6 + 0.3), atol=1e-14)

    def test_a_ripple_of_two_periods(self) -> None:
        x = np.linspace(-5.0, -1.0, 801)
        numbers = {"amplitude": 0.2, "period": 1.6, "phase": 0.3, "ratio": 0.4, "order": 1.5, "second_phase": 1.0}
        force = simulate(AIR, [active("cogging", "two_periods", **numbers)], x + 5, x)
        angle = 2 * np.pi * x / 1.6
        assert_allclose(force, 0.2 * np.sin(angle + 0.3) + 0.08 * np.sin(1.5 * angle + 1.0), atol=1e-14)

    @pytest.mark.parametrize("steepness", [0.1, 2.5, 10.0])
    def test_a_ripple_of_teeth_has_its_amplitude_in_the_first_harmonic(self, steepness: float) -> None:
        x = -5.0 + np.arange(640) * 1.6 / 640
        numbers = {"amplitude": 0.2, "period": 1.6, "phase": 0.3, "steepness": steepness}
        force = simulate(AIR, [active("cogging", "slotted", **numbers)], x + 5, x)
        angle = 2 * np.pi * x / 1.6 + 0.3
        assert_allclose(2 * np.mean(force * np.sin(angle)), 0.2, rtol=1e-6)
        top = force.max() / 0.2
        assert top == pytest.approx({0.1: 1.0, 2.5: 0.8394, 10.0: 0.791}[steepness], abs=0.005)

    def test_a_ripple_that_trails(self) -> None:
        x = -5.0 + ramp(4.0, 801)
        numbers = {"amplitude": 0.2, "period": 1.6, "phase": 0.3, "trail": 0.2}
        force = simulate(AIR, [active("cogging", "trailing", **numbers)], np.arange(x.size) * 1e-3, x)
        for way, behind in ((slice(50, 801), -0.1), (slice(850, 1601), 0.1)):
            assert_allclose(force[way], 0.2 * np.sin(2 * np.pi * (x[way] + behind) / 1.6 + 0.3), atol=1e-12)

    def test_an_encoder_error_that_fades(self) -> None:
        numbers = {"amplitude": 0.05, "period": 0.8, "phase": 0.5, "growth": -0.3, "at_depth": 1.0}
        cascade = Cascade(LINEAR, [active("encoder_error", "fading", **numbers)])
        true = np.linspace(-1.0, 2.0, 601)
        plant = cascade.plant()
        reported = np.array([plant.reported_mm(float(x)) for x in true])
        wave = 0.05 * (1 - 0.3 * (true - 1)) * np.sin(2 * np.pi * true / 0.8 + 0.5)
        assert_allclose(reported - true, wave, atol=1e-14)
        assert_allclose(cascade.simulate(true + 1, reported), K * np.maximum(true, 0.0), atol=1e-11)

    def test_an_encoder_error_of_two_periods(self) -> None:
        numbers = {"amplitude": 0.05, "period": 0.8, "phase": 0.5, "ratio": 0.4, "order": 1.7, "second_phase": 1.0}
        cascade = Cascade(LINEAR, [active("encoder_error", "two_periods", **numbers)])
        true = np.linspace(-1.0, 2.0, 601)
        plant = cascade.plant()
        reported = np.array([plant.reported_mm(float(x)) for x in true])
        angle = 2 * np.pi * true / 0.8
        assert_allclose(reported - true, 0.05 * np.sin(angle + 0.5) + 0.02 * np.sin(1.7 * angle + 1.0), atol=1e-14)
        assert_allclose(cascade.simulate(true + 1, reported), K * np.maximum(true, 0.0), atol=1e-11)

    def test_the_encoder_reports_true_plus_error_and_is_undone_before_the_plant(self) -> None:
        for form in ("sine", "harmonics"):
            error = active("encoder_error", form, amplitude=0.05, period=0.8, phase=0.5)
            cascade = Cascade(LINEAR, [error])
            true = np.linspace(-1.0, 2.0, 601)
            plant = cascade.plant()
            reported = np.array([plant.reported_mm(float(x)) for x in true])
            wave = np.sin(2 * np.pi * true / 0.8 + 0.5)
            if form == "harmonics":
                wave = wave + 0.5 * np.sin(4 * np.pi * true / 0.8)
            assert_allclose(reported - true, 0.05 * wave, atol=1e-14)
            assert_allclose(cascade.simulate(true + 1, reported), K * np.maximum(true, 0.0), atol=1e-11)

    def test_an_error_too_steep_is_taken_as_the_steepest(self) -> None:
        plant = Cascade(AIR, [active("encoder_error", amplitude=1.0, period=0.5)]).plant()
        reported = [plant.reported_mm(float(x)) for x in np.linspace(0.0, 1.0, 500)]
        assert np.all(np.diff(reported) > 0.0)
