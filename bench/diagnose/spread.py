"""Standard errors of a diagnosis's numbers: they hold where the noise is coloured or uneven, and where a shape of the
family leaves something that no shape of it explains."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bench.identify.uncertainty import sandwich

from .data import Data
from .refit import Fit, errors, jacobian

Array = NDArray[np.float64]


def covariance(data: Data, fit: Fit) -> Array:
    """Of x (P, P), 0 at bounds, in units of the noise (`bench.identify.uncertainty.sandwich`). `fit`: at its minimum on
    `data`.
    """
    structure, x = fit.structure, fit.x
    if not len(x):
        return np.zeros((0, 0))
    counted = data.weight > 0
    J = jacobian(data, structure, x)[counted]
    J[~np.isfinite(J)] = 0.0
    e = errors(data, structure, x)[counted]
    prior = np.diag(structure.prior)
    here = replace(fit, matrix=J.T @ J + prior, spread=None)
    if not here.free:
        return np.zeros_like(prior)
    square = max(float(np.mean(e * e)), 1.0)
    return sandwich([e], [J], here.covariance(), square * prior, here.free).covariance
