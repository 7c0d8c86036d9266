"""Delay, lag and resonance look alike while they are short: how late each comes, and which numbers make it so late."""

from __future__ import annotations

import math
from collections.abc import Mapping

LATE = ("force_delay", "sensor_lag", "resonance")
DAMPINGS, HIGHEST_HZ = (0.06, 0.2, 0.45), 4500.0


def lateness_s(id_: str, values: Mapping[str, float]) -> float:
    """How far the force comes behind a ramp in the end, s; 0 for causes that are not of these."""
    if id_ == "force_delay":
        return values["delay"]
    if id_ == "sensor_lag":
        return values["time_constant"]
    if id_ == "resonance":
        return values["damping_ratio"] / (math.pi * values["frequency"])  # 2ζ/ω
    return 0.0


def as_late(id_: str, late_s: float) -> list[dict[str, float]]:
    """Numbers of the first form of an effect with which it is so late."""
    if id_ == "force_delay":
        return [{"delay": late_s}]
    if id_ == "sensor_lag":
        return [{"time_constant": late_s}]
    frequencies = [(damping, damping / (math.pi * late_s)) for damping in DAMPINGS]
    return [{"frequency": f, "damping_ratio": damping} for damping, f in frequencies if f < HIGHEST_HZ]
