"""The sixth shapes: from the cell to the sample.

Sources: joints whose damping is dry (Den Hartog 1931; Bickford, bolted joints) and those that work loose (Junker
1969); filters of finite response, a sinc within a window (Oppenheim and Schafer, Discrete-Time Signal Processing),
and hydraulic cells that fill and drain through a throttle (Doebelin, Measurement Systems); questions that are asked
again when no answer comes (Modbus over serial line) and networks that are now more and now less busy (Paxson 1997);
clocks that lose their reference and run free (ITU-T G.810, holdover) and tuning forks, whose rate is a parabola of
temperature (Vig, Quartz Crystal Resonators and Oscillators); the return of zero of load cells (OIML R 60); amplifiers
whose zero walks (Allan 1966, Horowitz and Hill, The Art of Electronics) and those that correct it by a coarse
thermometer; half-wave rectifiers (IEC 61000-3-2).
"""

from __future__ import annotations

import numpy as np
from numba import njit
from scipy.signal import fftconvolve

from .fourth_outside_bench import _wandering
from .outside_bench import _child
from .registry import Build, more_shapes, spread
from .sensor import _LAG, _RESONANCE, _disturb, first_order
from .third_machine import _fundamental


@njit(cache=True)
def _dry(force, h, omega, damping, holds):
    """y'' = ω(t)² (F − y) − 2 ζ ω y' − ω² `holds` sign y', in quarter steps; it sticks where less pulls at it."""
    out, y, v, small = np.zeros(force.shape[0]), force[0], 0.0, h / 4
    out[0] = y
    for k in range(1, force.shape[0]):
        a = omega[k] * omega[k]
        for part in range(4):
            f = force[k - 1] + (force[k] - force[k - 1]) * (part + 0.5) / 4
            # Midpoint rule without the dry part, which then takes of the speed what it can.
            new = v * (1 - damping * omega[k] * small - a * small * small / 4) + a * small * (f - y)
            new /= 1 + damping * omega[k] * small + a * small * small / 4
            lost = a * holds * small
            new = np.copysign(max(abs(new) - lost, 0.0), new)
            y += small * (v + new) / 2
            v = new
        out[k] = y
    return out


@more_shapes("resonance", "dry_joint", "works_loose")
def resonance(build: Build, shape: str, size: float) -> dict[str, float]:
    """Half of the damping is dry, and ends the swing; or the frequency falls by a sixth to a third along the recording.

    `dry_joint`: stated is the damping of a swing of 2 to 4 % of the greatest force, less where the size is below 1.
    `works_loose`: evenly; stated is the frequency in the middle.
    """
    rng, duration = build.rng, build.plant.duration_s
    frequency = float(np.clip(rng.uniform(40, 80) / np.sqrt(size), 15, 300))
    damping, swing = spread(rng, 0.05, 0.2), float(rng.uniform(0.02, 0.04)) * min(size, 1.0) * build.force_N
    falls, omega = float(rng.uniform(0.16, 0.33)), 2 * np.pi * frequency
    # In a swing of A, F_d sign y' takes as much as 2 ζ ω y' with ζ = 2 F_d/(π A k).
    holds = 0.5 * damping * np.pi * swing / 2

    def stage(t, force):
        if shape == "dry_joint":
            return _dry(force, t[1] - t[0], np.full(len(t), omega), 0.5 * damping, holds)
        return _dry(force, t[1] - t[0], omega * (1 + falls * (0.5 - t / duration)), damping, 0.0)

    build.sensor(_RESONANCE, stage)
    return {"frequency": frequency, "damping_ratio": damping}


@njit(cache=True)
def _throttled(force, h, fills_s, drains_s):
    """First order, with one time as it rises and another as it falls."""
    out, y, up, down = np.zeros(force.shape[0]), force[0], np.exp(-h / fills_s), np.exp(-h / drains_s)
    out[0] = y
    for k in range(1, force.shape[0]):
        f = 0.5 * (force[k] + force[k - 1])
        y = f + (y - f) * (up if f > y else down)
        out[k] = y
    return out


def windowed_sinc(steps: float) -> np.ndarray:
    """Weights of a sinc within a raised cosine, two zeros to either side of the middle, `steps` before and behind."""
    s = np.arange(-int(steps), int(steps) + 1) / max(steps, 1e-9)
    weights = np.sinc(2 * s) * (0.54 + 0.46 * np.cos(np.pi * s))
    return weights / weights.sum()


@more_shapes("sensor_lag", "finite_response", "hydraulic")
def sensor_lag(build: Build, shape: str, size: float) -> dict[str, float]:
    """A sinc within a window, late by half of its length; or a cell of oil that drains more slowly than it fills.

    Stated is the mean delay. `hydraulic`: 0.7 to 0.85 of it as it rises, as much more as it falls.
    """
    tau, sooner = 3e-3 * size * spread(build.rng, 0.7, 1.5), float(build.rng.uniform(0.15, 0.3))

    def stage(t, force):
        h = float(t[1] - t[0])
        if shape == "hydraulic":
            return _throttled(force, h, (1 - sooner) * tau, (1 + sooner) * tau)
        weights = windowed_sinc(tau / h)
        middle = len(weights) // 2
        padded = np.pad(force - force[0], (middle, middle), mode="edge")
        even = fftconvolve(padded, weights, mode="valid") + force[0]
        return np.interp(t - tau, t, even)

    build.sensor(_LAG, stage)
    return {"time_constant": tau}


