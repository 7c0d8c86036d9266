import numpy as np
import pytest
from numpy.testing import assert_allclose

from bench.paper.tables import PrintedRow, rows, tables


def test_nine_rows_as_printed() -> None:
    assert list(tables()) == ["I", "II", "III"]
    assert [row.order for row in rows()] == [1, 2, 3, 4, 1, 2, 3, 4, 4]
    assert [table.printed.method for table in tables().values()] == ["noniterative", "iterative", "fast"]
    assert [row.V for row in rows()] == [0.2703, 0.0759, 0.5074, 0.1079, None, None, None, None, None]
    last = tables()["III"].row(4)
    assert last.filter.a == (1.0, -1.1942, 0.2149, 0.0257, -0.0261)
    assert last.filter.b == (1.0, -0.8502, -0.2029, -0.0844, 0.1464)
    with pytest.raises(KeyError):
        tables()["III"].row(2)


def test_elastic_laws_follow_from_gamma() -> None:
    """γ_1 δ^γ_2 for (10), (γ_1/γ_2)(e^(γ_2 δ) − 1) for (9)."""
    delta = np.array([0.6, 1.2, 2.4])
    assert_allclose(tables()["I"].row(2).law.force(delta), 1.4559 * delta**1.7708)
    assert_allclose(tables()["II"].row(2).law.force(delta), 2.2445 / 0.6911 * np.expm1(0.6911 * delta))


def test_table_I_order_2_alternates() -> None:
    """z² − 0.0874 z − 0.8945 = 0, by hand: 0.0437 ± √(0.0437² + 0.8945)."""
    row = tables()["I"].row(2)
    assert_allclose(row.poles, [0.990489, -0.903089], atol=1e-6)
    assert row.stable
    assert row.relaxation is None
    assert "-0.9031 is negative" in row.reason


def test_table_I_order_3_is_unstable() -> None:
    row = tables()["I"].row(3)
    assert_allclose(row.poles[0], -1.007, atol=1e-3)
    assert not row.stable
    assert [r.stable for r in rows()].count(False) == 1
    assert "unstable" in row.reason


def test_table_I_order_4_grows_through_a_hold() -> None:
    """(1 − 0.3142 + 3.1638 + 2.7338 − 6.5291)/(1 − 0.8787 + 0.4685 − 0.1295 − 0.44)."""
    row = tables()["I"].row(4)
    assert_allclose(row.static_gain, 0.0543 / 0.0203)
    assert_allclose(row.static_gain, 2.67, atol=0.01)
    assert "a held force would grow" in row.reason


def test_table_II_order_2_has_a_negative_share() -> None:
    """Partial fractions of the step response: c_1 = 0.98 at 0.964, c_2 = −0.61 at 0.102."""
    row = tables()["II"].row(2)
    assert_allclose(row.poles, [0.9641, 0.1021], atol=1e-4)
    residue = [(p**2 - 0.5556 * p - 0.4243) / ((p - 1) * (p - q)) for p, q in (row.poles, row.poles[::-1])]
    assert_allclose(residue, [0.98, -0.61], atol=0.005)
    assert "share -0.6" in row.reason


def test_only_order_1_relaxes() -> None:
    assert [row.order for row in rows() if row.relaxation is not None] == [1, 1]
    for row in rows():
        assert (row.relaxation is None) == bool(row.reason)
    shares, rates = tables()["I"].row(1).relaxation or ((), ())
    assert_allclose(rates, [-np.log(0.9261)], rtol=1e-12)
    assert_allclose(shares, [1 - (1 - 0.9823) / (1 - 0.9261)], rtol=1e-9)  # g ends at B(1)/A(1) = c_0


def test_orders_above_1_have_complex_or_negative_poles_or_shares() -> None:
    odd = [row for row in rows() if row.order in (3, 4)]
    assert all(np.any((row.poles.imag != 0) | (row.poles.real < 0)) for row in odd)


def test_a_row_with_unequal_orders_is_refused() -> None:
    with pytest.raises(ValueError, match="l = r"):
        PrintedRow(a=(0.1,), b=(0.1, 0.2), gamma=(1.0, 1.0))
