"""What a fault is: its kind, when it strikes, its parameters, and how a bench is to come out of it.

A kind is one entry in a family's file, made with `Kind(...)`; being in the file's `KINDS` registers it. Nothing here
imports the physics: a bench file is checked without them.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from sim.faults.site import Site

Device = Literal["motor", "load_cell", "host"]
Outcome = Literal["recovered", "stopped safely", "refused to start"]

RECOVERED: Outcome = "recovered"
STOPPED: Outcome = "stopped safely"
REFUSED: Outcome = "refused to start"

WHEN = ("at_s", "step", "rate_per_s")
COMMON = ("kind", "device", *WHEN, "after_s", "duration_s")


class FaultError(ValueError):
    """A fault that cannot be: which one (`index`), which of its keys, what is wrong, what helps."""

    def __init__(self, index: int, key: str, message: str, cure: str = "") -> None:
        super().__init__(f"faults[{index}]{'.' if key else ''}{key}: {message}{f'; {cure}' if cure else ''}")
        self.index, self.key, self.message, self.cure = index, key, message, cure


@dataclass(frozen=True)
class Parameter:
    """A number (or, with `words`, a word) of a fault; `default` where the file gives none."""

    name: str
    unit: str
    default: float | str
    what: str
    lower: float = -math.inf
    upper: float = math.inf
    words: tuple[str, ...] = ()

    def complaint(self, value: object) -> tuple[str, str] | None:
        """What is wrong with a value, and the cure; None if nothing is."""
        if self.words:
            if value in self.words:
                return None
            return f"there is no `{value}`", nearest(str(value), self.words)
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            return f"`{value}` is not a number", f"give a number of {self.unit}" if self.unit else "give a number"
        if not self.lower <= value <= self.upper:
            return f"{value:g} is outside {self.lower:g} to {self.upper:g}{f' {self.unit}' if self.unit else ''}", ""
        return None


@dataclass(frozen=True)
class Reaction:
    """How a run on a bench is to come out of one fault.

    `fault` is the entry as it stands in a bench file, without `kind` and `device`. `says`: a regular expression that
    the cause (or the refusal) matches. `shows`: of a run that recovers, the counters that tell of the fault, where
    there are any: those of a line (`motor`), or one of the result (`overruns`). `bench` is the shipped bench, `why` the
    reason in words.
    """

    device: Device
    fault: Mapping[str, Any]
    outcome: Outcome
    says: str = ""
    shows: str = ""
    why: str = ""
    bench: str = "simulated"


@dataclass(frozen=True)
class Kind:
    """A kind of fault. `install(fault, site)` makes it happen on a simulated bench; it may raise ValueError.

    `lasting`: whether `duration_s` means something. `frames`: strikes single frames, so that without a duration it is
    one frame; other kinds last to the end then.
    """

    name: str
    what: str
    devices: tuple[Device, ...]
    install: Callable[[Fault, Site], None]
    reactions: tuple[Reaction, ...]
    parameters: tuple[Parameter, ...] = ()
    lasting: bool = True
    frames: bool = False


@dataclass(frozen=True)
class Fault:
    """One entry of `simulation.faults`, checked. Times in seconds of bench time; `step` a step's name or number."""

    kind: Kind
    device: Device
    index: int
    at_s: float | None = None
    step: str | int | None = None
    rate_per_s: float | None = None
    after_s: float = 0.0
    duration_s: float | None = None
    values: Mapping[str, Any] = field(default_factory=dict)

    def number(self, name: str) -> float:
        """A parameter that is a number."""
        return float(self.values[name])

    def word(self, name: str) -> str:
        """A parameter that is a word."""
        return str(self.values[name])


def nearest(word: str, known: Iterable[str]) -> str:
    """`did you mean 'x'?`, or what there is."""
    names = list(known)
    near = difflib.get_close_matches(word, names, n=1, cutoff=0.5)
    return f"did you mean `{near[0]}`?" if near else f"there are: {', '.join(names)}"


def read_fault(spec: Mapping[str, Any], index: int, kinds: Mapping[str, Kind]) -> Fault:
    """One entry of the list, checked. Raises `FaultError`."""
    if "kind" not in spec:
        raise FaultError(index, "kind", "is missing", f"there are: {', '.join(kinds)}")
    name = spec["kind"]
    kind = kinds.get(name) if isinstance(name, str) else None
    if kind is None:
        raise FaultError(index, "kind", f"there is no fault `{name}`", nearest(str(name), kinds))
    own = {parameter.name: parameter for parameter in kind.parameters}
    for key in spec:
        if key not in COMMON and key not in own:
            raise FaultError(
                index, str(key), f"`{kind.name}` has no such parameter", nearest(str(key), [*COMMON, *own])
            )
    device = _device(spec, index, kind)
    given = [key for key in WHEN if spec.get(key) is not None]
    if len(given) != 1:
        message = f"{' and '.join(given)} are given" if given else "nothing says when it strikes"
        raise FaultError(index, given[1] if given else "", message, "give one of at_s, step, rate_per_s")
    if spec.get("after_s") is not None and given != ["step"]:
        raise FaultError(index, "after_s", "counts from the beginning of a step", "give `step` with it")
    if spec.get("duration_s") is not None and not kind.lasting:
        raise FaultError(index, "duration_s", f"`{kind.name}` happens at once and does not last", "leave it out")
    step = spec.get("step")
    if step is not None and (isinstance(step, bool) or not isinstance(step, str | int)):
        raise FaultError(index, "step", f"`{step}` is no step", "give a step's name (`approach`, `steps[0]`) or number")
    values: dict[str, Any] = {}
    for parameter in kind.parameters:
        value = spec.get(parameter.name, parameter.default)
        complaint = parameter.complaint(value)
        if complaint is not None:
            raise FaultError(index, parameter.name, *complaint)
        values[parameter.name] = value
    return Fault(
        kind,
        device,
        index,
        at_s=_seconds(spec, "at_s", index),
        step=step,
        rate_per_s=_seconds(spec, "rate_per_s", index, above=True),
        after_s=_seconds(spec, "after_s", index) or 0.0,
        duration_s=_seconds(spec, "duration_s", index, above=True),
        values=values,
    )


def _device(spec: Mapping[str, Any], index: int, kind: Kind) -> Device:
    given = spec.get("device")
    if given is None and len(kind.devices) == 1:
        return kind.devices[0]
    for device in kind.devices:
        if device == given:
            return device
    message = "is missing" if given is None else f"`{given}` cannot have the fault `{kind.name}`"
    raise FaultError(index, "device", message, f"it is a fault of: {', '.join(kind.devices)}")


def _seconds(spec: Mapping[str, Any], key: str, index: int, *, above: bool = False) -> float | None:
    value = spec.get(key)
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise FaultError(index, key, f"`{value}` is not a number", "give seconds" if key[-5:] != "per_s" else "")
    if value < 0 or (above and value == 0):
        raise FaultError(index, key, f"{value:g} is {'not greater than' if above else 'less than'} 0")
    return float(value)
