"""Effects of the pad that the catalogue has no name for. Each size of 1 is a misfit of some 1–3 % of the largest force.

They go into the elastic force as a factor of time, `gain`, so that contact and relaxation follow by themselves. What
adds to the elastic force u is told as the factor 1 + added/u; near the surface, where u is small, the factor is kept
within 0.2 to 2. Depth is that of the probe as commanded; a frame that gives way is not seen here.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numba import njit

from .registry import Build, effect, spread


def _rate(t: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Speed over the last step, mm/s."""
    return np.diff(x, prepend=x[0]) / (t[1] - t[0])


def _added(build: Build, part: Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]) -> None:
    """Add `part(t, depth, u)` in N to the elastic force u while the probe is below the surface."""
    law = build.plant.pad.law

    def gain(t, x):
        depth = np.maximum(x, 0.0)
        u = law.force(depth)
        inside = u > 1e-9
        share = np.where(inside, part(t, depth, u) / np.where(inside, u, 1.0), 0.0)
        return 1 + np.clip(share, -0.8, 1.0)

    build.plant.gain.append(gain)


@effect("temperature_swing", "stiffness", "shift")
def temperature_swing(build: Build, shape: str, size: float) -> dict[str, float]:
    """The temperature swings with a heater that goes on and off, every 8 to 25 s.

    `stiffness`: the modulus follows. `shift`: all times of relaxation do (time–temperature superposition, Williams,
    Landel and Ferry 1955), by a factor of up to 2 either way, and the modulus by a half of the other shape's.
    """
    rng = build.rng
    period_s, phase = spread(rng, 8.0, 25.0), float(rng.uniform(0, 2 * np.pi))
    swing = 0.05 * size * (1.0 if shape == "stiffness" else 0.5)

    def wave(t):
        return np.sin(2 * np.pi * t / period_s + phase)

    build.plant.gain.append(lambda t, x: 1 + swing * wave(t))
    if shape == "shift":
        shift = np.log(2.0) * min(size, 2.0)
        # In steps of 20 ms: nothing changes faster, and each change costs the kernel new exponentials.
        build.plant.rate_factor.append(lambda t, x: np.exp(shift * wave(np.round(t / 0.02) * 0.02)))
    return {"swing": swing, "period": period_s}


@njit(cache=True)
def _bonds(depth, h, length_mm, recovery_s):
    """Share of bonds that are whole: B' = (1 − B)/τ − B |v|/ℓ below the surface."""
    whole = np.ones(depth.shape[0])
    for k in range(1, depth.shape[0]):
        way = abs(depth[k] - depth[k - 1])
        whole[k] = (whole[k - 1] + h / recovery_s) / (1 + h / recovery_s + way / length_mm)
    return whole


@effect("payne", "kinetic", "many_times")
def payne(build: Build, shape: str, size: float) -> dict[str, float]:
    """The filler's network breaks with any motion, small ones too, and heals at rest (Payne 1962, Kraus 1984).

    Other than in Mullins' effect the deepest point does not matter, and nothing stays. `many_times`: bonds heal over
    two decades of time, as thixotropic gels do (Barnes 1997).
    """
    rng = build.rng
    share, length = 0.2 * size * spread(rng, 0.8, 1.25), 0.4 * spread(rng, 0.7, 1.5)
    middle = spread(rng, 2.0, 6.0)
    times = middle * (np.array([1.0]) if shape == "kinetic" else 10 ** np.array([-1.0, -0.5, 0.0, 0.5, 1.0]))

    def gain(t, x):
        depth = np.maximum(x, 0.0)
        whole = [_bonds(depth, t[1] - t[0], length, recovery) for recovery in times]
        return 1 - min(share, 0.6) * (1 - np.mean(whole, axis=0))

    build.plant.gain.append(gain)
    return {"share": share, "length": length, "recovery": middle}


