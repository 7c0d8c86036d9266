"""The fourth shapes: what lies between the motor and the pad.

Sources: frames with a part of plastic or glue, which creeps (Findley, Lai and Onaran 1976); joints whose edges slip
(Iwan 1966, Gaul and Nitsche 2001); plays that change with the eccentricity of a gear or pulley, or differ each time
(ISO 230-2: reversal value and its spread); samples that settle on their tape, and wavy surfaces (ISO 4287); friction
that changes along the way, as of rails that are not parallel (Armstrong-Hélouvry 1991), that grows with the logarithm
of speed, as of polymers (Briscoe and Tabor 1978), and of grease that is worked in (Lugt, Grease Lubrication in Rolling
Bearings); benches that recoil (Rivin, Passive Vibration Isolation); ripple of the thrust, and of windings with a
fraction of a slot for each pole (Gieras, Linear Synchronous Motors; Hendershot and Miller); magnetic scales, which
remember the way they were passed, and whose poles are not alike (Campbell, Position Sensors).
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
from .third_machine import _sliding, _trails, _worn


@more_shapes("frame_compliance", "creeps", "joints_slip")
def frame_compliance(build: Build, shape: str, size: float) -> dict[str, float]:
    """A tenth to a fifth of it comes late, within 0.3 to 2 s; or a fifth to two fifths sit in joints that slip.

    `creeps`: stated is the middle of at once and at last. `joints_slip`: that part sticks until the force has changed
    by a tenth to a fifth of the greatest, which makes a loop; stated is the mean of both ways.
    """
    rng, compliance = build.rng, size * spread(build.rng, 0.005, 0.02)
    if shape == "creeps":
        late = float(rng.uniform(0.1, 0.2))
        told = {"frame_form": 5, "frame_mm_N": compliance / (1 - late / 2), "frame_late_s": spread(rng, 0.3, 2.0)}
    else:
        late = float(rng.uniform(0.2, 0.4))
        half = float(rng.uniform(0.05, 0.1)) * build.force_N
        told = {"frame_form": 6, "frame_mm_N": compliance, "frame_force_N": half}
    build.plant.numbers.update(told, frame_late_share=late)
    return {"compliance": compliance}


@more_shapes("backlash", "runout")
def runout(build: Build, shape: str, size: float) -> dict[str, float]:
    """A gear or pulley that runs out: the width swells and shrinks by 15 to 35 % every 0.5 to 1.5 mm; stated: mean."""
    gap, more = 0.02 * size * spread(build.rng, 0.7, 1.4), float(build.rng.uniform(0.15, 0.35))
    period, phase = spread(build.rng, 0.5, 1.5), float(build.rng.uniform(0, 2 * np.pi))
    build.plant.play.append(lambda t, x: _worn(x, gap * (1 + more * np.sin(2 * np.pi * x / period + phase))))
    return {"gap": gap}


@njit(cache=True)
def _uneven(x, gaps):
    """Behind a play whose width is another of `gaps` after each turn to the way out."""
    y, j, out = x.copy(), gaps.shape[0] - 1, False
    for k in range(1, x.shape[0]):
        if x[k] < x[k - 1] and not out:
            j, out = (j + 1) % gaps.shape[0], True
        elif x[k] > x[k - 1]:
            out = False
        y[k] = min(max(y[k - 1], x[k]), x[k] + gaps[j])
    return y


@more_shapes("backlash", "uneven")
def uneven(build: Build, shape: str, size: float) -> dict[str, float]:
    """Balls and dirt: each turn finds another width, spread by a sixth to a third about the mean, which is stated."""
    gap, spreads = 0.02 * size * spread(build.rng, 0.7, 1.4), float(build.rng.uniform(0.16, 0.33))
    child = _child(build.rng)
    gaps = np.ravel([(1 + s, 1 - s) for s in spreads * np.clip(child.standard_normal(512), -2, 2)])
    build.plant.play.append(lambda t, x: _uneven(x, gap * gaps))
    return {"gap": gap}


@dataclass(frozen=True)
class Wavy(_Tabulated):
    """The mean of a law over a surface that is a sine of this half height; the crests are at depth 0."""

    name: ClassVar[str] = "wavy"
    law: Law
    half: float

    def force(self, depth_mm: np.ndarray | float) -> np.ndarray:
        depth = np.asarray(depth_mm, dtype=float)
        # Heights of a sine at even phases: the nodes of Gauss and Chebyshev, whose weights are equal.
        heights = np.cos(np.pi * (np.arange(24) + 0.5) / 24)
        return np.mean([self.law.force(depth - self.half * (1 - h)) for h in heights], axis=0)

    def parameters(self) -> dict[str, float]:
        return self.law.parameters() | {"half": self.half}

    def model(self, depth_mm: float) -> dict[str, Any]:
        return self.law.model(depth_mm)


@more_shapes("contact_offset", "settles", "wavy")
def contact_offset(build: Build, shape: str, size: float) -> dict[str, float]:
    """The surface lies elsewhere; it goes on by an eighth as the sample settles, or is wavy, by up to 15 µm either way.

    `settles`: within a tenth to a third of the recording; stated is the mean over time. `wavy`: the mean height.
    """
    rng, duration = build.rng, build.plant.duration_s
    offset = float(rng.choice([-1.0, 1.0])) * 0.05 * size * spread(rng, 0.7, 1.4)
    tau = duration * float(rng.uniform(0.1, 0.33))
    if shape == "wavy":
        half = min(0.2 * abs(offset), 0.015)
        build.plant.pad = replace(build.plant.pad, law=Wavy(build.plant.pad.law, half))
        build.plant.numbers["offset_mm"] = offset - half
        return {"offset": offset}
    mean = tau / duration * -np.expm1(-duration / tau)
    build.plant.numbers["offset_mm"] = offset
    # Deeper as time goes, as a weight on a tape.
    build.plant.height.append(lambda t, x: abs(offset) / 8 * (mean - np.exp(-t / tau)))
    return {"offset": offset}


@more_shapes("friction", "tight_spots", "polymer_bush", "worked_in")
def friction(build: Build, shape: str, size: float) -> dict[str, float]:
    """Of rails not quite parallel, of a bush of polymer, or of grease that has lain.

    `tight_spots`: the level changes along the way, by 25 to 50 % in waves of two lengths; stated is its mean over the
    depths. `polymer_bush`: 3 to 6 % more for each e-fold of speed above 0.1 mm/s, stated at 1 mm/s. `worked_in`: half
    as much again at first, less within 5 to 20 mm of way, back within 20 to 60 s at rest; stated when worked in.
    """
    rng, coulomb = build.rng, 0.05 * size * spread(build.rng, 0.7, 1.6)
    presliding, depth = 1.5e-3 * spread(rng, 0.6, 1.6), build.depth_mm
    waves, grows = rng.uniform([0.15, 0.1], [0.3, 0.2]), float(rng.uniform(0.03, 0.06))
    phases, length, rests_s = rng.uniform(0, 2 * np.pi, 2), spread(rng, 5.0, 20.0), spread(rng, 20.0, 60.0)

    def level(t, x, v):
        if shape == "tight_spots":
            # Whole waves over the depths: one and two, so that they have no mean there.
            return 1 + np.sin(2 * np.pi * x[:, None] / depth * np.array([1.0, 2.0]) + phases) @ waves
        if shape == "polymer_bush":
            return 1 + grows * (np.log1p(np.abs(v) / 0.1) - np.log1p(10.0))
        return 1 + 0.5 * _stiff(x, t[1] - t[0], length, rests_s)

    def act(t, x, v, a):
        at = level(t, x, v)
        return coulomb * _sliding(x, presliding, at, at)

    build.plant.felt.append(act)
    return {"coulomb": coulomb}


@njit(cache=True)
def _stiff(x, h, length_mm, rests_s):
    """Structure of the grease: s' = (1 − s)/τ − s |v|/ℓ, whole at first."""
    out = np.ones(x.shape[0])
    for k in range(1, x.shape[0]):
        out[k] = (out[k - 1] + h / rests_s) / (1 + h / rests_s + abs(x[k] - x[k - 1]) / length_mm)
    return out


