"""The compiled loop: exact derivatives, the same physics as sim, memory bounded by chunks."""

from __future__ import annotations

import numpy as np
import pytest

from bench.identify import fit, objective, problem, runs
from bench.identify.laws import exponential, polynomial, power
from bench.identify.objective import Structure
from tests.truth.laws import Exponential, Power
from tests.truth.pad import Pad

from .closed_form import measured


@pytest.mark.parametrize("family", [exponential(), power(), polynomial(4)], ids=lambda f: f.name)
@pytest.mark.parametrize("unilateral", [True, False])
def test_derivatives_are_exact(family, unilateral: bool) -> None:
    data = problem.build([measured(Pad(Exponential(2.24, 0.69), (0.3, 0.2), (5.0, 0.4)), samples=400)])
    structure = Structure(family, 2, unilateral)
    theta = family.starts[4]
    x = np.concatenate([theta, np.log([5.0, 0.4]), [0.5, 0.3, 0.2]])
    (piece,) = objective.simulate(data.runs[0], structure, x, derivatives=True)
    assert piece.let_go.any() == unilateral
    for j in range(structure.size):
        h = np.zeros(structure.size)
        h[j] = 1e-6
        (up,), (down,) = (objective.simulate(data.runs[0], structure, x + s * h) for s in (1, -1))
        same = up.let_go == down.let_go  # a sample on the edge of contact has no derivative
        numeric = (up.force - down.force) / 2e-6
        np.testing.assert_allclose(piece.jacobian[same, j], numeric[same], atol=2e-7 * max(1.0, np.abs(numeric).max()))


def test_normal_equations_do_not_depend_on_the_chunk(monkeypatch: pytest.MonkeyPatch) -> None:
    data = problem.build([measured(Pad(Exponential(2.24, 0.69), (0.3, 0.2), (5.0, 0.4)), samples=500)])
    structure = Structure(exponential(), 2, True)
    x = np.concatenate([[1.5], np.log([5.0, 0.4]), [0.5, 0.3, 0.2]])
    whole = objective.normal_equations(data, structure, x)
    monkeypatch.setattr(runs, "CHUNK", 77)
    for a, b in zip(whole, objective.normal_equations(data, structure, x), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-11)


@pytest.mark.parametrize("contact", ["bonded", "unilateral"])
@pytest.mark.parametrize("law", ["exponential", "power", "polynomial"])
def test_the_model_it_returns_simulates_what_it_fitted(law: str, contact: str) -> None:
    data = measured(Pad(Power(1.7, 0.8), (0.3, 0.2), (5.0, 0.4), contact), noise_N=0.001)  # type: ignore[arg-type]
    data.force_time_s, data.force_N = data.force_time_s[5:-5:2], data.force_N[5:-5:2]
    result = fit(data, law=law, order=2, contact=contact)
    simulated = result.model.simulate_at(data.position_time_s, data.position_mm, data.force_time_s)
    np.testing.assert_allclose(simulated, result.simulated, atol=1e-9 * np.abs(data.force_N).max())


def test_a_long_hold_leaves_no_slow_numbers() -> None:
    """States that decay for thousands of time constants must end at zero, not among subnormal numbers."""
    time = np.arange(20000) * 0.01
    depth = np.minimum(time, 1.0)
    m = measured(Pad(Exponential(2.0, 0.7)), samples=20)
    m.position_time_s, m.position_mm, m.force_time_s, m.force_N = time, depth, time, depth
    run = problem.build([m]).runs[0]
    structure = Structure(exponential(), 1, True)
    (piece,) = objective.simulate(run, structure, np.array([1.0, np.log(50.0), 0.5, 0.5]), derivatives=True)
    assert piece.jacobian[-1, 1] == 0.0
