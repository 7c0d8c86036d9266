"""Shapes of the pad's own effects.

Sources: rubber bonds that have failed over a part of their area (ASTM D429, Gent and Hamed 1983); threads of polymer
that thin by elasticity and capillarity (Bazilevskii et al. 1990, Anna and McKinley 2001) and adhesives that lose their
tack to dust (Hansen and Autumn 2005); compressible foams (Hill 1978, Storåkers 1986) and laminates of a soft and a
firm layer in series; softening by the stress that was reached (Johnson and Beatty 1993) and reloading that meets the
virgin curve beyond the old extreme (Diani, Fayolle and Gilormini 2009); cracks that must first nucleate (Mars and
Fatemi 2002) and fretting by the way in either direction (Archard 1953); compression by the logarithm of the load (the
oedometer: Terzaghi and Peck 1948) and brittle cores that crush at once (Gibson and Ashby 1997); the spectrum of
Havriliak and Negami (1967) and pads of two materials, each with a time of its own; the strain under a sphere, which
goes with the radius of contact (Tabor, The Hardness of Metals), and structure that follows late (Kovacs 1963); foams
whose stress goes with the logarithm of the rate (Nagy, Ko and Lindholm 1974, Johnson and Cook 1983) and hydraulic
stops (Dixon, The Shock Absorber Handbook).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numba import njit
from scipy.optimize import brentq

from ..laws import Law, _Tabulated
from .curves import stretched
from .modes import add_modes, drawn_mode
from .plant import simulate
from .registry import Build, more_shapes, spread
from .structure import hide_law
from .third_outside_bench import _fades


def _felt(build: Build, force: Callable[[np.ndarray], np.ndarray]) -> None:
    """Add `force(t)` in N at the probe, which may ask `_pad_alone`: what it asks for is without this force."""
    asking = []

    def act(t, x, v, a):
        if asking:
            return np.zeros_like(t)
        asking.append(True)
        pull = force(t)
        asking.clear()
        return pull

    build.plant.felt.append(act)


def _pad_alone(build: Build, t: np.ndarray, **numbers: Any) -> np.ndarray:
    """The pad's force in N in the same plant, with other numbers for the kernel."""
    plant = build.plant
    return simulate(replace(plant, numbers=plant.numbers | numbers, sensor=[]), float(t[1] - t[0])).pad_N


@more_shapes("separation", "partly")
def separation(build: Build, shape: str, size: float) -> dict[str, float]:
    """The lab believes `bonded`. A twentieth of the surface is still glued and pulls as it would; the rest lets go."""
    build.believed = replace(build.believed, contact="bonded")

    def pull(t):
        free, held = (_pad_alone(build, t, adhesion_form=0, unilateral=kind) for kind in (True, False))
        return 0.05 * size * (held - free)

    _felt(build, pull)
    return {}


def _gap(build: Build, t: np.ndarray) -> np.ndarray:
    """Way in mm from the surface, which comes back as it relaxes, to the probe: read off a pull of e^{−gap} nN."""
    force = _pad_alone(build, t, adhesion_form=1, pull_off_N=1e-9, adhesion_mm=1.0)
    force[0] = force[1]  # the kernel begins with the first step
    return np.where(force < 0, -np.log(np.clip(-force / 1e-9, 1e-300, 1.0)), 0.0)


@more_shapes("adhesion", "thread", "fouls")
def adhesion(build: Build, shape: str, size: float) -> dict[str, float]:
    """A thread that thins with the time since it was drawn; or a neck that bears less from touch to touch.

    `thread`: P (1 − e^{−10 g/range}) e^{−s/τ} after s, τ of 5 to 20 ms, until it breaks at the range. `fouls`:
    P sin(π g/2 range), less by 8 to 20 % for each touch before; stated is P of the first.
    """
    pull_off, reach = 0.1 * size * spread(build.rng, 0.7, 1.5), 0.05 * spread(build.rng, 0.6, 1.6)
    thins_s, keeps = spread(build.rng, 0.005, 0.02), float(build.rng.uniform(0.8, 0.92))

    def pull(t):
        gap, at = _gap(build, t), np.arange(len(t))
        met, far = (np.maximum.accumulate(np.where(so, at, -1)) for so in (gap == 0, gap > reach))
        holds = met > far
        drawn = np.where(holds, gap / reach, 0.0)
        if shape == "thread":
            return pull_off * np.expm1(-10 * drawn) * np.exp(-(t - t[np.maximum(met, 0)]) / thins_s)
        touches = np.cumsum(np.diff(holds.astype(int), prepend=0) > 0)
        return -pull_off * keeps ** np.maximum(touches - 1, 0) * np.sin(np.pi / 2 * drawn)

    _felt(build, pull)
    return {"pull_off": pull_off, "range": reach}


