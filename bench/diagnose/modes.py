"""Which of a pad's relaxation modes is the missing one: a refit deals the modes out as it comes upon them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sim.relaxation import Relaxation

from .numbers import Structure
from .refit import Fit

Array = NDArray[np.float64]


def missing_told(fit: Fit, believed: Structure) -> Array:
    """x of the fit with the same modes dealt out anew: those nearest to the believed rates are the pad's, and what is
    left over is the mode that was missing. The force is the same.
    """
    structure = fit.structure
    for index, cause in enumerate(structure.causes):
        if cause.id != "missing_relaxation_mode" or cause.form.name != cause.effect.forms[0].name:
            continue
        wanted = np.sort(np.log(believed.pad.pad.relaxation.rates))
        values = structure.values(fit.x)
        pad = structure.pad.at(fit.x[: len(structure.pad.coordinates)])
        modes = [*zip(pad.relaxation.shares, pad.relaxation.rates, strict=True), _mode(values[index])]
        rates = np.log([rate for _, rate in modes])
        away = [float(np.sum((np.sort(np.delete(rates, j)) - wanted) ** 2)) for j in range(len(modes))]
        best = int(np.argmin(away))
        if best == len(modes) - 1 or sum(share for share, _ in modes) >= 1.0:
            return fit.x
        share, rate = modes.pop(best)
        modes.sort(key=lambda mode: -mode[1])
        relaxation = Relaxation(tuple(c for c, _ in modes), tuple(nu for _, nu in modes))
        values[index] = {**values[index], "share": share, "rate": rate}
        dealt = replace(structure.pad, pad=replace(pad, relaxation=relaxation))
        return structure.x(dealt.x(), values, fit.of_run)
    return fit.x


def _mode(values: dict[str, float]) -> tuple[float, float]:
    return values["share"], values["rate"]
