"""The motor and its position: stalled, jammed, weak, in error, at an end, or somewhere else than it says."""

from __future__ import annotations

from collections.abc import Callable

from sim.faults.base import RECOVERED, STOPPED, Fault, Kind, Parameter, Reaction
from sim.faults.bytes_ import IN_HOLD, IN_RAMP
from sim.faults.site import Site

IN_HOMING = {"at_s": 1.0}
"""The controllers that home begin with it at once, and are on their way then."""

STUCK = "(home return|return to origin) does not end(: its position has stood still| within 120 s)"


def _stall(fault: Fault, site: Site) -> None:
    plant = site.plant

    def set_to(force_N: float | None) -> Callable[[float], None]:
        def act(at_s: float) -> None:
            plant.advance(at_s)
            plant.weaken(set_to, force_N)

        return act

    site.when(fault, set_to(0.0), set_to(None))


def _derated(fault: Fault, site: Site) -> None:
    """The drive grows hot, and pushes less and less: down to `left_N` within `within_s`."""
    plant = site.plant
    left_N, within_s = fault.number("left_N"), fault.number("within_s")
    full_N = plant.settings.max_force_N
    over = False

    def begin(at_s: float) -> None:
        def less(now_s: float) -> None:
            if over:
                return
            share = min(1.0, (now_s - at_s) / within_s) if within_s > 0.0 else 1.0
            plant.advance(now_s)
            plant.weaken(begin, full_N + (left_N - full_N) * share)
            if share < 1.0:
                site.clock.schedule(now_s + max(1e-3, within_s / 50.0), less)

        nonlocal over
        over = False
        less(at_s)

    def end(at_s: float) -> None:
        nonlocal over
        over = True
        plant.advance(at_s)
        plant.weaken(begin, None)

    site.when(fault, begin, end)


def _jam(fault: Fault, site: Site) -> None:
    plant = site.plant

    def set_to(on: bool) -> Callable[[float], None]:
        def act(at_s: float) -> None:
            plant.advance(at_s)
            plant.jam(on)

        return act

    site.when(fault, set_to(True), set_to(False))


def _obstacle(fault: Fault, site: Site) -> None:
    plant, ahead_mm = site.plant, fault.number("ahead_mm")

    def begin(at_s: float) -> None:
        plant.advance(at_s)
        plant.obstruct(plant.position_mm + ahead_mm)

    def end(at_s: float) -> None:
        plant.advance(at_s)
        plant.obstruct(None)

    site.when(fault, begin, end)


def _slip(fault: Fault, site: Site) -> None:
    drive, by_mm = site.part(fault, "drive"), fault.number("by_mm")

    def begin(at_s: float) -> None:
        site.plant.advance(at_s)
        drive.zero_mm += by_mm

    site.when(fault, begin)


def _error(fault: Fault, site: Site) -> None:
    fail, code = site.part(fault, "fail"), int(fault.number("code"))
    site.when(fault, lambda at_s: fail(code, at_s), lambda at_s: fail(0, at_s))


def _position(fault: Fault, site: Site, made: Callable[[float], Callable[[float], float]]) -> None:
    """While the fault lasts, encoder readings (mm, motor frame) go through what `made(its beginning)` gives."""
    drive = site.part(fault, "drive")
    active: list[Callable[[float], float]] = []

    def begin(at_s: float) -> None:
        active[:] = [made(at_s)]

    drive.distortions.append(lambda reading_mm: active[0](reading_mm) if active else reading_mm)
    site.when(fault, begin, lambda at_s: active.clear())


def _frozen(fault: Fault, site: Site) -> None:
    def made(began_s: float) -> Callable[[float], float]:
        kept: list[float] = []

        def frozen(reading_mm: float) -> float:
            if not kept:
                kept.append(reading_mm)
            return kept[0]

        return frozen

    _position(fault, site, made)


def _jump(fault: Fault, site: Site) -> None:
    by_mm = fault.number("by_mm")
    _position(fault, site, lambda began_s: lambda reading_mm: reading_mm + by_mm)


def _spike(fault: Fault, site: Site) -> None:
    drive, by_mm = site.part(fault, "drive"), fault.number("by_mm")
    pending = False

    def begin(at_s: float) -> None:
        nonlocal pending
        pending = True

    def spiked(reading_mm: float) -> float:
        nonlocal pending
        if not pending:
            return reading_mm
        pending = False
        return reading_mm + by_mm

    drive.distortions.append(spiked)
    site.when(fault, begin)


SLIP_S = 0.002
"""In steps of so long a slip is made."""


