"""Small simulated benches for the device tests, and a client that knows nothing but bytes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import serial

from sim.model import Model
from sim.world import World, WorldSettings, register, unregister

SPRING_N_mm = 10.0
FREE_AIR: dict[str, Any] = {
    "pad": {"elastic": {"law": "none"}, "relaxation": {"shares": [], "rates": []}, "contact": "unilateral"}
}
SPRING: dict[str, Any] = {
    "pad": {
        "elastic": {"law": "polynomial", "alpha": [0.0, SPRING_N_mm]},
        "relaxation": {"shares": [], "rates": []},
        "contact": "unilateral",
    }
}
ORCA: dict[str, Any] = {"driver": "orca", "baudrate": 115200, "gap_us": 2000, "stroke": (-20.0, 20.0)}
IAI: dict[str, Any] = {"driver": "iai", "baudrate": 38400, "stroke": (-20.0, 20.0)}
DAD: dict[str, Any] = {"driver": "dad141", "baudrate": 115200, "capacity": 50.0}


def crc(data: bytes) -> bytes:
    """CRC-16/Modbus bit by bit, as the serial line specification's appendix has it; low byte first."""
    register_ = 0xFFFF
    for byte in data:
        register_ ^= byte
        for _ in range(8):
            register_ = (register_ >> 1) ^ (0xA001 if register_ & 1 else 0)
    return register_.to_bytes(2, "little")


def framed(text: str) -> bytes:
    """Bytes written in hexadecimal, with their CRC appended."""
    data = bytes.fromhex(text)
    return data + crc(data)


class Client:
    """A port of a world in virtual time, and how to ask over it."""

    def __init__(self, world: World, key: str, **options: Any) -> None:
        self.world = world
        self.clock = world.clock
        line = world.endpoints[key].line
        settings: dict[str, Any] = {"baudrate": line.baudrate or 9600, "parity": line.parity}
        self.port = serial.serial_for_url(f"sim://{world.settings.name}/{key}", timeout=0, **(settings | options))

    def ask(self, request: bytes, within_s: float = 0.2) -> bytes:
        """Send, wait until the reply is complete (nothing more in 5 ms), return it; b"" where none comes."""
        self.port.write(request)
        self.clock.wait([self.port], self.clock.now() + within_s)
        reply = self.port.read(4096)
        self.clock.wait([], self.clock.now() + (0.005 if reply else 0.0))
        return bytes(reply + self.port.read(4096))

    def modbus(self, text: str) -> str:
        """Ask with a request in hexadecimal without CRC; the reply in hexadecimal, its CRC checked and cut off."""
        reply = self.ask(framed(text))
        if not reply:
            return ""
        assert crc(reply[:-2]) == reply[-2:]
        return reply[:-2].hex(" ")

    def command(self, text: str) -> str:
        """Ask in lines; the reply without its line end."""
        return self.ask(text.encode() + b"\r").decode().rstrip("\r\n")

    def sleep(self, seconds: float) -> None:
        """Let bench time pass."""
        self.clock.wait([], self.clock.now() + seconds)
        self.world.plant.advance(self.clock.now())


@contextmanager
def bench(name: str = "test", **settings: Any) -> Iterator[World]:
    """A registered world: an Orca, a DAD 141.1, free air, no noise, unless said otherwise."""
    model = Model.from_dict(settings.pop("model", FREE_AIR))
    motor, load_cell = settings.pop("motor", {}), settings.pop("load_cell", {})
    motor = motor if "driver" in motor else ORCA | motor
    load_cell = load_cell if "driver" in load_cell else DAD | load_cell
    world = World(WorldSettings(name=name, model=model, motor=motor, load_cell=load_cell, **settings))
    register(world)
    try:
        yield world
    finally:
        unregister(name)
