"""What some data can tell of: the numbers of a form are kept within that."""

from __future__ import annotations

import pytest

from bench.diagnose.candidates import forms
from bench.diagnose.numbers import PadNumbers, Structure
from bench.diagnose.reach import Reach, narrowed
from bench.diagnose.ripple import ripples
from sim.effects import all_effects, effect
from sim.elastic import Polynomial
from sim.pad import Pad
from sim.relaxation import Relaxation


@pytest.mark.parametrize(("travel_mm", "sought"), [(3.0, True), (3e-3, False)])
def test_what_repeats_is_sought_where_the_way_holds_a_wave(travel_mm, sought):
    """A cell is pressed by micrometres: no thread and no scale has so short a pitch, and any curve is a part of one."""
    reach = Reach(1e-3, 10.0, travel_mm=travel_mm, depth_mm=0.8 * travel_mm, force_N=1e-6, changes_N=1e-5)
    pad = Pad(Polynomial((0.0, 1e-3 / travel_mm)), Relaxation(), unilateral=True)
    structure = Structure(PadNumbers(pad, 0.8 * travel_mm, 1e-6), ())
    found = [form for _, form in forms(structure, False, reach) if ripples(form)]
    assert bool(found) == sought
    for form in found:
        (period,) = (p for p in form.parameters if p.name == "period")
        assert period.upper <= 1.6 * travel_mm


@pytest.mark.parametrize("force_N", [0.5, 50.0])
def test_a_joint_opens_or_closes_within_the_forces_that_were_met(force_N):
    reach = Reach(sample_s=0.01, span_s=60.0, travel_mm=3.0, depth_mm=2.5, force_N=force_N, changes_N=60.0)
    for form in ("joint", "closing"):
        preload = next(
            p for p in narrowed(effect("frame_compliance").form(form), reach).parameters if p.name == "preload"
        )
        assert 0 < preload.lower < min(preload.starts) < max(preload.starts) < preload.upper <= force_N


@pytest.mark.parametrize("travel_mm", [0.3, 3.0])
def test_a_pull_reaches_no_further_than_the_way_on_which_it_is_seen(travel_mm):
    reach = Reach(
        sample_s=0.01, span_s=60.0, travel_mm=travel_mm, depth_mm=0.8 * travel_mm, force_N=5.0, changes_N=60.0
    )
    for form in effect("adhesion").forms:
        pull = next(p for p in narrowed(form, reach).parameters if p.name == "range")
        assert max(pull.starts) <= pull.upper <= travel_mm


def test_what_was_pressed_before_as_deep_as_the_run_goes_does_not_soften_in_it():
    """It is a law then, of which these data see no other branch."""
    reach = Reach(sample_s=0.01, span_s=60.0, travel_mm=2.0, depth_mm=1.5, force_N=5.0, changes_N=60.0)
    form = narrowed(effect("stress_softening").form("preconditioned"), reach)
    already = next(p for p in form.parameters if p.name == "already")
    assert already.upper < 1.5 and already.starts and max(already.starts) <= already.upper


def test_a_form_of_which_a_fit_can_change_nothing_is_no_candidate() -> None:
    reach = Reach(sample_s=0.01, span_s=60.0, travel_mm=3.0, depth_mm=2.5, force_N=5.0, changes_N=60.0)
    structure = Structure(PadNumbers(Pad(Polynomial((0.0, 1.0)), Relaxation(), unilateral=True), 2.5, 5.0), ())
    found = [form.name for _, form in forms(structure, False, reach, also_unsought=True)]
    assert "fine_spline" in found and "points" not in found


@pytest.mark.parametrize("force_N", [1e-6, 1e-3, 5.0, 7e5])
@pytest.mark.parametrize("way_mm", [1e-3, 2.0, 500.0])
def test_no_number_leaves_what_a_model_file_holds(force_N, way_mm):
    """Cells are pressed with a nanonewton, walls with a meganewton: what is found must be written."""
    reach = Reach(1e-3, 100.0, travel_mm=way_mm, depth_mm=0.8 * way_mm, force_N=force_N, changes_N=10 * force_N)
    for cause in all_effects().values():
        for form in cause.forms:
            for own, kept in zip(form.parameters, narrowed(form, reach).parameters, strict=True):
                assert own.lower <= kept.lower <= kept.if_left_out <= kept.upper <= own.upper, (cause.id, own.name)
