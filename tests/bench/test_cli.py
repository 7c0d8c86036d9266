"""The commands as a person gives them: what they print, what they leave, how they end."""

from __future__ import annotations

import datetime
import io
import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from bench import cli, results
from bench.recording import read_recording
from bench.run.folder import own_folder
from tests.bench.run.benches import SHORT, bench_file, merged, protocol_file
from tests.bench.said import AIR, FIT, Said

ROOT = Path(__file__).parents[2]


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
            "^padbench fit: --contact: 'glued' is none of auto, bonded",
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
    assert names == {"recording.mcap", "model.yaml", "fit.json", "diagnosis.json", "report.html"}
    page = (folder / "report.html").read_text("utf-8")
    assert page.startswith("<!doctype html>") or page.startswith("<!DOCTYPE html>")
    assert len(page) < 2_000_000
    for word in ("pad-7", "Ada", "21 °C", "&lt;b&gt;first&lt;/b&gt; &amp; last"):
        assert word in page
    recording = read_recording(folder)
    assert recording.run["operator"] == "Ada" and json.loads(recording.run["sample"]) == {"id": "pad-7"}
    assert set(recording.attachments) == {"protocol.yaml", "bench.yaml", "model.yaml"}


def test_the_last_line_says_where_the_report_is(padbench, tmp_path):
    protocol = protocol_file(tmp_path, AIR)
    for count in (1, 2):
        said = padbench("run", protocol)
        assert said.status == 0 and said.err == ""
        report = Path(said.out.splitlines()[-1].removeprefix("report: "))
        assert report.is_file() and report.parent.parent == Path("runs")
        assert re.fullmatch(r"\d{4}-\d\d-\d\d_\d{6}_in-the-air(_2)?", report.parent.name)
        assert len(list(Path("runs").iterdir())) == count


def test_a_terminal_that_is_closed_meanwhile_costs_nothing(padbench, tmp_path, monkeypatch):
    """Nobody reads any more when the run ends: the report is made all the same."""

    class Closed(io.StringIO):
        def flush(self) -> None:
            if Path("out/recording.mcap").exists():
                raise OSError(5, "Input/output error")

    monkeypatch.setattr(sys, "stdout", Closed())
    assert cli.main(["run", protocol_file(tmp_path, AIR), "--out", "out"]) == 0
    sys.stdout.close()
    assert Path("out/report.html").is_file()


def test_folders_of_one_second_are_numbered(padbench):
    now = datetime.datetime(2026, 11, 21, 10, 15)
    names = []
    for _ in range(3):
        with own_folder("quick", None, now) as folder:
            names.append(folder.name)
    assert names == [f"2026-11-21_101500_quick{tail}" for tail in ("", "_2", "_3")]
    with own_folder("quick", Path("a/b"), now) as folder:
        assert folder == Path("a/b") and folder.is_dir()


def test_a_stopped_run_keeps_data_and_says_why(padbench, tmp_path):
    protocol = protocol_file(tmp_path, merged(SHORT, {"limits": {"force": 2}, "steps": [{"to": 1.5, "speed": 80}]}))
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
    said = padbench("run", protocol_file(tmp_path, AIR), "--bench", bench, "--simulated", "--out", "out")
    assert said.status == 0, said.err
    assert "no fit: there was no pad (air run)" in said.out
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


def test_a_fit_that_leaves_more_than_noise_says_so_and_what_to_do(padbench, csv):
    plain = padbench("fit", csv, *FIT)
    assert "times the noise" not in plain.out and "padbench diagnose" not in plain.out
    poor = padbench("fit", csv, "--law", "polynomial", "--degree", "1", "--order", "1", "--write", "my model.yaml")
    assert poor.status == 0 and "times the noise: it lacks something" in poor.out
    assert poor.out.rstrip().endswith(f"padbench diagnose {csv} --model 'my model.yaml'")


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


def told_difference(said: Said) -> float:
    """What `simulate --like` says of the data, N."""
    assert said.status == 0, said
    found = re.search(r"RMS difference to the data ([\d.e-]+) N", said.out)
    assert found is not None
    return float(found[1])


