"""The estimator for use while the run goes on."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bench import identify
from bench.identify import _recursive_kernel as kernel
from bench.identify.laws import exponential, polynomial, power
from bench.identify.recursive import ROOM, Recursive

from .discrete_data import measurement, steps

TRUTH = {"m": 2.24, "b": 0.69, "c_1": 0.25, "c_2": 0.15, "nu_1": 4.0, "nu_2": 0.35}


def fed(m, estimator=None, until_s=math.inf) -> Recursive:
    estimator = estimator or Recursive(exponential(), 2, 3.0, 20.0)
    for t, x, F in zip(m.force_time_s.tolist(), m.position_mm.tolist(), m.force_N.tolist(), strict=True):
        if t > until_s:
            break
        estimator.update(t, x, F)
    return estimator


def test_it_arrives_while_the_run_goes_on():
    # After two of seven levels, and at the end nearer.
    off = {"early": [], "late": []}
    for seed in range(4):
        m = measurement(steps(seed))
        for when, until in (("early", 6.4), ("late", math.inf)):
            found = fed(m, until_s=until).parameters
            off[when].append(max(abs(found[n] / x - 1) for n, x in TRUTH.items()))
    assert np.median(off["early"]) < 0.15 and max(off["late"]) < 0.02


@pytest.mark.parametrize("family", [exponential(), power(), polynomial(3)], ids=lambda f: f.name)
def test_the_compiled_law_is_the_laws_own(family):
    kind = {"exponential": kernel.EXPONENTIAL, "power": kernel.POWER, "polynomial": kernel.POLYNOMIAL}[family.name]
    depths = np.array([-0.2, 0.0, 1e-3, 0.3, 0.9, 1.1])
    for theta in [*family.starts[:6], np.full(family.size, 1e-5)]:
        s, ds = family.shape(depths, np.asarray(theta))
        for n, u in enumerate(depths.tolist()):
            slope = np.empty(family.size)
            assert kernel.law_value(kind, u, np.asarray(theta, dtype=float), slope) == pytest.approx(s[n], abs=1e-9)
            assert np.allclose(slope, ds[n], atol=1e-6)


def test_its_memory_is_bounded_and_joining_keeps_what_was_learned():
    m = measurement(steps(0, rate_hz=1000.0))
    rng = np.random.default_rng(0)
    estimator = fed(m)
    end = float(m.force_time_s[-1])
    before = estimator.parameters
    # Never still: every sample is a block of its own.
    from tests.truth import draw
    from tests.truth.motion import sinusoids
    from tests.truth.pad import simulate

    wave = sinusoids(0.5, 2.4, [0.5, 3.0], periods=10)
    t = np.arange(0, wave.duration_s, 1e-3)
    F = simulate(draw.POLYURETHANE, wave, t).force_N + 0.01 * rng.standard_normal(len(t))
    estimator.rest()
    for now, x, f in zip((end + 1 + t).tolist(), wave.position(t).tolist(), F.tolist(), strict=True):
        estimator.update(now, x, f)
        assert estimator.blocks <= ROOM
    assert all(estimator.parameters[n] == pytest.approx(x, rel=0.03) for n, x in TRUTH.items()), before


def test_samples_without_force_and_uneven_times():
    m = measurement(steps())
    rng = np.random.default_rng(1)
    keep = np.sort(rng.choice(len(m.force_N), int(0.7 * len(m.force_N)), replace=False))
    estimator = Recursive(exponential(), 2, 3.0, 20.0)
    for n in keep.tolist():
        force = float(m.force_N[n]) if rng.random() < 0.6 else math.nan
        estimator.update(float(m.force_time_s[n]), float(m.position_mm[n]), force)
    assert all(estimator.parameters[n] == pytest.approx(x, rel=0.05) for n, x in TRUTH.items())


def test_time_must_rise():
    estimator = Recursive(exponential(), 1, 1.0, 1.0)
    estimator.update(0.0, 0.0, 0.0)
    with pytest.raises(ValueError, match="rise"):
        estimator.update(0.0, 0.0, 0.0)
    with pytest.raises(ValueError):
        Recursive(exponential(), 1, 0.0, 1.0)


def test_it_is_always_a_relaxation():
    m = measurement(steps(2, noise_N=0.2))
    estimator = Recursive(exponential(), 3, 3.0, 20.0)
    for n, (t, x, F) in enumerate(
        zip(m.force_time_s.tolist(), m.position_mm.tolist(), m.force_N.tolist(), strict=True)
    ):
        estimator.update(t, x, F)
        if n % 200 == 0:
            p = estimator.parameters
            assert min(p[f"c_{i}"] for i in (1, 2, 3)) > 0 and sum(p[f"c_{i}"] for i in (1, 2, 3)) < 1
            assert p["nu_1"] >= p["nu_2"] >= p["nu_3"] > 0 and p["m"] > 0


def test_as_a_method_over_recorded_data():
    f = identify.fit(measurement(steps()), method="recursive")
    assert (f.law, f.order, f.physical, f.converged) == ("exponential", 2, True, True) and f.filter is None
    assert {"time_s", "m", "b", "c_1", "nu_1"} <= set(f.history) and f.iterations == f.samples
    assert np.mean(f.residual**2) == pytest.approx(f.V) and f.rmse < 1.05 * f.noise_floor
    whole = identify.fit(measurement(steps()), law="exponential", order=2)
    assert f.V <= 1.05 * whole.V
