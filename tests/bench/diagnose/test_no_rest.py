"""Motion as quick as its samples, without a rest: what looks like noise is motion, and nothing is down to it."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import butter, sosfilt

from bench import identify
from bench.diagnose import diagnose
from bench.diagnose.words import lines
from bench.fitview import fit_view
from bench.identify.noise import noise_of, of_the_motion
from bench.recording.types import Measurement
from bench.report.verdict import judge
from sim.model import Model
from tests.bench.diagnose.small import measurement
from tests.truth.cases import null_case

LINE = {"elastic": {"law": "polynomial", "alpha": [0.0, 0.4]}, "relaxation": {"shares": [0.3], "rates": [5.0]}}


@functools.cache
def shaken(seed: int) -> Measurement:
    """A mass on a hardening spring, driven at random beyond its resonance; 1 mN of noise. No pad."""
    rng = np.random.default_rng(seed)
    rate_Hz, n = 600.0, 3000
    t = np.arange(n) / rate_Hz
    force = sosfilt(butter(4, 150.0, fs=rate_Hz, output="sos"), rng.standard_normal(n))
    force *= 0.22 / np.std(force)

    def moves(at: float, state: np.ndarray) -> list[float]:
        x, v = state
        return [v, 2.6e5 * float(np.interp(at, t, force)) - 40.0 * v - 1.8e5 * x - 3e4 * x**3]

    x = solve_ivp(moves, (0.0, float(t[-1])), [0.0, 0.0], t_eval=t, max_step=5e-4, rtol=1e-6).y[0]
    return Measurement("shaken", t, x - x[0], t, force + 1e-3 * rng.standard_normal(n))


@pytest.mark.parametrize("seed", range(3))
def test_motion_that_is_taken_for_noise_is_said_to_be_none(seed: int) -> None:
    m = shaken(seed)
    assert noise_of([m]).force_N > 0.1, "a hundred times the noise"
    fitted = identify.fit(m, law="polynomial", degree=1, order=1)
    assert any("goes with the motion from sample to sample" in note for note in fitted.notes)
    assert set(fitted.undetermined) == set(fitted.parameters)
    tone, said = judge(fit_view(fitted))
    assert tone == "bad" and "explains" not in said


@pytest.mark.parametrize("kind", ["white", "coloured", "quantised", "heavy"])
def test_noise_of_a_pad_is_no_motion(kind: str) -> None:
    for seed in range(12):
        m = measurement(null_case(seed, noise_kind=kind))
        assert not of_the_motion(m, noise_of([m]).force_N)
        loud = np.random.default_rng(seed).standard_normal(len(m.force_N)) * np.std(m.force_N)
        assert not of_the_motion(replace(m, force_N=m.force_N + loud), float(np.std(loud)))


@pytest.mark.long
@pytest.mark.parametrize("seed", range(2))
def test_nothing_is_explained_down_to_what_is_no_noise(seed: int) -> None:
    d = diagnose(shaken(seed), Model.from_dict({"pad": {**LINE, "contact": "bonded"}}))
    assert d.verdict == "unexplained" and all(cause.confidence <= 0.5 for cause in d.causes)
    assert any("goes with the motion from sample to sample" in line for line in lines(d))
