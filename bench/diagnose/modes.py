"""Which part of a pad's relaxation is the missing one: a refit deals it out as it comes upon it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from sim.relaxation import Relaxation

from .data import Data
from .numbers import Cause, Structure
from .refit import Fit, refit

Array = NDArray[np.float64]

NAMED = "missing_relaxation_mode"
SEEN = 5e-3  # of the force: differences of relaxation that count
DEALT = 0.3  # e-folds that believed shares and rates may be off, where nothing else tells
TIMES = 60
RATES = 6  # from which a spectrum is begun
STEPS = 40  # of the fit from there, at the most: valleys are compared at their ends
APART = 0.1  # e-folds of a number, by which two ways to deal it out are two


def as_believed(short: Data, fit: Fit) -> Fit | None:
    """The fit with its relaxation dealt out anew between pad and missing spectrum, the pad's part as near as can be to
    what was believed: a broad spectrum can take over modes of the pad, and a mode of the pad the spectrum's place.
    None where there is no spectrum, or no room.
    """
    structure = fit.structure
    index = next((k for k, cause in enumerate(structure.causes) if cause.id == NAMED), None)
    own = structure.pad.pad.relaxation
    if index is None or own.order == 0:
        return None
    values, cause, order = structure.values(fit.x), structure.causes[index], own.order
    end, names = len(structure.pad.coordinates), [p.name for p in cause.fitted]
    pad, amend = fit.pad, cause.form.amend
    assert amend is not None
    times = np.geomspace(0.3 * float(np.median(np.diff(short.time_s))), 3.0 * float(np.ptp(short.time_s)), TIMES)
    wanted = _relaxed(amend(pad, values[index]).relaxation, times)
    centre = np.log(np.maximum([*own.shares, *own.rates], 1e-9))

    def dealt(x: Array) -> tuple[Relaxation, dict[str, float]]:
        numbers = np.exp(x[: 2 * order]).tolist()
        return Relaxation(tuple(numbers[:order]), tuple(numbers[order:])), _told(cause, names, x[2 * order : -1])

    def error(x: Array) -> Array:
        relaxation, told = dealt(x)
        if sum(relaxation.shares) + told["share"] >= 1.0:
            return np.full(TIMES + 2 * order + 1, 1e3)
        left = _relaxed(amend(replace(pad, relaxation=relaxation), told).relaxation, times)
        # what relaxes before any sample sees it is a stiffer pad
        off = np.exp(x[-1]) * left - wanted
        return np.concatenate([off / SEEN, (x[: 2 * order] - centre) / DEALT, x[-1:] / DEALT])

    tried = []
    room = max(0.05, 0.9 * (1.0 - sum(own.shares)))
    for rate in (values[index]["rate"], *(1.0 / times[:: TIMES // RATES]).tolist()):
        begun = values[index] | {"rate": rate, "share": min(values[index]["share"], room)}
        start = np.concatenate([centre, np.log([max(begun[name], 1e-6) for name in names]), [0.0]])
        if np.isfinite(start).all() and error(start).max() < 1e3:
            tried.append(least_squares(error, start, max_nfev=60))
    if not tried:
        return None

    def carried(x: Array) -> Fit:
        relaxation, told = dealt(x)
        numbers = replace(structure.pad, pad=replace(pad, relaxation=relaxation))
        values[index] = {**values[index], **told}
        x = np.clip(structure.x(numbers.x(), values, fit.of_run), structure.lower, structure.upper)
        x[: end - 2 * order] = fit.x[: end - 2 * order]
        return refit(short, structure, x, STEPS, 1e-8)

    nearest, *others = (one.x for one in sorted(tried, key=lambda one: float(one.cost)))
    # another valley may be nearly as near: the data tell which
    apart = [x for x in others if np.max(np.abs(x - nearest)) > APART]
    return min((carried(x) for x in (nearest, *apart[:1])), key=lambda f: f.chi2)


def _told(cause: Cause, names: list[str], x: Array) -> dict[str, float]:
    """Numbers of a cause at logarithms, within their bounds."""
    bounds = {p.name: (p.lower, p.upper) for p in cause.fitted}
    values = zip(names, np.exp(x).tolist(), strict=True)
    return {**cause.start, **{name: min(max(v, bounds[name][0]), bounds[name][1]) for name, v in values}}


def _relaxed(relaxation: Relaxation, times_s: Array) -> Array:
    """What is left of the force after these times."""
    out = np.ones(len(times_s))
    for share, rate in zip(relaxation.shares, relaxation.rates, strict=True):
        out += share * np.expm1(-rate * times_s)
    return out


def missing_told(fit: Fit, believed: Structure) -> Array:
    """x of the fit with the same modes dealt out anew: those nearest to the believed rates are the pad's, and what is
    left over is the mode that was missing. The force is the same.
    """
    structure = fit.structure
    for index, cause in enumerate(structure.causes):
        if cause.id != NAMED or cause.form.name != cause.effect.forms[0].name:
            continue
        values = structure.values(fit.x)
        pad = fit.pad
        modes = [*zip(pad.relaxation.shares, pad.relaxation.rates, strict=True), _mode(values[index])]
        best = left_over([float(np.log(rate)) for _, rate in modes], np.log(believed.pad.pad.relaxation.rates))
        if best == len(modes) - 1 or sum(share for share, _ in modes) >= 1.0:
            return fit.x
        share, rate = modes.pop(best)
        modes.sort(key=lambda mode: -mode[1])
        relaxation = Relaxation(tuple(c for c, _ in modes), tuple(nu for _, nu in modes))
        values[index] = {**values[index], "share": share, "rate": rate}
        dealt = replace(structure.pad, pad=replace(pad, relaxation=relaxation))
        return structure.x(dealt.x(), values, fit.of_run)
    return fit.x


def left_over(logs: Sequence[float], believed: Array) -> int:
    """Which of some modes has no place among those believed, by the logarithms of their rates."""
    wanted = np.sort(believed)
    away = [float(np.sum((np.sort(np.delete(np.array(logs), j)) - wanted) ** 2)) for j in range(len(logs))]
    return int(np.argmin(away))


def _mode(values: dict[str, float]) -> tuple[float, float]:
    return values["share"], values["rate"]
