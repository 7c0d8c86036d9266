"""Samples that stand off where moves begin and end: strays of the channel, or what the motion makes. Data of the
independent simulator; rates over consecutive seeds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.diagnose import Diagnosis, diagnose
from bench.diagnose.asked_again import halted
from bench.diagnose.channel import resting, standing_off, strays
from bench.recording.types import Measurement
from sim.model import Model
from tests.bench.diagnose.small import measurement
from tests.truth.cases import Case, draw_case

SEEDS = range(3)


def said(id: str, shape: str, size: float, protocol: str, rate_Hz: float) -> list[tuple[Case, Diagnosis]]:
    """Cases and their diagnoses."""
    cases = [
        draw_case(seed, (id,), size, shape, protocol=protocol, rate_hz=rate_Hz, jitter="none", own_clock=False)
        for seed in SEEDS
    ]
    return [(c, diagnose(measurement(c), Model.from_dict(c.believed))) for c in cases]


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.parametrize(
    ("size", "protocol", "rate_Hz"),
    [(1.0, "random_steps", 300.0), (2.5, "random_steps", 300.0), (2.5, "staircase", 400.0)],
)
def test_strays_in_moves_are_told_once_the_model_is_right_beside_them(size, protocol, rate_Hz):
    """At the larger size hardly a sample of some bursts is right; in a staircase, of few moves, of none."""
    right = 0
    for case, found in said("outliers", "switching", size, protocol, rate_Hz):
        true, flagged = case.truth.flags["outlier"], found.flags["outliers"]
        hit = (true & flagged).sum()
        right += hit >= 0.9 * true.sum() and hit >= 0.9 * flagged.sum() and [c.id for c in found.causes] == ["outliers"]
    assert right >= len(SEEDS) - 1


@pytest.mark.slow
@pytest.mark.long
def test_what_a_motion_makes_in_a_sample_or_two_is_no_stray():
    for _, found in said("resonance", "second_order", 1.0, "staircase", 120.0):
        assert found.causes and found.causes[0].id == "resonance"
        assert found.flags["outliers"].sum() <= 1


@pytest.mark.slow
@pytest.mark.long
def test_a_mode_beyond_half_the_rate_of_sampling_is_found():
    """Some 110 to 200 Hz at 200 samples a second; the fastest may be too little to be seen."""
    found = [d.causes[0].id if d.causes else "" for _, d in said("resonance", "second_order", 0.15, "rich", 200.0)]
    assert found.count("resonance") >= len(SEEDS) - 1


def test_noise_in_heaps_has_no_strays_and_strays_stand_off_it():
    """Where a channel's step is twice the noise, most readings of a slow force say one of two values."""
    for seed in range(20):
        rng = np.random.default_rng(seed)
        force = 3.0 + np.exp(-np.linspace(0.0, 3.0, 8000))
        left = 0.05 * np.round((force + 0.025 * rng.standard_normal(8000)) / 0.05) - force
        everything, none = np.ones(8000, dtype=bool), np.zeros(8000, dtype=bool)
        assert not standing_off(left, everything, none, 0.05).any()
        stray = rng.choice(8000, 12, replace=False)
        left[stray] += 0.5
        assert np.array_equal(np.flatnonzero(standing_off(left, everything, none, 0.05)), np.sort(stray))


def test_strays_that_crowd_are_told_from_what_rings():
    """Every second sample within 20 ms of a start or a stop, up or down as it comes; or a mode that is struck there."""
    time = np.arange(0.0, 20.0, 0.001)
    position = np.interp(time % 1.0, [0.0, 0.3, 0.5, 0.8], [0.0, 0.0, 1.0, 1.0])
    m = Measurement("crowd", time, position, time, np.zeros_like(time))
    since = np.minimum((time - 0.3) % 1.0, (time - 0.5) % 1.0)
    for seed in range(10):
        rng = np.random.default_rng(seed)
        off = (since < 0.02) & (rng.random(len(time)) < 0.6)
        stray = np.where(off, rng.choice([-1.0, 1.0], len(time)) * rng.uniform(1.0, 2.0, len(time)), 0.0)
        assert strays(m, stray, off)
        for frequency_Hz in rng.uniform(20.0, 490.0, 5):
            struck = np.repeat(rng.choice([-1.0, 1.0], 40), 500)
            rung = struck * np.cos(2.0 * np.pi * frequency_Hz * since + 0.3)
            assert not strays(m, rung, since < 0.02), frequency_Hz


