"""The page of a check: planned depth and expected force, with the limits, before anything moves."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from bench.report import axes as parts
from bench.report import facts, markup
from bench.report.markup import digits, figure, section
from bench.report.style import light
from bench.report.svg import render
from bench.report.verdict import Verdict
from bench.report.view import PlanView


def write_plan(path: Path, plan: PlanView, *, title: str = "Planned run") -> None:
    """Write the page of a checked protocol to `path`. Raises OSError where the file cannot be written."""
    path.write_text(plan_page(plan, title), encoding="utf-8")


def plan_page(plan: PlanView, title: str = "Planned run") -> str:
    """The plan as HTML text."""
    said = verdict_of(plan)
    listed = markup.bullets(plan.problems, "fail") + markup.bullets(plan.notes)
    body = f"<h1>{markup.text(title)}</h1>\n"
    body += f'<section class="verdict {said.tone}"><h2>{markup.text(said.headline)}</h2>'
    body += "".join(f"<p>{markup.text(sentence)}</p>" for sentence in said.sentences) + listed + "</section>\n"
    caption = "Planned depth, and beneath it the force that the believed pad would answer with. Dashed: limits."
    if plan.expected_N is None:
        caption = "Planned depth. No pad model is believed, so no force is expected. Dashed: limits."
    body += section("Plan", figure(trajectory(plan), caption) if plan.time_s.size else "")
    limits = [(name.replace("_", " "), f"{value:.6g} {unit}") for name, (value, unit) in plan.limits.items()]
    body += section("Limits", markup.facts(limits))
    body += section("What is planned", markup.facts(plan.facts.items()))
    body += section("Steps", facts.steps_table(plan.steps))
    return markup.page(title, body + "<footer>Written by padbench. Units: mm, N, s.</footer>")


def verdict_of(plan: PlanView) -> Verdict:
    """May it run, and what are the extremes of the plan?"""
    said = []
    if plan.time_s.size:
        said.append(
            f"It takes {digits(float(plan.time_s[-1] - plan.time_s[0]))} s and goes {_most(plan.position_mm)} mm deep."
        )
    if plan.expected_N is not None and np.isfinite(plan.expected_N).any():
        said.append(f"The expected force reaches {_most(plan.expected_N)} N.")
    if plan.problems:
        return Verdict("bad", "The check refuses this protocol", said)
    return Verdict("good", "The check passes: this protocol may run", said)


def _most(values: np.typing.NDArray[np.float64]) -> str:
    finite = values[np.isfinite(values)]
    return digits(float(finite.max()), 3) if finite.size else "–"


def trajectory(plan: PlanView) -> str:
    """Depth and expected force over time as SVG."""
    expected = plan.expected_N
    heights = [210.0] if expected is None else [190.0, 190.0]

    def draw(figure_: Figure) -> None:
        made = parts.panels(figure_, heights)
        end = float(plan.time_s[-1])
        made[0].set_xlim(float(plan.time_s[0]), end if end > plan.time_s[0] else end + 1.0)
        parts.line(made[0], plan.time_s, plan.position_mm, "commanded", "planned depth", width=1.6)
        made[0].axhline(0.0, color=light("noise"), lw=1.0, ls="--", label="pad surface")
        made[0].set_ylabel("depth, mm")
        _limit(made[0], plan, "depth")
        if expected is not None:
            parts.line(made[1], plan.time_s, expected, "expected", "expected force", width=1.6)
            made[1].set_ylabel("force, N")
            _limit(made[1], plan, "force")
        made[-1].set_xlabel("time, s")
        parts.shade(made, parts.step_spans(plan.steps, end))
        for ax in made:
            parts.legend(ax)

    return render("plan", "Planned depth and expected force over time", parts.WIDE, parts.stacked(heights), draw)


def _limit(ax: Axes, plan: PlanView, name: str) -> None:
    if name in plan.limits:
        value, unit = plan.limits[name]
        ax.axhline(value, color=light("event"), lw=1.4, ls=(0, (6, 3)), label=f"limit {value:.6g} {unit}")
        low, high = ax.get_ylim()
        ax.set_ylim(low, max(high, value + 0.06 * (value - low)))
