"""The model file: a pad and its effects, as written in YAML (docs/formats.md, Model), and as something that runs."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Mapping
from functools import cached_property
from itertools import pairwise
from typing import Annotated, Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    GetJsonSchemaHandler,
    field_validator,
    model_serializer,
    model_validator,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

from sim.effects import Active, Effect, Form, Parameter, all_effects
from sim.effects.elastic_law import MOST_POINTS
from sim.elastic import ElasticLaw, Exponential, NoPad, Polynomial, Power, Spline
from sim.pad import Cascade, Pad, Plant
from sim.relaxation import Relaxation

Array = NDArray[np.float64]
# strict: a text or `true` in a file is a slip, not a number
Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Positive = Annotated[Number, Field(gt=0)]
NotNegative = Annotated[Number, Field(ge=0)]

SHARES_ROUNDING = 1e-9


def nearest(word: str, known: Iterable[str]) -> str:
    """`; did you mean 'x'?`, or what there is."""
    names = list(known)
    near = difflib.get_close_matches(word, names, n=1, cutoff=0.5)
    if near:
        return f"; did you mean {near[0]!r}?"
    return f"; there are {', '.join(names)}" if names else "; there are none"


class _Part(BaseModel):
    """Part of a model file: immutable, so that what was computed from it is kept, but not copied with it."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    def _forget(self) -> Self:
        for name in set(self.__dict__) - set(type(self).model_fields):
            del self.__dict__[name]
        return self

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """A copy, with `update` put in unchecked."""
        return super().model_copy(update=update, deep=deep)._forget()

    def __getstate__(self) -> dict[Any, Any]:
        state = super().__getstate__()
        fields = type(self).model_fields
        return {**state, "__dict__": {name: value for name, value in state["__dict__"].items() if name in fields}}


class ExponentialSpec(_Part):
    """K = m e^(bδ), (7) and (9)."""

    law: Literal["exponential"]
    m: Positive = Field(description="N/mm")
    b: Number = Field(description="1/mm")

    def elastic(self) -> ElasticLaw:
        """The law itself."""
        return Exponential(self.m, self.b)


class PowerSpec(_Part):
    """K = p δ^q, (8) and (10)."""

    law: Literal["power"]
    p: Positive = Field(description="N/mm^(q+1)")
    q: Annotated[Number, Field(gt=-1)] = Field(description="exponent of the stiffness")

    def elastic(self) -> ElasticLaw:
        """The law itself."""
        return Power(self.p, self.q)


class PolynomialSpec(_Part):
    """F^e = Σ α_i δ^i, (14)."""

    law: Literal["polynomial"]
    alpha: Annotated[list[Number], Field(min_length=2)] = Field(description="α_0, α_1 … in N/mm^i")

    def elastic(self) -> ElasticLaw:
        """The law itself."""
        return Polynomial(tuple(self.alpha))


class SplineSpec(_Part):
    """F^e through points."""

    law: Literal["spline"]
    delta_mm: Annotated[list[Number], Field(min_length=1)]
    force_N: Annotated[list[Number], Field(min_length=1)]

    @model_validator(mode="after")
    def _rises(self) -> Self:
        self.elastic()
        return self

    def elastic(self) -> ElasticLaw:
        """The law itself."""
        return Spline(tuple(self.delta_mm), tuple(self.force_N))


class NoPadSpec(_Part):
    """The bench in free air."""

    law: Literal["none"]

    def elastic(self) -> ElasticLaw:
        """The law itself."""
        return NoPad()


ElasticSpec = Annotated[
    ExponentialSpec | PowerSpec | PolynomialSpec | SplineSpec | NoPadSpec, Field(discriminator="law")
]


class RelaxationSpec(_Part):
    """c_1 … c_r and ν_1 … ν_r of (6); c_0 is what is left of 1."""

    shares: list[NotNegative] = Field(default_factory=list, description="c_1, c_2 …")
    rates: list[Positive] = Field(default_factory=list, description="ν_1, ν_2 … in 1/s, descending")

    @field_validator("shares")
    @classmethod
    def _leave_c_0(cls, shares: list[float]) -> list[float]:
        if math.fsum(shares) > 1.0 + SHARES_ROUNDING:
            raise ValueError(f"shares add up to {math.fsum(shares):g}, more than 1: nothing is left for c_0")
        return shares

    @field_validator("rates")
    @classmethod
    def _descend(cls, rates: list[float]) -> list[float]:
        if any(later >= earlier for earlier, later in zip(rates, rates[1:], strict=False)):
            raise ValueError("rates must descend from each to the next (with their shares in the same order)")
        return rates

    @model_validator(mode="after")
    def _match(self) -> Self:
        if len(self.shares) != len(self.rates):
            raise ValueError(f"{len(self.shares)} shares but {len(self.rates)} rates: one of each a mode")
        return self


