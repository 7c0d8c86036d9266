"""The seventh effects outside the catalogue: each is what its docstring says."""

import numpy as np
import pytest

from .effects.seventh_outside_pad import _roused
from .motion import Path
from .sets import SETS, outside, shapes_of
from .test_truth_cases import CATALOGUE
from .test_truth_effects import hidden
from .test_truth_sixth_outside import touches
from .test_truth_third_outside import added

pytestmark = pytest.mark.long


def test_they_are_of_the_bench_or_of_the_pad():
    mine = outside(CATALOGUE, "seventh")
    assert len(mine) == 11 and all(shapes_of(id, *SETS) == shapes_of(id, "seventh") for id in mine)


def test_a_spring_beside_the_pad():
    motion = Path(-1.0).hold(1.0).to(2.0, 1.5).hold(20.0).motion()
    t = np.arange(0, 24.0, 1e-3)
    for seed in range(3):
        _, told, build = hidden("guide_spring", "flexure", motion=motion, seed=seed)
        way, spring = (motion.position(t) + 1.0) / 2.0, added(build, t) / told["spring"]
        moved = way > 0.01
        parts = (np.abs(spring[moved]) / way[moved] - 1) / way[moved] ** 2
        assert np.ptp(parts) < 1e-6 and 0.5 <= parts[0] <= 1.5 and np.all(spring[~moved] ** 2 < 2e-4)
        _, told, build = hidden("guide_spring", "gaiter", motion=motion, seed=seed)
        spring = added(build, t) / (2 * told["spring"])
        # At rest it goes to two fifths, by one exponential.
        assert spring[-1] == pytest.approx(0.4 * 1.5, abs=0.02) and np.all(spring[t < 1] == 0)
        left = np.interp([5.0, 6.0, 7.0], t, spring) - 0.6
        tau = -1 / np.log(left[1:] / left[:-1])
        assert tau[0] == pytest.approx(tau[1], rel=1e-2) and 0.99 <= tau[0] <= 4.01


@pytest.mark.parametrize("shape", shapes_of("shunt_marks", "seventh"))
def test_marks_of_a_shunt(shape):
    t = np.arange(0, 60, 1e-3)
    for motion in (Path(-1.0).hold(60.0).motion(), Path(1.0).hold(60.0).motion()):
        _, told, build = hidden("shunt_marks", shape, motion=motion)
        marks = added(build, t) / told["step"]
        levels = {0.0, 1.0} if shape == "one_way" else {-1.0, 0.0, 1.0}
        begins, ends = (np.flatnonzero(np.diff((marks == 1).astype(int)) == side) for side in (1, -1))
        assert set(np.round(marks, 9)) == levels and np.allclose(np.diff(t[begins]), told["every"], atol=2e-3)
        assert np.allclose(t[ends[-5:]] - t[begins[-5:]], told["lasts"], atol=2e-3) and 0.25 <= told["lasts"] <= 0.5
        if shape == "both_ways":
            assert abs(np.mean(marks)) < 0.02 and np.all(marks[ends + 1] == -1)


def test_heat_of_a_touch():
    t, zeros = np.arange(0, 59.9, 1e-3), []
    for depth in (0.3, 2.0):
        motion = Path(-0.01, np.inf).to(depth, 100.0).hold(30.0).to(-0.01, 100.0).hold(30.0).motion()
        for shape in shapes_of("touch_heat", "seventh"):
            _, told, build = hidden("touch_heat", shape, motion=motion)
            zeros.append(added(build, t) / told["zero"])
            # As it grows in contact, so it fades in air.
            meets, leaves = np.flatnonzero(np.diff((motion.position(t) > 0).astype(int)) != 0)
            grown, faded = zeros[-1][meets : meets + 25_000 : 1000], zeros[-1][leaves : leaves + 25_000 : 1000]
            assert np.allclose(grown / zeros[-1][leaves], 1 - faded / zeros[-1][leaves], atol=0.01)
            tau = told["time_constant"]
            times = np.array([0.5, 1.0]) * tau + 1e-3
            wanted = -np.expm1(-np.array([0.5, 1.0]))
            if shape == "two_bodies":
                wanted = (wanted - np.expm1(-np.array([2.5, 5.0]))) / 2
            assert np.interp(times, t, zeros[-1]) == pytest.approx(wanted, abs=5e-3)
    # However deep.
    assert np.allclose(zeros[0], zeros[2], atol=0.03) and np.allclose(zeros[1][:30_000], zeros[3][:30_000], atol=1e-6)


