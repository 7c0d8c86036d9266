"""What some data can tell of at all, and the numbers of a form kept within that."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sim.effects.base import Form, Parameter

from . import ripple
from .data import Data
from .numbers import Structure
from .way import on_the_way, shown_on_the_way

SHORTEST, SHORTEST_MOVING = 0.12, 0.03  # of the longest period
MOSTLY, NEARLY_ALL = 0.5, 0.8  # of the force samples, that are on the way; of the travel, that they show finely
LONGEST_PERIOD = 1.6  # of the travel
LONGEST_IN_PASSING = 0.35  # of the travel, where each depth is met once
BENDS_AT = (0.08, 0.14, 0.2, 0.28, 0.38, 0.5, 0.7)  # of the depth reached
MOVED_AT = tuple(k / 10 for k in range(1, 10))  # of the run, when something may have moved
RUBS = (0.02, 0.05, 0.1)  # of the depth reached, by which the load goes past a place before what it does there
TURNS = (0.2, 0.35, 0.6, 1.0, 1.6)  # of the depth reached, after which a width may repeat
FRESH = 0.9  # of the depth reached, beyond which a softening pad must go for the first time in the run
EVERY = tuple(0.1 * 1.1**k for k in range(24))  # of the run
COARSE = 500  # samples in which what the load changes is counted: in finer ones noise would count
LONGEST_REPORTED = 0.7  # of the depth, for errors of the position: longer ones are another elastic law


@dataclass(frozen=True)
class Reach:
    """What the data can tell of at all: spans of time and travel, and the finest sampling."""

    sample_s: float
    span_s: float
    travel_mm: float
    depth_mm: float
    force_N: float
    changes_N: float
    """All that the load changes, up and down, as a linear pad's would."""
    rich: bool = True
    """Whether depths are held, or passed again: what depends on the position alone differs there from a law, which
    relaxes. In one pass over the depth it is told only by many periods."""
    moving: bool = False
    """Whether there is no pad, or most forces were felt on the way, or some nearly all along it: then the moves show a
    ripple itself."""

    @classmethod
    def of(cls, data: Data, structure: Structure, sample_s: float, rich: bool = True) -> Reach:
        """That of some data, and of how deep a structure's pad is pressed there and how much it bears at the most."""
        depth_mm, force_N = structure.pad.depth_mm, structure.pad.force_N
        into_mm = np.maximum(data.position_mm[:: max(1, data.size // COARSE)], 0.0)
        return cls(
            sample_s=sample_s,
            span_s=float(data.time_s[-1] - data.time_s[0]),
            travel_mm=float(np.ptp(data.position_mm)),
            depth_mm=depth_mm,
            force_N=force_N,
            changes_N=max(float(np.sum(np.abs(np.diff(into_mm)))) * force_N / depth_mm, force_N),
            rich=rich,
            moving=structure.in_air or on_the_way(data) > MOSTLY or (rich and shown_on_the_way(data) > NEARLY_ALL),
        )


def narrowed(form: Form, reach: Reach) -> Form:
    """The form with its parameters kept within what the data can tell of, and started there."""
    longest_mm = _longest_mm(form, reach)
    return replace(form, parameters=tuple(_narrowed(p, reach, longest_mm) for p in form.parameters))


def _longest_mm(form: Form, reach: Reach) -> float:
    """The longest way after which a form can be seen to repeat."""
    way_mm, share = reach.travel_mm, LONGEST_PERIOD
    if "report" in form.blocks and reach.depth_mm > 0.1 * reach.travel_mm:  # in air no force shows it
        way_mm, share = reach.depth_mm, LONGEST_REPORTED
    return way_mm * (share if reach.rich else LONGEST_IN_PASSING)


def repeats_beyond(form: Form, reach: Reach) -> bool:
    """Whether a form repeats over a longer way at the least than these data go: a part of one wave is any curve."""
    if not ripple.ripples(form):
        return False
    period = next(p for p in form.parameters if p.name == "period")
    return period.lower >= _longest_mm(form, reach)


def with_periods(form: Form, from_mm: float, to_mm: float) -> Form:
    """The form with periods of this range."""
    return replace(
        form,
        parameters=tuple(
            _within(p, from_mm, to_mm, p.starts, p.if_left_out) if p.name == "period" else p for p in form.parameters
        ),
    )


def _narrowed(p: Parameter, reach: Reach, longest_mm: float) -> Parameter:
    lower, upper, starts, default = p.lower, p.upper, p.starts, p.if_left_out
    if p.unit == "1/s" and p.logarithmic:
        lower, upper = max(lower, 0.3 / reach.span_s), min(upper, 0.6 / reach.sample_s)
    elif p.unit == "Hz":
        lower, upper = max(lower, 2.0 / reach.span_s), min(upper, 0.9 / reach.sample_s)
    elif p.name == "window":  # corners of the motion are rebuilt between samples
        default = 0.1 * reach.sample_s
    elif p.name == "lasts":  # half of the time in which the load comes and goes once
        default = reach.span_s * reach.force_N / reach.changes_N
    elif p.unit == "s" and p.logarithmic:
        upper = min(upper, 3.0 * reach.span_s)
    elif p.name == "period":
        # some levels of depth are met by any ripple that is short enough
        shortest = SHORTEST_MOVING if reach.moving else SHORTEST
        lower, upper = max(lower, shortest * longest_mm), min(upper, longest_mm)
    elif p.name == "range":  # a pull beyond the widest gap is a bias; a pad may lag by half its depth
        upper = min(upper, reach.travel_mm - 0.5 * reach.depth_mm)
    elif p.name == "already":  # pressed before as deep as this run goes: then nothing softens in it, and it is a law
        upper = min(upper, FRESH * reach.depth_mm)
        starts = tuple(share * reach.depth_mm for share in (0.25, 0.5, 0.75)) if starts else ()
    elif p.name == "reach":
        default = reach.depth_mm
    elif p.name == "moved_at":
        upper = min(upper, reach.span_s)
        starts, default = tuple(share * reach.span_s for share in MOVED_AT), 0.5 * reach.span_s
    elif p.name == "every":  # a saw tooth that is a little too long is off by a whole one in the end
        starts, default = tuple(share * reach.span_s for share in EVERY), 0.3 * reach.span_s
        lower, upper = EVERY[0] * reach.span_s, reach.span_s
    elif p.name == "at_time":
        default = 0.5 * reach.span_s
    elif p.name == "bends_at":  # a rate that is another one but for a moment at the begin is a step
        lower, upper = 0.15 * reach.span_s, min(upper, 0.95 * reach.span_s)
        starts, default = tuple(share * reach.span_s for share in MOVED_AT[1:]), 0.5 * reach.span_s
    elif p.bend or p.name == "depth":  # of what goes over a longer way only the slope is told
        upper = min(upper, (0.5 if p.bend and p.name == "depth" else 1.0) * reach.depth_mm)
        starts = tuple(share * reach.depth_mm for share in BENDS_AT) if p.bend else starts
    elif p.name == "at_depth":
        default = 0.5 * reach.depth_mm
    elif p.name == "at_load":
        default = 0.5 * reach.force_N
    elif p.name == "at_swing":
        default = 0.03 * reach.force_N
    elif p.name == "at_change":
        default = 0.5 * reach.changes_N
    elif p.name == "at_travel":  # half of the travel in, which is half of all changes
        default = 0.25 * reach.changes_N * reach.depth_mm / reach.force_N
    elif p.name == "at_force":
        default = 0.6 * reach.force_N
    elif p.name == "limit" and p.unit == "N":
        starts = tuple(share * reach.force_N for share in (0.6, 0.8, 0.93, 0.985))
    elif p.name == "rubs" and p.unit == "mm":
        starts, default = tuple(share * reach.depth_mm for share in RUBS), RUBS[0] * reach.depth_mm
    elif p.name == "turn":  # worn where it is used, or once about after each turn of what drives it
        upper = min(upper, LONGEST_PERIOD * reach.depth_mm)
        starts = tuple(share * reach.depth_mm for share in TURNS)
    elif p.name == "preload":  # a joint that opens beyond all forces is none
        lower, upper = 0.02 * reach.force_N, reach.force_N
        starts = tuple(share * reach.force_N for share in (0.15, 0.3, 0.6))
    elif p.name == "slip_force":
        lower, upper = 0.005 * reach.force_N, reach.force_N
        starts = tuple(share * reach.force_N for share in (0.03, 0.1))
    return _within(p, lower, upper, starts, default)


def _within(p: Parameter, lower: float, upper: float, starts: Sequence[float], default: float) -> Parameter:
    """A parameter between other bounds, where there is anything between them."""
    lower, upper = max(lower, p.lower), min(upper, p.upper)  # beyond those no model file holds it
    if lower >= upper:
        return p
    starts = tuple(v for v in starts if lower <= v <= upper)
    default = min(max(default, lower), upper)
    typical = min(max(p.typical, lower), upper)
    return replace(p, lower=lower, upper=upper, starts=starts, default=default, typical=typical)
