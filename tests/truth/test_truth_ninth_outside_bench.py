"""Effects of the bench outside the catalogue: each is what its docstring says."""

import numpy as np
import pytest

from .effects.ninth_outside_bench import _coded, haar_kept
from .motion import Path
from .sets import SETS, shapes_of
from .test_truth_cases import CATALOGUE
from .test_truth_effects import hidden
from .test_truth_third_outside import added

pytestmark = pytest.mark.long

MINE = ("idle_tones", "lossy_codec", "delta_code", "concealment", "railway")


def test_they_are_of_the_ninth_alone():
    assert not set(MINE) & set(CATALOGUE)
    assert all(len(shapes_of(id, "ninth")) == 2 and shapes_of(id, *SETS) == shapes_of(id, "ninth") for id in MINE)


def through(build, force, h=1e-4):
    """What the sensor makes of a force."""
    ((_, stage),) = build.plant.sensor
    return stage(h * np.arange(len(force)), force)


def frequency(off, h=1e-4):
    """Of a tone, by its upward passages, Hz."""
    up = np.flatnonzero((off[:-1] < 0) & (off[1:] >= 0))
    return (len(up) - 1) / (h * (up[-1] - up[0])) if len(up) > 1 else 0.0


@pytest.mark.parametrize("shape", shapes_of("idle_tones", "ninth"))
@pytest.mark.parametrize("seed", range(3))
def test_tones_that_go_with_the_force(shape, seed):
    _, told, build = hidden("idle_tones", shape, seed=seed)
    assert np.all(through(build, np.zeros(1000)) == 0) and 3.0 <= told["frequency"] <= 9.0
    for part in (0.13, 0.3, 0.55, 0.9):
        force = np.full(100_000, 6.0 * part)
        off = through(build, force) - force
        wanted = part
        if shape == "folded":
            assert 2.0 <= told["folds"] <= 4.0
            # Up to all of it at 1/n, and nothing at 2/n.
            wanted = np.interp(part * told["folds"], [0, 1, 2, 3, 4], [0, 1, 0, 1, 0])
        if wanted > 0.15:
            assert np.max(np.abs(off)) == pytest.approx(told["amplitude"], rel=1e-3)
            assert frequency(off) == pytest.approx(wanted * told["frequency"], rel=0.01)
    # Its phase adds up: with a ramp it is a parabola.
    force = 6.0 * np.linspace(0.0, 0.2, 20_001)
    turns = told["frequency"] * (told["folds"] if shape == "folded" else 1.0) * 0.05 * (1e-4 * np.arange(20_001)) ** 2
    assert np.allclose(through(build, force) - force, told["amplitude"] * np.sin(2 * np.pi * turns), atol=1e-6)


def test_steps_of_haar():
    block = np.array([[4.0, 2.0, 5.0, 5.0, 0.0, 0.0, 1.0, -1.0]])
    # Halves of differences 2 of eight samples, −1 and 0 of four, 1, 0, 0, 1 of two; by the roots of 1, 2 and 4.
    assert np.allclose(haar_kept(block, 0.49), block) and np.allclose(haar_kept(block, 2.01), 2.0)
    assert np.allclose(haar_kept(block, 0.71), [[4.0] * 4 + [0.0] * 4])
    assert np.allclose(haar_kept(block, 0.7), [[3.0, 3.0, 5.0, 5.0, 0.0, 0.0, 0.0, 0.0]])
    both = haar_kept(np.concatenate([block, 3 * block]), 1.5)
    assert np.allclose(both[0], [4.0] * 4 + [0.0] * 4) and np.allclose(both[1], 3 * block)


def pressed(t):
    """Some presses, with steps, ramps and a relaxation."""
    return np.interp(t, [0.3, 0.31, 1.5, 1.6, 2.2, 2.21, 4.0], [0.0, 5.0, 4.0, 1.0, 1.0, 6.0, 5.0])


