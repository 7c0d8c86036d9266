"""Plain sentences about what the data can and cannot tell."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field

import numpy as np

from bench.readings import ceiling
from bench.recording.types import Measurement

from ._kernel import Array
from .clocks import clocks_note
from .estimate import NOTHING, Estimate
from .motion import glanced, holds, turns
from .noise import MOTION_FOR_NOISE, Noise, of_the_motion
from .nuisance import late_s, moved_mm
from .past import begins_loaded, fitted_past, said_of_past
from .problem import Problem

TOO_FAR_APART = "The samples lie too far apart to tell their noise: it is no more than the error of this fit."
LEAST_WAY, CLEAR_WAY = 1e-3, 0.05  # of the depth: less is no motion that a law is told by; more is no encoder's noise

NEAR, LOADED, MUCH, OFTEN = (
    0.03,
    0.1,
    0.5,
    0.1,
)  # of the travel, above the surface; of the greatest force, pushed there,
# and either way; of the samples

LAW, SHARES, RATES = "law", "shares", "rates"
EVERYTHING = frozenset({LAW, SHARES, RATES})
OF = {"c": {SHARES}, "nu": {RATES}, "a": {RATES}, "b": {SHARES, RATES}}
"""Kinds of numbered parameters by their letter: c_i, nu_i, and a_i, b_i of a digital filter (13), whose poles are the
rates alone. All others, the law's own b among them, are the law's."""


@dataclass
class Findings:
    """Sentences about the data, and which kinds of numbers are none of the pad's for what they say."""

    notes: list[str] = field(default_factory=list)
    spoilt: set[str] = field(default_factory=set)
    still: bool = False
    """Whether nothing moves: the force tells rates, whatever the shares are."""

    def lost(self, names: Collection[str]) -> set[str]:
        """Those of a fit's numbers that are spoilt."""
        return {name for name in names if _kinds(name) & self.spoilt}


def _kinds(name: str) -> set[str]:
    letter, _, number = name.partition("_")
    return OF.get(letter, {LAW}) if number else {LAW}


def findings(problem: Problem, noise: Noise, unilateral: bool, pasts: bool = True) -> Findings:
    """What is wrong or missing in the data themselves, and which numbers that costs.

    `unilateral`: a pad that lets go shows no force in air. `pasts`: the method fits the state of a run that begins
    loaded; the others take it as at rest.
    """
    every = Findings(list(problem.notes))
    out = every.notes
    several = len(problem.measurements) > 1
    measurements = [glanced(m) for m in problem.measurements]
    for m in measurements:
        mine = _about(m, noise, unilateral, pasts)
        found = [*m.notes, *mine.notes]
        out += [f"{m.name}: {line}" for line in found] if several else found
        every.spoilt |= mine.spoilt
    speeds = np.concatenate([_move_speeds(m, problem.depth_mm) for m in measurements])
    if len(speeds) and speeds.max() < 1.5 * speeds.min():
        out.append(
            f"All moves are at one speed ({np.median(speeds):.3g} mm/s): what other speeds do rests on the model."
        )
    every.still = not any(_moves(m, noise) for m in measurements)
    if every.still:
        out.append(
            "The position does not move while the force counts: that shows how fast the force relaxes, and neither the"
            " elastic law nor the shares. (Is the position's column right?)"
        )
        every.spoilt |= {LAW, SHARES}
    if not noise.from_holds:
        out.append("There is no hold: the noise was judged from the motion, slow modes by the model alone.")
    if problem.depth_mm < 10 * noise.position_mm:
        out.append(
            "The depth is less than ten times the noise of the position: the elastic law cannot be told, and its"
            " numbers are none of the pad's."
        )
        every.spoilt.add(LAW)
    return every


def _moves(m: Measurement, noise: Noise) -> bool:
    """Whether the position does while the force counts: clearly, or by more than its noise and next to nothing."""
    position = m.position_at_forces_mm()[m.counted()]
    way, depth = float(np.ptp(position)), float(np.abs(position).max(initial=0.0))
    return way > CLEAR_WAY * depth or way > max(8 * noise.position_mm, LEAST_WAY * depth)


