"""The sixth effects of the pad that the catalogue has no name for. A size of 1 is some 1–3 % of the force.

None of them is what an id of the table means, nor two of them together. Sources: skins that dry and break (Routh
2013, drying of thin films); avalanches after a load (Omori 1894, as of foams and crumpled sheets: Durian 1997, Matan,
Williams, Witten and Nagel 2002); loose cushions that walk from under the probe; physiological tremor (Elble and
Koller 1990), also of tired muscles (Gandevia 2001); pores that clog (Dressaire and Sauret 2017); shells with two
states of rest (Brinkmeyer et al. 2012, pseudo-bistable domes).
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .fourth_outside_bench import _wandering
from .fourth_outside_pad import _touches
from .outside_bench import _child
from .outside_pad import _added
from .registry import Build, effect, spread


@njit(cache=True)
def _skin(depth, h, breaks_mm, wears_mm, dries_s):
    """How much skin there is, 1 at first: it breaks beyond a depth, or wears off with the way, and grows in air."""
    out, g, broken = np.ones(depth.shape[0]), 1.0, False
    for k in range(1, depth.shape[0]):
        if depth[k] > 0:
            broken = broken or depth[k] > breaks_mm
            if broken:
                g *= np.exp(-h / 0.005)
            g *= np.exp(-abs(depth[k] - depth[k - 1]) / wears_mm)
        else:
            broken = False
            g += (1 - g) * -np.expm1(-h / dries_s)
        out[k] = g
    return out


@effect("crust", "brittle", "wears")
def crust(build: Build, shape: str, size: float) -> dict[str, float]:
    """In air a crust dries on the pad and bears with it, until it breaks; it takes 0.4 to 1.5 s to come back.

    `brittle`: it breaks at 0.4 to 0.6 of the depth. `wears`: it is rubbed off within 1 to 2 depths of way.
    """
    rng, depth_mm = build.rng, build.depth_mm
    more, dries_s = 0.3 * size * build.force_N / depth_mm * spread(rng, 0.8, 1.25), spread(rng, 0.4, 1.5)
    breaks, wears = depth_mm * float(rng.uniform(0.4, 0.6)), depth_mm * spread(rng, 1.0, 2.0)
    breaks, wears = (breaks, np.inf) if shape == "brittle" else (np.inf, wears)

    def part(t, depth, u):
        return more * depth * _skin(depth, t[1] - t[0], breaks, wears, dries_s)

    _added(build, part)
    return {"more": more, "dries": dries_s}


@effect("avalanches", "omori", "even")
def avalanches(build: Build, shape: str, size: float) -> dict[str, float]:
    """At rest the pad gives way by jumps at random, of many sizes; the next move fills up what is missing.

    `omori`: less and less often, by one over the time since the move. `even`: one in 3 s or so, whenever.
    """
    rng, motion = build.rng, build.plant.motion
    drop, child = 0.06 * size * spread(rng, 0.8, 1.25), _child(rng)
    at = motion.breaks_s
    moves = np.abs(motion.velocity((at[1:] + at[:-1]) / 2)) > 1e-6
    begins = at[:-1][moves & ~np.concatenate([[False], moves[:-1]])]
    ends = at[1:][moves & ~np.concatenate([moves[1:], [False]])]
    rests = list(zip(ends, np.append(begins[1:], build.plant.duration_s + 10), strict=True))
    often, soon_s = 0.25, 0.05
    when, sizes = [], []
    for end, until in rests:
        # As many as fit: by K ln(1 + s/c), or by the time.
        counted = np.cumsum(child.exponential(1.0, 200))
        later = soon_s * np.expm1(np.minimum(counted / often, 40.0)) if shape == "omori" else 3.0 * counted
        later = later[end + later < until]
        when.append(end + later)
        sizes.append(child.exponential(1.0, 200)[: len(later)])

    def gain(t, x):
        out = np.ones_like(t)
        for (_, until), jumps, parts in zip(rests, when, sizes, strict=True):
            first, last = np.searchsorted(t, [jumps[0] if len(jumps) else until, until])
            lost = np.concatenate([[0.0], np.cumsum(parts)])
            out[first:last] = 1 - 0.7 * np.tanh(drop * lost[np.searchsorted(jumps, t[first:last], side="right")] / 0.7)
        return out

    build.plant.gain.append(gain)
    return {"drop": drop}


@effect("squirming", "each_touch", "wanders")
def squirming(build: Build, shape: str, size: float) -> dict[str, float]:
    """A cushion that lies loose walks from under the probe while it is pressed, or comes to lie better under it.

    `each_touch`: this way or that, by another amount each touch, within 0.5 to 2 s of it. `wanders`: to and fro, as an
    Ornstein–Uhlenbeck process of 1.5 to 4 s under load, and stays where it is in air.
    """
    rng = build.rng
    deviation, takes_s, child = 0.09 * size * spread(rng, 0.8, 1.25), spread(rng, 0.5, 2.0), _child(rng)
    ways = child.choice([-1.0, 1.0], 1024) * child.uniform(0.6, 1.4, 1024)
    along = _wandering(child, build.plant.duration_s, 2 * takes_s)

    def gain(t, x):
        pressed = np.cumsum(x > 0) * (t[1] - t[0])
        if shape == "wanders":
            return np.clip(1 + 0.6 * deviation * (along(pressed) - along(0.0)), 0.3, 2.0)
        touch = _touches(x)
        since = pressed - np.maximum.accumulate(np.where(x > 0, 0.0, pressed))
        return np.clip(1 - deviation * ways[touch % 1024] * np.expm1(-since / takes_s), 0.3, 2.0)

    build.plant.gain.append(gain)
    return {"deviation": deviation}


@effect("tremor", "steady", "tires")
def tremor(build: Build, shape: str, size: float) -> dict[str, float]:
    """The pad is held by a hand or a muscle that trembles, at 7 to 12 Hz in bouts of a second or so.

    `steady`: always as much. `tires`: nothing at first, and all of it within 1 to 3 s of load; it rests in air.
    """
    rng, step_s = build.rng, 2e-3
    deviation, frequency = 0.05 * size * spread(rng, 0.8, 1.25), float(rng.uniform(7.0, 12.0))
    lasts_s, takes_s, child = spread(rng, 0.5, 1.5), spread(rng, 1.0, 3.0), _child(rng)
    waves = [_wandering(child, build.plant.duration_s, lasts_s, step_s) for _ in range(2)]
    more = 1.0 if shape == "steady" else 1.5

    def gain(t, x):
        angle = 2 * np.pi * frequency * t
        swing = waves[0](t) * np.sin(angle) + waves[1](t) * np.cos(angle)
        pressed = np.cumsum(x > 0) * (t[1] - t[0])
        since = pressed - np.maximum.accumulate(np.where(x > 0, 0.0, pressed))
        tired = -np.expm1(-since / takes_s) if shape == "tires" else 1.0
        return 1 + np.clip(more * deviation * tired * swing, -0.7, 0.7)

    build.plant.gain.append(gain)
    return {"deviation": deviation, "frequency": frequency}


@effect("clogging", "each_touch", "in_bouts")
def clogging(build: Build, shape: str, size: float) -> dict[str, float]:
    """Pores clog and are flushed: all rates of relaxation are now slower and now quicker, whatever the depth.

    `each_touch`: by a factor of its own for each touch. `in_bouts`: between two, every 1 to 4 s at random.
    """
    rng = build.rng
    spreads, dwell_s, child = np.log(3.0) * size * spread(rng, 0.8, 1.25), spread(rng, 1.0, 4.0), _child(rng)
    factors = np.exp(np.clip(spreads * child.uniform(-1.5, 1.5, 1024), -3.0, 3.0))
    times = np.cumsum(child.exponential(dwell_s, int(np.ceil(4 * (build.plant.duration_s + 10) / dwell_s)) + 20))
    limit = float(np.exp(min(spreads, 3.0)))

    def factor(t, x):
        if shape == "each_touch":
            return factors[_touches(x) % 1024]
        return np.where(np.searchsorted(times, t) % 2, limit, 1 / limit)

    build.plant.rate_factor.append(factor)
    return {"spread": float(spreads)}


@njit(cache=True)
def _presses(x, beyond_mm, back_mm):
    """How often the probe has come beyond a depth, since it was last above another."""
    out, count, ready = np.zeros(x.shape[0], dtype=np.int64), 0, True
    for k in range(x.shape[0]):
        if ready and x[k] > beyond_mm:
            ready, count = False, count + 1
        elif x[k] < back_mm:
            ready = True
        out[k] = count
    return out


@effect("two_states", "push_push", "at_random")
def two_states(build: Build, shape: str, size: float) -> dict[str, float]:
    """A shell inside turns over when it is pressed beyond 0.35 to 0.5 of the depth, and stays so until the next time.

    Stiffer one way than the other. `push_push`: each time. `at_random`: half of the times.
    """
    rng, depth_mm = build.rng, build.depth_mm
    differs, beyond = 0.12 * size * spread(rng, 0.8, 1.25), depth_mm * float(rng.uniform(0.35, 0.5))
    turned = np.arange(4096) % 2 if shape == "push_push" else np.cumsum(_child(rng).random(4096) < 0.5) % 2
    turned[0] = 0

    def gain(t, x):
        return np.clip(1 - differs * turned[_presses(x, beyond, 0.7 * beyond) % 4096], 0.2, 1.0)

    build.plant.gain.append(gain)
    return {"differs": differs, "beyond": beyond}
