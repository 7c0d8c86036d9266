"""The fourth shapes of what lies between the motor and the pad against closed forms."""

import numpy as np
import pytest

from .cases import draw_case
from .effects.fourth_machine import Wavy, _stiff, _uneven
from .laws import Power
from .motion import Path
from .sets import shapes_of
from .test_truth_effects import SHORT, hidden, numbers

pytestmark = pytest.mark.long


def test_a_frame_that_creeps():
    # A spring K behind a frame: K w/τ' with 1/τ' = (1 + K C s/(1 + K C (1 − s)))/τ, K = 3 N/mm.
    c, s, tau, depth = 0.05, 0.4, 0.5, 1.5
    motion = Path(0.0).to(depth, 100.0).hold(4.0).motion()
    fine = numbers(motion, frame_form=5, frame_mm_N=c, frame_late_share=s, frame_late_s=tau)
    last = 3 * depth / (1 + 3 * c)
    left = fine.at(np.array([0.5, 1.0, 1.5])) - last
    wanted = np.exp(-0.5 / tau * (1 + 3 * c * s / (1 + 3 * c * (1 - s))))
    assert fine.force_N[-1] == pytest.approx(last, rel=1e-4)
    assert left[1] / left[0] == pytest.approx(wanted, rel=1e-3) and left[2] / left[1] == pytest.approx(wanted, rel=1e-3)


def test_the_compliance_that_creeps_is_the_middle():
    fine, told, build = hidden("frame_compliance", "creeps", motion=Path(0.0).to(2.0, 1000.0).hold(20.0).motion())
    given = fine.reported_mm - fine.probe_mm
    # Pressed within 20 ms, of which little is late.
    first, last = given[300] / fine.cell_N[300], given[-1] / fine.cell_N[-1]
    share = build.plant.numbers["frame_late_share"]
    assert 0.1 < share < 0.2 and first / last == pytest.approx(1 - share, abs=0.1 * share)
    assert (first + last) / 2 == pytest.approx(told["compliance"], rel=0.01)


def test_joints_that_slip_make_a_loop():
    motion = Path(0.0).to(2.0, 20.0).to(0.5, 20.0).hold(0.1).motion()
    fine, told, build = hidden("frame_compliance", "joints_slip", motion=motion)
    force, given, turned = fine.cell_N, fine.reported_mm - fine.probe_mm, np.argmax(fine.reported_mm)
    at, half, share = 0.6 * build.force_N, *(build.plant.numbers[k] for k in ("frame_force_N", "frame_late_share"))
    up = np.interp(at, force[:turned], given[:turned])
    down = np.interp(-at, -force[turned:], given[turned:])
    assert (up + down) / 2 == pytest.approx(told["compliance"] * at, rel=1e-3)
    assert down - up == pytest.approx(2 * told["compliance"] * share * half, rel=1e-3)
    # At first, and at first after the turn, the joints stick.
    few = slice(2, np.argmax(force > 0.9 * half))
    assert np.allclose(given[few], (1 - share) * told["compliance"] * force[few], atol=1e-9)


@pytest.mark.parametrize("shape", shapes_of("frame_compliance", "fourth"))
@pytest.mark.parametrize("other", ["friction", "adhesion", "viscous_damping", "stress_softening", "separation"])
def test_the_frame_goes_with_other_effects(shape, other):
    shapes = {"frame_compliance": shape, other: shapes_of(other, "fourth")[-1]}
    plain = {"motion": SHORT, "rate_hz": 500.0, "law": "power", "contact": "unilateral"}
    truth = draw_case(7, ("frame_compliance", other), 1.0, shapes, **plain).truth
    fine, compliance = truth.fine, truth.parameters["frame_compliance"]["compliance"]
    given, loaded = fine.reported_mm - fine.probe_mm, fine.cell_N > 0.3 * truth.drawn.force_N
    assert np.all(np.isfinite(fine.cell_N)) and loaded.any()
    # Within a third of the secant wherever there is a load: at once, at last, on either way.
    assert np.all(np.abs(given[loaded] / (compliance * fine.cell_N[loaded]) - 1) < 0.34)


