"""The ninth shapes from the cell to the sample, against closed forms."""

import numpy as np
import pytest

from .cases import draw_case
from .effects.ninth_signal import _compensated, _rattles, coloured, loop_with_dead_time, running_median
from .motion import Path
from .test_truth_effects import SHORT, disturbed, hidden
from .test_truth_eighth_signal import applied
from .test_truth_fourth_signal import QUIET
from .test_truth_seventh_signal import swung

pytestmark = pytest.mark.long

LONG = Path(-0.5).to(1.0, 0.5).hold(50.0).to(-0.5, 0.5).hold(10.0).motion()

# --- resonance --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("frequency", "damping"), [(50.0, 0.05), (80.0, 0.2), (15.0, 0.1), (300.0, 0.1)])
def test_a_loop_with_a_dead_time(frequency, damping):
    gain, dead = loop_with_dead_time(frequency, damping)
    root = 2 * np.pi * frequency * complex(-damping, np.sqrt(1 - damping**2))
    assert abs(root + gain * np.exp(-root * dead)) < 1e-9 * abs(root)
    # Between 1/e, from which on it swings, and π/2, from which on it grows.
    assert np.exp(-1) < gain * dead < np.pi / 2


def test_a_step_of_a_loop_by_its_pieces():
    # y' = K (1 − y)(t − T): a line from T to 2 T, a parabola is taken off up to 3 T.
    t = 1e-4 * np.arange(1000)
    out = _compensated(np.where(t > 0.01, 1.0, 0.0), 1e-4, 200.0, 0.005)
    s = t - 0.01
    exact = 200.0 * np.maximum(s - 0.005, 0.0) - 200.0**2 * np.maximum(s - 0.01, 0.0) ** 2 / 2
    assert np.allclose(out[s < 0.015], exact[s < 0.015], atol=0.015) and np.all(out[s < 0.0049] == 0)


@pytest.mark.parametrize("seed", range(3))
def test_a_cell_that_makes_up_for_the_force(seed):
    _, told, build = hidden("resonance", "force_compensation", seed=seed)
    f, z = told["frequency"], told["damping_ratio"]
    assert 40 <= f <= 80 and 0.05 <= z <= 0.2
    gain, dead = loop_with_dead_time(f, z)
    for ratio in (0.01, 0.3, 0.9, 1.0, 1.1, 2.0):
        s = 2j * np.pi * f * ratio
        late = gain * np.exp(-s * dead)
        assert swung(build, f * ratio) == pytest.approx(late / (s + late), rel=0.02)
    # Where the force has stopped it rings as told.
    t = 1e-4 * np.arange(6000)
    ring = build.plant.sensor[0][1](t, np.where(t > 0.01, 1.0, 0.0)) - 1
    tops = np.flatnonzero((np.diff(ring)[1:] < 0) & (np.diff(ring)[:-1] > 0))[1:4] + 1
    assert 1 / np.mean(np.diff(t[tops])) == pytest.approx(f * np.sqrt(1 - z**2), rel=0.02)
    assert np.log(ring[tops[0]] / ring[tops[1]]) == pytest.approx(2 * np.pi * z / np.sqrt(1 - z**2), rel=0.05)


def test_a_mass_that_rattles():
    h, omega, t = 1e-4, 2 * np.pi * 50.0, 1e-4 * np.arange(4000)
    step = np.where(t > 1e-4, 0.1, 0.0)
    # Without a wall that is met it is a swing of second order.
    free = _rattles(step, h, omega, 0.05, 0.1, 1.0, 0.5)
    swing = omega * np.sqrt(1 - 0.05**2)
    s = t - 1.5e-4
    exact = 0.1 * (
        1 - np.exp(-0.05 * omega * s) * (np.cos(swing * s) + 0.05 / np.sqrt(1 - 0.05**2) * np.sin(swing * s))
    )
    assert np.allclose(free[5:], exact[5:], atol=2e-3)
    # With walls all that is lost is more, and it comes to the same rest.
    met = _rattles(step, h, omega, 0.0, 0.1, 0.01, 0.5)
    whole = _rattles(step, h, omega, 0.0, 0.1, 10.0, 0.5)
    assert np.ptp(whole[-200:]) == pytest.approx(0.2, rel=0.01) and np.ptp(met[-200:]) < 0.12
    assert np.mean(met[-1000:]) == pytest.approx(0.1, abs=5e-3)


