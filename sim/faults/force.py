"""What the load cell says: frozen, saturated, overloaded, jumping, drifting, with the wrong sign, without its zero."""

from __future__ import annotations

from collections.abc import Callable

from sim.faults.base import RECOVERED, STOPPED, Fault, Kind, Parameter, Reaction
from sim.faults.bytes_ import IN_HOLD, IN_RAMP
from sim.faults.site import Site

LOST = "surface could not be measured: (no contact where|force where|it ended far above|the force does not rise)"
"""The slow approach does not find what the first one felt."""

MOVED = "where it was tared: its zero has moved"

Distortion = Callable[[float, float], float]
"""(true reading in N, time) → what the device takes for it."""


def distort(fault: Fault, site: Site, made: Callable[[float], Distortion]) -> None:
    """While the fault lasts, readings go through what `made(its beginning)` gives."""
    amplifier = site.part(fault, "amplifier")
    active: list[Distortion] = []

    def begin(at_s: float) -> None:
        active[:] = [made(at_s)]

    amplifier.distortions.append(lambda force_N, at_s: active[0](force_N, at_s) if active else force_N)
    site.when(fault, begin, lambda at_s: active.clear())


def _frozen(fault: Fault, site: Site) -> None:
    def made(began_s: float) -> Distortion:
        kept: list[float] = []

        def frozen(force_N: float, at_s: float) -> float:
            kept[1:] = []
            if not kept:
                kept.append(force_N)
            return kept[0]

        return frozen

    distort(fault, site, made)


def _saturated(fault: Fault, site: Site) -> None:
    limit_N = fault.number("limit_N")
    distort(fault, site, lambda began_s: lambda force_N, at_s: max(-limit_N, min(limit_N, force_N)))


def _overload(fault: Fault, site: Site) -> None:
    sign = 1.0 if fault.word("direction") == "over" else -1.0
    distort(fault, site, lambda began_s: lambda force_N, at_s: sign * 1e9)


def _jump(fault: Fault, site: Site) -> None:
    by_N = fault.number("by_N")
    distort(fault, site, lambda began_s: lambda force_N, at_s: force_N + by_N)


def _spike(fault: Fault, site: Site) -> None:
    """Single readings that are off."""
    amplifier, by_N = site.part(fault, "amplifier"), fault.number("by_N")
    pending = False

    def begin(at_s: float) -> None:
        nonlocal pending
        pending = True

    def spiked(force_N: float, at_s: float) -> float:
        nonlocal pending
        if not pending:
            return force_N
        pending = False
        return force_N + by_N

    amplifier.distortions.append(spiked)
    site.when(fault, begin)


def _drift(fault: Fault, site: Site) -> None:
    rate_N_s = fault.number("rate_N_s")
    distort(fault, site, lambda began_s: lambda force_N, at_s: force_N + rate_N_s * (at_s - began_s))


def _gain(fault: Fault, site: Site) -> None:
    factor = fault.number("factor")
    distort(fault, site, lambda began_s: lambda force_N, at_s: factor * force_N)


def _zero(fault: Fault, site: Site) -> None:
    """Somebody presses the zero key (or the device loses its zero): what is there now becomes nothing."""
    amplifier = site.part(fault, "amplifier")

    def begin(at_s: float) -> None:
        amplifier.zero += amplifier.gross(at_s)
        amplifier.zeroed = True

    site.when(fault, begin)


def _noisy(fault: Fault, site: Site) -> None:
    random, std_N = site.random(fault), fault.number("std_N")
    distort(fault, site, lambda began_s: lambda force_N, at_s: force_N + float(random.normal(0.0, std_N)))


