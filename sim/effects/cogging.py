"""Cogging: a force periodic in position, as the magnets of a linear motor pull on its iron; felt by the cell.

- `sine`: amplitude · sin(2π y/period + phase).
- `tared`: the sine less its value at the first sample, where the force was taken for zero.
- `harmonics`: with a second harmonic, ratio · amplitude.
- `unbalanced`: a sine at any load, and its second harmonic that goes with the load, amplitude · (sin(θ + phase)
  + ratio (y/at_depth)^exponent sin(2θ + second_phase)): the motor's current sensors have an offset, and gains that
  differ (S. Chen, C. Namuduri, S. Mir, Controller-induced parasitic torque ripples in a PM synchronous motor, IEEE
  Trans. Ind. Appl. 38, 2002, 1273–1281).
- `swelling`: the sine grows along the way, as towards the end of the magnets: amplitude · (1 + growth (y − at_depth)).
- `driven`: the sine grows with the force of the pad, which the motor bears: amplitude · (1 + growth (|F|/at_load − 1)),
  the ripple of the thrust beside that of the magnets (N. Bianchi, S. Bolognani, A. D. F. Cappello, Reduction of cogging
  force in PM linear motors by pole-shifting, IEE Proc. Electr. Power Appl. 152, 2005, 703–709).
- `uneven`: as `swelling`, of the sine with its second and third harmonic: edges of slots, in a row that ends.
- `trailing`: the sine of a place that is dragged along, as iron's field is behind the magnets': the middle of a play of
  the full width `trail`.
- `slotted`: tanh(steepness · sin) over its own first harmonic, of that amplitude: flat over teeth and slots, steep at
  their edges.
- `two_periods`: with a second sine of `order` waves for each of the first, which need not be whole: slots that are no
  multiple of the poles, and magnets that are not alike (J. R. Hendershot, T. J. E. Miller, Design of Brushless
  Permanent-Magnet Machines, 2nd ed., Motor Design Books, 2010).
- `edged`: Σ r^(n−1) sin n θ, all harmonics, as of edges that are rounded over some of the period: sin θ over
  1 − 2 r cos θ + r²; `amplitude` is that of the first.
- `warming`: the sine fades or grows in time, as magnets weaken with warmth: amplitude · (1 + growth (t − at_time)).
- `weakening`: magnets lose strength with the load they have borne, for good: amplitude · (1 + lost (1 − m/reach)), m
  the deepest point so far (S. Ruoho, E. Dlala, A. Arkkio, Comparison of demagnetization models for finite-element
  analysis of permanent-magnet synchronous machines, IEEE Trans. Magn. 43, 2007, 3964–3968).
- `creeping`: phase + creep · ∫|dy|, all the way there has been since the first sample, to and fro: a belt that creeps
  on its pulley (J. N. Fawcett, Chain and belt drives: a review, Shock Vib. Digest 13(5), 1981, 5–12).

Reference: J. F. Gieras, Z. J. Piech, B. Z. Tomczuk, Linear Synchronous Motors: Transportation and Automation Systems,
2nd ed., CRC Press, 2012 (cogging and detent force).
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from sim.effects.base import Effect, Form, Parameter
from sim.effects.stamps import AT_TIME
from sim.effects.waves import GROWTH, PHASE, SECOND_HARMONIC, SECOND_PERIOD, phase
from sim.jit import State, block


@block
def sine(dt: float, y: float, state: State, p: State) -> float:
    """Force in N; p = (amplitude, period, phase)."""
    return p[0] * math.sin(2.0 * math.pi * y / p[1] + p[2])


@block
def tared(dt: float, y: float, state: State, p: State) -> float:
    """Force in N; p = (amplitude, period, phase); state: started, the place of the tare."""
    if state[0] == 0.0:
        state[0] = 1.0
        state[1] = y
    wave = 2.0 * math.pi / p[1]
    return p[0] * (math.sin(wave * y + p[2]) - math.sin(wave * state[1] + p[2]))


@block
def unbalanced(dt: float, y: float, state: State, p: State) -> float:
    """Force in N; p = (amplitude, period, phase, ratio, second_phase, exponent, at_depth)."""
    angle = 2.0 * math.pi * y / p[1]
    load = (y / p[6]) ** p[5] if y > 0.0 else 0.0
    return p[0] * (math.sin(angle + p[2]) + p[3] * load * math.sin(2.0 * angle + p[4]))


@block
def swelling(dt: float, y: float, state: State, p: State) -> float:
    """Force in N; p = (amplitude, period, phase, growth, at_depth)."""
    return p[0] * (1.0 + p[3] * (y - p[4])) * math.sin(2.0 * math.pi * y / p[1] + p[2])


@block
def note_load(dt: float, force: float, state: State, p: State) -> float:
    """Adds nothing to the pad's force, and notes it."""
    state[0] = abs(force)
    return 0.0


