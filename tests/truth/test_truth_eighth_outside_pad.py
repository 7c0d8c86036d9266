"""The eighth effects of the pad outside the catalogue: each is what its docstring says."""

import numpy as np
import pytest

from .effects.eighth_outside_pad import _given_way, _voids
from .motion import Path
from .sets import SETS, shapes_of
from .test_truth_cases import CATALOGUE
from .test_truth_effects import hidden

pytestmark = pytest.mark.long

MINE = ("echo", "delayed_yield", "pressed_beside", "twitches", "voids")


def test_they_are_of_the_eighth_alone():
    assert not set(MINE) & set(CATALOGUE)
    assert all(shapes_of(id, *SETS) == shapes_of(id, "eighth") and len(shapes_of(id, "eighth")) == 2 for id in MINE)


@pytest.mark.parametrize(("shape", "turned"), [("closed_end", 1), ("open_end", -1)])
def test_a_wave_comes_back(shape, turned):
    for seed in range(3):
        halves = []
        for depth in (0.6, 1.2):
            motion = Path(-0.01, np.inf).to(depth, 1e3).hold(8.0).motion()
            fine, told, _ = hidden("echo", shape, motion=motion, seed=seed)
            halves.append((fine.force_N / (3 * depth) - 1)[100:79_900] / told["share"])
        heard, t = halves[0], fine.time_s[100:79_900] - 0.0003
        assert np.allclose(halves[0], halves[1], atol=0.01)
        assert 0.3 <= told["returns"] <= 1.0 and 0.2 <= told["lasts"] / told["returns"] <= 0.33
        # A triangle each time, whose height is that of the step and then 0.6 of the one before, six times.
        wanted = np.zeros_like(t)
        for k in range(1, 7):
            from_top = np.abs(t - k * told["returns"] - told["lasts"] / 2) / (told["lasts"] / 2)
            wanted += turned**k * 0.6 ** (k - 1) * np.maximum(1 - from_top, 0.0)
        assert np.allclose(heard, wanted, atol=0.02)
        assert heard.max() > (0.97 if turned > 0 else 0.57) and np.all(np.abs(heard[t < told["returns"] - 0.01]) < 1e-9)


def delays(shape, seed, depth, air_s=3.0):
    motion = Path(-0.01, np.inf).to(depth, 1e3).hold(40.0).to(-0.01, 1e3).hold(air_s).to(depth, 1e3).hold(0.05).motion()
    fine, told, _ = hidden("delayed_yield", shape, motion=motion, seed=seed)
    met = 0.01 / 1e3
    lost = (1 - fine.force_N / (3 * depth)) / told["share"]
    return fine.time_s - met, lost, told


def test_a_gel_gives_way_late():
    for seed in range(3):
        late = []
        for depth in (0.8, 1.4, 2.0):
            t, lost, told = delays("at_once", seed, depth)
            held = (t > 0.003) & (t < 39.9)
            t, lost = t[held], lost[held]
            late.append(t[lost > 1e-6][0])
            assert np.all(np.abs(lost[t < late[-1] - 1e-3]) < 1e-9) and lost[-1] == pytest.approx(1.0)
            takes = -0.05 / np.log(1 - np.interp(late[-1] + 0.05, t, lost))
            assert 0.019 <= takes <= 0.081
        # e times as late for each `per_load` of the greatest force less.
        wanted = told["delay"] * np.exp((1 - np.array([0.4, 0.7, 1.0])) / told["per_load"])
        assert late == pytest.approx(wanted, rel=1e-2, abs=3e-3) and 0.1 <= told["delay"] <= 0.3


def test_it_heals_in_air():
    heals = []
    for air_s in (1.0, 3.0):
        t, lost, _ = delays("at_once", 0, 0.6, air_s)
        again = (t > 40.005 + air_s) & (t < 40.02 + air_s)
        heals.append(-air_s / np.log(np.median(lost[again])))
    assert heals[0] == pytest.approx(heals[1], rel=0.02) and 1.0 <= heals[0] <= 4.0
    # Half a second is too short by itself, and does not count after a moment in air.
    load, touches = np.ones(1500), np.ones(1500, dtype=bool)
    touches[500] = False
    given = _given_way(load, touches, 1e-3, 0.7, 0.3, 0.02, 1.0)
    assert np.all(given[:1195] == 0) and given[1210] > 0.1


def test_strand_by_strand():
    t, lost, told = delays("strand_by_strand", 1, 1.4)
    held = (t > 0.003) & (t < 39.9)
    t, lost = t[held], lost[held]
    base = told["delay"] * np.exp(0.3 / told["per_load"])
    for k, part in enumerate((0.4, 0.8, 1.6, 3.2)):
        late = part * base
        assert np.interp(late - 2e-3, t, lost) == pytest.approx(k / 4, abs=0.02)
        assert np.interp(late + 0.01, t, lost) > k / 4 + 0.02
    assert lost[-1] == pytest.approx(1.0)


