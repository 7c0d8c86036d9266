"""Mains hum, found in the holds, where nothing else swings: a line in the spectrum of what smooth curves leave.

It is taken out of the force before the search, which works on averages over blocks that hide it, and given back at the
end: as a cause where it can come from the mains, else as something that nothing explains.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from .noise import Part

Array = NDArray[np.float64]

LOWEST_HZ = 8.0
MAINS_HZ, MULTIPLES = (45.0, 65.0), (1, 2, 3)
LEVEL = 1e-5  # of a line by chance, over all frequencies
LEAST_SHARE = 0.002  # of the noise power


@dataclass(frozen=True)
class Line:
    """Σ over harmonics (1, 3) of the sines found; `frequency_Hz`, `amplitude_N` and `phase_rad` of the first at t = 0,
    `ratio` and `third_phase_rad` of the third (0 where there is none)."""

    frequency_Hz: float
    amplitude_N: float
    phase_rad: float
    ratio: float
    third_phase_rad: float

    sample_s: float = 1e-3

    @property
    def of_the_mains(self) -> bool:
        """Whether the grid's frequency, or a low multiple of it, looks like this at this rate of sampling."""
        step_Hz = (MAINS_HZ[1] - MAINS_HZ[0]) / 400.0
        grid = np.outer(MULTIPLES, np.arange(MAINS_HZ[0], MAINS_HZ[1] + step_Hz, step_Hz)).ravel()
        rate = 1.0 / self.sample_s
        seen = np.abs(grid - rate * np.rint(grid / rate))
        return bool(np.min(np.abs(seen - self.frequency_Hz)) <= 2.0 * step_Hz)

    def force_N(self, time_s: Array) -> Array:
        """The line at times (n,) since its start."""
        angle = 2.0 * np.pi * self.frequency_Hz * time_s
        third = self.ratio * np.sin(3.0 * angle + self.third_phase_rad)
        return np.asarray(self.amplitude_N * (np.sin(angle + self.phase_rad) + third))


def find(start_s: float, sample_s: float, parts: list[Part]) -> Line | None:
    """The strongest line in the holds, where it is beyond chance; phases count from `start_s`.

    `sample_s`: time between force samples.
    """
    if sum(len(e) for _, e, _ in parts) < 200:
        return None
    t = np.concatenate([t for t, _, _ in parts]) - start_s
    e = np.concatenate([e for _, e, _ in parts])
    step = sample_s
    power, frequency = _spectrum(t, e, step)
    usable = (frequency > LOWEST_HZ) & (frequency < 0.47 / step)
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
    spacing = frequency[1] - frequency[0]
    found = minimize_scalar(
        lambda f: -_taken(t, e, f)[0], bounds=(frequency[k] - spacing, frequency[k] + spacing), method="bounded",
        options={"xatol": spacing * 1e-3},
    )  # fmt: skip
    f = float(found.x)
    taken, sine, cosine = _taken(t, e, f)
    if taken < LEAST_SHARE * float(e @ e):
        return None
    amplitude, phase = float(np.hypot(sine, cosine)), float(np.arctan2(cosine, sine))
    ratio = third = 0.0
    if 3.0 * f < 0.47 / step:
        more, s3, c3 = _taken(t, e, 3.0 * f)
        if more > 15.0 * float(e @ e) / len(e):
            ratio, third = float(np.hypot(s3, c3)) / amplitude, float(np.arctan2(c3, s3))
    return Line(f, amplitude, phase, ratio, third, step)


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
