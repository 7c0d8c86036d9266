"""The page of a diagnosis, and its sections for the page of a run: verdict, causes, residuals, what remains."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import yaml

from bench.diagnose import words
from bench.diagnose.result import CauseFound, Diagnosis
from bench.report import diagnosis_plots as plots
from bench.report import markup
from bench.report.diagnosis_views import best_view
from bench.report.markup import figure, folded, measured, section, table
from sim.effects.reading import force

__all__ = ["card", "sections", "write_diagnosis"]

RAREST = 0.0001
"""Probability of a test's finding by chance, below which its size says no more."""

TONES = {"consistent": "good", "explained": "good", "unexplained": "bad"}


def write_diagnosis(path: Path, d: Diagnosis, title: str | None = None) -> None:
    """Write the page of a diagnosis. The same diagnosis gives the same bytes. Raises OSError where it cannot."""
    path.write_text(diagnosis_page(d, title), encoding="utf-8")


def diagnosis_page(d: Diagnosis, title: str | None = None) -> str:
    """The page as HTML text: self-contained, without script."""
    heading = title or (f"Diagnosis · {d.name}" if d.name else "Diagnosis")
    there = [(anchor, name, body) for anchor, name, body in sections(d) if body]
    links = " ".join(f'<a href="#{anchor}">{markup.text(name)}</a>' for anchor, name, _ in there)
    body = (
        f"<h1>{markup.text(heading)}</h1>\n"
        f'<p class="sub">{markup.text(_subtitle(d))}</p>\n'
        + card(d)
        + f"<nav>{links}</nav>\n"
        + "".join(section(name, content, anchor) for anchor, name, content in there)
        + "<footer>Written by padbench. Units: mm, N, s. Errors are rms of a free-running simulation over the measured "
        "motion. How the numbers are defined: docs/diagnosis.md.</footer>"
    )
    return markup.page(heading, body)


def _subtitle(d: Diagnosis) -> str:
    if d.time_s.size == 0:
        return ""
    return f"{d.time_s.size} force samples over {markup.digits(float(d.time_s[-1] - d.time_s[0]), 3)} s"


def card(d: Diagnosis, heading: str = "", *, notes: bool = True, remark: str = "") -> str:
    """The verdict in words, with the numbers to see first; without the notes on the data where they stand elsewhere.

    `remark`: a sentence under the numbers.
    """
    tone = "fair" if d.verdict == "unexplained" and d.causes else TONES.get(d.verdict, "plain")
    said = [f"First of all: {sentence}" for sentence in d.in_question]
    said += [_sentence(d.as_given)] if d.as_given else []
    said += [_sentence(cause.explanation) for cause in d.causes]
    said.append(" ".join(_sentence(words_) for words_ in words.remains(d)) if d.verdict != "consistent" else "")
    said += [_sentence(sentence) for sentence in words.warnings(d)]
    said += [_sentence(sentence)] if (sentence := words.not_known(d)) else []
    paragraphs = "".join(f"<p>{markup.text(sentence)}</p>" for sentence in said if sentence)
    before = "error on held-out data, before" if d.causes else "error on held-out data"
    tiles = [(before, force(d.held_out_before))]
    if d.causes:
        tiles.append(("after", force(d.held_out_after)))
    tiles.append(("noise floor", force(d.noise_floor)))
    if d.causes:
        done = "explained" if d.verdict == "explained" else "taken"
        tiles.append((f"of the error {done}", words.percent(max(1.0 - d.left, 0.0))))
    if d.flagged_fraction > 0:
        tiles.append(("of the samples flagged", words.percent(d.flagged_fraction)))
    top = heading or words.verdict(d)
    heard = markup.bullets(d.notes, "warn") if notes else ""
    return (
        f'<section class="verdict {tone}"><h2>{markup.text(top)}</h2>{paragraphs}{markup.tiles(tiles)}'
        f"{f'<p>{markup.text(remark)}</p>' if remark else ''}{heard}"
        "</section>\n"
    )


def _sentence(plain: str) -> str:
    return f"{plain[:1].upper()}{plain[1:]}{'' if plain.endswith(('.', '?')) else '.'}"


def sections(d: Diagnosis, *, short: bool = False) -> list[tuple[str, str, str]]:
    """(anchor, heading, HTML) of each part; `short`: what the page of a run shows."""
    found = [("causes", "Causes", _causes(d)), ("residuals", "What the model leaves", _residuals(d))]
    if short:
        return found
    return [
        *found,
        ("held-out", "Error on data held out", _held_out(d)),
        ("candidates", "Candidates", _candidates(d)),
        ("remains", "What remains", _remains(d)),
        ("next-test", "Next test", _next_test(d)),
        ("extended", "The extended model", _extended(d)),
    ]


