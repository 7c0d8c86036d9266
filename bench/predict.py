"""What a plan will look like in time: positions, and the force with which the believed pad answers.

Ramps and holds follow from the plan alone. Where a force ends a ramp, the pad model runs beside it, sample by sample,
under the run's own rule: the force is seen a latency late, then the axis brakes and holds where it stands. The
forces of the whole are then simulated once over the finished motion.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bench.plan import Plan, Segment
from bench.trajectory import Profile, braking_distance

if TYPE_CHECKING:
    from sim.model import Model
    from sim.pad import Plant

Array = NDArray[np.float64]

FINEST_S, COARSEST_S = 1e-3, 0.05
"""Grid of the prediction, as it is drawn: 1 kHz where it moves fast, coarser where little happens."""

FINE_MM = 0.002
GROWTH = 1.1
"""A hold's grid opens from the finest to the coarsest step by this factor: relaxation is fast at first."""

CREEP_STEP_S, CREEP_TIME_S = 0.01, 0.1
"""A held force is corrected so often, and approached with this time constant."""


@dataclass(frozen=True)
class Prediction:
    """Planned motion in the pad frame (motor frame in an air run) and expected force; arrays of shape (n,).

    `force_N` is NaN without a pad model. `segment` is the index of each sample's segment, `starts_s` when each
    segment begins, `segments` the plan's with their starts filled in. `unreached` are the indices of force ramps (and
    held forces) that came to the deepest or highest point allowed without getting there.
    """

    time_s: Array
    position_mm: Array
    force_N: Array
    segment: NDArray[np.int64]
    starts_s: Array
    segments: tuple[Segment, ...]
    unreached: tuple[int, ...]
    bounded: bool
    """A force target had no model to say where it ends; the deepest way allowed was taken."""


LONGEST_S = 7 * 86400.0
"""A protocol of more than a week is a mistake; its prediction alone would fill a computer."""


class TooLong(Exception):
    """A segment (`index` of the plan's) with which the steps take more than `LONGEST_S`: `total_s` at the least."""

    def __init__(self, index: int, total_s: float) -> None:
        super().__init__(f"{total_s:g} s")
        self.index, self.total_s = index, total_s


def predict(plan: Plan, believed: Model | None) -> Prediction:
    """Run the plan on the believed pad; without one, force targets go as deep as the limits allow.

    Raises `TooLong`.
    """
    return _Timeline(plan, believed).run()


def planned_motion(plan: Plan, believed: Model, finer: float) -> tuple[Array, Array]:
    """Times, s, and positions, mm (n,), of a plan on the believed pad, on a grid so many times as fine as is drawn.

    Raises `TooLong`.
    """
    timeline = _Timeline(plan, believed, finer)
    timeline.go()
    return timeline.motion


