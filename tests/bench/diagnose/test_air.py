"""Runs without a pad: what the bench adds by itself, made by the independent simulator's own motion and friction."""

from __future__ import annotations

import numpy as np
import pytest

from bench.diagnose import diagnose
from bench.recording.types import Measurement
from sim.model import Model
from tests.truth.effects.plant import followed
from tests.truth.effects.third_machine import _sliding
from tests.truth.motion import Path

AIR = {"pad": {"elastic": {"law": "none"}, "relaxation": {"shares": [], "rates": []}, "contact": "unilateral"}}
RATE_HZ, NOISE_N, WAVES_ALONG = 250.0, 0.008, 8.3
COULOMB_N, COGGING_N = 0.08, 0.12
MASS_KG, SERVO_S, FINE_S = 0.2, 4e-3, 1e-4


def to_and_fro(seed: int) -> Measurement:
    """Moves at random over 11 mm, with friction and a ripple that is there eight times along the way."""
    rng = np.random.default_rng(seed)
    path = Path(0.0, 3000.0).hold(1.0)
    for target in [5.5, -5.5, *rng.uniform(-5.5, 5.5, 14)]:
        path = path.to(float(target), float(rng.choice([5.0, 15.0, 50.0]))).hold(0.8)
    motion = path.motion()
    fine = np.arange(0.0, motion.duration_s, 2e-4)
    x, level = motion.position(fine), np.ones(len(fine))
    period = 11.0 / WAVES_ALONG
    force = COULOMB_N * _sliding(x, 2e-3, level, level) + COGGING_N * np.sin(2 * np.pi * x / period + seed)
    t = np.arange(0.0, motion.duration_s - 0.01, 1 / RATE_HZ)
    at = motion.position(t) + 3e-4 * rng.standard_normal(len(t))
    felt = np.interp(t, fine, force) + NOISE_N * rng.standard_normal(len(t))
    return Measurement("air", t, at, t, felt)


def started_and_stopped(seed: int) -> Measurement:
    """A mass of 0.2 kg on the cell, moved at random above the surface by a drive that smooths, at 1 kHz."""
    rng = np.random.default_rng(seed)
    path = Path(-6.0, 3000.0).hold(1.0)
    for target in rng.uniform(-11.0, -0.5, 16):
        path = path.to(float(target), float(rng.uniform(25.0, 80.0))).hold(0.6)
    motion = path.motion()
    fine = np.arange(0.0, motion.duration_s, FINE_S)
    x = followed(fine, motion.position(fine), SERVO_S)
    force = 1e-3 * MASS_KG * np.gradient(np.gradient(x, FINE_S), FINE_S)
    t = np.arange(0.0, motion.duration_s - 0.01, 1e-3)
    at = np.interp(t, fine, x) + 3e-4 * rng.standard_normal(len(t))
    felt = np.interp(t, fine, force) + NOISE_N * rng.standard_normal(len(t))
    return Measurement("air", t, at, t, felt)


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.parametrize("seed", [1, 2, 3, 4, 5])
def test_a_mass_is_found_in_a_long_run_without_a_pad(seed: int) -> None:
    # Nothing but the motion says there how finely the run must be looked at.
    said = diagnose(started_and_stopped(seed), Model.from_dict(AIR))
    assert said.verdict == "explained" and [cause.id for cause in said.causes] == ["inertia"]
    assert said.causes[0].parameters["mass"].value == pytest.approx(MASS_KG, rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, *(pytest.param(s, marks=pytest.mark.long) for s in (2, 3, 4))])
def test_friction_and_a_short_ripple_are_told_apart(seed: int) -> None:
    said = diagnose(to_and_fro(seed), Model.from_dict(AIR))
    found = {cause.id: cause.parameters for cause in said.causes}
    assert said.verdict == "explained" and set(found) == {"friction", "cogging"}
    assert found["friction"]["coulomb"].value == pytest.approx(COULOMB_N, rel=0.05)
    assert found["cogging"]["amplitude"].value == pytest.approx(COGGING_N, rel=0.05)
    assert found["cogging"]["period"].value == pytest.approx(11.0 / WAVES_ALONG, rel=0.01)
