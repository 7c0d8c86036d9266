"""The bench file: which devices, within which limits, and, for a simulated bench, what is true."""

from __future__ import annotations

import re
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import (
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    PrivateAttr,
    Tag,
    ValidationError,
    WithJsonSchema,
    model_validator,
)

from bench.complaints import FieldError, complaints
from bench.errors import InputError
from bench.places import Key, Places
from bench.protocol import Name, NotNegative, Number, Positive, Word
from bench.shipped import find_file, find_shipped, shipped_names
from bench.yamlfile import Document, read_yaml, validate
from drivers.regmap import LoadCellMap, MotorMap, load_map
from drivers.spec import LoadCellSpec, MotorSpec
from sim.faults import FaultError, fault_schema, read_faults

if TYPE_CHECKING:
    from sim.model import Model

DEFAULT_BENCH, DEFAULT_PAD = "simulated", "polyurethane"


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Limits(_Part):
    """What must never be crossed; `position` in the motor frame, `stale` the age of data that stops a run."""

    force: Positive = Field(description="N, compression, of the net force; gross is held to load_cell.capacity")
    tension: NotNegative = Field(5.0, description="N, pull")
    position: tuple[Number, Number] = Field(description="mm, motor frame: lowest, highest")
    speed: Positive = Field(description="mm/s")
    acceleration: Positive = Field(description="mm/s²")
    jerk: Positive | None = Field(None, description="mm/s³")
    following_error: Positive = Field(0.5, description="mm")
    stale: Positive = Field(0.05, description="s")

    @model_validator(mode="after")
    def _ordered(self) -> Limits:
        lowest, highest = self.position
        if not lowest < highest:
            raise FieldError(("position",), f"the first ({lowest:g}) must be less than the second ({highest:g})")
        return self


Delay = Annotated[float, Field(gt=-1, lt=1, allow_inf_nan=False)]


class Timing(_Part):
    """How late each channel's values are, in seconds, beyond what its driver knows; written by `doctor`."""

    force_delay: Delay = 0.0
    position_delay: Delay = 0.0
    measured_on: date | None = None


class Probe(_Part):
    """What touches the pad; `radius` in mm."""

    id: Word = ""
    shape: Word = "sphere"
    radius: Positive | None = None


class Machine(_Part):
    """The bench's mechanics; `frame_stiffness` in N/mm, None: not measured."""

    frame_stiffness: Positive | None = None
    probe: Probe = Field(default_factory=Probe)


class Noise(_Part):
    """Standard deviations of the simulated channels, and the load cell's zero drift (N/s)."""

    force: NotNegative = Field(0.01, description="N")
    position: NotNegative = Field(0.0005, description="mm")
    drift: Number = Field(0.0, description="N/s")


Surface = Annotated[
    Annotated[Number, Tag("height")] | Annotated[Literal["random"], Tag("any height")],
    Discriminator(lambda value: "any height" if isinstance(value, str) else "height"),
]


SimulatedFault = Annotated[dict[str, Any], WithJsonSchema(fault_schema())]


class Simulation(_Part):
    """The truth behind `sim://` ports; nothing but the simulated devices reads it."""

    seed: Annotated[int, Field(ge=0)] = 1
    clock: Literal["virtual", "wall"] = "virtual"
    pad: Word = Field(DEFAULT_PAD, description="a model file (relative to the bench file), or a shipped pad's name")
    surface: Surface = Field("random", description="mm, motor frame")
    noise: Noise = Field(default_factory=Noise)
    faults: list[SimulatedFault] = Field(default_factory=list, description="what goes wrong (docs/faults.md)")

    @model_validator(mode="after")
    def _known_faults(self) -> Simulation:
        try:
            read_faults(self.faults)
        except FaultError as error:
            path: tuple[Key, ...] = ("faults", error.index, error.key) if error.key else ("faults", error.index)
            raise FieldError(path, error.message, error.cure) from None
        return self


class Bench(_Part):
    """A bench file."""

    name: Name
    description: Word = ""
    motor: MotorSpec
    load_cell: LoadCellSpec
    limits: Limits
    timing: Timing = Field(default_factory=Timing)
    machine: Machine = Field(default_factory=Machine)
    simulation: Simulation | None = None

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

    def place(self, path: tuple[Key, ...]) -> str:
        """`file:line:column` of a part of the bench file; the bench's name where it came from no file."""
        return self._places.place(path) if self._places else self.name

    @property
    def sim_name(self) -> str | None:
        """NAME of `sim://NAME/motor`, or None where the motor is a real one."""
        return _sim_name(self.motor.port)

    @property
    def all_simulated(self) -> bool:
        """Both ports are `sim://`: nothing can be hurt."""
        return self.motor.port.startswith("sim://") and self.load_cell.port.startswith("sim://")

    @property
    def pad_file(self) -> Path | None:
        """The model file of the simulated pad; raises `InputError` where there is none."""
        if self.simulation is None:
            return None
        name = self.simulation.pad
        if self._source is not None and _is_file(self._source.parent / name):
            return self._source.parent / name
        shipped = find_shipped("pad", name)
        if shipped is not None:
            return shipped
        cure = f"it is relative to the bench file; shipped pads: {', '.join(shipped_names('pad'))}"
        raise InputError(self.place(("simulation", "pad")), f"simulation.pad: there is no file `{name}`", cure)

    @model_validator(mode="after")
    def _consistent(self) -> Bench:
        self._check_travel()
        self._check_force()
        for what in ("speed", "acceleration"):
            most: float | None = getattr(self.motor, f"max_{what}")
            asked: float = getattr(self.limits, what)
            if most is not None and asked > most:
                message = f"{asked:g} is more than motor.max_{what} {most:g}"
                raise FieldError(("limits", what), message, "lower the limit to what the motor can do")
        if self.simulation is None:
            for key in ("motor", "load_cell"):
                if getattr(self, key).port.startswith("sim://"):
                    raise FieldError((key, "port"), "is simulated, but there is no `simulation` block", "add one")
        return self

    def _check_travel(self) -> None:
        (lowest, highest), (first, last) = self.limits.position, self.motor.stroke
        if lowest < first or highest > last:
            message = f"[{lowest:g}, {highest:g}] reaches beyond motor.stroke [{first:g}, {last:g}]"
            raise FieldError(("limits", "position"), message, "narrow the limit to what the axis can travel")

    def _check_force(self) -> None:
        for what in ("force", "tension"):
            limit: float = getattr(self.limits, what)
            if limit > self.load_cell.capacity:
                message = f"{limit:g} N is beyond load_cell.capacity {self.load_cell.capacity:g} N"
                raise FieldError(("limits", what), message, "the limit must protect the load cell: lower it")


