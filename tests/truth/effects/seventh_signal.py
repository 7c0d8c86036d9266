"""The seventh shapes: from the cell to the sample.

Sources: lines whose far end throws waves back (Wylie and Streeter, Fluid Transients) and damping by a fractional
derivative (Bagley and Torvik 1983, Oustaloup 1991); filters after Cauer (1958) and amplifiers that are no faster than
their slew rate (Solomon 1974); two tasks that each read by a cycle of their own (Tindell and Clark 1994) and links that
save power while nothing goes on (IEEE 802.11; Mogul and Ramakrishnan 1997); oscillators pulled by another one (Adler
1946) and counters of a processor that changes its speed (Intel, Software Developer's Manual); carriers that are
rectified in an amplifier (Kitchin and Counts 2006); sun and clouds, and indicators that find their zero anew at
intervals (OIML R 76); heaters that are fed in bursts of whole waves (IEC 60947-4-3).
"""

from __future__ import annotations

import numpy as np
from numba import njit
from scipy.signal import ellipap, lfilter

from .outside_bench import _child
from .registry import Build, more_shapes, spread
from .sensor import _LAG, _RESONANCE, _disturb, ramp_filter
from .third_outside_bench import _fades


def echoes(time_s: np.ndarray, force: np.ndarray, delay_s: float, kept: float) -> np.ndarray:
    """y(t) = (1 + r) F(t − T) − r y(t − 2 T), what comes out of the closed end of a line."""
    count = int(np.ceil(delay_s / (time_s[1] - time_s[0])))
    grid = np.arange(int(np.ceil(time_s[-1] / delay_s * count)) + 2) * (delay_s / count)
    num, den = np.zeros(count + 1), np.zeros(2 * count + 1)
    num[-1], den[0], den[-1] = 1 + kept, 1.0, kept
    out = force[0] + lfilter(num, den, np.interp(grid, time_s, force) - force[0])
    return np.interp(time_s, grid, out)


def fractional(power: float, damping: float) -> tuple[np.ndarray, np.ndarray, float, float]:
    """(num, den, frequency, damping ratio of its pair) of 1/(s² + 2 ζ s^α + 1), s^α by three poles over two decades."""
    edges = 10.0 ** (-1 + (np.arange(3) * 2 + np.array([[1 - power], [1 + power]])) / 3)
    zeros, poles = np.poly(-edges[0]), np.poly(-edges[1])
    scale = 2 * damping * 10.0**power
    num = poles
    den = np.polyadd(np.polymul([1.0, 0.0, 1.0], poles), scale * zeros)
    roots = np.roots(den)
    pair = roots[np.argmax(roots.imag)]
    return num * den[-1] / num[-1], den, float(abs(pair)), float(-pair.real / abs(pair))


@more_shapes("resonance", "line", "fractional_damper")
def resonance(build: Build, shape: str, size: float) -> dict[str, float]:
    """The force comes through a line that throws it back, with all odd harmonics; or a damper of a polymer, s^α.

    `line`: (1 + r) e^{−s T}/(1 + r e^{−2 s T}); stated is its first pair of poles. `fractional_damper`: α of 0.4 to
    0.7; stated is the pair of poles.
    """
    rng = build.rng
    frequency = float(np.clip(rng.uniform(40, 80) / np.sqrt(size), 15, 300))
    damping, power = spread(rng, 0.05, 0.2), float(rng.uniform(0.4, 0.7))
    omega = 2 * np.pi * frequency
    if shape == "line":
        lost = np.pi * damping / np.sqrt(1 - damping**2)
        delay, kept = float(np.hypot(lost, np.pi) / (2 * omega)), float(np.exp(-lost))
        build.sensor(_RESONANCE, lambda t, force: echoes(t, force, delay, kept))
        return {"frequency": frequency, "damping_ratio": damping}
    num, den, apart, damping = fractional(power, 1.6 * damping)
    build.sensor(_RESONANCE, lambda t, force: ramp_filter(t * omega / apart, force, num.tolist(), den.tolist()))
    return {"frequency": frequency, "damping_ratio": damping}


