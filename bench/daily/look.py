"""What a bench says of itself while nothing is commanded: who is there, where it stands, how its lines do."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from bench.daily.open_bench import OpenBench
from bench.rates import force_rate_Hz
from bench.run.loop import Script
from drivers.errors import DriverError
from drivers.motor import Motor, MotorIdentity, MotorSample
from drivers.registers import RegisterMotor
from drivers.wire import Exchange, Steps

LOOK_S = 1.0
READS = 20
READ_EVERY_S = 0.02
SERVO_BIT = "servo_on"
"""What a register map calls the bit that says so, as the shipped ones do."""

SLOW_SHARE = 0.9
"""A cell that delivers less than this share of what its line can carry is remarked on."""


@dataclass
class Status:
    """One look. `problems` are what a person must see to, none on a bench that is well; `remarks` are good to know."""

    motor: dict[str, Any] = field(default_factory=dict)
    load_cell: dict[str, Any] = field(default_factory=dict)
    lines: dict[str, Any] = field(default_factory=dict)
    problems: list[str] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)


def status(work: OpenBench) -> Status:
    """Look at both devices; one that does not answer is a problem, and hides nothing of the other."""
    found = Status()

    def script() -> Script[None]:
        yield from _look_at_motor(work, found)
        yield from _look_at_cell(work, found)

    work.look(script())
    found.lines = work.rig.traffic()
    for name, counts in found.lines.items():
        bad = {key: counts[key] for key in ("retries", "timeouts", "bad_frames") if counts[key]}
        if bad and not _silent(found, name):
            listed = ", ".join(f"{count} {key.replace('_', ' ')}" for key, count in bad.items())
            found.problems.append(f"{name}: the line is not clean: {listed}; check cable, shield and termination")
    return found


def _silent(found: Status, name: str) -> bool:
    return any(problem.startswith(f"{name}: ") for problem in found.problems)


def _look_at_motor(work: OpenBench, found: Status) -> Script[None]:
    motor = work.rig.motor
    try:
        identity = yield from work.loop.perform(motor.connect())
        homed = yield from work.loop.perform(motor.is_homed())
        samples: list[MotorSample] = []
        took_s: list[float] = []
        for _ in range(READS):
            exchange = motor.read()
            samples.append((yield from work.loop.perform(_one(exchange))))
            took_s.append(exchange.received_s - exchange.sent_s)
            yield from work.loop.sleep(READ_EVERY_S)
    except DriverError as error:
        found.problems.append(str(error))
        return
    positions = [sample.position_mm for sample in samples]
    last = samples[-1]
    moved_mm = positions[-1] - positions[0]
    lowest, highest = work.bench.limits.position
    found.motor = {
        "model": identity.model,
        **identity.details,
        "homed": homed,
        "energised": _energised(motor, identity),
        "position_mm": last.position_mm,
        "moved_mm": moved_mm,
        "in_limits": lowest <= last.position_mm <= highest,
        "force_N": last.force_N,
        "faults": list(motor.fault_names(last.fault)),
        "answer_ms": 1e3 * float(np.median(took_s)),
        "slowest_answer_ms": 1e3 * max(took_s),
    }
    if last.fault:
        found.problems.append(f"motor: it reports {', '.join(found.motor['faults'])}; clear the cause before a run")
    if not homed:
        found.remarks.append("the axis is not homed: a run homes it first, so does `padbench home`")
    elif not found.motor["in_limits"]:
        found.problems.append(
            f"motor: at {last.position_mm:.3f} mm, outside limits.position [{lowest:g}, {highest:g}] mm; "
            "move it by hand, or home it"
        )
    if abs(moved_mm) > 0.05:
        found.problems.append(
            f"motor: it moved by {moved_mm:+.3f} mm while nothing was commanded: something pushes it, or it sinks"
        )


def _energised(motor: Motor, identity: MotorIdentity) -> bool | None:
    """Whether the motor holds its place by force, from what connecting to it has told; None where it does not tell."""
    if isinstance(motor, RegisterMotor) and SERVO_BIT in motor.map.bits:
        return SERVO_BIT in identity.details["bits"]
    told = identity.details.get("energised")
    return told if isinstance(told, bool) else None


def _look_at_cell(work: OpenBench, found: Status) -> Script[None]:
    try:
        identity, channel = yield from work.listen(LOOK_S)
    except DriverError as error:
        found.problems.append(str(error))
        return
    force = channel.gross_N
    if force.size < 2:
        found.problems.append(f"load_cell: {force.size} readings in {LOOK_S:g} s; check its rate and mode")
        return
    expected_Hz = force_rate_Hz(work.bench)
    rate_Hz = (force.size - 1) / (channel.time_s[-1] - channel.time_s[0])
    capacity = work.bench.load_cell.capacity
    found.load_cell = {
        "model": identity.model,
        **identity.details,
        "gross_N": float(force.mean()),
        "noise_N": float(force.std()),
        "share_of_capacity": float(np.abs(force).max() / capacity),
        "rate_Hz": float(rate_Hz),
        "expected_rate_Hz": expected_Hz,
        "age_ms": 1e3 * float(np.median(channel.received_s - channel.time_s)),
        "overloaded": int(channel.flagged.sum()),
        "flags": dict(work.notebook.flags),
        "calibrated_on": work.bench.load_cell.calibrated_on,
    }
    if channel.flagged.any():
        found.problems.append("load_cell: it reports overload; take the load off before anything else")
    if rate_Hz < SLOW_SHARE * expected_Hz:
        found.problems.append(
            f"load_cell: {rate_Hz:.0f} readings a second where {expected_Hz:.0f} are expected; "
            "a filter or an average in the amplifier, a slow line, or a wrong `rate` in the bench file"
        )


def _one(exchange: Exchange[Any]) -> Steps[Any]:
    """A conversation of one exchange."""
    return (yield exchange)


def words(found: Status) -> list[str]:
    """A few lines for a terminal."""
    lines = []
    motor, cell = found.motor, found.load_cell
    if motor:
        force = f", it feels {motor['force_N']:+.2f} N" if motor["force_N"] is not None else ""
        faults = f"FAULT {', '.join(motor['faults'])}" if motor["faults"] else "no fault"
        homed = "homed" if motor["homed"] else "NOT homed"
        power = {True: ", ENERGISED", False: ", not energised", None: ""}[motor["energised"]]
        lines.append(f"motor      {motor['model']}{power}, {homed}, at {motor['position_mm']:.3f} mm{force}, {faults}")
        lines.append(f"           answers in {motor['answer_ms']:.1f} ms ({motor['slowest_answer_ms']:.1f} at most)")
    if cell:
        lines.append(
            f"load cell  {cell['model']}, {cell['gross_N']:+.3f} N gross, noise {1e3 * cell['noise_N']:.1f} mN, "
            f"{100 * cell['share_of_capacity']:.0f} % of capacity"
        )
        lines.append(
            f"           {cell['rate_Hz']:.0f} readings a second, {cell['age_ms']:.1f} ms old on arrival, "
            f"calibrated on {cell['calibrated_on'] or 'no known date'}"
        )
    lines += [f"note       {remark}" for remark in found.remarks]
    lines += [f"problem    {problem}" for problem in found.problems]
    return [*lines, "nothing was moved, nothing switched on" + ("" if found.problems else "; all is well")]
