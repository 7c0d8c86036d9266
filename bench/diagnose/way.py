"""What the way of a motion can tell: depths that are met again, or once only."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bench.identify.motion import holds

if TYPE_CHECKING:
    from .data import Data

LEVELS, PASSES = 4, 4  # depths held, or passes over the depth, that make data rich
TOLD_ONCE = 0.5  # how sure a name can be of what acts with the motion, where data are not rich


def is_rich(data: Data) -> bool:
    """Whether a measurement holds several depths, or passes over its depth several times."""
    counted = data.weight > 0
    x = data.position_mm
    span = float(np.ptp(x[counted])) if counted.any() else 0.0
    if span <= 0.0:
        return False
    levels: list[float] = []
    for s in holds(data.time_s, x):
        level = float(np.mean(x[s]))
        if level > 0.05 * span and all(abs(level - other) > 0.05 * span for other in levels):
            levels.append(level)
    if len(levels) >= LEVELS:
        return True
    passes, way, end = 0, 0, float(x[0])
    for value in x[:: max(len(x) // 5000, 1)].tolist():
        if way >= 0 and value > end or way <= 0 and value < end:
            if way == 0 and abs(value - end) > 0.5 * span:
                way, passes = (1 if value > end else -1), passes + 1
            end = value if way else end
        elif abs(value - end) > 0.5 * span:
            way, passes, end = -way, passes + 1, value
    return passes >= PASSES
