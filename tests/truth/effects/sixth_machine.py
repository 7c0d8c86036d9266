"""The sixth shapes of what lies between the motor and the pad.

Sources: screws that are held at one end, whose stiffness goes with one over the free length (Slocum, Precision
Machine Design), and mounts of rubber between plates (Rivin, Passive Vibration Isolation); lost motion under load (JIS
B 6201) and set screws that work loose (Junker 1969); strips that are bowed; friction as simulators smooth it, by a
tanh of speed, and as vibration does (Andersson, Söderberg and Björklund 2007, Pervozvanski and Canudas de Wit 2002),
viscous friction of greased rails beside Coulomb's (Armstrong-Hélouvry 1991), and friction that differs from stroke to
stroke (Rabinowicz 1958); dampers of a ring in oil (Lanchester 1914, Den Hartog, Mechanical Vibrations) and parts
loose within a clearance (Babitsky, Theory of Vibro-Impact Systems); the edges of teeth and poles (Gieras, Linear
Synchronous Motors) and magnets that weaken as they warm (Hanselman, Brushless Permanent-Magnet Motor Design); heads
whose bracket bends (Heidenhain, mounting tolerances of exposed linear encoders) and scales whose signals are
overdriven (Heydemann 1981).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numba import njit

from ..laws import Law, _Tabulated
from .outside_bench import _child
from .registry import Build, more_shapes, spread
from .sensor import first_order
from .third_machine import _fundamental, _sliding, _worn


@more_shapes("frame_compliance", "screw", "rubber_mount")
def frame_compliance(build: Build, shape: str, size: float) -> dict[str, float]:
    """A screw held at one end gives way more the further its nut is out; or rubber, a spring with a damper beside it.

    `screw`: by a fifth to two fifths of the mean from one end of the depths to the other; stated is that in the middle.
    `rubber_mount`: d + τ d' = C F, τ of 4 to 20 ms.
    """
    rng, compliance, depth = build.rng, size * spread(build.rng, 0.005, 0.02), build.depth_mm
    goes = float(rng.choice([-1.0, 1.0]) * rng.uniform(0.2, 0.4))
    if shape == "screw":
        told = {"frame_form": 9, "frame_per_mm": goes / depth, "frame_at_mm": depth / 2}
    else:
        told = {"frame_form": 5, "frame_late_share": 1.0, "frame_late_s": spread(rng, 0.004, 0.02)}
    build.plant.numbers.update(told, frame_mm_N=compliance)
    return {"compliance": compliance}


@more_shapes("backlash", "under_load", "works_loose")
def backlash(build: Build, shape: str, size: float) -> dict[str, float]:
    """The flanks give way, so that the width goes with the load; or a set screw works loose, the more the further.

    `under_load`: by 40 to 80 % of the mean from none to the greatest load; stated is that at half of it.
    `works_loose`: from 0.6 to 1.4 of the mean along all the way there is; stated is the mean.
    """
    rng, law, most = build.rng, build.plant.pad.law, build.force_N
    gap, goes = 0.02 * size * spread(rng, 0.7, 1.4), float(rng.uniform(0.4, 0.8))

    def width(x):
        if shape == "under_load":
            return gap * (1 + goes * (np.clip(law.force(x) / most, 0.0, 1.2) - 0.5))
        way = np.cumsum(np.abs(np.diff(x, prepend=x[0])))
        return gap * (0.6 + 0.8 * way / max(way[-1], 1e-9))

    build.plant.play.append(lambda t, x: _worn(x, width(x)))
    return {"gap": gap}


@dataclass(frozen=True)
class Bowed(_Tabulated):
    """The mean of a law over a strip bent like the outside of a tube: half its width from the crest it is `drop` lower.

    F = ∫ F(δ − drop s²) ds, s from 0 to 1. The crest is at depth 0, the mean height a third of `drop` below.
    """

    name: ClassVar[str] = "bowed"
    law: Law
    drop: float

    def force(self, depth_mm: np.ndarray | float) -> np.ndarray:
        depth = np.asarray(depth_mm, dtype=float)
        nodes, weights = np.polynomial.legendre.leggauss(24)
        places = (nodes + 1) / 2
        parts = [w / 2 * self.law.force(depth - self.drop * s**2) for s, w in zip(places, weights, strict=True)]
        return np.sum(parts, axis=0)

    def parameters(self) -> dict[str, float]:
        return self.law.parameters() | {"drop": self.drop}

    def model(self, depth_mm: float) -> dict[str, Any]:
        return self.law.model(depth_mm)


@more_shapes("contact_offset", "bowed")
def contact_offset(build: Build, shape: str, size: float) -> dict[str, float]:
    """The surface lies elsewhere and the sample is bowed by up to 30 µm; stated is that of the mean height."""
    offset = float(build.rng.choice([-1.0, 1.0])) * 0.05 * size * spread(build.rng, 0.7, 1.4)
    drop = min(0.4 * abs(offset), 0.03)
    build.plant.pad = replace(build.plant.pad, law=Bowed(build.plant.pad.law, drop))
    build.plant.numbers["offset_mm"] = offset - drop / 3
    return {"offset": offset}


def _strokes(x: np.ndarray) -> np.ndarray:
    """How often the motion has turned so far."""
    moves = np.diff(x, prepend=x[0])
    last = np.maximum.accumulate(np.where(moves != 0, np.arange(len(x)), 0))
    side = np.sign(moves[last])
    return np.cumsum(np.abs(np.diff(side, prepend=side[0])) > 0)


@more_shapes("friction", "smoothed", "viscous_rail", "each_stroke")
def friction(build: Build, shape: str, size: float) -> dict[str, float]:
    """A tanh of speed, nothing at rest; Coulomb's and more with speed; or a level that differs from stroke to stroke.

    `smoothed`: F tanh v/v_0, v_0 of 0.2 to 1 mm/s. `viscous_rail`: a grease that doubles it at 60 to 200 mm/s; stated
    is what is left where it hardly moves. `each_stroke`: spread by a sixth about the mean, which is stated.
    """
    rng, coulomb = build.rng, 0.05 * size * spread(build.rng, 0.7, 1.6)
    slow, doubles, presliding = spread(rng, 0.2, 1.0), spread(rng, 60.0, 200.0), 1e-3 * spread(rng, 0.6, 1.6)
    levels = 1 + np.clip(_child(rng).standard_normal(4096), -2.5, 2.5) / 6

    def act(t, x, v, a):
        if shape == "smoothed":
            return coulomb * np.tanh(v / slow)
        level = 1 + np.abs(v) / doubles if shape == "viscous_rail" else levels[_strokes(x) % len(levels)]
        return coulomb * _sliding(x, presliding, level, level)

    build.plant.felt.append(act)
    return {"coulomb": coulomb}


@njit(cache=True)
def _rattles(v, h, half_mm):
    """Speed of a part that floats within ± half_mm: it goes on by itself until an end takes it along."""
    out, own, off = np.zeros(v.shape[0]), v[0], -half_mm
    for k in range(1, v.shape[0]):
        off += (own - 0.5 * (v[k] + v[k - 1])) * h
        if off > half_mm or off < -half_mm:
            off = min(max(off, -half_mm), half_mm)
            own = min(own, v[k]) if off > 0 else max(own, v[k])
        out[k] = own
    return out


@more_shapes("inertia", "oil_ring", "rattles")
def inertia(build: Build, shape: str, size: float) -> dict[str, float]:
    """A quarter to two fifths of it turns or slides in oil, and comes late; or as much is loose within a clearance.

    `oil_ring`: by a first order of 10 to 40 ms. `rattles`: of 10 to 40 µm, without rebound; each stop takes 1.5 ms.
    """
    rng, mass = build.rng, size * spread(build.rng, 0.05, 0.3)
    share, late_s, half = float(rng.uniform(0.25, 0.4)), spread(rng, 0.01, 0.04), 0.5 * spread(rng, 0.01, 0.04)

    def act(t, x, v, a):
        if shape == "oil_ring":
            moved = first_order(t, a, late_s)
        else:
            moved = np.gradient(first_order(t, _rattles(v, t[1] - t[0], half), 0.0015), t)
        return 1e-3 * mass * ((1 - share) * a + share * moved)

    build.plant.felt.append(act)
    return {"mass": mass}


@more_shapes("cogging", "edges", "warms")
def cogging(build: Build, shape: str, size: float) -> dict[str, float]:
    """Edges of teeth and poles, Σ r^{n−1} sin n θ, r of 0.35 to 0.6; or a sine that fades as the magnets warm.

    `edges`: stated is the first harmonic. `warms`: by a fifth to a third, within a fifth to a half of the recording;
    stated is the mean over time.
    """
    rng, duration = build.rng, build.plant.duration_s
    amplitude = 0.05 * size * spread(rng, 0.7, 1.6)
    period = min(float(rng.uniform(2.0, 5.0)), (build.depth_mm + 0.5) / 0.7)
    phase, sharp = float(rng.uniform(0, 2 * np.pi)), float(rng.uniform(0.35, 0.6))
    fades, tau = float(rng.uniform(0.2, 0.33)), duration * float(rng.uniform(0.2, 0.5))
    mean = tau / duration * -np.expm1(-duration / tau)

    def act(t, x, v, a):
        angle = 2 * np.pi * x / period + phase
        if shape == "edges":
            return amplitude * np.sin(angle) / (1 - 2 * sharp * np.cos(angle) + sharp**2)
        return amplitude * (1 + fades * (np.exp(-t / tau) - mean)) * np.sin(angle)

    build.plant.felt.append(act)
    return {"amplitude": amplitude, "period": period}


@more_shapes("encoder_error", "head_bends", "overdriven")
def encoder_error(build: Build, shape: str, size: float) -> dict[str, float]:
    """The head's bracket bends under load, and the error grows or fades; or sine and cosine are cut off at their tops.

    `head_bends`: by half to all of the mean from none to the greatest load; stated is that at half of it. `overdriven`:
    by 1.1 to 1.35, the arc of what is left, four waves to one of the signals; stated is the first harmonic of a wave.
    """
    rng, law, most = build.rng, build.plant.pad.law, build.force_N
    amplitude, period = 0.01 * size * spread(rng, 0.7, 1.4), spread(rng, 0.7, 1.5)
    phase, goes = float(rng.uniform(0, 2 * np.pi)), float(rng.choice([-1.0, 1.0]) * rng.uniform(0.5, 1.0))
    over = float(rng.uniform(1.1, 1.35))

    def arc(angle):
        sine, cosine = (np.clip(over * part, -1.0, 1.0) for part in (np.sin(angle / 4), np.cos(angle / 4)))
        return np.sin(np.arctan2(sine, cosine) - angle / 4)

    scale = amplitude / _fundamental(arc)

    def error(x):
        angle = 2 * np.pi * x / period + phase
        if shape == "overdriven":
            return scale * arc(angle)
        return amplitude * (1 + goes * (np.clip(law.force(x) / most, 0.0, 1.2) - 0.5)) * np.sin(angle)

    build.plant.encoder.append(lambda t, x: x + error(x))
    return {"amplitude": amplitude, "period": period}
