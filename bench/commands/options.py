"""Arguments that several commands share."""

from __future__ import annotations

import argparse
from pathlib import Path


def add_bench(parser: argparse.ArgumentParser) -> None:
    """`--bench` and `--pad`."""
    parser.add_argument(
        "--bench", default="simulated", metavar="BENCH", help="bench file or shipped name (default: %(default)s)"
    )
    parser.add_argument(
        "--pad", metavar="MODEL", help="the pad as the lab believes it to be: model file or shipped name"
    )


def add_columns(parser: argparse.ArgumentParser) -> None:
    """`--columns` and `--units` for CSV data."""
    parser.add_argument("--columns", metavar="MAP", help="names in a CSV: time=…,position=…,force=…[,force_time=…]")
    parser.add_argument("--units", metavar="MAP", help="units in a CSV: time=ms,position=m,force=mN")


def add_structure(parser: argparse.ArgumentParser) -> None:
    """What is fitted: law, order, contact."""
    parser.add_argument(
        "--method",
        default="continuous",
        help="continuous (default): simulation error, continuous time; the paper's noniterative, iterative, fast; "
        "iv (iterative, unbiased); recursive (as while the run goes on)",
    )
    parser.add_argument("--law", default="auto", help="exponential, power, polynomial or auto (default)")
    parser.add_argument("--order", default="auto", help="relaxation modes: 1 to 4 or more, or auto (default)")
    parser.add_argument("--degree", type=int, metavar="N", help="degree of a polynomial law")
    parser.add_argument(
        "--contact", default="auto", choices=["auto", "bonded", "unilateral"], help="default: %(default)s"
    )


def existing(path: Path) -> Path:
    """The path, if something is there; raises `InputError`."""
    from bench.errors import InputError

    if not path.exists():
        raise InputError(str(path), "there is no such file or folder", "check the name")
    return path
