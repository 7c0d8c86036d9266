"""`padbench fit DATA…`: the pad's model from recordings, run folders or CSV."""

from __future__ import annotations

import argparse
import json
import shlex
from pathlib import Path

from bench.commands.options import add_columns, add_structure, named_by_file, pads, read_data, status
from bench.commands.outputs import add_json, add_output
from bench.errors import EXIT_DONE


def arguments(parser: argparse.ArgumentParser) -> None:
    """What the command takes."""
    parser.add_argument(
        "data", nargs="+", type=Path, metavar="DATA", help="MCAP, run folder or CSV; several are one pad"
    )
    add_structure(parser)
    add_columns(parser)
    parser.add_argument(
        "--sample-time", type=float, metavar="T", help="seconds, for a discrete method (default: from the data)"
    )
    parser.add_argument("--starts", type=int, metavar="N", help="noniterative: how many starts (default: 5)")
    parser.add_argument(
        "--ramps", choices=["recovered", "all"], help="fast: the rising ramps that show the elastic law"
    )
    add_json(parser, "write fit.json there; - for standard output, and nothing else")
    add_output(parser, "--write", kinds=("yaml",), type=Path, metavar="MODEL", help="write the fitted model as YAML")
    add_output(
        parser, "--report", kinds=("html",), type=Path, metavar="HTML", help="write a report page of the first DATA"
    )


def main(args: argparse.Namespace) -> int:
    """Fit and print; status 0 whatever the verdict."""
    recordings = read_data(args, *args.data)  # what cannot be read is refused before all else is loaded

    from bench import identify
    from bench.results import fit_lines, lacking

    measurements = pads(recordings)
    options = {name: getattr(args, name) for name in ("starts", "ramps") if getattr(args, name) is not None}
    with status("fitting", quiet=args.json == "-") as progress, named_by_file(args.data, measurements):
        result = identify.fit(
            measurements,
            method=args.method,
            law=args.law,
            order=args.order,
            contact=args.contact,
            degree=args.degree,
            progress=progress,
            sample_time=args.sample_time,
            **options,
        )
    text = json.dumps(result.to_json(), indent=2, allow_nan=False)
    if args.json == "-":
        print(text)
    else:
        said = " ".join(result.notes)  # most methods repeat what was heard on reading
        heard = [f"{m.name}: {note}" for m in measurements for note in m.notes if note not in said]
        print("\n".join([*heard, *fit_lines(result)]))
        if lacking(result) and len(args.data) > 1:
            runs = " ".join(shlex.quote(str(path)) for path in args.data)
            print(f"whether these runs are of one pad: padbench compare {runs}")
        elif lacking(result):
            data, model = (shlex.quote(str(path)) for path in (args.data[0], args.write or "MODEL"))
            print(f"what it may lack: padbench diagnose {data} --model {model}")
        if args.json:
            Path(args.json).write_text(text + "\n", "utf-8")
    if args.write:
        from bench.modelfile import write_model

        write_model(args.write, result.model)
    if args.report:
        from bench.fitview import fit_view, over_times
        from bench.report import write_report

        with status("fitting at other sample times", quiet=args.json == "-"):
            over = over_times(result, measurements, **options)
        write_report(args.report, recordings[0], fit_view(result, over), host=recordings[0].host)
    return EXIT_DONE
