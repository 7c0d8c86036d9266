"""What the run was and how the bench behaved: tables from the recording's own records."""

from __future__ import annotations

import datetime
import json
import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
from numpy.typing import NDArray

from bench.recording.types import Event, Recording, StepMark
from bench.report import markup
from bench.report.markup import digits

Array = NDArray[np.float64]

_NAMES = {
    "protocol": "Protocol",
    "description": "Description",
    "sample": "Sample",
    "operator": "Operator",
    "note": "Note",
    "conditions": "Conditions",
    "bench": "Bench",
    "pad": "Pad believed",
    "model": "Model believed",
    "simulated": "Simulated",
    "seed": "Seed",
    "clock": "Clock",
    "started": "Started",
    "date": "Date",
    "motor": "Motor",
    "load_cell": "Load cell",
    "probe": "Probe",
    "timing": "Timing",
    "run_id": "Run",
    "id": "Run",
}
FEW = 5
"""Events of one name that are listed even where the plots do not show them."""

_RESULT_SHOWN = frozenset({"status", "outcome", "state", "cause", "first_cause", "reason", "error"})
_BESIDE = {
    "recording.mcap": "every sample, as measured (Foxglove, PlotJuggler)",
    "model.yaml": "the fitted model, for `padbench simulate`",
    "fit.json": "the fit in numbers",
    "diagnosis.json": "what the model leaves, and why",
    "next_test.yaml": "the protocol that tells apart what is left in doubt",
}


def was(recording: Recording, host: Mapping[str, str] | None = None) -> str:
    """What the run was: protocol, sample, operator, note, conditions, bench, seed, date, simulated or not."""
    run = dict(recording.run)
    began = started(recording, host)
    pairs: list[tuple[str, object]] = []
    for key, name in _NAMES.items():
        value = _plain(run.pop(key, ""))
        pairs.append((name, began if key == "started" else value))
    run |= {key: value for key, value in (host or {}).items() if key not in ("started", "padding")}
    rest = [(key.replace("_", " "), _plain(value)) for key, value in sorted(run.items())]
    if not recording.run:
        pairs.append(("Data", recording.source.name))
    files = "".join(
        markup.folded(name, f"<pre>{markup.text(data.decode('utf-8', 'replace'))}</pre>")
        for name, data in sorted(recording.attachments.items())
        if name.endswith((".yaml", ".yml", ".json", ".txt"))
    )
    return markup.facts(pairs) + markup.folded("All records of the run", markup.facts(rest)) + files


def started(recording: Recording, host: Mapping[str, str] | None = None) -> str:
    """When the run was made: by the host's record, else by its folder's name, else by a real bench's clock (UTC).

    A virtual clock starts at a fixed moment, which is no date. Empty where nothing tells.
    """
    for record in (host or {}, recording.run):
        said = _plain(record.get("started") or record.get("date") or "")
        if said:
            return said.replace("T", " ", 1)
    folder = re.match(r"(\d{4}-\d\d-\d\d)_(\d\d)(\d\d)(\d\d)_", recording.source.resolve().parent.name)
    if folder:
        return f"{folder[1]} {folder[2]}:{folder[3]}:{folder[4]}"
    epoch = recording.run.get("epoch_ns", "")
    if epoch.isdecimal() and not is_simulated(recording):
        moment = datetime.datetime.fromtimestamp(int(epoch) / 1e9, tz=datetime.UTC)
        return f"{moment:%Y-%m-%d %H:%M:%S} UTC"
    return ""


def is_simulated(recording: Recording) -> bool:
    """Whether the bench was a simulated one, by the run's record."""
    return _plain(recording.run.get("simulated", "")).lower() in ("true", "yes", "1")


def sample_name(recording: Recording) -> str:
    """The sample's id; empty where none was given."""
    given = recording.run.get("sample", "")
    try:
        found = json.loads(given)
    except ValueError:
        return given
    return str(found.get("id") or "") if isinstance(found, Mapping) else _plain(given)


