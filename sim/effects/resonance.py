"""Resonance of the force path: cell, probe and what holds them swing at their own frequency.

The damping ratio ends at 0.5: beyond, a second-order low-pass has next to no peak left, and is a sensor lag.

- `low_pass`: all of the force passes ω²/(s² + 2ζω s + ω²).
- `partial`: a share of it does, the rest passes as it is: a mode of part of the structure, which adds a ringing at each
  sudden change and nothing to what is slow.
- `transmitted`: the damper stands beside the spring and bears too, (2ζω s + ω²)/(s² + 2ζω s + ω²). It comes no later
  than a ramp in the end.
- `amplifier`: a pole at `ratio` times ω comes after the mode, as of an amplifier whose bandwidth is not far above it.

Exact for a force that is linear between samples, at any spacing.

Reference: W. T. Thomson, Theory of Vibration with Applications, 4th ed., Prentice Hall, 1993; E. O. Doebelin,
Measurement Systems: Application and Design, 4th ed., McGraw-Hill, 1990, chapter 3; J. P. Den Hartog, Mechanical
Vibrations, 4th ed., McGraw-Hill, 1956, section 2.12 (transmissibility).
"""

from __future__ import annotations

import math

from sim.effects.base import Effect, Form, Parameter
from sim.effects.linear import first_order
from sim.effects.linear import low_pass as exact
from sim.jit import State, block

_Y, _SPEED, _LAST, _STARTED, _AFTER = range(5)


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
    """Force after the mode and a pole at ratio · ω, by partial fractions; p = (frequency, damping_ratio, ratio)."""
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
    return y + share * (after - y - p[2] / omega * speed)


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
        ),
    ),
)
