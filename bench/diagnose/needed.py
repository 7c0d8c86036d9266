"""Which of the causes found are needed: by what was held out, by the end of the run, and all fitted together."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from .channel_causes import hum_cause
from .data import Data, Prepared
from .evidence import EXACT, MOST_LEFT, SPEAKS, of_slow_force, within_bounds
from .gauge import gauged
from .held_out import SEEN, held_out_square, later_square
from .hum import Line
from .hum import find as line_of
from .modes import missing_told
from .numbers import Structure, shapes_of
from .path import Path
from .refit import Fit, extended, force_at, mean_square, onto, placed, refit
from .shapes import plainest, reshaped, steadier
from .spread import covariance
from .verdict import chain, excesses, no_size, ordered, sureness, told_size, without

LEAST, FURTHER = 0.004, 0.01  # of the error beyond the noise: what a first and a further cause must take of what was
# held out
DOUBTED, LITTLE = 0.3, 0.08  # sure of a name, and of the error beyond the noise: a further cause with less is none
UNLIKELY, A_FIFTH = 0.2, 0.2  # the same, with less of it
NAMED, TRACE = 0.6, 0.05  # the same, of a further cause where what it and all others leave is next to nothing
FAINT = 0.25  # of the noise power, that such a cause takes
OF_A_GIANT, NO_LESS = 0.003, 2.0  # of the error beyond the noise, and of what is left: for the shape of the first
# cause it is little to miss, if what stands for that leaves as much of it
MOST = 0.5  # of what was left, that a cause leaves
NEARLY_ALL = 0.9  # of the error beyond the noise
UNTOLD = 2.0  # times the square that the belief leaves: then its end cannot be foretold
HARM = 1.2  # times the square of an error: a cause that makes more of it is none
SAME_LINE = 0.01  # of its frequency
FADED = 0.25  # of its size as found


@dataclass(frozen=True)
class Needed:
    """The causes of a path that are needed. `fits`: the chain from none of them to all, in the order of what they take,
    with its held-out squares and their excesses over the noise, N²; `whole`: its first and last fit on all the data."""

    fits: list[Fit]
    squares: list[float]
    excess: list[float]
    whole: tuple[Fit, Fit]
    floor_N: float


def needed(prepared: Prepared, path: Path, believed: Structure) -> Needed:
    """Those causes at a path's end that are needed, in their best shapes."""
    base = path.fits[0]
    final = reshaped(prepared.short, path.fits[-1], len(base.structure.causes))
    final = ordered(prepared, final, base, path.fits)
    floor = _floor(prepared, final)
    fits, squares, excess = _needed(prepared, path, final, floor)
    whole = _whole(prepared, fits, believed)
    while (gone := _gone(prepared.full, fits, whole[1], excess)) is not None:
        fits, squares, excess = _dropped(prepared, path, fits, gone, floor)
        whole = _whole(prepared, fits, believed)
    return Needed(fits, squares, excess, whole, floor)


def _needed(prepared: Prepared, path: Path, final: Fit, floor_N: float) -> tuple[list[Fit], list[float], list[float]]:
    """The chain of those causes that what was held out needs, with its held-out squares and excesses. `final`: all that
    were found, in their best shapes."""
    base = path.fits[0]
    apart = _flagged_square(prepared, base)

    def needless(fits: list[Fit], squares: list[float], excess: list[float]) -> int | None:
        if len(fits) < 2:
            return None
        slow = _slow_squares(prepared, fits, squares)
        number = _needless(prepared, fits, squares, excess, apart, slow, path)
        return _doubtful(path, fits, excess, apart, floor_N, slow) if number is None else number

    fits = chain(prepared, final, base, path.fits)
    squares, excess = excesses(prepared, fits, floor_N)
    number = needless(fits, squares, excess)
    milder = None
    if number is not None:  # it may be the shape that does harm, and not the cause
        for other in _milder(prepared, path, final):
            again = chain(prepared, ordered(prepared, other, base), base, path.fits)
            of_them = excesses(prepared, again, floor_N)
            if needless(again, *of_them) is None:
                milder = again, *of_them
                break
    while number is not None:
        fits, squares, excess = _dropped(prepared, path, fits, number, floor_N)
        number = needless(fits, squares, excess)
        if milder is not None and (number is not None or milder[1][-1] <= squares[-1]):
            return milder  # and not where without the cause what was held out is met better than with a worse shape
    return fits, squares, excess