@pytest.mark.parametrize("shape", shapes_of("pressed_beside", "eighth"))
def test_another_press_beside_it(shape):
    motion = Path(1.5).hold(90.0).motion()
    for seed in range(3):
        fine, told, _ = hidden("pressed_beside", shape, motion=motion, seed=seed)
        t = np.arange(0.5, 89.5, 1e-3)
        wave = (1.5 - fine.at(t) / 3) / told["sinks"]
        assert wave.min() >= -1e-9 and wave.max() <= 1 + 1e-9 and 0.09 <= told["takes"] <= 0.31
        slopes = np.diff(wave) / 1e-3
        changing = np.abs(slopes) > 1e-6
        assert np.allclose(np.abs(np.median(slopes[slopes > 1e-6])), 1 / told["takes"], rtol=1e-3)
        begins = np.flatnonzero(np.diff(changing.astype(int)) == 1)
        lengths = np.diff(t[begins])
        assert len(lengths) > 20 and np.mean(changing) == pytest.approx(len(begins) * told["takes"] / 89, rel=0.15)
        if shape == "rhythm":
            assert np.allclose(lengths[::2], lengths[0], atol=3e-3) and np.allclose(
                lengths[1::2], lengths[1], atol=3e-3
            )
            period = lengths[0] + lengths[1]
            assert 2 <= period <= 6 and 0.34 <= np.mean(wave[: int(period * 10 / 1e-3)]) <= 0.61
        else:
            rest = lengths - told["takes"]
            # Exponential: the deviation is the mean.
            assert rest.min() > -0.01 and 0.6 < np.mean(rest) < 4.5
            assert np.std(rest) == pytest.approx(np.mean(rest), rel=0.5)


def test_twitches():
    motion = Path(1.0).hold(120.0).motion()
    for shape in shapes_of("twitches", "eighth"):
        for seed in range(3):
            fine, told, _ = hidden("twitches", shape, motion=motion, seed=seed)
            wave = (fine.force_N[1:] / 3 - 1) / told["growth"]
            # Of q e^{1−q}, (1 + τ d/dt)² leaves an impulse of e τ.
            kept = np.exp(-1e-4 / told["tau"])
            left = wave[2:] - 2 * kept * wave[1:-1] + kept**2 * wave[:-2]
            pulses = np.convolve(left, np.ones(3), "same") / (np.e * 1e-4 / told["tau"])
            hit = np.flatnonzero(pulses > 0.1)
            first = hit[np.concatenate([[True], np.diff(hit) > 5])]
            sizes = np.array([pulses[k : k + 4].max() for k in first])
            gaps = np.diff(first * 1e-4)
            assert sizes.min() > 0.4 and sizes[:-1].max() < 1.6 * 2 and np.median(sizes) == pytest.approx(1.0, abs=0.25)
            assert 0.04 <= told["tau"] <= 0.09
            if shape == "single":
                assert 0.4 < np.mean(gaps) < 1.2 and np.std(gaps) == pytest.approx(np.mean(gaps), rel=0.35)
                continue
            inside = gaps < 0.5
            assert np.allclose(gaps[inside], gaps[inside][0], atol=2e-3) and 0.099 <= gaps[inside][0] <= 0.161
            ends = np.flatnonzero(~inside)
            counts = np.diff(ends)
            assert set(counts) <= {3, 4, 5, 6} and len(set(counts)) >= 3
            begins = first[ends + 1] * 1e-4
            assert np.all((np.diff(begins) > 1.49) & (np.diff(begins) < 4.01)) and np.std(np.diff(begins)) > 0.4


def test_voids_open_by_speed():
    x = np.concatenate([np.linspace(0, 2, 201), np.linspace(2, 1, 101)[1:], np.full(100, 1.0), np.linspace(1, 2, 101)])
    # A millimetre in 0.1 s is 10 mm/s.
    assert np.all(_voids(x, 1e-3, 11.0, 0.5, np.inf, 1.0) == 0)
    share = _voids(x, 1e-3, 9.0, 0.5, 2.0, np.inf)
    assert share[200] == 0 and np.all(np.diff(share[200:300]) > 0)
    assert share[400] == pytest.approx(share[300] * np.exp(-0.05), rel=1e-3)
    assert _voids(x, 1e-3, 9.0, 0.5, np.inf, 1.0)[300] == pytest.approx(-np.expm1(-2.0))
    for seed in range(3):
        for shape in shapes_of("voids", "eighth"):
            for speed, opens in ((1.5, False), (7.0, True)):
                path = Path(0.0, np.inf).to(2.0, 50.0).hold(0.1).to(1.0, speed).hold(1.0).to(1.9, 1.0).hold(0.1)
                motion = path.motion()
                fine, told, _ = hidden("voids", shape, motion=motion, seed=seed)
                back = 0.14 + 1.0 / speed
                at = back + np.array([0.001, 0.5, 0.999, 1.95])
                lost = (1 - fine.at(at) / (3 * motion.position(at))) / told["share"]
                if not opens:
                    assert np.allclose(lost, 0, atol=1e-9)
                    continue
                if shape == "dissolve":
                    # As much in any like time, pressed or not; the way in adds nothing.
                    fades = -np.diff(at)[[0, 2]] / np.log(lost[[1, 3]] / lost[[0, 2]])
                    assert 2.0 <= fades[0] <= 8.0 and fades[0] == pytest.approx(fades[1], rel=1e-3)
                    continue
                # Whole within 0.4 to 1 mm.
                assert -np.expm1(-1.0) - 1e-3 <= lost[0] <= -np.expm1(-2.5) + 1e-3
                assert lost[:3] == pytest.approx(lost[0], abs=2e-3)
                closes = -0.9 / np.log(lost[3] / lost[2])
                assert 0.99 <= closes <= 2.01
