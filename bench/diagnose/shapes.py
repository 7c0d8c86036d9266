"""The other shapes of a cause's family: each fitted in place of the one that leads, and what it is worth."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sim.effects import Form

from .candidates import CHANNEL
from .data import Data
from .modes import NAMED as MISSING
from .modes import as_believed, missing_told
from .noise import HARDLY_ANY
from .numbers import Cause, Structure, cause_of
from .reach import LONGEST_PERIOD, Reach, narrowed, with_periods
from .refit import Fit, chi2, reduced, refit
from .ripple import larger_first, merged, ripples
from .starts import Signatures, alike, combinations, starts
from .way import met_again

Array = NDArray[np.float64]

STEPS, STARTS = 8, 12  # of the fit of another shape
LONGER, ROOM = 6, 1.5  # starts with longer periods, of each shape; times a period, that the longest must be for them
LARGER = (5.0, 25.0)  # times the size found, from which a course is begun too
FEW, TRIED = 3, 2  # steps of the best starts
NEARLY = 1e-5  # of χ², that a step must promise
END = 25  # steps of the one that is taken
AS_GOOD = 4.0  # Δχ² by which one that is near to what was believed may be worse
HARDLY_WORSE = 25.0  # Δχ² by which one wave that swells may be worse than two
SAME = 1.0  # Δχ² by which a shape is no other
INEXACT = 0.02  # of what a cause takes, that its true shape may be from the nearest of its family
LESS_ODD = 0.7  # times as far, in squares, from the others of its family: a shape that is taken for its numbers
FAR = 0.25  # of a number, that a shape which fits worse counts as away at the most: further, it means another thing
LEFT = 1.03  # times the noise power: what leaves more may have a period beyond those sought
IN_STEP = 0.3  # of the position's power, that is at a frequency: then the motion swings with it
EDGE = 1e-6  # within which a coordinate is at its bound
WORKERS = 2


@dataclass(frozen=True)
class Member:
    """A shape of a family, fitted in the place `index` of a fit's causes; −1: the fit without any."""

    fit: Fit
    index: int

    @property
    def values(self) -> dict[str, float]:
        """Its numbers."""
        return self.fit.structure.values(self.fit.x)[self.index]

    @property
    def variances(self) -> dict[str, float]:
        """Of those that were fitted, in the fit's coordinates, for white noise."""
        s = self.fit.structure
        spread = np.diag(self.fit.covariance())[s.of_cause(self.index)]
        return dict(zip([p.name for p in s.causes[self.index].fitted], spread.tolist(), strict=True))

    @property
    def at_its_end(self) -> int:
        """How many of its numbers are at a bound and yet do something there: at 0, or left out, one does nothing."""
        if self.index < 0:
            return 0
        s, at = self.fit.structure, self.fit.structure.of_cause(self.index)
        x, moves = self.fit.x[at], np.diag(self.fit.matrix)[at] > 0.0
        ended = moves & ((x <= s.lower[at] + EDGE) | (x >= s.upper[at] - EDGE))
        neutral = [self.values[p.name] in (0.0, p.default) for p in s.causes[self.index].fitted]
        return int(np.count_nonzero(ended & ~np.array(neutral, dtype=bool)))


def stand_in(short: Data, fit: Fit) -> tuple[Fit, list[int]]:
    """The fit carried on with short data, without what detectors find, and which of its causes are left."""
    kept = [i for i, c in enumerate(fit.structure.causes) if c.id not in CHANNEL]
    structure = replace(fit.structure, causes=tuple(fit.structure.causes[i] for i in kept))
    values = fit.structure.values(fit.x)
    x = structure.x(fit.x[: len(structure.pad.coordinates)], [values[i] for i in kept], fit.of_run)
    return refit(short, structure, x, STEPS, 1e-6), kept


def families(short: Data, lead: Fit, indices: Sequence[int]) -> list[list[Member]]:
    """Of each of some causes, the shape that leads and those others of its family that make a plant."""
    again = met_again(short, lead.structure)
    tried = [
        (index, form)
        for index in indices
        for form in lead.structure.causes[index].effect.forms
        if form.name != lead.structure.causes[index].form.name and _comparable(lead.structure.causes[index].form, form)
        if again or not form.has_a_course
    ]
    with ThreadPoolExecutor(WORKERS) as pool:
        found = list(pool.map(lambda pair: _other(short, lead, *pair), tried))
    return [
        [Member(lead, index), *(m for (i, _), m in zip(tried, found, strict=True) if i == index and m is not None)]
        for index in indices
    ]


