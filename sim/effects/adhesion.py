"""Adhesion: pad and probe attract each other, in contact by `pull_off`, and over a gap within about `range`.

- `exponential`: −pull_off · e^(−gap/range); the same on the way in and out. In contact it is a constant pull, as in
  the DMT theory (B. V. Derjaguin, V. M. Muller, Yu. P. Toporov, J. Colloid Interface Sci. 53, 1975, 314–326).
- `linear`: −pull_off · (1 − gap/range) up to the range.
- `van_der_waals`: −pull_off/(1 + gap/z)², the attraction of a sphere by a flat (J. N. Israelachvili, Intermolecular
  and Surface Forces, 3rd ed., Academic Press, 2011), with z = range/(√e − 1).
- `sticking`: hysteretic. A bond grows in contact within `dwell` s, stretches over the range, where a share of `left`
  still pulls, and is gone beyond: it pulls on the way out alone. Pull-off after contact, and a neck that snaps, are the
  marks of the JKR theory (K. L. Johnson, K. Kendall, A. D. Roberts, Surface energy and the contact of elastic solids,
  Proc. R. Soc. Lond. A 324, 1971, 301–313).
- `necking`: a bond that pulls only once it is stretched: from nothing in contact to `pull_off` at `crest` of the range,
  and down to nothing at its end (G. Alfano, M. A. Crisfield, Finite element interface models for delamination, Int. J.
  Numer. Methods Eng. 50, 2001, 1701–1736: traction and separation).
- `stretching`: a neck that pulls up to `pull_off` as it is stretched, pull_off · sin(π/2 · gap/range), and snaps.
- `drawing`: fibrils are drawn out of a soft adhesive: up to `pull_off` at `crest` of the range, that over a share
  `holds` of the rest, then down to nothing at its end (H. Lakrout, P. Sergot, C. Creton, Direct observation of
  cavitation and fibrillation in a probe tack experiment on model acrylic pressure-sensitive-adhesives, J. Adhesion 69,
  1999, 307–359).
- `quick`: a neck that bears the more the quicker it is opened: pull_off · ((v_0 + v)/(v_0 + 10 mm/s))^n sin(π/2 ·
  gap/range), v_0 = 0.1 mm/s (D. Maugis, M. Barquins, Fracture mechanics and the adherence of viscoelastic bodies, J.
  Phys. D 11, 1978, 1989–2023). `pull_off` is that at 10 mm/s.
- `ageing`: bridges of liquid go on condensing in contact: pull_off · (1 + growth · ln((t + dwell)/(1 s + dwell))) after
  t s of it, and e^(−gap/range) of that on the way out alone, until five times the range (L. Bocquet, E. Charlaix, S.
  Ciliberto, J. Crassous, Moisture-induced ageing in granular media and the kinetics of capillary condensation, Nature
  396, 1998, 735–737). `pull_off` is that after 1 s.
- `preloaded`: pressing makes the contact that sticks: pull_off · (deepest/reach)^n of the depth since the last tear,
  and e^(−gap/range) of that on the way out alone, until five times the range (F. P. Bowden, D. Tabor, The Friction and
  Lubrication of Solids, Oxford University Press, 1950, chapter 15: the pull goes with the load that pressed).
- `smooth`: −pull_off · q e^(1−q) with q = gap/z, the same on the way in and out: nothing at touch, the most at z, then
  down again (X.-P. Xu, A. Needleman, Numerical simulations of fast crack growth in brittle solids, J. Mech. Phys.
  Solids 42, 1994, 1397–1434). z = range/3.146, as q e^(1−q) is 1/e there.
- `even`: `pull_off` over all of the range, on both ways, and nothing beyond (D. S. Dugdale, J. Mech. Phys. Solids 8,
  1960, 100–104; D. Maugis, J. Colloid Interface Sci. 150, 1992, 243–269), rounded over a twentieth of it.
- `charging`: each touch takes a share `takes` of the charge that is still missing, which leaks away in air within
  `leaks`; the pull goes with its square, as that of a charged sphere, pull_off (q/(1 + gap/z))² with z as above, on the
  way in too (R. G. Horn, D. T. Smith, Contact electrification and adhesion between dissimilar materials, Science 256,
  1992, 362–364).

`range` is the gap at which the pull has fallen to 1/e where it ends nowhere, and where it ends otherwise.

The gap is to the surface where it is, sunk as it may be by relaxation.
"""

