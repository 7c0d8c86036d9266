"""The ninth shapes of the pad's own effects.

Sources: K. Kendall, Thin-film peeling: the elastic term, J. Phys. D 8 (1975); S. Niu et al., Theoretical study of
contact-mode triboelectric nanogenerators, Energy Environ. Sci. 6 (2013); S. Poivet, F. Nallet, C. Gay and P. Fabre,
Cavitation-induced force transition in confined viscous liquids under traction, Europhys. Lett. 62 (2003); S. Timoshenko
and J. Gere, Theory of Elastic Stability (1961), crooked columns; J. Almen and A. László, The uniform-section disk
spring, Trans. ASME 58 (1936); R. Long, K. Mayumi, C. Creton, T. Narita and C. Hui, Time dependent behavior of a dual
cross-link self-healing gel, Macromolecules 47 (2014); C. Horgan, R. Ogden and G. Saccomandi, A theory of stress
softening of elastomers based on finite chain extensibility, Proc. R. Soc. A 460 (2004); P. Paris and F. Erdogan, A
critical analysis of crack propagation laws, J. Basic Eng. 85 (1963); F. Abraham, T. Alshuth and S. Jerrams, The effect
of minimum stress and stress amplitude on the fatigue life of non strain crystallising elastomers, Mater. Des. 26
(2005); W. Prager, A new method of analyzing stresses and strains in work-hardening plastic solids, J. Appl. Mech. 23
(1956); R. Andrews, A. Tobolsky and E. Hanson, The theory of permanent set at elevated temperatures in natural and
synthetic rubber vulcanizates, J. Appl. Phys. 17 (1946); D. Pearson and E. Helfand, Viscoelastic properties of
star-shaped polymers, Macromolecules 17 (1984); C. Armstrong, W. Lai and V. Mow, An analysis of the unconfined
compression of articular cartilage, J. Biomech. Eng. 106 (1984); W. Moonan and N. Tschoegl, Effect of pressure on the
mechanical properties of polymers, Macromolecules 16 (1983); Y. Bernabé, The effective pressure law for permeability
during pore pressure and confining pressure cycling, J. Geophys. Res. 92 (1987); F. Moore, The rheology of ceramic slips
and bodies, Trans. Br. Ceram. Soc. 58 (1959); G. Scott Blair, The role of psychophysics in rheology, J. Colloid Sci. 2
(1947).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numba import njit
from scipy.optimize import brentq
from scipy.signal import lfilter
from scipy.special import gamma, j0, j1, jn_zeros

from ..laws import Law, _Tabulated
from .eighth_pad import _felt, _gap, _pad_alone, _unrelaxed
from .modes import add_modes, drawn_mode
from .outside_pad import _bonds
from .registry import Build, more_shapes, spread
from .structure import hide_law


@more_shapes("separation", "peels")
def separation(build: Build, shape: str, size: float) -> dict[str, float]:
    """The lab believes `bonded`. A twelfth of the surface is glued at first, and is peeled off as it is pulled at.

    What is left of it falls by e with an impulse of 0.2 to 0.8 s of the greatest force, for good.
    """
    build.believed = replace(build.believed, contact="bonded")
    impulse = build.force_N * spread(build.rng, 0.2, 0.8)

    def pull(t):
        free, held = (_pad_alone(build, t, adhesion_form=0, unilateral=kind) for kind in (True, False))
        gone = np.cumsum(np.maximum(-held, 0.0)) * (t[1] - t[0]) / impulse
        return size / 12 * np.exp(-gone) * (held - free)

    _felt(build, pull)
    return {}


@njit(cache=True)
def _charge(touching, h, takes, leaks_s):
    """Charge between 0 and 1: each touch takes a share of what is missing; it leaks away in air."""
    out, q, kept = np.zeros(touching.shape[0]), 0.0, np.exp(-h / leaks_s)
    for k in range(1, touching.shape[0]):
        if touching[k] and not touching[k - 1]:
            q += takes * (1 - q)
        elif not touching[k]:
            q *= kept
        out[k] = q
    return out


@more_shapes("adhesion", "charged", "viscous_film")
def adhesion(build: Build, shape: str, size: float) -> dict[str, float]:
    """Touches charge the surfaces, which attract each other, in contact and by the way in too; or a film is drawn.

    `charged`: P q²/(1 + g/d)², P/e at the range; each touch takes 0.4 to 0.6 of what is missing of q = 1, and it leaks
    within 5 to 20 s of air. `viscous_film`: P (v/v_0)/(1 + g/d)³ as the gap opens with v, and P, where the film
    cavitates, at most; P/e at the range at 10 mm/s, v_0 of 1 to 4 mm/s.
    """
    rng = build.rng
    pull_off, reach = 0.1 * size * spread(rng, 0.7, 1.5), 0.05 * spread(rng, 0.6, 1.6)
    takes, leaks_s, quick = float(rng.uniform(0.4, 0.6)), spread(rng, 5.0, 20.0), spread(rng, 1.0, 4.0)

    def pull(t):
        gap, h = _gap(build, t), float(t[1] - t[0])
        touching = gap == 0
        touching[0] = False
        if shape == "charged":
            return -pull_off * (_charge(touching, h, takes, leaks_s) / (1 + gap / reach * np.expm1(0.5))) ** 2
        opens = np.maximum(np.diff(gap, prepend=gap[0]) / h, 0.0)
        wet = np.maximum.accumulate(touching) & ~touching
        thick = reach / ((10.0 * np.e / quick) ** (1 / 3) - 1)
        return -pull_off * wet * np.minimum(opens / quick / (1 + gap / thick) ** 3, 1.0)

    _felt(build, pull)
    return {"pull_off": pull_off, "range": reach}


@dataclass(frozen=True)
class CrookedWalls(_Tabulated):
    """Walls that are a little crooked bow out below the load A that buckles them: δ/d = f + e ((1 − f)^{−2} − 1)."""

    name: ClassVar[str] = "crooked_walls"
    modulus: float
    crooked: float
    scale: float

    def curve(self, depth_mm: np.ndarray) -> np.ndarray:
        wanted, e = np.asarray(depth_mm, dtype=float) / self.scale, self.crooked
        # Newton from above: the left side is convex, so that every step stays above the root.
        f = np.minimum(wanted, 1 - (1 + wanted / e) ** -0.5)
        for _ in range(40):
            f = f - (f + e * ((1 - f) ** -2 - 1) - wanted) / (1 + 2 * e * (1 - f) ** -3)
        return self.modulus * f


@dataclass(frozen=True)
class DiscSpring(_Tabulated):
    """A conical disc, c times as high as it is thick: F = A x ((c − x)(c − x/2) + 1), x = δ/t; it is flat at x = c."""

    name: ClassVar[str] = "disc_spring"
    modulus: float
    cone: float
    thickness: float

    def curve(self, depth_mm: np.ndarray) -> np.ndarray:
        x = np.asarray(depth_mm, dtype=float) / self.thickness
        return self.modulus * x * ((self.cone - x) * (self.cone - x / 2) + 1)


@more_shapes("elastic_law", "crooked_walls", "disc_spring")
def elastic_law(build: Build, shape: str, size: float) -> dict[str, Any]:
    """The true law is that of the name; the believed one is fitted to it. Sizes but 1 lie between (or beyond) both."""
    rng, depth = build.rng, build.depth_mm
    crooked, used = spread(rng, 0.01, 0.05), float(rng.uniform(0.75, 0.88))
    cone, beyond = float(rng.uniform(1.05, 1.3)), float(rng.uniform(1.4, 1.9))
    walls: Law = CrookedWalls(1.0, crooked, depth / (used + crooked * ((1 - used) ** -2 - 1)))
    other = walls if shape == "crooked_walls" else DiscSpring(1.0, cone, depth / (beyond * cone))
    other = other.with_parameters({"modulus": build.force_N / float(other.force(depth))})
    return hide_law(build, shape, other, size)


@njit(cache=True)
def _learnt(x, h, takes_s):
    """A depth that goes after the probe while that is deeper, within `takes_s`."""
    out, m, part = np.zeros(x.shape[0]), max(x[0], 0.0), -np.expm1(-h / takes_s)
    out[0] = m
    for k in range(1, x.shape[0]):
        if x[k] > m:
            m += (x[k] - m) * part
        out[k] = m
    return out


@more_shapes("stress_softening", "takes_time", "chain_limit")
def stress_softening(build: Build, shape: str, size: float) -> dict[str, float]:
    """1 − s (1 − e^{−(M − δ)/d}), where bonds take 0.1 to 0.4 s to break, so that M is short of the deepest point.

    `chain_limit`: (J − m²)/(J − δ²), m the deepest point and J the chains' own, both in greatest depths; s is lost at
    2 `depth` below the greatest depth, at 0.8 of it where that would lie in air.
    """
    rng, deepest = build.rng, build.depth_mm
    share, depth = min(0.15 * size * spread(rng, 0.7, 1.4), 0.6), 0.5 * spread(rng, 0.6, 1.6)
    takes_s, there = spread(rng, 0.1, 0.4), max(1 - 2 * depth / deepest, 0.2)
    limit = (1 - (1 - share) * there**2) / share

    def gain(t, x):
        inner = np.maximum(x, 0.0)
        if shape == "takes_time":
            learnt = _learnt(inner, float(t[1] - t[0]), takes_s)
            return 1 + share * np.expm1(-np.maximum(learnt - inner, 0.0) / depth)
        now, most = (np.minimum((at / deepest) ** 2, 0.98 * limit) for at in (inner, np.maximum.accumulate(inner)))
        return (limit - most) / (limit - now)

    build.plant.gain.append(gain)
    return {"share": share, "depth": depth}


@njit(cache=True)
def _crack(x, most, power, grows, stops):
    """Length of a crack, 1 at first: da = grows a^{m/2} d(stroke/most)^m along each stroke in, up to `stops`."""
    out, low, a = np.ones(x.shape[0]), max(x[0], 0.0), 1.0
    for k in range(1, x.shape[0]):
        before, now = max(x[k - 1], 0.0), max(x[k], 0.0)
        if now < before:
            low = now
        else:
            way = ((now - low) / most) ** power - ((before - low) / most) ** power
            a = min(a + grows * a ** (power / 2) * way, stops)
        out[k] = a
    return out


def lost_work(u: np.ndarray, h: float, shares: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """Σ c ν ∫ w² dt of the modes w' = u' − ν w, from rest."""
    total = np.zeros_like(u)
    for c, nu in zip(shares, rates, strict=True):
        kept = np.exp(-nu * h)
        w = lfilter([(1 - kept) / (nu * h)], [1.0, -kept], np.diff(u, prepend=0.0))
        total += c * nu * w * w
    return total * h


@more_shapes("damage", "crack", "by_loss")
def damage(build: Build, shape: str, size: float) -> dict[str, float]:
    """A crack grows by a power of the stroke, and the faster the longer it is; or e^{−r Λ} by what the modes dissipate.

    `crack`: a power of 2.1 to 2.6; by 3 to 8 % in a stroke to the greatest depth, of which r is the mean rate at first;
    the stiffness falls by e with its length, and it stops at three times that. `by_loss`: under the surface, at rest
    too; r is the mean over all of the way of loading.
    """
    rng, rate, deepest = build.rng, 0.01 * size * spread(build.rng, 0.6, 1.6), build.depth_mm
    power, grows = float(rng.uniform(2.1, 2.6)), spread(rng, 0.03, 0.08)
    # After the first stroke a^{1 − m/2} = 1 − (m/2 − 1) grows.
    first = (1 - (power / 2 - 1) * grows) ** (-1 / (power / 2 - 1)) - 1

    def gain(t, x):
        inner = np.maximum(x, 0.0)
        if shape == "crack":
            return np.exp(-rate * deepest / first * (_crack(x, deepest, power, grows, 3.0) - 1))
        pad, h = build.plant.pad, float(t[1] - t[0])
        lost = lost_work(pad.law.force(inner), h, np.array(pad.shares), np.array(pad.rates))
        whole = np.cumsum(np.where(inner > 0, lost, 0.0))
        way = np.sum(np.maximum(np.diff(inner), 0.0))
        return np.exp(-rate * way * whole / max(whole[-1], 1e-12))

    build.plant.gain.append(gain)
    return {"rate": rate}


@njit(cache=True)
def _slid(x, holds):
    """A play of ± `holds` that is dragged along from 0."""
    out, p = np.zeros(x.shape[0]), 0.0
    for k in range(x.shape[0]):
        p = max(min(p, x[k] + holds), x[k] - holds)
        out[k] = p
    return out


@more_shapes("permanent_set", "flows_back", "two_networks")
def permanent_set(build: Build, shape: str, size: float) -> dict[str, float]:
    """It yields, hardens, and flows back in part as it is let go; or bonds form anew in whatever shape the pad has.

    `flows_back`: 2 s (δ − Y) beyond a yield depth Y of 0.3 to 0.42 of the greatest, back to 2 s Y; stated is the middle
    of the two. `two_networks`: with the time integral of the depth; stated is that at the end of the recording.
    """
    rate, holds = min(0.03 * size * spread(build.rng, 0.7, 1.4), 0.3), float(build.rng.uniform(0.3, 0.42))

    def height(t, x):
        inner = np.maximum(x, 0.0)
        if shape == "flows_back":
            return 2 * rate * _slid(inner, holds * build.depth_mm)
        formed = np.cumsum(inner)
        return rate * build.depth_mm * formed / max(formed[-1], 1e-12)

    build.plant.height.append(height)
    return {"set": rate}


def arm_rates(rate: float, barrier: float, cells: int = 10) -> tuple[np.ndarray, np.ndarray]:
    """Shares and rates of arms that draw back by s of their length, 2 (1 − s) ds with τ ∝ e^{b s²}; 1/e at 1/rate."""
    s = (np.arange(cells) + 0.5) / cells
    weights, times = 2 * (1 - s) / cells, np.exp(barrier * s**2)
    unit = brentq(lambda q: float(weights @ np.exp(-q / times)) - np.exp(-1.0), 1e-3, 1e3)
    return weights, rate * unit / times


def disc_rates(rate: float, poisson: float, terms: int = 6) -> tuple[np.ndarray, np.ndarray]:
    """Shares and rates of a wet disc between plates: α² by J_1 = (1 − n)/(1 − 2n) α J_0, 1/((1 − n)² α² − 1 + 2n).

    All add to 1/(2 (1 − n)) by the instant's stress, that of a body without change of volume; the last takes the rest.
    """
    edges = np.concatenate([[1e-3], jn_zeros(0, terms)])
    ratio = (1 - poisson) / (1 - 2 * poisson)
    roots = [brentq(lambda x: j1(x) - ratio * x * j0(x), a, b) for a, b in zip(edges[:-1], edges[1:], strict=True)]
    squares = np.array(roots) ** 2
    weights = 2 * (1 - poisson) / ((1 - poisson) ** 2 * squares - 1 + 2 * poisson)
    weights[-1] += 1 - weights.sum()
    return weights, rate * squares / squares[0]


@more_shapes("missing_relaxation_mode", "arm_retraction", "wet_disc")
def missing_relaxation_mode(build: Build, shape: str, size: float) -> dict[str, float]:
    """Branched chains whose arms draw back against a barrier of 3 to 5; or a wet disc that drains at its rim.

    `arm_retraction`: 1/e of it is left at 1/rate. `wet_disc`: Poisson's ratio 0 to 0.35; stated is the slowest rate.
    """
    rng, (share, rate) = build.rng, drawn_mode(build, size, 0.3, 15.0)
    barrier, poisson = float(rng.uniform(3.0, 5.0)), float(rng.uniform(0.0, 0.35))
    weights, rates = arm_rates(rate, barrier) if shape == "arm_retraction" else disc_rates(rate, poisson)
    add_modes(build, share, weights, rates)
    return {"share": share, "rate": rate}


@njit(cache=True)
def _since_touch(x):
    """Deepest point since the probe came from air."""
    out, m = np.zeros(x.shape[0]), 0.0
    for k in range(x.shape[0]):
        m = max(m, x[k]) if x[k] > 0 else 0.0
        out[k] = m
    return out


@more_shapes("depth_dependent_relaxation", "under_pressure", "stays_drained")
def depth_dependent_relaxation(build: Build, shape: str, size: float) -> dict[str, float]:
    """(1 + F/F_0)^{−c}, slower under pressure, F_0 of 0.05 to 0.3 of the greatest; or ν (1 + s m), m the deepest point.

    `stays_drained`: since the last touch, so that the way back changes nothing until it is let go. Stated is the mean
    slope from the surface to the greatest depth.
    """
    rng, deepest, law, most = build.rng, build.depth_mm, build.plant.pad.law, build.force_N
    slope, part = size * float(rng.uniform(-0.2, -0.1)), spread(rng, 0.05, 0.3)
    if shape == "stays_drained" and rng.random() < 0.6:
        slope = size * float(rng.uniform(0.1, 0.3))
    slope = max(slope, -0.8 / deepest)

    def factor(t, x):
        if shape == "stays_drained":
            rates = 1 + slope * _since_touch(x)
        else:
            rates = (1 + law.force(x) / most / part) ** (np.log1p(slope * deepest) / np.log1p(1 / part))
        # In steps of 0.1 %: each change costs the kernel new exponentials.
        return np.round(np.maximum(rates, 0.1), 3)

    build.plant.rate_factor.append(factor)
    return {"slope": slope}


def fractional_speed(speed: np.ndarray, h: float, alpha: float) -> np.ndarray:
    """The derivative of order α of the way, from its speed: sin πα/π ∫ ν^α w dln ν, w' = v − ν w, three a decade."""
    step = np.log(10.0) / 3
    rates = 10.0 ** (np.arange(-9, 10) / 3)
    out = rates[-1] ** (alpha - 1) * np.exp((alpha - 1) * step / 2) / (1 - alpha) * speed  # what is faster is a dashpot
    for nu in rates:
        kept = np.exp(-nu * h)
        out = out + nu**alpha * step * lfilter([(1 - kept) / nu], [1.0, -kept], speed)
    return np.sin(np.pi * alpha) / np.pi * out


