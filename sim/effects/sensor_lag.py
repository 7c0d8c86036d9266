"""Sensor lag: a low-pass in the force path, as amplifiers and load cells have.

In all forms `time_constant` is how far the output comes behind a ramp in the end, so that a change of form keeps its
value. Each but `slewing`, which limits the rate from sample to sample, is exact for a force that is linear between
samples, at any spacing.

- `first_order`: 1/(1 + τs).
- `partly`: 1 − σ + σ/(1 + τs/σ), a share σ of the force late and the rest at once: lag and lead of a divider with a
  capacitor, (1 + (1 − σ)τs/σ)/(1 + τs/σ).
- `two_poles`: critically damped, 1/(1 + τs/2)².
- `butterworth`: second order without a peak, damping ratio 1/√2, ω = √2/τ.
- `three_poles`: after Butterworth, 1/((1 + s/ω)(1 + s/ω + s²/ω²)) with ω = 2/τ, which overshoots by 8 %.
- `chebyshev`: four poles after Chebyshev with a ripple of 0.5 dB, as in front of converters: nearly a delay, and a
  ringing after it.
- `line`: a line with resistance and capacity all along, 1/cosh √(2τs): poles at 1, 9, 25, 49 times the slowest (W. C.
  Elmore, The transient response of damped linear networks, J. Appl. Phys. 19, 1948, 55–63).
- `moving_average`: the mean over the last 2τ.
- `decimator`: the mean over 2wτ around the time τ ago. With w = 1/√3 delay and width are those of three running means
  in a row, as of a converter's sinc³ decimator (E. B. Hogenauer, IEEE Trans. Acoust. Speech Signal Process. 29, 1981,
  155–162).
- `finite`: the same of any width w: weights that are even about their middle let the force come late by half their
  length, and smooth it the less, the sharper their passband ends (A. V. Oppenheim, R. W. Schafer, Discrete-Time Signal
  Processing, 3rd ed., Prentice Hall, 2010, chapter 7).
- `throttled`: 1/(1 + τ(1 − u)s) as the force rises and 1/(1 + τ(1 + u)s) as it falls, as of a hydraulic cell behind a
  throttle with a valve (Doebelin, chapter 6). A step that begins on one side of the force ends on it.
- `slewing`: one pole, whose output goes no faster than at_force/(slow · τ): the slew rate of an amplifier, or a pen's
  (Doebelin, chapters 3 and 12).
- `loaded`: one pole of the time τ e^(growth (y/at_force − 1)), which goes with the force y that is there: air in a cell
  of oil gives way the less, the more it bears (H. E. Merritt, Hydraulic Control Systems, Wiley, 1967, section 1.3).
- `opening`: one pole of the time τ/(1 + opens |F − y|/at_force), F − y what the output y lacks: a filter that opens
  where the force moves, as weighing indicators have ("adaptive"), and τ that of small changes (of this kind: G. Casiez,
  N. Roussel, D. Vogel, 1€ filter: a simple speed-based low-pass filter, Proc. CHI 2012, 2527–2530).
- `warming`: one pole of the time τ e^(growth u + bend (3u² − 1)/2), u = t/at_time − 1, which goes with the time since
  the first sample: oil thins as it warms (G. W. Stachowiak, A. W. Batchelor, Engineering Tribology, 4th ed.,
  Butterworth-Heinemann, 2014, section 2.3). With at_time half the length of the data, τ is its geometric mean.

Reference: E. O. Doebelin, Measurement Systems: Application and Design, 4th ed., McGraw-Hill, 1990, chapter 3 (first
and second order instruments and their response to a ramp); A. I. Zverev, Handbook of Filter Synthesis, Wiley, 1967
(poles after Chebyshev).
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from sim.effects.base import Effect, Form, Parameter
from sim.effects.linear import first_order as lagged
from sim.effects.linear import low_pass
from sim.effects.stamps import HALF_TIME
from sim.effects.varying_lag import loaded, one_pole, opening, slewing, throttled, warming
from sim.jit import State, block

_Y, _LAST, _STARTED, _Y2, _V, _V2 = range(6)


@block
def first_order(dt: float, u: float, state: State, p: State) -> float:
    """τ y' = u − y; p = (time_constant,)."""
    y = one_pole(dt, state[_STARTED], state[_Y], state[_LAST], u, p[0])
    state[_STARTED], state[_Y], state[_LAST] = 1.0, y, u
    return y


