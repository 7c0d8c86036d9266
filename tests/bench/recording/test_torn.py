"""Torn and damaged files: what is intact comes back, what is lost is told, and recover rewrites the rest.

What is intact is worked out with the library's reader from the whole file: the messages of each chunk, and where in
the file the chunk ends.
"""

from __future__ import annotations

import random
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from mcap.data_stream import ReadDataStream
from mcap.reader import make_reader
from mcap.records import Chunk, Message
from mcap.stream_reader import breakup_chunk

from bench.errors import InputError
from bench.recording import read_recording, recover
from tests.bench.recording.made import write_run


@dataclass
class Whole:
    data: bytes
    chunks: list[tuple[int, int, list[float]]]
    """Start, end and the motor's receive times (s from the first) of each chunk."""
    data_end: int


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Whole:
    path = tmp_path_factory.mktemp("torn") / "run.mcap"
    write_run(path, seconds=4.0)
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
        assert summary is not None
        motor = next(c.id for c in summary.channels.values() if c.topic == "/motor")
        chunks = []
        for index in summary.chunk_indexes:
            file.seek(index.chunk_start_offset + 9)
            records = breakup_chunk(Chunk.read(ReadDataStream(file)), validate_crc=True)
            logs = [r.log_time for r in records if isinstance(r, Message) and r.channel_id == motor]
            end = index.chunk_start_offset + index.chunk_length
            chunks.append((index.chunk_start_offset, end, logs))
    first = chunks[0][2][0]
    data = path.read_bytes()
    whole = Whole(data, [(a, b, [(t - first) / 1e9 for t in logs]) for a, b, logs in chunks], len(data))
    assert len(whole.chunks) > 10 and sum(len(logs) for _, _, logs in whole.chunks) == 4000
    return whole


def received(whole: Whole, spared: list[int]) -> list[float]:
    return [t for k in spared for t in whole.chunks[k][2]]


def check(path: Path, expected: list[float], *, damaged: bool = True) -> None:
    """The reader has exactly the expected samples, and so has the recovered file, through the library's reader."""
    recording = read_recording(path)
    assert recording.motor.received_s.tolist() == pytest.approx(expected, abs=1e-9)
    assert bool(recording.lost) == damaged
    try:
        out, report = recover(path)
    except InputError:
        assert not expected
        return
    with out.open("rb") as file:
        logs = [m.log_time for _, _, m in make_reader(file, validate_crcs=True).iter_messages(topics=["/motor"])]
    assert len(logs) == len(expected) == report.per_topic.get("/motor", 0)
    again = read_recording(out)
    assert np.array_equal(again.motor.time_s, recording.motor.time_s)
    assert np.array_equal(again.motor.position_mm, recording.motor.position_mm)
    assert np.array_equal(again.load_cell.gross_N, recording.load_cell.gross_N)
    assert again.run == recording.run and again.attachments == recording.attachments
    assert report.lost == bool(recording.lost) == (report.status == 3)
    assert bool(again.lost) == report.gone


def test_cut_anywhere(whole, tmp_path):
    """A file cut at any byte gives every sample of the chunks before the cut."""
    pick = random.Random(1)
    size = len(whole.data)
    edges = [end + d for _, end, _ in whole.chunks[:2] for d in (-1, 0, 1)]
    cuts = [9, 60, 300, size - 1, size - 8, size - 9, size - 40] + edges + [pick.randrange(8, size) for _ in range(40)]
    for n, cut in enumerate(cuts):
        path = tmp_path / f"cut{n}.mcap"
        path.write_bytes(whole.data[:cut])
        spared = [k for k, (_, end, _) in enumerate(whole.chunks) if end <= cut]
        expected = received(whole, spared)
        recording = read_recording(path)
        assert recording.motor.received_s.tolist() == pytest.approx(expected, abs=1e-9), cut
        if n % 4 == 0 and expected:
            check(path, expected, damaged=recording.lost is not None)
        path.unlink()


def flipped(data: bytes, at: int, mask: int = 0x55) -> bytes:
    return data[:at] + bytes([data[at] ^ mask]) + data[at + 1 :]


