"""Which steps the search takes from cause to cause, by fits that are made up: an id and a χ²."""

from __future__ import annotations

import importlib
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bench.diagnose import evidence, verdict
from bench.diagnose.evidence import EXACT
from bench.diagnose.noise import Colour
from bench.diagnose.numbers import cause_of
from bench.diagnose.path import Measure, Path
from bench.diagnose.result import Number
from bench.diagnose.shaping import Shaping
from sim.effects import effect
from tests.bench.diagnose.told import NOISE, Told, fit, named

module = importlib.import_module("bench.diagnose.search")
pytestmark = pytest.mark.usefixtures("all_are_believed")
RANKS = {(): {"adhesion": 20e3, "cogging": 90e3}, ("adhesion",): {"force_drift": 12e3}}


def test_where_a_second_cause_takes_little_but_much_is_left_two_others_may_stand_in_the_place_of_the_first():
    """8,000 of 3 million is too little to pay, but with drift beside it cogging does what neither adhesion can."""
    search = Told(RANKS, fit(1100, "force_drift", "cogging"))
    assert named(search) == ["force_drift", "cogging"] and search.exchanges > 0


def test_two_that_do_no_better_together_are_not_taken():
    assert named(Told(RANKS, fit(11e3, "force_drift", "cogging"))) == ["adhesion"]


def test_a_third_cause_must_take_its_share_of_all():
    """Beside one giant a small cause may stand that leaves nothing; beside two it may be what their shapes miss."""
    first, second = ("force_drift",), ("force_drift", "backlash")
    ranks = {(): {"force_drift": 5000.0}, first: {"backlash": 1050.0}}
    assert named(Told(ranks, fit(1050.0, *second))) == list(second)
    ranks = {(): {"force_drift": 2e6}, first: {"backlash": 4000.0}, second: {"adhesion": 1000.0}}
    assert named(Told(ranks, fit(4000.0, *second))) == list(second)


def test_beside_a_giant_a_trace_may_be_what_its_shape_misses():
    ranks = {(): {"force_drift": 1300.0}, ("force_drift",): {"backlash": 1000.0}}
    of_the_giant = 300.0 / (3e6 - NOISE)
    assert of_the_giant < EXACT
    assert named(Told(ranks, fit(1000.0, "force_drift", "backlash"))) == ["force_drift"]


def test_where_next_to_nothing_is_left_no_two_are_tried():
    search = Told(
        {(): {"adhesion": 1010.0}, ("adhesion",): {"force_drift": 1005.0}}, fit(900.0, "force_drift", "cogging")
    )
    assert named(search) == ["adhesion"] and search.exchanges == 0


def test_what_is_too_small_to_be_named_stands_beside_what_is(monkeypatch):
    monkeypatch.setattr(module, "believable", lambda fit, prepared: fit.structure.causes[-1].id != "encoder_error")
    monkeypatch.setattr(module, "too_small", lambda fit, prepared: fit.structure.causes[-1].id == "encoder_error")
    search = Told({(): {"cogging": 1010.0, "encoder_error": 1011.0, "friction": 9e3}}, None)
    path = search.path(fit(180e3))
    assert [c.id for c in path.fits[-1].structure.causes] == ["cogging"]
    assert [t.id for t in path.rivals[0]] == ["cogging", "friction", "encoder_error"]


@pytest.mark.parametrize(
    ("ranks", "shapes", "first"),
    [
        ({"damage": 20e3, "friction": 25e3}, {25e3: 1010.0}, "friction"),
        ({"damage": 20e3, "friction": 25e3}, {25e3: 1010.0, 20e3: 1000.0}, "damage"),  # either gains by it
        ({"damage": 20e3, "friction": 2e6}, {2e6: 1010.0}, "damage"),  # it is far off
        ({"damage": 1010.0, "friction": 25e3}, {25e3: 900.0}, "damage"),  # there is nothing to tell them apart by
    ],
)
def test_shapes_are_asked_before_names_are(ranks, shapes, first):
    search = Told({(): ranks}, fit(11e3, "adhesion", "cogging"), shapes)
    assert named(search)[0] == first


@pytest.mark.parametrize(("both", "after"), [(1010.0, ["friction", "force_bias"]), (90e3, ["friction"])])
def test_a_further_cause_is_one_where_it_leaves_nothing_and_another_shape_of_the_first_does(both, after):
    """Another shape of the friction takes most of what a bias takes, 180,000 to 110,000 of 95,000."""
    ranks = {(): {"friction": 180e3}, ("friction",): {"force_bias": 95e3}}
    search = Told(ranks, fit(both, "friction", "force_bias"), {180e3: 110e3, 95e3: both})
    assert named(search) == after


