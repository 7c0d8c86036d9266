"""One run from open ports to a closed recording; what is made of the data afterwards is not its business."""

from __future__ import annotations

import datetime
import gc
import hashlib
import importlib.metadata
import math
import platform
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import yaml

from bench.config import Bench
from bench.errors import InputError, Refused, Stopped
from bench.plan import Plan
from bench.protocol import Protocol
from bench.rates import force_rate_Hz, motor_rate_Hz
from bench.recording.unfinished import Left
from bench.recording.writer import Recorder
from bench.run.axis import Axis
from bench.run.folder import RECORDING
from bench.run.foresight import Foresight
from bench.run.loop import Loop
from bench.run.rig import Rig, is_simulated, open_rig
from bench.run.safety import Blame, Envelope, Monitor
from bench.run.script import Findings, Run
from bench.run.signals import SIGNALS as SIGNALS
from bench.run.signals import Operator, listening
from bench.run.touchoff import warm_up
from bench.shipped import MODEL
from bench.yamlfile import parse, validate
from drivers.errors import DriverError

HOST_PACKAGES = ("padbench", "numpy", "scipy", "numba", "pymodbus", "pyserial", "mcap")

Progress = Callable[[float, str], None]
"""Told now and then: seconds of bench time since the start, and what the run is doing."""


@dataclass(frozen=True)
class Notes:
    """What the person at the bench says about the run."""

    sample: str | None = None
    operator: str | None = None
    note: str | None = None
    conditions: str | None = None
    since_contact_s: float | None = None
    """For how long the pad had been left alone: since it was mounted, or touched last."""


@dataclass(frozen=True)
class Outcome:
    """How a run ended: `cause` is None when the protocol ran to its end, else the first thing that went wrong."""

    folder: Path
    cause: str | None
    findings: Findings
    bench_seconds: float
    motor_samples: int
    force_samples: int
    held_up_s: float
    """By how much moves took longer than planned, because the motor answered too slowly."""
    motor_period_s: float
    strikes: int = 0
    """How often the operator, or the system, has asked it to stop."""

    @property
    def recording(self) -> Path:
        """The MCAP file."""
        return self.folder / RECORDING


def run_protocol(
    protocol: Protocol,
    bench: Bench,
    plan: Plan,
    folder: Path,
    *,
    believed_text: str | None = None,
    notes: Notes | None = None,
    progress: Progress | None = None,
    planned_s: float | None = None,
    left: Left | None = None,
) -> Outcome:
    """Run the plan of a protocol on a bench and record it in `folder`.

    `planned_s`: how long it will take, for the room on the disk. `left`: what the run before this one left behind.
    The first thing that goes wrong stops the motor, is recorded and comes back as `Outcome.cause`; the data are kept.
    Raises `InputError` where a port cannot be opened, a device does not answer or the recording cannot be made:
    nothing has been commanded then, and nothing is recorded that is worth keeping.
    """
    bench = _as_sampled(bench, protocol)
    try:
        rig = open_rig(bench, f"the run {folder.resolve()}")
    except DriverError as error:
        raise InputError(bench.place((error.device, "port")), f"{error.device}: {error.message}") from error
    warm_up()
    operator = Operator()
    foresight = _foresight(believed_text, plan)
    with rig, _undisturbed(), listening(operator):  # to the end of the recording: a late signal must not tear it
        virtual = rig.world is not None and not rig.world.clock.wall
        mode: Literal["inline", "process"] = "inline" if virtual else "process"
        force_Hz = force_rate_Hz(bench, protocol.sampling.load_cell)
        motor_Hz = motor_rate_Hz(bench, protocol.sampling.motor)
        path, per_s = folder / RECORDING, force_Hz + motor_Hz
        made = Recorder(path, rig.clock, mode=mode, planned_s=planned_s, samples_per_s=per_s)
        with _kept_once_begun(made) as recorder:
            recorder.begin(
                _run_record(protocol, bench, notes or Notes()),
                _host_record(),
                simulation=rig.world.truth() if rig.world is not None else None,
                attachments=_attachments(protocol, bench, believed_text),
            )
            if left is not None:
                found = {"folder": str(left.folder), "why": left.why, "pressing": left.pressing}
                seen = {"position_mm": left.position_mm, "force_N": left.force_N, "surface_mm": left.surface_mm}
                known = {key: value for key, value in seen.items() if value is not None}
                recorder.event(rig.clock.now(), "left_behind", {**found, **known})
            monitor = Monitor(envelope_of(bench, plan))
            monitor.frozen.expect(force_Hz, bench.limits.stale)
            axis = Axis(rig.motor, 1.0 / motor_Hz, bench.limits.following_error)
            loop = Loop(rig, axis, monitor, recorder, operator)
            if rig.world is not None:
                from bench.run.simulated import overheard

                loop.sink = overheard(recorder, rig.world)
            loop.foresight = foresight
            return _run(rig, loop, recorder, protocol, bench, plan, folder, progress)


