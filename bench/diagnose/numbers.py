"""The numbers of a pad and its effects as one vector for least squares, and back.

Coordinates are of order one and bounded: logarithms of what is above 0 by nature, shares as c_i = e_i/(1 + Σ e), so
that they never add up to more than 1.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from sim.effects import Active, Effect, Form
from sim.effects.base import Parameter
from sim.elastic import ElasticLaw, Exponential, NoPad, Polynomial, Power, Spline
from sim.pad import Cascade, Pad, Past
from sim.relaxation import Relaxation

Array = NDArray[np.float64]

STEEPEST = 25.0  # of an exponential law over the depth: beyond, a pad is none but at the very end


@dataclass(frozen=True)
class Coordinate:
    """One entry of the vector: value = exp(x) or x · unit, between bounds on x."""

    name: str
    lower: float
    upper: float
    logarithmic: bool = False
    unit: float = 1.0
    cost: float = 0.0
    """What its square costs, in χ²: of what is expected to be near 0 before any data."""

    def value(self, x: float) -> float:
        """The number itself."""
        return float(np.exp(x)) if self.logarithmic else x * self.unit

    def x(self, value: float) -> float:
        """The coordinate of a number, within the bounds."""
        x = np.log(max(value, 1e-300)) if self.logarithmic else value / self.unit
        return float(min(max(x, self.lower), self.upper))


def _positive(name: str, low: float = 1e-12, high: float = 1e12) -> Coordinate:
    return Coordinate(name, float(np.log(low)), float(np.log(high)), True)


def _spline(law: Spline) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Depths and forces of its points with (0, 0) before them."""
    if law.delta_mm[0] == 0.0:
        return law.delta_mm, law.force_N
    return (0.0, *law.delta_mm), (0.0, *law.force_N)


@dataclass(frozen=True)
class PadNumbers:
    """How one pad (law, order, contact) is laid out; `depth_mm` and `force_N` are the scales of the data."""

    pad: Pad
    depth_mm: float
    force_N: float

    @cached_property
    def coordinates(self) -> list[Coordinate]:
        """The law's numbers, then e_1 … e_r, then the rates."""
        r = self.pad.relaxation.order
        shares = [Coordinate(f"c_{i}", 0.0, 1e3) for i in range(1, r + 1)]
        return [*self._law(), *shares, *(_positive(f"nu_{i}", 1e-5, 1e5) for i in range(1, r + 1))]

    def _law(self) -> list[Coordinate]:
        law, D, F = self.pad.law, self.depth_mm, self.force_N
        if isinstance(law, Exponential):
            return [_positive("m"), Coordinate("b", -STEEPEST, STEEPEST, unit=1 / D)]
        if isinstance(law, Power):
            return [_positive("p"), Coordinate("q", -0.95, 30.0)]
        if isinstance(law, Polynomial):
            return [Coordinate(f"alpha_{i}", -1e4, 1e4, unit=F / D**i) for i in range(1, len(law.alpha))]
        if isinstance(law, Spline):
            return [Coordinate(f"rise_{i}", 0.0, 1e4, unit=F) for i in range(1, len(_spline(law)[0]))]
        return []

    def x(self) -> Array:
        """The vector of the pad itself."""
        law, relaxation = self.pad.law, self.pad.relaxation
        if isinstance(law, Spline):
            numbers = list(np.diff(_spline(law)[1]))
        elif isinstance(law, Polynomial):
            numbers = list(law.alpha[1:])
        else:
            numbers = list(law.parameters.values())
        c_0 = max(relaxation.c_0, 1e-3)
        numbers += [c / c_0 for c in relaxation.shares] + list(relaxation.rates)
        return np.array([c.x(v) for c, v in zip(self.coordinates, numbers, strict=True)])

    def at(self, x: Array) -> Pad:
        """The pad at a vector."""
        values = [c.value(v) for c, v in zip(self.coordinates, x.tolist(), strict=True)]
        r = self.pad.relaxation.order
        k = len(values) - 2 * r
        law = self.pad.law
        new: ElasticLaw = law
        if isinstance(law, Exponential):
            new = Exponential(values[0], values[1])
        elif isinstance(law, Power):
            new = Power(values[0], values[1])
        elif isinstance(law, Polynomial):
            new = Polynomial((law.alpha[0], *values[:k]))
        elif isinstance(law, Spline):
            new = Spline(_spline(law)[0], tuple(np.cumsum([0.0, *values[:k]]).tolist()))
        if r == 0:
            return replace(self.pad, law=new)
        e = values[k : k + r]
        whole = 1.0 + sum(e)
        return replace(self.pad, law=new, relaxation=Relaxation(tuple(v / whole for v in e), tuple(values[k + r :])))


