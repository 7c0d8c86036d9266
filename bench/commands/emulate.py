"""`padbench emulate BENCH`: a simulated bench's devices on pseudo-terminals, for any client."""

from __future__ import annotations

import argparse
import sys

from bench.errors import EXIT_DONE


def arguments(parser: argparse.ArgumentParser) -> None:
    """What the command takes."""
    parser.add_argument("bench", metavar="BENCH", nargs="?", help="bench file or shipped name (default: simulated)")


def main(args: argparse.Namespace) -> int:
    """Print `KEY PATH` a device, then serve on the wall clock until stopped."""
    from bench.config import load_bench, simulated
    from bench.run.simulated import world_of
    from sim.emulate import serve

    serve(world_of(simulated(load_bench(args.bench)), clock="wall"), sys.stdout)
    return EXIT_DONE
