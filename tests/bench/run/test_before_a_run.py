"""What a run looks at before it begins: what the last one left, the room on the disk, the names in its bench file."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench.config import Bench, load_bench
from bench.errors import InputError
from bench.preflight import check
from bench.protocol import load_protocol
from bench.recording import left_behind, read_recording
from bench.recording.space import RESERVE
from bench.run.runner import Notes, run_protocol
from tests.bench.recording.test_unfinished import run_of
from tests.bench.run.benches import AIR, SHORT, bench_file, protocol_file


def begin(folder: Path, **given: object):
    """A short run on the simulated bench; what `run_protocol` is given besides."""
    bench = load_bench(bench_file(folder))
    protocol = load_protocol(protocol_file(folder, SHORT))
    out = folder / "run"
    out.mkdir()
    return run_protocol(protocol, bench, check(protocol, bench, None).plan, out, **given)


def test_what_the_last_run_left_is_an_event_of_this_one(tmp_path):
    run_of(tmp_path / "runs", "killed", 10, None)
    left = left_behind(tmp_path / "runs")
    assert left is not None and left.pressing
    recording = read_recording(begin(tmp_path, left=left).folder)
    (event,) = [event for event in recording.events if event.name == "left_behind"]
    assert event.data["pressing"] is True
    assert event.data["position_mm"] == pytest.approx(1.25) and event.data["surface_mm"] == pytest.approx(0.5)
    assert event.time_s < min(e.time_s for e in recording.events if e.name == "devices")


def test_run_and_status_tell_it_before_anything_else(padbench, tmp_path, monkeypatch):
    """A bench that counts as a real one; the run before was killed 0.75 mm deep in a pad."""
    monkeypatch.setattr(Bench, "all_simulated", property(lambda bench: False))
    protocol = protocol_file(tmp_path, AIR)
    run_of(Path("runs"), "killed", 10, None, bench="simulated")
    said = padbench("status", "simulated")
    assert said.status == 0 and "the motor at 1.250 mm, in the pad" in said.out
    said = padbench("run", protocol, "--bench", "simulated", "--attended")
    assert said.status == 0, said
    assert "NOTICE" in said.out and "the motor at 1.250 mm, in the pad" in said.out and "padbench release" in said.out
    assert said.out.index("NOTICE") < said.out.index("bench time")


@pytest.mark.parametrize("bench", ["simulated", "another"])
def test_a_run_that_ended_well_and_another_bench_are_nothing_to_tell(padbench, tmp_path, monkeypatch, bench):
    monkeypatch.setattr(Bench, "all_simulated", property(lambda bench: False))
    result = {"status": "done"} if bench == "simulated" else None
    run_of(Path("runs"), "before", 10, result, bench=bench)
    assert "NOTICE" not in padbench("status", "simulated").out


@pytest.mark.parametrize(("planned_s", "fits"), [(10.0, True), (10_000.0, False)])
def test_the_room_is_reckoned_for_the_plan(tmp_path, monkeypatch, planned_s, fits):
    """1549 samples a second of 70 bytes, 25 chunks: 1.2 MB for ten seconds, 1.2 GB for ten thousand."""
    monkeypatch.setattr("bench.recording.space.free_bytes", lambda folder: RESERVE + 100_000_000)
    if fits:
        assert begin(tmp_path, planned_s=planned_s).cause is None
    else:
        with pytest.raises(InputError, match=r"1\.[23] GB there, .* are free"):
            begin(tmp_path, planned_s=planned_s)


def test_for_how_long_the_pad_was_left_alone(tmp_path):
    outcome = begin(tmp_path, notes=Notes(since_contact_s=600.0))
    assert read_recording(outcome.folder).run["since_contact_s"] == "600.0"


@pytest.mark.parametrize("name", ["x" * 5000, "a" * 300 + ".yaml"])
@pytest.mark.parametrize("key", ["pad", "map"])
def test_a_name_that_no_file_can_have(tmp_path, key, name):
    changes = {"simulation": {"pad": name}} if key == "pad" else {"motor": {"driver": "registers", "map": name}}
    with pytest.raises(InputError, match="there is no file"):
        load_bench(bench_file(tmp_path, **changes))
