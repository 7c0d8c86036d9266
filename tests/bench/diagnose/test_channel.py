"""What the force channel shows by itself: repeats, ceilings, strays, and what swings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from bench.diagnose import diagnose, swing
from bench.diagnose.channel import faults, of_the_model
from bench.diagnose.channel_causes import joined
from bench.diagnose.data import Data
from bench.diagnose.evidence import beyond_limit
from bench.diagnose.numbers import PadNumbers, Structure, cause_of
from bench.diagnose.refit import Fit
from bench.diagnose.result import CauseFound
from sim.effects import effect
from sim.elastic import Exponential
from sim.model import Model
from sim.pad import Pad
from sim.relaxation import Relaxation
from tests.bench.diagnose.small import measurement
from tests.truth.cases import draw_case

SAMPLE_s = 0.002
SEEDS = range(12)


def _steps(rng: np.random.Generator, step_N: float, noise_N: float) -> np.ndarray:
    """Ramps and holds between random forces, with white noise, as a coarse channel has them."""
    pieces = [np.zeros(200)]
    for _ in range(60):
        here, there = pieces[-1][-1], rng.uniform(0.5, 6.0)
        pieces += [np.linspace(here, there, 80), np.full(300, there)]
    force = np.concatenate(pieces)
    return np.round((force + noise_N * rng.standard_normal(len(force))) / step_N) * step_N


def _repeated(rng: np.random.Generator, force: np.ndarray, share: float) -> np.ndarray:
    stuck = rng.random(len(force)) < share
    stuck[0] = False
    return np.where(stuck, np.concatenate([[0.0], force[:-1]]), force)


def test_repeats_in_a_coarse_channel_are_told_by_how_often_they_come():
    """A channel with steps of its noise's size repeats itself anyway: 5 % more of it still show."""
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        clean = _steps(rng, 0.01, 0.015)
        assert not faults(clean).stuck.any()
        again = _repeated(rng, clean, 0.05)
        found = faults(again)
        assert found.stuck_share == pytest.approx(0.05, abs=0.015)
        assert found.stuck.any()
        repeats = np.concatenate([[False], again[1:] == again[:-1]])
        assert not (found.stuck & ~repeats).any()


def test_repeats_in_motion_are_told_where_a_coarse_channel_hides_those_at_rest():
    """Noise of less than a step, and one reading in ten lost while the force moves, one in a hundred at rest."""
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        clean = _steps(rng, 0.004, 0.003)
        assert not faults(clean).stuck.any()
        moves = np.abs(np.gradient(np.convolve(clean, np.ones(9) / 9.0, mode="same"))) > 0.01
        stuck = rng.random(len(clean)) < np.where(moves, 0.1, 0.01)
        stuck[0] = False
        found = faults(clean[np.maximum.accumulate(np.where(stuck, 0, np.arange(len(clean))))]).stuck
        assert (found & stuck).sum() >= 10
        assert (found & ~stuck).sum() <= 0.1 * found.sum()


def test_a_fine_scale_with_a_few_values_between_its_steps_repeats_itself_by_chance():
    """Some readings are means of others: the finest change is none of the scale's."""
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        force = np.round(5.0 * np.exp(-np.arange(2000) / 400.0) + 0.001 * rng.standard_normal(2000), 4)
        between = rng.choice(2000, 100, replace=False)
        force[between] += 0.00005
        assert not faults(force).stuck.any()


def test_a_coarse_channel_that_loses_digits_does_not_stick():
    for seed in SEEDS:  # a tenth of a reading is no multiple of the step
        rng = np.random.default_rng(seed)
        t = np.arange(0.0, 21.5, 1 / 600.0)
        ends = np.concatenate([[-0.5], *([0.2, 0.7 + 0.1 * k] for k in range(31)), [0.2]])
        depth = np.maximum(np.interp(t, 2.0 + np.cumsum(np.abs(np.diff(ends, prepend=-0.5))) / 8.0, ends), 0.0)
        clean_N = 0.5 * np.expm1(1.2 * depth)
        force = 0.02 * np.round((clean_N + 0.0094 * rng.standard_normal(t.size)) / 0.02)
        lost = rng.random(t.size) < 0.0025
        force[lost] *= rng.choice([0.1, 10.0, -1.0], lost.sum())
        found = faults(force)
        assert not (found.stuck & ~lost).any()
        assert (found.outlier & lost).sum() > 0.5 * (lost & (clean_N > 0.5)).sum()


