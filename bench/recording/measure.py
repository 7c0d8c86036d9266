"""From a recording to the arrays that a fit may see: the rules, in one place.

What was measured is not changed: positions move into the pad frame, stamps by the delays that `doctor` measured, and
samples that cannot count are left out and named. Where polls are too slow to show a move, its commanded profile stands
between them (`between`), and what is not known of it costs nothing in a fit.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench import yamlfile
from bench.errors import InputError
from bench.places import Key
from bench.readings import copies, said_of
from bench.recording.between import Spans, between_polls
from bench.recording.schemas import BENCH_FILE, NO_SURFACE, STOPPED
from bench.recording.stairs import stairs
from bench.recording.types import Array, Event, Measurement, Recording
from drivers.motor import STREAMED, RAREST_Hz

GAP = 5.0
"""A pause between samples of more than so many usual periods is reported."""

FILTERED = 4.0
"""Samples of a tare that are worth one, at the most: load cells filter."""

TARED_S = 0.9
"""The tare averages at least so long before it is noted."""

UNPAIRED_S = 0.25
"""Forces may outlast the positions by so much before it is reported."""

SPIKE = 30.0
"""A sample is reported as a drop-out when it stands so many noise deviations away from both its neighbours …"""

SPIKE_OVER_STEPS = 5.0
"""… and so many times further than the neighbours moved themselves (the tip of a triangle is none)."""


@dataclass(frozen=True)
class Delays:
    """How late the reported stamps are, seconds, by the bench file's `timing`; subtracted from them."""

    force_s: float = 0.0
    position_s: float = 0.0


def measurement_of(recording: Recording) -> Measurement:
    """The measurement in a recording.

    Position in the pad frame and net force, each at its own strictly increasing times, corrected by the `timing` of
    the bench file in the recording. Force samples that the device called bad (overload) and those outside the
    position's time span are left out. `fit_from_s` is the start of the first mark of phase `steps`; before it all is
    history. `fit_to_s` is where the run was stopped, if it was. Without marks (CSV) everything counts.
    Raises `InputError` where there is no surface, no sample, or the run ended before its first step.
    """
    place = str(recording.source)
    cure = f"what could be read: {recording.lost}" if recording.lost else ""
    if recording.motor.time_s.size == 0 or recording.load_cell.time_s.size == 0:
        what = "position" if recording.motor.time_s.size == 0 else "force"
        raise InputError(place, f"holds no {what} sample", cure)
    if recording.surface_mm is None:
        raise InputError(place, "has no touch-off: where the pad begins is not known", cure or "did the run reach it?")
    notes = list(recording.notes)
    if recording.run and recording.result is None:
        notes.append(f"this run did not come to its end: it is there to {float(recording.load_cell.time_s[-1]):.4g} s")
    bench = _bench_of(recording)
    delays = _delays(bench, recording)
    if delays != Delays():
        notes.append(
            f"stamps corrected by the bench's timing: force {delays.force_s * 1e3:g} ms, "
            f"position {delays.position_s * 1e3:g} ms"
        )
    if any(event.name == NO_SURFACE for event in recording.events):
        notes.append("run without touch-off: depths count from the motor's own zero")
    position_time, position = _channel(
        "position", recording.motor.time_s - delays.position_s, recording.motor.position_mm, notes
    )
    position_time, position = _new_ones(position_time, position, notes)
    force_time, force = _forces(recording, delays, notes)
    if position.size < 2:
        raise InputError(place, "holds fewer than two position samples", cure)
    fit_from, fit_to = _span(recording, place)
    inside = (force_time >= position_time[0]) & (force_time <= position_time[-1])
    # A cell that is read a little longer than the motor is how every run begins and ends: not worth a word.
    late = force_time > position_time[-1] + UNPAIRED_S
    outside = int(np.count_nonzero(~inside & (force_time >= fit_from))) if late.any() else 0
    if outside:
        notes.append(f"{outside} force samples outside the time of the position samples left out")
    force_time, force = force_time[inside], force[inside]
    counted = int(np.count_nonzero((force_time >= fit_from) & (force_time <= fit_to)))
    if counted < 2:
        raise InputError(place, f"holds {counted} force samples that count, two at the least are needed", cure)
    _report_gaps("position", position_time, notes)
    _report_gaps("force", force_time, notes)
    _report_spikes("position", position_time, position, notes)
    _report_spikes("force", force_time, force, notes)
    doubtful: Spans = []
    stamp_std, way_doubt = 0.0, None
    between = between_polls(recording.events, position_time, position, force_time, force)
    if between is not None:
        position_time, position, doubtful = between.time_s, between.position_mm, between.doubtful
        stamp_std, way_doubt = between.stamp_std_s, between.way_doubt
        notes += between.notes
    else:
        told = np.interp(position_time, recording.motor.time_s - delays.position_s, recording.motor.command_mm)
        doubtful = _stairs(bench, position_time, told, (force_time, force), notes)
    return Measurement(
        name=_name(recording.source),
        position_time_s=position_time,
        position_mm=position - recording.surface_mm,
        force_time_s=force_time,
        force_N=force,
        fit_from_s=fit_from,
        fit_to_s=fit_to,
        marks=list(recording.steps),
        surface_std_mm=recording.surface_std_mm,
        zero_std_N=_zero_std_N(recording),
        tared_s=_tared_s(recording),
        notes=notes,
        doubtful=doubtful,
        stamp_std_s=stamp_std,
        way_doubt=way_doubt,
    )


