"""Permanent set: the surface sinks with the depth reached, and does not come back.

- `linear`: by set · deepest.
- `power`: by set · deepest (deepest/reach)^(n − 1), progressive above n = 1.
- `saturating`: by limit · (1 − e^(−set · deepest/limit)): set · deepest at first, and no more than the limit.
- `yielding`: by set · (deepest − limit), once the deepest exceeds the limit.
- `gradual`: towards set · deepest at a rate in time, only while pressed (the rate is scaled by depth/deepest).
- `rebounding`: of what sinks at once a share `back` rises again at a rate in time, while nothing presses on it; `set`
  is the mean of what sinks at once and what stays (ISO 1856 and ISO 815 measure a set after a time of recovery).
- `ratcheting`: by set · deepest · (1 + more · ln N), N how often the probe came near the deepest depth (9/10 of it)
  from half of it or less: each cycle adds less than the one before (J. L. Chaboche, Time-independent constitutive
  theories for cyclic plasticity, Int. J. Plast. 2, 1986, 149–188).
- `flowing`: by set · deepest · (1 + flows · ln(1 + T/1 s)), T the time under load (∫ depth/deepest dt): cold flow, by
  the logarithm of time as creep goes under a stress that stays (W. N. Findley, J. S. Lai, K. Onaran, Creep and
  Relaxation of Nonlinear Viscoelastic Materials, North-Holland, 1976, chapter 2).
- `springing`: it yields beyond a depth of `limit` and hardens, and as it is let go a part flows back: 2 · set times a
  play of ± limit that the depth drags along; `set` is the mean of what has sunk under the deepest and of what stays (W.
  Prager, A new method of analyzing stresses and strains in work-hardening plastic solids, J. Appl. Mech. 23, 1956,
  493–496: the back stress of what has hardened).
- `lifting`: as the probe goes back, by set · deepest · (1 − e^(−(deepest − y)/within)) over the same of `reach`, so
  that `set` is what stays of a stroke of that depth; the law is the pad's as it is pressed first, set in it, as of what
  is read from the curve of unloading (W. C. Oliver, G. M. Pharr, J. Mater. Res. 7, 1992, 1564–1583).
- `pounded`: towards set · deepest with the way pressed, set · deepest · (1 − e^(−W/way)), W = ∫ max(dy, 0) below the
  sunken surface: what many presses make thinner (ISO 3385, Flexible cellular polymeric materials: determination of
  fatigue by constant-load pounding).

`deepest` is in the probe's coordinate; the pad's depth is what is left above the sunken surface.

Reference: L. Mullins, Softening of rubber by deformation, Rubber Chem. Technol. 42, 1969, 339–362 (set as part of the
softening); ISO 1856, Flexible cellular polymeric materials: determination of compression set.
"""

from __future__ import annotations

import math

from sim.effects.base import Effect, Form, Parameter
from sim.jit import State, block

_DEEPEST, _SUNK, _BACK = range(3)
_TIMES, _AWAY = 1, 2
_LOADED = 1
_PRESSED, _LAST = 1, 2


@block
def linear(dt: float, y: float, state: State, p: State) -> float:
    """Depth below the sunken surface; p = (set,)."""
    state[_DEEPEST] = max(state[_DEEPEST], y)
    return y - p[0] * state[_DEEPEST]


@block
def power(dt: float, y: float, state: State, p: State) -> float:
    """Depth below the sunken surface; p = (set, exponent, reach)."""
    state[_DEEPEST] = max(state[_DEEPEST], y)
    return float(y - min(p[0] * p[2] * (state[_DEEPEST] / p[2]) ** p[1], state[_DEEPEST]))


@block
def saturating(dt: float, y: float, state: State, p: State) -> float:
    """Depth below the sunken surface; p = (set, limit)."""
    state[_DEEPEST] = max(state[_DEEPEST], y)
    return y + p[1] * math.expm1(-p[0] * max(state[_DEEPEST], 0.0) / p[1])


@block
def yielding(dt: float, y: float, state: State, p: State) -> float:
    """Depth below the sunken surface; p = (set, limit)."""
    state[_DEEPEST] = max(state[_DEEPEST], y)
    return y - p[0] * max(0.0, state[_DEEPEST] - p[1])


