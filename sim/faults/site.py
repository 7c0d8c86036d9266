"""Where faults are put: one simulated bench, with the times at which each fault strikes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from sim.faults.base import Fault, FaultError
from sim.line import Line, Pieces

if TYPE_CHECKING:
    import numpy as np

    from sim.world import World

Begin = Callable[[float], None]


@dataclass(frozen=True)
class Strike:
    """A fault that has begun: for tests, and for whoever wants to know what a run went through."""

    time_s: float
    kind: str
    device: str


class Spell:
    """Which frames or requests a fault takes once it has begun: the next one, or all of them for `duration_s`."""

    def __init__(self, duration_s: float | None) -> None:
        self._duration_s = duration_s
        self._pending = False
        self._until_s = -1.0

    def begin(self, at_s: float) -> None:
        """The fault strikes."""
        if self._duration_s is None:
            self._pending = True
        else:
            self._until_s = at_s + self._duration_s

    def takes(self, at_s: float) -> bool:
        """Whether what comes by now is struck; without a duration, the one that asks is the one."""
        if not self._pending and at_s >= self._until_s:
            return False
        self._pending = False
        return True


class Site:
    """The bench's parts that faults change, a stream of random numbers for each fault, and what has struck so far."""

    def __init__(self, world: World) -> None:
        self.world = world
        self.clock = world.true_clock
        self.plant = world.plant
        self.struck: list[Strike] = []
        self.steps_seen: list[str] = []
        self.over = False
        """Whether nothing strikes any more: for who looks at a bench after its run."""
        self._waiting: list[tuple[Fault, Begin]] = []

    def line(self, fault: Fault) -> Line:
        """The line of the fault's device."""
        return self.world.endpoints[fault.device].line

    def device(self, fault: Fault) -> Any:
        """The simulated device."""
        return self.world.endpoints[fault.device].device

    def part(self, fault: Fault, name: str) -> Any:
        """A part of the device (`drive`, `amplifier`, `server`), or what it can do; raises `FaultError` without."""
        found = getattr(self.device(fault), name, None)
        if found is None:
            kind = type(self.device(fault)).__name__
            raise FaultError(fault.index, "kind", f"`{fault.kind.name}` is not simulated for this device ({kind})")
        return found

    def random(self, fault: Fault) -> np.random.Generator:
        """The random numbers of one fault: a stream of its own, from the bench's seed and its place in the list."""
        return self.world.fault_generator(fault.index)

    # -- when ----------------------------------------------------------------------------------------------------

    def when(self, fault: Fault, begin: Begin, end: Begin | None = None) -> None:
        """Have `begin(time)` called whenever the fault strikes, and `end(time)` when its duration is over."""

        def strike(at_s: float) -> None:
            if self.over:
                return
            self.note(fault, at_s)
            begin(at_s)
            if end is not None and fault.duration_s is not None:
                self.clock.schedule(at_s + fault.duration_s, end)

        if fault.rate_per_s is not None:
            random, mean_s = self.random(fault), 1.0 / fault.rate_per_s

            def again(at_s: float) -> None:
                strike(at_s)
                busy_s = fault.duration_s or 0.0
                self.clock.schedule(at_s + busy_s + random.exponential(mean_s), again)

            self.clock.schedule(random.exponential(mean_s), again)
        elif fault.step is not None:
            self._waiting.append((fault, strike))
        else:
            assert fault.at_s is not None
            if fault.at_s == 0.0:
                strike(0.0)  # before the first byte, and before a port is opened
            else:
                self.clock.schedule(fault.at_s, strike)

    def note(self, fault: Fault, at_s: float) -> None:
        """Keep in mind that a fault has struck."""
        self.struck.append(Strike(at_s, fault.kind.name, fault.device))

    def step_begins(self, name: str) -> None:
        """A step of the run begins: faults that wait for it strike, after their `after_s`; once each."""
        now_s = self.clock.now()
        number = len([seen for seen in self.steps_seen if seen.startswith("steps[") and seen != name])
        if name in self.steps_seen:
            return
        self.steps_seen.append(name)
        for waiting in list(self._waiting):
            fault, strike = waiting
            if fault.step == name or (name.startswith("steps[") and fault.step == number):
                self._waiting.remove(waiting)
                self.clock.schedule(now_s + fault.after_s, strike)

    # -- on the line ---------------------------------------------------------------------------------------------

    def frames(self, fault: Fault, change: Callable[[bytes], Pieces], to_device: bool = False) -> None:
        """Have `change(frame)` say what becomes of the frames that the fault strikes.

        Without a duration that is the next frame, else all of them for so long.
        """
        spell = Spell(fault.duration_s)

        def tamper(data: bytes, at_s: float) -> Pieces:
            return change(data) if spell.takes(at_s) else ((data, 0.0),)

        self.line(fault).tamper(tamper, to_device)
        self.when(fault, spell.begin)
