"""The eighth shapes of the pad's own effects against closed forms."""

from dataclasses import replace

import numpy as np
import pytest

from .effects.eighth_pad import HyperFoam, Laminate, _short_of, _unrelaxed, havriliak_negami
from .effects.plant import simulate as plant_steps
from .laws import Power
from .motion import Path
from .pad import Pad, simulate
from .sets import shapes_of
from .test_truth_effects import cycles, hidden

pytestmark = pytest.mark.long

SOFT = Pad(Power(3.0, 0.0), (0.5,), (3.0,))


def test_a_part_is_glued():
    motion = Path(-0.5).to(2.0, 50.0).hold(4.0).to(-0.5, 50.0).hold(2.0).motion()
    fine, told, build = hidden("separation", "partly", pad=SOFT, motion=motion)
    assert told == {} and build.believed.contact == "bonded"
    t = np.arange(0.0, motion.duration_s, 3e-3)
    free, held = (
        simulate(Pad(SOFT.law, SOFT.shares, SOFT.rates, kind), motion, t) for kind in ("unilateral", "bonded")
    )
    assert np.allclose(fine.at(t), 0.95 * free.force_N + 0.05 * held.force_N, atol=2e-4)
    # What it remembers of 6 N is half of it, and fades by 3/s from where it is let go.
    last = fine.time_s > motion.duration_s - 1.9
    out = fine.time_s[last] - (motion.duration_s - 2.0)
    faded = -fine.force_N[last] / (0.05 * 0.5 * 6 * np.exp(-3.0 * out))
    assert np.ptp(faded) < 1e-6 and 0.85 < faded[0] < 1.0


@pytest.mark.parametrize("pad", [Pad(Power(3.0, 0.0)), SOFT])
def test_a_neck_that_fouls(pad):
    path = Path(-0.5)
    for _ in range(5):
        path.to(1.0, 20.0).hold(0.3).to(-0.5, 2.0).hold(0.3)
    motion, t = path.motion(), np.arange(0.0, 9.0, 1e-3)
    for seed in range(2):
        fine, told, _ = hidden("adhesion", "fouls", pad=pad, motion=motion, seed=seed)
        plain = simulate(pad, motion, t)
        touch = np.minimum((t / motion.duration_s * 5).astype(int), 4)
        # The surface comes back by itself, so that the gap is less than the way from where it let go.
        surface = np.where(plain.let_go, plain.elastic_N / 3, 0.0)
        gap = surface - motion.position(t)
        out = (motion.velocity(t) < 0) & (gap > 0.02 * told["range"]) & (plain.force_N < 1e-9)
        pull, share = -fine.at(t) / told["pull_off"], gap / told["range"]
        near = out & (share < 0.98)
        bears = pull[near] / np.sin(np.pi / 2 * share[near])
        by_touch = np.array([np.median(bears[touch[near] == k]) for k in range(5)])
        assert by_touch[0] == pytest.approx(1.0, rel=2e-3) and 0.8 <= by_touch[1] <= 0.92
        assert by_touch == pytest.approx(by_touch[1] ** np.arange(5.0), rel=2e-3)
        assert np.allclose(bears, by_touch[touch[near]], rtol=0.03)
        assert np.all(pull[out & (share > 1.02)] == 0) and np.all(pull[(t > 0) & (t < 0.025)] == 0)
        assert np.allclose(fine.at(t)[plain.force_N > 0.01], plain.force_N[plain.force_N > 0.01], atol=1e-3)


