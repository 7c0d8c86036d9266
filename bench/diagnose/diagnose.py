"""The diagnosis: refit the belief, search for what it lacks, judge on data held out, and say it."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bench import identify
from bench.errors import InputError
from bench.felt_motion import serves
from bench.identify.motion import holds
from bench.identify.noise import MOTION_FOR_NOISE, of_the_motion
from bench.identify.past import fitted_past
from bench.identify.problem import must_touch
from bench.recording.types import Measurement
from sim.effects import all_effects
from sim.model import Model
from sim.pad import Pad

from .as_given import as_given
from .asked_again import asked_again, hum_asked_again, with_pulses
from .candidates import CHANNEL
from .channel import FEW, Faults, faults, not_of_the_motion
from .channel_causes import by_themselves, channel_causes, joined
from .contact import stays_bonded
from .data import Prepared, as_reported, prepare
from .evidence import SPEAKS, beyond_limit, held_back
from .hum import hidden
from .needed import Needed, needed
from .noise import SETTLED_S
from .noiseless import without_noise
from .numbers import PadNumbers, Structure, cause_of
from .path import Path
from .refit import Fit, force_at, placed
from .remains import FEWEST, beyond_chance, remains
from .result import Alternative, Diagnosis
from .search import A_PART, Search
from .swing import Swing
from .swing import find as swinging
from .units import doubts
from .verdict import explains, floor_told, found, seen, speaks
from .way import TOLD_ONCE, most_sure
from .write import model_of

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

TOLD = 0.002  # of what the belief leaves beyond the noise: what a fault of the channel adds at the least
NO_NOISE = 0.1  # of the noise power: what turns its sign with each sample is taken for some times as much noise
ENDED_EARLY = "the search ended with its work done: what is left may have a further cause, for which it did not look"
FEW_TO_TELL = "only {} force samples count in these data: too few to tell causes by"
SHAKING = {"inertia", "resonance"}  # what swings with each corner of a motion is heard in it, and is no noise
RIVALS = 4  # models of the best single causes that are kept


def diagnose(m: Measurement, believed: Model, progress: Callable[[str], None] | None = None) -> Diagnosis:
    """What the believed model gets wrong about a measurement, and why.

    Raises InputError for data that cannot be worked on at all (see `identify.fit`).
    """
    begun = time.perf_counter()
    tell = progress or (lambda _: None)
    tell("reading the channels")
    if believed.pad.elastic.law != "none":
        must_touch([m])
    flags = not_of_the_motion(m, with_pulses(m, without_noise(m, faults(m.force_N))))
    prepared = prepare(m, flags.good)
    structure = believed_structure(believed, prepared)
    search = Search(prepared, structure, tell, ["saturation"] if flags.saturated.any() else [])
    tell("refitting what is believed")
    base = search.base(_pads(m, believed, structure, flags.good))
    _, flags, search, path = asked_again(m, search.prepared, flags, search, Path([base]), first=True)
    base = path.fits[0]
    tell("looking for causes")
    path = search.path(base)
    ended = _ended(m, search, flags, path, tell)
    if ended.nothing_needed:  # what came first did harm to all that followed; what stood near it may not
        others = (_ended(m, search, flags, other, tell) for other in search.from_others(path))
        ended = next((e for e in others if e.takes_a_part), ended)
    return _concluded(m, believed, ended, begun)


@dataclass(frozen=True)
class _Ended:
    """A search that has ended, on data whose faults were asked for once more; and what of it is needed."""

    prepared: Prepared
    flags: Faults
    search: Search
    path: Path
    needed: Needed

    @property
    def nothing_needed(self) -> bool:
        """Whether there were causes and none is left."""
        return len(self.path.fits) > 1 and len(self.needed.fits) == 1

    @property
    def takes_a_part(self) -> bool:
        """Whether what is needed takes as much of the error of what was held out as a search that began anew must."""
        return self.needed.excess[-1] < (1.0 - A_PART) * self.needed.excess[0]


def _ended(m: Measurement, search: Search, flags: Faults, path: Path, tell: Callable[[str], None]) -> _Ended:
    prepared, flags, search, path = asked_again(m, search.prepared, flags, search, path)
    prepared, flags, search, path = hum_asked_again(m, prepared, flags, search, path)
    tell("predicting what was held out")
    return _Ended(prepared, flags, search, path, needed(prepared, path, search.believed))


def believed_structure(model: Model, prepared: Prepared) -> Structure:
    """The believed pad and its effects, to be refitted; the surface's doubt with it."""
    pad = PadNumbers(model.pad.physics(), prepared.depth_mm, prepared.force_scale_N)
    causes = []
    for entry in model.effects:
        if entry.id in CHANNEL:  # the detectors find it and take it out
            continue
        active = entry.active()
        causes.append(cause_of(active.effect, active.form, active.values))
    past_N = prepared.force_scale_N if prepared.pressed else 0.0
    run_s = float(np.ptp(prepared.full.time_s))
    doubts = prepared.doubt_mm, prepared.zero_N, past_N
    return Structure(pad, tuple(causes), *doubts, run_s, prepared.stamp_s)


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


