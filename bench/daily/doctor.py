"""A check-up of a bench: what it is asked, what it does, what is made of the answers.

Everything moves under the run's own monitor, in small steps and under a force cap. The order is that of trust: first
who is there and which way is forth, then steps in air, and only with `press` a gentle press into a pad.
"""

from __future__ import annotations

import datetime
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from bench.daily.checkup import delay, standing, steps
from bench.daily.checkup.finding import Checkup, Finding
from bench.daily.checkup.usb import latency_timers
from bench.daily.hand import step_by
from bench.daily.open_bench import OpenBench
from bench.errors import Refused, Stopped
from bench.protocol import Approach
from bench.recording.types import ForceChannel, MotorChannel, Recording, StepMark
from bench.run.approach import tare, touch_off
from bench.run.loop import Script
from bench.run.motion import Mover

NUDGE_MM, NUDGE_MM_S = 0.1, 0.5
NUDGE_SHARE = 0.2
"""The nudge must be measured to this share of itself."""

STEP_MM = 0.15
STEPS = 6
REST_AFTER_STEP_S = 0.4
BAND_MM = 0.003
APPROACH = Approach(speed=1.0, force=0.05, retract=0.3)
PRESS_SHARE = 0.4
"""Of the force cap: how hard the press is while it is slow; faster strokes are felt up to twice as hard."""

STROKES = 4
STROKE_SPEEDS_MM_S = (2.0, 10.0, 40.0)
IN_S, OUT_S, RESTED_S = 0.3, 0.4, 2.0
"""How long a stroke stays in the pad, and out of it; and how long the pad rests before the first."""

OLD_DAYS = 400
TURNED_OVER = ("tension limit", "load_cell.sign")
"""What the run's own judges say where a press pulls."""


@dataclass(frozen=True)
class Wishes:
    """What the check-up is to do. `confirm(question)` asks the person; `press`: there is a pad in the way."""

    seconds: float
    cap_N: float
    press: bool
    confirm: Callable[[str], bool]


def examine(work: OpenBench, wishes: Wishes, checkup: Checkup) -> None:
    """The whole check-up, put into `checkup` as it comes.

    Raises `Stopped` where a limit was met, `Refused` where it cannot go on; what was found until then stays found.
    """
    free = work.bench.all_simulated
    moved_mm = work.move(lambda: _nudge(work), force_cap_N=wishes.cap_N, pull_too=True, may_home=free)
    _identities(work, checkup)
    if not _direction(wishes, checkup, moved_mm):
        return
    work.notebook.clear()
    air = work.move(lambda: _in_air(work, wishes.seconds), force_cap_N=wishes.cap_N, pull_too=True, may_home=free)
    _judge_air(work, wishes, checkup, air)
    if wishes.press:
        _press(work, wishes, checkup)
    figures, findings = latency_timers(work.bench)
    checkup.add("adapters", figures, findings)
    _lines(work, checkup)


# -- who is there, which way is forth ----------------------------------------------------------------------------------


def _identities(work: OpenBench, checkup: Checkup) -> None:
    devices = work.notebook.data_of("devices") or {}
    cell = work.bench.load_cell
    findings = [
        Finding("motor", str(devices.get("motor", "?"))),
        Finding(
            "load cell", f"{devices.get('load_cell', '?')}, unit {cell.unit}, scale {cell.scale:g}, sign {cell.sign:+d}"
        ),
    ]
    if cell.calibrated_on is None:
        means = "nobody knows whether a newton is a newton"
        findings.append(Finding("calibration", "no date", False, means, "padbench calibrate, with dead weights"))
    elif (datetime.date.today() - cell.calibrated_on).days > OLD_DAYS:
        findings.append(Finding("calibration", f"of {cell.calibrated_on}", False, "it is old", "padbench calibrate"))
    else:
        findings.append(Finding("calibration", f"of {cell.calibrated_on}"))
    checkup.add("devices", devices, findings)


def _nudge(work: OpenBench) -> Script[float]:
    """Forth by a tenth of a millimetre, and back; how far it was measured to go."""
    begun = work.loop.last_motor.position_mm if work.loop.last_motor is not None else math.nan
    done = yield from step_by(work, NUDGE_MM, NUDGE_MM_S)
    yield from step_by(work, -NUDGE_MM, NUDGE_MM_S)
    return done.position_mm - begun


