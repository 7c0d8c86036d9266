"""Force drift: the zero of the force wanders with time, from the first sample on.

From warming up, from creep of the cell's own spring and glue, from a cable that settles. `rate` is the rate at the
first sample in all forms.

- `linear`: rate · t.
- `settling`: rate · τ (1 − e^(−t/τ)), one thermal time constant.
- `root`: rate · 2τ (√(1 + t/τ) − 1), as heat that diffuses in.
- `logarithmic`: rate · τ ln(1 + t/τ), as creep of glue and gauge.
- `hyperbolic`: rate · t/(1 + t/τ), as recovery by many processes of which each is slower than the last.
- `turning`: rate · (2τ/π) sin(πt/2τ), as a room that warms and cools: it turns at τ.
- `bent`: rate · t until a time, and a share of that rate from there on, as where a door is opened or a heater goes off.
- `two_bodies`: a share of it settles within τ, the rest within `later` times as long: gauge and body of a cell.
- `quickening`: rate · t (1 + t/2τ), as a supply that ends: twice as quick at τ.
- `wandering`: rate · (t + Σ c_k (sin(kπ t/T) T/kπ − t)), k from 1 to 12, over the length T of the data: the rate itself
  swings by half waves, as where a heater goes on and off, or a zero walks. `at_time` is their middle, T/2.
- `rezeroed`: rate · (t mod `every`), as where a device finds its zero anew at even distances (OIML R 76-1,
  Non-automatic weighing instruments: devices that set zero by themselves).

Reference: OIML R 60, Metrological regulation for load cells (creep, and temperature effect on the dead load output).
"""

from __future__ import annotations

import math

from sim.effects.base import Effect, Form, Parameter
from sim.effects.stamps import HALF_TIME, WAVES, half_waves
from sim.jit import State, block


@block
def linear(dt: float, force: float, state: State, p: State) -> float:
    """State: time since the first sample; p = (rate,)."""
    state[0] += dt
    return force + p[0] * state[0]


@block
def settling(dt: float, force: float, state: State, p: State) -> float:
    """Exponential to a limit; p = (rate, time_constant)."""
    state[0] += dt
    return force - p[0] * p[1] * math.expm1(-state[0] / p[1])


@block
def root(dt: float, force: float, state: State, p: State) -> float:
    """Root of time in the end; p = (rate, time_constant)."""
    state[0] += dt
    return force + p[0] * 2.0 * p[1] * (math.sqrt(1.0 + state[0] / p[1]) - 1.0)


@block
def logarithmic(dt: float, force: float, state: State, p: State) -> float:
    """Logarithm of time in the end; p = (rate, time_constant)."""
    state[0] += dt
    return force + p[0] * p[1] * math.log1p(state[0] / p[1])


@block
def hyperbolic(dt: float, force: float, state: State, p: State) -> float:
    """To a limit, slowly; p = (rate, time_constant)."""
    state[0] += dt
    return force + p[0] * state[0] / (1.0 + state[0] / p[1])


@block
def two_bodies(dt: float, force: float, state: State, p: State) -> float:
    """Two exponentials; p = (rate, time_constant, share, later)."""
    state[0] += dt
    slow = p[1] * p[3]
    soon, late = p[1] * math.expm1(-state[0] / p[1]), slow * math.expm1(-state[0] / slow)
    return force - p[0] * (p[2] * soon + (1.0 - p[2]) * late)


@block
def rezeroed(dt: float, force: float, state: State, p: State) -> float:
    """Saw tooth of time; p = (rate, every)."""
    state[0] += dt
    return force + p[0] * (state[0] % p[1])


@block
def turning(dt: float, force: float, state: State, p: State) -> float:
    """Sine of time; p = (rate, time_constant)."""
    state[0] += dt
    slow = 0.5 * math.pi / p[1]
    return force + p[0] / slow * math.sin(slow * state[0])


@block
def wandering(dt: float, force: float, state: State, p: State) -> float:
    """Half waves of the rate; p = (rate, wave_1 to wave_12, at_time)."""
    state[0] += dt
    slow = 0.5 * math.pi / max(p[WAVES + 1], 1e-9)
    way = state[0]
    for k in range(1, WAVES + 1):
        way += p[k] * (math.sin(k * slow * state[0]) / (k * slow) - state[0])
    return force + p[0] * way


