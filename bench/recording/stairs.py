"""Fast moves of a motor that is told positions so rarely that it has reached each before it hears the next.

The pad then feels stairs. The samples show where each step ended, and nothing of how: between two of them the position
is known to half a step. Where that makes more force than the noise of the force, nothing is to be learnt from it.
"""

from __future__ import annotations

import numpy as np

from bench.recording.between import Spans, white
from bench.recording.types import Array
from drivers.motor import RAREST_Hz


def stairs(time_s: Array, command_mm: Array, force_time_s: Array, force_N: Array) -> Spans:
    """Spans of time (from, to; s) in which a streamed motion is known too little for what the force is known to; none
    where the motor was told often enough: a computer that is late makes one step of several.

    `time_s`, `command_mm` (n,): the motor's samples, and where it was told to go with each; NaN where nothing was told.
    `force_time_s`, `force_N` (m,).
    """
    rare = np.diff(time_s) * RAREST_Hz > 1.0
    if len(force_N) < 3 or not rare.any() or np.isfinite(command_mm).mean() < 0.5:
        return []
    steps_N = np.abs(np.diff(np.interp(time_s, force_time_s, force_N)))
    told = np.abs(np.diff(np.nan_to_num(command_mm, nan=0.0))) > 0.0
    unknown = np.flatnonzero(rare & told & (0.5 * steps_N > white(force_N)))
    spans: Spans = []
    for k in unknown.tolist():
        begin_s, end_s = float(time_s[max(k - 1, 0)]), float(time_s[min(k + 2, len(time_s) - 1)])
        if spans and begin_s <= spans[-1][1]:
            spans[-1] = (spans[-1][0], end_s)
        else:
            spans.append((begin_s, end_s))
    return spans
