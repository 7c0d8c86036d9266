"""The one loop of a run: it services every port, judges every sample, and runs the script between.

The script is a generator that yields whenever it has nothing to do before the next turn of the loop. Samples are
recorded and judged as they arrive, whatever the script is doing; the loop waits on all ports at once.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from bench.errors import Stopped
from bench.recording.types import StepMark
from bench.run.axis import Axis
from bench.run.rig import Rig
from bench.run.safety import LATE_TURN_S, Monitor
from bench.run.signals import Operator
from bench.run.watch import HostSleep
from drivers.errors import DeviceTimeout, DriverError
from drivers.loadcell import ForceSample
from drivers.motor import MotorSample
from drivers.wire import Pause, Port, Steps

if TYPE_CHECKING:
    from bench.run.foresight import Foresight

T = TypeVar("T")
Script = Generator[None, None, T]

LONGEST_WAIT_S = 0.02
"""The loop turns at least so often, to look at the operator's stop and at how old the samples are."""

MAX_REFUSED = 3
"""So many exchanges in a row may be answered with an error before the run stops; silence is judged by its length."""


class Sink(Protocol):
    """Where samples and events go: the recorder, or nothing."""

    def motor(
        self, time_s: float, received_s: float, position_mm: float, command_mm: float, force_N: float | None
    ) -> None:
        """One motor sample."""
        ...

    def force(
        self,
        time_s: float,
        received_s: float,
        net_N: float,
        gross_N: float,
        flags: tuple[str, ...] = (),
        overload: bool = False,
    ) -> None:
        """One load-cell sample."""
        ...

    def event(self, time_s: float, name: str, data: dict[str, Any]) -> None:
        """Something that happened."""
        ...

    def step(self, mark: StepMark) -> None:
        """A stretch of the run begins."""
        ...

    def tick(self, now_s: float) -> None:
        """Flush when it is time to."""
        ...

    def problem(self) -> str | None:
        """Why nothing more can be recorded, if so."""
        ...


@dataclass
class Window:
    """Samples kept for the script while it wants them (tare, touch-off, force steps)."""

    motor_time_s: list[float] = field(default_factory=list)
    position_mm: list[float] = field(default_factory=list)
    force_time_s: list[float] = field(default_factory=list)
    net_N: list[float] = field(default_factory=list)
    gross_N: list[float] = field(default_factory=list)


