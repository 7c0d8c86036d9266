"""The fifth effects outside the catalogue: each is what its docstring says."""

import numpy as np
import pytest

from .effects.fifth_outside_bench import _door, _sleeps
from .effects.fifth_outside_pad import _withdrawn
from .effects.fifth_pad import _pressed
from .motion import Path
from .sets import shapes_of
from .test_truth_effects import hidden
from .test_truth_fourth_outside import SIX
from .test_truth_third_outside import added

pytestmark = pytest.mark.long

HELD = Path(1.0).hold(60.0).motion()  # a spring of 3 N/mm, held at 1 mm of 2


@pytest.mark.parametrize("shape", shapes_of("swapped_blocks", "fifth"))
def test_blocks_change_places(shape):
    _, told, build = hidden("swapped_blocks", shape, motion=HELD)
    t, block = np.arange(0, 60, 1e-4), told["block"]
    read = build.delays[0](t, None)
    moved = np.round((read - t) / block, 6)
    # Those moved make up for each other, in each place.
    assert set(np.unique(moved)) == ({-1.0, 0.0, 1.0} if shape == "pairs" else {-2.0, 0.0, 2.0})
    begins = t[1:][(moved[1:] > 0) & (moved[:-1] <= 0)]
    assert 60 / 1.4 < len(begins) < 60 / 0.7 and np.std(np.diff(begins)) > 0.1
    for begin in begins[:-1]:
        inside = (t >= begin - 1e-9) & (t < begin + (2 if shape == "pairs" else 3) * block)
        assert np.allclose(np.sort(read[inside]), t[inside], atol=2.1e-4)
        ahead = (t >= begin) & (t < begin + block)
        assert np.all(moved[ahead][2:-2] > 0)
    assert np.all(moved[(t > begins[3] + 3 * block + 1e-3) & (t < begins[4] - 1e-3)] == 0)


def test_a_swinging_door_keeps_within_its_band():
    t = np.arange(0, 10, 1e-3)
    force = np.sin(t) + 0.3 * np.sin(11 * t)
    for band in (0.02, 0.1):
        kept = _door(t, force, band)
        off = np.abs(np.interp(t, t[kept], force[kept]) - force)
        assert kept[0] == 0 and kept[-1] == len(t) - 1 and np.all(np.diff(kept) > 0)
        # Slopes within the door at each point: at most the band, where it opened, off the line.
        assert 0.5 * band < off.max() < 1.001 * band and len(kept) < 150
    assert len(_door(t, 2 * t, 0.1)) == 2
    fine, told, build = hidden("archive", "swinging_door", motion=SIX)
    assert 0.7 * told["band"] < np.max(np.abs(fine.force_N - fine.cell_N)) < 1.001 * told["band"]
    fine, told, _ = hidden("archive", "sparse", motion=SIX)
    bends = np.abs(np.diff(fine.force_N, 2)) > 1e-9
    moves = np.abs(SIX.velocity(fine.time_s[1:-1])) > 1
    # One in each: two of three show where it moves, as there they are no straight line.
    assert bends.sum() < 1.3 * fine.time_s[-1] / told["every"] and bends[moves].sum() > 10


@pytest.mark.parametrize("shape", shapes_of("air_hammer", "fifth"))
def test_a_bearing_swings_under_some_loads(shape):
    path = Path(-0.5)
    for depth in (0.1, 0.9, 1.95):  # 0.05, 0.45 and 0.97 of the load
        path.to(depth, 50.0).hold(20.0)
    fine, told, build = hidden("air_hammer", shape, motion=path.motion())
    swings, level = fine.force_N - fine.cell_N, {}
    for depth in (-0.5, 0.1, 0.9, 1.95):
        there = (np.abs(fine.reported_mm - depth) < 1e-9) & (fine.time_s > 3)
        level[depth] = np.std(swings[there][30_000:]) * np.sqrt(2) / told["amplitude"] if there.any() else 0.0
    assert level[0.1] < 1e-2 and level[0.9] == pytest.approx(1.0, abs=0.02)
    assert level[1.95] == pytest.approx(0.0 if shape == "band" else 1.0, abs=0.02)
    there = np.abs(fine.reported_mm - 0.9) < 1e-9
    spectrum = np.abs(np.fft.rfft(swings[there])) ** 2
    at = np.fft.rfftfreq(int(there.sum()), 1e-4)
    near = np.abs(at / told["frequency"] - 1) < 0.35
    assert spectrum[near].sum() > 0.95 * spectrum.sum() and spectrum.max() < 0.7 * spectrum.sum()


