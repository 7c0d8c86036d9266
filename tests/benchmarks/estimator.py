"""How good the default estimator is: random pads from the independent simulator, many draws.

`python -m tests.benchmarks.estimator --share 0.02` runs a fiftieth of it, to see that it works; `--jobs 2` takes two
processes.
"""

from __future__ import annotations

import argparse
import math
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from bench.identify import fit
from bench.identify.laws import exponential
from bench.identify.recursive import Recursive
from bench.recording.types import Measurement
from tests.benchmarks.estimator_draws import (
    TOLD,
    Outcome,
    Setting,
    coverage,
    far_off,
    flagged,
    outcomes,
    over_bound,
    violations,
)  # fmt: skip
from tests.benchmarks.report import Goal, Section, Table
from tests.truth.laws import Exponential
from tests.truth.motion import staircase
from tests.truth.pad import Pad, simulate

TITLE = "The estimator against the truth"
PADS = 1002
COLOURED = 150
AUTOMATIC = 40
WEAK = 150
CORNERS = 16
THREE = Pad(Exponential(2.24, 0.69), (0.2, 0.15, 0.1), (12.0, 1.4, 0.15))

HOW = f"""
Random pads of the independent simulator (`tests/truth/draw.py`: three laws, 1 to 3 modes, rates a factor 3 apart at the
least, contact of either kind) on a staircase up and down of 80 mm/s steps, with noise on the force. Law, order and
contact are given but where it says otherwise. The bound is Cramér and Rao's; parameters count whose bound is at most
{TOLD:.0%} of the value (in the first table pads of which all are). Error over bound is the pooled root mean square: 1
is as good as can be. Coverage is the share of true values within ±1.96 stated standard errors, 95 % if these are right.
Brackets are 95 % intervals from resampling whole draws.

The judge in the table of what is undetermined: a bound says how far off an estimate may be, and whoever sees the
data knows the value only that well. A judge who knew the bound's size exactly, and of the value only value ± bound,
would call so many undetermined, if he split the way from 50 to 100 % in the middle. The last two columns: of the
numbers called undetermined, and of the others, how many are off by more than half of their true value. The bound holds
near the truth; where two modes can stand in for one another the data may tell less than it says.
"""

Campaign = Callable[[Setting, int], list[Outcome]]


def _range(figures: tuple[float, float, float], form: str = "{:.3f}", scale: float = 1.0) -> str:
    middle, low, high = (form.format(scale * f) for f in figures)
    return f"{middle} [{low}, {high}]"


