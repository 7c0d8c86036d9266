"""The ninth shapes from the cell to the sample.

Sources: force balances (E. Doebelin, Measurement Systems) and N. Hayes, Roots of the transcendental equation associated
with a certain difference-differential equation, J. London Math. Soc. 25 (1950), for loops with a dead time; S. Masri
and T. Caughey, On the stability of the impact damper, J. Appl. Mech. 33 (1966); N. Gallagher and G. Wise, A theoretical
analysis of the properties of median filters, IEEE Trans. ASSP 29 (1981); E. Andrade, The viscosity of liquids, Nature
125 (1930), for oil that thins as it warms; W. Leland, M. Taqqu, W. Willinger and D. Wilson, On the self-similar nature
of Ethernet traffic, IEEE/ACM Trans. Netw. 2 (1994); J. Dunnicliff, Geotechnical Instrumentation for Monitoring Field
Performance (1988), vibrating wires; C. Pascoe, Time, technology and leaping seconds (Google 2011), smeared leaps; J.
Barnes and D. Allan, A statistical model of flicker noise, Proc. IEEE 54 (1966); K. Hoffmann, An Introduction to
Measurements using Strain Gages (1989), zeros that are strained away; I. Langmuir, The evaporation of small spheres,
Phys. Rev. 12 (1918); G. Uhlenbeck and L. Ornstein, On the theory of the Brownian motion, Phys. Rev. 36 (1930); the
flicker of arc furnaces, for which there are flickermeters (IEC 61000-4-15).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numba import njit

from .fourth_outside_bench import _wandering
from .outside_bench import _child
from .registry import Build, more_shapes, spread
from .sensor import _LAG, _RESONANCE, _disturb


def loop_with_dead_time(frequency_Hz: float, damping: float) -> tuple[float, float]:
    """(gain, dead time) of a loop s + K e^{−s T} = 0 whose slowest pair of roots has that frequency and damping."""
    omega, side = 2 * np.pi * frequency_Hz, np.sqrt(1 - damping**2)
    dead_s = (np.pi / 2 - np.arcsin(damping)) / (omega * side)
    return float(omega * np.exp(-damping * omega * dead_s)), float(dead_s)


@njit(cache=True)
def _compensated(force, h, gain, dead_s):
    """y'(t) = K (F − y)(t − T), what is missing taken as linear between the steps; T is more than a step."""
    n = force.shape[0]
    out, missing = np.zeros(n), np.zeros(n)
    out[0], back = force[0], dead_s / h
    whole = int(back)
    part = back - whole
    before = 0.0
    for k in range(1, n):
        i = k - whole
        now = 0.0
        if i >= 1:
            now = missing[i] * (1 - part) + missing[i - 1] * part
        out[k] = out[k - 1] + gain * h * (before + now) / 2
        missing[k] = force[k] - out[k]
        before = now
    return out


@njit(cache=True)
def _rattles(force, h, omega, damping, mass, gap, bounces):
    """y'' = ω² (F − y) − 2 ζ ω y' of a mass of 1, in which another one is free to fly between walls at ± gap."""
    out, y, v, small = np.zeros(force.shape[0]), force[0], 0.0, h / 4
    place, speed = y, 0.0
    out[0] = y
    a = omega * omega
    for k in range(1, force.shape[0]):
        for part in range(4):
            f = force[k - 1] + (force[k] - force[k - 1]) * (part + 0.5) / 4
            # Midpoint rule.
            new = v * (1 - damping * omega * small - a * small * small / 4) + a * small * (f - y)
            new /= 1 + damping * omega * small + a * small * small / 4
            y += small * (v + new) / 2
            v = new
            place += small * speed
            off = place - y
            if abs(off) > gap:
                place = y + np.copysign(gap, off)
                if (speed - v) * off > 0:
                    mean = (v + mass * speed) / (1 + mass)
                    apart = bounces * (speed - v)
                    v, speed = mean + mass * apart / (1 + mass), mean - apart / (1 + mass)
        out[k] = y
    return out


@more_shapes("resonance", "force_compensation", "impact_damper")
def resonance(build: Build, shape: str, size: float) -> dict[str, float]:
    """A cell that makes up for the force by a loop with a dead time, K e^{−s T}/(s + K e^{−s T}); or a loose mass.

    `force_compensation`: stated is the slowest pair of its roots. `impact_damper`: a mass of 4 to 10 % flies between
    walls at ± 0.5 to 1.5 % of the greatest force (as a deflection) and bounces by half; stated is what swings less.
    """
    rng = build.rng
    frequency = float(np.clip(rng.uniform(40, 80) / np.sqrt(size), 15, 300))
    damping, mass = spread(rng, 0.05, 0.2), float(rng.uniform(0.04, 0.1))
    gap = build.force_N * spread(rng, 0.005, 0.015)
    gain, dead_s = loop_with_dead_time(frequency, damping)

    def stage(t, force):
        h = float(t[1] - t[0])
        if shape == "force_compensation":
            return _compensated(force, h, gain, dead_s)
        return _rattles(force, h, 2 * np.pi * frequency, damping, mass, gap, 0.5)

    build.sensor(_RESONANCE, stage)
    return {"frequency": frequency, "damping_ratio": damping}


