"""Short probing blocks: what each is good for, as steps of a protocol, and the motion that steps make.

Each block begins and ends in air, so that blocks can follow one another in any order. Depths in mm, speeds in mm/s,
times in s.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.trajectory import Profile

Array = NDArray[np.float64]

Step = dict[str, float]

AIR_mm = -0.5
SLOWEST_mm_s = 0.2
GROWTH = 0.04
"""Of the gaps between samples looked at, by the samples since the last corner."""


@dataclass(frozen=True)
class Reach:
    """How deep (mm) and how fast (mm/s) a test may go, and how it accelerates (mm/s²)."""

    depth_mm: float
    speed_mm_s: float
    acceleration_mm_s2: float


@dataclass(frozen=True)
class Block:
    """`name`: a word for the protocol; `what`: a phrase for people; `steps`: ramps with their holds."""

    name: str
    what: str
    steps: tuple[Step, ...]

    def to_dict(self, repeat: int = 1) -> dict[str, Any]:
        """The block as a step of a protocol file."""
        return {"block": self.name, "repeat": repeat, "steps": [dict(step) for step in self.steps]}


def _step(to: float, speed: float, hold: float = 0.0) -> Step:
    step = {"to": round(to, 3), "speed": float(f"{max(speed, SLOWEST_mm_s):.3g}")}
    return step | {"hold": hold} if hold > 0 else step


def library(reach: Reach) -> list[Block]:
    """All blocks, within the reach."""
    D, V = reach.depth_mm, reach.speed_mm_s
    sweep: list[Step] = []
    for share in (1.0, 0.25, 0.06, 0.015):
        sweep += [_step(0.7 * D, V * share, 1.0), _step(AIR_mm, V, 3.0)]
    deeper: list[Step] = []
    for part in (0.35, 0.35, 0.35, 0.65, 0.35, 0.65, 1.0, 0.65, 1.0, 0.35):
        deeper += [_step(part * D, V / 4, 0.3), _step(AIR_mm, V / 4, 1.5)]
    shallow = [_step(part * D, V / 8, 1.0) for part in (0.04, 0.08, 0.13, 0.2, 0.28, 0.4, 0.28, 0.2, 0.13, 0.08, 0.04)]
    stairs = [_step(part * D, V, 2.0) for part in (0.2, 0.4, 0.6, 0.8, 1.0, 0.8, 0.6, 0.4, 0.2)]
    turns: list[Step] = []
    for part in (0.3, 0.6, 0.9):
        turns.append(_step(part * D, V / 4, 1.0))
        for _ in range(3):
            turns += [_step((part - 0.05) * D, 1.0, 0.3), _step(part * D, 1.0, 0.3)]
    fast: list[Step] = []
    for part in (0.4, 0.8, 0.4, 0.8):
        fast += [_step(part * D, V, 0.4), _step(AIR_mm, V, 1.2)]
    corners: list[Step] = []
    for _ in range(12):
        corners += [_step(0.95 * D, V, 0.15), _step(0.5 * D, V, 0.15)]
    slow = [_step(D, max(D / 12.0, SLOWEST_mm_s)), _step(AIR_mm, max(D / 12.0, SLOWEST_mm_s), 2.0)]
    rest = [
        _step(0.6 * D, V / 4, 3.0),
        _step(AIR_mm, V / 4, 12.0),
        _step(0.6 * D, V / 4, 3.0),
        _step(AIR_mm, V / 4, 8.0),
    ]
    return [
        Block("speeds", "one depth at several speeds", tuple(sweep)),
        Block("deeper", "cycles with returns to the surface, then deeper, then as before", tuple(deeper)),
        Block("shallow", "a shallow staircase", (*shallow, _step(AIR_mm, V / 8, 2.0))),
        Block("stairs", "a staircase up and down", (*stairs, _step(AIR_mm, V, 2.0))),
        Block("long_hold", "a long hold, and recovery in air", (_step(0.8 * D, V, 25.0), _step(AIR_mm, V, 15.0))),
        Block("turns", "small reversals at several depths", (*turns, _step(AIR_mm, V / 4, 1.0))),
        Block("fast", "fast steps with rests in air", tuple(fast)),
        Block("corners", "fast reversals at depth", (*corners, _step(AIR_mm, V, 1.0))),
        Block("slow", "slow ramps in and out", tuple(slow)),
        Block("air", "free air between presses", (_step(AIR_mm, 5.0, 8.0), *rest)),
    ]


@dataclass(frozen=True)
class Motion:
    """Times (n,), positions (n,), and how many samples of an even clock each stands for (n,): denser after corners."""

    time_s: Array
    position_mm: Array
    weight: Array

    @property
    def duration_s(self) -> float:
        """From the first sample to the last."""
        return float(self.time_s[-1] - self.time_s[0])


def motion(steps: Iterable[Step], acceleration_mm_s2: float, rate_Hz: float) -> Motion:
    """The motion of steps from rest in air, as sampled at a rate."""
    profiles: list[tuple[float, Profile]] = []
    now, at = 0.5, AIR_mm
    corners = [0.0]
    for step in steps:
        profile = Profile(at, step["to"], step["speed"], acceleration_mm_s2)
        profiles.append((now, profile))
        corners += [now, now + profile.duration_s]
        now += profile.duration_s + step.get("hold", 0.0)
        at = step["to"]
    index = _kept(np.array(corners), int(now * rate_Hz) + 1, rate_Hz)
    time = index / rate_Hz
    position = np.full(time.size, AIR_mm)
    for begin, profile in profiles:
        later = time >= begin
        position[later] = profile.position(time[later] - begin)
    edges = np.concatenate([[-0.5], (index[1:] + index[:-1]) / 2.0, [index[-1] + 0.5]])
    return Motion(time, position, np.diff(edges))


def _kept(corners_s: Array, samples: int, rate_Hz: float) -> NDArray[np.intp]:
    """Samples that are looked at: all of them just after a corner, then ever fewer."""
    index = np.arange(samples)
    begins = np.unique(np.ceil(corners_s * rate_Hz).astype(np.intp))
    since = index - begins[np.maximum(np.searchsorted(begins, index, side="right") - 1, 0)]
    rank = np.floor(np.log1p(GROWTH * since) / np.log1p(GROWTH)).astype(np.intp)
    return np.flatnonzero((np.diff(rank, prepend=-1) != 0) | (since == 0) | (index == samples - 1))


def together(blocks: Sequence[Block]) -> list[Step]:
    """The steps of blocks one after the other."""
    return [step for block in blocks for step in block.steps]