def _about(m: Measurement, noise: Noise, unilateral: bool, pasts: bool) -> Findings:
    every = Findings()
    out = every.notes
    force, depth = m.force_N, m.position_at_forces_mm()
    top = float(np.abs(force).max())
    deepest = depth > 0.7 * depth.max()
    if float(np.mean(force[deepest])) < -3 * noise.force_N:
        out.append(
            "The force is negative at depth: its sign is reversed (load cell `sign: -1`; of a CSV"
            " `--units force=-N`), or this is no pad pressed in."
        )
        every.spoilt |= EVERYTHING
    elif top < 10 * noise.force_N:
        out.append(f"The force ({top:.3g} N at most) is less than ten times its noise: no number is told well.")
    # a bonded pad that has relaxed pulls there, and less than it was pressed
    acts = (force > max(LOADED * top, 6 * noise.force_N)) | (np.abs(force) > max(MUCH * top, 6 * noise.force_N))
    outside = (depth < -NEAR * float(np.ptp(depth))) & acts
    if float(np.mean(outside)) > OFTEN:
        out.append(
            f"The force acts above the surface too ({100 * float(np.mean(outside)):.0f} % of the samples), where no law"
            " here bears anything. (Is 0 mm the surface, and is this a pad that is pressed in?)"
        )
    if of_the_motion(m, noise.force_N):
        out.append(MOTION_FOR_NOISE)
        every.spoilt |= EVERYTHING
    level = ceiling(force)
    if level is not None:
        out.append(
            f"The force stands at {level:.4g} N again and again, with nothing above: the channel is saturated there."
            " This costs the law at depth and all shares and rates: the cut-off peaks look like a pad that gives way."
        )
        every.spoilt |= EVERYTHING
    if line := clocks_note(m, noise):
        out.append(line)
        every.spoilt |= {LAW, RATES}
    loaded = begins_loaded(m, float(depth.max()), top, noise)
    out += _level_notes(m, depth, noise, top, unilateral, loaded, pasts)
    if loaded and not pasts:
        every.spoilt |= EVERYTHING
    if not loaded and deepest.any() and float(depth.max()) > 0:
        rising = np.flatnonzero(np.abs(force - _first_level(force, depth)) > max(8 * noise.force_N, 0.01 * top))
        start = depth[rising[0]] / depth.max() if len(rising) else 0.0
        if start > 0.5:
            out.append(
                f"The force rises only from {depth[rising[0]]:.4g} mm on: the surface may not be at 0 mm,"
                " where the model has it. A diagnosis tells by how much."
            )
    return every


def _first_level(force: Array, depth: Array) -> float:
    """Mean force before the motion begins, over at most 20 samples."""
    still = np.abs(depth[:20] - depth[0]) <= 0.0005 * np.ptp(depth)
    count = len(still) if still.all() else int(np.argmin(still))
    return float(np.mean(force[: max(count, 1)]))


