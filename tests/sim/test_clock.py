from __future__ import annotations

import os

import pytest

from sim.clock import Deadlock, SimClock


class FakePort:
    """A port as the clock sees it."""

    def __init__(self) -> None:
        self.frame_waiting = 0
        self.line = None


def test_waiting_jumps_and_events_run_in_time_order() -> None:
    clock = SimClock()
    seen: list[tuple[str, float, float]] = []
    for name, at_s in (("late", 2.0), ("early", 1.0), ("far", 1e6)):
        clock.schedule(at_s, lambda due_s, name=name: seen.append((name, due_s, clock.now())))
    clock.wait([], 3.0)
    assert seen == [("early", 1.0, 1.0), ("late", 2.0, 2.0)]
    assert clock.now() == 3.0
    assert clock.next_event_s() == 1e6


def test_equal_times_run_in_the_order_scheduled() -> None:
    clock = SimClock()
    seen: list[int] = []
    for k in range(20):
        clock.schedule(1.0, lambda due_s, k=k: seen.append(k))
    clock.wait([], 1.0)
    assert seen == list(range(20))


def test_an_event_can_schedule_for_its_own_time_and_be_cancelled() -> None:
    clock = SimClock()
    seen: list[str] = []
    doomed = clock.schedule(1.0, lambda due_s: seen.append("doomed"))

    def first(due_s: float) -> None:
        seen.append("first")
        doomed.cancel()
        clock.schedule(due_s, lambda again_s: seen.append(f"again at {again_s}"))

    clock.schedule(0.5, first)
    clock.wait([], 1.0)
    assert seen == ["first", "again at 0.5"]


def test_waiting_ends_when_a_port_has_bytes() -> None:
    clock = SimClock()
    port = FakePort()

    def deliver(due_s: float) -> None:
        port.frame_waiting = 3
        clock.arrived()

    clock.schedule(0.25, deliver)
    clock.wait([port], 1.0)
    assert clock.now() == 0.25
    clock.wait([port], 1.0)  # the bytes are still there
    assert clock.now() == 0.25


def test_a_time_in_the_past_does_not_turn_the_clock_back() -> None:
    clock = SimClock()
    clock.wait([], 1.0)
    clock.wait([], 0.5)
    assert clock.now() == 1.0


def test_waiting_for_ever_for_nothing_is_an_error_and_not_a_hang() -> None:
    with pytest.raises(Deadlock):
        SimClock().wait([FakePort()], float("inf"))


def test_virtual_time_always_starts_at_the_same_date() -> None:
    assert SimClock().epoch_ns == SimClock().epoch_ns == 1767225600 * 10**9


def test_on_the_wall_events_run_when_due_and_descriptors_wake() -> None:
    clock = SimClock(wall=True)
    seen: list[float] = []
    start_s = clock.now()
    clock.schedule(start_s + 0.01, lambda due_s: seen.append(clock.now() - due_s))
    clock.wait([], start_s + 0.02)
    assert clock.now() >= start_s + 0.02
    assert len(seen) == 1
    assert seen[0] >= 0.0

    read_end, write_end = os.pipe()
    try:

        class Pipe:
            def fileno(self) -> int:
                return read_end

        clock.schedule(clock.now() + 0.005, lambda due_s: os.write(write_end, b"x"))
        until_s = clock.now() + 30.0
        clock.wait([Pipe()], until_s)
        assert clock.now() < until_s
    finally:
        os.close(read_end)
        os.close(write_end)
