"""The truth against closed forms, against cruder integration, and against what physics allows."""

import csv

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import curve_fit

from . import crb, draw
from .dataset import Clocks, make
from .laws import Exponential, Hertz, Polynomial, Power, Tanh
from .motion import Path, random_steps, rich, sampled, sinusoids, staircase
from .noise import Coloured, Noise, Quantised, SamplingJitter, StampJitter, StudentT, White
from .pad import Pad, simulate

C, NU = (0.25, 0.15, 0.1), (20.0, 4.0, 0.35)
IDEAL = np.inf


def ramp_and_hold(depth=2.0, speed=10.0, hold=5.0):
    return Path(0.0, IDEAL).to(depth, speed).hold(hold).motion()


def linear_ramp(t, v, K, c=C, nu=NU):
    """v K [c_0 t + Σ c_i (1 − e^{−ν_i t})/ν_i] for t ≥ 0."""
    t = np.maximum(t, 0)
    return v * K * ((1 - sum(c)) * t + sum(a * -np.expm1(-n * t) / n for a, n in zip(c, nu, strict=True)))


# --- closed forms ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("law", [Power(3.0, 0.0), Polynomial((0.0, 3.0))])
def test_linear_pad_ramp_and_hold(law):
    t = np.linspace(0, 5, 1234)
    F = simulate(Pad(law, C, NU), ramp_and_hold(), t).force_N
    expected = linear_ramp(t, 10.0, 3.0) - linear_ramp(t - 0.2, 10.0, 3.0)
    assert np.max(np.abs(F - expected)) < 1e-12


def test_exponential_pad_on_an_ideal_ramp():
    # w_i = ∫ e^{−ν(t−s)} m e^{bvs} v ds = m v (e^{bvt} − e^{−νt}) / (bv + ν)
    m, b, v = 2.24, 0.69, 5.0
    t = np.linspace(0, 0.6, 301)
    modes = [c * m * v * (np.exp(b * v * t) - np.exp(-n * t)) / (b * v + n) for c, n in zip(C, NU, strict=True)]
    expected = (1 - sum(C)) * m / b * np.expm1(b * v * t) + sum(modes)
    F = simulate(Pad(Exponential(m, b), C, NU), Path(0.0, IDEAL).to(3.0, v).motion(), t).force_N
    assert np.max(np.abs(F - expected)) < 1e-12


def test_linear_pad_under_a_sinusoid():
    # δ = A (1 − cos ωt): w = K A ω (ν sin ωt − ω cos ωt + ω e^{−νt}) / (ν² + ω²)
    A, f, K = 1.0, 1.3, 2.0
    om, t = 2 * np.pi * f, np.linspace(0, 4 / f, 2001)
    F = simulate(Pad(Power(K, 0.0), C, NU, "bonded"), Path().sines([(A, f)], 4 / f).motion(), t).force_N
    w = [K * A * om * (n * np.sin(om * t) - om * np.cos(om * t) + om * np.exp(-n * t)) / (n**2 + om**2) for n in NU]
    expected = (1 - sum(C)) * K * A * (1 - np.cos(om * t)) + sum(c * x for c, x in zip(C, w, strict=True))
    assert np.max(np.abs(F - expected)) < 1e-11


def test_step_response_is_the_reduced_relaxation():
    pad = Pad(Exponential(2.0, 0.7), C, NU)
    t = np.linspace(0, 8, 500)
    held = Path(1.5).hold(8.0).motion()
    assert np.allclose(simulate(pad, held, t).force_N, pad.law.force(1.5) * pad.relaxation(t), rtol=1e-12)


@pytest.mark.parametrize("law", [Exponential(2.24, 0.69), Power(2.0, 1.2), Polynomial((0.0, 1.0, 0.5, 0.2))])
def test_a_very_fast_press_gives_the_elastic_response(law):
    t = np.linspace(0, 2e-6, 50)
    F = simulate(Pad(law, C, NU), Path(0.0, IDEAL).to(2.0, 1e6).motion(), t).force_N
    assert np.allclose(F, law.force(1e6 * t), rtol=1e-4)


