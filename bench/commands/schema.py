"""`padbench schema KIND`: the JSON schema of a file format, for editors."""

from __future__ import annotations

import argparse
import json


def arguments(parser: argparse.ArgumentParser) -> None:
    """What the command takes."""
    parser.add_argument("kind", choices=["protocol", "bench", "model"], help="which file format")


def main(args: argparse.Namespace) -> int:
    """Print the schema."""
    from bench.schemas import schema

    print(json.dumps(schema(args.kind), indent=2))
    return 0
