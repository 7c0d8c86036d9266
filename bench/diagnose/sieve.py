"""Candidates joined to a fit, and sieved: a few steps from several starts for all of them, more for the better half, to
the end for the best few, all on the short stand-in; what is compared at last has converged."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sim import effects
from sim.effects import Effect, Form

from .candidates import forms
from .dashpot import instead_of_a_mode
from .data import Data, Prepared
from .drift_in_air import told_in_air
from .evidence import believable, penalty, unexplained
from .late import LATE, as_late, lateness_s
from .modes import NAMED as MISSING
from .modes import missing_told
from .noise import HARDLY_ANY
from .numbers import Cause, Structure, cause_of
from .path import Trial
from .reach import Reach
from .refit import Fit, extended, force_at, jacobian, refit
from .ripple import merged, ripples, two_periods
from .spectrum import one_more_mode
from .starts import Signatures, Start, starts
from .way import met_again

Array = NDArray[np.float64]

FEW, MORE, ALL = 3, 7, 40  # steps of the three rounds
STARTS, SECOND, THIRD, WORTH = 4, 8, 4, 18  # starts of an id; ids in the second, the third, and the first round
BY_CHANCE = 0.4  # of a step between samples, by which the time at which forces were felt scatters
LATE_TOO = 0.99  # of what the best takes: what makes the force late too and takes as much
BETTER = 10.0  # Δχ², times what the best leaves over what noise does: for less no cause is exchanged
COMPARED = 5  # rivals of a cause that is compared anew
AS_LATE = 0.9  # of the best gain: what makes the force late and takes so much brings its look-alikes in
FORETOLD = 0.2  # of a gain: first-order signatures promise so much of it at the least
HOPEFUL, CLOSE = 0.1, 0.6  # of the best one's gain: families that are worth the next round, and their second shapes
AS_GOOD = 0.5  # of the best start's promise: another form's own start is tried too
PROMISES, KEEPS = 0.5, 0.5  # of what is left unexplained; and of its promise: a start that keeps less steps anew
STRAYED = 5.0  # times as fast or as slow as any believed: such a mode has taken a cause's place
ASTRAY = 0.1  # of what is left, that one promises whose first steps have left more than there was
NEAR = 2.0  # times χ² before: another law that is no farther off after a few steps takes more
KNEES = ("soft",)  # forms that say more than that the greatest forces are at a ceiling
ROUNDS, MUCH = 3, 0.1  # of more steps for it, and the share of χ² by which they must fall for another
WORKERS = 2  # threads: the plant runs without Python's lock
PLAIN = 20.0  # Δχ² for which a form of fewer numbers is preferred
CRUMB_LEFT = 0.05  # of what one of them leaves, that another must take more at the full rate to stand before it
LATER = 12.0  # Δχ² by which a later form of a family must be better than its first, as the less usual one
LIMIT = 24.0  # Δχ² by which one with a number at its bound must be better: it is another cause's limit
AS_A_WAVE = 0.99  # of the gain of a law drawn through points: so much a wave takes that is what was drawn
ALIKE, ALIKE_LEFT = 0.005, 0.3  # of the gain, and of what the best leaves unexplained: so little more is none
FEWER = 0.5  # of a law's numbers: to a cause with no more of them ALIKE is enough


class Sieve:
    """The candidates for one measurement. `progress` is told what goes on."""

    def __init__(
        self, prepared: Prepared, structure: Structure, progress: Callable[[str], None], known: Sequence[str] = ()
    ) -> None:
        """`known`: ids that detectors have found already."""
        self.prepared, self.progress, self.known = prepared, progress, tuple(known)
        self.believed = structure
        self.samples = float(prepared.full.weight.sum())
        full = prepared.full
        self.reach = Reach.of(full, structure, prepared.sample_s, met_again(full, structure))

    @property
    def short(self) -> Data:
        """What is searched on."""
        return self.prepared.short

    @property
    def expected(self) -> float:
        """What noise alone leaves of χ² on the stand-in, whose entries are means."""
        return float(np.count_nonzero(self.short.weight > 0)) * float(np.sqrt(self.prepared.memory))

    @property
    def effective(self) -> float:
        """Samples that say something of their own."""
        return max(self.samples / self.prepared.memory, 20.0)

    def ranked(self, fit: Fit, only: Sequence[str] | None = None, least: float = 0.0) -> list[Trial]:
        """The candidates joined to a fit: the best form of each id, best first. `least`: Δχ² that is of any use."""
        signatures = Signatures(self.short, fit)
        wanted = [
            pair
            for pair in forms(fit.structure, fit.structure.in_air, self.reach)
            if (only is None or pair[0].id in only) and (pair[0].id not in self.known or pair[1].name in KNEES)
        ]
        self.progress(f"signatures of {len(wanted)} shapes")
        family: dict[str, list[Form]] = {}
        for effect, form in wanted:
            family.setdefault(effect.id, []).append(form)

        def begun(id_: str) -> list[Start]:
            effect, rich = effects.effect(id_), self.reach.rich
            return [start for form in family[id_] for start in starts(signatures, effect, form, rich=rich)]

        with ThreadPoolExecutor(WORKERS) as pool:
            # a thread has all forms of an id, which may share what they begin with; those that take longest come first
            ids = sorted(family, key=lambda i: -len(family[i]))
            found = dict(zip(ids, pool.map(begun, ids), strict=True))
            by_id = {id_: found[id_] for id_ in family}
            promising = self._promising(by_id, least) if only is None else list(by_id)
            for id_, start in self._hidden(signatures, wanted):
                by_id[id_].append(start)
                promising += [] if id_ in promising else [id_]
            self.progress(f"{len(promising)} candidates")
            believed = self._as_believed(fit)
            sieved = dict(
                zip(
                    promising,
                    pool.map(lambda i: self._sieved(fit, by_id[i], signatures, believed), promising),
                    strict=True,
                )
            )
            order = sorted((i for i in promising if sieved[i]), key=lambda i: sieved[i][0].score)
            second = _worth(fit, [sieved[i] for i in order], SECOND)
            wide = list(
                pool.map(
                    lambda i: self._widened(fit, sieved[i], by_id[i], family[i], signatures.jacobian), order[:second]
                )
            )
            wide.sort(key=lambda trials: trials[0].score)
            third = _worth(fit, wide, THIRD)
            self.progress(f"closer: {', '.join(trials[0].id for trials in wide[:third])}")
            close = [_contenders(fit, trials) for trials in wide[:third]]
            ended = list(pool.map(lambda trials: [self._ended(t) for t in trials], close))
            best = min((t for trials in ended for t in trials), key=lambda t: t.score, default=None)
            if best is not None:
                again = pool.map(lambda trials: self._relaxing_as(best, min(trials, key=lambda t: t.score)), ended)
                ended = [[*trials, *new] for trials, new in zip(ended, again, strict=True)]
        families = [self._of_one_period(t) for t in [*ended, *wide[third:]]]
        found_all = [self._plainest(sorted(t, key=lambda t: t.score)) for t in families]
        found_all += [sieved[i][0] for i in order[second:]]
        found_all.sort(key=lambda t: t.score)
        ranked = sorted(self._late_alike(fit, found_all, family), key=lambda t: t.score)
        return plainer_first(fit, self._plainer(fit, ranked))

    def _plainer(self, fit: Fit, ranked: list[Trial]) -> list[Trial]:
        """First the one of fewest numbers, and of as many the first form of its family, where what it leaves more is
        little beside what the best leaves too."""
        if not ranked:
            return ranked
        best = ranked[0].fit
        gained, beyond = fit.chi2 - best.chi2, unexplained(best.chi2, self.expected) + 1.0

        def as_good(t: Trial) -> bool:
            more = t.fit.chi2 - best.chi2
            return plainness(t) < plainness(ranked[0]) and more < ALIKE * gained and more < ALIKE_LEFT * beyond

        def plainness(t: Trial) -> tuple[int, bool]:
            return t.fit.free, not t.usual

        plain = min((t for t in ranked[1:] if as_good(t)), key=plainness, default=None)
        return ranked if plain is None else [plain, *(t for t in ranked if t is not plain)]

    def _relaxing_as(self, best: Trial, trial: Trial) -> list[Trial]:
        """A trial again, from where the pad relaxes as in the best one: modes settle in many ways, most of them bad."""
        order = best.fit.structure.pad.pad.relaxation.order
        if trial is best or order == 0:
            return []
        end = len(best.fit.structure.pad.coordinates)
        x = trial.fit.x.copy()
        x[end - 2 * order : end] = best.fit.x[end - 2 * order : end]
        again = self._solved(trial.fit.structure, x, MORE, None)
        return [self._carried(again, ALL)] if again is not None and again.score < trial.score else []

    def _late_alike(self, fit: Fit, ranked: list[Trial], family: dict[str, list[Form]]) -> list[Trial]:
        """Where a delay, a lag or a stiff resonance fits as well as any: the others again, from where they are as late.
        A relaxation mode can have taken their place, so that no signature shows them."""
        enough = AS_LATE * (fit.chi2 - ranked[0].fit.chi2) if ranked else 0.0
        best = next((t for t in ranked if t.id in LATE and fit.chi2 - t.fit.chi2 >= enough), None)
        late_s = 0.0 if best is None else lateness_s(best.id, best.fit.structure.values(best.fit.x)[-1])
        if best is None or late_s <= 0.0:
            return ranked
        out = {t.id: t for t in ranked}
        for id_ in [i for i in LATE if i in family and i != best.id]:
            # with the bounds of physics: a mode beyond what the sampling resolves is late, and no more
            own = effects.effect(id_)
            shapes = [own.forms[0]]
            if id_ == "sensor_lag" and unexplained(best.fit.chi2, self.expected) > 0.0:  # the usual ones are not it
                shapes += [form for form in own.forms if not form.sought]
            late = [cause_of(own, shape, values) for shape in shapes for values in as_late(id_, late_s)]
            tried = [t for t in (self._joined(fit, cause, MORE, None) for cause in late) if t is not None]
            if tried:
                again = self._carried(min(tried, key=lambda t: t.score), ALL)
                others = [*self._relaxing_as(ranked[0], again), *([out[id_]] if id_ in out else [])]
                out[id_] = min([again, *others], key=lambda t: t.score)
        return list(out.values())

    def late_first(self, before: Fit, ranked: list[Trial]) -> list[Trial]:
        """With that one in front, of what makes the force late and takes as much as the first, which does so where each
        sample counts: means over blocks smear what a delay keeps and a lag does not."""
        enough = LATE_TOO * (before.chi2 - ranked[0].fit.chi2)
        late = [t for t in ranked[: 1 + COMPARED] if t.id in LATE and before.chi2 - t.fit.chi2 > enough]
        if self.prepared.felt.late_s > BY_CHANCE * self.prepared.sample_s:  # what scatters has waited: no filter does
            return sorted(ranked, key=lambda t: t not in late or t.id != "force_delay")
        if ranked[0].id not in LATE or len(late) < 2 or self.short.size == self.prepared.full.size:
            return ranked
        full = self.prepared.full
        with ThreadPoolExecutor(WORKERS) as pool:
            whole = list(pool.map(lambda t: refit(full, t.fit.structure, t.fit.x, MORE, 1e-6), late))
        cost = [fit.chi2 + t.score - t.fit.chi2 for t, fit in zip(late, whole, strict=True)]
        # what all of them leave tells nothing of which it is; nor does a crumb of that, which other shapes may take
        least = BETTER * max(whole[0].chi2 / self.effective, 1.0)
        beyond = whole[0].chi2 - np.count_nonzero(full.weight > 0)
        if cost[0] - min(cost) <= max(least, CRUMB_LEFT * beyond):
            return ranked
        first = late[int(np.argmin(cost))]
        return [first, *(t for t in ranked if t is not first)]

    def _promising(self, by_id: dict[str, list[Start]], least: float) -> list[str]:
        """Ids whose first-order signature takes anything worth while, and those that have none."""
        promise = {id_: max((s.promise for s in found), default=0.0) for id_, found in by_id.items()}
        finite = [p for p in promise.values() if np.isfinite(p)]
        least = max(0.01 * max(finite, default=0.0), 8.0 * self.prepared.memory, FORETOLD * least)
        order = sorted((i for i in promise if promise[i] >= least), key=lambda i: -promise[i])
        return order[:WORTH]

    def _hidden(self, at: Signatures, pairs: Sequence[tuple[Effect, Form]]) -> list[tuple[str, Start]]:
        """Causes whose place a mode of the pad has taken, whose signature shows next to nothing; and a mode whose place
        others have taken."""
        rates, believed = self.believed.pad.pad.relaxation.rates, self.believed.pad.x()
        causes = [instead_of_a_mode(at.fit, rates, cause_of(*pair)) for pair in pairs]
        out = [(cause.id, Start(cause, np.inf, believed)) for cause in causes if cause is not None]
        more = [one_more_mode(at, rates, cause_of(*pair)) for pair in pairs]
        out += [(cause.id, Start(cause, np.inf, pad)) for cause, pad in (m for m in more if m is not None)]
        asked = {effect.id: effect for effect, _ in pairs}
        aired = [(id_, told_in_air(at, effect, believed, self.reach)) for id_, effect in asked.items()]
        return [*out, *((id_, start) for id_, start in aired if start is not None)]

    def _sieved(
        self, fit: Fit, found: list[Start], signatures: Signatures, believed: tuple[Array, Array]
    ) -> list[Trial]:
        """A few steps from the most promising starts of an id, and once more with the pad as it was believed."""
        found = sorted(found, key=lambda s: -s.promise)
        # with two periods a ripple promises the most, and takes no other's place
        most = STARTS + sum(two_periods(s.cause.form) for s in found)
        chosen = [s for s in found if np.isinf(s.promise)]
        forms_seen: dict[str, int] = {}
        for s in found:
            seen = forms_seen.get(s.cause.form.name, 0)
            if np.isfinite(s.promise) and seen < 2 and sum(forms_seen.values()) < most:
                forms_seen[s.cause.form.name] = seen + 1
                chosen.append(s)
        joined = [self._kept(fit, s, signatures.jacobian) for s in chosen if s.pad is None]
        # another law begins beside the fit and not at it: it takes more steps to tell what it is worth
        near = [t is not None and t.cause.form.amend is not None and t.fit.chi2 < NEAR * fit.chi2 for t in joined]
        tried = [self._carried(t, MORE) if close else t for t, close in zip(joined, near, strict=True) if t is not None]
        tried += self._from_believed(fit, tried, *believed)
        for s in chosen:
            if s.pad is not None:
                structure = fit.structure.with_cause(s.cause)
                x = structure.x(s.pad, [*fit.structure.values(fit.x), s.cause.start], fit.of_run)
                again = self._solved(structure, x, MORE, None)
                tried += [] if again is None else [self._falling(again)]
        return sorted(tried, key=lambda t: t.score)

    def _kept(self, fit: Fit, start: Start, known: Array) -> Trial | None:
        """A few steps from a start, the sensitivities of the pad's numbers known. Where it promises to explain what is
        left, and does not keep that, it has changed them: a frame's way is most of the pad's in another place; or its
        shape was led away before the pad had followed: where each depth held is before or behind a bend, a slope
        tells nothing of what comes next. Data that meet their depths once are left at that: there the long way leads to
        any shape, and what it promises fits no other run."""
        trial = self._joined(fit, start.cause, FEW, known)
        left = unexplained(fit.chi2, self.expected)
        promised = min(start.promise, left)
        if trial is None or not np.isfinite(start.promise):
            return trial
        rich = self.reach.rich
        hopes = ASTRAY if rich and trial.fit.chi2 >= fit.chi2 else PROMISES
        for again in (self._joined, self._followed) if rich else (self._joined,):
            if promised <= hopes * left or fit.chi2 - trial.fit.chi2 > KEEPS * promised:
                break
            other = again(fit, start.cause, FEW, None)
            trial = other if other is not None and other.score < trial.score else trial
        return trial

    def _widened(
        self, fit: Fit, trials: list[Trial], found: list[Start], family: list[Form], known: Array
    ) -> list[Trial]:
        """More steps for the best, and for the other forms of the family: each from where it ended, or from its own
        most promising start, whichever leads further in a few steps.
        """
        best = self._carried(trials[0], MORE)
        out = [best, *trials[1:2]]
        usual = next((t for t in trials if t.usual and t is not trials[0]), None)
        if usual is not None:  # from its own start: where another form has ended may be a bad one
            out.append(self._carried(usual, MORE))
        dealt = next((d for d in map(self._dealt, out) if d is not None), None)
        root = dealt or best
        tried = {root.cause.form.name}
        for form in family:
            if form.name in tried or (form.amend is not None and root.cause.amplitude is None):
                continue
            tried.add(form.name)
            cause = cause_of(root.cause.effect, form)
            shared = {p.name for p in cause.fitted} & {p.name for p in root.cause.fitted}
            *before, values = root.fit.structure.values(root.fit.x)
            cause = cause.with_start(**{name: values[name] for name in shared})
            structure = fit.structure.with_cause(cause)
            pad = root.fit.x[: len(structure.pad.coordinates)]
            x = structure.x(pad, [*before, cause.start], root.fit.of_run)
            begun = self._solved(structure, x, FEW, None)
            own = self._of_its_own(fit, form, trials, found, known)
            if own is not None and begun is not None and begun.score <= own.score:
                own = None
            if own is not None:
                out.append(self._falling(own))
            if begun is not None and (own is None or dealt is not None):
                out.append(self._carried(begun, MORE))
        return sorted(out, key=lambda t: t.score)

    def _dealt(self, trial: Trial) -> Trial | None:
        """A trial of one more mode with the modes dealt out as they should be, None where it is none: of modes that are
        all alike any can be the one too many, but another shape is that of the one which is."""
        if trial.id != MISSING or not trial.usual:
            return None
        return replace(trial, fit=replace(trial.fit, x=missing_told(trial.fit, self.believed)))

    def _of_its_own(self, fit: Fit, form: Form, trials: list[Trial], found: list[Start], known: Array) -> Trial | None:
        """A few steps of a form from its own best start, taken from the sieve if they are done; None: a poor start."""
        done = [t for t in trials if t.cause.form.name == form.name]
        if done:
            return min(done, key=lambda t: t.score)
        own = [s for s in found if s.cause.form.name == form.name and np.isfinite(s.promise)]
        best = max(own, key=lambda s: s.promise, default=None)
        if best is None or best.promise < AS_GOOD * max(s.promise for s in found):
            return None
        return self._kept(fit, best, known)

    def _falling(self, trial: Trial) -> Trial:
        """More steps, and again while they take much: a form from its own start has a longer way than from another's
        end."""
        for _ in range(ROUNDS):
            before, trial = trial.fit.chi2, self._carried(trial, MORE)
            if before - trial.fit.chi2 < MUCH * before:
                break
        return trial

    def _of_one_period(self, trials: list[Trial]) -> list[Trial]:
        """The trials of a family without a second period where that one's numbers end at their bounds, or is none: it
        must not cost the others their place."""
        kept = [t for t in trials if not two_periods(t.cause.form) or self._apart(t.fit)]
        return kept or trials

    def _apart(self, fit: Fit) -> bool:
        cause, values = fit.structure.causes[-1], fit.structure.values(fit.x)[-1]
        return believable(fit, self.prepared) and not merged(cause.form, values, self.reach.travel_mm)

    def _plainest(self, trials: list[Trial]) -> Trial:
        """The best; or a form of fewer numbers that is as good for what there is to explain, or leaves less than noise
        would."""
        best = trials[0]
        for t in trials[1:]:
            fewer = t.fit.free < best.fit.free
            as_good = t.fit.chi2 - best.fit.chi2 < PLAIN * self.prepared.memory
            if fewer and (as_good or t.fit.chi2 < HARDLY_ANY * self.expected):
                best = t
        return best

    def _as_believed(self, fit: Fit) -> tuple[Array, Array]:
        """(the pad's numbers as believed, derivatives there by them and by the causes of a fit)."""
        pad = self.believed.pad.x()
        x = fit.structure.x(pad, fit.structure.values(fit.x), fit.of_run)
        return pad, jacobian(self.short, fit.structure, x)[:, : len(x) - fit.structure.tail]

    def _from_believed(self, fit: Fit, tried: Sequence[Trial], pad: Array, known: Array) -> list[Trial]:
        """The best of some starts again, with the pad as it was believed: a refit may have run far from it. Where a
        mode has, the way back is long, and is gone where depths are met more than once (`_kept`)."""
        if not tried:
            return []
        best = min(tried, key=lambda t: t.score).fit
        start = best.structure.x(pad, best.structure.values(best.x), best.of_run)
        again = self._solved(best.structure, start, FEW, known)
        if again is None:
            return []
        return [self._falling(again) if self.reach.rich and self._strayed(fit) else again]

    def _strayed(self, fit: Fit) -> bool:
        """Whether a mode of a fit's pad is another one by far than any that was believed."""
        order, end = self.believed.pad.pad.relaxation.order, len(fit.structure.pad.coordinates)
        rates, believed = fit.x[end - order : end], self.believed.pad.x()[len(self.believed.pad.coordinates) - order :]
        off = np.abs(rates[:, None] - believed[None, :]).min(axis=1, initial=np.inf)
        return bool(np.any(off > np.log(STRAYED)))

    def _joined(self, fit: Fit, cause: Cause, steps: int, known: Array | None) -> Trial | None:
        structure = fit.structure.with_cause(cause)
        own = structure.x(fit.x[: len(structure.pad.coordinates)])[structure.of_cause(len(structure.causes) - 1)]
        return self._solved(structure, extended(fit, own), steps, known)

    def _followed(self, fit: Fit, cause: Cause, steps: int, known: Array | None) -> Trial | None:
        """As `_joined`, from where the pad and the cause's size have followed, its shape held as it begins."""
        shape = tuple(replace(p, fixed=not p.amplitude) for p in cause.form.parameters)
        held = cause_of(cause.effect, replace(cause.form, parameters=shape), cause.start)
        beside = self._joined(fit, held, steps, known)
        if beside is None:
            return None
        values, pad = beside.fit.structure.values(beside.fit.x), beside.fit.x[: len(fit.structure.pad.coordinates)]
        structure = fit.structure.with_cause(cause.with_start(**values[-1]))
        return self._solved(structure, structure.x(pad, values, beside.fit.of_run), steps, known)

    def _solved(self, structure: Structure, x: Array, steps: int, known: Array | None) -> Trial | None:
        if not np.isfinite(force_at(self.short, structure, x)).all():
            return None
        done = refit(self.short, structure, x, steps, 1e-6, known)
        return self._trial(done)

    def _trial(self, fit: Fit) -> Trial:
        cause = fit.structure.causes[-1]
        at = fit.structure.of_cause(len(fit.structure.causes) - 1)
        x, lower, upper = fit.x[at], fit.structure.lower[at], fit.structure.upper[at]
        edge = float(np.sum((x <= lower + 1e-9) | (x >= upper - 1e-9)))
        unusual = 0.0 if cause.form.name == cause.effect.forms[0].name else LATER * self.prepared.memory
        unusual += edge * LIMIT * self.prepared.memory
        return Trial(cause, fit, fit.chi2 + self._penalty(fit) + unusual)

    def _penalty(self, fit: Fit) -> float:
        return penalty(fit.free, self.effective) * self.prepared.memory

    def _ended(self, trial: Trial) -> Trial:
        """At its minimum: on again where it is still on its way, and something is left to explain."""
        done = self._carried(trial, ALL)
        left = unexplained(done.fit.chi2, self.expected) > 0.0
        return self._carried(done, ALL) if left and not done.fit.converged else done

    def _carried(self, trial: Trial, steps: int) -> Trial:
        return self._trial(refit(self.short, trial.fit.structure, trial.fit.x, steps, 1e-8))


def plainer_first(fit: Fit, ranked: list[Trial]) -> list[Trial]:
    """First an error of the position that repeats, where a law that is drawn through points stood in front of it and
    takes hardly more of what `fit` leaves; or a cause of few numbers, where a law of many did.

    On a pad that stays put a wave and a law are the same function of the position, and a curve through points can be
    any; that it comes out as a wave of more than one period tells of the encoder, and not of a pad. So does a curve
    that comes out as what a surface that lies elsewhere makes, but for a two-hundredth.
    """
    if not ranked or ranked[0].id != "elastic_law":
        return ranked
    gained = fit.chi2 - ranked[0].fit.chi2
    few = fit.free + FEWER * (ranked[0].fit.free - fit.free)

    def is_all(t: Trial) -> bool:
        plain = t.fit.free <= few and not ripples(t.cause.form)
        share = AS_A_WAVE if _repeats(t) and drawn(ranked[0]) else 1.0 - ALIKE if plain else np.inf
        return fit.chi2 - t.fit.chi2 > share * gained

    told = next((t for t in ranked[1:] if t.id != ranked[0].id and is_all(t)), None)
    return ranked if told is None else [told, *(t for t in ranked if t is not told)]


def drawn(trial: Trial) -> bool:
    """Whether its cause is a law drawn through points, which can be any curve."""
    return trial.id == "elastic_law" and trial.cause.form.name.endswith("spline")


def _repeats(trial: Trial) -> bool:
    form = trial.cause.form  # with two periods it can be any curve itself
    return ripples(form) and "report" in form.blocks and not two_periods(form)


def _worth(fit: Fit, ranked: Sequence[Sequence[Trial]], most: int) -> int:
    """How many of some families, best first, take enough to be looked at more closely."""
    gains = [fit.chi2 - trials[0].fit.chi2 for trials in ranked[:most]]
    return next((k for k, gain in enumerate(gains) if k > 1 and gain < HOPEFUL * max(gains)), len(gains))


def _contenders(fit: Fit, trials: list[Trial]) -> list[Trial]:
    """Of a family the best, and, where they are not far behind, the next best and the best of its first form."""
    gained = fit.chi2 - trials[0].fit.chi2
    others = [t for t in trials[1:] if fit.chi2 - t.fit.chi2 > CLOSE * gained]
    return [trials[0], *others[:1], *[t for t in others[1:] if t.usual][:1]]
