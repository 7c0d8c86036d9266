"""The judge's shapes of what lies between the motor and the pad.

Sources: R. H. Thornley, R. Connolly, M. M. Barash and F. Koenigsberger, The effect of surface topography upon the
static stiffness of machine tool joints, Int. J. Mach. Tool Des. Res. 5 (1965) 57; A. K. Chopra and S. C.-S. Yim,
Simplified earthquake analysis of structures with foundation uplift, J. Struct. Eng. 111 (1985) 906; D. Tabor, The
Hardness of Metals (1951), of flanks that are dented; P. J. Phlips, A. R. Schamel and J. Meyer, An efficient model for
valvetrain and spring dynamics, SAE 890619 (1989), of clearances that hold oil; C. M. van Wyk, Note on the
compressibility of wool, J. Text. Inst. 37 (1946) T285; H. Eyring, Viscosity, plasticity, and diffusion as examples of
absolute reaction rates, J. Chem. Phys. 4 (1936) 283, and A. Schallamach, A theory of dynamic rubber friction, Wear 6
(1963) 375; A. Majumdar and B. Bhushan, Role of fractal geometry in roughness characterization and contact mechanics of
surfaces, J. Tribol. 112 (1990) 205; J. R. Rice, Heating and weakening of faults during earthquake slip, J. Geophys.
Res. 111 (2006) B05311; J. P. Den Hartog, Forced vibrations with combined Coulomb and viscous friction, Trans. ASME 53
(1931) 107; G. G. Stokes, On the effect of the internal friction of fluids on the motion of pendulums, Trans. Camb.
Phil. Soc. 9 (1851) 8; H. Ohta and E. Hayashi, Vibration of linear guideway type recirculating linear ball bearings, J.
Sound Vib. 235 (2000) 847; K. Ohnishi, M. Shibata and T. Murakami, Motion control for advanced mechatronics, IEEE/ASME
Trans. Mechatron. 1 (1996) 56; T. Emura and L. Wang, A high-resolution interpolator for incremental encoders based on
the quadrature PLL method, IEEE Trans. Ind. Electron. 47 (2000) 84; J. Ni, CNC machine accuracy enhancement through
real-time error compensation, J. Manuf. Sci. Eng. 119 (1997) 717.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numba import njit

from ..laws import Law, _Tabulated
from .eighth_machine import _modes, _yields
from .outside_bench import _child
from .registry import Build, judge_shapes, spread
from .sensor import first_order
from .sixth_machine import _strokes
from .third_machine import _sliding, _worn


def _lifts(load: np.ndarray) -> np.ndarray:
    """Rotation of a foot on a bed of springs, both over those at which it begins to lift: 4/(3 − M)² beyond 1.

    Beyond 2 straight on.
    """
    lifted = 4 / (3 - np.clip(load, 1.0, 2.0)) ** 2 + 8 * np.maximum(load - 2, 0.0)
    return np.where(load < 1, load, lifted)


@judge_shapes("frame_compliance", "beds_in", "base_lifts")
def frame_compliance(build: Build, shape: str, size: float) -> dict[str, float]:
    """A new joint is pressed flat, for good, by the greatest force so far; or a base lifts from its bed at one edge.

    `beds_in`: d = C ((1 − s/2) F + s p), s of 0.2 to 0.4, p ∝ 1 − e^{−max F/f} and as much as F at 0.6 of the greatest
    force, f of 0.3 to 0.8 of it; stated is the middle of the first secant there and of what springs back. `base_lifts`:
    0.3 to 0.5 of it, from 0.6 to 0.8 of the greatest force on; stated is the secant at 0.6 of that.
    """
    rng, compliance, at = build.rng, size * spread(build.rng, 0.005, 0.02), 0.6 * build.force_N
    flat, worked = float(rng.uniform(0.2, 0.4)), build.force_N * float(rng.uniform(0.3, 0.8))
    share, begins = float(rng.uniform(0.3, 0.5)), build.force_N * float(rng.uniform(0.6, 0.8))

    def given(t, force):
        if shape == "beds_in":
            most = np.maximum.accumulate(np.maximum(force, 0.0))
            pressed = at * np.expm1(-most / worked) / np.expm1(-at / worked)
            return compliance * ((1 - flat / 2) * force + flat * pressed)
        return compliance * ((1 - share) * force + share * begins * _lifts(force / begins))

    _yields(build, compliance, given)
    return {"compliance": compliance}


@njit(cache=True)
def _leaks(x, h, gap, tau):
    """Behind a play full of oil: what is lost goes to 0 on the way in and to `gap` on the way out, by time alone."""
    y, lost, end, kept = x.copy(), 0.0, 0.0, np.exp(-h / tau)
    for k in range(1, x.shape[0]):
        dx = x[k] - x[k - 1]
        if abs(dx) > 1e-9:
            end = 0.0 if dx > 0 else gap
        lost = end + (lost - end) * kept
        y[k] = x[k] + lost
    return y


@judge_shapes("backlash", "brinelled", "oil_filled")
def backlash(build: Build, shape: str, size: float) -> dict[str, float]:
    """The load dents the flanks, for good; or oil in the play has to leak past, which takes time and not way.

    `brinelled`: from 0.4 to 0.6 of it to all of it, with the greatest load so far, which is stated. `oil_filled`: by
    e^{−t/τ} after each turn, at rest too; τ of 20 to 80 ms.
    """
    rng, law, most = build.rng, build.plant.pad.law, build.force_N
    gap, new, tau = 0.02 * size * spread(rng, 0.7, 1.4), float(rng.uniform(0.4, 0.6)), spread(rng, 0.02, 0.08)

    def play(t, x):
        if shape == "oil_filled":
            return _leaks(x, t[1] - t[0], gap, tau)
        borne = np.maximum.accumulate(np.clip(law.force(x) / most, 0.0, 1.0))
        return _worn(x, gap * (new + (1 - new) * borne))

    build.plant.play.append(play)
    return {"gap": gap}


@dataclass(frozen=True)
class Piled(_Tabulated):
    """A law in series with a pile of fibres, F = f ((h_0/h)³ − 1): δ = δ_F + h_0 (1 − (1 + F/f)^{−1/3})."""

    name: ClassVar[str] = "piled"
    law: Law
    height: float
    first: float

    def given(self, force_N: np.ndarray | float) -> np.ndarray:
        """By how much the pile is pressed together, mm."""
        return self.height * (1 - (1 + np.asarray(force_N) / self.first) ** (-1 / 3))

    def force(self, depth_mm: np.ndarray | float) -> np.ndarray:
        depth = np.asarray(depth_mm, dtype=float)
        pressed = max(float(np.max(depth)), 1e-9) * np.linspace(0, 1, 20_001) ** 2
        force = self.law.force(pressed)
        return np.interp(depth, pressed + self.given(force), force)

    def parameters(self) -> dict[str, float]:
        return self.law.parameters() | {"height": self.height, "first": self.first}

    def model(self, depth_mm: float) -> dict[str, Any]:
        return self.law.model(depth_mm)


@judge_shapes("contact_offset", "pile")
def contact_offset(build: Build, shape: str, size: float) -> dict[str, float]:
    """The surface lies elsewhere and bears a pile of fibres, of up to 20 µm, which is pressed together by the load.

    To half its height at 2 to 14 % of the greatest; stated is the surface under the greatest force.
    """
    rng = build.rng
    offset = float(rng.choice([-1.0, 1.0])) * 0.05 * size * spread(rng, 0.7, 1.4)
    law = Piled(build.plant.pad.law, min(0.3 * abs(offset), 0.02), build.force_N * spread(rng, 0.003, 0.02))
    build.plant.pad = replace(build.plant.pad, law=law)
    build.plant.numbers["offset_mm"] = offset - float(law.given(build.force_N))
    return {"offset": offset}


@njit(cache=True)
def _bonds(x, h, length, slow, scale):
    """s' = (v − u sinh(s/σ))/ℓ; of w = e^{s/σ} a Riccati equation, exact for an even speed."""
    out, w = np.zeros(x.shape[0]), 1.0
    for k in range(1, x.shape[0]):
        v, side = (x[k] - x[k - 1]) / h, 1.0
        if v < 0:
            v, side, w = -v, -1.0, 1 / w
        root = np.sqrt(v * v + slow * slow)
        high, low = (v + root) / slow, -slow / (v + root)
        q = (w - high) / (w - low) * np.exp(-root * h / (length * scale))
        w = low + (high - low) / (1 - q)
        if side < 0:
            w = 1 / w
        out[k] = scale * np.log(w)
    return out


