"""An open bench for the short commands: devices, loop and limits of a run, without a protocol and without a file.

Whatever moves here moves under the run's own `Monitor`, starts as a run starts (`Run.start_devices`) and ends as a run
ends: in the bench file's safe state, read back.
"""

from __future__ import annotations

from collections.abc import Callable
from types import TracebackType
from typing import TypeVar

from bench.config import Bench
from bench.daily.notebook import Notebook
from bench.errors import InputError, PadbenchError, Refused, Stopped
from bench.plan import plan
from bench.protocol import DepthStep, Finish, Protocol
from bench.rates import motor_rate_Hz, speed_step_mm_s
from bench.recording.types import ForceChannel
from bench.run.axis import Axis
from bench.run.loop import Loop, Script
from bench.run.motion import Mover, Shape
from bench.run.rig import open_rig
from bench.run.runner import envelope_of
from bench.run.safety import Monitor
from bench.run.script import Run
from bench.run.signals import Operator, listening
from bench.run.touchoff import warm_up
from drivers.errors import DriverError
from drivers.loadcell import LoadCellIdentity

T = TypeVar("T")

GENTLE_MM_S2 = 200.0
"""Acceleration of moves made by hand: little more than the least an IAI controller counts; 5 mm/s stop in 60 µm."""

BASELINE_S = 0.3
"""The force before a move is averaged so long: a cap counts from there."""