def scores(short: Data, members: Sequence[Member]) -> Array:
    """χ² of each with what its numbers cost (G. Schwarz, Ann. Statist. 6, 1978, 461–464).

    What the best of them leaves beyond the noise counts as noise, that of the colour too: no shape is exact. A number
    at the end of what the data can tell was chosen like any other, and costs as much.
    """
    entries = float(np.count_nonzero(short.weight > 0))
    scale = max(min(m.fit.chi2 / max(entries - m.fit.free, 1.0) for m in members), 1.0)
    cost = float(np.log(max(short.weight.sum() / scale**2, 20.0)))
    return np.array([m.fit.chi2 / scale + cost * (m.fit.free + m.at_its_end) for m in members])


def reshaped(short: Data, fit: Fit, own: int = 0) -> Fit:
    """The fit with each of its causes in the best of its shapes; `own`: causes at the begin that stay as they are."""
    lead, kept = stand_in(short, fit)
    if len(kept) < len(fit.structure.causes) or lead.chi2 < HARDLY_ANY * np.count_nonzero(short.weight > 0):
        return fit  # or without noise, where the plainest shape stands as it was found
    lead = taken = replace(lead, x=missing_told(lead, lead.structure))
    for index in range(own, len(kept)):
        members = families(short, taken, [index])[0]
        dealt = as_believed(short, taken) if taken.structure.causes[index].id == MISSING else None
        count = len(members)
        members += [] if dealt is None else families(short, dealt, [index])[0]
        score = scores(short, members)
        score[count:] -= AS_GOOD
        order = np.argsort(score, kind="stable").tolist()
        if order[0] < count:
            order.insert(0, _usual(short, members[:count], order[0]))
        for best in order:
            if best == 0:
                break
            other = refit(short, members[best].fit.structure, members[best].fit.x, END, 1e-8)
            if not departed(short, other, index):
                taken = other
                break
        taken = _longer(short, _apart(short, taken, index, members[1:count]), index)
        taken = _exchanged(short, taken, index)
    return fit if taken is lead else taken


def weights(score: Array) -> tuple[Array, Array]:
    """How much each shape counts if one of them is true, and if none is; the last score is that without the cause."""
    above = score[:-1] - score.min()
    plain, inexact = (np.exp(-0.5 * above / t) for t in (1.0, 1.0 + INEXACT * (score[-1] - score.min())))
    return np.asarray(plain / plain.sum()), np.asarray(inexact / inexact.sum())


def _usual(short: Data, members: Sequence[Member], best: int) -> int:
    """Which of the shapes that are as good as the best of a family has the most usual numbers: from which those of the
    others are the least away, all told, each by its weight. Which of them is a little better tells nothing of the
    numbers; and one that knows one of them not, or cannot tell it, is none of them."""
    cause = members[best].fit.structure.causes[members[best].index]
    asked = [p for p in cause.form.parameters if p.required]
    score = scores(short, members)
    tied = [k for k in np.argsort(score, kind="stable").tolist() if score[k] <= score[best] + AS_GOOD]
    if len(tied) == 1 or cause.of_the_law:  # whose numbers are each form's own
        return best

    scale = members[best].values
    numbers = np.full((len(members), len(asked)), np.nan)
    for row, member in zip(numbers, members, strict=True):
        values, variances = member.values, member.variances
        for n, p in enumerate(asked):
            if variances.get(p.name, 0.0) > 0.0:
                row[n] = np.log(values[p.name]) if p.logarithmic else values[p.name] / max(abs(scale[p.name]), 1e-300)
    tied = [k for k in tied if np.isfinite(numbers[k]).all()]
    if not tied:
        return best
    bare = refit(short, *reduced(members[best].fit, members[best].index), STEPS, NEARLY)
    _, weight = weights(scores(short, [*members, Member(bare, -1)]))
    away = {k: float(np.sum(weight @ np.minimum(np.nan_to_num(np.abs(numbers - numbers[k])), FAR) ** 2)) for k in tied}
    usual = min(tied, key=away.__getitem__)
    return best if best in away and away[usual] > LESS_ODD * away[best] else usual


def _apart(short: Data, fit: Fit, index: int, others: Sequence[Member]) -> Fit:
    """The fit; or, where a cause of it is two waves that are one which swells, with the best of its other shapes, of
    whatever period, if that is hardly worse: of two such waves no number is told."""
    if not _merged(short, fit, index) or not others:
        return fit
    best = others[int(np.argmin(scores(short, others)))].fit
    single = _longer(short, refit(short, best.structure, best.x, END, 1e-8), index)
    apart, together = scores(short, [Member(single, index), Member(fit, index)])
    return single if apart < together + HARDLY_WORSE else fit


