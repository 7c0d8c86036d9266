"""The page of a campaign, from its lines."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from tests.benchmarks.report import Table
from tests.truth.cases import NOISES

from .count import (
    Line,
    Rate,
    both_detectable,
    causes,
    confusion,
    detectable,
    first,
    flags_good,
    flags_pair,
    floor_between,
    floor_near,
    found,
    held_out_near,
    least_beside,
    out_of_family,
    rate,
    right_first,
    right_listed,
    spurious,
    stated,
)
from .halves import Figure, grouped, half, shaped, side_by_side
from .plan import CATALOGUE, GROUPS
from .runs_told import FLAGS_GOOD

BESIDE = (0.0, 60.0, 200.0, 600.0, 2e3, 1e4, 1e5, 1e12)
"""χ² of the lesser effect of a pair beside the other."""

BINS = (0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 0.99, 1.0 + 1e-9)
"""Of confidence."""


def page(lines: Sequence[Line], command: str) -> str:
    """Markdown."""
    good = [line for line in lines if "error" not in line]
    by = grouped(good)
    judged = [line for line in [*by["single"], *by["large"]] if half(line) == "judge"]
    seen = any(line["truth"].get("beside") for line in by["pair"])
    versions = len({line["code"] for line in lines})
    counts = ", ".join(f"{len(by[group])} {group}" for group in GROUPS)
    blocks = [
        "# How well the diagnosis does",
        "",
        "Effects are hidden in data by the independent simulator (`tests/truth`), in shapes written from the",
        "literature and not from the diagnosis's own blocks; it is handed a CSV file and a model file. Written by",
        "",
        f"    {command}",
        "",
        f"{len(lines)} cases ({counts}), {len(lines) - len(good)} ended in an error"
        + (f"; results of {versions} versions of the code are mixed." if versions > 1 else "."),
        "",
        "## Targets",
        "",
        *targets(good, by).lines(),
        "",
        *WHAT_IS_COUNTED.strip().splitlines(),
        "",
        "## The two halves of the shapes",
        "",
        "The first half of the shapes has been there while the diagnosis was written; the judge half was written by",
        "somebody who had not seen the diagnosis, and nothing has been tuned to it.",
        "",
        *side_by_side(good).lines(),
        "",
        "## By effect",
        "",
        "Single cases of all sizes, the large ones too. All but the first two columns count detectable cases.",
        "",
        *by_effect([*by["single"], *by["large"]]).lines(),
        "",
        *(["## By effect, judge half", "", *by_effect(judged).lines(), ""] if judged else []),
        "## By shape",
        "",
        *by_shape([*by["single"], *by["large"]]).lines(),
        "",
        "## By size and visibility",
        "",
        *by_size([*by["single"], *by["large"]]).lines(),
        "",
        *(["## Pairs", "", *WHAT_IS_SEEN_BESIDE.strip().splitlines(), "", *by_beside(by["pair"]).lines(), ""] * seen),
        "## What was named first",
        "",
        "Rows: what was hidden. Columns: what was named, by the number of its row; C consistent, U unexplained",
        "without a cause. Detectable cases.",
        "",
        *confusion_table([line for line in [*by["single"], *by["large"]] if detectable(line)]).lines(),
        "",
        "## Nothing hidden",
        "",
        *by_noise(by["null"]).lines(),
        "",
        "## Confidence",
        "",
        "Causes named in single, large and pair cases that are detectable: how often the name was right.",
        "",
        *confidence([*filter(detectable, [*by["single"], *by["large"]]), *by["pair"]]).lines(),
        "",
        "## Faults of the channel",
        "",
        *faults(good).lines(),
        "",
        "## Time",
        "",
        *seconds(by).lines(),
    ]
    return "\n".join(blocks).rstrip() + "\n"


WHAT_IS_COUNTED = """
- *Detectable*: the believed structure, refitted to the data without noise, leaves χ² ≥ 60. Sizes of single cases are
  log-uniform between 0.05 and 2.5 times the typical, those of pairs between 0.5 and 2, outside the catalogue between
  0.5 and 2.5.
- *Right id first*: strict. *Or listed beside one that fits as well*: the right id stands among the alternatives which
  the diagnosis does not exclude, and the id named first, beside the believed structure, fits the data without noise
  within χ² of 25 (tests/truth/rivals.py; computed for what makes the force late). *Or not excluded*: without asking
  for that.
