"""The port: pulled out, taken, shared with a second program."""

from __future__ import annotations

import errno
import math
import os
from collections.abc import Callable
from typing import Any

from sim.faults.base import RECOVERED, REFUSED, STOPPED, Device, Fault, FaultError, Kind, Parameter, Reaction
from sim.faults.bytes_ import IN_HOLD, IN_RAMP
from sim.faults.frames import with_crc
from sim.faults.site import Site, Spell
from sim.line import Pieces, garbled

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


_ASKED = {"Iai": 0x9000, "SmcLec": 0x9000, "Laumas": 0x0007}
"""A register that a second program may well ask for, by the kind of device."""


def _requests(fault: Fault, site: Site) -> None:
    """A second program asks the device: its answers come to this host as well."""
    device, server = site.device(fault), _shared(fault, site)
    name = type(device).__name__
    request = b"I4\r\n" if name == "MtSics" else b"ID\r"
    if server is not None:
        request = with_crc(bytes((server.address, 3)) + _ASKED.get(name, 0x0100).to_bytes(2, "big") + b"\0\2")
    site.when(fault, lambda at_s: _tell(fault, site, request, at_s))


def _tell(fault: Fault, site: Site, request: bytes, at_s: float) -> None:
    """Bytes of the second program arrive at the device."""
    receiver = site.line(fault).device
    assert receiver is not None
    receiver.receive(request, at_s)


def _answers(fault: Fault, site: Site) -> None:
    """Another device on the same wires answers its own host."""
    line, server = site.line(fault), _shared(fault, site)
    answer = b'I4 A "B021002594"\r\n' if type(site.device(fault)).__name__ == "MtSics" else b"D:1410\r\n"
    if server is not None:
        answer = with_crc(bytes((server.address + 1, 3, 4, 0, 0, 0x12, 0x34)))

    def speak(at_s: float) -> None:
        line.device_write(answer, at_s)

    site.when(fault, speak)


_COILS = {
    "Iai": {"sleep": b"\x04\x03\0\0", "move": b"\x04\x2c\xff\0"},
    "SmcLec": {"sleep": b"\0\x19\0\0", "move": b"\0\x18\xff\0"},
}
"""Controllers that make their own moves: the coil that switches the servo off, and the one that stops the move."""


def _commands(fault: Fault, site: Site) -> None:
    """A second program commands the motor: to sleep, or to another place."""
    device, by_mm = site.device(fault), fault.number("by_mm")
    name = type(device).__name__
    if name not in ("Orca", *_COILS):
        raise FaultError(fault.index, "kind", f"`foreign_commands` is simulated for Orca, {', '.join(_COILS)}")
    address = device.server.address

    def command(at_s: float) -> None:
        if name in _COILS:
            body = bytes((address, 5)) + _COILS[name][fault.word("what")]
        elif fault.word("what") == "sleep":
            body = bytes((address, 6, 0, 3, 0, 1))
        else:
            site.plant.advance(at_s)
            place = device.drive.counts() + round(device.drive.direction * by_mm / device.drive.quantum_mm)
            body = bytes((address, 0x64, 30)) + place.to_bytes(4, "big", signed=True)
        _tell(fault, site, with_crc(body), at_s)

    site.when(fault, command)


def _twin(fault: Fault, site: Site) -> None:
    """A second device of the same address answers too: at the same time, or (`apart_s`) behind."""
    server, apart_s = _shared(fault, site), fault.number("apart_s")
    if server is None:
        raise FaultError(fault.index, "kind", "this device has its line for itself")
    spell = Spell(fault.duration_s if fault.duration_s is not None else math.inf)

    def both(data: bytes, at_s: float) -> Pieces:
        if not spell.takes(at_s):
            return ((data, 0.0),)
        if apart_s == 0.0:
            return ((garbled(data), 0.0),)
        # As long, of the same form, and another device's values: all of them 0.
        head = 3 if data[1] in (1, 2, 3, 4, 23) else 2
        other = data if data[1] in (5, 6, 15, 16) else with_crc(data[:head] + bytes(len(data) - head - 2))
        return ((data, 0.0), (other, apart_s))

    site.line(fault).tamper(both, False)
    site.when(fault, spell.begin)


