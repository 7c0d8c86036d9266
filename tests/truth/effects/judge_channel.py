"""The judge's shapes: faults of the force channel.

Sources: D. Giannoulis, M. Massberg and J. D. Reiss, Digital dynamic range compressor design, J. Audio Eng. Soc. 60
(2012) 399, of limiters that turn the gain down and let it come back; L. Lamport, Concurrent reading and writing,
Commun. ACM 20 (1977) 806, of words that are read while they are written; J. Elliott, M. Hoemmen and F. Mueller,
Exploiting data representation for fault tolerance, J. Comput. Sci. 14 (2016) 51, of bits that flip in floating numbers;
R. H. Clarke, A statistical theory of mobile-radio reception, Bell Syst. Tech. J. 47 (1968) 957, and S. O. Rice,
Statistical properties of a sine wave plus random noise, Bell Syst. Tech. J. 27 (1948) 109, of waves that fade; C. L.
Liu and J. W. Layland, Scheduling algorithms for multiprogramming in a hard-real-time environment, J. ACM 20 (1973) 46,
of tasks that go first.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .registry import OUTLIERS, SATURATION, STUCK, Build, Samples, judge_shapes

COUNT_N = 0.002
BYTE_N = 256 * COUNT_N
#: Of a float of 32 bits: its sign, the lower three bits of the exponent, the upper four of the mantissa.
BITS = (31, 25, 24, 23, 22, 21, 20, 19)


@njit(cache=True)
def turned_down(time_s, force_N, limit_N, release_s):
    """Gain: L/F at once where it would be more than L, and back towards 1 within the time of release."""
    out, gain = np.ones(force_N.shape[0]), 1.0
    for k in range(force_N.shape[0]):
        if k > 0:
            gain = 1 + (gain - 1) * np.exp((time_s[k - 1] - time_s[k]) / release_s)
        if gain * force_N[k] > limit_N:
            gain = limit_N / force_N[k]
        out[k] = gain
    return out


@judge_shapes("saturation", "limiter")
def saturation(build: Build, shape: str, size: float) -> dict[str, float]:
    """A limiter turns the gain down so that nothing is above the limit; it comes back within 30 to 150 ms, or more.

    Flagged is what is too small by a hundredth or more.
    """
    share = max(1 - 0.2 * size * float(build.rng.uniform(0.8, 1.2)), 0.3)
    release_s, told = float(build.rng.uniform(0.03, 0.15)), {"limit": float("nan")}

    def stage(samples: Samples, _: np.random.Generator) -> None:
        limit = told["limit"] = share * float(np.max(samples.clean_N))
        gain = turned_down(samples.time_s, samples.force_N, limit, release_s)
        samples.flags["saturated"] = gain < 0.99
        samples.force_N = samples.force_N * gain
        samples.clean_N = samples.clean_N * turned_down(samples.time_s, samples.clean_N, limit, release_s)

    build.samples.append((SATURATION, stage))
    return told


def torn(force_N: np.ndarray) -> np.ndarray:
    """By how much a word is off whose upper byte is that of the value before; nothing at first."""
    upper = np.floor(np.round(force_N / COUNT_N) / 256)
    return np.diff(upper, prepend=upper[0]) * -BYTE_N


def flipped(force_N: np.ndarray, bit: np.ndarray) -> np.ndarray:
    """Floats of 32 bits with one of them turned over."""
    words = force_N.astype(np.float32).view(np.uint32)
    return (words ^ np.left_shift(np.uint32(1), bit.astype(np.uint32))).view(np.float32).astype(float)


@judge_shapes("outliers", "torn_word", "float_bit")
def outliers(build: Build, shape: str, size: float) -> dict[str, float]:
    """A word read as it is written, its upper byte still of the value before; or a bit of a float that flips.

    `torn_word`: counts of 2 mN, so that it is off by 0.512 N, to the side it comes from, or by more if it went further.
    `float_bit`: one of eight that matter; of samples where that is 20 deviations of the noise or more, and no more than
    a cell's 50 N.
    """
    wanted, fraction = 0.005 * size * float(build.rng.uniform(0.7, 1.4)), {"fraction": float("nan")}

    def stage(samples: Samples, rng: np.random.Generator) -> None:
        force, n = samples.force_N, len(samples.force_N)
        if shape == "torn_word":
            fault = torn(force)
            able = np.flatnonzero(fault)
        else:
            read = flipped(force, rng.choice(BITS, n))
            fault = read - force
            able = np.flatnonzero((np.abs(fault) > 20 * samples.noise_std_N) & (np.abs(read) < 50))
        hit = rng.choice(able, min(max(1, round(wanted * n)), len(able)), replace=False)
        off = np.zeros(n)
        off[hit] = fault[hit]
        samples.force_N = force + off
        samples.flags["outlier"] = off != 0
        fraction["fraction"] = float(np.mean(off != 0))

    build.samples.append((OUTLIERS, stage))
    return fraction


def busy(time_s: np.ndarray, asked_s: np.ndarray, takes_s: np.ndarray) -> np.ndarray:
    """Whether a processor is at work for others, each of whom asks at some time and takes a while; the late wait."""
    order = np.argsort(asked_s, kind="stable")
    out, free_s = np.zeros(len(time_s), dtype=bool), -np.inf
    for at, takes in zip(asked_s[order], takes_s[order], strict=True):
        begins = max(at, free_s)
        free_s = begins + takes
        out[np.searchsorted(time_s, begins) : np.searchsorted(time_s, free_s)] = True
    return out


def envelope(time_s: np.ndarray, doppler_hz: float, rng: np.random.Generator, waves: int = 32) -> np.ndarray:
    """Of waves that come from all sides to one that moves: |Σ e^{i (2π f cos α t + φ)}|, its mean square 1."""
    shifts = 2 * np.pi * doppler_hz * np.cos(rng.uniform(0, 2 * np.pi, waves))
    phases = rng.uniform(0, 2 * np.pi, waves)
    total = np.zeros(len(time_s), dtype=complex)
    for shift, phase in zip(shifts, phases, strict=True):
        total += np.exp(1j * (shift * time_s + phase))
    return np.abs(total) / np.sqrt(waves)


@judge_shapes("stuck_samples", "fading", "two_tasks")
def stuck_samples(build: Build, shape: str, size: float) -> dict[str, float]:
    """A radio whose waves fade as somebody walks about; or two tasks that go before the reader's, each at its own rate.

    `fading`: nothing comes through while the envelope is below a level; 2 to 8 Hz at the most. `two_tasks`: every 0.6
    to 1.2 s, and 1.3 to 1.9 times that; each takes half of the fraction, and where both ask one waits for the other.
    """
    share, doppler = 0.01 * size * float(build.rng.uniform(0.7, 1.4)), float(build.rng.uniform(2.0, 8.0))
    period, ratio = float(build.rng.uniform(0.6, 1.2)), float(build.rng.uniform(1.3, 1.9))
    late, fraction = build.rng.uniform(0, 1, 2), {"fraction": share}

    def stage(samples: Samples, rng: np.random.Generator) -> None:
        t, n = samples.time_s, len(samples.force_N)
        wanted = max(3, round(share * n))
        if shape == "fading":
            faint = envelope(t, doppler, rng)
            faint[0] = np.inf
            stuck = faint <= np.partition(faint, wanted - 1)[wanted - 1]
        else:
            periods = period * np.array([1.0, ratio])
            asked = [np.arange(first, t[-1], every) for first, every in zip(late * periods, periods, strict=True)]
            takes = np.concatenate([np.full(len(a), p / 2) for a, p in zip(asked, periods, strict=True)])
            used, stuck = max(share, 3 / n), np.zeros(n, dtype=bool)
            # Few samples are met by what is short.
            while np.count_nonzero(stuck) < 3:
                stuck = busy(t, np.concatenate(asked), used * takes)
                stuck[0] = False
                used *= 1.2
        # The last value that came in is read until the next one.
        samples.force_N = samples.force_N[np.maximum.accumulate(np.where(stuck, 0, np.arange(n)))]
        samples.flags["stuck"] = stuck
        fraction["fraction"] = float(np.mean(stuck))

    build.samples.append((STUCK, stage))
    return fraction
