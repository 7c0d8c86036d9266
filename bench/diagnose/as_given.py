"""How far the numbers of a belief had to move: with those it was given it may err, although its structure does not."""

from __future__ import annotations

import math

from sim.effects.reading import force
from sim.elastic import NoPad
from sim.pad import Pad

NOTABLE = 1.5  # times the error that is left refitted
CHANGED = 0.02  # of a number
SHOWN = 4


def as_given(believed: Pad, refitted: Pad, given_N: float, left_N: float) -> str:
    """A sentence on it; empty where the numbers were as good as right. `given_N`, `left_N`: RMS errors with the numbers
    as given and refitted."""
    if isinstance(believed.law, NoPad) or not NOTABLE * left_N <= given_N < math.inf:
        return ""
    before, after = _numbers(believed), _numbers(refitted)
    moved = {name: abs(after[name] - v) / max(abs(v), 1e-12) for name, v in before.items() if name in after}
    most = sorted((name for name, by in moved.items() if by > CHANGED), key=lambda name: -moved[name])[:SHOWN]
    if not most:
        return ""
    changes = ", ".join(f"{name} {before[name]:.4g} → {after[name]:.4g}" for name in before if name in most)
    return f"with its numbers as given it errs by {force(given_N)}; refitted: {changes}"


def _numbers(pad: Pad) -> dict[str, float]:
    shares, rates = pad.relaxation.shares, pad.relaxation.rates
    modes = {f"c_{i}": c for i, c in enumerate(shares, start=1)} | {f"nu_{i}": v for i, v in enumerate(rates, start=1)}
    return {**pad.law.parameters, **modes}
