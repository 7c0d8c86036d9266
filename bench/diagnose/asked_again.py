"""Faults of the channel, asked again once there is a model: what stands off it, and what stays while it goes on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bench.identify.motion import holds
from bench.readings import resolution, runs
from bench.recording.types import Measurement

from .channel import FEW, Faults, far, not_of_the_motion, of_the_model, resting, standing_off, strays
from .data import Prepared, prepare
from .noise import least_N
from .path import Path
from .pulses import pulses
from .refit import Fit, force_at, onto
from .search import Search

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

NEAR = 1.5  # times the noise, within which a model is right enough to judge single samples
STRAYS = 0.25  # of the holds: so many samples that stand off beside others that do are no transients
AGAIN = 3  # samples of one value that a force on its way does not have
GONE = 2  # samples of them by which it has: one alone may be late
JUMP = 0.5  # of the way a force has gone while its channel stayed
LEAST = 20.0  # times the least noise, that a stray is off by where there is none: moments of contact stand off too
SMEARS_S = 1e-3  # by which stamps wander off an even clock: a twentieth of a wave of the mains
MORE = 1.1  # times the power of the hum that the stamps tell
STEPS, DEVIATIONS = 2.0, 8.0  # of the channel, and of its noise: so far a force has gone that shows none of it


def with_pulses(m: Measurement, flags: Faults) -> Faults:
    """With the pulses of a channel that has some in holds, where nothing else makes it rise at once and go back."""
    pulsed = pulses(m.force_N, ~flags.by_itself, resolution(m.force_N))
    return replace(flags, outlier=flags.outlier | _in_holds_too(resting(m), pulsed))


def _in_holds_too(at_rest: Mask, pulsed: Mask) -> Mask:
    """Pulses of a channel that has some in holds; else none: in moves alone, the motion may have made them."""
    return pulsed if (pulsed & at_rest).sum() >= FEW else np.zeros_like(pulsed)


def halted(force_N: Array, modelled_N: Array, but: Mask, noise_N: float) -> Mask:
    """Samples (m,) that say the one before again, in runs in which the force has gone on. `but`: those that are known
    to be at fault. The model need not be right: where a force goes on less than it says, it does so afterwards too, but
    a channel that stayed jumps to where the force has gone.

    A coarse channel repeats itself at rest, and not on its way; what is at an end of it may be at a ceiling.
    """
    first, length = runs(force_N)
    step_N, ends = resolution(force_N), (force_N.min(), force_N.max())
    far = STEPS * step_N + DEVIATIONS * noise_N
    out = np.zeros(len(force_N), dtype=bool)
    for begin, count in zip(first[length >= AGAIN].tolist(), length[length >= AGAIN].tolist(), strict=True):
        run = slice(begin, begin + count)
        way_N = float(np.ptp(modelled_N[run]))
        left = np.abs(modelled_N[run] - modelled_N[begin]) > far
        jump_N = float(abs(force_N[min(begin + count, len(force_N) - 1)] - force_N[begin]))
        if left.sum() >= GONE and jump_N > JUMP * way_N and force_N[begin] not in ends and not but[run].any():
            # on its way a force is within a step for some samples before; half of them, on the average, are of this run
            passing = int(0.5 * count * step_N / way_N)
            out[begin + 1 + passing : begin + count] = True
    return out


def _left(m: Measurement, prepared: Prepared, fit: Fit) -> tuple[Array, Array]:
    """What a fit leaves of each force sample (m,), nan where that was not fitted; and its force there, N. Less is left
    where errors of the positions make much, as much less as they make the noise larger: there is the motion astray. So
    it is where the noise is loud, and more where it is not."""
    full, at = prepared.full, prepared.at
    errors, modelled = np.full(len(m.force_N), np.nan), m.force_N.copy()
    force_N = force_at(full, fit.structure, fit.x)
    modelled[prepared.kept], noise_N = force_N[at], prepared.noise_N(force_N)[at]
    surely = prepared.noise.force_N / np.hypot(noise_N, prepared.felt.total_N[at])
    errors[prepared.kept] = surely * (full.force_N[at] - modelled[prepared.kept])
    return errors, modelled


def _left_by_the_rest(m: Measurement, prepared: Prepared, flags: Faults, fit: Fit) -> tuple[Array, Array]:
    """The same; of the fit without samples that are strays for all that it can tell, where many have pulled it away."""
    errors, modelled = _left(m, prepared, fit)
    known = np.isfinite(errors) & flags.good
    off = standing_off(np.where(known, errors, 0.0), known, _unsure(flags), resolution(m.force_N))
    off = (off if strays(m, errors, off) else np.zeros_like(off)) | _in_crowds(m, errors, known)
    if not off.any():
        return errors, modelled
    return _left(m, prepared, onto(fit, prepare(m, flags.good & ~off).doubting(prepared.felt).short, 15, 1e-8))


def _in_crowds(m: Measurement, errors: Array, known: Mask) -> Mask:
    """Samples (m,) beyond what all others foretell, where they are strays: crowded so that hardly one is right among
    its neighbours, these tell nothing, as where a motor's switching comes through. Else none."""
    off = known & (np.abs(errors) > far(errors[known])) if known.any() else known
    return off if strays(m, errors, off) else np.zeros_like(known)


