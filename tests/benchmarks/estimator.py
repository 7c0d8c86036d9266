"""How good the default estimator is: random pads from the independent simulator, many draws.

`python -m tests.benchmarks.estimator --quick` runs a fiftieth of it, to see that it works.
"""

from __future__ import annotations

import argparse
import math
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from unittest.mock import patch

import numpy as np

from bench.identify import continuous, fit, problem
from bench.recording.types import Measurement
from tests.benchmarks.report import Goal, Section, Table
from tests.truth import crb, draw
from tests.truth.motion import Motion, staircase
from tests.truth.noise import Coloured, White
from tests.truth.pad import Pad, simulate

TITLE = "The estimator against the truth"
PROCESSES = 2
DRAWS = 1000
TOLD = 0.2  # of the value: a bound above it is not pooled

HOW = f"""
Random pads of the independent simulator (`tests/truth/draw.py`: three laws, 1 to 3 modes, rates a factor 3 apart at the
least, contact of either kind) on a staircase of 80 mm/s steps, with noise on the force. Law, order and contact are
given but where it says otherwise. The bound is Cramér and Rao's; parameters count whose bound is at most
{TOLD:.0%} of the value. Error over bound is the pooled root mean square: 1 is as good as can be. Coverage is the share
of true values within ±1.96 stated standard errors, 95 % if these are right.
"""


@dataclass(frozen=True)
class Setting:
    """What a draw is made of. `noise`: of the elastic force at depth; `modes`: r, 0 for 1 to 3 at random; `all_told`:
    only pads whose every bound is at most 20 %; `colours_s`: correlation times of the noise, 0 for white."""

    rate_hz: float
    hold_s: float
    noise: float
    modes: int = 0
    all_told: bool = False
    colours_s: tuple[float, ...] = (0.0,)
    repeats: int = 1
    auto: bool = False
    paths: tuple[str, ...] = ("rebuilt",)


@dataclass(frozen=True)
class Outcome:
    """One parameter of one fit, or of none (`name` empty): the fit alone. Errors in units of std and of the bound."""

    colour_s: float
    path: str
    rate_hz: float
    modes: int
    right: bool
    excess: float  # V over V at the truth, minus 1
    name: str = ""
    z: float = math.nan
    over_bound: float = math.nan
    relative_bound: float = math.nan
    undetermined: bool = False


def outcomes(setting: Setting, seed: int) -> list[Outcome]:
    """One pad, drawn anew until it is one that the setting wants, and its fits."""
    rng = np.random.default_rng([seed, int(setting.rate_hz), int(1e6 * setting.noise), setting.modes])
    for _ in range(200):
        drawn = draw.pad(rng, orders=(setting.modes,) if setting.modes else (1, 2, 3))
        depth, std = drawn.depth_mm, setting.noise * drawn.force_N
        levels = (depth * np.array([0.25, 0.5, 0.75, 1.0, 0.5, 0.2])).tolist()
        motion = staircase([*levels, -0.5], 80.0, setting.hold_s, lead_s=0.5 + float(rng.uniform(0, 0.02)))
        t = np.arange(int(motion.duration_s * setting.rate_hz)) / setting.rate_hz
        J = np.stack(list(crb.sensitivities(drawn.pad, motion, t).values()), axis=1)
        values = np.abs(list(drawn.pad.parameters().values()))
        if not setting.all_told or np.all(_bound(J, White(std), t) <= TOLD * values):
            break
    clean = simulate(drawn.pad, motion, t).force_N
    out: list[Outcome] = []
    for colour_s in setting.colours_s:
        noise = Coloured(std, colour_s) if colour_s else White(std)
        bound = _bound(J, noise, t)
        for _ in range(setting.repeats):
            force = clean + noise.draw(t, rng)
            for path in setting.paths:
                out += _fitted(setting, drawn.pad, motion, t, force, clean, bound, colour_s, path)
    return out


def _bound(J: np.ndarray, noise: White, t: np.ndarray) -> np.ndarray:
    white = noise.whiten(t, J)
    fisher = white.T @ white
    scale = np.sqrt(np.diag(fisher))
    return np.asarray(np.sqrt(np.diag(np.linalg.inv(fisher / np.outer(scale, scale)))) / scale)


