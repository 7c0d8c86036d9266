"""Tables of a fit: parameters with their doubt, the structures tried, the figures of merit."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from bench.report import markup
from bench.report.markup import digits, forces, measured, number
from bench.report.verdict import LAWS
from bench.report.view import Evidence, FitView

_MEANING = {
    "m": "stiffness at the surface",
    "b": "stiffening with depth",
    "p": "stiffness coefficient of the power law",
    "q": "exponent of the stiffness",
}


def meaning(name: str) -> str:
    """What a parameter is, in a few words."""
    head, _, index = name.partition("_")
    if name in _MEANING:
        return _MEANING[name]
    if head == "c" and index.isdigit():
        return "share that never relaxes" if index == "0" else f"share of relaxation mode {index}"
    if head == "nu" and index.isdigit():
        return f"rate of relaxation mode {index}"
    if head in ("alpha", "a") and index.isdigit():
        return f"coefficient of δ^{index}"
    if head in ("F", "force") and index.isdigit():
        return f"elastic force at point {index}"
    return ""


def symbol(name: str) -> str:
    """The paper's symbol: `nu_1` → ν₁."""
    head, _, index = name.partition("_")
    if not index.isdigit():
        return name
    greek = {"nu": "ν", "alpha": "α", "gamma": "γ", "delta": "δ", "tau": "τ"}.get(head, head)
    return greek + index.translate(str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉"))


def parameters(fit: FitView) -> str:
    """The parameters: value, unit, standard deviation, relative, and in words where the data do not determine one."""
    given = fit.json.get("parameters")
    if not isinstance(given, Mapping):
        return ""
    loose = {str(name) for name in fit.json.get("undetermined") or ()}
    rows, styles = [], []
    for name, entry in given.items():
        value, std, unit = of(entry)
        shown, doubt = measured(value, std)
        relative = f"{digits(100 * std / abs(value), 2)} %" if value and math.isfinite(std) else "–"
        undetermined = name in loose
        remark = "undetermined by these data" if undetermined else "" if math.isfinite(std) else "doubt not known"
        said = ", ".join(part for part in (meaning(name), time_constant(name, value), remark) if part)
        rows.append([symbol(name), shown, doubt, unit, relative, said])
        styles.append("off" if undetermined else "")
    if "c_0" not in given and "c_1" in given:
        rest = 1.0 - sum(of(entry)[0] for name, entry in given.items() if str(name).startswith("c_"))
        rows.append([symbol("c_0"), digits(rest), "–", "1", "–", f"{meaning('c_0')}, from the others: 1 − Σ cᵢ"])
    head = ["parameter", "value", "std. dev.", "unit", "relative", "meaning"]
    formula = LAWS.get(str(fit.json.get("law")), ("", ""))[1]
    said = f"<p><code>{markup.text(formula)}</code> &nbsp; <code>g(t) = c₀ + Σ cᵢ·e^(−νᵢ·t)</code></p>\n"
    return (said if formula else "") + markup.table(head, rows, numeric=(1, 2, 4), styles=styles)


def of(entry: Any) -> tuple[float, float, str]:
    """Value, standard deviation (NaN: unknown) and unit of a parameter of fit.json."""
    if not isinstance(entry, Mapping):
        return number(entry), math.nan, ""
    return number(entry.get("value")), number(entry.get("std")), str(entry.get("unit") or "1")


def time_constant(name: str, rate: float) -> str:
    """A rate as the time constant that people think in."""
    return f"time constant {digits(1.0 / rate, 3)} s" if name.startswith("nu_") and rate > 0 else ""


def merit(fit: FitView) -> str:
    """Every figure of the fit."""
    rmse, floor, held = forces(fit.number("rmse"), fit.number("noise_floor"), fit.number("held_out_rmse"))
    yes = {True: "yes", False: "no"}
    seconds = fit.number("seconds")
    return markup.facts(
        [
            ("Method", fit.json.get("method", "")),
            ("Error of the simulation, rms", rmse),
            ("Noise floor, rms", floor),
            ("Error on data held out, rms", held if held != "–" else ""),
            ("V, mean squared error (16)", f"{digits(fit.number('V'))} N²" if math.isfinite(fit.number("V")) else ""),
            ("Samples fitted", fit.json.get("samples", "")),
            ("Physical", yes.get(fit.json.get("physical", None), "")),
            ("Converged", yes.get(fit.json.get("converged", None), "")),
            ("Time taken", f"{digits(seconds, 2)} s" if math.isfinite(seconds) else ""),
        ]
    )


def evidence(rows: list[Evidence]) -> str:
    """The structures tried, best first within each law, with the chosen one marked in words."""
    if not rows:
        return ""
    held = any(math.isfinite(row.held_out_rmse_N) for row in rows)
    ruled = any(math.isfinite(row.criterion) for row in rows)
    least = min((row.criterion for row in rows if math.isfinite(row.criterion)), default=math.nan)
    contacts = len({row.contact for row in rows}) > 1
    values = [row.rmse_N for row in rows] + [row.held_out_rmse_N for row in rows]
    scale, unit = (1e3, "mN") if max((v for v in values if math.isfinite(v)), default=1.0) < 0.5 else (1.0, "N")
    head = ["law", "order", *(["contact"] if contacts else []), f"error, {unit} rms"]
    head += [f"held out, {unit} rms"] if held else []
    head += ["criterion above the best", "remark"] if ruled else ["remark"]
    errors = markup.column([scale * row.rmse_N for row in rows])
    left_out = markup.column([scale * row.held_out_rmse_N for row in rows])
    lines = []
    for row, error, other in zip(rows, errors, left_out, strict=True):
        line = [row.law, str(row.order), *([row.contact] if contacts else []), error]
        line += [other] if held else []
        line += [f"{row.criterion - least:.1f}" if math.isfinite(row.criterion) else "–"] if ruled else []
        lines.append([*line, ", ".join(x for x in ("chosen" if row.chosen else "", row.remark) if x)])
    right = tuple(i for i, name in enumerate(head) if name not in ("law", "contact", "remark"))
    return markup.table(head, lines, numeric=right, styles=["chosen" if row.chosen else "" for row in rows])