def _units(m: Measurement, believed: Structure, refitted: Fit, ended: Fit) -> list[str]:
    """What makes the units doubtful: of the belief refitted, where that is so still with the causes that were found."""
    said = doubts(m, believed.pad.pad, refitted.pad)
    return said if doubts(m, believed.pad.pad, ended.pad) else []


def _concluded(m: Measurement, believed: Model, ended: _Ended, begun: float) -> Diagnosis:
    prepared, flags, search, path = ended.prepared, ended.flags, ended.search, ended.path
    whole, squares, excess, floor = ended.needed.whole, ended.needed.squares, ended.needed.excess, ended.needed.floor_N
    full, raw, at = prepared.full, prepared.raw, prepared.at
    before, after = (force_at(full, f.structure, f.x) for f in whole)
    known = {entry.id for entry in believed.effects}
    hum_N = prepared.hum_N * ("mains_hum" in known and prepared.mains is not None)
    before = before + hum_N
    residual = raw.force_N - after
    swing = _swinging(prepared, residual)
    if swing is not None:
        floor, squares, excess = _apart(prepared, swing, floor, squares, excess)
    tests = remains(prepared.judged, residual, whole[1].free, swing)
    told = [r for r in tests if r.passed]
    channel = [c for c in channel_causes(m, prepared, flags, before, whole[1]) if c.id not in known]
    if (len(excess) > 1 or channel) and not told:
        excess = seen(excess, floor)
    apart = sum(c.gain for c in channel)  # still in N²
    scale = excess[0] + apart
    if scale <= 0:
        scale = np.inf
    gains = [(a - b) / scale for a, b in zip(excess, excess[1:], strict=False)]
    causes = found(search, path, whole[1], gains)
    least = min(TOLD * scale, SPEAKS * floor**2)
    causes = joined(causes, [replace(c, gain=c.gain / scale) for c in channel if c.gain > least or by_themselves(c)])
    left = excess[-1] / scale if causes and np.isfinite(scale) else 1.0 - sum(c.gain for c in causes)
    if causes:
        verdict = "explained" if explains(left, causes, not search.reach.rich) else "unexplained"
    else:
        something = (told and speaks(excess[0], squares[0], floor)) or beyond_chance(full, residual)
        verdict = "unexplained" if something else "consistent"
    no_noise = of_the_motion(m, prepared.noise.force_N)
    if no_noise:
        verdict, causes = "unexplained", [replace(c, confidence=min(c.confidence, TOLD_ONCE)) for c in causes]
    held_out_N = float(np.sqrt(squares[0] + apart)), float(np.sqrt(squares[-1]))
    floor = min(float(np.sqrt(prepared.floor_N**2 - prepared.felt_floor_N**2)), floor)
    saturated = flags.saturated.copy()
    saturated[prepared.kept] |= beyond_limit(raw, whole[1])[at]
    saturated[prepared.kept] |= held_back(prepared, whole[1], flags)
    flags = replace(flags, saturated=saturated)
    if flags.outlier.sum() < FEW and all(c.id != "outliers" for c in causes):  # left out, but no fault of the channel
        flags = replace(flags, outlier=np.zeros_like(flags.outlier))
    flagged = flags.flagged[prepared.kept]
    inside = m.counted()[prepared.kept]
    good = raw.weight[at] > 0
    rmse = _errors_N(raw.force_N[at], (before[at], after[at]), inside, good)
    reported, where = as_reported(m)
    first_N, last_N = (force_at(reported, f.structure, f.x)[where][prepared.kept] for f in whole)
    other = _errors_N(raw.force_N[at], (first_N + hum_N[at], last_N), inside, good)
    rmse_before, rmse_after = rmse if serves(rmse[1], other[1]) else other  # as `bench.like` has it
    in_question = _units(m, search.believed, path.fits[0], whole[1])
    return Diagnosis(
        verdict=verdict,
        causes=causes,
        left=float(left),
        noise_floor=floor_told(*held_out_N, left, floor) if causes else floor,
        rmse_before=rmse_before,
        rmse_after=rmse_after,
        held_out_before=held_out_N[0],
        held_out_after=held_out_N[1],
        flagged_fraction=float(flagged.mean()),
        seconds=time.perf_counter() - begun,
        model_dict=model_of(believed, whole[1], prepared, flags.limit_N),
        notes=list(m.notes),
        doubts=[
            *in_question,
            *([] if SHAKING & (known | {c.id for c in causes}) else prepared.said_of_noise),
            *([MOTION_FOR_NOISE] if no_noise else []),
            *_past(search),
            *(hidden(swing.frequency_Hz, prepared.sample_s) if swing is not None else []),
            *(stays_bonded(search, path) if causes else []),
            *([ENDED_EARLY] if path.cut_short and verdict != "consistent" else []),
            *([FEW_TO_TELL.format(counted)] if (counted := np.count_nonzero(full.weight)) < FEWEST else []),
        ],
        in_question=in_question,
        remainders=tests,
        as_given=_as_given(prepared, search.believed, whole[0], rmse_before) if verdict == "consistent" else "",
        name=m.name,
        seen_once=any(most_sure(all_effects()[c.id], c.form, search.reach.rich) < 1.0 for c in causes),
        time_s=full.time_s[at],
        position_mm=full.position_mm[at],
        force_N=raw.force_N[at],
        before_N=before[at],
        after_N=after[at],
        sigma_N=full.total_N[at],
        flags={"saturation": flags.saturated, "stuck_samples": flags.stuck, "outliers": flags.outlier},
        counted=good,
        ranking=_ranking(path),
        rivals=[(t.id, model_of(believed, t.fit, prepared)) for t in (path.rivals[0][:RIVALS] if path.rivals else [])],
    )


