"""A series of pads, one after the other: mount, rest, run, fit; skip, redo, leave, and go on another day.

A run that was stopped is done anew after a rest, from its beginning: what a pad has felt is part of its state, and the
half of a protocol is no measurement.
"""

from __future__ import annotations

import datetime
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Literal
from typing import Protocol as Shape

from bench.daily.series_file import Pad, Series, folder_name
from bench.daily.series_state import PadState, State, Turn
from bench.errors import InputError, Refused
from bench.preflight import Preflight
from bench.protocol import Protocol
from bench.recording.lock import holding
from bench.recording.unfinished import left_behind, must_be_idle, notice
from bench.run.folder import REPORT, discard
from bench.run.runner import Notes, Outcome, run_protocol

MOST_STOPPED = 2
"""So many stopped runs of one pad, and with --yes the series goes on with the next."""

Answer = Literal["go", "skip", "redo", "leave"]


def _now() -> datetime.datetime:
    return datetime.datetime.now().astimezone()


class Teller(Shape):
    """Told how far a run is, in every turn of its loop."""

    def tell(self, bench_s: float, label: str) -> None:
        """Seconds of bench time since the start, and what the run is doing."""
        ...


@dataclass
class Person:
    """Who is asked and told; `ask(question, answers)` returns one of the answers. `rest(seconds, label)` waits."""

    ask: Callable[[str, tuple[Answer, ...]], Answer]
    say: Callable[[str], None]
    rest: Callable[[float, str], None]
    analyse: Callable[[Path], None]
    progress: Callable[[], AbstractContextManager[Teller]]
    by_itself: bool = False
    now: Callable[[], datetime.datetime] = _now


