"""Backlash: play between motor and probe, `gap` wide.

- `play`: rigid. While pushing, the probe follows the motor without offset (touch-off is made so); while pulled back it
  stays `gap` deeper. `start` says where in the play the data begin: 0 at the pushing side, 1 at the other.
- `centred`: the same, counted from the middle: gap/2 to either side of the motor.
- `gradual`: four plays of gap · (1 ± spread) side by side, so that the gap closes by and by (Prandtl and Ishlinskii's
  operator: M. Brokate, J. Sprekels, Hysteresis and Phase Transitions, Springer, 1996).
- `loaded`: the gap is closed by the force itself, within `closing_force`: a joint that is loose at rest and seated
  under load. Deflection gap · (1 − e^(−|F|/closing_force)) in the force's direction, solved with the pad.
- `running_out`: the width goes with the place, gap · (1 + swell · sin(2π x/turn + angle)): a gear, pulley or screw that
  runs out (ISO 230-2: the reversal value is stated for each place). `gap` is the mean; `side` is 0 where the surface
  was found pushing, and 0.5 in `centred`.
- `worn`: wider in one place, gap · (1 + wear · e^(−((x − at)/width)²)): a screw or guide worn where it is used most (J.
  F. Archard, Contact and rubbing of flat surfaces, J. Appl. Phys. 24, 1953, 981–988: wear goes with load and way).
  `gap` is the width where nothing is worn; `side` as in `running_out`.
- `wearing`: gap · (1 + growth (t − at_time)), as of screws that work loose under load that comes and goes (G. H.
  Junker, New criteria for self-loosening of fasteners under vibration, SAE Technical Paper 690055, 1969), or of a nut
  that warms.
- `closing`: what has opened closes again under the preload, within `time_constant`: a nut or joint full of grease, of
  which the film is pressed out (J. Stefan, Versuche über die scheinbare Adhäsion, Sitzungsber. Akad. Wiss. Wien 69,
  1874, 713–735: the thinner the film, the slower; near one thickness, as an exponential).
- `filled`: a film of oil that motion drags in fills a share of the play, gap · (1 − film · v/(v + v_0)) at speed v (O.
  Reynolds, On the theory of lubrication, Philos. Trans. R. Soc. Lond. 177, 1886, 157–234: what a film carries grows
  with its speed). `gap` is the width at rest.
- `lifted`: the probe's side is heavy and hangs in its nut: at a load that bears its weight, at the depth `lifts`, the
  motor goes through the play and nothing is pressed; friction in its guide makes that `rubs` deeper on the way in, and
  as much less deep on the way back (A. Tustin, The effects of backlash and of speed-dependent friction on the stability
  of closed-cycle control systems, J. IEE 94, 1947, 143–151: gravity takes up the play).
- `coasting`: what the motor pushes goes on by itself once that stops or turns, slowed down by dry friction at `slows`,
  until it meets the other flank (S. Dubowsky, F. Freudenstein, Dynamic analysis of mechanical systems with clearances,
  J. Eng. Ind. 93, 1971, 305–316).

Reference: M. Nordin, P.-O. Gutman, Controlling mechanical systems with backlash, a survey, Automatica 38, 2002,
1633–1649.
"""

from __future__ import annotations

import math

from sim.effects.base import Effect, Form, Parameter
from sim.effects.stamps import AT_TIME
from sim.effects.waves import phase
from sim.jit import State, block, compiled

_STARTED = 0


@block
def play(dt: float, x: float, state: State, p: State) -> float:
    """Probe side, from x (pushing) to x + gap; p = (gap, start)."""
    if state[_STARTED] == 0.0:
        state[_STARTED] = 1.0
        state[1] = x + p[0] * p[1]
    state[1] = min(max(state[1], x), x + p[0])
    return state[1]


@block
def centred(dt: float, x: float, state: State, p: State) -> float:
    """Probe side, from x − gap/2 (pushing) to x + gap/2; p = (gap, start)."""
    if state[_STARTED] == 0.0:
        state[_STARTED] = 1.0
        state[1] = x + p[0] * (p[1] - 0.5)
    state[1] = min(max(state[1], x - 0.5 * p[0]), x + 0.5 * p[0])
    return state[1]


@block
def gradual(dt: float, x: float, state: State, p: State) -> float:
    """Mean of four plays from x to x + gap (1 ± spread); p = (gap, spread, start)."""
    result = 0.0
    for i in range(4):
        gap = p[0] * (1.0 + p[1] * (i - 1.5) / 1.5)
        if state[_STARTED] == 0.0:
            state[1 + i] = x + gap * p[2]
        state[1 + i] = min(max(state[1 + i], x), x + gap)
        result += 0.25 * state[1 + i]
    state[_STARTED] = 1.0
    return result


