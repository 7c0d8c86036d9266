"""Third shapes of the pad's own effects. Equations in `kernel`.

Sources: adhesion, damage, joints and damping as named in `kernel`; Ogden (1972) and Hencky (1928) in uniaxial
compression; a sphere on a layer that is bonded to a plate and not thick (Dimitriadis et al. 2002); softening as a power
of a ratio (Guo and Sluys 2006); viscoplastic set (Perzyna 1966); the power law of Nutting (1921) as a gamma
distribution of rates; the fractional element (Koeller 1984), whose spectrum is that of Cole and Cole (1941).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numba import njit

from ..laws import Law, _Tabulated
from .curves import stretched
from .modes import add_modes, drawn_mode
from .registry import Build, more_shapes, spread
from .structure import hide_law


@more_shapes("adhesion", "van_der_waals", "bilinear")
def adhesion(build: Build, shape: str, size: float) -> dict[str, float]:
    """P/(1 + g/r)² on the way in and out, a tail that e^{−g/range} has not; or from nothing to P and down to nothing.

    `van_der_waals`: P/e at the range. `bilinear`: P at a quarter of the range, where what holds begins to break.
    """
    pull_off, reach = 0.1 * size * spread(build.rng, 0.7, 1.5), 0.05 * spread(build.rng, 0.6, 1.6)
    form, length = (5, reach / np.expm1(0.5)) if shape == "van_der_waals" else (6, reach)
    build.plant.numbers.update(adhesion_form=form, pull_off_N=pull_off, adhesion_mm=length)
    return {"pull_off": pull_off, "range": reach}


@dataclass(frozen=True)
class Ogden(_Tabulated):
    """A block of thickness H, one term: F = A (λ^{−α/2 − 1} − λ^{α − 1}), λ = 1 − δ/H; α = 2 is neo-Hooke's."""

    name: ClassVar[str] = "ogden"
    modulus: float
    exponent: float
    thickness: float

    def curve(self, depth_mm: np.ndarray) -> np.ndarray:
        stretch = stretched(depth_mm, self.thickness)
        return self.modulus * (stretch ** (-self.exponent / 2 - 1) - stretch ** (self.exponent - 1))


@dataclass(frozen=True)
class Hencky(_Tabulated):
    """True stress by the logarithm of the stretch, of a foam that does not bulge: F = −A ln(1 − δ/H)."""

    name: ClassVar[str] = "hencky"
    modulus: float
    thickness: float

    def curve(self, depth_mm: np.ndarray) -> np.ndarray:
        return -self.modulus * np.log(stretched(depth_mm, self.thickness))


@dataclass(frozen=True)
class ThinLayer(_Tabulated):
    """Sphere of radius R on a bonded layer of thickness H that keeps its volume; with χ = √(R δ)/H

    F = A δ^{3/2} (1 + 1.133 χ + 1.283 χ² + 0.769 χ³ + 0.0975 χ⁴).
    """

    name: ClassVar[str] = "thin_layer"
    modulus: float
    radius: float
    thickness: float

    def curve(self, depth_mm: np.ndarray) -> np.ndarray:
        chi = np.sqrt(self.radius * depth_mm) / self.thickness
        factor = np.polynomial.polynomial.polyval(chi, (1.0, 1.133, 1.283, 0.769, 0.0975))
        return self.modulus * depth_mm**1.5 * factor


@more_shapes("elastic_law", "ogden", "hencky", "thin_layer")
def elastic_law(build: Build, shape: str, size: float) -> dict[str, Any]:
    """The true law is another; the believed one is fitted to it. Sizes but 1 lie between (or beyond) the two."""
    rng, depth = build.rng, build.depth_mm
    strain = float(rng.uniform(0.45, 0.6))
    laws: dict[str, Law] = {
        "ogden": Ogden(1.0, float(rng.uniform(4.0, 9.0)), depth / strain),
        "hencky": Hencky(1.0, depth / (strain + 0.3)),
        "thin_layer": ThinLayer(1.0, float(rng.uniform(4.0, 12.0)), depth / strain),
    }
    other = laws[shape]
    other = other.with_parameters({"modulus": build.force_N / float(other.force(depth))})
    return hide_law(build, shape, other, size)


@more_shapes("stress_softening", "ratio")
def ratio(build: Build, shape: str, size: float) -> dict[str, float]:
    """η = (δ/δ_max)^a: it has lost the share at 2 `depth` below the greatest depth, and all but nothing is left above.

    Where that would lie in air, at a fifth of the greatest depth.
    """
    share, depth = min(0.15 * size * spread(build.rng, 0.7, 1.4), 0.6), 0.5 * spread(build.rng, 0.6, 1.6)
    left = 1 - min(2 * depth / build.depth_mm, 0.8)
    build.plant.numbers.update(softening_form=5, softening_share=float(np.log1p(-share) / np.log(left)))
    return {"share": share, "depth": depth}


