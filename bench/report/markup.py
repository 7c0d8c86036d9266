"""Small builders of HTML. Everything that comes from outside goes through `text`, which escapes it."""

from __future__ import annotations

import html
import math
import re
from collections.abc import Iterable, Sequence
from typing import Any

from bench.report.style import style_sheet

LONGEST = 20_000
"""Characters of one value or attached file that a page shows."""


def text(value: object) -> str:
    """`value` as text that is safe inside an element or an attribute; very long values are cut, and say so."""
    plain = str(value)
    if len(plain) > LONGEST:
        plain = f"{plain[:LONGEST]}\n… ({len(plain) - LONGEST} characters more in the recording)"
    return html.escape(plain.replace("\x00", "␀"), quote=True)


def page(title: str, body: str) -> str:
    """A whole document: no script, nothing fetched from anywhere."""
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta name="generator" content="padbench">\n'
        f"<title>{text(title)}</title>\n<style>\n{style_sheet()}</style>\n</head>\n"
        f"<body>\n<main>\n{body}\n</main>\n</body>\n</html>\n"
    )


def section(heading: str, body: str, anchor: str = "") -> str:
    """A titled card. `body` is HTML already; nothing is drawn when it is empty."""
    if not body:
        return ""
    where = f' id="{anchor}"' if anchor else ""
    return f"<section{where}>\n<h2>{text(heading)}</h2>\n{body}\n</section>\n"


def figure(svg: str, caption: str, *, wide: bool = True) -> str:
    """A plot and how to read it. Wide plots scroll sideways on a narrow screen instead of shrinking to nothing."""
    frame = f'<div class="wide">{svg}</div>' if wide else svg
    return f"<figure>{frame}<figcaption>{text(caption)}</figcaption></figure>\n"


def facts(pairs: Iterable[tuple[str, object]]) -> str:
    """A list of names and values; empty values are left out."""
    shown = [(name, value) for name, value in pairs if str(value).strip()]
    if not shown:
        return ""
    lines = "".join(f"<div><dt>{text(name)}</dt><dd>{text(value)}</dd></div>" for name, value in shown)
    return f"<dl>{lines}</dl>\n"


def table(
    head: Sequence[str], rows: Iterable[Sequence[object]], *, numeric: Sequence[int] = (), styles: Sequence[str] = ()
) -> str:
    """A table with its first column as row headings; the columns in `numeric` are set right.

    `styles`: a class for each row (`chosen`, `off` or empty).
    """

    def kind(i: int) -> str:
        return ' class="n"' if i in numeric else ""

    top = "".join(f'<th scope="col"{kind(i)}>{text(name)}</th>' for i, name in enumerate(head))
    lines = []
    for r, row in enumerate(rows):
        style = f' class="{styles[r]}"' if r < len(styles) and styles[r] else ""
        cells = "".join(
            f'<th scope="row">{text(cell)}</th>' if i == 0 else f"<td{kind(i)}>{text(cell)}</td>"
            for i, cell in enumerate(row)
        )
        lines.append(f"<tr{style}>{cells}</tr>")
    if not lines:
        return ""
    return f'<div class="scroll"><table><thead><tr>{top}</tr></thead><tbody>{"".join(lines)}</tbody></table></div>\n'


def bullets(items: Iterable[object], kind: str = "") -> str:
    """A list of sentences."""
    style = f' class="{kind}"' if kind else ""
    lines = "".join(f"<li>{text(item)}</li>" for item in items)
    return f"<ul{style}>{lines}</ul>\n" if lines else ""


def folded(summary: str, body: str) -> str:
    """Detail that opens on a click, without script."""
    return f"<details><summary>{text(summary)}</summary>{body}</details>\n" if body else ""


def tiles(pairs: Iterable[tuple[str, str]]) -> str:
    """The few numbers to see first: (name, value)."""
    return (
        '<div class="tiles">'
        + "".join(f'<div class="tile"><b>{text(value)}</b> <span>{text(name)}</span></div>' for name, value in pairs)
        + "</div>\n"
    )


