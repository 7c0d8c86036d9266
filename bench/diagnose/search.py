"""Which causes a set of data asks for: every candidate by a joint refit, causes added and taken away one by one.

Candidates are sieved: a few steps from several starts for all of them, more for the better half, to the end for the
best few, all on the short stand-in; what is compared at last has converged.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .candidates import Signatures, forms, starts
from .data import Prepared
from .evidence import Evidence, believable, evidence_of, penalty
from .numbers import Cause, Structure
from .refit import Fit, extended, force_at, reduced, refit

Array = NDArray[np.float64]

FEW, MORE, ALL = 3, 8, 40  # steps of the three rounds
HALF, BEST = 20, 7  # forms in the second round, ids in the third
MOST_CAUSES = 4


@dataclass(frozen=True)
class Trial:
    """A candidate joined to a fit: the joint fit on the stand-in, and what it is worth (`score`: lower is better)."""

    cause: Cause
    fit: Fit
    score: float

    @property
    def id(self) -> str:
        """The effect's id."""
        return self.cause.id


@dataclass
class Path:
    """Causes in the order found, with the fits along the way (`fits[0]`: none of them) and what stood beside each."""

    fits: list[Fit]
    rivals: list[list[Trial]] = field(default_factory=list)
    evidence: list[Evidence] = field(default_factory=list)


class Search:
    """One search on one measurement. `progress` is told what goes on."""

    def __init__(self, prepared: Prepared, structure: Structure, progress: Callable[[str], None]) -> None:
        self.prepared, self.progress = prepared, progress
        self.short = prepared.short
        self.believed = structure
        self.samples = float(prepared.full.weight.sum())
        self.effective = max(self.samples / prepared.colour.memory, 20.0)
        self.spans = np.bincount(prepared.owner, minlength=self.short.size)

    # --- the believed structure ------------------------------------------------------------------------------------

    def base(self, pads: Sequence[Array]) -> Fit:
        """The believed structure with its numbers refitted, from each of some vectors of the pad."""
        fits = [refit(self.short, self.believed, self.believed.x(x), 12, 1e-5) for x in pads]
        fits.sort(key=lambda f: f.chi2)
        ended = [refit(self.short, f.structure, f.x, 60, 1e-9) for f in fits[:2] if f.chi2 < 3 * fits[0].chi2]
        return min(ended, key=lambda f: f.chi2)

    # --- candidates ------------------------------------------------------------------------------------------------

    def ranked(self, fit: Fit, only: Sequence[str] | None = None) -> list[Trial]:
        """Every candidate joined to a fit: the best form of each id, best first."""
        data = self.short
        signatures = Signatures(data, fit)
        first: list[Trial] = []
        candidates = [(e, f) for e, f in forms(fit.structure, fit.structure.in_air) if only is None or e.id in only]
        for number, (effect, form) in enumerate(candidates):
            self.progress(f"candidate {number + 1} of {len(candidates)}: {effect.id}")
            joined = [self._joined(fit, s.cause, FEW) for s in starts(data, signatures, effect, form)]
            tried = [t for t in joined if t is not None]
            tried += self._from_believed(fit, tried)
            if tried:
                first.append(min(tried, key=lambda t: t.score))
        first.sort(key=lambda t: t.score)
        second = [self._carried(t, MORE) for t in first[:HALF]]
        second.sort(key=lambda t: t.score)
        ids: list[str] = []
        third: list[Trial] = []
        for t in second:
            if t.id not in ids:
                ids.append(t.id)
            if ids.index(t.id) < BEST and sum(x.id == t.id for x in third) < 3:
                third.append(self._carried(t, ALL))
        rest = [t for t in [*second, *first[HALF:]] if t.id not in {x.id for x in third}]
        return _best_of_each(third + rest)

    def _from_believed(self, fit: Fit, tried: Sequence[Trial]) -> list[Trial]:
        """The best of some starts again, with the pad as it was believed: a refit may have run far from it."""
        if not tried or fit.structure.causes[len(self.believed.causes) :]:
            return []
        best = min(tried, key=lambda t: t.score)
        structure = best.fit.structure
        start = structure.x(self.believed.pad.x(), structure.values(best.fit.x))
        again = self._solved(structure, start, FEW)
        return [] if again is None else [again]

    def _joined(self, fit: Fit, cause: Cause, steps: int) -> Trial | None:
        structure = fit.structure.with_cause(cause)
        own = structure.x(fit.x[: len(structure.pad.coordinates)])[structure.of_cause(len(structure.causes) - 1)]
        return self._solved(structure, extended(fit, structure, own), steps)

    def _solved(self, structure: Structure, x: Array, steps: int) -> Trial | None:
        if not np.isfinite(force_at(self.short, structure, x)).all():
            return None
        done = refit(self.short, structure, x, steps, 1e-6)
        return self._trial(done)

    def _trial(self, fit: Fit) -> Trial:
        return Trial(fit.structure.causes[-1], fit, fit.chi2 + self._penalty(fit))

    def _penalty(self, fit: Fit) -> float:
        return penalty(fit.free, self.effective) * self.prepared.colour.memory

    def _carried(self, trial: Trial, steps: int) -> Trial:
        return self._trial(refit(self.short, trial.fit.structure, trial.fit.x, steps, 1e-8))

    # --- the path --------------------------------------------------------------------------------------------------

    def path(self, base: Fit) -> Path:
        """Causes one after the other while each pays; then those that others have made needless go."""
        path = Path([base])
        while len(path.fits) <= MOST_CAUSES:
            now = path.fits[-1]
            ranked = self.ranked(now)
            ranked = [t for t in ranked if believable(t.fit, self.prepared)]
            if not ranked:
                break
            best = ranked[0]
            found = self.judge(now, best.fit, base)
            path.rivals.append(ranked)
            path.evidence.append(found)
            if not found.pays:
                break
            path.fits.append(best.fit)
            if len(path.fits) > 2:
                path.fits[-1] = self.exchanged(path)
        return path

    def judge(self, before: Fit, after: Fit, base: Fit) -> Evidence:
        """Whether the step from one fit to the next is more than chance, and more than a crumb."""
        short = self.short
        change = force_at(short, after.structure, after.x) - force_at(short, before.structure, before.x)
        direction = (np.sqrt(short.weight > 0) * change / short.sigma_N)[self.prepared.owner]
        inflation = self.prepared.colour.inflation(direction)
        return evidence_of(before, after, base, inflation, self.samples)

    def exchanged(self, path: Path) -> Fit:
        """The last fit, or a better one with one of its earlier causes exchanged for one that stood beside it."""
        best = path.fits[-1]
        score = best.chi2 + self._penalty(best)
        own = len(self.believed.causes)
        for index in range(own, len(best.structure.causes) - 1):
            rivals = [t.id for t in path.rivals[index - own][:5]] + [t.id for t in path.rivals[-1][:4]]
            present = {c.id for c in best.structure.causes}
            rivals = [r for r in dict.fromkeys(rivals) if r not in present]
            if not rivals:
                continue
            structure, x = reduced(best, index)
            without = refit(self.short, structure, x, 10, 1e-5)
            for trial in self.ranked(without, only=rivals)[:1]:
                if trial.score < score - 10 and believable(trial.fit, self.prepared):
                    best, score = trial.fit, trial.score
        return best


def _best_of_each(trials: Sequence[Trial]) -> list[Trial]:
    best: dict[str, Trial] = {}
    for t in trials:
        if t.id not in best or t.score < best[t.id].score:
            best[t.id] = t
    return sorted(best.values(), key=lambda t: t.score)