def _landscape(x: np.ndarray, depth_mm: float, phases: np.ndarray) -> np.ndarray:
    """Σ sin(2π k x/L + φ_k)/k with a mean square of 1 over L."""
    k = np.arange(1, len(phases) + 1)
    out = np.zeros_like(x)
    for number, phase in zip(k, phases, strict=True):
        out += np.sin(2 * np.pi * number * x / depth_mm + phase) / number
    return out * np.sqrt(2 / np.sum(1 / k**2))


@judge_shapes("friction", "creeping_bonds", "rough_track", "flash_heat")
def friction(build: Build, shape: str, size: float) -> dict[str, float]:
    """Bonds that let go by themselves, the sooner the harder they are pulled; a rough track; or spots that melt.

    `creeping_bonds`: s' = (v − u sinh(s/σ))/ℓ, u of 1 to 100 nm/s and ℓ of 2 to 6 µm, so that it fades by the
    logarithm of time at rest; stated is that of a steady 10 mm/s. `rough_track`: 24 waves as 1/k over the depths, each
    way others, by 0.15 to 0.28 in the mean square; stated is the mean over the depths. `flash_heat`: f + (1 − f) v_w/v
    beyond v_w of 4 to 15 mm/s, f of 0.35 to 0.6; stated is that of slow moves.
    """
    rng, coulomb, depth = build.rng, 0.05 * size * spread(build.rng, 0.7, 1.6), build.depth_mm
    presliding, length, slow = 1e-3 * spread(rng, 0.6, 1.6), spread(rng, 0.002, 0.006), spread(rng, 1e-6, 1e-4)
    rough, phases = float(rng.uniform(0.15, 0.28)), _child(rng).uniform(0, 2 * np.pi, (2, 24))
    weak, melts = float(rng.uniform(0.35, 0.6)), spread(rng, 4.0, 15.0)
    scale = 1 / np.arcsinh(10 / slow)

    def act(t, x, v, a):
        if shape == "creeping_bonds":
            return coulomb * _bonds(x, t[1] - t[0], length, slow, scale)
        if shape == "rough_track":
            forth, back = (1 + rough * _landscape(x, depth, part) for part in phases)
            return coulomb * _sliding(x, presliding, np.maximum(forth, 0.05), np.maximum(back, 0.05))
        level = weak + (1 - weak) * melts / np.maximum(np.abs(v), melts)
        return coulomb * _sliding(x, presliding, level, level)

    build.plant.felt.append(act)
    return {"coulomb": coulomb}


