"""What the bench asks of a load cell and its amplifier, whatever speaks to it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Protocol

from drivers.wire import Link, Steps


@dataclass(frozen=True, slots=True)
class LoadCellIdentity:
    """What the device says it is; `details` keeps vendor facts for the recording."""

    model: str
    details: dict[str, Any] = field(default_factory=dict)


@dataclass(slots=True)
class ForceSample:
    """One reading of the amplifier in newtons, positive in compression, scale and sign of the bench file applied.

    `time_s`: when it was measured, on the bench's clock, with known delays of wire and filter taken off;
    `received_s`: when its last byte came. `flags`: the device's own words (`overload`, `stable`, `tared` …).
    The device's gross value is used: taring is the bench's, so that a lost tare cannot go unnoticed.
    """

    time_s: float
    received_s: float
    gross_N: float
    flags: tuple[str, ...] = ()
    overload: bool = False


class LoadCell(Protocol):
    """A load cell that is read continuously or polled; `samples` never blocks."""

    name: str
    link: Link

    def connect(self) -> Steps[LoadCellIdentity]:
        """Identify the device and read its settings (resolution, rate, filter)."""
        ...

    def start(self) -> Steps[None]:
        """Begin measuring at the device's (or the configured) rate."""
        ...

    def samples(self) -> list[ForceSample]:
        """The samples that have come since the last call, oldest first; submits the next poll if it polls."""
        ...

    def stop(self) -> Steps[None]:
        """End continuous output, leave the device quiet."""
        ...

    def latency_s(self) -> float:
        """Longest expected age of the newest sample when the bench sees it, seconds (period + wire + filter)."""
        ...

    def next_poll_s(self) -> float | None:
        """When `samples` wants to be called again to submit a poll (bench clock); None while it waits for bytes."""
        ...
