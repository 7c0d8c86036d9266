"""Contact offset: the true surface lies elsewhere than where touch-off has put it.

- `constant`: depth = position − offset.
- `toe`: seating. The first part of the way takes up slack, tilt and roughness: δ = y²/(4·offset) up to y = 2·offset,
  then y − offset; ASTM D695 and D638 call this the toe of the curve and correct for the same offset.
- `asperities`: rough faces meet by their summits first, and the load grows exponentially with approach until they are
  flat: δ = s ln(1 + e^((y − offset)/s)), s = roughness · |offset| (J. A. Greenwood, J. B. P. Williamson, Proc. R.
  Soc. A 295, 1966, 300–319, with exponentially distributed heights).
- `moved`: offset · (1 + share (s(t) − ½)), s a logistic step from 0 to 1 at a time: an axis that is homed anew, a pad
  that is shifted or a probe put on again during the recording finds the surface a little elsewhere.

With an exponential law a constant offset is exactly another m, and with a polynomial another polynomial.

Reference: D. C. Lin, E. K. Dimitriadis, F. Horkay, Robust strategies for automated AFM force curve analysis I,
J. Biomech. Eng. 129, 2007, 430–440, on how the point of contact and the stiffness stand in for each other.
"""

from __future__ import annotations

import math

from sim.effects.base import Effect, Form, Parameter
from sim.jit import State, block

_MOST = 0.3  # of the offset, by which it may change


@block
def constant(dt: float, y: float, state: State, p: State) -> float:
    """Depth below the true surface; p = (offset,)."""
    return y - p[0]


@block
def toe(dt: float, y: float, state: State, p: State) -> float:
    """Depth after a parabola of length 2·offset; p = (offset,)."""
    if y <= 0.0 or p[0] <= 0.0:
        return y
    if y < 2.0 * p[0]:
        return y * y / (4.0 * p[0])
    return y - p[0]


@block
def asperities(dt: float, y: float, state: State, p: State) -> float:
    """Depth behind a rough face; p = (offset, roughness over offset)."""
    s = p[1] * abs(p[0])
    if s < 1e-12:
        return y - p[0]
    u = (y - p[0]) / s
    if u > 40.0:
        return y - p[0]
    if u < -40.0:
        return min(y - p[0], 0.0)
    return s * math.log1p(math.exp(u))


@block
def moved(dt: float, y: float, state: State, p: State) -> float:
    """Depth below a surface that moves once; p = (offset, share, moved_at, within); state: time."""
    state[0] += dt
    return y - p[0] * (1.0 + 0.5 * p[1] * math.tanh((state[0] - p[2]) / p[3]))


def _offset(what: str, least_mm: float = -5.0) -> Parameter:
    return Parameter(
        "offset", "mm", least_mm, 5.0, 0.05, what, required=True, amplitude=True, floor=("position_noise_mm", 2.0)
    )


EFFECT = Effect(
    id="contact_offset",
    what="The true surface is not where touch-off has put it.",
    says="the surface lies {offset:size} mm {offset:deeper/higher} than it was taken to lie",
    check="repeat the touch-off, slower and with a smaller force; look for dust or tilt under the probe",
    reference="Lin, Dimitriadis, Horkay, J. Biomech. Eng. 129, 2007, 430-440",
    forms=(
        Form(
            name="constant",
            what="all depths are off by the same",
            parameters=(_offset("true surface minus believed surface"),),
            blocks={"depth": constant},
        ),
        Form(
            name="toe",
            what="a soft beginning: the offset is lost over the first part of the way",
            parameters=(_offset("way lost before contact is whole", 0.0),),
            blocks={"depth": toe},
        ),
        Form(
            name="asperities",
            what="summits of a rough face touch first",
            parameters=(
                _offset("true surface, of the flattened summits, minus believed surface"),
                Parameter(
                    "roughness",
                    "1",
                    0.02,
                    2.0,
                    0.3,
                    "spread of the summits' heights over the offset",
                    starts=(0.2, 0.7),
                ),
            ),
            blocks={"depth": asperities},
        ),
        Form(
            name="moved",
            what="a little more or less from a time on",
            parameters=(
                _offset("true surface minus believed surface, the mean of before and after"),
                Parameter(
                    "share",
                    "1",
                    -_MOST,
                    _MOST,
                    0.1,
                    "what there is more of it in the end",
                    default=0.0,
                    starts=(-0.1, 0.1),
                ),
                Parameter("moved_at", "s", 0.0, 1e6, 30.0, "time at which it moves, from the first sample on"),
                Parameter("within", "s", 0.02, 60.0, 0.5, "half the time that the move takes"),
            ),
            sought=False,
            blocks={"depth": moved},
            state=(0.0,),
        ),
    ),
)
