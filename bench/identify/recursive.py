"""An estimator for use while the run goes on: the continuous model, updated sample by sample.

`Recursive.update(t, delta, force)` takes one sample and costs microseconds, whatever the length of the run; times may
be uneven, and a sample may have no force. What was measured is kept in blocks, in bounded memory, and every sample
carries a Gauss-Newton sweep over them a little further (`_recursive_kernel`). Several first guesses run side by side,
and the one with the least error is what is reported. All numbers are those of the physical model, shares and rates
positive by construction, so what comes out is a relaxation at any time.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence

import numpy as np

from bench.recording.types import Measurement

from . import _recursive_kernel as kernel
from . import asked, notes, objective
from ._kernel import Array
from .discrete.choice import families
from .estimate import Estimate
from .laws import Family
from .noise import noise_of
from .objective import Structure
from .parameters import model_dict, parameters
from .problem import Problem, build
from .result import Evidence, FitResult, Trace
from .select import CLEAR
from .starts import bounds_of
from .uncertainty import independent_samples, spread_of

POINTS = 400  # of the history
ROOM = 16384  # blocks kept
SWEEP = 30  # blocks a sample
KINDS = {"exponential": kernel.EXPONENTIAL, "power": kernel.POWER, "polynomial": kernel.POLYNOMIAL}
FIRST_RATES = ((0.1, 3.0), (0.5, 30.0))  # 1/s: slowest and fastest of the first guesses
SETTLED = 0.02  # F^e and rates moved by no more than this share in the last tenth of the run


class Recursive:
    """Estimates of one pad, from rest.

    `law`: a family of `laws`; `order` r; `depth_mm` and `force_N`: the depth and force expected at the most, roughly
    (they scale the problem: the protocol knows them). `rates`: (slowest, fastest) of each set of first guesses, 1/s.
    """

    def __init__(
        self,
        law: Family,
        order: int,
        depth_mm: float,
        force_N: float,
        unilateral: bool = True,
        rates: Sequence[tuple[float, float]] = FIRST_RATES,
    ) -> None:
        if not (depth_mm > 0 and force_N > 0):
            raise ValueError("depth_mm and force_N must be above 0")
        if order < 1:
            raise ValueError("there must be one mode at the least")
        self.structure = Structure(law, order, unilateral)
        self.depth_mm, self.force_N = depth_mm, force_N
        thetas = law.starts[[len(law.starts) // 5, len(law.starts) // 2, (3 * len(law.starts)) // 4]]
        spread = [np.geomspace(fast, slow, order + 2)[1:-1] for slow, fast in rates]
        weights = np.log(np.full(order + 1, 0.7 / (order + 1)))
        first = np.array([np.concatenate([theta, np.log(nu), weights]) for theta in thetas for nu in spread])
        B, P = first.shape
        self._X = np.ascontiguousarray(np.stack([first, first], axis=1))
        self._gradients, self._matrices = np.zeros((B, 2, P)), np.zeros((2 * B, P, P))
        self._H, self._dH = np.zeros((B, order + 1)), np.zeros((B, order + 1, P))
        self._coupled = np.zeros((B, 1), dtype=np.int64)
        self._numbers = np.zeros((B, 4), dtype=np.int64)
        self._figures = np.zeros((B, 5))
        self._figures[:, kernel.DAMPING] = 0.1
        self._open, self._history = np.zeros(8), np.zeros((5, ROOM))
        self._whole = np.array([0, 0, 0, 1], dtype=np.int64)
        ends = [(law.lower, 1e-3, 1e-5), (law.upper, 1e3, 1e2)]
        self._bounds = np.stack(
            [
                np.concatenate([theta, np.full(order, math.log(nu)), np.full(order + 1, math.log(a))])
                for theta, nu, a in ends
            ]
        )
        self._kind = KINDS[law.name]
        self._step, self._end = kernel.update.native, kernel.end_run.native  # compiled now, not in the run
        self._last_s = -math.inf

    def update(self, t: float, delta: float, force: float = math.nan) -> None:
        """One sample: time in s, depth in mm, force in N (NaN: none). Raises ValueError for a time not later."""
        if not t > self._last_s:
            raise ValueError(f"the time must rise: {t} s after {self._last_s} s")
        self._last_s = t
        self._step(
            t, delta / self.depth_mm, force / self.force_N, self._kind, self.structure.unilateral, SWEEP, self._open,
            self._history, self._numbers, self._figures, self._X, self._gradients, self._matrices, self._H, self._dH,
            self._coupled, self._whole, self._bounds,
        )  # fmt: skip

    def rest(self) -> None:
        """The next sample belongs to another run: its time is its own, the pad is at rest; what was learned stays."""
        self._last_s = -math.inf
        self._end(self._open, self._whole, self._history)

    @property
    def blocks(self) -> int:
        """Blocks that the history holds."""
        return int(self._whole[kernel.BLOCKS])

    @property
    def x(self) -> Array:
        """[θ, log ν, a] of the best member as in `objective.Structure`, rates falling."""
        k, r = self.structure.family.size, self.structure.order
        x = self._X[self._whole[kernel.BEST], 0].copy()
        x[k + r :] = np.exp(x[k + r :])
        by_rate = np.argsort(-x[k : k + r], kind="stable")
        order = np.concatenate([np.arange(k), k + by_rate, [k + r], k + r + 1 + by_rate]).astype(np.intp)
        return np.asarray(x[order])

    @property
    def parameters(self) -> dict[str, float]:
        """The numbers of the model by name, now."""
        theta, rates, weights = self.structure.split(self.x)
        gain = float(weights.sum())
        law = self.structure.family.physical_numbers(theta, gain * self.force_N, self.depth_mm)
        out = {name: float(value) for name, value, _ in law}
        out |= {f"c_{i}": float(a) / gain for i, a in enumerate(weights[1:], 1)}
        return out | {f"nu_{i}": float(nu) for i, nu in enumerate(rates, 1)}


def fit(
    measurements: Sequence[Measurement],
    law: str = "auto",
    order: int | str = "auto",
    contact: str = "auto",
    degree: int | None = None,
    progress: Callable[[str], None] | None = None,
) -> FitResult:
    """The recursion over recorded data, once, in order; each run from rest. V is (16) with the numbers it ends at."""
    begun = time.perf_counter()
    asked.contact_known(contact)
    problem = build(measurements)
    noise = noise_of(problem.measurements)
    laws, several = families(law, degree), asked.orders(order)
    unilateral = contact == "unilateral" or (contact == "auto" and not _pulls(problem, noise.force_N))
    ended = []
    for family in laws:
        for r in several:
            if progress:
                progress(f"{family.name}, order {r}")
            ended.append(_over(problem, family, r, unilateral))
    judged = sorted(((_criterion(problem, e, ended), e, h) for e, h in ended), key=lambda item: item[0])
    best = _pick([(criterion, e) for criterion, e, _ in judged])
    least, history = next((criterion, h) for criterion, e, h in judged if e is best)
    spread = spread_of(problem, best)
    found, covariance, undetermined = parameters(problem, best, spread)
    about = notes.findings(problem, noise, unilateral, pasts=False)
    lost = about.lost(found) | set(undetermined)
    unit = problem.force_N**2
    traces = _traces(problem, best)
    force = np.concatenate([t.force_N[t.counted] for t in traces])
    variation = float(np.linalg.norm(force - force.mean()))
    V = best.cost / problem.weight * unit
    return FitResult(
        method="recursive",
        law=best.structure.family.name,
        order=best.structure.order,
        contact="unilateral" if unilateral else "bonded",
        parameters=found,
        model_dict=model_dict(problem, best, found),
        filter=None,
        V=V,
        noise_floor=noise.floor_N,
        fit_percent=100 * (1 - math.sqrt(V * len(force)) / variation) if variation > 0 else 0.0,
        physical=best.physical,
        converged=best.converged,
        undetermined=[name for name in found if name in lost],
        held_out_rmse=math.nan,
        samples=len(force),
        seconds=time.perf_counter() - begun,
        degree=best.structure.family.degree or None,
        traces=traces,
        evidence=[
            Evidence(
                e.structure.family.name,
                e.structure.family.degree,
                e.structure.order,
                "unilateral" if unilateral else "bonded",
                e.structure.size,
                e.cost / problem.weight * unit,
                criterion - least,
                math.nan,
                _eligible(e),
                e is best,
            )
            for criterion, e, _ in judged
        ],  # fmt: skip
        notes=[
            *about.notes,
            "As it would have stood when the run ended; `--method continuous` goes on to the end of the search.",
            *([] if best.converged else ["The numbers were still moving when the data ended."]),
        ],
        noise=noise,
        independent_samples=spread.samples,
        covariance=covariance,
        iterations=int(problem.weight),
        history=history,
    )


def _pulls(problem: Problem, noise_N: float) -> bool:
    level = -max(8 * noise_N / problem.force_N, 0.03)
    return sum(int(np.count_nonzero((run.y < level) & (run.weight > 0))) for run in problem.runs) >= 3


def _over(problem: Problem, family: Family, order: int, unilateral: bool) -> tuple[Estimate, dict[str, list[float]]]:
    """The recursion over all runs: where it ended, and its way there."""
    estimator = Recursive(family, order, problem.depth_mm, problem.force_N, unilateral)
    every = max(1, problem.size // POINTS)
    history: dict[str, list[float]] = {}
    for j, run in enumerate(problem.runs):
        if j:
            estimator.rest()
        counted = np.where(run.weight > 0, run.y * problem.force_N, np.nan).tolist()
        depth = (run.u * problem.depth_mm).tolist()
        for n, (t, delta, force) in enumerate(zip(run.time_s.tolist(), depth, counted, strict=True)):
            estimator.update(t, delta, force)
            if n % every == 0 or n == run.size - 1:
                for name, value in ({"time_s": t} | estimator.parameters).items():
                    history.setdefault(name, []).append(value)
    x = estimator.x
    structure = estimator.structure
    total, _, matrix = objective.normal_equations(problem, structure, x)
    estimate = Estimate(structure, x, total, matrix, _settled(history), bounds_of(problem))
    return estimate, history


def _settled(history: dict[str, list[float]]) -> bool:
    for name, values in history.items():
        if name != "time_s" and not name.startswith("c_"):
            late = np.array(values[-max(len(values) // 10, 2) :])
            if np.ptp(late) > SETTLED * max(abs(late[-1]), 1e-12):
                return False
    return True


def _eligible(e: Estimate) -> bool:
    """Physical, at rest, and every mode distinct and within what the data see, as for `continuous`."""
    return e.physical and e.converged and e.distinct


def _pick(judged: list[tuple[float, Estimate]]) -> Estimate:
    """The least criterion of those that may be chosen (of all, where none may), or a simpler one within `CLEAR`.

    The recursion stops when the run does, a little above its minimum, and not as far for every order: so a mode more
    must be a clear gain, and a mode that doubles another, or has no share, is none.
    """
    able = [(criterion, e) for criterion, e in judged if _eligible(e)] or judged
    least, best = min(able, key=lambda item: item[0])
    for criterion, e in able:
        if e.structure.size < best.structure.size and criterion < least + CLEAR:
            best = e
    return best


def _criterion(problem: Problem, estimate: Estimate, ended: list[tuple[Estimate, dict[str, list[float]]]]) -> float:
    best = min((e for e, _ in ended), key=lambda e: e.cost)
    n = independent_samples(problem, best.x, best.structure)
    return n * math.log(max(estimate.cost / problem.weight, 1e-12)) + estimate.structure.size * math.log(n)


def _traces(problem: Problem, estimate: Estimate) -> list[Trace]:
    simulated = objective.forces(problem, estimate.structure, estimate.x)
    out = []
    for m, run, at, (force, _, _) in zip(problem.measurements, problem.runs, problem.where, simulated, strict=True):
        counted = run.weight[at] > 0
        out.append(
            Trace(
                m.name,
                m.force_time_s,
                run.u[at] * problem.depth_mm,
                m.force_N,
                force[at] * problem.force_N,
                counted,
            )
        )
    return out
