"""The judge's shapes of what lies between the motor and the pad against closed forms."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

from .cases import draw_case
from .effects.judge_machine import Piled, _bonds, _dry, _leaks, _lifts, _slipped
from .laws import Power
from .motion import Path
from .sets import shapes_of
from .test_truth_effects import hidden
from .test_truth_ninth import OTHERS, felt, phasor

FRAMES = ("beds_in", "base_lifts")
H = 1e-4


def test_they_are_of_the_judge():
    assert set(FRAMES) <= set(shapes_of("frame_compliance", "judge")) and "pile" in shapes_of("contact_offset", "judge")
    assert set(shapes_of("friction", "judge")) >= {"creeping_bonds", "rough_track", "flash_heat"}
    for id in ("backlash", "inertia", "cogging", "encoder_error"):
        assert len(shapes_of(id, "judge")) >= 2


@pytest.mark.parametrize("seed", range(3))
def test_a_joint_that_is_pressed_flat(seed):
    motion = Path(-0.1, np.inf).to(1.7, 20.0).to(0.0, 20.0).to(1.6, 20.0).to(2.1, 20.0).to(0.0, 20.0).motion()
    fine, told, build = hidden("frame_compliance", "beds_in", 2.0, motion=motion, seed=seed)
    given, force = fine.reported_mm - fine.probe_mm, fine.cell_N
    ends = np.interp([1.8 / 20, 3.5 / 20, 5.1 / 20, 5.6 / 20], fine.time_s, np.arange(len(force))).astype(int)
    first, back, again, last = (
        slice(a, b) for a, b in zip([0, *ends[:3]], [ends[0], ends[1], ends[2], ends[3]], strict=True)
    )
    springs, stays = np.polyfit(force[back][1:-20], given[back][1:-20], 1)
    assert np.allclose(given[back][1:-20], stays + springs * force[back][1:-20], atol=1e-6)
    # Half of what it was at first springs back, and half of the rest.
    at = np.interp(0.6 * build.force_N, force[first], given[first]) / (0.6 * build.force_N)
    assert (at + springs) / 2 == pytest.approx(told["compliance"], rel=1e-3)
    assert 0.2 <= 2 * (1 - springs / told["compliance"]) <= 0.4
    # What stays goes as 1 − e^{−F/f}: by its values at F, 2 F and 3 F.
    one, two, three = (np.interp(part, force[first], given[first] - springs * force[first]) for part in (1.4, 2.8, 4.2))
    falls = two / one - 1
    assert three / one == pytest.approx(1 + falls + falls**2, abs=1e-3)
    assert 0.3 <= -1.4 / np.log(falls) / build.force_N <= 0.8
    # Nothing new until it is pressed harder than before; then as if it had never been let go.
    less = force[again] < 0.98 * force[first].max()
    assert np.allclose((given[again] - springs * force[again])[less], stays, atol=1e-6)
    more = force[last] > 1.03 * force[first].max()
    wanted = one / (1 - falls) * (1 - falls ** (force[last] / 1.4))
    assert more.any() and np.allclose((given[last] - springs * force[last])[more], wanted[more], rtol=2e-3)


def test_a_foot_on_a_bed_of_springs():
    x = (np.arange(20_000) + 0.5) / 20_000
    for lies in (1.0, 0.9, 0.7, 0.5):
        # It turns about an edge of what still lies on; the springs pull nowhere. 1/6 of N L lifts the first.
        press = np.maximum(lies - x, 0.0)
        load = 6 * np.sum(press * (0.5 - x)) / np.sum(press)
        turned = 0.5 / np.mean(press)
        assert _lifts(np.array([load]))[0] == pytest.approx(turned, rel=1e-3)
    below = np.array([-2.0, 0.0, 0.4, 1.0])
    assert np.allclose(_lifts(below), below) and np.allclose(_lifts(np.array([2.0, 2.5])), [4.0, 8.0])


@pytest.mark.parametrize("seed", range(3))
def test_a_base_that_lifts(seed):
    motion = Path(-0.1).to(2.4, 20.0).to(0.0, 20.0).motion()
    fine, told, build = hidden("frame_compliance", "base_lifts", 2.0, motion=motion, seed=seed)
    given, force = (fine.reported_mm - fine.probe_mm) / told["compliance"], fine.cell_N
    low = force < 0.59 * build.force_N
    assert np.allclose(given[low], force[low], atol=1e-5)

    def wanted(share, begins):
        lifted = np.where(force > begins, 4 / (3 - np.maximum(force / begins, 1.0)) ** 2, force / begins)
        return (1 - share) * force + share * begins * lifted

    found = least_squares(lambda q: wanted(*q) - given, (0.4, 0.7 * build.force_N))
    assert np.max(np.abs(found.fun)) < 2e-3
    assert 0.299 <= found.x[0] <= 0.501 and 0.599 <= found.x[1] / build.force_N <= 0.801


@pytest.mark.parametrize("shape", FRAMES)
@pytest.mark.parametrize("other", OTHERS)
def test_the_frame_goes_with_other_effects(shape, other):
    shapes = {"frame_compliance": shape, other: shapes_of(other, "first")[0]}
    short = Path(-0.5).to(1.4, 60.0).hold(0.1).to(2.0, 8.0).hold(0.1).to(1.0, 60.0).hold(0.1).to(-0.5, 60.0).hold(0.1)
    plain = {"motion": short.motion(), "rate_hz": 500.0, "law": "power", "contact": "unilateral"}
    truth = draw_case(7, ("frame_compliance", other), 1.0, shapes, **plain).truth
    fine, compliance = truth.fine, truth.parameters["frame_compliance"]["compliance"]
    given, loaded = fine.reported_mm - fine.probe_mm, fine.cell_N > 0.5 * truth.drawn.force_N
    assert np.all(np.isfinite(fine.cell_N)) and loaded.any()
    assert np.all(np.abs(given[loaded] / (compliance * fine.cell_N[loaded]) - 1) < 0.6)


@pytest.mark.parametrize("seed", range(3))
def test_flanks_that_are_dented(seed):
    motion = Path(-0.5).to(1.0, 20.0).to(-0.5, 20.0).to(0.5, 20.0).to(-0.5, 20.0).to(2.2, 20.0).to(-0.5, 20.0)
    motion = motion.to(1.0, 20.0).to(-0.5, 20.0).motion()
    fine, told, _ = hidden("backlash", "brinelled", motion=motion, seed=seed)
    lost = (fine.probe_mm - fine.reported_mm) / told["gap"]
    one, same, whole, after = np.interp([0.14, 0.24, 0.51, 0.66], fine.time_s, lost)
    # By the greatest load: half of it leaves half of what there is to come.
    assert same == pytest.approx(one) and whole == pytest.approx(1.0) and after == pytest.approx(1.0)
    assert 0.4 <= 2 * one - 1 <= 0.6
    # On the way in nothing is lost.
    assert np.interp([0.074, 0.38], fine.time_s, lost) == pytest.approx([0.0, 0.0], abs=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_a_play_full_of_oil(seed):
    x = np.concatenate([np.linspace(0, 1, 500), np.linspace(1, 0.99, 11)[1:], np.full(2000, 0.99)])
    lost = _leaks(x, H, 0.02, 0.03) - x
    since = np.arange(1, 2011) * H
    assert np.all(lost[:500] == 0) and np.allclose(lost[500:], 0.02 * -np.expm1(-since / 0.03))
    taus = []
    for speed in (40.0, 2.0):
        # It turns, goes on a little and stands still: by time alone, whatever the speed.
        motion = Path(0.2, np.inf).to(1.0, 20.0).to(0.98, speed).hold(0.3).to(1.2, speed).hold(0.1).motion()
        fine, told, _ = hidden("backlash", "oil_filled", motion=motion, seed=seed)
        lost = (fine.probe_mm - fine.reported_mm) / told["gap"]
        turn, again = 0.04, 0.34 + 0.02 / speed
        taus.append(-0.05 / np.log(1 - np.interp(turn + 0.05, fine.time_s, lost)))
        open_ = np.interp(again, fine.time_s, lost)
        assert open_ == pytest.approx(-np.expm1((turn - again) / taus[-1]), abs=2e-3)
        assert np.interp(again + 0.07, fine.time_s, lost) == pytest.approx(open_ * np.exp(-0.07 / taus[-1]), abs=5e-3)
    assert taus[0] == pytest.approx(taus[1], rel=0.01) and 0.0198 <= taus[0] <= 0.0805


def test_a_surface_of_fibres():
    law = Piled(Power(3.0, 0.0), 0.02, 0.05)
    pile = 0.02 * np.array([1.0, 0.9, 0.7, 0.4, 0.25])
    force = 0.05 * ((0.02 / pile) ** 3 - 1)
    assert np.allclose(law.force(force / 3.0 + 0.02 - pile), force, rtol=2e-3, atol=1e-9)
    assert np.all(law.force(np.array([-0.1, 0.0])) == 0)
    for seed in range(3):
        found = []
        for depth in (2.3, 1.0, 0.5):
            fine, told, build = hidden("contact_offset", "pile", motion=Path(depth).hold(0.1).motion(), seed=seed)
            found.append((depth - fine.force_N[-1] / 3.0, fine.force_N[-1]))
        made = build.plant.pad.law
        assert 0 < made.height <= 0.02 and 0.003 <= made.first / 6 <= 0.02
        # Each stands as far off as its pile at that load is less high than at the greatest.
        for at, load in found:
            high, least = made.height * np.cbrt(made.first / (made.first + np.array([load, 6.0])))
            assert at == pytest.approx(told["offset"] + least - high, abs=2e-6)


def test_bonds_that_let_go():
    t = H * np.arange(6001)
    v = np.interp(t, [0, 0.1, 0.11, 0.2, 0.2001, 0.4, 0.42, 0.6], [3.0, 3.0, 0.0, 0.0, -8.0, -8.0, 0.2, 0.2])
    x = np.concatenate([[0.0], np.cumsum((v[1:] + v[:-1]) / 2 * H)])
    length, slow, scale = 0.05, 0.3, 0.4
    got = _bonds(x, H, length, slow, scale)

    def rate(s, state):
        k = min(int(s / H), 5999)
        return [((x[k + 1] - x[k]) / H - slow * np.sinh(state[0] / scale)) / length]

    exact = solve_ivp(rate, (0, t[-1]), [0.0], t_eval=t, rtol=1e-9, atol=1e-10, max_step=H).y[0]
    assert np.allclose(got, exact, atol=2e-4)


@pytest.mark.parametrize("seed", range(3))
def test_friction_of_bonds(seed):
    _, told, build = hidden("friction", "creeping_bonds", seed=seed)
    t = H * np.arange(20_001)
    levels = [felt(build, v * np.minimum(t, 1.0), v, t=t) / told["coulomb"] for v in (1.0, 10.0, 100.0)]
    at = [level[9_999] for level in levels]
    # By the logarithm of speed, and 1 at 10 mm/s.
    assert at[1] == pytest.approx(1.0, abs=1e-4) and at[2] - at[1] == pytest.approx(at[1] - at[0], rel=1e-3)
    scale = (at[2] - at[0]) / (2 * np.log(10.0))
    slow = 10 / np.sinh(1 / scale)
    assert 0.99e-6 <= slow <= 1.01e-4
    # At rest it fades by the logarithm of time, −σ ln(t/t_0).
    rest = levels[1][10_001 + np.array([100, 1000, 9_990])]
    # tanh(s/2σ) falls by e^{−u t/ℓσ}.
    logs = np.log(np.tanh(rest / (2 * scale)))
    lengths = -slow / scale * np.array([0.09, 0.899]) / np.diff(logs)
    assert lengths[0] == pytest.approx(lengths[1], rel=1e-2) and 0.00199 <= lengths[1] <= 0.00604


@pytest.mark.parametrize("seed", range(3))
def test_a_rough_track(seed):
    _, told, build = hidden("friction", "rough_track", seed=seed)
    x = np.linspace(-2.0, 4.0, 30_001)
    forth = felt(build, x)[10_000:20_000] / told["coulomb"]
    back = felt(build, x[::-1])[10_001:20_001][::-1] / told["coulomb"]
    shares = []
    for level in (forth, -back):
        assert np.mean(level) == pytest.approx(1.0, abs=1e-3) and 0.149 <= np.std(level) <= 0.281
        waves = np.abs(np.fft.rfft(level))[1:]
        # Waves of the depth over 1 to 24, each as high as it is long, and none that is shorter.
        assert np.allclose(waves[:24] * np.arange(1, 25), waves[0], rtol=0.02) and np.all(waves[25:] < 2e-3 * waves[0])
        shares.append(np.std(level))
    assert shares[0] == pytest.approx(shares[1], rel=1e-3) and np.corrcoef(forth, back)[0, 1] < 0.9
    # The same the next time.
    assert np.allclose(felt(build, np.tile(x, 2))[40_050:50_000] / told["coulomb"], forth[49:9_999], atol=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_spots_that_melt(seed):
    _, told, build = hidden("friction", "flash_heat", seed=seed)
    x = np.linspace(-1.5, -1.0, 3001)
    speeds = np.array([0.01, 3.9, 16.0, 40.0, 160.0, 1e7])
    level = np.array([felt(build, x, v)[-1] for v in speeds]) / told["coulomb"]
    weak = level[-1]
    melts = (level[2:5] - weak) / (1 - weak) * speeds[2:5]
    assert np.allclose(level[:2], 1.0) and 0.35 <= weak <= 0.6
    assert np.allclose(melts, melts[0], rtol=1e-3) and 3.99 <= melts[0] <= 15.01
    assert felt(build, x[::-1], -40.0)[-1] == pytest.approx(-level[3] * told["coulomb"])


def test_a_mass_held_by_dry_friction():
    omega, rubs = 2 * np.pi * 40.0, 100.0
    half = np.pi / omega
    t = H * np.arange(1200)
    out = _dry(np.where(t > 0, 6 * rubs, 0.0), H, omega, rubs) / rubs
    # Den Hartog: half swings of 5, 3 and 1 about where friction lets it rest, and then it sticks.
    for k, high in enumerate((5.0, 3.0, 1.0)):
        part = (t > k * half + 4 * H) & (t < (k + 1) * half - 4 * H)
        wave = high * np.cos(omega * (t[part] - k * half - 1.5 * H))
        assert np.allclose(out[part] - 6, (-1) ** (k + 1) * wave, atol=0.12 * high + 0.04)
    assert np.all(out[t > 3 * half + 10 * H] == 6.0)
    small = np.interp(t, [0, 0.05, 0.12], [0.0, 90.0, -99.0])
    assert np.array_equal(_dry(small, H, omega, rubs), small)


@pytest.mark.parametrize("seed", range(3))
def test_the_mass_on_a_dry_mount(seed):
    _, told, build = hidden("inertia", "dry_mount", seed=seed)
    t = H * np.arange(20_000)
    ramp = 1000.0 * np.minimum(t, 1.0)
    along = felt(build, t, 0.0, ramp) / (1e-3 * told["mass"])
    holds = t[np.argmax(np.abs(along - ramp) > 1e-6)]
    assert 0.08 <= holds <= 0.2002 and along[-1] == pytest.approx(1000.0)
    jump = felt(build, t, 0.0, np.where(t > 0.05, 1000.0, 0.0)) / (1e-3 * told["mass"])
    begins = np.argmax(jump > 1)
    missing = 1 - jump[begins] / 1000.0
    assert 0.5 <= missing / (1 - holds) <= 0.81
    quarter = (np.argmax(jump >= 1000.0) - begins) * H
    assert 29 <= 0.25 / quarter <= 73


@pytest.mark.parametrize("seed", range(3))
def test_a_liquid_inside(seed):
    _, told, build = hidden("inertia", "liquid_inside", seed=seed)
    t = H * np.arange(8_000)
    got = felt(build, t, 0.0, np.ones_like(t)) / (1e-3 * told["mass"])
    slow = np.flatnonzero(1 - got < 0.03)[0]
    tau = -(np.pi**2) / 4 * 0.02 / np.log((1 - got[slow + 200]) / (1 - got[slow]))
    assert 0.0299 <= tau <= 0.1502
    # As the wall's layer grows, 2 √(t/π τ) of it.
    share = (1 - got[slow]) * np.pi**2 / 8 * np.exp(np.pi**2 * (slow + 1) * H / (4 * tau))
    assert 0.5 <= share <= 0.8
    early = np.arange(round(0.01 * tau / H), round(0.12 * tau / H))
    wanted = 1 - share + share * 2 * np.sqrt((early + 1) * H / (np.pi * tau))
    assert np.allclose(got[early], wanted, atol=0.008)


def test_a_phase_that_slips_at_each_turn():
    x = np.concatenate([np.linspace(0, 1, 101), np.linspace(1, 0.5, 51)[1:], np.linspace(0.5, 1, 51)[1:]])
    phase = _slipped(x, np.array([0.3, -1.0, 0.5]), 0.1)
    way = 0.01 * np.arange(201)
    wanted = np.interp(way, [0.01, 0.11, 1.01, 1.11, 1.51, 1.61], [0, 0.3, 0.3, -0.7, -0.7, -0.2])
    assert np.allclose(phase, wanted)


@pytest.mark.parametrize("seed", range(3))
def test_a_cage_that_slips(seed):
    _, told, build = hidden("cogging", "cage_slips", seed=seed)
    period = told["period"]
    one = np.linspace(0, 1.2 * period, 3001)
    x = np.concatenate([one if k % 2 == 0 else one[::-1] for k in range(120)])
    force = felt(build, x) / told["amplitude"]
    phases = []
    for stroke, part in zip(x.reshape(120, -1), force.reshape(120, -1), strict=True):
        angle, kept = 2 * np.pi * stroke / period, slice(700, None)
        (c, s), rest, *_ = np.linalg.lstsq(np.stack([np.cos(angle), np.sin(angle)], 1)[kept], part[kept], rcond=None)
        assert np.hypot(c, s) == pytest.approx(1.0, abs=1e-6) and np.sum(rest) < 1e-6
        phases.append(np.arctan2(c, s))
    jumps = (np.diff(phases) + np.pi) % (2 * np.pi) - np.pi
    assert 0.26 <= np.sqrt(np.mean(jumps**2)) <= 0.9 and np.max(np.abs(jumps)) <= 0.8 * np.sqrt(3.0)
    # Either way, evenly spread: as many beyond half of the greatest as below.
    assert 0.35 < np.mean(np.abs(jumps) > np.max(np.abs(jumps)) / 2) < 0.65 and abs(np.mean(jumps)) < 0.2


@pytest.mark.parametrize("seed", range(3))
def test_an_observer_that_learns_a_ripple(seed):
    _, told, build = hidden("cogging", "observer", seed=seed)
    period = told["period"]
    t = H * np.arange(60_000)

    def wave(waves_s):
        # Whole waves of the last part.
        x = waves_s * period * t
        last = slice(60_000 - round(round(1.5 * waves_s) / waves_s / H), None)
        return phasor(felt(build, x, t=t)[last], x[last], period) / told["amplitude"]

    quick, others = wave(200.0), [wave(f) for f in (2.0, 8.0)]
    assert np.abs(quick) == pytest.approx(1.0, abs=0.06)
    # At rest 1 − k of it is left, between 1 − k/(1 + i ω τ).
    rest = np.array([felt(build, np.full(100, at), t=0.05 * np.arange(100))[-1] for at in period * np.arange(16) / 16])
    left = np.sqrt(2 * np.mean(rest**2)) / told["amplitude"]
    assert 0.2 <= left <= 0.5
    missing = [1 - w / (quick / np.abs(quick)) for w in others]
    late = [-np.imag(m) / np.real(m) / (2 * np.pi * f) for m, f in zip(missing, (2.0, 8.0), strict=True)]
    takes = [np.real(m) * (1 + (2 * np.pi * f * late[0]) ** 2) for m, f in zip(missing, (2.0, 8.0), strict=True)]
    assert late[0] == pytest.approx(late[1], rel=0.15) and 0.018 <= late[0] <= 0.126
    assert takes == pytest.approx([1 - left, 1 - left], rel=0.1)


@pytest.mark.parametrize("seed", range(3))
def test_signals_that_shrink_with_speed(seed):
    _, told, build = hidden("encoder_error", "past_cutoff", seed=seed)
    period = told["period"]

    def wave(speed, part=1):
        x = np.linspace(0.0, 4 * period, 40_001)
        off = build.plant.encoder[0](x / speed, x) - x
        return np.abs(phasor(off[10_000:-10_000], x[10_000:-10_000], period / part)) / told["amplitude"]

    # −log(1 + i o e^{−iθ}) has parts of oⁿ/n.
    offset = 2 * np.pi * told["amplitude"] / period
    assert wave(1e-3) == pytest.approx(1.0, rel=1e-3) and wave(1e-3, 2) == pytest.approx(offset / 2, rel=1e-2)
    grows = wave(60.0)
    assert 1.59 <= grows <= 3.01 and wave(60.0, 2) == pytest.approx(grows**2 * offset / 2, rel=1e-2)
    assert wave(30.0) == pytest.approx(np.sqrt(1 + (grows**2 - 1) / 4), rel=1e-3)


@pytest.mark.parametrize("seed", range(3))
def test_a_correction_that_is_looked_up_now_and_then(seed):
    _, told, build = hidden("encoder_error", "corrected_late", seed=seed)
    period, amplitude = told["period"], told["amplitude"]
    t = H * np.arange(40_000)
    slow = np.linspace(0.0, period, 40_001)[:-1]
    error = build.plant.encoder[0](t, slow) - slow
    assert np.abs(phasor(error, slow, period)) == pytest.approx(amplitude, rel=0.02)
    x = 5.0 * period * t
    error = build.plant.encoder[0](t, x) - x
    # It jumps at even ticks; between them it is as it would be without it, but for a constant.
    bends = np.abs(np.diff(error, 3))
    jumps = np.flatnonzero(bends > 0.2 * np.max(bends))
    tick = np.median(np.diff(jumps[np.diff(jumps, prepend=-99) > 9])) * H
    fits = []
    for guess in np.linspace(tick - 1.5 * H, tick + 1.5 * H, 301):
        before = 5.0 * period * np.floor(t / guess) * guess
        angles = (2 * np.pi * part / period for part in (x, before))
        columns = np.stack([f(a[::4]) for a in angles for f in (np.sin, np.cos)], 1)
        parts, rest, *_ = np.linalg.lstsq(columns, error[::4] / amplitude, rcond=None)
        fits.append((float(np.sum(rest)), guess, parts))
    rest, tick, parts = min(fits, key=lambda fit: fit[0])
    whole, taken = np.hypot(*parts[:2]), np.hypot(*parts[2:])
    print(rest / len(t), tick, whole, taken)
    assert rest < 1e-3 * len(t[::4]) and 0.0079 <= tick <= 0.0251
    assert whole - taken == pytest.approx(1.0, abs=1e-3) and 0.299 <= taken / whole <= 0.501
