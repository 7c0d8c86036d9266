"""Probe and pad in small time steps: everything in which force and motion act on each other.

One step goes from node to node of an even grid. The elastic force u is linear within it, for which the relaxation
modes z_i' = ν_i (u − z_i) are exact; F = u − Σ c_i z_i. Friction is exact for a constant speed within the step. The
frame is solved implicitly: the probe stands where  x = y − deflection(F(x)),  y being the motor side behind the play.

Sources: friction by Dahl (1968), Stribeck, LuGre (Canudas de Wit et al. 1995), Maxwell slip (Iwan 1966);
stress softening by Ogden and Roxburgh (1999), exponential (Miehe 1995), Zúñiga and Beatty (2002), Dorfmann and Ogden
(2003); damage by Kachanov (1958); adhesion after Derjaguin, Muller, Toporov (1975), Johnson, Kendall, Roberts (1971),
a capillary bridge of constant volume (Maugis 1987), van der Waals forces of a sphere and a plane (Derjaguin 1934,
Hamaker 1937), a bilinear law of traction and separation (Alfano and Crisfield 2001); joints after Hertz (1882); damage
by the load (Miner 1945); flow after Eyring (1936). Those of the later shapes are named where they are registered.
Units: mm, N, s.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit


class Numbers(NamedTuple):
    """What the loop is told; a form of 0 means none."""

    step_s: float
    unilateral: bool = True
    stick_N: float = 0.0  # tension at which an attached surface lets go
    stick_once: bool = False
    stick_keeps: float = 1.0  # share of that tension that is left each time it has let go
    stick_Ns: float = 0.0  # impulse of tension that a film bears
    stick_s: float = 0.0  # contact after which all of the tension is borne, by the root of time; 0 at once
    offset_mm: float = 0.0  # surface below the zero of position
    # 1 linear, 2 stiffening, 3 softer beyond a preload, 4 Hertz, 5 creeps, 6 slips, 7 root, 8 cubic,
    # 9 with the way, 10 bowed rod, 11 wedge
    frame_form: int = 0
    frame_mm_N: float = 0.0
    frame_force_N: float = 1.0
    frame_stiff_share: float = 1.0
    frame_late_share: float = 0.0
    frame_late_s: float = 1.0
    frame_per_mm: float = 0.0
    frame_at_mm: float = 0.0
    friction_form: int = 0  # 1 Coulomb, 2 Stribeck, 3 Dahl, 4 LuGre, 5 Maxwell slip
    coulomb_N: float = 0.0
    presliding_mm: float = 1e-3
    static_share: float = 0.0
    stribeck_mm_s: float = 1.0
    bristle_Ns_mm: float = 0.0
    slide_Ns_mm: float = 0.0
    softening_form: int = (
        0  # 1 exponential, 2 Ogden–Roxburgh, 3 Beatty, 4 Dorfmann–Ogden, 5 ratio, 6 linear, 7 Simo, 8 hyperbolic
    )
    softening_share: float = 0.0
    softening_mm: float = 1.0
    softening_Nmm: float = 1.0
    softening_heals_s: float = 0.0  # within which the deepest point is forgotten; 0 never
    damage_form: int = (
        0  # 1 exponential, 2 Kachanov, 3 saturating, 4 logarithmic, 5 hyperbolic, 6 by load, 7 deep, 8 power, 9 work
    )
    damage_per_mm: float = 0.0
    damage_limit: float = 1.0
    set_form: int = 0  # 1 linear, 2 saturating, 3 beyond a yield depth, 4 progressive
    set_mm_mm: float = 0.0
    set_limit_mm: float = 1.0
    # 1 exponential, 2 snaps off, 3 neck, 4 bridge, 5 van der Waals, 6 bilinear, 7 fibrils, 8 by rate, 9 smooth,
    # 10 tack, 11 by depth, 12 strands, 13 Dugdale, 14 suction
    adhesion_form: int = 0
    pull_off_N: float = 0.0
    adhesion_mm: float = 1.0
    adhesion_s: float = 1.0
    adhesion_depth_mm: float = 1.0
    # 1 linear, 2 with depth, 3 thinning, 4 thickening, 5 Eyring, 6 one-sided, 7 √depth, 8 load, 9 squeeze, 10 flow,
    # 11 stiffness, 12 Carreau, 13 blow-off
    damping_form: int = 0
    damping_Ns_mm: float = 0.0
    damping_ref: float = 1.0
    rate_form: int = 0  # 1 linear, 2 exponential, 3 saturating, 4 free volume, 5 up to a knee, 6 each mode its own
    rate_per_mm: float = 0.0
    rate_knee_mm: float = 1.0
    table_mm: float = 1e-3


# State: deepest raw depth, deepest depth, path of loading, surface and the one before, u, whether in contact (and
# for how many nodes), whether (or how much) attached by adhesion, probe position, how often it has let go, impulse of
# the tension so far.
_RAW, _DEEPEST, _PATH, _S, _S1, _U, _CONTACT, _ATTACHED, _X, _BROKEN, _PULLED = range(11)
_SLIPS = 6


@njit(cache=True)
def _law(table, depth, step):
    """Cubic Hermite in a table of (force, slope, energy); beyond its end a straight line."""
    n = table.shape[0]
    i = int(depth / step)
    if i >= n - 1:
        return table[n - 1, 0] + table[n - 1, 1] * (depth - (n - 1) * step)
    s = depth / step - i
    left, right = table[i], table[i + 1]
    a, b = s * s * (3 - 2 * s), s * (1 - s)
    return left[0] * (1 - a) + right[0] * a + step * b * ((1 - s) * left[1] - s * right[1])


@njit(cache=True)
def _slope(table, depth, step):
    n = table.shape[0]
    i = min(int(depth / step), n - 2)
    s = min(depth / step - i, 1.0)
    return table[i, 1] + s * (table[i + 1, 1] - table[i, 1])


@njit(cache=True)
def _energy(table, depth, step):
    n = table.shape[0]
    i = min(int(depth / step), n - 2)
    s = depth / step - i
    return table[i, 2] + s * (table[i + 1, 2] - table[i, 2])


@njit(cache=True)
def _elastic(p, table, depth, deepest, keep):
    """u at a depth, softened below the deepest point reached and by damage."""
    if depth <= 0:
        return 0.0
    u = keep * _law(table, depth, p.table_mm)
    below = deepest - depth
    if p.softening_form and below > 0:
        if p.softening_form == 1:
            u *= 1 + p.softening_share * math.expm1(-below / p.softening_mm)
        elif p.softening_form == 2:
            most = _energy(table, deepest, p.table_mm)
            scale = p.softening_Nmm + 0.05 * most
            u *= 1 - p.softening_share * math.erf((most - _energy(table, depth, p.table_mm)) / scale)
        elif p.softening_form == 4:
            lost = _energy(table, deepest, p.table_mm) - _energy(table, depth, p.table_mm)
            u *= 1 - p.softening_share * math.tanh(lost / p.softening_Nmm)
        elif p.softening_form == 5:
            u *= (depth / deepest) ** p.softening_share
        elif p.softening_form == 6:
            u *= 1 - p.softening_share * min(0.5 * below / p.softening_mm, 1.0)
        elif p.softening_form == 7:  # D(δ) = D_∞ (1 − e^{−δ/d}); the law is the virgin curve, D in it
            whole = 1 + p.softening_share * math.expm1(-deepest / p.softening_mm)
            u *= whole / (1 + p.softening_share * math.expm1(-depth / p.softening_mm))
        elif p.softening_form == 8:
            u *= 1 - p.softening_share * below / (below + p.softening_mm)
        else:
            u *= math.exp(-p.softening_share * math.sqrt(below / p.softening_mm))
    return u


@njit(cache=True)
def _kept(p, path):
    """Share of the stiffness that is left after a path of loading, mm."""
    if p.damage_form == 0:
        return 1.0
    if p.damage_form in (1, 6, 7, 9):
        return math.exp(-p.damage_per_mm * path)
    if p.damage_form == 2:  # dD/dλ = r / (1 − D)²
        return max(1 - 3 * p.damage_per_mm * path, 0.01) ** (1 / 3)
    if p.damage_form == 4:
        return max(1 - p.damage_per_mm * p.damage_limit * math.log1p(path / p.damage_limit), 0.01)
    if p.damage_form == 5:
        return 1 / (1 + p.damage_per_mm * path)
    if p.damage_form == 8:
        return (1 + path / p.damage_limit) ** (-p.damage_per_mm * p.damage_limit)
    return 1 + p.damage_limit * math.expm1(-p.damage_per_mm * path / p.damage_limit)


@njit(cache=True)
def _sunk(p, deepest):
    """How far the surface has sunk, mm."""
    if p.set_form == 0 or deepest <= 0:
        return 0.0
    if p.set_form == 1:
        return p.set_mm_mm * deepest
    if p.set_form == 2:
        return -p.set_limit_mm * math.expm1(-p.set_mm_mm * deepest / p.set_limit_mm)
    if p.set_form == 4:
        return p.set_mm_mm * deepest**1.5 / math.sqrt(p.set_limit_mm)
    return p.set_mm_mm * max(deepest - p.set_limit_mm, 0.0)


@njit(cache=True)
def _damped(p, table, speed, depth):
    if p.damping_form == 0 or depth <= 0:
        return 0.0
    if p.damping_form == 1:
        return p.damping_Ns_mm * speed
    if p.damping_form == 2:
        return p.damping_Ns_mm * speed * depth / p.damping_ref
    if p.damping_form == 5:
        return p.damping_Ns_mm * p.damping_ref * math.asinh(speed / p.damping_ref)
    if p.damping_form == 6:
        return p.damping_Ns_mm * speed * (1 + math.copysign(p.damping_ref, speed))
    if p.damping_form == 7:
        return p.damping_Ns_mm * speed * math.sqrt(depth / p.damping_ref)
    if p.damping_form == 8:
        return p.damping_Ns_mm * speed * _law(table, depth, p.table_mm) / p.damping_ref
    if p.damping_form == 9:
        return p.damping_Ns_mm * speed / max(1 - depth / p.damping_ref, 0.2) ** 3
    if p.damping_form == 10:
        return p.damping_Ns_mm * speed * (1 + abs(speed) / p.damping_ref)
    if p.damping_form == 11:
        return p.damping_Ns_mm * speed * _slope(table, depth, p.table_mm) / p.damping_ref
    if p.damping_form == 12:  # n = 0.4
        return p.damping_Ns_mm * speed * (1 + (speed / p.damping_ref) ** 2) ** -0.3
    if p.damping_form == 13:
        slow = min(max(speed, -p.damping_ref), p.damping_ref)
        return p.damping_Ns_mm * (slow + 0.25 * (speed - slow))
    exponent = 0.7 if p.damping_form == 3 else 1.3
    return math.copysign(p.damping_Ns_mm * p.damping_ref * (abs(speed) / p.damping_ref) ** exponent, speed)


@njit(cache=True)
def _friction(p, slips, dx, new):
    """Friction at the end of a step of dx; `slips` are the deflections before (mm), `new` those after."""
    if p.friction_form == 0:
        return 0.0
    v = dx / p.step_s
    static = 1 + p.static_share * math.exp(-((v / p.stribeck_mm_s) ** 2))
    if p.friction_form <= 2:
        level = static if p.friction_form == 2 else 1.0
        # The stiffness before slip stays; the deflection at slip follows the level.
        z = min(max(slips[0] + dx, -level * p.presliding_mm), level * p.presliding_mm)
        new[0] = z
        return p.coulomb_N * z / p.presliding_mm
    if p.friction_form <= 4:
        end = p.presliding_mm * (static if p.friction_form == 4 else 1.0)
        steady = math.copysign(end, dx)
        z = steady + (slips[0] - steady) * math.exp(-abs(dx) / end)
        rate = (z - slips[0]) / p.step_s
        new[0] = z
        force = p.coulomb_N * z / p.presliding_mm
        if p.friction_form == 4:
            force += p.bristle_Ns_mm * rate + p.slide_Ns_mm * v
        return force
    total = 0.0
    for i in range(_SLIPS):
        end = p.presliding_mm * 2.0 ** (i - 3)
        new[i] = min(max(slips[i] + dx, -end), end)
        total += new[i] / end
    return p.coulomb_N * total / _SLIPS


@njit(cache=True)
def _deflection(p, force, place, late, new):
    if p.frame_form == 2:
        return math.copysign(p.frame_mm_N * p.frame_force_N * math.log1p(abs(force) / p.frame_force_N), force)
    if p.frame_form == 3 and force <= p.frame_force_N:
        return p.frame_stiff_share * p.frame_mm_N * force
    if p.frame_form == 3:
        return p.frame_mm_N * (force - (1 - p.frame_stiff_share) * p.frame_force_N)
    if p.frame_form == 4:
        pressed = (1 + abs(force) / p.frame_force_N) ** (2 / 3) - 1
        return math.copysign(1.5 * p.frame_mm_N * p.frame_force_N * pressed, force)
    if p.frame_form == 5:
        new[0] = force + (late[0] - force) * math.exp(-p.step_s / p.frame_late_s)
        return p.frame_mm_N * ((1 - p.frame_late_share) * force + p.frame_late_share * new[0])
    if p.frame_form == 6:
        new[0] = min(max(late[0], force - p.frame_force_N), force + p.frame_force_N)
        return p.frame_mm_N * ((1 - p.frame_late_share) * force + p.frame_late_share * new[0])
    if p.frame_form == 7:
        pressed = 2 * p.frame_force_N * (math.sqrt(1 + abs(force) / p.frame_force_N) - 1)
        bent = (1 - p.frame_stiff_share) * abs(force) + p.frame_stiff_share * pressed
        return math.copysign(p.frame_mm_N * bent, force)
    if p.frame_form == 8:  # y + y³ = F/F_0
        y = 2 / math.sqrt(3.0) * math.sinh(math.asinh(1.5 * math.sqrt(3.0) * force / p.frame_force_N) / 3)
        return p.frame_mm_N * p.frame_force_N * y
    if p.frame_form == 9:
        return p.frame_mm_N * (1 + p.frame_per_mm * (place - p.frame_at_mm)) * force
    if p.frame_form == 10:  # up to nine tenths of the load at which it buckles
        left = max(1 - force / p.frame_force_N, 0.1)
        bent = 0.5 * p.frame_force_N * (1 / (left * left) - 1)
        return p.frame_mm_N * ((1 - p.frame_late_share) * force + p.frame_late_share * bent)
    if p.frame_form == 11:
        low, high = force / (1 + p.frame_late_share), force / (1 - p.frame_late_share)
        new[0] = min(max(late[0], min(low, high)), max(low, high))
        return p.frame_mm_N * new[0]
    return p.frame_mm_N * force


@njit(cache=True)
def _surface(p, table, held, remembered, keep, deepest, low, high):
    """Free surface in [low, high], the old one, at which  held · u(s) − remembered + damping = 0."""
    a, b = low, high
    for _ in range(60):
        s = 0.5 * (a + b)
        if b - a < 1e-9:
            break
        left = held * _elastic(p, table, s, deepest, keep) - remembered + _damped(p, table, (s - high) / p.step_s, s)
        if left > 0:
            b = s
        else:
            a = s
    return 0.5 * (a + b)


@njit(cache=True)
def _pad(p, table, x, height, gain, e, k, c, z, state, new_z, new):
    """Force of the pad on the probe at x, and in `new_z` and `new` the state that goes with it."""
    raw = x - p.offset_mm - height
    new[_RAW] = max(state[_RAW], raw)
    depth = raw - _sunk(p, new[_RAW])
    inner = max(depth, 0.0)
    was = state[_CONTACT] > 0
    deepest = state[_DEEPEST]
    if p.softening_heals_s > 0:
        deepest = inner + (deepest - inner) * math.exp(-p.step_s / p.softening_heals_s)
    new[_DEEPEST] = max(deepest, depth)
    way = max(inner - state[_S], 0.0)
    if p.damage_form == 6:
        way *= (inner + state[_S]) / p.damage_limit
    elif p.damage_form == 7:
        way = max(inner - max(state[_S], p.damage_limit), 0.0)
    elif p.damage_form == 9:
        way *= _law(table, 0.5 * (inner + state[_S]), p.table_mm) / p.damage_limit
    new[_PATH] = state[_PATH] + way
    keep = gain * _kept(p, new[_PATH])
    u = _elastic(p, table, inner, new[_DEEPEST], keep)
    # F = held u − remembered, since z(h) = u − (u − u_0) k + (z_0 − u_0) e with k = (1 − e)/(ν h).
    held, remembered = 1.0, 0.0
    for i in range(c.shape[0]):
        held -= c[i] * (1 - k[i])
        remembered += c[i] * (state[_U] * k[i] + (z[i] - state[_U]) * e[i])
    if state[_CONTACT] >= 2:
        speed = (3 * inner - 4 * state[_S] + state[_S1]) / (2 * p.step_s)
    else:
        speed = (inner - state[_S]) / p.step_s
    force = held * u - remembered + _damped(p, table, speed, inner)
    new[_S] = inner
    bears = was and not (p.stick_once and state[_BROKEN] > 0)
    tension = p.stick_N * p.stick_keeps ** state[_BROKEN]
    if p.stick_s > 0:
        tension *= math.sqrt(min(state[_CONTACT] * p.step_s / p.stick_s, 1.0))
    new[_PULLED] = state[_PULLED] + p.step_s * max(-force, 0.0) if bears and force < 0 else 0.0
    touching = (not p.unilateral) or force >= (-tension if bears else -1e-13) or 0 < new[_PULLED] < p.stick_Ns
    new[_BROKEN] = state[_BROKEN] + (1.0 if was and not touching else 0.0)
    if touching:
        new[_CONTACT] = state[_CONTACT] + 1
    else:
        new[_CONTACT] = 0
        new[_PATH] = state[_PATH]
        force = 0.0
        if p.damping_form or p.adhesion_form or p.damage_form:
            new[_S] = _surface(p, table, held, remembered, keep, new[_DEEPEST], 0.0, state[_S])
        u = _elastic(p, table, new[_S], new[_DEEPEST], keep) if p.damping_form else max(remembered / held, 0.0)
    for i in range(c.shape[0]):
        new_z[i] = u - (u - state[_U]) * k[i] + (z[i] - state[_U]) * e[i]
    new[_U] = u
    new[_S1] = state[_S]
    new[_ATTACHED] = state[_ATTACHED]
    if p.adhesion_form:
        gap = 0.0 if touching and depth > 0 else max(new[_S] - depth, 0.0)
        if gap == 0.0 and p.adhesion_form == 10:
            new[_ATTACHED] = 1 - (1 - state[_ATTACHED]) * math.exp(-p.step_s / p.adhesion_s)
        elif gap == 0.0 and p.adhesion_form == 11:
            new[_ATTACHED] = max(state[_ATTACHED], min(depth / p.adhesion_depth_mm, 1.0))
        elif gap == 0.0:
            new[_ATTACHED] = 1.0
        elif gap > p.adhesion_mm:
            new[_ATTACHED] = 0.0
        if p.adhesion_form == 1:
            force -= p.pull_off_N * math.exp(-gap / p.adhesion_mm)
        elif p.adhesion_form == 5:
            force -= p.pull_off_N / (1 + gap / p.adhesion_mm) ** 2
        elif p.adhesion_form == 9:
            force -= p.pull_off_N * 3 * gap / p.adhesion_mm * math.exp(1 - 3 * gap / p.adhesion_mm)
        elif new[_ATTACHED] > 0 and p.adhesion_form == 7:
            share = gap / p.adhesion_mm
            force -= p.pull_off_N * max(min(share / 0.15, 1.0, (1 - share) / 0.3), 0.0)
        elif new[_ATTACHED] > 0 and p.adhesion_form == 8:
            quick = 1 + 10 * max(state[_X] - x, 0.0) / p.step_s  # 1 + v/0.1 mm/s; 101 at 10 mm/s
            force -= p.pull_off_N * math.sin(0.5 * math.pi * gap / p.adhesion_mm) * (quick / 101) ** 0.15
        elif new[_ATTACHED] > 0 and p.adhesion_form == 12:
            share = gap / p.adhesion_mm  # four alike, which break at 0.4, 0.6, 0.8 and 1
            force -= p.pull_off_N * share / 1.8 * min(4.0, math.ceil(5 * (1 - share)))
        elif p.adhesion_form == 13:
            force -= p.pull_off_N if gap < p.adhesion_mm else 0.0
        elif new[_ATTACHED] > 0 and p.adhesion_form == 14:  # Boyle: 1 − V_0/V, V_0 of 0.3 of the range
            force -= p.pull_off_N * 1.3 * gap / (gap + 0.3 * p.adhesion_mm)
        elif new[_ATTACHED] > 0 and p.adhesion_form == 6:
            force -= p.pull_off_N * min(4 * gap, (p.adhesion_mm - gap) * 4 / 3) / p.adhesion_mm
        elif new[_ATTACHED] > 0 and p.adhesion_form == 4:
            force -= p.pull_off_N * (1 - gap / math.sqrt(gap * gap + p.adhesion_mm * p.adhesion_mm))
        elif new[_ATTACHED] > 0 and p.adhesion_form == 2:
            force -= p.pull_off_N * (1 - 0.6 * gap / p.adhesion_mm)
        elif new[_ATTACHED] > 0:
            force -= new[_ATTACHED] * p.pull_off_N * math.sin(0.5 * math.pi * gap / p.adhesion_mm)
    new[_X] = x
    return force


@njit(cache=True)
def _rates(p, nu, factor, depth, e, k):
    if p.rate_form == 1:
        factor *= max(1 + p.rate_per_mm * depth, 0.1)
    elif p.rate_form == 2:
        factor *= math.exp(p.rate_per_mm * depth)
    elif p.rate_form == 3:
        factor *= max(1 + p.rate_per_mm * depth / (1 + depth / 4), 0.1)
    elif p.rate_form == 4:
        factor *= math.exp(p.rate_per_mm * depth / (1 + depth / 4))
    elif p.rate_form == 5:
        factor *= max(1 + p.rate_per_mm * min(depth, p.rate_knee_mm), 0.1)
    plain = factor
    for i in range(nu.shape[0]):
        if p.rate_form == 6:  # from 1.5 times the slope for the first mode to half of it for the last
            weight = 1.5 - i / (nu.shape[0] - 1) if nu.shape[0] > 1 else 1.0
            factor = plain * math.exp(weight * p.rate_per_mm * depth)
        e[i] = math.exp(-nu[i] * factor * p.step_s)
        k[i] = -math.expm1(-nu[i] * factor * p.step_s) / (nu[i] * factor * p.step_s)


@njit(cache=True)
def run(p, table, c, nu, behind_mm, felt_N, height_mm, gain, rate_factor):
    """Arrays (n,) over the nodes: force in the cell, of the pad (N), the probe (mm), whether in contact.

    behind_mm: motor side behind the play; felt_N: forces at the probe that only motion and time decide; height_mm: of
    the surface, into the pad; gain: of the elastic force; rate_factor: of the relaxation. `table` (m, 3) holds force,
    slope and energy of the elastic law every `table_mm`.
    """
    n, r = behind_mm.shape[0], c.shape[0]
    cell, pad, probe, contact = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n, dtype=np.bool_)
    z, new_z, e, k = np.zeros(r), np.zeros(r), np.ones(r), np.ones(r)
    slips, new_slips = np.zeros(_SLIPS), np.zeros(_SLIPS)
    state, new, late, new_late = np.zeros(11), np.zeros(11), np.zeros(1), np.zeros(1)
    state[_X], probe[0], cell[0] = behind_mm[0], behind_mm[0], felt_N[0]
    stiffness = 1.0
    for j in range(1, n):
        if j == 1 or p.rate_form or rate_factor[j] != rate_factor[j - 1]:
            _rates(p, nu, rate_factor[j], state[_S], e, k)
        y = behind_mm[j]
        x = y if p.frame_form == 0 else y - _deflection(p, cell[j - 1], y, late, new_late)
        low, high = -1e9, 1e9
        x_last = r_last = 0.0
        for turn in range(80):
            force = _pad(p, table, x, height_mm[j], gain[j], e, k, c, z, state, new_z, new)
            total = force + felt_N[j] + _friction(p, slips, x - state[_X], new_slips)
            if p.frame_form == 0:
                break
            left = x - y + _deflection(p, total, y, late, new_late)
            if abs(left) < 1e-10 or high - low < 1e-12:
                break
            if left > 0:
                high = x
            else:
                low = x
            slope = 1 + p.frame_mm_N * stiffness
            if turn > 0 and x != x_last and (left - r_last) / (x - x_last) > 0.5:
                slope = (left - r_last) / (x - x_last)
                stiffness = (slope - 1) / p.frame_mm_N
            x_last, r_last = x, left
            x = x - left / slope
            if x <= low or x >= high or turn > 30:
                x = 0.5 * (low + high) if high - low < 1e8 else x
        cell[j], pad[j], probe[j], contact[j] = total, force, x, new[_CONTACT] > 0
        z[:], state[:], slips[:], late[:] = new_z, new, new_slips, new_late
    return cell, pad, probe, contact