@contextmanager
def held(out: Path) -> Iterator[None]:
    """A series' folder, made where there is none, for one process alone: two would erase each other's turns.

    Raises `Refused` where another series measures into it, `InputError` where it cannot be made.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(str(out), f"cannot be made: {error.strerror}", "name another `out` in the list") from None
    with holding(out) as ours:
        if not ours:
            raise Refused(f"{out}: another series is being measured into it\n  wait for its end, or leave it there")
        yield


def measure(series: Series, preflight: Preflight, state: State, person: Person, redo: tuple[str, ...] = ()) -> bool:
    """Measure what is left of the series; the state is on disk after every turn. False where somebody left."""
    for pad_id in redo:
        state.of(pad_id).status = None
    series.out.mkdir(parents=True, exist_ok=True)
    state.write(series.out)
    for number, pad in enumerate(series.pads, start=1):
        kept = state.of(pad.id)
        if kept.status in ("done", "skipped"):
            person.say(f"[{number} of {len(series.pads)}] {pad.id}: {kept.status}")
            _make_up(series, person, kept)
            continue
        if not _one(series, preflight, state, person, number, pad, kept):
            return False
    return True


def _make_up(series: Series, person: Person, kept: PadState) -> None:
    """Analyse a run whose analysis never came to its end: whoever ended it then would never have its figures."""
    last = next((turn for turn in reversed(kept.turns) if turn.status == "done"), None)
    if kept.status == "done" and last is not None and not (series.out / last.folder / REPORT).exists():
        person.say(f"{last.folder} was measured and not analysed: that is done now")
        person.analyse(series.out / last.folder)


def _one(
    series: Series, preflight: Preflight, state: State, person: Person, number: int, pad: Pad, kept: PadState
) -> bool:
    """One pad to its end; False where the person leaves."""
    label = f"[{number} of {len(series.pads)}] {pad.id}"
    thick = f", {pad.thickness:g} mm" if pad.thickness else ""
    answer = person.ask(f"{label}{thick}: mount it, see that the probe is in air", ("go", "skip", "leave"))
    mounted = person.now()
    while True:
        if answer == "leave":
            return False
        if answer == "skip":
            kept.status = "skipped"
            state.write(series.out)
            return True
        rested_s = _rest(series, person, pad, max([mounted, *(turn.ended for turn in kept.turns)]))
        turn = _turn(series, preflight, person, number, pad, kept, rested_s)
        kept.turns.append(turn)
        kept.status = turn.status
        state.write(series.out)
        if turn.status == "done":
            person.analyse(series.out / turn.folder)
            answer = "go" if person.by_itself else person.ask(f"{label}: done", ("go", "redo", "leave"))
            if answer != "redo":
                return answer != "leave"
            continue
        person.say(f"{label}: STOPPED: {turn.cause}")
        if "operator" in turn.cause or "signal" in turn.cause:
            return False  # whoever stops a run by hand wants to look, not to have the next one begin
        if person.by_itself:
            answer = "redo" if _in_a_row(kept) < MOST_STOPPED else "skip"
            if answer == "skip":
                return True  # it stays "stopped": tomorrow it has another turn
            continue
        answer = person.ask(f"{label}: see to the cause, then do it anew", ("redo", "skip", "leave"))


def _in_a_row(kept: PadState) -> int:
    count = 0
    for turn in reversed(kept.turns):
        if turn.status == "done":
            break
        count += 1
    return count


def _rest(series: Series, person: Person, pad: Pad, since: datetime.datetime) -> float | None:
    """Wait until the pad has been left alone for `rest_s`; returns for how long it has been. None: simulated."""
    if series.bench.all_simulated:
        return None  # every simulated run has a pad that was never touched
    left_s = series.rest_s - (person.now() - since).total_seconds()
    if left_s > 0:
        person.rest(left_s, f"{pad.id} rests")
    return (person.now() - since).total_seconds()


def _turn(
    series: Series, preflight: Preflight, person: Person, number: int, pad: Pad, kept: PadState, rested_s: float | None
) -> Turn:
    folder = next(name for name in _names(pad) if not (series.out / name).exists())
    bench = series.bench
    if bench.all_simulated and bench.simulation is not None:  # another pad: another surface, other noise
        simulation = bench.simulation.model_copy(update={"seed": bench.simulation.seed + number - 1})
        bench = bench.model_copy(update={"simulation": simulation})
    if not bench.all_simulated:
        must_be_idle(series.out, bench.name)
    left = left_behind(series.out, bench.name) if not bench.all_simulated else None
    if left is not None:
        person.say(notice(left))
    rested = f"left alone for {rested_s:.0f} s" if rested_s is not None else "simulated: never touched before"
    note = "; ".join([*([pad.note] if pad.note else []), f"{rested}; pad {number} of series {series.name}"])
    where = series.out / folder
    where.mkdir()
    try:
        with person.progress() as progress:
            outcome: Outcome = run_protocol(
                _protocol_of(series, pad),
                bench,
                preflight.plan,
                where,
                believed_text=series.believed_text,
                notes=Notes(pad.id, series.operator, note, series.conditions, rested_s),
                progress=progress.tell,
                planned_s=preflight.duration_s + preflight.approach_s,
                left=left,
            )
    except (InputError, Refused):
        discard(where)
        raise
    cause = outcome.cause or ""
    if outcome.findings.not_safe:
        cause = f"{cause}; NOT SAFE: {outcome.findings.not_safe}: use the emergency stop"
    return Turn(
        folder=folder,
        status="done" if outcome.cause is None else "stopped",
        cause=cause,
        ended=person.now(),
        rested_s=rested_s,
    )


def _protocol_of(series: Series, pad: Pad) -> Protocol:
    """The protocol with the pad as its sample, so that thickness and age stand in the recording."""
    sample = series.protocol.sample.model_copy(update=pad.model_dump(exclude_none=True))
    return series.protocol.model_copy(update={"sample": sample})


def _names(pad: Pad) -> Iterator[str]:
    stem, n = folder_name(pad.id), 2
    yield stem
    while True:
        yield f"{stem}_{n}"
        n += 1


def wait(seconds: float, tell: Callable[[float], None]) -> None:
    """Wait on the wall clock, telling every second how much is left (s)."""
    end_s = time.monotonic() + seconds
    while (left_s := end_s - time.monotonic()) > 0:
        tell(left_s)
        time.sleep(min(1.0, left_s))
