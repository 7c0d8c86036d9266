"""The seventh shapes of what lies between the motor and the pad.

Sources: rods that are not quite straight (Timoshenko and Gere, Theory of Elastic Stability) and tapers, whose friction
goes with their load (Wahl, Mechanical Springs, as of ring springs); two meshes with a shaft between them (Nordin and
Gutman 2002) and films that are squeezed out at rest (Stefan 1874); faces that are turned hollow or to a cone (ISO 1101,
flatness); rolling friction before it slides (Al-Bender and De Moerlooze 2010), friction that comes late behind the
speed (Hess and Soom 1990), greases with a yield stress (Herschel and Bulkley 1926); covers of sheets (Slocum,
Precision Machine Design) and arms that swing (Blevins, Formulas for Natural Frequency and Mode Shape); the reaction of
the armature (Gieras, Linear Synchronous Motors) and belts that creep on their pulleys (Gerbert 1999); scales written
field by field (Teimel 1992) and signals whose offsets drift (Heydemann 1981, Birch 1990).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numba import njit

from ..laws import Law, _Tabulated
from .registry import Build, more_shapes, spread
from .sensor import second_order
from .third_machine import _gms, _sliding, _worn


@more_shapes("frame_compliance", "bowed_rod", "taper")
def frame_compliance(build: Build, shape: str, size: float) -> dict[str, float]:
    """A rod that is bowed shortens by (1 − F/P)^{−2} − 1, beside what is linear; or a taper that jams.

    `bowed_rod`: that part has a third to two thirds of the compliance at no load, P is 2 to 4 times the greatest force;
    stated is the secant at 0.6 of that. `taper`: F = d (1 ± μ)/C, more as it goes in than as it comes out, and stuck
    between; μ of 0.1 to 0.25, stated is the mean of both ways.
    """
    rng, compliance, at = build.rng, size * spread(build.rng, 0.005, 0.02), 0.6 * build.force_N
    share, buckles = float(rng.uniform(0.33, 0.67)), float(rng.uniform(2.0, 4.0)) * build.force_N
    rubs = float(rng.uniform(0.1, 0.25))
    if shape == "bowed_rod":
        given = (1 - share) * at + share * 0.5 * buckles * ((1 - at / buckles) ** -2 - 1)
        told = {"frame_form": 10, "frame_mm_N": compliance * at / given, "frame_force_N": buckles}
        told["frame_late_share"] = share
    else:
        # d/F is C/(1 + μ) one way and C/(1 − μ) the other.
        told = {"frame_form": 11, "frame_mm_N": compliance * (1 - rubs**2), "frame_late_share": rubs}
    build.plant.numbers.update(told)
    return {"compliance": compliance}


@njit(cache=True)
def _oiled(x, h, length_mm, tau_s):
    """Film from 0 to 1: it builds with the way, and is squeezed out by f' = −f³/2τ, which is 1/√(1 + t/τ)."""
    out, film = np.zeros(x.shape[0]), 0.0
    for k in range(1, x.shape[0]):
        film += (1 - film) * -np.expm1(-abs(x[k] - x[k - 1]) / length_mm)
        film /= np.sqrt(1 + film * film * h / tau_s)
        out[k] = film
    return out


@more_shapes("backlash", "two_meshes", "squeezed_out")
def backlash(build: Build, shape: str, size: float) -> dict[str, float]:
    """Two plays with a shaft between them, which winds up before the second opens; or a film that wants motion.

    `two_meshes`: two fifths to three fifths of the gap, then nothing over a way of 1 to 2.5 gaps, then the rest.
    `squeezed_out`: a quarter to two fifths of the gap is filled after 0.5 to 2 mm of way, and dry within 0.05 to 0.3 s
    and longer, by the root of time; stated is the dry gap.
    """
    rng, gap = build.rng, 0.02 * size * spread(build.rng, 0.7, 1.4)
    first, winds = gap * float(rng.uniform(0.4, 0.6)), gap * float(rng.uniform(1.0, 2.5))
    film, length, tau = float(rng.uniform(0.25, 0.4)), spread(rng, 0.5, 2.0), spread(rng, 0.05, 0.3)

    def play(t, x):
        if shape == "squeezed_out":
            return _worn(x, gap * (1 - film * _oiled(x, t[1] - t[0], length, tau)))
        way = _worn(x, np.full(len(x), gap + winds)) - x
        return x + np.minimum(way, first) + np.maximum(way - first - winds, 0.0)

    build.plant.play.append(play)
    return {"gap": gap}


