"""Standard errors of a diagnosis's numbers: they hold where the noise is coloured or uneven, where a shape of the
family leaves something that no shape of it explains, and where several shapes serve as well."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bench.identify.uncertainty import sandwich

from .data import Data
from .gauge import gauged, in_the_mean
from .numbers import Coordinate
from .refit import Fit, chi2, errors, jacobian, reduced, refit
from .shapes import FAR, Member, families, scores, stand_in, weights

Array = NDArray[np.float64]

UNKNOWN = 1.0  # variance of a logarithm with which nothing in the data moves
STEPS_WITHOUT, NEARLY = 8, 1e-5  # of the fit without a cause, and of χ², that a step of it must promise
STEPS = np.geomspace(1e-4, 1.0, 25)  # of a number about which χ² is flat
WIDEST = 1e6  # times the variance that the stand-in tells


def covariance(data: Data, short: Data, fit: Fit) -> Array:
    """Of x (P, P), 0 at bounds, in units of the noise. `fit`: at its minimum on `data`; `short`: the stand-in for them,
    free of hum."""
    if not len(fit.x):
        return np.zeros((0, 0))
    own = in_the_mean(data, fit, of_the_noise(data, fit))
    for position in _flat(fit, np.diag(own)):
        own[position, position] = _by_steps(data, fit, position)
    return own + np.diag(_of_the_shapes(short, fit, np.diag(own).copy()))


def _flat(fit: Fit, own: Array) -> list[int]:
    """Places in x of the contract's numbers within their bounds that no small step changes the force by."""
    asked = {
        position
        for index, cause in enumerate(fit.structure.causes)
        for position, p in zip(range(*fit.structure.of_cause(index).indices(len(fit.x))), cause.fitted, strict=True)
        if p.required and own[position] <= 0.0  # below: of a matrix that has no inverse
    }
    coordinates = fit.structure.coordinates
    return [k for k in sorted(asked) if coordinates[k].lower < fit.x[k] < coordinates[k].upper]


def _by_steps(data: Data, fit: Fit, position: int) -> float:
    """Variance of a number about which χ² only jumps, as that of the depth at which a bond snaps between two samples:
    the square of the step by which χ² rises by 1 on either side; 0 where none does."""
    least, coordinate = chi2(data, fit.structure, fit.x), fit.structure.coordinates[position]
    for step in STEPS:
        beside = []
        for way in (-step, step):
            x = fit.x.copy()
            x[position] = np.clip(x[position] + way, coordinate.lower, coordinate.upper)
            beside.append(chi2(data, fit.structure, x))
        if min(beside) > least + 1.0:
            return float(step**2)
    return 0.0


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


def _of_the_shapes(short: Data, fit: Fit, own: Array) -> Array:
    """What the choice among shapes that the data cannot tell apart adds to the variances of x (P,).

    Each shape of a cause's family weighs as its χ² tells it (K. P. Burnham, D. R. Anderson, Model Selection and
    Multimodel Inference, 2nd ed., Springer, 2002, section 4.3, with Schwarz's weights). By these the first shape counts
    alone as soon as there is little noise. But no shape of a family is the true one: the nearest may be off by a share
    of what the cause does, and a difference of that order in χ² tells nothing (such discrepancy between a model and the
    world: M. C. Kennedy, A. O'Hagan, Bayesian calibration of computer models, J. R. Stat. Soc. B 63, 2001, 425–464). By
    weights of that kind the variance is at least so much. A shape whose numbers the data cannot tell says no more about
    another's than that one itself does.
    """
    out = np.zeros(len(fit.x))
    lead, kept = stand_in(short, fit)
    every = fit.structure.values(fit.x)
    causes = lead.structure.causes
    indices = [k for k in range(len(kept)) if not causes[k].of_the_law]  # a law's numbers are each form's own
    for index, family in zip(indices, families(short, lead, indices), strict=True):
        members = [family[0], *(_stated(short, m) for m in family[1:])]
        place, bare = kept[index], refit(short, *reduced(lead, index), STEPS_WITHOUT, NEARLY)
        plain, rough = weights(scores(short, [*members, Member(bare, -1)]))
        at = fit.structure.of_cause(place)
        for position, p in zip(range(at.start, at.stop), fit.structure.causes[place].fitted, strict=True):
            c = fit.structure.coordinates[position]
            if not p.required:
                continue
            if own[position] == 0.0 and c.logarithmic and c.lower < fit.x[position] < c.upper:
                out[position] = UNKNOWN
                continue
            told = members[0].variances[p.name]  # 0: the stand-in says nothing of it
            wider = min(max(float(own[position]) / told, 1.0), WIDEST) if told > 0.0 else 1.0
            away = [_away(m, p.name, every[place][p.name], c, wider, float(own[position])) for m in members[1:]]
            as_told = sum(w * (a.step**2 + a.more) for w, a in zip(plain[1:], away, strict=True))
            inexact = sum(w * (min(a.step, a.far) ** 2 + a.more) for w, a in zip(rough[1:], away, strict=True))
            out[position] = max(as_told, inexact)
    return out


def _stated(short: Data, member: Member) -> Member:
    """A shape with its numbers as they are stated, and their matrix."""
    stated = gauged(short, member.fit)
    if stated.structure is member.fit.structure:
        return member
    there = refit(short, stated.structure, stated.x, 1, NEARLY)
    return replace(member, fit=replace(there, spread=in_the_mean(short, there, there.covariance())))


@dataclass(frozen=True)
class _Away:
    """A number in another shape, in the coordinate: how far off it is, by how much its variance there is more, and how
    far it counts as being off at the most where that shape fits worse."""

    step: float
    more: float
    far: float


def _away(member: Member, name: str, here: float, c: Coordinate, wider: float, own: float) -> _Away:
    far = FAR if c.logarithmic else FAR * abs(here) / c.unit
    if name not in member.variances:  # a choice of that form, which knows no such number
        return _Away(0.0, own, far)
    there = member.values[name]
    step = np.log(max(there, 1e-300) / here) if c.logarithmic else (there - here) / c.unit
    return _Away(abs(float(step)), min(max(wider * member.variances[name] - own, 0.0), own), far)
