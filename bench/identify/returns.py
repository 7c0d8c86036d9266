"""Nodes where a pad may have let go: its surface comes back when it will, not at a sample.

The model judges let-go and return at its nodes. At 100 samples a second and a rate of 60 1/s a return that is taken at
the next sample is off by half a mode, and so is the force for some samples. While the probe is in the pad and shows no
force, the steps are therefore cut to some milliseconds. Positions between samples stay on the lines that they are on.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bench.recording.types import Measurement

from ._kernel import Array
from .motion import jitter

STEP_S = 0.0025  # that steps are cut to
PIECES = 4  # of a step at the most
QUIET = 4.0  # noise deviations of force, below which there may be none
LEAST = 0.005  # of the largest force: as well
MOST = 0.5  # of the samples in the pad: beyond it the force is lost in its noise, and tells no let-go


def with_returns(m: Measurement, time_s: Array, position_mm: Array) -> tuple[Array, Array]:
    """The motion (n,), (n,) with more nodes where the probe is in the pad and shows no force; itself where nowhere.

    Times in s, positions in mm; every node of the input is among those of the result.
    """
    silent = _silent(m, time_s, position_mm)
    steps = np.diff(time_s)
    pieces = np.where(silent, np.clip(np.ceil(steps / STEP_S - 1e-6), 1, PIECES), 1).astype(np.intp)
    extra = [time_s[:-1][pieces > k] + steps[pieces > k] * k / pieces[pieces > k] for k in range(1, PIECES)]
    fresh = np.sort(np.concatenate(extra))
    if not len(fresh):
        return time_s, position_mm
    place = np.searchsorted(time_s, fresh)
    return np.insert(time_s, place, fresh), np.insert(position_mm, place, np.interp(fresh, time_s, position_mm))


def _silent(m: Measurement, time_s: Array, position_mm: Array) -> NDArray[np.bool_]:
    """Of each step (n − 1,): whether the pad may be out of contact at one of its ends, though the probe is in it."""
    force = np.interp(time_s, m.force_time_s, m.force_N)
    quiet = np.abs(force) < max(QUIET * jitter(m.force_N), LEAST * float(np.max(np.abs(m.force_N))))
    inside = position_mm > 0
    pressed = np.maximum.accumulate(inside & ~quiet)  # a first touch is no return
    if np.count_nonzero(inside & quiet) > MOST * np.count_nonzero(inside):
        return np.zeros(len(time_s) - 1, dtype=bool)
    here = inside & quiet & pressed
    return np.asarray(here[:-1] | here[1:])