class _Timeline:
    def __init__(self, plan: Plan, believed: Model | None, finer: float = 1.0) -> None:
        self.plan, self.believed, self.finer = plan, believed, finer
        by_force = any(s.kind in ("force_ramp", "force_hold") for s in plan.segments)
        self.plant: Plant | None = believed.plant() if believed is not None and by_force else None
        self.times: list[Array] = [np.zeros(1)]
        self.positions: list[Array] = [np.array([plan.start_mm])]
        self.counts: list[int] = []
        self.now_s, self.at_mm, self.force_N = 0.0, plan.start_mm, 0.0
        self.unreached: list[int] = []
        self.bounded = False
        if self.plant is not None:
            self.force_N = self.plant.step(0.0, plan.start_mm)

    def go(self) -> tuple[list[float], list[Segment]]:
        """When each segment begins, and the segments with their starts filled in; times and positions with them."""
        starts, segments = [], []
        for index, segment in enumerate(self.plan.segments):
            starts.append(self.now_s)
            segments.append(replace(segment, start_mm=self.at_mm))
            before = len(self.times)
            self._add(index, segment)
            self.counts.append(sum(len(block) for block in self.times[before:]))
        return starts, segments

    @property
    def motion(self) -> tuple[Array, Array]:
        """Times and positions so far."""
        return np.concatenate(self.times), np.concatenate(self.positions)

    def run(self) -> Prediction:
        starts, segments = self.go()
        time, position = self.motion
        force = np.full(time.size, np.nan) if self.believed is None else self.believed.simulate(time, position)
        return Prediction(
            time_s=time,
            position_mm=position,
            force_N=force,
            segment=np.concatenate([[0], np.repeat(np.arange(len(segments)), self.counts)]),
            starts_s=np.array(starts),
            segments=tuple(segments),
            unreached=tuple(self.unreached),
            bounded=self.bounded,
        )

    def _add(self, index: int, segment: Segment) -> None:
        if segment.kind not in ("ramp", "force_ramp"):
            self._must_end(index, segment.duration_s)
        if segment.kind == "ramp":
            profile = segment.profile(self.at_mm)
            self._must_end(index, profile.duration_s)
            self._ramp(profile)
        elif segment.kind == "force_ramp":
            self._force_ramp(index, segment)
        elif segment.kind == "force_hold" and self.plant is not None:
            self._force_hold(index, segment, self.plant)
        else:
            self._append(*_hold(segment.duration_s, self.at_mm, self.finer))

    def _must_end(self, index: int, duration_s: float) -> None:
        """Before there is a grid for it."""
        total_s = self.now_s + duration_s
        if not total_s <= LONGEST_S:
            raise TooLong(index, total_s)

    def _append(self, offsets: Array, positions: Array) -> None:
        """Add samples at times after now; the streaming pad follows if there is one."""
        if offsets.size == 0:
            return
        if self.plant is not None:
            before = 0.0
            for offset, position in zip(offsets.tolist(), positions.tolist(), strict=True):
                self.force_N = self.plant.step(offset - before, position)
                before = offset
        self._note(offsets, positions)

    def _note(self, offsets: Array, positions: Array) -> None:
        self.times.append(self.now_s + offsets)
        self.positions.append(positions)
        self.now_s += float(offsets[-1])
        self.at_mm = float(positions[-1])

    def _ramp(self, profile: Profile) -> None:
        offsets = _ramp_grid(profile, self.finer)
        self._append(offsets, profile.position(offsets))

    def _force_ramp(self, index: int, segment: Segment) -> None:
        rising = self.believed is None or self.force_N < segment.target_N
        profile = segment.profile(self.at_mm, self.plan.deepest_mm if rising else self.plan.highest_mm)
        self._must_end(index, profile.duration_s)
        if self.plant is None:
            self.bounded = True
            self._ramp(profile)
            return
        grid = _ramp_grid(profile, self.finer)
        before, seen_s = 0.0, math.nan
        used = 0
        for offset, position in zip(grid.tolist(), profile.position(grid).tolist(), strict=True):
            if offset >= seen_s:
                break
            self.force_N = self.plant.step(offset - before, position)
            before, used = offset, used + 1
            if math.isnan(seen_s) and (self.force_N >= segment.target_N) == rising:
                seen_s = offset + self.plan.force_latency_s
        if used:
            self._note(grid[:used], profile.position(grid[:used]))
        if math.isnan(seen_s):
            self.unreached.append(index)
            return
        self._run_out(profile, before, seen_s)

    def _run_out(self, profile: Profile, last_s: float, seen_s: float) -> None:
        """From the last sample to the moment the force is seen, then braking to rest."""
        rest_s = min(seen_s, profile.duration_s) - last_s
        if rest_s > 0.0:
            self._append(np.array([rest_s]), np.array([profile.position(last_s + rest_s)]))
        speed = profile.velocity(seen_s)
        if speed == 0.0:
            return
        brake = profile.acceleration_mm_s2
        stop_s = abs(speed) / brake
        u = np.linspace(0.0, stop_s, 5)[1:]
        way = np.minimum(abs(speed) * u - brake * u * u / 2.0, braking_distance(speed, brake))
        self._append(u, self.at_mm + math.copysign(1.0, speed) * way)

    def _force_hold(self, index: int, segment: Segment, plant: Plant) -> None:
        steps = max(1, math.ceil(segment.duration_s / CREEP_STEP_S))
        dt = segment.duration_s / steps
        positions = np.empty(steps)
        stiffness = self._stiffness()
        at, bounded = self.at_mm, False
        for n in range(steps):
            speed = (segment.target_N - self.force_N) / (stiffness * CREEP_TIME_S)
            speed = max(-segment.speed_mm_s, min(segment.speed_mm_s, speed))
            wanted = at + speed * dt
            at = max(self.plan.highest_mm, min(self.plan.deepest_mm, wanted))
            bounded = bounded or at != wanted
            self.force_N = plant.step(dt, at)
            positions[n] = at
        if bounded:
            self.unreached.append(index)
        self._note(np.linspace(dt, segment.duration_s, steps), positions)

    def _stiffness(self) -> float:
        assert self.believed is not None
        law = self.believed.pad.law
        # Half a tenth of a millimetre into the pad at least: at the surface a law may have no stiffness.
        return max(float(law.stiffness(max(self.at_mm, 0.05))), 0.01)


def _ramp_grid(profile: Profile, finer: float) -> Array:
    """Times after the start, the end included; empty for a ramp of no length."""
    if profile.duration_s == 0.0:
        return np.empty(0)
    step = min(max(FINEST_S, FINE_MM / profile.peak_speed_mm_s), COARSEST_S)
    count = max(8, math.ceil(finer * profile.duration_s / step))
    return np.linspace(0.0, profile.duration_s, count + 1)[1:]


def _hold(duration_s: float, at_mm: float, finer: float) -> tuple[Array, Array]:
    if duration_s <= 0.0:
        return np.empty(0), np.empty(0)
    offsets: list[float] = []
    t, step, coarsest = 0.0, FINEST_S / finer, COARSEST_S / finer
    while t + 1.5 * step < duration_s and step < coarsest:
        t += step
        offsets.append(t)
        step *= GROWTH
    count = max(1, math.ceil((duration_s - t) / coarsest))
    grid = np.concatenate([offsets, np.linspace(t, duration_s, count + 1)[1:]])
    return grid, np.full(grid.size, at_mm)
