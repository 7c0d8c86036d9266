"""Moves made by hand: home, a step of a jog, a jog by keys, release."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drivers
from bench.config import Bench
from bench.daily.open_bench import OpenBench
from bench.errors import InputError, Refused, Stopped
from bench.run.in_use import using
from bench.run.loop import Script
from bench.run.rig import Rig, open_rig
from drivers.clock import WallClock
from drivers.errors import DriverError
from drivers.motor import Motor
from drivers.wire import Link, Steps, complete

MOST_STEP_MM = 5.0
"""A jog is a small step: further goes who asks several times, and looks in between."""

MOST_SPEED_MM_S = 5.0
USUAL_CAP_N = 1.0
STEPS_MM = (0.01, 0.1, 1.0)
"""Steps of a jog by keys."""

SETTLED_S = 0.2


@dataclass(frozen=True)
class Jogged:
    """One step: from where to where (motor frame, mm), and what the force did (N, from before the jog)."""

    start_mm: float
    position_mm: float
    force_change_N: float
    peak_change_N: float


def home(work: OpenBench, *, again: bool = False) -> dict[str, Any]:
    """Home the axis where it is not (or `again`), enter the travel allowed, end in the safe state."""
    loop, run, motor = work.loop, work.run, work.rig.motor

    def whole() -> Script[None]:
        homed = work.notebook.data_of("homed")
        if homed is None and again:
            loop.axis.go_silent()
            yield from loop.perform(motor.home())
            yield from run.enter_travel()

    work.move(whole, may_home=True)
    homed = work.notebook.data_of("homed")
    state = run.found.safe_state or {}
    return {"homed_now": homed is not None, **(homed or {}), "safe_state": state}


def jog(work: OpenBench, by_mm: float, speed_mm_s: float, cap_N: float) -> Jogged:
    """One step of `by_mm`; raises `Refused` where it would leave the travel, `Stopped` where a limit was met."""
    return work.move(lambda: step_by(work, by_mm, speed_mm_s), force_cap_N=cap_N, may_home=_afresh(work))


def _afresh(work: OpenBench) -> bool:
    """A simulated bench is a new one for each command, and nobody is in the way of its homing."""
    return work.bench.all_simulated


def step_by(work: OpenBench, by_mm: float, speed_mm_s: float) -> Script[Jogged]:
    """One step of an axis that is energised; refused where it would leave the travel allowed."""
    mover, loop = work.mover, work.loop
    start = mover.here()
    target = start + by_mm
    lowest, highest = loop.monitor.envelope.position_mm
    if not lowest <= target <= highest:
        raise Refused(
            f"from {start:.3f} mm a step of {by_mm:+g} mm ends at {target:.3f} mm, "
            f"beyond limits.position [{lowest:g}, {highest:g}] mm"
        )
    window = mover.watch()
    yield from mover.go(target, speed_mm_s)
    yield from mover.settle()
    yield from loop.sleep(SETTLED_S)
    mover.unwatch()
    force = window.net_N or [math.nan]
    last = [net for time_s, net in zip(window.force_time_s, window.net_N, strict=True)][-20:] or [math.nan]
    position = loop.last_motor.position_mm if loop.last_motor is not None else math.nan
    return Jogged(start, position, sum(last) / len(last), max(force, key=abs))


def jog_by_keys(
    work: OpenBench, keys: Callable[[], str | None], tell: Callable[[str], None], speed_mm_s: float, cap_N: float
) -> float:
    """Steps by keys until `q`; returns where the axis ended (mm). A step that would leave the travel is not made.

    `keys()` gives the next key or None, and never blocks: "forth", "back", "larger", "smaller", "quit".
    """

    def whole() -> Script[float]:
        size = 1
        tell(_line(work, STEPS_MM[size]))
        while True:
            key = keys()
            if key == "quit":
                return work.mover.here()
            if key in ("larger", "smaller"):
                size = min(max(size + (1 if key == "larger" else -1), 0), len(STEPS_MM) - 1)
            elif key in ("forth", "back"):
                try:
                    yield from step_by(work, STEPS_MM[size] * (1 if key == "forth" else -1), speed_mm_s)
                except Refused as no:
                    tell(str(no))
                    continue
            yield from work.loop.sleep(0.02)
            tell(_line(work, STEPS_MM[size]))

    return work.move(whole, force_cap_N=cap_N, may_home=_afresh(work))


def _line(work: OpenBench, step_mm: float) -> str:
    last = work.loop.last_motor
    position = last.position_mm if last is not None else math.nan
    return f"{position:9.3f} mm   {work.loop.last_net_N:+8.3f} N   step {step_mm:g} mm"


def release(bench: Bench) -> dict[str, Any]:
    """Bring the motor to a state without force, read back. Needs no load cell: it may be what is broken.

    Raises `InputError` where the motor cannot be reached, `Refused` where another process uses it, `Stopped` where
    nobody can say that it let go.
    """
    with using([bench.motor.port]):
        return _let_go(bench)


def _let_go(bench: Bench) -> dict[str, Any]:
    try:
        motor, links, rig = _motor_alone(bench)
    except DriverError as error:
        raise InputError(bench.place((error.device, "port")), f"{error.device}: {error.message}") from error

    def conversation() -> Steps[dict[str, Any]]:
        identity = yield from motor.connect()
        found = yield from motor.safe_state("release")
        return {"motor": identity.model, **found}

    try:
        return complete(conversation(), motor.link, links)
    except DriverError as error:
        raise Stopped(
            f"NOT SAFE: that the motor let go could not be read back: {error}\n  use the emergency stop"
        ) from error
    finally:
        motor.link.close()
        if rig is not None:
            rig.close()


def _motor_alone(bench: Bench) -> tuple[Motor, list[Link], Rig | None]:
    if bench.motor.port.startswith("sim://"):
        rig = open_rig(bench)
        return rig.motor, [link for link in rig.links if link is not rig.motor.link], rig
    return drivers.open_motor(bench.motor, WallClock()), [], None
