"""A fitted model held against the run it was fitted to: the surface that the fit moved is found again."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from bench.cli import main
from bench.config import load_model
from bench.diagnose import diagnose
from bench.like import likeness
from bench.recording import read_recording, write_csv
from bench.recording.types import Measurement
from sim.model import Model
from tests.bench.run.benches import SHORT, run


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    """A short run, and the fit of it."""
    folder = tmp_path_factory.mktemp("like")
    done = run(folder, SHORT)
    model, result = folder / "model.yaml", folder / "fit.json"
    arguments = ["--law", "exponential", "--order", "2", "--contact", "unilateral"]
    assert main(["fit", str(done.folder), *arguments, "--write", str(model), "--json", str(result)]) == 0
    return done, model, json.loads(result.read_text())


def said_rmse(text: str) -> float:
    found = re.search(r"RMS difference to the data ([0-9.e+-]+) N", text)
    assert found is not None
    return float(found.group(1))


def as_reported_rmse(text: str) -> float:
    """On the positions as they are, on which a fit works: said beside where the motion as felt serves better."""
    found = re.search(r"([0-9.e+-]+) N on the positions as reported", text)
    return float(found.group(1)) if found else said_rmse(text)


def test_simulate_agrees_with_the_fit(fitted, tmp_path, capsys):
    done, model, fit = fitted
    capsys.readouterr()
    assert main(["simulate", str(model), "--like", str(done.folder), "--out", str(tmp_path / "out.csv")]) == 0
    said = capsys.readouterr().out
    # a fit takes the tare for right; here its own error, of some hundredths of the noise's power, is found
    assert 0.98 * fit["rmse"] < as_reported_rmse(said) < 1.002 * fit["rmse"]
    assert said_rmse(said) <= as_reported_rmse(said)
    assert "surface taken" in said


@pytest.mark.long
@pytest.mark.parametrize("off_mm", [0.02, -0.02])
def test_a_surface_that_is_off_is_found_within_its_doubt(fitted, off_mm):
    done, model, fit = fitted
    m = done.recording.measurement()
    here = likeness(load_model(str(model)), m)
    moved = replace(m, position_mm=m.position_mm - off_mm, surface_std_mm=0.02)
    certain = likeness(load_model(str(model)), replace(moved, surface_std_mm=0.0))
    doubted = likeness(load_model(str(model)), moved)
    assert certain.moved_mm == 0 and "surface" not in certain.sentence and certain.rmse_N > 1.5 * here.rmse_N
    assert doubted.moved_mm == pytest.approx(here.moved_mm + off_mm, abs=5e-4)
    assert doubted.rmse_N == pytest.approx(here.rmse_N, rel=1e-3)
    assert np.array_equal(doubted.measurement.position_mm, moved.position_mm), "the data stay as they were"


def test_a_surface_is_not_moved_beyond_its_doubt(fitted):
    done, model, _ = fitted
    m = done.recording.measurement()
    far = replace(m, position_mm=m.position_mm - 0.1, surface_std_mm=0.001)
    found = likeness(load_model(str(model)), far)
    assert 0 < found.moved_mm <= 0.006


def test_csv_is_taken_as_it_is(fitted, tmp_path, capsys):
    done, model, _ = fitted
    m = done.recording.measurement()
    data = tmp_path / "data.csv"
    position = np.interp(m.force_time_s, m.position_time_s, m.position_mm)
    write_csv(data, m.force_time_s, position, m.force_time_s, m.force_N)
    capsys.readouterr()
    assert main(["simulate", str(model), "--like", str(data), "--out", str(tmp_path / "out.csv")]) == 0
    said = capsys.readouterr().out
    read = read_recording(data).measurement()
    simulated = load_model(str(model)).simulate_at(read.position_time_s, read.position_mm, read.force_time_s)
    assert as_reported_rmse(said) == pytest.approx(float(np.sqrt(np.mean((read.force_N - simulated) ** 2))), rel=1e-4)
    assert "surface" not in said


@pytest.mark.long
@pytest.mark.parametrize(
    ("hidden", "known"),
    [
        ([{"id": "friction", "coulomb": 0.15}], [{"id": "friction", "coulomb": 0.1}]),
        ([{"id": "mains_hum", "amplitude": 0.06, "frequency": 50.1}], []),
        ([{"id": "force_bias", "bias": 0.08}], []),
    ],
    ids=["friction", "hum", "bias"],
)
def test_the_model_of_a_diagnosis_reproduces_its_error(tmp_path, hidden, known):
    """What friction and a bias do before contact goes with the tare, and the surface is moved within its doubt."""
    pad = load_model("polyurethane").to_dict()["pad"]
    truth = tmp_path / "truth.yaml"
    truth.write_text(json.dumps({"pad": pad, "effects": hidden}))
    measured = run(tmp_path, SHORT, simulation={"pad": str(truth)}).recording.measurement()
    assert measured.tared_s is not None and measured.surface_std_mm > 0
    told = diagnose(measured, Model.from_dict({"pad": pad, "effects": known}))
    assert likeness(told.model, measured).rmse_N == pytest.approx(told.rmse_after, rel=0.01)


@pytest.mark.long
def test_what_a_model_says_of_the_tare_counts_as_zero(fitted):
    """A pad with a bias in its cell answers as the one without: the tare took it away."""
    done, _, _ = fitted
    measured = done.recording.measurement()
    plain = load_model("polyurethane").to_dict()
    biased = Model.from_dict({**plain, "effects": [{"id": "force_bias", "bias": 0.5}]})
    assert likeness(biased, measured).rmse_N == pytest.approx(likeness(Model.from_dict(plain), measured).rmse_N)
    untared = likeness(biased, replace(measured, tared_s=None)).rmse_N
    assert untared == pytest.approx(0.5, rel=0.1), "data without a tare have the bias in them"


@pytest.mark.parametrize("felt_late", [True, False])
def test_positions_that_are_exact_are_no_worse_for_the_model_of_a_diagnosis(felt_late):
    """Steps of 10 µm, each with a row, stamped late by chance: what looks like rounding is the motion itself, and the
    stamps are those at which the force was felt, or the force was felt at even times and only stamped so."""
    rng = np.random.default_rng(4)
    t = 0.128 * np.arange(240) + rng.uniform(0.0, 0.06, 240)
    x = 0.01 * np.arange(240) - 0.4
    elastic = 26.0 * np.maximum(x, 0.0) ** 1.5
    held = np.zeros(240)  # by a mode of 0.3 s: each ramp's share, as far as it has not relaxed
    at = t if felt_late else 0.128 * np.arange(240)
    for i in range(1, 240):
        gone = np.exp(-3.0 * (at[i] - at[i - 1]))
        held[i] = gone * held[i - 1] + (1.0 - gone) / (3.0 * (at[i] - at[i - 1])) * (elastic[i] - elastic[i - 1])
    force = 0.2 * elastic + 0.8 * held + 0.005 * rng.standard_normal(240)
    m = Measurement("steps", t, x, t, force)
    believed = {"elastic": {"law": "power", "p": 20.0, "q": 0.2}, "relaxation": {"shares": [0.3], "rates": [0.6]}}
    told = diagnose(m, Model.from_dict({"pad": {**believed, "contact": "unilateral"}}))
    assert likeness(told.model, m).rmse_N == pytest.approx(told.rmse_after, rel=0.01)
