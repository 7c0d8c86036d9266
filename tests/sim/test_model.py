import json
import pickle
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydantic import ValidationError

from sim.elastic import Exponential
from sim.model import Model
from sim.relaxation import Relaxation

PAD: dict[str, Any] = {
    "elastic": {"law": "exponential", "m": 2.24, "b": 0.69},
    "relaxation": {"shares": [0.25, 0.15], "rates": [4.0, 0.35]},
    "contact": "unilateral",
    "std": {"m": 0.01, "b": 0.002, "c_1": 0.003},
}
FRICTION = {"id": "friction", "form": "coulomb", "coulomb": {"value": 0.05, "unit": "N", "std": 0.004}}


def with_pad(**changes: Any) -> dict[str, Any]:
    pad = {key: value for key, value in PAD.items() if key != "std"} | changes
    return {"pad": {key: value for key, value in pad.items() if value is not None}}


def refusal(data: dict[str, Any]) -> str:
    with pytest.raises(ValidationError) as caught:
        Model.from_dict(data)
    error = caught.value.errors()[0]
    return ".".join(map(str, error["loc"])) + ": " + error["msg"]


def test_the_contracts_form_goes_round_unchanged() -> None:
    written = {"pad": PAD, "effects": [FRICTION]}
    model = Model.from_dict(written)
    assert model.to_dict() == written
    assert Model.from_dict(model.to_dict()) == model
    assert Model.from_dict(json.loads(json.dumps(model.to_dict()))) == model


@pytest.mark.parametrize(
    "elastic",
    [
        {"law": "power", "p": 3.8, "q": 0.77},
        {"law": "polynomial", "alpha": [0.0, 1.5, 0.4]},
        {"law": "spline", "delta_mm": [0.0, 1.0, 2.0], "force_N": [0.0, 1.0, 4.0]},
        {"law": "none"},
    ],
)
def test_every_law_goes_round_and_runs(elastic: dict[str, Any]) -> None:
    model = Model.from_dict(with_pad(elastic=elastic))
    assert model.to_dict()["pad"]["elastic"] == elastic
    assert np.isfinite(model.simulate([0.0, 1.0], [0.0, 1.0])).all()


def test_what_may_be_left_out() -> None:
    model = Model.from_dict({"pad": {"elastic": {"law": "none"}}})
    assert model.pad.contact == "unilateral"
    assert model.pad.relaxation.rates == []
    assert model.effects == []


def test_parameters_have_the_names_of_fits() -> None:
    pad = Model.from_dict({"pad": PAD}).pad
    assert pad.parameters == {"m": 2.24, "b": 0.69, "c_1": 0.25, "c_2": 0.15, "nu_1": 4.0, "nu_2": 0.35}
    assert pad.units == {"m": "N/mm", "b": "1/mm", "c_1": "1", "c_2": "1", "nu_1": "1/s", "nu_2": "1/s"}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"elastic": {"law": "exponential", "m": 0.0, "b": 1.0}}, "exponential.m: Input should be greater than 0"),
        ({"elastic": {"law": "exponential", "m": True, "b": 1.0}}, "exponential.m: Input should be a valid number"),
        ({"elastic": {"law": "exponential", "m": "2", "b": 1.0}}, "exponential.m: Input should be a valid number"),
        ({"elastic": {"law": "power", "p": 1.0, "q": -1.0}}, "power.q: Input should be greater than -1"),
        ({"elastic": {"law": "power", "p": -1.0, "q": 0.0}}, "power.p: Input should be greater than 0"),
        ({"elastic": {"law": "rubber"}}, "does not match any of the expected tags"),
        ({"elastic": {"law": "exponential", "m": 1.0, "b": float("nan")}}, "exponential.b"),
        ({"elastic": {"law": "none", "m": 1.0}}, "none.m: Extra inputs"),
        ({"elastic": {"law": "spline", "delta_mm": [1.0, 0.5], "force_N": [1.0, 2.0]}}, "delta_mm must rise"),
        ({"relaxation": {"shares": [0.6, 0.5], "rates": [2.0, 1.0]}}, "shares add up to 1.1, more than 1"),
        ({"relaxation": {"shares": [-0.1], "rates": [2.0]}}, "shares.0: Input should be greater than or equal to 0"),
        ({"relaxation": {"shares": [0.1, 0.1], "rates": [1.0, 2.0]}}, "rates must descend"),
        ({"relaxation": {"shares": [0.1, 0.1], "rates": [1.0, 1.0]}}, "rates must descend"),
        ({"relaxation": {"shares": [0.1], "rates": [0.0]}}, "rates.0: Input should be greater than 0"),
        ({"relaxation": {"shares": [0.1], "rates": []}}, "1 shares but 0 rates"),
        ({"contact": "glued"}, "contact: Input should be 'unilateral' or 'bonded'"),
        ({"std": {"c_3": 0.1}}, "std: no parameter 'c_3'; did you mean 'c_"),
        ({"colour": "blue"}, "colour: Extra inputs"),
    ],
)
def test_pads_that_are_refused(changes: dict[str, Any], message: str) -> None:
    assert message in refusal(with_pad(**changes))


