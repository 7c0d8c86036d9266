"""The doubt about the one sample at which a force leaps."""

from __future__ import annotations

import numpy as np
import pytest

from bench.diagnose.within_a_step import leaps

NOISE_N = 0.01
LEAPS = 40


def staircase(late: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """(samples, where the leaps are): 0 and 1 N by turns, 20 samples each. `late`: the share of a step by which a leap
    is late, so that the first sample behind it is as much lower."""
    force = np.repeat(np.arange(LEAPS + 1) % 2, 20).astype(float)
    at = 20 * np.arange(1, LEAPS + 1)
    force[at] += late * (force[at - 1] - force[at])
    return force, at


@pytest.fixture
def sigma() -> np.ndarray:
    return np.full(20 * (LEAPS + 1), NOISE_N)


def test_one_leap_met_a_little_late_is_anywhere_in_its_step(sigma):
    modelled, at = staircase()
    measured = modelled + NOISE_N * np.random.default_rng(1).standard_normal(len(modelled)).clip(-2, 2)
    assert not leaps(modelled, measured, sigma).any()
    measured[at[7]] = 0.4
    doubt = leaps(modelled, measured, sigma)
    assert np.flatnonzero(doubt).tolist() == [at[7]]
    assert doubt[at[7]] == pytest.approx(12**-0.5)  # of what is even over 1 N


def test_where_all_leaps_are_late_that_is_no_chance(sigma):
    modelled, _ = staircase()
    assert not leaps(modelled, staircase(late=0.3)[0], sigma).any()


@pytest.mark.parametrize(
    ("offset", "value"),
    [(0, 1.5), (5, 0.6)],
    ids=["beyond what lies beside it", "away from a leap"],
)
def test_a_pulse_is_none(sigma, offset, value):
    modelled, at = staircase()
    measured = modelled.copy()
    measured[at[6] + offset] = value
    assert not leaps(modelled, measured, sigma).any()


def test_what_goes_on_is_none(sigma):
    """A lag that the next sample shows too."""
    modelled, at = staircase()
    measured = modelled.copy()
    measured[at[6]], measured[at[6] + 1] = 0.4, 0.7
    assert not leaps(modelled, measured, sigma).any()


def test_too_few_samples_have_no_leap():
    assert leaps(np.zeros(2), np.ones(2), np.ones(2)).tolist() == [0.0, 0.0]
