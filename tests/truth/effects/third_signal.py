"""Third shapes of what happens between the cell and the sample.

Sources: modes close to each other (Ewins, Modal Testing); cells whose stiffness goes with the load; filters after
Bessel (Thomson 1949) and Butterworth (1930), as in front of converters; queues that fill and are emptied, and waits
with an exponential tail; clocks that are set by others (Mills, Network Time Protocol) or follow a thermostat; recovery
that is a hyperbola of time; air conditioning; voltage with flat tops (IEC 61000-3-2), and inverters that hum while
they drive.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from scipy.signal import besselap, buttap

from .registry import Build, more_shapes, spread
from .sensor import _LAG, _RESONANCE, _disturb, first_order, ramp_filter, second_order


@more_shapes("resonance", "close_pair")
def close_pair(build: Build, shape: str, size: float) -> dict[str, float]:
    """Two modes a seventh to a quarter apart, which beat; stated is the one with the greater part, 55 to 70 %."""
    rng = build.rng
    frequency = float(np.clip(rng.uniform(40, 80) / np.sqrt(size), 15, 300))
    damping, share, apart = spread(rng, 0.05, 0.2), float(rng.uniform(0.55, 0.7)), float(rng.uniform(1.14, 1.25))

    def stage(t, force):
        main = second_order(t, force, frequency, damping)
        return share * main + (1 - share) * second_order(t, force, apart * frequency, damping)

    build.sensor(_RESONANCE, stage)
    return {"frequency": frequency, "damping_ratio": damping}


@njit(cache=True)
def _swings(force, h, omega, damping, goes, most):
    """y'' = ω² s (F − y) − 2 ζ ω y' with a stiffness s that goes with F, in quarter steps; at rest at first."""
    out, y, v = np.zeros(force.shape[0]), force[0], 0.0
    out[0] = y
    small = h / 4
    for k in range(1, force.shape[0]):
        for part in range(4):
            f = force[k - 1] + (force[k] - force[k - 1]) * (part + 0.5) / 4
            stiff = 1 + goes * (min(max(f / most, 0.0), 1.2) - 0.5)
            # Midpoint rule: y' = v and v' = ω² s (f − y) − 2 ζ ω v with the means of y and v over the step.
            a = omega * omega * stiff
            new = v * (1 - damping * omega * small - a * small * small / 4) + a * small * (f - y)
            new /= 1 + damping * omega * small + a * small * small / 4
            y += small * (v + new) / 2
            v = new
        out[k] = y
    return out


@more_shapes("resonance", "loaded")
def loaded(build: Build, shape: str, size: float) -> dict[str, float]:
    """The stiffer the more it bears: ω² grows by 20 to 40 % from no load to the greatest; stated: at half load."""
    rng, most = build.rng, build.force_N
    frequency = float(np.clip(rng.uniform(40, 80) / np.sqrt(size), 15, 300))
    damping, goes = spread(rng, 0.05, 0.2), float(rng.uniform(0.2, 0.4))
    omega = 2 * np.pi * frequency
    build.sensor(_RESONANCE, lambda t, force: _swings(force, t[1] - t[0], omega, damping, goes, most))
    return {"frequency": frequency, "damping_ratio": damping}


def all_pole(time_s: np.ndarray, values: np.ndarray, poles: np.ndarray, delay_s: float) -> np.ndarray:
    """A low-pass of these poles, scaled so that slow signals come late by `delay_s`, which is Σ −1/p."""
    poles = poles * np.sum(-1 / poles).real
    scaled = time_s / delay_s
    for pole in poles[poles.imag >= -1e-9]:
        if abs(pole.imag) < 1e-9:
            values = first_order(scaled, values, float(-1 / pole.real))
        else:
            values = ramp_filter(scaled, values, [abs(pole) ** 2], [1.0, -2 * pole.real, abs(pole) ** 2])
    return values


@more_shapes("sensor_lag", "bessel", "butterworth")
def converter_filter(build: Build, shape: str, size: float) -> dict[str, float]:
    """Four poles after Bessel, or three after Butterworth, which overshoots; its delay is the time constant stated."""
    tau = 3e-3 * size * spread(build.rng, 0.7, 1.5)
    poles = besselap(4)[1] if shape == "bessel" else buttap(3)[1]
    build.sensor(_LAG, lambda t, force: all_pole(t, force, poles, tau))
    return {"time_constant": tau}


@more_shapes("force_delay", "queue")
def queue(build: Build, shape: str, size: float) -> dict[str, float]:
    """A queue fills over 2 to 8 s and is emptied: the delay grows from 0.7 to 1.3 of its mean, and falls back."""
    delay = 2e-3 * size * spread(build.rng, 0.6, 1.6)
    period, phase = spread(build.rng, 2.0, 8.0), float(build.rng.uniform(0, 1))
    build.delays.append(lambda t, rng: t - delay * (0.7 + 0.6 * ((t / period + phase) % 1)))
    return {"delay": delay}


