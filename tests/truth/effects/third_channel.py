"""Third shapes of the faults of the force channel.

Sources: supplies that sag under a long overload; heavy tails (Pareto 1896) of impulsive interference (Middleton 1977);
frames lost on a bus and read as nothing; converters that fall back to half their rate, and masters that are busy while
the drive moves.
"""

from __future__ import annotations

import numpy as np

from .registry import OUTLIERS, SATURATION, STUCK, Build, Samples, more_shapes


@more_shapes("saturation", "sags")
def sags(build: Build, shape: str, size: float) -> dict[str, float]:
    """The rail gives way by 3 % the longer it bears, within 0.2 to 1 s, and is whole again after; stated: at first."""
    share = max(1 - 0.2 * size * float(build.rng.uniform(0.8, 1.2)), 0.3)
    gives_s = float(build.rng.uniform(0.2, 1.0))
    told: dict[str, float] = {"limit": float("nan")}

    def stage(samples: Samples, _: np.random.Generator) -> None:
        limit = told["limit"] = share * float(np.max(samples.clean_N))
        t, within = samples.time_s, samples.clean_N <= limit
        # Time since the force was last within the range; samples may be a little out of order where they jitter.
        last = np.maximum.accumulate(np.where(within, t, t[0]))
        rail = limit * (1 - 0.03 * -np.expm1(-np.maximum(t - last, 0.0) / gives_s))
        samples.flags["saturated"] = samples.force_N > rail
        samples.force_N, samples.clean_N = np.minimum(samples.force_N, rail), np.minimum(samples.clean_N, rail)

    build.samples.append((SATURATION, stage))
    return told


@more_shapes("outliers", "pareto", "dropouts")
def outliers(build: Build, shape: str, size: float) -> dict[str, float]:
    """15 deviations of the noise or more, with a tail of x^{−1.5} up to 1000; or samples under load that read zero.

    What is lost in air cannot be told from air: `dropouts` are those at 20 deviations or more.
    """
    wanted = 0.005 * size * float(build.rng.uniform(0.7, 1.4))
    fraction = {"fraction": wanted}

    def stage(samples: Samples, rng: np.random.Generator) -> None:
        n, std = len(samples.force_N), samples.noise_std_N
        told = np.arange(n) if shape == "pareto" else np.flatnonzero(np.abs(samples.clean_N) > 20 * std)
        hit = rng.choice(told, min(max(1, round(wanted * n)), len(told)), replace=False)
        fraction["fraction"] = len(hit) / n
        force = samples.force_N.copy()
        if shape == "pareto":
            sizes = np.minimum(15 * (1 + rng.pareto(1.5, len(hit))), 1000)
            force[hit] += rng.choice([-1.0, 1.0], len(hit)) * sizes * std
        else:
            force[hit] = 0.0
        samples.force_N = force
        samples.flags["outlier"] = np.zeros(n, dtype=bool)
        samples.flags["outlier"][hit] = True

    build.samples.append((OUTLIERS, stage))
    return fraction


@more_shapes("stuck_samples", "half_rate", "busy")
def stuck_samples(build: Build, shape: str, size: float) -> dict[str, float]:
    """Stretches of 0.2 to 1 s in which each value comes twice; or values that stay as a motion begins, 5 to 30 ms."""
    share = 0.01 * size * float(build.rng.uniform(0.7, 1.4))
    fraction, motion = {"fraction": share}, build.plant.motion

    def runs(samples: Samples, rng: np.random.Generator, wanted: int):
        n = len(samples.force_N)
        if shape == "half_rate":
            while True:
                length = min(2 * wanted, int(rng.uniform(0.2, 1.0) * build.rate_hz), n - 3)
                yield int(rng.integers(1, n - length)) + np.arange(0, length, 2)
        at = motion.breaks_s[:-1]
        begins = at[(np.abs(motion.velocity(at + 1e-4)) > 0) & (np.abs(motion.velocity(at - 1e-4)) == 0)]
        # One run for each motion, in any order; longer ones where that is not enough.
        for least_s, most_s in ((0.005, 0.03), (0.03, 0.1), (0.1, 0.3)):
            for time_s in rng.permutation(begins):
                start = max(int(np.searchsorted(samples.time_s, time_s)), 1)
                length = max(2, int(rng.uniform(least_s, most_s) * build.rate_hz))
                yield np.arange(start, min(start + length, n))

    def stage(samples: Samples, rng: np.random.Generator) -> None:
        stuck = np.zeros(len(samples.force_N), dtype=bool)
        wanted = max(3, round(share * len(stuck)))
        for run in runs(samples, rng, wanted):
            stuck[run[: max(wanted - int(stuck.sum()), 0)]] = True
            if stuck.sum() >= wanted:
                break
        # The last value that came in is read until the next one.
        fresh = np.maximum.accumulate(np.where(stuck, 0, np.arange(len(stuck))))
        samples.force_N = samples.force_N[fresh]
        samples.flags["stuck"] = stuck
        fraction["fraction"] = float(np.mean(stuck))

    build.samples.append((STUCK, stage))
    return fraction
