"""Load cells that convert more slowly than they are read: told from noise, digits and samples that stick by chance."""

from __future__ import annotations

import functools
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from bench import identify
from bench.diagnose import diagnose
from bench.diagnose.channel import faults
from bench.readings import copies, drop_outs, resolution, rows_per_conversion, spacing
from bench.recording import read_recording, write_csv
from bench.recording.types import Measurement
from sim.model import Model
from tests.truth.cases import null_case
from tests.truth.laws import Power
from tests.truth.motion import staircase
from tests.truth.pad import Pad, simulate

ROW_s = 0.0125
PAD = Pad(Power(2.7, 0.5), (0.3, 0.12), (2.5, 0.2))
BELIEVED = Pad(Power(2.5, 0.5), (0.26, 0.13), (2.8, 0.18))
TRUE = {"p": 2.7, "q": 0.5, "nu_1": 2.5, "nu_2": 0.2, "c_1": 0.3, "c_2": 0.12}
SEEDS = range(20)


@functools.cache
def clean(up_mm_s: float = 8.0) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """(times, positions, forces without noise) of a staircase, up and down twice."""
    motion = staircase([0.8, 1.6, 2.4, 1.6, 0.8, 0.0] * 2, up_mm_s, 3.0)
    t = np.arange(0.0, motion.duration_s, ROW_s)
    return t, np.asarray(motion.position(t)), simulate(PAD, motion, t).force_N


def held(rows: float, seed: int, digit_N: float = 0.002) -> tuple[Measurement, NDArray[np.bool_]]:
    """(what is logged of a cell that converts every so many rows, which rows only repeat), with 10 mN of noise."""
    t, x, force = clean()
    rng = np.random.default_rng(seed)
    converted = np.floor((np.arange(len(t)) + rng.uniform(0.0, rows)) / rows).astype(int)
    again = np.concatenate([[False], np.diff(converted) == 0])
    new = np.flatnonzero(~again)
    said = np.rint((force + 0.01 * rng.standard_normal(len(t))) / digit_N) * digit_N
    f = said[new[np.cumsum(~again) - 1]]
    return Measurement("held", t, x + 1e-4 * rng.standard_normal(len(t)), t, f), again


@pytest.mark.parametrize("rows", [2.0, 2.5, 3.0, 8.0, 9.7])
@pytest.mark.parametrize("digit_N", [1e-6, 0.002, 0.008])
def test_a_slow_converter_is_told(rows: float, digit_N: float) -> None:
    by_chance = digit_N / (2.0 * np.sqrt(np.pi) * 0.01)  # that a new value is the one before, which nobody can tell
    for seed in SEEDS:
        m, again = held(rows, seed, digit_N=digit_N)
        assert rows_per_conversion(m.force_N) == int(rows)
        found = copies(m.force_N)
        assert np.mean(again[found]) >= 1.0 - by_chance / (rows - 1.0)
        assert np.sum(found & again) >= (1.0 - by_chance / (rows - 1.0)) * np.sum(again)


@pytest.mark.parametrize("noise_N", [0.0, 0.0005, 0.002, 0.006, 0.02])
@pytest.mark.parametrize("up_mm_s", [0.05, 0.8, 30.0])
def test_digits_and_noise_are_no_slow_converter(noise_N: float, up_mm_s: float) -> None:
    _, _, force = clean(up_mm_s)
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        said = np.rint((force + noise_N * rng.standard_normal(len(force))) / 0.002) * 0.002
        assert not copies(said).any()
        assert not copies(said[::40]).any()


@pytest.mark.parametrize("share", [0.05, 0.3, 0.6, 0.875])
def test_samples_that_stick_by_chance_are_no_slow_converter(share: float) -> None:
    _, _, force = clean()
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        said = np.rint((force + 0.01 * rng.standard_normal(len(force))) / 0.002) * 0.002
        sticks = rng.random(len(said)) < share
        sticks[0] = False
        assert not copies(said[np.flatnonzero(~sticks)[np.cumsum(~sticks) - 1]]).any()


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_fit_leaves_the_copies_out_and_says_so(seed: int) -> None:
    m, again = held(8.0, seed)
    fitted = identify.fit(m)
    assert fitted.law == "power" and fitted.order == 2
    assert np.sqrt(fitted.V) < 1.1 * 0.01
    for name, true in TRUE.items():
        assert abs(fitted.parameters[name].value - true) < 4.5 * fitted.parameters[name].std, name
    assert any("a new one every 8 samples" in note for note in fitted.notes)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_diagnosis_names_them_and_nothing_else(seed: int) -> None:
    m, again = held(8.0, seed)
    d = diagnose(m, Model.from_dict(BELIEVED.model()))
    assert d.verdict == "explained"
    assert [cause.id for cause in d.causes] == ["stuck_samples"]
    fraction = d.causes[0].parameters["fraction"]
    assert abs(fraction.value - float(np.mean(again))) < 2.0 * fraction.std
    assert d.held_out_after < 1.15 * 0.01


