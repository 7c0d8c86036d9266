"""The paper's fast method: γ on rising ramps alone, then A and B in closed form over ramps and holds. One iteration.

Phase (a), on a ramp so quick that nothing relaxes in it, has F = F^e(δ): A = B = 1, and γ is a least-squares fit of
the law to the force samples of the ramp, as measured. Phase (b) is one ARX step (or, with `step="iv"`, ARX and then the
instrumental variable, which is consistent) over all the data.

**Which ramps.** F = F^e(δ) holds for a pad that has recovered: on a later ramp of a staircase the force starts from
what relaxation left of it, and γ comes out too soft. So `ramps="recovered"` takes those that begin out of contact, with
no creep left that matters (see `phases.MEMORY`), and of them those in which no more than `MOST_LOSS` relaxes;
`ramps="all"` is the literal reading: every rising ramp. What either leaves wrong is estimated and reported, as a share
of F^e at the greatest depth:

- `loss_in_ramp`: what relaxes before a ramp has ended, by the step response that was found;
- `bias_of_all_ramps`: F^e by all rising ramps against F^e by the recovered ones;
- `depth_read`: the depth of the deepest ramp used, of the greatest in the data; beyond it the law is extrapolated;
- `doubt_at_depth`: the standard error of F^e at the greatest depth, of its value.

Refused: no such ramp; a loss of more than `MOST_LOSS` in every one; ramps to less than `LEAST_READ` of the depth.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from bench.errors import InputError
from bench.recording.types import Measurement
from sim.digital import Filter

from .._kernel import Array
from ..noise import noise_of
from ..result import FitResult
from ..solver import Solution, minimise
from . import outcome
from .estimator import Found, arx_scores, output_error_scores, relative_V, silent
from .iv import refined
from .linear import arx
from .phases import Ramp, ramps_of
from .series import Data
from .system import SOFTEST, Structure

MOST_LOSS = 0.05
LEAST_READ = 0.2  # of the greatest depth: ramps that end above it say nothing of the rest
SHALLOW = 0.8  # of the greatest depth: ramps that end above it leave the rest of the law to extrapolation
MOST_STEPS = 40  # of the instrumental variable
OTHER = "Use `--method continuous` or `iterative`, which take relaxation into account everywhere."
WOULD_DO = (
    "A protocol whose first step goes from air to its greatest depth at 60 mm/s or more would do, as in `long_hold`. "
)


def fit(
    measurements: Sequence[Measurement],
    law: str = "auto",
    order: int | str = "auto",
    contact: str = "auto",
    degree: int | None = None,
    progress: Callable[[str], None] | None = None,
    sample_time: float | None = None,
    ramps: str = "recovered",
    step: str = "arx",
) -> FitResult:
    """Fit one pad. `ramps`: recovered or all; `step`: arx or iv. Raises InputError too where no ramp will do."""
    if ramps not in ("recovered", "all"):
        raise InputError("--ramps", f"there are no `{ramps}` ramps", "One of: recovered, all.")
    if step not in ("arx", "iv"):
        raise InputError("fit", f"there is no step `{step}`", "One of: arx, iv.")
    return outcome.fit(Fast(ramps, step), measurements, law, order, contact, degree, progress, sample_time)


@dataclass(frozen=True)
class _Phase:
    """Samples of phase (a): depth over D, force over the scale; of each ramp its depth and times after its start."""

    u: Array
    y: Array
    pieces: list[tuple[Array, Array]]

    def only(self, kept: list[int]) -> _Phase:
        """The samples of some of the ramps."""
        owner = np.repeat(np.arange(len(self.pieces)), [len(t) for t, _ in self.pieces])
        inside = np.isin(owner, kept)
        return _Phase(self.u[inside], self.y[inside], [self.pieces[k] for k in kept])


def phase_a(data: Data, structure: Structure) -> Array | None:
    """γ by phase (a) on the recovered ramps; None where the data have none."""
    rested = [[r for r in ramps_of(m) if r.rising and r.recovered] for m in data.measurements]
    try:
        phase = _samples(data, structure, rested, "recovered")
    except InputError:
        return None
    return _static(structure, phase)[0].x


class Fast:
    """The scheme, for `outcome.fit`."""

    name = "fast"

    def __init__(self, ramps: str = "recovered", step: str = "arx") -> None:
        self.ramps, self.step = ramps, step

    def estimate(self, data: Data, structure: Structure, quick: bool = False, start: Array | None = None) -> Found:
        """γ by phase (a), A and B by (a) and (b)."""
        every = [[r for r in ramps_of(m) if r.rising] for m in data.measurements]
        rested = [[r for r in ramps if r.recovered] for ramps in every]
        phase = _samples(data, structure, every if self.ramps == "all" else rested, self.ramps)
        first = _static(structure, phase)[0].x
        if first[0] <= SOFTEST:
            raise InputError(
                "--method fast", "the force does not rise on its ramps", "Is its sign right (load cell `sign`)?"
            )
        noise = noise_of(data.on_grid()).force_N / data.force_N
        left = silent(data, structure, noise)
        # `start`: a refit on part of the data
        filter = self._steady(data, structure, first, left) if start is None else structure.filter(start)
        phase, loss = self._quick(structure, phase, filter, data.T)
        fitted, variance = _static(structure, phase)
        gamma = fitted.x
        v = structure.joined(gamma, self._linear(data, structure, gamma, left))
        V = relative_V(data, structure, v)
        if not np.isfinite(V):
            raise _runs_away(structure)
        covariance: Array = np.asarray(variance * np.linalg.pinv(fitted.matrix), dtype=np.float64)
        if start is not None:
            return Found(V, v, 1, True, [(V, v)], gamma_covariance=covariance)
        if loss > MOST_LOSS:
            raise InputError(
                "--method fast",
                f"{100 * loss:.0f} % of the force relaxes before the ramps have ended: they do not show the elastic "
                f"response ({100 * MOST_LOSS:.0f} % at most)",
                f"Ramps must be quicker. {WOULD_DO}{OTHER}",
            )
        read = max(float(u.max()) for _, u in phase.pieces)
        doubt = float(np.sqrt(max(covariance[0, 0], 0.0)) / gamma[0])
        if read < LEAST_READ:
            raise InputError(
                "--method fast",
                f"its ramps end at {read * data.depth_mm:.2g} mm of {data.depth_mm:.3g}: they say nothing of the rest",
                WOULD_DO + OTHER,
            )
        bias = _bias(data, structure, every, rested)
        figures = {"loss_in_ramp": loss, "bias_of_all_ramps": bias, "depth_read": read, "doubt_at_depth": doubt}
        notes = self._notes(figures, len(phase.pieces), len(phase.u))
        if read < SHALLOW:
            notes.append(
                f"Its ramps end at {read * data.depth_mm:.3g} mm of {data.depth_mm:.3g} mm: beyond, the law is "
                f"extrapolated, and at depth in doubt by {100 * doubt:.2g} %. {WOULD_DO.strip()}"
            )
        return Found(V, v, 1, True, [(V, v)], notes=notes, figures=figures, gamma_covariance=covariance)

    def _steady(self, data: Data, structure: Structure, gamma: Array, left: list[np.ndarray]) -> Filter:
        """The step response by which losses are judged: ARX's would be biased, so the instrumental variable's."""
        v = structure.joined(gamma, self._linear(data, structure, gamma, left))
        if not np.isfinite(relative_V(data, structure, v)):
            raise _runs_away(structure)
        return structure.filter(v if self.step == "iv" else _instrumental(data, structure, v))

    def _quick(self, structure: Structure, phase: _Phase, filter: Filter, T: float) -> tuple[_Phase, float]:
        """The ramps that lose no more than `MOST_LOSS`, or the best one where none does; and the loss of the worst."""
        losses = _losses(structure, _static(structure, phase)[0].x, phase, filter, T)
        if self.ramps == "all" or max(losses) <= MOST_LOSS:
            return phase, max(losses)
        most = max(MOST_LOSS, min(losses))
        kept = phase.only([k for k, loss in enumerate(losses) if loss <= most])
        if len(kept.u) <= structure.nonlinear:  # too few samples for the law
            return phase, max(losses)
        return kept, max(_losses(structure, _static(structure, kept)[0].x, kept, filter, T))

    def scores(self, data: Data, structure: Structure, v: Array) -> list[Array]:
        """Those of the linear step (γ has its own covariance)."""
        return output_error_scores(data, structure, v) if self.step == "iv" else arx_scores(data, structure, v)

    def _linear(self, data: Data, structure: Structure, gamma: Array, left: list[np.ndarray]) -> Array:
        none = np.zeros(structure.order)
        v = structure.vector(float(gamma[0]), gamma[1:], none, none)
        linear = arx(data, structure, v, left)
        if self.step == "iv":
            linear = _instrumental(data, structure, structure.joined(gamma, linear))[structure.nonlinear :]
        return linear

    def _notes(self, figures: dict[str, float], ramps: int, samples: int) -> list[str]:
        which = "rising ramp" if self.ramps == "all" else "rising ramp from a recovered pad"
        which = which.replace("ramp", "ramps", 1) if ramps > 1 else which
        lines = [
            f"The elastic law is from {samples} samples of {ramps} {which}; {100 * figures['loss_in_ramp']:.2g} % of "
            "the force relaxes within them, and the law is that much too soft."
        ]
        bias = figures["bias_of_all_ramps"]
        if np.isfinite(bias):
            lines.append(f"By all rising ramps the law comes out {100 * bias:+.2g} % against recovered ones, at depth.")
        return lines


def _samples(data: Data, structure: Structure, ramps: list[list[Ramp]], which: str) -> _Phase:
    pieces = []
    for m, several in zip(data.measurements, ramps, strict=True):
        depth = m.position_at_forces_mm()
        counted = m.counted()
        for ramp in several:
            inside = (m.force_time_s >= ramp.begin_s) & (m.force_time_s <= ramp.end_s) & (depth > 0)
            inside &= counted
            if inside.any():
                pieces.append((m.force_time_s[inside], depth[inside] / data.depth_mm, m.force_N[inside] / data.force_N))
    count = sum(len(t) for t, _, _ in pieces)
    need = structure.nonlinear + 1
    if count < need:
        kind = "rising ramp" if which == "all" else "rising ramp that begins out of contact on a recovered pad"
        found = f"only {count} force samples lie on one" if pieces else "there is none in the data"
        raise InputError("--method fast", f"it needs {need} samples of a {kind}: {found}", WOULD_DO + OTHER)
    u = np.concatenate([p[1] for p in pieces])
    return _Phase(u, np.concatenate([p[2] for p in pieces]), [(t, depth) for t, depth, _ in pieces])


def _static(structure: Structure, phase: _Phase) -> tuple[Solution, float]:
    """γ with F = F^e(δ), and the variance of the error."""
    family, g = structure.family, structure.nonlinear

    def error(x: Array) -> tuple[Array, Array]:
        s, ds = family.shape(phase.u, x[1:])
        return phase.y - x[0] * s, np.concatenate([s[:, None], x[0] * ds], axis=1)

    def normal(x: Array) -> tuple[float, Array, Array]:
        e, J = error(x)
        return float(e @ e), J.T @ e, J.T @ J

    lower, upper = structure.bounds()
    starts = []
    for theta in family.starts:
        s, _ = family.shape(phase.u, theta)
        x = np.concatenate([[max(float(s @ phase.y) / max(float(s @ s), 1e-300), 1e-6)], theta])
        starts.append((float(np.sum(error(x)[0] ** 2)), x))
    starts.sort(key=lambda item: item[0])
    ends = [
        minimise(normal, lambda x: float(np.sum(error(x)[0] ** 2)), x, lower[:g], upper[:g], 100) for _, x in starts[:2]
    ]
    best = min(ends, key=lambda s: s.cost)
    return best, best.cost / max(len(phase.u) - g, 1)


def _instrumental(data: Data, structure: Structure, v: Array) -> Array:
    """v with the instrumental variable's filter for the law's shape in it, by repeated steps."""
    for _ in range(MOST_STEPS):
        new = refined(data, structure, v)
        still = bool(np.all(np.abs(new - v) <= 1e-7 * np.max(np.abs(v))))
        v = new
        if still:
            break
    return v


def _losses(structure: Structure, gamma: Array, phase: _Phase, filter: Filter, T: float) -> list[float]:
    """Share of F^e lost at the end of each ramp: Σ ΔF^e (1 − g(t_end − t)) / F^e(end)."""
    out = []
    for t, u in phase.pieces:
        s, _ = structure.family.shape(u, gamma[1:])
        rise = np.diff(s, prepend=0.0)
        ago = t[-1] - t
        middle = ago + np.append(np.diff(t), 0.0)[: len(t)] / 2
        g = filter.step_response(int(np.ceil(middle.max() / T)) + 2)
        lost = 1 - np.interp(middle / T, np.arange(len(g)), g)
        out.append(max(float(rise @ lost / s[-1]), 0.0) if s[-1] > 0 else 0.0)
    return out


def _runs_away(structure: Structure) -> InputError:
    return InputError("fit", f"the ARX filter of order {structure.order} grows without end within these data",
                      "Try another order, or a longer --sample-time.")  # fmt: skip


def _bias(data: Data, structure: Structure, every: list[list[Ramp]], rested: list[list[Ramp]]) -> float:
    """F^e at D by all rising ramps over that by the recovered ones, minus 1; NaN where there are none of these."""
    try:
        both = [_static(structure, _samples(data, structure, ramps, "all"))[0].x[0] for ramps in (every, rested)]
    except InputError:
        return float("nan")
    return float(both[0] / both[1] - 1) if both[1] > 0 else float("nan")
