"""Motors and load cells over their own wire protocols. Knows no protocol of the bench, no pad and no simulation.

`open_motor` and `open_load_cell` make a driver from the bench file's words about a device; everything a driver can
raise is in `drivers.errors`.
"""

from __future__ import annotations

import math
from typing import Any

from drivers import errors
from drivers.errors import DriverError
from drivers.loadcell import LoadCell
from drivers.motor import Motor
from drivers.regmap import LinkMap, LoadCellMap, MotorMap, load_map
from drivers.spec import LoadCellSpec, MotorSpec
from drivers.wire import Clock, Link, open_port

__all__ = ["LoadCellSpec", "MotorSpec", "errors", "open_load_cell", "open_motor"]


def open_motor(spec: MotorSpec, clock: Clock, name: str = "motor") -> Motor:
    """Open the port and make the driver; says nothing to the device yet.

    Raises `PortError` where the port cannot be opened, `DriverError` where the register map or the gains are wrong.
    """
    if spec.driver == "orca":
        from drivers.orca import DEFAULT_BAUDRATE, Orca, default_gap_s

        baudrate = spec.baudrate or DEFAULT_BAUDRATE
        gap_s = default_gap_s(baudrate) if spec.gap_us is None else 1e-6 * spec.gap_us
        link = _link(name, spec.port, clock, LinkMap(baudrate=baudrate, parity=spec.parity or "E"), gap_s)
        try:
            return Orca(link, name=name, address=spec.address, direction=spec.direction, gains=spec.gains)
        except DriverError:
            link.close()
            raise
    from drivers.registers import RegisterMotor

    device: MotorMap = _map(name, spec, "motor")
    link = _register_link(name, spec, clock, device)
    return RegisterMotor(link, device, name=name, address=spec.address, direction=spec.direction)


def open_load_cell(spec: LoadCellSpec, clock: Clock, name: str = "load_cell") -> LoadCell:
    """Open the port and make the driver; says nothing to the device yet. Raises as `open_motor` does."""
    if spec.driver == "dad141":
        from drivers.dad141 import DEFAULT_BAUDRATE, Dad141

        settings = LinkMap(baudrate=spec.baudrate or DEFAULT_BAUDRATE, parity=spec.parity or "N")
        return Dad141(
            _link(name, spec.port, clock, settings, 1e-6 * (spec.gap_us or 0)),
            name=name,
            address=spec.address,
            newtons_per_unit=spec.newtons_per_unit,
            capacity_N=spec.capacity,
            mode=spec.mode,
            rate_hz=spec.rate,
            decimals=spec.decimals,
            strict=spec.checksum == "strict",
        )
    if spec.driver == "mt_sics":
        from drivers import mt_sics

        settings = LinkMap(baudrate=spec.baudrate or mt_sics.DEFAULT_BAUDRATE, parity=spec.parity or "N")
        return mt_sics.MtSics(
            _link(name, spec.port, clock, settings, 1e-6 * (spec.gap_us or 0)),
            name=name,
            unit=spec.unit,
            newtons_per_unit=spec.newtons_per_unit,
            capacity_N=spec.capacity,
            mode=spec.mode,
            rate_hz=spec.rate,
        )
    from drivers.registers_cell import RegisterLoadCell

    device: LoadCellMap = _map(name, spec, "load_cell")
    link = _register_link(name, spec, clock, device)
    return RegisterLoadCell(
        link,
        device,
        name=name,
        address=1 if spec.address is None else spec.address,
        newtons_per_unit=spec.newtons_per_unit,
        capacity_N=spec.capacity,
        rate_hz=spec.rate,
    )


def _map(name: str, spec: MotorSpec | LoadCellSpec, kind: Any) -> Any:
    try:
        return load_map(spec.driver, spec.map, kind)
    except (OSError, ValueError) as error:
        raise DriverError(name, f"the register map of {spec.driver!r} cannot be used: {error}") from error


def _register_link(name: str, spec: MotorSpec | LoadCellSpec, clock: Clock, device: MotorMap | LoadCellMap) -> Link:
    settings = LinkMap(
        transport=device.link.transport,
        baudrate=spec.baudrate or device.link.baudrate,
        parity=spec.parity or device.link.parity,
        stopbits=device.link.stopbits,
    )
    gap_us = device.link.gap_us if spec.gap_us is None else spec.gap_us
    if settings.transport == "tcp":
        return _link(name, spec.port, clock, settings, 1e-6 * (gap_us or 0))
    from drivers.modbus import rtu_gap_s

    gap_s = rtu_gap_s(settings.baudrate, _bits_per_byte(settings)) if gap_us is None else 1e-6 * gap_us
    return _line_of_many(name, spec.port, clock, settings, gap_s)


def _link(name: str, url: str, clock: Clock, settings: LinkMap, gap_s: float) -> Link:
    port = open_port(name, url, settings.baudrate, parity=settings.parity, stopbits=settings.stopbits)
    on_wire = settings.transport == "rtu"
    return Link(
        name,
        port,
        clock,
        baudrate=settings.baudrate if on_wire else 0,
        bits_per_byte=_bits_per_byte(settings),
        gap_s=gap_s,
    )


def _line_of_many(name: str, url: str, clock: Clock, settings: LinkMap, gap_s: float) -> Link:
    """A link on a line that other devices of register maps may be on too."""
    from drivers.bus import bus_link

    bits = _bits_per_byte(settings)
    return bus_link(name, url, clock, settings, baudrate=settings.baudrate, bits_per_byte=bits, gap_s=gap_s)


def _bits_per_byte(settings: LinkMap) -> int:
    """Start bit, eight data bits, parity and stop bits."""
    return math.floor(9 + (settings.parity != "N") + settings.stopbits)
