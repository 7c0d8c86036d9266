"""Single bytes on a line: lost, repeated, changed, late, and bytes that nobody sent."""

from __future__ import annotations

from sim.faults.base import RECOVERED, REFUSED, STOPPED, Device, Fault, Kind, Parameter, Reaction
from sim.faults.site import Site
from sim.line import Pieces

BOTH: tuple[Device, ...] = ("motor", "load_cell")

DIRECTION = Parameter("direction", "", "to_host", "which way", words=("to_host", "to_device"))

IN_HOLD = {"step": "steps[0]", "after_s": 0.3}
IN_RAMP = {"step": "steps[0]", "after_s": 0.01}
LONG = {"duration_s": 0.3}


def outwards(fault: Fault) -> bool:
    """Whether what goes to the device is struck."""
    return fault.word("direction") == "to_device"


def _count(default: int, what: str) -> Parameter:
    return Parameter("count", "bytes", default, what, 1, 1000)


def _lost(fault: Fault, site: Site) -> None:
    random, count = site.random(fault), int(fault.number("count"))

    def change(data: bytes) -> Pieces:
        first = int(random.integers(0, max(1, len(data) - count + 1)))
        return ((data[:first] + data[first + count :], 0.0),)

    site.frames(fault, change, outwards(fault))


def _repeated(fault: Fault, site: Site) -> None:
    random, count = site.random(fault), int(fault.number("count"))

    def change(data: bytes) -> Pieces:
        first = int(random.integers(0, max(1, len(data) - count + 1)))
        return ((data[: first + count] + data[first:], 0.0),)

    site.frames(fault, change, outwards(fault))


def _corrupted(fault: Fault, site: Site) -> None:
    random, count = site.random(fault), int(fault.number("count"))

    def change(data: bytes) -> Pieces:
        changed = bytearray(data)
        for _ in range(count):
            changed[int(random.integers(0, len(data)))] ^= 1 << int(random.integers(0, 8))
        return ((bytes(changed), 0.0),)

    site.frames(fault, change, outwards(fault))


def _late(fault: Fault, site: Site) -> None:
    by_s = fault.number("by_s")
    site.frames(fault, lambda data: ((data, by_s),), outwards(fault))


def _noise(fault: Fault, site: Site) -> None:
    random, count = site.random(fault), int(fault.number("count"))
    site.frames(fault, lambda data: ((random.bytes(count) + data, 0.0),), outwards(fault))


_RATE = {"rate_per_s": 2.0}

KINDS: tuple[Kind, ...] = (
    Kind(
        "bytes_lost",
        "Bytes of a frame never arrive.",
        BOTH,
        _lost,
        (
            Reaction("motor", _RATE, RECOVERED, shows="motor", why="the next command is on its way"),
            Reaction("motor", {**_RATE, "direction": "to_device"}, RECOVERED, shows="motor"),
            Reaction("motor", {**IN_HOLD, **LONG}, STOPPED, "motor.*(silent|no answer)"),
            Reaction("load_cell", _RATE, RECOVERED, shows="load_cell", why="the checksum tells, the line is left out"),
            Reaction("load_cell", {**IN_HOLD, **LONG, "count": 5}, STOPPED, "load cell is silent"),
            Reaction("motor", {"at_s": 0, "duration_s": 60}, REFUSED, "motor.*(no answer|checksum|CRC)"),
            Reaction("load_cell", {"at_s": 0, "duration_s": 60, "count": 5}, REFUSED, "load_cell"),
            Reaction("motor", _RATE, RECOVERED, shows="motor", bench="simulated_iai", why="polls are asked again"),
            Reaction(
                "load_cell",
                _RATE,
                RECOVERED,
                shows="load_cell",
                why="a line that is cut is no weight",
                bench="simulated_balance",
            ),
            Reaction(
                "load_cell",
                {**IN_HOLD, **LONG, "count": 5},
                STOPPED,
                "load cell is silent|limit|overload",
                why="its lines have no checksum",
                bench="simulated_balance",
            ),
            Reaction("load_cell", _RATE, RECOVERED, shows="load_cell", bench="simulated_laumas"),
            Reaction("motor", _RATE, RECOVERED, shows="motor", bench="simulated_smc_lec"),
        ),
        (_count(1, "how many in a row"), DIRECTION),
        frames=True,
    ),
    Kind(
        "bytes_repeated",
        "Bytes of a frame arrive twice.",
        BOTH,
        _repeated,
        (
            Reaction("motor", _RATE, RECOVERED, shows="motor"),
            Reaction("load_cell", _RATE, RECOVERED, shows="load_cell"),
            Reaction("motor", {**IN_RAMP, **LONG}, STOPPED, "motor.*(silent|no answer|checksum|CRC)"),
        ),
        (_count(1, "how many in a row"), DIRECTION),
        frames=True,
    ),
    Kind(
        "bytes_corrupted",
        "Bits of a frame are flipped.",
        BOTH,
        _corrupted,
        (
            Reaction("motor", _RATE, RECOVERED, shows="motor"),
            Reaction("motor", {**_RATE, "direction": "to_device"}, RECOVERED, shows="motor"),
            Reaction("motor", {**IN_HOLD, **LONG}, STOPPED, "motor.*(silent|no answer|checksum|CRC)"),
            Reaction("load_cell", _RATE, RECOVERED, shows="load_cell"),
            Reaction(
                "load_cell",
                {**IN_HOLD, **LONG, "count": 5},
                STOPPED,
                "load cell is silent|limit|overload|beyond",
                why="one line in 256 has the right checksum for wrong digits",
            ),
            Reaction("load_cell", _RATE, RECOVERED, shows="load_cell", bench="simulated_balance"),
        ),
        (_count(1, "how many bits"), DIRECTION),
        frames=True,
    ),
    Kind(
        "late",
        "Frames arrive late, as through an adapter or a system that holds them back.",
        BOTH,
        _late,
        (
            Reaction("motor", {"rate_per_s": 5.0, "by_s": 0.005}, RECOVERED),
            Reaction("load_cell", {"rate_per_s": 5.0, "by_s": 0.01}, RECOVERED),
            Reaction("motor", {**IN_HOLD, "by_s": 0.2}, STOPPED, "motor.*(silent|no answer)"),
            Reaction("load_cell", {**IN_HOLD, "by_s": 0.2}, STOPPED, "load cell is silent"),
        ),
        (Parameter("by_s", "s", 0.02, "how late", 0.0, 60.0), DIRECTION),
        frames=True,
    ),
    Kind(
        "line_noise",
        "Bytes that nobody sent come before a frame.",
        BOTH,
        _noise,
        (
            Reaction("motor", _RATE, RECOVERED),
            Reaction("load_cell", _RATE, RECOVERED),
            Reaction(
                "motor", {**IN_HOLD, **LONG}, RECOVERED, shows="motor", why="the answer is found behind the noise"
            ),
        ),
        (_count(3, "how many"), DIRECTION),
        frames=True,
    ),
)