@njit(cache=True)
def _dry(a, h, omega, rubs):
    """a + r'' of a mass on a spring that dry friction holds: r'' = −a − ω² r ∓ μ as it slides, and r' = 0 as it sticks.

    Exact for an even a; it stops where it turns, and is let go of in the next step at the soonest.
    """
    out, r, v = a.copy(), 0.0, 0.0
    cosine, sine = np.cos(omega * h), np.sin(omega * h)
    for k in range(1, a.shape[0]):
        pull = -a[k] - omega * omega * r
        if v == 0 and abs(pull) <= rubs:
            continue
        side = np.sign(v) if v != 0 else np.sign(pull)
        rests = -(a[k] + side * rubs) / (omega * omega)
        off, was = r - rests, v
        r, v = rests + off * cosine + v / omega * sine, v * cosine - off * omega * sine
        if v * side <= 0:
            r, v = rests + side * np.sqrt(off * off + was * was / (omega * omega)), 0.0
        out[k] = a[k] + (v - was) / h
    return out


@judge_shapes("inertia", "dry_mount", "liquid_inside")
def inertia(build: Build, shape: str, size: float) -> dict[str, float]:
    """A part on a spring that dry friction holds, and that swings once it is let go; or a layer of liquid inside.

    `dry_mount`: half to four fifths of it, 30 to 70 Hz, held up to 0.08 to 0.2 of the greatest acceleration.
    `liquid_inside`: as much, which its wall drags along: tanh √(s τ)/√(s τ), τ = H²/ν of 30 to 150 ms. Stated is that
    of slow moves.
    """
    rng, mass = build.rng, size * spread(build.rng, 0.05, 0.3)
    share, mount_Hz, holds = float(rng.uniform(0.5, 0.8)), spread(rng, 30.0, 70.0), float(rng.uniform(0.08, 0.2))
    tau, odd = spread(rng, 0.03, 0.15), 2 * np.arange(16.0) + 1

    def act(t, x, v, a):
        h = float(t[1] - t[0])
        if shape == "dry_mount":
            moved = _dry(a, h, 2 * np.pi * mount_Hz, holds * max(float(np.max(np.abs(a))), 1.0))
        else:
            # Modes of 8/(n π)² with rates of (n π)²/4τ, n odd; what is quicker is at once.
            moved = _modes(a, h, (odd * np.pi) ** 2 / (4 * tau), np.full(16, 2 / tau))
            moved = moved + (1 - np.sum(8 / (odd * np.pi) ** 2)) * a
        return 1e-3 * mass * ((1 - share) * a + share * moved)

    build.plant.felt.append(act)
    return {"mass": mass}


