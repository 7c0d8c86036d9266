"""The next test: where these data leave two causes standing, the protocol that would tell them apart.

Both models are simulated over short probing blocks. The other model is refitted to what the first one makes, so that
only what a refit could not absorb counts: as χ² at the noise of the data, and as a share of what the cause makes at
all, as a diagnosis judges by both. Blocks are added by what they tell per second.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml

from bench.recording.types import Measurement
from sim.model import EffectEntry, Model

from .data import Data
from .numbers import PadNumbers, Structure, cause_of
from .probing import AIR_mm, Block, Motion, Reach, library, motion, together
from .refit import refit
from .result import Diagnosis
from .words import in_air, in_doubt, name_of

if TYPE_CHECKING:
    from bench.config import Bench

ENOUGH = 200.0
"""Expected Δχ² with which a test is content: far beyond chance, and beyond some error in the shapes …"""
SHARE = 0.06
"""… and the share of the cause's own χ² that the other must be unable to take: no shape is exact."""
WORTH = 0.1
"""Part of both under which no test is proposed."""
DONE = (
    "this run was the test that tells {} from {}, and what it left is no more than their shapes may differ by: the "
    "same again tells no more; look at both on the bench, and take either where that does not matter"
)
LONGEST_S = 150.0
MOST_BLOCKS = 6
FASTEST_Hz = 500.0
"""Samples per second that are simulated at the most."""
SETTLED = 0.01
"""Part of what is worth while under which no other form of the rival need be tried."""
STEPS = 40
STRONGER = 1.5
"""Times the greatest force of the data that a test may expect: a fast way to the same depth is felt more."""
ACCELERATION_mm_s2 = 3000.0
"""Where no bench file says."""
FAST_mm_s = 80.0
"""Speed asked for at the most where the bench allows more than the data have shown."""


@dataclass(frozen=True)
class Rival:
    """Two models that the data leave standing, with the ids of what they differ in."""

    named: str
    other: str
    models: tuple[Model, Model]


def design(d: Diagnosis, measurement: Measurement, bench: Bench | None = None, ran: str = "") -> dict[str, Any] | None:
    """The content of a protocol file that separates the cause named from what is not excluded; None where nothing
    remains to be told apart, or no block would tell it, or this run was that test: which is then one of the doubts.

    `ran`: the description of the protocol that the data were recorded with.
    The test stays within the depth of the data, and within the speed of the data or of the bench file.
    """
    pair = rival_of(d)
    if pair is None:
        return None
    if any(ran.startswith(_tells(*names)) for names in ((pair.named, pair.other), (pair.other, pair.named))):
        d.doubts.append(DONE.format(name_of(pair.named), name_of(pair.other)))
        return None
    reach = _reach(measurement, bench)
    sigma = max(d.noise_floor, 1e-9)
    rate = min(1.0 / float(np.median(np.diff(measurement.force_time_s))), FASTEST_Hz)
    blocks = [b for b in library(reach) if _presses_little_enough([b], pair, reach, rate, measurement, bench)]
    chosen, told = _chosen(blocks, pair, reach, sigma, rate)
    if not chosen or told < WORTH:
        return None
    return _protocol(pair, chosen, told, reach, rate, bench)


def rival_of(d: Diagnosis) -> Rival | None:
    """The cause most in doubt and what stands beside it, as models; None where the data have told all names."""
    if in_air(d):
        return None
    models = dict(d.rivals)
    own = [c.id for c in d.causes]
    for cause in sorted(d.causes, key=lambda c: c.confidence):
        for other in (a.id for a in in_doubt(cause)):
            if other not in models or other in own:
                continue
            first = d.model_dict if len(own) == 1 else models.get(cause.id)
            if first is not None:
                return Rival(cause.id, other, (Model.from_dict(first), Model.from_dict(models[other])))
    return None


