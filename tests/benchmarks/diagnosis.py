"""How long a diagnosis takes: 30,000 samples of every protocol, with each cause of the catalogue hidden in turn."""

from __future__ import annotations

import tempfile
import time

import numpy as np

from tests.benchmarks.report import Goal, Section, Table, middle
from tests.campaign.judge import diagnosed
from tests.campaign.plan import catalogued
from tests.truth.cases import PROTOCOLS, draw_case

TITLE = "Diagnosis of 30,000 samples"
WANTED_S = 10.0
SAMPLES = 30_000
SEED = 1
COARSE_HZ = 200.0  # to learn how long a protocol lasts

HOW = f"""
Cases of the independent simulator of the tests, drawn like those of the campaign but for their rate, which makes
{SAMPLES:,} samples of the protocol: nothing hidden, and each cause of the catalogue at its typical size. The time is
that of the diagnosis alone, with all candidates, by the clock on the wall; a diagnosis before the timed ones loads the
compiled code. Sizes of 2.5 times the typical, and several causes at once, take longer: a further cause is looked for as
long as one pays.
"""


def run() -> Section:
    """Every cause in every protocol."""
    started = time.perf_counter()
    table = Table(("protocol", "s", "s of processor time", "cases", "within 10 s", "right first", "longest"))
    _timed(None, "staircase")
    every: list[float] = []
    for protocol in PROTOCOLS:
        timed = {id or "nothing": _timed(id, protocol) for id in (None, *catalogued("first"))}
        wall, processor, right = map(list, zip(*timed.values(), strict=True))
        within = sum(s <= WANTED_S for s in wall)
        row = (protocol, middle(wall, "{:.1f}"), middle(processor, "{:.1f}"), str(len(wall)), str(within))
        table.rows.append((*row, str(sum(right)), max(timed, key=lambda name: timed[name])))
        every += wall
    within = sum(s <= WANTED_S for s in every)
    text = f"{np.median(every):.1f} s at the median; {within} of {len(every)} within"
    goal = Goal("diagnosis: 30,000 samples, all candidates", f"≤ {WANTED_S:g} s", text, within == len(every))
    return Section(TITLE, HOW, [table], [goal], time.perf_counter() - started)


def _timed(id: str | None, protocol: str) -> tuple[float, float, bool]:
    """Wall and processor time in seconds, and whether what was hidden was named first."""
    ids = () if id is None else (id,)
    coarse = draw_case(SEED, ids, 1.0, protocol=protocol, rate_hz=COARSE_HZ)
    case = draw_case(SEED, ids, 1.0, protocol=protocol, rate_hz=SAMPLES / float(coarse.time_s[-1]))
    with tempfile.TemporaryDirectory() as folder:
        line = diagnosed(case, case.write(folder))
    named = [cause["id"] for cause in line["said"]["causes"][:1]]
    return line["seconds"], line["cpu_seconds"], named == list(ids)
