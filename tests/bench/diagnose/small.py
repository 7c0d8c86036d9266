"""One small hidden cause, diagnosed once for several tests, and a diagnosis made by hand."""

from __future__ import annotations

import functools
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from bench.diagnose import Diagnosis, diagnose
from bench.diagnose.channel import faults, not_of_the_motion
from bench.diagnose.data import Prepared, prepare
from bench.diagnose.diagnose import believed_structure
from bench.diagnose.numbers import cause_of
from bench.diagnose.refit import Fit, onto, refit
from bench.diagnose.result import Alternative, CauseFound, Number, Remainder
from bench.diagnose.search import Search
from bench.protocol import Protocol
from bench.recording.types import Measurement
from sim.effects import effect
from sim.model import Model
from tests.truth.cases import Case, draw_case
from tests.truth.motion import Motion, staircase

PAD: dict[str, Any] = {
    "elastic": {"law": "exponential", "m": 2.0, "b": 0.5},
    "relaxation": {"shares": [0.2], "rates": [2.0]},
    "contact": "unilateral",
}


def case(id: str, seed: int = 1, **told: Any) -> Case:
    """An effect at its typical size, slowly sampled, so that it is soon diagnosed."""
    return draw_case(seed, (id,), 1.0, **({"protocol": "staircase", "rate_hz": 150.0} | told))


def measurement(c: Case) -> Measurement:
    """What the lab has, without a file between."""
    stamps = c.time_s if c.force_time_s is None else c.force_time_s
    where, felt = np.isfinite(c.position_mm), np.isfinite(c.force_N)
    return Measurement("case", c.time_s[where], c.position_mm[where], stamps[felt], c.force_N[felt])


def begun(c: Case) -> tuple[Search, Fit]:
    """A search, and the believed structure refitted."""
    m = measurement(c)
    p = prepare(m, not_of_the_motion(m, faults(m.force_N)).good)
    structure = believed_structure(Model.from_dict(c.believed), p)
    search = Search(p, structure, lambda _: None)
    return search, search.base([structure.pad.x()])


@functools.cache
def diagnosed(id: str) -> tuple[Case, Diagnosis]:
    """A case and its diagnosis, made once."""
    c = case(id)
    return c, diagnose(measurement(c), Model.from_dict(c.believed))


@functools.cache
def fitted(id: str, shape: str, form: str, size: float = 1.0, seed: int = 1, **told: Any) -> tuple[Case, Prepared, Fit]:
    """A hidden effect, and the fit of one form of it, from the true numbers."""
    c = draw_case(seed, (id,), size, shape, **({"protocol": "rich", "rate_hz": 120.0, "jitter": "none"} | told))
    m = measurement(c)
    p = prepare(m, not_of_the_motion(m, faults(m.force_N)).good)
    structure = believed_structure(Model.from_dict(c.believed), p)
    cause = cause_of(effect(id), effect(id).form(form), c.truth.parameters[id])
    joined = structure.with_cause(cause)
    fit = refit(p.short, joined, joined.x(structure.pad.x()), 60, 1e-9)
    return c, p, onto(fit, p.full)


def motion_of(content: dict[str, Any]) -> Motion:
    """A protocol's steps and its finish as a motion of the independent simulator."""
    steps = [flat.step for flat in Protocol.model_validate(content).flatten()]
    levels = [*(s.to for s in steps), -0.5]
    speeds, holds = [*(s.speed for s in steps), 5.0], [*(s.hold for s in steps), 5.0]
    return staircase(levels, speeds, holds, start_mm=-0.5, acceleration_mm_s2=3000.0, lead_s=1.0)


def made_up(**changes: Any) -> Diagnosis:
    """A diagnosis of friction with a rival, by hand: what words and pages make of it is known beforehand."""
    rng = np.random.default_rng(0)
    time = np.arange(0.0, 20.0, 0.01)
    position = np.interp(time % 4.0, [0.0, 2.5, 4.0], [-0.3, 1.7, -0.3])
    speed = np.where(time % 4.0 < 2.5, 1.0, -1.0)
    noise = 0.01 * rng.standard_normal(time.size)
    clean = np.maximum(position, 0.0)
    rival = Alternative("backlash", "play", 0.97, 12.0, False)
    cause = CauseFound(
        "friction", "coulomb", {"coulomb": Number(0.05, "N", 0.004)}, 0.93, 0.8, [rival],
        "friction of 0.05 N acts against the motion, either way", "grease the guide",
    )  # fmt: skip
    flags = np.zeros(time.size, dtype=bool)
    flags[[100, 700]] = True
    told = Diagnosis(
        verdict="explained", causes=[cause], left=0.07, noise_floor=0.01, rmse_before=0.051, rmse_after=0.0104,
        held_out_before=0.052, held_out_after=0.0168, flagged_fraction=0.001, seconds=1.0,
        model_dict={"pad": PAD, "effects": [{"id": "friction", "coulomb": 0.05}]},
        notes=["a <note> & more"],
        remainders=[Remainder("speed", 1e-5, 0.03, "goes with the speed", True),
                    Remainder("time", 0.4, 0.0, "changes in the course of the run", False)],
        name="<made & up>", time_s=time, position_mm=position, force_N=clean + 0.05 * speed + noise,
        before_N=clean, after_N=clean + 0.05 * speed, sigma_N=np.full(time.size, 0.01),
        flags={"outliers": flags, "saturation": np.zeros_like(flags)}, counted=~flags,
        ranking=[Alternative("friction", "coulomb", 1.0, 0.0, False), rival,
                 replace(rival, id="cogging", gain_share=0.3)],
        rivals=[("friction", {"pad": PAD, "effects": [{"id": "friction", "coulomb": 0.05}]}),
                ("backlash", {"pad": PAD, "effects": [{"id": "backlash", "gap": 0.03}]})],
    )  # fmt: skip
    return replace(told, **changes)


def written(folder: Path, c: Case) -> tuple[Path, Path]:
    """(data, believed model) as files."""
    c.write(folder)
    return folder / "data.csv", folder / "believed.yaml"
