"""The fifth shapes: what lies between the motor and the pad.

Sources: flat joints of machine tools, which give way by the root of the pressure (Levina and Reshetov 1971, Back,
Burdekin and Cowley 1973), and diaphragms, which stretch as they bend (Timoshenko and Woinowsky-Krieger, Theory of
Plates and Shells); nuts of plastic, whose clearance closes as they warm, and films that carry a part of the clearance
the more the faster it goes (Reynolds 1886, Sommerfeld 1904); samples with a seam, and machines that are homed anew (ISO
230-2, repeatability); friction that is elastic before it slips (Dupont, Hayward, Armstrong and Altpeter 2002), of a
contact whose edge slips first (Mindlin 1949, Mindlin and Deresiewicz 1953), and of guides whose balls come in one after
another (Ohta, Kitajima, Kato and Igarashi 2007); a block that lies loose and slides (Newmark 1965) and a liquid that
sloshes (Abramson, NASA SP-106); the ripple of blocks of current that follow each other (Hanselman, Brushless
Permanent-Magnet Motor Design) and magnets that are not alike (Gieras, Linear Synchronous Motors); interpolators that
average (Heidenhain, subdivision error and traversing speed) and screws whose lead has a second wave (ISO 3408-3).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numba import njit

from ..laws import Law, _Tabulated
from .outside_bench import _child
from .registry import Build, more_shapes, spread
from .sensor import second_order
from .third_machine import _gms, _sliding, _worn


@more_shapes("frame_compliance", "flat_joint", "diaphragm")
def frame_compliance(build: Build, shape: str, size: float) -> dict[str, float]:
    """A joint that gives way by √(1 + F/F_0) − 1, beside what is linear; or a plate with y + y³ = F/F_0, y = d/(C F_0).

    `flat_joint`: the joint has half to four fifths of the compliance at no load, and F_0 is 3 to 10 % of the greatest
    force. `diaphragm`: F_0 is 1 to 2 times the greatest. Stated is the secant at 0.6 of the greatest force.
    """
    rng, compliance, at = build.rng, size * spread(build.rng, 0.005, 0.02), 0.6 * build.force_N
    share, small, large = float(rng.uniform(0.5, 0.8)), float(rng.uniform(0.03, 0.1)), float(rng.uniform(1.0, 2.0))
    if shape == "flat_joint":
        scale = small * build.force_N
        given = (1 - share) * at + share * 2 * scale * (np.sqrt(1 + at / scale) - 1)
        told = {"frame_form": 7, "frame_stiff_share": share}
    else:
        scale = large * build.force_N
        given = scale * float(np.roots([1.0, 0.0, 1.0, -at / scale])[-1].real)
        told = {"frame_form": 8}
    build.plant.numbers.update(told, frame_mm_N=compliance * at / given, frame_force_N=scale)
    return {"compliance": compliance}


@more_shapes("backlash", "warms", "oil_wedge")
def backlash(build: Build, shape: str, size: float) -> dict[str, float]:
    """The nut warms, and its clearance closes by a third to a half; or a film carries up to a third of it at speed.

    `warms`: within a fifth to a half of the recording; stated is the mean over time. `oil_wedge`: w v/(v + v_0) of the
    width is filled, v_0 of 5 to 20 mm/s; stated is the width at rest.
    """
    rng, duration = build.rng, build.plant.duration_s
    gap, closes, tau = 0.02 * size * spread(rng, 0.7, 1.4), float(rng.uniform(0.33, 0.5)), float(rng.uniform(0.2, 0.5))
    film, half_mm_s = float(rng.uniform(0.2, 0.33)), spread(rng, 5.0, 20.0)
    mean = tau * -np.expm1(-1 / tau)

    def width(t, x):
        if shape == "warms":
            return gap * (1 + closes * (np.exp(-t / (tau * duration)) - mean))
        speed = np.abs(np.gradient(x, t))
        return gap * (1 - film * speed / (speed + half_mm_s))

    build.plant.play.append(lambda t, x: _worn(x, width(t, x)))
    return {"gap": gap}


@dataclass(frozen=True)
class Seam(_Tabulated):
    """A share of the surface lies higher by a step: F = s F(δ) + (1 − s) F(δ − step); its top is at depth 0."""

    name: ClassVar[str] = "seam"
    law: Law
    share: float
    step: float

    def force(self, depth_mm: np.ndarray | float) -> np.ndarray:
        depth = np.asarray(depth_mm, dtype=float)
        return self.share * self.law.force(depth) + (1 - self.share) * self.law.force(depth - self.step)

    def parameters(self) -> dict[str, float]:
        return self.law.parameters() | {"share": self.share, "step": self.step}

    def model(self, depth_mm: float) -> dict[str, Any]:
        return self.law.model(depth_mm)


@more_shapes("contact_offset", "seam", "rehomed")
def contact_offset(build: Build, shape: str, size: float) -> dict[str, float]:
    """A fifth to two fifths of the surface is a seam, up to 20 µm higher; or the machine is homed anew once.

    `seam`: stated is the mean height. `rehomed`: from then on the surface is found a tenth of the offset elsewhere, at
    0.3 to 0.7 of the time; stated is the mean over time.
    """
    rng, duration = build.rng, build.plant.duration_s
    offset = float(rng.choice([-1.0, 1.0])) * 0.05 * size * spread(rng, 0.7, 1.4)
    share, step, when = float(rng.uniform(0.2, 0.4)), min(0.3 * abs(offset), 0.02), float(rng.uniform(0.3, 0.7))
    side = float(rng.choice([-1.0, 1.0]))
    if shape == "seam":
        build.plant.pad = replace(build.plant.pad, law=Seam(build.plant.pad.law, share, step))
        build.plant.numbers["offset_mm"] = offset - (1 - share) * step
        return {"offset": offset}
    build.plant.numbers["offset_mm"] = offset
    build.plant.height.append(lambda t, x: side * offset / 10 * ((t > when * duration) - (1 - when)))
    return {"offset": offset}


@njit(cache=True)
def _elasto_plastic(x, presliding, elastic):
    """z' = x' (1 − α(z) z/z_ss), over z_ss; α is 0 below `elastic` and on the way back, else a half sine up to 1.

    In steps of a fiftieth of z_ss at most.
    """
    out, z = np.zeros(x.shape[0]), 0.0
    for k in range(1, x.shape[0]):
        way = (x[k] - x[k - 1]) / presliding
        count = int(np.ceil(abs(way) * 50))
        for _ in range(count):
            share, a = 0.0, abs(z)
            if z * way > 0 and a > elastic:
                share = 0.5 + 0.5 * np.sin(np.pi * (min(a, 1.0) - 0.5 * (1 + elastic)) / (1 - elastic))
            if share > 1 - 1e-9:
                break
            z += way / count * (1 - share * a)
        out[k] = z
    return out


def _edge_slips(count: int = 20) -> tuple[np.ndarray, np.ndarray]:
    """Elements (where they slip, their forces) whose sum is 1 − (1 − s)^{3/2} at s = 1/n, 2/n … 1, straight between."""
    at = np.arange(count + 1) / count
    stiffness = np.append(np.diff(1 - (1 - at) ** 1.5) * count, 0.0)
    return at[1:], -np.diff(stiffness) * at[1:]


@more_shapes("friction", "elasto_plastic", "edge_slips", "ball_passage")
def friction(build: Build, shape: str, size: float) -> dict[str, float]:
    """Elastic up to 0.4 to 0.7 of its deflection; a contact that slips from its edge; or balls that come in and go.

    `edge_slips`: 1 − (1 − s/ℓ)^{3/2} at first, ℓ of 5 to 15 µm, and twice as far after a turn. `ball_passage`: the
    level swells by 12 to 25 % with each 0.4 to 1.2 mm of way, as balls enter the track; stated is its mean.
    """
    rng, coulomb = build.rng, 0.05 * size * spread(build.rng, 0.7, 1.6)
    presliding, elastic, length = 3e-3 * spread(rng, 0.6, 1.6), float(rng.uniform(0.4, 0.7)), spread(rng, 0.005, 0.015)
    swells, pitch, phase = float(rng.uniform(0.12, 0.25)), spread(rng, 0.4, 1.2), float(rng.uniform(0, 2 * np.pi))
    ends, shares = _edge_slips()

    def act(t, x, v, a):
        if shape == "elasto_plastic":
            return coulomb * _elasto_plastic(x, presliding, elastic)
        if shape == "edge_slips":
            return coulomb * _gms(x, t[1] - t[0], ends * length, shares, 0.0, 1.0, 1.0)
        level = 1 + swells * np.sin(2 * np.pi * x / pitch + phase)
        return coulomb * _sliding(x, presliding / 2, level, level)

    build.plant.felt.append(act)
    return {"coulomb": coulomb}


@njit(cache=True)
def _slides(v, h, most):
    """Acceleration of a block that friction takes along, `most` at the very most."""
    out, own = np.zeros(v.shape[0]), v[0]
    for k in range(1, v.shape[0]):
        out[k] = min(max((v[k] - own) / h, -most), most)
        own += out[k] * h
    return out


@more_shapes("inertia", "loose_block", "slosh")
def inertia(build: Build, shape: str, size: float) -> dict[str, float]:
    """A fifth to a third of it lies loose and slides where it is pushed too hard; or as much is a liquid that sloshes.

    `loose_block`: from 0.4 to 0.7 of the greatest acceleration on. `slosh`: at 2 to 5 Hz, and for seconds.
    """
    rng, mass = build.rng, size * spread(build.rng, 0.05, 0.3)
    share, holds = float(rng.uniform(0.2, 0.33)), float(rng.uniform(0.4, 0.7))
    slosh_Hz, damping = spread(rng, 2.0, 5.0), spread(rng, 0.02, 0.06)

    def act(t, x, v, a):
        if shape == "loose_block":
            moved = _slides(v, t[1] - t[0], holds * max(float(np.max(np.abs(a))), 1.0))
        else:
            moved = second_order(t, a, slosh_Hz, damping)
        return 1e-3 * mass * ((1 - share) * a + share * moved)

    build.plant.felt.append(act)
    return {"mass": mass}


@more_shapes("cogging", "commutation", "uneven_magnets")
def cogging(build: Build, shape: str, size: float) -> dict[str, float]:
    """Blocks of current that are switched, |sin| with its cusps; or magnets that differ, by a fifth and in place.

    `commutation`: stated is the first harmonic. `uneven_magnets`: each period has its amplitude, which goes over into
    the next, and its place, within 4 % of the period; stated is the mean of all.
    """
    rng = build.rng
    amplitude = 0.05 * size * spread(rng, 0.7, 1.6)
    period = min(float(rng.uniform(2.0, 5.0)), (build.depth_mm + 0.5) / 0.7)
    phase, child = float(rng.uniform(0, 2 * np.pi)), _child(rng)
    places = period * np.arange(-4.0, 5.0)
    strengths, off = 0.35 * child.uniform(-1, 1, len(places)), 0.04 * period * child.uniform(-1, 1, len(places))
    # Those at the depths, 0 to 2 periods, have no mean.
    strengths -= strengths[4:7].mean()

    def act(t, x, v, a):
        if shape == "commutation":
            # |sin θ/2| is 2/π − 4/π (cos θ/3 + cos 2θ/15 + …).
            return 0.75 * np.pi * amplitude * (np.abs(np.sin(np.pi * x / period + phase / 2)) - 2 / np.pi)
        angle = 2 * np.pi * (x + np.interp(x, places, off)) / period
        return amplitude * (1 + np.interp(x, places, strengths)) * np.sin(angle + phase)

    build.plant.felt.append(act)
    return {"amplitude": amplitude, "period": period}


@more_shapes("encoder_error", "averaged", "ball_screw")
def encoder_error(build: Build, shape: str, size: float) -> dict[str, float]:
    """An interpolator that averages over time, so that fast motions see less of it; or a screw with a second wave.

    `averaged`: a first order of 5 to 15 ms acts on the error at a given speed; stated is that at rest. `ball_screw`: a
    quarter to two fifths at 0.4 to 0.6 of the period, as of the balls; stated is the lead's.
    """
    rng = build.rng
    amplitude, period = 0.01 * size * spread(rng, 0.7, 1.4), spread(rng, 0.7, 1.5)
    phase, other = rng.uniform(0, 2 * np.pi, 2)
    tau, share, ratio = spread(rng, 0.005, 0.015), float(rng.uniform(0.25, 0.4)), float(rng.uniform(0.4, 0.6))

    def error(t, x):
        angle = 2 * np.pi * x / period + phase
        if shape == "averaged":
            # e^{iθ}/(1 + i ω τ) with ω = 2π v/period.
            turns = 1 + 2j * np.pi * tau * np.gradient(x, t) / period
            return amplitude * np.imag(np.exp(1j * angle) / turns)
        return amplitude * (np.sin(angle) + share * np.sin(2 * np.pi * x / (ratio * period) + other))

    build.plant.encoder.append(lambda t, x: x + error(t, x))
    return {"amplitude": amplitude, "period": period}
