"""Two at one bench: whoever comes second is told who came first. With real processes, and devices that live on."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from bench.errors import Refused
from bench.run.in_use import using
from tests.bench.run.benches import merged, protocol_file
from tests.bench.run.test_host_gone import PRESS, ROOT, emulated, running, stopped

pytestmark = pytest.mark.skipif(not hasattr(os, "openpty"), reason="no pseudo-terminals and no flock here")

LONG = merged(PRESS, {"steps": [{"to": 1.0, "speed": 5, "hold": 200}]})
HOLDER = """
import sys, time
from bench.run.in_use import using
with using(sys.argv[2:], sys.argv[1]):
    print("held", flush=True)
    time.sleep(600)
"""


@contextlib.contextmanager
def held_by_another(what: str, *ports: str) -> Iterator[subprocess.Popen[str]]:
    """A process that uses ports until it is killed."""
    command = [sys.executable, "-c", HOLDER, what, *ports]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT)
    try:
        assert process.stdout is not None and process.stdout.readline() == "held\n"
        yield process
    finally:
        process.kill()
        process.communicate(timeout=10)


def test_the_second_is_told_who_holds_the_port_and_a_killed_one_holds_nothing(tmp_path):
    port, link = tmp_path / "port", tmp_path / "by-id"
    port.touch()
    link.symlink_to(port)
    url = f"socket://{tmp_path.name}:502"
    with held_by_another("the run runs/x", str(port), url) as first:
        for wanted in (str(port), str(link), url):
            with pytest.raises(Refused) as refused, using([wanted, "sim://bench/load_cell"]):
                pass
            assert f"the run runs/x is going on (process {first.pid})" in str(refused.value)
        with using([str(tmp_path / "another"), "sim://bench/motor"]):
            pass  # what it did not get it does not hold
    with using([str(port), str(link), url]):
        pass


def test_one_line_for_both_devices_and_the_same_port_again(tmp_path):
    for _ in range(2):
        with using([str(tmp_path / "line"), str(tmp_path / "line")]):
            pass


def test_where_no_such_file_can_be_made_the_port_itself_is_left_to_refuse(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "none"))
    with using([str(tmp_path / "port")]), using([str(tmp_path / "port")]):
        pass


def padbench(*words: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    """A command as somebody else gives it, in another process and folder."""
    env = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "bench.cli", *words]
    return subprocess.run(command, capture_output=True, text=True, timeout=100, cwd=cwd, env=env, check=False)


@pytest.mark.long
def test_a_second_run_and_every_other_command_are_refused_while_one_is_going_on(tmp_path):
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    protocol = protocol_file(elsewhere, PRESS)
    # A controller without a watchdog, and a run that waits for it: a busy machine must not end the first one.
    patient = {"limits": {"stale": 20.0}}
    with (
        emulated(tmp_path, "simulated_iai", **patient) as (_, real),
        running(tmp_path, real, LONG, "steps[0]") as first,
    ):
        process = f"process {first.pid})"
        told = [
            padbench("run", protocol, "--bench", str(real), "--attended", cwd=elsewhere),
            padbench("status", str(real), cwd=elsewhere),
            padbench("release", str(real), cwd=elsewhere),
            padbench("run", protocol, "--bench", str(real), "--attended", "--out", str(tmp_path / "b"), cwd=elsewhere),
        ]
        for said in told:
            assert said.returncode == 1 and "Traceback" not in said.stderr, said
            assert "is going on" in said.stderr and str(tmp_path / "out") in said.stderr and process in said.stderr
        assert not (elsewhere / "runs").exists() and not (tmp_path / "b").exists(), "nothing is left of the refused"
        assert first.poll() is None, f"nothing of it has disturbed the first: {stopped(first)}"
        recovering = padbench("recover", str(tmp_path / "out"), cwd=elsewhere)
        assert recovering.returncode == 2 and "is being written" in recovering.stderr and process in recovering.stderr
        first.kill()
        first.wait(10)
        end = time.monotonic() + 30
        while (said := padbench("status", str(real), cwd=elsewhere)).returncode and time.monotonic() < end:
            time.sleep(0.2)
        assert "motor " in said.stdout, said
