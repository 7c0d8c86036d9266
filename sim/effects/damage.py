"""Damage: the pad gets softer with all the way it has been loaded, for good, at whatever depth.

Travel is the sum of all depth that the surface gains while it is loaded: where the probe comes back before the pad has
recovered, the way to the surface does not count. Positions come with noise, which would add up: a gain counts once
it exceeds a dead band (`dead_band`, a choice and not fitted).

- `exponential`: floor + (1 − floor) e^(−rate · travel/(1 − floor)).
- `hyperbolic`: 1/(1 + rate · travel), which slows down.
- `linear`: 1 − rate · travel, down to 0.02.
- `power`: (1 + k rate · travel)^(−1/k): between linear (k = −1), exponential (0) and hyperbolic (1), and beyond both:
  Kachanov's law, which ends in rupture, has k = −3 or so.
- `weibull`: e^(−rate · s (travel/s)^shape), s = `at_travel`: a bundle of fibres of which each breaks at its own travel.
  Above 1 the pad is whole at first and fails within some travel; below 1 it goes on ever slower.
- `energy`: as exponential, in the travel weighed by (n + 1) (δ/reach)^n, as the work of a spring F ∝ δ^n: deep travel
  counts more, and a stroke down to `reach` as much as elsewhere.
- `threshold`: e^(−rate · travel/(1 − spared)) of the travel deeper than `spared` times `reach` alone: what stays above
  does no harm (Lemaitre's p_D). A stroke down to `reach` costs as much as elsewhere.
- `fatigue`: as `power`, in the travel weighed as in `energy`: what a crack does whose growth goes with a power of the
  stroke (Paris), the faster the longer it is (k below 0).
- `loss`: e^(−rate · s ∫ ν (u − z)² dt), z' = ν (u − z), u = (δ/s)^n, ν = 1/time_constant: by what a pad dissipates as
  it relaxes, in holds too (W. van Dijk, Practical fatigue characterization of bituminous mixes, Proc. Assoc. Asphalt
  Paving Technol. 44, 1975, 38–74), over 1 − e^(−ν `lasts`): a stroke down to s, two thirds of `reach`, held for `lasts`
  and followed by a long rest costs as much as elsewhere; among strokes of all depths those are about the mean.
- `creep`: e^(−rate · s ∫ (δ/s)^n dt/`lasts`): by the time under load, at whatever speed that came (L. M. Kachanov,
  Rupture time under creep conditions, 1958; translated in Int. J. Fract. 97, 1999, xi–xviii). A stroke down to s, as of
  `loss`, held for `lasts` costs as much as elsewhere.
- `by_speed`: e^(−rate · ∫ (v/10 mm/s)^n ds) over the way loaded: quick strokes harm more, or less (n below 0), as the
  rate of a crack goes with a power of the rate of loading (S. N. Zhurkov, Int. J. Fract. Mech. 1, 1965, 311–323).
- `by_way`: e^(−rate · way): by all the way the probe has gone deeper below the first surface, whether the pad had come
  back to it by then or not, as cycles are counted on a machine that knows of strokes alone (ISO 3385, which pounds
  foams to a given stroke).

`rate` is what a mm of travel takes at first, of the stiffness; that of `weibull`, the mean up to `at_travel`.
In `loss` and `creep` it is multiplied by `weighs`: a diagnosis states by it what the strokes of its data took, in the
mean over their travel, however deep they went and long they lasted.

Reference: J. Lemaitre, A Course on Damage Mechanics, 2nd ed., Springer, 1996
(accumulated strain and energy as measures; chapter 4, fatigue); P. Paris and F. Erdogan, A critical analysis of crack
propagation laws, J. Basic Eng. 85, 1963; W. Weibull, A statistical distribution function of wide applicability, J.
Appl. Mech. 18, 1951 (`weibull`).
"""

from __future__ import annotations

import math
from dataclasses import replace

from sim.effects.base import Effect, Form, Parameter
from sim.jit import State, block, compiled

_LAST, _TRAVEL = range(2)
_MODE, _LOST = range(2)
_BEFORE = 2
_SPEED_MM_S, _SLOWEST_MM_S = 10.0, 0.01
"""Speed at which `rate` of `by_speed` holds, and below which none is told from rest."""
_LEAST = 0.02
_MEAN_STROKE = 2.0 / 3.0
"""Of `reach`: what `rate` of `loss` is stated for."""


