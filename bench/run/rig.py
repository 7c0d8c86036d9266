"""Two devices and a clock as one bench, from a bench file; the only place where a simulated bench is wired in."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass, field
from types import TracebackType
from typing import TYPE_CHECKING, Any

import drivers
from bench.run.in_use import COMMAND, using
from drivers.clock import WallClock
from drivers.loadcell import LoadCell
from drivers.motor import Motor
from drivers.wire import Clock, Link, Port, Steps, T, complete

if TYPE_CHECKING:
    from bench.config import Bench
    from sim.world import World


@dataclass
class Rig:
    """An open bench: devices, links and the clock they share. A context manager; closing closes the ports."""

    clock: Clock
    motor: Motor
    load_cell: LoadCell
    world: World | None = None
    links: list[Link] = field(default_factory=list)
    ports: list[Port] = field(default_factory=list)
    held: ExitStack = field(default_factory=ExitStack)
    """That this process, and no other, uses the ports."""

    def complete(self, steps: Steps[T], link: Link) -> T:
        """Run a conversation to its end while the other link is serviced too."""
        return complete(steps, link, [other for other in self.links if other is not link])

    def traffic(self) -> dict[str, dict[str, Any]]:
        """Counters of both links."""
        return {
            link.name: {name: getattr(link.traffic, name) for name in link.traffic.__slots__} for link in self.links
        }

    def close(self) -> None:
        """Close both ports; says nothing to the devices."""
        for link in self.links:
            link.close()
        self.held.close()

    def __enter__(self) -> Rig:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def is_simulated(bench: Bench) -> bool:
    """Whether every port of the bench is a simulated one."""
    return all(port.startswith("sim://") for port in (bench.motor.port, bench.load_cell.port))


def open_rig(bench: Bench, what: str = COMMAND) -> Rig:
    """Open both devices of a bench; `what` is told to whoever wants them meanwhile.

    Raises `drivers.errors.PortError` where a port cannot be opened, `Refused` where another process uses it.
    """
    with ExitStack() as held:
        held.enter_context(using((bench.motor.port, bench.load_cell.port), what))
        rig = _open(bench)
        rig.held = held.pop_all()
    return rig


def _open(bench: Bench) -> Rig:
    world = None
    clock: Clock
    if any(port.startswith("sim://") for port in (bench.motor.port, bench.load_cell.port)):
        from bench.run.simulated import world_of

        world = world_of(bench)
        clock = world.clock
    else:
        clock = WallClock()
    motor = drivers.open_motor(bench.motor, clock)
    try:
        load_cell = drivers.open_load_cell(bench.load_cell, clock)
    except drivers.errors.DriverError:
        motor.link.close()
        raise
    links = [motor.link, load_cell.link]
    return Rig(clock, motor, load_cell, world, links, [link.port for link in links])
