"""Every benchmark by one command: `python -m tests.benchmarks [NAME …] [--write]`."""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Sequence
from pathlib import Path

from tests.benchmarks.report import Section, goal_table, machine

NAMES = ("dry_run", "plant", "wire", "stop_latency", "fit", "estimator", "touch_off", "recording", "export")
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


def main() -> int:
    """Run what is asked for, print it, write the page."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks", description="What it reaches, measured.")
    parser.add_argument("names", metavar="NAME", nargs="*", help=f"some only: {', '.join(NAMES)}")
    parser.add_argument("--write", action="store_true", help=f"write {PAGE.parent.name}/{PAGE.name} (all of them)")
    args = parser.parse_args()
    unknown = set(args.names) - set(NAMES)
    if unknown:
        parser.error(f"there is no benchmark {', '.join(sorted(unknown))}; there are {', '.join(NAMES)}")
    if args.write and args.names:
        parser.error("--write writes the whole page: name no benchmarks")
    where = machine()
    print(where, flush=True)
    sections = []
    for name in args.names or NAMES:
        section: Section = importlib.import_module(f"tests.benchmarks.{name}").run()
        sections.append(section)
        print("\n" + "\n".join(section.lines()) + f"({section.seconds:.0f} s)", flush=True)
    print("\n" + "\n".join(goal_table(sections).lines()))
    if args.write:
        PAGE.write_text(page(sections, where), encoding="utf-8")
        print(f"\nwritten: {PAGE}")
    return 0 if all(goal.met for section in sections for goal in section.goals) else 1


if __name__ == "__main__":
    sys.exit(main())
