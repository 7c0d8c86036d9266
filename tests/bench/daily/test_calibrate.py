"""Calibration by dead weights: against an amplifier that is really set up wrong, and against readings by hand."""

from __future__ import annotations

import io
import json
import re
from pathlib import Path

import numpy as np
import pytest
import yaml

from bench.daily.dead_weights import Reading, calibrate
from bench.errors import Refused
from tests.bench.daily.benches import in_the_world, miscalibrated
from tests.bench.run.benches import bench_file

G = 9.80665


def cell_of(path: Path) -> dict:
    return yaml.safe_load(path.read_text("utf-8"))["load_cell"]


@pytest.mark.parametrize(
    ("true", "before"),
    [(1.037, 2.0), (-0.981, 1.0), *(pytest.param(*p, marks=pytest.mark.long) for p in ((1.037, 1.0), (-0.981, 2.0)))],
)
def test_it_finds_scale_and_sign_of_an_amplifier_set_up_wrong(padbench, tmp_path, monkeypatch, true, before):
    in_the_world(monkeypatch, miscalibrated(true))
    path = bench_file(tmp_path, load_cell={"scale": before})
    said = padbench("calibrate", path, "--weights", "0,0.2,0.5,1", "--and-back", "--yes", "--json", "-")
    found = json.loads(said.out)
    assert said.status == 0, said
    cell = cell_of(path)
    doubt = max(4 * found["std"], 2e-4)  # readings are rounded to 1 mN
    assert cell["scale"] == pytest.approx(abs(true), rel=doubt) and cell["sign"] == (1 if true > 0 else -1)
    assert str(cell["calibrated_on"]) == found["date"]
    record = next(tmp_path.glob("bench.calibration_*.json"))
    kept = json.loads(record.read_text())
    assert kept["after"] == {"scale": cell["scale"], "sign": cell["sign"]} and len(kept["readings"]) == 7
    assert kept["hysteresis_percent"] < 0.1 and kept["linearity_percent"] < 0.1


@pytest.mark.parametrize("true", [1.0, -1.0])
def test_a_sign_that_turns_is_said_before_anybody_agrees_to_it(padbench, tmp_path, monkeypatch, true):
    in_the_world(monkeypatch, miscalibrated(true))
    path = bench_file(tmp_path)
    before = path.read_text("utf-8")
    said = padbench("calibrate", path, "--weights", "0,0.2,0.5", "--yes", "--dry")
    assert said.status == 0 and ("THE SIGN TURNS" in said.out) is (true < 0)
    assert (f"sign +1 → {'-1' if true < 0 else '+1'}") in said.out and path.read_text("utf-8") == before


def test_an_interrupt_at_a_prompt_ends_the_line(padbench, tmp_path, monkeypatch):
    class Interrupted:
        def readline(self) -> str:
            raise KeyboardInterrupt

    monkeypatch.setattr("sys.stdin", Interrupted())
    said = padbench("calibrate", bench_file(tmp_path), "--weights", "0,0.2,0.5")
    assert said.status == 1 and said.err.splitlines()[-1] == "padbench calibrate: stopped by the operator (Ctrl-C)"


def test_calibrating_twice_changes_nothing_more_and_keeps_both_records(padbench, tmp_path, monkeypatch):
    in_the_world(monkeypatch, miscalibrated(1.1))
    path = bench_file(tmp_path)
    for _ in range(2):
        assert padbench("calibrate", path, "--forces", "0,2,5", "--yes").status == 0
    assert cell_of(path)["scale"] == pytest.approx(1.1, rel=1e-3)
    assert len(list(tmp_path.glob("bench.calibration_*.json"))) == 2


def test_nothing_is_written_without_consent(padbench, tmp_path, monkeypatch):
    path = bench_file(tmp_path)
    before = path.read_text()
    for words, status in ((["n"], 0), ([], 1)):
        monkeypatch.setattr("sys.stdin", io.StringIO("\n\n\n" + "".join(f"{word}\n" for word in words)))
        said = padbench("calibrate", path, "--weights", "0,0.1,1")
        assert said.status == status, said
        assert path.read_text() == before and list(tmp_path.iterdir()) == [path]
    assert padbench("calibrate", path, "--weights", "0,0.1,1", "--yes", "--dry").status == 0
    assert path.read_text() == before and list(tmp_path.iterdir()) == [path]


def test_the_person_is_asked_for_each_load_and_may_go_back_or_leave(padbench, tmp_path, monkeypatch):
    path = bench_file(tmp_path)
    monkeypatch.setattr("sys.stdin", io.StringIO("\n\nr\n\n\ny\n"))
    said = padbench("calibrate", path, "--weights", "0,0.1,1")
    assert said.status == 0 and said.err.count("0.9807 N (100.00 g)") == 2 and "written" in said.out
    monkeypatch.setattr("sys.stdin", io.StringIO("\nq\n"))
    left = padbench("calibrate", path, "--weights", "0,0.1,1")
    assert left.status == 1 and "left before all loads" in left.err


