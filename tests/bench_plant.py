"""How fast the plant runs: `python -m tests.bench_plant`. Wanted: at least 10,000 times real time at 1 kHz.

Prints, for some models, nanoseconds a sample in array form and the ratio to real time, and microseconds a streaming
step. The best of several runs counts: what else the machine does is not the plant's doing.
"""

from __future__ import annotations

import time

import numpy as np

from sim import kernel as k
from sim.axis import BenchPlant, ServoSettings
from sim.model import Model
from sim.relaxation import modes, modes_and_slopes

WANTED = 10_000.0
RATE_HZ = 1000.0

PAD = {
    "elastic": {"law": "exponential", "m": 2.24, "b": 0.69},
    "relaxation": {"shares": [0.25, 0.15], "rates": [4.0, 0.35]},
    "contact": "unilateral",
}
FRICTION = {"id": "friction", "coulomb": 0.05}
FRAME = {"id": "frame_compliance", "compliance": 0.01}


def best(job, repeats: int = 7) -> float:
    """Shortest wall time of a job in seconds."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        job()
        times.append(time.perf_counter() - start)
    return min(times)


def plant_alone(effects: list[dict[str, object]], samples: int = 400_000) -> None:
    model = Model.from_dict({"pad": PAD, "effects": effects})
    t = np.arange(samples) / RATE_HZ
    x = 1.2 - 1.4 * np.cos(3.0 * t)
    dt = np.full(samples, 1.0 / RATE_HZ)
    layout = model.cascade.layout
    force, probe = np.empty(samples), np.empty(samples)
    state = layout.state.copy()
    each = best(lambda: k.run(layout.program, layout.parameters, state, dt, x, force, probe)) / samples
    plant = model.plant()
    steps = x[:20_000].tolist()

    def stream() -> None:
        for value in steps:
            plant.step(1e-3, value)

    streamed = best(stream, 3) / len(steps)
    names = " + ".join(str(effect["id"]) for effect in effects) or "pad alone"
    ratio = 1.0 / RATE_HZ / each
    verdict = "" if effects else ("   ok" if ratio >= WANTED else "   TOO SLOW")
    print(
        f"{names:30s} {each * 1e9:7.1f} ns a sample = {ratio:8,.0f} x real time, streaming {streamed * 1e6:.2f} us"
        + verdict
    )


def filters(samples: int = 30_000) -> None:
    rng = np.random.default_rng(1)
    t = np.cumsum(1e-3 * (1.0 + 0.1 * rng.standard_normal(samples)).clip(0.1))
    Fe = rng.standard_normal(samples)
    nu = np.array([4.0, 0.35])
    print(f"relaxation filter, r = 2, {samples} samples: {best(lambda: modes(t, Fe, nu)) * 1e3:.2f} ms", end=", ")
    print(f"with sensitivities {best(lambda: modes_and_slopes(t, Fe, nu)) * 1e3:.2f} ms")


def bench_time() -> None:
    bench = BenchPlant(ServoSettings(), Model.from_dict({"pad": PAD, "effects": [FRICTION, FRAME]}), 0.3, 0.0)
    bench.hold(0.0)

    def second() -> None:
        start = bench.time_s
        for n in range(1, 1001):
            bench.advance(start + n * 1e-3)
            bench.hold(1.5)
            _ = bench.position_mm, bench.force_N

    print(f"bench with friction and frame, 1 s in 1 ms calls: {best(second) * 1e3:.1f} ms")


def main() -> None:
    plant_alone([])
    plant_alone([FRICTION])
    plant_alone([FRAME])
    plant_alone([FRICTION, FRAME])
    filters()
    bench_time()


if __name__ == "__main__":
    main()