def test_a_thread_that_thins():
    times = []
    for seed in range(3):
        for speed in (1.0, 5.0):
            motion = Path(-0.5, np.inf).to(1.0, 20.0).hold(0.1).to(-0.5, speed).motion()
            fine, told, _ = hidden("adhesion", "thread", motion=motion, seed=seed)
            out = (fine.reported_mm < 0) & (fine.time_s > 0.1)
            gap, pull = -fine.reported_mm[out], -fine.force_N[out] / told["pull_off"]
            drawn = (gap > 0.05 * told["range"]) & (gap < 0.98 * told["range"])
            # The time is the gap over the speed, to within a step.
            thinned = -np.log(pull[drawn] / -np.expm1(-10 * gap[drawn] / told["range"]))
            slope, start = np.polyfit(gap[drawn] / speed, thinned, 1)
            assert abs(start) < 0.03 and np.all(pull[gap > 1.02 * told["range"]] == 0)
            times.append(1 / slope)
    assert times[::2] == pytest.approx(times[1::2], rel=1e-3) and np.ptp(times) > 1e-3
    assert min(times) >= 0.005 and max(times) <= 0.02


@pytest.mark.parametrize(("id", "shape"), [("adhesion", "thread"), ("separation", "partly")])
def test_what_asks_for_the_plant_again_is_not_asked_for_ever(id, shape):
    motion = Path(-0.5).to(1.0, 20.0).hold(0.1).to(-0.5, 5.0).motion()
    fine, _, build = hidden(id, shape, pad=SOFT, motion=motion)
    asked = []

    def looks(t, x):
        asked.append(plant_steps(replace(build.plant, play=[])).cell_N)
        return x

    build.plant.play.append(looks)
    again = plant_steps(build.plant)
    assert np.array_equal(again.cell_N, fine.cell_N) and again.cell_N.min() < -1e-3
    # Asked from outside it has the force, asked by the force itself it has not.
    assert any(np.array_equal(force, fine.cell_N) for force in asked) and len(asked) <= 5


def test_laws():
    foam, layers = HyperFoam(2.0, 9.0, 4.0), Laminate(2.0, 6.0, 1.5)
    assert foam.force(2.0) == pytest.approx(2 * (2 - 0.5**8)) and foam.force(3.0) == pytest.approx(2 * (4 - 0.25**8))
    assert foam.force(1e-6) / 1e-6 == pytest.approx(2 * 9 / 4, rel=1e-4)
    for depth in (0.1, 1.0, 2.0, 4.0):
        f = layers.force(depth) / 2
        assert 1.5 * f / (1 + f) + 1.5 * f / 6 == pytest.approx(depth)
    # Two springs in series at first, the firm one alone at last.
    assert layers.force(1e-6) / 1e-6 == pytest.approx(1 / (1.5 / 2 + 1.5 / 12), rel=1e-4)
    assert layers.force(101.0) - layers.force(100.0) == pytest.approx(8.0, rel=1e-3)
    for law in (foam, layers):
        assert law.force(-1.0) == 0 and np.all(np.diff(law.force(np.linspace(0, 3.0, 500))) > 0)
    for shape, kind in (("hyperfoam", HyperFoam), ("laminate", Laminate)):
        _, told, build = hidden("elastic_law", shape)
        assert told["law"] == shape and isinstance(build.plant.pad.law, kind)
        assert build.plant.pad.law.force(2.0) == pytest.approx(6.0)
        assert build.believed.law.name in ("power", "exponential")


def test_softening_by_force():
    pad = Pad(Power(3.0, 1.0))  # 1.5 δ²
    fine, told, _ = hidden("stress_softening", "by_force", pad=pad, motion=cycles(1.2, 0.0, 1.6, 0.3, 2.0, 0.0))
    x, deepest = fine.reported_mm, np.maximum.accumulate(fine.reported_mm)
    inside = x > 0.05
    last = 1.5 * (4 - (2 - min(told["depth"], 1.6)) ** 2)
    lost = (1 - fine.force_N[inside] / (1.5 * x[inside] ** 2)) / told["share"]
    assert np.allclose(lost, -np.expm1(-1.5 * (deepest**2 - x**2)[inside] / last), atol=1e-5) and lost.max() > 0.6


