"""Further shapes of the pad's own effects. Equations in `kernel`.

Sources: pseudo-elasticity with a hyperbolic tangent (Dorfmann and Ogden 2003); softening with the logarithm of the
cycles; limited chain extension (Gent 1996); a box spectrum of relaxation times (Neubert 1963, Fung 1981); free volume
(Doolittle 1951, Knauss and Emri 1981); shear thickening (Ostwald–de Waele); capillary bridges (Maugis 1987).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from ..laws import Law, _Tabulated
from .curves import stretched
from .modes import add_modes
from .registry import Build, more_shapes, spread
from .structure import hide_law


@more_shapes("separation", "bond_breaks")
def bond_breaks(build: Build, shape: str, size: float) -> dict[str, float]:
    """The lab believes `bonded`, and it was so: the bond bears 1 % of the greatest force until it breaks, once."""
    build.believed = replace(build.believed, contact="bonded")
    build.plant.numbers.update(stick_N=0.01 * min(size, 2.0) * build.force_N, stick_once=True)
    return {}


@more_shapes("adhesion", "capillary")
def capillary(build: Build, shape: str, size: float) -> dict[str, float]:
    """A liquid bridge of constant volume: P (1 − g/√(g² + r²)) over the gap g, until it breaks at the range r."""
    pull_off, reach = 0.1 * size * spread(build.rng, 0.7, 1.5), 0.05 * spread(build.rng, 0.6, 1.6)
    build.plant.numbers.update(adhesion_form=4, pull_off_N=pull_off, adhesion_mm=reach)
    return {"pull_off": pull_off, "range": reach}


@dataclass(frozen=True)
class Gent(_Tabulated):
    """A block of thickness H of chains that end: F = A (λ^{−2} − λ) J/(J − I + 3), I = λ² + 2/λ, λ = 1 − δ/H."""

    name: ClassVar[str] = "gent"
    modulus: float
    limit: float
    thickness: float

    def curve(self, depth_mm: np.ndarray) -> np.ndarray:
        stretch = stretched(depth_mm, self.thickness)
        used = np.minimum((stretch**2 + 2 / stretch - 3) / self.limit, 0.95)
        return self.modulus * (stretch**-2 - stretch) / (1 - used)


@more_shapes("elastic_law", "gent")
def gent(build: Build, shape: str, size: float) -> dict[str, Any]:
    """The true law is Gent's; the believed one is fitted to it. Sizes but 1 lie between (or beyond) the two."""
    rng, depth = build.rng, build.depth_mm
    thickness = depth / float(rng.uniform(0.35, 0.5))
    stretch = 1 - depth / thickness
    limit = (stretch**2 + 2 / stretch - 3) / float(rng.uniform(0.5, 0.75))
    other: Law = Gent(1.0, limit, thickness)
    other = replace(other, modulus=build.force_N / float(other.force(depth)))
    return hide_law(build, shape, other, size)


@more_shapes("stress_softening", "dorfmann_ogden")
def dorfmann_ogden(build: Build, shape: str, size: float) -> dict[str, float]:
    """η = 1 − s tanh((W_max − W)/w), with w the energy of the last `depth` mm before the deepest point."""
    share, depth = min(0.15 * size * spread(build.rng, 0.7, 1.4), 0.6), 0.5 * spread(build.rng, 0.6, 1.6)
    deepest = build.depth_mm
    at = np.linspace(deepest - min(depth, 0.8 * deepest), deepest, 101)
    energy = float(np.trapezoid(build.plant.pad.law.force(at), at))
    build.plant.numbers.update(softening_form=4, softening_share=share, softening_Nmm=energy)
    return {"share": share, "depth": depth}


@more_shapes("damage", "logarithmic")
def logarithmic(build: Build, shape: str, size: float) -> dict[str, float]:
    """1 − r L ln(1 + λ/L) after a way of loading λ, with L of 2 to 6 depths: each cycle costs less than the last."""
    rate = 0.01 * size * spread(build.rng, 0.6, 1.6)
    length = build.depth_mm * float(build.rng.uniform(2, 6))
    build.plant.numbers.update(damage_form=4, damage_per_mm=rate, damage_limit=length)
    return {"rate": rate}


@more_shapes("permanent_set", "progressive")
def progressive(build: Build, shape: str, size: float) -> dict[str, float]:
    """s δ_max √(δ_max/δ_ref), with δ_ref the greatest depth: the deeper, the more of it stays."""
    rate = min(0.03 * size * spread(build.rng, 0.7, 1.4), 0.3)
    build.plant.numbers.update(set_form=4, set_mm_mm=rate, set_limit_mm=build.depth_mm)
    return {"set": rate}


@more_shapes("missing_relaxation_mode", "box")
def box(build: Build, shape: str, size: float) -> dict[str, float]:
    """Relaxation times spread evenly on a log scale over a decade and a half: modes of equal shares, four a decade."""
    share, middle = 0.08 * size * spread(build.rng, 0.7, 1.4), spread(build.rng, 0.4, 15.0)
    add_modes(build, share, np.full(7, 1 / 7), middle * 10 ** np.linspace(0.75, -0.75, 7))
    return {"share": share, "rate": middle}


@more_shapes("depth_dependent_relaxation", "free_volume")
def free_volume(build: Build, shape: str, size: float) -> dict[str, float]:
    """ν e^{B (1/f_0 − 1/f)} with a free volume f that goes with depth: ν exp(s δ/(1 + δ/4 mm))."""
    rng = build.rng
    slope = size * float(rng.uniform(0.1, 0.3) if rng.random() < 0.6 else rng.uniform(-0.2, -0.1))
    slope = max(slope, -0.8 / build.depth_mm)
    build.plant.numbers.update(rate_form=4, rate_per_mm=slope)
    return {"slope": slope}


@more_shapes("viscous_damping", "thickening")
def thickening(build: Build, shape: str, size: float) -> dict[str, float]:
    """c v_ref (v/v_ref)^1.3 with v_ref = 20 mm/s, a dense suspension between skin and core."""
    coefficient = size * spread(build.rng, 0.005, 0.02)
    build.plant.numbers.update(damping_form=4, damping_Ns_mm=coefficient, damping_ref=20.0)
    return {"coefficient": coefficient}
