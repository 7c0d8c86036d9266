"""The seventh shapes of the pad's own effects. Those in which force and motion act on each other are forms of `kernel`.

Sources: rubbers that heal together by the root of time (Wool and O'Connor 1981); a cohesive zone of even stress
(Dugdale 1960, Maugis 1992) and cups that hold by suction, whose gas follows Boyle; masses of fibres (van Wyk 1946)
and hyperbolae of soils and soft gels (Kondner 1963); fillers that come off beyond a strain (Govindjee and Simo 1991)
and unloading and reloading on paths of their own (Rickaby and Scott 2013); damage layer by layer (Lemaitre, A Course
on Damage Mechanics) and by the range of each stroke (Basquin 1910, Miner 1945, Matsuishi and Endo 1968); set that
goes with speed (Cowper and Symonds 1957) and shakes down (Melan 1938); diffusion out of a sphere (Crank, The
Mathematics of Diffusion) and chains that let go in pairs (des Cloizeaux 1988); permeability by porosity (Kozeny 1927,
Carman 1937) and rates by the load (Zhurkov 1965); thinning after Carreau (1972) and dampers whose valves open (Dixon,
The Shock Absorber Handbook).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numba import njit
from scipy.optimize import brentq

from ..laws import Law, _Tabulated
from .curves import stretched
from .modes import add_modes, drawn_mode
from .registry import Build, more_shapes, spread
from .sixth_pad import _visits
from .structure import hide_law
from .third_outside_bench import _fades


@more_shapes("separation", "heals")
def separation(build: Build, shape: str, size: float) -> dict[str, float]:
    """The lab believes `bonded`. It bears 2 % of the greatest force after 1 to 4 s of contact, by its root."""
    build.believed = replace(build.believed, contact="bonded")
    stick = 0.02 * min(size, 2.0) * build.force_N
    build.plant.numbers.update(stick_N=stick, stick_s=spread(build.rng, 1.0, 4.0))
    return {}


@more_shapes("adhesion", "dugdale", "suction")
def adhesion(build: Build, shape: str, size: float) -> dict[str, float]:
    """P over all of the range, on the way in too, and nothing beyond; or a cup whose seal breaks at the range.

    `suction`: 1.3 P g/(g + 0.3 r), after it was pressed on; P is what it bears when it breaks.
    """
    pull_off, reach = 0.1 * size * spread(build.rng, 0.7, 1.5), 0.05 * spread(build.rng, 0.6, 1.6)
    form = 13 if shape == "dugdale" else 14
    build.plant.numbers.update(adhesion_form=form, pull_off_N=pull_off, adhesion_mm=reach)
    return {"pull_off": pull_off, "range": reach}


@dataclass(frozen=True)
class VanWyk(_Tabulated):
    """A mass of fibres of thickness H that bend between their contacts: F = A ((1 − δ/H)^{−3} − 1)."""

    name: ClassVar[str] = "van_wyk"
    modulus: float
    thickness: float

    def curve(self, depth_mm: np.ndarray) -> np.ndarray:
        return self.modulus * (stretched(depth_mm, self.thickness) ** -3 - 1)


@dataclass(frozen=True)
class Kondner(_Tabulated):
    """A hyperbola, F = A δ/(δ + d), which goes towards A."""

    name: ClassVar[str] = "kondner"
    modulus: float
    scale: float

    def curve(self, depth_mm: np.ndarray) -> np.ndarray:
        return self.modulus * depth_mm / (depth_mm + self.scale)


@more_shapes("elastic_law", "van_wyk", "kondner")
def elastic_law(build: Build, shape: str, size: float) -> dict[str, Any]:
    """The true law is that of the name; the believed one is fitted to it. Sizes but 1 lie between (or beyond) both."""
    rng, depth = build.rng, build.depth_mm
    strain, scale = float(rng.uniform(0.4, 0.55)), float(rng.uniform(0.5, 1.5))
    other: Law = VanWyk(1.0, depth / strain) if shape == "van_wyk" else Kondner(1.0, scale * depth)
    other = other.with_parameters({"modulus": build.force_N / float(other.force(depth))})
    return hide_law(build, shape, other, size)


@njit(cache=True)
def _leaves(x, way):
    """From 0 to 1 within `way` as it goes out, and back to 0 within as much as it comes in."""
    out, w = np.zeros(x.shape[0]), 0.0
    for k in range(1, x.shape[0]):
        w = min(max(w - (x[k] - x[k - 1]) / way, 0.0), 1.0)
        out[k] = w
    return out


@more_shapes("stress_softening", "debonding", "two_paths")
def stress_softening(build: Build, shape: str, size: float) -> dict[str, float]:
    """η = 1 − s D(δ_max) (1 − e^{−q}), q = (δ_max − δ)/d; or 1 − s (1 − e^{−q}) on the way out and less of it back in.

    `debonding`: D is 0 up to 0.1 to 0.3 of the greatest depth, and straight from there to 1 at it. `two_paths`: 0.55 to
    0.75 of it on the way in, a twentieth of the depth after a turn. Stated is s.
    """
    rng, deepest = build.rng, build.depth_mm
    share, depth = min(0.15 * size * spread(rng, 0.7, 1.4), 0.6), 0.5 * spread(rng, 0.6, 1.6)
    begins, back, way = deepest * float(rng.uniform(0.1, 0.3)), float(rng.uniform(0.55, 0.75)), 0.05 * deepest

    def gain(t, x):
        inner = np.maximum(x, 0.0)
        most = np.maximum.accumulate(inner)
        if shape == "debonding":
            whole = np.clip((most - begins) / (deepest - begins), 0.0, 1.2)
        else:
            whole = back + (1 - back) * _leaves(x, way)
        return 1 + share * whole * np.expm1(-(most - inner) / depth)

    build.plant.gain.append(gain)
    return {"share": share, "depth": depth}


@njit(cache=True)
def _layered(x, elastic, edges, pitch, per_pass):
    """Gain of layers `pitch` thick, each of which loses `per_pass` (as a logarithm) as the probe goes in through it.

    elastic (n,): of the law at x; edges: of the law at the layers' upper sides.
    """
    count = edges.shape[0]
    out, kept = np.ones(x.shape[0]), np.ones(count)
    for k in range(1, x.shape[0]):
        begin, end = max(x[k - 1], 0.0), max(x[k], 0.0)
        i = min(int(begin / pitch), count - 1)
        while end > begin:
            until = end if i == count - 1 else min(end, (i + 1) * pitch)
            kept[i] *= np.exp(-per_pass * (until - begin) / pitch)
            begin = until
            i = min(i + 1, count - 1)
        if elastic[k] <= 0:
            out[k] = kept[0]
            continue
        last, total = min(int(end / pitch), count - 1), 0.0
        for i in range(last):
            total += kept[i] * (edges[i + 1] - edges[i])
        out[k] = (total + kept[last] * (elastic[k] - edges[last])) / elastic[k]
    return out


@njit(cache=True)
def _by_stroke(x, most, power):
    """Σ most (stroke/most)^power over the strokes in contact that have ended in a turn."""
    out, low, total, goes_in = np.zeros(x.shape[0]), max(x[0], 0.0), 0.0, True
    for k in range(1, x.shape[0]):
        now, before = max(x[k], 0.0), max(x[k - 1], 0.0)
        if now < before and goes_in:
            total += most * ((before - low) / most) ** power
            goes_in = False
        elif now > before and not goes_in:
            low, goes_in = before, True
        out[k] = total
    return out


@more_shapes("damage", "layers", "by_stroke")
def damage(build: Build, shape: str, size: float) -> dict[str, float]:
    """Forty layers, each of which tires as it is gone through; or strokes that cost by a power of their range.

    `layers`: e^{−r D n} of its own for the n-th time, D the greatest depth. `by_stroke`: at each turn, with a power of
    1.5 to 2.5. Either way r is the mean rate of a stroke from the surface to the greatest depth.
    """
    rate, power = 0.01 * size * spread(build.rng, 0.6, 1.6), float(build.rng.uniform(1.5, 2.5))
    deepest, law = build.depth_mm, build.plant.pad.law
    edges = law.force(deepest / 40 * np.arange(40.0))

    def gain(t, x):
        if shape == "layers":
            return _layered(x, law.force(x), edges, deepest / 40, rate * deepest)
        return np.exp(-rate * _by_stroke(x, deepest, power))

    build.plant.gain.append(gain)
    return {"rate": rate}


@njit(cache=True)
def _pressed(x, h, speed, power):
    """∫ (speed/v)^power dδ_max, the factor within 0.3 and 3."""
    out, deepest, sunk = np.zeros(x.shape[0]), 0.0, 0.0
    for k in range(1, x.shape[0]):
        if x[k] > deepest:
            factor = (speed * h / max(x[k] - x[k - 1], 1e-12)) ** power
            sunk += min(max(factor, 0.3), 3.0) * (x[k] - deepest)
            deepest = x[k]
        out[k] = sunk
    return out


@more_shapes("permanent_set", "slow_presses", "shakes_down")
def permanent_set(build: Build, shape: str, size: float) -> dict[str, float]:
    """Slow presses leave more, by (v_ref/v)^p, p of 0.1 to 0.25; or each cycle a smaller part of what is still missing.

    `slow_presses`: stated is that at 20 mm/s. `shakes_down`: s δ_max (1 − a e^{−(N−1)/n}), a of 0.3 to 0.5, n of 1.5 to
    3, N how often it was near δ_max, each within 50 ms; stated is that in the end.
    """
    rng, rate = build.rng, min(0.03 * size * spread(build.rng, 0.7, 1.4), 0.3)
    power, missing, fold = float(rng.uniform(0.1, 0.25)), float(rng.uniform(0.3, 0.5)), float(rng.uniform(1.5, 3.0))

    def height(t, x):
        h = float(t[1] - t[0])
        if shape == "slow_presses":
            return rate * _pressed(x, h, 20.0, power)
        count = _fades(_visits(x) - 1, h, 0.05)
        return rate * np.maximum.accumulate(np.maximum(x, 0.0)) * (1 - missing * np.exp(-count / fold))

    build.plant.height.append(height)
    return {"set": rate}


def sphere_rates(rate: float, terms: int = 6) -> tuple[np.ndarray, np.ndarray]:
    """Shares and rates of what diffuses out of a sphere: 6/π² Σ e^{−n² ν t}/n²; the last takes what is left."""
    n = np.arange(1.0, terms + 1)
    weights = 6 / (np.pi * n) ** 2
    weights[-1] += 1 - weights.sum()
    return weights, rate * n**2


def pair_rates(rate: float) -> tuple[np.ndarray, np.ndarray]:
    """Shares and rates of (8/π² Σ e^{−p² s}/p²)², p = 1, 3, 5, 7, of which 1/e is left at 1/rate."""
    odd = np.array([1.0, 3.0, 5.0, 7.0])
    part = 1 / odd**2 / np.sum(1 / odd**2)
    first, second = np.triu_indices(4)
    weights = part[first] * part[second] * np.where(first == second, 1.0, 2.0)
    rates = odd[first] ** 2 + odd[second] ** 2
    unit = brentq(lambda s: float(weights @ np.exp(-rates * s)) - np.exp(-1.0), 1e-3, 10.0)
    return weights, rate * unit * rates


@more_shapes("missing_relaxation_mode", "sphere", "double_reptation")
def missing_relaxation_mode(build: Build, shape: str, size: float) -> dict[str, float]:
    """What diffuses out of grains, six terms, the slowest of which is stated; or chains that let go in pairs.

    `double_reptation`: stated is where 1/e of it is left.
    """
    share, rate = drawn_mode(build, size, 0.2, 20.0)
    weights, rates = sphere_rates(rate) if shape == "sphere" else pair_rates(rate)
    add_modes(build, share, weights, rates)
    return {"share": share, "rate": rate}


def permeability(strain: np.ndarray | float, porosity: float) -> np.ndarray:
    """φ³/(1 − φ)² over that at no strain, with φ = 1 − (1 − φ_0)/(1 − ε)."""
    left = np.maximum(1 - (1 - porosity) / (1 - np.asarray(strain, dtype=float)), 1e-3)
    return left**3 / (1 - left) ** 2 / (porosity**3 / (1 - porosity) ** 2)


@more_shapes("depth_dependent_relaxation", "kozeny", "zhurkov")
def depth_dependent_relaxation(build: Build, shape: str, size: float) -> dict[str, float]:
    """Pores that close let water through by φ³/(1 − φ)², φ_0 of 0.6 to 0.85; or an exponential of the load.

    Stated is the mean slope from the surface to the greatest depth. `kozeny`: slower the deeper. `zhurkov`: quicker.
    """
    rng, deepest, law, most = build.rng, build.depth_mm, build.plant.pad.law, build.force_N
    slope = size * (float(rng.uniform(-0.2, -0.1)) if shape == "kozeny" else float(rng.uniform(0.1, 0.3)))
    slope, porosity = max(slope, -0.8 / deepest), float(rng.uniform(0.6, 0.85))
    whole = 1 + slope * deepest
    strain = brentq(lambda e: float(permeability(e, porosity)) - min(whole, 1.0), 0.0, porosity - 1e-3)

    def factor(t, x):
        if shape == "kozeny":
            rates = permeability(strain * np.maximum(x, 0.0) / deepest, porosity)
        else:
            rates = np.exp(np.log(whole) * law.force(x) / most)
        # In steps of 0.1 %: each change costs the kernel new exponentials.
        return np.round(np.maximum(rates, 0.1), 3)

    build.plant.rate_factor.append(factor)
    return {"slope": slope}


@more_shapes("viscous_damping", "carreau", "blow_off")
def viscous_damping(build: Build, shape: str, size: float) -> dict[str, float]:
    """c_0 v (1 + (v/v_0)²)^{−0.3}, v_0 of 4 to 15 mm/s; or a valve that opens at 6 to 15 mm/s, a quarter beyond.

    Stated is F/v at 20 mm/s.
    """
    rng, coefficient = build.rng, size * spread(build.rng, 0.005, 0.02)
    quick, opens = spread(rng, 4.0, 15.0), spread(rng, 6.0, 15.0)
    told = {"damping_form": 12, "damping_ref": quick, "damping_Ns_mm": coefficient * (1 + (20.0 / quick) ** 2) ** 0.3}
    if shape == "blow_off":
        first = coefficient * 20.0 / (opens + 0.25 * (20.0 - opens))
        told = {"damping_form": 13, "damping_ref": opens, "damping_Ns_mm": first}
    build.plant.numbers.update(told)
    return {"coefficient": coefficient}
