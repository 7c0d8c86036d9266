"""From the cell to the sample: resonance, lag, delay, clock, bias, drift and hum.

Sources: second-order dynamics of load cells (Doebelin, Measurement Systems), warm-up and logarithmic drift of strain
gauges (HBM application notes on creep and zero drift), mains pick-up with its third harmonic.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import cont2discrete, lfilter

from .registry import DISTURBANCE, Build, Samples, effect, spread

_RESONANCE, _LAG = 10, 20


def ramp_filter(time_s: np.ndarray, values: np.ndarray, num: list[float], den: list[float]) -> np.ndarray:
    """A continuous filter on an even grid, exact for values linear between the steps; at rest at the start."""
    # Normalised: the first value is taken off, so that the start is steady.
    b, a, _ = cont2discrete((num, den), float(time_s[1] - time_s[0]), method="foh")
    gain = num[-1] / den[-1]
    return lfilter(np.ravel(b), a, values - values[0]) + gain * values[0]


def second_order(time_s: np.ndarray, values: np.ndarray, frequency_Hz: float, damping_ratio: float) -> np.ndarray:
    """ω² / (s² + 2 ζ ω s + ω²)."""
    omega = 2 * np.pi * frequency_Hz
    return ramp_filter(time_s, values, [omega**2], [1.0, 2 * damping_ratio * omega, omega**2])


def first_order(time_s: np.ndarray, values: np.ndarray, time_constant_s: float) -> np.ndarray:
    """1 / (τ s + 1)."""
    return ramp_filter(time_s, values, [1.0], [time_constant_s, 1.0])


@effect("resonance", "second_order", "partial", "two_modes")
def resonance(build: Build, shape: str, size: float) -> dict[str, float]:
    """The force path swings; a smaller effect is a higher frequency, since what is seen goes with 1/f²."""
    rng = build.rng
    frequency = float(np.clip(rng.uniform(40, 80) / np.sqrt(size), 15, 300))
    damping = spread(rng, 0.05, 0.2)
    share = {"second_order": 1.0, "partial": float(rng.uniform(0.5, 0.8)), "two_modes": float(rng.uniform(0.6, 0.8))}[
        shape
    ]

    def stage(t, force):
        main = second_order(t, force, frequency, damping)
        rest = second_order(t, force, 2.4 * frequency, damping) if shape == "two_modes" else force
        return share * main + (1 - share) * rest

    build.sensor(_RESONANCE, stage)
    return {"frequency": frequency, "damping_ratio": damping}


@effect("sensor_lag", "first_order", "two_poles", "moving_average")
def sensor_lag(build: Build, shape: str, size: float) -> dict[str, float]:
    """A low-pass whose mean delay is the time constant stated."""
    tau = 3e-3 * size * spread(build.rng, 0.7, 1.5)

    def stage(t, force):
        if shape == "first_order":
            return first_order(t, force, tau)
        if shape == "two_poles":
            return first_order(t, first_order(t, force, 0.65 * tau), 0.35 * tau)
        # Mean over the last 2 τ, from the integral of the force.
        whole = np.concatenate([[0.0], np.cumsum((force[1:] + force[:-1]) / 2 * np.diff(t))])
        before = np.interp(t - 2 * tau, t, whole) + np.minimum(t - 2 * tau, 0.0) * force[0]
        return (whole - before) / (2 * tau)

    build.sensor(_LAG, stage)
    return {"time_constant": tau}


@effect("force_delay", "pure", "uneven")
def force_delay(build: Build, shape: str, size: float) -> dict[str, float]:
    """What is reported as of t was measured at t − delay; `uneven`: each sample with its own, spread by a seventh."""
    delay = 2e-3 * size * spread(build.rng, 0.6, 1.6)

    def late(t, rng):
        if shape == "pure":
            return t - delay
        return t - delay * np.clip(1 + 0.15 * rng.standard_normal(len(t)), 0.5, 1.5)

    build.delays.append(late)
    return {"delay": delay}


@effect("clock_skew", "stamped", "merged", "wandering", least_rate_hz=600.0)
def clock_skew(build: Build, shape: str, size: float) -> dict[str, float]:
    """Stamps of the force are true times (1 + skew): in a column of their own, or taken for the position's."""
    rng = build.rng
    skew = float(rng.choice([-1.0, 1.0])) * 200e-6 * size * spread(rng, 0.6, 1.6)
    if shape == "stamped":
        build.own_clock = True
        build.stamps.append(lambda t: t * (1 + skew))
    elif shape == "merged":
        build.delays.append(lambda t, _: t / (1 + skew))
    else:
        # The rate comes up over a minute: 80 % of it at first, 120 % in the end, as a crystal that warms.
        build.own_clock = True
        build.stamps.append(lambda t: t + skew * (1.2 * t - 0.4 * 20 * -np.expm1(-t / 20)))
    return {"skew": 1e6 * skew}


def _disturb(build: Build, added) -> None:
    def stage(samples: Samples, _: np.random.Generator) -> None:
        extra = added(samples.time_s)
        samples.force_N, samples.clean_N = samples.force_N + extra, samples.clean_N + extra

    build.samples.append((DISTURBANCE, stage))


@effect("force_bias", "constant", "stepped")
def force_bias(build: Build, shape: str, size: float) -> dict[str, float]:
    """A wrong zero; `stepped`: it moves by a tenth at some time."""
    rng = build.rng
    bias = float(rng.choice([-1.0, 1.0])) * 0.05 * size * spread(rng, 0.6, 1.6)
    moved, when = bias * (0.1 if shape == "stepped" else 0.0), build.plant.duration_s * rng.uniform(0.3, 0.7)
    _disturb(build, lambda t: bias + moved * (np.where(t > when, 0.5, -0.5)))
    return {"bias": bias}


@effect("force_drift", "linear", "exponential", "logarithmic")
def force_drift(build: Build, shape: str, size: float) -> dict[str, float]:
    """r t, r τ (1 − e^{−t/τ}), r τ ln(1 + t/τ): r is the initial rate."""
    rng = build.rng
    rate = float(rng.choice([-1.0, 1.0])) * 0.002 * size * spread(rng, 0.6, 1.6)
    tau = build.plant.duration_s * float(rng.uniform(0.3, 1.0))
    curves = {
        "linear": lambda t: rate * t,
        "exponential": lambda t: -rate * tau * np.expm1(-t / tau),
        "logarithmic": lambda t: rate * tau * np.log1p(t / tau),
    }
    _disturb(build, curves[shape])
    return {"rate": rate}


@effect("mains_hum", "sine", "harmonic", "wavering")
def mains_hum(build: Build, shape: str, size: float) -> dict[str, float]:
    """50 or 60 Hz within 0.05 Hz; with a third harmonic; with an amplitude that swells over seconds."""
    rng = build.rng
    amplitude = 0.03 * size * spread(rng, 0.6, 1.6)
    frequency = float(rng.choice([50.0, 60.0]) + rng.uniform(-0.05, 0.05))
    phase, third, slow = rng.uniform(0, 2 * np.pi, 3)
    beat_Hz = float(rng.uniform(0.02, 0.1))

    def hum(t):
        angle = 2 * np.pi * frequency * t
        wave = np.sin(angle + phase)
        if shape == "harmonic":
            wave = wave + 0.3 * np.sin(3 * angle + third)
        if shape == "wavering":
            wave = wave * (1 + 0.3 * np.sin(2 * np.pi * beat_Hz * t + slow))
        return amplitude * wave

    _disturb(build, hum)
    return {"amplitude": amplitude, "frequency": frequency}
