import copy
import pickle

import numpy as np
import pytest
from numpy.testing import assert_allclose

from sim.elastic import Exponential, NoPad, Polynomial, Power
from sim.grid import union
from sim.pad import Cascade, Pad, Past
from sim.relaxation import Relaxation

GEL = Relaxation((0.25, 0.15), (4.0, 0.35))
EXPONENTIAL = Exponential(2.24, 0.69)


def walk(n: int = 3000, seed: int = 5) -> tuple[np.ndarray, np.ndarray]:
    """Uneven times and a motion in and out of contact, with jumps and stamps that repeat."""
    rng = np.random.default_rng(seed)
    dt = rng.choice([0.0, 2.5e-4, 1e-3, 1e-3, 0.0213], n)
    dt[0] = 0.0
    t = np.cumsum(dt)
    x = 1.0 - 1.6 * np.cos(2.3 * t) + 0.2 * np.sin(31 * t) + 0.3 * (rng.random(n) < 0.01)
    return t, x


def test_bonded_pad_is_law_then_filter() -> None:
    t, x = walk()
    pad = Cascade(Pad(EXPONENTIAL, GEL, unilateral=False))
    assert_allclose(pad.simulate(t, x), GEL.filter(t, EXPONENTIAL.force(x)), rtol=1e-11, atol=1e-11)
    assert pad.simulate(t, x).min() < -0.1


@pytest.mark.parametrize("unilateral", [True, False])
@pytest.mark.parametrize("law", [EXPONENTIAL, Power(3.8, 0.77), Polynomial((0.1, 1.0, 0.5)), NoPad()], ids=str)
def test_streaming_is_the_array_form(law, unilateral: bool) -> None:
    t, x = walk()
    cascade = Cascade(Pad(law, GEL, unilateral))
    plant = cascade.plant()
    dt = np.diff(t, prepend=t[0])
    streamed = [plant.step(float(d), float(p)) for d, p in zip(dt, x, strict=True)]
    assert_allclose(streamed, cascade.simulate(t, x), rtol=0, atol=1e-12)


