"""A run that is going on, and one that was killed: told apart by who holds the file. With real processes."""

from __future__ import annotations

import os
import shutil
import signal
import sys
import time

import pytest

from bench.errors import InputError, Refused
from bench.recording import Recorder, left_behind, read_recording, recover
from bench.recording.lock import hold, is_alive, is_held
from bench.recording.unfinished import must_be_idle
from tests.bench.recording.made import StillClock
from tests.bench.recording.test_killed import Victim

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="flock and SIGKILL are POSIX")


@pytest.mark.parametrize("mode", ["inline", "process"])
def test_a_run_that_goes_on_has_left_nothing_and_one_that_was_killed_has(tmp_path, mode):
    folder = tmp_path / "runs" / "now"
    folder.mkdir(parents=True)
    victim = Victim(folder / "recording.mcap", mode, 0.2)
    try:
        who = f"process {victim.process.pid})"
        assert left_behind(tmp_path / "runs") is None
        with pytest.raises(Refused, match="is going on") as refused:
            must_be_idle(tmp_path / "runs", "lab")
        assert str(folder) in str(refused.value) and who in str(refused.value)
        must_be_idle(tmp_path / "runs", "another")
        with pytest.raises(InputError, match="is being written") as said:
            recover(folder)
        assert who in str(said.value) and len(list(folder.iterdir())) == 1, "and nothing was begun"
        assert read_recording(folder).motor.time_s.size > 50, "reading it goes on"
    finally:
        victim.kill(writer_too=True)
    must_be_idle(tmp_path / "runs", "lab")
    left = left_behind(tmp_path / "runs", "lab")
    assert left is not None and left.folder == folder and "did not come to its end" in left.why
    recover(folder)


def test_the_writer_of_a_run_that_was_killed_is_waited_for(tmp_path):
    folder = tmp_path / "runs" / "now"
    folder.mkdir(parents=True)
    victim = Victim(folder / "recording.mcap", "process", 0.2)
    os.kill(victim.writer, signal.SIGSTOP)  # it comes to its work only later
    victim.kill(writer_too=False)
    assert is_held(folder / "recording.mcap")
    os.kill(victim.writer, signal.SIGCONT)
    left = left_behind(tmp_path / "runs")
    assert left is not None and left.folder == folder
    assert read_recording(folder).lost is None, "it has been finished"


def test_a_copy_of_a_run_that_goes_on_is_a_torn_file(tmp_path):
    clock = StillClock()
    with Recorder(tmp_path / "run.mcap", clock) as recorder:
        recorder.begin({"protocol": "quick"}, {})
        recorder.motor(0.0, 0.0, 1.0)
        recorder.tick(1.0)
        shutil.copy(tmp_path / "run.mcap", tmp_path / "copy.mcap")
        assert recover(tmp_path / "copy.mcap")[1].per_topic == {"/motor": 1}
        with pytest.raises(InputError, match=rf"process {os.getpid()}\)"):
            recover(tmp_path / "run.mcap")
    assert not is_held(tmp_path / "run.mcap")


def test_where_there_are_no_locks_nobody_holds_anything(tmp_path, monkeypatch):
    monkeypatch.setattr("bench.recording.lock.fcntl", None)
    with Recorder(tmp_path / "run.mcap", StillClock()) as recorder:
        recorder.begin({}, {})
        assert not is_held(tmp_path / "run.mcap")
        assert recover(tmp_path / "run.mcap")[1].has_result is False


def test_a_question_at_the_wrong_moment_does_not_keep_the_writer_from_its_lock(tmp_path):
    path = tmp_path / "file"
    path.touch()
    first, second = os.open(path, os.O_RDONLY), os.open(path, os.O_RDONLY)
    try:
        started = time.monotonic()
        assert hold(first) and not hold(second)
        assert time.monotonic() > started, "it has asked more than once"
        assert is_held(path)
    finally:
        os.close(first)
        assert hold(second)
        os.close(second)
    assert not is_held(path) and not is_held(tmp_path / "none")
    assert is_alive(os.getpid()) and is_alive(1) and not is_alive(2**40)
