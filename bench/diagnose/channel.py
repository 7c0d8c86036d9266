"""Faults of the force channel, found in the samples themselves: stuck values, a ceiling, outliers.

Asked before any model, and again about what a model leaves: transients look like spikes against a wrong model.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student_t

from bench.identify.motion import holds
from bench.readings import copies, resolution, runs
from bench.recording.types import Measurement

from .coarse import coarse_repeats
from .stuck import CHANCE, FEW_REPEATS, LEAPS, equal_by_chance, no_accident, repeated, slowed

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

SETTLING = 20  # samples after a move that are not yet a hold
LEAVING = 3  # samples at the end of a hold that may already move
CROWDED = 3.0  # times as many outliers in moves as in holds: then those are none
NEARLY = 0.95  # of a ceiling
CEILING = 8  # samples in a row at the greatest force
AT_TOP = 3  # samples at the greatest force, where digits are so many that no reading repeats another
CALMED, AMID = 9, 0.3  # samples over which, and share of the usual change of slope below which, the noise has gone
TOP, DISTINCT = 0.8, 3  # of the greatest force: where a ceiling that gives way still is; and values that it passes
ELSEWHERE = 0.1  # of the share of calm samples near the greatest force, or of those at it that repeat each other: so
# many elsewhere mean no ceiling
FEW_BESIDE = 0.05  # of the samples at a ceiling that moves: so few others as high are at it too
WIDEST_KNEE, USUAL_KNEE = 0.5, 0.1  # of a ceiling, that a knee is wide at the most, and where the noise does not tell
AT_LAST = 0.75  # of a knee, where it is at its end
NARROWED, SLOW, JUMPS = 2.0, 4.0, 4.0  # usual second differences: below a ceiling, where any narrows the noise; that
# a slow force changes by; and the largest that count
BENT = 15.0  # logarithm of the likelihood that a width must gain over none to be known, or lose to be excluded
BESIDE = 5  # neighbours on either side that a stray sample is held against: bursts are shorter
ASIDE, CALM = 8, 0.6  # neighbours on either side of a force or a residual, and their share that a burst leaves alone
FAR = 6.0  # noise deviations that an outlier stands off at the least
COARSELY = 12.0  # the same, in a channel so coarse that no tail is foretold
FEW, ALONE = 3, 1.7  # outliers that are a fault; and times further off is one that is no fault, but no noise either
HEAPS = 3.0  # steps of a coarse channel within which its noise is
NEXT = 1.5  # steps: the value next to the one that stands is none that stands off, however seldom it comes
BULK = 9.0  # medians of the size: within some six deviations of white noise
DOUBT = 2.0  # of the logarithm of the likelihood of a tail: two standard deviations
DEGREES = np.array([2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 8.0, 11.0, 16.0, 30.0, 100.0])
FALSE_SHARE, SEVERAL = 0.05, 10  # of values beyond the limit that may be noise, where at least so many lie there
AROUND_S = 0.02  # either side of a sample, where its speed and acceleration are looked at
TOGETHER, ONE_WAY = 0.5, 0.5  # of strays, that have another beside them, or go with the motion: fewer do
BY_CHANCE = 2.5  # deviations of how often neighbours that stand off agree in sign, by chance
STEADY = 0.2  # of the way within `AROUND_S`, that a change of speed makes at the most
BURST, MOST_OF_THEM = 5, 0.9  # samples of a burst of strays at the most; and share of the bursts that are no longer
MOSTLY = 0.5  # of the samples that stand off
RARE = 0.01  # samples that the noise's own tail puts beyond an outlier's limit, in all the data


@dataclass(frozen=True)
class Faults:
    """Of each force sample (m,), whether it is at a ceiling, repeats the one before, or stands off. `bent`: below a
    ceiling that is or may be not sharp, where it is no fault yet and not quite the force either: left out, and not
    flagged. `limit_N`: the ceiling, where there is one. `stuck_share`: share that sticks, where single samples cannot
    all be told."""

    saturated: Mask
    stuck: Mask
    outlier: Mask
    bent: Mask
    limit_N: float | None = None
    stuck_share: float | None = None
    unsure: Mask | None = None
    """Samples that stand off in moves: strays, or transients that no model has made yet."""

    @property
    def by_itself(self) -> Mask:
        """Samples that tell nothing of the force, whatever a model may say of them."""
        return self.saturated | self.stuck | self.bent

    @property
    def good(self) -> Mask:
        """Samples that tell of the force."""
        return ~(self.by_itself | self.outlier)

    @property
    def flagged(self) -> Mask:
        """Samples that a fault has made."""
        return self.saturated | self.stuck | self.outlier


def faults(force_N: Array) -> Faults:
    """What the samples (m,) show by themselves."""
    none = np.zeros(len(force_N), dtype=bool)
    if len(force_N) < 30:
        return Faults(none, none, none, none)
    saturated, limit = _ceiling(force_N)
    yielding, top = _yielding(force_N)
    saturated, limit = saturated | yielding, top if limit is None else limit
    bent = none
    if limit is not None:
        bent, ended = _knee(force_N, saturated, limit)
        saturated, bent = saturated | ended, bent & ~(saturated | ended)
    # just below a ceiling that is not sharp a channel repeats itself too
    ended = saturated if limit is None else saturated | (force_N * np.sign(limit) > NEARLY * abs(limit))
    stuck = copies(force_N) & ~ended
    if not stuck.any():
        stuck = repeated(force_N, ended) | slowed(force_N, ended)
    halted, share = coarse_repeats(force_N, ended | stuck)
    if not stuck.any():
        stuck = halted
    outlier = _spikes(force_N, ~(saturated | stuck))
    if limit is not None:  # nothing is read beyond a ceiling
        outlier |= (force_N * np.sign(limit) > abs(limit) * (1.0 + 1e-9)) & ~saturated
    again = _stray_again(force_N, outlier, stuck)
    return Faults(
        saturated, stuck & ~again, outlier | again, bent & ~(stuck | outlier | again), limit,
        share if stuck is halted else None,
    )  # fmt: skip


def _stray_again(force: Array, outlier: Mask, stuck: Mask) -> Mask:
    """Stuck samples that say a stray value again, and samples with the one value that stray ones have where readings
    have many digits: what is read when nothing is there."""
    first, length = runs(force)
    return (np.repeat(outlier[first], length) & stuck) | (_one_value(force, outlier) & ~outlier)


def _one_value(force: Array, outlier: Mask) -> Mask:
    """Samples with a value that stray ones have again and again, where readings have many digits."""
    values, count = np.unique(force[outlier], return_counts=True)
    if resolution(force) == 0.0 and no_accident(int(count.max(initial=0)), equal_by_chance(force)):
        return np.isin(force, values[count >= FEW_REPEATS])
    return np.zeros(len(force), dtype=bool)


def _ceiling(force: Array) -> tuple[Mask, float | None]:
    """Samples at the greatest (or least) value, where many in a row share it and nothing is beyond but a few strays; or
    a few, in a channel in which next to no other two in a row are equal."""
    mask, step = np.zeros(len(force), dtype=bool), resolution(force)
    first, length = runs(force)
    span = float(np.ptp(force))
    if span == 0.0:
        return mask, None
    long = length >= CEILING
    spike = _spikes(force, ~np.repeat(long, length)) if long.any() else mask
    for sign in (1.0, -1.0):
        top = float((sign * force[first[long]]).max()) if long.any() else float((sign * force).max())
        if top < 0.05 * span:  # the least of forces that all push is no ceiling
            continue
        at = np.abs(sign * force[first] - top) <= 1e-9 * span
        beyond = (sign * force > top + 1e-9 * span) & ~spike
        others = length[~at] if (~at).any() else np.ones(1)
        # Elsewhere runs are as long as resolution and noise make them: a ceiling's are of another size.
        longest = max(CEILING, 3.0 * float(np.quantile(others, 0.999)))
        # a coarse channel below a ceiling that is not sharp says one value for long, and the next one for a while
        near = at | (np.abs(sign * force[first] - top) < NEXT * step)
        for told in (at, near):
            if length[told].max() >= longest and beyond.sum() <= FEW_BESIDE * int(length[told].sum()):
                return np.repeat(told, length), sign * top
        held = np.repeat(at, length)
        repeats = int((others - 1).sum())
        if (
            others.max() < AT_TOP
            and repeats <= ELSEWHERE * held.sum()
            and not beyond.any()
            and _tops(sign * force, top, held)
        ):
            return held, sign * top
    return mask, None


def _tops(force: Array, top: float, at: Mask) -> bool:
    """Whether samples (m,) at the greatest force share one value in a channel in which hardly others in a row do, with
    forces beside them that lead there: what sticks does so anywhere, and a stray stands alone."""
    if int(at.sum()) < AT_TOP or resolution(force) > 0.0:
        return False
    beside = (at[:-2] | at[2:]) & ~at[1:-1]
    return bool(beside.any()) and float(np.median(force[1:-1][beside])) > TOP * top


def _yielding(force: Array) -> tuple[Mask, float | None]:
    """Samples at a ceiling that moves, as one that gives way under load does: near the greatest (or least) force, on
    a path without the noise that there is elsewhere. The limit is the furthest of them.
    """
    mask, step = np.zeros(len(force), dtype=bool), resolution(force)
    bend = np.abs(np.diff(force, 2))
    usual = float(np.mean(np.minimum(bend, np.quantile(bend, 0.9))))
    if usual == 0.0:
        return mask, None
    calm = np.zeros(len(force), dtype=bool)
    calm[1:-1] = np.convolve(bend, np.ones(CALMED) / CALMED, mode="same") < AMID * usual
    calm[: CALMED // 2 + 1] = calm[len(force) - CALMED // 2 - 1 :] = False
    near = max(1.001 * step, AMID * usual)  # digits of a file are cut off
    change = np.diff(force)
    calm[1:] &= np.abs(change) <= near
    for sign in (1.0, -1.0):
        top = float((sign * force).max())
        if top < 0.05 * float(np.ptp(force)):
            continue
        high = sign * force > TOP * top
        if calm[~high].sum() * high.sum() > ELSEWHERE * calm[high].sum() * (~high).sum():
            continue  # so calm is this channel wherever it rests
        inside = (calm & high).astype(np.int8)
        edges = np.flatnonzero(np.diff(np.concatenate([[0], inside, [0]]))).reshape(-1, 2)
        for first, last in edges.tolist():
            core = force[first:last]
            # a value that only stays the same sticks: it is what is beside it that must be calm
            at, long = runs(core)
            k = int(np.argmax(long))
            begin, within = first + at[k], max(int(long[k]) - 2, 0)
            apart = np.concatenate([bend[first - 1 : begin], bend[begin + within : last - 1]])
            if len(apart) < CEILING or len(long) < DISTINCT:
                continue
            quiet = float(np.mean(apart)) / usual
            if len(apart) * np.log(max(quiet, 1e-3)) > np.log(CHANCE) - 4.0:
                continue  # noise is as quiet as that by chance
            slope = float(np.median(np.diff(core))) if step == 0.0 else 0.0
            while first > 0 and abs(change[first - 1] - slope) <= near:
                first -= 1
            while last < len(force) and abs(change[last - 1] - slope) <= near:
                last += 1
            mask[first:last] = True
        if mask.any():
            mask |= sign * force >= top - 1e-9 * float(np.ptp(force))
            # where it bears for a moment only, its calm does not show
            beyond = sign * force >= float((sign * force[mask]).min())
            return (mask | beyond if (beyond & ~mask).sum() <= FEW_BESIDE * mask.sum() else mask), sign * top
    return mask, None


def _knee(force: Array, saturated: Mask, limit: float) -> tuple[Mask, Mask]:
    """Samples below a ceiling that bends the force towards it, or may do so; and those that it is known to bend most.

    The noise tells: it comes through with the slope of the knee. That is taken for 1 − u², u from 0 at the knee's begin
    to 1 at the ceiling, as of a hyperbolic tangent. How wide the knee is has a likelihood, by exponential sizes of the
    second differences. Close below the ceiling a sharp one, too, narrows the noise. What a sample's neighbours are says
    whether it is within: by its own force those left would be the lower ones of a hold.
    """
    y, top = force * np.sign(limit), abs(limit)
    bend = np.abs(np.diff(force, 2))
    usual = max(float(np.mean(np.minimum(bend, np.quantile(bend, 0.9)))), 1e-9 * top)
    level = (y[:-2] + y[1:-1] + y[2:]) / 3.0
    free = ~(saturated[:-2] | saturated[1:-1] | saturated[2:])
    free &= np.abs(y[2:] - y[:-2]) < SLOW * usual  # where the motion does not make the differences
    use = free & (level > (1.0 - WIDEST_KNEE) * top) & (level < top - NARROWED * usual)
    size, way = np.minimum(bend[use] / usual, JUMPS), (top - level[use]) / top
    widths = np.geomspace(1e-3, WIDEST_KNEE, 40)
    slope = [np.maximum(1.0 - np.clip(1.0 - way / width, 0.0, 1.0) ** 2, 0.05) for width in widths]
    costs = np.array([float(np.sum(size / s + np.log(s) - size)) for s in slope])
    if costs.min() < -BENT:
        width = float(widths[np.argmin(costs)])
        ended = 1.0 - (top - y) / (width * top) > AT_LAST
        return (_beside(y) > top * (1.0 - width)) | ended, ended
    unsure = widths[(costs < BENT) & (widths <= USUAL_KNEE)]
    return _beside(y) > top * (1.0 - float(unsure.max(initial=0.0))), np.zeros(len(force), dtype=bool)


def _beside(force: Array) -> Array:
    """Median of each sample's neighbours, without itself (m,)."""
    return np.asarray(np.median(_neighbours(force, ASIDE), axis=0))