def steadier(short: Data, fit: Fit, own: int = 0) -> Fit:
    """The fit with each cause that has a course in the best of its shapes that have none: half waves go where they may
    in a block that was not seen. The fit itself where there is no such cause; `own`: causes that stay as they are."""
    for index in range(own, len(fit.structure.causes)):
        if fit.structure.causes[index].form.has_a_course:
            members = families(short, fit, [index])[0]
            steady = [m for m in members if not m.fit.structure.causes[index].form.has_a_course]
            if steady:
                best = steady[int(np.argmin(scores(short, steady)))].fit
                fit = refit(short, best.structure, best.x, END, 1e-8)
    return fit


def plainest(data: Data, fit: Fit, own: int = 0) -> Fit:
    """The fit with those causes in a plainer shape whose further numbers have come to nothing: there it is the same.
    `own`: causes at the begin that stay as they are."""
    reach = Reach.of(data, fit.structure, data.sample_s)
    for index in range(own, len(fit.structure.causes)):
        pad = fit.x[: len(fit.structure.pad.coordinates)]
        cause, values = fit.structure.causes[index], fit.structure.values(fit.x)[index]
        left = {p.name for p in cause.fitted if p.required or values[p.name] != 0.0}
        if len(left) == len(cause.fitted):
            continue
        for form in cause.effect.forms:
            plain = alike(fit, index, cause_of(cause.effect, narrowed(form, reach)))
            if not _comparable(cause.form, form) or not {p.name for p in plain.fitted} <= left:
                continue
            other = refit(data, *_in_place(fit, index, plain, pad), FEW, NEARLY)
            if other.chi2 <= fit.chi2 + SAME:
                fit = other
                break
    return fit


