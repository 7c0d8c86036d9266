"""The sixth effects outside the catalogue: each is what its docstring says."""

import numpy as np
import pytest

from .effects.sixth_outside_bench import _holds_peak, _relieved
from .effects.sixth_outside_pad import _presses, _skin
from .motion import Path
from .pad import Pad
from .sets import SETS, outside, shapes_of
from .test_truth_cases import CATALOGUE
from .test_truth_effects import SPRING, hidden
from .test_truth_third_outside import added

pytestmark = pytest.mark.long


def touches(count, depth=1.8, hold_s=0.05, air_s=0.05, speed=20.0):
    path = Path(-0.5)
    for _ in range(count):
        path.to(depth, speed).hold(hold_s).to(-0.5, 100.0).hold(air_s)
    return path.motion()


def test_they_are_of_the_bench_or_of_the_pad():
    mine = outside(CATALOGUE, "sixth")
    assert len(mine) == 11 and all(shapes_of(id, *SETS) == shapes_of(id, "sixth") for id in mine)


@pytest.mark.parametrize("shape", shapes_of("chip", "sixth"))
def test_a_chip_bears_a_part(shape):
    force = np.array([0.0, 5.0, 3.5, 5.0, 3.2, 2.5, 1.9, 3.0, 0.1, 0.0, 0.3, 0.0])
    assert np.array_equal(_relieved(force, 2 / 3, 0.4), [0, 0, 0, 0, 1, 1, 2, 2, 3, 3, 3, 3])
    motion = touches(40)
    fine, told, _ = hidden("chip", shape, motion=motion)
    period, levels = motion.duration_s / 40, []
    for k in range(40):
        inside = (fine.time_s > k * period) & (fine.time_s < (k + 1) * period) & (motion.velocity(fine.time_s) > 19)
        lost, force = (fine.cell_N - fine.force_N)[inside], fine.cell_N[inside]
        met = lost > 1e-9
        if met.any():
            slope = np.polyfit(force[met], lost[met], 1)[0]
            assert slope == pytest.approx(told["bears"], rel=1e-3)
        levels.append(force[met].min() / 6 if met.any() else 2.0)
    levels = np.array(levels)
    if shape == "moves":
        assert np.all((levels > 0.09) & (levels < 0.71)) and np.std(levels) > 0.1
    else:
        there = levels < 1
        assert 10 < there.sum() < 30
        assert np.ptp(levels[there]) < 0.01 and 0.14 < levels[there][0] < 0.31


def test_a_detector_of_peaks():
    force = np.repeat([1.0, 3.0, 2.0, 0.0, -1.0], 1000)
    held = _holds_peak(force, 1e-4, 0.1)
    # From 3 N on it sinks, and meets the 2 N that there are after 0.1 ln 1.5 s.
    assert held[1500] == 3.0 and held[2200] == pytest.approx(3 * np.exp(-0.201), rel=1e-3) and held[2499] == 2.0
    assert held[3500] == pytest.approx(2 * np.exp(-0.5), rel=5e-3) and held[-1] > -1.0
    assert np.array_equal(_holds_peak(-force, 1e-4, 1e-7), -force)
    motion = Path(-0.5).to(1.5, 20.0).hold(0.3).to(0.5, 100.0).hold(0.3).motion()
    for shape in shapes_of("peak_detector", "sixth"):
        fine, told, _ = hidden("peak_detector", shape, 2.0, motion=motion)
        t, rises = fine.time_s, fine.time_s < 0.3
        assert np.array_equal(fine.force_N[rises], fine.cell_N[rises])
        begin = t[np.flatnonzero(fine.cell_N > 4.4999)[-1]]
        if shape == "leaks":
            first, second = np.interp(begin + np.array([0.2, 0.5]) * told["lasts"], t, fine.force_N)
            assert first > 3.6 and second / first == pytest.approx(np.exp(-0.3), rel=1e-3)
        else:
            assert t[np.flatnonzero(fine.force_N > 4.4999)[-1]] - begin == pytest.approx(told["lasts"], abs=3e-4)
            assert np.min(fine.force_N[t > 0.2]) > 1.4999


