"""The planned motion: a protocol on a bench as ramps and holds, in order, with what cannot be made said beforehand.

All positions are in the pad frame. What a force target leads to is only known when the force is felt, so a segment
that follows one has no start yet: `Segment.profile(start_mm)` makes its ramp when the start is known.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal

from bench.config import Bench
from bench.places import Key
from bench.protocol import Approach, DepthStep, FlatStep, ForceStep, Protocol
from bench.rates import force_latency_s, made_speed_mm_s, speed_step_mm_s, streams, too_far_behind, too_rare
from bench.trajectory import Profile, braking_distance

if TYPE_CHECKING:
    from sim.model import Model

Phase = Literal["precondition", "steps", "finish"]
Kind = Literal["ramp", "hold", "force_ramp", "force_hold", "air"]

RISE_TO_ACCELERATION_S = 0.01
"""Jerk of an S-curve where none is given: full acceleration after this time."""

OVERSHOOT_SHARE = 0.05
"""How far past a force target the force may run before the motor has stopped, as a share of the target."""

UNKNOWN_STIFFNESS_N_mm = 50.0
"""Taken for a pad without a model: four times the stiffness of the paper's gel at 15 N (Table II: m + bF = 13 N/mm)."""

NAN = float("nan")


@dataclass(frozen=True)
class Problem:
    """Something that is to be said before anything moves.

    `severity`: "error" refuses the run, "notice" is only told. `kind`: "contradiction" where the files alone show it,
    "prediction" where it takes a simulation (or, for notices, neither). `path` is the place in the protocol file.
    """

    step: str
    message: str
    severity: Literal["error", "notice"] = "error"
    kind: Literal["contradiction", "prediction"] = "contradiction"
    cure: str = ""
    path: tuple[Key, ...] = ()

    def __str__(self) -> str:
        return f"{self.step}: {self.message}" if self.step else self.message


@dataclass(frozen=True)
class Segment:
    """One stretch of a run.

    `kind`: ramp (to `target_mm`), hold (position, `duration_s`), force_ramp (until `target_N`), force_hold (keep
    `target_N` for `duration_s`), air (a hold away from the pad). What does not apply is NaN. `start_mm` is NaN after
    a force target. `asked_mm_s` is the protocol's speed, `speed_mm_s` what is commanded: less on the way to a force
    where the force channel's latency forbids more. `path` is the step in the protocol file.
    """

    name: str
    phase: Phase
    kind: Kind
    path: tuple[Key, ...] = ()
    start_mm: float = NAN
    target_mm: float = NAN
    target_N: float = NAN
    speed_mm_s: float = NAN
    asked_mm_s: float = NAN
    acceleration_mm_s2: float = NAN
    jerk_mm_s3: float | None = None
    duration_s: float = NAN

    def profile(self, start_mm: float | None = None, end_mm: float | None = None) -> Profile:
        """The ramp of this segment; for a force ramp `end_mm` is where it ends unless the force stops it before."""
        return Profile(
            self.start_mm if start_mm is None else start_mm,
            self.target_mm if end_mm is None else end_mm,
            self.speed_mm_s,
            self.acceleration_mm_s2,
            self.jerk_mm_s3,
        )


@dataclass(frozen=True)
class PlanLimits:
    """What holds during the run: the tighter of protocol and bench. `depth_mm` is infinite where none is given."""

    force_N: float
    tension_N: float
    depth_mm: float
    position_mm: tuple[float, float]
    speed_mm_s: float
    acceleration_mm_s2: float


@dataclass(frozen=True)
class Plan:
    """Segments in order, from `start_mm` (pad frame: `approach.retract` above the surface; motor frame in an air run).

    `deepest_mm` is as deep as a force ramp may go in search of its force, `highest_mm` as far out.
    """

    protocol: str
    start_mm: float
    segments: tuple[Segment, ...]
    limits: PlanLimits
    in_air: bool
    deepest_mm: float
    highest_mm: float
    force_latency_s: float
    problems: tuple[Problem, ...] = field(default=())


def allowed_force_speed(
    target_N: float, stiffness_N_mm: float, latency_s: float, deceleration_mm_s2: float, noise_N: float = 0.0
) -> float:
    """Greatest speed (mm/s) at which a force target is overshot by no more than 5 % of it, or 3 sigma of the noise.

    Seen `latency_s` late and braked at `deceleration_mm_s2`, the axis runs on by v·latency + v²/2a, which the pad
    answers with its stiffness.
    """
    way_mm = max(OVERSHOOT_SHARE * abs(target_N), 3.0 * noise_N) / stiffness_N_mm
    # v²/2a + v·latency = way, in the form that is exact when the latency dominates.
    root = math.sqrt(latency_s * latency_s + 2.0 * way_mm / deceleration_mm_s2)
    return 2.0 * way_mm / (latency_s + root)


