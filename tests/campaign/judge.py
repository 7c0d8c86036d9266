"""One case from end to end: drawn, written, read back, diagnosed, compared with the truth; a line of JSON.

The diagnosis is handed what a lab would hand it, a CSV file and a model file, and nothing else.
"""

from __future__ import annotations

import hashlib
import math
import tempfile
import time
import traceback
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from bench.recording.types import Measurement
from sim.model import Model
from tests.truth.beside import seen_beside
from tests.truth.cases import Case, draw_case
from tests.truth.detect import Lab, _sigma, _whitened, freed, misfit, of_the_pad, sampling
from tests.truth.noise import Coloured, Quantised, StudentT, White
from tests.truth.rivals import as_good, as_good_in_place

from .family import HELD_OUT, family_rmse_N
from .plan import CATALOGUE, Item
from .runs_told import told_by_runs

ROOT = Path(__file__).resolve().parents[2]
FLAGS = {"saturated": "saturation", "stuck": "stuck_samples", "outlier": "outliers"}
"""Names of the truth, and of the diagnosis."""

NOISE_KINDS = {White: "white", Coloured: "coloured", Quantised: "quantised", StudentT: "heavy"}

RANKED = 8
"""Candidates for the first cause that a line keeps."""


@cache
def code() -> str:
    """A mark of the code that diagnoses, so that results of several versions are not taken for one."""
    files = sorted(
        path for folder in ("bench/diagnose", "bench/identify", "sim") for path in (ROOT / folder).rglob("*.py")
    )
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()[:8]


def run(item: Item, keep: Path | None = None) -> dict[str, Any]:
    """The line of a case; with `error` where something raised. `keep`: where data and model are left."""
    line: dict[str, Any] = {"key": item.key, "item": item.to_json(), "code": code()}
    try:
        case = item.case()
        line |= truth_of(case)
        if keep is None:
            with tempfile.TemporaryDirectory() as folder:
                line |= diagnosed(case, case.write(folder))
        else:
            line |= diagnosed(case, case.write(keep))
        line["bounds"] = _bounds(item, line)
        line["as_good"] = _as_good(item, case, line)
        line["alike"] = _alike(item, case, line)
    except Exception:
        line["error"] = traceback.format_exc(limit=-4)
    return line


def truth_of(case: Case) -> dict[str, Any]:
    """What was hidden, in what noise, and whether anything of it can be seen."""
    truth = case.truth
    seen = misfit(case)
    n = len(case.force_N)
    alone, beside = {}, {}
    if len(truth.ids) > 1:
        alone = {id: bool(misfit(case.alone(id)).detectable) for id in truth.ids}
        beside = seen_beside(case)
    return {
        "truth": {
            "parameters": truth.parameters,
            "protocol": truth.protocol,
            "rate_hz": truth.rate_hz,
            "samples": n,
            "own_clock": case.force_time_s is not None,
            "law": truth.structure.law.__class__.__name__,
            "contact": truth.structure.contact,
            "modes": len(truth.structure.rates),
            "noise": NOISE_KINDS[type(truth.noise)],
            "noise_N": truth.noise.std,
            "position_std_mm": truth.position_std_mm,
            "floor_N": truth.noise_floor_N,
            "chi2": seen.chi2,
            "faults": seen.faults,
            "detectable": bool(seen.detectable),
            "misfit_N": seen.rmse_N,
            "of_noise_power": (seen.chi2 + seen.faults) / n,
            "alone": alone,
            "beside": beside,
            "coarse_chi2": sampling(case),
        }
    }


def diagnosed(case: Case, folder: Path) -> dict[str, Any]:
    """What the diagnosis says of the files in a folder, and its flags held against the truth's."""
    from bench.config import load_model
    from bench.diagnose import diagnose
    from bench.recording import read_recording

    measurement = read_recording(folder / "data.csv").measurement()
    believed = load_model(folder / "believed.yaml")
    wall, cpu = time.perf_counter(), time.process_time()
    result = diagnose(measurement, believed)
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    said = result.to_json()
    flags = said.pop("flags", {})
    said.pop("next_protocol", None)
    ranking = [
        {"id": a.id, "form": a.form, "gain_share": a.gain_share, "delta_chi2": a.delta_chi2}
        for a in list(getattr(result, "ranking", []))[:RANKED]
    ]
    flagged = score_flags(case, measurement.force_time_s, flags)
    line = {"said": said, "ranking": ranking, "flags": flagged, "seconds": wall, "cpu_seconds": cpu}
    if case.truth.ids and not set(case.truth.ids) & set(CATALOGUE):
        line["clean_rmse_N"] = clean_rmse_N(case, measurement, Model.from_dict(result.model_dict))
    if len(case.truth.ids) == 1 and result.held_out_after > HELD_OUT * result.noise_floor:
        model, id = Model.from_dict(result.model_dict), case.truth.ids[0]
        line["family_rmse_N"] = family_rmse_N(measurement, _clean_N(case, measurement), model, id)
    return line


def _clean_N(case: Case, measurement: Measurement) -> np.ndarray:
    return case.truth.clean_N[_rows(case, measurement.force_time_s)]