@more_shapes("inertia", "recoil", "stacked")
def inertia(build: Build, shape: str, size: float) -> dict[str, float]:
    """The bench recoils, by a twelfth to a fifth, at 6 to 14 Hz; or half of it sits on an adapter of 80 to 160 Hz.

    `recoil`: the mass feels a less what its ground does, s²/(s² + 2 ζ ω s + ω²) of that share. `stacked`: the adapter
    is hardly damped, and rings.
    """
    rng, mass = build.rng, size * spread(build.rng, 0.05, 0.3)
    share, recoil_Hz, damping = float(rng.uniform(0.08, 0.2)), spread(rng, 6.0, 14.0), spread(rng, 0.08, 0.2)
    upper, upper_Hz = float(rng.uniform(0.4, 0.6)), spread(rng, 80.0, 160.0)

    def act(t, x, v, a):
        if shape == "stacked":
            return 1e-3 * mass * ((1 - upper) * a + upper * second_order(t, a, upper_Hz, 0.08))
        omega = 2 * np.pi * recoil_Hz
        low = second_order(t, a, recoil_Hz, damping)
        # s²/(…) is 1 less (2 ζ s/ω + 1) ω²/(…).
        ground = a - low - 2 * damping / omega * np.gradient(low, t)
        return 1e-3 * mass * (a - share * ground)

    build.plant.felt.append(act)
    return {"mass": mass}


