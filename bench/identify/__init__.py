"""From measured force and position to a pad model: one file a method, one result type."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from bench.errors import InputError

from .result import Evidence, FitResult, Parameter, Trace

if TYPE_CHECKING:
    from bench.recording.types import Measurement

__all__ = ["METHODS", "Evidence", "FitResult", "Parameter", "Trace", "fit"]

METHODS: dict[str, str] = {
    "continuous": "continuous",
    "noniterative": "discrete.noniterative",
    "iterative": "discrete.iterative",
    "fast": "discrete.fast",
    "iv": "discrete.iv",
    "recursive": "recursive",
}
"""Method name -> module of this package with a function `fit(measurements, law, order, contact, degree, progress)`;
the discrete ones take `sample_time` too."""


def fit(
    measurements: Measurement | Sequence[Measurement],
    method: str = "continuous",
    law: str = "auto",
    order: int | str = "auto",
    contact: str = "auto",
    degree: int | None = None,
    progress: Callable[[str], None] | None = None,
    sample_time: float | None = None,
    **options: Any,
) -> FitResult:
    """Fit one pad model to one or more measurements.

    `law`: exponential (9), power (10), polynomial (14, of `degree`), spline (points; `continuous` alone) or auto;
    `order`: number of relaxation modes r or auto; `contact`: bonded, unilateral or auto. `progress` is called with a
    few words as the work goes on.
    `sample_time`: T in s of a discrete method; None: from the data. `options`: further arguments of the method's own
    `fit` (`starts` of noniterative, `ramps` and `step` of fast). Several measurements are runs of one pad, each from
    rest (`continuous`: unless it begins loaded). Raises `bench.errors.InputError` for a name that is not
    known and for data that cannot be fitted at all (too few samples, no contact, no force, times out of order).
    """
    from importlib import import_module

    if method not in METHODS:
        raise InputError("--method", f"there is no method `{method}`", f"One of: {', '.join(METHODS)}.")
    runs = list(measurements) if isinstance(measurements, Sequence) else [measurements]
    if sample_time is not None:
        if not METHODS[method].startswith("discrete."):
            discrete = ", ".join(name for name, module in METHODS.items() if module.startswith("discrete."))
            said = f"the {method} method takes the data at their own times"
            raise InputError("--sample-time", said, f"It is for --method {discrete}.")
        options["sample_time"] = sample_time
    module = import_module(f".{METHODS[method]}", __package__)
    _check(module.fit, method, options)
    runs, twice = _each_once(runs)
    result: FitResult = module.fit(
        runs, law=law, order=order, contact=contact, degree=degree, progress=progress, **options
    )
    result.notes += twice
    return result


def _each_once(runs: list[Measurement]) -> tuple[list[Measurement], list[str]]:
    """Measurements without those that hold the samples of another one, and a note on each that was left out."""
    import numpy as np

    kept: list[Measurement] = []
    notes = []
    for m in runs:
        same = (k for k in kept if np.array_equal(k.force_time_s, m.force_time_s))
        first = next((k for k in same if np.array_equal(k.force_N, m.force_N)), None)
        if first is None:
            kept.append(m)
        else:
            notes.append(f"{m.name} holds the samples of {first.name} once more, and was left out.")
    return kept, notes


def _check(function: Callable[..., FitResult], method: str, options: dict[str, Any]) -> None:
    from inspect import signature

    for name in options:
        if name not in signature(function).parameters:
            raise InputError("--" + name.replace("_", "-"), f"the {method} method has no such argument")
