"""The judge's shapes of what pad and contact do: letting go, adhesion, further relaxation, rates with depth, damping.

Sources. Letting go: an interface that opens from its edge (Kendall 1971; Maugis and Barquins 1978); a pad that clings
to the probe and is lifted off its seat. Adhesion: the curve of Johnson, Kendall and Roberts (1971) under fixed grips
(Maugis 2000); Lennard-Jones between sphere and plane in Derjaguin's approximation, with the contact of Derjaguin,
Muller and Toporov (1975; Greenwood 1997); a liquid bridge (Willett et al. 2000) that breaks at the root of its volume
(Lian, Thornton and Adams 1993). Relaxation: Fung's box spectrum (1972, 1993), the fractional Zener solid (Caputo and
Mainardi 1971; Koeller 1984), consolidation (Terzaghi 1943; Armstrong, Lai and Mow 1984). Rates: diffusion over the
radius of contact (Hu et al. 2010) or the thickness (Armstrong et al. 1984), stress activation (Eyring 1936; Tobolsky
and Eyring 1943). Damping: Tsuji, Tanaka and Ishida (1992), a dashpot behind a spring (Maxwell 1867; Bird et al. 1987),
fluid pressed out of open cells (Tyler and Ashby 1986; Gibson and Ashby 1997).

What acts by contact is felt at the probe: a twin of the plant without it tells where the probe is, whether it touches
and what the pad bears. Units: mm, N, s.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numba import njit
from scipy.optimize import brentq

from ..laws import Law
from .modes import add_modes, drawn_mode
from .plant import Fine, Plant, simulate
from .registry import Build, judge_shapes, spread


def twin(plant: Plant, time_s: np.ndarray, **numbers: Any) -> Fine:
    """The same plant without forces felt, and with some numbers of the kernel changed."""
    told = {"felt": [], "sensor": [], "numbers": plant.numbers | numbers}
    return simulate(replace(plant, **told), float(time_s[1] - time_s[0]))


def depth_mm(plant: Plant, fine: Fine) -> np.ndarray:
    """How deep the probe is below the surface of a virgin pad, negative in air."""
    return fine.probe_mm - float(plant.numbers.get("offset_mm", 0.0))


@njit(cache=True)
def _elastic_force(given, contact, c, nu, step_s):
    """u: as given while in contact, and  Σ c_i z_i  of the free surface out of it; z_i' = ν_i (u − z_i)."""
    u, z = given.copy(), np.zeros(c.shape[0])
    e = np.exp(-nu * step_s)
    k = (1 - e) / (nu * step_s)
    for j in range(1, u.shape[0]):
        if not contact[j]:
            held, remembered = 1.0, 0.0
            for i in range(c.shape[0]):
                held -= c[i] * (1 - k[i])
                remembered += c[i] * (u[j - 1] * k[i] + (z[i] - u[j - 1]) * e[i])
            u[j] = max(remembered / held, 0.0)
        for i in range(c.shape[0]):
            z[i] = u[j] - (u[j] - u[j - 1]) * k[i] + (z[i] - u[j - 1]) * e[i]
    return u


def gap_mm(plant: Plant, fine: Fine) -> np.ndarray:
    """From the probe to the pad's surface, which comes back by relaxation alone; 0 in contact."""
    depth, pad = depth_mm(plant, fine), plant.pad
    inner = np.maximum(depth, 0.0)
    c, nu = np.array(pad.shares, dtype=float), np.array(pad.rates, dtype=float)
    u = _elastic_force(pad.law.force(inner), fine.contact, c, nu, float(fine.time_s[1] - fine.time_s[0]))
    nodes = np.linspace(0.0, float(inner.max()) + 0.01, 4001)
    surface = np.where(fine.contact, inner, np.interp(u, pad.law.force(nodes), nodes))
    return np.maximum(surface - depth, 0.0)


# --- separation -----------------------------------------------------------------------------------------------------


