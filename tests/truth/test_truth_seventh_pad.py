"""The seventh shapes of the pad's own effects against closed forms."""

import numpy as np
import pytest

from .effects.seventh_pad import Kondner, VanWyk, _by_stroke, pair_rates, permeability, sphere_rates
from .laws import Power
from .motion import Path
from .pad import Pad
from .sets import shapes_of
from .test_truth_effects import cycles, hidden

pytestmark = pytest.mark.long


def test_a_bond_that_heals():
    pad, borne = Pad(Power(3.0, 0.0), (0.5,), (3.0,)), []
    for hold in (0.2, 0.45, 8.0):
        motion = Path(-0.5).to(2.0, 50.0).hold(hold).to(-0.5, 10.0).hold(1.0).motion()
        fine, told, build = hidden("separation", "heals", pad=pad, motion=motion)
        borne.append((np.sum(fine.force_N > 0) * 1e-4, -fine.force_N.min() / (0.02 * 6)))
        assert fine.force_N[-1] == 0 and fine.force_N[10] == 0
    assert told == {} and build.believed.contact == "bonded"
    times, shares = np.array(borne).T
    # A step is 1 µm of 3 N/mm or so.
    assert shares[2] == pytest.approx(1.0, abs=0.03)
    assert shares[1] / shares[0] == pytest.approx(np.sqrt(times[1] / times[0]), rel=0.1)
    assert 1.0 <= build.plant.numbers["stick_s"] == pytest.approx(times[0] / shares[0] ** 2, rel=0.15)


def test_adhesion():
    motion = Path(-0.5).to(1.0, 2.0).hold(0.1).to(-0.5, 2.0).motion()
    for seed in range(3):
        fine, told, _ = hidden("adhesion", "dugdale", motion=motion, seed=seed)
        x, air = fine.reported_mm, fine.reported_mm < 0
        near = np.abs(-x[air] / told["range"] - 1) < 0.01
        wanted = -told["pull_off"] * (-x[air] < told["range"])  # on the way in as on the way out
        assert np.allclose(fine.force_N[air][~near], wanted[~near], atol=1e-9)
        held = (fine.time_s > 0.76) & (fine.time_s < 0.84)
        assert np.allclose(fine.force_N[held], 3.0 - told["pull_off"], atol=1e-3)
        fine, told, _ = hidden("adhesion", "suction", motion=motion, seed=seed)
        assert np.all(fine.force_N[(x < 0) & (fine.time_s < 0.2)] == 0) and fine.force_N[-1] == 0
        out = (x < 0) & (fine.time_s > 0.6)
        gap, pull = -x[out] / told["range"], -fine.force_N[out] / told["pull_off"]
        seals = gap < 0.995
        # Boyle: the share of the pressure that is lost is one less V_0 over V.
        assert np.allclose(pull[seals] / 1.3, 1 - 0.3 / (0.3 + gap[seals]), atol=1e-6)
        assert pull.max() == pytest.approx(1.0, abs=0.01) and np.all(pull[gap > 1.01] == 0)
        assert np.allclose(fine.force_N[held], 3.0, atol=1e-3)


def test_laws():
    fibres, soil = VanWyk(2.0, 4.0), Kondner(6.0, 1.5)
    for depth in (0.1, 1.0, 2.0):
        # Straight in one over the cube of what is left, and in one over the depth.
        assert (fibres.force(depth) / 2 + 1) ** (-1 / 3) == pytest.approx(1 - depth / 4)
        assert 1 / soil.force(depth) == pytest.approx(1 / 6 + 1.5 / 6 / depth)
    for law in (fibres, soil):
        assert law.force(-1.0) == 0 and np.all(np.diff(law.force(np.linspace(0, 2.4, 500))) > 0)
    _, told, build = hidden("elastic_law", "van_wyk")
    assert told["law"] == "van_wyk" and isinstance(build.plant.pad.law, VanWyk)
    assert build.plant.pad.law.force(2.0) == pytest.approx(6.0) and build.believed.law.name in ("power", "exponential")


