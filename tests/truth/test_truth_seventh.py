"""The seventh shapes of what lies between the motor and the pad against closed forms."""

import numpy as np
import pytest

from .cases import draw_case
from .effects.seventh_machine import Coned, _oiled, _power_elements
from .laws import Power
from .motion import Path
from .sets import shapes_of
from .test_truth_effects import SHORT, hidden

pytestmark = pytest.mark.long


@pytest.mark.parametrize("seed", range(3))
def test_a_rod_that_is_bowed(seed):
    fine, told, build = hidden("frame_compliance", "bowed_rod", 2.0, seed=seed)
    given, force = fine.reported_mm - fine.probe_mm, fine.cell_N
    loaded = force > 0.05
    n = build.plant.numbers
    buckles, share, first = n["frame_force_N"], n["frame_late_share"], n["frame_mm_N"]
    # C ((1 − s) + s (1 − F/2P)/(1 − F/P)²) is the same law with F taken out.
    left = 1 - force[loaded] / buckles
    softness = first * (1 - share + share * (1 + left) / 2 / left**2)
    assert np.allclose(given[loaded] / force[loaded], softness, rtol=1e-5)
    assert np.interp(3.6, np.sort(force[loaded]), np.sort(given[loaded])) / 3.6 == pytest.approx(
        told["compliance"], rel=1e-3
    )
    assert 12 <= buckles <= 24 and 0.33 <= share <= 0.67 and np.all(np.diff(softness[np.argsort(force[loaded])]) >= 0)


@pytest.mark.parametrize("seed", range(3))
def test_a_taper_that_jams(seed):
    motion = Path(-0.5).to(1.9, 5.0).to(0.3, 5.0).to(1.2, 5.0).motion()
    fine, told, _ = hidden("frame_compliance", "taper", 2.0, motion=motion, seed=seed)
    given, v = fine.reported_mm - fine.probe_mm, motion.velocity(fine.time_s)
    softness = given / np.where(fine.cell_N > 0.05, fine.cell_N, np.inf)
    goes_in = (v > 1) & (fine.time_s < 0.4) & (softness > 0)
    goes_out = (v < -1) & (softness > 0) & (fine.reported_mm < 0.9)
    ways = [np.median(softness[some]) for some in (goes_in, goes_out)]
    assert np.allclose(softness[goes_in], ways[0], rtol=1e-6) and np.allclose(softness[goes_out], ways[1], rtol=1e-6)
    assert np.mean(ways) == pytest.approx(told["compliance"], rel=1e-6)
    assert 0.1 <= (ways[1] - ways[0]) / (ways[1] + ways[0]) <= 0.25
    # Stuck until the force has fallen by as much.
    turn = np.flatnonzero(v < -1)[0]
    stuck = (v < -1) & (fine.cell_N > 1.01 * fine.cell_N[turn] * ways[0] / ways[1])
    assert stuck.sum() > 50 and np.ptp(given[stuck]) < 1e-6


@pytest.mark.parametrize("shape", shapes_of("frame_compliance", "seventh"))
@pytest.mark.parametrize("other", ["friction", "adhesion", "viscous_damping", "stress_softening", "damage"])
def test_the_frame_goes_with_other_effects(shape, other):
    shapes = {"frame_compliance": shape, other: shapes_of(other, "seventh")[0]}
    plain = {"motion": SHORT, "rate_hz": 500.0, "law": "power", "contact": "unilateral"}
    truth = draw_case(7, ("frame_compliance", other), 1.0, shapes, **plain).truth
    fine, compliance = truth.fine, truth.parameters["frame_compliance"]["compliance"]
    given, loaded = fine.reported_mm - fine.probe_mm, fine.cell_N > 0.3 * truth.drawn.force_N
    assert np.all(np.isfinite(fine.cell_N)) and loaded.any()
    assert np.mean(np.abs(given[loaded] / (compliance * fine.cell_N[loaded]) - 1) < 0.34) > 0.9


