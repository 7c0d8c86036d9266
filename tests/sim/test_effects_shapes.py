"""Shapes that a cause takes once it is found: each against its closed form."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import lsim

from sim.effects import effect
from sim.elastic import Exponential
from sim.pad import Cascade, Pad
from sim.relaxation import Relaxation
from tests.sim.effect_tools import AIR, GEL, LINEAR, K, active, ramp, sense, simulate


def test_a_surface_that_moves_once() -> None:
    t = np.linspace(0.0, 20.0, 2001)
    moves = active("contact_offset", "moved", offset=0.1, share=0.2, moved_at=8.0, within=0.05)
    force = simulate(LINEAR, [moves], t, np.full(t.size, 1.0))
    assert_allclose(force[[100, 800, 1900]], K * (1.0 - 0.1 * np.array([0.9, 1.0, 1.1])), rtol=1e-9)


def test_attraction_that_grows_and_falls_with_the_gap() -> None:
    pulls = active("adhesion", "smooth", pull_off=0.2, range=0.3)
    crest = 0.3 / 3.146193
    x = -np.array([0.0, 0.5 * crest, crest, 0.3, 3.0])
    force = simulate(LINEAR, [pulls], np.arange(5.0), x)
    assert_allclose(force, -0.2 * np.array([0.0, 0.5 * math.exp(0.5), 1.0, math.exp(-1.0), 0.0]), atol=1e-7)


def test_relaxation_that_changes_from_a_depth_on() -> None:
    t = np.linspace(0.0, 3.0, 3001)
    for depth, factor in ((0.7, 1.0), (1.0, 1.0), (2.0, 1.6), (3.0, 2.2)):
        later = active("depth_dependent_relaxation", "beyond", slope=0.4, begins=1.0 / 3.0, reach=3.0)
        pad = Pad(Exponential(K, 0.0), GEL, unilateral=True)
        quick = Pad(Exponential(K, 0.0), Relaxation(GEL.shares, tuple(factor * r for r in GEL.rates)), unilateral=True)
        x = np.full(t.size, depth)
        assert_allclose(simulate(pad, [later], t, x), simulate(quick, [], t, x), rtol=1e-9)


def test_play_that_a_film_fills_at_speed() -> None:
    film = active("backlash", "filled", gap=0.1, film=0.4, speed=10.0)
    x = np.concatenate([np.linspace(0.0, 2.0, 201), np.linspace(2.0, 1.0, 101)[1:]])
    for step_s, open_mm in ((1e-3, 0.1 * (1 - 0.4 * 10.0 / 20.0)), (1.0, 0.1 * (1 - 0.4 * 0.01 / 10.01))):
        _, probe = Cascade(LINEAR, [film]).probe(step_s * np.arange(x.size), x)
        assert_allclose(probe[:201], x[:201], atol=1e-12)
        assert_allclose(probe[-20:] - x[-20:], open_mm, rtol=1e-6)


def test_set_that_grows_with_each_cycle() -> None:
    x = np.concatenate([ramp(1.0, 101)] * 4)
    force = simulate(
        LINEAR, [active("permanent_set", "ratcheting", set=0.1, more=0.2)], np.arange(x.size, dtype=float), x
    )
    tops = np.flatnonzero(x == 1.0)
    assert_allclose(force[tops], K * (1.0 - 0.1 * (1.0 + 0.2 * np.log([1.0, 2.0, 3.0, 4.0]))), rtol=1e-12)


def test_a_mount_of_rubber_rings_as_its_equation_has_it() -> None:
    frequency, damping, ratio = 30.0, 0.12, 0.8
    omega = 2.0 * math.pi * frequency
    pole = ratio * omega
    zero = pole + 2.0 * damping * omega
    poles = np.polymul([1.0, pole], [1.0, 2.0 * damping * omega, omega**2])
    t = np.linspace(0.0, 0.3, 3001)
    force = np.interp(t, [0.0, 0.05, 0.06, 0.3], [0.0, 0.0, 2.0, 2.0])
    _, wanted, _ = lsim((np.array([1.0 / zero, 1.0]) * pole * omega**2, poles), force, t)
    mount = active("resonance", "mounted", frequency=frequency, damping_ratio=damping, ratio=ratio)
    assert_allclose(sense(mount, t, force), wanted, atol=1e-6)


def test_softening_that_levels_off_late() -> None:
    softens = active("stress_softening", "hyperbola", share=0.4, depth=0.5)
    x = np.array([0.0, 0.5, 2.0, 1.7, 1.4, 0.5, 2.0])
    left = [1.0, 1.0, 1.0, 0.8, 1.0 - 0.4 * 2.0 / 3.0, 1.0 - 0.4 * 5.0 / 6.0, 1.0]
    assert_allclose(simulate(LINEAR, [softens], np.arange(7.0), x), K * x * np.array(left), rtol=1e-12)


def test_softening_that_rest_takes_back() -> None:
    heals = active("stress_softening", "healing", share=0.4, depth=0.5, time_constant=8.0)
    t = np.array([0.0, 1.0, 1.0, 5.0, 17.0])
    x = np.array([0.0, 2.0, 1.0, 1.0, 1.0])
    below = np.exp(-np.array([0.0, 4.0, 16.0]) / 8.0)
    force = simulate(LINEAR, [heals], t, x)
    assert_allclose(force[2:], K * (1.0 + 0.4 * np.expm1(-below / 0.5)), rtol=1e-9)
    assert_allclose(force[1], K * 2.0)


def test_friction_that_swells_along_the_way() -> None:
    swells = active("friction", "swelling", coulomb=0.5, swell=0.3, turn=0.8, angle=0.4, presliding=1e-4)
    x = np.linspace(0.0, 2.0, 4001)
    level = 0.5 * (1 + 0.3 * np.sin(2 * math.pi * x / 0.8 + 0.4))
    force = simulate(AIR, [swells], np.arange(x.size, dtype=float), x)
    assert_allclose(force[10:], level[10:], rtol=2e-3)
    back = simulate(AIR, [swells], np.arange(x.size, dtype=float), x[::-1])
    assert_allclose(back[10:], -level[::-1][10:], rtol=2e-3)


@pytest.mark.parametrize("more", [0.6, -0.4])
def test_friction_over_a_tight_place(more: float) -> None:
    numbers = {"coulomb": 0.5, "more": more, "place": 0.8, "width": 0.2, "presliding": 1e-4}
    x = np.linspace(0.0, 2.0, 4001)
    level = 0.5 * (1 + more * np.exp(-(((x - 0.8) / 0.2) ** 2)))
    for way, sign in ((slice(None), 1.0), (slice(None, None, -1), -1.0)):
        force = simulate(AIR, [active("friction", "tight", **numbers)], np.arange(x.size, dtype=float), x[way])
        assert_allclose(force[10:], sign * level[way][10:], rtol=2e-3)
    assert_allclose(level[[0, -1]], 0.5, rtol=1e-6)


def test_a_line_lags_as_its_hyperbolic_cosine() -> None:
    tau, slow = 0.02, 2.0 * 0.02 * 4.0 / math.pi**2
    t = np.linspace(0.0, 0.4, 4001)
    force = sense(active("sensor_lag", "line", time_constant=tau), t, 3.0 * t)
    assert_allclose(3.0 * t[-1] - force[-1], 3.0 * tau, rtol=1e-3)
    odd = 2.0 * np.arange(40) + 1.0
    # after a jump at the first of two samples all poles of 1/cosh √(2 τ s) die away by themselves
    jump = sense(active("sensor_lag", "line", time_constant=tau), t, np.where(t > 0.0, 1.0, 0.0))
    left = sum(4.0 / math.pi * (-1.0) ** k / n * np.exp(-(n**2) * t / slow) for k, n in enumerate(odd))
    late = t > 0.01
    assert_allclose(1.0 - jump[late], left[late], atol=0.03)


def test_a_drift_of_two_bodies() -> None:
    t = np.array([0.0, 1e-4, 5.0, 1e6])
    drift = active("force_drift", "two_bodies", rate=0.02, time_constant=4.0, share=0.3, later=12.0)
    soon, late = 4.0 * (1.0 - np.exp(-t / 4.0)), 48.0 * (1.0 - np.exp(-t / 48.0))
    assert_allclose(sense(drift, t, np.zeros(4)), 0.02 * (0.3 * soon + 0.7 * late), atol=1e-12)


def test_a_delay_that_wanders() -> None:
    stamps = 5.0 + np.linspace(0.0, 40.0, 4001)
    waves = {f"wave_{k}": 0.0 for k in range(1, 13)} | {"wave_1": -0.2, "wave_4": 0.3}
    wanders = effect("force_delay").form("wandering")
    assert wanders.time_shift is not None
    late = stamps - wanders.time_shift({"delay": 0.004, "at_time": 20.0, **waves}, stamps)
    share = np.linspace(0.0, 1.0, 4001)
    assert_allclose(late, 0.004 * (1 - 0.2 * np.cos(math.pi * share) + 0.3 * np.cos(4 * math.pi * share)), atol=1e-12)
    assert_allclose(np.trapezoid(late, share), 0.004, rtol=1e-6)


def test_a_delay_that_changes_once() -> None:
    stamps = 5.0 + np.linspace(0.0, 40.0, 401)
    again = effect("force_delay").form("reconnected")
    assert again.time_shift is not None
    values = {"delay": 0.004, "changes": -0.25, "moved_at": 15.0, "within": 0.1}
    late = stamps - again.time_shift(values, stamps)
    assert_allclose(late[[0, 140, 150, 160, 400]], [0.004, 0.004, 0.0035, 0.003, 0.003], atol=1e-6)


def test_damage_that_goes_with_the_speed_of_loading() -> None:
    """A stroke of 1 mm at 40 mm/s costs twice as much as one at 10 mm/s, where it goes with the root of the speed."""
    t = np.array([0.0, 0.1, 0.2, 0.225, 1.0])
    x = np.array([0.0, 1.0, 0.0, 1.0, 1.0])
    worn = active("damage", "by_speed", rate=0.1, exponent=0.5, dead_band=0.0)
    pad = Pad(Exponential(1.0, 0.0), Relaxation(), unilateral=True)
    force = simulate(pad, [worn], t, x)
    assert_allclose(force[[1, 3, 4]], np.exp([-0.1, -0.3, -0.3]), rtol=1e-9)


def test_a_clock_that_loses_its_reference() -> None:
    stamps = 5.0 + np.linspace(0.0, 40.0, 401)
    held = effect("clock_skew").form("held")
    assert held.time_shift is not None
    late = stamps - held.time_shift({"skew": 200.0, "free_from": 0.25, "at_time": 20.0}, stamps)
    assert_allclose(late[[0, 50, 100, 250, 400]], [0.0, 0.0, 0.0, 0.004, 0.008], atol=1e-12)


def test_a_clock_that_is_set_once() -> None:
    stamps = 5.0 + np.linspace(0.0, 40.0, 401)
    values = {"skew": -200.0, "undone": 0.25, "set_at": 0.6, "at_time": 20.0}
    set_once = effect("clock_skew").form("set_once")
    assert set_once.time_shift is not None
    late = stamps - set_once.time_shift(values, stamps)
    # Of 4.8 ms that it has lost after 24 s a quarter is made up for.
    assert_allclose(late[[0, 100, 200, 280, 400]], [0.0, -2e-3, -4e-3, -5.6e-3 + 1.2e-3, -8e-3 + 1.2e-3], atol=1e-8)


def test_a_clock_whose_rate_wanders() -> None:
    stamps = 5.0 + np.linspace(0.0, 40.0, 4001)
    waves = {f"wave_{k}": 0.0 for k in range(1, 13)} | {"wave_1": -0.5, "wave_3": 0.8}
    wanders = effect("clock_skew").form("wandering")
    assert wanders.time_shift is not None
    late = stamps - wanders.time_shift({"skew": 150.0, "at_time": 20.0, **waves}, stamps)
    share = np.linspace(0.0, 1.0, 4001)
    rate = 150e-6 * (1 - 0.5 * np.cos(math.pi * share) + 0.8 * np.cos(3 * math.pi * share))
    assert_allclose(np.gradient(late, 0.01)[1:-1], rate[1:-1], atol=1e-9)
    assert_allclose(late[-1], 150e-6 * 40.0)


def test_a_filter_of_finite_response() -> None:
    t = np.linspace(0.0, 0.4, 4001)
    filtered = active("sensor_lag", "finite", time_constant=0.02, width=0.25)
    assert_allclose(sense(filtered, t, 3.0 * t)[500:], 3.0 * (t[500:] - 0.02), atol=1e-9)
    step = sense(filtered, t, np.where(t > 0.1 - 1e-9, 1.0, 0.0))
    assert_allclose(np.interp([0.114, 0.12, 0.1225, 0.126], t, step), [0.0, 0.5, 0.75, 1.0], atol=0.02)


def test_a_cell_that_drains_more_slowly_than_it_fills() -> None:
    t = np.linspace(0.0, 2.0, 20_001)
    force = np.interp(t, [0.0, 0.5, 1.0, 1.0001], [0.0, 1.0, 1.0, 0.0])
    out = sense(active("sensor_lag", "throttled", time_constant=0.02, uneven=0.3), t, force)
    assert_allclose(np.interp(0.4, t, out), 0.8 - 2.0 * 0.014, rtol=1e-6)
    assert_allclose(np.interp([1.0101, 1.0301], t, out), np.exp(-np.array([0.01, 0.03]) / 0.026), rtol=3e-3)


def test_friction_that_vibration_smooths() -> None:
    x = np.concatenate([np.linspace(0.0, 1.0, 101), np.full(10, 1.0), np.linspace(1.0, 0.0, 51)[1:]])
    smoothed = active("friction", "smoothed", coulomb=0.3, speed=2.0)
    force = simulate(AIR, [smoothed], 0.01 * np.arange(x.size), x)
    assert_allclose(force[1:101], 0.3 * math.tanh(0.5), rtol=1e-9)
    assert_allclose(force[101:111], 0.0, atol=1e-12)
    assert_allclose(force[111:], -0.3 * math.tanh(1.0), rtol=1e-9)


def test_friction_by_the_speed_alone() -> None:
    speeds = np.array([0.0, 0.05, 0.5, 4.0, -4.0, 0.0, -60.0])
    x = np.concatenate([[0.3], 0.3 + np.cumsum(0.01 * speeds)])
    told = active("friction", "by_speed", coulomb=0.2, static_ratio=1.5, stribeck_speed=2.0, viscous=1e-3, speed=0.1)
    force = simulate(AIR, [told], 0.01 * np.arange(x.size), x)
    level = 0.2 + 0.1 * np.exp(-((speeds / 2.0) ** 2))
    assert_allclose(force[1:], level * np.tanh(speeds / 0.1) + 1e-3 * speeds, atol=1e-12)


def test_cogging_of_edges_has_all_harmonics() -> None:
    x = np.arange(1000) / 1000 * 2.0
    edged = active("cogging", "edged", amplitude=0.2, period=2.0, phase=0.0, sharpness=0.5)
    spectrum = np.fft.rfft(simulate(AIR, [edged], np.arange(1000.0), x)) / 500
    assert_allclose(-spectrum.imag[1:6], 0.2 * 0.5 ** np.arange(5), rtol=1e-9)


def test_cogging_that_fades_in_time() -> None:
    t = np.linspace(0.0, 40.0, 401)
    x = np.linspace(0.0, 3.0, 401)
    warm = active("cogging", "warming", amplitude=0.2, period=2.0, phase=0.3, growth=-0.01, at_time=20.0)
    wanted = 0.2 * (1.0 - 0.01 * (t - 20.0)) * np.sin(math.pi * x + 0.3)
    assert_allclose(simulate(AIR, [warm], t, x), wanted, atol=1e-12)


def test_a_mass_in_oil_comes_late() -> None:
    """A move at steady acceleration: the share in oil is felt by 1 − e^(−t/τ)."""
    t = np.arange(0.0, 0.4, 2e-4)
    x = 0.5 * 200.0 * t**2
    numbers = {"mass": 0.2, "share": 0.4, "time_constant": 0.03, "window": 1e-3, "lead": 0.0}
    force = simulate(AIR, [active("inertia", "oiled", **numbers)], t, x)
    wanted = 0.2 * 0.2 * (0.6 + 0.4 * -np.expm1(-t / 0.03))
    late = (t > 0.01) & (t < 0.2)
    assert_allclose(force[late], wanted[late], rtol=0.02)


def test_a_mass_that_is_compensated_late() -> None:
    """A move at steady acceleration: m/(1 − c) is felt at first, and m in the end."""
    t = np.arange(0.0, 0.2, 2e-4)
    x = 0.5 * 200.0 * t**2
    numbers = {"mass": 0.1, "corrects": 0.5, "time_constant": 0.02, "window": 1e-3, "lead": 0.0}
    force = simulate(AIR, [active("inertia", "compensated", **numbers)], t, x)
    wanted = 0.1 * 0.2 * (2.0 + np.expm1(-t / 0.02))
    late = t > 0.005
    assert_allclose(force[late], wanted[late], rtol=0.02)


def test_a_zero_that_is_late_to_come_back() -> None:
    t = np.linspace(0.0, 40.0, 4001)
    force = np.where((t > 10.0) & (t <= 20.0), 4.0, 0.0)
    late = active("force_bias", "returning", bias=0.1, share=0.2, time_constant=5.0, at_force=4.0)
    zero = (sense(late, t, force) - force) / 0.1 - 1.0
    wanted = 0.2 * (np.array([0.0, -np.expm1(-1.0), -np.expm1(-2.0) * math.exp(-1.0)]) - 0.5)
    assert_allclose(np.interp([5.0, 15.0, 25.0], t, zero), wanted, atol=1e-3)


def test_play_of_what_works_loose() -> None:
    loose = active("backlash", "wearing", gap=0.1, growth=0.02, at_time=20.0)
    x = np.interp(np.arange(40.0), [0.0, 5.0, 10.0, 30.0, 35.0, 39.0], [0.0, 1.0, 0.0, 0.0, 1.0, 0.2])
    _, probe = Cascade(LINEAR, [loose]).probe(np.arange(40.0), x)
    assert_allclose((probe - x)[[4, 10, 35, 39]], [0.0, 0.1 * 0.8, 0.0, 0.1 * 1.38], atol=1e-12)


def test_an_encoder_whose_head_leans_under_load() -> None:
    x = np.linspace(-0.5, 2.0, 26)
    leans = effect("encoder_error").form("leaning")
    numbers = {"amplitude": 0.01, "period": 0.8, "phase": 0.3, "growth": 0.6, "power": 2.0, "reach": 2.0}
    block, vector = leans.blocks["report"], np.array(leans.vector(numbers))
    reported = np.array([block(0.0, here, np.zeros(1), vector) for here in x])
    size = 1.0 + 0.6 * ((np.maximum(x, 0.0) / 2.0) ** 2 - 0.5)
    assert_allclose(reported - x, 0.01 * size * np.sin(2 * math.pi * x / 0.8 + 0.3), atol=1e-12)


def test_a_taper_that_jams() -> None:
    """A stiff spring against it: the load goes up to 4 N, back to 1 N and on to 2 N."""
    jams = active("frame_compliance", "jamming", compliance=0.01, rubs=0.2)
    load = np.concatenate([np.linspace(0.0, 4.0, 41), np.linspace(4.0, 1.0, 31)[1:], np.linspace(1.0, 2.0, 11)[1:]])
    block, state = jams.form.blocks["frame"], np.zeros(1)
    gives = np.array([block(0.1, f, state, np.array([0.01, 0.2])) for f in load])
    out = 0.01 * np.minimum(4.0 * 0.8, load[41:71] * 1.2)
    assert_allclose(gives, np.concatenate([0.01 * 0.8 * load[:41], out, np.maximum(out[-1], 0.01 * 0.8 * load[71:])]))
    force = simulate(LINEAR, [jams], np.arange(81.0), ramp(1.0, 41))
    assert_allclose(force[:41], K / (1.0 + 0.8 * 0.01 * K) * np.linspace(0.0, 1.0, 41), rtol=1e-6, atol=1e-9)
    assert_allclose(force[60:], K / (1.0 + 1.2 * 0.01 * K) * np.linspace(0.5, 0.0, 21), rtol=1e-6, atol=1e-9)


def test_a_scale_of_fields_too_long_is_off_by_a_saw_tooth() -> None:
    x = np.arange(1000) / 1000 * 2.0
    form = effect("encoder_error").form("stitched")
    for sharpness in (0.6, -0.6, 0.0):
        numbers = {"amplitude": 0.01, "period": 2.0, "phase": 0.0, "sharpness": sharpness}
        block, vector = form.blocks["report"], np.array(form.vector(numbers))
        off = np.array([block(0.0, here, np.zeros(1), vector) for here in x]) - x
        harmonics = -np.fft.rfft(off).imag[1:6] / 500
        assert_allclose(harmonics, 0.01 * sharpness ** np.arange(5.0) / np.arange(1, 6), atol=1e-8)


def test_a_belt_creeps_with_all_the_way_there_has_been() -> None:
    x = ramp(3.0, 301)
    creeps = active("cogging", "creeping", amplitude=0.2, period=2.0, phase=0.3, creep=-0.1)
    way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(x)))])
    wanted = 0.2 * np.sin(math.pi * x + 0.3 - 0.1 * way)
    assert_allclose(simulate(AIR, [creeps], np.arange(float(x.size)), x), wanted, atol=1e-12)


def test_a_bias_of_a_drive_that_moves() -> None:
    t = np.arange(0.0, 6.0, 0.01)
    x = np.interp(t, [0.0, 1.0, 2.0, 4.0, 4.5, 6.0], [0.0, 0.0, 2.0, 2.0, -3.0, -3.0])
    bias = simulate(AIR, [active("force_bias", "in_motion", bias=-0.1, share=0.2)], t, x)
    assert_allclose(np.interp([0.5, 1.5, 3.0, 4.25, 5.5], t, bias), [-0.1, -0.12, -0.1, -0.12, -0.1], rtol=5e-3)


def test_what_leaves_a_sphere() -> None:
    pad = Pad(Exponential(K, 0.0), Relaxation(), unilateral=True)
    t = np.linspace(0.0, 4.0, 401)
    force = simulate(pad, [active("missing_relaxation_mode", "sphere", share=0.4, rate=0.5)], t, np.full(t.size, 1.0))
    n = np.arange(1.0, 2001.0)
    inside = np.array([6.0 / np.pi**2 * np.sum(np.exp(-(n**2) * 0.5 * s) / n**2) for s in t])
    assert_allclose(force[5:], K * (0.6 + 0.4 * inside[5:]), rtol=2e-3)
    assert force[0] == K


def test_a_pull_that_is_the_same_up_to_its_range() -> None:
    pulls = active("adhesion", "even", pull_off=0.2, range=0.5)
    x = np.concatenate([-np.linspace(0.0, 1.0, 11), -np.linspace(1.0, 0.0, 11)])
    force = simulate(LINEAR, [pulls], np.arange(22.0), x)
    away = np.round(-x, 6)
    assert_allclose(force, np.where(away < 0.5, -0.2, np.where(away > 0.5, 0.0, -0.1)), atol=2e-4)


def test_softening_that_is_less_on_the_way_back_in() -> None:
    x = np.interp(np.arange(701.0), [0.0, 200.0, 300.0, 500.0, 700.0], [0.0, 2.0, 1.0, 3.0, 2.0])
    soft = active("stress_softening", "two_ways", share=0.3, depth=0.5, again=0.6, within=0.1)
    factor = simulate(LINEAR, [soft], np.arange(x.size, dtype=float), x)[1:] / (K * x[1:])
    below = np.maximum.accumulate(x)[1:] - x[1:]
    out, back = np.s_[215:299], np.s_[315:399]
    assert_allclose(factor[:199], 1.0)
    assert_allclose(factor[out], 1.0 - 0.3 * -np.expm1(-below[out] / 0.5))
    assert_allclose(factor[back], 1.0 - 0.3 * 0.6 * -np.expm1(-below[back] / 0.5))
    assert_allclose(factor[400:499], 1.0)


def test_a_drift_that_a_device_sets_to_zero_at_times() -> None:
    t = np.linspace(0.0, 50.0, 5001)
    zero = sense(active("force_drift", "rezeroed", rate=0.002, every=20.0), t, np.zeros(t.size))
    assert_allclose(
        np.interp([0.0, 10.0, 19.9, 20.1, 35.0, 45.0], t, zero), 0.002 * np.array([0, 10, 19.9, 0.1, 15, 5])
    )


def test_a_cell_with_air_is_quicker_under_load() -> None:
    """Small steps at a high, at the stated and at no load: each ends as a lag of its own time does."""
    t = np.arange(0.0, 0.3, 0.0005)
    for level, times in ((0.0, math.exp(0.6)), (5.0, 1.0), (10.0, math.exp(-0.6)), (25.0, math.exp(-0.6))):
        force = level + 1e-4 * (t >= 0.1)
        loaded = active("sensor_lag", "loaded", time_constant=0.02, growth=-0.6, at_force=5.0)
        left = (level + 1e-4 - sense(loaded, t, force)[t > 0.1]) / 1e-4
        wanted = np.exp(-(t[t > 0.1] - 0.1) / (0.02 * times))
        assert_allclose(left, wanted, atol=0.03)
    assert_allclose(sense(loaded, t, np.full(t.size, 3.0)), 3.0)


def test_oil_that_thins_as_it_warms() -> None:
    """Small steps at the begin, in the middle and at the end: each ends as a lag of its own time does, or nearly."""
    lag = active("sensor_lag", "warming", time_constant=0.02, growth=-0.4, bend=0.2, at_time=30.0)
    for at, time in ((1e-9, math.exp(0.4 + 0.2)), (30.0, math.exp(-0.1)), (60.0, math.exp(-0.4 + 0.2))):
        t = np.r_[np.linspace(0.0, at, 50), at + np.arange(1, 400) * 0.0005]
        left = 1.0 - sense(lag, t, 1.0 * (t > at))[t > at]
        assert_allclose(left[1:], left[0] * np.exp(-(t[t > at] - t[t > at][0])[1:] / (0.02 * time)), atol=0.01)
    assert_allclose(sense(lag, t, np.full(t.size, 3.0)), 3.0)


def test_relaxation_that_follows_the_depth_late() -> None:
    block = effect("depth_dependent_relaxation").form("late").blocks["rate"]
    t = np.arange(0.0, 3.0, 0.01)
    depth, state, p = np.where(t < 1.5, np.clip(4.0 * t, -1.0, 2.0), -1.0), np.zeros(2), np.array([0.4, 0.3])
    factor = np.array([block(0.01 if s else 0.0, d, state, p) for s, d in zip(t, depth, strict=True)])
    felt = lsim(([1.0], [0.3, 1.0]), np.maximum(depth, 0.0), t)[1]
    assert_allclose(factor, 1.0 + 0.4 * felt, rtol=1e-6)


def test_a_flow_stress_by_the_logarithm_of_the_rate() -> None:
    """In the middle of ramps in and out; half as deep it is as much as the elastic force is there."""
    for speed in (2.0, 20.0, 80.0):
        step_s = 2.0 / (200.0 * speed)
        x = np.concatenate([np.linspace(0.0, 2.0, 201), np.linspace(2.0, 0.0, 201)[1:]])
        t = step_s * np.arange(x.size)
        flows = active("viscous_damping", "plastic", coefficient=0.01, linear_to=3.0, growth=0.8, at_depth=1.0)
        more = simulate(LINEAR, [flows], t, x) - K * x
        at_one = 0.01 * 20.0 * np.arcsinh(speed / 3.0) / np.arcsinh(20.0 / 3.0)
        half = np.expm1(0.4) / np.expm1(0.8)
        assert_allclose(more[[50, 100, 300, 350]], np.array([half, 1.0, -1.0, -half]) * at_one, rtol=1e-6)


def test_a_clamp_that_each_change_of_the_load_loosens() -> None:
    """Between 0 and 5 N, again and again; what is below a hundredth of 5 N slips nowhere."""
    block = effect("frame_compliance").form("loosening").blocks["frame"]
    load = np.concatenate(
        [np.interp(np.arange(601.0), 100.0 * np.arange(7), [0, 5, 0, 5, 0, 5, 0]), 0.04 * np.eye(50)[0]]
    )
    state, p = np.zeros(2), np.array([0.01, 0.2, 15.0, 5.0])
    gives = np.array([block(0.1, f, state, p) for f in load])
    # Of each way the first 0.05 N, or where it has turned 0.1 N, loosen nothing.
    changed = 4.95 + 4.9 * np.arange(5.0)
    crests = [100, 300, 500]
    assert_allclose(gives[crests], 0.01 * (1.0 + 0.2 * (changed[[0, 2, 4]] / 15.0 - 1.0)) * 5.0, rtol=1e-9)
    assert gives[0] == 0.0 and abs(state[1] - changed[4] - 4.9) < 1e-9


def test_softening_until_a_little_beyond_the_deepest_point() -> None:
    x = np.interp(np.arange(701.0), [0.0, 200.0, 300.0, 500.0, 600.0, 700.0], [0.0, 2.0, 1.0, 3.0, 2.99, 3.0])
    soft = active("stress_softening", "rejoining", share=0.3, depth=0.5, further=0.1)
    factor = simulate(LINEAR, [soft], np.arange(x.size, dtype=float), x)[1:] / (K * x[1:])
    assert_allclose(factor[:199], 1.0)
    back = np.s_[215:410]
    assert_allclose(factor[back], 1.0 - 0.3 * -np.expm1(-(2.2 - x[1:][back]) / 0.5))
    assert_allclose(factor[425:499], 1.0)
    # A fifteenth of the way that it takes, and not more than that further.
    assert_allclose(factor[-2:], 1.0 - 0.3 * -np.expm1(-(3.0 * (1.0 + 0.1 / 15.0) - x[-2:]) / 0.5))


def test_cogging_that_was_there_when_the_force_was_set_to_zero() -> None:
    x = np.linspace(-1.0, -3.0, 41)
    force = simulate(AIR, [active("cogging", "tared", amplitude=0.2, period=1.5, phase=0.4)], np.arange(41.0), x)
    wave = np.sin(2 * math.pi * x / 1.5 + 0.4)
    assert_allclose(force, 0.2 * (wave - wave[0]), atol=1e-14)


def test_an_encoder_error_that_the_touch_off_went_through() -> None:
    x = np.linspace(0.0, 2.0, 81)
    zeroed = active("encoder_error", "zeroed", amplitude=0.02, period=0.9, phase=1.1)
    plant = Cascade(LINEAR, [zeroed]).plant()
    reported = np.array([plant.reported_mm(float(here)) for here in x])
    assert reported[0] == 0.0
    assert_allclose(reported - x, 0.02 * (np.sin(2 * math.pi * x / 0.9 + 1.1) - math.sin(1.1)), atol=1e-15)


def test_softening_with_the_depth_over_the_deepest() -> None:
    x = np.array([0.0, 1.0, 0.5, 0.0, 2.0, 1.0, 0.5, 3.0])
    depth = 2.0 * (1.0 - math.exp(-1.0))  # below a reach of 2: then it goes in proportion
    softens = active("stress_softening", "relative", share=0.3, depth=depth, reach=2.0)
    force = simulate(LINEAR, [softens], np.arange(8.0), x)
    deepest = np.maximum.accumulate(x)
    assert_allclose(force[1:], K * x[1:] * (1.0 - 0.3 * (1.0 - x[1:] / deepest[1:])), rtol=1e-12)
    at_once = active("stress_softening", "relative", share=0.3, depth=2.0 * (1.0 - math.exp(-0.5)), reach=2.0)
    force = simulate(LINEAR, [at_once], np.arange(8.0), x)  # and with a square
    assert_allclose(force[1:], K * x[1:] * (1.0 - 0.3 * (1.0 - (x[1:] / deepest[1:]) ** 2)), rtol=1e-12)
