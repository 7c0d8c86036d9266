"""Against what a residual shows its cause best: samples grouped by depth, way, speed, time since motion, cycle.

A view is judged by the share of the residual's power that the group means take, corrected for their number; a hum by
the share of its line in the spectrum.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bench.diagnose.result import Diagnosis
from bench.identify.motion import holds

Array = NDArray[np.float64]
Groups = NDArray[np.intp]

FEWEST = 4
"""Samples of a group that is shown."""
FINER = 1.25
"""How many times more a finer or richer view must take."""
LINE = 40.0
"""Times its neighbourhood's power at which a line of the spectrum is called one."""
LEAST_Hz = 4.0
NATURAL = {
    "friction": "depth and way",
    "backlash": "depth and way",
    "viscous_damping": "speed",
    "inertia": "speed",
    "force_delay": "speed",
    "sensor_lag": "speed",
    "missing_relaxation_mode": "time since motion",
    "depth_dependent_relaxation": "time since motion",
    "cogging": "position",
    "encoder_error": "position",
    "damage": "cycle",
    "permanent_set": "cycle",
    "stress_softening": "cycle",
    "elastic_law": "depth",
    "contact_offset": "depth",
    "frame_compliance": "depth",
}
"""Where a cause shows by its nature; such a view is taken …"""
NEAR = 1.35
"""… though another takes so many times more: groups happen to tell other things apart, too."""
WORTH = 0.02
"""Share of the residual's power under which no view is worth a picture …"""
PART = 0.2
"""… or, where a cause is named, of the power beyond the noise; and never what chance alone would take."""
CHANCE = 40.0


@dataclass(frozen=True)
class Series:
    """One curve of a view: group centres and the mean residuals there, N, shape (g,)."""

    label: str
    x: Array
    before_N: Array
    after_N: Array


@dataclass(frozen=True)
class View:
    """Residuals before and after against something; `share` of the power before that the view takes."""

    name: str
    axis: str
    share: float
    series: list[Series]
    logarithmic: bool = False
    said: str = ""


@dataclass(frozen=True)
class _Grouping:
    name: str
    axis: str
    centre: Array
    """Of each group, where it stands on the axis."""
    number: Groups
    """Of each sample, its group; −1: none."""
    curve: Groups
    """Of each group, the curve that it belongs to."""
    labels: tuple[str, ...]
    logarithmic: bool = False
    said: str = ""
    cost: float = 1.0


def best_view(d: Diagnosis) -> View | None:
    """The view that shows the cause best, by what it takes of the residual before; None where none takes much."""
    use = np.flatnonzero(d.counted)
    if use.size < 60:
        return None
    time, position = d.time_s[use], d.position_mm[use]
    before, after = (d.force_N - d.before_N)[use], (d.force_N - d.after_N)[use]
    total = float(before @ before)
    if total <= 0:
        return None
    found = [_view(g, before, after) for g in _groupings(time, position)]
    spectrum = _spectrum(time, before, after)
    if spectrum is not None:
        found.append((spectrum.share, spectrum))
    natural = NATURAL.get(d.causes[0].id, "") if d.causes else ""
    best = max(found, key=lambda pair: pair[0] * (NEAR if pair[1].name == natural else 1.0))[1]
    beyond = max(1.0 - d.noise_floor**2 * use.size / total, 0.0)
    least = max(min(WORTH, PART * beyond), CHANCE / use.size) if d.causes else WORTH
    return best if best.share >= least else None


def _view(g: _Grouping, before: Array, after: Array) -> tuple[float, View]:
    inside = g.number >= 0
    count = np.bincount(g.number[inside], minlength=len(g.centre)).astype(np.float64)
    sums = [np.bincount(g.number[inside], e[inside], minlength=len(g.centre)) for e in (before, after)]
    enough = count >= FEWEST
    means = [np.where(enough, s / np.maximum(count, 1.0), np.nan) for s in sums]
    total = float(before @ before)
    taken = float(np.sum((sums[0] ** 2 / np.maximum(count, 1.0))[enough]))
    n, groups = len(before), int(enough.sum())
    share = max(1.0 - (1.0 - taken / total) * n / max(n - groups, 1), 0.0)
    series = []
    for k, label in enumerate(g.labels):
        mine = np.flatnonzero((g.curve == k) & enough)
        if mine.size:
            mine = mine[np.argsort(g.centre[mine])]
            series.append(Series(label, g.centre[mine], means[0][mine], means[1][mine]))
    return share / g.cost, View(g.name, g.axis, share, series, g.logarithmic, g.said)


def _groupings(time: Array, position: Array) -> list[_Grouping]:
    still = np.zeros(len(time), dtype=bool)
    since = np.zeros(len(time))
    for stretch in holds(time, position):
        still[stretch] = True
        since[stretch] = time[stretch] - time[stretch.start]
    speed = np.gradient(position, np.maximum.accumulate(time + 1e-9 * np.arange(len(time))))
    way = np.where(still, 2, np.where(speed > 0, 0, 1)).astype(np.intp)
    return [
        _by_depth(position, np.zeros(len(time), dtype=np.intp), ("",), 24, "depth", "", 1.0),
        _by_depth(
            position, way, ("on the way in", "on the way out", "in holds"), 16, "depth and way",
            "What differs between the way in and the way out at one depth is friction, play, or a pad that remembers.",
            FINER**0.5,
        ),
        _by_depth(
            position, np.zeros(len(time), dtype=np.intp), ("",), 120, "position",
            "What repeats along the travel belongs to the drive: magnets, thread, encoder.", FINER,
        ),
        _by_speed(speed, still),
        _by_rest(time, position, still, since),
        _by_cycle(time, position, way),
    ]  # fmt: skip