def plan(
    protocol: Protocol,
    bench: Bench,
    believed: Model | None = None,
    *,
    latency_s: float | None = None,
    noise_N: float = 0.0,
) -> Plan:
    """The protocol as segments on this bench; what the bench cannot do is in `problems`, nothing is clipped.

    `latency_s` is the force channel's, from the opened driver; by default it is estimated from the bench file.
    `noise_N` is the standard deviation of the force in air, where it has been measured.
    """
    return _Planner(protocol, bench, believed, latency_s, noise_N).plan()


class _Planner:
    def __init__(
        self, protocol: Protocol, bench: Bench, believed: Model | None, latency_s: float | None, noise_N: float
    ) -> None:
        self.protocol, self.bench, self.believed, self.noise_N = protocol, bench, believed, noise_N
        self.latency_s = force_latency_s(bench, protocol.sampling.load_cell) if latency_s is None else latency_s
        self.limits = effective_limits(protocol, bench)
        self.acceleration = protocol.acceleration or bench.limits.acceleration
        self.jerk: float | None = None
        if protocol.profile == "s_curve":
            jerk = self.acceleration / RISE_TO_ACCELERATION_S
            self.jerk = protocol.jerk or min(jerk, bench.limits.jerk or jerk)
        self.speed_step_mm_s = speed_step_mm_s(bench)
        self.problems: list[Problem] = []
        self.short: dict[float, list[tuple[str, float]]] = {}
        self.seen: set[tuple[tuple[Key, ...], str]] = set()
        approach = protocol.approach
        self.start_mm = -approach.retract if isinstance(approach, Approach) else 0.0
        self.at_mm = self.start_mm

    def plan(self) -> Plan:
        self._check_rates()
        segments = tuple(self._segments())
        self._check_dynamics()
        self._tell_short_ramps()
        lowest, highest = self.limits.position_mm
        depths = [s.target_mm for s in segments if not math.isnan(s.target_mm)] + [self.start_mm]
        deepest = min(self.limits.depth_mm, highest - lowest + self.start_mm)
        by_force = any(s.kind == "force_ramp" for s in segments)
        return Plan(
            protocol=self.protocol.name,
            start_mm=self.start_mm,
            segments=segments,
            limits=self.limits,
            in_air=self.protocol.in_air,
            deepest_mm=deepest if by_force else max(depths),
            highest_mm=min(depths),
            force_latency_s=self.latency_s,
            problems=tuple(self.problems),
        )

    def _segments(self) -> Iterator[Segment]:
        before, finish = self.protocol.precondition, self.protocol.finish
        if before is not None:
            for k in range(before.cycles):
                name = f"precondition[{k}]"
                yield self._ramp(name, "precondition", ("precondition",), before.to, before.speed)
                yield self._ramp(name, "precondition", ("precondition",), self.start_mm, before.speed)
            if before.rest:
                yield self._still("precondition", "precondition", "hold", ("precondition",), before.rest, self.at_mm)
        for flat in self.protocol.flatten():
            yield from self._step(flat, flat.step)
        out = -finish.retract if not self.protocol.in_air else self.start_mm
        # The default speed of leaving is ours, not asked for: it bows to the bench's limit.
        speed = finish.speed if "speed" in finish.model_fields_set else min(finish.speed, self.limits.speed_mm_s)
        yield self._ramp("finish", "finish", ("finish",), out, speed)
        yield self._still("finish", "finish", "air", ("finish",), finish.air, out)

    def _step(self, flat: FlatStep, step: DepthStep | ForceStep) -> Iterator[Segment]:
        if isinstance(step, DepthStep):
            yield self._ramp(flat.name, "steps", flat.path, step.to, step.speed)
            if step.hold:
                yield self._still(flat.name, "steps", "hold", flat.path, step.hold, step.to)
            return
        speed = self._force_speed(flat, step)
        ramp = self._ramp(flat.name, "steps", flat.path, NAN, step.speed)
        yield replace(ramp, kind="force_ramp", target_N=step.to_force, speed_mm_s=speed)
        if step.hold and step.hold_mode == "force":
            hold = self._still(flat.name, "steps", "force_hold", flat.path, step.hold, NAN)
            yield replace(hold, target_N=step.to_force, speed_mm_s=speed, acceleration_mm_s2=self.acceleration)
        elif step.hold:
            yield self._still(flat.name, "steps", "hold", flat.path, step.hold, NAN)

    def _ramp(self, name: str, phase: Phase, path: tuple[Key, ...], to: float, speed: float) -> Segment:
        start, self.at_mm = self.at_mm, to
        self._check_speed(name, (*path, "speed"), speed)
        made = self._made(name, (*path, "speed"), speed)
        segment = Segment(name, phase, "ramp", path, start, to, NAN, made, speed, self.acceleration, self.jerk)
        if not math.isnan(start) and not math.isnan(to) and start != to:
            reached = segment.profile().peak_speed_mm_s
            self._check_following(name, (*path, "speed"), reached)
            if reached < made * (1 - 1e-9):
                self.short.setdefault(speed, []).append((name, reached))
        return segment

    @staticmethod
    def _still(name: str, phase: Phase, kind: Kind, path: tuple[Key, ...], duration_s: float, at_mm: float) -> Segment:
        return Segment(name, phase, kind, path, at_mm, at_mm, duration_s=duration_s)

    def _force_speed(self, flat: FlatStep, step: ForceStep) -> float:
        if step.to_force > self.bench.limits.force:
            message = f"to_force: {step.to_force:g} N is beyond the bench's limits.force {self.bench.limits.force:g} N"
            self._once(flat.name, message, (*flat.path, "to_force"), "lower the target")
        stiffness = stiffness_at(self.believed, step.to_force)
        known = stiffness is not None
        allowed = allowed_force_speed(
            step.to_force, stiffness or UNKNOWN_STIFFNESS_N_mm, self.latency_s, self.acceleration, self.noise_N
        )
        slowest = self.speed_step_mm_s
        if allowed >= step.speed:
            return made_speed_mm_s(step.speed, slowest)
        pad = f"{stiffness:.3g} N/mm" if known else f"{UNKNOWN_STIFFNESS_N_mm:g} N/mm (taken for want of a model)"
        message = (
            f"approaches {step.to_force:g} N at {allowed:.3g} mm/s, not at the {step.speed:g} mm/s asked for: seen "
            f"{self.latency_s * 1e3:.3g} ms late, a pad of {pad} would be over the target by more than "
            f"{OVERSHOOT_SHARE:.0%}"
        )
        if allowed < slowest:
            over_N = (stiffness or UNKNOWN_STIFFNESS_N_mm) * slowest * self.latency_s
            allowed = slowest
            message = (
                f"approaches {step.to_force:g} N at {slowest:g} mm/s, the slowest of this motor: a pad of {pad} may be "
                f"over the target by {over_N:.2g} N, more than {OVERSHOOT_SHARE:.0%} of it"
            )
        elif slowest:
            allowed = math.floor(allowed / slowest * (1 + 1e-9)) * slowest
        self._once(flat.name, message, (*flat.path, "speed"), severity="notice")
        return allowed

    def _made(self, name: str, path: tuple[Key, ...], speed: float) -> float:
        """The speed that the motor makes of the one asked for, which is said where it is another."""
        made = made_speed_mm_s(speed, self.speed_step_mm_s)
        if speed < 0.5 * self.speed_step_mm_s:
            message = f"speed: {speed:g} mm/s is less than this motor makes: its slowest is {made:g} mm/s"
            self._once(name, message, path, "move faster, or use a motor that is streamed")
        elif abs(made - speed) > 1e-3 * speed:
            message = (
                f"moves at {made:g} mm/s, not at {speed:g}: this motor counts speeds in {self.speed_step_mm_s:g} mm/s"
            )
            self._once(name, message, path, severity="notice")
        return made

    def _check_speed(self, name: str, path: tuple[Key, ...], speed: float) -> None:
        if speed > self.limits.speed_mm_s:
            message = f"speed: {speed:g} mm/s is beyond {self._owner('speed')} {self.limits.speed_mm_s:g} mm/s"
            self._once(name, message, path, "lower the speed")

    def _check_dynamics(self) -> None:
        approach, limits = self.protocol.approach, self.bench.limits
        if isinstance(approach, Approach):
            self._check_speed("approach", ("approach", "speed"), approach.speed)
            way = approach.speed * self.latency_s + braking_distance(approach.speed, self.acceleration)
            force = approach.force + UNKNOWN_STIFFNESS_N_mm * way
            if approach.force >= limits.force:
                message = f"force: {approach.force:g} N is not under the bench's limits.force {limits.force:g} N"
                self._once("approach", message, ("approach", "force"), "lower it")
            elif force > self.limits.force_N:
                message = (
                    f"speed: at {approach.speed:g} mm/s a stiff sample ({UNKNOWN_STIFFNESS_N_mm:g} N/mm) is touched "
                    f"with {force:.3g} N before the axis has stopped, beyond {self.limits.force_N:g} N"
                )
                self._once("approach", message, ("approach", "speed"), "approach slower")
        if self.acceleration > self.limits.acceleration_mm_s2:
            most = self.limits.acceleration_mm_s2
            message = f"{self.acceleration:g} mm/s² is beyond {self._owner('acceleration')} {most:g} mm/s²"
            self._once("acceleration", message, ("acceleration",), "lower the acceleration")
        if self.jerk is not None and limits.jerk is not None and self.jerk > limits.jerk:
            message = f"{self.jerk:g} mm/s³ is beyond the bench's limits.jerk {limits.jerk:g} mm/s³"
            self._once("jerk", message, ("jerk",), "lower the jerk")
        if self.jerk is not None and not streams(self.bench):
            message = f"s_curve needs a motor that is streamed; `{self.bench.motor.driver}` makes its own trapezoids"
            self._once("profile", message, ("profile",), "use `profile: trapezoid` on this bench")

    def _check_rates(self) -> None:
        for device in ("motor", "load_cell"):
            found = too_rare(self.bench, device, getattr(self.protocol.sampling, device))
            if found:
                self._once("sampling", found, ("sampling", device), "raise it here, or in the bench file")

    def _check_following(self, name: str, path: tuple[Key, ...], speed_mm_s: float) -> None:
        found = too_far_behind(self.bench, speed_mm_s, self.protocol.sampling.motor)
        if found:
            self._once(name, f"speed: {found}", path, "go slower, or raise the motor's baud rate and rate")

    def _owner(self, what: str) -> str:
        most, limit = getattr(self.bench.motor, f"max_{what}"), getattr(self.bench.limits, what)
        return f"motor.max_{what}" if most is not None and most < limit else f"the bench's limits.{what}"

    def _tell_short_ramps(self) -> None:
        for speed, ramps in self.short.items():
            least, most = min(reached for _, reached in ramps), max(reached for _, reached in ramps)
            reached = f"{least:.3g}" if most - least < 0.05 else f"{least:.3g} to {most:.3g}"
            message = (
                f"reaches {reached} of {speed:g} mm/s: the way is too short for more at {self.acceleration:g} mm/s²"
            )
            self.problems.append(Problem(_listed([name for name, _ in ramps]), message, "notice"))

    def _once(
        self,
        name: str,
        message: str,
        path: tuple[Key, ...],
        cure: str = "",
        severity: Literal["error", "notice"] = "error",
    ) -> None:
        """One word for one place in the file, however often a block repeats it."""
        if (path, message) not in self.seen:
            self.seen.add((path, message))
            self.problems.append(Problem(name, message, severity, "contradiction", cure, path))


