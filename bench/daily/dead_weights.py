"""Scale and sign of a load cell from loads that are known: a straight line, and what departs from it.

The line is reading = k · load + zero, by least squares over all readings: loads are taken as exact. Linearity is the
largest departure from it, and hysteresis the largest difference between readings of one load on the way up and on the
way down, both in percent of the span (the usual "best straight line" and "hysteresis" of load-cell data sheets; ISO
376:2011 has the same ideas with other reference lines).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from bench.errors import Refused

MOST_LINEARITY_PERCENT = 2.0
"""A cell that departs further from a line is not scaled by one: a stop touches, a weight was mistaken, or it slips."""

SPAN_SIGMAS = 50.0
"""The span of the readings must stand so far above their noise, or the scale is worth less than 2 %."""


@dataclass(frozen=True)
class Reading:
    """One load on the cell: `load_N` known, `reading_N` as the bench file's present scale and sign make it."""

    load_N: float
    reading_N: float
    noise_N: float = math.nan
    samples: int = 0
    drift_N_s: float = math.nan


@dataclass(frozen=True)
class Calibration:
    """What the readings say. `factor` is what the present scale is multiplied by; `std` its relative doubt."""

    factor: float
    sign: int
    zero_N: float
    std: float
    linearity_percent: float
    hysteresis_percent: float | None
    residuals_N: list[float]
    span_N: float

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return dict(vars(self))


def calibrate(readings: list[Reading]) -> Calibration:
    """Fit the line. Raises `Refused` where these readings cannot tell a scale."""
    loads = np.array([reading.load_N for reading in readings])
    values = np.array([reading.reading_N for reading in readings])
    distinct = np.unique(loads)
    if distinct.size < 3:
        raise Refused(
            f"{distinct.size} different loads cannot show whether the cell is linear\n"
            "  take three at the least, with 0 first"
        )
    span = float(np.ptp(loads))
    k, zero = (float(value) for value in np.polyfit(loads, values, 1))
    residuals = values - (k * loads + zero)
    noise = np.nanmax([*(reading.noise_N for reading in readings), 0.0])
    if abs(k) * span <= SPAN_SIGMAS * noise / math.sqrt(max(1, min(reading.samples or 1 for reading in readings))):
        raise Refused(
            f"the readings go by {abs(k) * span:.4f} N over all loads, hardly more than their noise\n"
            "  is the weight on the cell, and the cell wired to this amplifier?"
        )
    spread = float(np.sqrt(np.sum(residuals**2) / max(len(readings) - 2, 1)))
    std = spread / math.sqrt(float(np.sum((loads - loads.mean()) ** 2))) / abs(k)
    return Calibration(
        factor=1.0 / abs(k),
        sign=1 if k > 0 else -1,
        zero_N=zero,
        std=std,
        linearity_percent=100.0 * float(np.abs(residuals).max()) / (abs(k) * span),
        hysteresis_percent=_hysteresis(loads, values, abs(k) * span),
        residuals_N=[float(value) / abs(k) for value in residuals],
        span_N=span,
    )


def _hysteresis(loads: np.ndarray, values: np.ndarray, span: float) -> float | None:
    """Up against down, in percent of the span; None where no load was read on both ways."""
    top = int(np.argmax(loads))
    apart = [
        abs(float(values[i] - values[j]))
        for i in range(top)
        for j in range(top + 1, len(loads))
        if math.isclose(loads[i], loads[j], abs_tol=1e-9)
    ]
    return 100.0 * max(apart) / span if apart else None


def lines(found: Calibration, readings: list[Reading], scale: float, sign: int) -> list[str]:
    """The calibration for a terminal: residuals, then what comes out."""
    out = ["      load N   reading N      off mN    noise mN"]
    for reading, off in zip(readings, found.residuals_N, strict=True):
        noise = f"{1e3 * reading.noise_N:11.2f}" if math.isfinite(reading.noise_N) else "          –"
        out.append(f"  {reading.load_N:10.4f}  {reading.reading_N:10.4f} {1e3 * off:+11.2f} {noise}")
    out.append(
        f"scale {scale:.6g} → {scale * found.factor:.6g} (± {100 * found.std:.3f} %), "
        f"sign {sign:+d} → {sign * found.sign:+d}"
    )
    hysteresis = found.hysteresis_percent
    known = f"{hysteresis:.3f} %" if hysteresis is not None else "not known (go up and down: --and-back)"
    out.append(f"linearity {found.linearity_percent:.3f} % of {found.span_N:.3g} N, hysteresis {known}")
    if found.sign < 0:
        out.append(
            "THE SIGN TURNS: a load that presses read negative; every limit of force was on the wrong side until now\n"
            "  but if these weights pulled at the cell, where a pad presses it: write nothing, and load it that way"
        )
    return out
