"""Motion between samples: exact where a planner's trapezoid was sampled, never worse, and what it does to a fit."""

from __future__ import annotations

import numpy as np
import pytest

from bench.identify import continuous, fit, problem
from bench.motion_between import motion_between
from tests.truth import draw
from tests.truth import motion as motions
from tests.truth.dataset import make
from tests.truth.draw import POLYURETHANE
from tests.truth.laws import Exponential
from tests.truth.motion import Motion
from tests.truth.noise import Noise, White
from tests.truth.pad import Pad, simulate

from .closed_form import measurement, of_dataset

LEVELS = [0.6, 1.3, 2.4, 0.9, 1.7, -0.5]


def errors(motion: Motion, rate_hz: float, noise_mm: float = 0.0) -> tuple[float, float]:
    """RMS distance from the true motion in mm: of straight lines between samples, of the motion rebuilt."""
    t = np.arange(0, motion.duration_s, 1 / rate_hz)
    x = motion.position(t) + noise_mm * np.random.default_rng(1).standard_normal(len(t))
    fine = np.linspace(0, t[-1], 50 * len(t))
    true = motion.position(fine)
    straight, rebuilt = np.interp(fine, t, x), np.interp(fine, *motion_between(t, x, noise_mm=noise_mm))
    return float(np.sqrt(np.mean((straight - true) ** 2))), float(np.sqrt(np.mean((rebuilt - true) ** 2)))


@pytest.mark.parametrize("rate_hz", [100.0, 137.0, 250.0, 1000.0])
@pytest.mark.parametrize(("speed", "acceleration"), [(80.0, 5000.0), (20.0, 2000.0), (60.0, np.inf)])
def test_trapezoids_are_found_again(rate_hz: float, speed: float, acceleration: float) -> None:
    motion = motions.staircase(LEVELS, speed, 0.7, acceleration_mm_s2=acceleration, lead_s=0.503)
    straight, rebuilt = errors(motion, rate_hz)
    # What is left is the chords between the new nodes, of a bend of 1e-4 of the reach at the most.
    assert rebuilt < 5e-4 and rebuilt <= straight
    if straight > 1e-3:
        assert rebuilt < 0.1 * straight


@pytest.mark.parametrize("noise_mm", [0.0, 0.0005])
def test_other_motions_are_no_worse_than_straight_lines(noise_mm: float) -> None:
    rng = np.random.default_rng(5)
    for motion in (
        motions.sinusoids(0.5, 2.0, (0.3, 4.0)),
        motions.random_steps(rng, 2.5, 20),
        motions.rate_sweep(2.0, (1.0, 10.0, 90.0), 0.5, 0.5),
    ):
        for rate_hz in (100.0, 500.0):
            straight, rebuilt = errors(motion, rate_hz, noise_mm)
            assert rebuilt <= 1.02 * straight


def test_a_fast_sine_is_followed() -> None:
    straight, rebuilt = errors(motions.sinusoids(0.5, 2.5, (8.0,), periods=40), 100.0)
    assert rebuilt < 0.4 * straight


def test_samples_stay_and_nothing_is_added_where_nothing_matters() -> None:
    motion = motions.staircase(LEVELS, 80.0, 0.7)
    t = np.arange(0, motion.duration_s, 0.01)
    x = motion.position(t)
    time, position = motion_between(t, x)
    assert len(time) > len(t) and np.all(np.diff(time) > 0)
    at = np.searchsorted(time, t)
    np.testing.assert_array_equal(time[at], t)
    np.testing.assert_array_equal(position[at], x)
    slow = motions.staircase(LEVELS, 0.5, 0.7)
    stamps = np.arange(0, slow.duration_s, 0.01)
    depths = slow.position(stamps)
    same = motion_between(stamps, depths)
    assert same[0] is stamps and same[1] is depths


def test_corners_between_samples_bias_no_parameter() -> None:
    """At 100 Hz and noise of 0.05 % of the force, straight lines are off by many standard errors."""
    z, cost = [], []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        depth = rng.uniform(1.5, 3.0)
        levels = (depth * np.array([0.25, 0.5, 0.75, 1.0, 0.5, 0.2])).tolist()
        motion = motions.staircase([*levels, -0.5], 80.0, 3.0, lead_s=float(rng.uniform(0.5, 0.51)))
        data = make(POLYURETHANE, motion, 100.0, Noise(White(0.004)), rng)
        result = fit(of_dataset(data), law="exponential", order=2)
        for name, value in POLYURETHANE.parameters().items():
            z.append((result.parameters[name].value - value) / result.parameters[name].std)
        cost.append(result.V / float(np.mean((data.force_N - data.truth.force_true_N) ** 2)))
    assert np.sqrt(np.mean(np.square(z))) < 1.5  # with straight lines it is above 4
    assert max(cost) < 1.001


def test_clean_data_on_straight_lines_keep_them() -> None:
    """Forces computed from straight lines between the samples, at corners that a real drive does not make."""
    pad = Pad(Exponential(2.24, 0.69), (0.25, 0.15), (4.0, 0.35))
    motion = motions.staircase(LEVELS, 80.0, 2.0)
    t = np.arange(0, motion.duration_s, 0.01)
    x = motion.position(t)
    F = simulate(pad, motions.sampled(t, x), t, max_step_s=0.001).force_N
    result = fit(measurement(t, x, F), law="exponential", order=2)
    # The law bends within a straight line too, which the model leaves out: so nearly, not quite.
    assert result.rmse < 0.01 * float(np.max(F))
    assert result.parameters["b"].value == pytest.approx(0.69, rel=0.03)


@pytest.mark.long
def test_of_the_two_paths_the_one_with_the_lower_cost_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    """By however little: else V would be above that of the true numbers where the two are close."""
    data, options = [], []
    for seed in range(12):
        rng = np.random.default_rng([31, seed])
        drawn = draw.pad(rng, orders=(1,))
        levels = (drawn.depth_mm * np.array([0.25, 0.5, 0.75, 1.0, 0.5])).tolist()
        motion = motions.staircase([*levels, -0.5], 80.0, 1.0, lead_s=float(rng.uniform(0.5, 0.51)))
        made = make(drawn.pad, motion, 200.0, Noise(White(0.01 * drawn.force_N)), rng)
        data.append(of_dataset(made))
        polynomial = drawn.pad.law.name == "polynomial"
        options.append({"law": drawn.pad.law.name, "order": 1, "degree": 3 if polynomial else None})

    def squares() -> list[float]:
        return [fit(m, contact=c, **o).V for m, o in zip(data, options, strict=True) for c in ("bonded", "unilateral")]

    found = squares()
    monkeypatch.setattr(continuous, "straightened", lambda plain, choice: False)
    rebuilt = squares()
    monkeypatch.setattr(continuous, "build", lambda m, between=False, blocks=False: problem.build(m, blocks=blocks))
    straight = squares()
    assert found == pytest.approx(np.minimum(rebuilt, straight), rel=1e-8)
    assert 0 < np.sum(np.array(straight) < rebuilt) < len(found)  # neither path is always the better
