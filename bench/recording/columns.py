"""Which column of a CSV file is what, and in which unit: `--columns` and `--units`."""

from __future__ import annotations

import difflib
import re
import shlex
from collections.abc import Mapping, Sequence

from bench.errors import InputError

NAMES = {"time": "time_s", "position": "position_mm", "force": "force_N", "force_time": "force_time_s"}
"""What padbench calls its columns (docs/formats.md); `force_time` may be missing."""

REQUIRED = ("time", "position", "force")

_POUND_FORCE_N = 4.4482216152605
_STANDARD_GRAVITY = 9.80665
_TIME = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0}
_LENGTH = {"mm": 1.0, "m": 1e3, "cm": 10.0, "um": 1e-3, "µm": 1e-3, "nm": 1e-6, "in": 25.4}
_FORCE = {
    "N": 1.0,
    "kN": 1e3,
    "mN": 1e-3,
    "uN": 1e-6,
    "µN": 1e-6,
    "nN": 1e-9,
    "pN": 1e-12,
    "kgf": _STANDARD_GRAVITY,
    "kg": _STANDARD_GRAVITY,
    "gf": _STANDARD_GRAVITY / 1e3,
    "g": _STANDARD_GRAVITY / 1e3,
    "lbf": _POUND_FORCE_N,
}
UNITS = {"time": _TIME, "position": _LENGTH, "force": _FORCE, "force_time": _TIME}
"""Factor to seconds, millimetres, newtons; grams and kilograms are weights under standard gravity."""


def parse_columns(text: str, place: str = "--columns") -> dict[str, str]:
    """`time=t,position=x,force=F[,force_time=tF]` as a mapping. Raises `InputError`."""
    return _pairs(text, place, "column")


def parse_units(text: str, place: str = "--units") -> dict[str, str]:
    """`position=m,force=-mN` as a mapping of units that are known, with a minus where the sign is turned. Raises
    `InputError`."""
    units = _pairs(text, place, "unit")
    for what, unit in units.items():
        _factor(what, unit, place)
    return units


def factors(units: Mapping[str, str] | None, place: str = "--units") -> dict[str, float]:
    """Factor to s, mm and N for each of time, position, force, force_time (which follows time unless given)."""
    given = dict(units or {})
    if "time" in given:
        given.setdefault("force_time", given["time"])
    _check_keys(given, place)
    return {what: _factor(what, given[what], place) if what in given else 1.0 for what in NAMES}


def place_columns(header: Sequence[str], columns: Mapping[str, str] | None, place: str) -> dict[str, int]:
    """Index of each of time, position, force (and force_time, where it is there) in the header.

    Raises `InputError` that names what is missing and what stands nearest to it.
    """
    given = dict(columns or {})
    _check_keys(given, "--columns")
    found = {}
    missing = []
    for what, name in NAMES.items():
        wanted = given.get(what, name)
        if wanted in header:
            found[what] = header.index(wanted)
        elif what in REQUIRED or what in given:
            missing.append((what, wanted))
    if missing:
        raise InputError(place, f"has no column {_listed([w for _, w in missing])}", _cure(missing, header))
    if len(set(found.values())) < len(found):
        raise InputError(
            "--columns", "names one column twice", "time, position and force stand in columns of their own"
        )
    return found


def misread(header: Sequence[str], place: Mapping[str, int], units: Mapping[str, str] | None) -> list[str]:
    """A word on each column whose name ends with another unit than it is read in, of which nothing was said."""
    said = dict(units or {})
    words = []
    for what, index in place.items():
        own, name = NAMES[what].rpartition("_")[2], header[index]
        ending = re.search(r"[_ /(\[]([^\W\d_]+)[)\]]?\s*$", name)
        unit = ending[1].replace("\u03bc", "µ") if ending else own
        if what in said or (what == "force_time" and "time" in said) or unit == own or unit not in UNITS[what]:
            continue
        words.append(f"column {name!r} is read in {own}, and its name says {unit}: then add --units {what}={unit}")
    return words


def _cure(missing: Sequence[tuple[str, str]], header: Sequence[str]) -> str:
    hints = []
    for what, wanted in missing:
        near = difflib.get_close_matches(wanted.lower(), [h.lower() for h in header], 1, 0.5)
        same = [h for h in header if near and h.lower() == near[0]] or [h for h in header if what in h.lower()]
        hints.append(f"{what}={same[0] if same else '…'}")
    return (
        f"columns there: {_listed(header)}; say which is what: --columns {shlex.quote(','.join(hints))} (and --units)"
    )


def _pairs(text: str, place: str, kind: str) -> dict[str, str]:
    pairs: dict[str, str] = {}
    for part in text.split(","):
        what, equals, value = (piece.strip() for piece in part.partition("="))
        if not equals or not value:
            raise InputError(place, f"{part.strip()!r} is not WHAT={kind.upper()}", f"as in {place} {_example(kind)}")
        if what in pairs:
            raise InputError(place, f"{what!r} is given twice")
        pairs[what] = value
    _check_keys(pairs, place)
    return pairs


def _example(kind: str) -> str:
    return "time=t,position=travel,force=load" if kind == "column" else "position=m,force=mN"


def _check_keys(given: Mapping[str, str], place: str) -> None:
    for what in given:
        if what not in NAMES:
            near = difflib.get_close_matches(what, NAMES, 1, 0.4)
            cure = f"did you mean {near[0]!r}? " if near else ""
            raise InputError(place, f"{what!r} is not known", f"{cure}known: {', '.join(NAMES)}")


def _factor(what: str, unit: str, place: str) -> float:
    table = UNITS[what]
    if unit.startswith("-") and what in ("position", "force"):
        return -_factor(what, unit[1:], place)
    unit = unit.replace("\u03bc", "µ")  # the Greek letter, which looks the same
    if unit not in table:
        raise InputError(place, f"{unit!r} is no unit of {what.replace('_', ' ')}", f"known: {', '.join(table)}")
    return table[unit]


def _listed(names: Sequence[str]) -> str:
    return ", ".join(repr(name) for name in names)
