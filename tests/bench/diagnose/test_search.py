"""The search among the candidates; data of the independent simulator."""

from __future__ import annotations

import numpy as np
import pytest

from bench.diagnose.channel import faults, not_of_the_motion
from bench.diagnose.data import Data, prepare
from bench.diagnose.diagnose import believed_structure
from bench.diagnose.numbers import PadNumbers, Structure
from bench.diagnose.refit import Fit, chi2, force_at, refit
from bench.diagnose.search import Search
from sim.elastic import Exponential
from sim.model import Model
from sim.pad import Pad
from sim.relaxation import Relaxation
from tests.bench.diagnose.small import measurement
from tests.truth.cases import Case, draw_case


def begun(c: Case) -> tuple[Search, Fit]:
    """A search, and the believed structure refitted."""
    m = measurement(c)
    p = prepare(m, not_of_the_motion(m, faults(m.force_N)).good)
    structure = believed_structure(Model.from_dict(c.believed), p)
    search = Search(p, structure, lambda _: None)
    return search, search.base([structure.pad.x()])


@pytest.mark.parametrize("seed", [1, 3])
def test_a_form_whose_valley_is_apart_from_the_best_ones_is_found(seed):
    """From where a joint that opens has ended no way leads to one that has closed."""
    c = draw_case(seed, ("frame_compliance",), 2.5, "joint_closes", protocol="rich", rate_hz=150.0, jitter="none")
    search, base = begun(c)
    trial = search.ranked(base, only=["frame_compliance"])[0]
    assert trial.cause.form.name == "closing"
    assert trial.fit.chi2 < 1.1 * search.expected


@pytest.mark.parametrize("seed", [1, 3])
def test_another_law_is_told_by_the_form_of_few_numbers(seed):
    """Its numbers lean on each other: a few steps from where it resembles the fit do not say what it is worth."""
    c = draw_case(seed, ("elastic_law",), 0.1, "ogden", protocol="staircase", rate_hz=140.0, jitter="none")
    search, base = begun(c)
    trial = search.ranked(base, only=["elastic_law", "encoder_error"])[0]
    assert trial.cause.form.name.startswith("polynomial")
    assert trial.fit.chi2 < 1.05 * search.expected


def test_where_a_model_runs_away_its_error_has_no_end_and_no_step_is_taken_there():
    """Forces of e^120 N are numbers still; over a noise this small they are none."""
    time, depth = np.arange(500) * 0.01, np.linspace(0.0, 2.0, 500)
    data = Data(time, depth, 3.0 * depth, np.ones(500), np.full(500, 1e-260), np.zeros(500, dtype=np.intp))
    pad = PadNumbers(Pad(Exponential(0.3, 60.0), Relaxation(), unilateral=True), 2.0, 6.0)
    assert np.isfinite(force_at(data, Structure(pad), pad.x())).all()
    assert chi2(data, Structure(pad), pad.x()) == np.inf
    assert np.array_equal(refit(data, Structure(pad), pad.x(), 5).x, pad.x())