@pytest.mark.parametrize("seed", range(3))
def test_a_code_of_cosines(seed):
    _, told, build = hidden("lossy_codec", "cosines", seed=seed)
    length = round(told["lasts"] / 1e-4)
    force = pressed(1e-4 * np.arange(4 * length))
    out = through(build, force)
    assert 0.2 <= told["lasts"] <= 0.7 and np.all(through(build, np.zeros(3000)) == 0)
    k = np.arange(40)[:, None]
    cosines = np.cos(np.pi * k * (np.arange(length) + 0.5) / length) * np.sqrt((1 + (k > 0)) / length)
    for n in range(4):
        was, kept = (cosines @ part[n * length : (n + 1) * length] for part in (force, out))
        steps = kept / (told["loses"] * np.sqrt(length))
        assert np.allclose(steps, np.round(steps), atol=1e-6) and np.max(np.abs(was - kept)) <= 0.5001 * kept_step(told)
    # It is off before a step as well as after it.
    off = np.abs(out - force)[: int(0.299 / 1e-4)]
    assert np.max(off) > 0.05 * told["loses"] or (0.3 % told["lasts"]) < 0.03


def kept_step(told):
    """Step of the code: of the root of all samples of a block."""
    return told["loses"] * np.sqrt(round(told["lasts"] / 1e-4))


@pytest.mark.parametrize("seed", range(3))
def test_a_code_of_steps(seed):
    _, told, build = hidden("lossy_codec", "haar", seed=seed)
    length = 2 ** round(np.log2(told["lasts"] / 1e-4))
    force = pressed(1e-4 * np.arange(4 * length))
    out = through(build, force)
    assert length in (2048, 4096, 8192) and np.all(through(build, np.zeros(3000)) == 0)
    blocks, whole = out.reshape(4, length), force.reshape(4, length)
    assert np.allclose(blocks.mean(axis=1), whole.mean(axis=1))
    # The difference of the halves of a block is kept where it is large enough, and else is none.
    for parts in (1, 2, 4, 8, 16):
        halves = (part.reshape(4 * parts, 2, -1).mean(axis=2) for part in (blocks, whole))
        kept, was = (part[:, 0] - part[:, 1] for part in halves)
        large = np.abs(was) / 2 >= 0.7 * told["loses"] * np.sqrt(parts)
        assert np.allclose(kept[large], was[large]) and np.allclose(kept[~large], 0.0, atol=1e-9)


def test_ups_and_downs():
    force, count = np.full(200, 50.0), np.arange(1, 8)
    jayant = _coded(force, 4, 0.1, 1e9, 1.5, False)
    # The first is the least, and each is 1.5 of the last: a geometric sum; held for four steps of time.
    assert np.allclose(jayant[0:28:4], 50.0)
    force[0] = 0.0
    jayant = _coded(force, 4, 0.1, 1e9, 1.5, False)
    assert np.allclose(jayant[4:32:4], 0.1 * (1.5**count - 1) / 0.5)
    assert np.all(jayant[4:32:4] == jayant[4:32].reshape(-1, 4).T)
    slow = _coded(force, 1, 0.1, 2.0, 1.5, True)
    # Two of the least, and from the third on a fifth of the way to the most.
    steps = np.where(count < 3, 0.1, 2.0 - 1.9 * 0.8 ** (count - 2.0))
    assert np.allclose(slow[1:8], np.cumsum(steps))
    assert np.all(_coded(np.concatenate([[1.0], np.full(9, 1.04)]), 1, 0.1, 2.0, 1.5, False) == 1.0)


@pytest.mark.parametrize("shape", shapes_of("delta_code", "ninth"))
@pytest.mark.parametrize("seed", range(3))
def test_a_force_as_ups_and_downs(shape, seed):
    _, told, build = hidden("delta_code", shape, seed=seed)
    force = np.concatenate([np.zeros(1000), np.full(9000, 5.0), np.full(10_000, 5.0 + 0.45 * told["least"])])
    out = through(build, force)
    assert np.all(out[:1000] == 0) and 1 / 510 <= told["every"] <= 1 / 295
    changes = np.flatnonzero(np.diff(out) != 0)
    every = round(told["every"] / 1e-4)
    assert np.all(np.diff(changes) % every == 0)
    steps = np.diff(out)[changes]
    assert np.allclose(steps[:1], told["least"])
    if shape == "one_bit_memory":
        assert np.allclose(steps[1:5] / steps[:4], steps[1] / steps[0]) and 1.5 <= steps[1] / steps[0] <= 1.8
    else:
        rest = 0.15 * 6.0 - steps[1:6]
        assert np.allclose(rest[1:] / rest[:-1], 0.8)
    # It goes beyond, and in the end is as near as half of the least.
    assert np.max(out) > 5.0 + told["least"] and abs(out[9990] - 5.0) <= 1.001 * told["least"]


