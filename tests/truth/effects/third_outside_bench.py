"""More effects of the bench that the catalogue has no name for. A size of 1 is some 1–3 % of the force.

Like `outside_bench`, none of them is what an id of the table means, nor two of them together.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .outside_bench import _AMPLIFIER, _child
from .plant import acceleration
from .registry import Build, effect, spread
from .sensor import _disturb, second_order


@effect("knocks", "table", "thump")
def knocks(build: Build, shape: str, size: float) -> dict[str, float]:
    """Somebody works at the same table: every 2 to 5 s, at random (a Poisson process; Rice 1944), another knock.

    `table`: it rings at 8 to 20 Hz for some tenths of a second. `thump`: a pulse to one side, t/τ e^{1−t/τ}.
    """
    rng = build.rng
    amplitude, every_s = 0.12 * size * build.force_N * spread(rng, 0.8, 1.25), spread(rng, 2.0, 5.0)
    ring_Hz, lasts_s, pulse_s = spread(rng, 8.0, 20.0), spread(rng, 0.15, 0.4), spread(rng, 0.05, 0.15)
    child = _child(rng)
    count = int(np.ceil(3 * (build.plant.duration_s + 10) / every_s)) + 20
    begins, sizes = np.cumsum(child.exponential(every_s, count)), child.uniform(-1, 1, count)

    def added(t):
        out = np.zeros_like(t)
        for begin, weight in zip(begins, sizes, strict=True):
            s = t - begin
            near = (s > 0) & (s < 5.0)
            s = s[near]
            if shape == "table":
                out[near] += weight * np.exp(-s / lasts_s) * np.sin(2 * np.pi * ring_Hz * s)
            else:
                out[near] += weight * s / pulse_s * np.exp(1 - s / pulse_s)
        return amplitude * out

    _disturb(build, added)
    told = {"frequency": ring_Hz, "lasts": lasts_s} if shape == "table" else {"lasts": pulse_s}
    return {"amplitude": amplitude, "every": every_s} | told


@effect("jumping_delay", "two_routes", "lost_frames")
def jumping_delay(build: Build, shape: str, size: float) -> dict[str, float]:
    """How late the force is jumps, every few seconds at random; no delay and no rate of a clock says when.

    `two_routes`: one of two ways through a network. `lost_frames`: samples are counted and some never come, so that
    what is counted runs ahead more and more, until both ends start anew.
    """
    rng = build.rng
    late_s, dwell_s = 0.02 * size * spread(rng, 0.8, 1.25), spread(rng, 2.0, 5.0)
    child = _child(rng)
    count = int(np.ceil(4 * (build.plant.duration_s + 10) / dwell_s)) + 20
    times = np.cumsum(child.exponential(dwell_s, count))
    if shape == "two_routes":
        levels = np.resize([0.0, 1.0], count + 1)
    else:
        levels, level = np.zeros(count + 1), 0.0
        for k in range(1, count + 1):
            level = 0.0 if child.random() < 0.3 else level - child.uniform(0.2, 0.8)
            levels[k] = level
    build.delays.append(lambda t, _: t - late_s * levels[np.minimum(np.searchsorted(times, t), count)])
    return {"late": late_s, "dwell": dwell_s}


@njit(cache=True)
def _fades(values, h, tau):
    out, kept = np.zeros(values.shape[0]), np.exp(-h / tau)
    for k in range(1, values.shape[0]):
        out[k] = values[k] + (out[k - 1] - values[k]) * kept
    return out


@effect("supply_droop", "quick", "slow")
def supply_droop(build: Build, shape: str, size: float) -> dict[str, float]:
    """Bridge and motor share a supply: while the motor moves, either way, the cell's gain drops, and comes back.

    `quick`: within 60 to 200 ms. `slow`: within 2 to 5 s, as a regulator warms. Cells whose supply is not measured
    along read in proportion to it (six wires or four; HBM, Wägezellen).
    """
    rng, motion = build.rng, build.plant.motion
    drop = 0.16 * size * spread(rng, 0.8, 1.25)
    tau = spread(rng, 0.06, 0.2) if shape == "quick" else spread(rng, 2.0, 5.0)

    def stage(t, force):
        drawn = _fades((np.abs(motion.velocity(t)) > 1e-6).astype(float), t[1] - t[0], tau)
        return force * (1 - min(drop, 0.5) * drawn / max(np.max(drawn), 1e-9))

    build.sensor(_AMPLIFIER, stage)
    return {"drop": drop, "time_constant": tau}


@effect("rocking_bench", "one_way", "two_ways")
def rocking_bench(build: Build, shape: str, size: float) -> dict[str, float]:
    """Each move kicks a bench on soft feet, which rocks at 2 to 6 Hz for seconds (Rivin, Passive Vibration Isolation).

    Pad and probe stand on it at different heights and swing against each other. `two_ways`: it pitches and bounces at
    frequencies 1.3 to 1.8 apart, half each. The greatest swing of the run is the amplitude.
    """
    rng, motion = build.rng, build.plant.motion
    frequency, damping, ratio = spread(rng, 2.0, 6.0), spread(rng, 0.01, 0.04), float(rng.uniform(1.3, 1.8))
    amplitude = 0.06 * size * spread(rng, 0.8, 1.25) * build.depth_mm

    def height(t, x):
        kicks = acceleration(motion, t)
        y = second_order(t, kicks, frequency, damping)
        if shape == "two_ways":
            other = second_order(t, kicks, ratio * frequency, damping)
            y = y / np.max(np.abs(y)) + other / np.max(np.abs(other))
        return amplitude * y / np.max(np.abs(y))

    build.plant.height.append(height)
    return {"frequency": frequency, "damping_ratio": damping, "amplitude": amplitude}


@njit(cache=True)
def _steadied(force, h, band, slow_s, quick_s, latches):
    """Follows within `quick_s` outside the band about what is shown, within `slow_s` inside; or jumps, and stays."""
    out, y = np.zeros(force.shape[0]), force[0]
    slow, quick = -np.expm1(-h / slow_s), -np.expm1(-h / quick_s)
    for k in range(force.shape[0]):
        off = force[k] - y
        if latches:
            y = force[k] if abs(off) > band else y
        else:
            y += off * (quick if abs(off) > band else slow)
        out[k] = y
    return out


@effect("steady_display", "adaptive", "latched")
def steady_display(build: Build, shape: str, size: float) -> dict[str, float]:
    """A weighing indicator calms what it shows: within a band it hardly follows, outside at once (OIML R 76).

    `adaptive`: within the band it follows in 1.5 to 4 s. `latched`: it shows the last value until the band is left.
    """
    rng = build.rng
    band = 0.035 * size * build.force_N * spread(rng, 0.8, 1.25)
    slow_s, quick_s = spread(rng, 1.5, 4.0), spread(rng, 0.003, 0.01)
    latches = shape == "latched"
    build.sensor(_AMPLIFIER, lambda t, force: _steadied(force, t[1] - t[0], band, slow_s, quick_s, latches))
    return {"band": band, "slow": slow_s}


@effect("wandering_zero", "reverting", "flicker")
def wandering_zero(build: Build, shape: str, size: float) -> dict[str, float]:
    """The zero wanders and comes back, as in a draught: no line, no steps and no tone.

    `reverting`: an Ornstein–Uhlenbeck process of 1 to 4 s. `flicker`: a power of 1/f, the sum of six from 0.1 to 30 s
    (van der Ziel 1950).
    """
    rng = build.rng
    deviation = 0.025 * size * build.force_N * spread(rng, 0.8, 1.25)
    middle_s = spread(rng, 1.0, 4.0)
    times = np.array([middle_s]) if shape == "reverting" else np.geomspace(0.1, 30.0, 6)
    child, step_s = _child(rng), 0.01
    count = int(np.ceil((build.plant.duration_s + 1) / step_s)) + 2
    keeps = np.exp(-step_s / times)
    pushes = child.standard_normal((count, len(times))) * np.sqrt((1 - keeps**2) / len(times))
    pushes[0] /= np.sqrt(1 - keeps**2)
    states = np.zeros_like(pushes)
    states[0] = pushes[0]
    for k in range(1, count):
        states[k] = keeps * states[k - 1] + pushes[k]
    path = deviation * np.sum(states, axis=1)
    _disturb(build, lambda t: np.interp(t, step_s * np.arange(count), path))
    return {"deviation": deviation}
