"""The ninth shapes of what lies between the motor and the pad against closed forms."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.special import jv

from .cases import draw_case
from .effects.ninth_machine import Matted, _coasts, _flattens, _gas, _hangs, _hardens, _leans, _ribs, _surges
from .laws import Power
from .motion import Path
from .sets import shapes_of
from .test_truth_effects import hidden

pytestmark = pytest.mark.long

OTHERS = ("friction", "adhesion", "viscous_damping", "stress_softening", "damage")
FRAMES = ("disc_spring", "gas_strut")


def test_they_are_of_the_ninth():
    assert set(FRAMES) <= set(shapes_of("frame_compliance", "ninth"))
    assert set(shapes_of("friction", "ninth")) >= {"ribs", "rubber_bell", "ring_rolls", "tared"}
    for id in ("backlash", "inertia", "cogging", "encoder_error"):
        assert len(shapes_of(id, "ninth")) >= 2


def test_a_disc_that_is_pressed_flat():
    way = np.linspace(0.0, 1.0, 1001)
    # Almen and László, y in thicknesses, r = 0.9: P = y ((r − y)(r − y/2) + 1), by what it is where it is flat.
    y = 0.9 * way
    load = y * ((0.9 - y) * (0.9 - y / 2) + 1) / 0.9
    assert np.allclose(_flattens(load, 0.9), way, atol=1e-6)
    assert np.all(_flattens(np.array([1.0, 1.5, 9.0]), 0.9) == 1.0)
    assert _flattens(np.array([-0.2]), 0.9) == pytest.approx(-0.2 / 1.81)


@pytest.mark.parametrize("seed", range(3))
def test_a_frame_with_disc_springs(seed):
    fine, told, build = hidden("frame_compliance", "disc_spring", 2.0, seed=seed)
    given, force = fine.reported_mm - fine.probe_mm, fine.cell_N
    order = np.argsort(force)
    at = 0.6 * build.force_N
    assert np.interp(at, force[order], given[order]) / at == pytest.approx(told["compliance"], rel=1e-3)
    level = np.linspace(0.02, 0.99, 98) * force.max()
    softness = np.gradient(np.interp(level, force[order], given[order]), level) / told["compliance"]
    top = int(np.argmax(softness))
    # Ever softer until it is flat, and from there on the linear part alone.
    assert 0.7 * build.force_N <= level[top] <= 0.96 * build.force_N and np.all(np.diff(softness[1 : top - 1]) > -2e-3)
    if level[top] < 0.92 * force.max():
        rest = softness[-3:]
        assert np.ptp(rest) < 1e-3 and rest.mean() < 0.75 < softness[top]
    # 1 + r² to 1 − r²/2 between the two ends of what it has of its own.
    if level[top] < 0.92 * force.max():
        ratio = (softness[top] - rest.mean()) / (softness[0] - rest.mean())
        assert 1.36 / 0.82 * 0.75 <= ratio <= 2.01 / 0.495 * 1.05


def test_a_gas_that_warms():
    h, tau = 1e-3, 0.5
    pressure = np.concatenate([[1.0], np.full(3000, 1.7)])
    warm = _gas(pressure, h, tau)
    # At once T = p^(1 − 1/γ); then it cools at constant pressure, within γ τ.
    first = 1.7 ** (0.4 / 1.4) - 1
    assert np.allclose(warm[1:] - 1, first * np.exp(-np.arange(1, 3001) * h / 0.7), rtol=1e-9)
    ramp = np.linspace(1.0, 3.0, 20_001)
    assert _gas(ramp, 1e-4, 1e6)[-1] == pytest.approx(3 ** (2 / 7), rel=1e-4)
    # p^(1/γ) V stays where no heat is lost; p V stays where all of it is.
    slow = _gas(ramp, 1e-4, 1e-4)
    assert np.allclose(slow, 1.0, atol=1e-3)


@pytest.mark.parametrize("seed", range(3))
def test_a_frame_with_a_strut_of_gas(seed):
    motion = Path(-0.5).to(1.9, 400.0).hold(16.0).to(0.9, 0.5).hold(13.0).motion()
    fine, told, build = hidden("frame_compliance", "gas_strut", 2.0, motion=motion, seed=seed)
    given, force = fine.reported_mm - fine.probe_mm, fine.cell_N
    ends = [np.interp(s, fine.time_s, part) for part in (given, force) for s in (16.0, motion.duration_s - 0.05)]
    # As it has cooled  d = L F/(F_0 + F): of two points F_0 and L, and the secant at 0.6 of the greatest force.
    (d1, d2), (f1, f2) = ends[:2], ends[2:]
    filled = f1 * f2 * (d1 - d2) / (d2 * f1 - d1 * f2)
    stroke = d1 * (filled + f1) / f1
    assert 0.79 <= filled / build.force_N <= 2.02
    assert stroke / (filled + 0.6 * build.force_N) == pytest.approx(told["compliance"], rel=5e-3)
    # Just after the press it has hardly cooled: (1 + F/F_0) (1 − d/L)^1.4 is 1.
    k = np.argmax(fine.reported_mm >= 1.9 - 1e-9)
    tight = (1 + force[k] / filled) * (1 - given[k] / stroke) ** 1.4
    assert tight == pytest.approx(1.0, abs=0.012) and (1 + force[k] / filled) * (1 - given[k] / stroke) > 1.03


@pytest.mark.parametrize("shape", FRAMES)
@pytest.mark.parametrize("other", OTHERS)
def test_the_frame_goes_with_other_effects(shape, other):
    shapes = {"frame_compliance": shape, other: shapes_of(other, "first")[0]}
    short = Path(-0.5).to(1.4, 60.0).hold(0.1).to(2.0, 8.0).hold(0.1).to(1.0, 60.0).hold(0.1).to(-0.5, 60.0).hold(0.1)
    plain = {"motion": short.motion(), "rate_hz": 500.0, "law": "power", "contact": "unilateral"}
    truth = draw_case(7, ("frame_compliance", other), 1.0, shapes, **plain).truth
    fine, compliance = truth.fine, truth.parameters["frame_compliance"]["compliance"]
    given, loaded = fine.reported_mm - fine.probe_mm, fine.cell_N > 0.3 * truth.drawn.force_N
    assert np.all(np.isfinite(fine.cell_N)) and loaded.any()
    assert np.all(np.abs(given[loaded] / (compliance * fine.cell_N[loaded]) - 1) < 0.45)


def test_a_part_that_coasts():
    # In at 20 mm/s, stopped at once at 1 mm; out again.
    h, gap, slows = 1e-4, 0.05, 400.0
    x = np.concatenate([np.arange(0, 1.0, 20 * h), np.full(1000, 1.0), 1.0 - np.arange(0, 0.5, 1 * h)])
    y = _coasts(x, h, gap, slows)
    stop = np.argmax(x >= 1.0 - 1e-12)
    since = h * np.arange(1, 20)
    assert np.all(y[:stop] == x[:stop])
    # v t − b t²/2, until the other flank stops it.
    assert np.allclose(y[stop : stop + 19], 1.0 - 20 * h + 20 * (since) - slows * since**2 / 2, atol=2e-3)
    assert np.allclose(y[stop + 40 :], x[stop + 40 :] + gap)
    # Slowly it stops on its own after v²/2 b, within the play.
    x = np.concatenate([np.arange(0, 0.2, 4 * h), np.full(1000, 0.2)])
    y = _coasts(x, h, gap, slows)
    assert y[-1] - 0.2 == pytest.approx(4.0**2 / 800, abs=5e-4)


@pytest.mark.parametrize("seed", range(3))
def test_a_play_that_is_coasted_through(seed):
    motion = Path(-0.5, np.inf).to(1.5, 50.0).hold(0.3).to(0.5, 50.0).hold(0.3).to(1.2, 0.5).hold(0.1).motion()
    fine, told, _ = hidden("backlash", "coasts", motion=motion, seed=seed)
    lost = (fine.probe_mm - fine.reported_mm) / told["gap"]
    at = np.interp([0.02, 0.3, 0.62, 2.0], fine.time_s, lost)
    # On the other flank after a quick stop, either way, and where it was pushed after a slow one.
    assert at == pytest.approx([0.0, 1.0, 0.0, 0.0], abs=1e-6)
    assert np.all((lost > -1e-9) & (lost < 1 + 1e-9)) and abs(lost[-1]) < 0.05
    # After 2 mm/s it goes on by v²/2 b, b of 200 to 800 mm/s².
    slow = Path(-0.5, np.inf).to(0.5, 2.0).hold(0.2).motion()
    fine, told, _ = hidden("backlash", "coasts", motion=slow, seed=seed)
    went = fine.probe_mm[-1] - fine.reported_mm[-1]
    assert 4 / 1600 - 3e-4 <= went <= 4 / 400 + 1e-4


@pytest.mark.parametrize("seed", range(3))
def test_a_nut_that_is_lifted(seed):
    assert np.allclose(_hangs(np.array([0.0, 0.5, 0.99, 1.3, 2.0, 0.9]), 0.2, 0.8, 1.0), [0, 0.5, 0.8, 1.1, 1.8, 0.9])
    motion = Path(-0.5).to(1.8, 2.0).to(-0.3, 2.0).motion()
    fine, told, build = hidden("backlash", "hangs", motion=motion, seed=seed)
    lost = (fine.reported_mm - fine.probe_mm) / told["gap"]
    v = motion.velocity(fine.time_s)
    lifts = []
    for way in (v > 1.9, v < -1.9):
        x, y, gone = fine.reported_mm[way], fine.probe_mm[way], lost[way]
        assert np.all((gone > -1e-6) & (gone < 1 + 1e-6))
        assert np.allclose(gone[x < 0.2], 0.0, atol=1e-6) and np.allclose(gone[x > 1.4], 1.0, atol=1e-6)
        between = (gone > 1e-6) & (gone < 1 - 1e-6)
        # Meanwhile the probe stands still, over a way of one gap.
        assert np.ptp(y[between]) < 1e-6 and np.ptp(x[between]) == pytest.approx(told["gap"], abs=5e-4)
        lifts.append(3 * np.mean(y[between]) / build.force_N)
    weight = np.mean(lifts)
    assert 0.2 <= weight <= 0.4 and 0.099 <= (lifts[1] - lifts[0]) / 2 / weight <= 0.251


def test_a_surface_that_closes_by_the_logarithm():
    law = Matted(Power(3.0, 0.0), 0.004, 0.02)
    force = np.array([0.003, 0.02, 0.5, 3.0])
    assert np.allclose(law.force(force / 3.0 + 0.004 * np.log(1 + force / 0.02)), force, rtol=2e-4)
    assert law.force(0.0) == 0 and np.all(law.force(np.array([-0.1, 0.0])) == 0)
    for seed in range(3):
        offsets = []
        for depth in (2.3, 1.0):
            fine, told, build = hidden("contact_offset", "matted", motion=Path(depth).hold(0.1).motion(), seed=seed)
            offsets.append((depth - fine.force_N[-1] / 3.0, fine.force_N[-1]))
        made = build.plant.pad.law
        # Between two loads by u ln F/F'; and as stated under the greatest.
        (far, most), (near, less) = offsets
        assert far - near == pytest.approx(made.height * np.log((made.first + most) / (made.first + less)), abs=1e-6)
        assert far - made.height * np.log(most / 6.0) == pytest.approx(told["offset"], abs=2e-5)
        assert 0 < made.height <= 0.004 and 0.003 <= made.first / 6 <= 0.01


def felt(build, x, v=0.0, a=0.0, t=None):
    t = 1e-4 * np.arange(len(x)) if t is None else t
    return build.plant.felt[0](t, x, np.broadcast_to(v, x.shape), np.broadcast_to(a, x.shape))


def lost_each_wave(soft):
    """Mean pull over F_0: what is lost at each snap, by its energies before and after, over the wave of 2π."""
    snaps = np.arccos(-1 / soft)
    place = snaps + soft * np.sin(snaps)

    def energy(theta):
        return (place - theta) ** 2 / 2 / soft - np.cos(theta)

    roots, grid = [], np.linspace(snaps + 1e-3, place + soft, 4001)
    pull = place - grid - soft * np.sin(grid)
    for k in np.flatnonzero(pull[:-1] * pull[1:] < 0):
        roots.append(brentq(lambda q: place - q - soft * np.sin(q), grid[k], grid[k + 1]))
    stable = [q for q in roots if 1 + soft * np.cos(q) > 0]
    # The first that is met downhill, as it has no speed.
    return (energy(snaps) - energy(min(stable))) / (2 * np.pi)


def test_a_wiper_on_ribs():
    for soft in (3.0, 4.5, 6.0):
        force = _ribs(np.linspace(0.0, 20.0, 100_001), 1.0, soft)
        assert np.max(np.abs(force)) <= 1 + 1e-9 and np.max(force) > 0.999
        assert np.mean(force[50_001:]) == pytest.approx(lost_each_wave(soft), abs=3e-3)
        # Between snaps F = sin θ with X = θ + η sin θ, so that it begins at a slope of 2π/(1 + η).
        assert force[10] / (20.0 * 10 / 100_000) == pytest.approx(2 * np.pi / (1 + soft), rel=1e-3)
        back = _ribs(np.concatenate([np.linspace(0, 10, 20_001), np.linspace(10, 0, 20_001)]), 1.0, soft)
        assert np.mean(back[-10_000:]) == pytest.approx(-lost_each_wave(soft), abs=3e-3)
    for seed in range(3):
        _, told, build = hidden("friction", "ribs", seed=seed)
        force = felt(build, np.linspace(-3.0, 0.0, 60_001)) / told["coulomb"]
        assert np.mean(force[20_000:]) == pytest.approx(1.0, abs=0.02)
        snaps = np.flatnonzero(np.diff(force) < -0.15)
        apart = np.diff(snaps[np.diff(snaps, prepend=-9) > 2]) * 5e-5
        assert np.allclose(apart[3:], apart[3], atol=1.1e-4) and 0.0399 <= np.mean(apart[3:]) <= 0.1501


@pytest.mark.parametrize("seed", range(3))
def test_rubber_that_rubs_most_at_some_speed(seed):
    _, told, build = hidden("friction", "rubber_bell", seed=seed)
    speeds, x = np.geomspace(0.01, 1e4, 1201), np.linspace(-1.5, -1.0, 5001)
    level = np.array([felt(build, x, v)[-1] for v in speeds]) / told["coulomb"]
    within = (speeds >= 1 - 1e-9) & (speeds <= 100 + 1e-9)
    logs = np.log(speeds)
    assert np.trapezoid(level[within], logs[within]) / np.log(100) == pytest.approx(1.0, abs=2e-3)
    # What it has more is a parabola in the logarithms.
    base = level[0]
    top = np.argmax(level)
    near = level > base + 0.1 * (level[top] - base)
    curve = np.polyfit(logs[near] - logs[top], np.log(level[near] / base - 1), 2)
    wide = np.sqrt(-1 / curve[0])
    assert 0.99 <= wide <= 1.61 and 4.9 <= speeds[top] <= 31 and 0.58 <= level[top] / base - 1 <= 1.52
    assert np.allclose(np.polyval(curve, logs[near] - logs[top]), np.log(level[near] / base - 1), atol=1e-3)


@pytest.mark.parametrize("seed", range(3))
def test_a_ring_that_rolls(seed):
    _, told, build = hidden("friction", "ring_rolls", seed=seed)
    x = np.concatenate([np.linspace(-2, -1, 10_001), np.full(500, -1.0), np.linspace(-1, -2, 10_001)[1:]])
    x = np.concatenate([x, np.full(500, -2.0), np.linspace(-2, -1.97, 301)])
    force = felt(build, x) / told["coulomb"]
    slides = np.argmax(force > 0.99)
    assert np.all(force[slides + 30 : 10_501] == 1.0)
    # At rest it stays; then back over all of the way that it has, and slides.
    out = -force[10_500:20_500]
    rolls = out[60]
    assert 0.4 <= rolls <= 0.65 and np.all(out[40 : np.argmax(out > rolls + 1e-9)] == rolls)
    way = np.argmax(out > rolls + 1e-9) * 1e-4
    assert 0.0995 <= way <= 0.401 and np.all(out[round(way / 1e-4) + 30 :] == 1.0)
    # The first way is a half of that, and 30 µm of another turn are rolled.
    assert slides * 1e-4 == pytest.approx(way / 2, abs=4e-3) and force[-1] == pytest.approx(rolls)


def test_friction_that_was_taken_for_zero():
    ways = set()
    for seed in range(8):
        _, told, build = hidden("friction", "tared", seed=seed)
        x = np.concatenate([np.full(100, -2.0), np.linspace(-2, -1, 10_001), np.linspace(-1, -2, 10_001)[1:]])
        force = felt(build, x) / told["coulomb"]
        assert np.all(force[:100] == 0.0)
        into, out = force[5000], force[15_000]
        assert into - out == pytest.approx(2.0) and {round(abs(into)), round(abs(out))} == {0, 2}
        ways.add(round(into))
    assert ways == {0, 2}


def test_waves_in_a_spring_that_hangs_free():
    h, steps = 1e-4, 100
    v = np.concatenate([np.zeros(10), np.full(4000, 1.0)])
    # Without loss tanh: 1 for a way to and fro, then −1, and so on.
    square = _surges(v, h, steps, 1e-9)[10:]
    assert np.allclose(square.reshape(-1, steps)[:8], np.resize([1.0, -1.0], 8)[:, None])
    t, s = h * np.arange(30_000), 2j * np.pi * 35.0
    turned = _surges(np.cos(abs(s) * t), h, steps, 0.002)
    # A step is smoothed by the value at its end, which is a half of it sooner.
    back = np.exp(-s * (steps - 0.5) * h) / (1 + 0.002 * s)
    late = slice(20_000, None)
    wanted = np.real((1 - back) / (1 + back) * np.exp(s * t))
    assert np.allclose(turned[late], wanted[late], atol=0.02 * np.max(np.abs(wanted)))


@pytest.mark.parametrize("seed", range(3))
def test_the_mass_of_a_spring_that_hangs(seed):
    _, told, build = hidden("inertia", "surge", seed=seed)
    t = 1e-4 * np.arange(60_000)
    # Evenly faster: m a in the mean over a period, which is four times the way along it.
    force = felt(build, t, t, np.ones_like(t), t=t) / (1e-3 * told["mass"])
    assert np.mean(force[30_000:]) == pytest.approx(1.0, abs=0.01)
    jump = felt(build, t, np.where(t > 0.1, 1.0, 0.0), t=t) / (1e-3 * told["mass"])
    first = np.flatnonzero(np.abs(np.diff(jump)) > 0)[1] * 1e-4 - 0.1
    # 2/(2T + τ) until it is back.
    high = jump[round(0.1 / 1e-4) + 20]
    assert 0.0079 <= first <= 0.0302 and 0.099 * first <= 2 / high - first <= 0.256 * first
    assert abs(jump[-1]) < 1e-3 * high


@pytest.mark.parametrize("damping", [0.05, 0.15])
def test_a_mount_that_hardens(damping):
    h, omega, way = 1e-4, 2 * np.pi * 40.0, 0.03
    t = h * np.arange(1500)
    a = np.interp(t, [0, 0.01, 0.02, 0.03, 0.05, 0.06, 0.08], [0, 0, 3000.0, 3000.0, 0, -2000.0, 0])

    def motion(s, state):
        r, v = state
        return v, -np.interp(s, t, a) - 2 * damping * omega * v - omega**2 * r * (1 + (r / way) ** 2)

    exact = solve_ivp(motion, (0, t[-1]), (0.0, 0.0), t_eval=t, rtol=1e-9, atol=1e-12, max_step=1e-4)
    r, v = exact.y
    wanted = -2 * damping * omega * v - omega**2 * r * (1 + (r / way) ** 2)
    got = _hardens(a, h, omega, damping, way)
    assert np.allclose(got[1:], wanted[1:], atol=2e-3 * np.max(np.abs(wanted)))
    # Pushed evenly and for long, it goes along.
    assert _hardens(np.full(60_000, 500.0), h, omega, damping, way)[-1] == pytest.approx(500.0, rel=1e-4)


@pytest.mark.parametrize("seed", range(3))
def test_the_mass_on_a_hard_mount(seed):
    _, told, build = hidden("inertia", "hard_mount", seed=seed)
    t = 1e-4 * np.arange(40_000)
    small, rings = np.zeros(40_000), np.zeros(40_000)
    small[100:] = 1.0
    rings[100:140] = 2000.0
    step = felt(build, t, 0.0, small) / (1e-3 * told["mass"])
    assert step[-1] == pytest.approx(1.0, rel=1e-3) and 0.19 <= step[100] <= 0.51
    free = felt(build, t, 0.0, rings)[140:]
    turns = np.flatnonzero((free[:-1] < 0) & (free[1:] >= 0))
    cycles = np.diff(turns) * 1e-4
    # Quick while it swings far; 25 to 60 Hz as it dies away.
    assert cycles[0] < 0.93 * cycles[-3] and 24 <= 1 / cycles[8] <= 66


def phasor(wave, x, period):
    return 2j * np.mean(wave * np.exp(-2j * np.pi * x / period))


def test_a_wave_that_leans():
    angle = 2 * np.pi * np.arange(4096) / 4096
    for give in (0.4, 0.7, -0.55):
        wave = _leans(angle, give)
        for n in (1, 2, 3, 5):
            part = 2 * np.mean(wave * np.sin(n * angle))
            assert part == pytest.approx(2 / give * jv(n, n * give) / n, abs=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_a_ripple_that_leans(seed):
    _, told, build = hidden("cogging", "leans", seed=seed)
    period = told["period"]
    x = np.linspace(-20 * period, 0, 40_000, endpoint=False)
    force = felt(build, x)
    parts = [phasor(force, x, period / n) for n in (1, 2, 3)]
    assert np.abs(parts[0]) == pytest.approx(told["amplitude"], rel=1e-6)
    give = brentq(lambda e: jv(2, 2 * e) / 2 / jv(1, e) - np.abs(parts[1] / parts[0]), 0.05, 0.95)
    assert 0.4 <= give <= 0.7
    assert np.abs(parts[2] / parts[0]) == pytest.approx(jv(3, 3 * give) / 3 / jv(1, give), rel=1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_magnets_that_lose_strength(seed):
    _, told, build = hidden("cogging", "demagnetised", seed=seed)
    period, amplitude = told["period"], told["amplitude"]
    air = np.linspace(-20 * period, 0, 40_000, endpoint=False)

    def after(depth):
        # There, back into air, and along.
        x = np.concatenate([np.linspace(-0.1, depth, 500), air])
        return np.abs(phasor(felt(build, x)[500:], air, period)) / amplitude

    levels = [after(depth) for depth in (-0.01, 0.5, 1.0, 2.0, 2.3)]
    assert 1.5 <= levels[0] <= 2.0 and levels[3] == pytest.approx(1.0, abs=1e-9) and levels[4] == levels[3]
    # By the load that was borne, 3 N/mm of 6 N.
    assert levels[1] == pytest.approx(0.75 * levels[0] + 0.25, abs=1e-9)
    assert levels[2] == pytest.approx(0.5 * levels[0] + 0.5, abs=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_a_map_that_has_shifted(seed):
    _, told, build = hidden("encoder_error", "old_map", seed=seed)
    period = told["period"]
    x = np.linspace(0.0, period, 50_401)[:-1]
    error = build.plant.encoder[0](x, x) - x
    parts = np.abs(np.array([phasor(error, x, period / n) for n in range(1, 30)]))
    assert parts[0] == pytest.approx(told["amplitude"], rel=1e-3)
    # Of a sine that is straight between n points: harmonics m n ± 1, of 1/(m n ± 1)² by the first.
    others = np.flatnonzero(parts[1:] > 0.01 * np.max(parts[1:])) + 2
    points = others[0] + 1
    assert 5 <= points <= 8 and np.all((others % points == 1) | (others % points == points - 1))
    assert parts[points - 2] / parts[points] == pytest.approx((points + 1) ** 2 / (points - 1) ** 2, rel=2e-3)
    # The first of the map is sinc² of its size: from it what the shift is.
    whole, shrinks = parts[points - 2] * (points - 1) ** 2, np.sinc(1 / points) ** 2
    cosine = (1 + shrinks**2 - (parts[0] * shrinks / whole) ** 2) / (2 * shrinks)
    assert 0.29 <= np.arccos(cosine) <= 0.61


@pytest.mark.parametrize("seed", range(3))
def test_signals_that_are_read_in_turn(seed):
    _, told, build = hidden("encoder_error", "in_turn", seed=seed)
    period, t = told["period"], 1e-4 * np.arange(100_000)

    def error(speed):
        x = speed * t
        return build.plant.encoder[0](t, x) - x, x

    # With sin θ + o alone the first harmonic is o, and the second half its square.
    slow = 0.1 * period
    waves = [np.abs(phasor(*error(slow), period / n)) for n in (1, 2)]
    offset = 2 * np.pi * told["amplitude"] / period
    assert waves[0] == pytest.approx(told["amplitude"], rel=2e-3)
    assert waves[1] == pytest.approx(offset / 2 * told["amplitude"], rel=0.2)
    # At speed v Δ/2 of half the period more, and as much in the mean: 0.5 to 1 of the other at 60 mm/s.
    x = 60.0 * 1e-5 * np.arange(200_000)
    x = x[: int(np.floor(x[-1] / period) * period / 6e-4)]
    off = build.plant.encoder[0](1e-5 * np.arange(len(x)), x) - x
    late = -2 * np.mean(off) if np.mean(off) < 0 else 2 * np.mean(off)
    assert 0.48 <= late / 2 / told["amplitude"] <= 1.02
    assert np.abs(phasor(off, x, period / 2)) == pytest.approx(late / 2, rel=0.15)
