import itertools
import math
import re

import numpy as np
import pytest
from numpy.testing import assert_allclose

from sim.effects import Active, all_effects, effect
from sim.elastic import Exponential, NoPad
from sim.kernel import PLACES
from sim.pad import Cascade, Pad
from sim.relaxation import Relaxation
from tests.sim.test_pad import walk

GEL = Relaxation((0.25, 0.15), (4.0, 0.35))
AIR = Pad(NoPad(), Relaxation(), unilateral=True)


def active(name: str, form: str | None = None, **values: float) -> Active:
    cause = effect(name)
    chosen = cause.form(form)
    return Active(cause, chosen, {p.name: values.get(p.name, p.if_left_out) for p in chosen.parameters})


EVERY_FORM = [(cause.id, form.name) for cause in all_effects().values() for form in cause.forms]


class TestRegistry:
    @pytest.mark.parametrize(("name", "form"), EVERY_FORM)
    def test_metadata_are_complete(self, name: str, form: str) -> None:
        cause = effect(name)
        chosen = cause.form(form)
        assert re.fullmatch(r"[a-z_]+", cause.id)
        assert cause.what.endswith(".")
        assert chosen.what
        assert set(chosen.blocks) <= set(PLACES)
        for p in chosen.parameters:
            assert p.lower <= p.typical <= p.upper, p.name
            assert p.lower <= p.if_left_out <= p.upper, p.name
            assert p.unit
            assert p.what

    def test_forms_of_an_effect_have_names_of_their_own(self) -> None:
        for cause in all_effects().values():
            names = [form.name for form in cause.forms]
            assert len(set(names)) == len(names)

    def test_required_parameters_are_those_of_the_contract(self) -> None:
        required = {
            cause.id: [(p.name, p.unit) for p in cause.forms[0].parameters if p.required]
            for cause in all_effects().values()
        }
        assert required["friction"] == [("coulomb", "N")]
        assert required["frame_compliance"] == [("compliance", "mm/N")]

    def test_unknown(self) -> None:
        with pytest.raises(KeyError):
            effect("telepathy")
        with pytest.raises(KeyError):
            effect("friction").form("mental")


def compare_forms(effects: list[Active], unilateral: bool) -> None:
    t, x = walk(1500)
    cascade = Cascade(Pad(Exponential(2.24, 0.69), GEL, unilateral), effects)
    plant = cascade.plant()
    worst = 0.0
    streamed = []
    for n, (d, p) in enumerate(zip(np.diff(t, prepend=t[0]), x, strict=True)):
        force = plant.sense(float(d), plant.step(float(d), float(p)))
        streamed.append(plant.sample(float(d), force))
        if n:
            worst = max(worst, abs(plant.residual_mm))
    assert_allclose(streamed, cascade.simulate(t, x), rtol=0, atol=1e-12)
    assert worst < 1e-12


@pytest.mark.parametrize("unilateral", [True, False])
class TestStreamingIsTheArrayForm:
    @pytest.mark.parametrize(("name", "form"), EVERY_FORM)
    def test_alone(self, name: str, form: str, unilateral: bool) -> None:
        compare_forms([active(name, form)], unilateral)

    def test_all_pairs(self, unilateral: bool) -> None:
        for one, two in itertools.combinations(EVERY_FORM, 2):
            if one[0] != two[0]:
                compare_forms([active(*one), active(*two)], unilateral)

    def test_strong_feedback(self, unilateral: bool) -> None:
        stiff = [active("frame_compliance", compliance=0.3), active("friction", "presliding", coulomb=1.0)]
        compare_forms(stiff, unilateral)


class TestFrameCompliance:
    def test_a_linear_pad_looks_softer_by_the_series_spring(self) -> None:
        K, C = 12.0, 0.02
        cascade = Cascade(
            Pad(Exponential(K, 0.0), Relaxation(), unilateral=True), [active("frame_compliance", compliance=C)]
        )
        t = np.arange(400) * 1e-3
        x = 1.0 - 1.2 * np.cos(30 * t)
        force, probe = cascade.probe(t, x)
        assert_allclose(force, np.maximum(x, 0.0) * K / (1 + C * K), atol=1e-13)
        assert_allclose(probe, x - C * force, atol=1e-13)

    def test_two_springs_in_series_add(self) -> None:
        pad = Pad(Exponential(2.24, 0.69), GEL, unilateral=False)
        t, x = walk(300)
        two = [active("frame_compliance", compliance=0.01), active("frame_compliance", compliance=0.015)]
        one = [active("frame_compliance", compliance=0.025)]
        assert_allclose(Cascade(pad, two).simulate(t, x), Cascade(pad, one).simulate(t, x), atol=1e-12)

    def test_the_force_lies_on_the_law_at_the_probe(self) -> None:
        law = Exponential(2.24, 0.69)
        cascade = Cascade(Pad(law, Relaxation(), unilateral=True), [active("frame_compliance", compliance=0.05)])
        force, probe = cascade.probe(*walk(300))
        assert_allclose(force, law.force(probe), atol=1e-11)


