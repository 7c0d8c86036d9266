"""Where the search for a cause begins."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.diagnose import diagnose, sieve
from bench.diagnose.late import LATE, as_late, lateness_s
from bench.diagnose.numbers import PadNumbers, Structure, cause_of
from bench.diagnose.reach import Reach, narrowed
from bench.diagnose.refit import Fit, refit
from bench.diagnose.search import Search
from bench.diagnose.starts import Signatures, _scanned, alike, starts
from sim.effects import effect
from sim.effects.base import Active
from sim.elastic import Polynomial
from sim.model import Model
from sim.pad import Cascade, Pad
from sim.relaxation import Relaxation
from tests.bench.diagnose.small import begun, case, measurement
from tests.campaign.plan import Item
from tests.truth.cases import draw_case


@pytest.mark.parametrize("rate_Hz", [5.0, 8.0, 15.0, 30.0, 200.0, 2000.0])
@pytest.mark.parametrize(
    "form", [f.name for f in effect("resonance").forms if not any(p.amplitude for p in f.parameters)]
)
def test_ringing_is_sought_at_all_frequencies_that_the_data_can_show(form, rate_Hz):
    """Down to data so slow that no usual start lies within what they show."""
    reach = Reach(sample_s=1 / rate_Hz, span_s=60.0, travel_mm=3.0, depth_mm=2.5, force_N=5.0, changes_N=60.0)
    shape = narrowed(effect("resonance").form(form), reach)
    starts = list(_scanned(shape, {}))
    found = np.unique([values["frequency"] for values in starts])
    assert 0 < found[0] <= max(4.0, 0.1 * rate_Hz) and found[-1] == pytest.approx(0.9 * rate_Hz)
    assert len({values["damping_ratio"] for values in starts}) > 1
    assert all(len(values) == len(starts[0]) for values in starts)
    near = 0.2 * rate_Hz  # where the family's other form was found
    beside = {values["frequency"] for values in _scanned(shape, {"frequency": near})}
    assert len(beside) < len(found) and min(beside) < 0.6 * near and max(beside) > 1.7 * near
    assert min(abs(np.log(f / near)) for f in beside) < 0.01


def test_a_clock_that_is_off_by_more_than_a_ramp_takes_is_sought_there():
    """A case in which a campaign never looked at the clock: ramps of some milliseconds come too late by as much and
    more, and what a small skew does to the force tells nothing of that."""
    c = Item("pair", ("clock_skew", "permanent_set"), ("random_walk", "core_crushes"), (1.41, 0.537), 527769910).case()
    search, base = begun(c)
    signatures, clock = Signatures(search.short, base), effect("clock_skew")
    form, true_ppm = narrowed(clock.forms[0], search.reach), c.truth.parameters["clock_skew"]["skew"]
    first = starts(signatures, clock, form)[0]
    assert 0.3 < first.cause.start["skew"] / true_ppm < 3.0
    assert first.promise > 0.1 * (base.chi2 - search.expected)
    assert starts(signatures, clock, form, rich=False)[0].promise < 0.1 * first.promise, "where depths are met once"


def test_a_bend_is_sought_at_few_depths_where_they_are_met_once(monkeypatch):
    """In between any depth can be made to fit there: a measured relaxation got a drift by it as large as its force."""
    search, base = begun(case("backlash"))
    signatures, play = Signatures(search.short, base), effect("backlash")
    form = narrowed(play.form("lifted"), search.reach)
    bend = next(p for p in form.parameters if p.bend)
    tried: list[float] = []
    monkeypatch.setattr(signatures, "of", lambda cause: tried.append(cause.start[bend.name]) or (1.0, 1.0))
    starts(signatures, play, form, rich=False)
    few = set(tried)
    tried.clear()
    starts(signatures, play, form)
    assert few == set(bend.starts) and few < set(tried) and len(set(tried)) > 3 * len(few)


@pytest.mark.long
def test_a_play_in_which_the_probe_hangs_is_found_whichever_depths_are_held():
    """Each depth held is before or behind the one at which the load lifts the probe, so that no slope leads from one
    place to the next: of these ten three were found while few places were tried."""
    found = []
    for seed in range(10):
        c = draw_case(seed, ("backlash",), 1.2, "hangs", protocol="staircase", rate_hz=300.0)
        search, base = begun(c)
        if base.chi2 > 1.2 * search.expected:
            trial = search.ranked(base, only=["backlash"])[0]
            found.append(trial.cause.form.name == "lifted" and trial.fit.chi2 < 1.4 * search.expected)
    assert len(found) > 7 and np.mean(found) > 0.85


@pytest.mark.slow
def test_a_start_is_worth_what_it_promises_though_the_pad_has_gone_far():
    """A case that a campaign called unexplained: with the pad where it had gone to without the play, the first steps
    led away from the depth at which the load lifts the probe, which was the right one."""
    c = Item("pair", ("backlash", "damage"), ("hangs", "hyperbolic"), (1.19, 1.65), 2007262211).case()
    search, base = begun(c)
    trial = search.ranked(base, only=["backlash"])[0]
    assert trial.cause.form.name == "lifted"
    assert trial.fit.chi2 - search.expected < 0.2 * (base.chi2 - search.expected), "the rest is damage"


@pytest.mark.slow
@pytest.mark.long
def test_a_play_in_which_the_probe_hangs_is_found_beside_damage():
    c = Item("pair", ("backlash", "damage"), ("hangs", "hyperbolic"), (1.19, 1.65), 2007262211).case()
    said = diagnose(measurement(c), Model.from_dict(c.believed))
    assert said.verdict == "explained"
    assert [cause.id for cause in said.causes] == ["backlash", "damage"]
    for cause, name in zip(said.causes, ("gap", "rate"), strict=True):
        assert cause.parameters[name].value == pytest.approx(c.truth.parameters[cause.id][name], rel=0.1)


def gone_far() -> tuple[Search, Fit]:
    """A search among data of damage and of relaxation that depends on the depth; and a fit of the latter of which two
    modes of the pad are none that was believed, as a campaign's search had one."""
    ids, shapes = ("damage", "depth_dependent_relaxation"), ("all_the_way", "under_pressure")
    search, base = begun(Item("pair", ids, shapes, (1.084, 1.918), 2051734287).case())
    found = effect("depth_dependent_relaxation")
    cause = cause_of(found, found.form("exponential"), {"slope": -0.2})
    structure = base.structure.with_cause(cause)
    far = replace(base.pad, relaxation=Relaxation((0.55, 0.0003, 0.264), (8000.0, 50.0, 3.1)))
    x = structure.x(replace(structure.pad, pad=far).x(), [cause.start], base.of_run)
    return search, refit(search.short, structure, x, 60, 1e-8)


