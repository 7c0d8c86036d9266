"""One press and one hold show what acts with the motion once: no name of that kind is sure then."""

from __future__ import annotations

import numpy as np
import pytest

from bench.diagnose import Diagnosis, diagnose
from bench.diagnose.data import Data
from bench.diagnose.way import TOLD_ONCE, is_rich
from sim.effects import all_effects
from sim.model import Model
from tests.bench.diagnose.small import case, diagnosed, measurement
from tests.truth.motion import staircase


def data(levels_mm: list[float], hold_s: float = 1.0) -> Data:
    """Moves at 1 mm/s from one level to the next, each held."""
    time, level = [0.0], [0.0]
    for to in levels_mm:
        time += [time[-1] + abs(to - level[-1]), time[-1] + abs(to - level[-1]) + hold_s]
        level += [to, to]
    stamps = np.arange(0.0, time[-1], 0.01)
    force, weight = np.zeros_like(stamps), np.ones_like(stamps)
    return Data(stamps, np.interp(stamps, time, level), force, weight, weight, np.zeros(stamps.size, dtype=np.intp))


@pytest.mark.parametrize(
    ("levels_mm", "rich"),
    [
        ([2.0], False),
        ([2.0, 0.0], False),
        ([2.0, 1.99, 2.0, 1.99, 2.0], False),
        ([2.0, 0.0, 2.0, 0.0, 2.0], True),
        ([0.5, 1.0, 1.5, 2.0], False),
        ([0.5, 1.0, 1.5, 2.0, 0.0], True),
    ],
)
def test_several_depths_held_or_passes_make_data_rich_that_come_back(levels_mm, rich):
    assert is_rich(data(levels_mm)) is rich


def of_motion(d: Diagnosis) -> list[float]:
    """How sure the names of causes are that act with the motion."""
    return [c.confidence for c in d.causes if all_effects()[c.id].of_motion]


def pressed_once(id: str, seed: int) -> Diagnosis:
    """One press to 2 mm and one hold that hide an effect."""
    motion = staircase([2.0], [1.0], [6.0], start_mm=-0.5, acceleration_mm_s2=3000.0, lead_s=1.0)
    c = case(id, seed, motion=motion)
    return diagnose(measurement(c), Model.from_dict(c.believed))


@pytest.mark.slow
@pytest.mark.parametrize("ids", [("friction",), pytest.param(("cogging", "inertia"), marks=pytest.mark.long)])
def test_one_press_names_nothing_surely_that_acts_with_the_motion(ids):
    told = [pressed_once(id, 1) for id in ids]
    sure = [confidence for d in told for confidence in of_motion(d)]
    assert sure and max(sure) <= 0.5
    assert all(d.seen_once == bool(of_motion(d)) for d in told)
    assert max(of_motion(diagnosed("friction")[1])) > TOLD_ONCE, "a staircase tells it"


@pytest.mark.slow
@pytest.mark.long
def test_one_press_tells_a_hum_all_the_same():
    d = pressed_once("mains_hum", 1)
    assert d.causes[0].id == "mains_hum" and d.causes[0].confidence > TOLD_ONCE and not d.seen_once
