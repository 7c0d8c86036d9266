"""The sixth shapes of what lies between the motor and the pad against closed forms."""

import numpy as np
import pytest

from .cases import draw_case
from .effects.sixth_machine import Bowed, _rattles
from .laws import Power
from .motion import Path
from .sets import shapes_of
from .test_truth_effects import SHORT, hidden

pytestmark = pytest.mark.long


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_screw_that_is_held_at_one_end(seed):
    fine, told, _ = hidden("frame_compliance", "screw", 2.0, seed=seed)
    loaded = fine.cell_N > 0.1
    x, softness = fine.reported_mm[loaded], ((fine.reported_mm - fine.probe_mm)[loaded] / fine.cell_N[loaded])
    slope, start = np.polyfit(x, softness, 1)
    assert np.allclose(start + slope * x, softness, rtol=1e-6)
    assert start + slope * 1.0 == pytest.approx(told["compliance"], rel=1e-6)
    # From one end of 2 mm to the other.
    assert 0.2 <= abs(2 * slope / told["compliance"]) <= 0.4


@pytest.mark.parametrize("seed", [0, 1])
def test_a_mount_of_rubber_in_the_frame(seed):
    motion = Path(-0.5).to(1.5, 20.0).hold(0.3).to(0.8, 20.0).hold(0.3).motion()
    fine, told, build = hidden("frame_compliance", "rubber_mount", 2.0, motion=motion, seed=seed)
    given, force, tau = fine.reported_mm - fine.probe_mm, fine.cell_N, build.plant.numbers["frame_late_s"]
    speed = np.diff(given) / 1e-4
    assert 0.004 <= tau <= 0.02 and np.max(np.abs(speed)) > 0.5
    assert np.allclose((given[1:] + given[:-1]) / 2 + tau * speed, told["compliance"] * force[1:], atol=2e-4)
    assert given[-2] == pytest.approx(told["compliance"] * force[-2], rel=1e-4)


@pytest.mark.parametrize("shape", shapes_of("frame_compliance", "sixth"))
@pytest.mark.parametrize("other", ["friction", "adhesion", "viscous_damping", "stress_softening", "damage"])
def test_the_frame_goes_with_other_effects(shape, other):
    shapes = {"frame_compliance": shape, other: shapes_of(other, "sixth")[0]}
    plain = {"motion": SHORT, "rate_hz": 500.0, "law": "power", "contact": "unilateral"}
    truth = draw_case(7, ("frame_compliance", other), 1.0, shapes, **plain).truth
    fine, compliance = truth.fine, truth.parameters["frame_compliance"]["compliance"]
    rests = np.abs(truth.motion.velocity(fine.time_s)) == 0
    given, loaded = fine.reported_mm - fine.probe_mm, rests & (fine.cell_N > 0.3 * truth.drawn.force_N)
    assert np.all(np.isfinite(fine.cell_N)) and loaded.any()
    # Soon after a move rubber is not yet where it will be.
    assert np.mean(np.abs(given[loaded] / (compliance * fine.cell_N[loaded]) - 1) < 0.25) > 0.8


def test_play_that_goes_with_the_load():
    motion = Path(-0.5).to(2.0, 5.0).to(-0.5, 5.0).motion()
    fine, told, _ = hidden("backlash", "under_load", motion=motion)
    lost, x = (fine.probe_mm - fine.reported_mm) / told["gap"], fine.reported_mm
    back = motion.velocity(fine.time_s) < -1
    assert np.all(lost[(fine.time_s > 0) & (fine.time_s < 0.4)] < 1e-9)
    under, air = back & (x > 0) & (x < 1.8), back & (x < 0)
    slope, start = np.polyfit(x[under], lost[under], 1)
    assert np.allclose(start + slope * x[under], lost[under], atol=1e-6)
    # The spring bears half of its load at half of its depth.
    assert start + slope == pytest.approx(1.0, abs=1e-6) and 0.4 <= 2 * slope <= 0.8
    assert np.allclose(lost[air], start, atol=1e-6)


def test_play_that_works_loose():
    path = Path(-1.0)
    for _ in range(20):
        path.to(-0.5, 50.0).to(-1.0, 50.0).hold(0.1)
    motion = path.motion()
    fine, told, _ = hidden("backlash", "works_loose", motion=motion)
    ends = motion.duration_s / 20 * np.arange(1, 21) - 0.01
    widths = np.interp(ends, fine.time_s, fine.probe_mm - fine.reported_mm) / told["gap"]
    # After k of 20 strokes there and back alike.
    assert np.allclose(widths, 0.6 + 0.8 * np.arange(1, 21) / 20, atol=1e-6)