@pytest.mark.parametrize("seed", range(3))
def test_two_meshes_and_a_shaft(seed):
    motion = Path(-0.5).to(-1.5, 2.0).to(-0.5, 2.0).motion()
    fine, told, _ = hidden("backlash", "two_meshes", motion=motion, seed=seed)
    x, lost, gap = fine.reported_mm, fine.probe_mm - fine.reported_mm, told["gap"]
    turn = int(np.argmin(x))
    way = -0.5 - x[:turn]
    # It opens by the way, waits, opens again, and stays.
    opens = np.diff(lost[:turn]) / np.maximum(np.diff(way), 1e-12) > 0.5
    assert lost[turn] == pytest.approx(gap) and np.sum(opens * np.diff(way)) == pytest.approx(gap, rel=0.05)
    rests = np.flatnonzero(np.abs(np.diff(np.flatnonzero(opens))) > 1)
    (pause,) = (np.flatnonzero(opens)[rests[0] + 1] - np.flatnonzero(opens)[rests[0]],)
    first = lost[np.flatnonzero(opens)[rests[0]] + 1] / gap
    assert 0.38 <= first <= 0.62 and 0.9 <= pause * 2e-4 / gap <= 2.6 and len(rests) == 1
    assert lost[-2] == pytest.approx(0.0, abs=1e-9) and np.all(lost[turn:] <= gap + 1e-9)


def test_a_film_that_is_squeezed_out():
    still = _oiled(np.concatenate([np.linspace(0, 50, 2001), np.full(40_000, 50.0)]), 1e-4, 0.5, 0.1)
    begin, after = still[2000], 1e-4 * np.arange(40_001)
    assert begin > 0.95
    assert np.allclose(still[2000:], begin / np.sqrt(1 + begin**2 * after / 0.1), rtol=1e-6)
    slow = Path(-0.5).to(-2.5, 2.0).hold(5.0).to(-2.4, 0.02).motion()
    fine, told, _ = hidden("backlash", "squeezed_out", motion=slow)
    lost = (fine.probe_mm - fine.reported_mm) / told["gap"]
    moving = np.interp(0.9, fine.time_s, lost)
    assert 0.6 <= moving < 0.97 and np.all(lost <= 1 + 1e-9)
    dry = Path(-0.5).to(-0.7, 0.05).motion()
    fine, told, _ = hidden("backlash", "squeezed_out", motion=dry)
    assert (fine.probe_mm - fine.reported_mm)[-2] == pytest.approx(told["gap"], rel=0.06)


def test_a_face_that_is_a_cone():
    law, rise = Coned(Power(3.0, 0.0), 0.024), 0.024
    for depth in (0.004, 0.012, 0.02):
        # 3 ∫ (δ − r s) 2 s ds up to where it is met.
        assert law.force(depth) == pytest.approx(depth**3 / rise**2, rel=1e-2)
    assert law.force(1.0) == pytest.approx(3 * (1.0 - 2 * rise / 3)) and law.force(0.0) == 0
    for seed in (0, 1, 2):
        fine, told, _ = hidden("contact_offset", "coned", motion=Path(1.0).hold(0.1).motion(), seed=seed)
        assert 1.0 - fine.force_N[-1] / 3.0 == pytest.approx(told["offset"])


def felt(build, x, v=0.0, a=0.0, t=None):
    t = 1e-4 * np.arange(len(x)) if t is None else t
    return build.plant.felt[0](t, x, np.broadcast_to(v, x.shape), np.broadcast_to(a, x.shape))