@compiled("UniTuple(float64, 2)(float64, float64, float64, float64)")
def loaded(depth: float, dead_band: float, last: float, travel: float) -> tuple[float, float]:
    """(depth from which a further gain counts, loading travel), after the probe has come to a depth."""
    here = max(depth, 0.0)
    gained = here - dead_band - last
    if gained > 0.0:
        travel += gained
        last += gained
    return min(last, here), travel


@compiled("UniTuple(float64, 2)(float64, float64, float64, float64, float64, float64)")
def weighed(
    depth: float, dead_band: float, last: float, travel: float, exponent: float, reach: float
) -> tuple[float, float]:
    """As `loaded`, with travel weighed by (exponent + 1) (depth/reach)^exponent."""
    here = max(depth, 0.0)
    gained = here - dead_band - last
    if gained > 0.0:
        n = exponent + 1.0
        travel += reach * (((last + gained) / reach) ** n - (last / reach) ** n)
        last += gained
    return min(last, here), travel


@compiled("float64(float64, float64)")
def _by_power(lost: float, power: float) -> float:
    """(1 + power · lost)^(−1/power), of which 0 is the exponential."""
    if abs(power) < 1e-6:
        return max(_LEAST, math.exp(-lost))
    left = max(1.0 + power * lost, 1e-9)
    return max(_LEAST, math.exp(-math.log(left) / power))


@block
def exponential(dt: float, depth: float, state: State, p: State) -> float:
    """Factor on F^e; p = (rate, floor, dead_band)."""
    state[_LAST], state[_TRAVEL] = loaded(depth, p[2], state[_LAST], state[_TRAVEL])
    return p[1] + (1.0 - p[1]) * math.exp(-p[0] * state[_TRAVEL] / (1.0 - p[1]))


@block
def gone(dt: float, depth: float, state: State, p: State) -> float:
    """The depth as it is, and the way to it; p = (rate, dead_band)."""
    state[_LAST], state[_TRAVEL] = loaded(depth, p[1], state[_LAST], state[_TRAVEL])
    return depth


@block
def by_way(dt: float, depth: float, state: State, p: State) -> float:
    """Factor on F^e after the way that `gone` has counted; p = (rate, dead_band)."""
    return max(_LEAST, math.exp(-p[0] * state[_TRAVEL]))


@block
def power(dt: float, depth: float, state: State, p: State) -> float:
    """Factor on F^e; p = (rate, power, dead_band)."""
    state[_LAST], state[_TRAVEL] = loaded(depth, p[2], state[_LAST], state[_TRAVEL])
    return _by_power(p[0] * state[_TRAVEL], p[1])


@block
def weibull(dt: float, depth: float, state: State, p: State) -> float:
    """Factor on F^e; p = (rate, shape, at_travel, dead_band)."""
    state[_LAST], state[_TRAVEL] = loaded(depth, p[3], state[_LAST], state[_TRAVEL])
    return max(_LEAST, math.exp(-p[0] * p[2] * (state[_TRAVEL] / p[2]) ** p[1]))


@block
def hyperbolic(dt: float, depth: float, state: State, p: State) -> float:
    """Factor on F^e; p = (rate, dead_band)."""
    state[_LAST], state[_TRAVEL] = loaded(depth, p[1], state[_LAST], state[_TRAVEL])
    return 1.0 / (1.0 + p[0] * state[_TRAVEL])


@block
def linear(dt: float, depth: float, state: State, p: State) -> float:
    """Factor on F^e; p = (rate, dead_band)."""
    state[_LAST], state[_TRAVEL] = loaded(depth, p[1], state[_LAST], state[_TRAVEL])
    return max(_LEAST, 1.0 - p[0] * state[_TRAVEL])


@block
def energy(dt: float, depth: float, state: State, p: State) -> float:
    """Factor on F^e; p = (rate, exponent, floor, reach, dead_band)."""
    state[_LAST], state[_TRAVEL] = weighed(depth, p[4], state[_LAST], state[_TRAVEL], p[1], p[3])
    return p[2] + (1.0 - p[2]) * math.exp(-p[0] * state[_TRAVEL] / (1.0 - p[2]))