def _neighbours(values: Array, reach: int) -> Array:
    """Of each value (m,) the others up to so many away on either side (2 reach, m), mirrored at the ends."""
    padded = np.pad(values, reach, mode="reflect")
    return np.stack([padded[k : k + len(values)] for k in range(2 * reach + 1) if k != reach])


def _spikes(force: Array, good: Mask) -> Mask:
    """Single samples (or two) far off a line between their neighbours, with no such step beside them."""
    mask = np.zeros(len(force), dtype=bool)
    index = np.flatnonzero(good)
    y = force[index]
    if len(y) < 30:
        return mask
    noise = 1.4826 * float(np.median(np.abs(np.diff(y, 2) - np.median(np.diff(y, 2))))) / np.sqrt(6.0)
    noise = max(noise, resolution(force) / np.sqrt(12.0), 1e-12)
    around = _neighbours(y, BESIDE)
    middle = np.median(around, axis=0)
    spread = np.sort(around, axis=0)
    reach = spread[-3] - spread[2]  # in a move the neighbours themselves lie apart
    off = np.abs(y - middle)
    quiet = reach <= np.quantile(reach, 0.5)  # in holds the differences are noise alone
    limit = far((y - middle)[quiet])
    if not np.isfinite(limit):  # most of a coarse channel's values are the one between their neighbours
        limit = max(COARSELY * _of_the_heaps(y - middle, resolution(force)), LEAPS * resolution(force))
    limit = max(limit, FAR * noise)
    mask[index[_beyond(off, np.full(len(y), limit), 2.0 * reach)]] = True
    return mask


