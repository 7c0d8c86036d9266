"""`padbench release BENCH`: the motor lets go."""

from __future__ import annotations

import argparse

from bench.daily.words import add_arguments, agreed, bench_of, put_out
from bench.errors import EXIT_DONE, Refused


def arguments(parser: argparse.ArgumentParser) -> None:
    """What the command takes."""
    add_arguments(parser, moves=False)
    parser.add_argument("--yes", action="store_true", help="also where a vertical axis will sink")


def main(args: argparse.Namespace) -> int:
    """Release, and read back that it is so; status 1 where nobody can say."""
    bench = bench_of(args)
    if bench.motor.orientation == "vertical":
        weight = "the axis is vertical: without force it sinks, with its weight, onto whatever is below."
        if not agreed(f"{weight} Is it held, or its way free?", yes=args.yes):
            raise Refused("the motor was left as it is")
    from bench.daily.hand import release

    found = release(bench)
    where = f" at {found['position_mm']:.3f} mm" if found.get("position_mm") is not None else ""
    put_out(args, [f"{found['motor']}: {found.get('state', '?')}, without force,{where}"], found)
    return EXIT_DONE
