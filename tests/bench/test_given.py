"""What a recording holds of what its run was given, and what `padbench report` makes of it."""

from __future__ import annotations

import numpy as np
import pytest

import bench.results
from bench.config import load_model
from bench.given import bench_in, model_in, prediction_in
from bench.predict import predict
from bench.recording import read_recording
from bench.results import analyse
from tests.bench.run.benches import run


@pytest.fixture(scope="module")
def believing(tmp_path_factory):
    """A run for which the silicone was believed, on a bench that has the polyurethane."""
    return run(tmp_path_factory.mktemp("believing"), pad="silicone")


@pytest.mark.long
def test_the_run_is_diagnosed_again_against_what_was_believed(believing, monkeypatch):
    asked = []

    def remembered(measurement, model, progress):
        asked.append(model)
        return diagnose(measurement, model, progress)

    diagnose = bench.results.diagnose
    monkeypatch.setattr(bench.results, "diagnose", remembered)
    made = analyse(believing.folder)
    assert made.diagnosis is not None
    assert [model.pad for model in asked] == [load_model("silicone").pad]
    assert made.fit is not None and asked[0].pad != made.fit.model.pad


def test_the_plan_is_expected_again_as_it_was_before_the_run(believing):
    believed = model_in(believing.recording)
    again = prediction_in(believing.recording, believed)
    before = predict(believing.plan, load_model("silicone"))
    assert again is not None and np.ptp(before.force_N) > 0.1
    np.testing.assert_array_equal(again.time_s, before.time_s)
    np.testing.assert_array_equal(again.force_N, before.force_N)


def test_files_that_are_not_there_or_cannot_be_read_are_none(believing):
    recording = read_recording(believing.folder)
    recording.attachments = {"bench.yaml": b"motor: [", "model.yaml": b"\xff\xfe: 1"}
    assert bench_in(recording) is None
    assert model_in(recording) is None
    assert prediction_in(recording, None) is None