@judge_shapes("separation", "edge_first", "lifted_pad")
def separation(build: Build, shape: str, size: float) -> dict[str, float]:
    """The lab believes `bonded`; nothing is stated.

    edge_first: four equal parts of the face, from the edge inwards, each the pad on a quarter of the area. They let go
    one by one, when the tension comes to  (1, 3, 5, 7)/4 T  by what the whole face would bear; T = 0.04 N, × 0.7–1.4.
    lifted_pad: the pad clings to the probe and comes off its seat at a tension of its weight, which hangs on the
    probe until it lands: F = −W where it is lifted; W = 0.015 N (a gram and a half), × 0.7–1.4. The few µm in which
    the seat takes the weight over again are left out.
    """
    plant = build.plant
    build.believed = replace(build.believed, contact="bonded")
    if shape == "edge_first":
        tensions = 0.04 * size * spread(build.rng, 0.7, 1.4) * np.array([0.25, 0.75, 1.25, 1.75])
        plant.numbers["stick_N"] = tensions[0]

        def others(t, x, v, a):
            parts = [twin(plant, t, stick_N=tension).pad_N for tension in tensions]
            return np.mean(parts, axis=0) - parts[0]

        plant.felt.append(others)
        return {}
    weight = 0.015 * size * spread(build.rng, 0.7, 1.4)
    plant.numbers["stick_N"] = weight

    def hangs(t, x, v, a):
        contact = twin(plant, t).contact
        return -weight * (~contact & np.logical_or.accumulate(contact))

    plant.felt.append(hangs)
    return {}


# --- adhesion -------------------------------------------------------------------------------------------------------


def _jkr_curve() -> tuple[np.ndarray, np.ndarray]:
    """Depth, and by how much the load is below that of Hertz there, from snap-off on.

    P = a³ − √6 a^{3/2},  δ = a² − (2/3) √6 a^{1/2};  snap-off of fixed grips at a³ = 1/6, pull-off P = −3/2.
    """
    a = (1 / 6) ** (1 / 3) * np.geomspace(1.0, 60.0, 6000)
    depth = a**2 - 2 / 3 * np.sqrt(6 * a)
    return depth, a**3 - np.sqrt(6 * a**3) - np.maximum(depth, 0.0) ** 1.5


_JKR_DEPTH, _JKR_LESS = _jkr_curve()


def jkr(share: np.ndarray, load: np.ndarray) -> np.ndarray:
    """Attraction in units of the pull-off: at a share of the gap of snap-off, or under a load in those units.

    8/9 at first touch, 1 at 0.48 of the gap, 5/9 at snap-off; 2/3 under large loads.
    """
    depth = np.where(share > 0, _JKR_DEPTH[0] * share, (1.5 * np.maximum(load, 0.0)) ** (2 / 3))
    return -np.interp(depth, _JKR_DEPTH, _JKR_LESS) / 1.5


def lennard_jones(way: np.ndarray) -> np.ndarray:
    """Attraction of sphere and plane over 1 + gap/ε, 1 at contact: (4/3) s^{−2} − (1/3) s^{−8}."""
    return 4 / 3 * way**-2.0 - way**-8.0 / 3


def willett(gap: np.ndarray) -> np.ndarray:
    """Attraction of a liquid bridge over gap/√(V/R), 1 at contact: 1/(1 + 1.05 s + 2.5 s²)."""
    return 1 / (1 + 1.05 * gap + 2.5 * gap**2)


#: Where they have fallen to 1/e: ε and √(V/R) in units of the range.
_EPSILON = 1 / (brentq(lambda s: lennard_jones(s) - np.exp(-1), 1.1, 9.0) - 1)
_ROOT = 1 / brentq(lambda s: willett(s) - np.exp(-1), 0.1, 9.0)


def attached(touching: np.ndarray, apart: np.ndarray) -> np.ndarray:
    """Whether it has touched since it was last apart."""
    index = np.arange(len(touching))
    last = [np.maximum.accumulate(np.where(when, index, -1)) for when in (touching, apart)]
    return last[0] > last[1]


