from decimal import Decimal, localcontext

import numpy as np
import pytest
from numpy.testing import assert_allclose

from sim.kernel import ramp_gain
from sim.relaxation import Relaxation, modes, modes_and_slopes, ramp_gain_slope

GEL = Relaxation((0.25, 0.15), (4.0, 0.35))


def uneven(n: int = 400, seed: int = 1) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.cumsum(rng.choice([1e-4, 1e-3, 0.02, 0.3], n))


def test_g_is_equation_6() -> None:
    t = np.array([0.0, 0.1, 1.0, 100.0])
    assert_allclose(GEL.reduced(t), 0.6 + 0.25 * np.exp(-4 * t) + 0.15 * np.exp(-0.35 * t))
    assert GEL.reduced(0.0) == 1.0
    assert_allclose(GEL.c_0, 0.6)
    assert GEL.order == 2


def test_ramp_and_hold_in_closed_form_at_uneven_times() -> None:
    """F = v ∫ g on the ramp; on the hold the same integral from the ramp's age (superposition in (5))."""
    t = np.unique(np.concatenate([[0.0, 0.5], uneven()]))
    speed, end = 3.0, 0.5
    Fe = speed * np.minimum(t, end)

    def integral(s: np.ndarray) -> np.ndarray:
        return 0.6 * s + 0.25 * (1 - np.exp(-4 * s)) / 4 + 0.15 * (1 - np.exp(-0.35 * s)) / 0.35

    expected = speed * (integral(t) - integral(np.maximum(t - end, 0.0)))
    assert_allclose(GEL.filter(t, Fe), expected, rtol=1e-12, atol=1e-13)


def test_a_step_answers_with_g() -> None:
    t = np.concatenate([[0.0], uneven()])
    assert_allclose(GEL.filter(t, np.full(t.size, 2.0)), 2.0 * GEL.reduced(t), rtol=1e-12)


def test_a_repeated_stamp_is_a_step() -> None:
    t = np.array([0.0, 1.0, 1.0, 2.0])
    Fe = np.array([0.0, 0.0, 1.0, 1.0])
    assert_allclose(GEL.filter(t, Fe), [0.0, 0.0, 1.0, float(GEL.reduced(1.0))])


def test_sensitivities_against_differences() -> None:
    t = uneven()
    Fe = np.cumsum(np.random.default_rng(2).standard_normal(t.size))
    nu = np.array([40.0, 4.0, 0.35, 1e-4])
    w, dw = modes_and_slopes(t, Fe, nu)
    assert_allclose(w, modes(t, Fe, nu), rtol=1e-14)
    for i in range(nu.size):
        h = 1e-5 * nu[i]
        up, down = nu.copy(), nu.copy()
        up[i] += h
        down[i] -= h
        difference = (modes(t, Fe, up) - modes(t, Fe, down))[:, i] / (2 * h)
        assert_allclose(dw[:, i], difference, rtol=1e-5, atol=1e-6 * np.abs(difference).max())


def test_gain_and_its_slope_to_rounding_over_16_decades() -> None:
    with localcontext() as context:
        context.prec = 60
        for x in [*np.logspace(-14, 2, 160), 0.0199999, 0.0200001]:
            exact = Decimal(float(x))
            gain = (1 - (-exact).exp()) / exact
            slope = ((-exact).exp() - gain) / exact
            assert abs(ramp_gain(x) / float(gain) - 1) < 5e-16
            assert abs(ramp_gain_slope(x, ramp_gain(x)) / float(slope) - 1) < 1e-12
    assert ramp_gain(0.0) == 1.0


def test_very_fast_and_very_slow_modes_have_their_limits() -> None:
    t = np.arange(0, 1, 1e-3)
    Fe = t**2
    w = modes(t, Fe, [1e-12, 1e9])
    assert_allclose(w[:, 0], Fe, atol=1e-11)  # never relaxes
    assert_allclose(w[:, 1], 0.0, atol=1e-5)  # relaxed at once


def test_shapes_that_do_not_match() -> None:
    with pytest.raises(ValueError, match="differ in shape"):
        modes([0.0, 1.0], [0.0], [1.0])
    with pytest.raises(ValueError, match="same number"):
        Relaxation((0.1,), ())
    assert modes([], [], [1.0]).shape == (0, 1)
