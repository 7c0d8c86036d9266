"""What a run leaves behind, in memory: one type for MCAP, run folders and CSV.

All times are seconds on the bench's clock (0 = the recording's epoch); nothing here is resampled.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass
class MotorChannel:
    """Samples of the axis, motor frame; all arrays of shape (n,).

    `time_s`: when measured; `received_s`: when the host had it; `command_mm`: the position commanded at `time_s`
    (NaN where none was); `force_N`: the motor's own estimate (NaN where it senses none).
    """

    time_s: Array
    position_mm: Array
    command_mm: Array
    force_N: Array
    received_s: Array


@dataclass
class ForceChannel:
    """Samples of the load cell, shape (n,): `force_N` net of the tare, `gross_N` as read; `flagged` where the device
    itself called the sample bad (overload)."""

    time_s: Array
    force_N: Array
    gross_N: Array
    received_s: Array
    flagged: NDArray[np.bool_]


@dataclass(frozen=True)
class Event:
    """Something that happened: `name` in snake_case (`tare`, `touch_off`, `limit`, `stopped` …) with its numbers."""

    time_s: float
    name: str
    data: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class StepMark:
    """Start of a stretch of the run. `phase`: tare, approach, precondition, steps, finish.

    `kind`: ramp, hold, force_ramp, force_hold, air. `name` is the protocol's own (`steps[2]`, `cycle[1].steps[0]`).
    `target_mm` (pad frame) and `speed_mm_s` are NaN where they do not apply.
    """

    time_s: float
    name: str
    phase: str
    kind: str
    target_mm: float = float("nan")
    speed_mm_s: float = float("nan")


@dataclass
class Recording:
    """One run, or one CSV file.

    `surface_mm` is where the pad's surface stands in the motor frame, by touch-off (`surface_std_mm` its standard
    deviation); None while it is not known. CSV data are in the pad frame already: surface 0, std 0.
    `run` is the `padbench.run` record, `result` the `padbench.result` record (None: the run did not finish, or
    there was none: CSV). The truth of a simulated bench (`padbench.simulation`) is not here: no fit may see it.
    """

    source: Path
    motor: MotorChannel
    load_cell: ForceChannel
    events: list[Event] = field(default_factory=list)
    steps: list[StepMark] = field(default_factory=list)
    surface_mm: float | None = None
    surface_std_mm: float = 0.0
    run: dict[str, str] = field(default_factory=dict)
    result: dict[str, str] | None = None
    host: dict[str, str] = field(default_factory=dict)
    """The `padbench.host` record: wall-clock start and versions, what may differ between two runs of one seed."""
    attachments: dict[str, bytes] = field(default_factory=dict)
    extra: dict[str, Array] = field(default_factory=dict)
    """Further columns of a CSV file, shape (k,) each, at `extra_time_s`; NaN where a cell is empty."""
    extra_text: dict[str, list[str]] = field(default_factory=dict)
    """Further columns that are not numbers, likewise."""
    extra_time_s: Array = field(default_factory=lambda: np.empty(0))
    notes: list[str] = field(default_factory=list)
    """What was taken for what on reading (separators, units), in plain words."""
    lost: str | None = None
    """What could not be read (a torn or damaged file), in plain words."""

    def measurement(self) -> Measurement:
        """What a fit may see: pad-frame position, net force, both at their own times, from the first step on.

        Touch-off and preconditioning are included as history but not as cost (`fit_from_s`).
        Raises `bench.errors.InputError` when there is no surface or no sample.
        """
        from bench.recording.measure import measurement_of  # the rules live there; types stay free of them

        return measurement_of(self)


@dataclass
class Measurement:
    """The arrays that identification and diagnosis work on.

    `position_time_s`, `position_mm`: shape (n,), strictly increasing times, pad frame.
    `force_time_s`, `force_N`: shape (m,), strictly increasing times, within the position's time span.
    `fit_from_s`: force samples before it are history, they cost nothing.
    `marks`: step starts, where the recording has them. `surface_std_mm`: doubt of the pad's surface.
    `probe_radius_mm` and the like stay in the recording.
    """

    name: str
    position_time_s: Array
    position_mm: Array
    force_time_s: Array
    force_N: Array
    fit_from_s: float = -np.inf
    fit_to_s: float = np.inf
    marks: list[StepMark] = field(default_factory=list)
    surface_std_mm: float = 0.0
    zero_std_N: float = 0.0
    """Doubt of the force's zero, as the tare left it."""
    tared_s: tuple[float, float] | None = None
    """Between which times the force was taken for zero: what a model says of them counts as zero too."""
    notes: list[str] = field(default_factory=list)
    """What was repaired or left out on reading, in plain words."""
    doubtful: list[tuple[float, float]] = field(default_factory=list)
    """Spans of time (first and last force stamp) in which the position is not known well enough for the force to count
    (`bench.recording.between`); the motion in them counts as history."""

    stamp_std_s: float = 0.0
    """By how much all stamps of the position may be early or late against those of the force, standard deviation."""
    way_doubt: tuple[Array, Array] | None = None
    """(s, mm), (k,) each: by how much the positions may be off, all along together, by one standard deviation of what
    the axis gives way to the force; linear between. None where it is stiff, or its polls show it."""

    def position_at_forces_mm(self) -> Array:
        """The position at the stamps of the forces (m,), linear between its own."""
        return np.asarray(np.interp(self.force_time_s, self.position_time_s, self.position_mm))

    def counted(self) -> NDArray[np.bool_]:
        """Which force samples cost something, (m,): from `fit_from_s` to `fit_to_s`, and none that is doubtful."""
        counted = (self.force_time_s >= self.fit_from_s) & (self.force_time_s <= self.fit_to_s)
        for begin_s, end_s in self.doubtful:
            first = np.searchsorted(self.force_time_s, begin_s)
            counted[first : np.searchsorted(self.force_time_s, end_s, side="right")] = False
        return counted
