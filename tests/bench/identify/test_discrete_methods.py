"""The paper's methods and the instrumental variable, on data of tests.truth; what is random is asserted as a rate."""

from __future__ import annotations

import functools
import json
import math

import numpy as np
import pytest
from scipy.signal import lfilter

from bench import identify
from bench.errors import InputError
from bench.identify import FitResult
from bench.identify.discrete import Start, over_sample_times
from sim.model import Model

from .discrete_data import GEL, T, exact, measurement, steps

DISCRETE = ("noniterative", "iterative", "fast", "iv")
TRUE_POLES = np.exp(-np.array([0.35, 4.0]) * T)


def fitted(m, method, order=2, **options) -> FitResult:
    return identify.fit(m, method=method, law="exponential", order=order, **options)


@functools.cache
def on_steps(method: str, order: int = 2, seed: int = 0) -> FitResult:
    return fitted(measurement(steps(seed)), method, order)


@functools.cache
def on_exact(method: str, samples: int, noise_N: float, seed: int) -> FitResult:
    m = exact(seed, samples, noise_N)
    return fitted(m, method, sample_time=T, contact="bonded")


# --- without noise every method that minimises over all the data finds the truth ---


@pytest.mark.parametrize("method", ["noniterative", "iterative", "iv"])
def test_exact_data_give_the_true_numbers(method):
    f = on_exact(method, 400, 0.0, 0)
    assert f.physical and f.contact == "bonded" and f.rmse < 1e-4
    found = {name: p.value for name, p in f.parameters.items()}
    for name, value in {"m": 2.24, "b": 0.69, "c_1": 0.25, "c_2": 0.15, "nu_1": 4.0, "nu_2": 0.35}.items():
        assert found[name] == pytest.approx(value, rel=2e-3), name


@pytest.mark.parametrize("law", ["power", "polynomial"])
def test_the_other_laws_are_fitted_too(law):
    from tests.truth.laws import Polynomial, Power
    from tests.truth.pad import Pad

    truth = {"power": Power(3.0, 0.7), "polynomial": Polynomial((0.0, 2.0, 0.5, 0.3))}[law]
    m = exact(1, 400, 0.0, Pad(truth, GEL.shares, GEL.rates, "bonded"))
    f = identify.fit(m, method="iv", law=law, order=2, degree=3 if law == "polynomial" else None, sample_time=T)
    for name, value in truth.parameters().items():
        if value:
            assert f.parameters[name].value == pytest.approx(value, rel=5e-3), name


# --- form ---


@pytest.mark.parametrize("method", DISCRETE)
@pytest.mark.parametrize("order", [1, 2, 3])
def test_the_result_keeps_the_form(method, order):
    f = on_steps(method, order)
    out = json.loads(json.dumps(f.to_json(), allow_nan=False))
    assert out["filter"]["sample_time_s"] == pytest.approx(0.01) and out["iterations"] >= 1
    assert len(out["filter"]["a"]) == len(out["filter"]["b"]) == order + 1
    assert out["filter"]["a"][0] == out["filter"]["b"][0] == 1.0 and len(out["filter"]["poles"]) == order
    assert {"m", "b"} <= set(out["parameters"]) and f.samples == len(f.time_s)
    assert np.mean(f.residual**2) == pytest.approx(f.V)
    assert {"V", "m", "b", "a_1", "b_1"} <= set(f.history)
    pad = Model.from_dict(out["model"]).pad
    if f.physical:
        poles = np.exp(-np.array(pad.relaxation.rates) * 0.01)
        real = sorted((p[0] for p in out["filter"]["poles"]), reverse=True)
        assert len(poles) == 0 or np.allclose(sorted(poles, reverse=True), real[: len(poles)], atol=1e-6) or order == 3
        assert min(pad.relaxation.shares, default=1.0) >= 0 and sum(pad.relaxation.shares) <= 1 + 1e-9
    else:
        assert list(pad.relaxation.shares) == [] and {"a_1", "b_1"} <= set(out["parameters"])
        assert any("no relaxation" in note or "falls" in note for note in f.notes)


@pytest.mark.parametrize("method", ["noniterative", "iterative", "iv"])
def test_V_is_the_simulated_output_error(method):
    m = exact(3, 400, 0.1)
    f = fitted(m, method, sample_time=T, contact="bonded")
    assert f.filter is not None
    law = {name: f.parameters[name].value for name in ("m", "b")}
    u = law["m"] / law["b"] * np.expm1(law["b"] * m.position_mm)
    simulated = lfilter(f.filter["b"], f.filter["a"], u)
    assert np.mean((m.force_N - simulated) ** 2) == pytest.approx(f.V, rel=1e-6)


def test_laws_and_orders_are_compared():
    f = identify.fit(measurement(steps()), method="iv")
    assert (f.law, f.order) == ("exponential", 2) and len(f.evidence) > 8
    assert [e.chosen for e in f.evidence].count(True) == 1 and f.held_out_rmse < 2 * f.noise_floor


def test_two_runs_share_one_pad():
    f = fitted([measurement(steps(1)), measurement(steps(2))], "iv")
    assert len(f.traces) == 2 and f.parameters["m"].value == pytest.approx(2.24, rel=0.01)


@pytest.mark.parametrize(
    ("options", "where"),
    [
        ({"law": "spline"}, "--law"),
        ({"order": "9"}, "--order"),
        ({"contact": "loose"}, "--contact"),
        ({"degree": 2, "law": "power"}, "--degree"),
        ({"ramps": "some", "method": "fast"}, "--ramps"),
        ({"starts": 0, "method": "noniterative"}, "--starts"),
        ({"starts": 3}, "--starts"),
        ({"sample_time": 0.01, "method": "recursive"}, "--sample-time"),
    ],
)
def test_what_cannot_be_asked_is_named(options, where):
    with pytest.raises(InputError) as error:
        identify.fit(measurement(steps()), **({"method": "iv"} | options))
    assert error.value.place == where


