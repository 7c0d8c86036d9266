"""When one cause stands in the place of another, by fits that are made up: an id and a χ²."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from bench.diagnose.numbers import cause_of
from bench.diagnose.path import Measure, Path
from bench.diagnose.search import Search
from sim.effects import effect
from tests.bench.diagnose.told import NOISE, Told, fit, named

pytestmark = pytest.mark.usefixtures("all_are_believed")


class OfAKind(Told):
    """A search in which no one shape of a cause does what two of its kind do, which do it without a further cause."""

    def _united(self, now: Any, beside: Any) -> Any:
        return now

    def _stays_beside(self, now: Any, reshaped: Any, further: Any) -> bool:
        return False


@pytest.mark.parametrize(
    ("second", "after"),
    [
        (1050.0, ["resonance", "force_delay"]),  # a second resonance is worse than a delay, of as many numbers
        (1025.0, ["resonance"]),  # it is as good
    ],
)
def test_two_of_a_kind_do_not_stand_for_a_shape_where_one_other_cause_does_better(second, after):
    ranks: Any = {(): {"resonance": 7000.0}, ("resonance",): {"force_delay": 1010.0, "resonance": second}}
    assert named(OfAKind(ranks, None)) == after


@pytest.mark.parametrize(
    ("numbers", "second", "further", "simpler"),
    [
        ((3, 1), 1020.0, 1010.0, True),
        ((3, 1), 1005.0, 1010.0, False),  # it leaves more
        ((1, 3), 1050.0, 1010.0, False),  # it has more numbers
        ((3, 1), 4020.0, 4010.0, False),  # much is left
    ],
)
def test_a_cause_of_few_numbers_is_no_worse_than_a_second_of_a_kind(numbers, second, further, simpler):
    now, two, other = fit(20e3, "set"), fit(second, "set", "set"), fit(further, "set", "offset")
    two.free, other.free = numbers
    assert OfAKind({}, None)._simpler(now, two, other) is simpler


class Exchanging(Told):
    """A search whose exchange is the real one; without one of its causes a fit leaves 50,000."""

    exchanged = Search.exchanged
    believed: Any = SimpleNamespace(causes=())
    limit = False

    def ranked(self, now: Any, only: Any = None, least: float = 0.0) -> list[Any]:
        return [t for t in super().ranked(now) if t.id in only]

    def _without(self, now: Any, index: int) -> Any:
        return fit(50e3, *(c.id for k, c in enumerate(now.structure.causes) if k != index))

    def _penalty(self, now: Any) -> float:
        return 0.0

    def _a_limit(self, now: Any, index: int) -> bool:
        return self.limit


def came(first: str, left: float, **chi2: float) -> Path:
    """A path from 200,000 to a cause that came first and to play, which leaves so much beside it. `chi2`: what stood
    beside each other as the first came in, best first."""
    fits = [fit(200e3), fit(chi2[first], first), fit(left, first, "backlash")]
    turns = [fit(x, i) for i, x in chi2.items()], [fits[-1]]
    stood = [
        [SimpleNamespace(id=f.structure.causes[-1].id, cause=f.structure.causes[-1], fit=f) for f in t] for t in turns
    ]
    measures = [Measure(f.chi2, NOISE, NOISE, 1.0) for f in fits[:-1]]
    return Path(fits, stood, [list(chi2), ["backlash"]], measures)


@pytest.mark.parametrize(
    ("bias", "numbers", "after"),
    [
        (70e3, 1, "force_bias"),
        (150e3, 1, "adhesion"),  # 50,000 of 144,000 are not close
        (70e3, 3, "adhesion"),  # it has more numbers
    ],
)
def test_one_that_stood_close_behind_is_tried_in_the_place_of_the_first_wherever_it_stood(bias, numbers, after):
    """Seventh of seven, with 130,000 of the 144,000 that adhesion takes."""
    others = ["cogging", "permanent_set", "elastic_law", "contact_offset", "friction"]
    search = Exchanging({("backlash",): {"force_bias": 1010.0}}, None)
    path = came("adhesion", 8500.0, adhesion=56e3, **dict.fromkeys(others, 60e3), force_bias=bias)
    path.rivals[0][-1].fit.free = numbers
    assert {c.id for c in search.exchanged(path).structure.causes} == {after, "backlash"}


@pytest.mark.parametrize(
    ("shapes", "after"),
    [
        ({8500.0: 2800.0}, ["force_bias", "backlash"]),
        ({}, ["backlash", "cogging"]),
        ({8500.0: 2800.0, 5000.0: 1000.0}, ["backlash", "cogging"]),
    ],
)
def test_no_cause_goes_for_another_before_those_beside_it_have_had_their_best_shapes(shapes, after):
    """Play of the wrong shape leaves what a cogging of many numbers takes in place of the bias."""
    search = Exchanging({("backlash",): {"cogging": 5000.0}}, None, shapes)
    path = came("force_bias", 8500.0, force_bias=56e3, cogging=190e3)
    assert [c.id for c in search.exchanged(path).structure.causes] == after


@pytest.mark.parametrize(
    ("limit", "beside", "after"),
    [(True, 1105.0, "cogging"), (True, 1140.0, "force_bias"), (False, 1105.0, "force_bias")],
)
def test_a_cause_at_its_bound_gives_way_to_one_that_no_data_exclude(limit, beside, after):
    """Within 25 of it: its limit is what the other cause is."""
    search = Exchanging({("backlash",): {"cogging": beside}}, None)
    search.limit = limit
    path = came("force_bias", 1100.0, force_bias=56e3, cogging=190e3)
    assert after in {c.id for c in search.exchanged(path).structure.causes}


class Reshaping(Exchanging):
    """A search in which play turns out to be worn, beside which a cause that stood far behind leaves nothing."""

    worn = 1800.0

    def _without(self, now: Any, index: int) -> Any:
        left = (c for k, c in enumerate(now.structure.causes) if k != index)
        return fit(50e3, *(f"{c.id}/{c.form.name}" for c in left))

    def recurved(self, now: Any) -> Any:
        return fit(self.worn, "damage", "backlash/worn")

    def ranked(self, now: Any, only: Any = None, least: float = 0.0) -> list[Any]:
        worn = any(c.form.name == "worn" for c in now.structure.causes)
        found = {"contact_offset": 1010.0, "cogging": 2900.0} if worn else {"cogging": 5000.0, "contact_offset": 30e3}
        return [SimpleNamespace(id=i, fit=fit(x, "backlash", i), score=x) for i, x in found.items() if i in only]


@pytest.mark.parametrize(
    ("worn", "after"),
    [
        (1800.0, "contact_offset"),
        (1060.0, "damage"),  # it leaves no more than noise may
        (2800.0, "damage"),  # it leaves much: no shape that is known is right
    ],
)
def test_what_stood_far_behind_is_tried_once_those_beside_it_have_their_shapes(monkeypatch, worn, after):
    """Seventh where damage came in, behind six that are tried at once or are worse beside any shape."""
    monkeypatch.setattr(Reshaping, "worn", worn)
    others = ["cogging", "permanent_set", "elastic_law", "frame_compliance", "friction"]
    path = came("damage", 8500.0, damage=56e3, **dict.fromkeys(others, 150e3), contact_offset=160e3)
    assert {c.id for c in Reshaping({}, None).exchanged(path).structure.causes} == {after, "backlash"}


class Comparing(Exchanging):
    """A search whose comparison at the end is the real one."""

    _compare = Search._compare

    def _trial(self, now: Any) -> Any:
        return SimpleNamespace(id=now.structure.causes[-1].id, fit=now, score=now.chi2)


@pytest.mark.parametrize(("ahead", "asked"), [(56e3, True), (100e3, False)])
def test_one_that_stood_behind_another_is_compared_anew_beside_what_came_later(monkeypatch, ahead, asked):
    """Of adhesion, in whose place a bias has come, the play beside it tells far more than stood there."""
    monkeypatch.setattr("bench.diagnose.exchange.last", lambda f, id_: fit(f.chi2, id_))
    search = Comparing({("backlash",): {"adhesion": 9e3}}, None)
    path = came("force_bias", 1010.0, adhesion=ahead, force_bias=70e3)
    search._compare(path)
    assert ("force_bias" in path.compared) is asked


@pytest.mark.parametrize(("noise", "asked"), [(4000.0, True), (1000.0, False)])
def test_what_stood_ahead_is_told_by_what_noise_left_there(monkeypatch, noise, asked):
    """χ² of before the noise's colour was taken in: noise alone left four times as much."""
    monkeypatch.setattr("bench.diagnose.exchange.last", lambda f, id_: fit(f.chi2, id_))
    search = Comparing({("backlash",): {"adhesion": 9e3}}, None)
    path = came("force_bias", 1010.0, adhesion=6.9e3, force_bias=7e3)
    path.measures = [replace(m, expected=noise) for m in path.measures]
    search._compare(path)
    assert ("force_bias" in path.compared) is asked