def _fitted(
    setting: Setting, pad: Pad, motion: Motion, t: np.ndarray, force: np.ndarray, clean: np.ndarray,
    bound: np.ndarray, colour_s: float, path: str,
) -> list[Outcome]:  # fmt: skip
    degree = 3 if pad.law.name == "polynomial" else None
    asked = {} if setting.auto else {
        "law": pad.law.name, "order": len(pad.rates), "contact": pad.contact, "degree": degree
    }  # fmt: skip
    data = Measurement("draw", t, motion.position(t), t, force)
    straight = partial(_straight, problem.build)
    with patch.object(continuous, "build", straight if path == "straight" else problem.build):
        result = fit(data, **asked)  # type: ignore[arg-type]
    right = (result.law, result.order, result.degree) == (pad.law.name, len(pad.rates), degree)
    excess = result.V / float(np.mean((force - clean) ** 2)) - 1
    known = Outcome(colour_s, path, setting.rate_hz, len(pad.rates), right, excess)
    rows = [known]
    for (name, value), least in zip(pad.parameters().items(), bound.tolist(), strict=True):
        found = result.parameters.get(name)
        if found is None:
            continue
        error = found.value - value
        rows.append(
            Outcome(
                colour_s,
                path,
                setting.rate_hz,
                len(pad.rates),
                right,
                excess,
                name,
                error / found.std if found.std > 0 else math.nan,
                error / least,
                least / abs(value) if value else math.inf,
                name in result.undetermined,
            )  # fmt: skip
        )
    return rows


def _straight(build: Callable[..., problem.Problem], *args: object, **options: object) -> problem.Problem:
    return build(*args, **{**options, "between": False})


def campaign(setting: Setting, draws: int, pool: ProcessPoolExecutor) -> list[Outcome]:
    """All draws of a setting, in both processes."""
    return [row for rows in pool.map(partial(outcomes, setting), range(draws), chunksize=2) for row in rows]


def coverage(rows: Sequence[Outcome]) -> tuple[float, int]:
    """Share of intervals that hold the truth, and how many there are; a missing one holds nothing."""
    told = [row for row in rows if row.name and row.right and row.relative_bound <= TOLD]
    return float(np.mean([abs(row.z) < 1.959964 for row in told])), len(told)


def over_bound(rows: Sequence[Outcome]) -> float:
    """Pooled root mean square of error over bound."""
    told = [row.over_bound for row in rows if row.name and row.right and row.relative_bound <= TOLD]
    return float(np.sqrt(np.mean(np.square(told))))


def violations(rows: Sequence[Outcome]) -> tuple[int, int, float]:
    """Fits whose V is above that of the truth, all fits, and the largest excess."""
    excess = [row.excess for row in rows if not row.name]
    return sum(e > 1e-6 for e in excess), len(excess), max([0.0, *excess])


