"""Whole runs on simulated benches, made from the shipped files with changes; what a test wants to know of one."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

import sim.world
from bench.config import Bench, load_bench, load_model
from bench.plan import Plan
from bench.preflight import check
from bench.protocol import load_protocol
from bench.recording import Recording, read_recording
from bench.run.runner import Outcome, run_protocol
from bench.shipped import find_file
from sim.model import Model
from sim.world import World

SHORT: dict[str, Any] = {
    "name": "short",
    "approach": {"speed": 4, "force": 0.05, "retract": 0.3},
    "limits": {"force": 12, "depth": 2.5},
    "steps": [{"to": 1.0, "speed": 40, "hold": 0.5}, {"to": 0.0, "speed": 20, "hold": 0.3}],
    "finish": {"retract": 0.3, "air": 0.5},
}
"""Some six seconds of bench time."""

AIR: dict[str, Any] = {"name": "air", "approach": "none", "limits": {"force": 12}, "steps": SHORT["steps"]}
"""The same without a pad, of which nothing is fitted."""

Hook = Callable[[float, str], None]


def merged(base: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """`base` with the changes, mappings inside merged likewise; None takes a key away."""
    out = dict(base)
    for key, value in changes.items():
        if value is None and key in out:
            del out[key]
        else:
            both = isinstance(value, Mapping) and isinstance(out.get(key), Mapping)
            out[key] = merged(out[key], value) if both else value
    return out


def bench_file(folder: Path, base: str = "simulated", name: str = "bench.yaml", **changes: Any) -> Path:
    """A shipped bench with changes, as a file; its pad is the shipped polyurethane unless changed."""
    content = yaml.safe_load(find_file("bench", base).read_text("utf-8"))
    content["simulation"]["pad"] = "polyurethane"
    path = folder / name
    path.write_text(yaml.safe_dump(merged(content, changes), sort_keys=False), "utf-8")
    return path


def protocol_file(folder: Path, content: Mapping[str, Any] | str) -> str:
    """A protocol as a file; a word is a shipped one's name."""
    if isinstance(content, str):
        return content
    path = folder / "protocol.yaml"
    path.write_text(yaml.safe_dump(dict(content), sort_keys=False), "utf-8")
    return str(path)


@dataclass
class Done:
    """A run that is over: what came of it, and the simulated bench as it was left."""

    outcome: Outcome
    recording: Recording
    world: World
    bench: Bench
    plan: Plan
    folder: Path

    @property
    def result(self) -> dict[str, Any]:
        """`padbench.result`, JSON unfolded."""
        assert self.recording.result is not None
        found = {}
        for key, text in self.recording.result.items():
            try:
                found[key] = json.loads(text)
            except ValueError:
                found[key] = text
        return found

    @property
    def surface_mm(self) -> float:
        """Where the run believes the surface."""
        assert self.recording.surface_mm is not None
        return self.recording.surface_mm

    @property
    def truth(self) -> Model:
        """The true pad."""
        return self.world.settings.model

    def events(self, name: str) -> list[Any]:
        """The events of a name."""
        return [event for event in self.recording.events if event.name == name]

    def force(self, from_s: float, to_s: float) -> np.ndarray:
        """Net force between two times."""
        cell = self.recording.load_cell
        return cell.force_N[(cell.time_s >= from_s) & (cell.time_s < to_s)]

    def depth(self, from_s: float, to_s: float) -> np.ndarray:
        """Measured positions between two times, from the believed surface."""
        motor = self.recording.motor
        return motor.position_mm[(motor.time_s >= from_s) & (motor.time_s < to_s)] - self.surface_mm

    def stretches(self) -> list[tuple[Any, float]]:
        """Each step mark with the time at which the next one begins."""
        marks = self.recording.steps
        ends = [mark.time_s for mark in marks[1:]] + [float(self.recording.motor.time_s[-1])]
        return list(zip(marks, ends, strict=True))

    def is_safe(self) -> bool:
        """Asked of the device itself: let go, or holding still, as the bench file wants it."""
        plant = self.world.plant
        if self.bench.motor.safe_state == "release":
            return not plant.servo_on
        return plant.servo_on and not plant.moving


def run(
    folder: Path,
    protocol: Mapping[str, Any] | str = SHORT,
    base: str = "simulated",
    *,
    pad: str | None = None,
    hook: Hook | None = None,
    **changes: Any,
) -> Done:
    """Run a protocol on a shipped bench with changes; nothing is fitted. `pad` is what the lab believes."""
    bench = load_bench(bench_file(folder, base, **changes))
    script = load_protocol(protocol_file(folder, protocol))
    preflight = check(script, bench, load_model(pad) if pad else None)
    refusal = preflight.refusal()
    if refusal is not None:
        raise refusal
    out = folder / "run"
    out.mkdir()
    text = find_file("pad", pad).read_text("utf-8") if pad else None
    outcome = run_protocol(script, bench, preflight.plan, out, believed_text=text, progress=hook)
    assert bench.sim_name is not None
    world = sim.world._worlds[bench.sim_name]
    return Done(outcome, read_recording(out), world, bench, preflight.plan, out)


def once(when: Callable[[float, str], bool], action: Callable[[World, float], None]) -> Hook:
    """A hook that does something to the simulated bench once, in the first turn for which `when` holds."""
    done = False

    def hook(bench_s: float, label: str) -> None:
        nonlocal done
        if not done and when(bench_s, label):
            done = True
            action(sim.world._worlds["bench"], bench_s)

    return hook


def falls_silent(key: str) -> Callable[[World, float], None]:
    """The device sends nothing any more."""

    def action(world: World, bench_s: float) -> None:
        world.endpoints[key].line.device_write = lambda data, at_s: at_s  # type: ignore[method-assign]

    return action


def is_unplugged(key: str) -> Callable[[World, float], None]:
    """The port gives an error, as that of an adapter that was pulled out."""

    def gone(*_: Any) -> Any:
        raise OSError(5, "Input/output error")

    def action(world: World, bench_s: float) -> None:
        world.endpoints[key].line.host_read = gone  # type: ignore[method-assign]
        world.endpoints[key].line.host_write = gone  # type: ignore[method-assign]

    return action