@block
def gradual(dt: float, y: float, state: State, p: State) -> float:
    """Depth below the sinking surface; p = (set, rate)."""
    state[_DEEPEST] = max(state[_DEEPEST], y)
    if state[_DEEPEST] > 0.0:
        pressed = min(max(y / state[_DEEPEST], 0.0), 1.0)
        state[_SUNK] -= (p[0] * state[_DEEPEST] - state[_SUNK]) * math.expm1(-p[1] * pressed * dt)
    return y - state[_SUNK]


@block
def rebounding(dt: float, y: float, state: State, p: State) -> float:
    """Depth below the surface; p = (set, back, rate); state: deepest, what of it stays sunk, what comes back."""
    if y > state[_DEEPEST]:
        sunk = p[0] / (1.0 - 0.5 * p[1]) * (y - state[_DEEPEST])
        state[_DEEPEST] = y
        state[_SUNK] += (1.0 - p[1]) * sunk
        state[_BACK] += p[1] * sunk
    elif y < state[_SUNK] + state[_BACK]:
        state[_BACK] *= math.exp(-p[2] * dt)
        state[_BACK] = max(state[_BACK], y - state[_SUNK], 0.0)  # it meets the probe and stops
    return y - state[_SUNK] - state[_BACK]


@block
def ratcheting(dt: float, y: float, state: State, p: State) -> float:
    """Depth below the sunken surface; p = (set, more); state: deepest, times but one, whether it was away."""
    state[_DEEPEST] = max(state[_DEEPEST], y)
    if y < 0.5 * state[_DEEPEST]:
        state[_AWAY] = 1.0
    elif state[_AWAY] != 0.0 and y > 0.9 * state[_DEEPEST]:
        state[_AWAY] = 0.0
        state[_TIMES] += 1.0
    return float(y - min(p[0] * state[_DEEPEST] * (1.0 + p[1] * math.log1p(state[_TIMES])), state[_DEEPEST]))


@block
def flowing(dt: float, y: float, state: State, p: State) -> float:
    """Depth below the sinking surface; p = (set, flows); state: deepest, time under load."""
    state[_DEEPEST] = max(state[_DEEPEST], y)
    if state[_DEEPEST] > 0.0:
        state[_LOADED] += min(max(y / state[_DEEPEST], 0.0), 1.0) * dt
    return float(y - min(p[0] * state[_DEEPEST] * (1.0 + p[1] * math.log1p(state[_LOADED])), state[_DEEPEST]))


@block
def springing(dt: float, y: float, state: State, p: State) -> float:
    """Depth below the surface; p = (set, limit); state: the play that is dragged along."""
    here = max(y, 0.0)
    state[0] = max(min(state[0], here + p[1]), here - p[1])
    return y - 2.0 * p[0] * state[0]


@block
def lifting(dt: float, y: float, state: State, p: State) -> float:
    """Depth below the sinking surface; p = (set, within, reach); state: deepest, what has sunk."""
    state[_DEEPEST] = max(state[_DEEPEST], y)
    come = math.expm1((max(y, 0.0) - state[_DEEPEST]) / p[1]) / math.expm1(-p[2] / p[1])
    sunk = p[0] * state[_DEEPEST] * come
    state[_SUNK] = max(state[_SUNK], sunk)
    return y - state[_SUNK]


@block
def pounded(dt: float, y: float, state: State, p: State) -> float:
    """Depth below the sinking surface; p = (set, way); state: deepest, way pressed, last position."""
    sunk = -p[0] * state[_DEEPEST] * math.expm1(-state[_PRESSED] / p[1])
    state[_PRESSED] += max(y - max(state[_LAST], sunk), 0.0)
    state[_LAST] = y
    state[_DEEPEST] = max(state[_DEEPEST], y)
    return float(y + p[0] * state[_DEEPEST] * math.expm1(-state[_PRESSED] / p[1]))


_SET = Parameter(
    "set",
    "mm/mm",
    0.0,
    0.95,
    0.05,
    "how far the surface sinks, per mm of depth reached",
    required=True,
    amplitude=True,
    starts=(0.02, 0.1),
)

