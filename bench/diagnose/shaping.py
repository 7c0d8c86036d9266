"""Causes that were found, in other shapes: of one alone, of those that stand near each other, and of two of a kind."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cached_property

import numpy as np

from .candidates import CHANNEL, forms
from .data import Prepared
from .evidence import RIVAL, believable, unexplained
from .numbers import Cause, cause_of
from .path import Trial
from .reach import narrowed, with_periods
from .refit import Fit, last, reduced, refit
from .ripple import ripples
from .shapes import begun_anew, departed, waving
from .sieve import ALL, CLOSE, FEW, LATER, MORE, WORKERS, Sieve, drawn, plainer_first
from .starts import Signatures, alike, starts

MUCH, MOST = 0.25, 0.5  # of its gain, and of what is left, that a further cause takes beside a second one of a kind
AS_WELL = 0.8  # share of a second cause of a kind's gain, that a further cause's beside the first reaches
CLEAN, UNCLEAN, LITTLE = 0.03, 0.05, 0.1  # of what was left that a fit leaves: nothing, something, and next to nothing
FURTHER, FAR_LESS = 1.4, 5.0  # times the longest wave sought; and what it leaves, that the next leaves at the least
RIVALS = 2  # beside the best, that are asked for their best shapes


class Shaping(Sieve):
    """Candidates and causes in their other shapes."""

    @cached_property
    def _asked(self) -> list[tuple[Prepared, Fit, Fit]]:
        """The data, a fit, and what came of it: what stood beside a cause often stands beside the next one too."""
        return []

    def recurved(self, now: Fit) -> Fit:
        """The fit with one of its causes in another form, also of those that only refine others; if that is better."""
        for prepared, fit, other in self._asked:
            if prepared is self.prepared and fit is now:
                return other
        other = self._in_another_form(now)
        self._asked.append((self.prepared, now, other))
        return other

    def _in_another_form(self, now: Fit) -> Fit:
        begun: list[tuple[Fit, Cause]] = []
        for index, cause in enumerate(now.structure.causes):
            if index < len(self.believed.causes) or cause.id in CHANNEL:
                continue
            structure, x = reduced(now, index)
            here, without = replace(now, structure=structure, x=x), self._without(now, index)
            signatures, numbers = Signatures(self.short, without), now.structure.values(now.x)[index]
            for effect, form in forms(structure, structure.in_air, self.reach, also_unsought=True):
                if effect.id != cause.id or form.name == cause.form.name:
                    continue
                like = alike(now, index, cause_of(effect, form))
                begun += [(here, c) for c in (like, *begun_anew(self.short, now, index, like))]
                anew = starts(signatures, effect, form, near=numbers, rich=self.reach.rich)
                begun += [(without, s.cause) for s in anew]
        with ThreadPoolExecutor(WORKERS) as pool:
            first = [
                t for t in pool.map(lambda start: self._joined(start[0], start[1], FEW, None), begun) if t is not None
            ]
            # each form on from its best start: one with a long way to go is behind after a few steps
            best = {(t.id, t.cause.form.name): t for t in sorted(first, key=lambda t: -t.score)}
            tried = list(pool.map(lambda t: self._carried(t, MORE), best.values()))
        near = [t for t in tried if not departed(self.short, t.fit, len(t.fit.structure.causes) - 1)]
        fits = [self._carried(t, ALL).fit for t in sorted(near, key=lambda t: t.score)[:2]]
        others = [fit for fit in fits if not departed(self.short, fit, len(fit.structure.causes) - 1)]
        return min([now, *others], key=lambda fit: fit.chi2)

    def _without(self, fit: Fit, index: int) -> Fit:
        """The fit without one of its causes, a few steps on."""
        structure, x = reduced(fit, index)
        return refit(self.short, structure, x, 10, 1e-5)

    def _near(self, before: float, ranked: Sequence[Trial], most: int = RIVALS) -> list[Trial]:
        """Those that stood close behind the first of a stage, `most` at the most. `before`: χ² there."""
        gain = before - ranked[0].fit.chi2
        return [t for t in ranked[1 : 1 + most] if before - t.fit.chi2 > CLOSE * gain]

    def _shaped(self, trial: Trial) -> Trial:
        """A trial with that one of its causes in another form of which it gains most; its own cause stays the last."""
        again = self._trial(last(self.recurved(trial.fit), trial.id))
        return again if again.score < trial.score and believable(again.fit, self.prepared) else trial

    def _told(self, trial: Trial) -> Trial:
        """A trial in its best shapes, where it leaves something that tells of them."""
        return self._shaped(trial) if unexplained(trial.fit.chi2, self.expected) > 0.0 else trial

    def _in_shape(self, now: Fit, ranked: list[Trial], first: bool, anyway: bool) -> list[Trial]:
        """The best and those near it with the causes in their best shapes, where the best leaves something that tells
        them apart, or is a law drawn through points, and another comes in front so, or a further cause leaves next to
        nothing; or `anyway`."""
        best = ranked[0]
        near = self._near(now.chi2, ranked)
        # a curve through points is that of any other cause but for crumbs
        told = unexplained(best.fit.chi2, self.expected) > 0.0 or drawn(best)
        if not anyway and not (near and told):
            return ranked
        with ThreadPoolExecutor(WORKERS) as pool:
            shaped = list(pool.map(self._shaped, [best, *near]))
        lead = plainer_first(now, sorted(shaped, key=lambda t: t.score))[0]
        if lead.score > shaped[0].score - LATER * self.prepared.memory:
            lead = shaped[0]
        clean = lead.fit.chi2 - self.expected < CLEAN * max(now.chi2 - self.expected, 0.0)
        if lead.id == best.id and not (anyway or (clean and not first)):
            return ranked
        asked = {t.id for t in shaped}
        rest = [*(t for t in shaped if t is not lead), *(t for t in ranked if t.id not in asked)]
        return [lead, *sorted(rest, key=lambda t: t.score)]

    def _a_longer_wave(self, ranked: Sequence[Trial]) -> Trial | None:
        """The first of the candidates with a somewhat longer wave than is sought, where it ends within that and leaves
        far less than any other that is believed; else None. Part of one wave is any curve, but then no other has it."""
        fit, form = ranked[0].fit, ranked[0].cause.form
        if not ripples(form):
            return None
        limits = next(p for p in form.parameters if p.name == "period")
        form, values = with_periods(form, limits.lower, FURTHER * limits.upper), fit.structure.values(fit.x)
        pad = fit.x[: len(fit.structure.pad.coordinates)]
        longer = self._trial(waving(self.short, fit, len(values) - 1, form, values[-1], pad, ALL))
        others = (t.fit.chi2 for t in ranked[1:] if believable(t.fit, self.prepared))
        left, next_left = longer.fit.chi2 - self.expected, min(others, default=np.inf) - self.expected
        return longer if believable(longer.fit, self.prepared) and next_left > FAR_LESS * max(left, 0.0) else None

    def _united(self, now: Fit, beside: Trial) -> Fit:
        """The fit with one cause in place of two of a kind, itself and another shape of it: a shape that has what both
        have, from their numbers; the fit itself where there is none."""
        own = len(self.believed.causes)
        index = next((k for k, c in enumerate(now.structure.causes) if k >= own and c.id == beside.id), None)
        if index is None:  # what is believed stays as it is
            return now
        both = beside.fit.structure.values(beside.fit.x)
        one, other = both[index], both[-1]
        told_by_other = {p.name for p in beside.cause.fitted}
        structure, x = reduced(beside.fit, len(both) - 1)
        structure, x = reduced(replace(beside.fit, structure=structure, x=x), index)
        without = replace(beside.fit, structure=structure, x=x)
        best = now
        for form in beside.cause.effect.forms:
            cause = cause_of(beside.cause.effect, narrowed(form, self.reach))
            amplitude = cause.amplitude
            names = {p.name for p in cause.fitted}
            if amplitude is None or amplitude.name not in one.keys() & other.keys() or not names > told_by_other:
                continue
            for values in ({**other, **one}, {**one, **other}):
                told = {name: value for name, value in values.items() if name in names}
                told[amplitude.name] = one[amplitude.name] + other[amplitude.name]
                trial = self._joined(without, cause.with_start(**told), ALL, None)
                if trial is not None and trial.fit.chi2 < best.chi2 and believable(trial.fit, self.prepared):
                    best = trial.fit
        return best

    def _reshaped(self, before: float, after: float, reshaped: float) -> bool:
        """Whether another shape of a cause found does what a further cause did. All are χ²."""
        return before - reshaped > AS_WELL * (before - after) and not self._alone_clean(before, after, reshaped)

    def _stays_beside(self, now: Fit, reshaped: Fit, further: Fit) -> bool:
        """Whether a further cause takes much of what it takes from a fit, and most of what is left, where that has a
        second one of a kind too: then both are missing, the further cause and the shape."""
        cause = further.structure.causes[-1].with_start(**further.structure.values(further.x)[-1])
        both = self._joined(reshaped, cause, ALL, None)
        if both is None:
            return False
        taken, left = reshaped.chi2 - both.fit.chi2, reshaped.chi2 - self.expected
        return taken > max(MUCH * (now.chi2 - further.chi2), MOST * left)

    def _simpler(self, now: Fit, reshaped: Fit, further: Fit) -> bool:
        """Whether a further cause leaves next to nothing of what a fit leaves, and is better than a second one of a
        kind, or as good with fewer numbers: what two of a kind can do together tells nothing of its shape."""
        better = reshaped.chi2 - further.chi2
        surely = better > no_rival(further, self.expected, self.prepared.memory)
        no_worse = further.free < reshaped.free or (further.free == reshaped.free and surely)
        return better >= 0.0 and no_worse and further.chi2 - self.expected < LITTLE * (now.chi2 - self.expected)

    def _alone_clean(self, before: float, after: float, reshaped: float) -> bool:
        """Whether a further cause leaves nothing, and another shape of a cause found something beyond chance."""
        left = max(before - self.expected, 1e-9)
        return self._clean(before, after) and reshaped - after > max(UNCLEAN * left, RIVAL * self.prepared.memory)

    def _clean(self, before: float, after: float) -> bool:
        """Whether a fit leaves nothing of what was left before. Both are χ²."""
        return after - self.expected < max(CLEAN * (before - self.expected), float(np.sqrt(2.0 * self.expected)))


def no_rival(fit: Fit, expected: float, memory: float) -> float:
    """Δχ² by which a fit must be better or worse than another, or neither excludes the other: what it leaves counts as
    noise. `expected`, `memory`: of the data that its χ² is of."""
    return RIVAL * max(fit.chi2 / expected, memory)
