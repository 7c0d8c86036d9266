import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.interpolate import PchipInterpolator

from sim.elastic import LAWS, ElasticLaw, Exponential, NoPad, Polynomial, Power, Spline, law

EXAMPLES: list[ElasticLaw] = [
    Exponential(2.24, 0.69),
    Exponential(2.24, 0.0),
    Exponential(2.24, 1e-12),
    Exponential(2.24, -0.3),
    Power(3.8, 0.77),
    Power(3.8, 0.0),
    Power(3.8, -0.3),
    Polynomial((0.0, 1.5, 0.4, 0.2)),
    Polynomial((0.3, 1.5)),
    Spline((0.0, 0.5, 1.0, 2.0, 3.0), (0.0, 0.4, 1.2, 5.0, 14.0)),
    Spline((0.7, 1.0), (0.4, 1.2)),
    Spline((2.0,), (3.0,)),
    NoPad(),
]
DEPTHS = np.array([0.003, 0.2, 0.5, 0.77, 1.0, 1.9, 2.6, 3.4])


def test_every_law_has_an_example() -> None:
    assert {example.name for example in EXAMPLES} == set(LAWS)


@pytest.mark.parametrize("example", EXAMPLES, ids=str)
class TestEveryLaw:
    def test_no_force_out_of_contact(self, example: ElasticLaw) -> None:
        outside = np.array([-3.0, -1e-9, 0.0])
        assert not example.force(outside).any()
        assert not example.stiffness(outside).any()
        assert not example.force_gradient(outside).any()

    def test_stiffness_is_the_slope_of_the_force(self, example: ElasticLaw) -> None:
        h = 1e-6
        slope = (example.force(DEPTHS + h) - example.force(DEPTHS - h)) / (2 * h)
        assert_allclose(example.stiffness(DEPTHS), slope, rtol=1e-6, atol=1e-8)

    def test_gradient_is_the_slope_in_each_parameter(self, example: ElasticLaw) -> None:
        gradient = example.force_gradient(DEPTHS)
        assert gradient.shape == (DEPTHS.size, len(example.parameters))
        for column, (name, value) in enumerate(example.parameters.items()):
            h = 1e-6 * max(1.0, abs(value))
            up = example.with_parameters({name: value + h}).force(DEPTHS)
            down = example.with_parameters({name: value - h}).force(DEPTHS)
            assert_allclose(gradient[:, column], (up - down) / (2 * h), rtol=2e-6, atol=2e-8, err_msg=name)

    def test_depth_at_is_the_inverse(self, example: ElasticLaw) -> None:
        force = example.force(DEPTHS)
        if isinstance(example, NoPad):
            assert np.isnan(example.depth_at([1.0])).all()
        else:
            assert_allclose(example.depth_at(force), DEPTHS, rtol=1e-9)
        assert not example.depth_at([-1.0, 0.0]).any()

    def test_block_in_python_and_compiled_agree(self, example: ElasticLaw) -> None:
        parameters = list(example.kernel_parameters)
        python = [example.block(0.0, float(d), [], parameters) for d in DEPTHS]
        assert_allclose(example.force(DEPTHS), python, rtol=1e-15)

    def test_shapes_units_and_dict(self, example: ElasticLaw) -> None:
        assert example.force(DEPTHS.reshape(2, 4)).shape == (2, 4)
        assert example.stiffness(0.5).shape == ()
        assert list(example.units) == list(example.parameters)
        written = example.to_dict()
        assert law(written.pop("law"), written) == example

    def test_unknown_parameter(self, example: ElasticLaw) -> None:
        with pytest.raises(KeyError, match="no parameter 'zeta'"):
            example.with_parameters({"zeta": 1.0})


def test_exponential_against_equation_9() -> None:
    assert_allclose(Exponential(2.2445, 0.6911).force(2.4), 2.2445 / 0.6911 * (math.exp(0.6911 * 2.4) - 1))
    assert_allclose(Exponential(2.0, 0.0).force([1.0, 2.5]), [2.0, 5.0])


