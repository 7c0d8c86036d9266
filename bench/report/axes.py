"""What the plots share: panels at fixed margins, thinned lines, phase shading, event marks, bands."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter
from numpy.typing import NDArray

from bench.recording.types import Event, Recording, StepMark
from bench.report.decimate import thin
from bench.report.style import light

Array = NDArray[np.float64]

WIDE = 860.0
"""Width of a plot that takes the whole page, in points."""
HALF = 430.0
_LEFT, _RIGHT, _GAP = 58.0, 20.0, 30.0

PHASES = ("tare", "approach", "precondition", "steps", "finish")
"""Phases of a run; each is also the name of its colour."""


def panels(figure: Figure, heights: Sequence[float], *, top: float = 30.0) -> list[Axes]:
    """Panels one above the other, `heights` in points, with a common x axis labelled at the lowest.

    The figure's height must be `stacked(heights, top)`. All margins are fixed, so that the panels of every page
    line up.
    """
    width = figure.get_figwidth() * figure.dpi
    total = figure.get_figheight() * figure.dpi
    made: list[Axes] = []
    y = total - top
    for height in heights:
        y -= height
        box = (_LEFT / width, y / total, (width - _LEFT - _RIGHT) / width, height / total)
        made.append(figure.add_axes(box, sharex=made[0] if made else None))
        y -= _GAP
    for ax in made[:-1]:
        ax.tick_params(labelbottom=False)
    for ax in made:
        ax.yaxis.set_label_coords(-44.0 / (width - _LEFT - _RIGHT), 0.5)
    return made


def stacked(heights: Sequence[float], top: float = 30.0) -> float:
    """Height of the figure that holds `panels(heights)`, in points."""
    return top + sum(heights) + _GAP * (len(heights) - 1) + 42.0


def force_unit(peak_N: float) -> tuple[float, str]:
    """(units a newton, unit) in which an axis up to `peak_N` has short numbers; newtons where that is none."""
    if not peak_N > 0.0:
        return 1.0, "N"
    for scale, unit in ((1.0, "N"), (1e3, "mN"), (1e6, "µN")):
        if scale * peak_N >= 0.5:
            return scale, unit
    return 1e9, "nN"


def noise_band(ax: Axes, floor_N: float, scale: float) -> None:
    """Two deviations of the noise either way; `scale`: units of the axis a newton."""
    edge = 2.0 * floor_N * scale
    ax.axhspan(-edge, edge, color=light("noise"), alpha=0.22, lw=0, zorder=0.5, label="noise floor ± 2σ")
    for y in (-edge, edge):  # in front, where dense data would hide the band
        ax.axhline(y, color=light("noise"), lw=0.9, ls="--", zorder=3)


def line(
    ax: Axes,
    time_s: Array,
    value: Array,
    colour: str,
    label: str = "",
    *,
    style: str = "-",
    width: float = 1.2,
) -> None:
    """A line over time, thinned to the axes' pixels with its extremes kept. Empty arrays draw nothing."""
    if time_s.size == 0 or not np.isfinite(value).any():
        return
    x, y = thin(time_s, value, max(int(ax.bbox.width), 50))
    ax.plot(x, y, style, color=light(colour), lw=width, label=label or "_nolegend_")


def legend(ax: Axes, *, above: bool = True, from_x: float = 0.0) -> None:
    """A legend in one line above the axes, at their left, where it covers no data and a narrow screen shows it.

    `from_x`: where it begins, as a share of the axes' width. With `above` false it goes inside, where it fits best.
    """
    handles, _ = ax.get_legend_handles_labels()
    if not handles:
        return
    if above:
        ax.legend(
            loc="lower left", bbox_to_anchor=(from_x, 1.01), ncols=len(handles), columnspacing=1.4, handlelength=1.8
        )
    else:
        ax.legend(loc="best", handlelength=1.8)


@dataclass(frozen=True)
class Span:
    """A stretch of time and the step mark that it begins with."""

    from_s: float
    to_s: float
    mark: StepMark

    @property
    def phase(self) -> str:
        """The phase of the run it belongs to."""
        return self.mark.phase


def step_spans(marks: Sequence[StepMark], end_s: float) -> list[Span]:
    """The stretch of each step mark: up to the next one, the last up to `end_s`."""
    ordered = sorted(marks, key=lambda mark: mark.time_s)
    ends = [mark.time_s for mark in ordered] + [end_s]
    return [Span(mark.time_s, max(end, mark.time_s), mark) for mark, end in zip(ordered, ends[1:], strict=True)]


