"""The fifth shapes of what lies between the motor and the pad against closed forms."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from .cases import draw_case
from .effects.fifth_machine import Seam, _edge_slips, _elasto_plastic, _slides
from .laws import Power
from .motion import Path
from .sets import shapes_of
from .test_truth_effects import SHORT, hidden

pytestmark = pytest.mark.long


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("shape", shapes_of("frame_compliance", "fifth"))
def test_frames(shape, seed):
    fine, told, build = hidden("frame_compliance", shape, 2.0, seed=seed)
    force, given = fine.cell_N[1:], (fine.reported_mm - fine.probe_mm)[1:]
    at = 0.6 * build.force_N
    assert np.interp(at, np.sort(force), given[np.argsort(force)]) / at == pytest.approx(told["compliance"], rel=1e-3)
    first, scale, share = (build.plant.numbers.get(f"frame_{k}") for k in ("mm_N", "force_N", "stiff_share"))
    if shape == "flat_joint":
        # Less what is linear, the force goes with the square of the way beyond a preload of F_0.
        y = (given / first - (1 - share) * force) / share
        assert np.allclose(force, y + y**2 / (4 * scale), atol=1e-6) and 0.02 * build.force_N < scale < 0.11 * 6
    else:
        y = given / (first * scale)
        assert np.allclose(force, scale * (y + y**3), atol=1e-6) and build.force_N <= scale <= 2 * build.force_N


@pytest.mark.parametrize("shape", shapes_of("frame_compliance", "fifth"))
@pytest.mark.parametrize("other", ["friction", "adhesion", "viscous_damping", "stress_softening", "damage"])
def test_the_frame_goes_with_other_effects(shape, other):
    shapes = {"frame_compliance": shape, other: shapes_of(other, "fifth")[-1]}
    plain = {"motion": SHORT, "rate_hz": 500.0, "law": "power", "contact": "unilateral"}
    truth = draw_case(7, ("frame_compliance", other), 1.0, shapes, **plain).truth
    fine, compliance = truth.fine, truth.parameters["frame_compliance"]["compliance"]
    given, loaded = fine.reported_mm - fine.probe_mm, fine.cell_N > 0.3 * truth.drawn.force_N
    assert np.all(np.isfinite(fine.cell_N)) and loaded.any()
    assert np.all(np.abs(given[loaded] / (compliance * fine.cell_N[loaded]) - 1) < 0.34)


def test_the_clearance_of_a_nut_that_warms():
    path = Path(-1.0)
    for _ in range(40):
        path.to(-0.5, 50.0).to(-1.0, 50.0).hold(1.0)
    motion = path.motion()
    fine, told, _ = hidden("backlash", "warms", motion=motion)
    lost = fine.probe_mm - fine.reported_mm
    ends = motion.duration_s / 40 * np.arange(1, 41) - 0.01
    widths = np.interp(ends, fine.time_s, lost) / told["gap"]
    steps = np.diff(widths)
    assert np.all(steps < 0) and np.allclose(steps[1:] / steps[:-1], steps[1] / steps[0], rtol=1e-3)
    kept = steps[1] / steps[0]
    assert 0.2 < -1 / (40 * np.log(kept)) < 0.5
    # w = w_∞ + c e^{−t/τ} with a mean of 1.
    last = widths[0] - steps[0] / (kept - 1)
    first, tau = (widths[0] - last) / kept ** (ends[0] * 40 / motion.duration_s), -1 / (40 * np.log(kept))
    assert 0.33 <= first <= 0.5 and last + first * tau * -np.expm1(-1 / tau) == pytest.approx(1.0, abs=1e-3)


def test_a_film_in_the_play():
    lost, speeds = [], np.array([1.0, 4.0, 16.0, 64.0])
    for speed in speeds:
        motion = Path(-3.0, 1e5).to(-0.5, 10.0).to(-3.0, float(speed)).hold(0.1).motion()
        fine, told, _ = hidden("backlash", "oil_wedge", motion=motion)
        off = fine.probe_mm - fine.reported_mm
        moves = (fine.reported_mm < -1) & (motion.velocity(fine.time_s) < -0.999 * speed) & (fine.time_s > 0.25)
        assert np.ptp(off[moves][60:-20]) < 1e-9
        lost.append(off[moves][100] / told["gap"])
        assert np.all(np.abs(off[(fine.time_s > 0.01) & (fine.time_s < 0.24)]) < 1e-12)
    # 1/(w v/(v + v_0)) is straight over 1/v.
    over = 1 / (1 - np.array(lost))
    slope, start = np.polyfit(1 / speeds, over, 1)
    assert np.allclose(start + slope / speeds, over, rtol=1e-4)
    assert 0.2 <= 1 / start <= 0.33 and 5 <= slope / start <= 20


def test_a_surface_with_a_seam():
    law = Seam(Power(3.0, 0.0), 0.3, 0.02)
    assert law.force(0.0) == 0 and law.force(0.01) == pytest.approx(3 * 0.3 * 0.01)
    assert law.force(1.0) == pytest.approx(3 * (0.3 + 0.7 * 0.98))
    for seed in (0, 1, 2):
        fine, told, _ = hidden("contact_offset", "seam", motion=Path(1.0).hold(0.1).motion(), seed=seed)
        assert 1.0 - fine.force_N[-1] / 3.0 == pytest.approx(told["offset"])


def test_a_machine_that_is_homed_anew():
    fine, told, _ = hidden("contact_offset", "rehomed", motion=Path(1.0).hold(40.0).motion())
    surface, t = 1.0 - fine.force_N[1:-1] / 3.0, fine.time_s[1:-1]
    levels = np.unique(np.round(surface, 9))
    assert len(levels) == 2 and np.ptp(levels) == pytest.approx(abs(told["offset"]) / 10)
    assert np.mean(surface) == pytest.approx(told["offset"], rel=1e-3)
    changed = t[np.argmax(np.abs(np.diff(surface)))]
    assert 0.29 < changed / 40 < 0.71


def felt(build, x, v=0.0, a=0.0):
    t = 1e-4 * np.arange(len(x))
    return build.plant.felt[0](t, x, np.broadcast_to(v, x.shape), np.broadcast_to(a, x.shape))


def test_friction_that_is_elastic_before_it_slips():
    # Small swings come back to where they were, whatever their number: no drift.
    x = 2.9e-3 * 0.5 * np.abs(np.sin(np.linspace(0, 20 * np.pi, 4001)))
    assert np.allclose(_elasto_plastic(x, 2.9e-3, 0.52), x / 2.9e-3, atol=1e-9)
    # On the way on, as solved by another method.
    elastic, s = 0.5, np.linspace(0, 6, 3001)

    def slope(_, z):
        share = 0.5 - 0.5 * np.cos(np.pi * np.clip((z - elastic) / (1 - elastic), 0, 1))
        return 1 - share * z

    exact = solve_ivp(slope, (0, 6), [0.0], t_eval=s, rtol=1e-9, atol=1e-10).y[0]
    assert np.allclose(_elasto_plastic(3e-3 * s, 3e-3, elastic), exact, atol=5e-3)
    assert np.allclose(_elasto_plastic(-3e-3 * s, 3e-3, elastic), -exact, atol=5e-3)
    _, told, build = hidden("friction", "elasto_plastic")
    there = felt(build, np.concatenate([np.linspace(-1, -0.5, 500), np.linspace(-0.5, -1, 500)]))
    assert there[499] == pytest.approx(told["coulomb"], rel=1e-2)
    assert there[-1] == pytest.approx(-told["coulomb"], rel=1e-2)


def test_a_contact_that_slips_from_its_edge():
    ends, shares = _edge_slips(200)
    assert shares.sum() == pytest.approx(1.0) and np.all(shares > 0)
    _, told, build = hidden("friction", "edge_slips")
    x = np.concatenate([np.arange(0, 0.04, 1e-5), 0.04 - np.arange(0, 0.06, 1e-5)])
    force = felt(build, x)[:4000] / told["coulomb"], felt(build, x)[4000:] / told["coulomb"]
    length = 1e-5 * np.argmax(force[0] > 1 - 1e-9)
    s = np.arange(0, 0.04, 1e-5) / length

    def first(s):
        return 1 - (1 - np.minimum(s, 1)) ** 1.5

    assert 0.0049 < length < 0.0151 and np.allclose(force[0], first(s), atol=6e-3)
    # On the way back twice as much over twice as far (Masing).
    assert np.allclose(force[1][:4000], 1 - 2 * first(s / 2), atol=1.2e-2)


def test_balls_that_come_and_go():
    _, told, build = hidden("friction", "ball_passage")
    x = np.linspace(-1.0, 200.0, 400_001)
    there, back = felt(build, x) / told["coulomb"], felt(build, x[::-1].copy())[::-1] / told["coulomb"]
    inside = (x > 0) & (x < 199)
    assert np.allclose(there[inside], -back[inside], atol=2e-2) and np.mean(there[inside]) == pytest.approx(1, abs=2e-3)
    spectrum = 2 * np.abs(np.fft.rfft(there[inside] - 1)) / inside.sum()
    pitch = 199 / np.argmax(spectrum)
    assert 0.39 < pitch < 1.21 and 0.24 < np.ptp(there[inside]) < 0.5


def test_a_block_that_lies_loose():
    # Taken along by at most 400 mm/s²: 20 mm/s after 10 ms take it 50 ms.
    t = 1e-4 * np.arange(2000)
    own = np.cumsum(_slides(np.minimum(2000 * t, 20.0), 1e-4, 400.0)) * 1e-4
    assert np.allclose(own, np.minimum(400 * t, 20.0), atol=0.1)
    motion = Path(-2.0, 4000.0).hold(0.05).to(-0.5, 20.0).hold(0.1).motion()
    fine, told, _ = hidden("inertia", "loose_block", motion=motion)
    force, v = fine.force_N / (1e-3 * told["mass"]), motion.velocity(fine.time_s)
    # Its speed is that of the rest before it stops: the force's impulse is that of all of it.
    before = fine.time_s < 0.05 + 0.06
    assert np.sum(force[before]) * 1e-4 == pytest.approx(20.0, rel=1e-2)
    slides = (v == 20.0) & (np.abs(force) > 1e-6)
    even = np.median(force[slides])
    assert slides.sum() > 20 and np.mean(np.abs(force[slides] / even - 1) < 1e-6) > 0.9
    # 20 mm/s are reached in 5 ms by all but the block, and as much later as it slides on by the block.
    takes = 20.0 / (np.sum(slides) * 1e-4 + 0.005)
    assert 0.38 * 4000 < takes < 0.72 * 4000 and 0.19 < even / takes < 0.34


def test_a_liquid_that_sloshes():
    _, told, build = hidden("inertia", "slosh")
    t, gains = 1e-4 * np.arange(400_000), {}
    for frequency in (0.2, *np.linspace(2, 5, 31), 200.0):
        a = np.sin(2 * np.pi * frequency * t)
        force = felt(build, t, 0.0, a) / (1e-3 * told["mass"])
        gains[frequency] = np.std(force[200_000:]) / np.std(a[200_000:])
    assert gains[0.2] == pytest.approx(1.0, abs=0.01) and 0.66 < gains[200.0] < 0.81
    # At its own frequency its share, times 1/2ζ of 8 to 25.
    assert max(gains.values()) > 5 * (1 - gains[200.0])


def test_ripple_of_commutation():
    _, told, build = hidden("cogging", "commutation")
    x = np.linspace(-20 * told["period"], 0.0, 40_000, endpoint=False)
    spectrum = 2 * np.abs(np.fft.rfft(felt(build, x))) / len(x)
    # |sin| has harmonics as 1/3, 1/15, 1/35.
    assert spectrum[[20, 40, 60]] == pytest.approx(told["amplitude"] * np.array([1, 3 / 15, 3 / 35]), rel=1e-3)
    assert spectrum[0] < 1e-3 * told["amplitude"]


def test_magnets_that_differ():
    amplitudes = []
    for seed in range(8):
        _, told, build = hidden("cogging", "uneven_magnets", seed=seed)
        each = []
        for begin in np.arange(-4, 4):
            x = told["period"] * (begin + np.linspace(0, 1, 2000, endpoint=False))
            each.append(2 * np.abs(np.mean(felt(build, x) * np.exp(-2j * np.pi * x / told["period"]))))
        each = np.array(each) / told["amplitude"]
        assert np.all((each > 0.4) & (each < 1.6)) and np.ptp(each) > 0.1
        amplitudes.append(np.mean(each[4:6]))
    assert np.mean(amplitudes) == pytest.approx(1.0, abs=0.08)


def error_of(build, x, t):
    return build.plant.encoder[0](t, x) - x


def test_an_interpolator_that_averages():
    late = np.zeros((6, 2))
    for seed in range(len(late)):
        _, told, build = hidden("encoder_error", "averaged", seed=seed)
        x, lines = np.linspace(0, 20 * told["period"], 40_000, endpoint=False), {}
        for speed in (1e-4, 20.0, 80.0):
            wave = error_of(build, x, x / speed) * np.exp(-2j * np.pi * x / told["period"])
            lines[speed] = 2 * np.abs(np.mean(wave)) / told["amplitude"]
        assert lines[1e-4] == pytest.approx(1.0, rel=1e-3)
        late[seed] = [np.sqrt(lines[v] ** -2 - 1) * told["period"] / (2 * np.pi * v) for v in (20.0, 80.0)]
    # 1/√(1 + (ωτ)²) with the same τ at each speed.
    assert np.allclose(late[:, 0], late[:, 1], rtol=1e-3)
    assert 0.0049 < late.min() < 0.0075 and 0.009 < late.max() < 0.0151


def test_a_screw_with_a_second_wave():
    _, told, build = hidden("encoder_error", "ball_screw")
    x = np.linspace(0, 600 * told["period"], 60_000, endpoint=False)
    error = error_of(build, x, x)
    spectrum = 2 * np.abs(np.fft.rfft(error * np.hanning(len(x)))) / len(x) * 2
    assert spectrum[600] == pytest.approx(told["amplitude"], rel=1e-2)
    beyond = np.argmax(np.where(np.abs(np.arange(len(spectrum)) - 600) > 50, spectrum, 0))
    assert 1 / 0.61 < beyond / 600 < 1 / 0.39 and 0.2 < spectrum[beyond] / told["amplitude"] < 0.41
