"""Effects of the bench outside the catalogue: each is what its docstring says."""

import numpy as np
import pytest

from .effects.judge_outside_bench import charges, climbed, heaps, ridges, switched
from .motion import Path
from .sets import SETS, shapes_of
from .test_truth_cases import CATALOGUE
from .test_truth_effects import hidden
from .test_truth_ninth_outside_bench import through
from .test_truth_third_outside import added

MINE = ("barkhausen", "setpoints", "photons", "grease", "triboelectric")
UP_DOWN = np.concatenate([np.linspace(0.0, 7.0, 70_001), np.linspace(7.0, 0.0, 70_001)[1:]])


def test_they_are_of_the_judge_alone():
    assert not set(MINE) & set(CATALOGUE)
    assert all(len(shapes_of(id, "judge")) == 2 and shapes_of(id, *SETS) == shapes_of(id, "judge") for id in MINE)


@pytest.mark.parametrize("seed", range(3))
def test_walls_that_are_pinned(seed):
    rng, step = np.random.default_rng(seed), 0.01
    places = step * np.arange(-100, 901)
    ground = 0.1 * np.cumsum(rng.standard_normal(1001)) * np.sqrt(step / 0.2)
    ground -= ground[100]
    got = climbed(UP_DOWN[:140_001:7], -1.0, step, ground)
    # Up it is at the first place where y + W(y) is as much as F, and down from the top at the first from above.
    force, whole = UP_DOWN[:140_001:7], places + ground
    half = len(force) // 2
    up = np.maximum.accumulate(whole[100:])
    at = places[100 + np.searchsorted(up, force[: half + 1])]
    assert np.all((got[: half + 1] <= at + 1e-9) & (got[: half + 1] >= at - step - 1e-9))
    top = int(np.ceil((got[half] + 1.0) / step))
    down = np.minimum.accumulate(whole[top::-1])
    at = places[top - np.searchsorted(-down, -force[half + 5 :])]
    assert np.all((got[half + 5 :] >= at - 1e-9) & (got[half + 5 :] <= at + step + 1e-9))
    assert np.allclose(got + np.interp(got, places, ground), force, atol=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_a_cell_of_pinned_walls(seed):
    _, told, build = hidden("barkhausen", "walls", seed=seed)
    assert np.all(through(build, np.zeros(1000)) == 0) and 0.03 <= told["over"] / 6 <= 0.08
    out = through(build, UP_DOWN)
    up, down = out[:70_001], out[70_000:][::-1]
    # It goes up as it is pushed and never back, lies lower on the way up, and jumps.
    assert np.all(np.diff(up) >= 0) and np.all(np.diff(down) >= 0) and np.all(up <= down + 1e-9)
    assert np.max(np.diff(up)) > 50 * np.median(np.diff(up)) and np.mean(down - up) > 0.15 * told["pinned"]
    assert 0.4 < np.std(up - UP_DOWN[:70_001]) / told["pinned"] < 1.8
    # At rest nothing moves, and the third time is as the second.
    assert np.ptp(through(build, np.full(50, 3.0))) < 1e-9
    again = through(build, np.tile(UP_DOWN[::10], 3)).reshape(3, -1)
    assert np.allclose(again[2], again[1], atol=1e-9)


def test_switches():
    force = np.array([0.0, 1.0, 2.0, 1.5, 0.9, 0.5, 1.2, 3.0])
    # The first on from 1 and off below 0.6; the second on from 2 and off below 1.
    out = switched(force, np.array([1.0, 2.0]), np.array([0.6, 1.0]), np.array([1.0, -3.0]))
    assert list(out) == [0.0, 1.0, -2.0, -2.0, 1.0, 0.0, 1.0, -2.0]


@pytest.mark.parametrize("seed", range(3))
def test_a_cell_of_switches(seed):
    _, told, build = hidden("barkhausen", "switches", seed=seed)
    off = (through(build, UP_DOWN) - UP_DOWN) / told["pinned"]
    jumps = np.flatnonzero(np.abs(np.diff(off)) > 1e-6)
    sizes, where = np.diff(off)[jumps], UP_DOWN[jumps + 1]
    on = jumps < 70_000
    assert np.sum(on) == 16 and np.sum(~on) == 16 and off[0] == off[-1] == 0
    assert np.sum(sizes[on] > 0) == 8 and np.all((np.abs(sizes) > 0.249) & (np.abs(sizes) < 0.751))
    assert np.all((where[on] >= 0.6 - 1e-3) & (where[on] <= 6.0 + 1e-3))
    for size, at in zip(sizes[on], where[on], strict=True):
        back = where[~on][np.argmin(np.abs(sizes[~on] + size))]
        assert 0.399 <= back / at <= 0.801


@pytest.mark.parametrize("seed", range(3))
def test_a_drive_that_reckons_on(seed):
    _, told, build = hidden("setpoints", "dead_reckoning", seed=seed)
    ((stage,), every, h) = (build.plant.play, told["every"], 1e-5)
    t = h * np.arange(20_000)
    assert 4e-3 <= every <= 6.26e-3 and np.allclose(stage(t, 3 * t)[1300:], 3 * t[1300:])
    # Of t² what is made up from the last two lacks T² (p + p²), p of the time from one to the next.
    lacks = (t**2 - stage(t, t**2))[2000:] / every**2
    assert np.all(lacks > -1e-6) and np.max(lacks) == pytest.approx(2.0, abs=0.02)
    assert np.mean(lacks) == pytest.approx(1 / 2 + 1 / 3, abs=0.03)
    # It goes on after a stop, up to v T, and is right from the second on.
    x = 60.0 * np.minimum(t, 0.1)
    off = stage(t, x) - x
    beyond = np.flatnonzero(np.abs(off[2000:]) > 1e-9) * h + 0.02 - 0.1
    assert 0.5 * 60 * every <= np.max(off) <= 60 * every + 1e-9 and np.min(off[2000:]) > -1e-9
    assert beyond[0] >= -1.1 * h and every - 2 * h <= beyond[-1] <= 2 * every


@pytest.mark.parametrize("seed", range(3))
def test_a_drive_that_goes_by_a_curve(seed):
    _, told, build = hidden("setpoints", "cubic", seed=seed)
    ((stage,), every, h) = (build.plant.play, told["every"], 1e-5)
    t = h * np.arange(40_000)
    middle = slice(6000, -12_000)
    assert 16e-3 <= every <= 25.1e-3 and np.allclose(stage(t, t**2)[middle], t[middle] ** 2, atol=1e-8)
    # Slopes from both sides are T² too much for t³: p (1 − p)(1 − 2 p) T³, √3/18 of that at the most.
    off = (stage(t, t**3) - t**3)[middle] / every**3
    assert np.max(off) == pytest.approx(np.sqrt(3) / 18, rel=0.02) and np.min(off) == pytest.approx(
        -np.max(off), rel=1e-3
    )
    # A corner is felt before it as well as after, by two of them.
    x = 60.0 * np.maximum(t - 0.2, 0.0)
    off = stage(t, x) - x
    felt = t[np.abs(off) > 1e-7] - 0.2
    felt = felt[felt < 0.1]
    assert -2 * every <= felt[0] < -0.2 * every and 0.2 * every < felt[-1] <= 2 * every and np.min(off) < -1e-3


@pytest.mark.parametrize("shape", shapes_of("photons", "judge"))
@pytest.mark.parametrize("seed", range(3))
def test_noise_of_light(shape, seed):
    _, told, build = hidden("photons", shape, motion=Path(1.0).hold(60.0).motion(), seed=seed)
    assert np.all(through(build, np.full(1000, -0.5)) == -0.5) and np.all(through(build, np.zeros(1000)) == 0)
    offs = [(through(build, np.full(300_000, 6.0 * p), 2e-4) - 6.0 * p) / told["amplitude"] for p in (0.1, 0.4, 0.9)]
    wanted = np.sqrt([0.1, 0.4, 0.9])
    if shape == "parted":
        wanted = 2 * np.sqrt(np.array([0.1 * 1.0, 0.4 * 0.7, 0.9 * 0.2])) / 1.1
    # One noise, weighed by what comes in.
    for off, most in zip(offs, wanted, strict=True):
        assert np.allclose(off / most, offs[0] / wanted[0], atol=1e-9)
        assert np.std(off) == pytest.approx(most, rel=0.1)
    later = np.mean(offs[0][25:] * offs[0][:-25]) / np.var(offs[0])
    assert later == pytest.approx(np.exp(-0.005 / told["time"]), abs=0.05) and 0.008 <= told["time"] <= 0.025


def test_ridges_where_it_turned():
    step, wide, keeps = 1e-4, 0.05, 0.4
    x = np.concatenate([np.arange(0, 1, step), np.arange(1, 0, -step), np.arange(0, 1.6, step), np.full(50, 1.6)])
    out = ridges(x, wide, keeps)
    assert np.all(out[: round(1 / step)] == 0) and out[round(1 / step) + 2] == pytest.approx(-1, abs=0.01)
    # The work of a pass, ∫ h b dx with h' = −h b/e, is (h − h k) e, e = w √(2π)/ln 1/k; half a pass leaves √k.
    wears = wide * np.sqrt(2 * np.pi) / np.log(1 / keeps)
    back = slice(round(1 / step), round(1.5 / step))
    assert -np.sum(out[back]) * step == pytest.approx((1 - np.sqrt(keeps)) * wears, rel=0.01)
    over = slice(round(2.5 / step), round(3.5 / step))
    assert np.sum(out[over]) * step == pytest.approx((1 - keeps) * np.sqrt(keeps) * wears, rel=0.01)
    # Another one at the turn at 0, and nothing between.
    assert np.sum(out[round(2.0 / step) : round(2.4 / step)]) * step == pytest.approx(
        (1 - np.sqrt(keeps)) * wears, rel=0.02
    )
    assert np.all(out[-1000:] == 0) and np.all(np.abs(out) <= 1)
    # What it holds stays where it stands.
    rests = ridges(np.concatenate([x[:-2000], np.full(500, 1.03)]), wide, keeps)
    assert np.ptp(rests[-499:]) == 0


def test_heaps_that_are_pushed():
    h, over, flows, rests = 1e-3, 0.1, 0.2, 0.8
    forth, back = np.arange(0, 1.0, 0.002), np.arange(1.0, 0.4, -0.002)
    x = np.concatenate([forth, np.full(1001, 1.0), back, np.full(500, 0.4), np.arange(0.4, 1.2, 0.002)])
    out = heaps(x, h, over, flows, rests)
    assert np.allclose(out[:500], 1 - np.exp(-forth / over), atol=1e-9)
    s = h * np.arange(1, 1001)
    assert np.allclose(out[501:1501], -np.expm1(-1.0 / over) * np.exp(-s / rests), rtol=2e-3)
    # Nothing on the way back; the heap comes after it by 0.2 mm/s, and is met there.
    assert np.all(out[1502:2301] == 0)
    meets = 2301 + np.argmax(out[2301:] > 0)
    assert x[meets] == pytest.approx(1.0 - flows * h * (meets - 1501), abs=0.004)
    assert np.all(np.diff(out[meets:]) > 0)
    # On the other side alike.
    assert np.allclose(heaps(-x, h, over, flows, rests), -out)


@pytest.mark.parametrize("seed", range(3))
def test_grease_that_is_pushed_about(seed):
    motion = Path(-0.5, np.inf).hold(1.0).to(1.5, 20.0).hold(1.0).to(0.0, 20.0).hold(1.0).to(1.6, 20.0).hold(0.5)
    _, told, build = hidden("grease", "heaps", motion=motion.motion(), seed=seed)
    t = 1e-3 * np.arange(4600)
    read = added(build, t) / told["held"]
    assert np.all(read[:1000] == 0) and np.max(np.abs(read)) <= 1 and read[1100] == pytest.approx(1.0, abs=1e-3)
    over = -0.1 / np.log(1 - np.interp(1.005, t, read))
    rests = -0.5 / np.log(np.interp(1.7, t, read) / np.interp(1.2, t, read))
    assert 0.048 <= over <= 0.155 and 0.49 <= rests <= 2.02 and 0.1 <= told["flows"] <= 0.4
    _, told, build = hidden("grease", "ridges", motion=motion.motion(), seed=seed)
    read = added(build, t) / told["held"]
    x = motion.motion().position(t)
    assert np.all(read[:2100] == 0) and 0.04 <= told["wide"] <= 0.1
    # On its way back from the first turn, at the second, and where it goes over the first.
    again = (t > 3.2) & (x > 1.5 - told["wide"]) & (x < 1.5)
    assert np.min(read[2101:2110]) < -0.3 and np.max(read[3170:3200]) > 0.3 and np.max(read[again]) > 0.2
    assert np.all(np.abs(read[(x > 0.7) & (x < 0.8)]) < 1e-6)


def test_charges_that_show_as_they_part():
    h, tau = 1e-3, 0.5
    force = np.concatenate([np.zeros(100), np.full(300, 3.0), np.zeros(400), np.full(200, 6.0), np.zeros(400)])
    s = h * np.arange(1, 401)
    by_load = charges(force, h, 0.1, tau, 0.0, 6.0)
    assert np.all(by_load[:400] == 0) and np.all(by_load[800:1000] == 0)
    assert np.allclose(by_load[400:800], 0.5 * np.exp(-s / tau))
    # The second brings 1 to what is left of the first after 0.6 s.
    assert np.allclose(by_load[1000:], (1 + 0.5 * np.exp(-0.6 / tau)) * np.exp(-s / tau))
    by_count = charges(force, h, 0.1, tau, 0.4, 6.0)
    left = 0.4 * np.exp(-0.6 / tau)
    assert np.allclose(by_count[400:800], 0.4 * np.exp(-s / tau))
    assert np.allclose(by_count[1000:], (left + 0.4 * (1 - left)) * np.exp(-s / tau))
    # What hardly touches is none.
    assert np.all(charges(np.where(force > 0, 0.09, 0.0), h, 0.1, tau, 0.0, 6.0) == 0)


@pytest.mark.parametrize("seed", range(3))
def test_leads_that_are_charged(seed):
    pulse = np.concatenate([np.full(2000, 6.0), np.zeros(2000), np.full(2000, 3.0), np.zeros(2000)])
    for shape, times in (("by_load", (0.3, 1.0)), ("by_count", (4.0, 12.0))):
        _, told, build = hidden("triboelectric", shape, seed=seed)
        off = (through(build, pulse) - pulse) / told["amplitude"]
        side = np.sign(off[2100])
        tau = -0.1 / np.log(off[3100] / off[2100])
        assert np.all(off[pulse > 0] == 0) and times[0] <= tau <= times[1]
        first, second = side * off[2000], side * off[6000]
        left = first * np.exp(-0.4 / tau)
        if shape == "by_load":
            assert first == pytest.approx(1.0, abs=1e-3) and second == pytest.approx(left + 0.5, abs=1e-3)
        else:
            assert 0.399 <= first <= 0.701 and second == pytest.approx(left + first * (1 - left), abs=1e-3)
