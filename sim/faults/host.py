"""The host: stalled, its clock set, its disk full, stopped by a signal, killed.

What strikes the process itself goes through `World.host_acts`, which whoever runs the bench may replace: a test that is
to outlive the kill does.
"""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from typing import TYPE_CHECKING

from sim.clock import SteppedClock
from sim.faults.base import RECOVERED, STOPPED, Fault, FaultError, Kind, Parameter, Reaction
from sim.faults.bytes_ import IN_HOLD, IN_RAMP
from sim.faults.site import Site

if TYPE_CHECKING:
    from collections.abc import Mapping

SIGNALS = {
    "interrupt": signal.SIGINT,
    "terminate": signal.SIGTERM,
    "hang_up": getattr(signal, "SIGHUP", signal.SIGTERM),
}


def own_acts() -> Mapping[str, Callable[[], None]]:
    """What faults do to this very process."""
    return {
        "kill": lambda: os.kill(os.getpid(), getattr(signal, "SIGKILL", signal.SIGTERM)),
        **{name: _raiser(number) for name, number in SIGNALS.items()},
    }


def _raiser(number: int) -> Callable[[], None]:
    return lambda: signal.raise_signal(number)


def _stall(fault: Fault, site: Site) -> None:
    for_s = fault.number("for_s")
    site.when(fault, lambda at_s: site.clock.stall(for_s))


def _step(fault: Fault, site: Site) -> None:
    by_s = fault.number("by_s")
    clock = site.world.clock
    assert isinstance(clock, SteppedClock)

    def begin(at_s: float) -> None:
        clock.step_s += by_s
        site.clock.wake()

    site.when(fault, begin)


def _act(name: Callable[[Fault], str]) -> Callable[[Fault, Site], None]:
    def install(fault: Fault, site: Site) -> None:
        def begin(at_s: float) -> None:
            act = site.world.host_acts.get(name(fault))
            if act is not None:  # nobody who records anything has come yet: there is no disk to fill
                act()

        site.when(fault, begin)

    return install


def _disk_full(fault: Fault, site: Site) -> None:
    if site.clock.wall:
        cure = "give the bench the virtual clock"
        raise FaultError(fault.index, "kind", "on the wall's clock another process writes the recording", cure)
    _act(lambda fault: "disk_full")(fault, site)


KINDS: tuple[Kind, ...] = (
    Kind(
        "host_stall",
        "The host does nothing for a while (a busy machine, a laptop that sleeps).",
        ("host",),
        _stall,
        (
            Reaction("host", {**IN_RAMP, "for_s": 0.01}, RECOVERED, shows="overruns"),
            Reaction("host", {**IN_HOLD, "for_s": 0.03}, RECOVERED, shows="overruns"),
            Reaction("host", {**IN_RAMP, "for_s": 0.3}, STOPPED, "(?i)fault|silent|time-?out|stall|late"),
            Reaction("host", {**IN_HOLD, "for_s": 2.0}, STOPPED, "(?i)fault|silent|time-?out|stall|late"),
            Reaction("host", {"step": "approach", "for_s": 2.0}, STOPPED, "(?i)fault|silent|stall|late"),
            Reaction(
                "host",
                {**IN_RAMP, "for_s": 2.0},
                STOPPED,
                "(?i)silent|stall|late",
                bench="simulated_iai",
                why="the controller ends its move by itself meanwhile",
            ),
        ),
        (Parameter("for_s", "s", 0.1, "how long", 0.0, 3600.0),),
        lasting=False,
    ),
    Kind(
        "clock_step",
        "The host's clock is set, forward or back.",
        ("host",),
        _step,
        (
            Reaction("host", {**IN_HOLD, "by_s": 5.0}, STOPPED, "(?i)clock|silent|stall"),
            Reaction("host", {**IN_RAMP, "by_s": 5.0}, STOPPED, "(?i)clock|silent|stall"),
            Reaction("host", {**IN_HOLD, "by_s": -0.5}, STOPPED, "(?i)clock"),
            Reaction("host", {**IN_RAMP, "by_s": -5.0}, STOPPED, "(?i)clock"),
            Reaction("host", {**IN_HOLD, "by_s": 0.002}, RECOVERED),
        ),
        (Parameter("by_s", "s", 1.0, "by how much", -3600.0, 3600.0),),
        lasting=False,
    ),
    Kind(
        "signal",
        "The process is told to stop (Ctrl-C, kill, a terminal that closes).",
        ("host",),
        _act(lambda fault: fault.word("signal")),
        (
            Reaction("host", {**IN_RAMP, "signal": "interrupt"}, STOPPED, "operator|SIGINT"),
            Reaction("host", {**IN_HOLD, "signal": "terminate"}, STOPPED, "SIGTERM"),
            Reaction("host", {"step": "approach", "signal": "hang_up"}, STOPPED, "SIGHUP"),
        ),
        (Parameter("signal", "", "interrupt", "which", words=tuple(SIGNALS)),),
        lasting=False,
    ),
    Kind(
        "killed",
        "The process is killed: nobody says goodbye.",
        ("host",),
        _act(lambda fault: "kill"),
        (
            Reaction("host", {**IN_RAMP}, STOPPED, "killed", why="the motor's own watchdog; what was flushed is kept"),
            Reaction("host", {**IN_HOLD}, STOPPED, "killed"),
            Reaction("host", {"step": "approach", "after_s": 0.1}, STOPPED, "killed"),
            Reaction("host", {**IN_RAMP}, STOPPED, "killed", bench="simulated_iai", why="it ends its move, and holds"),
        ),
        lasting=False,
    ),
    Kind(
        "disk_full",
        "The disk is full: nothing more can be recorded.",
        ("host",),
        _disk_full,
        (
            Reaction("host", {**IN_RAMP}, STOPPED, "recording cannot go on.*(?i:no space|full)"),
            Reaction("host", {**IN_HOLD}, STOPPED, "recording cannot go on.*(?i:no space|full)"),
            Reaction("host", {"step": "approach"}, STOPPED, "recording cannot go on.*(?i:no space|full)"),
        ),
        lasting=False,
    ),
)
