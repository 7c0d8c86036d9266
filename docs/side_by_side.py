"""Make docs/side_by_side.md: padbench beside what a user would otherwise reach for, on the same simulated data.

    pip install -e ".[compare]"           # lmfit and SysIdentPy, for this page alone
    python -m docs.side_by_side [--pads N] [--out FILE]

The data are from the independent simulator of the tests. A tool that is not installed is left out, and the page says
so.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import importlib.util
import multiprocessing
import os
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path as File
from typing import Literal

import numpy as np

from docs.side_by_side_tools import LOWER, NAMES, TOOLS, UPPER, Training
from tests.truth import draw
from tests.truth.motion import Motion, Path
from tests.truth.pad import simulate

SEED = 7
PADS = 8  # a case; each with every noise
NOISES = (0.002, 0.02)  # standard deviation, of the largest force
POSITION_MM = 0.0005  # standard deviation of the position
LOST = 0.05  # of the largest force: an error on the unseen protocol that is no fit at all
LEVELS = (0.3, 0.6, 0.9, 0.5)
NEEDS = {"lmfit": "lmfit", "SysIdentPy": "sysidentpy"}
SHORT = {"m": "m", "b": "b", "c_1": "c₁", "c_2": "c₂", "nu_1": "ν₁", "nu_2": "ν₂"}


@dataclass(frozen=True)
class Case:
    """How the data came about."""

    title: str
    contact: Literal["bonded", "unilateral"]
    speed_mm_s: float
    rate_hz: float


CASES = (
    Case("Quick presses, the pad stays on the probe", "bonded", 60.0, 250.0),
    Case("Quick presses, the pad lets go", "unilateral", 60.0, 250.0),
    Case("Slow presses", "bonded", 3.0, 250.0),
    Case("Quick presses, 60 samples a second", "bonded", 60.0, 60.0),
)


@dataclass(frozen=True)
class Outcome:
    """One tool on one data set: relative errors by name, error on the unseen protocol over the largest force, s."""

    case: int
    noise: float
    seed: int
    tool: str
    errors: dict[str, float]
    unseen: float
    seconds: float
    refusal: str = ""

    @property
    def lost(self) -> bool:
        """No fit, or one that is of no use."""
        return not self.unseen <= LOST


def learned(depth_mm: float, speed_mm_s: float) -> Motion:
    """What the tools see: one press to the greatest depth and a long hold, then a staircase."""
    path = Path(-0.5).hold(0.5).to(depth_mm, speed_mm_s).hold(8.0).to(-0.5, speed_mm_s).hold(4.0)
    for level in LEVELS:
        path.to(level * depth_mm, speed_mm_s).hold(2.0)
    return path.to(-0.5, speed_mm_s).hold(1.0).motion()


def unseen(depth_mm: float) -> Motion:
    """Other speeds, other depths, and a return into air."""
    path = Path(-0.5).hold(0.5).to(0.8 * depth_mm, 8.0).hold(3.0).to(0.35 * depth_mm, 1.5).hold(2.0)
    path.to(0.65 * depth_mm, 15.0).hold(1.0).to(-0.5, 8.0).hold(1.0)
    return path.to(0.5 * depth_mm, 2.0).hold(2.0).motion()


def outcomes_of(task: tuple[int, float, int]) -> list[Outcome]:
    """Every tool on one pad with one noise."""
    index, noise, seed = task
    case = CASES[index]
    drawn = draw.pad(np.random.default_rng([SEED, index, seed]), ["exponential"], (2,), (case.contact,))
    rng = np.random.default_rng([SEED, index, seed, round(1e4 * noise)])
    motion, other = learned(drawn.depth_mm, case.speed_mm_s), unseen(drawn.depth_mm)
    time_s = np.arange(0, motion.duration_s, 1 / case.rate_hz)
    clean = simulate(drawn.pad, motion, time_s).force_N
    top = float(clean.max())
    data = Training(
        time_s,
        motion.position(time_s) + POSITION_MM * rng.standard_normal(len(time_s)),
        clean + noise * top * rng.standard_normal(len(time_s)),
        case.contact == "unilateral",
    )
    other_s = np.arange(0, other.duration_s, 1 / 250.0)
    depth, true = other.position(other_s), simulate(drawn.pad, other, other_s).force_N
    numbers = drawn.pad.parameters()
    out = []
    for name, tool in TOOLS.items():
        if name in NEEDS and importlib.util.find_spec(NEEDS[name]) is None:
            continue
        began = time.process_time()
        try:
            fitted = tool(data)
        except Exception as error:  # whatever a library raises is its answer here
            out.append(Outcome(index, noise, seed, name, {}, np.inf, time.process_time() - began, str(error)))
            continue
        seconds = time.process_time() - began
        off = float(np.sqrt(np.mean((fitted.predict(other_s, depth) - true) ** 2))) / top
        same = set(NAMES) == set(fitted.numbers)  # else a black box, or another structure
        errors = {n: abs(fitted.numbers[n] / x - 1) for n, x in numbers.items()} if same else {}
        out.append(Outcome(index, noise, seed, name, errors, off, seconds))
    return out


def run(pads: int, jobs: int) -> list[Outcome]:
    """All data sets, over processes; in a fixed order."""
    tasks = [(case, noise, seed) for case in range(len(CASES)) for noise in NOISES for seed in range(pads)]
    if jobs == 1:
        return [outcome for task in tasks for outcome in outcomes_of(task)]
    with ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn"), _alone) as pool:
        return [outcome for several in pool.map(outcomes_of, tasks) for outcome in several]


def _alone() -> None:
    """A process: the libraries loaded and the compiled code ready before anything is timed."""
    outcomes_of((0, NOISES[0], 10_000))


OWN = "padbench"
ALIKE = 1.05  # errors so near to one another are the same


def table(rows: list[Outcome]) -> list[str]:
    """One case: a line a tool."""
    noises = [f"{100 * noise:g} % noise" for noise in NOISES]
    head = ["tool", *(f"{n}: {what}" for n in noises for what in ("parameters", "unseen")), "lost", "s"]
    lines = ["| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
    for tool in _tools(rows):
        mine = [r for r in rows if r.tool == tool]
        cells = [tool]
        for noise in NOISES:
            here = [r for r in mine if r.noise == noise and not r.lost]
            cells.append(_spread([100 * e for r in here for e in r.errors.values()]))
            cells.append(_spread([100 * r.unseen for r in here]))
        cells.append(f"{sum(r.lost for r in mine)} of {len(mine)}")
        cells.append(f"{np.median([r.seconds for r in mine]):.2g}")
        lines.append("| " + " | ".join(cells) + " |")
    return lines


def _spread(values: list[float]) -> str:
    if not values:
        return "–"
    return f"{np.median(values):.2g} ({np.quantile(values, 0.1):.2g}–{np.quantile(values, 0.9):.2g})"


def _tools(rows: list[Outcome]) -> list[str]:
    return [tool for tool in TOOLS if any(r.tool == tool for r in rows)]


def wins(rows: list[Outcome]) -> list[str]:
    """Of each tool, in how many data sets of a case its error on the unseen protocol is the least, or as good as."""
    sets: dict[tuple[int, float, int], dict[str, float]] = {}
    for r in rows:
        sets.setdefault((r.case, r.noise, r.seed), {})[r.tool] = r.unseen
    lines = ["| tool | " + " | ".join(case.title for case in CASES) + " |", "|---" * (len(CASES) + 1) + "|"]
    for tool in _tools(rows):
        cells = []
        for index in range(len(CASES)):
            here = [of for (case, _, _), of in sets.items() if case == index]
            best = sum(of.get(tool, np.inf) <= ALIKE * min(of.values()) for of in here)
            cells.append(f"{best} of {len(here)}")
        lines.append(f"| {tool} | " + " | ".join(cells) + " |")
    return lines


def against_own(rows: list[Outcome]) -> list[str]:
    """A sentence a tool: where it is as good as padbench told the same, where better, and what time it takes."""
    own = {(r.case, r.noise, r.seed): r for r in rows if r.tool == OWN}
    lines = []
    for tool in _tools(rows):
        if tool == OWN:
            continue
        mine = [r for r in rows if r.tool == tool]
        pairs = [(r, own[r.case, r.noise, r.seed]) for r in mine]
        better = sum(o.unseen > ALIKE * r.unseen for r, o in pairs)
        worse = sum(r.unseen > ALIKE * o.unseen for r, o in pairs)
        ratio = float(np.median([r.seconds / o.seconds for r, o in pairs]))
        time_said = f"{1 / ratio:.2g} times quicker" if ratio < 1 else f"{ratio:.2g} times slower"
        lines.append(
            f"- {tool}: better than padbench (told the same) in {better} of {len(pairs)} data sets, as good in"
            f" {len(pairs) - better - worse}, worse in {worse}; {time_said}."
        )
    return lines


def page(rows: list[Outcome], pads: int) -> str:
    """The page."""
    absent = [name for name in NEEDS if name not in _tools(rows)]
    versions = ", ".join(f"{name} {importlib.metadata.version(name)}" for name in ("scipy", "lmfit", "sysidentpy")
                         if importlib.util.find_spec(name))  # fmt: skip
    bounds = ", ".join(f"{SHORT[n]} {low:g} … {high:g}" for n, low, high in zip(NAMES, LOWER, UPPER, strict=True))
    lines = [
        HEAD.format(
            pads=pads * len(CASES),
            sets=pads * len(CASES) * len(NOISES),
            seed=SEED,
            last=pads - 1,
            versions=versions,
            bounds=bounds,
            position=1e3 * POSITION_MM,
            lost=100 * LOST,
            tools=_about_tools(),
        )  # fmt: skip
    ]
    if absent:
        lines += [f"Not installed when this page was made, and so not in it: {', '.join(absent)}.", ""]
    for index, case in enumerate(CASES):
        contact = "lets go where it would pull" if case.contact == "unilateral" else "may pull"
        lines += [f"## {case.title}", ""]
        lines += [f"{case.speed_mm_s:g} mm/s, {case.rate_hz:g} samples a second, {pads} pads; the pad {contact}.", ""]
        lines += [*table([r for r in rows if r.case == index]), ""]
    lines += ["## Who wins where", "", f"Data sets in which the error on the unseen protocol is the least of all tools,"
              f" or within {100 * (ALIKE - 1):.0f} % of it (so one data set can count for several):", ""]  # fmt: skip
    lines += [*wins(rows), "", *against_own(rows), "", TAIL]
    return "\n".join(lines)


def _about_tools() -> str:
    lines = []
    for name, tool in TOOLS.items():
        said = " ".join((tool.__doc__ or "").split())
        lines.append(f"- **{name}**. {said}")
    return "\n".join(lines)


HEAD = """# Side by side

