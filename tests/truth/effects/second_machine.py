"""Further shapes of what lies between the motor and the pad.

Sources: joints that open beyond their preload (Bickford, bolted joints); play with a film of grease (Nordin and Gutman
2002); static friction that grows with the time at rest (Rabinowicz 1958, Dieterich 1979); rough surfaces as a spread
of heights (Greenwood and Williamson 1966); end effect of linear motors; the gap of a read head that is not parallel.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numba import njit

from ..laws import Law, _Tabulated
from .registry import Build, more_shapes, spread
from .sensor import second_order


@more_shapes("frame_compliance", "joint_opens")
def joint_opens(build: Build, shape: str, size: float) -> dict[str, float]:
    """Stiff up to the preload of a joint, softer beyond; the compliance stated is the secant at 0.6 of the greatest."""
    compliance = size * spread(build.rng, 0.005, 0.02)
    preload, stiff = float(build.rng.uniform(0.15, 0.35)) * build.force_N, float(build.rng.uniform(0.3, 0.6))
    at = 0.6 * build.force_N
    beyond = compliance * at / (at - (1 - stiff) * preload)
    told = {"frame_form": 3, "frame_mm_N": beyond, "frame_force_N": preload, "frame_stiff_share": stiff}
    build.plant.numbers.update(told)
    return {"compliance": compliance}


@njit(cache=True)
def _greased(x, gap, closes):
    """A play that closes by itself: each step the share `closes` of what is open."""
    y = x.copy()
    for k in range(1, x.shape[0]):
        y[k] = x[k] + min(max((y[k - 1] - x[k - 1]) * (1 - closes) + x[k - 1] - x[k], 0.0), gap)
    return y


@more_shapes("backlash", "greased")
def greased(build: Build, shape: str, size: float) -> dict[str, float]:
    """On the way back the play opens at once; then the pad presses the film of grease out, within 0.3 to 2 s."""
    gap, closing_s = 0.02 * size * spread(build.rng, 0.7, 1.4), spread(build.rng, 0.3, 2.0)
    build.plant.play.append(lambda t, x: _greased(x, gap, -np.expm1(-(t[1] - t[0]) / closing_s)))
    return {"gap": gap}


@dataclass(frozen=True)
class Rough(_Tabulated):
    """The mean of a law over surfaces whose heights are normal within ±2.5 deviations; the first is at depth 0."""

    name: ClassVar[str] = "rough"
    law: Law
    deviation: float

    def force(self, depth_mm: np.ndarray | float) -> np.ndarray:
        depth = np.asarray(depth_mm, dtype=float)
        nodes, weights = np.polynomial.legendre.leggauss(16)
        heights = 2.5 * nodes
        weights = weights * np.exp(-(heights**2) / 2)
        weights = weights / weights.sum()
        parts = [w * self.law.force(depth - self.deviation * (2.5 + h)) for h, w in zip(heights, weights, strict=True)]
        return np.sum(parts, axis=0)

    def parameters(self) -> dict[str, float]:
        return self.law.parameters() | {"deviation": self.deviation}

    def model(self, depth_mm: float) -> dict[str, Any]:
        return self.law.model(depth_mm)


@more_shapes("contact_offset", "rough")
def rough(build: Build, shape: str, size: float) -> dict[str, float]:
    """The surface lies elsewhere and its heights are spread by up to 20 µm; stated is that of the mean height."""
    offset = float(build.rng.choice([-1.0, 1.0])) * 0.05 * size * spread(build.rng, 0.7, 1.4)
    deviation = min(0.15 * abs(offset), 0.02)
    build.plant.pad = replace(build.plant.pad, law=Rough(build.plant.pad.law, deviation))
    build.plant.numbers["offset_mm"] = offset - 2.5 * deviation
    return {"offset": offset}


@njit(cache=True)
def _dwelling(x, h, coulomb, presliding, growth, forgets):
    """Coulomb friction whose level to break away grows by `growth` ln(1 + rest/0.1 s); slip of `forgets` mm ends it."""
    force, z, rest = np.zeros(x.shape[0]), 0.0, 0.0
    for k in range(1, x.shape[0]):
        dx = x[k] - x[k - 1]
        if abs(dx) < 1e-9:
            rest += h
        level = 1 + growth * np.log1p(rest / 0.1)
        end = level * presliding
        moved = z + dx
        if abs(moved) > end:
            rest *= np.exp(-(abs(moved) - end) / forgets)
            end = (1 + growth * np.log1p(rest / 0.1)) * presliding
        z = min(max(moved, -end), end)
        force[k] = coulomb * z / presliding
    return force


@more_shapes("friction", "dwell")
def dwell(build: Build, shape: str, size: float) -> dict[str, float]:
    """More force to break away the longer it rested: 3 to 8 % for each e-fold of time; `coulomb` while sliding."""
    rng, coulomb = build.rng, 0.05 * size * spread(build.rng, 0.7, 1.6)
    presliding, growth = 1e-3 * spread(rng, 0.6, 1.6), float(rng.uniform(0.03, 0.08))
    build.plant.felt.append(lambda t, x, v, a: _dwelling(x, t[1] - t[0], coulomb, presliding, growth, 0.005))
    return {"coulomb": coulomb}


@more_shapes("inertia", "hose")
def hose(build: Build, shape: str, size: float) -> dict[str, float]:
    """A quarter to a half of the mass is a cable or hose, hung on softly (15 to 40 Hz, damped by a third)."""
    mass = size * spread(build.rng, 0.05, 0.3)
    hung, hung_Hz = float(build.rng.uniform(0.25, 0.5)), float(build.rng.uniform(15, 40))

    def act(t, x, v, a):
        return 1e-3 * mass * ((1 - hung) * a + hung * second_order(t, a, hung_Hz, 0.35))

    build.plant.felt.append(act)
    return {"mass": mass}


@more_shapes("cogging", "end_effect")
def end_effect(build: Build, shape: str, size: float) -> dict[str, float]:
    """The ripple swells along the way, as the motor nears the end of its magnets; stated: its mean over the depths."""
    rng = build.rng
    amplitude, swells = 0.05 * size * spread(rng, 0.7, 1.6), float(rng.choice([-1.0, 1.0]) * rng.uniform(0.3, 0.8))
    period = min(float(rng.uniform(2.0, 5.0)), (build.depth_mm + 0.5) / 0.7)
    phase, depth = float(rng.uniform(0, 2 * np.pi)), build.depth_mm

    def act(t, x, v, a):
        return amplitude * (1 + swells * (x / depth - 0.5)) * np.sin(2 * np.pi * x / period + phase)

    build.plant.felt.append(act)
    return {"amplitude": amplitude, "period": period}


@more_shapes("encoder_error", "skewed_head")
def skewed_head(build: Build, shape: str, size: float) -> dict[str, float]:
    """The read head is not parallel to its scale: the error fades along the way; stated: its mean over the depths."""
    rng = build.rng
    amplitude, period = 0.01 * size * spread(rng, 0.7, 1.4), spread(rng, 0.7, 1.5)
    fades, phase, depth = float(rng.uniform(0.4, 1.0)), float(rng.uniform(0, 2 * np.pi)), build.depth_mm

    def error(x):
        return amplitude * (1 - fades * (x / depth - 0.5)) * np.sin(2 * np.pi * x / period + phase)

    build.plant.encoder.append(lambda t, x: x + error(x))
    return {"amplitude": amplitude, "period": period}
