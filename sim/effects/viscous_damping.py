"""Viscous damping of the pad: force against the speed of its surface, on top of relaxation, while in contact.

Speed is that of the surface at the end of the step: the step's mean, carried on by half a step with the lesser of the
last two accelerations (minmod), and no further than to rest. So a steady acceleration is followed, and at a corner, or
amid noise, it is the mean (R. J. LeVeque, Finite Volume Methods for Hyperbolic Problems, Cambridge, 2002, chapter 6,
on such limits). All forms oppose the motion, so they only ever take energy. `coefficient` is force over speed at
`SPEED_MM_S`, and at the depth `at_depth` where it depends on depth: in the middle of what benches do, where forms agree
on it, and not at an end that none was seen at.

- `linear`: coefficient · v, Kelvin and Voigt's dashpot.
- `hunt_crossley`: coefficient · (δ/at_depth)^n v, which starts at 0 at touch as measured impacts do (K. H. Hunt,
  F. R. E. Crossley, Coefficient of restitution interpreted as damping in vibroimpact, J. Appl. Mech. 42, 1975,
  440–445).
- `with_stiffness`: coefficient · e^(a(δ − at_depth)) v, damping in proportion to a stiffness that grows exponentially.
- `with_load`: coefficient · (e^(aδ) − 1)/(e^(a at_depth) − 1) v, damping in proportion to an elastic force that grows
  exponentially; as Hunt and Crossley have it, λ xⁿ v with a force k xⁿ.
- `power`: coefficient · v ((v² + v_0²)/(SPEED_MM_S² + v_0²))^((n−1)/2): shear thinning below n = 1, linear under
  v_0 = 0.05 mm/s. What is pressed through an orifice resists with n = 2 (I. E. Idelchik, Handbook of Hydraulic
  Resistance, 4th ed., Begell House, 2008).
- `thermal`: coefficient · SPEED_MM_S asinh(v/v_0)/asinh(SPEED_MM_S/v_0), of bonds that heat breaks and load helps:
  linear under v_0, then as its logarithm (H. Eyring, Viscosity, plasticity, and diffusion as examples of absolute
  reaction rates, J. Chem. Phys. 4, 1936, 283–291).
- `plastic`: the same, times the share of the elastic force that `with_load` has: a flow stress by the logarithm of the
  rate (G. R. Johnson, W. H. Cook, Fracture characteristics of three metals, Eng. Fract. Mech. 21, 1985, 31–48).
- `one_sided`: coefficient · (1 + differs · sgn v) v: more on the way in than on the way out, or less; `coefficient` is
  the mean of both.
- `springpot`: a fractional derivative, C d^α δ/dt^α, between a dashpot and a spring, made of sin(πα)/π ∫ ν^α w dln ν
  by modes w' = v − ν w, three a decade; `coefficient` is force over speed after 0.1 s of an even speed (R. L. Bagley,
  P. J. Torvik, A theoretical basis for the application of fractional calculus to viscoelasticity, J. Rheol. 27, 1983,
  201–210).
- `filled`: coefficient · min(max((δ − begins)/(at_depth/5), 0), 1) v: a filling, or a cell of oil inside, that
  is met at a depth.
- `thixotropic`: coefficient · (stays + (1 − stays) λ) v, of a filling that gets thinner as it is moved and sets again:
  λ' = (1 − λ)/sets − λ |v|/way, from 1 (J. Mewis, N. J. Wagner, Thixotropy, Adv. Colloid Interface Sci. 147–148, 2009,
  214–227); `coefficient` is of one that has set.
"""

from __future__ import annotations

import math

from sim.effects.base import Effect, Form, Parameter
from sim.jit import State, block, compiled

SPEED_MM_S = 20.0
"""Speed at which `coefficient` is force over speed."""
_A_DECADE, _SLOWEST, _MODES = 3.0, 0.1, 13
_FASTEST, _EVEN_S = 1000.0, 0.1
"""Rates of the modes of `springpot`, 1/s; and the time of an even speed at which its coefficient is stated."""
_SLOW = 0.05
"""Speed below which `power` is linear, mm/s: a root has no slope at rest."""


