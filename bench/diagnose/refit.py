"""Least squares of a pad with its effects: free-running simulation against measured force, in units of the noise."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import Bounds, minimize

from bench.identify._kernel import accumulate
from bench.identify.solver import minimise
from sim.pad import Pad

from .data import Data
from .numbers import Structure

Array = NDArray[np.float64]

RENEWED, OFF = 6, 1.0  # steps for which derivatives are good, where they foretold the last one but for this share
STEP = 1e-5  # of a coordinate of order one, for derivatives


@dataclass(frozen=True)
class Fit:
    """Where a search ended: x (P,), χ² there (with the surface's prior), Gauss–Newton matrix (P, P)."""

    structure: Structure
    x: Array
    chi2: float
    matrix: Array
    converged: bool
    spread: Array | None = None
    """Covariance of x (P, P) that holds for noise of any colour, where it was worked out."""

    @property
    def free(self) -> int:
        """Numbers that the data move: those at a bound, or without any influence, are none."""
        x, s = self.x, self.structure
        inside = (x > s.lower) & (x < s.upper) & (np.diag(self.matrix) > 1e-9)
        return int(inside.sum())

    @property
    def pad(self) -> Pad:
        """The pad with the numbers found."""
        numbers = self.structure.pad
        return numbers.at(self.x[: len(numbers.coordinates)])

    @property
    def of_run(self) -> Array:
        """The entries of x that belong to the run, and not to pad or causes."""
        return self.x[len(self.x) - self.structure.tail :]

    def covariance(self) -> Array:
        """Of x (P, P), 0 at bounds: `spread`, or else for white noise."""
        if self.spread is not None:
            return self.spread
        s, scale = self.structure, np.sqrt(np.maximum(np.diag(self.matrix), 1e-300))
        inside = (self.x > s.lower) & (self.x < s.upper) & (np.diag(self.matrix) > 1e-9)
        out = np.zeros_like(self.matrix)
        index = np.ix_(inside, inside)
        if inside.any():
            H = self.matrix[index] / np.outer(scale[inside], scale[inside])
            values, vectors = np.linalg.eigh(H)
            values = np.maximum(values, 1e-12 * values.max())
            out[index] = (vectors / values) @ vectors.T / np.outer(scale[inside], scale[inside])
        return out


def force_at(data: Data, structure: Structure, x: Array) -> Array:
    """Simulated force on the grid (n,), N; not finite where the numbers make no plant."""
    data.work.add(data.size)
    position = data.position_mm + structure.surface_mm(x)
    if late_s := structure.late_s(x):  # far less than a move takes: to first order
        position = position - late_s * data.speed_mm_s
    with np.errstate(all="ignore"):
        force = structure.cascade(x).simulate_on(data.grid, position)
    # the tare takes the pad's own force at that time off, and leaves its own error, which is the offset
    zero_N = 0.0 if data.tared is None else float(np.mean(force[data.tared]))
    return np.asarray(force - zero_N + structure.offset_N(x))


def errors(data: Data, structure: Structure, x: Array) -> Array:
    """√w (F − F_simulated)/σ on the grid (n,), whitened."""
    return data.whitened(data.force_N - force_at(data, structure, x))


def chi2(data: Data, structure: Structure, x: Array) -> float:
    """Σ w e²/σ², and what a moved surface costs."""
    return _chi2(errors(data, structure, x), structure.prior, x)


def _chi2(e: Array, prior: Array, x: Array) -> float:
    with np.errstate(over="ignore", invalid="ignore"):
        return float(np.sum(e * e) + np.sum(prior * x**2))


def mean_square(data: Data, structure: Structure, x: Array) -> float:
    """Mean squared error over the samples that count, N²."""
    e = data.force_N - force_at(data, structure, x)
    return float(np.sum(data.weight * e * e) / max(data.weight.sum(), 1.0))


def placed(data: Data, fit: Fit) -> Fit:
    """The fit with the run's own numbers, surface and zero, where all samples count alike: there whoever compares the
    model with the run finds them again (`bench.like`), and errors are told of all samples alike."""
    tail = fit.structure.tail
    if tail == 0:
        return fit
    model = fit.x[: len(fit.x) - tail]
    square = max(mean_square(data, fit.structure, fit.x), 1e-300)
    counted = float(data.weight.sum())

    def cost(of_run: Array) -> float:
        x = np.concatenate([model, of_run])
        return counted * mean_square(data, fit.structure, x) / square + float(np.sum(of_run**2))

    bounds = Bounds(fit.structure.lower[-tail:], fit.structure.upper[-tail:])
    found = minimize(cost, fit.of_run, method="Nelder-Mead", bounds=bounds, options={"maxfev": 120, "fatol": 1e-3})
    return replace(fit, x=np.concatenate([model, found.x])) if found.fun < cost(fit.of_run) else fit


def jacobian(
    data: Data, structure: Structure, x: Array, force: Array | None = None, known: Array | None = None
) -> Array:
    """∂(√w F/σ)/∂x (n, P), whitened, by differences to the side away from the bounds; the first columns: `known`."""
    base = force_at(data, structure, x) if force is None else force
    lower, upper = structure.lower, structure.upper
    out = np.empty((data.size, len(x)))
    first = 0 if known is None else known.shape[1]
    if known is not None:
        out[:, :first] = known
    for j in range(first, len(x)):
        h = STEP * max(1.0, abs(x[j]))
        if x[j] + h > upper[j] or (x[j] < 0 and x[j] - h >= lower[j]):
            h = -h
        moved = x.copy()
        moved[j] += h
        out[:, j] = data.whitened(force_at(data, structure, moved) - base) / h
    return out


def products(e: Array, J: Array) -> tuple[Array, Array]:
    """Jᵀe (P,), JᵀJ (P, P). Without BLAS, whose threads cost more than they give on arrays of this shape."""
    P = J.shape[1]
    gradient, matrix = np.zeros(P), np.zeros((P, P))
    accumulate(np.ones(len(e)), np.ascontiguousarray(e), np.zeros(len(e)), np.ascontiguousarray(J), gradient, matrix)
    return gradient, np.tril(matrix) + np.tril(matrix, -1).T


def refit(
    data: Data,
    structure: Structure,
    x0: Array,
    max_steps: int = 40,
    tolerance: float = 1e-7,
    known: Array | None = None,
    exact: bool = False,
) -> Fit:
    """From x0 to the minimum, or as far as `max_steps` go.

    `known`: derivatives by the first numbers that are near enough to those here, for the first steps of a search.
    """
    prior = structure.prior
    last: list[Array] = []  # x, force and derivatives of the step before
    tried: list[Array] = []  # x and force of the last trial: the one that is taken is asked for again
    age = 0

    def force_of(x: Array) -> Array:
        if not tried or not np.array_equal(tried[0], x):
            tried[:] = [x.copy(), force_at(data, structure, x)]
        return tried[1]

    def derivatives(x: Array, force: Array) -> Array:
        """By differences, or carried on by the secant (C. G. Broyden, Math. Comp. 19, 1965) while that is near."""
        nonlocal age
        J, off = None, np.inf
        if last and age < RENEWED:
            before, then, J = last
            way = x - before
            change, foretold = data.whitened(force - then), np.sum(J * way, axis=1)
            size = float(np.sum(foretold * foretold))
            miss = change - foretold
            off = float(np.sum(miss * miss)) / size if size > 0.0 else np.inf
        if J is None or off > OFF**2:
            J = jacobian(data, structure, x, force, known)
            J[~np.isfinite(J)] = 0.0
            age = 0
        else:
            J = J + np.outer(miss / float(np.sum(way * way)), way)
        age += 1
        last[:] = [x.copy(), force, J]
        return J

    def left_of(x: Array) -> tuple[Array, float]:
        """(errors, whitened; χ²), as `errors` and `chi2` have them."""
        e = data.whitened(data.force_N - force_of(x))
        return e, _chi2(e, prior, x)

    def normal(x: Array) -> tuple[float, Array, Array]:
        J = derivatives(x, force_of(x))
        e, value = left_of(x)
        gradient, matrix = products(e, J)
        return value, gradient - prior * x, matrix + np.diag(prior)

    if not len(x0):  # a bench in air, and nothing in doubt: there is nothing to fit
        return Fit(structure, x0, chi2(data, structure, x0), np.zeros((0, 0)), True)
    solution = minimise(normal, lambda x: left_of(x)[1], x0, structure.lower, structure.upper, max_steps, tolerance)
    if exact and age > 1:  # the matrix says how sure the numbers are
        J = jacobian(data, structure, solution.x)
        J[~np.isfinite(J)] = 0.0
        return Fit(structure, solution.x, solution.cost, products(J[:, 0], J)[1] + np.diag(prior), solution.converged)
    return Fit(structure, solution.x, solution.cost, solution.matrix, solution.converged)


def onto(fit: Fit, data: Data, max_steps: int = 25, tolerance: float = 1e-9) -> Fit:
    """The same structure carried on with other data, its matrix by differences at the end."""
    return refit(data, fit.structure, fit.x, max_steps, tolerance, exact=True)


def extended(fit: Fit, added: Array) -> Array:
    """x of a structure with one cause more at its end: the fit's numbers, the cause's, the run's."""
    n = len(fit.x) - fit.structure.tail
    return np.concatenate([fit.x[:n], added, fit.of_run])


def reduced(fit: Fit, index: int) -> tuple[Structure, Array]:
    """The structure without one of its causes, and the numbers that remain."""
    s = fit.structure
    gone = s.of_cause(index)
    x = np.delete(fit.x, np.arange(gone.start, gone.stop))
    return replace(s, causes=tuple(c for i, c in enumerate(s.causes) if i != index)), x


def last(fit: Fit, id_: str) -> Fit:
    """The same fit with the last of its causes of that id at the end."""
    causes = fit.structure.causes
    index = max(k for k, cause in enumerate(causes) if cause.id == id_)
    if index == len(causes) - 1:
        return fit
    order = [*(k for k in range(len(causes)) if k != index), index]
    structure = replace(fit.structure, causes=tuple(causes[k] for k in order))
    n = len(structure.pad.coordinates)
    at = [fit.structure.of_cause(k) for k in order]
    places = np.concatenate([np.arange(n), *(np.arange(s.start, s.stop) for s in at)])
    places = np.concatenate([places, np.arange(len(places), len(fit.x))])
    return replace(fit, structure=structure, x=fit.x[places], matrix=fit.matrix[np.ix_(places, places)])
