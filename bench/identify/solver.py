"""Levenberg-Marquardt within bounds, on the normal equations."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ._kernel import Array


@dataclass(frozen=True)
class Solution:
    """Where the search ended: x (P,), Σ w e² there, the Gauss-Newton matrix (P, P), steps, whether it had converged."""

    x: Array
    cost: float
    matrix: Array
    steps: int
    converged: bool


def minimise(
    normal: Callable[[Array], tuple[float, Array, Array]],
    cost: Callable[[Array], float],
    x0: Array,
    lower: Array,
    upper: Array,
    max_steps: int = 80,
    tolerance: float = 1e-12,
) -> Solution:
    """Minimise Σ e² from x0; `normal` gives (Σ e², Jᵀe, JᵀJ) with J = ∂model/∂x, e = data − model.

    Converged: the step promised and made less than `tolerance` of the cost, or there is nothing left to gain. A
    variable at a bound that the gradient presses against is held there. Marquardt's scaling: the result does not
    hang on the units of x. Where sums of sensitivities overflow the search ends, not converged.
    """
    x = np.clip(x0, lower, upper)
    damping, grow = 1e-3, 2.0
    value, g, H = normal(x)
    floor = 1e-30 * max(value, 1.0)
    idle = step = 0
    for step in range(1, max_steps + 1):
        if not (np.isfinite(H).all() and np.isfinite(g).all()):  # a model that all but runs away: no step from here
            return Solution(x, value, np.zeros_like(H), step, False)
        free = ~(((x <= lower) & (g < 0)) | ((x >= upper) & (g > 0)))
        scale = np.sqrt(np.maximum(np.diag(H), 1e-14 * np.max(np.diag(H)) + 1e-300))
        # What an undamped step could still gain, whatever the damping has grown to.
        if not free.any() or _promise(H, g, scale, free) <= max(tolerance * value, floor):
            return Solution(x, value, H, step, True)
        for _ in range(15):
            move = _step(H, g, scale, free, damping)
            tried = np.clip(x + move, lower, upper)
            actual_move = tried - x
            promised = float(2 * g @ actual_move - actual_move @ H @ actual_move)
            gained = value - cost(tried)
            if gained > 0 and np.isfinite(gained):
                break
            damping, grow = damping * grow, grow * 2
        else:  # no step gains: at the minimum to rounding, or stuck
            left = _step(H, g, scale, free, 1e-12)
            still = bool(np.all(np.abs(left) <= 1e-8 * (np.abs(x) + 1e-2)))
            return Solution(x, value, H, step, still or _promise(H, g, scale, free) <= 1e-6 * value)
        # Where samples go in and out of contact the promise is never quite kept: then what is gained decides.
        idle = idle + 1 if gained <= max(tolerance, 1e-10) * value else 0
        if idle >= 3:
            return Solution(tried, *normal(tried)[::2], step, True)
        x = tried
        ratio = gained / promised if promised > 0 else 1.0
        damping = max(damping * max(1 / 5, 1 - (2 * ratio - 1) ** 3), 1e-15)
        grow = 2.0
        value, g, H = normal(x)
    return Solution(x, value, H, step, False)


def _step(H: Array, g: Array, scale: Array, free: np.ndarray, damping: float) -> Array:
    move = np.zeros(len(g))
    S = scale[free]
    A = H[np.ix_(free, free)] / np.outer(S, S)
    A[np.diag_indices_from(A)] += damping + 1e-14
    move[free] = np.linalg.solve(A, g[free] / S) / S
    return move


def _promise(H: Array, g: Array, scale: Array, free: np.ndarray) -> float:
    S = scale[free]
    b = g[free] / S
    A = H[np.ix_(free, free)] / np.outer(S, S)
    A[np.diag_indices_from(A)] += 1e-12
    return float(b @ np.linalg.solve(A, b))
