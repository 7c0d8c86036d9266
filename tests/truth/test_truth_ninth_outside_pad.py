"""Effects of the pad outside the catalogue: each is what its docstring says."""

import numpy as np
import pytest
from scipy.special import ndtr

from .effects.ninth_outside_pad import (
    _closed_count,
    _closed_share,
    _fires,
    _hunts,
    _marks,
    _relay,
    _turned,
    opens_per_s,
)
from .motion import Path
from .sets import SETS, shapes_of
from .test_truth_cases import CATALOGUE
from .test_truth_effects import hidden

pytestmark = pytest.mark.long

MINE = ("firing", "imprint", "catch_bonds", "regulated", "fabric")


def test_they_are_of_the_ninth_alone():
    assert not set(MINE) & set(CATALOGUE)
    assert all(shapes_of(id, *SETS) == shapes_of(id, "ninth") and len(shapes_of(id, "ninth")) == 2 for id in MINE)


# --- firing -----------------------------------------------------------------------------------------------------------


def jerks(fine, told, depth, held):
    """Times of the jerks while the probe is held: of q e^{1−q}, (1 + τ d/dt)² leaves an impulse of e τ."""
    t, wave = fine.time_s[held], (fine.force_N[held] / (3 * depth) - 1) / told["growth"]
    kept = np.exp(-1e-4 / told["tau"])
    left = wave[2:] - 2 * kept * wave[1:-1] + kept**2 * wave[:-2]
    return t[1:-1][left / (np.e * 1e-4 / told["tau"]) > 0.5]


@pytest.mark.parametrize("seed", range(3))
def test_the_more_it_bears_the_oftener_it_jerks(seed):
    often = []
    for depth in (0.1, 0.8, 1.4, 2.0):
        # Seen at 2 mm for a moment, so that the greatest force is the same each time.
        motion = Path(0.0, np.inf).to(depth, 1e3).hold(20.0).to(2.0, 1e3).motion()
        fine, told, _ = hidden("firing", "steady", motion=motion, seed=seed)
        when = jerks(fine, told, depth, (fine.time_s > 0.01) & (fine.time_s < 19.9))
        often.append(len(when) / 20.0)
        if depth == 2.0:
            gaps = np.diff(when) * told["often"] * 0.9
            assert (
                gaps.min() > 0.74 and gaps.max() < 1.26 and np.std(gaps) == pytest.approx(0.5 / np.sqrt(12), rel=0.25)
            )
    load = np.array([0.05, 0.4, 0.7, 1.0])
    assert often == pytest.approx(told["often"] * np.maximum(load - 0.1, 0.0), rel=0.08, abs=0.06)
    assert 2.0 <= told["often"] <= 4.0 and 0.04 <= told["tau"] <= 0.08


@pytest.mark.parametrize("seed", range(3))
def test_it_gets_used_to_its_load(seed):
    fine, told, _ = hidden("firing", "adapts", motion=Path(2.0).hold(60.0).motion(), seed=seed)
    when = jerks(fine, told, 2.0, fine.time_s > 0.001)
    # 0.9 at first and 0.1 in the end.
    assert 4.0 <= told["often"] <= 8.0
    late = when[when > 15.0]
    assert (len(late) - 1) / (late[-1] - late[0]) == pytest.approx(0.1 * told["often"], rel=0.15)
    # All those more are 0.8 τ of what the rate is.
    more = len(when) - 0.1 * told["often"] * 60.0
    assert 0.6 < more / told["often"] / 0.8 < 3.5 and np.median(np.diff(when)[:3]) < 3 / told["often"]


def test_the_time_to_fire():
    load = np.where(np.arange(10_000) < 5000, 0.6, 0.1)
    when = _fires(load, 1e-3, 0.1, 2.0, 0.0, 1.0, np.full(50, 0.5))
    # ∫ 2 · 0.5 dt of 0.5 each, and nothing at the least.
    assert np.allclose(when, 500 * np.arange(1, len(when) + 1), atol=2) and len(when) in (9, 10)


# --- imprint ----------------------------------------------------------------------------------------------------------


