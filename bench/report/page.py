"""The page of one run: a self-contained HTML file that reads without a network, without script, and on paper."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

from bench.diagnose import words
from bench.diagnose.result import Diagnosis
from bench.recording.types import Event, Recording
from bench.report import axes, curves, facts, markup, numbers, plots, scheme, verdict
from bench.report import diagnosis as diagnosis_page
from bench.report.markup import digits, figure, forces, section
from bench.report.verdict import Verdict
from bench.report.view import Curve, Evidence, FitView, Plan, PlanView

__all__ = ["Curve", "Evidence", "FitView", "Plan", "PlanView", "report_page", "write_report"]


def write_report(
    path: Path,
    recording: Recording,
    fit: FitView | None,
    *,
    plan: Plan | None = None,
    title: str | None = None,
    fit_problem: str = "",
    host: Mapping[str, str] | None = None,
    diagnosis: Diagnosis | None = None,
    diagnosis_problem: str = "",
) -> None:
    """Write the report of a run to `path`.

    `fit` is None where nothing was fitted, and `fit_problem` then says why; likewise `diagnosis`. `plan` is on the
    recording's clock, in the pad frame. `host` is the recording's `padbench.host` record, for date and versions. The
    same input gives the same bytes. Files of the run folder are linked where they lie beside `path` already, so write
    them first. Raises OSError where the file cannot be written.
    """
    text = report_page(
        recording,
        fit,
        plan=plan,
        title=title,
        fit_problem=fit_problem,
        host=host,
        beside=facts.beside(path),
        diagnosis=diagnosis,
        diagnosis_problem=diagnosis_problem,
    )
    path.write_text(text, encoding="utf-8")


def report_page(
    recording: Recording,
    fit: FitView | None,
    *,
    plan: Plan | None = None,
    title: str | None = None,
    fit_problem: str = "",
    host: Mapping[str, str] | None = None,
    beside: str = "",
    diagnosis: Diagnosis | None = None,
    diagnosis_problem: str = "",
) -> str:
    """The report as HTML text (see `write_report`); `beside` is HTML already."""
    heading = title or _title(recording)
    events = axes.marked_events(recording.events)
    sections = [
        ("run", "What the run was", facts.was(recording, host)),
        ("trajectory", "Trajectory", _trajectory(recording, plan, events)),
        ("force", "Force", _force(recording, fit, plan, events)),
        ("indentation", "Force against indentation", _indentation(recording, fit)),
        ("corner", "The fastest ramp, enlarged", _corner(recording, fit)),
        ("model", "Model", _model(fit)),
        ("method", "Method", scheme.section(fit)),
        *(diagnosis_page.sections(diagnosis, short=True) if diagnosis is not None else []),
        ("structures", "Structures tried", numbers.evidence(fit.evidence) if fit else ""),
        ("touch-off", "Tare and touch-off", facts.touch_off(recording)),
        ("sampling", "Sampling", facts.rates(recording)),
        ("traffic", "Traffic and counters", facts.traffic(recording)),
        ("files", "Files beside this page", beside),
    ]
    there = [(anchor, name, body) for anchor, name, body in sections if body]
    links = " ".join(f'<a href="#{anchor}">{markup.text(name)}</a>' for anchor, name, _ in there)
    body = (
        f'<h1>{markup.text(heading)}</h1>\n<p class="sub">{markup.text(_subtitle(recording, host))}</p>\n'
        + _verdicts(recording, fit, fit_problem)
        + _diagnosed(diagnosis, diagnosis_problem, fit)
        + f"<nav>{links}</nav>\n"
        + "".join(section(name, content, anchor) for anchor, name, content in there)
        + "<footer>Written by padbench. Units: mm, N, s. Depth grows into the pad, force is positive in compression."
        "</footer>"
    )
    return markup.page(heading, body)


def _title(recording: Recording) -> str:
    if not recording.run:
        return recording.source.name or "Recording"
    named = (recording.run.get("protocol", ""), facts.sample_name(recording))
    return " · ".join(part for part in named if part) or recording.source.name or "Run"


def _subtitle(recording: Recording, host: Mapping[str, str] | None) -> str:
    low, high = axes.time_span(recording)
    kind = "simulated bench" if facts.is_simulated(recording) else ""
    return " · ".join(x for x in (facts.started(recording, host), kind, f"{digits(high - low, 3)} s recorded") if x)


def _verdicts(recording: Recording, fit: FitView | None, problem: str) -> str:
    of_run = verdict.run_verdict(recording)
    of_fit = verdict.fit_verdict(fit, problem)
    body = _card(of_run, "") if of_run else ""
    notes = [*recording.notes, *(fit.notes if fit is not None else ())]
    notes = list(dict.fromkeys(notes))  # a fit repeats what it heard on reading
    extra = (_tiles(fit) if fit is not None else "") + markup.bullets(notes, "warn")
    return body + _card(of_fit, extra)


APART = (
    "These figures and those of the fit differ: the fit takes positions as they were reported, the diagnosis the "
    "motion as the pad felt it, so that less of the positions' noise is in its floor and its errors; and each holds "
    "out blocks of its own, which matters most where a run is short."
)


def _diagnosed(diagnosis: Diagnosis | None, problem: str, fit: FitView | None) -> str:
    if diagnosis is not None:
        heading = f"Diagnosis: {words.lowered(words.verdict(diagnosis))}"
        return diagnosis_page.card(diagnosis, heading, notes=False, remark=APART if _differ(diagnosis, fit) else "")
    return _card(Verdict("plain", "No diagnosis was made", [problem]), "") if problem else ""


def _differ(diagnosis: Diagnosis, fit: FitView | None) -> bool:
    """Whether a reader sees two figures of one name."""
    if fit is None:
        return False
    pairs = ((diagnosis.noise_floor, "noise_floor"), (diagnosis.held_out_before, "held_out_rmse"))
    return any(forces(value) != forces(fit.number(key)) for value, key in pairs if math.isfinite(fit.number(key)))


def _card(said: Verdict, extra: str) -> str:
    paragraphs = "".join(f"<p>{markup.text(sentence)}</p>" for sentence in said.sentences if sentence)
    return f'<section class="verdict {said.tone}"><h2>{markup.text(said.headline)}</h2>{paragraphs}{extra}</section>\n'


def _tiles(fit: FitView) -> str:
    rmse, floor, held = forces(fit.number("rmse"), fit.number("noise_floor"), fit.number("held_out_rmse"))
    percent = fit.number("fit_percent")
    shown = [
        ("elastic law", str(fit.json.get("law", "–"))),
        ("relaxation modes", str(fit.json.get("order", "–"))),
        ("fit", f"{percent:.2f} %" if math.isfinite(percent) else "–"),
        ("error, rms", rmse),
        ("noise floor, rms", floor),
    ]
    if held != "–":
        shown.append(("error on held-out data", held))
    return markup.tiles(shown)


def _trajectory(recording: Recording, plan: Plan | None, events: list[tuple[int, Event]]) -> str:
    if recording.motor.time_s.size == 0:
        return "<p>The recording holds no position.</p>"
    said = "Commanded and measured position; phases are tinted, every other step too, and numbers mark events."
    body = figure(plots.trajectory(recording, plan, events), said)
    body += markup.folded(f"Events ({len(recording.events)})", facts.event_table(recording, events))
    return body + markup.folded(f"Steps ({len(recording.steps)})", facts.steps_table(recording.steps))


def _force(recording: Recording, fit: FitView | None, plan: Plan | None, events: list[tuple[int, Event]]) -> str:
    if recording.load_cell.time_s.size == 0:
        return "<p>The recording holds no force.</p>"
    said = "Net force of the load cell, positive in compression."
    if fit is not None:
        said = (
            "Above: force measured and simulated, the simulation driven by the measured motion alone. Below: measured "
            "minus simulated. Where it leaves the band of the noise, the model leaves something unexplained. What came "
            "before the first step is history: simulated, not fitted."
        )
    return figure(plots.force(recording, fit, plan, events), said)


def _indentation(recording: Recording, fit: FitView | None) -> str:
    svg = curves.indentation(recording, fit)
    said = (
        "The area of a loop is energy that the pad took. Loops that lie on one another say that the pad did not change."
    )
    return figure(svg, said) if svg else ""


def _corner(recording: Recording, fit: FitView | None) -> str:
    svg = plots.corner(recording, fit)
    said = "Tinted: the ramp. An error of time between the two channels, or of the servo, shows here first."
    return figure(svg, said) if svg else ""


def _model(fit: FitView | None) -> str:
    if fit is None:
        return ""
    pair = ""
    if fit.elastic is not None:
        pair += figure(curves.elastic([("", fit.elastic)]), "Force before any relaxation.", wide=False)
    if fit.relaxation is not None:
        said = "Share of the force that is left so long after a step."
        pair += figure(curves.relaxation([("", fit.relaxation)]), said, wide=False)
    both = f'<div class="pair">{pair}</div>\n' if pair else ""
    return numbers.parameters(fit) + both + markup.folded("All figures of the fit", numbers.merit(fit))
