"""The judge's effects of the pad beyond the catalogue, against closed forms and independent integration."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from . import draw
from .cases import draw_case
from .effects import EFFECTS, Build
from .effects.judge_outside_pad import consolidation, pad_N, under_a_sphere
from .effects.plant import Plant
from .effects.plant import simulate as fine_steps
from .laws import Exponential, Power
from .motion import Path, rich
from .pad import Pad, simulate

SPRING = Pad(Power(3.0, 0.0))  # 3 N/mm, no relaxation
SOFT = Pad(Exponential(1.5, 0.6), (0.3, 0.2), (6.0, 0.5))
SHORT = rich(2.0, (60.0, 8.0), hold_s=0.15, long_hold_s=0.6)
IDS = (
    *("poroelasticity", "nonlinear_viscoelasticity", "heating"),
    *("physical_ageing", "cell_buckling", "probe_friction"),
)
ALL = [(id, shape) for id in IDS for shape in EFFECTS[id].of("judge")]


def hidden(id, shape, size=1.0, pad=SPRING, motion=SHORT, seed=0, depth=2.0):
    """One effect in a plant: (fine steps, what is stated, build)."""
    drawn = draw.DrawnPad(pad, depth, float(pad.law.force(depth)))
    build = Build(drawn, Plant(pad, motion, motion.duration_s), pad, 0.01, 1000.0, np.random.default_rng(seed))
    told = EFFECTS[id].hide(build, shape, size)
    return fine_steps(build.plant), told, build


def stepped(depth_mm, hold_s=4.0):
    """A quick step and a hold, from the surface on: (motion, time at the end of the step)."""
    return Path(0.0, np.inf).hold(0.1).to(depth_mm, 2000.0).hold(hold_s).motion(), 0.1 + depth_mm / 2000.0


# --- all of them ------------------------------------------------------------------------------------------------


def test_none_is_of_the_first_half():
    assert all(EFFECTS[id].of("first") == () for id in IDS)


@pytest.mark.parametrize(("id", "shape"), ALL)
def test_it_is_silent_in_air_grows_with_size_and_is_the_same_again(id, shape):
    plain = fine_steps(Plant(SOFT, SHORT, SHORT.duration_s)).force_N
    fine, told, build = hidden(id, shape, pad=SOFT)
    again, told_again, _ = hidden(id, shape, pad=SOFT)
    assert told == told_again and fine.force_N.tobytes() == again.force_N.tobytes()
    assert all(value > 0 for value in told.values())
    assert np.all(fine.force_N[fine.reported_mm <= 0] == 0) and np.max(fine.force_N) > 1
    assert build.believed == SOFT
    changes = []
    for size in (0.05, 0.3, 1.0, 2.5):
        force = hidden(id, shape, size, SOFT)[0].force_N
        # Two integrations of the plain pad differ by some 1e-8 N where the surface has let go.
        assert np.all(np.isfinite(force)) and np.min(force) > -1e-6
        changes.append(float(np.sqrt(np.mean((force - plain) ** 2))))
    assert np.all(np.diff(changes) > 0)


def test_it_is_drawn_as_a_case():
    case = draw_case(5, ("poroelasticity",), 1.0, protocol="rich")
    assert np.all(np.isfinite(case.force_N)) and set(case.truth.parameters["poroelasticity"]) == {"pressure", "rate"}


# --- the pad beside the plain one -----------------------------------------------------------------------------------


@pytest.mark.parametrize("contact", ["unilateral", "bonded"])
def test_without_more_it_is_the_exact_pad(contact):
    pad = Pad(SOFT.law, SOFT.shares, SOFT.rates, contact)
    t = np.arange(0, SHORT.duration_s, 1e-4)
    force = pad_N(pad, t, SHORT.position(t))
    assert np.max(np.abs(force[::50] - simulate(pad, SHORT, t[::50]).force_N)) < 2e-3


def test_a_free_surface_comes_back_as_in_the_exact_pad():
    pad = Pad(Power(3.0, 0.5), (0.5,), (1.0,))
    motion = Path(-0.2).to(2.0, 50.0).hold(1.0).to(-0.2, 50.0).hold(0.4).to(2.0, 5.0).hold(0.2).motion()
    t = np.arange(0, motion.duration_s, 1e-4)
    exact = simulate(pad, motion, t[::20])
    force = pad_N(pad, t, motion.position(t))[::20]
    back = [at for at, kind in exact.events if kind == "return"][-1]
    assert motion.position(back) > 0.1
    assert np.max(np.abs(force - exact.force_N)) < 2e-3


# --- drainage -------------------------------------------------------------------------------------------------------


def test_a_layer_drains_as_the_equation_of_diffusion_says():
    """p_t = D p_zz on 0 to H, no flow at 0, p = 0 at H, p = 1 at the start; time in units of 4 H²/(π² D)."""
    n = 200
    z = (np.arange(n) + 0.5) / n
    second = np.diag(np.full(n, -2.0)) + np.diag(np.ones(n - 1), 1) + np.diag(np.ones(n - 1), -1)
    second[0, 0], second[-1, -1] = -1.0, -3.0
    rates, modes = np.linalg.eigh(second * n**2 * 4 / np.pi**2)
    t = np.array([0.05, 0.2, 0.5, 1.0, 2.0])
    mean = [np.mean(modes @ (np.exp(rates * at) * (modes.T @ np.ones_like(z)))) for at in t]
    weights, ours = consolidation()
    assert np.allclose(np.exp(-np.outer(t, ours)) @ weights, mean, atol=0.02)


@pytest.mark.parametrize("depth", [0.8, 2.0])
@pytest.mark.parametrize("shape", ["compacting_layer", "wet_sphere"])
def test_pressure_drains_at_a_rate_of_its_depth(shape, depth):
    motion, end = stepped(depth)
    fine, told, build = hidden("poroelasticity", shape, motion=motion)
    t = end + np.array([0.3, 1.0, 3.0])
    extra = fine.at(t) - 3 * depth
    if shape == "wet_sphere":
        tau = told["rate"] * 0.5 * 2.0 / depth * (t - end)
        shares = 0.491 * np.exp(-0.908 * np.sqrt(tau)) + 0.509 * np.exp(-1.679 * tau)
        assert np.allclose(extra, told["pressure"] * (depth / 2) ** 1.5 * shares, atol=0.02 * told["pressure"])
        return
    # The slowest mode is left in the end: its share and rate tell how compaction stops the drainage.
    half = hidden("poroelasticity", shape, motion=stepped(1.0)[0])[0].at(np.array([2.0, 4.0])) - 3.0
    assert np.log(half[0] / half[1]) / 2 == pytest.approx(told["rate"], rel=0.05)
    late = np.log(extra[1] / extra[2]) / 2
    assert (late < told["rate"]) if depth > 1 else (late > told["rate"])


def test_the_spectrum_under_a_sphere_is_that_of_the_paper():
    weights, rates = under_a_sphere()
    tau = np.geomspace(0.003, 10, 40)
    wanted = 0.491 * np.exp(-0.908 * np.sqrt(tau)) + 0.509 * np.exp(-1.679 * tau)
    assert np.allclose(np.exp(-np.outer(tau, rates)) @ weights, wanted, atol=0.01)


# --- relaxation -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("depth", [0.6, 1.9])
def test_schapery_relaxes_by_a_share_that_goes_with_depth(depth):
    motion, end = stepped(depth)
    fine, told, _ = hidden("nonlinear_viscoelasticity", "schapery", pad=SOFT, motion=motion)
    t = end + np.array([0.02, 0.2, 1.0, 3.0])
    more = 1 + told["share"] * (depth - 1.0)  # 2 δ/δ_max − 1 at a greatest depth of 2 mm
    modes = 0.3 * np.exp(-6.0 * (t - end)) + 0.2 * np.exp(-0.5 * (t - end))
    assert np.allclose(fine.at(t), float(SOFT.law.force(depth)) * (0.5 + more * modes), rtol=2e-3)


def test_bergstrom_and_boyce_flow_by_a_power_of_the_overstress():
    pad = Pad(Power(3.0, 0.0), (0.4,), (3.0,))
    motion = Path(0.0, np.inf).hold(0.1).to(2.0, 4.0).hold(1.0).to(0.8, 1.0).hold(0.5).motion()
    fine, told, build = hidden("nonlinear_viscoelasticity", "bergstrom_boyce", pad=pad, motion=motion)
    scale = 0.3 * build.force_N

    def flows(t, q):
        return 3.0 * float(motion.velocity(t)) - 3.0 * q * (np.abs(q) / scale) ** told["excess"]

    t = np.linspace(0.12, motion.duration_s - 0.05, 60)
    q = solve_ivp(flows, (0, motion.duration_s), [0.0], t_eval=t, max_step=1e-3, rtol=1e-8, atol=1e-10).y[0]
    assert np.allclose(fine.at(t), 0.6 * 3.0 * motion.position(t) + 0.4 * q, atol=5e-3)


# --- temperature and age --------------------------------------------------------------------------------------------


def test_a_warm_room_softens_the_pad_and_quickens_it():
    motion, end = stepped(2.0)
    fine, told, build = hidden("heating", "room", motion=motion)
    t = np.array([0.5, 2.0, 4.0])
    theta = told["rise"] * (1 - np.exp(-t / told["time_constant"]))
    assert np.allclose(fine.at(t), 6.0 * np.exp(-0.025 * theta), rtol=1e-5)
    warm = told["rise"] * (1 - np.exp(-1e4 / told["time_constant"]))
    (factor,) = build.plant.rate_factor
    energy = 8.314 * np.log(factor(np.array([1e4]), np.zeros(1))[0]) * 296.0 * (296.0 + warm) / warm
    assert 60e3 < energy < 100e3


def test_a_warm_probe_heats_while_it_touches():
    motion = Path(-0.5, np.inf).hold(0.5).to(1.0, 1000.0).hold(2.0).to(-0.5, 1000.0).hold(3.0)
    motion = motion.to(1.0, 1000.0).hold(1.0).motion()
    fine, told, _ = hidden("heating", "warm_probe", motion=motion)
    tau = told["time_constant"]
    warm = 1 - np.exp(-2.0 / tau)
    for at, theta in ((2.4, 1 - np.exp(-1.9 / tau)), (5.55, warm * np.exp(-3.0 / tau))):
        assert fine.at(np.array([at]))[0] == pytest.approx(3.0 * np.exp(-0.025 * told["rise"] * theta), rel=3e-3)


@pytest.mark.parametrize("shape", ["struik", "soft_glass"])
def test_an_ageing_pad_relaxes_by_the_effective_time(shape):
    pad = Pad(Power(3.0, 0.0), (0.4,), (0.8,))
    motion, end = stepped(2.0, 12.0)
    fine, told, build = hidden("physical_ageing", shape, pad=pad, motion=motion)
    t, age, mu = np.array([1.0, 4.0, 11.0]), told["age"], told["exponent"]

    def effective(t):  # ∫ (1 + t/t_e)^−μ dt
        return age / (1 - mu) * ((1 + t / age) ** (1 - mu) - 1)

    if shape == "struik":
        whole = 6.0 * (0.6 + 0.4 * np.exp(-0.8 * (effective(t) - effective(end))))
    else:
        (gain,) = build.plant.gain
        stiffer = float(gain(np.array([age * (np.e - 1)]), np.zeros(1))[0]) - 1
        assert 0.02 <= stiffer <= 0.05

        def flows(t, z):
            return 0.8 * (1 + t / age) ** -mu * (6.0 * (1 + stiffer * np.log1p(t / age)) - z)

        z = solve_ivp(flows, (end, 12.0), [0.0], t_eval=t, rtol=1e-9, atol=1e-10).y[0]
        whole = 6.0 * (1 + stiffer * np.log1p(t / age)) - 0.4 * z
    assert np.allclose(fine.at(t), whole, atol=5e-3)


# --- cells and contact ----------------------------------------------------------------------------------------------


def test_rows_fold_on_the_way_in_and_open_later_on_the_way_out():
    motion = Path(-0.2, np.inf).to(2.0, 2.0).to(-0.2, 2.0).to(2.0, 2.0).to(-0.2, 2.0).motion()
    fine, told, _ = hidden("cell_buckling", "snapping_rows", motion=motion)
    x, inward = fine.reported_mm, np.gradient(fine.reported_mm) > 0
    deep, shallow = np.abs(x - 1.9) < 0.05, (x > 0.01) & (x < 0.3 * told["opens"] - 0.01)
    assert np.allclose(fine.force_N[deep], 3 * x[deep] * (1 - told["share"]))
    assert np.allclose(fine.force_N[shallow], 3 * x[shallow])
    first = np.interp(np.linspace(0.05, 1.9, 50), x[:11000], fine.force_N[:11000])
    third = np.interp(np.linspace(0.05, 1.9, 50), x[22001:32900], fine.force_N[22001:32900])
    assert np.mean(np.abs(first - third) > 1e-6) < 0.05  # what has opened is as new
    kept = np.round(fine.force_N[inward & (x > 0.01)] / (3 * x[inward & (x > 0.01)]), 9)
    assert 6 <= len(np.unique(kept)) <= 9


def test_many_cells_fold_evenly():
    motion = Path(-0.2, np.inf).to(2.0, 2.0).to(0.0, 2.0).motion()
    fine, told, _ = hidden("cell_buckling", "many_cells", motion=motion)
    for depth in (0.6, 1.0, 1.5):
        t_in, t_out = (depth + 0.2) / 2, 1.1 + (2.0 - depth) / 2
        for at, folds in ((t_in, depth), (t_out, depth / told["opens"])):
            share = np.clip((folds - 0.3) / 1.5, 0, 1)
            assert fine.at(np.array([at]))[0] == pytest.approx(3 * depth * (1 - told["share"] * share), rel=0.012)


def test_partial_slip_turns_round_by_the_ratio_of_depths():
    motion = Path(-0.2, np.inf).to(2.0, 2.0).to(0.5, 2.0).motion()
    fine, told, _ = hidden("probe_friction", "partial_slip", motion=motion)
    k = told["share"]
    assert np.allclose(fine.at(np.array([0.3, 0.9])), 3 * np.array([0.4, 1.6]) * (1 + k))
    s = [(fine.at(np.array([1.1 + (2 - d) / 2]))[0] / (3 * d) - 1) / k for d in (1.9, 1.6)]
    reach = np.log(1.9 / 2) / np.log((s[0] + 1) / 2)
    assert 0.1 <= reach <= 0.25
    assert s[1] == pytest.approx(2 * (1.6 / 2) ** (1 / reach) - 1, abs=1e-3)


def test_stick_slip_is_a_saw_between_two_bounds():
    motion = Path(-0.2, np.inf).to(2.0, 2.0).to(0.2, 2.0).motion()
    fine, told, _ = hidden("probe_friction", "stick_slip", motion=motion)
    x, way = fine.reported_mm, fine.time_s
    s = (np.divide(fine.force_N, 3 * x, out=np.ones_like(x), where=x > 0.01) - 1) / told["share"]
    inward, outward = (x > 0.3) & (way < 1.1), (x > 0.3) & (way > 1.3) & (way < 1.95)
    assert 0.98 < s[inward].max() <= 1 + 1e-9 and 0.2 < s[inward].min() < 0.6
    assert -1 - 1e-9 <= s[outward].min() < -0.98 and -0.6 < s[outward].max() < -0.2
    rise = np.diff(s)[inward[1:]] / 2e-4  # per mm, between the slips
    assert 1 / (0.05 * 2.0) <= np.median(rise) <= 1 / (0.02 * 2.0)
