"""What all effects have in common: metadata, streaming = arrays, files, combinations, and that one file is enough."""

import itertools
import re
import subprocess
import sys
from pathlib import Path
from textwrap import dedent

import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose

from docs.effects import RECIPE
from sim.effects import Active, Parameter, all_effects, effect
from sim.elastic import Exponential
from sim.grid import union
from sim.model import Model
from sim.pad import Cascade, Pad
from sim.slots import PLACES
from tests.sim.effect_tools import EVERY_FORM, GEL, active
from tests.sim.test_pad import walk

CONTRACT = {
    "frame_compliance": [("compliance", "mm/N")],
    "backlash": [("gap", "mm")],
    "contact_offset": [("offset", "mm")],
    "friction": [("coulomb", "N")],
    "inertia": [("mass", "kg")],
    "resonance": [("frequency", "Hz"), ("damping_ratio", "1")],
    "cogging": [("amplitude", "N"), ("period", "mm")],
    "force_delay": [("delay", "s")],
    "clock_skew": [("skew", "ppm")],
    "sensor_lag": [("time_constant", "s")],
    "force_bias": [("bias", "N")],
    "force_drift": [("rate", "N/s")],
    "mains_hum": [("amplitude", "N"), ("frequency", "Hz")],
    "saturation": [("limit", "N")],
    "outliers": [("fraction", "1")],
    "stuck_samples": [("fraction", "1")],
    "encoder_error": [("amplitude", "mm"), ("period", "mm")],
    "separation": [],
    "adhesion": [("pull_off", "N"), ("range", "mm")],
    "stress_softening": [("share", "1"), ("depth", "mm")],
    "damage": [("rate", "1/mm")],
    "permanent_set": [("set", "mm/mm")],
    "missing_relaxation_mode": [("share", "1"), ("rate", "1/s")],
    "depth_dependent_relaxation": [("slope", "1/mm")],
    "viscous_damping": [("coefficient", "N*s/mm")],
}
"""The table of the file formats: id, and the parameters that a file must give."""

WRITTEN = {
    "N": (1e3, "mN"),
    "N/s": (1e3, "mN per second"),
    "N*s/mm": (1.0, "N per mm/s"),
    "mm": (1.0, "mm"),
    "mm/mm": (1.0, "mm per mm"),
    "mm/N": (1.0, "mm per N"),
    "1/mm": (1e2, "% "),
    "1": (1e2, "% "),
    "s": (1e3, "ms"),
    "ppm": (1.0, "microseconds a second"),
    "kg": (1e3, "g "),
}
"""How a sentence for people writes a typical size of each unit: times what, and in which words."""

WITHOUT_AMPLITUDE = {
    "resonance": {"low_pass", "transmitted", "amplifier", "mounted", "pair", "antiresonance", "loaded", "damper"},
    "saturation": None,
    "separation": None,
    "elastic_law": None,
}
"""Forms that no number switches off (None: all of the effect)."""

PARTS = 5
"""Of all pairs of forms; one of them is simulated each time."""


