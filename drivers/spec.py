"""What the bench file says about its two devices: where they are, what they are, how to read them."""

from __future__ import annotations

import difflib
from datetime import date
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, field_validator, model_validator

from drivers.maps import shipped_maps

Positive = Annotated[FiniteFloat, Field(gt=0)]
Parity = Literal["N", "E", "O"]
RegisterMapSource = str | dict[str, Any]
"""A register map: a file's path, or its content (`registers`); for a shipped map, the keys that differ from it."""

FORCE_UNITS_N = {"N": 1.0, "mN": 1e-3, "kN": 1e3, "g": 9.80665e-3, "kg": 9.80665}
"""Newtons in one unit of what a load cell may be calibrated in; grams and kilograms at standard gravity."""


class _Spec(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")

    driver: str
    port: Annotated[str, Field(min_length=1)]
    baudrate: Annotated[int, Field(gt=0)] | None = None
    parity: Parity | None = None
    gap_us: Annotated[int, Field(ge=0, le=1_000_000)] | None = None
    rate: Positive | None = None
    map: RegisterMapSource | None = None

    @field_validator("driver")
    @classmethod
    def _known_driver(cls, name: str) -> str:
        known = cls.drivers()
        if name not in known:
            near = difflib.get_close_matches(name, known, n=1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            raise ValueError(f"no driver is called {name!r} (there are {', '.join(known)}){hint}")
        return name

    @model_validator(mode="after")
    def _map_fits(self) -> _Spec:
        if self.driver == "registers" and self.map is None:
            raise ValueError("driver 'registers' needs 'map', the register map's file")
        if self.driver in self.built_in() and self.map is not None:
            raise ValueError(f"driver {self.driver!r} takes no 'map'")
        if self.driver not in ("registers", *self.built_in()) and isinstance(self.map, str):
            raise ValueError(
                f"{self.driver!r} is a shipped map already; say 'driver: registers' for a map file, "
                "or give only the keys that differ"
            )
        return self

    @classmethod
    def built_in(cls) -> tuple[str, ...]:
        """Drivers that are code."""
        raise NotImplementedError

    @classmethod
    def drivers(cls) -> tuple[str, ...]:
        """All names `driver` may have."""
        raise NotImplementedError


class MotorSpec(_Spec):
    """`motor:` of a bench file.

    `direction` -1 where the device counts up away from the pad; `moving_mass` in kg; `stroke` in mm, motor frame;
    `gains` are the device's own raw numbers; `rate` is how often the motor is commanded or polled, Hz; `gap_us` the
    silence before each request; `max_speed` (mm/s) and `max_acceleration` (mm/s²) are what the axis can do.
    """

    address: Annotated[int, Field(ge=1, le=247)] = 1
    direction: Literal[1, -1] = 1
    orientation: Literal["horizontal", "vertical"] = "horizontal"
    moving_mass: Positive = 0.5
    stroke: tuple[FiniteFloat, FiniteFloat]
    gains: dict[str, FiniteFloat] | None = None
    safe_state: Literal["release", "hold", "retract"] = "release"
    max_speed: Positive | None = None
    max_acceleration: Positive | None = None

    @field_validator("stroke")
    @classmethod
    def _rising(cls, stroke: tuple[float, float]) -> tuple[float, float]:
        if not stroke[0] < stroke[1]:
            raise ValueError("the lower end of the stroke must lie below the upper one")
        return stroke

    @classmethod
    def built_in(cls) -> tuple[str, ...]:
        """Drivers that are code."""
        return ("orca",)

    @classmethod
    def drivers(cls) -> tuple[str, ...]:
        """All names `driver` may have."""
        return (*cls.built_in(), *shipped_maps("motor"), "registers")


class LoadCellSpec(_Spec):
    """`load_cell:` of a bench file.

    `unit` is what the device's number is calibrated in; force_N = sign · scale · (newtons of the number).
    `capacity` in N: at or beyond it a reading is an overload. `mode` continuous (the device sends by itself) or poll;
    `rate` is the device's own output rate, or how often to poll, Hz; `decimals` the device's decimal places (asked
    for where not given); `checksum: off` takes lines whose checksum does not match.
    """

    address: Annotated[int, Field(ge=0, le=255)] | None = None
    unit: Literal["N", "mN", "kN", "g", "kg"] = "N"
    scale: Positive = 1.0
    sign: Literal[1, -1] = 1
    capacity: Positive
    calibrated_on: date | None = None
    mode: Literal["continuous", "poll"] = "continuous"
    decimals: Annotated[int, Field(ge=0, le=5)] | None = None
    checksum: Literal["strict", "off"] = "strict"

    @field_validator("checksum", mode="before")
    @classmethod
    def _off_is_a_word(cls, value: Any) -> Any:
        # YAML 1.1 readers make a boolean of `off`.
        return "off" if value is False else value

    @property
    def newtons_per_unit(self) -> float:
        """Newtons of bench force for 1 of the device's number: unit, scale and sign together."""
        return FORCE_UNITS_N[self.unit] * self.scale * self.sign

    @classmethod
    def built_in(cls) -> tuple[str, ...]:
        """Drivers that are code."""
        return ("dad141", "mt_sics")

    @classmethod
    def drivers(cls) -> tuple[str, ...]:
        """All names `driver` may have."""
        return (*cls.built_in(), *shipped_maps("load_cell"), "registers")
