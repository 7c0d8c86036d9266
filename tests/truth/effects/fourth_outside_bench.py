"""The fourth shapes: effects of the bench that the catalogue has no name for. A size of 1 is some 1–3 % of the force.

Like `outside_bench`, none of them is what an id of the table means, nor two of them together.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .outside_bench import _AMPLIFIER, _child
from .registry import Build, effect, spread
from .sensor import _disturb
from .third_outside_bench import _fades


@njit(cache=True)
def _zeroed(force, h, band_N, calm_N_s, waits_s, rate_N_s):
    """What is left less a zero, which goes towards it at `rate_N_s` once that was small and calm a while.

    The zero stays within the band.
    """
    out, zero, calm_s = np.zeros(force.shape[0]), 0.0, 0.0
    for k in range(1, force.shape[0]):
        left = force[k] - zero
        calm = abs(left) < band_N and abs(force[k] - force[k - 1]) < calm_N_s * h
        calm_s = calm_s + h if calm else 0.0
        if calm_s > waits_s:
            zero += min(max(left, -rate_N_s * h), rate_N_s * h)
            zero = min(max(zero, -band_N), band_N)
        out[k] = force[k] - zero
    return out


@effect("zero_tracking", "tracks", "tares")
def zero_tracking(build: Build, shape: str, size: float) -> dict[str, float]:
    """An indicator takes a small load that is calm for a drifting zero, and takes it off (OIML R 76, zero tracking).

    After 0.15 to 0.3 s. `tracks`: slowly, the band within 1 to 3 s. `tares`: at once. What it took is missing at all
    greater loads, until it has been calm in air.
    """
    rng = build.rng
    band, waits_s = (
        0.1 * size * build.force_N * spread(rng, 0.8, 1.25),
        spread(rng, 0.15, 0.3),
    )
    rate = band / (spread(rng, 1.0, 3.0) if shape == "tracks" else 0.01)
    calm = 0.5 * build.force_N
    build.sensor(_AMPLIFIER, lambda t, force: _zeroed(force, t[1] - t[0], band, calm, waits_s, rate))
    return {"band": band, "rate": rate}


@effect("machinery", "fan", "pump")
def machinery(build: Build, shape: str, size: float) -> dict[str, float]:
    """A fan nearby that comes and goes, or a pump with its strokes, felt in air too (Norton, Noise and Vibration).

    `fan`: on and off every 3 to 8 s, at random; it runs up and down within 0.4 to 1 s, and shakes as its speed squared.
    `pump`: a half sine for each of 1 to 2.5 strokes a second, each of another length, by a tenth, and another height.
    """
    rng, duration = build.rng, build.plant.duration_s
    amplitude = 0.04 * size * build.force_N * spread(rng, 0.8, 1.25)
    if shape == "pump":
        period, child = 1 / spread(rng, 1.0, 2.5), _child(rng)
        count = int(np.ceil(2 * (duration + 10) / period)) + 10
        lengths = period * np.clip(1 + 0.1 * child.standard_normal(count), 0.6, 1.4)
        begins, heights = np.concatenate([[0.0], np.cumsum(lengths)[:-1]]), child.uniform(0.6, 1.4, count)

        def strokes(t):
            k = np.clip(np.searchsorted(begins, t, side="right") - 1, 0, count - 1)
            return 1.5 * amplitude * heights[k] * np.maximum(np.sin(2 * np.pi * (t - begins[k]) / lengths[k]), 0.0)

        _disturb(build, strokes)
        return {"amplitude": amplitude, "frequency": 1 / period}
    frequency, dwell_s, runs_up_s = spread(rng, 12.0, 35.0), spread(rng, 3.0, 8.0), spread(rng, 0.4, 1.0)
    child, step_s = _child(rng), 1e-3
    count = int(np.ceil(4 * (duration + 10) / dwell_s)) + 20
    switched = np.cumsum(child.exponential(dwell_s, count))
    grid = np.arange(0.0, duration + 1.0, step_s)
    speed = _fades(np.searchsorted(switched, grid) % 2 == 0, step_s, runs_up_s)
    turned = 2 * np.pi * frequency * step_s * np.cumsum(speed)
    _disturb(build, lambda t: amplitude * np.interp(t, grid, speed**2) * np.sin(np.interp(t, grid, turned)))
    return {"amplitude": amplitude, "frequency": frequency}


def _wandering(child: np.random.Generator, duration_s: float, time_s: float, step_s: float = 0.01):
    """An Ornstein–Uhlenbeck process of deviation 1, as a function of time."""
    keeps = np.exp(-step_s / time_s)
    path = child.standard_normal(int(np.ceil((duration_s + 1) / step_s)) + 2)
    path[1:] *= np.sqrt(1 - keeps**2)
    for k in range(1, len(path)):
        path[k] += keeps * path[k - 1]
    return lambda t: np.interp(t, step_s * np.arange(len(path)), path)


@effect("sense_wire", "two_level", "wanders")
def sense_wire(build: Build, shape: str, size: float) -> dict[str, float]:
    """A bad contact in the bridge's supply or sense wires: the gain changes, the zero does not (HBM, Wägezellen).

    `two_level`: it opens and closes at random times, every 1 to 4 s (Rice 1944). `wanders`: an Ornstein–Uhlenbeck
    process of 1.5 to 5 s, as of a corroded pin.
    """
    rng, duration = build.rng, build.plant.duration_s
    drop, dwell_s = 0.1 * size * spread(rng, 0.8, 1.25), spread(rng, 1.0, 4.0)
    time_s, child = spread(rng, 1.5, 5.0), _child(rng)
    if shape == "two_level":
        times = np.cumsum(child.exponential(dwell_s, int(np.ceil(4 * (duration + 10) / dwell_s)) + 20))
        build.sensor(_AMPLIFIER, lambda t, force: force * (1 - drop * (np.searchsorted(times, t) % 2)))
        return {"drop": drop, "dwell": dwell_s}
    along = _wandering(child, duration, time_s)
    build.sensor(_AMPLIFIER, lambda t, force: force * (1 + 0.8 * drop * along(t)))
    return {"drop": drop, "time": time_s}


@effect("loose_screw", "each_move", "hard_moves")
def loose_screw(build: Build, shape: str, size: float) -> dict[str, float]:
    """A cell that is not screwed tight seats itself anew as it is pushed about, and its zero is another one each time.

    `each_move`: evenly spread, a new one in each move, in air too. `hard_moves`: only in moves that are quicker than
    the middle one, or as quick (VDI/VDE 2638 wants cells to be seated under load before use).
    """
    rng, motion = build.rng, build.plant.motion
    step, child = 0.035 * size * build.force_N * spread(rng, 0.8, 1.25), _child(rng)
    middle = (motion.breaks_s[1:] + motion.breaks_s[:-1]) / 2
    speed = np.abs(motion.velocity(middle))
    moves = speed > 1e-6
    begins = np.flatnonzero(moves & ~np.concatenate([[False], moves[:-1]]))
    ends = np.flatnonzero(moves & ~np.concatenate([moves[1:], [False]]))
    top = np.array([speed[i : j + 1].max() for i, j in zip(begins, ends, strict=True)])
    chosen = ends if shape == "each_move" else ends[top >= (1 - 1e-9) * np.median(top)]
    when = motion.breaks_s[chosen + 1]
    zeros = np.concatenate([[0.0], step * child.uniform(-np.sqrt(3.0), np.sqrt(3.0), len(when))])
    _disturb(build, lambda t: zeros[np.searchsorted(when, t)])
    return {"step": step}


@effect("loose_head", "wanders", "jumps")
def loose_head(build: Build, shape: str, size: float) -> dict[str, float]:
    """A read head or scale that is not fixed: the loop follows it, now more and now less.

    `wanders`: an Ornstein–Uhlenbeck process of 1.5 to 5 s, as of glue in a draught. `jumps`: between two places, at
    random times every 1 to 3 s (Rice 1944).
    """
    rng, duration = build.rng, build.plant.duration_s
    off = 0.02 * size * build.depth_mm * spread(rng, 0.8, 1.25)
    time_s, dwell_s, child = spread(rng, 1.5, 5.0), spread(rng, 1.0, 3.0), _child(rng)
    told = {"off": off, "time": time_s} if shape == "wanders" else {"off": off, "dwell": dwell_s}
    along = _wandering(child, duration, time_s)
    times = np.cumsum(child.exponential(dwell_s, int(np.ceil(4 * (duration + 10) / dwell_s)) + 20))

    def moved(t):
        if shape == "wanders":
            return off * along(t)
        return 2 * off * _fades((np.searchsorted(times, t) % 2).astype(float), t[1] - t[0], 0.01)

    # The loop makes the reported position right, and the true one wrong.
    build.plant.motor.append(lambda t, x: x - moved(t))
    build.plant.encoder.append(lambda t, x: x + moved(t))
    return told


@effect("idle_current", "halved", "detents")
def idle_current(build: Build, shape: str, size: float) -> dict[str, float]:
    """A stepper's driver lowers its current a while after each move, and the load pushes the probe back (Acarnley).

    After 0.3 to 1 s, until the next move; nothing reports it. `halved`: in proportion to the load. `detents`: to the
    next place where the rotor holds by itself, which lies otherwise each time, and only under a fifth of the load.
    """
    rng, motion, law, most = build.rng, build.plant.motion, build.plant.pad.law, build.force_N
    gives, waits_s, child = 0.06 * size * build.depth_mm * spread(rng, 0.8, 1.25), spread(rng, 0.3, 1.0), _child(rng)
    places = child.uniform(0.2, 1.0, 4096)

    def back(t, x):
        moves = np.abs(motion.velocity(t)) > 1e-6
        last = np.maximum.accumulate(np.where(moves, np.arange(len(t)), 0))
        idle = (t - t[last] > waits_s) & ~moves
        load = np.clip(law.force(np.maximum(x, 0.0)) / most, 0.0, 1.2)
        rests = np.cumsum(np.diff(idle.astype(int), prepend=0) > 0)
        pushed = load if shape == "halved" else places[rests % len(places)] * (load > 0.2)
        return x - gives * _fades(np.where(idle, pushed, 0.0), t[1] - t[0], 0.01)

    build.plant.play.append(back)
    return {"gives": gives, "waits": waits_s}
