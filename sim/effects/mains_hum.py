"""Mains hum: a sine in time on the force, from the mains through cable and ground.

Phases are at the first sample. `harmonics` adds the third harmonic, which rectifiers and saturated transformers make.

Reference: H. W. Ott, Noise Reduction Techniques in Electronic Systems, 2nd ed., Wiley, 1988.
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
            parameters=(_AMPLITUDE, _FREQUENCY, phase("phase", "phase at the first sample")),
            blocks={"sensor": sine},
            state=(0.0,),
        ),
        Form(
            name="harmonics",
            what="a sine and its third harmonic",
            parameters=(
                _AMPLITUDE,
                _FREQUENCY,
                phase("phase", "phase at the first sample"),
                Parameter("ratio", "1", 0.0, 3.0, 0.3, "third harmonic over the first"),
                phase("third_phase", "phase of the third harmonic at the first sample"),
            ),
            blocks={"sensor": harmonics},
            state=(0.0,),
        ),
    ),
)
