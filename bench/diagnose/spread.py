"""Standard errors of a diagnosis's numbers: they hold where the noise is coloured or uneven, where a shape of the
family leaves something that no shape of it explains, and where several shapes serve as well."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from bench.identify.uncertainty import sandwich
from sim.effects import Form

from .candidates import CHANNEL, Reach, combinations, narrowed
from .data import Data
from .numbers import Structure, cause_of
from .refit import Fit, errors, force_at, jacobian, refit

Array = NDArray[np.float64]

STEPS, STARTS = 8, 6  # of the fit of another shape
WORKERS = 2
NUMBER = 2.0  # χ² that a further number must take to count as much (H. Akaike, IEEE Trans. Autom. Control 19, 1974)


def covariance(data: Data, fit: Fit) -> Array:
    """Of x (P, P), 0 at bounds, in units of the noise. `fit`: at its minimum on `data`."""
    if not len(fit.x):
        return np.zeros((0, 0))
    own = of_the_noise(data, fit)
    return own + np.diag(_of_the_shapes(data, fit, np.diag(own).copy()))


def of_the_noise(data: Data, fit: Fit) -> Array:
    """Covariance of x (P, P) with the shapes of the causes as they are (`bench.identify.uncertainty.sandwich`)."""
    structure, x = fit.structure, fit.x
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


@dataclass(frozen=True)
class _Member:
    """A shape of a family, fitted: χ², how many numbers moved, values and variances of its numbers by name."""

    chi2: float
    free: int
    values: dict[str, float]
    variances: dict[str, float]
    """In the fit's coordinates, for white noise."""


def _of_the_shapes(data: Data, fit: Fit, own: Array) -> Array:
    """What the choice among shapes that the data cannot tell apart adds to the variances of x (P,).

    Each shape of a cause's family is fitted in place of the one that leads, and weighs as its χ² tells it (K. P.
    Burnham, D. R. Anderson, Model Selection and Multimodel Inference, 2nd ed., Springer, 2002, section 4.3). What the
    best of them leaves beyond the noise counts as noise: no shape is exact.
    """
    out = np.zeros(len(fit.x))
    short = data if data.short is None else data.short
    kept = [i for i, c in enumerate(fit.structure.causes) if c.id not in CHANNEL]
    structure = replace(fit.structure, causes=tuple(fit.structure.causes[i] for i in kept))
    every = fit.structure.values(fit.x)
    pad = fit.x[: len(structure.pad.coordinates)]
    x = structure.x(pad, [every[i] for i in kept], fit.of_run)
    lead = refit(short, structure, x, STEPS, 1e-6)
    tried = [
        (index, form)
        for index, cause in enumerate(structure.causes)
        for form in cause.effect.forms
        if form.name != cause.form.name and _comparable(cause.form, form)
    ]
    with ThreadPoolExecutor(WORKERS) as pool:
        found = list(pool.map(lambda pair: _other(short, lead, *pair), tried))
    entries = float(np.count_nonzero(short.weight > 0)) - lead.free
    for index, cause in enumerate(structure.causes):
        leading = _member(lead, index)
        members = [leading, *(m for (i, _), m in zip(tried, found, strict=True) if i == index and m is not None)]
        scale = max(min(m.chi2 for m in members) / max(entries, 1.0), 1.0)
        weight = _weights(members, scale)
        at = fit.structure.of_cause(kept[index])
        for position, p in zip(range(at.start, at.stop), cause.fitted, strict=True):
            c = fit.structure.coordinates[position]
            if not p.required:
                continue
            if own[position] == 0.0 and c.logarithmic and c.lower < fit.x[position] < c.upper:
                out[position] = 1.0  # nothing in the data moves with it
                continue
            wider = max(own[position] / max(leading.variances[p.name], 1e-300), 1.0) if own[position] > 0 else scale
            here = every[kept[index]][p.name]
            for w, m in zip(weight[1:], members[1:], strict=True):
                away = (
                    np.log(max(m.values[p.name], 1e-300) / here)
                    if c.logarithmic
                    else (m.values[p.name] - here) / c.unit
                )
                out[position] += w * float(away**2 + max(wider * m.variances[p.name] - own[position], 0.0))
    return out


def _weights(members: Sequence[_Member], scale: float) -> Array:
    """How much each shape counts; `scale`: χ² of a sample that the best of them leaves."""
    score = np.array([m.chi2 / scale + NUMBER * m.free for m in members])
    weight = np.exp(-0.5 * (score - score.min()))
    return np.asarray(weight / weight.sum())


def _comparable(one: Form, other: Form) -> bool:
    """Whether two forms have the same numbers beside those of their shapes."""
    return [p.name for p in one.parameters if p.required] == [p.name for p in other.parameters if p.required]


def _member(fit: Fit, index: int) -> _Member:
    at = fit.structure.of_cause(index)
    spread = np.diag(fit.covariance())[at]
    names = [p.name for p in fit.structure.causes[index].fitted]
    values = fit.structure.values(fit.x)[index]
    return _Member(fit.chi2, fit.free, values, dict(zip(names, spread.tolist(), strict=True)))


def _other(short: Data, lead: Fit, index: int, form: Form) -> _Member | None:
    """Another shape in place of a cause of a fit, carried to its minimum; None where it makes no plant."""
    structure, values = lead.structure, lead.structure.values(lead.x)
    cause = structure.causes[index]
    shape = narrowed(form, _reach(short, structure))
    told = {p.name: values[index][p.name] for p in shape.parameters if p.name in values[index]}
    own_shape = replace(shape, parameters=tuple(p for p in shape.parameters if not p.required))
    pad = lead.x[: len(structure.pad.coordinates)]
    best: tuple[float, Structure, Array] | None = None
    for started in [{}, *islice(combinations(own_shape), STARTS)]:
        own = cause_of(cause.effect, shape, told | started)
        causes = (*structure.causes[:index], own, *structure.causes[index + 1 :])
        joined = replace(structure, causes=causes)
        x = joined.x(pad, [*values[:index], own.start, *values[index + 1 :]], lead.of_run)
        force = force_at(short, joined, x)
        if not np.isfinite(force).all():
            continue
        e = short.whitened(short.force_N - force)
        square = float(np.sum(e * e))
        if best is None or square < best[0]:
            best = square, joined, x
    if best is None:
        return None
    return _member(refit(short, best[1], best[2], STEPS, 1e-6), index)


def _reach(short: Data, structure: Structure) -> Reach:
    stamps = short.time_s[short.weight > 0]
    return Reach(
        sample_s=float(np.min(np.diff(stamps), initial=1.0)),
        span_s=float(short.time_s[-1] - short.time_s[0]),
        travel_mm=float(np.ptp(short.position_mm)),
        depth_mm=structure.pad.depth_mm,
        force_N=structure.pad.force_N,
    )
