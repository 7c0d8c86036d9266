"""Reference data for the estimator: the model's definition written out, F^e linear between samples."""

from __future__ import annotations

import math

import numpy as np

from bench.recording.types import Measurement
from tests.truth.dataset import Dataset
from tests.truth.laws import Law
from tests.truth.pad import Pad


def force(pad: Pad, time_s: np.ndarray, depth_mm: np.ndarray) -> np.ndarray:
    """(5) with (6) for F^e linear between samples: each step's ramp is integrated in closed form.

    A unilateral pad that would pull has let go: there the elastic force is what gives F = 0.
    """
    elastic = pad.law.force(depth_mm).tolist()
    c_0 = 1 - sum(pad.shares)
    w, surface, out = [0.0] * len(pad.rates), 0.0, []
    for k, wanted in enumerate(elastic):
        dt = time_s[k] - time_s[k - 1] if k else 0.0
        decay = [math.exp(-nu * dt) for nu in pad.rates]
        gain = [(1 - e) / (nu * dt) if dt else 1.0 for nu, e in zip(pad.rates, decay, strict=True)]
        held = c_0 * surface + sum(c * e * x for c, e, x in zip(pad.shares, decay, w, strict=True))
        slope = c_0 + sum(c * g for c, g in zip(pad.shares, gain, strict=True))
        rise = wanted - surface
        if pad.contact == "unilateral" and held + slope * rise < 0:
            rise = -held / slope
        w = [e * x + g * rise for e, x, g in zip(decay, w, gain, strict=True)]
        surface += rise
        out.append(held + slope * rise)
    return np.array(out)


def steps(rng: np.random.Generator, depth_mm: float, samples: int = 1500) -> tuple[np.ndarray, np.ndarray]:
    """Uneven stamps over about 30 s, ramps and holds up, down and into the air."""
    time = np.cumsum(rng.uniform(0.005, 0.035, samples))
    levels = depth_mm * np.array([-0.2, 0.4, 0.7, 1.0, 0.5, 0.8, 0.2, -0.2, 0.9, 0.3])
    knots = np.repeat(np.linspace(0, time[-1], 11), 2)[1:-1]
    knots[2::2] += 0.2
    return time, np.interp(time, knots, np.repeat(levels, 2))


def measurement(time_s: np.ndarray, depth_mm: np.ndarray, force_N: np.ndarray, name: str = "data") -> Measurement:
    """Both channels at the same stamps."""
    return Measurement(name, time_s, depth_mm, time_s, force_N)


def measured(pad: Pad, seed: int = 0, noise_N: float = 0.0, samples: int = 1500, depth_mm: float = 2.5) -> Measurement:
    """Uneven ramps and holds on a pad, with white noise."""
    rng = np.random.default_rng(seed)
    time, depth = steps(rng, depth_mm, samples)
    return measurement(time, depth, force(pad, time, depth) + noise_N * rng.standard_normal(samples))


def of_dataset(data: Dataset) -> Measurement:
    """A recording of tests.truth as a fit sees it."""
    stamps = data.time_s if data.force_time_s is None else data.force_time_s
    p, f = np.isfinite(data.position_mm), np.isfinite(data.force_N)
    return Measurement("truth", data.time_s[p], data.position_mm[p], stamps[f], data.force_N[f])


def curve(law: Law, depth_mm: float) -> np.ndarray:
    """F^e on a grid, to compare laws by."""
    return law.force(np.linspace(0, depth_mm, 50))
