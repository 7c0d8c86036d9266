"""The compiled loop of the plant: one step, and the same step over arrays.

Of a plant's program, parameters and state (sim/slots.py). One step, from motor side to load cell:

    x ─ play ─►(+)─► y ─ depth ─► δ ─ law·elastic ─► F^e ─ relaxation ─► + contact, gap ─► F_pad ─► + load(F_pad),
                ▲ −                                                                              probe(y) ─► F_cell
                └────────────────────────────────── frame ◄───────────────────────────────────────────────┘

Everything between frame and cell is inside a loop without delay: y + Σ frame(F_cell(y)) = x is solved in every step, to
rounding, on trial copies of the state, and the copy at the solution becomes the state.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sim.jit import call_block, compiled, pointer
from sim.slots import (
    BONDED,
    CACHE,
    CELL,
    CONTACT,
    DEPTH,
    ELASTIC,
    FE,
    FILM,
    FRAME,
    GAP,
    INNER,
    INNER_SIZE,
    LAW,
    LOAD,
    MODES,
    ONCE,
    PAD_DEPTH,
    PAD_FORCE,
    PLAY,
    PROBE,
    PULLED,
    RATE,
    RECOVERS,
    RELAX,
    REPORT,
    RESIDUAL,
    SCRATCH,
    SLOPE,
    STARTS,
    SURFACE,
    TRIAL,
    TRIAL_CELL,
    UNILATERAL,
    Array,
    Doubles,
    Ints,
    Program,
    W,
    X,
    Y,
    chain,
    product,
    total,
)
from sim.surface import free_surface, surface_force, torn

_TOLERANCE = 4e-15
_NEXT_IS_NONE = 1e-17  # mm², of the errors of two secant steps: the next is that times half the curvature


@compiled("float64(float64)")
def ramp_gain(x: float) -> float:
    """φ(x) = (1 − e^(−x)) / x, the ramp-invariant gain of a mode with x = ν dt; 1 at x = 0."""
    if x < 0.02:  # the series is exact to rounding here, and quicker than expm1
        return 1.0 - x / 2 * (1.0 - x / 3 * (1.0 - x / 4 * (1.0 - x / 5 * (1.0 - x / 6 * (1.0 - x / 7)))))
    return -math.expm1(-x) / x


@compiled("void(CPointer(int64), CPointer(float64), CPointer(float64), float64)")
def faded(program: Ints, params: Doubles, state: Doubles, scaled: float) -> None:
    """Decay and gain of the modes in a step of `scaled` seconds, which are kept while the step stays the same."""
    r, relax, cache = program[MODES], program[RELAX], program[CACHE]
    if state[cache] != scaled:
        state[cache] = scaled
        for i in range(r):
            x = params[relax + 1 + r + i] * scaled
            gain = ramp_gain(x)
            state[cache + 1 + i] = 1.0 - x * gain
            state[cache + 1 + r + i] = gain


@compiled("float64(CPointer(int64), CPointer(float64), int64, float64, float64)")
def touched(program: Ints, state: Doubles, pad: int, dt: float, depth: float) -> float:
    """For how long the pad at `pad` is touched in a step to `depth`: less where it is met within the step, at full
    speed; a frame between takes that up."""
    before, surface = state[pad + PAD_DEPTH], state[pad + SURFACE]
    if before < surface < depth and program[STARTS + FRAME] == program[STARTS + FRAME + 1]:
        return float(dt * (depth - surface) / (depth - before))
    return dt


@compiled("float64(CPointer(int64), CPointer(float64), CPointer(float64), int64, float64, float64)")
def bonded_step(program: Ints, params: Doubles, state: Doubles, shift: int, dt: float, y: float) -> float:
    """One step of a pad that stays bonded, on the state moved by `shift`: its force, N."""
    r, relax, cache = program[MODES], program[RELAX], program[CACHE]
    pad = program[INNER] + shift
    depth = chain(program, params, state, shift, DEPTH, dt, y)
    faded(program, params, state, dt * product(program, params, state, shift, RATE, dt, depth))
    old = state[pad + FE]
    Fe = product(program, params, state, shift, ELASTIC, dt, depth)
    Fe *= chain(program, params, state, shift, LAW, dt, depth)
    F = params[relax] * Fe
    for i in range(r):
        w, gain = state[pad + W + i], state[cache + 1 + r + i]
        state[pad + W + i] = state[cache + 1 + i] * w + gain * (Fe - old)
        F += params[relax + 1 + i] * state[pad + W + i]
    F += total(program, params, state, shift, CONTACT, touched(program, state, pad, dt, depth), depth)
    state[pad + FE] = Fe
    state[pad + PAD_DEPTH] = depth
    state[pad + SURFACE] = max(depth, 0.0)
    return float(F)


@compiled("float64(CPointer(int64), CPointer(float64), CPointer(float64), int64, float64, float64)")
def pad_step(program: Ints, params: Doubles, state: Doubles, shift: int, dt: float, y: float) -> float:
    """One step of everything between probe position and load cell, on the state moved by `shift`. F_cell in N."""
    r = program[MODES]
    pad = program[INNER] + shift
    relax, cache = program[RELAX], program[CACHE]
    depth = chain(program, params, state, shift, DEPTH, dt, y)
    faded(program, params, state, dt * product(program, params, state, shift, RATE, dt, depth))
    old = state[pad + FE]
    A = 0.0
    B = params[relax]
    for i in range(r):
        c, gain = params[relax + 1 + i], state[cache + 1 + r + i]
        A += c * (state[cache + 1 + i] * state[pad + W + i] - gain * old)
        B += c * gain
    surface = max(depth, 0.0)
    before = state[pad + PAD_DEPTH]
    since = touched(program, state, pad, dt, depth)
    plain = program[STARTS + CONTACT] == program[STARTS + CONTACT + 1]
    simple = plain and program[STARTS + GAP] == program[STARTS + GAP + 1]
    lasting = program[STARTS + ELASTIC] == program[STARTS + ELASTIC + 1]  # nothing remembers where the surface was
    off = False
    pull = 0.0  # of a film, in N
    if program[UNILATERAL] != 0 and not (simple and lasting):
        # a pad that has let go is asked first where its surface is now
        held = program[FILM] != 0 and 0.0 < state[pad + PULLED] < params[program[FILM]]
        apart = not held and depth < state[pad + SURFACE] and before < state[pad + SURFACE]
        F = -1.0 if apart else surface_force(program, params, state, shift, dt, since, depth, A, B)
        if F < 0.0 and not apart:
            pull = torn(program, params, state, shift, dt, F)
        if F < 0.0 and pull != F:
            surface = free_surface(program, params, state, shift, dt, depth, A, B)
            off = surface > depth
            F = 0.0 if off else max(surface_force(program, params, state, shift, dt, since, depth, A, B), 0.0)
            surface = max(surface, 0.0)
        scratch = program[SCRATCH] - program[INNER]
        Fe = state[pad - shift + scratch + FE]
        for k in range(W + r, program[INNER_SIZE]):  # what the blocks remember
            state[pad + k] = state[pad - shift + scratch + k]
    else:
        Fe = product(program, params, state, shift, ELASTIC, dt, depth)
        Fe *= chain(program, params, state, shift, LAW, dt, depth)
        F = A + B * Fe
        if program[UNILATERAL] != 0 and F < 0.0:
            pull = torn(program, params, state, shift, dt, F)
            off = pull != F
        F += total(program, params, state, shift, CONTACT, since, depth)
    if off:
        if plain:
            Fe = -A / B if B > 0.0 else 0.0
        F = pull
    elif F >= 0.0 and program[ONCE] == 0:
        state[pad + PULLED] = 0.0
    for i in range(r):
        w = state[pad + W + i]
        state[pad + W + i] = state[cache + 1 + i] * w + state[cache + 1 + r + i] * (Fe - old)
    if not simple:
        F += total(program, params, state, shift, GAP, dt, surface - depth)
    if program[BONDED] != 0:
        twin = shift + program[INNER_SIZE] // 2
        F += params[program[BONDED]] * (bonded_step(program, params, state, twin, dt, y) - F)
    went = off and before < state[pad + SURFACE] and dt > 0.0  # and not only left where the probe let go
    state[pad + RECOVERS] = (state[pad + SURFACE] - surface) / dt if went else 0.0
    state[pad + FE] = Fe
    state[pad + PAD_DEPTH] = depth
    state[pad + PAD_FORCE] = F
    state[pad + SURFACE] = surface
    F += total(program, params, state, shift, LOAD, dt, F)
    return float(F + total(program, params, state, shift, PROBE, dt, y))


@compiled("float64(CPointer(int64), CPointer(float64), CPointer(float64), float64, float64, float64)")
def imbalance(program: Ints, params: Doubles, state: Doubles, dt: float, x: float, y: float) -> float:
    """y + Σ frame(F_cell(y)) − x, on a fresh trial copy of the state."""
    inner, trial = program[INNER], program[TRIAL]
    for k in range(program[INNER_SIZE]):
        state[trial + k] = state[inner + k]
    shift = trial - inner
    F = pad_step(program, params, state, shift, dt, y)
    state[TRIAL_CELL] = F
    return y + total(program, params, state, shift, FRAME, dt, F) - x


@compiled("float64(CPointer(int64), CPointer(float64), CPointer(float64), float64, float64)")
def solve(program: Ints, params: Doubles, state: Doubles, dt: float, x: float) -> float:
    """Probe position y with y + Σ frame(F_cell(y)) = x; the state becomes the one at y.

    Secant steps kept within a bracket once there is one. A passive frame and pad have a slope of at least 1, so that a
    full step of the imbalance brackets the root; where some block pushes the other way the step is doubled.
    """
    slope = state[SLOPE]
    a = state[Y] + (x - state[X]) * slope
    f_a = imbalance(program, params, state, dt, x, a)
    b, f_b = a, f_a
    tolerance = _TOLERANCE * max(abs(x), abs(a), 0.1)
    if abs(f_a) > tolerance:
        low, high = -math.inf, math.inf
        if f_a < 0.0:
            low = a
        else:
            high = a
        b = a - f_a * slope
        reach = 1.0
        stale = 0
        for n in range(200):
            f_b = imbalance(program, params, state, dt, x, b)
            if n == 0 and abs(b - a) > 1e-7 and f_b != f_a:
                state[SLOPE] = min(1.0, max(0.01, (b - a) / (f_b - f_a)))
            if abs(f_b) <= tolerance:
                break
            before = high - low
            if f_b < 0.0:
                low = b
            else:
                high = b
            c = b - f_b * (b - a) / (f_b - f_a) if f_b != f_a else math.nan
            if high - low < math.inf:
                stale = stale + 1 if high - low > 0.5 * before else 0
                if not low < c < high or stale > 3:
                    c = 0.5 * (low + high)
                    stale = 0
                if not low < c < high:  # nothing lies between: a jump, or rounding
                    break
            else:
                if not abs(c - b) <= abs(f_b) * reach or (c - b) * f_b >= 0.0:
                    c = b - f_b * reach
                    reach *= 2.0
                if c == b:
                    break
            a, f_a = b, f_b
            b = c
    inner, trial = program[INNER], program[TRIAL]
    for k in range(program[INNER_SIZE]):
        state[inner + k] = state[trial + k]
    state[RESIDUAL] = f_b
    state[CELL] = state[TRIAL_CELL]
    return float(b)


@compiled("float64(CPointer(int64), CPointer(float64), CPointer(float64), float64, float64)")
def plant_step(program: Ints, params: Doubles, state: Doubles, dt: float, x: float) -> float:
    """One step of the plant: motor-side position `x` in mm, `dt` seconds after the last; force at the cell in N."""
    x = chain(program, params, state, 0, PLAY, dt, x)
    if program[STARTS + FRAME] == program[STARTS + FRAME + 1]:
        y = x
        state[CELL] = pad_step(program, params, state, 0, dt, y)
    else:
        y = solve(program, params, state, dt, x)
    state[X] = x
    state[Y] = y
    return float(state[CELL])


@compiled("void(float64, float64[::1], float64[::1], float64[::1])")
def fade(rate: float, dt: Array, decay: Array, gain: Array) -> None:
    """What `pad_step` works out for one mode in steps dt (n,): decay e^(−ν dt) and gain φ(ν dt), into the last two."""
    for n in range(dt.size):
        x = rate * dt[n]
        gain[n] = ramp_gain(x)
        decay[n] = 1.0 - x * gain[n]


@compiled(
    "void(int64[::1], float64[::1], float64[::1], float64[::1], float64[::1], float64[::1], float64[::1],"
    " float64[:, ::1], float64[:, ::1])"
)
def run(
    program: Program, params: Array, state: Array, dt: Array, x: Array, force: Array, probe: Array, decay: Array,
    gain: Array,
) -> None:  # fmt: skip
    """`plant_step` over arrays of shape (n,): force at the cell and probe position are written to `force` and `probe`.

    `decay`, `gain` (r, n): of each mode and step as `fade` has them, or (0, n) to have them worked out here.
    """
    program_p, params_p, state_p = pointer(program), pointer(params), pointer(state)
    r, cache = decay.shape[0], program[CACHE]
    for n in range(x.size):
        if r > 0:
            state[cache] = dt[n]
            for i in range(r):
                state[cache + 1 + i] = decay[i, n]
                state[cache + 1 + r + i] = gain[i, n]
        force[n] = plant_step(program_p, params_p, state_p, dt[n], x[n])
        probe[n] = state[Y]


@compiled("float64(int64[::1], float64[::1], float64[::1], float64, float64)")
def step(program: Program, params: Array, state: Array, dt: float, x: float) -> float:
    """`plant_step` for Python."""
    return plant_step(pointer(program), pointer(params), pointer(state), dt, x)


@compiled("float64(int64[::1], float64[::1], float64[::1], int64, float64, float64)")
def chain_step(program: Program, params: Array, state: Array, place: int, dt: float, u: float) -> float:
    """`chain` for Python."""
    return chain(pointer(program), pointer(params), pointer(state), 0, place, dt, u)


@compiled("void(int64[::1], float64[::1], float64[::1], int64, float64[::1], float64[::1])")
def run_chain(program: Program, params: Array, state: Array, place: int, dt: Array, u: Array) -> None:
    """The blocks of a place over an array, in place."""
    program_p, params_p, state_p = pointer(program), pointer(params), pointer(state)
    for n in range(u.size):
        u[n] = chain(program_p, params_p, state_p, 0, place, dt[n], u[n])


@compiled("void(int64[::1], float64[::1], float64[::1], float64[::1])")
def unreport(program: Program, params: Array, state: Array, u: Array) -> None:
    """True positions from reported ones, in place, by bracketed secant steps; `report` blocks are static and rise.

    Each begins beside the one before, by the slope there: positions stand still most of the time.
    """
    program_p, params_p, state_p = pointer(program), pointer(params), pointer(state)
    y, reported, slope = 0.0, 0.0, 1.0
    for n in range(u.size):
        y += (u[n] - reported) / slope
        reported = u[n]
        low, high = -math.inf, math.inf
        before, error_before = y, 0.0
        for k in range(60):
            error = chain(program_p, params_p, state_p, 0, REPORT, 0.0, y) - reported
            if abs(error) <= 1e-15 * max(abs(y), 0.1):
                break
            if error > 0.0:
                high = y
            else:
                low = y
            if k > 0 and error != error_before:
                slope = min(2.0, max(0.05, (error - error_before) / (y - before)))
            last = k > 0 and abs(error * error_before) <= _NEXT_IS_NONE
            before, error_before = y, error
            y -= error / slope
            if not low < y < high:
                if high - low == math.inf:
                    y = before - error
                else:
                    y = 0.5 * (low + high)
                    if not low < y < high:  # nothing lies between
                        break
            elif last:
                break
        u[n] = y


@compiled("void(int64, float64[::1], float64[::1], float64[::1], float64[::1])")
def apply(address: int, params: Array, state: Array, u: Array, out: Array) -> None:
    """One block at dt = 0 over an array."""
    params_p, state_p = pointer(params), pointer(state)
    for n in range(u.size):
        out[n] = call_block(address, 0.0, u[n], state_p, 0, params_p, 0)


def as_vector(values: Any) -> Array:
    """A contiguous float64 vector, as the compiled functions take them."""
    return np.ascontiguousarray(values, dtype=np.float64)
