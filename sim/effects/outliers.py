"""Outliers: single force samples that are far off, `fraction` of all.

Which samples is drawn by a hash of their number and `seed` (no fit can find it; detectors flag the samples instead).

- `heavy`: added ± an exponentially distributed error of mean `size`.
- `spikes`: added ±size.
- `one_sided`: added +|size|, exponentially distributed, or −|size| where size is negative.
- `dropouts`: the sample is replaced by `size`, 0 for a lost frame.

Reference: P. J. Huber, Robust Statistics, Wiley, 1981 (the gross error model: contamination of a fraction).
"""

from __future__ import annotations

import math

from sim.effects.base import Effect, Form, Parameter
from sim.effects.draws import uniform
from sim.jit import State, block


@block
def heavy(dt: float, force: float, state: State, p: State) -> float:
    """p = (fraction, size, seed); state: samples so far."""
    n = 3 * int(state[0])
    state[0] += 1.0
    seed = int(p[2])
    if uniform(n, seed) >= p[0]:
        return force
    off = -p[1] * math.log(uniform(n + 1, seed))
    return force + off if uniform(n + 2, seed) < 0.5 else force - off


@block
def spikes(dt: float, force: float, state: State, p: State) -> float:
    """p = (fraction, size, seed)."""
    n = 3 * int(state[0])
    state[0] += 1.0
    seed = int(p[2])
    if uniform(n, seed) >= p[0]:
        return force
    return force + p[1] if uniform(n + 2, seed) < 0.5 else force - p[1]


@block
def one_sided(dt: float, force: float, state: State, p: State) -> float:
    """p = (fraction, size, seed)."""
    n = 3 * int(state[0])
    state[0] += 1.0
    seed = int(p[2])
    if uniform(n, seed) >= p[0]:
        return force
    return force - p[1] * math.log(uniform(n + 1, seed))


@block
def dropouts(dt: float, force: float, state: State, p: State) -> float:
    """p = (fraction, size, seed)."""
    n = 3 * int(state[0])
    state[0] += 1.0
    return p[1] if uniform(n, int(p[2])) < p[0] else force


_FRACTION = Parameter("fraction", "1", 0.0, 1.0, 0.005, "share of the samples", required=True, amplitude=True)
_SEED = Parameter("seed", "1", 0.0, 1e6, 1.0, "which samples", fixed=True)

EFFECT = Effect(
    id="outliers",
    what="Single force samples are far off.",
    says="{fraction:percent} of the force samples are spikes",
    check="look at cable, plugs and checksum errors; such samples are left out",
    reference="Huber, Robust Statistics, 1981",
    of_motion=False,
    forms=(
        Form(
            name="heavy",
            what="errors of either sign, exponentially distributed",
            parameters=(_FRACTION, Parameter("size", "N", 0.0, 1e4, 1.0, "mean size of the error"), _SEED),
            blocks={"sampling": heavy},
            state=(0.0,),
        ),
        Form(
            name="spikes",
            what="errors of either sign and one size",
            parameters=(_FRACTION, Parameter("size", "N", 0.0, 1e4, 1.0, "size of the error"), _SEED),
            blocks={"sampling": spikes},
            state=(0.0,),
        ),
        Form(
            name="one_sided",
            what="errors of one sign, exponentially distributed",
            parameters=(_FRACTION, Parameter("size", "N", -1e4, 1e4, 1.0, "mean size of the error, with sign"), _SEED),
            blocks={"sampling": one_sided},
            state=(0.0,),
        ),
        Form(
            name="dropouts",
            what="another value in place of the sample",
            parameters=(
                _FRACTION,
                Parameter("size", "N", -1e4, 1e4, 0.0, "value that is reported instead"),
                _SEED,
            ),
            blocks={"sampling": dropouts},
            state=(0.0,),
        ),
    ),
)