@dataclass(frozen=True)
class Cause:
    """One form of one effect, as a candidate or as part of a model; `start`: values of all its parameters."""

    effect: Effect
    form: Form
    start: Mapping[str, float]

    @property
    def id(self) -> str:
        """The effect's id."""
        return self.effect.id

    @property
    def fitted(self) -> list[Parameter]:
        """Parameters that least squares moves."""
        return [p for p in self.form.parameters if not p.fixed]

    @property
    def amplitude(self) -> Parameter | None:
        """The number that switches the effect off."""
        return next((p for p in self.form.parameters if p.amplitude), None)

    @property
    def of_the_law(self) -> bool:
        """Whether it is another pad, as another law is: no number switches it off, it is one at any of them."""
        return self.form.amend is not None and self.amplitude is None

    def with_start(self, **values: float) -> Cause:
        """Other values to start from."""
        return replace(self, start={**self.start, **values})


def cause_of(effect: Effect, form: Form, given: Mapping[str, float] | None = None) -> Cause:
    """With every parameter at its default, but for those given."""
    start = {p.name: p.if_left_out for p in form.parameters}
    return Cause(effect, form, start | dict(given or {}))


def shapes_of(structure: Structure) -> list[tuple[str, str]]:
    """Of each cause, its id and the name of its form."""
    return [(cause.id, cause.form.name) for cause in structure.causes]


def _coordinate(p: Parameter) -> Coordinate:
    if p.logarithmic:
        return Coordinate(p.name, float(np.log(p.lower)), float(np.log(p.upper)), True)
    unit = abs(p.typical) or (p.upper - p.lower) / 10 or 1.0
    cost = 0.0 if p.spread is None else (unit / p.spread) ** 2
    return Coordinate(p.name, p.lower / unit, p.upper / unit, unit=unit, cost=cost)


