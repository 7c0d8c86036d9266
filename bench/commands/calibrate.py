"""`padbench calibrate BENCH --weights 0,0.1,0.2`: scale and sign of the load cell from dead weights."""

from __future__ import annotations

import argparse
import datetime
import json
from pathlib import Path
from typing import TYPE_CHECKING

from bench.daily.words import NEWTONS_PER_KG, add_arguments, agreed, asked, bench_of, plain, positive, put_out
from bench.errors import EXIT_DONE, InputError, Refused

if TYPE_CHECKING:
    from bench.config import Bench
    from bench.daily.dead_weights import Reading


def arguments(parser: argparse.ArgumentParser) -> None:
    """What the command takes."""
    add_arguments(parser, moves=False)
    loads = parser.add_mutually_exclusive_group()
    loads.add_argument("--weights", metavar="KG,…", help="masses to put on, kg, 0 first: 0,0.1,0.2,0.5")
    loads.add_argument("--forces", metavar="N,…", help="the same as forces, N")
    loads.add_argument("--readings", type=Path, metavar="CSV", help="readings taken before: reading_N, weight_kg")
    parser.add_argument("--and-back", action="store_true", help="also down again: shows hysteresis")
    parser.add_argument("--seconds", type=float, default=3.0, metavar="S", help="how long each is read (default: 3)")
    parser.add_argument(
        "--gravity", type=float, default=NEWTONS_PER_KG, metavar="M_S2", help="where you are (default: 9.80665)"
    )
    parser.add_argument("--yes", action="store_true", help="write without asking; simulated: weights need no hand")
    parser.add_argument("--dry", action="store_true", help="show the result, write nothing")


def main(args: argparse.Namespace) -> int:
    """Read, fit, show, and with consent write; status 1 where the readings make no calibration."""
    positive("--seconds", args.seconds, 600.0, "s", "a few seconds do")
    if not 9.7 < args.gravity < 9.9:
        raise InputError(
            "--gravity", f"{args.gravity:g} m/s² is nowhere on Earth", "9.780 at the equator, 9.832 at a pole"
        )
    bench = bench_of(args)
    from bench.daily import dead_weights
    from bench.daily.yaml_edit import edited, own_file

    path = None if args.dry else own_file(bench.source, bench.name)
    readings = _readings(args, bench)
    found = dead_weights.calibrate(readings)
    cell = bench.load_cell
    today = datetime.date.today()
    scale, sign = float(f"{cell.scale * found.factor:.7g}"), cell.sign * found.sign
    values = {
        ("load_cell", "scale"): repr(scale),
        ("load_cell", "sign"): str(sign),
        ("load_cell", "calibrated_on"): today.isoformat(),
    }
    figures = {
        "bench": bench.name,
        "date": today,
        "before": {"scale": cell.scale, "sign": cell.sign, "calibrated_on": cell.calibrated_on, "unit": cell.unit},
        "after": {"scale": scale, "sign": sign},
        **found.to_json(),
        "gravity_m_s2": args.gravity,
        "readings": [vars(reading) for reading in readings],
        "written": None,
    }
    lines = dead_weights.lines(found, readings, cell.scale, cell.sign)
    if found.linearity_percent > dead_weights.MOST_LINEARITY_PERCENT:
        put_out(args, lines, figures)
        raise Refused(
            f"the readings depart by {found.linearity_percent:.2f} % of the span from a line: no scale mends that\n"
            "  a weight mistaken for another, a stop that touches, a cable that pulls? the bench file is as it was"
        )
    if path is None:
        put_out(args, [*lines, "nothing was written (--dry)"], figures)
        return EXIT_DONE
    new = edited(bench.text, values, path)  # what cannot be written is told before anybody is asked
    if args.json != "-":
        print("\n".join(lines), flush=True)
    if not agreed(f"write this into {path}?", yes=args.yes):
        put_out(args, ["nothing was written"], figures)
        return EXIT_DONE
    record = _write(path, new, figures, today)
    put_out(args, [f"written: {path}; record: {record}", AFTER], figures)
    return EXIT_DONE


AFTER = "tare and surface are found anew by every run, so nothing old is left; recordings keep the bench file they had"


def _readings(args: argparse.Namespace, bench: Bench) -> list[Reading]:
    from bench.daily import loads

    if args.readings is not None:
        return loads.read_file(args.readings)
    if args.weights is None and args.forces is None:
        raise InputError("--weights", "which loads?", "give --weights 0,0.1,0.2 (kg), --forces (N) or --readings CSV")
    option, text, unit_N = (
        ("--weights", args.weights, args.gravity) if args.weights is not None else ("--forces", args.forces, 1.0)
    )
    wanted = loads.parse_loads(text, option, unit_N)
    loads.too_heavy(wanted, bench.load_cell.capacity, "load_cell.capacity", option)
    if args.and_back:
        wanted += wanted[-2::-1]
    from bench.daily.open_bench import OpenBench

    with OpenBench(bench) as work:
        by_itself = args.yes and work.rig.world is not None
        return loads.read_loads(work, wanted, args.seconds, None if by_itself else asked)


def _write(path: Path, text: str, figures: dict[str, object], today: datetime.date) -> Path:
    """The record first: a bench file never speaks of a calibration that is nowhere."""
    from bench.daily.yaml_edit import write_whole

    stem = f"{path.stem}.calibration_{today.isoformat()}"
    record, n = path.with_name(f"{stem}.json"), 2
    while record.exists():
        record, n = path.with_name(f"{stem}_{n}.json"), n + 1
    figures["written"] = str(path.name)
    write_whole(record, json.dumps(plain(figures), indent=2, allow_nan=False) + "\n")
    write_whole(path, text)
    return record