def test_a_mark_where_it_is_held():
    x = np.concatenate([np.full(2000, 1.0), np.linspace(1.0, 0.0, 200), np.full(1000, -0.5), np.linspace(0, 2.0, 401)])
    marks = _marks(x, 1e-3, 0.02, 0.1, 0.8, np.inf, np.inf)
    assert marks[1999] == pytest.approx(-np.expm1(-2.0 / 0.8), rel=2e-3) and np.all(marks[2200:3200] == 0)
    # Passed again: what 2 s of holding and two ways at 5 mm/s, one of which is half done, have made of each place.
    again, place = marks[3200:], x[3200:]
    bell = np.exp(-0.5 * ((place - 1.0) / 0.1) ** 2)
    below = ndtr(-place / 0.1)
    passed = 0.1 * np.sqrt(2 * np.pi) / 5.0 * (ndtr((1.0 - place) / 0.1) - below + 0.5 - below)
    assert np.allclose(again[1:], -np.expm1(-(2.0 * bell + passed) / 0.8)[1:], atol=0.02)
    faded = _marks(x, 1e-3, 0.02, 0.1, 0.8, 5.0, np.inf)[3200:]
    at = np.argmin(np.abs(place - 1.0))
    assert faded[at] / again[at] == pytest.approx(np.exp(-1.4 / 5.0), rel=0.12)


@pytest.mark.parametrize("shape", shapes_of("imprint", "ninth"))
@pytest.mark.parametrize("seed", range(3))
def test_a_pad_that_remembers_depths(shape, seed):
    kept = {}
    for rest, passes in ((0.5, 1), (6.0, 1), (0.5, 3)):
        path = Path(0.0, np.inf).to(1.0, 100.0).hold(8.0).to(-0.5, 100.0).hold(rest)
        for _ in range(passes - 1):
            path.to(1.6, 100.0).to(-0.5, 100.0)
        motion = path.to(1.9, 100.0).motion()
        fine, told, _ = hidden("imprint", shape, motion=motion, seed=seed)
        last = fine.time_s > motion.duration_s - 0.0149
        x = fine.reported_mm[last]
        more = (fine.force_N[last] / (3 * x) - 1) / told["more"]
        kept[rest, passes] = np.interp(1.0, x, more)
        # Nothing where it was not held.
        assert np.interp(1.0 + 5 * told["width"], x, more) < 0.05
        hold = (fine.time_s > 0.1) & (fine.time_s < 1.0)
        grown = 1 - (fine.force_N[hold] / 3 - 1) / told["more"]
        if shape == "rubbed_out":
            slope = np.polyfit(fine.time_s[hold][grown > 0.05], np.log(grown[grown > 0.05]), 1)[0]
            assert -1 / slope == pytest.approx(told["grows"], rel=0.05)
    first = kept[0.5, 1]
    if shape == "fades":
        assert kept[0.5, 3] == pytest.approx(first, rel=0.1) and 0.45 < kept[6.0, 1] / first < 0.85
    else:
        assert kept[6.0, 1] == pytest.approx(first, rel=1e-3) and kept[0.5, 3] < 0.6 * first


# --- bonds ------------------------------------------------------------------------------------------------------------


def test_bonds_hold_longest_under_a_middling_load():
    load = np.linspace(0, 1, 1001)
    opens = opens_per_s(load, 4.0, 0.15, 0.1)
    # e^{−p/c}/c = e^{(p−1)/s}/s where it is least.
    least = (1 / 0.1 + np.log(0.1 / 0.15)) / (1 / 0.15 + 1 / 0.1)
    assert load[np.argmin(opens)] == pytest.approx(least, abs=2e-3) and opens.min() < 0.2
    assert opens[0] == pytest.approx(4.0, rel=1e-3) and opens[-1] == pytest.approx(4.0, rel=2e-3)


@pytest.mark.parametrize("seed", range(3))
def test_many_bonds(seed):
    for depth in (0.1, 1.0, 2.0):
        motion = Path(0.0, np.inf).to(depth, 1e4).hold(12.0).to(-0.5, 1e4).hold(0.1).to(depth, 1e4).hold(0.05).motion()
        fine, told, _ = hidden("catch_bonds", "many", motion=motion, seed=seed)
        assert 1 / 1.0 <= told["closes"] <= 1 / 0.3 and 2 <= told["opens"] / told["closes"] <= 10
        p = depth / 2
        opens = told["opens"] * (np.exp(-p / told["catch"]) + np.exp((p - 1) / told["slip"]))
        total = told["closes"] + opens
        t = np.array([0.05, 0.2, 0.7, 11.0])
        share = (fine.at(t) / (3 * depth) - 1) / told["more"]
        assert share == pytest.approx(told["closes"] / total * -np.expm1(-total * t), abs=3e-3)
        assert (fine.force_N[-1] / (3 * depth) - 1) / told["more"] < 0.2  # anew after air


