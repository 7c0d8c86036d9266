"""The sixth effects of the bench that the catalogue has no name for. A size of 1 is some 1–3 % of the force.

None of them is what an id of the table means, nor two of them together. Sources: force that goes past the cell,
through dirt between its live and its dead end (VDI/VDE 2638; HBM, mounting of load cells); peak detectors (Horowitz
and Hill, The Art of Electronics); cables that flex (IEC 60512-2-5, contact disturbance); hoses that whip (Païdoussis,
Fluid-Structure Interactions); isolators whose valves hunt (Rivin, Passive Vibration Isolation).
"""

from __future__ import annotations

import numpy as np
from numba import njit
from scipy.ndimage import maximum_filter1d
from scipy.signal import lfilter

from .fourth_outside_bench import _wandering
from .outside_bench import _AMPLIFIER, _CELL, _child
from .registry import Build, effect, spread
from .sensor import _disturb
from .third_outside_bench import _fades


@njit(cache=True)
def _relieved(force, share, least):
    """How often the force has fallen to a share of the peak since it did so last; peaks below `least` do not count."""
    out, count, peak = np.zeros(force.shape[0], dtype=np.int64), 0, 0.0
    for k in range(force.shape[0]):
        peak = max(peak, force[k])
        if peak > least and force[k] < share * peak:
            count, peak = count + 1, force[k]
        out[k] = count
    return out


@effect("chip", "moves", "comes_and_goes")
def chip(build: Build, shape: str, size: float) -> dict[str, float]:
    """A chip between the cell's live and dead end bears a part of what is beyond a force, each time beyond another.

    It shifts as it is relieved by a third. `moves`: it bears from 0.1 to 0.7 of the greatest force on.
    `comes_and_goes`: from 0.15 to 0.3 on, one of two times.
    """
    rng, most = build.rng, build.force_N
    bears, begins, child = 0.23 * size * spread(rng, 0.8, 1.25), float(rng.uniform(0.15, 0.3)), _child(rng)
    levels, there = most * child.uniform(0.1, 0.7, 1024), np.ones(1024)
    if shape == "comes_and_goes":
        levels, there = np.full(1024, most * begins), np.ravel(child.permuted(np.tile([0.0, 1.0], (512, 1)), axis=1))
        there[0] = 1.0

    def stage(t, force):
        place = _relieved(force, 2 / 3, 0.03 * most) % 1024
        return force - min(bears, 0.8) * there[place] * np.maximum(force - levels[place], 0.0)

    build.sensor(_CELL, stage)
    return {"bears": bears}


@njit(cache=True)
def _holds_peak(force, h, tau):
    """Follows at once as it rises; as it falls, sinks towards nothing, or what is below it, and no faster."""
    out, y, kept = force.copy(), force[0], np.exp(-h / tau)
    for k in range(1, force.shape[0]):
        end = min(force[k], 0.0)
        y = max(force[k], end + (y - end) * kept)
        out[k] = y
    return out


