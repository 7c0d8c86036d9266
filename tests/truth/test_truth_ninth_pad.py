"""The ninth shapes of the pad's own effects against closed forms and independent counts."""

import numpy as np
import pytest
from scipy.special import gamma

from .effects.ninth_pad import (
    CrookedWalls,
    DiscSpring,
    _charge,
    _crack,
    _learnt,
    _since_touch,
    _slid,
    arm_rates,
    disc_rates,
    fractional_speed,
    lost_work,
)
from .laws import Power
from .motion import Path
from .pad import Pad, simulate
from .sets import shapes_of
from .test_truth_effects import cycles, hidden

pytestmark = pytest.mark.long

SOFT = Pad(Power(3.0, 0.0), (0.5,), (0.3,))


@pytest.mark.parametrize("seed", range(3))
def test_what_is_glued_peels(seed):
    motion = Path(-0.5).to(2.0, 50.0).hold(4.0).to(-0.5, 50.0).hold(6.0).motion()
    fine, told, build = hidden("separation", "peels", pad=SOFT, motion=motion, seed=seed)
    assert told == {} and build.believed.contact == "bonded"
    t = np.arange(4.2, 10.0, 1e-2)
    held = simulate(Pad(SOFT.law, SOFT.shares, SOFT.rates, "bonded"), motion, t).force_N
    # Out of contact the rest bears nothing, so that what is felt is what is left of the glue.
    left = 12 * fine.at(t) / held
    # 0.5 · 6 (1 − e^{−1.2}) fades with 0.3/s, so its impulse is known.
    impulse = 0.5 * 6 * -np.expm1(-0.3 * 4.0) / 0.3 * -np.expm1(-0.3 * (t - t[0]))
    slope, start = np.polyfit(impulse, np.log(left), 1)
    assert np.allclose(np.log(left), start + slope * impulse, atol=2e-2) and 0.8 < np.exp(start) < 1.0
    assert 0.19 <= -1 / slope / 6 <= 0.83


def test_charge():
    touching = np.zeros(4000, dtype=bool)
    touching[500:1000] = touching[2000:2500] = True
    q = _charge(touching, 1e-3, 0.5, 2.0)
    assert np.all(q[:500] == 0) and np.all(q[500:1000] == 0.5)
    assert q[1999] == pytest.approx(0.5 * np.exp(-0.5)) and q[2100] == pytest.approx(0.5 + 0.25 * np.exp(-0.5))
    assert q[3499] == pytest.approx(q[2100] * np.exp(-0.5))


@pytest.mark.parametrize("seed", range(3))
def test_charged_surfaces(seed):
    path = Path(-0.5, np.inf)
    for _ in range(4):
        path.to(0.5, 20.0).hold(0.1).to(-0.5, 20.0).hold(0.1)
    motion = path.motion()
    fine, told, _ = hidden("adhesion", "charged", motion=motion, seed=seed)
    x, touch = fine.reported_mm, np.minimum((fine.time_s / motion.duration_s * 4).astype(int), 3)
    assert np.all(fine.force_N[(fine.time_s > 2e-4) & (fine.time_s < 0.024)] == 0)
    out = (fine.time_s > 0.14) & (x < -1e-3)
    root = 1 - x[out] / told["range"] * np.expm1(0.5)
    # Charge and gap are apart; P/e at the range, in and out.
    charge = np.sqrt(-fine.force_N[out] / told["pull_off"]) * root
    first = (touch[out] == 0) & (fine.time_s[out] < 0.24)
    fades_s = -1 / np.polyfit(fine.time_s[out][first], np.log(charge[first]), 1)[0]
    assert 4.9 < fades_s < 20.1
    # Out at 0.175 s and so on, in again 0.15 s later.
    since = (fine.time_s[out] - 0.175) % 0.3
    levels = np.array([np.median((charge * np.exp(since / fades_s))[touch[out] == k]) for k in range(4)])
    assert 0.39 < levels[0] < 0.61
    left = levels[:-1] * np.exp(-0.15 / fades_s)
    assert levels[1:] == pytest.approx(left + levels[0] * (1 - left), rel=2e-3)
    inside = (fine.time_s > 0.1) & (fine.time_s < 0.12)
    assert np.allclose(3 * x[inside] - fine.force_N[inside], told["pull_off"] * levels[0] ** 2, rtol=0.05)


