"""What the motor moves: its friction and its mass."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from sim.elastic import Exponential
from sim.pad import Cascade, Pad
from sim.relaxation import Relaxation
from tests.sim.effect_tools import AIR, LINEAR, active, ramp, simulate


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

    def test_what_goes_with_the_load_knows_the_force_of_the_pad_that_relaxes_and_that_of_a_frame(self) -> None:
        t = np.arange(4001) * 1e-3
        x = np.where(t < 2.0, t, 4.0 - t)
        pad = Pad(Exponential(2.0, 0.5), Relaxation((0.3,), (2.0,)), True)
        for beside in ([], [active("frame_compliance", compliance=0.01)]):
            load = Cascade(pad, beside).simulate(t, x)
            y = x - 0.01 * load if beside else x
            friction = active("friction", "pressed", coulomb=0.05, load=0.4, presliding=1e-5)
            drag = 0.05 * (1 + 0.4 * load) * np.where(t <= 2.0, 1.0, -1.0)
            cell = Cascade(pad, [*beside, friction]).simulate(t, x + (0.01 * drag if beside else 0.0))
            assert_allclose((cell - load - drag)[[500, 1500, 3000]], 0.0, atol=1e-9 if not beside else 2e-5)
            cogging = active("cogging", "driven", amplitude=0.05, period=0.3, phase=0.2, growth=0.4, at_load=2.0)
            wave = 0.05 * (1 + 0.4 * (load / 2.0 - 1)) * np.sin(2 * np.pi * y / 0.3 + 0.2)
            cell = Cascade(pad, [*beside, cogging]).simulate(t, x + (0.01 * wave if beside else 0.0))
            assert_allclose(cell - load, wave, atol=1e-12)

    @pytest.mark.parametrize("form", ["coulomb", "presliding", "stribeck", "load_dependent", "pressed", "one_way"])
    def test_a_closed_loop_takes_energy(self, form: str) -> None:
        x = np.concatenate([0.4 * np.sin(np.linspace(0, 2 * np.pi, 3001)) + 0.5] * 2)
        force = simulate(AIR, [active("friction", form)], np.arange(x.size) * 1e-3, x)
        around = slice(x.size // 2, None)  # the second loop begins as it ends
        work = np.sum(0.5 * (force[around][1:] + force[around][:-1]) * np.diff(x[around]))
        assert work > 0.9 * 0.05 * 1.6 * 0.5


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