def csv(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "readings.csv"
    path.write_text(text)
    return path


def test_readings_of_a_file_need_no_device(padbench, tmp_path):
    path = bench_file(tmp_path, motor={"port": "/dev/nowhere"}, load_cell={"port": "/dev/no"})
    rows = "".join(f"{kg},{-kg * G / 0.9 + 0.3:.5f}\n" for kg in (0, 0.1, 0.5, 1, 0.5, 0))
    said = padbench("calibrate", path, "--readings", csv(tmp_path, "weight_kg,reading_N\n" + rows), "--yes")
    assert said.status == 0
    assert cell_of(path)["scale"] == pytest.approx(0.9, rel=1e-5) and cell_of(path)["sign"] == -1


READINGS = {
    "no head": ("1,2\n2,3\n", r"readings\.csv:1: the first line must name"),
    "no number": ("force_N,reading_N\n0,0\n1,one\n", r"readings\.csv:3: reading_N: `one` is no number"),
    "a cell missing": ("force_N,reading_N\n0\n", r"readings\.csv:2: reading_N: `` is no number"),
    "not finite": ("force_N,reading_N\n0,nan\n", r"readings\.csv:2: reading_N: must be a finite"),
    "empty": ("", r"readings\.csv:1: the first line"),
}


@pytest.mark.parametrize("case", READINGS)
def test_a_file_of_readings_that_cannot_be_read(padbench, tmp_path, case):
    text, message = READINGS[case]
    said = padbench("calibrate", bench_file(tmp_path), "--readings", csv(tmp_path, text), "--yes")
    assert said.status == 2 and re.search(message, said.err) and "Traceback" not in said.err


BAD = {
    "nothing": ([], "--weights: which loads"),
    "two": (["--weights", "0,1"], "--weights: three different loads"),
    "words": (["--weights", "0,one,2"], "--weights: `0,one,2` is no list of numbers"),
    "negative": (["--forces=0,-1,2"], "--forces: a load is a finite number"),
    "too heavy": (["--weights", "0,1,6"], r"--weights: 58\.84 N is not under load_cell\.capacity 50 N"),
    "both": (["--weights", "0,1,2", "--forces", "0,1,2"], "not allowed with"),
    "on the moon": (["--weights", "0,1,2", "--gravity", "1.62"], "--gravity: 1.62"),
}


@pytest.mark.parametrize("case", BAD)
def test_loads_that_cannot_be_meant(padbench, tmp_path, case):
    words, message = BAD[case]
    said = padbench("calibrate", bench_file(tmp_path), "--yes", *words)
    assert said.status == 2 and re.search(message, said.err)


def test_the_shipped_benches_stay_as_they_are(padbench):
    said = padbench("calibrate", "simulated", "--weights", "0,0.1,1", "--yes")
    assert said.status == 2 and "shipped bench" in said.err


# -- the line ----------------------------------------------------------------------------------------------------------


def readings(loads: list[float], values: list[float]) -> list[Reading]:
    return [Reading(load, value, 0.001, 100) for load, value in zip(loads, values, strict=True)]


def test_linearity_is_the_largest_departure_in_percent_of_the_span():
    # A parabola of height h over the span departs from its least-squares line, at n = 5 evenly spaced points, by the
    # residuals of the orthogonal polynomial (2, -1, -2, -1, 2)/2 of it: h/2 · (½, -¼, -½, -¼, ½).
    x = np.linspace(0.0, 1.0, 5)
    h = 0.01
    found = calibrate(readings([*10 * x], [*10 * (x + h * 4 * x * (1 - x))]))
    assert found.linearity_percent == pytest.approx(100 * 0.5 * h, rel=1e-6)
    assert found.hysteresis_percent is None


def test_hysteresis_is_the_largest_difference_up_and_down():
    found = calibrate(readings([0, 5, 10, 5, 0], [0, 5.00, 10, 5.04, 0.01]))
    assert found.hysteresis_percent == pytest.approx(0.4, rel=0.01)


def test_a_cell_that_is_no_line_is_refused(padbench, tmp_path):
    path = bench_file(tmp_path)
    before = path.read_text()
    rows = "force_N,reading_N\n0,0\n5,5\n10,7\n"
    said = padbench("calibrate", path, "--readings", csv(tmp_path, rows), "--yes")
    assert said.status == 1 and "no scale mends that" in said.err and path.read_text() == before


def test_a_weight_that_is_not_felt_is_refused():
    with pytest.raises(Refused, match="hardly more than their noise"):
        calibrate([Reading(load, 0.001 * load / 10, 0.01, 100) for load in (0.0, 5.0, 10.0)])
