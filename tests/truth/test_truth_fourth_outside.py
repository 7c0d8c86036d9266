"""The fourth shapes outside the catalogue: each is what its docstring says."""

import numpy as np
import pytest

from .effects.fourth_outside_bench import _zeroed
from .effects.fourth_outside_pad import _cooled, _follows, _touches
from .motion import Path
from .test_truth_effects import hidden
from .test_truth_third_outside import added

pytestmark = pytest.mark.long

TOUCHES = Path(-0.5)
for _ in range(6):
    TOUCHES.to(1.6, 40.0).hold(0.6).to(-0.5, 40.0).hold(0.6)
SIX = TOUCHES.motion()


def test_an_indicator_takes_a_small_calm_load_for_zero():
    # 0.4 N for 2 s, 4 N for 1 s, air for 2 s, in steps of 0.1 ms; the band is 1 N and gone through in 2 s.
    force = np.repeat([0.0, 0.4, 4.0, 0.0], [100, 20_000, 10_000, 20_000])
    shown = _zeroed(force, 1e-4, 1.0, 5.0, 0.2, 0.5)
    assert shown[100 + 1900] == pytest.approx(0.4) and shown[100 + 6000] == pytest.approx(0.4 - 0.5 * 0.4, abs=1e-3)
    assert shown[20_090] == pytest.approx(0.0, abs=1e-3) and shown[30_090] == pytest.approx(3.6, abs=1e-3)
    assert shown[30_200] == pytest.approx(-0.4, abs=1e-3) and abs(shown[-1]) < 1e-3
    tared = _zeroed(force, 1e-4, 1.0, 5.0, 0.2, 100.0)
    assert tared[100 + 1990] == pytest.approx(0.4) and abs(tared[100 + 2100]) < 1e-9
    # Never by more than the band.
    stairs = _zeroed(np.repeat([0.0, 0.9, 1.8, 2.7], 10_000), 1e-4, 1.0, 5.0, 0.2, 100.0)
    assert stairs[-1] == pytest.approx(1.7)


