"""What an effect is: a physical cause, as blocks at places of the plant, with its parameters.

An effect file in this folder defines `EFFECT`; that alone registers it. A form (member of the family) names its
parameters and supplies steps (sim.jit.block) for one or several places:

| place | input → output | meaning |
|---|---|---|
| report | true position, mm → reported position | static, slope near 1 |
| play | motor side → after the play, mm | no feedback |
| frame | force at the cell, N → deflection, mm | solved together with the pad |
| probe | probe position, mm → force at the probe, N | added to the pad's, felt by the cell |
| depth | depth → depth, mm | chained |
| elastic | depth, mm → factor on F^e | multiplied |
| rate | depth, mm → factor on all rates | multiplied |
| contact | depth, mm → force of the pad's own, N | added while in contact; with it, too, the pad cannot pull |
| gap | gap between pad and probe, mm (0 in contact) → force, N | added between the two: may pull |
| load | force of the pad on the probe, N → force, N | added to it; or 0, where a block only notes it for `probe` |
| sensor | force at the cell → force in the path, N | chained, on the whole time grid |
| sampling | force → force as reported, N | chained, once a force sample |

All blocks of one effect share one state vector, which starts as `state`, and one parameter vector: the form's
parameters in their order, or what `pack` makes of them. A step from `frame` to `load` is run several times on trial
copies of the state, so it may keep nothing elsewhere. A step must take dt = 0 (the first sample of all, and stamps that
repeat).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from sim.jit import Block
from sim.slots import PLACES

from .reading import read

if TYPE_CHECKING:
    from sim.pad import Pad

Array = NDArray[np.float64]

Floor = Literal["sample_s", "position_noise_mm", "force_noise_N"]
"""A quantity of the data: the time between force samples, or the standard deviation of a channel's noise."""


@dataclass(frozen=True)
class Parameter:
    """One number: its unit (as written in files), what physics allows, and a typical value to start a fit from."""

    name: str
    unit: str
    lower: float
    upper: float
    typical: float
    what: str
    required: bool = False
    default: float | None = None
    """Value when a file leaves it out; `typical` where None."""
    starts: tuple[float, ...] = ()
    """Values from which fits of a shape start (time constants, periods, phases …); `typical` alone where empty."""
    amplitude: bool = False
    """The number that switches the effect off at 0; where lower < 0 its sign is part of the effect."""
    floor: tuple[Floor, float] | None = None
    """(a quantity of the data, factor): a value nearer to 0 than their product cannot be believed."""
    fixed: bool = False
    """A choice of form, not fitted: it stays at the value given, or at its default."""
    bend: bool = False
    """A depth at which the force bends. Each depth held before or behind it makes a minimum of its own, so a fit starts
    from many shares of the depth reached, and not from `starts`."""

    spread: float | None = None
    """Standard deviation about 0 that is expected of it before any data: of numbers, as those of a course in time, of
    which data may tell some sums alone."""

    def __post_init__(self) -> None:
        outside = [value for value in (*self.starts, self.if_left_out) if not self.lower <= value <= self.upper]
        if outside:
            raise ValueError(f"{self.name}: {outside[0]:g} is not from {self.lower:g} to {self.upper:g}")

    @property
    def logarithmic(self) -> bool:
        """Whether a fit works on the parameter's logarithm: wherever it is above 0 by nature."""
        return self.lower > 0.0

    @property
    def if_left_out(self) -> float:
        """The value of an optional parameter that a file does not give."""
        return self.typical if self.default is None else self.default


@dataclass(frozen=True)
class Form:
    """One member of an effect's family."""

    name: str
    what: str
    parameters: tuple[Parameter, ...]
    blocks: Mapping[str, Block] = field(default_factory=dict)
    state: tuple[float, ...] = ()
    pack: Callable[[Mapping[str, float]], tuple[float, ...]] | None = None
    time_shift: Callable[[Mapping[str, float], Array], Array] | None = None
    """Stamp of a force sample (s) → when that force was felt (s): late or drifting force clocks."""
    sought: bool = True
    """Whether a diagnosis tries the form; one that can pass for another cause simulates only."""
    amend: Callable[[Pad, Mapping[str, float]], Pad] | None = None
    """Another pad in place of the one described: another law, a further mode, contact that lets go."""
    of_motion: bool = False
    """Whether it goes with the motion, where its effect by itself does not (see `Effect.of_motion`)."""

    def __post_init__(self) -> None:
        unknown = set(self.blocks) - (set(PLACES) - {"law"})
        if unknown:
            raise ValueError(f"form {self.name}: no place {', '.join(sorted(unknown))}")

    @property
    def given(self) -> bool:
        """Whether all its numbers are choices, of which a fit can change none."""
        return bool(self.parameters) and all(p.fixed for p in self.parameters)

    @property
    def has_a_course(self) -> bool:
        """Whether it is now more and now less in time, by half waves over the data."""
        return any(p.spread is not None for p in self.parameters)

    def vector(self, values: Mapping[str, float]) -> tuple[float, ...]:
        """The parameter vector the blocks read."""
        if self.pack is not None:
            return self.pack(values)
        return tuple(values[parameter.name] for parameter in self.parameters)


@dataclass(frozen=True)
class Effect:
    """A physical cause. `forms[0]` is the one meant when a file names none."""

    id: str
    what: str
    forms: tuple[Form, ...]
    says: str = ""
    """A sentence for whoever runs the bench, with the parameters of the first form as `{name}` fields (see
    `sim.effects.reading` for how their numbers can be written)."""
    check: str = ""
    """What to look at on the bench."""
    reference: str = ""
    """Where the physics stands in the literature."""
    of_motion: bool = True
    """Whether it acts with depth or speed, or as a pad's relaxation and greatest force may. One press and one hold show
    that once, and a pad that is stranger than its law does the same; what else runs in time is told by them as well as
    by a longer run."""

    def explanation(self, values: Mapping[str, float]) -> str:
        """`says` with numbers in it; `what` where the effect has no such sentence."""
        return read(self.says, values) if self.says else self.what

    def goes_with_motion(self, form: str | None = None) -> bool:
        """Whether it acts with the motion in the form of that name (see `form`)."""
        return self.of_motion or self.form(form).of_motion

    def form(self, name: str | None = None) -> Form:
        """The form `name`, or the first; KeyError when there is none of that name."""
        if name is None:
            return self.forms[0]
        for form in self.forms:
            if form.name == name:
                return form
        raise KeyError(name)

    def active(self, form: str | None = None, **values: float) -> Active:
        """The effect with numbers; parameters left out take their defaults, required ones their typical value.

        Raises KeyError for a form or a parameter that there is not.
        """
        chosen = self.form(form)
        unknown = set(values) - {parameter.name for parameter in chosen.parameters}
        if unknown:
            raise KeyError(sorted(unknown)[0])
        numbers = {parameter.name: values.get(parameter.name, parameter.if_left_out) for parameter in chosen.parameters}
        return Active(self, chosen, numbers)


@dataclass(frozen=True)
class Active:
    """A form with numbers: what a model holds."""

    effect: Effect
    form: Form
    values: Mapping[str, float]
