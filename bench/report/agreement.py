"""Whether the numbers of several fits may be one and the same: by the fits' own errors, and by the scatter of repeats.

A fit's error is that of one run on one spot. Whoever puts a pad back finds it a little different, so where pads were
measured more than once, what lies between pads is held against what lies between the repeats of one.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.special import chdtrc, fdtrc

from bench.report import numbers
from bench.report.markup import digits, measured

ALIKE = 0.01
"""Parameters differ where equal ones would scatter so far in less than this share of cases …"""
DOUBTFUL = 0.05
"""… and are in doubt below this share, which is that of the intervals drawn: 95 % bars may then miss one another."""


class Entry(NamedTuple):
    """A parameter of one run: runs counted from 0; standard deviation; whether its data do not tell it."""

    run: int
    value: float
    std: float
    unit: str
    loose: bool

    @property
    def votes(self) -> bool:
        """Whether it can be held against others: undetermined ones and those of unknown doubt cannot."""
        return math.isfinite(self.std) and self.std > 0 and not self.loose


class OfSample(NamedTuple):
    """A parameter's mean over the runs of one sample, and its standard error."""

    sample: str
    runs: int
    mean: float
    std: float


def parameters_of(fits: Sequence[Mapping[str, Any]]) -> dict[str, list[Entry]]:
    """By parameter: the entry of each fit (content of fit.json) that has it."""
    found: dict[str, list[Entry]] = {}
    for i, fit in enumerate(fits):
        given = fit.get("parameters")
        loose = {str(name) for name in fit.get("undetermined") or ()}
        for name, entry in given.items() if isinstance(given, Mapping) else ():
            value, std, unit = numbers.of(entry)
            if math.isfinite(value):
                found.setdefault(str(name), []).append(Entry(i, value, std, unit, str(name) in loose))
    return found


def agreement(entries: Sequence[Entry]) -> str:
    """Whether values with these standard deviations may be one and the same: χ² of their weighted scatter."""
    voting = [(e.value, e.std) for e in entries if e.votes]
    if len(voting) < 2:
        return ""
    value, std = np.array(voting).T
    weight = 1.0 / std**2
    mean = float(weight @ value / weight.sum())
    chi2 = float(weight @ (value - mean) ** 2)
    chance = float(chdtrc(len(voting) - 1, chi2))
    if chance >= DOUBTFUL:
        return "yes, within their uncertainty"
    if chance >= ALIKE:
        return f"perhaps: equal ones scatter so far in {digits(100 * chance, 2)} % of cases"
    spread = f", spread {digits(100 * float(np.ptp(value)) / abs(mean), 2)} %" if mean else ""
    return f"no{spread}, χ² {digits(chi2, 3)} of {len(voting) - 1}"


def by_sample(entries: Sequence[Entry], samples: Sequence[str]) -> tuple[list[OfSample], float]:
    """(means of the samples, how often samples that are alike would be so far apart): an analysis of variance, in which
    repeats scatter by no less than the fits' own errors. None, NaN: fewer than two samples, or none with repeats.

    `samples`: of each run, by its place; runs without a name are left out.
    """
    groups: dict[str, list[Entry]] = {}
    for e in entries:
        if e.votes and samples[e.run]:
            groups.setdefault(samples[e.run], []).append(e)
    count = sum(map(len, groups.values()))
    freedom = count - len(groups)
    if len(groups) < 2 or freedom < 1:
        return [], math.nan
    means = {name: float(np.mean([e.value for e in group])) for name, group in groups.items()}
    inside = sum((e.value - means[name]) ** 2 for name, group in groups.items() for e in group) / freedom
    inside = max(inside, float(np.mean([e.std**2 for group in groups.values() for e in group])))
    whole = float(np.mean([e.value for group in groups.values() for e in group]))
    between = sum(len(group) * (means[name] - whole) ** 2 for name, group in groups.items()) / (len(groups) - 1)
    chance = float(fdtrc(len(groups) - 1, freedom, between / inside))
    return [OfSample(n, len(g), means[n], math.sqrt(inside / len(g))) for n, g in groups.items()], chance


def differ(chance: float) -> str:
    """What the analysis of variance says of the samples, in words."""
    if chance >= DOUBTFUL:
        return "no further apart than repeats"
    if chance >= ALIKE:
        return f"perhaps apart: repeats scatter so far in {digits(100 * chance, 2)} % of cases"
    return "further apart than repeats"


def lines(fits: Sequence[Mapping[str, Any]], samples: Sequence[str]) -> list[str]:
    """The comparison for a terminal: each parameter that two fits have, and the means of samples with repeats."""
    out = []
    for name, entries in parameters_of(fits).items():
        said = agreement(entries)
        if said:
            low, high = (digits(f(e.value for e in entries if e.votes)) for f in (min, max))
            unit = f" {entries[0].unit}" if entries[0].unit not in ("", "1") else ""
            out.append(f"  {name:<5} {low} … {high}{unit}: {said}")
        means, chance = by_sample(entries, samples)
        if means:
            told = ", ".join(f"{m.sample} {' ± '.join(measured(m.mean, m.std))} ({m.runs})" for m in means)
            out.append(f"        {told}: {differ(chance)}")
    if len({(fit.get("law"), fit.get("order")) for fit in fits}) > 1:
        out.append("  (of different laws or orders numbers of one name are not the same: give --law and --order)")
    return ["do their numbers agree?", *out] if out else []
