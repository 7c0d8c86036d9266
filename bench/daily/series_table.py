"""What a series came to: a line a pad, on the terminal and as CSV."""

from __future__ import annotations

import csv
import io
import json
import math
from typing import Any

from bench.daily.series_file import Series
from bench.daily.series_state import State
from bench.daily.yaml_edit import write_whole
from bench.run.folder import FIT

TABLE = "series.csv"
_ABOUT_FIT = ("law", "order", "contact", "rmse", "noise_floor", "fit_percent")
_SHOWN = 6


def rows(series: Series, state: State) -> list[dict[str, Any]]:
    """One mapping a pad of the list, in its order; fitted parameters by name, their standard errors as `NAME_std`."""
    found = []
    for pad in series.pads:
        kept = state.of(pad.id)
        row: dict[str, Any] = {"id": pad.id, "thickness": pad.thickness, "status": kept.status or "to do"}
        last = next((turn for turn in reversed(kept.turns) if turn.status == kept.status), None)
        if last is not None:
            row |= {"run": last.folder, "left_alone_s": last.rested_s, "runs": len(kept.turns), "cause": last.cause}
            path = series.out / last.folder / FIT
            if kept.status == "done" and path.is_file():
                row |= _of_fit(json.loads(path.read_text("utf-8")))
        found.append(row)
    return found


def _of_fit(fit: dict[str, Any]) -> dict[str, Any]:
    row = {name: fit.get(name) for name in _ABOUT_FIT}
    for name, parameter in fit["parameters"].items():
        row[name], row[f"{name}_std"] = parameter["value"], parameter["std"]
    row["undetermined"] = " ".join(fit.get("undetermined", []))
    return row


def columns(found: list[dict[str, Any]]) -> list[str]:
    """All names, in the order in which they come up."""
    return list(dict.fromkeys(name for row in found for name in row))


def write(series: Series, found: list[dict[str, Any]]) -> None:
    """`series.csv` in the series' folder."""
    text = io.StringIO(newline="")
    table = csv.DictWriter(text, columns(found), restval="", lineterminator="\n")
    table.writeheader()
    table.writerows(found)
    write_whole(series.out / TABLE, text.getvalue())


def _with_doubt(value: float | None, std: float | None) -> str:
    from bench.report.markup import measured  # with the pages, which take a second to load

    if value is None:
        return "–"
    shown, doubt = measured(value, math.nan if std is None else std)
    return shown if doubt in ("–", "0") else f"{shown} ± {doubt}"


def lines(found: list[dict[str, Any]]) -> list[str]:
    """The table for a terminal: the pad, how it went, the first fitted parameters, the error."""
    names = [name.removesuffix("_std") for name in columns(found) if name.endswith("_std")][:_SHOWN]
    head = ["pad", "", *names, "error mN"]
    body = []
    for row in found:
        numbers = [_with_doubt(row.get(name), row.get(f"{name}_std")) for name in names]
        error = f"{1e3 * row['rmse']:.3g}" if row.get("rmse") is not None else "–"
        body.append([row["id"], row["status"], *numbers, error])
    widths = [max(len(line[i]) for line in [head, *body]) for i in range(len(head))]
    return ["  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)) for line in [head, *body]]