@njit(cache=True)
def _lagged(values, h, tau):
    out, decay = np.zeros(values.shape[0]), np.exp(-h / tau)
    for k in range(1, values.shape[0]):
        out[k] = values[k] + (out[k - 1] - values[k]) * decay
    return out


@njit(cache=True)
def _jammed(speed, h, critical_mm_s, jams_s, keeps_s, loosens_s):
    """How far jammed, 0 to 1: above the critical speed within `jams_s`; after `keeps_s` below it, it loosens."""
    out, y, slow_s = np.zeros(speed.shape[0]), 0.0, 1e9
    up, down = -np.expm1(-h / jams_s), np.exp(-h / loosens_s)
    for k in range(1, speed.shape[0]):
        if speed[k] > critical_mm_s:
            slow_s = 0.0
            y += (1 - y) * up
        else:
            slow_s += h
            if slow_s > keeps_s:
                y *= down
        out[k] = y
    return out


@effect("rate_stiffening", "jamming", "latched")
def rate_stiffening(build: Build, shape: str, size: float) -> dict[str, float]:
    """A filling of grains in fluid jams above a critical speed, and stays stiffer for a while (Brown and Jaeger 2014).

    In and out alike, and not at all below that speed. `jamming`: it loosens as soon as it is slow. `latched`: some
    seconds later, then at once.
    """
    rng = build.rng
    share, critical = 0.12 * size * spread(rng, 0.8, 1.25), spread(rng, 3.0, 10.0)
    keeps_s, loosens_s = (0.0, spread(rng, 3.0, 10.0)) if shape == "jamming" else (spread(rng, 0.5, 3.0), 0.05)

    def gain(t, x):
        speed = np.abs(_rate(t, np.maximum(x, 0.0)))
        return 1 + share * _jammed(speed, t[1] - t[0], critical, 0.02, keeps_s, loosens_s)

    build.plant.gain.append(gain)
    return {"share": share, "critical_speed": critical}


@njit(cache=True)
def _film(depth, h, gap_mm, squeeze_s, refill_s):
    """A film between two layers: its thickness g, squeezed while δ > g, refilled else."""
    over, g = np.zeros(depth.shape[0]), gap_mm
    for k in range(1, depth.shape[0]):
        if depth[k] > g:
            g = max(g - h * (depth[k] - g) / squeeze_s, 0.0)
        else:
            g += h * (gap_mm - g) / refill_s
        over[k] = max(depth[k] - g, 0.0)
    return over


@effect("second_layer", "film", "slow_return")
def second_layer(build: Build, shape: str, size: float) -> dict[str, float]:
    """A pad of two layers: the second is met at half the depth, and later or earlier as time goes.

    What lies between them is squeezed out (Reynolds 1886) and comes back, each with a time of its own; `slow_return`:
    it comes back within ten seconds or more, so that the next press meets a thinner film.
    """
    rng = build.rng
    gap, stiffness = build.depth_mm * float(rng.uniform(0.4, 0.6)), build.force_N / build.depth_mm
    squeeze, refill = spread(rng, 2.0, 6.0), spread(rng, 1.0, 4.0) if shape == "film" else spread(rng, 8.0, 25.0)
    more = 0.4 * size * stiffness
    _added(build, lambda t, depth, u: more * _film(depth, t[1] - t[0], gap, squeeze, refill))
    return {"gap": gap, "stiffness": more, "squeeze": squeeze, "refill": refill}


@njit(cache=True)
def _age(x, h, length_mm):
    """Time since the last motion: A' = 1 − A |v|/ℓ, s."""
    age = np.zeros(x.shape[0])
    for k in range(1, x.shape[0]):
        age[k] = (age[k - 1] + h) / (1 + abs(x[k] - x[k - 1]) / length_mm)
    return age


