"""The linear step: A and B by least squares, γ given. ARX as in the paper, or by instrumental variables.

With u = F^e(δ; γ),

    F(k) = −Σ a_i F(k−i) + b_0 u(k) + Σ b_i u(k−i) + error.

b_0 = 1 of (13) is kept in one of two ways: *fixed*, where F(k) − u(k) is what is regressed and the gain stays with
γ; or *scaled*, where b_0 is estimated and goes into the gain afterwards (B/b_0, gain·b_0).

ARX takes this error as white. On a bench the noise sits on the measured force instead, so that it is in the
regressors too, and the estimate stays wrong however long the data are. The refined instrumental variable (Young; the
fixed point of Steiglitz and McBride) filters F and u by 1/A and correlates with the simulated, noise-free output in
place of the measured one; where it stands still the simulated output error is orthogonal to its own sensitivities:
it is the output-error estimate, consistent under any noise that does not depend on the motion.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.digital import Filter

from .._kernel import Array
from .series import Data, Series
from .system import Simulated, Structure, simulate


@dataclass(frozen=True)
class Equations:
    """Of one run: target (K,), regressors (K, 2r), instruments (K, 2r), and which rows count."""

    target: Array
    regressors: Array
    instruments: Array
    rows: NDArray[np.bool_]


def arx(data: Data, structure: Structure, v: Array, left: list[NDArray[np.bool_]] | None = None) -> Array:
    """(α, β) by ordinary least squares with b_0 fixed, u from the γ in v. `left`: rows to leave out."""
    systems = [arx_equations(run, structure, v, None if left is None else left[j]) for j, run in enumerate(data.runs)]
    target = np.concatenate([e.target[e.rows] for e in systems])
    regressors = np.concatenate([e.regressors[e.rows] for e in systems])
    return _scaled_lstsq(regressors, target)


def arx_scaled(data: Data, structure: Structure, v: Array, left: list[NDArray[np.bool_]] | None = None) -> Array:
    """v after an ARX step with b_0 estimated and put into the gain; v itself where it comes out negative."""
    targets, columns = [], []
    for j, run in enumerate(data.runs):
        out = simulate(run, structure, v)
        e = arx_equations(run, structure, v, None if left is None else left[j], out)
        now = difference(out.elastic, structure.order)
        targets.append((e.target + now)[e.rows])
        columns.append(np.concatenate([now[:, None], e.regressors], axis=1)[e.rows])
    return _rescaled(structure, v, _scaled_lstsq(np.concatenate(columns), np.concatenate(targets)))


def arx_equations(
    run: Series,
    structure: Structure,
    v: Array,
    left: NDArray[np.bool_] | None = None,
    now: Simulated | None = None,
) -> Equations:
    """The ARX equations of a run, b_0 fixed. Where a unilateral pad has let go u is the surface's as simulated."""
    out = now if now is not None else simulate(run, structure, v)
    u = out.elastic
    gone = out.let_go if left is None else left
    target = difference(run.y, structure.order) - difference(u, structure.order)
    regressors = np.concatenate([-_basis(run.y, structure.order), _basis(u, structure.order)], axis=1)
    rows = _rows(run, structure.order) & ~gone
    return Equations(target, regressors, regressors, rows)


def iv(data: Data, structure: Structure, v: Array) -> Array:
    """v after one step of the refined instrumental variable from the filter in it; v itself where that is no help.

    b_0 is scaled: gain and filter pull on the same thing, and turns that hold one of them creep.
    """
    size = 2 * structure.order + 1
    matrix, right = np.zeros((size, size)), np.zeros(size)
    for run in data.runs:
        e = iv_equations(run, structure, v)
        if e is None:
            return v
        Z = e.instruments[e.rows]
        matrix += Z.T @ e.regressors[e.rows]
        right += Z.T @ e.target[e.rows]
    return _rescaled(structure, v, _scaled_solve(matrix, right))


