"""What the next start is told of the last run."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from bench.recording import Recorder, left_behind
from tests.bench.recording.made import StillClock


def run_of(
    runs: Path,
    name: str,
    age_s: int,
    result: dict[str, object] | None,
    *,
    bench: str = "lab",
    simulated: bool = False,
    cut: int = 0,
) -> Path:
    """A run that ended at 1.25 mm and 0.75 N, the pad's surface at 0.5 mm."""
    folder = runs / name
    folder.mkdir(parents=True)
    file = folder / "recording.mcap"
    clock = StillClock()
    recorder = Recorder(file, clock)
    recorder.begin({"bench": bench, "simulated": simulated}, {})
    recorder.surface(0.0, 0.5, 0.01)
    for i in range(100):
        recorder.motor(i * 1e-2, i * 1e-2, 1.25 - 0.01 * (99 - i))
        recorder.force(i * 1e-2, i * 1e-2, 0.75, 1.0)
        recorder.tick(i * 1e-2)
    if result is None:
        recorder.close()
    else:
        recorder.finish(result)
    if cut:
        file.write_bytes(file.read_bytes()[:-cut])
    os.utime(file, (2e9 - age_s, 2e9 - age_s))
    return folder


def test_a_run_that_ended_leaves_nothing(tmp_path):
    assert left_behind(tmp_path / "none") is None
    assert left_behind(tmp_path) is None
    run_of(tmp_path, "old", 10, None)
    run_of(tmp_path, "new", 5, {"status": "stopped", "safe_state": {"state": "release"}})
    assert left_behind(tmp_path) is None, "what came before the last run has been dealt with"


@pytest.mark.parametrize("cut", [0, 40, 3000])
def test_a_killed_run_leaves_the_motor_where_it_was_seen_last(tmp_path, cut):
    run_of(tmp_path, "old", 10, {"status": "done"})
    folder = run_of(tmp_path, "new", 5, None, cut=cut)
    left = left_behind(tmp_path)
    assert left is not None and (left.folder, left.bench) == (folder, "lab")
    assert left.position_mm == pytest.approx(1.25, abs=0.25 if cut > 100 else 1e-9)
    assert left.force_N == 0.75 and left.surface_mm == 0.5 and left.pressing
    assert "did not come to its end" in str(left) and "in the pad" in str(left) and "0.75 N" in str(left)


def test_a_motor_that_was_not_made_safe_is_told(tmp_path):
    run_of(tmp_path, "new", 5, {"status": "stopped", "not_safe": "no answer to 'read'"})
    left = left_behind(tmp_path)
    assert left is not None and "no answer to 'read'" in left.why and left.position_mm == pytest.approx(1.25)


def test_simulated_runs_other_benches_and_junk_are_passed_over(tmp_path):
    run_of(tmp_path, "killed", 20, None)
    run_of(tmp_path, "simulated", 10, None, simulated=True)
    run_of(tmp_path, "elsewhere", 8, {"status": "done"}, bench="other")
    (tmp_path / "junk").mkdir()
    (tmp_path / "junk" / "recording.mcap").write_bytes(b"junk" * 100)
    (tmp_path / "notes.txt").write_text("no run")
    assert left_behind(tmp_path) is None, "the other bench's run is the last of all"
    left = left_behind(tmp_path, "lab")
    assert left is not None and left.folder.name == "killed"
    assert left_behind(tmp_path, "other") is None and left_behind(tmp_path, "third") is None
