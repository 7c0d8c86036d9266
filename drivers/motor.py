"""What the bench asks of a linear motor, whatever speaks to it.

Positions are millimetres in the motor frame as the *device* counts them, with the bench file's
`direction` applied, so that positive always points into the pad. A driver never rewrites the device's zero.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, Protocol

from drivers.wire import Exchange, Link, Steps

SafeState = Literal["release", "hold", "retract"]

STREAMED = ("orca",)
"""Drivers of kind "stream", in a bench file's words: known before a device is opened, and from a recording."""

RAREST_Hz = 400.0
"""Positions a second that make a motion of a stream: a position loop settles within some 2 ms, and stands between."""


@dataclass(frozen=True, slots=True)
class MotorIdentity:
    """What the device says it is; `details` keeps vendor facts (serial number, firmware) for the recording."""

    model: str
    details: dict[str, Any]


@dataclass(frozen=True, slots=True)
class MotorLimits:
    """Clamps that are written to the device, where it has registers for them, and read back."""

    speed_mm_s: float
    acceleration_mm_s2: float
    force_N: float
    position_mm: tuple[float, float]
    watchdog_s: float


@dataclass(slots=True)
class MotorSample:
    """One reading of the axis.

    `time_s`: when it was measured, on the bench's clock; `received_s`: when the reply was complete.
    `force_N` is the motor's own estimate, positive into the pad's resistance, or None.
    `fault`: raw device error word (0 = none).
    """

    time_s: float
    received_s: float
    position_mm: float
    force_N: float | None = None
    fault: int = 0
    moving: bool | None = None


class Motor(Protocol):
    """A linear axis.

    `kind` "stream": the host sends a position every tick (`stream`), the reply is a sample.
    `kind` "move": the device makes the profile itself (`move`), the host polls (`read`).
    Methods return either one `Exchange` (submit it to `link`) or `Steps` (a generator of exchanges
    and pauses, run by `wire.complete` or by the bench's loop).
    """

    name: str
    link: Link
    kind: Literal["stream", "move"]

    def connect(self) -> Steps[MotorIdentity]:
        """Identify the device; raises `DriverError` when it is not what the bench file says."""
        ...

    def prepare(self, limits: MotorLimits) -> Steps[dict[str, Any]]:
        """Write clamps and watchdog, read them back; returns what the device now holds, for the recording."""
        ...

    def held(self) -> Steps[None]:
        """Read back what `prepare` wrote once more; raises `ReadbackError` where the device has forgotten it."""
        ...

    def energise(self) -> Steps[None]:
        """Clear transient faults, close the position loop at the present position, without moving."""
        ...

    def is_homed(self) -> Steps[bool]:
        """Whether the device knows where it is."""
        ...

    def home(self) -> Steps[None]:
        """Home, and wait for the end of it; raises `DeviceFault` where the device reports failure."""
        ...

    def read(self) -> Exchange[MotorSample]:
        """One sample, without commanding anything."""
        ...

    def stream(self, position_mm: float) -> Exchange[MotorSample]:
        """Command a position now, get a sample ("stream" only). Also feeds the device's watchdog."""
        ...

    def move(self, target_mm: float, speed_mm_s: float, acceleration_mm_s2: float) -> Steps[None]:
        """Start a trapezoid move; returns when the device has taken it ("move" only)."""
        ...

    def stop(self) -> Steps[None]:
        """Decelerate now and hold the position reached, as fast as the device's protocol allows."""
        ...

    def safe_state(self, state: SafeState) -> Steps[dict[str, Any]]:
        """Bring the device into the state and prove it by reading back; raises `ReadbackError`.

        "retract" is a motion: the bench makes it first, then asks for "hold"; drivers treat it as "hold".
        """
        ...

    def fault_names(self, fault: int) -> tuple[str, ...]:
        """Names of the bits set in a sample's fault word."""
        ...
