"""The campaign by one command: draw, diagnose, append a line a case; show, list, write the table."""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import sys
import time
from collections.abc import Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from pathlib import Path
from typing import Any

from bench.one_thread import ONE_THREAD
from tests.truth.effects import HALVES

from .count import causes, wrongs
from .judge import run
from .plan import Item, plan
from .show import failures, shown
from .table import page


def read(path: Path) -> list[dict[str, Any]]:
    """Lines of a file of results, the last of each key; a torn last line is left out."""
    lines: dict[str, dict[str, Any]] = {}
    if path.exists():
        for text in path.read_text("utf-8").splitlines():
            try:
                line = json.loads(text)
            except json.JSONDecodeError:
                continue
            lines[line["key"]] = line
    return list(lines.values())


def work(items: Sequence[Item], out: Path, jobs: int, minutes: float | None) -> None:
    """Diagnose in processes of their own and append as they come; no new ones after `minutes`."""
    os.environ.update(ONE_THREAD)
    begun, waiting = time.monotonic(), list(reversed(items))
    out.parent.mkdir(parents=True, exist_ok=True)
    torn = out.exists() and not out.read_bytes().endswith(b"\n") and out.stat().st_size > 0
    with (
        out.open("a", encoding="utf-8") as file,
        ProcessPoolExecutor(jobs, mp_context=multiprocessing.get_context("spawn")) as pool,
    ):
        file.write("\n" if torn else "")
        running: set[Future[dict[str, Any]]] = set()
        done = 0
        while True:
            late = minutes is not None and time.monotonic() - begun > 60 * minutes
            while waiting and len(running) < jobs and not late:
                running.add(pool.submit(run, waiting.pop()))
            if not running:
                break
            ended, running = wait(running, return_when=FIRST_COMPLETED)
            for future in ended:
                line = future.result()
                file.write(json.dumps(line, allow_nan=True) + "\n")
                file.flush()
                done += 1
                print(f"{done}/{len(items)} {told(line)}", file=sys.stderr, flush=True)


def told(line: dict[str, Any]) -> str:
    """A case in one line."""
    wrong = ", ".join(wrongs(line)) or "as it should be"
    if "error" in line:
        return f"{line['key']}: {line['error'].strip().splitlines()[-1]}"
    said = f"{line['said']['verdict']} {' + '.join(causes(line))}".strip()
    return f"{line['key']}: {said} ({line['seconds']:.1f} s) – {wrong}"


def main() -> int:
    """Status 0 however the diagnosis does."""
    parser = argparse.ArgumentParser(prog="python -m tests.campaign", description=__doc__)
    parser.add_argument("--single", type=int, default=0, metavar="N", help="cases an id, sizes 0.05 to 2.5")
    parser.add_argument("--large", type=int, metavar="N", help="cases an id at size 2.5 (a third of --single)")
    parser.add_argument(
        "--null", type=int, default=0, metavar="N", help="cases with nothing hidden, all kinds of noise"
    )
    parser.add_argument("--pairs", type=int, default=0, metavar="N", help="cases with two effects")
    parser.add_argument(
        "--outside", type=int, default=0, metavar="N", help="cases with an effect outside the catalogue"
    )
    parser.add_argument(
        "--half", choices=(*HALVES, "both"), default="first", help="of the shapes: those known, the judge's, or both"
    )
    parser.add_argument("--ids", default="", metavar="ID,…", help="cases of these ids alone")
    parser.add_argument("--failing", type=Path, metavar="FILE", help="the failing cases of another campaign instead")
    parser.add_argument("--seed", type=int, default=1, metavar="S")
    parser.add_argument("--jobs", type=int, default=2, metavar="J", help="processes (2)")
    parser.add_argument("--minutes", type=float, metavar="M", help="begin no case after so long; carry on another time")
    parser.add_argument("--out", type=Path, default=Path("campaign.jsonl"), metavar="FILE", help="a line a case")
    parser.add_argument("--table", type=Path, metavar="MD", help="write the page")
    parser.add_argument("--show", metavar="KEY", help="print a case: its key, or a part of it")
    parser.add_argument("--again", action="store_true", help="with --show: diagnose it with the code as it is")
    parser.add_argument("--keep", type=Path, metavar="DIR", help="with --show --again: leave data and model there")
    parser.add_argument("--failures", action="store_true", help="list failing cases by kind")
    args = parser.parse_args()

    if args.show:
        return shown(read(args.out), args.show, args.again, args.keep)
    if args.failing:
        items = [Item.from_json(line["item"]) for line in read(args.failing) if wrongs(line)]
    else:
        large = args.large if args.large is not None else -(-args.single // 3)
        ids = [id for id in args.ids.split(",") if id]
        items = plan(args.seed, args.single, large, args.null, args.pairs, args.outside, ids, args.half)
    known = {line["key"] for line in read(args.out)}
    items = [item for item in items if item.key not in known]
    if items:
        work(items, args.out, args.jobs, args.minutes)
    lines = read(args.out)
    if args.failures:
        print(failures(lines))
    if args.table:
        command = (
            "python -m tests.campaign --single N --null N --pairs N --outside N --half both --out FILE --table PAGE"
        )
        args.table.write_text(page(lines, command), encoding="utf-8")
        print(f"written: {args.table}")
    if not (items or args.failures or args.table):
        parser.error(
            "nothing to do: say how many cases (--single, --null, --pairs, --outside), or what to do with them"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