@dataclass(frozen=True)
class HyperFoam(_Tabulated):
    """A block of thickness H of a foam that does not bulge: F = A (λ^{−1} − λ^{α − 1}), λ = 1 − δ/H."""

    name: ClassVar[str] = "hyperfoam"
    modulus: float
    exponent: float
    thickness: float

    def curve(self, depth_mm: np.ndarray) -> np.ndarray:
        stretch = stretched(depth_mm, self.thickness)
        return self.modulus * (1 / stretch - stretch ** (self.exponent - 1))


@dataclass(frozen=True)
class Laminate(_Tabulated):
    """A soft layer of thickness h that locks, on a spring r times as stiff: δ/h = f/(1 + f) + f/r, F = A f."""

    name: ClassVar[str] = "laminate"
    modulus: float
    firmer: float
    thickness: float

    def curve(self, depth_mm: np.ndarray) -> np.ndarray:
        wanted = self.firmer * depth_mm / self.thickness
        b = 1 + self.firmer - wanted  # f² + b f = r δ/h
        return self.modulus * 2 * wanted / (b + np.sqrt(b**2 + 4 * wanted))


@more_shapes("elastic_law", "hyperfoam", "laminate")
def elastic_law(build: Build, shape: str, size: float) -> dict[str, Any]:
    """The true law is that of the name; the believed one is fitted to it. Sizes but 1 lie between (or beyond) both."""
    rng, depth = build.rng, build.depth_mm
    strain, exponent = float(rng.uniform(0.45, 0.65)), float(rng.uniform(6.0, 14.0))
    firmer, part = float(rng.uniform(5.0, 12.0)), float(rng.uniform(0.4, 0.7))
    foam: Law = HyperFoam(1.0, exponent, depth / strain)
    other = foam if shape == "hyperfoam" else Laminate(1.0, firmer, part * depth)
    other = other.with_parameters({"modulus": build.force_N / float(other.force(depth))})
    return hide_law(build, shape, other, size)


@njit(cache=True)
def _short_of(x, more, way):
    """Way to where the virgin curve is met again: `more` beyond the deepest, after a `way` back."""
    out, deepest, moved = np.zeros(x.shape[0]), 0.0, 0.0
    for k in range(1, x.shape[0]):
        moved = min(moved + max(x[k - 1] - x[k], 0.0) / way, 1.0)
        met = deepest * (1 + more * moved)
        if x[k] >= met:
            deepest = met = x[k]
            moved = 0.0
        out[k] = met - x[k]
    return out


@more_shapes("stress_softening", "by_force", "rejoins_late")
def stress_softening(build: Build, shape: str, size: float) -> dict[str, float]:
    """η = 1 − s (1 − e^{−(F_max − F^e)/f}), f the force of the last `depth` mm; or 1 − s (1 − e^{−(M − δ)/d}).

    `rejoins_late`: M is the deepest point, and 5 to 12 % more once it has gone back by a twentieth of the depth.
    """
    rng, deepest = build.rng, build.depth_mm
    share, depth = min(0.15 * size * spread(rng, 0.7, 1.4), 0.6), 0.5 * spread(rng, 0.6, 1.6)
    more, above = float(rng.uniform(0.05, 0.12)), deepest - min(depth, 0.8 * deepest)

    def gain(t, x):
        if shape == "rejoins_late":
            return 1 + share * np.expm1(-_short_of(np.maximum(x, 0.0), more, 0.05 * deepest) / depth)
        force, (whole, before) = (build.plant.pad.law.force(at) for at in (x, np.array([deepest, above])))
        return 1 + share * np.expm1((force - np.maximum.accumulate(force)) / (whole - before))

    build.plant.gain.append(gain)
    return {"share": share, "depth": depth}


