"""The judge's shapes of the pad's elastic law, softening, damage and set.

Sources: E. Rodriguez, M. Paredes and M. Sartor, Analytical behavior law for a constant pitch conical compression
spring, J. Mech. Des. 128 (2006); P. Flory and J. Rehner, Statistical mechanics of cross-linked polymer networks II:
swelling, J. Chem. Phys. 11 (1943); L. Mullins and N. Tobin, Theoretical model for the elastic behavior of
filler-reinforced vulcanized rubbers, Rubber Chem. Technol. 30 (1957); M. Klüppel and J. Schramm, A generalized tube
model of rubber elasticity and stress softening of filler reinforced elastomer systems, Macromol. Theory Simul. 9
(2000); K. Johnson, Contact Mechanics (1985), the mattress of springs; S. Zhurkov, Kinetic concept of the strength of
solids, Int. J. Fract. Mech. 1 (1965); O. Wheeler, Spectrum loading and crack growth, J. Basic Eng. 94 (1972); J.
Archard, Contact and rubbing of flat surfaces, J. Appl. Phys. 24 (1953); M. Avrami, Kinetics of phase change, J. Chem.
Phys. 7 (1939); A. Gent, Crystallization and the relaxation of stress in stretched natural rubber vulcanizates, Trans.
Faraday Soc. 50 (1954).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numba import njit
from scipy.optimize import brentq

from ..laws import Law, _Tabulated
from .registry import Build, judge_shapes, spread
from .structure import hide_law


@dataclass(frozen=True)
class ConicalCoil(_Tabulated):
    """A conical coil whose wide turns lie down first: δ/d = ∫ min(f r³, 1) dr/(1 − k) + e f, r from k to 1, F = A f.

    The widest turn lies down at A, the last at A/k³; e is what it stands on.
    """

    name: ClassVar[str] = "conical_coil"
    modulus: float
    narrow: float
    base: float
    travel: float

    def depth(self, f: np.ndarray) -> np.ndarray:
        k, wide = self.narrow, np.clip(f, 1.0, self.narrow**-3) ** (-1 / 3)
        turns = np.minimum(f, self.narrow**-3) * (wide**4 - k**4) / 4 + 1 - wide
        return self.travel * (turns / (1 - k) + self.base * f)

    def curve(self, depth_mm: np.ndarray) -> np.ndarray:
        depth = np.asarray(depth_mm, dtype=float)
        # Halving: the depth grows with the load, and by no less than the base.
        low, high = np.zeros_like(depth), depth / (self.base * self.travel)
        for _ in range(60):
            middle = (low + high) / 2
            above = self.depth(middle) > depth
            low, high = np.where(above, low, middle), np.where(above, middle, high)
        return self.modulus * (low + high) / 2


def osmotic(phi: np.ndarray | float, chi: float) -> np.ndarray:
    """Pressure of mixing −ln(1 − φ) − φ − χ φ² in units of RT/V of the solvent."""
    return -np.log1p(-np.asarray(phi)) - phi - chi * np.asarray(phi) ** 2


@dataclass(frozen=True)
class SwollenGel(_Tabulated):
    """A swollen gel that gives off solvent: F = A (Π(φ/λ) − λ Π(φ)), λ = 1 − δ/h; straight from φ/λ = 0.9 on."""

    name: ClassVar[str] = "swollen_gel"
    modulus: float
    polymer: float
    chi: float
    height: float

    def curve(self, depth_mm: np.ndarray) -> np.ndarray:
        left = 1 - np.asarray(depth_mm, dtype=float) / self.height
        least, at_rest = self.polymer / 0.9, float(osmotic(self.polymer, self.chi))
        inner = np.maximum(left, least)
        # −dF/dλ there: φ/λ² Π' + Π(φ), Π' = p/(1 − p) − 2 χ p.
        slope = 0.9**2 / self.polymer * (0.9 / 0.1 - 2 * self.chi * 0.9) + at_rest
        pressed = osmotic(self.polymer / inner, self.chi) - inner * at_rest
        return self.modulus * (pressed + slope * np.maximum(least - left, 0.0))


@judge_shapes("elastic_law", "conical_coil", "swollen_gel")
def elastic_law(build: Build, shape: str, size: float) -> dict[str, Any]:
    """The true law is that of the name; the believed one is fitted to it. Sizes but 1 lie between (or beyond) both.

    `conical_coil`: k of 0.4 to 0.6, e of 0.005 to 0.015, the load at the greatest depth 0.5 to 0.9 of the last turn's.
    `swollen_gel`: φ of 0.08 to 0.2, χ of 0.2 to 0.45; pressed to 0.5 to 0.75 of polymer at the greatest depth.
    """
    rng, depth = build.rng, build.depth_mm
    narrow, base, used = float(rng.uniform(0.4, 0.6)), spread(rng, 0.005, 0.015), float(rng.uniform(0.5, 0.9))
    polymer, chi, pressed = spread(rng, 0.08, 0.2), float(rng.uniform(0.2, 0.45)), float(rng.uniform(0.5, 0.75))
    travel = depth / float(ConicalCoil(1.0, narrow, base, 1.0).depth(np.array(used / narrow**3)))
    gel = SwollenGel(1.0, polymer, chi, depth / (1 - polymer / pressed))
    other: Law = ConicalCoil(1.0, narrow, base, travel) if shape == "conical_coil" else gel
    other = other.with_parameters({"modulus": build.force_N / float(other.force(depth))})
    return hide_law(build, shape, other, size)