def load_bench(name_or_path: str | Path | None = None) -> Bench:
    """A bench by file or shipped name; raises `InputError`. None: `simulated`, as shipped."""
    default = find_shipped("bench", DEFAULT_BENCH) if name_or_path is None else None
    document = read_yaml(default or find_file("bench", name_or_path or DEFAULT_BENCH))
    bench = validate(document, Bench)
    bench = bench.model_copy(update={key: _with_map(bench, key, document) for key in ("motor", "load_cell")})
    bench._text, bench._source, bench._places = document.text, document.path, document.places
    if bench.pad_file is not None:  # found now rather than when the devices start
        load_model(bench.pad_file)
    return bench


def _is_file(path: Path) -> bool:
    """Whether there is such a file; a name that no file can have (too long, a zero byte) is that of none."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def _with_map(bench: Bench, key: Literal["motor", "load_cell"], document: Document) -> MotorSpec | LoadCellSpec:
    """The device's spec with its register map read, if it names a file, and checked."""
    spec: MotorSpec | LoadCellSpec = getattr(bench, key)
    if isinstance(spec.map, str):
        path = document.path.parent / spec.map
        if not _is_file(path):
            cure = "it is relative to the bench file"
            raise document.error((key, "map"), f"there is no file `{spec.map}`", cure)
        content = read_yaml(path)
        validate(content, MotorMap if key == "motor" else LoadCellMap)
        return spec.model_copy(update={"map": content.data})
    if spec.driver not in spec.built_in():
        try:
            load_map(spec.driver, spec.map, key)
        except ValidationError as error:
            places = Places(document.path.name, {(): (1, 1)})
            message = complaints(error, MotorMap if key == "motor" else LoadCellMap, places).message
            raise document.error((key, "map"), message) from None
        except ValueError as error:
            raise document.error((key, "map"), str(error)) from None
    return spec


def load_model(name_or_path: str | Path) -> Model:
    """A pad model by file or shipped name; raises `InputError`."""
    from sim.model import Model  # the physics take a moment to import; whoever needs no pad does without

    return validate(read_yaml(find_file("pad", name_or_path)), Model)


def _sim_name(port: str) -> str | None:
    """NAME of `sim://NAME/KEY`, or None."""
    match = re.match(r"sim://([^/?]+)", port)
    return match[1] if match else None


def ports_agree(bench: Bench) -> None:
    """Raises `InputError` where one port is simulated and the other real or of another world, or has no name."""
    ports = {"motor": bench.motor.port, "load_cell": bench.load_cell.port}
    unreal = [key for key, port in ports.items() if port.startswith("sim://")]
    if not unreal:
        return
    for key in ports:
        if key not in unreal:
            message = f"{key}.port is real, and the other one is simulated: they share neither pad nor time"
            cure = "make both real, or both simulated (--simulated does)"
            raise InputError(bench.place((key, "port")), message, cure)
    for key, port in ports.items():
        if _sim_name(port) is None:
            message = f"{key}.port: `{port}` names no simulated bench"
            raise InputError(bench.place((key, "port")), message, f"write sim://NAME/{key}")
    if bench.sim_name != _sim_name(bench.load_cell.port):
        message = f"load_cell.port is of another simulated bench than motor.port ({ports['motor']})"
        raise InputError(bench.place(("load_cell", "port")), message, f"write sim://{bench.sim_name}/load_cell")
    for key, port in ports.items():
        if port != f"sim://{bench.sim_name}/{key}":
            message = f"{key}.port: there is no simulated device at {port}"
            raise InputError(bench.place((key, "port")), message, f"write sim://{bench.sim_name}/{key}")


def simulated(bench: Bench) -> Bench:
    """A dry run of `bench`: its drivers, rates and limits behind `sim://` ports, and a default truth if it has none."""
    own = re.sub(r"[^A-Za-z0-9_-]", "-", bench.name)
    name = _sim_name(bench.motor.port) or _sim_name(bench.load_cell.port) or own
    ports = {
        key: spec.model_copy(update={"port": f"sim://{name}/{key}"})
        for key, spec in (("motor", bench.motor), ("load_cell", bench.load_cell))
    }
    # model_copy keeps the private text and source: a simulation.pad stays relative to the bench file
    return bench.model_copy(update={**ports, "simulation": bench.simulation or Simulation()})