@pytest.mark.parametrize("shape", shapes_of("concealment", "ninth"))
@pytest.mark.parametrize("seed", range(3))
def test_what_is_made_up(shape, seed):
    motion = Path(1.0).hold(60.0).motion()
    _, told, build = hidden("concealment", shape, motion=motion, seed=seed)
    h = 1e-4
    t = h * np.arange(600_000)
    force = np.full(600_000, 3.0) if shape == "fades" else 1e-3 * t**2
    off = through(build, force) - force
    lost = np.concatenate([[0], (np.abs(off) > 1e-12).astype(int), [0]])
    begins, ends = np.flatnonzero(np.diff(lost) == 1), np.flatnonzero(np.diff(lost) == -1)
    apart, lengths = np.diff(begins) * h, (ends - begins)[:-1] * h
    assert np.all((apart > 0.799) & (apart < 1.601)) and np.std(apart) > 0.12 and len(begins) > 40
    assert np.all((lengths > 0.59 * told["lasts"]) & (lengths < 1.41 * told["lasts"])) and np.ptp(lengths) > 0.04
    taus = []
    for i, length in zip(begins[:20], lengths, strict=False):
        s = np.arange(1, round(length / h) - 2) * h
        part = off[i + 1 : i + 1 + len(s)]
        if shape == "fades":
            taus.append(-(s[-1] - s[0]) / np.log((3 + part[-1]) / (3 + part[0])))
        else:
            # F = c t² less the line through two of its points, L apart, s beyond the last: c s (s + L).
            assert np.allclose(-part, 1e-3 * s * (s + length), atol=2e-7)
    if shape == "fades":
        assert np.allclose(taus, taus[0], rtol=1e-6) and 0.6 <= taus[0] <= 1.2
    straight = through(build, 0.1 * t) - 0.1 * t
    assert shape == "fades" or np.max(np.abs(straight)) < 1e-9


@pytest.mark.parametrize("seed", range(3))
def test_axles_of_trains(seed):
    _, told, build = hidden("railway", "axles", motion=Path(1.0).hold(120.0).motion(), seed=seed)
    t = np.arange(0, 120, 1e-3)
    read = added(build, t) / told["amplitude"]
    tops = np.flatnonzero((read[1:-1] > read[:-2]) & (read[1:-1] >= read[2:]) & (read[1:-1] > 0.1)) + 1
    assert np.all(read >= 0) and np.all((read[tops] > 0.49) & (read[tops] < 1.52)) and np.std(read[tops]) > 0.2
    trains = np.split(tops, np.flatnonzero(np.diff(tops) > 800) + 1)[1:-1]
    assert len(trains) >= 10 and all(5 <= len(train) <= 9 for train in trains) and len({len(a) for a in trains}) > 1
    assert all(np.allclose(np.diff(t[train]), told["apart"], atol=5e-3) for train in trains)
    assert 0.3 <= told["apart"] <= 0.5
    middles = np.array([(t[train[0]] + t[train[-1]]) / 2 for train in trains])
    assert np.all((np.diff(middles) > 4.99) & (np.diff(middles) < 10.01)) and np.std(np.diff(middles)) > 0.6
    # Each a Gaussian with a deviation of a sixth of what they are apart.
    top = trains[0][1]
    near = np.interp(t[top] + told["apart"] / 6, t, read)
    assert near / read[top] == pytest.approx(np.exp(-0.5), rel=0.02)


@pytest.mark.parametrize("seed", range(3))
def test_the_rumble_of_trains(seed):
    _, told, build = hidden("railway", "rumble", motion=Path(1.0).hold(150.0).motion(), seed=seed)
    t = np.arange(0, 150, 1e-3)
    read = added(build, t) / told["amplitude"]
    # One in 7.5 s, 3.75 s long: of the square of each √π/4 of its length.
    assert np.mean(read**2) == pytest.approx(np.sqrt(np.pi) / 4 * 3.75 / 7.5, rel=0.35)
    spectrum = np.mean(read[:-5] * read[5:]) / np.mean(read**2)
    assert spectrum == pytest.approx(np.exp(-0.005 / told["time"]), abs=0.05) and 0.008 <= told["time"] <= 0.025
    loud = np.sqrt(np.convolve(read**2, np.full(400, 1 / 400), mode="same"))
    passes = np.diff(np.flatnonzero(np.diff((loud > 0.35).astype(int)) == 1)) * 1e-3
    assert np.mean(loud < 0.1) > 0.05 and np.mean(loud > 0.5) > 0.12 and 3.0 < np.mean(passes) < 12.0
