"""What a device makes of a request: it has another register map, or answers and does nothing."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from sim.faults.base import REFUSED, STOPPED, Device, Fault, Kind, Parameter, Reaction
from sim.faults.bytes_ import IN_HOLD, IN_RAMP
from sim.faults.site import Site, Spell

BOTH: tuple[Device, ...] = ("motor", "load_cell")


def _other_map(fault: Fault, site: Site) -> None:
    """What the map says of an address is so of another: reads and writes of registers go there."""
    device = site.device(fault)
    by, swapped = int(fault.number("by")), fault.word("what") == "swapped_words"
    read, write = site.part(fault, "read_registers"), site.part(fault, "write_registers")
    on = False

    def read_elsewhere(address: int, count: int, at_s: float) -> list[int]:
        if not on:
            return list(read(address, count, at_s))
        if swapped:
            return _swapped(read(address, count, at_s))
        return list(read(address + by, count, at_s))

    def write_elsewhere(address: int, values: list[int], at_s: float) -> None:
        if not on:
            write(address, values, at_s)
        elif swapped:
            write(address, _swapped(values), at_s)
        else:
            write(address + by, values, at_s)

    def switch(to: bool) -> Callable[[float], None]:
        def act(at_s: float) -> None:
            nonlocal on
            on = to

        return act

    device.read_registers, device.write_registers = read_elsewhere, write_elsewhere
    site.when(fault, switch(True), switch(False))


def _swapped(words: list[int]) -> list[int]:
    """Two and two in the other order; one that is left over stays."""
    out = list(words)
    for k in range(0, len(out) - 1, 2):
        out[k], out[k + 1] = out[k + 1], out[k]
    return out


WRITES = (5, 6, 15, 16, 23, 0x64, 0x69)
"""Function codes that command something; the last two are an Orca's own."""


def _ignored(fault: Fault, site: Site) -> None:
    """Commands are answered as if they had been done."""
    server = site.part(fault, "server")
    device, functions = site.device(fault), dict(server.functions)
    spell = Spell(fault.duration_s if fault.duration_s is not None else math.inf)

    def deaf(code: int) -> Callable[[bytes, float], bytes]:
        def answer(pdu: bytes, at_s: float) -> bytes:
            if not spell.takes(at_s):
                return bytes(functions[code](pdu, at_s))
            return bytes(_as_if_done(device, code, pdu, at_s, functions))

        return answer

    server.functions = functions | {code: deaf(code) for code in WRITES if code in functions}
    site.when(fault, spell.begin)


def _as_if_done(device: Any, code: int, pdu: bytes, at_s: float, functions: Mapping[int, Any]) -> bytes:
    """The answer to a command, without its doing."""
    if code in (5, 6):
        return pdu
    if code in (15, 16):
        return pdu[:5]
    if code == 23:
        return bytes((23,)) + bytes(functions[3](b"\x03" + pdu[1:5], at_s)[1:])
    return bytes(device.stream_reply(code, at_s))


KINDS: tuple[Kind, ...] = (
    Kind(
        "other_map",
        "The registers stand elsewhere, or their words the other way round: another firmware, another gateway.",
        BOTH,
        _other_map,
        (
            Reaction("motor", {"at_s": 0}, STOPPED, "motor: the device refuses", why="before it is energised"),
            Reaction("motor", {"at_s": 0}, STOPPED, "motor.*stays under PIO command", bench="simulated_iai"),
            Reaction("motor", {**IN_HOLD}, STOPPED, "following error|motor", bench="simulated_iai"),
            Reaction("load_cell", {"at_s": 0}, REFUSED, "load_cell", bench="simulated_modbus"),
            Reaction("load_cell", {**IN_HOLD}, STOPPED, "load cell is silent", bench="simulated_modbus"),
            Reaction(
                "load_cell",
                {"at_s": 0, "what": "swapped_words"},
                STOPPED,
                "overload",
                bench="simulated_modbus",
                why="so large a number is no force",
            ),
            Reaction("load_cell", {"at_s": 0}, STOPPED, "overload", bench="simulated_laumas"),
            Reaction("motor", {"at_s": 0}, REFUSED, "motor: the device refuses", bench="simulated_smc_lec"),
        ),
        (
            Parameter("what", "", "elsewhere", "what is different", words=("elsewhere", "swapped_words")),
            Parameter("by", "registers", 2, "how far away they stand", -1000, 1000),
        ),
    ),
    Kind(
        "commands_ignored",
        "The motor answers commands, and does nothing: a key or another panel has the say.",
        ("motor",),
        _ignored,
        (
            Reaction("motor", {**IN_RAMP}, STOPPED, "following error|motor"),
            Reaction("motor", {**IN_HOLD}, STOPPED, "motor"),
            Reaction(
                "motor", {"at_s": 0}, STOPPED, "motor: force limit: wrote", why="the first limit does not read back"
            ),
            Reaction("motor", {**IN_RAMP}, STOPPED, "following error|motor", bench="simulated_iai"),
            Reaction("motor", {"at_s": 0}, STOPPED, "motor.*stays under PIO command", bench="simulated_iai"),
            Reaction("motor", {**IN_RAMP}, STOPPED, "did not get where it was sent", bench="simulated_smc_lec"),
            Reaction("motor", {"at_s": 0}, STOPPED, "motor: the servo does not come on", bench="simulated_smc_lec"),
        ),
    ),
)
