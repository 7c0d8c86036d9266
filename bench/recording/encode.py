"""Samples, marks and events as JSON bytes.

The two sample encoders run at every sample of a run, so they build their text by hand: a quarter of what `json.dumps`
takes. Numbers are written with `repr`, the shortest text that reads back as the same number.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

from bench.recording.types import StepMark


def motor_json(position_mm: float, command_mm: float | None, force_N: float | None) -> bytes:
    """One `/motor` message; None and NaN are left out."""
    text = ""
    value = float(position_mm)  # numpy's scalars do not print as JSON
    if value - value == 0.0:  # false for NaN and infinities alike
        text = f',"position_mm":{value!r}'
    if command_mm is not None:
        value = float(command_mm)
        if value - value == 0.0:
            text += f',"command_mm":{value!r}'
    if force_N is not None:
        value = float(force_N)
        if value - value == 0.0:
            text += f',"force_N":{value!r}'
    return f"{{{text[1:]}}}".encode()


def force_json(net_N: float, gross_N: float, flags_json: str) -> bytes:
    """One `/load_cell` message; `flags_json` comes from `flags_fragment`."""
    text = ""
    value = float(net_N)
    if value - value == 0.0:
        text = f'"force_N":{value!r},'
    value = float(gross_N)
    if value - value == 0.0:
        text += f'"gross_N":{value!r},'
    return f"{{{text}{flags_json}}}".encode()


def flags_fragment(flags: tuple[str, ...], overload: bool) -> str:
    """The flags' part of a `/load_cell` message (the recorder keeps it, since flags seldom change)."""
    return f'"flags":{json.dumps(" ".join(flags))},"overload":{"true" if overload else "false"}'


def step_json(mark: StepMark) -> bytes:
    """One `/step` message."""
    numbers = {"target_mm": mark.target_mm, "speed_mm_s": mark.speed_mm_s}
    return object_json({"name": mark.name, "phase": mark.phase, "kind": mark.kind, **numbers})


def event_json(name: str, data: Mapping[str, Any]) -> bytes:
    """One `/event` message: the name and, beside it, the event's own fields.

    Raises ValueError where a field is itself called `name`.
    """
    if "name" in data:
        raise ValueError("an event's field cannot be called 'name': that is the event's own")
    return object_json({"name": name, **data})


def log_json(ns: int, level: int, text: str) -> bytes:
    """One `/log` message (foxglove.Log)."""
    timestamp = {"sec": ns // 1_000_000_000, "nsec": ns % 1_000_000_000}
    log = {"timestamp": timestamp, "level": level, "message": text, "name": "padbench", "file": "", "line": 0}
    return object_json(log)


def object_json(fields: Mapping[str, Any]) -> bytes:
    """A JSON object; numbers that are not finite are left out, arrays become lists, other objects text."""
    return json.dumps(_plain(fields), separators=(",", ":"), allow_nan=False).encode()


def _plain(value: Any) -> Any:
    if hasattr(value, "tolist"):  # numpy scalars and arrays
        value = value.tolist()
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items() if not _not_finite(v)}
    if isinstance(value, (list, tuple)):
        return [None if _not_finite(v) else _plain(v) for v in value]
    if value is None or isinstance(value, (str, bool, int, float)):
        return value
    return str(value)


def _not_finite(value: Any) -> bool:
    return isinstance(value, float) and not math.isfinite(value)


def strings(fields: Mapping[str, object]) -> dict[str, str]:
    """MCAP metadata are text throughout: what is not text becomes JSON (`1`, `[1,2]`, `{"a":1}`), None is left out."""
    return {
        str(key): value if isinstance(value, str) else _compact(value)
        for key, value in fields.items()
        if value is not None
    }


def _compact(value: object) -> str:
    plain = _plain(value)
    if isinstance(plain, str):
        return plain
    return "nan" if _not_finite(plain) else json.dumps(plain, separators=(",", ":"), allow_nan=False)
