"""How noisy the force is, sample by sample, and how much neighbouring samples say the same thing.

σ² = σ_F² + (K σ_x)²: the force's own noise, and what is left of the position's through the local stiffness. The colour
is that of a Gauss–Markov process with white noise beside it, ρ_k = a φ^k, matched in the holds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from bench.identify.motion import holds
from bench.recording.types import Measurement

Array = NDArray[np.float64]

LONGEST = 2000  # samples of a hold that are looked at
LEAST = 12
MEMORY_S = 0.15  # correlation time beyond which it is no noise, but structure


@dataclass(frozen=True)
class Colour:
    """ρ_0 = 1, ρ_k = share · φ^k between force samples k apart."""

    share: float = 0.0
    phi: float = 0.0

    @property
    def memory(self) -> float:
        """Samples that say the same as one, of a slow direction: 1 + 2 Σ ρ."""
        return 1.0 + 2.0 * self.share * self.phi / (1.0 - self.phi)


@dataclass(frozen=True)
class ForceNoise:
    """`force_N`: standard deviation of the force alone; `from_holds`: else from motion."""

    force_N: float
    colour: Colour
    from_holds: bool


Part = tuple[Array, Array, Array]
"""Of one hold: stamps, errors about a smooth curve, and the orthonormal basis that was taken out."""


def hold_errors(m: Measurement, good: NDArray[np.bool_]) -> list[Part]:
    """What smooth curves leave of the force samples (m,) that are `good`, hold by hold."""
    parts: list[Part] = []
    for stretch in holds(m.position_time_s, m.position_mm):
        t0, t1 = m.position_time_s[stretch.start], m.position_time_s[stretch.stop - 1]
        first, last = np.searchsorted(m.force_time_s, [t0, t1])
        # what a mode, a lag or ringing still does just after the motion is no noise
        first = int(first) + min(int(last - first) // 4, int(np.searchsorted(m.force_time_s[first:last], t0 + 0.15)))
        first = max(first, int(last) - LONGEST)
        kept = np.arange(first, int(last))[good[first : int(last)]]
        if len(kept) >= LEAST:
            parts.append((m.force_time_s[kept], *_about_curve(m.force_time_s[kept], m.force_N[kept])))
    return parts


def force_noise(m: Measurement, good: NDArray[np.bool_]) -> ForceNoise:
    """Of the force samples (m,) that are `good`, about smooth curves through the holds."""
    parts = [(e, Q) for _, e, Q in hold_errors(m, good)]
    if sum(len(e) for e, _ in parts) < 40:
        return ForceNoise(_from_motion(m.force_N[good]), Colour(), False)
    return _matched(parts, float(np.median(np.diff(m.force_time_s))))


def _about_curve(t: Array, y: Array) -> tuple[Array, Array]:
    """(what is left of y about a constant, a line and exponentials, the orthonormal basis taken out)."""
    n = len(y)
    span = t[-1] - t[0]
    terms = int(np.clip(n // 8, 1, 9))
    basis = [np.ones(n), (t - t[0]) / span]
    basis += [np.exp(-(t - t[0]) / tau) for tau in np.geomspace(2.0 * span / n, 0.6 * span, terms)]
    Q, _ = np.linalg.qr(np.stack(basis, axis=1))
    left = y - y.mean()
    return left - Q @ (Q.T @ left), Q


def _matched(parts: list[tuple[Array, Array]], sample_s: float) -> ForceNoise:
    """σ, a and φ for which what the projection leaves has the autocovariance found."""
    longest = max(len(e) for e, _ in parts)
    lags = np.unique(np.concatenate([[0, 1, 2, 3, 5, 8], np.geomspace(10, 200, 8)]).astype(np.intp))
    lags = lags[lags < max(longest // 3, 2)]
    found = np.zeros(len(lags))
    for e, _ in parts:
        found += [float(e[: len(e) - k] @ e[k:]) if k < len(e) else 0.0 for k in lags]
    sizes = np.array([sum(max(len(e) - k, 0) for e, _ in parts) for k in lags], dtype=np.float64)
    white = np.array([_expected(parts, lags, 0.0)]).ravel()
    sigma2 = found[0] / white[0]
    left = found / sizes
    best = (np.inf, 0.0, 0.0, sigma2)
    if len(lags) > 3 and abs(left[1]) > 3.0 * left[0] / np.sqrt(sizes[1]):
        slowest = float(np.exp(-sample_s / MEMORY_S))
        for phi in 1.0 - np.geomspace(0.6, max(1.0 - slowest, 1e-4), 28):
            tail = _expected(parts, lags, float(phi))
            A = np.stack([white, tail], axis=1) / sizes[:, None]
            weight = np.sqrt(sizes / sizes[0])
            solution = np.linalg.lstsq(A * weight[:, None], left * weight, rcond=None)[0]
            nugget, coloured = max(float(solution[0]), 0.0), max(float(solution[1]), 0.0)
            error = float(np.sum((weight * (A @ [nugget, coloured] - left)) ** 2))
            if error < best[0]:
                best = (error, float(phi), coloured / max(nugget + coloured, 1e-300), nugget + coloured)
    _, phi, share, sigma2 = best
    return ForceNoise(float(np.sqrt(max(sigma2, 1e-300))), Colour(share, phi) if share > 0.02 else Colour(), True)


def _expected(parts: list[tuple[Array, Array]], lags: NDArray[np.intp], phi: float) -> Array:
    """Σ over the parts of E[ê_i ê_{i+k}] for unit noise of ρ_k = φ^k, ê what the projection leaves."""
    out = np.zeros(len(lags))
    for e, Q in parts:
        n = len(e)
        if phi > 0.0:  # R Q by two recursions
            forward = lfilter([1.0], [1.0, -phi], Q, axis=0)
            backward = lfilter([1.0], [1.0, -phi], Q[::-1], axis=0)[::-1]
            RQ = forward + backward - Q
        else:
            RQ = Q
        inner = Q.T @ RQ
        for j, k in enumerate(lags):
            if k >= n:
                continue
            plain = (n - k) * phi**k if phi > 0 else (float(n) if k == 0 else 0.0)
            cross = float(np.sum(RQ[: n - k] * Q[k:])) + float(np.sum(Q[: n - k] * RQ[k:]))
            out[j] += plain - cross + float(np.sum((Q[: n - k] @ inner) * Q[k:]))
    return out


def _from_motion(y: Array) -> float:
    """Without holds: scatter about parabolas over nine samples."""
    n = len(y) // 9
    if n < 2:
        return float(np.std(np.diff(y)) / np.sqrt(2)) if len(y) > 2 else 0.0
    t = np.linspace(-1, 1, 9)
    A = np.stack([np.ones(9), t, t * t], axis=1)
    windows = y[: 9 * n].reshape(n, 9)
    error = windows - windows @ (A @ np.linalg.pinv(A)).T
    return float(np.sqrt(np.median(np.sum(error**2, axis=1)) / 5.348))
