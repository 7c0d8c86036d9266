"""What a device answers: exceptions, restarts, and settings that are not what they were."""

from __future__ import annotations

from collections.abc import Callable

from sim.faults.base import RECOVERED, REFUSED, STOPPED, Device, Fault, FaultError, Kind, Parameter, Reaction
from sim.faults.bytes_ import IN_HOLD, IN_RAMP
from sim.faults.site import Site, Spell
from sim.line import Line, Pieces

BOTH: tuple[Device, ...] = ("motor", "load_cell")


def _exception(fault: Fault, site: Site) -> None:
    """Refuse requests: the next one, or all of them for a while."""
    target = getattr(site.device(fault), "server", None) or site.device(fault)
    if not hasattr(target, "refuse"):
        raise FaultError(fault.index, "kind", "`exception` is not simulated for this device")
    code = int(fault.number("code"))
    spell = Spell(fault.duration_s)
    before: Callable[[float], int | None] | None = target.refuse

    def refuse(at_s: float) -> int | None:
        return code if spell.takes(at_s) else before(at_s) if before is not None else None

    target.refuse = refuse
    site.when(fault, spell.begin)


def _restart(fault: Fault, site: Site) -> None:
    """Power fails: deaf and mute for `off_s`, then as after power-up, with a setting changed."""
    restart = site.part(fault, "power_up")
    line, off_s, changed = site.line(fault), fault.number("off_s"), fault.word("comes_back")
    _check(fault, site, changed)
    until_s = -1.0

    def nothing(data: bytes, at_s: float) -> Pieces:
        return () if at_s < until_s else ((data, 0.0),)

    def begin(at_s: float) -> None:
        nonlocal until_s
        until_s = at_s + off_s
        restart(at_s)
        site.clock.schedule(until_s, back)

    def back(at_s: float) -> None:
        restart(at_s)
        _change(fault, site, changed, at_s)

    line.tamper(nothing, False)
    line.device = _Ear(line, lambda at_s: at_s >= until_s)
    site.when(fault, begin)


class _Ear:
    """What a device hears while it is on; what was on its way when the power failed it hears no more."""

    def __init__(self, line: Line, on: Callable[[float], bool]) -> None:
        assert line.device is not None
        self._inner = line.device
        self._on = on

    def receive(self, data: bytes, at_s: float) -> None:
        """Bytes arrive."""
        if self._on(at_s):
            self._inner.receive(data, at_s)


def _setting(fault: Fault, site: Site) -> None:
    """Somebody else sets the device while it works."""
    what = fault.word("setting")
    _check(fault, site, what)
    site.when(fault, lambda at_s: _change(fault, site, what, at_s))


SETTINGS = ("baudrate", "address", "filter", "decimals", "direction")


def _check(fault: Fault, site: Site, what: str) -> None:
    if what in ("filter", "decimals"):
        site.part(fault, "amplifier")
    elif what == "direction":
        site.part(fault, "drive")
    elif what == "address":
        device = site.device(fault)
        if not hasattr(getattr(device, "server", device), "address"):
            raise FaultError(fault.index, "kind", "this device has no address")


def _change(fault: Fault, site: Site, what: str, at_s: float) -> None:
    line, device = site.line(fault), site.device(fault)
    if what == "baudrate" and line.baudrate:
        line.set_device(9600 if line.baudrate != 9600 else 19200, line.parity)
    elif what == "address":
        target = getattr(device, "server", device)
        target.address += 1
        if hasattr(device, "open"):
            device.open = False
    elif what == "filter":
        device.amplifier.set_filter(level=6)
    elif what == "decimals":
        device.amplifier.set_decimals(max(0, device.amplifier.decimals - 1))
    elif what == "direction":
        site.plant.advance(at_s)
        device.drive.direction = -device.drive.direction