from __future__ import annotations

import math

from sim.effects.base import Effect, Form, Parameter
from sim.jit import State, block

_ROOT = math.expm1(0.5)
_FALLEN = 3.1461932206205825  # q e^(1 − q) = 1/e, beyond the crest
_ROUNDED = 0.05  # of the range, over which `even` ends
_CREEP_MM_S = 0.1
"""Speed of opening below which `quick` falls no further."""
_TORN = 5.0  # ranges at which `ageing` and `preloaded` are torn
_NEAR = 0.02
"""Share of the range within which a bond grows: not 0, so that the force has no jump at touch."""


@block
def exponential(dt: float, gap: float, state: State, p: State) -> float:
    """Force in N; p = (pull_off, range)."""
    return -p[0] * math.exp(-gap / p[1])


@block
def linear(dt: float, gap: float, state: State, p: State) -> float:
    """Force in N; p = (pull_off, range)."""
    return -p[0] * max(0.0, 1.0 - gap / p[1])


@block
def van_der_waals(dt: float, gap: float, state: State, p: State) -> float:
    """Force in N; p = (pull_off, range)."""
    near = 1.0 / (1.0 + gap / p[1] * _ROOT)
    return -p[0] * near * near


@block
def sticking(dt: float, gap: float, state: State, p: State) -> float:
    """Force in N; p = (pull_off, range, dwell, left); state: the share of the bond that has grown."""
    if gap >= p[1]:
        state[0] = 0.0
        return 0.0
    state[0] -= (1.0 - state[0]) * math.expm1(-dt / p[2] * math.exp(-gap / (_NEAR * p[1])))
    return -p[0] * state[0] * (1.0 - (1.0 - p[3]) * gap / p[1])


@block
def ageing(dt: float, gap: float, state: State, p: State) -> float:
    """Force in N; p = (pull_off, range, dwell, growth); state: whether there is a bond, for how long it has been in
    contact."""
    if gap >= _TORN * p[1]:
        state[0], state[1] = 0.0, 0.0
    elif gap <= _NEAR * p[1]:
        state[1] += state[0] * dt
        state[0] = 1.0
    if state[0] == 0.0:
        return 0.0
    aged = 1.0 + p[3] * math.log((state[1] + p[2]) / (1.0 + p[2]))
    return -p[0] * max(aged, 0.0) * math.exp(-max(gap, 0.0) / p[1])


@block
def pressed(dt: float, depth: float, state: State, p: State) -> float:
    """No force of its own; state: whether there is a bond, the deepest since it was torn."""
    state[1] = max(state[1], depth)
    return 0.0


@block
def preloaded(dt: float, gap: float, state: State, p: State) -> float:
    """Force in N; p = (pull_off, range, power, reach); state: as of `pressed`."""
    if gap >= _TORN * p[1]:
        state[0], state[1] = 0.0, 0.0
    elif gap <= 0.0:
        state[0] = 1.0
    if state[0] == 0.0:
        return 0.0
    return float(-p[0] * (max(state[1], 0.0) / p[3]) ** p[2] * math.exp(-gap / p[1]))


@block
def necking(dt: float, gap: float, state: State, p: State) -> float:
    """Force in N; p = (pull_off, range, crest); state: whether there is a bond."""
    if gap >= p[1]:
        state[0] = 0.0
    elif gap <= 0.0:
        state[0] = 1.0
    if state[0] == 0.0:
        return 0.0
    stretched = gap / p[1]
    return -p[0] * min(stretched / p[2], (1.0 - stretched) / (1.0 - p[2]))


