"""Every kind of fault, on a bench that has it: it ends as the table says, names what happened, and leaves no harm."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

from bench.run.runner import Outcome
from sim.faults import KINDS, RECOVERED, REFUSED, STOPPED, Kind, Reaction
from tests.faults.faulty import Seen, bench_with, press

LOST_AT_MOST_s = 0.3
"""A killed process loses what it had not flushed: a quarter of a second, and what was on the wire."""


def cases() -> Iterator[object]:
    """Of every day the first of what one kind may come to on one device; and each sixth of what is like it."""
    alike: Counter[tuple[str, str, str]] = Counter()
    for kind in KINDS.values():
        for number, reaction in enumerate(kind.reactions):
            told = (kind.name, reaction.device, reaction.outcome)
            marks = [pytest.mark.long] if alike[told] % 6 else []
            alike[told] += 1
            yield pytest.param(kind, reaction, id=f"{kind.name}-{reaction.device}-{number}", marks=marks)


@pytest.mark.parametrize(("kind", "reaction"), list(cases()))
def test_how_a_run_comes_out_of_it(tmp_path, kind: Kind, reaction: Reaction):
    seen = struck(tmp_path / "1", kind, reaction, 1)
    if reaction.outcome == RECOVERED and seen.how == STOPPED:
        # Chance may strike where nothing could be made good: that is safe too, and rare.
        assert not seen.unsafe()
        again = [struck(tmp_path / str(seed), kind, reaction, seed) for seed in (2, 3)]
        assert all(s.how == RECOVERED for s in again), seen.cause
        seen = again[0]
    assert seen.how == reaction.outcome, seen.cause
    assert re.search(reaction.says, seen.cause), seen.cause
    assert not seen.unsafe()
    if reaction.outcome == REFUSED:
        assert seen.witness.hardest_N == 0.0, "nothing was to be commanded"
        return
    if seen.outcome is None:
        kept_as_far_as_flushed(seen)
    else:
        recorded_whole(seen, seen.outcome)
        if reaction.shows:
            assert shown(seen, reaction.shows) > 0
        if kind.name != "disk_full":
            assert (seen.recording().result or {}).get("cause", "") == seen.cause


def struck(folder: Path, kind: Kind, reaction: Reaction, seed: int) -> Seen:
    """A run with the fault, which strikes where the seed has it."""
    folder.mkdir()
    fault = {"kind": kind.name, "device": reaction.device, **reaction.fault}
    seen = press(folder, bench_with([fault], reaction.bench, seed=seed))
    assert seen.struck, "the fault never struck"
    return seen


def recorded_whole(seen: Seen, outcome: Outcome) -> None:
    """Each sample that the loop took is in the recording, up to a disk that is full."""
    recording = seen.recording()
    struck = seen.struck[0]
    if struck.kind == "disk_full":
        assert recording.load_cell.received_s[-1] > struck.time_s - LOST_AT_MOST_s
        return
    assert recording.lost is None
    assert recording.motor.time_s.size == outcome.motor_samples
    assert recording.load_cell.time_s.size == outcome.force_samples


def kept_as_far_as_flushed(seen: Seen) -> None:
    """The file of a killed run opens, says that it is unfinished, and ends shortly before the kill."""
    recording = seen.recording()
    killed_s = seen.witness.killed_s
    assert killed_s is not None and recording.result is None
    assert killed_s - LOST_AT_MOST_s < recording.load_cell.received_s[-1] <= killed_s


def shown(seen: Seen, where: str) -> float:
    """What the counters say: those of one line that tell of trouble, or one of the result's own."""
    import json

    result = seen.recording().result or {}
    if where in result:
        return float(result[where])
    traffic = json.loads(result["traffic"])[where]
    return float(sum(traffic[name] for name in ("timeouts", "bad_frames", "retries", "refusals", "stray_bytes")))


def test_there_are_faults_of_all_sorts():
    """At least 45 that differ in kind, device or what becomes of them."""
    different = {(kind.name, r.device, r.outcome) for kind in KINDS.values() for r in kind.reactions}
    assert len(different) >= 45
    assert {r.outcome for kind in KINDS.values() for r in kind.reactions} == {RECOVERED, STOPPED, REFUSED}
    for kind in KINDS.values():
        assert {reaction.device for reaction in kind.reactions} <= set(kind.devices)
        assert kind.reactions, f"{kind.name}: nobody says what is to become of it"
