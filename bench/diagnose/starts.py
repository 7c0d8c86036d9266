"""From where to start a candidate.

A start is chosen by what the cause's first-order signature, beyond what the pad's own numbers can imitate, takes of the
residual; it is only a start: a candidate is judged by a joint refit.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, product

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from sim.effects.base import Effect, Form
from sim.elastic import ElasticLaw

from . import ripple
from .data import Data
from .numbers import Cause, Structure, cause_of
from .refit import Fit, extended, force_at, jacobian

Array = NDArray[np.float64]

MOST_STARTS = 96
LOWEST_RINGING_HZ, FREQUENCIES = 4.0, 32
NEARBY, ABOUT = 7, 2.0  # frequencies about one that was found, and up to how many times it, either way
RISEN, STANDS_OUT, DEEP = 0.005, 6.0, 0.05  # of the greatest force, and deviations of its noise, that are no free air;
# of the depth, below which a surface has another start
MANY = 24  # starts of another form than the first, beyond which it has none of its own
BETWEEN, KEPT = 3, 8  # further places between two of those; starts of which the one that keeps its promise comes first
MOST_SHIFT, FINE = 0.04, 0.05  # of the run, by which a force is sought shifted in time, and by halves of that down to
# what lies between samples: no more than so many of them are nearer to each other


@dataclass(frozen=True)
class Start:
    """A cause with values to start from, and the χ² that its signature promises to take."""

    cause: Cause
    promise: float
    pad: Array | None = None
    """The pad's vector to start from, where its refit stands in the cause's place."""


class Signatures:
    """Judges signatures at one fit: residual and the pad's own derivatives, taken out by projection."""

    def __init__(self, data: Data, fit: Fit) -> None:
        self.data, self.fit = data, fit
        self.force = force_at(data, fit.structure, fit.x)
        J = jacobian(data, fit.structure, fit.x, self.force)
        self.jacobian = J[:, : len(fit.x) - fit.structure.tail]
        norm = np.linalg.norm(J, axis=0)
        J = J[:, norm > 1e-9 * max(float(norm.max(initial=0.0)), 1e-300)]
        Q = np.linalg.qr(J / np.linalg.norm(J, axis=0))[0] if J.shape[1] else np.zeros((data.size, 0))
        self.Q = [np.ascontiguousarray(q) for q in Q.T]
        self.residual = self._clear(data.whitened(data.force_N - self.force))
        self.waves: dict[tuple[str, str], ripple.Waves] = {}  # by effect and form: several forms begin with one

    def _clear(self, column: Array) -> Array:
        for q in self.Q:
            column = column - float(np.sum(q * column)) * q
        return column

    def column(self, cause: Cause) -> Array:
        """Change of the force by a unit of the cause's amplitude (n,), whitened, beyond what the pad can imitate."""
        amplitude = cause.amplitude
        assert amplitude is not None
        size = 0.3 * (abs(amplitude.typical) or 1.0)
        if size > amplitude.upper:
            size = 0.5 * amplitude.upper
        return self._clear(self.data.whitened(self.change(cause.with_start(**{amplitude.name: size}))) / size)

    def change(self, cause: Cause) -> Array:
        """What a cause adds to the force (n,), N, all else as it is."""
        structure = self.fit.structure.with_cause(cause)
        added = structure.x(self.fit.x[: len(structure.pad.coordinates)])[structure.of_cause(len(structure.causes) - 1)]
        with np.errstate(all="ignore"):
            return force_at(self.data, structure, extended(self.fit, added)) - self.force

    def of(self, cause: Cause) -> tuple[float, float]:
        """(χ² that the cause's signature takes, amplitude at which it does); amplitude within the bounds."""
        amplitude, column = cause.amplitude, self.column(cause)
        assert amplitude is not None
        square = _square(column)
        if not np.isfinite(square) or square <= 1e-18:
            return 0.0, 0.0
        along = float(np.sum(column * self.residual))
        best = along / square
        best = min(max(best, amplitude.lower), amplitude.upper)
        return best * (2 * along - best * square), best

    def whole(self, cause: Cause) -> float:
        """χ² that a cause takes as it stands, the pad's numbers free to first order; −inf where it makes no plant."""
        change = self.change(cause)
        if not np.isfinite(change).all():
            return -np.inf
        column = self._clear(self.data.whitened(change))
        return float(2.0 * np.sum(column * self.residual)) - _square(column)


def _square(column: Array) -> float:
    """Sum of squares; infinite for a column so large that its numbers make no plant."""
    with np.errstate(over="ignore"):
        return float(np.sum(column * column))