def _errors_N(force_N: Array, models_N: tuple[Array, Array], inside: Mask, good: Mask) -> tuple[float, float]:
    """RMS errors of a force before and after: over all samples that count, and over those that are not flagged."""
    before, after = (force_N - models_N[0])[inside], (force_N - models_N[1])[good]
    return float(np.sqrt(np.mean(before**2))), float(np.sqrt(np.mean(after**2)))


def _as_given(prepared: Prepared, believed: Structure, refitted: Fit, left_N: float) -> str:
    """With the numbers as given, where the run's own, as its surface, serve them best."""
    raw, at = prepared.raw, prepared.at[prepared.raw.weight[prepared.at] > 0]
    given = placed(raw, replace(refitted, structure=believed, x=believed.x(believed.pad.x())))
    given_N = force_at(raw, believed, given.x)
    return as_given(believed.pad.pad, refitted.pad, float(np.sqrt(np.mean((raw.force_N - given_N)[at] ** 2))), left_N)


def _past(search: Search) -> list[str]:
    """That the run begins amid the pad's load, where it does and that leaves anything."""
    if not search.believed.modes_begun:
        return []
    full, first = search.prepared.raw, int(search.prepared.at[0])
    return [fitted_past(float(full.position_mm[first]), float(full.force_N[first]))]


def _swinging(prepared: Prepared, residual_N: Array) -> Swing | None:
    """What swings in what is left of the holds, where the motion has no part in it."""
    full, still = prepared.full, np.zeros(prepared.full.size, dtype=bool)
    for s in holds(full.time_s, full.position_mm):
        still[s.start : s.stop] = full.time_s[s] > full.time_s[s.start] + SETTLED_S
    at = prepared.at[(full.weight[prepared.at] > 0) & still[prepared.at]]
    if len(at) and np.mean(residual_N[at] ** 2) < NO_NOISE * prepared.noise.force_N**2:
        return None
    return swinging(full.time_s[at], residual_N[at], prepared.sample_s)


def _apart(
    prepared: Prepared, swing: Swing, floor_N: float, squares: list[float], excess: list[float]
) -> tuple[float, list[float], list[float]]:
    """Noise floor, N, held-out squares and their excesses over it, N², with what swings: as far as the holds took it
    for noise, and the line that was taken out before.

    Noise is no more than what stands beside the swing, and no less than the floor's own share of that.
    """
    line = 0.0
    if prepared.hum is not None and not prepared.hum.of_the_mains:
        line = 0.5 * prepared.hum.amplitude_N**2 * (1.0 + prepared.hum.ratio**2)
    noise = float(np.clip(swing.beside_N2, (1.0 - swing.share) * floor_N**2, floor_N**2))
    taken = floor_N**2 - noise + line
    return float(np.sqrt(noise)), [s + line for s in squares], [e + taken for e in excess]


def _ranking(path: Path) -> list[Alternative]:
    """What each candidate alone takes of what the best takes; none where that is no more than chance."""
    if not path.rivals or not path.evidence[0].significant:
        return []
    base = path.measures[0].before
    best = path.rivals[0][0].fit.chi2
    gained = max(base - best, 1e-12)
    return [
        Alternative(t.id, t.cause.form.name, max((base - t.fit.chi2) / gained, 0.0), t.fit.chi2 - best, False)
        for t in path.rivals[0]
    ]
