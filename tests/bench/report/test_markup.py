import math

import pytest

from bench.report import markup


@pytest.mark.parametrize(
    ("value", "std", "shown"),
    [
        (2.2413, 0.0102, ("2.241", "0.010")),
        (0.6893, 0.0021, ("0.6893", "0.0021")),
        (-12.34, 0.5, ("−12.34", "0.50")),
        (1234.0, 56.0, ("1234", "56")),
        (0.25, 0.00996, ("0.250", "0.010")),
        (3.5, math.nan, ("3.500", "–")),
        (3.5, 0.0, ("3.500", "0")),
    ],
)
def test_value_and_doubt_have_the_same_digits(value: float, std: float, shown: tuple[str, str]) -> None:
    assert markup.measured(value, std) == shown


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (0.0, "0"),
        (9.9999, "10.00"),
        (-0.01234, "−0.01234"),
        (1e-9, "1.000e−09"),
        (math.nan, "–"),
        (math.inf, "–"),
    ],
)
def test_digits(value: float, shown: str) -> None:
    assert markup.digits(value) == shown


def test_forces_stand_in_one_unit() -> None:
    assert markup.forces(0.0307, 0.0121) == ["30.7 mN", "12.1 mN"]
    assert markup.forces(0.7, 0.0121) == ["0.700 N", "0.0121 N"]
    assert markup.forces(0.0307, math.nan) == ["30.7 mN", "–"]


@pytest.mark.parametrize(
    ("key", "shown"),
    [
        ("surface_mm", "surface 5 mm"),
        ("speed_mm_s", "speed 5 mm/s"),
        ("humidity_percent", "humidity 5 %"),
        ("temperature_C", "temperature 5 °C"),
        ("samples", "samples 5"),
        ("in_a_row", "in a row 5"),
        ("N", "N 5"),
    ],
)
def test_units_in_names_are_read_out(key: str, shown: str) -> None:
    assert markup.named(key, "5") == shown


def test_escaping_and_cutting() -> None:
    assert markup.text("<b>\"'&") == "&lt;b&gt;&quot;&#x27;&amp;"
    long = markup.text("x" * (markup.LONGEST + 5))
    assert "5 characters more" in long and len(long) < markup.LONGEST + 100


def test_a_column_shares_its_decimals() -> None:
    assert markup.column([118.0, 30.7, 0.0, math.nan]) == ["118.0", "30.7", "0.0", "–"]


def test_powers_are_raised() -> None:
    assert markup.raised("N/mm^2") == "N/mm²"
    assert markup.raised("mm^-1") == "mm⁻¹"
