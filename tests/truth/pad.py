"""The quasi-linear pad, integrated finely in time.

The paper's (5) with (6), F = ∫ g(t−τ) dF^e[δ(τ)], is, with one internal variable a mode,

    z_i' = ν_i (u − z_i),    F = u − Σ c_i z_i,    u = F^e(δ),

where u − z_i = w_i is the state of w_i' = −ν_i w_i + K(δ) δ̇, and F = c_0 u + Σ c_i w_i.

`bonded`: that holds always, and F may be negative. `unilateral`: where F would be negative the pad has let go.
Then F = 0, hence u = Σ c_i z_i, and z_i' = ν_i (Σ c_j z_j − z_i) is linear and autonomous: the surface, which is
the depth with F^e = u, comes back by relaxation alone until the probe meets it, u = F^e(δ), again.

Between two nodes in contact  z(t+h) = e^{−νh} z(t) + ν ∫ e^{−ν(h−s)} u ds  by Gauss–Legendre quadrature; out of
contact the exponential of the matrix is exact. Nodes are the samples, a step no longer than `max_step_s`, the
corners of the motion and its crossings of the surface; let-go and return are found by root finding.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from scipy.optimize import brentq

from .laws import Law
from .motion import Motion

_X, _W = np.polynomial.legendre.leggauss(6)
_X, _W = (_X + 1) / 2, _W / 2


@dataclass(frozen=True)
class Pad:
    """Elastic law, shares c_1.., rates ν_1.. (1/s), contact. c_0 = 1 − Σ c_i."""

    law: Law
    shares: tuple[float, ...] = ()
    rates: tuple[float, ...] = ()
    contact: Literal["bonded", "unilateral"] = "unilateral"

    def __post_init__(self) -> None:
        c, nu = self.shares, self.rates
        if len(c) != len(nu) or min((*c, *nu), default=1.0) <= 0 or sum(c) > 1:
            raise ValueError(f"shares {c} and rates {nu} must pair, be positive, and the shares add to 1 at most")

    def relaxation(self, time_s: np.ndarray) -> np.ndarray:
        """(6): g(t) for t ≥ 0."""
        time = np.asarray(time_s, dtype=float)
        return 1 + sum(c * np.expm1(-nu * time) for c, nu in zip(self.shares, self.rates, strict=True))

    def parameters(self) -> dict[str, float]:
        """All numbers by name: the law's, c_1.., nu_1.. ."""
        shares = {f"c_{i}": c for i, c in enumerate(self.shares, 1)}
        return self.law.parameters() | shares | {f"nu_{i}": nu for i, nu in enumerate(self.rates, 1)}

    def with_parameters(self, values: dict[str, float]) -> Pad:
        """The same pad with some numbers changed."""
        law = {k: v for k, v in values.items() if k in self.law.parameters()}
        shares = tuple(values.get(f"c_{i}", c) for i, c in enumerate(self.shares, 1))
        rates = tuple(values.get(f"nu_{i}", nu) for i, nu in enumerate(self.rates, 1))
        return replace(self, law=self.law.with_parameters(law), shares=shares, rates=rates)

    def model(self, depth_mm: float = 4.0) -> dict[str, Any]:
        """The content of a model file; `depth_mm` bounds a law that must be written as points."""
        relaxation = {"shares": list(self.shares), "rates": list(self.rates)}
        pad = {"elastic": self.law.model(depth_mm), "relaxation": relaxation, "contact": self.contact}
        return {"pad": pad}


@dataclass(frozen=True)
class Response:
    """What the pad did at the times asked for, and the times of its events."""

    force_N: np.ndarray
    elastic_N: np.ndarray  # u: F^e(δ) in contact; out of contact the free surface's
    let_go: np.ndarray  # bool
    events: list[tuple[float, Literal["let_go", "return"]]] = field(default_factory=list)


def simulate(pad: Pad, motion: Motion, time_s: np.ndarray, max_step_s: float = 0.005) -> Response:
    """Force in N at the times given (not decreasing, ≥ 0), of a virgin pad at t = 0."""
    asked = np.asarray(time_s, dtype=float)
    nodes = _nodes(motion, asked, max_step_s)
    integrator = _Integrator(pad, motion, nodes)
    integrator.run()
    at = np.searchsorted(nodes, asked)
    return Response(integrator.force_N[at], integrator.elastic_N[at], integrator.let_go[at], integrator.events)


def _nodes(motion: Motion, asked: np.ndarray, max_step_s: float) -> np.ndarray:
    end = asked[-1]
    corners = motion.corners_s()
    even = np.linspace(0.0, end, max(2, math.ceil(end / max_step_s) + 1))
    nodes = np.unique(np.concatenate([even, corners[(corners > 0) & (corners < end)], asked]))
    depth = motion.position(nodes)
    crossed = np.flatnonzero(depth[:-1] * depth[1:] < 0)
    roots = [brentq(lambda t: float(motion.position(t)), nodes[k], nodes[k + 1], xtol=1e-14) for k in crossed]
    return np.union1d(nodes, roots)


