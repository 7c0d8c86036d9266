"""Mains hum: a sine in time on the force, from the mains through cable and ground.

Phases are at the first sample.

- `sine`: amplitude · sin(2πft + phase).
- `harmonics`: with the third harmonic, which rectifiers and saturated transformers make.
- `flat_topped`: with the third, the fifth and the seventh, as rectifiers make that draw from the crests alone.
- `dimmed`: a dimmer lets each half wave through from an angle `fires` on (IEC 61000-3-2), its choke making the edge a
  tenth of a millisecond long; `amplitude` is that of the first harmonic, `phase` that of the mains.
- `distorted`: with all harmonics from the second to the seventh; rectifiers of half waves make the even ones.
- `swinging`: amplitude and phase swing slowly, amplitude · (1 + swell · sin(2πt/period + …)) ·
  sin(2πft + phase + wander · sin(2πt/period + …)), as the grid's frequency does and what else it feeds.
- `swinging_harmonics`: the same with its harmonics up to the seventh, whose phases wander so many times as far.
- `bursts`: let through for `fed` of every `waves` whole waves, from wave number `first` on, as heaters are that are
  switched at zero crossings (IEC 61000-3-3, burst firing); `amplitude` is the mean over time, waves begin at phase 0.
- `loaded`, `loaded_harmonics`: the same, times 1 + growth · (F − at_force) of the force F at the cell. A bridge
  multiplies its supply by its load, so ripple of the supply is hum that grows with the force; what comes by the cable
  and the bridge's own zero does not grow.

Reference: H. W. Ott, Noise Reduction Techniques in Electronic Systems, 2nd ed., Wiley, 1988; E. O. Doebelin,
Measurement Systems: Application and Design, 4th ed., McGraw-Hill, 1990, chapter 4 (bridges: output over excitation);
IEC 61000-3-2, Limits for harmonic current emissions; P. Kundur, Power System Stability and Control, McGraw-Hill, 1994,
chapter 11 (the grid's frequency).
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from sim.effects.base import Effect, Form, Parameter
from sim.effects.waves import phase
from sim.jit import State, block


@block
def sine(dt: float, force: float, state: State, p: State) -> float:
    """Force with the hum; p = (amplitude, frequency, phase); state: time since the first sample."""
    state[0] += dt
    return force + p[0] * math.sin(2.0 * math.pi * p[1] * state[0] + p[2])


@block
def harmonics(dt: float, force: float, state: State, p: State) -> float:
    """Force with the hum; p = (amplitude, frequency, phase, ratio, third_phase)."""
    state[0] += dt
    angle = 2.0 * math.pi * p[1] * state[0]
    return force + p[0] * (math.sin(angle + p[2]) + p[3] * math.sin(3.0 * angle + p[4]))


@block
def flat_topped(dt: float, force: float, state: State, p: State) -> float:
    """Force with the hum; p = (amplitude, frequency, phase), then (ratio, phase) of the third, fifth and seventh."""
    state[0] += dt
    angle = 2.0 * math.pi * p[1] * state[0]
    wave = math.sin(angle + p[2]) + p[3] * math.sin(3.0 * angle + p[4])
    return force + p[0] * (wave + p[5] * math.sin(5.0 * angle + p[6]) + p[7] * math.sin(7.0 * angle + p[8]))


RISE_RAD = (
    0.04  # a tenth of a millisecond of a wave of 50 or 60 Hz: of an edge without length no sample says where it is
)


def first_of_dimmed(fires: float) -> tuple[float, float]:
    """Sine and cosine of the first harmonic of sin θ let through from `fires` on, the edge as long as a dimmer's."""
    middle = fires + 0.5 * RISE_RAD
    return 1.0 - (middle - 0.5 * math.sin(2.0 * middle)) / math.pi, -(math.sin(middle) ** 2) / math.pi


def let_through(angle: NDArray[np.float64], fires: float) -> NDArray[np.float64]:
    """What a dimmer lets through of the mains at angles (n,), rad: from 0 to 1."""
    return np.clip((angle % math.pi - fires) / RISE_RAD, 0.0, 1.0)


@block
def dimmed(dt: float, force: float, state: State, p: State) -> float:
    """Force with the hum; p = (amplitude of the whole wave, frequency, phase, fires)."""
    state[0] += dt
    angle = 2.0 * math.pi * p[1] * state[0] + p[2]
    return force + p[0] * min(max((angle % math.pi - p[3]) / RISE_RAD, 0.0), 1.0) * math.sin(angle)


