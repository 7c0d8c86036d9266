"""The plots of a diagnosis: residuals over time and against the view that shows the cause, candidates, errors."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MaxNLocator, NullLocator
from numpy.typing import NDArray

from bench.diagnose.result import Diagnosis
from bench.diagnose.words import name_of
from bench.report import axes as parts
from bench.report.diagnosis_views import View
from bench.report.style import light
from bench.report.svg import render

Array = NDArray[np.float64]

MOST_BARS = 12
LEAST_BAR = 0.002
MOST_MARKS = 400
BEFORE, AFTER = "simulated", "commanded"
"""Colours of what is from before and after."""


def flagged(d: Diagnosis) -> NDArray[np.bool_]:
    """Samples (n,) that have a channel fault, where they can be laid beside the residual."""
    out = np.zeros(len(d.time_s), dtype=bool)
    for mask in d.flags.values():
        if len(mask) == len(out):
            out |= mask
    return out


def residuals(d: Diagnosis) -> str:
    """Residual over time with the noise band and the flagged samples; where a cause is named also what is left then."""
    named = bool(d.causes)
    heights = [170.0, 130.0] if named else [170.0]
    before, after = d.force_N - d.before_N, d.force_N - d.after_N
    shown = d.counted if d.counted.any() else np.ones(len(d.time_s), dtype=bool)
    bad = flagged(d)

    def draw(figure: Figure) -> None:
        made = parts.panels(figure, heights)
        made[0].set_xlim(float(d.time_s[0]), float(d.time_s[-1]))
        shows = [(before, BEFORE, "before: as believed, refitted" if named else "as believed, refitted")]
        if named:
            shows.append((after, AFTER, "after: with the causes named"))
        for ax, (left, colour, label) in zip(made, shows, strict=True):
            top = 1.12 * max(float(np.nanmax(np.abs(left[shown & ~bad]), initial=0.0)), 2.4 * d.noise_floor)
            scale, unit = parts.force_unit(top)
            history = ~(shown | bad)
            if history.any():
                parts.line(ax, d.time_s, np.where(history, left, np.nan) * scale, "muted", "", width=0.7)
            parts.line(ax, d.time_s, np.where(shown & ~bad, left, np.nan) * scale, colour, label, width=0.8)
            parts.noise_band(ax, d.noise_floor, scale)
            _marks(ax, d.time_s, left * scale, bad, top * scale)
            ax.axhline(0.0, color=light("muted"), lw=0.7)
            ax.set_ylim(-top * scale, top * scale)
            ax.set_ylabel(f"residual, {unit}")
            parts.legend(ax)
        made[-1].set_xlabel("time, s")

    title = "Residual over time, before and after" if named else "Residual over time"
    return render("residuals", title, parts.WIDE, parts.stacked(heights), draw)


def _marks(ax: Axes, time_s: Array, left: Array, bad: NDArray[np.bool_], top: float) -> None:
    at = np.flatnonzero(bad)
    if at.size == 0:
        return
    at = at[:: max(1, -(-at.size // MOST_MARKS))]
    y = np.clip(left[at], -0.94 * top, 0.94 * top)
    ax.plot(time_s[at], y, "x", color=light("event"), ms=4, label="flagged, left out", zorder=4)


def view(chosen: View, *, named: bool = True) -> str:
    """Mean residual before and after, group by group, against what shows the cause best; `named`: a cause is."""
    heights = [240.0]
    values = [np.abs(np.concatenate([s.before_N, s.after_N])) for s in chosen.series]
    scale, unit = parts.force_unit(max((float(np.nanmax(v, initial=0.0)) for v in values), default=1.0))
    spectrum = chosen.name == "frequency"
    top = 30.0 if len(chosen.series) < 2 else 52.0  # room for a legend of two lines

    def draw(figure: Figure) -> None:
        [ax] = parts.panels(figure, heights, top=top)
        styles, marks = ("-", "--", ":"), ("o", "s", "^")
        for number, s in enumerate(chosen.series):
            both = [(s.before_N, BEFORE, "before"), (s.after_N, AFTER, "after")]
            for left, colour, word in both if named else [(s.before_N, BEFORE, "")]:
                label = ", ".join(part for part in (word, s.label) if part) or "_nolegend_"
                if spectrum:
                    parts.line(ax, s.x, left * scale, colour, label, width=0.9)
                    continue
                few = len(s.x) <= 40
                ax.plot(
                    s.x, left * scale, styles[number % 3], color=light(colour), lw=1.3, ms=3.5,
                    marker=marks[number % 3] if few else None, label=label,
                )  # fmt: skip
        if chosen.logarithmic:
            ax.set_xscale("log")
            ax.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            parts.plain_numbers(ax.xaxis)
            ax.xaxis.set_minor_locator(NullLocator())
        if not spectrum:
            ax.axhline(0.0, color=light("muted"), lw=0.7)
        if chosen.name == "cycle":
            ax.xaxis.set_major_locator(MaxNLocator(integer=True))
        ax.set_ylabel(f"{'amplitude' if spectrum else 'mean residual'}, {unit}")
        ax.set_xlabel(chosen.axis)
        columns = max(len(chosen.series), 2)
        if ax.get_legend_handles_labels()[0]:
            ax.legend(loc="lower left", bbox_to_anchor=(0.0, 1.01), ncols=columns, columnspacing=1.4, handlelength=2.2)

    return render("view", f"Residual against {chosen.axis}", parts.WIDE, parts.stacked(heights, top), draw)


def candidates(d: Diagnosis) -> str:
    """What each candidate alone takes of the best one's gain, as bars; empty where none was tried."""
    ranked = [a for a in d.ranking if math.isfinite(a.gain_share) and a.gain_share >= LEAST_BAR][:MOST_BARS]
    if not ranked:
        return ""
    height = 21.0 * len(ranked) + 8.0
    own = {c.id for c in d.causes}
    beside = {a.id for c in d.causes for a in c.alternatives if not a.excluded}

    def draw(figure: Figure) -> None:
        width, total = figure.get_figwidth() * figure.dpi, figure.get_figheight() * figure.dpi
        ax = figure.add_axes((270.0 / width, 42.0 / total, (width - 330.0) / width, height / total))
        for place, a in enumerate(ranked):
            colour = "commanded" if a.id in own else "precondition" if a.id in beside else "tare"
            ax.barh(-place, 100.0 * a.gain_share, height=0.68, color=light(colour), lw=0)
            ax.annotate(
                f"{100.0 * a.gain_share:.3g} %", (100.0 * a.gain_share, -place), xytext=(4, 0),
                textcoords="offset points", va="center", fontsize=9.5, color=light("muted"),
            )  # fmt: skip
        ax.set_yticks(range(0, -len(ranked), -1), [name_of(a.id) for a in ranked])
        ax.set_ylim(-len(ranked) + 0.4, 0.6)
        ax.set_xlim(0.0, 108.0)
        ax.set_xlabel("share of the best candidate's gain, %")
        ax.tick_params(axis="y", length=0)
        ax.grid(visible=False, axis="y")

    return render("candidates", "Candidates, best first", parts.WIDE, height + 52.0, draw)


