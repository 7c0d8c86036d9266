"""Stress softening (Mullins): below the deepest point reached the pad is softer; there it is as it was.

The factor on F^e depends on depth δ and on the deepest depth so far; loading beyond it follows the virgin curve.

- `exponential`: 1 − share (1 − e^(−(deepest − δ)/depth)).
- `preconditioned`: the same on a pad that had been pressed to `already` before the data begin.
- `linear`: 1 − share · min(1, (deepest − δ)/depth).
- `ogden_roxburgh`: 1 − share · erf((deepest² − δ²)/(depth (depth + growth · deepest))): the error function of the
  energy below the deepest, as for a linear spring (R. W. Ogden, D. G. Roxburgh, A pseudo-elastic model for the Mullins
  effect in filled rubber, Proc. R. Soc. Lond. A 455, 1999, 2861–2877).
- `discontinuous_damage`: 1 − share (1 − e^(−deepest/depth)) at all depths: the deepest point sets the stiffness
  (J. C. Simo, On a fully three-dimensional finite-strain viscoelastic damage model, Comput. Methods Appl. Mech. Eng.
  60, 1987, 153–173).

State: the deepest depth. Reference: L. Mullins, Softening of rubber by deformation, Rubber Chem. Technol. 42, 1969,
339–362.
"""

from __future__ import annotations

import math

from sim.effects.base import Effect, Form, Parameter
from sim.jit import State, block


@block
def exponential(dt: float, depth: float, state: State, p: State) -> float:
    """Factor on F^e; p = (share, depth, already)."""
    here = max(depth, 0.0)
    state[0] = max(state[0], here, p[2])
    return 1.0 + p[0] * math.expm1(-(state[0] - here) / p[1])


@block
def linear(dt: float, depth: float, state: State, p: State) -> float:
    """Factor on F^e; p = (share, depth, already)."""
    here = max(depth, 0.0)
    state[0] = max(state[0], here, p[2])
    return 1.0 - p[0] * min(1.0, (state[0] - here) / p[1])


@block
def ogden_roxburgh(dt: float, depth: float, state: State, p: State) -> float:
    """Factor on F^e; p = (share, depth, growth, already)."""
    here = max(depth, 0.0)
    state[0] = max(state[0], here, p[3])
    deepest = state[0]
    return 1.0 - p[0] * math.erf((deepest - here) * (deepest + here) / (p[1] * (p[1] + p[2] * deepest)))


@block
def discontinuous_damage(dt: float, depth: float, state: State, p: State) -> float:
    """Factor on F^e; p = (share, depth, already)."""
    state[0] = max(state[0], depth, p[2])
    return 1.0 + p[0] * math.expm1(-state[0] / p[1])


_SHARE = Parameter(
    "share", "1", 0.0, 0.98, 0.2, "share of the stiffness that goes", required=True, amplitude=True, starts=(0.1, 0.4)
)
_DEPTH = Parameter(
    "depth",
    "mm",
    1e-3,
    100.0,
    0.5,
    "distance below the deepest point over which it goes",
    required=True,
    starts=(0.15, 0.5, 2.0),
)
_ALREADY = Parameter("already", "mm", 0.0, 100.0, 0.0, "depth reached before the data begin", fixed=True)

EFFECT = Effect(
    id="stress_softening",
    what="Below the deepest point reached the pad is softer (Mullins).",
    says="below its deepest point the pad loses up to {share:.3g} of its force, over {depth:.3g} mm",
    check="precondition to the greatest depth of the protocol first, and let the pad rest",
    reference="Mullins, Rubber Chem. Technol. 42, 1969, 339-362",
    forms=(
        Form(
            name="exponential",
            what="softer with the distance below the deepest point",
            parameters=(_SHARE, _DEPTH, _ALREADY),
            blocks={"elastic": exponential},
            state=(0.0,),
        ),
        Form(
            name="linear",
            what="softer in proportion to the distance below the deepest point, up to the share",
            parameters=(_SHARE, _DEPTH, _ALREADY),
            blocks={"elastic": linear},
            state=(0.0,),
        ),
        Form(
            name="ogden_roxburgh",
            what="softer with the energy below the deepest point",
            parameters=(
                _SHARE,
                _DEPTH,
                Parameter("growth", "1", 0.0, 10.0, 0.3, "growth of the distance with the deepest depth"),
                _ALREADY,
            ),
            blocks={"elastic": ogden_roxburgh},
            state=(0.0,),
        ),
        Form(
            name="discontinuous_damage",
            what="softer at all depths, by the deepest point",
            parameters=(_SHARE, _DEPTH, _ALREADY),
            blocks={"elastic": discontinuous_damage},
            state=(0.0,),
        ),
        Form(
            name="preconditioned",
            what="as exponential, on a pad pressed before the data begin",
            parameters=(
                _SHARE,
                _DEPTH,
                Parameter(
                    "already", "mm", 0.0, 100.0, 1.0, "depth reached before the data begin", starts=(0.5, 1.5, 3.0)
                ),
            ),
            sought=False,
            blocks={"elastic": exponential},
            state=(0.0,),
        ),
    ),
)
