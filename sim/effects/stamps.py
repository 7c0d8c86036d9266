"""What counts from the first sample on. No effect itself."""

from __future__ import annotations

from sim.effects.base import Array, Parameter

AT_TIME = Parameter("at_time", "s", 0.0, 1e6, 30.0, "time since the first sample when it holds", fixed=True)

HALF_TIME = Parameter("at_time", "s", 0.0, 1e6, 30.0, "half the length of the data", fixed=True)


WAVES = 12
"""Half waves over the data, of a course in time."""


def half_waves(spread: float, what: str) -> tuple[Parameter, ...]:
    """Of what is now more and now less over the data: how far by each of its half waves, of itself. By about
    `spread` as is expected: where few moves tell of it, it is not known in between."""
    most = 6.0 * spread
    return tuple(
        Parameter(f"wave_{k}", "1", -most, most, 0.0, f"{k} half waves {what}", spread=spread)
        for k in range(1, WAVES + 1)
    )


def origin(stamp_s: Array) -> float:
    """The first of the stamps; a single one without an array around it counts from time 0."""
    return float(stamp_s.flat[0]) if stamp_s.ndim and stamp_s.size else 0.0