@compiled("UniTuple(float64, 4)(float64, float64, float64, float64, float64, float64)")
def _speed(
    dt: float, depth: float, before: float, mean_before: float, dt_before: float, bent_before: float
) -> tuple[float, float, float, float]:
    """In the pad, mm/s, at the end of the step; then what the next step asks for: the mean speed in this one, its
    length (0: not in the pad), and the acceleration."""
    if dt <= 0.0:
        return 0.0, mean_before, dt_before, bent_before
    if depth <= 0.0:
        return 0.0, 0.0, 0.0, 0.0
    mean = (depth - max(before, 0.0)) / dt
    if before <= 0.0 or dt_before <= 0.0:
        return mean, mean, dt, 0.0
    bent = 2.0 * (mean - mean_before) / (dt + dt_before)
    speed = mean
    if bent * bent_before > 0.0:
        speed += 0.5 * dt * math.copysign(min(abs(bent), abs(bent_before)), bent)
    return (speed if speed * mean > 0.0 else 0.0), mean, dt, bent


@compiled("float64(float64, float64, float64)")
def _of_the_load(depth: float, growth: float, at_depth: float) -> float:
    """Elastic force over that at a depth, of a law that grows exponentially."""
    if growth == 0.0:
        return max(depth, 0.0) / at_depth
    return math.expm1(growth * max(depth, 0.0)) / math.expm1(growth * at_depth)


@compiled("float64(float64, float64)")
def _of_bonds(speed: float, linear_to: float) -> float:
    """Speed (mm/s) at which what is linear resists as bonds do that heat breaks; the same at `SPEED_MM_S`."""
    return SPEED_MM_S * math.asinh(speed / linear_to) / math.asinh(SPEED_MM_S / linear_to)


@block
def linear(dt: float, depth: float, state: State, p: State) -> float:
    """Dashpot; p = (coefficient,)."""
    speed, state[1], state[2], state[3] = _speed(dt, depth, state[0], state[1], state[2], state[3])
    state[0] = depth
    return p[0] * speed


@block
def hunt_crossley(dt: float, depth: float, state: State, p: State) -> float:
    """Dashpot that grows with depth; p = (coefficient, exponent, at_depth)."""
    speed, state[1], state[2], state[3] = _speed(dt, depth, state[0], state[1], state[2], state[3])
    state[0] = depth
    return float(p[0] * (max(depth, 0.0) / p[2]) ** p[1] * speed)


@block
def with_stiffness(dt: float, depth: float, state: State, p: State) -> float:
    """Dashpot that grows exponentially with depth; p = (coefficient, growth, at_depth)."""
    speed, state[1], state[2], state[3] = _speed(dt, depth, state[0], state[1], state[2], state[3])
    state[0] = depth
    return p[0] * math.exp(p[1] * (max(depth, 0.0) - p[2])) * speed


@block
def with_load(dt: float, depth: float, state: State, p: State) -> float:
    """Dashpot that grows with the elastic force; p = (coefficient, growth, at_depth)."""
    speed, state[1], state[2], state[3] = _speed(dt, depth, state[0], state[1], state[2], state[3])
    state[0] = depth
    return p[0] * _of_the_load(depth, p[1], p[2]) * speed


@block
def power(dt: float, depth: float, state: State, p: State) -> float:
    """Dashpot that depends on speed; p = (coefficient, exponent)."""
    speed, state[1], state[2], state[3] = _speed(dt, depth, state[0], state[1], state[2], state[3])
    state[0] = depth
    square = (speed * speed + _SLOW * _SLOW) / (SPEED_MM_S * SPEED_MM_S + _SLOW * _SLOW)
    return float(p[0] * speed * square ** (0.5 * (p[1] - 1.0)))


@block
def thermal(dt: float, depth: float, state: State, p: State) -> float:
    """Dashpot of thermally broken bonds; p = (coefficient, linear_to)."""
    speed, state[1], state[2], state[3] = _speed(dt, depth, state[0], state[1], state[2], state[3])
    state[0] = depth
    return p[0] * _of_bonds(speed, p[1])


