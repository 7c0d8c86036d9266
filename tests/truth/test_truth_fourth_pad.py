"""The fourth shapes of the pad's own effects against closed forms."""

import numpy as np
import pytest

from .effects.fourth_pad import ClosedCells, Pins, Yeoh, consolidation_rates, log_normal_rates
from .laws import Power
from .motion import Path
from .pad import Pad
from .sets import shapes_of
from .test_truth_effects import cycles, hidden, numbers

pytestmark = pytest.mark.long


def test_a_film_bears_an_impulse():
    # c_1 = ½: quickly back by d after a long hold at 2 mm the force is 3 (1 − d) N, and then pulls.
    pad, impulse = Pad(Power(3.0, 0.0), (0.5,), (3.0,)), 0.02
    for pull in (0.3, 0.6):
        back = 1.0 - pull / 3
        motion = Path(0.0, np.inf).to(2.0, 100.0).hold(5.0).to(back, 1000.0).hold(0.4).motion()
        fine = numbers(motion, pad, stick_Ns=impulse)
        tension = np.where(fine.time_s > 5.0, np.maximum(-fine.force_N, 0.0), 0.0)
        # F = E − (E + P) e^{−3t} with E = 3 back/2: it fades as the pad relaxes, or lets go when its impulse is spent.
        held, end = np.sum(tension) * 1e-4, 1.5 * back
        whole = pull / 3 - end * np.log1p(pull / end) / 3
        assert tension.max() == pytest.approx(pull, rel=0.02)
        assert held == pytest.approx(min(impulse, whole), rel=0.03) and (whole < impulse) == (pull < 0.5)
    fine, told, build = hidden("separation", "grease_film", pad=pad, motion=motion)
    assert told == {} and build.believed.contact == "bonded"
    assert fine.force_N.min() < -0.3 and 0.003 * 6 <= build.plant.numbers["stick_Ns"] <= 0.008 * 6


def test_adhesion():
    motion = Path(-0.5).to(1.0, 2.0).hold(0.1).to(-0.5, 2.0).motion()
    for shape in shapes_of("adhesion", "fourth"):
        fine, told, _ = hidden("adhesion", shape, motion=motion)
        x, back = fine.reported_mm, fine.time_s > 0.8
        shares = np.array([0.075, 0.3, 0.6, 0.85])
        pulls = -np.interp(shares * told["range"], -x[back], fine.force_N[back]) / told["pull_off"]
        if shape == "fibrils":
            assert pulls == pytest.approx([0.5, 1.0, 1.0, 0.5], abs=0.02)
        else:
            # 21 at 2 mm/s, 101 at 10 mm/s.
            assert pulls == pytest.approx(np.sin(np.pi / 2 * shares) * (21 / 101) ** 0.15, abs=0.02)
        assert np.all(fine.force_N[~back & (x < 0)] == 0)
        assert np.all(fine.force_N[back & (x < -1.01 * told["range"])] == 0)
    quick, told, _ = hidden("adhesion", "by_rate", motion=Path(0.5, 1e5).to(-0.5, 10.0).motion())
    assert quick.force_N.min() == pytest.approx(-told["pull_off"], rel=0.02)


def test_laws():
    d = np.linspace(0, 2.0, 500)
    # Small strains: 3 A δ/H of a block; a straight line of gas and walls; one pin.
    assert Yeoh(2.0, 0.7, 0.3, 50.0).force(0.01) == pytest.approx(3 * 2.0 * 0.01 / 50, rel=1e-3)
    # λ = ½: I − 3 = ¼ + 4 − 3 = 5/4 and λ^{−2} − λ = 7/2.
    assert Yeoh(1.0, 0.4, 0.2, 4.0).force(2.0) == pytest.approx(3.5 * (1 - 0.5 + 0.2 * 25 / 16))
    assert ClosedCells(1.0, 0.5, 4.0).force(2.0) == pytest.approx(1.0 + 0.25)
    assert ClosedCells(1.0, 0.5, 4.0).force(3.0) == pytest.approx(3.0 + 0.375)
    slopes = np.gradient(Pins(1.5, 0.5).force(d), d)
    assert [np.interp(at, d, slopes) for at in (0.25, 0.75, 1.25)] == pytest.approx([1.5, 3.0, 4.5], rel=0.15)
    assert slopes[1] == pytest.approx(0.75, rel=0.1)  # rounded: half of the first
    for law in (Yeoh(1.0, 0.8, 0.6 * 0.64, 2.0 / 0.55), ClosedCells(1.0, 0.2, 2.4), Pins(1.0, 0.7)):
        assert np.all(np.diff(law.force(d)) > 0) and law.force(-1.0) == 0


