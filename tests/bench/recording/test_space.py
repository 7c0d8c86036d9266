"""Room on the disk: refused before the run, stopped in time while it goes on, and nothing lost where it is full."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from bench.errors import InputError
from bench.recording import Recorder, read_recording, space
from tests.bench.recording.made import StillClock

POSIX = pytest.mark.skipif(sys.platform == "win32", reason="no pipes of this kind there")


def test_a_run_that_does_not_fit_is_refused_with_its_need(tmp_path, monkeypatch):
    free = 500 << 20
    monkeypatch.setattr(space, "free_bytes", lambda folder: free)
    Recorder(tmp_path / "fits.mcap", StillClock(), planned_s=3600, samples_per_s=1500).close()
    with pytest.raises(InputError) as refused:
        Recorder(tmp_path / "run.mcap", StillClock(), planned_s=2 * 3600, samples_per_s=1500)
    need = (32 << 20) + 7200 * (1500 * space.SAMPLE_SIZE + 25 * space.CHUNK_COST)
    assert refused.value.status == 2 and refused.value.place == str(tmp_path)
    assert f"{need / 1e6:.1f} MB" in str(refused.value) and f"{free / 1e6:.1f} MB are free" in str(refused.value)
    assert "--out" in refused.value.cure
    assert not (tmp_path / "run.mcap").exists()


@pytest.mark.parametrize("rate", [2.0, 10.0, 50.0, 100.0, 775.0])
def test_the_estimate_is_not_too_small(tmp_path, rate):
    """A run takes less than what is reckoned with, and not so much less that it means nothing; at any rate."""
    path = tmp_path / "run.mcap"
    rng, count = np.random.default_rng(2), 3000
    recorder = Recorder(path, StillClock())
    start = path.stat().st_size
    for k, (x, f) in enumerate(rng.normal(0, 1, (count, 2)).tolist()):
        at = k / rate
        recorder.motor(at, at + 3e-4, round(x, 3), x, f)
        recorder.force(at, at + 4e-3, f, round(f, 3))
        recorder.tick(at + 4e-3)
    recorder.close()
    reckoned = space.need_bytes(count / rate, 2 * rate) - space.RESERVE
    assert reckoned / 4 < path.stat().st_size - start < reckoned


@POSIX
@pytest.mark.parametrize("mode", ["inline", "process"])
def test_at_the_reserve_the_loop_is_told_and_the_end_is_still_recorded(tmp_path, mode, monkeypatch):
    """The reserve is more than any disk has; what comes after the problem is in the file, and so is the result."""
    path = tmp_path / "run.mcap"
    clock = StillClock()
    with monkeypatch.context() as patch:
        patch.setattr(space, "RESERVE", 0)
        if mode == "inline":
            recorder = Recorder(path, clock)
            patch.setattr(space, "RESERVE", 1 << 62)
        else:
            site = tmp_path / "site"  # the writer is a process of its own: it is told by a module it imports first
            site.mkdir()
            (site / "sitecustomize.py").write_text("import bench.recording.space as space\nspace.RESERVE = 1 << 62\n")
            patch.setenv("PYTHONPATH", f"{site}:{Path.cwd()}")
            recorder = Recorder(path, clock, mode="process")
        recorder.begin({"protocol": "made"}, {})
        told = None
        for i in range(200_000):
            clock.time_s = i * 1e-3
            recorder.motor(clock.time_s, clock.time_s, float(i))
            recorder.tick(clock.time_s)
            told = told if told is not None or recorder.problem() is None else i
            if told is not None and i > told + 500:
                break
        problem = recorder.finish({"status": "stopped"})
    assert problem is not None and "nearly full" in problem and str(tmp_path) in problem
    recording = read_recording(path)
    assert recording.lost is None and recording.result is not None and recording.result["status"] == "stopped"
    assert recording.motor.position_mm.tolist() == [float(k) for k in range(i + 1)]


FULL = """
import sys
from pathlib import Path
from bench.recording import Recorder, space
from tests.bench.recording.made import StillClock
import time
space.RESERVE = 0
space.UNTOLD_S = 0.0
clock = StillClock()
recorder = Recorder(Path("/mnt/run.mcap"), clock, mode=sys.argv[1])
recorder.begin({"protocol": "made"}, {})
for i in range(1_000_000):
    clock.time_s = i * 1e-3
    recorder.motor(clock.time_s, clock.time_s, hash(i * 1.7) % 1000003 / 7.0)
    recorder.tick(clock.time_s)
    if recorder.problem():
        break
    if i % 100 == 0:
        time.sleep(0.001)
print(i, recorder.problem())
recorder.finish({"status": "stopped"})
"""


@POSIX
@pytest.mark.parametrize("mode", ["inline", "process"])
def test_a_disk_that_is_really_full_loses_nothing_that_was_recorded(tmp_path, mode):
    """A file system of one megabyte, in a namespace of its own."""
    unshare = shutil.which("unshare")
    namespace = [unshare, "-rm"] if unshare else ["false"]
    if subprocess.run([*namespace, "mount", "-t", "tmpfs", "none", "/mnt"], capture_output=True).returncode:
        pytest.skip("no namespaces with file systems of one's own here")
    (tmp_path / "full.py").write_text(FULL)
    (tmp_path / "sitecustomize.py").write_text("import bench.recording.space as space\nspace.RESERVE = 0\n")
    script = (
        f'mount -t tmpfs -o size=1m none /mnt && "{sys.executable}" {tmp_path}/full.py {mode} && cp /mnt/run.mcap .'
    )
    env = {"PYTHONPATH": f"{tmp_path}:{Path.cwd()}", "PATH": "/usr/bin:/bin:/usr/sbin:/sbin"}
    done = subprocess.run(
        [*namespace, "sh", "-c", script], cwd=tmp_path, env=env, capture_output=True, text=True, timeout=60, check=True
    )
    count, problem = done.stdout.split(maxsplit=1)
    assert "No space left" in problem and done.stderr == ""
    recording = read_recording(tmp_path / "run.mcap")
    size = recording.motor.time_s.size
    assert np.array_equal(recording.motor.time_s, np.arange(size) / 1000), "no gap in what is there"
    assert (tmp_path / "run.mcap").stat().st_size > 0.9 * (1 << 20)
    assert recording.lost is not None and "damaged" not in recording.lost and "cut off" not in recording.lost
    assert size <= int(count) + 1
    if mode == "inline":
        assert int(count) - size < 100, "no more than what waited for its flush, and what the disk refused"
