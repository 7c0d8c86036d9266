"""The axis in small steps in air: rise, overshoot, settling, following error, and how far it lags behind commands."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.daily.checkup.finding import Finding
from bench.recording.types import MotorChannel

Array = NDArray[np.float64]

FEW = 5
"""With fewer samples in the rise of a step its shape cannot be told."""

OVERSHOOT_PERCENT = 15.0
SLOW_S = 0.1
ERROR_MM = 0.01
SAFETY_SHARE = 0.5
"""Of limits.following_error: a step that uses more than that leaves little for a pad."""


def step_figures(
    motor: MotorChannel, start_mm: float, target_mm: float, began_s: float, band_mm: float
) -> dict[str, Any]:
    """One step: figures from samples that begin before it and end well after it.

    Rise is from 10 to 90 % of the way; `settled_s` from the begin until the position stays within `band_mm` of where
    it ends; `lag_s` by how much the measured position is late against the commanded one (least squares).
    """
    t = motor.time_s - began_s
    way = target_mm - start_mm
    share = (motor.position_mm - start_mm) / way
    after = t >= 0.0
    end = float(np.median(motor.position_mm[t > 0.75 * t[-1]]))
    first = {level: _crossing(t[after], share[after], level) for level in (0.1, 0.9)}
    rising = int(np.sum((share > 0.1) & (share < 0.9) & after))
    outside = after & (np.abs(motor.position_mm - end) > band_mm)
    commanded = np.nonzero(np.abs(motor.command_mm - target_mm) > 1e-9)[0]
    return {
        "step_mm": way,
        "rise_s": first[0.9] - first[0.1],
        "samples_in_rise": rising,
        "overshoot_percent": max(0.0, 100.0 * (float(share[after].max()) - 1.0)) if way else float("nan"),
        "settled_s": float(t[outside][-1]) if outside.any() else 0.0,
        "command_s": float(t[commanded[-1]]) if commanded.size else 0.0,
        "error_mm": end - target_mm,
        "following_error_mm": float(np.abs(motor.command_mm - motor.position_mm).max()),
        "lag_s": lag_s(motor),
    }


def _crossing(t: Array, share: Array, level: float) -> float:
    beyond = np.nonzero(share >= level)[0]
    if beyond.size == 0:
        return float("nan")
    i = int(beyond[0])
    if i == 0:
        return float(t[0])
    before, now = share[i - 1], share[i]
    return float(t[i - 1] + (level - before) / (now - before) * (t[i] - t[i - 1]))


def lag_s(motor: MotorChannel, most_s: float = 0.05) -> float:
    """How late the measured position is against the commanded one: the shift with the least squared difference."""
    t = motor.time_s
    best = (np.inf, 0.0)
    for width, centre in ((most_s, 0.5 * most_s), (most_s / 20, None), (most_s / 400, None)):
        middle = best[1] if centre is None else centre
        for shift in np.linspace(middle - width / 2, middle + width / 2, 41):
            inside = (t - shift >= t[0]) & (t <= t[-1])
            apart = motor.position_mm[inside] - np.interp(t[inside] - shift, t, motor.command_mm)
            cost = float(np.mean(apart**2))
            if cost < best[0]:
                best = (cost, float(shift))
    return best[1]


def judged(steps: list[dict[str, Any]], allowed_mm: float) -> tuple[dict[str, Any], list[Finding]]:
    """The median of several steps, and what it means; `allowed_mm` is limits.following_error."""
    names = [name for name in steps[0] if name != "step_mm"]
    middle = {name: float(np.median([step[name] for step in steps])) for name in names}
    middle["error_mm"] = max((step["error_mm"] for step in steps), key=abs)
    middle["following_error_mm"] = max(step["following_error_mm"] for step in steps)
    figures: dict[str, Any] = {"median": middle, "each": steps}
    way = abs(steps[0]["step_mm"])
    shown = (
        f"{way:g} mm in {1e3 * middle['rise_s']:.0f} ms, {middle['overshoot_percent']:.0f} % too far, "
        f"settled after {1e3 * middle['settled_s']:.0f} ms, {1e3 * middle['lag_s']:.1f} ms behind the command"
    )
    findings = []
    if middle["samples_in_rise"] < FEW:
        shown = f"{way:g} mm: over between two or three positions, so that rise and overshoot cannot be told"
        findings.append(Finding("step", shown, None, "", "the end of each step was looked at all the same"))
    elif middle["overshoot_percent"] > OVERSHOOT_PERCENT:
        means = "ramps end deeper than planned, and the pad remembers the deepest point"
        do = "lower the proportional gain, or raise the damping (Orca: p down, dv up), or accelerate less"
        findings.append(Finding("step", shown, False, means, do))
    elif middle["settled_s"] > middle["command_s"] + SLOW_S:
        means = "a hold begins while the axis still creeps: that looks like relaxation"
        findings.append(Finding("step", shown, False, means, "raise the gains (Orca: p, i), or free the rail"))
    else:
        findings.append(Finding("step", shown))
    error = middle["error_mm"]
    if abs(error) > ERROR_MM:
        means = "depths are off by that much; friction with too little integral gain, or a play"
        do = "raise the integral gain (Orca: i), grease the rail, look for play"
        findings.append(Finding("where it stands", f"{1e3 * error:+.1f} µm beside the target", False, means, do))
    else:
        findings.append(Finding("where it stands", f"{1e3 * error:+.1f} µm beside the target at most"))
    following = middle["following_error_mm"]
    if following > SAFETY_SHARE * allowed_mm:
        means = f"limits.following_error is {allowed_mm:g} mm: a fast ramp into a pad would stop the run"
        do = "raise the limit if the axis is sound, else see to gains and friction"
        findings.append(Finding("following error", f"{following:.3f} mm", False, means, do))
    else:
        findings.append(Finding("following error", f"{following:.3f} mm of {allowed_mm:g} mm allowed"))
    return figures, findings