@pytest.mark.parametrize("shape", shapes_of("coarse_codes", "seventh"))
def test_few_codes(shape):
    _, told, build = hidden("coarse_codes", shape)
    ((_, stage),) = build.plant.sensor
    force = np.linspace(-6.0, 6.0, 240_001)
    read = stage(force, force)
    assert read[120_000] == 0 and np.allclose(read, -read[::-1]) and np.all(np.diff(read) >= 0)
    codes = np.unique(np.round(read[read > 1e-9], 9))
    if shape == "logarithm":
        # Even by the logarithm, and as wide as is said at two fifths of 7.2 N.
        steps = np.diff(np.log1p(255 * codes / 7.2))
        assert np.allclose(steps, 2.5 * told["width"], rtol=1e-6)
        near = np.abs(codes - 0.4 * 7.2).argmin()
        assert (codes[near + 1] - codes[near - 1]) / 2 == pytest.approx(7.2 * told["width"], rel=0.3)
    else:
        edges = np.append(force[1:][(np.diff(read) > 0) & (force[1:] > 0)], np.nan)
        widths = np.diff(edges)[:-1] / 7.2 / told["width"]
        assert np.all((widths > 0.29) & (widths < 1.71)) and np.std(widths) > 0.2
        middles = (edges[1:] + edges[:-1])[:-1] / 2
        assert np.allclose(codes[: len(middles)], middles, atol=1e-4)
    assert np.max(np.abs(read - force)) < 1.3 * 7.2 * told["width"]


@pytest.mark.parametrize("shape", shapes_of("fringes", "seventh"))
def test_fringes_of_light(shape):
    _, told, build = hidden("fringes", shape)
    ((_, stage),) = build.plant.sensor
    t, wave = np.arange(0, 15, 1e-3), told["wave"]
    assert 3 <= 6.0 / wave <= 5 and np.all(stage(t, np.zeros_like(t)) == 0)
    # A sine of the force, at any one time; from two of its places follows its phase.
    parts = [(stage(t, np.full_like(t, share * wave)) - share * wave) / told["amplitude"] for share in (0.25, 0.5)]
    sine = -parts[1] / 2
    cosine = parts[0] + sine
    assert np.allclose(sine**2 + cosine**2, 1.0) and np.allclose(stage(t, np.full_like(t, wave)), wave)
    phase = np.unwrap(np.arctan2(sine, cosine))
    if shape == "drift":
        assert np.ptp(np.diff(phase)) < 1e-6 and 15 <= 2 * np.pi / (phase[1000] - phase[0]) <= 40
    else:
        assert 0.5 < np.std(phase) < 3.0 and np.max(np.abs(np.diff(phase, 1))) < 0.5


