"""The extended model as a model file's content."""

from __future__ import annotations

from typing import Any

import numpy as np

from sim.elastic import NoPad
from sim.model import Model

from .candidates import CHANNEL
from .data import Prepared
from .refit import Fit


def model_of(believed: Model, fit: Fit, prepared: Prepared, limit_N: float | None = None) -> dict[str, Any]:
    """Pad and effects with the fit's numbers and their standard errors; `limit_N`: a ceiling of the force."""
    structure = fit.structure
    pad = fit.pad
    order = np.argsort(-np.array(pad.relaxation.rates), kind="stable")
    rates = [pad.relaxation.rates[i] for i in order]
    for i in range(1, len(rates)):
        rates[i] = min(rates[i], rates[i - 1] * (1 - 1e-9))
    content: dict[str, Any] = {}
    if believed.name:
        content["name"] = believed.name
    content["description"] = "what was believed, refitted and extended by a diagnosis"
    entry: dict[str, Any] = {"elastic": pad.law.to_dict()}
    if not isinstance(pad.law, NoPad):
        entry["relaxation"] = {"shares": [pad.relaxation.shares[i] for i in order], "rates": rates}
        entry["contact"] = "unilateral" if pad.unilateral else "bonded"
    content["pad"] = entry
    effects = []
    covariance = fit.covariance()
    for index, (cause, values) in enumerate(zip(structure.causes, structure.values(fit.x), strict=True)):
        row: dict[str, Any] = {"id": cause.id, "form": cause.form.name}
        position = structure.of_cause(index).start
        for p in cause.form.parameters:
            quantity: dict[str, Any] = {"value": float(values[p.name]), "unit": p.unit}
            if not p.fixed:
                c = structure.coordinates[position]
                spread = float(np.sqrt(max(covariance[position, position], 0.0)))
                spread *= abs(values[p.name]) if c.logarithmic else c.unit
                if spread > 0:
                    quantity["std"] = spread
                position += 1
            row[p.name] = quantity
        effects.append(row)
    ids = {row["id"] for row in effects}
    effects += [row for row in believed.to_dict().get("effects", ()) if row["id"] in CHANNEL and row["id"] not in ids]
    if limit_N is not None and "saturation" not in ids:
        effects.append({"id": "saturation", "limit": {"value": abs(limit_N), "unit": "N"}})
    if effects:
        content["effects"] = effects
    return content