def running_median(time_s: np.ndarray, force: np.ndarray, every_s: float) -> np.ndarray:
    """The median of the last nine values taken every so often, held until the next one."""
    count = int(time_s[-1] / every_s) + 2
    taken = np.interp(np.arange(-8, count) * every_s, time_s, force)
    median = np.median(np.lib.stride_tricks.sliding_window_view(taken, 9), axis=1)
    return median[np.floor(time_s / every_s + 1e-9).astype(int)]


@njit(cache=True)
def _thins(force, h, tau_s):
    """First order, with a time constant for each step."""
    out, y = np.zeros(force.shape[0]), force[0]
    out[0] = y
    for k in range(1, force.shape[0]):
        f = 0.5 * (force[k] + force[k - 1])
        y = f + (y - f) * np.exp(-h / tau_s[k])
        out[k] = y
    return out


@more_shapes("sensor_lag", "running_median", "oil_warms")
def sensor_lag(build: Build, shape: str, size: float) -> dict[str, float]:
    """The median of nine values; or a throttle whose oil thins as it warms, to a half or a third of the first lag.

    `running_median`: late by four and a half steps, which is stated. `oil_warms`: by an exponential of a warming that
    takes 0.2 to 0.6 of the recording; stated is the mean over the recording.
    """
    rng, duration = build.rng, build.plant.duration_s
    tau = 3e-3 * size * spread(rng, 0.7, 1.5)
    thins, warms_s = np.log(float(rng.uniform(2.0, 3.0))), duration * float(rng.uniform(0.2, 0.6))

    def thick(t):
        return np.exp(thins * np.expm1(-t / warms_s) / -np.expm1(-duration / warms_s))

    mean = float(np.mean(thick(np.arange(0.0, duration, 1e-2))))

    def stage(t, force):
        if shape == "running_median":
            return running_median(t, force, tau / 4.5)
        return _thins(force, float(t[1] - t[0]), tau / mean * thick(t))

    build.sensor(_LAG, stage)
    return {"time_constant": tau}


def coloured(child: np.random.Generator, duration_s: float, power: float, step_s: float = 0.05) -> Callable:
    """Noise of mean 0 and deviation 1 whose power goes with f^{−power}, as a function of time."""
    count = 2 ** int(np.ceil(np.log2(duration_s / step_s + 2)))
    lines = np.fft.rfft(child.standard_normal(count))
    lines[0] = 0.0
    lines[1:] *= np.arange(1.0, len(lines)) ** (-power / 2)
    path = np.fft.irfft(lines, count)[: int(duration_s / step_s) + 2]
    path = (path - path.mean()) / path.std()
    return lambda t: np.interp(t, step_s * np.arange(len(path)), path)


@more_shapes("force_delay", "self_similar", "vibrating_wire")
def force_delay(build: Build, shape: str, size: float) -> dict[str, float]:
    """A network busy on all scales of time alike; or a wire whose waves are counted, which swings faster under load.

    `self_similar`: a spread of a quarter, power as f^{−0.8}. `vibrating_wire`: it goes with 1/√(1 + F/F_0), F_0 of 0.3
    to 0.8 of the greatest force. Stated is the mean over the recording.
    """
    rng, law, motion, duration = build.rng, build.plant.pad.law, build.plant.motion, build.plant.duration_s
    delay, tension = 2e-3 * size * spread(rng, 0.6, 1.6), build.force_N * float(rng.uniform(0.3, 0.8))
    busy = coloured(_child(rng), duration + 10, 0.8)

    def longer(t):
        if shape == "self_similar":
            return 1 + 0.25 * np.clip(busy(t), -2.5, 2.5)
        return 1 / np.sqrt(1 + law.force(motion.position(t)) / tension)

    mean = float(np.mean(longer(np.arange(0.0, duration, 1e-3))))
    build.delays.append(lambda t, _: t - delay * longer(t) / mean)
    return {"delay": delay}


