"""`padbench home BENCH`: the axis learns where it is, and stands inside its travel."""

from __future__ import annotations

import argparse

from bench.daily.words import add_arguments, bench_of, put_out
from bench.errors import EXIT_DONE


def arguments(parser: argparse.ArgumentParser) -> None:
    """What the command takes."""
    add_arguments(parser, moves=True)
    parser.add_argument("--again", action="store_true", help="also where the axis says that it is homed")


def main(args: argparse.Namespace) -> int:
    """Home, enter the travel, end in the safe state."""
    bench = bench_of(args)
    from bench.daily.hand import home
    from bench.daily.open_bench import OpenBench

    with OpenBench(bench) as work:
        found = home(work, again=args.again)
    state = found["safe_state"]
    where = state.get("position_mm")
    at = f" at {where:.3f} mm" if where is not None else ""
    said = "homed" if found["homed_now"] else "it was homed already (--again homes it anew)"
    put_out(args, [f"{said}; the axis is in its safe state, {state.get('state', '?')},{at}"], found)
    return EXIT_DONE