@judge_shapes("adhesion", "jkr_curve", "lennard_jones", "willett_bridge")
def adhesion(build: Build, shape: str, size: float) -> dict[str, float]:
    """An attraction beside the pad's own force, by the gap to its surface; 0.1 N × 0.7–1.5 and 0.05 mm × 0.6–1.6.

    jkr_curve: from touch on the load is below that of Hertz by what JKR says, and the contact is stretched until it
    snaps off at a gap: the range. lennard_jones: P [(4/3) (1 + g/ε)^{−2} − (1/3) (1 + g/ε)^{−8}], in and out alike.
    willett_bridge: from touch on P/(1 + 1.05 s + 2.5 s²), s = g/√(V/R), until it breaks at V^{1/3}; R = 3–8 mm.
    Stated are the greatest pull P and the gap of snap-off, or the one at which 1/e of the pull is left.
    """
    rng, plant = build.rng, build.plant
    pull_off, reach = 0.1 * size * spread(rng, 0.7, 1.5), 0.05 * spread(rng, 0.6, 1.6)
    root_mm = _ROOT * reach
    breaks_mm = reach if shape == "jkr_curve" else (root_mm**2 * float(rng.uniform(3, 8))) ** (1 / 3)

    def act(t, x, v, a):
        fine = twin(plant, t)
        gap = gap_mm(plant, fine)
        if shape == "lennard_jones":
            return -pull_off * lennard_jones(1 + gap / (_EPSILON * reach))
        holds = attached(fine.contact & (depth_mm(plant, fine) > 0), gap > breaks_mm)
        if shape == "jkr_curve":
            return -pull_off * holds * jkr(np.minimum(gap / reach, 1.0), fine.pad_N / pull_off)
        return -pull_off * holds * willett(gap / root_mm)

    plant.felt.append(act)
    return {"pull_off": pull_off, "range": reach}


# --- relaxation that the belief lacks -------------------------------------------------------------------------------


def box(width: float, points: int = 6) -> tuple[np.ndarray, np.ndarray]:
    """Shares and rates of a spectrum that is even in the logarithm of time, rates from width^{−1/2} to width^{1/2}."""
    nodes, weights = np.polynomial.legendre.leggauss(points)
    return weights / 2, width ** (nodes / 2)


def mittag_leffler(order: float, points: int = 9) -> tuple[np.ndarray, np.ndarray]:
    """Shares and rates of E_α(−t^α), by the quantiles q of its rates: r^α = sin πα q / sin πα(1 − q)."""
    nodes, weights = np.polynomial.legendre.leggauss(points)
    q = (1 + nodes) / 2
    return weights / 2, (np.sin(np.pi * order * q) / np.sin(np.pi * order * (1 - q))) ** (1 / order)


def consolidation(terms: int = 6) -> tuple[np.ndarray, np.ndarray]:
    """Shares and rates of a layer drained at a face: Σ 8/(π n)² e^{−n² t} over odd n; the last has what is left."""
    n = 2.0 * np.arange(terms) + 1
    weights = 8 / (np.pi * n) ** 2
    weights[-1] = 1 - weights[:-1].sum()
    return weights, n**2


