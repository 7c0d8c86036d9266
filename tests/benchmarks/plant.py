"""How fast the plant runs by itself: array form, streaming form, and as part of the simulated axis."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from sim import kernel as k
from sim.axis import BenchPlant, ServoSettings
from sim.grid import Grid
from sim.model import Model
from sim.relaxation import modes, modes_and_slopes
from tests.benchmarks.report import Goal, Section, Table, middle

TITLE = "The plant alone"
WANTED = 10_000.0
RATE_HZ = 1000.0
ROUNDS = 15

PAD: Mapping[str, object] = {
    "elastic": {"law": "exponential", "m": 2.24, "b": 0.69},
    "relaxation": {"shares": [0.25, 0.15], "rates": [4.0, 0.35]},
    "contact": "unilateral",
}
FRICTION: Mapping[str, object] = {"id": "friction", "coulomb": 0.05}
FRAME: Mapping[str, object] = {"id": "frame_compliance", "compliance": 0.01}

HOW = f"""
A pad (exponential law, two relaxation modes, unilateral) is pressed and let go in a sine, 1000 samples a second, in
contact most of the time. Array form: one compiled call over 100,000 samples. Streaming form: a call from Python for
each of 20,000 samples. Median of {ROUNDS} rounds, with the fastest and the slowest.
"""


def rounds(job: Callable[[], object], count: int = ROUNDS) -> list[float]:
    """Wall times of a job, in seconds."""
    times = []
    for _ in range(count):
        start = time.perf_counter()
        job()
        times.append(time.perf_counter() - start)
    return times


def _plant(effects: Sequence[Mapping[str, object]], samples: int = 100_000) -> tuple[list[float], list[float]]:
    """Seconds a sample in array form and in streaming form, a value a round."""
    model = Model.from_dict({"pad": PAD, "effects": list(effects)})
    t = np.arange(samples) / RATE_HZ
    x = 1.2 - 1.4 * np.cos(3.0 * t)
    dt = np.full(samples, 1.0 / RATE_HZ)
    layout = model.cascade.layout
    force, probe = np.empty(samples), np.empty(samples)
    state = layout.state.copy()
    fades = Grid(t).fades(model.cascade.pad.relaxation.rates)
    array = rounds(lambda: k.run(layout.program, layout.parameters, state, dt, x, force, probe, *fades))
    plant = model.plant()
    steps = x[:20_000].tolist()

    def stream() -> None:
        for value in steps:
            plant.step(1.0 / RATE_HZ, value)

    return [s / samples for s in array], [s / len(steps) for s in rounds(stream)]


def _axis() -> list[float]:
    """Seconds for a second of bench time: axis, friction, frame and pad, asked every millisecond."""
    bench = BenchPlant(ServoSettings(), Model.from_dict({"pad": PAD, "effects": [FRICTION, FRAME]}), 0.3, 0.0)
    bench.hold(0.0)

    def second() -> None:
        start = bench.time_s
        for n in range(1, 1001):
            bench.advance(start + n * 1e-3)
            bench.hold(1.5)
            _ = bench.position_mm, bench.force_N

    return rounds(second)


def run() -> Section:
    """Pad alone (the goal), with effects, and what it is a part of."""
    started = time.perf_counter()
    plants = Table(("plant", "ns a sample, array form", "× real time at 1 kHz", "µs a step, streaming"))
    reached = 0.0
    for name, effects in (
        ("pad alone", []),
        ("pad, friction", [FRICTION]),
        ("pad, frame compliance (solved)", [FRAME]),
        ("pad, friction, frame compliance", [FRICTION, FRAME]),
    ):
        array, streamed = _plant(effects)
        ratio = 1.0 / RATE_HZ / float(np.median(array))
        reached = reached or ratio
        plants.rows.append((name, middle(array, "{:.0f}", 1e9), f"{ratio:,.0f}", middle(streamed, "{:.2f}", 1e6)))
    rng = np.random.default_rng(1)
    t = np.cumsum(1e-3 * (1.0 + 0.1 * rng.standard_normal(30_000)).clip(0.1))
    Fe, nu = rng.standard_normal(30_000), np.array([4.0, 0.35])
    parts = Table(("part", "ms"))
    parts.rows += [
        ("relaxation filter, r = 2, 30,000 uneven samples", middle(rounds(lambda: modes(t, Fe, nu)), "{:.2f}", 1e3)),
        ("the same with its sensitivities", middle(rounds(lambda: modes_and_slopes(t, Fe, nu)), "{:.2f}", 1e3)),
        ("simulated axis with friction and frame, 1 s asked every ms", middle(_axis(), "{:.1f}", 1e3)),
    ]
    goal = Goal("plant alone, 1 kHz", f"≥ {WANTED:,.0f} × real time", f"{reached:,.0f} ×", reached >= WANTED)
    return Section(TITLE, HOW, [plants, parts], [goal], time.perf_counter() - started)
