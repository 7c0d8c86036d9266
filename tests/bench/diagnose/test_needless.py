"""Which of the causes found is taken away again, as what was held out tells."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bench.diagnose import verdict
from bench.diagnose.path import Path
from bench.diagnose.refit import chi2
from bench.diagnose.verdict import no_size
from tests.bench.diagnose.small import fitted

module = importlib.import_module("bench.diagnose.needed")


def needless(
    monkeypatch: pytest.MonkeyPatch,
    squares: Sequence[float],
    left_out: Sequence[float],
    ids: Sequence[str] = ("friction", "backlash", "inertia"),
    later: Sequence[float] = (1.0, 1.0, 1.0, 1.0),
    course: bool = False,
    sure: float = 1.0,
) -> int | None:
    """Number of the needless cause: `squares`, with none, one … all causes; `left_out`, without each but the last.
    `later`: squares of what comes later, by the number of causes; `course`: they have one in time; `sure`: so are
    their names. The noise's own square is 1."""
    causes = tuple(SimpleNamespace(id=i, form=SimpleNamespace(has_a_course=course)) for i in ids)
    fits: list[Any] = [
        SimpleNamespace(structure=SimpleNamespace(causes=causes[:k]), number=k) for k in range(len(squares))
    ]
    monkeypatch.setattr(module, "without", lambda prepared, fit, index: index)
    monkeypatch.setattr(module, "held_out_square", lambda prepared, index: left_out[index])

    def later_square(prepared: Any, fit: Any) -> float:
        return later[fit] if isinstance(fit, int) else later[fit.number]

    monkeypatch.setattr(module, "later_square", later_square)
    monkeypatch.setattr(module, "_sure", lambda path, fits, number: sure)
    prepared: Any = SimpleNamespace(floor_N=1.0, floor_square_std=0.01)
    return module._needless(
        prepared, fits, list(squares), [max(s - 1.0, 0.0) for s in squares], 0.0, [0.0] * len(squares), Path([])
    )


def test_of_two_that_hide_each_other_neither_is_needless(monkeypatch):
    assert needless(monkeypatch, [4.0, 4.1, 1.0], [3.9]) is None
    assert needless(monkeypatch, [4.0, 3.99, 1.0], [3.9]) is None


def test_of_two_that_together_foretell_less_than_none_does_one_goes_though_each_helps_the_other(monkeypatch):
    assert needless(monkeypatch, [4.0, 4.3, 4.1], [4.5]) == 0


def test_one_that_the_others_have_made_needless_goes(monkeypatch):
    assert needless(monkeypatch, [4.0, 4.1, 1.0, 1.01], [3.9, 3.0]) == 2
    assert needless(monkeypatch, [4.0, 4.1, 1.0], [1.0]) == 0


def test_one_that_takes_a_crumb_goes_and_one_that_takes_most_of_what_is_left_stays(monkeypatch):
    assert needless(monkeypatch, [400.0, 3.0, 2.5], []) == 1
    assert needless(monkeypatch, [400.0, 3.0, 1.1], []) is None
    assert needless(monkeypatch, [40000.0, 3.0, 1.1], []) == 1  # no shape of the first is so exact


@pytest.mark.parametrize(("end", "sure", "gone"), [(1.1, 0.7, None), (3.5, 0.7, 1), (1.1, 0.5, 1)])
def test_one_that_takes_a_crumb_stays_where_it_takes_most_of_what_the_end_leaves(monkeypatch, end, sure, gone):
    """A frame beside a pad that softens where it is pressed deeper: there nothing else tells how much."""
    assert needless(monkeypatch, [400.0, 3.0, 2.5], [], later=[9.0, 5.0, end], sure=sure) == gone


def test_one_that_does_harm_later_goes_but_a_drift_may_turn(monkeypatch):
    assert needless(monkeypatch, [400.0, 3.0], [], later=[2.0, 2000.0]) == 0
    assert needless(monkeypatch, [400.0, 3.0], [], ["force_drift"], later=[2.0, 2000.0]) is None
    assert needless(monkeypatch, [4.0, 2.0], [], ["force_drift"], later=[2.0, 9.0]) == 0


def test_half_of_a_course_does_not_foretell_the_rest(monkeypatch):
    """Of a delay that is now more and now less, whose blocks amid the data are met."""
    for course, gone in ((True, None), (False, 0)):
        assert needless(monkeypatch, [60.0, 10.0], [], ["force_delay"], [15.0, 300.0], course) == gone
    assert needless(monkeypatch, [60.0, 40.0], [], ["force_delay"], [15.0, 300.0], True) == 0  # they are not


def test_what_it_takes_of_all_counts_against_its_harm_later(monkeypatch):
    assert needless(monkeypatch, [400.0, 3.0], [], later=[2.0, 9.0]) is None  # 397 against a third of 7
    assert needless(monkeypatch, [400.0, 70.0, 3.0], [70.0], later=[700.0, 2.0, 9.0]) is None
    assert needless(monkeypatch, [400.0, 70.0, 45.0], [70.0], later=[700.0, 2.0, 9.0]) == 1  # it leaves most


