"""The commands as a person gives them: what they print, what they leave, how they end; and what they say of bad input."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from bench import cli
from bench.recording import read_recording
from tests.bench.run.benches import SHORT, bench_file, merged, protocol_file, run

ROOT = Path(__file__).parents[2]
FIT = ("--law", "exponential", "--order", "2", "--contact", "unilateral")
MODEL: dict[str, Any] = {
    "pad": {
        "elastic": {"law": "exponential", "m": 2.24, "b": 0.69},
        "relaxation": {"shares": [0.25, 0.15], "rates": [4.0, 0.35]},
        "contact": "unilateral",
    }
}


@dataclass(frozen=True)
class Said:
    """How a command ended and what it printed."""

    status: int
    out: str
    err: str


@pytest.fixture
def padbench(capsys, monkeypatch, tmp_path):
    """Give a command in a folder of its own."""
    monkeypatch.chdir(tmp_path)

    def give(*words: object) -> Said:
        capsys.readouterr()
        try:
            status = cli.main([str(word) for word in words])
        except SystemExit as end:
            status = int(end.code or 0)
        printed = capsys.readouterr()
        return Said(status, printed.out, printed.err)

    return give


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A run folder, complete, made by the command; its surface is where touch-off puts it."""
    where = tmp_path_factory.mktemp("shared")
    bench = bench_file(where, simulation={"seed": 11})
    protocol = protocol_file(where, merged(SHORT, {"sample": {"id": "pad-7"}}))
    out = where / "out"
    words = ["--operator", "Ada", "--note", "<b>first</b> & last", "--conditions", "21 °C"]
    assert cli.main(["run", protocol, "--bench", str(bench), "--pad", "polyurethane", "--out", str(out), *words]) == 0
    return out


@pytest.fixture(scope="module")
def csv(tmp_path_factory) -> Path:
    """A fast ramp and a hold of the shipped pad, with noise, as CSV."""
    path = tmp_path_factory.mktemp("csv") / "data.csv"
    from bench.config import load_model

    t = np.arange(0, 4, 0.004)
    x = np.interp(t, [0, 0.2, 0.25, 2, 2.1, 4], [-0.2, -0.2, 1.5, 1.5, 0.4, 0.4])
    force = load_model("polyurethane").simulate(t, x) + np.random.default_rng(4).normal(0, 0.01, t.size)
    rows = zip(t, x, force, strict=True)
    path.write_text("time_s,position_mm,force_N\n" + "".join(f"{a:.4f},{b:.6f},{c:.5f}\n" for a, b, c in rows))
    return path


# -- the command itself ------------------------------------------------------------------------------------------------


def test_help_imports_nothing_heavy():
    heavy = ("numpy", "scipy", "numba", "matplotlib", "pydantic", "rich", "yaml", "mcap", "serial")
    code = f"import sys, bench.cli; bench.cli.parser(None); print([m for m in {heavy} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=60)
    assert done.stdout.strip() == "[]", done.stderr


@pytest.mark.parametrize("command", cli.COMMANDS)
def test_every_command_has_help(padbench, command):
    said = padbench(command, "--help")
    assert said.status == 0 and said.out.startswith(f"usage: padbench {command}") and not said.err
    assert cli.COMMANDS[command][:20].lower() in said.out.lower()


def test_help_names_every_command(padbench):
    said = padbench("--help")
    assert said.status == 0
    for command in cli.COMMANDS:
        assert re.search(rf"^    {command} ", said.out, re.M)
    assert "no emergency stop" in said.out


def test_version(padbench):
    assert re.fullmatch(r"padbench \d+\.\d+\.\d+\n", padbench("--version").out)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ((), "usage: padbench"),
        (("rnu", "quick"), r"^padbench: there is no command 'rnu'; did you mean run\?\n  see padbench --help\n$"),
        (("run",), r"^padbench run: the following arguments are required: PROTOCOL\n  see padbench run --help\n$"),
        (("run", "quick", "--bnch", "x"), r"^padbench run: there is no option --bnch; did you mean --bench\?\n"),
        (("run", "quick", "--bnch=x"), r"^padbench run: there is no option --bnch; did you mean --bench\?\n"),
        (("run", "quick", "slow"), "^padbench run: 'slow' is one word too many\n"),
        (
            ("fit", "x.csv", "--contact", "glued"),
            "^padbench fit: --contact: 'glued' is none of auto, bonded, unilateral",
        ),
        (("fit", "x.csv", "--degree", "two"), "^padbench fit: --degree: 'two' is no whole number\n"),
        (("fit", "x.csv", "--sample-time", "x"), "^padbench fit: --sample-time: 'x' is no number\n"),
        (("schema", "protocl"), r"^padbench schema: kind: 'protocl' is none of .*did you mean protocol\?\n"),
        (("simulate", "polyurethane", "--out", "x.csv"), "--protocol.*--like.*required"),
        (("check",), "^padbench check: PROTOCOL: which one"),
    ],
)
def test_a_command_that_is_not_understood(padbench, words, message):
    said = padbench(*words)
    assert said.status == 2 and not said.out
    assert re.search(message, said.err), said.err