@more_shapes("damage", "incubates", "either_way")
def damage(build: Build, shape: str, size: float) -> dict[str, float]:
    """e^{−r Λ}: Λ = λ − ℓ (1 − e^{−λ/ℓ}), which must first get going; or half of all way in contact, in and out.

    `incubates`: ℓ of 0.7 to 2 depths; stated is the rate in the end.
    """
    rng, rate = build.rng, 0.01 * size * spread(build.rng, 0.6, 1.6)
    length = build.depth_mm * float(rng.uniform(0.7, 2.0))

    def gain(t, x):
        way = np.diff(np.maximum(x, 0.0), prepend=max(x[0], 0.0))
        if shape == "either_way":
            return np.exp(-rate / 2 * np.cumsum(np.abs(way)))
        path = np.cumsum(np.maximum(way, 0.0))
        return np.exp(-rate * (path + length * np.expm1(-path / length)))

    build.plant.gain.append(gain)
    return {"rate": rate}


@more_shapes("permanent_set", "log_load", "core_crushes")
def permanent_set(build: Build, shape: str, size: float) -> dict[str, float]:
    """It goes with ln(1 + F_max/F_0), F_0 of 4 to 10 % of the greatest force; or a brittle core crushes, once.

    `core_crushes`: at 0.35 to 0.65 of the greatest depth, within a tenth of it. Stated is the mean over the way there.
    """
    rng, rate = build.rng, min(0.03 * size * spread(build.rng, 0.7, 1.4), 0.3)
    part, begins, depth = float(rng.uniform(0.04, 0.1)), float(rng.uniform(0.35, 0.65)), build.depth_mm
    within, most = 0.07 + rate, build.force_N  # never sinks faster than it is pressed

    def height(t, x):
        deepest = np.maximum.accumulate(np.maximum(x, 0.0))
        if shape == "core_crushes":
            return rate * depth * np.clip((deepest / depth - begins) / within, 0.0, 1.0)
        return rate * depth * np.log1p(build.plant.pad.law.force(deepest) / most / part) / np.log1p(1 / part)

    build.plant.height.append(height)
    return {"set": rate}


def havriliak_negami(rate: float, alpha: float, beta: float) -> tuple[np.ndarray, np.ndarray]:
    """Shares and rates, three a decade, of 1/(1 + (i ω τ)^α)^β; 1/e of it is left at 1/rate.

    By ln y, y being times over τ: y^{αβ} sin βθ/(π (1 + 2 y^α cos πα + y^{2α})^{β/2}), θ the angle of y^α + e^{iπα}.
    """
    y = 10 ** (np.arange(5.0, -9.0, -1.0) / 3)
    raised = y**alpha + np.exp(1j * np.pi * alpha)
    weights = y ** (alpha * beta) * np.sin(beta * np.angle(raised)) / np.abs(raised) ** beta
    # What lies beyond goes with y^{−α} and y^{αβ}, and into the last at either end.
    ends, step = np.array([alpha, alpha * beta]), np.log(10.0) / 3
    weights[[0, -1]] *= 1 + np.exp(-ends * step / 2) / (ends * step)
    weights /= weights.sum()
    unit = brentq(lambda s: float(weights @ np.exp(-s / y)) - np.exp(-1.0), 1e-3, 1e2)
    return weights, rate * unit / y


@more_shapes("missing_relaxation_mode", "havriliak_negami", "two_materials")
def missing_relaxation_mode(build: Build, shape: str, size: float) -> dict[str, float]:
    """A spectrum that is skewed and broad, 1/e of it left at 1/rate; or two modes 10 to 30 apart, about the rate.

    `havriliak_negami`: α of 0.75 to 0.9, β of 0.4 to 0.7. `two_materials`: the quicker has 0.4 to 0.6 of the share.
    """
    rng, (share, rate) = build.rng, drawn_mode(build, size, 0.3, 15.0)
    alpha, beta = float(rng.uniform(0.75, 0.9)), float(rng.uniform(0.4, 0.7))
    ratio, first = spread(rng, 10.0, 30.0), float(rng.uniform(0.4, 0.6))
    weights, rates = np.array([first, 1 - first]), rate * ratio ** np.array([0.5, -0.5])
    if shape == "havriliak_negami":
        weights, rates = havriliak_negami(rate, alpha, beta)
    add_modes(build, share, weights, rates)
    return {"share": share, "rate": rate}


