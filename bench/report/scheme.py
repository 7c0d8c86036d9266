"""How a method that counts its steps came to its numbers, and what hangs on its sample time: poles, two plots."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter
from numpy.typing import NDArray

from bench.report import axes as parts
from bench.report import markup
from bench.report.markup import digits, figure
from bench.report.numbers import symbol
from bench.report.style import light
from bench.report.svg import render
from bench.report.view import FitView, OverTimes

Array = NDArray[np.float64]

_HEIGHT = 190.0
_MARKS = ("o", "s", "^", "D", "v", "P", "X")
_REAL = 1e-9  # imaginary part, of the magnitude, that is rounding


def section(fit: FitView | None) -> str:
    """Poles, convergence, numbers against the sample time; empty for a method that has none of them."""
    if fit is None:
        return ""
    body = _poles(fit)
    if svg := convergence(fit):
        body += figure(svg, _said(fit))
    if fit.over_times is not None:
        body += figure(
            over_times(fit.over_times),
            "The same data at other sample times T, with law and order kept. Filled: the filter is a relaxation; "
            "hollow: it is none, and has no rates. The line marks the T of this fit. Numbers of a pad do not hang on "
            "T: where they move with it, the method does not see the pad alone.",
        )
        refused = [f"T = {digits(T, 3)} s: {why}" for T, why in fit.over_times.refused.items()]
        body += markup.bullets(refused)
    return body


def _said(fit: FitView) -> str:
    if "time_s" in fit.history:
        return "What the numbers stood at while the run went on, over what they ended at: 1 is where they came to rest."
    count = fit.number("iterations")
    steps = int(count) if math.isfinite(count) else len(fit.history["V"])
    return (
        f"V of (16) after each of {steps} iterations. It need not fall in the two-step methods: where they come to "
        "rest is no minimum of V."
    )


def _poles(fit: FitView) -> str:
    """Each pole of the filter, and what it would be as a mode of relaxation."""
    filter = fit.json.get("filter")
    if not isinstance(filter, Mapping):
        return ""
    T = markup.number(filter.get("sample_time_s"))
    rows = []
    for re, im in filter.get("poles") or ():
        is_real = abs(im) <= _REAL * max(abs(complex(re, im)), 1e-300)
        shown = digits(re) if is_real else f"{digits(re)} {'+' if im > 0 else '−'} {digits(abs(im))} i"
        relaxes = is_real and 0 < re < 1
        rows.append([
            shown,
            digits(abs(complex(re, im))),
            digits(-math.log(re) / T) if relaxes and T > 0 else "–",
            "" if relaxes else "no relaxation's: it is not real and between 0 and 1",
        ])  # fmt: skip
    whole = "The filter is a relaxation." if fit.json.get("physical") else "The filter as a whole is no relaxation."
    said = f"<p>{whole} Sample time {digits(T)} s.</p>\n"
    return said + markup.table(["pole", "magnitude", "rate −ln p / T, 1/s", ""], rows, numeric=(0, 1, 2))


def convergence(fit: FitView) -> str:
    """V over the iterations, or, for a method that follows the run, its numbers over time; empty without a history."""
    if "time_s" in fit.history:
        return _following(fit.history)
    V = np.asarray(fit.history.get("V", ()), dtype=float)
    if V.size < 2 or not (np.isfinite(V) & (V > 0)).any():
        return ""

    def draw(figure: Figure) -> None:
        [ax] = parts.panels(figure, [_HEIGHT], top=12.0)
        ax.plot(np.arange(1, V.size + 1), V, "-o", color=light("simulated"), lw=1.4, ms=3)
        ax.set_yscale("log")
        parts.plain_numbers(ax.yaxis)
        ax.yaxis.set_minor_formatter(FuncFormatter(lambda value, _: f"{value:g}" if _few(ax) else ""))
        ax.set_xlabel("iteration")
        ax.set_ylabel("V, N²")

    return render("convergence", "Convergence", parts.WIDE, parts.stacked([_HEIGHT], 12.0), draw)


def _few(ax: Axes) -> bool:
    low, high = ax.get_ylim()
    return high < 5 * low


def _following(history: Mapping[str, Sequence[float]]) -> str:
    time = np.asarray(history["time_s"], dtype=float)
    names = [name for name in history if name not in ("time_s", "V")]
    if time.size < 2 or not names:
        return ""

    def draw(figure: Figure) -> None:
        [ax] = parts.panels(figure, [_HEIGHT])
        for i, name in enumerate(names):
            y = np.asarray(history[name], dtype=float)
            if y[-1] != 0:
                style = ("-", "--", ":")[(i // 7) % 3]
                ax.plot(time, y / y[-1], style, color=light(f"run-{i % 7}"), lw=1.3, label=symbol(name))
        ax.axhline(1.0, color=light("muted"), lw=0.7, zorder=0)
        ax.set_ylim(0.0, 2.0)
        ax.set_xlabel("time, s")
        ax.set_ylabel("over the last value")
        parts.legend(ax)

    return render("convergence", "Convergence", parts.WIDE, parts.stacked([_HEIGHT]), draw)


def over_times(of: OverTimes) -> str:
    """The law's numbers over those of this fit, and the rates, against the sample time."""
    heights = [_HEIGHT, _HEIGHT]
    here = int(np.nanargmin(np.abs(np.log(of.T / of.chosen))))

    def draw(figure: Figure) -> None:
        top, low = parts.panels(figure, heights)
        for i, (name, y) in enumerate(of.numbers.items()):
            relative = y / y[here] if y[here] else y
            _dots(top, of.T, relative, of.physical, f"run-{i % 7}", _MARKS[i % 7], symbol(name))
        for i in range(of.rates.shape[1]):
            colour = f"run-{(len(of.numbers) + i) % 7}"
            _dots(low, of.T, of.rates[:, i], of.physical, colour, _MARKS[i % 7], symbol(f"nu_{i + 1}"))
        for ax in (top, low):
            ax.axvline(of.chosen, color=light("muted"), lw=1.0, ls="--", zorder=0)
            parts.legend(ax)
        low.set_xscale("log")
        low.set_xticks(of.T, [digits(T, 2) for T in of.T], minor=False)
        low.minorticks_off()
        if np.nanmax(of.rates, initial=0.0) > 0:
            low.set_yscale("log")
            parts.plain_numbers(low.yaxis)
        top.set_ylabel("law, over this fit's")
        low.set_ylabel("rate −ln p / T, 1/s")
        low.set_xlabel("sample time T, s")

    return render("sample-times", "Numbers against the sample time", parts.WIDE, parts.stacked(heights), draw)


def _dots(ax: Axes, T: Array, y: Array, physical: NDArray[np.bool_], colour: str, mark: str, label: str) -> None:
    ax.plot(T, y, "-", color=light(colour), lw=1.0)
    for which, fill in ((physical, light(colour)), (~physical, light("paper"))):
        ax.plot(T[which], y[which], mark, color=light(colour), mfc=fill, ms=5)
    ax.plot([], [], f"-{mark}", color=light(colour), ms=5, lw=1.0, label=label)
