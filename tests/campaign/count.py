"""What is counted: rates with their intervals, and what is wrong with one line."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from .family import HELD_OUT
from .judge import listed, named
from .runs_told import FLAGS_GOOD

Line = dict[str, Any]

NEAR = 0.10
"""Of a parameter's value, or of the noise floor."""

TOLD = 0.002
"""Of the noise power: what is smaller may be called consistent (docs/formats.md)."""


IMITATED = 0.25
"""Of the misfit's power: one or two causes of the catalogue that leave no more imitate what was hidden; as much may be
left of what is called explained (docs/formats.md)."""


@dataclass(frozen=True)
class Rate:
    """How many of how many."""

    hits: int
    n: int

    @property
    def share(self) -> float:
        """nan of none."""
        return self.hits / self.n if self.n else math.nan

    def interval(self, z: float = 1.959964) -> tuple[float, float]:
        """Wilson's 95 % interval (J. Am. Stat. Assoc. 22, 1927, 209–212)."""
        if not self.n:
            return 0.0, 1.0
        p, n = self.share, self.n
        middle, half = p + z**2 / (2 * n), z * math.sqrt(p * (1 - p) / n + z**2 / (4 * n**2))
        return max((middle - half) / (1 + z**2 / n), 0.0), min((middle + half) / (1 + z**2 / n), 1.0)

    def __str__(self) -> str:
        return f"{100 * self.share:.1f} %" if self.n else "–"


def rate(lines: Iterable[Line], hit: Callable[[Line], bool]) -> Rate:
    """Lines for which `hit` holds, of all."""
    answers = [bool(hit(line)) for line in lines]
    return Rate(sum(answers), len(answers))


def causes(line: Line) -> list[str]:
    """Ids in the order in which they were named."""
    return [cause["id"] for cause in line["said"]["causes"]]


def first(line: Line) -> str:
    """The first cause, or what was said instead of one."""
    return next(iter(causes(line)), line["said"]["verdict"])


def right_first(line: Line) -> bool:
    """Whether the first cause is (one of) the hidden."""
    return first(line) in line["item"]["ids"]


def right_listed(line: Line) -> bool:
    """Whether a hidden id is the first cause or among what is said not to be excluded in its place."""
    if right_first(line) or not line["said"]["causes"]:
        return right_first(line)
    return any(listed(line["said"]["causes"][0], id) for id in line["item"]["ids"])


def right_or_alike(line: Line) -> bool:
    """Whether a hidden id is first, or listed beside a first that fits the data without noise as well."""
    return right_first(line) or (right_listed(line) and bool(line.get("as_good")))


def found(line: Line, id: str) -> bool:
    """Whether an id is named at any place."""
    return named(line, id) is not None


def found_or_alike(line: Line, id: str) -> bool:
    """Whether an id of a pair is named, or listed beside one that fits the data without noise as well in its place."""
    return found(line, id) or id in line.get("alike", {})


def spurious(line: Line) -> bool:
    """Whether something is named after the first cause that is not hidden."""
    return any(id not in line["item"]["ids"] for id in causes(line)[1:])


def detectable(line: Line) -> bool:
    """By the noise-free misfit of the believed structure (tests/truth/detect.py)."""
    return bool(line["truth"]["detectable"])


def imitated(line: Line) -> bool:
    """Of an effect outside the catalogue: whether the one or two causes named leave so little of it, without noise."""
    left_N = line.get("clean_rmse_N")  # older lines have none
    if left_N is None or len(causes(line)) not in (1, 2):
        return False
    return bool(left_N**2 <= IMITATED * line["truth"]["misfit_N"] ** 2)


def both_detectable(line: Line) -> bool:
    """Of a pair: whether each alone would be."""
    return all(line["truth"]["alone"].values())


def least_beside(line: Line) -> float:
    """Of a pair: χ² of the effect that is seen less beside the other (tests/truth/beside.py); nan where not asked."""
    return float(min(line["truth"].get("beside", {}).values(), default=math.nan))


@dataclass(frozen=True)
class Stated:
    """One parameter of a cause named rightly: the truth, what was said, the least deviation possible."""

    key: str
    id: str
    name: str
    true: float
    value: float | None
    std: float | None
    bound: float | None

    @property
    def near(self) -> bool:
        """Within 10 %, or within two of the deviations stated."""
        if self.value is None:
            return False
        return abs(self.value - self.true) <= max(NEAR * abs(self.true), 2 * (self.std or 0.0))

    @property
    def sane(self) -> bool:
        """The deviation is stated, and is at most a quarter of the value or twice its bound."""
        if self.std is None or self.value is None:
            return False
        return self.std <= max(abs(self.value) / 4, 2 * (self.bound or 0.0))