def _by_depth(
    position: Array, curve: Groups, labels: tuple[str, ...], bins: int, name: str, said: str, cost: float
) -> _Grouping:
    low, high = float(position.min()), max(float(position.max()), float(position.min()) + 1e-9)
    number = np.minimum(((position - low) / (high - low) * bins).astype(np.intp), bins - 1)
    centre = low + (np.arange(bins) + 0.5) * (high - low) / bins
    k = len(labels)
    return _Grouping(
        name, "depth, mm", np.tile(centre, k), curve * bins + number, np.repeat(np.arange(k), bins), labels, False,
        said, cost,
    )  # fmt: skip


def _by_speed(speed: Array, still: NDArray[np.bool_]) -> _Grouping:
    fastest = max(float(np.abs(speed).max()), 1e-9)
    bins = 10
    place = np.clip((np.log10(np.maximum(np.abs(speed), 1e-12) / fastest) / 3.0 + 1.0) * bins, 0, bins - 1)
    number = np.where(still, -1, place.astype(np.intp) + np.where(speed > 0, 0, bins))
    centre = fastest * 10.0 ** (3.0 * ((np.arange(bins) + 0.5) / bins - 1.0))
    said = "What grows with the speed is late, damped or heavy; what only changes its sign is friction."
    curve = np.repeat([0, 1], bins)
    labels = ("on the way in", "on the way out")
    return _Grouping("speed", "speed, mm/s", np.tile(centre, 2), number, curve, labels, True, said)


def _by_rest(time: Array, position: Array, still: NDArray[np.bool_], since: Array) -> _Grouping:
    longest = max(float(since.max()), 1e-2)
    shortest = max(longest * 1e-4, 1e-3)
    bins = 14
    place = np.clip(np.log(np.maximum(since, shortest) / shortest) / np.log(longest / shortest) * bins, 0, bins - 1)
    deep = position > 0.05 * max(float(position.max()), 1e-9)
    came = np.zeros(len(time), dtype=np.intp)
    starts = np.flatnonzero(np.diff(still.astype(np.int8), prepend=0) == 1)
    for k, start in enumerate(starts.tolist()):
        end = starts[k + 1] if k + 1 < len(starts) else len(time)
        came[start:end] = 0 if position[start] >= position[max(start - 10, 0)] else 1
    curve = np.where(deep, came, 2)
    number = np.where(still, place.astype(np.intp) + curve * bins, -1)
    centre = shortest * (longest / shortest) ** ((np.arange(bins) + 0.5) / bins)
    labels = ("after a way in", "after a way out", "at the surface and in air")
    said = "What goes on after the motion has ended is relaxation, or a lag of the force path."
    axis = "time since the last motion, s"
    number = number.astype(np.intp)
    return _Grouping("time since motion", axis, np.tile(centre, 3), number, np.repeat(np.arange(3), bins), labels, True,
                     said)  # fmt: skip


def _by_cycle(time: Array, position: Array, way: Groups) -> _Grouping:
    """Cycles begin where the probe leaves the surface for the depth."""
    deepest = max(float(position.max()), 1e-9)
    inside = False
    begins = []
    low, high = 0.05 * deepest, 0.2 * deepest
    for k in np.flatnonzero((position < low) | (position > high)).tolist():
        if not inside and position[k] > high:
            inside = True
            begins.append(k)
        elif inside and position[k] < low:
            inside = False
    number = np.searchsorted(begins, np.arange(len(time)), side="right").astype(np.intp) - 1
    cycles = max(len(begins), 1)
    number = np.where(position > low, number, -1)
    number = np.where(number >= 0, number + cycles * (way == 1), -1)
    centre = np.tile(np.arange(1.0, cycles + 1), 2)
    labels = ("on the way in and in holds", "on the way out")
    said = "What changes from cycle to cycle is a pad that softens, sets or is damaged, or a channel that drifts."
    return _Grouping("cycle", "cycle", centre, number, np.repeat([0, 1], cycles), labels, False, said)


def _spectrum(time: Array, before: Array, after: Array) -> View | None:
    """Amplitudes over frequency, where one line stands out."""
    step = float(np.median(np.diff(time)))
    if not step > 0:
        return None
    grid = np.arange(time[0], time[-1], step)
    n = len(grid)
    if n < 256:
        return None
    frequency = np.fft.rfftfreq(n, step)
    power = [np.abs(np.fft.rfft(np.interp(grid, time, e - e.mean()) * np.hanning(n))) ** 2 for e in (before, after)]
    over = np.flatnonzero(frequency >= LEAST_Hz)
    if over.size < 20:
        return None
    peak = int(over[np.argmax(power[0][over])])
    beside = power[0][max(peak - 60, 0) : peak + 61]
    line = float(power[0][max(peak - 2, 0) : peak + 3].sum())
    if line < LINE * float(np.median(beside)):
        return None
    share = line / float(power[0].sum())
    scale = 4.0 / n  # of a Hann window: amplitude of a sine
    near = slice(max(int(over[0]), peak - 4000), peak + 4001)
    amplitude = [scale * np.sqrt(p[near]) for p in power]
    said = f"A line at {frequency[peak]:.5g} Hz: something hums."
    series = [Series("", np.asarray(frequency[near], dtype=np.float64), amplitude[0], amplitude[1])]
    return View("frequency", "frequency, Hz", share, series, False, said)