def combinations(form: Form) -> Iterator[dict[str, float]]:
    """Values to start the form's shape from: all combinations, thinned where there are too many."""
    shapes = [p for p in form.parameters if not p.amplitude and not p.fixed and p.starts]
    several: Iterable[tuple[float, ...]] = product(*(p.starts for p in shapes))
    every = list(several)
    stride = max(1, -(-len(every) // MOST_STARTS))
    for values in every[::stride]:
        yield dict(zip([p.name for p in shapes], values, strict=True))


def _scanned(form: Form, near: Mapping[str, float]) -> Iterator[dict[str, float]]:
    """Values to start from where nothing scales the effect; frequencies densely, since ringing has narrow minima."""
    frequency = next((p for p in form.parameters if p.unit == "Hz"), None)
    if frequency is None:
        yield from combinations(form)
        return
    least, most, count = max(frequency.lower, LOWEST_RINGING_HZ), frequency.upper, FREQUENCIES
    if least >= most:  # so slow are the data
        least = frequency.lower
    if frequency.name in near:
        found, count = near[frequency.name], NEARBY
        least, most = max(found / ABOUT, frequency.lower), min(found * ABOUT, frequency.upper)
    others = replace(form, parameters=tuple(p for p in form.parameters if p is not frequency))
    for values in combinations(others):
        for f in np.geomspace(least, most, count):
            yield {**values, frequency.name: float(f)}


def starts(
    signatures: Signatures,
    effect: Effect,
    form: Form,
    most: int = 2,
    near: Mapping[str, float] | None = None,
    rich: bool = True,
) -> list[Start]:
    """The most promising starts of a form, best first. `near`: numbers of another form of the family that was found,
    about which frequencies are sought. `rich`: whether depths are met more than once; where not, none begins far off:
    any shape fits there that is sought well enough, and foretells no other run."""
    cause = cause_of(effect, form)
    if cause.of_the_law:
        amended = _amended(signatures.fit, cause)
        if len(amended) > most:
            amended = sorted(amended, key=lambda c: -signatures.whole(c))
        return [Start(c, np.inf) for c in amended[:most]]
    if cause.amplitude is None:
        tried = [cause.with_start(**values) for values in _scanned(form, near or {})]
        if len(tried) > most:
            tried = sorted(tried, key=lambda c: -signatures.whole(c))
        return [Start(c, np.inf) for c in tried[:most]]
    if ripple.ripples(form):
        return _rippling(signatures, effect, cause, most)
    amplitude = cause.amplitude
    found: list[Start] = []
    if len(list(combinations(form))) > MANY and form.name != effect.forms[0].name:
        return []  # it is tried from where the family's first form has ended
    for values in combinations(_finely(form) if rich else form):
        trial = cause.with_start(**values)
        promise, best = signatures.of(trial)
        least = 0.05 * abs(amplitude.typical)
        sign = -1.0 if best < 0 else 1.0
        size = min(max(abs(best), least), 5 * abs(amplitude.typical) or abs(best))
        found.append(Start(trial.with_start(**{amplitude.name: _inside(sign * size, amplitude.lower, amplitude.upper)}),
                           promise))  # fmt: skip
    found += _far_off(signatures, cause) if rich and form.time_shift is not None else []
    found += _at_the_surface(signatures, cause) if cause.id == "contact_offset" else []
    found.sort(key=lambda s: -s.promise)
    if rich and any(p.bend for p in form.parameters):  # of many that promise as much, the one that keeps it comes first
        first = max(found[:KEPT], key=lambda s: signatures.whole(s.cause))
        found.sort(key=lambda s: s is not first)
    return found[:most]


def _finely(form: Form) -> Form:
    """The form with the depth at which it bends begun at more places: each depth held is on one side of it, and what a
    fit does on its way past one is a leap."""
    fine = tuple(replace(p, starts=_between(p.starts)) if p.bend else p for p in form.parameters)
    return replace(form, parameters=fine)


def _between(values: Sequence[float]) -> tuple[float, ...]:
    """Values with others in between, in even ratios."""
    share = np.arange(BETWEEN + 1) / (BETWEEN + 1)
    between = [float(a ** (1.0 - s) * b**s) for a, b in pairwise(values) for s in share]
    return (*between, *values[-1:])


def _far_off(signatures: Signatures, cause: Cause) -> list[Start]:
    """Starts of what shifts the force in time by more than a ramp takes: a first-order signature knows of none."""
    amplitude, shift = cause.amplitude, cause.form.time_shift
    assert amplitude is not None and shift is not None
    time_s = signatures.data.time_s
    unit = amplitude.typical or 1.0
    shift_s = float(np.max(np.abs(shift({**cause.start, amplitude.name: unit}, time_s) - time_s)))
    longest_s, shortest_s = MOST_SHIFT * float(time_s[-1] - time_s[0]), float(np.quantile(np.diff(time_s), FINE))
    twice = range(max(int(np.log2(longest_s / max(shortest_s, 1e-300))), 0) + 1)
    sizes = [longest_s / 2.0**k * abs(unit) / max(shift_s, 1e-300) for k in twice]
    at = [s for size in sizes for s in (size, -size) if amplitude.lower < s < amplitude.upper]
    started = [cause.with_start(**{amplitude.name: size}) for size in at]
    return [Start(c, signatures.whole(c)) for c in started]


def _at_the_surface(signatures: Signatures, cause: Cause) -> list[Start]:
    """A surface where the force begins to rise, where that is deep below the one believed: from there the pad is the
    one believed, and no more the one that was bent to rise so late."""
    data, pad, amplitude = signatures.data, signatures.fit.structure.pad, cause.amplitude
    assert amplitude is not None
    counted = data.weight > 0
    force, position = data.force_N[counted], data.position_mm[counted]
    least_N = max(RISEN * float(np.max(force)), STANDS_OUT * float(np.median(data.total_N[counted])))
    risen = np.flatnonzero((force[:-1] > least_N) & (force[1:] > least_N))
    if not pad.pad.unilateral or not len(risen) or position[risen[0]] < DEEP * pad.depth_mm:
        return []
    offset = _inside(float(position[max(risen[0] - 1, 0)]), amplitude.lower, amplitude.upper)
    return [Start(cause.with_start(**{amplitude.name: offset}), np.inf, pad.x())]


def _rippling(signatures: Signatures, effect: Effect, cause: Cause, most: int) -> list[Start]:
    """Starts of what repeats with the position."""
    plain = {p.name for p in cause.form.parameters} == {p.name for p in effect.forms[0].parameters}
    # at its own bounds: a second sine may have a shorter period than the first is sought with
    sine, amplitude = cause_of(effect, effect.form(cause.form.name if plain else None)), cause.amplitude
    assert amplitude is not None

    def column(period_mm: float, phase_rad: float) -> Array:
        return signatures.column(sine.with_start(period=period_mm, phase=phase_rad))

    key = (effect.id, sine.form.name)
    if key not in signatures.waves:
        signatures.waves[key] = ripple.Waves(signatures.residual)
    out = []
    most = 1 if ripple.two_periods(cause.form) else most
    for values, promise in ripple.starts(cause.form, column, signatures.waves[key], most):
        size = min(max(values["amplitude"], 0.05 * amplitude.typical), 5 * amplitude.typical)
        values["amplitude"] = _inside(size, amplitude.lower, amplitude.upper)
        out.append(Start(cause.with_start(**values), promise))
    return out


def _inside(value: float, lower: float, upper: float) -> float:
    return min(max(value, lower), upper)


def _amended(fit: Fit, cause: Cause, drawn: ElasticLaw | None = None) -> list[Cause]:
    """Another law in place of the believed: numbers with which it is near `drawn`, or the curve that was fitted. Where
    the law stays, all starts."""
    structure = fit.structure
    pad = fit.pad
    fitted = cause.fitted
    assert cause.form.amend is not None
    amend = cause.form.amend
    if not fitted:
        return [cause]
    if amend(pad, cause.start).law == pad.law:
        return [cause.with_start(**values) for values in combinations(cause.form)]
    depth = np.linspace(0.02, 1.0, 60) * structure.pad.depth_mm
    wanted = (pad.law if drawn is None else drawn).force(depth)
    scale = max(float(np.abs(wanted).max()), 1e-12)
    probe = Structure(structure.pad, (cause,))
    at = probe.of_cause(0)
    lower, upper = probe.lower[at], probe.upper[at]
    base = probe.x(fit.x[: len(structure.pad.coordinates)])

    def error(numbers: Array) -> Array:
        x = base.copy()
        x[at] = numbers
        with np.errstate(all="ignore"):
            law = amend(pad, probe.values(x)[0]).law
            off = (law.force(depth) - wanted) / scale
        return np.where(np.isfinite(off), np.clip(off, -1e6, 1e6), 1e6)

    best = None
    for shrink in (1.0, 0.3, 3.0):
        x0 = np.clip(base[at] * shrink, lower + 1e-9, upper - 1e-9)
        solution = least_squares(error, x0, bounds=(lower, upper), x_scale="jac", max_nfev=200)
        if best is None or solution.cost < best.cost:
            best = solution
    assert best is not None
    x = base.copy()
    x[at] = best.x
    return [cause.with_start(**probe.values(x)[0])]


def alike(fit: Fit, index: int, cause: Cause) -> Cause:
    """Another shape of one of a fit's causes, to start from where that one is: near its curve where it is a law, and
    else with the numbers that they share."""
    amend, values = fit.structure.causes[index].form.amend, fit.structure.values(fit.x)[index]
    if amend is not None and cause.form.amend is not None:
        return _amended(fit, cause, amend(fit.pad, values).law)[0]
    return cause.with_start(**{p.name: values[p.name] for p in cause.fitted if p.name in values})
