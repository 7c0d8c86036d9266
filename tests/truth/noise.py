"""Noise of the channels and of their clocks, each with its figures stated.

Value noise is a class with `.draw(time_s, rng)` (same shape as the time), `.std`, and `.whiten(time_s, columns)`,
which scales columns (n, k) so that their Gram matrix is the Fisher information of what they are derivatives of.
Timing noise is one of two different things: `SamplingJitter`, the samples really are taken at uneven times and
the stamps say so; `StampJitter`, the samples are evenly taken and the stamps are wrong.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class White:
    """Independent Gaussian values of standard deviation `std` (N or mm)."""

    std: float

    def draw(self, time_s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        return self.std * rng.standard_normal(len(time_s))

    def apply(self, values: np.ndarray, time_s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Values as measured."""
        return values + self.draw(time_s, rng)

    def whiten(self, time_s: np.ndarray, columns: np.ndarray) -> np.ndarray:
        return columns / self.std


@dataclass(frozen=True)
class Coloured(White):
    """Gauss–Markov: E x(t) x(t+s) = std² e^{−|s|/τ}; AR(1) with φ = e^{−Δt/τ} on even times."""

    correlation_time_s: float

    def draw(self, time_s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        phi = np.exp(-np.diff(time_s) / self.correlation_time_s)
        fresh = rng.standard_normal(len(time_s)) * np.concatenate([[1.0], np.sqrt(1 - phi**2)])
        x = fresh.tolist()
        for k, f in enumerate(phi.tolist(), 1):
            x[k] += f * x[k - 1]
        return self.std * np.array(x)

    def whiten(self, time_s: np.ndarray, columns: np.ndarray) -> np.ndarray:
        phi = np.exp(-np.diff(time_s) / self.correlation_time_s)[:, None]
        fresh = (columns[1:] - phi * columns[:-1]) / np.sqrt(1 - phi**2)
        return np.concatenate([columns[:1], fresh]) / self.std


@dataclass(frozen=True)
class StudentT(White):
    """Independent Student-t values scaled to standard deviation `std`; `dof` > 2, small is heavy."""

    dof: float = 4.0

    def draw(self, time_s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        return self._scale * rng.standard_t(self.dof, len(time_s))

    @property
    def _scale(self) -> float:
        return self.std * np.sqrt((self.dof - 2) / self.dof)

    def whiten(self, time_s: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """The information of a location is (dof + 1) / ((dof + 3) scale²)."""
        return columns * np.sqrt((self.dof + 1) / (self.dof + 3)) / self._scale


@dataclass(frozen=True)
class Quantised:
    """Another noise, then rounding to multiples of `step`; `source=None` rounds alone."""

    step: float
    source: White | None = None

    @property
    def std(self) -> float:
        """Of the whole: rounding adds step²/12."""
        return float(np.hypot(self.source.std if self.source else 0.0, self.step / np.sqrt(12)))

    def apply(self, values: np.ndarray, time_s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        measured = self.source.apply(values, time_s, rng) if self.source else values
        return np.round(measured / self.step) * self.step

    def whiten(self, time_s: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """As if rounding were white noise of step²/12, near enough while the source is not below the step."""
        if type(self.source) is not White:
            raise ValueError("the information in rounded values is known here for white noise only")
        return columns / self.std


@dataclass(frozen=True)
class SamplingJitter:
    """Samples are taken at even times plus a deviation; the stamps tell the true times."""

    std_s: float

    def times(self, even_s: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """(true times, stamps)."""
        true = even_s + _deviation(even_s, self.std_s, rng)
        return true, true


@dataclass(frozen=True)
class StampJitter:
    """Samples are taken at even times; the stamps deviate from them."""

    std_s: float

    def times(self, even_s: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """(true times, stamps)."""
        return even_s, even_s + _deviation(even_s, self.std_s, rng)


def _deviation(even_s: np.ndarray, std_s: float, rng: np.random.Generator) -> np.ndarray:
    """Gaussian, cut at 0.45 of the period so that order is kept, and not before the start."""
    bound = 0.45 * float(np.min(np.diff(even_s)))
    return np.maximum(np.clip(std_s * rng.standard_normal(len(even_s)), -bound, bound), -even_s)


@dataclass(frozen=True)
class Noise:
    """What disturbs a recording; None is nothing."""

    force: White | Quantised | None = field(default_factory=lambda: White(0.01))
    position: White | Quantised | None = None
    timing: SamplingJitter | StampJitter | None = None