def test_fillers_that_come_off_beyond_a_strain():
    fine, told, _ = hidden("stress_softening", "debonding", motion=cycles(0.15, 0.0, 1.0, 0.0, 1.5, 0.0, 2.0, 0.0))
    x, deepest = fine.reported_mm, np.maximum.accumulate(fine.reported_mm)
    some = (deepest - x > 0.05) & (x > 0.05)
    lost = (1 - fine.force_N[some] / (3 * x[some])) / -np.expm1(-(deepest - x)[some] / told["depth"])
    levels = [np.median(lost[np.abs(deepest[some] - d) < 1e-6]) for d in (0.15, 1.0, 1.5, 2.0)]
    spreads = [np.ptp(lost[np.abs(deepest[some] - d) < 1e-6]) for d in (0.15, 1.0, 1.5, 2.0)]
    assert max(spreads) < 1e-3 and levels[0] == pytest.approx(0, abs=1e-6)
    assert levels[3] == pytest.approx(told["share"], rel=1e-3)
    assert (levels[3] - levels[2]) == pytest.approx(levels[2] - levels[1], rel=1e-3)
    begins = 2.0 - levels[3] / (levels[3] - levels[2]) * 0.5
    assert 0.2 <= begins <= 0.6


def test_softening_on_two_paths():
    fine, told, _ = hidden("stress_softening", "two_paths", motion=cycles(2.0, 0.3, 2.0, 0.3))
    x, v = fine.reported_mm, np.gradient(fine.reported_mm, 1e-4)
    inside = (x > 0.45) & (x < 1.85)
    lost = np.zeros_like(x)
    lost[inside] = (1 - fine.force_N / 3 / np.maximum(x, 0.1))[inside] / -np.expm1(-(2.0 - x)[inside] / told["depth"])
    lost /= told["share"]
    out, back = inside & (v < -1), inside & (v > 1) & (fine.time_s > 0.5)
    assert np.allclose(lost[out], 1.0, atol=1e-6) and np.ptp(lost[back]) < 1e-6
    assert 0.55 <= lost[back][0] <= 0.75 and np.allclose(lost[inside & (fine.time_s < 0.38)], 0, atol=1e-6)


