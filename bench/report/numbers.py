"""Tables of a fit: parameters with their doubt, the structures tried, the figures of merit."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
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


NEAR = 8
"""Structures that the table shows at once."""


def meaning(name: str) -> str:
    """What a parameter is, in a few words."""
    head, _, index = name.partition("_")
    if name in _MEANING:
        return _MEANING[name]
    if head == "c" and index.isdigit():
        return "share that never relaxes" if index == "0" else f"share of relaxation mode {index}"
    if head == "nu" and index.isdigit():
        return f"rate of relaxation mode {index}"
    if head == "alpha" and index.isdigit():
        return markup.raised(f"coefficient of δ^{index}") if index != "1" else "coefficient of δ"
    if head in ("a", "b") and index.isdigit():
        return f"of the filter (13), {'denominator' if head == 'a' else 'numerator'}"
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
        shown, doubt = measured(rest, fit.c_0_std)
        relative = f"{digits(100 * fit.c_0_std / abs(rest), 2)} %" if rest and math.isfinite(fit.c_0_std) else "–"
        rows.append([symbol("c_0"), shown, doubt, "", relative, f"{meaning('c_0')}, from the others: 1 − Σ cᵢ"])
    head = ["parameter", "value", "std. dev.", "unit", "relative", "meaning"]
    formula = LAWS.get(str(fit.json.get("law")), ("", ""))[1]
    said = f"<p><code>{markup.text(formula)}</code> &nbsp; <code>g(t) = c₀ + Σ cᵢ·e^(−νᵢ·t)</code></p>\n"
    return (said if formula else "") + markup.table(head, rows, numeric=(1, 2, 4), styles=styles)


def of(entry: Any) -> tuple[float, float, str]:
    """Value, standard deviation (NaN: unknown) and unit (empty: a pure number) of a parameter of fit.json."""
    if not isinstance(entry, Mapping):
        return number(entry), math.nan, ""
    unit = markup.raised(str(entry.get("unit") or ""))
    return number(entry.get("value")), number(entry.get("std")), "" if unit == "1" else unit


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


def evidence(rows: Sequence[Evidence]) -> str:
    """The structures tried, best first, with the chosen one marked in words; what is far behind is folded away."""
    ranked = sorted(rows, key=lambda row: (row.criterion if math.isfinite(row.criterion) else math.inf, row.rmse_N))
    near = [row for i, row in enumerate(ranked) if i < NEAR or row.chosen]
    far = [row for row in ranked if row not in near]
    more = markup.folded(f"{len(far)} further structures", _evidence(far, ranked))
    return _evidence(near, ranked) + more if ranked else ""


def _evidence(rows: Sequence[Evidence], among: Sequence[Evidence]) -> str:
    held = any(math.isfinite(row.held_out_rmse_N) for row in among)
    ruled = any(math.isfinite(row.criterion) for row in among)
    least = min((row.criterion for row in among if math.isfinite(row.criterion)), default=math.nan)
    contacts = len({row.contact for row in among}) > 1
    largest = max((row.rmse_N for row in among if math.isfinite(row.rmse_N)), default=1.0)
    scale, unit = (1e3, "mN") if largest < 0.5 else (1.0, "N")
    columns: list[tuple[str, list[str]]] = [
        ("law", [row.law for row in rows]),
        ("order", [str(row.order) for row in rows]),
    ]
    if contacts:
        columns.append(("contact", [row.contact for row in rows]))
    columns.append((f"error, {unit} rms", markup.column([scale * row.rmse_N for row in rows])))
    if held:
        columns.append((f"held out, {unit} rms", markup.column([scale * row.held_out_rmse_N for row in rows])))
    if ruled:
        above = [row.criterion - least for row in rows]
        columns.append(("criterion above the least", [f"{x:.1f}" if math.isfinite(x) else "–" for x in above]))
    remarks = [", ".join(x for x in ("chosen" if row.chosen else "", row.remark) if x) for row in rows]
    columns.append(("remark", remarks))
    right = tuple(i for i, (name, _) in enumerate(columns) if name not in ("law", "contact", "remark"))
    lines = list(zip(*(cells for _, cells in columns), strict=True))
    styles = ["chosen" if row.chosen else "" for row in rows]
    return markup.table([name for name, _ in columns], lines, numeric=right, styles=styles)
