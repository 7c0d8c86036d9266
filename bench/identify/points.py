"""F^e through points: the law for a pad that no formula fits, with depths chosen from the data.

θ are the rises from point to point over the last of them, all positive, so the curve never falls; between points it
is the monotone cubic of sim.elastic. The force at the deepest point is the gain.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from sim.elastic import Spline

from ._kernel import Array
from .condense import condensed
from .estimate import search
from .laws import Family, Named, exponential, polynomial, power
from .objective import Structure
from .problem import Problem
from .starts import Starter, bounds_of

COUNTS = (6, 8, 10)  # points
FLATTEST, STEEPEST = 1e-6, 1e5  # rises, of the last one
EVEN = 0.5  # how much the depths would rather be even than where the force bends
TRIAL = 1500  # samples that the depths are chosen on
STARTS = (-4.0, -1.0, 0.5, 2.0, 4.5)


@dataclass(frozen=True)
class Points(Family):
    """A law through `depths_mm` (n,), the last of them the greatest depth of the data."""

    depths_mm: tuple[float, ...] = ()

    def entry(self, numbers: Named) -> dict[str, Any]:
        """`{law: spline, delta_mm: […], force_N: […]}`."""
        return {"law": self.name, "delta_mm": list(self.depths_mm), "force_N": [value for _, value, _ in numbers]}


def through(knots: Array, depth_mm: float) -> Points:
    """The family with these depths, (n,) in units of D, rising, the last of them 1."""
    n = len(knots)
    at = tuple(float(k) for k in knots)

    def values(theta: Array) -> tuple[Array, float]:
        rises = np.append(theta, 1.0)
        whole = float(rises.sum())
        v = np.cumsum(rises) / whole
        v[-1] = 1.0
        return v, whole

    def shape(u: Array, theta: Array) -> tuple[Array, Array]:
        v, whole = values(theta)
        law = Spline(at, tuple(v.tolist()))
        by_rise = (np.tril(np.ones((n, n)))[:, : n - 1] - v[:, None]) / whole
        return law.force(u), np.ascontiguousarray(law.force_gradient(u) @ by_rise)

    def numbers(theta: Array, gain_N: float, depth: float) -> Named:
        return [(f"force_{i}", float(gain_N * value), "N") for i, value in enumerate(values(theta)[0], 1)]

    starts = []
    for family, numbers_of in ((exponential(), STARTS), (power(), (0.5,))):
        for start in numbers_of:
            rises = np.diff(family.shape(knots, np.array([start]))[0], prepend=0.0)
            starts.append(np.clip(rises[:-1] / rises[-1], 10 * FLATTEST, 0.1 * STEEPEST))
    return Points(
        "spline", n - 1, np.full(n - 1, FLATTEST), np.full(n - 1, STEEPEST), np.array(starts), shape, numbers, n,
        tuple(float(k * depth_mm) for k in knots),
    )  # fmt: skip


def points(problem: Problem, unilateral: bool) -> list[Points]:
    """Families of 6, 8 and 10 points, closer where the force bends.

    Where it bends is told by a trial fit of a polynomial of degree 4 with two modes, on a shortened stand-in.
    """
    short, _ = condensed(problem, TRIAL)
    family, bounds = polynomial(4), bounds_of(problem)
    starts = Starter(short, family, unilateral, bounds).first(2)
    trial = search(short, Structure(family, 2, unilateral, problem.pasts), starts, bounds)
    theta, _, _ = trial.structure.split(trial.x)
    u = np.linspace(0.0, 1.0, 201)
    s = family.shape(u, theta)[0]
    bend = np.sqrt(np.abs(np.gradient(np.gradient(s, u), u)))
    density = bend / max(float(bend.mean()), 1e-12) + EVEN
    way = np.concatenate([[0.0], np.cumsum((density[1:] + density[:-1]) / 2)])
    return [through(_knots(way / way[-1], u, n), problem.depth_mm) for n in COUNTS]


def _knots(share: Array, u: Array, n: int) -> Array:
    knots = np.interp(np.arange(1, n + 1) / n, share, u)
    knots[-1] = 1.0
    return np.asarray(knots)