def _run(
    rig: Rig,
    loop: Loop,
    recorder: Recorder,
    protocol: Protocol,
    bench: Bench,
    plan: Plan,
    folder: Path,
    progress: Progress | None,
) -> Outcome:
    run = Run(loop, protocol, bench, plan)
    started = rig.clock.now()
    if progress is not None:
        tell = progress
        loop.on_turn = lambda now: tell(now - started, run.label)
    cause: str | None = None
    failure: Exception | None = None
    try:
        loop.run(run.phases())
    except Stopped as stop:
        cause = stop.cause
        if loop.monitor.cause is None:  # said by the script: what is crossed from now on is not the first
            loop.monitor.violate(cause, _blame(stop))
    except InputError:
        raise  # no device was reached, none was commanded
    except Exception as error:  # a defect of ours: the motor is stopped all the same, then it is told
        cause, failure = f"a defect of padbench: {type(error).__name__}: {error}", error
        loop.monitor.violate(cause, "run")
    if cause is not None:
        recorder.log("error", cause)
        _wind_down(loop, run, cause)
    seconds = rig.clock.now() - started
    problem = recorder.finish(
        {
            "status": "done" if cause is None else "stopped",
            "cause": cause or "",
            "bench_seconds": f"{seconds:.3f}",
            "overruns": loop.axis.overruns,
            "held_up_s": f"{loop.axis.held_up_s:.3f}",
            "late_turns": loop.late_turns,
            "longest_turn_s": f"{loop.longest_turn_s:.4f}",
            "traffic": rig.traffic(),
            "safe_state": run.found.safe_state,
            **({"not_safe": run.found.not_safe} if run.found.not_safe else {}),
        }
    )
    if failure is not None:
        raise failure
    counts = loop.motor_count, loop.force_count
    axis, strikes = loop.axis, loop.operator.strikes
    return Outcome(folder, cause or problem, run.found, seconds, *counts, axis.held_up_s, axis.period_s, strikes)


@contextmanager
def _kept_once_begun(recorder: Recorder) -> Iterator[Recorder]:
    """Takes the recording of a run away again where no device was reached: nothing was measured."""
    try:
        with recorder:
            yield recorder
    except (InputError, Refused):
        recorder.path.unlink(missing_ok=True)
        raise


def _wind_down(loop: Loop, run: Run, cause: str) -> None:
    """Stop and make safe; a second failure is recorded beside the first, and never replaces it."""
    loop.monitor.stopping = True  # before the loop's first turn, which would raise the first cause again
    try:
        loop.run(run.wind_down(cause))
    except Exception as error:  # whatever it is, the first cause and the data come before it
        run.found.not_safe = str(error)
        loop.sink.event(loop.clock.now(), "stop_incomplete", {"message": str(error)})


