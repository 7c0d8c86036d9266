"""How much faster than real time does a dry run go, and where does its time go?"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from bench.config import load_bench
from bench.preflight import check
from bench.protocol import load_protocol
from bench.run.runner import Outcome, run_protocol
from tests.benchmarks.profile import LAYERS, OTHER, counted, sampled
from tests.benchmarks.report import Goal, Section, Table, middle

TITLE = "Dry run of the staircase"
PROTOCOL, BENCH = "staircase", "simulated"
WANTED = 10.0
ROUNDS = 5

HOW = """
The shipped `staircase` on the shipped bench `simulated`, as `padbench run` runs it: real drivers, simulated devices
behind `sim://` ports with their time on the wire, 1 kHz position stream, limits, recording to MCAP; virtual time. From
opening the ports to the closed recording; preflight before and fit after are not in it. Bench seconds per second of
processor time stand beside those per second of wall time, since other programs slow down only the latter.
"""


def dry_run() -> Callable[[], Outcome]:
    """A job that runs the protocol into a scratch folder."""
    protocol, bench = load_protocol(PROTOCOL), load_bench(BENCH)
    plan = check(protocol, bench, None).plan

    def job() -> Outcome:
        with tempfile.TemporaryDirectory() as folder:
            outcome = run_protocol(protocol, bench, plan, Path(folder))
        assert outcome.cause is None, outcome.cause
        return outcome

    return job


def run() -> Section:
    """Speed over some rounds, then two profiles."""
    started = time.perf_counter()
    job = dry_run()
    job()  # fills caches
    wall, processor = [], []
    for _ in range(ROUNDS):
        before, used = time.perf_counter(), time.process_time()
        outcome = job()
        wall.append(outcome.bench_seconds / (time.perf_counter() - before))
        processor.append(outcome.bench_seconds / (time.process_time() - used))
    samples = f"{outcome.motor_samples} motor and {outcome.force_samples} force samples"
    speed = Table(("staircase", "times real time, median (range)"))
    speed.rows.append((f"{outcome.bench_seconds:.1f} s of bench time, {samples}: wall", middle(wall)))
    speed.rows.append(("the same by processor time", middle(processor)))
    looked = sampled(job)
    counts, dearest = counted(job)
    layers = Table(("where the time goes", "share, sampled", "share, cProfile"))
    for layer in [*(name for name, _ in LAYERS), OTHER]:
        layers.rows.append((layer, _percent(looked.get(layer, 0.0)), _percent(counts.get(layer, 0.0))))
    functions = Table(("dearest functions, with the builtins they call", "calls", "share, cProfile"))
    functions.rows += [(name, str(calls), _percent(share)) for name, calls, share in dearest]
    reached = sorted(wall)[len(wall) // 2]
    goal = Goal("dry run of the staircase", f"≥ {WANTED:g} × real time", f"{reached:.1f} ×", reached >= WANTED)
    return Section(TITLE, HOW, [speed, layers, functions], [goal], time.perf_counter() - started)


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %"
