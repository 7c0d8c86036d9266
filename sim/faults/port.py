"""The port: pulled out, taken, shared with a second program."""

from __future__ import annotations

import errno
import os
from typing import Any

from sim.faults.base import RECOVERED, REFUSED, STOPPED, Device, Fault, FaultError, Kind, Parameter, Reaction
from sim.faults.bytes_ import IN_HOLD, IN_RAMP
from sim.faults.frames import with_crc
from sim.faults.site import Site
from sim.line import Pieces

BOTH: tuple[Device, ...] = ("motor", "load_cell")


def _unplugged(fault: Fault, site: Site) -> None:
    line = site.line(fault)
    site.when(
        fault,
        lambda at_s: line.unplug(OSError(errno.EIO, os.strerror(errno.EIO))),
        lambda at_s: line.unplug(None),
    )


def _taken(fault: Fault, site: Site) -> None:
    """Another program has the port open: it cannot be opened, and one that is open loses half of what comes."""
    line, random = site.line(fault), site.random(fault)

    def begin(at_s: float) -> None:
        line.refusal = "it is in use by another program"

    def end(at_s: float) -> None:
        line.refusal = None

    def change(data: bytes, at_s: float) -> Pieces:
        return () if line.refusal is not None and random.random() < 0.5 else ((data, 0.0),)

    line.tamper(change, False)
    site.when(fault, begin, end)


def _shared(fault: Fault, site: Site) -> Any:
    """The device's Modbus server, None where it speaks in lines; raises where the line is shared with nobody."""
    if site.line(fault).baudrate == 0:
        raise FaultError(fault.index, "kind", "on a network nobody hears what another is told")
    return getattr(site.device(fault), "server", None)


def _requests(fault: Fault, site: Site) -> None:
    """A second program asks the device: its answers come to this host as well."""
    device, server = site.device(fault), _shared(fault, site)
    request = b"ID\r"
    if server is not None:
        request = with_crc(bytes((server.address, 3, 0x90 if type(device).__name__ == "Iai" else 1, 0, 0, 2)))
    site.when(fault, lambda at_s: _tell(fault, site, request, at_s))


def _tell(fault: Fault, site: Site, request: bytes, at_s: float) -> None:
    """Bytes of the second program arrive at the device."""
    receiver = site.line(fault).device
    assert receiver is not None
    receiver.receive(request, at_s)


def _answers(fault: Fault, site: Site) -> None:
    """Another device on the same wires answers its own host."""
    line, server = site.line(fault), _shared(fault, site)
    answer = b"D:1410\r\n"
    if server is not None:
        answer = with_crc(bytes((server.address + 1, 3, 4, 0, 0, 0x12, 0x34)))

    def speak(at_s: float) -> None:
        line.device_write(answer, at_s)

    site.when(fault, speak)


def _commands(fault: Fault, site: Site) -> None:
    """A second program commands the motor: to sleep, or to another place."""
    device, by_mm = site.device(fault), fault.number("by_mm")
    name = type(device).__name__
    if name not in ("Orca", "Iai"):
        raise FaultError(fault.index, "kind", "`foreign_commands` is simulated for Orca and IAI motors")
    address = device.server.address

    def command(at_s: float) -> None:
        if name == "Iai":
            body = bytes((address, 5, 0x04, 0x03, 0, 0))  # servo off
            if fault.word("what") == "move":
                body = bytes((address, 5, 0x04, 0x2C, 0xFF, 0))  # stop
        elif fault.word("what") == "sleep":
            body = bytes((address, 6, 0, 3, 0, 1))
        else:
            site.plant.advance(at_s)
            place = device.drive.counts() + round(device.drive.direction * by_mm / device.drive.quantum_mm)
            body = bytes((address, 0x64, 30)) + place.to_bytes(4, "big", signed=True)
        _tell(fault, site, with_crc(body), at_s)

    site.when(fault, command)


KINDS: tuple[Kind, ...] = (
    Kind(
        "unplugged",
        "The port is pulled out (and, after `duration_s`, plugged in again).",
        BOTH,
        _unplugged,
        (
            Reaction("motor", {**IN_HOLD}, STOPPED, "motor: the port was lost"),
            Reaction("motor", {**IN_RAMP}, STOPPED, "motor: (the port was lost|cannot write)"),
            Reaction("motor", {**IN_HOLD, "duration_s": 0.02}, STOPPED, "motor: the port was lost"),
            Reaction("load_cell", {**IN_HOLD}, STOPPED, "load_cell: the port was lost"),
            Reaction("load_cell", {**IN_RAMP}, STOPPED, "load_cell: the port was lost"),
            Reaction("load_cell", {**IN_HOLD, "duration_s": 0.02}, STOPPED, "load_cell: the port was lost"),
            Reaction("motor", {"at_s": 0}, REFUSED, "motor.*cannot open"),
            Reaction("load_cell", {"at_s": 0}, REFUSED, "load_cell.*cannot open"),
            Reaction("motor", {**IN_HOLD}, STOPPED, "motor: the port was lost", bench="simulated_iai"),
        ),
    ),
    Kind(
        "taken",
        "Another program opens the port, and takes half of what comes.",
        BOTH,
        _taken,
        (
            Reaction("motor", {"at_s": 0}, REFUSED, "motor.*in use by another program"),
            Reaction("load_cell", {"at_s": 0}, REFUSED, "load_cell.*in use by another program"),
            Reaction("motor", {**IN_HOLD, "duration_s": 0.03}, RECOVERED, shows="motor"),
            Reaction("load_cell", {**IN_HOLD, "duration_s": 0.3}, RECOVERED),
            Reaction("motor", {"step": "approach"}, STOPPED, "motor.*(silent|no answer)", why="sooner or later"),
        ),
    ),
    Kind(
        "foreign_requests",
        "A second program asks the device on the same wires: its answers are seen here.",
        BOTH,
        _requests,
        (
            Reaction("motor", {"rate_per_s": 3.0}, RECOVERED, shows="motor"),
            Reaction("load_cell", {"rate_per_s": 3.0}, STOPPED, "load cell is silent", why="it ends the stream"),
            Reaction("motor", {"rate_per_s": 3.0}, RECOVERED, bench="simulated_iai"),
        ),
        lasting=False,
    ),
    Kind(
        "foreign_answers",
        "Another device on the same wires answers its own host.",
        BOTH,
        _answers,
        (
            Reaction("motor", {"rate_per_s": 3.0}, RECOVERED, shows="motor"),
            Reaction("load_cell", {"rate_per_s": 3.0}, RECOVERED, shows="load_cell"),
        ),
        lasting=False,
    ),
    Kind(
        "foreign_commands",
        "A second program commands the motor.",
        ("motor",),
        _commands,
        (
            Reaction("motor", {**IN_HOLD, "what": "move", "by_mm": 0.1}, RECOVERED, why="the next set-point follows"),
            Reaction("motor", {**IN_HOLD, "what": "move", "by_mm": 2.0}, STOPPED, "following|limit"),
            Reaction(
                "motor", {**IN_HOLD, "what": "sleep"}, RECOVERED, why="the next set-point wakes it: no way to stop"
            ),
            Reaction("motor", {**IN_HOLD, "what": "sleep"}, STOPPED, "motor|following", bench="simulated_iai"),
        ),
        (
            Parameter("what", "", "sleep", "what it commands", words=("sleep", "move")),
            Parameter("by_mm", "mm", 1.0, "how far a move goes", -50.0, 50.0),
        ),
        lasting=False,
    ),
)
