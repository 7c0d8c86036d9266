"""Another elastic law than believed.

The believed law is replaced as a whole: the forms are those of sim/elastic with their numbers as parameters.

- `exponential`, `power`: equations (7) to (10) of the paper.
- `polynomial_2` … `polynomial_5`: equation (14); alpha_0, a jump at first touch, is 0 unless given.
- `spline`: a monotone cubic through (0, 0) and seven points evenly spaced up to `reach`, each `rise_i` above the last.
  `reach` is a choice and not fitted: the greatest depth of the data. `graded_spline` has nine points at depths that go
  with the square, closer near the surface: a pad that is touched at a point, as by a sphere, bends most there.
  `fine_spline` and `fine_graded_spline` have fifteen.
- `points`: the same curve through (0, 0) and up to twenty points where a file has them; for simulation.

Files may say `law:` for `form:`, for polynomials `law: polynomial, alpha: [α_0, α_1, …]`, and for points `law: spline,
delta_mm: […], force_N: […]`.

Reference: L. R. G. Treloar, The Physics of Rubber Elasticity, 3rd ed., Oxford, 1975; for the spline
F. N. Fritsch, J. Butland, SIAM J. Sci. Stat. Comput. 5, 1984, 300–304.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import accumulate, pairwise
from typing import TYPE_CHECKING

from sim.effects.base import Effect, Form, Parameter

if TYPE_CHECKING:
    from sim.pad import Pad

KNOTS = 7
GRADED_KNOTS = 9
FINE_KNOTS = 15
MOST_POINTS = 20


def _exponential(pad: Pad, values: Mapping[str, float]) -> Pad:
    from sim.elastic import Exponential

    return replace(pad, law=Exponential(values["m"], values["b"]))


def _power(pad: Pad, values: Mapping[str, float]) -> Pad:
    from sim.elastic import Power

    return replace(pad, law=Power(values["p"], values["q"]))


def _polynomial(degree: int) -> Callable[[Pad, Mapping[str, float]], Pad]:
    def amend(pad: Pad, values: Mapping[str, float]) -> Pad:
        from sim.elastic import Polynomial

        return replace(pad, law=Polynomial(tuple(values[f"alpha_{i}"] for i in range(degree + 1))))

    return amend


def _spline(parts: Sequence[float]) -> Callable[[Pad, Mapping[str, float]], Pad]:
    def amend(pad: Pad, values: Mapping[str, float]) -> Pad:
        from sim.elastic import Spline

        depths = tuple(values["reach"] * part for part in parts)
        forces = tuple(accumulate(values[f"rise_{i}"] for i in range(1, len(parts) + 1)))
        return replace(pad, law=Spline(depths, forces))

    return amend


def _spline_form(name: str, what: str, knots: int, sought: bool, grading: int = 1) -> Form:
    """A monotone curve through points at parts (i/knots)^grading of the reach; `sought`: also where nothing yet speaks
    for another law."""
    parts = [(i / knots) ** grading for i in range(1, knots + 1)]
    reach = Parameter("reach", "mm", 1e-3, 100.0, 3.0, "depth of the last point", required=True, fixed=True)
    rises = [
        Parameter(
            f"rise_{i}",
            "N",
            0.0,
            1e5,
            0.8 * 1.3 ** (KNOTS * part) * KNOTS * (part - before),
            f"force at {i} of {knots} points down to the reach less that at {i - 1}",
            required=True,
        )
        for i, (before, part) in enumerate(pairwise([0.0, *parts]), start=1)
    ]
    return Form(name, what, (reach, *rises), amend=_spline(parts), sought=sought)


def _points(pad: Pad, values: Mapping[str, float]) -> Pad:
    from sim.elastic import Spline

    there = [i for i in range(1, MOST_POINTS + 1) if values[f"step_{i}"] > 0.0]
    depths, forces = (tuple(accumulate(values[f"{name}_{i}"] for i in there)) for name in ("step", "rise"))
    return replace(pad, law=Spline(depths, forces))


def _points_form() -> Form:
    each = range(1, MOST_POINTS + 1)
    steps = [
        Parameter(f"step_{i}", "mm", 0.0, 1e3, 0.2, f"depth of point {i} less that of the one before; 0: there is none",
                  default=0.0, fixed=True)
        for i in each[1:]
    ]  # fmt: skip
    rises = [
        Parameter(f"rise_{i}", "N", 0.0, 1e5, 0.5, f"force at point {i} less that at the one before", default=0.0,
                  fixed=True)
        for i in each
    ]  # fmt: skip
    first = Parameter("step_1", "mm", 1e-6, 1e3, 0.2, "depth of point 1", required=True, fixed=True)
    what = f"monotone curve through up to {MOST_POINTS} points given"
    return Form("points", what, (first, *steps, *rises), amend=_points, sought=False)


def _polynomial_form(degree: int) -> Form:
    units = ("N", "N/mm", "N/mm^2", "N/mm^3", "N/mm^4", "N/mm^5")
    typical = (0.0, 2.0, 0.5, 0.2, 0.05, 0.01)
    alpha = [
        Parameter(
            f"alpha_{i}", units[i], -1e6, 1e6, typical[i], f"coefficient of depth to the power {i}", required=True
        )
        for i in range(1, degree + 1)
    ]
    jump = Parameter("alpha_0", "N", -1e6, 1e6, 0.0, "jump at first touch", fixed=True)
    return Form(
        f"polynomial_{degree}",
        f"polynomial of degree {degree} in depth",
        (*alpha, jump),
        amend=_polynomial(degree),
    )


EFFECT = Effect(
    id="elastic_law",
    what="The elastic response follows another law than believed.",
    says="the elastic force follows another law than the model's",
    check="press slowly to many depths, shallow ones too, and fit with `--law auto`",
    reference="Treloar, The Physics of Rubber Elasticity, 3rd ed., 1975",
    forms=(
        Form(
            name="exponential",
            what="stiffness grows exponentially with depth",
            parameters=(
                Parameter("m", "N/mm", 1e-6, 1e6, 2.0, "stiffness at the surface", required=True, starts=(0.5, 5.0)),
                Parameter("b", "1/mm", -10.0, 10.0, 0.5, "growth of the stiffness", required=True, starts=(0.1, 0.7)),
            ),
            amend=_exponential,
        ),
        Form(
            name="power",
            what="stiffness goes with a power of depth",
            parameters=(
                Parameter(
                    "p", "N/mm^(q+1)", 1e-6, 1e6, 3.0, "stiffness at 1 mm of depth", required=True, starts=(1.0, 10.0)
                ),
                Parameter("q", "1", -0.95, 8.0, 0.7, "exponent of the stiffness", required=True, starts=(0.3, 1.0)),
            ),
            amend=_power,
        ),
        *(_polynomial_form(degree) for degree in (2, 3, 4, 5)),
        _spline_form("spline", "monotone curve through seven points", KNOTS, True),
        _spline_form(
            "graded_spline", "monotone curve through nine points, closer near the surface", GRADED_KNOTS, True, 2
        ),
        _spline_form("fine_spline", "monotone curve through fifteen points", FINE_KNOTS, False),
        _spline_form(
            "fine_graded_spline", "monotone curve through fifteen points, closer near the surface", FINE_KNOTS, False, 2
        ),
        _points_form(),
    ),
)