def _new_ones(time_s: Array, position_mm: Array, notes: list[str]) -> tuple[Array, Array]:
    """Without the rows that only repeat a position, where it is written more often than it is asked for: between two
    new ones the axis moves on, and does not stand and jump. The last row stays, for the time that it holds."""
    again = copies(position_mm)
    if not again.any():
        return time_s, position_mm
    again[-1] = False
    notes.append(f"position: {said_of(again)}")
    return time_s[~again], position_mm[~again]


def _stairs(
    bench: dict[Key, Any], time_s: Array, told_mm: Array, force: tuple[Array, Array], notes: list[str]
) -> Spans:
    """Where a streamed motor made stairs (`stairs`); none where nothing tells that it was streamed."""
    motor = bench.get("motor")
    if not isinstance(motor, dict) or motor.get("driver") not in STREAMED:
        return []
    spans = stairs(time_s, told_mm, *force)
    if spans:
        lasts_s, rate_Hz = sum(end - begin for begin, end in spans), 1.0 / float(np.median(np.diff(time_s)))
        late = "late now and then, by a late computer"
        often = f"only {rate_Hz:.3g} times a second" if rate_Hz < RAREST_Hz else late
        notes.append(
            f"force: {lasts_s:.2g} s of fast motion cost nothing in a fit: the motor was told a position {often}, "
            "and what the pad felt between two of them no sample shows"
        )
    return spans


def delays_of(recording: Recording) -> Delays:
    """The `timing` block of the bench file inside the recording; zero where there is none."""
    return _delays(_bench_of(recording), recording)


def _delays(bench: dict[Key, Any], recording: Recording) -> Delays:
    timing = bench.get("timing")
    if not isinstance(timing, dict):
        return Delays()
    path = Path(f"{recording.source}:{BENCH_FILE}")
    return Delays(_seconds(timing, "force_delay", path), _seconds(timing, "position_delay", path))


def _bench_of(recording: Recording) -> dict[Key, Any]:
    """The bench file inside the recording, as it is; empty where there is none."""
    text = recording.attachments.get(BENCH_FILE)
    if text is None:
        return {}
    data = yamlfile.parse(text.decode(errors="replace"), Path(f"{recording.source}:{BENCH_FILE}")).data
    return data if isinstance(data, dict) else {}


def increasing(time_s: Array, values: Array) -> tuple[Array, Array]:
    """Samples sorted by time, those of equal time averaged; both shape (n,), the result (k,) with k <= n."""
    if np.all(np.diff(time_s) > 0):
        return time_s, values
    stamps, inverse, counts = np.unique(time_s, return_inverse=True, return_counts=True)
    return stamps, np.bincount(inverse, weights=values) / counts


def _seconds(timing: dict[str, object], key: str, path: Path) -> float:
    value = timing.get(key) or 0.0
    if not isinstance(value, int | float):
        raise InputError(str(path), f"timing.{key} must be seconds, not {value!r}")
    return float(value)


def _channel(what: str, time_s: Array, values: Array, notes: list[str]) -> tuple[Array, Array]:
    """The samples that are numbers, in the order of strictly increasing times."""
    good = np.isfinite(values) & np.isfinite(time_s)
    time_s, values = time_s[good], values[good]
    back = int(np.count_nonzero(np.diff(time_s) < 0))
    if back:
        lie = "stamps lie" if back > 1 else "stamp lies"
        notes.append(f"{what}: {back} {lie} before the one that came first; put in order")
    stamps, merged = increasing(time_s, values)
    if stamps.size < time_s.size:
        again = time_s.size - stamps.size
        several = ("samples", "were") if again > 1 else ("sample", "was")
        notes.append(f"{what}: {again} {several[0]} with a stamp that was there already {several[1]} averaged")
    return stamps, merged


