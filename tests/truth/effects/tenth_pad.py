"""The tenth shapes of what a pad does.

Sources: ISO 3385, Flexible cellular polymeric materials: determination of fatigue by constant-load pounding: foam loses
height from press to press, ever less.
"""

from __future__ import annotations

import numpy as np

from .registry import Build, more_shapes, spread


@more_shapes("permanent_set", "pounding")
def permanent_set(build: Build, shape: str, size: float) -> dict[str, float]:
    """It sinks with the way pressed W, by W/(W + W_half) of what it comes to, with W_half of 2 to 5 times the depth."""
    rng, depth = build.rng, build.depth_mm
    most, half_mm = min(0.05 * size * spread(rng, 0.7, 1.4), 0.3), depth * spread(rng, 2.0, 5.0)

    def height(t, x):
        pressed = np.maximum(x, 0.0)
        way = np.concatenate([[0.0], np.cumsum(np.maximum(np.diff(pressed), 0.0))])
        return most * np.maximum.accumulate(pressed) * way / (way + half_mm)

    build.plant.height.append(height)
    return {"set": most}


@more_shapes("damage", "all_the_way")
def damage(build: Build, shape: str, size: float) -> dict[str, float]:
    """e^{−r Λ} by all the way Λ that the probe has gone down below the first surface, where the pad is or not."""
    rate = 0.01 * size * spread(build.rng, 0.6, 1.6)

    def gain(t, x):
        depth = np.maximum(x, 0.0)
        return np.exp(-rate * np.cumsum(np.maximum(np.diff(depth, prepend=0.0), 0.0)))

    build.plant.gain.append(gain)
    return {"rate": rate}
