"""The sixth shapes of the pad's own effects against closed forms."""

import numpy as np
import pytest

from .effects.sixth_pad import ArrudaBoyce, Toe, fitted_rates, gel, wedge_rates
from .laws import Power
from .motion import Path
from .pad import Pad
from .sets import shapes_of
from .test_truth_effects import cycles, hidden

pytestmark = pytest.mark.long


def test_tack_that_blooms():
    pad = Pad(Power(3.0, 0.0), (0.5,), (3.0,))
    path, ends = Path(-0.5), []
    for _ in range(4):
        path.to(2.0, 50.0).hold(3.0).to(-0.5, 10.0).hold(3.0)
        ends.append(path.motion().duration_s)
    fine, told, build = hidden("separation", "blooms", pad=pad, motion=path.motion())
    assert told == {} and build.believed.contact == "bonded"
    least = [fine.force_N[(fine.time_s > end - 3.3) & (fine.time_s < end)].min() for end in ends]
    # A step is 1 µm of 3 N/mm or so.
    assert least == pytest.approx(-0.005 * 6 * 1.1 ** np.arange(4.0), abs=3e-3)
    assert fine.force_N[-1] == 0


def test_bonds_as_deep_as_it_was_pressed():
    pulls, depths = [], np.array([0.3, 0.8, 1.3, 2.0])
    for depth in depths:
        # A deeper touch before this one leaves nothing behind.
        motion = Path(-0.5).to(1.6, 20.0).to(-0.5, 20.0).to(depth, 20.0).to(0.2, 20.0).to(-0.5, 2.0).motion()
        fine, told, build = hidden("adhesion", "by_depth", motion=motion)
        last = fine.time_s > motion.duration_s - 0.36
        pulls.append(-fine.force_N[last].min() / told["pull_off"])
        assert fine.force_N[-1] == 0
    whole = build.plant.numbers["adhesion_depth_mm"]
    assert 1.4 <= whole <= 2.0 and pulls == pytest.approx(np.minimum(depths / whole, 1.0), rel=5e-3)
    out = (fine.reported_mm < 0) & last
    gap = -fine.reported_mm[out] / told["range"]
    assert np.allclose(fine.force_N[out], -told["pull_off"] * np.sin(np.pi / 2 * gap) * (gap <= 1), atol=1e-3)


def test_strands_break_one_by_one():
    motion = Path(-0.5).to(1.0, 2.0).hold(0.1).to(-0.5, 2.0).motion()
    fine, told, _ = hidden("adhesion", "strands", motion=motion)
    x, out = fine.reported_mm, (fine.reported_mm < 0) & (fine.time_s > 0.6)
    gap = -x[out] / told["range"]
    bears = np.sum([gap * (gap < end) for end in (0.4, 0.6, 0.8, 1.0)], axis=0)
    near = np.min(np.abs(gap[:, None] - np.array([0.4, 0.6, 0.8, 1.0])), axis=1) < 0.01
    pull = -fine.force_N[out] / told["pull_off"]
    assert np.allclose(pull[~near], (bears / 1.8)[~near], atol=1e-6) and pull.max() == pytest.approx(1.0, abs=0.01)
    assert np.all(fine.force_N[(x < 0) & (fine.time_s < 0.25)] == 0)


def test_laws():
    law, locks = ArrudaBoyce(2.0, 1.4, 4.0), 1.4
    for depth in (0.2, 1.0, 2.0, 2.3):
        stretch = 1 - depth / 4
        used = np.sqrt((stretch**2 + 2 / stretch) / 3) / locks
        pull = 3 * used * law.force(depth) / (2 * (stretch**-2 - stretch))
        # Langevin's function of it is how far the chains are stretched.
        assert 1 / np.tanh(pull) - 1 / pull == pytest.approx(used, rel=0.03)
    assert ArrudaBoyce(2.0, 1e4, 4.0).force(2.0) == pytest.approx(2 * (4 - 0.5), rel=1e-6)
    toe = Toe(3.0, 0.4)
    assert toe.force(1e-3) == pytest.approx(3 * 1e-6 / 0.8, rel=1e-4)
    assert (toe.force(20.0) - toe.force(19.0)) == pytest.approx(3.0, rel=1e-3)
    assert toe.force(20.0) == pytest.approx(3 * (20 - 0.4), rel=1e-3)
    for other in (law, toe):
        assert other.force(-1.0) == 0 and np.all(np.diff(other.force(np.linspace(0, 2.4, 500))) > 0)


