"""`padbench export MODEL --to c|json`: a fitted pad for other programs."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from bench.commands.outputs import add_output
from bench.errors import EXIT_DONE, InputError


def arguments(parser: argparse.ArgumentParser) -> None:
    """What the command takes."""
    parser.add_argument("model", metavar="MODEL", help="model file, run folder or shipped pad's name")
    parser.add_argument("--to", required=True, choices=["c", "json"], help="C header for real-time loops, or JSON")
    parser.add_argument("--rate", type=float, default=1000.0, metavar="HZ", help="steps a second (default: 1000)")
    add_output(
        parser,
        "--out",
        kinds=("c", "json"),
        stdout=True,
        metavar="FILE",
        help="file to write; without it, standard output",
    )
    parser.add_argument("--name", default="pad", help="prefix of what the C header defines (default: %(default)s)")
    parser.add_argument("--pad-only", action="store_true", help="leave out effects that an export cannot hold")


def main(args: argparse.Namespace) -> int:
    """Write the export."""
    from bench.config import load_model
    from bench.export import c_header, describe
    from bench.shipped import find_file

    path = find_file("pad", args.model)
    model, source = load_model(path), path.name
    if args.to == "c":
        text = c_header(model, args.rate, name=args.name, source=source, pad_only=args.pad_only)
    else:
        description = describe(model, args.rate, source=source, pad_only=args.pad_only)
        text = json.dumps(description, indent=2, allow_nan=False, ensure_ascii=False) + "\n"
    if args.out is None or args.out == "-":
        print(text, end="")
        return EXIT_DONE
    try:
        Path(args.out).write_text(text, "utf-8")
    except OSError as error:
        raise InputError(args.out, f"cannot be written: {error.strerror}", "name another file with --out") from None
    print(f"wrote {args.out}: {'C header' if args.to == 'c' else 'JSON'} for a loop of {args.rate:g} Hz")
    return EXIT_DONE