def _causes(d: Diagnosis) -> str:
    if not d.causes:
        return ""
    head = ["cause", "numbers", "of the error", "how sure", "what else it could be"]
    rows = []
    for cause in d.causes:
        rows.append(
            (
                f"{words.name_of(cause.id)} ({cause.form})",
                _numbers(cause),
                words.percent(cause.gain),
                words.sure(cause).removesuffix(" sure"),
                "; ".join(filter(None, (words.rivals(cause) or "nothing near", words.no_surer(cause)))),
            )
        )
    said = "<p>Shares are of the error beyond the noise, on data held out, in the order listed.</p>"
    checks = [f"{words.name_of(cause.id)}: {cause.check}" for cause in d.causes if cause.check]
    check = f"<h3>Check on the bench</h3>{markup.bullets(checks)}" if checks else ""
    return f'<div class="causes">{table(head, rows, numeric=(2, 3))}</div>{said}{check}'


def _numbers(cause: CauseFound) -> str:
    lines = []
    for name, n in cause.parameters.items():
        value, doubt = measured(n.value, n.std)
        unit = "" if n.unit in ("1", "") else f" {n.unit.replace('*', '·')}"
        lines.append(f"{name} = {value}{f' ± {doubt}' if math.isfinite(n.std) else ''}{unit}")
    lines += [said] if (said := words.untold(cause)) else []
    return "\n".join(lines)


def _residuals(d: Diagnosis) -> str:
    if d.time_s.size < 2:
        return ""
    said = (
        "Measured minus simulated: above with the model believed, its numbers refitted; below with the causes named "
        "and all numbers refitted together. Each on its own scale; the band is what noise alone makes."
    )
    if not d.causes:
        said = (
            "Measured minus simulated, with the model believed, its numbers refitted. The band is what noise alone "
            "makes."
        )
    body = figure(plots.residuals(d), said)
    chosen = best_view(d)
    if chosen is not None:
        share = words.percent(chosen.share)
        residual = "the residual before" if d.causes else "the residual"
        what = "the cause best" if d.causes else "most"
        said = f"Of all views tried this one shows {what}: means take {share} of {residual}."
        if chosen.name == "frequency":
            said = f"The line takes {share} of {residual}."
        svg = plots.view(chosen, named=bool(d.causes))
        body += f"<h3>By {markup.text(chosen.name)}</h3>" + figure(svg, f"{said} {chosen.said}")
    return body


def _held_out(d: Diagnosis) -> str:
    if not (math.isfinite(d.held_out_before) and math.isfinite(d.held_out_after)):
        return ""
    said = "Every stretch of the data as predicted by numbers that were not fitted to it."
    if d.causes:
        said += " Flagged samples count before, and are left out after."
    return figure(plots.held_out(d), said)


def _candidates(d: Diagnosis) -> str:
    svg = plots.candidates(d)
    if not svg:
        return f"<p>{markup.text('No cause alone takes more of what the believed model leaves than chance would.')}</p>"
    said = (
        "What each cause alone, refitted together with the pad, takes of the gain of the best. Blue: named above; "
        "orange: not excluded in its place. Faults of the channel (stray, stuck, saturated samples, hum) are found "
        "in the samples themselves and are not in this list."
    )
    return figure(svg, said)


def _remains(d: Diagnosis) -> str:
    if not d.remainders:
        return ""
    told = [r for r in d.remainders if r.passed]
    rows = [(r.name, f"What is left {r.sentence}", words.percent(r.share), chance(r.p_value)) for r in told]
    found = f"{len(told)} found some" if told else "none found any"
    made = f"{len(d.remainders)} tests looked for structure in what is left; {found}."
    body = f"<p>{markup.text(made)}</p>"
    return body + table(["test", "finding", "of its power", "chance"], rows, numeric=(2, 3))


def chance(p_value: float) -> str:
    """A probability for reading: what is hardly more than none is not said to be none."""
    return f"{p_value:.1g}" if p_value >= RAREST else f"< {RAREST:g}"


def _next_test(d: Diagnosis) -> str:
    if d.next_protocol is None:
        return ""
    said = markup.text(str(d.next_protocol.get("description", "")))
    return f"<p>{said}</p>" + folded("The protocol", _yaml(d.next_protocol))


def _extended(d: Diagnosis) -> str:
    said = "<p>What was believed, refitted and extended: what <code>--write</code> stores.</p>"
    return said + folded("The model file", _yaml(d.model_dict)) if d.model_dict else ""


def _yaml(content: object) -> str:
    return f"<pre>{markup.text(yaml.safe_dump(_plain(content), sort_keys=False, allow_unicode=True, width=110))}</pre>"


def _plain(value: object) -> object:
    """Numbers of numpy as numbers, and to seven digits, for reading."""
    if isinstance(value, dict):
        return {key: _plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    if isinstance(value, np.generic):
        value = value.item()
    return float(f"{value:.7g}") if isinstance(value, float) else value