@pytest.mark.parametrize("shape", shapes_of("carrier_beat", "fifth"))
def test_carriers_beat(shape):
    _, told, build = hidden("carrier_beat", shape, motion=Path(-1.0).hold(400.0).motion())
    t = np.arange(0, 400, 5e-3)
    beat = added(build, t)
    assert np.sqrt(2) * np.std(beat) == pytest.approx(told["amplitude"], rel=0.1)
    spectrum, at = np.abs(np.fft.rfft(beat)) ** 2, np.fft.rfftfreq(len(t), 5e-3)
    # Slow, and no line: it wanders by a third.
    assert spectrum[(at > 0.2 * told["frequency"]) & (at < 4 * told["frequency"])].sum() > 0.95 * spectrum.sum()
    middle = np.sum(spectrum * at) / spectrum.sum()
    assert middle / told["frequency"] == pytest.approx(1.0 if shape == "one" else 1.33, abs=0.25)
    assert spectrum.max() < 0.2 * spectrum.sum()


def test_an_amplifier_that_sleeps():
    # 1 N for 1 s, a short and a long time without, 1 N again; in steps of 0.1 ms.
    force = np.repeat([0.0, 1.0, 0.0, 1.0, 0.0, 1.0], [5000, 10_000, 1000, 10_000, 5000, 10_000])
    awake = _sleeps(force, 1e-4, 0.1, 0.2, 0.5)
    assert awake[5000] == pytest.approx(1.0, abs=1e-3) and awake[14_999] == pytest.approx(np.exp(-2.0), rel=1e-3)
    assert awake[16_000] == pytest.approx(np.exp(-1.1 / 0.5), rel=1e-3)  # 0.1 s is not long enough
    assert awake[31_000] == pytest.approx(1.0, abs=1e-3)
    fine, told, _ = hidden("sleep", "slow_reference", motion=Path(-0.5).to(1.0, 50.0).hold(3.0).motion())
    lost, t = 1 - fine.force_N / np.where(fine.cell_N > 0.2, fine.cell_N, np.nan), fine.time_s
    begin = t[np.argmax(fine.cell_N > 0.02 * 6)]
    for later in (0.05, 0.3, 1.0):
        assert np.interp(begin + later, t, lost) == pytest.approx(
            told["off"] * np.exp(-later / told["takes"]), rel=1e-2
        )


def test_charge_gathers_and_goes_off():
    t = np.arange(0, 300, 1e-3)
    _, told, build = hidden("charging", "steady", motion=Path(-1.0).hold(300.0).motion())
    zero = added(build, t) / told["level"]
    drops = np.flatnonzero(np.diff(zero) < 0)
    slope = np.diff(zero)[np.diff(zero) > 0]
    assert np.ptp(slope) < 1e-6 and 2.0 <= 1e-3 / slope[0] <= 6.0 and np.all(zero[drops + 1] < 1e-3)
    assert np.all((zero[drops] > 0.49) & (zero[drops] < 1.51)) and np.std(zero[drops]) > 0.15
    _, told, build = hidden("charging", "by_motion", motion=SIX)
    t = np.arange(0, SIX.duration_s, 1e-3)
    zero, v = added(build, t), np.abs(SIX.velocity(t))
    rests = (v[1:] == 0) & (v[:-1] == 0)
    assert np.all(np.abs(np.diff(zero)[rests]) < 1e-6) and np.ptp(zero) > 0.4 * told["level"]


def test_a_pad_that_packs():
    x = np.concatenate([np.linspace(-1, 2, 301), np.linspace(2, 1, 101), np.linspace(1, 2, 101)])
    assert _pressed(x)[[100, 200, 300, 401, 502]] == pytest.approx([0.0, 1.0, 2.0, 2.0, 3.0])
    fine, told, _ = hidden("compaction", "logarithmic", motion=SIX)
    loaded = fine.reported_mm > 0.1
    way = np.cumsum(np.maximum(np.diff(np.maximum(fine.reported_mm, 0.0), prepend=0.0), 0.0))
    stiffer = fine.force_N[loaded] / (3 * fine.reported_mm[loaded]) - 1
    assert np.allclose(stiffer, told["growth"] * np.log1p(way[loaded] / told["length"]), atol=1e-6)
    path = Path(0.3)
    for _ in range(300):
        path.to(1.6, 20.0).to(0.3, 20.0)
    fine, told, _ = hidden("compaction", "shaken_loose", motion=path.motion())
    stiffer = fine.force_N[1:] / (3 * fine.reported_mm[1:]) - 1
    falls = np.flatnonzero(np.diff(stiffer) < -1e-3)
    assert 300 * 2.6 / 20 / 15 / 3 < len(falls) < 300 * 2.6 / 20 / 6 * 2 and np.all(stiffer[falls + 1] < 0.05)


