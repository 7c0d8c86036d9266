"""Effects hidden by the independent simulator, and by a simulated bench, are found and named: a fixed small budget.

The whole judgement, with sizes, pairs and intervals, is `python -m tests.campaign`. Here each effect of the catalogue
is hidden once at its typical size, at slow sampling and in a short protocol, with consecutive seeds; a rate is required
and not each case, since no seed is picked.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import yaml

from bench.shipped import find_file
from tests.bench.run.benches import run
from tests.campaign.judge import diagnosed
from tests.campaign.plan import CATALOGUE
from tests.truth.cases import NOISES, draw_case, null_case
from tests.truth.detect import misfit

pytestmark = pytest.mark.slow

GROUPS = {
    "machine": ("frame_compliance", "backlash", "contact_offset", "friction", "inertia", "cogging", "encoder_error"),
    "force path": ("sensor_lag", "resonance", "force_delay", "clock_skew", "mains_hum"),
    "channel": ("force_drift", "force_bias", "saturation", "outliers", "stuck_samples"),
    "contact": ("separation", "adhesion", "elastic_law", "permanent_set"),
    "material": (
        *("stress_softening", "damage", "missing_relaxation_mode"),
        *("depth_dependent_relaxation", "viscous_damping"),
    ),
}
FAST = {"resonance", "clock_skew", "mains_hum"}
"""Not to be seen at slow sampling."""

LOOK_ALIKE = {"force_delay", "sensor_lag", "resonance"}
"""All three make the force late: of these it is enough that the right one is said not to be excluded."""


def hidden(id: str) -> Any:
    """The case of an id: its seed is its place in the catalogue."""
    rate = 300.0 if id in FAST else 100.0
    return draw_case(CATALOGUE.index(id), (id,), 1.0, protocol="rich", rate_hz=rate)


def right(id: str, said: dict[str, Any]) -> bool:
    """Whether the first cause is the hidden one, or a look-alike that says so."""
    causes = said["causes"]
    if not causes:
        return False
    if causes[0]["id"] == id:
        return True
    listed = {a["id"] for a in causes[0]["alternatives"] if not a["excluded"]}
    return {id, causes[0]["id"]} <= LOOK_ALIKE and id in listed


def test_every_id_is_in_one_group():
    assert sorted(id for ids in GROUPS.values() for id in ids) == sorted(CATALOGUE)


@pytest.mark.parametrize("turn", [None, *(pytest.param(turn, marks=pytest.mark.long) for turn in (0, 1, 2, 3))])
@pytest.mark.parametrize("group", GROUPS)
def test_hidden_effects_are_named(group, turn, tmp_path):
    """The first one of a group each day; by every fourth, all of it takes six times as long again."""
    asked = GROUPS[group][:1] if turn is None else GROUPS[group][turn::4]
    ids = [id for id in asked if misfit(hidden(id)).detectable]
    assert len(ids) >= max(len(asked) - 1, 1)  # else the set judges nothing
    said = {id: diagnosed(case := hidden(id), case.write(tmp_path / id))["said"] for id in ids}
    wrong = {id: [c["id"] for c in s["causes"]] or s["verdict"] for id, s in said.items() if not right(id, s)}
    assert len(wrong) <= len(asked) // 3, wrong


@pytest.mark.parametrize("seeds", [range(3), pytest.param(range(3, 12), marks=pytest.mark.long)])
def test_noise_of_the_position_that_lasts_is_no_play(seeds, tmp_path):
    """A play that follows an encoder's filtered noise later takes some of it away."""
    said = {}
    for seed in seeds:
        case = null_case(seed, rate_hz=400.0, position_noise_mm=1.5e-3, position_step_mm=0.0, position_memory=3.0)
        said[seed] = diagnosed(case, case.write(tmp_path / str(seed)))["said"]
    alarms = {seed: [c["id"] for c in s["causes"]] for seed, s in said.items() if s["verdict"] != "consistent"}
    assert len(alarms) <= len(seeds) // 4, alarms


@pytest.mark.parametrize("seeds", [range(2), pytest.param(range(2, 8), marks=pytest.mark.long)])
def test_nothing_hidden_is_consistent(seeds, tmp_path):
    said = {}
    for seed in seeds:
        case = null_case(seed, noise_kind=NOISES[seed % 4], rate_hz=100.0)
        said[seed] = diagnosed(case, case.write(tmp_path / str(seed)))["said"]
    alarms = {
        seed: [c["id"] for c in s["causes"]] or s["verdict"] for seed, s in said.items() if s["verdict"] != "consistent"
    }
    assert len(alarms) <= len(seeds) // 4, alarms


def test_found_through_the_wire(tmp_path, padbench):
    pad = yaml.safe_load(find_file("pad", "polyurethane").read_text("utf-8"))
    truth = tmp_path / "truth.yaml"
    truth.write_text(yaml.safe_dump(pad | {"effects": [{"id": "frame_compliance", "compliance": 0.02}]}))
    folder: Path = run(tmp_path, "quick", simulation={"pad": str(truth), "seed": 11}).folder
    assert padbench("diagnose", folder, "--model", "polyurethane", "--json", tmp_path / "said.json").status == 0
    said = json.loads((tmp_path / "said.json").read_text("utf-8"))
    assert said["verdict"] == "explained" and said["causes"][0]["id"] == "frame_compliance"
    number = said["causes"][0]["parameters"]["compliance"]
    assert abs(number["value"] - 0.02) <= max(0.002, 2 * number["std"])


@pytest.mark.long
def test_a_clean_run_is_consistent_on_a_slow_bench(tmp_path, padbench):
    folder: Path = run(tmp_path, "quick", "simulated_laumas", simulation={"seed": 7}).folder
    assert padbench("diagnose", folder, "--model", "polyurethane", "--json", tmp_path / "said.json").status == 0
    said = json.loads((tmp_path / "said.json").read_text("utf-8"))
    assert said["verdict"] == "consistent", said["causes"]