@njit(cache=True)
def _slewed(force, h, tau, most_N_s):
    """y' = (F − y)/τ, and no faster than `most_N_s`."""
    out, y, share = np.zeros(force.shape[0]), force[0], -np.expm1(-h / tau)
    out[0] = y
    for k in range(1, force.shape[0]):
        step = (0.5 * (force[k] + force[k - 1]) - y) * share
        y += min(max(step, -most_N_s * h), most_N_s * h)
        out[k] = y
    return out


@more_shapes("sensor_lag", "cauer", "slew_rate")
def sensor_lag(build: Build, shape: str, size: float) -> dict[str, float]:
    """Four poles and two pairs of zeros after Cauer, of 0.5 and 40 dB; or a first order that is no faster than a rate.

    `cauer`: stated is the mean delay. `slew_rate`: it takes 12 to 25 ms from nothing to the greatest force, if the size
    is 1; stated is the time constant below that.
    """
    tau = 3e-3 * size * spread(build.rng, 0.7, 1.5)
    quickest = build.force_N / (size * spread(build.rng, 0.012, 0.025))
    zeros, poles, _ = ellipap(4, 0.5, 40.0)
    num, den = np.real(np.poly(zeros)), np.real(np.poly(poles))
    num, delay = num * den[-1] / num[-1], float(np.sum(-1 / poles).real)

    def stage(t, force):
        if shape == "cauer":
            return ramp_filter(t * delay / tau, force, num.tolist(), den.tolist())
        return _slewed(force, t[1] - t[0], tau, quickest)

    build.sensor(_LAG, stage)
    return {"time_constant": tau}


@more_shapes("force_delay", "two_cycles", "saves_power")
def force_delay(build: Build, shape: str, size: float) -> dict[str, float]:
    """One task reads the cell, another one reads the first, each by a cycle of its own; or a link that dozes at rest.

    `two_cycles`: of 0.6 to 0.9 and 0.4 to 0.6 of the delay, the rest is even. `saves_power`: later by 0.5 to 1 times
    after a rest than after a long move, within 0.1 to 0.4 s. Stated is the mean over the recording.
    """
    rng, motion = build.rng, build.plant.motion
    delay = 2e-3 * size * spread(rng, 0.6, 1.6)
    cycles, phases = delay * rng.uniform([0.6, 0.4], [0.9, 0.6]), rng.uniform(0, 1, 2)
    more, tau = float(rng.uniform(0.5, 1.0)), spread(rng, 0.1, 0.4)
    grid = np.arange(0.0, build.plant.duration_s, 1e-3)
    rests = 1 + more * (1 - _fades((np.abs(motion.velocity(grid)) > 1e-6).astype(float), 1e-3, tau))
    rests /= np.mean(rests)

    def late(t, _):
        if shape == "saves_power":
            return t - delay * np.interp(t, grid, rests)
        read = t - delay + cycles.sum() / 2
        for cycle, phase in zip(cycles, phases, strict=True):
            read = (np.floor(read / cycle + phase) - phase) * cycle
        return read

    build.delays.append(late)
    return {"delay": delay}


def pulled(angle: np.ndarray, pull: float) -> np.ndarray:
    """Adler's phase, φ' = (1 − κ sin φ)/√(1 − κ²), at θ = t: tan φ/2 = κ + √(1 − κ²) tan θ/2."""
    half = np.asarray(angle) / 2
    phase = 2 * np.arctan2(pull * np.cos(half) + np.sqrt(1 - pull**2) * np.sin(half), np.cos(half))
    return angle + np.angle(np.exp(1j * (phase - angle)))