@more_shapes("force_delay", "tail")
def tail(build: Build, shape: str, size: float) -> dict[str, float]:
    """0.8 of the delay always, the rest a wait with an exponential tail, another one for each sample."""
    delay = 2e-3 * size * spread(build.rng, 0.6, 1.6)
    build.delays.append(lambda t, rng: t - delay * (0.8 + 0.2 * rng.exponential(1.0, len(t))))
    return {"delay": delay}


@more_shapes("clock_skew", "resynchronised")
def resynchronised(build: Build, shape: str, size: float) -> dict[str, float]:
    """A slow clock is set once, by a fifth to a third of what it has lost; stated is its rate before and after."""
    rng = build.rng
    skew, duration = -200e-6 * size * spread(rng, 0.6, 1.6), build.plant.duration_s
    when, share = duration * float(rng.uniform(0.4, 0.8)), float(rng.uniform(0.2, 1 / 3))
    build.own_clock = True
    build.stamps.append(lambda t: t * (1 + skew) - np.where(t > when, share * skew * when, 0.0))
    return {"skew": 1e6 * skew}


@more_shapes("clock_skew", "thermostat")
def thermostat(build: Build, shape: str, size: float) -> dict[str, float]:
    """The rate swings by a third to two thirds as a thermostat switches, every 10 to 30 s; stated is its mean."""
    rng = build.rng
    skew = float(rng.choice([-1.0, 1.0])) * 200e-6 * size * spread(rng, 0.6, 1.6)
    swings, period, phase = float(rng.uniform(0.33, 0.67)), spread(rng, 10.0, 30.0), float(rng.uniform(0, 2 * np.pi))

    def gained(t):
        angle = 2 * np.pi * t / period
        return skew * (t + swings * period / (2 * np.pi) * (np.cos(phase) - np.cos(angle + phase)))

    build.own_clock = True
    build.stamps.append(lambda t: t + gained(t))
    return {"skew": 1e6 * float(gained(build.plant.duration_s)) / build.plant.duration_s}


@more_shapes("force_bias", "wavers")
def wavers(build: Build, shape: str, size: float) -> dict[str, float]:
    """By a tenth, with two periods of 10 to 60 s that do not go together."""
    rng = build.rng
    bias = float(rng.choice([-1.0, 1.0])) * 0.05 * size * spread(rng, 0.6, 1.6)
    periods, phases = rng.uniform([10, 30], [20, 60]), rng.uniform(0, 2 * np.pi, 2)

    def added(t):
        waves = np.sin(2 * np.pi * t[:, None] / periods + phases)
        return bias * (1 + 0.05 * np.sum(waves, axis=1))

    _disturb(build, added)
    return {"bias": bias}


@more_shapes("force_drift", "hyperbolic", "turns")
def drifts(build: Build, shape: str, size: float) -> dict[str, float]:
    """r t/(1 + t/τ), or a room that warms and cools: r P/2π sin 2πt/P, which turns at P/4. r is the initial rate."""
    rng, duration = build.rng, build.plant.duration_s
    rate = float(rng.choice([-1.0, 1.0])) * 0.002 * size * spread(rng, 0.6, 1.6)
    tau, omega = duration * float(rng.uniform(0.4, 1.2)), 2 * np.pi / (duration * float(rng.uniform(2.0, 4.0)))
    if shape == "hyperbolic":
        _disturb(build, lambda t: rate * t / (1 + t / tau))
    else:
        _disturb(build, lambda t: rate / omega * np.sin(omega * t))
    return {"rate": rate}


@more_shapes("mains_hum", "flat_topped")
def flat_topped(build: Build, shape: str, size: float) -> dict[str, float]:
    """Rectifiers flatten the tops: −15 to −25 % of the third harmonic, and half and a quarter of that of two more."""
    rng = build.rng
    amplitude = 0.03 * size * spread(rng, 0.6, 1.6)
    frequency = float(rng.choice([50.0, 60.0]) + rng.uniform(-0.05, 0.05))
    phase, third = float(rng.uniform(0, 2 * np.pi)), float(rng.uniform(0.15, 0.25))
    parts = {1: 1.0, 3: third, 5: -third / 2, 7: -third / 4}

    def hum(t):
        angle = 2 * np.pi * frequency * t + phase
        return amplitude * sum(part * np.sin(n * angle) for n, part in parts.items())

    _disturb(build, hum)
    return {"amplitude": amplitude, "frequency": frequency}


@more_shapes("mains_hum", "inverter")
def inverter(build: Build, shape: str, size: float) -> dict[str, float]:
    """Half as much again while the motor moves as at rest; stated is the mean over time."""
    rng, motion = build.rng, build.plant.motion
    amplitude = 0.03 * size * spread(rng, 0.6, 1.6)
    frequency = float(rng.choice([50.0, 60.0]) + rng.uniform(-0.05, 0.05))
    phase = float(rng.uniform(0, 2 * np.pi))

    def moves(t):
        return np.abs(motion.velocity(t)) > 1e-6

    share = float(np.mean(moves(np.arange(0.0, build.plant.duration_s, 1e-3))))
    rest = amplitude / (1 + 0.5 * share)
    _disturb(build, lambda t: rest * (1 + 0.5 * moves(t)) * np.sin(2 * np.pi * frequency * t + phase))
    return {"amplitude": amplitude, "frequency": frequency}
