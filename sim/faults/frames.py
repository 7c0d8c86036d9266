"""Whole frames: split, glued, from a wrong address, with a wrong checksum, or never."""

from __future__ import annotations

from sim.faults.base import RECOVERED, REFUSED, STOPPED, Device, Fault, FaultError, Kind, Parameter, Reaction
from sim.faults.bytes_ import DIRECTION, IN_HOLD, IN_RAMP, LONG, outwards
from sim.faults.site import Site
from sim.line import Pieces

BOTH: tuple[Device, ...] = ("motor", "load_cell")


def with_crc(data: bytes) -> bytes:
    """A Modbus RTU frame with its CRC."""
    from sim.devices.modbus import crc16  # the devices bring the physics with them; reading a bench file does without

    crc = crc16(data)
    return data + bytes((crc & 0xFF, crc >> 8))


def _split(fault: Fault, site: Site) -> None:
    random, gap_s = site.random(fault), fault.number("gap_s")

    def change(data: bytes) -> Pieces:
        at = int(random.integers(1, max(2, len(data))))
        return ((data[:at], 0.0), (data[at:], gap_s))

    site.frames(fault, change, outwards(fault))


def _glued(fault: Fault, site: Site) -> None:
    """A frame waits for the next one, and both come in one piece."""
    held = b""
    waiting = False

    def begin(at_s: float) -> None:
        nonlocal waiting
        waiting = True

    def tamper(data: bytes, at_s: float) -> Pieces:
        nonlocal held, waiting
        if held:
            data, held = held + data, b""
            return ((data, 0.0),)
        if waiting:
            held, waiting = data, False
            return ()
        return ((data, 0.0),)

    site.line(fault).tamper(tamper, outwards(fault))
    site.when(fault, begin)


def _address(fault: Fault, site: Site) -> None:
    site.part(fault, "server")

    def change(data: bytes) -> Pieces:
        if site.line(fault).baudrate == 0:  # Modbus TCP: the unit identifier
            return ((data[:6] + bytes([data[6] + 1 & 0xFF]) + data[7:], 0.0),)
        return ((with_crc(bytes([data[0] + 1 & 0xFF]) + data[1:-2]), 0.0),)

    site.frames(fault, change)


def _checksum(fault: Fault, site: Site) -> None:
    if type(site.device(fault)).__name__ == "MtSics":
        raise FaultError(fault.index, "kind", "lines of MT-SICS have no checksum", "take `bytes_corrupted`")

    def change(data: bytes) -> Pieces:
        body = data.rstrip(b"\r\n")
        if body == data:
            return ((data[:-1] + bytes([data[-1] ^ 0xFF]), 0.0),)
        last = b"0" if body[-1:] != b"0" else b"1"  # a line of text ends in its checksum's digits
        return ((body[:-1] + last + data[len(body) :], 0.0),)

    site.frames(fault, change, outwards(fault))


def _silent(fault: Fault, site: Site) -> None:
    site.frames(fault, lambda data: (), outwards(fault))


def _stale(fault: Fault, site: Site) -> None:
    """What is kept from the first answer on comes as the second, and so on."""
    kept = b""
    on = False

    def begin(at_s: float) -> None:
        nonlocal kept, on
        kept, on = b"", True

    def end(at_s: float) -> None:
        nonlocal on
        on = False

    def tamper(data: bytes, at_s: float) -> Pieces:
        nonlocal kept
        if not on:
            return ((data, 0.0),)
        before, kept = kept, data
        return ((before, 0.0),)

    site.line(fault).tamper(tamper, False)
    site.when(fault, begin, end)