def lost_below(fine):
    x, deepest = fine.reported_mm, np.maximum.accumulate(fine.reported_mm)
    virgin, below = deepest - x < 1e-9, (deepest - x > 1e-6) & (x > 0.05)
    assert np.allclose(fine.force_N[virgin & (x > 0)], 3 * x[virgin & (x > 0)], atol=1e-6)
    return x[below], deepest[below], 1 - fine.force_N[below] / (3 * x[below])


def test_softening():
    motion = cycles(1.0, 0.0, 1.6, 0.0, 2.0, 0.0)
    fine, told, _ = hidden("stress_softening", "linear", motion=motion)
    x, deepest, lost = lost_below(fine)
    assert np.allclose(lost, told["share"] * np.minimum((deepest - x) / (2 * told["depth"]), 1.0), atol=1e-6)
    for seed in range(3):
        fine, told, build = hidden("stress_softening", "simo", motion=motion, seed=seed)
        x, deepest, lost = lost_below(fine)
        most, length = (build.plant.numbers[k] for k in ("softening_share", "softening_mm"))
        whole = [1 + most * np.expm1(-depth / length) for depth in (x, deepest)]
        assert np.allclose(1 - lost, whole[1] / whole[0], atol=1e-6)
        at = max(2.0 - 2 * told["depth"], 0.4)
        last = deepest > 1.999999
        assert np.interp(-at, -x[last], lost[last]) == pytest.approx(told["share"], rel=1e-3)


def test_damage():
    motion = cycles(2.0, 0.0, 1.0, 0.0, 2.0)
    fine, told, build = hidden("damage", "power", 2.0, motion=motion)
    x, rate, limit = fine.reported_mm, told["rate"], build.plant.numbers["damage_limit"]
    way = np.cumsum(np.maximum(np.diff(x, prepend=x[0]), 0))
    assert np.allclose(fine.force_N[x > 0.1], (3 * x * (1 + way / limit) ** (-rate * limit))[x > 0.1], atol=1e-6)
    fine, told, build = hidden("damage", "beyond_threshold", 2.0, motion=motion)
    x, spared = fine.reported_mm, build.plant.numbers["damage_limit"]
    # A stroke to the greatest depth costs what was stated, by the mm; the one to 1 mm what lies below the threshold.
    cost = 2 * told["rate"] * np.array([1.0, max(1.0 - spared, 0.0) / (2.0 - spared), 1.0])
    kept = [fine.force_N[k] / (3 * x[k]) for k in (np.argmax(x), np.argmin(np.abs(fine.time_s - 1.0)), len(x) - 2)]
    assert 0.39 < spared < 1.01 and kept == pytest.approx(np.exp(-np.cumsum(cost)), rel=1e-3)


def test_rows_that_crush():
    fine, told, _ = hidden("permanent_set", "rows", 2.0, motion=cycles(1.0, 0.0, 2.0))
    sunk, x = fine.reported_mm - fine.force_N / 3.0, fine.reported_mm
    deep = (x > 0.5) & (np.maximum.accumulate(x) - x < 1e-9)
    x, sunk = x[deep], sunk[deep]
    # In steps about a straight line, which is touched in the middle of each row.
    off = sunk / told["set"] - x
    assert np.all(np.diff(sunk) > -1e-9) and np.max(np.abs(off)) < 2.0 / 8 / 2 and np.abs(np.mean(off)) < 0.02
    assert np.mean(np.diff(sunk) < 1e-9) == pytest.approx(0.5, abs=0.07)


def test_a_set_that_rebounds_in_air():
    path = Path(0.0).to(2.0, 50.0).hold(3.0).to(-0.5, 50.0).hold(40.0).to(1.0, 50.0).hold(0.5)
    fine, told, _ = hidden("permanent_set", "rebounds", 2.0, motion=path.motion())
    sunk = fine.reported_mm - fine.force_N / 3.0
    first, last = np.interp(3.0, fine.time_s, sunk), sunk[-2]
    assert (first + last) / 2 == pytest.approx(2.0 * told["set"], rel=0.02)
    assert 0.66 < last / first < 0.82 and np.interp(1.0, fine.time_s, sunk) == pytest.approx(first)