def _slipping(fault: Fault, site: Site) -> None:
    """What the motor counts from moves, so that its positions are of another place from step to step."""
    drive, rate_mm_s = site.part(fault, "drive"), fault.number("rate_mm_s")
    on = False

    def begin(at_s: float) -> None:
        nonlocal on
        if not on:
            on = True
            site.clock.schedule(at_s + SLIP_S, more)

    def more(at_s: float) -> None:
        if on and not site.over:
            site.plant.advance(at_s)
            drive.zero_mm += SLIP_S * rate_mm_s
            site.clock.schedule(at_s + SLIP_S, more)

    def end(at_s: float) -> None:
        nonlocal on
        on = False

    site.when(fault, begin, end)


KINDS: tuple[Kind, ...] = (
    Kind(
        "stall",
        "The motor pushes no more: the pad moves it.",
        ("motor",),
        _stall,
        (
            Reaction("motor", {**IN_RAMP}, STOPPED, "following error"),
            Reaction("motor", {**IN_HOLD}, STOPPED, "following error"),
            Reaction("motor", {"step": "approach", "after_s": 0.05}, STOPPED, "following error"),
            Reaction("motor", {**IN_RAMP}, STOPPED, "following error", bench="simulated_iai"),
            Reaction("motor", {**IN_HOMING}, STOPPED, STUCK, bench="simulated_iai", why="while it homes"),
            Reaction("motor", {**IN_RAMP}, STOPPED, "following error|did not get", bench="simulated_smc_lec"),
            Reaction("motor", {**IN_HOMING}, STOPPED, STUCK, why="while it homes", bench="simulated_smc_lec"),
        ),
    ),
    Kind(
        "derating",
        "The drive grows hot and is let push less and less.",
        ("motor",),
        _derated,
        (
            Reaction("motor", {**IN_RAMP, "left_N": 0.5}, STOPPED, "following error|fault|did not get where"),
            Reaction("motor", {"at_s": 0, "left_N": 60.0}, RECOVERED, why="it is still strong enough"),
            Reaction(
                "motor", {**IN_HOMING, "left_N": 0.1}, STOPPED, STUCK, bench="simulated_iai", why="while it homes"
            ),
            Reaction(
                "motor", {**IN_HOMING, "left_N": 0.1}, STOPPED, STUCK, why="while it homes", bench="simulated_smc_lec"
            ),
        ),
        (
            Parameter("left_N", "N", 1.0, "what is left", 0.0, 1e6),
            Parameter("within_s", "s", 0.2, "how fast", 0.0, 3600.0),
        ),
    ),
    Kind(
        "jam",
        "The mover sticks where it is.",
        ("motor",),
        _jam,
        (
            Reaction("motor", {**IN_RAMP}, STOPPED, "following error|motor reports a fault: force limit"),
            Reaction(
                "motor",
                {"step": "approach"},
                STOPPED,
                "following error|motor reports a fault: force limit|the motor pushes|position stands still",
            ),
            Reaction("motor", {**IN_RAMP}, STOPPED, "following error", bench="simulated_iai"),
            Reaction("motor", {**IN_HOMING}, STOPPED, STUCK, bench="simulated_iai", why="while it homes"),
            Reaction("motor", {**IN_HOLD, "duration_s": 0.1}, RECOVERED, why="it was to stand there anyway"),
            Reaction(
                "motor",
                {**IN_RAMP},
                STOPPED,
                "following error|did not get where it was sent",
                why="its following error alone allows for it",
                bench="simulated_smc_lec",
            ),
            Reaction("motor", {**IN_HOMING}, STOPPED, STUCK, why="while it homes", bench="simulated_smc_lec"),
        ),
    ),
    Kind(
        "hits_end",
        "Something stands in the way, or the travel ends earlier than anybody knew.",
        ("motor",),
        _obstacle,
        (
            Reaction("motor", {"step": "steps[0]", "ahead_mm": 0.2}, STOPPED, "following error|fault|force"),
            Reaction("motor", {"step": "approach", "ahead_mm": 0.2}, STOPPED, "following error|fault|force|motor"),
        ),
        (Parameter("ahead_mm", "mm", 0.2, "so far ahead of where it is", 0.0, 100.0),),
    ),
    Kind(
        "lost_position",
        "The motor loses its position: it counts from somewhere else than before.",
        ("motor",),
        _slip,
        (
            Reaction("motor", {**IN_HOLD, "by_mm": 1.0}, STOPPED, "following error|speed limit|force limit"),
            Reaction("motor", {**IN_RAMP, "by_mm": -1.0}, STOPPED, "following error|speed limit"),
            Reaction(
                "motor",
                {"step": "approach", "by_mm": 3.0},
                STOPPED,
                "following error|speed limit|force limit|as the motor was energised",
            ),
        ),
        (Parameter("by_mm", "mm", 1.0, "by how much", -100.0, 100.0),),
        lasting=False,
    ),
    Kind(
        "motor_fault",
        "The motor reports an error of its own, and lets go.",
        ("motor",),
        _error,
        (
            Reaction("motor", {**IN_HOLD, "code": 64}, STOPPED, "motor reports a fault: too hot"),
            Reaction("motor", {**IN_RAMP, "code": 1024}, STOPPED, "motor reports a fault.*volt"),
            Reaction("motor", {**IN_RAMP, "code": 256}, STOPPED, "motor reports a fault.*power"),
            Reaction("motor", {**IN_RAMP, "code": 0xD8}, STOPPED, "motor reports a fault", bench="simulated_iai"),
            Reaction(
                "motor",
                {**IN_HOMING, "code": 0xD8},
                STOPPED,
                "home return.*code 0x00d8",
                bench="simulated_iai",
                why="while it homes: its alarm ends the waiting",
            ),
            Reaction("motor", {**IN_HOLD, "code": 1024, "duration_s": 0.02}, STOPPED, "motor reports a fault.*volt"),
            Reaction("motor", {"at_s": 0, "code": 64}, RECOVERED, why="what sleep mode clears was of before the run"),
            Reaction("motor", {**IN_RAMP}, STOPPED, "motor reports a fault: alarm", bench="simulated_smc_lec"),
            Reaction(
                "motor",
                {**IN_HOMING},
                STOPPED,
                "return to origin.*alarm",
                why="while it homes: its alarm ends the waiting",
                bench="simulated_smc_lec",
            ),
        ),
        (Parameter("code", "", 64, "error bits (Orca) or alarm code (IAI)", 1, 0xFFFF),),
    ),
    Kind(
        "position_frozen",
        "The motor's position stands still, and answers go on coming.",
        ("motor",),
        _frozen,
        (
            Reaction("motor", {**IN_RAMP}, STOPPED, "following error"),
            Reaction("motor", {**IN_HOLD}, STOPPED, "(?i)following error|froz|same|still"),
            Reaction("motor", {"step": "approach", "after_s": 0.05}, STOPPED, "(?i)following error|froz|same|still"),
            Reaction(
                "motor",
                {"step": "approach", "after_s": 0.6},
                STOPPED,
                "position stands still|contact after only 0.000 mm",
            ),
            Reaction("motor", {**IN_RAMP}, STOPPED, "(?i)following error|froz", bench="simulated_iai"),
            Reaction("motor", {**IN_RAMP}, STOPPED, "(?i)following error|froz|did not get", bench="simulated_smc_lec"),
        ),
    ),
    Kind(
        "position_jump",
        "The motor's reading jumps, and stays off; the axis does not move.",
        ("motor",),
        _jump,
        (
            Reaction("motor", {**IN_HOLD, "by_mm": 1.0}, STOPPED, "following error|depth limit"),
            Reaction("motor", {**IN_HOLD, "by_mm": 50.0}, STOPPED, "travel limit"),
            Reaction(
                "motor",
                {"at_s": 0, "by_mm": 0.4},
                STOPPED,
                "as the motor was energised",
                why="it holds what it reads, and goes there at once",
            ),
        ),
        (Parameter("by_mm", "mm", 1.0, "by how much", -1e3, 1e3),),
    ),
    Kind(
        "position_spike",
        "Single positions are off, under a good checksum.",
        ("motor",),
        _spike,
        (
            Reaction("motor", {"rate_per_s": 3.0, "by_mm": 0.02}, RECOVERED),
            Reaction("motor", {**IN_HOLD, "by_mm": 5.0}, STOPPED, "travel limit|following error|depth limit"),
        ),
        (Parameter("by_mm", "mm", 0.02, "by how much", -1e3, 1e3),),
        lasting=False,
    ),
    Kind(
        "position_drift",
        "The axis creeps away from where the motor says it is: a coupling slips, a scale grows warm.",
        ("motor",),
        _slipping,
        (
            Reaction("motor", {"at_s": 0, "rate_mm_s": 0.002}, RECOVERED, why="some micrometres in a run"),
            Reaction("motor", {**IN_HOLD, "rate_mm_s": 5.0}, STOPPED, "force limit|as the motor was energised"),
            Reaction("motor", {**IN_HOLD, "rate_mm_s": 5.0}, STOPPED, "following error", bench="simulated_iai"),
            Reaction(
                "motor",
                {**IN_HOLD, "rate_mm_s": 5.0},
                STOPPED,
                "force limit|following|did not get",
                bench="simulated_smc_lec",
            ),
        ),
        (Parameter("rate_mm_s", "mm/s", 0.01, "how fast, positive into the pad", -100.0, 100.0),),
    ),
)
