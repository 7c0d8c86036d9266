"""The fourth shapes: the pad's own effects. Those in which force and motion act on each other are forms of `kernel`.

Sources: a film between plates bears an impulse of tension (Stefan 1874, Reynolds 1886); fibrils of a soft adhesive
(Lakrout, Sergot and Creton 1999) and the speed at which a bond is opened (Gent and Schultz 1972, Maugis and Barquins
1978); laws after Yeoh (1993), of closed cells with gas (Gibson and Ashby 1997) and of pins of different heights
(Greenwood and Williamson 1966 with few); damage by the deepest point (Simo 1987); networks of evenly spread lengths
(Bueche 1961); damage beyond a threshold (Lemaitre 1985) and by a power of the way (Basquin 1910); rows of cells that
crush one after another (Papka and Kyriakides 1994); compression set that comes back in part (ISO 815); consolidation
(Terzaghi 1925, Biot 1941); a log-normal spectrum (Wiechert 1893, Yager 1936); permeability that goes with strain (Lai
and Mow 1980), rates that go with stress (Leaderman 1943); damping with the radius of contact (Kuwabara and Kono 1987)
or the load (Hunt and Crossley 1975).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numba import njit

from ..laws import Law, _Tabulated
from .curves import stretched
from .modes import add_modes, drawn_mode
from .registry import Build, more_shapes, spread
from .structure import hide_law


@more_shapes("separation", "grease_film")
def grease_film(build: Build, shape: str, size: float) -> dict[str, float]:
    """The lab believes `bonded`. A film bears tension until its impulse is 3 to 8 ms of the greatest force."""
    build.believed = replace(build.believed, contact="bonded")
    impulse_s = min(size, 2.0) * spread(build.rng, 0.003, 0.008)
    build.plant.numbers["stick_Ns"] = impulse_s * build.force_N
    return {}


@more_shapes("adhesion", "fibrils", "by_rate")
def adhesion(build: Build, shape: str, size: float) -> dict[str, float]:
    """Up to P within 0.15 of the range, P until 0.7 of it, then nothing; or a neck that bears more the quicker it goes.

    `by_rate`: P (1 + v/0.1 mm/s)^0.15 sin(π g/2 r), with P at 10 mm/s.
    """
    pull_off, reach = 0.1 * size * spread(build.rng, 0.7, 1.5), 0.05 * spread(build.rng, 0.6, 1.6)
    form = 7 if shape == "fibrils" else 8
    build.plant.numbers.update(adhesion_form=form, pull_off_N=pull_off, adhesion_mm=reach)
    return {"pull_off": pull_off, "range": reach}


@dataclass(frozen=True)
class Yeoh(_Tabulated):
    """A block of thickness H of filled rubber: F = A (λ^{−2} − λ) (1 − B (I − 3) + C (I − 3)²), I = λ² + 2/λ."""

    name: ClassVar[str] = "yeoh"
    modulus: float
    falls: float
    rises: float
    thickness: float

    def curve(self, depth_mm: np.ndarray) -> np.ndarray:
        stretch = stretched(depth_mm, self.thickness)
        more = stretch**2 + 2 / stretch - 3
        return self.modulus * (stretch**-2 - stretch) * (1 - self.falls * more + self.rises * more**2)


@dataclass(frozen=True)
class ClosedCells(_Tabulated):
    """A foam of thickness H whose gas is pressed together, beside its walls: F = A δ/(H − δ) + B δ/H."""

    name: ClassVar[str] = "closed_cells"
    modulus: float
    walls: float
    thickness: float

    def curve(self, depth_mm: np.ndarray) -> np.ndarray:
        stretch = stretched(depth_mm, self.thickness)
        return self.modulus * ((1 - stretch) / stretch + self.walls * (1 - stretch))


@dataclass(frozen=True)
class Pins(_Tabulated):
    """Pins of like stiffness, each met `pitch` deeper than the one before and rounded over a fifth of that.

    F = A Σ_k w ln(1 + e^{(δ − kp)/w}), less what that is at 0.
    """

    name: ClassVar[str] = "pins"
    modulus: float
    pitch: float

    def curve(self, depth_mm: np.ndarray) -> np.ndarray:
        depth, begins = np.asarray(depth_mm)[..., None], self.pitch * np.arange(12)
        width = self.pitch / 5
        met = np.logaddexp(0, (depth - begins) / width) - np.logaddexp(0, -begins / width)
        return self.modulus * width * np.sum(met, axis=-1)


@more_shapes("elastic_law", "yeoh", "closed_cells", "pins")
def elastic_law(build: Build, shape: str, size: float) -> dict[str, Any]:
    """The true law is another; the believed one is fitted to it. Sizes but 1 lie between (or beyond) the two."""
    rng, depth = build.rng, build.depth_mm
    strain, falls, part = float(rng.uniform(0.4, 0.55)), float(rng.uniform(0.5, 0.8)), float(rng.uniform(0.3, 0.45))
    laws: dict[str, Law] = {
        # The cubic rises everywhere where B² is below 3 C.
        "yeoh": Yeoh(1.0, falls, 0.6 * falls**2, depth / strain),
        "closed_cells": ClosedCells(1.0, float(rng.uniform(0.2, 1.5)), depth / (strain + 0.3)),
        "pins": Pins(1.0, depth * part),
    }
    other = laws[shape]
    other = other.with_parameters({"modulus": build.force_N / float(other.force(depth))})
    return hide_law(build, shape, other, size)


@more_shapes("stress_softening", "linear", "simo")
def stress_softening(build: Build, shape: str, size: float) -> dict[str, float]:
    """In proportion to the way below the deepest point, up to 2 `depth`; or (1 − D(δ_max))/(1 − D(δ)) of the law.

    D = D_∞ (1 − e^{−δ/ℓ}), ℓ half the greatest depth or more. Either has lost the share at 2 `depth` below the greatest
    depth, `simo` at 0.8 of it where that would lie in air.
    """
    share, depth = min(0.15 * size * spread(build.rng, 0.7, 1.4), 0.6), 0.5 * spread(build.rng, 0.6, 1.6)
    told = {"softening_form": 6, "softening_share": share, "softening_mm": depth}
    if shape == "simo":
        deepest, length = build.depth_mm, build.depth_mm * float(build.rng.uniform(0.5, 1.0))
        most, there = -np.expm1(-np.array([deepest, max(deepest - 2 * depth, 0.2 * deepest)]) / length)
        # (1 − D_∞ most)/(1 − D_∞ there) = 1 − share.
        told = {"softening_form": 7, "softening_share": share / (most - (1 - share) * there), "softening_mm": length}
        if told["softening_share"] > 0.95:
            told["softening_share"] = 0.95
            share = 1 - (1 - 0.95 * most) / (1 - 0.95 * there)
    build.plant.numbers.update(told)
    return {"share": float(share), "depth": depth}


@more_shapes("damage", "beyond_threshold", "power")
def damage(build: Build, shape: str, size: float) -> dict[str, float]:
    """e^{−r Λ}, where only loading deeper than a fifth to a half counts; or (1 + λ/ℓ)^{−r ℓ}, ℓ of 2 to 6 depths.

    `beyond_threshold`: r is the mean rate of a stroke to the greatest depth. `power`: it is the rate at first.
    """
    rng, rate = build.rng, 0.01 * size * spread(build.rng, 0.6, 1.6)
    spared, length = float(rng.uniform(0.2, 0.5)), build.depth_mm * float(rng.uniform(2, 6))
    told = {"damage_form": 8, "damage_per_mm": rate, "damage_limit": length}
    if shape == "beyond_threshold":
        told = {"damage_form": 7, "damage_per_mm": rate / (1 - spared), "damage_limit": spared * build.depth_mm}
    build.plant.numbers.update(told)
    return {"rate": rate}


@njit(cache=True)
def _rebounds(x, h, rate, stays, tau):
    """A part of `rate` times the deepest point stays, the rest fades where nothing presses on it."""
    sunk, deepest, part = np.zeros(x.shape[0]), 0.0, 0.0
    for k in range(1, x.shape[0]):
        if x[k] > deepest:
            part += (1 - stays) * rate * (x[k] - deepest)
            deepest = x[k]
        elif x[k] < stays * rate * deepest:
            part *= np.exp(-h / tau)
        sunk[k] = stays * rate * deepest + part
    return sunk


@more_shapes("permanent_set", "rows", "rebounds")
def permanent_set(build: Build, shape: str, size: float) -> dict[str, float]:
    """Rows of cells crush, one each eighth to twelfth of the depth; or a fifth to a third comes back in air.

    `rows`: stated is the mean of all rows. `rebounds`: within 2 to 10 s; stated is the middle of at once and at last.
    """
    rng, rate = build.rng, min(0.03 * size * spread(build.rng, 0.7, 1.4), 0.3)
    row, back, tau = build.depth_mm / float(rng.uniform(8, 12)), float(rng.uniform(0.2, 0.33)), spread(rng, 2.0, 10.0)

    def rows(x):
        # Each gives way within the middle half of its row.
        whole, part = np.divmod(np.maximum.accumulate(np.maximum(x, 0.0)) / row, 1.0)
        return rate * row * (whole + np.clip(2 * part - 0.5, 0.0, 1.0))

    def height(t, x):
        return rows(x) if shape == "rows" else _rebounds(x, t[1] - t[0], rate / (1 - back / 2), 1 - back, tau)

    build.plant.height.append(height)
    return {"set": rate}


def consolidation_rates(rate: float, terms: int = 12) -> tuple[np.ndarray, np.ndarray]:
    """Shares and rates of water that leaves a layer: 8/π² Σ e^{−(2k+1)² ν t}/(2k+1)²; the last takes what is left."""
    odd = 2.0 * np.arange(terms) + 1
    weights = 8 / (np.pi * odd) ** 2
    weights[-1] += 1 - weights.sum()
    return weights, rate * odd**2


def log_normal_rates(width: float, rate: float) -> tuple[np.ndarray, np.ndarray]:
    """Shares and rates, four a decade, whose logarithm is normal about that of `rate` with a deviation of `width`."""
    logs = np.log(10.0) / 4 * np.arange(-8, 9)
    weights = np.exp(-0.5 * (logs / width) ** 2)
    kept = weights > 1e-3 * weights.sum()
    return weights[kept] / weights[kept].sum(), rate * np.exp(logs[kept])


@more_shapes("missing_relaxation_mode", "consolidation", "log_normal")
def missing_relaxation_mode(build: Build, shape: str, size: float) -> dict[str, float]:
    """Water that is pressed out, four fifths of it at the slowest rate, which is stated; or a log-normal spectrum.

    `log_normal`: a deviation of 0.6 to 1.2 e-folds; stated is the middle.
    """
    rng, (share, rate) = build.rng, drawn_mode(build, size, 0.2, 20.0)
    width = float(rng.uniform(0.6, 1.2))
    weights, rates = consolidation_rates(rate, 5) if shape == "consolidation" else log_normal_rates(width, rate)
    add_modes(build, share, weights, rates)
    return {"share": share, "rate": rate}


@more_shapes("depth_dependent_relaxation", "pores", "with_force")
def depth_dependent_relaxation(build: Build, shape: str, size: float) -> dict[str, float]:
    """ν (1 + s δ/2)², as pores close or open; or ν (1 + s δ_ref F^e/F_ref), which is s in the mean over the depths."""
    rng, depth, law, most = build.rng, build.depth_mm, build.plant.pad.law, build.force_N
    slope = size * float(rng.uniform(0.1, 0.3) if rng.random() < 0.6 else rng.uniform(-0.2, -0.1))
    slope = max(slope, -0.8 / depth)

    def factor(t, x):
        # In steps of 0.1 %: each change costs the kernel new exponentials.
        wanted = (
            (1 + slope * np.maximum(x, 0.0) / 2) ** 2 if shape == "pores" else 1 + slope * depth * law.force(x) / most
        )
        return np.round(np.maximum(wanted, 0.1), 3)

    build.plant.rate_factor.append(factor)
    return {"slope": slope}


@more_shapes("viscous_damping", "kuwabara_kono", "hunt_crossley")
def viscous_damping(build: Build, shape: str, size: float) -> dict[str, float]:
    """c v √(δ/δ_ref), with the radius of contact; or c v F^e/F^e(δ_ref), with the load. δ_ref is half the greatest."""
    coefficient, middle = size * spread(build.rng, 0.005, 0.02), build.depth_mm / 2
    told = {"damping_form": 7, "damping_ref": middle}
    if shape == "hunt_crossley":
        told = {"damping_form": 8, "damping_ref": float(build.plant.pad.law.force(middle))}
    build.plant.numbers.update(told, damping_Ns_mm=coefficient)
    return {"coefficient": coefficient}
