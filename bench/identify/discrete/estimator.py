"""What a discrete estimator takes and gives: the interface between the schemes and `outcome`, which reports them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from .._kernel import Array
from . import system
from .linear import arx_equations, difference
from .search import Attempt
from .series import Data
from .system import Structure, simulate

QUIET = 4.0  # noise deviations of force that count as force


@dataclass(frozen=True)
class Found:
    """An estimate: V (scaled), v, iterations, whether they converged, their history.

    `attempts`: where each start led, best first, for a scheme with several. `notes`: plain sentences. `figures`:
    further numbers of the scheme by name. `gamma_covariance`: of γ where it comes from other data than the filter.
    """

    V: float
    v: Array
    iterations: int
    converged: bool
    history: list[tuple[float, Array]]
    attempts: list[Attempt] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    figures: dict[str, float] = field(default_factory=dict)
    gamma_covariance: Array | None = None


class Estimator(Protocol):
    """One scheme."""

    name: str

    def estimate(self, data: Data, structure: Structure, quick: bool = False, start: Array | None = None) -> Found:
        """From the data, or near `start`; `quick` may do with fewer starts. Raises InputError where it cannot."""

    def scores(self, data: Data, structure: Structure, v: Array) -> list[Array]:
        """Of each run (K, P): the terms whose sums the scheme sets to zero."""


def output_error_scores(data: Data, structure: Structure, v: Array) -> list[Array]:
    """w e ∂F/∂v: of schemes whose fixed point is a stationary point of (16)."""
    out = []
    for run in data.runs:
        now = simulate(run, structure, v, "all")
        out.append(now.jacobian * (run.weight * (run.y - now.force))[:, None])
    return out


def arx_scores(data: Data, structure: Structure, v: Array, scaled: bool = False) -> list[Array]:
    """[w e ∂F/∂γ, regressors × equation error]: of the two-step scheme with ARX; `scaled`: b_0 the best for α and β."""
    g, r = structure.nonlinear, structure.order
    simulated = [simulate(run, structure, v, "gamma") for run in data.runs]
    equations = [arx_equations(run, structure, v, now=now) for run, now in zip(data.runs, simulated, strict=True)]
    b_0 = 1.0
    if scaled:
        above, below = 0.0, 0.0
        for e, now in zip(equations, simulated, strict=True):
            own = difference(now.elastic, r) + e.regressors[:, r:] @ v[g + r :]
            left = e.target + difference(now.elastic, r) - e.regressors[:, :r] @ v[g : g + r]
            above += float(own[e.rows] @ left[e.rows])
            below += float(own[e.rows] @ own[e.rows])
        b_0 = above / below if below > 0 else 1.0
    out = []
    for run, now, e in zip(data.runs, simulated, equations, strict=True):
        own = difference(now.elastic, r) + e.regressors[:, r:] @ v[g + r :]
        left = e.target + difference(now.elastic, r) - e.regressors[:, :r] @ v[g : g + r]
        error = np.where(e.rows, left - b_0 * own, 0.0)
        by_gamma = now.jacobian * (run.weight * (run.y - now.force))[:, None]
        out.append(np.concatenate([by_gamma, e.regressors * error[:, None]], axis=1))
    return out


def silent(data: Data, structure: Structure, noise: float) -> list[NDArray[np.bool_]]:
    """Of each run, where a unilateral pad has plainly let go: pressed before, and no force left. `noise`: scaled."""
    out = []
    for run in data.runs:
        quiet = run.y < max(QUIET * noise, 0.005)
        pressed = np.maximum.accumulate(~quiet)
        out.append(quiet & pressed if structure.unilateral else np.zeros_like(quiet))
    return out


def relative_V(data: Data, structure: Structure, v: Array) -> float:
    """(16) in scaled units; inf where the filter runs away."""
    return system.cost(data, structure, v) / data.weight