@more_shapes("force_delay", "asked_again", "congestion")
def force_delay(build: Build, shape: str, size: float) -> dict[str, float]:
    """One answer in eight is lost and asked for anew, and comes twice as late; or a network more busy and less.

    `asked_again`: stated is the mean of all. `congestion`: a spread of a fifth, which wanders within 2 to 6 s.
    """
    rng = build.rng
    delay, time_s, child = 2e-3 * size * spread(rng, 0.6, 1.6), spread(rng, 2.0, 6.0), _child(rng)
    along = _wandering(child, build.plant.duration_s + 10, time_s)

    def late(t, rng):
        if shape == "asked_again":
            return t - delay * np.where(rng.random(len(t)) < 1 / 8, 2.0, 1.0) / (9 / 8)
        return t - delay * (1 + 0.2 * np.clip(along(t), -2.5, 2.5))

    build.delays.append(late)
    return {"delay": delay}


@more_shapes("clock_skew", "holdover", "tuning_fork")
def clock_skew(build: Build, shape: str, size: float) -> dict[str, float]:
    """Right as long as it has its reference, then free; or a parabola, as the room warms, in no column of its own.

    `holdover`: for the first tenth to third of the recording. `tuning_fork`: the rate goes from an eighth to a quarter
    of its mean up to twice of it or more. Stated is the mean over the recording.
    """
    rng, duration = build.rng, build.plant.duration_s
    skew = float(rng.choice([-1.0, 1.0])) * 200e-6 * size * spread(rng, 0.6, 1.6)
    locked, begins = duration * float(rng.uniform(0.1, 0.33)), float(rng.uniform(0.3, 0.6))

    def gained(t):
        if shape == "holdover":
            return skew * duration * np.maximum(t - locked, 0.0) / (duration - locked)
        # ∫ (a + t/D)² dt, which is D ((a + 1)³ − a³)/3 at the end.
        whole = (begins + 1) ** 3 - begins**3
        return skew * duration * ((begins + t / duration) ** 3 - begins**3) / whole

    if shape == "holdover":
        build.own_clock = True
        build.stamps.append(lambda t: t + gained(t))
    else:
        build.delays.append(lambda t, _: t - gained(t))
    return {"skew": 1e6 * skew}


@more_shapes("force_bias", "returns_late")
def force_bias(build: Build, shape: str, size: float) -> dict[str, float]:
    """A part of it goes with the load that there was in the last seconds; stated is the mean over the recording.

    0.9 of it after air, and up to a quarter more after the greatest load, within 3 to 10 s.
    """
    rng, most = build.rng, build.force_N
    bias = float(rng.choice([-1.0, 1.0])) * 0.05 * size * spread(rng, 0.6, 1.6)
    forgets_s, told = spread(rng, 3.0, 10.0), {"bias": bias}

    def stage(t, force):
        zero = bias * (0.9 + 0.25 * np.clip(first_order(t, force, forgets_s) / most, 0.0, 1.2))
        told["bias"] = float(np.mean(zero))
        return force + zero

    build.sensor(_LAG + 20, stage)
    return told


@more_shapes("force_drift", "walks", "coarse_correction")
def force_drift(build: Build, shape: str, size: float) -> dict[str, float]:
    """A straight line and a random walk besides; or one that is corrected in steps, as a thermometer tells of degrees.

    `walks`: by a tenth of the line's end, or so. `coarse_correction`: a line in even steps, every 3 to 8 s.
    """
    rng, duration = build.rng, build.plant.duration_s
    rate = float(rng.choice([-1.0, 1.0])) * 0.002 * size * spread(rng, 0.6, 1.6)
    grid, every, begins = np.linspace(0.0, duration + 1.0, 2000), spread(rng, 3.0, 8.0), float(rng.uniform(0, 1))
    walk = np.concatenate([[0.0], np.cumsum(_child(rng).standard_normal(len(grid) - 1))]) / np.sqrt(len(grid))

    def drift(t):
        if shape == "walks":
            return rate * (t + 0.12 * duration * np.interp(t, grid, walk))
        return rate * every * np.floor(t / every + begins)

    _disturb(build, drift)
    return {"rate": rate}


@more_shapes("mains_hum", "half_wave")
def mains_hum(build: Build, shape: str, size: float) -> dict[str, float]:
    """A rectifier of half waves, fed for 90 to 180 degrees of each; stated is the amplitude of the first harmonic."""
    rng = build.rng
    amplitude = 0.03 * size * spread(rng, 0.6, 1.6)
    frequency = float(rng.choice([50.0, 60.0]) + rng.uniform(-0.05, 0.05))
    phase, level = float(rng.uniform(0, 2 * np.pi)), float(rng.uniform(0.0, np.cos(np.pi / 4)))

    def wave(angle):
        return np.maximum(np.sin(angle) - level, 0.0)

    scale, mean = amplitude / _fundamental(wave), float(np.mean(wave(2 * np.pi * np.arange(4096) / 4096)))
    _disturb(build, lambda t: scale * (wave(2 * np.pi * frequency * t + phase) - mean))
    return {"amplitude": amplitude, "frequency": frequency}
