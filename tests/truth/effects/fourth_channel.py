"""The fourth shapes: faults of the force channel.

Sources: overload stops of load cells, which take what goes beyond (Doebelin, Measurement Systems); fast transients that
swing to the other side (IEC 61000-4-4) and those of drives that are switched on and off (Ott, Electromagnetic
Compatibility Engineering); a number sent as text that has lost a character; a channel with a good and a bad state
(Gilbert 1960, Elliott 1963); converters that calibrate themselves at intervals, and send nothing new meanwhile.
"""

from __future__ import annotations

import numpy as np

from .registry import OUTLIERS, SATURATION, STUCK, Build, Samples, more_shapes


@more_shapes("saturation", "overload_stop")
def overload_stop(build: Build, shape: str, size: float) -> dict[str, float]:
    """Beyond the limit a stop bears with the cell, which feels 2 to 6 % of what is more."""
    share = max(1 - 0.2 * size * float(build.rng.uniform(0.8, 1.2)), 0.3)
    passes = float(build.rng.uniform(0.02, 0.06))
    told: dict[str, float] = {"limit": float("nan")}

    def stage(samples: Samples, _: np.random.Generator) -> None:
        limit = told["limit"] = share * float(np.max(samples.clean_N))
        over = samples.clean_N > limit
        lost = np.where(over, (1 - passes) * (samples.clean_N - limit), 0.0)
        samples.flags["saturated"] = over
        samples.force_N, samples.clean_N = samples.force_N - lost, samples.clean_N - lost

    build.samples.append((SATURATION, stage))
    return told


def _near_switching(build: Build, time_s: np.ndarray) -> np.ndarray:
    """Samples within 20 ms after a motion begins or ends."""
    motion = build.plant.motion
    at = motion.breaks_s
    switched = at[(np.abs(motion.velocity(at + 1e-4)) > 0) != (np.abs(motion.velocity(at - 1e-4)) > 0)]
    last = np.searchsorted(switched, time_s, side="right") - 1
    return np.flatnonzero((last >= 0) & (time_s - switched[np.maximum(last, 0)] < 0.02))


@more_shapes("outliers", "doublets", "switching", "lost_character")
def outliers(build: Build, shape: str, size: float) -> dict[str, float]:
    """Pairs of one sign and the other; spikes where the motor is switched on or off; numbers ten times too small.

    `doublets`: 20 to 50 deviations of the noise, then 0.5 to 0.9 of that the other way. `switching`: 20 to 60, within
    20 ms of a start or stop. `lost_character`: of samples at 25 deviations or more; near nothing a tenth is no fault.
    """
    wanted = 0.005 * size * float(build.rng.uniform(0.7, 1.4))
    fraction = {"fraction": wanted}

    def stage(samples: Samples, rng: np.random.Generator) -> None:
        n, std = len(samples.force_N), samples.noise_std_N
        force, count = samples.force_N.copy(), max(1, round(wanted * n))
        if shape == "doublets":
            first = 2 * rng.choice(n // 2, max(1, round(count / 2)), replace=False)
            spikes = rng.choice([-1.0, 1.0], len(first)) * rng.uniform(20, 50, len(first)) * std
            force[first] += spikes
            force[first + 1] -= spikes * np.maximum(rng.uniform(0.5, 0.9, len(first)), 15 * std / np.abs(spikes))
            hit = np.concatenate([first, first + 1])
        elif shape == "switching":
            near = _near_switching(build, samples.time_s)
            hit = rng.choice(near, min(count, len(near)), replace=False)
            force[hit] += rng.choice([-1.0, 1.0], len(hit)) * rng.uniform(20, 60, len(hit)) * std
        else:
            told = np.flatnonzero(np.abs(samples.clean_N) > 25 * std)
            hit = rng.choice(told, min(count, len(told)), replace=False)
            force[hit] /= 10
        fraction["fraction"] = len(hit) / n
        samples.force_N = force
        samples.flags["outlier"] = np.zeros(n, dtype=bool)
        samples.flags["outlier"][hit] = True

    build.samples.append((OUTLIERS, stage))
    return fraction


@more_shapes("stuck_samples", "bad_state", "self_calibration")
def stuck_samples(build: Build, shape: str, size: float) -> dict[str, float]:
    """Times of 0.1 to 0.6 s in which two samples of three are lost; or 10 to 25 ms without news every second or
    three.

    `self_calibration`: of even length and distance; the distance follows from the fraction.
    """
    share = 0.01 * size * float(build.rng.uniform(0.7, 1.4))
    fraction, length_s = {"fraction": share}, float(build.rng.uniform(0.01, 0.025))

    def stage(samples: Samples, rng: np.random.Generator) -> None:
        n = len(samples.force_N)
        stuck = np.zeros(n, dtype=bool)
        wanted = max(3, round(share * n))
        if shape == "self_calibration":
            length = max(2, round(length_s * build.rate_hz))
            every = max(int(length * n / wanted), 2 * length)
            begins = np.arange(int(rng.integers(1, every)), n, every)
            where = (begins[:, None] + np.arange(length)).ravel()
            stuck[where[where < n]] = True
        while shape == "bad_state" and stuck.sum() < wanted:
            length = max(3, int(rng.uniform(0.1, 0.6) * build.rate_hz))
            start = int(rng.integers(1, n - length))
            lost = start + np.flatnonzero(rng.random(length) < 2 / 3)
            stuck[lost[: wanted - int(stuck.sum())]] = True
        # The last value that came in is read until the next one.
        fresh = np.maximum.accumulate(np.where(stuck, 0, np.arange(n)))
        samples.force_N = samples.force_N[fresh]
        samples.flags["stuck"] = stuck
        fraction["fraction"] = float(np.mean(stuck))

    build.samples.append((STUCK, stage))
    return fraction
