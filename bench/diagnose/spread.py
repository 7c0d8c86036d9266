"""Standard errors of a diagnosis's numbers: they hold where the noise is coloured or uneven, and where a shape of the
family leaves something that no shape of it explains."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bench.identify.colour import corrected_colour, spread_through
from bench.identify.uncertainty import contributions, student, windowed

from .data import Data
from .refit import Fit, errors, jacobian

Array = NDArray[np.float64]

DOUBT = 2.0  # standard deviations of its own by which the scores must say more than the colour


def covariance(data: Data, fit: Fit) -> Array:
    """Of x (P, P), 0 at bounds: sandwich H⁻¹ S H⁻¹, S by the residual's autocovariance, or by the scores summed
    over windows of its memory where these say more (H. White, Econometrica 48, 1980; W. Newey, K. West,
    Econometrica 55, 1987). `fit`: at its minimum on `data`.
    """
    structure, x = fit.structure, fit.x
    if not len(x):
        return np.zeros((0, 0))
    counted = data.weight > 0
    J = jacobian(data, structure, x)[counted]
    J[~np.isfinite(J)] = 0.0
    e = errors(data, structure, x)[counted]
    prior = np.diag(structure.prior)
    H = J.T @ J + prior
    inside = (x > structure.lower) & (x < structure.upper) & (np.diag(H) > 1e-9)
    if not inside.any():
        return np.zeros_like(H)
    scale = np.sqrt(np.maximum(np.diag(H), 1e-300))[inside]
    index = np.ix_(inside, inside)
    values, vectors = np.linalg.eigh(H[index] / np.outer(scale, scale))
    inverse = np.zeros_like(H)
    inverse[index] = (vectors / np.maximum(values, 1e-12 * values.max())) @ vectors.T / np.outer(scale, scale)
    colour = corrected_colour([e], [J], inverse)
    square = max(float(np.mean(e * e)), 1.0)
    steady = inverse @ (spread_through([J], colour.gamma) + square * prior) @ inverse
    window = int(min(np.ceil(2 * colour.memory), len(e)))
    scores = J * e[:, None]
    felt = inverse @ (windowed([scores], window) + square * prior) @ inverse
    independent = len(e) / colour.memory
    freedom = max(independent - float(inside.sum()), 1.0)
    even, uneven = np.diag(steady), np.diag(felt) * independent / freedom
    doubt = np.sqrt(2 / contributions([scores], inverse, window))
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.where(even > 0, uneven / even, 1.0)
    ratio = np.where(ratio > 1 + DOUBT * doubt, ratio, 1.0)
    widened = np.sqrt(ratio) * student(freedom)
    return np.asarray(steady * np.outer(widened, widened))
