"""A fit as the report shows it: the curves F^e(δ) and g(t) with their doubt, and a discrete fit at other times T."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bench.report import Curve, Evidence, FitView, OverTimes

if TYPE_CHECKING:
    from collections.abc import Sequence

    from bench.identify import FitResult
    from bench.recording.types import Measurement

Array = NDArray[np.float64]

POINTS = 200
TIMES = (0.5, 1.0, 2.0, 4.0, 8.0)
"""Sample times at which a discrete fit is shown, over its own."""


def fit_view(fit: FitResult, over: OverTimes | None = None) -> FitView:
    """The first measurement of a fit, its curves and the structures tried; `over`: the fit at other sample times."""
    trace = fit.traces[0]
    counted = trace.time_s[trace.counted]
    return FitView(
        json=fit.to_json(),
        time_s=trace.time_s,
        position_mm=trace.position_mm,
        measured_N=trace.force_N,
        simulated_N=trace.simulated_N,
        fit_from_s=float(counted[0]),
        fit_to_s=float(counted[-1]),
        elastic=elastic_curve(fit, float(max(t.position_mm.max() for t in fit.traces))),
        # a filter that is no relaxation leaves the model without one: a line at 1 would say that nothing relaxes
        relaxation=relaxation_curve(fit, float(counted[-1] - counted[0])) if fit.physical or not fit.filter else None,
        evidence=[
            Evidence(
                law=row.label,
                order=row.order,
                rmse_N=float(np.sqrt(row.V)),
                held_out_rmse_N=row.held_out_rmse,
                criterion=row.criterion,
                contact=row.contact,
                chosen=row.chosen,
                remark="" if row.eligible else "not physical, or not converged",
            )
            for row in fit.evidence
        ],
        notes=fit.notes,
        history=fit.history,
        over_times=over,
        c_0_std=rest.std if (rest := fit.c_0) is not None else float("nan"),
    )


def over_times(fit: FitResult, measurements: Sequence[Measurement], **options: object) -> OverTimes | None:
    """A discrete fit again at shorter and longer sample times, law and order kept; None for the other methods.

    `options`: as given to the fit (`starts`, `ramps`).
    """
    from bench.identify.discrete import over_sample_times
    from bench.identify.discrete.over_time import LAW

    if fit.filter is None:
        return None
    T = float(fit.filter["sample_time_s"])
    found = over_sample_times(measurements, fit.method, fit.law, fit.order, [share * T for share in TIMES],
                              contact=fit.contact, degree=fit.degree, **options)  # fmt: skip
    rates = -np.sort(-np.where(found.physical[:, None], found.rates.real, np.nan), axis=1)
    numbers = {name: y for name, y in found.numbers.items() if name in LAW or name.startswith("alpha_")}
    return OverTimes(found.T, numbers, rates, found.physical, T, found.refused)


def elastic_curve(fit: FitResult, deepest_mm: float) -> Curve | None:
    """F^e over the depths that were measured."""
    if deepest_mm <= 0:
        return None
    law = fit.model.pad.law
    depth = np.linspace(0.0, deepest_mm, POINTS)
    return Curve(depth, law.force(depth), _deviation(fit, list(law.parameters), law.force_gradient(depth)))


def relaxation_curve(fit: FitResult, longest_s: float) -> Curve:
    """g(t) over the times that were measured, denser at the start."""
    relaxation = fit.model.pad.relaxation
    shares, rates = np.array(relaxation.shares), np.array(relaxation.rates)
    t = np.concatenate([[0.0], np.geomspace(1e-3 * longest_s, longest_s, POINTS - 1)])
    decay = np.exp(-np.outer(t, rates))
    g = 1.0 - shares.sum() + decay @ shares
    names = [f"c_{i + 1}" for i in range(shares.size)] + [f"nu_{i + 1}" for i in range(rates.size)]
    return Curve(t, g, _deviation(fit, names, np.hstack([decay - 1.0, -shares * t[:, None] * decay])))


def _deviation(fit: FitResult, names: list[str], gradient: Array) -> Array | None:
    """Standard deviation of a curve whose gradient (n, k) is taken by the parameters `names`."""
    known = list(fit.parameters)
    if fit.covariance is None or any(name not in known for name in names):
        return None
    rows = [known.index(name) for name in names]
    covariance = fit.covariance[np.ix_(rows, rows)]
    variance: Array = np.einsum("ni,ij,nj->n", gradient, covariance, gradient)
    return np.sqrt(np.maximum(variance, 0.0)) if np.isfinite(variance).all() else None