def test_another_shape_of_the_first_is_taken_before_it_is_said_that_no_second_pays():
    """A mode takes 10,000 of 19,000 beyond the noise, a three-hundredth of all; beside the cogging's best shape, 15,000
    of 15,000."""
    ranks: Any = {
        (): {"cogging": 20e3},
        ("cogging",): {"missing_relaxation_mode": 10e3},
        ("cogging", 16e3): {"missing_relaxation_mode": 1000.0},
    }
    assert named(Told(ranks, None, {20e3: 16e3})) == ["cogging", "missing_relaxation_mode"]
    assert named(Told(ranks, None, {20e3: 19e3})) == ["cogging"]  # of what is left a twentieth is no shape


def test_where_the_last_cause_has_another_shape_those_before_it_are_held_against_others_again():
    """A ripple came in where a bias and a resonance were, and leaves no more than they do once that has its shape."""
    ranks: Any = {
        (): {"cogging": 20e3},
        ("cogging",): {"resonance": 3000.0},
        ("cogging", "resonance", 2900.0): {"friction": 1900.0},
    }
    search = Told(ranks, fit(2900.0, "cogging", "resonance"), {2900.0: 1010.0})
    assert named(search) == ["cogging", "resonance"]
    assert search.exchanges == 2, "as it came in, and in its shape"


@pytest.mark.parametrize(
    ("id_", "form", "other", "taken"),
    [
        ("stress_softening", "ogden_roxburgh", 5600.0, True),
        ("stress_softening", "ogden_roxburgh", 8300.0, False),  # permanent set leaves less
        ("resonance", "low_pass", 5600.0, False),
        ("cogging", "sine", 5600.0, False),
        ("cogging", "sine", 3000.0, True),
    ],
)
def test_a_shape_at_its_bound_is_stood_for_by_another_but_for_that_of_a_wave_or_a_lag(
    monkeypatch, id_, form, other, taken
):
    """The shape that leads leaves 5,500, of which noise is 1,000; its reach is at the end of what the data tell."""
    shape, rival = effect(id_).form(form), fit(8200.0, "permanent_set")
    lead, within = fit(5500.0, id_), fit(other, id_)

    def trial(fit: Any) -> Any:
        return SimpleNamespace(id=id_, cause=SimpleNamespace(form=shape), fit=fit, score=fit.chi2)

    search = Told({}, None)
    monkeypatch.setattr(module, "believable", lambda fit, prepared: fit is not lead)
    monkeypatch.setattr(module, "families", lambda *told: [[None, SimpleNamespace(fit=within)]])
    monkeypatch.setattr(search, "_trial", trial)
    monkeypatch.setattr(search, "_a_longer_wave", lambda ranked: None)
    set_ = SimpleNamespace(id="permanent_set", fit=rival, score=8200.0)
    best = search._inside(Path([fit(29e3)]), [trial(lead), set_])[0]
    assert (best.fit is within) == taken


def test_what_was_asked_for_its_other_forms_is_not_asked_again_of_the_same_data(monkeypatch):
    search, asked = Told({}, None), []
    monkeypatch.setattr(search, "_in_another_form", lambda now: asked.append(now) or fit(1.0))

    def other(now: Any) -> Any:
        return Shaping.recurved(search, now)

    now = fit(9e3, "friction")
    assert other(now) is other(now) and len(asked) == 1
    other(fit(9e3, "friction"))
    other(fit(9e3, "friction/swelling"))
    assert len(asked) == 3
    search.prepared = SimpleNamespace(**vars(search.prepared))
    other(now)
    assert len(asked) == 4, "those data are others: their noise is white since"


class Counting(Told):
    """A search that counts its turns."""

    turns = 0

    def _turn(self, path: Any) -> Any:
        self.turns += 1
        return super()._turn(path)


def test_where_nothing_is_left_a_search_ends():
    """With less than the noise should leave no shape is another."""
    search = Counting({(): {"cogging": 900.0}, ("cogging",): {"force_bias": 899.0}}, None)
    assert named(search) == ["cogging"] and search.turns == 2


class Working(Told):
    """A search that has done its work with the candidates of one turn."""

    done = 0

    @property
    def work(self) -> int:
        return self.done

    def ranked(self, now: Any, only: Any = None, least: float = 0.0) -> list[Any]:
        self.done += module.MOST_WORK
        return super().ranked(now, only, least)


