"""The judge's half of the force path: how it swings, how late it is, by which clock, and what is added to it.

Sources: Den Hartog (1956), Mechanical Vibrations, ch. 2, force through a damped mount; Meirovitch (2001), Fundamentals
of Vibrations, ch. 8, the cantilever under a force at its tip; polled converters and zero-order hold, Franklin, Powell
and Workman (1998), ch. 5; shifted gamma latencies of packets, Mukherjee (1994); clocks by their random walk of
frequency, Allan (1987), IEEE Std 1139; two-pole Bessel filters, Thomson (1949); cascaded averages in delta-sigma
converters, Candy (1986), Hogenauer (1981); 1/f noise as a sum of Lorentzians, van der Ziel (1950), Keshner (1982);
temperature effect on zero and warm-up of strain gauge cells, OIML R 60 and Hoffmann (1989); ripple of rectified
supplies, Horowitz and Hill (2015), ch. 1 and 9; line currents of rectifiers with a capacitor, Mohan et al. (2003),
ch. 5.
Units: mm, N, s.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.signal import lfilter

from .registry import DISTURBANCE, Build, Samples, judge_shapes, spread
from .sensor import ramp_filter, second_order

_RESONANCE, _LAG = 10, 20

#: Roots of cos b cosh b = −1, and the share of each mode in the moment at the root of a cantilever, ± 4/b².
_BEAM = np.array([1.8751040687, 4.6940911330])
_BEAM_SHARES = np.array([4.0, -4.0]) / _BEAM**2

Of = Callable[[np.ndarray], np.ndarray]


def _either(rng: np.random.Generator) -> float:
    return float(rng.choice([-1.0, 1.0]))


def _add(build: Build, added: Of) -> None:
    """Put a function of time on the force channel."""

    def stage(samples: Samples, _: np.random.Generator) -> None:
        extra = added(samples.time_s)
        samples.force_N, samples.clean_N = samples.force_N + extra, samples.clean_N + extra

    build.samples.append((DISTURBANCE, stage))


def _forgetful(rng: np.random.Generator, n: int, step_s: float, time_s: float) -> np.ndarray:
    """Gauss–Markov values of variance 1 and correlation e^{−|s|/time} on an even grid."""
    kept = np.exp(-step_s / time_s)
    fresh = rng.standard_normal(n)
    fresh[1:] *= np.sqrt(1 - kept**2)
    return lfilter([1.0], [1.0, -kept], fresh)


@judge_shapes("resonance", "mount_transmissibility", "bending_cantilever")
def resonance(build: Build, shape: str, size: float) -> dict[str, float]:
    """The force path swings. Frequency 40–80 Hz over √size, damping ratio 0.05–0.2.

    `mount_transmissibility`: spring and dashpot of the mount both pass the force on, (2 ζ ω s + ω²) / (s² + 2 ζ ω s +
    ω²). `bending_cantilever`: a cantilever of even mass with the force at its tip and the gauges at its root,

        Σ a_n ω_n² / (s² + 2 ζ ω_n s + ω_n²),   a_n = ± 4/b_n²,   ω_n ~ b_n²:   1.138 at f, −0.182 at 6.27 f,

    and what is left of the sum, 0.044, at once. Stated: ω/2π and ζ; of the beam those of its first mode.
    """
    rng = build.rng
    frequency = float(np.clip(rng.uniform(40, 80) / np.sqrt(size), 15, 300))
    damping = spread(rng, 0.05, 0.2)
    omega = 2 * np.pi * frequency

    def mount(t, force):
        passed = [2 * damping * omega, omega**2]
        return ramp_filter(t, force, passed, [1.0, *passed])

    def beam(t, force):
        felt = (1 - float(_BEAM_SHARES.sum())) * force
        for share, b in zip(_BEAM_SHARES.tolist(), _BEAM.tolist(), strict=True):
            felt = felt + share * second_order(t, force, frequency * (b / _BEAM[0]) ** 2, damping)
        return felt

    build.sensor(_RESONANCE, mount if shape == "mount_transmissibility" else beam)
    return {"frequency": frequency, "damping_ratio": damping}


def averaged(time_s: np.ndarray, values: np.ndarray, width_s: float) -> np.ndarray:
    """Mean over the last `width_s` of values on an even grid, linear between its points; at rest before."""
    step, last = float(time_s[1] - time_s[0]), len(values) - 2
    from_first = values - values[0]
    whole = np.concatenate([[0.0], np.cumsum((from_first[1:] + from_first[:-1]) / 2 * step)])
    at = np.maximum(np.arange(len(values)) - width_s / step, 0.0)
    k = np.minimum(at.astype(int), last)
    u = at - k
    before = whole[k] + step * u * (from_first[k] + u / 2 * (from_first[k + 1] - from_first[k]))
    return values[0] + (whole - before) / width_s


@judge_shapes("sensor_lag", "bessel_two_pole", "sinc3_converter")
def sensor_lag(build: Build, shape: str, size: float) -> dict[str, float]:
    """A low-pass whose mean delay, the first moment of its impulse response, is the τ stated: 2.1–4.5 ms.

    `bessel_two_pole`: 3 / (τ² s² + 3 τ s + 3), as in amplifiers of bridges. `sinc3_converter`: three means over 2 τ/3,
    one after the other, as a delta-sigma converter decimates.
    """
    tau = 3e-3 * size * spread(build.rng, 0.7, 1.5)

    def stage(t, force):
        if shape == "bessel_two_pole":
            return ramp_filter(t, force, [3.0], [tau**2, 3 * tau, 3.0])
        for _ in range(3):
            force = averaged(t, force, 2 * tau / 3)
        return force

    build.sensor(_LAG, stage)
    return {"time_constant": tau}


@judge_shapes("force_delay", "sample_and_hold", "queued_link")
def force_delay(build: Build, shape: str, size: float) -> dict[str, float]:
    """What is reported as of t was measured earlier; stated is the mean age, 1.2–3.2 ms.

    `sample_and_hold`: the amplifier converts each T, by its own beat, and tells the last value it has, which took L to
    get there: the age runs from L to L + T, delay = L + T/2; T is 0.6 to 1.2 delays. `queued_link`: a fixed time and
    the wait in a queue, a shifted gamma distribution of shape 2, which lasts for 50 to 200 ms; delay = the fixed time
    and the mean wait, which is a quarter to a half of it.
    """
    rng = build.rng
    delay = 2e-3 * size * spread(rng, 0.6, 1.6)
    if shape == "sample_and_hold":
        period, phase = delay * float(rng.uniform(0.6, 1.2)), float(rng.uniform(0, 1))
        latency = delay - period / 2
        build.delays.append(lambda t, _: (np.floor((t - latency) / period - phase) + phase) * period)
        return {"delay": delay}
    wait, lasts_s = delay * float(rng.uniform(0.25, 0.5)), spread(rng, 0.05, 0.2)
    grid = np.arange(0.0, build.plant.duration_s + 1.0, 1e-3)
    # The mean of four squares is of gamma distribution, shape 2 and mean 1; squares forget twice as fast.
    queue = np.mean([_forgetful(rng, len(grid), 1e-3, 2 * lasts_s) ** 2 for _ in range(4)], axis=0)
    build.delays.append(lambda t, _: t - (delay - wait) - wait * np.interp(t, grid, queue))
    return {"delay": delay}


@judge_shapes("clock_skew", "lost_samples", "aligned_midway", "random_walk_fm")
def clock_skew(build: Build, shape: str, size: float) -> dict[str, float]:
    """The clock of the force goes 120–320 ppm fast or slow; stated is its mean rate, less 1.

    `lost_samples`: time is told by counting samples, of which one is lost each P or so (in the middle 60 % of each P):
    what counts as t is of t + g n(t), g the period of the converter, about 1 ms times size. Skew = 1/(1 + g/P) − 1 < 0.
    `aligned_midway`: the lab made both clocks agree at some time in the middle and took the stamps for the
    position's: of t₀ + (t − t₀)/(1 + skew). `random_walk_fm`: stamps t + ∫ y dt in a column of their own, y a
    random walk about the skew, which is its mean over the recording; it goes a quarter of the skew in a minute.
    """
    rng, duration = build.rng, build.plant.duration_s
    skew = _either(rng) * 200e-6 * size * spread(rng, 0.6, 1.6)
    if shape == "lost_samples":
        skew = -abs(skew)
        gap = 1e-3 * size * spread(rng, 0.6, 1.6)
        every = gap * (1 + skew) / -skew
        n = int(duration / every) + 2
        lost = (np.arange(n) + rng.uniform(0.2, 0.8, n)) * every
        build.delays.append(lambda t, _: t + gap * np.searchsorted(lost, t, side="right"))
    elif shape == "aligned_midway":
        agree = duration * float(rng.uniform(0.35, 0.65))
        build.delays.append(lambda t, _: agree + (t - agree) / (1 + skew))
    else:
        grid = np.linspace(0.0, duration, 1001)
        step = float(grid[1])
        walk = np.concatenate([[0.0], np.cumsum(rng.standard_normal(1000))]) * 0.25 * np.sqrt(step / 60)
        error = np.concatenate([[0.0], np.cumsum((walk[1:] + walk[:-1]) / 2 * step)])
        error = skew * (grid + error - error[-1] * grid / duration)
        build.own_clock = True
        build.stamps.append(lambda t: t + np.interp(t, grid, error))
    return {"skew": 1e6 * skew}


@judge_shapes("force_bias", "flicker_zero", "breathing_zero")
def force_bias(build: Build, shape: str, size: float) -> dict[str, float]:
    """A wrong zero of 0.03–0.08 N, as constant as zeros are; stated is its mean.

    `flicker_zero`: with 1/f noise of an amplifier, a twentieth of it as root mean square, from five Lorentzians of
    0.1 to 26 s; its mean over the recording is taken off. `breathing_zero`: the temperature effect on zero in a room
    whose climate control cycles within 20 to 50 s, b (1 + 0.08 sin(2πt/P + φ)).
    """
    rng = build.rng
    bias = _either(rng) * 0.05 * size * spread(rng, 0.6, 1.6)
    if shape == "breathing_zero":
        period, phase = spread(rng, 20.0, 50.0), float(rng.uniform(0, 2 * np.pi))
        _add(build, lambda t: bias * (1 + 0.08 * np.sin(2 * np.pi * t / period + phase)))
        return {"bias": bias}
    grid = np.arange(0.0, build.plant.duration_s + 0.02, 0.02)
    flicker = np.sum([_forgetful(rng, len(grid), 0.02, tau) for tau in np.geomspace(0.1, 25.6, 5)], axis=0) / 5**0.5
    wander = 0.05 * bias * (flicker - flicker.mean())
    _add(build, lambda t: bias + np.interp(t, grid, wander))
    return {"bias": bias}


@judge_shapes("force_drift", "two_stage_warmup", "room_swing")
def force_drift(build: Build, shape: str, size: float) -> dict[str, float]:
    """The zero goes with a temperature; stated is its rate r at the start, 1.2–3.2 mN/s.

    `two_stage_warmup`: first the gauges, then the body of the cell, r [a τ₁ (1 − e^{−t/τ₁}) + (1 − a) τ₂ (1 −
    e^{−t/τ₂})], a 0.25–0.45, τ₁ 3–10 s, τ₂ 60–200 s. `room_swing`: a room whose temperature swings,
    r P/2π [sin(2πt/P + φ) − sin φ]/cos φ, P 150–400 s, φ within 30°.
    """
    rng = build.rng
    rate = _either(rng) * 0.002 * size * spread(rng, 0.6, 1.6)
    if shape == "two_stage_warmup":
        share, quick, slow = float(rng.uniform(0.25, 0.45)), spread(rng, 3.0, 10.0), spread(rng, 60.0, 200.0)
        early, late = share * quick, (1 - share) * slow
        _add(build, lambda t: -rate * (early * np.expm1(-t / quick) + late * np.expm1(-t / slow)))
    else:
        omega, phase = 2 * np.pi / spread(rng, 150.0, 400.0), float(rng.uniform(-np.pi / 6, np.pi / 6))
        scale = rate / (omega * np.cos(phase))
        _add(build, lambda t: scale * (np.sin(omega * t + phase) - np.sin(phase)))
    return {"rate": rate}


@judge_shapes("mains_hum", "supply_ripple", "rectifier_pulses")
def mains_hum(build: Build, shape: str, size: float) -> dict[str, float]:
    """Pick-up of a mains of 50 or 60 Hz ± 0.05 Hz; stated are amplitude (18–48 mN) and frequency of the first line.

    `supply_ripple`: the saw-tooth on a supply that is rectified both ways, Σ sin(n θ)/n up to n = 4, the first line at
    twice the mains: 100 or 120 Hz. `rectifier_pulses`: the stray field of a transformer that feeds a rectifier, whose
    current are half-waves of a cosine about the crests, ± β wide (30–45°), alternately up and down; the first line is
    at the mains, a_1 = (2/β) cos β / ((π/2β)² − 1) of the pulse.
    """
    rng = build.rng
    amplitude = 0.03 * size * spread(rng, 0.6, 1.6)
    mains = float(rng.choice([50.0, 60.0]) + rng.uniform(-0.05, 0.05))
    phase, half = float(rng.uniform(0, 2 * np.pi)), float(np.radians(rng.uniform(30, 45)))

    def ripple(t):
        angle = 4 * np.pi * mains * t + phase
        return amplitude * sum(np.sin(n * angle) / n for n in range(1, 5))

    def pulses(t):
        angle = 2 * np.pi * mains * t + phase
        side = np.cos(angle)
        off_crest = np.arcsin(np.clip(np.sin(angle), -1, 1))  # 0 at both crests of the cosine
        pulse = np.where(np.abs(off_crest) < half, np.cos(np.pi / (2 * half) * off_crest), 0.0)
        first = (2 / half) * np.cos(half) / ((np.pi / (2 * half)) ** 2 - 1)
        return amplitude / first * np.sign(side) * pulse

    _add(build, ripple if shape == "supply_ripple" else pulses)
    return {"amplitude": amplitude, "frequency": 2 * mains if shape == "supply_ripple" else mains}