def test_a_play_that_runs_out():
    fine, told, _ = hidden("backlash", "runout", motion=Path(-12.0).to(-0.5, 20.0).to(-12.0, 20.0).motion())
    x, lost = fine.reported_mm, fine.probe_mm - fine.reported_mm
    back = np.arange(len(x)) > np.argmax(x) + 400
    assert np.all(np.abs(lost[: np.argmax(x)]) < 1e-12)
    order = np.argsort(x[back])
    x, lost = x[back][order], lost[back][order]
    mean = np.trapezoid(lost, x) / np.ptp(x)
    assert mean == pytest.approx(told["gap"], rel=0.05)
    swing = (np.max(lost) - np.min(lost)) / (2 * told["gap"])
    assert 0.14 < swing < 0.36 and (np.max(lost) + np.min(lost)) / 2 == pytest.approx(told["gap"], rel=1e-3)


def test_a_play_that_is_another_each_time():
    x = np.concatenate([np.linspace(0, 1, 101), *[np.abs(np.linspace(-1, 1, 201))[1:]] * 4])
    lost = _uneven(x, np.array([0.1, 0.2, 0.3])) - x
    assert np.allclose([lost[k] for k in (200, 400, 600, 800)], [0.1, 0.2, 0.3, 0.1])
    assert np.allclose(lost[100::200][:4], 0.0)  # on the way in it is gone
    path = Path(-1.0)
    for _ in range(8):
        path.to(-0.5, 50.0).to(-1.0, 50.0)
    fine, told, _ = hidden("backlash", "uneven", motion=path.motion())
    x, lost = fine.reported_mm, fine.probe_mm - fine.reported_mm
    turns = np.flatnonzero((x[1:-1] <= x[:-2]) & (x[1:-1] < x[2:]) & (x[1:-1] < -0.99)) + 1
    levels = np.append(lost[turns], lost[-1]) / told["gap"]
    # One and the one after lie as far above the mean as below.
    assert len(levels) == 8 and np.allclose(levels[::2] + levels[1::2], 2.0) and np.ptp(levels) > 0.1


