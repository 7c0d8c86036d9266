"""Frame compliance: bench frame, load cell and probe give way under force like a spring in series with the pad.

The motor side moves by x, the probe by y = x − C F. With a linear pad of stiffness K the bench sees K/(1 + C K) instead
of K. The force used is the one at the cell, solved within the step (sim/kernel.py), never the last step's.

Reference: W. C. Oliver, G. M. Pharr, J. Mater. Res. 7, 1992, 1564–1583: the compliance measured is that of the
contact plus that of the load frame.
"""

from __future__ import annotations

from sim.effects.base import Effect, Form, Parameter
from sim.jit import State, block


@block
def spring(dt: float, force: float, state: State, p: State) -> float:
    """Deflection C F in mm; p = (compliance,)."""
    return p[0] * force


EFFECT = Effect(
    id="frame_compliance",
    what="Frame, load cell and probe give way under force like a spring in series with the pad.",
    forms=(
        Form(
            name="linear",
            what="deflection proportional to the force at the cell",
            parameters=(
                Parameter(
                    "compliance",
                    "mm/N",
                    0.0,
                    1.0,
                    0.005,
                    "deflection per newton",
                    required=True,
                ),
            ),
            blocks={"frame": spring},
        ),
    ),
)