@pytest.mark.parametrize("shape", shapes_of("flexed_cable", "sixth"))
def test_a_cable_that_is_unquiet_in_motion(shape):
    path = Path(0.5)
    for _ in range(12):
        path.to(1.5, 2.0).to(0.5, 2.0)
    motion = path.hold(8.0).motion()
    fine, told, _ = hidden("flexed_cable", shape, motion=motion)
    lost, t = (1 - fine.force_N / np.where(fine.cell_N > 0, fine.cell_N, 1.0)) / told["drop"], fine.time_s
    moving = (t > 2) & (t < 11.9)
    rests = (t > 12.2 + 8 * told["settles"]) & (t < motion.duration_s)
    assert 0.2 <= told["settles"] <= 0.5 and np.all(np.abs(lost[rests]) < 3e-3)
    if shape == "crackles":
        assert np.std(lost[moving]) == pytest.approx(1.0, abs=0.2) and abs(np.mean(lost[moving])) < 0.35
        off = lost[moving] - np.mean(lost[moving])
        assert np.mean(off[4000:] * off[:-4000]) < 0.25 * np.var(off)  # 0.4 s
        assert np.mean(off[100:] * off[:-100]) > 0.6 * np.var(off)  # 10 ms
    else:
        low, high = lost[moving] < 0.05, np.abs(lost[moving] - 1.5) < 0.1
        assert np.all(low | high) and 0.3 < np.mean(high) < 0.7
        changes = np.sum(np.diff(high.astype(int)) != 0)
        assert 9.9 / 0.25 < changes < 9.9 / 0.04


def test_a_hose_whips_as_it_is_dragged():
    path = Path(-0.5)
    for speed in (2.0, 50.0) * 10:
        path.to(1.5, speed).hold(6.0).to(-0.5, speed).hold(6.0)
    motion = path.motion()
    t = np.arange(0, motion.duration_s, 1e-3)
    quick = [s for s in motion.breaks_s[:-1] if np.isclose(np.abs(motion.velocity(s + 1e-6)), 50.0)]
    slow = [s for s in motion.breaks_s[:-1] if np.isclose(np.abs(motion.velocity(s + 1e-6)), 2.0)]
    for shape in shapes_of("whipping_hose", "sixth"):
        _, told, build = hidden("whipping_hose", shape, motion=motion)
        swings = added(build, t)
        assert np.max(np.abs(swings)) == pytest.approx(told["amplitude"], rel=0.01)
        power = [[np.max(np.abs(swings[(t > s) & (t < s + 1.1)])) for s in some] for some in (quick, slow)]
        ratio = np.mean(power[0]) / np.mean(power[1])
        # A push is as long as its move: 0.04 s of 50 and 1 s of 2.
        assert ratio > 2.5 if shape == "by_speed" else ratio < 0.6
        assert np.std(power[0]) > 0.15 * np.mean(power[0])
        # It calms by e^{−t/τ}, and swings at its frequency.
        soon, late = ([np.log(np.std(swings[(t > s + a) & (t < s + a + 0.5)])) for s in slow] for a in (1.5, 2.5))
        assert np.mean(soon) - np.mean(late) == pytest.approx(1 / told["calms"], rel=0.1)
        spectrum, at = np.abs(np.fft.rfft(swings)) ** 2, np.fft.rfftfreq(len(t), 1e-3)
        middle = at[np.searchsorted(np.cumsum(spectrum), spectrum.sum() / 2)]
        assert middle == pytest.approx(told["frequency"], rel=0.1)


@pytest.mark.parametrize("shape", shapes_of("levelling", "sixth"))
def test_a_table_that_hunts(shape):
    fine, told, _ = hidden("levelling", shape, motion=Path(1.0).hold(150.0).motion())
    height = (1.0 - fine.force_N[1:] / 3.0) / told["deviation"]
    turns = np.flatnonzero(np.diff(np.sign(np.diff(height))) != 0)
    lengths = np.diff(fine.time_s[turns])
    assert np.all((np.abs(height[turns]) > 0.79) & (np.abs(height[turns]) < 1.21)) and np.std(height[turns]) > 0.5
    assert np.all(np.diff(height[turns])[1:] * np.diff(height[turns])[:-1] < 0)  # up and down by turns
    if shape == "hunts":
        assert np.all((lengths > 0.99) & (lengths < 4.01)) and np.std(lengths) > 0.4
    else:
        up = lengths < 0.31
        assert np.all(up[1:] != up[:-1]) and np.all((lengths[~up] > 1.99) & (lengths[~up] < 5.01))
        assert np.allclose(lengths[up], 0.3, atol=1e-3)


