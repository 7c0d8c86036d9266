"""A preflight as the report shows it."""

from __future__ import annotations

import math

import numpy as np

from bench.preflight import Preflight
from bench.recording.types import StepMark
from bench.report import PlanView


def plan_view(preflight: Preflight) -> PlanView:
    """Planned depth and expected force over time, with limits, problems and notes."""
    prediction, limits = preflight.prediction, preflight.plan.limits
    marks = [
        StepMark(float(start), s.name, s.phase, s.kind, s.target_mm, s.speed_mm_s)
        for start, s in zip(prediction.starts_s, prediction.segments, strict=True)
    ]
    drawn: dict[str, tuple[float, str]] = {"force": (limits.force_N, "N")}
    if math.isfinite(limits.depth_mm):
        drawn["depth"] = (limits.depth_mm, "mm")
    return PlanView(
        time_s=prediction.time_s,
        position_mm=prediction.position_mm,
        expected_N=None if np.isnan(prediction.force_N).all() else prediction.force_N,
        steps=marks,
        limits=drawn,
        problems=[str(problem) for problem in preflight.errors],
        notes=[str(problem) for problem in preflight.notices],
        facts={"duration": f"{preflight.duration_s:.1f} s", "protocol": preflight.protocol.name},
    )
