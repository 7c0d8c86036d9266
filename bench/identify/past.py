"""A pad that was already loaded when the data begin: the state it was in is estimated with it.

The model starts from rest. Where it did not, what is left of the past fades as Σ a_i η_i e^{−ν_i t}, one number η_i for
each mode of each such run (in units of F^e at the greatest depth). For a pad that stays in contact they are linear
nuisance parameters: nothing is known of them, and all other numbers are estimated beside them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bench.recording.types import Measurement

from .noise import Noise
from .problem import Problem

CLEAR = 6.0  # standard deviations of the mean that a force or its change must stand out by
LEAST_DEPTH = 0.01  # of the greatest: less may be a surface that is a little off
LEAST_FORCE = 0.003  # of the largest
FIRST = 20  # samples that the beginning is judged on
HOLD = 2000  # samples over which a change is looked for
STILL = 5e-4  # of the reach: less is no motion


def with_pasts(problem: Problem, noise: Noise) -> Problem:
    """The problem with a free initial state for every run that begins loaded; never for one that begins in air."""
    runs, count = [], 0
    for run, m in zip(problem.runs, problem.measurements, strict=True):
        if begins_loaded(m, problem.depth_mm, problem.force_N, noise):
            run = replace(run, past=count)
            count += 1
        runs.append(run)
    return replace(problem, runs=tuple(runs)) if count else problem


def said_of_past(depth_mm: float, force_N: float) -> str:
    """That a run begins loaded, at a depth and with a force; what is done about it is to follow."""
    return f"The data begin at {depth_mm:.3g} mm with {force_N:.3g} N on the pad: its past is not known, and "


def fitted_past(depth_mm: float, force_N: float) -> str:
    """That a run begins loaded, and the state it begins in was fitted."""
    return said_of_past(depth_mm, force_N) + "the state it had left was fitted with it."


def begins_inside(m: Measurement, depth_mm: float, noise_mm: float) -> bool:
    """Whether the probe is clearly below the pad's surface from the first sample on, whatever the force is there: a pad
    that lets go may still be on its way back to the probe."""
    least = max(LEAST_DEPTH * depth_mm, 4 * noise_mm, 4 * m.surface_std_mm)
    first_mm = float(np.interp(m.force_time_s[0], m.position_time_s, m.position_mm))
    return min(first_mm, float(m.position_mm[0])) > least


def begins_loaded(m: Measurement, depth_mm: float, force_N: float, noise: Noise) -> bool:
    """Whether the force is clear, or relaxes, while the probe is in the pad from the first sample on."""
    if not begins_inside(m, depth_mm, noise.position_mm):
        return False
    depth = np.interp(m.force_time_s[:HOLD], m.position_time_s, m.position_mm)
    force = m.force_N[:HOLD]
    moved = np.abs(depth - depth[0]) > max(STILL * float(np.ptp(m.position_mm)), 6 * noise.position_mm)
    still = int(np.argmax(moved)) if moved.any() else len(depth)
    count = max(min(still, FIRST), 1)
    level = abs(float(np.mean(force[:count])))
    if level > max(CLEAR * noise.force_N / np.sqrt(count), LEAST_FORCE * force_N):
        return True
    quarter = still // 4
    if quarter < 3:
        return False
    change = abs(float(np.mean(force[:quarter]) - np.mean(force[still - quarter : still])))
    return change > float(max(CLEAR * noise.force_N * np.sqrt(2 / quarter), LEAST_FORCE * force_N))