def test_softening_that_ends_late():
    way = _short_of(np.array([0.0, 1.0, 0.9, 0.8, 0.5, 1.05, 1.1, 1.15, 1.0]), 0.1, 0.2)
    # Half of the way back at 0.9, all of it from 0.8 on; met again at 1.1, and anew from 1.15.
    assert np.allclose(way, [0, 0, 0.15, 0.3, 0.6, 0.05, 0.0, 0.0, 0.15 + 0.115 * 0.75])
    fine, told, _ = hidden("stress_softening", "rejoins_late", motion=cycles(1.5, 0.0, 2.0))
    x, again = fine.reported_mm, (fine.time_s > 0.61) & (fine.reported_mm > 0.1)
    kept = fine.force_N[again] / (3 * x[again])
    met = x[again][kept > 1 - 1e-9][0]
    assert 1.5 * 1.05 <= met <= 1.5 * 1.12
    wanted = 1 + told["share"] * np.expm1(-np.maximum(met - x[again], 0.0) / told["depth"])
    assert np.allclose(kept, wanted, atol=2e-4) and np.all(kept[x[again] > met] == pytest.approx(1.0))
    first = (fine.time_s < 0.3) & (x > 0.01)
    assert np.allclose(fine.force_N[first], 3 * x[first])


def test_damage_that_incubates():
    motion = cycles(*([2.0, 0.2] * 8), speed=50.0)
    for seed in range(2):
        fine, told, _ = hidden("damage", "incubates", 2.5, motion=motion, seed=seed)
        x = fine.reported_mm
        way, inside = np.cumsum(np.maximum(np.diff(x, prepend=0.0), 0)), x > 0.1
        lost = -np.log(fine.force_N[inside] / (3 * x[inside]))
        path, index = np.unique(np.round(way[inside], 6), return_index=True)
        slopes = np.diff(lost[index]) / np.diff(path) / told["rate"]
        missing, middle = 1 - slopes, (path[1:] + path[:-1]) / 2
        some = (missing > 0.05) & (np.diff(path) > 1e-3)
        slope, start = np.polyfit(middle[some], np.log(missing[some]), 1)
        # Nothing at first, all of the rate in the end.
        assert start == pytest.approx(0.0, abs=0.01) and 1.4 <= -1 / slope <= 4.0 and abs(slopes[-1] - 1) < 0.04
        assert np.allclose(np.log(missing[some]), start + slope * middle[some], atol=0.02)


def test_damage_by_the_way_in_and_out():
    motion = Path(-0.5, np.inf).to(2.0, 20.0).to(0.4, 20.0).to(1.0, 20.0).to(-0.5, 20.0).to(1.5, 20.0).motion()
    fine, told, _ = hidden("damage", "either_way", motion=motion)
    x = fine.reported_mm
    way = np.cumsum(np.abs(np.diff(np.maximum(x, 0.0), prepend=0.0)))
    inside = x > 0.05
    assert np.allclose(-np.log(fine.force_N[inside] / (3 * x[inside])) / told["rate"], way[inside] / 2)
    assert way[-2] == pytest.approx(2.0 + 1.6 + 0.6 + 1.0 + 1.5, abs=1e-2)


def test_set_by_the_logarithm_of_the_load():
    depths = np.array([0.1, 0.3, 0.8, 1.4, 2.0])
    for seed in range(3):
        sunk = []
        for depth in depths:
            motion = Path(0.0, np.inf).to(depth, 20.0).to(0.9 * depth, 20.0).hold(0.1).motion()
            fine, told, _ = hidden("permanent_set", "log_load", motion=motion, seed=seed)
            sunk.append((0.9 * depth - fine.force_N[-1] / 3) / (2.0 * told["set"]))
        parts = np.linspace(0.04, 0.1, 601)
        curves = np.log1p(depths / 2 / parts[:, None]) / np.log1p(1 / parts[:, None])
        assert sunk[-1] == pytest.approx(1.0, abs=1e-3) and np.min(np.max(np.abs(curves - sunk), axis=1)) < 2e-3


