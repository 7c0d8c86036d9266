"""Whole runs on a simulated bench that has faults, and what a bystander saw of the true bench meanwhile."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any
from unittest import mock

import yaml

import bench.config
import bench.run.runner
import bench.run.simulated
from bench.config import Bench, Simulation, load_bench
from bench.errors import InputError
from bench.preflight import check
from bench.protocol import Protocol, load_protocol
from bench.recording import Recording, read_recording
from bench.run.folder import RECORDING
from bench.run.runner import Outcome, run_protocol
from sim.faults.site import Strike
from sim.world import World, WorldSettings, unregister

SHORT: dict[str, Any] = {
    "name": "short",
    "approach": {"speed": 4, "force": 0.05, "retract": 0.3},
    "limits": {"force": 6, "depth": 1.5},
    "steps": [{"to": 1.0, "speed": 40, "hold": 0.6}, {"to": 0.3, "speed": 20, "hold": 0.1}],
    "finish": {"retract": 0.3, "air": 0.1},
    "sampling": {"motor": 250},
}
"""Some five seconds of bench time, most of it tare and touch-off."""

APPROACH_mm_s = {"smc_lec": 2.0}
"""A motor that is told a move in three messages stops later: preflight wants a slower approach."""

SURFACE_mm = 0.6
REACTION_s = 0.025
"""From crossing a limit to the first command that brakes: sample, wire, a turn of the loop, a poll of a slow motor."""

AFTERWARDS_s = {"orca": 1.0, "iai": 4.0, "smc_lec": 4.0}
"""So long the bench is left alone after a run, before it is looked at: for a motor's own watchdog, or the end of its
move where it has none."""

FOLD_s = 1.0


class Killed(BaseException):
    """The process is gone: nothing after this runs that a killed process would not run."""


class Witness:
    """Sees the true bench, whatever the host is told: how far, how hard, how fast."""

    def __init__(self, world: World) -> None:
        self.world = world
        self.deepest_mm = -math.inf
        self.highest_mm = math.inf
        self.hardest_N = -math.inf
        self.softest_N = math.inf
        self.killed_s: float | None = None
        self._since_s = 0.0
        world.true_clock.schedule(FOLD_s, self._look)

    def _look(self, at_s: float) -> None:
        self.fold(at_s)
        self.world.true_clock.schedule(at_s + FOLD_s, self._look)

    def fold(self, at_s: float) -> None:
        """Take in what has happened until now."""
        plant = self.world.plant
        plant.advance(at_s)
        _, position, force = plant.history(self._since_s)
        self._since_s = at_s
        self.deepest_mm = max(self.deepest_mm, float(position.max()))
        self.highest_mm = min(self.highest_mm, float(position.min()))
        self.hardest_N = max(self.hardest_N, float(force.max()))
        self.softest_N = min(self.softest_N, float(force.min()))

    def let_pass(self, seconds: float) -> None:
        """Time goes by, without a host, and with no more faults than there are."""
        self.world.site.over = True
        clock = self.world.true_clock
        clock.wait((), clock.now() + seconds)
        self.fold(clock.now())


@dataclass
class Seen:
    """One run: how it ended for the host (`outcome`, `refusal`, or killed), and how for the true bench."""

    bench: Bench
    protocol: Protocol
    folder: Path
    witness: Witness
    outcome: Outcome | None
    refusal: str | None
    ended_s: float
    """Bench time at the end of the run."""
    before_N: float
    """True force then; `AFTERWARDS_s` later it is the plant's."""

    @property
    def world(self) -> World:
        """The simulated bench as it was left."""
        return self.witness.world

    @property
    def struck(self) -> list[Strike]:
        """The faults that struck while there was a run."""
        return [strike for strike in self.world.site.struck if strike.time_s <= self.ended_s]

    @property
    def how(self) -> str:
        """In the words of the table of faults."""
        if self.refusal is not None:
            return "refused to start"
        if self.outcome is not None and self.outcome.cause is None:
            return "recovered"
        return "stopped safely"

    @property
    def cause(self) -> str:
        """What the run said."""
        if self.refusal is not None:
            return self.refusal
        if self.outcome is None:
            return "killed"
        return self.outcome.cause or ""

    @property
    def touched(self) -> bool:
        """Whether the run has found the surface."""
        return self.refusal is None and any(event.name == "touch_off" for event in self.recording().events)

    def recording(self) -> Recording:
        """What was recorded."""
        return read_recording(self.folder)

    def unsafe(self, shift_mm: float = 0.0, deceived: bool = False) -> list[str]:
        """What is wrong with the true bench: went too far or too hard, or is not at rest; empty if nothing.

        `shift_mm`: how far a fault moves the axis by itself. `deceived`: a fault makes the cell say less than there is,
        so that only travel and depth can hold; before the touch-off there is no depth yet, and what holds is the
        motor's own force.
        """
        searching = deceived and not self.touched
        plant, limits = self.world.plant, self.bench.limits
        speed = max(self.fastest_mm_s(), 1e-9)
        way_mm = speed * (REACTION_s + self.poll_s()) + speed**2 / (2.0 * limits.acceleration) + shift_mm
        wrong = []
        # Outwards there is the end of the axis: homing goes there, and a pad may push a released axis that far.
        low, high = self.bench.motor.stroke[0], limits.position[1]
        w = self.witness
        if not low - way_mm <= w.highest_mm <= w.deepest_mm <= high + way_mm:
            wrong.append(f"travelled from {w.highest_mm:.2f} to {w.deepest_mm:.2f} mm")
        depth, limit_mm = w.deepest_mm - self.world.surface_mm, self.protocol.limits.depth or math.inf
        if depth > limit_mm + way_mm and not searching:
            wrong.append(f"went {depth:.2f} mm deep, {limit_mm:g} mm allowed, {way_mm:.2f} mm to stop")
        limit_N = min(limits.force, self.protocol.limits.force or math.inf)
        law = self.world.settings.model.pad.law
        # How the force grows over the stopping distance, from where the pad answers with the limit.
        at_limit_mm = next((0.01 * n for n in range(1000) if law.force(0.01 * n) >= limit_N), 10.0)
        hardest_N = float(law.force(at_limit_mm + way_mm))
        if w.hardest_N > hardest_N and (searching or not deceived):
            wrong.append(f"pressed with {w.hardest_N:.2f} N, {limit_N:g} N allowed, {hardest_N:.2f} N to stop")
        if abs(plant.speed_mm_s) > 1.0:
            wrong.append(f"still moves, at {plant.speed_mm_s:.2f} mm/s")
        if self.bench.motor.safe_state == "release" and plant.force_N > max(1.0, self.before_N) + 0.1:
            wrong.append(f"the force still grows: {self.before_N:.2f} to {plant.force_N:.2f} N")
        if plant.force_N > limit_N and not deceived:
            wrong.append(f"left with {plant.force_N:.2f} N on the pad, {limit_N:g} N allowed")
        if self.bench.motor.safe_state == "release" and plant.servo_on and not self.on_its_own():
            wrong.append("the motor is still on")
        return wrong

    def on_its_own(self) -> bool:
        """Whether the motor has noticed by itself that nobody commands it any more, and lets go slowly."""
        return bool(getattr(self.world.endpoints["motor"].device, "errors", 0) & 1 << 11)

    def fastest_mm_s(self) -> float:
        """The fastest move of the protocol."""
        steps = [step.speed for step in self.protocol.steps if hasattr(step, "speed")]
        return max([5.0, *(speed for speed in steps if speed is not None)])

    def poll_s(self) -> float:
        """How long a motor that is polled may not be heard."""
        return {"orca": 0.0, "smc_lec": 0.06}.get(self.bench.motor.driver, 0.02)


