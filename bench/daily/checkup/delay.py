"""How late the force comes against the position it belongs to.

In contact: the pad's model and the delay are fitted together to fast and slow strokes into the pad and out of it. The
moment of touch moves with speed times delay, which no relaxation does; the standard error has both in it. In air: the
cell feels the inertia of the probe in sharp moves, F(t) = m a(t − d), linear in m; d by least squares (variable
projection; Golub and Pereyra, SIAM J. Numer. Anal. 10, 1973).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.optimize import minimize_scalar

from bench import identify
from bench.daily.checkup.finding import Finding
from bench.diagnose.data import prepare
from bench.diagnose.diagnose import believed_structure
from bench.diagnose.refit import mean_square, refit
from bench.diagnose.spread import covariance
from bench.diagnose.verdict import described
from bench.recording.types import ForceChannel, MotorChannel, Recording
from sim.model import Model

Array = NDArray[np.float64]

MOST_S = 0.03
"""Longest delay that is looked for, early or late."""

AHEAD_S = 0.02
MOST_DOUBT_S = 0.005
"""A delay that is known no better than that says nothing."""

GRID_S = 0.00025
SMOOTH_S = 0.003
SIGNIFICANT = 30.0
"""F statistic beyond which the force has to do with the motion at all."""

LATE_S = 2e-4
"""A delay that differs from the bench file's by less costs less than the noise at any usual speed."""

UNSEEN_S = 1e-3
"""Two deviations of a delay that leave it unknown: so late a force is a cause that a diagnosis finds."""

BLOCK_S = 0.05
"""Errors hang together over about so long; the doubt is taken from blocks of this length."""


@dataclass(frozen=True)
class Delay:
    """`delay_s` of force stamps against position stamps, one standard deviation, and how it was found."""

    delay_s: float
    std_s: float
    how: str
    rms_N: float

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return dict(vars(self))


def judged(found: Delay, known_s: float) -> Finding:
    """A delay against that of the bench file: another one, the same, or not known well enough to say."""
    shown = f"force {1e3 * found.delay_s:+.2f} ± {1e3 * found.std_s:.2f} ms late against position ({found.how})"
    off_s, doubt_s = abs(found.delay_s - known_s), 2.0 * found.std_s
    if off_s > max(LATE_S, 1.5 * doubt_s):
        means = f"the bench file says {1e3 * known_s:+.2f} ms: at 80 mm/s that is {80e3 * off_s:.0f} µm of depth"
        do = "--write FILE puts it into `timing`; check the amplifier's filter too"
        return Finding("delay", shown, False, means, do)
    if off_s > max(LATE_S, doubt_s) or doubt_s > UNSEEN_S:
        means = f"{1e3 * (off_s + doubt_s):.1f} ms cannot be told from the {1e3 * known_s:g} ms of the bench file"
        do = "a run of fast moves on a pad tells it better: its diagnosis names a late force, and by how much"
        return Finding("delay", shown, None, means, do)
    return Finding("delay", shown)


def in_contact(recording: Recording) -> Delay | None:
    """From strokes into a pad, those since the first mark of phase `steps`; None where they tell nothing.

    Raises `InputError` for what cannot be fitted at all.
    """
    measured = recording.measurement()
    # So shallow, any law is near an exponential one; trying them all takes ten times as long and changes nothing.
    fitted = identify.fit([measured], law="exponential", order=2, contact="unilateral")
    # A delay of the model is never negative: with the forces stamped later by a known time, an early force is one too.
    span = measured.force_time_s + AHEAD_S <= measured.position_time_s[-1]
    later = replace(measured, force_time_s=measured.force_time_s[span] + AHEAD_S, force_N=measured.force_N[span])
    content = fitted.model.to_dict()
    content["effects"] = [{"id": "force_delay", "form": "constant", "delay": AHEAD_S}]
    prepared = prepare(later, np.ones(later.force_N.size, dtype=bool))
    structure = believed_structure(Model.model_validate(content), prepared)
    fit = refit(prepared.full, structure, structure.x(structure.pad.x()), 60, 1e-9)
    number = described(replace(fit, spread=covariance(prepared.full, prepared.short, fit)), 0)[2]["delay"]
    if not math.isfinite(number.std) or number.std > MOST_DOUBT_S:
        return None
    rms_N = math.sqrt(mean_square(prepared.full, structure, fit.x))
    return Delay(number.value - AHEAD_S, number.std, "strokes into the pad", rms_N)


def in_air(motor: MotorChannel, cell: ForceChannel) -> Delay | None:
    """From the inertia of what the cell carries, in sharp moves; None where none is felt."""
    grid, x = _even(motor)
    if grid.size < 100:
        return None
    width = SMOOTH_S / GRID_S
    acceleration = gaussian_filter1d(x, width, order=2) / GRID_S**2
    scale = float(np.std(acceleration))
    if scale <= 0:
        return None
    return _best(grid, np.column_stack([np.ones_like(x), acceleration / scale]), cell, "inertia in air")


def _even(motor: MotorChannel) -> tuple[Array, Array]:
    """The measured motion on an even grid."""
    if motor.time_s.size < 8:
        return np.empty(0), np.empty(0)
    grid = np.arange(motor.time_s[0], motor.time_s[-1], GRID_S)
    return grid, np.interp(grid, motor.time_s, motor.position_mm)


def _best(grid: Array, columns: Array, cell: ForceChannel, how: str) -> Delay | None:
    t, force = cell.time_s, cell.gross_N
    inside = (t > grid[0] + MOST_S) & (t < grid[-1] - MOST_S)
    t, force = t[inside], force[inside]
    n, p = t.size, columns.shape[1]
    if n < 10 * p:
        return None

    def residual(delay: float) -> Array:
        design = np.column_stack([np.interp(t - delay, grid, column) for column in columns.T])
        return np.asarray(force - design @ np.linalg.lstsq(design, force, rcond=None)[0])

    def cost(delay: float) -> float:
        e = residual(delay)
        return float(e @ e)

    coarse = np.linspace(-MOST_S, MOST_S, 61)
    start = float(coarse[int(np.argmin([cost(delay) for delay in coarse]))])
    step = float(coarse[1] - coarse[0])
    found = minimize_scalar(cost, bounds=(start - step, start + step), method="bounded", options={"xatol": 1e-7})
    delay, least = float(found.x), float(found.fun)
    null = float(np.sum((force - force.mean()) ** 2))
    strength = (null - least) / (p - 1) / (least / (n - p))
    if strength < SIGNIFICANT or abs(delay) > MOST_S - step:
        return None
    return Delay(delay, _doubt(t, residual, delay), how, math.sqrt(least / n))


def _doubt(t: Array, residual: Any, delay: float) -> float:
    """Standard deviation of the delay: the curvature of the cost, widened for errors that hang together."""
    h = 1e-4
    here = residual(delay)
    slope = (residual(delay + h) - residual(delay - h)) / (2.0 * h)
    information = float(slope @ slope)
    block = ((t - t[0]) / BLOCK_S).astype(int)
    score = np.bincount(block, weights=slope * here)
    return math.sqrt(max(float(score @ score), float(here @ here) / t.size * information)) / information