@more_shapes("depth_dependent_relaxation", "contact_strain", "lags_behind")
def depth_dependent_relaxation(build: Build, shape: str, size: float) -> dict[str, float]:
    """ν (1 + s √(δ δ_ref)), by the strain under a sphere, δ_ref the greatest depth; or 1 + s δ, but some time late.

    `lags_behind`: first-order, within 0.2 to 1 s. Stated is the mean slope from the surface to the greatest depth.
    """
    rng, deepest = build.rng, build.depth_mm
    slope = size * float(rng.uniform(0.1, 0.3) if rng.random() < 0.6 else rng.uniform(-0.2, -0.1))
    slope, late_s = max(slope, -0.8 / deepest), spread(rng, 0.2, 1.0)

    def factor(t, x):
        inner = np.maximum(x, 0.0)
        felt = np.sqrt(inner * deepest) if shape == "contact_strain" else _fades(inner, t[1] - t[0], late_s)
        # In steps of 0.1 %: each change costs the kernel new exponentials.
        return np.round(np.maximum(1 + slope * felt, 0.1), 3)

    build.plant.rate_factor.append(factor)
    return {"slope": slope}


@njit(cache=True)
def _unrelaxed(wanted, inside, h, c, nu):
    """What to add to the elastic force u so that F = u − Σ c z, z' = ν (u − z), has `wanted` more; none in air."""
    out, z, before = np.zeros(wanted.shape[0]), np.zeros(c.shape[0]), 0.0
    e = np.exp(-nu * h)
    k = (1 - e) / (nu * h)
    held = 1 - np.sum(c * (1 - k))
    for j in range(1, wanted.shape[0]):
        rest = before * k + (z - before) * e
        out[j] = (wanted[j] + np.sum(c * rest)) / held if inside[j] else 0.0
        z = out[j] * (1 - k) + rest
        before = out[j]
    return out


def _damped(build: Build, force: Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]) -> None:
    """Add `force(depth, speed, u)` in N while the probe is below the surface; near it no more than 3 times u."""

    def gain(t, x):
        pad, h, depth = build.plant.pad, float(t[1] - t[0]), np.maximum(x, 0.0)
        u, c, nu = pad.law.force(depth), np.array(pad.shares), np.array(pad.rates)
        inside, speed = u > 1e-9, np.diff(depth, prepend=depth[0]) / h
        added = _unrelaxed(force(depth, speed, u), inside, h, c, nu)
        return 1 + np.clip(added / np.where(inside, u, 1.0), -0.95, 3.0)

    build.plant.gain.append(gain)


@more_shapes("viscous_damping", "log_rate", "inner_cell")
def viscous_damping(build: Build, shape: str, size: float) -> dict[str, float]:
    """F^e by the logarithm of speed, C ln(1 + |v|/v_0) more or less; or c v from where a cell of oil inside is met.

    `log_rate`: v_0 of 3 to 8 mm/s; stated is F/v at 20 mm/s and half the greatest depth. `inner_cell`: at 0.2 to 0.4 of
    the depth, all of it a tenth deeper.
    """
    rng, coefficient, deepest = build.rng, size * spread(build.rng, 0.005, 0.02), build.depth_mm
    slow, begins = spread(rng, 3.0, 8.0), float(rng.uniform(0.2, 0.4))

    def force(depth, speed, u):
        if shape == "inner_cell":
            return coefficient * speed * np.clip((depth / deepest - begins) / 0.1, 0.0, 1.0)
        share = np.sign(speed) * np.log1p(np.abs(speed) / slow) / np.log1p(20.0 / slow)
        return coefficient * 20.0 * share * u / float(build.plant.pad.law.force(deepest / 2))

    _damped(build, force)
    return {"coefficient": coefficient}
