"""Effects outside the catalogue: each is seen, each is what its docstring says."""

import numpy as np
import pytest

from .cases import draw_case
from .detect import misfit
from .effects.outside_pad import _activated, _bonds, _film, _jammed
from .motion import Path, rich
from .pad import Pad
from .sets import outside, written_in
from .test_truth_cases import CATALOGUE
from .test_truth_effects import SPRING, disturbed, hidden

OUTSIDE = outside(CATALOGUE, "first", "second")
SHAPES = written_in(tuple(OUTSIDE), "first", "second")
MOTION = rich(2.0, (60.0, 8.0), hold_s=0.4, long_hold_s=3.0)
PLAIN = {"motion": MOTION, "rate_hz": 200.0, "noise_kind": "white", "own_clock": False, "jitter": "none"}


def test_there_are_enough_of_them():
    assert len(OUTSIDE) >= 10


@pytest.mark.long
@pytest.mark.parametrize(("id", "shape"), SHAPES)
def test_each_is_seen_at_its_typical_size(id, shape):
    case = draw_case(31, (id,), 1.0, shape, law="power", contact="unilateral", noise_N=0.01, **PLAIN)
    again = draw_case(31, (id,), 1.0, shape, law="power", contact="unilateral", noise_N=0.01, **PLAIN)
    assert np.array_equal(case.force_N, again.force_N) and np.array_equal(case.position_mm, again.position_mm)
    found = misfit(case)
    assert found.detectable
    # No more than a disturbance: a tenth of the largest force at the very most, in the mean.
    assert found.rmse_N < 0.1 * np.max(np.abs(case.truth.clean_N))
    other = draw_case(32, (id,), 1.0, shape, drawn=case.truth.drawn, noise_N=0.01, **PLAIN)
    assert not np.allclose(other.truth.clean_N, case.truth.clean_N, atol=1e-4)


@pytest.mark.parametrize(("id", "shape"), SHAPES)
@pytest.mark.parametrize("contact", ["bonded", "unilateral"])
def test_each_stays_finite_at_any_size(id, shape, contact):
    for size in (0.05, 2.5):
        case = draw_case(33, (id,), size, shape, contact=contact, **PLAIN)
        assert np.all(np.isfinite(case.force_N)) and np.all(np.isfinite(case.position_mm))
        assert np.max(np.abs(case.truth.clean_N)) < 80
        assert np.all(np.isfinite(list(case.truth.parameters[id].values())))


IN_AIR = {("building", "shaking"), ("stick_slip", "guide"), ("ranging", "settling")}


@pytest.mark.parametrize(("id", "shape"), [s for s in SHAPES if s not in IN_AIR and s[0] != "loose_cable"])
def test_what_is_of_the_pad_is_not_felt_in_air(id, shape):
    motion = Path(-1.5).hold(0.2).to(-0.5, 20.0).hold(0.5).to(-1.5, 20.0).hold(0.2).motion()
    fine, _, _ = hidden(id, shape, motion=motion)
    assert np.all(fine.force_N == 0)


def test_a_swing_of_temperature_in_closed_form():
    fine, told, _ = hidden("temperature_swing", "stiffness", motion=Path(0.0).to(1.0, 10.0).hold(60.0).motion())
    hold = fine.time_s > 1
    t, swing = fine.time_s[hold], fine.force_N[hold] / 3.0 - 1
    waves = np.stack([f(2 * np.pi * t / told["period"]) for f in (np.sin, np.cos)], axis=1)
    fit = np.linalg.lstsq(waves, swing, rcond=None)[0]
    assert np.hypot(*fit) == pytest.approx(told["swing"], rel=1e-6) and np.allclose(waves @ fit, swing, atol=1e-9)
    pad = Pad(SPRING.law, (0.4,), (0.5,))
    shifted, told, _ = hidden("temperature_swing", "shift", pad=pad, motion=Path(1.0).hold(4.0).motion())
    # ln of the mode that is left falls at ν times a factor within 2 either way.
    gain = shifted.pad_N[1] / 3.0
    assert gain == pytest.approx(1, abs=told["swing"] + 1e-3)


def test_bonds_break_with_the_way_and_heal_with_time():
    depth = np.concatenate([np.linspace(0, 1, 1001), np.ones(40_000)])
    whole = _bonds(depth, 1e-4, 0.4, 2.0)
    # At 10 mm/s for 0.1 s, B' = (1 − B)/τ − B v/ℓ from 1; then 1 − B falls as e^{−t/τ}.
    rate = 1 / 2.0 + 10 / 0.4
    steady = 1 / 2.0 / rate
    assert whole[1000] == pytest.approx(steady + (1 - steady) * np.exp(-0.1 * rate), rel=1e-2)
    assert (1 - whole[-1]) / (1 - whole[1000]) == pytest.approx(np.exp(-4.0 / 2.0), rel=1e-2)


