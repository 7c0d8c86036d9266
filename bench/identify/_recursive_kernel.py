"""The compiled part of the recursive estimator: history in blocks, and Gauss-Newton sweeps over it.

**History.** Samples are averaged into blocks: in motion one a sample, in a hold blocks that grow with the time since it
began, as relaxation slows down. Where the room is used up neighbours at nearly the same depth are
joined two by two.

**Sweeps.** Several estimates (*members*) stand side by side, from different first guesses. Each is swept: its
candidate is simulated over the history with its sensitivities (`_kernel.advance`, the same physics as the fit's),
and Σ w e², Jᵀ w e, Jᵀ w J are gathered on the way, some blocks a sample. Where the sweep before ended, and the
costs compare, the candidate is dropped if it is worse than what it came from; at the end it is accepted, and gives
the next candidate (Levenberg-Marquardt). As the states are simulated anew with every candidate, nothing of what
was learned wrong early stays in them. (A recursion over the current sample alone was tried, and settled at wrong
values: a run has only a handful of ramps.)

x = [θ (k), log ν (r), log a (r+1)] in scaled units.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sim.jit import compiled

from ._kernel import Array, advance

Ints = NDArray[np.int64]

EXPONENTIAL, POWER, POLYNOMIAL = 0, 1, 2
MOVED = 2e-3  # of the depth scale: beyond it a sample is not of the block
GROWTH, GROWTH_FREE = 0.05, 0.01  # length of a block over the time since the hold began; the second without force
QUIET = 0.02  # of the force scale: no force
LONGEST_STEP = 1.0

# the open block, and when the present hold began
COUNT, WEIGHT, SUM_T, SUM_U, SUM_Y, FIRST_T, FIRST_U, STILL = range(8)
# whole numbers of the estimator
BLOCKS, TURN, BEST, FRESH = range(4)
# of a member: next block, end of this sweep, end of the sweep before, accepted sweeps
NEXT, END, CHECK, ACCEPTED = range(4)
# of a member: cost accepted, its weight, cost of this sweep, its weight, damping
COST, COST_WEIGHT, RUNNING, RUNNING_WEIGHT, DAMPING = range(5)


@compiled("float64(int64, float64, float64[::1], float64[::1])")
def law_value(kind: int, u: float, theta: Array, ds: Array) -> float:
    """s(u; θ) of `laws.Family` for one depth; its derivatives (k,) are written to `ds`."""
    k = theta.shape[0]
    for i in range(k):
        ds[i] = 0.0
    if u <= 0.0:
        return 0.0
    if kind == EXPONENTIAL:
        q = float(theta[0])
        if abs(q) < 1e-3:
            ds[0] = u * ((u - 1.0) / 2.0 + q * (2.0 * u * u - 3.0 * u + 1.0) / 6.0)
            return u + u * q * ((u - 1.0) / 2.0 + q * (2.0 * u * u - 3.0 * u + 1.0) / 12.0)
        whole = math.expm1(q)
        s = math.expm1(q * u) / whole
        ds[0] = (u * math.exp(q * u) - s * math.exp(q)) / whole
        return s
    if kind == POWER:
        s = u ** (theta[0] + 1.0)
        ds[0] = s * math.log(u)
        return float(s)
    s, power = u, u
    for i in range(k):
        power *= u
        ds[i] = power - u
        s += theta[i] * ds[i]
    return s


@compiled("void(float64[:, ::1], float64[::1])")
def _solve(R: Array, b: Array) -> None:
    """b ← R⁻¹ b by Cholesky, R (n, n) destroyed."""
    n = b.shape[0]
    for j in range(n):
        for i in range(j):
            total = R[j, i]
            for m in range(i):
                total -= R[j, m] * R[i, m]
            R[j, i] = total / R[i, i]
        d = R[j, j]
        for m in range(j):
            d -= R[j, m] * R[j, m]
        R[j, j] = math.sqrt(max(d, 1e-30))
    for j in range(n):
        for m in range(j):
            b[j] -= R[j, m] * b[m]
        b[j] /= R[j, j]
    for j in range(n - 1, -1, -1):
        for m in range(j + 1, n):
            b[j] -= R[m, j] * b[m]
        b[j] /= R[j, j]


@compiled("void(float64[::1], int64[::1], float64[:, ::1])")
def _close(open_block: Array, whole: Ints, history: Array) -> None:
    """The open block goes into the history: rows dt, u, y, w, t."""
    n, count = whole[BLOCKS], open_block[COUNT]
    t = open_block[SUM_T] / count
    first = whole[FRESH] == 1 or n == 0
    history[0, n] = -1.0 if first else t - history[4, n - 1]
    history[1, n] = open_block[SUM_U] / count
    history[2, n] = open_block[SUM_Y] / open_block[WEIGHT] if open_block[WEIGHT] > 0.0 else 0.0
    history[3, n] = open_block[WEIGHT]
    history[4, n] = t
    whole[BLOCKS] = n + 1
    whole[FRESH] = 0
    open_block[COUNT] = 0.0


@compiled("void(float64[::1], int64[::1], float64[:, ::1])")
def end_run(open_block: Array, whole: Ints, history: Array) -> None:
    """Close the block; the next sample begins another run, from rest."""
    if open_block[COUNT] > 0.0 and whole[BLOCKS] < history.shape[1]:
        _close(open_block, whole, history)
    open_block[COUNT] = 0.0
    whole[FRESH] = 1


@compiled("void(int64[::1], float64[:, ::1])")
def _join(whole: Ints, history: Array) -> None:
    """Neighbours two by two where they differ least in depth, half of the pairs; a run's first block stays alone."""
    n, out = whole[BLOCKS], 0
    apart = np.median(np.abs(history[1, 1:n] - history[1, : n - 1]))
    i = 0
    while i < n:
        alone = history[0, i] < 0.0 or i + 1 == n or history[0, i + 1] < 0.0
        alone = alone or abs(history[1, i + 1] - history[1, i]) > apart
        w = history[3, i] + (0.0 if alone else history[3, i + 1])
        first, t = history[0, i] < 0.0, history[4, i]
        u, y = history[1, i], history[2, i]
        if not alone:
            t, u = 0.5 * (t + history[4, i + 1]), 0.5 * (u + history[1, i + 1])
            y = (history[3, i] * y + history[3, i + 1] * history[2, i + 1]) / w if w > 0.0 else 0.0
        history[0, out] = -1.0 if first else t - history[4, out - 1]
        history[1, out], history[2, out], history[3, out], history[4, out] = u, y, w, t
        out += 1
        i += 1 if alone else 2
    whole[BLOCKS] = out


