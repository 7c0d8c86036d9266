"""The tenth shapes of the catalogue's effects against closed forms."""

import numpy as np
import pytest

from .motion import Path
from .test_truth_effects import hidden

pytestmark = pytest.mark.long


@pytest.mark.parametrize("seed", range(3))
def test_a_play_is_wider_about_one_place(seed):
    motion = Path(-0.5).to(1.5, 5.0).to(-0.5, 5.0).motion()
    fine, told, _ = hidden("backlash", "worn_spot", motion=motion, depth=1.5, seed=seed)
    back = (fine.time_s > 0.44) & (fine.reported_mm > 0) & (fine.time_s < 0.79)
    x, lost = fine.reported_mm[back], (fine.probe_mm - fine.reported_mm)[back]
    worst = x[np.argmax(lost)]
    assert 0.29 * 1.5 < worst < 0.71 * 1.5 and 1.98 < lost.max() / told["gap"] < 3.02
    beside = np.abs(x - worst) > 0.41 * 1.5
    assert beside.any() and np.allclose(lost[beside], told["gap"], rtol=1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_a_surface_sinks_with_the_way_pressed(seed):
    _, told, build = hidden("permanent_set", "pounding", motion=Path(-0.5).to(1.0, 20.0).motion(), depth=1.0, seed=seed)
    cycle = np.concatenate([np.linspace(0.0, 1.0, 501), np.linspace(1.0, 0.0, 501)[1:]])
    sunk = build.plant.height[-1](np.arange(6006.0), np.tile(cycle, 6))[1000::1001]
    half_mm = told["set"] / sunk[0] - 1  # after one press of 1 mm
    assert 2.0 < half_mm < 5.0
    n = np.arange(1.0, 7.0)  # presses, and mm
    assert np.allclose(sunk, told["set"] * n / (n + half_mm), rtol=1e-9)


def test_a_pad_is_softer_by_all_the_way_gone_down():
    _, told, build = hidden("damage", "all_the_way", motion=Path(-0.5).to(1.0, 20.0).motion(), depth=1.0)
    cycle = np.concatenate([np.linspace(-0.5, 1.0, 301), np.linspace(1.0, -0.5, 301)[1:]])
    gain = build.plant.gain[-1](np.arange(3005.0), np.tile(cycle, 5))
    assert np.allclose(gain[600::601], np.exp(-told["rate"] * np.arange(1.0, 6.0)), rtol=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_cogging_grows_along_a_row_that_ends(seed):
    _, told, build = hidden("cogging", "end_of_row", motion=Path(-0.5).to(1.0, 20.0).motion(), depth=1.0, seed=seed)
    x = np.linspace(0.5, 0.5 + told["period"], 2001)[:-1]
    felt = build.plant.felt[-1](None, x, None, None)
    zero = build.plant.felt[-1](None, np.array([0.5, 0.5 + told["period"]]), None, None)
    grows = np.log(zero[1] / zero[0]) / told["period"]
    assert 0.39 < abs(grows) < 0.81
    lines = np.fft.rfft(felt * np.exp(-grows * (x - 0.5))) / 1000
    assert np.abs(lines[1]) == pytest.approx(told["amplitude"], rel=1e-6)
    assert np.all(np.abs(lines[2:4]) > 0.19 * told["amplitude"]) and np.all(np.abs(lines[4:20]) < 1e-9)