def test_shares_may_add_up_to_1() -> None:
    Model.from_dict(with_pad(relaxation={"shares": [0.1] * 10, "rates": [10.0 - i for i in range(10)]}))


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ({"id": "frictoin", "coulomb": 0.1}, "no effect 'frictoin'; did you mean 'friction'?"),
        ({"coulomb": 0.1}, "needs an `id`"),
        ({"id": "friction", "form": "coulumb", "coulomb": 0.1}, "no form 'coulumb'; did you mean 'coulomb'?"),
        ({"id": "friction", "colomb": 0.1}, "no parameter 'colomb'; did you mean 'coulomb'?"),
        ({"id": "friction"}, "friction (coulomb) needs 'coulomb' in N"),
        ({"id": "friction", "coulomb": {"value": 50, "unit": "mN"}}, "coulomb is in N, not mN"),
        ({"id": "friction", "coulomb": -0.1}, "coulomb must be from 0 to 5000 N, not -0.1"),
        ({"id": "friction", "coulomb": {"value": 0.1, "sdt": 0.1}}, "sdt: Extra inputs"),
        ({"id": "friction", "coulomb": "much"}, "value: Input should be a valid number"),
        ("friction", "valid dictionary"),
    ],
)
def test_effects_that_are_refused(entry: Any, message: str) -> None:
    assert message in refusal({"pad": PAD, "effects": [entry]})


def test_a_plain_number_is_a_value_and_the_first_form_the_default() -> None:
    model = Model.from_dict({"pad": PAD, "effects": [{"id": "friction", "coulomb": 0.05}]})
    assert model.to_dict()["effects"] == [{"id": "friction", "form": "coulomb", "coulomb": {"value": 0.05}}]


def test_simulate_is_the_pads_physics() -> None:
    t = np.arange(1000) * 1e-3
    x = 1.0 - np.cos(5 * t)
    model = Model.from_dict({"pad": PAD | {"contact": "bonded"}})
    expected = Relaxation((0.25, 0.15), (4.0, 0.35)).filter(t, Exponential(2.24, 0.69).force(x))
    assert_allclose(model.simulate(t, x), expected, atol=1e-11)
    assert_allclose(model.simulate_at(t, x, t[::7]), expected[::7], atol=1e-11)
    plant = model.plant()
    assert_allclose([plant.step(0.0 if n == 0 else 1e-3, float(p)) for n, p in enumerate(x)], expected, atol=1e-10)


def test_copies_and_pickles_carry_fields_only() -> None:
    model = Model.from_dict({"pad": PAD, "effects": [FRICTION]})
    before = model.simulate([0.0, 1.0], [0.0, 1.0])
    stiff = Model.from_dict({"pad": PAD | {"elastic": {"law": "exponential", "m": 9.0, "b": 0.0}}}).pad
    copied = model.model_copy(update={"pad": stiff})
    assert copied.simulate([0.0, 1.0], [0.0, 1.0])[1] > 2 * before[1]
    sent = pickle.loads(pickle.dumps(model))
    assert sent == model
    assert "cascade" not in sent.__dict__
    assert np.array_equal(sent.simulate([0.0, 1.0], [0.0, 1.0]), before)


def test_a_model_does_not_change() -> None:
    model = Model.from_dict({"pad": PAD})
    with pytest.raises(ValidationError):
        model.pad = model.pad


def test_json_schema_lists_each_form_with_its_parameters() -> None:
    schema = Model.model_json_schema()
    text = json.dumps(schema)
    assert '"additionalProperties": false' in text
    entry = schema["$defs"]["EffectEntry"]["oneOf"]
    friction = next(alternative for alternative in entry if alternative["properties"]["form"]["const"] == "stribeck")
    assert {"id", "form", "coulomb", "static_ratio"} <= set(friction["properties"])
    assert friction["required"] == ["id", "form", "coulomb"]