class TestRegistry:
    def test_every_cause_of_the_contract_is_there(self) -> None:
        assert set(all_effects()) == {*CONTRACT, "elastic_law"}

    @pytest.mark.parametrize(("name", "form"), EVERY_FORM)
    def test_metadata_are_complete(self, name: str, form: str) -> None:
        cause = effect(name)
        chosen = cause.form(form)
        assert re.fullmatch(r"[a-z_]+", cause.id)
        assert cause.what.endswith(".")
        assert cause.says and cause.check and cause.reference
        assert chosen.what
        assert set(chosen.blocks) <= set(PLACES)
        for p in chosen.parameters:
            assert all(p.lower <= value <= p.upper for value in (p.typical, p.if_left_out, *p.starts)), p.name
            assert p.unit
            assert p.what
            assert p.logarithmic == (p.lower > 0.0)

    @pytest.mark.parametrize(("name", "form"), EVERY_FORM)
    def test_required_parameters_are_those_of_the_contract(self, name: str, form: str) -> None:
        parameters = effect(name).form(form).parameters
        required = [(p.name, p.unit) for p in parameters if p.required]
        if name != "elastic_law":  # there they are the law's own
            assert required == CONTRACT[name]
        assert [p.required for p in parameters] == sorted((p.required for p in parameters), reverse=True)

    @pytest.mark.parametrize(("name", "form"), EVERY_FORM)
    def test_the_sentence_for_people_takes_the_numbers_of_every_form(self, name: str, form: str) -> None:
        parameters = effect(name).form(form).parameters
        sentence = effect(name).explanation({p.name: p.typical for p in parameters if p.required})
        assert "{" not in sentence
        for p in parameters:
            if p.amplitude and p.required:
                scale, unit = WRITTEN[p.unit]
                assert f" {scale * p.typical:.3g} {unit}" in f" {sentence}"

    @pytest.mark.parametrize(("name", "form"), EVERY_FORM)
    def test_at_amplitude_0_there_is_no_effect(self, name: str, form: str) -> None:
        amplitudes = [p for p in effect(name).form(form).parameters if p.amplitude]
        without = WITHOUT_AMPLITUDE.get(name, set())
        if without is None or form in without:
            assert amplitudes == []
            return
        (amplitude,) = amplitudes
        assert amplitude.lower == 0.0 or amplitude.lower == -amplitude.upper
        t, x = walk(4000)
        pad = Pad(Exponential(2.24, 0.69), GEL, unilateral=True)
        off = Cascade(pad, [active(name, form, **{amplitude.name: 0.0})])
        # where times shift, the last of the positions at one stamp holds
        nothing = Cascade(pad).simulate_at(t, x, t) if off.shifts_time else Cascade(pad).simulate(t, x)
        assert_allclose(off.simulate(t, x), nothing, rtol=0, atol=1e-9)
        on = Cascade(pad, [active(name, form)]).simulate(t, x)
        assert np.abs(on - nothing).max() > 1e-4

    def test_forms_of_an_effect_have_names_of_their_own(self) -> None:
        for cause in all_effects().values():
            names = [form.name for form in cause.forms]
            assert len(set(names)) == len(names)

    def test_unknown(self) -> None:
        with pytest.raises(KeyError):
            effect("telepathy")
        with pytest.raises(KeyError):
            effect("friction").form("mental")
        with pytest.raises(KeyError):
            effect("friction").active(grease=1.0)

    def test_a_parameter_must_hold_its_own_bounds(self) -> None:
        with pytest.raises(ValueError, match=r"a: 3 is not from 0 to 1"):
            Parameter("a", "mm", 0.0, 1.0, 0.5, "a number", starts=(0.2, 3.0))


def compare_forms(effects: list[Active], unilateral: bool, n: int = 1500) -> None:
    """The streaming form on the grid of `simulate`, sample by sample."""
    t, x = walk(n)
    cascade = Cascade(Pad(Exponential(2.24, 0.69), GEL, unilateral), effects)
    grid, wanted, on_grid = t, np.arange(n), x
    true = cascade._true(x)
    if cascade.shifts_time:
        last = np.append(np.diff(t) > 0.0, True)
        grid, wanted = union(t[last], cascade.felt_at(t))
        on_grid = np.interp(grid, t[last], true[last])
    else:
        on_grid = true
    plant = cascade.plant()
    sensed = []
    for k, (d, p) in enumerate(zip(np.diff(grid, prepend=grid[0]), on_grid, strict=True)):
        sensed.append(plant.sense(float(d), plant.step(float(d), float(p))))
        if k:
            assert abs(plant.residual_mm) < 1e-12
    dt = np.diff(t, prepend=t[0])
    streamed = [plant.sample(float(d), sensed[k]) for d, k in zip(dt, wanted, strict=True)]
    assert_allclose(streamed, cascade.simulate(t, x), rtol=0, atol=1e-12)


@pytest.mark.parametrize("unilateral", [True, False])
class TestStreamingIsTheArrayForm:
    @pytest.mark.parametrize(("name", "form"), EVERY_FORM)
    def test_alone(self, name: str, form: str, unilateral: bool) -> None:
        compare_forms([active(name, form)], unilateral)

    def test_pairs_of_first_forms(self, unilateral: bool) -> None:
        for one, two in itertools.combinations(all_effects().values(), 2):
            compare_forms([one.active(), two.active()], unilateral, 300)

    def test_strong_feedback(self, unilateral: bool) -> None:
        stiff = [active("frame_compliance", compliance=0.3), active("friction", "presliding", coulomb=1.0)]
        compare_forms(stiff, unilateral)


@pytest.mark.parametrize("unilateral", [True, False])
@pytest.mark.parametrize("part", [0, *(pytest.param(k, marks=pytest.mark.long) for k in range(1, PARTS))])
def test_all_pairs_of_forms_give_forces(part: int, unilateral: bool) -> None:
    t, x = walk(150)
    pad = Pad(Exponential(2.24, 0.69), GEL, unilateral)
    for one, two in itertools.islice(itertools.combinations(EVERY_FORM, 2), part, None, PARTS):
        force = Cascade(pad, [active(*one), active(*two)]).simulate(t, x)
        assert np.isfinite(force).all(), (one, two)


@pytest.mark.parametrize(("name", "form"), EVERY_FORM)
def test_at_its_bounds_a_form_gives_forces(name: str, form: str) -> None:
    """A fit may go there."""
    t, x = walk(300)
    pad = Pad(Exponential(2.24, 0.69), GEL, unilateral=True)
    parameters = effect(name).form(form).parameters
    typical = {p.name: p.typical for p in parameters}
    for p in parameters:
        for value in (p.lower, p.upper):
            force = Cascade(pad, [active(name, form, **{**typical, p.name: value})]).simulate(t, x)
            assert np.isfinite(force).all(), (p.name, value)