def _direction(wishes: Wishes, checkup: Checkup, moved_mm: float) -> bool:
    figures = {"asked_mm": NUDGE_MM, "moved_mm": moved_mm}
    if abs(moved_mm - NUDGE_MM) > NUDGE_SHARE * NUDGE_MM:
        do = "is the axis blocked, the scale of its register map right, the servo on?"
        means = f"{NUDGE_MM:g} mm were asked for"
        checkup.add("direction", figures, [Finding("direction", f"it moved {moved_mm:+.3f} mm", False, means, do)])
        return False
    seen = wishes.confirm(f"The axis went {NUDGE_MM:g} mm forth and back. Did it go towards the pad first?")
    figures["confirmed"] = seen
    if not seen:
        finding = Finding(
            "direction", "it moves away from the pad where it should go in", False,
            "every limit of depth and travel would be on the wrong side",
            "turn motor.direction in the bench file, and run doctor again; nothing else was tried",
        )  # fmt: skip
        checkup.add("direction", figures, [finding])
        return False
    checkup.add("direction", figures, [Finding("direction", f"{1e3 * moved_mm:+.0f} µm, towards the pad")])
    return True


# -- in air ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Air:
    """What was recorded in air: standing, and stepping with each step's (began_s, ended_s, from_mm, to_mm)."""

    standing: tuple[MotorChannel, ForceChannel]
    stepping: tuple[MotorChannel, ForceChannel]
    spans: list[tuple[float, float, float, float]]


def _in_air(work: OpenBench, seconds: float) -> Script[_Air]:
    """Stand, then step away from the pad and back, as fast as the limits allow. Nothing is computed meanwhile: there
    is a motor to feed."""
    notebook, limits = work.notebook, work.bench.limits
    mover = Mover(work.loop, work.shape(limits.acceleration))
    start = mover.here()
    lowest, highest = limits.position
    way = -STEP_MM if start - STEP_MM >= lowest else STEP_MM
    if start + way > highest:
        raise Refused(f"there is no room for a step of {STEP_MM:g} mm within limits.position")
    notebook.clear()
    yield from work.loop.sleep(seconds)
    standing_still = notebook.motor_channel(), notebook.force_channel()
    notebook.clear()
    spans = []
    for number in range(STEPS):
        before, target = (start, start + way) if number % 2 == 0 else (start + way, start)
        yield from work.loop.sleep(0.05)
        began_s = work.clock.now()
        yield from mover.go(target, limits.speed)
        yield from work.loop.sleep(REST_AFTER_STEP_S)
        spans.append((began_s, work.clock.now(), before, target))
    return _Air(standing_still, (notebook.motor_channel(), notebook.force_channel()), spans)


def _judge_air(work: OpenBench, wishes: Wishes, checkup: Checkup, air: _Air) -> None:
    motor, cell = air.standing
    checkup.add("rates", *standing.rates(work.bench, motor, cell))
    checkup.add("values", *standing.values(work.bench, cell))
    checkup.add("noise", *standing.noise(cell, APPROACH.force))
    checkup.add("motor_noise", {"position_mm": float(np.std(motor.position_mm))}, [])
    motor, cell = air.stepping
    each = [
        steps.step_figures(_between(motor, began_s - 0.02, ended_s), before, target, began_s, BAND_MM)
        for began_s, ended_s, before, target in air.spans
    ]
    checkup.add("step", *steps.judged(each, work.bench.limits.following_error))
    found = delay.in_air(motor, cell)
    if found is None:
        finding = Finding(
            "delay", "not to be told in air: the cell feels nothing of the motion", None, "",
            "" if wishes.press else "lay a pad below, and add --press",
        )  # fmt: skip
        checkup.add("delay", {"in_air": None}, [] if wishes.press else [finding])
    else:
        _delay(work, checkup, "in_air", found, told=not wishes.press)


def _between(motor: MotorChannel, from_s: float, to_s: float) -> MotorChannel:
    part = (motor.time_s >= from_s) & (motor.time_s <= to_s)
    arrays = (motor.time_s, motor.position_mm, motor.command_mm, motor.force_N, motor.received_s)
    return MotorChannel(*(values[part] for values in arrays))


# -- in a pad ----------------------------------------------------------------------------------------------------------


