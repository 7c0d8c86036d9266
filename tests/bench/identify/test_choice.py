"""Which law, which order, which contact."""

from __future__ import annotations

import numpy as np
import pytest

from bench.identify import fit
from bench.identify.select import LARGE
from tests.truth.laws import Exponential, Polynomial, Power
from tests.truth.motion import Path
from tests.truth.pad import Pad, simulate

from .closed_form import measured, measurement

SHARES, RATES = (0.25, 0.15), (4.0, 0.35)


@pytest.mark.parametrize(
    ("law", "degree"),
    [
        (Exponential(2.24, 0.69), None),
        pytest.param(Power(1.7, 0.8), None, marks=pytest.mark.long),
        pytest.param(Polynomial((0.0, 2.0, -0.3, 0.5)), 3, marks=pytest.mark.long),
    ],
    ids=["exponential", "power", "polynomial"],
)
@pytest.mark.parametrize("contact", [pytest.param("bonded", marks=pytest.mark.long), "unilateral"])
def test_the_structure_the_data_were_made_with_is_chosen(law, degree, contact) -> None:
    right = 0
    for seed in range(3):
        result = fit(measured(Pad(law, SHARES, RATES, contact), seed, noise_N=0.02))
        right += (result.law, result.degree, result.order, result.contact) == (law.name, degree, 2, contact)
    assert right == 3


@pytest.mark.parametrize("order", [1, pytest.param(3, marks=pytest.mark.long)])
def test_other_orders(order: int) -> None:
    shares, rates = ((0.4,), (1.3,)) if order == 1 else ((0.2, 0.15, 0.1), (12.0, 1.4, 0.15))
    result = fit(measured(Pad(Exponential(2.24, 0.69), shares, rates), noise_N=0.01, samples=3000))
    assert (result.law, result.order) == ("exponential", order)


def test_evidence_is_complete_and_ranked() -> None:
    result = fit(measured(Pad(Exponential(2.24, 0.69), SHARES, RATES), noise_N=0.02))
    assert sum(e.chosen for e in result.evidence) == 1
    assert [e.criterion for e in result.evidence] == sorted(e.criterion for e in result.evidence)
    chosen = next(e for e in result.evidence if e.chosen)
    assert (chosen.law, chosen.order, chosen.contact) == (result.law, result.order, result.contact)
    assert pytest.approx(result.V) == chosen.V and chosen.held_out_rmse == pytest.approx(result.held_out_rmse)
    assert {e.law for e in result.evidence} == {"exponential", "power", "polynomial"}
    assert {e.contact for e in result.evidence} == {"bonded", "unilateral"}
    # Nested models: V does not rise with the order.
    V = {e.order: e.V for e in result.evidence if e.law == "exponential" and e.contact == "unilateral"}
    assert all(V[r + 1] <= V[r] * (1 + 1e-6) for r in sorted(V)[:-1])


def test_a_pad_that_never_lets_go_is_called_unilateral() -> None:
    pad = Pad(Exponential(2.24, 0.69), SHARES, RATES, "bonded")
    data = measured(pad, noise_N=0.02)
    until = int(np.argmax(data.position_time_s > 12.0))  # only going in
    data.position_time_s, data.position_mm = data.position_time_s[:until], data.position_mm[:until]
    data.force_time_s, data.force_N = data.force_time_s[:until], data.force_N[:until]
    result = fit(data, law="exponential", order=2)
    assert result.contact == "unilateral" and {e.contact for e in result.evidence} == {"unilateral"}


def test_noise_of_the_position_in_a_long_hold_buys_no_law() -> None:
    """Sample by sample a law that is soft at the depth of the hold alone lets less of that noise through."""
    path = Path(-0.5).hold(1).to(1.8, 60).hold(90).to(-0.5, 60).hold(3).to(1.8, 20).hold(4).to(-0.5, 20)
    motion = path.hold(1).motion()
    time = np.arange(0, motion.duration_s, 1e-3)
    rng = np.random.default_rng(0)
    F = simulate(Pad(Exponential(2.24, 0.69), SHARES, RATES), motion, time, 0.05).force_N
    F += 0.005 * rng.standard_normal(len(time))
    depth = motion.position(time) + 0.0015 * rng.standard_normal(len(time))
    result = fit(measurement(time, depth, F), order=2, contact="unilateral")
    assert len(time) > LARGE and result.law == "exponential"


def test_coloured_residuals_do_not_buy_modes() -> None:
    """A slow wander of the force, which more modes would follow for a while."""
    pad = Pad(Exponential(2.24, 0.69), (0.4,), (1.3,))
    data = measured(pad, samples=3000)
    rng = np.random.default_rng(5)
    wander = np.convolve(rng.standard_normal(len(data.force_N) + 60), np.ones(60) / 60, mode="valid")[1:]
    data.force_N = data.force_N + 0.05 * wander / wander.std()
    result = fit(data, law="exponential")
    assert result.independent_samples < 0.1 * result.samples
    assert result.order == 1


def test_held_out_error_is_that_of_unseen_blocks() -> None:
    result = fit(measured(Pad(Exponential(2.24, 0.69), SHARES, RATES), noise_N=0.05), law="exponential", order=2)
    assert result.rmse < result.held_out_rmse < 1.1 * result.rmse
    wrong = fit(measured(Pad(Exponential(2.24, 0.69), SHARES, RATES), noise_N=0.05), law="power", order=1)
    assert wrong.held_out_rmse > 3 * result.held_out_rmse
