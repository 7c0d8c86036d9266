"""Reading steps for data that were not taken by padbench: explicit, and each leaves a note in the measurement.

A fit takes position 0 for the surface and force 0 for no load. Data whose zeroes are elsewhere are brought there
here, never in the fit.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bench.errors import InputError
from bench.recording.types import Measurement


def force_zeroed(m: Measurement, first_samples: int) -> Measurement:
    """Subtract the mean force of the first samples, out of contact. Raises InputError for fewer than 3."""
    if not 3 <= first_samples <= len(m.force_N):
        raise InputError(m.name, f"{first_samples} samples cannot give the zero of the force")
    level = float(np.mean(m.force_N[:first_samples]))
    note = f"The force's zero was taken from its first {first_samples} samples: {level:.4g} N subtracted."
    return replace(m, force_N=m.force_N - level, notes=[*m.notes, note])


def baseline_removed(m: Measurement, contact_mm: float) -> Measurement:
    """Subtract a straight line over position, fitted where the position is above `contact_mm` on the way in."""
    depth = m.position_at_forces_mm()
    until = int(np.argmax(depth >= contact_mm)) if np.any(depth >= contact_mm) else len(depth)
    if until < 10:
        raise InputError(m.name, f"the data do not start out of contact (above {contact_mm:.4g} mm)")
    slope, level = np.polyfit(depth[:until], m.force_N[:until], 1)
    note = f"A baseline of {level:.3g} N {slope:+.3g} N/mm, seen before contact, was subtracted from the force."
    return replace(m, force_N=m.force_N - (level + slope * depth), notes=[*m.notes, note])


def surface_at(m: Measurement, contact_mm: float) -> Measurement:
    """Move the position's zero to the surface."""
    note = f"The surface was put at {contact_mm:.5g} mm of the data's position, where the force starts to rise."
    return replace(m, position_mm=m.position_mm - contact_mm, notes=[*m.notes, note])


def indentation(m: Measurement, stiffness_N_mm: float) -> Measurement:
    """Take the bending of a series spring of known stiffness (a cantilever, a frame) off the position."""
    depth = m.position_at_forces_mm() - m.force_N / stiffness_N_mm
    note = f"The bending of a series spring of {stiffness_N_mm:.4g} N/mm was taken off the position."
    return replace(m, position_time_s=m.force_time_s, position_mm=depth, notes=[*m.notes, note])


def contact_of(m: Measurement) -> float:
    """Position at which the force first leaves its early level for good on the way in, mm.

    The level and its scatter are those of the first sixth of the way in; contact is where the force last crosses five
    scatters above it before it reaches a tenth of its greatest rise. Raises InputError where it never rises.
    """
    depth = m.position_at_forces_mm()
    deepest = int(np.argmax(depth >= depth[0] + 0.98 * (depth.max() - depth[0])))
    if deepest < 60:
        raise InputError(m.name, "there is no way in to find a surface on")
    force = m.force_N[: deepest + 1]
    early = max(int(np.argmax(depth >= depth[0] + (depth.max() - depth[0]) / 6)), 10)
    line = np.polyfit(depth[:early], force[:early], 1)
    rise = force - np.polyval(line, depth[: deepest + 1])
    scatter = float(np.std(rise[:early]))
    if float(rise.max()) < 8 * scatter:
        raise InputError(m.name, "the force never rises above its early scatter: there is no contact in these data")
    up = int(np.argmax(rise > max(0.1 * rise.max(), 5 * scatter)))
    below = np.flatnonzero(rise[:up] <= 5 * scatter)
    return float(depth[below[-1] if len(below) else 0])
