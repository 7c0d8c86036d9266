"""`padbench series LIST`: many pads, one after the other, with rests; go on tomorrow where you left."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from bench.commands.options import say, status
from bench.commands.outputs import add_json
from bench.commands.progress import Progress
from bench.daily.words import asked, put_out
from bench.errors import EXIT_DONE, EXIT_NO, InputError, PadbenchError, Refused

if TYPE_CHECKING:
    from bench.daily.series import Answer


def arguments(parser: argparse.ArgumentParser) -> None:
    """What the command takes."""
    parser.add_argument("list", type=Path, metavar="LIST", help="YAML: bench, protocol, pad, out, rest_s, samples")
    parser.add_argument("--simulated", action="store_true", help="dry run: the bench's drivers, simulated ports")
    parser.add_argument("--attended", action="store_true", help="somebody stands at the bench, a hand at its stop")
    parser.add_argument("--yes", action="store_true", help="ask nothing: measure all that is left")
    parser.add_argument("--redo", action="append", default=[], metavar="ID", help="measure this pad again")
    parser.add_argument("--changed", action="store_true", help="go on although bench or protocol have changed")
    add_json(parser, "write the table there; - for standard output alone")


def main(args: argparse.Namespace) -> int:
    """Measure what is left; status 0 when every pad is done, 1 when some are not."""
    from bench.daily import series as work
    from bench.daily import series_table
    from bench.daily.series_file import load_series
    from bench.daily.series_state import read_state
    from bench.preflight import check

    series = load_series(args.list, dry_run=args.simulated)
    unknown = [pad_id for pad_id in args.redo if pad_id not in [pad.id for pad in series.pads]]
    if unknown:
        raise InputError("--redo", f"there is no pad `{unknown[0]}` in {args.list}", "give an id of the list")
    quiet = args.json == "-"
    preflight = check(series.protocol, series.bench, series.believed)
    refusal = preflight.refusal()
    if refusal is not None:
        raise refusal
    if not series.bench.all_simulated and not args.attended:
        raise Refused(
            f"bench '{series.bench.name}' is real hardware, and nobody is said to stand at it\n"
            "  stand there, a hand at its emergency stop, and add --attended (or dry-run it with --simulated)"
        )

    def tell(text: str) -> None:
        print(text, file=sys.stderr, flush=True) if quiet else say(text)

    def analyse(folder: Path) -> None:
        from bench.results import analyse

        try:
            with status(f"fitting {folder.name}", quiet=quiet) as progress:
                results = analyse(folder, believed=series.believed, structure=series.structure, progress=progress)
        except (PadbenchError, OSError) as error:
            tell(f"{folder.name}: no fit: {error}")
            return
        for line in results.lines():
            tell(f"  {line}")

    person = work.Person(
        ask=lambda question, answers: "go" if args.yes and "go" in answers else _ask(question, answers),
        say=tell,
        rest=_rest,
        analyse=analyse,
        progress=lambda: Progress(preflight.duration_s + preflight.approach_s),
        by_itself=args.yes,
    )
    with work.held(series.out):
        state = read_state(series, changed=args.changed)
        try:
            whole = work.measure(series, preflight, state, person, tuple(args.redo))
        finally:
            found = series_table.rows(series, state)
            series_table.write(series, found)
    left = [row["id"] for row in found if row["status"] not in ("done", "skipped")]
    lines = [*series_table.lines(found), f"table: {series.out / series_table.TABLE}"]
    if left:
        lines.append(f"left to do: {', '.join(left)}; the same command goes on there")
    put_out(args, lines, {"series": series.name, "complete": not left, "pads": found})
    return EXIT_DONE if whole and not left else EXIT_NO


_KEYS: dict[Answer, str] = {"go": "Enter", "skip": "s: skip", "redo": "r: redo", "leave": "q: leave, go on another day"}


def _ask(question: str, answers: tuple[Answer, ...]) -> Answer:
    keys = ", ".join(_KEYS[answer] for answer in answers)
    known = {("" if answer == "go" else _KEYS[answer][0]): answer for answer in answers}
    while True:
        word = asked(f"{question} ({keys}):", ", or say --yes" if "go" in answers else "").lower()[:1]
        if word in known:
            return known[word]


def _rest(seconds: float, label: str) -> None:
    """A countdown on the terminal; one line where there is none."""
    from bench.daily.series import wait

    shown = sys.stderr.isatty()
    if not shown:
        print(f"{label} for {seconds:.0f} s", file=sys.stderr, flush=True)
    wait(seconds, lambda left_s: _count(left_s, seconds, label) if shown else None)
    if shown:
        print("\r\x1b[K", end="", file=sys.stderr, flush=True)


def _count(left_s: float, whole_s: float, label: str) -> None:
    done = round(24 * (1.0 - left_s / whole_s))
    bar = "█" * done + "·" * (24 - done)
    print(f"\r\x1b[K{bar} {label}: {left_s:.0f} s left", end="", file=sys.stderr, flush=True)