class PadSpec(_Part):
    """The pad: elastic response, relaxation, contact, and the standard deviations of their numbers where known."""

    elastic: ElasticSpec
    relaxation: RelaxationSpec = Field(default_factory=RelaxationSpec)
    contact: Literal["unilateral", "bonded"] = "unilateral"
    std: dict[str, NotNegative] | None = None

    @model_validator(mode="after")
    def _std_of_something(self) -> Self:
        for name in self.std or {}:
            if name not in self.parameters:
                raise ValueError(f"std: no parameter {name!r}{nearest(name, self.parameters)}")
        return self

    @cached_property
    def law(self) -> ElasticLaw:
        """The elastic response."""
        return self.elastic.elastic()

    @property
    def parameters(self) -> dict[str, float]:
        """All numbers by the names that fits use: the law's, then c_1 …, nu_1 …"""
        relaxation = self.relaxation
        return (
            self.law.parameters
            | {f"c_{i}": c for i, c in enumerate(relaxation.shares, start=1)}
            | {f"nu_{i}": nu for i, nu in enumerate(relaxation.rates, start=1)}
        )

    @property
    def units(self) -> dict[str, str]:
        """Unit of each of `parameters`."""
        r = range(1, len(self.relaxation.rates) + 1)
        return self.law.units | {f"c_{i}": "1" for i in r} | {f"nu_{i}": "1/s" for i in r}

    def physics(self) -> Pad:
        """The pad as the plant takes it."""
        relaxation = Relaxation(tuple(self.relaxation.shares), tuple(self.relaxation.rates))
        return Pad(self.law, relaxation, self.contact == "unilateral")


class Quantity(_Part):
    """A number, its unit, and its standard deviation where known."""

    value: Number
    unit: str | None = None
    std: NotNegative | None = None


def _form_schema(effect: Effect, form: Form) -> dict[str, Any]:
    """JSON schema of one form of an effect as it stands in a file."""
    properties: dict[str, Any] = {"id": {"const": effect.id, "description": effect.what}}
    properties["form"] = {"const": form.name, "description": form.what}
    for parameter in form.parameters:
        number = {"type": "number", "minimum": parameter.lower, "maximum": parameter.upper}
        quantity = {
            "type": "object",
            "properties": {"value": number, "unit": {"const": parameter.unit}, "std": {"type": "number", "minimum": 0}},
            "required": ["value"],
            "additionalProperties": False,
        }
        properties[parameter.name] = {
            "description": f"{parameter.what}, {parameter.unit}",
            "anyOf": [number, quantity],
        }
    required = ["id"] if form is effect.forms[0] else ["id", "form"]
    required += [parameter.name for parameter in form.parameters if parameter.required]
    return {"type": "object", "properties": properties, "required": required, "additionalProperties": False}


def _unit(parameter: Parameter, before: str = " ") -> str:
    """The unit behind some word; nothing for a number without unit."""
    return "" if parameter.unit == "1" else before + parameter.unit


def _as_form(fields: dict[str, Any]) -> dict[str, Any]:
    """An elastic law written as in a pad, `law: polynomial, alpha: […]` or `law: spline, delta_mm: […], force_N: […]`,
    as the form that has it and its numbers."""
    law, alpha = fields.pop("law", None), fields.get("alpha")
    if law is not None:
        if fields.get("form", law) != law:
            raise ValueError(f"elastic_law has the law {law!r} and the form {fields['form']!r}: give one of them")
        fields["form"] = law
    if isinstance(alpha, list) and str(fields.get("form", "")).startswith("polynomial"):
        degree = max(2, len(alpha) - 1)
        fields["form"] = f"polynomial_{degree}"
        del fields["alpha"]
        fields |= {f"alpha_{i}": alpha[i] if i < len(alpha) else 0.0 for i in range(degree + 1)}
    if fields.get("form") == "spline" and {"delta_mm", "force_N"} & set(fields):
        curve = SplineSpec.model_validate({"law": "spline", **{k: v for k, v in fields.items() if k != "form"}})
        points = [(0.0, 0.0), *((d, f) for d, f in zip(curve.delta_mm, curve.force_N, strict=True) if d > 0.0)]
        if len(points) > MOST_POINTS + 1:
            raise ValueError(f"elastic_law takes {MOST_POINTS} points at the most, not {len(points) - 1}")
        fields = {"form": "points"}
        for i, (before, point) in enumerate(pairwise(points), start=1):
            fields |= {f"step_{i}": point[0] - before[0], f"rise_{i}": point[1] - before[1]}
    return fields