class Drawing(Comparing):
    """A search in which a law is drawn through points, or is a formula, and an encoder's error is a wave."""

    def __init__(self, chi2: float, law: str) -> None:
        super().__init__({("backlash",): {"encoder_error": chi2}}, None)
        self.law = law

    def _trial(self, now: Any) -> Any:
        which = effect(now.structure.causes[-1].id)
        form = which.form(self.law) if which.id == "elastic_law" else which.forms[0]
        return SimpleNamespace(id=which.id, cause=cause_of(which, form), fit=now, score=now.chi2)

    def ranked(self, now: Any, only: Any = None, least: float = 0.0) -> list[Any]:
        return [self._trial(t.fit) for t in super().ranked(now, only)]

    def _shaped(self, trial: Any) -> Any:
        return trial


@pytest.mark.parametrize(
    ("chi2", "law", "after"),
    [
        (1450.0, "fine_spline", "encoder_error"),  # all but a hundredth of what the law takes
        (1550.0, "fine_spline", "elastic_law"),
        (1450.0, "exponential", "elastic_law"),  # few numbers tell a law
    ],
)
def test_a_law_through_points_is_a_wave_once_what_else_there_is_stands_beside_it(monkeypatch, chi2, law, after):
    """Without either the play alone leaves 50,000."""
    monkeypatch.setattr("bench.diagnose.exchange.last", lambda f, id_: fit(f.chi2, "backlash", id_))
    path = came("elastic_law", 1000.0, elastic_law=60e3)
    search = Drawing(chi2, law)
    search._wave_for_a_law(path)
    assert after in {c.id for c in path.fits[-1].structure.causes}
    assert ("encoder_error" in path.compared) is (after == "encoder_error")