@pytest.mark.parametrize("finished", [True, False], ids=["finished", "unfinished"])
@pytest.mark.parametrize("where", ["first", "middle", "last"])
def test_a_damaged_chunk_costs_that_chunk_alone(whole, tmp_path, where, finished):
    last = len(whole.chunks) - 1
    bad = {"first": 0, "middle": last // 2, "last": last}[where]
    start, end, _ = whole.chunks[bad]
    data = flipped(whole.data, (start + end) // 2)
    if not finished:
        data = data[: whole.chunks[-1][1]]
    path = tmp_path / "damaged.mcap"
    path.write_bytes(data)
    check(path, received(whole, [k for k in range(last + 1) if k != bad]))
    recording = read_recording(path)
    if where == "middle":
        assert f"{len(whole.chunks[bad][2])} messages missing in /motor" in recording.lost
        _, report = recover(path)
        assert report.missing["/motor"] == len(whole.chunks[bad][2]) and report.status == 3


@pytest.mark.parametrize("finished", [True, False], ids=["finished", "unfinished"])
@pytest.mark.parametrize("offset", [0, 1, 4, 8], ids=["opcode", "length", "length_high", "length_top"])
def test_a_damaged_record_head_hides_nothing(whole, tmp_path, offset, finished):
    """Kind and length of a chunk record are damaged, its content is not: nothing is lost."""
    start, _, _ = whole.chunks[5]
    data = flipped(whole.data, start + offset)
    path = tmp_path / "damaged.mcap"
    path.write_bytes(data if finished else data[: whole.chunks[-1][1]])
    recording = read_recording(path)
    assert recording.motor.time_s.size == 4000
    _, report = recover(path)
    assert report.per_topic["/motor"] == 4000


def test_damage_between_chunks(whole, tmp_path):
    """The message index behind a chunk only repeats; where its length is damaged, the walk finds the next chunk."""
    end = whole.chunks[4][1]
    for offset in (0, 2, 7):
        path = tmp_path / f"damaged{offset}.mcap"
        path.write_bytes(flipped(whole.data, end + offset))
        recording = read_recording(path)
        assert recording.motor.time_s.size == 4000 and recording.lost is None
        torn = tmp_path / f"torn{offset}.mcap"
        torn.write_bytes(flipped(whole.data, end + offset)[: whole.chunks[-1][1]])
        assert read_recording(torn).motor.time_s.size == 4000


def test_random_damage_never_crashes_and_never_invents(whole, tmp_path):
    """Forty files with ten random bytes each: whatever is read was written."""
    pick = random.Random(2)
    true = {round(t * 1e9): i for i, t in enumerate(received(whole, list(range(len(whole.chunks)))))}
    read = 0
    for n in range(40):
        data = bytearray(whole.data)
        for _ in range(10):
            data[pick.randrange(8, len(data))] = pick.randrange(256)
        path = tmp_path / f"damaged{n}.mcap"
        path.write_bytes(data if n % 2 else data[: pick.randrange(8, len(data))])
        recording = read_recording(path)
        samples = [true[round(t * 1e9)] for t in recording.motor.received_s.tolist()]
        assert samples == sorted(samples)
        assert recording.motor.position_mm.tolist() == [1.25 + 1e-3 * i for i in samples]
        read += len(samples)
    assert read > 40 * 1000


def test_the_channels_are_known_even_when_their_chunk_is_gone(whole, tmp_path):
    """Unfinished, and damaged in the first chunk, where the only description of the channels stood."""
    start, end, _ = whole.chunks[0]
    path = tmp_path / "damaged.mcap"
    path.write_bytes(flipped(whole.data, (start + end) // 2)[: whole.chunks[-1][1]])
    recording = read_recording(path)
    assert recording.motor.time_s.size == 4000 - len(whole.chunks[0][2])
    assert recording.steps[-1].kind == "hold"


def test_recover_of_a_whole_file_loses_nothing(whole, tmp_path):
    path = tmp_path / "run.mcap"
    path.write_bytes(whole.data)
    out, report = recover(path)
    assert out == tmp_path / "run.recovered.mcap"
    assert report.status == 0 and report.has_result and report.finished
    assert (report.messages, report.attachments, report.metadata) == (4000 + 2000 + 5, 3, 4)
    recording, again = read_recording(path), read_recording(out)
    assert again.result == recording.result and again.lost is None
    assert again.events == recording.events and repr(again.steps) == repr(recording.steps)


def test_recover_says_what_it_cannot_do(tmp_path):
    junk = tmp_path / "junk.mcap"
    junk.write_bytes(random.Random(3).randbytes(5000))
    with pytest.raises(InputError, match="nothing that could be recovered"):
        recover(junk)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["junk.mcap"], "no half-made file is left"
    run = tmp_path / "run.mcap"
    write_run(run, seconds=0.1)
    with pytest.raises(InputError, match="the damaged file itself"):
        recover(run, run)
    with pytest.raises(InputError, match="does not exist"):
        recover(tmp_path / "none.mcap")
    with pytest.raises(InputError, match=r"out\.mcap: cannot be written"):
        recover(run, tmp_path / "nowhere" / "out.mcap")


def test_a_file_without_its_first_bytes_can_be_recovered(whole, tmp_path):
    path = tmp_path / "run.mcap"
    path.write_bytes(b"\0\0\0\0" + whole.data[4:])
    with pytest.raises(InputError, match="recover"):
        read_recording(path)
    out, report = recover(path)
    assert report.per_topic["/motor"] == 4000
    assert read_recording(out).motor.time_s.size == 4000