def _reach(m: Measurement, bench: Bench | None) -> Reach:
    moved = np.abs(np.diff(m.position_mm))
    elapsed = np.diff(m.position_time_s)
    span = max(5, len(moved) // 20000)
    speed = np.convolve(moved, np.ones(span), "valid") / np.convolve(elapsed, np.ones(span), "valid")
    fastest = max(float(np.quantile(speed, 0.9995)), 1.0)
    acceleration = ACCELERATION_mm_s2
    if bench is not None:
        limits, motor = bench.limits, bench.motor
        fastest = min(max(fastest, FAST_mm_s), limits.speed, motor.max_speed or math.inf)
        acceleration = min(limits.acceleration, motor.max_acceleration or math.inf)
    return Reach(0.97 * float(m.position_mm.max()), float(f"{0.95 * fastest:.2g}"), acceleration)


def _presses_little_enough(
    blocks: Sequence[Block], pair: Rival, reach: Reach, rate: float, m: Measurement, bench: Bench | None
) -> bool:
    """Whether no model expects far more than the data have shown, or than the bench allows."""
    most = STRONGER * float(np.max(m.force_N))
    if bench is not None:
        most = max(most, 0.7 * bench.limits.force)
    return _peak(blocks, pair, reach, rate) <= most


def _peak(blocks: Sequence[Block], pair: Rival, reach: Reach, rate: float) -> float:
    moved = motion(together(blocks), reach.acceleration_mm_s2, rate)
    return max(float(np.max(model.simulate(moved.time_s, moved.position_mm))) for model in pair.models)


def _chosen(blocks: Sequence[Block], pair: Rival, reach: Reach, sigma: float, rate: float) -> tuple[list[Block], float]:
    """(blocks, what they tell together, 1: enough): the best per second, one after the other."""
    chosen: list[Block] = []
    told = 0.0
    while len(chosen) < MOST_BLOCKS and told < 1.0:
        best: tuple[float, float, Block] | None = None
        for block in blocks:
            moved = motion(together([*chosen, block]), reach.acceleration_mm_s2, rate)
            if chosen and moved.duration_s > LONGEST_S:
                continue
            value = separation(pair.models, moved, sigma)
            pace = (min(value, 1.0) - told) / moved.duration_s  # more than enough is of no use
            if best is None or pace > best[0]:
                best = (pace, value, block)
        if best is None or best[1] <= told * 1.02:
            break
        chosen.append(best[2])
        told = best[1]
    return chosen, told


def separation(models: tuple[Model, Model], moved: Motion, sigma_N: float) -> float:
    """What a motion tells of two models: 1 where it is enough, whichever of the two is true."""
    first, second = models
    return min(_told(first, second, moved, sigma_N), _told(second, first, moved, sigma_N))


def _told(true: Model, other: Model, moved: Motion, sigma_N: float) -> float:
    """What the other cannot imitate of the true one, against what is enough."""
    n = moved.time_s.size
    force = true.simulate(moved.time_s, moved.position_mm)
    sigma, fold = np.full(n, sigma_N), np.zeros(n, dtype=np.intp)
    data = Data(moved.time_s, moved.position_mm, force, moved.weight, sigma, fold)
    left = math.inf
    for member in family(other):
        left = min(left, refitted(data, member))
        if left <= SETTLED * ENOUGH * WORTH:
            break
    if left <= 0.0 or not math.isfinite(left):
        return 0.0
    without = refitted(data, true.model_copy(update={"effects": true.effects[:-1]}))
    own = max(without, left) if math.isfinite(without) else math.inf
    return min(left / ENOUGH, left / own / SHARE)


def family(model: Model) -> list[Model]:
    """The model, and the same with its last effect in the other forms that a diagnosis tries: their numbers where they
    share them, else as usual. Any of them may pass for the other cause."""
    if not model.effects:
        return [model]
    own = model.effects[-1]
    active = own.active()
    out = [model]
    for form in active.effect.forms:
        if form.name == own.form or not form.sought or form.amend is not None or active.form.amend is not None:
            continue
        entry: dict[str, Any] = {"id": own.id, "form": form.name}
        entry |= {p.name: min(max(active.values.get(p.name, p.if_left_out), p.lower), p.upper) for p in form.parameters}
        effects = [*model.effects[:-1], EffectEntry.model_validate(entry)]
        out.append(model.model_copy(update={"effects": effects}))
    return out


def refitted(data: Data, model: Model) -> float:
    """χ² that a model leaves when its numbers are refitted."""
    structure = structure_of(model, float(data.position_mm.max()), max(float(np.abs(data.force_N).max()), 1e-6))
    found = refit(data, structure, structure.x(structure.pad.x()), STEPS, 1e-5)
    return found.chi2 if math.isfinite(found.chi2) else math.inf


def structure_of(model: Model, depth_mm: float, force_N: float) -> Structure:
    """A model as something to be refitted."""
    causes = []
    for entry in model.effects:
        active = entry.active()
        causes.append(cause_of(active.effect, active.form, active.values))
    return Structure(PadNumbers(model.pad.physics(), depth_mm, force_N), tuple(causes))


def _tells(named: str, other: str) -> str:
    """How the description of a test begins that tells two causes apart."""
    return f"Tells {name_of(named)} from {name_of(other)}:"


def _protocol(
    pair: Rival, chosen: Sequence[Block], told: float, reach: Reach, rate: float, bench: Bench | None
) -> dict[str, Any]:
    different = {block.name: block for block in chosen}.values()
    what = ", ".join(block.what for block in different)
    hope = "" if told >= 0.5 else " They differ little: it may not be enough."
    peak = _peak(chosen, pair, reach, rate)
    force = float(math.ceil(1.3 * peak + 0.5))
    if bench is not None:
        force = min(force, bench.limits.force)
    return {
        "name": "next_test",
        "description": f"{_tells(pair.named, pair.other)} {what}.{hope}",
        "approach": {"speed": min(2.0, reach.speed_mm_s), "force": 0.05, "retract": -AIR_mm},
        "limits": {"force": force, "depth": round(1.03 * reach.depth_mm + 0.05, 2)},
        "steps": [block.to_dict(chosen.count(block)) for block in different],
        "finish": {"retract": -AIR_mm, "air": 5.0},
    }


def write_protocol(path: Path, content: dict[str, Any]) -> None:
    """The protocol as a YAML file that `padbench check` and `run` take."""
    text = yaml.safe_dump(content, sort_keys=False, default_flow_style=None, width=120, allow_unicode=True)
    path.write_text(f"# Written by `padbench diagnose --next`.\n{text}", encoding="utf-8")