@more_shapes("clock_skew", "pulled", "governor")
def clock_skew(build: Build, shape: str, size: float) -> dict[str, float]:
    """Another oscillator nearly catches the clock, which slips past it at times; or one that changes its speed.

    `pulled`: after Adler, κ of 0.5 to 0.8, every 4 to 12 s. `governor`: 0.4 or 1.6 of the skew, at random times every 2
    to 6 s, in no column of its own. Stated is the mean over the recording.
    """
    rng, duration = build.rng, build.plant.duration_s
    skew = float(rng.choice([-1.0, 1.0])) * 200e-6 * size * spread(rng, 0.6, 1.6)
    pull, omega = float(rng.uniform(0.5, 0.8)), 2 * np.pi / spread(rng, 4.0, 12.0)
    begins, dwell_s, child = float(rng.uniform(0, 2 * np.pi)), spread(rng, 2.0, 6.0), _child(rng)
    times = np.concatenate([[0.0], np.cumsum(child.exponential(dwell_s, int(4 * (duration + 10) / dwell_s) + 20))])
    rates = np.resize([0.4, 1.6] if child.random() < 0.5 else [1.6, 0.4], len(times) - 1)
    along = np.concatenate([[0.0], np.cumsum(rates * np.diff(times))])

    def gained(t):
        if shape == "pulled":
            return skew * (pulled(omega * t + begins, pull) - pulled(np.float64(begins), pull)) / omega
        return skew * np.interp(t, times, along)

    if shape == "pulled":
        build.own_clock = True
        build.stamps.append(lambda t: t + gained(t))
    else:
        build.delays.append(lambda t, _: t - gained(t))
    return {"skew": 1e6 * float(gained(duration)) / duration}


@more_shapes("force_bias", "rectified")
def force_bias(build: Build, shape: str, size: float) -> dict[str, float]:
    """A drive's carrier is rectified: 10 to 20 % more of it while the motor moves; stated is the mean over time."""
    rng, motion = build.rng, build.plant.motion
    bias = float(rng.choice([-1.0, 1.0])) * 0.05 * size * spread(rng, 0.6, 1.6)
    more = float(rng.uniform(0.1, 0.2))

    def moves(t):
        return np.abs(motion.velocity(t)) > 1e-6

    share = float(np.mean(moves(np.arange(0.0, build.plant.duration_s, 1e-3))))
    _disturb(build, lambda t: bias * (1 + more * (moves(t) - share)))
    return {"bias": bias}


@more_shapes("force_drift", "clouds", "found_anew")
def force_drift(build: Build, shape: str, size: float) -> dict[str, float]:
    """It drifts as the sun shines on it, and back by half of that behind clouds; or its zero is found anew at times.

    `clouds`: at random, every 3 to 10 s. `found_anew`: at even distances, every 0.25 to 0.4 of the recording.
    """
    rng, duration = build.rng, build.plant.duration_s
    rate = float(rng.choice([-1.0, 1.0])) * 0.002 * size * spread(rng, 0.6, 1.6)
    dwell_s, every, child = spread(rng, 3.0, 10.0), duration * float(rng.uniform(0.25, 0.4)), _child(rng)
    lengths = child.exponential(dwell_s, int(4 * (duration + 10) / dwell_s) + 20)
    times = np.concatenate([[0.0], np.cumsum(lengths)])
    along = np.concatenate([[0.0], np.cumsum(lengths * np.resize([1.0, -0.5], len(lengths)))])
    _disturb(build, lambda t: rate * (np.interp(t, times, along) if shape == "clouds" else t % every))
    return {"rate": rate}


@more_shapes("mains_hum", "bursts")
def mains_hum(build: Build, shape: str, size: float) -> dict[str, float]:
    """A heater is fed in bursts of whole waves, 0.4 to 0.7 of 20 to 60 of them; stated is the mean over time."""
    rng = build.rng
    amplitude = 0.03 * size * spread(rng, 0.6, 1.6)
    frequency = float(rng.choice([50.0, 60.0]) + rng.uniform(-0.05, 0.05))
    phase, waves = float(rng.uniform(0, 1)), int(rng.integers(20, 61))
    fed = round(waves * float(rng.uniform(0.4, 0.7)))

    def hum(t):
        turns = frequency * t + phase
        return amplitude * waves / fed * (np.floor(turns) % waves < fed) * np.sin(2 * np.pi * turns)

    _disturb(build, hum)
    return {"amplitude": amplitude, "frequency": frequency}
