"""The eighth shapes: from the cell to the sample.

Sources: bending beams, whose gauges at the root feel each mode in turn the other way (Timoshenko, Young and Weaver,
Vibration Problems in Engineering), and films squeezed in a gap that the load closes (Blech 1983); air that is trapped
in the oil of a hydraulic cell (Merritt, Hydraulic Control Systems) and indicators whose filter opens where the weight
moves (Piskorowski and Barcinski 2008); backlogs that build up while something else has the processor (Anick, Mitra and
Sondhi 1982) and numbers sent as text, which takes as long as they are (RS-232); loops that lock onto a reference with
an overshoot (Gardner, Phaselock Techniques) and activity dips of crystals (Vig, Quartz Crystal Resonators and
Oscillators); popcorn noise (Horowitz and Hill, The Art of Electronics); gauges and their compensation that do not warm
together (Hoffmann, An Introduction to Stress Analysis using Strain Gauges) and motors that warm by what they hold;
generators whose loads are switched (ISO 8528-5).
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .outside_bench import _child
from .registry import Build, more_shapes, spread
from .sensor import _LAG, _RESONANCE, _disturb, first_order, second_order

_ROOTS = np.array([1.8751040687, 4.6940911330, 7.8547574382])
"""β L of a cantilever: 1 + cos λ cosh λ = 0."""


def beam_modes() -> tuple[np.ndarray, np.ndarray]:
    """(shares of the root's moment for a force at the tip, frequencies) of a cantilever, to the first: 4 (−1)^n/λ²."""
    return 4 * np.array([1.0, -1.0, 1.0]) / _ROOTS**2, (_ROOTS / _ROOTS[0]) ** 2


@njit(cache=True)
def _squeezed(force, h, omega, damping, closes, most):
    """y'' = ω² (F − y) − 2 ζ(y) ω y', ζ with the third power of what is left of a gap, in quarter steps."""
    out, y, v, small = np.zeros(force.shape[0]), force[0], 0.0, h / 4
    out[0] = y
    a = omega * omega
    for k in range(1, force.shape[0]):
        for part in range(4):
            f = force[k - 1] + (force[k] - force[k - 1]) * (part + 0.5) / 4
            left = 1 - closes * min(max(y / most, -0.2), 1.2)
            lost = damping * omega * ((1 - closes / 2) / left) ** 3
            # Midpoint rule, with the gap of the beginning.
            new = v * (1 - lost * small - a * small * small / 4) + a * small * (f - y)
            new /= 1 + lost * small + a * small * small / 4
            y += small * (v + new) / 2
            v = new
        out[k] = y
    return out


@more_shapes("resonance", "bending_beam", "squeeze_film")
def resonance(build: Build, shape: str, size: float) -> dict[str, float]:
    """A beam with gauges at its root: 1.14 of the first mode, −0.18 of one at 6.3 f, 0.06 at 17.5 f; or a damping film.

    `bending_beam`: what the higher modes lack is there at once. `squeeze_film`: the load closes 0.3 to 0.5 of the gap,
    and the damping goes with its −3rd power: a half of the stated one in air, twice to three times under full load;
    stated is that at half load.
    """
    rng, most = build.rng, build.force_N
    frequency = float(np.clip(rng.uniform(40, 80) / np.sqrt(size), 15, 300))
    damping, closes = spread(rng, 0.05, 0.2), float(rng.uniform(0.3, 0.5))
    shares, ratios = beam_modes()

    def stage(t, force):
        if shape == "squeeze_film":
            return _squeezed(force, t[1] - t[0], 2 * np.pi * frequency, damping, closes, most)
        out = (1 - shares.sum()) * force
        for share, ratio in zip(shares, ratios, strict=True):
            out = out + share * second_order(t, force, ratio * frequency, damping)
        return out

    build.sensor(_RESONANCE, stage)
    return {"frequency": frequency, "damping_ratio": damping}


@njit(cache=True)
def _with_air(force, h, tau, air_N, half_N):
    """First order, whose time goes with the compressibility of air: ((1 + F½/a)/(1 + y/a))² τ."""
    out, y = np.zeros(force.shape[0]), force[0]
    out[0] = y
    for k in range(1, force.shape[0]):
        f = 0.5 * (force[k] + force[k - 1])
        slower = ((1 + half_N / air_N) / max(1 + y / air_N, 0.5)) ** 2
        y = f + (y - f) * np.exp(-h / (tau * slower))
        out[k] = y
    return out


@njit(cache=True)
def _opens(force, h, tau, band_N):
    """y' = (F − y)/τ (1 + |F − y|/b): what is left goes as a logistic curve, which each step follows exactly."""
    out, y, keeps = np.zeros(force.shape[0]), force[0], np.exp(-h / tau)
    out[0] = y
    for k in range(1, force.shape[0]):
        f = 0.5 * (force[k] + force[k - 1])
        left = y - f
        y = f + left * keeps / (1 + abs(left) / band_N * (1 - keeps))
        out[k] = y
    return out


@more_shapes("sensor_lag", "trapped_air", "adaptive")
def sensor_lag(build: Build, shape: str, size: float) -> dict[str, float]:
    """Air in a cell of oil, the more compressible the less it bears; or a filter that opens where the force moves.

    `trapped_air`: with a pressure of its own of 0.7 to 1.5 of the greatest load, so that the time in air is 1.8 to 2.9
    times that at half load, which is stated. `adaptive`: twice as quick where 8 to 20 % of the greatest force are
    missing; stated is the time constant of small changes.
    """
    rng, most = build.rng, build.force_N
    tau = 3e-3 * size * spread(rng, 0.7, 1.5)
    air, band = most * spread(rng, 0.7, 1.5), most * spread(rng, 0.08, 0.2)

    def stage(t, force):
        if shape == "trapped_air":
            return _with_air(force, t[1] - t[0], tau, air, most / 2)
        return _opens(force, t[1] - t[0], tau, band)

    build.sensor(_LAG, stage)
    return {"time_constant": tau}


def characters(force_N: np.ndarray) -> np.ndarray:
    """Digits of a whole number of mN without leading zeros."""
    return 1 + np.floor(np.log10(np.maximum(np.floor(1e3 * np.abs(force_N) + 1e-9), 1.0)) + 1e-12)


@more_shapes("force_delay", "backlog", "text_length")
def force_delay(build: Build, shape: str, size: float) -> dict[str, float]:
    """Now and then something else has the processor, and what waits is served late; or longer numbers take longer.

    `backlog`: 0.2 to 0.6 s after the last one, for 20 to 60 ms, the delay grows by once to twice what it is else, and
    falls at half the pace. `text_length`: one to five digits of mN after 3 to 6 other characters. Stated is the mean of
    the recording.
    """
    rng, law, motion = build.rng, build.plant.pad.law, build.plant.motion
    delay, others = 2e-3 * size * spread(rng, 0.6, 1.6), int(rng.integers(3, 7))
    every_s, child, duration = spread(rng, 0.2, 0.6), _child(rng), build.plant.duration_s
    count = int((duration + 10) / every_s)
    lasts, grows = child.uniform(0.02, 0.06, count), child.uniform(1.0, 2.0, count)
    begins = np.cumsum(child.exponential(every_s, count)) + 3 * np.concatenate([[0.0], np.cumsum(lasts)[:-1]])
    knots = np.stack([begins, begins + lasts, begins + 3 * lasts], axis=1).ravel()
    waits = np.stack([np.ones(count), 1 + grows, np.ones(count)], axis=1).ravel()

    def longer(t):
        if shape == "text_length":
            return others + characters(law.force(motion.position(t)))
        return np.interp(t, knots, waits)

    mean = float(np.mean(longer(np.arange(0.0, duration, 1e-3))))
    build.delays.append(lambda t, _: t - delay * longer(t) / mean)
    return {"delay": delay}


def locked(t: np.ndarray, omega: float, damping: float) -> np.ndarray:
    """Phase gained as a loop of second order takes up a rate of 1, from rest: its answer to a ramp."""
    swings = omega * np.sqrt(1 - damping**2)
    rest = np.exp(-damping * omega * t) * np.sin(swings * t + 2 * np.arccos(damping)) / swings
    return t - 2 * damping / omega + rest


@more_shapes("clock_skew", "locks_in", "activity_dip")
def clock_skew(build: Build, shape: str, size: float) -> dict[str, float]:
    """A loop takes up the wrong rate of its reference, and overshoots; or a crystal that slows at some temperature.

    `locks_in`: by 20 to 50 %, with a period of 0.15 to 0.35 of the recording. `activity_dip`: a Lorentzian, once to
    twice the skew deep and 8 to 16 % of the recording wide at half of that, in no column of its own. Stated is the mean
    over the recording.
    """
    rng, duration = build.rng, build.plant.duration_s
    skew = float(rng.choice([-1.0, 1.0])) * 200e-6 * size * spread(rng, 0.6, 1.6)
    damping, period = float(rng.uniform(0.21, 0.45)), duration * float(rng.uniform(0.15, 0.35))
    deep, wide = float(rng.uniform(1.0, 2.0)), duration * float(rng.uniform(0.04, 0.08))
    at, omega = duration * float(rng.uniform(0.3, 0.7)), 2 * np.pi / period / np.sqrt(1 - damping**2)

    def gained(t):
        if shape == "locks_in":
            return skew * locked(t, omega, damping)
        return skew * t - abs(skew) * deep * wide * (np.arctan((t - at) / wide) + np.arctan(at / wide))

    if shape == "locks_in":
        build.own_clock = True
        build.stamps.append(lambda t: t + gained(t))
    else:
        build.delays.append(lambda t, _: t - gained(t))
    return {"skew": 1e6 * float(gained(duration)) / duration}


@more_shapes("force_bias", "popcorn")
def force_bias(build: Build, shape: str, size: float) -> dict[str, float]:
    """The amplifier's zero jumps between two levels, 10 to 20 % apart, at random every 0.5 to 3 s; stated: the mean."""
    rng, duration = build.rng, build.plant.duration_s
    bias = float(rng.choice([-1.0, 1.0])) * 0.05 * size * spread(rng, 0.6, 1.6)
    apart, dwell_s, child = float(rng.uniform(0.1, 0.2)), spread(rng, 0.5, 3.0), _child(rng)
    jumps = np.cumsum(child.exponential(dwell_s, int(4 * (duration + 10) / dwell_s) + 20))

    def upper(t):
        return np.searchsorted(jumps, t) % 2

    share = float(np.mean(upper(np.arange(0.0, duration, 1e-3))))
    _disturb(build, lambda t: bias * (1 + apart * (upper(t) - share)))
    return {"bias": bias}


@more_shapes("force_drift", "gradient", "motor_heat")
def force_drift(build: Build, shape: str, size: float) -> dict[str, float]:
    """Gauges warm before what compensates them: r t e^{−t/τ}, out and back; or a motor warms the cell by what it holds.

    `gradient`: back from 0.3 to 0.6 of the recording on, at a rate twice that of the other shapes. `motor_heat`: its
    loss goes with the square of the force, at the greatest load 1 to 2 times more than in air; the cell takes it up as
    a body of first order within 0.6 to 1.5 of the recording. r is the initial rate, in air.
    """
    rng, duration, most = build.rng, build.plant.duration_s, build.force_N
    rate = float(rng.choice([-1.0, 1.0])) * 0.002 * size * spread(rng, 0.6, 1.6)
    back, tau = duration * float(rng.uniform(0.3, 0.6)), duration * float(rng.uniform(0.6, 1.5))
    more, grid = float(rng.uniform(1.0, 2.0)), np.arange(0.0, duration + 10.0, 2e-3)
    rate *= 2.0 if shape == "gradient" else 1.0
    load = build.plant.pad.law.force(build.plant.motion.position(grid)) / most
    # The body is cold at first, whatever flows into it by then.
    flows = 1 + more * load**2
    warm = tau * (first_order(grid, flows, tau) - flows[0] * np.exp(-grid / tau))

    def drift(t):
        return rate * (t * np.exp(-t / back) if shape == "gradient" else np.interp(t, grid, warm))

    _disturb(build, drift)
    return {"rate": rate}


def governed(t: np.ndarray, switched_s: np.ndarray, off_Hz: float, back_s: float) -> np.ndarray:
    """Turns gained as the frequency goes off by Δf e^{−s/τ}: down where a load goes on, up where it goes off, …"""
    turns = np.zeros_like(t)
    for k, at in enumerate(switched_s[switched_s < t[-1]]):
        turns += (-1) ** k * off_Hz * back_s * np.expm1(-np.maximum(t - at, 0.0) / back_s)
    return turns


@more_shapes("mains_hum", "generator")
def mains_hum(build: Build, shape: str, size: float) -> dict[str, float]:
    """A generator of its own: a load goes on or off every 2 to 8 s, and the speed falls or rises, and comes back.

    By 0.1 to 0.2 Hz, within 0.5 to 1.5 s. Stated is the frequency that its governor brings it back to.
    """
    rng = build.rng
    amplitude = 0.03 * size * spread(rng, 0.6, 1.6)
    frequency = float(rng.choice([50.0, 60.0]) + rng.uniform(-0.05, 0.05))
    phase, every_s = float(rng.uniform(0, 2 * np.pi)), spread(rng, 2.0, 8.0)
    off_Hz, back_s, child = float(rng.uniform(0.1, 0.2)), float(rng.uniform(0.5, 1.5)), _child(rng)
    switched = np.cumsum(child.exponential(every_s, int(4 * (build.plant.duration_s + 10) / every_s) + 20))

    def hum(t):
        turns = frequency * t + governed(t, switched, off_Hz, back_s)
        return amplitude * np.sin(2 * np.pi * turns + phase)

    _disturb(build, hum)
    return {"amplitude": amplitude, "frequency": frequency}
