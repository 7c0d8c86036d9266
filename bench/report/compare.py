"""Several runs side by side: parameters with intervals, and the curves laid over one another."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from matplotlib.figure import Figure

from bench.report import axes as parts
from bench.report import curves, markup, numbers, verdict
from bench.report.agreement import Entry, agreement, by_sample, differ, parameters_of
from bench.report.markup import figure, forces, measured, section
from bench.report.style import light
from bench.report.svg import render
from bench.report.view import Curve, FitView

Runs = Sequence[tuple[str, FitView]]


def write_comparison(path: Path, runs: Runs, *, samples: Sequence[str] = (), title: str = "Comparison of runs") -> None:
    """Write a page that compares fits; `runs` holds (name, fit), in the order to show; `samples`: of each run, the
    name of what was measured, or nothing.

    Raises ValueError when there is no run, OSError where the file cannot be written.
    """
    if not runs:
        raise ValueError("there is no run to compare")
    path.write_text(comparison_page(runs, title, samples), encoding="utf-8")


def comparison_page(runs: Runs, title: str = "Comparison of runs", samples: Sequence[str] = ()) -> str:
    """The comparison as HTML text."""
    names = _names(runs)
    body = f'<h1>{markup.text(title)}</h1>\n<p class="sub">{markup.text(" · ".join(_short_list(names)))}</p>\n'
    body += section("Verdicts", _verdicts(runs))
    body += section("Curves", _curves(runs))
    entries = parameters_of([fit.json for _, fit in runs])
    body += section("Parameters", _table(runs, entries) + _by_sample(entries, samples) + _intervals(runs, entries))
    return markup.page(title, body + "<footer>Written by padbench. Intervals are 95 %.</footer>")


def _short_list(names: list[str]) -> list[str]:
    return names if len(names) <= 6 else [*names[:5], f"{len(names) - 5} more"]


def _verdicts(runs: Runs) -> str:
    rows = []
    for name, fit in runs:
        rmse, floor = forces(fit.number("rmse"), fit.number("noise_floor"))
        percent = fit.number("fit_percent")
        said = verdict.judge(fit)[1]
        shown = f"{percent:.2f} %" if math.isfinite(percent) else "–"
        rows.append([name, _structure(fit), shown, rmse, floor, said])
    head = ["run", "model", "fit", "error, rms", "noise floor, rms", "verdict"]
    return markup.table(head, rows, numeric=(2, 3, 4))


def _structure(fit: FitView) -> str:
    given = (fit.json.get(key) for key in ("law", "order", "contact"))
    law, order, contact = ("" if value is None else str(value) for value in given)
    return ", ".join(part for part in (law, f"{order} modes" if order != "1" else "1 mode", contact) if part)


def _curves(runs: Runs) -> str:
    elastic: list[tuple[str, Curve]] = [(name, fit.elastic) for name, fit in runs if fit.elastic is not None]
    relaxing: list[tuple[str, Curve]] = [(name, fit.relaxation) for name, fit in runs if fit.relaxation is not None]
    pair = ""
    if elastic:
        pair += figure(curves.elastic(elastic), "Force before any relaxation, with 95 % bands.", wide=False)
    if relaxing:
        pair += figure(curves.relaxation(relaxing), "Share of the force left so long after a step.", wide=False)
    return f'<div class="pair">{pair}</div>\n' if pair else ""


def _table(runs: Runs, parameters: Mapping[str, list[Entry]]) -> str:
    rows = []
    for name, entries in parameters.items():
        cells = ["–"] * len(runs)
        for i, value, std, _, loose in entries:
            shown, doubt = measured(value, std)
            cells[i] = shown + (f" ± {doubt}" if doubt not in ("–", "0") else "") + (" (undetermined)" if loose else "")
        rows.append([numbers.symbol(name), entries[0].unit, agreement(entries), *cells])
    head = ["parameter", "unit", "do they agree?", *_names(runs)]
    return markup.table(head, rows, numeric=tuple(range(3, 3 + len(runs))))


def _by_sample(parameters: Mapping[str, list[Entry]], samples: Sequence[str]) -> str:
    """Means of the samples, where some were measured more than once, and whether they differ by more than repeats."""
    names = list(dict.fromkeys(name for name in samples if name))
    rows = []
    for parameter, entries in parameters.items():
        means, chance = by_sample(entries, samples) if samples else ([], math.nan)
        if means:
            told = {m.sample: f"{' ± '.join(measured(m.mean, m.std))} ({m.runs})" for m in means}
            cells = [told.get(name, "–") for name in names]
            rows.append([numbers.symbol(parameter), entries[0].unit, differ(chance), *cells])
    if not rows:
        return ""
    caption = "By sample: means (of so many runs) with standard errors as repeats scatter, which no fit alone tells."
    head = ["parameter", "unit", "do the samples differ?", *names]
    table = markup.table(head, rows, numeric=tuple(range(3, 3 + len(names))))
    return f"<p>{markup.text(caption)}</p>{table}"


def _names(runs: Runs) -> list[str]:
    return [name for name, _ in runs]


def _intervals(runs: Runs, parameters: Mapping[str, list[Entry]]) -> str:
    plots = ""
    for k, (name, entries) in enumerate(parameters.items()):
        if len(entries) >= 2:
            plots += f"<figure>{_interval_plot(f'interval{k}', name, entries, runs)}</figure>"
    return f'<div class="pair">{plots}</div>\n' if plots else ""


def _interval_plot(key: str, name: str, entries: list[Entry], runs: Runs) -> str:
    height = 24.0 * len(entries) + 14.0

    def draw(figure_: Figure) -> None:
        [ax] = parts.panels(figure_, [height], top=10.0)
        box = ax.get_position()
        left = 0.30
        ax.set_position((left, box.y0, box.x1 - left, box.height))
        for row, (i, value, std, _, loose) in enumerate(entries):
            colour = light("muted") if loose else light(f"run-{i % 7}")
            reach = 1.96 * std if math.isfinite(std) else 0.0
            ax.plot([value - reach, value + reach], [row, row], "-", color=colour, lw=2.2)
            ax.plot([value], [row], "o", color=colour, ms=6, mfc=light("paper") if loose else colour)
        ax.set_yticks(range(len(entries)), [_fitting(runs[i][0]) for i, *_ in entries])
        ax.set_ylim(len(entries) - 0.5, -0.5)
        ax.margins(x=0.08)
        ax.locator_params(axis="x", nbins=5)
        unit = entries[0].unit
        ax.set_xlabel(f"{numbers.symbol(name)}, {unit}" if unit not in ("", "1") else numbers.symbol(name))

    label = f"Parameter {name} of each run with its 95 % interval"
    return render(key, label, parts.HALF, parts.stacked([height], 10.0), draw)


def _fitting(name: str, most: int = 18) -> str:
    return name if len(name) <= most else name[: most - 1] + "…"