def test_the_model_that_was_written_gives_the_error_that_was_told(padbench, csv):
    """contracts.md: `simulate MODEL --like DATA` reproduces rmse within 1 %."""
    rmse = json.loads(padbench("fit", csv, *FIT, "--json", "-", "--write", "model.yaml").out)["rmse"]
    said = padbench("simulate", "model.yaml", "--like", csv, "--out", "again.csv")
    assert said.status == 0
    assert told_difference(said) == pytest.approx(rmse, rel=0.01)
    data, again = (np.genfromtxt(path, delimiter=",", names=True) for path in (csv, Path("again.csv")))
    assert np.array_equal(data["time_s"], again["time_s"])
    assert np.sqrt(np.mean((data["force_N"] - again["force_N"]) ** 2)) == pytest.approx(rmse, rel=0.01)


def test_the_model_of_a_run_folder_gives_the_error_of_its_fit(padbench, csv, folder):
    Path("run").mkdir()
    assert padbench("convert", csv, "run/recording.mcap").status == 0
    assert padbench("fit", "run", *FIT, "--json", "run/fit.json", "--write", "run/model.yaml").status == 0
    # A surface found by touch-off is moved by the fit within its doubt; the model of the pad does not hold that.
    for run_folder, within in (("run", 0.01), (folder, 0.3)):
        rmse = json.loads((Path(run_folder) / "fit.json").read_text())["rmse"]
        said = padbench("simulate", Path(run_folder) / "model.yaml", "--like", run_folder, "--out", "again.csv")
        assert float(re.search(r"RMS difference to the data ([\d.e-]+) N", said.out)[1]) == pytest.approx(
            rmse, rel=within
        )  # type: ignore[index]


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


@pytest.mark.long
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
    assert said.status == 0 and said.out.startswith("wrote run.csv\n  note: a CSV has no place for")
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


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no /dev/full")
@pytest.mark.parametrize("words", [["check", "quick"], ["check", "--list"], ["schema", "protocol"]])
def test_a_full_disk_behind_standard_output_is_no_defect(tmp_path, words):
    """Little is written when the interpreter ends, much before: both are said, once."""
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "bench.cli", *words], stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert done.returncode == 2 and "cannot be written: No space left on device" in done.stderr
    assert done.stderr.count("\n") == 1


def test_ctrl_c_while_the_model_is_fitted_says_where_the_recording_is(padbench, tmp_path, monkeypatch):
    def struck(*given, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr("bench.results.analyse", struck)
    said = padbench("run", protocol_file(tmp_path, AIR), "--out", "out")
    assert said.status == 1 and "Ctrl-C" in said.err and "`padbench report out`" in said.err
    assert Path("out/recording.mcap").is_file()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no /dev/full")
def test_a_disk_that_is_full_when_the_fit_is_written_says_what_is_kept(padbench, tmp_path, monkeypatch):
    def full(folder, **options):
        (folder / "diagnosis.json").symlink_to("/dev/full")
        return analyse(folder, **options)

    analyse = results.analyse
    monkeypatch.setattr("bench.results.analyse", full)
    said = padbench("run", protocol_file(tmp_path, AIR), "--out", "out")
    assert said.status == 1 and "out: what was found cannot be written: No space left on device" in said.err
    assert "`padbench report out`" in said.err and "Traceback" not in said.err
    monkeypatch.setattr("bench.results.analyse", analyse)
    Path("out/diagnosis.json").unlink()
    assert padbench("report", "out").status == 0


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
@pytest.mark.parametrize("turned_into", [None, ValueError])
def test_a_command_that_is_told_to_end_says_so(padbench, monkeypatch, name, turned_into):
    """Also where what was under way makes another error of it, as pydantic does of one amid a schema."""

    def struck(args):
        try:
            os.kill(os.getpid(), getattr(signal, name))
            time.sleep(5.0)
        except KeyboardInterrupt:
            if turned_into:
                raise turned_into("within a schema") from None
            raise
        return 0

    usual = signal.default_int_handler if name == "SIGINT" else signal.SIG_DFL
    before = signal.signal(getattr(signal, name), usual)  # whoever started the tests may have had it ignored (nohup)
    monkeypatch.setattr("bench.commands.check.main", struck)
    try:
        said = padbench("check", "quick")
        assert signal.getsignal(getattr(signal, name)) == usual
    finally:
        signal.signal(getattr(signal, name), before)
    whom = "the operator (Ctrl-C)" if name == "SIGINT" else f"signal {name}"
    assert said.status == 1 and said.err == f"padbench check: stopped by {whom}\n"