def stated(line: Line) -> list[Stated]:
    """The contract's parameters of a single cause that was named first."""
    if not right_first(line):
        return []
    id = first(line)
    said = line["said"]["causes"][0]["parameters"]
    out = []
    for name, true in line["truth"]["parameters"][id].items():
        if isinstance(true, int | float) and name != "share_of_difference" and math.isfinite(true):
            number = said.get(name, {})
            bound = line["bounds"].get(name)
            out.append(Stated(line["key"], id, name, true, number.get("value"), number.get("std"), bound))
    return out


def floor_near(line: Line, truth: str) -> bool:
    """Noise floor within 10 % of the truth: `noise_N` of the force, `floor_N` with the position's through stiffness."""
    return abs(line["said"]["noise_floor"] / line["truth"][truth] - 1) <= NEAR


def floor_between(line: Line) -> bool:
    """Noise floor between the two truths, 10 % beyond them allowed."""
    told = line["said"]["noise_floor"]
    return (1 - NEAR) * line["truth"]["noise_N"] <= told <= (1 + NEAR) * line["truth"]["floor_N"]


def held_out_near(line: Line) -> bool:
    """Error on data held out, after, within 1.15 of the noise floor stated."""
    after, floor = line["said"]["held_out_after"], line["said"]["noise_floor"]
    return after is not None and after <= HELD_OUT * floor


def out_of_family(line: Line) -> bool:
    """Whether the best of the cause's shapes, fitted without noise, leaves more than the error on data held out allows
    beyond the noise: then no fit can reach that."""
    left_N = line.get("family_rmse_N")  # older lines have none, nor those in which the error is within
    return left_N is not None and bool(left_N**2 > (HELD_OUT**2 - 1.0) * line["truth"]["floor_N"] ** 2)


def flags_pair(counts: Sequence[int]) -> tuple[float, float]:
    """(precision, recall) of (hit, flagged, true); 1 where there was nothing to get wrong."""
    hit, said, true = counts
    return hit / said if said else 1.0, hit / true if true else 1.0


def flags_good(counts: Sequence[int]) -> bool:
    """Both at least 0.9."""
    return min(flags_pair(counts)) >= FLAGS_GOOD


def wrongs(line: Line) -> list[str]:
    """Kinds of failure of one line; none where all is as it should be."""
    if "error" in line:
        return ["error"]
    group, verdict, out = line["item"]["group"], line["said"]["verdict"], []
    if group == "null":
        out += ["false alarm"] if verdict != "consistent" else []
    elif group == "outside":
        if detectable(line) and verdict != "unexplained":
            out.append("outside effect explained" if verdict == "explained" else "outside effect missed")
    elif group == "pair":
        missed = sum(not found(line, id) for id in line["item"]["ids"])
        if both_detectable(line):
            out += [[], ["one of a pair missed"], ["both of a pair missed"]][missed]
        out += ["spurious in a pair"] if any(id not in line["item"]["ids"] for id in causes(line)) else []
    elif detectable(line):
        out += ([] if right_first(line) else ["missed"]) if not line["said"]["causes"] else []
        out += ["wrong first"] if causes(line) and not right_first(line) else []
        out += ["unexplained"] if verdict == "unexplained" else []
        out += ["spurious second"] if spurious(line) else []
        out += ["parameter off"] if not all(s.near for s in stated(line)) else []
        out += ["deviation too wide"] if not all(s.sane for s in stated(line)) else []
        out += ["held-out error"] if right_first(line) and not held_out_near(line) else []
    elif causes(line) and not right_first(line):
        out.append("false alarm below detectability")
    if not floor_between(line):
        out.append("noise floor")
    if any(line["flags"].values()) and not flags_good(line["flags"]["any"]):
        out.append("flags")
    return out


def pattern(line: Line) -> str:
    """What failures alike have in common: the ids and shapes hidden, and what was said."""
    hidden = " + ".join(f"{i} ({s})" for i, s in zip(line["item"]["ids"], line["item"]["shapes"], strict=True))
    if "error" in line:
        return f"{hidden or 'nothing'} → {line['error'].strip().splitlines()[-1]}"
    return f"{hidden or 'nothing'} → {' + '.join(causes(line)) or line['said']['verdict']}"


def confusion(lines: Iterable[Line]) -> dict[str, Counter[str]]:
    """By hidden id, how often what was named first."""
    table: dict[str, Counter[str]] = {}
    for line in lines:
        table.setdefault(line["item"]["ids"][0], Counter())[first(line)] += 1
    return table