@pytest.mark.parametrize(
    ("left", "after", "cut_short"),
    [
        (2500.0, ["cogging", "force_bias"], False),  # of 177,000 little, and more than twice what noise leaves
        (1900.0, ["cogging"], True),
        (1200.0, ["cogging"], False),  # what is left may be chance
    ],
)
def test_a_search_whose_work_is_done_goes_on_where_a_cause_must_be_missing_and_else_says_so(left, after, cut_short):
    search = Working({(): {"cogging": left}, ("cogging",): {"force_bias": 1010.0}}, None)
    path = search.path(fit(180e3))
    assert [c.id for c in path.fits[-1].structure.causes] == after
    assert path.cut_short is cut_short


class Reshaping(Told):
    """A search in which friction, but for what stood behind it, is tried with the resonance in another shape too."""

    def _shaped(self, trial: Any) -> Any:
        ids = [c.id for c in trial.fit.structure.causes]
        if ids != ["resonance", "friction"]:
            return trial
        return SimpleNamespace(id=trial.id, fit=fit(1100.0, "resonance/partial", "friction"), score=1100.0)

    def settled(self, now: Any, joined: Any) -> Any:
        partial = joined.structure.causes[0].form.name == "partial" and now.chi2 > 170e3
        return fit(170e3, "resonance/partial") if partial else now


def test_where_a_shape_has_changed_all_are_asked_again_beside_it():
    """What stood fourth beside the wrong shape may be first beside the right one."""
    beside = {"friction": 160e3, "cogging": 170e3, "backlash": 180e3, "contact_offset": 190e3}
    ranks: Any = {(): {"resonance": 350e3}, ("resonance",): beside}
    ranks["resonance", 170e3] = {"contact_offset": 1000.0, "friction": 1100.0}
    assert named(Reshaping(ranks, None)) == ["resonance", "contact_offset"]


def squares(monkeypatch: pytest.MonkeyPatch, values: list[float]) -> list[float]:
    """Excesses over a noise of 1 N², whose own doubt is large, of fits with these held-out squares."""
    fits: list[Any] = [SimpleNamespace(free=3, square=v) for v in values]
    monkeypatch.setattr(verdict, "held_out_square", lambda prepared, fit: fit.square)
    monkeypatch.setattr(verdict, "_square_std", lambda prepared, fit: 0.03)
    prepared: Any = SimpleNamespace(
        floor_square_std=0.03,
        colour=SimpleNamespace(memory=1.0),
        full=SimpleNamespace(weight=SimpleNamespace(sum=lambda: 10_000.0)),
    )
    return verdict.excesses(prepared, fits, 1.0)[1]


def test_what_a_later_fit_surely_takes_is_there_however_doubtful_the_floor_is(monkeypatch):
    assert squares(monkeypatch, [2.0, 1.03, 1.00]) == pytest.approx([1.0, 0.03, 0.0])
    # a five-hundredth of the noise is none, and within the floor's doubt it stays nothing
    assert squares(monkeypatch, [2.0, 1.03, 1.0285]) == pytest.approx([1.0, 0.0, 0.0])


@pytest.mark.parametrize(("quick", "there"), [(True, 0.2), (False, 0.0)])
def test_noise_of_a_long_memory_hides_what_is_slow_and_not_what_is_quick(monkeypatch, quick, there):
    """The doubt about the floor is as large as what a cause takes: whether it does so by chance, its course tells."""
    n, steps = np.arange(10_000), [2.0, 1.2, 1.0]
    course = np.sin(n * (1.0 if quick else 1e-3))
    monkeypatch.setattr(verdict, "held_out_square", lambda prepared, fit: fit.square)
    monkeypatch.setattr(verdict, "_square_std", lambda prepared, fit: 0.3)
    monkeypatch.setattr(verdict, "force_at", lambda full, structure, x: x * course)
    colour = Colour(((0.25, 0.9), (0.25, 0.999)))
    full = SimpleNamespace(weight=np.ones(n.size))
    prepared: Any = SimpleNamespace(floor_square_std=0.3, colour=colour, full=full)
    fits: list[Any] = [SimpleNamespace(free=3, square=s, structure=None, x=k) for k, s in enumerate(steps)]
    assert verdict.excesses(prepared, fits, 1.0)[1] == pytest.approx([1.0, there, 0.0])


