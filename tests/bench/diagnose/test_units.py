"""Data in other units than the model's, or with the other sign: the refit takes that up, and somebody must say so."""

from __future__ import annotations

from dataclasses import replace

import pytest

from bench.diagnose import diagnose
from bench.diagnose.units import doubts
from bench.diagnose.words import lines
from bench.recording.types import Measurement
from sim.elastic import Exponential, NoPad
from sim.model import Model
from sim.pad import Pad
from sim.relaxation import Relaxation
from tests.bench.diagnose.small import measurement
from tests.truth.cases import draw_case


def scaled(m: Measurement, mm: float = 1.0, N: float = 1.0, s: float = 1.0) -> Measurement:
    return replace(
        m,
        position_time_s=s * m.position_time_s,
        position_mm=mm * m.position_mm,
        force_time_s=s * m.force_time_s,
        force_N=N * m.force_N,
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("how", "said"),
    [
        ({}, ""),
        ({"mm": 1e-3}, "times as stiff as believed: are positions in mm and forces in N?"),
        ({"N": 1e-3}, "times as soft as believed: are positions in mm and forces in N?"),
        ({"s": 1e3}, "times as slowly as believed: are the stamps in s?"),
        ({"N": -1.0}, "is its sign turned?"),
    ],
)
def test_who_diagnoses_data_in_other_units_is_told(how, said):
    c = draw_case(3, (), law="exponential", protocol="staircase", rate_hz=100.0, jitter="none")
    d = diagnose(scaled(measurement(c), **how), Model.from_dict(c.believed))
    assert len(d.doubts) == bool(said) and all(said in sentence for sentence in d.doubts)
    assert set(d.doubts) <= set(d.to_json()["notes"])
    assert all(sum(sentence in line for line in lines(d)) == 1 for sentence in d.doubts)
    assert d.in_question == d.doubts and (not said or "first of all: " in lines(d)[1])


def pad(m: float, rates: tuple[float, ...]) -> Pad:
    return Pad(Exponential(m, 0.5), Relaxation((0.2,) * len(rates), rates), unilateral=True)


@pytest.mark.parametrize(
    ("refitted", "said"),
    [
        (pad(2.4, (10.0, 1.0)), []),
        (pad(9.0, (100.0, 0.2)), []),
        (pad(2.0, (1e4, 1.0)), []),  # one mode that the data hardly tell
        (pad(2000.0, (10.0, 1.0)), ["1,000 times as stiff"]),
        (pad(0.002, (0.01, 0.001)), ["1,000 times as soft", "1,000 times as slowly"]),
    ],
)
def test_numbers_may_be_off_but_not_by_another_unit(refitted, said):
    m = measurement(draw_case(3, (), protocol="staircase", rate_hz=100.0))
    found = doubts(m, pad(2.0, (10.0, 1.0)), refitted)
    assert len(found) == len(said) and all(part in whole for part, whole in zip(said, found, strict=True))


def test_a_bench_in_air_has_no_stiffness_to_doubt():
    m = measurement(draw_case(3, (), protocol="staircase", rate_hz=100.0))
    air = Pad(NoPad(), Relaxation(), unilateral=True)
    assert doubts(scaled(m, N=-1.0), air, air) == []
