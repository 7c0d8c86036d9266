"""Further shapes of what happens between the cell and the sample, and of the channel's faults.

Sources: structures with an antiresonance (Ewins, Modal Testing); decimators of cascaded means (Hogenauer 1981); random
walk of an oscillator's frequency (Allan 1966); heat that diffuses into a body goes with √t (Carslaw and Jaeger); the
frequency of the grid; recovery of amplifiers from overload; bits that flip on a bus; two rates that beat.
"""

from __future__ import annotations

import numpy as np

from .registry import OUTLIERS, SATURATION, STUCK, Build, Samples, more_shapes, spread
from .sensor import _LAG, _RESONANCE, _disturb, ramp_filter


@more_shapes("resonance", "antiresonance")
def antiresonance(build: Build, shape: str, size: float) -> dict[str, float]:
    """A pair of zeros above the poles, where a part of the structure absorbs the motion of the rest."""
    rng = build.rng
    frequency = float(np.clip(rng.uniform(40, 80) / np.sqrt(size), 15, 300))
    damping, ratio = spread(rng, 0.05, 0.2), float(rng.uniform(1.4, 2.2))
    pole, zero = 2 * np.pi * frequency, 2 * np.pi * frequency * ratio
    # In ω² / (s² + 2 ζ ω s + ω²) · (s²/z² + 2 ζ s/z + 1).
    num = [pole**2 / zero**2, 2 * damping * pole**2 / zero, pole**2]
    den = [1.0, 2 * damping * pole, pole**2]
    build.sensor(_RESONANCE, lambda t, force: ramp_filter(t, force, num, den))
    return {"frequency": frequency, "damping_ratio": damping}


def _mean_over(t: np.ndarray, force: np.ndarray, window_s: float) -> np.ndarray:
    whole = np.concatenate([[0.0], np.cumsum((force[1:] + force[:-1]) / 2 * np.diff(t))])
    before = np.interp(t - window_s, t, whole) + np.minimum(t - window_s, 0.0) * force[0]
    return (whole - before) / window_s


@more_shapes("sensor_lag", "sinc3")
def sinc3(build: Build, shape: str, size: float) -> dict[str, float]:
    """Three running means in a row, as in the decimator of a sigma-delta converter; its delay is the time constant."""
    tau = 3e-3 * size * spread(build.rng, 0.7, 1.5)

    def stage(t, force):
        for _ in range(3):
            force = _mean_over(t, force, 2 * tau / 3)
        return force

    build.sensor(_LAG, stage)
    return {"time_constant": tau}


@more_shapes("force_delay", "polled")
def polled(build: Build, shape: str, size: float) -> dict[str, float]:
    """Another task reads the cell at a rate of its own, and what is reported is its last reading: the delay saws.

    Its period is below the sampling's, so that no reading comes twice; the delay stated is the mean.
    """
    delay = 2e-3 * size * spread(build.rng, 0.6, 1.6)
    period, phase = min(delay, 0.7 / build.rate_hz), float(build.rng.uniform(0, 1))

    def late(t, rng):
        sent = t - delay + period / 2
        return (np.floor(sent / period + phase) - phase) * period

    build.delays.append(late)
    return {"delay": delay}


@more_shapes("clock_skew", "random_walk")
def random_walk(build: Build, shape: str, size: float) -> dict[str, float]:
    """The rate of the force clock walks at random, a quarter of the skew or so; the skew stated is the mean."""
    rng = build.rng
    skew = float(rng.choice([-1.0, 1.0])) * 200e-6 * size * spread(rng, 0.6, 1.6)
    knots = np.linspace(0, build.plant.duration_s + 1.0, 60)
    walk = np.cumsum(rng.standard_normal(len(knots)))
    walk = walk - walk.mean()
    rate = skew * (1 + 0.25 * walk / np.std(walk))
    gained = np.concatenate([[0.0], np.cumsum((rate[1:] + rate[:-1]) / 2 * np.diff(knots))])
    build.own_clock = True
    build.stamps.append(lambda t: t + np.interp(t, knots, gained))
    return {"skew": 1e6 * float(gained[-1] / knots[-1])}


@more_shapes("force_bias", "settling")
def settling(build: Build, shape: str, size: float) -> dict[str, float]:
    """Tared too early: a sixth of the bias fades within 3 to 12 s."""
    rng = build.rng
    bias = float(rng.choice([-1.0, 1.0])) * 0.05 * size * spread(rng, 0.6, 1.6)
    fades_s = float(rng.uniform(3, 12))
    _disturb(build, lambda t: bias * (1 + np.exp(-t / fades_s) / 6))
    return {"bias": bias}