@compiled("void(float64[::1], float64[::1], float64[:, ::1], float64[::1], float64[:, ::1], float64[::1])")
def _candidate(x: Array, gradient: Array, matrix: Array, bound_damping: Array, bounds: Array, out: Array) -> None:
    """out ← x + (H + damping diag H)⁻¹ g, within bounds, no component further than `LONGEST_STEP`."""
    P = x.shape[0]
    work, step = matrix.copy(), gradient.copy()
    top = 0.0
    for p in range(P):
        top = max(top, matrix[p, p])
    for p in range(P):
        work[p, p] += bound_damping[0] * work[p, p] + 1e-9 * top + 1e-30
    _solve(work, step)
    largest = 0.0
    for p in range(P):
        largest = max(largest, abs(step[p]))
    share = LONGEST_STEP / largest if largest > LONGEST_STEP else 1.0
    for p in range(P):
        out[p] = min(max(x[p] + share * step[p], bounds[0, p]), bounds[1, p])


@compiled(
    "void(int64, int64, boolean, int64, float64[:, ::1], int64[:, ::1], float64[:, ::1], float64[:, :, ::1],"
    "float64[:, :, ::1], float64[:, :, ::1], float64[:, ::1], float64[:, :, ::1], int64[:, ::1], int64[::1],"
    "float64[:, ::1])"
)
def sweep(
    m: int,
    kind: int,
    unilateral: bool,
    most: int,
    history: Array,
    numbers: Ints,
    figures: Array,
    X: Array,
    gradients: Array,
    matrices: Array,
    H: Array,
    dH: Array,
    coupled: Ints,
    whole: Ints,
    bounds: Array,
) -> None:
    """Up to `most` blocks of member m's sweep.

    `numbers` (B, 4), `figures` (B, 5): see the constants; `X` (B, 2, P): accepted and candidate; `gradients` (B, 2, P)
    and `matrices` (2B, P, P) likewise; `H` (B, r+1), `dH` (B, r+1, P), `coupled` (B, 1): states of the simulation.
    """
    P, r = X.shape[2], H.shape[1] - 1
    k = P - 2 * r - 1
    at = numbers[m, NEXT]
    if at == 0:
        numbers[m, END] = whole[BLOCKS]
        gradients[m, 1, :] = 0.0
        matrices[2 * m + 1, :, :] = 0.0
        figures[m, RUNNING] = figures[m, RUNNING_WEIGHT] = 0.0
    stop = min(at + most, numbers[m, END])
    if at < numbers[m, CHECK] < stop:
        stop = numbers[m, CHECK]
    for i in range(at + 1, stop):
        if history[0, i] < 0.0:
            stop = i
            break
    n = stop - at
    if n <= 0:
        return
    if history[0, at] < 0.0:
        H[m, :] = 0.0
        dH[m, :, :] = 0.0
        coupled[m, 0] = 0
    x = X[m, 1]
    dt, s, ds = history[0, at:stop].copy(), np.empty(n), np.empty((n, k))
    dt[0] = max(dt[0], 0.0)
    for i in range(n):
        s[i] = law_value(kind, history[1, at + i], x[:k], ds[i])
    weights = np.exp(x[k + r :])
    force, elastic, gone = np.empty(n), np.empty(n), np.empty(n, dtype=np.bool_)
    jacobian = np.empty((n, P))
    advance(
        dt,
        s,
        ds,
        np.exp(x[k : k + r]),
        weights,
        unilateral,
        H[m],
        dH[m],
        coupled[m],
        force,
        elastic,
        jacobian,
        gone,
    )
    gradient, matrix = gradients[m, 1], matrices[2 * m + 1]
    for i in range(n):
        w = history[3, at + i]
        e = history[2, at + i] - force[i]
        figures[m, RUNNING] += w * e * e
        figures[m, RUNNING_WEIGHT] += w
        for p in range(P):
            if p >= k + r:
                jacobian[i, p] *= weights[p - k - r]
            gradient[p] += w * jacobian[i, p] * e
        for p in range(P):
            for q in range(p + 1):
                matrix[p, q] += w * jacobian[i, p] * jacobian[i, q]
    numbers[m, NEXT] = stop
    accepted = numbers[m, ACCEPTED] > 0
    if accepted and stop == numbers[m, CHECK] and not figures[m, RUNNING] <= figures[m, COST]:
        figures[m, DAMPING] = min(figures[m, DAMPING] * 5.0, 1e9)
    elif stop == numbers[m, END]:
        # number by number: an assignment of arrays brings in the text of its error, and most of the compilation
        for p in range(P):
            X[m, 0, p], gradients[m, 0, p] = x[p], gradient[p]
            for q in range(P):
                matrices[2 * m, p, q] = matrix[max(p, q), min(p, q)]
        figures[m, COST], figures[m, COST_WEIGHT] = figures[m, RUNNING], figures[m, RUNNING_WEIGHT]
        figures[m, DAMPING] = max(figures[m, DAMPING] / 5.0, 1e-6)
        numbers[m, CHECK] = numbers[m, END]
        numbers[m, ACCEPTED] += 1
    else:
        return
    numbers[m, NEXT] = 0
    _candidate(X[m, 0], gradients[m, 0], matrices[2 * m], figures[m, DAMPING:], bounds, X[m, 1])


