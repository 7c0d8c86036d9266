"""Mains hum: a sine in time on the force, from the mains through cable and ground.

Phases are at the first sample.

- `sine`: amplitude · sin(2πft + phase).
- `harmonics`: with the third harmonic, which rectifiers and saturated transformers make.
- `loaded`, `loaded_harmonics`: the same, times 1 + growth · (F − at_force) of the force F at the cell. A bridge
  multiplies its supply by its load, so ripple of the supply is hum that grows with the force; what comes by the cable
  and the bridge's own zero does not grow.

Reference: H. W. Ott, Noise Reduction Techniques in Electronic Systems, 2nd ed., Wiley, 1988; E. O. Doebelin,
Measurement Systems: Application and Design, 4th ed., McGraw-Hill, 1990, chapter 4 (bridges: output over excitation).
"""

from __future__ import annotations

import math

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
    100.0,
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
_LOAD = (
    Parameter("growth", "1/N", -1e3, 1e3, 0.1, "by how much of itself it grows with each newton of load"),
    Parameter("at_force", "N", -1e5, 1e5, 0.0, "force at which the amplitude is as stated", fixed=True),
)

EFFECT = Effect(
    id="mains_hum",
    what="The mains hum on the force signal.",
    says="the force hums with {amplitude:.4g} N at {frequency:.5g} Hz",
    check="look at shield and ground of the cell's cable; set the amplifier's notch or average over whole periods",
    reference="Ott, Noise Reduction Techniques in Electronic Systems, 2nd ed., 1988",
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
