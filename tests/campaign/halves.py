"""The targets that depend on the shapes hidden, for each half of the shapes by itself.

The first half has been there while the diagnosis was written; the judge half was written without a look at it, so
what is reached there holds for shapes that nobody had in mind.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from tests.benchmarks.report import Table
from tests.truth.detect import ENOUGH
from tests.truth.effects import HALVES

from .count import (
    TOLD,
    Line,
    Rate,
    both_detectable,
    causes,
    detectable,
    found,
    found_or_alike,
    imitated,
    least_beside,
    rate,
    right_first,
    right_listed,
    right_or_alike,
    spurious,
)
from .plan import GROUPS

PLAIN = 10 * ENOUGH
"""χ² of an effect that is plain beside another."""


@dataclass(frozen=True)
class Figure:
    """A target and what was reached; `wanted` is None where there is nothing to be reached."""

    what: str
    wanted: float | None
    at_least: bool
    reached: Rate

    def aim(self) -> str:
        """What is wanted, in words."""
        sign = "≥" if self.at_least else "≤"
        return f"{sign} {100 * self.wanted:.3g} %" if self.wanted is not None else ""

    def cells(self) -> tuple[str, str, str, str]:
        """Reached, its interval, of how many, whether that is enough."""
        low, high = self.reached.interval()
        met = "–"
        if self.wanted is not None and self.reached.n:
            share = self.reached.share
            met = "yes" if (share >= self.wanted if self.at_least else share <= self.wanted) else "no"
            met += ", open" if low < self.wanted < high else ""
        return str(self.reached), f"{100 * low:.1f}–{100 * high:.1f} %", str(self.reached.n), met


def half(line: Line) -> str:
    """Of a line; those written before there were two are of the first."""
    return str(line["item"].get("half", "first"))


def grouped(lines: Sequence[Line]) -> dict[str, list[Line]]:
    """By group."""
    return {group: [line for line in lines if line["item"]["group"] == group] for group in GROUPS}


def shaped(by: Mapping[str, Sequence[Line]]) -> list[Figure]:
    """The targets that depend on the shapes, of lines by group."""
    single, large = ([line for line in by[g] if detectable(line)] for g in ("single", "large"))
    told = [line for line in single if line["truth"]["of_noise_power"] >= TOLD]
    pairs, outside = [p for p in by["pair"] if both_detectable(p)], [o for o in by["outside"] if detectable(o)]

    plain = [p for p in pairs if least_beside(p) >= PLAIN]
    unlike = [o for o in outside if not imitated(o)]

    def unexplained(line: Line) -> bool:
        return bool(line["said"]["verdict"] == "unexplained")

    def both(line: Line) -> bool:
        return all(found(line, id) for id in line["item"]["ids"])

    def both_or_alike(line: Line) -> bool:
        return all(found_or_alike(line, id) for id in line["item"]["ids"])

    def both_alone(line: Line) -> bool:
        return sorted(causes(line)) == sorted(line["item"]["ids"])

    return [
        Figure("right cause first, single, detectable", 0.97, True, rate(single, right_first)),
        Figure("… or listed beside one that fits as well", 0.97, True, rate(single, right_or_alike)),
        Figure("… or not excluded", None, True, rate(single, right_listed)),
        Figure("… misfit over 0.2 % of the noise power", None, True, rate(told, right_first)),
        Figure("right cause first at 2.5 times the typical size", 0.99, True, rate(large, right_first)),
        Figure("… or listed beside one that fits as well", 0.99, True, rate(large, right_or_alike)),
        Figure("… or not excluded", None, True, rate(large, right_listed)),
        Figure("unexplained, single, detectable", 0.03, False, rate(single, unexplained)),
        Figure("spurious second cause, single, detectable", 0.03, False, rate(single, spurious)),
        Figure("both of a pair named", 0.90, True, rate(pairs, both)),
        Figure("… or listed beside one that fits as well", 0.90, True, rate(pairs, both_or_alike)),
        Figure("… and nothing else", None, True, rate(pairs, both_alone)),
        Figure("… each seen beside the other, χ² ≥ 600", None, True, rate(plain, both)),
        Figure("outside the catalogue: unexplained", 0.93, True, rate(outside, unexplained)),
        Figure("… that the one or two named do not imitate", 0.93, True, rate(unlike, unexplained)),
    ]


def side_by_side(lines: Sequence[Line]) -> Table:
    """A row a target, both halves in it."""
    heads = [f"{name} half: {what}" for name in HALVES for what in ("reached", "95 % interval", "of", "met")]
    table = Table(["target", "wanted", *heads])
    each = [shaped(grouped([line for line in lines if half(line) == name])) for name in HALVES]
    for figures in zip(*each, strict=True):
        table.rows.append([figures[0].what, figures[0].aim(), *(cell for f in figures for cell in f.cells())])
    return table
