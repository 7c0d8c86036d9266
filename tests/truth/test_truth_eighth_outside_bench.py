"""The eighth effects of the bench outside the catalogue: each is what its docstring says."""

import numpy as np
import pytest

from .effects.eighth_outside_bench import _slews, _tips
from .effects.registry import Samples
from .motion import Path
from .sets import SETS, shapes_of
from .test_truth_cases import CATALOGUE
from .test_truth_effects import hidden
from .test_truth_sixth_outside import touches
from .test_truth_third_outside import added

pytestmark = pytest.mark.long

MINE = ("neighbour", "interleaving", "slew_limit", "stuck_bit", "battery", "short_leg")


def test_they_are_of_the_eighth_alone():
    assert not set(MINE) & set(CATALOGUE)
    assert all(len(shapes_of(id, "eighth")) == 2 and shapes_of(id, *SETS) == shapes_of(id, "eighth") for id in MINE)


@pytest.mark.parametrize("shape", shapes_of("neighbour", "eighth"))
def test_a_station_beside(shape):
    t = np.arange(0, 300, 1e-3)
    reads = []
    for motion in (Path(-1.0).hold(300.0).motion(), Path(-1.0).hold(100.0).to(1.5, 10.0).hold(199.7).motion()):
        _, told, build = hidden("neighbour", shape, motion=motion)
        reads.append(added(build, t) / told["part"])
    # At times of its own, whatever is done here.
    assert np.allclose(reads[0][:299_000], reads[1][:299_000], atol=0.02)
    read = reads[0]
    ways = np.abs(np.diff(read)) * 1e3
    if shape == "presses":
        air = read < 1e-9
        begins = np.flatnonzero(np.diff(air.astype(int)) == -1)
        ends = np.flatnonzero(np.diff(air.astype(int)) == 1)
        ends = ends[ends > begins[0]]
        lengths, pauses = t[ends] - t[begins[: len(ends)]], t[begins[1:]] - t[ends[: len(begins) - 1]]
        assert np.all((lengths > 1.0) & (lengths < 4.65)) and np.all((pauses > 0.45) & (pauses < 2.4))
        assert np.std(lengths) > 0.5 and len(lengths) == pytest.approx(300 / 4.0, rel=0.15)
        tops = np.array([np.max(read[i:j]) for i, j in zip(begins, ends, strict=False)])
        assert np.std(tops) > 0.2 and np.all((tops > 0.12) & (tops < 1.7))
        # It goes on to two thirds, by one exponential.
        for i, j in zip(begins, ends, strict=False):
            if t[j] - t[i] > 3.0:
                parts = np.diff(read[i + 400 : i + 1701 : 400])
                assert parts[1] / parts[0] == pytest.approx(parts[2] / parts[1], rel=1e-3)
                assert 0.25 < -0.4 / np.log(parts[1] / parts[0]) < 0.85
    else:
        assert np.mean(read > 0) > 0.95
        jumps = np.flatnonzero(np.diff((ways > 1.5).astype(int)) == 1)
        # Those that are too small to tell are fewer than half.
        assert 0.4 * 300 / 2.7 < len(jumps) < 300 / 2.4 and np.std(np.diff(jumps)) > 400
        # In the mean two thirds of the middle of 0.2 and 1.7, but for the rises.
        assert np.mean(read) == pytest.approx(0.63, abs=0.12)


@pytest.mark.parametrize("shape", shapes_of("interleaving", "eighth"))
def test_converters_that_take_turns(shape):
    counts = set()
    for seed in range(12):
        _, told, build = hidden("interleaving", shape, seed=seed)
        t = np.arange(12_000) / 1000
        force = np.where(t < 6, 2.0, 0.0)
        samples = Samples(t, force + 0.5, force.copy(), 0.01)
        for _, stage in build.samples:
            stage(samples, np.random.default_rng(0))
        off = (samples.clean_N[t < 6] / 2 - 1) / told["differs"]
        # What is no force is as it was.
        assert np.all(samples.clean_N[t >= 6] == 0) and np.allclose(samples.force_N - samples.clean_N, 0.5)
        if shape == "each_sample":
            turns = next(n for n in (2, 3, 4) if np.allclose(off[n:], off[:-n]))
            counts.add(turns)
            assert np.mean(off[:turns]) == pytest.approx(0, abs=1e-9) and np.std(off[:turns]) == pytest.approx(1.0)
        else:
            assert np.allclose(np.abs(off), 1.0)
            turned = np.diff(np.flatnonzero(np.diff(off) != 0)) / 1000
            assert np.allclose(turned, turned.mean(), atol=1.1e-3) and 0.059 < turned.mean() < 0.251
    assert counts == ({2, 3, 4} if shape == "each_sample" else set())


