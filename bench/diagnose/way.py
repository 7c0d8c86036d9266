"""What the way of a motion can tell: depths that are met again, or once only."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bench.identify.motion import holds

if TYPE_CHECKING:
    from sim.effects.base import Effect

    from .data import Data
    from .numbers import Structure

LEVELS, PASSES = 4, 4  # depths held, or passes over the depth, that make data rich which come back
AGAIN = 2  # times that a depth is held again, after another one, which do as well
LEAST = 0.05  # of the greatest depth: less is no way, nor another level
MOVES = 0.2  # of the mean speed over all of the run
PARTS = 60  # of the travel: three and more for each wave of the shortest ripple that is sought where they are shown
TOLD_ONCE = 0.5  # how sure a name can be of what acts with the motion, where data are not rich


def is_rich(data: Data, bonded: bool = False) -> bool:
    """Whether a measurement comes back, and holds several depths, or some again, or passes over it several times. The
    way above the surface tells nothing of a pad, but of a `bonded` one."""
    counted = data.weight > 0
    x = data.position_mm if bonded else np.maximum(data.position_mm, 0.0)
    span = float(np.ptp(x[counted])) if counted.any() else 0.0
    if span <= 0.0 or _passes(x, LEAST * span) < 2:
        return False
    held = [float(np.mean(x[s])) for s in holds(data.time_s, x)]
    held = [level for level in held if abs(level) > LEAST * span]
    held = [level for before, level in pairwise([np.inf, *held]) if abs(level - before) > LEAST * span]
    first = [level for k, level in enumerate(held) if all(abs(level - other) > LEAST * span for other in held[:k])]
    again = len(held) - len(first)
    return len(first) >= LEVELS or again >= AGAIN or _passes(x, 0.5 * span) >= PASSES


def met_again(data: Data, structure: Structure) -> bool:
    """Whether a measurement comes back over the depths of a structure's pad, or there is none."""
    return structure.in_air or is_rich(data, not structure.pad.pad.unilateral)


def on_the_way(data: Data) -> float:
    """Share of the force samples that were taken while the position moved."""
    way_mm, apart_s = np.abs(np.diff(data.position_mm)), np.diff(data.time_s)
    mean_speed = float(way_mm.sum()) / max(float(data.time_s[-1] - data.time_s[0]), 1e-300)
    moves = way_mm > MOVES * mean_speed * apart_s
    return float(data.weight[1:][moves].sum() / max(data.weight.sum(), 1e-300))


def shown_on_the_way(data: Data) -> float:
    """Share of the travel that samples amid motion show as finely as its `PARTS`."""
    way_mm, part_mm = np.abs(np.diff(data.position_mm)), float(np.ptp(data.position_mm)) / PARTS
    fine = (way_mm > 0.0) & (way_mm <= part_mm) & (data.weight[1:] > 0)
    parts = np.minimum((data.position_mm[1:][fine] - data.position_mm.min()) // max(part_mm, 1e-300), PARTS - 1)
    return np.unique(parts).size / PARTS


def most_sure(effect: Effect, form: str, rich: bool) -> float:
    """How sure the name of an effect can be at the most, in a form. `rich`: whether the data are, or none is of a
    pad."""
    return 1.0 if rich or not effect.goes_with_motion(form) else TOLD_ONCE


def _passes(position_mm: NDArray[np.float64], least_mm: float) -> int:
    """How often the motion goes one way by more than `least_mm`, before it goes back by as much."""
    passes, way, end = 0, 0, float(position_mm[0])
    for value in position_mm[:: max(len(position_mm) // 5000, 1)].tolist():
        if way >= 0 and value > end or way <= 0 and value < end:
            if way == 0 and abs(value - end) > least_mm:
                way, passes = (1 if value > end else -1), passes + 1
            end = value if way else end
        elif abs(value - end) > least_mm:
            way, passes, end = -way, passes + 1, value
    return passes
