"""The paper's noniterative method, (15)-(17): the simulated output error minimised over θ = [a, b, γ] at once.

Gauss-Newton steps with Marquardt's damping on exact gradients (the filter's sensitivities), b_0 = 1, l = r, k = 0. As
in the paper nothing keeps the filter stable or a relaxation, and the search ends in the minimum next to its start.

**Starts.** The paper starts from "an initial guess" that it does not give. Here `starts` is how many: the first takes γ
from the elastic response alone (a = b = 0) and a, b from ARX with that γ; the others are relaxations with shares and
log-uniform rates drawn from a fixed seed, γ fitted to each. Or `starts` are filters of your own. The best end is the
result; all of them are kept, so local minima show.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from bench.errors import InputError
from bench.recording.types import Measurement
from sim.transfer import zero_order_hold

from .._kernel import Array
from ..noise import noise_of
from ..result import FitResult
from . import outcome
from .estimator import Found, output_error_scores, silent
from .linear import arx
from .search import Attempt, everything, first_gamma
from .series import Data
from .system import Structure

STARTS = 5
SAME = 1e-3  # ends whose V differ by less, relatively, are one minimum


@dataclass(frozen=True)
class Start:
    """A first guess of the filter: a_1 … a_r and b_1 … b_r. γ is fitted to it."""

    a: Sequence[float]
    b: Sequence[float]


def fit(
    measurements: Sequence[Measurement],
    law: str = "auto",
    order: int | str = "auto",
    contact: str = "auto",
    degree: int | None = None,
    progress: Callable[[str], None] | None = None,
    sample_time: float | None = None,
    starts: int | Sequence[Start] = STARTS,
) -> FitResult:
    """Fit one pad. `sample_time` T in s (default: from the data); `starts`: how many, or which."""
    if isinstance(starts, int) and starts < 1:
        raise InputError("--starts", f"{starts} starts are none", "1 or more.")
    return outcome.fit(Noniterative(starts), measurements, law, order, contact, degree, progress, sample_time)


class Noniterative:
    """The scheme, for `outcome.fit`."""

    name = "noniterative"

    def __init__(self, starts: int | Sequence[Start] = STARTS) -> None:
        self.starts = starts

    def estimate(self, data: Data, structure: Structure, quick: bool = False, start: Array | None = None) -> Found:
        """The best of the minima that the starts lead to."""
        count = min(self.starts, 2) if quick and isinstance(self.starts, int) else None
        points = [start] if start is not None else self._points(data, structure, count)
        ends = [everything(data, structure, v) for v in points]
        if not ends:
            raise InputError("--starts", "every start is a filter that grows without end within these data")
        ends.sort(key=lambda attempt: attempt.V)
        best = ends[0]
        return Found(best.V, best.v, best.iterations, best.converged, best.history, ends, _about(ends))

    def scores(self, data: Data, structure: Structure, v: Array) -> list[Array]:
        """Those of the output error."""
        return output_error_scores(data, structure, v)

    def _points(self, data: Data, structure: Structure, count: int | None) -> list[Array]:
        if not isinstance(self.starts, int):
            given = [s for s in self.starts if len(s.a) == len(s.b) == structure.order]
            if not given:
                raise InputError("--starts", f"none of the starts is of order {structure.order}")
            made = [first_gamma(data, structure, np.array(s.a), np.array(s.b)) for s in given]
            return [v for v in made if v is not None]
        points = [v for v in [from_arx(data, structure)] if v is not None]
        rng = np.random.default_rng(structure.order)
        span = max(float(run.time_s[-1] - run.time_s[0]) for run in data.runs)
        for _ in range((count or self.starts) - 1):
            rates = np.sort(np.exp(rng.uniform(np.log(0.5 / span), np.log(0.5 / data.T), structure.order)))[::-1]
            shares = 0.8 * rng.dirichlet(np.ones(structure.order + 1))[1:]
            filter = zero_order_hold(shares.tolist(), rates.tolist(), data.T)
            v = first_gamma(data, structure, np.array(filter.a[1:]), np.array(filter.b[1:]))
            if v is not None:
                points.append(v)
        return points


def from_arx(data: Data, structure: Structure) -> Array | None:
    """γ of the elastic response alone, then a and b by ARX; None where that filter runs away."""
    none = np.zeros(structure.order)
    v = first_gamma(data, structure, none, none)
    if v is None:
        return None
    noise = noise_of(data.on_grid()).force_N / data.force_N
    v = structure.joined(v[: structure.nonlinear], arx(data, structure, v, silent(data, structure, noise)))
    return first_gamma(data, structure, *structure.coefficients(v))


def minima(ends: Sequence[Attempt]) -> list[float]:
    """The different V that converged searches ended at, least first."""
    out: list[float] = []
    for attempt in sorted(ends, key=lambda e: e.V):
        if attempt.converged and (not out or attempt.V / out[-1] > 1 + SAME):
            out.append(attempt.V)
    return out


def _about(ends: list[Attempt]) -> list[str]:
    different = minima(ends)
    if len(different) < 2:
        return []
    ratios = ", ".join(f"{V / different[0]:.3g}" for V in different)
    return [f"{len(ends)} starts ended in {len(different)} different minima: V is 1 : {ratios[3:]} of the least."]
