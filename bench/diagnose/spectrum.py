"""Where a missing relaxation mode stands: from a spectrum of modes at fixed rates, of which the force is a sum.

At given rates the force is linear in the shares, and shares that cannot be negative come out few (C. L. Lawson, R. J.
Hanson, Solving Least Squares Problems, Prentice-Hall, 1974, chapter 23; for relaxation: M. Baumgaertel, H. H. Winter,
Determination of discrete relaxation and retardation time spectra from dynamic mechanical data, Rheol. Acta 28, 1989,
511–519). From where a refit has dealt out too few modes, steps along one more of them often lead astray.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from sim.relaxation import Relaxation

from .modes import NAMED, left_over
from .numbers import Cause
from .refit import force_at
from .starts import Signatures

Array = NDArray[np.float64]

RATES = 24
UNIT = 0.05  # share by which the force of a mode is made
PRESSED = 0.02  # of the greatest force: where the pad bears for sure
LEAST = 1e-4  # of the force: a lesser mode is none
MOST = 0.97  # of the force that relaxes


def one_more_mode(at: Signatures, believed_rates: Sequence[float], cause: Cause) -> tuple[Cause, Array] | None:
    """The missing mode to start from, and the pad's vector beside it; None where the spectrum has no mode too many."""
    data, fit, structure, order = at.data, at.fit, at.fit.structure, len(believed_rates)
    if cause.id != NAMED or cause.form.name != cause.effect.forms[0].name or order == 0:
        return None
    end = len(structure.pad.coordinates)
    pad = fit.pad
    rate = next(p for p in cause.form.parameters if p.name == "rate")
    rates = np.geomspace(rate.lower, rate.upper, RATES)

    def force(relaxation: Relaxation, law: Array) -> Array:
        numbers = replace(structure.pad, pad=replace(pad, relaxation=relaxation))
        x = numbers.x()
        x[: len(law)] = law
        other = replace(structure, pad=numbers)
        return force_at(data, other, other.x(x, structure.values(fit.x), fit.of_run))

    law = fit.x[: end - 2 * order]
    elastic = force(Relaxation(), law)
    modes = [data.whitened(force(Relaxation((UNIT,), (nu,)), law) - elastic) / UNIT for nu in rates.tolist()]
    curve = -at.jacobian[:, : len(law)]  # of the force, by the numbers of the law
    A = np.hstack([curve, np.stack(modes, axis=1)])
    target = data.whitened(data.force_N - elastic)
    pressed = at.force > PRESSED * structure.pad.force_N  # where it lets go it is no sum
    if not (np.isfinite(A).all() and np.isfinite(target).all()) or int(pressed.sum()) < 2 * A.shape[1]:
        return None
    room = np.concatenate([structure.upper[: len(law)] - law, np.full(RATES, MOST)])
    least = np.concatenate([structure.lower[: len(law)] - law, np.zeros(RATES)])
    found = lsq_linear(A[pressed], target[pressed], bounds=(least - 1e-12, room + 1e-12)).x
    peaks = _merged(found[len(law) :], np.log(rates), order + 1)
    total = sum(share for share, _ in peaks)
    if len(peaks) < order + 1 or total <= 0.0:
        return None
    shares = [share * min(1.0, MOST / total) for share, _ in peaks]
    own = left_over([log for _, log in peaks], np.log(believed_rates))
    others = sorted((k for k in range(len(peaks)) if k != own), key=lambda k: -peaks[k][1])
    relaxation = Relaxation(tuple(shares[k] for k in others), tuple(float(np.exp(peaks[k][1])) for k in others))
    begun = cause.with_start(share=shares[own], rate=float(np.exp(peaks[own][1])))
    numbers = replace(structure.pad, pad=replace(pad, relaxation=relaxation))
    x = numbers.x()
    x[: len(law)] = law + found[: len(law)]
    return begun, np.clip(x, structure.lower[:end], structure.upper[:end])


def _merged(shares: Array, logs: Array, count: int) -> list[tuple[float, float]]:
    """(share, logarithm of the rate) of so many modes at the most: neighbours made one where that costs least."""
    peaks = [(float(c), float(at)) for c, at in zip(shares, logs, strict=True) if c > LEAST]
    while len(peaks) > count:
        cost = [a[0] * b[0] / (a[0] + b[0]) * (a[1] - b[1]) ** 2 for a, b in zip(peaks, peaks[1:], strict=False)]
        k = int(np.argmin(cost))
        (c, at), (d, other) = peaks[k : k + 2]
        peaks[k : k + 2] = [(c + d, (c * at + d * other) / (c + d))]
    return peaks
