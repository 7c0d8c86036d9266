"""The recording of a run: a function of the seed, without the truth for whoever fits, and alive after a kill."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from mcap.records import Attachment, Channel, DataEnd, Footer, Header, Message, Metadata, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import Writer

from bench.cli import main
from bench.recording import read_recording
from tests.bench.run.benches import SHORT, bench_file, merged, protocol_file, run

ROOT = Path(__file__).parents[3]
LOST_AT_MOST_S = 0.5
FIT = ("--law", "exponential", "--order", "2", "--contact", "unilateral")


def records(path: Path) -> list[Any]:
    """Every record of a file, those inside chunks too."""
    with path.open("rb") as stream:
        return list(StreamReader(stream).records)


def without_truth(source: Path, target: Path) -> Path:
    """A copy without the record that holds the truth; everything else as it was."""
    with target.open("wb") as stream:
        writer = Writer(stream)
        schemas: dict[int, int] = {0: 0}
        channels: dict[int, int] = {}
        for record in records(source):
            if isinstance(record, Header):
                writer.start(record.profile, record.library)
            elif isinstance(record, Schema) and record.id not in schemas:
                schemas[record.id] = writer.register_schema(record.name, record.encoding, record.data)
            elif isinstance(record, Channel) and record.id not in channels:
                schema = schemas[record.schema_id]
                names = (record.topic, record.message_encoding, schema, record.metadata)
                channels[record.id] = writer.register_channel(*names)
            elif isinstance(record, Message):
                channel = channels[record.channel_id]
                writer.add_message(channel, record.log_time, record.data, record.publish_time, record.sequence)
            elif isinstance(record, Attachment):
                media = record.media_type
                writer.add_attachment(record.create_time, record.log_time, record.name, media, record.data)
            elif isinstance(record, Metadata) and record.name != "padbench.simulation":
                writer.add_metadata(record.name, record.metadata)
            elif isinstance(record, DataEnd):
                break
        writer.finish()
    return target


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> Path:
    """The recording of a short run with a hidden effect."""
    folder = tmp_path_factory.mktemp("recorded")
    pad = folder / "pad.yaml"
    pad.write_text(
        "pad:\n  elastic: {law: exponential, m: 2.2345678, b: 0.69}\n"
        "  relaxation: {shares: [0.25, 0.15], rates: [4.0, 0.35]}\n  contact: unilateral\n"
        "effects:\n  - {id: frame_compliance, compliance: 0.0123456}\n"
    )
    return run(folder, simulation={"pad": str(pad), "seed": 7919}).folder / "recording.mcap"


def test_one_seed_one_recording(tmp_path):
    """Record by record the same, but for `padbench.host` and what is computed over it."""
    files = []
    for name in ("a", "b"):
        folder = tmp_path / name
        folder.mkdir()
        files.append(run(folder, simulation={"seed": 5}).folder / "recording.mcap")
        time.sleep(0.01)
    first, second = (records(file) for file in files)
    assert len(first) == len(second) > 5000
    differing = [(a, b) for a, b in zip(first, second, strict=True) if a != b]
    for a, b in differing:
        if isinstance(a, Metadata):
            assert a.name == b.name == "padbench.host" and a.metadata["started"] != b.metadata["started"]
        elif isinstance(a, DataEnd):
            assert replace(a, data_section_crc=0) == replace(b, data_section_crc=0)
        else:
            assert isinstance(a, Footer) and replace(a, summary_crc=0) == replace(b, summary_crc=0)
    assert files[0].stat().st_size == files[1].stat().st_size
    one, two = (file.read_bytes() for file in files)
    unequal = np.flatnonzero(np.frombuffer(one, np.uint8) != np.frombuffer(two, np.uint8))
    assert unequal.size < 100, "the host's lines, and the checksums over them"


def test_another_seed_another_recording(tmp_path):
    forces, surfaces = [], []
    for seed in (5, 6):
        folder = tmp_path / str(seed)
        folder.mkdir()
        done = run(folder, merged(SHORT, {"steps": [{"to": 0.3, "speed": 40}]}), simulation={"seed": seed})
        forces.append(done.recording.load_cell.gross_N[:500])
        surfaces.append(done.world.surface_mm)
    assert not np.array_equal(*forces) and surfaces[0] != surfaces[1]


def test_the_truth_stands_in_one_record_only(recorded):
    everything = records(recorded)
    truth = [r for r in everything if isinstance(r, Metadata) and r.name == "padbench.simulation"]
    assert len(truth) == 1 and "frame_compliance" in truth[0].metadata["model"]
    hidden = (b"0.0123456", b"frame_compliance", b"2.2345678", truth[0].metadata["surface_mm"].encode()[:8])
    for record in everything:
        if isinstance(record, Attachment | Message):
            text = record.data
        elif isinstance(record, Metadata) and record is not truth[0]:
            text = json.dumps(record.metadata).encode()
        else:
            continue
        if b'"touch_off"' not in text:  # what the run has found is no truth
            assert not any(word in text for word in hidden), record
    names = [r.name for r in everything if isinstance(r, Attachment)]
    assert names == ["protocol.yaml", "bench.yaml"]
    bench = next(r for r in everything if isinstance(r, Attachment) and r.name == "bench.yaml")
    assert "simulation" not in yaml.safe_load(bench.data)


def test_a_fit_cannot_see_the_truth(recorded, tmp_path, capsys):
    blind = without_truth(recorded, tmp_path / "recording.mcap")
    kept = [r.name for r in records(blind) if isinstance(r, Metadata)]
    assert kept == ["padbench.run", "padbench.host", "padbench.result"]
    found = []
    for file in (recorded, blind):
        assert main(["fit", str(file), *FIT, "--json", "-"]) == 0
        found.append(json.loads(capsys.readouterr().out))
        found[-1].pop("seconds")
    assert found[0] == found[1]


def test_what_is_in_it(recorded):
    recording = read_recording(recorded)
    assert recording.run["protocol"] == "short" and recording.run["simulated"] == "true"
    assert len(recording.run["bench_sha256"]) == 64 and recording.run["seed"] == "7919"
    assert "numpy" in recording.host["versions"]
    names = [event.name for event in recording.events]
    assert names == ["devices", "clamps", "tare", "contact", "touch_off", "safe_state"]


# -- processes ---------------------------------------------------------------------------------------------------------

POSIX = pytest.mark.skipif(not hasattr(os, "openpty"), reason="there are no pseudo-terminals here")
PADBENCH = (sys.executable, "-m", "bench.cli")
LONG = merged(SHORT, {"steps": [{"to": 0.8, "speed": 20, "hold": 1}, {"to": 1.0, "speed": 20, "hold": 600}]})


def started(*words: str, group: bool = False) -> subprocess.Popen[str]:
    """A padbench process whose output is kept."""
    return subprocess.Popen(
        [*PADBENCH, *words],
        cwd=ROOT,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=group,
    )


def until(process: subprocess.Popen[str], ready: Any, seconds: float = 60.0) -> None:
    """Wait until something is so, as long as the process lives."""
    deadline = time.monotonic() + seconds
    while not ready():
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < deadline, "it never came to that"
        time.sleep(0.05)


def steps_of(folder: Path) -> int:
    """Marks of the protocol's own steps in the recording so far."""
    file = folder / "recording.mcap"
    if not file.exists() or file.stat().st_size < 10_000:
        return 0
    return sum(mark.phase == "steps" for mark in read_recording(file).steps)


