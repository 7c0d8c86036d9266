"""A relaxation mode that is fast beside the motion is a dashpot, and a refit makes one of a mode where damping lacks.

Mode i follows F = c_i w, w' = −ν_i w + dF^e/dt (sim.relaxation). Where ν_i is fast, w = (dF^e/dt)/ν_i: a force
c_i K^e(δ)/ν_i times the speed. Damping added to such a fit takes nothing, as it is there already, while the mode that
was given up for it is missed elsewhere.
"""

from __future__ import annotations

import numpy as np

from .numbers import Cause
from .refit import Fit

FASTER = 3.0  # than any mode that was believed
NAMED = "viscous_damping"


def instead_of_a_mode(fit: Fit, believed_rates: tuple[float, ...], cause: Cause) -> Cause | None:
    """The damping, to start from, that the modes of a fit make that are far faster than those believed; None where
    there are none."""
    if cause.id != NAMED or not believed_rates:
        return None
    structure, limit = fit.structure, FASTER * max(believed_rates)
    pad = fit.pad
    modes = [mode for mode in zip(pad.relaxation.shares, pad.relaxation.rates, strict=True) if mode[1] > limit]
    if not modes:
        return None
    depth_mm = cause.start.get("at_depth", 0.5 * structure.pad.depth_mm)
    stiffness = float(pad.law.stiffness(np.array([depth_mm]))[0])
    return cause.with_start(coefficient=stiffness * sum(share / rate for share, rate in modes))