@pytest.mark.parametrize("seed", range(3))
def test_few_bonds(seed):
    motion = Path(1.2).hold(300.0).motion()
    rng = np.random.default_rng(seed)
    n = 300_000
    opens, waits = np.full(n, 1.5), rng.exponential(1.0, (6, 2048))
    count = _closed_count(np.ones(n, dtype=bool), opens, 2.5, 1e-3, waits)
    assert set(np.round(6 * count)) <= set(range(7)) and motion.duration_s == 300.0
    # Binomial of 2.5/4, and forgotten by e^{−4 t}.
    steady = count[2000:]
    assert np.mean(steady) == pytest.approx(0.625, abs=0.03)
    assert np.var(steady) == pytest.approx(0.625 * 0.375 / 6, rel=0.15)
    off = steady - np.mean(steady)
    assert np.mean(off[250:] * off[:-250]) / np.var(steady) == pytest.approx(np.exp(-1.0), abs=0.1)
    mean = _closed_share(np.ones(n, dtype=bool), opens, 2.5, 1e-3)
    assert mean[-1] == pytest.approx(0.625) and mean[100] == pytest.approx(0.625 * -np.expm1(-0.4))
    touching = np.arange(n) % 1000 < 500
    assert np.all(_closed_count(touching, opens, 2.5, 1e-3, waits)[~touching] == 0)
    fine, told, _ = hidden("catch_bonds", "few", motion=Path(1.2).hold(20.0).motion(), seed=seed)
    levels = np.unique(np.round((fine.force_N[1:] / 3.6 - 1) / told["more"] * 6, 6))
    assert np.allclose(levels, np.round(levels)) and 4 <= len(levels) <= 7


# --- a controller -----------------------------------------------------------------------------------------------------


def test_what_integrates_late():
    # A step of 1: a line from T on, −k (s − T), and a parabola more from 2 T.
    t = 1e-3 * np.arange(1200)
    y = _hunts(np.where(t > 0, 1.0, 0.0), 1e-3, 2.0, 0.4)
    exact = -2.0 * np.maximum(t - 0.4, 0.0) + 2.0**2 * np.maximum(t - 0.8, 0.0) ** 2 / 2
    assert np.allclose(y, exact, atol=5e-3)


@pytest.mark.parametrize("seed", range(3))
def test_a_controller_that_hunts(seed):
    fine, told, _ = hidden("regulated", "hunts", motion=Path(0.0, np.inf).to(1.0, 1e4).hold(30.0).motion(), seed=seed)
    t, left = fine.time_s, (fine.force_N / 3 - 1) / told["share"]
    assert 0.8 <= told["turns"] <= 1.2 and 0.25 <= told["late"] <= 0.6
    assert np.all(np.abs(left[(t > 1e-3) & (t < told["late"])]) < 1e-3)
    line = (t > told["late"]) & (t < 2 * told["late"])
    assert np.allclose(left[line], -told["turns"] * (t[line] / told["late"] - 1), atol=2e-3)
    # It overshoots, and in the end there is as much pressure as before.
    assert left.min() < -1.1 and left[-1] == pytest.approx(-1.0, abs=0.05)


def test_a_valve_and_a_pump():
    t = 1e-3 * np.arange(10_000)
    u = np.where(t < 5.0, 1.0, 0.0)
    y = _relay(u, 1e-3, 0.2, 0.2, 1.0, 0.1)
    off = u + y
    # Down with 1.1 to nothing, down with the leak to −0.2, up with 0.9 to nothing, and so on.
    assert np.interp(0.5, t, y) == pytest.approx(-0.55, abs=5e-3) and np.interp(0.9, t, y) == pytest.approx(
        -0.99, abs=5e-3
    )
    later = (t > 1.0) & (t < 4.9)
    assert off[later].max() < 5e-3 and off[later].min() == pytest.approx(-0.2, abs=5e-3)
    period = 0.2 / 0.1 + 0.2 / 0.9
    low = t[later][np.flatnonzero(np.diff(np.sign(np.diff(off[later]))) > 0) + 1]
    assert np.diff(low) == pytest.approx(period, abs=5e-3)
    # Let go it is too low by all that was let out, and the pump comes.
    assert off[5001] == pytest.approx(-1.0, abs=0.2) and np.all(np.abs(off[t > 7.0]) < 0.21)