def test_an_output_that_cannot_go_quicker():
    force, h, tau = np.concatenate([[0.0], np.full(20_000, 5.0)]), 1e-4, 2e-3
    t = h * np.arange(20_001)
    out = _slews(force, h, 50.0, 20.0, tau)
    # sinh q = sinh q_0 e^{−t/τ}, q what is left over S τ, here 50 at first.
    left = (5.0 - out) / (50.0 * tau)
    assert np.interp([0.02, 0.05], t, out) == pytest.approx([1.0, 2.5], rel=1e-9)
    wanted = 5.0 - 50.0 * tau * np.arcsinh(np.exp(50.0 - t / tau) / 2)
    assert np.allclose(out, wanted, atol=1e-9)
    late = t > 0.105
    assert np.allclose(np.log(left[late][:100]), np.log(left[late][0]) - h * np.arange(100) / tau, atol=1e-3)
    back = _slews(5 - force, h, 50.0, 20.0, tau)
    assert np.interp(0.1, t, back) == pytest.approx(5.0 - 20.0 * 0.1, rel=1e-9)
    small = _slews(force * 1e-4, h, 50.0, 50.0, tau)
    assert np.allclose(small, 5e-4 * -np.expm1(-t / tau), rtol=1e-4)
    motion = Path(0.0, np.inf).to(1.9, 500.0).hold(0.4).to(0.0, 500.0).hold(0.4).to(1.9, 4.0).motion()
    for shape, up, down in (("both_ways", 1.0, 1.0), ("slow_back", 0.5, 1.5)):
        fine, told, _ = hidden("slew_limit", shape, motion=motion)
        rate = np.diff(fine.force_N) / 1e-4
        assert np.max(rate) * up * told["full"] == pytest.approx(6.0, rel=1e-3)
        assert np.min(rate) * down * told["full"] == pytest.approx(-6.0, rel=1e-3)
        slow = fine.time_s > 0.9
        # 12 N/s for 1 % of the time of the whole.
        assert np.max(np.abs(fine.force_N - fine.cell_N)[slow]) < 12.0 * 0.01 * told["full"] * 1.05


@pytest.mark.parametrize("shape", shapes_of("stuck_bit", "eighth"))
def test_a_bit_that_is_never_set(shape):
    _, told, build = hidden("stuck_bit", shape, motion=Path(1.0).hold(200.0).motion())
    ((_, stage),) = build.plant.sensor
    force = np.linspace(0.0, 6.0, 60_001)
    if shape == "always":
        lost = (force - stage(force, force)) / told["weight"]
        assert np.allclose(lost, np.round(lost), atol=1e-9) and set(np.round(lost)) == {0.0, 1.0}
        edges = force[1:][np.abs(np.diff(lost)) > 0.5]
        assert edges[0] == pytest.approx(told["begins"], abs=2e-4) and lost[0] == 0
        assert np.allclose(np.diff(edges), told["weight"], atol=2e-4) and 0.3 <= edges[0] / told["weight"] <= 0.7
        return
    t = np.arange(0, 200, 1e-3)
    inside = told["begins"] + 0.5 * told["weight"]
    lost = inside - stage(t, np.full_like(t, inside))
    assert np.all(stage(t, np.full_like(t, inside + told["weight"])) == inside + told["weight"])
    assert set(np.round(lost / told["weight"], 9)) == {0.0, 1.0} and 0.25 < np.mean(lost > 0) / 1.0 < 0.75
    dwells = np.diff(np.flatnonzero(np.diff(lost) != 0)) / 1000
    assert 0.7 < np.mean(dwells) < 5.5 and np.std(dwells) == pytest.approx(np.mean(dwells), rel=0.4)