@more_shapes("force_drift", "square_root")
def square_root(build: Build, shape: str, size: float) -> dict[str, float]:
    """Heat that diffuses into the cell's body: 2 r τ (√(1 + t/τ) − 1), of initial rate r."""
    rng = build.rng
    rate = float(rng.choice([-1.0, 1.0])) * 0.002 * size * spread(rng, 0.6, 1.6)
    tau = build.plant.duration_s * float(rng.uniform(0.1, 0.5))
    _disturb(build, lambda t: 2 * rate * tau * (np.sqrt(1 + t / tau) - 1))
    return {"rate": rate}


@more_shapes("mains_hum", "grid")
def grid(build: Build, shape: str, size: float) -> dict[str, float]:
    """The frequency of the grid swings by some 10 mHz over half a minute; the one stated is its mean."""
    rng = build.rng
    amplitude = 0.03 * size * spread(rng, 0.6, 1.6)
    frequency = float(rng.choice([50.0, 60.0]) + rng.uniform(-0.03, 0.03))
    swing_Hz, period_s = float(rng.uniform(0.005, 0.015)), float(rng.uniform(20, 60))
    phase, slow = rng.uniform(0, 2 * np.pi, 2)

    def hum(t):
        wander = swing_Hz * period_s * np.sin(2 * np.pi * t / period_s + slow)
        return amplitude * np.sin(2 * np.pi * frequency * t + wander + phase)

    _disturb(build, hum)
    return {"amplitude": amplitude, "frequency": frequency}


@more_shapes("saturation", "slow_recovery")
def slow_recovery(build: Build, shape: str, size: float) -> dict[str, float]:
    """The amplifier stays at its limit for 10 to 40 ms after the force is back within."""
    share = max(1 - 0.2 * size * float(build.rng.uniform(0.8, 1.2)), 0.3)
    recovers_s = float(build.rng.uniform(0.01, 0.04))
    told: dict[str, float] = {"limit": float("nan")}

    def stage(samples: Samples, _: np.random.Generator) -> None:
        limit = told["limit"] = share * float(np.max(samples.clean_N))
        t, over = samples.time_s, samples.clean_N > limit
        # Time since the force was last above the limit; samples may be a little out of order where they jitter.
        last = np.maximum.accumulate(np.where(over, t, -np.inf))
        held = t - last < recovers_s
        samples.flags["saturated"] = held | (samples.force_N > limit)
        samples.clean_N = np.where(held, limit, samples.clean_N)
        samples.force_N = np.where(held, limit, np.minimum(samples.force_N, limit))

    build.samples.append((SATURATION, stage))
    return told


@more_shapes("outliers", "bit_errors")
def bit_errors(build: Build, shape: str, size: float) -> dict[str, float]:
    """One of two bits of the word flips: off by one of two values, 20 to 25 and twice as many noise deviations."""
    fraction = 0.005 * size * float(build.rng.uniform(0.7, 1.4))
    bit_N = build.noise_std_N * float(build.rng.uniform(20, 25))

    def stage(samples: Samples, rng: np.random.Generator) -> None:
        n = len(samples.force_N)
        hit = rng.choice(n, max(1, round(fraction * n)), replace=False)
        weight = bit_N * rng.choice([1.0, 2.0], len(hit))
        samples.force_N = samples.force_N.copy()
        # A bit that is set is cleared, one that is not is set.
        is_set = np.floor(samples.force_N[hit] / weight) % 2 == 1
        samples.force_N[hit] += np.where(is_set, -weight, weight)
        samples.flags["outlier"] = np.zeros(n, dtype=bool)
        samples.flags["outlier"][hit] = True

    build.samples.append((OUTLIERS, stage))
    return {"fraction": fraction}


@more_shapes("stuck_samples", "beat")
def beat(build: Build, shape: str, size: float) -> dict[str, float]:
    """The converter is a little slower than the reader: at even distances a value is read twice."""
    fraction = 0.01 * size * float(build.rng.uniform(0.7, 1.4))

    def stage(samples: Samples, rng: np.random.Generator) -> None:
        n = len(samples.force_N)
        every = min(1 / fraction, n / 3)
        at = np.floor(rng.uniform(1, every) + every * np.arange(n)).astype(int)
        at = at[at < n]
        force = samples.force_N.copy()
        force[at] = force[at - 1]
        samples.force_N = force
        samples.flags["stuck"] = np.zeros(n, dtype=bool)
        samples.flags["stuck"][at] = True

    build.samples.append((STUCK, stage))
    return {"fraction": fraction}
