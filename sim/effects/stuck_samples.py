"""Stuck samples: at times the force channel repeats its last value, `fraction` of all samples.

When is drawn by a hash of the sample's number and `seed` (no fit can find it; detectors flag the samples instead).

- `runs`: each time for `length` samples, once in every `length`/`fraction` of them, anywhere within, so that a short
  recording has its share too.
- `random_runs`: at any time, and for a random number of samples, geometrically distributed with that mean.

Reference: R. Isermann, Fault-Diagnosis Systems, Springer, 2006 (sensor faults).
"""

from __future__ import annotations

import math

from sim.effects.base import Effect, Form, Parameter
from sim.effects.draws import uniform
from sim.jit import State, block

_COUNT, _HELD, _LEFT = range(3)


@block
def runs(dt: float, force: float, state: State, p: State) -> float:
    """p = (fraction, length, seed); state: samples so far, value held."""
    n = state[_COUNT]
    state[_COUNT] += 1.0
    if n > 0.0 and p[0] > 0.0:
        length = math.floor(p[1] + 0.5)
        every = length / min(p[0], 1.0)
        turn = math.floor(n / every)
        begins = math.ceil(turn * every + uniform(int(turn), int(p[2])) * (every - length))
        if begins <= n < begins + length:
            return state[_HELD]
    state[_HELD] = force
    return force


@block
def random_runs(dt: float, force: float, state: State, p: State) -> float:
    """p = (fraction, length, seed)."""
    n = 2 * int(state[_COUNT])
    state[_COUNT] += 1.0
    if n > 0 and state[_LEFT] < 1.0 and p[0] > 0.0:
        mean = max(p[1], 1.0)
        begin = p[0] / (p[0] + mean * (1.0 - p[0]))
        if uniform(n, int(p[2])) < begin:
            state[_LEFT] = 1.0
            if mean > 1.0:
                state[_LEFT] += math.floor(math.log(uniform(n + 1, int(p[2]))) / math.log(1.0 - 1.0 / mean))
    if state[_LEFT] >= 1.0:
        state[_LEFT] -= 1.0
        return state[_HELD]
    state[_HELD] = force
    return force


_FRACTION = Parameter("fraction", "1", 0.0, 1.0, 0.02, "share of the samples", required=True, amplitude=True)
_LENGTH = Parameter("length", "1", 1.0, 1e6, 20.0, "samples in a run, on average", fixed=True)
_SEED = Parameter("seed", "1", 0.0, 1e6, 1.0, "when", fixed=True)

EFFECT = Effect(
    id="stuck_samples",
    what="At times the force channel repeats its last value.",
    says="{fraction:percent} of the force samples repeat an old value",
    check="poll the load cell no faster than it converts; look for lost frames; such samples are left out",
    reference="Isermann, Fault-Diagnosis Systems, 2006",
    of_motion=False,
    forms=(
        Form(
            name="runs",
            what="in runs of one length",
            parameters=(_FRACTION, _LENGTH, _SEED),
            blocks={"sampling": runs},
            state=(0.0,) * 2,
        ),
        Form(
            name="random_runs",
            what="in runs of random length",
            parameters=(_FRACTION, _LENGTH, _SEED),
            blocks={"sampling": random_runs},
            state=(0.0,) * 3,
        ),
    ),
)