@compiled(
    "void(float64, float64, float64, int64, boolean, int64, float64[::1], float64[:, ::1], int64[:, ::1],"
    "float64[:, ::1], float64[:, :, ::1], float64[:, :, ::1], float64[:, :, ::1], float64[:, ::1],"
    "float64[:, :, ::1], int64[:, ::1], int64[::1], float64[:, ::1])"
)
def update(
    t: float,
    u: float,
    y: float,
    kind: int,
    unilateral: bool,
    most: int,
    open_block: Array,
    history: Array,
    numbers: Ints,
    figures: Array,
    X: Array,
    gradients: Array,
    matrices: Array,
    H: Array,
    dH: Array,
    coupled: Ints,
    whole: Ints,
    bounds: Array,
) -> None:
    """One sample into the history (y NaN: no force), and up to `most` blocks of a sweep, every other one the best's."""
    B = X.shape[0]
    if open_block[COUNT] > 0.0:
        moved = abs(u - open_block[FIRST_U]) > MOVED
        growth = GROWTH if abs(open_block[SUM_Y]) > QUIET * open_block[WEIGHT] else GROWTH_FREE
        late = t - open_block[FIRST_T] > growth * (open_block[FIRST_T] - open_block[STILL])
        if moved or late or whole[BLOCKS] == 0 or whole[FRESH] == 1:
            _close(open_block, whole, history)
            if moved:
                open_block[STILL] = t
            if whole[BLOCKS] == history.shape[1]:
                _join(whole, history)
                for m in range(B):
                    numbers[m, :] = 0
    if open_block[COUNT] == 0.0:
        open_block[FIRST_T], open_block[FIRST_U] = t, u
        open_block[WEIGHT] = open_block[SUM_T] = open_block[SUM_U] = open_block[SUM_Y] = 0.0
        if whole[FRESH] == 1:
            open_block[STILL] = t
    open_block[COUNT] += 1.0
    open_block[SUM_T] += t
    open_block[SUM_U] += u
    if y == y:
        open_block[WEIGHT] += 1.0
        open_block[SUM_Y] += y
    if whole[BLOCKS] < 2:
        return
    whole[TURN] += 1
    m = whole[BEST] if whole[TURN] % 2 == 0 else (whole[TURN] // 2) % B
    done = numbers[m, ACCEPTED]
    sweep(m, kind, unilateral, most, history, numbers, figures, X, gradients, matrices, H, dH, coupled, whole, bounds)
    if numbers[m, ACCEPTED] != done:
        least = math.inf
        for j in range(B):
            if figures[j, COST_WEIGHT] > 0.0 and figures[j, COST] / figures[j, COST_WEIGHT] < least:
                least = figures[j, COST] / figures[j, COST_WEIGHT]
                whole[BEST] = j