def test_a_defect_is_called_one_and_leaves_a_log(padbench, monkeypatch):
    def broken(kind: str) -> Any:
        raise ZeroDivisionError("made for the test")

    monkeypatch.setattr("bench.schemas.schema", broken)
    said = padbench("schema", "bench")
    assert said.status == 70 and not said.out and "Traceback" not in said.err
    assert "defect of padbench" in said.err and "ZeroDivisionError: made for the test" in said.err
    log = Path(re.search(r"details are in (\S+)", said.err)[1])  # type: ignore[index]
    assert "Traceback" in log.read_text() and "in broken" in log.read_text()
    log.unlink()


# -- run and check -----------------------------------------------------------------------------------------------------


def test_a_run_leaves_a_folder(folder):
    names = {path.name for path in folder.iterdir()}
    assert names == {"recording.mcap", "model.yaml", "fit.json", "report.html"}
    page = (folder / "report.html").read_text("utf-8")
    assert page.startswith("<!doctype html>") or page.startswith("<!DOCTYPE html>")
    assert len(page) < 2_000_000
    for word in ("pad-7", "Ada", "21 °C", "&lt;b&gt;first&lt;/b&gt; &amp; last"):
        assert word in page
    recording = read_recording(folder)
    assert recording.run["operator"] == "Ada" and json.loads(recording.run["sample"]) == {"id": "pad-7"}
    assert set(recording.attachments) == {"protocol.yaml", "bench.yaml", "model.yaml"}


def test_the_last_line_says_where_the_report_is(padbench, tmp_path):
    protocol = protocol_file(tmp_path, merged(SHORT, {"name": "my pad", "steps": [{"to": 0.4, "speed": 20}]}))
    said = padbench("run", protocol, "--bench", bench_file(tmp_path))
    assert said.status == 0 and said.err == ""
    report = Path(said.out.splitlines()[-1].removeprefix("report: "))
    assert report.is_file() and report.parent.parent == Path("runs")
    assert re.fullmatch(r"\d{4}-\d\d-\d\d_\d{6}_my-pad", report.parent.name)
    again = padbench("run", protocol, "--bench", bench_file(tmp_path))
    assert again.status == 0 and len(list(Path("runs").iterdir())) == 2


def test_a_stopped_run_keeps_data_and_says_why(padbench, tmp_path):
    protocol = protocol_file(tmp_path, merged(SHORT, {"limits": {"force": 2}, "steps": [{"to": 1.5, "speed": 20}]}))
    said = padbench("run", protocol, "--bench", bench_file(tmp_path), "--out", "out")
    assert said.status == 1
    assert re.search(r"^STOPPED: force limit: 2\.\d+ N measured, 2 N allowed\n  .* kept in out$", said.out, re.M)
    page = Path("out/report.html").read_text("utf-8")
    card = re.search(r'<section class="verdict bad"><h2>(.*?)</h2><p>(.*?)</p>', page)
    assert card is not None and "stopped" in card[1] and "force limit: 2." in card[2]
    assert re.search(r"\.bad\b[^{]*\{[^}]*(red|var\(--bad\))", page), "in red"
    recording = read_recording(Path("out"))
    assert recording.result is not None and recording.result["status"] == "stopped"


def test_a_run_that_is_known_to_fail_does_not_begin(padbench, tmp_path):
    protocol = protocol_file(tmp_path, merged(SHORT, {"limits": {"force": 2}, "steps": [{"to": 1.5, "speed": 20}]}))
    said = padbench("run", protocol, "--pad", "polyurethane", "--out", "out")
    assert said.status == 1 and not Path("out").exists()
    assert re.match(
        r"padbench run: steps\[0\]: [\d.]+ N are expected, at up to 1\.5 mm: beyond limits\.force 2 N", said.err
    )


def test_a_real_bench_wants_somebody_to_stand_there(padbench, tmp_path):
    ports = {"motor": {"port": "/dev/ttyUSB0"}, "load_cell": {"port": "/dev/ttyUSB1"}}
    bench = bench_file(tmp_path, simulation=None, **ports)
    said = padbench("run", "quick", "--bench", bench)
    assert said.status == 1 and "--attended" in said.err and "--simulated" in said.err
    assert not Path("runs").exists()


