"""Where the search begins for what repeats with the position."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from bench.diagnose import diagnose, ripple
from bench.diagnose.numbers import cause_of
from bench.diagnose.path import Trial
from bench.diagnose.reach import Reach, narrowed
from bench.diagnose.refit import Fit
from bench.diagnose.sieve import plainer_first
from sim.effects import effect
from sim.model import Model
from tests.bench.diagnose.small import measurement
from tests.campaign.plan import Item
from tests.truth.cases import draw_case

DEPTH_mm = np.concatenate([np.linspace(0.0, 3.0, 400), np.linspace(3.0, 0.0, 200)])
REACH = Reach(sample_s=0.005, span_s=60.0, travel_mm=3.0, depth_mm=3.0, force_N=5.0, changes_N=60.0)


def _wave(period_mm: float, phase_rad: float) -> np.ndarray:
    return np.sin(2 * np.pi * DEPTH_mm / period_mm + phase_rad)


@pytest.mark.parametrize("id_", ["cogging", "encoder_error"])
@pytest.mark.parametrize("seed", range(6))
def test_a_ripple_begins_near_its_period_with_its_phases_and_harmonic(id_, seed):
    """A sixth of a wave off over the whole travel at the most: at its ends the fundamental is then 30° off."""
    rng = np.random.default_rng(seed)
    amplitude, period = 0.5 * (1 + rng.random()), float(rng.uniform(0.5, 1.7))
    phase, second = rng.uniform(-np.pi, np.pi, 2)
    ratio = float(rng.uniform(0.2, 0.8))
    felt = amplitude * (_wave(period, phase) + ratio * _wave(period / 2, second))
    shape = narrowed(effect(id_).form("harmonics"), REACH)
    found = list(ripple.starts(shape, _wave, ripple.Waves(felt), 2))
    values, promise = found[0]
    assert 0.8 * float(felt @ felt) < promise <= float(felt @ felt) * (1 + 1e-9)
    assert abs(3.0 / values["period"] - 3.0 / period) < 0.2
    near = values["amplitude"] * (
        _wave(values["period"], values["phase"]) + values["ratio"] * _wave(values["period"] / 2, values["second_phase"])
    )
    assert np.mean((near - felt) ** 2) < 0.2 * np.mean(felt**2)


@pytest.mark.parametrize("greater", ["longer", "shorter"])
@pytest.mark.parametrize("id_", ["cogging", "encoder_error"])
@pytest.mark.parametrize("seed", range(6))
def test_two_ripples_begin_near_their_periods_the_greater_first(id_, seed, greater):
    rng = np.random.default_rng(seed)
    amplitude, period, order = 0.5 * (1 + rng.random()), float(rng.uniform(0.9, 1.9)), float(rng.uniform(1.4, 3.0))
    if greater == "shorter":
        period, order = 0.7 * period, 1.0 / min(order, 1.8)  # of which the longer is no longer than what is sought
    phase, second = rng.uniform(-np.pi, np.pi, 2)
    ratio = float(rng.uniform(0.3, 0.8))
    felt = amplitude * (_wave(period, phase) + ratio * _wave(period / order, second))
    values, promise = next(
        ripple.starts(narrowed(effect(id_).form("two_periods"), REACH), _wave, ripple.Waves(felt), 2)
    )
    assert 0.8 * float(felt @ felt) < promise <= float(felt @ felt) * (1 + 1e-9)
    assert abs(3.0 / values["period"] - 3.0 / period) < 0.25
    assert abs(3.0 * values["order"] / values["period"] - 3.0 * order / period) < 0.25
    assert values["ratio"] < 0.95


@pytest.mark.parametrize(
    ("order", "period_mm", "one"),
    [(1.1, 2.0, True), (0.9, 2.0, True), (1.1, 0.2, False), (1.4, 2.0, False), (1.4, 5.0, True)],
)
def test_two_waves_of_less_than_a_beat_are_one_that_swells(order: float, period_mm: float, one: bool) -> None:
    values = {"period": period_mm, "order": order}
    assert ripple.merged(effect("cogging").form("two_periods"), values, 3.0) is one
    assert not ripple.merged(effect("cogging").form("swelling"), {"period": period_mm}, 3.0)


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.parametrize("seed", [0, 1, 2, 3, 4, 5])
def test_a_ripple_that_goes_with_the_load_has_a_size_and_is_not_two_waves_that_cancel(seed: int) -> None:
    """Of ten times its size each, and told to within their own size: the sum is all that the data have."""
    c = draw_case(seed, ("cogging",), 1.0, "thrust")
    said = diagnose(measurement(c), Model.from_dict(c.believed))
    assert said.verdict == "explained" and [cause.id for cause in said.causes] == ["cogging"]
    size, true_N = said.causes[0].parameters["amplitude"], c.truth.parameters["cogging"]["amplitude"]
    assert size.std < 0.4 * size.value
    assert abs(size.value - true_N) < 0.35 * true_N


@pytest.mark.slow
@pytest.mark.long
def test_a_wave_somewhat_longer_than_any_sought_is_one_where_all_else_leaves_far_more():
    """A case in which a campaign named a bias and adhesion, and left seven tenths: the load shifts the wave's phase, so
    that it looks as long as 1.62 times the travel, and 1.6 was the most."""
    sizes, shapes = (0.8848, 0.674), ("armature_reaction", "hertz_joint")
    c = Item("pair", ("cogging", "frame_compliance"), shapes, sizes, 167907098).case()
    said = diagnose(measurement(c), Model.from_dict(c.believed))
    assert said.verdict == "explained" and [cause.id for cause in said.causes] == ["cogging", "frame_compliance"]
    compliance = said.causes[1].parameters["compliance"].value
    assert compliance == pytest.approx(c.truth.parameters["frame_compliance"]["compliance"], rel=0.1)
    assert said.held_out_after < 1.1 * said.noise_floor


def test_starts_are_apart_and_within_bounds():
    rng = np.random.default_rng(7)
    shape = narrowed(effect("encoder_error").form("sine"), REACH)
    bounds = next(p for p in shape.parameters if p.name == "period")
    found = list(ripple.starts(shape, _wave, ripple.Waves(rng.standard_normal(DEPTH_mm.size)), 3))
    periods = [values["period"] for values, _ in found]
    assert len(set(periods)) == 3 and all(bounds.lower < p < bounds.upper for p in periods)
    assert [promise for _, promise in found] == sorted((promise for _, promise in found), reverse=True)


def test_an_error_of_the_position_repeats_within_the_depth():
    """In air no force shows it, however far the axis travels there."""
    far = Reach(sample_s=0.005, span_s=60.0, travel_mm=9.0, depth_mm=3.0, force_N=5.0, changes_N=60.0)
    longest = next(p for p in narrowed(effect("encoder_error").forms[0], far).parameters if p.name == "period").upper
    assert longest < 3.0


def trial(id_: str, form: str, chi2: float, free: int = 20) -> Trial:
    cause = cause_of(effect(id_), effect(id_).form(form))
    return Trial(cause, cast(Fit, SimpleNamespace(chi2=chi2, free=free)), chi2)


@pytest.mark.parametrize(("wave", "first"), [(1080.0, "encoder_error"), (1100.0, "elastic_law")])
def test_a_law_through_points_gives_way_to_a_wave_that_is_as_good(wave, first):
    """Of 10 000 the one takes 9000; the other less by one or by more than one in a hundred."""
    before = cast(Fit, SimpleNamespace(chi2=10_000.0, free=6))
    ranked = [trial("elastic_law", "fine_spline", 1000.0), trial("friction", "coulomb", 1050.0)]
    ranked.append(trial("encoder_error", "sine", wave))
    again = plainer_first(before, ranked)
    assert again[0].id == first and sorted(t.id for t in again) == sorted(t.id for t in ranked)
    formula = [trial("elastic_law", "polynomial_3", 1000.0), *ranked[1:]]
    assert plainer_first(before, formula) == formula, "a formula has few numbers: it draws no waves"


@pytest.mark.parametrize(
    ("chi2", "free", "first"),
    [(1040.0, 7, "contact_offset"), (1050.0, 7, "elastic_law"), (1040.0, 8, "elastic_law")],
)
def test_a_law_of_many_numbers_gives_way_to_a_cause_of_few_that_is_as_good(chi2, free, first):
    """Of 10 000 the one takes 9000 with three numbers more than there were; the other less by one in 225 or 180."""
    before = cast(Fit, SimpleNamespace(chi2=10_000.0, free=6))
    ranked = [trial("elastic_law", "polynomial_5", 1000.0, 9), trial("contact_offset", "constant", chi2, free)]
    assert plainer_first(before, ranked)[0].id == first


def test_a_ripple_begun_elsewhere_is_the_same_one_moved():
    x = np.linspace(0.0, 4.0, 200)

    def wave(values):
        k = 2 * np.pi / values["period"]
        return np.sin(k * x + values["phase"]) + values["ratio"] * np.sin(2 * k * x + values["second_phase"])

    known = cause_of(effect("cogging"), effect("cogging").form("harmonics"),
                     {"amplitude": 1.0, "period": 0.7, "phase": 0.4, "ratio": 0.5, "second_phase": 1.1})  # fmt: skip
    moved_mm = 0.23
    k = 2 * np.pi / 0.7
    far = wave({**known.start, "phase": 0.4 + k * moved_mm, "second_phase": 1.1 + 2 * k * moved_mm})
    nearest = min(float(np.abs(wave(cause.start) - far).max()) for cause in ripple.turned(known))
    assert nearest < 0.5 * 2 * np.pi / ripple.TURNS * 2.0 < float(np.abs(wave(known.start) - far).max())


def test_of_two_waves_the_larger_is_told_as_the_first():
    """The same force at every place; and nothing is done where it is already, or the other would be out of bounds."""
    form = effect("cogging").form("two_periods")
    values = {"amplitude": 0.02, "period": 0.7, "phase": 0.4, "ratio": 2.5, "order": 0.51, "second_phase": -1.0}
    told = ripple.larger_first(form, values)
    assert told is not None and told["amplitude"] == pytest.approx(0.05) and told["period"] == pytest.approx(0.7 / 0.51)

    def force(p):
        angle = 2 * np.pi * np.linspace(-3.0, 3.0, 50) / p["period"]
        second = p["ratio"] * np.sin(p["order"] * angle + p["second_phase"])
        return p["amplitude"] * (np.sin(angle + p["phase"]) + second)

    np.testing.assert_allclose(force(told), force(values), atol=1e-12)
    assert ripple.larger_first(form, told) is None
    assert ripple.larger_first(form, values | {"order": 0.25 / 1.01}) is None