@block
def partly(dt: float, u: float, state: State, p: State) -> float:
    """A share passes a lag of τ/share, the rest at once; p = (time_constant, share)."""
    y = one_pole(dt, state[_STARTED], state[_Y], state[_LAST], u, p[0] / p[1])
    state[_STARTED], state[_Y], state[_LAST] = 1.0, y, u
    return u + p[1] * (y - u)


@block
def two_poles(dt: float, u: float, state: State, p: State) -> float:
    """Two first-order lags of τ/2 in a row; p = (time_constant,)."""
    if state[_STARTED] == 0.0 or p[0] <= 0.0:
        state[_STARTED] = 1.0
        state[_Y] = u
        state[_Y2] = u
    elif dt > 0.0:
        x = 2.0 * dt / p[0]
        decay = math.exp(-x)
        lag = (u - state[_LAST]) / x  # behind the ramp, after each of the two
        one = state[_Y] - state[_LAST] + lag
        two = state[_Y2] - state[_LAST] + 2.0 * lag
        state[_Y] = u - lag + one * decay
        state[_Y2] = u - 2.0 * lag + (two + one * x) * decay
    state[_LAST] = u
    return state[_Y2]


@block
def butterworth(dt: float, u: float, state: State, p: State) -> float:
    """Second order with damping ratio 1/√2; p = (time_constant,)."""
    if state[_STARTED] == 0.0 or p[0] <= 0.0:
        state[_STARTED] = 1.0
        state[_Y] = u
        state[_Y2] = 0.0
    else:
        omega = math.sqrt(2.0) / p[0]
        y, v = low_pass(dt, state[_Y], state[_Y2], state[_LAST], u, omega, math.sqrt(0.5))
        state[_Y] = y
        state[_Y2] = v
    state[_LAST] = u
    return state[_Y]


@block
def three_poles(dt: float, u: float, state: State, p: State) -> float:
    """Third order after Butterworth, by partial fractions: 1/(1 + s) − s/(1 + s + s²); p = (time_constant,)."""
    if state[_STARTED] == 0.0 or p[0] <= 0.0:
        state[_STARTED] = 1.0
        state[_Y] = u
        state[_Y2] = u
        state[_V2] = 0.0
        state[_LAST] = u
        return u
    omega = 2.0 / p[0]
    y = lagged(dt, state[_Y], state[_LAST], u, 1.0 / omega)
    y2, v2 = low_pass(dt, state[_Y2], state[_V2], state[_LAST], u, omega, 0.5)
    state[_Y] = y
    state[_Y2] = y2
    state[_V2] = v2
    state[_LAST] = u
    return y - v2 / omega


def _modes(poles: list[complex]) -> list[tuple[float, float, float, float]]:
    """Of poles, one of each pair, scaled to a delay of 1 in all: (ω, ζ, share of the mode's output, of its speed).

    By partial fractions: Π −p over Π (s − p) is the sum over pairs of (b s + a)/(s² + 2ζω s + ω²).
    """
    every = [q for p in poles for q in (p, p.conjugate())]
    delay = sum(-1.0 / p for p in every).real
    every = [delay * p for p in every]
    gain = math.prod((abs(delay * p) ** 2 for p in poles), start=1.0)
    out = []
    for p in (delay * p for p in poles):
        rest = math.prod(((p - q) for q in every if q != p), start=complex(1.0))
        residue, omega = gain / rest, abs(p)
        a, b = -2.0 * (residue * p.conjugate()).real, 2.0 * residue.real
        out.append((omega, -p.real / omega, a / omega**2, b / omega**2))
    return out