def _beyond(off: Array, limit: Array, reach: Array) -> Mask:
    """Which distances (n,) are beyond a limit (n,) and what the neighbours differ by (n,): of one or two alone those
    that are far beyond, as the tail of noise is not known that well, and the noise of a channel often has one."""
    beyond = off > limit + reach
    return beyond if beyond.sum() >= FEW else beyond & (off > ALONE * limit + reach)


def far(values: Array) -> float:
    """Distance from 0 beyond which a value (n,) is no noise, by the tail its bulk foretells (Student's t); infinite
    where most values are 0.

    Degrees and scale are those under which the values within `BULK` medians are likeliest, counted in bins: what lies
    further out has no say.
    """
    size = np.abs(values)
    q50 = float(np.median(size))
    if q50 <= 0.0:
        return np.inf
    edges = np.concatenate([np.linspace(0.0, 4.0, 33), np.linspace(4.0, BULK, 15)[1:]])
    counts = np.histogram(size / q50, edges)[0]
    shrinks = np.linspace(0.85, 1.15, 25)  # of the scale that the median tells
    degrees, shrink = np.meshgrid(DEGREES, shrinks, indexing="ij")
    scale = shrink / np.asarray(student_t.ppf(0.75, DEGREES))[:, None]
    within = np.asarray(student_t.cdf(edges / scale[..., None], degrees[..., None]))
    shares = np.diff(within, axis=-1) / (within[..., -1:] - 0.5)
    likelihood = np.sum(counts * np.log(np.maximum(shares, 1e-300)), axis=-1)
    # of the tails that the bulk allows the heaviest, with the scale that suits it
    allowed_tails = np.flatnonzero(likelihood.max(axis=1) >= likelihood.max() - DOUBT)
    heaviest = int(allowed_tails[0])
    best = heaviest, int(np.argmax(likelihood[heaviest]))
    # beyond it noise alone puts less than one value in a hundred such data, or a small share of those that lie there
    unit = q50 * float(scale[best])
    beyond = np.sort(size[size > FAR * unit])[::-1] / unit
    foretold = 2.0 * len(values) * np.asarray(student_t.sf(beyond, degrees[best]))
    allowed = np.flatnonzero(foretold <= FALSE_SHARE * np.arange(1, len(beyond) + 1))
    rare = float(student_t.isf(RARE / len(values) / 2, degrees[best]))
    if len(allowed) >= SEVERAL:
        rare = min(rare, float(beyond[allowed[-1]]) * (1.0 - 1e-9))
    return unit * max(rare, FAR)


