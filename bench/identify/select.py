"""Which law, which order, which contact: the candidates, the evidence, the choice."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from . import objective
from .condense import condensed
from .estimate import Estimate, over_the_edge, polish, search
from .held_out import held_out_square
from .laws import Family
from .objective import Structure
from .problem import Problem
from .starts import Bounds, Starter, bounds_of
from .uncertainty import independent_samples

CONTENDERS = 6  # candidates polished before they are compared
CLEAR = 6.0  # difference of the criterion that decides (some 20 to 1 in odds)
POORER = 2.0  # times the error
LARGE = 40_000  # samples beyond which candidates are compared on a finer stand-in of about so many blocks
# The position's noise is better out: sample by sample a law gains where it is soft at the depth of a long hold alone.
FINE = 0.015  # growth of its blocks in a hold: what they leave out is small against the least difference that counts
RESOLVED = 1e-5  # of the largest force: no force channel is better, no difference of errors below it means anything


@dataclass(frozen=True, eq=False)
class Candidate:
    """A fitted structure with its evidence; V and `held_out_square` in scaled force squared."""

    estimate: Estimate
    V: float
    held_out_square: float = float("nan")
    criterion: float = float("nan")

    @property
    def size(self) -> int:
        """Number of parameters."""
        return self.estimate.structure.size

    @property
    def eligible(self) -> bool:
        """Whether it may be chosen: physical, every mode distinct, the search ended."""
        return self.estimate.physical and self.estimate.distinct and self.estimate.converged


@dataclass(frozen=True)
class Choice:
    """The candidate chosen, polished on all the data, and everything it was compared with."""

    best: Candidate
    candidates: list[Candidate]
    independent: float


def choose(
    problem: Problem,
    families: Sequence[Family],
    orders: Sequence[int],
    contacts: Sequence[bool],
    progress: Callable[[str], None],
) -> Choice:
    """Fit every structure asked for and choose.

    The criterion is n_e ln V + P ln n_e; n_e is the number of independent samples that the residual of the
    candidate with the least V is worth, so that coloured residuals do not buy modes. The lowest wins, unless a
    simpler one is within `CLEAR` of it and predicts left-out blocks as well, or predicts them 5 % better at all and is
    not `POORER` on what it was fitted to (one that no left-out block resembles tells nothing of either).
    Contact is chosen first, by the lowest criterion; where the pad never lets go in the simulation the two are one
    model, and `unilateral` is what it is called.
    """
    short, owners = condensed(problem)
    fine = finer(problem)
    bounds = bounds_of(problem)
    ladders = {True: [Ladder(short, f, True, bounds) for f in families] if True in contacts else [],
               False: [Ladder(short, f, False, bounds) for f in families] if False in contacts else []}  # fmt: skip
    exact = len(orders) == 1
    first = min(max(min(orders), 2), max(orders))
    for unilateral in contacts:
        if not unilateral and True in contacts and not _lets_go(short, ladders[True]):
            continue  # the two contacts are one model
        for ladder in ladders[unilateral]:
            progress(f"{ladder.name}, {'unilateral' if unilateral else 'bonded'}, order 1 to {first}")
            ladder.climb(first, exact)
    for ladder in _worth_climbing(ladders):
        if max(orders) > first:
            progress(f"{ladder.name}, order {first + 1} to {max(orders)}")
        ladder.climb(max(orders), exact)
    estimates = [e for side in ladders.values() for ladder in side for e in ladder.found if e.structure.order in orders]
    candidates = [Candidate(e, e.cost / problem.weight) for e in estimates]
    lowest = min(candidates, key=lambda c: c.V)
    refined = polish(fine, lowest.estimate)
    independent = independent_samples(problem, refined.x, refined.structure)
    # Means of blocks leave out the scatter within the blocks, which is the same for whatever is fitted to them.
    V = objective.cost(problem, refined.structure, refined.x) / problem.weight
    scatter = V - refined.cost / fine.weight
    candidates = [judged(c, independent) for c in candidates]
    ranked = sorted(candidates, key=lambda c: (not c.eligible, c.criterion))
    finished = []
    for rank, c in enumerate(ranked):
        progress(f"comparing {c.estimate.structure.family.name}, order {c.estimate.structure.order}")
        finished.append(_finished(c, fine, short, owners if fine is problem else None, independent, scatter, rank))
    best = _pick(finished, exact)
    e = polish(problem, best.estimate)
    near = polish(short, e)
    beside = over_the_edge(short, near)
    if beside is not near:
        e = min(e, polish(problem, beside), key=lambda one: one.cost)
    ended = judged(replace(best, estimate=e, V=e.cost / problem.weight), independent)
    return Choice(ended, [ended if c is best else c for c in finished], independent)


def finer(problem: Problem) -> Problem:
    """What candidates are compared on: the data themselves, or a stand-in of some `LARGE` blocks."""
    return condensed(problem, LARGE, FINE)[0] if problem.size > LARGE else problem


def _finished(
    c: Candidate,
    fine: Problem,
    short: Problem,
    owners: list[NDArray[np.intp]] | None,
    independent: float,
    scatter: float,
    rank: int,
) -> Candidate:
    """V and held-out error; a contender is polished first, one far behind is taken as it is.

    `owners`: of each run, the short sample of every one of `fine`; without, left-out blocks are those of `short`.
    `scatter`: what `fine` leaves out of V.
    """
    contender = rank < CONTENDERS
    e = polish(fine, c.estimate) if contender else c.estimate
    V = (e.cost if contender else objective.cost(fine, e.structure, e.x)) / fine.weight + scatter
    steps = 25 if contender else 5
    if owners is not None:
        return judged(Candidate(e, V, held_out_square(short, fine, owners, e, steps)), independent)
    within = V - objective.cost(short, e.structure, e.x) / short.weight
    alone = [np.arange(run.size) for run in short.runs]
    return judged(Candidate(e, V, held_out_square(short, short, alone, e, steps) + within), independent)


class Ladder:
    """Fits of one law and contact, of rising order: each starts from the grid and from the one below, so that V does
    not rise with the order."""

    def __init__(self, problem: Problem, family: Family, unilateral: bool, bounds: Bounds) -> None:
        self.problem, self.family, self.unilateral, self.bounds = problem, family, unilateral, bounds
        self.name = f"{family.name} {family.degree or ''}".strip()
        self.found: list[Estimate] = []
        self._starter = Starter(problem, family, unilateral, bounds)

    def climb(self, order: int, to_the_end: bool) -> None:
        """Fit up to `order`; unless `to_the_end`, no further than where one mode more gains nothing at all."""
        while len(self.found) < order and (to_the_end or not self._idle()):
            r = len(self.found) + 1
            starts = self._starter.first(r)
            if self.found:
                starts += self._starter.next(self.found[-1].structure, self.found[-1].x)
            self.found.append(
                search(
                    self.problem, Structure(self.family, r, self.unilateral, self.problem.pasts), starts, self.bounds
                )
            )

    def _idle(self) -> bool:
        if len(self.found) < 2:
            return False
        before, last = (max(e.cost, 1e-300) for e in self.found[-2:])
        # Two parameters must lower n_e ln V by 2 ln n_e; n_e is at most the number of samples.
        return self.problem.weight * float(np.log(before / last)) < 2.0


def _worth_climbing(ladders: dict[bool, list[Ladder]]) -> list[Ladder]:
    """Those of the contact that fits better so far; of both where they are close."""
    least = {side: min((e.cost for one in many for e in one.found), default=np.inf) for side, many in ladders.items()}
    return [one for side, many in ladders.items() for one in many if least[side] <= 1.1 * min(least.values())]


def _lets_go(problem: Problem, ladders: list[Ladder]) -> bool:
    return any(
        bool(gone.any())
        for one in ladders
        for e in one.found
        for _, gone, _ in objective.forces(problem, e.structure, e.x)
    )


def judged(c: Candidate, independent: float) -> Candidate:
    """The candidate with its criterion, for residuals worth so many independent samples."""
    V = c.V + RESOLVED**2  # the scaled force is 1 at most
    return replace(c, criterion=independent * float(np.log(V)) + c.size * float(np.log(independent)))


def _pick(candidates: list[Candidate], order_given: bool) -> Candidate:
    """The best of those that may be chosen; of an order that was asked for, all that are physical may."""
    able = [c for c in candidates if c.eligible]
    ended = [c for c in candidates if c.estimate.physical and c.estimate.converged]
    if order_given:
        able = ended
    elif able:  # a force that goes on falling is no reason to leave out the mode that it needs
        least = min(c.criterion for c in able) - 2 * CLEAR
        able += [c for c in ended if not c.eligible and c.estimate.distinct_but_slow and c.criterion < least]
    if able:  # a search that came to no end is no reason to take one that has twice its error
        least = min(c.V for c in able) / POORER**2
        able += [c for c in candidates if c.estimate.physical and c.estimate.distinct and least > c.V]
    able = able or candidates
    able = sorted(able, key=lambda c: c.criterion)
    # The contact whose best is best; a tie goes to the pad that can let go.
    for c in able:
        if c.estimate.structure.unilateral and c.criterion < able[0].criterion + 2.0:
            able = [a for a in able if a.estimate.structure.unilateral]
            break
    else:
        able = [a for a in able if not a.estimate.structure.unilateral]
    best = able[0]
    for c in sorted(able[1:], key=lambda c: c.size):
        if c.size >= best.size:
            continue
        as_well = c.held_out_square <= best.held_out_square and c.criterion < best.criterion + CLEAR
        if as_well or (1.1 * c.held_out_square < best.held_out_square and c.V < POORER**2 * best.V):
            return c
    return best