@pytest.mark.parametrize("shape", shapes_of("crystallisation", "fifth"))
def test_rubber_crystallises_deep_down(shape):
    motion = Path(2.0).hold(20.0).to(1.6, 1000.0).hold(2.0).to(0.5, 1000.0).hold(1.0).motion()
    fine, told, _ = hidden("crystallisation", shape, motion=motion)
    more = fine.force_N[1:] / (3 * fine.reported_mm[1:]) - 1
    t = fine.time_s[1:]
    for later in (0.5, 2.0, 15.0):
        wanted = -told["growth"] * np.expm1(-later / told["takes"])
        assert np.interp(later, t, more) == pytest.approx(wanted, rel=1e-3)
    melts = np.interp([20.3, 20.5, 22.5, 22.9], t, more) / told["growth"]
    if shape == "lingers":
        # At half a millimetre nothing is wanted: it fades, within 3 to 8 s.
        assert 3.0 < -0.8 / np.log(melts[3] / melts[2]) < 8.0
    else:
        # At 0.8 of the depth 0.55 to 0.67 of it, soon.
        assert 0.55 < melts[1] < 0.67 and abs(melts[0] - melts[1]) < 2e-3 and np.max(np.abs(melts[2:])) < 1e-3


def test_gas_lifts_the_surface_and_escapes():
    fine, told, _ = hidden("bubbles", "one", motion=Path(1.0).hold(200.0).motion())
    lifted = (fine.force_N[1:] / 3.0 - 1.0) / told["rise"]
    drops = np.flatnonzero(np.diff(lifted) < -0.3)
    assert np.all(lifted > -1e-9) and np.all(lifted[drops + 1] < 0.02)
    spans = np.diff(fine.time_s[1:][drops])
    assert np.all((spans > 0.39 * told["every"]) & (spans < 1.61 * told["every"])) and np.std(spans) > 0.1
    # As the root of time since it escaped.
    for drop, span in zip(drops, spans, strict=False):
        at = np.array([0.25, 0.5, 1.0]) * span * 0.99
        rise = np.interp(fine.time_s[1:][drop] + at, fine.time_s[1:], lifted)
        assert np.allclose(rise, np.sqrt(at / told["every"]), atol=0.02)
    fine, told, _ = hidden("bubbles", "several", motion=Path(1.0).hold(200.0).motion())
    many = np.flatnonzero(np.diff(fine.force_N[1:] / 3.0 / told["rise"]) < -0.2)
    assert 2.2 < len(many) * told["every"] / 200 < 3.8


@pytest.mark.parametrize("shape", shapes_of("creases", "fifth"))
def test_the_skin_folds_in_some_touches(shape):
    path = Path(-0.5)
    for _ in range(40):
        path.to(1.9, 10.0).to(-0.5, 100.0)
    motion = path.motion()
    fine, told, _ = hidden("creases", shape, motion=motion)
    period, kinds = motion.duration_s / 40, []
    for k in range(40):
        inside = (fine.time_s > k * period) & (fine.time_s < (k + 1) * period) & (motion.velocity(fine.time_s) > 9.9)
        x, more = fine.reported_mm[inside], (fine.force_N - 3 * np.maximum(fine.reported_mm, 0))[inside]
        slope = (np.interp(1.85, x, more) - np.interp(1.6, x, more)) / 0.25 / told["more"]
        kinds.append((round(slope, 2), round(1.85 - np.interp(1.85, x, more) / max(slope * told["more"], 1e-9), 2)))
    slopes, begins = np.array(kinds).T
    folds = slopes > 0
    assert np.all((begins[folds] > 0.39) & (begins[folds] < 1.21))
    if shape == "now_and_then":
        assert set(slopes) == {0.0, 1.0} and 8 < folds.sum() < 32 and len(set(begins[folds])) > 6
    else:
        assert set(slopes) == {0.0, 0.5, 1.0, 1.5} and len({kind for kind in kinds if kind[0]}) == 3


def test_a_pad_that_draws_back():
    load = np.repeat([0.0, 2.0, 0.5, 0.0], [1000, 10_000, 10_000, 10_000])
    drawn = _withdrawn(load, 1e-4, 1.0, 0.2, 0.1, 2.0)
    assert np.all(drawn[:2990] == 0) and drawn[4000] == pytest.approx(-np.expm1(-0.1 / 0.1), abs=2e-3)
    assert drawn[20_999] == drawn[11_000]  # low, but not let go
    assert drawn[-1] == pytest.approx(drawn[11_000] * np.exp(-1.0 / 2.0), rel=1e-3)
    fine, told, _ = hidden("withdrawal", "reflex", motion=Path(-0.5).to(1.6, 100.0).hold(3.0).motion())
    depth = 1.6 - fine.force_N / 3.0
    begins = fine.time_s[np.argmax((fine.time_s > 0.05) & (fine.reported_mm > 1.599) & (depth > 1e-6))]
    assert 0.09 < begins < 0.3 and depth[-1] == pytest.approx(told["back"], rel=1e-3)
    fine, told, _ = hidden("withdrawal", "learns", motion=SIX)
    holds = [s for s in SIX.breaks_s if SIX.position(s) > 1.59 and SIX.velocity(s + 1e-4) == 0]
    drawn = np.array([1.6 - fine.at(s + 0.59) / 3.0 for s in holds])
    assert len(drawn) == 6 and np.all(np.diff(drawn) < 0) and drawn[5] / drawn[4] == pytest.approx(0.8, rel=0.03)
