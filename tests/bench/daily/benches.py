"""Simulated benches for the commands of a day, and a way to get at the world behind one while a command has it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from bench.daily import open_bench
from bench.run.rig import Rig
from sim.world import World


def in_the_world(monkeypatch: pytest.MonkeyPatch, change: Callable[[World], Any] = lambda world: None) -> list[World]:
    """Have `change` done to every simulated world that a command opens; the worlds come in the list, as they are."""
    worlds: list[World] = []
    opened = open_bench.open_rig

    def open_changed(bench: Any) -> Rig:
        rig = opened(bench)
        assert rig.world is not None
        change(rig.world)
        worlds.append(rig.world)
        return rig

    monkeypatch.setattr(open_bench, "open_rig", open_changed)
    return worlds


def miscalibrated(newtons_per_unit: float) -> Callable[[World], None]:
    """The amplifier shows one unit for so many newtons, whatever the bench file believes; negative: turned over."""

    def change(world: World) -> None:
        amplifier = world.devices["load_cell"].amplifier  # type: ignore[attr-defined]
        amplifier.newtons_per_unit = newtons_per_unit
        amplifier.set_decimals(amplifier.decimals)

    return change


def mute(key: str) -> Callable[[World], None]:
    """The device hears, and says nothing."""

    def change(world: World) -> None:
        world.endpoints[key].line.device_write = lambda data, at_s: at_s  # type: ignore[method-assign]

    return change
