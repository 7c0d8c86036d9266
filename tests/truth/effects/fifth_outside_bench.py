"""The fifth shapes: effects of the bench that the catalogue has no name for. A size of 1 is some 1–3 % of the force.

None of them is what an id of the table means, nor two of them together.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numba import njit

from .fourth_outside_bench import _wandering
from .outside_bench import _AMPLIFIER, _child
from .registry import Build, effect, spread
from .sensor import _disturb
from .third_outside_bench import _fades


@effect("swapped_blocks", "pairs", "reversed")
def swapped_blocks(build: Build, shape: str, size: float) -> dict[str, float]:
    """Blocks of samples arrive in the wrong order now and then, and are filed as they come (RFC 4737, reordering).

    Every 0.8 to 1.3 s, at random. `pairs`: two blocks change places. `reversed`: three come last to first.
    """
    rng = build.rng
    block_s, several = (0.05, 2) if shape == "pairs" else (0.028, 3)
    block_s *= size * spread(rng, 0.8, 1.25)
    every_s, child = spread(rng, 0.8, 1.3), _child(rng)
    count = int(np.ceil(2 * (build.plant.duration_s + 10) / every_s)) + 10
    begins = np.cumsum(every_s * child.uniform(0.6, 1.4, count))

    def read(t, _):
        last = np.searchsorted(begins, t, side="right") - 1
        part = t - np.where(last >= 0, begins[last], 1e9)
        block = np.floor(part / max(block_s, 1e-9))
        return np.where((part >= 0) & (block < several), t + (several - 1 - 2 * block) * block_s, t)

    build.delays.append(read)
    return {"block": block_s}


@njit(cache=True)
def _door(t, force, most):
    """Index of the points that a swinging door keeps: what lies between is within `most` of the line."""
    kept, count, begin = np.zeros(force.shape[0], dtype=np.int64), 1, 0
    upper, lower = np.inf, -np.inf
    for k in range(1, force.shape[0]):
        slope = (force[k] - force[begin]) / (t[k] - t[begin])
        if slope > upper or slope < lower:
            begin = k - 1
            kept[count] = begin
            count += 1
            upper, lower = np.inf, -np.inf
        way = t[k] - t[begin]
        upper = min(upper, (force[k] + most - force[begin]) / way)
        lower = max(lower, (force[k] - most - force[begin]) / way)
    kept[count] = force.shape[0] - 1
    return kept[: count + 1]


@effect("archive", "swinging_door", "sparse")
def archive(build: Build, shape: str, size: float) -> dict[str, float]:
    """The force comes out of an archive that keeps few points, and is straight between them (Bristol 1990).

    `swinging_door`: a point is kept where the line would miss what came in by more than a band. `sparse`: one point in
    each twentieth of a second, at an uneven place.
    """
    rng = build.rng
    band, every_s, child = 0.03 * size * build.force_N * spread(rng, 0.8, 1.25), 0.05 * size, _child(rng)
    every_s *= spread(rng, 0.8, 1.25)

    def stage(t, force):
        if shape == "swinging_door":
            kept = _door(t, force, band)
        else:
            steps = max(every_s / (t[1] - t[0]), 1.0)
            places = (np.arange(int(len(t) / steps)) + child.uniform(0, 1, int(len(t) / steps))) * steps
            kept = np.unique(np.concatenate([[0], places.astype(int), [len(t) - 1]]))
        return np.interp(t, t[kept], force[kept])

    build.sensor(_AMPLIFIER, stage)
    return {"band": band} if shape == "swinging_door" else {"every": every_s}


def _phase(child: np.random.Generator, duration_s: float, frequency: float, spreads: float) -> Callable:
    """Angle of a tone whose frequency wanders by a share of it, within a second or so."""
    wanders, grid = _wandering(child, duration_s, 1.0), np.arange(0.0, duration_s + 1.0, 1e-3)
    turned = 2 * np.pi * frequency * 1e-3 * np.cumsum(1 + spreads * np.clip(wanders(grid), -2.5, 2.5))
    return lambda t: np.interp(t, grid, turned)


@effect("air_hammer", "band", "heavy")
def air_hammer(build: Build, shape: str, size: float) -> dict[str, float]:
    """An air bearing swings by itself under some loads, at 8 to 25 Hz or so (Powell 1970, pneumatic hammer).

    The frequency wanders by a tenth, and it takes 0.1 to 0.4 s to come and to go. `band`: between 0.15 to 0.3 and 0.6
    to 0.8 of the greatest load. `heavy`: above 0.3 to 0.45.
    """
    rng, most = build.rng, build.force_N
    amplitude, frequency = 0.05 * size * most * spread(rng, 0.8, 1.25), spread(rng, 8.0, 25.0)
    takes_s, angle = spread(rng, 0.1, 0.4), _phase(_child(rng), build.plant.duration_s, frequency, 0.1)
    low, high = (float(rng.uniform(*part)) for part in ((0.15, 0.3), (0.6, 0.8)))
    low, high = (low, high) if shape == "band" else (1.5 * low, np.inf)

    def stage(t, force):
        swings = ((force > low * most) & (force < high * most)).astype(float)
        return force + amplitude * _fades(swings, t[1] - t[0], takes_s) * np.sin(angle(t))

    build.sensor(_AMPLIFIER, stage)
    return {"amplitude": amplitude, "frequency": frequency}


@effect("carrier_beat", "one", "two")
def carrier_beat(build: Build, shape: str, size: float) -> dict[str, float]:
    """Carriers of amplifiers side by side beat, where they are not tied to each other (HBM, carrier frequency).

    At 0.6 to 2.5 Hz, and as the oscillators wander so does it, by a third. `two`: with two neighbours.
    """
    rng, duration = build.rng, build.plant.duration_s
    amplitude, frequency = 0.02 * size * build.force_N * spread(rng, 0.8, 1.25), spread(rng, 0.6, 2.5)
    count = 1 if shape == "one" else 2
    ratio, child = float(rng.uniform(1.3, 2.0)), _child(rng)
    angles = [_phase(child, duration, frequency * ratio**k, 0.33) for k in range(count)]
    phases = child.uniform(0, 2 * np.pi, count)

    def beat(t):
        parts = [np.sin(angle(t) + phase) for angle, phase in zip(angles, phases, strict=True)]
        return amplitude / np.sqrt(count) * np.sum(parts, axis=0)

    _disturb(build, beat)
    return {"amplitude": amplitude, "frequency": frequency}


@njit(cache=True)
def _sleeps(force, h, wakes_N, waits_s, takes_s):
    """1 as it wakes, when the force is above a level after it was below for a time; fades while it is awake."""
    out, w, calm_s = np.zeros(force.shape[0]), 1.0, 1e9
    for k in range(force.shape[0]):
        if abs(force[k]) > wakes_N:
            if calm_s > waits_s:
                w = 1.0
            calm_s = 0.0
        else:
            calm_s += h
        w *= np.exp(-h / takes_s)
        out[k] = w
    return out


@effect("sleep", "slow_reference")
def sleep(build: Build, shape: str, size: float) -> dict[str, float]:
    """To save its battery the amplifier sleeps in air, and after it wakes its gain is not yet what it will be.

    It sleeps after 0.1 to 0.3 s below 2 % of the greatest force, and wakes as that is passed (as of wireless bridges
    with a supply that is switched). Its gain is too low, for 0.3 to 1 s.
    """
    rng = build.rng
    off, takes_s = min(0.35 * size * spread(rng, 0.8, 1.25), 0.9), spread(rng, 0.3, 1.0)
    waits_s, wakes = float(rng.uniform(0.1, 0.3)), 0.02 * build.force_N
    build.sensor(_AMPLIFIER, lambda t, force: force * (1 - off * _sleeps(force, t[1] - t[0], wakes, waits_s, takes_s)))
    return {"off": off, "takes": takes_s}


@effect("charging", "steady", "by_motion")
def charging(build: Build, shape: str, size: float) -> dict[str, float]:
    """Charge gathers on a cable and goes off in a spark: the zero climbs, drops, and climbs anew (IEC 61340).

    At random levels. `steady`: it climbs all the time, for 2 to 6 s. `by_motion`: as the cable is rubbed, within 1 to 3
    depths of way.
    """
    rng, motion, duration = build.rng, build.plant.motion, build.plant.duration_s
    most, child = 0.035 * size * build.force_N * spread(rng, 0.8, 1.25), _child(rng)
    lasts_s, length = spread(rng, 2.0, 6.0), build.depth_mm * spread(rng, 1.0, 3.0)
    grid = np.arange(0.0, duration + 1.0, 1e-3)
    way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(motion.position(grid))))])
    gathers = grid / lasts_s if shape == "steady" else way / length
    # Climbs by 1 for each unit, and goes off at each of these.
    goes_off = np.cumsum(child.uniform(0.5, 1.5, 4096))

    def zero(t):
        charge = np.interp(t, grid, gathers)
        k = np.searchsorted(goes_off, charge, side="right")
        return most * (charge - np.where(k > 0, goes_off[k - 1], 0.0))

    _disturb(build, zero)
    return {"level": most}