@pytest.mark.parametrize("base", ["simulated", "simulated_iai", "simulated_modbus"])
def test_a_dry_run_of_a_real_bench(padbench, tmp_path, base):
    """Its drivers, rates and limits; only the ports are replaced."""
    ports = {"motor": {"port": "/dev/ttyUSB0"}, "load_cell": {"port": "/dev/ttyUSB1"}}
    bench = bench_file(tmp_path, base, name="lab 2.yaml", simulation=None, **ports)
    protocol = protocol_file(tmp_path, merged(SHORT, {"steps": [{"to": 0.4, "speed": 20}]}))
    said = padbench("run", protocol, "--bench", bench, "--simulated", "--out", "out")
    assert said.status == 0, said.err
    recording = read_recording(Path("out"))
    assert recording.run["simulated"] == "true"
    kept = yaml.safe_load(recording.attachments["bench.yaml"])
    assert kept["motor"]["port"] == "/dev/ttyUSB0" and kept["motor"]["driver"] == recording.run["motor"]


def test_check_shows_the_plan_and_what_is_expected(padbench):
    said = padbench("check", "quick", "--pad", "polyurethane", "--plot", "plan.html")
    assert said.status == 0 and said.err == ""
    rows = [line.split() for line in said.out.splitlines() if line.startswith("steps[")]
    assert [row[2] for row in rows] == ["1", "2", "1.2", "0", "1.6", "0"]
    # F = F^e(1)·g at the end of a quick ramp: between what has all relaxed and what has not.
    elastic = 2.24 / 0.69 * (np.exp(0.69) - 1)
    assert 0.9 * elastic < float(rows[0][-1]) < elastic
    assert "peak force" in said.out and "plot: plan.html" in said.out
    page = Path("plan.html").read_text("utf-8")
    assert "<svg" in page and "steps[4]" in page


def test_check_refuses_with_the_name_of_the_step(padbench, tmp_path):
    steps = [{"block": "deep", "repeat": 2, "steps": [{"to": 0.5, "speed": 20}, {"to": 2.4, "speed": 20, "hold": 1}]}]
    protocol = protocol_file(tmp_path, merged(SHORT, {"limits": {"force": 9}, "steps": steps}))
    said = padbench("check", protocol, "--pad", "polyurethane", "--plot", "plan.html")
    assert said.status == 1
    assert re.match(r"padbench check: steps\[0\]\.deep\[[01]\]\.steps\[1\]: [\d.]+ N are expected", said.err)
    assert said.err.count("are expected") == 1 and "are expected" not in said.out, "told once"
    assert Path("plan.html").is_file(), "drawn all the same: it shows where"


def test_check_lists_what_is_shipped(padbench):
    said = padbench("check", "--list")
    for word in ("staircase", "sweep", "quick", "long_hold", "precondition", "rich", "air", "first_contact"):
        assert re.search(rf"^protocols: .*\b{word}\b", said.out, re.M)
    assert "simulated_iai" in said.out and "silicone" in said.out


# -- what is made of data ----------------------------------------------------------------------------------------------

FIT_KEYS = {
    "method": str, "law": str, "order": int, "contact": str, "model": dict, "parameters": dict, "filter": type(None),
    "V": float, "rmse": float, "noise_floor": float, "fit_percent": float, "physical": bool, "converged": bool,
    "undetermined": list, "held_out_rmse": float, "samples": int, "seconds": float,
}  # fmt: skip
"""contracts.md, fit.json, for the continuous method."""


def test_fit_json_is_what_is_promised(padbench, csv):
    said = padbench("fit", csv, *FIT, "--json", "-")
    assert said.status == 0 and said.err == ""
    found = json.loads(said.out)
    assert {key: type(found[key]) for key in FIT_KEYS} == FIT_KEYS
    assert list(found["parameters"]) == ["m", "b", "c_1", "c_2", "nu_1", "nu_2"]
    assert {name: p["unit"] for name, p in found["parameters"].items()} == {
        "m": "N/mm", "b": "1/mm", "c_1": "1", "c_2": "1", "nu_1": "1/s", "nu_2": "1/s"
    }  # fmt: skip
    for name, truth in {"m": 2.24, "b": 0.69, "c_1": 0.25, "nu_1": 4.0}.items():
        parameter = found["parameters"][name]
        assert abs(parameter["value"] - truth) < 4 * parameter["std"]
    assert found["V"] == pytest.approx(found["rmse"] ** 2)
    assert found["rmse"] == pytest.approx(0.01, rel=0.1) and found["noise_floor"] == pytest.approx(0.01, rel=0.2)
    assert (found["method"], found["law"], found["order"], found["contact"]) == (
        "continuous",
        "exponential",
        2,
        "unilateral",
    )