def clean_rmse_N(case: Case, measurement: Measurement, model: Model) -> float:
    """RMS of what a model is off by from the force without noise, along the motion as it was measured."""
    from bench.like import likeness

    return likeness(model, replace(measurement, force_N=_clean_N(case, measurement))).rmse_N


def _rows(case: Case, force_time_s: np.ndarray) -> np.ndarray:
    """The truth's row of each stamp that the reading of the file kept."""
    stamps = case.time_s if case.force_time_s is None else case.force_time_s
    return np.searchsorted((stamps[1:] + stamps[:-1]) / 2, force_time_s)


def score_flags(case: Case, force_time_s: np.ndarray, flags: dict[str, list[int]]) -> dict[str, list[int]]:
    """By fault (hit, flagged, true) samples, among those that the reading of the file kept; `any` for all at once, and
    `told` for all but those of a channel that sticks which no run of equal values tells."""
    index = _rows(case, force_time_s)
    n, out = len(index), {}
    all_said, all_true, untold = (np.zeros(n, dtype=bool) for _ in range(3))
    for mine, theirs in FLAGS.items():
        true = case.truth.flags.get(mine, np.zeros(len(case.force_N), dtype=bool))[index]
        said = np.zeros(n, dtype=bool)
        said[np.asarray(flags.get(theirs, []), dtype=int)] = True
        all_said, all_true = all_said | said, all_true | true
        if mine == "stuck":
            untold = true & ~told_by_runs(case.force_N[index], true)
        if said.any() or true.any():
            out[theirs] = [int((said & true).sum()), int(said.sum()), int(true.sum())]
    for name, there in (("any", np.ones(n, dtype=bool)), ("told", ~untold)):
        said, true = all_said & there, all_true & there
        out[name] = [int((said & true).sum()), int(said.sum()), int(true.sum())]
    return out


def named(line: dict[str, Any], id: str) -> dict[str, Any] | None:
    """The cause of that id, if it was named."""
    return next((cause for cause in line["said"]["causes"] if cause["id"] == id), None)


def listed(cause: dict[str, Any], id: str) -> bool:
    """Whether an id is said not to be excluded in a cause's place."""
    return any(a["id"] == id and not a.get("excluded") for a in cause["alternatives"])


def _alike(item: Item, case: Case, line: dict[str, Any]) -> dict[str, str]:
    """Of a pair, by hidden id that is not named: the one named instead that lists it and fits as well in its place."""
    causes = line["said"]["causes"]
    missed = [id for id in item.ids if named(line, id) is None]
    wrong = [c for c in causes if c["id"] not in item.ids]
    if item.group != "pair" or not all(line["truth"]["alone"].values()):
        return {}
    tried = ((id, c["id"]) for id in missed for c in wrong if listed(c, id))
    return {id: rival for id, rival in tried if as_good_in_place(case, rival, id)}


def _as_good(item: Item, case: Case, line: dict[str, Any]) -> bool:
    """Where another id than the lone hidden one was named first: whether it fits the data without noise as well."""
    first = next((cause["id"] for cause in line["said"]["causes"]), None)
    if item.group not in ("single", "large") or first in (None, item.ids[0]) or not line["truth"]["detectable"]:
        return False
    return as_good(case, str(first))


def _bounds(item: Item, line: dict[str, Any]) -> dict[str, float]:
    """Cramér–Rao bounds of the parameters of a lone effect, where a stated deviation is over a quarter of the value."""
    if item.group not in ("single", "large"):
        return {}
    cause, truth = named(line, item.ids[0]), line["truth"]["parameters"][item.ids[0]]
    if cause is None:
        return {}
    wide = [
        name
        for name, value in truth.items()
        if isinstance(value, float) and (cause["parameters"].get(name, {}).get("std") or 0.0) > abs(value) / 4
    ]
    return bounds(item, wide) if wide else {}


def bounds(item: Item, names: list[str]) -> dict[str, float]:
    """Smallest standard deviations of parameters that go with the size, the pad's numbers being unknown too.

    With s = ∂F/∂(size) of the clean force, weighed by the noise and freed of what the pad's numbers can do,
    std(size) ≥ 1/‖s‖, and a parameter's by how much it goes with the size. Random draws are held.
    """
    case = item.case()
    truth, size = case.truth, item.sizes[0]
    h = 0.02 * size
    above, below = (
        draw_case(
            item.seed,
            item.ids,
            size + sign * h,
            item.shapes[0],
            **truth.overrides,
            drawn=truth.drawn,
            motion=truth.motion,
        ).truth
        for sign in (1, -1)
    )
    lab = Lab(truth)
    scale = truth.noise.std / _sigma(truth, lab)

    def weighed(force: np.ndarray) -> np.ndarray:
        return _whitened(truth.noise, truth.label_time_s, force * scale)

    own = weighed((above.clean_N - below.clean_N) / (2 * h))
    free = freed(own, of_the_pad(truth, lab, weighed))
    norm = float(np.linalg.norm(free))
    id, out = item.ids[0], {}
    for name in names:
        slope = (above.parameters[id][name] - below.parameters[id][name]) / (2 * h)
        out[name] = abs(slope) / norm if norm > 0 else math.inf
    return out
