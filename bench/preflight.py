"""Before anything moves: what the protocol will do on this bench to the pad as it is believed to be.

Two kinds of refusal. A contradiction can be read off the files (a speed beyond the bench's limit) and is the files'
fault; a prediction takes the pad model (a force beyond the limit) and is an answer: no.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from bench.config import Bench
from bench.errors import InputError, PadbenchError, Refused
from bench.places import Key
from bench.plan import Plan, Problem, Segment, plan
from bench.predict import LONGEST_S, Prediction, TooLong, predict
from bench.protocol import Approach, Protocol
from bench.rates import at_least, force_rate_Hz, motor_rate_Hz, stairs_mm

if TYPE_CHECKING:
    from sim.model import Model

Array = NDArray[np.float64]

TOLERANCE = 1e-9
STAIRS = 0.01
"""Of the longest way: steps of a streamed motion, from which they are worth a word."""

TARE_S = 2.0
"""Taken for the tare in air when bench time is estimated."""


@dataclass(frozen=True)
class Outcome:
    """What is expected of one segment: extremes of position (mm) and of force (N; NaN without a pad model)."""

    segment: Segment
    start_s: float
    duration_s: float
    deepest_mm: float
    highest_mm: float
    start_N: float
    peak_N: float
    least_N: float


@dataclass(frozen=True)
class Preflight:
    """What `check` found. `duration_s` counts from the end of the touch-off, `approach_s` is what tare, approach and
    the way back may take at most. `surface_mm` is the range of motor-frame heights of the surface for which the
    protocol stays within the travel; None in an air run."""

    protocol: Protocol
    plan: Plan
    prediction: Prediction
    problems: tuple[Problem, ...]
    outcomes: tuple[Outcome, ...]
    duration_s: float
    approach_s: float
    samples: dict[str, int]
    at_least: bool
    """Whether there may be more samples than that: a device is polled, and taken for as slow as it may be."""
    surface_mm: tuple[float, float] | None
    believed: bool

    @property
    def errors(self) -> tuple[Problem, ...]:
        """What refuses the run."""
        return tuple(p for p in self.problems if p.severity == "error")

    @property
    def notices(self) -> tuple[Problem, ...]:
        """What is only said."""
        return tuple(p for p in self.problems if p.severity == "notice")

    @property
    def ok(self) -> bool:
        """Nothing stands against the run."""
        return not self.errors

    def refusal(self) -> PadbenchError | None:
        """The errors as one exception: `InputError` where the files contradict, else `Refused`; None if all is well."""
        errors = sorted(self.errors, key=lambda p: p.kind != "contradiction")
        if not errors:
            return None
        first, others = errors[0], errors[1:]
        cure = "\n  ".join([line for line in (first.cure,) if line] + [f"also: {problem}" for problem in others[:5]])
        if first.kind == "contradiction":
            return InputError(self.protocol.place(first.path), str(first), cure)
        return Refused(f"{first}" + (f"\n  {cure}" if cure else ""))

    def lines(self, width: int = 100, *, errors: bool = True) -> list[str]:
        """The summary for a terminal, without colour; without `errors` where these are said otherwise."""
        from bench.preflight_text import render

        return render(self, width, errors=errors)


def check(
    protocol: Protocol,
    bench: Bench,
    believed: Model | None = None,
    *,
    surface_mm: float | None = None,
    latency_s: float | None = None,
    noise_N: float = 0.0,
) -> Preflight:
    """Plan the protocol, simulate it on the believed pad, and say what stands against it.

    `surface_mm` (motor frame) is the surface once it is known: travel is then checked exactly, before only its span.
    `latency_s` and `noise_N` as for `bench.plan.plan`. Raises `InputError` where the steps take more than a week.
    """
    if protocol.in_air:
        believed = None  # there is nothing for it to be
    planned = plan(protocol, bench, believed, latency_s=latency_s, noise_N=noise_N)
    try:
        prediction = predict(planned, believed)
    except TooLong as long:
        segment = planned.segments[long.index]
        what = f"{segment.name}: with this the steps take {long.total_s:.3g} s, more than a week ({LONGEST_S:g} s)"
        cure = "times are in seconds, speeds in mm/s: shorten it, or make several protocols"
        raise InputError(protocol.place(segment.path), what, cure) from None
    outcomes = _outcomes(prediction)
    problems = list(planned.problems)
    problems += _travel(planned, outcomes, surface_mm)
    problems += _unreached(prediction, outcomes)
    if believed is None and not planned.in_air:
        cure = "give the pad's model with --pad; for a pad that has none yet, begin with `first_contact`"
        problems.append(Problem("", "no pad model: forces are not predicted", "notice", cure=cure))
    elif believed is not None:
        problems += _forces(planned, outcomes)
    if bench.motor.orientation == "vertical" and bench.motor.safe_state == "release":
        message = "a vertical axis is let go in the safe state (motor.safe_state: release) and falls on the sample"
        problems.append(Problem("", message, "notice", cure="use hold or retract, unless a brake or spring carries it"))
    if bench.motor.driver == "orca" and bench.motor.safe_state != "release":
        message = (
            f"motor.safe_state {bench.motor.safe_state}: an Orca holds only while it is told to; its watchdog lets go "
            "when padbench has ended"
        )
        cure = "carry a vertical axis by a brake or a spring" if bench.motor.orientation == "vertical" else ""
        problems.append(Problem("", message, "notice", cure=cure))
    problems += _stairs(planned, bench, protocol.sampling.motor)
    duration_s = float(prediction.time_s[-1])
    approach_s = _approach_s(protocol, bench)
    total_s = duration_s + approach_s
    return Preflight(
        protocol=protocol,
        plan=planned,
        prediction=prediction,
        problems=tuple(problems),
        outcomes=outcomes,
        duration_s=duration_s,
        approach_s=approach_s,
        samples={
            "motor": round(total_s * motor_rate_Hz(bench, protocol.sampling.motor)),
            "load_cell": round(total_s * force_rate_Hz(bench, protocol.sampling.load_cell)),
        },
        at_least=at_least(bench, "motor") or at_least(bench, "load_cell"),
        surface_mm=None if planned.in_air else _surface_range(planned, outcomes),
        believed=believed is not None,
    )


def _stairs(planned: Plan, bench: Bench, asked_Hz: float | None) -> Iterator[Problem]:
    """A motor that is streamed so rarely that the pad feels each position by itself."""
    speeds = [s.speed_mm_s for s in planned.segments if math.isfinite(s.speed_mm_s)]
    depths = [abs(s.target_mm - s.start_mm) for s in planned.segments if math.isfinite(s.target_mm - s.start_mm)]
    fastest, way_mm = max(speeds, default=0.0), max(depths, default=math.inf)
    step_mm = stairs_mm(bench, fastest, asked_Hz)
    if step_mm > STAIRS * way_mm:
        every_ms = 1e3 / motor_rate_Hz(bench, asked_Hz)
        message = (
            f"the motor is told a position every {every_ms:.3g} ms: at {fastest:.3g} mm/s the pad feels stairs of "
            f"{step_mm:.2g} mm, which no sample shows: forces felt meanwhile cost nothing in a fit"
        )
        cure = "go slower, or set motor and bench file to 625 000 baud or more (docs/bench.md)"
        yield Problem("", message, "notice", cure=cure)


def _approach_s(protocol: Protocol, bench: Bench) -> float:
    lowest, highest = bench.limits.position
    if not isinstance(protocol.approach, Approach):
        return TARE_S
    return TARE_S + (highest - lowest + protocol.approach.retract) / protocol.approach.speed


def _outcomes(prediction: Prediction) -> tuple[Outcome, ...]:
    ends = np.searchsorted(prediction.segment, np.arange(len(prediction.segments)), side="right")
    begins = np.concatenate([[0], ends[:-1]])
    found = []
    for index, segment in enumerate(prediction.segments):
        start_s = float(prediction.starts_s[index])
        # A segment begins where the one before ended: that sample belongs to both.
        rows = slice(max(begins[index] - 1, 0), ends[index])
        position, force, time = prediction.position_mm[rows], prediction.force_N[rows], prediction.time_s[rows]
        found.append(
            Outcome(
                segment=segment,
                start_s=start_s,
                duration_s=float(time[-1]) - start_s,
                deepest_mm=float(position.max()),
                highest_mm=float(position.min()),
                # but its force is what the segment before has done
                start_N=float(force[0]),
                peak_N=float(force[1:].max()) if force.size > 1 else float(force[0]),
                least_N=float(force[1:].min()) if force.size > 1 else float(force[0]),
            )
        )
    return tuple(found)


def _worst(outcomes: Iterable[Outcome], key: Callable[[Outcome], float]) -> list[Outcome]:
    """The one with the greatest key of each step, however often a block repeats it."""
    worst: dict[tuple[Key, ...], Outcome] = {}
    for outcome in outcomes:
        path = outcome.segment.path
        if path not in worst or key(outcome) > key(worst[path]):
            worst[path] = outcome
    return list(worst.values())


def _forces(planned: Plan, outcomes: tuple[Outcome, ...]) -> Iterator[Problem]:
    """Steps that go beyond a limit; not those that only come back from there. What is no number is beyond each."""
    limits = planned.limits
    finite = [math.isfinite(o.peak_N) and math.isfinite(o.least_N) for o in outcomes]
    lost = [o for o, known in zip(outcomes, finite, strict=True) if not known]
    for outcome in _worst(lost, lambda o: o.deepest_mm):
        yield Problem(
            outcome.segment.name,
            f"the pad model gives no finite force at up to {outcome.deepest_mm:.3g} mm: nothing can be held to "
            f"limits.force {limits.force_N:g} N",
            kind="prediction",
            cure="the model's elastic law is far too steep for this motion: see that it is the pad's",
            path=outcome.segment.path,
        )
    outcomes = tuple(o for o, known in zip(outcomes, finite, strict=True) if known)
    pressed = (o for o in outcomes if o.peak_N > max(limits.force_N, o.start_N) + TOLERANCE)
    for outcome in _worst(pressed, lambda o: o.peak_N):
        segment = outcome.segment
        yield Problem(
            segment.name,
            f"{outcome.peak_N:.3g} N are expected, at up to {outcome.deepest_mm:.3g} mm: beyond limits.force "
            f"{limits.force_N:g} N",
            kind="prediction",
            cure="go less deep, or slower; raise the limit only if bench and sample stand it",
            path=segment.path,
        )
    pulled = (o for o in outcomes if o.least_N < min(-limits.tension_N, o.start_N) - TOLERANCE)
    for outcome in _worst(pulled, lambda o: -o.least_N):
        yield Problem(
            outcome.segment.name,
            f"a pull of {-outcome.least_N:.3g} N is expected, beyond limits.tension {limits.tension_N:g} N",
            kind="prediction",
            cure="come back slower, or less far",
            path=outcome.segment.path,
        )


def _unreached(prediction: Prediction, outcomes: tuple[Outcome, ...]) -> Iterator[Problem]:
    for index in prediction.unreached:
        outcome = outcomes[index]
        segment = outcome.segment
        if segment.kind == "force_hold":
            what = f"{segment.target_N:g} N held would creep to {outcome.deepest_mm:.3g} mm, all that is allowed"
        else:
            what = (
                f"{segment.target_N:g} N are not expected before {outcome.deepest_mm:.3g} mm, all that is allowed: "
                f"only {outcome.peak_N:.3g} N there"
            )
        cure = "lower the target, or raise limits.depth"
        yield Problem(segment.name, what, kind="prediction", cure=cure, path=segment.path)


def _travel(planned: Plan, outcomes: tuple[Outcome, ...], surface_mm: float | None) -> Iterator[Problem]:
    """Positions against the bench's travel; without a surface, whether any height of it would do."""
    lowest, highest = planned.limits.position_mm
    deepest, least = max(outcomes, key=lambda o: o.deepest_mm), min(outcomes, key=lambda o: o.highest_mm)
    zero = 0.0 if planned.in_air else surface_mm
    text = f"limits.position [{lowest:g}, {highest:g}]"
    if zero is None:
        way = max(deepest.deepest_mm, 0.0) - min(least.highest_mm, 0.0)
        if way > highest - lowest + TOLERANCE:
            name, path = deepest.segment.name, deepest.segment.path
            message = f"from {least.highest_mm:.3g} to {deepest.deepest_mm:.3g} mm is more than the bench's {text} has"
            yield Problem(name, message, cure="go less deep", path=path)
        return
    kind: Literal["contradiction", "prediction"] = "contradiction" if planned.in_air else "prediction"
    where = "" if planned.in_air else f" (surface at {zero:.4g} mm)"
    for outcome, at in ((deepest, zero + deepest.deepest_mm), (least, zero + least.highest_mm)):
        if not lowest - TOLERANCE <= at <= highest + TOLERANCE:
            message = f"goes to {at:.4g} mm in the motor frame{where}, beyond the bench's {text}"
            cure = "stay within it" if planned.in_air else "move the sample, or go less far"
            yield Problem(outcome.segment.name, message, kind=kind, cure=cure, path=outcome.segment.path)


def _surface_range(planned: Plan, outcomes: tuple[Outcome, ...]) -> tuple[float, float]:
    lowest, highest = planned.limits.position_mm
    # the surface itself is met from above, however far from it the steps keep
    highest_mm, deepest_mm = min(0.0, *(o.highest_mm for o in outcomes)), max(0.0, *(o.deepest_mm for o in outcomes))
    return lowest - highest_mm, highest - deepest_mm
