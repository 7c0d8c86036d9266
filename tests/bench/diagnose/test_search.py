"""The search among the candidates; data of the independent simulator."""

from __future__ import annotations

import pytest

from bench.diagnose.channel import faults, not_of_the_motion
from bench.diagnose.data import prepare
from bench.diagnose.diagnose import believed_structure
from bench.diagnose.search import Search
from sim.model import Model
from tests.bench.diagnose.small import measurement
from tests.truth.cases import draw_case


@pytest.mark.parametrize("seed", [1, 3])
def test_a_form_whose_valley_is_apart_from_the_best_ones_is_found(seed):
    """From where a joint that opens has ended no way leads to one that has closed."""
    c = draw_case(seed, ("frame_compliance",), 2.5, "joint_closes", protocol="rich", rate_hz=150.0, jitter="none")
    m = measurement(c)
    p = prepare(m, not_of_the_motion(m, faults(m.force_N)).good)
    structure = believed_structure(Model.from_dict(c.believed), p)
    search = Search(p, structure, lambda _: None)
    trial = search.ranked(search.base([structure.pad.x()]), only=["frame_compliance"])[0]
    assert trial.cause.form.name == "closing"
    assert trial.fit.chi2 < 1.1 * search.expected