def to_one_e(weights: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """The rates scaled such that 1/e is left at a time of 1."""
    left = brentq(lambda log: weights @ np.exp(-rates * np.exp(log)) - np.exp(-1), -15, 15)
    return rates * np.exp(left)


@judge_shapes("missing_relaxation_mode", "fung_box", "fractional_zener", "drained_layer")
def missing_relaxation_mode(build: Build, shape: str, size: float) -> dict[str, float]:
    """A share of 0.08 × 0.7–1.4 that relaxes in a way of its own; its rate is 1 over the time at which 1/e is left.

    fung_box: [E_1(t/τ_2) − E_1(t/τ_1)]/ln(τ_2/τ_1), τ_2/τ_1 = 10–60. fractional_zener: E_α(−(t/τ)^α), α = 0.6–0.85.
    drained_layer: Σ 8/(π n)² e^{−n² t/τ}, n odd.
    """
    share, rate = drawn_mode(build, size, 0.2, 20.0)
    if shape == "fung_box":
        weights, rates = box(spread(build.rng, 10.0, 60.0))
    elif shape == "fractional_zener":
        weights, rates = mittag_leffler(float(build.rng.uniform(0.6, 0.85)))
    else:
        weights, rates = consolidation()
    add_modes(build, share, weights, rate * to_one_e(weights, rates))
    return {"share": share, "rate": rate}


# --- rates that go with depth ---------------------------------------------------------------------------------------

Factor = Callable[[np.ndarray], np.ndarray]


def nearest_slope(factor: Factor, deepest_mm: float) -> float:
    """s of the line 1 + s δ that is nearest to a factor over the depths from 0 to the deepest."""
    nodes, weights = np.polynomial.legendre.leggauss(40)
    depth = deepest_mm * (1 + nodes) / 2
    return float(weights @ ((factor(depth) - 1) * depth) / (weights @ depth**2))


def rates_with_depth(shape: str, slope: float, law: Law, deepest_mm: float) -> Factor:
    """The factor of the rates over depth, its one number such that the line nearest to it has that slope."""

    def of(number: float) -> Factor:
        if shape == "growing_contact":
            return lambda depth: 1 / (1 + number * depth)
        if shape == "thinning_layer":
            return lambda depth: (1 - np.minimum(number * depth, 0.9)) ** -2.0
        return lambda depth: np.exp(number * law.force(depth) / float(law.force(deepest_mm)))

    most = {"growing_contact": 1e3, "thinning_layer": 0.88, "stress_activated": 8.0}[shape]
    most = most / deepest_mm if shape == "thinning_layer" else most
    return of(brentq(lambda number: nearest_slope(of(number), deepest_mm) - slope, 0.0, most))


@judge_shapes("depth_dependent_relaxation", "growing_contact", "thinning_layer", "stress_activated")
def depth_dependent_relaxation(build: Build, shape: str, size: float) -> dict[str, float]:
    """All rates by a factor of depth; stated is the slope of the line 1 + s δ nearest to it over the depths pressed.

    growing_contact: 1/(1 + δ/d), a diffusion time that grows with the area of contact, which is linear in depth
    (s = −0.1 to −0.2 1/mm). thinning_layer: (1 − δ/H)^{−2}, diffusion through a layer that gets thinner.
    stress_activated: e^{F^e(δ)/F_s} (both 0.1 to 0.3 1/mm).
    """
    rng = build.rng
    growing = shape == "growing_contact"
    slope = size * float(rng.uniform(-0.2, -0.1) if growing else rng.uniform(0.1, 0.3))
    slope = max(slope, -0.8 / build.depth_mm)
    factor = rates_with_depth(shape, slope, build.plant.pad.law, build.depth_mm)
    build.plant.rate_factor.append(lambda t, x: factor(np.maximum(x, 0.0)))
    return {"slope": slope}


# --- damping --------------------------------------------------------------------------------------------------------


@njit(cache=True)
def _behind_spring(driven, touching, share):
    """A lag of what drives it, by a share of the way a step; let go it is at rest at once."""
    force = np.zeros(driven.shape[0])
    for j in range(1, driven.shape[0]):
        if touching[j]:
            force[j] = force[j - 1] + share * (driven[j] - force[j - 1])
    return force


@judge_shapes("viscous_damping", "tsuji", "sprung_dashpot", "open_cell")
def viscous_damping(build: Build, shape: str, size: float) -> dict[str, float]:
    """c v h(δ) while in contact, h = 1 at half the greatest depth; the pad does not pull. c = 0.005–0.02 N s/mm.

    tsuji: (δ/δ_ref)^{1/4}. sprung_dashpot: h = 1, and the dashpot is behind a spring: τ f' + f = c v, τ = 0.8–2.5 ms.
    open_cell: as 1/(1 − δ/H), H = 1.6 to 2.5 times the greatest depth. Stated is c.
    """
    rng, plant = build.rng, build.plant
    coefficient = size * spread(rng, 0.005, 0.02)
    tau, half = spread(rng, 0.8e-3, 2.5e-3), build.depth_mm / 2
    thickness = float(rng.uniform(1.6, 2.5)) * build.depth_mm

    def act(t, x, v, a):
        fine, step_s = twin(plant, t), float(t[1] - t[0])
        depth = depth_mm(plant, fine)
        touching, inner = fine.contact & (depth > 0), np.maximum(depth, 0.0)
        force = coefficient * np.gradient(depth, step_s) * touching
        if shape == "tsuji":
            force = force * (inner / half) ** 0.25
        elif shape == "open_cell":
            force = force * (1 - half / thickness) / (1 - np.minimum(inner / thickness, 0.9))
        else:
            force = _behind_spring(force, touching, -np.expm1(-step_s / tau))
        return np.maximum(force, -np.maximum(fine.pad_N, 0.0)) if plant.pad.contact == "unilateral" else force

    plant.felt.append(act)
    return {"coefficient": coefficient}
