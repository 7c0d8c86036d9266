"""Pads that let go of the probe where the lab believes that they stick to it."""

import pytest

from bench.diagnose import diagnose
from sim.model import Model
from tests.bench.diagnose.small import measurement
from tests.truth.cases import draw_case


@pytest.mark.parametrize("seed", [1, *(pytest.param(s, marks=pytest.mark.long) for s in (3, 4, 5, 6, 7, 8))])
def test_the_share_of_a_face_that_stays_bonded_is_told(seed: int) -> None:
    """An eighth. Of these draws the second is left out: its pad hardly ever pulls."""
    c = draw_case(seed, ("separation",), 2.5, "partly", protocol="rich", rate_hz=100.0)
    found = diagnose(measurement(c), Model.from_dict(c.believed))
    assert found.verdict == "explained"
    assert [(cause.id, cause.form) for cause in found.causes] == [("separation", "partly")]
    bonded = found.causes[0].parameters["bonded"]
    assert abs(bonded.value - 0.125) < max(2 * bonded.std, 0.0025) and bonded.std < 0.02
