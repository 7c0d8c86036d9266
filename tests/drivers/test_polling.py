"""Polls of a load cell: one at a time, when they are due, and none of a port that is lost."""

from __future__ import annotations

import errno

import pytest

import drivers
from drivers.loadcell import ForceSample
from drivers.polling import Polls
from drivers.spec import LoadCellSpec
from drivers.wire import Exchange, Link, complete
from sim.world import World, register, unregister
from tests.drivers.emulated_bench import settings
from tests.drivers.scripted import AnsweringPort, ManualClock, Reply


def polls(answers: list[Reply], value: ForceSample | None = None) -> tuple[Polls, Link]:
    """Ten a second, each answered by the next in the list; whatever comes is read as `value`."""
    clock = ManualClock()
    link = Link("load_cell", AnsweringPort(clock, lambda request: answers.pop(0)), clock, baudrate=9600, attempts=1)

    def ask() -> Exchange[ForceSample | None]:
        return Exchange("poll", b"?", lambda buffer: len(buffer), lambda frame, sent_s, received_s: value, 0.05)

    return Polls(link, ask, lambda: 0.1), link


def turn(polls: Polls, link: Link, until_s: float) -> list[ForceSample]:
    """What came meanwhile."""
    samples: list[ForceSample] = []
    while link.clock.now() < until_s:
        link.service()
        samples += polls.serve()
        due_s = polls.next_s()
        link.clock.wait([link.port], min(until_s, link.wake_at(), until_s if due_s is None else due_s))
    return samples


def test_they_begin_come_at_their_interval_and_end() -> None:
    sample = ForceSample(0.0, 0.0, 1.0)
    mine, link = polls([b"a"] * 6, sample)
    assert not mine.running and mine.next_s() is None and mine.serve() == []
    mine.begin()
    assert mine.running and mine.next_s() == link.clock.now()
    assert turn(mine, link, 0.45) == [sample] * 5
    assert mine.next_s() == pytest.approx(0.5)
    complete(mine.end(), link)
    assert not mine.running and turn(mine, link, 1.0) == []


def test_one_that_is_not_answered_or_says_nothing_gives_no_sample() -> None:
    sample = ForceSample(0.0, 0.0, 1.0)
    mine, link = polls([None, [(0.01, b"a")], [(0.01, b"a")]], sample)
    mine.begin()
    assert turn(mine, link, 0.25) == [sample] * 2
    nothing, link = polls([b"a"] * 3)
    nothing.begin()
    assert turn(nothing, link, 0.25) == []


@pytest.mark.parametrize(
    "cell",
    [
        {"driver": "dad141", "mode": "poll"},
        {"driver": "mt_sics", "mode": "poll", "unit": "N"},
        {"driver": "dad141_modbus"},
        {"driver": "laumas_tlb"},
    ],
    ids=lambda cell: str(cell["driver"]),
)
def test_a_port_that_is_lost_is_not_polled_for_ever(cell: dict[str, object]) -> None:
    """A poll that is due and can never be made would keep a bench in virtual time where it is."""
    motor = {"driver": "orca", "baudrate": 1_000_000, "stroke": (-20.0, 20.0)}
    world = World(settings({"motor": motor, "load_cell": {"capacity": 50.0, **cell}}, "lost", "virtual"))
    register(world)
    try:
        spec = {"port": "sim://lost/load_cell", "capacity": 50.0, **cell}
        opened = drivers.open_load_cell(LoadCellSpec.model_validate(spec), world.clock)
        complete(opened.connect(), opened.link)
        complete(opened.start(), opened.link)
        opened.samples()
        world.endpoints["load_cell"].line.unplug(OSError(errno.EIO, "Input/output error"))
        opened.link.service()
        assert opened.link.broken is not None
        for _ in range(3):
            opened.samples()
            assert opened.next_poll_s() is None
    finally:
        unregister("lost")