def _press(work: OpenBench, wishes: Wishes, checkup: Checkup) -> None:
    try:
        recording = work.move(
            lambda: _strokes(work, wishes.cap_N), force_cap_N=wishes.cap_N, pull_too=True,
            may_home=work.bench.all_simulated,
        )  # fmt: skip
    except Stopped as stop:
        if not any(words in stop.cause for words in TURNED_OVER):
            raise
        finding = Finding(
            "load cell's sign", "a press reads as a pull", False, "no limit of compression would ever be met",
            "turn load_cell.sign in the bench file, and run doctor again",
        )  # fmt: skip
        checkup.add("press", {"stopped": stop.cause}, [finding])
        return
    sign = Finding("load cell's sign", "a press reads positive")
    checkup.add("press", {"surface_mm": recording.surface_mm, "strokes": STROKES * len(STROKE_SPEEDS_MM_S)}, [sign])
    found = delay.in_contact(recording)
    if found is None:
        finding = Finding("delay", "not to be told", False, "the force hardly follows the strokes", "is it a soft pad?")
        checkup.add("delay", {"in_contact": None}, [finding])
    else:
        _delay(work, checkup, "in_contact", found, told=True)


def _strokes(work: OpenBench, cap_N: float) -> Script[Recording]:
    """Find the pad, press it to a share of the cap, and stroke into it and out again, each time faster."""
    loop, limits, notebook = work.loop, work.bench.limits, work.notebook
    mover = Mover(loop, work.shape(limits.acceleration))
    start = mover.here()
    notebook.clear()
    air = yield from tare(loop, mover, APPROACH, 1.0)
    surface = yield from touch_off(loop, mover, APPROACH, air, 0.5 * APPROACH.speed / 8.0 * loop.axis.period_s)
    level_N = PRESS_SHARE * cap_N
    deepest = loop.monitor.envelope.position_mm[1]
    reached = yield from mover.go_until(deepest, APPROACH.speed, lambda: loop.last_net_N >= level_N)
    if not reached:
        raise Stopped(f"{level_N:g} N were not reached within limits.position: raise the pad, or lower --force-cap")
    deep, out = mover.here(), surface.position_mm - APPROACH.retract
    yield from mover.go(out, 5.0)
    yield from loop.sleep(RESTED_S)
    loop.sink.step(StepMark(work.clock.now(), "strokes", "steps", "ramp"))
    for wanted in STROKE_SPEEDS_MM_S:
        speed = min(wanted, limits.speed)
        for _ in range(STROKES):
            yield from mover.go(deep, speed)
            yield from loop.sleep(IN_S)
            yield from mover.go(out, speed)
            yield from loop.sleep(OUT_S)
    yield from mover.go(min(start, out), 5.0)
    yield from mover.settle()
    return notebook.recording(work.bench.name, surface.position_mm, surface.std_mm)


# -- what is left ------------------------------------------------------------------------------------------------------


def _delay(work: OpenBench, checkup: Checkup, where: str, found: delay.Delay, *, told: bool) -> None:
    timing = work.bench.timing
    known_s = timing.force_delay - timing.position_delay
    findings = [delay.judged(found, known_s)] if told else []
    checkup.add("delay", {where: found.to_json(), "in_bench_file_s": known_s}, findings)


def _lines(work: OpenBench, checkup: Checkup) -> None:
    traffic = work.rig.traffic()
    findings = []
    for name, counts in traffic.items():
        bad = {key: counts[key] for key in ("retries", "timeouts", "bad_frames") if counts[key]}
        if bad:
            listed = ", ".join(f"{count} {key.replace('_', ' ')}" for key, count in bad.items())
            means = "what is repeated comes late, and a stop with it"
            do = "cable, shield, termination; local echo off; baud rate and parity as in the device"
            findings.append(Finding(f"{name} line", listed, False, means, do))
        else:
            findings.append(Finding(f"{name} line", f"{counts['exchanges']} exchanges, none repeated"))
    checkup.add("lines", {**traffic, "overruns": work.axis.overruns}, findings)


def measured_delay(checkup: Checkup) -> dict[str, Any] | None:
    """The delay to be written: that in contact, else that in air, else none."""
    figures = checkup.figures.get("delay", {})
    found = figures.get("in_contact") or figures.get("in_air")
    return dict(found) if found else None