def _milder(prepared: Prepared, path: Path, final: Fit) -> Iterator[Fit]:
    """The causes of a fit in the shapes in which they were found, and in the best that have no course in time; where
    those are others."""
    if set(shapes_of(final.structure)) != set(shapes_of(path.fits[-1].structure)):
        yield path.fits[-1]
    steady = steadier(prepared.short, final, len(path.fits[0].structure.causes))
    if steady is not final:
        yield steady


def _dropped(
    prepared: Prepared, path: Path, fits: list[Fit], number: int, floor_N: float
) -> tuple[list[Fit], list[float], list[float]]:
    """The chain without one of the causes found, with its held-out squares and excesses. What the others take may have
    another order then."""
    base = fits[0]
    left = without(prepared, fits[-1], len(base.structure.causes) + number, path.fits)
    fits = chain(prepared, ordered(prepared, left, base, path.fits), base, path.fits)
    return fits, *excesses(prepared, fits, floor_N)


def _slow_squares(prepared: Prepared, fits: list[Fit], squares: list[float]) -> list[float]:
    """What each step's cause leaves that is of the force's zero, found before and of another course (N²)."""
    shares = [of_slow_force(prepared.full, *step, fits[0]) for step in pairwise(fits)]
    return [share * square for share, square in zip(shares, squares[1:], strict=True)]


def _needless(
    prepared: Prepared, fits: list[Fit], squares: list[float], excess: list[float], apart: float, slow: list[float],
    path: Path,
) -> int | None:  # fmt: skip
    """Number of a cause that is of no use for what was held out, or does harm to what comes later; None: all are."""
    own = len(fits[0].structure.causes)
    floor = squares[-1] - excess[-1]
    scale = excess[0] + apart
    last = len(fits) - 2
    order = sorted(range(last + 1), key=lambda k: squares[k] - squares[k + 1])
    if squares[-1] >= squares[0]:  # all together foretell nothing
        return order[0]
    for k in order:
        taken, gain, left = squares[k] - squares[k + 1], excess[k] - excess[k + 1], excess[k]
        if k < last and gain <= FURTHER * scale and squares[k + 1] <= HARM * squares[k]:
            # of two that hide each other neither is of use alone; but neither does it harm
            alone = held_out_square(prepared, without(prepared, fits[-1], own + k))
            taken, gain, left = alone - squares[-1], max(alone - floor, 0.0) - excess[-1], max(alone - floor, 0.0)
        if taken <= 0.0:
            return k
        small = gain <= (LEAST if last == 0 else FURTHER) * scale
        most_left = k < 2 and gain >= MOST_LEFT * (left - slow[k]) and gain >= SPEAKS * prepared.floor_N**2
        most_left = most_left and (k == 0 or gain >= EXACT * scale)
        if small and not most_left and not (last and _told_by_the_end(prepared, path, fits, k)):
            return k
    plain = later_square(prepared, fits[0])
    not_told = plain > UNTOLD * squares[0]  # what comes early does not tell the pad itself
    least, doubted = min((_sure(path, fits, k), k) for k in range(last + 1)) if not_told else (1.0, 0)
    if not_told and least >= DOUBTED:
        return None
    later = later_square(prepared, fits[-1]) - 2.0 * prepared.floor_square_std
    if not_told:  # nor any cause, then, that helps with the end
        return doubted if later > plain else None
    if later <= HARM * plain and all(later <= HARM * later_square(prepared, fit) for fit in fits[1:-1]):
        return None
    # a drift that turns or ends is one, though its begin does not foretell that; nor does half of a course the rest
    causes = fits[-1].structure.causes[own:]
    untold = [
        (c.id == "force_drift" and excess[k] - excess[k + 1] > NEARLY_ALL * scale)
        or (c.form.has_a_course and excess[k + 1] < MOST * excess[k])
        for k, c in enumerate(causes)
    ]
    rest = [
        np.inf if untold[k] else later_square(prepared, without(prepared, fits[-1], own + k)) for k in range(last + 1)
    ]
    for k in range(last + 1):  # what it takes of all that was held out may be more than it does harm to the end alone
        if excess[k + 1] < MOST * excess[k] and squares[k] - squares[k + 1] > (1.0 - SEEN) * (later - rest[k]):
            rest[k] = np.inf
    best = int(np.argmin(rest))
    return best if later > HARM * rest[best] else None


