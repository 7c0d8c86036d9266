"""A channel without noise, as a simulation's: nothing moves its force in air, and what repeats there does not stick."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bench.readings import resolution, runs
from bench.recording.types import Measurement

from .channel import Faults, resting
from .noise import force_noise, least_N

CRESTS, AT_A_CREST = 12, 4  # runs, and samples in one, that may be equal as a force turns


def without_noise(m: Measurement, found: Faults) -> Faults:
    """Without the stuck samples at rest, in air, and with the values of the air, of a channel that has no noise; other
    channels' as they are."""
    if not found.stuck.any() or max(force_noise(m, ~found.saturated).force_N, resolution(m.force_N)) >= least_N(m):
        return found
    depth_mm = m.position_at_forces_mm()
    air = depth_mm < 0.0
    natural = resting(m) | air | (np.diff(depth_mm, prepend=np.nan) == 0.0)
    natural |= np.isin(m.force_N, np.unique(m.force_N[found.stuck & air]))
    first, length = runs(m.force_N)
    of_motion = (np.add.reduceat(natural.astype(int), first) == 0) & (length > 1)
    if of_motion.sum() < CRESTS:
        of_motion &= length > AT_A_CREST
    return replace(found, stuck=found.stuck & np.repeat(of_motion, length))
