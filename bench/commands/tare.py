"""`padbench tare BENCH`: the load cell in air, and whether a run could take its zero now."""

from __future__ import annotations

import argparse
from typing import Any

from bench.daily.words import add_arguments, bench_of, positive, put_out
from bench.errors import EXIT_DONE


def arguments(parser: argparse.ArgumentParser) -> None:
    """What the command takes."""
    add_arguments(parser, moves=True)
    parser.add_argument("--seconds", type=float, default=3.0, metavar="S", help="how long to read (default: 3)")
    parser.add_argument(
        "--back-off", type=float, metavar="MM", help="move away first, and see whether the probe touched (moves)"
    )


def main(args: argparse.Namespace) -> int:
    """Print mean, noise and drift; status 1 where the force is not steady or the probe touches."""
    positive("--seconds", args.seconds, 600.0, "s", "a few seconds do")
    if args.back_off is not None:
        positive("--back-off", args.back_off, 5.0, "mm", "half a millimetre does")
    args.attended = args.attended or args.back_off is None  # nothing moves without it
    bench = bench_of(args)
    from bench.daily import zero
    from bench.daily.open_bench import OpenBench

    with OpenBench(bench) as work:
        if args.back_off is None:
            found = zero.read_zero(work, args.seconds)
        else:
            found = zero.read_zero_backing_off(work, args.back_off, args.seconds)
    put_out(args, _lines(found), found)
    return EXIT_DONE


def _lines(found: dict[str, Any]) -> list[str]:
    lines = [
        f"zero {found['mean_N']:+.4f} N ± {1e3 * found['std_of_mean_N']:.2f} mN, one reading ± "
        f"{1e3 * found['noise_N']:.2f} mN, drift {1e3 * found['drift_N_s']:+.2f} mN/s ({found['samples']} readings)"
    ]
    if "contact_check" in found:
        lines.append(f"contact check, {found['backed_off_mm']:.2f} mm back: {found['contact_check']}")
    else:
        lines.append("a probe that rests on something steady reads like air: --back-off 0.5 moves away and sees")
    lines.append("nothing was stored: every run takes its own zero, in air, just before it approaches")
    return lines