@dataclass(frozen=True)
class Coned(_Tabulated):
    """The mean of a law over a round face turned to a cone, `rise` high: F = ∫ F(δ − rise s) 2 s ds, s from 0 to 1.

    The tip is at depth 0, the mean height two thirds of the rise below.
    """

    name: ClassVar[str] = "coned"
    law: Law
    rise: float

    def force(self, depth_mm: np.ndarray | float) -> np.ndarray:
        depth = np.asarray(depth_mm, dtype=float)
        nodes, weights = np.polynomial.legendre.leggauss(24)
        places = (nodes + 1) / 2
        parts = [w * s * self.law.force(depth - self.rise * s) for s, w in zip(places, weights, strict=True)]
        return np.sum(parts, axis=0)

    def parameters(self) -> dict[str, float]:
        return self.law.parameters() | {"rise": self.rise}

    def model(self, depth_mm: float) -> dict[str, Any]:
        return self.law.model(depth_mm)


@more_shapes("contact_offset", "coned")
def contact_offset(build: Build, shape: str, size: float) -> dict[str, float]:
    """The surface lies elsewhere, and the probe's face is a cone of up to 25 µm; stated is that of its mean height."""
    offset = float(build.rng.choice([-1.0, 1.0])) * 0.05 * size * spread(build.rng, 0.7, 1.4)
    rise = min(0.35 * abs(offset), 0.025)
    build.plant.pad = replace(build.plant.pad, law=Coned(build.plant.pad.law, rise))
    build.plant.numbers["offset_mm"] = offset - 2 * rise / 3
    return {"offset": offset}


def _power_elements(power: float, count: int = 20) -> tuple[np.ndarray, np.ndarray]:
    """Elements (where they slip, their forces) whose sum is s^power at s = 1/n, 2/n … 1, straight between."""
    at = np.arange(count + 1) / count
    stiffness = np.append(np.diff(at**power) * count, 0.0)
    return at[1:], -np.diff(stiffness) * at[1:]


@more_shapes("friction", "rolling", "comes_late", "yield_stress")
def friction(build: Build, shape: str, size: float) -> dict[str, float]:
    """Balls that roll before they slide; a fall with speed that comes late; or a grease that yields and then flows.

    `rolling`: (s/ℓ)^p at first, p of 0.5 to 0.7 and ℓ of 40 to 120 µm, and twice as far after a turn. `comes_late`:
    1 + f/(1 + (v/v_s)²), f of 0.2 to 0.6 and v_s of 1 to 8 mm/s, with the speed of 3 to 10 ms ago; stated is that at
    speed. `yield_stress`: 1 + (v/v_0)^n, n of 0.4 to 0.6 and v_0 of 100 to 300 mm/s; stated is what yields.
    """
    rng, coulomb = build.rng, 0.05 * size * spread(build.rng, 0.7, 1.6)
    power, length, presliding = float(rng.uniform(0.5, 0.7)), spread(rng, 0.04, 0.12), 1e-3 * spread(rng, 0.6, 1.6)
    more, slow, late_s = float(rng.uniform(0.2, 0.6)), spread(rng, 1.0, 8.0), spread(rng, 0.003, 0.01)
    flow, doubles = float(rng.uniform(0.4, 0.6)), spread(rng, 100.0, 300.0)
    ends, shares = _power_elements(power)

    def act(t, x, v, a):
        if shape == "rolling":
            return coulomb * _gms(x, t[1] - t[0], ends * length, shares, 0.0, 1.0, 1.0)
        if shape == "comes_late":
            level = 1 + more / (1 + (np.interp(t - late_s, t, np.abs(v)) / slow) ** 2)
        else:
            level = 1 + (np.abs(v) / doubles) ** flow
        return coulomb * _sliding(x, presliding, level, level)

    build.plant.felt.append(act)
    return {"coulomb": coulomb}


#: Of a beam clamped at its foot: shares of its mass in the first three modes, and their frequencies over the first.
_ARM = ((0.613, 1.0), (0.188, 6.267), (0.065, 17.55))


