"""What the commands of a day share: their arguments, and how figures come out."""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bench.commands.options import say
from bench.commands.outputs import add_json
from bench.errors import InputError, Refused

if TYPE_CHECKING:
    from bench.config import Bench

NEWTONS_PER_KG = 9.80665
"""Standard gravity; on the Earth's surface it is up to 0.3 % less (equator) or more (poles)."""


def add_arguments(parser: argparse.ArgumentParser, *, moves: bool, figures: bool = True) -> None:
    """BENCH, `--simulated`, `--attended` where something moves, `--json` where figures come out."""
    parser.add_argument("bench", metavar="BENCH", help="bench file or shipped name")
    parser.add_argument("--simulated", action="store_true", help="the bench's drivers and limits, simulated ports")
    if moves:
        parser.add_argument("--attended", action="store_true", help="somebody stands at the bench, a hand at its stop")
    if figures:
        add_json(parser, "write every figure there; - for standard output alone")


def bench_of(args: argparse.Namespace) -> Bench:
    """The bench that the arguments name; raises `InputError`, and `Refused` for a real one that nobody attends."""
    from bench.config import load_bench, simulated

    bench = load_bench(args.bench)
    if args.simulated:
        bench = simulated(bench)
    if not bench.all_simulated and not getattr(args, "attended", True):
        raise Refused(
            f"bench '{bench.name}' is real hardware, and nobody is said to stand at it\n"
            "  stand there, a hand at its emergency stop, and add --attended (or try it with --simulated)"
        )
    return bench


def put_out(args: argparse.Namespace, lines: Iterable[str], figures: Mapping[str, Any]) -> None:
    """Lines for people, or with `--json -` nothing but the figures; with `--json FILE` both."""
    text = json.dumps(plain(figures), indent=2, allow_nan=False)
    if args.json == "-":
        print(text)
        return
    for line in lines:
        say(line)
    if args.json:
        Path(args.json).write_text(text + "\n", "utf-8")


def plain(value: Any) -> Any:
    """The value as JSON knows it: numpy's numbers as Python's, NaN and infinity as null."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if value is None or isinstance(value, bool | int | str) else str(value)


def asked(question: str, otherwise: str = "") -> str:
    """What the person answers on standard input, stripped; raises `Refused` where nobody can, which says what would do
    `otherwise`.

    The question goes to standard error: with `--json -` nothing else may be on standard output.
    """
    print(question, end=" ", file=sys.stderr, flush=True)
    try:
        line = sys.stdin.readline()
    except KeyboardInterrupt:
        print(file=sys.stderr)  # what is said next begins a line of its own
        raise
    if not line:
        print(file=sys.stderr)
        raise Refused(f"nobody answers: standard input has ended\n  answer at a terminal{otherwise}")
    return line.strip()


def agreed(question: str, *, yes: bool, must_say: bool = False, nobody: bool = False) -> bool:
    """Whether the person says yes; `yes`: it was said on the command line.

    Enter is no, but where a no would be believed (`must_say`); what is neither is asked again. `nobody`: where there is
    nobody to be asked at all it is yes, as on a simulated bench, which harms nobody.
    """
    if yes:
        return True
    known = {"y": True, "yes": True, "n": False, "no": False, **({} if must_say else {"": False})}
    while True:
        try:
            answer = asked(f"{question} [y/n]" if must_say else f"{question} [y/N]", ", or say --yes").lower()
        except Refused:
            if nobody:
                return True
            raise
        if answer in known:
            return known[answer]
        nobody = False  # there is somebody


def positive(name: str, value: float, most: float, unit: str, cure: str) -> float:
    """The value, if it lies over 0 and up to `most`; raises `InputError` at the option of that name."""
    if not math.isfinite(value) or not 0 < value <= most:
        raise InputError(name, f"{value:g} {unit} is not over 0 and up to {most:g} {unit}", cure)
    return value