class Loop:
    """Rig, axis, monitor and sink, turned until the script ends or something stops it.

    `tare_N` is subtracted from gross readings, `tared_s` when it was taken; `operator` is looked at in every turn.
    """

    def __init__(self, rig: Rig, axis: Axis, monitor: Monitor, sink: Sink, operator: Operator | None = None) -> None:
        self.rig = rig
        self.axis = axis
        self.monitor = monitor
        self.sink = sink
        self.clock = rig.clock
        self.operator = operator if operator is not None else Operator()
        self.foresight: Foresight | None = None
        self.tare_N = 0.0
        self.tared_s = math.nan
        self.late_turns = 0
        self.longest_turn_s = 0.0
        self.measuring = False
        self.window: Window | None = None
        self.last_force: ForceSample | None = None
        self.last_net_N = 0.0
        self.last_motor: MotorSample | None = None
        self.force_count = 0
        self.motor_count = 0
        self.on_turn: Callable[[float], None] | None = None
        self._force_latency_s = 0.0
        self._failed = 0
        # A real bench goes on while the computer sleeps; a simulated one sleeps with it.
        self._sleep = HostSleep() if getattr(self.clock, "watches", False) else None

    def run(self, script: Script[T]) -> T:
        """Turn until the script returns; its value comes back.

        Raises `Stopped` with the first cause when a limit is crossed, a device fails or the operator stops.
        """
        rig, axis, clock, links = self.rig, self.axis, self.clock, self.rig.links
        ports = self._ports()
        ready: Sequence[Port] = ports
        due_s = [0.0] * len(links)
        before = clock.now()
        while True:
            now = clock.now()
            if now - before > LATE_TURN_S or self._sleep is not None:
                self._judge_turn(now, now - before)
            before = now
            for link, link_due_s in zip(links, due_s, strict=True):
                if link_due_s <= now or link.port in ready:
                    link.service()
            axis.catch_up(now)
            self._take(now)
            self.monitor.check()
            try:
                next(script)
            except StopIteration as stop:
                return stop.value  # type: ignore[no-any-return]  # StopIteration carries Any
            except DriverError as error:
                raise Stopped(str(error)) from error
            axis.tick(now)
            self.sink.tick(now)
            if self.on_turn is not None:
                self.on_turn(now)
            due_s = [link.wake_at() for link in links]
            wake = min(axis.wake_at(), now + LONGEST_WAIT_S, *due_s)
            if self.measuring:
                due = rig.load_cell.next_poll_s()
                if due is not None and due < wake:
                    wake = due
            if rig.load_cell.link.broken is not None or rig.motor.link.broken is not None:
                ports = self._ports()
            ready = clock.wait(ports, wake)
            waker = self.operator.waker
            if waker is not None and waker in ready:
                waker.read(64)

    def begin_measuring(self) -> None:
        """The load cell is running: from now on its silence counts."""
        self.measuring = True
        self._force_latency_s = self.rig.load_cell.latency_s()
        self.monitor.expect_force_from(self.clock.now())

    def end_measuring(self) -> None:
        """The load cell is about to be stopped: its silence means nothing any more."""
        self.measuring = False
        self.monitor.expect_force_from(None)

    @property
    def operator_stop(self) -> str | None:
        """What the operator (or a signal) wants the run stopped for; set again it is wanted harder."""
        return self.operator.wish

    @operator_stop.setter
    def operator_stop(self, wish: str) -> None:
        self.operator.strike(wish)

    def force_age_s(self, now_s: float) -> float:
        """How long ago the newest force came, beyond what is normal for the cell; infinity before the first."""
        if self.last_force is None:
            return math.inf
        return now_s - self.last_force.received_s - self._force_latency_s

    # -- for scripts -------------------------------------------------------------------------------------------

    def perform(self, steps: Steps[T]) -> Script[T]:
        """A driver's conversation as part of a script, while the loop keeps turning; raises its `DriverError`."""
        link = self.rig.motor.link if steps is not None else None
        return self.perform_on(steps, link)

    def perform_on(self, steps: Steps[T], link: Any) -> Script[T]:
        """Like `perform`, on any link."""
        reply: Any = None
        error: DriverError | None = None
        while True:
            try:
                item = steps.throw(error) if error is not None else steps.send(reply)
            except StopIteration as stop:
                return stop.value  # type: ignore[no-any-return]  # StopIteration carries Any
            reply, error = None, None
            if isinstance(item, Pause):
                yield from self.sleep(item.seconds)
                continue
            link.submit(item)
            while not item.done:
                yield
            reply, error = item.value, item.error

    def sleep(self, seconds: float) -> Script[None]:
        """Let the loop turn for so long on the bench's clock."""
        until = self.clock.now() + seconds
        while self.clock.now() < until:
            yield

    # -- inside ------------------------------------------------------------------------------------------------

    def _ports(self) -> list[Port]:
        """What a wait ends for: the ports that are not lost (those would wake us for ever), and a signal."""
        ports: list[Port] = [link.port for link in self.rig.links if link.broken is None]
        waker = self.operator.waker
        if waker is not None and getattr(self.clock, "wall", True):
            ports.append(waker)
        return ports

    def _judge_turn(self, now: float, gap_s: float) -> None:
        """Note a turn that came late, and have it judged; a stopping run only notes it."""
        slept_s = self._sleep.slept_s() if self._sleep is not None else 0.0
        if gap_s > LATE_TURN_S or slept_s > LATE_TURN_S:
            self.late_turns += 1
            self.longest_turn_s = max(self.longest_turn_s, gap_s)
            self.sink.event(now, "late_turn", {"gap_s": gap_s, "slept_s": slept_s})
            self.monitor.turn(gap_s, slept_s)

    def _take(self, now: float) -> None:
        """Record and judge everything that has come."""
        monitor, sink = self.monitor, self.sink
        window = self.window
        if self.measuring:
            for sample in self.rig.load_cell.samples():
                net = sample.gross_N - self.tare_N
                sink.force(sample.time_s, sample.received_s, net, sample.gross_N, sample.flags, sample.overload)
                monitor.force(sample, net)
                self.last_force = sample
                self.last_net_N = net
                self.force_count += 1
                if window is not None:
                    window.force_time_s.append(sample.time_s)
                    window.net_N.append(net)
                    window.gross_N.append(sample.gross_N)
        axis = self.axis
        for reading, command in axis.collect():
            sink.motor(reading.time_s, reading.received_s, reading.position_mm, command, reading.force_N)
            names = self.rig.motor.fault_names(reading.fault) if reading.fault else ()
            monitor.motor(reading, command, names, axis.lag_mm(reading.time_s), axis.over_s(reading.time_s))
            self.last_motor = reading
            self.motor_count += 1
            if self.foresight is not None:
                self.foresight.note(reading.time_s, reading.position_mm)
            self._failed = 0
            if window is not None:
                window.motor_time_s.append(reading.time_s)
                window.position_mm.append(reading.position_mm)
        while axis.told:
            sink.event(*axis.told.pop(0))
        while axis.failures:
            failure = axis.failures.pop(0)
            self._failed += 1
            sink.event(now, "motor_error", {"message": str(failure), "in_a_row": self._failed})
            answered = not isinstance(failure, DeviceTimeout)
            if (answered and self._failed >= MAX_REFUSED) or self.rig.motor.link.broken is not None:
                monitor.violate(str(failure), "motor")
        if axis.refused is not None:
            sink.event(now, "motor_refused", {"message": str(axis.refused)})
            monitor.violate(str(axis.refused), "motor")
            axis.refused = None
        broken = self.rig.load_cell.link.broken
        if broken is not None and self.measuring:
            monitor.violate(str(broken), "cell")
        monitor.time(now, self._force_latency_s, axis.live)
        if self.operator.wish is not None:
            monitor.violate(self.operator.wish, "operator")
        problem = sink.problem()
        if problem is not None:
            monitor.violate(f"the recording cannot go on: {problem}", "host")

    @property
    def last_gross_N(self) -> float:
        """The last reading of the load cell (NaN before the first)."""
        return self.last_force.gross_N if self.last_force is not None else math.nan
