"""Model files out: YAML that a person likes to read, with numbers that come back as they were."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml

from bench.errors import InputError

if TYPE_CHECKING:
    from sim.model import Model

DIGITS = 10
"""Significant digits kept: more than any fit knows."""


def model_text(model: Model) -> str:
    """The model as YAML, short lists on one line."""
    return yaml.dump(_rounded(model.to_dict()), Dumper=_Dumper, sort_keys=False, default_flow_style=None, width=110)


def write_model(path: Path, model: Model) -> None:
    """Write a model file; raises `InputError` where it cannot be written."""
    try:
        path.write_text(model_text(model), "utf-8")
    except OSError as error:
        raise InputError(str(path), f"cannot be written: {error.strerror}") from error


class _Dumper(yaml.SafeDumper):
    """Writes 1e-3 as YAML 1.2 has it, which is also what YAML 1.1 readers take for a number."""


def _represent_float(dumper: yaml.SafeDumper, value: float) -> yaml.ScalarNode:
    text = repr(value)
    if "e" in text and "." not in text:
        text = text.replace("e", ".0e")
    return dumper.represent_scalar("tag:yaml.org,2002:float", text)


_Dumper.add_representer(float, _represent_float)


def _rounded(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _rounded(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(item) for item in value]
    return float(f"{value:.{DIGITS}g}") if isinstance(value, float) else value