def test_the_first_blow_keeps_the_momentum():
    h, omega, t = 1e-5, 2 * np.pi * 20.0, 1e-5 * np.arange(4000)
    out = _rattles(np.where(t > 1e-5, 1.0, 0.0), h, omega, 0.0, 0.1, 0.1, 0.5)
    v = np.gradient(out, h)
    # y = 1 − cos ω t meets the one at rest at 0.1, with ω sin; v goes on as (1 − m e)/(1 + m).
    blow = np.argmax(out > 0.1)
    speed = omega * np.sqrt(1 - 0.9**2)
    assert v[blow - 3] == pytest.approx(speed, rel=0.01)
    after = speed * (1 - 0.1 * 0.5) / 1.1
    assert v[blow + 3] == pytest.approx(after, rel=0.02)
    # Between two blows either is free, and the next is where the one that flies, at (1 + e)/(1 + m), is caught up with.
    s = h * np.arange(1000)
    free = 1 - 0.9 * np.cos(omega * s) + after / omega * np.sin(omega * s)
    flies = speed * 1.5 / 1.1 * s
    caught = np.flatnonzero(free - flies > 0.1)
    second = caught[caught > 100][0]
    assert np.allclose(out[blow : blow + second - 10], free[: second - 10], atol=2e-3)
    goes = np.gradient(free, h)
    lost = (goes[second] - speed * 1.5 / 1.1) * 0.1 * 1.5 / 1.1
    assert v[blow + second - 30] == pytest.approx(goes[second - 30], rel=0.005)
    assert goes[second + 30] - v[blow + second + 30] == pytest.approx(lost, rel=0.1) and lost > 1.0


@pytest.mark.parametrize("seed", range(3))
def test_the_loose_mass_is_felt_in_swings_that_are_large(seed):
    _, told, build = hidden("resonance", "impact_damper", seed=seed)
    f, z = told["frequency"], told["damping_ratio"]
    t = 1e-4 * np.arange(10_000)
    swing = 2 * np.pi * f * np.sqrt(1 - z**2)
    s, apart = np.maximum(t - 0.01005, 0.0), {}
    plain = 1 - np.exp(-z * 2 * np.pi * f * s) * (np.cos(swing * s) + z / np.sqrt(1 - z**2) * np.sin(swing * s))
    for size in (0.01, 3.0):
        apart[size] = np.abs(build.plant.sensor[0][1](t, np.where(t > 0.01, size, 0.0)) / size - plain)
    # Below the gap nothing is met; above it a blow is worth about the share of the mass.
    assert apart[0.01].max() < 2e-3 and 0.02 < apart[3.0].max() < 0.3 and apart[3.0][-1] < 2e-3
    assert 40 <= f <= 80


# --- lag --------------------------------------------------------------------------------------------------------------


def test_a_running_median():
    t = 1e-4 * np.arange(20_000)
    # A ramp comes four steps late, and a half of one more as each is held; a spike of four steps does not come at all.
    out = running_median(t, 3.0 * t, 0.01)
    assert np.mean((t - out / 3.0)[10_000:]) == pytest.approx(0.045, abs=2e-4) and len(np.unique(out[10_000:])) == 100
    assert np.all(running_median(t, np.where((t > 0.5) & (t < 0.54), 1.0, 0.0), 0.01) == 0)
    out = running_median(t, np.where((t > 0.5) & (t < 0.6), 1.0, 0.0), 0.01)
    assert set(out) == {0.0, 1.0} and np.sum(out) * 1e-4 == pytest.approx(0.1, abs=0.011)
    for seed in range(3):
        _, told, build = hidden("sensor_lag", "running_median", seed=seed)
        late = t - build.plant.sensor[0][1](t, t)
        assert np.mean(late[10_000:]) == pytest.approx(told["time_constant"], rel=0.01)
        assert 2.1e-3 <= told["time_constant"] <= 4.5e-3


@pytest.mark.parametrize("seed", range(3))
def test_oil_that_warms(seed):
    _, told, build = hidden("sensor_lag", "oil_warms", motion=LONG, seed=seed)
    t = np.arange(0.0, LONG.duration_s, 2e-3)
    fine = np.arange(0.0, LONG.duration_s, 1e-4)
    # A ramp is late by the lag of the time there.
    late = np.interp(t, fine, fine - build.plant.sensor[0][1](fine, fine))[500:]
    t = t[500:]
    assert np.mean(late) == pytest.approx(told["time_constant"], rel=0.02) and np.all(np.diff(late) < 1e-9)
    logs = np.interp(LONG.duration_s * np.array([0.1, 0.4, 0.7, 0.98]), t, np.log(late))
    keeps = (logs[2] - logs[1]) / (logs[1] - logs[0])
    warms = -0.3 / np.log(keeps)
    assert 0.198 < warms < 0.602
    # From the beginning to the end of the recording by a half or a third.
    whole = (logs[0] - logs[2]) / (np.exp(-0.1 / warms) - np.exp(-0.7 / warms)) * -np.expm1(-1 / warms)
    assert 1.98 < np.exp(whole) < 3.03


