"""Effects of the force path and of its clock: lag, resonance, delay, drift, hum, limits, faults."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.signal import cheb1ap

from sim.effects import Active, effect
from sim.effects.draws import uniform
from sim.pad import Cascade
from tests.sim.effect_tools import AIR, LINEAR, SOFT, K, active, sense, simulate
from tests.sim.test_pad import walk

Array = NDArray[np.float64]


def sample(effect: Active, force: Array) -> Array:
    """What sampling makes of a force."""
    plant = Cascade(AIR, [effect]).plant()
    return np.array([plant.sample(1e-3, float(f)) for f in force])


LAGS = [form.name for form in effect("sensor_lag").forms]
EVEN = np.arange(3000) * 1e-3
UNEVEN = np.cumsum(np.random.default_rng(3).uniform(0.0, 4e-3, 3000))


class TestForceDelay:
    def test_a_ramp_comes_late_by_speed_times_slope_times_delay(self) -> None:
        x = 0.1 + 2.0 * EVEN
        late = simulate(LINEAR, [active("force_delay", delay=0.0123)], EVEN, x)
        assert_allclose((K * x - late)[20:], 2.0 * K * 0.0123, rtol=1e-9)

    def test_it_is_exact_between_samples(self) -> None:
        t, x = walk(400)
        t = t + np.arange(t.size) * 1e-4  # no stamps repeat
        late = Cascade(SOFT, [active("force_delay", delay=7.7e-4)]).simulate_at(t, x, t + 7.7e-4)
        assert_allclose(late, simulate(SOFT, [], t, x), atol=1e-6)


class TestClockSkew:
    @pytest.mark.parametrize("form", ["linear", "offset", "ageing"])
    def test_clocks_agree_at_the_first_sample_and_part_at_the_rate(self, form: str) -> None:
        stamp = 100.0 + np.linspace(0.0, 50.0, 11)
        felt = Cascade(AIR, [active("clock_skew", form, skew=200.0)]).felt_at(stamp)
        assert felt[0] == stamp[0]
        apart = (stamp - felt)[1] / 5.0 * 1e6
        assert_allclose(apart, {"ageing": 200.0}.get(form, 200 / (1 + 2e-4)), rtol=1e-9)

    def test_the_skew_of_an_ageing_clock_grows_about_its_mean(self) -> None:
        stamp = np.array([0.0, 20.0, 20.001, 50.0, 100.0])
        numbers = {"skew": 500.0, "growth": 0.012, "at_time": 50.0}
        felt = Cascade(AIR, [active("clock_skew", "ageing", **numbers)]).felt_at(stamp)
        assert_allclose(1 - (felt[2] - felt[1]) / 0.001, 500e-6 * (1 - 0.012 * 30), rtol=1e-4)
        assert_allclose(stamp[4] - felt[4], 500e-6 * 100, rtol=1e-12)

    def test_an_offset_without_skew_is_a_delay(self) -> None:
        t, x = walk(300)
        offset = simulate(SOFT, [active("clock_skew", "offset", skew=0.0, offset=0.004)], t, x)
        assert_allclose(offset, simulate(SOFT, [active("force_delay", delay=0.004)], t, x), atol=1e-9)


class TestSensorLag:
    @pytest.mark.parametrize("form", LAGS)
    @pytest.mark.parametrize("t", [EVEN, UNEVEN], ids=["even", "uneven"])
    def test_behind_a_ramp_by_the_time_constant(self, form: str, t: Array) -> None:
        tau = 0.03
        out = sense(active("sensor_lag", form, time_constant=tau), t, 3.0 * t)
        assert_allclose((3.0 * t - out)[t > 40 * tau], 3.0 * tau, rtol=1e-9)

    def test_closed_forms_of_the_ramp_from_its_start(self) -> None:
        tau, s = 0.02, UNEVEN - UNEVEN[0]
        first = s - tau * (1 - np.exp(-s / tau))
        h = tau / 2
        second = s - 2 * h + (2 * h + s) * np.exp(-s / h)
        mean = np.where(s < 2 * tau, s**2 / (4 * tau), s - tau)
        part = s - tau * (1 - np.exp(-0.7 * s / tau))
        expectations = {"first_order": first, "two_poles": second, "moving_average": mean, "partly": part}
        for form, expected in expectations.items():
            out = sense(active("sensor_lag", form, time_constant=tau), UNEVEN, s)
            assert_allclose(out, expected, atol=1e-12)

    def test_chebyshev_ripples_by_half_a_decibel_and_then_falls(self) -> None:
        """|H|² = 1/(1 + ε² T₄²(ω/ω_c)): 1 at the crests of the ripple; delay and band edge go with each other."""
        t, tau = np.arange(60000) * 1e-4, 0.01
        poles = cheb1ap(4, 0.5)[1]
        edge = float(np.sum(-1 / poles).real) / tau
        for ratio in (0.3, math.cos(math.pi / 4), 1.0, 1.5):
            out = sense(active("sensor_lag", "chebyshev", time_constant=tau), t, np.sin(ratio * edge * t))
            chebyshev = 8 * ratio**4 - 8 * ratio**2 + 1
            level = math.sqrt(1 + (10**0.05 - 1)) / math.sqrt(1 + (10**0.05 - 1) * chebyshev**2)
            assert_allclose(np.abs(out[t > 3]).max(), level, rtol=1e-3)

    def test_three_poles_pass_sines_as_butterworths_do(self) -> None:
        t, tau = np.arange(60000) * 1e-4, 0.01
        for ratio in (0.3, 1.0, 1.5):
            out = sense(active("sensor_lag", "three_poles", time_constant=tau), t, np.sin(ratio * 2 / tau * t))
            assert_allclose(np.abs(out[t > 3]).max(), 1 / math.sqrt(1 + ratio**6), rtol=1e-3)

    def test_butterworth_overshoots_a_step_by_four_percent(self) -> None:
        force = np.where(EVEN > 0.1, 1.0, 0.0)
        out = sense(active("sensor_lag", "butterworth", time_constant=0.05), EVEN, force)
        assert_allclose(out.max(), 1 + math.exp(-math.pi), atol=1e-4)

    def test_a_moving_average_of_many_samples_is_theirs(self) -> None:
        """More samples in the window than it has knots for."""
        t = np.arange(40001) * 1e-5
        force = np.sin(30 * t) + 0.3 * np.cos(170 * t)
        out = sense(active("sensor_lag", "moving_average", time_constant=0.04), t, force)
        total = (1 - np.cos(30 * t)) / 30 + 0.3 * np.sin(170 * t) / 170
        w = 8000
        assert_allclose(out[w:], (total[w:] - total[:-w]) / 0.08, atol=1e-5)

    def test_a_decimator_is_a_mean_of_which_the_ramp_says_delay_and_width(self) -> None:
        tau, width, s = 0.02, 0.5, UNEVEN - UNEVEN[0]
        out = sense(active("sensor_lag", "decimator", time_constant=tau, width=width), UNEVEN, s)
        inside = np.clip(s - (1 - width) * tau, 0.0, 2 * width * tau)
        expected = inside**2 / (4 * width * tau) + np.maximum(s - (1 + width) * tau, 0.0)
        assert_allclose(out, expected, atol=1e-12)

    def test_a_decimator_is_nearly_three_means_in_a_row(self) -> None:
        t = np.arange(20001) * 1e-4
        force = np.sin(2 * np.pi * 20.0 * t)
        tau, w = 0.006, 40  # three windows of 2/3 τ
        three = force.copy()
        for _ in range(3):
            total = np.concatenate([[0.0], np.cumsum((three[1:] + three[:-1]) / 2)])
            three = np.concatenate([three[:w], (total[w:] - total[:-w]) / w])
        out = sense(active("sensor_lag", "decimator", time_constant=tau), t, force)
        late = sense(active("sensor_lag", "moving_average", time_constant=tau), t, force)
        assert np.abs(out - three)[1000:].max() < 1e-3 < 0.02 < np.abs(late - three)[1000:].max()

    def test_the_first_sample_is_rest(self) -> None:
        for form in LAGS:
            assert_allclose(sense(active("sensor_lag", form), EVEN[:50], np.full(50, 4.0)), 4.0)

    def test_a_filter_that_opens_where_much_is_missing(self) -> None:
        """After a step the output lacks m: m' = −m (1 + a m)/τ, so that m = m₀ e/(1 + a m₀ (1 − e)), e = e^(−t/τ)."""
        t, opens = (
            np.arange(0.0, 0.5, 5e-4),
            active("sensor_lag", "opening", time_constant=0.05, opens=6.0, at_force=2.0),
        )
        force = sense(opens, t, np.where(t > 0, 4.0, 0.0))
        fades, begun = np.exp(-(t[1:] - t[1]) / 0.05), 4.0 - force[1]
        assert_allclose(4.0 - force[1:], begun * fades / (1.0 + 3.0 * begun * (1.0 - fades)), atol=2e-3)
        slow = sense(opens, t, 1e-4 * t)
        assert_allclose(slow[-1], 1e-4 * (t[-1] - 0.05), rtol=1e-3)


