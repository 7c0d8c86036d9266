"""`padbench diagnose`: its words, files and statuses, and its agreement with `simulate --like`."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
import yaml

from bench.config import load_model
from bench.like import likeness
from bench.recording import read_recording
from tests.bench.diagnose.small import case, diagnosed, measurement, written
from tests.bench.report.html_check import check
from tests.bench.run.benches import SHORT, protocol_file, run
from tests.bench.said import AIR


@pytest.fixture(scope="module")
def friction(tmp_path_factory) -> tuple[Path, Path]:
    """Data with friction, and the model that knows nothing of it."""
    return written(tmp_path_factory.mktemp("friction"), case("friction"))


def finite(text: str) -> dict:
    """JSON without NaN or infinity."""

    def refuse(word: str) -> float:
        raise AssertionError(word)

    return json.loads(text, parse_constant=refuse)


def test_words_json_model_report_and_agreement(padbench, friction):
    data, model = friction
    said = padbench("diagnose", data, "--model", model, "--json", "d.json", "--write", "m2.yaml", "--report", "d.html",
                    "--next", "next.yaml")  # fmt: skip
    assert said.status == 0, said
    assert "friction" in said.out.splitlines()[0]
    content = finite(Path("d.json").read_text())
    assert content["verdict"] == "explained" and content["causes"][0]["id"] == "friction"
    assert sum(c["gain"] for c in content["causes"]) + content["left"] == pytest.approx(1.0, abs=1e-6)
    assert Path("next.yaml").exists() == (content["next_protocol"] is not None)
    page = Path("d.html").read_text()
    check(page)
    assert len(page) < 2_000_000
    assert yaml.safe_load(Path("m2.yaml").read_text())["effects"][0]["id"] == "friction"
    like = padbench("simulate", "m2.yaml", "--like", data, "--out", "out.csv")
    found = re.search(r"RMS difference to the data ([0-9.e+-]+) N", like.out)
    assert like.status == 0 and found is not None
    assert float(found.group(1)) == pytest.approx(content["rmse_after"], rel=0.01)


def test_json_alone_on_standard_output(padbench, friction):
    data, model = friction
    said = padbench("diagnose", data, "--model", model, "--json", "-")
    assert said.status == 0 and said.err == ""
    assert finite(said.out)["causes"][0]["id"] == "friction"


@pytest.mark.parametrize(
    "id", ["sensor_lag", *(pytest.param(id, marks=pytest.mark.long) for id in ("outliers", "contact_offset"))]
)
def test_the_extended_model_reproduces_the_error(id):
    c, d = diagnosed(id)
    assert likeness(d.model, measurement(c)).rmse_N == pytest.approx(d.rmse_after, rel=0.01)


@pytest.mark.parametrize(
    ("words", "patterns"),
    [
        (("nothing.csv", "--model", "polyurethane"), (r"nothing\.csv: does not exist",)),
        (("{data}", "--model", "nobody"), (r"nobody: there is no such file", "shipped: ")),
        (("{data}",), ("--model",)),
        (("bad.csv", "--model", "polyurethane"), (r"bad\.csv",)),
        (("short.csv", "--model", "polyurethane"), (r"force samples can be used",)),
        (("dead.csv", "--model", "polyurethane"), (r"dead\.csv: the force is zero throughout", "connected")),
        (("stuck.csv", "--model", "polyurethane"), (r"stuck\.csv: the force is 0\.25 N throughout", "connected")),
        (("turned.csv", "--model", "polyurethane"), (r"turned\.csv: the position never passes the surface", "sign")),
        (("still.csv", "--model", "polyurethane"), (r"still\.csv: the position never passes the surface", "zero")),
        (("{data}", "--model", "polyurethane", "--json", "no/where.json"), (r"there is no folder no",)),
        (("{data}", "--model", "polyurethane", "--next", "no/where.yaml"), (r"there is no folder no",)),
        (("{data}", "--model", "broken.yaml"), (r"broken\.yaml",)),
    ],
)
def test_bad_input_is_said_in_one_message(padbench, csv, words, patterns):
    Path("bad.csv").write_text("a,b\n1,2\n")
    Path("short.csv").write_text("time_s,position_mm,force_N\n" + "".join(f"{k / 10},{k},{k}\n" for k in range(5)))
    for name, level in (("dead", 0.0), ("stuck", 0.25)):
        rows = (f"{k / 50},{min(k / 100, 2.0)},{level}\n" for k in range(500))
        Path(f"{name}.csv").write_text("time_s,position_mm,force_N\n" + "".join(rows))
    for name, way in (("turned", -1.0), ("still", 0.0)):
        rows = (f"{k / 50},{way * min(k / 100, 2.0)},{min(k / 100, 2.0)}\n" for k in range(500))
        Path(f"{name}.csv").write_text("time_s,position_mm,force_N\n" + "".join(rows))
    Path("broken.yaml").write_text("pad: {elastic: {law: exponential, m: -1, b: 2}}\n")
    said = padbench("diagnose", *(csv if word == "{data}" else word for word in words))
    assert said.status == 2, said
    for pattern in patterns:
        assert re.search(pattern, said.err), said.err
    assert "Traceback" not in said.err and said.out == ""


def test_a_run_in_air_asks_for_a_model_without_a_pad(padbench, tmp_path):
    done = run(tmp_path, AIR)
    said = padbench("diagnose", done.folder, "--model", "polyurethane")
    assert said.status == 2 and "recorded in air" in said.err and "law: none" in said.err


def test_an_empty_model_is_taken_for_a_run_in_air(padbench, tmp_path):
    done = run(tmp_path, AIR)
    (tmp_path / "none.yaml").write_text("pad: {elastic: {law: none}}\n")
    said = padbench("diagnose", done.folder, "--model", "none.yaml", "--json", "d.json", "--report", "d.html")
    assert said.status == 0, said
    assert (
        read_recording(done.folder).measurement().name and finite(Path("d.json").read_text())["next_protocol"] is None
    )
    assert load_model("none.yaml").pad.elastic.law == "none"


def test_every_run_ends_with_a_diagnosis(padbench, tmp_path):
    folder = tmp_path / "out"
    protocol = protocol_file(tmp_path, SHORT)
    said = padbench("run", protocol, "--out", folder)
    assert said.status == 0, said
    content = finite((folder / "diagnosis.json").read_text())
    assert f"diagnosis: {content['verdict']}" in said.out
    page = (folder / "report.html").read_text()
    assert "Diagnosis: " in page and "diagnosis.json" in page
    assert len(page) < 3_000_000
