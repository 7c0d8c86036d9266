"""Relaxation that depends on depth: all rates times one factor, a clock of the material's own.

- `exponential`: e^(slope · δ).
- `linear`: 1 + slope · δ, continued below 0.1 by an exponential so that no rate ever vanishes.
- `hyperbolic`: time constants linear in depth, 1/(1 + g δ/reach): water that leaves by the radius of a contact under a
  sphere goes a way whose square is as δ (Y. Z. Hu, X. Zhao, J. J. Vlassak, Z. Suo, Using indentation to characterize
  the poroelasticity of gels, Appl. Phys. Lett. 96, 2010, 121904).
- `layer`: time constants that go with the square of what is left of a layer, 1/(1 + g δ/reach)²: water that leaves
  through its thickness (K. Terzaghi, Erdbaumechanik, Deuticke, 1925). In both g is such that `slope` is the mean from
  the surface to the reach: at the surface they can be many times as steep.
- `free_volume`: e^(slope · δ/(1 + δ/fading)): rates go with e^(−B/f), and the free volume f with depth (M. L. Williams,
  R. F. Landel, J. D. Ferry, J. Am. Chem. Soc. 77, 1955, 3701–3707).
- `knee`: 1 + slope · min(δ, knee): linear up to a knee, and even beyond.
- `beyond`: 1 up to a share `begins` of the reach, and linear from there; `slope` is the mean from the surface to the
  reach: cells or asperities that must close first (L. J. Gibson, M. F. Ashby, Cellular Solids, 2nd ed., Cambridge
  University Press, 1997).
- `late`: 1 + slope · d, where d follows the depth with a time constant: the structure takes its time (A. J. Kovacs,
  Transition vitreuse dans les polymères amorphes, Fortschr. Hochpolym.-Forsch. 3, 1963, 394–507).
- `drained`: 1 + slope · m, m the deepest point since the probe came from air: water that has been pressed out comes
  back only where nothing presses (J. S. Hou, M. H. Holmes, W. M. Lai, V. C. Mow, Boundary conditions at the
  cartilage-synovial fluid interface, J. Biomech. Eng. 111, 1989, 78–87).

`linear`, `exponential`, `free_volume`, `knee`, `late` and `drained` have the relative slope `slope` at the surface.

Reference: R. A. Schapery, On the characterization of nonlinear viscoelastic materials, Polym. Eng. Sci. 9, 1969,
295–310 (shift factor that depends on strain).
"""

from __future__ import annotations

import math

from sim.effects.base import Effect, Form, Parameter
from sim.effects.linear import first_order as lagged
from sim.jit import State, block, compiled

_LEAST = 0.1


@compiled("float64(float64)")
def _kept(factor: float) -> float:
    """A factor, continued below a tenth by an exponential that never reaches 0."""
    return factor if factor >= _LEAST else _LEAST * math.exp(max(factor / _LEAST - 1.0, -50.0))


@compiled("float64(float64, float64)")
def _at_the_reach(slope: float, reach: float) -> float:
    """The factor there, of a mean slope; continued below a tenth by a logarithm: a fit may begin with the slope of
    another form, which at the surface can be beyond any mean."""
    factor = 1.0 + slope * reach
    return factor if factor >= _LEAST else _LEAST / (1.0 + math.log(2.0 - factor / _LEAST))


@block
def linear(dt: float, depth: float, state: State, p: State) -> float:
    """Factor on the rates; p = (slope,)."""
    factor = 1.0 + p[0] * max(depth, 0.0)
    return _kept(factor)


@block
def exponential(dt: float, depth: float, state: State, p: State) -> float:
    """Factor on the rates; p = (slope,)."""
    return math.exp(min(max(p[0] * max(depth, 0.0), -50.0), 50.0))


@block
def hyperbolic(dt: float, depth: float, state: State, p: State) -> float:
    """Factor on the rates; p = (slope, reach)."""
    whole = _at_the_reach(p[0], p[1])
    return 1.0 / _kept(1.0 + (1.0 / whole - 1.0) * max(depth, 0.0) / p[1])


@block
def layer(dt: float, depth: float, state: State, p: State) -> float:
    """Factor on the rates; p = (slope, reach)."""
    whole = _at_the_reach(p[0], p[1])
    left = _kept(1.0 + (1.0 / math.sqrt(whole) - 1.0) * max(depth, 0.0) / p[1])
    return 1.0 / (left * left)