class TestResonance:
    def ringing(self, frequency: float, damping: float, t: Array) -> Array:
        """Response to a ramp that begins at 0, less what is left of it in the end."""
        out = sense(active("resonance", frequency=frequency, damping_ratio=damping), t, t)
        return out - (t - 2 * damping / (2 * math.pi * frequency))

    def test_frequency_and_decrement(self) -> None:
        frequency, damping = 20.0, 0.08
        t = np.arange(20001) * 1e-4
        swing = self.ringing(frequency, damping, t)
        crests = np.flatnonzero((swing[1:-1] > swing[:-2]) & (swing[1:-1] > swing[2:])) + 1
        crests = crests[:5]
        period = 1 / (frequency * math.sqrt(1 - damping**2))
        assert_allclose(np.diff(t[crests]), period, atol=2e-4)
        decrement = np.log(swing[crests][:-1] / swing[crests][1:])
        assert_allclose(decrement, 2 * math.pi * damping / math.sqrt(1 - damping**2), rtol=1e-3)

    def test_the_ramp_is_exact_at_any_spacing(self) -> None:
        w, z = 2 * math.pi * 20.0, 0.08
        t = UNEVEN - UNEVEN[0]
        w_d = w * math.sqrt(1 - z * z)
        e, de = 2 * z / w, -1.0
        expected = np.exp(-z * w * t) * (e * np.cos(w_d * t) + (de + z * w * e) / w_d * np.sin(w_d * t))
        assert_allclose(self.ringing(20.0, 0.08, t), expected, atol=1e-12)

    def test_a_sine_is_amplified_as_the_transfer_function_says(self) -> None:
        t = np.arange(40000) * 2e-4
        w, z = 2 * math.pi * 20.0, 0.2
        for ratio in (0.5, 1.0, 2.0):
            out = sense(active("resonance", frequency=20.0, damping_ratio=z), t, np.sin(ratio * w * t))
            gain = 1 / math.hypot(1 - ratio**2, 2 * z * ratio)
            assert_allclose(np.abs(out[t > 4]).max(), gain, rtol=2e-3)

    def test_a_part_that_rings(self) -> None:
        force = np.where(EVEN > 0.1, 1.0, 0.0)
        numbers = {"frequency": 30.0, "damping_ratio": 0.1}
        whole = sense(active("resonance", **numbers), EVEN, force)
        part = sense(active("resonance", "partial", share=0.25, **numbers), EVEN, force)
        assert_allclose(part, 0.75 * force + 0.25 * whole, atol=1e-13)

    def test_transmissibility_and_a_pole_after_the_mode(self) -> None:
        """Gain and phase of sines, against the transfer functions."""
        t = np.arange(40000) * 2e-4
        w, z, r = 2 * math.pi * 20.0, 0.2, 3.0
        late = t > 4
        for ratio in (0.5, 1.0, 2.0):
            s = 1j * ratio
            mode = s * s + 2 * z * s + 1
            other, zeros = s * s + 2 * z * s * r + r * r, (s / r) ** 2 + 2 * z * s / r + 1
            transfers = {
                "transmitted": (2 * z * s + 1) / mode,
                "amplifier": 1 / mode / (1 + s / r),
                "pair": 0.7 / mode + 0.3 * r * r / other,
                "antiresonance": zeros / mode,
            }
            for form, transfer in transfers.items():
                given = {} if form == "transmitted" else {"ratio": r}
                given |= {"share": 0.7} if form == "pair" else {}
                effect_ = active("resonance", form, frequency=20.0, damping_ratio=z, **given)
                out = sense(effect_, t, np.sin(ratio * w * t))
                expected = np.imag(transfer * np.exp(1j * ratio * w * t))
                assert_allclose(out[late], expected[late], atol=3e-4)

    def test_a_mode_that_is_stiffer_under_load(self) -> None:
        """Small steps beside a load that stays: they ring at √(1 + growth (F/at − 1)) of the frequency."""
        t = np.arange(20000) * 1e-4
        for load in (0.0, 4.0, 8.0):
            numbers = {"frequency": 20.0, "damping_ratio": 0.05, "growth": 0.36, "at_force": 4.0}
            rings = sense(active("resonance", "loaded", **numbers), t, np.where(t > 0.1, load + 1e-3, load)) - load
            faster = math.sqrt(1 + 0.36 * (load / 4.0 - 1))
            plain = active("resonance", frequency=20.0 * faster, damping_ratio=0.05 / faster)
            assert_allclose(rings, sense(plain, t, np.where(t > 0.1, 1e-3, 0.0)), atol=1e-6)

    @pytest.mark.parametrize("exponent", [0.5, 1.0, 2.0])
    def test_a_damper_that_goes_with_a_power_of_the_speed(self, exponent: float) -> None:
        """Against the equation of motion, and its loss in a swing against that of a viscous damper."""
        frequency, zeta, share, swing = 20.0, 0.1, 0.6, 0.3
        w = 2 * math.pi * frequency
        angles = np.linspace(0, 2 * math.pi, 20001)
        loss = np.trapezoid(np.abs(np.cos(angles)) ** (exponent + 1), angles)
        strength = 2 * zeta * share * w * math.pi / loss * (w * swing) ** (1 - exponent)
        t = np.arange(800) * 1e-3
        force = np.interp(t, [0.05, 0.06, 0.4, 0.42], [0.0, 1.0, 1.0, 0.4])

        def moves(now: float, y: Array) -> list[float]:
            drag = 2 * zeta * (1 - share) * w * y[1] + strength * abs(y[1]) ** exponent * np.sign(y[1])
            return [y[1], w * w * (np.interp(now, t, force) - y[0]) - drag]

        expected = solve_ivp(moves, (0.0, t[-1]), [0.0, 0.0], t_eval=t, max_step=2e-4, rtol=1e-8, atol=1e-10).y[0]
        numbers = {"frequency": frequency, "damping_ratio": zeta, "share": share, "at_swing": swing}
        out = sense(active("resonance", "damper", exponent=exponent, **numbers), t, force)
        assert_allclose(out, expected, atol=1e-3)

    def test_a_joint_that_rubs_sticks_where_it_is(self) -> None:
        """Slowly up, a rest, slowly down: behind by what the joint holds, either way, and as long as it rests."""
        frequency, zeta, swing = 40.0, 0.1, 0.3
        w = 2 * math.pi * frequency
        holds = math.pi / 4 * 2 * zeta * w * (w * swing) / w**2  # of the loss of a viscous damper in that swing
        numbers = {"frequency": frequency, "damping_ratio": zeta, "share": 1.0, "exponent": 0.0, "at_swing": swing}
        for dt in (1e-3, 7e-3):
            t = np.arange(0.0, 9.0, dt)
            force = np.interp(t, [0.0, 3.0, 6.0, 9.0], [0.0, 3.0, 3.0, 0.0])
            out = sense(active("resonance", "damper", **numbers), t, force)
            up, rests, down = (force - out)[(t > 1.0) & (t < 3.0)], out[(t > 3.01) & (t < 6.0)], (force - out)[t > 7.0]
            # as it breaks away it swings, by its speed over ω, and nothing ends that as long as it does not turn
            assert_allclose(up, holds, atol=1.3 / w)
            assert np.mean(up) == pytest.approx(holds, rel=0.01) and np.mean(down) == pytest.approx(-holds, rel=0.01)
            assert np.ptp(rests) < 0.01 * holds

    def test_other_shapes_are_exact_at_any_spacing(self) -> None:
        """What comes out of ramps between uneven samples does not change when more samples lie on them."""
        t = UNEVEN[:300]
        force = np.cumsum(np.random.default_rng(5).standard_normal(t.size))
        fine = np.sort(np.concatenate([t, (t[1:] + t[:-1]) / 2]))
        for form in ("transmitted", "amplifier", "pair", "antiresonance"):
            ringing = active("resonance", form, frequency=20.0, damping_ratio=0.1)
            whole = sense(ringing, fine, np.interp(fine, t, force))
            assert_allclose(sense(ringing, t, force), whole[np.searchsorted(fine, t)], atol=1e-9)


