"""Separation: the lab believes `bonded`, and the pad lets go.

- `unilateral`: where the force would be negative there is none, and the surface comes back by relaxation on its own
  (docs/formats.md, Contact). Nothing to fit: the pad is unilateral or it is not.
- `film`: a film of grease or water between pad and probe bears tension first, until it has grown too thick: by Stefan's
  law F dt goes with d(1/h²), so that a film of any first thickness well below its last bears an impulse and no more. It
  closes when pad and probe are pressed together again.
- `breaking`: a bond bears an impulse of tension in all, from lift to lift, and is broken for good once that is used up:
  an adhesive under loads that come back gathers damage until it parts (W. V. Mars, A. Fatemi, A literature survey on
  fatigue analysis approaches for rubber, Int. J. Fatigue 24, 2002, 949–961).
- `partly`: a share of the face stays bonded and pulls, the rest lets go; both are columns of one pad beside each other
  (a Winkler foundation: K. L. Johnson, Contact Mechanics, 1985, section 4.3).

Reference: T. C. T. Ting, The contact stresses between a rigid indenter and a viscoelastic half-space, J. Appl. Mech.
33, 1966, 845–854 (receding contact on a surface that recovers); J. Stefan, Versuche über die scheinbare Adhäsion,
Sitzungsber. Akad. Wiss. Wien 69, 1874, 713–735 (the impulse that parts two plates in a liquid).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from sim.effects.base import Effect, Form, Parameter

if TYPE_CHECKING:
    from sim.pad import Pad


def _lets_go(pad: Pad, values: Mapping[str, float]) -> Pad:
    return replace(pad, unilateral=True)


def _lets_go_late(pad: Pad, values: Mapping[str, float]) -> Pad:
    return pad if pad.unilateral else replace(pad, unilateral=True, film_Ns=values["impulse"])


def _breaks(pad: Pad, values: Mapping[str, float]) -> Pad:
    return pad if pad.unilateral else replace(_lets_go_late(pad, values), film_once=True)


def _lets_go_in_part(pad: Pad, values: Mapping[str, float]) -> Pad:
    return pad if pad.unilateral else replace(pad, unilateral=True, bonded=values["bonded"])


def _impulse(what: str, most: int) -> Parameter:
    """Begun at each quarter of a decade: an impulse that no lift reaches changes nothing with a little more or less."""
    return Parameter("impulse", "N*s", 1e-6, 1e4, 0.02, what, starts=tuple(10.0 ** (k / 4) for k in range(-16, most)))


EFFECT = Effect(
    id="separation",
    what="The pad lets go where the model believes it bonded.",
    says="the pad lets go of the probe instead of pulling on it",
    check="look at the pad while the probe goes back: does it stick? Model it as `contact: unilateral`",
    reference="Ting, J. Appl. Mech. 33, 1966, 845-854",
    forms=(
        Form(name="unilateral", what="no force where the pad would pull", parameters=(), amend=_lets_go),
        Form(
            name="film",
            what="a film bears an impulse of tension before it lets go",
            parameters=(_impulse("tension over time that parts pad and probe", 5),),
            amend=_lets_go_late,
        ),
        Form(
            name="breaking",
            what="a bond bears an impulse of tension in all, and is broken for good",
            parameters=(_impulse("tension over time, of all lifts, that breaks the bond", 10),),
            amend=_breaks,
        ),
        Form(
            name="partly",
            what="a share of the face stays bonded",
            parameters=(
                Parameter("bonded", "1", 0.0, 0.9, 0.3, "share of the face that stays bonded", starts=(0.1, 0.3, 0.6)),
            ),
            amend=_lets_go_in_part,
        ),
    ),
)
