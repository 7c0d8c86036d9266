"""The third shapes of the pad's own effects against closed forms."""

import numpy as np
import pytest
from scipy.special import erfcx

from .effects.third_pad import Hencky, Ogden, ThinLayer, fractional_rates, gamma_rates
from .laws import Power
from .motion import Path
from .pad import Pad
from .sets import shapes_of
from .test_truth_effects import cycles, hidden

pytestmark = pytest.mark.long


def test_adhesion():
    motion = Path(-0.5).to(1.0, 2.0).hold(0.1).to(-0.5, 2.0).motion()
    fine, told, _ = hidden("adhesion", "van_der_waals", motion=motion)
    x, out = fine.reported_mm, (fine.reported_mm < 0) & (fine.time_s > 0)
    gap = -x[out] * np.expm1(0.5) / told["range"]
    assert np.allclose(fine.force_N[out], -told["pull_off"] / (1 + gap) ** 2, atol=1e-9)
    assert np.interp(-told["range"], x[x < 0][:2500], fine.force_N[x < 0][:2500]) == pytest.approx(
        -told["pull_off"] / np.e, rel=1e-3
    )
    fine, told, _ = hidden("adhesion", "bilinear", motion=motion)
    x, back = fine.reported_mm, fine.time_s > 0.8
    gaps = told["range"] * np.array([0.125, 0.25, 0.625])
    pulls = -np.interp(gaps, -x[back], fine.force_N[back]) / told["pull_off"]
    assert pulls == pytest.approx([0.5, 1.0, 0.5], abs=0.02)
    assert np.all(fine.force_N[~back & (x < 0)] == 0) and np.all(fine.force_N[back & (x < -1.01 * told["range"])] == 0)


def test_laws():
    d = np.linspace(0, 2.0, 500)
    # α = 2 is neo-Hooke's, A (λ^{−2} − λ); small strains of all: a straight line or Hertz's.
    stretch = 1 - d / 5.0
    assert np.allclose(Ogden(1.5, 2.0, 5.0).force(d), 1.5 * (stretch**-2 - stretch))
    assert Hencky(2.0, 50.0).force(0.01) == pytest.approx(2 * 0.01 / 50, rel=1e-3)
    assert ThinLayer(1.0, 5.0, 1e6).force(1.0) == pytest.approx(1.0, rel=1e-4)
    # √(5 · 0.8)/4 = ½: 1 + 1.133/2 + 1.283/4 + 0.769/8 + 0.0975/16.
    assert ThinLayer(1.0, 5.0, 4.0).force(0.8) == pytest.approx(0.8**1.5 * 1.98946875)
    for law in (Ogden(1.0, 8.0, 4.0), Hencky(1.0, 2.4), ThinLayer(1.0, 8.0, 4.0)):
        assert np.all(np.diff(law.force(d)) > 0) and law.force(-1.0) == 0


def test_softening_by_a_ratio():
    fine, told, build = hidden("stress_softening", "ratio", motion=cycles(1.0, 0.0, 1.6, 0.0, 2.0))
    x, deepest = fine.reported_mm, np.maximum.accumulate(fine.reported_mm)
    inside = x > 0.02
    power = build.plant.numbers["softening_share"]
    assert np.allclose(fine.force_N[inside], 3 * x[inside] * (x[inside] / deepest[inside]) ** power, atol=1e-6)
    at = 1 - min(told["depth"], 0.8)  # 2 depth of 2 mm
    assert at**power == pytest.approx(1 - told["share"])


def test_damage():
    motion = cycles(2.0, 0.0, 1.0, 0.0, 2.0)
    for shape in shapes_of("damage", "third"):
        fine, told, _ = hidden("damage", shape, 2.0, motion=motion)
        x, rate = fine.reported_mm, told["rate"]
        way = np.maximum(np.diff(x, prepend=x[0]), 0)
        if shape == "hyperbolic":
            kept = 1 / (1 + rate * np.cumsum(way))
        else:
            kept = np.exp(-rate * np.cumsum(way * (x + np.roll(x, 1)) / 2.0))
        assert np.allclose(fine.force_N[x > 0.1], (3 * x * kept)[x > 0.1], atol=1e-6)
    # To 2 mm, to half of it, to 2 mm again: 2 + 0.5 + 2 mm by load.
    assert fine.force_N[-2] / 6 == pytest.approx(np.exp(-4.5 * rate), rel=1e-3)