@block
def plastic(dt: float, depth: float, state: State, p: State) -> float:
    """Dashpot of such bonds that grows with the elastic force; p = (coefficient, linear_to, growth, at_depth)."""
    speed, state[1], state[2], state[3] = _speed(dt, depth, state[0], state[1], state[2], state[3])
    state[0] = depth
    return p[0] * _of_the_load(depth, p[2], p[3]) * _of_bonds(speed, p[1])


@block
def springpot(dt: float, depth: float, state: State, p: State) -> float:
    """Fractional dashpot; p = (coefficient, order). State: as of `linear`, then ways of the modes."""
    speed, state[1], state[2], state[3] = _speed(dt, depth, state[0], state[1], state[2], state[3])
    went = max(depth, 0.0) - max(state[0], 0.0)
    state[0] = depth
    order, step = p[1], math.log(10.0) / _A_DECADE
    total = speed * (_FASTEST * math.exp(0.5 * step)) ** (order - 1.0) / (1.0 - order)  # quicker ones follow the speed
    total += max(depth, 0.0) * (_SLOWEST * math.exp(-0.5 * step)) ** order / order  # slower ones the depth
    for k in range(_MODES):
        rate = _SLOWEST * math.exp(step * k)
        kept = math.exp(-rate * dt)
        state[4 + k] = state[4 + k] * kept + (went / dt * (1.0 - kept) / rate if dt > 0.0 else 0.0)
        if depth <= 0.0:
            state[4 + k] = 0.0
        total += step * rate**order * state[4 + k]
    whole = math.sin(math.pi * order) / math.pi * math.gamma(2.0 - order) * _EVEN_S ** (order - 1.0)
    return float(p[0] * whole * total)


@block
def one_sided(dt: float, depth: float, state: State, p: State) -> float:
    """Dashpot that differs by direction; p = (coefficient, differs)."""
    speed, state[1], state[2], state[3] = _speed(dt, depth, state[0], state[1], state[2], state[3])
    state[0] = depth
    return p[0] * (1.0 + p[1] if speed > 0.0 else 1.0 - p[1]) * speed


@block
def filled(dt: float, depth: float, state: State, p: State) -> float:
    """Dashpot from a depth on; p = (coefficient, begins, at_depth)."""
    speed, state[1], state[2], state[3] = _speed(dt, depth, state[0], state[1], state[2], state[3])
    state[0] = depth
    return p[0] * min(max(5.0 * (depth - p[1]) / p[2], 0.0), 1.0) * speed


@block
def thixotropic(dt: float, depth: float, state: State, p: State) -> float:
    """Dashpot that motion thins; p = (coefficient, stays, way, sets). State: as of `linear`, then 1 − λ."""
    went = abs(max(depth, 0.0) - max(state[0], 0.0))
    speed, state[1], state[2], state[3] = _speed(dt, depth, state[0], state[1], state[2], state[3])
    state[0] = depth
    steps = dt / p[3] + went / p[2]  # of an even speed within the step
    if steps > 0.0:
        state[4] += (went / p[2] / steps - state[4]) * -math.expm1(-steps)
    return p[0] * (1.0 - (1.0 - p[1]) * state[4]) * speed


_RESTING = (0.0, 0.0, 0.0, 0.0)


def _coefficient(what: str) -> Parameter:
    return Parameter(
        "coefficient", "N*s/mm", 0.0, 1e4, 0.005, what, required=True, amplitude=True, starts=(0.002, 0.02)
    )


_GROWTH = Parameter("growth", "1/mm", -2.0, 10.0, 0.7, "exponential growth with depth", starts=(0.3, 1.0))
_LINEAR_TO = Parameter("linear_to", "mm/s", 0.1, 200.0, 10.0, "speed to which it is linear", starts=(3.0, 15.0))
_AT_DEPTH = Parameter("at_depth", "mm", 1e-3, 100.0, 1.0, "depth at which the coefficient holds", fixed=True)

