"""What counts from the first sample on. No effect itself."""

from __future__ import annotations

from sim.effects.base import Array, Parameter

AT_TIME = Parameter("at_time", "s", 0.0, 1e6, 30.0, "time since the first sample when it holds", fixed=True)


def origin(stamp_s: Array) -> float:
    """The first of the stamps; a single one without an array around it counts from time 0."""
    return float(stamp_s.flat[0]) if stamp_s.ndim and stamp_s.size else 0.0
