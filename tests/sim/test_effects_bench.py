"""Effects between motor and load cell: frame, play, magnets, encoder."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from sim.effects import effect
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

    def test_a_worn_play_is_wider_in_one_place(self) -> None:
        x, probe, _ = self.loop("worn", gap=0.1, wear=2.0, worn_at=0.6, width=0.3)
        gap = 0.1 * (1 + 2.0 * np.exp(-(((x - 0.6) / 0.3) ** 2)))
        back = slice(1350, 2001)
        assert_allclose(probe[back] - x[back], gap[back], atol=1e-12)

    @pytest.mark.parametrize(
        ("name", "none"), [("running_out", {"swell": 0.0}), ("wearing", {"growth": 0.0}), ("worn", {"wear": 0.0})]
    )
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

    def test_cogging_of_three_harmonics_that_grows_along_the_way(self) -> None:
        x = np.linspace(0.0, 3.0, 61)
        told = {"amplitude": 0.1, "period": 0.9, "phase": 0.3, "ratio": 0.5, "second_phase": 1.1, "third_ratio": 0.2}
        uneven = active("cogging", "uneven", **told, third_phase=-0.4, growth=0.3, at_depth=1.5)
        theta = 2 * np.pi * x / 0.9
        wave = np.sin(theta + 0.3) + 0.5 * np.sin(2 * theta + 1.1) + 0.2 * np.sin(3 * theta - 0.4)
        assert_allclose(simulate(AIR, [uneven], x, x), 0.1 * (1 + 0.3 * (x - 1.5)) * wave, atol=1e-12)

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

    def test_the_encoder_is_undone_to_rounding_in_every_shape(self) -> None:
        """Steep errors, on a motion that rests, moves and jumps, with the noise of an encoder on it."""
        rng = np.random.default_rng(7)
        moves = np.interp(np.arange(900), [0, 200, 300, 500, 501, 899], [0.0, 0.0, 1.3, 1.3, 0.4, 2.0])
        for form in effect("encoder_error").forms:
            for noise_mm in (0.0, 1e-5, 1e-3):
                numbers = {p.name: p.if_left_out for p in form.parameters} | {"amplitude": 0.02, "period": 0.11}
                cascade = Cascade(AIR, [active("encoder_error", form.name, **numbers)])
                reported = moves + noise_mm * rng.standard_normal(moves.size)
                plant = cascade.plant()
                again = [plant.reported_mm(float(x)) for x in cascade._true(reported)]
                assert_allclose(again, reported, rtol=0.0, atol=2e-14, err_msg=f"{form.name} {noise_mm}")

    def test_an_error_too_steep_is_taken_as_the_steepest(self) -> None:
        plant = Cascade(AIR, [active("encoder_error", amplitude=1.0, period=0.5)]).plant()
        reported = [plant.reported_mm(float(x)) for x in np.linspace(0.0, 1.0, 500)]
        assert np.all(np.diff(reported) > 0.0)