def not_of_the_motion(m: Measurement, found: Faults) -> Faults:
    """Without the outliers in moves, where these have many more than the holds: transients that no model made yet.
    A value that comes again and again is no transient's."""
    if not found.outlier.any():
        return found
    still = resting(m)
    in_holds = (found.outlier & still).sum() / max(still.sum(), 1)
    in_moves = (found.outlier & ~still).sum() / max((~still).sum(), 1)
    if still.sum() > 50 and in_moves > CROWDED * in_holds + 2.0 / max((~still).sum(), 1):
        kept = found.outlier & (still | _one_value(m.force_N, found.outlier))
        return replace(found, outlier=kept, unsure=found.outlier & ~kept)
    return found


def resting(m: Measurement) -> Mask:
    """Force samples (m,) in holds, once these have settled."""
    still = np.zeros(len(m.force_N), dtype=bool)
    for s in holds(m.position_time_s, m.position_mm):
        first, last = np.searchsorted(m.force_time_s, [m.position_time_s[s.start], m.position_time_s[s.stop - 1]])
        settled = int(first) + min(int(last - first) // 4, SETTLING)
        still[settled : max(settled, int(last) - LEAVING)] = True
    return still


def standing_off(residual: Array, good: Mask, suspect: Mask, step_N: float) -> Mask:
    """Outliers against a model: residuals (m,), single or in short bursts, far beyond most of their neighbours'.

    `suspect` (m,): those that stood off before there was a model, and for which half the distance is enough; `step_N`:
    of the channel, which noise of that size comes in.
    """
    mask = np.zeros(len(residual), dtype=bool)
    index = np.flatnonzero(good)
    if len(index) < 30:
        return mask
    e = residual[index]
    around = _neighbours(e, ASIDE)
    middle = np.median(around, axis=0)
    calm = np.quantile(np.abs(around - middle), CALM, axis=0)
    limit = far(e - middle)
    # where a step is as large as the noise, values come in heaps, of which no tail is foretold
    coarse = max(FAR * _of_the_heaps(e - middle, step_N), NEXT * step_N)
    limits = np.maximum(np.where(suspect[index], 0.5, 1.0) * limit, coarse)
    reach = 3.0 * np.maximum(calm - float(np.median(calm)), 0.0)
    mask[index[_beyond(np.abs(e - middle), limits, reach)]] = True
    return mask


def _of_the_heaps(values: Array, step_N: float) -> float:
    """RMS of those values (n,) that are noise in a channel of such steps; 0 where none are."""
    heaps = values[np.abs(values) <= HEAPS * step_N]
    return float(np.sqrt(np.mean(heaps**2))) if len(heaps) else 0.0


def of_the_model(modelled: Array, errors: Array, off: Mask) -> Mask:
    """Which of some samples `off` (m,) stand off by less than a spike that the model has there, where most of them do:
    when exactly it comes is not known that well. `modelled`, `errors` (m,): the model's force and what it leaves, N."""
    bend = np.pad(np.abs(np.diff(modelled, 2)), 2)
    spike = np.maximum(np.maximum(bend[:-2], bend[1:-1]), bend[2:])
    own = off & (np.abs(errors) < spike)
    return own if own.sum() > MOSTLY * off.sum() else np.zeros(len(off), dtype=bool)


def strays(m: Measurement, errors: Array, off: Mask) -> bool:
    """Whether samples `off` (m,) stand off alone, and up or down as it comes: what a motion makes lasts, or goes with
    its speed or its acceleration. `errors` (m,): what a model leaves of the force, N."""
    at = np.flatnonzero(off)
    if len(at) < SEVERAL:
        return False
    beside = off[np.maximum(at - 1, 0)] | off[np.minimum(at + 1, len(off) - 1)]
    x = [
        np.interp(m.force_time_s[at] + shift, m.position_time_s, m.position_mm) for shift in (-AROUND_S, 0.0, AROUND_S)
    ]
    sign, turn = np.sign(errors[at]), x[2] - 2.0 * x[1] + x[0]
    with_speed, with_acceleration = (abs(float(np.mean(sign * np.sign(way)))) for way in (x[2] - x[0], turn))
    # what a motion makes begins where that changes
    steady = np.abs(turn) < STEADY * (np.abs(x[2] - x[1]) + np.abs(x[1] - x[0]))
    in_bursts = float(np.mean(steady)) > MOSTLY and _in_bursts(errors, off)
    apart = float(np.mean(beside)) < TOGETHER or _as_it_comes(np.sign(errors) * off) or in_bursts
    return apart and max(with_speed, with_acceleration) < ONE_WAY


def _as_it_comes(sign: Array) -> bool:
    """Whether of samples (m,) that stand off (0: does not) neighbours, and next neighbours, agree in sign about as
    often as not: what lasts keeps its sign, and what rings turns it in one of the two."""
    next_, over_next = (sign[lag:] * sign[:-lag] for lag in (1, 2))
    told = [(int(np.count_nonzero(both)), abs(float(both.sum()))) for both in (next_, over_next)]
    return told[0][0] >= SEVERAL and all(total <= BY_CHANCE * np.sqrt(count) for count, total in told)


def _in_bursts(errors: Array, off: Mask) -> bool:
    """Whether samples (m,) that stand off do so for a few at once, and these up or down as it comes from one time to
    the next, and the next but one: as a mode rings, its half waves turn each time."""
    begins, ends = np.flatnonzero(np.diff(np.pad(off.astype(np.int8), 1))).reshape(-1, 2).T
    if len(begins) < SEVERAL or float(np.quantile(ends - begins, MOST_OF_THEM)) > BURST:
        return False
    total = np.concatenate([[0.0], np.cumsum(np.where(off, errors, 0.0))])
    sign = np.sign(total[ends] - total[begins])
    return all(abs(float(sign[lag:] @ sign[:-lag])) <= BY_CHANCE * np.sqrt(len(sign)) for lag in (1, 2))
