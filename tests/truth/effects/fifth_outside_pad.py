"""The fifth shapes: effects of the pad that the catalogue has no name for. A size of 1 is some 1–3 % of the force.

None of them is what an id of the table means, nor two of them together.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .fifth_pad import _pressed
from .fourth_outside_pad import _follows, _touches
from .outside_bench import _child
from .outside_pad import _added
from .registry import Build, effect, spread


@effect("compaction", "logarithmic", "shaken_loose")
def compaction(build: Build, shape: str, size: float) -> dict[str, float]:
    """A pad of grains or fibres packs as it is pressed, and is stiffer from then on (Knight et al. 1995).

    By the logarithm of the way of loading. `shaken_loose`: every 6 to 15 s, at random, it falls apart again.
    """
    rng, duration = build.rng, build.plant.duration_s
    growth, length = 0.2 * size * spread(rng, 0.8, 1.25), build.depth_mm * spread(rng, 0.3, 1.0)
    every_s, child = spread(rng, 6.0, 15.0), _child(rng)
    when = np.cumsum(child.exponential(every_s, int(np.ceil(4 * (duration + 10) / every_s)) + 20))

    def gain(t, x):
        way = _pressed(x)
        if shape == "shaken_loose":
            last = np.searchsorted(when, t)
            way = way - np.interp(np.where(last > 0, when[last - 1], 0.0), t, way)
        return 1 + growth * np.log1p(way / length)

    build.plant.gain.append(gain)
    return {"growth": growth, "length": length}


@effect("crystallisation", "at_once_gone", "lingers")
def crystallisation(build: Build, shape: str, size: float) -> dict[str, float]:
    """Deep down, rubber crystallises as time goes, and is stiffer the longer it is held; it melts as it is let go.

    Below half the depth, within 0.7 to 2.5 s (Flory 1947, Treloar). `at_once_gone`: melted within 50 ms. `lingers`:
    within 3 to 8 s.
    """
    rng, depth_mm = build.rng, build.depth_mm
    growth, takes_s = 0.6 * size * spread(rng, 0.8, 1.25), spread(rng, 0.7, 2.5)
    melts_s, least = spread(rng, 3.0, 8.0) if shape == "lingers" else 0.05, float(rng.uniform(0.4, 0.55))

    def gain(t, x):
        wanted = np.clip((x / depth_mm - least) / (1 - least), 0.0, 1.2)
        return 1 + growth * _follows(wanted, t[1] - t[0], takes_s, melts_s)

    build.plant.gain.append(gain)
    return {"growth": growth, "takes": takes_s}


@effect("bubbles", "one", "several")
def bubbles(build: Build, shape: str, size: float) -> dict[str, float]:
    """Gas gathers under the skin and lifts the surface, until it escapes at once (Scriven 1959, growth as √t).

    Every 2 to 8 s, at random, pressed or not. `several`: three, each with its own times, a third of the height each.
    """
    rng, duration = build.rng, build.plant.duration_s
    rise, every_s = 0.09 * size * build.depth_mm * spread(rng, 0.8, 1.25), spread(rng, 2.0, 8.0)
    count, child = 1 if shape == "one" else 3, _child(rng)
    many = int(np.ceil(4 * (duration + 10) / every_s)) + 20
    escapes = [np.cumsum(every_s * child.uniform(0.4, 1.6, many)) for _ in range(count)]

    def height(t, x):
        lifted = np.zeros_like(t)
        for when in escapes:
            k = np.searchsorted(when, t, side="right")
            lifted += np.sqrt((t - np.where(k > 0, when[k - 1], 0.0)) / every_s)
        return -rise * lifted / np.sqrt(count)

    build.plant.height.append(height)
    return {"rise": rise, "every": every_s}


@effect("creases", "now_and_then", "one_of_three")
def creases(build: Build, shape: str, size: float) -> dict[str, float]:
    """The skin folds beneath the probe in some of the touches, and bears more from some depth on (Gent and Cho 1999).

    `now_and_then`: in half of them, and each fold begins elsewhere, at 0.2 to 0.6 of the depth. `one_of_three`: one of
    three folds, or none, which begin at places of their own and differ by what they bear.
    """
    rng, depth_mm = build.rng, build.depth_mm
    more, child = 0.35 * size * build.force_N / depth_mm * spread(rng, 0.8, 1.25), _child(rng)
    begins, bears = child.uniform(0.2, 0.6, 1024), (child.random(1024) < 0.5).astype(float)
    if shape == "one_of_three":
        which = child.integers(0, 4, 1024)
        begins, bears = np.append(child.uniform(0.2, 0.6, 3), 1.0)[which], np.array([0.5, 1.0, 1.5, 0.0])[which]

    def part(t, depth, u):
        touch = _touches(depth)
        return more * bears[touch] * np.maximum(depth - begins[touch] * depth_mm, 0.0)

    _added(build, part)
    return {"more": more}


@njit(cache=True)
def _withdrawn(load, h, hurts, late_s, draws_s, calm_s):
    """To 1 within `draws_s`, once the load has been above a level for `late_s`; back within `calm_s` when it is low."""
    out, since, w = np.zeros(load.shape[0]), 0.0, 0.0
    for k in range(1, load.shape[0]):
        since = since + h if load[k] > hurts else 0.0
        if since > late_s:
            w += (1 - w) * -np.expm1(-h / draws_s)
        elif load[k] < 0.3 * hurts:
            w *= np.exp(-h / calm_s)
        out[k] = w
    return out


@effect("withdrawal", "reflex", "learns")
def withdrawal(build: Build, shape: str, size: float) -> dict[str, float]:
    """A living pad draws back where it is pressed too hard, 0.1 to 0.25 s late (Sherrington 1910).

    From 0.2 to 0.35 of the greatest force on, within 50 to 150 ms; it comes back in 1 to 3 s once it is let go.
    `learns`: less from time to time, by a fifth (Thompson and Spencer 1966, habituation).
    """
    rng, law, most = build.rng, build.plant.pad.law, build.force_N
    back, hurts = 0.09 * size * build.depth_mm * spread(rng, 0.8, 1.25), float(rng.uniform(0.2, 0.35)) * most
    late_s, draws_s, calm_s = float(rng.uniform(0.1, 0.25)), spread(rng, 0.05, 0.15), spread(rng, 1.0, 3.0)

    def height(t, x):
        load = law.force(np.maximum(x, 0.0))
        drawn = _withdrawn(load, t[1] - t[0], hurts, late_s, draws_s, calm_s)
        if shape == "learns":
            above = load > hurts
            drawn = drawn * 1.3 * 0.8 ** np.maximum(np.cumsum(np.diff(above.astype(int), prepend=0) > 0) - 1, 0)
        return back * drawn

    build.plant.height.append(height)
    return {"back": back}