@compiled("float64(float64, float64, float64, float64)")
def behind(x: float, gap: float, side: float, last: float) -> float:
    """Where a probe at `last` is once the motor is at x, of whose play a share `side` is ahead of it."""
    return min(max(last, x - side * gap), x + (1.0 - side) * gap)


@block
def running_out(dt: float, x: float, state: State, p: State) -> float:
    """Probe side, about x by the gap there; p = (gap, swell, turn, angle, side, start)."""
    gap = p[0] * (1.0 + p[1] * math.sin(2.0 * math.pi * x / p[2] + p[3]))
    if state[_STARTED] == 0.0:
        state[_STARTED] = 1.0
        state[1] = x + gap * (p[5] - p[4])
    state[1] = behind(x, gap, p[4], state[1])
    return state[1]


@block
def worn(dt: float, x: float, state: State, p: State) -> float:
    """Probe side, about x by the gap there; p = (gap, wear, worn_at, width, side)."""
    off = (x - p[2]) / p[3]
    gap = p[0] * (1.0 + p[1] * math.exp(-off * off))
    if state[_STARTED] == 0.0:
        state[_STARTED] = 1.0
        state[1] = x
    state[1] = behind(x, gap, p[4], state[1])
    return state[1]


@block
def closing(dt: float, x: float, state: State, p: State) -> float:
    """Probe side, from x to x + gap, and back to x by and by; p = (gap, time_constant). State: started, x, what is
    open."""
    if state[_STARTED] == 0.0:
        state[_STARTED] = 1.0
        state[1] = x
    opened = state[2] * math.exp(-dt / p[1]) - (x - state[1])
    state[1] = x
    state[2] = min(max(opened, 0.0), p[0])
    return x + state[2]


@block
def wearing(dt: float, x: float, state: State, p: State) -> float:
    """Probe side, about x by what is open by then; p = (gap, growth, side, at_time). State: started, probe, time."""
    state[2] += dt
    gap = p[0] * max(1.0 + p[1] * (state[2] - p[3]), 0.0)
    if state[_STARTED] == 0.0:
        state[_STARTED] = 1.0
        state[1] = x
    state[1] = behind(x, gap, p[2], state[1])
    return state[1]


@block
def filled(dt: float, x: float, state: State, p: State) -> float:
    """Probe side, from x to x + what is open; p = (gap, film, speed). State: started, probe, x, speed."""
    if state[_STARTED] == 0.0:
        state[_STARTED] = 1.0
        state[1] = x
    elif dt > 0.0:
        state[3] = abs(x - state[2]) / dt
    state[2] = x
    gap = p[0] * (1.0 - p[1] * state[3] / (state[3] + p[2]))
    state[1] = min(max(state[1], x), x + gap)
    return state[1]


@block
def coasting(dt: float, x: float, state: State, p: State) -> float:
    """Probe side, from x to x + gap, pushed and then on by itself; p = (gap, slows). State: …, probe, x, speed."""
    if state[_STARTED] == 0.0:
        state[_STARTED] = 1.0
        state[1] = state[2] = x
    elif dt > 0.0:
        left = max(abs(state[3]) - p[1] * dt, 0.0)
        state[1] += 0.5 * dt * (math.copysign(left, state[3]) + state[3]) if left > 0.0 else 0.0
        state[3] = math.copysign(left, state[3])
    if state[1] <= x or state[1] >= x + p[0]:
        state[1] = min(max(state[1], x), x + p[0])
        state[3] = (x - state[2]) / dt if dt > 0.0 else 0.0
    state[2] = x
    return state[1]


@block
def lifted(dt: float, x: float, state: State, p: State) -> float:
    """Probe side, from x − gap (borne) to x (hanging); p = (gap, lifts, rubs)."""
    if state[_STARTED] == 0.0:
        state[_STARTED] = 1.0
        state[1] = x
    state[1] = min(max(state[1], p[1] - p[2]), p[1] + p[2])  # where it slides in its guide
    state[1] = min(max(state[1], x - p[0]), x)
    return state[1]


@block
def loaded(dt: float, force: float, state: State, p: State) -> float:
    """Deflection of a joint that force closes; p = (gap, closing_force)."""
    closed = -math.expm1(-abs(force) / p[1])
    return p[0] * closed if force >= 0.0 else -p[0] * closed


_GAP = Parameter(
    "gap",
    "mm",
    0.0,
    5.0,
    0.03,
    "full width of the play",
    required=True,
    amplitude=True,
    floor=("position_noise_mm", 2.0),
    starts=(0.01, 0.05),
)
_SIDE = Parameter(
    "side", "1", 0.0, 1.0, 0.0, "where in the play the motor's own position lies (0: pushing side)", starts=(0.0, 0.5)
)
_START = Parameter("start", "1", 0.0, 1.0, 0.0, "where in the play the data begin (0: pushing side)", fixed=True)