def _longer(short: Data, fit: Fit, index: int) -> Fit:
    """The fit with a longer period than was sought for a cause that repeats with the position, where its own is at the
    bound or leaves something: while other causes may stand first a long one is another law, and no more."""
    structure, values = fit.structure, fit.structure.values(fit.x)
    cause, entries = structure.causes[index], float(np.count_nonzero(short.weight > 0))
    if not ripples(cause.form):
        return fit
    k = structure.of_cause(index).start + [p.name for p in cause.fitted].index("period")
    if fit.x[k] < structure.upper[k] - EDGE and fit.chi2 < LEFT * max(entries - fit.free, 1.0):
        return fit
    period_mm, longest_mm = values[index]["period"], LONGEST_PERIOD * float(np.ptp(short.position_mm))
    if ROOM * period_mm > longest_mm:
        return fit

    def carried(form: Form, start: Mapping[str, float], pad: Array, steps: int) -> Fit:
        return waving(short, fit, index, with_periods(form, 0.5 * period_mm, longest_mm), start, pad, steps, NEARLY)

    bare = refit(short, *reduced(fit, index), END, 1e-8)
    signatures, end = Signatures(short, bare), len(structure.pad.coordinates)
    found = [carried(cause.form, values[index], fit.x[:end], END)]
    for form in [f for f in cause.effect.forms if f.sought]:
        begun = starts(signatures, cause.effect, with_periods(form, 1.02 * period_mm, longest_mm), LONGER)
        tried = sorted((carried(form, s.cause.start, bare.x[:end], STEPS) for s in begun), key=lambda f: f.chi2)
        found += [refit(short, f.structure, f.x, END, 1e-8) for f in tried[: LONGER // 2]]
    members = [Member(fit, index), *(Member(f, index) for f in found if not departed(short, f, index))]
    return members[int(np.argmin(scores(short, members)))].fit


def _exchanged(short: Data, fit: Fit, index: int) -> Fit:
    """The fit with the larger of a cause's two waves for the first."""
    form = fit.structure.causes[index].form
    values = larger_first(form, fit.structure.values(fit.x)[index])
    if values is None:
        return fit
    form = with_periods(form, 0.5 * values["period"], 2.0 * values["period"])
    return waving(short, fit, index, form, values, fit.x[: len(fit.structure.pad.coordinates)])


def waving(
    short: Data, fit: Fit, index: int, form: Form, start: Mapping[str, float], pad: Array,
    steps: int = END, tolerance: float = 1e-8,
) -> Fit:  # fmt: skip
    """The fit carried on with one of its causes in a form of other bounds, begun at `start`, and the pad at `pad`."""
    own = cause_of(fit.structure.causes[index].effect, form, start)
    return refit(short, *_in_place(fit, index, own, pad), steps, tolerance)


def _in_place(fit: Fit, index: int, cause: Cause, pad: Array) -> tuple[Structure, Array]:
    """The structure with another cause in a place, and x where that and the pad begin anew, all else as it is."""
    structure, values = fit.structure.with_cause_at(index, cause), fit.structure.values(fit.x)
    return structure, structure.x(pad, [*values[:index], cause.start, *values[index + 1 :]], fit.of_run)


def departed(short: Data, fit: Fit, index: int) -> bool:
    """Whether a cause is another's shape, of which this one makes what it can: it differs from the first of its family
    by as much as the family allows (a number of either sign, 0 by default, at its bound), or swings in time as the
    motion does, so that friction is in it, or is two waves in place of one that swells."""
    at = fit.structure.of_cause(index)
    departures = [p.default == 0.0 and p.lower == -p.upper for p in fit.structure.causes[index].fitted]
    x, lower, upper = fit.x[at], fit.structure.lower[at], fit.structure.upper[at]
    at_bound = np.any(np.array(departures, dtype=bool) & ((x <= lower + EDGE) | (x >= upper - EDGE)))
    return bool(at_bound) or _in_step(short, fit, index) or _merged(short, fit, index)


def _merged(short: Data, fit: Fit, index: int) -> bool:
    values = fit.structure.values(fit.x)[index]
    return merged(fit.structure.causes[index].form, values, float(np.ptp(short.position_mm)))


def _in_step(short: Data, fit: Fit, index: int) -> bool:
    """Whether the position swings with a cause's period in time."""
    cause = fit.structure.causes[index]
    if not any(p.name == "period" and p.unit == "s" for p in cause.form.parameters):
        return False
    turns = short.time_s / fit.structure.values(fit.x)[index]["period"]
    lasts = np.gradient(short.time_s)
    off = short.position_mm - float(np.average(short.position_mm, weights=lasts))
    at_that = abs(np.average(off * np.exp(-2j * np.pi * turns), weights=lasts))
    return bool(2.0 * at_that**2 > IN_STEP * np.average(off**2, weights=lasts))


def _comparable(one: Form, other: Form) -> bool:
    """Whether two forms have the same numbers beside those of their shapes."""
    return [p.name for p in one.parameters if p.required] == [p.name for p in other.parameters if p.required]


def _other(short: Data, lead: Fit, index: int, form: Form) -> Member | None:
    """Another shape in place of a cause of a fit, carried to its minimum; None where it makes no plant."""
    structure, values = lead.structure, lead.structure.values(lead.x)
    cause, end = structure.causes[index], len(structure.pad.coordinates)
    shape = narrowed(form, Reach.of(short, structure, short.sample_s))
    told = {p.name: values[index][p.name] for p in shape.parameters if p.name in values[index]}
    like = cause_of(cause.effect, shape, told)
    begun = _begun(short, lead, index, like, [{}, *_own(shape, told), *_thinned(list(combinations(shape)))])
    tried = [refit(short, *_in_place(lead, index, c, lead.x[:end]), FEW, NEARLY) for c in begun]
    if not tried:
        return None
    best = min(tried, key=lambda fit: fit.chi2)
    member = Member(refit(short, best.structure, best.x, STEPS, NEARLY), index)
    return None if departed(short, member.fit, index) else member


def begun_anew(short: Data, lead: Fit, index: int, like: Cause) -> list[Cause]:
    """Another shape of a cause of a fit, `like` that one in the numbers that they share, with its own begun elsewhere:
    where it fits best so."""
    return _begun(short, lead, index, like, _own(like.form, lead.structure.causes[index].start))


def _begun(short: Data, lead: Fit, index: int, like: Cause, own: Sequence[Mapping[str, float]]) -> list[Cause]:
    """A cause in a place of a fit with some of its numbers begun as `own` has them, where it fits best as it stands;
    and begun larger, where it has a course."""
    causes, pad = [like.with_start(**values) for values in own], lead.x[: len(lead.structure.pad.coordinates)]
    left = np.array([chi2(short, *_in_place(lead, index, cause, pad)) for cause in causes])
    best = [causes[k] for k in np.argsort(left, kind="stable")[:TRIED] if np.isfinite(left[k])]
    return [*best, *_larger(like)]


def _larger(cause: Cause) -> list[Cause]:
    """A cause that is now more and now less over the data, begun from larger sizes: what comes and goes is little on
    the average, and its half waves, of that size, are much."""
    size = cause.amplitude
    if size is None or not cause.form.has_a_course:
        return []
    return [cause.with_start(**{size.name: times * cause.start[size.name]}) for times in LARGER]


def _own(form: Form, told: Collection[str]) -> list[dict[str, float]]:
    """Values to start from of what is not told; none where all is."""
    fresh = replace(form, parameters=tuple(p for p in form.parameters if p.name not in told))
    return _thinned([values for values in combinations(fresh) if values])


def _thinned(every: list[dict[str, float]]) -> list[dict[str, float]]:
    return every[:: max(1, len(every) // STARTS)]
