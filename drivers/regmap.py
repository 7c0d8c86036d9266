"""The form of a register map: what a YAML file says about a device, so that it needs no code.

A map says how the device is reached (`link`, `reply`), which registers one poll reads (`blocks`), what is in them
(`values`, `bits`), and what to write for each verb of the driver (`energise`, `home`, `move`, `stop`, `hold`,
`release`), as lists of steps. Some names have a meaning to the driver:

- values `position` (mm), `force` (of a motor, N), `fault` (a word, 0 = none); of a load cell `gross`;
- bits `servo_on`, `homed`, `moving`;
- `codes`: what the numbers of `fault` mean;
- in steps that write, `from:` one of `target`, `speed`, `acceleration`, or a name from `constants`.

See `drivers/maps/iai.yaml` for one in full.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, FiniteFloat, field_validator, model_validator

from drivers.maps import shipped_map
from drivers.values import UNITS, WORDS, NumberType, WordOrder

Address = Annotated[int, Field(ge=0, le=0xFFFF)]
Table = Literal["holding", "input", "coil", "discrete"]

MOVE_VARIABLES = frozenset({"target", "speed", "acceleration"})
"""What `move` hands to its steps, in mm, mm/s, mm/s²."""


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


def _known_unit(unit: object) -> str:
    if not isinstance(unit, str) or unit not in UNITS:
        raise ValueError(f"unknown unit {unit!r}; there are {', '.join(name for name in UNITS if name)}")
    return unit


Unit = Annotated[str, BeforeValidator(_known_unit)]


class LinkMap(_Part):
    """How the device is reached as delivered; the bench file may override each."""

    transport: Literal["rtu", "tcp"] = "rtu"
    baudrate: Annotated[int, Field(gt=0)] = 38400
    parity: Literal["N", "E", "O"] = "N"
    stopbits: Literal[1, 2] = 1
    gap_us: Annotated[int, Field(ge=0)] | None = None


class ReplyMap(_Part):
    """How long the device may take before it answers: factor · processing + delay (times in ms)."""

    processing_ms: Annotated[FiniteFloat, Field(ge=0)] = 10.0
    factor: Annotated[FiniteFloat, Field(ge=1)] = 1.0
    delay_ms: Annotated[FiniteFloat, Field(ge=0)] = 0.0

    @property
    def turnaround_s(self) -> float:
        """Longest time between the end of a request and the beginning of its reply, seconds."""
        return 1e-3 * (self.factor * self.processing_ms + self.delay_ms)


class Block(_Part):
    """Neighbouring registers (or coils) that one request reads."""

    table: Table = "holding"
    address: Address
    count: Annotated[int, Field(ge=1, le=125)]

    def has(self, table: Table, address: int, words: int = 1) -> bool:
        """Whether so many registers from an address lie in the block."""
        return table == self.table and self.address <= address and address + words <= self.address + self.count


class Value(_Part):
    """A number in registers: raw · scale, in `unit`.

    `negative`: the register has the number without its sign, and it is negative where this bit is on.
    """

    address: Address
    table: Literal["holding", "input"] = "holding"
    type: NumberType = "u16"
    scale: FiniteFloat = 1.0
    unit: Unit = ""
    negative: str | None = None

    @property
    def words(self) -> int:
        """Registers it takes."""
        return WORDS[self.type]

    @property
    def factor(self) -> float:
        """Base units (mm, mm/s, mm/s², N, s) in one count."""
        return self.scale * UNITS[self.unit]


class Bit(_Part):
    """A bit of a register (`address`, `bit`), a coil or a discrete input; `true_when: 0` for active-low ones."""

    address: Address
    table: Table = "holding"
    bit: Annotated[int, Field(ge=0, le=15)] | None = None
    true_when: Literal[0, 1] = 1

    @model_validator(mode="after")
    def _bit_of_what(self) -> Bit:
        if (self.bit is None) != (self.table in ("coil", "discrete")):
            raise ValueError("a bit of a register needs 'bit'; one of table 'coil' or 'discrete' has none")
        return self


class Written(_Part):
    """A number to write: a variable (`from`) or a constant (`to`), in `unit`, as raw = value / scale, rounded.

    `min` and `max` bound the raw number: beyond them the move is refused, never clipped."""

    variable: Annotated[str | None, Field(alias="from")] = None
    to: FiniteFloat | None = None
    type: NumberType = "u16"
    scale: Annotated[FiniteFloat, Field(gt=0)] = 1.0
    unit: Unit = ""
    min: FiniteFloat | None = None
    max: FiniteFloat | None = None

    @model_validator(mode="after")
    def _one_source(self) -> Written:
        if (self.variable is None) == (self.to is None):
            raise ValueError("a written number needs either 'from' (a variable) or 'to' (a constant)")
        return self

    @property
    def factor(self) -> float:
        """Base units in one count."""
        return self.scale * UNITS[self.unit]


class _Write(_Part):
    """What all writes have.

    `edge`: the device acts on the change, so that it is never sent twice. `when`: only where these bits, read just
    before, are as said.
    """

    edge: bool = False
    when: dict[str, bool] = {}


class WriteCoil(_Write):
    """Write one coil."""

    coil: Address
    to: bool


class WriteRegister(_Write):
    """Write one register by function 06."""

    register_: Annotated[Address, Field(alias="register")]
    to: Annotated[int, Field(ge=0, le=0xFFFF)]


class WriteBlock(_Write):
    """Write neighbouring registers in one message, by function 16."""

    registers: Address
    fields: Annotated[list[Written], Field(min_length=1)]


class Wait(_Part):
    """Read until all the bits are as said; failed after `within_s`, or where the position stands for `stuck_s`."""

    wait: Annotated[dict[str, bool], Field(min_length=1)]
    within_s: Annotated[FiniteFloat, Field(gt=0)]
    every_s: Annotated[FiniteFloat, Field(gt=0)] = 0.02
    stuck_s: Annotated[FiniteFloat, Field(gt=0)] | None = None
    message: str = "the device does not get there"


class Check(_Part):
    """Read once; the bits must be as said."""

    check: Annotated[dict[str, bool], Field(min_length=1)]
    message: str


class Compare(_Part):
    """Read a value back; it must be what was written (a variable or a number, in base units) within `tolerance`."""

    readback: str
    equals: str | FiniteFloat
    tolerance: Annotated[FiniteFloat, Field(ge=0)] = 0.0


class PauseStep(_Part):
    """Wait so long."""

    pause_s: Annotated[FiniteFloat, Field(gt=0)]


_STEPS: dict[str, type[_Part]] = {
    "coil": WriteCoil,
    "register": WriteRegister,
    "registers": WriteBlock,
    "wait": Wait,
    "check": Check,
    "readback": Compare,
    "pause_s": PauseStep,
}


def _step(item: Any) -> Any:
    """Choose the step's form by the key that only it has, so that a mistake in it is reported for that form."""
    if not isinstance(item, dict):
        return item
    found = [name for name in _STEPS if name in item]
    if len(found) != 1:
        raise ValueError(f"a step has exactly one of the keys {', '.join(_STEPS)}")
    return _STEPS[found[0]].model_validate(item)


