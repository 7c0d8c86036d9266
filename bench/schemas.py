"""JSON Schema of the files people write, for editors: draft-07, which is what YAML language servers understand."""

from __future__ import annotations

import math
from typing import Any, Literal

from bench.config import Bench
from bench.protocol import Protocol

DRAFT = "http://json-schema.org/draft-07/schema#"


def schema(kind: Literal["protocol", "bench", "model"]) -> dict[str, Any]:
    """The schema of one kind of file."""
    if kind == "protocol":
        content = Protocol.model_json_schema()
    elif kind == "bench":
        content = Bench.model_json_schema()
    else:
        from sim.model import Model

        content = Model.model_json_schema()
        content["$defs"]["EffectEntry"] = {"oneOf": _effects()}
        content["$defs"].pop("Quantity", None)
    return {"$schema": DRAFT, **_as_draft_07(content)}


def _effects() -> list[dict[str, Any]]:
    """The forms of all effects, as they are written in a model file: parameters beside `id` and `form`."""
    from sim.effects import all_effects

    found = []
    for effect in all_effects().values():
        for number, form in enumerate(effect.forms):
            properties: dict[str, Any] = {"id": {"const": effect.id}, "form": {"const": form.name}}
            for parameter in form.parameters:
                bounds = {"type": "number", "minimum": parameter.lower, "maximum": parameter.upper}
                std = {"type": ["number", "null"], "minimum": 0}
                quantity = {
                    "type": "object",
                    "properties": {"value": bounds, "unit": {"const": parameter.unit}, "std": std},
                    "required": ["value"],
                    "additionalProperties": False,
                }
                text = f"{parameter.what}, {parameter.unit}" if parameter.unit else parameter.what
                properties[parameter.name] = {"description": text, "anyOf": [bounds, quantity]}
            required = ["id", *(p.name for p in form.parameters if p.required)]
            if number > 0:  # without `form`, the first one is meant
                required.insert(1, "form")
            found.append(
                {
                    "type": "object",
                    "title": effect.id if len(effect.forms) == 1 else f"{effect.id}: {form.name}",
                    "description": form.what,
                    "properties": properties,
                    "required": required,
                    "additionalProperties": False,
                }
            )
    return found


def _as_draft_07(node: Any) -> Any:
    """Where 2020-12 (which pydantic writes) and draft-07 differ for what our files use."""
    if isinstance(node, list):
        return [_as_draft_07(item) for item in node]
    if not isinstance(node, dict):
        return node
    out: dict[str, Any] = {}
    for key, value in node.items():
        if key == "prefixItems":
            out["items"] = _as_draft_07(value)
        elif key != "discriminator" and value not in (math.inf, -math.inf):  # OpenAPI's own; no bound at all
            out[key] = _as_draft_07(value)
    if "$ref" in out and len(out) > 1:  # draft-07 ignores what stands beside a $ref
        out["allOf"] = [{"$ref": out.pop("$ref")}]
    return out