def test_a_sample_that_is_bowed():
    law, drop = Bowed(Power(3.0, 0.0), 0.03), 0.03
    for depth in (0.005, 0.015, 0.025):
        # 3 ∫ (δ − d s²) ds up to where it is met.
        assert law.force(depth) == pytest.approx(3 * 2 / 3 * depth**1.5 / np.sqrt(drop), rel=5e-3)
    assert law.force(1.0) == pytest.approx(3 * (1.0 - drop / 3)) and law.force(0.0) == 0
    for seed in (0, 1, 2):
        fine, told, _ = hidden("contact_offset", "bowed", motion=Path(1.0).hold(0.1).motion(), seed=seed)
        assert 1.0 - fine.force_N[-1] / 3.0 == pytest.approx(told["offset"])


def felt(build, x, v=0.0, a=0.0, t=None):
    t = 1e-4 * np.arange(len(x)) if t is None else t
    return build.plant.felt[0](t, x, np.broadcast_to(v, x.shape), np.broadcast_to(a, x.shape))


def test_friction_that_is_smooth_in_speed():
    _, told, build = hidden("friction", "smoothed")
    v = np.linspace(-0.3, 0.3, 601)
    share = felt(build, np.zeros(601), v) / told["coulomb"]
    slopes = np.arctanh(share[v != 0]) / v[v != 0]
    assert np.ptp(slopes) < 1e-6 and 1.0 <= slopes[0] <= 5.0 and abs(share[300]) < 1e-12
    assert felt(build, np.zeros(2), 50.0)[0] == pytest.approx(told["coulomb"])
    motion = Path(-1.5).to(-1.0, 20.0).hold(0.2).motion()
    fine, _, _ = hidden("friction", "smoothed", motion=motion)
    assert abs(fine.force_N[-2]) < 1e-9  # nothing at rest


def test_a_rail_with_grease():
    levels, speeds = [], np.array([0.5, 10.0, 40.0, 80.0])
    for speed in speeds:
        x = np.concatenate([np.linspace(-1, -0.5, 1001), np.linspace(-0.5, -1, 1001)])
        v = np.repeat([speed, -speed], 1001)
        _, told, build = hidden("friction", "viscous_rail")
        force = felt(build, x, v) / told["coulomb"]
        assert force[1000] == pytest.approx(-force[-1], rel=1e-3)
        levels.append(force[1000])
    slope, start = np.polyfit(speeds, levels, 1)
    assert start == pytest.approx(1.0, abs=1e-3) and np.allclose(start + slope * speeds, levels, rtol=1e-3)
    assert 1 / 201 < slope < 1 / 59


def test_friction_of_another_level_each_stroke():
    _, told, build = hidden("friction", "each_stroke")
    x = np.interp(np.arange(120_001) / 300, np.arange(401), np.resize([-1.0, -0.5], 401))
    force = felt(build, x).reshape(-1)[1:].reshape(400, 300) / told["coulomb"]
    assert np.all(np.ptp(force[:, 50:-1], axis=1) < 1e-9)
    assert np.array_equal(np.sign(force[:, 100]), np.resize([1.0, -1.0], 400))
    levels = np.abs(force[:, 100])
    assert np.mean(levels) == pytest.approx(1.0, abs=0.03) and np.std(levels) == pytest.approx(1 / 6, rel=0.12)
    assert abs(np.corrcoef(levels[1:], levels[:-1])[0, 1]) < 0.2


def test_a_ring_in_oil():
    for seed in range(3):
        _, told, build = hidden("inertia", "oil_ring", seed=seed)
        t, gains = 1e-4 * np.arange(200_000), {}
        for frequency in (0.2, 4.0, 12.0, 500.0):
            a = np.sin(2 * np.pi * frequency * t)
            force = felt(build, t, 0.0, a) / (1e-3 * told["mass"])
            gains[frequency] = np.std(force[100_000:]) / np.std(a[100_000:])
        share = 1 - gains[500.0]
        assert gains[0.2] == pytest.approx(1.0, abs=0.01) and 0.24 < share < 0.41
        # |1 − s + s/(1 + i ω τ)| at two frequencies gives one τ.
        tries = np.geomspace(0.005, 0.08, 4000)
        taus = []
        for frequency in (4.0, 12.0):
            wanted = np.abs(1 - share + share / (1 + 2j * np.pi * frequency * tries))
            taus.append(tries[np.argmin(np.abs(wanted - gains[frequency]))])
        assert taus[0] == pytest.approx(taus[1], rel=0.05) and 0.0095 < taus[0] < 0.042