@more_shapes("inertia", "sheet_cover", "arm")
def inertia(build: Build, shape: str, size: float) -> dict[str, float]:
    """A cover whose sheets are taken along one by one, and left behind on the way back; or an arm that swings.

    `sheet_cover`: 0.3 to 0.6 of it are four to six sheets, each of which is taken along within 0.2 mm, by m' v²; stated
    is the mean over the depths. `arm`: half to four fifths of it, of 40 to 90 Hz and its next two modes.
    """
    rng, mass, depth = build.rng, size * spread(build.rng, 0.05, 0.3), build.depth_mm
    share, sheets, within = float(rng.uniform(0.3, 0.6)), int(rng.integers(4, 7)), 0.2
    swings, first_Hz, damping = float(rng.uniform(0.5, 0.8)), spread(rng, 40.0, 90.0), spread(rng, 0.02, 0.06)
    places = depth * (np.arange(sheets) + 0.5) / sheets

    def act(t, x, v, a):
        if shape == "arm":
            rest = 1 - swings * sum(part for part, _ in _ARM)
            moved = sum(swings * part * second_order(t, a, ratio * first_Hz, damping) for part, ratio in _ARM)
            return 1e-3 * mass * (rest * a + moved)
        taken = np.zeros_like(x)
        gains = np.zeros_like(x)
        for place in places:
            taken += np.clip((x - place) / within + 0.5, 0.0, 1.0) / sheets
            gains += (np.abs(x - place) < within / 2) / (within * sheets)
        bears = 1 - share + 2 * share * taken
        return 1e-3 * mass * (bears * a + 2 * share * gains * np.maximum(v, 0.0) ** 2)

    build.plant.felt.append(act)
    return {"mass": mass}


@more_shapes("cogging", "armature_reaction", "belt_creeps")
def cogging(build: Build, shape: str, size: float) -> dict[str, float]:
    """The thrust shifts the field, and the ripple's phase with it; or a pulley's, on which the belt creeps.

    `armature_reaction`: by 0.4 to 1 rad from none to the greatest load. `belt_creeps`: by 0.5 to 1.2 rad, evenly over
    all the way there is. Amplitude and period are those at any one load, or time.
    """
    rng, law, most = build.rng, build.plant.pad.law, build.force_N
    amplitude = 0.05 * size * spread(rng, 0.7, 1.6)
    period = min(float(rng.uniform(2.0, 5.0)), (build.depth_mm + 0.5) / 0.7)
    phase, side = float(rng.uniform(0, 2 * np.pi)), float(rng.choice([-1.0, 1.0]))
    thrust, creeps = side * float(rng.uniform(0.4, 1.0)), side * float(rng.uniform(0.5, 1.2))

    def act(t, x, v, a):
        angle = 2 * np.pi * x / period + phase
        if shape == "armature_reaction":
            return amplitude * np.sin(angle + thrust * (np.clip(law.force(x) / most, 0.0, 1.2) - 0.5))
        way = np.cumsum(np.abs(np.diff(x, prepend=x[0])))
        return amplitude * np.sin(angle + creeps * (way / max(way[-1], 1e-9) - 0.5))

    build.plant.felt.append(act)
    return {"amplitude": amplitude, "period": period}


@more_shapes("encoder_error", "stitched", "offsets_drift")
def encoder_error(build: Build, shape: str, size: float) -> dict[str, float]:
    """A scale whose fields are written a little too long or short, and begin anew; or offsets of sine and cosine.

    `stitched`: Σ r^{n−1} sin(n θ)/n, r of 0.6 to 0.8; stated is the first harmonic. `offsets_drift`: that of the sine
    settles by 0.4 to 0.8 within a fifth to a half of the recording, that of the cosine goes evenly through nothing, to
    0.3 to 0.6 of the other; stated is the mean.
    """
    rng, duration = build.rng, build.plant.duration_s
    amplitude, period = 0.01 * size * spread(rng, 0.7, 1.4), spread(rng, 0.7, 1.5)
    phase, side = float(rng.uniform(0, 2 * np.pi)), float(rng.choice([-1.0, 1.0]))
    sharp, settles, goes = float(rng.uniform(0.6, 0.8)), float(rng.uniform(0.4, 0.8)), float(rng.uniform(0.3, 0.6))
    tau = duration * float(rng.uniform(0.2, 0.5))
    mean = tau / duration * -np.expm1(-duration / tau)

    def error(t, x):
        angle = 2 * np.pi * x / period + phase
        if shape == "stitched":
            return side * amplitude / sharp * np.arctan(sharp * np.sin(angle) / (1 - sharp * np.cos(angle)))
        sine, cosine = 1 + side * settles * (np.exp(-t / tau) - mean), goes * (2 * t / duration - 1)
        return amplitude * (sine * np.sin(angle) + cosine * np.cos(angle))

    build.plant.encoder.append(lambda t, x: x + error(t, x))
    return {"amplitude": amplitude, "period": period}
