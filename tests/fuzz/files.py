"""Files from strangers: protocols, benches, models, register maps, CSV, recordings."""

from __future__ import annotations

import json
import random
import struct
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from itertools import islice
from pathlib import Path
from typing import Any

import yaml
import zstandard

from bench.config import load_bench, load_model
from bench.errors import InputError
from bench.protocol import load_protocol
from bench.recording import read_recording, recover
from bench.recording.types import Recording
from bench.yamlfile import read_yaml, validate
from drivers.maps import shipped_map, shipped_maps
from drivers.regmap import LoadCellMap, MotorMap, load_map
from tests.bench.recording.made import write_run
from tests.fuzz.mutate import VALUES, spoiled_bytes, spoiled_tree, yaml_text

SHIPPED = Path(__file__).parents[2] / "protocols"
NAMED = (InputError,)


@contextmanager
def named() -> Iterator[None]:
    """A named error is an answer."""
    with suppress(*NAMED):
        yield


@cache
def _texts(folder: str) -> tuple[str, ...]:
    return tuple(path.read_text("utf-8") for path in sorted((SHIPPED / folder).glob("*.yaml")))


def _yaml_file(folder: str, path: Path, pick: random.Random) -> None:
    """A shipped file made worse, as text or as a tree."""
    text = pick.choice(_texts(folder))
    path.unlink(missing_ok=True)
    if pick.random() < 0.4:
        path.write_bytes(spoiled_bytes(text.encode(), pick))
        return
    tree = yaml.safe_load(text)
    for _ in range(pick.choice((1, 1, 2, 5))):
        tree = spoiled_tree(tree, pick)
    path.write_text(yaml_text(tree, pick), "utf-8", errors="surrogatepass")


def protocol(folder: Path, pick: random.Random) -> None:
    path = folder / "p.yaml"
    _yaml_file("", path, pick)
    with named():
        for step in islice(load_protocol(path).flatten(), 100_001):
            assert step.step.speed > 0


def bench(folder: Path, pick: random.Random) -> None:
    path = folder / "b.yaml"
    _yaml_file("benches", path, pick)
    with named():
        load_bench(path)


def model(folder: Path, pick: random.Random) -> None:
    path = folder / "m.yaml"
    _yaml_file("pads", path, pick)
    with named():
        load_model(path)


def register_map(folder: Path, pick: random.Random) -> None:
    device = pick.choice(("motor", "load_cell"))
    name = pick.choice(shipped_maps("motor") + shipped_maps("load_cell"))
    tree = shipped_map(name)
    for _ in range(pick.choice((1, 1, 2, 5))):
        tree = spoiled_tree(tree, pick)
    path = folder / "map.yaml"
    path.unlink(missing_ok=True)
    path.write_text(yaml_text(tree, pick), "utf-8", errors="surrogatepass")
    with named():
        validate(read_yaml(path), MotorMap if device == "motor" else LoadCellMap)
    if isinstance(tree, dict):
        with suppress(ValueError):
            load_map("registers", tree, "motor" if device == "motor" else "load_cell")
        with suppress(ValueError):  # laid over a shipped one
            over = spoiled_tree(tree, pick)
            load_map(pick.choice(shipped_maps("motor")), over if isinstance(over, dict) else {}, "motor")


CSV = "time_s,position_mm,force_N,force_time_s,note\n" + "".join(
    f"{0.001 * i:.3f},{0.01 * i},{0.5 + 0.1 * i},{0.001 * i + 0.0002:.4f},x\n" for i in range(30)
)


def csv(folder: Path, pick: random.Random) -> None:
    path = folder / "d.csv"
    data = CSV.encode()
    if pick.random() < 0.3:
        data = CSV.replace(",", pick.choice(";\t,")).encode(pick.choice(("utf-16", "utf-8-sig", "cp1252")))
    path.unlink(missing_ok=True)
    path.write_bytes(spoiled_bytes(data, pick))
    with named():
        _used(read_recording(path))


def _used(recording: Recording) -> None:
    """What every command asks of it."""
    recording.measurement().counted()


@cache
def _run() -> tuple[bytes, ...]:
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        found = []
        for seconds, finish in ((0.2, True), (0.2, False), (1.2, True)):
            path = Path(folder) / f"{seconds}{finish}.mcap"
            recorder = write_run(path, seconds=seconds, finish=finish)
            found.append(path.read_bytes())
            recorder.close()
        return tuple(found)


def mcap(folder: Path, pick: random.Random) -> None:
    """A damaged recording; or one whose chunks are whole, and hold what no recorder writes."""
    path = folder / "r.mcap"
    path.unlink(missing_ok=True)
    data = pick.choice(_run())
    path.write_bytes(spoiled_bytes(data, pick) if pick.random() < 0.5 else _made_up(pick))
    with named():
        _used(read_recording(path))
    if pick.random() < 0.3:
        with named():
            recover(path)