def held_out(d: Diagnosis) -> str:
    """Held-out error, before and after where a cause is named, with the noise floor."""
    scale, unit = parts.force_unit(max(d.held_out_before, d.held_out_after))
    rows = [("before", d.held_out_before, BEFORE), ("after", d.held_out_after, AFTER)]
    if not d.causes:
        rows = [("as believed", d.held_out_before, BEFORE)]
    height = 30.0 * len(rows)

    def draw(figure: Figure) -> None:
        width, total = figure.get_figwidth() * figure.dpi, figure.get_figheight() * figure.dpi
        ax = figure.add_axes((90.0 / width, 42.0 / total, (width - 170.0) / width, height / total))
        for place, (_, value, colour) in enumerate(rows):
            ax.barh(-place, value * scale, height=0.62, color=light(colour), lw=0)
            ax.annotate(
                f"{value * scale:.3g} {unit}", (value * scale, -place), xytext=(4, 0), textcoords="offset points",
                va="center", fontsize=10, color=light("ink"),
            )  # fmt: skip
        ax.axvline(d.noise_floor * scale, color=light("noise"), lw=1.6, ls="--", label="noise floor")
        ax.set_yticks(range(0, -len(rows), -1), [name for name, _, _ in rows])
        ax.set_ylim(0.5 - len(rows), 0.5)
        ax.set_xlim(0.0, 1.12 * max(d.held_out_before, d.held_out_after, 1e-6) * scale)
        ax.set_xlabel(f"error on data held out, rms, {unit}")
        ax.tick_params(axis="y", length=0)
        ax.grid(visible=False, axis="y")
        parts.legend(ax)

    return render("held-out", "Error on data held out", parts.WIDE, height + 42.0 + 26.0, draw)
