"""The halves keep to themselves; the later shapes and the judge's change a recording, are seen, stay finite."""

import numpy as np
import pytest

from .cases import draw_case, null_case
from .detect import misfit
from .effects import EFFECTS
from .motion import Path
from .sets import SETS, outside, shapes_of, written_in
from .test_truth_cases import CATALOGUE
from .test_truth_effects import SHORT, hidden
from .test_truth_outside import PLAIN

# Those whose physics takes many shapes.
RICH = (
    *("friction", "backlash", "frame_compliance", "elastic_law", "stress_softening", "damage", "permanent_set"),
    *("adhesion", "viscous_damping", "depth_dependent_relaxation", "missing_relaxation_mode", "encoder_error"),
    *("cogging", "inertia", "resonance", "force_drift", "force_delay", "sensor_lag", "clock_skew", "outliers"),
    "stuck_samples",
)
LATER = ("third", "fourth", "fifth", "sixth", "seventh", "eighth", "ninth", "judge")
# The common tests are of those that have not stood for long: each set has tests of its own besides.
NEW = LATER[-2:]
SHAPES = written_in(CATALOGUE, *NEW)
BEYOND = written_in(tuple(outside(CATALOGUE, *NEW)), *NEW)
CONTACTS = ("bonded", "unilateral")
# Of those that have stood for long one kind of contact each, in turn: there are many.
TOUCHED = [(*pair, CONTACTS[k % 2]) for k, pair in enumerate(BEYOND) if pair[1] not in EFFECTS[pair[0]].judge]
TOUCHED += [(*pair, contact) for pair in BEYOND if pair[1] in EFFECTS[pair[0]].judge for contact in CONTACTS]


def of_every_day(cases):
    """Every other one of the judge's of every day, the rest of the long tests."""
    chosen = [c for c in cases if c[1] in EFFECTS[c[0]].judge][::2]
    return [c if c in chosen else pytest.param(*c, marks=pytest.mark.long) for c in cases]


def test_the_judge_keeps_to_itself():
    least = {"third": 8, "fourth": 10, "fifth": 10, "sixth": 10, "seventh": 10, "eighth": 10, "ninth": 10, "judge": 10}
    assert all(len(outside(CATALOGUE, name)) >= count for name, count in least.items())
    assert all(EFFECTS[id].judge for id in CATALOGUE) and all(len(EFFECTS[id].judge) >= 2 for id in RICH)
    for id, known in EFFECTS.items():
        assert set(known.judge) == set(shapes_of(id, "judge")) and set(shapes_of(id, *SETS)) == set(known.of("both"))
        assert not set(known.shapes) & set(known.judge) and set(known.of("both")) == {*known.shapes, *known.judge}
        # What a seed draws by itself is of the first half, but for effects that are the judge's as a whole.
        assert set(known.drawn) <= set(known.shapes or known.judge)


def test_a_seed_draws_none_of_the_later_shapes():
    plain = {"motion": SHORT, "rate_hz": 200.0}
    drawn = {draw_case(seed, ("friction",), **plain).truth.shapes["friction"] for seed in range(12)}
    later = shapes_of("friction", "second", "third", "fourth", "fifth", "sixth", "seventh", "eighth", "ninth", "judge")
    assert later and drawn <= set(shapes_of("friction", "first"))
    for shape in later:
        assert draw_case(0, ("friction",), 1.0, shape, **plain).truth.shapes == {"friction": shape}


@pytest.mark.parametrize(("id", "shape"), of_every_day(SHAPES))
def test_each_shape_changes_the_recording_at_any_size(id, shape):
    plain = {"motion": SHORT, "rate_hz": 800.0, "noise_kind": "white", "jitter": "none"}
    plain |= {} if id == "clock_skew" else {"own_clock": False}
    without = null_case(17, **plain)
    changes = []
    for size in (0.05, 1.0, 2.5):
        case = draw_case(17, (id,), size, shape, **plain)
        assert case.truth.shapes == {id: shape} and np.all(np.isfinite(case.force_N))
        assert np.all(np.isfinite(case.position_mm)) and np.all(np.diff(case.time_s) > 0)
        assert case.force_time_s is None or np.all(np.diff(case.force_time_s) > 0)
        assert np.max(np.abs(case.truth.clean_N)) < 80
        assert all(np.isfinite(v) for v in case.truth.parameters[id].values() if not isinstance(v, str))
        here, there = (truth.clean_N + truth.fault_N for truth in (case.truth, without.truth))
        same = len(here) == len(there) and case.truth.drawn == without.truth.drawn
        change = np.std(here - there) + np.std(case.position_mm - without.position_mm) if same else np.nan
        clock = id == "clock_skew" and case.force_time_s is not None
        changes.append(np.std(case.force_time_s - case.truth.force_true_time_s) if clock else change)
    again = draw_case(17, (id,), 2.5, shape, **plain)
    assert np.array_equal(again.force_N, case.force_N) and np.array_equal(again.position_mm, case.position_mm)
    if id != "elastic_law" and not np.isnan(changes).any():
        # A sample is lost but rarely where the skew is small.
        assert 0 < changes[0] < changes[1] < changes[2] or (shape == "slipped_samples" and 0 == changes[0] < changes[1])


# --- outside the catalogue --------------------------------------------------------------------------------------------


@pytest.mark.long
@pytest.mark.parametrize(("id", "shape"), of_every_day(BEYOND))
def test_what_is_outside_is_seen_at_its_typical_size(id, shape):
    told = {"law": "power", "contact": "unilateral", "noise_N": 0.01, **PLAIN}
    case, again = (draw_case(31, (id,), 1.0, shape, **told) for _ in range(2))
    assert np.array_equal(case.force_N, again.force_N) and np.array_equal(case.position_mm, again.position_mm)
    found, most = misfit(case), np.max(np.abs(case.truth.clean_N))
    # Seen, and no more than a disturbance.
    assert found.detectable and 0.001 * most < found.rmse_N < 0.06 * most
    other = draw_case(32, (id,), 1.0, shape, drawn=case.truth.drawn, noise_N=0.01, **PLAIN)
    assert not np.allclose(other.truth.clean_N, case.truth.clean_N, atol=1e-4)


@pytest.mark.parametrize(("id", "shape", "contact"), of_every_day(TOUCHED))
def test_what_is_outside_stays_finite_and_grows_with_its_size(id, shape, contact):
    cases = [draw_case(33, (id,), size, shape, contact=contact, **PLAIN) for size in (0.0, 0.05, 2.5)]
    for case in cases:
        assert np.all(np.isfinite(case.force_N)) and np.all(np.isfinite(case.position_mm))
        assert np.max(np.abs(case.truth.clean_N)) < 80
        assert np.all(np.isfinite(list(case.truth.parameters[id].values())))
    none, small, large = (case.truth.clean_N for case in cases)
    assert 0 < np.std(small - none) < 0.2 * np.std(large - none)


@pytest.mark.parametrize(("id", "shape"), of_every_day(BEYOND))
def test_what_is_of_the_pad_is_not_felt_in_air(id, shape):
    motion = Path(-1.5).hold(0.2).to(-0.5, 20.0).hold(0.5).to(-1.5, 20.0).hold(0.2).motion()
    fine, _, _ = hidden(id, shape, motion=motion)
    assert np.all(fine.force_N == 0)