def _scored(said: np.ndarray, true: np.ndarray) -> tuple[float, float]:
    """(precision, recall) of samples (n,)."""
    hits = float((said & true).sum())
    return hits / max(said.sum(), 1), hits / true.sum()


def test_a_value_that_comes_twice_for_a_while_sticks_in_a_coarse_channel_too():
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        force = _steps(rng, 0.01, 0.012)
        assert not faults(force).stuck.any()
        stuck = np.zeros(len(force), dtype=bool)
        stuck[5001:5401:2] = stuck[15_001:15_201:2] = True
        force[stuck] = force[np.flatnonzero(stuck) - 1]
        precision, recall = _scored(faults(force).stuck, stuck)
        assert precision > 0.95
        assert recall > 0.95


@pytest.mark.long
@pytest.mark.parametrize("kind", ["white", "coloured", "quantised", "heavy"])
def test_a_ceiling_that_gives_way_is_a_ceiling(kind):
    """Its samples follow each other without noise, and none of them is the greatest twice."""
    said, true = [], []
    for seed in (1, 2, 3, 4):
        told = {"noise_kind": kind, "own_clock": False, "rate_hz": 400.0}
        case = draw_case(seed, ("saturation",), 1.5, "sags", **told)
        found = faults(case.force_N)
        said.append(found.saturated)
        true.append(case.truth.flags["saturated"])
        assert found.limit_N == pytest.approx(case.truth.parameters["saturation"]["limit"], rel=0.01)
        assert found.stuck.sum() < 0.01 * true[-1].sum()
        assert not faults(draw_case(seed, (), **told).force_N).saturated.any()
    precision, recall = _scored(np.concatenate(said), np.concatenate(true))
    assert precision > 0.9
    assert recall > 0.8


@pytest.mark.parametrize(
    "kind", ["white", *(pytest.param(k, marks=pytest.mark.long) for k in ("coloured", "quantised", "heavy"))]
)
def test_below_a_ceiling_that_is_not_sharp_the_force_is_not_trusted(kind):
    """From where the force is bent by 1 % of the ceiling on; below a sharp one all but little is."""
    said, true = [], []
    for seed in (1, 2, 3, 4):
        told = {"noise_kind": kind, "own_clock": False, "rate_hz": 400.0}
        sharp = draw_case(seed, ("saturation",), 1.5, "hard", **told)
        assert np.mean(faults(sharp.force_N).bent) < 0.08
        case = draw_case(seed, ("saturation",), 1.5, "soft", **told)
        found, limit = faults(case.force_N), case.truth.parameters["saturation"]["limit"]
        bends = (case.force_N > 0.96 * limit) & ~case.truth.flags["saturated"]
        assert np.mean(found.good[bends]) < 0.05
        assert np.mean(found.good[case.force_N < 0.85 * limit]) > 0.99
        said.append(found.saturated)
        true.append(case.truth.flags["saturated"])
    precision, recall = _scored(np.concatenate(said), np.concatenate(true))
    assert precision > 0.95
    assert recall > 0.75


def test_a_run_of_one_value_near_the_greatest_force_sticks_and_is_no_ceiling():
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        force = _steps(rng, 1e-7, 0.01)
        top = int(np.argmax(force))
        force[top + 20 : top + 24] = force[top + 20] - 1e-5 * np.arange(4)  # calm by chance
        force[top + 23 : top + 41] = force[top + 23]
        found = faults(force)
        assert not found.saturated.any()
        assert found.stuck[top + 24 : top + 41].all()


