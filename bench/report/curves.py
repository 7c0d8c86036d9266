"""The plots that are not over time: force against indentation, elastic response, reduced relaxation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator
from numpy.typing import NDArray

from bench.recording.types import Recording
from bench.report import axes as parts
from bench.report.decimate import thin_path
from bench.report.facts import has_surface
from bench.report.style import TIME_RAMP, light
from bench.report.svg import render
from bench.report.view import Curve, FitView

Array = NDArray[np.float64]

_CURVE_HEIGHT = 240.0

MOST_POINTS = 12_000
"""A curve that needs more points than this is embedded as a picture, which is then the smaller."""


def indentation(recording: Recording, fit: FitView | None) -> str:
    """Force against depth, measured coloured from early to late, simulated over it; empty without both channels.

    Empty also without a pad: in air there is no indentation, and the force is noise alone.
    """
    if recording.run and not has_surface(recording):
        return ""
    time_s, depth, measured = _in_pad_frame(recording, fit)
    if time_s.size < 2 or not (np.isfinite(depth) & np.isfinite(measured)).any():
        return ""
    height = 380.0

    def draw(figure: Figure) -> None:
        [ax] = parts.panels(figure, [height])
        width = ax.get_position().width * parts.WIDE
        # half a pixel: finer than an eye sees, so that lines stay smooth
        cell_x, cell_y = 0.5 * _span(depth) / width or 1.0, 0.5 * _span(measured) / height or 1.0
        edges = np.linspace(time_s[0], time_s[-1], len(TIME_RAMP) + 1)
        pieces = []
        for i in range(len(TIME_RAMP)):
            first, last = np.searchsorted(time_s, edges[i : i + 2])
            last = min(int(last) + 1, time_s.size)
            pieces.append(thin_path(depth[first:last], measured[first:last], cell_x, cell_y))
        heavy = sum(x.size for x, _ in pieces) > MOST_POINTS
        for i, (x, y) in enumerate(pieces):
            ax.plot(x, y, color=light(f"time-{i}"), lw=2.6, rasterized=heavy)
        if fit is not None:
            x, y = thin_path(depth, fit.simulated_N, cell_x, cell_y)
            heavy = x.size > MOST_POINTS
            ax.plot(x, y, color=light("simulated"), lw=0.8, rasterized=heavy, label="simulated")
        deepest, highest = float(np.nanmax(depth)), float(np.nanmin(depth))
        if deepest > 0.05 * (deepest - highest):  # the way through air says little: only its end is shown
            ax.set_xlim(max(highest - 0.01 * deepest, -0.12 * deepest), 1.02 * deepest)
        ax.set_xlabel("depth, mm")
        ax.set_ylabel("force, N")
        _time_bar(ax, time_s)
        if fit is not None:
            parts.legend(ax, from_x=0.46)

    return render("indentation", "Force against indentation", parts.WIDE, parts.stacked([height]), draw)


def _in_pad_frame(recording: Recording, fit: FitView | None) -> tuple[Array, Array, Array]:
    """Time, depth and force at the force stamps: those of the fit, or else from the preconditioning on."""
    if fit is not None:
        return fit.time_s, fit.position_mm, fit.measured_N
    motor, cell = recording.motor, recording.load_cell
    nothing = np.empty(0)
    if recording.surface_mm is None or motor.time_s.size < 2 or cell.time_s.size < 2:
        return nothing, nothing, nothing
    starts = [mark.time_s for mark in recording.steps if mark.phase in ("precondition", "steps")]
    begin = max(min(starts) if starts else -np.inf, float(motor.time_s[0]))
    inside = (cell.time_s >= begin) & (cell.time_s <= motor.time_s[-1])
    good = np.isfinite(motor.position_mm)
    if not inside.any() or not good.any():
        return nothing, nothing, nothing
    depth = np.interp(cell.time_s[inside], motor.time_s[good], motor.position_mm[good]) - recording.surface_mm
    return cell.time_s[inside], depth, cell.force_N[inside]


def _span(values: Array) -> float:
    finite = values[np.isfinite(values)]
    return float(np.ptp(finite)) if finite.size else 0.0


def _time_bar(ax: Axes, time_s: Array) -> None:
    """The key of the colours, above the axes: from the first to the last second."""
    bar = ax.inset_axes((0.15, 1.025, 0.22, 0.022))
    for i in range(len(TIME_RAMP)):
        bar.axvspan(i, i + 1, color=light(f"time-{i}"), lw=0)
    bar.set_xlim(0, len(TIME_RAMP))
    bar.axis("off")
    height = 1.036
    ax.text(
        0.14, height, f"measured, {time_s[0]:.1f} s", transform=ax.transAxes, ha="right", va="center", fontsize=10.5
    )
    ax.text(0.38, height, f"{time_s[-1]:.1f} s", transform=ax.transAxes, ha="left", va="center", fontsize=10.5)


def elastic(curves: Sequence[tuple[str, Curve]]) -> str:
    """F^e over depth, with a 95 % band where its doubt is known."""
    return _curves("elastic", "Elastic response", curves, "depth, mm", "elastic response Fᵉ, N", log=False)


def relaxation(curves: Sequence[tuple[str, Curve]]) -> str:
    """g over time on a logarithmic axis, with a 95 % band where its doubt is known."""
    return _curves(
        "relaxation", "Reduced relaxation", curves, "time after a step, s", "share of force left, g(t)", log=True
    )


def _curves(name: str, label: str, curves: Sequence[tuple[str, Curve]], x: str, y: str, *, log: bool) -> str:
    def draw(figure: Figure) -> None:
        [ax] = parts.panels(figure, [_CURVE_HEIGHT], top=12.0)
        for i, (run, curve) in enumerate(curves):
            colour = "simulated" if len(curves) == 1 else f"run-{i % 7}"
            _band(ax, curve, colour, run, ("-", "--", "-.", ":")[(i // 7) % 4] if len(curves) > 7 else "-", log)
        if log:
            ax.set_xscale("log")
            parts.plain_numbers(ax.xaxis)
            ax.xaxis.set_minor_locator(NullLocator())
            ax.set_ylim(top=max(1.02, ax.get_ylim()[1]))
            low = ax.get_ylim()[0]
            ax.set_ylim(bottom=max(0.0, low) if low > -0.02 else low)
        else:
            ax.axhline(0.0, color=light("muted"), lw=0.7)
        ax.set_xlabel(x)
        ax.set_ylabel(y)
        if len(curves) > 1 or any(curve.std is not None for _, curve in curves):
            parts.legend(ax, above=False)

    return render(name, label, parts.HALF, parts.stacked([_CURVE_HEIGHT], 12.0), draw)


def _band(ax: Axes, curve: Curve, colour: str, run: str, style: str, log: bool) -> None:
    good = np.isfinite(curve.y) & ((curve.x > 0) if log else np.isfinite(curve.x))
    x, y = curve.x[good], curve.y[good]
    ax.plot(x, y, style, color=light(colour), lw=1.8, label=run or "_nolegend_")
    if curve.std is not None:
        doubt = 1.96 * np.nan_to_num(curve.std[good])
        hidden = np.ptp(y) > 0 and float(2 * doubt.max()) < 2.0 / _CURVE_HEIGHT * float(np.ptp(y))
        label = "95 % band" + (", thinner than the line" if hidden else "") if not run else "_nolegend_"
        ax.fill_between(x, y - doubt, y + doubt, color=light(colour), alpha=0.12 if run else 0.22, lw=0, label=label)