padbench beside what one would otherwise reach for. Made by

    pip install -e ".[compare]"
    python -m docs.side_by_side

{pads} pads of two modes, drawn at random (seed {seed}, pads 0 to {last} of each case), {sets} data sets, from the
simulator of the tests, which shares no code with padbench. Each pad: an exponential law, 1 to 20 N at 1 to 4 mm, rates
from 0.1 to 60 /s. White noise on the force, {position:g} µm of it on the position. The training data are one press with
a long hold and a staircase; the unseen protocol goes at other speeds to other depths.

Tools ({versions}):

{tools}

scipy and lmfit have the same model, start (the elastic law fitted alone, shares 0.2, rates 5 and 0.5 /s) and bounds
({bounds};
lmfit's ν₁ as up to 1000 times ν₂). One run each, no second try.

Columns: *parameters*: relative error in % of the six numbers, pooled; *unseen*: RMS error on the unseen protocol
against the noise-free truth, % of the largest force; both as median (10 %–90 % quantile) of the fits that are not
lost. *lost*: no fit, or an error there above {lost:g} %. *s*: median processor time of the fit. SysIdentPy's model is a
black box and has no such numbers, nor has a fit that chose another law or order.
"""

TAIL = """So where the law and the number of modes are known, the pad stays on the probe and the samples are dense,
the plain model with `curve_fit` or lmfit does as well, sooner, and is all that is needed.

What this does not show: standard errors, notes on bad data, the choice of law and order (the last line of each table
alone has it), and effects of a real bench, of which these data have none.
"""


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(prog="python -m docs.side_by_side", description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--pads", type=int, default=PADS, help="pads a case")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--out", type=File, default=File(__file__).with_name("side_by_side.md"))
    options = parser.parse_args()
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[name] = "1"  # read by the processes: threads would only add to their time
    options.out.write_text(page(run(options.pads, options.jobs), options.pads), encoding="utf-8")


if __name__ == "__main__":
    main()
