"""How far off is the surface that touch-off finds, and does it know how far?

Every run is a whole one: devices, wire, tare, approach, recording; the protocol ends after one tiny step. The error is
the recording's `touch_off` event less the `surface_mm` of its `padbench.simulation` record.
"""

from __future__ import annotations

import dataclasses
import json
import math
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
from mcap.reader import make_reader

from bench.config import Bench, load_bench
from bench.preflight import check
from bench.protocol import Protocol
from bench.run.runner import run_protocol
from tests.benchmarks.report import Goal, Section, Table

TITLE = "Touch-off: error of the surface"

COVERED = 0.90
"""Share of surfaces that must lie within two standard deviations as stated: normal errors would be 95 %."""


@dataclasses.dataclass(frozen=True)
class Case:
    """A bench, the truth behind its ports, and how many seeds of it are run."""

    seeds: int
    bench: str = "simulated"
    pad: str = "polyurethane"
    noise_N: float = 0.01
    drift_N_s: float = 0.0

    @property
    def name(self) -> str:
        """As printed."""
        drift = f", drift {1e3 * self.drift_N_s:g} mN/s" if self.drift_N_s else ""
        return f"{self.bench}, {self.pad}, noise {1e3 * self.noise_N:g} mN{drift}"


CASES = (
    Case(40),
    Case(40, pad="silicone"),
    Case(20, noise_N=0.005),
    Case(20, noise_N=0.02),
    Case(20, drift_N_s=0.002),
    Case(20, pad="silicone", noise_N=0.02, drift_N_s=-0.002),
    Case(20, pad="power"),
    Case(20, pad="power", noise_N=0.02),
    Case(20, bench="simulated_iai"),
    Case(20, bench="simulated_modbus"),
)


OTHER_PADS: dict[str, dict[str, object]] = {
    "power": {
        "elastic": {"law": "power", "p": 3.8, "q": 0.77},
        "relaxation": {"shares": [0.25, 0.15], "rates": [4.0, 0.35]},
        "contact": "unilateral",
    },
}
"""Pads that are not shipped: the paper's power law, which begins far softer than the exponential."""


@dataclasses.dataclass(frozen=True)
class Touch:
    """One touch-off: errors and stated deviation in mm; NaN where the run found no surface (`cause` says why)."""

    error_mm: float
    std_mm: float
    cause: str | None


def touch(case: Case, seed: int) -> Touch:
    """Run one seed of a case up to its touch-off and compare with the truth."""
    protocol = Protocol.model_validate(
        {
            "name": "touch",
            "approach": {"speed": 2.0, "force": 0.05, "retract": 0.5},
            "steps": [{"to": 0.0, "speed": 20}],
            "finish": {"retract": 0.5, "air": 0},
        }
    )
    with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryDirectory() as pads:
        bench = _bench(case, seed, Path(pads))
        outcome = run_protocol(protocol, bench, check(protocol, bench, None).plan, Path(folder))
        found, truth_mm = _recorded(outcome.recording)
    if found is None:
        return Touch(math.nan, math.nan, outcome.cause)
    return Touch(found["surface_mm"] - truth_mm, found["surface_std_mm"], outcome.cause)


def _bench(case: Case, seed: int, folder: Path) -> Bench:
    bench = load_bench(case.bench)
    pad = case.pad
    if pad in OTHER_PADS:
        file = folder / f"{pad}.yaml"
        file.write_text(json.dumps({"pad": OTHER_PADS[pad]}))
        pad = str(file)
    assert bench.simulation is not None
    noise = bench.simulation.noise.model_copy(update={"force": case.noise_N, "drift": case.drift_N_s})
    truth = bench.simulation.model_copy(update={"seed": seed, "pad": pad, "noise": noise, "surface": "random"})
    return bench.model_copy(update={"simulation": truth})


def _recorded(path: Path) -> tuple[dict[str, float] | None, float]:
    """The `touch_off` event of a recording, if there is one, and the true surface."""
    with path.open("rb") as stream:
        reader = make_reader(stream)
        truth = next(item.metadata for item in reader.iter_metadata() if item.name == "padbench.simulation")
        for _, _, message in reader.iter_messages(topics=["/event"]):
            event = json.loads(message.data)
            if event["name"] == "touch_off":
                return event, float(truth["surface_mm"])
    return None, float(truth["surface_mm"])


def _one(job: tuple[Case, int]) -> Touch:
    return touch(*job)


def run() -> Section:
    """All cases, over the machine's cores."""
    started = time.perf_counter()
    jobs = [(case, seed) for case in CASES for seed in range(1, case.seeds + 1)]
    with ProcessPoolExecutor() as pool:
        touches = list(pool.map(_one, jobs, chunksize=4))
    table = Table(("case", "runs", "median error, µm", "95 %, µm", "mean, µm", "stated std, µm", "within 2 std"))
    everything: list[Touch] = []
    for case in CASES:
        mine = [t for (c, _), t in zip(jobs, touches, strict=True) if c == case]
        everything += mine
        table.rows.append(_row(case.name, mine))
    table.rows.append(_row("all", everything))
    errors, std = _arrays(everything)
    covered = float(np.mean(np.abs(errors) < 2.0 * std))
    return Section(
        TITLE,
        HOW,
        [table],
        [Goal("touch-off within two stated deviations", f"≥ {COVERED:.0%}", f"{covered:.0%}", covered >= COVERED)],
        time.perf_counter() - started,
    )


HOW = """
Each run is a seed of a simulated bench: its own surface height (0.5 to 2 mm above the start), its own noise. The runs
go through devices, wire, tare and approach up to the touch-off and are recorded; the error is the surface in the
recording's `touch_off` event less the one in its `padbench.simulation` record. "Median" and "95 %" are quantiles of the
error's magnitude, "mean" its bias with the standard error of that mean, "stated std" the median of what the run itself
says about its error, and the last column how often the error was less than twice that (95 % for normal errors).
"""


def _arrays(touches: list[Touch]) -> tuple[np.ndarray, np.ndarray]:
    lost = [t.cause for t in touches if math.isnan(t.error_mm)]
    assert not lost, f"{len(lost)} runs found no surface: {lost[0]}"
    return np.array([t.error_mm for t in touches]), np.array([t.std_mm for t in touches])


def _row(name: str, touches: list[Touch]) -> tuple[str, ...]:
    errors, std = _arrays(touches)
    size = np.abs(errors)
    n = len(errors)
    bias = f"{1e3 * errors.mean():+.1f} ± {1e3 * errors.std(ddof=1) / math.sqrt(n):.1f}"
    return (
        name,
        str(n),
        f"{1e3 * np.median(size):.1f}",
        f"{1e3 * np.quantile(size, 0.95):.1f}",
        bias,
        f"{1e3 * np.median(std):.1f}",
        f"{np.mean(size < 2.0 * std):.0%}",
    )
