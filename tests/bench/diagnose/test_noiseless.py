"""Data without noise, as a simulation writes them: the first that a newcomer will try."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import yaml

from bench.diagnose import diagnose
from bench.diagnose.channel import faults
from bench.diagnose.noise import force_noise, least_N
from bench.diagnose.noiseless import without_noise
from bench.recording.types import Measurement
from sim.model import Model
from tests.bench.diagnose.small import PAD, case, measurement

OFF = 1.08  # what the pad believed is stiffer by


def said_of(padbench, effects: list[dict]) -> dict:
    """The diagnosis of some effects simulated over the protocol `quick`, with a pad believed that has none."""
    Path("true.yaml").write_text(yaml.safe_dump({"pad": PAD, "effects": effects}))
    elastic = {**PAD["elastic"], "m": OFF * PAD["elastic"]["m"]}
    Path("believed.yaml").write_text(yaml.safe_dump({"pad": {**PAD, "elastic": elastic}}))
    assert padbench("simulate", "true.yaml", "--protocol", "quick", "--out", "data.csv").status == 0
    return json.loads(padbench("diagnose", "data.csv", "--model", "believed.yaml", "--json", "-").out)


def test_a_protocol_is_sampled_evenly_as_the_bench_would(padbench):
    assert padbench("simulate", "polyurethane", "--protocol", "quick", "--out", "data.csv").status == 0
    time_s = np.genfromtxt("data.csv", delimiter=",", names=True)["time_s"]
    assert np.allclose(np.diff(time_s), 1e-3, atol=1e-9) and len(time_s) > 3000


@pytest.mark.slow
def test_what_is_believed_is_consistent_with_its_simulation(padbench):
    content = said_of(padbench, [])
    assert content["verdict"] == "consistent" and not content["causes"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effect", "form", "name"),
    [
        ({"id": "friction", "coulomb": 0.05}, "coulomb", "coulomb"),
        pytest.param(
            *({"id": "frame_compliance", "compliance": 0.005}, "linear", "compliance"), marks=pytest.mark.long
        ),
        pytest.param(*({"id": "force_bias", "bias": 0.05}, "constant", "bias"), marks=pytest.mark.long),
        pytest.param(*({"id": "backlash", "gap": 0.02}, "play", "gap"), marks=pytest.mark.long),
    ],
)
def test_what_was_hidden_in_a_simulation_is_named_in_its_plain_form(padbench, effect, form, name):
    content = said_of(padbench, [effect])
    assert content["verdict"] == "explained"
    assert [(c["id"], c["form"]) for c in content["causes"]] == [(effect["id"], form)]
    assert content["causes"][0]["parameters"][name]["value"] == pytest.approx(effect[name], rel=0.01)


def still() -> Measurement:
    """Forces of the independent simulator without their noise: in air they stand still."""
    c = case("adhesion")
    m = measurement(c)
    where = np.isfinite(c.force_N)
    return Measurement(m.name, m.position_time_s, m.position_mm, m.force_time_s, c.truth.clean_N[where])


def test_a_channel_that_stands_still_in_air_has_no_noise_and_does_not_stick():
    m = still()
    found = faults(m.force_N)
    assert found.stuck.sum() > 100  # by themselves the samples say so
    assert not without_noise(m, found).stuck.any()
    assert force_noise(m, found.good).force_N < least_N(m)


def test_a_channel_with_noise_that_sticks_does_so_all_the_same():
    c = case("stuck_samples")
    m, found = measurement(c), faults(measurement(c).force_N)
    assert found.stuck.sum() > 10 and np.array_equal(without_noise(m, found).stuck, found.stuck)
    believed = Model.from_dict(c.believed)
    assert [cause.id for cause in diagnose(m, believed).causes] == ["stuck_samples"]
