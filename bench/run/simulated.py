"""From a bench file's `simulation` block to the world behind its `sim://` ports."""

from __future__ import annotations

from typing import Any, Literal

from bench.config import Bench, load_model
from bench.errors import InputError
from drivers.regmap import load_map
from drivers.spec import LoadCellSpec, MotorSpec
from sim.world import World, WorldSettings, register


def world_of(bench: Bench, clock: Literal["virtual", "wall"] | None = None) -> World:
    """Build and register the simulated bench, so that `sim://NAME/KEY` opens its devices.

    `clock` ("wall", "virtual") overrides the file's. Raises `InputError` where the file describes what cannot be
    simulated.
    """
    for key, other in (("motor", bench.load_cell.port), ("load_cell", bench.motor.port)):
        if not getattr(bench, key).port.startswith("sim://") and other.startswith("sim://"):
            message = f"{key}.port is real, and the other one is simulated: they share neither pad nor time"
            cure = "make both real, or both simulated (--simulated does)"
            raise InputError(bench.place((key, "port")), message, cure)
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
    except ValueError as error:
        part = ("simulation", "faults") if truth.faults else ("simulation",)
        raise InputError(bench.place(part), str(error)) from error
    register(world)
    return world


def _device(spec: MotorSpec | LoadCellSpec, kind: Literal["motor", "load_cell"]) -> dict[str, Any]:
    """The device's part of the bench file as plain values, with its register map's content where it has one."""
    values = spec.model_dump(mode="json")
    if spec.driver not in spec.built_in():
        values["map"] = load_map(spec.driver, spec.map, kind).model_dump(mode="json")
    return values