def test_softening_that_begins_gently():
    fine, told, _ = hidden("stress_softening", "gaussian", motion=cycles(1.0, 0.0, 1.6, 0.0, 2.0, 0.0))
    x, deepest = fine.reported_mm, np.maximum.accumulate(fine.reported_mm)
    virgin, below = (deepest - x < 1e-9) & (x > 0), (deepest - x > 0.02) & (x > 0.05)
    assert np.allclose(fine.force_N[virgin], 3 * x[virgin], atol=1e-6)
    lost = (1 - fine.force_N[below] / (3 * x[below])) / told["share"]
    some = lost < 0.999
    assert np.allclose(-np.log1p(-lost[some]), ((deepest - x)[below][some] / told["depth"]) ** 2, rtol=1e-3, atol=1e-4)


def test_softening_that_takes_some_cycles():
    path = Path(0.0, np.inf)
    for _ in range(8):
        path.to(2.0, 50.0).to(0.0, 50.0)
    motion = path.motion()
    fine, told, _ = hidden("stress_softening", "conditioning", motion=motion)
    back = motion.duration_s / 8 * np.arange(8) + 0.06  # at 1 mm on the way out
    lost = 1 - fine.at(back) / (3 * np.interp(back, fine.time_s, fine.reported_mm))
    whole = told["share"] * -np.expm1(-1.0 / told["depth"])
    assert np.allclose(lost / whole, 1 - 0.4 * np.exp(-np.arange(8) / 1.5), atol=2e-3)


def test_damage_of_two_kinds_of_bonds():
    motion = cycles(*([2.0, 0.2] * 20), speed=50.0)
    fine, told, _ = hidden("damage", "two_kinds", 2.5, motion=motion)
    x, rate = fine.reported_mm, told["rate"]
    way = np.cumsum(np.maximum(np.diff(x, prepend=0.0), 0))
    inside = x > 0.1
    kept = (fine.force_N[inside] / (3 * x[inside])).copy()
    weak = kept - 2 / 3 * np.exp(-rate * way[inside] / 2)
    assert np.allclose(weak, np.exp(-2 * rate * way[inside]) / 3, atol=1e-6)
    assert np.log(kept[0]) / way[inside][0] == pytest.approx(-rate, rel=0.01)


def test_damage_by_speed():
    costs, speeds = [], np.array([5.0, 20.0, 80.0])
    for speed in speeds:
        motion = Path(0.0, np.inf).to(2.0, speed).to(1.0, speed).hold(0.1).motion()
        fine, told, _ = hidden("damage", "by_speed", motion=motion)
        costs.append(-np.log(fine.force_N[-1] / 3.0) / 2.0 / told["rate"])
    assert costs[1] == pytest.approx(1.0, rel=2e-3)
    assert costs[2] / costs[1] == pytest.approx(costs[1] / costs[0], rel=2e-3)
    assert 0.149 < np.log(costs[2] / costs[1]) / np.log(4.0) < 0.301


def test_cold_flow():
    motion = Path(0.0, np.inf).to(2.0, 1000.0).hold(30.0).to(0.5, 1000.0).hold(10.0).to(2.0, 1000.0).hold(1.0).motion()
    fine, told, _ = hidden("permanent_set", "cold_flow", motion=motion)
    t = np.array([1.0, 3.0, 10.0, 29.0])
    grown = (2.0 - fine.at(t) / 3.0) / (2.0 * told["set"]) - 1
    per_fold = grown / np.log1p(t)
    assert np.allclose(per_fold, per_fold[0], rtol=2e-3) and 0.05 <= per_fold[0] <= 0.12
    # It does not go on where little presses.
    again = 2.0 - fine.at(np.array([40.01])) / 3.0
    assert again == pytest.approx(2.0 * told["set"] * (1 + per_fold[0] * np.log1p(30.0)), rel=1e-3)


def test_set_in_bursts():
    sizes = []
    for seed in range(6):
        fine, told, _ = hidden("permanent_set", "bursts", motion=cycles(2.0, 0.5, 2.0), seed=seed)
        x = np.maximum.accumulate(fine.reported_mm)
        first = (fine.reported_mm == x) & (x > 0.01)
        sunk, x = (fine.reported_mm - fine.force_N / 3)[first] / told["set"], x[first]
        assert sunk[-1] == pytest.approx(2.0, rel=1e-3) and np.all(np.diff(sunk) > -1e-6)
        rests = np.interp(0.1 * np.arange(1, 20) - 0.01, x, sunk)
        assert np.allclose(rests, np.interp(0.1 * np.arange(1, 20) - 0.06, x, sunk), atol=1e-6)
        sizes += list(np.diff(rests) / 0.1)
    # Exponential steps: the deviation is the mean.
    assert np.mean(sizes) == pytest.approx(1.0, abs=0.1) and np.std(sizes) == pytest.approx(1.0, abs=0.25)