def _damped(build: Build, force: Callable[[float, np.ndarray, np.ndarray], np.ndarray]) -> None:
    """Add `force(h, depth, speed)` in N while the probe is below the surface; near it no more than 3 times u."""

    def gain(t, x):
        pad, h, depth = build.plant.pad, float(t[1] - t[0]), np.maximum(x, 0.0)
        u, inside = pad.law.force(depth), depth > 1e-6
        wanted = force(h, depth, np.diff(depth, prepend=depth[0]) / h)
        added = _unrelaxed(wanted, inside, h, np.array(pad.shares), np.array(pad.rates))
        return 1 + np.clip(added / np.where(inside, u, 1.0), -0.95, 3.0)

    build.plant.gain.append(gain)


@more_shapes("viscous_damping", "thixotropic", "springpot")
def viscous_damping(build: Build, shape: str, size: float) -> dict[str, float]:
    """A filling that gets thinner as it is moved, to 0.3 at most, and sets again; or C d^α δ/dt^α, α of 0.75 to 0.9.

    `thixotropic`: within a way of 0.3 to 1 depths and 1 to 5 s; stated is F/v in the mean over the way in contact.
    `springpot`: stated is F/v after 0.1 s of even speed.
    """
    rng, coefficient = build.rng, size * spread(build.rng, 0.005, 0.02)
    length, sets_s = build.depth_mm * spread(rng, 0.3, 1.0), spread(rng, 1.0, 5.0)
    alpha = float(rng.uniform(0.75, 0.9))

    def force(h, depth, speed):
        if shape == "springpot":
            return coefficient * gamma(2 - alpha) * 0.1 ** (alpha - 1) * fractional_speed(speed, h, alpha)
        thick = 0.3 + 0.7 * _bonds(depth, h, length, sets_s)
        way = np.abs(speed)
        return coefficient * thick / max(np.sum(thick * way), 1e-12) * np.sum(way) * speed

    _damped(build, force)
    return {"coefficient": coefficient}