@contextlib.contextmanager
def bench_on_terminals(folder: Path) -> Iterator[Path]:
    """An emulated bench in another process, and the bench file of who believes that it is real."""
    simulated = bench_file(folder, "simulated_iai", "emulated.yaml", simulation={"surface": 0.6})
    emulator = started("emulate", str(simulated))
    assert emulator.stdout is not None
    try:
        ports = dict(emulator.stdout.readline().split() for _ in range(2))
        assert list(ports) == ["motor", "load_cell"]
        # Processes of a busy machine are late; what is tested here is not how late.
        limits = {"stale": 2.0, "following_error": 5.0}
        yield bench_file(
            folder, "simulated_iai", "real.yaml", simulation=None, limits=limits,
            motor={"port": ports["motor"], "safe_state": "retract"}, load_cell={"port": ports["load_cell"]},
        )  # fmt: skip
    finally:
        emulator.terminate()
        emulator.wait(20)
        emulator.stdout.close()
        assert emulator.stderr is not None
        emulator.stderr.close()


@pytest.mark.long
@POSIX
def test_a_run_over_terminals_that_is_stopped_and_one_that_is_killed(tmp_path):
    protocol = protocol_file(tmp_path, LONG)
    with bench_on_terminals(tmp_path) as bench:
        words = ("run", protocol, "--bench", str(bench), "--out")
        # Nobody there: refused, and nothing is left behind.
        refused = started(*words, str(tmp_path / "refused"))
        out, err = refused.communicate(timeout=60)
        assert refused.returncode == 1 and "--attended" in err and "Traceback" not in err
        assert not (tmp_path / "refused").exists()

        stopped = tmp_path / "stopped"
        process = started(*words, str(stopped), "--attended")
        until(process, lambda: steps_of(stopped) >= 2)
        process.send_signal(signal.SIGTERM)
        out, err = process.communicate(timeout=240)  # fit, diagnosis and report come after the stop
        assert process.returncode == 1, err
        assert "STOPPED: stopped by signal SIGTERM" in out and err == ""
        recording = read_recording(stopped)
        assert recording.lost is None and recording.result is not None
        assert json.loads(recording.result["safe_state"])["servo_on"] is True
        names = [event.name for event in recording.events]
        told = [name for name in names[names.index("stopped") :] if name != "late_turn"]
        assert told == ["stopped", "halt", "move", "retreat", "stop", "safe_state"], "halted, then out of the pad"
        assert recording.motor.position_mm[-1] < recording.surface_mm, "out of the pad again"
        assert recording.run["simulated"] == "false"
        page = (stopped / "report.html").read_text("utf-8")
        assert "stopped by signal SIGTERM" in page and "stopped before its protocol ended" in page

        killed = tmp_path / "killed"
        process = started(*words, str(killed), "--attended", group=True)
        until(process, lambda: steps_of(killed) >= 3)
        os.killpg(process.pid, signal.SIGKILL)
        at_s = time.time()
        process.communicate(timeout=60)
    recording = read_recording(killed)
    assert recording.result is None
    for channel in (recording.motor, recording.load_cell):
        last = int(recording.run["epoch_ns"]) * 1e-9 + channel.time_s[-1]
        assert at_s - last < LOST_AT_MOST_S
    can_be_recovered(killed / "recording.mcap", tmp_path)