def _slipped(x: np.ndarray, jumps: np.ndarray, within_mm: float) -> np.ndarray:
    """Sum of one of `jumps` for each turn so far, each of which comes evenly over a way after its turn."""
    way, turns = np.cumsum(np.abs(np.diff(x, prepend=x[0]))), _strokes(x)
    out = np.zeros_like(x)
    for at, jump in zip(way[np.flatnonzero(np.diff(turns, prepend=0) > 0)], np.resize(jumps, turns[-1]), strict=True):
        out += jump * np.clip((way - at) / within_mm, 0.0, 1.0)
    return out


@judge_shapes("cogging", "cage_slips", "observer")
def cogging(build: Build, shape: str, size: float) -> dict[str, float]:
    """A cage of balls that slips as it turns round, and the phase with it; or an observer in the drive that learns it.

    `cage_slips`: by 0.3 to 0.8 rad in the mean square, within 0.1 mm. `observer`: it takes off 0.5 to 0.8 of what there
    is, late by a first order of 20 to 120 ms, so that holds see less; stated is that of quick moves.
    """
    rng = build.rng
    amplitude = 0.05 * size * spread(rng, 0.7, 1.6)
    period = min(float(rng.uniform(2.0, 5.0)), (build.depth_mm + 0.5) / 0.7)
    phase, takes, late_s = float(rng.uniform(0, 2 * np.pi)), float(rng.uniform(0.5, 0.8)), spread(rng, 0.02, 0.12)
    jumps = spread(rng, 0.3, 0.8) * _child(rng).uniform(-np.sqrt(3.0), np.sqrt(3.0), 512)

    def act(t, x, v, a):
        angle = 2 * np.pi * x / period + phase
        if shape == "cage_slips":
            return amplitude * np.sin(angle + _slipped(x, jumps, 0.1))
        return amplitude * (np.sin(angle) - takes * first_order(t, np.sin(angle), late_s))

    build.plant.felt.append(act)
    return {"amplitude": amplitude, "period": period}


@judge_shapes("encoder_error", "past_cutoff", "corrected_late")
def encoder_error(build: Build, shape: str, size: float) -> dict[str, float]:
    """Signals that get smaller with speed, and their offset does not; or a map that is looked up now and then.

    `past_cutoff`: arctan of sin θ + o g and cos θ, less θ, g = √(1 + (v/v_c)²), 1.6 to 3 at the greatest speed; stated
    is that at rest. `corrected_late`: 0.3 to 0.5 of the error is taken off, as it was at the last tick of 8 to 25 ms;
    stated is what is left at rest.
    """
    rng, motion = build.rng, build.plant.motion
    amplitude, period = 0.01 * size * spread(rng, 0.7, 1.4), spread(rng, 0.7, 1.5)
    phase, grows, tick_s = float(rng.uniform(0, 2 * np.pi)), float(rng.uniform(1.6, 3.0)), spread(rng, 0.008, 0.025)
    corrects, offset = float(rng.uniform(0.3, 0.5)), 2 * np.pi * amplitude / period
    quickest = float(np.max(np.abs(motion.velocity(np.arange(0.0, motion.duration_s, 1e-3)))))
    cutoff = max(quickest, 1e-3) / np.sqrt(grows**2 - 1)

    def error(t, x):
        angle = 2 * np.pi * x / period + phase
        if shape == "corrected_late":
            before = np.interp(np.floor(t / tick_s) * tick_s, t, x)
            there = np.sin(2 * np.pi * before / period + phase)
            return amplitude * (np.sin(angle) - corrects * there) / (1 - corrects)
        larger = np.minimum(offset * np.sqrt(1 + (np.gradient(x, t) / cutoff) ** 2), 0.95)
        # The arc of a circle whose middle is off by that: arctan(o cos θ/(1 + o sin θ)).
        return period / (2 * np.pi) * np.arctan2(larger * np.cos(angle), 1 + larger * np.sin(angle))

    build.plant.encoder.append(lambda t, x: x + error(t, x))
    return {"amplitude": amplitude, "period": period}
