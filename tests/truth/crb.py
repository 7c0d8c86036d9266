"""The Cramér–Rao bound of the pad's numbers.

With J = ∂F/∂θ at the force samples (true times, true motion) and independent Gaussian force noise,

    cov θ̂ ≥ (Jᵀ Σ⁻¹ J)⁻¹,    Σ = σ² I where the noise is white.

Coloured and Student-t noise have their own information (`noise.whiten`). Noise of the position and of the stamps
is not counted: with it no estimator does better than this, and the attainable bound is higher.
"""

from __future__ import annotations

import numpy as np

from .dataset import Truth
from .motion import Motion
from .pad import Pad, simulate


def sensitivities(pad: Pad, motion: Motion, time_s: np.ndarray, relative_step: float = 3e-5) -> dict[str, np.ndarray]:
    """∂F/∂θ at the times given, by central differences; c_0 = 1 − Σ c_i follows the shares."""
    derivatives = {}
    for name, value in pad.parameters().items():
        h = relative_step * (abs(value) or 1.0)
        above, below = (simulate(pad.with_parameters({name: value + s * h}), motion, time_s).force_N for s in (1, -1))
        derivatives[name] = (above - below) / (2 * h)
    return derivatives


def information(truth: Truth) -> tuple[list[str], np.ndarray]:
    """Names, and the Fisher information matrix in their order."""
    if truth.noise.force is None:
        raise ValueError("without force noise there is no bound")
    columns = sensitivities(truth.pad, truth.motion, truth.force_true_time_s)
    J = truth.noise.force.whiten(truth.force_true_time_s, np.stack(list(columns.values()), axis=1))
    return list(columns), J.T @ J


def bound(truth: Truth) -> dict[str, float]:
    """Smallest standard deviation of each number that an unbiased estimator can have, by parameter name."""
    names, fisher = information(truth)
    scale = np.sqrt(np.diag(fisher))
    covariance = np.linalg.inv(fisher / np.outer(scale, scale)) / np.outer(scale, scale)
    return dict(zip(names, np.sqrt(np.diag(covariance)).tolist(), strict=True))
