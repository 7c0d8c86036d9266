"""The fourth shapes: from the cell to the sample.

Sources: transmissibility of a spring and a damper side by side (Den Hartog, Mechanical Vibrations); amplifiers whose
bandwidth is near the cell's own frequency (Doebelin, Measurement Systems); lead and lag of a divider with a capacitor;
filters after Chebyshev, as in front of converters; transfers in blocks and the latency timer of serial adapters on USB
(FTDI AN232B-04), buses that are busy while a drive moves; records that lose or double a sample now and then, clocks
that are slewed at intervals (Mills, Network Time Protocol); batteries that end and doors that are opened; the ripple of
the excitation, which a bridge multiplies by its load.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import cheb1ap

from .registry import Build, more_shapes, spread
from .sensor import _LAG, _RESONANCE, _disturb, first_order, ramp_filter, second_order
from .third_signal import all_pole


@more_shapes("resonance", "transmitted", "amplifier")
def resonance(build: Build, shape: str, size: float) -> dict[str, float]:
    """The damper passes force on as well, (2 ζ ω s + ω²)/(s² + 2 ζ ω s + ω²); or a third pole at 2 to 4 ω follows."""
    rng = build.rng
    frequency = float(np.clip(rng.uniform(40, 80) / np.sqrt(size), 15, 300))
    damping, ratio = spread(rng, 0.05, 0.2), float(rng.uniform(2.0, 4.0))
    omega = 2 * np.pi * frequency

    def stage(t, force):
        if shape == "transmitted":
            return ramp_filter(t, force, [2 * damping * omega, omega**2], [1.0, 2 * damping * omega, omega**2])
        return first_order(t, second_order(t, force, frequency, damping), 1 / (ratio * omega))

    build.sensor(_RESONANCE, stage)
    return {"frequency": frequency, "damping_ratio": damping}


@more_shapes("sensor_lag", "partly", "chebyshev")
def sensor_lag(build: Build, shape: str, size: float) -> dict[str, float]:
    """A fifth to two fifths passes at once, the rest late; or four poles after Chebyshev with a ripple of 0.5 dB.

    Stated is the mean delay, as of the other shapes.
    """
    tau, late = 3e-3 * size * spread(build.rng, 0.7, 1.5), float(build.rng.uniform(0.6, 0.8))
    poles = cheb1ap(4, 0.5)[1]

    def stage(t, force):
        if shape == "chebyshev":
            return all_pole(t, force, poles, tau)
        return force + late * (first_order(t, force, tau / late) - force)

    build.sensor(_LAG, stage)
    return {"time_constant": tau}


@more_shapes("force_delay", "blocks")
def blocks(build: Build, shape: str, size: float) -> dict[str, float]:
    """Samples come in blocks of 16 to 64 ms; each block is late by its own, normal about the mean, a fifth of it."""
    delay = 2e-3 * size * spread(build.rng, 0.6, 1.6)
    length_s, seed = spread(build.rng, 0.016, 0.064), int(build.rng.integers(2**31))
    off = np.random.default_rng(seed).standard_normal(int((build.plant.duration_s + 10) / length_s) + 10)
    off = np.clip(off - off.mean(), -2, 2)
    build.delays.append(lambda t, _: t - delay * (1 + 0.2 * off[np.floor(np.maximum(t, 0.0) / length_s).astype(int)]))
    return {"delay": delay}


@more_shapes("force_delay", "busy_bus")
def busy_bus(build: Build, shape: str, size: float) -> dict[str, float]:
    """While the motor moves its messages go first, and the force is late; at rest by 0.5 to 0.8 of that."""
    delay, rests = 2e-3 * size * spread(build.rng, 0.6, 1.6), float(build.rng.uniform(0.5, 0.8))
    motion = build.plant.motion
    build.delays.append(lambda t, _: t - delay * np.where(np.abs(motion.velocity(t)) > 1e-6, 1.0, rests))
    return {"delay": delay}


@more_shapes("clock_skew", "slipped_samples")
def slipped_samples(build: Build, shape: str, size: float) -> dict[str, float]:
    """Samples are counted, and at even distances one is lost or comes twice: from there on all are off by one more."""
    skew, rate = 200e-6 * size * spread(build.rng, 0.6, 1.6), build.rate_hz
    sign, phase = float(build.rng.choice([-1.0, 1.0])), float(build.rng.uniform(0, 1))
    # Counted too slowly where samples are lost: what is taken for t was measured later.
    build.delays.append(lambda t, _: t - sign * np.floor(skew * t * rate + phase) / rate)
    return {"skew": 1e6 * sign * skew}


@more_shapes("clock_skew", "slewed")
def slewed(build: Build, shape: str, size: float) -> dict[str, float]:
    """Every 8 to 20 s a daemon finds the clock off, and for two fifths of the time it runs at 0.4 of its skew.

    Stated is the mean over the recording.
    """
    rng = build.rng
    skew = float(rng.choice([-1.0, 1.0])) * 200e-6 * size * spread(rng, 0.6, 1.6)
    period, phase = spread(rng, 8.0, 20.0), float(rng.uniform(0, 1))

    def along(t):
        # ∫ of 1.4 for 0.6 of the period, then 0.4.
        whole, part = np.divmod(t / period + phase, 1.0)
        return period * (whole + 1.4 * np.minimum(part, 0.6) + 0.4 * np.maximum(part - 0.6, 0.0))

    start, duration = along(0.0), build.plant.duration_s
    build.own_clock = True
    build.stamps.append(lambda t: t + skew * (along(t) - start))
    return {"skew": 1e6 * skew * float(along(duration) - start) / duration}


@more_shapes("force_bias", "cable")
def cable(build: Build, shape: str, size: float) -> dict[str, float]:
    """The cell's cable pulls, by a tenth to a fifth more at one end of the way than at the other; stated: the mean."""
    rng = build.rng
    bias = float(rng.choice([-1.0, 1.0])) * 0.05 * size * spread(rng, 0.6, 1.6)
    pulls, depth = float(rng.choice([-1.0, 1.0]) * rng.uniform(0.1, 0.2)), build.depth_mm
    build.plant.felt.append(lambda t, x, v, a: bias * (1 + pulls * (np.clip(x / depth, -0.5, 1.5) - 0.5)))
    return {"bias": bias}