def _whole(values: Mapping[str, float]) -> tuple[float, ...]:
    """What `dimmed` reads."""
    fires = values["fires"]
    return (values["amplitude"] / math.hypot(*first_of_dimmed(fires)), values["frequency"], values["phase"], fires)


@block
def distorted(dt: float, force: float, state: State, p: State) -> float:
    """Force with the hum; p = (amplitude, frequency, phase), then (ratio, phase) of the second to the seventh."""
    state[0] += dt
    angle = 2.0 * math.pi * p[1] * state[0]
    wave = math.sin(angle + p[2])
    for k in range(6):
        wave += p[3 + 2 * k] * math.sin((k + 2.0) * angle + p[4 + 2 * k])
    return force + p[0] * wave


@block
def swinging(dt: float, force: float, state: State, p: State) -> float:
    """p = (amplitude, frequency, phase, period, swell, swell_phase, wander, wander_phase)."""
    state[0] += dt
    slow = 2.0 * math.pi * state[0] / p[3]
    angle = 2.0 * math.pi * p[1] * state[0] + p[2] + p[6] * math.sin(slow + p[7])
    return force + p[0] * (1.0 + p[4] * math.sin(slow + p[5])) * math.sin(angle)


@block
def swinging_harmonics(dt: float, force: float, state: State, p: State) -> float:
    """p = as of `swinging`, then (ratio, phase) of the second to the seventh."""
    state[0] += dt
    slow = 2.0 * math.pi * state[0] / p[3]
    angle = 2.0 * math.pi * p[1] * state[0] + p[6] * math.sin(slow + p[7])
    wave = math.sin(angle + p[2])
    for k in range(6):
        wave += p[8 + 2 * k] * math.sin((k + 2.0) * angle + p[9 + 2 * k])
    return force + p[0] * (1.0 + p[4] * math.sin(slow + p[5])) * wave


@block
def bursts(dt: float, force: float, state: State, p: State) -> float:
    """Force with the hum; p = (amplitude while it is fed, frequency, phase, waves, fed, first)."""
    state[0] += dt
    turns = p[1] * state[0] + p[2] / (2.0 * math.pi)
    fed = (math.floor(turns) - p[5]) % p[3] < p[4]
    return force + p[0] * math.sin(2.0 * math.pi * turns) if fed else force


def _while_fed(values: Mapping[str, float]) -> tuple[float, ...]:
    """What `bursts` reads."""
    waves, first = float(round(values["waves"])), float(round(values["first"]))
    fed = min(float(round(values["fed"])), waves)
    return (values["amplitude"] * waves / fed, values["frequency"], values["phase"], waves, fed, first)


@block
def loaded(dt: float, force: float, state: State, p: State) -> float:
    """Force with the hum; p = (amplitude, frequency, phase, growth, at_force)."""
    state[0] += dt
    swells = p[0] * (1.0 + p[3] * (force - p[4]))
    return force + swells * math.sin(2.0 * math.pi * p[1] * state[0] + p[2])


@block
def loaded_harmonics(dt: float, force: float, state: State, p: State) -> float:
    """Force with the hum; p = (amplitude, frequency, phase, ratio, third_phase, growth, at_force)."""
    state[0] += dt
    angle = 2.0 * math.pi * p[1] * state[0]
    swells = p[0] * (1.0 + p[5] * (force - p[6]))
    return force + swells * (math.sin(angle + p[2]) + p[3] * math.sin(3.0 * angle + p[4]))


_AMPLITUDE = Parameter(
    "amplitude",
    "N",
    0.0,
    1e4,
    0.03,
    "force at the crest",
    required=True,
    amplitude=True,
    floor=("force_noise_N", 0.02),
)
_FREQUENCY = Parameter(
    "frequency", "Hz", 0.1, 2000.0, 50.0, "frequency", required=True, starts=(50.0, 60.0, 100.0, 120.0)
)
_PHASE = phase("phase", "phase at the first sample")
_THIRD = (
    Parameter("ratio", "1", 0.0, 3.0, 0.3, "third harmonic over the first"),
    phase("third_phase", "phase of the third harmonic at the first sample"),
)
_HIGHER = (
    Parameter("fifth", "1", 0.0, 3.0, 0.1, "fifth harmonic over the first"),
    phase("fifth_phase", "phase of the fifth harmonic at the first sample"),
    Parameter("seventh", "1", 0.0, 3.0, 0.05, "seventh harmonic over the first"),
    phase("seventh_phase", "phase of the seventh harmonic at the first sample"),
)
_EACH = tuple(
    p
    for name in ("second", "third", "fourth", "fifth", "sixth", "seventh")
    for p in (
        Parameter(name, "1", 0.0, 3.0, 0.2, f"{name} harmonic over the first"),
        phase(f"{name}_phase", f"phase of the {name} harmonic at the first sample"),
    )
)
_SWING = (
    Parameter("period", "s", 0.5, 1e4, 30.0, "time of a swing"),
    Parameter("swell", "1", 0.0, 1.0, 0.1, "how far the amplitude swings, of itself"),
    phase("swell_phase", "phase of that at the first sample"),
    Parameter("wander", "rad", 0.0, 20.0, 0.1, "how far the phase swings"),
    phase("wander_phase", "phase of that at the first sample"),
)
_BURSTS = (
    Parameter("waves", "1", 2.0, 1e4, 50.0, "whole waves after which it repeats", fixed=True),
    Parameter("fed", "1", 1.0, 1e4, 25.0, "how many of them are let through", fixed=True),
    Parameter("first", "1", 0.0, 1e4, 0.0, "number of the first one", default=0.0, fixed=True),
)
_LOAD = (
    Parameter("growth", "1/N", -1e3, 1e3, 0.1, "by how much of itself it grows with each newton of load"),
    Parameter("at_force", "N", -1e5, 1e5, 0.0, "force at which the amplitude is as stated", fixed=True),
)

