"""Effects of the pad, and of the frame before it, further forms: each against a closed form."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from sim.effects import effect
from tests.sim.effect_tools import LINEAR, K, active, simulate


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
        block = effect("frame_compliance").form("damped").blocks["frame"]
        state, compliance, late = [0.0, 0.0], 0.01, 0.02
        block(0.0, 5.0, state, [compliance, late])
        state[1] = 5.0  # the force stands from here on
        times = np.cumsum(np.random.default_rng(2).uniform(1e-4, 5e-3, 50))
        got = [block(float(d), 5.0, state, [compliance, late]) for d in np.diff(times, prepend=0.0)]
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