@dataclass(frozen=True)
class Structure:
    """A pad with effects, to be fitted: x = [pad, effects in order, past, surface, stamps, zero].

    `doubt_mm`, `zero_N`: standard deviations of the surface and of the force's zero, as touch-off and tare found them;
    0: certain, and no entry of x. `past_N`: that of what each of the pad's modes begins with, where the run of `run_s`
    begins in contact (`sim.pad.Past`); 0: it begins at rest. `stamp_s`: that of when positions were measured, all
    together, where a motor is polled; 0: as their stamps say.
    """

    pad: PadNumbers
    causes: tuple[Cause, ...] = ()
    doubt_mm: float = 0.0
    zero_N: float = 0.0
    past_N: float = 0.0
    run_s: float = math.inf
    stamp_s: float = 0.0
    coordinates: tuple[Coordinate, ...] = field(init=False)

    def __post_init__(self) -> None:
        found = [*self.pad.coordinates, *(_coordinate(p) for c in self.causes for p in c.fitted)]
        found += [Coordinate("past", -6.0, 6.0, unit=self.past_N, cost=1.0)] * self.modes_begun
        if self.doubt_mm > 0:
            found.append(Coordinate("surface", -6.0, 6.0, unit=self.doubt_mm, cost=1.0))
        if self.stamp_s > 0:
            found.append(Coordinate("stamps", -6.0, 6.0, unit=self.stamp_s, cost=1.0))
        if self.zero_N > 0:
            found.append(Coordinate("zero", -4.0, 4.0, unit=self.zero_N, cost=1.0))
        object.__setattr__(self, "coordinates", tuple(found))

    @cached_property
    def lower(self) -> Array:
        """Lower bounds of x."""
        return np.array([c.lower for c in self.coordinates])

    @cached_property
    def upper(self) -> Array:
        """Upper bounds of x."""
        return np.array([c.upper for c in self.coordinates])

    @property
    def prior(self) -> Array:
        """What each coordinate squared costs, in χ²: the doubts about surface and zero, and what is expected."""
        return np.array([c.cost for c in self.coordinates])

    @property
    def tail(self) -> int:
        """How many entries at the end of x belong to the run, and not to pad or causes."""
        return self.modes_begun + (self.doubt_mm > 0) + (self.stamp_s > 0) + (self.zero_N > 0)

    @property
    def modes_begun(self) -> int:
        """How many modes begin with what their past has left."""
        return self.pad.pad.relaxation.order if self.past_N > 0 else 0

    def with_cause(self, cause: Cause) -> Structure:
        """One more cause."""
        return replace(self, causes=(*self.causes, cause))

    def with_cause_at(self, index: int, cause: Cause) -> Structure:
        """Another cause in a place."""
        return replace(self, causes=(*self.causes[:index], cause, *self.causes[index + 1 :]))

    def x(self, pad_x: Array, causes: Sequence[Mapping[str, float]] | None = None, tail: Array | None = None) -> Array:
        """The vector of a pad's own vector, the causes' values (their starts where not given) and the run's own end."""
        values = list(causes) if causes is not None else [c.start for c in self.causes]
        parts = [pad_x]
        for cause, v in zip(self.causes, values, strict=True):
            parts.append(np.array([_coordinate(p).x(v[p.name]) for p in cause.fitted]))
        parts.append(np.zeros(self.tail) if tail is None else tail)
        return np.concatenate(parts)

    def values(self, x: Array) -> list[dict[str, float]]:
        """Of each cause, all its numbers."""
        at = len(self.pad.coordinates)
        out = []
        for cause in self.causes:
            numbers = dict(cause.start)
            for p in cause.fitted:
                numbers[p.name] = min(max(self.coordinates[at].value(float(x[at])), p.lower), p.upper)
                at += 1
            out.append(numbers)
        return out

    def of_cause(self, index: int) -> slice:
        """Where the numbers of a cause stand in x."""
        start = len(self.pad.coordinates) + sum(len(c.fitted) for c in self.causes[:index])
        return slice(start, start + len(self.causes[index].fitted))

    def surface_mm(self, x: Array) -> float:
        """Depth added to all positions."""
        return float(x[len(x) - self.tail + self.modes_begun]) * self.doubt_mm if self.doubt_mm > 0 else 0.0

    def late_s(self, x: Array) -> float:
        """By how much positions were measured later than their stamps say."""
        at = len(x) - 1 - (self.zero_N > 0)
        return float(x[at]) * self.stamp_s if self.stamp_s > 0 else 0.0

    def offset_N(self, x: Array) -> float:
        """What the force reads without load."""
        return float(x[-1]) * self.zero_N if self.zero_N > 0 else 0.0

    def cascade(self, x: Array) -> Cascade:
        """The plant at x."""
        pad = self.pad.at(x[: len(self.pad.coordinates)])
        active = [Active(c.effect, c.form, v) for c, v in zip(self.causes, self.values(x), strict=True)]
        begun = x[len(x) - self.tail :][: self.modes_begun] * self.past_N
        past = Past(pad.relaxation.rates, tuple(begun.tolist()), self.run_s) if len(begun) else None
        return Cascade(pad, active, past)

    @property
    def in_air(self) -> bool:
        """Whether there is no pad."""
        return isinstance(self.pad.pad.law, NoPad)