def _level_notes(
    m: Measurement, depth: Array, noise: Noise, top: float, unilateral: bool, loaded: bool, pasts: bool
) -> list[str]:
    start, begun = _first_level(m.force_N, depth), float(depth[0])
    large = max(6 * noise.force_N, 0.01 * top)
    if loaded:
        if pasts:
            return [fitted_past(begun, start)]
        said = said_of_past(begun, start)
        return [said + "this method takes it as at rest: every number is off by that (`continuous` fits it)."]
    out = []
    air = depth < -0.002 * np.ptp(depth)
    if unilateral and int(air.sum()) >= 10:
        level = float(np.mean(m.force_N[air]))
        edge = max(int(air.sum()) // 5, 1)
        change = float(np.mean(m.force_N[air][-edge:]) - np.mean(m.force_N[air][:edge]))
        if abs(level) > max(noise.force_N, 0.003 * top) or abs(change) > max(noise.force_N, 0.003 * top):
            out.append(
                f"In air the force reads {level:.3g} N and changes by {change:+.3g} N over the run: tare or drift."
            )
    elif abs(start) > large:
        out.append(
            f"The force is {start:.3g} N before the probe has gone in: an offset, a preload, or stamps of force"
            " and position apart."
        )
    return out


def _move_speeds(m: Measurement, depth_mm: float) -> Array:
    """Mean speeds of the moves between holds and turning points that go a tenth of the depth or more, mm/s."""
    still = holds(m.position_time_s, m.position_mm)
    edges = [0, *(e for s in still for e in (s.start, s.stop - 1)), len(m.position_mm) - 1]
    out = []
    for a, b in zip(edges[::2], edges[1::2], strict=True):
        if b - a < 1:
            continue
        x, t = m.position_mm[a : b + 1], m.position_time_s[a : b + 1]
        ends = turns(x, 0.1 * depth_mm)
        for i, j in zip(ends[:-1], ends[1:], strict=True):
            if abs(x[j] - x[i]) >= 0.1 * depth_mm and t[j] > t[i]:
                # Middle half of the way: ends are acceleration, or a hold's first samples.
                low, high = sorted((x[i] + 0.25 * (x[j] - x[i]), x[i] + 0.75 * (x[j] - x[i])))
                inside = np.flatnonzero((x[i : j + 1] >= low) & (x[i : j + 1] <= high)) + i
                p, q = (inside[0], inside[-1]) if len(inside) > 1 else (i, j)
                if t[q] > t[p]:
                    out.append(abs(x[q] - x[p]) / (t[q] - t[p]))
    return np.array(out)


def about_fit(problem: Problem, estimate: Estimate) -> list[str]:
    """What the fit found at the edge of what the data can tell, and the range it was measured over."""
    out = []
    _, rates, weights = estimate.structure.split(estimate.x)
    step, span = problem.times()
    if weights.sum() <= NOTHING:
        out.append("No positive stiffness fits these data: every parameter is lost.")
        return out
    out += _doubts(problem, estimate)
    slow = [1 / nu for nu, a in zip(rates, weights[1:], strict=True) if a > 0 and 1 / nu > 0.5 * span]
    if slow:
        out.append(
            f"The slowest mode ({max(slow):.3g} s) is longer than half the run ({span:.3g} s): how far the force"
            " goes on falling is not known."
        )
    fast = [1 / nu for nu, a in zip(rates, weights[1:], strict=True) if a > 0 and 1 / nu < 3 * step]
    if fast:
        out.append(f"The fastest mode ({min(fast):.2g} s) is hardly longer than a sample ({step:.2g} s).")
    if problem.moves_rebuilt:
        out.append(
            "Fast moves were rebuilt between the samples: straight lines, as `simulate` has them, explain the force"
            " less well."
        )
    if not estimate.converged:
        out.append("The search did not converge.")
    out.append(
        f"Measured: times from {2 * step:.2g} s to {span:.3g} s, depths to {problem.depth_mm:.4g} mm."
        " Beyond that the model was not tried."
    )
    return out


def _doubts(problem: Problem, estimate: Estimate) -> list[str]:
    """Where the surfaces that touch-off left in doubt were put, and the stamps of polled positions."""
    theta, _, _ = estimate.structure.split(estimate.x)
    out = []
    for m, by, late in zip(problem.measurements, moved_mm(problem, theta), late_s(problem, theta), strict=True):
        if by:
            out.append(
                f"{m.name}: the surface was put {abs(1e3 * by):.1f} µm {'higher' if by > 0 else 'lower'} than touch-off"
                f" said (its own doubt: {1e3 * m.surface_std_mm:.1f} µm)."
            )
        if abs(late) > 0.5 * m.stamp_std_s:
            out.append(
                f"{m.name}: positions were taken to be {abs(1e3 * late):.2g} ms {'later' if late > 0 else 'earlier'}"
                f" than their stamps say (their own doubt: {1e3 * m.stamp_std_s:.2g} ms)."
            )
    return out
