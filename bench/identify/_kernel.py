"""The compiled loops of the estimator: quasi-linear model and its sensitivities, sample by sample.

F^e is linear between samples, so a mode obeys exactly (ramp-invariant form of (5), (6))

    h_i(t + dt) = e^{−ν_i dt} h_i(t) + φ(ν_i dt) ΔF^e,    φ(x) = (1 − e^{−x})/x,    F = Σ a_i h_i,

with ν_0 = 0, a_i = gain · c_i, and F^e in units of its value at the greatest depth. Every derivative is carried
along by the chain rule of the same recursion; where a unilateral pad has let go, F^e is what makes F = 0, so it too
depends on all parameters.

The factors of a step are sim's (sim/kernel.py, sim/relaxation.py), and so is the way of compiling (sim/jit.py).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim.jit import compiled
from sim.kernel import ramp_gain
from sim.relaxation import ramp_gain_slope

Array = NDArray[np.float64]


@compiled("float64(float64)")
def _flushed(value: float) -> float:
    """Zero for what has died away: a decaying state would else stay among the slow subnormal numbers."""
    return 0.0 if abs(value) < 1e-250 else value


@compiled(
    "void(float64[::1], float64[::1], float64[:, ::1], float64[::1], float64[::1], boolean, float64[::1],"
    "float64[:, ::1], int64[::1], float64[::1], float64[::1], float64[:, ::1], boolean[::1])"
)
def advance(
    dt_s: Array,
    shape: Array,
    d_shape: Array,
    rates: Array,
    weights: Array,
    unilateral: bool,
    state: Array,
    d_state: Array,
    coupled: NDArray[np.int64],
    force: Array,
    elastic: Array,
    jacobian: Array,
    let_go: NDArray[np.bool_],
) -> None:
    """Carry the model over n samples, its state in and out.

    `dt_s` (n,): time since the sample before (0 for a run's first); `shape` (n,): F^e at the samples; `d_shape`
    (n, k): its derivatives by the k shape parameters; `rates` (r,) in 1/s; `weights` (r+1,): a_0 … a_r, all ≥ 0.
    `state` (r+1,): h_0 … h_r; `d_state` (r+1, P): their derivatives, P = k + r + (r+1), order: shape parameters,
    log ν_i, a_i; `coupled` (1,): nonzero once a let-go has made every state depend on every parameter.
    Written: `force` (n,), `elastic` (n,), `jacobian` (n, P) (or (0, 0): no derivatives), `let_go` (n,).
    """
    n, k, r = dt_s.shape[0], d_shape.shape[1], rates.shape[0]
    P = k + r + r + 1
    want = jacobian.shape[0] > 0
    decay, gain = np.ones(r + 1), np.ones(r + 1)
    d_decay, d_gain = np.zeros(r + 1), np.zeros(r + 1)
    d_rise = np.zeros(P)
    last_dt = -1.0
    for j in range(n):
        if dt_s[j] != last_dt:
            last_dt = dt_s[j]
            for i in range(1, r + 1):
                x = rates[i - 1] * last_dt
                gain[i] = ramp_gain(x)
                decay[i] = 1.0 - x * gain[i]
                d_decay[i] = -x * decay[i]  # by log ν, as d_gain
                d_gain[i] = x * ramp_gain_slope(x, gain[i])
        rise = shape[j] - state[0]
        held, per_rise = 0.0, 0.0
        for i in range(r + 1):
            held += weights[i] * decay[i] * state[i]
            per_rise += weights[i] * gain[i]
        gone = unilateral and held + per_rise * rise < 0.0 and per_rise > 0.0
        if gone:
            rise = -held / per_rise
            coupled[0] = 1
        let_go[j] = gone

        if want:
            if gone:
                for p in range(P):
                    d_held = 0.0
                    for i in range(r + 1):
                        d_held += weights[i] * decay[i] * d_state[i, p]
                    d_rise[p] = -d_held / per_rise
                for i in range(1, r + 1):
                    d_rise[k + i - 1] -= weights[i] * (d_decay[i] * state[i] + d_gain[i] * rise) / per_rise
                for i in range(r + 1):
                    d_rise[k + r + i] -= (decay[i] * state[i] + gain[i] * rise) / per_rise
            else:
                for p in range(P):
                    d_rise[p] = -d_state[0, p]
                for p in range(k):
                    d_rise[p] += d_shape[j, p]
            last = P if coupled[0] != 0 else k
            for i in range(r + 1):
                for p in range(last):
                    d_state[i, p] = _flushed(decay[i] * d_state[i, p] + gain[i] * d_rise[p])
            for i in range(1, r + 1):
                q = k + i - 1
                if coupled[0] == 0:
                    d_state[i, q] = _flushed(decay[i] * d_state[i, q])
                d_state[i, q] += d_decay[i] * state[i] + d_gain[i] * rise

        total = 0.0
        for i in range(r + 1):
            state[i] = _flushed(decay[i] * state[i] + gain[i] * rise)
            total += weights[i] * state[i]
        force[j] = 0.0 if gone else total
        elastic[j] = state[0]
        if want:
            if gone:
                for p in range(P):
                    jacobian[j, p] = 0.0
            else:
                for p in range(last):
                    d_force = 0.0
                    for i in range(r + 1):
                        d_force += weights[i] * d_state[i, p]
                    jacobian[j, p] = d_force
                if coupled[0] == 0:
                    for i in range(r):
                        jacobian[j, k + i] = weights[i + 1] * d_state[i + 1, k + i]
                    for i in range(r + 1):
                        jacobian[j, k + r + i] = 0.0
                for i in range(r + 1):
                    jacobian[j, k + r + i] += state[i]


@compiled("float64[:, ::1](float64[::1], float64[::1], float64[::1])")
def modes(dt_s: Array, elastic: Array, rates: Array) -> Array:
    """h_i of a given elastic response, bonded: (n, M+1), column 0 is `elastic` itself, then one a rate (M,)."""
    n, M = dt_s.shape[0], rates.shape[0]
    out = np.empty((n, M + 1))
    state = np.zeros(M)
    decay, gain = np.ones(M), np.ones(M)
    before, last_dt = 0.0, -1.0
    for j in range(n):
        if dt_s[j] != last_dt:
            last_dt = dt_s[j]
            for i in range(M):
                gain[i] = ramp_gain(rates[i] * last_dt)
                decay[i] = 1.0 - rates[i] * last_dt * gain[i]
        rise = elastic[j] - before
        before = elastic[j]
        out[j, 0] = elastic[j]
        for i in range(M):
            state[i] = _flushed(decay[i] * state[i] + gain[i] * rise)
            out[j, i + 1] = state[i]
    return out


@compiled("float64(float64[::1], float64[::1], float64[::1])")
def squared(weight: Array, measured: Array, force: Array) -> float:
    """Σ w e². Here and below no BLAS: its threads cost more than they give on arrays of this size."""
    total = 0.0
    for j in range(measured.shape[0]):
        error = measured[j] - force[j]
        total += weight[j] * error * error
    return total


@compiled("float64(float64[::1], float64[::1], float64[::1], float64[:, ::1], float64[::1], float64[:, ::1])")
def accumulate(weight: Array, measured: Array, force: Array, jacobian: Array, gradient: Array, matrix: Array) -> float:
    """Add Σ w e J to `gradient` (P,) and the lower triangle of Σ w J Jᵀ to `matrix` (P, P); returns Σ w e²."""
    n, P = jacobian.shape
    total = 0.0
    for j in range(n):
        w = weight[j]
        if w == 0.0:
            continue
        error = measured[j] - force[j]
        total += w * error * error
        for p in range(P):
            scaled = w * jacobian[j, p]
            gradient[p] += scaled * error
            for q in range(p + 1):
                matrix[p, q] += scaled * jacobian[j, q]
    return total
