"""Time stamps against a source that is exactly regular and a host that is late in all the ways hosts are."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from drivers.timing import LineTimer, LowerHull

INTERVAL_S = 1 / 549.0
LINES = 3000
BYTES_BEHIND_S = 10 * 20 / 115200


def late_host(rng: np.random.Generator, sent: np.ndarray, mean_s: float = 0.3e-3, bunch: float = 0.2) -> np.ndarray:
    """Read times: exponential latency; with probability `bunch` the host sleeps 2 to 12 ms, and lines pile up."""
    read = sent + rng.exponential(mean_s, sent.size)
    index = 0
    while index < sent.size:
        if rng.random() < bunch * 0.1:
            asleep_until = sent[index] + rng.uniform(2e-3, 12e-3)
            until = int(np.searchsorted(sent, asleep_until))
            read[index:until] = asleep_until
            index = until
        index += 1
    return np.maximum.accumulate(read)


def stamps_of(timer: LineTimer, read: np.ndarray) -> np.ndarray:
    """Feed the timer as a driver does: all lines of one read together, each less the wire time of those behind it."""
    stamps: list[float] = []
    start = 0
    for index in range(1, read.size + 1):
        if index == read.size or read[index] != read[start]:
            behind = np.arange(index - start)[::-1] * BYTES_BEHIND_S
            stamps += timer.stamp(list(read[start:index] - behind))
            start = index
    return np.array(stamps)


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("nominal_s", [None, 1 / 600.0])
def test_error_below_100_us_after_a_second(seed: int, nominal_s: float | None) -> None:
    rng = np.random.default_rng(seed)
    drift = 1 + rng.uniform(-200e-6, 200e-6)
    sent = 5.0 + INTERVAL_S * drift * np.arange(LINES)
    stamps = stamps_of(LineTimer(nominal_s), late_host(rng, sent))
    settled = sent > sent[0] + 1.0
    error = stamps - sent
    assert np.abs(error[settled]).max() < 100e-6
    # In the first second too, no stamp is worse than the latency it was read with.
    assert error.max() < 12.1e-3
    assert (np.diff(stamps) > 0).all()


def test_arrivals_without_latency_are_stamped_exactly() -> None:
    sent = 2.0 + INTERVAL_S * np.arange(2000)
    stamps = stamps_of(LineTimer(), sent)
    assert np.abs(stamps - sent).max() < 1e-9


def test_a_reading_loop_slower_than_the_lines_does_not_bias() -> None:
    """The host looks every 5 ms only; lines wait for it from 0 to 5 ms."""
    sent = INTERVAL_S * np.arange(LINES)
    read = np.ceil(sent / 5e-3) * 5e-3
    stamps = stamps_of(LineTimer(), read)
    assert np.abs(stamps - sent)[sent > 1.0].max() < 100e-6


@pytest.mark.parametrize("missing", [1, 2, 7])
def test_lost_lines_are_noticed_and_counted(missing: int) -> None:
    rng = np.random.default_rng(missing)
    sent = INTERVAL_S * np.arange(LINES)
    kept = np.delete(sent, np.arange(1500, 1500 + missing))
    timer = LineTimer()
    stamps = stamps_of(timer, late_host(rng, kept))
    assert timer.lost == missing
    later = kept > sent[1500] + 0.2
    assert np.abs(stamps - kept)[later].max() < 100e-6


def test_broken_lines_keep_their_place() -> None:
    sent = INTERVAL_S * np.arange(LINES)
    timer = LineTimer()
    errors = []
    for index, time_s in enumerate(sent):
        if index % 40 == 39:
            timer.skip()
        else:
            errors.append(timer.stamp([time_s])[0] - time_s)
    assert np.abs(errors[600:]).max() < 1e-9
    assert timer.lost == 0


def test_a_broken_line_taken_for_two_is_put_right_at_once() -> None:
    sent = INTERVAL_S * np.arange(LINES)
    timer = LineTimer()
    errors = []
    for index, time_s in enumerate(sent):
        if index == 1500:
            timer.skip(2)
        else:
            errors.append(timer.stamp([time_s])[0] - time_s)
    assert np.abs(errors[1600:]).max() < 1e-6


def test_a_stall_of_the_host_loses_nothing() -> None:
    sent = INTERVAL_S * np.arange(LINES)
    read = sent.copy()
    read[(sent > 2.0) & (sent < 2.1)] = 2.1
    timer = LineTimer()
    stamps = stamps_of(timer, read)
    assert timer.lost == 0
    assert np.abs(stamps - sent)[sent > 1.0].max() < 100e-6


def test_after_an_interruption_with_another_phase_it_begins_anew() -> None:
    rng = np.random.default_rng(3)
    first = INTERVAL_S * np.arange(1500)
    second = first[-1] + 3.0 + 0.37 * INTERVAL_S + INTERVAL_S * np.arange(1500)
    sent = np.concatenate([first, second])
    timer = LineTimer()
    stamps = stamps_of(timer, late_host(rng, sent))
    later = sent > second[0] + 1.0
    assert np.abs(stamps - sent)[later].max() < 100e-6
    assert abs(timer.lost - 3.0 / INTERVAL_S) < 30


def test_a_clock_that_wanders_is_followed() -> None:
    """The device's clock changes its rate by 20 ppm within a minute."""
    rng = np.random.default_rng(4)
    count = np.arange(60 * 549)
    rate_ppm = 20 * np.sin(2 * np.pi * count / count.size)
    sent = np.cumsum(INTERVAL_S * (1 + 1e-6 * rate_ppm))
    stamps = stamps_of(LineTimer(), late_host(rng, sent))
    assert np.abs(stamps - sent)[sent > 1.0].max() < 150e-6


def test_lower_hull_is_below_all_points_and_convex() -> None:
    rng = np.random.default_rng(5)
    times = 0.1 * np.arange(500) + rng.exponential(0.3, 500)
    hull = LowerHull()
    for count, time_s in enumerate(times):
        hull.add(count, time_s)
    below = np.interp(np.arange(500), hull.counts, hull.times)
    assert (below <= times + 1e-12).all()
    slopes = [(y1 - y0) / (k1 - k0) for (k0, y0), (k1, y1) in pairwise(zip(hull.counts, hull.times, strict=True))]
    assert all(first < second for first, second in pairwise(slopes))
    tangent = hull.tangent()
    assert tangent is not None
    assert (tangent[0] + tangent[1] * np.arange(500) <= times + 1e-9).all()
