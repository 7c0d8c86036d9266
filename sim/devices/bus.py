"""Several simulated devices on one line, as on RS485: each hears every request and answers to its own address."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from sim.devices.modbus import RtuServer
from sim.line import Line


class _Modbus(Protocol):
    server: RtuServer


class _Ears:
    """What the host sends, to all of them. Devices do not hear each other's answers: these are for the host."""

    def __init__(self, servers: Sequence[RtuServer]) -> None:
        self.servers = servers

    def receive(self, data: bytes, at_s: float) -> None:
        """Take bytes whose last has arrived at `at_s`."""
        for server in self.servers:
            server.receive(data, at_s)


def join(line: Line, devices: Sequence[_Modbus]) -> None:
    """Put Modbus RTU devices on one line, instead of those they were made with; their addresses must differ.

    Raises ValueError where two have the same address.
    """
    servers = [device.server for device in devices]
    addresses = [server.address for server in servers]
    if len(set(addresses)) != len(addresses):
        raise ValueError(f"devices on one line need addresses of their own; these have {addresses}")
    for server in servers:
        server.line = line
    line.device = _Ears(servers)