def asked_again(
    m: Measurement, prepared: Prepared, flags: Faults, search: Search, path: Path, first: bool = False
) -> tuple[Prepared, Faults, Search, Path]:
    """Channel faults against the model found; where that changes which samples count, the fits are carried on. `first`:
    the model is the belief alone, and strays are asked for only where some are known."""
    errors, modelled = _left_by_the_rest(m, prepared, flags, path.fits[-1])
    stays = halted(m.force_N, modelled, flags.by_itself | ~np.isfinite(errors), prepared.noise.force_N)
    before, flags = flags, replace(flags, stuck=flags.stuck | stays, outlier=flags.outlier & ~stays)
    known = np.isfinite(errors) & ~flags.by_itself
    if not first or flags.outlier.any() or flags.unsure is not None:
        flags = _strays_again(m, prepared, flags, errors, modelled, known)
    if np.array_equal(flags.good, before.good):
        return prepared, before, search, path
    return _carried_on(prepare(m, flags.good), prepared, flags, search, path)


def hum_asked_again(
    m: Measurement, prepared: Prepared, flags: Faults, search: Search, path: Path
) -> tuple[Prepared, Faults, Search, Path]:
    """Hum that is steady by the times at which the forces were felt, and not by their stamps, taken out as well."""
    last = path.fits[-1]
    plant = last.structure.cascade(last.x)
    if not plant.shifts_time:
        return prepared, flags, search, path
    shift_s = plant.felt_at(m.force_time_s) - m.force_time_s
    even = np.polyval(np.polyfit(m.force_time_s, shift_s, 1), m.force_time_s)
    if np.std(shift_s - even) < SMEARS_S:
        return prepared, flags, search, path
    anew = prepare(m, flags.good, plant.felt_at)
    if anew.mains is None or np.sum(anew.hum_N**2) < MORE * np.sum(prepared.hum_N**2):
        return prepared, flags, search, path
    return _carried_on(anew, prepared, flags, search, path)


def _carried_on(
    anew: Prepared, before: Prepared, flags: Faults, search: Search, path: Path
) -> tuple[Prepared, Faults, Search, Path]:
    """A search's fits on data that were prepared anew."""
    anew = anew.doubting(before.felt)
    prepared = anew.white() if before.memory == 1.0 else anew
    again = Search(prepared, search.believed, search.progress, search.known)
    return prepared, flags, again, replace(path, fits=[onto(f, prepared.short, 15, 1e-8) for f in path.fits])


def _unsure(flags: Faults) -> Mask:
    """Samples that stand off in moves, and may be strays."""
    return np.zeros_like(flags.outlier) if flags.unsure is None else flags.unsure


def _strays_again(
    m: Measurement, prepared: Prepared, flags: Faults, errors: Array, modelled: Array, known: Mask
) -> Faults:
    """The flags with the samples that stand off the model.

    Samples that stand off in moves are strays, and no transients, where the model is right about those beside them.
    So are a few more of a channel that has strays, for transients come with most moves; and more than a few that are
    not as the motion is.
    """
    unsure = _unsure(flags)
    suspect, at_rest = flags.outlier | unsure, resting(m)
    told = np.where(np.isfinite(errors), errors, 0.0)
    step_N = resolution(m.force_N)
    outlier = standing_off(told, known, suspect, step_N)
    outlier &= ~of_the_model(modelled, errors, outlier)
    pulsed = _in_holds_too(at_rest, pulses(told, known, step_N))
    outlier |= pulsed | _in_crowds(m, errors, known)
    if prepared.noise.force_N <= least_N(m):
        outlier &= np.abs(told) > LEAST * least_N(m)
    if outlier.sum() < FEW and not suspect.any():
        outlier &= at_rest  # one or two in moves, in a channel without strays, are at the motion's corners
    if np.array_equal(outlier, flags.outlier):
        return flags
    further, rest = outlier & ~suspect, known & ~suspect
    few = STRAYS * len(holds(m.position_time_s, m.position_mm))
    if (flags.outlier.any() and further.sum() <= few) or strays(m, errors, further | unsure):
        rest &= ~further
    if strays(m, errors, outlier & ~at_rest):  # where they crowd, some show only once the others are gone
        crowded = standing_off(told, known & ~outlier, suspect, step_N)
        outlier |= crowded
        rest &= ~crowded
    rest &= ~(pulsed | further & at_rest)  # what stands off alone in a hold is no transient, whatever the model is
    near = (NEAR * prepared.floor_N) ** 2
    if not rest.any() or float(np.mean(errors[rest] ** 2)) > near:
        return flags  # against a wrong model transients look like outliers
    flags = replace(flags, outlier=outlier, unsure=None)
    moving = known & ~at_rest
    beside = moving & ~outlier
    if not beside.any() or float(np.mean(errors[beside] ** 2)) > near or not strays(m, errors, outlier & moving):
        flags = not_of_the_motion(m, flags)
    return flags
