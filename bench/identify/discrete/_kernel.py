"""The compiled loop of the discrete model: elastic response through the digital filter (13), with sensitivities.

    F(k) = u(k) + Σ b_i u(k−i) − Σ a_i F(k−i),    u = gain · s(δ),    b_0 = 1, l = r, k = 0

from rest. On a unilateral pad that would pull, F = 0 and u is what makes it so (the surface that has let go). Every
derivative follows by the chain rule of the same recursion. The derivatives by the filter are taken in the basis of
`system.Basis`, seed by seed, where nearly equal columns would lose their digits.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim.jit import compiled

from .._kernel import Array


@compiled(
    "boolean(float64[::1], float64[:, ::1], float64, float64[::1], float64[::1], float64[:, ::1], boolean, float64,"
    "float64[::1], float64[::1], float64[:, ::1], float64[:, ::1], boolean[::1])"
)
def run(
    s: Array,
    ds: Array,
    gain: float,
    a: Array,
    b: Array,
    M: Array,
    unilateral: bool,
    limit: float,
    force: Array,
    elastic: Array,
    jacobian: Array,
    d_elastic: Array,
    let_go: NDArray[np.bool_],
) -> bool:
    """Model over K samples; False where |F| passed `limit` (an unstable filter), the rest then left as it was.

    `s` (K,), `ds` (K, k): shape of the elastic response and its derivatives; `a`, `b` (r,); `M` (r, r): a = a* + M α,
    b = b* + M β. Written: `force`, `elastic` (K,), `let_go` (K,), and `jacobian` (K, P) of the force by (gain, θ), or
    by (gain, θ, α, β); (0, 0): no derivatives. `d_elastic` (r, P): workspace, derivatives of the last r of u.
    """
    n, r, g = s.shape[0], a.shape[0], 1 + ds.shape[1]
    want = jacobian.shape[0] > 0
    P = jacobian.shape[1]
    for i in range(d_elastic.shape[0]):
        for p in range(P):
            d_elastic[i, p] = 0.0
    for k in range(n):
        known = min(r, k)
        rest = 0.0
        for i in range(known):
            rest += b[i] * elastic[k - 1 - i] - a[i] * force[k - 1 - i]
        u = gain * s[k]
        gone = unilateral and u + rest < 0.0
        if gone:
            u = -rest
        F = 0.0 if gone else u + rest
        if not abs(F) <= limit:
            return False
        if abs(F) < 1e-250:  # what has died away would stay among the slow subnormal numbers
            F = 0.0
        force[k], elastic[k], let_go[k] = F, u, gone
        if want:
            for p in range(P):
                d = 0.0
                for i in range(known):
                    d += b[i] * d_elastic[i, p] - a[i] * jacobian[k - 1 - i, p]
                if p >= g:
                    if p < g + r:
                        for i in range(known):
                            d -= M[i, p - g] * force[k - 1 - i]
                    else:
                        for i in range(known):
                            d += M[i, p - g - r] * elastic[k - 1 - i]
                if abs(d) < 1e-250:
                    d = 0.0
                now = 0.0
                if gone:
                    now = -d
                elif p == 0:
                    now = s[k]
                elif p < g:
                    now = gain * ds[k, p - 1]
                for i in range(r - 1, 0, -1):
                    d_elastic[i, p] = d_elastic[i - 1, p]
                if r > 0:
                    d_elastic[0, p] = now
                jacobian[k, p] = 0.0 if gone else now + d
    return True
