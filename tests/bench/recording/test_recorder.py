"""What the recorder writes, read back with the library's own reader."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader

from bench.errors import InputError
from bench.recording import Recorder, StepMark, read_recording
from tests.bench.recording.made import EPOCH_NS, TRUTH_TEXT, StillClock, force_at, position_at, write_run

MODES = ["inline", "process"]


def library_view(path: Path) -> tuple[dict[str, list[Any]], dict[str, dict[str, str]], dict[str, bytes]]:
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        topics = defaultdict(list)
        for schema, channel, message in reader.iter_messages():
            topics[channel.topic].append((schema, channel, message))
        metadata = {m.name: m.metadata for m in reader.iter_metadata()}
        attachments = {a.name: a.data for a in reader.iter_attachments()}
    return topics, metadata, attachments


@pytest.mark.parametrize("mode", MODES)
def test_every_sample_stands_in_the_file_with_both_its_times(tmp_path, mode):
    path = tmp_path / "run.mcap"
    write_run(path, mode=mode)
    topics, metadata, attachments = library_view(path)
    motor = [message for _, _, message in topics["/motor"]]
    assert [m.sequence for m in motor] == list(range(3000))
    assert [m.log_time for m in motor] == [EPOCH_NS + 1_000_000 * i for i in range(3000)]
    assert [m.publish_time for m in motor] == [EPOCH_NS + 1_000_000 * i - 200_000 for i in range(3000)]
    assert json.loads(motor[200].data) == {"position_mm": position_at(200), "command_mm": position_at(200) + 0.01}
    assert json.loads(motor[0].data) == {"position_mm": position_at(0)}, "no command yet: the field is not there"
    cell = [json.loads(message.data) for _, _, message in topics["/load_cell"]]
    assert len(cell) == 1500
    assert cell[10] == {"force_N": force_at(20), "gross_N": force_at(20) + 0.5, "flags": "stable", "overload": False}
    assert cell[750]["overload"] is True and cell[750]["flags"] == "stable overload"
    assert [json.loads(m.data)["name"] for _, _, m in topics["/event"]] == ["touch_off"]
    step = json.loads(topics["/step"][2][2].data)
    assert step == {"name": "steps[0]", "phase": "steps", "kind": "hold", "target_mm": 1.0}
    assert list(metadata)[0] == "padbench.run" and list(metadata)[-1] == "padbench.result"
    assert metadata["padbench.run"]["seed"] == "7" and metadata["padbench.run"]["protocol"] == "made"
    assert metadata["padbench.result"]["motor_samples"] == "3000"
    assert json.loads(metadata["padbench.result"]["traffic"]) == {"bytes_in": 3}
    assert attachments["protocol.yaml"] == b"name: made\n"


def test_viewers_find_what_they_need(tmp_path):
    """Foxglove: JSON with a jsonschema whose root is an object, foxglove.Log by its exact name, flat number fields."""
    path = tmp_path / "run.mcap"
    write_run(path)
    topics, _, _ = library_view(path)
    names = {topic: entries[0][0].name for topic, entries in topics.items()}
    assert names["/log"] == "foxglove.Log"
    for entries in topics.values():
        schema, channel, _ = entries[0]
        assert channel.message_encoding == "json" and schema.encoding == "jsonschema"
        assert json.loads(schema.data)["type"] == "object"
    for topic in ("/motor", "/load_cell"):
        schema, channel, message = topics[topic][-1]
        fields = json.loads(schema.data)["properties"]
        assert set(json.loads(message.data)) <= set(fields)
        assert all(p["type"] in ("number", "string", "boolean") for p in fields.values())
        assert "position_mm: mm" in channel.metadata["units"] or "force_N: N" in channel.metadata["units"]
    log = json.loads(topics["/log"][0][2].data)
    assert log["level"] == 2 and log["message"] == "surface found"
    assert log["timestamp"] == {"sec": EPOCH_NS // 10**9, "nsec": 500_000_000}


def test_no_nan_ever_reaches_the_json(tmp_path):
    path = tmp_path / "run.mcap"
    recorder = Recorder(path, StillClock())
    recorder.begin({}, {})
    recorder.motor(0.0, 0.0, math.nan, math.inf, -math.inf)
    recorder.motor(0.1, 0.1, np.float64(1.5), np.float64("nan"), np.float32(0.25))
    recorder.force(0.0, 0.0, math.nan, math.inf)
    recorder.event(0.0, "odd", {"a": math.nan, "b": [1.0, math.inf], "c": np.arange(2), "d": {"e": math.nan}})
    recorder.step(StepMark(0.0, "s", "steps", "hold"))
    recorder.finish({})
    topics, _, _ = library_view(path)

    def strict(constant: str) -> None:
        raise AssertionError(constant)

    seen = {t: [json.loads(m.data, parse_constant=strict) for _, _, m in e] for t, e in topics.items()}
    assert seen["/motor"] == [{}, {"position_mm": 1.5, "force_N": 0.25}]
    assert seen["/load_cell"] == [{"flags": "", "overload": False}]
    assert seen["/event"] == [{"name": "odd", "b": [1.0, None], "c": [0, 1], "d": {}}]
    assert seen["/step"] == [{"name": "s", "phase": "steps", "kind": "hold"}]


def test_same_calls_same_bytes_but_for_the_host_record(tmp_path):
    """Two runs of one seed differ in `padbench.host` alone: its length shifts nothing else."""
    one, two = tmp_path / "one.mcap", tmp_path / "two.mcap"
    write_run(one, host={"python": "3.11.7", "started": "2026-01-01T00:00:00"})
    write_run(
        two, host={"python": "3.13", "started": "2026-02-03T10:11:12.123456", "machine": "another, with a long name"}
    )
    a, b = one.read_bytes(), two.read_bytes()
    assert len(a) == len(b)
    differing = [i for i in range(len(a)) if a[i] != b[i]]
    start = a.index(b"padbench.host")
    assert start == b.index(b"padbench.host")
    assert start < differing[0] and differing[-1] < start + 4096 + 64
    write_run(tmp_path / "three.mcap", host={"python": "3.11.7", "started": "2026-01-01T00:00:00"})
    assert (tmp_path / "three.mcap").read_bytes() == a


def test_the_truth_is_in_its_own_record_and_nowhere_else(tmp_path):
    path = tmp_path / "run.mcap"
    write_run(path)
    _, metadata, attachments = library_view(path)
    assert metadata["padbench.simulation"]["bench_file_block"] == TRUTH_TEXT
    assert json.loads(metadata["padbench.simulation"]["noise"]) == {"force": 0.01}
    assert b"secret" not in attachments["bench.yaml"] and b"# a comment" in attachments["bench.yaml"]
    recording = read_recording(path)
    assert "secret" not in repr(recording)


@pytest.mark.parametrize("mode", MODES)
def test_an_existing_file_is_never_overwritten(tmp_path, mode):
    path = tmp_path / "run.mcap"
    path.write_text("precious")
    with pytest.raises(InputError, match="exists already"):
        Recorder(path, StillClock(), mode=mode)
    assert path.read_text() == "precious"
    with pytest.raises(InputError, match="cannot be written"):
        Recorder(tmp_path / "nowhere" / "run.mcap", StillClock(), mode=mode)


FULL_DISK = """
import resource, sys, time
from pathlib import Path
from bench.recording import Recorder
from tests.bench.recording.made import StillClock
resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, 200_000))
clock = StillClock()
recorder = Recorder(Path(sys.argv[1]), clock, mode=sys.argv[2])
recorder.begin({}, {})
for i in range(400_000):
    clock.time_s = i * 1e-3
    recorder.motor(clock.time_s, clock.time_s, hash(i * 1.7) % 1000003 / 7.0)
    recorder.tick(clock.time_s)
    if recorder.problem():
        break
    if i % 100 == 0:
        time.sleep(0.001)
