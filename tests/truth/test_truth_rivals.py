"""Rivals against arithmetic: what the right name leaves is nothing, and what the wrong one leaves can be foretold."""

import numpy as np
import pytest

from .cases import draw_case
from .detect import ENOUGH, Lab, _sigma, misfit
from .motion import Path
from .rivals import AS_GOOD, STAGES, as_good, as_good_in_place, left_beside, left_in_place

MOTION = Path(-0.2).hold(0.3).to(1.5, 20.0).hold(0.6).to(0.8, 8.0).hold(0.6).to(-0.2, 20.0).hold(0.3).motion()
PLAIN = {
    "motion": MOTION,
    "noise_kind": "white",
    "noise_N": 0.01,
    "jitter": "none",
    "own_clock": False,
    "law": "power",
    "contact": "unilateral",
}


@pytest.mark.parametrize(
    ("id", "shape", "size"),
    [("force_delay", "pure", 1.0), ("sensor_lag", "first_order", 1.0), ("sensor_lag", "moving_average", 1.0),
     ("resonance", "second_order", 1.0), ("clock_skew", "stamped", 20.0)],  # in so short a run
)  # fmt: skip
def test_the_right_name_leaves_nothing(id, shape, size):
    case = draw_case(3, (id,), size, shape, rate_hz=1000.0, **PLAIN)
    assert misfit(case).detectable and left_beside(case, id) < AS_GOOD


def test_where_samples_lie_close_a_mode_that_rings_is_no_delay_and_a_mean_no_mode():
    ringing = draw_case(4, ("resonance",), 2.0, "second_order", rate_hz=1000.0, **PLAIN)
    averaged = draw_case(4, ("sensor_lag",), 2.0, "moving_average", rate_hz=1000.0, **PLAIN)
    assert not as_good(ringing, "force_delay") and not as_good(averaged, "resonance")


def test_where_only_the_mean_lateness_is_seen_a_lag_passes_for_a_delay():
    # Loud, and late by less than a sample: the delay as a whole is seen, what it does at the corners is not.
    plain = PLAIN | {"noise_N": 0.03}
    delayed = draw_case(5, ("force_delay",), 0.8, "pure", rate_hz=150.0, **plain)
    assert misfit(delayed).chi2 > ENOUGH and as_good(delayed, "sensor_lag")


def test_chance_in_a_delay_is_what_a_constant_one_leaves():
    case = draw_case(5, ("force_delay",), 2.0, "uneven", rate_hz=400.0, **PLAIN)
    truth, fine = case.truth, case.truth.fine
    slope = np.interp(truth.label_time_s, fine.time_s, np.gradient(fine.force_N, fine.time_s))
    spread_s = 0.15 * truth.parameters["force_delay"]["delay"]
    foretold = float(np.sum((slope * spread_s) ** 2)) / truth.noise.std**2
    left, rival = left_beside(case, "force_delay"), left_beside(case, "sensor_lag")
    # Far more than 25, and by chance: held against the rival is only what it leaves beyond that.
    assert left == pytest.approx(foretold, rel=0.25) and left > 10 * AS_GOOD
    assert rival > left + AS_GOOD and not as_good(case, "sensor_lag")
    loud = draw_case(5, ("force_delay",), 2.0, "uneven", rate_hz=400.0, **(PLAIN | {"noise_N": 0.03}))
    assert left_beside(loud, "sensor_lag") > AS_GOOD and as_good(loud, "sensor_lag")


def test_what_is_left_of_a_lag_under_a_steady_ramp_is_the_lag_once():
    # Over a long ramp any lag is a delay by its time constant: left is only what its ends differ by.
    ramp = Path(-0.2).hold(0.3).to(1.8, 1.0).hold(0.1).motion()
    case = draw_case(5, ("sensor_lag",), 1.0, "first_order", rate_hz=1000.0, **(PLAIN | {"motion": ramp}))
    truth, tau = case.truth, case.truth.parameters["sensor_lag"]["time_constant"]
    force = Lab(truth).force(truth.structure)
    stiffest = float(np.max(np.diff(force) * 1000.0))
    # One end: ∫ (slope τ e^{−t/τ})² dt = slope² τ³/2, in samples and units of the noise.
    one_end = stiffest**2 * tau**3 / 2 * 1000.0 / float(np.min(_sigma(truth, Lab(truth)))) ** 2
    assert left_beside(case, "force_delay") < AS_GOOD + 4 * one_end


def test_a_name_that_makes_nothing_late_is_not_judged():
    case = draw_case(3, ("force_delay",), 1.0, "pure", rate_hz=1000.0, **PLAIN)
    assert "friction" not in STAGES and left_beside(case, "friction") is None and not as_good(case, "friction")


BOTH = {"contact_offset": "fixed", "sensor_lag": "first_order", "cogging": "sine", "resonance": "second_order"}


@pytest.mark.parametrize(("id", "other"), [("sensor_lag", "cogging"), ("resonance", "contact_offset")])
def test_in_a_pair_the_right_name_leaves_next_to_nothing_and_a_wrong_one_what_it_leaves_alone(id, other):
    sizes, shapes = {id: 2.5, other: 1.0}, {id: BOTH[id], other: BOTH[other]}
    case = draw_case(3, (id, other), sizes, shapes, rate_hz=1000.0, **PLAIN)
    right, wrong = left_in_place(case, id, id), left_in_place(case, "force_delay", id)
    alone = left_beside(case.alone(id), "force_delay")
    # To first order only: the pad's numbers and the other's size are held by it.
    assert right < 0.05 * wrong and wrong == pytest.approx(alone, rel=0.3)
    assert not as_good_in_place(case, "force_delay", id)


def test_in_a_pair_too_a_lag_passes_for_a_delay_where_only_the_mean_lateness_is_seen():
    told = PLAIN | {"noise_N": 0.03, "rate_hz": 150.0}
    shapes = {"sensor_lag": "first_order", "cogging": "sine"}
    case = draw_case(5, ("cogging", "sensor_lag"), {"cogging": 1.0, "sensor_lag": 0.5}, shapes, **told)
    assert misfit(case.alone("sensor_lag")).chi2 > ENOUGH and as_good_in_place(case, "force_delay", "sensor_lag")


def test_beside_another_clock_and_of_a_name_that_makes_nothing_late_nothing_is_known():
    shapes = {"sensor_lag": "first_order", "clock_skew": "stamped"}
    case = draw_case(3, ("clock_skew", "sensor_lag"), 1.0, shapes, rate_hz=1000.0, **(PLAIN | {"own_clock": True}))
    assert left_in_place(case, "force_delay", "sensor_lag") is None
    assert left_in_place(case, "friction", "clock_skew") is None
