"""Frame compliance: bench frame, load cell and probe give way under force like a spring in series with the pad.

The motor side moves by x, the probe by y = x − C F. With a linear pad of stiffness K the bench sees K/(1 + C K) instead
of K. The force used is the one at the cell, solved within the step (sim/kernel.py), never the last step's.

`compliance` C is deflection over force at the force `at_force` (F_0) where it is no constant.

- `linear`: C F.
- `stiffening`: C F (1 + F_0/F_s)/(1 + |F|/F_s): joints that bed in under load.
- `power`: C F ((1 + (F/1 N)²)/(1 + (F_0/1 N)²))^((n−1)/2): linear at small forces and |F|^n at large ones. Hertz's
  contact of probe and seat has n = 2/3 (K. L. Johnson, Contact Mechanics, Cambridge, 1985, chapter 4).
- `joint`: the joint diagram, two straight lines that meet at a force P: a joint under preload is stiff until it opens,
  k < 1 times as compliant below P as beyond. In proportion to (|F| − (1 − k) m(|F|)) sgn F with m the lesser of |F| and
  P, rounded over r P since faces part bit by bit: m(F) = (F + √(P² + (r P)²) − √((F − P)² + (r P)²))/2 (J. H. Bickford,
  Introduction to the Design and Behavior of Bolted Joints, 4th ed., CRC, 2008).
- `closing`: the same with k > 1: faces that are not yet home are soft until P has closed the joint.
- `graded`: C F_0 U(|F|/F_0)/U(1) sgn F, where U' is 1 at no force, and `third`, `two_thirds` and `whole` at those parts
  of F_0, in straight lines between: a compliance that is measured over the force, as instrumented indentation asks
  (ISO 14577-2, Metallic materials, instrumented indentation, verification and calibration of testing machines).
- `slipping`: C ((1 − s) F + s G), where G is the middle of a play of the full width 2 `slip_force` that F drags along.
  A share s sits in joints whose edges stick until the force has changed by that width, and slip then. The curve is a
  loop; C is the mean of its two ways (W. D. Iwan, J. Appl. Mech. 33, 1966, 893–900; L. Gaul, R. Nitsche, The role of
  friction in mechanical joints, Appl. Mech. Rev. 54, 2001, 93–106).
- `creeping`: C ((1 − s) F + s G)/(1 − s/2), where G follows F with a time constant: parts of plastic or glue creep. C
  is the middle of at once and at last (W. N. Findley, J. S. Lai, K. Onaran, Creep and Relaxation of Nonlinear
  Viscoelastic Materials, North-Holland, 1976). Exact for a force that is linear between samples.
- `jamming`: C F (1 − μ) as the load grows and C F (1 + μ) as it goes, stuck between the two: a taper or a clamp whose
  faces rub under the load that they bear (J. E. Shigley, C. R. Mischke, Mechanical Engineering Design, McGraw-Hill,
  on wedges that lock themselves).
- `loosening`: C (1 + g (W/W_0 − 1)) F, where W = ∫ |dF| is all that the load has changed since the first sample: a
  clamp that each change loosens, or beds in. What is within a hundredth of `at_force` loosens nothing: faces must slip
  (G. H. Junker, New criteria for self-loosening of fasteners under vibration, SAE Technical Paper 690055, 1969). C is
  that at `at_change` W_0.
- `damped`: d + τ d' = C F, all of it late: a mount of rubber or a damped column, a spring with a dashpot beside it
  (E. I. Rivin, Passive Vibration Isolation, ASME Press, 2003, on Kelvin and Voigt's model of rubber). Exact, too.

Reference: W. C. Oliver, G. M. Pharr, J. Mater. Res. 7, 1992, 1564–1583: the compliance measured is that of the
contact plus that of the load frame.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from sim.effects.base import Effect, Form, Parameter
from sim.jit import State, block


@block
def spring(dt: float, force: float, state: State, p: State) -> float:
    """Deflection C F in mm; p = (compliance,)."""
    return p[0] * force


@block
def stiffening(dt: float, force: float, state: State, p: State) -> float:
    """Deflection in mm; p = (compliance, stiffening_force, at_force)."""
    return p[0] * force * (1.0 + p[2] / p[1]) / (1.0 + abs(force) / p[1])


@block
def power(dt: float, force: float, state: State, p: State) -> float:
    """Deflection in mm; p = (compliance, exponent, at_force)."""
    return float(p[0] * force * ((1.0 + force * force) / (1.0 + p[2] * p[2])) ** (0.5 * (p[1] - 1.0)))


@block
def joint(dt: float, force: float, state: State, p: State) -> float:
    """Deflection in mm; p = (compliance, preload, stiff_share, rounding, at_force)."""
    wide = p[3] * p[1]
    rest = math.sqrt(p[1] * p[1] + wide * wide)
    size = abs(force)
    below = 0.5 * (size + rest - math.sqrt((size - p[1]) * (size - p[1]) + wide * wide))
    below_at = 0.5 * (p[4] + rest - math.sqrt((p[4] - p[1]) * (p[4] - p[1]) + wide * wide))
    opened = math.copysign(size - (1.0 - p[2]) * below, force)
    return p[0] * p[4] * opened / (p[4] - (1.0 - p[2]) * below_at)


@block
def graded(dt: float, force: float, state: State, p: State) -> float:
    """Deflection in mm; p = (compliance, third, two_thirds, whole, at_force)."""
    size = abs(force) / p[4]
    way, before, begin = 0.0, 1.0, 0.0
    for k in range(1, 4):
        part = min(max(size - begin, 0.0), 1.0 / 3.0)
        way += part * (before + 1.5 * part * (p[k] - before))
        before = p[k]
        begin += 1.0 / 3.0
    way += max(size - 1.0, 0.0) * p[3]
    whole = (0.5 + p[1] + p[2] + 0.5 * p[3]) / 3.0
    return float(p[0] * p[4] * math.copysign(way, force) / whole)


@block
def slipping(dt: float, force: float, state: State, p: State) -> float:
    """Deflection in mm; p = (compliance, share, slip_force); state: the force that the joints have followed."""
    state[0] = min(max(state[0], force - p[2]), force + p[2])
    return p[0] * ((1.0 - p[1]) * force + p[1] * state[0])


@block
def jamming(dt: float, force: float, state: State, p: State) -> float:
    """Deflection in mm; p = (compliance, rubs); state: the deflection before."""
    middle, half = p[0] * force, p[0] * p[1] * abs(force)
    state[0] = min(max(state[0], middle - half), middle + half)
    return state[0]


@block
def creeping(dt: float, force: float, state: State, p: State) -> float:
    """Deflection in mm; p = (compliance, share, time_constant); state: the late force, and the force before."""
    x = dt / p[2]
    keep = math.exp(-x)
    mean = -math.expm1(-x) / x if x > 0.0 else 1.0  # of the decay over the step
    state[0] = force - (force - state[1]) * mean + (state[0] - state[1]) * keep
    state[1] = force
    return p[0] * ((1.0 - p[1]) * force + p[1] * state[0]) / (1.0 - 0.5 * p[1])


@block
def loosening(dt: float, force: float, state: State, p: State) -> float:
    """Deflection in mm; p = (compliance, growth, at_change, at_force); state: force followed, all it has changed."""
    slips = 0.01 * p[3]
    followed = min(max(state[0], force - slips), force + slips)
    state[1] += abs(followed - state[0])
    state[0] = followed
    return p[0] * max(1.0 + p[1] * (state[1] / p[2] - 1.0), 0.0) * force


def _all_late(values: Mapping[str, float]) -> tuple[float, ...]:
    """What `creeping` reads where all of it comes late: its middle is half of that at last."""
    return (0.5 * values["compliance"], 1.0, values["time_constant"])


def _compliance(what: str) -> Parameter:
    return Parameter("compliance", "mm/N", 0.0, 1.0, 0.005, what, required=True, amplitude=True, starts=(0.005, 0.03))


def _preload(what: str) -> Parameter:
    return Parameter("preload", "N", 1e-6, 1e7, 2.0, what, starts=(2.0,))


def _relative(name: str, where: str) -> Parameter:
    return Parameter(
        name, "1", 0.01, 20.0, 0.8, f"what a further newton adds at {where}, over that at none", starts=(0.5, 1.3)
    )


_ROUNDING = Parameter("rounding", "1", 0.01, 2.0, 0.1, "width of the bend over the preload", fixed=True)
_AT_FORCE = Parameter("at_force", "N", 1e-3, 1e6, 5.0, "force at which the compliance holds", fixed=True)

EFFECT = Effect(
    id="frame_compliance",
    what="Frame, load cell and probe give way under force like a spring in series with the pad.",
    says="frame, cell and probe give {compliance:.3g} mm per N",
    check="clamp the frame, shorten the lever arm, stiffen the probe holder; press on something hard to measure it",
    reference="Oliver, Pharr, J. Mater. Res. 7, 1992, 1564-1583",
    forms=(
        Form(
            name="linear",
            what="deflection proportional to the force at the cell",
            parameters=(_compliance("deflection per newton"),),
            blocks={"frame": spring},
        ),
        Form(
            name="stiffening",
            what="ever stiffer with the force",
            parameters=(
                _compliance("deflection per newton at `at_force`"),
                Parameter(
                    "stiffening_force", "N", 1e-2, 1e4, 5.0, "force at which the compliance is half", starts=(2.0, 20.0)
                ),
                _AT_FORCE,
            ),
            blocks={"frame": stiffening},
        ),
        Form(
            name="power",
            what="deflection goes with a power of the force",
            parameters=(
                _compliance("deflection per newton at `at_force`"),
                Parameter("exponent", "1", 0.1, 1.5, 2.0 / 3.0, "power of the force in N", starts=(0.4, 0.8)),
                _AT_FORCE,
            ),
            blocks={"frame": power},
        ),
        Form(
            name="joint",
            what="softer where a joint opens",
            parameters=(
                _compliance("deflection per newton at `at_force`"),
                _preload("force at which the joint opens"),
                Parameter("stiff_share", "1", 0.0, 1.0, 0.4, "compliance before over that after", starts=(0.2, 0.5)),
                _ROUNDING,
                _AT_FORCE,
            ),
            blocks={"frame": joint},
        ),
        Form(
            name="closing",
            what="stiffer where a joint has closed",
            parameters=(
                _compliance("deflection per newton at `at_force`"),
                _preload("force at which the joint has closed"),
                Parameter("soft_ratio", "1", 1.0, 10.0, 2.5, "compliance before over that after", starts=(2.5,)),
                _ROUNDING,
                _AT_FORCE,
            ),
            blocks={"frame": joint},
        ),
        Form(
            name="graded",
            what="another compliance at each force",
            parameters=(
                _compliance("deflection per newton at `at_force`"),
                _relative("third", "a third of `at_force`"),
                _relative("two_thirds", "two thirds of it"),
                _relative("whole", "`at_force` and beyond"),
                _AT_FORCE,
            ),
            sought=False,
            blocks={"frame": graded},
        ),
        Form(
            name="slipping",
            what="in part in joints that slip",
            parameters=(
                _compliance("deflection per newton, the mean of both ways"),
                Parameter("share", "1", 0.0, 1.0, 0.3, "share of the joints that slip", starts=(0.3,)),
                Parameter(
                    "slip_force", "N", 1e-6, 1e7, 0.3, "half the change of force before they slip", starts=(0.1, 1.0)
                ),
            ),
            sought=False,
            blocks={"frame": slipping},
            state=(0.0,),
        ),
        Form(
            name="jamming",
            what="less as the load grows than as it goes, stuck between",
            parameters=(
                _compliance("deflection per newton, the mean of both ways"),
                Parameter("rubs", "1", 0.0, 0.6, 0.15, "what friction adds or takes, over the load", starts=(0.15,)),
            ),
            blocks={"frame": jamming},
            state=(0.0,),
        ),
        Form(
            name="creeping",
            what="in part late, as plastic and glue",
            parameters=(
                _compliance("deflection per newton, the middle of at once and at last"),
                Parameter("share", "1", 0.0, 1.0, 0.15, "share that comes late", starts=(0.15,)),
                Parameter("time_constant", "s", 1e-3, 1e3, 1.0, "how late it comes", starts=(0.1, 0.6, 4.0)),
            ),
            sought=False,
            blocks={"frame": creeping},
            state=(0.0, 0.0),
        ),
        Form(
            name="loosening",
            what="ever softer with each change of the load, or stiffer",
            parameters=(
                _compliance("deflection per newton at `at_change`"),
                Parameter("growth", "1", -0.9, 0.9, 0.2, "growth up to `at_change`", default=0.0, starts=(-0.2, 0.2)),
                Parameter("at_change", "N", 1e-3, 1e9, 50.0, "all change of the load when C holds", fixed=True),
                Parameter("at_force", "N", 1e-3, 1e6, 5.0, "a hundredth of it slips", fixed=True),
            ),
            blocks={"frame": loosening},
            state=(0.0, 0.0),
        ),
        Form(
            name="damped",
            what="all of it late, as a mount of rubber",
            parameters=(
                _compliance("deflection per newton in the end"),
                Parameter("time_constant", "s", 1e-4, 10.0, 0.01, "how late it comes", starts=(0.003, 0.015)),
            ),
            blocks={"frame": creeping},
            state=(0.0, 0.0),
            pack=_all_late,
        ),
    ),
)