@block
def quickening(dt: float, force: float, state: State, p: State) -> float:
    """Quicker and quicker; p = (rate, time_constant)."""
    state[0] += dt
    return force + p[0] * state[0] * (1.0 + 0.5 * state[0] / p[1])


@block
def bent(dt: float, force: float, state: State, p: State) -> float:
    """Steady, and steady otherwise from a time on; p = (rate, share, bends_at)."""
    state[0] += dt
    return force + p[0] * (min(state[0], p[2]) + p[1] * max(state[0] - p[2], 0.0))


_RATE = Parameter("rate", "N/s", -1e4, 1e4, 0.002, "rate at the first sample", required=True, amplitude=True)


def _time_constant(what: str, starts: tuple[float, ...] = (3.0, 20.0, 120.0)) -> Parameter:
    return Parameter("time_constant", "s", 1.0, 1e5, 30.0, what, starts=starts)


_QUARTERS = (1.5, 2.1, 3.0, 4.2, 6.0, 8.5, 12.0, 17.0, 24.0, 34.0, 48.0, 96.0)
"""Quarters of a swing, s, near enough to each other that one is in step with any over two or three swings."""

EFFECT = Effect(
    id="force_drift",
    what="The zero of the force wanders with time.",
    says="the force {rate:rises/falls} by {rate:milli} mN per second at the start",
    check="let the cell warm up, and keep some free air before and after the run",
    reference="OIML R 60, Metrological regulation for load cells",
    forms=(
        Form(name="linear", what="steady", parameters=(_RATE,), blocks={"sensor": linear}, state=(0.0,)),
        Form(
            name="settling",
            what="exponentially to a limit",
            parameters=(_RATE, _time_constant("time in which the rate falls to 1/e")),
            blocks={"sensor": settling},
            state=(0.0,),
        ),
        Form(
            name="root",
            what="with the root of time in the end",
            parameters=(_RATE, _time_constant("time from which the rate falls")),
            blocks={"sensor": root},
            state=(0.0,),
        ),
        Form(
            name="logarithmic",
            what="with the logarithm of time in the end",
            parameters=(_RATE, _time_constant("time from which the rate falls")),
            blocks={"sensor": logarithmic},
            state=(0.0,),
        ),
        Form(
            name="hyperbolic",
            what="to a limit that it is long in reaching",
            parameters=(_RATE, _time_constant("time in which it is half way")),
            sought=False,
            blocks={"sensor": hyperbolic},
            state=(0.0,),
        ),
        Form(
            name="two_bodies",
            what="to a limit, one part soon and one late",
            parameters=(
                _RATE,
                _time_constant("time in which the part that is soon settles"),
                Parameter("share", "1", 0.0, 1.0, 0.5, "share of the rate that settles soon", starts=(0.5,)),
                Parameter("later", "1", 2.0, 100.0, 10.0, "how many times as long the rest takes", starts=(10.0,)),
            ),
            sought=False,
            blocks={"sensor": two_bodies},
            state=(0.0,),
        ),
        Form(
            name="turning",
            what="turns back, as the warmth of a room",
            parameters=(_RATE, _time_constant("time after which it turns", _QUARTERS)),
            blocks={"sensor": turning},
            state=(0.0,),
        ),
        Form(
            name="quickening",
            what="quicker and quicker, as a supply that ends",
            parameters=(_RATE, _time_constant("time after which it is twice as quick")),
            sought=False,
            blocks={"sensor": quickening},
            state=(0.0,),
        ),
        Form(
            name="wandering",
            what="now quicker and now slower, and back",
            parameters=(_RATE, *half_waves(1.0, "over the data, of the rate's fall, over `rate`"), HALF_TIME),
            sought=False,
            blocks={"sensor": wandering},
            state=(0.0,),
        ),
        Form(
            name="rezeroed",
            what="back to zero at even distances",
            parameters=(_RATE, Parameter("every", "s", 0.01, 1e6, 20.0, "time after which it is back to zero")),
            blocks={"sensor": rezeroed},
            state=(0.0,),
        ),
        Form(
            name="bent",
            what="steady, and at another rate from a time on",
            parameters=(
                _RATE,
                Parameter("share", "1", -3.0, 3.0, 0.3, "rate after it over the rate before"),
                Parameter("bends_at", "s", 0.0, 1e6, 30.0, "time at which it changes, from the first sample on"),
            ),
            sought=False,
            blocks={"sensor": bent},
            state=(0.0,),
        ),
    ),
)