@pytest.mark.parametrize("rows", [2, 4, 8])
def test_rows_that_repeat_as_a_whole_are_left_out_whole(tmp_path: Path, rows: int) -> None:
    """As a logger writes that is faster than what it reads: the axis does not stand and jump between."""
    t, x, force = clean(2.0)
    rng = np.random.default_rng(rows)
    said = (np.arange(len(t)) // rows) * rows
    x = np.round(x + 1e-4 * rng.standard_normal(len(t)), 4)[said]
    force = (np.rint((force + 0.01 * rng.standard_normal(len(t))) / 0.002) * 0.002)[said]
    write_csv(tmp_path / "rows.csv", t, x, t, force)
    m = read_recording(tmp_path / "rows.csv").measurement()
    assert any(f"a new one every {rows} samples" in note for note in m.notes)
    fitted = identify.fit(m, law="power", order=2, contact="unilateral")
    for name, true in TRUE.items():
        assert abs(fitted.parameters[name].value - true) < 4.5 * fitted.parameters[name].std, name


def test_positions_of_any_bench_are_taken_for_what_they_are() -> None:
    for seed in range(20):
        position = null_case(seed).position_mm
        assert not copies(position[np.isfinite(position)]).any()
    _, x, _ = clean()
    for count_mm in (1e-6, 1e-3, 0.01, 0.1):
        assert not copies(np.rint(x / count_mm) * count_mm).any()


def test_a_cell_that_stops_converting_costs_a_fit_nothing() -> None:
    """From the middle of a hold on it repeats one value; its last moves are lost, and nothing that was felt before."""
    t, x, force = clean()
    off: dict[str, list[float]] = {name: [] for name in TRUE}
    for seed in range(6):
        rng = np.random.default_rng(seed)
        f = np.rint((force + 0.01 * rng.standard_normal(len(t))) / 0.001) * 0.001
        frozen = int(rng.uniform(0.80, 0.84) * len(t))
        f[frozen:] = f[frozen]
        m = Measurement("frozen", t, x + 1e-4 * rng.standard_normal(len(t)), t, f)
        fitted = identify.fit(m, law="power", order=2)
        assert any(f"for {len(t) - frozen - 1} samples" in note and "left out" in note for note in fitted.notes)
        for name, true in TRUE.items():
            number = fitted.parameters[name]
            off[name].append((number.value - true) / number.std)
    assert all(np.sqrt(np.mean(np.square(z))) < 2.0 for z in off.values()), off


def test_what_stands_still_for_good_reasons_is_no_drop_out() -> None:
    rng = np.random.default_rng(1)
    depth = np.linspace(0.0, 1.0, 400)
    noisy = np.rint((depth + 0.01 * rng.standard_normal(400)) / 0.001) * 0.001
    ceiling = np.minimum(noisy, 0.8)
    let_go = np.where(np.arange(400) > 300, 0.0, noisy)
    coarse = np.rint(noisy / 0.1) * 0.1
    settled = 1.0 + np.exp(-np.arange(400.0))  # to the last digit after some 40 samples
    for force in (noisy, ceiling, let_go, coarse, settled):
        assert not drop_outs(force, depth, 0.01).any()
    noisy[200:240] = noisy[200]
    assert np.array_equal(np.flatnonzero(drop_outs(noisy, depth, 0.01)), np.arange(201, 240))


@pytest.mark.parametrize("step", [0.48876, 0.0122337])
def test_a_coarse_channel_of_which_each_level_is_met_once_has_a_step(step: float) -> None:
    """A ramp through the levels of a converter, in a file of five digits: no value comes often, and all are whole."""
    rng = np.random.default_rng(3)
    counts = np.rint(np.cumsum(np.abs(rng.normal(1.5, 1.0, 300))))
    assert resolution(np.round(25.0 + step * counts, 5)) == 0.0
    assert spacing(np.round(25.0 + step * counts, 5)) == pytest.approx(step, rel=1e-3)
    for seed in SEEDS:  # nor has noise any
        rng = np.random.default_rng(seed)
        assert spacing(rng.standard_normal(400)) == 0.0
        assert spacing(np.cumsum(rng.exponential(1.0, 400))) == 0.0


def test_a_coarse_channel_at_rest_does_not_stick() -> None:
    """Twice the same within a step of the converter is no accident, and no fault either."""
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        climbs = np.concatenate([np.zeros(20), np.linspace(0.0, 60.0, 300)]) + 0.15 * rng.standard_normal(320)
        force = np.round(29.32551 + 0.48876 * np.rint(climbs / 0.48876), 5)
        found = faults(force)
        assert not found.stuck.any() and not found.saturated.any() and found.good.mean() > 0.99