def test_an_end_that_the_belief_cannot_foretell_judges_no_cause(monkeypatch):
    """With more than twice the square it leaves elsewhere the early part does not tell the pad itself."""
    assert needless(monkeypatch, [4.0, 2.0], [], later=[7.0, 40.0]) == 0
    assert needless(monkeypatch, [4.0, 2.0], [], later=[9.0, 40.0]) is None


def test_a_doubtful_name_that_foretells_that_end_no_better_goes(monkeypatch):
    for later, sure, gone in ((9.5, 0.2, 0), (8.5, 0.2, None), (9.5, 0.4, None)):
        assert needless(monkeypatch, [4.0, 2.0], [], ["force_drift"], [9.0, later], sure=sure) == gone


@pytest.mark.parametrize(("after", "gone"), [((-2e-5, 0.05), 0), ((-4e-4, 0.05), None), ((-4e-4, 0.001), 1)])
def test_a_cause_of_which_nothing_is_left_with_the_hum_beside_it_goes(after, gone):
    """A bias of 0.4 mN that stood for the mean of what swings; a cause without a size stays whatever it becomes."""

    def fit(*values: float) -> Any:
        sizes = [SimpleNamespace(name="bias"), SimpleNamespace(name="coulomb"), None]
        causes = tuple(SimpleNamespace(amplitude=a) for a in sizes[: len(values)])
        told = [{"bias": v, "coulomb": v, "limit": v} for v in values]
        return SimpleNamespace(structure=SimpleNamespace(causes=causes, values=lambda x: told), x=None)

    assert module._faded([fit(), fit(-4e-4, 0.05, 8.0)], fit(*after, 0.0)) == gone


@pytest.mark.parametrize(
    ("harmful", "without", "kept"),
    [
        ({"force_delay/wandering"}, 2.0, ["force_delay/constant"]),
        ({"force_delay/wandering", "force_delay/constant"}, 2.0, ["force_delay/ageing"]),
        ({"force_delay/wandering", "force_delay/constant", "force_delay/ageing"}, 2.0, []),
        ({"force_delay/wandering"}, 0.9, []),
    ],
)
def test_where_the_shape_does_harm_the_cause_stays_in_one_that_does_none(monkeypatch, harmful, without, kept):
    """A cause is in the way in its best shape; it is only dropped where it is so too in the shape it was found in, and
    in the best that has no course in time; or where what was held out is met better `without` it (N²) than so."""

    def fit(*names: str) -> Any:
        pairs = [name.split("/") for name in names]
        causes = tuple(SimpleNamespace(id=id, form=SimpleNamespace(name=form)) for id, form in pairs)
        return SimpleNamespace(structure=SimpleNamespace(causes=causes))

    base, plain, final = fit(), fit("force_delay/constant"), fit("force_delay/wandering")
    steady = fit("force_delay/ageing")

    def names(fits: list[Any]) -> list[str]:
        return [f"{c.id}/{c.form.name}" for c in fits[-1].structure.causes]

    asked = []

    def asked_of(prepared: Any, fits: list[Any], *rest: Any) -> int | None:
        asked.append(names(fits))
        return 0 if harmful & set(names(fits)) else None

    monkeypatch.setattr(
        module, "chain", lambda prepared, fit, base, known: [base, fit] if fit.structure.causes else [base]
    )
    monkeypatch.setattr(module, "ordered", lambda prepared, fit, base: fit)
    monkeypatch.setattr(module, "excesses", lambda prepared, fits, floor: ([1.0] * len(fits), [1.0] * len(fits)))
    monkeypatch.setattr(module, "_slow_squares", lambda *_: [0.0])
    monkeypatch.setattr(module, "_flagged_square", lambda *_: 0.0)
    monkeypatch.setattr(module, "_needless", asked_of)
    monkeypatch.setattr(module, "_doubtful", lambda *_: None)
    monkeypatch.setattr(module, "_dropped", lambda prepared, path, fits, number, floor: ([base], [without], [1.0]))
    monkeypatch.setattr(module, "steadier", lambda short, found, own: steady if found is final else found)
    path: Any = SimpleNamespace(fits=[base, plain])
    prepared: Any = SimpleNamespace(short=None)
    fits, _, _ = module._needed(prepared, path, final, 1.0)
    assert names(fits) == kept
    in_turn = [["force_delay/wandering"], ["force_delay/constant"], ["force_delay/ageing"]]
    assert asked == in_turn[: 2 if "force_delay/constant" not in harmful else 3]  # no shape beyond one that does none


@pytest.mark.parametrize(
    ("course", "excess", "gone"),
    [
        (True, [1.0, 0.02, 0.001], 1),
        (False, [1.0, 0.02, 0.001], None),
        (True, [1.0, 0.2, 0.001], None),
        (True, [1.0, 0.14, 0.1], None),
    ],
    ids=["follows what another misses", "has no course", "takes much", "much is left"],
)
def test_what_has_any_course_in_time_must_take_a_part_beside_another(monkeypatch, course, excess, gone):
    """A drift that wanders follows what a bristle's shape misses, one time this way and one time that."""
    monkeypatch.setattr(module, "sureness", lambda path, id, named: (None, 0.9, 0.9))
    causes = [SimpleNamespace(id=i, form=SimpleNamespace(has_a_course=c)) for i, c in (("a", False), ("b", course))]
    fits: list[Any] = [SimpleNamespace(structure=SimpleNamespace(causes=causes[:k])) for k in range(3)]
    path: Any = None
    assert module._doubtful(path, fits, excess, 0.0, 1e-3, [0.0, 0.0]) == gone


