"""How a command ended, and short things to give to one."""

from __future__ import annotations

from dataclasses import dataclass

FIT = ("--law", "exponential", "--order", "2", "--contact", "unilateral")
"""A structure to fit: without it every one is tried."""

AIR = {
    "name": "in the air",
    "approach": "none",
    "steps": [{"to": -0.5, "speed": 20, "hold": 0.1}, {"to": 0.0, "speed": 20}],
    "finish": {"air": 0.1},
}


@dataclass(frozen=True)
class Said:
    """How a command ended and what it printed."""

    status: int
    out: str
    err: str
