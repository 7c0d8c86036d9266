"""`padbench diagnose DATA --model MODEL`: what the simulation gets wrong, why, and what the extension gains."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING

from bench.commands.options import add_columns, named_by_file, read_data, status
from bench.commands.outputs import add_json, add_output
from bench.errors import EXIT_DONE, InputError

if TYPE_CHECKING:
    from bench.diagnose import Diagnosis


def arguments(parser: argparse.ArgumentParser) -> None:
    """What the command takes."""
    parser.add_argument("data", type=Path, metavar="DATA", help="MCAP, run folder or CSV")
    parser.add_argument(
        "--model", required=True, metavar="MODEL", help="the model believed: file, run folder or shipped name"
    )
    add_columns(parser)
    add_json(parser, "write diagnosis.json there; - for standard output alone")
    add_output(parser, "--write", kinds=("yaml",), type=Path, metavar="MODEL2", help="write the extended model as YAML")
    add_output(
        parser,
        "--next",
        kinds=("yaml",),
        type=Path,
        metavar="PROTOCOL2",
        help="write the protocol that tells rivals apart",
    )
    add_output(parser, "--report", kinds=("html",), type=Path, metavar="HTML", help="write a report page")


def main(args: argparse.Namespace) -> int:
    """Diagnose and print; status 0 whatever the verdict."""
    recording = read_data(args, args.data)[0]  # what cannot be read is refused before all else is loaded

    from bench.config import load_model

    model = load_model(args.model)

    from bench.diagnose import diagnose
    from bench.diagnose.words import HOW_NEXT, lines
    from bench.results import is_air_run, next_test

    if is_air_run(recording) and model.pad.elastic.law != "none":
        cure = "name a model with `elastic: {law: none}`: it tells of the bench alone"
        raise InputError(str(args.data), f"was recorded in air: {args.model} has nothing to press there", cure)
    measurement = recording.measurement()
    with status("diagnosing", quiet=args.json == "-") as progress, named_by_file([args.data], [measurement]):
        result = diagnose(measurement, model, progress)
        progress("designing the next test")
        result.next_protocol = next_test(result, recording, measurement)
    text = json.dumps(result.to_json(), indent=2, allow_nan=False)
    if args.json == "-":
        print(text)
    else:
        said = lines(result, f"written to {args.next}" if args.next else HOW_NEXT)
        print("\n".join([*(f"{measurement.name}: {note}" for note in measurement.notes), *said]))
        if args.json:
            Path(args.json).write_text(text + "\n", "utf-8")
    if args.write:
        from bench.modelfile import write_model

        write_model(args.write, result.model)
    if args.next:
        _write_next(args.next, result, quiet=args.json == "-")
    if args.report:
        from bench.report.diagnosis import write_diagnosis

        write_diagnosis(args.report, result, f"Diagnosis · {args.data.name} and {Path(args.model).name}")
    return EXIT_DONE


def _write_next(path: Path, result: Diagnosis, *, quiet: bool) -> None:
    """Write the next protocol; where there is none, say so and write nothing."""
    if result.next_protocol is not None:
        from bench.diagnose.next_test import write_protocol

        write_protocol(path, result.next_protocol)
    elif not quiet:
        from bench.diagnose.words import doubtful

        remain = any(doubtful(cause) for cause in result.causes)
        why = "no test within these limits tells those that remain apart" if remain else "no two causes remain in doubt"
        print(f"no next test: {why}; {path} was not written")