@pytest.mark.parametrize("seed", range(3))
def test_a_film_that_is_drawn(seed):
    pulls = {}
    for speed in (0.5, 10.0):
        motion = Path(-0.5, np.inf).to(0.5, 20.0).hold(0.1).to(-0.5, speed).motion()
        fine, told, _ = hidden("adhesion", "viscous_film", motion=motion, seed=seed)
        gap, out = -fine.reported_mm, (fine.time_s > 0.15) & (fine.reported_mm < -1e-3)
        pulls[speed] = np.interp(
            told["range"] * np.array([0.1, 0.5, 1.0, 2.0]), gap[out], -fine.force_N[out] / told["pull_off"]
        )
        assert np.all(fine.force_N[fine.time_s < 0.024] == 0) and -fine.force_N.min() <= told["pull_off"] * (1 + 1e-9)
    # P/e at the range at 10 mm/s, and a twentieth of it at 0.5 mm/s; −1/3 powers are straight lines of the gap.
    assert pulls[10.0][2] == pytest.approx(np.exp(-1), rel=2e-3)
    assert pulls[0.5][1:] == pytest.approx(pulls[10.0][1:] / 20, rel=5e-3) or pulls[10.0][1] == pytest.approx(1.0)
    roots = pulls[0.5] ** (-1 / 3)
    assert (roots[3] - roots[0]) / (roots[2] - roots[0]) == pytest.approx(1.9 / 0.9, rel=5e-3)
    # Without a gap v/v_0.
    quick = 0.5 * (roots[0] - 0.1 * (roots[2] - roots[0]) / 0.9) ** 3
    assert 0.98 < quick < 4.04


def test_laws():
    walls, disc = CrookedWalls(2.0, 0.03, 1.5), DiscSpring(2.0, 1.2, 1.5)
    for depth in (0.01, 0.3, 1.0, 1.5, 4.0):
        f = walls.force(depth) / 2
        assert 1.5 * (f + 0.03 * (1 / (1 - f) ** 2 - 1)) == pytest.approx(depth) and 0 < f < 1
    assert walls.force(1e-6) / 1e-6 == pytest.approx(2 / (1.5 * 1.06), rel=1e-3)
    # Flat at 1.2 thicknesses: A c there, and its slope is 1 − c²/2 of A/t.
    assert disc.force(1.8) == pytest.approx(2 * 1.2)
    assert (disc.force(1.8001) - disc.force(1.7999)) / 2e-4 == pytest.approx(2 / 1.5 * (1 - 0.72), rel=1e-3)
    # Odd about the flat: F(2c) is twice that of the flat.
    assert disc.force(3.6) == pytest.approx(2 * disc.force(1.8)) and disc.force(2.4) + disc.force(1.2) == (
        pytest.approx(2 * disc.force(1.8))
    )
    for law in (walls, disc):
        assert law.force(-1.0) == 0 and np.all(np.diff(law.force(np.linspace(0, 4.0, 500))) > 0)
    for shape, kind in (("crooked_walls", CrookedWalls), ("disc_spring", DiscSpring)):
        for seed in range(3):
            _, told, build = hidden("elastic_law", shape, seed=seed)
            assert told["law"] == shape and isinstance(build.plant.pad.law, kind)
            assert build.plant.pad.law.force(2.0) == pytest.approx(6.0)
            assert build.believed.law.name in ("power", "exponential")


@pytest.mark.parametrize("seed", range(3))
def test_softening_takes_time(seed):
    parts = {}
    for hold in (0.05, 0.4, 6.0):
        motion = Path(0.0, np.inf).to(2.0, 1e4).hold(hold).to(0.1, 1e4).hold(0.2).motion()
        fine, told, _ = hidden("stress_softening", "takes_time", motion=motion, seed=seed)
        assert np.allclose(fine.force_N[(fine.time_s > 1e-3) & (fine.time_s < hold)], 6.0)
        below = -told["depth"] * np.log1p((fine.force_N[-1] / 0.3 - 1) / told["share"])
        parts[hold] = (below + 0.1) / 2.0
    # M comes to 2 mm by 1 − e^{−t/τ}.
    assert parts[6.0] == pytest.approx(1.0, abs=1e-3)
    taus = [-hold / np.log(1 - parts[hold]) for hold in (0.05, 0.4)]
    assert taus[0] == pytest.approx(taus[1], rel=0.02) and 0.099 < taus[1] < 0.405


