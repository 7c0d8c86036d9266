"""The eighth shapes of what lies between the motor and the pad against closed forms."""

from math import erf

import numpy as np
import pytest

from .cases import draw_case
from .effects.eighth_machine import Curled, _power_creep, _rate_and_state, _slip_weakens
from .laws import Power
from .motion import Path
from .sets import shapes_of
from .test_truth_effects import SHORT, hidden

pytestmark = pytest.mark.long

OTHERS = ("friction", "adhesion", "viscous_damping", "stress_softening", "damage")
FRAMES = ("printed", "clamp_loosens")


def test_they_are_of_the_eighth():
    assert set(FRAMES) <= set(shapes_of("frame_compliance", "eighth"))
    for id in ("backlash", "friction", "inertia", "cogging", "encoder_error"):
        assert len(shapes_of(id, "eighth")) >= 2


def power_of_time(t, force, power, at):
    """∫ (t − s)^n dF(s) at some times, the sum over the steps of the force, each at its middle."""
    middle, steps = (t[1:] + t[:-1]) / 2, np.diff(force)
    return np.array([np.sum(steps[middle < s] * (s - middle[middle < s]) ** power) for s in at])


def test_creep_by_a_power_of_time():
    force = np.concatenate([[0.0, 0.0], np.ones(200_000)])
    for power in (0.15, 0.3):
        crept = _power_creep(force, 1e-4, power)
        for t in (0.003, 0.05, 1.0, 18.0):
            assert crept[1 + round(t / 1e-4)] == pytest.approx(t**power, rel=0.01)


@pytest.mark.parametrize("seed", range(3))
def test_a_frame_that_is_printed(seed):
    motion = Path(-0.5).to(1.6, 40.0).hold(3.0).to(0.7, 40.0).hold(2.0).motion()
    fine, told, _ = hidden("frame_compliance", "printed", 2.0, motion=motion, seed=seed)
    at = np.array([0.1, 0.3, 0.8, 1.5, 2.5, 3.3, 4.0, 5.0])
    given = np.interp(at, fine.time_s, fine.reported_mm - fine.probe_mm)
    best = []
    for power in np.linspace(0.1, 0.35, 126):
        parts = np.stack([fine.at(at, "cell_N"), power_of_time(fine.time_s, fine.cell_N, power, at)], axis=1)
        found = np.linalg.lstsq(parts, given, rcond=None)[0]
        best.append((float(np.max(np.abs(parts @ found - given))), power, found))
    off, power, (at_once, late) = min(best, key=lambda one: one[0])
    assert off < 2e-3 * np.max(given) and 0.145 <= power <= 0.305
    # After 1 s of any constant force.
    assert at_once + late == pytest.approx(told["compliance"], rel=5e-3)
    assert 0.18 <= late / told["compliance"] <= 0.37


@pytest.mark.parametrize("seed", range(3))
def test_a_clamp_that_works_loose(seed):
    fine, told, _ = hidden("frame_compliance", "clamp_loosens", 2.0, seed=seed)
    loaded, way = fine.cell_N > 0.1, np.cumsum(np.abs(np.diff(fine.cell_N, prepend=0.0)))
    softness = ((fine.reported_mm - fine.probe_mm)[loaded] / fine.cell_N[loaded]) / told["compliance"]
    assert np.allclose(softness, 0.8 + 0.4 * (way / way[-1])[loaded], atol=1e-5)
    assert softness[0] == pytest.approx(0.8, abs=0.02) and softness[-1] > 1.15