@pytest.mark.parametrize("seed", range(3))
def test_balls_that_roll_before_they_slide(seed):
    ends, shares = _power_elements(0.6)
    for s in (0.05, 0.3, 0.75, 1.0):
        assert np.sum(shares * np.minimum(s / ends, 1.0)) == pytest.approx(s**0.6)
    _, told, build = hidden("friction", "rolling", seed=seed)
    x = np.concatenate([np.linspace(-1.0, -0.7, 3001), np.linspace(-0.7, -1.0, 3001)])
    force = felt(build, x) / told["coulomb"]
    assert force[3000] == pytest.approx(1.0) and force[-1] == pytest.approx(-1.0)
    length = 1e-4 * np.argmax(force > 1 - 1e-9)
    assert 0.039 < length < 0.122
    first, second = (np.interp(part * length, 1e-4 * np.arange(3001), force[:3001]) for part in (0.2, 0.6))
    power = np.log(second / first) / np.log(3.0)
    assert 0.48 < power < 0.72 and first == pytest.approx(0.2**power, rel=5e-3)
    # After a turn from 1 to −1 the same curve, twice as far and twice as high.
    back = force[3001:]
    assert np.interp(2 * 0.6 * length, 1e-4 * np.arange(3001), back) == pytest.approx(1 - 2 * second, abs=5e-3)


def test_friction_that_comes_late_behind_the_speed():
    _, told, build = hidden("friction", "comes_late")
    levels, speeds = [], np.array([0.2, 2.0, 4.0, 8.0, 400.0])
    for speed in speeds:
        levels.append(felt(build, np.linspace(-1, -0.5, 4001), speed)[-1] / told["coulomb"])
    more = 1 / (np.array(levels) - 1)
    # 1/(level − 1) is straight in v².
    slope, start = np.polyfit(speeds[:4] ** 2, more[:4], 1)
    assert np.allclose(start + slope * speeds[:4] ** 2, more[:4], rtol=1e-5) and levels[-1] < 1.01
    assert 0.2 <= 1 / start <= 0.6 and 1.0 <= np.sqrt(start / slope) <= 8.0
    x = np.linspace(-1, -0.5, 4001)
    v = np.where(np.arange(4001) < 2000, 0.5, 200.0)
    force = felt(build, x, v)
    falls = np.flatnonzero(np.abs(np.diff(force[1000:])) > 1e-6)[0] + 1000
    assert 28 <= falls - 2000 <= 101


def test_a_grease_that_yields():
    _, told, build = hidden("friction", "yield_stress")
    speeds = np.array([0.1, 1.0, 10.0, 100.0])
    levels = [felt(build, np.linspace(-1, -0.5, 2001), v)[-1] / told["coulomb"] for v in speeds]
    steps = np.diff(np.log(np.array(levels) - 1)) / np.log(10.0)
    assert np.ptp(steps) < 1e-6 and 0.4 <= steps[0] <= 0.6
    assert 100 <= 100 * (levels[-1] - 1) ** (-1 / steps[0]) <= 300


@pytest.mark.parametrize("seed", range(3))
def test_a_cover_of_sheets(seed):
    _, told, build = hidden("inertia", "sheet_cover", seed=seed)
    x, mass = np.linspace(-0.5, 2.0, 5001), 1e-3 * told["mass"]
    bears = felt(build, x, 0.0, 1.0) / mass
    inside = x >= 0
    assert np.mean(bears[inside]) == pytest.approx(1.0, abs=2e-3) and 0.4 <= bears[0] <= 0.7
    assert bears[0] + bears[-1] == pytest.approx(2.0)
    for speed in (10.0, 40.0):
        taken = felt(build, x, speed) / mass
        # The impulse of what is taken along, over all of the way: ∫ m' v² dx/v.
        assert np.sum(taken) * 5e-4 / speed == pytest.approx((bears[-1] - bears[0]) * speed, rel=0.01)
    assert np.all(felt(build, x, -40.0) == 0)
    assert len(np.flatnonzero(np.diff((taken > 0).astype(int)) > 0)) in (4, 5, 6)


@pytest.mark.parametrize("seed", range(3))
def test_an_arm_that_swings(seed):
    _, told, build = hidden("inertia", "arm", seed=seed)
    t = 1e-4 * np.arange(30_000)
    step = felt(build, t, 0.0, np.where(t > 0.1, 1.0, 0.0)) / (1e-3 * told["mass"])
    rest = step[1001]
    assert step[-1] == pytest.approx(1.0, abs=1e-3) and 1 - 0.8 < rest < 1 - 0.38
    # What swings: the first mode has 0.613 of what the three have, 0.866.
    ring, at = step[1000:21_000] - 1, np.fft.rfftfreq(20_000, 1e-4)
    lines = np.abs(np.fft.rfft(ring))
    first = at[np.argmax(lines)]
    assert 39 < first < 91
    second = at[(at > 4 * first) & (at < 9 * first)][np.argmax(lines[(at > 4 * first) & (at < 9 * first)])]
    assert second / first == pytest.approx(6.267, rel=0.02)


