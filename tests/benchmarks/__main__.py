"""Every benchmark by one command: `python -m tests.benchmarks [NAME …] [--write]`.

With names, `--write` renews the parts named and keeps the rest of the page.
"""

from __future__ import annotations

import argparse
import importlib
import re
import sys
from collections.abc import Sequence
from pathlib import Path

from tests.benchmarks.report import Section, Table, goal_table, machine

NAMES = (
    "dry_run", "plant", "wire", "stop_latency", "fit", "estimator", "undetermined", "diagnosis", "touch_off",
    "recording", "day", "export",
)  # fmt: skip
"""In the order of the page; each is a module of this package with `run() -> Section`."""

PAGE = Path(__file__).resolve().parents[2] / "docs" / "benchmarks.md"


def page(sections: Sequence[Section], where: str) -> str:
    """The page as Markdown: goals first, then each benchmark with how it was measured."""
    lines = [
        "# Benchmarks",
        "",
        "Measured and written by one command, on a machine with nothing else to do where that can be had:",
        "",
        "    .venv/bin/python -m tests.benchmarks --write",
        "",
        f"Measured on: {where}.",
        "",
        "Figures are medians of repetitions, with the lowest and the highest in brackets, unless a column says",
        "otherwise. Tests assert none of them: they hold on one machine at one time.",
        "",
        *goal_table(sections).lines(),
        "",
    ]
    for section in sections:
        lines += section.lines()
    return "\n".join(lines).rstrip() + "\n"


def renewed(old: str, sections: Sequence[Section], where: str, titles: Sequence[str]) -> str:
    """The page with these sections anew and all else as it was; `titles`: of all benchmarks, in the page's order.

    A section measured alone says on what. Goals keep their places; those of a renewed section that it no longer has
    (told by the word before the colon) go.
    """
    head, *rest = re.split(r"^(?=## )", old, flags=re.MULTILINE)
    parts = {part.splitlines()[0].removeprefix("## "): part.rstrip() + "\n" for part in rest}
    for section in sections:
        first, gap, *lines = section.lines()
        text = [first, gap, f"Measured alone, on: {where}.", gap, *lines]
        parts[section.title] = "\n".join(text).rstrip() + "\n"
    order = [*(title for title in titles if title in parts), *(title for title in parts if title not in titles)]
    lines = head.rstrip().splitlines()
    table = [k for k, line in enumerate(lines) if line.startswith("|")]
    rows = [[cell.strip() for cell in lines[k].strip("|").split("|")] for k in table[2:]]
    goals = Table(("what", "wanted", "reached", "met"), _goals(rows, goal_table(sections).rows))
    before = lines[: table[0]] if table else [*lines, ""]
    after = lines[table[-1] + 1 :] if table else []
    return "\n\n".join(["\n".join([*before, *goals.lines(), *after]), *(parts[title] for title in order)]).replace(
        "\n\n\n", "\n\n"
    )


def _goals(old: Sequence[Sequence[str]], new: Sequence[Sequence[str]]) -> list[Sequence[str]]:
    named = {row[0]: row for row in new}
    families = {name.partition(":")[0] for name in named if ":" in name}
    out: list[Sequence[str]] = []
    for row in old:
        if row[0] in named:
            out.append(named.pop(row[0]))
        elif row[0].partition(":")[0] not in families:
            out.append(row)
    return [*out, *named.values()]


def main() -> int:
    """Run what is asked for, print it, write the page."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks", description="What it reaches, measured.")
    parser.add_argument("names", metavar="NAME", nargs="*", help=f"some only: {', '.join(NAMES)}")
    parser.add_argument(
        "--write", action="store_true", help=f"write {PAGE.parent.name}/{PAGE.name}: all of it, or the named parts"
    )
    args = parser.parse_args()
    unknown = set(args.names) - set(NAMES)
    if unknown:
        parser.error(f"there is no benchmark {', '.join(sorted(unknown))}; there are {', '.join(NAMES)}")
    where = machine()
    print(where, flush=True)
    sections = []
    for name in args.names or NAMES:
        section: Section = importlib.import_module(f"tests.benchmarks.{name}").run()
        sections.append(section)
        print("\n" + "\n".join(section.lines()) + f"({section.seconds:.0f} s)", flush=True)
    print("\n" + "\n".join(goal_table(sections).lines()))
    if args.write:
        titles = [importlib.import_module(f"tests.benchmarks.{name}").TITLE for name in NAMES]
        anew = page(sections, where)
        text = renewed(PAGE.read_text(encoding="utf-8"), sections, where, titles) if args.names else anew
        PAGE.write_text(text, encoding="utf-8")
        print(f"\nwritten: {PAGE}")
    return 0 if all(goal.met for section in sections for goal in section.goals) else 1


if __name__ == "__main__":
    sys.exit(main())
