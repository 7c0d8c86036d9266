"""One discrete scheme over laws and orders, and its result in the form of fit.json."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bench.errors import InputError
from bench.recording.types import Measurement
from sim.model import Model
from sim.transfer import NotARelaxation, relaxation_of

from .. import asked
from .._kernel import Array
from ..held_out import FOLDS, folds_of
from ..noise import noise_of
from ..notes import findings
from ..parameters import DOUBTFUL
from ..problem import Problem, Run
from ..result import Evidence, FitResult, Parameter, Trace
from ..select import RESOLVED
from . import choice
from .estimator import Estimator, Found, relative_V
from .series import Data, sampled
from .spread import covariance, independent, relaxation_jacobian
from .system import SOFTEST, Structure, named, simulate, values


@dataclass(frozen=True, eq=False)
class Candidate:
    """A law and order with its estimate."""

    structure: Structure
    found: Found
    criterion: float = float("nan")


def fit(
    estimator: Estimator,
    measurements: Sequence[Measurement],
    law: str = "auto",
    order: int | str = "auto",
    contact: str = "auto",
    degree: int | None = None,
    progress: Callable[[str], None] | None = None,
    sample_time: float | None = None,
) -> FitResult:
    """Sample the data, try the laws and orders, choose by n_e ln V + P ln n_e, report. Raises InputError."""
    begun = time.perf_counter()
    families, orders = choice.families(law, degree), asked.orders(order)
    data = sampled(measurements, sample_time)
    unilateral = choice.unilateral(data, contact)
    structures = [Structure(f, r, unilateral) for f in families for r in orders]
    candidates = _tried(estimator, data, structures, progress or (lambda _: None))
    best = candidates[0]
    if len(structures) > 1:
        full = replace(best, found=estimator.estimate(data, best.structure))
        if full.found.V <= best.found.V:
            candidates[0] = best = full
    return _result(estimator, data, best, candidates, begun)


def _tried(
    estimator: Estimator, data: Data, structures: list[Structure], progress: Callable[[str], None]
) -> list[Candidate]:
    """All that could be estimated, the chosen one first."""
    out, problems = [], []
    for structure in structures:
        progress(f"{structure.family.name}, order {structure.order}")
        try:
            out.append(Candidate(structure, estimator.estimate(data, structure, quick=len(structures) > 1)))
        except InputError as error:
            problems.append(error)
    if not out:
        raise problems[0]
    least = min(out, key=lambda c: c.found.V)
    n = independent(data, least.structure, least.found.v)
    judged = [
        replace(c, criterion=n * float(np.log(c.found.V + RESOLVED**2)) + c.structure.size * float(np.log(n)))
        for c in out
    ]
    return sorted(judged, key=lambda c: (not c.found.converged, c.criterion))


def _result(estimator: Estimator, data: Data, best: Candidate, candidates: list[Candidate], begun: float) -> FitResult:
    structure, found = best.structure, best.found
    unit = data.force_N**2
    traces = _traces(data, structure, found.v)
    force = np.concatenate([t.force_N[t.counted] for t in traces])
    variation = float(np.linalg.norm(force - force.mean())) if len(force) else 0.0
    V = found.V * unit
    noise = noise_of(data.on_grid())
    reading = _Reading(estimator, data, structure, found)
    reading.doubt_the_grid(estimator, data, structure, found)
    about = findings(data.checked, noise_of(data.checked.measurements), structure.unilateral, pasts=False)
    lost = about.lost(reading.parameters) | set(reading.undetermined)
    notes = [*about.notes, *data.notes, f"Sampled every {data.T:.6g} s.", *reading.notes, *found.notes]
    filter = structure.filter(found.v)
    history: dict[str, list[float]] = {"V": [V_n * unit for V_n, _ in found.history]}
    for _, v in found.history:
        for name, value in values(data, structure, v).items():
            history.setdefault(name, []).append(float(value))
    return FitResult(
        method=estimator.name,
        law=structure.family.name,
        order=structure.order,
        contact="unilateral" if structure.unilateral else "bonded",
        parameters=reading.parameters,
        model_dict=reading.stated,
        filter={
            "sample_time_s": data.T,
            "a": list(filter.a),
            "b": list(filter.b),
            "poles": [[float(p.real), float(p.imag)] for p in filter.poles],
        },
        V=V,
        noise_floor=noise.floor_N,
        fit_percent=100 * (1 - float(np.sqrt(V * data.weight)) / variation) if variation > 0 else 0.0,
        physical=reading.physical,
        converged=bool(found.converged),
        undetermined=[name for name in reading.parameters if name in lost],
        held_out_rmse=_held_out(estimator, data, structure, found) * data.force_N,
        samples=int(data.weight),
        seconds=time.perf_counter() - begun,
        degree=structure.family.degree or None,
        traces=traces,
        evidence=_evidence(data, best, candidates),
        notes=notes,
        noise=noise,
        independent_samples=independent(data, structure, found.v),
        covariance=reading.covariance,
        iterations=found.iterations,
        history=history,
        attempts=[
            {"V": a.V * unit, "converged": a.converged, "iterations": a.iterations} | values(data, structure, a.v)
            for a in found.attempts
        ],
        figures=dict(found.figures),
    )


class _Reading:
    """The numbers as a person reads them: shares and rates where the filter is a relaxation, else a and b."""

    def __init__(self, estimator: Estimator, data: Data, structure: Structure, found: Found) -> None:
        v, g, r = found.v, structure.nonlinear, structure.order
        filter = structure.filter(v)
        self.notes: list[str] = []
        shares: tuple[float, ...] = ()
        rates: tuple[float, ...] = ()
        rising = structure.family.rising(v[1:g]) and bool(v[0] > SOFTEST)
        try:
            shares, rates = relaxation_of(filter, data.T, "zero_order")
            relaxes = True
        except NotARelaxation as error:
            relaxes = False
            self.notes.append(f"The filter is no relaxation: {error.reason}. The model has the elastic law alone.")
        if not rising:
            self.notes.append("The elastic response falls somewhere on the way down: no pad's does.")
        if relaxes and len(shares) < r:
            self.notes.append(f"The filter is a relaxation of {len(shares)} modes; the rest cancels.")
        self.physical = relaxes and rising
        entries = named(data, structure, v)
        law = entries[: len(entries) - 2 * r]
        T_ab = np.zeros((2 * r, 2 * r))
        T_ab[:r, :r] = T_ab[r:, r:] = structure.M
        of_v = covariance(data, structure, estimator, found)
        gradient = np.zeros((len(entries), len(v)))
        gradient[: len(law), :g] = _law_gradient(data, structure, v, len(law))
        gradient[len(law) :, g:] = T_ab
        if relaxes and len(shares) == r:
            D = relaxation_jacobian(list(shares), list(rates), data.T)
            gradient[len(law) :, g:] = np.linalg.lstsq(D, T_ab, rcond=1e-15)[0]
        if relaxes:
            modes = [(f"c_{i}", c, "1") for i, c in enumerate(shares, 1)]
            modes += [(f"nu_{i}", nu, "1/s") for i, nu in enumerate(rates, 1)]
            entries = law + modes
        with np.errstate(invalid="ignore", over="ignore"):
            of_numbers = gradient @ of_v @ gradient.T
            std = np.sqrt(np.diag(of_numbers))
        known = len(std) == len(entries)
        self.covariance: Array | None = of_numbers if known else None
        self.parameters = {
            name: Parameter(value, unit, float(std[i]) if known or i < len(law) else float("nan"))
            for i, (name, value, unit) in enumerate(entries)
        }
        self.depth_mm = data.depth_mm
        self.model: dict[str, Any] = {
            "pad": {
                "elastic": structure.family.entry(law),
                "relaxation": {"shares": list(shares), "rates": list(rates)},
                "contact": "unilateral" if structure.unilateral else "bonded",
            }
        }

    @property
    def undetermined(self) -> list[str]:
        """Names of the numbers that the data do not tell."""
        return [name for name, p in self.parameters.items() if not _told(name, p, self.depth_mm)]

    @property
    def stated(self) -> dict[str, Any]:
        """The model file's content, with the errors of its numbers."""
        told = {n: p.std for n, p in self.parameters.items() if np.isfinite(p.std) and n[:2] not in ("a_", "b_")}
        return {"pad": {**self.model["pad"], "std": told}}

    def doubt_the_grid(self, estimator: Estimator, data: Data, structure: Structure, found: Found) -> None:
        """Into the errors what the grid does to the numbers: the scheme is asked again with the force of this very
        model, without noise, along the motion as it was measured, and what it then finds other is no noise's work."""
        if not self.physical:
            return
        model = Model.from_dict(self.model)
        clean = [
            replace(m, force_N=model.simulate_at(m.position_time_s, m.position_mm, m.force_time_s))
            for m in data.checked.measurements
        ]
        try:
            again = sampled(clean, data.T)
            other = _Reading(estimator, again, structure, estimator.estimate(again, structure, start=found.v))
        except InputError:
            return
        off = {n: q.value - self.parameters[n].value for n, q in other.parameters.items() if n in self.parameters}
        moved = [n for n, by in off.items() if abs(by) > self.parameters[n].std and self.parameters[n].value]
        if self.covariance is not None:
            shift = np.array([off.get(name, 0.0) for name in self.parameters])
            self.covariance = self.covariance + np.outer(shift, shift)
        for name, by in off.items():
            p = self.parameters[name]
            self.parameters[name] = replace(p, std=float(np.hypot(p.std, by)))
        if moved:
            said = ", ".join(f"{n} by {100 * off[n] / self.parameters[n].value:+.2g} %" for n in moved)
            self.notes.append(
                f"The grid shifts its numbers, on data of this very model {said}: that is in their errors"
                " (`--method continuous` has no grid)."
            )