class TestBiasDriftHum:
    def test_bias(self) -> None:
        assert_allclose(sense(active("force_bias", bias=-0.2), EVEN[:3], np.array([0.0, 1.0, 2.0])), [-0.2, 0.8, 1.8])

    def test_a_bias_that_moves_a_little(self) -> None:
        t = np.array([3.0, 8.0, 13.0, 103.0])  # times count from the first sample on
        settles = sense(active("force_bias", "settling", bias=-0.2, share=0.1, time_constant=5.0), t, np.zeros(4))
        assert_allclose(settles, -0.2 * (1 + 0.1 * np.exp([0.0, -1.0, -2.0, -20.0])))
        slips = sense(active("force_bias", "slipping", bias=-0.2, share=0.1, moved_at=5.0, within=0.1), t, np.zeros(4))
        assert_allclose(slips, [-0.19, -0.2, -0.21, -0.21])

    def test_a_bias_that_pulls_along_the_way(self) -> None:
        t, x = np.arange(6.0), np.array([-9.0, -1.0, 0.0, 1.0, 2.0, 9.0])
        pulls = simulate(AIR, [active("force_bias", "along", bias=-0.2, share=0.1, reach=2.0)], t, x)
        assert_allclose(pulls, -0.2 * np.array([0.9, 0.9, 0.95, 1.0, 1.05, 1.1]))

    @pytest.mark.parametrize("form", [form.name for form in effect("force_drift").forms])
    def test_all_drifts_begin_at_the_rate(self, form: str) -> None:
        t = np.array([5.0, 5.001])
        assert_allclose(sense(active("force_drift", form, rate=-0.3), t, np.zeros(2)), [0.0, -0.3e-3], rtol=1e-4)

    def test_where_drifts_go(self) -> None:
        t = np.array([0.0, 1e4, 4e4])
        zero = np.zeros(3)
        numbers = {"rate": 0.01, "time_constant": 20.0}
        assert_allclose(sense(active("force_drift", rate=0.01), t, zero), 0.01 * t)
        assert_allclose(sense(active("force_drift", "settling", **numbers), t, zero)[1:], 0.2)
        turns = sense(active("force_drift", "turning", **numbers), np.array([0.0, 20.0, 40.0]), zero)
        assert_allclose(turns, [0.0, 0.4 / math.pi, 0.0], atol=1e-12)
        slows = sense(active("force_drift", "hyperbolic", **numbers), np.array([0.0, 20.0, 60.0]), zero)
        assert_allclose(slows, [0.0, 0.1, 0.15], atol=1e-12)
        bends = active("force_drift", "bent", rate=0.01, share=0.25, bends_at=20.0)
        assert_allclose(sense(bends, np.array([0.0, 20.0, 40.0]), zero), [0.0, 0.2, 0.25], atol=1e-12)
        ends = sense(active("force_drift", "quickening", **numbers), np.array([0.0, 20.0, 40.0]), zero)
        assert_allclose(ends, [0.0, 0.3, 0.8], atol=1e-12)
        root = sense(active("force_drift", "root", **numbers), t, zero)
        assert_allclose(root[2] / root[1], 2.0, rtol=0.05)
        log = sense(active("force_drift", "logarithmic", **numbers), t, zero)
        assert_allclose(log[2] - log[1], 0.2 * math.log(4), rtol=0.01)

    def test_hum(self) -> None:
        out = sense(active("mains_hum", amplitude=0.1, frequency=50.0, phase=0.4), 7.0 + UNEVEN, np.zeros(UNEVEN.size))
        s = UNEVEN - UNEVEN[0]
        assert_allclose(out, 0.1 * np.sin(2 * math.pi * 50 * s + 0.4), atol=1e-9)
        t = np.arange(4000) * 1e-3
        both = sense(active("mains_hum", "harmonics", amplitude=0.1, ratio=0.3), t, np.zeros(t.size))
        spectrum = np.abs(np.fft.rfft(both)) / 2000
        assert_allclose(spectrum[[200, 400, 600]], [0.1, 0.0, 0.03], atol=1e-9)

    def test_hum_with_more_harmonics_and_hum_that_swings(self) -> None:
        t = np.arange(4000) * 1e-3
        given = {"ratio": 0.3, "fifth": 0.2, "fifth_phase": 1.0, "seventh": 0.1}
        flat = sense(active("mains_hum", "flat_topped", amplitude=0.1, **given), t, np.zeros(t.size))
        spectrum = np.abs(np.fft.rfft(flat)) / 2000
        assert_allclose(spectrum[[200, 600, 1000, 1400]], [0.1, 0.03, 0.02, 0.01], atol=1e-9)
        swing = {"period": 4.0, "swell": 0.4, "swell_phase": 0.3, "wander": 0.5, "wander_phase": 1.0}
        out = sense(active("mains_hum", "swinging", amplitude=0.1, frequency=50.0, **swing), t, np.zeros(t.size))
        slow = 2 * math.pi * t / 4.0
        angle = 2 * math.pi * 50 * t + 0.5 * np.sin(slow + 1.0)
        assert_allclose(out, 0.1 * (1 + 0.4 * np.sin(slow + 0.3)) * np.sin(angle), atol=1e-9)
        names = ("second", "third", "fourth", "fifth", "sixth", "seventh")
        higher = dict.fromkeys(names, 0.0) | {"third": 0.3, "third_phase": -0.7, "sixth": 0.1}
        form, numbers = "swinging_harmonics", {"amplitude": 0.1, "frequency": 50.0, **swing, **higher}
        out = sense(active("mains_hum", form, **numbers), t, np.zeros(t.size))
        wave = np.sin(angle) + 0.3 * np.sin(3 * angle - 0.7) + 0.1 * np.sin(6 * angle)
        assert_allclose(out, 0.1 * (1 + 0.4 * np.sin(slow + 0.3)) * wave, atol=1e-9)

    def test_hum_that_grows_with_the_load(self) -> None:
        t = np.arange(4000) * 1e-3
        numbers = {"amplitude": 0.1, "growth": 0.25, "at_force": 2.0}
        for form, third in (("loaded", 0.0), ("loaded_harmonics", 0.03)):
            for load, swells in ((0.0, 0.5), (2.0, 1.0), (6.0, 2.0)):
                out = sense(active("mains_hum", form, frequency=50.0, **numbers), t, np.full(t.size, load)) - load
                spectrum = np.abs(np.fft.rfft(out)) / 2000
                assert_allclose(spectrum[[200, 400, 600]], [0.1 * swells, 0.0, third * swells], atol=1e-9)