def test_damage_layer_by_layer():
    # Five times down to half of the depth, then all the way: what lies below is still whole.
    motion = cycles(*([1.0, 0.0] * 5), 2.0, 0.0, 2.0, speed=50.0)
    fine, told, _ = hidden("damage", "layers", 2.5, motion=motion)
    x, rate = fine.reported_mm, told["rate"]
    last = np.flatnonzero((x > 0.2) & (np.gradient(x) < 0))
    last = last[fine.time_s[last] > motion.duration_s - 0.1]
    slopes = np.diff(fine.force_N[last]) / np.diff(x[last]) / 3
    middle = (x[last][1:] + x[last][:-1]) / 2
    # Each layer but those the ends of which differ: e^{−2 r n}, n of 6 above and 1 below.
    upper, lower = middle < 0.94, (middle > 1.06) & (middle < 1.94)
    assert np.median(slopes[upper]) == pytest.approx(np.exp(-2 * rate * 6), rel=1e-3)
    assert np.median(slopes[lower]) == pytest.approx(np.exp(-2 * rate * 1), rel=1e-3)
    fine, told, _ = hidden("damage", "layers", 1.0, motion=cycles(*([2.0, 0.0] * 8), speed=50.0))
    ends = fine.force_N[: 16 * (len(fine.force_N) // 16)].reshape(8, -1).max(axis=1) / 6
    assert np.allclose(ends, np.exp(-told["rate"] * 2.0 * np.arange(1, 9)), rtol=2e-3)


def test_damage_by_stroke():
    x = np.interp(np.arange(401), [0, 100, 150, 200, 300, 400], [-0.5, 1.0, 0.5, 1.5, 0.0, 2.0])
    total = _by_stroke(x, 2.0, 2.0)
    # 1 mm, 1 mm and one that has not ended; each costs 2 (range/2)².
    assert total[100] == 0 and total[101] == pytest.approx(0.5) and total[199] == pytest.approx(0.5)
    assert total[-1] == pytest.approx(1.0)
    powers = []
    for depth in (0.5, 1.0, 2.0):
        fine, told, _ = hidden("damage", "by_stroke", motion=cycles(*([depth, 0.0] * 6), depth))
        powers.append(-np.log(fine.force_N[-2] / (3 * fine.reported_mm[-2])) / 6 / told["rate"])
    assert powers[2] == pytest.approx(2.0, rel=1e-3) and powers[2] / powers[1] == pytest.approx(powers[1] / powers[0])
    assert 1.5 <= np.log2(powers[2] / powers[1]) <= 2.5


def test_slow_presses_leave_more():
    sets, speeds = [], np.array([2.0, 20.0, 200.0])
    for speed in speeds:
        motion = Path(0.0, np.inf).to(2.0, speed).to(1.0, speed).hold(0.1).motion()
        fine, told, _ = hidden("permanent_set", "slow_presses", motion=motion)
        sets.append((1.0 - fine.force_N[-1] / 3) / 2.0 / told["set"])
    assert sets[1] == pytest.approx(1.0, rel=5e-3) and sets[0] / sets[1] == pytest.approx(sets[1] / sets[2], rel=0.01)
    assert 0.1 <= np.log10(sets[0] / sets[1]) <= 0.25


def test_set_that_shakes_down():
    path = Path(0.0, np.inf)
    for _ in range(16):
        path.to(2.0, 20.0).hold(0.4).to(0.0, 20.0).hold(0.1)
    motion = path.motion()
    fine, told, _ = hidden("permanent_set", "shakes_down", motion=motion)
    ends = motion.duration_s / 16 * np.arange(16) + 0.49
    missing = 1 - (2.0 - fine.at(ends) / 3) / 2.0 / told["set"]
    assert 0.3 <= missing[0] <= 0.5
    folds = -1 / np.diff(np.log(missing[:8]))
    assert np.allclose(folds, folds[0], rtol=0.02) and 1.45 <= folds[0] <= 3.05 and missing[-1] < 0.01


def test_spectra_of_relaxation():
    t = np.geomspace(0.01, 4.0, 60)
    weights, rates = sphere_rates(2.0)
    n = np.arange(1, 2000)
    exact = np.array([np.sum(6 / (np.pi * n) ** 2 * np.exp(-2.0 * s * n**2)) for s in t])
    assert weights.sum() == pytest.approx(1.0) and rates[0] == 2.0
    assert np.max(np.abs(np.exp(-np.outer(t, rates)) @ weights - exact)) < 0.04
    weights, rates = pair_rates(2.0)
    assert weights.sum() == pytest.approx(1.0) and np.exp(-rates / 2.0) @ weights == pytest.approx(np.exp(-1.0))
    # The root of it is a sum of exponentials again, of rates 1, 9, 25 and 49.
    root = np.sqrt(np.exp(-np.outer(t, rates)) @ weights)
    parts = np.exp(-np.outer(t, rates.min() / 2 * np.array([1.0, 9.0, 25.0, 49.0])))
    best, left, *_ = np.linalg.lstsq(parts, root, rcond=None)
    assert left[0] < 1e-12 and best / best[0] == pytest.approx(1 / np.array([1.0, 9.0, 25.0, 49.0]), rel=1e-3)


@pytest.mark.parametrize("shape", shapes_of("missing_relaxation_mode", "seventh"))
def test_what_is_added_has_its_share(shape):
    pad = Pad(Power(3.0, 0.0), (0.3,), (50.0,))
    fine, told, build = hidden("missing_relaxation_mode", shape, pad=pad, motion=Path(2.0).hold(60.0).motion())
    assert fine.force_N[-2] / 6 == pytest.approx(1 - 0.3 - told["share"], abs=0.01)
    assert build.believed.rates == (50.0,) and sum(build.plant.pad.shares) == pytest.approx(0.3 + told["share"])
    left = fine.at(1 / told["rate"] + 0.0) / 6 - (1 - 0.3 - told["share"]) - 0.3 * np.exp(-50.0 / told["rate"])
    # By the slowest of the sphere there is less left than 1/e, by what was quicker.
    wanted = np.exp(-1.0) if shape == "double_reptation" else 6 / np.pi**2 * (np.exp(-1.0) + np.exp(-4.0) / 4)
    assert left / told["share"] == pytest.approx(wanted, abs=0.02)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("shape", shapes_of("depth_dependent_relaxation", "seventh"))
def test_rates_by_depth(shape, seed):
    depths, rates = np.array([0.05, 0.5, 1.0, 1.5, 2.0]), []
    for depth in depths:
        pad = Pad(Power(3.0, 1.0), (0.4,), (2.0,))
        motion = Path(depth).hold(1.5).motion()
        fine, told, _ = hidden("depth_dependent_relaxation", shape, pad=pad, motion=motion, seed=seed)
        rates.append(-np.diff(np.log(fine.at(np.array([0.2, 0.7])) / (1.5 * depth**2) - 0.6))[0] / 0.5 / 2.0)
    assert rates[-1] == pytest.approx(1 + 2 * told["slope"], rel=2e-3)
    if shape == "zhurkov":
        # ln ν goes with the load, 1.5 δ².
        assert np.allclose(np.log(rates) / np.log(rates[-1]), depths**2 / 4, atol=5e-3) and told["slope"] > 0
        return
    # One porosity, and strains in proportion to the depth, explain all of them.
    tries = [
        np.max(np.abs(np.array(rates) - permeability(strain * depths / 2, porosity)))
        for porosity in np.linspace(0.58, 0.88, 61)
        for strain in np.linspace(0.01, 0.3, 291)
    ]
    assert min(tries) < 3e-3 and told["slope"] < 0 and permeability(0.0, 0.7) == pytest.approx(1.0)
    assert permeability(0.2, 0.7) == pytest.approx((0.625**3 / 0.375**2) / (0.7**3 / 0.3**2))


@pytest.mark.parametrize("shape", shapes_of("viscous_damping", "seventh"))
def test_damping(shape):
    speeds, parts = np.array([2.0, 5.0, 20.0, 40.0, 80.0]), []
    for speed in speeds:
        motion = Path(-0.5).to(1.9, speed).hold(0.1).to(0.5, speed).hold(0.1).motion()
        fine, told, build = hidden("viscous_damping", shape, motion=motion)
        v, x = motion.velocity(fine.time_s), np.maximum(fine.reported_mm, 0)
        sliding = np.abs(np.abs(v) - speed) < 1e-9
        steady = sliding & np.roll(sliding, 3) & (x > 0.05) & (fine.force_N > 0)
        added = (fine.force_N - 3 * x)[steady] * np.sign(v[steady]) / speed / told["coefficient"]
        assert np.ptp(added) < 1e-2 and steady.sum() > 20
        parts.append(np.median(added))
    parts = np.array(parts)
    assert parts[2] == pytest.approx(1.0, rel=2e-3)
    if shape == "blow_off":
        # A quarter of the slope between any two beyond the valve.
        force = parts * speeds
        slopes = np.diff(force)[2:] / np.diff(speeds)[2:]
        assert np.allclose(slopes, parts[0] / 4, rtol=2e-3) and parts[1] == pytest.approx(parts[0], rel=2e-3)
    else:
        # (c_0 v/F)^{10/3} is straight in v².
        bent = parts ** (-10 / 3)
        slope, start = np.polyfit(speeds**2, bent, 1)
        assert np.allclose(start + slope * speeds**2, bent, rtol=2e-2) and 4 <= np.sqrt(start / slope) <= 15
    away, _, _ = hidden("viscous_damping", shape, 2.5, motion=Path(-0.5).to(1.0, 50.0).to(-0.5, 100.0).motion())
    assert away.force_N.min() == 0
