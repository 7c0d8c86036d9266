"""How a run is stopped before its end.

Softly: the axis decelerates, then backs out of the pad along the way it came, as long as the force falls on it. Hard:
the device's own stop and safe state at once, with no motion of our making. Hard is for a motor that cannot be trusted
with a motion (a fault, a following error, silence), and for an operator who strikes again.

The way out ends at the approach's retract above the surface; at the surface itself where there is no force to go by;
and where the pad begins to pull, which a bonded or sticky one does. Before a surface is known it ends where the tare
was taken: that was air. Before the tare nothing is known, and nothing moves.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from bench.errors import PadbenchError
from bench.protocol import Approach
from bench.run.loop import Script
from drivers.errors import DriverError

if TYPE_CHECKING:
    from bench.run.script import Run

STOP_PATIENCE_S = 1.0
"""How long a stopping axis is waited for before the safe state is applied all the same."""

RETRACT_MM_S = 5.0
"""Speed of the way out."""

RETRACT_PATIENCE_S = 10.0
RISE_SHARE, RISE_SIGMAS = 0.05, 10.0
"""So much more than the least force met on the way out, as a share of the limit, is a force that rises."""

TURNING_S = 0.05
"""The axis lags behind its command and the force behind the axis: for so long it may still rise."""

PULL_N, PULL_SIGMAS = 0.1, 5.0
"""So much less than the tare, at least, is a pull."""


class Stopping:
    """The end of a run that was stopped; `stop` is the script."""

    def __init__(self, run: Run) -> None:
        self.run = run
        self.loop = run.loop
        self.clock = run.clock
        self._strikes = self.loop.operator.strikes

    def stop(self) -> Script[None]:
        """Whatever fails here is noted, and the next thing is done all the same."""
        run, loop = self.run, self.loop
        why = self._why_hard()
        if loop.axis.live and why is None:
            loop.axis.clear_queue()
            loop.axis.halt(run.bench.limits.acceleration)
            yield from self._while_soft(self._brake_and_leave())
            why = self._why_hard()
        loop.axis.clear_queue()
        loop.sink.event(self.clock.now(), "stop", {"manner": "soft" if why is None else "hard", "why": why or ""})
        try:
            yield from run.make_safe()
        except DriverError as error:
            run.found.not_safe = str(error)
            loop.sink.event(self.clock.now(), "safe_state_failed", {"message": str(error)})
            yield from run.quieten()

    # -- soft or hard ------------------------------------------------------------------------------------------

    def _why_hard(self) -> str | None:
        """Why nothing may be planned any more, if so."""
        loop = self.loop
        if loop.rig.motor.link.broken is not None:
            return "the motor cannot be reached"
        if loop.monitor.motor_lost:
            return "the motor is not to be trusted with a motion"
        if loop.operator.strikes > min(1, self._strikes):
            return "the operator stopped it again"
        return None

    def _while_soft(self, script: Script[None]) -> Script[None]:
        """The script until it ends, or until it is to be harder; what fails in it ends it and is noted."""
        try:
            for _ in script:
                if self._why_hard() is not None:
                    return
                yield
        except (DriverError, PadbenchError) as error:
            self.loop.sink.event(self.clock.now(), "stop_incomplete", {"message": str(error)})

    def _brake_and_leave(self) -> Script[None]:
        give_up = self.clock.now() + STOP_PATIENCE_S
        while not self.loop.axis.ended(self.clock.now()) and self.clock.now() < give_up:
            yield
        yield from self._retreat()

    # -- the way out -------------------------------------------------------------------------------------------

    def _retreat(self) -> Script[None]:
        """Out of the pad, slowly, while the force falls."""
        run, loop, mover = self.run, self.loop, self.run.mover
        if loop.axis.motor.kind == "move":
            yield from mover.settle()
        blind = self._blind()
        target = self._target_mm(blind)
        if target is None or target > mover.here() - 1e-3:
            return
        sigma = run.found.air.sigma_N if run.found.air is not None else 0.0
        rise = max(RISE_SHARE * loop.monitor.envelope.force_N, RISE_SIGMAS * sigma)
        pull = max(PULL_N, PULL_SIGMAS * sigma)
        watch = _Falling(rise, pull, self.clock.now() + TURNING_S + loop.rig.load_cell.latency_s())
        begun_mm, ended = mover.here(), "out of the pad"
        if not blind and loop.last_net_N < -pull:
            ended = "the pad pulls"
        else:
            for ended in self._go(target, blind, watch):
                if ended:
                    break
                yield
            if ended:
                yield from mover.brake()
                out = self._target_mm(blind=True)
                if self._blind() and out is not None and mover.here() > out:
                    yield from mover.go(out, RETRACT_MM_S)
            else:
                yield from mover.settle()  # the plan is over before an axis that lags is
                ended = "at the surface, without a force to go by" if blind else "out of the pad"
        data = {"from_mm": begun_mm, "to_mm": mover.here(), "ended": ended}
        loop.sink.event(self.clock.now(), "retreat", data)

    def _go(self, target_mm: float, blind: bool, watch: _Falling) -> Iterator[str]:
        """Turn by turn: why the way out ends here, or nothing."""
        loop = self.loop
        give_up = self.clock.now() + RETRACT_PATIENCE_S
        seen = loop.force_count
        for _ in self.run.mover.go(target_mm, RETRACT_MM_S):
            why = ""
            if self.clock.now() > give_up:
                why = "it takes too long"
            elif not blind and self._blind():
                why = "the load cell was lost"
            elif not blind and loop.force_count != seen:
                seen = loop.force_count
                why = watch.sample(self.clock.now(), loop.last_net_N)
            yield why

    def _blind(self) -> bool:
        """Whether there is no force to go by."""
        loop = self.loop
        age_s = loop.force_age_s(self.clock.now())
        return loop.monitor.cell_lost or not loop.measuring or age_s > loop.monitor.envelope.stale_s

    def _target_mm(self, blind: bool) -> float | None:
        """How far out it may go (motor frame), None where nothing is known of the way."""
        run = self.run
        approach, surface = run.protocol.approach, run.found.surface
        lowest = self.loop.monitor.envelope.position_mm[0]
        if not isinstance(approach, Approach):
            return None
        if surface is not None:
            return max(lowest, surface.position_mm - (0.0 if blind else approach.retract))
        if run.found.air_mm is not None:
            return max(lowest, run.found.air_mm)
        if run.bench.motor.safe_state == "retract" and not blind:
            return max(lowest, run.mover.here() - approach.retract)
        return None


class _Falling:
    """Whether a force falls, sample by sample; two in a row say that it does not. A rise counts from a time on."""

    def __init__(self, rise_N: float, pull_N: float, from_s: float) -> None:
        self.rise_N = rise_N
        self.pull_N = pull_N
        self.from_s = from_s
        self._least_N = math.inf
        self._before = ""

    def sample(self, now_s: float, net_N: float) -> str:
        """Why the way out ends, or nothing."""
        now = ""
        if net_N < -self.pull_N:
            now = "the pad pulls"
        elif now_s > self.from_s:
            now = "the force rises" if net_N > self._least_N + self.rise_N else ""
            self._least_N = min(self._least_N, net_N)
        both, self._before = now if now == self._before else "", now
        return both
