"""What a seed stands for: a bench with one to three faults, and a short protocol."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from bench.protocol import Protocol
from sim.faults import KINDS, Reaction
from sim.faults.base import WHEN
from tests.faults.faulty import APPROACH_mm_s

BENCHES = (
    *["simulated"] * 4, "simulated_iai", "simulated_iai", "simulated_modbus",
    "simulated_smc_lec", "simulated_balance", "simulated_laumas",
)  # fmt: skip
DEEPEST_mm = 1.4
VARIED = ("off_s", "for_s", "gap_s", "duration_s", "ahead_mm", "within_s")
"""Numbers of a fault that a seed takes larger or smaller than the table's row."""

NOT_BEFORE = ("motor_fault", "position_jump", "killed", "signal", "disk_full")
"""What there is no sense in before there is a run."""

ABOUT_s = 4.5
"""A run of these protocols takes about so long."""


@dataclass(frozen=True)
class Drawn:
    """A seed, unfolded. `faults` are entries of a bench file."""

    seed: int
    base: str
    faults: tuple[Mapping[str, Any], ...]
    protocol: Protocol
    surface_mm: float

    def text(self) -> str:
        """For people: what to put into a bench file and a protocol to see the same."""
        steps = self.protocol.model_dump(mode="json", exclude_none=True, exclude_defaults=True)
        lines = [f"bench: {self.base}, seed: {self.seed}, surface: {self.surface_mm}", "faults:"]
        lines += [f"  - {json.dumps(fault)}" for fault in self.faults]
        return "\n".join([*lines, f"protocol: {json.dumps(steps)}"])


def reactions(base: str) -> list[tuple[str, Reaction]]:
    """What may strike on a bench: the rows of the table for it."""
    return [(kind.name, reaction) for kind in KINDS.values() for reaction in kind.reactions if reaction.bench == base]


def draw(seed: int) -> Drawn:
    """The bench and the protocol of a seed."""
    random = np.random.default_rng(np.random.SeedSequence([seed, 0xFA]))
    base = BENCHES[int(random.integers(len(BENCHES)))]
    rows = reactions(base)
    count = int(random.choice([1, 2, 3], p=[0.5, 0.3, 0.2]))
    faults = []
    for place in random.integers(len(rows), size=count):
        kind, reaction = rows[int(place)]
        own = {key: value for key, value in reaction.fault.items() if key not in (*WHEN, "after_s")}
        own = {key: _varied(random, value) if key in VARIED else value for key, value in own.items()}
        faults.append({"kind": kind, "device": reaction.device, **own, **_when(random, kind, reaction)})
    return Drawn(
        seed,
        base,
        tuple(faults),
        _protocol(random, APPROACH_mm_s.get(base.removeprefix("simulated_"), 4.0)),
        round(float(random.uniform(0.4, 0.9)), 3),
    )


def _varied(random: np.random.Generator, value: float) -> float:
    """Up to three times as much, or as little."""
    return round(value * float(np.exp(random.uniform(-1.1, 1.1))), 4)


def _when(random: np.random.Generator, kind: str, reaction: Reaction) -> dict[str, Any]:
    """At any instant, or with a step, or from the start; where the row says how often, half the time as often."""
    if "rate_per_s" in reaction.fault and random.random() < 0.5:
        return {"rate_per_s": reaction.fault["rate_per_s"]}
    way = random.random()
    if way < 0.1 and kind not in NOT_BEFORE:
        return {"at_s": 0.0}
    if way < 0.4:
        step = ("approach", "steps[0]", "steps[1]", "tare")[int(random.integers(4))]
        return {"step": step, "after_s": round(float(random.exponential(0.1)), 4)}
    return {"at_s": round(float(random.uniform(0.0, ABOUT_s)), 4)}


def _protocol(random: np.random.Generator, approach_mm_s: float) -> Protocol:
    steps: list[dict[str, Any]] = []
    for _ in range(int(random.integers(1, 4))):
        hold = round(float(random.uniform(0.0, 0.3)), 3)
        if random.random() < 0.2:
            force = round(float(random.uniform(0.5, 3.0)), 2)
            steps.append({"to_force": force, "speed": 2.0, "hold": hold})
        else:
            depth = round(float(random.uniform(0.1, DEEPEST_mm)), 3)
            steps.append({"to": depth, "speed": round(float(random.uniform(5.0, 60.0)), 1), "hold": hold})
    content = {
        "name": "drawn",
        "approach": {"speed": approach_mm_s, "force": 0.05, "retract": 0.3},
        "limits": {"force": 8, "depth": 1.6},
        "steps": steps,
        "finish": {"retract": 0.3, "air": 0.05},
        "sampling": {"motor": 250},
    }
    return Protocol.model_validate_json(json.dumps(content), strict=True)
