"""Amounts that cannot be negative."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear, nnls

Array = NDArray[np.float64]


def amounts(columns: Array, wanted: Array) -> tuple[Array, float]:
    """(amounts ≥ 0 (p,) of columns (k, p) with which their sum is nearest to `wanted` (k,), what is left: its norm).

    An active set that comes back to itself, as rounding may make it, ends in an error of `nnls`; a search within bounds
    ends near the same amounts.
    """
    length = float(np.linalg.norm(wanted))
    if length == 0.0:
        return np.zeros(columns.shape[1]), 0.0
    size = np.linalg.norm(columns, axis=0)
    size = np.where(size > 0.0, size, 1.0)
    unit = columns / size, wanted / length
    try:
        found = np.asarray(nnls(*unit)[0])
    except RuntimeError:
        found = np.asarray(lsq_linear(*unit, bounds=(0.0, np.inf), tol=1e-12).x)
    found = found * length / size
    return found, float(np.linalg.norm(columns @ found - wanted))