def _told(name: str, p: Parameter, depth_mm: float) -> bool:
    # b or q near 0 is a line, a coefficient of a filter near 0 a shorter filter: told when known to be one.
    least = {"b": 0.2 / depth_mm, "q": 0.2}.get(name, 1.0 if name[:2] in ("a_", "b_") else 0.0)
    return bool(np.isfinite(p.std) and p.std <= DOUBTFUL * max(abs(p.value), least))


def _law_gradient(data: Data, structure: Structure, v: Array, count: int) -> Array:
    g = structure.nonlinear
    out = np.empty((count, g))
    for j in range(g):
        h = 1e-6 * max(abs(v[j]), 1e-2)
        sides = []
        for sign in (1, -1):
            near = v.copy()
            near[j] += sign * h
            sides.append(np.array([value for _, value, _ in named(data, structure, near)[:count]]))
        out[:, j] = (sides[0] - sides[1]) / (2 * h)
    return out


def _traces(data: Data, structure: Structure, v: Array) -> list[Trace]:
    out = []
    for m, run in zip(data.measurements, data.runs, strict=True):
        keep = run.has
        force = simulate(run, structure, v).force[keep] * data.force_N
        measured = run.y[keep] * data.force_N
        out.append(Trace(m.name, run.time_s[keep], run.depth_mm[keep], measured, force, run.weight[keep] > 0))
    return out


