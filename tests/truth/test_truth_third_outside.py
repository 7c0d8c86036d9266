"""The later effects outside the catalogue: each is what its docstring says."""

import numpy as np
import pytest

from .effects.registry import Samples
from .effects.third_outside_bench import _fades, _steadied
from .effects.third_outside_pad import _flips, _outward
from .motion import Path
from .pad import Pad
from .sets import shapes_of
from .test_truth_effects import SPRING, hidden

pytestmark = pytest.mark.long


def added(build, t):
    samples = Samples(t, np.zeros_like(t), np.zeros_like(t), 0.01)
    for _, stage in build.samples:
        stage(samples, np.random.default_rng(0))
    return samples.clean_N


def test_knocks_come_at_random_and_die_out():
    step_s = 1e-3
    t = np.arange(0, 400, step_s)
    for shape in shapes_of("knocks", "third"):
        _, told, build = hidden("knocks", shape, motion=Path(-1.0).hold(400.0).motion())
        y = added(build, t)
        # Poles −1/τ ± i ω, or −1/τ twice: between two knocks each sample follows from the two before.
        kept, turn = np.exp(-step_s / told["lasts"]), 2 * np.pi * told.get("frequency", 0.0) * step_s
        left = y[2:] - 2 * kept * np.cos(turn) * y[1:-1] + kept**2 * y[:-2]
        hit = np.flatnonzero(np.abs(left) > 1e-4 * told["amplitude"])
        count = 1 + int(np.sum(np.diff(hit) > 3))
        wanted = 400 / told["every"]
        assert abs(count - wanted) < 4 * np.sqrt(wanted) and np.max(np.abs(y)) < 2 * told["amplitude"]


def test_a_delay_jumps_between_levels():
    t = np.arange(0, 60, 1e-3)
    _, told, build = hidden("jumping_delay", "two_routes", motion=Path(-1.0).hold(60.0).motion())
    late = t - build.delays[0](t, None)
    assert set(np.round(np.unique(np.round(late, 9)) / told["late"], 6)) == {0.0, 1.0}
    _, told, build = hidden("jumping_delay", "lost_frames", motion=Path(-1.0).hold(60.0).motion())
    late = np.round(t - build.delays[0](t, None), 9)
    steps = np.diff(late)[np.diff(late) != 0]
    # Ahead more and more, by less than one unit at a time, then back to nothing.
    assert late.max() == 0 and len(steps) > 5
    assert np.all((steps > -0.81 * told["late"]) & ((steps < 0) | np.isin(late[1:][np.diff(late) != 0], 0.0)))


def test_the_gain_drops_while_the_motor_moves():
    motion = Path(0.5).hold(1.0).to(1.5, 1.0).hold(1.0).to(0.5, 1.0).hold(1.0).motion()
    fine, told, _ = hidden("supply_droop", "quick", motion=motion)
    lost = 1 - fine.force_N[1:] / fine.cell_N[1:]
    t = fine.time_s[1:]
    assert lost.max() == pytest.approx(told["drop"]) and np.all(lost[t < 0.99] == 0)
    way_in, way_out = (lost[np.searchsorted(t, s + 0.5)] for s in (1.0, 3.0))
    assert way_in == pytest.approx(way_out, rel=1e-3)
    tail = np.interp([2.1, 2.2], t, lost)
    assert tail[1] / tail[0] == pytest.approx(np.exp(-0.1 / told["time_constant"]), rel=1e-3)
    assert _fades(np.ones(10_001), 1e-4, 0.5)[-1] == pytest.approx(1 - np.exp(-2.0), rel=1e-3)


def test_a_bench_rocks_after_each_move():
    motion = Path(0.5).hold(0.5).to(1.5, 50.0).hold(6.0).motion()
    for shape in shapes_of("rocking_bench", "third"):
        fine, told, _ = hidden("rocking_bench", shape, motion=motion)
        swing = fine.reported_mm[1:] - fine.force_N[1:] / 3.0
        t, omega = fine.time_s[1:], 2 * np.pi * told["frequency"]
        assert np.max(np.abs(swing)) == pytest.approx(told["amplitude"], rel=1e-6)
        assert np.allclose(swing[t < 0.49], 0.0, atol=1e-9)
        rest = t > 0.6
        t, decayed = t[rest], swing[rest] * np.exp(told["damping_ratio"] * omega * (t[rest] - 0.6))
        damped = omega * np.sqrt(1 - told["damping_ratio"] ** 2)
        waves = np.stack([np.sin(damped * t), np.cos(damped * t)], axis=1)
        off = decayed - waves @ np.linalg.lstsq(waves, decayed, rcond=None)[0]
        # One way: a damped sine of that frequency and no more.
        alone = np.max(np.abs(off)) < 1e-3 * told["amplitude"]
        assert alone == (shape == "one_way") and np.max(np.abs(decayed)) > 0.5 * told["amplitude"]


def test_a_display_is_calm_within_its_band():
    force = np.concatenate([np.zeros(100), np.full(20_000, 0.5), np.full(20_000, 5.0)])
    shown = _steadied(force, 1e-4, 1.0, 2.0, 0.005, False)
    assert shown[20_000] == pytest.approx(0.5 * -np.expm1(-1.99 / 2.0), rel=1e-3)
    # Out of the band at once, down to where the band begins, then slowly.
    assert 3.99 < shown[20_200 + 100] < 4.1 and shown[-1] < 4.8
    latched = _steadied(force, 1e-4, 1.0, 2.0, 0.005, True)
    assert set(latched) == {0.0, 5.0}