# --- against other integration ----------------------------------------------------------------------------------


def test_bonded_against_a_general_ode_solver_in_the_velocity_form():
    # w_i' = −ν_i w_i + K(δ) δ̇, F = c_0 F^e + Σ c_i w_i, K = m e^{bδ}: the paper's (5), another state than pad.py's.
    m, b = 2.24, 0.69
    motion = Path(0.0, 800.0).to(2.0, 30.0).hold(0.5).to(0.4, 5.0).hold(0.5).to(1.2, 20.0).hold(0.3).motion()
    t = np.linspace(0, motion.duration_s, 400)

    def rate(s, w):
        return -np.array(NU) * w + m * np.exp(b * motion.position(s)) * motion.velocity(s)

    w = solve_ivp(rate, (0, t[-1]), [0.0] * 3, t_eval=t, rtol=1e-8, atol=1e-9, max_step=0.004).y
    expected = (1 - sum(C)) * m / b * np.expm1(b * motion.position(t)) + np.array(C) @ w
    F = simulate(Pad(Exponential(m, b), C, NU, "bonded"), motion, t).force_N
    assert np.max(np.abs(F - expected)) < 1e-5


def euler(pad, motion, t):
    """Crude: z' = ν (u − z) with u = max(F^e, Σ c z) if unilateral, in steps of the times given."""
    u_all, z, F = pad.law.force(motion.position(t)), np.zeros(len(pad.rates)), []
    c, nu = np.array(pad.shares), np.array(pad.rates)
    for k, u in enumerate(u_all):
        held = max(u, c @ z) if pad.contact == "unilateral" else u
        F.append(held - c @ z)
        z = z + (t[min(k + 1, len(t) - 1)] - t[k]) * nu * (held - z)
    return np.array(F)


@pytest.mark.parametrize("contact", ["bonded", "unilateral"])
def test_contact_against_crude_steps_and_their_halving(contact):
    motion = sinusoids(-0.3, 1.5, [2.0, 3.1], periods=4)
    pad = Pad(Power(3.0, 0.5), C, NU, contact)
    coarse, fine = (np.linspace(0, motion.duration_s, n) for n in (40_001, 80_001))
    exact = simulate(pad, motion, coarse).force_N
    first, second = euler(pad, motion, coarse), euler(pad, motion, fine)[::2]
    assert np.max(np.abs(2 * second - first - exact)) < 3e-4 * np.max(exact)
    assert np.max(np.abs(second - exact)) < 0.6 * np.max(np.abs(first - exact))


@pytest.mark.parametrize("contact", [pytest.param("bonded", marks=pytest.mark.long), "unilateral"])
@pytest.mark.parametrize("law", [Exponential(2.24, 0.69), Power(2.0, 0.4), Hertz(0.1, 5.0), Tanh(4.0, 1.0, 0.5)])
def test_step_size_does_not_matter(contact, law):
    motion = random_steps(np.random.default_rng(3), 2.5, steps=12)
    t = np.linspace(0, motion.duration_s, 300)
    pad = Pad(law, C, NU, contact)
    reference = simulate(pad, motion, t, max_step_s=2e-4)
    coarse = simulate(pad, motion, t, max_step_s=0.02)
    assert np.max(np.abs(coarse.force_N - reference.force_N)) < 1e-6
    assert np.max(np.abs(simulate(pad, motion, t).force_N - reference.force_N)) < 2e-7
    times = [np.array([s for s, _ in r.events]) for r in (coarse, reference)]
    assert len(times[0]) == len(times[1]) and np.allclose(times[0], times[1], atol=1e-6)


# --- contact ------------------------------------------------------------------------------------------------------


