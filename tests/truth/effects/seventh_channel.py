"""The seventh shapes: faults of the force channel.

Sources: amplifiers that clip at a supply which is not regulated (Horowitz and Hill, The Art of Electronics); words
whose bytes come in the wrong order (Cohen 1981), and pulses of fences or radars that come by the clock (CISPR 16);
loggers that write their whole file each time (Tanenbaum, Modern Operating Systems), and links that get worse as their
battery ends (Zhao and Govindan 2003).
"""

from __future__ import annotations

import numpy as np

from .registry import OUTLIERS, SATURATION, STUCK, Build, Samples, more_shapes


@more_shapes("saturation", "ripple")
def saturation(build: Build, shape: str, size: float) -> dict[str, float]:
    """A limit with a ripple of 2 to 5 % either way, at 100 or 120 Hz: |sin| less its mean; stated is its mean."""
    share = max(1 - 0.2 * size * float(build.rng.uniform(0.8, 1.2)), 0.3)
    ripple, mains = float(build.rng.uniform(0.02, 0.05)), float(build.rng.choice([50.0, 60.0]))
    phase, told = float(build.rng.uniform(0, 1)), {"limit": float("nan")}

    def stage(samples: Samples, _: np.random.Generator) -> None:
        limit = told["limit"] = share * float(np.max(samples.clean_N))
        wave = np.abs(np.sin(np.pi * (2 * mains * samples.time_s + phase))) - 2 / np.pi
        rail = limit * (1 + 2 * ripple * wave)
        samples.flags["saturated"] = samples.force_N > rail
        samples.force_N, samples.clean_N = np.minimum(samples.force_N, rail), np.minimum(samples.clean_N, rail)

    build.samples.append((SATURATION, stage))
    return told


def swapped(force_N: np.ndarray, full_N: float) -> np.ndarray:
    """A word of 16 bits, ± full_N, with its bytes in the wrong order."""
    words = np.clip(np.round(force_N / full_N * 32767), -32768, 32767).astype(np.int16)
    return words.byteswap() * full_N / 32767


@more_shapes("outliers", "swapped_bytes", "by_the_clock")
def outliers(build: Build, shape: str, size: float) -> dict[str, float]:
    """A word whose bytes are swapped, ± 50 N full; or a pulse of one sign that comes at even distances.

    `swapped_bytes`: of samples where that is off by 20 deviations of the noise or more. `by_the_clock`: 20 to 60
    deviations; the distance follows from the fraction.
    """
    wanted = 0.005 * size * float(build.rng.uniform(0.7, 1.4))
    side, begins = float(build.rng.choice([-1.0, 1.0])), float(build.rng.uniform(0.1, 0.9))
    fraction = {"fraction": wanted}

    def stage(samples: Samples, rng: np.random.Generator) -> None:
        n, force = len(samples.force_N), samples.force_N.copy()
        count = max(1, round(wanted * n))
        if shape == "by_the_clock":
            hit = np.floor((np.arange(count) + begins) * n / count).astype(int)
            force[hit] += side * rng.uniform(20, 60, len(hit)) * samples.noise_std_N
        else:
            read = swapped(force, 50.0)
            far = np.flatnonzero(np.abs(read - force) > 20 * samples.noise_std_N)
            hit = rng.choice(far, min(count, len(far)), replace=False)
            force[hit] = read[hit]
        fraction["fraction"] = len(hit) / n
        samples.force_N = force
        samples.flags["outlier"] = np.zeros(n, dtype=bool)
        samples.flags["outlier"][hit] = True

    build.samples.append((OUTLIERS, stage))
    return fraction


@more_shapes("stuck_samples", "file_grows", "battery")
def stuck_samples(build: Build, shape: str, size: float) -> dict[str, float]:
    """At even distances the logger writes its file anew, which takes longer each time; or a link that gets worse.

    `file_grows`: six to ten times, as 1, 2, 3 …. `battery`: short runs of one to four samples at random, whose number
    goes with the square of time.
    """
    share, times = 0.01 * size * float(build.rng.uniform(0.7, 1.4)), int(build.rng.integers(6, 11))
    fraction = {"fraction": share}

    def stage(samples: Samples, rng: np.random.Generator) -> None:
        n = len(samples.force_N)
        stuck, wanted = np.zeros(n, dtype=bool), max(3, round(share * n))
        if shape == "file_grows":
            lengths = wanted * np.arange(1, times + 1) / (times * (times + 1) / 2)
            for k, length in enumerate(np.diff(np.round(np.cumsum([0.0, *lengths])).astype(int))):
                begin = int((k + 0.7) * n / times)
                stuck[begin : begin + min(int(length), int(0.25 * n / times))] = True
        while shape == "battery" and stuck.sum() < wanted:
            begin, length = int(n * rng.random() ** (1 / 3)), int(rng.integers(1, 5))
            if begin > 0 and not stuck[max(begin - 1, 0) : begin + length + 1].any():
                stuck[begin : begin + min(length, wanted - int(stuck.sum()))] = True
        # The last value that came in is read until the next one.
        fresh = np.maximum.accumulate(np.where(stuck, 0, np.arange(n)))
        samples.force_N = samples.force_N[fresh]
        samples.flags["stuck"] = stuck
        fraction["fraction"] = float(np.mean(stuck))

    build.samples.append((STUCK, stage))
    return fraction
