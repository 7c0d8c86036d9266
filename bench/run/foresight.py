"""What the believed pad will answer to the next ramp, from what the axis has really done to it so far.

Preflight predicts the plan from rest. During the run the pad has a history of its own: forces reached earlier or later
than planned, waits, the surface as measured. The model follows the measured motion, and a copy of it runs ahead.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from bench.errors import Stopped
from bench.plan import PlanLimits
from bench.run.axis import Curve

if TYPE_CHECKING:
    from sim.model import Model

LONGEST_STEP_S, MOST_STEPS = 2e-3, 400


class Foresight:
    """A believed pad that follows the run; `start` gives it the surface, before which nothing is known of it."""

    def __init__(self, believed: Model, limits: PlanLimits) -> None:
        self.limits = limits
        self._plant = believed.plant()
        self._plant.copy().step(0.0, 0.0)  # what has to be compiled is compiled now
        self._surface_mm: float | None = None
        self._time_s = math.nan

    def start(self, surface_mm: float) -> None:
        """The surface is known (motor frame, mm)."""
        self._surface_mm = surface_mm

    def note(self, time_s: float, position_mm: float) -> None:
        """One measured position, motor frame."""
        if self._surface_mm is None or time_s <= self._time_s:
            return
        dt_s = 0.0 if math.isnan(self._time_s) else time_s - self._time_s
        self._plant.step(dt_s, position_mm - self._surface_mm)
        self._time_s = time_s

    def extremes(self, curve: Curve) -> tuple[float, float]:
        """Greatest and least force (N) expected on a ramp (pad frame) that begins now."""
        ahead = self._plant.copy()
        steps = min(max(8, math.ceil(curve.duration_s / LONGEST_STEP_S)), MOST_STEPS)
        dt_s = curve.duration_s / steps
        times = np.linspace(0.0, curve.duration_s, steps + 1)[1:].tolist()
        forces = [ahead.step(dt_s, curve.position(t)) for t in times]
        return max(forces), min(forces)

    def allow(self, name: str, curve: Curve) -> None:
        """Raises `Stopped` where the ramp (pad frame) is expected to cross a force limit that is not crossed yet."""
        if self._surface_mm is None or curve.duration_s <= 0.0:
            return
        now_N = self._plant.force_N
        most, least = self.extremes(curve)
        limits = self.limits
        if not most <= max(limits.force_N, now_N):  # nor where it is no number
            raise Stopped(
                f"{name}: not begun: the believed pad would answer with {most:.3g} N on the way to "
                f"{curve.end_mm:.3g} mm, {limits.force_N:g} N allowed"
            )
        if not least >= min(-limits.tension_N, now_N):
            raise Stopped(
                f"{name}: not begun: the believed pad would pull with {-least:.3g} N on the way to "
                f"{curve.end_mm:.3g} mm, {limits.tension_N:g} N allowed"
            )