@block
def driven(dt: float, y: float, state: State, p: State) -> float:
    """Force in N; p = (amplitude, period, phase, growth, at_load); state: the pad's force."""
    return p[0] * (1.0 + p[3] * (state[0] / p[4] - 1.0)) * math.sin(2.0 * math.pi * y / p[1] + p[2])


@block
def uneven(dt: float, y: float, state: State, p: State) -> float:
    """Force in N; p = (amplitude, period, phase, ratio, second_phase, third_ratio, third_phase, growth, at_depth)."""
    angle = 2.0 * math.pi * y / p[1]
    wave = math.sin(angle + p[2]) + p[3] * math.sin(2.0 * angle + p[4]) + p[5] * math.sin(3.0 * angle + p[6])
    return p[0] * (1.0 + p[7] * (y - p[8])) * wave


@block
def trailing(dt: float, y: float, state: State, p: State) -> float:
    """Force in N; p = (amplitude, period, phase, trail); state: started, place dragged along."""
    if state[0] == 0.0:
        state[0] = 1.0
        state[1] = y
    state[1] = min(max(state[1], y - 0.5 * p[3]), y + 0.5 * p[3])
    return p[0] * math.sin(2.0 * math.pi * state[1] / p[1] + p[2])


@block
def slotted(dt: float, y: float, state: State, p: State) -> float:
    """Force in N; p = (amplitude over the first harmonic of the wave, period, phase, steepness)."""
    return p[0] * math.tanh(p[3] * math.sin(2.0 * math.pi * y / p[1] + p[2]))


@block
def weakening(dt: float, y: float, state: State, p: State) -> float:
    """Force in N; p = (amplitude, period, phase, lost, reach); state: the deepest point so far."""
    state[0] = min(max(state[0], y), p[4])
    size = 1.0 + p[3] * (1.0 - state[0] / p[4])
    return p[0] * size * math.sin(2.0 * math.pi * y / p[1] + p[2])


@block
def two_periods(dt: float, y: float, state: State, p: State) -> float:
    """Force in N; p = (amplitude, period, phase, ratio, order, second_phase)."""
    angle = 2.0 * math.pi * y / p[1]
    return p[0] * (math.sin(angle + p[2]) + p[3] * math.sin(p[4] * angle + p[5]))


@block
def edged(dt: float, y: float, state: State, p: State) -> float:
    """Force in N; p = (amplitude, period, phase, sharpness)."""
    angle = 2.0 * math.pi * y / p[1] + p[2]
    return p[0] * math.sin(angle) / (1.0 - 2.0 * p[3] * math.cos(angle) + p[3] * p[3])


@block
def warming(dt: float, y: float, state: State, p: State) -> float:
    """Force in N; p = (amplitude, period, phase, growth, at_time); state: time since the first sample."""
    state[0] += dt
    size = max(1.0 + p[3] * (state[0] - p[4]), 0.0)
    return p[0] * size * math.sin(2.0 * math.pi * y / p[1] + p[2])


@block
def creeping(dt: float, y: float, state: State, p: State) -> float:
    """Force in N; p = (amplitude, period, phase, creep); state: started, place before, way."""
    if state[0] == 0.0:
        state[0] = 1.0
        state[1] = y
    state[2] += abs(y - state[1])
    state[1] = y
    return p[0] * math.sin(2.0 * math.pi * y / p[1] + p[2] + p[3] * state[2])


def _second_harmonic(values: Mapping[str, float]) -> tuple[float, ...]:
    """What `two_periods` reads where the second sine is the second harmonic."""
    return (values["amplitude"], values["period"], values["phase"], values["ratio"], 2.0, values["second_phase"])


def _of_the_first_harmonic(values: Mapping[str, float]) -> tuple[float, ...]:
    """What `slotted` reads: a mean over half a period of equal steps, which is exact for smooth waves."""
    sines = [math.sin(math.pi * (k + 0.5) / _STEPS) for k in range(_STEPS)]
    first = 2.0 / _STEPS * sum(s * math.tanh(values["steepness"] * s) for s in sines)
    return (values["amplitude"] / first, values["period"], values["phase"], values["steepness"])


_STEPS = 64

_AMPLITUDE = Parameter(
    "amplitude",
    "N",
    0.0,
    1e4,
    0.05,
    "force at the crest",
    required=True,
    amplitude=True,
    floor=("force_noise_N", 0.05),
)
_PERIOD = Parameter(
    "period",
    "mm",
    0.02,
    200.0,
    1.0,
    "distance after which the force repeats",
    required=True,
    starts=(0.15, 0.25, 0.4, 0.6, 0.85, 1.2, 1.7, 2.5, 4.0, 8.0),
)

