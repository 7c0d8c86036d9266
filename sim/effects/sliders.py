"""The steps of friction: Prandtl's elements, whose sliders bear different things, and curves of speed. No effect itself
(`friction`, where they are described).
"""

from __future__ import annotations

import math

from sim.jit import State, block, compiled

_LAST, _FORCE, _STARTED, _LOAD = range(4)
_GREASE = 3
_CREEP_MM_S = 0.1
"""Speed below which `logarithmic` falls no further."""
_FIRST, _ELEMENTS = 3, 5


@compiled("float64(float64, float64, float64, float64)")
def slid(force: float, moved: float, stiffness: float, limit: float) -> float:
    """Prandtl's element: the force, N, of a spring of `stiffness` N/mm before a slider that bears `limit` N either way,
    once it has moved by so many mm from where it had `force`."""
    return max(-limit, min(limit, force + moved * stiffness))


@block
def coulomb(dt: float, y: float, state: State, p: State) -> float:
    """Prandtl's element; p = (coulomb, presliding)."""
    moved = y - state[_LAST] if state[_STARTED] != 0.0 else 0.0
    state[_STARTED] = 1.0
    state[_LAST] = y
    state[_FORCE] = slid(state[_FORCE], moved, p[0] / p[1], p[0])
    return state[_FORCE]


@block
def dahl(dt: float, y: float, state: State, p: State) -> float:
    """Dahl's model over the distance moved; p = (coulomb, presliding)."""
    moved = y - state[_LAST] if state[_STARTED] != 0.0 else 0.0
    state[_STARTED] = 1.0
    state[_LAST] = y
    ceiling = p[0] if moved >= 0.0 else -p[0]
    force = state[_FORCE] + (ceiling - state[_FORCE]) * -math.expm1(-abs(moved) / p[1])
    state[_FORCE] = force
    return force


@block
def maxwell_slip(dt: float, y: float, state: State, p: State) -> float:
    """Prandtl's elements side by side, of equal strength; p = (coulomb, presliding, spread)."""
    moved = y - state[_LAST] if state[_STARTED] != 0.0 else 0.0
    state[_STARTED] = 1.0
    state[_LAST] = y
    limit = p[0] / _ELEMENTS
    total = 0.0
    for k in range(_ELEMENTS):
        reach = p[1] * p[2] ** (k - 0.5 * (_ELEMENTS - 1))
        state[_FIRST + k] = slid(state[_FIRST + k], moved, limit / reach, limit)
        total += state[_FIRST + k]
    return total


@block
def stribeck(dt: float, y: float, state: State, p: State) -> float:
    """Prandtl's element with a slider that depends on speed.

    p = (coulomb, static_ratio, stribeck_speed, viscous, presliding).
    """
    moved = y - state[_LAST] if state[_STARTED] != 0.0 else 0.0
    state[_STARTED] = 1.0
    state[_LAST] = y
    speed = abs(moved) / dt if dt > 0.0 else 0.0
    limit = p[0] * (1.0 + (p[1] - 1.0) * math.exp(-((speed / p[2]) ** 2)))
    state[_FORCE] = slid(state[_FORCE], moved, p[0] / p[4], limit)
    viscous = p[3] * moved / dt if dt > 0.0 else 0.0
    return state[_FORCE] + viscous


@block
def note_depth(dt: float, depth: float, state: State, p: State) -> float:
    """Leaves the depth as it is, and notes it for the friction."""
    state[_LOAD] = max(depth, 0.0)
    return depth


@block
def note_load(dt: float, force: float, state: State, p: State) -> float:
    """Adds nothing to the pad's force, and notes it for the friction, where `load_dependent` has the depth."""
    state[_LOAD] = abs(force)
    return 0.0


@block
def load_dependent(dt: float, y: float, state: State, p: State) -> float:
    """Prandtl's element with a slider that depends on what was noted; p = (coulomb, load, presliding)."""
    moved = y - state[_LAST] if state[_STARTED] != 0.0 else 0.0
    state[_STARTED] = 1.0
    state[_LAST] = y
    limit = p[0] * (1.0 + p[1] * state[_LOAD])
    state[_FORCE] = slid(state[_FORCE], moved, limit / p[2], limit)
    return state[_FORCE]


