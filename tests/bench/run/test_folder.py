"""The folder of a run is that run's alone, also where two begin together."""

from __future__ import annotations

import datetime
import threading
from pathlib import Path

import pytest

import bench.run.runner as runner
from bench import cli
from bench.errors import InputError
from bench.run.folder import RECORDING, own_folder
from tests.bench.run.benches import AIR, bench_file, protocol_file

NOW = datetime.datetime(2026, 11, 21, 10, 15)


def test_a_second_run_into_one_folder_is_refused_and_touches_nothing(padbench, tmp_path, monkeypatch):
    """The second begins when the first has its folder, and no recording in it yet."""
    protocol, bench = protocol_file(tmp_path, AIR), bench_file(tmp_path)
    first_run, ended = runner.open_rig, []

    def slow(*given):
        monkeypatch.setattr(runner, "open_rig", first_run)
        other = threading.Thread(target=lambda: ended.append(cli.main(["run", protocol, "--bench", str(bench), *OUT])))
        other.start()
        other.join()
        return first_run(*given)

    OUT = ("--out", "both")
    monkeypatch.setattr(runner, "open_rig", slow)
    said = padbench("run", protocol, "--bench", bench, *OUT)
    assert ended == [2] and "both: another run has it" in said.err
    assert said.status == 0 and Path("both", RECORDING).is_file() and Path("both/report.html").is_file()


def test_who_is_refused_leaves_the_folder_of_the_other(tmp_path):
    with own_folder("quick", tmp_path / "both", NOW) as folder:
        with pytest.raises(InputError, match="another run has it"), own_folder("quick", folder, NOW):
            pytest.fail("two have one folder")
        assert folder.is_dir()


def test_a_recording_of_another_is_not_taken_away(padbench, tmp_path, monkeypatch):
    """Also where a system knows no locks: what a run did not make is not its to take away."""
    begun = runner.Recorder

    def late(path, *given, **options):
        path.write_bytes(b"another's")
        return begun(path, *given, **options)

    monkeypatch.setattr(runner, "Recorder", late)
    said = padbench("run", protocol_file(tmp_path, AIR), "--bench", bench_file(tmp_path), "--out", "both")
    assert said.status == 2 and "exists already" in said.err
    assert Path("both", RECORDING).read_bytes() == b"another's"


@pytest.mark.parametrize("there", [False, True])
def test_a_refused_run_leaves_no_folder_but_one_that_was_there(tmp_path, there):
    out = tmp_path / "out"
    if there:
        out.mkdir()
    with pytest.raises(InputError, match="no device"), own_folder("quick", out, NOW):
        raise InputError("port", "no device answers")
    assert out.exists() == there


@pytest.mark.parametrize("begun", [False, True])
def test_a_run_that_is_stopped_before_it_began_leaves_no_folder(tmp_path, begun):
    out = tmp_path / "out"
    with pytest.raises(KeyboardInterrupt), own_folder("p", out, datetime.datetime(2026, 11, 1)) as folder:
        if begun:
            (folder / "recording.mcap").write_bytes(b"mine")
        raise KeyboardInterrupt
    assert out.exists() == begun