def _told_by_the_end(prepared: Prepared, path: Path, fits: list[Fit], number: int) -> bool:
    """Whether a cause under a sure name takes most of what all others leave of what comes last: of what was held out
    amid the run it may take little, where that is where another cause comes in, whose size nothing else tells."""
    if _sure(path, fits, number) < NAMED:
        return False
    others = without(prepared, fits[-1], len(fits[0].structure.causes) + number)
    noise = prepared.floor_N**2
    left, after = later_square(prepared, others), later_square(prepared, fits[-1])
    taken = left - max(after, noise)
    return taken >= MOST_LEFT * (left - noise) and taken >= SPEAKS * noise


def _doubtful(
    path: Path, fits: list[Fit], excess: list[float], apart: float, floor_N: float, slow: list[float]
) -> int | None:
    """Number of a further cause whose name is hardly sure, and that takes little, and less than is left: what left the
    one may have left the other. Or whose name is most likely another, and that takes no large part. Or of one that
    takes next to nothing, and far less than the noise, under a name that may be another, where the rest is as good as
    explained without it: no shape is exact, and what it misses looks like something. So does any that is now more and
    now less in time, which may follow what the others' shapes miss wherever it stands. `apart`: what a channel's faults
    take (N²); where that is most, the first cause beside them is a further one too."""
    causes = fits[-1].structure.causes[len(fits[0].structure.causes) :]
    whole = excess[0] + apart
    for k in range(len(fits) - 1, 0 if apart > excess[0] else 1, -1):
        sure = _sure(path, fits, k - 1)
        taken, trace = excess[k - 1] - excess[k], TRACE * excess[0]
        nearly_all = taken + excess[-1] < 2.0 * trace
        if causes[k - 1].form.has_a_course and taken < trace and nearly_all:
            return k - 1
        if k == 1 and taken >= FAINT * floor_N**2:
            continue
        if sure < DOUBTED and _takes_little(excess, k, whole, slow[k - 1]):
            return k - 1
        if sure < UNLIKELY and taken < A_FIFTH * whole:
            return k - 1
        if sure < NAMED and taken < min(trace, FAINT * floor_N**2) and nearly_all:
            return k - 1
        if sure < DOUBTED and taken < min(OF_A_GIANT * excess[0], NO_LESS * excess[-1]):
            return k - 1
    return None


def _sure(path: Path, fits: list[Fit], number: int) -> float:
    """How sure one of the causes found is, by its name or by its kind."""
    named = [c.id for c in fits[-1].structure.causes[len(fits[0].structure.causes) :]]
    _, confidence, kind = sureness(path, named[number], named)
    return max(confidence, kind)


def _flagged_square(prepared: Prepared, fit: Fit) -> float:
    """Mean square that samples left out add to the error of a fit, N²."""
    full, at = prepared.full, prepared.at
    error = (full.force_N - force_at(full, fit.structure, fit.x))[at]
    return float(np.sum(error[full.weight[at] == 0.0] ** 2)) / max(len(at), 1) if (~prepared.good).any() else 0.0


def _floor(prepared: Prepared, final: Fit) -> float:
    """Noise of the data, N: as the holds tell it, or less where a model leaves less."""
    n = float(prepared.full.weight.sum())
    left = mean_square(prepared.full, final.structure, final.x) * n / max(n - final.free, 1.0)
    return min(prepared.floor_N, float(np.sqrt(left)))


def _whole(prepared: Prepared, fits: list[Fit], believed: Structure) -> tuple[Fit, Fit]:
    """First and last fit carried to the end on all the data, with the hum that the last one then has to make."""
    full, data, mains = prepared.full, prepared.full, prepared.mains
    before, last = onto(fits[0], full, 6, 1e-8), replace(fits[-1], x=missing_told(fits[-1], believed))
    after = None if mains is None else _with_hum(prepared, last, mains)
    if after is None:
        after = onto(last, full, 6, 1e-8)
    else:
        data = prepared.raw
    after = _spread(prepared, data, gauged(data, plainest(data, after, len(believed.causes))))
    if prepared.felt.total_N.any():
        before, after = placed(full, before), placed(data, after)
    return before, after