@more_shapes("force_drift", "battery", "door")
def drifts(build: Build, shape: str, size: float) -> dict[str, float]:
    """r t (1 + t/2τ), quicker and quicker; or r t until some time, and a quarter of that from there on."""
    rng, duration = build.rng, build.plant.duration_s
    rate = float(rng.choice([-1.0, 1.0])) * 0.002 * size * spread(rng, 0.6, 1.6)
    tau, when = duration * float(rng.uniform(0.8, 2.0)), duration * float(rng.uniform(0.4, 0.7))
    if shape == "battery":
        _disturb(build, lambda t: rate * t * (1 + t / (2 * tau)))
    else:
        _disturb(build, lambda t: rate * (np.minimum(t, when) + 0.25 * np.maximum(t - when, 0.0)))
    return {"rate": rate}


@more_shapes("mains_hum", "excitation")
def excitation(build: Build, shape: str, size: float) -> dict[str, float]:
    """Part of it is ripple of the bridge's supply: 0.7 in air, and as much more at the greatest load as it bears.

    It grows by 0.6 of the amplitude from no load to the greatest; stated is the mean over time.
    """
    rng, most = build.rng, build.force_N
    wanted = 0.03 * size * spread(rng, 0.6, 1.6)
    frequency = float(rng.choice([50.0, 60.0]) + rng.uniform(-0.05, 0.05))
    phase, told = float(rng.uniform(0, 2 * np.pi)), {"amplitude": wanted, "frequency": frequency}

    def stage(t, force):
        swells = wanted * (0.7 + 0.6 * np.clip(force / most, 0.0, 1.2))
        told["amplitude"] = float(np.mean(swells))
        return force + swells * np.sin(2 * np.pi * frequency * t + phase)

    build.sensor(_LAG + 20, stage)
    return told
