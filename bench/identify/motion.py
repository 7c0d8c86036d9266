"""Where the motion holds still, and how noisy the reported position is; found in the data alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bench.recording.types import Measurement
from sim.jit import compiled

from ._kernel import Array

MIN_HOLD = 8  # samples
LONG = 600_000  # samples of a channel beyond which a run is worked on in blocks and at a glance
WINDOWS = 100_000  # that noise is judged on
ENOUGH = 1000  # samples that tell the level of a hold


def glanced(m: Measurement) -> Measurement:
    """Every so many samples of a long measurement, for what is asked of it as a whole."""
    p, f = (max(1, n // (LONG // 2)) for n in (len(m.position_time_s), len(m.force_time_s)))
    if p == f == 1:
        return m
    position, force = (m.position_time_s[::p], m.position_mm[::p]), (m.force_time_s[::f], m.force_N[::f])
    return replace(m, position_time_s=position[0], position_mm=position[1], force_time_s=force[0], force_N=force[1])


def jitter(position: Array) -> float:
    """Standard deviation of the position's noise, in its unit: local straight lines over six samples.

    The quietest quarter of the windows counts (25 % point of a χ² of 4 degrees: 1.923), so curved motion elsewhere
    does not. 0 where the position stands exactly still.
    """
    n = len(position) // 6
    if n < 4:
        return 0.0
    windows = position[: 6 * n].reshape(n, 6)[:: max(1, n // WINDOWS)]
    t = np.arange(6) - 2.5
    level = windows.mean(axis=1, keepdims=True)
    slope = (windows @ t / (t @ t))[:, None]
    squares = np.sum((windows - level - slope * t) ** 2, axis=1)
    return float(np.sqrt(np.quantile(squares, 0.25) / 1.923))


@compiled("int64[:, ::1](float64[::1], float64, int64)")
def _stretches(position: Array, tolerance: float, least: int) -> NDArray[np.int64]:
    n = position.shape[0]
    found = np.empty((n // least + 1, 2), dtype=np.int64)
    count, start = 0, 0
    while start < n:
        low = high = position[start]
        stop = start + 1
        while stop < n:
            low, high = min(low, position[stop]), max(high, position[stop])
            if high - low > tolerance:
                break
            stop += 1
        if stop - start >= least:
            found[count, 0], found[count, 1] = start, stop
            count += 1
            start = stop
        else:
            start += 1
    return found[:count]


def _level(position: Array) -> float:
    """Median; of a long stretch, of some thousand of its samples: a hold of minutes is put together from hundreds."""
    return float(np.median(position[:: max(1, len(position) // ENOUGH)]))


def holds(time_s: Array, position: Array, noise: float | None = None) -> list[slice]:
    """Stretches where the position stays put: at least eight samples within its noise (None: `jitter`), and no trend.

    A slow ramp also stays within a tolerance for a while; it is told by its two ends, which differ by more than
    the noise lets their means differ.
    """
    noise = jitter(position) if noise is None else noise
    reach = float(np.ptp(position))
    tolerance = max(8 * noise, 5e-4 * reach)
    out: list[slice] = []
    for start, stop in _stretches(np.ascontiguousarray(position), tolerance, MIN_HOLD):
        third = max((stop - start) // 3, 1)
        drift = abs(float(np.mean(position[start : start + third]) - np.mean(position[stop - third : stop])))
        steady = 4 * noise * np.sqrt(2 / third) + 0.15 * tolerance
        if drift > steady or time_s[stop - 1] <= time_s[start]:
            continue
        # Neighbours of one hold, cut where a drift or a jump of one noise width ran over the tolerance.
        if (
            out
            and out[-1].stop >= start - 1
            and abs(_level(position[out[-1]]) - _level(position[start:stop])) < tolerance
        ):
            out[-1] = slice(out[-1].start, int(stop))
        else:
            out.append(slice(int(start), int(stop)))
    return out


def turns(position: Array, least: float) -> list[int]:
    """First, last and turning samples; wiggles below `least` (> 0, in the unit of the position) are none."""
    out, best, way = [0], 0, 0
    for k in range(1, len(position)):
        if way == 0:
            if abs(position[k] - position[0]) >= least:
                way, best = (1 if position[k] > position[0] else -1), k
        elif way * (position[k] - position[best]) > 0:
            best = k
        elif way * (position[best] - position[k]) >= least:
            out.append(best)
            way, best = -way, k
    return [*out, len(position) - 1]