@block
def stretching(dt: float, gap: float, state: State, p: State) -> float:
    """Force in N; p = (pull_off, range); state: whether there is a bond."""
    if gap >= p[1]:
        state[0] = 0.0
    elif gap <= 0.0:
        state[0] = 1.0
    return -p[0] * state[0] * math.sin(0.5 * math.pi * gap / p[1])


@block
def drawing(dt: float, gap: float, state: State, p: State) -> float:
    """Force in N; p = (pull_off, range, crest, holds); state: whether there is a bond."""
    if gap >= p[1]:
        state[0] = 0.0
    elif gap <= 0.0:
        state[0] = 1.0
    if state[0] == 0.0:
        return 0.0
    stretched = gap / p[1]
    ends = (1.0 - p[2]) * (1.0 - p[3])  # share of the range in which it tears
    return -p[0] * min(stretched / p[2], 1.0, (1.0 - stretched) / ends)


@block
def quick(dt: float, gap: float, state: State, p: State) -> float:
    """Force in N; p = (pull_off, range, exponent); state: whether there is a bond, gap before, speed of opening."""
    if gap >= p[1]:
        state[0] = 0.0
    elif gap <= 0.0:
        state[0] = 1.0
    if dt > 0.0:
        state[2] = max(gap - state[1], 0.0) / dt
    state[1] = gap
    hard = ((_CREEP_MM_S + state[2]) / (_CREEP_MM_S + 10.0)) ** p[2]
    return float(-p[0] * state[0] * hard * math.sin(0.5 * math.pi * gap / p[1]))


@block
def smooth(dt: float, gap: float, state: State, p: State) -> float:
    """Force in N; p = (pull_off, range)."""
    q = _FALLEN * gap / p[1]
    return float(-p[0] * q * math.exp(1.0 - q))


@block
def even(dt: float, gap: float, state: State, p: State) -> float:
    """Force in N; p = (pull_off, range)."""
    return -p[0] * 0.5 * (1.0 - math.tanh((gap / p[1] - 1.0) / _ROUNDED))


@block
def charging(dt: float, gap: float, state: State, p: State) -> float:
    """Force in N; p = (pull_off, range, takes, leaks); state: charge, whether it touches."""
    if gap > 0.0:
        state[0] *= math.exp(-dt / p[3])
        state[1] = 0.0
    elif state[1] == 0.0:
        state[1] = 1.0
        state[0] += p[2] * (1.0 - state[0])
    pulls = state[0] / (1.0 + gap / p[1] * _ROOT)
    return -p[0] * pulls * pulls


_PULL_OFF = Parameter(
    "pull_off",
    "N",
    0.0,
    1e4,
    0.1,
    "greatest pull",
    required=True,
    amplitude=True,
    floor=("force_noise_N", 0.05),
)
_RANGE = Parameter(
    "range", "mm", 1e-4, 20.0, 0.1, "gap over which the pull goes", required=True, starts=(0.02, 0.1, 0.5)
)