def test_fit_writes_what_is_asked_for(padbench, csv):
    said = padbench("fit", csv, *FIT, "--json", "fit.json", "--write", "model.yaml", "--report", "page.html")
    assert said.status == 0
    assert "exponential law, 2 relaxation modes, unilateral contact" in said.out
    found = json.loads(Path("fit.json").read_text())
    assert yaml.safe_load(Path("model.yaml").read_text())["pad"]["elastic"]["m"] == pytest.approx(
        found["parameters"]["m"]["value"]
    )
    assert "<svg" in Path("page.html").read_text("utf-8")


def test_the_model_that_was_written_gives_the_error_that_was_told(padbench, csv):
    """contracts.md: `simulate MODEL --like DATA` reproduces rmse within 1 %."""
    rmse = json.loads(padbench("fit", csv, *FIT, "--json", "-", "--write", "model.yaml").out)["rmse"]
    said = padbench("simulate", "model.yaml", "--like", csv, "--out", "again.csv")
    assert said.status == 0
    assert float(re.search(r"RMS difference to the data ([\d.e-]+) N", said.out)[1]) == pytest.approx(rmse, rel=0.01)  # type: ignore[index]
    data, again = (np.genfromtxt(path, delimiter=",", names=True) for path in (csv, Path("again.csv")))
    assert np.array_equal(data["time_s"], again["time_s"])
    assert np.sqrt(np.mean((data["force_N"] - again["force_N"]) ** 2)) == pytest.approx(rmse, rel=0.01)


def test_the_model_of_a_run_gives_the_error_of_its_fit(padbench, folder):
    fit = json.loads((folder / "fit.json").read_text())
    said = padbench("simulate", folder / "model.yaml", "--like", folder, "--out", "again.csv")
    assert said.status == 0
    told = float(re.search(r"RMS difference to the data ([\d.e-]+) N", said.out)[1])  # type: ignore[index]
    assert told == pytest.approx(fit["rmse"], rel=0.01)


def test_simulate_over_a_protocol(padbench, tmp_path):
    said = padbench("simulate", "polyurethane", "--protocol", protocol_file(tmp_path, SHORT), "--out", "plan.csv")
    assert said.status == 0 and "wrote plan.csv" in said.out
    data = np.genfromtxt("plan.csv", delimiter=",", names=True)
    assert data["position_mm"].max() == pytest.approx(1.0) and data["position_mm"][-1] == pytest.approx(-0.3)
    assert data["force_N"][-1] == 0 and 2.5 < data["force_N"].max() < 3.23
    assert padbench("fit", "plan.csv", *FIT).status == 0


def test_several_measurements_are_one_pad(padbench, csv, folder):
    said = padbench("fit", csv, folder, *FIT, "--json", "-")
    assert said.status == 0
    one = json.loads(padbench("fit", csv, *FIT, "--json", "-").out)
    assert json.loads(said.out)["samples"] > one["samples"]


def test_report_makes_a_run_folders_files_again(padbench, folder):
    page = (folder / "report.html").read_text("utf-8")
    (folder / "report.html").unlink()
    said = padbench("report", folder)
    assert said.status == 0 and said.out.splitlines()[-1] == f"report: {folder / 'report.html'}"
    again = (folder / "report.html").read_text("utf-8")
    assert "pad-7" in again and abs(len(again) - len(page)) < 0.5 * len(page)


def test_compare(padbench, csv, folder):
    said = padbench("compare", csv, folder, *FIT, "--out", "two.html")
    assert said.status == 0 and said.out.count("fit: exponential law") == 2
    page = Path("two.html").read_text("utf-8")
    assert "data.csv" in page and "<svg" in page


def test_convert_there_and_back(padbench, csv, folder):
    assert padbench("convert", csv, "data.mcap").status == 0
    assert padbench("convert", "data.mcap", "again.csv").status == 0
    a, b = (np.genfromtxt(path, delimiter=",", names=True) for path in (csv, Path("again.csv")))
    for name in ("time_s", "position_mm", "force_N"):
        np.testing.assert_allclose(a[name], b[name], atol=1e-9)
    said = padbench("convert", folder, "run.csv")
    assert said.status == 0 and said.out == "wrote run.csv\n"
    assert Path("run.csv").read_text().startswith("time_s,position_mm,force_N")