def test_exponential_gradient_is_smooth_through_b_0() -> None:
    # ∂F/∂b at b → 0 is m δ²/2, by the series of (9)
    for b in (0.0, 1e-15, 1e-9, -1e-9):
        assert_allclose(Exponential(3.0, b).force_gradient([0.5, 2.0])[:, 1], [3 * 0.125, 3 * 2.0], rtol=1e-8)
    below, above = Exponential(3.0, 0.000999999), Exponential(3.0, 0.001000001)
    assert_allclose(below.force_gradient([1.0]), above.force_gradient([1.0]), rtol=1e-8)


def test_an_exponential_that_saturates_has_no_depth_beyond() -> None:
    saturating = Exponential(2.0, -1.0)  # never above 2 N
    assert np.isnan(saturating.depth_at([2.0, 3.0])).all()
    assert np.isfinite(saturating.depth_at([1.9])).all()


def test_power_against_equation_10() -> None:
    # Table I, r = 2: γ_1 = p/(q+1) = 1.4559, γ_2 = q+1 = 1.7708
    assert_allclose(Power(1.4559 * 1.7708, 0.7708).force(2.4), 1.4559 * 2.4**1.7708)


def test_polynomial_with_alpha_0_jumps_at_contact_and_says_so() -> None:
    jump = Polynomial((0.3, 1.5))
    assert_allclose(jump.force([0.0, 1e-12, 1.0]), [0.0, 0.3, 1.8])
    assert "0.3 N at first touch" in jump.notes[0]
    assert not Polynomial((0.0, 1.5)).notes


def test_a_polynomial_that_never_reaches_the_force() -> None:
    assert np.isnan(Polynomial((0.0, 1.0, -0.25)).depth_at([1.5])).all()  # its top is 1 N at 2 mm
    assert_allclose(Polynomial((0.0, 1.0, -0.25)).depth_at([0.75]), [1.0])


def test_spline_is_scipys_pchip_inside_and_a_line_beyond() -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
        knots = np.concatenate([[0.0], np.cumsum(rng.uniform(0.1, 1.0, 6))])
        forces = np.concatenate([[0.0], np.cumsum(rng.uniform(0.0, 2.0, 6) * (rng.random(6) > 0.3))])
        if forces[-1] == 0.0:
            continue
        ours = Spline(tuple(knots), tuple(forces))
        reference = PchipInterpolator(knots, forces)
        inside = np.linspace(1e-9, knots[-1], 200)
        assert_allclose(ours.force(inside), reference(inside), rtol=1e-12, atol=1e-12)
        end = float(reference.derivative()(knots[-1]))
        assert_allclose(ours.force(knots[-1] + 0.8), forces[-1] + 0.8 * end, rtol=1e-12)


def test_spline_starts_at_the_origin_whether_listed_or_not() -> None:
    listed, implied = Spline((0.0, 1.0, 2.0), (0.0, 1.0, 3.0)), Spline((1.0, 2.0), (1.0, 3.0))
    assert_allclose(listed.force(DEPTHS), implied.force(DEPTHS))
    assert listed.parameters == implied.parameters == {"force_1": 1.0, "force_2": 3.0}


@pytest.mark.parametrize(
    ("delta_mm", "force_N", "message"),
    [
        ((0.0, 1.0), (0.0,), "same number"),
        ((0.0,), (0.0,), "greater than 0"),
        ((-1.0, 1.0), (0.0, 1.0), "starts at depth 0"),
        ((0.0, 1.0), (0.1, 1.0), "starts at depth 0"),
        ((0.0, 1.0, 1.0), (0.0, 1.0, 2.0), "delta_mm must rise"),
        ((0.0, 1.0, 2.0), (0.0, 1.0, 0.5), "force_N must not fall"),
    ],
)
def test_splines_that_are_none(delta_mm: tuple[float, ...], force_N: tuple[float, ...], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Spline(delta_mm, force_N)


def test_unknown_law_and_wrong_parameters_are_named() -> None:
    with pytest.raises(ValueError, match="did you mean 'exponential'"):
        law("exponental", {"m": 1, "b": 1})
    with pytest.raises(ValueError, match="parameters of the law 'power' do not fit: p"):
        law("power", {"p": 1})
