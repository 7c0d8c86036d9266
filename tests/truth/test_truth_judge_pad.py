"""The judge's shapes of the pad's elastic law, softening, damage and set, against closed forms and counts."""

import numpy as np
import pytest

from .effects.judge_pad import ConicalCoil, SwollenGel, _retarded, amplified, bed_kept
from .motion import Path
from .test_truth_effects import cycles, hidden


@pytest.mark.parametrize("narrow", [0.4, 0.6])
def test_a_conical_coil(narrow):
    law = ConicalCoil(2.0, narrow, 0.01, 1.5)
    # Turn by turn: each gives by the cube of its radius until it lies.
    turns = narrow + (1 - narrow) * (np.arange(20_000) + 0.5) / 20_000
    for load in (0.3, 0.9, 1.1, 2.0, 3.5, 0.9 / narrow**3, 1.5 / narrow**3):
        depth = 1.5 * (np.mean(np.minimum(load * turns**3, 1.0)) + 0.01 * load)
        assert law.force(depth) == pytest.approx(2 * load, rel=1e-4)
    assert law.force(-1.0) == 0 and np.all(np.diff(law.force(np.linspace(0, 4.0, 400))) > 0)


@pytest.mark.parametrize(("polymer", "chi"), [(0.08, 0.45), (0.15, 0.3), (0.2, 0.2)])
def test_a_swollen_gel(polymer, chi):
    law = SwollenGel(2.0, polymer, chi, 1.5)

    # Energy of the mixture and of chains over the height, for a network that is at rest as swollen.
    def energy(left, chains):
        solvent, p = left - polymer, polymer / left
        return solvent * np.log(1 - p) + chi * solvent * p + chains * left**2 / 2

    step, mixed = 1e-5, -(energy(1 + 1e-5, 0.0) - energy(1 - 1e-5, 0.0)) / 2e-5
    for depth in (0.05, 0.4, 0.8, 1.0):
        left = 1 - depth / 1.5
        wanted = -(energy(left + step, mixed) - energy(left - step, mixed)) / (2 * step)
        assert law.force(depth) == pytest.approx(2 * wanted, rel=1e-3, abs=1e-6)
    # Straight, and without a bend, from where a tenth is solvent.
    end = 1.5 * (1 - polymer / 0.9)
    slopes = np.diff(law.force(end + np.array([-1e-4, 0.0, 1e-4, 2.0, 3.0]))) / np.array([1e-4, 1e-4, 1.9999, 1.0])
    assert slopes == pytest.approx(np.full(4, slopes[-1]), rel=0.02) and slopes[2] == pytest.approx(slopes[3])


@pytest.mark.parametrize(("shape", "kind"), [("conical_coil", ConicalCoil), ("swollen_gel", SwollenGel)])
@pytest.mark.parametrize("seed", range(3))
def test_another_law(shape, kind, seed):
    _, told, build = hidden("elastic_law", shape, seed=seed)
    law = build.plant.pad.law
    assert told["law"] == shape and isinstance(law, kind) and law.force(2.0) == pytest.approx(6.0)
    assert build.believed.law.name in ("power", "exponential")
    depth = np.linspace(0.1, 2.0, 50)
    apart = np.sqrt(np.mean((law.force(depth) - build.believed.law.force(depth)) ** 2)) / 6
    assert 0.002 < apart < 0.1
    if shape == "conical_coil":
        # Straight until the widest turn lies down.
        first = float(law.depth(np.array(1.0)))
        assert law.force(first / 2) == pytest.approx(law.modulus / 2) and 0.2 < first < 1.5
        assert 0.49 < 6 / law.modulus * law.narrow**3 < 0.91
    else:
        assert 0.49 < law.polymer / (1 - 2.0 / law.height) < 0.76


def test_strain_of_what_is_soft():
    now, most = np.array([0.0, 0.3, 2.0, 4.0]), np.array([4.0, 4.0, 4.0, 4.0])
    fresh = amplified(now, most, 0.5)
    # d/√(1 + d) = c is d² = c² (1 + d).
    c = now / np.sqrt(5.0)
    assert fresh == pytest.approx((c**2 + c * np.sqrt(c**2 + 4)) / 2, abs=1e-9) and fresh[-1] == pytest.approx(4.0)
    assert amplified(now, most, 0.0) == pytest.approx(now, abs=1e-9)