# --- delay and clock --------------------------------------------------------------------------------------------------


def slope_of_power(values, step_s):
    power = np.abs(np.fft.rfft(values - values.mean())) ** 2
    at = np.fft.rfftfreq(len(values), step_s)
    bins = np.geomspace(at[2], 0.1 / step_s, 9)
    means = [np.log(np.mean(power[(at >= a) & (at < b)])) for a, b in zip(bins[:-1], bins[1:], strict=True)]
    return np.polyfit(np.log(np.sqrt(bins[1:] * bins[:-1])), means, 1)[0]


def test_noise_of_all_times():
    for power in (0.8, 1.0):
        slopes = []
        for seed in range(6):
            path = coloured(np.random.default_rng(seed), 400.0, power)(0.05 * np.arange(8000))
            assert np.mean(path) == pytest.approx(0.0, abs=0.01) and np.std(path) == pytest.approx(1.0, abs=0.01)
            slopes.append(slope_of_power(path, 0.05))
        assert np.mean(slopes) == pytest.approx(-power, abs=0.12)


def test_a_network_busy_on_all_scales():
    slopes = []
    for seed in range(6):
        _, told, build = hidden("force_delay", "self_similar", motion=LONG, seed=seed)
        t = np.arange(0, LONG.duration_s, 0.05)
        late = t - build.delays[0](t, None)
        assert np.mean(late) == pytest.approx(told["delay"], rel=0.01) and late.min() > 0
        assert np.std(late) / told["delay"] == pytest.approx(0.25, abs=0.06)
        slopes.append(slope_of_power(late, 0.05))
    assert np.mean(slopes) == pytest.approx(-0.8, abs=0.2)


@pytest.mark.parametrize("seed", range(3))
def test_a_wire_whose_waves_are_counted(seed):
    motion = Path(-0.5).to(2.0, 1.0).hold(0.5).motion()
    _, told, build = hidden("force_delay", "vibrating_wire", motion=motion, seed=seed)
    t = np.arange(0, motion.duration_s, 1e-3)
    late = t - build.delays[0](t, None)
    assert np.mean(late) == pytest.approx(told["delay"], rel=1e-3)
    # The square of its inverse is a straight line of the force.
    force = 3 * np.maximum(motion.position(t), 0.0)
    slope, start = np.polyfit(force, late**-2, 1)
    assert np.allclose(late**-2, start + slope * force, rtol=1e-9) and 0.299 <= start / slope / 6.0 <= 0.801


@pytest.mark.parametrize("seed", range(3))
def test_a_smeared_leap(seed):
    case = draw_case(seed, ("clock_skew",), 1.0, "leap_smear", **(QUIET | {"own_clock": True, "motion": LONG}))
    t, off = case.truth.force_true_time_s, case.force_time_s - case.truth.force_true_time_s
    skew = 1e-6 * case.truth.parameters["clock_skew"]["skew"]
    duration = LONG.duration_s + 2.5  # of the recording
    assert off[-1] == pytest.approx(skew * duration) and 1.1e-4 < abs(skew) < 3.3e-4
    rates, t = np.diff(off[::50]) / np.diff(t[::50]), (t[50::50] + t[:-50:50]) / 2
    going = np.abs(rates) > 1e-3 * abs(skew)
    begins, ends = t[going][0], t[going][-1]
    # Twice the mean over the part at its middle, and a raised cosine about it.
    middle, top = (begins + ends) / 2, rates[np.argmax(np.abs(rates))]
    lasts = 2 * skew * duration / top
    assert 0.399 <= lasts / duration <= 0.701 and 0.099 <= (middle - lasts / 2) / duration <= 0.251
    s = (t - middle) / lasts
    assert np.allclose(rates, np.where(np.abs(s) < 0.5, top * np.cos(np.pi * s) ** 2, 0.0), atol=0.01 * abs(top))


