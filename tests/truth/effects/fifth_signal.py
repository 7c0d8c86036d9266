"""The fifth shapes: from the cell to the sample.

Sources: dampers of oil, whose drag goes with the square of speed (Nayfeh and Mook, Nonlinear Oscillations), and mounts
of rubber with a spring behind their damper (Ruzicka and Derby 1971); lines with resistance and capacity all along
(Elmore 1948) and the mean that goes on by a share of each new sample, as indicators make it (Smith, Digital Signal
Processing); converters that take turns, and those that count down what they have integrated (Horowitz and Hill, The Art
of Electronics); crystals that age (Vig, Quartz Crystal Resonators and Oscillators) and clocks that lose ticks where
interrupts are held off (Mills, Network Time Protocol); compressors that switch; gauges and bodies that warm at two
speeds, and rooms with a heater that does; dimmers that cut the phase (IEC 61000-3-2).
"""

from __future__ import annotations

import numpy as np
from numba import njit
from scipy.signal import lfilter

from .registry import Build, more_shapes, spread
from .sensor import _LAG, _RESONANCE, _disturb, first_order, ramp_filter
from .third_machine import _fundamental


@njit(cache=True)
def _oil(force, h, omega, damping, drag):
    """y'' = ω² (F − y) − 2 ζ ω y' − q |y'| y', in quarter steps; at rest at first."""
    out, y, v, small = np.zeros(force.shape[0]), force[0], 0.0, h / 4
    out[0] = y
    for k in range(1, force.shape[0]):
        for part in range(4):
            f = force[k - 1] + (force[k] - force[k - 1]) * (part + 0.5) / 4
            lost, a = 2 * damping * omega + drag * abs(v), omega * omega
            # Midpoint rule, with the drag's |y'| of the beginning.
            new = v * (1 - lost * small / 2 - a * small * small / 4) + a * small * (f - y)
            new /= 1 + lost * small / 2 + a * small * small / 4
            y += small * (v + new) / 2
            v = new
        out[k] = y
    return out


def zener_mount(more: float, late: float) -> tuple[np.ndarray, float, float]:
    """Poles of k/(m s² + k (1 + N τ s/(τ s + 1))) with ω = 1: (coefficients, frequency, damping ratio of the pair)."""
    den = np.array([late, 1.0, late * (1 + more), 1.0])
    roots = np.roots(den)
    pair = roots[np.argmax(roots.imag)]
    return den, float(abs(pair)), float(-pair.real / abs(pair))


@more_shapes("resonance", "oil_damper", "zener_mount")
def resonance(build: Build, shape: str, size: float) -> dict[str, float]:
    """A damper of oil, whose part of the damping goes with the swing; or a mount of rubber, stiffer when it is quick.

    `oil_damper`: stated is the damping of a swing of 2 to 4 % of the greatest force, 0.7 of which is the oil's.
    `zener_mount`: (τ s + 1) ω²/((τ s + 1)(s² + ω²) + N ω² τ s), N of 0.25 to 0.8; stated is the pair of poles.
    """
    rng = build.rng
    frequency = float(np.clip(rng.uniform(40, 80) / np.sqrt(size), 15, 300))
    damping, swing = spread(rng, 0.05, 0.2), float(rng.uniform(0.02, 0.04)) * build.force_N
    more, late = float(rng.uniform(0.25, 0.8)), float(rng.uniform(0.6, 1.5))
    omega = 2 * np.pi * frequency
    if shape == "oil_damper":
        # In a swing of A, q |y'| y' takes as much as 2 ζ ω y' with ζ = 4 q A/3π.
        drag = 0.7 * damping * 3 * np.pi / (4 * swing)
        build.sensor(_RESONANCE, lambda t, force: _oil(force, t[1] - t[0], omega, 0.3 * damping, drag))
        return {"frequency": frequency, "damping_ratio": damping}
    den, apart, damping = zener_mount(more, late)
    powers = (omega / apart) ** np.arange(4.0)
    num = [late * powers[2], powers[3]]
    build.sensor(_RESONANCE, lambda t, force: ramp_filter(t, force, num, (den * powers).tolist()))
    return {"frequency": frequency, "damping_ratio": damping}


def _averaged(t: np.ndarray, force: np.ndarray, every_s: float, share: float) -> np.ndarray:
    """y goes on by a share of what is left, every so often, and stays until the next time."""
    begins = np.arange(int(t[-1] / every_s) + 2) * every_s
    taken = np.interp(begins, t, force)
    y = force[0] + lfilter([share], [1.0, share - 1], taken - force[0])
    return y[np.floor(t / every_s + 1e-9).astype(int)]


@more_shapes("sensor_lag", "rc_line", "exponential_mean")
def sensor_lag(build: Build, shape: str, size: float) -> dict[str, float]:
    """A line with resistance and capacity all along, 1/cosh √(2 τ s); or y + 0.4 (F − y), every half time constant.

    Stated is the mean delay, as of the other shapes.
    """
    tau = 3e-3 * size * spread(build.rng, 0.7, 1.5)
    # cosh √x is the product of 1 + 4 x/((2k + 1) π)²; what is left behind the eighth is shared out.
    parts = 1 / (2 * np.arange(8.0) + 1) ** 2

    def stage(t, force):
        if shape == "exponential_mean":
            # 1.5 steps by the mean, and a half as it is held.
            return _averaged(t, force, tau / 2, 0.4)
        for part in tau * parts / parts.sum():
            force = first_order(t, force, part)
        return force

    build.sensor(_LAG, stage)
    return {"time_constant": tau}


