"""A pad as plain data: parameters, transfer function, state space, digital filter."""

from __future__ import annotations

from typing import Any

from bench.export.realtime import DEFAULT_RATE_HZ, RealTimePad, checked_rate, digest, real_time_pad, version
from sim.digital import Filter
from sim.kernel import ramp_gain
from sim.model import Model
from sim.transfer import StateSpace, ramp_invariant, state_space, transfer_function, zero_order_hold


def describe(
    model: Model, rate_hz: float = DEFAULT_RATE_HZ, *, source: str = "", pad_only: bool = False
) -> dict[str, Any]:
    """Everything a program needs to run the pad at a rate; plain dicts, lists and numbers. See docs/export.md.

    Raises `Refused` for effects that have no form here (unless `pad_only`) and `InputError` for a rate that is none.
    """
    T = 1.0 / checked_rate(rate_hz)
    pad = real_time_pad(model, pad_only=pad_only)
    c, nu = pad.relaxation.shares, pad.relaxation.rates
    numerator, denominator = transfer_function(c, nu)
    gains = [ramp_gain.python(rate * T) for rate in nu]
    return {
        "padbench": version(),
        "source": source,
        "model_sha256": digest(model),
        "model": model.to_dict(),
        "left_out": list(pad.left_out),
        "parameters": _parameters(model, pad),
        "contact": pad.contact,
        "elastic": pad.law.to_dict(),
        "relaxation": {
            "c_0": pad.relaxation.c_0,
            "shares": list(c),
            "rates": list(nu),
            "time_constants_s": [1.0 / rate for rate in nu],
        },
        "transfer_function": {
            "input": "elastic force F^e, N",
            "output": "force F, N",
            "numerator": numerator.tolist(),
            "denominator": denominator.tolist(),
        },
        "state_space": _matrices(state_space(c, nu)),
        "discrete": {
            "rate_hz": rate_hz,
            "sample_time_s": T,
            "hold": "ramp",
            "decay": [1.0 - rate * T * gain for rate, gain in zip(nu, gains, strict=True)],
            "gain": gains,
            "state_space": _matrices(state_space(c, nu, T)),
            "filter": _filter(ramp_invariant(c, nu, T)),
            "zero_order_hold_filter": _filter(zero_order_hold(c, nu, T)),
        },
    }


def _parameters(model: Model, pad: RealTimePad) -> dict[str, dict[str, Any]]:
    std, believed = model.pad.std or {}, model.pad.parameters
    result: dict[str, dict[str, Any]] = {}
    for name, (value, unit) in pad.parameters.items():
        result[name] = {"value": value, "unit": unit}
        if name in std and believed.get(name) == value:
            result[name]["std"] = std[name]
    return result


def _matrices(space: StateSpace) -> dict[str, Any]:
    return {"A": space.A.tolist(), "B": space.B.tolist(), "C": space.C.tolist(), "D": space.D}


def _filter(filter: Filter) -> dict[str, Any]:
    poles = [[float(pole.real), float(pole.imag)] for pole in filter.poles]
    return {"a": list(filter.a), "b": list(filter.b), "poles": poles}
