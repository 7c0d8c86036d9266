"""fit.json as docs/formats.md fixes it."""

from __future__ import annotations

import json

import numpy as np
import pytest

from bench.identify import fit
from tests.truth.laws import Exponential, Polynomial, Power
from tests.truth.pad import Pad

from .closed_form import measured

KEYS = [
    *("method", "law", "order", "contact", "model", "parameters", "filter", "V", "rmse", "noise_floor", "fit_percent"),
    *("physical", "converged", "undetermined", "held_out_rmse", "samples", "seconds", "notes"),
]


@pytest.fixture(scope="module")
def result():
    return fit(measured(Pad(Exponential(2.24, 0.69), (0.25, 0.15), (4.0, 0.35)), noise_N=0.05))


def test_it_holds_just_what_it_must(result) -> None:
    data = json.loads(json.dumps(result.to_json(), allow_nan=False))
    assert list(data) == KEYS
    assert data["method"] == "continuous" and data["filter"] is None
    assert data["notes"] == result.notes and all(isinstance(line, str) for line in data["notes"])
    assert list(data["parameters"]) == ["m", "b", "c_1", "c_2", "nu_1", "nu_2"]
    assert [p["unit"] for p in data["parameters"].values()] == ["N/mm", "1/mm", "1", "1", "1/s", "1/s"]
    assert all(set(p) == {"value", "unit", "std"} and p["std"] > 0 for p in data["parameters"].values())


def test_figures_follow_their_definitions(result) -> None:
    t = result.traces[0]
    e, F = t.force_N - t.simulated_N, t.force_N
    assert pytest.approx(np.mean(e**2)) == result.V
    assert result.rmse == pytest.approx(np.sqrt(result.V))
    assert result.fit_percent == pytest.approx(100 * (1 - np.linalg.norm(e) / np.linalg.norm(F - F.mean())))
    assert result.noise_floor == pytest.approx(0.05, rel=0.1)
    assert result.samples == len(F)


def test_the_model_is_a_model_file(result) -> None:
    pad = result.to_json()["model"]["pad"]
    values = {name: p.value for name, p in result.parameters.items()}
    assert pad["elastic"] == {"law": "exponential", "m": values["m"], "b": values["b"]}
    assert pad["relaxation"]["shares"] == [values["c_1"], values["c_2"]]
    assert pad["relaxation"]["rates"] == [values["nu_1"], values["nu_2"]]
    assert values["nu_1"] > values["nu_2"]
    assert pad["std"] == {name: p.std for name, p in result.parameters.items()}
    model = result.model.to_dict()["pad"]
    assert {k: model[k] for k in ("elastic", "relaxation", "contact")} == {k: v for k, v in pad.items() if k != "std"}


@pytest.mark.parametrize(
    ("law", "names", "units"),
    [
        (Power(1.7, 0.8), ["p", "q"], ["N/mm^(q+1)", "1"]),
        (Polynomial((0.0, 2.0, 0.5)), ["alpha_1", "alpha_2"], ["N/mm", "N/mm^2"]),
    ],
)
def test_names_of_the_other_laws(law, names: list[str], units: list[str]) -> None:
    result = fit(
        measured(Pad(law, (0.4,), (1.3,)), noise_N=0.02),
        law=law.name,
        order=1,
        degree=len(names) if len(names) == 2 and law.name == "polynomial" else None,
    )
    assert [*result.parameters] == [*names, "c_1", "nu_1"]
    assert [result.parameters[n].unit for n in names] == units


def test_standard_errors_grow_with_the_noise_and_the_doubt_of_the_surface() -> None:
    pad = Pad(Power(1.7, 0.8), (0.4,), (1.3,))
    quiet, loud = (fit(measured(pad, noise_N=s), law="power", order=1) for s in (0.01, 0.04))
    assert loud.parameters["q"].std == pytest.approx(4 * quiet.parameters["q"].std, rel=0.1)
    data = measured(pad, noise_N=0.01)
    data.surface_std_mm = 0.02
    doubtful = fit(data, law="power", order=1)
    shifted = measured(pad, noise_N=0.01)
    shifted.position_mm = shifted.position_mm + 0.02
    moved = fit(shifted, law="power", order=1)
    for name in ("p", "q"):
        extra = np.sqrt(doubtful.parameters[name].std ** 2 - quiet.parameters[name].std ** 2)
        # At most what a surface one standard deviation away would do: the data themselves tell where it is.
        assert 0 < extra < abs(moved.parameters[name].value - quiet.parameters[name].value)
