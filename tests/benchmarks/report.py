"""What a benchmark hands back, and how it is printed and written."""

from __future__ import annotations

import os
import platform
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np


@dataclass
class Table:
    """Rows of text under column heads."""

    columns: Sequence[str]
    rows: list[Sequence[str]] = field(default_factory=list)

    def lines(self) -> list[str]:
        """As Markdown, padded so that it reads well on a terminal too; the first column is flush left."""
        grid = [list(self.columns), *[list(row) for row in self.rows]]
        widths = [max(len(row[k]) for row in grid) for k in range(len(self.columns))]

        def line(cells: Sequence[str]) -> str:
            text = [c.ljust(w) if k == 0 else c.rjust(w) for k, (c, w) in enumerate(zip(cells, widths, strict=True))]
            return f"| {' | '.join(text)} |"

        rule = ["-" * (w + 2) if k == 0 else "-" * (w + 1) + ":" for k, w in enumerate(widths)]
        return [line(grid[0]), f"|{'|'.join(rule)}|", *[line(row) for row in grid[1:]]]


@dataclass(frozen=True)
class Goal:
    """What is wanted, what was reached, and whether that is enough."""

    what: str
    wanted: str
    reached: str
    met: bool


@dataclass
class Section:
    """One benchmark's answer: figures, and how they were measured."""

    title: str
    how: str
    tables: list[Table] = field(default_factory=list)
    goals: list[Goal] = field(default_factory=list)
    seconds: float = 0.0

    def lines(self) -> list[str]:
        """The section as Markdown."""
        text = [f"## {self.title}", "", *self.how.strip().splitlines(), ""]
        for table in self.tables:
            text += [*table.lines(), ""]
        return text


def goal_table(sections: Sequence[Section]) -> Table:
    """All goals, the first thing to look at."""
    rows = [
        (goal.what, goal.wanted, goal.reached, "yes" if goal.met else "NO")
        for section in sections
        for goal in section.goals
    ]
    return Table(("what", "wanted", "reached", "met"), rows)


def middle(values: Sequence[float] | np.ndarray, form: str = "{:.1f}", scale: float = 1.0) -> str:
    """Median of repetitions with their lowest and highest: `12.3 (11.9 … 13.0)`."""
    v = scale * np.asarray(values, dtype=float)
    return f"{form.format(np.median(v))} ({form.format(v.min())} … {form.format(v.max())})"


def machine() -> str:
    """What the figures were measured on; says nothing that names the machine."""
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else float("nan")
    return (
        f"{_processor()}, {os.cpu_count()} cores, {platform.system()} {platform.release().split('-')[0]}, "
        f"{platform.python_implementation()} {platform.python_version()}; load average before the benchmarks {load:.1f}"
    )


def _processor() -> str:
    info = Path("/proc/cpuinfo")
    if info.exists():
        for line in info.read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.machine()
