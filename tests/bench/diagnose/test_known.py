"""A cause that the model has already is no finding: not the second time a bench is measured. Data of the independent
simulator; rates over consecutive seeds."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from bench.diagnose import diagnose
from bench.diagnose.data import prepare
from bench.diagnose.diagnose import believed_structure
from bench.diagnose.felt_errors import felt_errors, redrawn
from bench.diagnose.refit import refit
from sim.model import Model
from tests.bench.diagnose.small import measurement
from tests.truth.cases import Case, draw_case, null_case

SEEDS = range(3)


def known(c: Case, **off: float) -> Model:
    """What was believed, with the hidden effect's numbers, times `off`."""
    numbers = {
        name: value * off.get(name, 1.0) for _, told in c.truth.parameters.items() for name, value in told.items()
    }
    effects = [{"id": next(iter(c.truth.parameters)), **numbers}]
    return Model.from_dict({**c.believed, "effects": effects})


@pytest.mark.slow
@pytest.mark.parametrize(
    ("id", "shape", "rate_Hz", "off"),
    [
        ("friction", "coulomb", 120.0, {"coulomb": 0.8}),
        pytest.param("inertia", "rigid", 300.0, {"mass": 1.2}, marks=pytest.mark.long),
        pytest.param("encoder_error", "reported", 120.0, {"amplitude": 1.1}, marks=pytest.mark.long),
        pytest.param("cogging", "sine", 120.0, {"amplitude": 1.1}, marks=pytest.mark.long),
    ],
)
def test_what_is_believed_already_is_not_found_again(id, shape, rate_Hz, off):
    """Where a ripple stands in its period is not told: that is where the surface is, which is another one each time.
    Nor is the time over which an acceleration is taken, which goes with the sampling."""
    names = []
    for seed in SEEDS:
        c = draw_case(seed, (id,), 1.0, shape, protocol="staircase", rate_hz=rate_Hz, jitter="none", own_clock=False)
        said = diagnose(measurement(c), known(c, **off))
        names.append([cause.id for cause in said.causes] or said.verdict)
        assert said.rmse_before < 1.5 * c.truth.noise_floor_N
    assert names.count("consistent") >= len(SEEDS) - 1, names


@pytest.mark.parametrize(
    ("id", "shape"),
    [
        ("mains_hum", "sine"),
        pytest.param("outliers", "single", marks=pytest.mark.long),
        pytest.param("saturation", "hard", marks=pytest.mark.long),
    ],
)
def test_a_fault_of_the_channel_that_is_believed_is_not_told_as_missing(id, shape):
    c = draw_case(0, (id,), 1.0, shape, protocol="staircase", rate_hz=240.0, jitter="none", own_clock=False)
    m = measurement(c)
    assert [cause.id for cause in diagnose(m, Model.from_dict(c.believed)).causes] == [id]
    said = diagnose(m, known(c))
    assert said.verdict == "consistent" and [effect["id"] for effect in said.model_dict["effects"]] == [id]
    assert (said.flagged_fraction > 0) == (id != "mains_hum"), "its samples are left out all the same"
    if id == "mains_hum":
        assert said.rmse_before == pytest.approx(said.rmse_after, rel=0.05)


def felt(effects: list[dict[str, Any]]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(position at every force sample, what errors of the position make there in N, the noise of the force in N)."""
    c = null_case(1, noise_kind="white", protocol="staircase", rate_hz=300.0, jitter="none", own_clock=False)
    m = measurement(c)
    rng = np.random.default_rng(1)
    m = replace(m, position_mm=m.position_mm + 1e-3 * rng.standard_normal(len(m.position_mm)))
    p = prepare(m, np.ones(len(m.force_N), dtype=bool))
    structure = believed_structure(Model.from_dict({**c.believed, "effects": effects}), p)
    fit = refit(p.short, structure, structure.x(structure.pad.x()), 0, 1.0)
    told = felt_errors(p, fit, redrawn(p, np.random.default_rng(0)))
    return p.full.position_mm[p.at], told.total_N[p.at], p.full.sigma_N[p.at]


@pytest.mark.long
def test_errors_of_the_position_are_felt_by_what_feels_more_than_the_pad():
    _, through_the_pad, _ = felt([])
    assert not through_the_pad.any(), "the pad's stiffness is in the noise already"
    x, through_a_mass, noise = felt([{"id": "inertia", "mass": 0.3}])
    moving = np.abs(np.gradient(x)) > 1e-3
    assert np.median(through_a_mass[moving]) > 3 * np.median(noise)
    assert not through_a_mass[~moving].any() or np.median(through_a_mass[~moving]) < np.median(noise)
    _, through_friction, _ = felt([{"id": "friction", "coulomb": 0.3}])
    assert 0 < through_friction.max() < 0.6, "no more than all of it, either way"