@pytest.mark.parametrize("seed", range(3))
def test_a_relay_that_comes_and_goes(seed):
    fine, told, _ = hidden("regulated", "relay", motion=Path(0.0, np.inf).to(2.0, 1e4).hold(40.0).motion(), seed=seed)
    off = (fine.force_N / 6 - 1) / told["share"] + 1
    later = fine.time_s > 4.0
    least = -off[later].min()
    assert 0.098 < least < 0.252 and off[later].max() < 5e-3
    falls = -np.diff(off[later]) / 1e-4
    leaks, pumps = np.median(falls[falls > 0]), -np.median(falls[falls < 0])
    assert 0.079 < leaks < 0.201 and 0.49 - leaks < pumps < 1.51 - leaks
    first = (fine.time_s > 0.01) & (fine.time_s < 0.3)
    assert np.allclose(-np.diff(off[first]) / 1e-4, pumps + 2 * leaks, rtol=1e-3)


# --- a fabric ---------------------------------------------------------------------------------------------------------


def test_a_turn_takes_it_apart():
    x = np.concatenate(
        [np.linspace(0, 1, 1001), np.full(500, 1.0), np.linspace(1, 0.5, 501), np.linspace(0.5, 1.5, 1001)]
    )
    w = _turned(x, 0.02, 0.4, 0.0)
    assert np.all(w[:1501] == 0)
    # w' = q/g − w/c along the way s, q = e^{−s/g}: c/(c − g) (e^{−s/c} − e^{−s/g}).
    s = 1.0 - x[1501:2001]
    exact = 0.4 / 0.38 * (np.exp(-s / 0.4) - np.exp(-s / 0.02))
    assert np.allclose(w[1501:2001], exact, atol=0.02)
    # The second turn takes what is together again.
    left, s = w[2001], 0.3
    wanted = left * np.exp(-s / 0.4) + (1 - left) * 0.4 / 0.38 * (np.exp(-s / 0.4) - np.exp(-s / 0.02))
    assert np.interp(0.8, x[2002:], w[2002:]) == pytest.approx(wanted, abs=0.02)
    some = _turned(x, 0.02, 0.4, 0.7)
    assert some[1600] / w[1600] == pytest.approx(-np.expm1(-1.0 / 0.7), rel=1e-3)


def lost(shape, seed, *depths, speed=20.0, rest=0.0):
    """Share lost at 1.8 mm, on the way out from the last of the depths."""
    path = Path(0.0, np.inf)
    for depth in depths:
        path.to(depth, speed)
    motion = path.hold(rest).to(1.8, speed).hold(0.1).motion()
    fine, told, _ = hidden("fabric", shape, motion=motion, seed=seed)
    first = (fine.time_s > 1e-3) & (fine.time_s < 1.9 / speed)
    assert np.allclose(fine.force_N[first], 3 * fine.reported_mm[first])
    return (1 - fine.force_N[-1] / 5.4) / told["share"], told


@pytest.mark.parametrize("shape", shapes_of("fabric", "ninth"))
@pytest.mark.parametrize("seed", range(3))
def test_a_fabric_by_its_turns(shape, seed):
    one, told = lost(shape, seed, 1.9)
    goes, comes = told["goes"], told["comes"]
    assert 0.01 <= goes / 2 <= 0.03 and 0.15 <= comes / 2 <= 0.4
    # Not by speed, not by rest.
    assert lost(shape, seed, 1.9, speed=40.0)[0] == pytest.approx(one, rel=0.01)
    assert lost(shape, seed, 1.9, rest=5.0)[0] == pytest.approx(one, rel=1e-3)

    def single(s):
        return comes / (comes - goes) * (np.exp(-s / comes) - np.exp(-s / goes))

    if shape == "each_turn":
        assert one == pytest.approx(single(0.1), rel=0.02)
        part = {1.9: 1.0, 0.5: 1.0, 1.2: 1.0}
    else:
        needs = -1.9 / np.log(1 - one / single(0.1))
        assert 0.95 < needs < 2.1
        part = {way: -np.expm1(-way / needs) for way in (1.9, 0.5, 1.2)}
    for way in (0.5, 1.2):
        w = part[1.9] * single(way)
        w = w * np.exp(-way / comes) + (1 - w) * part[way] * single(way)
        w = w * np.exp(-0.1 / comes) + (1 - w) * part[way] * single(0.1)
        assert lost(shape, seed, 1.9, 1.9 - way, 1.9)[0] == pytest.approx(w, rel=0.03)
