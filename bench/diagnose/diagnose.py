"""The diagnosis: refit the belief, search for what it lacks, judge on data held out, and say it."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bench import identify
from bench.errors import InputError
from bench.recording.types import Measurement
from sim.effects import all_effects
from sim.model import Model
from sim.pad import Pad

from .channel import Faults, faults, standing_off
from .data import Prepared, prepare
from .numbers import PadNumbers, Structure, cause_of
from .refit import Fit, force_at, mean_square, onto
from .remains import remains
from .result import Alternative, CauseFound, Diagnosis, Number
from .search import Path, Search
from .verdict import EXPLAINED, chain, excesses, found, ordered
from .write import model_of

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

TOLD = 0.002  # of the noise power


def diagnose(m: Measurement, believed: Model, progress: Callable[[str], None] | None = None) -> Diagnosis:
    """What the believed model gets wrong about a measurement, and why.

    Raises InputError for data that cannot be worked on at all (see `identify.fit`).
    """
    begun = time.perf_counter()
    tell = progress or (lambda _: None)
    tell("reading the channels")
    flags = faults(m.force_N)
    prepared = prepare(m, flags.good)
    structure = believed_structure(believed, prepared)
    search = Search(prepared, structure, tell)
    tell("refitting what is believed")
    base = search.base(_pads(m, believed, structure, flags.good))
    tell("looking for causes")
    path = search.path(base)
    prepared, flags, search, path = _asked_again(m, prepared, flags, search, path)
    base, final = path.fits[0], path.fits[-1]
    final = ordered(prepared, final, base)
    tell("predicting what was held out")
    fits = chain(prepared, final, base)
    squares, excess = excesses(prepared, fits)
    whole = [onto(fit, prepared.full, 6, 1e-8) for fit in (fits[0], fits[-1])]
    return _concluded(m, believed, prepared, flags, search, path, fits, whole, squares, excess, begun)


def believed_structure(model: Model, prepared: Prepared) -> Structure:
    """The believed pad and its effects, to be refitted; the surface's doubt with it."""
    pad = PadNumbers(model.pad.physics(), prepared.depth_mm, prepared.force_scale_N)
    causes = []
    for entry in model.effects:
        active = entry.active()
        causes.append(cause_of(active.effect, active.form, active.values))
    return Structure(pad, tuple(causes), prepared.doubt_mm)


def _pads(m: Measurement, believed: Model, structure: Structure, good: Mask) -> list[Array]:
    """Where the refit of the belief starts: as believed, and where a fit of its law and order ends."""
    starts = [structure.pad.x()]
    spec = believed.pad
    order = len(spec.relaxation.rates)
    if spec.elastic.law in ("exponential", "power", "polynomial") and 1 <= order <= 8 and not structure.causes:
        clean = replace(m, force_time_s=m.force_time_s[good], force_N=m.force_N[good])
        degree = len(spec.elastic.alpha) - 1 if spec.elastic.law == "polynomial" else None
        try:
            fit = identify.fit(clean, law=spec.elastic.law, order=order, contact=spec.contact, degree=degree)
            pad: Pad = fit.model.pad.physics()
            starts.append(replace(structure.pad, pad=pad).x())
        except (InputError, ValueError, ArithmeticError):
            pass
    return starts


def _asked_again(
    m: Measurement, prepared: Prepared, flags: Faults, search: Search, path: Path
) -> tuple[Prepared, Faults, Search, Path]:
    """Channel faults against the model found; where that changes which samples count, the fits are carried on."""
    fit = path.fits[-1]
    residual = prepared.full.force_N - force_at(prepared.full, fit.structure, fit.x)
    errors = np.full(len(m.force_N), np.nan)
    errors[-len(prepared.at) :] = residual[prepared.at]
    known = np.isfinite(errors) & ~(flags.saturated | flags.stuck)
    outlier = standing_off(np.where(np.isfinite(errors), errors, 0.0), known)
    if outlier.sum() == flags.outlier.sum() and np.array_equal(outlier, flags.outlier):
        return prepared, flags, search, path
    flags = replace(flags, outlier=outlier)
    prepared = prepare(m, flags.good)
    again = Search(prepared, search.believed, search.progress)
    path = replace(path, fits=[onto(f, prepared.short, 15, 1e-8) for f in path.fits])
    return prepared, flags, again, path


