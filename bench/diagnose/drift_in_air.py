"""What the zero does is seen in air, whatever has become of the pad: beside a drift that it does not know, a refit
makes one of the pad's modes slow and large, and from there no search finds back."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim.effects import Effect

from .numbers import cause_of
from .reach import Reach, narrowed
from .starts import Signatures, Start

Array = NDArray[np.float64]

NAMED = "force_drift"
ABOVE = 0.02  # of the depth, above the surface: surely in air
FEWEST = 40.0  # force samples there
MOVES = 4.0  # times the noise's square: so much a zero scatters there that is no constant
TAKES = 0.5  # of that: so much a shape must take
TIMES = np.geomspace(0.05, 3.0, 12)  # of the time from the first sample to the last


def told_in_air(at: Signatures, effect: Effect, believed: Array, reach: Reach) -> Start | None:
    """The drift that forces in air tell of, to start from with the pad as it was believed (P,); None where they tell of
    none, or the pad may pull there."""
    data, structure = at.data, at.fit.structure
    if effect.id != NAMED or structure.in_air or not structure.pad.pad.unilateral:
        return None
    air = data.position_mm < -ABOVE * structure.pad.depth_mm
    weight = np.where(air, data.weight, 0.0) / data.total_N**2
    if float(np.sum(data.weight[air])) < FEWEST:
        return None

    def clear(values: Array) -> Array:
        return values - float(np.sum(weight * values) / np.sum(weight))

    left = clear(data.force_N - at.force)
    moves = float(np.sum(weight * left**2))
    if moves < MOVES * float(np.sum(data.weight[air])):
        return None
    best, takes = None, TAKES * moves
    span_s = float(data.time_s[-1] - data.time_s[0])
    for form in effect.forms:
        plain = cause_of(effect, narrowed(form, reach))
        if plain.amplitude is None:
            continue
        timed = any(p.name == "time_constant" for p in plain.fitted)
        for time_s in TIMES * span_s if timed else (0.0,):
            cause = plain.with_start(**({"time_constant": float(time_s)} if timed else {}))
            unit = clear(at.change(cause)) / cause.start[plain.amplitude.name]
            square = float(np.sum(weight * unit**2))
            along = float(np.sum(weight * unit * left))
            if square > 0.0 and along**2 / square > takes:
                takes = along**2 / square
                best = cause.with_start(**{plain.amplitude.name: along / square})
    return None if best is None else Start(best, np.inf, believed)