KINDS: tuple[Kind, ...] = (
    Kind(
        "frame_split",
        "A frame arrives in two pieces, with silence between.",
        BOTH,
        _split,
        (
            Reaction("motor", {"rate_per_s": 5.0, "gap_s": 0.004}, RECOVERED),
            Reaction("load_cell", {"rate_per_s": 5.0, "gap_s": 0.004}, RECOVERED),
            Reaction("motor", {**IN_HOLD, "gap_s": 0.2}, STOPPED, "motor.*(silent|no answer)"),
            Reaction("motor", {"rate_per_s": 2.0, "direction": "to_device"}, RECOVERED, shows="motor"),
        ),
        (Parameter("gap_s", "s", 0.004, "how long", 0.0, 60.0), DIRECTION),
        frames=True,
    ),
    Kind(
        "frames_glued",
        "A frame is held back, and comes together with the next.",
        BOTH,
        _glued,
        (
            Reaction("motor", {"rate_per_s": 2.0}, RECOVERED, shows="motor"),
            Reaction("load_cell", {"rate_per_s": 2.0}, RECOVERED),
        ),
        (DIRECTION,),
        lasting=False,
        frames=True,
    ),
    Kind(
        "wrong_address",
        "Answers bear the address of another device.",
        BOTH,
        _address,
        (
            Reaction("motor", {"rate_per_s": 2.0}, RECOVERED, shows="motor"),
            Reaction("motor", {**IN_RAMP, **LONG}, STOPPED, "motor.*(silent|no answer|address)"),
            Reaction("motor", {"at_s": 0, "duration_s": 60}, REFUSED, "motor"),
            Reaction("load_cell", {"at_s": 0, "duration_s": 60}, REFUSED, "load_cell", bench="simulated_modbus"),
            Reaction("load_cell", {**IN_RAMP, **LONG}, STOPPED, "load cell is silent", bench="simulated_modbus"),
            Reaction("load_cell", {**IN_RAMP, **LONG}, STOPPED, "load cell is silent", bench="simulated_laumas"),
        ),
        frames=True,
    ),
    Kind(
        "crc_error",
        "Frames come with a wrong checksum.",
        BOTH,
        _checksum,
        (
            Reaction("motor", {"rate_per_s": 2.0}, RECOVERED, shows="motor"),
            Reaction("motor", {"rate_per_s": 2.0, "direction": "to_device"}, RECOVERED, shows="motor"),
            Reaction("load_cell", {"rate_per_s": 2.0}, RECOVERED, shows="load_cell"),
            Reaction("load_cell", {**IN_HOLD, **LONG}, STOPPED, "load cell is silent"),
            Reaction("motor", {"at_s": 0, "duration_s": 60}, REFUSED, "motor.*(checksum|CRC)"),
            Reaction("motor", {**IN_HOLD, **LONG}, STOPPED, "motor", bench="simulated_iai"),
            Reaction("load_cell", {**IN_HOLD, **LONG}, STOPPED, "load cell is silent", bench="simulated_laumas"),
            Reaction("motor", {**IN_HOLD, **LONG}, STOPPED, "motor", bench="simulated_smc_lec"),
        ),
        (DIRECTION,),
        frames=True,
    ),
    Kind(
        "silent",
        "A device is not heard (or does not hear): its power, cable or transmitter is gone.",
        BOTH,
        _silent,
        (
            Reaction("motor", {**IN_HOLD, "duration_s": 60}, STOPPED, "motor is silent"),
            Reaction("motor", {**IN_RAMP, "duration_s": 60}, STOPPED, "motor is silent"),
            Reaction("motor", {**IN_RAMP, "duration_s": 60, "direction": "to_device"}, STOPPED, "motor is silent"),
            Reaction("load_cell", {**IN_RAMP, "duration_s": 60}, STOPPED, "load cell is silent"),
            Reaction(
                "load_cell", {"step": "approach", "after_s": 0.05, "duration_s": 60}, STOPPED, "load cell is silent"
            ),
            Reaction("load_cell", {"at_s": 1.0, "duration_s": 60}, STOPPED, "load cell is silent"),
            Reaction("motor", {"rate_per_s": 1.0, "duration_s": 0.01}, RECOVERED, shows="motor"),
            Reaction("load_cell", {"rate_per_s": 1.0, "duration_s": 0.02}, RECOVERED),
            Reaction("motor", {"at_s": 0, "duration_s": 60}, REFUSED, "motor.*no answer"),
            Reaction("load_cell", {"at_s": 0, "duration_s": 60}, REFUSED, "load_cell.*no answer"),
            Reaction("motor", {**IN_HOLD, "duration_s": 60}, STOPPED, "motor is silent", bench="simulated_iai"),
            Reaction("load_cell", {**IN_RAMP, "duration_s": 60}, STOPPED, "load cell is silent", bench="simulated_iai"),
            Reaction(
                "load_cell", {**IN_RAMP, "duration_s": 60}, STOPPED, "load cell is silent", bench="simulated_balance"
            ),
            Reaction(
                "load_cell", {**IN_RAMP, "duration_s": 60}, STOPPED, "load cell is silent", bench="simulated_laumas"
            ),
            Reaction(
                "load_cell", {"at_s": 0, "duration_s": 60}, REFUSED, "load_cell.*no answer", bench="simulated_laumas"
            ),
            Reaction("motor", {**IN_HOLD, "duration_s": 60}, STOPPED, "motor is silent", bench="simulated_smc_lec"),
        ),
        (DIRECTION,),
        frames=True,
    ),
    Kind(
        "stale_answers",
        "Each answer is that to the request before: one was late, and a gateway hands them on in turn.",
        BOTH,
        _stale,
        (
            Reaction(
                "motor", {"at_s": 0}, STOPPED, "motor", why="what it answers makes no sense: it is never energised"
            ),
            Reaction(
                "motor",
                {**IN_HOLD, "duration_s": 0.2},
                RECOVERED,
                shows="motor",
                why="a stream's answers are alike: each one period old",
            ),
            Reaction("load_cell", {"at_s": 0}, RECOVERED, shows="load_cell", why="what is asked again is answered"),
            Reaction("load_cell", {**IN_HOLD}, RECOVERED, why="a line is one interval old"),
            Reaction("load_cell", {"at_s": 0}, REFUSED, "load_cell.*no answer", bench="simulated_modbus"),
            Reaction("load_cell", {**IN_HOLD}, STOPPED, "load cell is silent", bench="simulated_modbus"),
            Reaction("motor", {**IN_RAMP}, RECOVERED, shows="motor", bench="simulated_iai", why="each is one poll old"),
            Reaction("load_cell", {**IN_HOLD}, RECOVERED, why="a line is one interval old", bench="simulated_balance"),
            Reaction(
                "load_cell",
                {**IN_HOLD},
                RECOVERED,
                shows="load_cell",
                why="nothing in RTU tells: each is one poll old",
                bench="simulated_laumas",
            ),
            Reaction(
                "motor",
                {**IN_RAMP},
                STOPPED,
                "motor",
                why="a command is not seen to be taken",
                bench="simulated_smc_lec",
            ),
        ),
    ),
)