def test_let_go_surface_recovers_and_meets_the_probe():
    # One mode, relaxed at d; then released at once: u = c_1 K d e^{−ν c_0 t}. A probe that waits at δ_1 is met when
    # that is K δ_1, and the force then rises to c_0 K δ_1 as K δ_1 c_0 (1 − e^{−ν s}).
    K, c, nu, d, waits = 3.0, 0.5, 2.0, 2.0, 0.4
    pad = Pad(Power(K, 0.0), (c,), (nu,))
    motion = Path(0.0, IDEAL).to(d, 1e7).hold(30.0).to(waits, 1e7).hold(6.0).motion()
    t = 30 + np.linspace(0.01, 6, 600)
    out = simulate(pad, motion, t)
    meets = np.log(c * d / waits) / (nu * (1 - c))
    assert [kind for _, kind in out.events] == ["let_go", "return"]
    assert out.events[1][0] == pytest.approx(30 + meets, abs=1e-5)
    s = t - 30 - meets
    free = K * c * d * np.exp(-nu * (1 - c) * (t - 30))
    assert np.allclose(out.elastic_N, np.where(s < 0, free, K * waits), atol=1e-5)
    assert np.allclose(out.force_N, np.where(s < 0, 0, K * waits * (1 - c) * -np.expm1(-nu * s)), atol=1e-5)


def test_a_returning_probe_meets_the_surface_below_its_first_height():
    K, c, nu, d = 3.0, 0.5, 2.0, 2.0
    pad = Pad(Power(K, 0.0), (c,), (nu,))
    rest = 0.7
    motion = Path(0.0, IDEAL).to(d, 1e7).hold(30.0).to(-0.1, 1e7).hold(rest).to(d, 1e7).hold(1.0).motion()
    t = np.linspace(30, motion.duration_s, 5001)
    out = simulate(pad, motion, t)
    assert float(motion.position(out.events[-1][0])) == pytest.approx(c * d * np.exp(-nu * (1 - c) * rest), abs=1e-4)
    assert out.force_N[-1] < K * d  # it remembers


def test_unilateral_never_pulls_and_bonded_does():
    motion = rich(2.0, hold_s=0.4, long_hold_s=3.0)
    t = np.arange(0, motion.duration_s, 0.004)
    pad = draw.POLYURETHANE
    free = simulate(pad, motion, t)
    stuck = simulate(Pad(pad.law, pad.shares, pad.rates, "bonded"), motion, t)
    assert free.force_N.min() > -1e-11 and np.all(free.force_N[free.let_go] == 0)
    assert stuck.force_N.min() < -0.05 and not stuck.events
    first = free.events[0][0]
    assert np.allclose(free.force_N[t < first], stuck.force_N[t < first], atol=1e-12)
    # Out of contact the surface only rises, and never above where it was at first.
    both = free.let_go[1:] & free.let_go[:-1]
    assert np.all(np.diff(free.elastic_N)[both] <= 1e-15) and free.elastic_N.min() >= 0
    assert np.all(free.elastic_N - pad.law.force(motion.position(t)) >= -1e-11)


@pytest.mark.parametrize("seed", range(6))
def test_cycles_from_and_to_the_air_lose_energy(seed):
    rng = np.random.default_rng(seed)
    drawn = draw.pad(rng, laws=draw.LAWS + draw.OTHER_LAWS, contacts=("unilateral",))
    path = Path(-0.2)
    for _ in range(4):
        path.to(drawn.depth_mm * rng.uniform(0.4, 1), rng.uniform(2, 50)).hold(rng.uniform(0, 1)).to(-0.2, 20)
    motion = path.hold(1.0).motion()
    t = np.linspace(0, motion.duration_s, 20_001)
    F, x = simulate(drawn.pad, motion, t).force_N, motion.position(t)
    work = np.concatenate([[0.0], np.cumsum(np.diff(x) * (F[1:] + F[:-1]) / 2)])
    closed = x <= -0.2 + 1e-12
    assert np.all(np.diff(work[closed]) >= -1e-9) and work[-1] > 0
    assert np.max(F) <= drawn.force_N


