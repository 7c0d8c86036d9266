"""The paper's iterative method.

In turn, until the numbers stand still: γ by (16) with A and B held; then A and B by linear least squares with u =
F^e(δ; γ), as an ARX system. b_0 = 1 of (13) is kept by `b_0="scaled"`: estimated with the others, and put into the
gain (the usual way with Hammerstein models); with `b_0="fixed"` F(k) − u(k) is regressed on F(k−i) and u(k−i), and
the gain stays with γ. The first ends in some ten turns; the second creeps, where gain and filter pull on the same
thing, and need not arrive even without noise. They end at different filters where the ARX step is biased. It
starts from A = B = 1 (a_i = b_i = 0), as the paper does for its fast form, with γ from the ramps on which that
holds; where there are none, from all the data.

The turns are a fixed-point iteration on two different criteria: V need not fall, and where they end is no minimum of V.
With the instrumental variable in place of ARX it is one (see `iv`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from bench.errors import InputError
from bench.recording.types import Measurement

from .._kernel import Array
from ..noise import noise_of
from ..result import FitResult
from . import outcome
from .estimator import Found, arx_scores, relative_V, silent
from .fast import phase_a
from .linear import arx, arx_scaled
from .search import first_gamma, gamma_step
from .series import Data
from .system import Structure, simulate

TURNS = 200
STILL = 1e-7
"""Converged: the simulated force moved by less than this share of its own size in a turn …"""
QUICK = 1e-5
"""… or than this one, where structures are only compared."""


def fit(
    measurements: Sequence[Measurement],
    law: str = "auto",
    order: int | str = "auto",
    contact: str = "auto",
    degree: int | None = None,
    progress: Callable[[str], None] | None = None,
    sample_time: float | None = None,
    b_0: str = "scaled",
) -> FitResult:
    """Fit one pad by turns of (16) and ARX. `sample_time` T in s (default: from the data); `b_0`: scaled or fixed."""
    if b_0 not in ("scaled", "fixed"):
        raise InputError("fit", f"b_0 cannot be `{b_0}`", "One of: scaled, fixed.")
    return outcome.fit(Iterative(b_0), measurements, law, order, contact, degree, progress, sample_time)


class Iterative:
    """The scheme, for `outcome.fit`."""

    name = "iterative"

    def __init__(self, b_0: str = "scaled") -> None:
        self.b_0 = b_0

    def estimate(self, data: Data, structure: Structure, quick: bool = False, start: Array | None = None) -> Found:
        """The fixed point of the turns; where the filter of a turn runs away, the best turn before it."""
        v = start if start is not None else _begin(data, structure)
        left = None
        if start is None:
            noise = noise_of(data.on_grid()).force_N / data.force_N
            left = silent(data, structure, noise)
        before, history, converged = _force(data, structure, v), [], False
        for _ in range(TURNS):
            if self.b_0 == "scaled":
                filtered = arx_scaled(data, structure, v, left)
            else:
                filtered = structure.joined(v[: structure.nonlinear], arx(data, structure, v, left))
            next_v = gamma_step(data, structure, filtered, 1e-9)
            if next_v is None:
                break
            v, left = next_v, None
            history.append((relative_V(data, structure, v), v))
            now = _force(data, structure, v)
            moved = float(np.linalg.norm(now - before)) / max(float(np.linalg.norm(now)), 1e-300)
            before = now
            if moved < (QUICK if quick else STILL):
                converged = True
                break
        if not history:
            raise InputError("fit", f"the ARX filter of order {structure.order} grows without end within these data",
                             "Try another order, or a longer --sample-time.")  # fmt: skip
        notes = []
        if not converged:
            V, v = min(history, key=lambda item: item[0])
            notes.append(f"The turns did not converge in {len(history)}; this is the one with the least V.")
        return Found(relative_V(data, structure, v), v, len(history), converged, history, notes=notes)

    def scores(self, data: Data, structure: Structure, v: Array) -> list[Array]:
        """Those of the two steps."""
        return arx_scores(data, structure, v, scaled=self.b_0 == "scaled")


def _begin(data: Data, structure: Structure) -> Array:
    none = np.zeros(structure.order)
    gamma = phase_a(data, structure)
    if gamma is not None:
        return structure.vector(float(gamma[0]), gamma[1:], none, none)
    v = first_gamma(data, structure, none, none)
    if v is None:
        raise InputError("fit", "the elastic response alone cannot be fitted to these data")
    return v


def _force(data: Data, structure: Structure, v: Array) -> Array:
    return np.concatenate([simulate(run, structure, v).force for run in data.runs])
