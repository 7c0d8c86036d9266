"""How long a fit takes: 30,000 samples of a staircase from the independent simulator."""

from __future__ import annotations

import time

import numpy as np

from bench.identify import FitResult, fit
from bench.recording.types import Measurement
from tests.benchmarks.report import Goal, Section, Table, middle
from tests.truth.draw import POLYURETHANE
from tests.truth.motion import staircase
from tests.truth.pad import simulate

TITLE = "Fit of 30,000 samples"
WANTED_S = 1.0
SAMPLES = 30_000
ROUNDS = 5

HOW = f"""
A pad like the paper's polyurethane (exponential law, r = 2) on a staircase up and down whose holds fill the time, from
the independent simulator of the tests: {SAMPLES:,} samples at 1 kHz, 10 mN of noise on the force. The time is that of
the fit alone, standard errors included; a fit before the timed ones loads the compiled code. What is not given the fit
finds out by itself.
"""


def measurement(samples: int, rate_Hz: float) -> Measurement:
    """A staircase whose holds fill the time."""
    levels = [0.6, 1.2, 1.8, 2.4, 1.8, 1.2, 0.6, 0.0, -0.5]
    motion = staircase(levels, 80.0, samples / rate_Hz / len(levels))
    stamps = np.arange(samples) / rate_Hz
    force = simulate(POLYURETHANE, motion, stamps, max_step_s=0.05).force_N
    noise = 0.01 * np.random.default_rng(1).standard_normal(samples)
    return Measurement("staircase", stamps, motion.position(stamps), stamps, force + noise)


def _timed(data: Measurement, rounds: int, **options: object) -> tuple[list[float], list[float], FitResult]:
    """Wall and processor time of each round in seconds, and the last result."""
    wall, processor = [], []
    for _ in range(rounds):
        start, used = time.perf_counter(), time.process_time()
        result = fit(data, **options)  # type: ignore[arg-type]
        wall.append(time.perf_counter() - start)
        processor.append(time.process_time() - used)
    return wall, processor, result


def run() -> Section:
    """Law and order given (the goal), then more and more left to the fit."""
    started = time.perf_counter()
    data = measurement(SAMPLES, 1000.0)
    given: dict[str, object] = {"law": "exponential", "order": 2, "contact": "unilateral"}
    fit(data, **given)  # type: ignore[arg-type]
    table = Table(("fit", "s", "s of processor time", "found", "error of b and ν₁, in stated std"))
    medians = []
    law_and_order: dict[str, object] = {"law": "exponential", "order": 2}
    for name, samples, options, rounds in (
        ("30,000 samples: law, order and contact given", data, given, 3),
        ("30,000 samples: law and order given", data, law_and_order, ROUNDS),
        ("30,000 samples: law given", data, {"law": "exponential"}, 2),
        ("30,000 samples: nothing given", data, {}, 2),
        ("1,000,000 samples at 10 kHz: law and order given", measurement(1_000_000, 10_000.0), law_and_order, 1),
    ):
        wall, processor, result = _timed(samples, rounds, **options)
        medians.append(float(np.median(wall)))
        found = f"{result.law}, r = {result.order}, {result.contact}"
        table.rows.append((name, middle(wall, "{:.2f}"), middle(processor, "{:.2f}"), found, _errors(result)))
    reached = medians[1]
    goal = Goal("fit of 30,000 samples, r = 2, law given", f"< {WANTED_S:g} s", f"{reached:.2f} s", reached < WANTED_S)
    return Section(TITLE, HOW, [table], [goal], time.perf_counter() - started)


def _errors(result: FitResult) -> str:
    truth = {"b": POLYURETHANE.law.parameters()["b"], "nu_1": POLYURETHANE.rates[0]}
    values = result.to_json()["parameters"]
    cells = []
    for name, true in truth.items():
        one = values.get(name)
        cells.append(f"{(one['value'] - true) / one['std']:+.1f}" if one and one.get("std") else "-")
    return ", ".join(cells)