TEXTS = (
    b"{}", b"[]", b"null", b"1", b"", b"{", b'{"name":null}', b'{"position_mm":1e400}', b'{"position_mm":NaN}',
    b'{"position_mm":"1.5","force_N":[1]}', b'{"position_mm":[1],"force_N":{}}', b'{"position_mm":%s}' % (b"9" * 400),
    b'{"name":"touch_off","surface_mm":"x"}', b'{"name":"touch_off","surface_mm":1e400}', b"[" * 3000, b'{"a":' * 2000,
    b'{"name":"touch_off","surface_mm":1,"surface_std_mm":NaN}', b'{"name":"polled","period_s":0,"stamp_std_s":"x"}',
    b'{"name":"move","target_mm":1e300,"speed_mm_s":1e-300,"acceleration_mm_s2":1e-300,"waited_s":-1}',
    b'{"name":"move","target_mm":2,"speed_mm_s":20,"acceleration_mm_s2":500,"waited_s":0.01}', b'{"name":"halt"}',
    b'{"name":"tare","tare_N":null,"sigma_N":-1,"drift_N_s":[]}', b'{"name":[],"phase":{},"kind":1,"target_mm":true}',
    b'{"name":"s","phase":"steps","kind":"hold"}', b'{"position_mm":1.0}', b'{"force_N":1.0,"gross_N":2,"overload":1}',
    b'{"name":"stopped"}', b'\xff\xfe{"a"', b'{"position_mm":true,"command_mm":false}', b'{"position_mm":-1e308}',
)  # fmt: skip

BENCHES = (
    "", "timing: {force_delay: 1e400}", "timing: 3", "timing: {force_delay: .nan}", "timing: {force_delay: '1'}",
    "timing: {force_delay: 1e300, position_delay: -1e300}", "[", "a: &a [*a]", "timing: {force_delay: 0.001}", "\0",
)  # fmt: skip


def _record(kind: int, body: bytes) -> bytes:
    return struct.pack("<BQ", kind, len(body)) + body


def _text(text: str | bytes) -> bytes:
    data = text.encode("utf-8", "surrogatepass") if isinstance(text, str) else text
    return struct.pack("<I", len(data)) + data


def _metadata(name: str, fields: dict[str, str]) -> bytes:
    pairs = b"".join(_text(k) + _text(v) for k, v in fields.items())
    return _record(12, _text(name) + struct.pack("<I", len(pairs)) + pairs)


def _chunk(plain: bytes, pick: random.Random) -> bytes:
    """A chunk with a checksum that is right, and sizes and compressions that may not be."""
    size = pick.choice((len(plain),) * 6 + (0, 1, 1 << 31, 1 << 40, (1 << 63) - 1))
    packed: bytes = zstandard.compress(plain)
    name = "zstd"
    if pick.random() < 0.2:
        name = pick.choice(("", "lz4", "zst", "ZSTD", "\0", "\ud800"))
    if pick.random() < 0.05:
        packed = zstandard.ZstdCompressor(write_content_size=False).compress(bytes(1 << 24))  # a small bomb
    head = struct.pack("<QQQI", 0, 1, size, pick.choice((zlib.crc32(plain),) * 4 + (0,)))
    return _record(6, head + _text(name) + struct.pack("<Q", len(packed)) + packed)


def _made_up(pick: random.Random) -> bytes:
    """A file of whole records with senseless content."""
    stamps = (0, 1, 10**9, 2 * 10**9, 1 << 62, (1 << 64) - 1)
    out = b"\x89MCAP0\r\n" + _record(1, _text("") + _text(pick.choice(("padbench", "other", ""))))
    epoch = pick.choice(("0", "1000000000", "x", "-1", "9" * 18, "9" * 25, "9" * 5000, "٣", ""))
    run = {"epoch_ns": epoch, "timing": pick.choice(("", "{", '{"force_delay":1e400}'))}
    out += _metadata(pick.choice(("padbench.run",) * 4 + ("x", "")), run)
    for name in ("bench.yaml", "protocol.yaml"):
        body = struct.pack("<QQ", 0, 0) + _text(name) + _text("") + _with_size(pick.choice(BENCHES).encode())
        out += _record(9, body + struct.pack("<I", zlib.crc32(body)))
    for _ in range(pick.randrange(4)):
        plain = b""
        if pick.random() < 0.3:
            plain += _record(4, struct.pack("<HH", pick.randrange(8), 0) + _text("/motor") + _text("cbor") + _text(b""))
        t = pick.choice(stamps)
        for k in range(pick.choice((1, 5, 60))):
            channel = pick.choice((1, 2, 3, 4, 5, 6, 77))
            t = pick.choice(stamps) if pick.random() < 0.1 else min(t + 10**6, (1 << 64) - 1)
            sequence = pick.choice((k, 0, (1 << 32) - 1))
            usual = {1: b'{"position_mm":%d.5}' % k, 2: b'{"force_N":%d.5}' % k}.get(channel)
            text = usual if usual and pick.random() < 0.7 else pick.choice(TEXTS)
            plain += _record(5, struct.pack("<HIQQ", channel, sequence, t, t) + text)
        out += _chunk(plain, pick)
    if pick.random() < 0.5:
        out += _metadata("padbench.result", {"status": json.dumps(str(pick.choice(VALUES)))})
    return out + (_record(15, bytes(4)) if pick.random() < 0.7 else b"")


def _with_size(data: bytes) -> bytes:
    return struct.pack("<Q", len(data)) + data


TARGETS: dict[str, Callable[[Path, random.Random], Any]] = {
    "protocol": protocol,
    "bench": bench,
    "model": model,
    "register_map": register_map,
    "csv": csv,
    "mcap": mcap,
}
