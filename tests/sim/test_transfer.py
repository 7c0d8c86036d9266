import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy import signal

from sim.relaxation import Relaxation
from sim.transfer import (
    Filter,
    NotARelaxation,
    frequency_response,
    is_relaxation,
    ramp_invariant,
    relaxation_of,
    state_space,
    transfer_function,
    zero_order_hold,
)

SHARES, RATES = (0.25, 0.15), (4.0, 0.35)
OMEGA = np.geomspace(1e-3, 1e3, 60)
HOLDS = {"zero_order": zero_order_hold, "ramp": ramp_invariant}

T_ = st.sampled_from([1e-3, 0.01, 0.05, 1.0])


@st.composite
def relaxations(draw: st.DrawFn, most: int = 3) -> tuple[tuple[float, ...], tuple[float, ...], float]:
    """Shares, rates and sample time with poles that double precision tells apart to 1e-9: gaps of 0.1 and more."""
    T = draw(T_)
    count = draw(st.integers(0, most))
    gaps = [draw(st.floats(0.1, 0.95 / max(count, 3))) for _ in range(count)]
    poles = 0.02 + np.cumsum(gaps)
    weights = np.array([draw(st.floats(0.05, 1.0)) for _ in range(count + 1)])
    c_0 = draw(st.sampled_from([0.0, 0.3, 1.0])) * weights[-1]
    shares = weights[:-1] / (weights[:-1].sum() + c_0) if count else weights[:0]
    return tuple(shares.tolist()), tuple((-np.log(poles) / T).tolist()), T


@settings(max_examples=150, deadline=None)
@given(relaxations(), st.sampled_from(sorted(HOLDS)))
def test_round_trip(relaxation: tuple[tuple[float, ...], tuple[float, ...], float], hold: str) -> None:
    shares, rates, T = relaxation
    found_shares, found_rates = relaxation_of(HOLDS[hold](shares, rates, T), T, hold)  # type: ignore[arg-type]
    assert_allclose(found_shares, shares, rtol=0, atol=1e-9)
    assert_allclose(found_rates, rates, rtol=1e-9)
    assert list(found_rates) == sorted(found_rates, reverse=True)


@settings(max_examples=50, deadline=None)
@given(relaxations(4))
def test_zero_order_hold_answers_a_step_with_g(
    relaxation: tuple[tuple[float, ...], tuple[float, ...], float],
) -> None:
    shares, rates, T = relaxation
    filter = zero_order_hold(shares, rates, T)
    n = np.arange(40)
    g = 1 - sum(shares) + sum(c * np.exp(-nu * n * T) for c, nu in zip(shares, rates, strict=True))
    assert filter.b[0] == 1.0
    assert len(filter.b) == len(filter.a) == len(shares) + 1
    assert_allclose(filter.step_response(40), g + np.zeros(40), rtol=0, atol=1e-11)
    assert_allclose(filter.static_gain, 1 - sum(shares), atol=1e-11)


@settings(max_examples=50, deadline=None)
@given(relaxations(4))
def test_ramp_invariant_answers_a_ramp_with_the_integral_of_g(
    relaxation: tuple[tuple[float, ...], tuple[float, ...], float],
) -> None:
    shares, rates, T = relaxation
    t = np.arange(40) * T
    integral = (1 - sum(shares)) * t
    for c, nu in zip(shares, rates, strict=True):
        integral = integral + c * -np.expm1(-nu * t) / nu
    assert_allclose(ramp_invariant(shares, rates, T).response(t), integral, rtol=1e-9, atol=1e-11 * T)


@settings(max_examples=25, deadline=None)
@given(relaxations(), st.integers(0, 2**31))
def test_ramp_invariant_is_the_filter_of_the_simulation(
    relaxation: tuple[tuple[float, ...], tuple[float, ...], float], seed: int
) -> None:
    shares, rates, T = relaxation
    Fe = np.append(0.0, np.random.default_rng(seed).uniform(0, 5, 200))
    expected = Relaxation(shares, rates).filter(np.arange(Fe.size) * T, Fe)
    assert_allclose(ramp_invariant(shares, rates, T).response(Fe), expected, rtol=0, atol=1e-9)


def test_transfer_function_by_hand() -> None:
    """c_0 + c_1 s/(s + 4) + c_2 s/(s + 0.35) over a common denominator."""
    numerator, denominator = transfer_function(SHARES, RATES)
    assert_allclose(denominator, [1.0, 4.35, 1.4])
    assert_allclose(numerator, [1.0, 0.6 * 4.35 + 0.25 * 0.35 + 0.15 * 4, 0.6 * 1.4])
    assert_allclose(frequency_response(SHARES, RATES, OMEGA), signal.freqs(numerator, denominator, OMEGA)[1])