@pytest.mark.parametrize("shape", FRAMES)
@pytest.mark.parametrize("other", [*OTHERS[:2], *(pytest.param(other, marks=pytest.mark.long) for other in OTHERS[2:])])
def test_the_frame_goes_with_other_effects(shape, other):
    shapes = {"frame_compliance": shape, other: shapes_of(other, "first")[0]}
    plain = {"motion": SHORT, "rate_hz": 500.0, "law": "power", "contact": "unilateral"}
    truth = draw_case(7, ("frame_compliance", other), 1.0, shapes, **plain).truth
    fine, compliance = truth.fine, truth.parameters["frame_compliance"]["compliance"]
    given, loaded = fine.reported_mm - fine.probe_mm, fine.cell_N > 0.3 * truth.drawn.force_N
    assert np.all(np.isfinite(fine.cell_N)) and loaded.any()
    if shape == "clamp_loosens":
        way = np.cumsum(np.abs(np.diff(fine.cell_N, prepend=fine.cell_N[0])))
        wanted = compliance * (0.8 + 0.4 * way / way[-1]) * fine.cell_N
        # But for the step in which it lets go.
        assert np.sum(np.abs(given - wanted) > 1e-6) < 5
    else:
        assert np.mean(np.abs(given[loaded] / (compliance * fine.cell_N[loaded]) - 1) < 0.34) > 0.9