def test_a_fan_comes_and_goes_and_a_pump_has_strokes():
    t = np.arange(0, 200, 2e-3)
    _, told, build = hidden("machinery", "fan", motion=Path(-1.0).hold(200.0).motion())
    force = added(build, t)
    spectrum, at = np.abs(np.fft.rfft(force)) ** 2, np.fft.rfftfreq(len(t), 2e-3)
    near = (at > 0.4 * told["frequency"]) & (at < 1.05 * told["frequency"])
    assert spectrum[near].sum() > 0.98 * spectrum.sum() and np.max(np.abs(force)) < 1.001 * told["amplitude"]
    loud = np.max(np.abs(force[: len(force) // 500 * 500].reshape(-1, 500)), axis=1) / told["amplitude"]
    assert np.mean(loud > 0.9) > 0.15 and np.mean(loud < 0.1) > 0.15  # on for seconds, off for seconds
    _, told, build = hidden("machinery", "pump", motion=Path(-1.0).hold(200.0).motion())
    force = added(build, t)
    begins = t[1:][(force[1:] > 1e-9) & (force[:-1] <= 1e-9)]
    assert np.all(force >= 0) and np.mean(np.diff(begins)) == pytest.approx(1 / told["frequency"], rel=0.03)
    assert 0.06 < np.std(np.diff(begins)) * told["frequency"] < 0.14


@pytest.mark.long
def test_a_sense_wire_changes_the_gain_and_not_the_zero():
    motion = Path(-0.5).to(1.0, 50.0).hold(60.0).to(-0.5, 50.0).hold(5.0).motion()
    fine, told, _ = hidden("sense_wire", "two_level", motion=motion)
    loaded = fine.cell_N > 0.1
    assert np.all(fine.force_N[~loaded & (fine.reported_mm < 0)] == 0)
    levels = np.unique(np.round(1 - fine.force_N[loaded] / fine.cell_N[loaded], 9))
    assert np.allclose(levels, [0.0, told["drop"]])
    fine, told, _ = hidden("sense_wire", "wanders", motion=Path(1.0).hold(2000.0).motion())
    gain = (fine.force_N[1:] / fine.cell_N[1:])[::100] - 1
    assert np.std(gain) == pytest.approx(0.8 * told["drop"], rel=0.15)
    lag = int(told["time"] / 0.01)
    assert np.corrcoef(gain[lag:], gain[:-lag])[0, 1] == pytest.approx(np.exp(-1.0), abs=0.12)


def test_a_stepper_gives_way_when_it_rests():
    motion = Path(-0.5).to(1.0, 50.0).hold(3.0).to(2.0, 50.0).hold(3.0).motion()
    for shape in ("halved", "detents"):
        fine, told, _ = hidden("idle_current", shape, motion=motion)
        back, t = fine.reported_mm - fine.probe_mm, fine.time_s
        begins = 1.5 / 50 + 50 / 5000
        assert np.all(np.abs(back[t < begins + told["waits"] - 0.01]) < 1e-9)
        first, second = (np.interp(s, t, back) / told["gives"] for s in (begins + 2.9, begins + 5.9))
        assert np.interp(begins + told["waits"] + 0.01, t, back) / told["gives"] == pytest.approx(
            first * -np.expm1(-1.0), abs=0.05 * first
        )
        if shape == "halved":
            assert (first, second) == pytest.approx((0.5, 1.0), rel=1e-3)
        else:
            assert 0.2 <= first <= 1.0 and 0.2 <= second <= 1.0 and first != second


def test_each_touch_meets_another_spot():
    assert _touches(np.array([-1, 0, 1, 2, 0, 1, -1, 1])).tolist() == [0, 0, 1, 1, 1, 2, 2, 3]
    fine, _, _ = hidden("fresh_spot", "stiffness", motion=SIX)
    loaded = fine.reported_mm > 0.2
    gains = np.unique(np.round((fine.force_N / (3.0 * fine.reported_mm))[loaded], 9))
    assert len(gains) == 6 and np.all(np.abs(gains - 1) < 0.07 * 1.25 * 2.001)
    fine, _, _ = hidden("fresh_spot", "height", motion=SIX)
    heights = np.unique(np.round((fine.reported_mm - fine.force_N / 3.0)[loaded], 9))
    assert len(heights) == 6 and np.max(np.abs(heights)) < 2 * 0.03 * 1.251 * 2


def test_a_probe_grows_with_each_touch():
    for shape in ("builds_up", "falls_off"):
        fine, told, _ = hidden("residue", shape, motion=SIX)
        holds = [s for s in SIX.breaks_s if SIX.position(s) > 1.59 and SIX.velocity(s + 1e-4) == 0]
        layers = np.array([fine.at(s + 0.3) / 3.0 - 1.6 for s in holds]) / told["layer"]
        assert len(layers) == 6 and layers[0] == pytest.approx(0.0, abs=1e-9)
        steps = np.diff(layers)
        grown = (steps > 0.19) & (steps < 1.01)
        assert np.all(grown) if shape == "builds_up" else np.all(grown | np.isclose(layers[1:], 0.0, atol=1e-9))


def test_a_gel_swells():
    fine, told, _ = hidden("swelling", "swells", motion=Path(1.0).hold(40.0).motion())
    left = told["rise"] + (1.0 - fine.force_N[1:] / 3.0)[::1000]  # to come
    assert np.ptp(left[1:] / left[:-1]) < 1e-6 and left[0] == pytest.approx(told["rise"], rel=1e-3)
    assert np.exp(-1 / 0.33) < left[-1] / told["rise"] < 1.02 * np.exp(-1.0)


def test_a_loose_screw_has_another_zero_after_each_move():
    t = np.arange(0, SIX.duration_s + 1, 1e-3)
    v = np.abs(SIX.velocity(t)) > 1e-6
    for shape in ("each_move", "hard_moves"):
        _, told, build = hidden("loose_screw", shape, motion=SIX)
        zeros = added(build, t)
        steps = np.flatnonzero(np.diff(zeros) != 0)
        ends = np.flatnonzero(v[:-1] & ~v[1:])
        # All of these moves are as quick as the middle one; each ends with another zero.
        assert len(steps) == 12 and np.all(np.abs(steps - ends) <= 2) and np.all(zeros[: steps[0]] == 0)
        assert np.max(np.abs(zeros)) <= np.sqrt(3) * told["step"]
    path = Path(0.0).to(1.0, 5.0).hold(0.5).to(0.0, 50.0).hold(0.5).to(1.0, 60.0).hold(0.5)
    _, _, build = hidden("loose_screw", "hard_moves", motion=path.motion())
    t = np.arange(0, 3, 1e-3)
    steps = t[1:][np.diff(added(build, t)) != 0]
    assert len(steps) == 2 and steps[0] > 0.7  # not after the slow one


@pytest.mark.long
def test_a_loose_head_leads_the_loop_astray():
    motion = Path(1.0).hold(2000.0).motion()
    fine, told, _ = hidden("loose_head", "wanders", motion=motion)
    assert np.allclose(fine.reported_mm, 1.0)
    off = (1.0 - fine.force_N[1:] / 3.0)[::100] / told["off"]
    lag = int(told["time"] / 0.01)
    assert np.std(off) == pytest.approx(1.0, rel=0.15)
    assert np.corrcoef(off[lag:], off[:-lag])[0, 1] == pytest.approx(np.exp(-1.0), abs=0.12)
    fine, told, _ = hidden("loose_head", "jumps", motion=Path(1.0).hold(60.0).motion())
    off = (1.0 - fine.force_N[1:] / 3.0) / (2 * told["off"])
    assert np.mean((off < 0.01) | (off > 0.99)) > 0.9 and np.mean(off > 0.5) > 0.15 and np.mean(off < 0.5) > 0.15


def test_a_muscle_tenses_now_and_then():
    wanted = np.repeat([0.0, 1.0, 0.0], 10_000)
    tense = _follows(wanted, 1e-4, 0.2, 0.8)
    assert tense[19_999] == pytest.approx(-np.expm1(-1.0 / 0.2), rel=1e-3)
    assert tense[-1] == pytest.approx(tense[19_999] * np.exp(-1.0 / 0.8), rel=1e-3)
    fine, told, _ = hidden("tensing", "bouts", motion=Path(1.0).hold(200.0).motion())
    more = (fine.force_N[1:] / 3.0 - 1) / told["growth"]
    assert more.min() >= 0 and 0.95 < more.max() <= 1.0
    assert np.mean(more > 0.5) > 0.2 and np.mean(more < 0.5) > 0.2
    path = Path(0.5)
    for _ in range(30):
        path.to(1.0, 20.0).hold(5.0).to(0.5, 20.0).hold(5.0)
    motion = path.motion()
    fine, told, _ = hidden("tensing", "startles", motion=motion)
    more = (fine.force_N[1:] / (3.0 * fine.reported_mm[1:]) - 1) / (1.5 * told["growth"])
    begins = fine.time_s[1:][1:][(more[1:] > 1e-3) & (more[:-1] <= 1e-3)]
    starts = motion.breaks_s[:-1][(motion.velocity(motion.breaks_s[:-1] - 1e-4) == 0)]
    starts = starts[np.abs(motion.velocity(starts + 1e-4)) > 0]
    late = np.min(np.where(begins[:, None] >= starts, begins[:, None] - starts, 9.0), axis=1)
    # Sixty moves, two of five of which startle: 24, with a deviation of 3.8.
    assert len(starts) == 60 and 12 <= len(begins) <= 36 and np.all((late > 0.099) & (late < 0.61))


def test_a_pad_takes_the_temperature_of_the_probe():
    cold = _cooled(np.repeat([True, False], 20_000), 1e-4, 3.0, 6.0)
    assert cold[19_999] == pytest.approx(-np.expm1(-2.0 / 3.0), rel=1e-3)
    assert cold[-1] == pytest.approx(cold[19_999] * np.exp(-2.0 / 6.0), rel=1e-3)
    fine, told, _ = hidden("cold_probe", "stiffens", motion=Path(1.0).hold(20.0).motion())
    assert fine.at(8.0) / 3.0 == pytest.approx(1 - told["growth"] * np.expm1(-8.0 / told["takes"]), rel=1e-3)
