"""A search that is told what it finds: fits are made up, an id and a χ²."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from bench.diagnose.evidence import Evidence
from bench.diagnose.search import Search
from bench.diagnose.work import Work

NOISE = 1000.0


def fit(chi2: float, *ids: str) -> Any:
    """A fit of causes by their ids, each with the name of its form behind a stroke where that is not the first."""
    pairs = [i.partition("/") for i in ids]
    causes = tuple(SimpleNamespace(id=i, form=SimpleNamespace(name=name, has_a_course=False)) for i, _, name in pairs)
    return SimpleNamespace(chi2=chi2, structure=SimpleNamespace(causes=causes), free=len(ids))


class Told(Search):
    """A search that is told what it finds: by the ids found so far, the candidates with their χ², best first.
    Where the last one found is told with its χ², that is of this one alone. `shapes`: χ² in another shape, by the χ²
    without; a fit to which another is added has one too then."""

    def __init__(
        self,
        ranks: dict[tuple[str | float, ...], dict[str, float]],
        together: Any,
        shapes: dict[float, float] | None = None,
    ) -> None:
        short = SimpleNamespace(work=Work())
        self.prepared: Any = SimpleNamespace(memory=1.0, felt=SimpleNamespace(late_s=0.0), sample_s=0.001, short=short)
        self.samples, self.ranks, self.together, self.exchanges = NOISE, ranks, together, 0
        self.shapes = shapes or {}

    @property
    def expected(self) -> float:
        return NOISE

    @property
    def effective(self) -> float:
        return NOISE

    def ranked(self, now: Any, only: Any = None, least: float = 0.0) -> list[Any]:
        ids = tuple(c.id for c in now.structure.causes)
        found = self.ranks.get((*ids, now.chi2), self.ranks.get(ids, {}))
        return [SimpleNamespace(id=i, fit=fit(chi2, *ids, i), score=chi2) for i, chi2 in found.items()]

    def _felt(self, path: Any) -> None:
        """There are no data."""

    def _late_by_chance(self, path: Any, fit: Any) -> bool:
        return False

    def _compare(self, path: Any) -> None:
        """The same."""

    def settled(self, now: Any, joined: Any) -> Any:
        return now

    def recurved(self, now: Any) -> Any:
        return fit(self.shapes.get(now.chi2, now.chi2), *(c.id for c in now.structure.causes))

    def _shaped(self, trial: Any) -> Any:
        chi2 = self.shapes.get(trial.fit.chi2, trial.fit.chi2)
        return SimpleNamespace(id=trial.id, fit=fit(chi2, *(c.id for c in trial.fit.structure.causes)), score=chi2)

    def _carried(self, trial: Any, steps: int) -> Any:
        return trial

    def exchanged(self, path: Any) -> Any:
        self.exchanges += 1
        return self.together or path.fits[-1]

    def judge(self, before: Any, after: Any, base: Any) -> Evidence:
        delta = before.chi2 - after.chi2
        share, of_left = delta / (base.chi2 - NOISE), delta / max(before.chi2 - NOISE, delta, 1e-9)
        return Evidence(delta, delta, 1, 15.0, share, delta / NOISE, of_left, len(before.structure.causes))


def named(search: Search) -> list[str]:
    return [c.id for c in search.path(fit(3e6)).fits[-1].structure.causes]
