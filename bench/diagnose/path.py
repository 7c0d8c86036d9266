"""What a search has been through: candidates joined to a fit, and the path from cause to cause."""

from __future__ import annotations

from dataclasses import dataclass, field

from .evidence import Evidence
from .numbers import Cause
from .refit import Fit


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

    @property
    def usual(self) -> bool:
        """Whether it is the first form of its family."""
        return self.cause.form.name == self.cause.effect.forms[0].name


@dataclass(frozen=True)
class Measure:
    """By which the χ² of a stage are judged: what the fit before it left, what noise alone leaves, the samples that say
    something of their own, and those that say the same as one and count all the same.

    Kept with the stage, for the path's fits go on: to whitened data, and to other samples counted.
    """

    before: float
    expected: float
    effective: float
    memory: float


Stage = tuple[Trial, list[Trial], Measure]
"""Where a cause came in: itself joined there, what stood beside it, by what χ² was judged."""


@dataclass
class Path:
    """Causes in the order found, with the fits along the way (`fits[0]`: none of them) and what stood beside each."""

    fits: list[Fit]
    rivals: list[list[Trial]] = field(default_factory=list)
    tried: list[list[str]] = field(default_factory=list)
    """Ids, best first, with those that could not be believed where they stood."""
    measures: list[Measure] = field(default_factory=list)
    evidence: list[Evidence] = field(default_factory=list)
    compared: dict[str, Stage] = field(default_factory=dict)
    """By id, a cause beside its rivals where the path has ended: of those that came in amid causes that have gone."""

    cut_short: bool = False
    """Whether the search's work was done before it could look for what is left."""

    def stage_of(self, id_: str) -> Stage | None:
        """Where a cause came in, or was compared anew."""
        if id_ in self.compared:
            return self.compared[id_]
        turns = zip(self.rivals, self.measures, strict=True)
        stages = [(own, ranked, measure) for ranked, measure in turns for own in ranked if own.id == id_]
        if not stages:
            return None
        # one that came in place of another stood near it there, and far behind where it was no cause yet
        own, ranked, measure = max(stages, key=lambda stage: _of_the_best(*stage))
        return own, [t for t in ranked if t.id != id_], measure


def _of_the_best(own: Trial, ranked: list[Trial], measure: Measure) -> float:
    """Share that a candidate takes of what the first of its stage takes."""
    taken = measure.before - ranked[0].fit.chi2
    return 1.0 if own is ranked[0] else min((measure.before - own.fit.chi2) / max(taken, 1e-9), 1.0)
