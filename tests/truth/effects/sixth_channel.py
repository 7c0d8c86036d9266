"""The sixth shapes: faults of the force channel.

Sources: overload alarms with a hysteresis of their own (OIML R 76; Horowitz and Hill, The Art of Electronics);
sparks, whose wave rings (IEC 61000-4-2), and numbers sent as text or as two's complement that have lost their sign;
frames whose checksum fails while a drive switches (Ott, Electromagnetic Compatibility Engineering), and links that
try again after twice the time (Metcalfe and Boggs 1976).
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .registry import OUTLIERS, SATURATION, STUCK, Build, Samples, more_shapes


@njit(cache=True)
def _latched(force, high, low):
    """True from the first value above `high` to the first below `low`."""
    out, on = np.zeros(force.shape[0], dtype=np.bool_), False
    for k in range(force.shape[0]):
        on = force[k] > (low if on else high)
        out[k] = on
    return out


@more_shapes("saturation", "alarm")
def saturation(build: Build, shape: str, size: float) -> dict[str, float]:
    """Above the limit an alarm shows the limit, until the force is 3 to 8 % below it again."""
    share = max(1 - 0.2 * size * float(build.rng.uniform(0.8, 1.2)), 0.3)
    ends = 1 - float(build.rng.uniform(0.03, 0.08))
    told: dict[str, float] = {"limit": float("nan")}

    def stage(samples: Samples, _: np.random.Generator) -> None:
        limit = told["limit"] = share * float(np.max(samples.clean_N))
        held = _latched(samples.clean_N, limit, ends * limit)
        samples.flags["saturated"] = held | (samples.force_N > limit)
        samples.clean_N = np.where(held, limit, samples.clean_N)
        samples.force_N = np.where(held, limit, np.minimum(samples.force_N, limit))

    build.samples.append((SATURATION, stage))
    return told


@more_shapes("outliers", "rings", "lost_sign")
def outliers(build: Build, shape: str, size: float) -> dict[str, float]:
    """A spark that swings for three samples, each 0.7 of the last and the other way; or a number without its sign.

    `rings`: 50 to 120 deviations of the noise at first, so that the last is 24 or more. `lost_sign`: of samples at 20
    deviations or more; −F for F.
    """
    wanted = 0.005 * size * float(build.rng.uniform(0.7, 1.4))
    fraction = {"fraction": wanted}

    def stage(samples: Samples, rng: np.random.Generator) -> None:
        n, std = len(samples.force_N), samples.noise_std_N
        force, count = samples.force_N.copy(), max(1, round(wanted * n))
        if shape == "rings":
            first = 3 * rng.choice(n // 3, max(1, round(count / 3)), replace=False)
            spikes = rng.choice([-1.0, 1.0], len(first)) * rng.uniform(50, 120, len(first)) * std
            for k in range(3):
                force[first + k] += spikes * (-0.7) ** k
            hit = np.concatenate([first, first + 1, first + 2])
        else:
            told = np.flatnonzero(np.abs(samples.clean_N) > 20 * std)
            hit = rng.choice(told, min(count, len(told)), replace=False)
            force[hit] *= -1
        fraction["fraction"] = len(hit) / n
        samples.force_N = force
        samples.flags["outlier"] = np.zeros(n, dtype=bool)
        samples.flags["outlier"][hit] = True

    build.samples.append((OUTLIERS, stage))
    return fraction


@more_shapes("stuck_samples", "checksum", "backs_off")
def stuck_samples(build: Build, shape: str, size: float) -> dict[str, float]:
    """Frames are lost one by one, nearly all of them while the motor moves; or a link that tries again, ever later.

    `checksum`: at random, ten times as many as at rest. `backs_off`: 10 ms after its last try, then 20, 40, 80 and 160,
    with a sample for each that gets through, and is whole again after.
    """
    share = 0.01 * size * float(build.rng.uniform(0.7, 1.4))
    fraction, motion = {"fraction": share}, build.plant.motion

    def stage(samples: Samples, rng: np.random.Generator) -> None:
        n = len(samples.force_N)
        stuck, wanted = np.zeros(n, dtype=bool), max(3, round(share * n))
        if shape == "checksum":
            odds = np.where(np.abs(motion.velocity(samples.time_s)) > 1e-6, 1.0, 0.1)
            odds[0] = 0.0
            stuck[rng.choice(n, wanted, replace=False, p=odds / odds.sum())] = True
        waits = np.maximum((0.01 * 2.0 ** np.arange(5) * build.rate_hz).astype(int), 1)
        while shape == "backs_off" and stuck.sum() < wanted:
            at = int(rng.integers(1, max(n - waits.sum() - 6, 2)))
            for wait in waits:
                run = np.arange(at, min(at + wait, n))
                stuck[run[: max(wanted - int(stuck.sum()), 0)]] = True
                at += int(wait) + 1
        # The last value that came in is read until the next one.
        fresh = np.maximum.accumulate(np.where(stuck, 0, np.arange(n)))
        samples.force_N = samples.force_N[fresh]
        samples.flags["stuck"] = stuck
        fraction["fraction"] = float(np.mean(stuck))

    build.samples.append((STUCK, stage))
    return fraction