EFFECT = Effect(
    id="cogging",
    what="A force periodic in position, from magnets or a thread, is felt by the cell.",
    says="a force of {amplitude:force} repeats every {period:.4g} mm of position",
    check="move slowly through free air over several periods; the ripple is there without a pad",
    reference="Gieras, Piech, Tomczuk, Linear Synchronous Motors, 2nd ed., 2012",
    forms=(
        Form(
            name="sine",
            what="one sine",
            parameters=(_AMPLITUDE, _PERIOD, PHASE),
            blocks={"probe": sine},
        ),
        Form(
            name="tared",
            what="one sine, nothing at the first sample, where the force was set to zero",
            parameters=(_AMPLITUDE, _PERIOD, PHASE),
            blocks={"probe": tared},
            state=(0.0, 0.0),
        ),
        Form(
            name="harmonics",
            what="a sine and its second harmonic",
            parameters=(_AMPLITUDE, _PERIOD, PHASE, *SECOND_HARMONIC),
            blocks={"probe": two_periods},
            pack=_second_harmonic,
        ),
        Form(
            name="unbalanced",
            what="a sine, and its second harmonic, which goes with the load",
            parameters=(
                _AMPLITUDE,
                _PERIOD,
                PHASE,
                *SECOND_HARMONIC,
                Parameter("exponent", "1", 0.5, 4.0, 1.5, "of the load by the depth"),
                GROWTH[1],
            ),
            sought=False,
            blocks={"probe": unbalanced},
        ),
        Form(
            name="swelling",
            what="a sine that grows along the way",
            parameters=(_AMPLITUDE, _PERIOD, PHASE, *GROWTH),
            blocks={"probe": swelling},
        ),
        Form(
            name="driven",
            what="a sine that grows with the force of the pad",
            parameters=(
                _AMPLITUDE,
                _PERIOD,
                PHASE,
                Parameter(
                    "growth", "1", 0.0, 1.5, 0.5, "share that goes with the load, at `at_load`", starts=(0.3, 0.8)
                ),
                Parameter("at_load", "N", 1e-6, 1e5, 1.0, "force of the pad at which the amplitude holds", fixed=True),
            ),
            sought=False,
            blocks={"load": note_load, "probe": driven},
            state=(0.0,),
        ),
        Form(
            name="uneven",
            what="a sine and two harmonics that grow along the way",
            parameters=(
                _AMPLITUDE,
                _PERIOD,
                PHASE,
                *SECOND_HARMONIC,
                Parameter("third_ratio", "1", 0.0, 3.0, 0.2, "third harmonic over the first"),
                phase("third_phase", "phase of the third harmonic at position 0"),
                *GROWTH,
            ),
            sought=False,
            blocks={"probe": uneven},
        ),
        Form(
            name="trailing",
            what="a sine that trails behind the motion",
            parameters=(
                _AMPLITUDE,
                _PERIOD,
                PHASE,
                Parameter("trail", "mm", 0.0, 5.0, 0.1, "full width of the play between the two ways"),
            ),
            blocks={"probe": trailing},
            state=(0.0, 0.0),
        ),
        Form(
            name="slotted",
            what="flat over teeth and slots, steep at their edges",
            parameters=(
                _AMPLITUDE,
                _PERIOD,
                PHASE,
                Parameter("steepness", "1", 0.1, 10.0, 2.0, "of the edges: a sine is at 0, a square wave far above 1"),
            ),
            blocks={"probe": slotted},
            pack=_of_the_first_harmonic,
        ),
        Form(
            name="two_periods",
            what="two sines whose periods are no multiple of each other",
            parameters=(_AMPLITUDE, _PERIOD, PHASE, *SECOND_PERIOD),
            blocks={"probe": two_periods},
        ),
        Form(
            name="edged",
            what="all harmonics, as of rounded edges",
            parameters=(
                _AMPLITUDE,
                _PERIOD,
                PHASE,
                Parameter("sharpness", "1", -0.9, 0.9, 0.4, "each harmonic over the one before", starts=(-0.4, 0.4)),
            ),
            sought=False,
            blocks={"probe": edged},
        ),
        Form(
            name="creeping",
            what="a sine whose phase goes with the way",
            parameters=(
                _AMPLITUDE,
                _PERIOD,
                PHASE,
                Parameter("creep", "rad/mm", -0.5, 0.5, 0.0, "phase for each mm of way", starts=(-0.01, 0.01)),
            ),
            sought=False,
            blocks={"probe": creeping},
            state=(0.0, 0.0, 0.0),
        ),
        Form(
            name="weakening",
            what="a sine that the load borne weakens for good",
            parameters=(
                _AMPLITUDE,
                _PERIOD,
                PHASE,
                Parameter("lost", "1", -0.9, 5.0, 0.5, "more of it at first, relative to what is left", starts=(0.6,)),
                Parameter("reach", "mm", 1e-3, 100.0, 1.0, "depth that leaves no more than `amplitude`", fixed=True),
            ),
            sought=False,
            blocks={"probe": weakening},
            state=(0.0,),
        ),
        Form(
            name="warming",
            what="a sine that fades or grows in time",
            parameters=(
                _AMPLITUDE,
                _PERIOD,
                PHASE,
                Parameter("growth", "1/s", -0.2, 0.2, 0.0, "relative growth in time", starts=(-0.005, 0.005)),
                AT_TIME,
            ),
            sought=False,
            blocks={"probe": warming},
            state=(0.0,),
        ),
    ),
)
