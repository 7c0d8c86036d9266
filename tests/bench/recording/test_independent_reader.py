"""The file is read by npm's `@mcap/core`, which shares no code with the Python library, record for record."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bench.recording import convert, read_recording
from tests.bench.recording.made import EPOCH_NS, write_run

pytestmark = pytest.mark.skipif(shutil.which("npm") is None, reason="npm is missing")

SCRIPT = Path(__file__).parents[2] / "js" / "read_mcap.mjs"
PACKAGES = ("@mcap/core@2", "@foxglove/wasm-zstd@1")


@pytest.fixture(scope="module")
def node_folder(tmp_path_factory) -> Path:
    """A folder with the packages, made anew: nothing is left in the tree."""
    folder = tmp_path_factory.mktemp("node")
    command = ["npm", "install", "--no-fund", "--no-audit", "--no-save", *PACKAGES]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    shutil.copy(SCRIPT, folder)
    return folder


def node_view(folder: Path, file: Path, how: str) -> dict[str, list[dict[str, Any]]]:
    command = ["node", str(folder / SCRIPT.name), str(file), how]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    records: dict[str, list[dict[str, Any]]] = {}
    for line in done.stdout.splitlines():
        record = json.loads(line)
        records.setdefault(record["type"], []).append(record)
    return records


def agrees(records: dict[str, list[dict[str, Any]]], file: Path) -> None:
    """Counts, stamps, order and values of every sample are what our reader says."""
    recording = read_recording(file)
    epoch = int(recording.run["epoch_ns"])
    topics = {
        "/motor": (recording.motor, ("position_mm", "command_mm", "force_N")),
        "/load_cell": (recording.load_cell, ("force_N", "gross_N")),
    }
    for topic, (channel, fields) in topics.items():
        found = [m for m in records["message"] if m["topic"] == topic]
        assert [m["sequence"] for m in found] == list(range(channel.time_s.size))
        for stamps, key in ((channel.time_s, "publish"), (channel.received_s, "log")):
            assert [round(t * 1e9) for t in stamps] == [int(m[key]) - epoch for m in found]
        objects = [json.loads(m["data"]) for m in found]
        for field in fields:
            theirs = np.array([o.get(field, np.nan) for o in objects])
            assert np.array_equal(theirs, getattr(channel, field), equal_nan=True), (topic, field)
    events = [json.loads(m["data"]) for m in records["message"] if m["topic"] == "/event"]
    assert events == [{"name": e.name, **e.data} for e in recording.events]
    assert len([m for m in records["message"] if m["topic"] == "/step"]) == len(recording.steps)


@pytest.mark.parametrize("mode", ["inline", "process"])
def test_a_run_record_for_record(tmp_path, node_folder, mode):
    file = tmp_path / "run.mcap"
    write_run(file, mode=mode)
    recording = read_recording(file)
    for how in ("indexed", "stream"):
        records = node_view(node_folder, file, how)
        agrees(records, file)
        assert len(records["message"]) == 3000 + 1500 + 3 + 1 + 1
        assert {m["name"]: m["fields"] for m in records["metadata"]}["padbench.run"] == recording.run
        assert {m["name"]: m["fields"] for m in records["metadata"]}["padbench.result"] == recording.result
        assert {a["name"]: a["data"].encode() for a in records["attachment"]} == recording.attachments
        schemas = {c["topic"]: (c["schema"], c["schemaEncoding"], c["encoding"]) for c in records["channel"]}
        assert schemas["/log"] == ("foxglove.Log", "jsonschema", "json")
        assert all(c["schemaData"]["type"] == "object" for c in records["channel"])
        assert min(int(m["log"]) for m in records["message"]) == EPOCH_NS
    assert node_view(node_folder, file, "indexed")["end"][0]["messages"] == "4505"
    assert node_view(node_folder, file, "stream")["end"][0]["done"] is True


def test_a_torn_run_gives_both_the_same_samples(tmp_path, node_folder):
    whole, torn = tmp_path / "run.mcap", tmp_path / "torn.mcap"
    write_run(whole)
    data = whole.read_bytes()
    torn.write_bytes(data[: len(data) * 2 // 3])
    records = node_view(node_folder, torn, "stream")
    assert records["end"][0]["done"] is False
    agrees(records, torn)
    assert read_recording(torn).motor.time_s.size > 1000


def test_a_converted_file(tmp_path, node_folder):
    source, file = tmp_path / "a.csv", tmp_path / "a.mcap"
    source.write_text("time_s,position_mm,force_N,gap_mm\n0,0,0.1,3\n0.25,1e-7,,4\n0.5,3.25,0.3,\n")
    convert(source, file)
    records = node_view(node_folder, file, "indexed")
    agrees(records, file)
    extra = [json.loads(m["data"]) for m in records["message"] if m["topic"] == "/extra"]
    assert extra == [{"gap_mm": 3.0}, {"gap_mm": 4.0}, {}]