def effective_limits(protocol: Protocol, bench: Bench) -> PlanLimits:
    """The tighter of protocol and bench, and of what the motor can do."""
    limits, motor = bench.limits, bench.motor
    return PlanLimits(
        force_N=min(limits.force, protocol.limits.force or math.inf),
        tension_N=limits.tension,
        depth_mm=protocol.limits.depth or math.inf,
        position_mm=limits.position,
        speed_mm_s=min(limits.speed, motor.max_speed or math.inf),
        acceleration_mm_s2=min(limits.acceleration, motor.max_acceleration or math.inf),
    )


def stiffness_at(believed: Model | None, force_N: float) -> float | None:
    """Stiffness (N/mm) of the believed pad where a slow ramp feels `force_N`; None where the model cannot say.

    At a force held long enough the elastic response stands at force / c_0, deeper in: that stiffness is the most.
    """
    if believed is None:
        return None
    law, relaxation = believed.pad.law, believed.pad.relaxation
    longest = max(1.0 - float(sum(relaxation.shares)), 0.2)
    depth = float(law.depth_at(force_N / longest))
    stiffness = float(law.stiffness(depth)) if math.isfinite(depth) and depth > 0 else 0.0
    return stiffness if math.isfinite(stiffness) and stiffness > 0 else None


def _listed(names: list[str]) -> str:
    unique = list(dict.fromkeys(names))
    return ", ".join(unique) if len(unique) <= 3 else f"{unique[0]}, {unique[1]} … {unique[-1]} ({len(unique)} ramps)"
