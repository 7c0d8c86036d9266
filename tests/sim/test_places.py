"""Every place of the plant, with blocks made for the test: what a later effect may rely on."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from sim.effects import Active, Effect, Form, Parameter
from sim.elastic import Exponential
from sim.jit import Block, State, block
from sim.pad import Cascade, Pad
from sim.relaxation import Relaxation
from tests.sim.test_pad import walk

K = 5.0
LINEAR = Pad(Exponential(K, 0.0), Relaxation(), unilateral=True)
GEL = Pad(Exponential(2.24, 0.69), Relaxation((0.25, 0.15), (4.0, 0.35)), unilateral=True)
A = Parameter("a", "1", -1e9, 1e9, 1.0, "a number", required=True)


@block
def shift(dt: float, u: float, state: State, p: State) -> float:
    return u + p[0]


@block
def wave(dt: float, u: float, state: State, p: State) -> float:
    return u + p[0] * math.sin(u)


@block
def play(dt: float, u: float, state: State, p: State) -> float:
    state[0] = min(max(state[0], u - p[0]), u + p[0])
    return state[0]


@block
def deepest(dt: float, u: float, state: State, p: State) -> float:
    state[0] = max(state[0], u)
    return 1.0 - p[0] * min(1.0, (state[0] - u) / 0.1)  # without a jump: it is solved for


@block
def constant(dt: float, u: float, state: State, p: State) -> float:
    return p[0]


@block
def damper(dt: float, u: float, state: State, p: State) -> float:
    moved = max(u, 0.0) - max(state[0], 0.0)
    state[0] = u
    return p[0] * moved / dt if dt > 0.0 else 0.0


@block
def pull(dt: float, u: float, state: State, p: State) -> float:
    return -p[0] * math.exp(-u / 0.1)


@block
def mass(dt: float, u: float, state: State, p: State) -> float:
    speed = (u - state[0]) / dt if dt > 0.0 else 0.0
    force = p[0] * (speed - state[1]) / dt if dt > 0.0 else 0.0
    state[0], state[1] = u, speed
    return force


@block
def count(dt: float, u: float, state: State, p: State) -> float:
    state[0] += p[0]
    return u + state[0]


@block
def spring(dt: float, u: float, state: State, p: State) -> float:
    return p[0] * u


@block
def remember(dt: float, u: float, state: State, p: State) -> float:
    state[0] = u
    return u


@block
def recall(dt: float, u: float, state: State, p: State) -> float:
    return p[0] * state[0]


def at(place: str, step: Block, a: float, state: tuple[float, ...] = ()) -> Active:
    form = Form("f", "for the test", (A,), {place: step}, state)
    return Active(Effect("test", "A test.", (form,)), form, {"a": a})


def run(pad: Pad, effects: list[Active], t: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Array form, checked against streaming."""
    cascade = Cascade(pad, effects)
    force = cascade.simulate(t, x)
    plant = cascade.plant()
    for n, d in enumerate(np.diff(t, prepend=t[0])):
        streamed = plant.sense(float(d), plant.step(float(d), float(x[n])))
        assert abs(plant.sample(float(d), streamed) - force[n]) < 1e-12
        assert abs(plant.residual_mm) < 1e-12
    return force


T = np.arange(601) * 1e-3
X = 0.8 - 1.0 * np.cos(20 * T)
LAW = K * np.maximum(X, 0.0)


def test_play_has_no_feedback_and_comes_before_the_frame() -> None:
    force = run(LINEAR, [at("play", play, 0.05, (0.0,)), at("frame", spring, 0.02)], T, X)
    turned = np.argmax(X)
    rising, falling = force[turned - 20], force[turned + 20]  # same x on either side of the turn, to rounding
    assert_allclose(X[turned - 20], X[turned + 20], atol=2e-2)
    expected = K / (1 + 0.02 * K)
    assert_allclose(rising, expected * (X[turned - 20] - 0.05), rtol=1e-12)
    assert falling > rising - 0.1


def test_depth_elastic_and_their_chains() -> None:
    two = [
        at("depth", shift, -0.2),
        at("depth", shift, 0.05),
        at("elastic", constant, 0.5),
        at("elastic", constant, 0.9),
    ]
    assert_allclose(run(LINEAR, two, T, X), 0.45 * K * np.maximum(X - 0.15, 0.0), atol=1e-12)


def test_elastic_with_memory_under_feedback() -> None:
    force = run(LINEAR, [at("elastic", deepest, 0.3, (0.0,)), at("frame", spring, 0.03)], T, X)
    turned = int(np.argmax(X))
    full, soft = K / (1 + 0.03 * K), 0.7 * K / (1 + 0.03 * 0.7 * K)
    assert_allclose(force[turned], full * X[turned], rtol=1e-12)
    assert_allclose(force[turned + 60], soft * X[turned + 60], rtol=1e-12)


def test_rate_scales_all_rates() -> None:
    quick = replace(GEL, relaxation=Relaxation((0.25, 0.15), (8.0, 0.7)))
    t, x = walk(500)
    assert_allclose(run(GEL, [at("rate", constant, 2.0)], t, x), Cascade(quick).simulate(t, x), atol=1e-11)


def test_probe_forces_are_felt_by_the_cell_and_the_frame() -> None:
    m = 2e-5  # N·s²/mm = 20 g
    t = np.arange(300) * 1e-3
    x = np.where(t > 0.05, -1.0 + 4.0 * (t - 0.05) ** 2, -1.0)
    force = run(LINEAR, [at("probe", mass, m, (-1.0, 0.0))], t, x)
    assert_allclose(force[60:], m * 8.0, rtol=1e-6)
    run(LINEAR, [at("probe", mass, m, (-1.0, 0.0)), at("frame", spring, 0.02)], t, x)