def test_without_modes_it_is_a_spring() -> None:
    numerator, denominator = transfer_function((), ())
    assert numerator.tolist() == denominator.tolist() == [1.0]
    assert zero_order_hold((), (), 0.1) == ramp_invariant((), (), 0.1) == Filter((1.0,), (1.0,))
    assert relaxation_of(Filter((1.0,), (1.0,)), 0.1) == ((), ())
    assert_allclose(state_space((), ()).frequency_response(OMEGA), 1.0)


@pytest.mark.parametrize(("hold", "theirs"), [("zero_order", "zoh"), ("ramp", "foh")])
def test_against_scipys_discretisation(hold: str, theirs: str) -> None:
    shares, rates, T = (0.2, 0.25, 0.15), (40.0, 4.0, 0.35), 0.02
    numerator, denominator, _ = signal.cont2discrete(transfer_function(shares, rates), T, method=theirs)
    filter = HOLDS[hold](shares, rates, T)
    assert_allclose(filter.a, denominator, rtol=1e-9)
    assert_allclose(filter.b, numerator.ravel(), rtol=1e-9)


@pytest.mark.parametrize("hold", sorted(HOLDS))
def test_state_spaces_are_the_same_systems(hold: str) -> None:
    T = 0.02
    assert_allclose(
        state_space(SHARES, RATES).frequency_response(OMEGA), frequency_response(SHARES, RATES, OMEGA), rtol=1e-12
    )
    omega = np.geomspace(1e-3, 0.99 * math.pi / T, 40)
    space = state_space(SHARES, RATES, T, hold)  # type: ignore[arg-type]
    expected = HOLDS[hold](SHARES, RATES, T).frequency_response(omega, T)
    assert_allclose(space.frequency_response(omega), expected, rtol=1e-10)
    assert space.A.shape == (2, 2)
    assert space.sample_time_s == T


def test_at_a_haptic_rate_the_modes_are_found_as_far_as_digits_go() -> None:
    """At 1 kHz the poles stand within 4e-4 of 1; rounding of a alone moves the slow rate by some 1e-9."""
    shares, rates = relaxation_of(ramp_invariant(SHARES, RATES, 1e-3), 1e-3, "ramp")
    assert_allclose(shares, SHARES, rtol=1e-7)
    assert_allclose(rates, RATES, rtol=1e-7)


@pytest.mark.parametrize("T", [0.1, 1e-3])
@pytest.mark.parametrize("apart", [0.0, 1e-9, 1e-7, 1e-6])
def test_rates_that_digits_cannot_tell_apart_are_one_mode(apart: float, T: float) -> None:
    shares, rates = relaxation_of(zero_order_hold((0.2, 0.1), (1.0 + apart, 1.0), T), T)
    assert_allclose(shares, [0.3], rtol=1e-8)
    assert_allclose(rates, [1.0 + apart * 2 / 3], rtol=1e-8)


def test_rates_that_digits_tell_apart_stay_two_modes() -> None:
    shares, rates = relaxation_of(zero_order_hold((0.2, 0.1), (1.01, 1.0), 0.1), 0.1)
    assert_allclose(shares, [0.2, 0.1], rtol=1e-6)
    assert_allclose(rates, [1.01, 1.0], rtol=1e-8)


@pytest.mark.parametrize(
    "extra",
    [[1, 0.3], [1, 1.3], [1, -1.3], [1, -1.0], [1, -1.4, 0.49], [1, -0.8, 0.25], [1, 0.3, 0.02]],
    ids=["negative", "unstable negative", "unstable", "at 1", "double", "complex", "two"],
)
def test_a_pole_that_a_zero_cancels_does_not_count(extra: list[float]) -> None:
    plain = zero_order_hold((0.3,), (0.5,), 1.0)
    padded = Filter(np.convolve(plain.a, extra).tolist(), np.convolve(plain.b, extra).tolist())
    shares, rates = relaxation_of(padded, 1.0)
    assert_allclose(shares, [0.3], rtol=1e-7)
    assert_allclose(rates, [0.5], rtol=1e-7)


@pytest.mark.parametrize(
    ("a", "b", "words"),
    [
        ([1, -0.5, 0.3], [1, -0.2, 0.1], "complex: a held force would oscillate"),
        ([1, -0.5, 1.3], [1, -0.2, 0.1], "oscillate, and grow"),
        ([1, 0.5], [1, 0.2], "the pole -0.5 is negative"),
        ([1, 1.007], [1, 0.2], "unstable"),
        ([1, -1.1], [1, -1.2], "the pole 1.1 lies outside the unit circle"),
        ([1, -1.0], [1, -0.7], "a pole lies at 1"),
        ([1, -0.9], [1, -0.8], "share -1: it would make a held force rise"),
        ([1, -0.9], [1, -1.1], "would end below 0 (static gain -1)"),
        ([1, -1.8, 0.81], [1, -1.85, 0.86], "2 poles coincide at 0.9"),
        ([1, -0.5], [2, -1.2], "starts at 2, not at 1"),
        ([1], [0.5], "starts at 0.5"),
        ([1, -0.5], [1, -0.6, 0.01], "of higher degree than A"),
    ],
)
def test_what_is_no_relaxation_is_refused_in_words(a: list[float], b: list[float], words: str) -> None:
    with pytest.raises(NotARelaxation) as caught:
        relaxation_of(Filter(a, b), 1.0)
    assert words in caught.value.reason
    assert not is_relaxation(Filter(a, b))