print(i)
print(recorder.finish({"status": "done"}))
"""


@pytest.mark.skipif(sys.platform == "win32", reason="no file size limit there")
@pytest.mark.parametrize("mode", MODES)
def test_a_full_disk_is_told_and_what_is_on_it_can_be_read(tmp_path, mode):
    """A file size limit stands for the full disk: the write fails with EFBIG where that fails with ENOSPC."""
    path = tmp_path / "run.mcap"
    command = [sys.executable, "-c", FULL_DISK, str(path), mode]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    count, problem = done.stdout.splitlines()
    assert int(count) < 399_999 and "cannot write" in problem and "large" in problem, done.stdout
    assert done.stderr == ""
    recording = read_recording(path)
    assert recording.result is None and recording.lost
    assert recording.motor.time_s.size > 100
    assert np.array_equal(recording.motor.time_s, np.arange(recording.motor.time_s.size) / 1000)


@pytest.mark.skipif(sys.platform == "win32", reason="written inline there")
def test_a_dead_writer_process_is_a_problem(tmp_path):
    import os
    import signal

    clock = StillClock()
    recorder = Recorder(tmp_path / "run.mcap", clock, mode="process")
    recorder.begin({}, {})
    assert recorder.writer_pid is not None
    os.kill(recorder.writer_pid, signal.SIGKILL)
    os.waitid(os.P_PID, recorder.writer_pid, os.WEXITED | os.WNOWAIT)
    for i in range(100):
        clock.time_s = i * 0.01
        recorder.motor(clock.time_s, clock.time_s, 0.0)
    assert recorder.problem() is not None and "died" in recorder.problem()
    assert recorder.finish({}) == recorder.problem()


@pytest.mark.skipif(sys.platform == "win32", reason="written inline there")
def test_a_disk_that_hangs_never_holds_the_loop(tmp_path, monkeypatch):
    """The writer process is stopped: the pipe fills, the buffer fills, samples are counted as lost, no call waits."""
    import os
    import signal

    from bench.recording import process_store

    monkeypatch.setattr(process_store, "BUFFER_LIMIT", 100_000)
    clock = StillClock()
    path = tmp_path / "run.mcap"
    recorder = Recorder(path, clock, mode="process")
    recorder.begin({}, {})
    os.kill(recorder.writer_pid, signal.SIGSTOP)
    handed = 0
    while recorder.problem() is None:
        clock.time_s = handed * 1e-3
        recorder.motor(clock.time_s, clock.time_s, float(handed))
        handed += 1
        assert handed < 100_000
    os.kill(recorder.writer_pid, signal.SIGCONT)
    assert "not written fast enough" in recorder.finish({})
    recording = read_recording(path)
    assert recording.result["messages_lost"] == "1"
    assert recording.motor.position_mm.tolist() == [float(i) for i in range(handed - 1)], "all that was taken is there"


def test_files_of_a_clock_that_begins_in_1970(tmp_path):
    """MCAP's times are unsigned; a sample measured before the clock's zero has its stamp all the same."""
    path = tmp_path / "run.mcap"
    recorder = Recorder(path, StillClock(epoch_ns=0))
    recorder.begin({}, {})
    recorder.motor(-0.5, 0.0, 1.0)
    recorder.finish({})
    assert read_recording(path).motor.time_s.tolist() == [-0.5]


def test_leaving_without_finish_leaves_a_whole_but_unfinished_run(tmp_path):
    path = tmp_path / "run.mcap"
    with Recorder(path, StillClock()) as recorder:
        recorder.begin({}, {})
        recorder.motor(0.0, 0.0, 1.0)
    recording = read_recording(path)
    assert recording.result is None and recording.lost is None and recording.motor.time_s.size == 1


def test_an_event_keeps_its_name(tmp_path):
    with Recorder(tmp_path / "run.mcap", StillClock()) as recorder, pytest.raises(ValueError, match="'name'"):
        recorder.event(0.0, "fault", {"name": "overheated"})