class TestLimitsAndFaults:
    force = np.linspace(-10.0, 10.0, 401)

    def test_saturation(self) -> None:
        assert_allclose(sample(active("saturation", limit=4.0), self.force), np.clip(self.force, -4, 4))
        assert_allclose(sample(active("saturation", "upper", limit=4.0), self.force), np.minimum(self.force, 4))
        stopped = sample(active("saturation", "stop", limit=4.0, passes=0.05), self.force)
        assert_allclose(stopped, np.minimum(self.force, 4) + 0.05 * np.maximum(self.force - 4, 0), atol=1e-12)
        folded = sample(active("saturation", "folding", limit=4.0, falls=0.1), self.force)
        assert_allclose(folded, np.minimum(self.force, 4) - 0.1 * np.maximum(self.force - 4, 0), atol=1e-12)
        # Slope 1 at the limit, and 1/e of it where the logarithm has grown by 1.
        beyond = np.array([4.0, 4.0 + 1e-6, 4.0 + 0.2 * (math.e - 1.0), -4.0 - 0.2 * (math.e - 1.0), 3.0])
        bent = sample(active("saturation", "compressing", limit=4.0, reach=0.2), beyond)
        assert_allclose(bent, [4.0, 4.0 + 1e-6, 4.2, -4.2, 3.0], rtol=1e-9)
        soft = sample(active("saturation", "soft", limit=4.0, sharpness=3.0), self.force)
        assert np.all(np.diff(soft) > 0)
        assert np.abs(soft).max() < 4.0
        near = np.abs(self.force) < 0.3
        assert_allclose(soft[near], self.force[near], rtol=1e-3)
        sharp = sample(active("saturation", "soft", limit=4.0, sharpness=60.0), self.force)
        assert_allclose(sharp, np.clip(self.force, -4, 4), atol=0.05)

    @pytest.mark.parametrize("form", ["heavy", "spikes", "one_sided", "dropouts"])
    def test_outliers(self, form: str) -> None:
        n, fraction, size = 60000, 0.03, 2.0
        off = sample(active("outliers", form, fraction=fraction, size=size), np.full(n, 5.0)) - 5.0
        hit = off != 0.0
        spread = 5 * math.sqrt(fraction * (1 - fraction) / n)
        assert abs(hit.mean() - fraction) < spread
        gaps = np.diff(np.flatnonzero(hit))
        assert abs((gaps == 1).mean() - fraction) < 5 * math.sqrt(fraction / gaps.size)  # they come singly
        if form == "spikes":
            assert set(np.round(off[hit], 12)) == {-2.0, 2.0}
        elif form == "dropouts":
            assert_allclose(off[hit], size - 5.0)
        else:
            assert abs(np.abs(off[hit]).mean() - size) < 5 * size / math.sqrt(hit.sum())
            assert (off[hit] > 0).all() == (form == "one_sided")
        if form in ("heavy", "spikes"):
            assert abs((off[hit] > 0).mean() - 0.5) < 2.5 / math.sqrt(hit.sum())

    @pytest.mark.parametrize("seed", range(5))
    def test_a_short_recording_has_its_share_of_stuck_samples(self, seed: int) -> None:
        force = np.arange(2500.0)
        stuck = sample(active("stuck_samples", "runs", fraction=0.02, length=10.0, seed=float(seed)), force) != force
        assert abs(stuck.sum() - 50) <= 10

    @pytest.mark.parametrize("form", ["runs", "random_runs"])
    def test_stuck_samples(self, form: str) -> None:
        n, fraction, length = 60000, 0.1, 12
        force = np.arange(n, dtype=np.float64)
        out = sample(active("stuck_samples", form, fraction=fraction, length=length), force)
        stuck = out != force
        edges = np.flatnonzero(np.diff(stuck.astype(int)))
        starts = edges[::2]
        assert abs(stuck.mean() - fraction) < 5 * fraction * math.sqrt(2 / starts.size)
        for start in starts:
            assert (out[start + 1] == start) and out[start] == start  # the last good value
        assert np.all(out[stuck] < force[stuck])
        lengths = np.diff(edges)[::2][: starts.size - 1]
        if form == "runs":
            assert (lengths % length == 0).all()  # a run may begin as the last one ends
        else:
            assert abs(lengths.mean() - length) < 5 * length / math.sqrt(lengths.size)

    def test_draws_are_even_and_each_seed_has_its_own(self) -> None:
        draws = np.array([[uniform(n, seed) for n in range(20000)] for seed in range(3)])
        assert ((draws > 0) & (draws < 1)).all()
        counts = np.stack([np.histogram(row, 20, (0, 1))[0] for row in draws])
        assert_allclose(counts, 1000, atol=5 * math.sqrt(1000))
        correlation = np.corrcoef(np.vstack([draws, np.roll(draws[0], 1)]))
        assert np.abs(correlation - np.eye(4)).max() < 5 / math.sqrt(20000)
        assert uniform(7, 1) == uniform.python(7, 1)