KINDS: tuple[Kind, ...] = (
    Kind(
        "exception",
        "The device refuses what it is asked (a Modbus exception, `ERR`).",
        BOTH,
        _exception,
        (
            Reaction("motor", {"rate_per_s": 2.0}, RECOVERED, shows="motor"),
            Reaction("motor", {**IN_HOLD, "duration_s": 60}, STOPPED, "motor.*exception"),
            Reaction("motor", {**IN_RAMP, "duration_s": 0.3, "code": 6}, STOPPED, "motor.*exception"),
            Reaction("motor", {"at_s": 0, "duration_s": 60}, REFUSED, "motor.*exception"),
            Reaction("load_cell", {"at_s": 0, "duration_s": 60}, REFUSED, "load_cell.*refuses"),
            Reaction("load_cell", {**IN_HOLD, "duration_s": 60}, STOPPED, "load.cell", bench="simulated_modbus"),
            Reaction("motor", {**IN_HOLD, "duration_s": 60}, STOPPED, "motor.*exception", bench="simulated_iai"),
            Reaction(
                "load_cell", {"at_s": 0, "duration_s": 60}, REFUSED, "load_cell.*refuses", bench="simulated_balance"
            ),
            Reaction(
                "load_cell", {"at_s": 0, "duration_s": 60}, REFUSED, "load_cell.*refuses", bench="simulated_laumas"
            ),
            Reaction("load_cell", {**IN_HOLD, "duration_s": 60}, STOPPED, "load.cell", bench="simulated_laumas"),
            Reaction("motor", {**IN_HOLD, "duration_s": 60}, STOPPED, "motor.*exception", bench="simulated_smc_lec"),
        ),
        (Parameter("code", "", 4, "the exception's number", 1, 11),),
        frames=True,
    ),
    Kind(
        "restart",
        "The device's power fails for a moment: it starts anew, and forgets what it was told.",
        BOTH,
        _restart,
        (
            Reaction("motor", {**IN_HOLD}, STOPPED, "motor is silent"),
            Reaction("motor", {**IN_RAMP, "off_s": 0.03}, STOPPED, "motor|following error"),
            Reaction(
                "motor",
                {"step": "tare", "after_s": 0.1, "off_s": 0.01},
                STOPPED,
                "the motor has restarted: (force limit|watchdog)",
                why="it answers again at once, but holds neither clamp nor watchdog any more",
            ),
            Reaction("motor", {**IN_HOLD, "comes_back": "baudrate"}, STOPPED, "motor is silent"),
            Reaction("motor", {**IN_HOLD, "off_s": 0.1, "comes_back": "direction"}, STOPPED, "motor|following error"),
            Reaction(
                "motor",
                {"at_s": 0, "off_s": 0.06, "comes_back": "direction"},
                STOPPED,
                "no contact",
                why="it is there again before it is asked, and goes the other way",
            ),
            Reaction("load_cell", {**IN_HOLD}, STOPPED, "load cell is silent"),
            Reaction("load_cell", {**IN_RAMP, "off_s": 0.03}, STOPPED, "load cell is silent"),
            Reaction("load_cell", {**IN_HOLD, "comes_back": "baudrate"}, STOPPED, "load cell is silent"),
            Reaction("load_cell", {"at_s": 0, "comes_back": "baudrate"}, REFUSED, "load_cell: no answer"),
            Reaction("load_cell", {"step": "approach", "comes_back": "decimals"}, STOPPED, "load cell is silent"),
            Reaction("motor", {**IN_HOLD}, STOPPED, "motor", bench="simulated_iai"),
            Reaction("load_cell", {**IN_HOLD}, STOPPED, "load cell is silent", bench="simulated_balance"),
            Reaction("load_cell", {**IN_HOLD}, STOPPED, "load cell is silent", bench="simulated_laumas"),
            Reaction(
                "load_cell",
                {**IN_RAMP, "off_s": 0.03},
                RECOVERED,
                shows="load_cell",
                why="it is asked again",
                bench="simulated_laumas",
            ),
            Reaction("motor", {**IN_HOLD}, STOPPED, "motor", bench="simulated_smc_lec"),
        ),
        (
            Parameter("off_s", "s", 0.5, "how long it is off", 0.0, 60.0),
            Parameter("comes_back", "", "same", "with which setting changed", words=("same", *SETTINGS)),
        ),
        lasting=False,
    ),
    Kind(
        "setting_changes",
        "Somebody else changes a setting of the device while it works.",
        BOTH,
        _setting,
        (
            Reaction("motor", {**IN_HOLD, "setting": "baudrate"}, STOPPED, "motor.*(silent|no answer)"),
            Reaction("motor", {**IN_HOLD, "setting": "address"}, STOPPED, "motor.*(silent|no answer)"),
            Reaction("motor", {**IN_HOLD, "setting": "direction"}, STOPPED, "following error|speed limit|travel limit"),
            Reaction("load_cell", {**IN_HOLD, "setting": "baudrate"}, STOPPED, "load cell is silent"),
            Reaction(
                "load_cell",
                {**IN_HOLD, "setting": "decimals"},
                STOPPED,
                "load cell|force",
                why="what it says falls to a tenth at once, and the pad's force does not",
            ),
            Reaction("load_cell", {"at_s": 0, "setting": "baudrate"}, REFUSED, "load_cell.*no answer"),
            Reaction("motor", {"at_s": 0, "setting": "baudrate"}, REFUSED, "motor.*no answer"),
            Reaction("motor", {"at_s": 0, "setting": "address"}, REFUSED, "motor.*no answer"),
            Reaction(
                "motor",
                {"at_s": 0, "setting": "direction"},
                STOPPED,
                "no contact",
                why="it moves away from the pad, and says that it goes towards it",
            ),
            Reaction(
                "load_cell",
                {**IN_HOLD, "setting": "baudrate"},
                STOPPED,
                "load cell is silent",
                bench="simulated_balance",
            ),
            Reaction(
                "load_cell",
                {**IN_HOLD, "setting": "decimals"},
                RECOVERED,
                why="it sends the decimal point",
                bench="simulated_balance",
            ),
            Reaction(
                "load_cell", {**IN_HOLD, "setting": "address"}, STOPPED, "load cell is silent", bench="simulated_laumas"
            ),
            Reaction(
                "load_cell",
                {**IN_HOLD, "setting": "decimals"},
                RECOVERED,
                why="its registers always have three",
                bench="simulated_laumas",
            ),
            Reaction(
                "motor",
                {**IN_HOLD, "setting": "address"},
                STOPPED,
                "motor.*(silent|no answer)",
                bench="simulated_smc_lec",
            ),
        ),
        (Parameter("setting", "", "baudrate", "which", words=SETTINGS),),
        lasting=False,
    ),
)