class _Integrator:
    """Goes from node to node; the state is z (list of floats) and whether the pad has let go."""

    def __init__(self, pad: Pad, motion: Motion, nodes: np.ndarray) -> None:
        self.pad, self.motion, self.nodes = pad, motion, nodes
        self.c, self.nu = np.array(pad.shares), np.array(pad.rates)
        n = len(nodes)
        self.force_N, self.elastic_N, self.let_go = np.zeros(n), np.zeros(n), np.zeros(n, dtype=bool)
        self.events: list[tuple[float, Literal["let_go", "return"]]] = []
        self.z = np.zeros(len(self.c))
        self.free = False
        # Out of contact z' = A z. diag(c/ν) A is symmetric, so A has real eigenvalues and all its vectors.
        root = np.sqrt(self.c * self.nu)
        symmetric = np.outer(root, root) - np.diag(self.nu)
        self.eigenvalues, Q = np.linalg.eigh(symmetric)
        scale = np.sqrt(self.c / self.nu)
        self.to_modes, self.from_modes = Q.T * scale, Q / scale[:, None]

    def run(self) -> None:
        nodes, c = self.nodes, self.c.tolist()
        h = np.diff(nodes)
        u = self.pad.law.force(self.motion.position(nodes))
        decay = np.exp(-np.outer(h, self.nu)).tolist()
        gained = self._gain(nodes[:-1], h).tolist()
        unilateral = self.pad.contact == "unilateral"
        tolerance = 1e-13 * (1 + float(np.max(u)))
        self.force_N, self.elastic_N = u.copy(), u.copy()
        force = u.tolist()
        k = 0
        while k < len(h):
            if self.free:
                k += self._skip(k, u, tolerance)
                if k == len(h):
                    break
            else:
                z = [e * s + q for e, s, q in zip(decay[k], self.z, gained[k], strict=True)]
                F = force[k + 1] - sum(a * s for a, s in zip(c, z, strict=True))
                if -tolerance <= F or not unilateral:
                    k += 1
                    self.z, self.force_N[k] = z, F
                    continue
            self._with_events(nodes[k], nodes[k + 1], tolerance)
            k += 1
            held = float(self.c @ self.z)
            self.let_go[k] = self.free
            if self.free:
                self.elastic_N[k] = held
            self.force_N[k] = self.elastic_N[k] - held

    def _skip(self, k: int, u: np.ndarray, tolerance: float, most: int = 4096) -> int:
        """Out of contact: take all steps from node k on, at most so many, that end before the probe returns."""
        times = self.nodes[k + 1 : k + 1 + most] - self.nodes[k]
        states = np.exp(np.outer(times, self.eigenvalues)) * (self.to_modes @ self.z) @ self.from_modes.T
        surface = states @ self.c
        met = u[k + 1 : k + 1 + most] - surface > tolerance
        n = int(np.argmax(met)) if met.any() else len(met)
        if n:
            self.z = states[n - 1]
            span = slice(k + 1, k + 1 + n)
            self.force_N[span], self.elastic_N[span], self.let_go[span] = 0.0, surface[:n], True
            if n == len(met) and k + n < len(self.nodes) - 1:
                return n + self._skip(k + n, u, tolerance, most)
        return n

    def _gain(self, start_s: np.ndarray, h: np.ndarray) -> np.ndarray:
        """ν ∫ e^{−ν(h−s)} u ds over steps in contact: (steps, modes)."""
        u = self.pad.law.force(self.motion.position(start_s[:, None] + h[:, None] * _X))
        kernel = np.exp(-self.nu * h[:, None, None] * (1 - _X)[:, None])
        return self.nu * h[:, None] * np.einsum("kj,kji,j->ki", u, kernel, _W)

    def _touching(self, start_s: float, end_s: float) -> np.ndarray:
        h = end_s - start_s
        return np.exp(-self.nu * h) * self.z + self._gain(np.array([start_s]), np.array([h]))[0]

    def _freely(self, h: float) -> np.ndarray:
        return self.from_modes @ (np.exp(self.eigenvalues * h) * (self.to_modes @ self.z))

    def _surplus(self, start_s: float, t: float) -> float:
        """F^e(δ) − Σ c_i z_i: the force in contact; out of it, negative until the probe meets the surface."""
        z = self._freely(t - start_s) if self.free else self._touching(start_s, t)
        return float(self.pad.law.force(self.motion.position(t)) - self.c @ z)

    def _with_events(self, start_s: float, end_s: float, tolerance: float) -> None:
        """One step in which contact may change, more than once where the probe grazes the surface."""
        for _ in range(20):
            left = self._surplus(start_s, end_s)
            if (left <= tolerance) if self.free else (left >= -tolerance):
                break
            if self._surplus(start_s, start_s) * left < 0:
                event_s = brentq(lambda t, a=start_s: self._surplus(a, t), start_s, end_s, xtol=1e-14)
            else:
                event_s = start_s
            self.z = self._freely(event_s - start_s) if self.free else self._touching(start_s, event_s)
            self.free = not self.free
            self.events.append((event_s, "let_go" if self.free else "return"))
            start_s = event_s
        self.z = self._freely(end_s - start_s) if self.free else self._touching(start_s, end_s)
