"""Encoder error: the reported position is off by an error that repeats with the pitch of the scale.

- `sine`: reported = true + amplitude · sin(2π true/period + phase).
- `zeroed`: the sine less its value at 0: a surface that was found through the encoder itself is where it reports 0.
- `harmonics`: with a second harmonic, ratio · amplitude. Unequal offsets of the two quadrature signals make the first
  harmonic, unequal gains and a phase other than 90° the second (P. L. M. Heydemann, Determination and correction of
  quadrature fringe measurement errors in interferometers, Appl. Opt. 20, 1981, 3382–3384).
- `two_periods`: with a second sine of `order` waves for each of the first, which need not be whole: the balls of a
  screw beside its lead, the pole pitch of a motor beside that of its scale.
- `fading`: the sine fades or grows along the way, where the head is not parallel to its scale: amplitude ·
  (1 + growth (true − at_depth)), within 0 and twice the amplitude.
- `leaning`: the sine grows or fades with a power of the depth, as the bracket of a head bends under the load:
  amplitude · (1 + growth ((true/reach)^power − ½)), within 0 and twice the amplitude, which is that at
  half of the load.
- `stitched`: Σ r^(n−1) sin n θ/n, a saw tooth with rounded edges: fields of a scale that are each a little too long or
  too short, and begin anew. It is atan(r sin θ/(1 − r cos θ))/r; `amplitude` is that of the first harmonic.
- `sectors`: a triangular wave that rises over a share `rise` of its period: parts of a scale that are stretched and
  compressed in turn.

A reported position must rise with the true one; an error so steep that it would not is taken as the steepest that does.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from sim.effects.base import Effect, Form, Parameter
from sim.effects.waves import GROWTH, PHASE, SECOND_HARMONIC, SECOND_PERIOD
from sim.jit import State, block

_STEEPEST = 0.9
_BLUNT = 1e-6  # a sharpness below is a sine


@block
def sine(dt: float, x: float, state: State, p: State) -> float:
    """Reported position; p = (amplitude, wave number, phase)."""
    return x + p[0] * math.sin(p[1] * x + p[2])


@block
def zeroed(dt: float, x: float, state: State, p: State) -> float:
    """Reported position; p = (amplitude, wave number, phase, …)."""
    return x + p[0] * (math.sin(p[1] * x + p[2]) - math.sin(p[2]))


@block
def two_periods(dt: float, x: float, state: State, p: State) -> float:
    """Reported position; p = (amplitude, wave number, phase, ratio, order, second phase)."""
    angle = p[1] * x
    return x + p[0] * (math.sin(angle + p[2]) + p[3] * math.sin(p[4] * angle + p[5]))


@block
def fading(dt: float, x: float, state: State, p: State) -> float:
    """Reported position; p = (amplitude, wave number, phase, growth, at_depth)."""
    size = min(max(1.0 + p[3] * (x - p[4]), 0.0), 2.0)
    return x + p[0] * size * math.sin(p[1] * x + p[2])


@block
def leaning(dt: float, x: float, state: State, p: State) -> float:
    """Reported position; p = (amplitude, wave number, phase, growth, power, reach)."""
    loaded = (max(x, 0.0) / p[5]) ** p[4]
    size = min(max(1.0 + p[3] * (loaded - 0.5), 0.0), 2.0)
    return float(x + p[0] * size * math.sin(p[1] * x + p[2]))


@block
def stitched(dt: float, x: float, state: State, p: State) -> float:
    """Reported position; p = (amplitude, wave number, phase, sharpness)."""
    angle = p[1] * x + p[2]
    return x + p[0] * math.atan2(p[3] * math.sin(angle), 1.0 - p[3] * math.cos(angle)) / p[3]


@block
def sectors(dt: float, x: float, state: State, p: State) -> float:
    """Reported position; p = (amplitude, waves per mm, phase in waves, rise)."""
    turns = p[1] * x + p[2]
    turns -= math.floor(turns)
    return x + p[0] * (2.0 * turns / p[3] - 1.0 if turns < p[3] else 1.0 - 2.0 * (turns - p[3]) / (1.0 - p[3]))


def _packed_sectors(values: Mapping[str, float]) -> tuple[float, ...]:
    period, rise = values["period"], values["rise"]
    amplitude = min(values["amplitude"], 0.5 * _STEEPEST * period * min(rise, 1.0 - rise))
    # the middle of the rise is where a sine of that phase goes up through 0
    return (amplitude, 1.0 / period, values["phase"] / (2.0 * math.pi) + 0.5 * rise, rise)


def _packed_stitched(values: Mapping[str, float]) -> tuple[float, ...]:
    wave_number = 2.0 * math.pi / values["period"]
    sharpness = values["sharpness"]
    sharpness = sharpness if abs(sharpness) > _BLUNT else math.copysign(_BLUNT, sharpness)
    amplitude = min(values["amplitude"], _STEEPEST * (1.0 - abs(sharpness)) / wave_number)
    return (amplitude, wave_number, values["phase"], sharpness)


def _packed_leaning(values: Mapping[str, float]) -> tuple[float, ...]:
    wave_number = 2.0 * math.pi / values["period"]
    growth, power, reach = values["growth"], values["power"], values["reach"]
    amplitude = min(values["amplitude"], _STEEPEST / (2.0 * wave_number + 1.5 * power * abs(growth) / reach))
    return (amplitude, wave_number, values["phase"], growth, power, reach)


def _packed_fading(values: Mapping[str, float]) -> tuple[float, ...]:
    wave_number = 2.0 * math.pi / values["period"]
    growth = values["growth"]
    amplitude = min(values["amplitude"], _STEEPEST / (2.0 * wave_number + abs(growth)))
    return (amplitude, wave_number, values["phase"], growth, values["at_depth"])


def _packed(values: Mapping[str, float]) -> tuple[float, ...]:
    """What `sine` and `two_periods` read; a second harmonic is the second period of order 2."""
    wave_number, ratio, order = 2.0 * math.pi / values["period"], values.get("ratio", 0.0), values.get("order", 2.0)
    amplitude = min(values["amplitude"], _STEEPEST / (wave_number * (1.0 + order * abs(ratio))))
    return (amplitude, wave_number, values["phase"], ratio, order, values.get("second_phase", 0.0))


_AMPLITUDE = Parameter(
    "amplitude",
    "mm",
    0.0,
    1.0,
    0.005,
    "greatest error",
    required=True,
    amplitude=True,
    floor=("position_noise_mm", 1.0),
)
_PERIOD = Parameter(
    "period",
    "mm",
    0.005,
    200.0,
    1.0,
    "distance after which the error repeats",
    required=True,
    starts=(0.1, 0.2, 0.35, 0.5, 0.7, 1.0, 1.4, 2.0, 3.0, 5.0),
)

EFFECT = Effect(
    id="encoder_error",
    what="The reported position is off by an error that repeats with the pitch of the encoder.",
    says="the encoder is off by up to {amplitude:.3g} mm, again every {period:.4g} mm",
    check="compare with a dial gauge over one pitch of the scale; run the maker's encoder calibration",
    reference="Heydemann, Appl. Opt. 20, 1981, 3382-3384",
    forms=(
        Form(
            name="sine",
            what="one sine",
            parameters=(_AMPLITUDE, _PERIOD, PHASE),
            blocks={"report": sine},
            pack=_packed,
        ),
        Form(
            name="zeroed",
            what="one sine, nothing at the surface, which was found through it",
            parameters=(_AMPLITUDE, _PERIOD, PHASE),
            blocks={"report": zeroed},
            pack=_packed,
        ),
        Form(
            name="harmonics",
            what="a sine and its second harmonic",
            parameters=(_AMPLITUDE, _PERIOD, PHASE, *SECOND_HARMONIC),
            blocks={"report": two_periods},
            pack=_packed,
        ),
        Form(
            name="two_periods",
            what="two sines whose periods are no multiple of each other",
            parameters=(_AMPLITUDE, _PERIOD, PHASE, *SECOND_PERIOD),
            blocks={"report": two_periods},
            pack=_packed,
        ),
        Form(
            name="fading",
            what="a sine that fades or grows along the way",
            parameters=(_AMPLITUDE, _PERIOD, PHASE, *GROWTH),
            blocks={"report": fading},
            pack=_packed_fading,
        ),
        Form(
            name="stitched",
            what="a saw tooth with rounded edges",
            parameters=(
                _AMPLITUDE,
                _PERIOD,
                PHASE,
                Parameter("sharpness", "1", -0.95, 0.95, 0.6, "each harmonic over the one before", starts=(-0.6, 0.6)),
            ),
            blocks={"report": stitched},
            pack=_packed_stitched,
        ),
        Form(
            name="sectors",
            what="a triangular wave",
            parameters=(
                _AMPLITUDE,
                _PERIOD,
                PHASE,
                Parameter("rise", "1", 0.1, 0.9, 0.5, "share of the period in which it rises", starts=(0.5,)),
            ),
            sought=False,
            blocks={"report": sectors},
            pack=_packed_sectors,
        ),
        Form(
            name="leaning",
            what="a sine that grows or fades with the load",
            parameters=(
                _AMPLITUDE,
                _PERIOD,
                PHASE,
                Parameter("growth", "1", -1.5, 1.5, 0.0, "what the greatest load adds to it", starts=(-0.7, 0.7)),
                Parameter("power", "1", 1.0, 4.0, 1.6, "power of the depth that the load goes with"),
                Parameter("reach", "mm", 1e-3, 100.0, 1.0, "depth of the greatest load", fixed=True),
            ),
            sought=False,
            blocks={"report": leaning},
            pack=_packed_leaning,
        ),
    ),
)