def test_a_crust_breaks_and_dries_anew():
    # 0.2 mm, back to the air for 1 s, then 0.8 mm; it breaks at 0.5 mm.
    depth = np.concatenate([np.linspace(0, 0.2, 500), np.zeros(10_000), np.linspace(0, 0.8, 1000), np.zeros(20_000)])
    skin = _skin(depth, 1e-4, 0.5, np.inf, 2.0)
    assert np.all(skin[: 10_500 + 600] == 1.0) and skin[11_499] < 1e-3
    assert skin[-1] == pytest.approx(-np.expm1(-2.0 / 2.0), rel=2e-3)
    worn = _skin(np.linspace(0, 3, 30_001), 1e-4, np.inf, 1.5, 2.0)
    assert worn[-1] == pytest.approx(np.exp(-2.0), rel=1e-3)
    fine, told, _ = hidden("crust", "brittle", motion=touches(3, air_s=1.0))
    first = (fine.time_s < 0.12) & (fine.reported_mm > 0)
    whole = fine.reported_mm[first] < 0.7
    bears = (fine.force_N[first] / fine.reported_mm[first])[whole] - 3
    assert np.allclose(bears, told["more"], rtol=1e-3)
    held = fine.at(np.array([0.16]))
    assert held == pytest.approx(3 * 1.8, rel=1e-3)
    again = (fine.time_s > 1.1) & (fine.reported_mm > 0.1) & (fine.reported_mm < 0.6)
    bears = fine.force_N[again][:100] / fine.reported_mm[again][:100] - 3
    # So long in air since it broke; what of it was left by then was next to nothing.
    air_s = fine.time_s[again][0] - fine.time_s[np.flatnonzero((fine.time_s < 0.5) & (fine.reported_mm > 0))[-1]]
    wanted = told["more"] * -np.expm1(-(air_s - 0.1 / 20) / told["dries"])
    assert np.allclose(bears, wanted, rtol=2e-2)


@pytest.mark.parametrize("shape", shapes_of("avalanches", "sixth"))
def test_avalanches_at_rest(shape):
    path = Path(0.5)
    for _ in range(20):
        path.to(1.5, 50.0).hold(6.0).to(0.5, 50.0).hold(6.0)
    motion = path.motion()
    fine, told, _ = hidden("avalanches", shape, motion=motion)
    kept, t = (fine.force_N / (3 * fine.reported_mm))[1:], fine.time_s[1:]
    lost = 0.7 * np.arctanh((1 - kept) / 0.7) / told["drop"]
    since, sizes, rests = [], [], motion.breaks_s[1:][np.abs(motion.velocity(motion.breaks_s[1:] + 1e-4)) == 0]
    rests = rests[(np.abs(motion.velocity(rests + 3.0)) == 0) & (rests < motion.duration_s - 1)]
    assert len(rests) == 40
    for end in rests:
        inside = (t > end - 5e-5) & (t < end + 5.99)
        steps = np.diff(lost[inside])
        assert np.all(steps > -1e-6)
        hit = np.flatnonzero(steps > 1e-6)
        since += list(t[inside][1:][hit] - end)
        sizes += list(steps[hit])
    moves = np.abs(motion.velocity(t)) > 1
    assert np.all(np.abs(lost[moves]) < 1e-6)  # filled up
    since = np.array(since)
    assert np.mean(sizes) == pytest.approx(1.0, abs=0.25) and np.std(sizes) == pytest.approx(1.0, abs=0.35)
    if shape == "omori":
        # 0.25 ln(1 + s/c) of them within s: as many up to 0.5 s as the half of all in 6 s.
        assert len(since) / 40 == pytest.approx(0.25 * np.log(121.0), rel=0.35)
        assert np.mean(since < 0.5) == pytest.approx(np.log(11) / np.log(121), abs=0.12)
    else:
        assert len(since) / 40 == pytest.approx(6 / 3.0, rel=0.25)
        assert np.mean(since < 3) == pytest.approx(0.5, abs=0.15)


def test_a_cushion_that_walks():
    motion = touches(30, hold_s=1.5)
    fine, told, _ = hidden("squirming", "each_touch", motion=motion)
    ends = motion.duration_s / 30 * (np.arange(30) + 1) - 0.1
    period = motion.duration_s / 30
    gains = fine.at(ends) / (3 * np.interp(ends, fine.time_s, fine.reported_mm)) - 1
    assert 0.6 * told["deviation"] < np.std(gains) < 1.1 * told["deviation"] and 5 < np.sum(gains > 0) < 25
    inside = (fine.time_s > period * 4 + 0.14) & (fine.time_s < period * 4 + 1.6)
    gain = (fine.force_N / 5.4)[inside] - 1
    # Straight in e^{−t/τ}: each like way takes the same share of what is left.
    parts = np.diff(gain[[0, 4000, 8000, 12_000]])
    assert parts[1] / parts[0] == pytest.approx(parts[2] / parts[1], rel=1e-2) and parts[1] / parts[0] < 0.9
    motion = touches(30, hold_s=1.5, air_s=3.0)
    fine, told, _ = hidden("squirming", "wanders", motion=motion)
    ends = motion.duration_s / 30 * (np.arange(30) + 1) - 3.03
    last = fine.at(ends) / (3 * np.interp(ends, fine.time_s, fine.reported_mm)) - 1
    next_ = motion.duration_s / 30 * np.arange(1, 30) + 0.06
    first = fine.at(next_) / (3 * np.interp(next_, fine.time_s, fine.reported_mm)) - 1
    # It stays in air as it was: what is next is what was last.
    assert np.std(first - last[:-1]) < 0.5 * np.std(last) and np.std(last) > 0.3 * told["deviation"]


