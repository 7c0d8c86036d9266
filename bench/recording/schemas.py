"""What stands in a recording: topics, their JSON schemas, the names of records and attachments.

Foxglove and PlotJuggler plot these without configuration: every channel is JSON with a JSON schema whose root is an
object, samples are flat objects of numbers whose names end in the unit, and `/log` is `foxglove.Log` by its exact
name. A value that was not measured is left out (JSON has no NaN, and both viewers then draw no point).
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

FORMAT = "1"
"""Version of what is described here; stands in `padbench.run` and in each channel's metadata."""

LIBRARY = "padbench"
"""Writer's name in the MCAP header; without a version, since the same seed gives the same bytes."""

RUN = "padbench.run"
RESULT = "padbench.result"
HOST = "padbench.host"
SIMULATION = "padbench.simulation"
RECOVERED = "padbench.recovered"

BENCH_FILE = "bench.yaml"
PROTOCOL_FILE = "protocol.yaml"
MODEL_FILE = "model.yaml"

TOUCH_OFF = "touch_off"
"""The event that carries the pad's surface: `surface_mm` (motor frame) and `surface_std_mm`."""

NO_SURFACE = "no_surface"
"""The event of a run without approach: its depths count from `surface_mm`, the motor's own zero."""

STOPPED = "stopped"
"""The event after which the motion is no longer the protocol's: the axis goes to its safe state."""

MOVE = "move"
"""The event of a motor that makes its own moves having taken one: `target_mm` (motor frame), `speed_mm_s`,
`acceleration_mm_s2` as the device counts them, and `waited_s` since it was commanded, within which the move began."""

HALT = "halt"
"""The event of such a motor told to stop where it is."""

POLLED = "polled"
"""The event that says how positions are asked for: `period_s`, and `stamp_std_s`, the doubt of a poll's stamp."""


@dataclass(frozen=True)
class Topic:
    """One channel: MCAP channel id, topic, schema name, JSON schema, and what its times are."""

    id: int
    name: str
    schema_name: str
    schema: dict[str, Any]
    times: str

    def schema_bytes(self) -> bytes:
        """The schema as it stands in the file."""
        return json.dumps(self.schema, separators=(",", ":")).encode()

    def metadata(self, epoch_ns: int) -> dict[str, str]:
        """Channel metadata: format, clock, and the unit of each field that has one."""
        units = [f"{name}: {p['unit']}" for name, p in self.schema.get("properties", {}).items() if "unit" in p]
        return {
            "schema_version": FORMAT,
            "epoch_ns": str(epoch_ns),
            "clock": f"{self.times}; nanoseconds since 1970, bench time 0 is epoch_ns",
            "units": ", ".join(units),
        }


def _number(unit: str, description: str) -> dict[str, str]:
    return {"type": "number", "unit": unit, "description": description}


def _object(title: str, properties: dict[str, Any]) -> dict[str, Any]:
    return {"title": title, "type": "object", "properties": properties}


_MEASURED = "publish_time: when it was measured; log_time: when the host had it"
_NOTED = "publish_time and log_time: when it happened"

MOTOR = Topic(
    1,
    "/motor",
    "padbench.Motor",
    _object(
        "padbench.Motor",
        {
            "position_mm": _number("mm", "measured position, motor frame"),
            "command_mm": _number("mm", "position commanded at the time of measurement, motor frame"),
            "force_N": _number("N", "the motor's own estimate of its force, positive against the pad"),
        },
    ),
    _MEASURED,
)
LOAD_CELL = Topic(
    2,
    "/load_cell",
    "padbench.LoadCell",
    _object(
        "padbench.LoadCell",
        {
            "force_N": _number("N", "net of the tare, positive in compression"),
            "gross_N": _number("N", "as read"),
            "flags": {"type": "string", "description": "the device's own words, separated by spaces"},
            "overload": {"type": "boolean", "description": "the device itself calls the sample bad"},
        },
    ),
    _MEASURED,
)
EVENT = Topic(
    3,
    "/event",
    "padbench.Event",
    _object("padbench.Event", {"name": {"type": "string", "description": "what happened; its numbers follow"}}),
    _NOTED,
)
STEP = Topic(
    4,
    "/step",
    "padbench.Step",
    _object(
        "padbench.Step",
        {
            "name": {"type": "string", "description": "the protocol's own: steps[2], cycle[1].steps[0]"},
            "phase": {"type": "string", "description": "tare, approach, precondition, steps, finish"},
            "kind": {"type": "string", "description": "ramp, hold, force_ramp, force_hold, air"},
            "target_mm": _number("mm", "pad frame"),
            "speed_mm_s": _number("mm/s", "speed of the ramp"),
        },
    ),
    _NOTED,
)
LOG = Topic(
    5,
    "/log",
    "foxglove.Log",
    _object(
        "foxglove.Log",
        {
            "timestamp": {
                "type": "object",
                "title": "time",
                "properties": {
                    "sec": {"type": "integer", "minimum": 0},
                    "nsec": {"type": "integer", "minimum": 0, "maximum": 999999999},
                },
            },
            "level": {
                "title": "foxglove.LogLevel",
                "oneOf": [
                    {"title": title, "const": value}
                    for value, title in enumerate(("UNKNOWN", "DEBUG", "INFO", "WARNING", "ERROR", "FATAL"))
                ],
            },
            "message": {"type": "string"},
            "name": {"type": "string"},
            "file": {"type": "string"},
            "line": {"type": "integer", "minimum": 0},
        },
    ),
    _NOTED,
)
EXTRA = Topic(
    6,
    "/extra",
    "padbench.Extra",
    _object("padbench.Extra", {}),
    "publish_time and log_time: the row's own time (columns of a CSV file that padbench gives no meaning to)",
)

TOPICS = (MOTOR, LOAD_CELL, EVENT, STEP, LOG, EXTRA)
RUN_TOPICS = TOPICS[:5]
"""What a run writes; `/extra` comes only with converted CSV files."""

LOG_LEVELS = {"debug": 1, "info": 2, "warning": 3, "error": 4, "fatal": 5}

_LATEST_NS = 1 << 62


def epoch_of(fields: Mapping[str, str]) -> int | None:
    """`epoch_ns` of a record or of a channel's metadata; None where it is not there, or is no time."""
    text = fields.get("epoch_ns", "")
    if not (text.isascii() and text.isdecimal() and len(text) <= 19):
        return None
    ns = int(text)
    return ns if ns < _LATEST_NS else None