class TestContact:
    """A linear pad with a damper of its own, left in an instant: K s + η s' = 0."""

    eta = 0.4

    def test_pressing(self) -> None:
        force = run(LINEAR, [at("contact", damper, self.eta, (-0.2,))], T, X)
        speed = np.where(X > 0.0, np.diff(X, prepend=X[0]), np.diff(np.maximum(X, 0.0), prepend=0.0)) / 1e-3
        once = slice(0, 340)  # later the pad is met with its surface still low
        assert (force[once] == 0.0).sum() > 60
        assert_allclose(force[once], np.maximum(LAW + self.eta * speed, 0.0)[once], atol=1e-9)

    def test_left_alone_the_surface_comes_up_against_its_damper(self) -> None:
        plant = Cascade(LINEAR, [at("contact", damper, self.eta, (0.0,))]).plant()
        plant.step(0.0, 1.0)
        plant.step(1.0, 1.0)
        dt = 1e-3
        for n in range(1, 200):
            assert plant.step(dt, -2.0) == 0.0
            assert_allclose(plant.elastic_force_N, K * (1 + K * dt / self.eta) ** -n, rtol=1e-9)

    def test_with_relaxation_and_frame_it_never_pulls(self) -> None:
        t, x = walk(800)
        force = run(GEL, [at("contact", damper, 0.05, (0.0,)), at("frame", spring, 0.02)], t, x)
        assert force.min() == 0.0

    def test_a_bonded_pad_pulls(self) -> None:
        force = run(replace(LINEAR, unilateral=False), [at("contact", damper, self.eta, (-0.2,))], T, X)
        assert force.min() < -1.0


class TestGap:
    def test_it_may_pull_where_a_unilateral_pad_has_let_go(self) -> None:
        force = run(LINEAR, [at("gap", pull, 0.3)], T, X)
        expected = LAW - 0.3 * np.exp(-np.maximum(-X, 0.0) / 0.1)
        assert_allclose(force, expected, atol=1e-12)

    def test_the_gap_is_to_the_surface_where_it_is(self) -> None:
        pad = Pad(Exponential(K, 0.0), Relaxation((0.3,), (2.0,)), unilateral=True)
        plant = Cascade(pad, [at("gap", pull, 0.3)]).plant()
        plant.step(0.0, 1.0)
        plant.step(1e3, 1.0)
        # relaxed to the end, the surface springs to c_1 of its depth (test_pad)
        assert_allclose(plant.step(0.0, 0.1), -0.3 * math.exp(-(0.3 - 0.1) / 0.1), rtol=1e-12)


def test_sensor_runs_on_the_whole_grid_and_sampling_once_a_sample() -> None:
    t = np.arange(101) * 0.01
    wanted = t[::10]
    still = np.full(t.size, -1.0)
    sensor = Cascade(LINEAR, [at("sensor", count, 1.0, (0.0,))])
    sampling = Cascade(LINEAR, [at("sampling", count, 1.0, (0.0,))])
    assert_allclose(sensor.simulate_at(t, still, wanted), np.arange(1, 102, 10))
    assert_allclose(sampling.simulate_at(t, still, wanted), np.arange(1, 12))


def test_reported_positions_are_undone_before_the_plant() -> None:
    true = X
    reported = true + 0.1 * np.sin(true)
    cascade = Cascade(LINEAR, [at("report", wave, 0.1)])
    assert_allclose(cascade.simulate(T, reported), LAW, atol=1e-12)
    assert_allclose(cascade.simulate_at(T, reported, T), LAW, atol=1e-12)
    assert_allclose([cascade.plant().reported_mm(float(v)) for v in true[:20]], reported[:20], rtol=1e-15)


def test_time_shift_moves_the_force_against_the_position() -> None:
    late = Form("f", "late", (A,), time_shift=lambda values, t: t - values["a"])
    cascade = Cascade(LINEAR, [Active(Effect("test", "A test.", (late,)), late, {"a": 0.0035})])
    force = cascade.simulate(T, X)
    assert_allclose(force, K * np.maximum(np.interp(T - 0.0035, T, X), 0.0), atol=1e-12)
    assert_allclose(cascade.simulate_at(T, X, T + 0.0035), LAW, atol=1e-9)


def test_amend_puts_another_pad_in_place() -> None:
    bonded = Form("f", "pulls", (A,), amend=lambda pad, values: replace(pad, unilateral=False))
    cascade = Cascade(GEL, [Active(Effect("test", "A test.", (bonded,)), bonded, {"a": 0.0})])
    t, x = walk(300)
    assert np.array_equal(cascade.simulate(t, x), Cascade(replace(GEL, unilateral=False)).simulate(t, x))


def test_blocks_of_one_effect_share_their_state_inside_the_loop() -> None:
    """The depth block notes the depth, the probe block pushes in proportion to it: solved together with the frame."""
    form = Form("f", "shared", (A,), {"depth": remember, "probe": recall, "frame": spring}, (0.0,))
    both = Active(Effect("test", "A test.", (form,)), form, {"a": 0.05})
    force = run(LINEAR, [both], T, np.maximum(X, 0.0))
    assert_allclose(force, (K + 0.05) / (1 + 0.05 * (K + 0.05)) * np.maximum(X, 0.0), atol=1e-12)


def test_a_force_that_falls_with_depth_is_solved_too() -> None:
    """A frame so soft that the balance of the step is far from y = x."""
    force = run(GEL, [at("probe", spring, -0.4), at("frame", spring, 0.8)], *walk(400))
    assert np.isfinite(force).all()


def test_no_such_place() -> None:
    with pytest.raises(ValueError, match="no place law"):
        Form("f", "for the test", (), {"law": spring})
