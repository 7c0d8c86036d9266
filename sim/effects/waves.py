"""Parameters that whatever repeats with the position has. No effect itself."""

from __future__ import annotations

import math

from sim.effects.base import Parameter


def phase(name: str, what: str) -> Parameter:
    """An angle, begun at each quarter."""
    return Parameter(name, "rad", -10.0, 10.0, 0.0, what, starts=(0.0, 0.5 * math.pi, math.pi, 1.5 * math.pi))


PHASE = phase("phase", "phase at position 0")

SECOND_HARMONIC = (
    Parameter("ratio", "1", 0.0, 3.0, 0.5, "second harmonic over the first"),
    phase("second_phase", "phase of the second harmonic at position 0"),
)

SECOND_PERIOD = (
    Parameter("ratio", "1", 0.0, 3.0, 0.3, "second amplitude over the first"),
    Parameter("order", "1", 0.25, 4.0, 1.5, "waves of the second for each of the first", starts=(0.63, 1.3, 1.6)),
    phase("second_phase", "phase of the second at position 0"),
)

GROWTH = (
    Parameter("growth", "1/mm", -5.0, 5.0, 0.0, "relative growth per mm", starts=(-0.2, 0.2)),
    Parameter("at_depth", "mm", 1e-3, 100.0, 1.0, "depth at which the amplitude holds", fixed=True),
)
