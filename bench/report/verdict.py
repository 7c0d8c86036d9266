"""The first lines of the page, in plain words: did the run end well, and how good is the model?"""

from __future__ import annotations

import contextlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from bench.recording.types import Recording
from bench.report.markup import digits, forces
from bench.report.view import FitView

LAWS = {
    "exponential": ("exponential", "Fᵉ = (m/b)·(e^(b·δ) − 1)"),
    "power": ("power", "Fᵉ = p/(q+1)·δ^(q+1)"),
    "polynomial": ("polynomial", "Fᵉ = Σ αᵢ·δⁱ"),
    "spline": ("spline", "Fᵉ: a smooth curve through points"),
    "none": ("no", "Fᵉ = 0: free air"),
}

DOWN_TO = 1.05
"""Times the noise: with more, a tenth of the power is something else, which a diagnosis may well name."""

HALF = 50.0
"""Per cent of the force that a fit must follow to be called a good one, however loud the noise."""

FINISHED = frozenset({"finished", "done", "complete", "completed", "ok", "success"})
_STOPS = ("limit", "overload", "fault", "stopped", "interrupted", "error", "aborted", "stop")


@dataclass(frozen=True)
class Outcome:
    """How a recording ended. `kind`: finished, stopped, unfinished, or data (a file that is no run of ours)."""

    kind: str
    cause: str = ""

    @property
    def sound(self) -> bool:
        """Whether it ended as it should."""
        return self.kind in ("finished", "data") and not self.cause


@dataclass(frozen=True)
class Verdict:
    """A headline with a tone (good, fair, bad, plain) and the sentences under it."""

    tone: str
    headline: str
    sentences: list[str]


def outcome(recording: Recording) -> Outcome:
    """How the run ended, with its first cause where it did not end well."""
    result = recording.result
    lost = recording.lost or ""
    if result is None:
        if not recording.run and not recording.steps:
            return Outcome("data", lost)
        return Outcome("unfinished", first_cause(recording) or lost or "the recording ends before the run did")
    status = _given(result, "status", "outcome", "state").lower()
    cause = _given(result, "cause", "first_cause", "reason", "error")
    if status in FINISHED or (not status and not cause):
        return Outcome("finished", lost)
    return Outcome("stopped", cause or first_cause(recording) or status)


def first_cause(recording: Recording) -> str:
    """The earliest event that stops a run, in words; empty where there is none."""
    for event in sorted(recording.events, key=lambda e: e.time_s):
        if event.name in _STOPS or event.name.endswith(("_fault", "_limit", "_lost")):
            said = _given(event.data, "cause", "message", "reason", "what")
            return f"{said or event.name.replace('_', ' ')} (at {event.time_s:.3f} s)"
    return ""


def _given(record: Mapping[str, Any], *names: str) -> str:
    """The first of these entries that is there, without the quotes of JSON text."""
    for name in names:
        value = str(record.get(name) or "").strip()
        if value.startswith('"'):
            with contextlib.suppress(ValueError):
                value = str(json.loads(value))
        if value and value != "null":
            return value
    return ""


def run_verdict(recording: Recording) -> Verdict | None:
    """What to say of the run itself; None where it ended as it should."""
    ended = outcome(recording)
    if ended.sound:
        return None
    if ended.kind == "stopped":
        said = [f"First cause: {ended.cause}."]
        if unsafe := _given(recording.result or {}, "not_safe"):
            said.append(f"The motor's safe state could not be confirmed: {unsafe}.")
        return Verdict("bad", "The run was stopped before its protocol ended", said)
    if ended.kind == "unfinished":
        said = [f"First cause: {ended.cause}.", "The recording has no closing record: what follows is what was saved."]
        if recording.lost and recording.lost not in ended.cause:
            said.append(f"Not readable: {recording.lost}.")
        return Verdict("bad", "The run is unfinished", said)
    return Verdict("bad", "Part of the recording could not be read", [f"{ended.cause}."])


def fit_verdict(fit: FitView | None, problem: str) -> Verdict:
    """What to say of the model."""
    if fit is None:
        return Verdict("plain", "No model was fitted", [_sentence(problem)] if problem else [])
    rmse, floor, percent = fit.number("rmse"), fit.number("noise_floor"), fit.number("fit_percent")
    ratio = rmse / floor if floor > 0 else math.nan
    tone, judgement = judge(fit)
    judgement += f" ({percent:.1f} % fit)" if math.isfinite(percent) else ""
    sentences = [f"{structure(fit, capital=True)}. {_error_beside_noise(rmse, floor, ratio)}"]
    if fit.json.get("converged") is False:
        tone = "bad"
        sentences.append("The fit did not converge: take its numbers as a start, not as a result.")
    if fit.json.get("physical") is False:
        tone = "bad"
        sentences.append(
            "The fitted filter is not a relaxation (complex, unstable or negative parts): it describes these data, "
            "and is no model of a pad."
        )
    if loose := fit.json.get("undetermined"):
        names = ", ".join(str(name) for name in loose)
        sentences.append(f"These data do not determine {names}: another protocol is needed for that.")
        tone = "fair" if tone == "good" else tone
    return Verdict(tone, judgement, sentences)


def _sentence(words: str) -> str:
    return words[:1].upper() + words[1:] + ("" if words.endswith((".", "!", "?")) else ".")


def judge(fit: FitView) -> tuple[str, str]:
    """The model in one sentence, with its tone: by its error against the noise, and by the share it follows."""
    rmse, floor, percent = fit.number("rmse"), fit.number("noise_floor"), fit.number("fit_percent")
    ratio = rmse / floor if floor > 0 else math.nan
    if not math.isfinite(ratio):
        return "plain", "A model was fitted"
    if ratio <= 2.0 and percent < HALF:
        return "bad", "What was taken for noise is most of the force"
    if ratio <= DOWN_TO:
        return "good", "The model explains the force down to the noise"
    if ratio <= 2.0:
        return "good", "The model is close to the noise"
    many = "several" if ratio < 10 else "many"
    if percent >= 95.0:
        return "fair", f"The model follows the force, and leaves {many} times the noise unexplained"
    return "bad", "The model does not explain these data"


def _error_beside_noise(rmse: float, floor: float, ratio: float) -> str:
    error, noise = forces(rmse, floor)
    if not math.isfinite(rmse):
        return ""
    if not math.isfinite(ratio):
        return f"The simulation is off by {error} rms; the noise of these data is not known."
    return f"The simulation is off by {error} rms, {digits(ratio, 2)} times the noise floor of {noise}."


def structure(fit: FitView, *, capital: bool = False) -> str:
    """The model's structure as a phrase: "exponential elastic law with 2 relaxation modes, unilateral contact"."""
    law = str(fit.json.get("law", "unknown"))
    order = fit.json.get("order")
    modes = "no relaxation" if order == 0 else f"{order} relaxation mode{'' if order == 1 else 's'}"
    contact = fit.json.get("contact")
    phrase = f"{LAWS.get(law, (law, ''))[0]} elastic law with {modes}" + (f", {contact} contact" if contact else "")
    return phrase[:1].upper() + phrase[1:] if capital else phrase
