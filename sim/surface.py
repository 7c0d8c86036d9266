"""The surface of a pad that has let go: how deep it lies, where it carries nothing, and what a film on it bears."""

from __future__ import annotations

from sim.jit import compiled
from sim.slots import (
    CONTACT,
    ELASTIC,
    FE,
    FILM,
    INNER,
    INNER_SIZE,
    LAW,
    PAD_FORCE,
    PULLED,
    RECOVERS,
    SCRATCH,
    STEEPNESS,
    SURFACE,
    Doubles,
    Ints,
    chain,
    product,
    total,
)

_QUICK = 5  # steps to a surface without a bracket
_BESIDE = 1e-3  # of the way to the last surface, where no slope is known
_RESIDUE = 1e-12  # of the force that relaxes: what a pad that has let go may carry


@compiled(
    "float64(CPointer(int64), CPointer(float64), CPointer(float64), int64, float64, float64, float64, float64, float64)"
)
def surface_force(
    program: Ints,
    params: Doubles,
    state: Doubles,
    shift: int,
    dt: float,
    since: float,
    s: float,
    A: float,
    B: float,
) -> float:
    """Force of the pad were its surface at depth `s`: A + B F^e(s) + contact(s), all blocks on a scratch copy, which
    stays. `since`: for how long the pad has been touched in this step of `dt`."""
    inner, scratch = program[INNER], program[SCRATCH]
    for k in range(program[INNER_SIZE]):
        state[scratch + k] = state[inner + shift + k]
    aside = scratch - inner
    Fe = product(program, params, state, aside, ELASTIC, dt, s) * chain(program, params, state, aside, LAW, dt, s)
    state[scratch + FE] = Fe
    return A + B * Fe + total(program, params, state, aside, CONTACT, since, s)


@compiled("float64(CPointer(int64), CPointer(float64), CPointer(float64), int64, float64, float64, float64, float64)")
def free_surface(
    program: Ints, params: Doubles, state: Doubles, shift: int, dt: float, depth: float, A: float, B: float
) -> float:
    """Depth at which a pad that has let go carries no force; `depth` itself where the force there is not below 0, or is
    so at every depth. Where it is not `depth`, the scratch copy is then the state there.

    A surface recovers about as fast as in the step before, and the force there rises with the depth: a Newton's step
    from there with the last slope, then secant steps; where those do not do, the same within a bracket.
    """
    pad = program[INNER] + shift
    tolerance = _RESIDUE * max(abs(A), 0.1)
    low = max(depth, 0.0)  # nothing of the pad's changes above its surface
    last, slope = state[pad + SURFACE], state[pad + STEEPNESS]
    s = last - state[pad + RECOVERS] * dt
    if slope > 0.0 and low < s <= last:
        f = surface_force(program, params, state, shift, dt, dt, s, A, B)
        for _ in range(_QUICK):
            if abs(f) <= tolerance:
                state[pad + STEEPNESS] = slope
                return float(s)
            a, f_a = s, f
            s = a - f_a / slope
            if not low < s <= last or s == a:
                break
            f = surface_force(program, params, state, shift, dt, dt, s, A, B)
            slope = (f - f_a) / (s - a)
            if not slope > 0.0:
                break
    s = max(last, low)
    f = surface_force(program, params, state, shift, dt, dt, s, A, B)
    # a surface that goes deeper: where a law falls with the depth, the probe may be on the pad
    if f < -tolerance and s > depth and surface_force(program, params, state, shift, dt, dt, depth, A, B) >= 0.0:
        return depth
    a, f_a = s, f
    width = max(s - low, 1e-6)
    for _ in range(60):
        if not f < -tolerance:
            break
        a, f_a, low = s, f, s
        s += width
        width *= 2.0
        f = surface_force(program, params, state, shift, dt, dt, s, A, B)
    if not f >= -tolerance:  # a law that falls with the depth has none: the surface stays with the probe
        return depth
    high = s
    slope = (f - f_a) / (s - a) if s > a else state[pad + STEEPNESS]
    stale = 0
    sure = False  # that the force at `depth` is below 0
    for _ in range(200):
        if abs(f) <= tolerance:
            break
        c = s - f / slope if slope > 0.0 else high - _BESIDE * (high - low)
        if not c < high or stale > 2:
            c = 0.5 * (low + high)
            stale = 0
        if not low < c:
            if not sure and surface_force(program, params, state, shift, dt, dt, depth, A, B) >= 0.0:
                return depth
            sure = True
            c = 0.5 * (low + high)
        if not low < c < high:  # nothing lies between
            break
        before = high - low
        a, f_a = s, f
        s = c
        f = surface_force(program, params, state, shift, dt, dt, s, A, B)
        if s != a:
            slope = (f - f_a) / (s - a)
        if f < 0.0:
            low, sure = s, True
        else:
            high = s
        stale = stale + 1 if high - low > 0.5 * before else 0
    if slope > 0.0:
        state[pad + STEEPNESS] = slope
    return float(s)


@compiled("float64(CPointer(int64), CPointer(float64), CPointer(float64), int64, float64, float64)")
def torn(program: Ints, params: Doubles, state: Doubles, shift: int, dt: float, F: float) -> float:
    """What a film between pad and probe bears of a tension F < 0 at the end of a step: F itself, or, once its impulse
    is used up, the mean over the step of what it bore in it; 0 without a film, and after."""
    if program[FILM] == 0:
        return 0.0
    pad = program[INNER] + shift
    left = params[program[FILM]] - state[pad + PULLED]
    if left <= 0.0:
        return 0.0
    before = state[pad + PAD_FORCE]  # the force goes linearly over the step
    pulled = 0.5 * dt * F * F / (before - F) if before > 0.0 else 0.5 * dt * -(before + F)
    state[pad + PULLED] += min(pulled, left)
    return F if pulled < left else -left / dt