KINDS: tuple[Kind, ...] = (
    Kind(
        "force_frozen",
        "The load cell's reading stands still, and lines go on coming.",
        ("load_cell",),
        _frozen,
        (
            Reaction("load_cell", {**IN_RAMP}, STOPPED, "(?i)froz|same|stand|still|not change"),
            Reaction("load_cell", {**IN_HOLD}, STOPPED, "(?i)froz|same|stand|still|not change"),
            Reaction(
                "load_cell", {"step": "approach", "after_s": 0.05}, STOPPED, "(?i)froz|same|stand|still|no contact"
            ),
            Reaction("load_cell", {**IN_HOLD}, STOPPED, "frozen", bench="simulated_balance"),
            Reaction("load_cell", {**IN_HOLD}, STOPPED, "frozen", bench="simulated_laumas"),
        ),
    ),
    Kind(
        "force_saturated",
        "The load cell's reading gets no further than a limit.",
        ("load_cell",),
        _saturated,
        (
            Reaction(
                "load_cell",
                {"at_s": 0, "limit_N": 1.0},
                STOPPED,
                "(?i)froz|same|still|saturat|motor",
                why="the pad is pressed harder than the cell says: its reading stands at the limit",
            ),
            Reaction("load_cell", {"at_s": 0, "limit_N": 30.0}, RECOVERED, why="the run stays below"),
        ),
        (Parameter("limit_N", "N", 5.0, "where it ends", 0.0, 1e6),),
    ),
    Kind(
        "overload",
        "The device reports that it is beyond its range.",
        ("load_cell",),
        _overload,
        (
            Reaction("load_cell", {**IN_HOLD}, STOPPED, "overload"),
            Reaction("load_cell", {**IN_RAMP, "duration_s": 0.02}, STOPPED, "overload"),
            Reaction("load_cell", {**IN_RAMP, "direction": "under"}, STOPPED, "overload"),
            Reaction(
                "load_cell", {"at_s": 0.0}, STOPPED, "overload", why="it answers, and says that it cannot measure"
            ),
            Reaction("load_cell", {**IN_HOLD}, STOPPED, "overload|force", bench="simulated_modbus"),
            Reaction("load_cell", {**IN_RAMP}, STOPPED, "overload", bench="simulated_balance"),
            Reaction("load_cell", {**IN_HOLD}, STOPPED, "overload", bench="simulated_laumas"),
        ),
        (Parameter("direction", "", "over", "beyond which end", words=("over", "under")),),
    ),
    Kind(
        "force_jump",
        "The load cell's reading jumps, and stays off (a cable moved, a gauge came loose).",
        ("load_cell",),
        _jump,
        (
            Reaction("load_cell", {**IN_HOLD, "by_N": 30.0}, STOPPED, "force limit"),
            Reaction("load_cell", {**IN_HOLD, "by_N": -10.0}, STOPPED, "tension limit"),
            Reaction(
                "load_cell",
                {**IN_HOLD, "by_N": -2.0},
                STOPPED,
                "(?i)jump|load cell|tare|motor",
                why="below every limit, but no pad does that while the axis stands",
            ),
            Reaction(
                "load_cell",
                {"step": "approach", "after_s": 0.1, "by_N": 0.5},
                STOPPED,
                MOVED,
                why="it looks like a touch, and stays where the tare was taken",
            ),
            Reaction(
                "load_cell", {"at_s": 1.0, "by_N": 0.5}, STOPPED, "(?i)steady|touches|jump", why="while it is tared"
            ),
            Reaction("load_cell", {**IN_HOLD, "by_N": -2.0}, STOPPED, "(?i)jump", bench="simulated_laumas"),
        ),
        (Parameter("by_N", "N", 1.0, "by how much", -1e6, 1e6),),
    ),
    Kind(
        "force_spike",
        "Single readings are far off, under a good checksum.",
        ("load_cell",),
        _spike,
        (
            Reaction("load_cell", {"rate_per_s": 3.0, "by_N": 0.3}, RECOVERED, why="two in a row count as a touch"),
            Reaction("load_cell", {**IN_HOLD, "by_N": 30.0}, STOPPED, "force limit"),
            Reaction("load_cell", {**IN_HOLD, "by_N": 30.0}, STOPPED, "force limit", bench="simulated_balance"),
        ),
        (Parameter("by_N", "N", 1.0, "by how much", -1e6, 1e6),),
        lasting=False,
    ),
    Kind(
        "force_drift",
        "The zero of the load cell wanders.",
        ("load_cell",),
        _drift,
        (
            Reaction("load_cell", {"at_s": 0, "rate_N_s": 0.5}, STOPPED, "not steady in air"),
            Reaction("load_cell", {"at_s": 0, "rate_N_s": 0.005}, RECOVERED, why="as much as a fit takes up"),
            Reaction("load_cell", {**IN_HOLD, "rate_N_s": 200.0}, STOPPED, "force limit"),
            Reaction(
                "load_cell",
                {"step": "approach", "after_s": 0.1, "rate_N_s": 0.5},
                STOPPED,
                MOVED,
                why="it looks like a touch, and is there in air too",
            ),
        ),
        (Parameter("rate_N_s", "N/s", 0.1, "how fast", -1e6, 1e6),),
    ),
    Kind(
        "force_gain",
        "The load cell's sensitivity is off by a factor; −1 is a cell that is wired the wrong way round.",
        ("load_cell",),
        _gain,
        (
            Reaction(
                "load_cell",
                {"at_s": 0, "factor": -1.0},
                STOPPED,
                "tension|sign|negative",
                why="the force falls where the probe meets the pad",
            ),
            Reaction(
                "load_cell",
                {**IN_HOLD, "factor": -1.0},
                STOPPED,
                "(?i)jump|tension|sign|load cell",
            ),
            Reaction("load_cell", {**IN_HOLD, "factor": 20.0}, STOPPED, "force limit|overload"),
            Reaction(
                "load_cell",
                {"step": "approach", "after_s": 0.4, "factor": -1.0},
                STOPPED,
                LOST,
                why="between the two approaches: the second one feels nothing where the first one did",
            ),
            Reaction("load_cell", {"at_s": 0, "factor": 0.0}, STOPPED, "(?i)froz|no contact|motor|still"),
        ),
        (Parameter("factor", "", -1.0, "the factor", -1e6, 1e6),),
    ),
    Kind(
        "zero_key",
        "The device is set to zero while it is loaded: it says nothing where there is force.",
        ("load_cell",),
        _zero,
        (
            Reaction("load_cell", {**IN_HOLD}, STOPPED, "(?i)jump|tare|zero|load cell|motor"),
            Reaction("load_cell", {"at_s": 0.1}, RECOVERED, why="before the tare it is as good as any zero"),
            Reaction("load_cell", {**IN_HOLD}, STOPPED, "(?i)jump", bench="simulated_balance"),
            Reaction("load_cell", {**IN_HOLD}, STOPPED, "(?i)jump", bench="simulated_laumas"),
        ),
        lasting=False,
    ),
    Kind(
        "force_noise",
        "The load cell's noise grows.",
        ("load_cell",),
        _noisy,
        (
            Reaction("load_cell", {"at_s": 0, "std_N": 0.02}, RECOVERED),
            Reaction("load_cell", {**IN_HOLD, "std_N": 20.0}, STOPPED, "limit"),
        ),
        (Parameter("std_N", "N", 0.1, "standard deviation", 0.0, 1e6),),
    ),
)
