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


def amplified(now: np.ndarray, most: np.ndarray, power: float) -> np.ndarray:
    """Depth d at which d (1 + d)^{−p} is now (1 + most)^{−p}: fresh rubber bears there what the worn one does now."""
    wanted = now * (1 + most) ** -power
    low, high = np.zeros_like(wanted), np.maximum(now, 0.0)
    for _ in range(45):
        middle = (low + high) / 2
        above = middle * (1 + middle) ** -power > wanted
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    return (low + high) / 2


def bed_kept(part: np.ndarray, power: float) -> np.ndarray:
    """What a bed of springs under a ball keeps at this part of its deepest point: 2 ∫ v (v x/(v x + 1 − x))^a dv.

    Each spring keeps (u/m)^a of its force, u its depth and m its deepest one.
    """
    nodes, weights = np.polynomial.legendre.leggauss(40)
    v, w = (nodes[:, None] + 1) / 2, weights[:, None] / 2
    x = np.clip(part, 1e-9, 1.0)
    return np.sum(2 * w * v * (v * x / (v * x + 1 - x)) ** power, axis=0)


@judge_shapes("stress_softening", "amplified_strain", "bed_of_fibres")
def stress_softening(build: Build, shape: str, size: float) -> dict[str, float]:
    """Hard parts raise the strain of the soft, by (1 + M/z)^{−p}, and go as it gets deeper; or each fibre forgets.

    `amplified_strain`: z of 0.1 to 0.25 of the greatest depth; F is that of fresh rubber of the same inner strain.
    `bed_of_fibres`: those at the rim of the touch were never pressed deep. Either loses the share at 2 `depth` below
    the greatest depth, at 0.8 of it where that would lie in air; stated is what it loses, where p of 0.95 ends it.
    """
    rng, deepest, law = build.rng, build.depth_mm, build.plant.pad.law
    share, depth = min(0.15 * size * spread(rng, 0.7, 1.4), 0.6), 0.5 * spread(rng, 0.6, 1.6)
    there, part = max(1 - 2 * depth / deepest, 0.2), spread(rng, 0.1, 0.25)

    def worn(power, now, most):
        """What is kept at depths `now` of the deepest `most`, both in mm."""
        if shape == "bed_of_fibres":
            grid = np.linspace(0.0, 1.0, 801)
            return np.interp(now / np.maximum(most, 1e-9), grid, bed_kept(grid, power))
        fresh = part * deepest * amplified(now / part / deepest, most / part / deepest, power)
        return np.where(now > 1e-6, law.force(fresh) / np.maximum(law.force(now), 1e-12), 1.0)

    def loses(power):
        return 1 - float(worn(power, np.array([there * deepest]), np.array([deepest]))[0])

    most = 0.95 if shape == "amplified_strain" else 60.0
    power = most if loses(most) < share else brentq(lambda p: loses(p) - share, 0.0, most)

    def gain(t, x):
        inner = np.maximum(x, 0.0)
        return worn(power, inner, np.maximum.accumulate(inner))

    build.plant.gain.append(gain)
    return {"share": min(share, loses(power)), "depth": depth}


@njit(cache=True)
def _retarded(x, most, grows, power):
    """Damage by the way in, slow as long as a crack runs in the zone that a deeper point left: (ρ/(A − a))^p.

    ρ = (δ/most)² is the zone of the moment, A the far edge of the widest so far; a grows by `grows` in a full stroke.
    """
    out, a, edge, total = np.zeros(x.shape[0]), 0.0, 0.0, 0.0
    for k in range(1, x.shape[0]):
        way = max(x[k], 0.0) - max(x[k - 1], 0.0)
        if way > 0:
            zone = (x[k] / most) ** 2
            edge = max(edge, a + zone)
            slow = (zone / (edge - a)) ** power
            total += slow * way
            a += grows * slow * way / most
        out[k] = total
    return out


@judge_shapes("damage", "under_load", "overloads")
def damage(build: Build, shape: str, size: float) -> dict[str, float]:
    """Bonds break by heat, at a rate of e^{F/F_0} − 1, at rest too; or a deep stroke slows what shallower ones do.

    `under_load`: F the elastic force, F_0 of 0.2 to 0.4 of the greatest. `overloads`: p of 1 to 1.5; the crack grows by
    0.1 to 0.3 of the widest zone in a full stroke. Of both r is the mean over all of the way of loading.
    """
    rng, rate, deepest = build.rng, 0.01 * size * spread(build.rng, 0.6, 1.6), build.depth_mm
    barrier, law = build.force_N * spread(rng, 0.2, 0.4), build.plant.pad.law
    grows, power = spread(rng, 0.1, 0.3), float(rng.uniform(1.0, 1.5))

    def gain(t, x):
        inner = np.maximum(x, 0.0)
        if shape == "under_load":
            # No more than e^12: nothing lives longer than that, however deep it is pressed.
            whole = np.cumsum(np.expm1(np.minimum(law.force(inner) / barrier, 12.0)))
        else:
            whole = _retarded(inner, deepest, grows, power)
        way = np.sum(np.maximum(np.diff(inner), 0.0))
        return np.exp(-rate * way * whole / max(whole[-1], 1e-12))

    build.plant.gain.append(gain)
    return {"rate": rate}


@judge_shapes("permanent_set", "wears", "crystallizes")
def permanent_set(build: Build, shape: str, size: float) -> dict[str, float]:
    """The surface is worn off by force times way, in and out; or the pad hardens in its pressed shape, late at first.

    `wears`: it bulges and rubs along the probe. `crystallizes`: 1 − e^{−(K/τ)^n}, K the time under load, which counts
    by the depth, τ of 0.3 to 0.6 of all of it, n of 2 to 3. Stated is s of the greatest depth at the recording's end.
    """
    rng, rate = build.rng, min(0.03 * size * spread(build.rng, 0.7, 1.4), 0.3)
    part, order, law = float(rng.uniform(0.3, 0.6)), float(rng.uniform(2.0, 3.0)), build.plant.pad.law

    def height(t, x):
        inner = np.maximum(x, 0.0)
        if shape == "wears":
            whole = np.cumsum(law.force(inner) * np.abs(np.diff(inner, prepend=inner[0])))
        else:
            loaded = np.cumsum(inner)
            whole = -np.expm1(-((loaded / max(part * loaded[-1], 1e-12)) ** order))
        return rate * build.depth_mm * whole / max(whole[-1], 1e-12)

    build.plant.height.append(height)
    return {"set": rate}