def test_what_is_learnt():
    x = np.concatenate([np.full(1000, 1.0), np.full(1000, 0.2), np.full(500, 1.5)])
    x[0] = 0.0
    m = _learnt(x, 1e-3, 0.5)
    assert m[999] == pytest.approx(-np.expm1(-1.998)) and np.all(m[1000:2000] == m[999])
    assert m[-1] == pytest.approx(1.5 - (1.5 - m[999]) * np.exp(-1.0))


@pytest.mark.parametrize("size", [1.0, 2.5])
@pytest.mark.parametrize("seed", range(3))
def test_chains_that_end(seed, size):
    motion = cycles(1.0, 0.0, 1.6, 0.0, 2.0, 0.0)
    fine, told, _ = hidden("stress_softening", "chain_limit", size, motion=motion, seed=seed)
    x, deepest = fine.reported_mm, np.maximum.accumulate(fine.reported_mm)
    inside = x > 0.05
    kept = fine.force_N[inside] / (3 * x[inside])
    m, y = (deepest[inside] / 2) ** 2, (x[inside] / 2) ** 2
    # (J − m)/(J − y): J from each point where it has lost something.
    lost = kept < 0.98
    limits = (m - y * kept)[lost] / (1 - kept[lost])
    assert np.ptp(limits) < 1e-3 * np.median(limits) and np.all(kept[m == y] == pytest.approx(1.0))
    limit, there = np.median(limits), max(1 - told["depth"], 0.2) ** 2
    assert (limit - 1) / (limit - there) == pytest.approx(1 - told["share"], rel=1e-3)


def test_a_crack():
    x = np.tile(np.concatenate([np.linspace(0, 2, 401), np.linspace(2, 0, 401)]), 12)
    a = _crack(x, 2.0, 2.4, 0.05, 3.0)
    # a^{1 − m/2} falls by (m/2 − 1) grows in each stroke, in and not out.
    ends = a[400::802]
    assert ends == pytest.approx((1 - 0.2 * 0.05 * np.arange(1.0, 13)) ** -5.0, rel=1e-4)
    assert np.all(np.diff(a) >= 0) and np.all(a[401:802] == ends[0])
    # Half a stroke 2^{−m} of it, wherever it begins.
    half = _crack(np.linspace(1, 2, 200), 2.0, 2.4, 1e-6, 3.0)[-1] - 1
    assert half == pytest.approx(1e-6 * 0.5**2.4, rel=1e-3)
    assert _crack(np.tile(x, 5), 2.0, 2.4, 0.08, 3.0)[-1] == 3.0


@pytest.mark.parametrize("seed", range(3))
def test_damage_by_a_crack(seed):
    path = Path(0.0, np.inf)
    for _ in range(10):
        path.to(2.0, 50.0).to(0.0, 50.0)
    fine, told, _ = hidden("damage", "crack", motion=path.motion(), seed=seed)
    tops = np.arange(0.04, 0.8, 0.08)
    lost = -np.log(fine.at(tops) / 6.0)
    assert lost[0] == pytest.approx(2 * told["rate"], rel=1e-3)
    steps = np.diff(np.concatenate([[0.0], lost]))
    assert np.all(np.diff(steps) > 0) and 1.2 < steps[-1] / steps[0] < 5


@pytest.mark.parametrize("seed", range(3))
def test_damage_by_what_is_dissipated(seed):
    pad = Pad(Power(3.0, 0.0), (0.3, 0.2), (8.0, 0.5), "bonded")
    motion = Path(0.0, np.inf).to(2.0, 40.0).hold(3.0).to(0.5, 10.0).hold(1.0).to(1.5, 5.0).hold(0.5).motion()
    fine, told, _ = hidden("damage", "by_loss", pad=pad, motion=motion, seed=seed)
    plain = simulate(pad, motion, fine.time_s)
    # Work that came in, less what the springs hold: 3 δ²/2 of the first, w²/6 of c w as w is a force on 3 N/mm.
    t, x = fine.time_s, motion.position(fine.time_s)
    u = 3 * x
    w = []
    for nu in pad.rates:
        kept = np.exp(-nu * 1e-4)
        state, out = 0.0, np.zeros_like(u)
        for k in range(1, len(u)):
            state = state * kept + (u[k] - u[k - 1]) * np.exp(-nu * 5e-5)
            out[k] = state
        w.append(out)
    work = np.cumsum(np.diff(u, prepend=0.0) * plain.force_N)
    held = 0.5 * u**2 / 2 + sum(c * out**2 / 2 for c, out in zip(pad.shares, w, strict=True))
    spent = work - held
    lost = lost_work(u, 1e-4, np.array(pad.shares), np.array(pad.rates)).cumsum()
    assert np.allclose(spent, lost, atol=0.01 * lost[-1])
    gain = build_gain(told, t, x, spent)
    assert np.sum(np.maximum(np.diff(x), 0)) == pytest.approx(3.0, abs=1e-3)
    some = slice(2000, None, 997)
    # u softened by the gain, and relaxed again.
    z, force = np.zeros(2), np.zeros_like(u)
    for k in range(1, len(u)):
        before, now = u[k - 1] * gain[k - 1], u[k] * gain[k]
        rates = np.array(pad.rates)
        z = (z * (1 - rates * 5e-5) + rates * 1e-4 * (before + now) / 2) / (1 + rates * 5e-5)
        force[k] = now - np.array(pad.shares) @ z
    assert np.allclose(fine.force_N[some], force[some], atol=3e-3)