@block
def fatigue(dt: float, depth: float, state: State, p: State) -> float:
    """Factor on F^e; p = (rate, exponent, power, reach, dead_band)."""
    state[_LAST], state[_TRAVEL] = weighed(depth, p[4], state[_LAST], state[_TRAVEL], p[1], p[3])
    return _by_power(p[0] * state[_TRAVEL], p[2])


@block
def loss(dt: float, depth: float, state: State, p: State) -> float:
    """Factor on F^e; p = (rate, exponent, time_constant, reach, lasts, weighs); state: what the mode that relaxes
    remembers, ∫ ν (u − z)² dt."""
    stroke = _MEAN_STROKE * p[3]
    u = (depth / stroke) ** p[1] if depth > 0.0 else 0.0
    fades = math.exp(-dt / p[2])
    behind = u - state[_MODE]
    state[_MODE] = u - behind * fades
    state[_LOST] += 0.5 * behind * behind * (1.0 - fades * fades)
    return math.exp(p[0] * p[5] * stroke * state[_LOST] / math.expm1(-p[4] / p[2]))


@block
def creep(dt: float, depth: float, state: State, p: State) -> float:
    """Factor on F^e; p = (rate, exponent, reach, lasts, weighs); state: depth before, ∫ (δ/s)^n dt."""
    stroke = _MEAN_STROKE * p[2]
    here = max(depth, 0.0)
    state[1] += dt * (0.5 * (here + state[0]) / stroke) ** p[1]
    state[0] = here
    return max(_LEAST, math.exp(-p[0] * p[4] * stroke * state[1] / p[3]))


@block
def threshold(dt: float, depth: float, state: State, p: State) -> float:
    """Factor on F^e; p = (rate, spared, reach, dead_band)."""
    limit = p[1] * p[2]
    state[_LAST], state[_TRAVEL] = loaded(depth - limit, p[3], state[_LAST], state[_TRAVEL])
    return math.exp(-p[0] * state[_TRAVEL] / (1.0 - p[1]))


@block
def by_speed(dt: float, depth: float, state: State, p: State) -> float:
    """Factor on F^e; p = (rate, exponent, dead_band). State: as elsewhere, and the depth before."""
    state[_LAST], went = loaded(depth, p[2], state[_LAST], 0.0)
    speed = (max(depth, 0.0) - state[_BEFORE]) / dt if dt > 0.0 else 0.0
    state[_BEFORE] = max(depth, 0.0)
    state[_TRAVEL] += went * (max(speed, _SLOWEST_MM_S) / _SPEED_MM_S) ** p[1]
    return max(_LEAST, math.exp(-p[0] * state[_TRAVEL]))


_RATE = Parameter(
    "rate",
    "1/mm",
    0.0,
    10.0,
    0.01,
    "relative loss of stiffness per mm of loading travel, at first",
    required=True,
    amplitude=True,
    starts=(0.003, 0.03),
)
_FLOOR = Parameter("floor", "1", 0.0, 0.998, 0.0, "share of the stiffness that stays", starts=(0.0, 0.5, 0.96))
_DEAD_BAND = Parameter("dead_band", "mm", 0.0, 0.1, 0.004, "gain of depth that counts as noise", fixed=True)
_POWER = Parameter("power", "1", -4.0, 12.0, 1.0, "0: exponential, 1: hyperbolic, -1: linear", starts=(-1.0, 1.0))
_EXPONENT = Parameter("exponent", "1", 0.0, 5.0, 1.0, "power of depth that weights the travel", starts=(1.0, 2.0))
_LASTS = Parameter("lasts", "s", 1e-3, 1e9, 1e9, "time for which a stroke is held that costs `rate`", fixed=True)
_WEIGHS = Parameter("weighs", "1", 1e-9, 1e9, 1.0, "travel that such a stroke stands for, over its own", fixed=True)
_REACH = Parameter("reach", "mm", 1e-3, 100.0, 1.0, "depth of a stroke on which `rate` is the mean", fixed=True)

