"""Stress softening (Mullins): below the deepest point reached the pad is softer; there it is as it was.

The factor on F^e depends on depth δ and on the deepest depth so far; loading beyond it follows the virgin curve.

- `exponential`: 1 − share (1 − e^(−(deepest − δ)/depth)).
- `virgin`: (1 − D(deepest))/(1 − D(δ)) with that damage D(δ) = share (1 − e^(−δ/depth)): the law is the curve of the
  pad as it is loaded first, D in it.
- `ratio`: (δ/deepest)^a, with an exponent a by which the share is gone at twice `depth` below `reach` (Z. Q. Guo, L. J.
  Sluys, Computational modelling of the stress-softening phenomenon of rubber-like materials under cyclic loading, Eur.
  J. Mech. A 25, 2006, 877–896). One number: `depth` only says where the share is stated.
- `relative`: 1 − share · (1 − (δ/deepest)^a): as `ratio`, but no more than the share, which is gone at the surface; a
  such that 1 − 1/e of it is gone at `depth` below `reach`: 1 where that is 0.63 of `reach`.
- `root`: e^(−a √(deepest − δ)), with a by which the share is gone at twice `depth`: much of it close below the deepest
  point (A. E. Zúñiga, M. F. Beatty, A new phenomenological model for stress-softening in elastomers, Z. Angew. Math.
  Phys. 53, 2002, 794–814). One number, too.
- `hyperbola`: 1 − share · q/(1 + q) with q = (deepest − δ)/(0.6 depth): it levels off late (J. Diani, B. Fayolle, P.
  Gilormini, A review on the Mullins effect, Eur. Polym. J. 45, 2009, 601–612, on such functions). 0.6 of it makes half
  of the share go about where it has in `exponential`.
- `weibull`: 1 − share (1 − e^(−q^n)) with q = (deepest − δ)/depth: bonds whose strengths are spread about a value
  (W. Weibull, A statistical distribution function of wide applicability, J. Appl. Mech. 18, 1951, 293–297), so that
  little of it goes close below the deepest point; 1 is `exponential`.
- `two_ways`: as `exponential` on the way out, and `again` of it on the way back in, one to the other over `within`:
  rubber is stiffer as it is loaded anew than as it was unloaded (J. S. Bergström, M. C. Boyce, Constitutive modeling of
  the large strain time-dependent behavior of elastomers, J. Mech. Phys. Solids 46, 1998, 931–954).
- `conditioning`: as `exponential`, with a share that takes some cycles to be whole: share (1 − lacks · e^(−N/takes)),
  N how often the probe has come back near the deepest depth (9/10 of it) from half of it or less (J. Diani, B. Fayolle,
  P. Gilormini, as above, on filled rubber, most of whose softening is in the first cycles and not in the first alone).
- `healing`: as `exponential`, with a deepest depth that is forgotten towards the depth at hand, within `time_constant`:
  rest gives back what was lost (J. A. C. Harwood, L. Mullins, A. R. Payne, Stress softening in natural rubber
  vulcanizates, J. Appl. Polym. Sci. 9, 1965, 3011–3021).
- `preconditioned`: as `exponential`, on a pad that had been pressed to `already` before the data begin.
- `linear`: 1 − share · min(1, (deepest − δ)/(2 depth)): as in `exponential`, `depth` is the mean distance at which it
  goes.
- `ogden_roxburgh`: 1 − share · erf((W_max − W)/(w + growth · W_max)), with energies W that go with δ^power (2: a linear
  spring), and w such that the argument is 1 at `depth` below the greatest depth of the data, `reach` (R. W. Ogden,
  D. G. Roxburgh, A pseudo-elastic model for the Mullins effect in filled rubber, Proc. R. Soc. Lond. A 455, 1999,
  2861–2877).
- `discontinuous_damage`: 1 − share (1 − e^(−deepest/depth)) at all depths: the deepest point sets the stiffness
  (J. C. Simo, On a fully three-dimensional finite-strain viscoelastic damage model, Comput. Methods Appl. Mech. Eng.
  60, 1987, 153–173).

- `alteration`: 1 − share (1 − e^(−deepest/whole)) (1 − e^(−((deepest − δ)/depth)^n)): links break the more, the further
  the network was ever stretched, and the virgin curve is met at the deepest point (G. Marckmann, E. Verron, L.
  Gornet, G. Chagnon, P. Charrier, P. Fort, A theory of network alteration for the Mullins effect, J. Mech. Phys. Solids
  50, 2002, 2011–2028).

State: the deepest depth. Reference: L. Mullins, Softening of rubber by deformation, Rubber Chem. Technol. 42, 1969,
339–362.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from sim.effects.base import Effect, Form, Parameter
from sim.jit import State, block


@block
def exponential(dt: float, depth: float, state: State, p: State) -> float:
    """Factor on F^e; p = (share, depth, already)."""
    here = max(depth, 0.0)
    state[0] = max(state[0], here, p[2])
    return 1.0 + p[0] * math.expm1(-(state[0] - here) / p[1])


_GONE_BACK = 0.05  # of the deepest depth: the way back after which the curve of the virgin pad is met further on


@block
def rejoining(dt: float, depth: float, state: State, p: State) -> float:
    """Factor on F^e; p = (share, depth, further, already); state: deepest point, depth before, way gone back."""
    here = max(depth, 0.0)
    state[2] += max(state[1] - here, 0.0)
    state[1] = here
    state[0] = max(state[0], p[3])
    back = min(state[2] / max(_GONE_BACK * state[0], 1e-9), 1.0)
    met = state[0] * (1.0 + p[2] * back)
    if here >= met:
        state[0] = here
        state[2] = 0.0
        met = here
    return 1.0 + p[0] * math.expm1(-(met - here) / p[1])


@block
def linear(dt: float, depth: float, state: State, p: State) -> float:
    """Factor on F^e; p = (share, depth, already)."""
    here = max(depth, 0.0)
    state[0] = max(state[0], here, p[2])
    return 1.0 - p[0] * min(1.0, (state[0] - here) / (2.0 * p[1]))


@block
def ogden_roxburgh(dt: float, depth: float, state: State, p: State) -> float:
    """Factor on F^e; p = (share, depth, power, growth, reach, already)."""
    here = max(depth, 0.0)
    state[0] = max(state[0], here, p[5])
    most = (state[0] / p[4]) ** p[2]
    scale = 1.0 - max(1.0 - p[1] / p[4], 0.0) ** p[2]  # of w + growth · W_max at the reach
    if p[1] > p[4]:
        scale = (p[1] / p[4]) ** p[2]
    grown = (1.0 + p[3] * most) / (1.0 + p[3])
    return 1.0 - p[0] * math.erf((most - (here / p[4]) ** p[2]) / (scale * grown))


@block
def ratio(dt: float, depth: float, state: State, p: State) -> float:
    """Factor on F^e; p = (exponent, already)."""
    here = max(depth, 0.0)
    state[0] = max(state[0], here, p[1])
    return (here / state[0]) ** p[0] if state[0] > 0.0 else 1.0


@block
def relative(dt: float, depth: float, state: State, p: State) -> float:
    """Factor on F^e; p = (share, exponent, already)."""
    here = max(depth, 0.0)
    state[0] = max(state[0], here, p[2])
    return 1.0 - p[0] * (1.0 - (here / state[0]) ** p[1]) if state[0] > 0.0 else 1.0


@block
def alteration(dt: float, depth: float, state: State, p: State) -> float:
    """Factor on F^e; p = (share, depth, exponent, whole, already)."""
    here = max(depth, 0.0)
    state[0] = max(state[0], here, p[4])
    return 1.0 - p[0] * math.expm1(-state[0] / p[3]) * math.expm1(-(((state[0] - here) / p[1]) ** p[2]))


@block
def virgin(dt: float, depth: float, state: State, p: State) -> float:
    """Factor on F^e; p = (share, depth, already)."""
    here = max(depth, 0.0)
    state[0] = max(state[0], here, p[2])
    return (1.0 + p[0] * math.expm1(-state[0] / p[1])) / (1.0 + p[0] * math.expm1(-here / p[1]))


_IN_THE_PAD = 0.8  # of the reach: where the share is stated at the most


def _exponent(values: Mapping[str, float]) -> tuple[float, ...]:
    """What `ratio` reads."""
    left = 1.0 - min(2.0 * values["depth"] / values["reach"], _IN_THE_PAD)
    return (math.log1p(-values["share"]) / math.log(left), values["already"])


def _relative(values: Mapping[str, float]) -> tuple[float, ...]:
    """What `relative` reads."""
    left = 1.0 - min(values["depth"] / values["reach"], 0.999)
    return (values["share"], -1.0 / math.log(left), values["already"])


@block
def root(dt: float, depth: float, state: State, p: State) -> float:
    """Factor on F^e; p = (a in 1/√mm, already)."""
    here = max(depth, 0.0)
    state[0] = max(state[0], here, p[1])
    return math.exp(-p[0] * math.sqrt(state[0] - here))


def _steepness(values: Mapping[str, float]) -> tuple[float, ...]:
    """What `root` reads."""
    return (-math.log1p(-values["share"]) / math.sqrt(2.0 * values["depth"]), values["already"])


@block
def hyperbola(dt: float, depth: float, state: State, p: State) -> float:
    """Factor on F^e; p = (share, depth, already)."""
    here = max(depth, 0.0)
    state[0] = max(state[0], here, p[2])
    below = state[0] - here
    return 1.0 - p[0] * below / (below + 0.6 * p[1])


@block
def weibull(dt: float, depth: float, state: State, p: State) -> float:
    """Factor on F^e; p = (share, depth, exponent, already)."""
    here = max(depth, 0.0)
    state[0] = max(state[0], here, p[3])
    return float(1.0 + p[0] * math.expm1(-(((state[0] - here) / p[1]) ** p[2])))


@block
def two_ways(dt: float, depth: float, state: State, p: State) -> float:
    """Factor on F^e; p = (share, depth, again, within, already); state: the deepest depth, how far it is on its way
    out, the depth before."""
    here = max(depth, 0.0)
    state[0] = max(state[0], here, p[4])
    state[1] = min(max(state[1] - (here - state[2]) / p[3], 0.0), 1.0)
    state[2] = here
    whole = p[2] + (1.0 - p[2]) * state[1]
    return 1.0 + p[0] * whole * math.expm1(-(state[0] - here) / p[1])


@block
def conditioning(dt: float, depth: float, state: State, p: State) -> float:
    """Factor on F^e; p = (share, depth, lacks, takes, already); state: deepest, times it came back, if it was away."""
    here = max(depth, 0.0)
    state[0] = max(state[0], here, p[4])
    if here < 0.5 * state[0]:
        state[2] = 1.0
    elif state[2] != 0.0 and here > 0.9 * state[0]:
        state[2] = 0.0
        state[1] += 1.0
    share = p[0] * (1.0 - p[2] * math.exp(-state[1] / p[3]))
    return 1.0 + share * math.expm1(-(state[0] - here) / p[1])


@block
def healing(dt: float, depth: float, state: State, p: State) -> float:
    """Factor on F^e; p = (share, depth, time_constant)."""
    here = max(depth, 0.0)
    state[0] = max(here + (state[0] - here) * math.exp(-dt / p[2]), here)
    return 1.0 + p[0] * math.expm1(-(state[0] - here) / p[1])


@block
def discontinuous_damage(dt: float, depth: float, state: State, p: State) -> float:
    """Factor on F^e; p = (share, depth, already)."""
    state[0] = max(state[0], depth, p[2])
    return 1.0 + p[0] * math.expm1(-state[0] / p[1])


_SHARE = Parameter(
    "share", "1", 0.0, 0.98, 0.2, "share of the stiffness that goes", required=True, amplitude=True, starts=(0.1, 0.4)
)
_DEPTH = Parameter(
    "depth",
    "mm",
    1e-3,
    100.0,
    0.5,
    "distance below the deepest point at which it goes, in the mean",
    required=True,
    starts=(0.15, 0.5, 2.0),
)
_ALREADY = Parameter("already", "mm", 0.0, 100.0, 0.0, "depth reached before the data begin", fixed=True)


def _stated(what: str) -> tuple[Parameter, Parameter]:
    """Share and depth of a form with one number: `depth` only says where the share is stated."""
    return (
        Parameter("share", "1", 0.0, 0.98, 0.2, what, required=True, amplitude=True, starts=(0.2,)),
        Parameter("depth", "mm", 1e-3, 100.0, 0.5, "half the distance at which it is gone", required=True, fixed=True),
    )


EFFECT = Effect(
    id="stress_softening",
    what="Below the deepest point reached the pad is softer (Mullins).",
    says="below its deepest point the pad loses up to {share:percent} of its force, over {depth:.3g} mm",
    check="precondition to the greatest depth of the protocol first, and let the pad rest",
    reference="Mullins, Rubber Chem. Technol. 42, 1969, 339-362",
    forms=(
        Form(
            name="exponential",
            what="softer with the distance below the deepest point",
            parameters=(_SHARE, _DEPTH, _ALREADY),
            blocks={"elastic": exponential},
            state=(0.0,),
        ),
        Form(
            name="rejoining",
            what="as exponential, until a little deeper than the deepest point",
            parameters=(
                _SHARE,
                _DEPTH,
                Parameter("further", "1", 0.0, 0.3, 0.08, "how much deeper, of the deepest point", starts=(0.08,)),
                _ALREADY,
            ),
            sought=False,
            blocks={"elastic": rejoining},
            state=(0.0, 0.0, 0.0),
        ),
        Form(
            name="linear",
            what="softer in proportion to the distance below the deepest point, up to the share",
            parameters=(_SHARE, replace(_DEPTH, bend=True), _ALREADY),
            blocks={"elastic": linear},
            state=(0.0,),
        ),
        Form(
            name="ogden_roxburgh",
            what="softer with the energy below the deepest point",
            parameters=(
                _SHARE,
                _DEPTH,
                Parameter("power", "1", 1.0, 8.0, 2.5, "power of the depth that the energy goes with"),
                Parameter("growth", "1", 0.0, 10.0, 0.1, "growth of the scale with the greatest energy", fixed=True),
                Parameter("reach", "mm", 1e-3, 100.0, 1.0, "depth below which `depth` counts", fixed=True),
                _ALREADY,
            ),
            blocks={"elastic": ogden_roxburgh},
            state=(0.0,),
        ),
        Form(
            name="discontinuous_damage",
            what="softer at all depths, by the deepest point",
            parameters=(_SHARE, _DEPTH, _ALREADY),
            blocks={"elastic": discontinuous_damage},
            state=(0.0,),
        ),
        Form(
            name="virgin",
            what="damage by the deepest point, which is in the first loading already",
            parameters=(_SHARE, _DEPTH, _ALREADY),
            blocks={"elastic": virgin},
            state=(0.0,),
        ),
        Form(
            name="ratio",
            what="softer by a power of the depth over the deepest",
            parameters=(
                *_stated("share of the stiffness that is gone at twice `depth` below `reach`"),
                Parameter("reach", "mm", 1e-3, 100.0, 1.0, "depth below which `depth` counts", fixed=True),
                _ALREADY,
            ),
            sought=False,
            blocks={"elastic": ratio},
            state=(0.0,),
            pack=_exponent,
        ),
        Form(
            name="relative",
            what="softer with the depth over the deepest, most at the surface",
            parameters=(
                _SHARE,
                _DEPTH,
                Parameter("reach", "mm", 1e-3, 100.0, 1.0, "depth below which `depth` counts", fixed=True),
                _ALREADY,
            ),
            sought=False,
            blocks={"elastic": relative},
            state=(0.0,),
            pack=_relative,
        ),
        Form(
            name="alteration",
            what="softer the deeper it was pressed, but at the deepest point",
            parameters=(
                _SHARE,
                _DEPTH,
                Parameter("exponent", "1", 0.5, 4.0, 1.0, "power of the distance", starts=(1.0, 2.0)),
                Parameter("whole", "mm", 0.01, 50.0, 0.5, "deepest depth that breaks 1 − 1/e of it", starts=(0.3, 1.5)),
                _ALREADY,
            ),
            sought=False,
            blocks={"elastic": alteration},
            state=(0.0,),
        ),
        Form(
            name="root",
            what="softer by the root of the distance below the deepest point",
            parameters=(
                *_stated("share of the stiffness that is gone at twice `depth`"),
                _ALREADY,
            ),
            sought=False,
            blocks={"elastic": root},
            state=(0.0,),
            pack=_steepness,
        ),
        Form(
            name="hyperbola",
            what="softer with the distance below the deepest point, levelling off late",
            parameters=(_SHARE, _DEPTH, _ALREADY),
            sought=False,
            blocks={"elastic": hyperbola},
            state=(0.0,),
        ),
        Form(
            name="weibull",
            what="softer with the distance below the deepest point, hardly so close to it",
            parameters=(
                _SHARE,
                _DEPTH,
                Parameter("exponent", "1", 0.5, 4.0, 2.0, "power of the distance", starts=(2.0,)),
                _ALREADY,
            ),
            sought=False,
            blocks={"elastic": weibull},
            state=(0.0,),
        ),
        Form(
            name="two_ways",
            what="softer on the way out than on the way back in",
            parameters=(
                _SHARE,
                _DEPTH,
                Parameter("again", "1", 0.0, 1.0, 0.7, "what is left of it on the way back in", starts=(0.7,)),
                Parameter("within", "mm", 1e-3, 10.0, 0.1, "way from the one to the other", starts=(0.05, 0.2)),
                _ALREADY,
            ),
            sought=False,
            blocks={"elastic": two_ways},
            state=(0.0, 0.0, 0.0),
        ),
        Form(
            name="conditioning",
            what="softer below the deepest point, and more with the first cycles",
            parameters=(
                _SHARE,
                _DEPTH,
                Parameter("lacks", "1", 0.0, 0.95, 0.3, "share of it that comes with later cycles", starts=(0.3,)),
                Parameter("takes", "1", 0.3, 30.0, 2.0, "cycles that it takes", starts=(2.0,)),
                _ALREADY,
            ),
            sought=False,
            blocks={"elastic": conditioning},
            state=(0.0, 0.0, 0.0),
        ),
        Form(
            name="healing",
            what="softer with the distance below a deepest point that rest makes forget",
            parameters=(
                _SHARE,
                _DEPTH,
                Parameter("time_constant", "s", 0.5, 1e4, 30.0, "time in which it is forgotten", starts=(10.0, 40.0)),
            ),
            blocks={"elastic": healing},
            state=(0.0,),
        ),
        Form(
            name="preconditioned",
            what="as exponential, on a pad pressed before the data begin",
            parameters=(
                _SHARE,
                _DEPTH,
                Parameter(
                    "already", "mm", 0.0, 100.0, 1.0, "depth reached before the data begin", starts=(0.5, 1.5, 3.0)
                ),
            ),
            sought=False,
            blocks={"elastic": exponential},
            state=(0.0,),
        ),
    ),
)
