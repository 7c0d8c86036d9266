"""How near the shapes of a cause's family come to what was hidden, where there is no noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bench.diagnose.candidates import CHANNEL
from bench.diagnose.channel import faults
from bench.diagnose.data import prepare
from bench.diagnose.diagnose import believed_structure
from bench.diagnose.refit import mean_square, refit
from bench.diagnose.shapes import families
from bench.recording.types import Measurement
from sim.model import Model

HELD_OUT = 1.15
"""Times the noise floor, that the error on data held out may be where the shape is in the family."""

BEST = 3
"""Shapes that are carried to their minimum."""

STEPS = 40


def family_rmse_N(measurement: Measurement, clean_N: np.ndarray, model: Model, id: str) -> float | None:
    """RMS, N, that the best shape of a cause leaves of the force without noise, the pad's numbers being free.

    `clean_N` (m,): at the measurement's force stamps. `model`: with the cause in some shape, from which the others
    start; causes beside it are left out. None for what detectors find and no fit has.
    """
    own = [entry for entry in model.effects if entry.id == id]
    if not own or id in CHANNEL:
        return None
    prepared = prepare(measurement, faults(measurement.force_N).good)
    force_N = prepared.full.force_N.copy()
    force_N[prepared.at] = clean_N[prepared.kept]
    clean = replace(prepared.full, force_N=force_N)
    structure = believed_structure(model.model_copy(update={"effects": own}), prepared)
    lead = refit(clean, structure, structure.x(structure.pad.x(), [c.start for c in structure.causes]), STEPS, 1e-7)
    tried = sorted(families(clean, lead, [0])[0], key=lambda member: member.fit.chi2)[:BEST]
    ended = [refit(clean, member.fit.structure, member.fit.x, STEPS, 1e-7) for member in tried]
    return float(np.sqrt(min(mean_square(clean, fit.structure, fit.x) for fit in ended)))
