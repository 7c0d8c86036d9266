"""What the tests of effects share."""

import numpy as np

from sim.effects import Active, all_effects, effect
from sim.elastic import Exponential, NoPad
from sim.pad import Cascade, Pad
from sim.relaxation import Relaxation

GEL = Relaxation((0.25, 0.15), (4.0, 0.35))
K = 5.0
AIR = Pad(NoPad(), Relaxation(), unilateral=True)
LINEAR = Pad(Exponential(K, 0.0), Relaxation(), unilateral=True)
SOFT = Pad(Exponential(2.24, 0.69), GEL, unilateral=True)

EVERY_FORM = [(cause.id, form.name) for cause in all_effects().values() for form in cause.forms]


def active(name: str, form: str | None = None, **values: float) -> Active:
    """An effect with some numbers; the others are typical ones."""
    return effect(name).active(form, **values)


def simulate(pad: Pad, effects: list[Active], t: np.ndarray, x: np.ndarray) -> np.ndarray:
    return Cascade(pad, effects).simulate(t, x)


def ramp(up_to: float, n: int, back: bool = True) -> np.ndarray:
    """From 0 to `up_to` in n samples, and back."""
    up = np.linspace(0.0, up_to, n)
    return np.concatenate([up, up[-2::-1]]) if back else up


def sense(effect: Active, t: np.ndarray, force: np.ndarray) -> np.ndarray:
    """What the force path makes of a force at the cell."""
    plant = Cascade(AIR, [effect]).plant()
    return np.array([plant.sense(float(d), float(f)) for d, f in zip(np.diff(t, prepend=t[0]), force, strict=True)])