@pytest.mark.parametrize("seed", range(3))
def test_a_nut_with_a_spring(seed):
    motion = Path(-0.5).to(2.0, 5.0).to(-0.5, 5.0).motion()
    fine, told, _ = hidden("backlash", "sprung_nut", motion=motion, seed=seed)
    load, lost = 3 * fine.reported_mm, (fine.probe_mm - fine.reported_mm) / told["gap"]
    v = motion.velocity(fine.time_s)
    assert np.all(np.abs(lost[v > 0]) < 1e-9)
    back = (v < -1) & (fine.reported_mm < 1.9)
    opens, whole = np.max(load[back & (lost < 1e-6)]), np.min(load[back & (lost > 1 - 1e-6)])
    preload = (opens + whole) / 2
    assert 0.2 <= preload / 6 <= 0.4 and opens / preload == pytest.approx(0.8, abs=2e-3)
    between = back & (load > opens) & (load < whole)
    assert np.allclose(lost[between], (load[between] - opens) / (whole - opens), atol=2e-3)
    assert np.all(np.abs(lost[back & (load < opens)]) < 1e-6) and np.all(lost[back & (load > whole)] > 1 - 1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_teeth_that_are_not_alike(seed):
    motion = Path(-0.5).to(4.0, 5.0).to(-2.0, 5.0).motion()
    fine, told, _ = hidden("backlash", "teeth", motion=motion, seed=seed)
    back = (motion.velocity(fine.time_s) < -4) & (fine.reported_mm < 3.9)
    x, lost = fine.reported_mm[back][::-1], (fine.probe_mm - fine.reported_mm)[back][::-1] / told["gap"]
    even = np.abs(np.diff(lost)) < 1e-9
    changes = np.flatnonzero(np.diff(even.astype(int)) != 0)
    begins, ends = (x[changes[even[changes] == kind]] for kind in (True, False))
    begins, ends = begins[begins < ends[-1]], ends[ends > begins[0]]
    middles = (begins + ends) / 2
    pitch = np.mean(np.diff(middles))
    assert 0.3 <= pitch <= 0.9 and np.allclose(np.diff(middles), pitch, atol=2e-3)
    assert np.allclose(ends - begins, 0.1 * pitch, atol=4e-3)
    widths = np.interp((middles[1:] + middles[:-1]) / 2, x, lost)
    used = (middles[1:] > 0) & (middles[:-1] < 2.0)
    assert np.mean(widths[used]) == pytest.approx(1.0, abs=1e-6) and np.std(widths) > 0.1
    assert np.all(widths / np.mean(widths) > 0.5) and np.max(widths) / np.min(widths) <= 1.4 / 0.6


def test_a_sample_that_is_curled():
    law, square = Curled(Power(3.0, 0.0), 0.02, 2.0), Curled(Power(2.0, 1.0), 0.02, 2.0)
    # Two springs in series, up to the 0.04 N at which it lies; from there on the pad alone.
    lies = 0.04 * (1 / 2.0 + 1 / 3.0)
    for depth in (0.1 * lies, 0.5 * lies, 0.999 * lies):
        assert law.force(depth) == pytest.approx(depth / (1 / 2.0 + 1 / 3.0), rel=2e-3)
    assert law.force(1.001 * lies) == pytest.approx(0.04, rel=5e-3) and law.force(1.0) == pytest.approx(3 * 0.98)
    for force in (0.004, 0.01, 0.03):
        assert square.force(force / 2.0 + np.sqrt(force)) == pytest.approx(force, rel=2e-3)
    assert square.force(0.9) == pytest.approx(0.88**2) and law.force(0.0) == 0 and law.force(-0.1) == 0
    for seed in (0, 1, 2):
        fine, told, build = hidden("contact_offset", "curled", motion=Path(1.0).hold(0.1).motion(), seed=seed)
        assert 1.0 - fine.force_N[-1] / 3.0 == pytest.approx(told["offset"])
        assert 0 < build.plant.pad.law.lift <= 0.03 and 0.2 <= build.plant.pad.law.bends / 6 <= 0.5


def felt(build, x, v=0.0, a=0.0, t=None):
    t = 1e-4 * np.arange(len(x)) if t is None else t
    return build.plant.felt[0](t, x, np.broadcast_to(v, x.shape), np.broadcast_to(a, x.shape))


def test_friction_that_is_more_at_first():
    # 0.3 mm, a rest, 0.3 mm on, and back.
    x = np.concatenate([np.linspace(0, 0.3, 3001), np.full(500, 0.3), np.linspace(0.3, 0.6, 3001)])
    x = np.concatenate([x, np.linspace(0.6, 0.0, 6001)])
    force = _slip_weakens(x, 0.001, 0.5, 0.03)
    for begin, side in ((0, 1), (3501, 1), (6502, -1)):
        part = side * force[begin : begin + 3000]
        top = int(np.argmax(part))
        assert part[top] == pytest.approx(1.5, rel=0.01)
        # From the top on  F − 1 = f e^{−s/ℓ}, s the way less what the spring has given back.
        way = np.arange(3000) * 1e-4
        slipped = way - way[top] + 0.001 * (part[top] - part)
        after = slice(top + 1, top + 600)
        wanted = (part[top] - 1) * np.exp(-slipped[after] / 0.03)
        assert np.allclose(part[after] - 1, wanted, atol=2e-3)
    assert force[3000] == pytest.approx(1.0, abs=1e-3) and np.all(force[3001:3501] == force[3000])
    for seed in range(3):
        _, told, build = hidden("friction", "slip_weakens", seed=seed)
        force = felt(build, np.linspace(-1.5, -1.0, 50_001)) / told["coulomb"]
        assert force[-1] == pytest.approx(1.0, abs=1e-3) and 1.28 <= np.max(force) <= 1.8
        top = np.argmax(force)
        falls = 1e-5 * np.argmax(force[top:] - 1 < (force[top] - 1) / np.e)
        assert 0.009 <= falls <= 0.053


def test_friction_by_rate_and_state():
    def level(speeds, ways, rest_s=0.0):
        pieces = [v * 1e-4 * np.ones(round(way / v / 1e-4)) for v, way in zip(speeds, ways, strict=True)]
        pieces.insert(1, np.zeros(round(rest_s / 1e-4)))
        return _rate_and_state(np.cumsum(np.concatenate([[0.0], *pieces])), 1e-4, 0.015, 0.035, 0.01)

    for speed in (0.1, 1.0, 10.0):
        # Steady: 1 − (b − a) ln v.
        assert level([speed], [0.3])[-1] == pytest.approx(1 - 0.02 * np.log(speed), abs=1e-6)
    # From 1 to 10 mm/s: more at once by a ln 10, and from there θ goes over by e^{−s/ℓ} from ℓ to a tenth.
    quick = level([1.0, 10.0], [0.2, 0.2])
    before = round(0.2 / 1e-4)
    for way in (0.001, 0.005, 0.02):
        theta = 0.1 + 0.9 * np.exp(-way / 0.01)
        wanted = 1 + 0.015 * np.log(10) + 0.035 * np.log(theta)
        assert quick[before + round(way / 1e-3)] == pytest.approx(wanted, abs=1e-6)
    # A rest of 2 s makes θ of 10 ms  10 s − 9.99 s e^{−2/10}.
    rested = level([1.0, 1.0], [0.2, 0.001], 2.0)
    assert rested[before + 20_000] == pytest.approx(1 + 0.015 * np.log(1e-3) + 0.035 * np.log(1.8209 / 0.01), abs=1e-5)
    _, told, build = hidden("friction", "rate_and_state")
    steady = []
    for speed in (1.0, 10.0, 50.0):
        n = round(0.5 / speed / 1e-4)
        steady.append(felt(build, -1 + speed * 1e-4 * np.arange(n + 1))[-1] / told["coulomb"])
    weakens = (steady[0] - np.array(steady[1:])) / np.log([10.0, 50.0])
    assert steady[0] == pytest.approx(1.0) and np.ptp(weakens) < 1e-5 and 0.01 <= weakens[0] <= 0.03


@pytest.mark.parametrize("seed", range(3))
def test_grease_that_is_cold(seed):
    _, told, build = hidden("friction", "cold_grease", seed=seed)
    t = np.linspace(0, SHORT.duration_s, 40_001)
    x = np.interp(np.arange(40_001), 400 * np.arange(101), np.resize([-1.0, -0.5], 101))
    level = np.abs(felt(build, x, t=t))[399::400] / told["coulomb"]
    steps = np.diff(level[:81:20])
    kept = steps[1] / steps[0]
    tau, falls = -0.2 / np.log(kept), -steps[0] / (1 - kept)
    assert steps[3] / steps[2] == pytest.approx(kept, rel=1e-6) and 0.19 <= tau <= 0.51
    last, whole = level[0] - falls, falls * np.exp(0.01 / tau)
    assert 0.4 <= last / (last + whole) <= 0.6
    # Over the whole of the time.
    assert last + whole * tau * -np.expm1(-1 / tau) == pytest.approx(1.0, abs=2e-3)


@pytest.mark.parametrize("seed", range(3))
def test_liquid_that_is_taken_along(seed):
    _, told, build = hidden("inertia", "bath", seed=seed)
    t = 1e-4 * np.arange(200_000)
    more = felt(build, t, 0.0, np.where(t >= 1e-4, 1.0, 0.0)) / (1e-3 * told["mass"]) - 1
    # Under an even acceleration √(T/τ) erf √(t/T).
    whole = more[-1]
    tries = np.linspace(0.25, 1.1, 1701)
    (ends,) = tries[[np.argmin([abs(erf(np.sqrt(0.1 / T)) - more[1000] / whole) for T in tries])]]
    for s in (0.003, 0.01, 0.03, 0.3, 1.0):
        assert np.interp(s, t, more) / whole == pytest.approx(erf(np.sqrt(s / ends)), abs=0.01)
    assert 0.29 <= ends <= 1.01 and 0.19 <= ends / whole**2 <= 1.01
    # As it stops, what is sheared goes on to pull.
    pushed = felt(build, t, 0.0, np.where((t > 0.1) & (t < 0.11), 1.0, 0.0)) / (1e-3 * told["mass"])
    assert pushed[1050] > 1 and pushed[1200] > 0 > pushed[1200] - pushed[1110]


@pytest.mark.parametrize("seed", range(3))
def test_what_a_correction_leaves(seed):
    _, told, build = hidden("inertia", "compensated", seed=seed)
    t = 1e-4 * np.arange(4000)
    left = felt(build, t, 0.0, np.where(t > 0.1, 1.0, 0.0)) / (1e-3 * told["mass"])
    assert np.all(left[:1000] == 0) and left[-1] == pytest.approx(1.0, abs=1e-6)
    since, more = t[1005:1100] - 0.1, np.log(left[1005:1100] - 1)
    slope, start = np.polyfit(since, more, 1)
    # (1 − k + k e^{−t/τ})/(1 − k).
    assert np.allclose(start + slope * since, more, atol=1e-6) and 0.002 <= -1 / slope <= 0.006
    assert 0.35 <= np.exp(start) / (1 + np.exp(start)) <= 0.6


def phasor(wave, x, period):
    return 2j * np.mean(wave * np.exp(-2j * np.pi * x / period))


@pytest.mark.parametrize("seed", range(3))
def test_ripple_of_solid_iron(seed):
    _, told, build = hidden("cogging", "eddy_currents", seed=seed)
    period = told["period"]
    x = np.linspace(-20 * period, 0, 40_000, endpoint=False)
    parts = [phasor(felt(build, x, v), x, period) for v in (0.0, 10.0, 60.0, -60.0)]
    assert np.abs(parts[0]) == pytest.approx(told["amplitude"], rel=1e-6)
    late = parts[0] / np.array(parts[1:]) - 1
    # 1 + i ω τ.
    tau = late.imag / (2 * np.pi * np.array([10.0, 60.0, -60.0]) / period)
    assert np.allclose(late.real, 0, atol=1e-9) and np.allclose(tau, tau[0]) and 0.003 <= tau[0] <= 0.01


@pytest.mark.parametrize("seed", range(3))
def test_ripple_of_current_sensors(seed):
    _, told, build = hidden("cogging", "current_sensors", seed=seed)
    period = told["period"]
    parts = []
    for begin in (-20 * period, 3.0):  # in air, and beyond the greatest load by a fifth
        x = begin + np.linspace(0, 20 * period, 40_000, endpoint=False)
        parts.append([np.abs(phasor(felt(build, x), x, period / n)) / told["amplitude"] for n in (1, 2, 3)])
    air, load = parts
    assert air == pytest.approx([1.0, 0.0, 0.0], abs=1e-6) and load[0] == pytest.approx(1.0, abs=1e-6)
    assert 0.6 <= load[1] / 1.2 <= 1.2 and load[2] < 1e-6


@pytest.mark.parametrize("seed", range(3))
def test_a_loop_that_is_slow(seed):
    taus = []
    for speed, length in ((5.0, 3.0), (60.0, 24.0)):
        motion = Path(-30.0, np.inf).to(-30.0 + length, speed).motion()
        fine, told, _ = hidden("encoder_error", "slow_loop", 0.05, motion=motion, seed=seed)
        x, period = motion.position(fine.time_s), told["period"]
        waves = np.stack([f(2 * np.pi * x / period) for f in (np.sin, np.cos)], axis=1)
        settled = (x > -30 + length / 4) & (fine.time_s < motion.duration_s)
        sizes = []
        for off in (fine.reported_mm - x, fine.probe_mm - x, fine.reported_mm - fine.probe_mm):
            found = np.linalg.lstsq(waves[settled], off[settled], rcond=None)[0]
            sizes.append(np.hypot(*found) / told["amplitude"])
        # i ω τ to 1 between what is reported wrong and what goes wrong.
        taus.append(sizes[0] / sizes[1] * period / (2 * np.pi * speed))
        assert sizes[2] == pytest.approx(1.0, rel=0.01) and np.hypot(*sizes[:2]) == pytest.approx(1.0, rel=0.01)
    assert taus[0] == pytest.approx(taus[1], rel=0.02) and 0.002 <= taus[1] <= 0.0081


@pytest.mark.parametrize("seed", range(3))
def test_an_interpolator_that_sets_itself(seed):
    _, told, build = hidden("encoder_error", "sets_itself", seed=seed)
    period = told["period"]
    x = np.interp(np.arange(40_001), 1000 * np.arange(41), np.resize([-2 * period, 0.0], 41))
    error = (build.plant.encoder[0](x, x) - x)[:40_000].reshape(40, 1000) / told["amplitude"]
    back = np.exp(-2j * np.pi * x[:40_000].reshape(40, 1000) / period)
    level = 2 * np.abs(np.mean(error * back, axis=1))
    assert np.mean(level) == pytest.approx(1.0, abs=1e-2)
    steps = np.diff(level[:40:10])
    kept = steps[1] / steps[0]
    length = -0.25 / np.log(kept)
    falls = -steps[0] / (1 - kept)
    assert steps[2] / steps[1] == pytest.approx(kept, rel=0.03) and 0.14 <= length <= 0.42
    last, whole = level[0] - falls, falls * np.exp(0.0125 / length)
    assert 0.18 <= last / (last + whole) <= 0.42