def test_a_set_that_creeps():
    motion = Path(-0.5).to(2.0, 50.0).hold(4.0).to(-0.5, 50.0).hold(1.0).to(2.0, 50.0).hold(0.5).motion()
    fine, told, _ = hidden("permanent_set", "creeps", 2.0, motion=motion)
    sunk = 2.0 - fine.force_N / 3.0
    t = np.array([0.5, 1.0, 1.5])
    left = 2 * told["set"] - np.interp(t, fine.time_s, sunk)
    assert left[1] / left[0] == pytest.approx(left[2] / left[1], rel=1e-3) and 0 < left[0] < 2 * told["set"]
    assert sunk[-1] == pytest.approx(2 * told["set"], rel=2e-2) and sunk[-1] >= np.interp(4.0, fine.time_s, sunk) - 1e-9


def test_spectra_of_relaxation():
    t = np.geomspace(0.02, 5, 60)
    for power in (1.5, 3.0):
        weights, rates = gamma_rates(power, 2.0)
        wanted = (1 + 2 * t * np.expm1(1 / power)) ** -power
        assert np.allclose(np.exp(-np.outer(t, rates)) @ weights, wanted, atol=0.01)
    # E_½(−√s) = e^s erfc √s; four decades leave out a little at either end.
    weights, rates = fractional_rates(0.5, 2.0)
    assert np.allclose(np.exp(-np.outer(t, rates)) @ weights, erfcx(np.sqrt(2 * t)), atol=0.05)
    assert np.all(weights > 0) and weights.sum() == pytest.approx(1)


def test_rates_by_depth():
    motion = Path(1.6).hold(2.0).motion()
    for seed in (0, 1, 2):
        pad = Pad(Power(3.0, 0.0), (0.4,), (2.0,))
        fine, told, build = hidden("depth_dependent_relaxation", "knee", pad=pad, motion=motion, seed=seed)
        factor = 1 + told["slope"] * min(1.6, build.plant.numbers["rate_knee_mm"])
        rate = -np.diff(np.log(fine.at(np.array([0.5, 1.0])) / 4.8 - 0.6)) / 0.5
        assert rate[0] == pytest.approx(2.0 * factor, rel=1e-3)
    pad = Pad(Power(3.0, 0.0), (0.3, 0.3), (20.0, 0.5))
    fine, told, _ = hidden("depth_dependent_relaxation", "mode_by_mode", pad=pad, motion=motion)
    fast, slow = (nu * np.exp(w * told["slope"] * 1.6) for nu, w in ((20.0, 1.5), (0.5, 0.5)))
    t = fine.time_s[100:-1]
    assert np.allclose(fine.force_N[100:-1] / 4.8, 0.4 + 0.3 * np.exp(-fast * t) + 0.3 * np.exp(-slow * t), atol=2e-3)


def test_damping():
    for speed in (2.0, 20.0, 50.0):
        motion = Path(-0.5).to(1.9, speed).hold(0.1).to(0.5, speed).hold(0.1).motion()
        v = motion.velocity(np.arange(0, motion.duration_s, 1e-4))
        for shape in shapes_of("viscous_damping", "third"):
            fine, told, build = hidden("viscous_damping", shape, motion=motion)
            x, c, ref = fine.reported_mm, told["coefficient"], build.plant.numbers["damping_ref"]
            added = (fine.force_N - 3 * np.maximum(x, 0))[: len(v)]
            inside = x[: len(v)] > 0.3
            there, back = (np.median(added[inside & (np.abs(v - s * speed) < 1e-9)]) for s in (1, -1))
            if shape == "eyring":
                wanted = 20 * c * np.arcsinh(speed / ref) / np.arcsinh(20 / ref)
                assert [there, -back] == pytest.approx([wanted, wanted], rel=1e-3)
            else:
                assert (there - back) / 2 == pytest.approx(speed * c, rel=1e-3)
                assert (there + back) / (there - back) == pytest.approx(ref, rel=1e-2)
