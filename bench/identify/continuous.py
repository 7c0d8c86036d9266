"""The default method: continuous-time quasi-linear model (5)-(10), least squares of the simulation error (16).

Positive shares and rates by construction, law and order given or chosen, any time stamps, several runs at once.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence

from bench.recording.types import Measurement

from . import asked, notes
from .laws import Family
from .noise import Noise, no_louder, noise_of
from .nuisance import doubtful, moved_mm, with_doubts
from .parameters import model_dict, parameters
from .past import with_pasts
from .path import straightened
from .points import points
from .problem import Problem, build
from .profile import CERTAIN, not_told
from .result import Evidence, FitResult
from .select import Choice, choose
from .traces import figures_of, traces_of
from .uncertainty import spread_of
from .unformed import with_points

LAWS = ("exponential", "power", "polynomial", "spline")
DEGREES = (2, 3, 4)  # tried where the degree of a polynomial is not given


def fit(
    measurements: Sequence[Measurement],
    law: str = "auto",
    order: int | str = "auto",
    contact: str = "auto",
    degree: int | None = None,
    progress: Callable[[str], None] | None = None,
) -> FitResult:
    """Fit one pad to all measurements, each from rest unless it begins loaded; raises InputError as `identify.fit`."""
    begun = time.perf_counter()
    families = asked.families(law, degree, LAWS, DEGREES)
    orders = asked.orders(order)
    asked.contact_known(contact)
    contacts = {"auto": (True, False), "unilateral": (True,), "bonded": (False,)}[contact]
    problem = build(measurements, between=True, blocks=True)
    noise = noise_of(problem.measurements)
    problem, choice = _chosen(problem, noise, families, orders, contacts, progress)
    if problem.rebuilt:
        plain = with_pasts(doubtful(build(measurements, blocks=True), noise.floor_N), noise)
        on_lines = straightened(plain, choice)
        if on_lines is True:
            problem, choice = _chosen(plain, noise, families, orders, contacts, progress)
        elif on_lines:
            problem, choice = plain, on_lines
    if law == "auto" and degree is None:
        choice = with_points(problem, choice, orders, progress or (lambda _: None))
    best = choice.best.estimate
    spread = spread_of(problem, best)
    found, covariance, undetermined = parameters(problem, best, spread)
    relative = {n: p.std / p.value if p.value else math.nan for n, p in found.items() if n.startswith(("c_", "nu_"))}
    loose = not_told(problem, best, relative, spread.samples) if best.physical else set()
    loose |= set(undetermined)
    loose |= {"nu" + name[1:] for name in loose if name.startswith("c_")}  # a share that may be nothing has no rate
    heard = noise
    noise = no_louder(heard, math.sqrt(choice.best.V) * problem.force_N)
    about = notes.findings(problem, noise, best.structure.unilateral)
    about.notes += [notes.TOO_FAR_APART] if noise is not heard else []
    if about.still:
        loose -= {name for name in loose if name.startswith("nu_") and relative[name] < CERTAIN}
    loose |= about.lost(found)
    undetermined = [name for name in found if name in loose]
    traces = traces_of(problem, best)
    samples, V, fit_percent = figures_of(traces)
    structure = best.structure
    unit = problem.force_N**2
    # Block means of long data leave out the scatter within the blocks, the same for every candidate.
    within = max(V / unit - choice.best.V, 0.0) if problem.in_blocks else 0.0
    return FitResult(
        method="continuous",
        law=structure.family.name,
        order=structure.order,
        contact="unilateral" if structure.unilateral else "bonded",
        parameters=found,
        model_dict=model_dict(problem, best, found),
        filter=None,
        V=V,
        noise_floor=noise.floor_N,
        fit_percent=fit_percent,
        physical=best.physical,
        converged=best.converged,
        undetermined=undetermined,
        held_out_rmse=math.sqrt((choice.best.held_out_square + within) * unit),
        samples=samples,
        seconds=time.perf_counter() - begun,
        degree=structure.family.degree if structure.family.name == "polynomial" else None,
        traces=traces,
        evidence=_evidence(choice, unit, within),
        notes=about.notes + notes.about_fit(problem, best),
        noise=noise,
        independent_samples=spread.samples,
        covariance=covariance,
        surface_moved_mm=moved_mm(problem, structure.split(best.x)[0]),
    )


def _chosen(
    problem: Problem,
    noise: Noise,
    families: Sequence[Family],
    orders: Sequence[int],
    contacts: Sequence[bool],
    progress: Callable[[str], None] | None,
) -> tuple[Problem, Choice]:
    problem = with_pasts(doubtful(problem, noise.floor_N), noise)
    said = progress or (lambda _: None)
    given: Sequence[Family] = families or points(problem, contacts[0])
    choice = choose(problem, [with_doubts(f, problem) for f in given], orders, contacts, said)
    return problem, choice


def _evidence(choice: Choice, unit: float, within: float) -> list[Evidence]:
    ranked = sorted(choice.candidates, key=lambda c: c.criterion)
    least = ranked[0].criterion
    out = []
    for c in ranked:
        s = c.estimate.structure
        out.append(
            Evidence(
                law=s.family.name,
                degree=s.family.degree,
                order=s.order,
                contact="unilateral" if s.unilateral else "bonded",
                size=c.size,
                V=(c.V + within) * unit,
                criterion=c.criterion - least,
                held_out_rmse=math.sqrt((c.held_out_square + within) * unit),
                eligible=c.eligible,
                chosen=c is choice.best,
            )
        )
    return out