def build_gain(told, t, x, spent):
    """What 3 mm of loading leave, by the share of the loss there was so far."""
    return np.exp(-3.0 * told["rate"] * spent / spent[-1])


def test_a_play_from_rest():
    assert _slid(np.array([0.0, 0.3, 1.0, 0.8, 0.5, 0.0, 0.9, 1.2]), 0.3).tolist() == (
        pytest.approx([0.0, 0.0, 0.7, 0.7, 0.7, 0.3, 0.6, 0.9])
    )


@pytest.mark.parametrize("seed", range(3))
def test_a_set_that_flows_back(seed):
    motion = Path(0.0, np.inf).to(2.0, 5.0).to(0.3, 5.0).to(0.0, 5.0).to(2.0, 5.0).motion()
    fine, told, _ = hidden("permanent_set", "flows_back", motion=motion, seed=seed)
    x, t = fine.reported_mm, fine.time_s
    sunk = (x - fine.force_N / 3) / told["set"]
    top, again = np.interp([0.4, 1.2], t, sunk)
    assert top == pytest.approx(again, abs=1e-2)
    yields = 2.0 - top / 2
    assert 0.299 <= yields / 2 <= 0.421
    first, last = (t < 0.39) & (x > 0.01), (t > 0.81) & (fine.force_N > 0.01)
    assert np.allclose(sunk[first], 2 * np.maximum(x[first] - yields, 0.0), atol=1e-2)
    # At rest 2 Y of it is left, the middle of which and of 2 (2 − Y) is the depth.
    assert np.allclose(sunk[last], np.maximum(2 * yields, 2 * (x[last] - yields)), atol=1e-2)
    assert (top + 2 * yields) / 2 == pytest.approx(2.0, abs=1e-2)


@pytest.mark.parametrize("seed", range(3))
def test_bonds_that_form_anew(seed):
    motion = Path(0.0, np.inf).to(2.0, 1e3).hold(2.0).to(-0.5, 1e3).hold(1.0).to(1.0, 1e3).hold(4.0).motion()
    fine, told, _ = hidden("permanent_set", "two_networks", motion=motion, seed=seed)
    sunk = (fine.reported_mm - fine.force_N / 3) / told["set"]
    # 2 mm for 2 s and 1 mm for 4 s: all of it is 8 mm s, a quarter of which comes in each second of the first.
    for at, wanted in ((1.0, 0.5), (1.9, 0.95), (3.5, 1.125), (5.0, 1.5), (7.0, 2.0)):
        assert np.interp(at, fine.time_s, sunk) == pytest.approx(wanted, abs=5e-3)