EFFECT = Effect(
    id="backlash",
    what="Play between motor and probe: the probe stays behind at each reversal.",
    says="there is {gap:.3g} mm of play between motor and probe",
    check="tighten couplings, thread and probe holder; preload the play away with a spring",
    reference="Nordin, Gutman, Automatica 38, 2002, 1633-1649",
    forms=(
        Form(
            name="play",
            what="rigid stops; no offset while pushing",
            parameters=(_GAP, _START),
            blocks={"play": play},
            state=(0.0, 0.0),
        ),
        Form(
            name="centred",
            what="rigid stops; half the gap to either side",
            parameters=(_GAP, _START),
            blocks={"play": centred},
            state=(0.0, 0.0),
        ),
        Form(
            name="gradual",
            what="the gap closes by and by",
            parameters=(
                _GAP,
                Parameter("spread", "1", 0.0, 1.0, 0.6, "how much the gaps of its parts differ", starts=(0.3, 0.8)),
                _START,
            ),
            blocks={"play": gradual},
            state=(0.0,) * 5,
        ),
        Form(
            name="running_out",
            what="wider here than there",
            parameters=(
                _GAP,
                Parameter("swell", "1", 0.0, 1.0, 0.3, "how much wider, over the mean", starts=(0.3,)),
                Parameter("turn", "mm", 0.1, 50.0, 1.0, "distance after which it is as wide", starts=(0.6, 1.1, 2.5)),
                phase("angle", "phase of the width at position 0"),
                _SIDE,
                _START,
            ),
            sought=False,
            blocks={"play": running_out},
            state=(0.0, 0.0),
        ),
        Form(
            name="worn",
            what="wider in one place",
            parameters=(
                _GAP,
                Parameter("wear", "1", 0.0, 20.0, 1.0, "how much wider there, over the gap elsewhere", starts=(1.0,)),
                Parameter("worn_at", "mm", -50.0, 50.0, 1.0, "where it is worn most", bend=True),
                Parameter("width", "mm", 0.02, 20.0, 0.3, "how far from it 1/e of that is left", starts=(0.15, 0.5)),
                _SIDE,
            ),
            sought=False,
            blocks={"play": worn},
            state=(0.0, 0.0),
        ),
        Form(
            name="wearing",
            what="rigid stops that part as time goes by, or come together",
            parameters=(
                _GAP,
                Parameter("growth", "1/s", -0.2, 0.2, 0.0, "relative growth in time", starts=(-0.01, 0.01)),
                _SIDE,
                AT_TIME,
            ),
            sought=False,
            blocks={"play": wearing},
            state=(0.0, 0.0, 0.0),
        ),
        Form(
            name="closing",
            what="what has opened closes by itself, as a film of grease is pressed out",
            parameters=(
                _GAP,
                Parameter("time_constant", "s", 0.01, 100.0, 1.0, "in which it closes to 1/e", starts=(0.3, 1.5)),
            ),
            blocks={"play": closing},
            state=(0.0,) * 3,
        ),
        Form(
            name="filled",
            what="narrower the faster it goes, as a film of oil fills it",
            parameters=(
                _GAP,
                Parameter("film", "1", 0.0, 0.9, 0.3, "share that the film fills at high speed", starts=(0.3,)),
                Parameter("speed", "mm/s", 0.1, 1e3, 10.0, "at which it fills half of that", starts=(3.0, 20.0)),
            ),
            sought=False,
            blocks={"play": filled},
            state=(0.0,) * 4,
        ),
        Form(
            name="coasting",
            what="the probe's side goes on by itself where the motor stops",
            parameters=(
                _GAP,
                Parameter("slows", "mm/s²", 10.0, 1e4, 400.0, "by which friction slows it down", starts=(100.0, 500.0)),
            ),
            blocks={"play": coasting},
            state=(0.0,) * 4,
        ),
        Form(
            name="lifted",
            what="the load lifts what hangs in the play",
            parameters=(
                _GAP,
                Parameter("lifts", "mm", 0.0, 50.0, 0.6, "depth at which the load bears its weight", bend=True),
                Parameter("rubs", "mm", 0.0, 5.0, 0.05, "how much deeper on the way in, less deep on the way back"),
            ),
            blocks={"play": lifted},
            state=(0.0, 0.0),
        ),
        Form(
            name="loaded",
            what="the force itself closes the gap",
            parameters=(
                _GAP,
                Parameter(
                    "closing_force",
                    "N",
                    1e-3,
                    100.0,
                    0.2,
                    "force at which 1/e of the gap is left",
                    starts=(0.1, 1.0),
                    floor=("force_noise_N", 3.0),  # closed by less, it is another surface
                ),
            ),
            sought=False,
            blocks={"frame": loaded},
        ),
    ),
)
