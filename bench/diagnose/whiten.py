"""Noise of a colour made white: what an entry tells beyond what those before it have told.

The noise of one force sample is σ (Σ √a_i x_i + √(1 − Σ a_i) ε), x_i independent Gauss–Markov processes of φ_i per
sample and ε white. An entry is the mean of w samples. The innovations of a Kalman filter on the states x_i at each
entry's first sample are independent of each other (B. D. O. Anderson, J. B. Moore, Optimal Filtering, Prentice Hall,
1979, chapters 5 and 9); that the mean over an entry and the states after it have errors in common is carried along.
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
    """The filter on entries (n,), of which `at` (k,) count; its numbers: `decay`, `gain`, `seen` (k, states), and
    `inverse` (k,)."""

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
    poles = np.array([(a, phi) for a, phi in colour.poles if a > 0.0 and phi > 0.0]).reshape(-1, 2)
    at = np.flatnonzero(weight > 0)
    if not len(poles) or len(at) < 2:
        return None
    a, phi = poles.T
    w = weight[at][:, None]
    first = time_s[at] - 0.5 * (weight[at] - 1.0) * sample_s
    steps = np.maximum(np.diff(first, append=first[-1] + weight[at][-1] * sample_s) / sample_s, 1.0)[:, None]
    faded = phi**w
    share = (1.0 - faded) / (w * (1.0 - phi))  # of the state at the first sample in the mean
    square = (1.0 + phi) / (1.0 - phi) / w - 2.0 * phi * (1.0 - faded) / ((1.0 - phi) * w) ** 2
    seen = np.sqrt(a * w) * share
    noise = np.maximum(1.0 - a.sum() + np.sum(a * w * (square - share**2), axis=1), 1e-12)
    decay = phi**steps
    common = seen * np.maximum(phi ** np.maximum(steps - w + 1.0, 1.0) - decay, 0.0)
    seen, decay = np.ascontiguousarray(seen), np.ascontiguousarray(decay)
    gain, inverse = _gains(seen, noise, decay, np.ascontiguousarray(common))
    return Whitening(at, decay, gain, seen, inverse)


@compiled("Tuple((float64[:, ::1], float64[::1]))(float64[:, ::1], float64[::1], float64[:, ::1], float64[:, ::1])")
def _gains(seen: Array, noise: Array, decay: Array, common: Array) -> tuple[Array, Array]:
    """What an innovation adds to the next states, and one over each innovation's standard deviation."""
    n, states = seen.shape
    gain, inverse = np.zeros((n, states)), np.zeros(n)
    doubt, told = np.eye(states), np.zeros(states)  # `told`: what the states' doubts and the entry have in common
    for k in range(n):
        square = noise[k]
        for i in range(states):
            told[i] = 0.0
            for j in range(states):
                told[i] += doubt[i, j] * seen[k, j]
            square += seen[k, i] * told[i]
        for i in range(states):
            gain[k, i] = (decay[k, i] * told[i] + common[k, i]) / square
        inverse[k] = 1.0 / np.sqrt(square)
        for i in range(states):
            for j in range(states):
                doubt[i, j] = decay[k, i] * doubt[i, j] * decay[k, j] - gain[k, i] * gain[k, j] * square
            doubt[i, i] = min(max(doubt[i, i] + 1.0 - decay[k, i] ** 2, 0.0), 1.0)
    return gain, inverse


@compiled("float64[::1](float64[::1], float64[:, ::1], float64[:, ::1], float64[:, ::1], float64[::1])")
def _innovations(e: Array, decay: Array, gain: Array, seen: Array, inverse: Array) -> Array:
    """Each entry less what those before it foretell, over its standard deviation."""
    n, states = seen.shape
    out, state = np.zeros(n), np.zeros(states)
    for k in range(n):
        innovation = e[k]
        for i in range(states):
            innovation -= seen[k, i] * state[i]
        out[k] = innovation * inverse[k]
        for i in range(states):
            state[i] = decay[k, i] * state[i] + gain[k, i] * innovation
    return out
