"""Where to start what repeats with the position: every period, with the phases and harmonics that fit the residual.

For a given period a sine and its second harmonic are linear in four numbers, so that only the period is scanned.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from sim.effects.base import Form

from .numbers import Cause

Array = NDArray[np.float64]

PERIODS = 36
TURNS = 24  # parts of a period
RATIO = 2.5  # of the second harmonic to the first at the most, to start with


def ripples(form: Form) -> bool:
    """Whether a form repeats with the position."""
    return {"period", "phase"} <= {p.name for p in form.parameters}


def turned(cause: Cause) -> list[Cause]:
    """The same ripple, begun at every part of its period."""
    out = []
    for turn in np.linspace(0.0, 2.0 * np.pi, TURNS, endpoint=False):
        phases = {"phase": cause.start["phase"] + turn}
        if "second_phase" in cause.start:
            phases["second_phase"] = cause.start["second_phase"] + 2.0 * turn
        out.append(cause.with_start(**{name: float(np.mod(value, 2.0 * np.pi)) for name, value in phases.items()}))
    return out


def starts(
    form: Form, column: Callable[[float, float], Array], residual: Array, most: int
) -> Iterator[tuple[dict[str, float], float]]:
    """(values to start from, χ² that they promise to take), best first, at periods apart from each other.

    `column`: change of the force (n,), in units of the noise, by a sine of amplitude 1, of a period and a phase, beyond
    what the pad can imitate; `residual` (n,) likewise.
    """
    period = next(p for p in form.parameters if p.name == "period")
    second = any(p.name == "ratio" for p in form.parameters)
    lowest, highest = 1.0 / period.upper, 1.0 / period.lower
    step = lowest / math.ceil(lowest * PERIODS / max(highest - lowest, 1e-9 * highest))
    waves = range(round(lowest / step), int(highest / step) + 1)
    every = {*waves, *(2 * k for k in waves if second)}
    pairs = {k: [column(1.0 / (k * step), phase) for phase in (0.0, 0.5 * math.pi)] for k in every}
    found = []
    for k in waves:
        columns = np.stack([*pairs[k], *(pairs[2 * k] if second else ())], axis=1)
        norm = np.linalg.norm(columns, axis=0)
        if not np.isfinite(norm).all() or norm.min() <= 1e-9:
            continue
        along = np.sum(columns * residual[:, None], axis=0)
        sizes = np.linalg.lstsq(columns.T @ columns, along, rcond=1e-10)[0]
        found.append((float(sizes @ along), k, sizes))
    found.sort(key=lambda one: -one[0])
    taken: list[int] = []
    for promise, k, sizes in found:
        if len(taken) < most and all(abs(k - other) > 1 for other in taken):
            taken.append(k)
            # just inside the bounds, at which an extreme period would stay
            near = min(max(1.0 / (k * step), 1.02 * period.lower), 0.98 * period.upper)
            yield {"period": near, **_waves(sizes)}, promise


def _waves(sizes: Array) -> dict[str, float]:
    """Amplitude and phase of a sin θ + b cos θ, and ratio and phase of the second harmonic."""
    amplitude = float(np.hypot(sizes[0], sizes[1]))
    out = {"amplitude": amplitude, "phase": float(np.arctan2(sizes[1], sizes[0]))}
    if len(sizes) > 2:
        ratio = float(np.hypot(sizes[2], sizes[3])) / max(amplitude, 1e-300)
        out |= {"ratio": min(ratio, RATIO), "second_phase": float(np.arctan2(sizes[3], sizes[2]))}
    return out