# --- noniterative ---


def test_starts_show_their_ends():
    f = fitted(measurement(steps()), "noniterative", 3, starts=4)
    V = [a["V"] for a in f.attempts]
    assert len(V) == 4 and all(np.diff(V) >= 0) and V[0] == pytest.approx(f.V)
    assert f.history["V"][0] >= f.history["V"][-1]


def test_own_starts_may_end_in_a_local_minimum():
    near = fitted(measurement(steps()), "noniterative", starts=[Start([-1.95, 0.955], [-1.97, 0.972])])
    ends = fitted(
        measurement(steps()),
        "noniterative",
        starts=[Start([0.9, 0.0], [0.9, 0.0]), Start([-1.95, 0.955], [-1.97, 0.972])],
    )
    assert abs(near.V / ends.V - 1) < 1e-3 and len(ends.attempts) == 2


def test_nested_orders_do_not_get_worse():
    V = [on_steps("noniterative", r).V for r in (1, 2, 3)]
    assert V[1] < 0.1 * V[0] and V[2] <= V[1] * 1.001


# --- ARX is biased under output noise, the instrumental variable is not ---


def errors(method: str, samples: int, seeds: range) -> np.ndarray:
    """Of each draw, the distance of the slow rate from the truth, 1/s."""
    out = []
    for seed in seeds:
        f = on_exact(method, samples, 0.1, seed)
        assert f.filter is not None
        slow = f.filter["poles"][0][0]
        out.append(-math.log(max(slow, 1e-6)) / T - 0.35)
    return np.array(out)


@pytest.mark.long
def test_the_bias_of_arx_stays_and_that_of_iv_goes():
    short, long = (errors("iv", n, range(4)) for n in (600, 2400))
    arx = errors("iterative", 2400, range(4))
    assert np.all(arx > 0.35)  # twice as fast as the truth, or more, in every draw
    assert np.median(np.abs(long)) < 0.02 and np.median(np.abs(long)) < np.median(np.abs(short))
    assert abs(long.mean()) < 3 * long.std(ddof=1) / math.sqrt(len(long)) + 2e-3


def test_standard_errors_of_iv_cover():
    truth = {"m": 2.24, "b": 0.69, "c_1": 0.25, "c_2": 0.15, "nu_1": 4.0, "nu_2": 0.35}
    inside = []
    for seed in range(4):
        f = on_exact("iv", 2400, 0.1, seed)
        inside += [abs(f.parameters[n].value - x) < 2.6 * f.parameters[n].std for n, x in truth.items()]
    assert np.mean(inside) > 0.85


def test_fast_with_the_instrumental_variable_is_consistent_too():
    # γ is from one ramp of some samples, so c and m scatter; the rates are the linear step's.
    slow = {}
    for step in ("arx", "iv"):
        f = fitted(measurement(steps(rate_hz=1000.0)), "fast", step=step)
        assert f.filter is not None
        slow[step] = sorted(abs(complex(*p)) for p in f.filter["poles"])
    true = np.exp(-np.array([4.0, 0.35]) * 0.01)
    assert np.allclose(slow["iv"], true, atol=3e-3) and not np.allclose(slow["arx"], true, atol=3e-3)


# --- fast ---


def test_fast_reads_the_law_on_the_first_ramp_and_all_ramps_make_it_soft():
    soft, right = [], []
    for seed in range(4):
        m = measurement(steps(seed, rate_hz=1000.0))
        recovered, every = fitted(m, "fast", 1), fitted(m, "fast", 1, ramps="all")
        depth = 2.4
        true = 2.24 / 0.69 * math.expm1(0.69 * depth)
        law = [f.model.pad.law.force(depth).item() / true - 1 for f in (recovered, every)]
        right.append(law[0])
        soft.append(law[1])
        assert recovered.iterations == 1 and 0 <= recovered.figures["loss_in_ramp"] < 0.02
    assert abs(np.mean(right)) < 0.1 and np.all(np.array(soft) < -0.15)
    estimated = recovered.figures["bias_of_all_ramps"]
    assert estimated == pytest.approx(soft[-1] - right[-1], abs=0.1)


def test_fast_refuses_slow_ramps_with_the_number():
    with pytest.raises(InputError, match=r"\d+ % of the force relaxes"):
        fitted(measurement(steps(speed_mm_s=1.0)), "fast")


def test_fast_needs_a_recovered_pad():
    m = measurement(steps())
    cut = m.position_time_s > 2.0
    loaded = type(m)("loaded", m.position_time_s[cut], m.position_mm[cut], m.force_time_s[cut], m.force_N[cut])
    with pytest.raises(InputError, match="recovered pad"):
        fitted(loaded, "fast")


# --- against the sample time ---


def test_numbers_over_sample_times():
    o = over_sample_times(measurement(steps()), "iv", "exponential", 2, [0.001, 0.01, 0.05])
    assert list(o.refused) == [0.001] and np.isnan(o.V[0])
    rates = np.sort(o.rates[1:].real, axis=1)
    assert np.allclose(rates, [0.35, 4.0], rtol=0.05) and o.physical[1:].all()
    assert np.all(np.isfinite(o.numbers["m"][1:])) and set(o.numbers) == {"m", "b", "a_1", "a_2", "b_1", "b_2"}