_RIPPLE, _ORDER = math.sqrt(10.0**0.05 - 1.0), 4
_SINH, _COSH = math.sinh(math.asinh(1.0 / _RIPPLE) / _ORDER), math.cosh(math.asinh(1.0 / _RIPPLE) / _ORDER)
_ANGLES = [math.pi * (2 * k + 1) / (2 * _ORDER) for k in range(_ORDER // 2)]
(_W1, _Z1, _A1, _B1), (_W2, _Z2, _A2, _B2) = _modes(
    [complex(-_SINH * math.sin(angle), _COSH * math.cos(angle)) for angle in _ANGLES]
)


@block
def chebyshev(dt: float, u: float, state: State, p: State) -> float:
    """Four poles after Chebyshev; p = (time_constant,)."""
    if state[_STARTED] == 0.0 or p[0] <= 0.0:
        state[_STARTED] = 1.0
        state[_Y] = u
        state[_Y2] = u
        state[_V] = 0.0
        state[_V2] = 0.0
        state[_LAST] = u
        return u
    y, v = low_pass(dt, state[_Y], state[_V], state[_LAST], u, _W1 / p[0], _Z1)
    y2, v2 = low_pass(dt, state[_Y2], state[_V2], state[_LAST], u, _W2 / p[0], _Z2)
    state[_Y] = y
    state[_V] = v
    state[_Y2] = y2
    state[_V2] = v2
    state[_LAST] = u
    return _A1 * y + _A2 * y2 + p[0] * (_B1 * v + _B2 * v2)


_SQUARES = (1.0, 9.0, 25.0, 49.0)
_LAGS = tuple(1.0 / square / sum(1.0 / other for other in _SQUARES) for square in _SQUARES)
_PARTS = tuple(
    math.prod((lag / (lag - other) for other in _LAGS if other != lag), start=1.0) for lag in _LAGS
)  # partial fractions
(_T1, _T2, _T3, _T4), (_P1, _P2, _P3, _P4) = _LAGS, _PARTS


@block
def line(dt: float, u: float, state: State, p: State) -> float:
    """Four poles of a line, side by side; p = (time_constant,). State: last, started, the four."""
    if state[1] == 0.0 or p[0] <= 0.0:
        state[1] = 1.0
        state[2] = u
        state[3] = u
        state[4] = u
        state[5] = u
    else:
        state[2] = lagged(dt, state[2], state[0], u, _T1 * p[0])
        state[3] = lagged(dt, state[3], state[0], u, _T2 * p[0])
        state[4] = lagged(dt, state[4], state[0], u, _T3 * p[0])
        state[5] = lagged(dt, state[5], state[0], u, _T4 * p[0])
    state[0] = u
    return _P1 * state[2] + _P2 * state[3] + _P3 * state[4] + _P4 * state[5]


# moving average: the integral of the force at knots in a ring; (age of the newest, integral, force, time) …
_AGE, _TOTAL, _FORCE, _NOW, _FIRST, _COUNT, _TAIL = range(7)  # two of the last
_RING = 8
KNOTS = 256
_PER_WINDOW = 200


@block
def moving_average(dt: float, u: float, state: State, p: State) -> float:
    """Mean over 2wτ, whose middle was τ ago; p = (time_constant, width).

    Knots (time, integral, force) stand at every sample, or where samples are closer than a 200th of the window, at
    that distance. Between knots the force is taken as linear.
    """
    width = 2.0 * p[0]
    if state[_COUNT] == 0.0:
        state[_FIRST] = u
        state[_TOTAL] = 0.0
        state[_NOW] = 0.0
    else:
        state[_NOW] += dt
        state[_TOTAL] += 0.5 * dt * (state[_FORCE] + u)
    state[_FORCE] = u
    now = state[_NOW]
    count = int(state[_COUNT])
    newest = _RING + 3 * ((count - 1) % KNOTS)
    if count == 0 or now - state[newest] >= width / _PER_WINDOW or dt <= 0.0:
        slot = _RING + 3 * (count % KNOTS)
        state[slot] = now
        state[slot + 1] = state[_TOTAL]
        state[slot + 2] = u
        state[_COUNT] += 1.0
        count += 1
    if width <= 0.0:
        return u
    half = 0.5 * width * p[1]
    before = after = 0.0  # integrals up to the window's begin and end
    for end in range(2):
        at = min(now - p[0] - half if end == 0 else now - p[0] + half, now)
        value = state[_TOTAL]
        if at <= 0.0:  # before the data the force was the first one
            value = at * state[_FIRST]
        elif at < now:
            tail = max(int(state[_TAIL + end]), count - KNOTS)
            while tail + 1 < count and state[_RING + 3 * ((tail + 1) % KNOTS)] <= at:
                tail += 1
            state[_TAIL + end] = float(tail)
            low = _RING + 3 * (tail % KNOTS)
            if tail + 1 < count:
                high = _RING + 3 * ((tail + 1) % KNOTS)
                then, force = state[high], state[high + 2]
            else:
                then, force = now, u
            into = at - state[low]
            slope = (force - state[low + 2]) / (then - state[low]) if then > state[low] else 0.0
            value = state[low + 1] + into * (state[low + 2] + 0.5 * slope * into)
        if end == 0:
            before = value
        else:
            after = value
    return (after - before) / (2.0 * half)


def _whole(values: Mapping[str, float]) -> tuple[float, ...]:
    return values["time_constant"], 1.0


_TIME_CONSTANT = Parameter(
    "time_constant",
    "s",
    0.0,
    1.0,
    0.01,
    "how far the reported force comes behind a ramp",
    required=True,
    amplitude=True,
    floor=("sample_s", 0.05),
    starts=(0.002, 0.01, 0.05),
)

EFFECT = Effect(
    id="sensor_lag",
    what="A low-pass in the force path smooths the force and lets it come late.",
    says="the force path smooths with a time constant of {time_constant:milli} ms",
    check="widen the filter of the load-cell amplifier, or note its setting and keep it",
    reference="Doebelin, Measurement Systems, 4th ed., 1990, chapter 3",
    forms=(
        Form(
            name="first_order",
            what="one pole",
            parameters=(_TIME_CONSTANT,),
            blocks={"sensor": first_order},
            state=(0.0,) * 3,
        ),
        Form(
            name="partly",
            what="one pole for a share of the force, the rest at once",
            parameters=(
                _TIME_CONSTANT,
                Parameter("share", "1", 0.1, 1.0, 0.7, "share of the force that comes late", starts=(0.4, 0.7)),
            ),
            sought=False,
            blocks={"sensor": partly},
            state=(0.0,) * 3,
        ),
        Form(
            name="two_poles",
            what="two equal poles, critically damped",
            parameters=(_TIME_CONSTANT,),
            blocks={"sensor": two_poles},
            state=(0.0,) * 4,
        ),
        Form(
            name="butterworth",
            what="second order, as flat as can be",
            parameters=(_TIME_CONSTANT,),
            blocks={"sensor": butterworth},
            state=(0.0,) * 4,
        ),
        Form(
            name="three_poles",
            what="third order, as flat as can be",
            parameters=(_TIME_CONSTANT,),
            sought=False,
            blocks={"sensor": three_poles},
            state=(0.0,) * 6,
        ),
        Form(
            name="chebyshev",
            what="four poles, nearly a delay",
            parameters=(_TIME_CONSTANT,),
            sought=False,
            blocks={"sensor": chebyshev},
            state=(0.0,) * 6,
        ),
        Form(
            name="line",
            what="a long line, with resistance and capacity all along",
            parameters=(_TIME_CONSTANT,),
            sought=False,
            blocks={"sensor": line},
            state=(0.0,) * 6,
        ),
        Form(
            name="moving_average",
            what="mean over a window of twice the time constant",
            parameters=(_TIME_CONSTANT,),
            blocks={"sensor": moving_average},
            state=(0.0,) * (_RING + 3 * KNOTS),
            pack=_whole,
        ),
        Form(
            name="decimator",
            what="mean over a shorter window as late, as of a converter's sinc filter",
            parameters=(
                _TIME_CONSTANT,
                Parameter("width", "1", 0.1, 1.0, 3.0**-0.5, "window over twice the time constant", fixed=True),
            ),
            blocks={"sensor": moving_average},
            state=(0.0,) * (_RING + 3 * KNOTS),
        ),
        Form(
            name="finite",
            what="a mean about a time ago, as of filters of finite response",
            parameters=(
                _TIME_CONSTANT,
                Parameter("width", "1", 0.02, 1.0, 0.3, "window over twice the time constant", starts=(0.15, 0.4)),
            ),
            sought=False,
            blocks={"sensor": moving_average},
            state=(0.0,) * (_RING + 3 * KNOTS),
        ),
        Form(
            name="throttled",
            what="one pole, quicker as the force rises than as it falls, or the other way round",
            parameters=(
                _TIME_CONSTANT,
                Parameter(
                    "uneven", "1", -0.8, 0.8, 0.2, "what falling takes more, of itself", default=0.0, starts=(-0.3, 0.3)
                ),
            ),
            sought=False,
            blocks={"sensor": throttled},
            state=(0.0,) * 3,
        ),
        Form(
            name="slewing",
            what="one pole, with a greatest rate",
            parameters=(
                _TIME_CONSTANT,
                Parameter(
                    "slow",
                    "1",
                    0.0,
                    50.0,
                    3.0,
                    "`at_force` over the time constant, over the greatest rate",
                    default=0.0,
                    starts=(1.0, 4.0),
                ),
                Parameter("at_force", "N", 1e-3, 1e5, 5.0, "force that tells the greatest rate", fixed=True),
            ),
            sought=False,
            blocks={"sensor": slewing},
            state=(0.0,) * 3,
        ),
        Form(
            name="loaded",
            what="one pole, quicker or slower under load",
            parameters=(
                _TIME_CONSTANT,
                Parameter(
                    "growth", "1", -2.0, 2.0, 0.4, "of its logarithm, from no load on", default=0.0, starts=(-0.7, 0.7)
                ),
                Parameter("at_force", "N", 1e-3, 1e5, 5.0, "force at which the time is as stated", fixed=True),
            ),
            sought=False,
            blocks={"sensor": loaded},
            state=(0.0,) * 3,
        ),
        Form(
            name="opening",
            what="one pole, quicker the more is missing, as of an adaptive filter",
            parameters=(
                _TIME_CONSTANT,
                Parameter(
                    "opens",
                    "1",
                    0.0,
                    300.0,
                    8.0,
                    "times quicker, less 1, where all of `at_force` is missing",
                    default=0.0,
                    starts=(3.0, 12.0, 50.0),
                ),
                Parameter("at_force", "N", 1e-3, 1e5, 5.0, "force that tells how far it opens", fixed=True),
            ),
            sought=False,
            blocks={"sensor": opening},
            state=(0.0,) * 3,
        ),
        Form(
            name="warming",
            what="one pole, quicker or slower as time goes by",
            parameters=(
                _TIME_CONSTANT,
                Parameter(
                    "growth",
                    "1",
                    -1.5,
                    1.5,
                    0.4,
                    "of its logarithm, over half the data",
                    default=0.0,
                    starts=(-0.5, 0.5),
                ),
                Parameter("bend", "1", -1.0, 1.0, 0.2, "of its logarithm, at either end", default=0.0),
                HALF_TIME,
            ),
            sought=False,
            blocks={"sensor": warming},
            state=(0.0,) * 4,
        ),
    ),
)