@pytest.mark.parametrize("shape", shapes_of("drive_noise", "seventh"))
def test_noise_of_a_drive(shape):
    path = Path(-1.0).hold(5.0)
    for _ in range(6):
        path.to(1.0, 1.0).to(-1.0, 1.0).hold(0.5)
    for _ in range(40):
        path.to(1.0, 16.0).to(-1.0, 16.0).hold(0.05)
    motion = path.motion()
    t = np.arange(0, motion.duration_s, 1e-3)
    _, told, build = hidden("drive_noise", shape, motion=motion)
    noise, v = added(build, t) / told["deviation"], np.abs(motion.velocity(t))
    slow, quick = noise[np.abs(v - 1.0) < 1e-6], noise[np.abs(v - 16.0) < 1e-6]
    assert np.all(noise[v == 0] == 0) and np.std(quick) == pytest.approx(1.5 if shape == "by_speed" else 1.0, rel=0.1)
    ratio = np.std(quick) / np.std(slow)
    assert ratio == pytest.approx(4.0 if shape == "by_speed" else 1.0, rel=0.1)
    # Forgotten within 12 ms, and not from one sample to the next.
    assert np.exp(-1 / 3.5) < np.mean(slow[1:] * slow[:-1]) / np.var(slow) < np.exp(-1 / 14)
    assert abs(np.mean(slow[60:] * slow[:-60])) < 0.1 * np.var(slow)


def test_a_muscle_that_is_roused():
    depth = np.tile(np.concatenate([np.zeros(1000), np.ones(1000)]), 3)
    level = _roused(depth, 1e-4, 0.5, 0.4, 1.0)
    kept = np.exp(-0.1999)
    assert level[999] == 0 and level[1000] == 0.4 and level[2999] == pytest.approx(0.4 * kept, rel=1e-3)
    assert level[3000] == pytest.approx(0.4 + 0.6 * 0.4 * kept, rel=1e-3)
    assert np.all(_roused(0.4 * depth, 1e-4, 0.5, 0.4, 1.0) == 0)
    for shape, side in (("strengthens", 1), ("tires", -1)):
        ends = []
        for depth_mm in (0.8, 1.6):
            motion = touches(12, depth=depth_mm)
            fine, told, _ = hidden("staircase", shape, motion=motion)
            at = motion.duration_s / 12 * (np.arange(12) + 1) - 0.08
            ends.append((fine.at(at) / (3 * np.interp(at, fine.time_s, fine.reported_mm)) - 1) * side / told["more"])
        first, last = ends[1][0], ends[1][-1]
        assert first == pytest.approx(told["step"], rel=0.08) and np.all(np.diff(ends[1]) > 0)
        period = motion.duration_s / 12
        kept = np.exp(-period / told["fades"])
        # Where as much is forgotten as is added.
        assert last == pytest.approx(told["step"] / (1 - (1 - told["step"]) * kept), rel=0.1)
        if shape == "tires":
            assert np.all(np.abs(ends[0]) < 1e-9)
        else:
            assert ends[0][0] == pytest.approx(first, rel=0.04)


@pytest.mark.parametrize("shape", shapes_of("loose_fill", "seventh"))
def test_a_filling_that_lies_otherwise(shape):
    motion = touches(120, depth=1.9, hold_s=0.02, air_s=0.02)
    fine, told, _ = hidden("loose_fill", shape, motion=motion)
    depths, period, rows = np.linspace(0.3, 1.7, 15), motion.duration_s / 120, []
    for k in range(120):
        some = (fine.time_s > k * period) & (fine.time_s < k * period + 0.1195) & (fine.reported_mm > 0.05)
        x = fine.reported_mm[some]
        rows.append(np.interp(depths, x, fine.force_N[some] / (3 * x)) - 1)
    waves = np.stack([np.sin((j + 1) * np.pi * depths / 2 + j) for j in range(3)], axis=1)
    parts, left, *_ = np.linalg.lstsq(waves, np.array(rows).T, rcond=None)
    assert np.max(left) < 1e-6
    assert np.std(parts, axis=1) == pytest.approx(told["deviation"] * np.ones(3), rel=0.3)
    follows = np.mean(parts[:, 1:] * parts[:, :-1]) / np.mean(parts**2)
    assert follows == pytest.approx(0.6 if shape == "bit_by_bit" else 0.0, abs=0.16)