- *Spurious*: a cause after the first that was not hidden. *Both of a pair*: named at any place, of the pairs of which
  each effect alone would be detectable. *Or listed …*: one that is not named stands among the alternatives of a name
  that was not hidden, which in its place fits as well. *Each seen beside the other*: of those, pairs of which neither
  effect can be made by the pad's numbers and the other's size, or by any law where the other is one, but for χ² of 600
  (table of pairs below).
- *That the one or two named do not imitate*: without the cases in which one or two causes were named that leave at most
  a quarter of the misfit's power where there is no noise: with so little left a cause is called explained, and the
  effect outside the catalogue is one that a single or a pair imitates.
- *Parameter*: each of the contract's parameters of a cause that was rightly named first. The bound is that of Cramér
  and Rao for the effect's size with the pad's numbers unknown.
- *Noise floor*: the deviation of the force noise, and the same with the position's noise through the stiffness. A
  diagnosis that averages the motion comes to rest between the two.
- *Held-out error*: single and large cases rightly named, over the noise floor as stated. *In the family*: where the
  best of all shapes of that cause, fitted to the data without noise, leaves no more than 1.15 allows beyond the noise.
- *Those that runs of one value can tell*: without the stuck samples in runs of equal values so short that chance makes
  as many. A channel whose steps are as coarse as its noise repeats itself one sample in three or so; there nothing in
  the data says which of them are stuck (tests/campaign/runs_told.py).
