"""What the devices said, kept in memory: for commands that look at a bench and record no run."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.recording.schemas import POLLED
from bench.recording.types import Event, ForceChannel, MotorChannel, Recording, StepMark

Array = NDArray[np.float64]


@dataclass
class Notebook:
    """A `Sink` that writes nothing to disk; `motor_channel` and `force_channel` give what came since `clear`."""

    events: list[Event] = field(default_factory=list)
    marks: list[StepMark] = field(default_factory=list)
    _motor: list[tuple[float, float, float, float, float]] = field(default_factory=list)
    _force: list[tuple[float, float, float, float, bool]] = field(default_factory=list)
    flags: dict[str, int] = field(default_factory=dict)
    """How many force samples carried each of the device's words."""

    def motor(
        self, time_s: float, received_s: float, position_mm: float, command_mm: float, force_N: float | None
    ) -> None:
        """One motor sample."""
        self._motor.append((time_s, position_mm, command_mm, np.nan if force_N is None else force_N, received_s))

    def force(
        self,
        time_s: float,
        received_s: float,
        net_N: float,
        gross_N: float,
        flags: tuple[str, ...] = (),
        overload: bool = False,
    ) -> None:
        """One load-cell sample."""
        self._force.append((time_s, net_N, gross_N, received_s, overload))
        for flag in flags:
            self.flags[flag] = self.flags.get(flag, 0) + 1

    def event(self, time_s: float, name: str, data: dict[str, Any]) -> None:
        """Something that happened."""
        self.events.append(Event(time_s, name, data))

    def step(self, mark: StepMark) -> None:
        """A stretch begins."""
        self.marks.append(mark)

    def tick(self, now_s: float) -> None:
        """Nothing to flush."""

    def problem(self) -> str | None:
        """Memory takes everything."""
        return None

    def clear(self) -> None:
        """Forget samples and marks so far; events stay."""
        self.marks.clear()
        self._motor.clear()
        self._force.clear()
        self.flags.clear()

    def data_of(self, name: str) -> dict[str, Any] | None:
        """The numbers of the last event of a name, None where there was none."""
        return next((event.data for event in reversed(self.events) if event.name == name), None)

    def recording(self, name: str, surface_mm: float, surface_std_mm: float) -> Recording:
        """What came since `clear` as a recording (of the same times), with a surface (motor frame)."""
        motor, cell = self.motor_channel(), self.force_channel()
        begun_s = min(motor.time_s[0], cell.time_s[0])
        return Recording(
            Path(name),
            motor,
            cell,
            events=[event for event in self.events if event.time_s >= begun_s or event.name == POLLED],
            steps=list(self.marks),
            surface_mm=surface_mm,
            surface_std_mm=surface_std_mm,
        )

    def motor_channel(self) -> MotorChannel:
        """Motor samples since `clear`, arrays of shape (n,)."""
        rows = np.array(self._motor, dtype=float).reshape(-1, 5).T
        return MotorChannel(rows[0], rows[1], rows[2], rows[3], rows[4])

    def force_channel(self) -> ForceChannel:
        """Force samples since `clear`, arrays of shape (n,)."""
        rows = np.array(self._force, dtype=float).reshape(-1, 5).T
        return ForceChannel(rows[0], rows[1], rows[2], rows[3], rows[4].astype(bool))