EFFECT = Effect(
    id="viscous_damping",
    what="The pad resists the speed at which it is pressed.",
    says="the pad adds {coefficient:.3g} N per mm/s of speed while in contact",
    check="press to one depth at several speeds; the fastest relaxation mode may be slower than what is seen",
    reference="Hunt, Crossley, J. Appl. Mech. 42, 1975, 440-445",
    forms=(
        Form(
            name="linear",
            what="in proportion to speed",
            parameters=(_coefficient("force per speed"),),
            blocks={"contact": linear},
            state=_RESTING,
        ),
        Form(
            name="hunt_crossley",
            what="in proportion to speed and to a power of the depth",
            parameters=(
                _coefficient("force per speed at `at_depth`"),
                Parameter("exponent", "1", 0.1, 5.0, 1.0, "power of the depth", starts=(0.5, 1.0, 1.5)),
                _AT_DEPTH,
            ),
            blocks={"contact": hunt_crossley},
            state=_RESTING,
        ),
        Form(
            name="with_stiffness",
            what="in proportion to speed and to a stiffness that grows with depth",
            parameters=(
                _coefficient("force per speed at `at_depth`"),
                _GROWTH,
                _AT_DEPTH,
            ),
            blocks={"contact": with_stiffness},
            state=_RESTING,
        ),
        Form(
            name="with_load",
            what="in proportion to speed and to an elastic force that grows exponentially with depth",
            parameters=(
                _coefficient("force per speed at `at_depth`"),
                _GROWTH,
                _AT_DEPTH,
            ),
            sought=False,
            blocks={"contact": with_load},
            state=_RESTING,
        ),
        Form(
            name="power",
            what="to a power of the speed",
            parameters=(
                _coefficient("force per speed at 20 mm/s"),
                Parameter("exponent", "1", 0.35, 2.5, 0.6, "power of the speed", starts=(0.5, 0.7, 1.3, 2.0)),
            ),
            blocks={"contact": power},
            state=_RESTING,
        ),
        Form(
            name="thermal",
            what="in proportion to slow speeds, and to the logarithm of quick ones",
            parameters=(
                _coefficient("force over speed at 20 mm/s"),
                _LINEAR_TO,
            ),
            sought=False,
            blocks={"contact": thermal},
            state=_RESTING,
        ),
        Form(
            name="plastic",
            what="with the elastic force and the logarithm of the speed",
            parameters=(
                _coefficient("force over speed at 20 mm/s and `at_depth`"),
                _LINEAR_TO,
                _GROWTH,
                _AT_DEPTH,
            ),
            sought=False,
            blocks={"contact": plastic},
            state=_RESTING,
        ),
        Form(
            name="springpot",
            what="a fractional derivative, between dashpot and spring",
            parameters=(
                _coefficient("force per speed after 0.1 s of an even speed"),
                Parameter("order", "1", 0.3, 0.98, 0.8, "of the derivative", starts=(0.6, 0.85)),
            ),
            sought=False,
            blocks={"contact": springpot},
            state=(0.0,) * (4 + _MODES),
        ),
        Form(
            name="one_sided",
            what="more one way than the other",
            parameters=(
                _coefficient("force per speed, mean of both ways"),
                Parameter("differs", "1", -0.95, 0.95, 0.2, "by how much each way differs from the mean"),
            ),
            sought=False,
            blocks={"contact": one_sided},
            state=_RESTING,
        ),
        Form(
            name="filled",
            what="from a depth on",
            parameters=(
                _coefficient("force per speed, a tenth of the depth reached behind `begins`"),
                Parameter("begins", "mm", 0.0, 100.0, 0.4, "depth at which the filling is met", bend=True),
                _AT_DEPTH,
            ),
            sought=False,
            blocks={"contact": filled},
            state=_RESTING,
        ),
        Form(
            name="thixotropic",
            what="less as it is moved, and as before after a rest",
            parameters=(
                _coefficient("force per speed of what has set"),
                Parameter("stays", "1", 0.0, 0.95, 0.3, "share that no motion takes away", starts=(0.2,)),
                Parameter("way", "mm", 0.05, 20.0, 0.7, "way over which it gets thinner", starts=(0.3, 1.0)),
                Parameter("sets", "s", 0.1, 100.0, 2.0, "time within which it sets again", starts=(1.0, 4.0)),
            ),
            sought=False,
            blocks={"contact": thixotropic},
            state=(*_RESTING, 0.0),
        ),
    ),
)
