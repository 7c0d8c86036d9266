"""What is made of a recording: fit, diagnosis, files, report. Used after every run, and by `padbench report`."""

from __future__ import annotations

import json
import math
import shlex
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bench import identify
from bench.diagnose import diagnose
from bench.diagnose.next_test import design, write_protocol
from bench.diagnose.words import lines as diagnosis_lines
from bench.errors import InputError, PadbenchError
from bench.fitview import fit_view
from bench.given import bench_in, described_in, model_in, prediction_in
from bench.modelfile import write_model
from bench.recording import Recording, read_recording
from bench.recording.schemas import NO_SURFACE
from bench.report import Plan as PlannedCurve
from bench.report import write_report
from bench.run.folder import FIT, REPORT
from bench.shipped import MODEL
from sim.effects.reading import force
from sim.model import Model

if TYPE_CHECKING:
    from bench.diagnose import Diagnosis
    from bench.identify import FitResult
    from bench.predict import Prediction
    from bench.recording.types import Measurement


DIAGNOSIS = "diagnosis.json"

NEXT = "next_test.yaml"
"""The protocol that tells apart what a run left in doubt, where there is one."""

WRONG = 1.5
"""Times the noise, beyond which a fit's error is said to be no noise."""

NO_PAD = {"pad": {"elastic": {"law": "none"}}}
"""The model of a bench in free air."""


@dataclass(frozen=True)
class Results:
    """The files beside a recording; `fit` is None where there is none, and `problem` says why; likewise `diagnosis`."""

    folder: Path
    fit: FitResult | None
    problem: str
    report: Path
    diagnosis: Diagnosis | None = None
    diagnosis_problem: str = ""

    def lines(self) -> list[str]:
        """A few lines for a terminal."""
        lines = [f"no fit: {self.problem}"] if self.problem else []
        if self.fit is not None:
            lines = fit_lines(self.fit)
        if self.diagnosis is not None:
            next_test = shlex.quote(str(self.folder / NEXT))
            how_next = f"`padbench run {next_test}`, with the same --bench and --pad"
            first, *others = diagnosis_lines(self.diagnosis, how_next)
            return [*lines, f"diagnosis: {first}", *others]
        return [*lines, f"no diagnosis: {self.diagnosis_problem}"] if self.diagnosis_problem else lines


def analyse(
    folder: Path,
    *,
    prediction: Prediction | None = None,
    believed: Model | None = None,
    structure: Mapping[str, Any] | None = None,
    progress: Callable[[str], None] | None = None,
) -> Results:
    """Fit and diagnose the recording of a run folder; write model.yaml, fit.json, diagnosis.json and report.html.

    `structure`: `law`, `order`, `contact`, `degree` of the fit, where they are not to be found out (as `identify.fit`).
    Diagnosed is what was believed, or else the fit; a run in air tells of the bench alone. `believed` and `prediction`
    are the recording's own where they are not given. What cannot be fitted (an air run, a run stopped before the pad)
    is said in the report, and so is what cannot be diagnosed. Raises `InputError` where the recording cannot
    be read, `OSError` with a file's or the folder's name where what is found cannot be written.
    """
    try:
        return _analysed(folder, prediction, believed, structure or {}, progress or (lambda _: None))
    except OSError as error:
        if error.filename is None and error.errno is not None:  # a write that found no room names no file
            raise OSError(error.errno, error.strerror, str(folder)) from error
        raise


def _analysed(
    folder: Path,
    prediction: Prediction | None,
    believed: Model | None,
    structure: Mapping[str, Any],
    tell: Callable[[str], None],
) -> Results:
    recording = read_recording(folder)
    believed = believed or model_in(recording)
    prediction = prediction or prediction_in(recording, believed)
    fit, problem = _fit_of(recording, structure)
    if fit is not None and believed is not None and believed.effects:
        ids = ", ".join(effect.id for effect in believed.effects)
        fit.notes.append(f"The pad believed in has effects of the bench ({ids}), and this fit of a pad alone has none.")
    if fit is not None:
        (folder / FIT).write_text(json.dumps(fit.to_json(), indent=2) + "\n", "utf-8")
        write_model(folder / MODEL, fit.model)
    diagnosis, unclear = _diagnosis_of(recording, fit, believed, tell)
    if diagnosis is not None:
        text = json.dumps(diagnosis.to_json(), indent=2, allow_nan=False)
        (folder / DIAGNOSIS).write_text(text + "\n", "utf-8")
        (folder / NEXT).unlink(missing_ok=True)
        if diagnosis.next_protocol is not None:
            write_protocol(folder / NEXT, diagnosis.next_protocol)
    report = folder / REPORT
    tell("writing the report")
    write_report(
        report,
        recording,
        fit_view(fit) if fit is not None else None,
        plan=_planned(recording, prediction),
        fit_problem=problem,
        host=recording.host,
        diagnosis=diagnosis,
        diagnosis_problem=unclear,
    )
    return Results(folder, fit, problem, report, diagnosis, unclear)