def iv_equations(run: Series, structure: Structure, v: Array) -> Equations | None:
    """The instrumental equations of a run, prefiltered by 1/A (unstable poles reflected); None where B/A runs away."""
    from scipy.signal import lfilter

    out = simulate(run, structure, v)
    if not out.ok:
        return None
    y = np.where(run.has, run.y, out.force)  # a gap is filled by the simulation: it carries no error
    A = _stable(structure.filter(v))
    y, u, x = (np.asarray(lfilter([1.0], A, signal)) for signal in (y, out.elastic, out.force))
    r = structure.order
    by_u = [difference(u, r)[:, None], _basis(u, r)]
    regressors = np.concatenate([by_u[0], -_basis(y, r), by_u[1]], axis=1)
    instruments = np.concatenate([by_u[0], -_basis(x, r), by_u[1]], axis=1)
    return Equations(difference(y, r), regressors, instruments, (run.weight > 0) & ~out.let_go)


def output_error(data: Data, structure: Structure, v: Array) -> Array:
    """v after one Gauss-Newton step on the simulated output error by gain, A and B, the law's shape held.

    v itself where the filter or its sensitivities run away."""
    free = np.r_[0, structure.nonlinear : structure.size]
    matrix, right = np.zeros((len(free), len(free))), np.zeros(len(free))
    for run in data.runs:
        out = simulate(run, structure, v, "all")
        J = out.jacobian[:, free]
        with np.errstate(over="ignore", invalid="ignore"):
            matrix += J.T @ (J * run.weight[:, None])
            right += J.T @ (run.weight * (run.y - out.force))
    if not (np.isfinite(matrix).all() and np.isfinite(right).all()):
        return v
    new = v.copy()
    new[free] += _scaled_solve(matrix, right)
    return new


def _stable(filter: Filter) -> Array:
    """A with the poles outside the unit circle reflected into it."""
    p = filter.poles
    if filter.stable:
        return np.array(filter.a)
    inside = np.where(np.abs(p) > 1, 1 / np.conj(p), p)
    return np.real(np.poly(0.99999 * inside))


def _rescaled(structure: Structure, v: Array, found: Array) -> Array:
    b_0, r, g = float(found[0]), structure.order, structure.nonlinear
    if not 0.1 < b_0 < 10:
        return v
    return np.concatenate([[v[0] * b_0], v[1:g], found[1 : 1 + r], found[1 + r :] / b_0])


def _rows(run: Series, order: int) -> NDArray[np.bool_]:
    """Samples that count and whose past is measured."""
    rows = run.weight > 0
    for i in range(1, order + 1):
        rows[i:] &= run.has[:-i]
    return rows


def difference(x: Array, order: int) -> Array:
    """(1 − z⁻¹)^order x, from rest."""
    return _power(x, order, 0)


def _power(x: Array, order: int, delay: int) -> Array:
    """(1 − z⁻¹)^order z^−delay x, from rest."""
    for _ in range(order):
        x = np.diff(x, prepend=0.0)
    return np.concatenate([np.zeros(delay), x[: len(x) - delay]]) if delay else x


def _basis(x: Array, r: int) -> Array:
    """Columns (1 − z⁻¹)^j z^(j−r) x, j = 0 … r−1: (K, r)."""
    return np.stack([_power(x, j, r - j) for j in range(r)], axis=1) if r else np.zeros((len(x), 0))


def _scaled_solve(matrix: Array, right: Array) -> Array:
    scale = np.sqrt(np.maximum(np.abs(np.diag(matrix)), 1e-300))
    return np.asarray(np.linalg.lstsq(matrix / np.outer(scale, scale), right / scale, rcond=1e-14)[0] / scale)


def _scaled_lstsq(A: Array, b: Array) -> Array:
    scale = np.linalg.norm(A, axis=0)
    scale[scale == 0] = 1.0
    return np.asarray(np.linalg.lstsq(A / scale, b, rcond=1e-13)[0] / scale)
