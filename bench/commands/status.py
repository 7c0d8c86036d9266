"""`padbench status BENCH`: who is there, where it stands, how its lines do; moves and energises nothing."""

from __future__ import annotations

import argparse
from pathlib import Path

from bench.daily.words import add_arguments, bench_of, put_out
from bench.errors import EXIT_DONE, EXIT_NO


def arguments(parser: argparse.ArgumentParser) -> None:
    """What the command takes."""
    add_arguments(parser, moves=False)


def main(args: argparse.Namespace) -> int:
    """Print what was seen; status 0 where all is well, 1 where somebody must see to something."""
    bench = bench_of(args)
    from bench.daily import look
    from bench.daily.open_bench import OpenBench
    from bench.recording.unfinished import left_behind, must_be_idle, notice
    from bench.run.folder import RUNS

    if not bench.all_simulated:
        must_be_idle(Path(RUNS), bench.name)
    left = left_behind(Path(RUNS), bench.name) if not bench.all_simulated else None
    with OpenBench(bench) as work:
        found = look.status(work)
    if left is not None:
        found.remarks.append(notice(left))
    figures = {
        "bench": bench.name,
        "motor": found.motor,
        "load_cell": found.load_cell,
        "lines": found.lines,
        "problems": found.problems,
        "remarks": found.remarks,
    }
    put_out(args, look.words(found), figures)
    return EXIT_NO if found.problems else EXIT_DONE