def test_spectra():
    for barrier in (3.0, 5.0):
        weights, rates = arm_rates(2.0, barrier)
        assert weights.sum() == pytest.approx(1.0) and weights @ np.exp(-rates / 2) == pytest.approx(np.exp(-1.0))
        # The ends of the cells' middles are 0.05 and 0.95 along the arm.
        assert rates[0] / rates[-1] == pytest.approx(np.exp(barrier * (0.95**2 - 0.05**2)))
        t = np.geomspace(0.05, 3.0, 20)
        s = np.linspace(0, 1, 20_001)
        unit = rates[0] * np.exp(barrier * 0.05**2)
        exact = [np.trapezoid(2 * (1 - s) * np.exp(-unit * at * np.exp(-barrier * s**2)), s) for at in t]
        assert np.allclose(np.exp(-np.outer(t, rates)) @ weights, exact, atol=0.01)
    for poisson in (0.0, 0.3):
        weights, rates = disc_rates(1.5, poisson)
        assert weights.sum() == pytest.approx(1.0) and rates[0] == 1.5 and np.all(weights > 0)
        # Many terms add to one by themselves: the last would else not be less than those before.
        many, fast = disc_rates(1.5, poisson, 60)
        assert np.all(np.diff(many[:-1]) < 0) and np.allclose(many[:5], weights[:5])
        # From the sixtieth on α is n π − 3 π/4 or so: 2/((1 − n) α²) each.
        assert many[-1] == pytest.approx(2 / ((1 - poisson) * np.pi**2 * 58.75), rel=0.05)
        # Far out the roots are π apart.
        assert np.diff(np.sqrt(fast * disc_root(poisson) ** 2 / 1.5))[-1] == pytest.approx(np.pi, abs=1e-3)


def disc_root(poisson):
    """The first root of J_1/(x J_0) = (1 − n)/(1 − 2n) by the series of both, by halving."""
    k = np.arange(30)
    factorial = np.cumprod(np.concatenate([[1.0], k[1:].astype(float)]))
    low, high = 0.5, 2.4
    for _ in range(60):
        x = (low + high) / 2
        zero = np.sum((-1.0) ** k * (x / 2) ** (2 * k) / factorial**2)
        one = np.sum((-1.0) ** k * (x / 2) ** (2 * k + 1) / (factorial**2 * (k + 1)))
        low, high = (x, high) if one < (1 - poisson) / (1 - 2 * poisson) * x * zero else (low, x)
    return x


@pytest.mark.parametrize("shape", shapes_of("missing_relaxation_mode", "ninth"))
@pytest.mark.parametrize("seed", range(3))
def test_what_is_added_has_its_share(shape, seed):
    pad = Pad(Power(3.0, 0.0), (0.3,), (50.0,))
    fine, told, build = hidden(
        "missing_relaxation_mode", shape, pad=pad, motion=Path(2.0).hold(60.0).motion(), seed=seed
    )
    assert build.believed.rates == (50.0,) and sum(build.plant.pad.shares) == pytest.approx(0.3 + told["share"])
    t = np.array([0.2, 1.0, 3.0, 4.0]) / told["rate"]
    left = (fine.at(t) / 6 - (1 - 0.3 - told["share"]) - 0.3 * np.exp(-50.0 * t)) / told["share"]
    if shape == "arm_retraction":
        assert left[1] == pytest.approx(np.exp(-1.0), abs=0.02) and left[2] > np.exp(-3.0)
    else:
        assert left[0] < np.exp(-0.2) and np.log(left[2] / left[3]) == pytest.approx(1.0, rel=0.03)


@pytest.mark.parametrize("seed", range(3))
def test_rates_under_pressure(seed):
    depths, rates = np.array([0.02, 0.5, 1.0, 1.5, 2.0]), []
    for depth in depths:
        pad = Pad(Power(3.0, 0.0), (0.4,), (2.0,))
        motion = Path(depth).hold(1.5).motion()
        fine, told, _ = hidden("depth_dependent_relaxation", "under_pressure", pad=pad, motion=motion, seed=seed)
        rates.append(-np.diff(np.log(fine.at(np.array([0.2, 0.7])) / (3 * depth) - 0.6))[0] / 0.5 / 2.0)
    assert rates[-1] == pytest.approx(1 + 2.0 * told["slope"], abs=3e-3) and np.all(np.diff(rates) < 0)
    parts = np.linspace(0.05, 0.3, 501)[:, None]
    curves = (1 + depths / 2 / parts) ** (np.log(rates[-1]) / np.log(1 + 1 / parts))
    assert np.min(np.max(np.abs(curves - rates), axis=1)) < 3e-3


@pytest.mark.parametrize("seed", range(4))
def test_rates_that_stay(seed):
    pad = Pad(Power(3.0, 0.0), (0.4,), (2.0,), "bonded")
    motion = Path(0.0, np.inf).to(2.0, 1e4).hold(1.0).to(0.5, 1e4).hold(1.0).to(-0.5, 1e4).hold(1.0).motion()
    fine, told, _ = hidden("depth_dependent_relaxation", "stays_drained", pad=pad, motion=motion, seed=seed)
    rates = []
    for begin, rest in ((0.2, 3.6), (1.2, 0.9), (2.2, 0.0)):
        t = begin + np.array([0.0, 0.5])
        rates.append(-2 * np.diff(np.log(np.abs(fine.at(t) - rest)))[0])
    # As quick at 0.5 mm as at 2 mm, and as ever once it is let go.
    assert rates == pytest.approx([2 * (1 + 2 * told["slope"])] * 2 + [2.0], rel=5e-3)
    assert _since_touch(np.array([-1.0, 0.5, 0.2, 0.7, -0.1, 0.3])).tolist() == [0, 0.5, 0.5, 0.7, 0, 0.3]


