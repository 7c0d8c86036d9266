"""Outside the catalogue: what real soft pads do that none of its ids says. All are silent where nothing touches.

Sources. Drainage: Biot (1941), Terzaghi (1943), permeability that falls with compaction after Lai and Mow (1980), the
spherical indenter after Hu, Zhao, Vlassak and Suo (2010). Relaxation that is no filter of an elastic force: Schapery
(1969), Bergström and Boyce (1998). Temperature: rubber-like moduli and Arrhenius shifts in Ferry (1980), heat into a
thin body as one capacity (Carslaw and Jaeger 1959). Ageing: Struik (1978); its stiffening of soft glasses in Fielding,
Sollich and Cates (2000). Buckling of cells: Gibson and Ashby (1997), rows that snap one by one in Papka and Kyriakides
(1994), hysteresis of a chain of bistable springs in Puglisi and Truskinovsky (2000). Friction between probe and pad:
Spence (1975), Storåkers and Elaguine (2005), stick and slip in Bowden and Tabor (1950).

Effects that scale the elastic force or the rates go in by `gain` and `rate_factor`. Those that are another pad are
simulated as such beside the plain pad by `pad_N`, and what the two differ by is felt at the probe.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numba import njit
from scipy.optimize import nnls
from scipy.signal import lfilter

from ..pad import Pad
from .plant import Along
from .registry import Build, judge_effect, spread

_GAS_J_mol_K, _ROOM_K = 8.314, 296.0
_POINTS = 4001

# --- another pad ----------------------------------------------------------------------------------------------------

#: Columns of a table over depth: elastic force, what drives the modes of the solid and of the fluid, and the factor
#: of the fluid's rates.
_ELASTIC, _SOLID, _FLUID, _RATE = range(4)


@njit(cache=True)
def _step(table, mm, s, h, held, weights, rates, kinds, power, scale_N, last, q, new):
    """Force at the end of a step that brings the surface to depth s; `new` are the modes there."""
    i = min(int(s / mm), table.shape[0] - 2)
    a = s / mm - i
    force = held * ((1 - a) * table[i, _ELASTIC] + a * table[i + 1, _ELASTIC])
    factor = (1 - a) * table[i, _RATE] + a * table[i + 1, _RATE]
    for k in range(weights.shape[0]):
        kind = kinds[k]
        half = 0.5 * ((1 - a) * table[i, kind] + a * table[i + 1, kind] - last[kind])
        middle = q[k] + half
        if kind == _FLUID:
            middle *= np.exp(-rates[k] * factor * h)
        elif power == 1.0:
            middle *= np.exp(-rates[k] * h)
        else:
            way = (power - 1) * rates[k] * h * (abs(middle) / scale_N) ** (power - 1)
            middle *= (1 + way) ** (-1 / (power - 1))
        new[k] = middle + half
        force += weights[k] * new[k]
    return force


@njit(cache=True)
def _along(depth_mm, h, unilateral, table, mm, held, weights, rates, kinds, power, scale_N):
    n, r = depth_mm.shape[0], weights.shape[0]
    force, q, new = np.zeros(n), np.zeros(r), np.zeros(r)
    last = table[0].copy()
    surface = 0.0
    for j in range(n):
        s = max(depth_mm[j], 0.0)
        F = _step(table, mm, s, h, held, weights, rates, kinds, power, scale_N, last, q, new)
        if unilateral and (F < 0 or depth_mm[j] <= 0):
            # Not touched: the surface goes to where there is no force, by secants, and never rises above where it was.
            high, least = surface, 0.0
            F_high = _step(table, mm, high, h, held, weights, rates, kinds, power, scale_N, last, q, new)
            F_least = _step(table, mm, least, h, held, weights, rates, kinds, power, scale_N, last, q, new)
            s = least if F_least >= 0 else high
            if F_least < 0 < F_high:
                old, s, F_old = high, max(high - mm, 0.0), F_high
                for _ in range(12):
                    F = _step(table, mm, s, h, held, weights, rates, kinds, power, scale_N, last, q, new)
                    if abs(F) < 1e-10 or F_old == F:
                        break
                    old, F_old, s = s, F, min(max(s - F * (s - old) / (F - F_old), 0.0), high)
            _step(table, mm, s, h, held, weights, rates, kinds, power, scale_N, last, q, new)
            F = 0.0
        force[j], surface = F, s
        i = min(int(s / mm), table.shape[0] - 2)
        for kind in range(4):
            last[kind] = table[i, kind] + (s / mm - i) * (table[i + 1, kind] - table[i, kind])
        q[:] = new
    return force


Curve = Callable[[np.ndarray, np.ndarray], np.ndarray]  # (depth mm, elastic force N) → values


def pad_N(
    pad: Pad,
    time_s: np.ndarray,
    depth_mm: np.ndarray,
    solid: Curve | None = None,
    power: float = 1.0,
    scale_N: float = 1.0,
    fluid: Curve | None = None,
    drains: Curve | None = None,
    spectrum: tuple[np.ndarray, np.ndarray] | None = None,
) -> np.ndarray:
    """Force of a pad  F = c_0 u + Σ c_i q_i + Σ w_k p_k  on an even grid of time.

    q_i' = d(solid)/dt − ν_i q_i (|q_i|/scale)^(power − 1),  p_k' = d(fluid)/dt − r_k drains(δ) p_k,  with u = F^e(δ),
    solid(δ, u) = u, no fluid, and `spectrum` the w_k and r_k. δ is the probe's, or the free surface's where the force
    would be tension in a unilateral pad.
    """
    table = np.zeros((_POINTS, 4))
    depth, mm = np.linspace(0.0, 1.05 * max(float(np.max(depth_mm)), 0.0) + 0.1, _POINTS, retstep=True)
    u = pad.law.force(depth)
    table[:, _ELASTIC], table[:, _SOLID] = u, u if solid is None else solid(depth, u)
    table[:, _FLUID] = 0.0 if fluid is None else fluid(depth, u)
    table[:, _RATE] = 1.0 if drains is None else drains(depth, u)
    more, more_rates = spectrum or (np.zeros(0), np.zeros(0))
    weights = np.concatenate([pad.shares, more]).astype(float)
    rates = np.concatenate([pad.rates, more_rates]).astype(float)
    kinds = np.array([_SOLID] * len(pad.shares) + [_FLUID] * len(more), dtype=np.int64)
    modes = (1.0 - sum(pad.shares), weights, rates, kinds, float(power), float(scale_N))
    h = float(time_s[1] - time_s[0])
    return _along(np.asarray(depth_mm, float), h, pad.contact == "unilateral", table, float(mm), *modes)


def _felt(build: Build, **other) -> None:
    """What a pad of another kind differs by from the plain one."""
    plant = build.plant
    plant.felt.append(lambda t, x, v, a: pad_N(plant.pad, t, x, **other) - pad_N(plant.pad, t, x))


# --- drainage -------------------------------------------------------------------------------------------------------


def consolidation() -> tuple[np.ndarray, np.ndarray]:
    """Weights and rates of the mean pressure in a layer drained at its face: 8/(π² n²), n² in units of π² D/(4 H²)."""
    n = np.arange(1, 20, 2)
    return (1 / n**2) / np.sum(1 / n**2), n.astype(float) ** 2


def under_a_sphere() -> tuple[np.ndarray, np.ndarray]:
    """Exponentials that add to 0.491 e^{−0.908 √τ} + 0.509 e^{−1.679 τ}, rates in units of D/a²."""
    tau, rates = np.geomspace(1e-3, 50, 300), np.geomspace(0.02, 300, 13)
    wanted = 0.491 * np.exp(-0.908 * np.sqrt(tau)) + 0.509 * np.exp(-1.679 * tau)
    weights, _ = nnls(np.exp(-np.outer(tau, rates)), wanted)
    kept = weights > 1e-3
    return weights[kept] / weights[kept].sum(), rates[kept]


@judge_effect("poroelasticity", "compacting_layer", "wet_sphere")
def poroelasticity(build: Build, shape: str, size: float) -> dict[str, float]:
    """Pore pressure that carries P at the greatest depth if pressed at once, and drains at a rate that hangs on depth.

    `compacting_layer`: a layer drained at its face, pressure with δ, permeability e^{−M δ/δ_max}, M of 1.5 to 3.5.
    `wet_sphere`: pressure with δ^{3/2}, rates D/a² = r δ_max/δ of a contact that grows (from 2 % of δ_max on). P is
    17 to 35 % of the elastic force, the slow rate 0.15–1.5 /s at half of the greatest depth. Stated: P and that rate.
    """
    rng, deepest = build.rng, build.depth_mm
    most, rate = 0.25 * build.force_N * size * spread(rng, 0.7, 1.4), spread(rng, 0.15, 1.5)
    compacts = float(rng.uniform(1.5, 3.5))
    if shape == "compacting_layer":
        weights, rates = consolidation()
        curves = {
            "fluid": lambda d, u: d / deepest,
            "drains": lambda d, u: rate * np.exp(-compacts * (d / deepest - 0.5)),
        }
    else:
        weights, rates = under_a_sphere()
        curves = {
            "fluid": lambda d, u: (d / deepest) ** 1.5,
            "drains": lambda d, u: rate * 0.5 / np.maximum(d / deepest, 0.02),
        }
    _felt(build, spectrum=(most * weights, rates), **curves)
    return {"pressure": most, "rate": rate}


# --- relaxation that is no filter of an elastic force ---------------------------------------------------------------


@judge_effect("nonlinear_viscoelasticity", "schapery", "bergstrom_boyce")
def nonlinear_viscoelasticity(build: Build, shape: str, size: float) -> dict[str, float]:
    """`schapery`: the modes are driven by h(δ) u, h = 1 + s (2 δ/δ_max − 1), s = 1 − e^{−0.7} or so; c_0 by u.

    `bergstrom_boyce`: flow of a power of the overstress, q' = u̇ − ν q (|q|/q_0)^{m−1}, m of about 2, q_0 of 0.3 of
    the greatest elastic force. Stated: s, or m − 1.
    """
    deepest, force = build.depth_mm, build.force_N
    if shape == "schapery":
        share = -float(np.expm1(-0.7 * size * spread(build.rng, 0.7, 1.4)))
        _felt(build, solid=lambda d, u: u * (1 + share * (2 * d / deepest - 1)))
        return {"share": share}
    excess = size * spread(build.rng, 0.7, 1.4)
    _felt(build, power=1 + excess, scale_N=0.3 * force)
    return {"excess": excess}


# --- temperature and age --------------------------------------------------------------------------------------------


def _warms(shape: str, tau_s: float) -> Along:
    """Share of the whole rise of temperature."""

    def room(t, x):
        return -np.expm1(-t / tau_s)

    def probe(t, x):  # θ' = (1 − θ)/τ while touched, −θ/τ in air; exact for contact that stays within a step
        k = float(-np.expm1(-(t[1] - t[0]) / tau_s))
        return lfilter([0.0, k], [1.0, k - 1.0], np.asarray(x > 0, float))

    return room if shape == "room" else probe


@judge_effect("heating", "room", "warm_probe")
def heating(build: Build, shape: str, size: float) -> dict[str, float]:
    """The pad gets warmer by ΔT θ: stiffness e^{−0.025 ΔT θ}, rates e^{(E/R)(1/T_0 − 1/T)}, E of 60–100 kJ/mol.

    `room`: θ = 1 − e^{−t/τ}, τ of 15–50 s. `warm_probe`: θ' = (1 − θ)/τ while touched, −θ/τ in air, τ of 4–15 s.
    ΔT of about 7 K. Stated: ΔT and τ.
    """
    rng = build.rng
    rise = 7.0 * size * spread(rng, 0.7, 1.4)
    tau = spread(rng, 15.0, 50.0) if shape == "room" else spread(rng, 4.0, 15.0)
    energy = float(rng.uniform(60e3, 100e3)) / _GAS_J_mol_K
    share = _warms(shape, tau)
    build.plant.gain.append(lambda t, x: np.exp(-0.025 * rise * share(t, x)))
    build.plant.rate_factor.append(lambda t, x: np.exp(energy * (1 / _ROOM_K - 1 / (_ROOM_K + rise * share(t, x)))))
    return {"rise": rise, "time_constant": tau}


@judge_effect("physical_ageing", "struik", "soft_glass")
def physical_ageing(build: Build, shape: str, size: float) -> dict[str, float]:
    """Rates (1 + t/t_e)^{−μ}, μ of 0.7–1, t_e of about 10 s (over size) since the pad was made anew or kneaded.

    `soft_glass`: stiffness 1 + κ ln(1 + t/t_e) too, κ of 0.02–0.05. Stated: t_e and μ.
    """
    rng = build.rng
    age, exponent, stiffer = (
        spread(rng, 7.0, 14.0) / max(size, 1e-9),
        float(rng.uniform(0.7, 1.0)),
        float(rng.uniform(0.02, 0.05)),
    )
    build.plant.rate_factor.append(lambda t, x: (1 + t / age) ** -exponent)
    if shape == "soft_glass":
        build.plant.gain.append(lambda t, x: 1 + stiffer * np.log1p(t / age))
    return {"age": age, "exponent": exponent}


# --- cells and contact ----------------------------------------------------------------------------------------------


@njit(cache=True)
def _buckled(x, folds, opens):
    """Share of the rows that are folded."""
    share, folded = np.zeros(x.shape[0]), np.zeros(folds.shape[0], dtype=np.bool_)
    for j in range(x.shape[0]):
        count = 0
        for i in range(folds.shape[0]):
            if x[j] >= folds[i]:
                folded[i] = True
            elif x[j] <= opens[i]:
                folded[i] = False
            count += folded[i]
        share[j] = count / folds.shape[0]
    return share


@judge_effect("cell_buckling", "snapping_rows", "many_cells")
def cell_buckling(build: Build, shape: str, size: float) -> dict[str, float]:
    """Rows of cells fold at depths δ_i and open at r δ_i: stiffness 1 − s b, b the share of those folded.

    δ_i are even over 0.15–0.9 of the greatest depth, r of 0.5–0.75, s = 1 − e^{−0.4} or so. `snapping_rows`: 5 to 8
    rows; `many_cells`: 64 of them. Stated: s and r.
    """
    rng = build.rng
    share = -float(np.expm1(-0.4 * size * spread(rng, 0.7, 1.4)))
    opens = float(rng.uniform(0.5, 0.75))
    rows = int(rng.integers(5, 9)) if shape == "snapping_rows" else 64
    folds = np.linspace(0.15, 0.9, rows) * build.depth_mm
    build.plant.gain.append(lambda t, x: 1 - share * _buckled(x, folds, opens * folds))
    return {"share": share, "opens": opens}


@njit(cache=True)
def _slides(x, reach, grips):
    """−1 to 1: how far the pad's surface is held back along the face of the probe.

    By d ln δ / reach towards the sign of the way; or, if `grips` is positive, by dδ / reach up to 1, where it slips
    back to 1 − grips.
    """
    held = np.zeros(x.shape[0])
    s, was = 0.0, 0.0
    for j in range(x.shape[0]):
        now = max(x[j], 0.0)
        if now <= 0:
            s = 0.0
        elif grips > 0:
            s += (now - was) / reach
            if abs(s) > 1:
                s = np.sign(s) * (1 - grips)
        elif was <= 0:
            s = 1.0
        elif now != was:
            to = np.sign(now - was)
            s = to + (s - to) * (min(now, was) / max(now, was)) ** (1 / reach)
        held[j], was = s, now
    return held


@judge_effect("probe_friction", "partial_slip", "stick_slip")
def probe_friction(build: Build, shape: str, size: float) -> dict[str, float]:
    """The surface rubs along the face of the probe: elastic force times 1 + k s, s from −1 on the way out to 1 in.

    `partial_slip`: ds = (±1 − s) |d ln δ|/λ, λ of 0.1–0.25, self-similar. `stick_slip`: s grows by dδ/l, l of 2–5 % of
    the greatest depth, and slips at ±1 back to ±0.2–0.6. k of about 0.04. Stated: k.
    """
    rng = build.rng
    share = min(0.04 * size * spread(rng, 0.7, 1.4), 0.5)
    reach, stick, back = spread(rng, 0.1, 0.25), spread(rng, 0.02, 0.05) * build.depth_mm, float(rng.uniform(0.2, 0.6))
    told = (reach, 0.0) if shape == "partial_slip" else (stick, 1 - back)
    build.plant.gain.append(lambda t, x: 1 + share * _slides(x, *told))
    return {"share": share}
