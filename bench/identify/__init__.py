"""From measured force and position to a pad model: one file a method, one result type."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from bench.errors import InputError

from .result import Evidence, FitResult, Parameter, Trace

if TYPE_CHECKING:
    from bench.recording.types import Measurement

__all__ = ["METHODS", "Evidence", "FitResult", "Parameter", "Trace", "fit"]

METHODS: dict[str, str] = {"continuous": "continuous"}
"""Method name -> module of this package with a function `fit(measurements, law, order, contact, degree, progress)`."""


def fit(
    measurements: Measurement | Sequence[Measurement],
    method: str = "continuous",
    law: str = "auto",
    order: int | str = "auto",
    contact: str = "auto",
    degree: int | None = None,
    progress: Callable[[str], None] | None = None,
) -> FitResult:
    """Fit one pad model to one or more measurements.

    `law`: exponential (9), power (10), polynomial (14, of `degree`) or auto; `order`: number of relaxation modes r or
    auto; `contact`: bonded, unilateral or auto. `progress` is called with a few words as the work goes on.
    Several measurements are runs of one pad, each from rest. Raises `bench.errors.InputError` for a name that is not
    known and for data that cannot be fitted at all (too few samples, no contact, no force, times out of order).
    """
    from importlib import import_module

    if method not in METHODS:
        raise InputError("--method", f"there is no method `{method}`", f"One of: {', '.join(METHODS)}.")
    runs = list(measurements) if isinstance(measurements, Sequence) else [measurements]
    module = import_module(f".{METHODS[method]}", __package__)
    result: FitResult = module.fit(runs, law=law, order=order, contact=contact, degree=degree, progress=progress)
    return result