def test_a_clock_that_flickers():
    slopes = []
    for seed in range(6):
        _, told, build = hidden("clock_skew", "flicker", motion=LONG, seed=seed)
        t = np.arange(0, LONG.duration_s, 0.05)
        off = t - build.delays[0](t, None)
        assert build.stamps == [] and not build.own_clock and off[0] == 0
        assert off[-1] == pytest.approx(1e-6 * told["skew"] * t[-1], rel=0.01)
        rates = np.diff(off) / 0.05 / (1e-6 * told["skew"])
        assert np.std(rates) == pytest.approx(1 / 3, abs=0.1)
        slopes.append(slope_of_power(rates, 0.05))
    assert np.mean(slopes) == pytest.approx(-1.0, abs=0.2)


# --- zero, drift and hum ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(3))
def test_a_zero_that_is_strained_away(seed):
    motion = Path(-0.5).to(1.0, 50.0).hold(0.5).to(-0.5, 50.0).hold(0.5).to(2.0, 50.0).to(0.5, 50.0).hold(0.5).motion()
    fine, told, _ = hidden("force_bias", "strained", motion=motion, seed=seed)
    zero = fine.force_N - 3 * np.maximum(fine.reported_mm, 0.0)
    assert np.mean(zero) == pytest.approx(told["bias"], rel=1e-6)
    air, held, back, last = np.interp([0.01, 0.3, 0.9, motion.duration_s - 0.1], fine.time_s, zero)
    # By half after 1 mm, by the rest after 2 mm, and nothing comes back.
    assert held == pytest.approx(back) and last - air == pytest.approx(2 * (held - air), rel=1e-3)
    assert 0.149 / 0.9 <= last / air - 1 <= 0.251 / 0.9


@pytest.mark.parametrize("seed", range(3))
def test_a_drop_that_dries(seed):
    duration = SHORT.duration_s
    t = np.linspace(0, 1.5 * duration, 30_001)
    samples, told = disturbed("force_drift", "drop_dries", t, seed=seed)
    zero, rate = samples.clean_N, told["rate"]
    assert zero[0] == 0 and zero[1] / t[1] == pytest.approx(rate, rel=1e-3) and 0.0011 < abs(rate) < 0.0033
    # What is left of the weight has a surface that falls evenly: its 2/3rd power is a straight line.
    left = np.maximum((1 - zero / zero[-1]), 0.0) ** (2 / 3)
    dries = t[np.argmax(left < 1e-9)]
    assert 0.499 < dries / duration < 1.101
    assert np.allclose(left, np.maximum(1 - t / dries, 0.0), atol=1e-3)
    assert zero[-1] == pytest.approx(rate * dries * 2 / 3, rel=1e-3)


def test_draughts():
    kept = []
    for seed in range(6):
        _, told, build = hidden("force_drift", "draughts", motion=LONG, seed=seed)
        t = np.arange(0, LONG.duration_s, 0.1)
        rates = np.diff(applied(build, t)) / 0.1 / told["rate"]
        assert rates[0] == pytest.approx(1.0, abs=0.35)
        wind = rates - 1
        assert 0.3 < np.std(wind) < 1.3
        # As an Ornstein–Uhlenbeck process, half a second apart and a second apart.
        kept.append([np.mean(wind[n:] * wind[:-n]) / np.mean(wind**2) for n in (5, 10)])
    half, whole = np.mean(kept, axis=0)
    assert whole == pytest.approx(half**2, abs=0.05) and np.exp(-0.5 / 1.0) < half < np.exp(-0.5 / 7.0)


@pytest.mark.parametrize("seed", range(3))
def test_hum_of_an_arc_furnace(seed):
    motion = Path(-0.5).to(1.0, 50.0).hold(60.0).motion()
    _, told, build = hidden("mains_hum", "arc_furnace", motion=motion, seed=seed)
    t = np.arange(0, 60, 1e-3)
    f = told["frequency"]
    assert min(abs(f - 50), abs(f - 60)) <= 0.05
    turned = applied(build, t) * 2 * np.exp(-2j * np.pi * f * t)
    # Over two waves each, a phase that stays and an amplitude that wanders.
    width = round(2000 / f)
    whole = np.cumsum(turned)
    waves = (whole[width:] - whole[:-width]) / width
    phase = np.angle(np.mean(waves))
    swells = np.real(waves * np.exp(-1j * phase)) / told["amplitude"]
    assert np.mean(swells) == pytest.approx(1.0, abs=0.02) and 0.25 < np.std(swells) < 0.42
    assert np.std(np.imag(waves * np.exp(-1j * phase))) < 0.1 * told["amplitude"]
    near, far = (np.corrcoef(swells[n:], swells[:-n])[0, 1] for n in (50, 1500))
    assert near > 0.3 and abs(far) < 0.15
