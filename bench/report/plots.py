"""The plots of one run over time: trajectory, force with residual, and the corner of its fastest ramp."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from bench.recording.types import Event, Recording
from bench.report import axes as parts
from bench.report.facts import has_surface
from bench.report.style import light
from bench.report.svg import render
from bench.report.view import FitView, Plan

Array = NDArray[np.float64]


def trajectory(recording: Recording, plan: Plan | None, events: Sequence[tuple[int, Event]]) -> str:
    """Commanded and measured position over the whole run, in the pad frame where the surface is known."""
    heights = [230.0]
    offset = recording.surface_mm
    surface = has_surface(recording)
    motor = recording.motor

    def draw(figure: Figure) -> None:
        [ax] = parts.panels(figure, heights)
        low, high = parts.time_span(recording)
        ax.set_xlim(low, high)
        zero = offset or 0.0
        if plan is not None and offset is not None:  # wide: a run that follows its plan would hide it
            parts.line(ax, plan.time_s, plan.position_mm, "expected", "planned", width=6.4)
        parts.line(ax, motor.time_s, motor.command_mm - zero, "commanded", "commanded", width=2.8)
        parts.line(ax, motor.time_s, motor.position_mm - zero, "measured", "measured", width=1.0)
        if surface:
            ax.axhline(0.0, color=light("noise"), lw=1.0, ls="--", zorder=1, label="pad surface")
        ax.set_ylabel("depth, mm" if surface else "motor position, mm")
        ax.set_xlabel("time, s")
        parts.shade([ax], parts.step_spans(recording.steps, high))
        parts.mark([ax], events)
        parts.legend(ax)

    return render("trajectory", "Position over time", parts.WIDE, parts.stacked(heights), draw)


def force(recording: Recording, fit: FitView | None, plan: Plan | None, events: Sequence[tuple[int, Event]]) -> str:
    """Force measured and simulated over the whole run; with a fit, what is left of it beneath."""
    heights = [230.0] if fit is None else [230.0, 120.0]
    cell = recording.load_cell

    def draw(figure: Figure) -> None:
        made = parts.panels(figure, heights)
        ax = made[0]
        low, high = parts.time_span(recording)
        ax.set_xlim(low, high)
        parts.line(ax, cell.time_s, cell.force_N, "measured", "measured", width=2.4)
        if plan is not None and plan.expected_N is not None:
            parts.line(ax, plan.time_s, plan.expected_N, "expected", "expected before the run", style=":", width=1.4)
        if fit is not None:
            parts.line(ax, fit.time_s, fit.simulated_N, "simulated", "simulated", width=1.1)
            _residual(made[1], fit)
        if cell.flagged.any():
            bad = np.flatnonzero(cell.flagged)[:2000]
            ax.plot(cell.time_s[bad], cell.force_N[bad], "x", color=light("event"), ms=4, label="flagged by the cell")
        ax.set_ylabel("force, N")
        made[-1].set_xlabel("time, s")
        parts.shade(made, parts.step_spans(recording.steps, high))
        parts.mark(made, events)
        parts.legend(ax)

    return render("force", "Force over time, measured and simulated", parts.WIDE, parts.stacked(heights), draw)


def _residual(ax: Axes, fit: FitView) -> None:
    left = fit.measured_N - fit.simulated_N
    fitted = (fit.time_s >= fit.fit_from_s) & (fit.time_s <= fit.fit_to_s)
    counted = left[fitted] if fitted.any() else left
    peak = float(np.nanmax(np.abs(counted))) if counted.size and np.isfinite(counted).any() else 1.0
    floor = fit.number("noise_floor")
    scale, unit = parts.force_unit(peak)
    if not fitted.all():
        parts.line(ax, fit.time_s, np.where(fitted, np.nan, left) * scale, "muted", "history, not fitted", width=0.8)
    parts.line(ax, fit.time_s, np.where(fitted, left, np.nan) * scale, "residual", "", width=0.9)
    top = 1.12 * peak
    if math.isfinite(floor) and floor > 0:
        parts.noise_band(ax, floor, scale)
        top = max(top, 2.6 * floor)
    ax.axhline(0.0, color=light("muted"), lw=0.7)
    if top > 0:
        ax.set_ylim(-top * scale, top * scale)
    ax.set_ylabel(f"residual, {unit}")
    parts.legend(ax)


def corner(recording: Recording, fit: FitView | None) -> str:
    """Position and force around the fastest ramp; empty where the recording has no motion to speak of."""
    window = fastest_ramp(recording)
    if window is None:
        return ""
    start, end = window
    whole = parts.time_span(recording)
    if end - start > 0.5 * (whole[1] - whole[0]):
        return ""  # the plots above show it already
    low, high = start - 0.6 * (end - start), end + 2.2 * (end - start)
    heights = [130.0, 180.0]
    motor, cell = recording.motor, recording.load_cell

    def draw(figure: Figure) -> None:
        above, below = parts.panels(figure, heights)
        above.set_xlim(1e3 * (low - start), 1e3 * (high - start))

        def piece(ax: Axes, t: Array, y: Array, colour: str, label: str, dots: bool, width: float) -> None:
            first, last = np.searchsorted(t, [low, high])
            first, last = max(int(first) - 1, 0), min(int(last) + 1, t.size)
            ms, shown = 1e3 * (t[first:last] - start), y[first:last]
            parts.line(ax, ms, shown, colour, label, width=width)
            if dots and last - first <= 160:
                ax.plot(ms, shown, ".", color=light(colour), ms=4.5)

        zero = recording.surface_mm or 0.0
        piece(above, motor.time_s, motor.command_mm - zero, "commanded", "commanded", False, 2.2)
        piece(above, motor.time_s, motor.position_mm - zero, "measured", "measured", True, 0.9)
        above.set_ylabel("depth, mm" if has_surface(recording) else "position, mm")
        piece(below, cell.time_s, cell.force_N, "measured", "measured", True, 0.9)
        if fit is not None:
            piece(below, fit.time_s, fit.simulated_N, "simulated", "simulated", False, 1.7)
        below.set_ylabel("force, N")
        below.set_xlabel("time from the start of the ramp, ms")
        for ax in (above, below):
            ax.axvspan(0.0, 1e3 * (end - start), color=light("approach"), alpha=0.14, lw=0, zorder=0)
            parts.legend(ax)

    return render("corner", "The fastest ramp, enlarged", parts.WIDE, parts.stacked(heights), draw)


def fastest_ramp(recording: Recording) -> tuple[float, float] | None:
    """Start and end, s, of the ramp with the highest planned speed, or the fastest motion where no step is marked."""
    motor = recording.motor
    if motor.time_s.size < 4:
        return None
    _, end_s = parts.time_span(recording)
    ramps = [
        (span.mark.speed_mm_s, span.from_s, span.to_s)
        for span in parts.step_spans(recording.steps, end_s)
        if span.mark.kind in ("ramp", "force_ramp") and span.phase == "steps" and span.mark.speed_mm_s > 0
        if span.to_s > span.from_s and motor.time_s[0] <= span.from_s < motor.time_s[-1]
    ]
    if ramps:
        top = max(speed for speed, _, _ in ramps)
        among = [(start, end) for speed, start, end in ramps if speed >= 0.999 * top]
        return max(among, key=lambda ramp: (_travel(recording, *ramp), -ramp[0]))
    return _fastest_motion(motor.time_s, motor.position_mm)


def _travel(recording: Recording, start: float, end: float) -> float:
    at = np.interp([start, end], recording.motor.time_s, recording.motor.position_mm)
    return round(abs(float(at[1] - at[0])), 2)


def _fastest_motion(time_s: Array, position_mm: Array) -> tuple[float, float] | None:
    good = np.isfinite(position_mm)
    t, x = time_s[good], position_mm[good]
    if t.size < 6:
        return None
    noise = float(np.median(np.abs(np.diff(x, 2)))) / (0.6745 * math.sqrt(6.0))
    reach, speed = 1, _speed(t, x, 1)
    # over as few samples as tell motion from encoder noise, lest noise be taken for speed or a fast ramp be missed
    while speed.size > 4 * reach and np.abs(x[2 * reach :] - x[: -2 * reach]).max() < 20.0 * noise:
        reach *= 2
        speed = _speed(t, x, reach)
    peak = int(np.argmax(speed))
    if speed[peak] <= 0:
        return None
    slow = np.flatnonzero(speed < 0.2 * speed[peak])
    before, after = slow[slow < peak], slow[slow > peak]
    first = int(before[-1]) + reach if before.size else 0
    last = int(after[0]) + reach if after.size else t.size - 1
    return float(t[first]), float(t[last])


def _speed(t: Array, x: Array, reach: int) -> Array:
    gap = t[2 * reach :] - t[: -2 * reach]
    return np.abs(x[2 * reach :] - x[: -2 * reach]) / np.where(gap > 0, gap, np.inf)
