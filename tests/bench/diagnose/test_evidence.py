"""When a step of the search is believed."""

from __future__ import annotations

import pytest

from bench.diagnose.evidence import Evidence, threshold


@pytest.mark.parametrize(
    ("effective", "known", "pays"), [(14.0, 0, False), (42.0, 0, True), (42.0, 1, False), (60.0, 1, True)]
)
def test_a_further_cause_takes_more_than_a_first(effective: float, known: int, pays: bool) -> None:
    # 1 in 100 over 150 tries is 1 in 15,000, which χ² of one number passes at 15.9.
    assert threshold(1) == pytest.approx(15.9, abs=0.1)
    step = Evidence(effective, effective, 1, threshold(1), share=0.1, crumb=0.02, of_left=0.5, known=known)
    assert step.pays is pays
