"""The tenth shapes of what lies between the motor and the pad.

Sources: J. F. Archard, Contact and rubbing of flat surfaces, J. Appl. Phys. 24 (1953) 981: wear grows with load and
way, so that a screw that is used in one place is worn there alone; J. F. Gieras, Z. J. Piech and B. Z. Tomczuk, Linear
Synchronous Motors (2012), end effects.
"""

from __future__ import annotations

import numpy as np

from .registry import Build, more_shapes, spread
from .third_machine import _worn


@more_shapes("backlash", "worn_spot")
def backlash(build: Build, shape: str, size: float) -> dict[str, float]:
    """Twice to three times as wide about one place as elsewhere, by a raised cosine of a fifth to two fifths of the
    depth to either side; stated is the width elsewhere."""
    rng, depth = build.rng, build.depth_mm
    gap, more = 0.012 * size * spread(rng, 0.7, 1.4), float(rng.uniform(1.0, 2.0))
    at, reach = float(rng.uniform(0.3, 0.7)) * depth, float(rng.uniform(0.2, 0.4)) * depth

    def width(x):
        off = np.clip((x - at) / reach, -1.0, 1.0)
        return gap * (1 + more * 0.5 * (1 + np.cos(np.pi * off)))

    build.plant.play.append(lambda t, x: _worn(x, width(x)))
    return {"gap": gap}


@more_shapes("cogging", "end_of_row")
def cogging(build: Build, shape: str, size: float) -> dict[str, float]:
    """A sine with a second and a third harmonic, e^{g (x/D − ½)} with g of 0.4 to 0.8 or its negative along the way;
    stated is the sine's amplitude in the middle."""
    rng, depth = build.rng, build.depth_mm
    amplitude, period = 0.05 * size * spread(rng, 0.7, 1.4), float(rng.uniform(0.25, 0.5)) * depth
    harmonics = [1.0, float(rng.uniform(0.3, 0.5)), float(rng.uniform(0.2, 0.4))]
    angles, grows = rng.uniform(-np.pi, np.pi, 3), float(rng.uniform(0.4, 0.8)) * float(rng.choice([-1.0, 1.0]))

    def force(t, x, v, a):
        theta = 2 * np.pi * x / period
        wave = sum(r * np.sin((k + 1) * theta + angles[k]) for k, r in enumerate(harmonics))
        return amplitude * np.exp(grows * (x / depth - 0.5)) * wave

    build.plant.felt.append(force)
    return {"amplitude": amplitude, "period": period, "phase": float(angles[0])}
