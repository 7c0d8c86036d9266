"""Structure tests on what is left: averages of the residual that noise would not make, corrected for their number."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2 as chi2_law

from bench.identify.motion import holds

from .data import Data
from .result import Remainder
from .swing import Swing

Array = NDArray[np.float64]

FEWEST = 60  # samples that a test is made on
TIMES = 3.0  # the noise's power: in a campaign no model that lacks nothing left 1.3 times
LEVEL = 0.01
LEAST = 8  # samples of a group
CRUMB = 0.002
SENTENCES = {
    "depth": "differs with the depth",
    "way": "differs between the way in and the way out",
    "time": "changes in the course of the run",
    "speed": "goes with the speed",
    "phase": "follows the time since the last motion",
    "corner": "stands where moves begin and end",
    "swing": "swings at {frequency:.3g} Hz, whatever the motion does",
    "memory": "is smoother from sample to sample than the noise",
}


def remains(data: Data, residual_N: Array, spent: int, swing: Swing | None) -> list[Remainder]:
    """The tests, most telling first. `residual_N` (n,) on the data's grid; `spent`: numbers fitted."""
    use = np.flatnonzero(data.weight > 0)
    if len(use) < FEWEST:
        return []
    e = data.whitened(residual_N)[use]
    groups = _groups(data, use)
    made = len(groups) + 1
    out = []
    total = float(e @ e)
    for name, number in groups.items():
        value, count, found = _grouped(e, number)
        p = float(chi2_law.sf(value, max(count, 1)))
        out.append(_remainder(name, p, found / total, made))
    value, found = _memory(e, spent)
    out.append(_remainder("memory", float(chi2_law.sf(value, 1)), found, made))
    if swing is not None:
        out.append(Remainder("swing", 0.0, swing.share, SENTENCES["swing"].format(frequency=swing.frequency_Hz), True))
    return sorted(out, key=lambda r: (not r.passed, -r.share))


def beyond_chance(data: Data, residual_N: Array) -> bool:
    """Whether what is left is several times the noise's power: no test has to see a structure in that."""
    weight = data.weight
    return float(np.sum(weight * (residual_N / data.total_N) ** 2)) > TIMES * float(weight.sum())


def _remainder(name: str, p: float, share: float, made: int) -> Remainder:
    return Remainder(name, p, share, SENTENCES[name], p * made < LEVEL and share > CRUMB)


def _grouped(e: Array, number: NDArray[np.intp]) -> tuple[float, int, float]:
    """(χ² of the group means, groups, what they take of Σ e² beyond chance)."""
    value = taken = 0.0
    count = 0
    for k in range(int(number.max()) + 1):
        inside = number == k
        n = int(inside.sum())
        if n < LEAST:
            continue
        part = float(e[inside].sum()) ** 2 / n
        value += part
        taken += max(part - 1.0, 0.0)
        count += 1
    return value, count, taken


def _memory(e: Array, spent: int) -> tuple[float, float]:
    """Power beyond the noise's own: (its standing as a χ² of one degree, share)."""
    n = len(e)
    excess = float(e @ e) / max(n - spent, 1) - 1.0
    # the scatter of a mean square, and of the noise's own estimate, which was no better
    spread = np.sqrt(6.0 / n) + 0.06
    return float(max(excess / spread, 0.0) ** 2), max(excess, 0.0) / (1.0 + max(excess, 0.0))


def _groups(data: Data, use: NDArray[np.intp]) -> dict[str, NDArray[np.intp]]:
    time, depth = data.time_s[use], data.position_mm[use]
    reach = max(float(depth.max()), 1e-9)
    still = np.zeros(data.size, dtype=bool)
    since = np.zeros(data.size)
    for s in holds(data.time_s, data.position_mm):
        still[s] = True
        since[s] = data.time_s[s] - data.time_s[s.start]
    speed = np.gradient(data.position_mm, np.maximum.accumulate(data.time_s + 1e-12 * np.arange(data.size)))
    still, since, speed = still[use], since[use], speed[use]
    bins = np.clip((depth / reach * 10).astype(np.intp), -1, 9) + 1
    way = np.where(still, 0, np.where(speed > 0, 1, 2))
    fastest = max(float(np.abs(speed).max()), 1e-9)
    paces = np.where(still, 0, 1 + np.clip((3 + np.log10(np.abs(speed) / fastest + 1e-12)) * 2, 0, 5).astype(np.intp))
    span = max(float(time[-1] - time[0]), 1e-9)
    corner = np.zeros(len(use), dtype=np.intp)
    edges = np.flatnonzero(np.diff(still.astype(np.int8)))
    for edge in edges.tolist():
        corner[max(edge - 3, 0) : edge + 5] = 1 if still[min(edge + 1, len(still) - 1)] else 2
    lap = np.where(still, 1 + np.clip(np.log2(1 + since / 0.02), 0, 9).astype(np.intp), 0)
    groups = {
        "depth": bins,
        "way": bins * 3 + way,
        "time": np.minimum(((time - time[0]) / span * 20).astype(np.intp), 19),
        "speed": paces * 3 + way,
        "phase": lap * 2 + (depth > 0.5 * reach),
        "corner": corner,
    }
    asked = {"way": way[~still], "speed": (paces * 3 + way)[~still], "phase": still.astype(np.intp), "corner": corner}
    return {name: number for name, number in groups.items() if name not in asked or _several(asked[name])}


def _several(number: NDArray[np.intp]) -> bool:
    """Whether there is more than one group that counts: of a run that only goes in no way out can be told."""
    return int(np.count_nonzero(np.bincount(number) >= LEAST)) > 1 if len(number) else False