def test_damage_is_found_although_modes_of_the_pad_have_gone_far_in_its_place():
    """From there damage leaves a fifteenth of what there is; with the pad as it was believed, next to nothing."""
    search, fit = gone_far()
    second = search.ranked(fit, only=["damage"])[0].fit
    assert second.chi2 - search.expected < 0.02 * (fit.chi2 - search.expected)


def test_first_steps_that_lead_to_more_than_there_was_are_taken_anew():
    search, fit = gone_far()
    signatures, softening = Signatures(search.short, fit), effect("stress_softening")
    start = starts(signatures, softening, narrowed(softening.form("rejoining"), search.reach))[0]
    led = search._joined(fit, start.cause, sieve.FEW, signatures.jacobian)
    kept = search._kept(fit, start, signatures.jacobian)
    assert kept is not None and led is not None
    assert kept.fit.chi2 < fit.chi2 < led.fit.chi2


@pytest.mark.parametrize("rich", [True, False])
def test_no_start_goes_the_long_way_where_depths_are_met_once(rich, monkeypatch):
    """There it leads to any shape: measured relaxations got causes by it that foretold no other run."""
    search, fit = gone_far()
    search.reach = replace(search.reach, rich=rich)
    signatures, softening = Signatures(search.short, fit), effect("stress_softening")
    start = starts(signatures, softening, narrowed(softening.form("rejoining"), search.reach))[0]
    start = replace(start, promise=fit.chi2)
    gone: set[str] = set()
    followed, falling = search._followed, search._falling
    monkeypatch.setattr(search, "_followed", lambda *a: gone.add("followed") or followed(*a))
    monkeypatch.setattr(search, "_falling", lambda *a: gone.add("falling") or falling(*a))
    kept = search._kept(fit, start, signatures.jacobian)
    search._from_believed(fit, [kept], *search._as_believed(fit))
    assert gone == ({"followed", "falling"} if rich else set())


@pytest.mark.parametrize("id_", LATE)
def test_delay_lag_and_resonance_are_as_late_as_they_say(id_):
    """Behind a long ramp of 1 N/s the force comes late by so many newtons as seconds."""
    time = np.arange(0.0, 12.0, 1e-3)
    for late_s in (0.001, 0.004):
        for values in as_late(id_, late_s):
            assert lateness_s(id_, values) == pytest.approx(late_s, rel=1e-9)
            spring = Pad(Polynomial((0.0, 1.0)), Relaxation(), unilateral=False)
            late = Cascade(spring, [Active(effect(id_), effect(id_).forms[0], values)])
            assert time[-1] - late.simulate(time, time)[-1] == pytest.approx(late_s, rel=0.02)


def test_a_finer_curve_starts_on_the_coarser_one_that_was_found():
    """Numbers of one name mean something else in each: the rises to seven points, and to fifteen."""
    law = effect("elastic_law")
    pad = Pad(Polynomial((0.0, 2.0, 0.3)), Relaxation((0.2,), (1.0,)), unilateral=True)
    rises = {f"rise_{i}": 0.4 + 0.15 * i for i in range(1, 8)}
    coarse = cause_of(law, law.form("spline"), {"reach": 2.5, **rises})
    structure = Structure(PadNumbers(pad, 2.5, 5.0), (coarse,))
    x = structure.x(structure.pad.x(), [coarse.start])
    fit = Fit(structure, x, 0.0, np.eye(len(x)), True)
    fine = alike(fit, 0, cause_of(law, law.form("fine_spline"), {"reach": 2.5}))
    depth = np.linspace(0.1, 2.5, 50)
    found, anew = (c.form.amend(pad, c.start).law.force(depth) for c in (coarse, fine))
    np.testing.assert_allclose(anew, found, atol=0.01 * found.max())


def test_another_shape_has_the_numbers_that_it_shares_with_the_one_found():
    cogging = effect("cogging")
    sine = cause_of(cogging, cogging.form("sine"), {"amplitude": 0.2, "period": 1.3, "phase": 0.4})
    pad = Pad(Polynomial((0.0, 2.0)), Relaxation((0.2,), (1.0,)), unilateral=True)
    structure = Structure(PadNumbers(pad, 2.5, 5.0), (sine,))
    x = structure.x(structure.pad.x(), [sine.start])
    fit = Fit(structure, x, 0.0, np.eye(len(x)), True)
    slotted = alike(fit, 0, cause_of(cogging, cogging.form("slotted")))
    assert slotted.start == pytest.approx({"amplitude": 0.2, "period": 1.3, "phase": 0.4, "steepness": 2.0})
