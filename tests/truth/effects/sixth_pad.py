"""The sixth shapes of the pad's own effects. Those in which force and motion act on each other are forms of `kernel`.

Sources: oil that comes out of rubber and makes it tacky (Creton and Ciccotti 2016); bonds that take as much surface
as was pressed on (Bowden and Tabor, The Friction and Lubrication of Solids) and strands that break one by one (Gent
and Petrich 1969); chains of eight (Arruda and Boyce 1993) with their inverse Langevin function (Cohen 1991), and
tissue whose fibres are crimped (Fung, Biomechanics); the cycles of conditioning that filled rubber takes (Diani,
Fayolle and Gilormini 2009); bonds of two kinds (Ogden and Roxburgh's remark on weak and strong ones, 1999) and
tearing that goes with speed (Greensmith and Thomas 1955); cold flow by the logarithm of time (Findley, Lai and Onaran
1976) and crushing in bursts (Alava, Nukala and Zapperi 2006); gels under a sphere or a punch (Hu, Zhao, Vlassak and
Suo 2010), a wedge of relaxation times (Tobolsky 1960); paths of drainage that go with the radius of contact or the
thickness (Hu et al. 2010, Terzaghi 1925); damping in proportion to stiffness (Rayleigh, The Theory of Sound) and by
the square of speed, as of an orifice (Idelchik, Handbook of Hydraulic Resistance).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numba import njit
from scipy.optimize import brentq, nnls

from ..laws import Law, _Tabulated
from .curves import stretched
from .modes import add_modes, drawn_mode
from .outside_bench import _child
from .registry import Build, more_shapes, spread
from .structure import hide_law


@more_shapes("separation", "blooms")
def separation(build: Build, shape: str, size: float) -> dict[str, float]:
    """The lab believes `bonded`. What blooms out bears 0.5 % of the greatest force, and a tenth more each next time."""
    build.believed = replace(build.believed, contact="bonded")
    build.plant.numbers.update(stick_N=0.005 * min(size, 2.0) * build.force_N, stick_keeps=1.1)
    return {}


@more_shapes("adhesion", "by_depth", "strands")
def adhesion(build: Build, shape: str, size: float) -> dict[str, float]:
    """A neck that bears as much of P as it was pressed down; or four strands alike, which break one by one.

    `by_depth`: all of P from 0.7 to all of the greatest depth on. `strands`: each a spring from the surface
    on, which breaks at 0.4, 0.6, 0.8 and all of the range; P is the most that they bear.
    """
    pull_off, reach = 0.1 * size * spread(build.rng, 0.7, 1.5), 0.05 * spread(build.rng, 0.6, 1.6)
    whole = build.depth_mm * float(build.rng.uniform(0.7, 1.0))
    form = 11 if shape == "by_depth" else 12
    build.plant.numbers.update(adhesion_form=form, pull_off_N=pull_off, adhesion_mm=reach, adhesion_depth_mm=whole)
    return {"pull_off": pull_off, "range": reach}


@dataclass(frozen=True)
class ArrudaBoyce(_Tabulated):
    """A block of thickness H of chains of eight: F = A (λ^{−2} − λ) L^{−1}(r)/3r, r² = I/(3 L_m²), I = λ² + 2/λ.

    L^{−1}(r) = r (3 − r²)/(1 − r²).
    """

    name: ClassVar[str] = "arruda_boyce"
    modulus: float
    locks: float
    thickness: float

    def curve(self, depth_mm: np.ndarray) -> np.ndarray:
        stretch = stretched(depth_mm, self.thickness)
        used = np.minimum((stretch**2 + 2 / stretch) / (3 * self.locks**2), 0.97)
        return self.modulus * (stretch**-2 - stretch) * (3 - used) / (3 * (1 - used))


@dataclass(frozen=True)
class Toe(_Tabulated):
    """Crimped fibres straighten within d, then bear like springs: F = A (√(δ² + d²) − d)."""

    name: ClassVar[str] = "toe"
    modulus: float
    scale: float

    def curve(self, depth_mm: np.ndarray) -> np.ndarray:
        return self.modulus * (np.hypot(depth_mm, self.scale) - self.scale)


@more_shapes("elastic_law", "arruda_boyce", "toe")
def elastic_law(build: Build, shape: str, size: float) -> dict[str, Any]:
    """The true law is that of the name; the believed one is fitted to it. Sizes but 1 lie between (or beyond) both."""
    rng, depth = build.rng, build.depth_mm
    strain, used, crimp = float(rng.uniform(0.4, 0.55)), float(rng.uniform(0.75, 0.9)), float(rng.uniform(0.1, 0.25))
    left = 1 - strain
    # At the greatest depth the chains are at `used` of their length, squared.
    locks = np.sqrt((left**2 + 2 / left) / (3 * used))
    other: Law = ArrudaBoyce(1.0, float(locks), depth / strain) if shape == "arruda_boyce" else Toe(1.0, crimp * depth)
    other = other.with_parameters({"modulus": build.force_N / float(other.force(depth))})
    return hide_law(build, shape, other, size)


@njit(cache=True)
def _visits(x):
    """How often the probe has come near the deepest point so far, 0.9 of it, from half of it or less."""
    out, deepest, count, away = np.ones(x.shape[0]), 0.0, 1.0, False
    for k in range(1, x.shape[0]):
        if x[k] < 0.5 * deepest:
            away = True
        elif away and x[k] > 0.9 * deepest:
            away, count = False, count + 1
        deepest = max(deepest, x[k])
        out[k] = count
    return out


@more_shapes("stress_softening", "gaussian", "conditioning")
def stress_softening(build: Build, shape: str, size: float) -> dict[str, float]:
    """η = 1 − s (1 − e^{−q²}), q = (δ_max − δ)/d; or 1 − s_N (1 − e^{−q}), which takes some cycles to be whole.

    `conditioning`: s_N = s (1 − 0.4 e^{−(N−1)/1.5}), N how often it was near δ_max; stated is s.
    """
    share, depth = min(0.15 * size * spread(build.rng, 0.7, 1.4), 0.6), 0.5 * spread(build.rng, 0.6, 1.6)

    def gain(t, x):
        inner = np.maximum(x, 0.0)
        below = (np.maximum.accumulate(inner) - inner) / depth
        if shape == "gaussian":
            return 1 + share * np.expm1(-(below**2))
        # Counted as it goes up again, so that a cycle shows from the next one on.
        return 1 + share * (1 - 0.4 * np.exp(-(_visits(x) - 1) / 1.5)) * np.expm1(-below)

    build.plant.gain.append(gain)
    return {"share": share, "depth": depth}


@more_shapes("damage", "two_kinds", "by_speed")
def damage(build: Build, shape: str, size: float) -> dict[str, float]:
    """A third of the bonds is weak and breaks four times as soon as the rest; or e^{−r Λ}, which costs more at speed.

    `two_kinds`: r is the mean rate at first. `by_speed`: Λ = ∫ (v/v_ref)^p dλ, p of 0.15 to 0.3, r at 20 mm/s.
    """
    rate, power = 0.01 * size * spread(build.rng, 0.6, 1.6), float(build.rng.uniform(0.15, 0.3))

    def gain(t, x):
        way = np.maximum(np.diff(np.maximum(x, 0.0), prepend=max(x[0], 0.0)), 0.0)
        if shape == "by_speed":
            return np.exp(-rate * np.cumsum(way * (way / (t[1] - t[0]) / 20.0) ** power))
        path = np.cumsum(way)
        # A third at 4 r/2 and two thirds at r/2.
        return np.exp(-2 * rate * path) / 3 + 2 * np.exp(-rate * path / 2) / 3

    build.plant.gain.append(gain)
    return {"rate": rate}


@more_shapes("permanent_set", "cold_flow", "bursts")
def permanent_set(build: Build, shape: str, size: float) -> dict[str, float]:
    """It grows with the logarithm of the time under load; or with the depth in bursts of many sizes.

    `cold_flow`: s δ_max (1 + c ln(1 + T/1 s)), c of 0.05 to 0.12, T the time below half of δ_max; stated is that at
    once. `bursts`: exponential steps, twenty in the greatest depth; stated is the mean over the way there.
    """
    rng, rate = build.rng, min(0.03 * size * spread(build.rng, 0.7, 1.4), 0.3)
    flows, pitch, child = float(rng.uniform(0.05, 0.12)), build.depth_mm / 20, _child(rng)
    steps = np.cumsum(child.exponential(1.0, 60))
    # The mean of the first twenty is 1, and each takes its share of the way.
    steps = np.concatenate([[0.0], steps * 20 / steps[19]]) * pitch

    def height(t, x):
        deepest = np.maximum.accumulate(np.maximum(x, 0.0))
        if shape == "cold_flow":
            loaded = np.cumsum((x > 0.5 * deepest) & (x > 0)) * (t[1] - t[0])
            return rate * deepest * (1 + flows * np.log1p(loaded))
        whole, part = np.divmod(np.minimum(deepest / pitch, 59.0), 1.0)
        # Each comes within the first third of its part of the way.
        return rate * np.interp(whole + np.minimum(3 * part, 1.0), np.arange(len(steps)), steps)

    build.plant.height.append(height)
    return {"set": rate}


def fitted_rates(left: Callable[[np.ndarray], np.ndarray], rate: float) -> tuple[np.ndarray, np.ndarray]:
    """Shares and rates, three a decade, of a curve that goes from 1 to 0, over five decades about 1/rate."""
    t = np.concatenate([[0.0], np.geomspace(3e-3, 100, 300)]) / rate
    rates = rate * 10 ** np.arange(-1.0, 3.01, 1 / 3)
    weights, _ = nnls(np.exp(-np.outer(t, rates)), left(t))
    kept = weights > 1e-3
    return weights[kept] / weights[kept].sum(), rates[kept]


def gel(rate: float) -> Callable[[np.ndarray], np.ndarray]:
    """Water that leaves a gel under a sphere: 0.491 e^{−0.908 √s} + 0.509 e^{−1.679 s}, 1/e of it left at 1/rate."""

    def curve(s):
        return 0.491 * np.exp(-0.908 * np.sqrt(s)) + 0.509 * np.exp(-1.679 * s)

    unit = brentq(lambda s: float(curve(s)) - np.exp(-1.0), 1e-3, 10.0)
    return lambda t: curve(unit * rate * t)


def wedge_rates(rate: float, decades: float) -> tuple[np.ndarray, np.ndarray]:
    """Shares that go with 1/√τ by ln τ, four a decade from the longest time; 1/e of it left at 1/rate."""
    times = 10 ** -np.arange(0.0, decades + 0.01, 0.25)
    weights = times**-0.5 / np.sum(times**-0.5)
    longest = brentq(lambda s: float(weights @ np.exp(-1 / (s * times))) - np.exp(-1.0), 0.1, 1e4)
    return weights, rate / (longest * times)


@more_shapes("missing_relaxation_mode", "gel", "wedge")
def missing_relaxation_mode(build: Build, shape: str, size: float) -> dict[str, float]:
    """A gel's water, a root of time at first; or a wedge of times, over a decade to a decade and a half.

    Stated is where 1/e of it is left.
    """
    rng, (share, rate) = build.rng, drawn_mode(build, size, 0.2, 20.0)
    decades = float(rng.uniform(1.0, 1.5))
    weights, rates = fitted_rates(gel(rate), rate) if shape == "gel" else wedge_rates(rate, decades)
    add_modes(build, share, weights, rates)
    return {"share": share, "rate": rate}


@more_shapes("depth_dependent_relaxation", "contact_radius", "thinner_layer")
def depth_dependent_relaxation(build: Build, shape: str, size: float) -> dict[str, float]:
    """Water goes as far as the contact is wide, ν ∝ 1/(1 + a δ); or as the layer is thick, ν ∝ 1/(1 − δ/H)².

    Slower the deeper, or quicker; stated is the mean slope from the surface to the greatest depth.
    """
    rng, deepest = build.rng, build.depth_mm
    slope = size * (float(rng.uniform(-0.2, -0.1)) if shape == "contact_radius" else float(rng.uniform(0.1, 0.3)))
    slope = max(slope, -0.8 / deepest)
    # 1 + s δ at the greatest depth.
    whole = 1 + slope * deepest

    def factor(t, x):
        share = np.maximum(x, 0.0) / deepest
        if shape == "contact_radius":
            rates = 1 / (1 + share * (1 / whole - 1))
        else:
            rates = 1 / np.maximum(1 - share * (1 - 1 / np.sqrt(whole)), 0.2) ** 2
        # In steps of 0.1 %: each change costs the kernel new exponentials.
        return np.round(np.maximum(rates, 0.1), 3)

    build.plant.rate_factor.append(factor)
    return {"slope": slope}


@more_shapes("viscous_damping", "with_stiffness", "orifice")
def viscous_damping(build: Build, shape: str, size: float) -> dict[str, float]:
    """c v K(δ)/K(δ_ref), K the slope of the law and δ_ref half the greatest depth; or c |v| v/v_ref.

    v_ref is 20 mm/s.
    """
    coefficient, middle, h = size * spread(build.rng, 0.005, 0.02), build.depth_mm / 2, 1e-4
    if shape == "with_stiffness":
        law = build.plant.pad.law
        stiffness = float(law.force(middle + h) - law.force(middle - h)) / (2 * h)
        told = {"damping_form": 11, "damping_ref": stiffness, "damping_Ns_mm": coefficient}
    else:
        # c v (1 + |v|/v_0) with a v_0 that is next to nothing.
        told = {"damping_form": 10, "damping_ref": 0.002, "damping_Ns_mm": coefficient * 0.002 / 20.0}
    build.plant.numbers.update(told)
    return {"coefficient": coefficient}
