"""A recording with its truth: pad, motion, noise and clocks put together."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .motion import Motion
from .noise import Noise
from .pad import Pad, simulate


@dataclass(frozen=True)
class Clocks:
    """How the rows of a recording come about.

    A channel is sampled at each `…_every`-th row only. Where the force has a clock of its own, it is measured
    `force_phase_s` after the row, and its stamps run `skew_ppm` fast against the clock of the position.
    """

    position_every: int = 1
    force_every: int = 1
    own_force_clock: bool = False
    force_phase_s: float = 0.0
    skew_ppm: float = 0.0

    def __post_init__(self) -> None:
        if (self.force_phase_s or self.skew_ppm) and not self.own_force_clock:
            raise ValueError("a phase or a skew needs own_force_clock")


@dataclass(frozen=True)
class Truth:
    """What a recording was made of; true times and values where the channel was sampled, NaN elsewhere."""

    pad: Pad
    motion: Motion
    noise: Noise
    clocks: Clocks
    rate_hz: float
    position_true_time_s: np.ndarray
    position_true_mm: np.ndarray
    force_true_time_s: np.ndarray
    force_true_N: np.ndarray
    let_go: np.ndarray
    events: list[tuple[float, str]]


@dataclass(frozen=True)
class Dataset:
    """Stamps and values as measured; a channel is NaN in rows where it was not sampled."""

    time_s: np.ndarray
    position_mm: np.ndarray
    force_N: np.ndarray
    force_time_s: np.ndarray | None
    truth: Truth

    def to_csv(self, path: str | Path) -> Path:
        """Write `time_s,position_mm,force_N` and, of a force with its own clock, `force_time_s`."""
        columns = {"time_s": self.time_s, "position_mm": self.position_mm, "force_N": self.force_N}
        if self.force_time_s is not None:
            columns["force_time_s"] = self.force_time_s
        with Path(path).open("w", newline="") as out:
            writer = csv.writer(out)
            writer.writerow(columns)
            for row in zip(*columns.values(), strict=True):
                writer.writerow("" if np.isnan(v) else f"{v:.9g}" for v in row)
        return Path(path)

    def model(self) -> dict[str, Any]:
        """The true pad as the content of a model file."""
        return self.truth.pad.model(float(np.nanmax(self.truth.position_true_mm)))

    def model_yaml(self) -> str:
        """The true pad as a model file."""
        pad = self.model()["pad"]
        lines = [f"  {key}: {_flow(value)}" for key, value in pad.items()]
        return "\n".join(["pad:", *lines]) + "\n"


def _flow(value: Any) -> str:
    """YAML flow style of dicts, lists, numbers and words."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{k}: {_flow(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(_flow(v) for v in value) + "]"
    if isinstance(value, str):
        return value
    text = repr(float(value))
    # YAML 1.1 reads 1e-05 as a word: a number there has a point.
    return text.replace("e", ".0e") if "e" in text and "." not in text else text


def make(
    pad: Pad,
    motion: Motion,
    rate_hz: float,
    noise: Noise,
    rng: np.random.Generator,
    clocks: Clocks | None = None,
) -> Dataset:
    """Record the motion from its start to its end at `rate_hz` rows a second."""
    clocks = clocks or Clocks()
    even = np.arange(int(np.floor(motion.duration_s * rate_hz + 1e-9)) + 1) / rate_hz
    rows = np.arange(len(even))
    has_position, has_force = rows % clocks.position_every == 0, rows % clocks.force_every == 0

    true, stamps = noise.timing.times(even, rng) if noise.timing else (even, even)
    force_true, force_stamps = true, stamps
    if clocks.own_force_clock:
        late = even + clocks.force_phase_s
        force_true, force_stamps = noise.timing.times(late, rng) if noise.timing else (late, late)
        force_stamps = force_stamps * (1 + 1e-6 * clocks.skew_ppm)

    response = simulate(pad, motion, force_true[has_force])
    depth = motion.position(true[has_position])
    force = response.force_N
    if noise.force:
        force = noise.force.apply(force, force_true[has_force], rng)
    position = noise.position.apply(depth, true[has_position], rng) if noise.position else depth

    truth = Truth(
        pad=pad,
        motion=motion,
        noise=noise,
        clocks=clocks,
        rate_hz=rate_hz,
        position_true_time_s=true[has_position],
        position_true_mm=depth,
        force_true_time_s=force_true[has_force],
        force_true_N=response.force_N,
        let_go=response.let_go,
        events=response.events,
    )
    own = _spread(force_stamps[has_force], has_force) if clocks.own_force_clock else None
    return Dataset(stamps, _spread(position, has_position), _spread(force, has_force), own, truth)


def _spread(values: np.ndarray, rows: np.ndarray) -> np.ndarray:
    spread = np.full(len(rows), np.nan)
    spread[rows] = values
    return spread
