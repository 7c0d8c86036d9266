"""Force bias: a constant in the reported force, present in free air too.

From a tare while something touched, a cable that pulls, a probe changed after the tare, or gravity on a tilted axis.

- `constant`: bias, at all times.
- `settling`: bias · (1 + share e^(−t/τ)), as after a tare while the cell still crept.
- `slipping`: bias · (1 + share (s(t) − ½)), s a logistic step from 0 to 1 at a time, as when a cable comes to lie
  elsewhere.
- `along`: bias · (1 + share (y/reach − ½)) at the probe's position y, as of a cable or tube that is pulled along: it is
  a weak spring. It hangs free further than half the reach beyond either end.
- `returning`: bias · (1 + share (G/at_force − ½)), G the force of the last seconds, by a first order: cells are slow to
  come back to zero after a load, and come back the later, the longer it lasted.
- `in_motion`: bias · (1 + share m), m = 1 while the probe moves and 0 while it rests: a drive's carrier that an
  amplifier rectifies (IEC 61326-2-3, Electromagnetic compatibility of transducers).
- `swinging`: bias · (1 + share sin(2πt/period + angle)), as where a heater, a draught or a compressor comes and goes.

The share is small: a zero that moves by more of itself than that drifts. A drift begins at zero; a bias is there from
the first sample on.

Reference: OIML R 60, Metrological regulation for load cells (zero, its return after load, and its shift); VDI/VDE 2637
part 1, Load cells (force shunts by cables and lines).
"""

from __future__ import annotations

import math

from sim.effects.base import Effect, Form, Parameter
from sim.effects.linear import first_order
from sim.jit import State, block

_MOST = 0.3  # of the bias, by which it may change
_PERIODS_S, _ANGLES = (4.0, 8.0, 14.0, 30.0), (-1.6, 0.0, 1.6, 3.1)
_SLOW_MM_S = 0.02  # at which a motion counts half


@block
def bias(dt: float, force: float, state: State, p: State) -> float:
    """Force with the bias; p = (bias,)."""
    return force + p[0]


@block
def settling(dt: float, force: float, state: State, p: State) -> float:
    """State: time since the first sample; p = (bias, share, time_constant)."""
    state[0] += dt
    return force + p[0] * (1.0 + p[1] * math.exp(-state[0] / p[2]))


@block
def slipping(dt: float, force: float, state: State, p: State) -> float:
    """State: time since the first sample; p = (bias, share, moved_at, within)."""
    state[0] += dt
    return force + p[0] * (1.0 + 0.5 * p[1] * math.tanh((state[0] - p[2]) / p[3]))


@block
def swinging(dt: float, force: float, state: State, p: State) -> float:
    """State: time since the first sample; p = (bias, share, period, angle)."""
    state[0] += dt
    return force + p[0] * (1.0 + p[1] * math.sin(2.0 * math.pi * state[0] / p[2] + p[3]))


@block
def along(dt: float, y: float, state: State, p: State) -> float:
    """Force at the probe; p = (bias, share, reach)."""
    return p[0] * (1.0 + p[1] * (min(max(y / p[2], -0.5), 1.5) - 0.5))


@block
def returning(dt: float, force: float, state: State, p: State) -> float:
    """p = (bias, share, time_constant, at_force). State: force before, G."""
    state[1] = first_order(dt, state[1], state[0], force, p[2])
    state[0] = force
    return force + p[0] * (1.0 + p[1] * (min(max(state[1] / p[3], -0.5), 1.5) - 0.5))


@block
def in_motion(dt: float, y: float, state: State, p: State) -> float:
    """Force at the probe; p = (bias, share). State: started, place before, of which it moves."""
    if state[0] == 0.0:
        state[0] = 1.0
        state[1] = y
    if dt > 0.0:
        speed = abs(y - state[1]) / dt
        state[2] = speed / (speed + _SLOW_MM_S)
        state[1] = y
    return p[0] * (1.0 + p[1] * state[2])


_BIAS = Parameter(
    "bias",
    "N",
    -1e3,
    1e3,
    0.05,
    "reported minus true force",
    required=True,
    amplitude=True,
    floor=("force_noise_N", 0.03),
)


def _share(what: str) -> Parameter:
    return Parameter("share", "1", -_MOST, _MOST, 0.1, what, default=0.0, starts=(0.1,))


EFFECT = Effect(
    id="force_bias",
    what="The reported force is off by a constant.",
    says="the force is off by {bias:force}, in free air too",
    check="tare in free air, with probe and cable as they are in the run",
    reference="OIML R 60, Metrological regulation for load cells",
    of_motion=False,
    forms=(
        Form(name="constant", what="the same at all times", parameters=(_BIAS,), blocks={"sensor": bias}),
        Form(
            name="settling",
            what="a little more or less at first",
            parameters=(
                _BIAS,
                _share("what there is more of it at first"),
                Parameter("time_constant", "s", 0.5, 60.0, 6.0, "time in which it settles", starts=(2.0, 6.0, 20.0)),
            ),
            sought=False,
            blocks={"sensor": settling},
            state=(0.0,),
        ),
        Form(
            name="slipping",
            what="a little more or less from a time on",
            parameters=(
                _BIAS,
                _share("what there is more of it in the end"),
                Parameter("moved_at", "s", 0.0, 1e6, 30.0, "time at which it moves, from the first sample on"),
                Parameter("within", "s", 0.02, 60.0, 1.5, "half the time that the move takes"),
            ),
            sought=False,
            blocks={"sensor": slipping},
            state=(0.0,),
        ),
        Form(
            name="swinging",
            what="a little more and less in turn, as time goes",
            parameters=(
                _BIAS,
                _share("how much more of it there is at the most"),
                Parameter("period", "s", 1.0, 1e4, 15.0, "time after which it is the same again", starts=_PERIODS_S),
                Parameter("angle", "rad", -math.pi, math.pi, 0.5, "of its turn at the first sample", starts=_ANGLES),
            ),
            sought=False,
            blocks={"sensor": swinging},
            state=(0.0,),
        ),
        Form(
            name="returning",
            what="a little more or less after a load",
            parameters=(
                _BIAS,
                _share("what there is more of it after the force stated than after none"),
                Parameter("time_constant", "s", 0.5, 300.0, 6.0, "time in which it comes back", starts=(3.0, 12.0)),
                Parameter("at_force", "N", 1e-3, 1e6, 5.0, "force that adds the share", fixed=True),
            ),
            sought=False,
            blocks={"sensor": returning},
            state=(0.0, 0.0),
            of_motion=True,
        ),
        Form(
            name="along",
            what="a little more or less at the end of the way",
            parameters=(
                _BIAS,
                _share("what there is more of it at the end of the way than at its begin"),
                Parameter("reach", "mm", 0.01, 1e3, 3.0, "depth at the end of the way", fixed=True),
            ),
            sought=False,
            blocks={"probe": along},
            of_motion=True,
        ),
        Form(
            name="in_motion",
            what="a little more or less while the motor moves",
            parameters=(_BIAS, _share("what there is more of it in motion")),
            sought=False,
            blocks={"probe": in_motion},
            state=(0.0, 0.0, 0.0),
            of_motion=True,
        ),
    ),
)
