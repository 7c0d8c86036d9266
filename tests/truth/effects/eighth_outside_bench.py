"""Effects of the bench that the catalogue has no name for. A size of 1 is some 1–3 % of the force.

None of them is what an id of the table means, nor two of them together. Sources: multiplexers that pass on a part of
the channel beside (Kester, Data Conversion Handbook); converters and amplifiers that take turns (Black and Hodges
1980; Yu and Geiger 1994); amplifiers whose output cannot go quicker (Solomon 1974); bits that fail (IEEE 1241);
batteries, which give way under the load of a radio (Linden, Handbook of Batteries); tables on more than three feet
(Slocum, Precision Machine Design; Martin 2007).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from .outside_bench import _AMPLIFIER, _child
from .registry import DISTURBANCE, Build, Samples, effect, spread
from .sensor import _disturb
from .third_outside_bench import _fades


@effect("neighbour", "presses", "steps")
def neighbour(build: Build, shape: str, size: float) -> dict[str, float]:
    """A multiplexer reads a part of the channel beside with ours: a station that presses its own sample, at its times.

    What it reads falls by a third within half a second or so after each change, as its sample relaxes, and never pulls.
    `presses`: up in 0.1 to 0.3 s, 1 to 4 s there, down, and 0.5 to 2 s in air. `steps`: to another load every 1 to 4 s.
    No press or step is like the last.
    """
    rng, child = build.rng, _child(build.rng)
    part, rise_s = 0.04 * size * build.force_N * spread(rng, 0.8, 1.25), spread(rng, 0.1, 0.3)
    relaxes_s, count = spread(rng, 0.3, 0.8), 2 * int(np.ceil(build.plant.duration_s)) + 20
    lasts, levels = rise_s + child.uniform(1.0, 4.0, count), child.uniform(0.2, 1.7, count)
    if shape == "presses":
        lasts[::2], levels[::2] = rise_s + child.uniform(0.5, 2.0, count // 2), 0.0
    begins = np.cumsum(lasts) - lasts - child.uniform(0.0, 3.0)
    grid = np.arange(-4.0, build.plant.duration_s + 1.0, 1e-3)
    times = np.ravel(np.column_stack([begins, begins + rise_s]))
    load = np.interp(grid, times, np.concatenate([[0.0], np.repeat(levels, 2)[:-1]]))
    reads = np.maximum(load - _fades(load, 1e-3, relaxes_s) / 3, 0.0)
    _disturb(build, lambda t: part * np.interp(t, grid, reads))
    return {"part": part}


@effect("interleaving", "each_sample", "ping_pong")
def interleaving(build: Build, shape: str, size: float) -> dict[str, float]:
    """Converters that take turns have not quite the same gain; all have the same zero.

    `each_sample`: two to four, sample by sample. `ping_pong`: two amplifiers, one at work while the other finds its
    zero, for 60 to 250 ms each.
    """
    rng, child = build.rng, _child(build.rng)
    differs, half_s = 0.03 * size * spread(rng, 0.8, 1.25), spread(rng, 0.06, 0.25)
    phase, turns = float(rng.uniform(0, 2)), int(rng.integers(2, 5))
    gains = child.standard_normal(turns)
    gains = (gains - gains.mean()) / np.std(gains)

    def stage(samples: Samples, _: np.random.Generator) -> None:
        if shape == "each_sample":
            which = gains[np.arange(len(samples.time_s)) % turns]
        else:
            which = np.where(np.floor(samples.time_s / half_s + phase) % 2 == 0, 1.0, -1.0)
        samples.force_N = samples.force_N + differs * which * samples.clean_N
        samples.clean_N = samples.clean_N * (1 + differs * which)

    build.samples.append((DISTURBANCE, stage))
    return {"differs": differs}


@njit(cache=True)
def _slews(force, h, up_N_s, down_N_s, tau):
    """y' = S tanh((F − y)/(S τ)), S that of the direction: in each step sinh((F − y)/(S τ)) falls by e^{−h/τ}."""
    out, y = np.zeros(force.shape[0]), force[0]
    for k in range(force.shape[0]):
        scale = tau * (up_N_s if force[k] > y else down_N_s)
        q = abs(force[k] - y) / scale
        left = q - h / tau if q - h / tau > 30 else math.asinh(math.sinh(min(q, 60.0)) * math.exp(-h / tau))
        y = force[k] - math.copysign(scale * left, force[k] - y)
        out[k] = y
    return out


@effect("slew_limit", "both_ways", "slow_back")
def slew_limit(build: Build, shape: str, size: float) -> dict[str, float]:
    """An amplifier whose output can go only so quickly: quick presses come late and too low, slow ones as they are.

    From nothing to the greatest force in 50 to 80 ms; where it has less to catch up than 1 % of that it is quick.
    `slow_back`: up half as long, and back half as long again.
    """
    full_s, most = 0.063 * size * spread(build.rng, 0.8, 1.25), build.force_N
    up_s, down_s = (full_s, full_s) if shape == "both_ways" else (0.5 * full_s, 1.5 * full_s)

    def stage(t, force):
        if full_s == 0:
            return force
        return _slews(force, t[1] - t[0], most / up_s, most / down_s, 0.01 * full_s)

    build.sensor(_AMPLIFIER, stage)
    return {"full": full_s}


