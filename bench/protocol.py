"""What is to be done to the pad: the protocol file as an object, and its steps one after the other.

Depths are in the pad frame (mm, 0 at the surface, growing into the pad), speeds in mm/s, forces in N, times in s.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Discriminator, Field, PrivateAttr, Tag, model_validator

from bench.complaints import FieldError
from bench.places import Key, Places
from bench.shipped import find_file
from bench.yamlfile import read_yaml, validate

MAX_STEPS = 100_000
"""More steps than this after expanding `repeat` are a mistake: at 10 ms each they take a quarter of an hour."""

Number = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]


def _as_word(value: Any) -> Any:
    """`id: 42` is meant as a word."""
    return str(value) if isinstance(value, int | float) and not isinstance(value, bool) else value


Word = Annotated[str, BeforeValidator(_as_word, json_schema_input_type=str | float)]
Name = Annotated[Word, Field(pattern=r"^\w[\w .\-]*$", max_length=100)]
"""What may become part of a folder's name."""


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Approach(_Part):
    """How the surface is found: down at `speed` until `force`, then back to `retract` above the surface."""

    speed: Positive = 2.0
    force: Positive = 0.05
    retract: NotNegative = 0.5


ApproachOrNone = Annotated[
    Annotated[Approach, Tag("approach by force")] | Annotated[Literal["none"], Tag("no approach")],
    Discriminator(lambda value: "no approach" if isinstance(value, str) else "approach by force"),
]


class Precondition(_Part):
    """`cycles` from the start into the depth `to` and back, then `rest` seconds in air."""

    to: Positive
    speed: Positive
    cycles: Annotated[int, Field(ge=1, le=MAX_STEPS)]
    rest: NotNegative = 0.0


class ProtocolLimits(_Part):
    """Limits of this protocol; the tighter of these and the bench's hold."""

    force: Positive | None = None
    depth: Positive | None = None


class DepthStep(_Part):
    """A ramp to a depth, then a hold of that position."""

    to: Number
    speed: Positive
    hold: NotNegative = 0.0


class ForceStep(_Part):
    """A ramp that stops at a force, then a hold of the position (or of the force: creep)."""

    to_force: Positive
    speed: Positive
    hold: NotNegative = 0.0
    hold_mode: Literal["position", "force"] = "position"


class BlockStep(_Part):
    """Steps under a name, `repeat` times."""

    block: Name
    repeat: Annotated[int, Field(ge=1)] = 1
    steps: Annotated[list[Step], Field(min_length=1)]


def _kind_of_step(value: Any) -> str | None:
    kinds: dict[str, str] = {"to": "depth step", "to_force": "force step", "block": "block of steps"}
    if isinstance(value, _Part):
        return next((tag for key, tag in kinds.items() if hasattr(value, key)), None)
    found = [tag for key, tag in kinds.items() if key in value] if isinstance(value, dict) else []
    return found[0] if len(found) == 1 else None


Step = Annotated[
    Annotated[DepthStep, Tag("depth step")]
    | Annotated[ForceStep, Tag("force step")]
    | Annotated[BlockStep, Tag("block of steps")],
    Discriminator(
        _kind_of_step,
        custom_error_type="step_kind",
        custom_error_message="A step has one of `to` (a depth), `to_force` (a force) or `block` (a name, with `steps`)",
    ),
]


class Finish(_Part):
    """Out of the pad to `retract` above the surface, and `air` seconds there: drift can be told from relaxation."""

    retract: NotNegative = 0.5
    air: NotNegative = 3.0
    speed: Positive = 5.0


class Sampling(_Part):
    """Rates asked of the devices, in samples per second; None: as fast as each device is set up for."""

    motor: Positive | None = None
    load_cell: Positive | None = None


class Sample(_Part):
    """What is pressed: goes into the recording. `thickness` in mm; `age` in the lab's own words."""

    id: Word | None = None
    thickness: Positive | None = None
    age: Word | None = None
    note: Word | None = None


@dataclass(frozen=True, slots=True)
class FlatStep:
    """One ramp and its hold, after blocks are expanded.

    `name` counts repeats (`steps[3].cycle[1].steps[0]`), `path` is where it stands in the file.
    """

    name: str
    path: tuple[Key, ...]
    step: DepthStep | ForceStep