@POSIX
def test_a_virtual_run_that_is_killed(tmp_path):
    protocol = protocol_file(tmp_path, merged(LONG, {"steps": [{"to": 0.8, "speed": 20, "hold": 3600}]}))
    folder = tmp_path / "run"
    process = started("run", protocol, "--out", str(folder))
    until(process, lambda: (folder / "recording.mcap").exists() and steps_of(folder) >= 1)
    time.sleep(0.2)
    process.kill()
    process.communicate(timeout=60)
    recording = read_recording(folder)
    assert recording.result is None
    motor, cell = recording.motor.time_s, recording.load_cell.time_s
    assert abs(motor[-1] - cell[-1]) < LOST_AT_MOST_S
    assert np.diff(motor).max() < 0.05 and np.diff(cell).max() < 0.02, "nothing is missing in between"
    can_be_recovered(folder / "recording.mcap", tmp_path)


def can_be_recovered(torn: Path, folder: Path) -> None:
    """`recover` makes a whole file of it, and the fit of both is the same."""
    whole = folder / "whole.mcap"
    assert main(["recover", str(torn), str(whole)]) in (0, 3)
    found = []
    for file in (torn, whole):
        out = folder / f"{file.stem}.json"
        assert main(["fit", str(file), "--law", "exponential", "--order", "1", "--json", str(out)]) == 0
        found.append(json.loads(out.read_text()))
        found[-1].pop("seconds")
    assert found[0] == found[1]
    assert read_recording(whole).lost is None
    assert main(["recover", str(whole), str(folder / "again.mcap")]) == 0