def test_spectra_of_relaxation():
    curve = gel(2.0)
    s = np.array([0.0, 1e-4, 0.05, 1.0])
    unit = np.log(curve(1e-6)) / np.log(gel(1.0)(1e-6))
    assert curve(0.5) == pytest.approx(np.exp(-1.0)) and unit == pytest.approx(np.sqrt(2.0), rel=1e-2)
    assert (1 - curve(s[1])) / np.sqrt(s[1]) == pytest.approx(0.491 * 0.908 * np.sqrt(2.0 * 0.75), rel=0.03)
    weights, rates = fitted_rates(curve, 2.0)
    t = np.geomspace(0.003, 3.0, 50)
    assert np.max(np.abs(np.exp(-np.outer(t, rates)) @ weights - curve(t))) < 6e-3
    for decades in (1.0, 1.5):
        weights, rates = wedge_rates(2.0, decades)
        assert weights @ np.exp(-rates / 2.0) == pytest.approx(np.exp(-1.0)) and weights.sum() == pytest.approx(1.0)
        assert np.allclose(weights / weights[0], np.sqrt(rates / rates[0]))
        assert np.log10(rates[-1] / rates[0]) == pytest.approx(decades, abs=0.13)


@pytest.mark.parametrize("shape", shapes_of("missing_relaxation_mode", "sixth"))
def test_what_is_added_has_its_share(shape):
    pad = Pad(Power(3.0, 0.0), (0.3,), (50.0,))
    fine, told, build = hidden("missing_relaxation_mode", shape, pad=pad, motion=Path(2.0).hold(100.0).motion())
    assert fine.force_N[-2] / 6 == pytest.approx(1 - 0.3 - told["share"], abs=0.01)
    assert build.believed.rates == (50.0,) and sum(build.plant.pad.shares) == pytest.approx(0.3 + told["share"])
    left = fine.at(1 / told["rate"] + 0.0) / 6 - (1 - 0.3 - told["share"]) - 0.3 * np.exp(-50.0 / told["rate"])
    assert left / told["share"] == pytest.approx(np.exp(-1.0), abs=0.02)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("shape", shapes_of("depth_dependent_relaxation", "sixth"))
def test_rates_by_depth(shape, seed):
    depths, rates = np.array([0.05, 0.5, 1.0, 1.5, 2.0]), []
    for depth in depths:
        pad = Pad(Power(3.0, 0.0), (0.4,), (2.0,))
        motion = Path(depth).hold(1.5).motion()
        fine, told, _ = hidden("depth_dependent_relaxation", shape, pad=pad, motion=motion, seed=seed)
        rates.append(-np.diff(np.log(fine.at(np.array([0.2, 0.7])) / (3 * depth) - 0.6))[0] / 0.5 / 2.0)
    assert rates[-1] == pytest.approx(1 + 2 * told["slope"], rel=2e-3)
    # The time goes with the radius, or with the square of the thickness that is left.
    path = 1 / np.array(rates) if shape == "contact_radius" else 1 / np.sqrt(rates)
    slope, start = np.polyfit(depths, path, 1)
    assert start == pytest.approx(1.0, abs=2e-3) and np.allclose(start + slope * depths, path, atol=3e-3)
    assert slope > 0.05 if shape == "contact_radius" else slope < -0.02


@pytest.mark.parametrize("shape", shapes_of("viscous_damping", "sixth"))
def test_damping(shape):
    pad = Pad(Power(3.0, 1.0))  # 3 δ²/2, so that K is 3 δ
    for speed in (5.0, 20.0, 60.0):
        motion = Path(-0.5).to(1.9, speed).hold(0.1).to(0.5, speed).hold(0.1).motion()
        fine, told, _ = hidden("viscous_damping", shape, pad=pad, motion=motion)
        v, x = motion.velocity(fine.time_s), np.maximum(fine.reported_mm, 0)
        sliding = np.abs(np.abs(v) - speed) < 1e-9
        steady = sliding & np.roll(sliding, 3) & (x > 0.05)
        # Half the greatest depth is 1 mm.
        factor = x if shape == "with_stiffness" else speed / 20
        added = np.sign(v) * speed * told["coefficient"] * factor
        wanted = np.maximum(1.5 * x**2 + added, 0.0)  # nothing where it has let go
        assert np.allclose(fine.force_N[steady], wanted[steady], rtol=2e-3, atol=2e-4) and wanted[steady].max() > 3
    away, _, _ = hidden("viscous_damping", shape, 2.5, motion=Path(-0.5).to(1.0, 50.0).to(-0.5, 100.0).motion())
    assert away.force_N.min() == 0