def lacking(fit: FitResult) -> bool:
    """Whether a fit leaves more than can be noise."""
    return fit.rmse > WRONG * fit.noise_floor > 0


def fit_lines(fit: FitResult) -> list[str]:
    """The fit in a few lines: structure, error beside noise, parameters with standard errors."""
    size = f" of degree {fit.degree}" if fit.degree else ""
    held = f", {force(fit.held_out_rmse)} on data held out" if math.isfinite(fit.held_out_rmse) else ""
    lines = [
        f"fit: {fit.law} law{size}, {fit.order} relaxation mode{'s' if fit.order > 1 else ''}, {fit.contact} contact",
        f"  error {force(fit.rmse)} (noise of the data {force(fit.noise_floor)}){held}; "
        f"{fit.fit_percent:.2f} % of the force explained",
    ]
    width = max(len(name) for name in fit.parameters)
    for name, parameter in fit.parameters.items():
        doubt = f" ± {parameter.std:.2g}" if math.isfinite(parameter.std) else ""
        verdict = "   undetermined by these data" if name in fit.undetermined else ""
        unit = f" {parameter.unit}" if parameter.unit != "1" else ""
        lines.append(f"  {name:<{width}} = {parameter.value:.5g}{doubt}{unit}{verdict}")
    if (rest := fit.c_0) is not None:
        doubt = f" ± {rest.std:.2g}" if math.isfinite(rest.std) else ""
        lines.append(f"  {'c_0':<{width}} = {rest.value:.5g}{doubt}, what never relaxes: 1 − Σ c_i")
    if lacking(fit):
        lines.append(
            f"  the model leaves {fit.rmse / fit.noise_floor:.2g} times the noise: it lacks something, and its numbers "
            "make up for that; their ± hold for the best such model and not for the pad"
        )
    lines += [f"  note: {note}" for note in fit.notes]
    return lines


def is_air_run(recording: Recording) -> bool:
    """Whether there was no pad, by the protocol (`approach: none`)."""
    return any(event.name == NO_SURFACE for event in recording.events)


def _fit_of(recording: Recording, structure: Mapping[str, Any]) -> tuple[FitResult | None, str]:
    if is_air_run(recording):
        return None, "there was no pad (air run)"
    if recording.surface_mm is None:
        stopped = recording.result is None or recording.result.get("status") != "done"
        return None, "the run ended before the pad's surface was found" if stopped else "no surface was found"
    try:
        return identify.fit(recording.measurement(), **structure), ""
    except InputError as error:
        return None, error.message


def _diagnosis_of(
    recording: Recording, fit: FitResult | None, believed: Model | None, tell: Callable[[str], None]
) -> tuple[Diagnosis | None, str]:
    """(the diagnosis, or None; why there is none). No failure of it may take away a run and its fit."""
    in_air = is_air_run(recording)
    model = Model.from_dict(NO_PAD) if in_air else believed or (fit.model if fit is not None else None)
    if model is None or (not in_air and recording.surface_mm is None):
        return None, ""  # that nothing was fitted is said already
    try:
        measurement = recording.measurement()
        found = diagnose(measurement, model, lambda what: tell(f"diagnosing: {what}"))
        json.dumps(found.to_json(), allow_nan=False)
    except PadbenchError as error:
        return None, str(error)
    except Exception as error:  # whatever it is: the run is over, and its data and fit are worth more
        return None, f"this is a defect of padbench, not of your run: {type(error).__name__}: {error}"
    tell("designing the next test")
    try:
        found.next_protocol = next_test(found, recording, measurement)
    except Exception as error:  # likewise
        found.notes.append(f"no next test could be designed: {type(error).__name__}: {error}")
    return found, ""


def next_test(found: Diagnosis, recording: Recording, measurement: Measurement) -> dict[str, Any] | None:
    """The protocol that tells rivals apart on the recording's bench, where there are any and it was not that one."""
    return design(found, measurement, bench_in(recording), described_in(recording))


def _planned(recording: Recording, prediction: Prediction | None) -> PlannedCurve | None:
    """The planned motion of the steps and the force expected, laid where the run began them (the recording's clock).

    Where a force ends a ramp, plan and run part in time, and no curve is drawn.
    """
    if prediction is None or any(segment.kind.startswith("force") for segment in prediction.segments):
        return None
    begin = next((mark.time_s for mark in recording.steps if mark.phase in ("precondition", "steps")), None)
    if begin is None:
        return None
    expected = None if np.isnan(prediction.force_N).all() else prediction.force_N
    return PlannedCurve(prediction.time_s + begin, prediction.position_mm, expected)