@contextmanager
def _undisturbed() -> Iterator[None]:
    """What is in memory by now is not searched for garbage during the run: that can take longer than a watchdog."""
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()


def _blame(stop: Stopped) -> Blame:
    """What a script has stopped for: a device that failed it, or the protocol."""
    error = stop.__cause__
    if isinstance(error, DriverError):
        return "cell" if error.device == "load_cell" else "motor"
    return "run"


def _foresight(believed_text: str | None, plan: Plan) -> Foresight | None:
    """The believed pad beside the run, where there is one and a pad to believe in."""
    if believed_text is None or plan.in_air:
        return None
    from sim.model import Model

    believed = validate(parse(believed_text, Path(MODEL)), Model)  # as every other command reads it
    return Foresight(believed, plan.limits)


def _as_sampled(bench: Bench, protocol: Protocol) -> Bench:
    """The bench with the load cell at the rate the protocol asks for: polled, since what a cell sends is its own."""
    rate = protocol.sampling.load_cell
    if rate is None:
        return bench
    update: dict[str, object] = {"rate": rate}
    if bench.load_cell.driver in ("dad141", "mt_sics"):
        update["mode"] = "poll"
    return bench.model_copy(update={"load_cell": bench.load_cell.model_copy(update=update)})


def envelope_of(bench: Bench, plan: Plan) -> Envelope:
    """What a run must stay within: the tighter of bench and protocol."""
    limits = bench.limits
    return Envelope(
        force_N=plan.limits.force_N,
        tension_N=limits.tension,
        gross_N=bench.load_cell.capacity,
        position_mm=limits.position,
        speed_mm_s=plan.limits.speed_mm_s,
        following_error_mm=limits.following_error,
        stale_s=limits.stale,
        depth_mm=plan.limits.depth_mm if not plan.in_air else math.inf,
        moving_mass_kg=bench.motor.moving_mass,
    )


def _run_record(protocol: Protocol, bench: Bench, notes: Notes) -> dict[str, object]:
    """`padbench.run`: everything the data depend on, and what people call it."""
    sample = protocol.sample.model_dump(exclude_none=True)
    if notes.sample is not None:
        sample["id"] = notes.sample
    return {
        "protocol": protocol.name,
        "protocol_sha256": hashlib.sha256(protocol.text.encode()).hexdigest(),
        "bench": bench.name,
        "bench_sha256": hashlib.sha256(bench.text.encode()).hexdigest(),
        "simulated": is_simulated(bench),
        "seed": bench.simulation.seed if bench.simulation is not None and is_simulated(bench) else "",
        "sample": sample,
        "operator": notes.operator or "",
        "note": notes.note or "",
        "conditions": notes.conditions or "",
        **({"since_contact_s": notes.since_contact_s} if notes.since_contact_s is not None else {}),
        "probe": bench.machine.probe.model_dump(exclude_none=True),
        "motor": bench.motor.driver,
        "load_cell": bench.load_cell.driver,
        "timing": bench.timing.model_dump(mode="json"),
    }


def _host_record() -> dict[str, object]:
    """`padbench.host`: what may differ between two runs of one seed."""
    versions = {}
    for package in HOST_PACKAGES:
        try:
            versions[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            versions[package] = "not installed"
    return {
        "started": datetime.datetime.now().astimezone().isoformat(timespec="milliseconds"),
        "python": platform.python_version(),
        "system": platform.platform(),
        "versions": versions,
    }


def _attachments(protocol: Protocol, bench: Bench, believed_text: str | None) -> dict[str, str | bytes]:
    files: dict[str, str | bytes] = {"protocol.yaml": protocol.text, "bench.yaml": bench.text}
    if believed_text is not None:
        files["model.yaml"] = believed_text
    for key, spec in (("motor", bench.motor), ("load_cell", bench.load_cell)):
        if isinstance(spec.map, dict):
            files[f"{key}_map.yaml"] = yaml.safe_dump(spec.map, sort_keys=False)
    return files
