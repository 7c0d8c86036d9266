"""The physical causes that can stand between motor and reading: one file each, found by being in this folder."""

from __future__ import annotations

import functools
import importlib
import pkgutil

from sim.effects.base import Active, Effect, Form, Parameter

__all__ = ["Active", "Effect", "Form", "Parameter", "all_effects", "effect"]


@functools.cache
def all_effects() -> dict[str, Effect]:
    """Every effect by its id, in alphabetical order. Read-only."""
    found: dict[str, Effect] = {}
    for module in sorted(pkgutil.iter_modules(__path__), key=lambda module: module.name):
        loaded = importlib.import_module(f"{__name__}.{module.name}")
        candidate = getattr(loaded, "EFFECT", None)
        if isinstance(candidate, Effect):
            found[candidate.id] = candidate
    return found


def effect(name: str) -> Effect:
    """The effect with that id. Raises KeyError."""
    return all_effects()[name]
