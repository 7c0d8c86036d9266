"""The pad as a Python object, for simulators and loops in Python: no compiler, no bench."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bench.export.realtime import real_time_pad
from sim.grid import checked, steps
from sim.kernel import ramp_gain
from sim.model import Model

Array = NDArray[np.float64]


class LivePad:
    """A pad that is pressed step by step, at any and varying steps of time; exact for F^e linear within each.

    It starts at rest, never touched. Effects of the model that have no form here are refused (`bench.errors.Refused`),
    or left out with `pad_only`.
    """

    def __init__(self, model: Model, *, pad_only: bool = False) -> None:
        pad = real_time_pad(model, pad_only=pad_only)
        self._law = pad.law.block.python
        self._parameters = list(pad.law.kernel_parameters)
        self._c_0 = pad.relaxation.c_0
        self._c = pad.relaxation.shares
        self._nu = pad.relaxation.rates
        self._unilateral = pad.unilateral
        self.reset()

    def reset(self) -> None:
        """Back to rest, never touched."""
        self._Fe = 0.0
        self._w = [0.0] * len(self._c)
        self._dt = -1.0
        self._force = 0.0
        self._started = False

    @property
    def force_N(self) -> float:
        """Force after the last step."""
        return self._force

    @property
    def elastic_force_N(self) -> float:
        """F^e after the last step; where the pad has let go, the one that gives no force."""
        return self._Fe

    def step(self, delta_mm: float, dt_s: float) -> float:
        """Move to a depth within dt_s seconds; the force there, N. The first step after a reset takes no time.

        Raises ValueError, before anything moves, for a depth or a time that is not finite, and a time below 0.
        """
        if not (math.isfinite(delta_mm) and 0.0 <= dt_s < math.inf):
            raise ValueError(f"no step to {delta_mm} mm within {dt_s} s: both must be finite, and time cannot fall")
        if not self._started:
            dt_s = 0.0
        self._started = True
        if dt_s != self._dt:
            self._dt = dt_s
            self._gain = [ramp_gain.python(nu * dt_s) for nu in self._nu]
            self._decay = [1.0 - nu * dt_s * gain for nu, gain in zip(self._nu, self._gain, strict=True)]
        Fe = self._law(0.0, delta_mm, [], self._parameters)
        relaxed, stiffness = 0.0, self._c_0
        for c, decay, gain, w in zip(self._c, self._decay, self._gain, self._w, strict=True):
            relaxed += c * (decay * w - gain * self._Fe)
            stiffness += c * gain
        force = relaxed + stiffness * Fe
        if self._unilateral and force < 0.0:  # the pad lets go: its surface is where it carries no force
            Fe = -relaxed / stiffness if stiffness > 0.0 else 0.0
            force = 0.0
        change = Fe - self._Fe
        self._w = [d * w + g * change for d, g, w in zip(self._decay, self._gain, self._w, strict=True)]
        self._Fe, self._force = Fe, force
        return force

    def simulate(self, time_s: ArrayLike, delta_mm: ArrayLike) -> Array:
        """Forces (n,) for depths (n,) at times (n,) that do not fall, from rest; the pad then stands at the last.

        Raises ValueError for arrays that do not match, are not finite, or times that fall.
        """
        time, delta = checked(time_s, delta_mm)
        self.reset()
        pairs = zip(delta.tolist(), steps(time).tolist(), strict=True)
        return np.array([self.step(position, dt) for position, dt in pairs])