@pytest.mark.parametrize(
    ("sizes", "excess", "gone"),
    [
        ([1.0, 0.2], [1.0, 0.1, 0.07], 1),
        ([1.0, 0.9], [1.0, 0.1, 0.07], None),
        ([1.0, 0.2], [1.0, 0.5, 0.07], None),
        ([1.0, 0.2], [1.0, 0.1, 0.0], None),
        ([0.1, 1.0], [1.0, 0.1, 0.07], None),
    ],
    ids=["little and untold", "told", "much", "nothing is left", "the first stays"],
)
def test_a_further_cause_without_a_size_goes_where_it_takes_little(monkeypatch, sizes, excess, gone):
    monkeypatch.setattr(module, "told_size", lambda whole, index: sizes[index])
    fits: list[Any] = [SimpleNamespace(structure=SimpleNamespace(causes=())) for _ in excess]
    assert module._untold(fits, fits[-1], excess) == gone


@pytest.mark.parametrize(
    ("nothing", "within", "excess", "gone"),
    [
        ([False, True], [True, True], [1.0, 0.001, 0.0], 1),
        ([False, False], [True, False], [1.0, 0.001, 0.0], 1),
        ([False, False], [True, True], [1.0, 0.001, 0.0], None),
        ([False, False], [True, False], [1.0, 0.3, 0.0], None),
        ([False, False], [False, True], [1.0, 0.001, 0.0], None),
        ([True, False], [True, True], [1.0, 0.0, 0.0], 0),
    ],
    ids=["does nothing", "at its bound", "a cause", "takes much", "the first stays", "the first does nothing"],
)
def test_a_cause_that_does_nothing_goes_and_a_further_one_that_is_anothers_limit(
    monkeypatch, nothing, within, excess, gone
):
    """A mode as fast as the sampling beside a lag; a skew of nothing beside a film that tears within a step."""
    causes = tuple(SimpleNamespace(number=k, of_the_law=False) for k in range(2))
    monkeypatch.setattr(module, "no_size", lambda data, whole, index: nothing[index])
    monkeypatch.setattr(module, "within_bounds", lambda cause, values: within[cause.number])
    whole: Any = SimpleNamespace(structure=SimpleNamespace(causes=causes, values=lambda x: [{}, {}]), x=None)
    fits: list[Any] = [SimpleNamespace(structure=SimpleNamespace(causes=causes[:k])) for k in range(3)]
    assert module._anothers(None, fits, whole, excess) == gone
    causes[1].of_the_law = True  # it is one at any of its numbers
    assert module._anothers(None, fits, whole, excess) == (gone if any(nothing) else None)


@pytest.mark.parametrize("gap_mm", [0.03, 1e-7])
def test_a_size_that_is_hardly_told_is_nothing_only_where_the_force_does_not_feel_it(gap_mm):
    """The mean width of a play that goes on growing along the way may be anything; without it the fit is far off."""
    _, prepared, fit = fitted("backlash", "worn", "running_out", 1.5, rate_hz=60.0)
    (values,) = fit.structure.values(fit.x)
    structure = fit.structure.with_cause_at(0, fit.structure.causes[0].with_start(**values | {"gap": gap_mm}))
    x = structure.x(fit.x[: len(structure.pad.coordinates)])
    unsure = replace(fit, structure=structure, x=x, spread=1e6 * np.eye(len(x)))
    assert no_size(prepared.full, unsure, 0) == (gap_mm < 1e-6)
    assert no_size(prepared.full, replace(unsure, spread=1e-12 * np.eye(len(x))), 0) is False


@pytest.mark.parametrize(("left", "takes"), [(0.97, False), (0.9, True)])
def test_a_search_that_began_anew_must_take_a_part_of_the_error(left, takes):
    ended = importlib.import_module("bench.diagnose.diagnose")._Ended
    none: Any = None
    needed: Any = SimpleNamespace(excess=[1.0, left])
    assert ended(none, none, none, none, needed).takes_a_part == takes


def test_with_one_cause_more_a_chain_is_no_worse() -> None:
    """What stood beside a cause can have led it into a valley where it does harm: two that were found went so."""
    _, p, fit = fitted("damage", "exponential", "exponential")
    base = verdict.without(p, fit, 0)
    lost = fit.x.copy()
    lost[fit.structure.of_cause(0).start] += 2.0 / fit.structure.coordinates[fit.structure.of_cause(0).start].unit
    there = replace(fit, x=lost, chi2=chi2(p.short, fit.structure, lost))
    assert there.chi2 > base.chi2
    assert verdict.chain(p, there, base)[1].chi2 < base.chi2