class TestFriction:
    def test_up_and_down_differ_by_twice_the_coulomb_force(self) -> None:
        t = np.arange(4001) * 1e-3
        x = 2.0 - np.abs(t - 2.0)
        law = Exponential(2.0, 0.5)
        for form in ("coulomb", "presliding"):
            friction = active("friction", form, coulomb=0.07, presliding=0.005)
            force = Cascade(Pad(law, Relaxation(), True), [friction]).simulate(t, x)
            up, down = force[200:1900], force[::-1][200:1900]
            assert_allclose(up - down, 2 * 0.07, atol=1e-12)
            assert_allclose((up + down) / 2, law.force(x[200:1900]), atol=1e-12)

    def test_rest_keeps_the_force_and_the_first_sample_has_none(self) -> None:
        for form in ("coulomb", "presliding", "stribeck"):
            plant = Cascade(AIR, [active("friction", form, coulomb=0.07)]).plant()
            assert plant.step(0.0, 3.0) == 0.0
            plant.step(0.01, 3.5)
            held = plant.step(0.1, 3.5)
            assert held >= 0.07 - 1e-12
            assert plant.step(10.0, 3.5) == held

    def test_coulomb_builds_up_along_a_spring(self) -> None:
        plant = Cascade(AIR, [active("friction", "coulomb", coulomb=0.1, presliding=0.002)]).plant()
        plant.step(0.0, 0.0)
        assert_allclose(plant.step(1e-3, 0.001), 0.05)
        assert_allclose(plant.step(1e-3, 0.1), 0.1)
        assert_allclose(plant.step(1e-3, 0.1 - 0.002), 0.0, atol=1e-13)
        assert_allclose(plant.step(1e-3, 0.1 - 0.004), -0.1)

    def test_dahl_is_exact_for_any_step(self) -> None:
        F, d = 0.1, 0.02
        expected = F * (1 - math.exp(-0.03 / d))
        for n in (1, 7, 300):
            plant = Cascade(AIR, [active("friction", "presliding", coulomb=F, presliding=d)]).plant()
            plant.step(0.0, 0.0)
            for i in range(1, n + 1):
                force = plant.step(1e-3, 0.03 * i / n)
            assert_allclose(force, expected, rtol=1e-12)

    def test_stribeck_falls_from_static_to_coulomb_and_rises_with_viscosity(self) -> None:
        numbers = {"coulomb": 0.1, "static_ratio": 1.5, "stribeck_speed": 2.0, "viscous": 0.001}
        for speed in (1e-4, 2.0, 50.0):
            plant = Cascade(AIR, [active("friction", "stribeck", **numbers)]).plant()
            plant.step(0.0, 0.0)
            dt = 0.05 / speed  # well beyond presliding
            plant.step(dt, 0.05)
            expected = 0.1 * (1 + 0.5 * math.exp(-((speed / 2.0) ** 2))) + 0.001 * speed
            assert_allclose(plant.step(dt, 0.1), expected, rtol=1e-12)

    def test_force_is_a_continuous_function_of_position(self) -> None:
        """What the implicit step needs: no jump at a reversal."""
        for form in ("coulomb", "presliding", "stribeck"):
            plant = Cascade(AIR, [active("friction", form, coulomb=1.0)]).plant()
            plant.step(0.0, 0.0)
            plant.step(1e-3, 0.2)
            before = plant.copy().step(1e-3, 0.2 + 1e-12)
            after = plant.copy().step(1e-3, 0.2 - 1e-12)
            assert abs(before - after) < 1e-8

    def test_friction_reaches_the_frame_too(self) -> None:
        """In air the deflection is that of friction alone: y = x − C F_c while sliding."""
        both = [active("friction", coulomb=0.5), active("frame_compliance", compliance=0.1)]
        force, probe = Cascade(AIR, both).probe([0.0, 0.1, 0.2], [0.0, 1.0, 0.0])
        assert_allclose(force, [0.0, 0.5, -0.5], atol=1e-13)
        assert_allclose(probe, [0.0, 0.95, 0.05], atol=1e-13)
