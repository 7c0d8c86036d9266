"""The register maps that come with padbench: one YAML file a device, read here and by the simulated devices."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from typing import Any, Literal

import yaml

DeviceKind = Literal["motor", "load_cell"]


@cache
def _contents() -> dict[str, dict[str, Any]]:
    maps = (item for item in files(__name__).iterdir() if item.name.endswith(".yaml"))
    return {
        item.name.removesuffix(".yaml"): yaml.safe_load(item.read_text("utf-8"))
        for item in sorted(maps, key=lambda item: item.name)
    }


def shipped_maps(device: DeviceKind) -> tuple[str, ...]:
    """Names of the shipped maps for one kind of device."""
    return tuple(name for name, content in _contents().items() if content.get("device") == device)


def shipped_map(name: str) -> dict[str, Any]:
    """The content of a shipped map; raises `KeyError` for a name that is not shipped."""
    return dict(_contents()[name])