class Protocol(_Part):
    """A protocol file."""

    name: Name
    description: Word = ""
    approach: ApproachOrNone = Field(
        default_factory=Approach, description="`none`: no pad; depths are then positions in the motor frame."
    )
    precondition: Precondition | None = None
    limits: ProtocolLimits = Field(default_factory=ProtocolLimits)
    steps: Annotated[list[Step], Field(min_length=1)]
    finish: Finish = Field(default_factory=Finish)
    acceleration: Positive | None = Field(None, description="mm/s²; default: what the bench allows")
    profile: Literal["trapezoid", "s_curve"] = "trapezoid"
    jerk: Positive | None = Field(None, description="mm/s³, of an s_curve; default: full acceleration in 10 ms")
    sampling: Sampling = Field(default_factory=Sampling)
    sample: Sample = Field(default_factory=Sample)

    _text: str = PrivateAttr(default="")
    _source: Path | None = PrivateAttr(default=None)
    _places: Places | None = PrivateAttr(default=None)

    @property
    def text(self) -> str:
        """The file as written, for the recording."""
        return self._text

    @property
    def source(self) -> Path | None:
        """The file it came from."""
        return self._source

    @property
    def in_air(self) -> bool:
        """No pad: there is no surface, and depths are positions in the motor frame."""
        return self.approach == "none"

    def place(self, path: tuple[Key, ...]) -> str:
        """`file:line:column` of a part of the protocol; its name where it came from no file."""
        return self._places.place(path) if self._places else self.name

    def flatten(self) -> Iterator[FlatStep]:
        """The steps in the order of their execution, blocks expanded."""
        return _flatten(self.steps, ("steps",), "steps")

    @model_validator(mode="after")
    def _consistent(self) -> Protocol:
        _check_count(self.steps, ("steps",), 1)
        if self.jerk is not None and self.profile != "s_curve":
            raise FieldError(("jerk",), "only an s_curve has a jerk", "add `profile: s_curve`, or leave it out")
        if isinstance(self.approach, str) and self.precondition is not None:
            raise FieldError(("precondition",), "there is no pad with `approach: none`", "leave one of the two out")
        if isinstance(self.approach, Approach) and self.limits.force and self.approach.force >= self.limits.force:
            message = f"{self.approach.force:g} N is not under limits.force {self.limits.force:g} N"
            raise FieldError(("approach", "force"), message)
        if self.precondition is not None:
            self._check_depth(self.precondition.to, ("precondition", "to"))
        for path, step in _leaves(self.steps, ("steps",)):
            self._check_step(path, step)
        return self

    def _check_step(self, path: tuple[Key, ...], step: DepthStep | ForceStep) -> None:
        if isinstance(step, DepthStep):
            self._check_depth(step.to, (*path, "to"))
            return
        if self.in_air:
            raise FieldError((*path, "to_force"), "there is nothing to press with `approach: none`")
        if self.limits.force is not None and step.to_force > self.limits.force:
            message = f"{step.to_force:g} N is beyond limits.force {self.limits.force:g} N"
            raise FieldError((*path, "to_force"), message, "lower the one, or raise the other")

    def _check_depth(self, to: float, path: tuple[Key, ...]) -> None:
        if self.limits.depth is not None and to > self.limits.depth:
            message = f"{to:g} mm is beyond limits.depth {self.limits.depth:g} mm"
            raise FieldError(path, message, "lower the one, or raise the other")


def _flatten(steps: list[Step], path: tuple[Key, ...], name: str) -> Iterator[FlatStep]:
    for i, step in enumerate(steps):
        here, label = (*path, i), f"{name}[{i}]"
        if isinstance(step, BlockStep):
            for k in range(step.repeat):
                yield from _flatten(step.steps, (*here, "steps"), f"{label}.{step.block}[{k}].steps")
        else:
            yield FlatStep(label, here, step)


def _leaves(steps: list[Step], path: tuple[Key, ...]) -> Iterator[tuple[tuple[Key, ...], DepthStep | ForceStep]]:
    for i, step in enumerate(steps):
        if isinstance(step, BlockStep):
            yield from _leaves(step.steps, (*path, i, "steps"))
        else:
            yield (*path, i), step


def _check_count(steps: list[Step], path: tuple[Key, ...], times: int) -> int:
    """How many steps these expand to; refuses the first place with which they are too many."""
    total = 0
    for i, step in enumerate(steps):
        here = (*path, i)
        if isinstance(step, BlockStep):
            inside = times * step.repeat
            total += (
                step.repeat if inside > MAX_STEPS else step.repeat * _check_count(step.steps, (*here, "steps"), inside)
            )
            here = (*here, "repeat")
        else:
            total += 1
        if total * times > MAX_STEPS:
            raise FieldError(here, f"the steps are more than {MAX_STEPS} with this", "repeat fewer times")
    return total


def load_protocol(name_or_path: str | Path) -> Protocol:
    """A protocol by file or shipped name; raises `InputError`."""
    document = read_yaml(find_file("protocol", name_or_path))
    protocol = validate(document, Protocol)
    protocol._text, protocol._source, protocol._places = document.text, document.path, document.places
    return protocol


BlockStep.model_rebuild()
Protocol.model_rebuild()
