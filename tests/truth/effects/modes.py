"""What all shapes of a mode that the belief lacks share: how big it is, where it lies, and how the others make room."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..pad import Pad
from .registry import Build, spread


def drawn_mode(build: Build, size: float, slowest: float, quickest: float) -> tuple[float, float]:
    """Share and rate (1/s) of a mode: of twelve rates between two the one that is farthest from those known."""
    share = 0.08 * size * spread(build.rng, 0.7, 1.4)
    known = np.log(build.plant.pad.rates) if build.plant.pad.rates else np.array([np.log(100.0)])
    tries = build.rng.uniform(np.log(slowest), np.log(quickest), 12)
    apart = np.min(np.abs(tries[:, None] - known), axis=1)
    return share, float(np.exp(tries[np.argmax(apart)]))


def add_modes(build: Build, share: float, weights: np.ndarray, rates: np.ndarray) -> None:
    """Modes of a share in all. What is elastic for good stays at 0.15 at least; the known modes make room."""
    pad = build.plant.pad
    room = min(1.0, (0.85 - share) / max(sum(pad.shares), 1e-9))
    shares = tuple(c * room for c in pad.shares)
    added = tuple((share * weights).tolist())
    build.plant.pad = Pad(pad.law, shares + added, pad.rates + tuple(rates.tolist()), pad.contact)
    build.believed = replace(build.believed, shares=shares)
