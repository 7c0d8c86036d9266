"""More effects of the pad that the catalogue has no name for. A size of 1 is some 1–3 % of the force.

Like `outside_pad`, none of them is what an id of the table means, nor two of them together.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .outside_bench import _child
from .outside_pad import _added
from .registry import Build, effect, spread


@njit(cache=True)
def _flips(depth, h, goes_mm, returns_mm, takes_s):
    """0 to 1: to 1 below `goes_mm`, back to 0 only above `returns_mm`; each within `takes_s`."""
    out, on, y, part = np.zeros(depth.shape[0]), 0.0, 0.0, -np.expm1(-h / takes_s)
    for k in range(depth.shape[0]):
        if depth[k] > goes_mm:
            on = 1.0
        elif depth[k] < returns_mm:
            on = 0.0
        y += (on - y) * part
        out[k] = y
    return out


@effect("snap_through", "dome", "cells")
def snap_through(build: Build, shape: str, size: float) -> dict[str, float]:
    """A dome buckles at one depth and springs back at a lesser one, at any speed (von Kármán and Tsien 1939).

    Between the two the force depends on where it came from; no point deeper need be reached, and nothing stays.
    `cells`: five of them, one below the other, as in foams and lattices.
    """
    rng, depth_mm = build.rng, build.depth_mm
    count, typical = (1, 0.1) if shape == "dome" else (5, 0.15)
    drop, takes_s = typical * size * build.force_N * spread(rng, 0.8, 1.25), spread(rng, 0.005, 0.02)
    goes = depth_mm * (rng.uniform(0.6, 0.75, 1) if count == 1 else np.linspace(0.45, 0.85, count))
    returns = goes - depth_mm * rng.uniform(0.25, 0.35, count)

    def part(t, depth, u):
        flips = [_flips(depth, t[1] - t[0], a, b, takes_s) for a, b in zip(goes, returns, strict=True)]
        return -drop * np.mean(flips, axis=0)

    _added(build, part)
    return {"drop": drop, "goes": float(goes[0]), "returns": float(returns[0])}


@effect("curing", "sets", "gels")
def curing(build: Build, shape: str, size: float) -> dict[str, float]:
    """The pad is not done: it stiffens for good as time goes, pressed or not (Kamal and Sourour 1973).

    `sets`: by 1 − e^{−t/τ} from the start. `gels`: about some time in the middle, an S, and what relaxes slows by half.
    """
    rng, duration = build.rng, build.plant.duration_s
    growth = (0.4 if shape == "sets" else 0.25) * size * spread(rng, 0.8, 1.25)
    tau, gels_s = duration * float(rng.uniform(0.3, 0.6)), duration * float(rng.uniform(0.35, 0.6))
    width = 0.06 * duration

    def done(t):
        return -np.expm1(-t / tau) if shape == "sets" else 1 / (1 + np.exp((gels_s - t) / width))

    build.plant.gain.append(lambda t, x: 1 + growth * done(t))
    if shape == "gels":
        # In steps of 2 %: each change costs the kernel new exponentials.
        build.plant.rate_factor.append(lambda t, x: 2.0 ** -(np.round(done(t) / 0.02) * 0.02))
    return {"growth": growth}


@njit(cache=True)
def _outward(x, way_mm):
    """1 after `way_mm` or more on the way out, 0 after as much on the way in; at first 0."""
    out, turn, y = np.zeros(x.shape[0]), x[0], 0.0
    for k in range(x.shape[0]):
        if y == 0.0:
            turn = max(turn, x[k])
            if x[k] < turn - way_mm:
                y, turn = 1.0, x[k]
        else:
            turn = min(turn, x[k])
            if x[k] > turn + way_mm:
                y, turn = 0.0, x[k]
        out[k] = y
    return out


@effect("one_way_relaxation", "slow_recovery", "quick_recovery")
def one_way_relaxation(build: Build, shape: str, size: float) -> dict[str, float]:
    """After a move out the pad recovers at other rates than it relaxes at after a move in (Reese and Govindjee 1998).

    At the same depth, so that it is no matter of depth: slower by a factor of 4, or quicker by as much.
    """
    rng = build.rng
    factor = (1 + 3 * size * spread(rng, 0.8, 1.25)) ** (-1.0 if shape == "slow_recovery" else 1.0)
    way = 0.01 * build.depth_mm
    build.plant.rate_factor.append(lambda t, x: factor ** _outward(x, way))
    return {"factor": factor}


@effect("pulse", "heart", "breath")
def pulse(build: Build, shape: str, size: float) -> dict[str, float]:
    """A living pad moves by itself: 0.9 to 1.6 beats a second, never quite even, or a breath every 3 to 6 s.

    `heart`: a steep rise and a slow fall, as in the arteries; beats differ by 6 %. `breath`: nearly a sine, whose
    depth differs from one to the next by a fifth and its length by a tenth.
    """
    rng = build.rng
    heart = shape == "heart"
    period = 1 / float(rng.uniform(0.9, 1.6)) if heart else float(rng.uniform(3.0, 6.0))
    amplitude = (0.06 if heart else 0.04) * size * build.depth_mm * spread(rng, 0.8, 1.25)
    child = _child(rng)
    count = int(np.ceil(2 * (build.plant.duration_s + 10) / period)) + 10
    lengths = period * np.clip(1 + (0.06 if heart else 0.1) * child.standard_normal(count), 0.6, 1.4)
    begins = np.concatenate([[-period], np.cumsum(lengths) - period])
    depths = 1 + (0.0 if heart else 0.2) * child.uniform(-1, 1, count)

    def height(t, x):
        k = np.clip(np.searchsorted(begins, t, side="right") - 1, 0, count - 1)
        phase = (t - begins[k]) / lengths[k]
        # Both begin and end at 0; the pulse has its top, near 1, at a tenth of the beat.
        wave = 10 * phase * np.exp(1 - 10 * phase) * (1 - phase) / 0.9 if heart else (1 - np.cos(2 * np.pi * phase)) / 2
        return -amplitude * depths[k] * wave

    build.plant.height.append(height)
    return {"amplitude": amplitude, "period": period}


@effect("collapse", "bubble", "refills")
def collapse(build: Build, shape: str, size: float) -> dict[str, float]:
    """A bubble under the skin gives way once, at some moment under load and no deeper than before; the surface drops.

    The moment is anywhere in the second and third quarter of the time spent below half the depth. `refills`: air
    comes back within 5 to 15 s.
    """
    rng = build.rng
    sinks, share, takes_s = 0.06 * size * build.depth_mm * spread(rng, 0.8, 1.25), float(rng.uniform(0.25, 0.75)), 0.02
    refills_s = spread(rng, 5.0, 15.0)

    def height(t, x):
        loaded = np.cumsum(x > build.depth_mm / 2)
        if not loaded[-1]:
            return np.zeros_like(t)
        since = np.maximum(t - t[np.searchsorted(loaded, share * loaded[-1])], 0.0)
        gone = -np.expm1(-since / takes_s)
        return sinks * gone * (np.exp(-since / refills_s) if shape == "refills" else 1.0)

    build.plant.height.append(height)
    return {"sinks": sinks}
