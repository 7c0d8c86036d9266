"""`padbench jog BENCH --by MM`: a small step of the axis; without `--by`, steps by keys on a terminal."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING

from bench.daily.words import add_arguments, bench_of, positive, put_out
from bench.errors import EXIT_DONE, InputError

if TYPE_CHECKING:
    from bench.config import Bench


def arguments(parser: argparse.ArgumentParser) -> None:
    """What the command takes."""
    add_arguments(parser, moves=True)
    parser.add_argument("--by", type=float, metavar="MM", help="step, positive into the pad (5 mm at most)")
    parser.add_argument("--speed", type=float, default=1.0, metavar="MM_S", help="mm/s, 5 at most (default: 1)")
    parser.add_argument(
        "--force-cap", type=float, default=1.0, metavar="N",
        help="stop where the force changes by so much (default: 1 N)",
    )  # fmt: skip


def main(args: argparse.Namespace) -> int:
    """Move; status 1 where a limit stopped it or would be crossed."""
    from bench.daily.hand import MOST_SPEED_MM_S, MOST_STEP_MM

    if args.by is not None and args.by != 0:
        if not abs(args.by) <= MOST_STEP_MM:
            raise InputError(
                "--by",
                f"{args.by:g} mm is a step of over {MOST_STEP_MM:g} mm",
                "jog in several steps, and look in between",
            )
    elif args.by == 0:
        raise InputError("--by", "0 mm is no step", "give millimetres, negative away from the pad")
    positive("--speed", args.speed, MOST_SPEED_MM_S, "mm/s", "what is faster is a protocol's business")
    if args.by is None and not (sys.stdin.isatty() and sys.stderr.isatty()):
        raise InputError("--by", "is missing, and there is no terminal for keys", "give --by MM")
    bench = bench_of(args)
    positive("--force-cap", args.force_cap, bench.limits.force, "N", "limits.force of the bench file holds in any case")
    positive("--speed", args.speed, bench.limits.speed, "mm/s", "limits.speed of the bench file holds in any case")
    return _step(args, bench) if args.by is not None else _keys(args, bench)


def _step(args: argparse.Namespace, bench: Bench) -> int:
    from bench.daily.hand import jog
    from bench.daily.open_bench import OpenBench

    with OpenBench(bench) as work:
        done = jog(work, args.by, args.speed, args.force_cap)
        state = work.run.found.safe_state or {}
    line = (
        f"from {done.start_mm:.3f} to {done.position_mm:.3f} mm; the force changed by {done.force_change_N:+.3f} N "
        f"({done.peak_change_N:+.3f} N at most); now {state.get('state', '?')}"
    )
    put_out(args, [line], {**vars(done), "safe_state": state})
    return EXIT_DONE


def _keys(args: argparse.Namespace, bench: Bench) -> int:
    from bench.daily.hand import jog_by_keys
    from bench.daily.keys import terminal_keys
    from bench.daily.open_bench import OpenBench

    def tell(text: str) -> None:
        print(f"\r\x1b[K{text}", end="", file=sys.stderr, flush=True)

    print("arrows: forth (up, right: into the pad) and back; + - : size of a step; q: end", file=sys.stderr)
    with OpenBench(bench) as work, terminal_keys(0.05 if work.virtual else 0.0) as keys:
        try:
            end_mm = jog_by_keys(work, keys, tell, args.speed, args.force_cap)
        finally:
            print(file=sys.stderr)
        state = work.run.found.safe_state or {}
    put_out(args, [f"at {end_mm:.3f} mm; now {state.get('state', '?')}"], {"position_mm": end_mm, "safe_state": state})
    return EXIT_DONE
