"""What a page shows of a fit and of a plan, as plain arrays: the report computes no physics."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bench.recording.types import StepMark

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Curve:
    """A function with its doubt: `x`, `y`, shape (n,); `std`: standard deviation of y at each x, or None."""

    x: Array
    y: Array
    std: Array | None = None


@dataclass(frozen=True)
class Evidence:
    """One structure that was tried: an elastic law with a number of relaxation modes.

    `rmse_N`: RMS of the simulated output error; `held_out_rmse_N`: the same on data left out of the fit (NaN: none);
    `criterion`: what the choice went by, less is better (NaN: none); `remark`: why not, in a few words.
    """

    law: str
    order: int
    rmse_N: float
    held_out_rmse_N: float = math.nan
    criterion: float = math.nan
    contact: str = ""
    chosen: bool = False
    remark: str = ""


@dataclass(frozen=True)
class OverTimes:
    """A discrete fit at other sample times: `T` (n,) in s; `numbers`: of the law by name, (n,), NaN where refused;
    `rates` (n, r) in 1/s, NaN where the filter is no relaxation; `physical` (n,); `chosen`: the T of the fit shown;
    `refused`: why, by T."""

    T: Array
    numbers: Mapping[str, Array]
    rates: Array
    physical: NDArray[np.bool_]
    chosen: float
    refused: Mapping[float, str] = field(default_factory=dict)


@dataclass(frozen=True)
class FitView:
    """A fit as the report shows it.

    `json`: the content of fit.json (docs/formats.md). `time_s`, `position_mm` (pad frame), `measured_N`, `simulated_N`:
    shape (n,), at the force stamps, on the recording's clock; outside `fit_from_s` … `fit_to_s` they are history that
    cost nothing. `elastic`: F^e in N over depth in mm; `relaxation`: g over s. `evidence`: the structures tried.
    `history`: how an iterative method converged, `V` in N² and the numbers by name, one entry an iteration (at `time_s`
    where it follows the run); `over_times`: a discrete fit at other sample times.
    """

    json: Mapping[str, Any]
    time_s: Array
    position_mm: Array
    measured_N: Array
    simulated_N: Array
    fit_from_s: float = -math.inf
    fit_to_s: float = math.inf
    elastic: Curve | None = None
    relaxation: Curve | None = None
    evidence: Sequence[Evidence] = ()
    notes: Sequence[str] = ()
    history: Mapping[str, Sequence[float]] = field(default_factory=dict)
    over_times: OverTimes | None = None
    c_0_std: float = math.nan
    """Standard error of the share that never relaxes."""

    def number(self, key: str) -> float:
        """A figure of fit.json; NaN where it is missing or null."""
        value = self.json.get(key)
        return float(value) if isinstance(value, (int, float)) and not isinstance(value, bool) else math.nan


class Plan(NamedTuple):
    """What was planned, on the recording's clock: shape (n,) each; NaN where nothing was expected or planned."""

    time_s: Array
    position_mm: Array
    expected_N: Array | None = None


@dataclass(frozen=True)
class PlanView:
    """A checked protocol: planned depth (pad frame, mm) and expected force (N) over time (s), shape (n,) each.

    `limits`: name → (value, unit), such as {"force": (15.0, "N"), "depth": (3.5, "mm")}; those two are drawn.
    `problems`: what the check refuses, in plain words; empty: it may run. `facts`: what to list beside it.
    """

    time_s: Array
    position_mm: Array
    expected_N: Array | None = None
    steps: Sequence[StepMark] = ()
    limits: Mapping[str, tuple[float, str]] = field(default_factory=dict)
    problems: Sequence[str] = ()
    notes: Sequence[str] = ()
    facts: Mapping[str, str] = field(default_factory=dict)
