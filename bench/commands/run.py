"""`padbench run PROTOCOL`: the main job, from the protocol to the fitted model and its report."""

from __future__ import annotations

import argparse
import datetime
import time
from pathlib import Path
from typing import TYPE_CHECKING

from bench.commands.options import add_bench
from bench.errors import EXIT_DONE, EXIT_NO, InputError, Refused

if TYPE_CHECKING:
    from bench.config import Bench
    from bench.predict import Prediction
    from bench.preflight import Preflight
    from bench.run.runner import Outcome


def arguments(parser: argparse.ArgumentParser) -> None:
    """What the command takes."""
    parser.add_argument("protocol", metavar="PROTOCOL", help="protocol file or shipped name (quick, staircase, …)")
    add_bench(parser)
    parser.add_argument("--out", type=Path, metavar="DIR", help="run folder (default: runs/<date>_<time>_<protocol>)")
    parser.add_argument("--simulated", action="store_true", help="dry run: the bench's drivers, simulated ports")
    parser.add_argument("--attended", action="store_true", help="somebody stands at the bench, a hand at its stop")
    parser.add_argument("--sample", metavar="ID", help="what is pressed; goes into the recording")
    parser.add_argument("--operator", metavar="NAME", help="who presses it")
    parser.add_argument("--conditions", metavar="TEXT", help="temperature, humidity … of the day")
    parser.add_argument("--note", metavar="TEXT", help="anything worth remembering")


def main(args: argparse.Namespace) -> int:
    """Check, run, fit, report; status 0 when the protocol ran to its end, 1 when it was refused or stopped."""
    from bench.config import load_bench, load_model, simulated
    from bench.preflight import check
    from bench.protocol import load_protocol
    from bench.run.folder import make_folder
    from bench.run.runner import Notes, run_protocol
    from bench.shipped import find_file

    protocol = load_protocol(args.protocol)
    bench = load_bench(args.bench)
    if args.simulated:
        bench = simulated(bench)
    believed = load_model(args.pad) if args.pad else None
    preflight = check(protocol, bench, believed)
    _say(preflight)
    refusal = preflight.refusal()
    if refusal is not None:
        raise refusal
    if not bench.all_simulated and not args.attended:
        raise Refused(
            f"bench '{bench.name}' is real hardware: stand at it, a hand at its emergency stop, and say --attended "
            "(or dry-run it with --simulated)"
        )
    if isinstance(args.operator, str) and not args.operator.strip():
        raise InputError("--operator", "is empty", "give a name, or leave it out")
    folder = make_folder(protocol.name, args.out, datetime.datetime.now())
    started = time.perf_counter()
    with _Progress(preflight) as progress:
        outcome = run_protocol(
            protocol,
            bench,
            preflight.plan,
            folder,
            believed_text=find_file("pad", args.pad).read_text("utf-8") if args.pad else None,
            notes=Notes(args.sample, args.operator, args.note, args.conditions),
            progress=progress.tell,
        )
    _say_outcome(outcome, bench, time.perf_counter() - started)
    _after(outcome, preflight.prediction)
    return EXIT_DONE if outcome.cause is None else EXIT_NO


def _after(outcome: Outcome, prediction: Prediction) -> None:
    from rich.console import Console

    from bench.results import analyse

    console = Console()
    with console.status("fitting the pad's model"):
        results = analyse(outcome.folder, prediction=prediction)
    for line in results.lines():
        console.print(line, highlight=False, markup=False)
    console.print(f"report: {results.report}", highlight=False, markup=False, soft_wrap=True)


def _say(preflight: Preflight) -> None:
    for line in preflight.lines():
        print(line)


def _say_outcome(outcome: Outcome, bench: Bench, wall_s: float) -> None:
    what = "simulated " if bench.all_simulated else ""
    speed = f" ({outcome.bench_seconds / wall_s:.0f} times real time)" if bench.all_simulated and wall_s > 0 else ""
    print(
        f"{what}run: {outcome.bench_seconds:.1f} s of bench time in {wall_s:.1f} s{speed}, "
        f"{outcome.motor_samples} motor and {outcome.force_samples} force samples"
    )
    found = outcome.findings
    if found.surface is not None:
        s = found.surface
        print(f"surface: {s.position_mm:.4f} mm ± {1e3 * s.std_mm:.1f} µm (motor frame)")
    if outcome.cause is not None:
        print(f"STOPPED: {outcome.cause}\n  what was measured until then is kept in {outcome.folder}")


class _Progress:
    """A progress bar over bench time, redrawn at most ten times a second."""

    def __init__(self, preflight: Preflight) -> None:
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

        self._bar = Progress(
            TextColumn("{task.description:<28.28}"),
            BarColumn(),
            TextColumn("{task.completed:>6.1f} / {task.total:.0f} s bench time"),
            TimeElapsedColumn(),
            transient=True,
        )
        self._task = self._bar.add_task("connecting", total=preflight.duration_s + preflight.approach_s)
        self._next = 0.0

    def tell(self, bench_s: float, label: str) -> None:
        """Called in every turn of the loop: cheap unless a tenth of a second has passed."""
        now = time.perf_counter()
        if now < self._next:
            return
        self._next = now + 0.1
        self._bar.update(self._task, completed=bench_s, description=label)

    def __enter__(self) -> _Progress:
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()