def test_a_pad_without_relaxation_is_its_law():
    motion = rich(2.0, hold_s=0.1, long_hold_s=0.5)
    t = np.linspace(0, motion.duration_s, 999)
    law = Exponential(2.0, 0.5)
    for contact in ("bonded", "unilateral"):
        F = simulate(Pad(law, contact=contact), motion, t).force_N
        assert np.allclose(F, law.force(motion.position(t)), atol=1e-12)


def test_impossible_pads_are_refused():
    for shares, rates in (((0.6, 0.6), (3.0, 1.0)), ((-0.1,), (1.0,)), ((0.1,), (0.0,)), ((0.1, 0.2), (1.0,))):
        with pytest.raises(ValueError, match="shares"):
            Pad(Power(1.0, 0.0), shares, rates)


# --- motion -------------------------------------------------------------------------------------------------------


def test_motion_is_continuous_and_keeps_its_limits():
    motion = staircase([1.0, 2.0, 2.02, 0.5], [80.0, 20.0, 80.0, 5.0], 1.0, -0.5, 6000.0)
    t = np.linspace(0, motion.duration_s, 200_001)
    x, v = motion.position(t), motion.velocity(t)
    assert np.max(np.abs(v)) == pytest.approx(80.0)
    assert np.max(np.abs(np.diff(v))) <= 6000.0 * (t[1] - t[0]) * (1 + 1e-6)
    assert np.allclose(np.cumsum((v[1:] + v[:-1]) / 2) * (t[1] - t[0]), x[1:] - x[0], atol=1e-6)
    # A trapezoid takes d/v + v/a, a way below v²/a a triangle of twice √(d/a).
    ends = np.cumsum([0.5, 1.5 / 80 + 80 / 6000, 1.0, 1 / 20 + 20 / 6000, 1.0, 2 * np.sqrt(0.02 / 6000)])
    assert motion.position(ends[[0, 1, 3, 5]]) == pytest.approx([-0.5, 1.0, 2.0, 2.02], abs=1e-12)
    assert np.all(np.abs(motion.velocity(ends[[1, 3, 5]] - 1e-4)) == pytest.approx(0.6))
    assert motion.position(1e9) == 0.5 and motion.velocity(1e9) == 0


def test_sines_and_samples():
    motion = sinusoids(0.3, 2.3, [0.5, 1.0, 4.0], periods=2)
    t = np.linspace(0, motion.duration_s, 4001)
    x = motion.position(t)
    assert x.max() <= 2.3 + 1e-9 and x.min() == -0.5
    inside = t[np.min(np.abs(t[:, None] - motion.corners_s()), axis=1) > 1e-4]
    slope = (motion.position(inside + 1e-5) - motion.position(inside - 1e-5)) / 2e-5
    assert np.allclose(slope, motion.velocity(inside), atol=1e-5)
    again = sampled(t, x)
    assert np.allclose(again.position(t), x) and again.position((t[7] + t[8]) / 2) == pytest.approx((x[7] + x[8]) / 2)


# --- noise --------------------------------------------------------------------------------------------------------


def test_noise_has_the_figures_it_states():
    rng, n, dt = np.random.default_rng(5), 400_000, 0.002
    t = np.arange(n) * dt
    x = Coloured(0.02, 0.01).draw(t, rng)
    assert np.std(x) == pytest.approx(0.02, rel=0.02)
    for lag in (1, 3, 5, 10):
        assert np.mean(x[lag:] * x[:-lag]) / np.var(x) == pytest.approx(np.exp(-lag * dt / 0.01), abs=0.01)
    fresh = Coloured(0.02, 0.01).whiten(t, x[:, None])[:, 0]
    assert np.std(fresh) == pytest.approx(1, rel=0.01) and abs(np.mean(fresh[1:] * fresh[:-1])) < 0.01
    w = White(0.3).draw(t, rng)
    assert np.std(w) == pytest.approx(0.3, rel=0.01) and abs(np.mean(w[1:] * w[:-1])) < 0.01 * 0.09
    s = StudentT(0.3, 6.0).draw(t, rng)
    assert np.std(s) == pytest.approx(0.3, rel=0.03)
    assert np.mean(s**4) / np.var(s) ** 2 > 4.5  # 3 + 6/(dof − 4) = 6 in the limit
    q = Quantised(0.5, White(0.5))
    y = q.apply(np.full(n, 0.123), t, rng)
    assert np.allclose(y / 0.5, np.round(y / 0.5)) and np.std(y) == pytest.approx(q.std, rel=0.01)