class EffectEntry(_Part):
    """One effect: `{id, form, <parameter>: {value, unit, std} or a number}`. `form` may be left out."""

    id: str
    form: str
    parameters: dict[str, Quantity] = Field(default_factory=dict)

    @model_validator(mode="before")
    @classmethod
    def _from_file(cls, data: Any) -> Any:
        if not isinstance(data, Mapping):
            return data
        fields = dict(data)
        fields |= fields.pop("parameters", None) or {}  # as the fields of this class are named
        name = fields.pop("id", None)
        if not isinstance(name, str):
            raise ValueError("an effect needs an `id`")
        effects = all_effects()
        if name not in effects:
            raise ValueError(f"no effect {name!r}{nearest(name, effects)}")
        if name == "elastic_law":
            fields = _as_form(fields)
        chosen = fields.pop("form", None) or effects[name].forms[0].name
        names = [form.name for form in effects[name].forms]
        if chosen not in names:
            raise ValueError(f"{name} has no form {chosen!r}{nearest(str(chosen), names)}")
        values = {
            key: value if isinstance(value, Mapping | Quantity) else {"value": value} for key, value in fields.items()
        }
        return {"id": name, "form": chosen, "parameters": values}

    @model_validator(mode="after")
    def _known(self) -> Self:
        known = {parameter.name: parameter for parameter in self._form.parameters}
        for name, quantity in self.parameters.items():
            if name not in known:
                raise ValueError(f"{self.id} ({self.form}) has no parameter {name!r}{nearest(name, known)}")
            parameter = known[name]
            if quantity.unit is not None and quantity.unit.replace("·", "*") != parameter.unit:
                raise ValueError(f"{self.id}: {name} is in {parameter.unit}, not {quantity.unit}")
            if not parameter.lower <= quantity.value <= parameter.upper:
                bounds = f"from {parameter.lower:g} to {parameter.upper:g}{_unit(parameter)}"
                raise ValueError(f"{self.id}: {name} must be {bounds}, not {quantity.value:g}")
        for parameter in self._form.parameters:
            if parameter.required and parameter.name not in self.parameters:
                raise ValueError(f"{self.id} ({self.form}) needs {parameter.name!r}{_unit(parameter, ' in ')}")
        return self

    @property
    def _form(self) -> Form:
        return all_effects()[self.id].form(self.form)

    def active(self) -> Active:
        """The effect with its numbers; those left out take their defaults."""
        form = self._form
        given = {name: quantity.value for name, quantity in self.parameters.items()}
        values = {p.name: given.get(p.name, p.if_left_out) for p in form.parameters}
        return Active(all_effects()[self.id], form, values)

    @classmethod
    def __get_pydantic_json_schema__(cls, core: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        """The file form: one alternative a form of each effect."""
        return {"title": "Effect", "oneOf": [_form_schema(e, form) for e in all_effects().values() for form in e.forms]}

    @model_serializer(mode="plain")
    def _to_file(self) -> dict[str, Any]:
        entry: dict[str, Any] = {"id": self.id, "form": self.form}
        for name, quantity in self.parameters.items():
            entry[name] = quantity.model_dump(exclude_none=True)
        return entry


class Model(_Part):
    """A model file, and the plant it describes."""

    name: str | None = None
    description: str | None = None
    pad: PadSpec
    effects: list[EffectEntry] = Field(default_factory=list)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Self:
        """From the model file's content. Raises pydantic's ValidationError."""
        return cls.model_validate(data)

    def to_dict(self) -> dict[str, Any]:
        """The model file's content, of plain dicts, lists and numbers; `from_dict` of it is equal to this model."""
        return self.model_dump(exclude_none=True)

    @cached_property
    def cascade(self) -> Cascade:
        """Pad and effects, ready to run."""
        return Cascade(self.pad.physics(), [entry.active() for entry in self.effects])

    def plant(self) -> Plant:
        """The streaming form, at rest and never touched."""
        return self.cascade.plant()

    def simulate(self, time_s: ArrayLike, position_mm: ArrayLike) -> Array:
        """Force as reported for reported pad-frame positions on one grid: see `sim.pad.Cascade.simulate`."""
        return self.cascade.simulate(time_s, position_mm)

    def simulate_at(self, position_time_s: ArrayLike, position_mm: ArrayLike, force_time_s: ArrayLike) -> Array:
        """Force as reported at its own times: see `sim.pad.Cascade.simulate_at`."""
        return self.cascade.simulate_at(position_time_s, position_mm, force_time_s)
