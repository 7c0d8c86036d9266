"""The default method: continuous-time quasi-linear model (5)-(10), least squares of the simulation error (16).

Positive shares and rates by construction, law and order given or chosen, any time stamps, several runs at once.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence

import numpy as np

from bench.errors import InputError
from bench.recording.types import Measurement

from . import notes, objective
from .laws import Family, exponential, polynomial, power
from .noise import noise_of
from .parameters import model_dict, parameters
from .problem import Problem, build
from .profile import not_told
from .result import Evidence, FitResult, Trace
from .select import Candidate, Choice, choose
from .surface import doubtful, moved_mm, with_surfaces
from .uncertainty import spread_of

LAWS = ("exponential", "power", "polynomial")
ORDERS = (1, 2, 3, 4)
DEGREES = (2, 3, 4)  # tried where the degree of a polynomial is not given
MOST_ORDERS = 8


def fit(
    measurements: Sequence[Measurement],
    law: str = "auto",
    order: int | str = "auto",
    contact: str = "auto",
    degree: int | None = None,
    progress: Callable[[str], None] | None = None,
) -> FitResult:
    """Fit one pad to all measurements; each starts from rest. Raises InputError as `identify.fit` does."""
    begun = time.perf_counter()
    families = _families(law, degree)
    orders = _orders(order)
    contacts = {"auto": (True, False), "unilateral": (True,), "bonded": (False,)}.get(contact)
    if contacts is None:
        raise InputError("--contact", f"there is no contact `{contact}`", "One of: auto, bonded, unilateral.")
    problem = build(measurements)
    noise = noise_of(problem.measurements)
    problem = doubtful(problem, noise.floor_N)
    families = [with_surfaces(family, problem) for family in families]
    choice = choose(problem, families, orders, contacts, progress or (lambda _: None))
    best = choice.best.estimate
    spread = spread_of(problem, best)
    found, covariance, undetermined = parameters(problem, best, spread)
    relative = {
        n: p.std / p.value for n, p in found.items() if n[:2] in ("c_", "nu") and np.isfinite(p.std) and p.value
    }
    loose = not_told(problem, best, relative, spread.samples) if best.physical else set()
    undetermined = [name for name in found if name in undetermined or name in loose]
    traces = _traces(problem, choice.best)
    structure = best.structure
    unit = problem.force_N**2
    force = np.concatenate([t.force_N[t.counted] for t in traces])
    error = np.concatenate([t.residual_N[t.counted] for t in traces])
    variation = float(np.linalg.norm(force - force.mean()))
    V = float(np.mean(error**2))
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
        fit_percent=100 * (1 - float(np.linalg.norm(error)) / variation) if variation > 0 else 0.0,
        physical=best.physical,
        converged=best.converged,
        undetermined=undetermined,
        held_out_rmse=math.sqrt(choice.best.held_out_square * unit),
        samples=len(force),
        seconds=time.perf_counter() - begun,
        degree=structure.family.degree or None,
        traces=traces,
        evidence=_evidence(choice, unit),
        notes=notes.about_data(problem, noise, structure.unilateral) + notes.about_fit(problem, best),
        noise=noise,
        independent_samples=spread.samples,
        covariance=covariance,
        surface_moved_mm=moved_mm(problem, structure.family, structure.split(best.x)[0]),
    )


def _families(law: str, degree: int | None) -> list[Family]:
    if law not in (*LAWS, "auto"):
        raise InputError("--law", f"there is no law `{law}` here", f"One of: {', '.join((*LAWS, 'auto'))}.")
    if degree is not None and not 1 <= degree <= 8:
        raise InputError("--degree", f"{degree} is no degree of a polynomial to fit", "From 1 to 8.")
    if degree is not None and law not in ("polynomial", "auto"):
        raise InputError("--degree", f"the {law} law has no degree", "Use it with `--law polynomial`.")
    several = [polynomial(n) for n in ((degree,) if degree else DEGREES)]
    if law == "polynomial":
        return several
    named = {"exponential": [exponential()], "power": [power()]}
    return named[law] if law != "auto" else [exponential(), power(), *several]


def _orders(order: int | str) -> tuple[int, ...]:
    if order == "auto":
        return ORDERS
    try:
        r = int(order)
    except ValueError:
        r = 0
    if not 1 <= r <= MOST_ORDERS:
        raise InputError("--order", f"`{order}` is no order", f"`auto`, or a whole number from 1 to {MOST_ORDERS}.")
    return (r,)


def _traces(problem: Problem, best: Candidate) -> list[Trace]:
    simulated = objective.forces(problem, best.estimate.structure, best.estimate.x)
    out = []
    for m, run, at, (force, _, _) in zip(problem.measurements, problem.runs, problem.where, simulated, strict=True):
        position = run.u[at] * problem.depth_mm
        model = force[at] * problem.force_N
        out.append(Trace(m.name, m.force_time_s, position, m.force_N, model, run.weight[at] > 0))
    return out


def _evidence(choice: Choice, unit: float) -> list[Evidence]:
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
                V=c.V * unit,
                criterion=c.criterion - least,
                held_out_rmse=math.sqrt(c.held_out_square * unit),
                eligible=c.eligible,
                chosen=c is choice.best,
            )
        )
    return out
