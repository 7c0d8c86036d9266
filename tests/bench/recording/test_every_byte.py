"""A recording cut at any byte, or damaged in any way, gives all of it that is intact, and nothing that was not written.

What is intact is told by the file's own layout, walked here by the length of each record (https://mcap.dev/spec): a
record is intact where none of its bytes was touched. The messages of a chunk, the fields of a record and an
attachment's bytes are one record each, and have to come back whole or not at all.
"""

from __future__ import annotations

import json
import random
import struct
from dataclasses import dataclass, field
from pathlib import Path

import pytest
import zstandard

from bench.errors import InputError
from bench.recording import Recording, read_recording, recover
from tests.bench.recording.made import write_run

MAGIC_SIZE = 8
HEADER, FOOTER, CHUNK, ATTACHMENT, METADATA, DATA_END = 1, 2, 6, 9, 12, 15
MESSAGE, MOTOR = 5, 1


@dataclass
class Record:
    kind: int
    begin: int
    end: int
    positions: list[float] = field(default_factory=list)
    """Of a chunk: what its motor messages say."""
    name: str = ""
    """Of an attachment or of a metadata record."""


@dataclass
class Whole:
    data: bytes
    records: list[Record]
    recording: Recording


def walk(data: bytes) -> list[Record]:
    """The records up to the end of the data."""
    records, at = [], MAGIC_SIZE
    while True:
        kind, length = struct.unpack_from("<BQ", data, at)
        record = Record(kind, at, at + 9 + length)
        body = data[at + 9 : record.end]
        if kind == CHUNK:
            (name_size,) = struct.unpack_from("<I", body, 28)
            record.positions = motor_positions(zstandard.ZstdDecompressor().decompress(body[32 + name_size + 8 :]))
        elif kind in (ATTACHMENT, METADATA):
            skip = 16 if kind == ATTACHMENT else 0
            (size,) = struct.unpack_from("<I", body, skip)
            record.name = body[skip + 4 : skip + 4 + size].decode()
        records.append(record)
        if kind == DATA_END:
            return records
        at = record.end


def motor_positions(plain: bytes) -> list[float]:
    found, at = [], 0
    while at < len(plain):
        kind, length = struct.unpack_from("<BQ", plain, at)
        if kind == MESSAGE and struct.unpack_from("<H", plain, at + 9)[0] == MOTOR:
            found.append(json.loads(plain[at + 31 : at + 9 + length])["position_mm"])
        at += 9 + length
    return found


def made(folder: Path, seconds: float) -> Whole:
    path = folder / "run.mcap"
    write_run(path, seconds=seconds)
    data = path.read_bytes()
    return Whole(data, walk(data), read_recording(path))