@effect("ageing", "stiffens", "slows")
def ageing(build: Build, shape: str, size: float) -> dict[str, float]:
    """A soft glass ages by the logarithm of time (Struik 1978).

    `stiffens`: its modulus grows at rest, and motion makes it young again. `slows`: made young by what went before the
    recording, its times of relaxation grow as its age to a power near one.
    """
    rng = build.rng
    length = build.depth_mm * spread(rng, 0.2, 0.6)
    if shape == "stiffens":
        growth = 0.06 * size * spread(rng, 0.8, 1.25)
        build.plant.gain.append(lambda t, x: 1 + growth * np.log1p(_age(np.maximum(x, 0.0), t[1] - t[0], length) / 0.3))
        return {"growth": growth, "length": length}
    power, young_s = min(0.9 * size, 2.0), spread(rng, 1.0, 4.0)

    def factor(t, x):
        # In steps of 2 %, so that the kernel need not take new exponentials in each step.
        steps = np.round(np.log1p(t / young_s) / 0.02) * 0.02
        return np.exp(power * (np.log1p(15.0 / young_s) - steps))

    build.plant.rate_factor.append(factor)
    return {"power": power, "young": young_s}


@njit(cache=True)
def _activated(target, h, rate, yields_N):
    """z' = ν F_y sinh((target − z)/F_y)."""
    z = np.zeros(target.shape[0])
    for k in range(1, target.shape[0]):
        off = (target[k] - z[k - 1]) / yields_N
        # Exact for a constant target: tanh(y/2) decays by e^{−νh}.
        kept = np.tanh(min(max(off, -30.0), 30.0) / 2) * np.exp(-rate * h)
        z[k] = target[k] - 2 * np.arctanh(kept) * yields_N
    return z


@effect("nonlinear_relaxation", "share_with_force", "activated")
def nonlinear_relaxation(build: Build, shape: str, size: float) -> dict[str, float]:
    """What relaxes is no fixed share of the elastic force, so that time and depth do not separate.

    `share_with_force`: a further mode follows u²/u_max (Schapery 1969). `activated`: its dashpot is Eyring's (1936),
    fast far from equilibrium and slow near it.
    """
    rng = build.rng
    rate, most = spread(rng, 0.3, 2.0), build.force_N
    share = min(0.3 * size * spread(rng, 0.8, 1.25), 0.6)

    def part(t, depth, u):
        h = t[1] - t[0]
        if shape == "share_with_force":
            return -_lagged(share * u * u / most, h, 1 / rate)
        return -_activated(share * u, h, 0.3 * rate, 0.05 * share * most)

    _added(build, part)
    return {"share": share, "rate": rate}


@njit(cache=True)
def _cushion(u, h, share, opens_N, closes_N, leak_per_s, refill_per_s):
    """Air that bears a share: p' = s u', less the leak from one pressure down to another, more what comes back."""
    p, leaks = np.zeros(u.shape[0]), False
    for k in range(1, u.shape[0]):
        p[k] = p[k - 1] + share * (u[k] - u[k - 1])
        leaks = p[k] > closes_N and (leaks or p[k] > opens_N)
        if leaks:
            p[k] *= np.exp(-leak_per_s * h)
        elif p[k] < 0:
            p[k] *= np.exp(-refill_per_s * h)
    return p


@effect("leak", "check_valve")
def leak(build: Build, shape: str, size: float) -> dict[str, float]:
    """A cushion of air bears a share of the load; a lip or a valve opens at a pressure, and shuts at a lower one.

    Shut, nothing flows, whatever the time. What is lost comes back slowly, once the pressure is below the room's.
    """
    rng = build.rng
    share = min(0.25 * size * spread(rng, 0.8, 1.25), 0.7)
    opens = share * build.force_N * float(rng.uniform(0.25, 0.5))
    closes = opens * float(rng.uniform(0.3, 0.6))
    leak_per_s, refill = spread(rng, 0.3, 2.0), spread(rng, 0.1, 0.4)
    _added(build, lambda t, depth, u: _cushion(u, t[1] - t[0], share, opens, closes, leak_per_s, refill) - share * u)
    return {"share": share, "opens": opens, "closes": closes, "leak": leak_per_s}
