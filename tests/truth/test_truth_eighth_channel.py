"""The eighth shapes of the channel's faults, against closed forms and counts."""

import numpy as np
import pytest

from .cases import draw_case
from .effects.eighth_channel import LEVEL_N, clamped
from .effects.registry import SATURATION, Samples
from .test_truth_effects import hidden
from .test_truth_fourth_signal import MANY

pytestmark = pytest.mark.long


def runs(flag):
    """(beginnings, lengths) of the runs of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flag.astype(int), [0]])))
    return edges[::2], edges[1::2] - edges[::2]


def test_a_diode_that_clamps():
    force = np.linspace(-2.0, 10.0, 1201)
    out = clamped(force, 5.0, 0.1)
    # What is lost in the resistor is what the diode draws.
    assert np.allclose(force - out, 0.1 * np.exp((out - 5.0) / 0.1)) and np.all(np.diff(out) > 0)
    assert np.allclose(out[force < 4.0], force[force < 4.0], atol=1e-5)
    # Where it draws as much as its knee it is at the limit; ten times as much costs ln 10 of it.
    assert np.interp([5.1, 5.0 + 1.0 + 0.1 * np.log(10)], force, out) == pytest.approx([5.0, 5.0 + 0.1 * np.log(10)])


@pytest.mark.parametrize("seed", range(3))
def test_a_limit_by_a_diode(seed):
    _, told, build = hidden("saturation", "diode_clamp", seed=seed)
    ramp = np.concatenate([np.linspace(0.0, 10.0, 2001), np.linspace(10.0, 0.0, 2001)])
    samples = Samples(np.arange(4002.0), ramp + 0.01, ramp.copy(), 0.01)
    ((order, stage),) = build.samples
    stage(samples, np.random.default_rng(0))
    limit, over = told["limit"], samples.flags["saturated"]
    assert order == SATURATION and 7.5 < limit < 8.5 and np.array_equal(over, ramp + 0.01 > limit)
    lost = ramp - samples.clean_N
    assert np.allclose(samples.clean_N[2:2001], samples.force_N[:1999], atol=1e-9)
    # From one force to another beyond the limit: by the knee times the logarithm of what is lost.
    knee = (samples.clean_N[2000] - samples.clean_N[1800]) / np.log(lost[2000] / lost[1800])
    assert 0.0099 <= knee / limit <= 0.0201 and lost[2000] > 1.0
    assert np.interp(limit, samples.clean_N[:2001], ramp[:2001]) == pytest.approx(limit + knee, rel=1e-4)


@pytest.mark.parametrize("seed", range(3))
def test_a_telephone_beside_the_cell(seed):
    case = draw_case(seed, ("outliers",), 1.0, "phone", **MANY)
    truth, hit = case.truth, case.truth.flags["outlier"]
    sizes = truth.fault_N[hit] / truth.noise.std
    assert hit.mean() == pytest.approx(truth.parameters["outliers"]["fraction"])
    assert hit.sum() == round(truth.parameters["outliers"]["fraction"] * len(hit)) and 0.003 < hit.mean() < 0.008
    assert np.all(truth.fault_N[~hit] == 0) and len(set(np.sign(sizes))) == 1
    assert np.all((np.abs(sizes) > 25) & (np.abs(sizes) < 60.1))
    times = truth.force_true_time_s[hit]
    for call in np.split(times, np.flatnonzero(np.diff(times) > 0.2) + 1):
        # All within an eighth of the frame.
        turns = np.exp(2j * np.pi * call / 4.615e-3)
        assert np.abs(np.mean(turns)) > np.sinc(1 / 8) - 0.02
        assert np.ptp(np.angle(turns / np.mean(turns))) <= 2 * np.pi * 0.577 / 4.615 + 1e-9
        if len(call) > 15:
            # One sample in eight, as long as it sends: 217 slots a second, of 0.58 samples each.
            assert len(call) / np.ptp(call) == pytest.approx(125.0, rel=0.15) and np.ptp(call) <= 1.5


@pytest.mark.parametrize("seed", range(3))
def test_codes_between_two_levels(seed):
    case = draw_case(seed, ("outliers",), 1.0, "sparkle", **MANY)
    truth, hit = case.truth, case.truth.flags["outlier"]
    assert hit.mean() == pytest.approx(truth.parameters["outliers"]["fraction"]) and 0.0005 < hit.mean() < 0.008
    off = truth.fault_N[hit] / 0.78125
    assert LEVEL_N == 0.78125 and np.all(truth.fault_N[~hit] == 0)
    assert {1.0, 2.0, 4.0} == set(np.round(np.abs(off), 9)) and 0.25 < np.mean(off > 0) < 0.75
    # All of them from near the places where levels meet: within a fifth of a turn, each 50/64 N, and at more than one.
    was = case.force_N[hit] - truth.fault_N[hit]
    turns = np.exp(2j * np.pi * was / 0.78125)
    assert np.ptp(np.angle(turns / np.mean(turns))) <= 0.2 * 2 * np.pi + 1e-9 and np.ptp(was) > 0.6 * 0.78125


@pytest.mark.parametrize("seed", range(3))
def test_a_cable_that_is_broken_at_a_place(seed):
    case = draw_case(seed, ("stuck_samples",), 1.5, "flexed_cable", **MANY)
    truth, stuck = case.truth, case.truth.flags["stuck"]
    where = np.flatnonzero(stuck)
    assert stuck.mean() == pytest.approx(truth.parameters["stuck_samples"]["fraction"]) and 0.005 < stuck.mean() < 0.022
    assert np.array_equal(case.force_N[stuck], case.force_N[where - 1])
    motion, t = truth.motion, truth.force_true_time_s
    moves, x = np.abs(motion.velocity(t)) > 1e-6, motion.position(t)
    assert np.all(moves[stuck])
    low, high = x[stuck].min(), x[stuck].max()
    assert high - low <= 1.0 + 1e-9 and 0.2 <= (low + high) / 4 <= 0.8
    # All that was measured on the way through there, each time.
    assert np.mean(stuck[moves & (x > low) & (x < high)]) == 1.0 and len(runs(stuck)[0]) >= 4
    # A smaller fraction is a shorter part of the way, of the same middle.
    few = draw_case(seed, ("stuck_samples",), 0.3, "flexed_cable", **MANY).truth.flags["stuck"]
    within = x[few].min(), x[few].max()
    assert np.mean(few[moves & (x > within[0]) & (x < within[1])]) == 1.0 and few.sum() < 0.5 * stuck.sum()
    assert sum(within) == pytest.approx(low + high, abs=0.15) and within[1] - within[0] < 0.7 * (high - low)


@pytest.mark.parametrize("seed", range(3))
def test_an_oven(seed):
    case = draw_case(seed, ("stuck_samples",), 1.5, "oven", **MANY)
    truth, stuck = case.truth, case.truth.flags["stuck"]
    where, t = np.flatnonzero(stuck), case.truth.force_true_time_s
    assert stuck.mean() == pytest.approx(truth.parameters["stuck_samples"]["fraction"]) and 0.009 < stuck.mean() < 0.022
    assert np.array_equal(case.force_N[stuck], case.force_N[where - 1])
    # Only within 0.45 of each period, 9 ms of 20 or 7.5 of 16.7, and all of those while it is on.
    begins, lengths = runs(stuck)
    period = np.median(np.diff(t[begins]))
    mains = 50.0 if period > 0.018 else 60.0
    assert np.median(lengths) in ({9} if mains == 50.0 else {7, 8})
    phases = np.exp(2j * np.pi * mains * t[stuck])
    spread = np.angle(phases / np.mean(phases))
    assert np.ptp(spread) <= 0.45 * 2 * np.pi + 1e-9 and np.ptp(spread) > 0.39 * 2 * np.pi
    on = np.split(begins, np.flatnonzero(np.diff(t[begins]) > 0.05) + 1)
    assert len(on) <= 4 and all(np.ptp(t[part]) <= 2.0 for part in on)
    # It may begin within a half of a period.
    assert all(np.allclose(np.diff(t[part])[1:], 1 / mains, atol=1.5e-3) for part in on)