@pytest.mark.parametrize("shape", shapes_of("battery", "eighth"))
def test_a_battery_that_gives_way(shape):
    fine, told, _ = hidden("battery", shape, motion=Path(1.0).hold(120.0).motion())
    t, more = fine.time_s[1:], (fine.force_N[1:] / 3 - 1) / told["more"]
    rises = np.diff(more) > 1e-12
    turns = np.flatnonzero(np.diff(rises.astype(int)) != 0) + 1
    begins, ends = turns[~rises[turns - 1]], turns[rises[turns - 1]]
    ends = ends[ends > begins[0]]
    sends, pauses = t[ends] - t[begins[: len(ends)]], t[begins[1 : len(ends) + 1]] - t[ends[: len(begins) - 1]]
    assert np.allclose(sends, told["sends"], atol=3e-4) and 0.2 <= told["sends"] <= 0.5
    every = np.diff(t[begins])
    if shape == "telegrams":
        assert np.allclose(every, every[0], atol=4e-4) and 1.0 <= every[0] <= 2.5
    else:
        assert np.all((pauses > 0.29) & (pauses < 3.01)) and np.std(pauses) > 0.4
    for i, j in zip(begins[:20], ends[:20], strict=True):
        n, kept = j - i, np.exp(-np.diff(t[[i, j]])[0] / told["takes"])
        # 1 − (1 − w) e^{−s/τ} as it sends, and w e^{−s/τ} after.
        assert more[j] == pytest.approx(1 - (1 - more[i]) * kept, rel=2e-3)
        after = min(n, 2000)
        assert more[j + after] == pytest.approx(more[j] * np.exp(-1e-4 * after / told["takes"]), rel=2e-3)


def test_a_table_with_a_short_leg():
    load = np.array([0.0, 0.5, 0.2, 0.1, 0.35, 0.45, 0.1, 0.9, 0.3])
    # Tips at 0.4 and then at 0.6; back at half of each.
    assert np.array_equal(_tips(load, np.array([0.4, 0.6]), 0.5), [0, 1, 1, 0, 0, 0, 0, 2, 2])
    for shape in shapes_of("short_leg", "eighth"):
        motion = touches(40, hold_s=0.3, speed=4.0)
        fine, told, _ = hidden("short_leg", shape, motion=motion)
        period, deeper, levels = motion.duration_s / 40, [], []
        off = fine.reported_mm - fine.force_N / 3
        for k in range(40):
            inside = (fine.time_s > k * period + 0.15) & (fine.time_s < (k + 1) * period - 0.1)
            down = inside & (motion.velocity(fine.time_s) > 3.9) & (fine.reported_mm > 0.1)
            levels.append(0.5 * fine.reported_mm[down][np.flatnonzero(off[down] > 1e-6)[0]])
            deeper.append(np.interp((k + 1) * period - 0.13, fine.time_s, off))
        deeper, levels = np.array(deeper) / told["step"], np.array(levels)
        if shape == "tips":
            assert np.ptp(levels) < 2e-3 and 0.24 < levels[0] < 0.46 and np.allclose(deeper, 1.0, atol=1e-3)
        else:
            assert np.all((levels > 0.14) & (levels < 0.61)) and np.std(levels) > 0.08
            assert np.all((deeper > 0.39) & (deeper < 1.61)) and np.std(deeper) > 0.2
        # It goes back before the load is gone.
        slow = Path(-0.5).to(1.8, 4.0).hold(0.3).to(-0.1, 1.0).motion()
        fine, told, _ = hidden("short_leg", shape, motion=slow)
        off, back = fine.reported_mm - fine.force_N / 3, slow.velocity(fine.time_s) < -0.9
        tipped = fine.reported_mm[off > 1e-6][0]
        returns = fine.reported_mm[back][np.flatnonzero(np.diff(off[back]) < -1e-7)[0]]
        assert returns / tipped == pytest.approx(told["back"], rel=0.02) and 0.3 <= told["back"] <= 0.6
        at = np.flatnonzero(off > 1e-6)[0]
        near = off[at + 600] / off[at + 3000]  # within 60 ms all but a twentieth
        assert near > 0.94 and off[at + 50] < 0.6 * off[at + 3000]