@pytest.fixture(scope="module")
def small(tmp_path_factory) -> Whole:
    """Two chunks, metadata and attachments between; without the padding of the host record."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("bench.recording.writer.HOST_SIZE", 16)
        whole = made(tmp_path_factory.mktemp("small"), 0.06)
    assert sum(r.kind == CHUNK for r in whole.records) == 2
    return whole


@pytest.fixture(scope="module")
def large(tmp_path_factory) -> Whole:
    whole = made(tmp_path_factory.mktemp("large"), 3.0)
    assert sum(r.kind == CHUNK for r in whole.records) > 60
    return whole


def read(path: Path, data: bytes) -> Recording | None:
    path.unlink(missing_ok=True)  # some file systems wait for the disk when a file is written over
    path.write_bytes(data)
    try:
        return read_recording(path)
    except InputError:
        return None


def came_back(recording: Recording | None, whole: Whole, intact: list[Record]) -> None:
    """Everything of the intact records, in order, and no number that was not written."""
    got = recording.motor.position_mm.tolist() if recording is not None else []
    expected = [x for record in intact for x in record.positions]
    assert got == expected
    names = {record.name for record in intact if record.kind == ATTACHMENT}
    if recording is None:
        assert not names
        return
    assert names == set(recording.attachments)
    assert all(recording.attachments[name] == whole.recording.attachments[name] for name in names)
    if any(record.name == "padbench.run" for record in intact):
        assert recording.run == whole.recording.run
    if any(record.name == "padbench.result" for record in intact):
        assert recording.result == whole.recording.result


def recovered(path: Path, recording: Recording | None) -> None:
    """`recover` writes the same, as a file that is whole."""
    try:
        out, report = recover(path)
    except InputError:
        assert recording is None or not recording.motor.time_s.size
        return
    again = read_recording(out)
    if recording is not None:
        assert again.motor.position_mm.tolist() == recording.motor.position_mm.tolist()
        assert again.attachments == recording.attachments and again.run == recording.run
        assert again.result == recording.result
        assert (report.status == 3) == bool(recording.lost)
    assert recover(out, path.with_name("twice.mcap"))[1].gone is False


@pytest.mark.long
def test_cut_at_every_byte(small, tmp_path):
    """Every length up to the end of the data, every tenth of the index behind; `recover` at every hundredth."""
    path = tmp_path / "cut.mcap"
    end = small.records[-1].end
    for cut in (*range(end + 1), *range(end + 1, len(small.data), 10)):
        intact = [r for r in small.records if r.end <= cut]
        recording = read(path, small.data[:cut])
        came_back(recording, small, intact)
        if cut > MAGIC_SIZE + 50 and cut % 100 == 0:
            recovered(path, recording)
        if recording is not None and cut < small.records[-1].end:
            assert recording.lost, cut


DAMAGES = ("flip", "zero", "noise", "remove", "insert")


def damaged(data: bytes, kind: str, at: int, size: int, pick: random.Random) -> bytes:
    behind = data[at + size :]
    if kind == "flip":
        return data[:at] + bytes([data[at] ^ (1 << pick.randrange(8))]) + data[at + 1 :]
    if kind == "zero":
        return data[:at] + bytes(size) + behind
    if kind == "noise":
        return data[:at] + pick.randbytes(size) + behind
    if kind == "remove":
        return data[:at] + behind
    return data[:at] + pick.randbytes(size) + data[at:]


def touched(record: Record, kind: str, at: int, size: int) -> bool:
    if kind == "insert":
        return record.begin < at < record.end
    return record.begin < at + (1 if kind == "flip" else size) and at < record.end


def check_damage(whole: Whole, path: Path, kind: str, at: int, size: int, seed: int, *, finished: bool) -> None:
    end = len(whole.data) if finished else whole.records[-1].begin
    at = MAGIC_SIZE + at % (end - MAGIC_SIZE)
    data = damaged(whole.data[:end], kind, at, size, random.Random(seed))
    recording = read(path, data)
    intact = [r for r in whole.records if r.end <= end and not touched(r, kind, at, size)]
    hit = [r for r in whole.records if r.end <= end and touched(r, kind, at, size)]
    # A head that is damaged may hide nothing of the chunk; what comes from a record that was hit must be right, too.
    got = recording.motor.position_mm.tolist() if recording is not None else []
    spared = [r for r in intact if r.positions]
    also = [r for r in hit if r.positions and r.positions[0] in got]
    expected = [x for r in sorted(spared + also, key=lambda r: r.begin) for x in r.positions]
    assert got == expected
    if recording is None:
        assert not spared
        return
    for name, content in recording.attachments.items():
        assert whole.recording.attachments.get(name) == content
    for r in intact:
        if r.kind == ATTACHMENT:
            assert r.name in recording.attachments, r
        elif r.name == "padbench.run":
            assert recording.run == whole.recording.run
        elif r.name == "padbench.result":
            assert recording.result == whole.recording.result
        elif r.name == "padbench.host":
            assert recording.host == whole.recording.host
    if seed % 20 == 0:
        recovered(path, recording)


@pytest.mark.parametrize("finished", [True, False], ids=["finished", "unfinished"])
def test_every_byte_flipped(small, tmp_path, finished):
    path = tmp_path / "flipped.mcap"
    for at in range(0, small.records[-1].end - MAGIC_SIZE, 4 if finished else 3):
        check_damage(small, path, "flip", at, 1, at, finished=finished)


@pytest.mark.parametrize("seed", range(10))
def test_any_damage_of_a_larger_file(large, tmp_path, seed):
    """Ten at a time: bytes flipped, zeroed, made noise, taken out, put in."""
    pick = random.Random(seed)
    for k in range(10):
        kind, at, size = pick.choice(DAMAGES), pick.randrange(1 << 30), pick.randrange(1, 3000)
        check_damage(large, tmp_path / "damaged.mcap", kind, at, size, 10 * seed + k, finished=bool(k % 2))


def test_a_checksum_that_is_wiped_out_with_what_it_stands_for_is_not_taken_for_none(small, tmp_path):
    """The format lets a writer leave checksums out (zero); ours never does."""
    record = next(r for r in small.records if r.kind == ATTACHMENT)
    data = bytearray(small.data[: small.records[-1].begin])
    data[record.end - 4 : record.end] = bytes(4)
    data[record.end - 6] ^= 1
    recording = read(tmp_path / "wiped.mcap", bytes(data))
    assert recording is not None and record.name not in recording.attachments
    assert recording.lost is not None and record.name in recording.lost