def _evidence(data: Data, best: Candidate, candidates: list[Candidate]) -> list[Evidence]:
    least = min(c.criterion for c in candidates)
    return [
        Evidence(
            law=c.structure.family.name,
            degree=c.structure.family.degree,
            order=c.structure.order,
            contact="unilateral" if c.structure.unilateral else "bonded",
            size=c.structure.size,
            V=c.found.V * data.force_N**2,
            criterion=c.criterion - least,
            held_out_rmse=float("nan"),
            eligible=c.found.converged,
            chosen=c is best,
        )
        for c in candidates
    ]


def _held_out(estimator: Estimator, data: Data, structure: Structure, found: Found) -> float:
    """RMS error (scaled) on time blocks that a refit did not see; NaN where the rest cannot be fitted alone."""
    runs = tuple(
        Run(run.time_s, np.full(len(run.time_s), data.T), run.depth_mm / data.depth_mm, run.y, run.weight)
        for run in data.runs
    )
    folds = folds_of(Problem(runs, data.depth_mm, data.force_N))
    total = 0.0
    for k in range(FOLDS):
        kept, left = (
            replace(
                data,
                runs=tuple(
                    replace(run, weight=np.where((fold == k) == out, run.weight, 0.0))
                    for run, fold in zip(data.runs, folds, strict=True)
                ),
            )
            for out in (False, True)
        )
        if kept.weight == 0 or left.weight == 0:
            continue
        try:
            refit = estimator.estimate(kept, structure, quick=True, start=found.v)
        except InputError:
            return float("nan")
        total += relative_V(left, structure, refit.v) * left.weight
    return float(np.sqrt(total / data.weight))
