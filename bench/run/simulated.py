"""From a bench file's `simulation` block to the world behind its `sim://` ports."""

from __future__ import annotations

import contextlib
import os
from typing import TYPE_CHECKING, Any, Literal

from bench.config import Bench, load_model, ports_agree
from bench.errors import InputError
from drivers.regmap import load_map
from drivers.spec import LoadCellSpec, MotorSpec
from sim.faults import FaultError
from sim.world import World, WorldSettings, register

if TYPE_CHECKING:
    from bench.recording.types import StepMark
    from bench.recording.writer import Recorder


def world_of(bench: Bench, clock: Literal["virtual", "wall"] | None = None) -> World:
    """Build and register the simulated bench, so that `sim://NAME/KEY` opens its devices.

    `clock` ("wall", "virtual") overrides the file's. Raises `InputError` where the file describes what cannot be
    simulated.
    """
    ports_agree(bench)
    truth = bench.simulation
    if truth is None or bench.pad_file is None or bench.sim_name is None:
        raise InputError(bench.place(("motor", "port")), "is simulated, but there is no `simulation` block", "add one")
    try:
        world = World(
            WorldSettings(
                name=bench.sim_name,
                model=load_model(bench.pad_file),
                motor=_device(bench.motor, "motor"),
                load_cell=_device(bench.load_cell, "load_cell"),
                seed=truth.seed,
                clock=truth.clock if clock is None else clock,
                surface=truth.surface,
                noise_force_N=truth.noise.force,
                noise_position_mm=truth.noise.position,
                drift_force_N_s=truth.noise.drift,
                faults=truth.faults,
            )
        )
    except FaultError as error:
        path: tuple[str | int, ...] = ("simulation", "faults", error.index)
        raise InputError(bench.place(path), f"simulation.faults[{error.index}]: {error.message}", error.cure) from None
    except ValueError as error:
        raise InputError(bench.place(("simulation",)), str(error)) from error
    register(world)
    return world


class Overheard:
    """A run's recorder, with a simulated bench that hears which step begins: faults may wait for it."""

    def __init__(self, recorder: Recorder, world: World) -> None:
        self.motor, self.force, self.event = recorder.motor, recorder.force, recorder.event
        self.tick, self.problem = recorder.tick, recorder.problem
        self._step = recorder.step
        self._world = world

    def step(self, mark: StepMark) -> None:
        """A stretch of the run begins."""
        self._step(mark)
        self._world.step_begins(mark.name)


def overheard(recorder: Recorder, world: World) -> Recorder | Overheard:
    """Where samples and events go: the recorder, and where the bench is to have faults, it hears of the steps too.

    The fault `disk_full` is of this recorder's file.
    """
    if not world.settings.faults:
        return recorder
    world.host_acts["disk_full"] = lambda: _fill_disk(recorder)
    return Overheard(recorder, world)


def _fill_disk(recorder: Recorder) -> None:
    """From now on the system itself answers every write to the recording with "no space left on device"."""
    wanted = recorder.path.stat()
    full = os.open("/dev/full", os.O_WRONLY)
    for number in range(3, 1024):
        with contextlib.suppress(OSError):
            found = os.fstat(number)
            if (found.st_dev, found.st_ino) == (wanted.st_dev, wanted.st_ino):
                os.dup2(full, number)
    os.close(full)


def _device(spec: MotorSpec | LoadCellSpec, kind: Literal["motor", "load_cell"]) -> dict[str, Any]:
    """The device's part of the bench file as plain values, with its register map's content where it has one."""
    values = spec.model_dump(mode="json")
    if spec.driver not in spec.built_in():
        values["map"] = load_map(spec.driver, spec.map, kind).model_dump(mode="json")
    return values
