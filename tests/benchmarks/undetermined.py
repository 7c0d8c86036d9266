"""What any rule could reach that calls numbers undetermined: rules with more and less knowledge, over the same draws.

A number whose Cramér-Rao bound is below 50 % of it should never be called undetermined, one with a bound above 100 %
always. But the bound is one at the true numbers, and whoever calls sees the data. So each rule here is a figure made
from one draw, higher where the number seems less told, and for every threshold on it stands what it costs.

`python -m tests.benchmarks.undetermined --draws 5` runs a part of it.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from unittest.mock import patch

import numpy as np

from bench.identify import continuous, fit, profile
from bench.identify.estimate import Estimate
from bench.identify.problem import Problem
from bench.recording.types import Measurement
from tests.benchmarks.estimator_draws import STEP_S, Setting, bound_of, drawn, sensitivities
from tests.benchmarks.report import Section, Table
from tests.truth.motion import Motion
from tests.truth.noise import White
from tests.truth.pad import Pad, simulate

TITLE = "What may be called undetermined"
DRAWS, FIRST = 80, 2040
SETTINGS = (Setting(200.0, 3.0, 0.003), Setting(200.0, 2.0, 0.02))
"""Ordinary pads, and pads that are mostly told weakly, as in `estimator`."""

BELOW, ABOVE = 0.5, 1.0
"""Bounds, of the value: below the one a call is false, above the other a missing one is a miss."""
MISSED = (0.0, 0.05, 0.1, 0.2, 0.3)  # of the numbers with a bound above 100 %


HOW = f"""
Wanted is that no number with a bound below 50 % of it is called undetermined, and every one with a bound above 100 %.
But the bound belongs to the true number, and whoever calls has the data. Take the most favourable case, in which the
size of the doubt were known exactly, and only the number itself had to be taken from the data: a number c with bound βc
is found at c (1 + βz), z standard normal, and its doubt is seen as β / |1 + βz| of it. The first table says what that
alone does. A number told to 45 % looks worse than 75 % in one draw of five, and one with a bound of 110 % looks better
than 75 % in a third of them. No threshold undoes that; it only moves the errors from one side to the other.

The second table is of real draws: {DRAWS} seeds of the ordinary and the weakly told pads of the section above, none of
which was used to choose the present rule; shares and rates alone. Each row is a rule: a figure made from one draw, and
the share of the well-told numbers that it calls where its threshold is set to miss so many of the lost ones. What the
fit states is the least. The largest standard error at any place that explains the data as well is what the present rule
goes by, with a second threshold on the first figure. To know the true noise, and to take the bound itself at the
estimate, helps less than to look at other places: where two modes stand in for one another the estimate may be at a
place at which they seem told. The last row has the size of the bound at the truth, which nobody has, and the number
alone from the data: the case of the first table. Even so some are called falsely where none may be missed, so what is
wanted cannot be had. Of the rules that can, none here is better than the present one on both counts.
"""


@dataclass(frozen=True)
class Judged:
    """One parameter of one fit: its true relative bound, whether it is called undetermined, and each rule's figure."""

    seed: int
    name: str
    relative_bound: float
    called: bool
    figures: dict[str, float]


STATED = "stated standard error, of the value"
PROFILE = "largest standard error at places as good"
SIZE_KNOWN = "bound at the truth, of the estimate"
AT_ESTIMATE = "bound at the estimate, noise known"


def judged(setting: Setting, seed: int) -> list[Judged]:
    """One draw of one setting, its fit, and the figures of all rules."""
    rng = np.random.default_rng([seed, int(setting.rate_hz), int(1e6 * setting.noise), setting.modes])
    pad, motion, t, std, J = drawn(setting, rng)
    force = simulate(pad, motion, t, STEP_S).force_N + White(std).draw(t, rng)
    degree = 3 if pad.law.name == "polynomial" else None
    kept: list[dict[str, float]] = []

    def watched(problem: Problem, estimate: Estimate, relative: dict[str, float], independent: float) -> set[str]:
        found = profile.doubts(problem, estimate, relative, independent)
        kept.append(found)
        return {name for name, doubt in found.items() if doubt > profile.DOUBTFUL}

    with patch.object(continuous, "not_told", watched):
        result = fit(
            Measurement("draw", t, motion.position(t), t, force),
            law=pad.law.name, order=len(pad.rates), contact=pad.contact, degree=degree,
        )  # fmt: skip
    values = {name: p.value for name, p in result.parameters.items()}
    least = dict(zip(pad.parameters(), bound_of(J, White(std), t).tolist(), strict=True))
    at_estimate = _bound_at(pad, values, motion, t, std)
    out = []
    for name, true in pad.parameters().items():
        value, stated = max(abs(values[name]), 1e-12), result.parameters[name].std
        stated = stated / value if np.isfinite(stated) else math.inf
        places = kept[0].get(name, 0.0) if kept else math.inf
        figures = {
            STATED: stated,
            PROFILE: max(stated, places),
            SIZE_KNOWN: least[name] / value,
            AT_ESTIMATE: at_estimate[name] / value,
        }
        out.append(Judged(seed, name, least[name] / abs(true), name in result.undetermined, figures))
    return out


