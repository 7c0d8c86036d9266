"""Mains hum, found in the holds, where nothing else swings: a line in the spectrum of what smooth curves leave.

It is taken out of the force before the search, which works on averages over blocks that hide it, and given back at the
end: as a cause where it can come from the mains, else as something that nothing explains.

A line beyond half the rate of sampling is seen folded. Of the frequencies that would look alike the one is taken that
the stamps tell, as they are never quite even, or else the one that is nearest to what grids have.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize, minimize_scalar

from sim.effects.mains_hum import first_of_dimmed, let_through

from .noise import Part

Array = NDArray[np.float64]

LOWEST_HZ = 8.0
GRIDS_HZ, MULTIPLES = (50.0, 60.0), (1, 2, 3)
OFF, STEADY = 0.05, 0.003  # of its frequency, by which a grid may be off, and by which a large one is
RARER = 1e-3  # of a grid's frequency, by which it must be nearer for each multiple: twice what a grid is off by, mostly
NEAR_HALF = 0.02  # of half the samples' rate
AT_HALF_THE_RATE = (
    "it swings at about half the rate of the samples, as hum of the mains does where they are taken {:.4g} times a "
    "second: sample at another rate, and it can be told and taken out"
)
LEVEL = 1e-5  # of a line by chance, over all frequencies
LEAST_SHARE = 0.002  # of the noise power
TOLD = 15.0  # times the noise power per sample: what a further number of the line must take
HARMONICS = tuple(range(2, 8))
FIRES = tuple(np.deg2rad(np.arange(10.0, 160.0, 5.0)).tolist())  # angles of a dimmer
WINDOW_S, FEWEST = 1.0, 20  # in which a line stands still while it swings slowly, and samples that tell of it there
MOST_WAVES, LEAST_FED = 160, 0.1  # of a burst's period; of the samples, that it is fed in
MOST_GROWTH = 2.0  # of the amplitude, from the least load of the holds to the greatest


@dataclass(frozen=True)
class Line:
    """Σ over harmonics of the sines found; `frequency_Hz`, `amplitude_N` and `phase_rad` of the first at t = 0,
    `ratio` and `third_phase_rad` of the third (0 where there is none). All grows by `growth_1_N`, of itself, with each
    newton that the cell bears beyond `at_N`, where the amplitude is as stated. `higher`: (order, ratio, phase) of
    further harmonics. `swing`: (period in s, swell, its phase, wander in rad, its phase), as in the effect's form.
    `fires_rad`: the angle from which on half waves are let through, where they are; the phase is the mains' then."""

    frequency_Hz: float
    amplitude_N: float
    phase_rad: float
    ratio: float
    third_phase_rad: float
    sample_s: float = 1e-3
    growth_1_N: float = 0.0
    at_N: float = 0.0
    higher: tuple[tuple[int, float, float], ...] = ()
    swing: tuple[float, ...] = ()
    fires_rad: float = 0.0
    bursts: tuple[int, ...] = ()
    """(waves, how many of them are fed, number of the first), where it comes in bursts of whole waves; the amplitude is
    the mean over time."""

    @property
    def of_the_mains(self) -> bool:
        """Whether a grid's frequency, or a low multiple of it, looks like this at this rate of sampling."""
        rate = 1.0 / self.sample_s
        return bool(_of_grids(float(_folded(self.frequency_Hz, rate)), rate))

    def angle(self, time_s: Array) -> Array:
        """Of the first harmonic at times (n,) since its start, from 0 where it does not wander, rad."""
        steady = 2.0 * np.pi * self.frequency_Hz * time_s
        if not self.swing:
            return np.asarray(steady)
        period, _, _, wander, wander_phase = self.swing
        return np.asarray(steady + wander * np.sin(2.0 * np.pi * time_s / period + wander_phase))

    def force_N(self, time_s: Array, load_N: Array) -> Array:
        """The line at times (n,) since its start, under loads (n,)."""
        angle = self.angle(time_s)
        swells = self.amplitude_N * (1.0 + self.growth_1_N * (load_N - self.at_N))
        first = angle + self.phase_rad
        if self.fires_rad:
            whole = swells / np.hypot(*first_of_dimmed(self.fires_rad))
            return np.asarray(whole * np.sin(first) * let_through(first, self.fires_rad))
        if self.bursts:
            waves, fed, begins = self.bursts
            on = (np.floor(first / (2.0 * np.pi)) - begins) % waves < fed
            return np.asarray(swells * (waves / fed) * on * np.sin(first))
        if self.swing:
            period, swell, swell_phase, _, _ = self.swing
            swells = swells * (1.0 + swell * np.sin(2.0 * np.pi * time_s / period + swell_phase))
        others = [(3, self.ratio, self.third_phase_rad), *self.higher]
        wave = np.sin(first) + sum(ratio * np.sin(order * angle + phase) for order, ratio, phase in others if ratio)
        return np.asarray(swells * wave)