def test_jamming_needs_speed():
    speed = np.repeat([0.0, 4.0, 0.0, 6.0, 0.0], 2000)
    jammed = _jammed(speed, 1e-4, 5.0, 0.02, 0.1, 0.05)
    assert not jammed[:6000].any() and jammed[7999] > 0.99 and jammed[8990] == jammed[7999]
    assert jammed[-1] == pytest.approx(np.exp(-0.1 / 0.05) * jammed[7999], rel=0.02)


def test_a_film_is_squeezed_and_comes_back():
    depth = np.concatenate([np.full(20_000, 1.5), np.zeros(20_000), np.full(2, 1.0)])
    over = _film(depth, 1e-4, 1.0, 2.0, 4.0)
    left_mm = 1.5 - over[19_999]  # below 1: thinner the longer it was pressed
    assert over[1] == pytest.approx(0.5, abs=1e-3) and left_mm == pytest.approx(1.5 - 0.5 * np.exp(2 / 2), rel=1e-3)
    back_mm = 1 - (1 - left_mm) * np.exp(-2 / 4)
    assert over[-2] == pytest.approx(1.0 - back_mm, rel=1e-2)


def test_an_activated_dashpot_is_linear_near_rest_only():
    near = _activated(np.full(10_001, 1e-3), 1e-4, 2.0, 1.0)
    assert near[-1] == pytest.approx(-1e-3 * np.expm1(-2.0), rel=1e-3)
    far = _activated(np.full(10_001, 10.0), 1e-4, 2.0, 1.0)
    assert far[50] > 10 * -10 * np.expm1(-2.0 * 0.005)
    # tanh(y/4) of the way left y would hold for sinh(y/2); here tanh(y/2) falls as e^{−νt}.
    assert np.tanh((10 - far[-1]) / 2) == pytest.approx(np.tanh(5) * np.exp(-2.0), rel=1e-6)


def test_a_cable_has_two_levels_and_random_steps():
    t = np.linspace(0, 60, 60_000)
    samples, told = disturbed("loose_cable", "two_level", t)
    assert set(np.round(np.unique(samples.clean_N), 12)) == {0.0, round(told["step"], 12)}
    many, told = disturbed("loose_cable", "many_levels", t)
    assert len(np.unique(many.clean_N)) > 2 and np.ptp(many.clean_N) <= 2 * told["step"]


def test_a_building_swings_in_a_narrow_band():
    fine, told, build = hidden("building", "shaking", motion=Path(-1.0).hold(80.0).motion())
    force = fine.force_N[::100]
    power = np.abs(np.fft.rfft(force - force.mean())) ** 2
    at = np.fft.rfftfreq(len(force), 0.01)
    near = np.abs(at - told["frequency"]) < 6 * told["damping_ratio"] * told["frequency"]
    assert power[near].sum() > 0.8 * power.sum()
    assert np.std(force) == pytest.approx(told["deviation"] * build.force_N, rel=0.5)
    # Not a tone, which would have more than 0.85 in the three bins about its frequency.
    peak = int(np.argmax(power))
    assert power[peak - 1 : peak + 2].sum() < 0.7 * power.sum()


def test_lost_steps_are_lost_in_moves():
    motion = Path(-1.0).hold(0.2).to(0.5, 20.0).hold(0.5).to(1.0, 20.0).hold(0.5).to(-1.0, 20.0).hold(0.3).motion()
    fine, _, _ = hidden("lost_steps", "every_move", motion=motion)
    off, v = fine.probe_mm - fine.reported_mm, motion.velocity(fine.time_s)
    rests = (v == 0) & (np.roll(v, 1) == 0)
    levels = np.unique(np.round(off[rests], 9))
    assert len(levels) == 4 and 0 in levels  # before the first of three moves, and after each
    assert np.array_equal(fine.reported_mm, motion.position(fine.time_s))


def test_a_range_is_left_well_below_where_it_was_entered():
    motion = Path(0.0, np.inf).to(2.0, 1.0).to(0.0, 1.0).motion()
    fine, told, build = hidden("ranging", "hysteresis", motion=motion)
    plain, up = fine.pad_N, fine.time_s < 2.0
    wrong = np.abs(fine.force_N - plain) > 1e-9
    assert plain[up & wrong].min() == pytest.approx(told["level"], rel=1e-2)
    assert plain[~up & wrong].min() < 0.45 * told["level"]
    high = up & wrong
    assert np.allclose(fine.force_N[high], plain[high] * (1 + told["gain"]) + told["zero"])