def test_a_bed_under_a_ball():
    x = np.array([0.1, 0.4, 0.8, 1.0])
    for power in (0.5, 2.0):
        for part, kept in zip(x, bed_kept(x, power), strict=True):
            # Rings of equal area, each as deep as the ball is there: 1 − ring at most, and all by the same less.
            most = 1 - (np.arange(200_000) + 0.5) / 200_000
            inner = np.maximum(most - (1 - part), 0.0)
            assert kept == pytest.approx(np.sum(inner * (inner / most) ** power) / np.sum(inner), rel=1e-4)
    # With a power of 1 it is 1 − 2 q (x − q ln(1/q))/x², q = 1 − x.
    q = 1 - x[:-1]
    assert bed_kept(x[:-1], 1.0) == pytest.approx(1 - 2 * q * (x[:-1] + q * np.log(q)) / x[:-1] ** 2)


@pytest.mark.parametrize("shape", ["amplified_strain", "bed_of_fibres"])
@pytest.mark.parametrize("size", [1.0, 2.5])
@pytest.mark.parametrize("seed", range(3))
def test_softer_below_the_deepest(shape, size, seed):
    fine, told, _ = hidden("stress_softening", shape, size, motion=cycles(1.2, 0.0, 2.0, 0.0), seed=seed)
    x, most = fine.reported_mm, np.maximum.accumulate(fine.reported_mm)
    inside = x > 0.02
    kept, now, deep = fine.force_N[inside] / (3 * x[inside]), x[inside], most[inside]
    assert np.all(kept[now == deep] == pytest.approx(1.0)) and np.all(kept <= 1 + 1e-9)
    last = deep == deep.max()
    there = 2.0 * max(1 - told["depth"], 0.2)
    assert np.interp(there, now[last][::-1], kept[last][::-1]) == pytest.approx(1 - told["share"], abs=1e-3)
    worn = kept < 0.999
    if shape == "amplified_strain":
        # The inner strain is that of fresh rubber at kept · x: p is the same everywhere for the z that it has.
        fresh, errors = kept[worn] * now[worn], []
        for z in 2.0 * np.linspace(0.1, 0.25, 151):
            powers = np.log(kept[worn]) / np.log((1 + fresh / z) / (1 + deep[worn] / z))
            errors.append(np.ptp(powers) / np.median(powers))
        assert min(errors) < 5e-3 and errors[0] + errors[-1] > 4 * min(errors)
    else:
        # One curve of x/M, after 1.2 mm as after 2 mm: the outer fibres are as fresh as they were.
        grid = np.linspace(0.1, 0.95, 30)
        first, second = (
            np.interp(grid, *np.sort(np.stack([now / deep, kept])[:, worn & part]))
            for part in (np.abs(deep - 1.2) < 2e-3, last)
        )
        assert np.allclose(first, second, atol=2e-3) and np.all(np.diff(second) > 0)


@pytest.mark.parametrize("seed", range(3))
def test_bonds_that_break_under_load(seed):
    path = Path(0.0, np.inf)
    for depth in (0.5, 1.0, 1.5, 2.0):
        path.to(depth, 1e4).hold(1.0).to(0.0, 1e4).hold(1.0)
    fine, told, _ = hidden("damage", "under_load", motion=path.motion(), seed=seed)
    t, x = fine.time_s, fine.reported_mm
    left = np.array([fine.at(2.0 * k + 0.95) / fine.at(2.0 * k + 0.05) for k in range(4)])
    rates = -np.log(left) / 0.9
    # Twice as much force, and the rate is that of e^{2q} − 1: (e^q − 1)(e^q + 1), and so on.
    grown = np.exp(1.5 / 6 / np.linspace(0.2, 0.4, 2001))
    wanted = (grown[:, None] ** np.arange(1, 5) - 1) / (grown[:, None] ** 4 - 1)
    errors = np.max(np.abs(wanted / (rates / rates[-1]) - 1), axis=1)
    assert np.min(errors) < 1e-3 and errors[0] + errors[-1] > 0.1
    # 5 mm of way cost 5 r in all; nothing in air.
    assert -np.log(fine.at(6.98) / (3 * 2.0)) == pytest.approx(5 * told["rate"] - 0.02 * rates[-1], rel=1e-2)
    assert fine.at(2.05) / 3.0 == pytest.approx(np.exp(-rates[0] - 0.05 * rates[1]), rel=1e-4) and len(t) == len(x)


