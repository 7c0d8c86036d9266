"""The iterative scheme with an instrumental variable in place of ARX: consistent under output noise.

In turn: A, B and the gain by the refined instrumental variable (see `linear`), γ by (16). Each step
is shortened until V falls; where the instrumental variable finds no such step (far from the truth, or where the pad has
let go and its surface hangs on A and B, which the instruments do not know), a Gauss-Newton step on the output error
takes its place. Both stand still at the same point, a stationary point of (16). After each turn the search goes on in
the direction of the turn while V falls, as turns alone creep where γ and the filter pull on the same thing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from bench.errors import InputError
from bench.recording.types import Measurement
from sim.transfer import zero_order_hold

from .._kernel import Array
from ..noise import noise_of
from ..result import FitResult
from . import outcome, system
from .estimator import Found, output_error_scores, relative_V, silent
from .linear import arx, iv, output_error
from .search import first_gamma, gamma_step
from .series import Data
from .system import Structure

TURNS = 100
NEAR = 1e-4
"""Converged: a full Gauss-Newton step could gain less than this share of one sample's noise power in N V, which
means that every number is within a hundredth of its standard error of the minimum."""
SHARES = (1.0, 0.5, 0.25, 0.1, 0.03)


def fit(
    measurements: Sequence[Measurement],
    law: str = "auto",
    order: int | str = "auto",
    contact: str = "auto",
    degree: int | None = None,
    progress: Callable[[str], None] | None = None,
    sample_time: float | None = None,
) -> FitResult:
    """Fit one pad by turns of instrumental variables and (16). `sample_time` T in s (default: from the data)."""
    return outcome.fit(Instrumental(), measurements, law, order, contact, degree, progress, sample_time)


class Instrumental:
    """The scheme, for `outcome.fit`."""

    name = "iv"

    def estimate(self, data: Data, structure: Structure, quick: bool = False, start: Array | None = None) -> Found:
        """Where the turns stand still."""
        v = start if start is not None else _begin(data, structure)
        V, before = relative_V(data, structure, v), v
        history = [(V, v)]
        converged = False
        for _ in range(TURNS // 4 if quick else TURNS):
            turned = gamma_step(data, structure, refined(data, structure, v), 1e-9)
            if turned is None:
                break
            v = _further(data, structure, before, turned)
            V, last = relative_V(data, structure, v), V
            history.append((V, v))
            before = v
            fell = 1 - V / last if last > 0 else 0.0
            converged = bool(fell <= 1e-6 and to_gain(data, structure, v) <= NEAR * V)
            if converged or fell <= 0:
                break
        notes = [] if converged else [f"The turns did not come to rest ({len(history) - 1} of them)."]
        return Found(V, v, len(history) - 1, converged, history, notes=notes)

    def scores(self, data: Data, structure: Structure, v: Array) -> list[Array]:
        """Those of the output error, whose stationary point it is."""
        return output_error_scores(data, structure, v)


def refined(data: Data, structure: Structure, v: Array) -> Array:
    """v after one linear step, the law's shape held: the longest that makes V fall; v itself where there is none."""
    V = relative_V(data, structure, v)
    for step in (iv, output_error):
        move = step(data, structure, v) - v
        for share in SHARES:
            tried = v + share * move
            if tried[0] > 0 and relative_V(data, structure, tried) < V:
                return tried
    return v


def to_gain(data: Data, structure: Structure, v: Array) -> float:
    """What a full Gauss-Newton step on (16) promises to take off N V, scaled."""
    _, gradient, matrix = system.normal_equations(data, structure, v, "all")
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    b = gradient / scale
    return float(b @ np.linalg.lstsq(matrix / np.outer(scale, scale), b, rcond=1e-13)[0])


def _begin(data: Data, structure: Structure) -> Array:
    """The best, after two steps, of: γ of the elastic response alone with A and B by ARX; and relaxations.

    The instruments need a filter to begin with that is not far off. At a short T noise moves ARX's out of reach, so
    relaxations with rates spread over the run stand beside it.
    """
    r = structure.order
    none = np.zeros(r)
    v = first_gamma(data, structure, none, none)
    if v is None:
        raise InputError("fit", "the elastic response alone cannot be fitted to these data")
    noise = noise_of(data.on_grid()).force_N / data.force_N
    linear = arx(data, structure, v, silent(data, structure, noise))
    filters = [structure.coefficients(structure.joined(v[: structure.nonlinear], linear))]
    span = max(float(run.time_s[-1] - run.time_s[0]) for run in data.runs)
    for fastest in (100.0 / span, 0.2 / data.T):
        edges = np.linspace(np.log(fastest), np.log(min(3.0 / span, 0.1 * fastest)), r + 2)[1:-1]
        filter = zero_order_hold([0.5 / r] * r, np.exp(edges).tolist(), data.T)
        filters.append((np.array(filter.a[1:]), np.array(filter.b[1:])))
    tried = [first_gamma(data, structure, a, b) for a, b in filters]
    ends = [refined(data, structure, refined(data, structure, w)) for w in tried if w is not None]
    return min([v, *ends], key=lambda w: relative_V(data, structure, w))


def _further(data: Data, structure: Structure, old: Array, new: Array) -> Array:
    """On from `new` in the direction from `old`, twice as far each time, while V falls."""
    lower, upper = structure.bounds()
    best, V, reach = new, relative_V(data, structure, new), 1.0
    while reach < 1e4:
        tried = new + reach * (new - old)
        if np.any(tried < lower) or np.any(tried > upper):
            break
        found = relative_V(data, structure, tried)
        if not found < V:
            break
        best, V, reach = tried, found, 2 * reach
    return best