@block
def free_volume(dt: float, depth: float, state: State, p: State) -> float:
    """Factor on the rates; p = (slope, fading)."""
    here = max(depth, 0.0)
    return math.exp(min(max(p[0] * here / (1.0 + here / p[1]), -50.0), 50.0))


@block
def knee(dt: float, depth: float, state: State, p: State) -> float:
    """Factor on the rates; p = (slope, knee)."""
    here = max(depth, 0.0)
    factor = 1.0 + p[0] * min(here, p[1])
    return _kept(factor)


@block
def beyond(dt: float, depth: float, state: State, p: State) -> float:
    """Factor on the rates; p = (slope, begins, reach)."""
    factor = 1.0 + p[0] * max(depth - p[1] * p[2], 0.0) / (1.0 - p[1])
    return _kept(factor)


@block
def late(dt: float, depth: float, state: State, p: State) -> float:
    """Factor on the rates; p = (slope, time_constant); state: the depth that is followed, and the depth before."""
    here = max(depth, 0.0)
    state[0] = lagged(dt, state[0], state[1], here, p[1])
    state[1] = here
    return _kept(1.0 + p[0] * state[0])


@block
def drained(dt: float, depth: float, state: State, p: State) -> float:
    """Factor on the rates; p = (slope,); state: the deepest point since the last touch."""
    state[0] = max(state[0], depth) if depth > 0.0 else 0.0
    return _kept(1.0 + p[0] * state[0])


_SLOPE = Parameter(
    "slope",
    "1/mm",
    -5.0,
    5.0,
    0.3,
    "relative change of all rates per mm of depth",
    required=True,
    amplitude=True,
    starts=(-0.3, 0.3),
)

_REACH = Parameter("reach", "mm", 1e-3, 1e3, 1.0, "depth to which `slope` is the mean", fixed=True)

EFFECT = Effect(
    id="depth_dependent_relaxation",
    what="The pad relaxes faster or slower the deeper it is pressed.",
    says="all relaxation rates {slope:grow/fall} by {slope:percent} per mm of depth",
    check="hold at several depths for the same time; keep to the depths that matter and fit there",
    reference="Schapery, Polym. Eng. Sci. 9, 1969, 295-310",
    forms=(
        Form(name="linear", what="rates linear in depth", parameters=(_SLOPE,), blocks={"rate": linear}),
        Form(name="exponential", what="rates exponential in depth", parameters=(_SLOPE,), blocks={"rate": exponential}),
        Form(
            name="hyperbolic",
            what="time constants linear in depth",
            parameters=(_SLOPE, _REACH),
            blocks={"rate": hyperbolic},
        ),
        Form(
            name="layer",
            what="time constants that go with the square of what is left of a layer",
            parameters=(_SLOPE, _REACH),
            sought=False,
            blocks={"rate": layer},
        ),
        Form(
            name="free_volume",
            what="rates that go with the free volume, less and less with the depth",
            parameters=(
                _SLOPE,
                Parameter("fading", "mm", 0.1, 1e3, 4.0, "depth at which half the slope is left", starts=(1.0, 4.0)),
            ),
            blocks={"rate": free_volume},
        ),
        Form(
            name="knee",
            what="rates linear in depth up to a knee",
            parameters=(
                _SLOPE,
                Parameter("knee", "mm", 0.1, 1e3, 1.5, "depth from which the rates stay as they are", bend=True),
            ),
            sought=False,
            blocks={"rate": knee},
        ),
        Form(
            name="beyond",
            what="rates linear in depth, from a depth on",
            parameters=(
                _SLOPE,
                Parameter("begins", "1", 0.0, 0.9, 0.4, "share of the reach up to which they are as at the surface"),
                _REACH,
            ),
            sought=False,
            blocks={"rate": beyond},
        ),
        Form(
            name="drained",
            what="rates linear in the deepest point since the last touch",
            parameters=(_SLOPE,),
            blocks={"rate": drained},
            state=(0.0,),
        ),
        Form(
            name="late",
            what="rates linear in a depth that is followed late",
            parameters=(
                _SLOPE,
                Parameter("time_constant", "s", 1e-2, 1e3, 0.5, "how late it is followed", starts=(0.2, 1.0)),
            ),
            blocks={"rate": late},
            state=(0.0, 0.0),
        ),
    ),
)
