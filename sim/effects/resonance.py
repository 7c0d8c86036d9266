"""Resonance of the force path: cell, probe and what holds them swing at their own frequency.

The damping ratio ends at 0.5: beyond, a second-order low-pass has next to no peak left, and is a sensor lag.

- `low_pass`: all of the force passes ω²/(s² + 2ζω s + ω²).
- `partial`: a share of it does, the rest passes as it is: a mode of part of the structure, which adds a ringing at each
  sudden change and nothing to what is slow.
- `transmitted`: the damper stands beside the spring and bears too, (2ζω s + ω²)/(s² + 2ζω s + ω²). It comes no later
  than a ramp in the end.
- `amplifier`: a pole at `ratio` times ω comes after the mode, as of an amplifier whose bandwidth is not far above it.
- `mounted`: on a mount of rubber, the damper of which has a spring behind it (Zener's solid): a pole at `ratio` times ω
  and a zero at (ratio + 2ζ) ω beside the mode (J. E. Ruzicka, T. F. Derby, Influence of Damping in Vibration Isolation,
  SVM-7, 1971).
- `pair`: the rest passes another mode of the same damping, at `ratio` times the frequency.
- `antiresonance`: zeros at `ratio` times the frequency and of the same damping, where a part of the structure absorbs
  the motion of the rest.
- `loaded`: ω² goes with the force that is borne, ω² (1 + growth (F/at_force − 1)), and not below a fifth: cells and
  joints are stiffer or softer under load. The stiffness stands still within a step.
- `damper`: a `share` of the damping at a swing of `at_swing` is that of a damper whose force goes with a power of the
  speed: 2 for oil that is throttled, 0 for a joint that rubs, between for many of them. The ratio stated is that of
  equal loss in each swing (Thomson, section 2.9), and the parts of a step follow each other.

Exact for a force that is linear between samples, at any spacing, but for the last two.

Reference: W. T. Thomson, Theory of Vibration with Applications, 4th ed., Prentice Hall, 1993; E. O. Doebelin,
Measurement Systems: Application and Design, 4th ed., McGraw-Hill, 1990, chapter 3; J. P. Den Hartog, Mechanical
Vibrations, 4th ed., McGraw-Hill, 1956, section 2.12 (transmissibility); D. J. Ewins, Modal Testing, 2nd ed., Research
Studies Press, 2000, chapter 2 (modes side by side, antiresonances).
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from sim.effects.base import Effect, Form, Parameter
from sim.effects.linear import first_order
from sim.effects.linear import low_pass as exact
from sim.jit import State, block, compiled

_Y, _SPEED, _LAST, _STARTED, _AFTER, _AFTER_SPEED = range(6)

_TURN, _MOST_PARTS = 0.3, 32
"""Angle of a swing, rad, that a part of a step takes at the most; parts of a step."""


@compiled("float64(float64, float64, float64, float64)")
def _braked(dt: float, speed: float, strength: float, exponent: float) -> float:
    """Speed after dt of v' = −strength · |v|^exponent, exactly; at rest it stays."""
    size = abs(speed)
    if size < 1e-200 or strength == 0.0:
        return speed
    if abs(exponent - 1.0) < 1e-6:
        left = size * math.exp(-strength * dt)
    else:
        power = size ** (1.0 - exponent) - (1.0 - exponent) * strength * dt
        left = power ** (1.0 / (1.0 - exponent)) if power > 0.0 else 0.0
    return math.copysign(left, speed)


@block
def low_pass(dt: float, u: float, state: State, p: State) -> float:
    """Force after the mode; p = (frequency, damping_ratio)."""
    if state[_STARTED] == 0.0:
        state[_STARTED] = 1.0
        state[_Y] = u
        state[_LAST] = u
    y, speed = exact(dt, state[_Y], state[_SPEED], state[_LAST], u, 2.0 * math.pi * p[0], p[1])
    state[_Y] = y
    state[_SPEED] = speed
    state[_LAST] = u
    return y


