"""Faults of the force channel: a range that ends, values that jump, values that stay.

Flags are set on the samples that are wrong. Sources: the usual fault classes of sensor data (Ni et al. 2009).
"""

from __future__ import annotations

import numpy as np

from .registry import OUTLIERS, SATURATION, STUCK, Build, Samples, effect


@effect("saturation", "hard", "soft")
def saturation(build: Build, shape: str, size: float) -> dict[str, float]:
    """Nothing above a limit: the typical one is 80 % of the greatest force; `soft` bends over the last 8 %."""
    share = max(1 - 0.2 * size * float(build.rng.uniform(0.8, 1.2)), 0.3)
    told: dict[str, float] = {"limit": float("nan")}

    def cap(force, limit):
        if shape == "hard":
            return np.minimum(force, limit)
        knee = 0.92 * limit
        bent = knee + (limit - knee) * np.tanh((force - knee) / (limit - knee))
        return np.where(force > knee, bent, force)

    def stage(samples: Samples, _: np.random.Generator) -> None:
        limit = told["limit"] = share * float(np.max(samples.clean_N))
        over = samples.force_N > limit
        samples.force_N, samples.clean_N = cap(samples.force_N, limit), cap(samples.clean_N, limit)
        samples.flags["saturated"] = over

    build.samples.append((SATURATION, stage))
    return told


@effect("outliers", "single", "bursts", "one_sided")
def outliers(build: Build, shape: str, size: float) -> dict[str, float]:
    """Samples off by 20 to 50 noise deviations."""
    fraction = 0.005 * size * float(build.rng.uniform(0.7, 1.4))

    def stage(samples: Samples, rng: np.random.Generator) -> None:
        n = len(samples.force_N)
        wanted = max(1, round(fraction * n))
        if shape == "bursts":
            starts = rng.choice(n - 4, max(1, round(wanted / 2.5)), replace=False)
            hit = np.unique(np.concatenate([s + np.arange(rng.integers(1, 5)) for s in starts]))
        else:
            hit = rng.choice(n, wanted, replace=False)
        sign = np.ones(len(hit)) if shape == "one_sided" else rng.choice([-1.0, 1.0], len(hit))
        samples.force_N = samples.force_N.copy()
        samples.force_N[hit] += sign * rng.uniform(20, 50, len(hit)) * samples.noise_std_N
        samples.flags["outlier"] = np.zeros(n, dtype=bool)
        samples.flags["outlier"][hit] = True

    build.samples.append((OUTLIERS, stage))
    return {"fraction": fraction}


@effect("stuck_samples", "short_runs", "long_runs", "single_repeats")
def stuck_samples(build: Build, shape: str, size: float) -> dict[str, float]:
    """The last value comes again: runs of 3–20, of a tenth of a second to a second, or once."""
    fraction = 0.01 * size * float(build.rng.uniform(0.7, 1.4))

    def stage(samples: Samples, rng: np.random.Generator) -> None:
        n = len(samples.force_N)
        stuck = np.zeros(n, dtype=bool)
        force = samples.force_N.copy()
        wanted = max(3, round(fraction * n))
        while stuck.sum() < wanted:
            if shape == "single_repeats":
                length = 1
            elif shape == "short_runs":
                length = int(rng.integers(3, 21))
            else:
                length = max(5, int(rng.uniform(0.1, 1.0) * build.rate_hz))
            length = min(length, wanted - int(stuck.sum()))
            start = int(rng.integers(1, n - length))
            if stuck[start - 1 : start + length + 1].any():
                continue
            force[start : start + length] = force[start - 1]
            stuck[start : start + length] = True
        samples.force_N = force
        samples.flags["stuck"] = stuck

    build.samples.append((STUCK, stage))
    return {"fraction": fraction}
