"""The seventh effects of the pad that the catalogue has no name for. A size of 1 is some 1–3 % of the force.

None of them is what an id of the table means, nor two of them together. Sources: muscle that strengthens from beat to
beat (Bowditch 1871) or tires (Fitts 1994); fillings of shreds and beans, which lie otherwise in each touch (Cates,
Wittmer, Bouchaud and Claudin 1998); clonus (Lance 1980); fronts that go in by the root of time (Stefan 1891, Crank, The
Mathematics of Diffusion); mattresses whose cells are filled by turns, and cushions that leak and are topped up
(McInnes 2015).
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .fourth_outside_pad import _touches
from .outside_bench import _child
from .registry import Build, effect, spread


@njit(cache=True)
def _roused(depth, h, enough_mm, step, fades_s):
    """Goes towards 1 by the share `step` whenever the probe comes below a depth from air, and fades in between."""
    out, level, ready, kept = np.zeros(depth.shape[0]), 0.0, True, np.exp(-h / fades_s)
    for k in range(depth.shape[0]):
        level *= kept
        if depth[k] <= 0:
            ready = True
        elif ready and depth[k] > enough_mm:
            level, ready = level + step * (1 - level), False
        out[k] = level
    return out


@effect("staircase", "strengthens", "tires")
def staircase(build: Build, shape: str, size: float) -> dict[str, float]:
    """A muscle is another one after each touch, and forgets them: by a share of what is left, however deep they were.

    `strengthens`: 0.3 to 0.5 of it, within 2 to 6 s. `tires`: 0.2 to 0.35, those alone that go beyond half the depth,
    within 6 to 15 s.
    """
    rng, strong = build.rng, shape == "strengthens"
    more, share = 0.25 * size * spread(rng, 0.8, 1.25), (0.3, 0.5) if strong else (0.2, 0.35)
    step = float(rng.uniform(*share))
    fades_s, enough = (spread(rng, 2.0, 6.0), 0.0) if strong else (spread(rng, 6.0, 15.0), 0.5 * build.depth_mm)
    side = 1.0 if strong else -1.0
    build.plant.gain.append(
        lambda t, x: np.maximum(1 + side * more * _roused(x, t[1] - t[0], enough, step, fades_s), 0.3)
    )
    return {"more": more, "step": step, "fades": fades_s}


@effect("loose_fill", "each_touch", "bit_by_bit")
def loose_fill(build: Build, shape: str, size: float) -> dict[str, float]:
    """Shreds or beans lie otherwise in each touch: softer here and stiffer there along the way in, never the same.

    Three sines of the depth, of 0.5 to 1.5 waves, normal. `bit_by_bit`: 0.6 of it is as it was the last time.
    """
    rng, depth = build.rng, build.depth_mm
    deviation, child = 0.06 * size * spread(rng, 0.8, 1.25), _child(rng)
    parts = np.clip(child.standard_normal((512, 3)), -2.5, 2.5)
    if shape == "bit_by_bit":
        for k in range(1, 512):
            parts[k] = 0.6 * parts[k - 1] + 0.8 * parts[k]

    def gain(t, x):
        touch, share = _touches(x) % 512, np.maximum(x, 0.0) / depth
        waves = sum(parts[touch, j] * np.sin((j + 1) * np.pi * share + j) for j in range(3))
        return np.clip(1 + deviation * waves, 0.3, 2.0)

    build.plant.gain.append(gain)
    return {"deviation": deviation}


@effect("clonus", "dies_down", "holds_on")
def clonus(build: Build, shape: str, size: float) -> dict[str, float]:
    """A muscle that is stretched too fast beats, at 5 to 7 Hz, 40 to 80 ms later; slow presses leave it alone.

    From a third of the greatest speed in on, as far as it touches; how much differs from time to time, by two fifths.
    `dies_down`: within 0.3 to 0.8 s. `holds_on`: for 0.4 to 1.5 s, then it stops.
    """
    rng, child = build.rng, _child(build.rng)
    amplitude, frequency, late_s = 0.14 * size * spread(rng, 0.8, 1.25), rng.uniform(5.0, 7.0), rng.uniform(0.04, 0.08)
    calms_s, lengths, much = spread(rng, 0.3, 0.8), child.uniform(0.4, 1.5, 2048), child.uniform(0.6, 1.4, 2048)

    def gain(t, x):
        speed = np.diff(x, prepend=x[0]) / (t[1] - t[0])
        quick = (speed > np.max(speed) / 3) & (x > 0)
        begins = quick & ~np.concatenate([[False], quick[:-1]])
        count = np.cumsum(begins)
        since = t - np.maximum.accumulate(np.where(begins, t, -1e3)) - late_s
        level = np.exp(-since / calms_s) if shape == "dies_down" else 0.6 * (since < lengths[count % 2048])
        beats = (since > 0) * level * much[count % 2048] * np.sin(2 * np.pi * frequency * np.maximum(since, 0.0))
        return np.clip(1 + amplitude * beats, 0.3, 2.0)

    build.plant.gain.append(gain)
    return {"amplitude": amplitude, "frequency": float(frequency), "late": float(late_s)}


@effect("front", "hardens", "thaws")
def front(build: Build, shape: str, size: float) -> dict[str, float]:
    """From the surface down the pad becomes another one, to a depth that goes with the root of time.

    Half to all of the depth at the end. `hardens`: it dries, and that layer is stiffer: 1 + a min(front/δ, 1).
    `thaws`: softer, 1 − a min(front/δ, 1).
    """
    rng, depth, duration = build.rng, build.depth_mm, build.plant.duration_s
    more, whole = 0.4 * size * spread(rng, 0.8, 1.25), depth * float(rng.uniform(0.5, 1.0))
    side = 1.0 if shape == "hardens" else -1.0

    def gain(t, x):
        layer = whole * np.sqrt(t / duration)
        return np.maximum(1 + side * more * np.minimum(layer / np.maximum(x, 1e-6), 1.0), 0.2)

    build.plant.gain.append(gain)
    return {"more": more, "whole": whole}


@effect("air_mattress", "by_turns", "topped_up")
def air_mattress(build: Build, shape: str, size: float) -> dict[str, float]:
    """The pad is full of air, and a pump sees to it; its pressure goes by the pump, and not by what the probe does.

    `by_turns`: cells are filled and emptied by turns, every 4 to 9 s, each change within a tenth to a fifth of that.
    `topped_up`: it leaks for 2 to 6 s at random, and is filled again within 0.3 s.
    """
    rng = build.rng
    swing, child = 0.06 * size * spread(rng, 0.8, 1.25), _child(rng)
    period, within, phase = spread(rng, 4.0, 9.0), float(rng.uniform(0.1, 0.2)), float(rng.uniform(0, 1))
    count = int(np.ceil(build.plant.duration_s + 10))
    lengths = np.ravel(np.column_stack([child.uniform(2.0, 6.0, count), np.full(count, 0.3)]))
    turns = np.concatenate([[-child.uniform(0.0, 2.0)], np.cumsum(lengths)])
    places = np.resize([1.0, -1.0], len(turns)) * 1.4

    def gain(t, x):
        if shape == "topped_up":
            wave = np.interp(t, turns, places)
        else:
            # A triangle, cut off.
            wave = np.clip((1 - 4 * np.abs((t / period + phase) % 1 - 0.5)) / (2 * within), -1.0, 1.0)
        return np.clip(1 + swing * wave, 0.3, 2.0)

    build.plant.gain.append(gain)
    return {"swing": swing}