def _folded(frequency_Hz: Array | float, rate_Hz: float) -> Array:
    """How frequencies look when they are sampled."""
    frequency = np.asarray(frequency_Hz, dtype=np.float64)
    return np.asarray(np.abs(frequency - rate_Hz * np.rint(frequency / rate_Hz)))


def find(start_s: float, parts: list[Part], stamp_s: Array, force_N: Array) -> Line | None:
    """The strongest line in the holds, where it is beyond chance; phases count from `start_s`.

    `stamp_s`, `force_N`: all force samples (m,).
    """
    if sum(len(e) for _, e, _ in parts) < 200:
        return None
    stamps = np.concatenate([t for t, _, _ in parts])
    t, e = stamps - start_s, np.concatenate([e for _, e, _ in parts])
    step = _step(stamp_s)
    power, frequency = _spectrum(t, e, step)
    # nearer to half the rate a sine and a cosine are one within a hold
    highest = 0.5 / step - 1.0 / max(float(t[-1] - t[0]) for t, _, _ in parts)
    usable = (frequency > LOWEST_HZ) & (frequency < highest)
    if not usable.any():
        return None
    # against the noise around it, whatever its colour
    width = max(len(power) // 60, 25)
    around = _running_median(power, width) / np.log(2.0)
    excess = np.where(usable, power / np.maximum(around, 1e-300), 0.0)
    lines = excess > np.log(usable.sum() / LEVEL)
    if not lines.any():
        return None
    k = int(np.argmax(np.where(lines, power - around, -np.inf)))  # the strongest: a harmonic may stand out more
    spacing = float(frequency[1] - frequency[0])
    least = TOLD * float(e @ e) / len(e)
    f = _told(t, e, _unfolded(float(frequency[k]), 1.0 / step), spacing, least)
    taken, sine, cosine = _taken(t, e, f)
    if taken < LEAST_SHARE * float(e @ e):
        return None
    amplitude, phase = float(np.hypot(sine, cosine)), float(np.arctan2(cosine, sine))
    load = force_N[np.searchsorted(stamp_s, stamps)] - e
    line = Line(f, amplitude, phase, 0.0, 0.0, step)
    shapes = [_with_harmonics(line, t, e, least, highest, spacing)]
    growth = _growth(t, e, f, load, least)
    if growth:
        at = float(np.mean(force_N))  # what is stated is the mean over the run
        there = 1.0 + growth * (at - float(np.mean(load)))
        shapes.append(replace(shapes[0], amplitude_N=amplitude * there, growth_1_N=growth / there, at_N=at, higher=()))
    swings, bursts = _swinging(line, parts, start_s), _bursting(line, t, e)
    shapes += [] if swings is None else [_with_harmonics(swings, t, e, least, highest, spacing)]
    shapes += [] if bursts is None else [bursts]
    shapes += [_dimmed(line, t, e)] if shapes[0].ratio or shapes[0].higher else []
    # the plainest, unless another one takes more than its numbers do by chance
    return min(shapes, key=lambda one: float(np.sum((e - one.force_N(t, load)) ** 2)) + least * _numbers(one))


def _numbers(line: Line) -> int:
    own = (line.growth_1_N != 0.0) + (line.fires_rad > 0.0) + len(line.swing) + len(line.bursts)
    return 2 * (line.ratio > 0.0) + 2 * len(line.higher) + own


def _dimmed(line: Line, t: Array, e: Array) -> Line:
    """The line as a dimmer makes it, which lets each half wave through from an angle on: the one that leaves least."""

    def one(fires: float, more: float = 1.0, later: float = 0.0) -> Line:
        fires = float(np.clip(fires, FIRES[0], FIRES[-1]))
        sine, cosine = first_of_dimmed(fires)
        phase = line.phase_rad - float(np.arctan2(cosine, sine)) + later
        return replace(line, amplitude_N=line.amplitude_N * more, phase_rad=phase, fires_rad=fires)

    def left(x: Array) -> float:
        return float(np.sum((e - one(*x.tolist()).force_N(t, t)) ** 2))

    # what is folded onto the first harmonic has its share in amplitude and phase
    start = min((np.array([fires, 1.0, 0.0]) for fires in FIRES), key=left)
    simplex = start + np.vstack([np.zeros(3), np.diag([0.05, 0.1, 0.1])])
    best = minimize(left, start, method="Nelder-Mead", options={"initial_simplex": simplex, "maxfev": 200}).x
    return one(*best.tolist())


def _bursting(line: Line, t: Array, e: Array) -> Line | None:
    """The line in bursts of whole waves: the period, the first wave and their count that take the most."""
    turns = line.frequency_Hz * t + line.phase_rad / (2.0 * np.pi)
    wave, in_phase = np.floor(turns).astype(np.intp), e * np.sin(2.0 * np.pi * turns)
    best, found = 0.0, None
    for waves in range(4, min(MOST_WAVES, int(np.ptp(wave)) // 4)):
        slot = (wave - wave.min()) % waves
        of_slot, count = np.bincount(slot, in_phase, waves), np.bincount(slot, minlength=waves)
        # sums over all runs of slots: as many rows as first slots, as many columns as lengths
        at = np.arange(waves)[:, None] + np.arange(1, waves)
        runs, counts = (np.concatenate([[0.0], np.cumsum(np.tile(a, 2))]) for a in (of_slot, count))
        taken, there = runs[at] - runs[:waves, None], counts[at] - counts[:waves, None]
        power = np.where(there > LEAST_FED * len(e), taken * np.abs(taken) / np.maximum(there, 1.0), 0.0)
        first, length = np.unravel_index(int(np.argmax(power)), power.shape)
        if power[first, length] > best:
            fed = int(length) + 1
            level = 2.0 * float(taken[first, length] / there[first, length]) * fed / waves
            best = float(power[first, length])
            begins = int((first + wave.min()) % waves)
            found = replace(line, amplitude_N=level, bursts=(waves, fed, begins))
    return found


def _with_harmonics(line: Line, t: Array, e: Array, least: float, highest: float, spacing: float) -> Line:
    """The line with those of its harmonics that are more than chance, and do not look like each other."""
    f, rate = line.frequency_Hz, 1.0 / line.sample_s
    seen, found = [float(_folded(f, rate))], []
    left = e - line.force_N(t, t)  # between holds nothing is seen: a line leaks far, into what is folded beside it
    even = line.angle(t) / (2.0 * np.pi * f)  # times at which a line that wanders would be steady
    for order in HARMONICS:
        here = float(_folded(order * f, rate))
        if LOWEST_HZ < here < highest and min(abs(here - other) for other in seen) > 16.0 * spacing:
            more, sine, cosine = _taken(even, left, order * f)
            if more > least:
                seen.append(here)
                angle = 2.0 * np.pi * order * f * even
                left = left - sine * np.sin(angle) - cosine * np.cos(angle)
                found.append((order, float(np.hypot(sine, cosine)) / line.amplitude_N, float(np.arctan2(cosine, sine))))
    third = next(((ratio, phase) for order, ratio, phase in found if order == 3), (0.0, 0.0))
    return replace(line, ratio=third[0], third_phase_rad=third[1], higher=tuple(one for one in found if one[0] != 3))


def _swinging(line: Line, parts: list[Part], start_s: float) -> Line | None:
    """The line with amplitude and phase that swing slowly, as windows of the holds have them; None: too few windows."""
    at, z = [], []
    for stamps, e, _ in parts:
        count = max(int((stamps[-1] - stamps[0]) / WINDOW_S), 1)
        for own in np.array_split(np.arange(len(stamps)), count):
            if len(own) >= FEWEST:
                t = stamps[own] - start_s
                _, sine, cosine = _taken(t, e[own], line.frequency_Hz)
                at.append(float(t.mean()))
                z.append(complex(sine, cosine))
    if len(z) < 12:
        return None
    when, way = np.array(at), np.array(z)
    angle, size = np.unwrap(np.angle(way)), np.abs(way)
    span, best = float(when[-1] - when[0]), (np.inf, 0.0, np.zeros(7))
    for cycles in np.arange(0.5, min(span / (4.0 * WINDOW_S), 40.0), 0.25):
        slow = 2.0 * np.pi * cycles / span * when
        A = np.stack([np.ones(len(when)), np.sin(slow), np.cos(slow), when / span], axis=1)
        of_angle, of_size = (np.linalg.lstsq(B, y, rcond=None)[0] for B, y in ((A, angle), (A[:, :3], size)))
        left = np.sum((size - A[:, :3] @ of_size) ** 2) + np.sum((size.mean() * (angle - A @ of_angle)) ** 2)
        if left < best[0]:
            best = (float(left), float(span / cycles), np.concatenate([of_angle, of_size]))
    _, period, x = best
    if not x[4] > 0.0:
        return None
    swell, wander = float(np.hypot(x[5], x[6])) / float(x[4]), float(np.hypot(x[1], x[2]))
    return replace(
        line,
        frequency_Hz=line.frequency_Hz + float(x[3]) / span / (2.0 * np.pi),
        amplitude_N=float(x[4]),
        phase_rad=float(np.angle(np.exp(1j * x[0]))),
        swing=(period, min(swell, 1.0), float(np.arctan2(x[6], x[5])), wander, float(np.arctan2(x[2], x[1]))),
    )


def _spectrum(t: Array, e: Array, step: float) -> tuple[Array, Array]:
    """Power on a grid of frequencies four times finer than the span resolves."""
    slot = np.rint((t - t[0]) / step).astype(np.intp)
    size = 1 << int(np.ceil(np.log2(4 * (slot[-1] + 1))))
    grid = np.zeros(size)
    np.add.at(grid, slot, e)
    spectrum = np.fft.rfft(grid)
    return np.asarray(np.abs(spectrum) ** 2, dtype=np.float64), np.asarray(np.fft.rfftfreq(size, step))


def _running_median(power: Array, width: int) -> Array:
    """Medians over blocks, interpolated."""
    blocks = max(len(power) // width, 1)
    cut = power[: blocks * width].reshape(blocks, width)
    centres = (np.arange(blocks) + 0.5) * width
    return np.asarray(np.interp(np.arange(len(power)), centres, np.median(cut, axis=1)))


def _taken(t: Array, e: Array, f: float) -> tuple[float, float, float]:
    """(power that a sine takes, sine and cosine amplitudes)."""
    angle = 2.0 * np.pi * f * t
    A = np.stack([np.sin(angle), np.cos(angle)], axis=1)
    solution = np.linalg.lstsq(A, e, rcond=None)[0]
    return float(np.sum((A @ solution) ** 2)), float(solution[0]), float(solution[1])


def _step(stamp_s: Array) -> float:
    """Mean time between samples that follow each other; the median is off by a part of what stamps scatter."""
    steps = np.diff(stamp_s)
    return float(np.mean(steps[steps < 1.5 * np.median(steps)]))


def _of_grids(seen_Hz: float, rate_Hz: float) -> list[float]:
    """Frequencies of the mains that look like this one. Folded, any frequency is near one that a grid might have: there
    it must be one that a large grid has."""
    count = int(MULTIPLES[-1] * max(GRIDS_HZ) / rate_Hz) + 2
    every = [abs(k * rate_Hz + sign * seen_Hz) for k in range(count) for sign in (1.0, -1.0)]
    far = {f: min(abs(f / (n * grid) - 1.0) for n in MULTIPLES for grid in GRIDS_HZ) for f in every}
    return [f for f, off in far.items() if off <= (OFF if f <= 0.5 * rate_Hz else STEADY)]


def hidden(swing_Hz: float, sample_s: float) -> list[str]:
    """What to say of a swing at half the samples' rate, where that is the frequency of the mains or its second."""
    half_Hz = 0.5 / sample_s
    mains = any(abs(half_Hz / (n * grid) - 1.0) < NEAR_HALF for n in (1, 2) for grid in GRIDS_HZ)
    if not mains or abs(swing_Hz / half_Hz - 1.0) > NEAR_HALF:
        return []
    return [AT_HALF_THE_RATE.format(1.0 / sample_s)]


def _unfolded(seen_Hz: float, rate_Hz: float) -> list[float]:
    """Frequencies of the mains that look like this one, nearest to a grid's first, where as near the
    least multiple; itself, where there are none."""

    def far(f: float) -> float:
        return min(abs(f / (n * grid) - 1.0) + RARER * (n - 1) for n in MULTIPLES for grid in GRIDS_HZ)

    return sorted(_of_grids(seen_Hz, rate_Hz), key=far) or [seen_Hz]


def _told(t: Array, e: Array, candidates: Sequence[float], spacing: float, least: float) -> float:
    """Of frequencies that look alike the first, unless another one takes more than by chance (`least`)."""
    best, most = candidates[0], -np.inf
    for candidate in candidates:
        found = _closest(t, e, candidate, spacing)
        if found[1] > most + (least if most > -np.inf else 0.0):
            best, most = found
    return best


def _closest(t: Array, e: Array, f: float, spacing: float) -> tuple[float, float]:
    """(the frequency close to one at which a sine takes the most, what it takes)."""
    found = minimize_scalar(
        lambda f: -_taken(t, e, f)[0], bounds=(f - spacing, f + spacing), method="bounded",
        options={"xatol": spacing * 1e-3},
    )  # fmt: skip
    return float(found.x), -float(found.fun)


def _growth(t: Array, e: Array, f: float, load: Array, least: float) -> float:
    """By how much of itself, as it is at the mean load, a line grows with each newton; 0 where that is no more than
    chance."""
    span = float(np.ptp(load))
    if span <= 0.0:
        return 0.0
    angle, along = 2.0 * np.pi * f * t, (load - load.mean()) / span
    waves = np.stack([np.sin(angle), np.cos(angle)], axis=1)
    A = np.hstack([waves, along[:, None] * waves])
    x = np.linalg.lstsq(A, e, rcond=None)[0]
    taken = float(np.sum((A @ x) ** 2)) - _taken(t, e, f)[0]
    growth = float(x[:2] @ x[2:] / (x[:2] @ x[:2]))  # in phase with the line itself
    return growth / span if taken > least and abs(growth) < MOST_GROWTH else 0.0
