"""What a mm of loading travel took in the mean over the data, by damage that goes with something else than travel."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sim.effects import Active
from sim.elastic import Polynomial
from sim.pad import Cascade, Pad
from sim.relaxation import Relaxation

from .data import Data
from .numbers import Cause, Structure, cause_of
from .refit import Fit

Array = NDArray[np.float64]

GAUGE = "weighs"  # the parameter by which the mean is stated: its product with the rate stays
LITTLE = 1e-6  # 1/mm, of which what is left of the stiffness tells the travel that counts
STEP = 1e-3  # of a coordinate of order one, for derivatives
PRESSED = 0.3  # of the greatest depth: where that shows


def gauged(data: Data, fit: Fit) -> Fit:
    """The same fit, with the rates of such damage in the mean over the loading travel of the data."""
    structure, x = fit.structure, fit.x.copy()
    depth_mm = data.position_mm + structure.surface_mm(x)
    for index, values in enumerate(structure.values(x)):
        cause = structure.causes[index]
        if GAUGE not in values:
            continue
        counts = _counting_mm(data, depth_mm, cause.with_start(**values)) / values[GAUGE]
        travel = _counting_mm(data, depth_mm, cause_of(cause.effect, cause.effect.forms[0]))
        if not 0.0 < counts < np.inf or not travel > 0.0:
            continue
        x[_rate_at(structure, index)] *= values[GAUGE] * counts / travel
        structure = structure.with_cause_at(index, cause.with_start(**{GAUGE: travel / counts}))
    return replace(fit, structure=structure, x=x)


def in_the_mean(data: Data, fit: Fit, covariance: Array) -> Array:
    """Covariance (P, P) of x with such rates as they are stated: as the other numbers of the law vary, a mm of loading
    travel of the data takes another multiple of them."""
    structure, x = fit.structure, fit.x
    depth_mm = data.position_mm + structure.surface_mm(x)
    stated = np.eye(len(x))
    for index, values in enumerate(structure.values(x)):
        cause = structure.causes[index]
        if GAUGE not in values:
            continue
        at = structure.of_cause(index)
        rate = _rate_at(structure, index)
        for k in range(at.start, at.stop):
            if k == rate or not structure.lower[k] + STEP < x[k] < structure.upper[k] - STEP:
                continue
            counts = []
            for step in (-STEP, STEP):
                beside = x.copy()
                beside[k] += step
                moved = structure.values(beside)[index]
                counts.append(_counting_mm(data, depth_mm, cause.with_start(**moved)))
            stated[rate, k] = x[rate] * (counts[1] - counts[0]) / (2.0 * STEP * max(sum(counts) / 2.0, 1e-300))
    return np.asarray(stated @ covariance @ stated.T)


def _rate_at(structure: Structure, index: int) -> int:
    """Where in x the rate of a cause stands."""
    return int(structure.of_cause(index).start) + [p.name for p in structure.causes[index].fitted].index("rate")


def _counting_mm(data: Data, depth_mm: Array, cause: Cause) -> float:
    """Loading travel of the data, mm, as damage counts it."""
    pad = Pad(Polynomial((0.0, 1.0)), Relaxation(), True)
    values = {**cause.start, "rate": LITTLE}
    left = Cascade(pad, [Active(cause.effect, cause.form, values)]).simulate_on(data.grid, depth_mm)
    pressed = np.flatnonzero(depth_mm > PRESSED * float(depth_mm.max(initial=0.0)))
    last = pressed[-1] if len(pressed) else -1
    return float((1.0 - left[last] / depth_mm[last]) / LITTLE) if depth_mm[last] > 0.0 else 0.0