def test_recover(padbench, folder):
    whole = (folder / "recording.mcap").read_bytes()
    Path("whole.mcap").write_bytes(whole)
    said = padbench("recover", "whole.mcap")
    assert said.status == 0 and "wrote whole.recovered.mcap" in said.out
    Path("torn.mcap").write_bytes(whole[: len(whole) // 2])
    said = padbench("recover", "torn.mcap", "out.mcap")
    assert said.status == 3 and "wrote out.mcap" in said.out
    assert read_recording(Path("out.mcap")).motor.time_s.size > 1000


@pytest.mark.parametrize("kind", ["protocol", "bench", "model"])
def test_schema_is_json(padbench, kind):
    said = padbench("schema", kind)
    assert said.status == 0
    assert json.loads(said.out)["type"] == "object"


# -- bad input ---------------------------------------------------------------------------------------------------------


def refused(said: Said, *patterns: str, status: int = 2) -> None:
    """One message, on standard error alone, that says all this."""
    assert said.status == status, said
    assert "Traceback" not in said.err and "Error" not in said.err, said.err
    assert len(said.err.splitlines()) <= 8 and said.err.startswith("padbench ")
    for pattern in patterns:
        assert re.search(pattern, said.err, re.M), said.err


STEP = "steps:\n  - {to: 1, speed: 10}\n"
BOMB = "a: &a [1,1,1,1,1,1,1,1,1,1]\n" + "".join(
    f"{name}: &{name} [{','.join(['*' + before] * 10)}]\n" for before, name in zip("abcdefg", "bcdefgh", strict=True)
)
PROTOCOLS = {
    "unknown key": (f"name: p\n{STEP}hold: 3\n", r"p\.yaml:4:1: hold: unknown key"),
    "nearly a key": ("name: p\nsteps:\n  - {to: 1, sped: 10}\n", r"p\.yaml:3:13: steps\[0\]\.sped: .*\n.*`speed`"),
    "wrong type": ("name: p\nsteps:\n  - {to: one, speed: 10}\n", r"p\.yaml:3:10: steps\[0\]\.to: .*number.*`one`"),
    "quoted": ("name: p\nsteps:\n  - {to: '1', speed: 10}\n", r"p\.yaml:3:10: .*number.*quotes"),
    "NaN": ("name: p\nsteps:\n  - {to: .nan, speed: 10}\n", r"p\.yaml:3:10: steps\[0\]\.to: .*finite"),
    "infinite": ("name: p\nsteps:\n  - {to: .inf, speed: 10}\n", r"p\.yaml:3:10: steps\[0\]\.to: .*finite"),
    "negative speed": ("name: p\nsteps:\n  - {to: 1, speed: -10}\n", r"p\.yaml:3:20: steps\[0\]\.speed: must be > 0"),
    "no speed": ("name: p\nsteps:\n  - {to: 1}\n", r"p\.yaml:3:5: steps\[0\]\.speed: is missing"),
    "no steps": ("name: p\nsteps: []\n", r"p\.yaml:2:8: steps: must not be empty"),
    "steps missing": ("name: p\n", r"p\.yaml:1:1: steps: is missing"),
    "empty": ("", r"p\.yaml: is empty\n.*name, steps"),
    "a list": ("- 1\n", r"p\.yaml:1:1: must be a mapping"),
    "depth and force": ("name: p\nsteps:\n  - {to: 1, to_force: 2, speed: 1}\n", r"p\.yaml:3:5: .*one of `to`"),
    "python tag": (f"name: !!python/object/apply:os.system ['true']\n{STEP}", r"p\.yaml:1:7: the tag .* not allowed"),
    "anchors": (BOMB, r"p\.yaml:\d+:\d+: more than \d+ values"),
    "unclosed": ("name: p\nsteps:\n  - {to: 1, speed: 10\n", r"p\.yaml:4:1: is not valid YAML: .*the end of the file\n.*line 3"),
    "tab": ("name: p\nsteps:\n\t- {to: 1, speed: 10}\n", r"p\.yaml:3:1: .*\n.*spaces"),
    "twice": (f"name: p\nname: q\n{STEP}", r"p\.yaml:2:1: name: this key is given twice\n.*line 1"),
    "deeper than its own limit": (f"name: p\nlimits: {{depth: 0.5}}\n{STEP}", r"p\.yaml:4:10: .*beyond limits\.depth 0\.5"),
    "faster than the bench": ("name: p\nsteps:\n  - {to: 1, speed: 1000}\n", r"p\.yaml:3:20: .*limits\.speed 200 mm/s"),
    "force beyond its own limit": (
        "name: p\nlimits: {force: 2}\nsteps:\n  - {to_force: 3, speed: 1}\n", r"p\.yaml:4:16: .*beyond limits\.force 2",
    ),
    "no time for a name": ("name: ''\n" + STEP, r"p\.yaml:1:7: name:"),
}  # fmt: skip


@pytest.mark.parametrize("case", PROTOCOLS)
def test_a_protocol_that_cannot_be_run(padbench, case):
    text, message = PROTOCOLS[case]
    Path("p.yaml").write_text(text)
    refused(padbench("check", "p.yaml"), "^padbench check: ", message)
    refused(padbench("run", "p.yaml", "--out", "out"), message)
    assert not Path("out").exists()


BENCHES: dict[str, tuple[dict[str, Any], str]] = {
    "unknown key": ({"motor": {"drivr": "orca"}}, r"bench\.yaml:\d+:3: motor\.drivr: unknown key\n.*`driver`"),
    "unknown driver": ({"motor": {"driver": "orka"}}, r"bench\.yaml:\d+:11: motor\.driver: .*'orca'"),
    "negative limit": ({"limits": {"force": -1}}, r"bench\.yaml:\d+:10: limits\.force: must be > 0"),
    "a limit beyond the cell": ({"limits": {"force": 80}}, r"limits\.force: 80 N is beyond load_cell\.capacity 50 N\n"),
    "travel upside down": ({"limits": {"position": [3, -3]}}, r"limits\.position: .*3.*less than.*-3"),
    "travel beyond the stroke": ({"limits": {"position": [-50, 3]}}, r"limits\.position: .*beyond motor\.stroke"),
    "no truth": ({"simulation": None}, r"motor\.port: is simulated, but there is no `simulation` block"),
    "no such pad": ({"simulation": {"pad": "pads/x.yaml"}}, r"simulation\.pad: there is no file `pads/x\.yaml`"),
    "no limits": ({"limits": None}, r"bench\.yaml:1:1: limits: is missing"),
    "not a date": ({"load_cell": {"calibrated_on": "soon"}}, r"load_cell\.calibrated_on: .*date"),
}


@pytest.mark.parametrize("case", BENCHES)
def test_a_bench_that_cannot_be(padbench, tmp_path, case):
    changes, message = BENCHES[case]
    bench_file(tmp_path, **changes)
    refused(padbench("check", "quick", "--bench", "bench.yaml"), message)


MODELS: dict[str, tuple[dict[str, Any], str]] = {
    "shares over 1": ({"relaxation": {"shares": [0.7, 0.6]}}, r"pad\.relaxation\.shares: .*1\.3, more than 1"),
    "a negative rate": ({"relaxation": {"rates": [4.0, -0.3]}}, r"pad\.relaxation\.rates\[1\]: must be > 0, not -0\.3"),
    "rates that rise": ({"relaxation": {"rates": [0.3, 4.0]}}, r"pad\.relaxation\.rates: .*descend"),
    "a share without a rate": ({"relaxation": {"shares": [0.1]}}, r"pad\.relaxation: 1 shares but 2 rates"),
    "an unknown law": (
        {"elastic": {"law": "exponental"}},
        r"pad\.elastic\.law: there is no `exponental`\n.*`exponential`",
    ),
    "a law without its number": ({"elastic": {"b": None}}, r"pad\.elastic\.b: is missing"),
    "an unknown contact": (
        {"contact": "glued"},
        r"pad\.contact: must be `unilateral` or `bonded`, not the word `glued`",
    ),
}


@pytest.mark.parametrize("case", MODELS)
def test_a_model_that_cannot_be(padbench, case):
    changes, message = MODELS[case]
    Path("m.yaml").write_text(yaml.safe_dump({"pad": merged(MODEL["pad"], changes)}, sort_keys=False))
    refused(padbench("check", "quick", "--pad", "m.yaml"), r"m\.yaml:\d+:\d+: ", message)
    refused(padbench("simulate", "m.yaml", "--protocol", "quick", "--out", "x.csv"), message)
    assert not Path("x.csv").exists()


@pytest.mark.parametrize(
    ("effect", "message"),
    [
        ({"id": "fricton", "coulomb": 0.1}, "no effect 'fricton'; did you mean 'friction'"),
        ({"id": "friction"}, "needs 'coulomb' in N"),
        ({"id": "friction", "coulomb": -1}, "coulomb must be from 0 to"),
        ({"id": "friction", "form": "stribek", "coulomb": 1}, "no form 'stribek'"),
    ],
)
def test_an_effect_that_cannot_be(padbench, effect, message):
    Path("m.yaml").write_text(yaml.safe_dump(MODEL | {"effects": [effect]}, sort_keys=False))
    refused(padbench("check", "quick", "--pad", "m.yaml"), r"m\.yaml:\d+:\d+: effects\[0\]: ", message)


TABLES = {
    "empty": ("", r"d\.csv: is empty\n.*time_s,position_mm,force_N"),
    "one line": ("time_s,position_mm,force_N\n", r"d\.csv: has a header and no row"),
    "one row": ("time_s,position_mm,force_N\n0,0,0\n", r"d\.csv: .*single row"),
    "time goes back": (
        "time_s,position_mm,force_N\n0,0,0\n1,1,1\n0.5,2,2\n",
        r"d\.csv:4:1: time goes back: 0\.5 after 1",
    ),
    "time stands still": ("time_s,position_mm,force_N\n0,0,0\n0,1,1\n0,2,2\n", r"d\.csv: .*same time"),
    "other columns": ("a,b,c\n0,0,0\n1,1,1\n", r"d\.csv: has no column 'time_s'.*\n.*'a', 'b', 'c'.*--columns"),
    "words": ("time_s,position_mm,force_N\n0,0,0\n1,y,1\n", r"d\.csv:3:3: 'y' in column 'position_mm' is not a number"),
    "NaN": ("time_s,position_mm,force_N\n0,0,0\n1,1,nan\n", r"d\.csv:3:5: 'nan' in column 'force_N'"),
    "a short row": ("time_s,position_mm,force_N\n0,0,0\n1,1\n", r"d\.csv:3: 2 cells where the header has 3"),
}


@pytest.mark.parametrize("case", TABLES)
def test_a_table_that_holds_no_measurement(padbench, case):
    text, message = TABLES[case]
    Path("d.csv").write_text(text)
    said = padbench("fit", "d.csv", "--json", "-")
    refused(said, message)
    assert said.out == ""


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", r"is empty"),
        (b"junk" * 100, r"is not an MCAP file"),
        (b"\x89MCAP0\r\n" + b"\x00" * 300, r"holds no position sample"),
    ],
)
def test_a_recording_that_is_none(padbench, content, message):
    Path("r.mcap").write_bytes(content)
    refused(padbench("fit", "r.mcap"), r"r\.mcap: ", message)
    refused(padbench("recover", "r.mcap"), r"r\.mcap: holds nothing that could be recovered")


