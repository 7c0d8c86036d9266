"""When was it measured? Time stamps for lines that a device sends at its own steady rate.

The device's clock ticks evenly, the host sees each tick late: by the adapter, the operating system, the loop. Late,
never early. So line k was sent at t = a + b·k, and of all straight lines below the arrivals (k, y_k) the one that
lies closest to them on average is taken: it touches two corners of the arrivals' lower convex hull, on either side of
the mean count. One line that came without delay on each side is enough, however late the others are.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence

WINDOW_S = 20.0
"""Arrivals older than that are forgotten, so that a device clock that drifts with temperature is followed."""

EVIDENCE_S = 0.03
EVIDENCE_READS = 8
"""A lost line shows as lateness that does not go away: for so long, and in so many reads."""

MIN_SPAN_COUNTS = 8
"""Below that many counts no slope is fitted: arrivals then stand for themselves, or for the nominal rate."""

SETTLED_COUNTS = 64
"""From here on the fit is good enough to judge what came late or early against it."""

INTERRUPTION_S = 0.25
"""A gap of at least so long is an interruption: the device may have started over, with another phase."""


class LowerHull:
    """Lower convex hull of points that come with rising count."""

    def __init__(self) -> None:
        self.counts: list[float] = []
        self.times: list[float] = []
        self.first_count: float | None = None

    def add(self, count: float, time_s: float) -> None:
        """Take a point; corners that it puts above the hull go."""
        ks, ys = self.counts, self.times
        if self.first_count is None:
            self.first_count = count
        if ks and ks[-1] == count:
            if time_s >= ys[-1]:
                return
            ks.pop()
            ys.pop()
        while len(ks) >= 2 and (ys[-1] - ys[-2]) * (count - ks[-2]) >= (time_s - ys[-2]) * (ks[-1] - ks[-2]):
            ks.pop()
            ys.pop()
        ks.append(count)
        ys.append(time_s)

    def tangent(self) -> tuple[float, float] | None:
        """Offset a and slope b of the hull's edge below the mean count; None with fewer than two corners."""
        ks, ys = self.counts, self.times
        if len(ks) < 2 or self.first_count is None:
            return None
        middle = 0.5 * (self.first_count + ks[-1])
        right = min(max(bisect_right(ks, middle), 1), len(ks) - 1)
        slope = (ys[right] - ys[right - 1]) / (ks[right] - ks[right - 1])
        return ys[right] - slope * ks[right], slope


class LineTimer:
    """Stamps lines of a steady stream with when they were sent, on the host's clock.

    `interval_s` is the nominal time between lines, if known; it serves in the first instants only.
    `lost` counts lines that never came, as far as their absence showed in the timing.
    """

    def __init__(self, interval_s: float | None = None, window_s: float = WINDOW_S) -> None:
        self.nominal_s = interval_s
        self.window_s = window_s
        self.lost = 0
        self._count = 0
        self._last_s = float("-inf")
        self._start_over()

    @property
    def interval_s(self) -> float | None:
        """Time between lines as fitted so far, or the nominal one."""
        return self._fit[1] if self._fit is not None else self.nominal_s

    def skip(self, lines: int = 1) -> None:
        """So many lines came broken: they took their place in the stream, but get no stamp."""
        self._count += lines

    def stamp(self, arrivals: Sequence[float]) -> list[float]:
        """Times at which the lines of one read were sent.

        `arrivals` (n,), rising: for each line the latest time its last byte can have been on the wire, that is the
        time of the read less the wire time of the bytes behind it. Stamps rise strictly and lie before these, but
        where that would make two of them equal.
        """
        if not arrivals:
            return []
        counts = []
        for arrival in arrivals:
            self._correct_early(arrival)
            counts.append(self._count)
            self._add(self._count, arrival)
            self._count += 1
        # The last line of a read waited least: only it says something about lines that are missing.
        jump = self._judge_late(counts[-1], arrivals[-1])
        return [self._stamp(count + jump, arrival) for count, arrival in zip(counts, arrivals, strict=True)]

    # -- inside ------------------------------------------------------------------------------------------------

    def _start_over(self) -> None:
        self._hull = LowerHull()
        self._next_hull = LowerHull()
        self._hull_since_s: float | None = None
        self._fit: tuple[float, float] | None = None
        self._late: list[tuple[float, float]] = []
        self._first_count = self._count

    @property
    def _settled(self) -> bool:
        return self._fit is not None and self._count - self._first_count >= SETTLED_COUNTS

    def _add(self, count: int, arrival: float) -> None:
        if self._hull_since_s is None:
            self._hull_since_s = arrival
        elif arrival - self._hull_since_s > self.window_s:
            # Two hulls, the second begun half a window later, forget the past without keeping every point.
            self._hull, self._next_hull = self._next_hull, LowerHull()
            self._hull_since_s += 0.5 * self.window_s
        self._hull.add(count, arrival)
        if arrival - self._hull_since_s > 0.5 * self.window_s:
            self._next_hull.add(count, arrival)
        span = count - self._first_count
        if span >= MIN_SPAN_COUNTS:
            self._fit = self._hull.tangent()
        elif self.nominal_s is not None:
            b = self.nominal_s
            self._fit = (min(y - b * k for k, y in zip(self._hull.counts, self._hull.times, strict=True)), b)

    def _correct_early(self, arrival: float) -> None:
        """Nothing comes early: a line that seems to was counted too high (a broken line was taken for two)."""
        if not self._settled:
            return
        assert self._fit is not None
        a, b = self._fit
        early = a + b * self._count - arrival
        if early > 0.5 * b:
            self._count -= round(early / b)

    def _judge_late(self, count: int, arrival: float) -> int:
        """Look for lines that never came; returns by how much the counts of this read are too low.

        A line that is late by whole intervals may have waited; when all reads of a while are, lines were lost. Late by
        something that is no whole number, or by very much: the stream was interrupted, and the fit begins anew.
        """
        if not self._settled:
            return 0
        assert self._fit is not None
        a, b = self._fit
        late = arrival - (a + b * count)
        if late < 0.5 * b:
            self._late.clear()
            return 0
        self._late.append((arrival, late))
        if len(self._late) < EVIDENCE_READS or arrival - self._late[0][0] < EVIDENCE_S:
            return 0
        missing = min(late for _, late in self._late) / b
        self._late.clear()
        lines = round(missing)
        if lines * b > INTERRUPTION_S or abs(missing - lines) > 0.3:
            self.lost += lines
            self.nominal_s = b
            self._start_over()
            self._add(count, arrival)
            return 0
        self.lost += lines
        self._count += lines
        return lines

    def _stamp(self, count: int, arrival: float) -> float:
        time_s = arrival
        if self._fit is not None:
            a, b = self._fit
            time_s = min(a + b * count, arrival)
        # Strictly rising, even where the fit has just moved.
        if time_s <= self._last_s:
            time_s = self._last_s + 1e-7
        self._last_s = time_s
        return time_s