def test_ripple_whose_phase_goes():
    for seed in range(4):
        _, told, build = hidden("cogging", "armature_reaction", seed=seed)
        x = np.linspace(-30 * told["period"], 0, 30_000, endpoint=False)
        air = 2 * np.mean(felt(build, x) * np.exp(-2j * np.pi * x / told["period"]))
        assert np.abs(air) == pytest.approx(told["amplitude"], rel=1e-6)
        y = x + 30 * told["period"] + 2.5  # beyond the greatest load by a fifth
        loaded = 2 * np.mean(felt(build, y) * np.exp(-2j * np.pi * y / told["period"]))
        assert np.abs(loaded) == pytest.approx(told["amplitude"], rel=1e-6)
        assert 0.4 <= abs(np.angle(loaded / air)) / 1.2 <= 1.0
        _, told, build = hidden("cogging", "belt_creeps", seed=seed)
        x = np.interp(np.arange(20_001), 1000 * np.arange(21), np.resize([-2 * told["period"], 0.0], 21))
        wave = felt(build, x)[:20_000].reshape(20, 1000) / told["amplitude"]
        back = np.exp(-2j * np.pi * x[:20_000].reshape(20, 1000) / told["period"])
        phases = np.unwrap(np.angle(2j * np.mean(wave * back, axis=1)))
        assert np.allclose(np.diff(phases), np.diff(phases)[0], atol=2e-2)
        assert 0.5 <= abs(phases[-1] - phases[0]) * 20 / 19 <= 1.21 and np.max(np.abs(wave)) <= 1.0


def error_of(build, x, t):
    return build.plant.encoder[0](t, x) - x


@pytest.mark.parametrize("seed", range(4))
def test_fields_that_are_stitched(seed):
    _, told, build = hidden("encoder_error", "stitched", seed=seed)
    x = np.linspace(0, 20 * told["period"], 40_000, endpoint=False)
    lines = np.abs(np.fft.rfft(error_of(build, x, x)))[20:101:20] * 2 / len(x)
    assert lines[0] == pytest.approx(told["amplitude"], rel=1e-6)
    sharp = 2 * lines[1] / lines[0]
    assert 0.6 <= sharp <= 0.8 and lines == pytest.approx(lines[0] * sharp ** np.arange(5) / np.arange(1, 6))


@pytest.mark.parametrize("seed", range(4))
def test_offsets_that_drift(seed):
    _, told, build = hidden("encoder_error", "offsets_drift", seed=seed)
    duration, period = SHORT.duration_s, told["period"]
    t = np.linspace(0, duration, 4001)
    parts = [error_of(build, np.full(4001, share * period), t) / told["amplitude"] for share in (0.0, 0.25)]
    whole = parts[0] + 1j * parts[1]
    mean = np.mean(whole[1:] + whole[:-1]) / 2
    assert np.abs(mean) == pytest.approx(1.0, abs=1e-4)
    # Beside its mean one part is straight and goes through nothing, the other settles.
    turned = whole * np.conj(mean)
    best = np.polyfit(t, turned.imag, 1)
    assert np.allclose(np.polyval(best, t), turned.imag, atol=2e-3) and 0.29 <= np.max(np.abs(turned.imag)) <= 0.61
    steps = np.diff(turned.real[::1000])
    kept = steps[1] / steps[0]
    assert steps[2] / steps[1] == pytest.approx(kept, rel=2e-2) and 0.19 <= -1 / (4 * np.log(kept)) <= 0.51
    assert 0.39 <= abs(steps[0] / (1 - kept)) <= 0.81
