"""The ninth shapes: faults of the force channel.

Sources: the foldback current limiting of voltage regulators, of outputs that fall again under overload; J. C. R.
Bennett, C. Partridge and N. Shectman, Packet reordering is not pathological network behavior, IEEE/ACM Trans. Netw. 7
(1999) 789, of what comes in too late; C. E. R. Bruce and R. H. Golde, The lightning discharge, J. IEE 88 (1941) 487,
whose two exponentials are taken for surges; M. H. J. Bollen, Understanding Power Quality Problems (2000), of supplies
that dip where a motor draws most; N. Golmie, R. E. Van Dyck, A. Soltanian, A. Tonnerre and O. Rébala, Interference
evaluation of Bluetooth and IEEE 802.11b systems, Wirel. Netw. 9 (2003) 201, of packets that are lost as a whole.
"""

from __future__ import annotations

import numpy as np

from .registry import OUTLIERS, SATURATION, STUCK, Build, Samples, more_shapes


@more_shapes("saturation", "folds_back")
def saturation(build: Build, shape: str, size: float) -> dict[str, float]:
    """Beyond the limit the output falls again, by 0.08 to 0.25 of what is too much."""
    share = max(1 - 0.2 * size * float(build.rng.uniform(0.8, 1.2)), 0.3)
    falls, told = float(build.rng.uniform(0.08, 0.25)), {"limit": float("nan")}

    def stage(samples: Samples, _: np.random.Generator) -> None:
        limit = told["limit"] = share * float(np.max(samples.clean_N))
        samples.flags["saturated"] = samples.force_N > limit
        samples.force_N, samples.clean_N = (
            np.where(force > limit, limit - falls * (force - limit), force)
            for force in (samples.force_N, samples.clean_N)
        )

    build.samples.append((SATURATION, stage))
    return told


def impulse(time_s: np.ndarray, falls_s: float) -> np.ndarray:
    """e^{−s/τ} − e^{−10 s/τ} over its greatest value; nothing before s = 0."""
    most = 0.1 ** (1 / 9) - 0.1 ** (10 / 9)
    since = np.maximum(time_s, 0.0) / falls_s
    return (np.exp(-since) - np.exp(-10 * since)) / most


@more_shapes("outliers", "stale", "surges")
def outliers(build: Build, shape: str, size: float) -> dict[str, float]:
    """A value from the turn of the buffer before; or surges, which rise at once and fall within some milliseconds.

    `stale`: all as old, 0.2 to 1.5 s; of samples where that is off by 20 deviations of the noise or more. `surges`: 50
    to 150 deviations at the top, either sign, as long as they are above 15; τ of 3 to 10 ms.
    """
    wanted = 0.005 * size * float(build.rng.uniform(0.7, 1.4))
    age_s, falls_s = float(build.rng.uniform(0.2, 1.5)), float(build.rng.uniform(0.003, 0.01))
    fraction = {"fraction": wanted}

    def stage(samples: Samples, rng: np.random.Generator) -> None:
        t, n, std = samples.time_s, len(samples.force_N), samples.noise_std_N
        off, count = np.zeros(n), max(1, round(wanted * n))
        if shape == "stale":
            age = min(max(round(age_s * build.rate_hz), 1), n // 4)
            older = np.zeros(n)
            older[age:] = samples.force_N[:-age] - samples.force_N[age:]
            far = np.flatnonzero(np.abs(older) > 20 * std)
            hit = rng.choice(far, min(count, len(far)), replace=False)
            off[hit] = older[hit]
        while shape == "surges" and np.count_nonzero(off) < count:
            top = rng.choice([-1.0, 1.0]) * rng.uniform(50, 150)
            wave = top * impulse(t - rng.uniform(t[0], t[-1]), falls_s)
            hit = np.flatnonzero((np.abs(wave) > 15) & (off == 0))[: count - np.count_nonzero(off)]
            off[hit] = wave[hit] * std
        samples.force_N = samples.force_N + off
        samples.flags["outlier"] = off != 0
        fraction["fraction"] = float(np.mean(off != 0))

    build.samples.append((OUTLIERS, stage))
    return fraction


def resets(power: np.ndarray, level: float, length: int) -> np.ndarray:
    """Beginnings of the runs of `length` samples in which it starts anew: wherever the power is above a level."""
    above, begins, k = np.flatnonzero(power > level), [], 0
    above = above[above > 0]
    while k < len(above):
        begins.append(above[k])
        k = int(np.searchsorted(above, above[k] + length))
    return np.array(begins, dtype=int)


@more_shapes("stuck_samples", "supply_dips", "lost_packets")
def stuck_samples(build: Build, shape: str, size: float) -> dict[str, float]:
    """The supply dips where the motor draws most, and the converter starts anew; or whole packets are lost.

    `supply_dips`: where force times speed is above 0.1 to 0.3 of its greatest, each time for as long, which follows
    from the fraction, 0.15 s at most. `lost_packets`: of 6 to 24 samples, at random, and the next one begins where the
    last one ends.
    """
    share, least = 0.01 * size * float(build.rng.uniform(0.7, 1.4)), float(build.rng.uniform(0.1, 0.3))
    packet, fraction, motion = int(build.rng.integers(6, 25)), {"fraction": share}, build.plant.motion

    def stage(samples: Samples, rng: np.random.Generator) -> None:
        n = len(samples.force_N)
        stuck, wanted = np.zeros(n, dtype=bool), max(3, round(share * n))
        if shape == "supply_dips":
            power = np.maximum(samples.clean_N * motion.velocity(samples.time_s), 0.0)
            level, low, high = least * float(np.max(power)), 2, max(2, int(0.15 * build.rate_hz))
            while low < high:
                length = (low + high) // 2
                enough = len(resets(power, level, length)) * length >= wanted
                low, high = (low, length) if enough else (length + 1, high)
            where = (resets(power, level, low)[:, None] + np.arange(low)).ravel()
            stuck[where[where < n][:wanted]] = True
        else:
            long = min(packet, wanted)
            begins = rng.permutation(np.arange(int(rng.integers(1, long + 1)), n - long, long))
            where = (begins[:, None] + np.arange(long)).ravel()
            stuck[where[:wanted]] = True
        # The last value that came in is read until the next one.
        fresh = np.maximum.accumulate(np.where(stuck, 0, np.arange(n)))
        samples.force_N = samples.force_N[fresh]
        samples.flags["stuck"] = stuck
        fraction["fraction"] = float(np.mean(stuck))

    build.samples.append((STUCK, stage))
    return fraction
