"""The long run: `python -m tests.fuzz --inputs 100000`; says how many, and how to make each failure again."""

from __future__ import annotations

import argparse
import random
import resource
import signal
import sys
import tempfile
import time
import traceback
import warnings
from pathlib import Path
from types import FrameType

from tests.fuzz import devices, files

TARGETS = {**files.TARGETS, **devices.TARGETS}

CPU_S = 20.0
"""Processor time that no single input may take; the slowest one takes a tenth of it."""

MEMORY = 4 << 30
SHOWN = 40


class Hang(Exception):
    """An input took too long."""


def once(target: str, number: int, folder: Path) -> None:
    """One input, made from target and number; raises whatever is not an answer."""
    signal.setitimer(signal.ITIMER_PROF, CPU_S)
    try:
        TARGETS[target](folder, random.Random(f"{target}:{number}"))
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)


def watched() -> None:
    """Warnings are errors, a hang is one, and so is memory without bound."""
    warnings.simplefilter("error")
    signal.signal(signal.SIGPROF, _hang)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))


def _hang(number: int, frame: FrameType | None) -> None:
    raise Hang(f"more than {CPU_S:g} s")


def main() -> int:
    """Run, print what failed; status 1 where something did."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--inputs", type=int, default=100_000)
    parser.add_argument("--first", type=int, default=0, metavar="NUMBER", help="begin with this one")
    parser.add_argument("--target", choices=sorted(TARGETS), action="append")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="stop after so long")
    parser.add_argument("--replay", metavar="TARGET:NUMBER", help="one input again, with its traceback")
    args = parser.parse_args()
    watched()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if args.replay:
            target, number = args.replay.split(":")
            once(target, int(number), folder)
            print("no failure")
            return 0
        return _all(args.target or list(TARGETS), args.first, args.inputs, args.seconds, folder)


def _all(targets: list[str], first: int, inputs: int, seconds: float, folder: Path) -> int:
    failed: dict[str, str] = {}
    counts = dict.fromkeys(targets, 0)
    spent = dict.fromkeys(targets, 0.0)
    worst = dict.fromkeys(targets, 0.0)
    kinds: set[str] = set()
    end = time.monotonic() + seconds
    for number in range(first, first + inputs):
        if time.monotonic() > end:
            break
        target = targets[number % len(targets)]
        began = time.process_time()
        try:
            once(target, number, folder)
        except Exception as error:
            frame = traceback.extract_tb(error.__traceback__)[-1]
            kind = f"{type(error).__name__} at {Path(frame.filename).name}:{frame.lineno}: {str(error)[:150]}"
            failed[f"{target}:{number}"] = kind
            where = f"{target} {type(error).__name__} {frame.filename}:{frame.lineno}"
            if where not in kinds and len(kinds) < SHOWN:
                kinds.add(where)
                print(f"{target}:{number}: {kind}", flush=True)
        took = time.process_time() - began
        counts[target] += 1
        spent[target] += took
        worst[target] = max(worst[target], took)
    for target in targets:
        if counts[target]:
            mean_ms = 1e3 * spent[target] / counts[target]
            print(f"{target}: {counts[target]} inputs, {mean_ms:.1f} ms each, {worst[target]:.2f} s the slowest")
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(
        f"{sum(counts.values())} inputs, {len(failed)} failures of {len(kinds)} kinds, {peak:.0f} MB of memory at most"
    )
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
