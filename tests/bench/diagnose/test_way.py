"""One press and one hold show what acts with the motion once: no name of that kind is sure then."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.diagnose import Diagnosis, diagnose
from bench.diagnose.data import Data
from bench.diagnose.way import TOLD_ONCE, is_rich, on_the_way, shown_on_the_way
from sim.effects import all_effects
from sim.model import Model
from tests.bench.diagnose.small import case, diagnosed, measurement
from tests.truth.cases import draw_case
from tests.truth.motion import Path, staircase


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
        ([0.7, 1.4, 2.0, 0.0], False),
        ([0.7, 1.4, 2.0, 1.4, 0.7, 0.0], True),
        ([0.7, 1.4, 2.0, 2.01, 1.99, 0.7, 0.0], False),
        ([-3.0, 0.5, 2.0, 1.8, 1.0, 0.0], True),
    ],
)
def test_several_depths_held_or_passes_make_data_rich_that_come_back(levels_mm, rich):
    assert is_rich(data(levels_mm)) is rich


def test_the_way_above_the_surface_is_one_of_a_bonded_pad():
    pulled = data([0.5, 2.0, 0.0, -1.0, -2.0])
    assert not is_rich(pulled)
    assert is_rich(pulled, bonded=True)


@pytest.mark.parametrize(("hold_s", "share"), [(0.0, 1.0), (1.0, 0.5), (9.0, 0.1)])
def test_the_share_of_the_forces_that_are_felt_on_the_way(hold_s, share):
    assert on_the_way(data([1.0, 2.0, 1.0, 0.0], hold_s)) == pytest.approx(share, abs=0.01)


def test_how_much_of_the_travel_some_forces_show_on_the_way():
    """Moves of 1 mm/s and 100 samples a second show all of 2 mm finely, however long the holds are; ten times fewer
    samples show a few places."""
    slow = data([1.0, 2.0, 0.0], 9.0)
    assert shown_on_the_way(slow) == 1.0
    every = slice(None, None, 10)
    few = replace(slow, time_s=slow.time_s[every], position_mm=slow.position_mm[every], weight=slow.weight[every])
    assert shown_on_the_way(few) < 0.5


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, *(pytest.param(s, marks=pytest.mark.long) for s in range(2, 7))])
def test_a_short_ripple_is_found_though_most_forces_are_felt_at_rest(seed):
    """One depth, at speeds from fast to slow, with long rests: the slow moves tell the ripple and its harmonics."""
    rng, path = np.random.default_rng(seed), Path(-0.3, 3000.0).hold(1.0)
    for speed in (20.0, 6.0, 2.0, 0.7):
        path = path.to(1.2, speed).hold(5.0).to(-0.1, speed).hold(3.0)
    force_N, period_mm = 0.03, float(rng.uniform(0.11, 0.17))
    c = draw_case(seed, (), motion=path.hold(1.0).motion(), rate_hz=150.0, noise_kind="white", noise_N=0.003)
    m = measurement(c)
    turn = 2 * np.pi * np.interp(m.force_time_s, c.time_s, c.truth.reported_mm) / period_mm
    wave_N = force_N * (np.sin(turn + seed) + 0.35 * np.sin(2 * turn) + 0.2 * np.sin(3 * turn + 1.0))
    d = diagnose(replace(m, force_N=m.force_N + wave_N), Model.from_dict(c.believed))
    found = d.causes[0].parameters
    assert d.verdict == "explained" and [cause.id for cause in d.causes] == ["cogging"]
    assert found["period"].value == pytest.approx(period_mm, rel=0.01)
    assert found["amplitude"].value == pytest.approx(force_N, rel=0.05)


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.parametrize("seed", [1, 2, 3, 4, 5, 6])
def test_a_short_ripple_is_found_where_the_pad_is_pressed_to_and_fro(seed):
    """Held at some depths, any ripple that is short enough has what is there; on the way between them one alone has."""
    rng, path = np.random.default_rng(seed), Path(-0.5, 3000.0).hold(1.0)
    for _ in range(8):
        path = path.to(3.0, 1.0).to(float(rng.uniform(-0.5, 0.3)), 1.5)
    force_N, period_mm = 0.06, float(rng.uniform(0.25, 0.45))
    c = draw_case(seed, (), motion=path.hold(1.0).motion(), rate_hz=150.0, noise_kind="white", noise_N=0.01)
    m = measurement(c)
    wave_N = force_N * np.sin(2 * np.pi * np.interp(m.force_time_s, c.time_s, c.truth.reported_mm) / period_mm + seed)
    d = diagnose(replace(m, force_N=m.force_N + wave_N), Model.from_dict(c.believed))
    found = d.causes[0].parameters
    assert d.verdict == "explained" and [cause.id for cause in d.causes] == ["cogging"]
    assert found["period"].value == pytest.approx(period_mm, rel=0.01)
    assert found["amplitude"].value == pytest.approx(force_N, rel=0.05)


def of_motion(d: Diagnosis) -> list[float]:
    """How sure the names of causes are that act with the motion."""
    return [c.confidence for c in d.causes if all_effects()[c.id].goes_with_motion(c.form)]


def pressed_once(id: str, seed: int) -> Diagnosis:
    """One press to 2 mm and one hold that hide an effect. At this rate no harmonic of the mains falls on 0 Hz."""
    motion = staircase([2.0], [1.0], [6.0], start_mm=-0.5, acceleration_mm_s2=3000.0, lead_s=1.0)
    c = case(id, seed, motion=motion, rate_hz=140.0)
    return diagnose(measurement(c), Model.from_dict(c.believed))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("id", "seeds"), [("friction", [1]), pytest.param("cogging", [1, 2, 3, 4, 5, 6], marks=pytest.mark.long)]
)
def test_one_press_names_nothing_surely_that_acts_with_the_motion(id, seeds):
    told = [pressed_once(id, seed) for seed in seeds]
    sure = [confidence for d in told for confidence in of_motion(d)]
    assert sure and max(sure) <= 0.5
    assert all(d.seen_once == bool(of_motion(d)) for d in told)
    assert all(d.verdict == "unexplained" for d in told), "an odd pad can be so"
    assert max(of_motion(diagnosed("friction")[1])) > TOLD_ONCE, "a staircase tells it"


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_one_press_tells_a_hum_all_the_same(seed):
    d = pressed_once("mains_hum", seed)
    assert d.causes[0].id == "mains_hum" and d.causes[0].confidence > TOLD_ONCE and not d.seen_once
