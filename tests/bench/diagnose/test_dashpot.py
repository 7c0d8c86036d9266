"""A mode that a refit has made a dashpot: what it is worth as one."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from bench.diagnose.dashpot import instead_of_a_mode
from bench.diagnose.numbers import Cause, PadNumbers, Structure, cause_of
from bench.diagnose.refit import Fit
from sim.effects import effect
from sim.elastic import Exponential
from sim.pad import Cascade, Pad
from sim.relaxation import Relaxation

SAMPLE_S = 1 / 600
RUN_AWAY = Pad(Exponential(10.0, 0.8), Relaxation((0.98, 0.005), (3000.0, 2.0)), True)
BELIEVED = (30.0, 2.0)


def fitted(pad: Pad) -> Fit:
    structure = Structure(PadNumbers(pad, 2.0, 5.0))
    x = structure.x(structure.pad.x())
    return Fit(structure, x, 0.0, np.eye(len(x)), True)


def damping(form: str) -> Cause:
    cause = cause_of(effect("viscous_damping"), effect("viscous_damping").form(form))
    return cause.with_start(at_depth=1.0) if form == "with_stiffness" else cause


def test_a_mode_beyond_the_sampling_is_a_damping_in_proportion_to_stiffness():
    cause = instead_of_a_mode(fitted(RUN_AWAY), BELIEVED, damping("with_stiffness"))
    assert cause is not None
    numbers = {**cause.start, "growth": 0.8}
    t = np.arange(0.0, 2.0, SAMPLE_S)
    x = 1.0 - np.cos(2 * np.pi * t)
    slow = Pad(Exponential(10.0 * 0.02, 0.8), Relaxation((0.25,), (2.0,)), True)  # what is left of it
    damped = Cascade(slow, [effect("viscous_damping").active("with_stiffness", **numbers)]).simulate(t, x)
    alone = Cascade(RUN_AWAY, []).simulate(t, x)
    assert np.sqrt(np.mean((damped - alone) ** 2)) < 0.01 * np.sqrt(np.mean(alone**2))


def test_its_coefficient_is_stiffness_times_share_over_rate():
    cause = instead_of_a_mode(fitted(RUN_AWAY), BELIEVED, damping("with_stiffness"))
    assert cause is not None
    assert_allclose(cause.start["coefficient"], 10.0 * np.exp(0.8) * 0.98 / 3000.0, rtol=1e-9)


@pytest.mark.parametrize(("rates", "id"), [((1500.0, 2.0), "viscous_damping"), (BELIEVED, "inertia")])
def test_no_damping_is_made_of_a_mode_as_it_was_believed(rates, id):
    assert instead_of_a_mode(fitted(RUN_AWAY), rates, cause_of(effect(id), effect(id).forms[0])) is None
