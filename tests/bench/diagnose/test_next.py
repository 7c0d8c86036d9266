"""The next test: proposed where names are in doubt, runnable, within the limits, and it tells."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.config import load_bench
from bench.diagnose import diagnose
from bench.diagnose.data import Data
from bench.diagnose.next_test import WORTH, design, family, refitted, rival_of, separation, write_protocol
from bench.diagnose.probing import AIR_mm, Reach, library, motion, together
from bench.diagnose.words import lines
from bench.preflight import check
from bench.protocol import Protocol, load_protocol
from bench.recording.types import Measurement
from sim.model import Model
from tests.bench.diagnose.small import PAD, case, made_up, measurement, motion_of

REACH = Reach(2.0, 80.0, 3000.0)


def data(depth_mm: float = 1.7, speed_mm_s: float = 5.0) -> Measurement:
    """A triangle in and out."""
    t = np.arange(0.0, 8.0, 0.002)
    x = np.interp(t, [1, 1 + depth_mm / speed_mm_s, 5, 5 + depth_mm / speed_mm_s], [0, depth_mm, depth_mm, 0]) - 0.1
    force = Model.from_dict({"pad": PAD}).simulate(t, x)
    return Measurement("data", t, x, t, force)


def models(*effects: dict[str, object]) -> tuple[Model, Model]:
    first, second = (Model.from_dict({"pad": PAD, "effects": [effect]}) for effect in effects)
    return first, second


def test_nothing_is_proposed_where_nothing_is_in_doubt():
    d = made_up()
    sure = replace(d.causes[0], confidence=0.99, alternatives=[replace(d.causes[0].alternatives[0], excluded=True)])
    assert design(replace(d, causes=[sure]), data()) is None
    assert design(replace(d, causes=[]), data()) is None
    assert design(replace(d, rivals=[]), data()) is None, "without a model of the rival there is nothing to tell apart"
    assert design(replace(d, model_dict={"pad": {"elastic": {"law": "none"}}}), data()) is None


def test_the_proposal_is_runnable_and_within_the_limits(tmp_path):
    content = design(made_up(), data())
    assert content is not None
    write_protocol(tmp_path / "next.yaml", content)
    protocol = load_protocol(tmp_path / "next.yaml")
    assert "friction" in protocol.description and "backlash" in protocol.description
    steps = [flat.step for flat in protocol.flatten()]
    assert max(s.to for s in steps) <= 1.6  # the deepest of the data
    assert max(s.speed for s in steps) <= 5.5  # the fastest of the data: no bench file allows more
    believed = Model.from_dict({"pad": PAD})
    assert check(protocol, load_bench("simulated"), believed).ok
    assert check(protocol, load_bench("simulated_iai"), believed).ok


def test_a_bench_file_allows_more_speed_and_limits_the_force():
    bench = load_bench("simulated")
    content = design(made_up(), data(), bench)
    assert content is not None
    assert content["limits"]["force"] <= bench.limits.force
    slow = design(made_up(), data(), bench.model_copy(update={"limits": bench.limits.model_copy(update={"speed": 3})}))
    assert slow is not None
    assert max(f.step.speed for f in Protocol.model_validate(slow).flatten()) <= 3


def test_a_run_that_was_the_test_is_not_proposed_again():
    d = made_up()
    content = design(d, data())
    assert content is not None and not d.doubts
    for ran in (
        content["description"],
        content["description"].replace("friction from backlash", "backlash from friction"),
    ):
        again = made_up()
        assert design(again, data(), ran=ran) is None
        assert any("the same again tells no more" in line for line in lines(again))
    assert design(made_up(), data(), ran="Tells friction from cogging: slow ramps.") == content


def test_the_rival_tested_against_is_the_one_not_excluded():
    d = made_up()
    pair = rival_of(d)
    assert pair is not None and (pair.named, pair.other) == ("friction", "backlash")
    assert pair.models[1].effects[0].id == "backlash"


def test_blocks_stay_within_reach_and_begin_and_end_in_air():
    for block in library(REACH):
        depths = [step["to"] for step in block.steps]
        assert max(depths) <= REACH.depth_mm and depths[-1] == AIR_mm
        assert max(step["speed"] for step in block.steps) <= REACH.speed_mm_s


def test_the_motion_is_that_of_the_steps():
    steps = together(library(REACH)[:2])
    moved = motion(steps, REACH.acceleration_mm_s2, 500.0)
    fine = np.arange(moved.time_s[-1] * 500) / 500
    assert moved.weight.sum() == pytest.approx(fine.size, abs=2)
    assert np.all(np.diff(moved.time_s) > 0)
    assert moved.position_mm.max() == pytest.approx(REACH.depth_mm)
    assert np.abs(np.diff(moved.position_mm) / np.diff(moved.time_s)).max() <= REACH.speed_mm_s * 1.001


def test_models_that_are_the_same_to_a_refit_cannot_be_told():
    """Under an exponential law an offset is another m exactly."""
    same = models({"id": "contact_offset", "offset": 0.05}, {"id": "contact_offset", "offset": 0.0})
    shallow = next(block for block in library(REACH) if block.name == "shallow")
    moved = motion([*shallow.steps], REACH.acceleration_mm_s2, 500.0)
    inside = replace(moved, position_mm=np.maximum(moved.position_mm, 0.3))  # the surface itself would tell
    assert separation(same, inside, 1e-3) < 1e-3


def test_what_noise_hides_is_not_told():
    pair = models({"id": "force_drift", "form": "linear", "rate": 0.002}, {"id": "force_bias", "bias": 0.05})
    moved = motion(together(library(REACH)), REACH.acceleration_mm_s2, 200.0)
    n = moved.time_s.size
    force = pair[0].simulate(moved.time_s, moved.position_mm)
    sigma, fold = np.ones(n), np.zeros(n, dtype=np.intp)
    left = refitted(Data(moved.time_s, moved.position_mm, force, moved.weight, sigma, fold), pair[1])
    # by hand: a constant leaves rate² (t − mean)² of a line in time, and the pad can take some of that where it is felt
    line = 0.002 * (moved.time_s - np.average(moved.time_s, weights=moved.weight))
    assert 0 < left <= float(np.sum(moved.weight * line**2)) * 1.001
    friction = models({"id": "friction", "coulomb": 0.05}, {"id": "backlash", "gap": 0.03})
    clear, noisy = (separation(friction, moved, s) for s in (0.01, 3.0))
    assert clear >= 1.0 > WORTH > noisy


def test_a_drift_that_settles_at_once_is_a_bias():
    """Another form of the rival may pass for the cause: what it takes is not told."""
    pair = models({"id": "force_bias", "bias": 0.05}, {"id": "force_drift", "form": "linear", "rate": 0.002})
    assert {m.effects[-1].form for m in family(pair[1])} >= {"linear", "settling"}
    block = next(block for block in library(REACH) if block.name == "slow")
    assert separation(pair, motion(block.steps, REACH.acceleration_mm_s2, 200.0), 0.01) < 1.0


@pytest.mark.slow
@pytest.mark.parametrize("true", [pytest.param("force_delay", marks=pytest.mark.long), "contact_offset"])
def test_the_next_test_names_the_right_one(true):
    """A staircase leaves look-alikes in doubt; the run proposed then tells."""
    first = case(true, seed=21, rate_hz=508.0)
    m = measurement(first)
    d = diagnose(m, Model.from_dict(first.believed))
    content = design(d, m)
    if content is None:
        pytest.skip("the staircase has told already")
    second = case(true, seed=21, rate_hz=508.0, drawn=first.truth.drawn, motion=motion_of(content))
    told = diagnose(measurement(second), Model.from_dict(first.believed))
    assert [c.id for c in told.causes][:1] == [true]
