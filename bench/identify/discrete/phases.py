"""Ramps of a motion: from a recording's marks, or found in the data."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bench.recording.types import Measurement

from .._kernel import Array
from ..motion import holds, turns

MEMORY = 0.035
"""A pad counts as recovered where what is left of its earlier creep is no more than this share of the ramp's own force.

A mode of rate ν that crept for a time C, and then had R to come back, keeps (1 − e^−νC) e^−νR of the force that pressed
it: with k = R/C at the most (k/(k+1))^k/(k+1), whatever ν is. That is 3.5 % after a rest ten times as long as all the
contact before it, and at any time after a touch-off with a hundredth of the ramp's force.
"""
TOUCH = 0.005  # of the greatest depth: deeper is contact


@dataclass(frozen=True)
class Ramp:
    """A move one way, s and mm (pad frame). `recovered`: it begins out of contact, and the pad had rested."""

    begin_s: float
    end_s: float
    start_mm: float
    end_mm: float
    recovered: bool = False

    @property
    def rising(self) -> bool:
        """Whether it goes deeper, and ends in the pad."""
        return self.end_mm > max(self.start_mm, 0.0)


def ramps_of(m: Measurement) -> list[Ramp]:
    """All moves of a measurement, in order."""
    spans = _marked(m) or _found(m)
    t, x = m.position_time_s, m.position_mm
    depth = max(float(x.max()), 0.0)
    contact = np.concatenate([[0.0], np.cumsum(np.diff(t) * (x[1:] > TOUCH * depth))])
    pressed = np.abs(m.force_N) * (np.interp(m.force_time_s, t, x) > TOUCH * depth)
    out = []
    for begin, end in spans:
        start_mm, end_mm = np.interp([begin, end], t, x)
        if abs(end_mm - start_mm) < 0.01 * max(float(np.ptp(x)), 1e-12):
            continue
        i = int(np.searchsorted(t, begin, side="right")) - 1
        before, after = np.searchsorted(m.force_time_s, [begin, end])
        past, own = (
            float(part.max()) if len(part) else 0.0 for part in (pressed[:before], pressed[before : after + 1])
        )
        left = _left(t, x, max(i, 0), float(contact[max(i, 0)]), TOUCH * depth)
        out.append(Ramp(begin, end, float(start_mm), float(end_mm), left * past <= MEMORY * own))
    return out


def _left(t: Array, x: Array, i: int, loaded_s: float, touch_mm: float) -> float:
    """The most that can be left of earlier creep at sample i, as a share; infinite in contact."""
    if x[i] > touch_mm:
        return float("inf")
    if loaded_s == 0.0:
        return 0.0
    last = int(np.flatnonzero(x[: i + 1] > touch_mm)[-1])
    k = float(t[i] - t[last]) / loaded_s
    return float((k / (k + 1)) ** k / (k + 1))


def _marked(m: Measurement) -> list[tuple[float, float]]:
    """The stretches that the marks call ramps."""
    ends = [mark.time_s for mark in m.marks] + [float(m.position_time_s[-1])]
    return [(mark.time_s, end) for mark, end in zip(m.marks, ends[1:], strict=True)
            if mark.kind == "ramp" and mark.phase in ("precondition", "steps") and end > mark.time_s]  # fmt: skip


def _found(m: Measurement) -> list[tuple[float, float]]:
    """The stretches between holds, cut where the motion turns round."""
    t, x = m.position_time_s, m.position_mm
    still = holds(t, x)
    edges = [0, *(e for s in still for e in (s.start, s.stop - 1)), len(x) - 1]
    out = []
    for i, j in zip(edges[::2], edges[1::2], strict=True):
        if j > i:
            ends = turns(x[i : j + 1], 0.02 * float(np.ptp(x)))
            out += [(float(t[i + p]), float(t[i + q])) for p, q in zip(ends[:-1], ends[1:], strict=True)]
    return out
