"""`padbench run PROTOCOL`: the main job, from the protocol to the fitted model and its report."""

from __future__ import annotations

import argparse
import datetime
import time
from pathlib import Path
from typing import TYPE_CHECKING

from bench.commands.options import add_bench, say, say_plan, status
from bench.commands.progress import Progress
from bench.errors import EXIT_DONE, EXIT_NO, InputError, Refused, Stopped, stop_of

if TYPE_CHECKING:
    from bench.config import Bench
    from bench.predict import Prediction
    from bench.run.runner import Outcome
    from sim.model import Model

HELD_UP_S = 0.1
"""By which moves may take longer than planned without a word."""


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
    from bench.recording.unfinished import left_behind, must_be_idle, notice
    from bench.run.folder import RUNS, must_be_free, own_folder
    from bench.run.runner import Notes, run_protocol
    from bench.shipped import find_file

    if args.operator is not None and not args.operator.strip():
        raise InputError("--operator", "is empty", "give a name, or leave it out")
    if args.out is not None:
        must_be_free(args.out)
    protocol = load_protocol(args.protocol)
    bench = load_bench(args.bench)
    if args.simulated:
        bench = simulated(bench)
    believed = load_model(args.pad) if args.pad else None
    preflight = check(protocol, bench, believed)
    say_plan(preflight)
    if not bench.all_simulated and not args.attended:
        raise Refused(
            f"bench '{bench.name}' is real hardware, and nobody is said to stand at it\n"
            "  stand there, a hand at its emergency stop, and add --attended (or dry-run it with --simulated)"
        )
    if not bench.all_simulated:
        must_be_idle(args.out.parent if args.out is not None else Path(RUNS), bench.name)
    with own_folder(protocol.name, args.out, datetime.datetime.now()) as folder:
        left = left_behind(folder.parent, bench.name) if not bench.all_simulated else None
        if left is not None:
            say(notice(left))
        started = time.perf_counter()
        with Progress(preflight.duration_s + preflight.approach_s) as progress:
            outcome = run_protocol(
                protocol,
                bench,
                preflight.plan,
                folder,
                believed_text=find_file("pad", args.pad).read_text("utf-8") if args.pad else None,
                notes=Notes(args.sample, args.operator, args.note, args.conditions),
                progress=progress.tell,
                planned_s=preflight.duration_s + preflight.approach_s,
                left=left,
            )
    _say_outcome(outcome, bench, time.perf_counter() - started)
    if outcome.strikes > 1:  # whoever strikes twice wants the prompt
        say(f"not fitted, since it was told to stop more than once: `padbench report {outcome.folder}` does that")
    else:
        _after(outcome, preflight.prediction, believed)
    return EXIT_DONE if outcome.cause is None else EXIT_NO


def _after(outcome: Outcome, prediction: Prediction, believed: Model | None) -> None:
    try:
        from bench.results import analyse
        from bench.run.folder import FIT

        with status("fitting the pad's model") as progress:
            results = analyse(outcome.folder, prediction=prediction, believed=believed, progress=progress)
    except KeyboardInterrupt as stop:
        what = "of the diagnosis; the fit is written" if (outcome.folder / FIT).is_file() else "of the fit"
        raise Stopped(
            f"stopped by {stop_of(stop)} in the course {what}\n"
            f"  the recording is whole: `padbench report {outcome.folder}` fits it and writes the rest"
        ) from None
    except OSError as error:
        raise Stopped(
            f"{error.filename or outcome.folder}: what was found cannot be written: {error.strerror}\n"
            f"  the recording is whole: make room, then `padbench report {outcome.folder}` writes the rest"
        ) from None
    for line in results.lines():
        say(line)
    say(f"report: {results.report}")


def _say_outcome(outcome: Outcome, bench: Bench, wall_s: float) -> None:
    what = "simulated " if bench.all_simulated else ""
    speed = f" ({outcome.bench_seconds / wall_s:.0f} times real time)" if bench.all_simulated and wall_s > 0 else ""
    say(
        f"{what}run: {outcome.bench_seconds:.1f} s of bench time in {wall_s:.1f} s{speed}, "
        f"{outcome.motor_samples} motor and {outcome.force_samples} force samples"
    )
    if outcome.held_up_s > HELD_UP_S:
        say(
            f"note: moves took {outcome.held_up_s:.2g} s longer than planned: the motor could be told a position "
            f"every {1e3 * outcome.motor_period_s:.3g} ms only, or this computer was late\n"
            "  see that baud rate and interframe delay of the motor are those of the bench file (docs/bench.md)"
        )
    found = outcome.findings
    if found.surface is not None:
        s = found.surface
        say(f"surface: {s.position_mm:.4f} mm ± {1e3 * s.std_mm:.1f} µm (motor frame)")
    if outcome.cause is not None:
        say(f"STOPPED: {outcome.cause}\n  what was measured until then is kept in {outcome.folder}")
    if found.not_safe:
        say(f"NOT SAFE: the motor's safe state could not be read back: {found.not_safe}\n  use the emergency stop")