def _with_hum(prepared: Prepared, last: Fit, mains: Line) -> Fit | None:
    """A fit with the hum that it has to make beside; None where all together make next to none, and what swings in the
    holds does not in the rest (a ceiling's ripple)."""
    structure = last.structure.with_cause(hum_cause(_retimed(prepared, last, mains)))
    hum = structure.of_cause(len(structure.causes) - 1)
    own = structure.x(last.x[: len(structure.pad.coordinates)], None)[hum]
    after = refit(prepared.raw, structure, extended(last, own), 8, 1e-8)
    return after if structure.values(after.x)[-1]["amplitude"] >= FADED * mains.amplitude_N else None


def _retimed(prepared: Prepared, fit: Fit, mains: Line) -> Line:
    """The line by the times at which a fit has the forces felt. It was found by their stamps, and some parts in ten
    thousand of its frequency are a whole wave within a minute."""
    plant, raw = fit.structure.cascade(fit.x), prepared.raw
    if not plant.shifts_time:
        return mains
    felt_s, counted = plant.felt_at(raw.time_s), prepared.at[raw.weight[prepared.at] > 0.0]
    left_N = (raw.force_N - force_at(raw, fit.structure, fit.x))[counted]
    stamps, begins_s = felt_s[counted], float(min(felt_s[0], raw.time_s[0]))
    line = line_of(begins_s, [(stamps, left_N, left_N)], stamps, raw.force_N[counted])
    near = line is not None and abs(line.frequency_Hz / mains.frequency_Hz - 1.0) < SAME_LINE
    return line if line is not None and near and line.of_the_mains else mains


def _gone(full: Data, fits: list[Fit], whole: Fit, excess: list[float]) -> int | None:
    """Number of a cause that is none once all is fitted together; None: all are."""
    for number in (_faded(fits, whole), _untold(fits, whole, excess), _anothers(full, fits, whole, excess)):
        if number is not None:
            return number
    return None


def _faded(fits: list[Fit], whole: Fit) -> int | None:
    """Number of a cause of which next to nothing is left once all is fitted together, the hum too; None: there is
    none."""
    own = len(fits[0].structure.causes)
    before, after = fits[-1].structure.values(fits[-1].x), whole.structure.values(whole.x)
    for k, cause in enumerate(fits[-1].structure.causes[own:]):
        name = None if cause.amplitude is None else cause.amplitude.name
        if name is not None and abs(after[own + k][name]) < FADED * abs(before[own + k][name]):
            return k
    return None


def _untold(fits: list[Fit], whole: Fit, excess: list[float]) -> int | None:
    """Number of a further cause whose size is not told, and that takes little, and less than is left; None: there is
    none."""
    own = len(fits[0].structure.causes)
    for k in range(len(fits) - 1, 1, -1):
        if _takes_little(excess, k, excess[0]) and told_size(whole, own + k - 1) < DOUBTED:
            return k - 1
    return None


def _anothers(full: Data, fits: list[Fit], whole: Fit, excess: list[float]) -> int | None:
    """Number of a cause that does nothing, but split the steps in which others are worked out or stand for noise; or of
    a further one that takes little and is another's limit, with a number at its bound; None: there is none."""
    own, values = len(fits[0].structure.causes), whole.structure.values(whole.x)
    for k in range(len(fits) - 1, 0, -1):
        index = own + k - 1
        cause = whole.structure.causes[index]
        little = k > 1 and excess[k - 1] - excess[k] < LITTLE * excess[0]
        if no_size(full, whole, index) or (little and not cause.of_the_law and not within_bounds(cause, values[index])):
            return k - 1
    return None


def _takes_little(excess: list[float], step: int, scale: float, slow: float = 0.0) -> bool:
    """Whether a step of the chain takes little of `scale`, and less than is left beside what is `slow` (all N²)."""
    return excess[step - 1] - excess[step] < min(LITTLE * scale, excess[-1] - slow)


def _spread(prepared: Prepared, data: Data, fit: Fit) -> Fit:
    return replace(fit, spread=covariance(data, prepared.short, fit)) if fit.structure.causes else fit