_model = cache(bench.config.load_model)


@cache
def _base(name: str) -> Bench:
    return load_bench(name)


def bench_with(faults: Sequence[Mapping[str, Any]], base: str = "simulated", seed: int = 1, **truth: Any) -> Bench:
    """A shipped bench with faults; `truth` goes into its `simulation` block."""
    shipped = _base(base)
    block = {"seed": seed, "pad": "polyurethane", "surface": SURFACE_mm, **truth, "faults": [dict(f) for f in faults]}
    return shipped.model_copy(update={"simulation": Simulation.model_validate(block)})


def protocol_of(folder: Path, content: Mapping[str, Any]) -> Protocol:
    """A protocol, by way of a file."""
    path = folder / "protocol.yaml"
    path.write_text(yaml.safe_dump(dict(content), sort_keys=False), "utf-8")
    return load_protocol(str(path))


def short_for(bench_: Bench) -> dict[str, Any]:
    """`SHORT`, with an approach that the bench's motor can stop."""
    speed = APPROACH_mm_s.get(bench_.motor.driver)
    return SHORT if speed is None else SHORT | {"approach": SHORT["approach"] | {"speed": speed}}


def press(folder: Path, bench_: Bench, content: Mapping[str, Any] | Protocol | None = None) -> Seen:
    """Run a protocol (`SHORT` if none) on a bench with faults, and look at the bench afterwards."""
    content = short_for(bench_) if content is None else content
    protocol = content if isinstance(content, Protocol) else protocol_of(folder, content)
    preflight = check(protocol, bench_, None)
    refusal = preflight.refusal()
    assert refusal is None, refusal
    out = folder / "run"
    out.mkdir()
    outcome, said, kept = None, None, b""
    with _witnessed() as made, cheaply():

        def kill() -> None:
            nonlocal kept
            made[0].killed_s = made[0].world.true_clock.now()
            kept = (out / RECORDING).read_bytes() if (out / RECORDING).exists() else b""
            raise Killed

        try:
            with _acts(kill):
                outcome = run_protocol(protocol, bench_, preflight.plan, out)
        except InputError as error:
            if not made:  # there is no such bench
                raise
            said = str(error)
        except Killed:
            (out / RECORDING).write_bytes(kept)
    witness = made[0]
    ended_s, before_N = witness.world.true_clock.now(), witness.world.plant.force_N
    witness.let_pass(AFTERWARDS_s[bench_.motor.driver])
    unregister(witness.world.settings.name)
    return Seen(bench_, protocol, out, witness, outcome, said, ended_s, before_N)


@contextlib.contextmanager
def _witnessed() -> Iterator[list[Witness]]:
    """Every world that is built meanwhile has a witness."""
    made: list[Witness] = []

    def build(settings: WorldSettings) -> World:
        world = World(settings)
        made.append(Witness(world))
        return world

    with mock.patch.object(bench.run.simulated, "World", build):
        yield made


@contextlib.contextmanager
def cheaply() -> Iterator[None]:
    """Leave out what a run does once, and hundreds of runs in one process hundreds of times."""
    with (
        mock.patch.object(bench.run.simulated, "load_model", _model),
        mock.patch.object(bench.run.runner, "_undisturbed", contextlib.nullcontext),
    ):
        yield


@contextlib.contextmanager
def _acts(kill: Callable[[], None]) -> Iterator[None]:
    """A killed process is one exception, for the sake of whoever asks afterwards."""
    import sim.world as w

    acts = w.own_acts()
    with mock.patch.object(w, "own_acts", lambda: {**acts, "kill": kill}):
        yield