def has_surface(recording: Recording) -> bool:
    """Whether depths count from a pad's surface, and not from the motor's own zero (a run without approach)."""
    return recording.surface_mm is not None and all(event.name != "no_surface" for event in recording.events)


def _plain(value: str) -> str:
    """A record's value for reading: JSON text, lists and objects unfolded into words; anything else as it is."""
    try:
        found = json.loads(value)
    except ValueError:
        return value
    if isinstance(found, bool):
        return "yes" if found else "no"
    if isinstance(found, Mapping):
        said = [_word(item) if key == "id" else markup.named(str(key), _word(item)) for key, item in found.items()]
        return ", ".join(
            part for part, item in zip(said, found.values(), strict=True) if item not in (None, "", [], {})
        )
    if isinstance(found, list):
        return ", ".join(_word(item) for item in found)
    return "" if found is None else found if isinstance(found, str) else value


def _word(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, (Mapping, list)):
        return json.dumps(value, ensure_ascii=False)
    return "–" if value is None else str(value)


def rates(recording: Recording) -> str:
    """How often each channel was sampled, its longest gap, and how long its samples were under way."""
    rows = []
    for name, channel in (("motor", recording.motor), ("load cell", recording.load_cell)):
        t = channel.time_s
        if t.size < 2:
            rows.append([name, str(t.size), "–", "–", "–", "–"])
            continue
        step = np.diff(t)
        late = channel.received_s - t if channel.received_s.size == t.size else np.full(t.size, np.nan)
        late = late[np.isfinite(late)]
        typical = float(np.median(step))
        longest = int(np.argmax(step))
        rows.append(
            [
                name,
                f"{t.size}",
                digits(1.0 / typical) if typical > 0 else "–",
                digits((t.size - 1) / float(t[-1] - t[0])) if t[-1] > t[0] else "–",
                f"{digits(1e3 * float(step[longest]), 3)} at {t[longest]:.3f} s",
                digits(1e3 * float(np.median(late)), 3) if late.size else "–",
            ]
        )
    head = ["channel", "samples", "typical rate, Hz", "mean rate, Hz", "longest gap, ms", "median age on arrival, ms"]
    flagged = int(recording.load_cell.flagged.sum())
    said = f"<p>The load cell flagged {flagged} samples.</p>" if flagged else ""
    return markup.table(head, rows, numeric=(1, 2, 3, 4, 5)) + said + _following(recording)


def _following(recording: Recording) -> str:
    error = recording.motor.command_mm - recording.motor.position_mm
    error = error[np.isfinite(error)]
    if error.size == 0:
        return ""
    rms, worst = float(np.sqrt(np.mean(error**2))), float(np.abs(error).max())
    return f"<p>Following error: {digits(rms, 3)} mm rms, {digits(worst, 3)} mm at worst.</p>\n"


def traffic(recording: Recording) -> str:
    """The closing record of the run (counters of each device, overruns) and events that came in numbers."""
    parts: list[str] = []
    plain: list[tuple[str, object]] = []
    for key, value in sorted((recording.result or {}).items()):
        if key in _RESULT_SHOWN:
            continue
        counted = _counters(value)
        if counted:
            parts.append(f"<h3>{markup.text(key.replace('_', ' ').capitalize())}</h3>{counted}")
        else:
            plain.append((key.replace("_", " "), _plain(value)))
    return markup.facts(plain) + "".join(parts)


def _counters(value: str) -> str:
    """A table of {"motor": {"sent": 1, …}, …}: one row a device; empty where `value` is anything else."""
    try:
        found = json.loads(value)
    except ValueError:
        return ""
    if not (isinstance(found, dict) and found and all(isinstance(item, dict) for item in found.values())):
        return ""
    names = list(dict.fromkeys(name for item in found.values() for name in item))
    rows = [
        [device.replace("_", " "), *(_word(item[name]) if name in item else "" for name in names)]
        for device, item in found.items()
    ]
    head = ["", *(name.replace("_", " ") for name in names)]
    return markup.table(head, rows, numeric=tuple(range(1, len(head))))


