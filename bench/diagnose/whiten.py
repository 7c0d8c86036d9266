"""Noise of a colour made white: what an entry tells beyond what those before it have told.

The noise of one force sample is σ (√a x + √(1 − a) ε), x a Gauss–Markov process of φ per sample and ε white. An entry
is the mean of w samples. The innovations of a Kalman filter on the state x at each entry's first sample are independent
of each other (B. D. O. Anderson, J. B. Moore, Optimal Filtering, Prentice Hall, 1979, chapters 5 and 9); that the mean
over an entry and the state after it have errors in common is carried along.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.jit import compiled

from .noise import Colour

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Whitening:
    """The filter on entries (n,), of which `at` (k,) count; `decay`, `gain`, `seen`, `inverse` (k,): its numbers."""

    at: NDArray[np.intp]
    decay: Array
    gain: Array
    seen: Array
    inverse: Array

    def __call__(self, e: Array) -> Array:
        """Errors (n,) that are σ/√w of a white sample each, without colour."""
        out = np.zeros(len(e))
        out[self.at] = _innovations(
            np.ascontiguousarray(e[self.at], dtype=np.float64), self.decay, self.gain, self.seen, self.inverse
        )
        return out


def whitening(colour: Colour, time_s: Array, weight: Array, sample_s: float) -> Whitening | None:
    """For entries (n,) at their mean times, each the mean of `weight` samples `sample_s` apart; None: nothing to do."""
    a, phi = colour.share, colour.phi
    at = np.flatnonzero(weight > 0)
    if a <= 0.0 or phi <= 0.0 or len(at) < 2:
        return None
    w = weight[at]
    first = time_s[at] - 0.5 * (w - 1.0) * sample_s
    steps = np.maximum(np.diff(first, append=first[-1] + w[-1] * sample_s) / sample_s, 1.0)
    faded = phi**w
    share = (1.0 - faded) / (w * (1.0 - phi))  # of the state at the first sample in the mean
    square = (1.0 + phi) / (1.0 - phi) / w - 2.0 * phi * (1.0 - faded) / ((1.0 - phi) * w) ** 2
    seen = np.sqrt(a * w) * share
    noise = np.maximum(1.0 - a + a * w * (square - share**2), 1e-12)
    decay = phi**steps
    common = seen * np.maximum(phi ** np.maximum(steps - w + 1.0, 1.0) - decay, 0.0)
    gain, inverse = _gains(seen, noise, decay, common)
    return Whitening(at, decay, gain, seen, inverse)


@compiled("UniTuple(float64[::1], 2)(float64[::1], float64[::1], float64[::1], float64[::1])")
def _gains(seen: Array, noise: Array, decay: Array, common: Array) -> tuple[Array, Array]:
    """What an innovation adds to the next state, and one over each innovation's standard deviation."""
    n = seen.shape[0]
    gain, inverse = np.zeros(n), np.zeros(n)
    doubt = 1.0
    for k in range(n):
        square = seen[k] ** 2 * doubt + noise[k]
        gain[k] = (decay[k] * doubt * seen[k] + common[k]) / square
        inverse[k] = 1.0 / np.sqrt(square)
        doubt = decay[k] ** 2 * doubt + 1.0 - decay[k] ** 2 - gain[k] ** 2 * square
        doubt = min(max(doubt, 0.0), 1.0)
    return gain, inverse


@compiled("float64[::1](float64[::1], float64[::1], float64[::1], float64[::1], float64[::1])")
def _innovations(e: Array, decay: Array, gain: Array, seen: Array, inverse: Array) -> Array:
    """Each entry less what those before it foretell, over its standard deviation."""
    out = np.zeros(e.shape[0])
    state = 0.0
    for k in range(e.shape[0]):
        innovation = e[k] - seen[k] * state
        out[k] = innovation * inverse[k]
        state = decay[k] * state + gain[k] * innovation
    return out