def test_bursts_of_strays_that_keep_their_sign_are_strays():
    """One to four samples at once, up or down as it comes, while the drive moves."""
    time = np.arange(0.0, 20.0, 0.001)
    position = np.interp(time % 1.0, [0.0, 0.3, 0.5, 0.8], [0.0, 0.0, 1.0, 1.0])
    m = Measurement("bursts", time, position, time, np.zeros_like(time))
    for seed in range(10):
        rng = np.random.default_rng(seed)
        error = np.zeros(len(time))
        for begin in rng.choice(np.flatnonzero(np.abs(np.gradient(position)) > 0.0), 120, replace=False):
            error[begin : begin + rng.integers(1, 5)] = rng.choice([-1.0, 1.0]) * rng.uniform(1.0, 2.0)
        assert strays(m, error, error != 0.0)
        towards = np.abs(error) * np.sign(np.gradient(position))  # a force that goes with the motion
        assert not strays(m, towards, towards != 0.0)
        struck = np.zeros(len(time))
        for corner in np.repeat(np.arange(20), 4) + np.tile([0.3, 0.5, 0.8, 1.0], 20):  # where a motion makes something
            begin = round(1000.0 * corner) + rng.integers(0, 15)
            struck[begin : begin + rng.integers(2, 5)] = rng.choice([-1.0, 1.0])
        assert not strays(m, struck, struck != 0.0)


def test_a_coarse_channel_that_stays_while_the_force_goes_on_is_stuck():
    """At rest it says the same value for as long by itself, and no length of run tells."""
    for seed in range(5):
        rng = np.random.default_rng(seed)
        force = np.concatenate([np.full(2000, 1.0), np.linspace(1.0, 4.0, 1000), np.full(2000, 4.0)])
        read = 0.05 * np.round((force + 0.01 * rng.standard_normal(5000)) / 0.05)
        stuck = np.zeros(5000, dtype=bool)
        for begin in (2100, 2400, 2800):
            stuck[begin : begin + 80] = True
            read[begin : begin + 80] = read[begin - 1]
        none = np.zeros(5000, dtype=bool)
        wrong = 0.9 * force + 0.1  # the model need not be right
        found = halted(read, wrong, none, 0.01)
        # the readings beside a run are of its value by chance
        assert (found & stuck).sum() >= 0.9 * stuck.sum() and (found & ~stuck).sum() <= 0.05 * stuck.sum()
        assert not halted(np.where(stuck, 4.4, read), wrong, none, 0.01).any()  # at its end: a ceiling


def test_a_force_that_goes_slower_than_the_model_says_is_not_stuck():
    """A step of a coarse channel takes long then, and nothing jumps at its end."""
    for seed in range(5):
        rng = np.random.default_rng(seed)
        force = np.concatenate([np.full(2000, 1.0), np.linspace(1.0, 1.6, 1000), np.full(2000, 1.6)])
        read = 0.05 * np.round((force + 0.005 * rng.standard_normal(5000)) / 0.05)
        far_off = 1.0 + 10.0 * (force - 1.0)
        assert not halted(read, far_off, np.zeros(5000, dtype=bool), 0.005).any()


def test_a_force_that_goes_on_a_sample_late_has_not_halted():
    # At rest, and on its way from the sample 50 on; the model has it there one sample too soon.
    read = np.concatenate([[-1.0], np.zeros(49), 0.1 * np.arange(1.0, 51.0)])
    soon = np.concatenate([[-1.0], read[2:], [5.1]])
    none = np.zeros(100, dtype=bool)
    assert not halted(read, soon, none, 0.005).any()
    stays = read.copy()
    stays[60:65] = stays[59]
    found = np.flatnonzero(halted(stays, soon, none, 0.005))
    assert found.size and set(found) <= set(range(60, 65))


@pytest.mark.parametrize(("count", "flagged"), [(1, 0), pytest.param(5, 5, marks=pytest.mark.long)])
def test_one_stray_is_left_out_and_no_fault_of_the_channel(count, flagged):
    for seed in SEEDS:
        c = draw_case(seed, (), protocol="staircase", rate_hz=150.0, jitter="none", noise_kind="white")
        m, rng = measurement(c), np.random.default_rng(seed)
        off = rng.choice(np.flatnonzero(resting(m)), count, replace=False)
        force_N = m.force_N.copy()
        force_N[off] += 60.0 * c.truth.noise_floor_N
        result = diagnose(replace(m, force_N=force_N), Model.from_dict(c.believed))
        assert np.array_equal(np.flatnonzero(result.flags["outliers"]), np.sort(off)[:flagged])
        assert [x.id for x in result.causes] == ["outliers"] * (flagged > 0)
        assert result.rmse_after < 1.2 * c.truth.noise_floor_N