@more_shapes("clock_skew", "leap_smear", "flicker")
def clock_skew(build: Build, shape: str, size: float) -> dict[str, float]:
    """A leap that is smeared over a part of the recording, by a raised cosine; or a rate that flickers, as 1/f.

    `leap_smear`: over 0.4 to 0.7 of it, which begins after 0.1 to 0.25, and right before and behind. `flicker`: by a
    third of the skew, in no column of its own. Stated is the mean over the recording.
    """
    rng, duration = build.rng, build.plant.duration_s
    skew = float(rng.choice([-1.0, 1.0])) * 200e-6 * size * spread(rng, 0.6, 1.6)
    lasts, begins = duration * float(rng.uniform(0.4, 0.7)), duration * float(rng.uniform(0.1, 0.25))
    grid = np.arange(0.0, duration + 10.0, 0.05)
    rates = 1 + coloured(_child(rng), duration + 10, 1.0)(grid) / 3
    along = np.concatenate([[0.0], np.cumsum((rates[1:] + rates[:-1]) / 2 * 0.05)])

    def gained(t):
        if shape == "flicker":
            return skew * np.interp(t, grid, along)
        part = np.clip((t - begins) / lasts, 0.0, 1.0)
        return skew * duration * (part - np.sin(2 * np.pi * part) / (2 * np.pi))

    if shape == "leap_smear":
        build.own_clock = True
        build.stamps.append(lambda t: t + gained(t))
    else:
        build.delays.append(lambda t, _: t - gained(t))
    return {"skew": 1e6 * float(gained(duration)) / duration}


@more_shapes("force_bias", "strained")
def force_bias(build: Build, shape: str, size: float) -> dict[str, float]:
    """A cell that was overloaded: its zero moves by 15 to 25 % of itself as it bears what it has not borne before.

    In proportion to the greatest force so far; stated is the mean over the recording.
    """
    rng, most = build.rng, build.force_N
    bias = float(rng.choice([-1.0, 1.0])) * 0.05 * size * spread(rng, 0.6, 1.6)
    moves, told = float(rng.uniform(0.15, 0.25)), {"bias": bias}

    def stage(t, force):
        zero = bias * (0.9 + moves * np.clip(np.maximum.accumulate(force) / most, 0.0, 1.2))
        told["bias"] = float(np.mean(zero))
        return force + zero

    build.sensor(_LAG + 20, stage)
    return told


@more_shapes("force_drift", "drop_dries", "draughts")
def force_drift(build: Build, shape: str, size: float) -> dict[str, float]:
    """A drop on the probe dries, (2/3) r T (1 − (1 − t/T)^{3/2}), and then it is gone; or a room full of draughts.

    `drop_dries`: T of 0.5 to 1.1 of the recording. `draughts`: the rate itself is 1 + 0.8 times an Ornstein–Uhlenbeck
    process, from 0 on, of 2 to 6 s. r is the initial rate.
    """
    rng, duration = build.rng, build.plant.duration_s
    rate = float(rng.choice([-1.0, 1.0])) * 0.002 * size * spread(rng, 0.6, 1.6)
    dries_s, time_s = duration * float(rng.uniform(0.5, 1.1)), spread(rng, 2.0, 6.0)
    grid = np.arange(0.0, duration + 10.0, 0.01)
    wind = _wandering(_child(rng), duration + 10, time_s)(grid)
    rates = 1 + 0.8 * (wind - wind[0] * np.exp(-grid / time_s))
    along = np.concatenate([[0.0], np.cumsum((rates[1:] + rates[:-1]) / 2 * 0.01)])

    def drift(t):
        if shape == "draughts":
            return rate * np.interp(t, grid, along)
        return rate * dries_s * 2 / 3 * (1 - np.clip(1 - t / dries_s, 0.0, 1.0) ** 1.5)

    _disturb(build, drift)
    return {"rate": rate}


@more_shapes("mains_hum", "arc_furnace")
def mains_hum(build: Build, shape: str, size: float) -> dict[str, float]:
    """An arc furnace next door: the amplitude wanders within 0.05 to 0.2 s, by 0.4 of it; stated is the mean."""
    rng, duration = build.rng, build.plant.duration_s
    amplitude = 0.03 * size * spread(rng, 0.6, 1.6)
    frequency = float(rng.choice([50.0, 60.0]) + rng.uniform(-0.05, 0.05))
    phase, arcs = float(rng.uniform(0, 2 * np.pi)), _wandering(_child(rng), duration + 10, spread(rng, 0.05, 0.2))

    def swells(t):
        return 1 + 0.4 * np.clip(arcs(t), -2.5, 2.5)

    mean = float(np.mean(swells(np.arange(0.0, duration, 1e-3))))
    _disturb(build, lambda t: amplitude * swells(t) / mean * np.sin(2 * np.pi * frequency * t + phase))
    return {"amplitude": amplitude, "frequency": frequency}