@more_shapes("cogging", "thrust", "fractional_slots")
def cogging(build: Build, shape: str, size: float) -> dict[str, float]:
    """A part that goes with the thrust; or slots that are no multiple of the poles, and make a second period.

    `thrust`: 0.7 of it without load, 1.3 at the greatest; stated is at half load. `fractional_slots`: a quarter to two
    fifths at 1.4 to 1.7 waves for each of the first; stated is the first.
    """
    rng, law, most = build.rng, build.plant.pad.law, build.force_N
    amplitude = 0.05 * size * spread(rng, 0.7, 1.6)
    period = min(float(rng.uniform(2.0, 5.0)), (build.depth_mm + 0.5) / 0.7)
    phase, other = rng.uniform(0, 2 * np.pi, 2)
    share, ratio = float(rng.uniform(0.25, 0.4)), float(rng.uniform(1.4, 1.7))

    def act(t, x, v, a):
        angle = 2 * np.pi * x / period
        if shape == "thrust":
            return amplitude * (0.7 + 0.6 * np.clip(law.force(x) / most, 0.0, 1.2)) * np.sin(angle + phase)
        return amplitude * (np.sin(angle + phase) + share * np.sin(ratio * angle + other))

    build.plant.felt.append(act)
    return {"amplitude": amplitude, "period": period}


@more_shapes("encoder_error", "magnetic_tape", "uneven_poles")
def encoder_error(build: Build, shape: str, size: float) -> dict[str, float]:
    """A tape that is read 1 to 3 % of a period late on either way; or poles that differ, by a fifth or so.

    `uneven_poles`: each period has its amplitude, which goes over into the next; stated is the mean of all.
    """
    rng = build.rng
    amplitude, period = 0.01 * size * spread(rng, 0.7, 1.4), spread(rng, 0.7, 1.5)
    phase, width = float(rng.uniform(0, 2 * np.pi)), 2 * period * float(rng.uniform(0.01, 0.03))
    count = int(np.ceil(build.depth_mm / period)) + 2
    poles = 0.25 * rng.uniform(-1, 1, count)
    poles, places = 1 + poles - poles.mean(), period * (np.arange(count) - 0.5)

    def error(x):
        if shape == "magnetic_tape":
            return amplitude * np.sin(2 * np.pi * _trails(x, width) / period + phase)
        return amplitude * np.interp(x, places, poles) * np.sin(2 * np.pi * x / period + phase)

    build.plant.encoder.append(lambda t, x: x + error(x))
    return {"amplitude": amplitude, "period": period}