@more_shapes("force_delay", "takes_turns", "dual_slope")
def force_delay(build: Build, shape: str, size: float) -> dict[str, float]:
    """Two converters take turns, one of them later; or one integrates and counts down, the longer the more there is.

    `takes_turns`: by 0.2 to 0.4 of the mean either way. `dual_slope`: 0.7 of it without load, 1.3 at the greatest;
    stated is at half load.
    """
    rng, law, most, motion = build.rng, build.plant.pad.law, build.force_N, build.plant.motion
    delay, differs = 2e-3 * size * spread(rng, 0.6, 1.6), float(rng.uniform(0.2, 0.4))

    def late(t, _):
        if shape == "takes_turns":
            return t - delay * (1 + differs * (1 - 2 * (np.arange(len(t)) % 2)))
        return t - delay * (0.7 + 0.6 * np.clip(law.force(motion.position(t)) / most, 0.0, 1.2))

    build.delays.append(late)
    return {"delay": delay}


@more_shapes("clock_skew", "ages", "loses_ticks")
def clock_skew(build: Build, shape: str, size: float) -> dict[str, float]:
    """The rate goes on evenly, from 0.6 of the skew to 1.4; or ticks are lost, twice to three times as many in motion.

    Stated is the mean over the recording. `loses_ticks`: the clock is slow.
    """
    rng, duration, motion = build.rng, build.plant.duration_s, build.plant.motion
    skew = float(rng.choice([-1.0, 1.0])) * 200e-6 * size * spread(rng, 0.6, 1.6)
    more, grid = float(rng.uniform(1.0, 2.0)), np.arange(0.0, duration + 1.0, 1e-3)
    rate = 1 + more * (np.abs(motion.velocity(grid)) > 1e-6)
    lost = np.concatenate([[0.0], np.cumsum((rate[1:] + rate[:-1]) / 2 * 1e-3)])
    lost *= duration / np.interp(duration, grid, lost)

    def gained(t):
        if shape == "ages":
            return skew * (0.6 * t + 0.4 * t**2 / duration)
        return -abs(skew) * np.interp(t, grid, lost)

    build.own_clock = True
    build.stamps.append(lambda t: t + gained(t))
    return {"skew": 1e6 * float(gained(duration)) / duration}


@more_shapes("force_bias", "compressor")
def force_bias(build: Build, shape: str, size: float) -> dict[str, float]:
    """A compressor on the same supply switches every 8 to 25 s, and the zero with it, by a tenth; stated: the mean."""
    rng = build.rng
    bias = float(rng.choice([-1.0, 1.0])) * 0.05 * size * spread(rng, 0.6, 1.6)
    period, phase, runs = spread(rng, 8.0, 25.0), float(rng.uniform(0, 1)), float(rng.uniform(0.3, 0.6))
    _disturb(build, lambda t: bias * (1 + 0.1 * (((t / period + phase) % 1 < runs) - runs)))
    return {"bias": bias}


@more_shapes("force_drift", "two_bodies", "heater")
def force_drift(build: Build, shape: str, size: float) -> dict[str, float]:
    """A part that warms soon and one that warms late; or a heater that goes on and off, so that it drifts in steps.

    `two_bodies`: r (s τ_1 (1 − e^{−t/τ_1}) + (1 − s) τ_2 (1 − e^{−t/τ_2})), τ_1 a tenth of the recording or so and τ_2
    more than half. `heater`: r while it is on, at first, and a quarter of that while it is off. r is the initial rate.
    """
    rng, duration = build.rng, build.plant.duration_s
    rate = float(rng.choice([-1.0, 1.0])) * 0.002 * size * spread(rng, 0.6, 1.6)
    soon, late, share = duration * rng.uniform(0.05, 0.12), duration * rng.uniform(0.6, 1.5), rng.uniform(0.3, 0.6)
    period, on = spread(rng, 8.0, 20.0), float(rng.uniform(0.4, 0.7))

    def drift(t):
        if shape == "two_bodies":
            return -rate * (share * soon * np.expm1(-t / soon) + (1 - share) * late * np.expm1(-t / late))
        whole, part = np.divmod(t / period, 1.0)
        heated = whole * on + np.minimum(part, on)
        return rate * (0.25 * t + 0.75 * period * heated)

    _disturb(build, drift)
    return {"rate": rate}


@more_shapes("mains_hum", "dimmer")
def mains_hum(build: Build, shape: str, size: float) -> dict[str, float]:
    """A dimmer lets each half wave through from 50 to 100 degrees on; stated is the amplitude of the first harmonic."""
    rng = build.rng
    amplitude = 0.03 * size * spread(rng, 0.6, 1.6)
    frequency = float(rng.choice([50.0, 60.0]) + rng.uniform(-0.05, 0.05))
    phase, fires = float(rng.uniform(0, 2 * np.pi)), np.deg2rad(float(rng.uniform(50, 100)))

    def wave(angle):
        return np.sin(angle) * (angle % np.pi > fires)

    scale = amplitude / _fundamental(wave)
    _disturb(build, lambda t: scale * wave(2 * np.pi * frequency * t + phase))
    return {"amplitude": amplitude, "frequency": frequency}