def test_a_surface_that_settles():
    fine, told, _ = hidden("contact_offset", "settles", motion=Path(1.0).hold(60.0).motion())
    surface, t = 1.0 - fine.force_N[1:-1] / 3.0, fine.time_s[1:-1]
    assert np.trapezoid(surface, t) / 60 == pytest.approx(told["offset"], rel=1e-4)
    steps = np.diff(surface[:: len(t) // 8])
    assert np.all(steps > 0) and np.allclose(steps[1:] / steps[:-1], steps[1] / steps[0], rtol=1e-3)
    assert 0.9 * abs(told["offset"]) / 8 < np.ptp(surface) < abs(told["offset"]) / 8


def test_a_wavy_surface():
    law = Wavy(Power(3.0, 0.0), 0.01)
    # Far in a plane at the mean height; at the mean height the mean of a sine's upper half, 1/π.
    assert law.force(0.0) == 0 and law.force(1.0) == pytest.approx(3 * 0.99)
    assert law.force(0.01) == pytest.approx(3 * 0.01 / np.pi, rel=5e-3)
    fine, told, _ = hidden("contact_offset", "wavy", motion=Path(1.0).hold(0.1).motion())
    assert 1.0 - fine.force_N[-1] / 3.0 == pytest.approx(told["offset"])


def felt(build, x, v=0.0, a=0.0):
    t = 1e-4 * np.arange(len(x))
    return build.plant.felt[0](t, x, np.full(len(x), v), np.full(len(x), a))


def test_friction_along_the_way():
    _, told, build = hidden("friction", "tight_spots")
    x = np.linspace(-1.0, 2.0, 30_001)
    there, back = felt(build, x) / told["coulomb"], felt(build, x[::-1].copy())[::-1] / told["coulomb"]
    inside = x[x >= 0]
    assert np.trapezoid(there[x >= 0], inside) / 2 == pytest.approx(1.0, rel=2e-3)
    middle = (x > 0.1) & (x < 1.9)
    assert np.allclose(there[middle], -back[middle], atol=2e-2) and 0.25 < np.ptp(there[middle]) < 1.0


def test_friction_by_the_logarithm_of_speed():
    _, told, build = hidden("friction", "polymer_bush")
    x = np.linspace(-1.0, -0.5, 5000)
    levels = np.array([felt(build, x, v)[-1] for v in (0.0, 1.0, 10.0, 100.0)]) / told["coulomb"]
    assert levels[1] == pytest.approx(1.0)
    steps = np.diff(levels) / np.diff(np.log([1.0, 11.0, 101.0, 1001.0]))
    assert np.allclose(steps, steps[0]) and 0.03 <= steps[0] <= 0.06


def test_grease_is_worked_in():
    # s' = (1 − s)/τ − s v/ℓ: at 10 mm/s for 1 s, then at rest.
    x = np.concatenate([np.linspace(0, 10, 10_001), np.full(100_000, 10.0)])
    s = _stiff(x, 1e-4, 8.0, 30.0)
    rate = 1 / 30 + 10 / 8
    moved = 1 / 30 / rate + (1 - 1 / 30 / rate) * np.exp(-rate)
    assert s[10_000] == pytest.approx(moved, rel=1e-3)
    assert (1 - s[-1]) / (1 - s[10_000]) == pytest.approx(np.exp(-10 / 30), rel=1e-3)
    _, told, build = hidden("friction", "worked_in")
    x = -0.5 - np.abs(np.linspace(-1, 1, 4001) - np.repeat([0.0], 4001))
    many = felt(build, np.tile(x, 60)) / told["coulomb"]
    assert 1.4 < np.max(many) <= 1.5 and 1.0 <= np.max(many[-4001:]) < 1.05


@pytest.mark.parametrize("shape", shapes_of("inertia", "fourth"))
def test_the_mass_of_slow_and_of_quick_motions(shape):
    _, told, build = hidden("inertia", shape)
    t, shares = 1e-4 * np.arange(60_000), []
    for frequency in (0.5, 1500.0):
        a = np.sin(2 * np.pi * frequency * t)
        force = build.plant.felt[0](t, np.zeros_like(t), np.zeros_like(t), a)[30_000:]
        shares.append(np.linalg.norm(force) / np.linalg.norm(a[30_000:]) / (1e-3 * told["mass"]))
    assert shares[0] == pytest.approx(1.0, abs=0.01)
    # What recoils or hangs on a spring does not come with a quick one.
    assert 0.79 < shares[1] < 0.93 if shape == "recoil" else 0.39 < shares[1] < 0.61


def test_a_ripple_of_the_thrust():
    _, told, build = hidden("cogging", "thrust")
    x = np.linspace(-20 * told["period"], 0.0, 40_000, endpoint=False)
    spectrum = 2 * np.abs(np.fft.rfft(felt(build, x))) / len(x)
    assert spectrum[20] == pytest.approx(0.7 * told["amplitude"]) and np.sum(spectrum) == pytest.approx(spectrum[20])
    # At the same phase without load, at half of it, and at all: a spring pressed by 0, 1 and 2 mm.
    for depth, factor in ((1.0, 1.0), (2.0, 1.3)):
        loaded, free = felt(build, np.array([depth, depth - 5 * told["period"]]))
        assert loaded / free == pytest.approx(factor / 0.7)


def test_slots_that_are_no_multiple_of_the_poles():
    _, told, build = hidden("cogging", "fractional_slots")
    x = np.linspace(0, 600 * told["period"], 60_000, endpoint=False)
    wave = felt(build, x)
    first = np.mean(wave * np.exp(-2j * np.pi * x / told["period"]))
    assert 2 * np.abs(first) == pytest.approx(told["amplitude"], rel=5e-3)
    rest = np.std(wave - 2 * np.real(first * np.exp(2j * np.pi * x / told["period"])))
    assert 0.24 < np.sqrt(2) * rest / told["amplitude"] < 0.41


def test_errors_of_a_magnetic_scale():
    _, told, build = hidden("encoder_error", "magnetic_tape")
    x = np.linspace(0, 20 * told["period"], 40_000, endpoint=False)
    there = (build.plant.encoder[0](0.0, x) - x)[20_000:]
    back = (build.plant.encoder[0](0.0, x[::-1].copy()) - x[::-1])[:20_000][::-1]
    lines = [2 * np.fft.rfft(wave)[10] / len(wave) for wave in (there, back)]
    assert np.abs(lines) == pytest.approx([told["amplitude"]] * 2, rel=1e-2)
    assert 2 * np.pi * 0.019 < -np.angle(lines[0] / lines[1]) < 2 * np.pi * 0.061
    _, told, build = hidden("encoder_error", "uneven_poles")
    count = int(2.0 / told["period"])
    x = np.linspace(0, count * told["period"], 2000 * count, endpoint=False)
    error = (build.plant.encoder[0](0.0, x) - x) / told["amplitude"]
    each = [np.ptp(part) / 2 for part in np.split(error, count)]
    assert np.all(np.abs(np.array(each) - 1) < 0.45) and np.mean(each) == pytest.approx(1.0, abs=0.25)
    angle = 2 * np.pi * x / told["period"]
    waves = np.stack([np.sin(angle), np.cos(angle)], axis=1)
    off = error - waves @ np.linalg.lstsq(waves, error, rcond=None)[0]
    assert 0.01 < np.std(off) < 0.3
