"""Random pads, motions, noises and rates from a generator passed in.

Pads range from finger pads to gels: an elastic force of 1–20 N at a depth of 1–4 mm.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from . import motion as motions
from .dataset import Clocks, Dataset, make
from .laws import Exponential, Hertz, Law, Polynomial, Power, Tanh
from .motion import Motion
from .noise import Coloured, Noise, Quantised, StudentT, White
from .pad import Pad

LAWS = ("exponential", "power", "polynomial")
OTHER_LAWS = ("hertz", "tanh")
MOTIONS = ("staircase", "rate_sweep", "rich", "random_steps", "sinusoids")
RATES_HZ = (100.0, 200.0, 250.0, 500.0, 1000.0, 2000.0)

#: After the paper's polyurethane gel, Tab. II.
POLYURETHANE = Pad(Exponential(2.24, 0.69), (0.25, 0.15), (4.0, 0.35))


@dataclass(frozen=True)
class DrawnPad:
    """A pad, how deep it may be pressed, and its elastic force there."""

    pad: Pad
    depth_mm: float
    force_N: float


def _log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def law(rng: np.random.Generator, name: str, depth_mm: float, force_N: float) -> Law:
    """A law of that name, of random curvature, that goes through (depth, force)."""
    d = depth_mm
    if name == "exponential":
        b = rng.uniform(0.5, 3.5) / d
        return Exponential(float(force_N * b / np.expm1(b * d)), float(b))
    if name == "power":
        q = float(rng.uniform(0.2, 2.0))
        return Power(force_N * (q + 1) / d ** (q + 1), q)
    if name == "polynomial":
        shares = rng.dirichlet([1.0] * 3) * 0.85 + 0.05
        return Polynomial((0.0, *(float(force_N * s / d**i) for i, s in enumerate(shares, 1))))
    if name == "hertz":
        radius = _log_uniform(rng, 2.0, 20.0)
        return Hertz(float(0.75 * force_N / (np.sqrt(radius) * d**1.5)), radius)
    if name == "tanh":
        scale, share = d * rng.uniform(0.3, 0.8), rng.uniform(0.2, 0.6)
        amplitude = (1 - share) * force_N / np.tanh(d / scale)
        return Tanh(float(amplitude), float(scale), float(share * force_N / d))
    raise ValueError(f"no law {name!r}: one of {(*LAWS, *OTHER_LAWS)}")


def pad(
    rng: np.random.Generator,
    laws: Sequence[str] = LAWS,
    orders: Sequence[int] = (1, 2, 3),
    contacts: Sequence[Literal["bonded", "unilateral"]] = ("unilateral", "bonded"),
) -> DrawnPad:
    """A pad: rates within 0.1–60 /s, at least a factor 3 apart; shares of 0.05 or more, c_0 of 0.25 or more."""
    depth, force = float(rng.uniform(1.0, 4.0)), _log_uniform(rng, 1.0, 20.0)
    elastic = law(rng, str(rng.choice(laws)), depth, force)
    r = int(rng.choice(orders))
    shares = 0.05 + rng.dirichlet(np.ones(r)) * (rng.uniform(max(0.15, 0.07 * r), 0.75) - 0.05 * r)
    # The slack that is left over a factor 3 from one to the next is shared out by sorted uniform numbers.
    slack = np.log(60.0 / 0.1) - (r - 1) * np.log(3.0)
    logs = np.log(0.1) + np.sort(rng.uniform(0, slack, r)) + np.arange(r) * np.log(3.0)
    rates = np.exp(logs)[::-1]
    contact: Literal["bonded", "unilateral"] = "bonded" if str(rng.choice(contacts)) == "bonded" else "unilateral"
    made = Pad(elastic, tuple(shares.tolist()), tuple(rates.tolist()), contact)
    return DrawnPad(made, depth, force)


def motion(rng: np.random.Generator, depth_mm: float, kinds: Sequence[str] = MOTIONS) -> Motion:
    """A motion of 20 s to about 2 min that never goes deeper than `depth_mm`."""
    kind = str(rng.choice(kinds))
    peak, fast = depth_mm * rng.uniform(0.8, 1.0), _log_uniform(rng, 30.0, 120.0)
    start, acceleration = -float(rng.uniform(0.2, 1.0)), _log_uniform(rng, 1000.0, 8000.0)
    common = {"start_mm": start, "acceleration_mm_s2": acceleration}
    if kind == "staircase":
        up = np.linspace(0, peak, int(rng.integers(4, 8)))[1:]
        levels = np.concatenate([up, up[-2::-1], [start]])
        return motions.staircase(levels.tolist(), fast, float(rng.uniform(2, 6)), **common)
    if kind == "rate_sweep":
        speeds = np.geomspace(rng.uniform(0.3, 1.0), fast, int(rng.integers(3, 6)))
        return motions.rate_sweep(peak, speeds.tolist(), float(rng.uniform(1, 4)), float(rng.uniform(2, 6)), **common)
    if kind == "rich":
        return motions.rich(peak, (fast, fast / 8, fast / 50), float(rng.uniform(0.5, 1.5)), **common)
    if kind == "random_steps":
        return motions.random_steps(rng, peak, int(rng.integers(20, 50)), **common)
    if kind == "sinusoids":
        f = np.geomspace(rng.uniform(0.1, 0.3), rng.uniform(2, 8), int(rng.integers(2, 5)))
        low, together = peak * rng.uniform(0.05, 0.4), bool(rng.random() < 0.5)
        return motions.sinusoids(low, peak, f.tolist(), int(rng.integers(4, 10)), together, **common)
    raise ValueError(f"no motion {kind!r}: one of {MOTIONS}")


def noise(rng: np.random.Generator, force_N: float, white: bool = False) -> Noise:
    """Force noise of 0.05–1 % of the force given (white if asked), position noise of 0–1 µm."""
    std = force_N * _log_uniform(rng, 0.0005, 0.01)
    kinds = (
        White(std),
        Coloured(std, _log_uniform(rng, 0.002, 0.05)),
        StudentT(std, float(rng.uniform(3, 8))),
        Quantised(float(std * rng.uniform(0.5, 1.5)), White(std)),
    )
    kind = 0 if white else int(rng.integers(len(kinds)))
    return Noise(force=kinds[kind], position=White(float(rng.uniform(0, 0.001))))


def dataset(
    rng: np.random.Generator,
    laws: Sequence[str] = LAWS,
    kinds: Sequence[str] = MOTIONS,
    white: bool = True,
    clocks: Clocks | None = None,
) -> Dataset:
    """All of it: pad, motion within its depth, rate of 100 Hz to 2 kHz, noise."""
    drawn = pad(rng, laws)
    path = motion(rng, drawn.depth_mm, kinds)
    return make(drawn.pad, path, float(rng.choice(RATES_HZ)), noise(rng, drawn.force_N, white), rng, clocks)