EFFECT = Effect(
    id="adhesion",
    what="Pad and probe attract each other: the pad pulls before it lets go.",
    says="the pad sticks with {pull_off:force} and lets go within {range:.3g} mm",
    check="clean or powder the probe, and see whether the pull goes",
    reference="Johnson, Kendall, Roberts, Proc. R. Soc. Lond. A 324, 1971, 301-313",
    forms=(
        Form(
            name="exponential",
            what="the pull falls exponentially with the gap",
            parameters=(_PULL_OFF, _RANGE),
            blocks={"gap": exponential},
        ),
        Form(
            name="linear",
            what="the pull falls linearly with the gap",
            parameters=(_PULL_OFF, _RANGE),
            blocks={"gap": linear},
        ),
        Form(
            name="van_der_waals",
            what="the pull falls with the square of the distance",
            parameters=(_PULL_OFF, _RANGE),
            blocks={"gap": van_der_waals},
        ),
        Form(
            name="sticking",
            what="pulls after contact alone, until the bond is torn",
            parameters=(
                _PULL_OFF,
                _RANGE,
                Parameter("dwell", "s", 1e-3, 100.0, 0.05, "time of contact in which it grows", starts=(0.005, 0.1)),
                Parameter("left", "1", 0.0, 1.0, 0.0, "share of the pull left when it tears", starts=(0.0, 0.5)),
            ),
            blocks={"gap": sticking},
            state=(0.0,),
        ),
        Form(
            name="ageing",
            what="pulls after contact alone, the more the longer that was",
            parameters=(
                _PULL_OFF,
                _RANGE,
                Parameter("dwell", "s", 1e-3, 100.0, 0.1, "time of contact from which it grows", starts=(0.1,)),
                Parameter("growth", "1", 0.0, 2.0, 0.2, "how much it grows by, in e times as long", starts=(0.2,)),
            ),
            sought=False,
            blocks={"gap": ageing},
            state=(0.0, 0.0),
        ),
        Form(
            name="preloaded",
            what="pulls after contact alone, the more the deeper that was",
            parameters=(
                _PULL_OFF,
                _RANGE,
                Parameter("power", "1", 0.05, 3.0, 0.6, "of the depth pressed", starts=(0.5, 1.0)),
                Parameter("reach", "mm", 1e-3, 100.0, 1.0, "depth after which it pulls by `pull_off`", fixed=True),
            ),
            sought=False,
            blocks={"contact": pressed, "gap": preloaded},
            state=(0.0, 0.0),
        ),
        Form(
            name="necking",
            what="pulls after contact alone, and most when it is stretched",
            parameters=(
                _PULL_OFF,
                _RANGE,
                Parameter("crest", "1", 0.02, 0.98, 0.6, "share of the range at which it pulls most"),
            ),
            blocks={"gap": necking},
            state=(0.0,),
        ),
        Form(
            name="stretching",
            what="pulls after contact alone, the more it is stretched, and snaps",
            parameters=(_PULL_OFF, _RANGE),
            sought=False,
            blocks={"gap": stretching},
            state=(0.0,),
        ),
        Form(
            name="drawing",
            what="fibrils that hold until they tear",
            parameters=(
                _PULL_OFF,
                _RANGE,
                Parameter(
                    "crest", "1", 0.02, 0.9, 0.2, "share of the range at which it pulls most", starts=(0.15, 0.4)
                ),
                Parameter("holds", "1", 0.0, 0.98, 0.6, "share of the rest over which it holds that", starts=(0.6,)),
            ),
            sought=False,
            blocks={"gap": drawing},
            state=(0.0,),
        ),
        Form(
            name="quick",
            what="a neck that bears more the quicker it is opened",
            parameters=(
                _PULL_OFF,
                _RANGE,
                Parameter("exponent", "1", 0.0, 1.0, 0.15, "power of the speed", starts=(0.15,)),
            ),
            sought=False,
            blocks={"gap": quick},
            state=(0.0, 0.0, 0.0),
        ),
        Form(
            name="charging",
            what="touches charge the surfaces, which pull on both ways",
            parameters=(
                _PULL_OFF,
                _RANGE,
                Parameter("takes", "1", 0.05, 1.0, 0.5, "share of what is missing that a touch takes", starts=(0.5,)),
                Parameter("leaks", "s", 0.1, 1e3, 10.0, "time in which it leaks to 1/e in air", starts=(10.0,)),
            ),
            blocks={"gap": charging},
            state=(0.0, 0.0),
        ),
        Form(
            name="smooth",
            what="nothing at touch, then more, then less, on both ways",
            parameters=(_PULL_OFF, _RANGE),
            sought=False,
            blocks={"gap": smooth},
        ),
        Form(
            name="even",
            what="the same pull over all of the range",
            parameters=(_PULL_OFF, _RANGE),
            sought=False,
            blocks={"gap": even},
        ),
    ),
)