def test_a_part_that_is_loose_within_a_clearance():
    # 20 mm/s reached in 5 ms and given up in 5 ms: it goes on by itself until it has gained the clearance.
    t = 1e-4 * np.arange(1000)
    v = 4000 * (np.clip(t - 0.01, 0, 0.005) - np.clip(t - 0.05, 0, 0.005))
    own = _rattles(v, 1e-4, 0.01)
    assert np.allclose(own[t < 0.05], v[t < 0.05]) and np.allclose(own[t > 0.06], 0, atol=1e-9)
    coasts = 0.05 + np.sqrt(2 * 0.02 / 4000)
    assert np.all(own[(t > 0.0502) & (t < coasts - 2e-4)] == own[499])
    after = (t > coasts + 2e-4) & (t < 0.06)
    assert np.allclose(own[after], v[after])
    motion = Path(-2.0, 4000.0).hold(0.05).to(-0.5, 20.0).hold(0.1).motion()
    for seed in range(3):
        fine, told, _ = hidden("inertia", "rattles", motion=motion, seed=seed)
        force, v = fine.force_N / (1e-3 * told["mass"]), motion.velocity(fine.time_s)
        stops = fine.time_s[np.flatnonzero(v > 19.999)[-1]]
        assert np.sum(force[fine.time_s < stops]) * 1e-4 == pytest.approx(20.0, rel=1e-2)
        assert np.sum(force) * 1e-4 == pytest.approx(0.0, abs=0.1)
        first = np.interp(stops + 1e-3, fine.time_s, force) / -4000
        assert 0.59 < first < 0.76  # without what floats


def test_ripple_of_edges():
    for seed in range(3):
        _, told, build = hidden("cogging", "edges", seed=seed)
        x = np.linspace(-20 * told["period"], 0.0, 40_000, endpoint=False)
        spectrum = 2 * np.abs(np.fft.rfft(felt(build, x))) / len(x)
        ratio = spectrum[40] / spectrum[20]
        assert spectrum[20] == pytest.approx(told["amplitude"], rel=1e-6) and 0.35 <= ratio <= 0.6
        assert spectrum[[60, 80]] == pytest.approx(told["amplitude"] * ratio ** np.array([2, 3]), rel=1e-6)


def test_ripple_that_fades_as_the_magnets_warm():
    _, told, build = hidden("cogging", "warms")
    duration = SHORT.duration_s
    t = np.linspace(0, duration, 40_001)
    waves = [felt(build, np.full(40_001, -part * told["period"]), t=t) for part in (0.0, 0.25)]
    level = np.hypot(*waves) / told["amplitude"]
    assert np.mean(level) == pytest.approx(1.0, abs=1e-4)
    steps = np.diff(level[::10_000])
    kept = steps[1] / steps[0]
    tau = -1 / (4 * np.log(kept))
    assert steps[2] / steps[1] == pytest.approx(kept, rel=1e-6) and 0.2 <= tau <= 0.5
    assert 0.2 <= -steps[0] / (1 - kept) <= 0.33


def error_of(build, x):
    return build.plant.encoder[0](x, x) - x


@pytest.mark.parametrize("seed", range(4))
def test_a_head_whose_bracket_bends(seed):
    _, told, build = hidden("encoder_error", "head_bends", seed=seed)
    levels = []
    for begin in (-20 * told["period"], 3.0):  # in air, and beyond the greatest load by a fifth
        x = begin + np.linspace(0, 20 * told["period"], 20_000, endpoint=False)
        wave = error_of(build, x) * np.exp(-2j * np.pi * x / told["period"])
        levels.append(2 * np.abs(np.mean(wave)) / told["amplitude"])
    goes = 2 * (1 - levels[0])
    assert 0.5 <= abs(goes) <= 1.0 and levels[1] == pytest.approx(1 + 0.7 * goes, abs=1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_signals_that_are_cut_off(seed):
    _, told, build = hidden("encoder_error", "overdriven", seed=seed)
    x = np.linspace(0, 20 * told["period"], 40_000, endpoint=False)
    lines = np.abs(np.fft.rfft(error_of(build, x)))[[20, 40, 60, 80]] * 2 / len(x)
    assert lines[0] == pytest.approx(told["amplitude"], rel=1e-3)
    angle, best = 2 * np.pi * np.arange(4096) / 4096, []
    for over in np.linspace(1.05, 1.4, 141):
        signal = np.clip(over * np.cos(angle), -1, 1) + 1j * np.clip(over * np.sin(angle), -1, 1)
        found = np.abs(np.fft.rfft(np.angle(signal * np.exp(-1j * angle))))[[4, 8, 12, 16]]
        best.append((float(np.max(np.abs(found / found[0] - lines / lines[0]))), over))
    assert min(best)[0] < 0.01 and 1.09 < min(best)[1] < 1.36