def test_spectra_of_relaxation():
    # Water leaves a layer: at first 1 − 4 √(x/π³) with x = ν t, later 8/π² e^{−x} alone.
    weights, rates = consolidation_rates(2.0)
    x = np.array([0.02, 0.05, 0.1, 0.2])
    left = np.exp(-np.outer(x / 2.0, rates)) @ weights
    assert np.allclose(left, 1 - 4 * np.sqrt(x / np.pi**3), atol=2e-3)
    assert np.exp(-rates * 1.0) @ weights == pytest.approx(8 / np.pi**2 * np.exp(-2.0), rel=1e-3)
    assert weights.sum() == pytest.approx(1.0) and np.all(weights > 0)
    for width in (0.6, 1.2):
        weights, rates = log_normal_rates(width, 3.0)
        logs = np.log(rates / 3.0)
        assert weights.sum() == pytest.approx(1.0) and weights @ logs == pytest.approx(0.0, abs=1e-9)
        assert np.sqrt(weights @ logs**2) == pytest.approx(width, rel=0.03)


@pytest.mark.parametrize("shape", shapes_of("missing_relaxation_mode", "fourth"))
def test_what_is_added_has_its_share(shape):
    pad = Pad(Power(3.0, 0.0), (0.3,), (50.0,))
    motion = Path(2.0).hold(100.0).motion()
    fine, told, build = hidden("missing_relaxation_mode", shape, pad=pad, motion=motion)
    assert fine.force_N[-2] / 6 == pytest.approx(1 - 0.3 - told["share"], abs=0.01)
    assert build.believed.rates == (50.0,) and sum(build.plant.pad.shares) == pytest.approx(0.3 + told["share"])
    # After one time constant of the rate stated between a quarter and a half of it is left.
    left = fine.at(1 / told["rate"] + 0.0) / 6 - (1 - 0.3 - told["share"]) - 0.3 * np.exp(-50.0 / told["rate"])
    assert 0.25 < left / told["share"] < 0.5


def test_rates_by_depth():
    for depth in (1.0, 1.6):
        motion = Path(depth).hold(2.0).motion()
        for seed in (0, 1, 2):
            for shape in shapes_of("depth_dependent_relaxation", "fourth"):
                pad = Pad(Power(3.0, 1.0), (0.4,), (2.0,))
                fine, told, _ = hidden("depth_dependent_relaxation", shape, pad=pad, motion=motion, seed=seed)
                s = told["slope"]
                # With F = 3 δ²/2 and 2 mm at most: s (2 mm) (δ/2)².
                factor = (1 + s * depth / 2) ** 2 if shape == "pores" else 1 + s * depth**2 / 2
                elastic = 1.5 * depth**2
                rate = -np.diff(np.log(fine.at(np.array([0.5, 1.0])) / elastic - 0.6)) / 0.5
                assert rate[0] == pytest.approx(2.0 * factor, rel=2e-3)


@pytest.mark.parametrize("shape", shapes_of("viscous_damping", "fourth"))
def test_damping(shape):
    # F = 3 δ²/2 with 2 mm at most: the middle is 1 mm and 1.5 N.
    pad = Pad(Power(3.0, 1.0))
    for speed in (5.0, 20.0):
        motion = Path(-0.5).to(1.9, speed).hold(0.1).to(0.5, speed).hold(0.1).motion()
        fine, told, _ = hidden("viscous_damping", shape, pad=pad, motion=motion)
        v, x = motion.velocity(fine.time_s), np.maximum(fine.reported_mm, 0)
        sliding = np.abs(np.abs(v) - speed) < 1e-9
        steady = sliding & np.roll(sliding, 3) & (x > 0.05)
        factor = np.sqrt(x) if shape == "kuwabara_kono" else x**2
        added = np.sign(v) * speed * told["coefficient"] * factor
        assert np.allclose(fine.force_N[steady], (1.5 * x**2 + added)[steady], atol=2e-4)
    motion = Path(-0.5).to(1.0, 50.0).to(-0.5, 100.0).motion()
    away, _, _ = hidden("viscous_damping", shape, 2.5, pad=pad, motion=motion)
    assert away.force_N.min() == 0
