"""Simulated devices: one file a device family, each speaking that vendor's bytes.

`motor_device` and `load_cell_device` make one from what a bench file says about it. A new device is one file and
one entry in the tables here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

from sim.axis import BenchPlant
from sim.clock import SimClock
from sim.devices.amplifier import NEWTONS, Amplifier
from sim.devices.dad141 import Dad141
from sim.devices.dad141_modbus import Dad141Modbus
from sim.devices.drive import Drive
from sim.devices.iai import Iai
from sim.devices.laumas import Laumas
from sim.devices.mt_sics import MtSics
from sim.devices.orca import Orca
from sim.devices.smc_lec import SmcLec
from sim.line import Line
from sim.noise import GaussianNoise

Settings: TypeAlias = Mapping[str, Any]
"""A device's part of the bench file: driver, baudrate, address, direction … (see `WorldSettings`)."""


def motor_device(spec: Settings, clock: SimClock, plant: BenchPlant, noise: GaussianNoise) -> tuple[Line, object]:
    """The line and the motor at its end. Raises ValueError where no device is simulated for the driver."""
    return _MOTORS[device_name(spec, "motor", _MOTORS)](spec, clock, plant, noise)


def load_cell_device(
    spec: Settings, clock: SimClock, plant: BenchPlant, noise: GaussianNoise, drift_N_s: float
) -> tuple[Line, object]:
    """The line and the load cell's amplifier at its end. Raises ValueError where none is simulated for the driver."""
    make = _LOAD_CELLS[device_name(spec, "load_cell", _LOAD_CELLS)]
    scale = float(spec.get("scale") or 1.0) * float(spec.get("sign") or 1)
    amplifier = Amplifier(
        clock,
        plant,
        noise,
        capacity_N=float(spec["capacity"]),
        newtons_per_unit=NEWTONS[str(spec.get("unit") or "N")] * scale,
        decimals=spec.get("decimals"),
        drift_N_s=drift_N_s,
    )
    return make(spec, clock, amplifier)


def device_name(spec: Settings, key: str, known: Mapping[str, object]) -> str:
    """Which simulated device stands for a driver: that of its own name, or that its register map names.

    Raises ValueError that says which are simulated.
    """
    driver = str(spec.get("driver"))
    for name in (driver, str(_map(spec).get("name"))):
        if name in known:
            return name
    raise ValueError(f"{key}: no simulated device speaks to driver {driver!r}; there are {', '.join(known)}")


def _map(spec: Settings) -> Mapping[str, Any]:
    given = spec.get("map")
    return given if isinstance(given, Mapping) else {}


def _link(spec: Settings, key: str, default: Any) -> Any:
    """A setting of the line: the bench file's, else the register map's, else the device's default."""
    if spec.get(key) is not None:
        return spec[key]
    link = _map(spec).get("link") or {}
    return link.get(key, default)


def _orca(spec: Settings, clock: SimClock, plant: BenchPlant, noise: GaussianNoise) -> tuple[Line, object]:
    """Set up as its maker advises: 80 µs interframe delay from 625 000 baud on, 2000 µs as delivered else."""
    baudrate = int(spec.get("baudrate") or 19200)
    gap_us = spec.get("gap_us")
    if gap_us is None:
        gap_us = 80 if baudrate >= 625_000 else 2000
    line = Line(clock, baudrate, str(spec.get("parity") or "E"))
    drive = Drive(clock, plant, noise, direction=int(spec.get("direction") or 1), quantum_mm=0.001)
    return line, Orca(line, drive, address=int(spec.get("address") or 1), delay_us=int(gap_us))


def _iai(spec: Settings, clock: SimClock, plant: BenchPlant, noise: GaussianNoise) -> tuple[Line, object]:
    line = Line(clock, int(_link(spec, "baudrate", 38400)), str(_link(spec, "parity", "N")), half_duplex=True)
    drive = Drive(clock, plant, noise, direction=int(spec.get("direction") or 1), quantum_mm=0.01)
    max_speed_mm_s = float(spec.get("max_speed") or 1000.0)
    return line, Iai(line, drive, address=int(spec.get("address") or 1), max_speed_mm_s=max_speed_mm_s)


def _smc_lec(spec: Settings, clock: SimClock, plant: BenchPlant, noise: GaussianNoise) -> tuple[Line, object]:
    line = Line(clock, int(_link(spec, "baudrate", 38400)), str(_link(spec, "parity", "N")), half_duplex=True)
    drive = Drive(clock, plant, noise, direction=int(spec.get("direction") or 1), quantum_mm=0.01)
    max_speed_mm_s = float(spec.get("max_speed") or 2000.0)
    return line, SmcLec(line, drive, address=int(spec.get("address") or 1), max_speed_mm_s=max_speed_mm_s)


def _dad141(spec: Settings, clock: SimClock, amplifier: Amplifier) -> tuple[Line, object]:
    line = Line(clock, int(spec.get("baudrate") or 115200), str(spec.get("parity") or "N"))
    return line, Dad141(line, amplifier, address=int(spec.get("address") or 0))


def _dad141_modbus(spec: Settings, clock: SimClock, amplifier: Amplifier) -> tuple[Line, object]:
    tcp = _link(spec, "transport", "tcp") == "tcp"
    baudrate = 0 if tcp else int(_link(spec, "baudrate", 115200))
    line = Line(clock, baudrate, str(_link(spec, "parity", "N")), half_duplex=not tcp)
    address = spec.get("address")
    return line, Dad141Modbus(line, amplifier, address=1 if address is None else int(address), tcp=tcp)


def _mt_sics(spec: Settings, clock: SimClock, amplifier: Amplifier) -> tuple[Line, object]:
    line = Line(clock, int(spec.get("baudrate") or 9600), str(spec.get("parity") or "N"))
    return line, MtSics(line, amplifier, unit=str(spec.get("unit") or "N"))


def _laumas(spec: Settings, clock: SimClock, amplifier: Amplifier) -> tuple[Line, object]:
    line = Line(clock, int(_link(spec, "baudrate", 9600)), str(_link(spec, "parity", "N")), half_duplex=True)
    return line, Laumas(line, amplifier, address=int(spec.get("address") or 1))


_MOTORS: dict[str, Callable[[Settings, SimClock, BenchPlant, GaussianNoise], tuple[Line, object]]] = {
    "orca": _orca,
    "iai": _iai,
    "smc_lec": _smc_lec,
}
_LOAD_CELLS: dict[str, Callable[[Settings, SimClock, Amplifier], tuple[Line, object]]] = {
    "dad141": _dad141,
    "dad141_modbus": _dad141_modbus,
    "laumas_tlb": _laumas,
    "mt_sics": _mt_sics,
}

__all__ = ["device_name", "load_cell_device", "motor_device"]
