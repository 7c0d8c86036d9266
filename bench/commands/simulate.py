"""`padbench simulate MODEL`: the force a model answers with, over a protocol or over measured motion."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from bench.commands.options import add_columns, named_by_file, read_data
from bench.commands.outputs import add_output
from bench.errors import EXIT_DONE, InputError

if TYPE_CHECKING:
    from bench.recording.types import Array
    from sim.model import Model

FINER = 10.0  # than the preview, so that what happens between samples is there
MOST = 2_000_000  # samples, of a protocol of hours


def arguments(parser: argparse.ArgumentParser) -> None:
    """What the command takes."""
    parser.add_argument("model", metavar="MODEL", help="model file, run folder or shipped pad's name")
    motion = parser.add_mutually_exclusive_group(required=True)
    motion.add_argument("--protocol", metavar="P", help="the planned motion of a protocol")
    motion.add_argument(
        "--like", type=Path, metavar="DATA", help="the measured motion of a recording, run folder or CSV"
    )
    parser.add_argument("--bench", metavar="BENCH", help="with --protocol (default: simulated, as shipped)")
    add_columns(parser)
    add_output(parser, "--out", kinds=("csv",), type=Path, required=True, metavar="CSV", help="file to write")


def main(args: argparse.Namespace) -> int:
    """Simulate and write CSV; with --like, also say how far the simulation is from the data."""
    from bench.config import load_model

    model = load_model(args.model)
    return _over_protocol(args, model) if args.protocol else _over_data(args, model)


def _over_protocol(args: argparse.Namespace, model: Model) -> int:
    """Sampled as the bench would sample it, of a motion and a force that go on between the samples."""
    import numpy as np

    from bench.config import load_bench
    from bench.predict import planned_motion
    from bench.preflight import check
    from bench.protocol import load_protocol
    from bench.rates import motor_rate_Hz
    from bench.recording import write_csv

    protocol = load_protocol(args.protocol)
    if protocol.in_air:
        raise InputError(args.protocol, "presses no pad (`approach: none`)", "name a protocol with an approach")
    bench = load_bench(args.bench)
    preflight = check(protocol, bench, model)
    for problem in preflight.errors:
        print(f"note: on bench '{bench.name}' this would be refused: {problem}")
    finer = min(FINER, max(MOST / preflight.prediction.time_s.size, 1.0))
    fine_s, fine_mm = planned_motion(preflight.plan, model, finer)
    duration_s = float(fine_s[-1])
    rate_Hz = min(motor_rate_Hz(bench, protocol.sampling.motor), MOST / duration_s)
    time_s = np.arange(int(duration_s * rate_Hz) + 1) / rate_Hz
    position, force = np.interp(time_s, fine_s, fine_mm), model.simulate_at(fine_s, fine_mm, time_s)
    _must_be_finite(args.model, force)
    write_csv(args.out, time_s, position, time_s, force)
    print(f"wrote {args.out}: {time_s.size} samples over {duration_s:.1f} s, without noise")
    return EXIT_DONE


def _must_be_finite(model: str, force_N: Array) -> None:
    import numpy as np

    lost = np.count_nonzero(~np.isfinite(force_N))
    if lost:
        what = f"gives no finite force over this motion ({lost} of {force_N.size} samples)"
        raise InputError(
            model, what, "its elastic law is far too steep for it: see that model and motion belong together"
        )


def _over_data(args: argparse.Namespace, model: Model) -> int:
    import numpy as np

    from bench.like import likeness
    from bench.recording import write_csv

    measured = read_data(args, args.like)[0].measurement()
    t, x, force_t = measured.position_time_s, measured.position_mm, measured.force_time_s
    with named_by_file([args.like], [measured]):
        like = likeness(model, measured)
    force = like.force_N
    _must_be_finite(args.model, force)
    if force_t.size == t.size and not np.array_equal(force_t, t):
        # Two clocks with a force for every position: row by row as the data have it.
        write_csv(args.out, t, x, t, force, extra={"force_time_s": (t, force_t)})
    else:
        write_csv(args.out, t, x, force_t, force)
    said = f"; {like.sentence}" if like.sentence else ""
    print(f"wrote {args.out}: {force.size} samples; RMS difference to the data {like.rmse_N:.6g} N{said}")
    return EXIT_DONE