def test_a_core_that_crushes_once():
    for seed in range(3):
        fine, told, _ = hidden("permanent_set", "core_crushes", motion=cycles(2.0, 0.5, 2.0), seed=seed)
        x = fine.reported_mm
        sunk = (x - fine.force_N / 3) / told["set"]
        first = (fine.time_s < 0.4) & (x > 0.01)
        going = first & (sunk > 0.05) & (sunk < 1.95)
        slope, start = np.polyfit(x[going], sunk[going], 1)
        begins, ends = -start / slope, (2.0 - start) / slope
        assert 0.7 <= begins <= 1.3 and (ends - begins) / 2 == pytest.approx(0.07 + told["set"], rel=1e-3)
        assert np.allclose(sunk[first], np.interp(x[first], [begins, ends], [0.0, 2.0]), atol=2e-3)
        assert np.allclose(sunk[fine.time_s > 0.41], 2.0, atol=2e-3)


def test_the_spectrum_of_havriliak_and_negami():
    for alpha, beta in ((0.75, 0.4), (0.9, 0.7), (0.8, 0.5)):
        weights, rates = havriliak_negami(2.0, alpha, beta)
        assert weights.sum() == pytest.approx(1.0) and weights @ np.exp(-rates / 2.0) == pytest.approx(np.exp(-1.0))
        assert np.all(np.diff(rates) > 0) and np.all(weights > 0)
        # The sixth is at y = 1.
        omega = rates[5] * np.geomspace(0.03, 30.0, 40)
        told = 1 / (1 + (1j * omega / rates[5]) ** alpha) ** beta
        made = (1 / (1 + 1j * omega[:, None] / rates)) @ weights
        assert np.max(np.abs(made - told)) < 0.02


@pytest.mark.parametrize("shape", shapes_of("missing_relaxation_mode", "eighth"))
def test_what_is_added_has_its_share(shape):
    pad = Pad(Power(3.0, 0.0), (0.3,), (50.0,))
    for seed in range(2):
        motion = Path(2.0).hold(60.0).motion()
        fine, told, build = hidden("missing_relaxation_mode", shape, pad=pad, motion=motion, seed=seed)
        rest = 1 - 0.3 - told["share"]
        assert build.believed.rates == (50.0,) and sum(build.plant.pad.shares) == pytest.approx(0.3 + told["share"])
        t = np.array([0.5, 1.0, 2.0]) / told["rate"]
        left = (fine.at(t) / 6 - rest - 0.3 * np.exp(-50.0 * t)) / told["share"]
        if shape == "havriliak_negami":
            assert left[1] == pytest.approx(np.exp(-1.0), abs=0.02) and left[0] < np.exp(-0.5)
        else:
            slow, quick = np.sort(build.plant.pad.rates[1:])
            assert slow * quick == pytest.approx(told["rate"] ** 2) and 10 <= quick / slow <= 30
            first = (left[1] - np.exp(-slow * t[1])) / (np.exp(-quick * t[1]) - np.exp(-slow * t[1]))
            assert 0.39 <= first <= 0.61
            assert left == pytest.approx(first * np.exp(-quick * t) + (1 - first) * np.exp(-slow * t), abs=5e-3)


@pytest.mark.parametrize("seed", range(3))
def test_rates_by_the_strain_of_the_contact(seed):
    depths, rates = np.array([0.02, 0.5, 1.0, 1.5, 2.0]), []
    for depth in depths:
        pad = Pad(Power(3.0, 0.0), (0.4,), (2.0,))
        motion = Path(depth).hold(1.5).motion()
        fine, told, _ = hidden("depth_dependent_relaxation", "contact_strain", pad=pad, motion=motion, seed=seed)
        rates.append(-np.diff(np.log(fine.at(np.array([0.2, 0.7])) / (3 * depth) - 0.6))[0] / 0.5 / 2.0)
    assert rates == pytest.approx(1 + told["slope"] * np.sqrt(2.0 * depths), abs=2e-3)
    assert rates[-1] - 1 == pytest.approx(2.0 * told["slope"], rel=1e-2)


