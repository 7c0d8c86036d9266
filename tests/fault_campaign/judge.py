"""One seed: run it, and hold what came of it against what must never bend."""

from __future__ import annotations

import re
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from unittest import mock

import bench.run.runner
from bench.run.folder import RECORDING
from sim.faults import FAMILIES, KINDS, RECOVERED, REFUSED
from tests.fault_campaign.draw import Drawn, draw
from tests.faults.faulty import Seen, bench_with, press
from tests.faults.test_kinds import LOST_AT_MOST_s

SHIFTS = ("lost_position", "foreign_commands", "position_jump")
"""Faults after which the axis is not where it says: `by_mm` is how far they take it by themselves."""

BLIND = (
    "force_gain", "force_saturated", "force_frozen", "force_jump", "force_drift", "setting_changes", "zero_key",
    "gain_drift", "cable_open", "other_map",
)  # fmt: skip
"""Faults after which the cell says less than there is: travel and depth still hold, the force limit is deceived."""


LINE = r"no answer|no reply|the reply carries|checksum|CRC|silent|answers, but"
TOUCH = (
    "contact after only|surface could not be measured|already touches something|as the motor was energised"
    "|not steady in air|its zero has moved|was not reached"
)
LIMITS = "(force|tension|travel|depth|speed) limit|following error"
OF_FAMILY = {
    "Bytes on the wire": f"{LINE}|{LIMITS}|{TOUCH}",
    "Frames": f"{LINE}|the motor reports a fault: force limit",
    "The port": f"{LINE}|{TOUCH}",
    "What a device makes of a request": f"{LINE}|{LIMITS}|{TOUCH}|where it was sent",
    "What the load cell says": f"{LIMITS}|{TOUCH}|the cell drifts|the motor pushes with",
    "What gets into the load cell's signal": f"{LIMITS}|{TOUCH}",
    "The motor and its position": (
        f"{LIMITS}|{TOUCH}|stands still|moves by itself|where it was sent|does not (end|come on|hold)"
        "|the motor reports a fault before any motion: force limit"
    ),
}
"""What any fault of a family is known to lead to, at other instants or with other protocols than the table's rows."""


@dataclass
class Verdict:
    """What a seed came to; `wrong` is empty where all held."""

    seed: int
    how: str
    cause: str
    wrong: list[str] = field(default_factory=list)
    content: bytes = b""


def judge(seed: int) -> Verdict:
    """Run a seed once, and judge it."""
    drawn = draw(seed)
    same_host = mock.patch.object(bench.run.runner, "_host_record", dict)  # the one record that may differ
    with same_host, tempfile.TemporaryDirectory(prefix="padbench-") as folder:
        made = bench_with(drawn.faults, drawn.base, seed=seed, surface=drawn.surface_mm)
        try:
            seen = press(Path(folder), made, drawn.protocol)
        except Exception as error:  # a defect, whatever it is: that is what is looked for
            return Verdict(seed, "crashed", str(error), [f"crashed: {type(error).__name__}: {error}"])
        verdict = Verdict(seed, seen.how, seen.cause, [*safe(seen, drawn), *named(seen), *kept(seen)])
        file = seen.folder / RECORDING
        verdict.content = file.read_bytes() if file.exists() else b""
    return verdict


TWICE = 10
"""Every so many seeds one is run a second time, and must write the same bytes."""


def tried(seed: int) -> Verdict:
    """A seed, judged; now and then twice."""
    verdict = judge(seed)
    if seed % TWICE == 0:
        verdict.wrong += again(verdict)
    verdict.content = b""
    return verdict


def again(verdict: Verdict) -> list[str]:
    """What differs when the same seed is run once more."""
    second = judge(verdict.seed)
    if (second.how, _placeless(second.cause)) != (verdict.how, _placeless(verdict.cause)):
        return [f"the same seed ended otherwise: {second.how}, {second.cause}"]
    return [] if second.content == verdict.content else ["the same seed wrote other bytes"]


def _placeless(cause: str) -> str:
    """Without the folder, which is another one each time."""
    return re.sub(r"\S*padbench-[^/\\]*", "", cause)


def safe(seen: Seen, drawn: Drawn) -> list[str]:
    """Force and travel within limits and the way to stop, and the motor at rest: of the true bench."""
    struck = {strike.kind for strike in seen.struck}
    shift_mm = sum(_shift_mm(fault) for fault in drawn.faults if fault["kind"] in struck)
    shift_mm += sum(_crept_mm(fault, seen) for fault in drawn.faults if fault["kind"] in struck)
    return seen.unsafe(shift_mm=shift_mm, deceived=bool(struck & set(BLIND)))


def _shift_mm(fault: Any) -> float:
    return abs(float(fault.get("by_mm", 0.0))) if fault["kind"] in SHIFTS else 0.0


def _crept_mm(fault: Any, seen: Seen) -> float:
    """How far the axis may have crept by the end of the run, from when that kind began first."""
    began_s = min(strike.time_s for strike in seen.struck if strike.kind == fault["kind"])
    return abs(float(fault.get("rate_mm_s", 0.0))) * (seen.ended_s - began_s)


def named(seen: Seen) -> list[str]:
    """A run that stopped says something that one of the faults that struck is known to lead to."""
    struck = {strike.kind for strike in seen.struck}
    if seen.how == RECOVERED or seen.cause == "killed":
        return []
    if not struck:
        return [f"stopped although nothing had struck: {seen.cause}"]
    told = [r.says for name in struck for r in KINDS[name].reactions if r.says]
    told += [says for family, says in OF_FAMILY.items() if struck & {kind.name for kind in FAMILIES[family]}]
    if not any(re.search(says, seen.cause) for says in told):
        return [f"the cause names none of {', '.join(sorted(struck))}: {seen.cause}"]
    return []


def kept(seen: Seen) -> list[str]:
    """Every sample up to the last flush is in the recording, and it opens."""
    if seen.how == REFUSED:
        return []
    try:
        recording = seen.recording()
    except Exception as error:  # whatever keeps a recording from opening
        if seen.outcome is None and seen.witness.killed_s is not None and seen.witness.killed_s < 2 * LOST_AT_MOST_s:
            return []  # killed before there was anything to keep
        return [f"the recording does not open: {error}"]
    full = [strike.time_s for strike in seen.struck if strike.kind == "disk_full"]
    if seen.outcome is None or full:
        until_s = min([*full, *([seen.witness.killed_s] if seen.witness.killed_s is not None else [])])
        stamps = recording.load_cell.received_s
        # nothing came, or the host took nothing, or its stamps are of another clock
        silent = any(
            strike.time_s < until_s and (strike.device == "load_cell" or strike.kind in ("host_stall", "clock_step"))
            for strike in seen.struck
        )
        if until_s > 1.0 and not silent and (stamps.size == 0 or stamps[-1] < until_s - LOST_AT_MOST_s):
            return ["what was flushed is not in the recording"]
        return []
    wrong = []
    if recording.lost is not None:
        wrong.append(f"the recording is damaged: {recording.lost}")
    counted = (seen.outcome.motor_samples, seen.outcome.force_samples)
    found = (recording.motor.time_s.size, recording.load_cell.time_s.size)
    if counted != found:
        wrong.append(f"samples are missing: {found} recorded of {counted}")
    return wrong