def test_a_misfit_is_not_taken_for_noise_however_it_scatters(monkeypatch):
    """What is wrong in few samples alone scatters far more than noise does: the floor is no less known for that."""
    left = np.ones(10_000)
    left[::500] = 30.0
    monkeypatch.setattr(verdict, "held_out_square", lambda prepared, fit: float(np.mean(left**2)))
    monkeypatch.setattr(verdict, "force_at", lambda full, structure, x: -left)
    full = SimpleNamespace(weight=np.ones(left.size), force_N=np.zeros(left.size))
    prepared: Any = SimpleNamespace(floor_square_std=0.02, colour=SimpleNamespace(memory=30.0), full=full)
    fits: list[Any] = [SimpleNamespace(free=3, structure=None, x=None)]
    assert verdict.excesses(prepared, fits, 1.0)[1] == pytest.approx([np.mean(left**2) - 1.0])


def test_where_no_test_sees_structure_a_little_over_the_noise_is_noise():
    assert verdict.seen([0.5, 0.07], 1.0) == pytest.approx([0.43, 0.0])
    assert verdict.seen([0.5, 0.2, 0.07], 1.0) == pytest.approx([0.43, 0.13, 0.0])
    assert verdict.seen([2.0, 0.4], 1.0) == [2.0, 0.4]  # the holds tell the noise better than that


@pytest.mark.parametrize(
    ("excess", "sure", "goes"),
    [
        ([4.0, 0.1, 0.0], 0.4, 1),  # a trace under an unsure name
        ([4.0, 0.1, 0.0], 0.9, None),  # the name is sure
        ([4.0, 0.3, 0.0], 0.4, None),  # more than a trace
        ([4.0, 0.5, 0.4], 0.4, None),  # much is left beside it
        ([400.0, 3.0, 0.0], 0.4, None),  # more than the noise
        ([400.0, 0.3, 0.0], 0.4, None),  # far more than a crumb of it
        ([400.0, 0.2, 0.0], 0.4, 1),
        ([9500.0, 28.0, 10.0], 0.2, 1),  # what the shape of a giant misses
        ([9500.0, 28.0, 10.0], 0.4, None),  # the name may be right
        ([9500.0, 28.0, 5.0], 0.2, None),  # it leaves little of that
        ([4000.0, 28.0, 10.0], 0.2, None),  # it is no giant's
        ([4.0, 0.6, 0.0], 0.15, 1),  # most likely it is another
        ([4.0, 1.0, 0.0], 0.15, None),  # but something it must be
    ],
)
def test_a_further_cause_that_takes_next_to_nothing_under_an_unsure_name_goes(monkeypatch, excess, sure, goes):
    needed = importlib.import_module("bench.diagnose.needed")
    monkeypatch.setattr(needed, "sureness", lambda path, name, named: ([], sure, sure))
    fits: list[Any] = [fit(0.0, *("backlash", "friction")[:k]) for k in range(3)]
    assert needed._doubtful(None, fits, excess, 0.0, 1.0, [0.0] * len(excess)) == goes


@pytest.mark.parametrize(
    ("taken", "apart", "sure", "goes"),
    [
        (0.05, 4e4, 0.15, 0),  # beside a ceiling that cut off as much: what its edge misses
        (0.05, 0.0, 0.15, None),  # it is all that there is
        (0.05, 4e4, 0.4, None),  # the name may be right
        (0.5, 4e4, 0.15, None),  # it shows beside the noise
    ],
)
def test_beside_faults_of_the_channel_the_first_cause_is_a_further_one(monkeypatch, taken, apart, sure, goes):
    needed = importlib.import_module("bench.diagnose.needed")
    monkeypatch.setattr(needed, "sureness", lambda path, name, named: ([], sure, sure))
    fits: list[Any] = [fit(0.0, *("backlash",)[:k]) for k in range(2)]
    assert needed._doubtful(None, fits, [taken, 0.0], apart, 1.0, [0.0, 0.0]) == goes


def test_a_cause_that_came_in_place_of_another_is_held_against_what_stood_beside_it_there():
    """Not against those of an earlier turn, where it was far behind."""
    told = [{"separation": 2000.0, "sensor_lag": 99000.0}, {"force_delay": 1100.0, "sensor_lag": 1101.0}]
    turns: Any = [[SimpleNamespace(id=i, fit=fit(chi2)) for i, chi2 in turn.items()] for turn in told]
    measures = [Measure(before, NOISE, NOISE, 1.0) for before in (100000.0, 2000.0)]
    stage = Path([fit(1101.0)], rivals=turns, measures=measures).stage_of("sensor_lag")
    assert stage is not None
    assert [t.id for t in stage[1]] == ["force_delay"]


