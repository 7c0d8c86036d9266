"""A small part of the long run (`python -m tests.fuzz`), and the inputs that were found by it or thought of."""

from __future__ import annotations

import random
import struct
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml
import zstandard
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bench.errors import InputError
from bench.protocol import load_protocol
from bench.recording import read_recording
from bench.recording.csv_text import MAX_SIZE
from bench.yamlfile import parse, read_yaml
from drivers.dad141_lines import MAX_LINE, LineCutter
from tests.fuzz import devices
from tests.fuzz.__main__ import TARGETS
from tests.fuzz.files import _chunk, _metadata, _record, _text

INPUTS = 60
"""Of each target; the long run takes more. Failures found by it stay in FOUND."""

FOUND = (
    "registers:14263", "registers:18223", "dad141:658", "dad141:1197", "mt_sics:164", "register_map:2001420",
)  # fmt: skip


@pytest.mark.parametrize("target", TARGETS)
def test_a_result_or_a_named_error(target, tmp_path):
    for number in range(INPUTS):
        try:
            TARGETS[target](tmp_path, random.Random(f"{target}:{number}"))
        except Exception as error:
            error.add_note(f"python -m tests.fuzz --replay {target}:{number}")
            raise


@pytest.mark.parametrize("found", FOUND)
def test_what_the_long_run_found(found, tmp_path):
    target, _, _ = found.partition(":")
    TARGETS[target](tmp_path, random.Random(found))


def refused(folder: Path, text: str | bytes, pattern: str) -> None:
    path = folder / "p.yaml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode("utf-8", "surrogatepass"))
    start = time.process_time()
    with pytest.raises(InputError, match=pattern):
        load_protocol(path)
    assert time.process_time() - start < 20.0


STEP = "steps: [{to: 1, speed: 1}]"
PROTOCOLS = {
    "too large a number": (f"name: p\napproach: {{speed: 1e400}}\n{STEP}", "too large a number"),
    "a number of a megabyte": ("name: " + "9" * 900_000, "too large a number"),
    "repeated a thousand million times": (
        f"name: p\nsteps: [{{block: a, repeat: 1000000000, {STEP}}}]", "more than 100000"
    ),
    "repeated within repeats": (
        "name: p\nsteps: [" + "{block: a, repeat: 1000, steps: [" * 10 + "{to: 1, speed: 1}" + "]}" * 10 + "]",
        "more than 100000",
    ),
    "nested a thousand deep": ("a: " + "[" * 1000, "nested more than"),
    "nested by dashes": ("- " * 1000 + "1", "nested more than"),
    "keys of keys": ("? " * 1000 + "a", "nested more than"),
    "an alias inside itself": ("&a [*a]", "alias"),
    "a list of a megabyte": ("name: [" + "1," * 450_000, "more than 30000 values"),
    "a line of a megabyte": ("name: " + "a " * 490_000 + f"\n{STEP}", "name: .*100 characters"),
    "a megabyte of anchors": ("a:\n" + "".join(f" - &a{i} 1\n" for i in range(70_000)), "more than 30000 values"),
    "larger than a megabyte": ("#" * 1_000_001, "larger than 1 MB"),
    "NUL": (b"name: a\0b\n", "U\\+0000"),
    "no UTF-8": (b"name: \xff\xfe\n", "no UTF-8"),
    "UTF-16": ("name: p\n".encode("utf-16"), "is UTF-16"),
    "half a character": (b'name: "\\ud800"\n', "surrogate"),
    "a name that is a path": (f"name: ../../etc/cron\n{STEP}", "name"),
    "a name that is a page": (f"name: <script>alert(1)</script>\n{STEP}", "name"),
}  # fmt: skip


@pytest.mark.parametrize("case", PROTOCOLS)
def test_protocols_made_to_hurt(case, tmp_path):
    refused(tmp_path, *PROTOCOLS[case])


def test_a_protocol_behind_a_link_that_leads_round(tmp_path):
    (tmp_path / "a.yaml").symlink_to(tmp_path / "b.yaml")
    (tmp_path / "b.yaml").symlink_to(tmp_path / "a.yaml")
    with pytest.raises(InputError):
        load_protocol(tmp_path / "a.yaml")
    with pytest.raises(InputError):
        read_yaml("/dev/zero")
    with pytest.raises(InputError):
        read_recording("x" * 5000)
    with pytest.raises(InputError):
        read_recording("a\0b")


TABLE = "time_s,position_mm,force_N\n"
TABLES = {
    "a field of a megabyte": (TABLE + "0,1,2\n1," + "9" * 1_000_000 + ",2\n", "field limit|too large|not a number"),
    "a quote without an end": (TABLE + '0,1,2\n1,"' + "1,2\n" * 100_000, "is not CSV"),
    "ten thousand columns": ("a," * 10_000 + "b\n" + "1," * 10_000 + "1\n", "two columns are called"),
    "a blank quoted": ('""\n', "is empty"),
    "a remark quoted": ('"#"\n"#"\n', "is empty"),
    "NUL behind the start": (TABLE + "0,1,2\n" * 12_000 + "1,\0,2\n", "not a number"),
    "commas alone": (("," * 5000 + "\n") * 3, "no column 'time_s'"),
    "too large a number": (TABLE + "0,1,1e400\n1,2,3\n", "too large"),
}


@pytest.mark.parametrize("case", TABLES)
def test_tables_made_to_hurt(case, tmp_path):
    text, pattern = TABLES[case]
    path = tmp_path / "d.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=pattern):
        read_recording(path)