@pytest.mark.long
def test_a_zero_that_comes_back():
    t = np.arange(0, 1500, 0.05)
    for shape, near in (("reverting", 0.12), ("flicker", 0.3)):
        _, told, build = hidden("wandering_zero", shape, motion=Path(-1.0).hold(1500.0).motion())
        path = added(build, t)
        assert np.std(path) == pytest.approx(told["deviation"], rel=near)
        line = np.polyval(np.polyfit(t, path, 1), t)
        assert np.std(path - line) > 0.9 * np.std(path)  # no drift


def test_a_dome_snaps_at_two_depths():
    depth = np.concatenate([np.linspace(0, 2, 20_001), np.linspace(2, 0, 20_001), np.linspace(0, 1, 10_001)])
    on = _flips(depth, 1e-4, 1.4, 0.8, 0.001)
    first, last = (np.flatnonzero(on > 0.5)[k] for k in (0, -1))
    assert depth[first] == pytest.approx(1.4, abs=1e-3) and depth[last] == pytest.approx(0.8, abs=1e-3)
    assert last > 30_000 and np.all(on[-5_000:] < 1e-3)  # 1 mm from above 0.8 mm is not enough
    fine, told, _ = hidden("snap_through", "dome", motion=Path(-0.2).to(2.0, 2.0).hold(0.1).to(-0.2, 2.0).motion())
    between = 0.5 * (told["goes"] + told["returns"])
    x, half = fine.reported_mm, np.argmax(fine.reported_mm)
    up, down = np.interp(between, x[:half], fine.force_N[:half]), np.interp(-between, -x[half:], fine.force_N[half:])
    assert up == pytest.approx(3 * between, rel=1e-6) and up - down == pytest.approx(told["drop"], rel=1e-3)


def test_curing_goes_by_the_clock():
    fine, told, build = hidden("curing", "sets", motion=Path(1.0).hold(40.0).motion())
    kept = fine.force_N[1:] / 3.0 - 1
    slope = np.diff(np.log(told["growth"] - kept[::10_000]))
    assert np.ptp(slope) < 1e-6 and slope[0] < 0 and kept[0] == pytest.approx(0, abs=1e-4)
    fine, told, build = hidden("curing", "gels", motion=Path(1.0).hold(40.0).motion())
    kept = fine.force_N[1:] / 3.0 - 1
    assert kept[0] < 0.01 * told["growth"] and kept[-1] > 0.95 * told["growth"] and np.all(np.diff(kept) >= 0)


def test_recovery_has_rates_of_its_own():
    x = np.concatenate([np.linspace(0, 2, 101), np.linspace(2, 1, 101), np.full(50, 1.0), np.linspace(1, 2, 101)])
    out = _outward(x, 0.05)
    assert np.all(out[:101] == 0) and np.all(out[108:252] == 1) and np.all(out[260:] == 0)
    pad = Pad(SPRING.law, (0.4,), (2.0,))
    motion = Path(0.0, np.inf).to(2.0, 1e4).hold(2.0).to(1.0, 1e4).hold(2.0).motion()
    for shape in shapes_of("one_way_relaxation", "third"):
        fine, told, _ = hidden("one_way_relaxation", shape, pad=pad, motion=motion)
        ins, outs = (np.abs(np.interp(s + np.array([0.3, 0.8]), fine.time_s, fine.force_N) - 3 * level * 0.6)
                     for s, level in ((0.0, 2.0), (2.0, 1.0)))  # fmt: skip
        assert -np.log(ins[1] / ins[0]) / 0.5 == pytest.approx(2.0, rel=1e-2)
        assert -np.log(outs[1] / outs[0]) / 0.5 == pytest.approx(2.0 * told["factor"], rel=2e-2)


def test_a_pulse_beats_without_being_even():
    for shape, most in (("heart", 1.0), ("breath", 1.2)):
        fine, told, _ = hidden("pulse", shape, motion=Path(1.0).hold(60.0).motion())
        lifted = fine.force_N[1:] / 3.0 - 1.0
        assert lifted.min() >= -1e-9 and 0.8 * told["amplitude"] < lifted.max() < 1.01 * most * told["amplitude"]
        low = np.flatnonzero(lifted < 1e-2 * told["amplitude"])
        beats = np.diff(fine.time_s[1:][low[np.flatnonzero(np.diff(low, prepend=-9) > 1)]])
        beats = beats[beats > 0.3 * told["period"]]
        assert np.mean(beats) == pytest.approx(told["period"], rel=0.1) and np.std(beats) > 0.02 * told["period"]


def test_a_bubble_gives_way_once():
    motion = Path(-0.5).to(1.8, 20.0).hold(20.0).to(1.2, 20.0).hold(20.0).motion()
    for shape in shapes_of("collapse", "third"):
        fine, told, _ = hidden("collapse", shape, motion=motion)
        sunk = fine.reported_mm - fine.force_N / 3.0
        inside = fine.reported_mm > 0.2
        t, sunk = fine.time_s[inside], sunk[inside]
        begins = t[np.argmax(sunk > 0.5 * told["sinks"])]
        assert 5 < begins < 35 and np.all(np.abs(sunk[t < begins - 0.1]) < 1e-9)
        assert sunk.max() == pytest.approx(told["sinks"], rel=0.03)
        assert sunk[-2] > 0.999 * told["sinks"] if shape == "bubble" else sunk[-2] < 0.7 * told["sinks"]