def test_a_fractional_derivative():
    h, t = 1e-4, 1e-4 * np.arange(20_001)
    for alpha in (0.75, 0.9):
        made = fractional_speed(np.where(t > 0, 3.0, 0.0), h, alpha)
        exact = 3.0 * t ** (1 - alpha) / gamma(2 - alpha)
        some = (t > 0.005) & (t < 1.5)
        assert np.allclose(made[some], exact[some], rtol=0.03)
        # Stopped, it fades by the difference of two of these.
        made = fractional_speed(np.where((t > 0) & (t <= 0.1), 3.0, 0.0), h, alpha)
        later = t > 0.12
        exact = 3.0 * (t[later] ** (1 - alpha) - (t[later] - 0.1) ** (1 - alpha)) / gamma(2 - alpha)
        assert np.allclose(made[later][:5000], exact[:5000], rtol=0.08)


@pytest.mark.parametrize("pad", [Pad(Power(3.0, 0.0)), Pad(Power(3.0, 0.0), (0.3, 0.2), (8.0, 0.5), "bonded")])
@pytest.mark.parametrize("seed", range(3))
def test_a_springpot(pad, seed):
    motion = Path(0.0, np.inf).to(1.9, 10.0).hold(0.3).motion()
    fine, told, _ = hidden("viscous_damping", "springpot", pad=pad, motion=motion, seed=seed)
    t = np.array([0.02, 0.05, 0.1, 0.15])
    added = (fine.at(t) - simulate(pad, motion, t).force_N) / 10.0 / told["coefficient"]
    # t^{1 − α}, which is 1 at 0.1 s.
    power = np.polyfit(np.log(t), np.log(added), 1)
    assert added[2] == pytest.approx(1.0, rel=0.03) and 0.08 < power[0] < 0.27
    assert np.allclose(np.log(added), np.polyval(power, np.log(t)), atol=0.01)
    after = fine.at(0.45) - simulate(pad, motion, np.array([0.45])).force_N[0]
    assert 0 < after / 10.0 / told["coefficient"] < 0.4


@pytest.mark.parametrize("seed", range(3))
def test_a_filling_that_thins(seed):
    motion = Path(0.0, np.inf).to(1.9, 20.0).hold(30.0).to(0.3, 20.0).to(1.9, 20.0).hold(0.1).motion()
    fine, told, _ = hidden("viscous_damping", "thixotropic", motion=motion, seed=seed)
    x, v = fine.reported_mm, motion.velocity(fine.time_s)
    moves = (np.abs(v) > 1) & (np.roll(v, 3) == v) & (np.roll(v, -3) == v) & (x > 0.3)
    thick = (fine.force_N - 3 * x)[moves] / v[moves] / told["coefficient"]
    t = fine.time_s[moves]
    # Thinner along each move, thick again after 30 s, and not so between the last two.
    fresh, again, worn = (thick[(t > a) & (t < a + 0.01)].mean() for a in (0.02, 30.097, 30.177))
    assert np.all(np.diff(thick[t < 0.09]) < 1e-6) and worn < again - 0.1 * fresh
    # By e within ℓ to 0.3 of it, but for what sets meanwhile: from three points as far apart.
    a, b, c = np.interp([0.02, 0.05, 0.08], t, thick)
    length = 0.6 / np.log((a - b) / (b - c))
    assert 0.55 < length < 2.05
    way = np.concatenate([np.linspace(0.3, 1.9, 300)])
    start = a + (a - b) * np.exp(0.4 / length) * -np.expm1(-0.4 / length) / -np.expm1(-0.6 / length)
    # All but a tenth of what can go is above 0.3 of the start.
    ends = (a * c - b * b) / (a + c - 2 * b)
    assert ends / start == pytest.approx(0.3, abs=0.12) and way[0] == 0.3
    assert np.mean(thick) == pytest.approx(1.0, abs=0.1)