def test_every_reason_is_given() -> None:
    with pytest.raises(NotARelaxation) as caught:
        relaxation_of(Filter([1, 1.7249, 0.6706, -0.0526], [1, 2.3938, -0.2924, -1.7025]), 1.0)
    assert len(caught.value.reasons) == 2
    assert all(reason in str(caught.value) for reason in caught.value.reasons)


def test_zeros_at_the_end_of_the_coefficients_change_nothing() -> None:
    plain = zero_order_hold(SHARES, RATES, 0.1)
    padded = Filter((*plain.a, 0.0), (*plain.b, 0.0, 0.0))
    assert_allclose(relaxation_of(padded, 0.1), relaxation_of(plain, 0.1), rtol=1e-12)


def test_coefficients_of_few_digits_pass_with_a_tolerance() -> None:
    """All force relaxes away in the end; five digits leave c_0 a little below 0."""
    exact = zero_order_hold((0.6, 0.4), (1.0, 0.2), 0.5)
    rounded = Filter([round(v, 5) for v in exact.a], [round(v - 2e-5, 5) if v != 1 else v for v in exact.b])
    assert rounded.static_gain < 0
    assert not is_relaxation(rounded, 0.5)
    shares, rates = relaxation_of(rounded, 0.5, tolerance=1e-2)
    assert_allclose(rates, [1.0, 0.2], rtol=0.01)
    assert_allclose(shares, [0.6, 0.4], rtol=0.01)


def test_filter_properties() -> None:
    filter = Filter([2.0, 1.0, -0.24], [2.0, -1.0])
    assert filter.a == (1.0, 0.5, -0.12)
    assert filter.b == (1.0, -0.5)
    assert_allclose(filter.poles, [-0.67720019, 0.17720019])  # z = −1/4 ± √(1/16 + 0.12)
    assert_allclose(filter.zeros, [0.5])
    assert filter.stable
    assert not Filter([1, 1.007], [1]).stable
    assert_allclose(filter.static_gain, 0.5 / 1.38)
    assert Filter([1, -1], [1]).static_gain == math.inf
    assert math.isnan(Filter([1, -1], [1, -1]).static_gain)
    assert_allclose(filter.response([1.0, 0.0, 0.0]), [1.0, -1.0, 0.62])
    assert_allclose(filter.frequency_response(math.pi / 0.1, 0.1), 1.5 / (1 - 0.5 - 0.12))


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: Filter([0.0, 1.0], [1.0]), "a_0"),
        (lambda: Filter([], [1.0]), "at least"),
        (lambda: Filter([1.0, math.nan], [1.0]), "finite"),
        (lambda: zero_order_hold((0.1,), (1.0,), 0.0), "sample time"),
        (lambda: zero_order_hold((0.1,), (), 0.1), "1 shares but 0 rates"),
        (lambda: zero_order_hold((0.1,), (-1.0,), 0.1), "above 0"),
        (lambda: relaxation_of(Filter([1.0], [1.0]), math.inf), "sample time"),
        (lambda: relaxation_of(Filter([1.0], [1.0]), 1.0, "zoh"), "no hold 'zoh'"),
        (lambda: state_space((0.1,), (1.0,), 0.1, "foh"), "no hold 'foh'"),  # type: ignore[arg-type]
    ],
)
def test_what_makes_no_sense_is_refused(call, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        call()


def test_where_digits_do_not_tell_nothing_is_claimed() -> None:
    """Four modes at 1 kHz, the slowest pole 3e-5 from 1: what is found is near the truth, or said to be open."""
    rng = np.random.default_rng(5)
    t = np.geomspace(1e-3, 100, 40)
    refused = 0
    for _ in range(200):
        rates = np.sort(10 ** rng.uniform(-2, 2, 4))[::-1]
        shares = rng.dirichlet(np.ones(5))[1:]
        try:
            found = relaxation_of(ramp_invariant(shares, rates, 1e-3), 1e-3, "ramp")
        except NotARelaxation as error:
            refused += 1
            assert "digits" in error.reason or "too near to tell" in error.reason
            continue
        assert_allclose(Relaxation(*found).reduced(t), Relaxation(tuple(shares), tuple(rates)).reduced(t), atol=1e-2)
    assert 0 < refused < 200
