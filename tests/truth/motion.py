"""Motions δ(t) as exact functions: pieces of a parabola plus sinusoids, so that any time can be sampled.

On the piece that starts at T_k, with τ = t − T_k,

    δ(τ) = a_0 + a_1 τ + a_2 τ² + Σ_j A_j (1 − cos 2π f_j τ).

Units: mm, s, mm/s, mm/s², Hz. Before the first and after the last piece the position is held.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Motion:
    """δ(t): `breaks_s` (n+1), `poly` (n, 3), `amplitude_mm` (n, j), `frequency_Hz` (n, j)."""

    breaks_s: np.ndarray
    poly: np.ndarray
    amplitude_mm: np.ndarray
    frequency_Hz: np.ndarray

    @property
    def duration_s(self) -> float:
        """End of the last piece."""
        return float(self.breaks_s[-1])

    def _piece(self, time_s: np.ndarray | float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        asked = np.asarray(time_s, dtype=float)
        time = np.clip(asked, self.breaks_s[0], self.breaks_s[-1])
        k = np.clip(np.searchsorted(self.breaks_s, time, side="right") - 1, 0, len(self.poly) - 1)
        return k, time - self.breaks_s[k], asked == time

    def position(self, time_s: np.ndarray | float) -> np.ndarray:
        """δ in mm."""
        k, tau, _ = self._piece(time_s)
        a = self.poly[k]
        depth = a[..., 0] + tau * (a[..., 1] + tau * a[..., 2])
        if self.amplitude_mm.shape[1]:
            angle = 2 * np.pi * self.frequency_Hz[k] * tau[..., None]
            depth = depth + np.sum(self.amplitude_mm[k] * (1 - np.cos(angle)), axis=-1)
        return depth

    def velocity(self, time_s: np.ndarray | float) -> np.ndarray:
        """dδ/dt in mm/s; from the right where it jumps."""
        k, tau, within = self._piece(time_s)
        a, omega = self.poly[k], 2 * np.pi * self.frequency_Hz[k]
        speed = a[..., 1] + 2 * tau * a[..., 2]
        speed = speed + np.sum(self.amplitude_mm[k] * omega * np.sin(omega * tau[..., None]), axis=-1)
        return np.where(within, speed, 0.0)

    def corners_s(self) -> np.ndarray:
        """Times where the pieces meet, and where a parabola turns round."""
        a_1, a_2 = self.poly[:, 1], self.poly[:, 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            turn = np.where(a_2 != 0, -a_1 / (2 * a_2), -1.0)
        inside = (turn > 0) & (turn < np.diff(self.breaks_s))
        return np.union1d(self.breaks_s, (self.breaks_s[:-1] + turn)[inside])


class Path:
    """Builds a motion piece by piece."""

    def __init__(self, start_mm: float = 0.0, acceleration_mm_s2: float = 5000.0) -> None:
        """Start at rest; `acceleration_mm_s2=inf` makes ideal ramps, whose speed jumps."""
        self.at_mm, self.acceleration_mm_s2 = float(start_mm), acceleration_mm_s2
        self._pieces: list[tuple[float, list[float], list[tuple[float, float]]]] = []

    def _add(self, duration_s: float, poly: list[float], tones: Sequence[tuple[float, float]] = ()) -> None:
        if duration_s > 1e-12:  # a triangle's flat top is left with the rounding
            self._pieces.append((duration_s, poly, list(tones)))

    def hold(self, duration_s: float) -> Path:
        """Stay."""
        self._add(duration_s, [self.at_mm, 0.0, 0.0])
        return self

    def to(self, target_mm: float, speed_mm_s: float) -> Path:
        """Go to the target by a trapezoid of speed (a triangle where the way is short)."""
        start, way = self.at_mm, abs(target_mm - self.at_mm)
        sign, a = np.sign(target_mm - start), self.acceleration_mm_s2
        if way > 0 and np.isinf(a):
            self._add(way / speed_mm_s, [start, sign * speed_mm_s, 0.0])
        elif way > 0:
            peak = min(speed_mm_s, np.sqrt(a * way))
            run_up = peak**2 / (2 * a)
            self._add(peak / a, [start, 0.0, sign * a / 2])
            self._add((way - 2 * run_up) / peak, [start + sign * run_up, sign * peak, 0.0])
            self._add(peak / a, [target_mm - sign * run_up, sign * peak, -sign * a / 2])
        self.at_mm = float(target_mm)
        return self

    def sines(self, tones: Sequence[tuple[float, float]], duration_s: float) -> Path:
        """Σ A_j (1 − cos 2π f_j τ), from rest where the path is; tones are (A_j in mm, f_j in Hz)."""
        self._add(duration_s, [self.at_mm, 0.0, 0.0], tones)
        self.at_mm += sum(A * (1 - np.cos(2 * np.pi * f * duration_s)) for A, f in tones)
        return self

    def motion(self) -> Motion:
        """The motion built so far."""
        n, j = len(self._pieces), max((len(p[2]) for p in self._pieces), default=0)
        tones = np.zeros((2, n, j))
        for k, piece in enumerate(self._pieces):
            for i, (A, f) in enumerate(piece[2]):
                tones[:, k, i] = A, f
        breaks = np.concatenate([[0.0], np.cumsum([p[0] for p in self._pieces])])
        return Motion(breaks, np.array([p[1] for p in self._pieces]), tones[0], tones[1])


def staircase(
    levels_mm: Sequence[float],
    speed_mm_s: float | Sequence[float],
    hold_s: float | Sequence[float],
    start_mm: float = -0.5,
    acceleration_mm_s2: float = 5000.0,
    lead_s: float = 0.5,
) -> Motion:
    """Fig. 5: one level after another, each held; speeds and holds one for all or one a level."""
    speeds = np.broadcast_to(speed_mm_s, len(levels_mm))
    holds = np.broadcast_to(hold_s, len(levels_mm))
    path = Path(start_mm, acceleration_mm_s2).hold(lead_s)
    for level, speed, hold in zip(levels_mm, speeds, holds, strict=True):
        path.to(float(level), float(speed)).hold(float(hold))
    return path.motion()


def rate_sweep(
    depth_mm: float,
    speeds_mm_s: Sequence[float],
    hold_s: float = 2.0,
    rest_s: float = 5.0,
    start_mm: float = -0.5,
    acceleration_mm_s2: float = 5000.0,
) -> Motion:
    """Fig. 1: the same depth at one speed after another, with a rest in air between."""
    path = Path(start_mm, acceleration_mm_s2).hold(0.5)
    for speed in speeds_mm_s:
        path.to(depth_mm, speed).hold(hold_s).to(start_mm, speed).hold(rest_s)
    return path.motion()


def rich(
    depth_mm: float,
    speeds_mm_s: Sequence[float] = (80.0, 10.0, 1.5),
    hold_s: float = 1.5,
    long_hold_s: float = 20.0,
    start_mm: float = -0.5,
    acceleration_mm_s2: float = 5000.0,
) -> Motion:
    """Steps up and down at several speeds, returns to the surface and into air, a repeat, one long hold."""
    path = Path(start_mm, acceleration_mm_s2).hold(0.5)
    for speed in speeds_mm_s:
        for share in (0.3, 0.6, 1.0, 0.5):
            path.to(share * depth_mm, speed).hold(hold_s)
        path.to(0.0, speed).hold(hold_s).to(start_mm, speed).hold(2 * hold_s)
    fastest = max(speeds_mm_s)
    for _ in range(3):
        path.to(0.7 * depth_mm, fastest).hold(0.5 * hold_s).to(0.0, fastest).hold(0.5 * hold_s)
    path.to(0.8 * depth_mm, fastest).hold(long_hold_s).to(start_mm, fastest).hold(2 * hold_s)
    return path.motion()


def random_steps(
    rng: np.random.Generator,
    depth_mm: float,
    steps: int = 30,
    speeds_mm_s: tuple[float, float] = (1.0, 80.0),
    holds_s: tuple[float, float] = (0.1, 3.0),
    air_share: float = 0.15,
    start_mm: float = -0.5,
    acceleration_mm_s2: float = 5000.0,
) -> Motion:
    """Uniform levels, log-uniform speeds and holds; some steps go to the air."""
    levels = np.where(rng.random(steps) < air_share, start_mm, rng.uniform(0.05, 1.0, steps) * depth_mm)
    speeds, holds = (np.exp(rng.uniform(*np.log(pair), steps)) for pair in (speeds_mm_s, holds_s))
    return staircase(levels.tolist(), speeds.tolist(), holds.tolist(), start_mm, acceleration_mm_s2)


def sinusoids(
    low_mm: float,
    high_mm: float,
    frequencies_Hz: Sequence[float],
    periods: int = 10,
    together: bool = True,
    start_mm: float = -0.5,
    acceleration_mm_s2: float = 5000.0,
) -> Motion:
    """Sinusoids between two depths: all at once for `periods` of the lowest, or one after the other."""
    path = Path(start_mm, acceleration_mm_s2).hold(0.5).to(low_mm, 10.0).hold(1.0)
    half = (high_mm - low_mm) / 2
    if together:
        tones = [(half / len(frequencies_Hz), f) for f in frequencies_Hz]
        path.sines(tones, periods / min(frequencies_Hz))
    else:
        for f in frequencies_Hz:
            path.sines([(half, f)], periods / f)
    return path.to(start_mm, 10.0).hold(2.0).motion()


def sampled(time_s: np.ndarray, position_mm: np.ndarray) -> Motion:
    """A measured position, taken as linear between its samples."""
    time, position = np.asarray(time_s, float), np.asarray(position_mm, float)
    slope = np.diff(position) / np.diff(time)
    poly = np.stack([position[:-1], slope, np.zeros_like(slope)], axis=1)
    none = np.zeros((len(slope), 0))
    return Motion(time, poly, none, none)
