"""Whether a measurement is in the units and has the sign that its model counts in: the refit takes any factor up."""

from __future__ import annotations

import numpy as np

from bench.recording.types import Measurement
from sim.elastic import NoPad
from sim.pad import Pad

MANY_TIMES = 10.0  # as stiff as was believed: no lab is off by so much
ANOTHER_TIME = 30.0  # times as fast, each of the modes: one mode that the data hardly tell may go anywhere
DEEPEST = 0.9  # of the greatest depth
PUSHED_BACK = 0.5  # of the greatest force, that is negative where the pad is pressed the most


def doubts(m: Measurement, believed: Pad, refitted: Pad) -> list[str]:
    """Sentences on what makes units or sign doubtful; most often none."""
    if isinstance(believed.law, NoPad):
        return []
    counted = m.counted()
    depth_mm = m.position_at_forces_mm()
    deepest_mm = float(depth_mm[counted].max(initial=0.0))
    deep = counted & (depth_mm > DEEPEST * deepest_mm)
    if deep.any() and float(np.median(m.force_N[deep])) < -PUSHED_BACK * float(np.abs(m.force_N[counted]).max()):
        return [
            "the force is negative where the pad is pressed the most: is its sign turned? (A push counts as positive; "
            "`--units force=-N` turns that of a CSV, `sign: -1` of the load cell that of a bench.)"
        ]
    out = []
    stiffer = _stiffer(believed, refitted, deepest_mm)
    if max(stiffer, 1.0 / stiffer) > MANY_TIMES:
        out.append(
            f"to fit, the pad was made {_times(stiffer, 'stiff', 'soft')} as believed: are positions in mm and forces "
            "in N? (--units says what else they are in)"
        )
    faster = np.array(refitted.relaxation.rates) / np.array(believed.relaxation.rates)
    if len(faster) and (np.all(faster > ANOTHER_TIME) or np.all(faster < 1.0 / ANOTHER_TIME)):
        typical = float(np.exp(np.mean(np.log(faster))))
        out.append(
            f"to fit, the pad was made to relax {_times(typical, 'fast', 'slowly')} as believed: are the stamps in s? "
            "(--units says what else they are in)"
        )
    return out


def _stiffer(believed: Pad, refitted: Pad, depth_mm: float) -> float:
    """Times the force at a depth; 1 where it is not to be told."""
    with np.errstate(all="ignore"):
        before, after = (float(pad.law.force(np.array([depth_mm]))[0]) for pad in (believed, refitted))
    if not (np.isfinite(before) and np.isfinite(after) and before > 0.0 and after > 0.0):
        return 1.0
    return after / before


def _times(factor: float, more: str, less: str) -> str:
    """How many times as much, or as little, for reading."""
    size = float(f"{max(factor, 1.0 / factor):.2g}")
    return f"{size:,.0f} times as {more if factor > 1.0 else less}"
