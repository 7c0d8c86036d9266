"""Inertia: the cell accelerates the mass beyond it, and feels the force that takes.

- `rigid`: mass · acceleration of the probe. The acceleration is the second divided difference of the positions: exact
  where it is constant, as in planned moves, and late by some half a window where it changes smoothly. `lead` carries it
  on by that share of its own change since the one before: half makes up for most of the lateness, a whole one
  overshoots. Earlier positions are taken at least seven tenths of `window` apart: noise of position grows with
  1/window², and stamps of two interleaved clocks come close together.
- `damped`: mass · (acceleration + damping_rate · speed), a mass in oil or with a cable dragging.
- `growing`: a mass m that goes with the place, as of a cable chain that lays itself down: m a + m' v²/2, which is the
  momentum's rate and what Lagrange's equation gives. `mass` is that at `at_depth`.
- `sprung`: the mass sits on a spring and damper of its own: natural frequency and damping ratio. A cell behind them
  reads the force of both; one that is itself the spring reads its deflection alone (`damping_felt` 0). Exact for an
  acceleration that is constant over some steps, at any spacing: the mean speed of a step is that at its middle, from
  which the acceleration is carried on to its end. A step many times as long as the one beside it moves at its mean
  speed but for a short time next to that one.
- `hung`: a share of the mass is sprung, the rest rigid: a cable or hose on a carriage.
- `recoiling`: the bench gives way under the mass and swings at a few hertz: the mass feels the acceleration less a
  share of s²/(s² + 2 ζ ω s + ω²) of it, which is as if that share hung, damper and all (E. I. Rivin, Passive Vibration
  Isolation, ASME Press, 2003).
- `oiled`: a share of the mass is dragged along by oil and comes late by a first order, as a ring that turns in its
  housing (J. P. Den Hartog, Mechanical Vibrations, 4th ed., McGraw-Hill, 1956, section 3.3: Lanchester's damper). It is
  hung from a damper, by a spring that is next to none.
- `compensated`: an accelerometer takes `corrects` of it off, late by a first order: what is left of a slow move
  is `mass`, and of a quick one at first mass/(1 − corrects) (Doebelin, chapter 5, on acceleration compensation).

`mass` in kg, positions in mm: the force is mass/1000 · mm/s².

Reference: L. Meirovitch, Fundamentals of Vibrations, McGraw-Hill, 2001 (rigid and sprung mass under base motion); E. O.
Doebelin, Measurement Systems, 4th ed., McGraw-Hill, 1990, chapter 4 (a mass on a spring whose deflection is read).
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from sim.effects.base import Effect, Form, Parameter
from sim.effects.linear import swing
from sim.jit import State, block, compiled

_STARTED = 0
_AGES = 1
_PLACES = 5
_KNOTS = 4
_HUNG = 9  # y, speed of the step and its length, then as of `ridden`
_LONGER = 2.0  # times the step beside it: for so long at the most a speed changes
_APART = 0.7
_KG_MM = 1e-3
"""N per kg mm/s²."""


@compiled("UniTuple(float64, 5)(float64, float64, float64, float64, float64, float64, float64, float64)")
def ridden(
    dt: float, dt_before: float, change: float, since: float, e: float, de: float, omega: float, damping: float
) -> tuple[float, float, float, float, float]:
    """Deflection of a spring under what rides on it, over a step that is faster by `change` (mm/s) than the one before.

    `e`, `de`: deflection and its speed, `since` before the step begins. Returns the same for the next step (since, e,
    de), and e and de at this one's end.
    """
    earlier = min(0.5 * dt_before, _LONGER * dt)
    later = 0.5 * dt if dt_before <= 0.0 else min(0.5 * dt, _LONGER * dt_before)
    e, de = swing(since - earlier, e, de, omega, damping)
    rest = -change / ((earlier + later) * omega * omega)  # deflection under the acceleration
    e, de = swing(earlier + later, e - rest, de, omega, damping)
    e += rest
    if later < 0.5 * dt:  # the speed has changed, and stays
        rest = 0.0
    e_now, de_now = swing(dt - later, e - rest, de, omega, damping)
    return dt - later, e, de, rest + e_now, de_now


@block
def rigid(dt: float, y: float, state: State, p: State) -> float:
    """Force on the mass in N; p = (mass, damping_rate, window, lead, growth, at_depth, hung, frequency, damping_ratio,
    damping_felt).

    State: the last four knots, newest first: time since each, and position there; then that of the part that is hung.
    """
    hanging = 0.0
    if p[6] != 0.0:
        if state[_STARTED] == 0.0:
            state[_HUNG] = y
        omega = 2.0 * math.pi * p[7]
        if dt > 0.0:
            step_speed = (y - state[_HUNG]) / dt
            change = step_speed - state[_HUNG + 1]
            since, e, de, e_now, de_now = ridden(
                dt, state[_HUNG + 2], change, state[_HUNG + 3], state[_HUNG + 4], state[_HUNG + 5], omega, p[8]
            )
            state[_HUNG] = y
            state[_HUNG + 1] = step_speed
            state[_HUNG + 2] = dt
            state[_HUNG + 3] = since
            state[_HUNG + 4] = e
            state[_HUNG + 5] = de
            state[_HUNG + 6] = e_now
            state[_HUNG + 7] = de_now
        hanging = -p[6] * (omega * omega * state[_HUNG + 6] + 2.0 * p[9] * p[8] * omega * state[_HUNG + 7])
    if state[_STARTED] == 0.0:
        state[_STARTED] = 1.0
        for i in range(_KNOTS):  # at rest before the data
            state[_AGES + i] = i * p[2]
            state[_PLACES + i] = y
    for i in range(_KNOTS):
        state[_AGES + i] += dt
    first = 0 if state[_AGES] >= _APART * p[2] else 1
    p1, p2, p3 = state[_AGES + first], state[_AGES + first + 1], state[_AGES + first + 2]
    y1, y2, y3 = state[_PLACES + first], state[_PLACES + first + 1], state[_PLACES + first + 2]
    speed = (y - y1) / p1
    before = (y1 - y2) / (p2 - p1)
    earlier = (y2 - y3) / (p3 - p2)
    newer = 2.0 * (speed - before) / p2  # a third of p1 + p2 ago
    older = 2.0 * (before - earlier) / (p3 - p1)  # p3/3 earlier still
    acceleration = newer + p[3] * (newer - older) * min((p1 + p2) / p3, 1.5)
    if state[_AGES] >= 0.999999 * p[2]:
        for i in range(_KNOTS - 1, 0, -1):
            state[_AGES + i] = state[_AGES + i - 1]
            state[_PLACES + i] = state[_PLACES + i - 1]
        state[_AGES] = 0.0
        state[_PLACES] = y
    now = speed + 0.5 * p1 * newer
    here = max(1.0 + p[4] * (y - p[5]), 0.0)
    felt = (1.0 - p[6]) * (here * acceleration + 0.5 * p[4] * now * now)
    return _KG_MM * p[0] * (felt + hanging + p[1] * now)


_MASS = Parameter("mass", "kg", 0.0, 500.0, 0.1, "mass beyond the cell", required=True, amplitude=True)
_LEAD = Parameter(
    "lead", "1", 0.0, 0.6, 0.5, "share of its change that an acceleration is carried on by", starts=(0.0, 0.5)
)
_WINDOW = Parameter(
    "window", "s", 1e-5, 0.02, 0.002, "least time over which acceleration is taken", starts=(2e-5, 2e-4, 1e-3, 3e-3)
)
_FREQUENCY = Parameter("frequency", "Hz", 1.0, 2000.0, 80.0, "natural frequency", starts=(20.0, 50.0, 120.0, 300.0))
_DAMPING = Parameter("damping_ratio", "1", 1e-3, 0.95, 0.3, "damping over critical damping", starts=(0.05, 0.5))


_FELT = Parameter("damping_felt", "1", 0.0, 1.0, 1.0, "share of the damper's force that the cell reads", starts=(0.5,))


def _packed(values: Mapping[str, float]) -> tuple[float, ...]:
    names = ("damping_rate", "window", "lead", "growth", "at_depth", "share")
    given = (values.get(name, 0.0) for name in names)
    return (
        values["mass"],
        *given,
        values.get("frequency", 1.0),
        values.get("damping_ratio", 0.5),
        values.get("damping_felt", 1.0),
    )


def _all_hung(values: Mapping[str, float]) -> tuple[float, ...]:
    # the window is of the rigid part, of which nothing is left
    return _packed({"share": 1.0, "window": 1e-3, **values})


_LOOSE_HZ = 0.05
"""Natural frequency of what hangs from a damper alone."""


def _oiled(values: Mapping[str, float]) -> tuple[float, ...]:
    # (2ζω s + ω²)/(s² + 2ζω s + ω²) is 1/(1 + τs) where 2ζω = 1/τ and ω is small
    ratio = 0.5 / (2.0 * math.pi * _LOOSE_HZ * values["time_constant"])
    return _packed({**values, "frequency": _LOOSE_HZ, "damping_ratio": ratio})


def _compensated(values: Mapping[str, float]) -> tuple[float, ...]:
    # m/(1 − c) (a − c a_late) is a share of −c/(1 − c) of m that comes late
    corrects = values["corrects"]
    return _oiled({**values, "share": -corrects / (1.0 - corrects)})


EFFECT = Effect(
    id="inertia",
    what="The cell feels the force that accelerates the mass beyond it.",
    says="a mass of {mass:milli} g beyond the cell is felt when the probe accelerates",
    check="run the same moves in free air; weigh probe and adapter; lower the acceleration",
    reference="Meirovitch, Fundamentals of Vibrations, 2001",
    forms=(
        Form(
            name="rigid",
            what="mass times acceleration",
            parameters=(_MASS, _WINDOW, _LEAD),
            blocks={"probe": rigid},
            state=(0.0,) * 17,
            pack=_packed,
        ),
        Form(
            name="damped",
            what="mass times acceleration, and drag in proportion to speed",
            parameters=(
                _MASS,
                Parameter("damping_rate", "1/s", 0.0, 1e4, 10.0, "drag over mass and speed", starts=(5.0, 50.0)),
                _WINDOW,
                _LEAD,
            ),
            blocks={"probe": rigid},
            state=(0.0,) * 17,
            pack=_packed,
        ),
        Form(
            name="sprung",
            what="the mass swings on a spring of its own",
            parameters=(_MASS, _FREQUENCY, _DAMPING, _FELT),
            blocks={"probe": rigid},
            state=(0.0,) * 17,
            pack=_all_hung,
        ),
        Form(
            name="growing",
            what="the mass that moves changes along the way, as of a cable chain",
            parameters=(
                _MASS,
                Parameter("growth", "1/mm", -5.0, 5.0, 0.0, "relative growth of the mass per mm", starts=(-0.2, 0.2)),
                Parameter("at_depth", "mm", 1e-3, 100.0, 1.0, "depth at which the mass holds", fixed=True),
                _WINDOW,
                _LEAD,
            ),
            sought=False,
            blocks={"probe": rigid},
            state=(0.0,) * 17,
            pack=_packed,
        ),
        Form(
            name="hung",
            what="a part of the mass swings on a spring of its own, as a cable or hose",
            parameters=(
                _MASS,
                Parameter("share", "1", 0.0, 1.0, 0.4, "share of the mass that swings"),
                _FREQUENCY,
                _DAMPING,
                _FELT,
                _WINDOW,
                _LEAD,
            ),
            sought=False,
            blocks={"probe": rigid},
            state=(0.0,) * 17,
            pack=_packed,
        ),
        Form(
            name="recoiling",
            what="the bench gives way under the mass, and swings",
            parameters=(
                _MASS,
                Parameter("share", "1", 0.0, 1.0, 0.15, "how much of the motion the bench takes up at once"),
                Parameter("frequency", "Hz", 1.0, 60.0, 9.0, "natural frequency of the bench", starts=(4.0, 8.0, 14.0)),
                Parameter("damping_ratio", "1", 1e-3, 0.95, 0.12, "damping over critical damping", starts=(0.05, 0.2)),
                _WINDOW,
                _LEAD,
            ),
            sought=False,
            blocks={"probe": rigid},
            state=(0.0,) * 17,
            pack=_packed,
        ),
        Form(
            name="oiled",
            what="a part of the mass is dragged along in oil, and comes late",
            parameters=(
                _MASS,
                Parameter("share", "1", 0.0, 1.0, 0.35, "share of the mass that comes late"),
                Parameter("time_constant", "s", 1e-3, 0.5, 0.02, "how late it comes", starts=(0.01, 0.03, 0.1)),
                _WINDOW,
                _LEAD,
            ),
            sought=False,
            blocks={"probe": rigid},
            state=(0.0,) * 17,
            pack=_oiled,
        ),
        Form(
            name="compensated",
            what="as far as an accelerometer's signal has not taken it off in time",
            parameters=(
                _MASS,
                Parameter("corrects", "1", 0.0, 0.95, 0.5, "share of the mass that is taken off, late"),
                Parameter("time_constant", "s", 2e-4, 0.1, 0.004, "how late", starts=(0.002, 0.008)),
                _WINDOW,
                _LEAD,
            ),
            sought=False,
            blocks={"probe": rigid},
            state=(0.0,) * 17,
            pack=_compensated,
        ),
    ),
)
