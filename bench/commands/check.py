"""`padbench check PROTOCOL`: is the protocol sound, and what will it do to the pad?"""

from __future__ import annotations

import argparse
from pathlib import Path

from bench.commands.options import add_bench, say_plan
from bench.commands.outputs import add_output
from bench.errors import EXIT_DONE, InputError


def arguments(parser: argparse.ArgumentParser) -> None:
    """What the command takes."""
    parser.add_argument("protocol", metavar="PROTOCOL", nargs="?", help="protocol file or shipped name")
    add_bench(parser)
    add_output(
        parser,
        "--plot",
        kinds=("html",),
        type=Path,
        metavar="HTML",
        help="write planned trajectory and expected force as a page",
    )
    parser.add_argument("--list", action="store_true", help="name the shipped protocols, benches and pads")


def main(args: argparse.Namespace) -> int:
    """Print the plan; status 1 where a limit would be crossed, 2 where the files contradict."""
    if args.list:
        return _list()
    if args.protocol is None:
        raise InputError("PROTOCOL", "which one?", "give a file or a shipped name (`padbench check --list`)")
    from bench.config import load_bench, load_model, ports_agree
    from bench.preflight import check
    from bench.protocol import load_protocol

    protocol = load_protocol(args.protocol)
    bench = load_bench(args.bench)
    ports_agree(bench)
    preflight = check(protocol, bench, load_model(args.pad) if args.pad else None)
    if args.plot is not None:  # drawn where it is refused as well: it shows why
        from bench.planview import plan_view
        from bench.report import write_plan

        write_plan(args.plot, plan_view(preflight), title=f"Plan of {protocol.name}")
    say_plan(preflight)
    if args.plot is not None:
        print(f"plot: {args.plot}")
    return EXIT_DONE


def _list() -> int:
    from bench.shipped import shipped_names

    print(f"protocols: {', '.join(shipped_names('protocol'))}")
    print(f"benches: {', '.join(shipped_names('bench'))}")
    print(f"pads: {', '.join(shipped_names('pad'))}")
    return EXIT_DONE
