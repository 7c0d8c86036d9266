"""Whether the force moves when the position does: clocks that are apart, or that drift apart.

In every quick move the change of force is laid over the change of a power of the depth, at all shifts of time. A pad's
force rises and falls with its depth at once, so the best shift is nothing, but for what relaxes within the move: a
small part of its length. This is judged before any fit, as a shift of a few samples spoils one without a trace: the
quick modes, or the slow ones, take it up.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import correlate

from bench.recording.types import Measurement

from ._kernel import Array
from .motion import holds
from .noise import Noise

POWERS = (1.0, 1.5, 2.0, 3.0, 4.0)
LEAST_MOVE = 0.1  # of the greatest depth
QUICK = 20.0  # times the shortest move
FARTHEST_S = 1.0
SEEN = 20.0  # noise deviations by which the force must change
ALIKE = 0.75  # correlation from which a shift is believed
OF_MOVE, OF_SAMPLE = 0.15, 2.5  # a shift counts beyond so much of a move's length, and so many samples
MOST = 200  # moves looked at
SHARE = 0.75  # of the moves that must agree


@dataclass(frozen=True)
class Move:
    """When a move was, s; how late the force was in it, s; and how late it may seem without being so."""

    time_s: float
    late_s: float
    doubt_s: float


def clocks_note(m: Measurement, noise: Noise) -> str:
    """What there is to say of the clocks of force and position; empty where they agree, or where it cannot be told."""
    moves = moves_of(m, noise)
    if not moves:
        return ""
    t, late, doubt = (np.array(x) for x in zip(*((k.time_s, k.late_s, k.doubt_s) for k in moves), strict=True))
    middle, least = float(np.median(late)), float(doubt.min())
    cost = "This costs all rates, and the law with them."
    if len(moves) >= 3 and float(np.ptp(t)) > 0:
        slope, at_0 = np.polyfit(t, late, 1)
        drift, left = float(slope * np.ptp(t)), float(np.std(late - slope * t - at_0))
        if abs(drift) > max(2 * least, 6 * left):
            first, last = (1e3 * (at_0 + slope * when) for when in (t.min(), t.max()))
            return (
                f"The clocks of force and position drift apart: the force comes {first:.3g} ms after the motion at"
                f" {t.min():.3g} s, and {last:.3g} ms at {t.max():.3g} s. {cost}"
            )
    agreed = float(np.mean(np.abs(late - middle) < doubt))
    if abs(middle) > (least if len(moves) > 1 else 2 * least) and agreed >= SHARE:
        way = "later" if middle > 0 else "earlier"
        return (
            f"The force comes {1e3 * abs(middle):.3g} ms {way} than the motion: the clocks of the two are apart, or the"
            f" bench's `timing` is not measured. {cost}"
        )
    return ""


def moves_of(m: Measurement, noise: Noise) -> list[Move]:
    """The quickest moves of a measurement that show a shift at all."""
    t, x = m.position_time_s, m.position_mm
    depth = float(x.max())
    still = holds(t, x)
    spans = [
        (before, after)
        for before, after in zip(still[:-1], still[1:], strict=True)
        if abs(max(np.median(x[after]), 0.0) - max(np.median(x[before]), 0.0)) > LEAST_MOVE * depth
    ]
    if not spans or depth <= 0:
        return []
    step = max(float(np.median(np.diff(t))), float(np.median(np.diff(m.force_time_s))))
    lengths = np.array([t[after.start] - t[before.stop - 1] for before, after in spans])
    quick = np.flatnonzero(lengths <= max(QUICK * lengths.min(), 5 * step))[:MOST]
    out = []
    for k in quick:
        before, after = spans[k]
        room = min(FARTHEST_S, 0.9 * min(t[before.stop - 1] - t[before.start], t[after.stop - 1] - t[after.start]))
        begin, end = t[before.stop - 1], t[after.start]
        late = _shift(m, begin, end, room, step, noise)
        if late is not None:
            out.append(Move(float(begin), late, OF_MOVE * float(end - begin) + OF_SAMPLE * step))
    return out


def _shift(m: Measurement, begin_s: float, end_s: float, room_s: float, step_s: float, noise: Noise) -> float | None:
    """How late the force is in one move, s; None where no shift makes the two alike."""
    count = int((end_s - begin_s + 2 * room_s) / step_s)
    if count < 8:
        return None
    grid = begin_s - room_s + step_s * np.arange(count)
    measured = np.interp(grid, m.force_time_s, m.force_N)
    if float(np.ptp(measured)) < SEEN * noise.force_N:
        return None
    force = np.diff(measured)
    power = float(force @ force)
    u = np.maximum(np.interp(grid, m.position_time_s, m.position_mm), 0.0)
    best, late = ALIKE, None
    for q in POWERS:
        rise = np.diff(u**q)
        size = float(np.sqrt(power * (rise @ rise)))
        if size <= 0:
            continue
        alike: Array = correlate(force, rise) / size
        k = int(np.argmax(alike))
        if alike[k] > best:
            best, late = float(alike[k]), (k - (len(rise) - 1)) * step_s
    return late
