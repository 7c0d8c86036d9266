"""When a step of the search is believed."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from bench.diagnose.evidence import Evidence, believable, threshold
from bench.diagnose.numbers import cause_of
from bench.diagnose.verdict import explains, speaks
from sim.effects import effect
from tests.bench.diagnose.small import made_up


@pytest.mark.parametrize(
    ("effective", "known", "pays"), [(14.0, 0, False), (42.0, 0, True), (42.0, 1, False), (60.0, 1, True)]
)
def test_a_further_cause_takes_more_than_a_first(effective: float, known: int, pays: bool) -> None:
    # 1 in 100 over 150 tries is 1 in 15,000, which χ² of one number passes at 15.9.
    assert threshold(1) == pytest.approx(15.9, abs=0.1)
    step = Evidence(effective, effective, 1, threshold(1), share=0.1, crumb=0.02, of_left=0.5, known=known)
    assert step.pays is pays


def test_what_takes_next_to_nothing_leaves_the_rest_as_explained_as_it_is() -> None:
    first = replace(made_up().causes[0], gain=0.8, confidence=0.99)
    for gain, explained in ((0.01, True), (0.05, False)):  # a fifth is left, and of a quarter 65 % are 16 %
        assert explains(0.19, [first, replace(first, gain=gain, confidence=0.65)]) is explained


@pytest.mark.parametrize(("time_constant_s", "own"), [(30.0, True), (1.0, False)])
def test_a_drift_that_is_over_at_once_is_a_bias(time_constant_s: float, own: bool) -> None:
    drift = effect("force_drift")
    cause = cause_of(drift, drift.form("settling"), {"rate": 3.0, "time_constant": time_constant_s})
    structure = SimpleNamespace(causes=(cause,), values=lambda x: [dict(cause.start)])
    fit: Any = SimpleNamespace(structure=structure, x=None)
    noise = SimpleNamespace(force_N=0.01)
    prepared: Any = SimpleNamespace(sample_s=0.01, position_noise_mm=1e-3, doubt_mm=0.0, zero_N=0.0, noise=noise)
    assert believable(fit, prepared) is own


@pytest.mark.parametrize(("alone", "explained"), [(-0.5, True), (-19.0, False)])
def test_causes_that_stand_against_each_other_explain_nothing(alone: float, explained: bool) -> None:
    first = replace(made_up().causes[0], gain=alone, confidence=0.9)
    assert explains(0.0, [first, replace(first, gain=1.0 - alone)]) is explained


@pytest.mark.parametrize(
    ("once", "confidence", "explained"), [(False, 0.5, True), (True, 0.5, False), (True, 0.9, True)]
)
def test_half_sure_names_explain_nothing_where_depths_are_met_once(
    once: bool, confidence: float, explained: bool
) -> None:
    cause = replace(made_up().causes[0], gain=1.0, confidence=confidence)
    assert explains(0.0, [cause], once) is explained


@pytest.mark.parametrize(
    ("excess", "square", "enough"),
    [
        (0.01, 1.01, True),  # beyond chance
        (0.0, 1.1, False),  # noise of a long memory leaves as much in one run and not in the next
        (0.0, 1.6, True),  # and this, but a test that knows of that sees something
    ],
)
def test_what_a_test_sees_is_unexplained_where_it_is_more_than_a_crumb(
    excess: float, square: float, enough: bool
) -> None:
    floor_N = 0.02
    assert speaks(excess * floor_N**2, square * floor_N**2, floor_N) is enough