EFFECT = Effect(
    id="damage",
    what="The pad gets softer with all the way it has been loaded, for good.",
    says="the pad loses {rate:percent} of its stiffness per mm it is pressed in, over and over",
    check="repeat one cycle many times; a pad that does not come to rest is worn out: take a new one",
    reference="Lemaitre, A Course on Damage Mechanics, 2nd ed., 1996",
    forms=(
        Form(
            name="exponential",
            what="exponentially with loading travel, to a floor",
            parameters=(_RATE, _FLOOR, _DEAD_BAND),
            blocks={"elastic": exponential},
            state=(0.0, 0.0),
        ),
        Form(
            name="hyperbolic",
            what="ever slower with loading travel",
            parameters=(_RATE, _DEAD_BAND),
            sought=False,
            blocks={"elastic": hyperbolic},
            state=(0.0, 0.0),
        ),
        Form(
            name="linear",
            what="in proportion to loading travel",
            parameters=(_RATE, _DEAD_BAND),
            sought=False,
            blocks={"elastic": linear},
            state=(0.0, 0.0),
        ),
        Form(
            name="by_way",
            what="with all the way down, in contact or not",
            parameters=(_RATE, _DEAD_BAND),
            sought=False,
            blocks={"depth": gone, "elastic": by_way},
            state=(0.0, 0.0),
        ),
        Form(
            name="power",
            what="with a power of loading travel",
            parameters=(_RATE, _POWER, _DEAD_BAND),
            blocks={"elastic": power},
            state=(0.0, 0.0),
        ),
        Form(
            name="weibull",
            what="as fibres of which each breaks at its own loading travel",
            parameters=(
                _RATE,
                Parameter("shape", "1", 0.3, 6.0, 1.0, "1: exponential; above, whole at first", starts=(0.6, 2.0)),
                Parameter("at_travel", "mm", 1e-3, 1e9, 20.0, "travel up to which `rate` is the mean", fixed=True),
                _DEAD_BAND,
            ),
            sought=False,
            blocks={"elastic": weibull},
            state=(0.0, 0.0),
        ),
        Form(
            name="energy",
            what="exponentially with the work of loading",
            parameters=(_RATE, _EXPONENT, _FLOOR, _REACH, _DEAD_BAND),
            blocks={"elastic": energy},
            state=(0.0, 0.0),
        ),
        Form(
            name="fatigue",
            what="with a power of the work of loading, as a crack that grows",
            parameters=(_RATE, _EXPONENT, _POWER, _REACH, _DEAD_BAND),
            sought=False,
            blocks={"elastic": fatigue},
            state=(0.0, 0.0),
        ),
        Form(
            name="loss",
            what="with what the pad dissipates as it relaxes",
            parameters=(
                _RATE,
                replace(_EXPONENT, lower=0.3, what="power of depth with which the load goes"),
                Parameter("time_constant", "s", 1e-3, 1e3, 1.0, "within which it relaxes", starts=(0.1, 1.0, 10.0)),
                _REACH,
                _LASTS,
                _WEIGHS,
            ),
            sought=False,
            blocks={"elastic": loss},
            state=(0.0, 0.0),
        ),
        Form(
            name="creep",
            what="with the time under load",
            parameters=(
                _RATE,
                replace(_EXPONENT, lower=0.3, what="power of depth with which it goes"),
                _REACH,
                replace(_LASTS, typical=1.0),
                _WEIGHS,
            ),
            blocks={"elastic": creep},
            state=(0.0, 0.0),
        ),
        Form(
            name="threshold",
            what="with loading travel beyond a depth alone",
            parameters=(
                _RATE,
                Parameter("spared", "1", 0.0, 0.9, 0.3, "limit over `reach`", starts=(0.2, 0.4, 0.6)),
                _REACH,
                _DEAD_BAND,
            ),
            sought=False,
            blocks={"elastic": threshold},
            state=(0.0, 0.0),
        ),
        Form(
            name="by_speed",
            what="with loading travel, more or less of it as that is quick",
            parameters=(
                _RATE,
                Parameter("exponent", "1", -1.5, 2.0, 0.4, "power of the speed", starts=(-0.4, 0.4)),
                _DEAD_BAND,
            ),
            sought=False,
            blocks={"elastic": by_speed},
            state=(0.0, 0.0, 0.0),
        ),
    ),
)
