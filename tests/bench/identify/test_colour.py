"""The residual's colour: autocovariances in closed form, and what a fit took out put back."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import t as student_t

from bench.identify.colour import corrected_colour, plain_colour, spread_through
from bench.identify.uncertainty import student


def ar1(rng: np.random.Generator, phi: float, n: int) -> np.ndarray:
    """Unit variance."""
    fresh = rng.standard_normal(n) * np.sqrt(1 - phi**2)
    fresh[0] = rng.standard_normal()
    return np.asarray(lfilter([1.0], [1.0, -phi], fresh))


def test_white_noise_remembers_nothing() -> None:
    memories = [plain_colour([np.random.default_rng(k).standard_normal(4000)]).memory for k in range(20)]
    assert np.median(memories) == 1.0 and max(memories) < 1.2


@pytest.mark.parametrize("phi", [0.8, 0.98])
def test_a_gauss_markov_memory_is_found(phi: float) -> None:
    memories = [plain_colour([ar1(np.random.default_rng(k), phi, 40_000)]).memory for k in range(10)]
    assert np.mean(memories) == pytest.approx((1 + phi) / (1 - phi), rel=0.1)


def test_two_runs_count_together_and_not_across_their_joint() -> None:
    rng = np.random.default_rng(3)
    one, two = ar1(rng, 0.9, 20_000), ar1(rng, 0.9, 20_000)
    colour = plain_colour([one, two])
    assert colour.memory == pytest.approx(19, rel=0.15)
    assert colour.gamma[0] == pytest.approx((one @ one + two @ two) / 40_000)


def test_what_the_fit_took_out_is_put_back() -> None:
    """A regression on ten slow waves: the residual of coloured noise forgets sooner, and is smaller, than the noise."""
    n, phi = 5000, 0.98
    t = np.arange(n) / n
    J = np.stack([np.cos(np.pi * k * t) for k in range(10)], axis=1)
    inverse = np.linalg.inv(J.T @ J)
    true = (1 + phi) / (1 - phi)
    raw, corrected = [], []
    for seed in range(25):
        e = ar1(np.random.default_rng(seed), phi, n)
        e = e - J @ (inverse @ (J.T @ e))
        raw.append(plain_colour([e]).memory * np.mean(e**2))
        colour = corrected_colour([e], [J], inverse)
        corrected.append(colour.memory * colour.gamma[0])
    assert np.mean(raw) < 0.75 * true
    assert np.mean(corrected) == pytest.approx(true, rel=0.15)


def test_white_noise_gets_its_degrees_of_freedom_back() -> None:
    n, P = 200, 20
    rng = np.random.default_rng(0)
    J = rng.standard_normal((n, P))
    inverse = np.linalg.inv(J.T @ J)
    found = []
    for _ in range(60):
        e = rng.standard_normal(n)
        e -= J @ (inverse @ (J.T @ e))
        found.append(corrected_colour([e], [J], inverse).gamma[0])
    assert np.mean(found) == pytest.approx(1.0, abs=0.03)  # uncorrected: 0.9


def test_spread_is_the_double_sum() -> None:
    rng = np.random.default_rng(1)
    J = [rng.standard_normal((n, 3)) for n in (50, 31)]
    gamma = 0.8 ** np.arange(12)
    direct = np.zeros((3, 3))
    for part in J:
        lag = np.abs(np.subtract.outer(np.arange(len(part)), np.arange(len(part))))
        direct += part.T @ np.where(lag < 12, gamma[np.minimum(lag, 11)], 0.0) @ part
    np.testing.assert_allclose(spread_through(J, gamma), direct, rtol=1e-10)


def test_student_widens_what_few_samples_tell() -> None:
    for freedom in (3.0, 10.0, 100.0):
        assert student(freedom) * 1.959964 == pytest.approx(student_t.ppf(0.975, freedom), rel=1e-5)
    assert student(1e9) == pytest.approx(1.0, abs=1e-4)
