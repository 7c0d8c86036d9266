"""What every load-cell driver must do, whatever carries its bytes: functions that take an open driver."""

from __future__ import annotations

from itertools import pairwise

import pytest

from drivers.loadcell import ForceSample, LoadCell
from drivers.wire import complete


def gather(cell: LoadCell, seconds: float) -> list[ForceSample]:
    """All samples of so long a time."""
    link = cell.link
    end_s = link.clock.now() + seconds
    samples: list[ForceSample] = []
    while link.clock.now() < end_s:
        samples += cell.samples()
        due_s = cell.next_poll_s()
        wake_s = min(end_s, link.wake_at(), end_s if due_s is None else due_s)
        link.clock.wait([link.port], wake_s)
        link.service()
    return samples + cell.samples()


def check_identify(cell: LoadCell) -> None:
    """It says what it is."""
    identity = complete(cell.connect(), cell.link)
    assert identity.model
    assert identity.details


def check_samples(cell: LoadCell, force_N: float, *, at_least_hz: float, noise_N: float = 0.02) -> None:
    """Forces are in newtons; times rise, lie before their receipt, and are no older than the driver says."""
    complete(cell.start(), cell.link)
    seconds = 0.5
    samples = gather(cell, seconds)
    assert len(samples) >= at_least_hz * seconds
    for sample in samples:
        assert sample.gross_N == pytest.approx(force_N, abs=noise_N)
        assert sample.time_s < sample.received_s
        assert not sample.overload
    assert all(first.time_s < second.time_s for first, second in pairwise(samples))
    assert 0 < cell.latency_s() < 0.2


def check_stop_is_quiet(cell: LoadCell) -> None:
    """After stop, nothing comes any more; it can be started again."""
    complete(cell.stop(), cell.link)
    before = cell.link.traffic.bytes_in
    assert gather(cell, 0.1) == []
    assert cell.link.traffic.bytes_in == before
    complete(cell.start(), cell.link)
    assert gather(cell, 0.1)
    complete(cell.stop(), cell.link)


def check_traffic(cell: LoadCell) -> None:
    """The counters show the bytes, and nothing was bad or refused on a good line."""
    traffic = cell.link.traffic
    assert traffic.bytes_in > 500  # half a second and more of the slowest, 53 lines of 18 bytes a second
    assert traffic.bytes_out > 0
    assert traffic.exchanges > 0
    assert (traffic.bad_frames, traffic.refusals, traffic.timeouts) == (0, 0, 0)


def check_all(cell: LoadCell, force_N: float, *, at_least_hz: float) -> None:
    """The whole contract."""
    check_identify(cell)
    check_samples(cell, force_N, at_least_hz=at_least_hz)
    check_stop_is_quiet(cell)
    check_traffic(cell)
