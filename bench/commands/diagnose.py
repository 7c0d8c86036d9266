"""`padbench diagnose DATA --model MODEL`: what the simulation gets wrong, why, and what the extension gains."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from bench.commands.options import add_columns, must_be_writable, read_data, status
from bench.errors import EXIT_DONE


def arguments(parser: argparse.ArgumentParser) -> None:
    """What the command takes."""
    parser.add_argument("data", type=Path, metavar="DATA", help="MCAP, run folder or CSV")
    parser.add_argument("--model", required=True, metavar="MODEL", help="the model believed: file or shipped name")
    add_columns(parser)
    parser.add_argument("--json", metavar="OUT", help="write diagnosis.json there; - for standard output alone")
    parser.add_argument("--write", type=Path, metavar="MODEL2", help="write the extended model as YAML")
    parser.add_argument("--next", type=Path, metavar="PROTOCOL2", help="write the protocol that tells rivals apart")
    parser.add_argument("--report", type=Path, metavar="HTML", help="write a report page")


def main(args: argparse.Namespace) -> int:
    """Diagnose and print; status 0 whatever the verdict."""
    from bench.config import load_model
    from bench.diagnose import diagnose
    from bench.diagnose.words import lines

    for path in (args.json, args.write, args.report, args.next):
        must_be_writable(path)
    model = load_model(args.model)
    measurement = read_data(args, args.data)[0].measurement()
    with status("diagnosing", quiet=args.json == "-") as progress:
        result = diagnose(measurement, model, progress)
    text = json.dumps(result.to_json(), indent=2, allow_nan=False)
    if args.json == "-":
        print(text)
    else:
        print("\n".join([*(f"{measurement.name}: {note}" for note in measurement.notes), *lines(result)]))
        if args.json:
            Path(args.json).write_text(text + "\n", "utf-8")
    if args.write:
        from bench.modelfile import write_model

        write_model(args.write, result.model)
    return EXIT_DONE