@effect("stuck_bit", "always", "at_times")
def stuck_bit(build: Build, shape: str, size: float) -> dict[str, float]:
    """A bit of the converter is never set: its weight is missing from each other span of the force, as wide as it is.

    The first begins at 0.3 to 0.7 of the weight, as zero is not at the edge of a code. `always`; `at_times`: now for
    some seconds and now not, each 1 to 4 s in the mean.
    """
    rng, child = build.rng, _child(build.rng)
    weight, begins = 0.05 * size * build.force_N * spread(rng, 0.8, 1.25), float(rng.uniform(0.3, 0.7))
    dwell_s = spread(rng, 1.0, 4.0)
    times = np.cumsum(child.exponential(dwell_s, int(np.ceil(4 * (build.plant.duration_s + 10) / dwell_s)) + 20))

    def stage(t, force):
        if weight == 0:
            return force
        lost = np.floor(force / weight + 1 - begins) % 2
        return force - weight * lost * (1 if shape == "always" else 1 - np.searchsorted(times, t) % 2)

    build.sensor(_AMPLIFIER, stage)
    return {"weight": weight, "begins": begins * weight}


@effect("battery", "telegrams", "on_air")
def battery(build: Build, shape: str, size: float) -> dict[str, float]:
    """A cell with a radio: as it sends, its battery gives way and the reference with it, and the force reads too high.

    The more the longer it sends, within 0.1 to 0.3 s, and so it recovers. `telegrams`: for 0.2 to 0.5 s, every 1 to
    2.5 s. `on_air`: as long, but after pauses of 0.3 to 3 s, when the band is free.
    """
    rng, child = build.rng, _child(build.rng)
    more, takes_s = 0.08 * size * spread(rng, 0.8, 1.25), spread(rng, 0.1, 0.3)
    every_s, sends_s = spread(rng, 1.0, 2.5), float(rng.uniform(0.2, 0.5))
    count = int(np.ceil((build.plant.duration_s + 10) / 0.5)) + 10
    pauses = np.full(count, every_s - sends_s) if shape == "telegrams" else child.uniform(0.3, 3.0, count)
    changes = np.cumsum(np.column_stack([pauses, np.full(count, sends_s)])) - pauses[0] * float(rng.uniform(0.0, 1.0))

    def stage(t, force):
        sends = (np.searchsorted(changes, t, side="right") % 2).astype(float)
        return force * (1 + more * _fades(sends, t[1] - t[0], takes_s))

    build.sensor(_AMPLIFIER, stage)
    return {"more": more, "takes": takes_s, "sends": sends_s}


@njit(cache=True)
def _tips(load, levels, back):
    """Which tilt the table is in, 0 for none: the k-th from where the load passes the k-th level until `back` of it."""
    out, count, tipped = np.zeros(load.shape[0], dtype=np.int64), 0, False
    for k in range(load.shape[0]):
        level = levels[count % levels.shape[0]]
        if tipped and load[k] < back * level:
            count, tipped = count + 1, False
        elif not tipped and load[k] > level:
            tipped = True
        out[k] = count + 1 if tipped else 0
    return out


@effect("short_leg", "tips", "shuffles")
def short_leg(build: Build, shape: str, size: float) -> dict[str, float]:
    """A table with a short leg tips under the load, so that the pad goes away by a step, and back as it is relieved.

    Within 20 to 60 ms; back at 0.3 to 0.6 of the load at which it tipped. `tips`: at 0.25 to 0.45 of the greatest load,
    by as much each time. `shuffles`: at 0.15 to 0.6 of it, each time at another and by another step, 0.4 to 1.6 of it.
    """
    rng, law, most, child = build.rng, build.plant.pad.law, build.force_N, _child(build.rng)
    step, takes_s = 0.03 * size * build.depth_mm * spread(rng, 0.8, 1.25), spread(rng, 0.02, 0.06) / 3
    level, back = float(rng.uniform(0.25, 0.45)), float(rng.uniform(0.3, 0.6))
    levels, steps = np.full(1024, level), np.ones(1024)
    if shape == "shuffles":
        levels, steps = child.uniform(0.15, 0.6, 1024), child.uniform(0.4, 1.6, 1024)
    steps = np.concatenate([[0.0], steps])

    def height(t, x):
        which = _tips(law.force(np.maximum(x, 0.0)) / most, levels, back)
        return step * _fades(steps[np.minimum(which, 1024)], t[1] - t[0], takes_s)

    build.plant.height.append(height)
    return {"step": step, "back": back}
