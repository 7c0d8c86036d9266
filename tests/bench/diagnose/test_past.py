"""Recordings that begin while the pad is pressed: the state that their past has left is no cause."""

from __future__ import annotations

import numpy as np
import pytest

from bench.diagnose import Diagnosis, diagnose
from bench.like import likeness
from bench.recording.types import Measurement
from sim.model import Model
from tests.bench.diagnose.small import measurement
from tests.truth.cases import Case, draw_case
from tests.truth.motion import Path

PRESSED_S, EASED_S = 2.5, 10.8
"""Amid the first hold of `begun_late`, and amid the third one, which the pad was let up to."""


def begun_late(seed: int, ids: tuple[str, ...], from_s: float) -> tuple[Case, Measurement, Diagnosis]:
    """Holds at several depths from a time on, its stamps from 0 on, and the diagnosis of it."""
    path = Path(-0.5, 3000.0).hold(1.0).to(0.9, 10.0).hold(4.0).to(1.7, 5.0).hold(4.0).to(0.7, 8.0).hold(3.0)
    path = path.to(1.4, 2.0).hold(4.0).to(-0.3, 5.0).hold(2.0).to(1.6, 20.0).hold(5.0).to(-0.3, 3.0).hold(2.0)
    c = draw_case(seed, ids, 1.0, motion=path.motion(), rate_hz=150.0, own_clock=False)
    m = measurement(c)
    told, felt = m.position_time_s >= from_s, m.force_time_s >= from_s
    cut = Measurement(
        m.name, m.position_time_s[told] - from_s, m.position_mm[told], m.force_time_s[felt] - from_s, m.force_N[felt]
    )
    return c, cut, diagnose(cut, Model.from_dict(c.believed))


@pytest.mark.slow
@pytest.mark.parametrize("from_s", [PRESSED_S, EASED_S])
@pytest.mark.parametrize("seed", [1, 2, *(pytest.param(s, marks=pytest.mark.long) for s in range(3, 9))])
def test_what_the_past_has_left_is_no_cause(seed, from_s):
    _, m, d = begun_late(seed, (), from_s)
    assert d.verdict == "consistent"
    assert any("its past is not known" in said for said in d.doubts)
    again = likeness(Model.from_dict(d.model_dict), m).rmse_N
    assert again == pytest.approx(d.rmse_after, rel=0.01), "whoever compares the model finds the state again"


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, *(pytest.param(s, marks=pytest.mark.long) for s in range(2, 7))])
def test_a_cause_is_found_beside_what_the_past_has_left(seed):
    c, _, d = begun_late(seed, ("friction",), PRESSED_S)
    assert [cause.id for cause in d.causes] == ["friction"] and d.verdict == "explained"
    assert d.causes[0].parameters["coulomb"].value == pytest.approx(c.truth.parameters["friction"]["coulomb"], rel=0.1)


def test_without_a_pad_there_is_no_past():
    """A bench in air that stands below where the surface would be."""
    t = np.arange(0.0, 8.0, 0.01)
    x = 2.0 + np.interp(t, [1.0, 2.0, 4.0, 5.0], [0.0, 1.0, 1.0, -1.0])
    m = Measurement("air", t, x, t, np.random.default_rng(1).normal(0.0, 0.01, t.size))
    d = diagnose(m, Model.from_dict({"pad": {"elastic": {"law": "none"}}}))
    assert d.verdict == "consistent" and not d.doubts


def test_a_run_that_begins_in_air_begins_at_rest():
    _, m, d = begun_late(1, (), 0.0)
    assert not any("its past is not known" in said for said in d.doubts)
    assert not likeness(Model.from_dict(d.model_dict), m).begins_inside and np.isfinite(d.rmse_after)
