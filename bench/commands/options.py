"""Arguments that several commands share."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from bench.errors import InputError

if TYPE_CHECKING:
    from bench.preflight import Preflight
    from bench.recording import Measurement, Recording


def add_bench(parser: argparse.ArgumentParser) -> None:
    """`--bench` and `--pad`."""
    parser.add_argument("--bench", metavar="BENCH", help="bench file or shipped name (default: simulated, as shipped)")
    parser.add_argument(
        "--pad", metavar="MODEL", help="the pad as the lab believes it to be: model file, run folder or shipped name"
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
    parser.add_argument("--law", default="auto", help="exponential, power, polynomial, spline or auto (default)")
    parser.add_argument("--order", default="auto", help="relaxation modes: 1 to 8, or auto (default)")
    parser.add_argument("--degree", type=int, metavar="N", help="of a polynomial law; with auto, of the one tried")
    parser.add_argument(
        "--contact", default="auto", choices=["auto", "bonded", "unilateral"], help="default: %(default)s"
    )


def read_data(args: argparse.Namespace, *paths: Path) -> list[Recording]:
    """Recordings, run folders or CSV with the `--columns` and `--units` given; raises `InputError`."""
    from bench.recording import parse_columns, parse_units, read_recording

    columns: Mapping[str, str] | None = parse_columns(args.columns) if args.columns else None
    units: Mapping[str, str] | None = parse_units(args.units) if args.units else None
    return [read_recording(path, columns=columns, units=units) for path in paths]


def pads(recordings: list[Recording]) -> list[Measurement]:
    """What a fit may see of recordings of a pad; raises `InputError` where there was none, or nothing to fit."""
    from bench.results import is_air_run

    for recording in recordings:
        if is_air_run(recording):
            cure = "fit a run with an approach; an air run tells of the bench alone"
            raise InputError(str(recording.source), "was recorded in air: there is no pad in it", cure)
    return [recording.measurement() for recording in recordings]


@contextmanager
def named_by_file(paths: Sequence[Path], measurements: Sequence[Measurement]) -> Iterator[None]:
    """Have what is wrong with a measurement said of the file that it came from: two folders may hold one name."""
    try:
        yield
    except InputError as error:
        files = {m.name: str(path) for path, m in zip(paths, measurements, strict=True)}
        place = ", ".join(files.get(name, name) for name in error.place.split(", "))
        raise InputError(place, error.message, error.cure) from None


def say_plan(preflight: Preflight) -> None:
    """What the protocol will do, on standard output; raises what stands against it, which is said there alone."""
    refusal = preflight.refusal()
    for line in preflight.lines(errors=refusal is None):
        print(line)
    if refusal is not None:
        raise refusal


def say(text: str) -> None:
    """Print, or be silent from now on where nobody listens any more (the terminal was closed, a pipe ended)."""
    try:
        print(text, flush=True)
    except OSError:
        sys.stdout = Path(os.devnull).open("w", encoding="utf-8")  # noqa: SIM115  # for the rest of the process


@contextmanager
def status(text: str, *, quiet: bool = False) -> Iterator[Callable[[str], None]]:
    """Says on the terminal (standard error) what is going on while it takes long; yields what changes the words."""
    from rich.console import Console

    with Console(stderr=True, quiet=quiet).status(text) as shown:
        yield lambda more: shown.update(f"{text}: {more}")
