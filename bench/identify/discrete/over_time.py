"""How the numbers of a discrete fit hang on the sample time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from bench.errors import InputError
from bench.recording.types import Measurement

from .._kernel import Array

LAW = ("m", "b", "p", "q")


@dataclass(frozen=True)
class OverSampleTimes:
    """One fit a sample time, n of them; NaN where a fit was refused (why: `refused`).

    `T` (n,) in s; `V` (n,) in N²; `numbers`: by name, (n,): the law's, a_i, b_i; `poles` (n, r) complex, the largest
    first; `rates` (n, r) complex: −ln p / T, the rate ν in 1/s where a pole is a relaxation's; `physical` (n,).
    """

    T: Array
    V: Array
    numbers: dict[str, Array]
    poles: np.ndarray
    rates: np.ndarray
    physical: np.ndarray
    refused: dict[float, str] = field(default_factory=dict)


def over_sample_times(
    measurement: Measurement | Sequence[Measurement],
    method: str,
    law: str,
    order: int,
    Ts: Sequence[float],
    **options: Any,
) -> OverSampleTimes:
    """Fit at each of the sample times `Ts`. `options`: further arguments of `identify.fit`.

    Raises InputError where no T can be fitted.
    """
    from .. import fit

    T = np.asarray(Ts, dtype=float)
    n = len(T)
    V, physical = np.full(n, np.nan), np.zeros(n, dtype=bool)
    poles = np.full((n, order), np.nan, dtype=complex)
    numbers: dict[str, Array] = {}
    refused: dict[float, str] = {}
    for j, time in enumerate(T.tolist()):
        try:
            found = fit(measurement, method=method, law=law, order=order, sample_time=time, **options)
        except InputError as error:
            refused[time] = error.message
            continue
        V[j], physical[j] = found.V, found.physical
        values = {name: p.value for name, p in found.parameters.items() if name in LAW or name.startswith("alpha_")}
        if found.filter is not None:
            own = np.array([complex(*p) for p in found.filter["poles"]])
            poles[j, : len(own)] = own
            for letter in "ab":
                values |= {f"{letter}_{i}": x for i, x in enumerate(found.filter[letter]) if i > 0}
        for name, value in values.items():
            numbers.setdefault(name, np.full(n, np.nan))[j] = value
    if len(refused) == n:
        raise InputError("--sample-time", next(iter(refused.values()), "no sample time given"))
    with np.errstate(divide="ignore", invalid="ignore"):
        rates = -np.log(poles) / T[:, None]
    return OverSampleTimes(T, V, numbers, poles, rates, physical, refused)