def test_a_ceiling_met_in_passing_is_one_though_a_reading_elsewhere_repeats_another():
    """Two peaks cut off, of five samples each: too few in a row for a channel that sticks."""
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        t = 0.05 * np.arange(600)
        force = 5.0 * np.exp(-(((t % 10.0 - 5.0) / 1.0) ** 2)) * np.array([1.0, 0.7, 1.0])[(t // 10.0).astype(int)]
        force += 0.01 * rng.standard_normal(600)
        above = force > 4.9
        assert 4 < above.sum() < 16
        force[above] = 4.9
        force[301] = force[300]
        found = faults(force)
        assert np.array_equal(found.saturated, above) and not found.stuck[above].any()


def test_a_coarse_channel_that_ends_softly_does_not_stick():
    """Where it ends it says one value for long, and for a while the next one: no noise is left to tell."""
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        force = np.repeat([0.0, 0.8, 1.5, 1.9, 1.2, 0.0, 0.5], 600) + 0.006 * rng.standard_normal(4200)
        code = np.round(force / 0.0048)
        above = np.zeros(4200, dtype=bool)
        above[3100:3220] = True
        code[above] = 446
        code[3100:3110] = 447  # as high as it gets, for a moment
        found = faults(code * 0.0048)
        assert not found.stuck.any()
        assert np.array_equal(found.saturated, above)


def test_strays_beyond_a_ceiling_do_not_hide_it():
    """Stray samples beyond what the channel reports are strays; where it stays at one value is its ceiling."""
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        force = np.minimum(_steps(rng, 1e-6, 0.01), 5.0)
        at = rng.choice(len(force), 100, replace=False)
        force[at] += rng.uniform(1.5, 4.0, len(at))
        found = faults(force)
        assert found.limit_N == pytest.approx(5.0)
        clipped = force == 5.0
        assert np.mean(found.saturated[clipped]) > 0.95
        assert not found.stuck[clipped].any()
        assert np.mean(found.outlier[np.setdiff1d(at, np.flatnonzero(clipped))]) > 0.9


def test_what_a_model_has_of_its_own_is_no_stray_and_what_a_wrong_one_has_besides_is():
    """Of spikes that come a little early or late much is left; strays are larger than what a model makes of them."""
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        at = np.sort(rng.choice(np.arange(10, 1990, 10), 30, replace=False))
        spikes, off = np.zeros(2000), np.zeros(2000, dtype=bool)
        spikes[at], off[at] = rng.choice([-1.0, 1.0], 30), True
        late = 0.6 * spikes * rng.choice([-1.0, 1.0], 2000)
        assert np.array_equal(of_the_model(spikes, late, off), off)
        assert not of_the_model(0.2 * spikes, spikes, off).any()
        assert not of_the_model(np.linspace(0.0, 50.0, 2000), late, off).any()


def test_a_frame_that_is_lost_twice_in_a_row_is_stray_and_not_stuck():
    for seed in (1, 2, 3):
        case = draw_case(seed, ("outliers",), 2.0, "dropouts", noise_kind="white", own_clock=False)
        force, stray = case.force_N.copy(), case.truth.flags["outlier"].copy()
        again = np.flatnonzero(stray[:-1] & ~stray[1:])[:6] + 1  # the frame after it is lost as well
        force[again], stray[again] = 0.0, True
        found = faults(force)
        assert not found.stuck.any()
        precision, recall = _scored(found.outlier, stray)
        assert precision > 0.95
        assert recall > 0.95


def test_the_tail_of_heavy_noise_is_no_fault():
    """One value in ten thousand far out is what such noise does, now and then."""
    flagged = 0
    for seed in range(40):
        rng = np.random.default_rng(seed)
        force = _steps(rng, 1e-7, 0.0)
        force = force + 0.01 * rng.standard_t(5.0, len(force))
        flagged += bool(faults(force).outlier.any())
    assert flagged <= 1


def test_a_channel_that_is_quiet_wherever_it_rests_has_no_ceiling():
    """Loud in its moves and quiet in all of its holds, the highest too."""
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        pieces, here = [], 0.0
        for there in [*rng.uniform(0.5, 5.5, 30), 6.0, 3.0]:
            moves = np.linspace(here, there, 60) + 0.05 * rng.standard_normal(60)
            rests = there - 0.02 * np.linspace(0.0, 1.0, 60) + 5e-4 * rng.standard_normal(60)
            pieces, here = [*pieces, moves, rests], there
        assert not faults(np.concatenate(pieces)).saturated.any()


def test_what_is_left_below_a_ceiling_is_not_the_lower_half_of_its_noise():
    """Holds close below a ceiling: which samples count must not go by their own noise."""
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        levels = np.repeat(np.linspace(5.4, 5.9, 11), 400)
        noise = 0.02 * rng.standard_normal(len(levels) + 200)
        force = np.minimum(np.concatenate([np.full(200, 8.0), levels]) + noise, 6.0)
        found = faults(force)
        assert found.saturated[:200].all() and not found.saturated[200:].any() and found.bent.any()
        for k in range(200, len(force), 400):
            left = noise[k : k + 400][found.good[k : k + 400]]
            assert abs(left.mean() if len(left) else 0.0) < 4.0 * 0.02 / np.sqrt(max(len(left), 1))


def test_samples_beyond_a_limit_that_was_fitted_are_told():
    """Of a limit of one side alone there is none on the other."""
    time, depth = np.arange(1000) * 0.01, np.linspace(0.0, 5.0, 1000)
    pad = PadNumbers(Pad(Exponential(3.0, 0.0), Relaxation(), unilateral=True), 2.0, 6.0)
    bias = cause_of(effect("force_bias"), effect("force_bias").form("constant"), {"bias": -9.0})
    force = 3.0 * depth - 9.0
    data = Data(time, depth, force, np.ones(1000), np.full(1000, 0.01), np.zeros(1000, dtype=np.intp))
    for form in effect("saturation").forms:
        limit = cause_of(effect("saturation"), form, {"limit": 4.5})
        structure = Structure(pad, (bias, limit))
        fit = Fit(structure, structure.x(pad.x()), 0.0, np.eye(4), True)
        both = form.name in ("hard", "soft", "compressing")
        assert np.array_equal(beyond_limit(data, fit), (np.abs(force) if both else force) > 4.5), form.name
        assert not beyond_limit(data, Fit(Structure(pad), pad.x(), 0.0, np.eye(2), True)).any()


def test_what_sways_at_a_frequency_of_its_own_is_seen_and_noise_is_not():
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        n = 20_000
        t = SAMPLE_s * np.arange(n)
        white = rng.standard_normal(n)
        for noise in (white, lfilter([1.0], [1.0, -0.9], white), rng.standard_t(4, n), np.round(white)):
            assert swing.find(t, noise, SAMPLE_s) is None
        # an oscillator of 5 Hz and 2 % damping, pushed at random
        turn = np.exp((-0.02 + 1j) * 2.0 * np.pi * 5.0 * SAMPLE_s)
        pushes = rng.standard_normal(n) + 1j * rng.standard_normal(n)
        sway = np.real(lfilter([1.0], [1.0, -turn], pushes))
        sway *= 1.5 / sway.std()
        found = swing.find(t, white + sway, SAMPLE_s)
        assert found is not None
        assert found.frequency_Hz == pytest.approx(5.0, rel=0.1)
        assert found.share == pytest.approx(1.5**2 / (1.0 + 1.5**2), abs=0.12)


@pytest.mark.parametrize("seed", [1, *(pytest.param(s, marks=pytest.mark.long) for s in (2, 3))])
def test_what_turns_its_sign_from_sample_to_sample_is_seen(seed):
    """Two gauges read in turn, one of which is out by some of the force: at half the rate, at which no hum is here."""
    c = draw_case(seed, (), noise_kind="white", jitter="none", protocol="staircase", rate_hz=170.0)
    m = measurement(c)
    rows = np.arange(len(m.force_N))
    out_by = 4.0 * c.truth.noise_floor_N / float(np.sqrt(np.mean(m.force_N**2)))
    m = replace(m, force_N=m.force_N * (1.0 + out_by * (-1.0) ** rows))
    result = diagnose(m, Model.from_dict(c.believed))
    assert result.verdict == "unexplained" and not result.causes
    told = [r for r in result.remainders if r.name == "swing" and r.passed]
    assert told and "85 Hz" in told[0].sentence
    assert result.noise_floor < 1.3 * c.truth.noise_floor_N


def test_a_fault_of_the_channel_stands_where_what_it_takes_puts_it():
    def cause(id: str, gain: float) -> CauseFound:
        return CauseFound(id, "", {}, gain, 1.0, [], "", "")

    model, channel = [cause("friction", 0.1), cause("backlash", 0.3)], [cause("stuck_samples", 0.0), cause("hum", 0.6)]
    assert [c.id for c in joined(model, channel)] == ["hum", "friction", "backlash", "stuck_samples"]


def test_a_few_samples_at_the_very_greatest_force_are_a_ceiling_where_nothing_else_repeats():
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        force = 3.0 + np.sin(np.linspace(0.0, 60.0, 6000)) + 0.002 * rng.standard_normal(6000)
        limit = float(np.sort(force)[-6])
        found = faults(np.minimum(force, limit))
        assert found.limit_N == limit
        assert found.saturated.sum() == 6
        assert not found.stuck.any()


def test_where_a_channel_sticks_a_few_samples_at_the_greatest_force_are_no_ceiling():
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        force = 3.0 + np.sin(np.linspace(0.0, 60.0, 6000)) + 0.002 * rng.standard_normal(6000)
        for at in (*rng.integers(10, 5990, 8).tolist(), int(np.argmax(force))):
            force[at : at + 5] = force[at]
        found = faults(force)
        assert found.limit_N is None
        assert found.stuck.sum() > 25


def test_a_share_of_the_samples_is_of_those_that_count():
    """What lies before the first step is history, and nothing of it is told."""
    c = draw_case(3, ("stuck_samples",), 2.5, protocol="staircase", rate_hz=150.0, jitter="none", own_clock=False)
    m = measurement(c)
    m = replace(m, fit_from_s=float(0.6 * m.force_time_s[-1]))
    said = diagnose(m, Model.from_dict(c.believed))
    share = float(c.truth.flags["stuck"][m.counted()].mean())
    found = next(cause for cause in said.causes if cause.id == "stuck_samples")
    assert abs(found.parameters["fraction"].value - share) < 0.2 * share


@pytest.mark.parametrize("other_zero_N", [0.0, 0.2304])
@pytest.mark.parametrize("seed", range(3))
def test_a_fine_scale_that_repeats_itself_by_chance_does_not_stick(seed, other_zero_N):
    """So many levels that there seems to be no step; and a zero that was set on the way, which doubles them."""
    rng, t = np.random.default_rng(seed), np.arange(6000)
    force = 2.0 * np.sin(t / 900.0) ** 2 + 0.01 * rng.standard_normal(t.size)
    force = np.round(force / 0.001) * 0.001 - np.where(t < 400, 0.0, other_zero_N)
    assert not faults(force).stuck.any()
    held = force.copy()
    held[3000:3020] = held[2999]
    assert faults(held).stuck[3001:3019].all() and faults(held).stuck.sum() < 24


@pytest.mark.parametrize("seed", range(3))
def test_readings_at_a_ceiling_are_no_reason_for_others_to_stick(seed: int) -> None:
    """They repeat each other by the thousand; elsewhere two of some digits are alike by chance."""
    rng, t = np.random.default_rng(seed), np.arange(20000)
    force = 2.0 * np.sin(t / 900.0) ** 2 + 0.003 * rng.standard_normal(t.size)
    found = faults(np.round(np.minimum(force, 1.7), 5))
    assert found.limit_N == 1.7 and found.saturated.sum() > 4000
    assert not found.stuck.any()


def test_runs_of_a_coarse_channel_are_told_by_how_many_of_them_are_long() -> None:
    """Each of 3 to 20 samples might be an accident; so many of a dozen and more are none."""
    hits, found, true = 0, 0, 0
    for seed in range(12):
        c = draw_case(seed, ("stuck_samples",), 1.0, "short_runs", noise_kind="quantised", own_clock=False)
        first = np.unique(c.time_s, return_index=True)[1]
        told, stuck = faults(c.force_N[first]).stuck, c.truth.flags["stuck"][first]
        hits, found, true = hits + int((told & stuck).sum()), found + int(told.sum()), true + int(stuck.sum())
    assert hits > 0.9 * found and hits > 0.5 * true


@pytest.mark.parametrize(("digits", "repeats", "told"), [(9, 6, 6), (9, 0, 0), (9, 3, 0), (5, 6, 0), (5, 200, 200)])
def test_a_few_repeats_are_no_accident_where_readings_have_many_digits(digits, repeats, told):
    """Of 12,000 with noise of 12 mN two in a row agree 4 times by chance where the last digit is 10 µN, and 4e-4 times
    where it is 1 nN."""
    for seed in range(8):
        rng = np.random.default_rng(seed)
        force = np.round(3.0 + np.sin(np.linspace(0.0, 60.0, 12_000)) + 0.012 * rng.standard_normal(12_000), digits)
        at = 10 + 20 * rng.choice(590, repeats, replace=False)
        force[at] = force[at - 1]
        flagged = faults(force).stuck
        assert flagged[at].sum() == told and flagged.sum() <= 1.06 * told
