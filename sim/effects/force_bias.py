"""Force bias: a constant in the reported force, present in free air too.

From a tare while something touched, a cable that pulls, a probe changed after the tare, or gravity on a tilted axis.

Reference: OIML R 60, Metrological regulation for load cells (zero and its shift).
"""

from __future__ import annotations

from sim.effects.base import Effect, Form, Parameter
from sim.jit import State, block


@block
def bias(dt: float, force: float, state: State, p: State) -> float:
    """Force with the bias; p = (bias,)."""
    return force + p[0]


EFFECT = Effect(
    id="force_bias",
    what="The reported force is off by a constant.",
    says="the force is off by {bias:.4g} N, in free air too",
    check="tare in free air, with probe and cable as they are in the run",
    reference="OIML R 60, Metrological regulation for load cells",
    forms=(
        Form(
            name="constant",
            what="the same at all times",
            parameters=(
                Parameter(
                    "bias",
                    "N",
                    -1e3,
                    1e3,
                    0.05,
                    "reported minus true force",
                    required=True,
                    amplitude=True,
                    floor=("force_noise_N", 0.03),
                ),
            ),
            blocks={"sensor": bias},
        ),
    ),
)
