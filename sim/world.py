"""A simulated bench: one clock, the axis with the pad before it, two devices on their lines.

Importing this module lets pyserial open `sim://NAME/KEY`: NAME is a registered world's, KEY the device's key in
the bench file.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal
from urllib.parse import urlsplit

import numpy as np
import serial

from sim.axis import BenchPlant, ServoSettings
from sim.clock import SimClock, SteppedClock
from sim.devices import load_cell_device, motor_device
from sim.faults import install, read_faults
from sim.faults.host import own_acts
from sim.faults.site import Site
from sim.line import Line
from sim.model import Model
from sim.noise import GaussianNoise, generator

SURFACE_mm = (0.5, 2.0)
"""How far above its start the surface stands where it is random."""


@dataclass(frozen=True)
class WorldSettings:
    """What is simulated.

    `model` is the true pad with its hidden effects; `surface` its motor-frame height in mm, or "random" (drawn from
    the seed); noises are standard deviations of one unfiltered reading; `drift_force_N_s` a steady drift of the
    load cell. `motor` and `load_cell` are those parts of the bench file as dicts (`driver`, `address`, `baudrate`,
    `parity`, `gap_us`, `direction`, `stroke`, `moving_mass`, `orientation`, `max_speed`, `max_acceleration`, `map`;
    `driver`, `baudrate`, `address`, `unit`, `scale`, `sign`, `capacity`, `decimals`, `map`); `map` is a register
    map's content. `faults` are entries of a bench file's `simulation.faults` (see `sim.faults`).
    """

    name: str
    model: Model
    motor: Mapping[str, Any]
    load_cell: Mapping[str, Any]
    seed: int = 1
    clock: Literal["virtual", "wall"] = "virtual"
    surface: float | Literal["random"] = "random"
    noise_force_N: float = 0.0
    noise_position_mm: float = 0.0
    drift_force_N_s: float = 0.0
    faults: list[Any] = field(default_factory=list)


@dataclass(frozen=True)
class Endpoint:
    """A device and the line that leads to it."""

    key: str
    line: Line
    device: object

    @property
    def tcp(self) -> bool:
        """Whether the device speaks over a network: its line has no wire time."""
        return self.line.baudrate == 0


class World:
    """A running simulated bench. The same settings make the same bytes, for the same questions at the same times.

    Starts with the axis at motor position 0 (or the end of the stroke next to it), the probe in air.
    Raises ValueError for a driver that has no simulated device, and `FaultError` for a fault that cannot be.
    `clock` is the host's; the devices live on `true_clock`, which is the same one but where a fault sets the host's.
    """

    def __init__(self, settings: WorldSettings) -> None:
        faults = read_faults(settings.faults)
        self.settings = settings
        self.true_clock = SimClock(wall=settings.clock == "wall")
        self.clock: SimClock = self.true_clock
        if any(fault.kind.name == "clock_step" for fault in faults):
            self.clock = SteppedClock(self.true_clock)
        motor = settings.motor
        low_mm, high_mm = (float(end) for end in motor["stroke"])
        start_mm = min(max(0.0, low_mm), high_mm)
        self.surface_mm = self._surface(start_mm, high_mm)
        self.plant = BenchPlant(_servo(motor), settings.model, self.surface_mm, start_mm)
        self.endpoints: dict[str, Endpoint] = {}
        position_noise = GaussianNoise(generator(settings.seed, "position"), settings.noise_position_mm)
        force_noise = GaussianNoise(generator(settings.seed, "force"), settings.noise_force_N)
        self._connect("motor", *motor_device(motor, self.true_clock, self.plant, position_noise))
        self._connect(
            "load_cell",
            *load_cell_device(settings.load_cell, self.true_clock, self.plant, force_noise, settings.drift_force_N_s),
        )
        self.host_acts: dict[str, Callable[[], None]] = dict(own_acts())
        self.site = Site(self)
        install(faults, self.site)

    @property
    def devices(self) -> dict[str, object]:
        """The devices by their keys in the bench file."""
        return {key: endpoint.device for key, endpoint in self.endpoints.items()}

    def fault_generator(self, index: int) -> np.random.Generator:
        """The random numbers of the fault at a place in the list; nothing else draws from them."""
        return generator(self.settings.seed, "faults", index)

    def step_begins(self, name: str) -> None:
        """To be told by the run: the step of that name begins. Faults that name a step wait for it."""
        self.site.step_begins(name)

    def truth(self) -> dict[str, Any]:
        """What a fit must not see: the pad, where its surface is, noise, seed. Plain values, for a record."""
        settings = self.settings
        return {
            "model": settings.model.to_dict(),
            "surface_mm": self.surface_mm,
            "noise": {
                "force_N": settings.noise_force_N,
                "position_mm": settings.noise_position_mm,
                "force_drift_N_s": settings.drift_force_N_s,
            },
            "seed": settings.seed,
            "clock": settings.clock,
            "faults": list(settings.faults),
        }

    def _connect(self, key: str, line: Line, device: object) -> None:
        self.endpoints[key] = Endpoint(key, line, device)

    def _surface(self, start_mm: float, high_mm: float) -> float:
        surface = self.settings.surface
        if surface != "random":
            return float(surface)
        nearest, farthest = (min(start_mm + way, high_mm) for way in SURFACE_mm)
        return float(generator(self.settings.seed, "surface").uniform(nearest, farthest))


def _servo(motor: Mapping[str, Any]) -> ServoSettings:
    low_mm, high_mm = motor["stroke"]
    given: dict[str, Any] = {"stroke_mm": (float(low_mm), float(high_mm))}
    for key, name in (
        ("moving_mass", "moving_mass_kg"),
        ("max_speed", "max_speed_mm_s"),
        ("max_acceleration", "max_acceleration_mm_s2"),
    ):
        if motor.get(key) is not None:
            given[name] = float(motor[key])
    return ServoSettings(vertical=motor.get("orientation") == "vertical", **given)


# -- names -----------------------------------------------------------------------------------------------------------

_worlds: dict[str, World] = {}


def register(world: World) -> None:
    """Make a world's devices reachable as `sim://NAME/KEY`; one that had the name before is forgotten."""
    _worlds[world.settings.name] = world


def unregister(name: str) -> None:
    """Forget a world; harmless when there is none of that name."""
    _worlds.pop(name, None)


def lookup(url: str) -> Endpoint:
    """The device behind `sim://NAME/KEY`. Raises `SerialException` that says what there is."""
    parts = urlsplit(url)
    world = _worlds.get(parts.netloc)
    key = parts.path.strip("/")
    if world is None or key not in world.endpoints:
        there_are = [f"sim://{name}/{key}" for name, world in _worlds.items() for key in world.endpoints]
        listed = ", ".join(there_are) if there_are else "none; a simulated bench registers its own"
        raise serial.SerialException(f"there is no simulated device at {url} (there are: {listed})")
    refusal = world.endpoints[key].line.refusal
    if refusal is not None:
        raise serial.SerialException(f"could not open port {url}: {refusal}")
    return world.endpoints[key]


if "sim" not in serial.protocol_handler_packages:
    serial.protocol_handler_packages.append("sim")