def touch_off(recording: Recording) -> str:
    """Where the surface was found, how surely, and the tare and touch-off events with their numbers."""
    said = ""
    if recording.surface_mm is not None and not has_surface(recording):
        said = "<p>No surface was looked for: positions count from the motor's own zero.</p>\n"
    elif recording.surface_mm is not None and recording.run:
        said = (
            f"<p>The surface stands at <b>{recording.surface_mm:.4f} mm</b> in the motor frame, "
            f"± {1e3 * recording.surface_std_mm:.1f} µm (one standard deviation).</p>\n"
        )
    pairs: list[tuple[str, object]] = []
    for event in recording.events:
        if event.name in ("homed", "tare", "contact", "touch_off"):
            data = _event_data(event)
            pairs.append((event.name.replace("_", " "), f"at {event.time_s:.3f} s" + (f": {data}" if data else "")))
    return said + markup.facts(pairs)


def _event_data(event: Event) -> str:
    return ", ".join(markup.named(key, _figure(key, value)) for key, value in event.data.items())


def _figure(key: str, value: Any) -> str:
    """A value of an event with no more digits than a bench can tell: forces to three, or 1 mN; positions to 0.1 µm."""
    if not isinstance(value, float) or not math.isfinite(value):
        return _word(value)
    if key.endswith(("_N", "_N_s")):
        return digits(value, 3) if abs(value) < 1 else f"{value:.3f}".replace("-", "−")
    if key.endswith("_mm"):
        return f"{round(value, 4) + 0.0:g}".replace("-", "−") if abs(value) < 100 else _word(value)
    return _word(value)


def event_table(recording: Recording, marked: Sequence[tuple[int, Event]]) -> str:
    """The events, numbered as in the plots, and how often those came that are too many to list."""
    numbers = {id(event): str(n) for n, event in marked}
    times = Counter(event.name for event in recording.events)
    rows, counted = [], Counter[str]()
    for event in sorted(recording.events, key=lambda e: e.time_s):
        if id(event) in numbers or times[event.name] <= FEW:
            said = [f"{event.time_s:.3f}", event.name.replace("_", " "), _event_data(event)]
            rows.append([numbers.get(id(event), ""), *said])
        else:
            counted[event.name] += 1
    body = markup.table(["no.", "time, s", "event", "data"], rows, numeric=(1,))
    if counted:
        rest = ", ".join(f"{name.replace('_', ' ')} {n}×" for name, n in sorted(counted.items()))
        body += f"<p>Not listed: {markup.text(rest)}.</p>\n"
    return body


def steps_table(steps: Sequence[StepMark]) -> str:
    """The steps as they were run, or are planned."""
    rows = [
        [
            mark.name,
            mark.phase,
            mark.kind.replace("_", " "),
            f"{mark.time_s:.3f}",
            f"{mark.target_mm:.6g}" if math.isfinite(mark.target_mm) else "",
            f"{mark.speed_mm_s:.6g}" if math.isfinite(mark.speed_mm_s) else "",
        ]
        for mark in steps[:400]
    ]
    head = ["step", "phase", "kind", "start, s", "target, mm", "speed, mm/s"]
    more = len(steps) - len(rows)
    said = f"<p>{more} more in the recording.</p>" if more > 0 else ""
    return markup.table(head, rows, numeric=(3, 4, 5)) + said


def beside(page: Path) -> str:
    """The files of the run folder that lie beside the page, linked."""
    lines = [
        f'<li><a href="{quote(name)}"><code>{markup.text(name)}</code></a> {markup.text(what)}</li>'
        for name, what in _BESIDE.items()
        if (page.parent / name).is_file()
    ]
    return f"<ul>{''.join(lines)}</ul>\n" if lines else ""