@pytest.mark.parametrize("seed", range(3))
def test_rates_that_lag_behind(seed):
    pad = Pad(Power(3.0, 0.0), (0.4,), (0.5,))
    motion = Path(0.0, np.inf).to(1.5, 1e4).hold(9.0).motion()
    fine, told, _ = hidden("depth_dependent_relaxation", "lags_behind", pad=pad, motion=motion, seed=seed)
    t = np.array([0.1, 0.3, 0.6, 1.2, 6.0, 8.0])
    passed = -np.log((fine.at(t) / 4.5 - 0.6) / 0.4) / 0.5
    # ∫ 1 + s δ (1 − e^{−t/τ}): a straight line in the end, which is s δ τ late.
    slope = 1.5 * told["slope"]
    assert (passed[5] - passed[4]) / 2.0 == pytest.approx(1 + slope, abs=2e-3)
    tau = ((1 + slope) * t[5] - passed[5]) / slope
    assert 0.18 <= tau <= 1.02
    assert passed == pytest.approx(t + slope * (t + tau * np.expm1(-t / tau)), abs=8e-3)


def test_what_relaxes_is_made_up_for():
    c, nu, h = np.array([0.3, 0.2]), np.array([4.0, 0.4]), 1e-3
    wanted, inside = np.where(np.arange(3000) % 700 < 300, 1.0, -0.5), np.arange(3000) >= 100
    added = _unrelaxed(wanted, inside, h, c, nu)
    # Modes by small steps of the middle rule.
    z, force = np.zeros(2), np.zeros(3000)
    for k in range(1, 3000):
        middle = (added[k] + added[k - 1]) / 2
        z = z + h * nu * (middle - z) / (1 + h * nu / 2)
        force[k] = added[k] - c @ z
    assert np.allclose(force[100:], wanted[100:], atol=2e-3) and np.all(added[:100] == 0)


@pytest.mark.parametrize("shape", shapes_of("viscous_damping", "eighth"))
@pytest.mark.parametrize("pad", [Pad(Power(3.0, 0.0)), Pad(Power(3.0, 0.0), (0.3, 0.2), (8.0, 0.5), "bonded")])
def test_damping(shape, pad):
    speeds, parts = np.array([2.0, 5.0, 20.0, 80.0]), []
    for speed in speeds:
        motion = Path(-0.5, np.inf).to(1.9, speed).hold(0.2).to(0.7, speed).hold(0.1).motion()
        fine, told, _ = hidden("viscous_damping", shape, pad=pad, motion=motion)
        plain = simulate(pad, motion, fine.time_s).force_N
        v, x = motion.velocity(fine.time_s), fine.reported_mm
        # Away from the corners, where the speed of the last step is that of two.
        steady = (v == np.roll(v, 2)) & (v == np.roll(v, -2)) & (x > 0.3)
        added = (fine.force_N - plain)[steady] / told["coefficient"] * np.where(v == 0, 1.0, np.sign(v))[steady]
        rests = v[steady] == 0
        assert np.allclose(added[rests], 0, atol=0.05)
        moves, depth = added[~rests], x[steady][~rests]
        if shape == "log_rate":
            # In proportion to F^e; half the greatest depth is 1 mm.
            assert np.allclose(moves / depth, np.median(moves / depth), rtol=2e-3)
            parts.append(np.median(moves / depth) / 20.0)
        else:
            full = depth > 0.4 * 2 + 0.21
            assert np.allclose(moves[full], speed, rtol=2e-3) and np.allclose(moves[depth < 0.39], 0, atol=2e-3 * speed)
            grows = (moves > 0.05 * speed) & (moves < 0.95 * speed)
            slope, start = np.polyfit(depth[grows], moves[grows] / speed, 1)
            assert slope == pytest.approx(5.0, rel=0.01) and 0.39 <= -start / slope <= 0.81
    if shape == "log_rate":
        slow = np.linspace(3.0, 8.0, 1001)
        curves = np.log1p(speeds / slow[:, None]) / np.log1p(20.0 / slow[:, None])
        assert parts[2] == pytest.approx(1.0, rel=2e-3) and np.min(np.max(np.abs(curves - parts), axis=1)) < 5e-3
    away, _, _ = hidden("viscous_damping", shape, 2.5, motion=Path(-0.5).to(1.0, 50.0).to(-0.5, 100.0).motion())
    assert away.force_N.min() == 0