def test_a_crack_that_is_held_up():
    ramp = np.linspace(0.0, 1.0, 4001)
    back = ramp[::-1]
    # First the way itself; a crack that hardly grows then costs ∫ x^{2p} = 1/(1 + 2p), and half a stroke 2^{−1 − 2p}.
    held = _retarded(np.concatenate([2 * ramp, 2 * back, 2 * ramp, 2 * back, ramp, back]), 2.0, 1e-9, 1.25)
    assert held[4000] == pytest.approx(2.0) and np.allclose(held[:4001], 2 * ramp) and np.all(np.diff(held) >= 0)
    assert held[3 * 4001 - 1] - held[4000] == pytest.approx(2 / 3.5, rel=1e-3)
    assert held[-1] - held[4 * 4001 - 1] == pytest.approx(2 * 0.5**3.5 / 3.5, rel=1e-3)
    # Beyond 1 mm nothing deeper ever came before. And out of the zone it is as fast as without.
    again = _retarded(np.concatenate([ramp, back, 2 * ramp]), 2.0, 1e-9, 1.25)
    assert again[-1] == pytest.approx(1 + 1 / 3.5 + 1, rel=1e-3)
    strokes = np.tile(np.concatenate([ramp, back]), 120)
    whole = _retarded(np.concatenate([2 * ramp, 2 * back, strokes]), 2.0, 0.2, 1.0)
    steps = np.diff(whole[2 * 4001 - 1 :: 2 * 4001])
    # A quarter of the zone: 1/12 of the way at first, a third or some more in the end.
    assert steps[0] == pytest.approx(1 / 12, rel=0.02) and np.all(np.diff(steps[:20]) > 0)
    assert 1 / 3 < steps[-1] < 0.45 and steps[-1] == pytest.approx(steps[-2])


@pytest.mark.parametrize("seed", range(3))
def test_overloads(seed):
    motion = Path(0.0, np.inf).to(2.0, 40.0).to(0.0, 40.0).to(1.0, 40.0).to(0.0, 40.0).to(2.0, 40.0).motion()
    fine, told, _ = hidden("damage", "overloads", motion=motion, seed=seed)
    first, small, last = -np.log(fine.at(np.array([0.05, 0.125, 0.2 - 1e-4])) / np.array([6.0, 3.0, 5.988]))
    # 5 mm in all, of which the first two cost the most by the mm, and the shallow one the least.
    assert last == pytest.approx(5 * told["rate"], rel=0.01)
    assert first / 2 > 1.4 * told["rate"] and 0 < small - first < 0.35 * (last - small) and last - small < 0.7 * first


@pytest.mark.parametrize("seed", range(3))
def test_a_surface_that_wears(seed):
    motion = Path(0.0, np.inf).to(2.0, 20.0).hold(0.5).to(-0.5, 20.0).to(1.0, 5.0).to(0.5, 20.0).hold(0.1).motion()
    fine, told, _ = hidden("permanent_set", "wears", motion=motion, seed=seed)
    x, t = fine.reported_mm, fine.time_s
    sunk = (x - fine.force_N / 3) / told["set"]
    # Work of 3 N/mm: 6 N mm in and out again, 1.5 N mm for the later millimetre, and 1.125 N mm half the way back.
    whole = 6 + 6 + 1.5 + 1.125
    for at, work in ((0.05, 1.5), (0.59, 6.0), (0.65, 6 + 4.5), (0.925, 12.375), (1.025, 13.5), (1.1, whole)):
        assert np.interp(at, t, sunk) == pytest.approx(2 * work / whole, abs=5e-3)


@pytest.mark.parametrize("seed", range(3))
def test_a_pad_that_crystallizes(seed):
    motion = Path(0.0, np.inf).to(2.0, 1e4).hold(2.0).to(-0.5, 1e4).hold(1.0).to(1.0, 1e4).hold(4.0).motion()
    fine, told, _ = hidden("permanent_set", "crystallizes", motion=motion, seed=seed)
    sunk = (fine.reported_mm - fine.force_N / 3) / told["set"] / 2.0
    # 8 mm s in all, half of it in each of the two presses; which n and τ from two points, and the others of these.
    orders, parts = np.meshgrid(np.linspace(2.0, 3.0, 201), np.linspace(0.3, 0.6, 201))
    times, loads = np.array([0.5, 1.0, 1.5, 4.0, 5.0, 6.0]), np.array([1.0, 2.0, 3.0, 5.0, 6.0, 7.0]) / 8
    made = np.interp(times, fine.time_s, sunk)
    wanted = np.expm1(-((loads[:, None, None] / parts) ** orders)) / np.expm1(-((1 / parts) ** orders))
    assert np.min(np.max(np.abs(wanted - made[:, None, None]), axis=0)) < 5e-3
    # Late at first; nothing more in air; all of it in the end.
    assert 3 < made[1] / made[0] < 8.1 and sunk[-1] == pytest.approx(1.0, abs=1e-3)
    assert np.interp(3.002, fine.time_s, sunk) == pytest.approx(np.interp(1.999, fine.time_s, sunk), abs=2e-3)
