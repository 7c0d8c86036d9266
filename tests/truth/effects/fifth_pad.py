"""The fifth shapes: the pad's own effects. Those in which force and motion act on each other are forms of `kernel`.

Sources: tapes that hold less each time (Creton and Ciccotti 2016); smooth laws of traction and separation (Xu and
Needleman 1994) and tack that grows while it is pressed (Zosel 1985); foamed rubber (Blatz and Ko 1962), and pads that
give way by a power of the force (Ramberg and Osgood 1943); softening that levels off late (functions as reviewed by
Diani, Fayolle and Gilormini 2009) and one that rest takes back (Mullins 1948, Harwood and Payne 1966); damage by the
work done (Lemaitre 1985) and bundles whose fibres break one by one (Daniels 1945); set that goes on with each cycle
(ratcheting; Chaboche 1986) and set by the load (Tabor, The Hardness of Metals); chains of beads (Rouse 1953) and
spectra that end (Davidson and Cole 1951); cells that fall in within a range of depth, and those that must first touch
(Gibson and Ashby 1997); films that are squeezed out (Stefan 1874, Reynolds 1886) and flow through pores with a part
that goes with the square of speed (Forchheimer 1901, Hilyard and Cunningham, Low Density Cellular Plastics).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numba import njit
from scipy.optimize import brentq
from scipy.special import betainc

from ..laws import Law, _Tabulated
from .curves import stretched
from .modes import add_modes, drawn_mode
from .outside_bench import _child
from .registry import Build, more_shapes, spread
from .structure import hide_law


@more_shapes("separation", "wears_off")
def separation(build: Build, shape: str, size: float) -> dict[str, float]:
    """The lab believes `bonded`. A tape bears 1.5 % of the greatest force, and half as much each next time."""
    build.believed = replace(build.believed, contact="bonded")
    build.plant.numbers.update(stick_N=0.015 * min(size, 2.0) * build.force_N, stick_keeps=0.5)
    return {}


@more_shapes("adhesion", "smooth", "tack")
def adhesion(build: Build, shape: str, size: float) -> dict[str, float]:
    """P q e^{1−q} with q = 3 g/range, on the way in too; or a neck that bears 1 − e^{−t/τ} of P after a contact of t.

    `smooth`: P at a third of the range. `tack`: τ of 0.2 to 1 s.
    """
    pull_off, reach = 0.1 * size * spread(build.rng, 0.7, 1.5), 0.05 * spread(build.rng, 0.6, 1.6)
    form, grows_s = 9 if shape == "smooth" else 10, spread(build.rng, 0.2, 1.0)
    build.plant.numbers.update(adhesion_form=form, pull_off_N=pull_off, adhesion_mm=reach, adhesion_s=grows_s)
    return {"pull_off": pull_off, "range": reach}


@dataclass(frozen=True)
class BlatzKo(_Tabulated):
    """A block of thickness H of foamed rubber, which bulges by the fourth root: F = A (λ^{−3} − λ^{−1/2})."""

    name: ClassVar[str] = "blatz_ko"
    modulus: float
    thickness: float

    def curve(self, depth_mm: np.ndarray) -> np.ndarray:
        stretch = stretched(depth_mm, self.thickness)
        return self.modulus * (stretch**-3 - stretch**-0.5)


@dataclass(frozen=True)
class RambergOsgood(_Tabulated):
    """Gives way by a power besides: δ/d = f + a f^n, F = A f."""

    name: ClassVar[str] = "ramberg_osgood"
    modulus: float
    more: float
    power: float
    scale: float

    def curve(self, depth_mm: np.ndarray) -> np.ndarray:
        wanted = np.asarray(depth_mm, dtype=float) / self.scale
        # Newton from above: the left side is convex, so that every step stays above the root.
        f = np.minimum(wanted, (wanted / self.more) ** (1 / self.power))
        for _ in range(40):
            f = f - (f + self.more * f**self.power - wanted) / (1 + self.more * self.power * f ** (self.power - 1))
        return self.modulus * f


@more_shapes("elastic_law", "blatz_ko", "ramberg_osgood")
def elastic_law(build: Build, shape: str, size: float) -> dict[str, Any]:
    """The true law is that of the name; the believed one is fitted to it. Sizes but 1 lie between (or beyond) both."""
    rng, depth = build.rng, build.depth_mm
    strain, more, power = float(rng.uniform(0.35, 0.5)), float(rng.uniform(1.5, 4.0)), float(rng.uniform(3.0, 5.0))
    other: Law = BlatzKo(1.0, depth / strain) if shape == "blatz_ko" else RambergOsgood(1.0, more, power, depth)
    other = other.with_parameters({"modulus": build.force_N / float(other.force(depth))})
    return hide_law(build, shape, other, size)


@more_shapes("stress_softening", "hyperbola", "heals")
def stress_softening(build: Build, shape: str, size: float) -> dict[str, float]:
    """η = 1 − s q/(1 + q) with q = (δ_max − δ)/(0.6 d); or the exponential one, whose δ_max is forgotten.

    `heals`: towards the depth at hand, within 15 to 50 s.
    """
    share, depth = min(0.15 * size * spread(build.rng, 0.7, 1.4), 0.6), 0.5 * spread(build.rng, 0.6, 1.6)
    told = {"softening_form": 8, "softening_mm": 0.6 * depth}
    if shape == "heals":
        told = {"softening_form": 1, "softening_mm": depth, "softening_heals_s": spread(build.rng, 15.0, 50.0)}
    build.plant.numbers.update(told, softening_share=share)
    return {"share": share, "depth": depth}


@njit(cache=True)
def _pressed(x):
    """Way of loading below the zero of position."""
    out = np.zeros(x.shape[0])
    for k in range(1, x.shape[0]):
        out[k] = out[k - 1] + max(max(x[k], 0.0) - max(x[k - 1], 0.0), 0.0)
    return out


@more_shapes("damage", "by_work", "fibres")
def damage(build: Build, shape: str, size: float) -> dict[str, float]:
    """e^{−r Λ} with Λ the work over its mean by the mm; or fibres that break one by one, at random, each a like share.

    `by_work`: r is the mean rate of a stroke to the greatest depth. `fibres`: every 0.5 to 1 mm in the mean; the mean
    of many such pads is e^{−r λ}.
    """
    rng, depth = build.rng, build.depth_mm
    rate, every = 0.01 * size * spread(rng, 0.6, 1.6), spread(rng, 0.5, 1.0)
    if shape == "by_work":
        at = np.linspace(0.0, depth, 401)
        mean = float(np.trapezoid(build.plant.pad.law.force(at), at)) / depth
        build.plant.numbers.update(damage_form=9, damage_per_mm=rate, damage_limit=mean)
        return {"rate": rate}
    breaks = np.cumsum(_child(rng).exponential(every, 4096))
    build.plant.gain.append(lambda t, x: (1 - rate * every) ** np.searchsorted(breaks, _pressed(x)))
    return {"rate": rate}


@njit(cache=True)
def _ratchets(x, h, per_cycle, takes_s):
    """δ_max (1 + c ln N), N how often the probe came near δ_max from half of it or less; each takes `takes_s`."""
    out, deepest, count, away, more = np.zeros(x.shape[0]), 0.0, 1.0, False, 0.0
    for k in range(1, x.shape[0]):
        deepest = max(deepest, x[k])
        if x[k] < 0.5 * deepest:
            away = True
        elif away and x[k] > 0.9 * deepest:
            away, count = False, count + 1
        more += (per_cycle * np.log(count) - more) * -np.expm1(-h / takes_s)
        out[k] = deepest * (1 + more)
    return out


@more_shapes("permanent_set", "ratchets", "by_load")
def permanent_set(build: Build, shape: str, size: float) -> dict[str, float]:
    """A little more with each cycle, by 10 to 20 % for each e-fold of their number; or in proportion to the load.

    `ratchets`: stated is that of the first. `by_load`: the mean over the way to the greatest depth.
    """
    rng, rate = build.rng, min(0.03 * size * spread(build.rng, 0.7, 1.4), 0.3)
    grows, takes_s, law, per_N = float(rng.uniform(0.1, 0.2)), 0.05, build.plant.pad.law, build.depth_mm / build.force_N

    def height(t, x):
        if shape == "ratchets":
            return rate * _ratchets(x, t[1] - t[0], grows, takes_s)
        return rate * per_N * law.force(np.maximum.accumulate(x))

    build.plant.height.append(height)
    return {"set": rate}


def rouse_rates(rate: float, beads: int) -> tuple[np.ndarray, np.ndarray]:
    """Shares and rates ν_1 k² of modes of equal weight, which have fallen to 1/e at 1/rate."""
    squares = np.arange(1.0, beads + 1) ** 2
    slowest = brentq(lambda s: float(np.mean(np.exp(-s * squares))) - np.exp(-1.0), 1e-4, 1.0)
    return np.full(beads, 1 / beads), rate * slowest * squares


def ending_rates(power: float, rate: float) -> tuple[np.ndarray, np.ndarray]:
    """Shares and rates of 1/(1 + i ω τ)^β, τ = 1/(β rate): sin πβ/π (y/(1 − y))^β by ln y, y < 1 being times over τ.

    Each mode stands for a range of y, and has its mean.
    """
    edges = np.concatenate([[0.0], np.geomspace(0.01, 0.6, 7), [0.8, 0.93, 1.0]])
    weights = np.diff(betainc(power, 1 - power, edges))
    # ∫ y dH is β times the next function of its kind.
    times = power * np.diff(betainc(power + 1, 1 - power, edges)) / weights
    return weights, power * rate / times


@more_shapes("missing_relaxation_mode", "rouse", "ending")
def missing_relaxation_mode(build: Build, shape: str, size: float) -> dict[str, float]:
    """A chain of four to seven beads, 1/e of it left at 1/rate; or a spectrum with a longest time, 1/rate in the mean.

    `ending`: β of 0.45 to 0.65.
    """
    rng, (share, rate) = build.rng, drawn_mode(build, size, 0.2, 20.0)
    beads, power = int(rng.integers(4, 8)), float(rng.uniform(0.45, 0.65))
    weights, rates = rouse_rates(rate, beads) if shape == "rouse" else ending_rates(power, rate)
    add_modes(build, share, weights, rates)
    return {"share": share, "rate": rate}


@more_shapes("depth_dependent_relaxation", "falls_in", "later")
def depth_dependent_relaxation(build: Build, shape: str, size: float) -> dict[str, float]:
    """An S about the middle, as cells fall in; or nothing up to 0.3 to 0.5 of the depth, a straight line from there.

    Stated is the mean slope from the surface to the greatest depth. `falls_in`: a tanh of 0.1 to 0.2 of the depth.
    """
    rng, deepest = build.rng, build.depth_mm
    slope = size * float(rng.uniform(0.1, 0.3) if rng.random() < 0.6 else rng.uniform(-0.2, -0.1))
    slope = max(slope, -0.8 / deepest)
    middle, width, begins = (float(rng.uniform(*part)) for part in ((0.4, 0.6), (0.1, 0.2), (0.3, 0.5)))

    def factor(t, x):
        share = np.maximum(x, 0.0) / deepest
        if shape == "later":
            grown = np.maximum(share - begins, 0.0) / (1 - begins)
        else:
            first, last = np.tanh((np.array([0.0, 1.0]) - middle) / width)
            grown = (np.tanh((share - middle) / width) - first) / (last - first)
        # In steps of 0.1 %: each change costs the kernel new exponentials.
        return np.round(np.maximum(1 + slope * deepest * grown, 0.1), 3)

    build.plant.rate_factor.append(factor)
    return {"slope": slope}


@more_shapes("viscous_damping", "squeezed_film", "forchheimer")
def viscous_damping(build: Build, shape: str, size: float) -> dict[str, float]:
    """c v ((H − δ_ref)/(H − δ))³, H of 2.5 to 4 depths; or c v (1 + |v|/v_0)/(1 + v_ref/v_0), v_0 of 20 to 80 mm/s.

    δ_ref is half the greatest depth, v_ref is 20 mm/s.
    """
    rng, coefficient = build.rng, size * spread(build.rng, 0.005, 0.02)
    thick, quick = build.depth_mm * float(rng.uniform(2.5, 4.0)), spread(rng, 20.0, 80.0)
    told = {"damping_form": 10, "damping_ref": quick, "damping_Ns_mm": coefficient / (1 + 20.0 / quick)}
    if shape == "squeezed_film":
        at = 1 - build.depth_mm / 2 / thick
        told = {"damping_form": 9, "damping_ref": thick, "damping_Ns_mm": coefficient * at**3}
    build.plant.numbers.update(told)
    return {"coefficient": coefficient}