EFFECT = Effect(
    id="mains_hum",
    what="The mains hum on the force signal.",
    says="the force hums with {amplitude:force} at {frequency:.5g} Hz",
    check="look at shield and ground of the cell's cable; set the amplifier's notch or average over whole periods",
    reference="Ott, Noise Reduction Techniques in Electronic Systems, 2nd ed., 1988",
    of_motion=False,
    forms=(
        Form(
            name="sine",
            what="one sine",
            parameters=(_AMPLITUDE, _FREQUENCY, _PHASE),
            blocks={"sensor": sine},
            state=(0.0,),
        ),
        Form(
            name="harmonics",
            what="a sine and its third harmonic",
            parameters=(_AMPLITUDE, _FREQUENCY, _PHASE, *_THIRD),
            blocks={"sensor": harmonics},
            state=(0.0,),
        ),
        Form(
            name="flat_topped",
            what="a sine and three odd harmonics",
            parameters=(_AMPLITUDE, _FREQUENCY, _PHASE, *_THIRD, *_HIGHER),
            sought=False,
            blocks={"sensor": flat_topped},
            state=(0.0,),
        ),
        Form(
            name="dimmed",
            what="half waves that are let through late, as by a dimmer",
            parameters=(
                _AMPLITUDE,
                _FREQUENCY,
                _PHASE,
                Parameter("fires", "rad", 0.0, 2.8, 1.3, "angle from which on a half wave is let through"),
            ),
            sought=False,
            blocks={"sensor": dimmed},
            state=(0.0,),
            pack=_whole,
        ),
        Form(
            name="bursts",
            what="so many whole waves on, so many off",
            parameters=(_AMPLITUDE, _FREQUENCY, _PHASE, *_BURSTS),
            sought=False,
            blocks={"sensor": bursts},
            state=(0.0,),
            pack=_while_fed,
        ),
        Form(
            name="distorted",
            what="a sine and its harmonics up to the seventh",
            parameters=(_AMPLITUDE, _FREQUENCY, _PHASE, *_EACH),
            sought=False,
            blocks={"sensor": distorted},
            state=(0.0,),
        ),
        Form(
            name="swinging",
            what="a sine of which amplitude and phase swing slowly",
            parameters=(_AMPLITUDE, _FREQUENCY, _PHASE, *_SWING),
            sought=False,
            blocks={"sensor": swinging},
            state=(0.0,),
        ),
        Form(
            name="swinging_harmonics",
            what="a sine and its harmonics up to the seventh, of which amplitude and phase swing slowly",
            parameters=(_AMPLITUDE, _FREQUENCY, _PHASE, *_SWING, *_EACH),
            sought=False,
            blocks={"sensor": swinging_harmonics},
            state=(0.0,),
        ),
        Form(
            name="loaded",
            what="a sine that grows with the load, as ripple of the bridge's supply",
            parameters=(_AMPLITUDE, _FREQUENCY, _PHASE, *_LOAD),
            sought=False,
            blocks={"sensor": loaded},
            state=(0.0,),
        ),
        Form(
            name="loaded_harmonics",
            what="a sine and its third harmonic, both growing with the load",
            parameters=(_AMPLITUDE, _FREQUENCY, _PHASE, *_THIRD, *_LOAD),
            sought=False,
            blocks={"sensor": loaded_harmonics},
            state=(0.0,),
        ),
    ),
)
