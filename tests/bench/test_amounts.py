"""Amounts that cannot be negative."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from bench import amounts as module
from bench.amounts import amounts


@pytest.mark.parametrize("scale", [1e-12, 1.0, 1e9])
def test_of_a_sum_its_amounts_are_found_and_what_is_not_there_is_none(scale: float) -> None:
    k = np.arange(1.0, 13.0)
    columns = np.stack([np.ones(12), 1e-5 * 0.7**k, 1e4 * 0.2**k], axis=1)
    found, left = amounts(columns, scale * (2.0 + 3e-5 * 0.7**k))
    assert_allclose(found, scale * np.array([2.0, 3.0, 0.0]), rtol=1e-9, atol=1e-12 * scale)
    assert left < 1e-12 * scale
    found, left = amounts(columns[:, :1], -scale * np.ones(12))
    assert found == [0.0] and left == pytest.approx(scale * np.sqrt(12.0))


@pytest.mark.parametrize("seed", range(10))
def test_where_the_active_set_comes_back_to_itself_the_amounts_are_the_same(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(seed)
    columns, wanted = rng.uniform(0.1, 1.0, (30, 4)), rng.uniform(0.0, 1.0, 30)
    plain, left = amounts(columns, wanted)

    def cycles(*_: object) -> None:
        raise RuntimeError("Maximum number of iterations reached.")

    monkeypatch.setattr(module, "nnls", cycles)
    other, as_much = amounts(columns, wanted)
    assert_allclose(other, plain, atol=1e-5)
    assert as_much == pytest.approx(left, rel=1e-6)


def test_nothing_wanted_is_nothing() -> None:
    assert amounts(np.ones((3, 2)), np.zeros(3))[1] == 0.0