- Intervals are Wilson's at 95 %. A target whose interval holds it is open, whatever the rate.
"""


WHAT_IS_SEEN_BESIDE = """
Pairs of which each effect alone would be detectable, by the χ² that the lesser one makes beside the other: what of it
neither the pad's numbers nor the size of the other can make, the other's shape being known, but of another law nothing
(tests/truth/beside.py). The diagnosis knows no shape.
"""


def targets(good: Sequence[Line], by: dict[str, list[Line]]) -> Table:
    """Each target with what was reached."""
    single, large = ([line for line in by[g] if detectable(line)] for g in ("single", "large"))
    numbers = [s for line in [*single, *large] for s in stated(line)]
    named = [line for line in [*single, *large] if right_first(line)]
    faulty = [line for line in good if line["flags"]["any"][2]]

    table = Table(["target", "wanted", "reached", "95 % interval", "of", "met"])

    def show(figure: Figure) -> None:
        reached, interval, of, met = figure.cells()
        table.rows.append((figure.what, figure.aim(), reached, interval, of, met))

    def row(what: str, wanted: float | None, at_least: bool, reached: Rate) -> None:
        show(Figure(what, wanted, at_least, reached))

    for figure in shaped(by):
        show(figure)
    row("false alarm, nothing hidden", 0.02, False, rate(by["null"], lambda r: r["said"]["verdict"] != "consistent"))
    row("parameter within 10 % or two deviations", 0.90, True, Rate(sum(s.near for s in numbers), len(numbers)))
    row("… deviation ≤ ¼ of the value or twice its bound", None, True, Rate(sum(s.sane for s in numbers), len(numbers)))
    row("… both", 0.90, True, Rate(sum(s.near and s.sane for s in numbers), len(numbers)))
    row("noise floor within 10 %: force noise", 0.95, True, rate(good, lambda r: floor_near(r, "noise_N")))
    row("… with the position's", 0.95, True, rate(good, lambda r: floor_near(r, "floor_N")))
    row("… between the two, 10 % allowed", 0.95, True, rate(good, floor_between))
    row("held-out error ≤ 1.15 noise floor", None, True, rate(named, held_out_near))
    inside = [r for r in named if not out_of_family(r)]
    row("… where the shape is in the family", 0.95, True, rate(inside, held_out_near))
    for which, of in (("any", "samples of cases with faults"), ("told", "… those that runs of one value can tell")):
        counts = [line["flags"].get(which, line["flags"]["any"]) for line in faulty]  # older lines have no `told`
        pooled = np.sum(counts, axis=0).tolist() if counts else [0, 0, 0]
        for what, value, n in zip(("precision", "recall"), flags_pair(pooled), pooled[1:], strict=True):
            met = "–" if not n else "yes" if value >= FLAGS_GOOD else "no"
            shown = f"{100 * value:.1f} %" if n else "–"
            table.rows.append((f"{what} of flags, {of}", "≥ 90 %", shown, "", str(n), met))
        row("… cases in which both are ≥ 0.9", None, True, Rate(sum(map(flags_good, counts)), len(counts)))
    return table


def _effect_row(name: str, lines: Sequence[Line]) -> list[str]:
    seen = [line for line in lines if detectable(line)]
    numbers = [s for line in seen for s in stated(line)]
    shares = (
        rate(seen, right_first),
        rate(seen, right_listed),
        rate(seen, lambda r: r["said"]["verdict"] == "unexplained"),
        rate(seen, spurious),
        Rate(sum(s.near for s in numbers), len(numbers)),
        Rate(sum(s.sane for s in numbers), len(numbers)),
    )
    held = [r["said"]["held_out_after"] / r["said"]["noise_floor"] for r in seen if right_first(r)]
    middle = f"{np.median(held):.3f}" if held else "–"
    return [name, str(len(lines)), str(len(seen)), *(f"{r.hits}/{r.n}" if r.n else "–" for r in shares), middle]


_COLUMNS = (
    *("n", "detectable", "right first", "or not excluded", "unexplained", "spurious", "parameters near"),
    *("deviations sane", "held-out / floor, median"),
)


def by_effect(lines: Sequence[Line]) -> Table:
    """A row an id."""
    table = Table(["hidden", *_COLUMNS])
    for id in CATALOGUE:
        own = [line for line in lines if line["item"]["ids"][0] == id]
        if own:
            table.rows.append(_effect_row(id, own))
    table.rows.append(_effect_row("all", lines))
    return table


def by_shape(lines: Sequence[Line]) -> Table:
    """A row a shape of an id."""
    table = Table(["hidden", *_COLUMNS])
    shapes = sorted({(r["item"]["ids"][0], r["item"]["shapes"][0]) for r in lines})
    for id, shape in shapes:
        own = [r for r in lines if (r["item"]["ids"][0], r["item"]["shapes"][0]) == (id, shape)]
        table.rows.append(_effect_row(f"{id}, {shape}{' (judge)' if half(own[0]) == 'judge' else ''}", own))
    return table


def by_size(lines: Sequence[Line]) -> Table:
    """Rows by size, by χ² of the misfit, by noise, sampling and protocol."""
    table = Table(["cases", *_COLUMNS])

    def rows(label: str, of: Callable[[Line], float], edges: Sequence[float]) -> None:
        for low, high in zip(edges, edges[1:], strict=False):
            own = [r for r in lines if low <= of(r) < high]
            if own:
                table.rows.append(_effect_row(f"{label} {low:g}–{high:g}", own))

    rows("size", lambda r: r["item"]["sizes"][0], (0.05, 0.1, 0.25, 0.5, 1.0, 2.0, 3.0))
    rows("χ²", lambda r: r["truth"]["chi2"] + r["truth"]["faults"], (0, 60, 300, 1e3, 1e4, 1e5, 1e9))
    rows("rate/Hz", lambda r: r["truth"]["rate_hz"], (0, 200, 500, 1000, 2001))
    for name, field in (("noise", "noise"), ("protocol", "protocol"), ("law", "law"), ("contact", "contact")):
        for value in sorted({r["truth"][field] for r in lines}):
            table.rows.append(_effect_row(f"{name} {value}", [r for r in lines if r["truth"][field] == value]))
    return table


def by_beside(lines: Sequence[Line]) -> Table:
    """Pairs by how much is seen of the lesser effect beside the other."""
    table = Table(["χ² of the lesser", "n", "both named", "and nothing else", "one", "none"])
    asked = [line for line in lines if both_detectable(line) and not math.isnan(least_beside(line))]
    for low, high in zip(BESIDE, BESIDE[1:], strict=False):
        own = [line for line in asked if low <= least_beside(line) < high]
        hits = [sum(found(line, id) for id in line["item"]["ids"]) for line in own]
        alone = sum(sorted(causes(line)) == sorted(line["item"]["ids"]) for line in own)
        if own:
            cells = (len(own), hits.count(2), alone, hits.count(1), hits.count(0))
            table.rows.append([f"{low:g}–{high:g}", *map(str, cells)])
    return table


def confusion_table(lines: Sequence[Line]) -> Table:
    """Hidden × named first."""
    counted = confusion(lines)
    ids = [id for id in CATALOGUE if id in counted]
    said = [*CATALOGUE, "consistent", "unexplained"]
    used = [name for name in said if any(counted[id][name] for id in ids)]
    short = {"consistent": "C", "unexplained": "U"}
    table = Table(["hidden", *(short.get(name) or str(CATALOGUE.index(name) + 1) for name in used)])
    for id in ids:
        cells = [str(counted[id][name]) if counted[id][name] else "·" for name in used]
        table.rows.append([f"{CATALOGUE.index(id) + 1} {id}", *cells])
    return table


def by_noise(lines: Sequence[Line]) -> Table:
    """Null cases by the kind of their noise."""
    table = Table(["noise", "n", "false alarms", "95 % interval", "named"])
    for kind in (*NOISES, "all"):
        own = [line for line in lines if kind in (line["truth"]["noise"], "all")]
        alarms = rate(own, lambda r: r["said"]["verdict"] != "consistent")
        low, high = alarms.interval()
        what = sorted({first(line) for line in own} - {"consistent"})
        table.rows.append(
            [kind, str(len(own)), str(alarms.hits), f"{100 * low:.1f}–{100 * high:.1f} %", ", ".join(what)]
        )
    return table


def confidence(lines: Sequence[Line]) -> Table:
    """How often a name was right, by the confidence stated."""
    pairs = [(c["confidence"], c["id"] in line["item"]["ids"]) for line in lines for c in line["said"]["causes"]]
    table = Table(["confidence", "causes", "mean stated", "right", "95 % interval"])
    for low, high in zip(BINS, BINS[1:], strict=False):
        own = [(c, right) for c, right in pairs if low <= c < high]
        if own:
            right = Rate(sum(r for _, r in own), len(own))
            a, b = right.interval()
            mean = f"{np.mean([c for c, _ in own]):.3f}"
            cells = [f"{low:g}–{min(high, 1):g}", str(len(own)), mean, str(right), f"{100 * a:.1f}–{100 * b:.1f} %"]
            table.rows.append(cells)
    return table


def faults(lines: Sequence[Line]) -> Table:
    """Flags by fault: in cases that have it, and what is flagged in cases that have none."""
    table = Table(
        ["fault", "cases", "precision", "recall", "mean precision", "mean recall", "both ≥ 0.9", "flagged without"]
    )
    for fault in ("saturation", "stuck_samples", "outliers", "any", "told"):
        own = [line["flags"][fault] for line in lines if line["flags"].get(fault, [0, 0, 0])[2]]
        others = [line for line in lines if not line["flags"].get(fault, [0, 0, 0])[2]]
        flagged = sum(line["flags"].get(fault, [0, 0, 0])[1] for line in others)
        without = flagged / max(sum(line["truth"]["samples"] for line in others), 1)
        cells = ["–"] * 5
        if own:
            pooled, each = flags_pair(np.sum(own, axis=0).tolist()), np.mean([flags_pair(c) for c in own], axis=0)
            cells = [f"{value:.3f}" for value in (*pooled, *each)] + [f"{sum(map(flags_good, own))}/{len(own)}"]
        table.rows.append([fault, str(len(own)), *cells, f"{100 * without:.3f} %"])
    return table


def seconds(by: dict[str, list[Line]]) -> Table:
    """Wall and processor time of a diagnosis; the campaign's processes share the machine."""
    table = Table(["cases", "n", "median/s", "95 % of them/s", "greatest/s", "processor, median/s", "samples, median"])
    for group in GROUPS:
        wall = [line["seconds"] for line in by[group]] or [math.nan]
        cpu = [line["cpu_seconds"] for line in by[group]] or [math.nan]
        samples = [line["truth"]["samples"] for line in by[group]] or [math.nan]
        figures = (np.median(wall), np.quantile(wall, 0.95), np.max(wall), np.median(cpu))
        if by[group]:
            cells = [*(f"{f:.1f}" for f in figures), f"{np.median(samples):.0f}"]
            table.rows.append([group, str(len(by[group])), *cells])
    return table