@pytest.mark.parametrize(
    ("words", "patterns"),
    [
        (("fit", "nothing.csv"), (r"nothing\.csv: does not exist",)),
        (("fit", "dota.csv"), (r"dota\.csv: does not exist", r"did you mean data\.csv\?")),
        (("fit", "."), (r"no run folder: it has no recording\.mcap",)),
        (("fit", "/dev/null"), (r"/dev/null: is no file",)),
        (("fit", "data.csv", "--method", "continous"), (r"--method: there is no method `continous`", "continuous")),
        (("fit", "data.csv", "--law", "exp"), (r"--law: there is no law `exp`", "exponential, power, polynomial")),
        (("fit", "data.csv", "--order", "two"), (r"--order: `two` is no order",)),
        (("fit", "data.csv", "--order", "0"), (r"--order: `0` is no order",)),
        (("fit", "data.csv", "--law", "power", "--degree", "3"), (r"--degree: the power law has no degree",)),
        (("fit", "data.csv", "--law", "polynomial", "--degree", "0"), (r"--degree: 0 is no degree",)),
        (("fit", "data.csv", "--columns", "nonsense"), (r"--columns: 'nonsense' is not WHAT=COLUMN",)),
        (("fit", "data.csv", "--columns", "tme=time_s"), (r"--columns: 'tme' is not known", "did you mean 'time'")),
        (("fit", "data.csv", "--columns", "time=t"), (r"data\.csv: has no column 't'", "time=time_s")),
        (("fit", "data.csv", "--units", "position=furlong"), (r"--units: 'furlong' is no unit of position",)),
        (("fit", "data.csv", "--units", "nonsense"), (r"--units: 'nonsense' is not WHAT=UNIT",)),
        (("fit", "data.csv", "--json", "no/such/fit.json"), (r"fit\.json: cannot be written: there is no folder no/such",)),
        (("fit", "data.csv", "--write", "no/such/m.yaml"), (r"m\.yaml: cannot be written",)),
        (("fit", "data.csv", "--report", "."), (r"\.: is a folder",)),
        (("compare", "data.csv"), (r"one run alone compares with nothing",)),
        (("compare", "data.csv", "nothing"), (r"nothing: does not exist",)),
        (("report", "nothing"), (r"nothing: does not exist",)),
        (("report", "data.csv"), (r"data\.csv: is not a run folder", r"padbench fit FILE --report")),
        (("convert", "data.csv", "x.foo"), (r"x\.foo: ends neither in \.csv nor in \.mcap",)),
        (("convert", "data.csv", "data.csv"), (r"is the input itself",)),
        (("recover", "nothing.mcap"), (r"nothing\.mcap: does not exist",)),
        (("simulate", "polyurethane", "--like", "nothing.csv", "--out", "x.csv"), (r"nothing\.csv: does not exist",)),
        (("simulate", "polyurethane", "--protocol", "air", "--out", "x.csv"), (r"air: presses no pad",)),
        (("simulate", "polyuretane", "--protocol", "quick", "--out", "x.csv"), (r"did you mean `polyurethane`\?",)),
        (("simulate", "polyurethane", "--protocol", "quick", "--out", "no/x.csv"), (r"there is no folder no",)),
        (("run", "quik"), (r"quik: there is no such file, and no shipped protocol", r"did you mean `quick`\?")),
        (("run", "quick", "--bench", "simulatd"), (r"no shipped bench", r"did you mean `simulated`\?")),
        (("run", "quick", "--pad", "silicon"), (r"no shipped pad", r"did you mean `silicone`\?")),
        (("run", "quick", "--operator", " "), (r"--operator: is empty",)),
        (("run", "quick", "--out", "full"), (r"full: is not empty", "no run overwrites another")),
        (("run", "quick", "--out", "data.csv"), (r"data\.csv: is a file, not a folder",)),
        (("run", "quick", "--out", "/proc/x"), (r"/proc/x: cannot be written", "--out")),
        (("check", "missing.yaml"), (r"missing\.yaml: there is no such file",)),
        (("emulate", "nope"), (r"no shipped bench of that name",)),
    ],
)  # fmt: skip
def test_what_is_not_there_or_makes_no_sense(padbench, csv, words, patterns):
    Path("data.csv").write_bytes(csv.read_bytes())
    Path("full").mkdir()
    Path("full/notes.txt").write_text("mine")
    said = padbench(*words)
    refused(said, rf"^padbench {words[0]}: ", *patterns)
    assert said.out == "" or words[:1] == ("run",)
    assert not Path("runs").exists() and Path("full/notes.txt").read_text() == "mine"


