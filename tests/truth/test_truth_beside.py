"""What is seen of one effect beside another, against what arithmetic and the single case say."""

import numpy as np
import pytest

from .beside import seen_beside
from .cases import draw_case
from .detect import ENOUGH, misfit
from .motion import Path
from .test_truth_rivals import PLAIN


def pair(first, second, shapes, sizes=None, **more):
    """A pair on the one motion."""
    told = PLAIN | {"rate_hz": 500.0} | more
    return draw_case(3, (first, second), sizes or {first: 1.0, second: 1.0}, shapes, **told)


def test_effects_that_have_nothing_in_common_are_seen_as_when_alone():
    shapes = {"mains_hum": "sine", "inertia": "rigid"}
    case = pair("inertia", "mains_hum", shapes)
    seen = seen_beside(case)
    for id in shapes:
        assert seen[id] == pytest.approx(misfit(case.alone(id)).chi2, rel=0.15)


def test_two_that_only_make_the_force_late_hide_each_other():
    # At slow moves and few samples a short lag is a delay but for what its curvature makes, which is far less.
    slow = Path(-0.2).hold(0.3).to(1.5, 3.0).hold(0.6).to(-0.2, 3.0).hold(0.3).motion()
    shapes = {"force_delay": "pure", "sensor_lag": "first_order"}
    case = pair("force_delay", "sensor_lag", shapes, motion=slow, noise_N=0.003)
    seen, alone = seen_beside(case), {id: misfit(case.alone(id)).chi2 for id in case.truth.ids}
    for id in case.truth.ids:
        assert alone[id] > ENOUGH and seen[id] < 0.05 * alone[id]


def test_a_wave_of_the_position_is_another_law_on_a_pad_that_stays_put_and_hum_is_none():
    def share(id, shape, seed):
        """Of what it makes alone, that is seen beside a law of which nothing is known."""
        shapes = {"elastic_law": "kondner", id: shape}
        case = draw_case(seed, tuple(shapes), dict.fromkeys(shapes, 1.0), shapes, **PLAIN, rate_hz=500.0)
        return seen_beside(case)[id] / misfit(case.alone(id)).chi2

    waves = [share("encoder_error", "reported", seed) for seed in range(8)]
    assert np.median(waves) < 0.05 and max(waves) < 0.25
    assert all(share("mains_hum", "sine", seed) == pytest.approx(1.0, rel=0.15) for seed in range(3))


def test_it_goes_with_the_square_of_a_size_that_is_small():
    shapes = {"force_drift": "linear", "mains_hum": "sine"}
    half, whole = (
        seen_beside(pair("force_drift", "mains_hum", shapes, {"force_drift": 1.0, "mains_hum": size}))["mains_hum"]
        for size in (0.5, 1.0)
    )
    assert whole == pytest.approx(4 * half, rel=1e-3)


def test_outliers_are_seen_beside_anything():
    case = pair("outliers", "inertia", {"outliers": "single", "inertia": "rigid"})
    seen = seen_beside(case)
    of_faults = float(np.sum((case.truth.fault_N / case.truth.noise.std) ** 2))
    assert seen["outliers"] == pytest.approx(of_faults, rel=0.2) and of_faults > ENOUGH


def test_a_frame_that_yields_by_turns_stands_beside_a_force_that_runs_the_pad_by_itself():
    """Each runs the plant anew, and neither may ask the other to do so for ever."""
    shapes = {"frame_compliance": "beds_in", "viscous_damping": "tsuji"}
    case = pair("frame_compliance", "viscous_damping", shapes=shapes, rate_hz=100.0)
    assert np.isfinite(case.force_N).all() and case.truth.parameters.keys() == shapes.keys()
