"""One pole whose time goes with what it passes, or with time. No effect itself (`sensor_lag`)."""

from __future__ import annotations

import math

from sim.effects.linear import first_order as lagged
from sim.jit import State, block, compiled

_Y, _LAST, _STARTED, _SINCE = range(4)


@compiled("float64(float64, float64, float64, float64, float64, float64)")
def one_pole(dt: float, started: float, y: float, before: float, u: float, tau: float) -> float:
    """Output of 1/(1 + τs) after dt; at the first sample, and where nothing lags, the input."""
    if started == 0.0 or tau <= 0.0:
        return u
    return lagged(dt, y, before, u, tau)


@block
def throttled(dt: float, u: float, state: State, p: State) -> float:
    """One pole, of one time as the output rises and another as it falls; p = (time_constant, uneven)."""
    rises = 0.5 * (state[_LAST] + u) > state[_Y]
    tau = p[0] * (1.0 - p[1] if rises else 1.0 + p[1])
    y = one_pole(dt, state[_STARTED], state[_Y], state[_LAST], u, tau)
    state[_STARTED], state[_Y], state[_LAST] = 1.0, y, u
    return y


@block
def slewing(dt: float, u: float, state: State, p: State) -> float:
    """One pole, whose output has a greatest rate; p = (time_constant, slow, at_force)."""
    y = one_pole(dt, state[_STARTED], state[_Y], state[_LAST], u, p[0])
    if state[_STARTED] != 0.0 and p[0] > 0.0 and p[1] > 0.0:
        most = dt * p[2] / (p[1] * p[0])
        y = min(max(y, state[_Y] - most), state[_Y] + most)
    state[_STARTED], state[_Y], state[_LAST] = 1.0, y, u
    return y


@block
def loaded(dt: float, u: float, state: State, p: State) -> float:
    """One pole, whose time goes with the force; p = (time_constant, growth, at_force)."""
    borne = min(max(state[_Y] / p[2], 0.0), 2.0)
    tau = p[0] * math.exp(p[1] * (borne - 1.0))
    y = one_pole(dt, state[_STARTED], state[_Y], state[_LAST], u, tau)
    state[_STARTED], state[_Y], state[_LAST] = 1.0, y, u
    return y


@block
def warming(dt: float, u: float, state: State, p: State) -> float:
    """One pole, whose time goes with the time since the first sample; p = (time_constant, growth, bend, at_time)."""
    middle = (state[_SINCE] + 0.5 * dt) / p[3] - 1.0
    tau = p[0] * math.exp(p[1] * middle + p[2] * (1.5 * middle * middle - 0.5))
    y = one_pole(dt, state[_STARTED], state[_Y], state[_LAST], u, tau)
    state[_STARTED], state[_Y], state[_LAST] = 1.0, y, u
    state[_SINCE] += dt
    return y


@block
def opening(dt: float, u: float, state: State, p: State) -> float:
    """One pole, the quicker the more is missing; p = (time_constant, opens, at_force). The time is that of what is
    missing on the mean of a step, as a step with the time of its begin foretells it."""
    y, before = state[_Y], state[_LAST]
    missing = abs(before - y)
    for _ in range(2):
        tau = p[0] / (1.0 + p[1] * missing / p[2])
        after = one_pole(dt, state[_STARTED], y, before, u, tau)
        missing = 0.5 * (abs(before - y) + abs(u - after))
    state[_STARTED], state[_Y], state[_LAST] = 1.0, after, u
    return after