@pytest.mark.parametrize("port", ["/dev/ttyNOTHING", "foo://bar", "socket://127.0.0.1:1"])
def test_a_port_that_is_not_there(padbench, tmp_path, port):
    bench = bench_file(tmp_path, simulation=None, motor={"port": port}, load_cell={"port": "/dev/ttyNOTHING2"})
    said = padbench("run", "quick", "--bench", bench, "--attended", "--out", "out")
    refused(said, rf"bench\.yaml:\d+:9: motor: cannot open port '{port}': ", "check 'port'")
    assert not Path("out").exists(), "nothing is left behind: the command can be given again"


def test_a_bench_that_is_half_real(padbench, tmp_path):
    bench = bench_file(tmp_path, motor={"port": "/dev/ttyUSB0"})
    said = padbench("run", "quick", "--bench", bench, "--attended")
    refused(said, r"bench\.yaml:\d+:9: motor\.port is real, and the other one is simulated", "--simulated")
    assert not Path("runs").exists()


@pytest.mark.skipif(not hasattr(__import__("os"), "openpty"), reason="there are no pseudo-terminals here")
def test_a_device_that_does_not_answer(padbench, tmp_path):
    """A terminal with nobody at its other end."""
    import os

    pairs = [os.openpty() for _ in range(2)]
    try:
        ports = [{"port": os.ttyname(slave)} for _, slave in pairs]
        bench = bench_file(tmp_path, simulation=None, motor=ports[0], load_cell=ports[1])
        said = padbench("run", "quick", "--bench", bench, "--attended", "--out", "out")
        refused(said, r"bench\.yaml:\d+:\d+: load_cell: no answer to '.*' within \d+ ms", "baudrate")
        assert not Path("out").exists()
    finally:
        for end in (end for pair in pairs for end in pair):
            os.close(end)


def test_an_air_run_is_no_data_to_fit(padbench, tmp_path):
    air = {"name": "a", "approach": "none", "steps": [{"to": -0.5, "speed": 20, "hold": 0.1}], "finish": {"air": 0.1}}
    done = run(tmp_path, air)
    said = padbench("fit", done.folder, "--json", "-")
    refused(said, "recording")
    assert said.out == ""


def test_a_run_that_never_met_the_pad_is_no_data_to_fit(padbench, tmp_path):
    done = run(tmp_path, SHORT, simulation={"surface": 5}, limits={"position": [-2, 1]})
    refused(padbench("fit", done.folder), "has no touch-off")
    report = padbench("report", done.folder)
    assert report.status == 0 and "the run ended before the pad's surface was found" in report.out
