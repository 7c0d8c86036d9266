"""`padbench doctor BENCH`: is this bench well, and if not, what is to be done?"""

from __future__ import annotations

import argparse
import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bench.commands.outputs import add_output
from bench.daily.words import add_arguments, agreed, bench_of, positive, put_out
from bench.errors import EXIT_DONE, EXIT_NO, InputError, PadbenchError

if TYPE_CHECKING:
    from bench.config import Bench


def arguments(parser: argparse.ArgumentParser) -> None:
    """What the command takes."""
    add_arguments(parser, moves=True)
    parser.add_argument("--press", action="store_true", help="there is a pad: press it gently, for the delay")
    parser.add_argument("--force-cap", type=float, default=2.0, metavar="N", help="never more than that (default: 2 N)")
    parser.add_argument("--seconds", type=float, default=5.0, metavar="S", help="how long to listen (default: 5)")
    parser.add_argument("--yes", action="store_true", help="the direction is known to be right: ask nothing")
    add_output(
        parser,
        "--write",
        kinds=("yaml",),
        edits="bench",
        type=Path,
        metavar="FILE",
        help="write the bench file with the measured delay",
    )


def main(args: argparse.Namespace) -> int:
    """Examine; status 0 where the bench is well, 1 where somebody must see to something."""
    positive("--seconds", args.seconds, 600.0, "s", "some seconds do")
    bench = bench_of(args)
    positive("--force-cap", args.force_cap, bench.limits.force, "N", "limits.force of the bench file holds in any case")
    if args.write is not None and args.write.exists() and args.write.resolve() != (bench.source or Path()).resolve():
        raise InputError(str(args.write), "is there already, and another file than BENCH", "name a new one, or BENCH")
    if args.write is not None and args.write.exists():
        from bench.daily.yaml_edit import own_file

        own_file(bench.source, bench.name)
    from bench.daily import doctor
    from bench.daily.checkup.finding import Checkup
    from bench.daily.open_bench import OpenBench

    with OpenBench(bench) as work:

        def right(question: str) -> bool:
            return agreed(question, yes=args.yes, must_say=True, nobody=bench.all_simulated)

        wishes = doctor.Wishes(args.seconds, args.force_cap, args.press, right)
        checkup, failure = Checkup(), None
        try:
            doctor.examine(work, wishes, checkup)
        except PadbenchError as error:
            failure = error
    lines = [line for finding in checkup.findings for line in finding.lines()]
    if failure is not None:  # what was found until then is worth as much as before
        shown = {"bench": bench.name, **checkup.to_json(), "well": False, "stopped": str(failure), "written": None}
        put_out(args, [*lines, "the check-up did not come to its end"], shown)
        raise failure
    found = doctor.measured_delay(checkup)
    figures: dict[str, Any] = {"bench": bench.name, **checkup.to_json(), "written": None}
    if args.write is not None:
        if found is None:
            lines.append("no delay could be measured, so that nothing was written")
        else:
            _write(args.write, bench, found["delay_s"])
            figures["written"] = str(args.write)
            lines.append(f"written: {args.write}, with timing.force_delay measured today")
    look = sum(finding.ok is False for finding in checkup.findings)
    lines.append("the bench is well" if checkup.well else f"{look} thing{'s' if look > 1 else ''} to see to")
    put_out(args, lines, figures)
    return EXIT_DONE if checkup.well else EXIT_NO


def _write(path: Path, bench: Bench, delay_s: float) -> None:
    """The bench file's text with what was measured in `timing`; comments stay."""
    from bench.daily.yaml_edit import edited, write_whole

    force_s, position_s = delay_s + bench.timing.position_delay, bench.timing.position_delay
    if force_s < 0:  # only the difference is measured, and nothing comes before it happens
        force_s, position_s = 0.0, -delay_s
    values = {
        ("timing", "force_delay"): f"{force_s:.6f}",
        ("timing", "position_delay"): f"{position_s:.6f}",
        ("timing", "measured_on"): datetime.date.today().isoformat(),
    }
    write_whole(path, edited(bench.text, values, path))