def _bounds(draws: int, pool: ProcessPoolExecutor) -> tuple[Table, Goal, list[Outcome]]:
    table = Table(("modes", "draws", "error over bound", "coverage, %", "V above the truth's"))
    everything: list[Outcome] = []
    for modes in (1, 2, 3):
        setting = Setting(200.0, 3.0, 0.003, modes, all_told=True)
        rows = campaign(setting, -(-draws // 3), pool)
        count = violations(rows)
        cover, _ = coverage(rows)
        table.rows.append((str(modes), str(count[1]), f"{over_bound(rows):.3f}", f"{100 * cover:.1f}", str(count[0])))
        everything += rows
    pooled = over_bound(everything)
    goal = Goal("estimator: pooled error over the Cramér-Rao bound", "≤ 1.1", f"{pooled:.3f}", pooled <= 1.1)
    return table, goal, everything


def _coverages(draws: int, pool: ProcessPoolExecutor) -> tuple[Table, list[Goal], list[Outcome]]:
    table = Table(("noise at 500 Hz", "fits", "intervals", "coverage, %", "right law and order, %"))
    colours = (0.0, 0.005, 0.02, 0.05)
    given = campaign(Setting(500.0, 3.0, 0.003, colours_s=colours, repeats=3), -(-draws // 3), pool)
    automatic = campaign(Setting(500.0, 3.0, 0.003, colours_s=(0.0, 0.02), auto=True), -(-draws // 3), pool)
    goals = []
    for what, rows, times in (("", given, colours), (", after auto", automatic, (0.0, 0.02))):
        for colour_s in times:
            some = [row for row in rows if row.colour_s == colour_s]
            name = (f"{1e3 * colour_s:g} ms" if colour_s else "white") + what
            cover, count = coverage(some)
            fits = [row for row in some if not row.name]
            right = float(np.mean([row.right for row in fits]))
            table.rows.append((name, str(len(fits)), str(count), f"{100 * cover:.1f}", f"{100 * right:.0f}"))
            met = 0.93 <= cover <= 0.97
            goals.append(Goal(f"estimator: coverage, {name}", "93 to 97 %", f"{100 * cover:.1f} %", met))
    return table, goals, given


def _undetermined(draws: int, pool: ProcessPoolExecutor) -> tuple[Table, list[Outcome]]:
    """Ordinary pads, and pads that are mostly told weakly: noise of 2 %, holds of 2 s."""
    table = Table(("pads", "bound", "parameters", "called undetermined, %"))
    everything: list[Outcome] = []
    for name, setting in (("ordinary", Setting(200.0, 3.0, 0.003)), ("weakly told", Setting(200.0, 2.0, 0.02))):
        rows = campaign(setting, draws, pool)
        everything += rows
        for label, low, high in (("below 50 %", 0.0, 0.5), ("50 to 100 %", 0.5, 1.0), ("above 100 %", 1.0, math.inf)):
            some = [row.undetermined for row in rows if row.name and low <= row.relative_bound < high]
            share = f"{100 * float(np.mean(some)):.1f}" if some else "-"
            table.rows.append((name, label, str(len(some)), share))
    return table, everything


def _corners(draws: int, pool: ProcessPoolExecutor) -> Table:
    table = Table(("rate, Hz", "path between samples", "coverage, %", "error over bound", "V above the truth's, %"))
    for rate in (100.0, 250.0, 500.0, 1000.0):
        setting = Setting(rate, 3.0, 0.0005, paths=("straight", "rebuilt"))
        rows = campaign(setting, draws, pool)
        for path in setting.paths:
            some = [row for row in rows if row.path == path]
            above, fits, _ = violations(some)
            table.rows.append((f"{rate:g}", path, f"{100 * coverage(some)[0]:.1f}", f"{over_bound(some):.2f}",
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


def _speed() -> tuple[Table, Goal]:
    from tests.benchmarks.fit import measurement
    from tests.truth.laws import Exponential

    three = Pad(Exponential(2.24, 0.69), (0.2, 0.15, 0.1), (12.0, 1.4, 0.15))
    data = measurement(30_000, 1000.0)
    rng = np.random.default_rng(1)
    path = staircase([0.6, 1.2, 1.8, 2.4, 1.8, 1.2, 0.6, 0.0, -0.5], 80.0, 30 / 9)
    stamps = data.force_time_s
    force = simulate(three, path, stamps, max_step_s=0.05).force_N + 0.01 * rng.standard_normal(len(stamps))
    data = Measurement("three", stamps, path.position(stamps), stamps, force)
    times = []
    for _ in range(6):
        started = time.process_time()
        fit(data, law="exponential", order=3)
        times.append(time.process_time() - started)
    middle = float(np.median(times[1:]))
    table = Table(("fit", "s of processor time"), [("30,000 samples, r = 3, law and order given", f"{middle:.2f}")])
    return table, Goal(
        "estimator: 30,000 samples, r = 3, law and order given", "< 0.5 s", f"{middle:.2f} s", middle < 0.5
    )


def run(share: float = 1.0) -> Section:
    """Everything; `share`: of the draws."""
    started = time.perf_counter()

    def some(n: int) -> int:
        return max(2, round(share * n))

    with ProcessPoolExecutor(PROCESSES, mp_context=get_context("spawn")) as pool:
        bounds, near, first = _bounds(some(DRAWS), pool)
        covers, covered, second = _coverages(some(300), pool)
        lost, third = _undetermined(some(200), pool)
        corners = _corners(some(40), pool)
    above, fits, most = violations([*first, *second, *third])
    wanted = Goal("estimator: V at the estimate above V at the truth", "never", f"{above} of {fits}", above == 0)
    speed, fast = _speed()
    sizes = _sizes((1_000_000, 10_000_000) if share == 1.0 else (700_000,))
    if above:
        bounds.rows.append(("all", str(fits), "", "", f"{above}, by {most:.1e} at most"))
    tables = [bounds, covers, lost, corners, speed, sizes]
    return Section(TITLE, HOW, tables, [near, *covered, wanted, fast], time.perf_counter() - started)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=TITLE)
    parser.add_argument("--quick", action="store_true", help="a fiftieth of the draws")
    section = run(0.02 if parser.parse_args().quick else 1.0)
    print("\n".join(section.lines()))
    print(
        "\n".join(f"{goal.what}: {goal.reached} ({goal.wanted})" for goal in section.goals), f"{section.seconds:.0f} s"
    )