@block
def partial(dt: float, u: float, state: State, p: State) -> float:
    """Force of which a share has passed the mode; p = (frequency, damping_ratio, share)."""
    if state[_STARTED] == 0.0:
        state[_STARTED] = 1.0
        state[_Y] = u
        state[_LAST] = u
    y, speed = exact(dt, state[_Y], state[_SPEED], state[_LAST], u, 2.0 * math.pi * p[0], p[1])
    state[_Y] = y
    state[_SPEED] = speed
    state[_LAST] = u
    return u + p[2] * (y - u)


@block
def transmitted(dt: float, u: float, state: State, p: State) -> float:
    """Force that spring and damper of the mode pass on; p = (frequency, damping_ratio)."""
    if state[_STARTED] == 0.0:
        state[_STARTED] = 1.0
        state[_Y] = u
        state[_LAST] = u
    omega = 2.0 * math.pi * p[0]
    y, speed = exact(dt, state[_Y], state[_SPEED], state[_LAST], u, omega, p[1])
    state[_Y] = y
    state[_SPEED] = speed
    state[_LAST] = u
    return y + 2.0 * p[1] / omega * speed


@block
def amplifier(dt: float, u: float, state: State, p: State) -> float:
    """Force after the mode and a pole at ratio · ω, by partial fractions, and so much of its rate in time.

    p = (frequency, damping_ratio, ratio, s of the rate).
    """
    if state[_STARTED] == 0.0:
        state[_STARTED] = 1.0
        state[_Y] = u
        state[_LAST] = u
        state[_AFTER] = u
    omega = 2.0 * math.pi * p[0]
    y, speed = exact(dt, state[_Y], state[_SPEED], state[_LAST], u, omega, p[1])
    after = first_order(dt, state[_AFTER], state[_LAST], u, 1.0 / (p[2] * omega))
    state[_Y] = y
    state[_SPEED] = speed
    state[_AFTER] = after
    state[_LAST] = u
    share = 1.0 / (1.0 - 2.0 * p[1] * p[2] + p[2] * p[2])
    change = omega * (omega * (u - y) - 2.0 * p[1] * speed)  # of the speed
    rate = speed + share * (p[2] * omega * (u - after) - speed - p[2] / omega * change)
    return y + share * (after - y - p[2] / omega * speed) + p[3] * rate


def _alone(values: Mapping[str, float]) -> tuple[float, ...]:
    """A pole without a zero."""
    return (values["frequency"], values["damping_ratio"], values["ratio"], 0.0)


def _mounted(values: Mapping[str, float]) -> tuple[float, ...]:
    """A pole and the zero of a mount."""
    frequency, damping, ratio = values["frequency"], values["damping_ratio"], values["ratio"]
    return (frequency, damping, ratio, 1.0 / (2.0 * math.pi * frequency * (ratio + 2.0 * damping)))


@block
def pair(dt: float, u: float, state: State, p: State) -> float:
    """Force that passes two modes side by side; p = (frequency, damping_ratio, share, ratio)."""
    if state[_STARTED] == 0.0:
        state[_STARTED] = 1.0
        state[_Y] = u
        state[_LAST] = u
        state[_AFTER] = u
    omega = 2.0 * math.pi * p[0]
    y, speed = exact(dt, state[_Y], state[_SPEED], state[_LAST], u, omega, p[1])
    other, other_speed = exact(dt, state[_AFTER], state[_AFTER_SPEED], state[_LAST], u, p[3] * omega, p[1])
    state[_Y] = y
    state[_SPEED] = speed
    state[_AFTER] = other
    state[_AFTER_SPEED] = other_speed
    state[_LAST] = u
    return other + p[2] * (y - other)