class TestFiles:
    @pytest.mark.parametrize(("name", "form"), EVERY_FORM)
    def test_every_form_goes_round_through_yaml(self, name: str, form: str) -> None:
        parameters = effect(name).form(form).parameters
        entry = {"id": name, "form": form}
        entry |= {p.name: {"value": p.typical, "unit": p.unit, "std": 0.01} for p in parameters}
        written = {"pad": {"elastic": {"law": "exponential", "m": 2.24, "b": 0.69}}, "effects": [entry]}
        model = Model.from_dict(yaml.safe_load(yaml.safe_dump(written)))
        again = Model.from_dict(yaml.safe_load(yaml.safe_dump(model.to_dict())))
        assert again == model
        assert model.to_dict()["effects"] == [entry]
        (held,) = model.cascade.effects
        assert held.values == {p.name: p.typical for p in parameters}

    def test_elastic_laws_may_be_written_as_in_a_pad(self) -> None:
        pad = {"elastic": {"law": "exponential", "m": 2.0, "b": 0.5}}
        for law, form in (
            ({"law": "power", "p": 3.0, "q": 0.5}, "power"),
            ({"law": "polynomial", "alpha": [0.1, 1.0, 0.5, 0.2]}, "polynomial_3"),
            ({"law": "polynomial", "alpha": [0.0, 2.0]}, "polynomial_2"),
            ({"law": "spline", "delta_mm": [0.0, 0.7, 2.0], "force_N": [0.0, 1.0, 4.0]}, "points"),
            ({"law": "spline", "delta_mm": [0.4, 0.7, 1.9], "force_N": [0.2, 1.0, 1.0]}, "points"),
        ):
            model = Model.from_dict({"pad": pad, "effects": [{"id": "elastic_law", **law}]})
            assert model.effects[0].form == form
            other = Model.from_dict({"pad": {"elastic": law}})
            x = np.linspace(-0.5, 2.0, 30)
            assert_allclose(model.simulate(x, x), other.simulate(x, x), rtol=1e-13)

    def test_a_spline_of_too_many_points_or_one_that_falls_is_refused(self) -> None:
        pad = {"elastic": {"law": "exponential", "m": 2.0, "b": 0.5}}
        many = [0.1 * i for i in range(30)]
        for depths, forces, said in ((many, many, "20 points at the most"), ([1.0, 2.0], [1.0, 0.5], "must not fall")):
            entry = {"id": "elastic_law", "law": "spline", "delta_mm": depths, "force_N": forces}
            with pytest.raises(ValueError, match=said):
                Model.from_dict({"pad": pad, "effects": [entry]})

    def test_units_may_be_written_with_a_dot(self) -> None:
        pad = {"elastic": {"law": "exponential", "m": 2.0, "b": 0.5}}
        for unit in ("N·s/mm", "N*s/mm"):
            entry = {"id": "viscous_damping", "coefficient": {"value": 0.01, "unit": unit}}
            assert Model.from_dict({"pad": pad, "effects": [entry]}).effects[0].active().values["coefficient"] == 0.01

    def test_a_law_and_another_form_contradict(self) -> None:
        entry = {"id": "elastic_law", "form": "power", "law": "exponential", "m": 1.0, "b": 1.0}
        with pytest.raises(ValueError, match="give one of them"):
            Model.from_dict({"pad": {"elastic": {"law": "none"}}, "effects": [entry]})


USE_IT = """
import sys
import sim.effects

sim.effects.__path__.append(sys.argv[1])
from sim.model import Model

model = Model.from_dict(
    {"pad": {"elastic": {"law": "exponential", "m": 2.0, "b": 0.0}}, "effects": [{"id": "gain_error", "gain": 0.25}]}
)
print(model.simulate([0.0, 1.0], [0.0, 1.0])[1], model.plant().step(0.0, 1.0))
print(sim.effects.effect("gain_error").explanation({"gain": 0.05}))
"""


def test_a_new_cause_is_one_file(tmp_path: Path) -> None:
    """The recipe's own, in a process of its own, as the list of effects is made once."""
    folder = tmp_path / "more"
    folder.mkdir()
    code = [line for line in RECIPE.splitlines() if line.startswith("    ") or not line]
    (folder / "gain_error.py").write_text(dedent("\n".join(code)), encoding="utf-8")
    result = subprocess.run(
        [sys.executable, "-c", USE_IT, str(folder)], capture_output=True, text=True, check=False, cwd=Path.cwd()
    )
    assert result.returncode == 0, result.stderr
    assert result.stdout.splitlines() == ["2.5 2.0", "the force is 5 % too large"]