AnyStep = WriteCoil | WriteRegister | WriteBlock | Wait | Check | Compare | PauseStep
Step = Annotated[AnyStep, BeforeValidator(_step)]
Sequence = list[Step]


class Action(_Part):
    """What a device can do beyond the driver's verbs (`RegisterMotor.perform`): steps, and the variables they take."""

    takes: list[str] = []
    steps: Annotated[Sequence, Field(min_length=1)]


class _DeviceMap(_Part):
    name: str
    title: str = ""
    link: LinkMap = LinkMap()
    reply: ReplyMap = ReplyMap()
    word_order: WordOrder = "high_first"
    poll_rate: Annotated[FiniteFloat, Field(gt=0)] = 50.0
    blocks: Annotated[dict[str, Block], Field(min_length=1)]
    values: dict[str, Value]
    bits: dict[str, Bit] = {}
    identify: list[str] = []

    def block_of(self, item: Value | Bit) -> str | None:
        """Name of the block that reads a value or bit, or None."""
        words = item.words if isinstance(item, Value) else 1
        for name, block in self.blocks.items():
            if block.has(item.table, item.address, words):
                return name
        return None

    def _must_know(self, names: list[str], known: dict[str, Any], where: str) -> None:
        for name in names:
            if name not in known:
                raise ValueError(f"{where}: there is no {name!r} (known: {', '.join(known) or 'none'})")

    @model_validator(mode="after")
    def _bits_are_read(self) -> _DeviceMap:
        for name, bit in self.bits.items():
            if self.block_of(bit) is None:
                raise ValueError(f"bit {name!r} lies in no block")
        for name, value in self.values.items():
            if value.negative is None:
                continue
            self._must_know([value.negative], self.bits, f"values.{name}")
            if self.block_of(value) is None or self.block_of(self.bits[value.negative]) != self.block_of(value):
                raise ValueError(f"value {name!r} and the bit of its sign must lie in one block")
            if name in self.identify:
                raise ValueError(f"value {name!r} is read by itself under identify, without the bit of its sign")
        self._must_know(self.identify, self.values, "identify")
        return self