@block
def antiresonance(dt: float, u: float, state: State, p: State) -> float:
    """Force after a pair of poles and a pair of zeros; p = (frequency, damping_ratio, ratio)."""
    if state[_STARTED] == 0.0:
        state[_STARTED] = 1.0
        state[_Y] = u
        state[_LAST] = u
    omega = 2.0 * math.pi * p[0]
    y, speed = exact(dt, state[_Y], state[_SPEED], state[_LAST], u, omega, p[1])
    state[_Y] = y
    state[_SPEED] = speed
    state[_LAST] = u
    rate = 2.0 * p[1] * speed / omega
    return y + rate / p[2] + (u - y - rate) / (p[2] * p[2])


@block
def loaded(dt: float, u: float, state: State, p: State) -> float:
    """Force after a mode whose stiffness goes with it; p = (frequency, damping_ratio, growth, at_force)."""
    if state[_STARTED] == 0.0:
        state[_STARTED] = 1.0
        state[_Y] = u
        state[_LAST] = u
    borne = min(max(0.5 * (u + state[_LAST]) / p[3], 0.0), 2.0)
    stiffer = math.sqrt(max(1.0 + p[2] * (borne - 1.0), 0.2))
    y, speed = exact(
        dt, state[_Y], state[_SPEED], state[_LAST], u, 2.0 * math.pi * p[0] * stiffer, min(p[1] / stiffer, 0.99)
    )
    state[_Y] = y
    state[_SPEED] = speed
    state[_LAST] = u
    return y


@block
def damper(dt: float, u: float, state: State, p: State) -> float:
    """Force after a mode with a damper of its own; p = (frequency, damping_ratio of the rest, strength, exponent).

    The damper takes speed as v' = −strength · |v|^exponent, for half of each part of the step before and after what
    the rest of the mode does (G. Strang, SIAM J. Numer. Anal. 5, 1968, 506–517); where it would stop the mode in the
    first half, after it, for the whole of it.
    """
    if state[_STARTED] == 0.0:
        state[_STARTED] = 1.0
        state[_Y] = u
        state[_LAST] = u
    omega = 2.0 * math.pi * p[0]
    parts = min(1 + int(omega * max(dt, 0.0) / _TURN), _MOST_PARTS)
    part = max(dt, 0.0) / parts
    y = state[_Y]
    speed = state[_SPEED]
    before = state[_LAST]
    for k in range(parts):
        after = before + (u - before) / (parts - k)
        slower = _braked(0.5 * part, speed, p[2], p[3])
        if slower == 0.0:  # it sticks, or creeps: what pulls at it is held at once
            _, pulled = exact(part, y, speed, before, after, omega, p[1])
            slower = _braked(part, pulled, p[2], p[3])
            y += 0.5 * part * (speed + slower)
            speed = slower
        else:
            y, speed = exact(part, y, slower, before, after, omega, p[1])
            speed = _braked(0.5 * part, speed, p[2], p[3])
        before = after
    state[_Y] = y
    state[_SPEED] = speed
    state[_LAST] = u
    return y


def _damped(values: Mapping[str, float]) -> tuple[float, ...]:
    """Damping shared out between a viscous damper and one of another power, of equal loss in a swing."""
    omega = 2.0 * math.pi * values["frequency"]
    n, zeta, share = values["exponent"], values["damping_ratio"], values["share"]
    loss = math.sqrt(math.pi) * math.gamma(0.5 * n + 1.5) / (2.0 * math.gamma(0.5 * n + 1.0))  # π over ∮ |cos|^(n+1)
    fastest = omega * values["at_swing"]
    return (values["frequency"], (1.0 - share) * zeta, 2.0 * share * zeta * omega * loss * fastest ** (1.0 - n), n)


_FREQUENCY = Parameter(
    "frequency",
    "Hz",
    0.5,
    5000.0,
    60.0,
    "natural frequency",
    required=True,
    starts=(8.0, 15.0, 30.0, 60.0, 120.0, 240.0, 480.0),
)
_DAMPING = Parameter(
    "damping_ratio", "1", 1e-3, 0.5, 0.1, "damping over critical damping", required=True, starts=(0.03, 0.2)
)