EFFECT = Effect(
    id="permanent_set",
    what="The surface sinks with the depth reached, for good.",
    says="the surface sinks by {set:.3g} mm per mm of depth reached",
    check="come back to the surface between presses; measure its height before and after the run",
    reference="Mullins, Rubber Chem. Technol. 42, 1969, 339-362; ISO 1856",
    forms=(
        Form(
            name="linear",
            what="at once, in proportion to the deepest depth",
            parameters=(_SET,),
            blocks={"depth": linear},
            state=(0.0,),
        ),
        Form(
            name="power",
            what="at once, with a power of the deepest depth",
            parameters=(
                _SET,
                Parameter("exponent", "1", 0.2, 5.0, 1.5, "power of the deepest depth", starts=(0.7, 1.5, 2.5)),
                Parameter("reach", "mm", 1e-3, 100.0, 1.0, "deepest depth at which `set` is the mean", fixed=True),
            ),
            blocks={"depth": power},
            state=(0.0,),
        ),
        Form(
            name="saturating",
            what="at once, ever less with the deepest depth",
            parameters=(
                _SET,
                Parameter("limit", "mm", 1e-4, 50.0, 0.1, "how far it sinks at the most", starts=(0.02, 0.1)),
            ),
            sought=False,
            blocks={"depth": saturating},
            state=(0.0,),
        ),
        Form(
            name="yielding",
            what="at once, beyond a depth that leaves no trace",
            parameters=(
                _SET,
                Parameter("limit", "mm", 0.0, 50.0, 0.5, "depth that leaves no trace", bend=True),
            ),
            blocks={"depth": yielding},
            state=(0.0,),
        ),
        Form(
            name="springing",
            what="beyond a depth that leaves no trace, and back in part",
            parameters=(
                _SET,
                Parameter("limit", "mm", 0.0, 50.0, 0.5, "depth that leaves no trace", bend=True),
            ),
            blocks={"depth": springing},
            state=(0.0,),
        ),
        Form(
            name="lifting",
            what="as the probe goes back",
            parameters=(
                _SET,
                Parameter("within", "mm", 0.005, 20.0, 0.3, "way back on which it comes", starts=(0.1, 0.5)),
                Parameter("reach", "mm", 1e-3, 100.0, 1.0, "depth of a stroke that leaves `set`", fixed=True),
            ),
            blocks={"depth": lifting},
            state=(0.0,) * 2,
        ),
        Form(
            name="gradual",
            what="in time, while pressed",
            parameters=(
                _SET,
                Parameter("rate", "1/s", 1e-4, 1e3, 0.5, "rate of the approach", starts=(0.02, 0.2, 2.0)),
            ),
            blocks={"depth": gradual},
            state=(0.0, 0.0),
        ),
        Form(
            name="rebounding",
            what="at once, and in part back in air",
            parameters=(
                _SET,
                Parameter("back", "1", 0.0, 0.9, 0.3, "share of what sinks that comes back", starts=(0.3,)),
                Parameter("rate", "1/s", 1e-3, 1e3, 0.2, "rate at which it comes back", starts=(0.1, 0.5)),
            ),
            sought=False,
            blocks={"depth": rebounding},
            state=(0.0, 0.0, 0.0),
        ),
        Form(
            name="ratcheting",
            what="at once, and a little more with each cycle",
            parameters=(
                _SET,
                Parameter("more", "1", 0.0, 1.0, 0.15, "what each e-fold of cycles adds", starts=(0.15,)),
            ),
            sought=False,
            blocks={"depth": ratcheting},
            state=(0.0, 0.0, 0.0),
        ),
        Form(
            name="flowing",
            what="at once, and more with the logarithm of the time under load",
            parameters=(
                _SET,
                Parameter("flows", "1", 0.0, 2.0, 0.1, "what each e-fold of the time adds", starts=(0.1,)),
            ),
            blocks={"depth": flowing},
            state=(0.0, 0.0),
        ),
        Form(
            name="pounded",
            what="with the way pressed",
            parameters=(
                _SET,
                Parameter("way", "mm", 0.05, 1e4, 10.0, "way pressed on which 1 − 1/e of it comes", starts=(2.0, 20.0)),
            ),
            blocks={"depth": pounded},
            state=(0.0, 0.0, 0.0),
        ),
    ),
)
