"""The eighth shapes: faults of the force channel.

Sources: diodes that clamp an input, whose voltage goes with the logarithm of the current (Shockley 1949; Horowitz and
Hill, The Art of Electronics); mobile telephones, which send for one of eight slots (GSM 05.02), and converters whose
coarse stage is caught between two levels (Kester, The Data Conversion Handbook: sparkle codes); wires that are broken
within their sheath and part where they are bent, and microwave ovens, which are heard on 2.4 GHz for a half of each
mains period (Kamerman and Erkoçevic 1997).
"""

from __future__ import annotations

import numpy as np
from scipy.special import wrightomega

from .registry import OUTLIERS, SATURATION, STUCK, Build, Samples, more_shapes

FRAME_S, SLOT_S = 4.615e-3, 0.577e-3
LEVEL_N = 50.0 / 64


def clamped(force_N: np.ndarray, limit_N: float, knee_N: float) -> np.ndarray:
    """y of F = y + w e^{(y − L)/w}: a resistor in front, and a diode that draws what is beyond the limit."""
    return force_N - knee_N * wrightomega((force_N - limit_N) / knee_N)


@more_shapes("saturation", "diode_clamp")
def saturation(build: Build, shape: str, size: float) -> dict[str, float]:
    """A diode clamps the input: beyond the limit by the logarithm alone, with a knee of 1 to 2 % of it."""
    share = max(1 - 0.2 * size * float(build.rng.uniform(0.8, 1.2)), 0.3)
    knee, told = float(build.rng.uniform(0.01, 0.02)), {"limit": float("nan")}

    def stage(samples: Samples, _: np.random.Generator) -> None:
        limit = told["limit"] = share * float(np.max(samples.clean_N))
        samples.flags["saturated"] = samples.force_N > limit
        samples.force_N, samples.clean_N = (clamped(f, limit, knee * limit) for f in (samples.force_N, samples.clean_N))

    build.samples.append((SATURATION, stage))
    return told


@more_shapes("outliers", "phone", "sparkle")
def outliers(build: Build, shape: str, size: float) -> dict[str, float]:
    """A telephone beside the cell: samples within its slot, 0.577 ms of 4.615, are off; or a code between two levels.

    `phone`: for 0.3 to 1.5 s at a time, by 25 to 60 deviations of the noise and one sign, rectified. `sparkle`: within
    a tenth of a level (50/64 N) of where two of the coarse levels meet, by 1, 2 or 4 levels, up or down.
    """
    wanted = 0.005 * size * float(build.rng.uniform(0.7, 1.4))
    begins, side = float(build.rng.uniform(0, 1)), float(build.rng.choice([-1.0, 1.0]))
    fraction = {"fraction": wanted}

    def stage(samples: Samples, rng: np.random.Generator) -> None:
        t, n, force = samples.time_s, len(samples.force_N), samples.force_N.copy()
        off, count = np.zeros(n), max(1, round(wanted * n))
        if shape == "sparkle":
            part = (force / LEVEL_N + begins) % 1
            near = np.flatnonzero(np.minimum(part, 1 - part) < 0.1)
            hit = rng.choice(near, min(count, len(near)), replace=False)
            off[hit] = rng.choice([-4, -2, -1, 1, 2, 4], len(hit)) * LEVEL_N
        while shape == "phone" and np.count_nonzero(off) < count:
            rings, lasts = rng.uniform(t[0], t[-1]), rng.uniform(0.3, 1.5)
            strong, slot = rng.uniform(30, 50), rng.uniform(0, FRAME_S)
            sent = (t >= rings) & (t < rings + lasts) & ((t - slot) % FRAME_S < SLOT_S) & (off == 0)
            hit = np.flatnonzero(sent)[: count - np.count_nonzero(off)]
            off[hit] = side * strong * rng.uniform(0.85, 1.2, len(hit)) * samples.noise_std_N
        samples.force_N = force + off
        samples.flags["outlier"] = off != 0
        fraction["fraction"] = float(np.mean(off != 0))

    build.samples.append((OUTLIERS, stage))
    return fraction


@more_shapes("stuck_samples", "flexed_cable", "oven")
def stuck_samples(build: Build, shape: str, size: float) -> dict[str, float]:
    """A broken wire parts where the cable is bent, each time the motor goes through a place; or an oven is on.

    `flexed_cable`: at 0.2 to 0.8 of the way, over as much of it as the fraction takes, but not more than a quarter to
    either side; it holds where the motor stands. `oven`: for 0.5 to 2 s at a time nothing comes through for 0.45 of
    each period of the mains.
    """
    share, place = 0.01 * size * float(build.rng.uniform(0.7, 1.4)), float(build.rng.uniform(0.2, 0.8))
    mains, phase = float(build.rng.choice([50.0, 60.0])), float(build.rng.uniform(0, 1))
    fraction, motion = {"fraction": share}, build.plant.motion

    def stage(samples: Samples, rng: np.random.Generator) -> None:
        t, n = samples.time_s, len(samples.force_N)
        stuck, wanted = np.zeros(n, dtype=bool), max(3, round(share * n))
        if shape == "flexed_cable":
            x, moves = motion.position(t), np.abs(motion.velocity(t)) > 1e-6
            far = np.where(moves, np.abs(x - place * x.max()) / x.max(), np.inf)
            far[0] = np.inf
            nearest = np.argsort(far, kind="stable")[:wanted]
            stuck[nearest[far[nearest] <= 0.25]] = True
        while shape == "oven" and stuck.sum() < wanted:
            begins, lasts = rng.uniform(t[1], t[-1]), rng.uniform(0.5, 2.0)
            deaf = (t >= begins) & (t < begins + lasts) & ((t * mains + phase) % 1 < 0.45) & ~stuck
            stuck[np.flatnonzero(deaf)[: wanted - int(stuck.sum())]] = True
        # The last value that came in is read until the next one.
        fresh = np.maximum.accumulate(np.where(stuck, 0, np.arange(n)))
        samples.force_N = samples.force_N[fresh]
        samples.flags["stuck"] = stuck
        fraction["fraction"] = float(np.mean(stuck))

    build.samples.append((STUCK, stage))
    return fraction
