"""Data for the discrete methods: the paper's staircase, and jumps, for which a zero-order hold is exact."""

from __future__ import annotations

import numpy as np

from bench.recording.types import Measurement
from tests.truth import draw
from tests.truth.dataset import Dataset, make
from tests.truth.laws import Exponential
from tests.truth.motion import Motion, Path, staircase
from tests.truth.noise import Noise, White
from tests.truth.pad import Pad

T = 0.05
LEVELS = (0.6, 1.2, 1.8, 2.4, 1.8, 1.2, 0.6)
GEL = Pad(Exponential(2.24, 0.69), (0.25, 0.15), (4.0, 0.35), "bonded")
"""As draw.POLYURETHANE, but it may pull."""


def measurement(data: Dataset, name: str = "run") -> Measurement:
    return Measurement(name, data.time_s, data.position_mm, data.time_s, data.force_N)


def jumps(rng: np.random.Generator, samples: int, hold: int = 20) -> Motion:
    """Levels at random, reached within 1 µs just before a sample: a zero-order hold of T is exact."""
    path, at_s = Path(0.0, np.inf), 0.0
    for n in range(samples // hold):
        target = float(rng.uniform(0.5, 2.4))
        jump_s = (2 + n * hold) * T - 1e-6
        way_s = 5e-7
        speed = abs(target - path.at_mm) / way_s
        path.hold(jump_s - at_s).to(target, speed)
        at_s = jump_s + way_s
    return path.hold(hold * T).motion()


def exact(seed: int, samples: int, noise_N: float, pad: Pad = GEL) -> Measurement:
    rng = np.random.default_rng(seed)
    noise = Noise(White(noise_N) if noise_N else None)
    return measurement(make(pad, jumps(rng, samples), 1 / T, noise, rng))


def steps(seed: int = 0, rate_hz: float = 200.0, noise_N: float = 0.01, speed_mm_s: float = 80.0) -> Dataset:
    """The paper's Fig. 5 on its gel."""
    path = staircase(list(LEVELS), speed_mm_s, 3.0)
    noise = Noise(White(noise_N) if noise_N else None)
    return make(draw.POLYURETHANE, path, rate_hz, noise, np.random.default_rng(seed))
