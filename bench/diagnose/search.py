"""Which causes a set of data asks for: causes added and taken away one by one, each by a joint refit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from sim import effects

from .data import FeltErrors
from .evidence import RIVAL, Evidence, believable, evidence_of, least_gain, of_slow_force, too_small, unexplained
from .exchange import Exchange
from .felt_errors import felt_errors, redrawn
from .late import LATE
from .late_by_chance import late_by_chance_s
from .numbers import shapes_of
from .path import Path, Trial
from .reach import LONGEST_PERIOD, LONGEST_REPORTED, narrowed, with_periods
from .refit import Fit, mean_square, reduced, refit
from .ripple import ripples, turned
from .shapes import families
from .sieve import ALL, MORE
from .starts import Signatures, combinations, starts

Array = NDArray[np.float64]

MANY_MORE = 2  # numbers of a shape beyond those of the plain one: then two plain causes are asked for in its place
SAME = 0.6  # share of a further cause's gain that another shape of a cause found reaches: then it is no further cause
QUIET = 2.0  # times the noise's square: what is left altogether, where its colour is taken in
MOST_WORK = 150_000_000  # simulated samples, after which no further cause is looked for
MORE_FOR_TWO = 2.0  # times those, where the first of two leaves much
A_SHAPE = 0.1  # of what is left beyond the noise, that another shape of a cause takes where no further cause pays
HALF = 0.5  # of what a shape at a bound, or two causes, leave beyond the noise: what goes in their place leaves less
MUCH_LEFT, A_PART = 0.03, 0.05  # of what the belief leaves beyond the noise, that a first cause and all that follow it
# leave; and what the lesser of two in its place takes, or of what was held out all that begins with another
GOOD_PART, OTHERS = 0.4, 2  # of what a first cause takes, that others take; so many are tried where it was none
LESS = 0.1  # of what those leave, that two in their place leave
MOST_CAUSES = 3
SEED = 0
MOST_SHAPES = 12  # of a believed cause, that are tried
LONG_WAVES = 3  # starts of a wave that is longer than those sought
LATER_BY_CHANCE = 1.3  # times what was known of it
MISFIT, GLARING = 1.3, 2.0  # times what noise leaves: then a cause that was found may have another shape, or is not all


@dataclass
class _Turn:
    """What stands to be added to a path: ids tried; candidates, best first; those too small to be named; the best
    further shape of a cause that is there (`beside`); what the first is worth, and whether there is more to be found.
    """

    tried: list[str]
    ranked: list[Trial]
    small: list[Trial]
    beside: Trial | None
    found: Evidence
    more: bool
    of_a_shape: bool = False
    """What is missed is of the shape of a cause that was found, and no form has it."""


class Search(Exchange):
    """One search on one measurement."""

    @cached_property
    def motion_errors_mm(self) -> Array:
        """What the motion as felt may be off by (runs, p), drawn once."""
        return redrawn(self.prepared, np.random.default_rng(SEED))

    @property
    def work(self) -> int:
        """Samples simulated so far."""
        return self.short.work.samples

    def base(self, pads: Sequence[Array]) -> Fit:
        """The believed structure with its numbers refitted, from each of some vectors of the pad."""
        fits = [refit(self.short, self.believed, x, 12, 1e-5) for x in self._starts(pads)]
        fits.sort(key=lambda f: f.chi2)
        ended = [refit(self.short, f.structure, f.x, 60, 1e-9) for f in fits[:2] if f.chi2 < 3 * fits[0].chi2]
        path = Path([min(ended, key=lambda f: f.chi2)])
        self._felt(path)
        return path.fits[0]

    def _starts(self, pads: Sequence[Array]) -> list[Array]:
        """Vectors from which the belief is refitted: as believed, and with the shapes that a form leaves open begun
        anew. What repeats with the position starts where in its period it fits best: that depends on where the surface
        is, which is another one with each pad."""
        own = self.believed.causes
        told = [[c.start for c in own]]
        for index, cause in enumerate(own):  # as finely as these data tell what the contract does not ask for
            form = narrowed(cause.form, self.reach)
            free = replace(form, parameters=tuple(p for p in form.parameters if not p.required and not p.fixed))
            for values in [*combinations(free), {p.name: p.if_left_out for p in free.parameters}][:MOST_SHAPES]:
                told.append([{**c.start, **(values if k == index else {})} for k, c in enumerate(own)])
        at = [k for k, cause in enumerate(own) if ripples(cause.form)]
        if at:
            bare = replace(self.believed, causes=tuple(c for k, c in enumerate(own) if k not in at))
            fits = [refit(self.short, bare, bare.x(pad), 12, 1e-5) for pad in pads]
            signatures = Signatures(self.short, min(fits, key=lambda f: f.chi2))
            best = {k: max(turned(own[k]), key=signatures.whole).start for k in at}
            told.insert(0, [best.get(k, c.start) for k, c in enumerate(own)])
        return [self.believed.x(pad, values) for pad in pads for values in told]

    def path(self, base: Fit) -> Path:
        """Causes one after the other while each pays; then those that others have made needless go. Where the first
        leaves much whatever follows, the same from one that stood near it."""
        begun = self.work
        path = self._walked(Path([base]), begun)
        path = self._from_another_first(path, begun) or path
        self._wave_for_a_law(path)
        self._compare(path)
        return path

    def _walked(self, path: Path, begun: int) -> Path:
        """A path carried on, cause by cause, until none pays or the work is too much. `begun`: where it was then."""
        asked = 1  # fits on the path when the causes' shapes were last asked
        turned_at, reshaped = self.work, False
        while len(path.fits) <= MOST_CAUSES:
            now = self.work
            # a third cause is not begun where it would not be done with what is left: most often there is none
            will_take = now - turned_at if len(path.fits) > 2 else 0
            # a second one is, where the first leaves much: with that alone the answer is none, or not all
            needs_two = len(path.fits) == 2 and (self._much_left(path) or self._times_left(path) > GLARING)
            if now - begun + will_take >= MOST_WORK * (MORE_FOR_TWO if needs_two else 1.0):
                path.cut_short = self._times_left(path) > MISFIT
                break
            turned_at = now
            self._whitened(path)
            self._felt(path)
            turn = self._turn(path)
            if turn is None:
                break
            again = turn.more and len(path.fits) > asked
            asked = len(path.fits) if again else asked
            other = self._another_shape(path, turn, again)
            if other is not None:  # not a further cause, but one found of another shape
                path.fits[-1], reshaped = other, True
                continue
            self._told_at_full_rate(path, turn)
            self._note(path, turn)
            if turn.of_a_shape or not self._added(path, turn):
                break
            reshaped = False
        if reshaped and len(path.fits) > 2:  # what came in beside a cause in another shape may be another's work
            path.fits[-1] = self.exchanged(path)
        return path

    def _much_left(self, path: Path) -> bool:
        """Whether what was found leaves much of what the belief left beyond the noise."""
        base, end = path.fits[0].chi2, path.fits[-1].chi2
        return end - self.expected >= MUCH_LEFT * (base - self.expected)

    def _from_another_first(self, path: Path, begun: int) -> Path | None:
        """The path to two causes from one that stood near the first, where the first leaves much, or what came in
        behind it something, and those two leave nothing: of two that look like a third together, that one comes first,
        and another fits what it has made of the rest. None: there is none."""
        if len(path.fits) < 2:
            return None
        end, prepared = path.fits[-1], self.prepared
        much = self._much_left(path) and unexplained(end.chi2, self.expected) > 0.0
        something = len(path.fits) > 2 and end.chi2 - self.expected > np.sqrt(2.0 * self.expected)
        if not much and not something:
            return None
        for near in self._near(path.measures[0].before, path.rivals[0]):
            if self.work - begun >= MOST_WORK * MORE_FOR_TWO:
                break
            first = self._carried(near, ALL)
            if not self._two_leave_less(first, end):
                continue
            again = self._begun_with(path, first)
            again = self._walked(again, self.work)  # there is hope, and it has work of its own
            two = len(again.fits) == 3 and again.evidence[1].share > A_PART
            # on the data as they have become on the way
            ended = end if self.prepared is prepared else refit(self.short, end.structure, end.x, 20, 1e-8)
            if two and self._leaves_less(again, ended, much):
                return again
            self.prepared = prepared  # which the path that was left may have whitened
        return None

    def _leaves_less(self, path: Path, end: Fit, much: bool) -> bool:
        """Whether a path leaves nothing, and surely less than another one's end, which leaves much or not so."""
        now = path.fits[-1]
        if not self._clean(path.fits[0].chi2, now.chi2) or now.chi2 + self._penalty(now) >= self._to_beat(end):
            return False
        nothing = much or unexplained(now.chi2, self.expected) <= 0.0
        return nothing and now.chi2 - self.expected < (LESS if much else HALF) * (end.chi2 - self.expected)

    def from_others(self, path: Path) -> Iterator[Path]:
        """Paths that begin with those that stood behind a path's first cause and take a good part of what it takes, all
        with the work that one has."""
        begun, prepared, ranked, before = self.work, self.prepared, path.rivals[0], path.measures[0].before
        enough = GOOD_PART * (before - ranked[0].fit.chi2)
        others = (t for t in ranked if t.id != ranked[0].id and before - t.fit.chi2 > enough)
        for other in islice(others, OTHERS):
            if self.work - begun >= MOST_WORK:
                break
            self.prepared = prepared  # which the path before may have whitened
            again = self._begun_with(path, self._carried(other, ALL))
            if again.evidence[0].pays:
                yield self._walked(again, begun)

    def _begun_with(self, path: Path, first: Trial) -> Path:
        """A path that begins with one of those that stood beside another's first cause."""
        base = path.fits[0]
        stood = [first, *(t for t in path.rivals[0] if t.id != first.id)]
        found = self.judge(base, first.fit, base)
        return Path([base, first.fit], [stood], path.tried[:1], path.measures[:1], [found])

    def _two_leave_less(self, first: Trial, end: Fit) -> bool:
        """Whether a first cause and another, in the shapes that come first, leave less than a path's end."""
        least = first.fit.chi2 - end.chi2
        beside = self.ranked(first.fit, least=least)
        second = next((t for t in beside if t.id != first.id and believable(t.fit, self.prepared)), None)
        return second is not None and second.fit.chi2 < end.chi2

    def _turn(self, path: Path) -> _Turn | None:
        """What stands to be added to a path, and what it is worth; None: nothing does."""
        now, first = path.fits[-1], len(path.fits) == 1
        least = least_gain(path.fits[0], self.prepared.memory, self.samples, self.expected, first)
        tried = self._inside(path, self.ranked(now, least=least))
        if tried and self._late_by_chance(path, tried[0].fit):
            return self._turn(path)
        every = [t for t in tried if believable(t.fit, self.prepared)]
        present = {c.id for c in now.structure.causes}
        ranked = [t for t in every if t.id not in present]
        if not ranked:
            return None
        small = [t for t in tried if t.id not in present and too_small(t.fit, self.prepared)]
        beside = min((t for t in every if t.id in present), key=lambda t: t.fit.chi2, default=None)
        found = self._lead(path, ranked[0])
        more = found.pays or self._times_left(path) > MISFIT
        return _Turn([t.id for t in tried], ranked, small, beside, found, more)

    def _lead(self, path: Path, best: Trial) -> Evidence:
        """What the step to a trial is worth, from the better one of the path's end and what the trial is without its
        cause."""
        path.fits[-1] = self.settled(path.fits[-1], best.fit)
        return self.judge(path.fits[-1], best.fit, path.fits[0])

    def _another_shape(self, path: Path, turn: _Turn, again: bool) -> Fit | None:
        """The path's end with one of its causes in another shape, where that is what is missed, and no further cause.
        Else the turn's candidates in their best shapes; `again`: the causes found are asked for theirs."""
        now, best = path.fits[-1], turn.ranked[0]
        other = self.recurved(now) if again else now
        same = other is not now and now.chi2 - other.chi2 > SAME * (now.chi2 - best.fit.chi2)
        if not turn.found.pays and now.chi2 - other.chi2 > A_SHAPE * max(now.chi2 - self.expected, 0.0):
            return other  # what its old shape missed may have hidden what comes next
        if same and unexplained(other.chi2, self.expected) <= 0.0:
            return other  # no further cause, in whatever shape, leaves less
        if turn.found.pays or same:
            plain, shaped = turn.ranked, self._in_shape(now, turn.ranked, len(path.fits) == 1, same)
            if len(path.fits) > 1 or not self._two_instead(path, best, shaped[0]):
                turn.ranked = shaped
            if same and not self._alone_clean(now.chi2, turn.ranked[0].fit.chi2, other.chi2):
                return other
        if turn.found.pays and len(path.fits) == 1:
            turn.ranked = self._plain_first(path, turn.ranked, plain)
        if turn.ranked[0] is not best:
            best = turn.ranked[0]
            turn.found = self._lead(path, best)
            if again and shapes_of(path.fits[-1].structure) != shapes_of(now.structure):
                return path.fits[-1]  # those further behind stand beside another shape too
            now = path.fits[-1]
        if turn.beside is not None and self._reshaped(now.chi2, best.fit.chi2, turn.beside.fit.chi2):
            united = self._united(now, turn.beside)
            if now.chi2 - united.chi2 > SAME * (now.chi2 - turn.beside.fit.chi2):
                return united
            turn.of_a_shape = not (
                self._simpler(now, turn.beside.fit, best.fit) or self._stays_beside(now, turn.beside.fit, best.fit)
            )
        return None

    def _told_at_full_rate(self, path: Path, turn: _Turn) -> None:
        """Delay, lag and resonance in the order that each sample tells."""
        best, turn.ranked = turn.ranked[0], self.late_first(path.fits[-1], turn.ranked)
        if turn.ranked[0] is not best:
            turn.found = self._lead(path, turn.ranked[0])

    def _note(self, path: Path, turn: _Turn) -> None:
        stood = [*turn.ranked, *turn.small]
        path.rivals.append(self._with_a_long_wave(path.fits[-1], stood) if turn.found.significant else stood)
        path.tried.append(turn.tried)
        path.measures.append(self._measure(path.fits[-1]))
        path.evidence.append(turn.found)

    def _with_a_long_wave(self, now: Fit, ranked: list[Trial]) -> list[Trial]:
        """The candidates, behind another law an error of the position that repeats over a longer way than is sought,
        where it takes more than one of those: part of one wave is any curve, so that it is no candidate by itself, but
        nor do these data exclude it."""
        if ranked[0].id != "elastic_law" or not self.reach.rich:
            return ranked
        effect = effects.effect("encoder_error")
        depth_mm = self.prepared.depth_mm
        form = with_periods(effect.forms[0], LONGEST_REPORTED * depth_mm, LONGEST_PERIOD * depth_mm)
        begun = starts(Signatures(self.short, now), effect, form, LONG_WAVES)
        tried = [t for t in (self._joined(now, s.cause, MORE, None) for s in begun) if t is not None]
        if not tried:
            return ranked
        wave = self._carried(min(tried, key=lambda t: t.fit.chi2), ALL)
        known = next((t for t in ranked if t.id == wave.id), None)
        if not believable(wave.fit, self.prepared) or (known is not None and known.fit.chi2 <= wave.fit.chi2):
            return ranked
        others = sorted([wave, *(t for t in ranked[1:] if t is not known)], key=lambda t: t.score)
        return [ranked[0], *others]

    def _added(self, path: Path, turn: _Turn) -> bool:
        """Whether the turn's first cause pays, or would with earlier ones exchanged: then it is at the path's end."""
        now = path.fits[-1]
        path.fits.append(turn.ranked[0].fit)
        if len(path.fits) > 2 and turn.more:
            path.fits[-1] = self.exchanged(path)
        if not turn.found.pays:  # what stood first may have been in the place of two others
            path.evidence[-1] = self.judge(now, path.fits[-1], path.fits[0])
            if not path.evidence[-1].pays:
                path.fits.pop()
                return False
        return True

    def _inside(self, path: Path, ranked: list[Trial]) -> list[Trial]:
        """With another shape of the leading family in front, where that one pays, and has a number at the bound of what
        can be told. Of a wave, and of what makes the force late, it must leave far less than that one does: a wave that
        grows as long as it may can be two, a mode as damped as it may be is a lag, and so is any shape of it."""
        if not ranked or believable(ranked[0].fit, self.prepared):
            return ranked
        lead, best = ranked[0], ranked[0].fit
        if not self.judge(path.fits[-1], best, path.fits[0]).pays:
            return ranked
        shapes = families(self.short, best, [len(best.structure.causes) - 1])[0][1:]
        tried = [t for t in (self._trial(m.fit) for m in shapes) if believable(t.fit, self.prepared)]
        again = self._carried(min(tried, key=lambda t: t.score), ALL) if tried else None
        least = HALF * (best.chi2 - self.expected)
        anothers = ripples(lead.cause.form) or lead.id in LATE
        if again is None or (anothers and again.fit.chi2 - self.expected > least):
            again = self._a_longer_wave(ranked)
        return ranked if again is None else sorted([again, *ranked[1:]], key=lambda t: t.score)

    def _two_instead(self, path: Path, plain: Trial, shaped: Trial) -> bool:
        """Whether a first cause in a shape of many numbers does what two plain ones do better, with fewer."""
        if shaped.fit.free < plain.fit.free + MANY_MORE:
            return False
        now = path.fits[-1]
        least = least_gain(path.fits[0], self.prepared.memory, self.samples, self.expected, False)
        further = (t for t in self.ranked(plain.fit, least=least) if t.id != plain.id)
        second = next((t for t in further if believable(t.fit, self.prepared)), None)
        if second is None or second.score > shaped.score - RIVAL * self.prepared.memory:
            return False
        if second.fit.free > shaped.fit.free:  # it is the same curve of many numbers, and another beside it
            return False
        return self._clean(now.chi2, second.fit.chi2) and self.judge(plain.fit, second.fit, now).pays

    def _plain_first(self, path: Path, ranked: list[Trial], plain: list[Trial]) -> list[Trial]:
        """The candidates for a first cause, with one of few numbers in front of a curve of many that is half-way to
        everything, where that one and a second leave nothing. It is the curve's own cause as it was before it was asked
        for its shape (`plain`: the candidates then), or the next that stands near."""
        lead = ranked[0]
        if unexplained(lead.fit.chi2, self.expected) <= 0.0:
            return ranked
        few = lead.fit.free - MANY_MORE
        own = (t for t in plain if t.id == lead.id and t.fit.free < few)
        near = (t for t in self._near(path.fits[-1].chi2, ranked) if t.fit.free < few)
        asked = [*islice(own, 1), *islice(near, 1)]
        if not asked:
            return ranked
        told = self._told(lead)
        first = next((t for t in asked if self._two_instead(path, t, told)), None)
        return ranked if first is None else [first, *(t for t in ranked if t.id != first.id)]

    def _whitened(self, path: Path) -> None:
        """Once little is left beside the noise, its colour goes into the cost; or no more than such noise leaves, where
        it remembers for long: what is small and changes fast cannot be seen beside it before."""
        if self.prepared.memory == 1.0:
            return
        last, prepared = path.fits[-1], self.prepared
        square = mean_square(prepared.full, last.structure, last.x)
        if square < QUIET * prepared.floor_N**2 or last.chi2 < self.expected:
            self.prepared = prepared.white()
            path.fits = [refit(self.short, f.structure, f.x, 20, 1e-8) for f in path.fits]

    def _felt(self, path: Path) -> None:
        """What the last fit's causes make of errors of the positions is noise: nothing else tells of it."""
        last = path.fits[-1]
        if last.structure.causes:
            self._doubting(path, felt_errors(self.prepared, last, self.motion_errors_mm))

    def _late_by_chance(self, path: Path, fit: Fit) -> bool:
        """Whether the forces of a fit were felt earlier or later by chance, of which nobody knew yet: then that is
        noise, and what makes them late is asked for again."""
        if late_by_chance_s(self.prepared, fit) <= LATER_BY_CHANCE * self.prepared.felt.late_s:
            return False
        self._doubting(path, felt_errors(self.prepared, fit, self.motion_errors_mm))
        return True

    def _doubting(self, path: Path, felt: FeltErrors) -> None:
        if np.array_equal(felt.total_N, self.prepared.felt.total_N):
            return
        self.prepared = self.prepared.doubting(felt)
        path.fits = [refit(self.short, f.structure, f.x, 20, 1e-8) for f in path.fits]

    def settled(self, now: Fit, joined: Fit) -> Fit:
        """The fit before a cause was added, or a better one that the addition has led to: a valley may be long."""
        structure, x = reduced(joined, len(joined.structure.causes) - 1)
        again = refit(self.short, structure, x, 20, 1e-8)
        return again if again.chi2 < now.chi2 else now

    def judge(self, before: Fit, after: Fit, base: Fit) -> Evidence:
        """Whether the step from one fit to the next is more than chance, and more than a crumb. What a slider's errors
        make the same for all of a rest counts once there."""
        data = self.prepared.judged_short
        if data is not self.short:
            before, after, base = (refit(data, fit.structure, fit.x, 8, 1e-6) for fit in (before, after, base))
        slow = of_slow_force(data, before, after, base)
        return evidence_of(before, after, base, self.prepared.memory, self.samples, self.expected, slow)