class MotorMap(_DeviceMap):
    """A motor that makes its own profiles, described by registers."""

    device: Literal["motor"]
    faults: list[str] = []
    codes: dict[int, str] = {}
    clamps: dict[Literal["speed", "acceleration", "force", "position_low", "position_high", "watchdog"], str] = {}
    constants: dict[str, FiniteFloat] = {}
    connect: Sequence = []
    energise: Sequence
    home: Sequence = []
    move: Sequence
    stop: Sequence
    hold: Sequence
    release: Sequence
    actions: dict[str, Action] = {}

    @field_validator("constants")
    @classmethod
    def _no_clash(cls, constants: dict[str, float]) -> dict[str, float]:
        clash = MOVE_VARIABLES & constants.keys()
        if clash:
            raise ValueError(f"{', '.join(sorted(clash))} cannot be constants")
        return constants

    @model_validator(mode="after")
    def _complete(self) -> MotorMap:
        self._must_know(["position"], self.values, "values")
        block = self.block_of(self.values["position"])
        if block is None:
            raise ValueError("value 'position' lies in no block")
        for name in ("force", "fault"):
            if name in self.values and self.block_of(self.values[name]) != block:
                raise ValueError(f"value {name!r} must lie in the block of 'position', to be of the same moment")
        self._must_know(["servo_on"], self.bits, "bits")
        self._must_know(self.faults, self.bits, "faults")
        self._must_know(list(self.clamps.values()), self.values, "clamps")
        signed = [name for name in self.clamps.values() if self.values[name].negative is not None]
        if signed:
            raise ValueError(f"clamps: {signed[0]!r} is written as it is, and cannot have its sign in a bit")
        for verb in ("connect", "energise", "home", "move", "stop", "hold", "release"):
            for number, step in enumerate(getattr(self, verb)):
                self._check_step(step, f"{verb}[{number}]", MOVE_VARIABLES if verb == "move" else ())
        for name, action in self.actions.items():
            clash = self.constants.keys() & set(action.takes)
            if clash:
                raise ValueError(f"actions.{name}: {', '.join(sorted(clash))} is a constant already")
            for number, step in enumerate(action.steps):
                self._check_step(step, f"actions.{name}[{number}]", action.takes)
        return self

    def _check_step(self, step: AnyStep, where: str, given: Iterable[str]) -> None:
        variables: dict[str, Any] = {**self.constants, **dict.fromkeys(given)}
        if isinstance(step, _Write):
            self._must_know(list(step.when), self.bits, where)
        if isinstance(step, Wait):
            self._must_know(list(step.wait), self.bits, where)
        elif isinstance(step, Check):
            self._must_know(list(step.check), self.bits, where)
        elif isinstance(step, Compare):
            self._must_know([step.readback], self.values, where)
            if isinstance(step.equals, str):
                self._must_know([step.equals], variables, where)
        elif isinstance(step, WriteBlock):
            names = [field.variable for field in step.fields if field.variable is not None]
            self._must_know(names, variables, where)


class LoadCellMap(_DeviceMap):
    """A load-cell amplifier that is polled, described by registers; `gross` is in the bench file's unit."""

    device: Literal["load_cell"]
    flags: list[str] = []
    overload: list[str] = []

    @model_validator(mode="after")
    def _complete(self) -> LoadCellMap:
        self._must_know(["gross"], self.values, "values")
        gross = self.values["gross"]
        if self.block_of(gross) is None:
            raise ValueError("value 'gross' lies in no block")
        if gross.unit:
            raise ValueError("value 'gross' has no unit here: it is the bench file's")
        self._must_know([*self.flags, *self.overload], self.bits, "flags, overload")
        for name in (*self.flags, *self.overload):
            if self.block_of(self.bits[name]) != self.block_of(gross):
                raise ValueError(f"bit {name!r} must lie in the block of 'gross', to be of the same moment")
        return self


def load_map(driver: str, source: str | dict[str, Any] | None, device: Literal["motor", "load_cell"]) -> Any:
    """The map for a driver name: a shipped one with what `source` says otherwise, or `source` itself.

    `source` may be a file's path. Laid over a shipped map, its mappings are merged, lists and numbers replaced.
    Returns a `MotorMap` or a `LoadCellMap`. Raises `OSError` for a file that cannot be read and `ValueError`
    (pydantic's, or a YAML reader's) for a map that cannot be used.
    """
    if isinstance(source, str):
        from pathlib import Path

        import yaml

        try:
            content = yaml.safe_load(Path(source).read_text("utf-8"))
        except yaml.YAMLError as error:
            raise ValueError(f"{source}: {error}") from error
    else:
        content = dict(source or {})
    if driver != "registers":
        content = _merged(shipped_map(driver), content)
    kind: type[_DeviceMap] = MotorMap if device == "motor" else LoadCellMap
    return kind.model_validate(content)


def _merged(base: Any, over: Any) -> Any:
    if not (isinstance(base, dict) and isinstance(over, dict)):
        return over
    return {**base, **{key: _merged(base[key], value) if key in base else value for key, value in over.items()}}
