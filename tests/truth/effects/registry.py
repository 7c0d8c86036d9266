"""The registry of effects, and what an effect is told when it is drawn.

An effect outside the catalogue is a new module in this folder, with for instance

    @effect("warming", "exponential")
    def warming(build: Build, shape: str, size: float) -> dict[str, float]:
        build.plant.gain.append(lambda t, x: 1 - 0.05 * size * -np.expm1(-t / 20))
        return {"softer": 0.05 * size}

and is asked for by `draw_case(seed, ("warming",))`. The hooks are the lists of `Plant` and of `Build`.

A further shape of an effect that is there is `@more_shapes("warming", "stepped")` in a module of its own. It is asked
for by name: what a seed draws by itself stays among the first shapes, so that its cases do not change.

Shapes come in two halves. The first may be looked at while a diagnosis is being written; the `judge` half is written
by somebody who has not seen that diagnosis, and is there to judge it alone: `@judge_shapes("warming", "sudden")`, and
`@judge_effect("cooling", "slow")` for an effect that is of that half as a whole.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..draw import DrawnPad
from ..pad import Pad
from .plant import Plant


@dataclass
class Samples:
    """The force channel at its samples: true times, values, the same without noise, and flags of faults."""

    time_s: np.ndarray
    force_N: np.ndarray
    clean_N: np.ndarray
    noise_std_N: float
    flags: dict[str, np.ndarray] = field(default_factory=dict)


#: Orders of the stages after the sensor; noise and rounding are added by the recording between them.
DISTURBANCE, NOISE, SATURATION, ROUNDING, OUTLIERS, STUCK = range(10, 70, 10)

SampleStage = Callable[[Samples, np.random.Generator], None]


@dataclass
class Build:
    """A case in the making; an effect changes it in place.

    plant: the truth. believed: what the lab believes (its numbers are jittered later). delays: (t, rng) → true time
    of what is reported as of t. samples: order and what is done to the samples. own_clock: write `force_time_s`.
    """

    drawn: DrawnPad
    plant: Plant
    believed: Pad
    noise_std_N: float
    rate_hz: float
    rng: np.random.Generator
    delays: list[Callable[[np.ndarray, np.random.Generator], np.ndarray]] = field(default_factory=list)
    samples: list[tuple[int, SampleStage]] = field(default_factory=list)
    own_clock: bool = False
    stamps: list[Callable[[np.ndarray], np.ndarray]] = field(default_factory=list)

    @property
    def depth_mm(self) -> float:
        """Deepest commanded position."""
        return self.drawn.depth_mm

    @property
    def force_N(self) -> float:
        """Elastic force there."""
        return self.drawn.force_N

    def sensor(self, order: int, stage: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> None:
        """Add a stage to the sensor."""
        self.plant.sensor.append((order, stage))


#: (build, shape, size) → the contract's parameters; a size of 1 is typical.
Hide = Callable[[Build, str, float], dict[str, Any]]


#: Of the shapes.
HALVES = ("first", "judge")


@dataclass(frozen=True)
class Effect:
    """An effect by its id: the shapes it takes, what it needs of pad and sampling, and how to hide it.

    shapes: those of the first half, none where the effect is the judge's. drawn: the ones among which a seed draws.
    judge: those of the judge half.
    """

    id: str
    shapes: tuple[str, ...]
    drawn: tuple[str, ...]
    hide: Hide
    contact: str | None = None
    laws: tuple[str, ...] | None = None
    least_rate_hz: float = 0.0
    judge: tuple[str, ...] = ()

    def of(self, half: str) -> tuple[str, ...]:
        """The shapes of one half; `both` for all."""
        return {"first": self.shapes, "judge": self.judge, "both": (*self.shapes, *self.judge)}[half]


EFFECTS: dict[str, Effect] = {}
_FIRST: dict[str, Effect] = {}
_MORE: dict[str, dict[str, Hide]] = {}
_JUDGE: dict[str, dict[str, Hide]] = {}


def _assemble(id: str, first: Effect) -> None:
    more, judge = _MORE.get(id, {}), _JUDGE.get(id, {})
    others = more | judge

    def hide(build: Build, shape: str, size: float) -> dict[str, Any]:
        return others.get(shape, first.hide)(build, shape, size)

    shapes = {"shapes": (*first.shapes, *more), "judge": (*first.judge, *judge)}
    EFFECTS[id] = replace(first, **shapes, hide=hide if others else first.hide)


def _further(known: dict[str, dict[str, Hide]], id: str, shapes: tuple[str, ...]) -> Callable[[Hide], Hide]:
    def register(hide: Hide) -> Hide:
        known.setdefault(id, {}).update(dict.fromkeys(shapes, hide))
        if id in _FIRST:
            _assemble(id, _FIRST[id])
        return hide

    return register


def effect(id: str, *shapes: str, **needs: Any) -> Callable[[Hide], Hide]:
    """Register `hide(build, shape, size)` under an id; `needs` are the fields of `Effect`."""

    def register(hide: Hide) -> Hide:
        _FIRST[id] = Effect(id, shapes, shapes, hide, **needs)
        _assemble(id, _FIRST[id])
        return hide

    return register


def more_shapes(id: str, *shapes: str) -> Callable[[Hide], Hide]:
    """Register shapes beyond the first of an effect that is registered before or after."""
    return _further(_MORE, id, shapes)


def judge_shapes(id: str, *shapes: str) -> Callable[[Hide], Hide]:
    """Register shapes of the judge half of an effect that is registered before or after."""
    return _further(_JUDGE, id, shapes)


def judge_effect(id: str, *shapes: str, **needs: Any) -> Callable[[Hide], Hide]:
    """Register an effect that is of the judge half as a whole."""

    def register(hide: Hide) -> Hide:
        _FIRST[id] = Effect(id, (), shapes, hide, judge=shapes, **needs)
        _assemble(id, _FIRST[id])
        return hide

    return register


def spread(rng: np.random.Generator, low: float, high: float) -> float:
    """Log-uniform between two positive numbers."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))