def _bound_at(pad: Pad, values: dict[str, float], motion: Motion, t: np.ndarray, std: float) -> dict[str, float]:
    """The bound at other numbers; inf for all where these are no pad's (a share at zero, two rates the same)."""
    shares = [v for n, v in values.items() if n.startswith("c_")]
    if min(shares) <= 0 or sum(shares) > 0.999:
        return dict.fromkeys(values, math.inf)
    J = sensitivities(pad.with_parameters(values), motion, t)
    with np.errstate(all="ignore"):
        try:
            found = bound_of(J, White(std), t)
        except np.linalg.LinAlgError:
            return dict.fromkeys(values, math.inf)
    return {n: float(b) if np.isfinite(b) else math.inf for n, b in zip(pad.parameters(), found, strict=True)}


def curve(rows: Sequence[Judged], figure: Callable[[Judged], float], missed: float) -> float:
    """Share called of the numbers with a bound below 50 %, at the threshold that misses so many above 100 %."""
    lost = np.sort([figure(row) for row in rows if row.relative_bound > ABOVE])
    told = np.array([figure(row) for row in rows if row.relative_bound < BELOW])
    if not len(lost) or not len(told):
        return math.nan
    return float(np.mean(told >= lost[min(int(missed * len(lost) + 1e-9), len(lost) - 1)]))


def present(rows: Sequence[Judged]) -> tuple[float, float]:
    """Of the rule as it is: share called of the bounds below 50 %, share missed of those above 100 %."""
    told = [row.called for row in rows if row.relative_bound < BELOW]
    lost = [not row.called for row in rows if row.relative_bound > ABOVE]
    return float(np.mean(told)) if told else math.nan, float(np.mean(lost)) if lost else math.nan


def modes_alone(rows: Sequence[Judged]) -> list[Judged]:
    """Shares and rates."""
    return [row for row in rows if row.name.startswith(("c_", "nu_"))]


def table(rows: Sequence[Judged]) -> Table:
    """Of each rule: what it calls falsely, at so many misses."""
    some = modes_alone(rows)
    false, missed = present(some)
    told = sum(row.relative_bound < BELOW for row in some)
    lost = sum(row.relative_bound > ABOVE for row in some)
    ends = (*MISSED, missed)
    head = f"called, of {told} with a bound below 50 %, where of {lost} above 100 % are missed:"
    out = Table((head, *(f"{100 * m:.0f} %" for m in MISSED), f"{100 * missed:.0f} % (as now)"))
    out.rows.append(("as it is", *("" for _ in MISSED), f"{100 * false:.1f} %"))
    for name in (STATED, PROFILE, AT_ESTIMATE, SIZE_KNOWN):
        cells = [curve(some, lambda row, n=name: row.figures[n], m) for m in ends]  # type: ignore[misc]
        out.rows.append((name, *(f"{100 * c:.1f} %" for c in cells)))
    return out


def seen() -> Table:
    """Of a number whose doubt is known but for the number itself: how often its relative bound looks how large."""
    sides = (0.5, 0.75, 1.0)
    out = Table(("bound", *(f"looks above {100 * side:.0f} %, %" for side in sides)))
    for beta in (0.2, 0.3, 0.45, 0.75, 1.1, 1.5, 2.5):
        shares = [_phi((1 / side) - (1 / beta)) - _phi(-(1 / side) - (1 / beta)) for side in sides]
        out.rows.append((f"{100 * beta:.0f} %", *(f"{100 * share:.0f}" for share in shares)))
    return out


def _phi(z: float) -> float:
    return 0.5 * math.erfc(-z / math.sqrt(2))


def section(rows: Sequence[Judged], seconds: float = 0.0) -> Section:
    """The section of the page over these draws; it has no goal of its own (those are the estimator's)."""
    return Section(TITLE, HOW, [seen(), table(rows)], seconds=seconds)


def run(draws: int = DRAWS) -> Section:
    """All of it."""
    started = time.perf_counter()
    rows = [row for seed in range(FIRST, FIRST + draws) for setting in SETTINGS for row in judged(setting, seed)]
    return section(rows, time.perf_counter() - started)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=TITLE)
    parser.add_argument("--draws", type=int, default=DRAWS)
    made = run(parser.parse_args().draws)
    print("\n".join(made.lines()), f"{made.seconds:.0f} s")
