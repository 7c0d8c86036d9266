"""Ramps of a motion: from a recording's marks, or found in the data."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bench.recording.types import Measurement

from .._kernel import Array
from ..motion import holds

REST = 10.0
"""A pad counts as recovered after a rest this many times as long as all the contact before it.

A mode of rate ν that crept for x/ν then keeps (1 − e^−x) e^−10x of its creep: 3.5 % at the most, whatever ν is.
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
    out = []
    for begin, end in spans:
        start_mm, end_mm = np.interp([begin, end], t, x)
        if abs(end_mm - start_mm) < 0.01 * max(float(np.ptp(x)), 1e-12):
            continue
        i = int(np.searchsorted(t, begin, side="right")) - 1
        loaded = float(contact[max(i, 0)])
        out.append(Ramp(begin, end, float(start_mm), float(end_mm), _rested(t, x, max(i, 0), loaded, TOUCH * depth)))
    return out


def _rested(t: Array, x: Array, i: int, loaded_s: float, touch_mm: float) -> bool:
    if x[i] > touch_mm:
        return False
    if loaded_s == 0.0:
        return True
    last = int(np.flatnonzero(x[: i + 1] > touch_mm)[-1])
    return bool(t[i] - t[last] >= REST * loaded_s)


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
            turns = _turns(x[i : j + 1], 0.02 * float(np.ptp(x)))
            out += [(float(t[i + p]), float(t[i + q])) for p, q in zip(turns[:-1], turns[1:], strict=True)]
    return out


def _turns(x: Array, least: float) -> list[int]:
    """First, last and turning samples; wiggles below `least` are none."""
    out, best, way = [0], 0, 0
    for k in range(1, len(x)):
        if way == 0:
            if abs(x[k] - x[0]) >= least:
                way, best = (1 if x[k] > x[0] else -1), k
        elif way * (x[k] - x[best]) > 0:
            best = k
        elif way * (x[best] - x[k]) >= least:
            out.append(best)
            way, best = -way, k
    return [*out, len(x) - 1]
