"""`padbench paper OUT`: the paper's figures and tables on simulated pads, and its findings as rates."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from bench.errors import EXIT_DONE, InputError

QUICK_DRAWS, QUICK_STARTS = 4, 4


def arguments(parser: argparse.ArgumentParser) -> None:
    """What the command takes."""
    parser.add_argument("out", type=Path, metavar="OUT", help="folder to write; draws in it are taken up again")
    parser.add_argument("--draws", type=int, metavar="N", help="draws of the noise (default: 100)")
    parser.add_argument("--starts", type=int, metavar="N", help="starts of the noniterative search (default: 10)")
    parser.add_argument("--jobs", type=int, metavar="N", help="processes (default: as many as there are cores)")
    parser.add_argument("--quick", action="store_true", help=f"a small try: {QUICK_DRAWS} draws, {QUICK_STARTS} starts")


def main(args: argparse.Namespace) -> int:
    """Make the draws that are missing, judge them all, write the folder."""
    from bench.paper.settings import settings

    stated = settings()
    draws = _count("--draws", args.draws, QUICK_DRAWS if args.quick else stated.draws)
    starts = _count("--starts", args.starts, QUICK_STARTS if args.quick else stated.starts)
    jobs = _count("--jobs", args.jobs, os.cpu_count() or 1)
    if args.out.exists() and not args.out.is_dir():
        raise InputError(str(args.out), "is a file, not a folder", "name a folder")
    args.out.mkdir(parents=True, exist_ok=True)
    _make(args.out, draws, starts, jobs)
    return EXIT_DONE


def _count(option: str, given: int | None, default: int) -> int:
    if given is not None and given < 1:
        raise InputError(option, f"{given} is too few", "1 or more")
    return default if given is None else given


def _make(out: Path, draws: int, starts: int, jobs: int) -> None:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    from bench.paper import draws as many
    from bench.paper import output
    from bench.paper.figures import pictures
    from bench.paper.findings import findings, physical_rates
    from bench.paper.page import page
    from bench.paper.settings import settings, source

    stated = settings()
    columns = (TextColumn("draws"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task("draws", total=draws)
        made = many.run(stated, out, draws, starts, jobs, lambda done: bar.update(task, completed=done))
    found, physical = findings(stated, made), physical_rates(made)
    lines, drawn = output.lines(made), pictures(stated, made)
    (out / "settings.yaml").write_bytes(source().read_bytes())
    output.write_tables(out, lines)
    output.write_findings(out, draws, starts, found, physical)
    for picture in drawn:
        (out / f"{picture.name}.svg").write_text(picture.standalone, encoding="utf-8")
    text = page(stated, draws, starts, found, physical, drawn, lines)
    (out / "index.html").write_text(text, encoding="utf-8")
    for finding in found:
        print(f"{finding.verdict:20}  {finding.claim}")
        for rate, _ in finding.main:
            print(f"{'':22}{rate.label}: {rate}")
    print(f"page: {out / 'index.html'}")