def test_the_two_jitters_differ_in_who_is_wrong():
    motion, pad, rng = staircase([1.0, 2.0], 2.0, 1.0), draw.POLYURETHANE, np.random.default_rng(0)
    for jitter, honest in ((SamplingJitter(3e-4), True), (StampJitter(3e-4), False)):
        data = make(pad, motion, 500.0, Noise(force=None, timing=jitter), rng)
        off = data.time_s - np.arange(len(data.time_s)) / 500
        assert np.std(off[1:]) == pytest.approx(3e-4, rel=0.1) and np.all(np.diff(data.time_s) > 0)
        error = np.max(np.abs(data.position_mm - motion.position(data.time_s)))
        assert error < 1e-12 if honest else error > 1e-3


# --- datasets and the bound ---------------------------------------------------------------------------------------


def test_csv_and_model_form(tmp_path):
    yaml = pytest.importorskip("yaml")
    motion, rng = staircase([1.0, 2.0], 20.0, 1.0), np.random.default_rng(1)
    clocks = Clocks(force_every=2, own_force_clock=True, force_phase_s=7e-4, skew_ppm=100.0)
    data = make(draw.POLYURETHANE, motion, 1000.0, Noise(White(0.01), White(5e-4)), rng, clocks)
    with data.to_csv(tmp_path / "d.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == ["time_s", "position_mm", "force_N", "force_time_s"]
    assert rows[1]["force_N"] == rows[1]["force_time_s"] == "" and rows[1]["position_mm"]
    assert float(rows[1000]["force_time_s"]) == pytest.approx(1.0007 * 1.0001, abs=1e-8)
    assert np.std(data.force_N[::2] - data.truth.force_true_N) == pytest.approx(0.01, rel=0.1)
    assert yaml.safe_load(data.model_yaml()) == {
        "pad": {
            "elastic": {"law": "exponential", "m": 2.24, "b": 0.69},
            "relaxation": {"shares": [0.25, 0.15], "rates": [4.0, 0.35]},
            "contact": "unilateral",
        }
    }
    plain = make(Pad(Hertz(1e-5, 4.0), (0.2,), (1e-5,)), motion, 100.0, Noise(), rng)
    elastic = yaml.safe_load(plain.model_yaml())["pad"]["elastic"]
    assert Power(elastic["p"], elastic["q"]).force(1.7) == pytest.approx(float(Hertz(1e-5, 4.0).force(1.7)))
    assert plain.force_time_s is None


def test_drawn_things_stay_in_their_ranges():
    rng = np.random.default_rng(11)
    for _ in range(300):
        drawn = draw.pad(rng, laws=draw.LAWS + draw.OTHER_LAWS)
        pad = drawn.pad
        assert 1 <= drawn.force_N <= 20 and 1 <= drawn.depth_mm <= 4
        assert float(pad.law.force(drawn.depth_mm)) == pytest.approx(drawn.force_N)
        nu = np.array(pad.rates)
        assert np.all(nu[:-1] / nu[1:] >= 3 - 1e-9) and nu[-1] >= 0.1 and nu[0] <= 60 + 1e-9
        assert min(pad.shares) >= 0.05 and 1 - sum(pad.shares) >= 0.25 - 1e-12
        motion = draw.motion(rng, drawn.depth_mm)
        deepest = motion.position(np.linspace(0, motion.duration_s, 2000)).max()
        assert 0.4 * drawn.depth_mm < deepest <= drawn.depth_mm + 1e-9 and 5 < motion.duration_s < 240
    same = [draw.dataset(np.random.default_rng(4), kinds=("staircase",)).force_N for _ in range(2)]
    assert np.array_equal(*same)


def test_sensitivities_of_a_power_law_in_closed_form():
    # F = p δ^{q+1}/(q+1), no relaxation: ∂F/∂p = F/p, ∂F/∂q = F (ln δ − 1/(q+1)).
    p, q, sigma = 3.0, 0.7, 0.02
    motion = Path(0.0, IDEAL).to(2.0, 1.0).motion()
    data = make(Pad(Power(p, q)), motion, 200.0, Noise(White(sigma)), np.random.default_rng(0))
    x = motion.position(data.truth.force_true_time_s)[1:]
    F = p * x ** (q + 1) / (q + 1)
    J = np.stack([F / p, F * (np.log(x) - 1 / (q + 1))], axis=1)
    expected = sigma * np.sqrt(np.diag(np.linalg.inv(J.T @ J)))
    got = crb.bound(data.truth)
    assert list(got) == ["p", "q"] and np.allclose(list(got.values()), expected, rtol=1e-7)


def test_sensitivities_of_relaxation_in_closed_form():
    # A step to δ: F = F^e (1 + Σ c_i (e^{−ν_i t} − 1)).
    t = np.linspace(0, 10, 500)
    pad = Pad(Power(3.0, 0.0), C, NU)
    got = crb.sensitivities(pad, Path(1.5).hold(10.0).motion(), t)
    for i, (c, nu) in enumerate(zip(C, NU, strict=True), 1):
        assert np.allclose(got[f"c_{i}"], 4.5 * np.expm1(-nu * t), atol=1e-7)
        assert np.allclose(got[f"nu_{i}"], -4.5 * c * t * np.exp(-nu * t), atol=1e-7)


def test_maximum_likelihood_attains_the_bound():
    # The estimator is least squares with the closed form of a linear pad of one mode, the data are the simulator's.
    rng, sigma = np.random.default_rng(8), 0.02
    data = make(Pad(Polynomial((0.0, 3.0)), (0.3,), (1.5,)), ramp_and_hold(), 100.0, Noise(White(sigma)), rng)

    def closed(t, p, c, nu):
        return linear_ramp(t, 10.0, p, (c,), (nu,)) - linear_ramp(t - 0.2, 10.0, p, (c,), (nu,))

    t, F = data.time_s, data.truth.force_true_N
    noisy = [F + sigma * rng.standard_normal(len(t)) for _ in range(400)]
    fits = np.array([curve_fit(closed, t, y, (2.5, 0.4, 2.0))[0] for y in noisy])
    std = crb.bound(data.truth)
    reached = np.std(fits, axis=0) / [std["alpha_1"], std["c_1"], std["nu_1"]]
    assert np.all(np.abs(reached - 1) < 0.12)  # 400 fits tell it to 3.5 %
    assert np.all(np.abs(np.mean(fits, axis=0) - [3.0, 0.3, 1.5]) < 0.2 * np.std(fits, axis=0))


def test_noise_of_one_power_leaves_different_information():
    motion, rng = rich(2.0, hold_s=0.3, long_hold_s=2.0), np.random.default_rng(8)

    def std(force):
        return crb.bound(make(draw.POLYURETHANE, motion, 200.0, Noise(force), rng).truth)

    white, tails, slow = std(White(0.02)), std(StudentT(0.02, 5.0)), std(Coloured(0.02, 1e-5))
    assert list(white) == ["m", "b", "c_1", "c_2", "nu_1", "nu_2"]
    for name, value in white.items():
        assert tails[name] / value == pytest.approx(np.sqrt(8 / 6 * 3 / 5), rel=1e-9)
        assert slow[name] == pytest.approx(value, rel=1e-9)
    with pytest.raises(ValueError, match="no bound"):
        std(None)