class TestUnilateral:
    """A linear pad K δ with one mode (c_0, c_1, ν), pressed and relaxed to the end, then left: closed forms."""

    K, c_1, nu, depth = 4.0, 0.3, 2.0, 1.5

    def cascade(self) -> Cascade:
        relaxation = Relaxation((self.c_1,), (self.nu,))
        return Cascade(Pad(Exponential(self.K, 0.0), relaxation, unilateral=True))

    def test_the_surface_springs_back_in_part_and_creeps_up_for_the_rest(self) -> None:
        plant = self.cascade().plant()
        plant.step(0.0, self.depth)
        plant.step(1e3, self.depth)
        assert_allclose(plant.force_N, (1 - self.c_1) * self.K * self.depth)
        assert plant.step(0.0, -1.0) == 0.0
        # F = c_0 F^e + c_1 (F^e − F^e_0) = 0 at once …
        at_once = self.c_1 * self.K * self.depth
        assert_allclose(plant.elastic_force_N, at_once)
        # … then c_1 w = −c_0 F^e gives F^e' = −ν c_0 F^e (the step is ramp-invariant: second order in dt)
        dt = 1e-3
        for n in range(1, 2001):
            assert plant.step(dt, -1.0) == 0.0
            if n % 500 == 0:
                assert_allclose(plant.elastic_force_N, at_once * np.exp(-self.nu * (1 - self.c_1) * n * dt), rtol=1e-5)

    def test_touching_again_meets_the_surface_where_it_has_come_to(self) -> None:
        plant = self.cascade().plant()
        plant.step(0.0, self.depth)
        plant.step(1e3, self.depth)
        plant.step(0.0, -1.0)
        plant.step(0.1, -1.0)
        surface = plant.elastic_force_N / self.K
        assert 0.3 < surface < self.c_1 * self.depth
        assert plant.copy().step(0.0, surface - 1e-6) == 0.0
        assert_allclose(plant.copy().step(0.0, surface + 1e-3), self.K * 1e-3, rtol=1e-9)

    def test_it_never_pulls_and_long_after_it_is_as_new(self) -> None:
        t, x = walk()
        cascade = Cascade(Pad(EXPONENTIAL, GEL, unilateral=True))
        assert cascade.simulate(t, x).min() == 0.0
        plant = cascade.plant()
        for d, p in zip(np.diff(t, prepend=t[0]), x, strict=True):
            plant.step(float(d), float(p))
        for _ in range(2000):
            plant.step(0.1, -1.0)
        fresh = cascade.plant()
        fresh.step(0.0, -1.0)
        assert_allclose(plant.step(0.01, 1.0), fresh.step(0.01, 1.0), rtol=1e-12)

    def test_it_is_not_the_clipped_force_of_a_bonded_pad(self) -> None:
        t = np.arange(0, 6, 1e-3)
        x = np.where(t < 2, 2.0, np.where(t < 3, 0.0, 1.0))
        free = Cascade(Pad(EXPONENTIAL, GEL, unilateral=True)).simulate(t, x)
        clipped = np.maximum(0.0, Cascade(Pad(EXPONENTIAL, GEL, unilateral=False)).simulate(t, x))
        assert_allclose(free[t < 2], clipped[t < 2], atol=1e-12)
        # the bonded pad was pulled back by its own negative force; the free one recovers less, and is met later
        assert (clipped - free)[t >= 3].min() > 0.0
        assert (clipped - free)[np.searchsorted(t, 3.0)] > 0.3

    def test_halving_the_step_converges_at_second_order(self) -> None:
        def at_the_end(n: int) -> np.ndarray:
            t = np.linspace(0.0, 4.0, n + 1)
            force = Cascade(Pad(EXPONENTIAL, GEL, unilateral=True)).simulate(t, 1.2 - 1.2 * np.cos(2 * np.pi * t))
            return force[:: n // 8]

        coarse, middle, fine = at_the_end(800), at_the_end(1600), at_the_end(12800)
        assert np.abs(middle - fine).max() < 0.4 * np.abs(coarse - fine).max()
        assert np.abs(middle - fine).max() < 1e-3


def test_free_air_has_no_force() -> None:
    t, x = walk(200)
    assert not Cascade(Pad(NoPad(), Relaxation(), unilateral=True)).simulate(t, x).any()


def test_no_relaxation_is_the_elastic_response() -> None:
    t, x = walk(200)
    assert_allclose(Cascade(Pad(EXPONENTIAL, Relaxation(), True)).simulate(t, x), EXPONENTIAL.force(x), rtol=1e-14)


class TestSimulateAt:
    def cascade(self) -> Cascade:
        return Cascade(Pad(EXPONENTIAL, GEL, unilateral=True))

    def test_on_the_same_stamps_it_is_simulate(self) -> None:
        t = np.arange(500) * 1e-3
        x = 1.0 - np.cos(20 * t)
        assert np.array_equal(self.cascade().simulate_at(t, x, t), self.cascade().simulate(t, x))

    def test_between_stamps_the_position_is_linear(self) -> None:
        t, x = np.array([0.0, 1.0, 3.0]), np.array([0.0, 2.0, 1.0])
        fine = np.linspace(0.0, 3.0, 3001)
        wanted = np.array([0.25, 1.0, 1.5, 2.999])
        exact = self.cascade().simulate(fine, np.interp(fine, t, x))
        # the elastic force is curved between coarse stamps, so the force stamps must have all the corners
        got = self.cascade().simulate_at(t, x, fine)[np.searchsorted(fine, wanted - 1e-9)]
        assert_allclose(got, exact[np.searchsorted(fine, wanted - 1e-9)], rtol=1e-12)

    def test_interleaved_grids_with_stamps_that_nearly_agree(self) -> None:
        t = np.arange(1000) * 1e-3
        x = 1.0 - np.cos(8 * t)
        noisy = t + np.random.default_rng(0).uniform(-4e-10, 4e-10, t.size)
        assert_allclose(self.cascade().simulate_at(t, x, np.sort(noisy)), self.cascade().simulate(t, x), atol=1e-12)

    def test_force_stamps_that_repeat_get_one_force(self) -> None:
        t = np.array([0.0, 0.1, 0.2])
        force = self.cascade().simulate_at(t, [0.0, 1.0, 1.0], [0.05, 0.05, 0.15, 0.15 + 1e-12])
        assert force[0] == force[1] != 0.0
        assert force[2] == force[3] != 0.0

    def test_of_positions_with_one_stamp_the_last_holds(self) -> None:
        force = self.cascade().simulate_at([0.0, 0.1, 0.1, 0.2], [0.0, 9.0, 1.0, 1.0], [0.1, 0.2])
        assert_allclose(force, self.cascade().simulate_at([0.0, 0.1, 0.2], [0.0, 1.0, 1.0], [0.1, 0.2]), rtol=1e-14)

    def test_outside_the_position_stamps_it_stands_still(self) -> None:
        force = self.cascade().simulate_at([1.0, 2.0], [1.0, 1.0], [0.5, 1.5, 9.0])
        assert_allclose(force, EXPONENTIAL.force(1.0) * GEL.reduced([0.0, 1.0, 8.5]), rtol=1e-12)

    @pytest.mark.parametrize(
        ("time", "position", "force_time", "message"),
        [
            ([0.0, 1.0], [0.0], [0.0], "differ in shape"),
            ([0.0, 2.0, 1.0], [0.0, 0.0, 0.0], [0.0], "position time falls at sample 2, 1 s"),
            ([0.0, 1.0], [0.0, 0.0], [1.0, 0.0], "force time falls at sample 1"),
            ([0.0, np.nan], [0.0, 0.0], [0.0], "position time is not a finite"),
            ([0.0, 1.0], [0.0, np.inf], [0.0], "position is not a finite"),
            ([], [], [0.0], "no position samples"),
        ],
    )
    def test_refusals(self, time: list[float], position: list[float], force_time: list[float], message: str) -> None:
        with pytest.raises(ValueError, match=message):
            self.cascade().simulate_at(time, position, force_time)


def test_union_of_random_grids() -> None:
    rng = np.random.default_rng(4)
    for _ in range(200):
        first = np.unique(rng.choice(np.arange(40), rng.integers(1, 20)) * 0.1)
        jitter = rng.choice([0.0, 3e-10, -3e-10, 0.031], 25)
        second = np.sort(rng.choice(np.arange(40), 25) * 0.1 + jitter)
        grid, index = union(first, second)
        assert np.all(np.diff(grid) > 1e-9)
        assert np.isin(first, grid).all()
        assert np.abs(grid[index] - second).max() <= 1.5e-9


@pytest.mark.parametrize("unilateral", [True, False])
def test_a_run_that_begins_amid_another_goes_on_with_what_that_left(unilateral: bool) -> None:
    """Held at a depth for T, each mode has lost F^e (1 − e^(−νT)) of what it had when it got there."""
    held_s, depth_mm = 0.7, 0.8
    t = np.linspace(0.0, 3.0, 600)
    x = depth_mm + 0.7 * np.sin(2.0 * t)
    pad = Pad(EXPONENTIAL, GEL, unilateral)
    whole = Cascade(pad).simulate(np.append(0.0, held_s + t), np.append(depth_mm, x))[1:]
    lost_N = EXPONENTIAL.force(np.array([depth_mm]))[0] * np.expm1(-held_s * np.array(GEL.rates))
    past = Past(GEL.rates, tuple(lost_N.tolist()))
    assert_allclose(Cascade(pad, (), past).simulate(t, x), whole, atol=1e-12)
    assert np.abs(Cascade(pad).simulate(t, x) - whole).max() > 0.1


def test_modes_between_those_of_a_past_begin_between() -> None:
    past = Past((10.0, 0.1), (-2.0, 1.0))
    assert_allclose(past.at([100.0, 10.0, 1.0, 0.1, 0.01]), [-2.0, -2.0, -0.5, 1.0, 1.0], atol=1e-12)


def test_what_does_not_fade_within_a_run_is_no_past() -> None:
    past = Past((10.0, 0.1), (-2.0, 1.0), run_s=20.0)
    assert_allclose(past.at([10.0, 0.1, 1e-5]), [-2.0, -np.expm1(-2.0), 2e-4], rtol=1e-3)


def test_plants_of_one_cascade_do_not_share_state() -> None:
    cascade = Cascade(Pad(EXPONENTIAL, GEL, unilateral=True))
    one = cascade.plant()
    one.step(0.0, 1.0)
    two = one.copy()
    one.step(1.0, 2.0)
    assert_allclose(two.force_N, EXPONENTIAL.force(1.0))
    assert cascade.plant().step(0.0, 0.0) == 0.0
    one.reset()
    assert_allclose(one.step(0.0, 1.0), EXPONENTIAL.force(1.0))


def test_addresses_stay_in_their_process() -> None:
    cascade = Cascade(Pad(EXPONENTIAL, GEL, unilateral=True))
    t, x = walk(50)
    before = cascade.simulate(t, x)
    again = pickle.loads(pickle.dumps(cascade))
    assert "layout" not in again.__dict__
    assert np.array_equal(again.simulate(t, x), before)
    with pytest.raises(TypeError, match="send the model"):
        pickle.dumps(cascade.plant())
    with pytest.raises(TypeError):
        copy.deepcopy(cascade.plant())
