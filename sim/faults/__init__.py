"""Faults of a simulated bench: one small file a family; `simulation.faults` of a bench file asks for them.

A new kind is a `Kind` in the `KINDS` of its family's file: bench files, their schema, docs/faults.md and the tests
find it there, together with how a run is to come out of it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from sim.faults import answers, bytes_, disturbance, force, frames, host, mover, port, requests
from sim.faults.base import (
    COMMON,
    RECOVERED,
    REFUSED,
    STOPPED,
    Fault,
    FaultError,
    Kind,
    Outcome,
    Parameter,
    Reaction,
    read_fault,
)

if TYPE_CHECKING:
    from sim.faults.site import Site

FAMILIES = {
    "Bytes on the wire": bytes_.KINDS,
    "Frames": frames.KINDS,
    "Answers and settings of a device": answers.KINDS,
    "What a device makes of a request": requests.KINDS,
    "The port": port.KINDS,
    "What the load cell says": force.KINDS,
    "What gets into the load cell's signal": disturbance.KINDS,
    "The motor and its position": mover.KINDS,
    "The host": host.KINDS,
}
KINDS: Mapping[str, Kind] = {kind.name: kind for family in FAMILIES.values() for kind in family}


def read_faults(specs: Sequence[Mapping[str, Any]]) -> tuple[Fault, ...]:
    """The entries of `simulation.faults`, checked. Raises `FaultError` for the first that is wrong."""
    return tuple(read_fault(spec, index, KINDS) for index, spec in enumerate(specs))


def install(faults: Sequence[Fault], site: Site) -> None:
    """Put faults into a simulated bench. Raises `FaultError` where its devices cannot have them."""
    for fault in faults:
        fault.kind.install(fault, site)


def fault_schema() -> dict[str, Any]:
    """JSON Schema of one entry, for editors: a form for each kind."""
    seconds = {"type": "number", "minimum": 0}
    forms = []
    for kind in KINDS.values():
        properties: dict[str, Any] = {
            "kind": {"const": kind.name},
            "device": {"enum": list(kind.devices)},
            "at_s": {**seconds, "description": "s of bench time"},
            "rate_per_s": {"type": "number", "exclusiveMinimum": 0, "description": "how often, at random"},
            "step": {"type": ["string", "integer"], "description": "a step's name, or its number from 0"},
            "after_s": {**seconds, "description": "s after the step's beginning"},
        }
        if kind.lasting:
            properties["duration_s"] = {"type": "number", "exclusiveMinimum": 0, "description": "s"}
        for parameter in kind.parameters:
            text = f"{parameter.what}, {parameter.unit}" if parameter.unit else parameter.what
            kept: dict[str, Any] = {"description": text, "default": parameter.default}
            kept |= {"enum": list(parameter.words)} if parameter.words else {"type": "number"}
            properties[parameter.name] = kept
        required = ["kind"] if len(kind.devices) == 1 else ["kind", "device"]
        forms.append(
            {
                "type": "object",
                "title": kind.name,
                "description": kind.what,
                "properties": properties,
                "required": required,
                "oneOf": [{"required": [key]} for key in ("at_s", "rate_per_s", "step")],
                "additionalProperties": False,
            }
        )
    return {"oneOf": forms}


__all__ = [
    "COMMON",
    "FAMILIES",
    "KINDS",
    "RECOVERED",
    "REFUSED",
    "STOPPED",
    "Fault",
    "FaultError",
    "Kind",
    "Outcome",
    "Parameter",
    "Reaction",
    "fault_schema",
    "install",
    "read_fault",
    "read_faults",
]
