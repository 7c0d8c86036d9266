"""The numbers as files: tables.csv and tables.json like Tables I to III with the paper's own beside, findings.json."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from bench.paper.draws import Draw
from bench.paper.experiment import ORDERS
from bench.paper.findings import Finding, best, of
from bench.paper.rates import Rate
from bench.paper.tables import tables
from sim.digital import Filter

MADE = (
    ("I", "polyurethane", "noniterative", "power"),
    ("I, with (9)", "polyurethane", "noniterative", "exponential"),
    ("II", "polyurethane", "iterative", "exponential"),
    ("II, silicone", "silicone", "iterative", "exponential"),
    ("III", "polyurethane", "fast", "exponential"),
    ("III, all ramps", "polyurethane", "fast, all ramps", "exponential"),
    ("iv", "polyurethane", "iv", "exponential"),
    ("continuous", "polyurethane", "continuous", "exponential"),
)
"""(table, pad, method, law): those like the paper's, the paper's method on other ground, and the unbiased ones."""

Line = dict[str, Any]


def lines(draws: Sequence[Draw]) -> list[Line]:
    """Every table's rows: the paper's first where it has one, then those of draw 0 (the best of the starts)."""
    out: list[Line] = []
    for table, pad, method, law in MADE:
        if table in tables():
            for row in tables()[table].rows:
                out.append(_line("paper", table, pad, method, law, row.filter, row.printed.gamma, row.V, row.reason))
        top = best(next(of(draws[:1], pad, method, law)))
        for r in ORDERS:
            if r in top:
                f = top[r]
                out.append(_line("remade", table, pad, method, law, f.filter, f.gamma, f.V, f.reason))
    return out


def _line(
    source: str, table: str, pad: str, method: str, law: str, filter: Filter, gamma: Sequence[float], V: float | None,
    reason: str,
) -> Line:  # fmt: skip
    gain = filter.static_gain
    return {
        "source": source, "table": table, "pad": pad, "method": method, "law": law, "r": filter.order,
        "a": list(filter.a[1:]), "b": list(filter.b[1:]), "gamma": list(gamma), "V_N2": V,
        "poles": [[float(p.real), float(p.imag)] for p in filter.poles], "stable": filter.stable,
        "static_gain": gain if math.isfinite(gain) else None, "relaxation": not reason, "reason": reason,
    }  # fmt: skip


def write_tables(folder: Path, rows: Sequence[Line]) -> None:
    """tables.json, and tables.csv with a_1 … a_4, b_1 … b_4, gamma_1, gamma_2 in columns."""
    _json(folder / "tables.json", rows)
    n = max(ORDERS)
    plain = ("source", "table", "pad", "method", "law", "r")
    names = [*plain, *(f"{x}_{i}" for x in "ab" for i in range(1, n + 1)), "gamma_1", "gamma_2", "V_N2", "poles",
             "stable", "static_gain", "relaxation", "reason"]  # fmt: skip
    with (folder / "tables.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, names, restval="")
        writer.writeheader()
        for row in rows:
            line = {name: row[name] for name in names if name in row} | {"poles": poles_text(row["poles"])}
            for letter in "ab":
                line |= {f"{letter}_{i}": value for i, value in enumerate(row[letter], 1)}
            line |= {f"gamma_{i}": value for i, value in enumerate(row["gamma"], 1)}
            writer.writerow(line)


def write_findings(
    folder: Path, draws: int, starts: int, found: Sequence[Finding], physical: Sequence[tuple[str, str, str, int, Rate]]
) -> None:
    """findings.json, and physical.csv with the share of filters that are relaxations."""
    shares = [{"pad": pad, "method": method, "law": law, "r": r, "hits": share.hits, "of": share.of, "low": share.low,
               "high": share.high} for pad, method, law, r, share in physical]  # fmt: skip
    data = {"draws": draws, "starts": starts, "findings": [f.to_json() for f in found], "physical": shares}
    _json(folder / "findings.json", data)
    with (folder / "physical.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, ("pad", "method", "law", "r", "hits", "of", "low", "high"))
        writer.writeheader()
        writer.writerows(shares)


def poles_text(poles: Sequence[Sequence[float]]) -> str:
    """Poles as people write them; of a pair one is written with ±, but for two that are one but for rounding."""
    out = []
    for real, imaginary in poles:
        if abs(imaginary) < 5e-5:
            out.append(f"{real:.4f}")
        elif imaginary > 0:
            out.append(f"{real:.4f} ± {imaginary:.4f}j")
    return ", ".join(out)


def _json(path: Path, data: Any) -> None:
    path.write_text(json.dumps(data, indent=1, ensure_ascii=False, allow_nan=False) + "\n", encoding="utf-8")