def joined(spans: Sequence[Span], *, by_name: bool = False) -> list[Span]:
    """Neighbouring stretches of one phase as one; with `by_name`, of one step (its ramp and its hold)."""
    found: list[Span] = []
    for span in spans:
        same = found and found[-1].phase == span.phase and (not by_name or found[-1].mark.name == span.mark.name)
        if same:
            found[-1] = Span(found[-1].from_s, span.to_s, found[-1].mark)
        else:
            found.append(span)
    return found


def shade(axes: Sequence[Axes], spans: Sequence[Span], *, named: bool = True) -> None:
    """Tint the phases and, within the steps, every other step; write the phases' names where there is room."""
    if not spans:
        return
    phases = joined(spans)
    steps = [span for span in joined(spans, by_name=True) if span.phase == "steps"]
    for ax in axes:
        for phase in phases:
            if phase.phase != "steps":
                colour = light(phase.phase if phase.phase in PHASES else "steps")
                ax.axvspan(phase.from_s, phase.to_s, color=colour, alpha=0.16, lw=0, zorder=0)
        if len(steps) <= 120:
            for i, span in enumerate(steps):
                if i % 2 == 0:
                    ax.axvspan(span.from_s, span.to_s, color=light("steps"), alpha=0.26, lw=0, zorder=0)
    if named:
        _name_phases(axes[0], phases)


def _name_phases(ax: Axes, phases: Sequence[Span]) -> None:
    floor, ceiling = ax.get_ylim()
    ax.set_ylim(floor, ceiling + 0.09 * (ceiling - floor))  # a free line above the data for the names
    low, high = ax.get_xlim()
    room = ax.get_position().width * WIDE
    for phase in phases:
        share = (min(phase.to_s, high) - max(phase.from_s, low)) / max(high - low, 1e-12)
        if share * room > 6.2 * len(phase.phase) + 6:
            ax.annotate(
                phase.phase,
                ((phase.from_s + phase.to_s) / 2, 0.985),
                xycoords=("data", "axes fraction"),
                ha="center",
                va="top",
                fontsize=9.5,
                color=light("muted"),
            )


NOT_MARKED = frozenset({"devices", "clamps", "homed", "retry", "timeout", "overrun", "motor_error", "safe_state"})
"""Events that say nothing about the curves, or may come by the hundred: in the table, not drawn."""


def marked_events(events: Sequence[Event], most: int = 40) -> list[tuple[int, Event]]:
    """The events to mark in a plot, numbered from 1 as in the table under it."""
    kept = [event for event in sorted(events, key=lambda e: e.time_s) if event.name not in NOT_MARKED]
    return list(enumerate(kept[:most], start=1))


def mark(axes: Sequence[Axes], events: Sequence[tuple[int, Event]]) -> None:
    """A thin line at each event through all panels, numbered at the foot of the first; numbers never overlap."""
    low, high = axes[0].get_xlim()
    gap = 15.0 * (high - low) / (WIDE * axes[0].get_position().width)
    last = -math.inf
    level = 0
    for number, event in events:
        for ax in axes:
            ax.axvline(event.time_s, color=light("event"), lw=0.9, ls=(0, (2, 2)), zorder=1)
        level = level + 1 if event.time_s - last < gap else 0
        last = event.time_s
        axes[0].annotate(
            str(number),
            (event.time_s, 0.0),
            xycoords=("data", "axes fraction"),
            xytext=(0, 7 + 14 * (level % 6)),
            textcoords="offset points",
            ha="center",
            va="center",
            fontsize=9,
            color=light("event"),
            bbox={"boxstyle": "round,pad=0.18", "fc": light("paper"), "ec": light("event"), "lw": 0.7},
            zorder=5,
        )


def time_span(recording: Recording) -> tuple[float, float]:
    """First and last moment of the recording, s: samples, marks and events; (0, 1) when it is empty."""
    times = [channel.time_s for channel in (recording.motor, recording.load_cell) if channel.time_s.size]
    ends = [float(t[0]) for t in times] + [float(t[-1]) for t in times]
    ends += [mark.time_s for mark in recording.steps] + [event.time_s for event in recording.events]
    if not ends:
        return 0.0, 1.0
    low, high = min(ends), max(ends)
    return low, high if high > low else low + 1.0


def plain_numbers(axis: Axis) -> None:
    """Ticks of a logarithmic axis as numbers: its own are markup, and no markup is drawn (svg.py)."""
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
