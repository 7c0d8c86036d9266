"""Data without noise that follow the model's definition exactly: the fit must find the numbers they were made with."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.identify import FitResult, fit
from bench.recording.types import Measurement
from tests.truth.laws import Exponential, Law, Polynomial, Power
from tests.truth.pad import Pad

from .closed_form import force, measured, steps

LAWS = [
    Exponential(2.24, 0.69),
    Exponential(9.0, -0.8),
    Power(1.7, 0.8),
    Power(3.0, -0.4),
    Polynomial((0.0, 2.0, -0.3, 0.5)),
]
MODES = [((0.4,), (1.3,)), ((0.25, 0.15), (4.0, 0.35)), ((0.2, 0.15, 0.1), (9.0, 1.2, 0.2))]


def assert_found(result: FitResult, pad: Pad, within: float) -> None:
    for name, value in pad.parameters().items():
        assert result.parameters[name].value == pytest.approx(value, rel=within), name


@pytest.mark.parametrize("law", LAWS, ids=lambda law: f"{law.name} {sum(law.parameters().values()):.2g}")
@pytest.mark.parametrize("contact", ["bonded", "unilateral"])
def test_every_law_is_found(law: Law, contact: str) -> None:
    pad = Pad(law, (0.25, 0.15), (4.0, 0.35), contact)  # type: ignore[arg-type]
    result = fit(measured(pad), law=law.name, order=2, contact=contact, degree=3 if law.name == "polynomial" else None)
    assert result.converged and result.physical and result.undetermined == []
    assert_found(result, pad, 1e-6)
    assert result.rmse < 1e-9 * np.abs(result.traces[0].force_N).max()


@pytest.mark.parametrize(("shares", "rates"), MODES)
def test_every_order_is_found(shares: tuple[float, ...], rates: tuple[float, ...]) -> None:
    pad = Pad(Exponential(2.24, 0.69), shares, rates)
    assert_found(fit(measured(pad), law="exponential", order=len(shares)), pad, 1e-6)


def test_force_on_its_own_stamps() -> None:
    pad = Pad(Power(1.7, 0.8), (0.25, 0.15), (4.0, 0.35), "bonded")
    time, depth = steps(np.random.default_rng(3), 2.5)
    position_time, force_time = time[::2], time[1:-1:3]
    # The path between position samples is a straight line: the truth is made on the union of both stamps.
    union = np.union1d(position_time, force_time)
    path = np.interp(union, position_time, depth[::2])
    F = force(pad, union, path)[np.searchsorted(union, force_time)]
    result = fit(Measurement("own", position_time, depth[::2], force_time, F), law="power", order=2)
    assert_found(result, pad, 1e-6)
    assert result.samples == len(force_time)


@pytest.mark.long
def test_units_do_not_matter() -> None:
    pad = Pad(Exponential(2.24, 0.69), (0.25, 0.15), (4.0, 0.35))
    data = measured(pad, noise_N=0.02)
    tiny = replace(data, position_mm=data.position_mm * 1e-6, force_N=data.force_N * 1e-9)
    a, b = fit(data), fit(tiny)
    assert (a.law, a.order, a.contact) == (b.law, b.order, b.contact) == ("exponential", 2, "unilateral")
    factor = {"m": 1e-3, "b": 1e6}
    for name, p in a.parameters.items():
        assert b.parameters[name].value == pytest.approx(p.value * factor.get(name, 1.0), rel=1e-5)
        assert b.parameters[name].std == pytest.approx(p.std * factor.get(name, 1.0), rel=1e-3)
    assert b.fit_percent == pytest.approx(a.fit_percent, abs=1e-6)


def test_runs_of_one_pad_each_start_from_rest() -> None:
    pad = Pad(Exponential(2.24, 0.69), (0.25, 0.15), (4.0, 0.35))
    first, second = measured(pad, seed=1), measured(pad, seed=2, depth_mm=1.5)
    result = fit([first, second], law="exponential", order=2)
    assert_found(result, pad, 1e-6)
    assert result.samples == len(first.force_N) + len(second.force_N)
    assert [len(t.residual_N) for t in result.traces] == [len(first.force_N), len(second.force_N)]


def test_history_is_simulated_but_costs_nothing() -> None:
    pad = Pad(Exponential(2.24, 0.69), (0.25, 0.15), (4.0, 0.35))
    data = measured(pad)
    spoilt = data.force_N.copy()
    early, late = data.force_time_s < 8.0, data.force_time_s > 25.0
    spoilt[early | late] += 5.0
    result = fit(replace(data, force_N=spoilt, fit_from_s=8.0, fit_to_s=25.0), law="exponential", order=2)
    assert_found(result, pad, 1e-6)
    assert result.samples == int((~early & ~late).sum())
    assert result.V < 1e-15
    trace = result.traces[0]
    np.testing.assert_array_equal(trace.counted, ~early & ~late)
    np.testing.assert_allclose(trace.residual_N[early | late], 5.0, atol=1e-6)