@more_shapes("damage", "hyperbolic", "by_load")
def damage(build: Build, shape: str, size: float) -> dict[str, float]:
    """1/(1 + r λ), bonds that break in pairs; or e^{−r Λ} with Λ = ∫ 2 δ/δ_ref dλ, so that deep strokes cost more.

    `by_load`: δ_ref is the greatest depth, and r the mean rate of a stroke down to there.
    """
    rate = 0.01 * size * spread(build.rng, 0.6, 1.6)
    form = 5 if shape == "hyperbolic" else 6
    build.plant.numbers.update(damage_form=form, damage_per_mm=rate, damage_limit=build.depth_mm)
    return {"rate": rate}


@njit(cache=True)
def _creeping(x, h, rate, tau):
    """s' = max(0, rate · deepest − s)/τ while the probe is below the surface that has sunk by s."""
    sunk, deepest, s = np.zeros(x.shape[0]), 0.0, 0.0
    for k in range(1, x.shape[0]):
        deepest = max(deepest, x[k])
        if x[k] > s:
            s += max(rate * deepest - s, 0.0) * -np.expm1(-h / tau)
        sunk[k] = s
    return sunk


@more_shapes("permanent_set", "creeps")
def creeps(build: Build, shape: str, size: float) -> dict[str, float]:
    """The surface sinks towards s δ_max within 0.2 to 1 s of contact, for good."""
    rate, tau = min(0.03 * size * spread(build.rng, 0.7, 1.4), 0.3), spread(build.rng, 0.2, 1.0)
    build.plant.height.append(lambda t, x: _creeping(x, t[1] - t[0], rate, tau))
    return {"set": rate}


def gamma_rates(power: float, rate: float) -> tuple[np.ndarray, np.ndarray]:
    """Shares and rates, three a decade, of (1 + t/τ)^{−n}, which is 1/e at 1/rate: x^n e^{−x} by ln x, x = ν τ."""
    tau = 1 / (rate * np.expm1(1 / power))
    x = 10 ** np.linspace(1, -2, 10)
    weights = x**power * np.exp(-x)
    kept = weights > 1e-4 * weights.sum()
    return weights[kept] / weights[kept].sum(), x[kept] / tau


def fractional_rates(alpha: float, rate: float) -> tuple[np.ndarray, np.ndarray]:
    """Shares and rates, three a decade over four, of E_α(−(ν t)^α): sin πα / (x^α + x^{−α} + 2 cos πα) by ln x."""
    x = 10 ** np.linspace(2, -2, 13)
    weights = np.sin(np.pi * alpha) / (x**alpha + x**-alpha + 2 * np.cos(np.pi * alpha))
    return weights / weights.sum(), rate * x


@more_shapes("missing_relaxation_mode", "power_tail", "fractional")
def missing_relaxation_mode(build: Build, shape: str, size: float) -> dict[str, float]:
    """A power of time as a tail, t^{−1.5} to t^{−3}; or a fractional element, t^{−α} with α of 0.7 to 0.85."""
    rng, (share, rate) = build.rng, drawn_mode(build, size, 0.3, 20.0)
    if shape == "power_tail":
        weights, rates = gamma_rates(float(rng.uniform(1.5, 3.0)), rate)
    else:
        weights, rates = fractional_rates(float(rng.uniform(0.7, 0.85)), rate)
    add_modes(build, share, weights, rates)
    return {"share": share, "rate": rate}


@more_shapes("depth_dependent_relaxation", "knee", "mode_by_mode")
def depth_dependent_relaxation(build: Build, shape: str, size: float) -> dict[str, float]:
    """ν (1 + s min(δ, δ_k)), with a knee at half to four fifths of the depth; or e^{w s δ} with w from 1.5 to 0.5.

    `mode_by_mode`: w is that of the fastest mode and of the slowest; the slope stated is the mean of the modes.
    """
    rng, depth = build.rng, build.depth_mm
    slope = size * float(rng.uniform(0.1, 0.3) if rng.random() < 0.6 else rng.uniform(-0.2, -0.1))
    slope, knee = max(slope, -0.8 / depth), depth * float(rng.uniform(0.5, 0.8))
    form = 5 if shape == "knee" else 6
    build.plant.numbers.update(rate_form=form, rate_per_mm=slope, rate_knee_mm=knee)
    return {"slope": slope}


@more_shapes("viscous_damping", "eyring", "one_sided")
def viscous_damping(build: Build, shape: str, size: float) -> dict[str, float]:
    """c v_ref asinh(v/v_0)/asinh(v_ref/v_0), v_ref = 20 mm/s; or more on the way in than on the way out, or less.

    `eyring`: v_0 of 5 to 15 mm/s. `one_sided`: by a fifth to two fifths; stated is the mean of both ways.
    """
    rng, coefficient = build.rng, size * spread(build.rng, 0.005, 0.02)
    if shape == "eyring":
        least = spread(rng, 5.0, 15.0)
        told = {"damping_form": 5, "damping_ref": least}
        told["damping_Ns_mm"] = coefficient * 20.0 / (least * float(np.arcsinh(20.0 / least)))
    else:
        differs = float(rng.choice([-1.0, 1.0]) * rng.uniform(0.2, 0.4))
        told = {"damping_form": 6, "damping_ref": differs, "damping_Ns_mm": coefficient}
    build.plant.numbers.update(told)
    return {"coefficient": coefficient}