def _bounds(draws: int, campaign: Campaign) -> tuple[Table, Goal, list[Outcome]]:
    table = Table(("modes", "draws", "parameters", "error over bound", "coverage, %", "V above the truth's"))
    everything: list[Outcome] = []
    for modes in (1, 2, 3, 0):
        rows = campaign(Setting(200.0, 3.0, 0.003, modes, all_told=True), -(-draws // 3)) if modes else everything
        above, fits, _ = violations(rows)
        *cover, count = coverage(rows)
        table.rows.append((str(modes) if modes else "all", str(fits), str(count), _range(over_bound(rows)),
                           _range((cover[0], cover[1], cover[2]), "{:.1f}", 100), str(above)))  # fmt: skip
        everything = [*everything, *rows] if modes else everything
    pooled = over_bound(everything)
    name = "estimator: pooled error over the Cramér-Rao bound"
    return table, Goal(name, "≤ 1.1", _range(pooled), pooled[0] <= 1.1), everything


def _coverages(given: int, automatic: int, campaign: Campaign) -> tuple[Table, list[Goal], list[Outcome]]:
    table = Table(("noise", "fits", "intervals", "coverage, %", "right law and order, %"))
    colours, few = (0.0, 0.005, 0.02, 0.05), (0.0, 0.02)
    known = campaign(Setting(200.0, 3.0, 0.003, colours_s=colours), given)
    chosen = campaign(Setting(200.0, 3.0, 0.003, colours_s=few, auto=True), automatic)
    goals = []
    for what, rows, times in (("", known, colours), (", after auto", chosen, few)):
        pooled = [([t], f"{1e3 * t:g} ms" if t else "white") for t in times]
        for members, label in [*pooled, ([t for t in times if t], "all coloured")]:
            if label == "all coloured" and len(times) <= 2:
                continue
            some = [row for row in rows if row.colour_s in members]
            fits = [row for row in some if not row.name]
            *cover, count = coverage(some)
            right = float(np.mean([row.right for row in fits]))
            shown = _range((cover[0], cover[1], cover[2]), "{:.1f}", 100)
            table.rows.append((label + what, str(len(fits)), str(count), shown, f"{100 * right:.0f}"))
            if rows is known:  # what `auto` chooses is another matter: that is told, not aimed at
                goals.append(Goal(f"estimator: coverage, {label}", "93 to 97 %", shown, 0.93 <= cover[0] <= 0.97))
    return table, goals, known


def _undetermined(draws: int, campaign: Campaign) -> tuple[Table, list[Goal], list[Outcome]]:
    """Ordinary pads, and pads that are mostly told weakly: noise of 2 %, holds of 2 s."""
    table = Table(("pads", "bound", "parameters", "called undetermined, %", "by a judge who knows the bound, %",
                   "off by half: called so", "not called so"))  # fmt: skip
    everything: list[Outcome] = []
    for name, setting in (("ordinary", Setting(200.0, 3.0, 0.003)), ("weakly told", Setting(200.0, 2.0, 0.02))):
        rows = campaign(setting, draws)
        everything += rows
        ranges = (("below 20 %", 0.0, 0.2), ("20 to 50 %", 0.2, 0.5), ("50 to 100 %", 0.5, 1.0),
                  ("above 100 %", 1.0, math.inf))  # fmt: skip
        for label, low, high in ranges:
            lost, count, best = flagged(rows, low, high)
            share = f"{100 * lost / count:.1f}" if count else "-"
            judge = f"{100 * best:.1f}" if count else "-"
            table.rows.append((name, label, str(count), share, judge, *far_off(rows, low, high)))
    told, lost = flagged(everything, 0.0, 0.5), flagged(everything, 1.0, math.inf)
    goals = [
        Goal("estimator: undetermined, bound below 50 %", "none", f"{told[0]} of {told[1]}", told[0] == 0),
        Goal("estimator: undetermined, bound above 100 %", "all", f"{lost[0]} of {lost[1]}", lost[0] == lost[1]),
    ]
    return table, goals, everything


def _corners(draws: int, campaign: Campaign) -> Table:
    table = Table(("rate, Hz", "path between samples", "coverage, %", "error over bound", "V above the truth's, %"))
    for rate in (100.0, 250.0, 500.0):
        setting = Setting(rate, 3.0, 0.0005, paths=("straight", "rebuilt"))
        rows = campaign(setting, draws)
        for path in setting.paths:
            some = [row for row in rows if row.path == path]
            above, fits, _ = violations(some)
            table.rows.append((f"{rate:g}", path, f"{100 * coverage(some)[0]:.1f}", f"{over_bound(some)[0]:.2f}",
                               f"{100 * above / fits:.0f}"))  # fmt: skip
    return table


LONG = """
import sys, time
from bench.identify import fit
from tests.benchmarks.estimator import held_MB, long_run

fit(long_run(20_000), law="exponential", order=2)
m = long_run(int(sys.argv[1]))
open("/proc/self/clear_refs", "w").write("5")
before, started = held_MB(), time.process_time()
fit(m, law="exponential", order=2)
print(held_MB() - before, time.process_time() - started)
"""


def held_MB() -> float:
    """Peak of the memory this process has held since it was last reset (Linux)."""
    with Path("/proc/self/status").open() as status:
        return next(int(line.split()[1]) / 1e3 for line in status if line.startswith("VmHWM"))


def long_run(samples: int) -> Measurement:
    """A press in two steps at 10 kHz; the force is the package's own model's, as only memory and time count."""
    from sim.model import Model

    pad = {"elastic": {"law": "exponential", "m": 2.24, "b": 0.69}}
    model = Model.from_dict({"pad": {**pad, "relaxation": {"shares": [0.25, 0.15], "rates": [4.0, 0.35]}}})
    t = np.arange(samples) * 1e-4
    x = np.interp(t, t[-1] * np.array([0, 0.1, 0.11, 0.5, 0.51, 1]), [-0.5, -0.5, 1.2, 1.2, 2.4, 2.4])
    force = model.simulate(t, x) + 0.01 * np.random.default_rng(1).standard_normal(samples)
    return Measurement("long", t, x, t, force)


def _sizes(samples: Sequence[int]) -> Table:
    table = Table(("samples", "input, MB", "memory beyond it, MB", "s of processor time"))
    for n in samples:
        run = subprocess.run([sys.executable, "-c", LONG, str(n)], capture_output=True, text=True, check=True)
        memory, seconds = (float(word) for word in run.stdout.split())
        table.rows.append((f"{n:,}", f"{24e-6 * n:.0f}", f"{memory:.0f}", f"{seconds:.1f}"))
    return table


def _speed() -> tuple[Table, list[Goal]]:
    """30,000 samples at 1 kHz, three modes; and the recursive update over the same samples."""
    t = np.arange(30_000) * 1e-3
    path = staircase([0.6, 1.2, 1.8, 2.4, 1.8, 1.2, 0.6, 0.0, -0.5], 80.0, 30 / 9)
    force = simulate(THREE, path, t, max_step_s=0.05).force_N + 0.01 * np.random.default_rng(1).standard_normal(len(t))
    data = Measurement("three", t, path.position(t), t, force)
    times, automatic = [], []
    for k in range(6):
        times.append(_seconds(lambda: fit(data, law="exponential", order=3)))
        if k > 3:
            automatic.append(_seconds(lambda: fit(data)))
    given = float(np.median(times[1:]))
    updates = []
    for _ in range(3):
        estimator = Recursive(exponential(), 3, 2.4, float(force.max()))
        samples = list(zip(t.tolist(), data.position_mm.tolist(), force.tolist(), strict=True))
        updates.append(_seconds(lambda e=estimator, s=samples: _updated(e, s)) / len(t) * 1e6)
    each = float(np.median(updates))
    table = Table(("what", "processor time"))
    table.rows = [
        ("30,000 samples, r = 3, law and order given", f"{given:.2f} s"),
        ("30,000 samples, law, order and contact left to the fit", f"{float(np.median(automatic)):.2f} s"),
        ("recursive update, r = 3, a sample", f"{each:.1f} µs"),
    ]
    return table, [
        Goal("estimator: 30,000 samples, r = 3, law and order given", "< 0.5 s", f"{given:.2f} s", given < 0.5),
        Goal("estimator: recursive update, r = 3", "< 20 µs", f"{each:.1f} µs", each < 20),
    ]


def _seconds(work: Callable[[], object]) -> float:
    started = time.process_time()
    work()
    return time.process_time() - started


def _updated(estimator: Recursive, samples: Iterable[tuple[float, float, float]]) -> None:
    for t, depth, force in samples:
        estimator.update(t, depth, force)


def run(share: float = 1.0, jobs: int = 1) -> Section:
    """Everything; `share`: of the draws; `jobs`: processes."""
    started = time.perf_counter()

    def some(n: int) -> int:
        return max(3, round(share * n))

    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:

        def campaign(setting: Setting, draws: int) -> list[Outcome]:
            rows: list[Outcome] = []
            for found in pool.map(partial(outcomes, setting), range(draws), chunksize=4):
                rows += found
            print(f"{setting}: {draws} pads, {time.perf_counter() - started:.0f} s", file=sys.stderr, flush=True)
            return rows

        bounds, near, first = _bounds(some(PADS), campaign)
        covers, covered, second = _coverages(some(COLOURED), some(AUTOMATIC), campaign)
        lost, told, third = _undetermined(some(WEAK), campaign)
        corners = _corners(some(CORNERS), campaign)
    above, fits, _ = violations([*first, *second, *third])
    wanted = Goal("estimator: V at the estimate above V at the truth", "never", f"{above} of {fits}", above == 0)
    speed, fast = _speed()
    sizes = _sizes((1_000_000, 10_000_000) if share == 1.0 else (700_000,))
    tables = [bounds, covers, lost, corners, speed, sizes]
    return Section(TITLE, HOW, tables, [near, *covered, *told, wanted, *fast], time.perf_counter() - started)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=TITLE)
    parser.add_argument("--share", type=float, default=1.0, help="of the draws")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    args = parser.parse_args()
    section = run(args.share, args.jobs)
    print("\n".join(section.lines()))
    lines = [f"{goal.what}: {goal.reached} ({goal.wanted})" for goal in section.goals]
    print("\n".join(lines), f"{section.seconds:.0f} s")