def test_a_table_of_gigabytes_is_not_read(tmp_path):
    path = tmp_path / "d.csv"
    with path.open("wb") as file:
        file.write(TABLE.encode())
        file.truncate(MAX_SIZE + 1)  # a hole: it takes no room on the disk
    with pytest.raises(InputError, match="larger than 256 MB"):
        read_recording(path)


def bombs() -> Iterator[tuple[str, bytes]]:
    """Chunks that say they are larger than anything, or are."""
    gigabyte = zstandard.ZstdCompressor(write_content_size=False).compressobj()
    packed = b"".join(gigabyte.compress(bytes(1 << 20)) for _ in range(1024)) + gigabyte.flush()
    for size in (1 << 20, 1 << 30, 1 << 40, (1 << 63) - 1):
        head = struct.pack("<QQQI", 0, 1, size, 0) + _text("zstd")
        yield f"says {size}", _record(6, head + struct.pack("<Q", len(packed)) + packed)
    told = zstandard.ZstdCompressor().compressobj(size=1 << 30)
    packed = b"".join(told.compress(bytes(1 << 20)) for _ in range(1024)) + told.flush()
    head = struct.pack("<QQQI", 0, 1, 1 << 20, 0) + _text("zstd")
    yield "a frame that is larger than the chunk says", _record(6, head + struct.pack("<Q", len(packed)) + packed)
    frame = bytearray(zstandard.compress(bytes(1 << 20)))
    frame[4] = 0b11100000  # eight bytes of content size follow
    frame[5:5] = struct.pack("<Q", 1 << 62)
    head = struct.pack("<QQQI", 0, 1, 1 << 20, 0) + _text("zstd")
    yield "a frame that lies", _record(6, head + struct.pack("<Q", len(frame)) + bytes(frame))


def test_chunks_made_to_fill_the_memory(tmp_path):
    """A gigabyte of zeros in 32 kB, and sizes beyond all machines: left out, and named."""
    import resource

    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for k, (name, chunk) in enumerate(bombs()):
        path = tmp_path / f"{k}.mcap"
        start = b"\x89MCAP0\r\n" + _record(1, _text("") + _text("padbench"))
        good = _chunk(_record(5, struct.pack("<HIQQ", 1, 0, 5, 5) + b'{"position_mm":1.5}'), random.Random(1))
        path.write_bytes(start + _metadata("padbench.run", {"epoch_ns": "0"}) + chunk + good)
        recording = read_recording(path)
        assert recording.lost is not None and "chunk" in recording.lost, name
        assert recording.motor.position_mm.tolist() == [1.5], name
    grown_kB = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    assert grown_kB < 300_000


@settings(max_examples=150, deadline=None, derandomize=True, database=None)
@given(text=st.text(max_size=200))
def test_any_text_is_yaml_or_refused(text):
    try:
        parse(text, Path("x.yaml"))
    except InputError as error:
        assert error.place.startswith("x.yaml") and "Error" not in str(error)


CHARACTERS = st.characters(exclude_categories=["Cs", "Cc", "Cn"], exclude_characters="\ufeff\ufffe\uffff")
PLAIN = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**53), 2**53)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(
        st.characters(exclude_categories=["Cs", "Cc", "Cn"], exclude_characters="\ufeff\ufffe\uffff"), max_size=10
    ),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text("abcdefgh", min_size=1), inner, max_size=4),
    max_leaves=15,
)


@settings(max_examples=100, deadline=None, derandomize=True, database=None, suppress_health_check=list(HealthCheck))
@given(data=PLAIN)
def test_what_is_written_as_yaml_reads_back(data):
    """Another writer's text (JSON with every word quoted, which is YAML) gives the same data: nothing is guessed."""
    import json

    assert parse(json.dumps(data, ensure_ascii=False), Path("x.yaml")).data == data


@settings(max_examples=100, deadline=None, derandomize=True, database=None)
@given(pieces=st.lists(st.binary(max_size=100), max_size=20))
def test_the_line_cutter_gives_what_stands_between_line_ends_and_keeps_no_more_than_a_line(pieces):
    cutter = LineCutter()
    out: list[bytes] = []
    for piece in pieces:
        out += [line for line, _ in cutter.feed(piece)]
        assert len(cutter._rest) <= MAX_LINE
    everything = b"".join(pieces).replace(b"\r", b"").replace(b"\n", b"")
    assert everything.startswith(b"".join(out)) and all(out)


def test_a_device_that_never_stops_talking_fills_no_memory():
    """A reply without an end: the exchange fails in its time, and what came is not kept."""
    pick = random.Random(1)
    clock = devices.Time()
    port = devices.Stranger(clock, lambda request: b"\x01\x03" + bytes(2000), pick)
    link = devices.Link("device", port, clock, attempts=1)
    exchange = devices.ModbusClient(link, 1).read_holding(1, 2)
    link.submit(exchange)
    for _ in range(2000):
        if exchange.done:
            break
        port.say(bytes(3000))
        clock.wait([port], link.wake_at())
        link.service()
    assert exchange.done and exchange.error is not None
    assert len(link._buffer) < 100_000


def test_shipped_files_are_what_the_fuzzing_begins_with():
    """The inputs are near to good ones: unspoiled, each is taken."""
    from tests.fuzz.files import SHIPPED

    for path in SHIPPED.glob("*.yaml"):
        assert yaml.safe_load(path.read_text("utf-8"))["name"]
        load_protocol(path)
