"""A run's memory does not grow with its length: what a day needs in the end waits in a file."""

from __future__ import annotations

import errno
import gc
import io
import os
import tempfile
import tracemalloc
from pathlib import Path

import pytest

from bench.config import load_bench
from bench.preflight import check
from bench.protocol import load_protocol
from bench.recording import read_recording, spool
from bench.recording.mcap_file import McapFile
from bench.recording.schemas import RUN_TOPICS
from bench.recording.spool import Spool
from bench.run.runner import run_protocol
from tests.bench.recording.test_mcap_file import EPOCH_NS, Library, fill
from tests.benchmarks.day import RATE_HZ, write_files

RUN_S = 100.0
FROM_S, UNTIL_S = 30.0, 95.0
MOST_BYTES = 2.0
"""A sample. An entry of the index kept as an object would be 80; a number kept of each sample at least 8."""


@pytest.mark.long
def test_minutes_at_100_Hz_cost_no_memory_a_sample(tmp_path, monkeypatch):
    monkeypatch.setattr(spool, "IN_MEMORY", 4096)
    protocol_file, bench_file = write_files(tmp_path, RUN_S / 3600.0)
    protocol, bench = load_protocol(str(protocol_file)), load_bench(str(bench_file))
    plan = check(protocol, bench, None).plan
    seen: dict[float, int] = {}

    def look(at_s: float, _label: str) -> None:
        for when_s in (FROM_S, UNTIL_S):
            if at_s >= when_s and when_s not in seen:
                gc.collect()
                seen[when_s] = tracemalloc.get_traced_memory()[0]

    tracemalloc.start()
    try:
        outcome = run_protocol(protocol, bench, plan, tmp_path, progress=look)
    finally:
        tracemalloc.stop()
    assert outcome.cause is None
    samples = 2.0 * RATE_HZ * (UNTIL_S - FROM_S)
    assert (seen[UNTIL_S] - seen[FROM_S]) / samples < MOST_BYTES
    recording = read_recording(tmp_path)
    assert recording.lost is None
    assert recording.motor.time_s.size == outcome.motor_samples
    assert recording.load_cell.time_s.size == outcome.force_samples


@pytest.mark.parametrize("in_memory", [1, 100, 3000])
def test_an_index_that_waited_in_a_file_is_the_same(tmp_path, monkeypatch, in_memory):
    monkeypatch.setattr(spool, "IN_MEMORY", in_memory)
    monkeypatch.setattr(spool, "PIECE", 70)
    fill(McapFile(tmp_path / "ours.mcap", RUN_TOPICS, EPOCH_NS), 9000, seed=5)
    fill(Library(tmp_path / "theirs.mcap"), 9000, seed=5)
    assert (tmp_path / "ours.mcap").read_bytes() == (tmp_path / "theirs.mcap").read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["ours.mcap", "theirs.mcap"], "and no file is left"


class Full(io.FileIO):
    """A file on a disk that takes ten bytes more, and then none for the next few writes."""

    refusals = 3

    def write(self, data: bytes) -> int:  # type: ignore[override]
        if len(data) > 10 and Full.refusals:
            return super().write(bytes(data[:10]))
        if Full.refusals:
            Full.refusals -= 1
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return super().write(data)


def test_a_full_disk_loses_nothing_of_it(tmp_path, monkeypatch):
    def full(buffering: int, dir: Path) -> Full:
        handle, name = tempfile.mkstemp(dir=dir)
        return Full(handle, "r+b")

    monkeypatch.setattr(Full, "refusals", 3)
    monkeypatch.setattr(tempfile, "TemporaryFile", full)
    monkeypatch.setattr(spool, "IN_MEMORY", 64)
    kept, wanted = Spool(tmp_path), b""
    for k in range(2000):
        piece = b"%d;" % k
        kept.append(piece)
        wanted += piece
    assert Full.refusals == 0, "the disk has refused, and was asked again"
    assert b"".join(kept.pieces()) == wanted
    kept.close()


def test_no_file_can_be_made(tmp_path, monkeypatch):
    monkeypatch.setattr(spool, "IN_MEMORY", 8)
    kept = Spool(tmp_path / "not there")
    for _ in range(100):
        kept.append(b"abc")
    assert b"".join(kept.pieces()) == b"abc" * 100
    kept.close()
