"""The preflight as a terminal shows it: one row a step, repeats folded, then what is said and what refuses."""

from __future__ import annotations

import io
import math
import re
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table

from bench.places import Key
from bench.preflight import Outcome, Preflight

if TYPE_CHECKING:
    from bench.plan import Problem

MAX_ROWS = 60
REPEAT = re.compile(r"(^precondition(?=\[\d+\]$)|\.[^\[\]]+(?=\[\d+\]\.steps\[))\[\d+\]")
"""Where a step's name counts repeats."""


def render(preflight: Preflight, width: int, *, errors: bool = True) -> list[str]:
    """Lines of text, without colour, at most `width` wide where words allow; with what refuses, if `errors`."""
    plan = preflight.plan
    lines = _table(preflight, width)
    most = "at most " if preflight.prediction.bounded else ""
    before = f"the tare takes {preflight.approach_s:.0f} s"
    if not plan.in_air:
        before = f"tare and approach take {preflight.approach_s:.0f} s at most"
    samples = f"{preflight.samples['motor']} motor and {preflight.samples['load_cell']} force samples"
    few = "at least" if preflight.at_least else "about"
    lines.append(f"{most}{_clock(preflight.duration_s)} of steps; {before}; {few} {samples}")
    force = [o.peak_N for o in preflight.outcomes if not math.isnan(o.peak_N)]
    if force and not plan.in_air:
        lines.append(f"peak force {max(force):.3g} N of {plan.limits.force_N:g} N allowed")
    if preflight.surface_mm is not None:
        low, high = preflight.surface_mm
        if low <= high:
            lines.append(f"the surface may stand from {low:.3g} to {high:.3g} mm in the motor frame")
    for problem in preflight.notices:
        lines += _said("note", problem)
    for problem in preflight.errors if errors else ():
        lines += _said("refused", problem)
    return lines


def _said(word: str, problem: Problem) -> list[str]:
    return [f"{word}: {problem}"] + ([f"  {problem.cure}"] if problem.cure else [])


def _table(preflight: Preflight, width: int) -> list[str]:
    rows = _rows(preflight)
    table = Table(box=None, padding=(0, 2, 0, 0), header_style="")
    table.add_column("step", overflow="fold")
    for title in ("times", "to", "speed mm/s", "hold s", "peak N"):
        table.add_column(title, justify="right", no_wrap=True)
    for row in rows[:MAX_ROWS]:
        table.add_row(*row)
    out = io.StringIO()
    Console(file=out, width=width, color_system=None, highlight=False, markup=False).print(table)
    lines = [line.rstrip() for line in out.getvalue().splitlines()]
    if len(rows) > MAX_ROWS:
        lines.append(f"… and {len(rows) - MAX_ROWS} more steps")
    return lines


def _rows(preflight: Preflight) -> list[tuple[str, ...]]:
    groups: dict[tuple[Key, ...], list[Outcome]] = {}
    for outcome in preflight.outcomes:
        groups.setdefault(outcome.segment.path, []).append(outcome)
    return [_row(group) for group in groups.values()]


def _row(group: list[Outcome]) -> tuple[str, ...]:
    """Ramps and holds of one step, over all its repeats."""
    first = group[0].segment
    held = next((o.segment.duration_s for o in group if o.segment.kind in ("hold", "force_hold", "air")), 0.0)
    names = dict.fromkeys(o.segment.name for o in group if o.segment.kind in ("ramp", "force_ramp"))
    peaks = [o.peak_N for o in group if not math.isnan(o.peak_N)]
    to = f"{first.target_mm:g} mm"
    if first.kind == "force_ramp":
        to = f"{first.target_N:g} N" + (f" at {group[0].deepest_mm:.3g} mm" if peaks else "")
    return (
        first.name if len(names) == 1 else REPEAT.sub(r"\1[*]", first.name),
        f"{len(names)}",
        to,
        f"{first.speed_mm_s:.4g}",
        f"{held:g}" if held else "",
        f"{max(peaks):.3g}" if peaks else "",
    )


def _clock(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 100 else f"{int(seconds // 60)} min {seconds % 60:.0f} s"
