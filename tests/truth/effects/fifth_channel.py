"""The fifth shapes: faults of the force channel.

Sources: power amplifiers that bend towards their limit (Rapp 1991); transmitters that send a fixed code where they find
themselves at fault (NAMUR NE 43), and multiplexers that give the neighbour's value (Horowitz and Hill, The Art of
Electronics); relays that take their time to change a range, meanwhile the last value is held (HP 3458A, user's guide);
waits with a heavy tail (Leland, Taqqu, Willinger and Wilson 1994).
"""

from __future__ import annotations

import numpy as np

from .registry import OUTLIERS, SATURATION, STUCK, Build, Samples, more_shapes


@more_shapes("saturation", "rapp")
def saturation(build: Build, shape: str, size: float) -> dict[str, float]:
    """F/(1 + (F/L)^{2p})^{1/2p}, p of 6 to 12: nearly straight up to nine tenths of the limit L, and never above it."""
    share = max(1 - 0.2 * size * float(build.rng.uniform(0.8, 1.2)), 0.3)
    sharp = float(build.rng.uniform(6.0, 12.0))
    told: dict[str, float] = {"limit": float("nan")}

    def stage(samples: Samples, _: np.random.Generator) -> None:
        limit = told["limit"] = share * float(np.max(samples.clean_N))

        def bent(force):
            return force / (1 + (np.maximum(force, 0.0) / limit) ** (2 * sharp)) ** (0.5 / sharp)

        samples.flags["saturated"] = samples.force_N > limit
        samples.force_N, samples.clean_N = bent(samples.force_N), bent(samples.clean_N)

    build.samples.append((SATURATION, stage))
    return told


@more_shapes("outliers", "error_code", "neighbour")
def outliers(build: Build, shape: str, size: float) -> dict[str, float]:
    """A fixed value beyond the range, whichever the force; or the value of the channel beside it, the position.

    `error_code`: 1.2 to 1.6 times the greatest force, to one side or the other. `neighbour`: a mm is taken for a N;
    of samples where that is off by 20 deviations of the noise or more.
    """
    wanted = 0.005 * size * float(build.rng.uniform(0.7, 1.4))
    code_N = float(build.rng.choice([-1.0, 1.0]) * build.rng.uniform(1.2, 1.6)) * build.force_N
    fraction, motion = {"fraction": wanted}, build.plant.motion

    def stage(samples: Samples, rng: np.random.Generator) -> None:
        n = len(samples.force_N)
        read = np.full(n, code_N) if shape == "error_code" else motion.position(samples.time_s)
        far = np.flatnonzero(np.abs(read - samples.force_N) > 20 * samples.noise_std_N)
        hit = rng.choice(far, min(max(1, round(wanted * n)), len(far)), replace=False)
        fraction["fraction"] = len(hit) / n
        samples.force_N = samples.force_N.copy()
        samples.force_N[hit] = read[hit]
        samples.flags["outlier"] = np.zeros(n, dtype=bool)
        samples.flags["outlier"][hit] = True

    build.samples.append((OUTLIERS, stage))
    return fraction


@more_shapes("stuck_samples", "range_relay", "heavy_tail")
def stuck_samples(build: Build, shape: str, size: float) -> dict[str, float]:
    """A relay changes the range each time the force goes through a level; or waits of two samples to a second.

    `range_relay`: at 0.2 to 0.3 and 0.55 to 0.75 of the greatest force, for a time that follows from the fraction,
    0.1 s at most. `heavy_tail`: the chance to last longer than n samples goes with 1/n.
    """
    share = 0.01 * size * float(build.rng.uniform(0.7, 1.4))
    levels = build.rng.uniform([0.2, 0.55], [0.3, 0.75])
    fraction = {"fraction": share}

    def stage(samples: Samples, rng: np.random.Generator) -> None:
        n = len(samples.force_N)
        stuck, wanted = np.zeros(n, dtype=bool), max(3, round(share * n))
        if shape == "range_relay":
            upper = np.sum(samples.clean_N[:, None] > levels * np.max(samples.clean_N), axis=1)
            begins = np.flatnonzero(np.diff(upper) != 0) + 1
            length = int(np.clip(np.ceil(wanted / max(len(begins), 1)), 2, max(2, 0.1 * build.rate_hz)))
            # Where there are fewer samples than changes of the range, not all of them cost one.
            for start in rng.permutation(begins)[: max(wanted // length, 1)]:
                stuck[start : start + length] = True
        while shape == "heavy_tail" and stuck.sum() < wanted:
            length = int(min(2 / rng.uniform(1e-9, 1.0), build.rate_hz, n / 4))
            start = int(rng.integers(1, n - length))
            if not stuck[start - 1 : start + length + 1].any():
                stuck[start : start + min(length, wanted - int(stuck.sum()))] = True
        # The last value that came in is read until the next one.
        fresh = np.maximum.accumulate(np.where(stuck, 0, np.arange(n)))
        samples.force_N = samples.force_N[fresh]
        samples.flags["stuck"] = stuck
        fraction["fraction"] = float(np.mean(stuck))

    build.samples.append((STUCK, stage))
    return fraction
