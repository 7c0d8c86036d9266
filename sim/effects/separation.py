"""Separation: the lab believes the pad bonded to the probe, and it lets go.

Where the force would be negative there is none, and the surface comes back by relaxation on its own (docs/formats.md,
Contact). Nothing to fit: the pad is unilateral or it is not.

Reference: T. C. T. Ting, The contact stresses between a rigid indenter and a viscoelastic half-space, J. Appl. Mech.
33, 1966, 845–854 (receding contact on a surface that recovers).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from sim.effects.base import Effect, Form

if TYPE_CHECKING:
    from sim.pad import Pad


def _lets_go(pad: Pad, values: Mapping[str, float]) -> Pad:
    return replace(pad, unilateral=True)


EFFECT = Effect(
    id="separation",
    what="The pad lets go where the model believes it bonded.",
    says="the pad lets go of the probe instead of pulling on it",
    check="look at the pad while the probe goes back: does it stick? Model it as `contact: unilateral`",
    reference="Ting, J. Appl. Mech. 33, 1966, 845-854",
    forms=(Form(name="unilateral", what="no force where the pad would pull", parameters=(), amend=_lets_go),),
)