@effect("peak_detector", "leaks", "window")
def peak_detector(build: Build, shape: str, size: float) -> dict[str, float]:
    """An indicator left in its mode for peaks: it rises at once, and comes down by itself.

    `leaks`: its capacitor within 28 to 44 ms, whatever the force does meanwhile. `window`: the greatest value of the
    last 14 to 23 ms.
    """
    tau = (0.035 if shape == "leaks" else 0.018) * size * spread(build.rng, 0.8, 1.25)

    def stage(t, force):
        h = float(t[1] - t[0])
        if shape == "leaks":
            return _holds_peak(force, h, max(tau, 1e-9))
        steps = int(np.floor(tau / h))
        # Of the last `steps` and the one at hand.
        return maximum_filter1d(force, steps + 1, mode="nearest", origin=steps // 2)

    build.sensor(_AMPLIFIER, stage)
    return {"lasts": tau}


@effect("flexed_cable", "crackles", "drops")
def flexed_cable(build: Build, shape: str, size: float) -> dict[str, float]:
    """A broken strand in a cable that moves along: the gain is unquiet in motion and for 0.2 to 0.5 s after.

    `crackles`: an Ornstein–Uhlenbeck process of 30 to 100 ms. `drops`: it opens and closes, 50 to 200 ms each.
    """
    rng, motion, duration = build.rng, build.plant.motion, build.plant.duration_s
    drop, settles_s, child = 0.15 * size * spread(rng, 0.8, 1.25), spread(rng, 0.2, 0.5), _child(rng)
    time_s, dwell_s = spread(rng, 0.03, 0.1), spread(rng, 0.05, 0.2)
    along = _wandering(child, duration, time_s, 0.005)
    times = np.cumsum(child.exponential(dwell_s, int(np.ceil(2 * (duration + 10) / dwell_s)) + 100))

    def stage(t, force):
        unquiet = _fades((np.abs(motion.velocity(t)) > 1e-6).astype(float), t[1] - t[0], settles_s)
        unquiet = unquiet / max(float(np.max(unquiet)), 1e-9)
        lost = along(t) if shape == "crackles" else 1.5 * (np.searchsorted(times, t) % 2)
        return force * (1 - np.clip(drop * unquiet * lost, -0.8, 0.8))

    build.sensor(_AMPLIFIER, stage)
    return {"drop": drop, "settles": settles_s}


@effect("whipping_hose", "by_speed", "any_move")
def whipping_hose(build: Build, shape: str, size: float) -> dict[str, float]:
    """A hose beside the cell whips as it is dragged, at 4 to 10 Hz, never twice the same way, and calms within 1 s.

    `by_speed`: the faster the more. `any_move`: in any move as much. The greatest swing is the amplitude.
    """
    rng, motion, step_s = build.rng, build.plant.motion, 1e-3
    amplitude, frequency = 0.06 * size * build.force_N * spread(rng, 0.8, 1.25), spread(rng, 4.0, 10.0)
    calms_s, child = spread(rng, 0.3, 1.0), _child(rng)
    grid = np.arange(0.0, build.plant.duration_s + 1.0, step_s)
    speed = np.abs(motion.velocity(grid))
    pushed = speed if shape == "by_speed" else (speed > 1e-6).astype(float)
    turn = np.exp((-1 / calms_s + 2j * np.pi * frequency) * step_s)
    pushes = pushed * (child.standard_normal(len(grid)) + 1j * child.standard_normal(len(grid)))
    swings = np.real(lfilter([1.0], [1.0, -turn], pushes))
    swings = amplitude * swings / max(float(np.max(np.abs(swings))), 1e-9)
    _disturb(build, lambda t: np.interp(t, grid, swings))
    return {"amplitude": amplitude, "frequency": frequency, "calms": calms_s}


@effect("levelling", "hunts", "bleeds")
def levelling(build: Build, shape: str, size: float) -> dict[str, float]:
    """A table on air whose valve has a dead band hunts: pad and probe go apart and together, every few seconds.

    `hunts`: up and down alike, each for 1 to 4 s. `bleeds`: it sinks for 2 to 5 s and is lifted within 0.3 s.
    """
    rng = build.rng
    deviation, child = 0.04 * size * build.depth_mm * spread(rng, 0.8, 1.25), _child(rng)
    count = 2 * int(np.ceil(build.plant.duration_s + 10))
    lengths = child.uniform(1.0, 4.0, count)
    if shape == "bleeds":
        lengths = np.ravel(np.column_stack([child.uniform(2.0, 5.0, count // 2), np.full(count // 2, 0.3)]))
    turns = np.concatenate([[-child.uniform(0.0, 2.0)], np.cumsum(lengths)])
    # Where the valve acts differs from time to time, by a fifth of the band.
    places = np.resize([-1.0, 1.0], len(turns)) * child.uniform(0.8, 1.2, len(turns))
    build.plant.height.append(lambda t, x: deviation * np.interp(t, turns, places))
    return {"deviation": deviation}
