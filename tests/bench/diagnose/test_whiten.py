"""Noise of a colour made white, against the covariance written out."""

from __future__ import annotations

import numpy as np
import pytest

from bench.diagnose.noise import Colour
from bench.diagnose.whiten import whitening

SAMPLES = np.array([1.0, 1.0, 2.0, 3.0, 5.0, 8.0, 1.0, 1.0, 4.0, 1.0])
MISSING = np.array([0, 0, 0, 0, 3, 0, 0, 5, 0, 0])
"""Samples of each entry, and how many are missing after it."""


@pytest.mark.parametrize(
    "poles",
    [
        *(((share, phi),) for share in (0.2, 0.7, 1.0) for phi in (0.1, 0.8, 0.99)),
        ((0.3, 0.99), (0.3, 0.9), (0.25, 0.3)),
        ((0.5, 0.95), (0.5, 0.2)),
    ],
)
def test_means_of_coloured_samples_become_independent(poles):
    first = np.cumsum(np.concatenate([[0], (SAMPLES + MISSING)[:-1]])).astype(int)
    n = int(first[-1] + SAMPLES[-1])
    apart = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    covariance = sum(share * phi**apart for share, phi in poles) + (1 - sum(a for a, _ in poles)) * np.eye(n)
    mean = np.zeros((len(SAMPLES), n))
    for row, (start, count) in enumerate(zip(first, SAMPLES.astype(int), strict=True)):
        mean[row, start : start + count] = 1 / count
    of_entries = mean @ covariance @ mean.T * np.sqrt(np.outer(SAMPLES, SAMPLES))  # in units of σ/√w
    white = whitening(Colour(poles), (first + (SAMPLES - 1) / 2) * 0.01, SAMPLES, 0.01)
    assert white is not None
    W = np.stack([white(column) for column in np.eye(len(SAMPLES))], axis=1)
    assert np.allclose(W @ of_entries @ W.T, np.eye(len(SAMPLES)), atol=1e-9)


def test_entries_that_do_not_count_are_passed_over():
    weight = np.array([1.0, 0.0, 1.0, 1.0])
    time = np.array([0.0, 0.004, 0.01, 0.02])
    white = whitening(Colour(((0.9, 0.9),)), time, weight, 0.01)
    alone = whitening(Colour(((0.9, 0.9),)), time[weight > 0], np.ones(3), 0.01)
    assert white is not None and alone is not None
    e = np.array([0.3, 7.0, -1.2, 0.4])
    assert white(e)[1] == 0.0 and np.allclose(white(e)[weight > 0], alone(e[weight > 0]))
    assert whitening(Colour(), time, weight, 0.01) is None