@pytest.mark.parametrize("shape", shapes_of("tremor", "sixth"))
def test_a_hand_that_trembles(shape):
    motion = Path(-0.5).hold(1.0).to(1.0, 50.0).hold(60.0).motion()
    fine, told, _ = hidden("tremor", shape, motion=motion)
    swing, t = fine.force_N / 3 - 1, fine.time_s
    held = (t > 12) & (t < 60)
    level = told["deviation"] * (1.0 if shape == "steady" else 1.5)
    assert np.std(swing[held]) == pytest.approx(level, rel=0.25)
    spectrum, at = np.abs(np.fft.rfft(swing[held])) ** 2, np.fft.rfftfreq(int(held.sum()), 1e-4)
    near = np.abs(at - told["frequency"]) < 2.0
    assert spectrum[near].sum() > 0.8 * spectrum.sum() and spectrum.max() < 0.4 * spectrum.sum()
    begins = np.std(swing[(t > 1.04) & (t < 1.14)])
    assert np.all(fine.force_N[t < 1] == 0) and (shape == "steady" or begins < 0.15 * level)


@pytest.mark.parametrize("shape", shapes_of("clogging", "sixth"))
def test_pores_clog(shape):
    pad = Pad(SPRING.law, (0.5,), (2.0,))
    motion = touches(16, hold_s=0.6, air_s=3.0)
    fine, told, _ = hidden("clogging", shape, pad=pad, motion=motion)
    period, rates = motion.duration_s / 16, []
    for k in range(16):
        t = k * period + 0.12 + np.array([0.05, 0.1, 0.15]) + 0.01
        force = fine.at(t) / 5.4 - 0.5
        rates.append(-np.diff(np.log(force)) / 0.05 / 2.0)
    # In a touch the rate is one; from one to the next it is not.
    rates = np.log(np.array(rates)) / told["spread"]
    even = np.abs(np.diff(rates, axis=1))[:, 0] < 0.05
    assert np.mean(even) > 0.8 and np.std(rates[even].mean(axis=1)) > 0.3
    if shape == "in_bouts":
        assert np.all(np.abs(np.abs(rates[even]) - 1) < 0.05) and len(set(np.sign(rates[even][:, 0]))) == 2
    else:
        assert np.all(even) and np.all(np.abs(rates) < 1.55) and len(set(np.round(rates[:, 0], 2))) > 12


def test_a_shell_with_two_states():
    x = np.interp(np.arange(300), [0, 99, 149, 199, 299], [0.0, 1.0, 0.6, 1.0, 0.0])
    assert np.array_equal(_presses(np.tile(x, 2), 0.9, 0.5)[[50, 99, 199, 250, 399]], [0, 1, 1, 1, 2])
    motion = touches(40)
    for shape in shapes_of("two_states", "sixth"):
        fine, told, _ = hidden("two_states", shape, motion=motion)
        ends = motion.duration_s / 40 * (np.arange(40) + 1) - 0.09
        softer = (1 - fine.at(ends) / (3 * np.interp(ends, fine.time_s, fine.reported_mm))) / told["differs"]
        states = np.round(softer)
        assert np.allclose(softer, states, atol=1e-3) and set(states) == {0.0, 1.0}
        changes = np.mean(np.diff(states) != 0)
        assert changes == 1.0 if shape == "push_push" else 0.25 < changes < 0.75
        turned = np.abs(np.diff(fine.force_N / np.where(fine.reported_mm > 0.1, 3 * fine.reported_mm, np.inf))) > 0.05
        at = fine.reported_mm[1:][turned & (fine.reported_mm[1:] > 0.2)]
        assert len(at) and np.allclose(at, told["beyond"], atol=0.01)
