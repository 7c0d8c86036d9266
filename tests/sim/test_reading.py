"""Sentences with numbers in them read as a person would write them."""

import pytest

from sim.effects import effect
from sim.effects.reading import read


@pytest.mark.parametrize(
    ("id", "values", "said"),
    [
        ("clock_skew", {"skew": -23.69}, "loses 23.7 microseconds a second"),
        ("clock_skew", {"skew": 169.0}, "gains 169 microseconds a second"),
        ("contact_offset", {"offset": -0.0312}, "0.0312 mm higher than"),
        ("force_delay", {"delay": 0.001451}, "1.45 ms after"),
        ("outliers", {"fraction": 0.0106, "size": 1.0}, "1.06 % of the force samples"),
        ("depth_dependent_relaxation", {"slope": -0.112}, "fall by 11.2 % per mm"),
        ("force_bias", {"bias": -0.0243}, "off by -24.3 mN"),
        ("force_bias", {"bias": 1.25}, "off by 1.25 N"),
        ("force_drift", {"rate": -0.00267}, "falls by 2.67 mN per second"),
    ],
)
def test_sizes_signs_and_units_are_for_people(id: str, values: dict[str, float], said: str) -> None:
    assert said in effect(id).explanation(values)


def test_what_has_no_number_is_told() -> None:
    with pytest.raises(KeyError):
        read("{gap:size} mm", {})
