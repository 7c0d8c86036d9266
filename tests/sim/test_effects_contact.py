"""What pad and probe do where they meet: where the surface is, how it lets go, and what pulls."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from sim.elastic import Exponential
from sim.pad import Cascade
from sim.relaxation import Relaxation
from tests.sim.effect_tools import LINEAR, SOFT, K, active, ramp, simulate
from tests.sim.test_pad import walk


class TestContactOffset:
    def test_the_pad_is_met_later(self) -> None:
        t, x = walk(300)
        for offset in (0.2, -0.1):
            assert_allclose(
                simulate(SOFT, [active("contact_offset", offset=offset)], t, x),
                simulate(SOFT, [], t, x - offset),
                atol=1e-13,
            )

    def test_under_an_exponential_law_it_is_another_m(self) -> None:
        m, b, offset = 2.24, 0.69, -0.3
        x = np.linspace(0.1, 2.0, 50)
        shifted = np.diff(
            simulate(replace(SOFT, relaxation=Relaxation()), [active("contact_offset", offset=offset)], x, x)
        )
        other = Exponential(m * math.exp(-b * offset), b)
        assert_allclose(shifted, np.diff(other.force(x)), rtol=1e-9)

    def test_the_toe_is_a_parabola_that_ends_as_an_offset(self) -> None:
        x = np.linspace(-0.5, 2.0, 251)
        force = simulate(LINEAR, [active("contact_offset", "toe", offset=0.2)], x + 1, x)
        expected = np.where(x < 0, 0.0, np.where(x < 0.4, x**2 / 0.8, x - 0.2))
        assert_allclose(force, K * expected, atol=1e-13)


class TestSeparationAndAdhesion:
    def test_separation_is_the_unilateral_pad(self) -> None:
        t, x = walk(500)
        bonded = replace(SOFT, unilateral=False)
        assert np.array_equal(simulate(bonded, [active("separation")], t, x), simulate(SOFT, [], t, x))

    @pytest.mark.parametrize("also", [[], [("viscous_damping", 0.0)], [("frame_compliance", 1e-12)]], ids=str)
    def test_a_film_bears_its_impulse_and_closes_again(self, also: list[tuple[str, float]]) -> None:
        pad = replace(LINEAR, relaxation=Relaxation((0.5,), (2.0,)), unilateral=False)
        others = [active(name, **{active(name).form.parameters[0].name: value}) for name, value in also]
        cycle = np.concatenate([ramp(1.0, 201)[:-1], np.zeros(200)])
        x, t = np.tile(cycle, 3), np.arange(3 * cycle.size) * 2e-3
        bonded = simulate(pad, others, t, x)
        unilateral = simulate(replace(pad, unilateral=True), others, t, x)
        force = simulate(pad, [active("separation", "film", impulse=0.02), *others], t, x)
        tears = int(np.flatnonzero((force == 0.0) & (unilateral == 0.0) & (x > 0.0))[0])
        assert_allclose(force[: tears - 1], bonded[: tears - 1], atol=1e-9)
        assert bonded[tears - 2] < -0.1
        assert_allclose(force[tears:600], 0.0, atol=1e-9)
        for pull in np.split(np.maximum(-force, 0.0), 3):  # each time it closes it bears as much
            assert 2e-3 * pull.sum() == pytest.approx(0.02, rel=0.05)
        held = simulate(pad, [active("separation", "film", impulse=1e3), *others], t, x)
        assert_allclose(held, bonded, atol=1e-9)
        let_go = simulate(pad, [active("separation", "film", impulse=1e-6), *others], t, x)
        assert_allclose(let_go, unilateral, atol=2e-3)

    def test_a_bond_that_has_borne_its_impulse_is_broken_for_good(self) -> None:
        pad = replace(LINEAR, relaxation=Relaxation((0.5,), (2.0,)), unilateral=False)
        cycle = np.concatenate([ramp(1.0, 201)[:-1], np.zeros(200)])
        x, t = np.tile(cycle, 3), np.arange(3 * cycle.size) * 2e-3
        bonded = simulate(pad, [], t, x)
        pulls = [2e-3 * float(pull.sum()) for pull in np.split(np.maximum(-bonded, 0.0), 3)]
        impulse = pulls[0] + 0.5 * pulls[1]  # it holds through the first lift, and breaks in the second
        force = simulate(pad, [active("separation", "breaking", impulse=impulse)], t, x)
        tears = int(np.flatnonzero((force == 0.0) & (bonded < -1e-3))[0])
        assert 600 < tears < 1200
        assert_allclose(force[: tears - 1], bonded[: tears - 1], atol=1e-9)
        assert 2e-3 * float(np.maximum(-force, 0.0).sum()) == pytest.approx(impulse, rel=0.02)
        assert force[tears:].min() == 0.0 and force[1200:].max() == pytest.approx(force[600:1200].max(), rel=0.05)

    @pytest.mark.parametrize("also", [[], ["stress_softening"], ["viscous_damping"]], ids=str)
    def test_of_a_face_that_stays_bonded_in_part_the_parts_pull_and_let_go_beside_each_other(
        self, also: list[str]
    ) -> None:
        t, x = walk(600)
        bonded, others = replace(SOFT, unilateral=False), [active(name) for name in also]
        pulls, lets_go = simulate(bonded, others, t, x), simulate(SOFT, others, t, x)
        assert np.abs(pulls - lets_go).max() > 1.0
        for share in (0.0, 0.05, 0.4):
            force = simulate(bonded, [active("separation", "partly", bonded=share), *others], t, x)
            assert_allclose(force, share * pulls + (1 - share) * lets_go, atol=1e-9)

    def test_a_frame_gives_by_what_both_parts_bear(self) -> None:
        """All that is bonded and none: the two ends of a share, through the loop with a frame."""
        t, x = walk(300)
        bonded, frame = replace(SOFT, unilateral=False), active("frame_compliance")
        part = replace(SOFT, bonded=1.0)
        assert_allclose(simulate(part, [frame], t, x), simulate(bonded, [frame], t, x), atol=1e-9)

    @pytest.mark.parametrize(
        ("form", "shape"),
        [
            ("exponential", lambda g: np.exp(-g / 0.2)),
            ("linear", lambda g: np.maximum(0, 1 - g / 0.2)),
            ("van_der_waals", lambda g: (1 + g / 0.2 * (math.sqrt(math.e) - 1)) ** -2.0),
        ],
    )
    def test_reversible_pull(self, form: str, shape) -> None:
        x = ramp(2.0, 401) - 1.0
        force = simulate(LINEAR, [active("adhesion", form, pull_off=0.3, range=0.2)], np.arange(x.size) * 1e-2, x)
        assert_allclose(force, K * np.maximum(x, 0) - 0.3 * shape(np.maximum(-x, 0)), atol=1e-12)
        assert_allclose(force, force[::-1], atol=1e-12)

    def test_sticking_pulls_on_the_way_out_alone(self) -> None:
        x = ramp(2.0, 2001) - 1.0
        stick = active("adhesion", "sticking", pull_off=0.3, range=0.2, dwell=0.01)
        force = simulate(LINEAR, [stick], np.arange(x.size) * 1e-3, x)
        way_in, way_out = force[:2001], force[:1999:-1]
        assert_allclose(way_in[:950], 0.0, atol=1e-6)
        gap = np.maximum(-x[:2001], 0.0)
        pull = -0.3 * np.maximum(0, 1 - gap / 0.2)
        assert_allclose(way_out[:990], pull[:990], atol=1e-6)
        assert_allclose(way_in[1500:], way_out[1500:], atol=1e-6)

    @pytest.mark.parametrize("contact_s", [1.0, 20.0])
    def test_bridges_that_go_on_condensing_pull_by_the_logarithm_of_the_time(self, contact_s: float) -> None:
        held = round(contact_s * 1e3)
        x = np.concatenate([[-0.1], np.full(held + 1, 0.5), -np.linspace(0.01, 1.2, 1191)])
        aged = active("adhesion", "ageing", pull_off=0.3, range=0.2, dwell=0.1, growth=0.25)
        force = simulate(LINEAR, [aged], np.arange(x.size) * 1e-3, x)
        gap, pull = -x[held + 2 :], 0.3 * (1 + 0.25 * math.log((contact_s + 0.1) / 1.1))
        assert force[0] == 0.0
        assert_allclose(force[held + 2 :], np.where(gap < 1.0, -pull * np.exp(-gap / 0.2), 0.0), rtol=2e-3, atol=1e-12)

    def test_what_was_pressed_deeper_pulls_more_until_it_is_torn(self) -> None:
        """Presses of 0.8, 0.2 and 0.8 mm: each pulls by its own depth, and nothing pulls on the way in."""
        out = np.linspace(0.0, 1.2, 1201)
        x = np.concatenate([np.concatenate([[-1.2], np.linspace(0.0, d, 201), -out]) for d in (0.8, 0.2, 0.8)])
        stuck = active("adhesion", "preloaded", pull_off=0.3, range=0.2, power=0.5, reach=0.8)
        force = simulate(LINEAR, [stuck], np.arange(x.size) * 1e-3, x).reshape(3, -1)
        assert_allclose(force[:, 0], 0.0, atol=1e-12)
        for pull, left in zip((0.3, 0.15, 0.3), force[:, 202:], strict=True):
            assert_allclose(left, np.where(out < 1.0, -pull * np.exp(-out / 0.2), 0.0), rtol=1e-9, atol=1e-12)

    @pytest.mark.parametrize("form", ["exponential", "van_der_waals"])
    def test_a_pull_that_ends_nowhere_has_fallen_to_1_e_at_the_range(self, form: str) -> None:
        force = simulate(
            LINEAR, [active("adhesion", form, pull_off=0.3, range=0.2)], np.array([0.0, 1e-3]), np.full(2, -0.2)
        )
        assert_allclose(force, -0.3 / math.e, rtol=1e-12)

    def test_a_bond_that_tears_while_it_pulls(self) -> None:
        x = 1.0 - np.linspace(0.0, 1.3, 2601)
        stick = active("adhesion", "sticking", pull_off=0.3, range=0.2, dwell=0.01, left=0.4)
        force = simulate(LINEAR, [stick], np.arange(x.size) * 1e-3, x)
        gap = -x
        out = gap > 1e-9
        assert_allclose(force[out], np.where(gap < 0.2, -0.3 * (1 - 0.6 * gap / 0.2), 0.0)[out], atol=1e-6)

    def test_a_neck_pulls_most_when_it_is_stretched(self) -> None:
        x = ramp(2.0, 2001) - 1.0
        neck = active("adhesion", "necking", pull_off=0.3, range=0.2, crest=0.25)
        force = simulate(LINEAR, [neck], np.arange(x.size) * 1e-3, x)
        gap = np.maximum(-x[2000:], 0.0)
        pull = np.interp(gap, [0.0, 0.05, 0.2], [0.0, 0.3, 0.0])
        assert_allclose(force[:1000], 0.0, atol=1e-12)
        assert_allclose(force[2000:], K * np.maximum(x[2000:], 0.0) - pull, atol=1e-9)

    def test_fibrils_hold_until_they_tear(self) -> None:
        x = np.concatenate([ramp(0.5, 101), -ramp(0.3, 301)])
        numbers = {"pull_off": 0.3, "range": 0.2, "crest": 0.2, "holds": 0.5}
        force = simulate(LINEAR, [active("adhesion", "drawing", **numbers)], np.arange(x.size) * 1e-2, x)
        gap = 0.3 * np.arange(301) / 300
        wanted = 0.3 * np.interp(gap / 0.2, [0.0, 0.2, 0.6, 1.0], [0.0, 1.0, 1.0, 0.0])
        assert_allclose(force[201:502], -wanted, atol=1e-9)
        assert_allclose(force[502:702], 0.0, atol=1e-12)  # no bond on the way in

    def test_a_neck_bears_more_the_quicker_it_is_opened(self) -> None:
        x = np.concatenate([ramp(0.5, 101), -ramp(0.1, 101, False)])
        for speed, factor in ((10.0, 1.0), (0.1, (0.2 / 10.1) ** 0.15)):
            numbers = {"pull_off": 0.3, "range": 0.2, "exponent": 0.15}
            force = simulate(LINEAR, [active("adhesion", "quick", **numbers)], np.arange(x.size) * 1e-3 / speed, x)
            assert_allclose(force[-1], -0.3 * factor * math.sin(0.25 * math.pi), rtol=1e-9)

    def test_a_neck_that_snaps(self) -> None:
        x = ramp(2.0, 2001) - 1.0005
        neck = active("adhesion", "stretching", pull_off=0.3, range=0.2)
        force = simulate(LINEAR, [neck], np.arange(x.size) * 1e-3, x)
        gap = np.maximum(-x[2000:], 0.0)
        pull = np.where(gap < 0.2, 0.3 * np.sin(0.5 * np.pi * gap / 0.2), 0.0)
        assert_allclose(force[:1000], 0.0, atol=1e-12)
        assert_allclose(force[2000:], K * np.maximum(x[2000:], 0.0) - pull, atol=1e-9)

    def test_a_torn_bond_does_not_come_back_by_itself(self) -> None:
        plant = Cascade(LINEAR, [active("adhesion", "sticking", pull_off=0.3, range=0.2, dwell=0.01)]).plant()
        plant.step(0.0, 0.5)
        plant.step(1.0, 0.5)
        assert_allclose(plant.step(1e-3, -0.1), -0.15, rtol=1e-6)
        assert plant.step(1e-3, -0.25) == 0.0
        assert_allclose(plant.step(1e-3, -0.1), 0.0, atol=1e-6)