@block
def worked_in(dt: float, y: float, state: State, p: State) -> float:
    """Prandtl's element behind grease; p = (coulomb, stiffness, way, rest, presliding); state: the grease's too."""
    if state[_STARTED] == 0.0:
        state[_STARTED] = 1.0
        state[_LAST] = y
        state[_GREASE] = 1.0
    moved = y - state[_LAST]
    state[_LAST] = y
    back, gone = dt / p[3], abs(moved) / p[2]
    if back + gone > 0.0:  # exact where speed is constant
        settled = back / (back + gone)
        state[_GREASE] = settled + (state[_GREASE] - settled) * math.exp(-back - gone)
    limit = p[0] * (1.0 + p[1] * state[_GREASE])
    state[_FORCE] = slid(state[_FORCE], moved, limit / p[4], limit)
    return state[_FORCE]


@block
def uneven(dt: float, y: float, state: State, p: State) -> float:
    """Prandtl's element over uneven ground; p = (coulomb, sine_1, cosine_1, sine_2, cosine_2, reach, presliding)."""
    moved = y - state[_LAST] if state[_STARTED] != 0.0 else 0.0
    state[_STARTED] = 1.0
    state[_LAST] = y
    angle = 2.0 * math.pi * y / p[5]
    more = p[1] * math.sin(angle) + p[2] * math.cos(angle) + p[3] * math.sin(2.0 * angle) + p[4] * math.cos(2.0 * angle)
    limit = p[0] * max(1.0 + more, 0.0)
    state[_FORCE] = slid(state[_FORCE], moved, p[0] / p[6], limit)
    return state[_FORCE]


@block
def tight(dt: float, y: float, state: State, p: State) -> float:
    """Prandtl's element over a rail with a tight place; p = (coulomb, more, place, width, presliding)."""
    moved = y - state[_LAST] if state[_STARTED] != 0.0 else 0.0
    state[_STARTED] = 1.0
    state[_LAST] = y
    away = (y - p[2]) / p[3]
    limit = p[0] * (1.0 + p[1] * math.exp(-away * away))
    state[_FORCE] = slid(state[_FORCE], moved, p[0] / p[4], limit)
    return state[_FORCE]


@block
def swelling(dt: float, y: float, state: State, p: State) -> float:
    """Prandtl's element whose limit swells along the way; p = (coulomb, swell, turn, angle, presliding)."""
    moved = y - state[_LAST] if state[_STARTED] != 0.0 else 0.0
    state[_STARTED] = 1.0
    state[_LAST] = y
    limit = p[0] * (1.0 + p[1] * math.sin(2.0 * math.pi * y / p[2] + p[3]))
    state[_FORCE] = slid(state[_FORCE], moved, p[0] / p[4], limit)
    return state[_FORCE]


@block
def logarithmic(dt: float, y: float, state: State, p: State) -> float:
    """Prandtl's element with a slider that depends on speed; p = (coulomb, growth, presliding)."""
    moved = y - state[_LAST] if state[_STARTED] != 0.0 else 0.0
    state[_STARTED] = 1.0
    state[_LAST] = y
    speed = abs(moved) / dt if dt > 0.0 else 0.0
    limit = p[0] * max(1.0 + p[1] * math.log((_CREEP_MM_S + speed) / (_CREEP_MM_S + 1.0)), 0.0)
    state[_FORCE] = slid(state[_FORCE], moved, p[0] / p[2], limit)
    return state[_FORCE]


@block
def one_way(dt: float, y: float, state: State, p: State) -> float:
    """Prandtl's element with a slider for each way; p = (coulomb, differs, presliding)."""
    moved = y - state[_LAST] if state[_STARTED] != 0.0 else 0.0
    state[_STARTED] = 1.0
    state[_LAST] = y
    force = state[_FORCE] + moved * (p[0] / p[2])
    force = max(-p[0] * (1.0 - p[1]), min(p[0] * (1.0 + p[1]), force))
    state[_FORCE] = force
    return force


@block
def smoothed(dt: float, y: float, state: State, p: State) -> float:
    """A tanh of the speed; p = (coulomb, speed)."""
    moved = y - state[_LAST] if state[_STARTED] != 0.0 else 0.0
    state[_STARTED] = 1.0
    state[_LAST] = y
    return p[0] * math.tanh(moved / (dt * p[1])) if dt > 0.0 else 0.0


@block
def by_speed(dt: float, y: float, state: State, p: State) -> float:
    """The Stribeck curve; p = (coulomb, static_ratio, stribeck_speed, viscous, speed)."""
    moved = y - state[_LAST] if state[_STARTED] != 0.0 else 0.0
    state[_STARTED] = 1.0
    state[_LAST] = y
    if dt <= 0.0:
        return 0.0
    v = moved / dt
    level = p[0] * (1.0 + (p[1] - 1.0) * math.exp(-((v / p[2]) ** 2)))
    return level * math.tanh(v / p[4]) + p[3] * v