def _latency(fault: Fault, site: Site) -> None:
    """What has come is handed over when the adapter's timer runs out, all of it at once."""
    line, every_s = site.line(fault), fault.number("every_s")
    usual_s = line.latency_s
    on = False

    def switch(to: bool) -> Callable[[float], None]:
        def act(at_s: float) -> None:
            nonlocal on
            on = to
            line.latency_s = usual_s

        return act

    def wait(data: bytes, at_s: float) -> Pieces:
        if on:
            end_s = at_s + len(data) * line.byte_s
            line.latency_s = usual_s + math.ceil(end_s / every_s) * every_s - end_s
        return ((data, 0.0),)

    line.tamper(wait, False)
    site.when(fault, switch(True), switch(False))


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
            Reaction("load_cell", {**IN_HOLD}, STOPPED, "load_cell: the port was lost", bench="simulated_balance"),
            Reaction("load_cell", {**IN_HOLD}, STOPPED, "load_cell: the port was lost", bench="simulated_laumas"),
            Reaction("load_cell", {**IN_HOLD}, STOPPED, "load_cell: the port was lost", bench="simulated_modbus"),
            Reaction("motor", {**IN_HOLD}, STOPPED, "motor: the port was lost", bench="simulated_smc_lec"),
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
            Reaction(
                "load_cell",
                {"rate_per_s": 3.0},
                RECOVERED,
                shows="load_cell",
                why="asked who it is, it goes on sending",
                bench="simulated_balance",
            ),
            Reaction("load_cell", {"rate_per_s": 3.0}, RECOVERED, bench="simulated_laumas"),
            Reaction("motor", {"rate_per_s": 3.0}, RECOVERED, bench="simulated_smc_lec"),
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
            Reaction("load_cell", {"rate_per_s": 3.0}, RECOVERED, shows="load_cell", bench="simulated_balance"),
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
            Reaction("motor", {**IN_HOLD, "what": "sleep"}, STOPPED, "motor|following", bench="simulated_smc_lec"),
        ),
        (
            Parameter("what", "", "sleep", "what it commands", words=("sleep", "move")),
            Parameter("by_mm", "mm", 1.0, "how far a move goes", -50.0, 50.0),
        ),
        lasting=False,
    ),
    Kind(
        "address_twice",
        "Two devices on the line have the same address, and both answer.",
        BOTH,
        _twin,
        (
            Reaction("motor", {"at_s": 0}, REFUSED, "motor"),
            Reaction("motor", {**IN_HOLD}, STOPPED, "motor.*(silent|no answer|checksum|CRC)"),
            Reaction(
                "motor", {**IN_HOLD, "apart_s": 0.0005}, RECOVERED, shows="motor", why="it comes when nothing is asked"
            ),
            Reaction(
                "motor",
                {**IN_HOLD, "apart_s": 0.0042},
                STOPPED,
                "following error",
                why="it comes as if for the next question",
            ),
            Reaction("motor", {**IN_RAMP}, STOPPED, "motor", bench="simulated_iai"),
            Reaction("load_cell", {**IN_HOLD}, STOPPED, "load cell is silent", bench="simulated_laumas"),
            Reaction("motor", {**IN_RAMP}, STOPPED, "motor", bench="simulated_smc_lec"),
        ),
        (Parameter("apart_s", "s", 0.0, "how long after the first the second one answers", 0.0, 10.0),),
    ),
    Kind(
        "latency_timer",
        "A USB adapter hands over what has come only every so often (its latency timer is as delivered).",
        BOTH,
        _latency,
        (
            Reaction("load_cell", {"at_s": 0}, RECOVERED, why="lines come in bunches, and are stamped evenly"),
            Reaction("motor", {"at_s": 0}, RECOVERED, why="the stream is as slow as the adapter"),
            Reaction("motor", {**IN_RAMP, "every_s": 0.2}, STOPPED, "motor.*(silent|no answer)"),
            Reaction("load_cell", {**IN_HOLD, "every_s": 0.2}, STOPPED, "load cell is silent"),
        ),
        (Parameter("every_s", "s", 0.016, "how often", 1e-4, 10.0),),
    ),
)