def _forces(recording: Recording, delays: Delays, notes: list[str]) -> tuple[Array, Array]:
    cell = recording.load_cell
    flagged: NDArray[np.bool_] = cell.flagged
    bad = int(flagged.sum())
    if bad:
        notes.append(f"{bad} force samples that the device called bad (overload) left out")
    good = ~flagged
    return _channel("force", cell.time_s[good] - delays.force_s, _on_one_zero(recording)[good], notes)


def _on_one_zero(recording: Recording) -> Array:
    """Net forces (n,), N, those before the tare on the zero that it set: what a model remembers of them is force too,
    and a coarse channel has one grid of values."""
    cell, tare = recording.load_cell, _tare(recording)
    tare_N = tare.data.get("tare_N") if tare is not None else None
    if tare is None or not isinstance(tare_N, int | float) or not np.isfinite(tare_N):
        return cell.force_N
    before = (cell.time_s < tare.time_s) & np.isfinite(cell.gross_N)
    return np.where(before, cell.gross_N - tare_N, cell.force_N)


def _zero_std_N(recording: Recording) -> float:
    """Standard deviation of the tare: its noise over its samples, which a device's filter makes fewer."""
    tare = _tare(recording)
    if tare is None:
        return 0.0
    sigma, samples = tare.data.get("sigma_N"), tare.data.get("samples")
    if not isinstance(sigma, int | float) or not isinstance(samples, int | float) or samples < 1 or sigma < 0:
        return 0.0
    return float(sigma) * float(np.sqrt(FILTERED / samples))


def _tared_s(recording: Recording) -> tuple[float, float] | None:
    """The time of the samples that the tare averaged: those before its event."""
    tare = _tare(recording)
    return (tare.time_s - TARED_S, tare.time_s) if tare is not None else None


def _tare(recording: Recording) -> Event | None:
    """The tare that holds: the last."""
    return next((event for event in reversed(recording.events) if event.name == "tare"), None)


def _span(recording: Recording, place: str) -> tuple[float, float]:
    if not recording.steps:
        return -np.inf, np.inf
    starts = [mark.time_s for mark in recording.steps if mark.phase == "steps"]
    if not starts:
        phase = recording.steps[-1].phase
        raise InputError(place, f"the run ended before its first step (in its {phase})", "there is nothing to fit")
    stops = [event.time_s for event in recording.events if event.name == STOPPED]
    return min(starts), min(stops, default=np.inf)


def _report_gaps(what: str, time_s: Array, notes: list[str]) -> None:
    if time_s.size < 3:
        return
    steps = np.diff(time_s)
    gaps = np.flatnonzero(steps > GAP * np.median(steps))
    # Where the rate itself changes (thinned data, a poll beside a stream) long steps come in rows; no gap then.
    alone = [i for i in gaps.tolist() if steps[i] > GAP * _around(steps, i)]
    if alone:
        worst = max(alone, key=lambda i: float(steps[i]))
        notes.append(
            f"{what}: {len(alone)} gaps in the samples, the longest {steps[worst]:.3g} s at {time_s[worst]:.6g} s"
        )


def _around(steps: Array, i: int) -> float:
    before, after = steps[i - 1] if i else steps[1], steps[i + 1] if i + 1 < steps.size else steps[-2]
    return float(max(before, after))


def _report_spikes(what: str, time_s: Array, values: Array, notes: list[str]) -> None:
    """Single samples that leave and come back at once; they are reported, whoever fits decides about them."""
    if values.size < 8:
        return
    up, down = values[1:-1] - values[:-2], values[1:-1] - values[2:]
    away = np.where(np.sign(up) == np.sign(down), np.minimum(np.abs(up), np.abs(down)), 0.0)
    bend = np.abs(up + down) / 2
    noise = 1.4826 * float(np.median(bend[bend > 0])) if np.any(bend) else 0.0  # a channel may stand still
    steps = np.abs(np.diff(values))
    before = np.concatenate([steps[:1], steps[:-2]])
    after = np.concatenate([steps[2:], steps[-1:]])
    spikes = np.flatnonzero((away > SPIKE * noise) & (away > SPIKE_OVER_STEPS * np.maximum(before, after)))
    if spikes.size:
        notes.append(f"{what}: {spikes.size} isolated drop-outs, the first at {time_s[spikes[0] + 1]:.6g} s")


def _name(source: Path) -> str:
    """What a person calls the data: the run folder's name, or the file's without suffix."""
    if source.name == "recording.mcap":
        return source.resolve().parent.name
    return source.name if source.is_dir() else source.stem