def number(value: Any) -> float:
    """`value` as a float; NaN where it is none (None, text, missing)."""
    if isinstance(value, bool) or value is None:
        return math.nan
    try:
        return float(value)
    except (TypeError, ValueError):
        return math.nan


def digits(value: float, significant: int = 4) -> str:
    """A number as people write it: so many significant digits, no exponent where it is readable without one."""
    if not math.isfinite(value):
        return "–"
    if value == 0:
        return "0"
    rounded = float(f"{value:.{significant - 1}e}")
    size = math.floor(math.log10(abs(rounded)))
    if size < -5 or size > 6:
        return f"{rounded:.{significant - 1}e}".replace("-", "−")
    return f"{rounded:.{max(0, significant - 1 - size)}f}".replace("-", "−")


_RAISED = str.maketrans("0123456789-.", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻·")


def raised(plain: str) -> str:
    """Powers as people write them: `N/mm^2` → N/mm²."""
    return re.sub(r"\^(-?[0-9.]+)", lambda m: m[1].translate(_RAISED), plain)


def column(values: Sequence[float], significant: int = 3) -> list[str]:
    """Numbers of one column with the same decimals: the smallest shows so many significant digits."""
    sizes = [abs(value) for value in values if math.isfinite(value) and value != 0]
    places = max(0, significant - 1 - math.floor(math.log10(min(sizes)))) if sizes else 0
    if places > 9:
        return [digits(value, significant) for value in values]
    return [f"{value:.{places}f}".replace("-", "−") if math.isfinite(value) else "–" for value in values]


_SUFFIXES = {
    "mm_s": "mm/s",
    "mm_s2": "mm/s²",
    "N_mm": "N/mm",
    "N_s": "N/s",
    "mm": "mm",
    "um": "µm",
    "N": "N",
    "mN": "mN",
    "s": "s",
    "ms": "ms",
    "us": "µs",
    "Hz": "Hz",
    "kg": "kg",
    "g": "g",
    "ppm": "ppm",
    "percent": "%",
    "C": "°C",
    "A": "A",
    "V": "V",
}


_PLAIN = {
    "radius": "mm",
    "thickness": "mm",
    "force_delay": "s",
    "position_delay": "s",
    "frame_stiffness": "N/mm",
    "moving_mass": "kg",
}
"""Units of figures of a bench or protocol file, whose names carry none."""


def named(key: str, value: str) -> str:
    """A figure with its unit, which its name carries, for reading: ("surface_mm", "3.217") → "surface 3.217 mm"."""
    if key in _PLAIN and value not in ("", "–"):
        return f"{key.replace('_', ' ')} {value} {_PLAIN[key]}"
    for parts in (2, 1):
        words = key.rsplit("_", parts)
        unit = _SUFFIXES.get("_".join(words[1:]))
        if unit and len(words) == parts + 1 and words[0]:
            return f"{words[0].replace('_', ' ')} {value} {unit}"
    return f"{key.replace('_', ' ')} {value}"


def measured(value: float, std: float) -> tuple[str, str]:
    """A value and its standard deviation, both to the second digit of the latter: ("2.240", "0.010")."""
    if not (math.isfinite(value) and math.isfinite(std) and std > 0):
        return digits(value), "–" if not (math.isfinite(std) and std == 0) else "0"
    rounded = float(f"{std:.1e}")
    places = 1 - math.floor(math.log10(rounded))
    if places > 9 or places < -3 or abs(value) >= 1e7:
        return digits(value, 6), digits(std, 2)
    places = max(0, places)
    return f"{value:.{places}f}".replace("-", "−"), f"{std:.{places}f}"


def forces(*values_N: float, significant: int = 3) -> list[str]:
    """Forces in one unit, mN where all are small, so that the eye compares them: ["12.1 mN", "10.0 mN"]."""
    finite = [abs(v) for v in values_N if math.isfinite(v)]
    small = bool(finite) and max(finite) < 0.5
    scale, unit = (1e3, "mN") if small else (1.0, "N")
    return [f"{digits(v * scale, significant)} {unit}" if math.isfinite(v) else "–" for v in values_N]
