"""Which causes could be missing, and from where to start each of them.

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

from sim.effects import all_effects
from sim.effects.base import Effect, Form, Parameter
from sim.elastic import ElasticLaw, NoPad

from . import ripple
from .data import Data
from .numbers import Cause, Structure, cause_of
from .refit import Fit, errors, extended, force_at, jacobian
from .way import on_the_way, shown_on_the_way

Array = NDArray[np.float64]

CHANNEL = ("outliers", "stuck_samples", "mains_hum")  # found by detectors, not by fitting
MOST_STARTS = 96
LOWEST_RINGING_HZ, FREQUENCIES = 4.0, 32
NEARBY, ABOUT = 7, 2.0  # frequencies about one that was found, and up to how many times it, either way
SHORTEST, SHORTEST_MOVING = 0.12, 0.03  # of the longest period
MOSTLY, NEARLY_ALL = 0.5, 0.8  # of the force samples, that are on the way; of the travel, that they show finely
MANY = 24  # starts of another form than the first, beyond which it has none of its own
LONGEST_PERIOD = 1.6  # of the travel
LONGEST_IN_PASSING = 0.35  # of the travel, where each depth is met once
BENDS_AT = (0.08, 0.14, 0.2, 0.28, 0.38, 0.5, 0.7)  # of the depth reached
MOVED_AT = tuple(k / 10 for k in range(1, 10))  # of the run, when something may have moved
BETWEEN, KEPT = 3, 8  # further places between two of those; starts of which the one that keeps its promise comes first
RUBS = (0.02, 0.05, 0.1)  # of the depth reached, by which the load goes past a place before what it does there
TURNS = (0.2, 0.35, 0.6, 1.0, 1.6)  # of the depth reached, after which a width may repeat
FRESH = 0.9  # of the depth reached, beyond which a softening pad must go for the first time in the run
EVERY = tuple(0.1 * 1.1**k for k in range(24))  # of the run
COARSE = 500  # samples in which what the load changes is counted: in finer ones noise would count
MOST_SHIFT, FINE = 0.04, 0.05  # of the run, by which a force is sought shifted in time, and by halves of that down to
# what lies between samples: no more than so many of them are nearer to each other
LONGEST_REPORTED = 0.7  # of the depth, for errors of the position: longer ones are another elastic law


@dataclass(frozen=True)
class Start:
    """A cause with values to start from, and the χ² that its signature promises to take."""

    cause: Cause
    promise: float
    pad: Array | None = None
    """The pad's vector to start from, where its refit stands in the cause's place."""


@dataclass(frozen=True)
class Reach:
    """What the data can tell of at all: spans of time and travel, and the finest sampling."""

    sample_s: float
    span_s: float
    travel_mm: float
    depth_mm: float
    force_N: float
    changes_N: float
    """All that the load changes, up and down, as a linear pad's would."""
    rich: bool = True
    """Whether depths are held, or passed again: what depends on the position alone differs there from a law, which
    relaxes. In one pass over the depth it is told only by many periods."""
    moving: bool = False
    """Whether there is no pad, or most forces were felt on the way, or some nearly all along it: then the moves show a
    ripple itself."""

    @classmethod
    def of(cls, data: Data, structure: Structure, sample_s: float, rich: bool = True) -> Reach:
        """That of some data, and of how deep a structure's pad is pressed there and how much it bears at the most."""
        depth_mm, force_N = structure.pad.depth_mm, structure.pad.force_N
        into_mm = np.maximum(data.position_mm[:: max(1, data.size // COARSE)], 0.0)
        return cls(
            sample_s=sample_s,
            span_s=float(data.time_s[-1] - data.time_s[0]),
            travel_mm=float(np.ptp(data.position_mm)),
            depth_mm=depth_mm,
            force_N=force_N,
            changes_N=max(float(np.sum(np.abs(np.diff(into_mm)))) * force_N / depth_mm, force_N),
            rich=rich,
            moving=structure.in_air or on_the_way(data) > MOSTLY or (rich and shown_on_the_way(data) > NEARLY_ALL),
        )


def narrowed(form: Form, reach: Reach) -> Form:
    """The form with its parameters kept within what the data can tell of, and started there."""
    longest_mm = _longest_mm(form, reach)
    return replace(form, parameters=tuple(_narrowed(p, reach, longest_mm) for p in form.parameters))


def _longest_mm(form: Form, reach: Reach) -> float:
    """The longest way after which a form can be seen to repeat."""
    way_mm, share = reach.travel_mm, LONGEST_PERIOD
    if "report" in form.blocks and reach.depth_mm > 0.1 * reach.travel_mm:  # in air no force shows it
        way_mm, share = reach.depth_mm, LONGEST_REPORTED
    return way_mm * (share if reach.rich else LONGEST_IN_PASSING)


def _repeats_beyond(form: Form, reach: Reach) -> bool:
    """Whether a form repeats over a longer way at the least than these data go: a part of one wave is any curve."""
    if not ripple.ripples(form):
        return False
    period = next(p for p in form.parameters if p.name == "period")
    return period.lower >= _longest_mm(form, reach)


def with_periods(form: Form, from_mm: float, to_mm: float) -> Form:
    """The form with periods of this range."""
    return replace(
        form,
        parameters=tuple(
            _within(p, from_mm, to_mm, p.starts, p.if_left_out) if p.name == "period" else p for p in form.parameters
        ),
    )


def _narrowed(p: Parameter, reach: Reach, longest_mm: float) -> Parameter:
    lower, upper, starts, default = p.lower, p.upper, p.starts, p.if_left_out
    if p.unit == "1/s" and p.logarithmic:
        lower, upper = max(lower, 0.3 / reach.span_s), min(upper, 0.6 / reach.sample_s)
    elif p.unit == "Hz":
        lower, upper = max(lower, 2.0 / reach.span_s), min(upper, 0.9 / reach.sample_s)
    elif p.name == "window":  # corners of the motion are rebuilt between samples
        default = 0.1 * reach.sample_s
    elif p.name == "lasts":  # half of the time in which the load comes and goes once
        default = reach.span_s * reach.force_N / reach.changes_N
    elif p.unit == "s" and p.logarithmic:
        upper = min(upper, 3.0 * reach.span_s)
    elif p.name == "period":
        # some levels of depth are met by any ripple that is short enough
        shortest = SHORTEST_MOVING if reach.moving else SHORTEST
        lower, upper = max(lower, shortest * longest_mm), min(upper, longest_mm)
    elif p.name == "range":  # a pull beyond the widest gap is a bias; a pad may lag by half its depth
        upper = min(upper, reach.travel_mm - 0.5 * reach.depth_mm)
    elif p.name == "already":  # pressed before as deep as this run goes: then nothing softens in it, and it is a law
        upper = min(upper, FRESH * reach.depth_mm)
        starts = tuple(share * reach.depth_mm for share in (0.25, 0.5, 0.75)) if starts else ()
    elif p.name == "reach":
        default = reach.depth_mm
    elif p.name == "moved_at":
        upper = min(upper, reach.span_s)
        starts, default = tuple(share * reach.span_s for share in MOVED_AT), 0.5 * reach.span_s
    elif p.name == "every":  # a saw tooth that is a little too long is off by a whole one in the end
        starts, default = tuple(share * reach.span_s for share in EVERY), 0.3 * reach.span_s
        lower, upper = EVERY[0] * reach.span_s, reach.span_s
    elif p.name == "at_time":
        default = 0.5 * reach.span_s
    elif p.name == "bends_at":  # a rate that is another one but for a moment at the begin is a step
        lower, upper = 0.15 * reach.span_s, min(upper, 0.95 * reach.span_s)
        starts, default = tuple(share * reach.span_s for share in MOVED_AT[1:]), 0.5 * reach.span_s
    elif p.bend or p.name == "depth":  # of what goes over a longer way only the slope is told
        upper = min(upper, (0.5 if p.bend and p.name == "depth" else 1.0) * reach.depth_mm)
        starts = tuple(share * reach.depth_mm for share in BENDS_AT) if p.bend else starts
    elif p.name == "at_depth":
        default = 0.5 * reach.depth_mm
    elif p.name == "at_load":
        default = 0.5 * reach.force_N
    elif p.name == "at_swing":
        default = 0.03 * reach.force_N
    elif p.name == "at_change":
        default = 0.5 * reach.changes_N
    elif p.name == "at_travel":  # half of the travel in, which is half of all changes
        default = 0.25 * reach.changes_N * reach.depth_mm / reach.force_N
    elif p.name == "at_force":
        default = 0.6 * reach.force_N
    elif p.name == "limit" and p.unit == "N":
        starts = tuple(share * reach.force_N for share in (0.6, 0.8, 0.93, 0.985))
    elif p.name == "rubs" and p.unit == "mm":
        starts, default = tuple(share * reach.depth_mm for share in RUBS), RUBS[0] * reach.depth_mm
    elif p.name == "turn":  # worn where it is used, or once about after each turn of what drives it
        upper = min(upper, LONGEST_PERIOD * reach.depth_mm)
        starts = tuple(share * reach.depth_mm for share in TURNS)
    elif p.name == "preload":  # a joint that opens beyond all forces is none
        lower, upper = 0.02 * reach.force_N, reach.force_N
        starts = tuple(share * reach.force_N for share in (0.15, 0.3, 0.6))
    elif p.name == "slip_force":
        lower, upper = 0.005 * reach.force_N, reach.force_N
        starts = tuple(share * reach.force_N for share in (0.03, 0.1))
    return _within(p, lower, upper, starts, default)


def _within(p: Parameter, lower: float, upper: float, starts: Sequence[float], default: float) -> Parameter:
    """A parameter between other bounds, where there is anything between them."""
    if lower >= upper:
        return p
    starts = tuple(v for v in starts if lower <= v <= upper)
    default = min(max(default, lower), upper)
    typical = min(max(p.typical, lower), upper)
    return replace(p, lower=lower, upper=upper, starts=starts, default=default, typical=typical)


def forms(structure: Structure, in_air: bool, reach: Reach, also_unsought: bool = False) -> list[tuple[Effect, Form]]:
    """All forms of all effects that may be added to a structure; `also_unsought`: those too that only refine others."""
    present = {c.id for c in structure.causes}
    out = []
    for effect in all_effects().values():
        if effect.id in CHANNEL:
            continue
        for form in effect.forms:
            # A second block of a cause that is there already asks whether only its shape is another.
            if effect.id in present and (form.amend is not None or form.time_shift is not None):
                continue
            if (in_air and not _in_air(form)) or _repeats_beyond(form, reach):
                continue
            if form.has_a_course and not reach.rich:  # where depths are met once, any error is one of its time
                continue
            if not (form.sought or also_unsought) or (form.amend is not None and not _amends(structure, form)):
                continue
            out.append((effect, narrowed(form, reach)))
    return out


def _in_air(form: Form) -> bool:
    if form.amend is not None:
        return False
    pads = {"depth", "elastic", "rate", "contact", "gap", "frame"}
    return form.time_shift is None and not pads & set(form.blocks)


def _amends(structure: Structure, form: Form) -> bool:
    """Whether the form changes the pad at all (separation of a pad that lets go already does not)."""
    pad = structure.pad.pad
    values = {p.name: p.typical for p in form.parameters}
    assert form.amend is not None
    return form.amend(pad, values) != pad and not isinstance(pad.law, NoPad)


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


def residual_of(data: Data, fit: Fit) -> Array:
    """Errors of a fit in units of the noise (n,)."""
    return errors(data, fit.structure, fit.x)
