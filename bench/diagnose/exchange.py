"""Causes found that go for others: those that stood near one are tried in its place once more is known."""

from __future__ import annotations

from .evidence import RIVAL, believable, unexplained
from .numbers import shapes_of
from .path import Measure, Path, Trial
from .refit import Fit, last, refit
from .shaping import RIVALS, Shaping, no_rival
from .sieve import ALL, BETTER, COMPARED, drawn, plainer_first

NEARLY = 0.95  # of what a cause takes: what another takes in its place that its best shape may do better
MISSED, SHAPED = 0.75, 2  # of what a further cause takes, that it took in the shape in which it came in; and how many
# rivals are asked for their shapes then
NOTHING = 1.05  # times what noise leaves
TRIED, TRIED_AGAIN = (5, 4), (8, 6)  # in a cause's place, of the first where it came in, and at the path's end
MUCH = 2.0  # times what noise leaves: no shape that is known is right then
MOST_NEAR = 8  # that stood close behind a cause with no more numbers, and are tried in its place


class Exchange(Shaping):
    """Causes of a path in the place of each other."""

    def exchanged(self, path: Path) -> Fit:
        """The last fit, or a better one with one of its earlier causes exchanged for one that stood beside it, or left
        out. Where nothing is left, those alone that stood near: what made them worse may have been the other cause.
        Once more, among more, where the same causes stay but in other shapes, and leave something that is no more than
        the noise: beside its wrong shape a cause may have been in the way of what is missing."""
        found = path.fits[-1]
        best = self._exchanged(path, found, TRIED)
        stayed = {c.id for c in best.structure.causes} == {c.id for c in found.structure.causes}
        other = set(shapes_of(best.structure)) != set(shapes_of(found.structure))
        something = unexplained(best.chi2, self.expected) > 0.0 and best.chi2 < MUCH * self.expected
        if stayed and other and something:
            best = self._exchanged(path, best, TRIED_AGAIN)
        return best

    def _exchanged(self, path: Path, fit: Fit, tried: tuple[int, int]) -> Fit:
        """A fit of the causes at a path's end, or a better one with one of the earlier ones exchanged."""
        best, told = fit, False
        own = len(self.believed.causes)
        for index in range(own, len(best.structure.causes)):
            present = {c.id for c in best.structure.causes}
            rivals = [i for i in self._stood_beside(path, index - own, tried) if i not in present]
            if not rivals:
                continue
            without = self._without(best, index)
            if without.chi2 < best.chi2:  # it was in the way
                return refit(self.short, without.structure, without.x, ALL, 1e-8)
            room = RIVAL * self.prepared.memory if self._a_limit(best, index) else 0.0
            for other in self.ranked(without, only=rivals)[:1]:
                best, told = self._better(best, other, without.chi2, room, told)
        return best

    def _stood_beside(self, path: Path, stage: int, tried: tuple[int, int]) -> list[str]:
        """Ids that are tried in the place of the cause that came in at a stage: so many of the first there, and of
        those at the path's end."""
        stage = min(stage, len(path.tried) - 1)
        stood = path.rivals[stage]
        near = self._near(path.measures[stage].before, stood, MOST_NEAR)
        if self._times_left(path) <= NOTHING:
            return [t.id for t in near[:RIVALS]]
        plain = [t.id for t in near if t.fit.free <= stood[0].fit.free]
        there, now = tried
        return list(dict.fromkeys([*path.tried[stage][:there], *plain, *path.tried[-1][:now]]))

    def _better(self, fit: Fit, other: Trial, before: float, room: float, told: bool) -> tuple[Fit, bool]:
        """(A fit, or one with another cause in the place of one of its own where that is better; whether the fit's own
        causes have been asked for their best shapes, as before where `told`). `before`: χ² with neither; `room`: by
        which the other may be worse."""
        score = self._to_beat(fit) + room
        shaped, worse = other, other.score >= score
        if worse and before - other.fit.chi2 > NEARLY * (before - fit.chi2):
            shaped = self._told(other)
        asked = shaped is not other or (not worse and unexplained(fit.chi2, self.expected) > 0.0)
        if asked and not told:  # shapes against shapes
            fit, told = self.recurved(fit), True
            score = self._to_beat(fit) + room
            if shaped is other and other.score >= score:
                shaped = self._told(other)
        better = shaped.score < score and believable(shaped.fit, self.prepared)
        return (shaped.fit if better else fit), told

    def _a_limit(self, fit: Fit, index: int) -> bool:
        """Whether a cause is at a bound: then it is another's limit, as what came in beside it has shown."""
        return not believable(last(fit, fit.structure.causes[index].id), self.prepared)

    def _to_beat(self, fit: Fit) -> float:
        """The score below which another fit is better by more than what both leave."""
        return fit.chi2 + self._penalty(fit) - BETTER * max(fit.chi2 / self.expected, 1.0)

    def _times_left(self, path: Path) -> float:
        """What was found leaves, in what noise leaves."""
        return path.fits[-1].chi2 / self.expected

    def _measure(self, before: Fit) -> Measure:
        """By which the χ² of a stage after a fit are judged, as the data are now."""
        return Measure(before.chi2, self.expected, self.effective, self.prepared.memory)

    def _wave_for_a_law(self, path: Path) -> None:
        """At a path's end an error of the position that repeats, in the place of a law through points, where that is
        all that the law does beside the other causes: which of the two is told once those are there."""
        final = path.fits[-1]
        own, causes = len(path.fits[0].structure.causes), final.structure.causes
        index = next((k for k, c in enumerate(causes) if k >= own and c.id == "elastic_law"), None)
        if index is None or len(causes) < own + 2:
            return
        law = self._trial(last(final, "elastic_law"))
        if not drawn(law) or any(c.id == "encoder_error" for c in causes):
            return
        without = self._without(final, index)
        law, *beside = (self._shaped(t) for t in [law, *self.ranked(without, only=["encoder_error"])])
        wave = plainer_first(without, [law, *beside])[0]
        if wave is law or not believable(wave.fit, self.prepared):
            return
        path.fits[-1] = wave.fit
        path.compared[wave.id] = (wave, [law], self._measure(without))

    def _compare(self, path: Path) -> None:
        """Causes that came in amid others which have gone since, or behind one, or in another shape that missed much of
        what they take, beside what stood near them there, where the path has ended: the others' errors, and those of a
        shape, tell nothing of how sure their names are."""
        final = path.fits[-1]
        own = len(path.fits[0].structure.causes)
        named = [c.id for c in final.structure.causes]
        for index in range(own, len(named)):
            stage = path.stage_of(named[index])
            if stage is None:
                continue
            came, beside, then = stage
            amid = not {c.id for c in came.fit.structure.causes} <= set(named)
            surely = came.fit.chi2 - no_rival(came.fit, then.expected, then.memory)
            amid |= any(t.fit.chi2 < surely for t in beside if t.id not in named)
            other = index > own and came.cause.form.name != final.structure.causes[index].form.name
            if not (amid or other):
                continue
            without = self._without(final, index)
            missed = then.before - came.fit.chi2 < MISSED * (without.chi2 - final.chi2)
            if not (amid or missed):
                continue
            near = [i for i in dict.fromkeys(t.id for t in (*beside, *path.rivals[0])) if i not in named][:COMPARED]
            now = self._trial(last(final, named[index]))
            rivals = self.ranked(without, only=near)
            if not amid:
                rivals = sorted(
                    (self._shaped(t) if k < SHAPED else t for k, t in enumerate(rivals)), key=lambda t: t.score
                )
            path.compared[now.id] = (now, rivals, self._measure(without))