def _concluded(
    m: Measurement, believed: Model, prepared: Prepared, flags: Faults, search: Search, path: Path,
    fits: list[Fit], whole: list[Fit], squares: list[float], excess: list[float], begun: float,
) -> Diagnosis:  # fmt: skip
    full, floor = prepared.full, prepared.floor_N
    before, after = (force_at(full, f.structure, f.x) for f in whole)
    counted = full.weight > 0
    channel, flagged_square = _channel_causes(m, prepared, flags, before)
    whole_excess = excess[0] + flagged_square
    scale = max(whole_excess, 1e-300)
    gains = [max(a - b, 0.0) / scale if whole_excess > 0 else 0.0 for a, b in zip(excess, excess[1:], strict=False)]
    causes = found(search, path, fits, whole[-1], gains)
    for c in channel:
        causes.append(replace(c, gain=c.gain / scale))
    left = excess[-1] / scale if whole_excess > 0 else 0.0
    left = 1.0 - sum(c.gain for c in causes) if causes else 1.0
    residual = full.force_N - after
    tests = remains(full, residual, after, prepared.colour, whole[-1].free)
    told = [r for r in tests if r.passed]
    if not causes and not told:
        verdict = "consistent"
    elif not causes:
        verdict = "unexplained" if excess[0] > TOLD * floor**2 else "consistent"
    else:
        verdict = "explained" if left <= EXPLAINED else "unexplained"
    at = prepared.at
    flagged = ~flags.good[-len(at) :]
    rmse_after, unflagged = _errors(m, prepared, after)
    return Diagnosis(
        verdict=verdict,
        causes=causes,
        left=float(left),
        noise_floor=floor,
        rmse_before=float(np.sqrt(np.mean((full.force_N - before)[at][_counted(m, at)] ** 2))),
        rmse_after=rmse_after,
        held_out_before=float(np.sqrt(squares[0] + flagged_square)),
        held_out_after=float(np.sqrt(squares[-1])),
        flagged_fraction=float(flagged.mean()),
        seconds=time.perf_counter() - begun,
        model_dict=model_of(believed, whole[-1], prepared),
        rmse_after_unflagged=unflagged,
        notes=list(m.notes),
        remainders=tests,
        name=m.name,
        time_s=full.time_s[at],
        position_mm=full.position_mm[at],
        force_N=full.force_N[at],
        before_N=before[at],
        after_N=after[at],
        sigma_N=full.sigma_N[at],
        flagged=flagged,
        counted=counted[at],
        ranking=_ranking(path),
    )


def _counted(m: Measurement, at: NDArray[np.intp]) -> Mask:
    time = m.force_time_s[-len(at) :]
    return np.asarray((time >= m.fit_from_s) & (time <= m.fit_to_s))


def _errors(m: Measurement, prepared: Prepared, after: Array) -> tuple[float, float]:
    """RMS error of the extended model over all samples, and over those not flagged."""
    full, at = prepared.full, prepared.at
    e = (full.force_N - after)[at]
    inside = _counted(m, at)
    good = full.weight[at] > 0
    return float(np.sqrt(np.mean(e[inside] ** 2))), float(np.sqrt(np.mean(e[good] ** 2)))


def _channel_causes(m: Measurement, prepared: Prepared, flags: Faults, before: Array) -> tuple[list[CauseFound], float]:
    """Channel faults as causes; their gain is still in N² (mean square of the flagged samples over all)."""
    at = prepared.at
    e = (prepared.full.force_N - before)[at]
    n = max(len(at), 1)
    out, total = [], 0.0
    for id_, mask in (
        ("saturation", flags.saturated),
        ("stuck_samples", flags.stuck),
        ("outliers", flags.outlier),
    ):
        mask = mask[-len(at) :] & _counted(m, at)
        count = int(mask.sum())
        if count == 0 or (id_ == "outliers" and count < 3):
            continue
        square = float(np.sum(e[mask] ** 2)) / n
        total += square
        share = count / n
        if id_ == "saturation":
            numbers = {"limit": Number(float(flags.limit_N or 0.0), "N", prepared.noise.force_N)}
        else:
            numbers = {"fraction": Number(share, "1", float(np.sqrt(share * (1 - share) / n)))}
        effect = all_effects().get(id_)
        values = {name: v.value for name, v in numbers.items()}
        try:
            words = effect.explanation(values) if effect is not None else id_
        except KeyError:
            words = effect.what if effect is not None else id_
        form = effect.forms[0].name if effect is not None else ""
        out.append(CauseFound(id_, form, numbers, square, 0.99, [], words, effect.check if effect is not None else ""))
    return out, total


def _ranking(path: Path) -> list[Alternative]:
    if not path.rivals:
        return []
    base = path.fits[0].chi2
    best = path.rivals[0][0].fit.chi2
    gained = max(base - best, 1e-12)
    return [
        Alternative(t.id, t.cause.form.name, max((base - t.fit.chi2) / gained, 0.0), t.fit.chi2 - best, False)
        for t in path.rivals[0]
    ]


__all__ = ["believed_structure", "diagnose", "mean_square"]
