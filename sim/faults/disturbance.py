"""What gets into the load cell's signal: mains hum, a knock, a cable with a loose contact, heat."""

from __future__ import annotations

import math

from sim.faults.base import RECOVERED, STOPPED, Fault, Kind, Parameter, Reaction
from sim.faults.bytes_ import IN_HOLD, IN_RAMP
from sim.faults.force import Distortion, distort
from sim.faults.site import Site

RAIL_N = 1e9
"""What an open bridge drifts to: as far as the device can read, and beyond its range."""


def _hum(fault: Fault, site: Site) -> None:
    amplitude_N, omega = fault.number("amplitude_N"), 2.0 * math.pi * fault.number("frequency_Hz")
    distort(fault, site, lambda began_s: lambda force_N, at_s: force_N + amplitude_N * math.sin(omega * at_s))


def _knock(fault: Fault, site: Site) -> None:
    """A blow, and what rings after it."""
    peak_N, decay_s = fault.number("peak_N"), fault.number("decay_s")
    omega = 2.0 * math.pi * fault.number("frequency_Hz")

    def made(began_s: float) -> Distortion:
        def rings(force_N: float, at_s: float) -> float:
            since_s = max(0.0, at_s - began_s)
            return force_N + peak_N * math.exp(-since_s / decay_s) * math.sin(omega * since_s)

        return rings

    distort(fault, site, made)


def _loose(fault: Fault, site: Site) -> None:
    """Open and closed in turns, each for a random time."""
    random = site.random(fault)
    open_s, closed_s, broken = fault.number("open_s"), fault.number("closed_s"), fault.word("reads")

    def made(began_s: float) -> Distortion:
        is_open, until_s = True, began_s + random.exponential(open_s)

        def loose(force_N: float, at_s: float) -> float:
            nonlocal is_open, until_s
            while at_s >= until_s:
                is_open = not is_open
                until_s += random.exponential(open_s if is_open else closed_s)
            if not is_open:
                return force_N
            return RAIL_N if broken == "rail" else 0.0

        return loose

    distort(fault, site, made)


def _heat(fault: Fault, site: Site) -> None:
    per_s = fault.number("share_per_s")
    distort(fault, site, lambda began_s: lambda force_N, at_s: force_N * math.exp(per_s * (at_s - began_s)))


KINDS: tuple[Kind, ...] = (
    Kind(
        "force_hum",
        "The mains, or a drive next door, gets into the load cell's cable.",
        ("load_cell",),
        _hum,
        (
            Reaction("load_cell", {"at_s": 0, "amplitude_N": 0.02}, RECOVERED, why="a fit takes it for noise"),
            Reaction("load_cell", {**IN_HOLD, "amplitude_N": 0.5}, RECOVERED, why="below every limit"),
            Reaction("load_cell", {**IN_HOLD, "amplitude_N": 30.0}, STOPPED, "limit|overload|beyond"),
            Reaction(
                "load_cell", {"at_s": 0, "amplitude_N": 2.0}, STOPPED, "not steady in air|as the motor was energised"
            ),
        ),
        (
            Parameter("amplitude_N", "N", 0.1, "amplitude", 0.0, 1e6),
            Parameter("frequency_Hz", "Hz", 50.0, "frequency", 1e-3, 1e5),
        ),
    ),
    Kind(
        "knock",
        "Somebody knocks against the bench: the load cell rings.",
        ("load_cell",),
        _knock,
        (
            Reaction("load_cell", {**IN_HOLD, "peak_N": 1.0}, RECOVERED, why="it comes back: no jump"),
            Reaction("load_cell", {**IN_RAMP, "peak_N": 1.0}, RECOVERED),
            Reaction("load_cell", {**IN_HOLD, "peak_N": 30.0}, STOPPED, "force limit|tension limit"),
            Reaction("load_cell", {"step": "approach", "after_s": 0.1, "peak_N": 30.0}, STOPPED, "limit"),
        ),
        (
            Parameter("peak_N", "N", 1.0, "about how hard", -1e6, 1e6),
            Parameter("frequency_Hz", "Hz", 40.0, "what rings", 1e-3, 1e5),
            Parameter("decay_s", "s", 0.05, "how long it takes to fall to a third", 1e-4, 60.0),
        ),
        lasting=False,
    ),
    Kind(
        "cable_open",
        "A loose contact in the load cell's cable: its bridge is open for moments, at random.",
        ("load_cell",),
        _loose,
        (
            Reaction("load_cell", {**IN_HOLD}, STOPPED, "overload"),
            Reaction("load_cell", {**IN_RAMP, "duration_s": 0.05}, STOPPED, "overload"),
            Reaction("load_cell", {"at_s": 0}, STOPPED, "overload"),
            Reaction("load_cell", {**IN_HOLD, "reads": "zero", "open_s": 0.2}, STOPPED, "(?i)jump|motor|froz"),
        ),
        (
            Parameter("reads", "", "rail", "what an open bridge reads", words=("rail", "zero")),
            Parameter("open_s", "s", 0.01, "how long it is open, on average", 1e-4, 60.0),
            Parameter("closed_s", "s", 0.05, "how long it is closed, on average", 1e-4, 3600.0),
        ),
    ),
    Kind(
        "gain_drift",
        "The load cell's sensitivity wanders, as with heat.",
        ("load_cell",),
        _heat,
        (
            Reaction(
                "load_cell",
                {"at_s": 0, "share_per_s": 0.001},
                RECOVERED,
                why="a percent in a run: nothing here can know",
            ),
            Reaction("load_cell", {**IN_HOLD, "share_per_s": 10.0}, STOPPED, "force limit|overload|gross"),
            Reaction("load_cell", {**IN_HOLD, "share_per_s": -10.0}, STOPPED, "(?i)motor|froz|jump"),
        ),
        (Parameter("share_per_s", "1/s", 0.01, "by which share of itself a second", -100.0, 100.0),),
    ),
)
