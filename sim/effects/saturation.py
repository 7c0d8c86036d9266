"""Saturation: the reported force ends at a limit.

- `hard`: at ±limit.
- `upper`: at +limit alone.
- `stop`: beyond +limit an overload stop bears beside the cell, which feels a share of what is more, as the stiffnesses
  of both have it.
- `folding`: beyond +limit the output falls again, by a share of what is more: an output stage that limits its current
  the more, the more it is overloaded (foldback).
- `recovering`: at +limit for a time after the force has come back below it too: an amplifier that was driven into its
  rail takes a while to leave it (its overload recovery time).
- `compressing`: beyond ±limit by the logarithm of what is more, limit + reach ln(1 + (|u| − limit)/reach): diodes that
  protect an input, or an automatic gain.
- `soft`: a knee, u/(1 + |u/limit|^sharpness)^(1/sharpness): an amplifier near its rails.

Reference: H. K. Khalil, Nonlinear Systems, 3rd ed., Prentice Hall, 2002, section 1.2 (common nonlinearities); E. O.
Doebelin, Measurement Systems: Application and Design, 4th ed., McGraw-Hill, 1990, chapter 5 (overload stops).
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from sim.effects.base import Effect, Form, Parameter
from sim.jit import State, block


@block
def hard(dt: float, force: float, state: State, p: State) -> float:
    """Between −limit and +limit; p = (limit,)."""
    return max(-p[0], min(p[0], force))


@block
def upper(dt: float, force: float, state: State, p: State) -> float:
    """No more than +limit; p = (limit,)."""
    return min(p[0], force)


@block
def sloping(dt: float, force: float, state: State, p: State) -> float:
    """Up, or down again, by a share of what is beyond +limit; p = (limit, slope)."""
    return force if force <= p[0] else p[0] + p[1] * (force - p[0])


def _falling(values: Mapping[str, float]) -> tuple[float, ...]:
    """What `folding` is of `sloping`."""
    return (values["limit"], -values["falls"])


@block
def recovering(dt: float, force: float, state: State, p: State) -> float:
    """At +limit for a time after each overload, which ends within tenths of it; p = (limit, recovery). State: whether
    there was one, and the time since."""
    if force >= p[0]:
        state[0], state[1] = 1.0, 0.0
        return p[0]
    state[1] += dt
    late = (state[1] / p[1] - 1.0) * 20.0
    if state[0] == 0.0 or late > 40.0:
        return force
    return force + (p[0] - force) / (1.0 + math.exp(late))


@block
def soft(dt: float, force: float, state: State, p: State) -> float:
    """Towards ±limit with a knee; p = (limit, sharpness)."""
    ratio = abs(force) / p[0]
    if ratio <= 1.0:
        return float(force / (1.0 + ratio ** p[1]) ** (1.0 / p[1]))
    end = p[0] if force > 0.0 else -p[0]
    return float(end / (1.0 + ratio ** -p[1]) ** (1.0 / p[1]))


@block
def compressing(dt: float, force: float, state: State, p: State) -> float:
    """The logarithm of what is beyond ±limit; p = (limit, reach)."""
    more = abs(force) - p[0]
    if more <= 0.0:
        return force
    return math.copysign(p[0] + p[1] * math.log1p(more / p[1]), force)


_LIMIT = Parameter(
    "limit", "N", 1e-3, 1e5, 8.0, "greatest force reported", required=True, starts=(1.0, 2.0, 4.0, 8.0, 16.0)
)

EFFECT = Effect(
    id="saturation",
    what="The reported force ends at a limit.",
    says="the force channel ends at {limit:.4g} N",
    check="raise the amplifier's range, or take a cell of greater capacity; never press on beyond it",
    reference="Khalil, Nonlinear Systems, 3rd ed., 2002, section 1.2",
    forms=(
        Form(name="hard", what="on both sides", parameters=(_LIMIT,), blocks={"sampling": hard}),
        Form(name="upper", what="in compression alone", parameters=(_LIMIT,), blocks={"sampling": upper}),
        Form(
            name="stop",
            what="in compression, where a stop bears with the cell",
            parameters=(
                _LIMIT,
                Parameter("passes", "1", 0.0, 0.5, 0.05, "share of what is beyond that the cell feels"),
            ),
            sought=False,
            blocks={"sampling": sloping},
        ),
        Form(
            name="folding",
            what="in compression, where the output falls again",
            parameters=(
                _LIMIT,
                Parameter("falls", "1", 0.0, 1.0, 0.1, "share of what is beyond by which it falls"),
            ),
            sought=False,
            blocks={"sampling": sloping},
            pack=_falling,
        ),
        Form(
            name="recovering",
            what="in compression, and for a while after",
            parameters=(
                _LIMIT,
                Parameter("recovery", "s", 1e-3, 5.0, 0.03, "how long it stays there", starts=(0.005, 0.02, 0.08)),
            ),
            sought=False,
            blocks={"sampling": recovering},
            state=(0.0, 0.0),
        ),
        Form(
            name="soft",
            what="with a knee",
            parameters=(
                _LIMIT,
                Parameter("sharpness", "1", 1.0, 60.0, 8.0, "sharpness of the knee", starts=(3.0, 20.0)),
            ),
            blocks={"sampling": soft},
        ),
        Form(
            name="compressing",
            what="by the logarithm of what is more",
            parameters=(
                _LIMIT,
                Parameter("reach", "N", 1e-4, 1e3, 0.1, "force over which it bends", starts=(0.02, 0.2)),
            ),
            sought=False,
            blocks={"sampling": compressing},
        ),
    ),
)