def test_a_delay_beside_a_zero_that_strays_is_asked_what_it_takes_of_what_is_not_the_zeros():
    """Nine in eleven parts of what the bias leaves are its own course (half of 30² beside 10²)."""
    time_s = np.linspace(0.0, 40.0, 4000)
    slow, fast = 30.0 * np.sin(0.4 * time_s), 10.0 * np.sign(np.sin(9.0 * time_s))
    data: Any = SimpleNamespace(time_s=time_s, whitened=lambda e: e)
    base, biased, also = fit(0.0), fit(0.0, "force_bias"), fit(0.0, "force_bias", "force_delay")
    for left, least, most in ((slow + fast, 0.75, 0.85), (slow, 0.99, 1.0), (fast, 0.0, 0.02)):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(evidence, "errors", lambda *_, left=left: left)
            also.x = also.structure
            assert least <= evidence.of_slow_force(data, biased, also, base) <= most
            assert evidence.of_slow_force(data, base, biased, base) == 0.0
            assert evidence.of_slow_force(data, fit(0.0, "friction"), also, base) == 0.0


@pytest.mark.parametrize(("std", "most"), [(0.02, 1.0), (0.5, 0.25), (5.0, 0.125), (float("nan"), 0.125)])
def test_a_name_is_not_surer_than_its_size(std, most):
    """A mass of 1 kg to within 20 g, 500 g, 5 kg, or not told at all."""
    inertia = effect("inertia")
    cause = cause_of(inertia, inertia.forms[0])
    assert verdict._of_its_size(cause, {"mass": Number(1.0, "kg", std)}) == pytest.approx(most)


@pytest.mark.parametrize(
    ("lead", "two", "after"),
    [
        (300e3, 1050.0, ["permanent_set", "backlash"]),  # of 3 million a tenth is left by what looks like both
        (300e3, 40e3, ["stress_softening"]),  # those two leave something themselves
        (50e3, 1050.0, ["stress_softening"]),  # its shape may miss as much
    ],
)
def test_where_the_first_leaves_much_two_others_that_leave_nothing_stand_in_its_place(lead, two, after):
    ranks: Any = {
        (): {"stress_softening": lead, "permanent_set": 700e3},
        ("permanent_set",): {"backlash": two},
    }
    assert named(Told(ranks, None)) == after


@pytest.mark.parametrize(
    ("end", "two", "other"),
    [
        (1300.0, 1010.0, True),
        (1300.0, 1152.0, False),  # more than half of what is left beyond the noise
        (2500.0, 1200.0, False),  # those two leave something themselves
        (1040.0, 960.0, False),  # that noise is by itself
    ],
)
def test_where_what_came_in_behind_the_first_leaves_something_two_others_may_leave_nothing(end, two, other):
    ranks: Any = {
        (): {"friction": 50e3, "permanent_set": 700e3},
        ("friction",): {"stress_softening": end},
        ("permanent_set",): {"force_drift": two},
    }
    assert named(Told(ranks, None)) == (["permanent_set", "force_drift"] if other else ["friction", "stress_softening"])


def test_a_second_that_takes_next_to_nothing_makes_no_other_first():
    ranks: Any = {
        (): {"stress_softening": 300e3, "permanent_set": 310e3},
        ("permanent_set",): {"missing_relaxation_mode": 290e3},
        ("permanent_set", "missing_relaxation_mode"): {"backlash": 1050.0},
    }
    assert named(Told(ranks, None)) == ["stress_softening"]


def test_paths_from_others_begin_with_those_that_take_a_good_part_of_what_the_first_took():
    ranks: dict[tuple[str | float, ...], dict[str, float]] = {
        (): {"friction": 20e3, "damage": 50e3, "backlash": 70e3, "adhesion": 150e3},
        ("damage",): {"viscous_damping": 30e3},
    }
    search = Told(ranks, fit(30e3, "damage", "viscous_damping"))
    path = search.path(fit(180e3))
    assert [c.id for c in path.fits[-1].structure.causes] == ["friction"]
    begun = [[c.id for c in other.fits[-1].structure.causes] for other in search.from_others(path)]
    assert begun == [["damage", "viscous_damping"], ["backlash"]]
