"""A bench emulated by `padbench emulate` in a process of its own, and clients that are run beside it."""

from __future__ import annotations

import importlib.util
import json
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import yaml

from bench.shipped import find_shipped

ROOT = Path(__file__).parents[2]
PADBENCH = "import sys; from bench.cli import main; sys.exit(main(sys.argv[1:]))"

ORCA = {"driver": "orca", "baudrate": 1_000_000, "stroke": [-20, 20]}
IAI = {"driver": "iai", "baudrate": 115200, "stroke": [-20, 20]}
SMC_LEC = {"driver": "smc_lec", "baudrate": 38400, "stroke": [-20, 20]}
DAD = {"driver": "dad141", "baudrate": 115200, "capacity": 50}
LAUMAS = {"driver": "laumas_tlb", "baudrate": 115200, "capacity": 50}
BALANCE = {"driver": "mt_sics", "baudrate": 9600, "capacity": 50, "unit": "g"}

TRIES = 4
"""A busy machine gives the emulator the processor too late for a client's time-out now and then; what is really wrong
is wrong every time."""


def needs(module: str) -> None:
    """Skip where a client's package is not there. It is looked for, not imported: that is for the client's process."""
    if importlib.util.find_spec(module) is None:
        pytest.skip(f"{module} is not installed (pip install 'padbench[clients]')")


def needs_program(name: str) -> str:
    """Path of a client program; skips where there is none."""
    path = shutil.which(name)
    if path is None:
        pytest.skip(f"{name} is not installed (a Debian package of this name)")
    return path


@contextmanager
def emulated(tmp_path: Path, motor: dict[str, Any], load_cell: dict[str, Any]) -> Iterator[dict[str, str]]:
    """Paths of the devices by their keys. The pad is far away, and nothing is noisy."""
    shipped = find_shipped("bench", "simulated")
    assert shipped is not None
    content = yaml.safe_load(shipped.read_text("utf-8"))
    content["motor"] = {"port": "sim://bench/motor", **motor}
    content["load_cell"] = {"port": "sim://bench/load_cell", **load_cell}
    content["limits"]["position"] = [-1, 6]
    content["simulation"] |= {"surface": 15.0, "noise": {"force": 0.0, "position": 0.0}}
    file = tmp_path / "bench.yaml"
    file.write_text(yaml.safe_dump(content), "utf-8")
    with subprocess.Popen(
        [sys.executable, "-c", PADBENCH, "emulate", str(file)], cwd=ROOT, stdout=subprocess.PIPE, text=True
    ) as process:
        try:
            assert process.stdout is not None
            paths = dict(process.stdout.readline().split() for _ in range(2))
            assert paths.keys() == {"motor", "load_cell"}
            yield paths
        finally:
            process.terminate()


def run_client(tmp_path: Path, devices: tuple[dict[str, Any], dict[str, Any]], key: str, script: str) -> Any:
    """Run a Python client in a process of its own with a device's path as its argument; what it prints, from JSON."""
    for left in reversed(range(TRIES)):
        with emulated(tmp_path, *devices) as paths:
            done = subprocess.run(
                [sys.executable, "-W", "ignore", "-c", script, paths[key]], capture_output=True, text=True, timeout=60
            )
        if done.returncode == 0:
            return json.loads(done.stdout.splitlines()[-1])
        if not left:
            pytest.fail(f"the client failed {TRIES} times, last with:\n{done.stdout}{done.stderr}")
    raise AssertionError
