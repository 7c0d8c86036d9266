"""From a search to a verdict: gains on held-out data, order, rivals, confidence, words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from .data import Data, Prepared
from .evidence import CRUMB, RIVAL, tempered, unexplained
from .held_out import held_out_square
from .late import LATE
from .noise import Colour
from .numbers import Cause, shapes_of
from .path import Measure, Path, Trial
from .refit import Fit, chi2, force_at, reduced, refit
from .result import Alternative, CauseFound, Number
from .search import Search
from .shapes import departed
from .way import TOLD_ONCE, most_sure

EXPLAINED = 0.25  # of the error: what surely named causes may leave
SURELY = 4.0  # deviations by which the squares of two fits differ
UNSEEN = 0.2  # of the noise power: what no test of structure sees of what is left; so far off may the noise be told
SOME, MUCH = 0.002, 0.3  # of the noise power: what a test of structure sees something in; and that, though noise of a
# long memory might have left as much
TOLD_SIZE = 0.25  # of a cause's size, that its standard deviation may be for a sure name
UNFELT = 16.0  # of χ²
NOTHING = 0.1  # of its standard deviation, that a size is
HARDLY = 0.3  # sure of a name
SLIGHT, SLIGHTLY = 0.02, 0.65  # of the error: how sure a cause that takes less beside another can be. In a campaign two
# of three were right, and what the others took was missing from the first one's shape
ANOTHERS = 0.5  # how sure the name of a cause can be that is as far from its family's first shape as it can go
BEGUN = 0.02  # of a cause's size, with which it begins anew
ONCE = "too little comes twice in this run"
BESIDE = "it takes next to nothing beside the others, and what their shapes miss can look like it"
FAR_OFF = "its shape is so far from the usual one that it may stand for another cause"
MANY = 3  # causes, as many as a search finds: so many together imitate what none of them is


def ordered(prepared: Prepared, fit: Fit, base: Fit, known: Sequence[Fit] = ()) -> Fit:
    """The causes in the order of what leaving each one out would cost, in χ²: what a mass feels of the encoder's noise
    counts little. That of the noise's colour counts for nothing, as in what is stated of each. `known`: as in
    `without`."""
    own = len(base.structure.causes)
    number = len(fit.structure.causes)
    if number - own < 2:
        return fit
    plain = replace(prepared.short, colour=Colour())
    costs = []
    for index in range(own, number):
        left = without(prepared, fit, index, known, 15)
        costs.append(chi2(plain, left.structure, left.x))
    order = list(range(own)) + [own + int(k) for k in np.argsort(-np.array(costs), kind="stable")]
    structure = replace(fit.structure, causes=tuple(fit.structure.causes[i] for i in order))
    values = fit.structure.values(fit.x)
    pad = fit.x[: len(fit.structure.pad.coordinates)]
    return refit(prepared.short, structure, structure.x(pad, [values[i] for i in order], fit.of_run), 8, 1e-8)


def without(prepared: Prepared, fit: Fit, index: int, known: Sequence[Fit] = (), steps: int = 30) -> Fit:
    """The fit without one of its causes. `known`: fits of before: from one of the same causes in the same shapes it may
    be better, for what stood beside a cause can have led it far from where it is alone."""
    structure, x = reduced(fit, index)
    shapes = shapes_of(structure)
    begun = [(structure, x)]
    begun += [(f.structure, f.x) for f in known if shapes_of(f.structure) == shapes]
    return min((refit(prepared.short, s, at, steps, 1e-8) for s, at in begun), key=lambda f: f.chi2)


def chain(prepared: Prepared, fit: Fit, base: Fit, known: Sequence[Fit] = ()) -> list[Fit]:
    """Fits of the believed structure, with the first cause, with two …, up to all. `known`: as in `without`."""
    own = len(base.structure.causes)
    fits = [fit]
    while len(fits[-1].structure.causes) > own + 1:
        fits.append(without(prepared, fits[-1], len(fits[-1].structure.causes) - 1, known))
    if len(fit.structure.causes) == own:
        return [base]
    out = [base]
    for after in reversed(fits):
        out.append(_no_worse(prepared, out[-1], after))
    return out


def _no_worse(prepared: Prepared, before: Fit, after: Fit) -> Fit:
    """A fit with one cause more than another, and no worse: where what stood beside the cause has led it into a valley
    that is, it begins anew, faint, where the other fit is."""
    size = after.structure.causes[-1].amplitude
    if after.chi2 <= before.chi2 or size is None:
        return after
    values = [*before.structure.values(before.x), after.structure.values(after.x)[-1]]
    values[-1] = {**values[-1], size.name: BEGUN * values[-1][size.name]}
    x = after.structure.x(before.x[: len(before.structure.pad.coordinates)], values, before.of_run)
    return min(after, refit(prepared.short, after.structure, x, 30, 1e-8), key=lambda f: f.chi2)


def excesses(prepared: Prepared, fits: Sequence[Fit], floor_N: float) -> tuple[list[float], list[float]]:
    """(held-out mean squares, those less the noise floor's square), N²; what is within chance of 0 counts as 0, unless
    a later fit takes it off: two fits share their noise, and their difference is far surer than the floor."""
    squares = [held_out_square(prepared, fit) for fit in fits]
    n, memory = float(prepared.full.weight.sum()), prepared.colour.memory
    # what is far off stands in few samples too: of those alone nothing is within chance
    noise_std = max(prepared.floor_square_std, floor_N**2 * min(_square_std(prepared, fits[-1]), 0.5 * UNSEEN))
    out = []
    for number, (square, fit) in enumerate(zip(squares, fits, strict=True)):
        doubt = 2.0 * noise_std + floor_N**2 * 2.0 * fit.free * memory / n
        excess = square - floor_N**2
        joined = number == 0 and len(fits) > 1
        out.append(max(excess, 0.0) if joined or excess > doubt else 0.0)
    for k in range(len(fits) - 2, 0, -1):
        taken = squares[k] - squares[k + 1]
        if taken <= CRUMB * floor_N**2:
            continue
        chance = 2.0 * floor_N * float(np.sqrt(taken * _memory_of_step(prepared, fits[k], fits[k + 1]) / n))
        if taken > SURELY * chance:  # of 2 Σ e Δ/n, Δ between the two fits
            out[k] = max(out[k], out[k + 1] + taken)
    return squares, out


def _memory_of_step(prepared: Prepared, before: Fit, after: Fit) -> float:
    """Samples that say the same as one of what the step from one fit to the next changes: noise of a long memory hides
    what is slow, and not what is quick."""
    full, colour = prepared.full, prepared.colour
    if colour.memory == 1.0:
        return 1.0
    change = force_at(full, after.structure, after.x) - force_at(full, before.structure, before.x)
    return colour.memory_of(change[full.weight > 0])


def seen(excess: Sequence[float], floor_N: float) -> list[float]:
    """Excesses over the noise, N², where no test of structure sees anything in what is left: little of that is noise
    too, of which the holds have told too little."""
    left = excess[-1] if excess[-1] < UNSEEN * floor_N**2 else 0.0
    return [max(e - left, 0.0) for e in excess]


def speaks(excess_N2: float, square_N2: float, floor_N: float) -> bool:
    """Whether what is left, of which no cause is named, is enough where a test of structure sees something in it: its
    excess over what may be chance, or the mean square itself, for the test has reckoned with chance in its own way."""
    return excess_N2 > SOME * floor_N**2 or square_N2 > (1.0 + MUCH) * floor_N**2


def floor_told(before_N: float, after_N: float, left: float, floor_N: float) -> float:
    """The noise floor, N, for which `left` is what the errors on held-out data, before and after, leave beyond it. What
    was taken for noise counts as noise; where that is not near the floor known, this one stands."""
    square = (after_N**2 - left * before_N**2) / (1.0 - left) if left < 1.0 else 0.0
    told = float(np.sqrt(max(square, 0.0)))
    return told if abs(told**2 / floor_N**2 - 1.0) < UNSEEN else floor_N


def _square_std(prepared: Prepared, fit: Fit) -> float:
    """Standard deviation of a mean square, over that mean square: as the scatter of what a fit leaves tells, whose
    tails may be heavy."""
    full = prepared.full
    left = (full.force_N - force_at(full, fit.structure, fit.x))[full.weight > 0] ** 2
    scatter = float(np.std(left)) / max(float(np.mean(left)), 1e-300)
    return scatter * float(np.sqrt(prepared.colour.memory / max(len(left), 1)))


def explains(left: float, causes: Sequence[CauseFound], once: bool = False) -> bool:
    """Whether causes explain an error of which a share is left: they may leave less, the less sure they are, but for
    those that take next to nothing; and many of them, of which one is hardly sure, explain nothing. Nor does a name
    that acts with the motion where that went one way `once`: it has not beaten an odd pad, which no list of causes
    has. Nor do causes of which one alone leaves as much again as there was: they but stand against each other."""
    if min((c.gain for c in causes), default=0.0) < -1.0:
        return False
    sure = min((max(c.confidence, c.of_its_kind) for c in causes if c.gain >= SLIGHT), default=1.0)
    if len(causes) >= MANY and sure < HARDLY or once and sure <= TOLD_ONCE:
        return False
    return left <= EXPLAINED * sure * (0.5 if len(causes) >= MANY else 1.0)


def alternatives(
    measure: Measure, fit: Fit, rivals: Sequence[Trial], named: Sequence[str] = ()
) -> tuple[list[Alternative], float, float]:
    """(those that the data cannot exclude, and the strongest rival; confidence in the name, and in its kind).

    `named`: causes that were found too, and do not make each other doubtful.
    """
    best = fit.chi2
    # what the family's shape leaves counts as noise when names are compared: no shape is exact
    scale = max(best / max(measure.expected, 1.0), 1.0) * np.sqrt(measure.memory)
    gained = max(measure.before - best, 1e-12)
    out: list[Alternative] = []
    odds, of_others = 0.0, 0.0
    late = fit.structure.causes[-1].id in LATE
    for t in rivals:
        delta = t.fit.chi2 - best
        extra = t.fit.free - fit.free
        effective = delta / scale + extra * np.log(measure.effective)
        share = float(np.clip((measure.before - t.fit.chi2) / gained, 0.0, 1.0))
        excluded = bool(effective > RIVAL and share < 0.995)
        ratio = float(delta) / (unexplained(best, measure.expected) + 1.0)
        if t.id in named:
            continue
        likely = float(np.exp(-0.5 * min(max(tempered(effective, share, ratio), 0.0), 200.0)))
        odds += likely
        of_others += 0.0 if late and t.id in LATE else likely
        if not excluded or not out:
            out.append(Alternative(t.id, t.cause.form.name, share, float(delta), excluded))
    return out, 1.0 / (1.0 + odds), 1.0 / (1.0 + of_others)


def sureness(path: Path, id_: str, named: Sequence[str]) -> tuple[list[Alternative], float, float]:
    """`alternatives` of a cause that a search has found; `named`: all that were."""
    stage = path.stage_of(id_)
    if stage is None:
        return [], 0.5, 0.5
    trial, rivals, measure = stage
    return alternatives(measure, trial.fit, rivals, named)


def described(fit: Fit, index: int) -> tuple[str, str, dict[str, Number]]:
    """(id, form, numbers with standard errors) of a cause of a fit on all the data."""
    cause = fit.structure.causes[index]
    covariance = fit.covariance()
    at = fit.structure.of_cause(index)
    values = fit.structure.values(fit.x)[index]
    out: dict[str, Number] = {}
    position = at.start
    for p in cause.form.parameters:
        if p.fixed:
            out[p.name] = Number(values[p.name], p.unit, float("nan"))
            continue
        spread = float(np.sqrt(max(covariance[position, position], 0.0)))
        coordinate = fit.structure.coordinates[position]
        scale = values[p.name] if coordinate.logarithmic else coordinate.unit
        inside = coordinate.lower < fit.x[position] < coordinate.upper
        out[p.name] = Number(values[p.name], p.unit, abs(scale) * spread if inside and spread > 0 else float("nan"))
        position += 1
    return cause.id, cause.form.name, out


def found(search: Search, path: Path, final: Fit, gains: Sequence[float]) -> list[CauseFound]:
    """The causes as the result has them. `final`: polished on all the data."""
    own = len(search.believed.causes)
    named = [c.id for c in final.structure.causes[own : own + len(gains)]]
    out = []
    for k, gain in enumerate(gains):
        others, confidence, kind = sureness(path, named[k], named)
        id_, form, numbers = described(final, own + k)
        cause = final.structure.causes[own + k]
        values = {name: number.value for name, number in numbers.items()}
        most, doubt = _at_the_most(search, final, own + k, gain, len(gains))
        doubt = doubt if most < confidence else ""
        sure, kind, told = min(confidence, most), min(kind, most), explain(cause.effect, values)
        out.append(CauseFound(id_, form, numbers, gain, sure, others, told, cause.effect.check, kind, doubt))
    return out


def _at_the_most(search: Search, final: Fit, index: int, gain: float, named: int) -> tuple[float, str]:
    """(how sure the name of a fit's cause, of so many `named`, can be whatever its rivals reach; and what keeps it from
    more)."""
    cause = final.structure.causes[index]
    limits = [
        (told_size(final, index), _of_the_size(final, index)),
        (most_sure(cause.effect, cause.form.name, search.reach.rich), ONCE),
        (SLIGHTLY if named > 1 and gain < SLIGHT else 1.0, BESIDE),
        (ANOTHERS if departed(search.short, final, index) else 1.0, FAR_OFF),
    ]
    return min(limits, key=lambda limit: limit[0])


def _of_the_size(final: Fit, index: int) -> str:
    """What is wrong with the size of a fit's cause where its name cannot be sure."""
    size = final.structure.causes[index].amplitude
    if size is None:
        return ""
    at = 1e-6 * (size.upper - size.lower)
    inside = size.lower + at < final.structure.values(final.x)[index][size.name] < size.upper - at
    return f"these data hardly tell its {size.name}" if inside else f"its {size.name} is as far as it is sought here"


def told_size(final: Fit, index: int) -> float:
    """How sure the name of a fit's cause can be at the most, as its size is told."""
    cause, numbers = final.structure.causes[index], described(final, index)[2]
    size = cause.amplitude
    if size is not None and size.name in numbers:
        number = numbers[size.name]
        numbers = {**numbers, size.name: replace(number, std=number.std * _given_its_course(final, index, size.name))}
    return _of_its_size(cause, numbers)


def _given_its_course(final: Fit, index: int, name: str) -> float:
    """By what a number of a fit's cause is better told where its course is given: half waves over the data tell when
    the cause was how large, and any one time's share of that is told less well than all of it."""
    fitted, at = final.structure.causes[index].fitted, final.structure.of_cause(index)
    own = at.start + [p.name for p in fitted].index(name)
    waves = [at.start + k for k, p in enumerate(fitted) if p.spread is not None]
    covariance = final.covariance()
    std = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    if not waves or std[own] == 0.0:
        return 1.0
    chosen = [own, *(k for k in waves if std[k] > 0.0)]
    shared = covariance[np.ix_(chosen, chosen)] / np.outer(std[chosen], std[chosen])
    return float(1.0 / np.sqrt(max(np.linalg.pinv(shared, rcond=1e-9)[0, 0], 1.0)))


def no_size(data: Data, final: Fit, index: int) -> bool:
    """Whether a fit's cause does nothing: its size is nothing, or far within its own deviation and not felt in the
    force either. One that is felt has numbers of its shape that are hardly told, and it is that."""
    size, numbers = final.structure.causes[index].amplitude, described(final, index)[2]
    if size is None or size.fixed or size.name not in numbers:
        return False
    number = numbers[size.name]
    if number.value == 0.0 or abs(number.value) >= NOTHING * number.std:
        return number.value == 0.0
    felt = data.whitened(force_at(data, final.structure, final.x) - force_at(data, *reduced(final, index)))
    return float(np.sum(felt * felt)) < UNFELT


def _of_its_size(cause: Cause, numbers: Mapping[str, Number]) -> float:
    """How sure a name can be at the most whose size these data do not tell: such a shape stands for something else."""
    size = cause.amplitude
    if size is None or size.fixed or size.name not in numbers:
        return 1.0
    number = numbers[size.name]
    doubt = number.std / max(abs(number.value), 1e-300) if np.isfinite(number.std) else 1.0
    return 1.0 if doubt <= TOLD_SIZE else 0.5 * TOLD_SIZE / min(doubt, 1.0)


def explain(effect: object, values: dict[str, float]) -> str:
    """A plain sentence with the numbers in it; the effect's description where the form has other numbers."""
    try:
        return str(effect.explanation(values))  # type: ignore[attr-defined]
    except KeyError:
        return str(effect.what)  # type: ignore[attr-defined]