@pytest.mark.parametrize("shape", shapes_of("clonus", "seventh"))
def test_a_muscle_that_beats(shape):
    path = Path(-0.5)
    for _ in range(12):
        path.to(1.5, 60.0).hold(2.5).to(-0.5, 60.0).hold(0.2).to(1.5, 5.0).hold(1.0).to(-0.5, 60.0).hold(0.2)
    motion = path.motion()
    fine, told, _ = hidden("clonus", shape, motion=motion)
    period, much = motion.duration_s / 12, []
    for k in range(12):
        begin = k * period + 0.5 / 60  # as it comes to the surface
        since = np.arange(0.06, 2.4, 1e-4)
        beats = fine.at(begin + since) / 4.5 - 1
        quiet = fine.at(k * period + 3.2 + np.arange(0, 0.6, 0.01)) / 4.5 - 1
        # A slow press calls for none; what is left of the last is e^{−3/0.8} at most.
        assert np.max(np.abs(quiet)) < (0.035 * told["amplitude"] if shape == "dies_down" else 1e-9)
        s = since - told["late"] - 0.006  # it is quick from 6 ms on or so, as it gathers speed
        wave = beats * np.exp(-2j * np.pi * told["frequency"] * s)
        soon = (s > 0) & (s < 1 / told["frequency"])
        much.append(2 * np.abs(np.mean(wave[soon])) / told["amplitude"])
        level = np.max(np.abs(beats[since > 1.7]))
        assert level < 0.15 * told["amplitude"]
        if shape == "holds_on":
            lasts = since[np.flatnonzero(np.abs(beats) > 1e-9)[-1]] - told["late"]
            assert 0.35 < lasts < 1.55
            much[-1] /= 0.6 if lasts > 0.25 else np.nan
    assert np.nanmin(much) > 0.3 and np.nanmax(much) < 1.5 and np.nanstd(much) > 0.08
    assert 5 <= told["frequency"] <= 7 and 0.04 <= told["late"] <= 0.08


def test_a_front_that_goes_in():
    for shape, side in (("hardens", 1), ("thaws", -1)):
        for depth in (0.05, 1.5):
            fine, told, _ = hidden("front", shape, motion=Path(depth).hold(40.0).motion())
            t = np.array([5.0, 10.0, 20.0, 39.0])
            share = (fine.at(t) / (3 * depth) - 1) * side / told["more"]
            layer = told["whole"] * np.sqrt(t / 40.0)
            assert share == pytest.approx(np.minimum(layer / depth, 1.0), rel=1e-3)
        assert 1.0 <= told["whole"] <= 2.0


@pytest.mark.parametrize("shape", shapes_of("air_mattress", "seventh"))
def test_a_mattress_of_air(shape):
    motion = Path(-0.5).to(1.0, 50.0).hold(60.0).motion()
    fine, told, _ = hidden("air_mattress", shape, motion=motion)
    t = np.arange(0.1, 60, 0.01)
    wave = (fine.at(t) / 3.0 - 1) / told["swing"]
    steps = np.diff(wave) / 0.01
    if shape == "by_turns":
        turns = t[1:][np.diff(np.sign(wave)) != 0]
        halves = np.diff(turns)
        assert np.allclose(halves, halves.mean(), atol=0.03) and 2.0 <= halves.mean() <= 4.5
        changing = np.mean(np.abs(wave) < 1 - 1e-6)
        assert 2 * 0.095 < changing < 2 * 0.21 and np.max(np.abs(wave)) == pytest.approx(1.0, abs=1e-6)
    else:
        assert np.max(np.abs(wave)) <= 1.4 + 1e-6
        filled = steps > 0.5
        begins = np.flatnonzero(np.diff(filled.astype(int)) == 1)
        lengths = np.diff(t[begins])
        assert np.all((lengths > 2.2) & (lengths < 6.4)) and np.std(lengths) > 0.4
        assert np.mean(steps[~filled] < 0) > 0.99 and np.max(steps) == pytest.approx(2.8 / 0.3, rel=0.01)
