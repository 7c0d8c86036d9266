"""The compiled loop of the axis: servo, mover and plant on one fixed grid of substeps.

Per substep of length h: set-point → servo force (limited) → mover, with rail friction, weight, end stops and the force
at the cell of the last substep → new position → plant. The mover is integrated by the semi-implicit Euler rule, which
is stable for ω h < 2 and keeps a held axis at rest. The plant takes the position as linear over the substep.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sim.jit import compiled, pointer
from sim.kernel import plant_step
from sim.slots import SENSOR, chain

Array = NDArray[np.float64]
Program = NDArray[np.int64]

# settings
(
    SUBSTEP,
    MASS,
    OMEGA,
    DAMPING,
    INTEGRAL_RATE,
    MAX_FORCE,
    MAX_ACCELERATION,
    MAX_SPEED,
    LOW,
    HIGH,
    RAIL_FRICTION,
    WEIGHT,
    SURFACE,
    SETTINGS,
) = range(14)

# axis: where it is …
POSITION, SPEED, FORCE, MOTOR_FORCE, INTEGRAL, AT_STOP = range(6)
# … and what it was told: mode, set-point and its speed; of a profile its start, direction, speeds and durations
MODE, BRAKED, SETPOINT, FEED, FEED_UNTIL = range(6, 11)
P_TIME, P_START, P_END, P_SIGN, P_SPEED, P_A1, P_T1, P_T2, P_PEAK, P_A3, P_T3 = range(11, 22)
PUSH_FORCE, PUSH_DAMPING = 22, 23
AXIS = 24

RELEASED, STREAM, PROFILE, PUSH = range(4)

# history rows
H_POSITION, H_SPEED, H_FORCE, H_SENSED, H_MOTOR, H_SETPOINT, HISTORY = range(7)

_MM = 1000.0  # mm in a metre: N/kg is m/s²


@compiled("Tuple((float64, float64, float64))(float64[::1], float64)")
def profile_at(axis: Array, t: float) -> tuple[float, float, float]:
    """Set-point in mm, its speed and acceleration at time t of the profile in `axis`."""
    since = max(0.0, t - axis[P_TIME])
    sign, u0, a1, t1, t2 = axis[P_SIGN], axis[P_SPEED], axis[P_A1], axis[P_T1], axis[P_T2]
    peak, a3, t3 = axis[P_PEAK], axis[P_A3], axis[P_T3]
    if since < t1:
        return axis[P_START] + sign * (u0 + 0.5 * a1 * since) * since, sign * (u0 + a1 * since), sign * a1
    way = (u0 + 0.5 * a1 * t1) * t1
    if since < t1 + t2:
        return axis[P_START] + sign * (way + peak * (since - t1)), sign * peak, 0.0
    left = t1 + t2 + t3 - since
    if left > 0.0:
        return axis[P_END] - sign * 0.5 * a3 * left * left, sign * a3 * left, -sign * a3
    return axis[P_END], 0.0, 0.0


@compiled("Tuple((float64, float64, float64))(float64[::1], float64)")
def setpoint_at(axis: Array, t: float) -> tuple[float, float, float]:
    """Set-point in mm, the speed and the acceleration fed forward at time t."""
    if axis[MODE] == PROFILE:
        return profile_at(axis, t)
    if axis[MODE] == STREAM:
        return axis[SETPOINT], axis[FEED] if t < axis[FEED_UNTIL] else 0.0, 0.0
    return axis[POSITION], 0.0, 0.0


@compiled("void(int64[::1], float64[::1], float64[::1], float64[::1], float64[::1], float64[:, ::1], int64, int64)")
def run_axis(
    program: Program, params: Array, state: Array, s: Array, axis: Array, history: Array, first: int, last: int
) -> None:
    """Substeps first+1 … last; the state after substep n goes to row n modulo the rows of `history`."""
    h, mass = s[SUBSTEP], s[MASS]
    omega2 = s[OMEGA] * s[OMEGA]
    x, v, F = axis[POSITION], axis[SPEED], axis[FORCE]
    motor = 0.0
    program_p, params_p, state_p = pointer(program), pointer(params), pointer(state)
    for n in range(first + 1, last + 1):
        target, speed, acceleration = setpoint_at(axis, (n - 1) * h)
        if axis[MODE] == RELEASED or axis[MODE] == PUSH:
            motor = axis[PUSH_FORCE] - axis[PUSH_DAMPING] * v if axis[MODE] == PUSH else 0.0
            motor = max(-s[MAX_FORCE], min(s[MAX_FORCE], motor))
            axis[INTEGRAL] = 0.0
            target = x
        else:
            error = target - x
            wanted = acceleration + omega2 * error + 2.0 * s[DAMPING] * s[OMEGA] * (speed - v) + axis[INTEGRAL]
            limited = max(-s[MAX_ACCELERATION], min(s[MAX_ACCELERATION], wanted))
            ceiling = _MM * s[MAX_FORCE] / mass
            limited = max(-ceiling, min(ceiling, limited))
            if v >= s[MAX_SPEED]:
                limited = min(limited, 0.0)
            elif v <= -s[MAX_SPEED]:
                limited = max(limited, 0.0)
            if (
                limited == wanted and axis[BRAKED] == 0.0
            ):  # an integral that grows against a limit would overshoot later
                axis[INTEGRAL] += s[INTEGRAL_RATE] * omega2 * error * h
            motor = limited * mass / _MM
        if axis[BRAKED] != 0.0:
            v = 0.0
        else:
            v += _MM * h / mass * (motor - F + s[WEIGHT])
            rub = _MM * h / mass * s[RAIL_FRICTION]
            v = v - math.copysign(rub, v) if abs(v) > rub else 0.0
            x += v * h
        axis[AT_STOP] = 0.0
        if x <= s[LOW]:
            x, v, axis[AT_STOP] = s[LOW], max(v, 0.0), -1.0
        elif x >= s[HIGH]:
            x, v, axis[AT_STOP] = s[HIGH], min(v, 0.0), 1.0
        axis[POSITION], axis[SPEED] = x, v
        F = plant_step(program_p, params_p, state_p, h, x - s[SURFACE])
        row = n % history.shape[0]
        history[row, H_POSITION] = x
        history[row, H_SPEED] = v
        history[row, H_FORCE] = F
        history[row, H_SENSED] = chain(program_p, params_p, state_p, 0, SENSOR, h, F)
        history[row, H_MOTOR] = motor
        history[row, H_SETPOINT] = target
    axis[FORCE] = F
    axis[MOTOR_FORCE] = motor
