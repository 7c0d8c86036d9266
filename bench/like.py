"""A model held against a measurement: the measured motion, the surface where it serves the model best.

Touch-off finds the surface to some micrometres. A fit moves it within that doubt, and the number belongs to the run and
not to the model; so whoever compares a model with a run finds it again, for this model and this run.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from bench.recording.types import Measurement
from sim.model import Model

Array = NDArray[np.float64]

FARTHEST = 6.0
"""Standard deviations that a surface may be moved; as many as in a fit (`identify.surface`)."""

CLOSE = 1e-4
"""Standard deviations to which the best place is found."""


@dataclass(frozen=True)
class Likeness:
    """A model's force over a measurement's motion: `force_N` (m,) at its force stamps, all of them.

    `moved_mm`: depth added to the positions, 0 where the surface is certain; `rmse_N`: over the samples that count.
    """

    measurement: Measurement
    force_N: Array
    moved_mm: float
    rmse_N: float

    @property
    def sentence(self) -> str:
        """What was done to the surface, for people; empty where nothing was."""
        if self.measurement.surface_std_mm <= 0:
            return ""
        way = "lower" if self.moved_mm < 0 else "higher"
        return (
            f"surface taken {1e3 * abs(self.moved_mm):.2g} µm {way} than touch-off said "
            f"(its own doubt: {1e3 * self.measurement.surface_std_mm:.2g} µm)"
        )


def likeness(model: Model, measurement: Measurement) -> Likeness:
    """The model's force over the measured motion, from rest.

    Where touch-off stated a doubt, the surface is moved: the shift s with the least Σ e² + V (s/std)², V being the mean
    square error at the best s without that prior. Positions whose surface is certain (CSV) are taken as they are.
    """
    counted = measurement.counted()
    measured = measurement.force_N[counted]

    def force(moved_mm: float) -> Array:
        moved = measurement.position_mm + moved_mm
        return model.simulate_at(measurement.position_time_s, moved, measurement.force_time_s)

    def square(moved_mm: float) -> float:
        return float(np.sum((measured - force(moved_mm)[counted]) ** 2))

    moved_mm = 0.0
    std = measurement.surface_std_mm
    if std > 0 and measured.size:
        moved_mm = _least(square, std)
        V = square(moved_mm) / measured.size
        moved_mm = _least(lambda s: square(s) + V * (s / std) ** 2, std)
    simulated = force(moved_mm)
    error = measured - simulated[counted]
    rmse = math.sqrt(float(np.mean(error**2))) if error.size else math.nan
    return Likeness(measurement, simulated, moved_mm, rmse)


def _least(cost: Callable[[float], float], std_mm: float) -> float:
    found = minimize_scalar(
        cost, bounds=(-FARTHEST * std_mm, FARTHEST * std_mm), method="bounded", options={"xatol": CLOSE * std_mm}
    )
    return float(found.x)