class OpenBench:
    """Devices, loop and limits. A context manager; closing closes the ports and says nothing to the devices.

    Raises `InputError` where a port cannot be opened, `Refused` where another process uses it.
    """

    def __init__(self, bench: Bench) -> None:
        self.bench = bench
        try:
            self.rig = open_rig(bench)
        except DriverError as error:
            raise InputError(bench.place((error.device, "port")), f"{error.device}: {error.message}") from error
        warm_up()
        limits = bench.limits
        self.notebook = Notebook()
        self.operator = Operator()
        self.axis = Axis(self.rig.motor, 1.0 / motor_rate_Hz(bench), bench.limits.following_error)
        protocol = _standing(bench)
        planned = plan(protocol, bench)
        monitor = Monitor(envelope_of(bench, planned))
        self.loop = Loop(self.rig, self.axis, monitor, self.notebook, self.operator)
        self.run = Run(self.loop, protocol, bench, planned)
        self.mover = Mover(self.loop, self.shape(min(GENTLE_MM_S2, limits.acceleration)))
        self.clock = self.rig.clock
        self._cell: LoadCellIdentity | None = None

    @property
    def virtual(self) -> bool:
        """A simulated bench on the virtual clock: waiting takes no time."""
        return self.rig.world is not None and not self.rig.world.clock.wall

    def shape(self, acceleration_mm_s2: float) -> Shape:
        """How the motor of this bench moves with such an acceleration."""
        return Shape(acceleration_mm_s2, speed_step_mm_s=speed_step_mm_s(self.bench))

    # -- looking -----------------------------------------------------------------------------------------------

    def look(self, script: Script[T]) -> T:
        """Run a script that commands nothing: limits crossed are noted by the monitor, and end nothing."""
        self.loop.monitor.stopping = True
        try:
            with listening(self.operator):
                return self.loop.run(self._while_wanted(script))
        finally:
            self.loop.monitor.stopping = False

    def listen(self, seconds: float, settle_s: float = 0.0) -> Script[tuple[LoadCellIdentity, ForceChannel]]:
        """Start the load cell, hear it for so long (after `settle_s` that do not count), and stop it again.

        Returns who it is and what it said. Raises its `DriverError`.
        """
        cell, loop = self.rig.load_cell, self.loop
        try:
            if self._cell is None:
                self._cell = yield from loop.perform_on(cell.connect(), cell.link)
            yield from loop.perform_on(cell.start(), cell.link)
            loop.begin_measuring()
            yield from loop.sleep(settle_s)
            self.notebook.clear()
            yield from loop.sleep(seconds)
            loop.end_measuring()
            yield from loop.perform_on(cell.stop(), cell.link)
        except DriverError:
            loop.end_measuring()
            raise
        return self._cell, self.notebook.force_channel()

    def _while_wanted(self, script: Script[T]) -> Script[T]:
        """The script, ended by the operator's stop, which a monitor that ends nothing would pass over."""
        while True:
            try:
                next(script)
            except StopIteration as end:
                return end.value  # type: ignore[no-any-return]  # StopIteration carries Any
            if self.operator.wish is not None:
                raise Stopped(self.operator.wish)
            yield

    # -- moving ------------------------------------------------------------------------------------------------

    def move(
        self,
        work: Callable[[], Script[T]],
        *,
        force_cap_N: float | None = None,
        pull_too: bool = False,
        may_home: bool = False,
    ) -> T:
        """Start the devices as a run does, do the work, end in the safe state, whatever happens.

        `force_cap_N` bounds the rise of the force from what it is before the work (and with `pull_too` its fall, for
        work that begins in air); the bench's limits hold as well.
        An axis that is not homed is refused unless it `may_home`.
        Raises `Stopped` with the first cause, `Refused`, `InputError`.
        """

        def whole() -> Script[T]:
            if not may_home:
                yield from self._must_be_homed()
            yield from self.run.start_devices()
            if force_cap_N is not None:
                yield from self._cap(force_cap_N, pull_too)
            result = yield from work()
            yield from self.run.make_safe()
            return result

        with listening(self.operator):
            try:
                return self.loop.run(whole())
            except InputError:
                raise  # no device was reached, none was commanded
            except Exception as error:  # also a defect of ours: the motor is made safe first
                not_safe = self._wind_down(str(error))
                if not_safe:
                    raise Stopped(f"{error}\n  {not_safe}") from error
                if isinstance(error, Stopped):
                    raise Stopped(f"{error}{self._left_in()}") from error
                raise

    def _wind_down(self, cause: str) -> str:
        """To the safe state; why nobody can say that it was reached, or nothing."""
        monitor = self.loop.monitor
        if monitor.cause is None:  # said by the work: limits that are crossed from now on are not the first
            monitor.violate(cause, "run")
        monitor.stopping = True
        try:
            self.loop.run(self.run.wind_down(cause))
        except PadbenchError as error:
            return f"NOT SAFE: {error}; use the emergency stop"
        found = self.run.found.not_safe
        return f"NOT SAFE: the safe state could not be read back: {found}; use the emergency stop" if found else ""

    def _left_in(self) -> str:
        """Where a motor that was stopped is now, as it was read back: a line for a person, or nothing."""
        found = self.run.found.safe_state
        if not found:
            return ""
        at = f", at {found['position_mm']:.3f} mm" if found.get("position_mm") is not None else ""
        return f"\n  the axis is in its safe state, {found.get('state', '?')}{at}"

    def _must_be_homed(self) -> Script[None]:
        motor = self.rig.motor
        try:
            yield from self.loop.perform(motor.connect())
            homed = yield from self.loop.perform(motor.is_homed())
        except DriverError as error:
            raise InputError(self.bench.place((error.device,)), str(error)) from error
        if not homed:
            raise Refused(
                "the axis is not homed: nobody knows where it stands, and no limit of travel would mean anything\n"
                "  see that its way is free, then `padbench home`"
            )

    def _cap(self, cap_N: float, pull_too: bool) -> Script[None]:
        loop, limits, envelope = self.loop, self.bench.limits, self.loop.monitor.envelope
        before_N = yield from self.mean_gross(BASELINE_S)
        loop.tare_N = before_N
        loop.monitor.tared()
        room_N = limits.force - max(0.0, before_N)
        if room_N <= 0:
            raise Refused(f"the load cell reads {before_N:.3f} N already; limits.force is {limits.force:g} N")
        envelope.force_N = min(cap_N, room_N)
        # What presses now may be let go.
        envelope.tension_N = min(cap_N, limits.tension) if pull_too else limits.tension + max(0.0, before_N)

    def mean_gross(self, seconds: float) -> Script[float]:
        """Mean gross force over so long, N."""
        window = self.mover.watch()
        yield from self.loop.sleep(seconds)
        self.mover.unwatch()
        if not window.gross_N:
            raise Stopped(f"no force sample came within {seconds:g} s")
        return float(sum(window.gross_N) / len(window.gross_N))

    def close(self) -> None:
        """Close both ports."""
        self.rig.close()

    def __enter__(self) -> OpenBench:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _standing(bench: Bench) -> Protocol:
    """A protocol that goes nowhere: what a run wants to know of one before it starts the devices."""
    lowest, highest = bench.limits.position
    step = DepthStep(to=min(max(0.0, lowest), highest), speed=min(1.0, bench.limits.speed))
    return Protocol(name="by hand", approach="none", steps=[step], finish=Finish(retract=0.0, air=0.0))