EFFECT = Effect(
    id="resonance",
    what="Cell, probe and what holds them ring at their own frequency.",
    says="the force path rings at {frequency:.4g} Hz with a damping ratio of {damping_ratio:.3g}",
    check="tap the probe in free air and look at the ringing; a lighter probe or a stiffer mount raises its frequency",
    reference="Thomson, Theory of Vibration with Applications, 4th ed., 1993",
    of_motion=False,
    forms=(
        Form(
            name="low_pass",
            what="the whole force passes the mode",
            parameters=(_FREQUENCY, _DAMPING),
            blocks={"sensor": low_pass},
            state=(0.0,) * 4,
        ),
        Form(
            name="partial",
            what="a share of the force passes the mode",
            parameters=(
                _FREQUENCY,
                _DAMPING,
                Parameter(
                    "share", "1", -2.0, 2.0, 0.3, "share of the force that rings", amplitude=True, starts=(0.3, -0.3)
                ),
            ),
            sought=False,
            blocks={"sensor": partial},
            state=(0.0,) * 4,
        ),
        Form(
            name="transmitted",
            what="spring and damper of the mode pass the force",
            parameters=(_FREQUENCY, _DAMPING),
            sought=False,
            blocks={"sensor": transmitted},
            state=(0.0,) * 4,
        ),
        Form(
            name="amplifier",
            what="the mode, and a first-order lag after it",
            parameters=(
                _FREQUENCY,
                _DAMPING,
                Parameter("ratio", "1", 0.5, 20.0, 3.0, "corner of the lag over the natural frequency"),
            ),
            sought=False,
            blocks={"sensor": amplifier},
            state=(0.0,) * 5,
            pack=_alone,
        ),
        Form(
            name="mounted",
            what="the mode on a mount of rubber",
            parameters=(
                _FREQUENCY,
                _DAMPING,
                Parameter("ratio", "1", 0.2, 5.0, 1.0, "rate at which the mount relaxes over the natural frequency"),
            ),
            sought=False,
            blocks={"sensor": amplifier},
            state=(0.0,) * 5,
            pack=_mounted,
        ),
        Form(
            name="pair",
            what="two modes, each for a share of the force",
            parameters=(
                _FREQUENCY,
                _DAMPING,
                Parameter("share", "1", 0.5, 1.0, 0.65, "share of the force that passes the mode stated"),
                Parameter("ratio", "1", 0.3, 4.0, 1.2, "frequency of the other mode over it", starts=(1.2, 2.4)),
            ),
            sought=False,
            blocks={"sensor": pair},
            state=(0.0,) * 6,
        ),
        Form(
            name="antiresonance",
            what="the mode, and another part that absorbs it above",
            parameters=(
                _FREQUENCY,
                _DAMPING,
                Parameter("ratio", "1", 1.05, 10.0, 1.8, "frequency of the antiresonance over the mode's"),
            ),
            sought=False,
            blocks={"sensor": antiresonance},
            state=(0.0,) * 4,
        ),
        Form(
            name="loaded",
            what="the mode is stiffer or softer under load",
            parameters=(
                _FREQUENCY,
                _DAMPING,
                Parameter("growth", "1", -0.8, 0.8, 0.2, "growth of the stiffness from no load to the force stated"),
                Parameter("at_force", "N", 1e-3, 1e5, 5.0, "force at which the frequency is as stated", fixed=True),
            ),
            sought=False,
            blocks={"sensor": loaded},
            state=(0.0,) * 4,
        ),
        Form(
            name="damper",
            what="the mode has a damper that goes with a power of the speed",
            parameters=(
                _FREQUENCY,
                _DAMPING,
                Parameter("share", "1", 0.0, 1.0, 0.7, "share of the damping that is this damper's", starts=(0.7,)),
                Parameter("exponent", "1", 0.0, 2.0, 2.0, "power of the speed", starts=(0.0, 0.6, 2.0)),
                Parameter("at_swing", "N", 1e-6, 1e5, 0.1, "swing with the damping stated", fixed=True),
            ),
            sought=False,
            blocks={"sensor": damper},
            state=(0.0,) * 4,
            pack=_damped,
        ),
    ),
)
