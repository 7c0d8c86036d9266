"""What is wrong with the host before a run begins: it is said, exit code 2, and nothing is commanded."""

from __future__ import annotations

import errno
import os
from pathlib import Path
from unittest import mock

from bench.run.folder import RECORDING
from tests.faults.faulty import bench_with, press


def test_a_folder_that_cannot_be_written(tmp_path):
    """As the system says it of a read-only file system (a test's user may well be allowed everything)."""
    open_ = Path.open

    def refused(path: Path, mode: str = "r", *args: object, **options: object) -> object:
        if path.name == RECORDING and mode != "r" and mode != "rb":
            raise OSError(errno.EROFS, os.strerror(errno.EROFS), str(path))
        return open_(path, mode, *args, **options)

    with mock.patch.object(Path, "open", refused):
        seen = press(tmp_path, bench_with([]))
    assert seen.how == "refused to start"
    assert RECORDING in seen.cause and os.strerror(errno.EROFS) in seen.cause
    assert seen.witness.hardest_N == 0.0 and not seen.unsafe()
    assert not seen.world.plant.servo_on


def test_a_disk_with_no_room(tmp_path):
    with mock.patch("bench.recording.space.free_bytes", lambda folder: 1000):
        seen = press(tmp_path, bench_with([]))
    assert seen.how == "refused to start"
    assert "free" in seen.cause and "make room" in seen.cause
    assert not seen.world.plant.servo_on and not seen.unsafe()
