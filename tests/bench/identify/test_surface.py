"""A surface that touch-off has put a little off: found again, within the doubt stated, and honestly."""

from __future__ import annotations

import numpy as np
import pytest

from bench.identify import fit
from bench.recording.types import Measurement
from tests.truth.dataset import make
from tests.truth.laws import Exponential, Power
from tests.truth.motion import staircase
from tests.truth.noise import Noise, White
from tests.truth.pad import Pad

from .closed_form import of_dataset

DOUBT_MM = 0.01
EXPONENTIAL = Pad(Exponential(2.24, 0.69), (0.25, 0.15), (4.0, 0.35))
POWER = Pad(Power(2.0, 1.2), (0.3,), (2.0,))


def misplaced(pad: Pad, seed: int) -> tuple[Measurement, float]:
    """A staircase whose positions are off by a draw from the stated doubt, and that draw (mm)."""
    rng = np.random.default_rng(seed)
    off = rng.normal(0.0, DOUBT_MM)
    path = staircase([0.6, 1.2, 1.8, 1.2, 0.6, -0.5], 80.0, 3.0)
    data = of_dataset(make(pad, path, 300.0, Noise(White(0.01)), rng))
    data.position_mm = data.position_mm - off
    data.surface_std_mm = DOUBT_MM
    return data, off


@pytest.mark.parametrize(
    "pad", [EXPONENTIAL, pytest.param(POWER, marks=pytest.mark.long)], ids=["exponential", "power"]
)
def test_parameters_are_honest_though_the_surface_is_off(pad: Pad) -> None:
    law, truth = pad.law.name, pad.parameters()
    z, found, off = [], [], []
    for seed in range(12):
        data, by = misplaced(pad, seed)
        result = fit(data, law=law, order=len(pad.rates))
        z += [(result.parameters[name].value - value) / result.parameters[name].std for name, value in truth.items()]
        found.append(result.surface_moved_mm[0])
        off.append(by)
    assert np.mean(np.abs(z) < 2) > 0.85
    # These forces tell the surface far better than the doubt they were given.
    assert np.std(np.subtract(found, off)) < 0.3 * DOUBT_MM


@pytest.mark.parametrize("seeds", [range(1), pytest.param(range(1, 12), marks=pytest.mark.long)])
def test_a_misplaced_surface_is_not_taken_for_another_law(seeds: range) -> None:
    chosen = [(r.law, r.order) for r in (fit(misplaced(EXPONENTIAL, seed)[0]) for seed in seeds)]
    assert chosen.count(("exponential", 2)) >= 5 * len(seeds) / 6


def test_it_is_said() -> None:
    data, off = misplaced(EXPONENTIAL, 3)
    result = fit(data, law="exponential", order=2)
    assert result.to_json()["surface_moved_mm"] == result.surface_moved_mm
    assert any("the surface was put" in note and ("higher" if off > 0 else "lower") in note for note in result.notes)


def test_a_certain_surface_is_not_moved() -> None:
    data, _ = misplaced(POWER, 1)
    data.surface_std_mm = 0.0
    result = fit(data, law="power", order=1)
    assert result.surface_moved_mm == [0.0] and "surface_moved_mm" not in result.to_json()


def test_each_run_has_its_own_surface() -> None:
    several, offs = zip(*(misplaced(POWER, seed) for seed in (1, 2, 3)), strict=True)
    result = fit(list(several), law="power", order=1)
    assert np.allclose(result.surface_moved_mm, offs, atol=0.3 * DOUBT_MM)


def test_a_method_that_takes_the_surface_for_certain_has_its_doubt_in_its_errors() -> None:
    z = []
    for seed in range(16):
        result = fit(misplaced(EXPONENTIAL, seed)[0], method="recursive", law="exponential", order=2)
        truth = EXPONENTIAL.parameters()
        z += [(result.parameters[name].value - value) / result.parameters[name].std for name, value in truth.items()]
    assert np.mean(np.abs(z) < 2) > 0.85 and np.std(z) > 0.5


def test_the_share_that_never_relaxes_has_an_honest_error() -> None:
    z = []
    for seed in range(16):
        rest = fit(misplaced(EXPONENTIAL, seed)[0], law="exponential", order=2).c_0
        assert rest is not None
        z.append((rest.value - 0.6) / rest.std)
    assert np.mean(np.abs(z) < 2) > 0.8 and 0.5 < np.std(z) < 1.6
