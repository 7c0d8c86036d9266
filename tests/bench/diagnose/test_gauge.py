"""The rate of damage that goes with something else than loading travel, in the mean over that of the data."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.diagnose.data import Prepared, prepare
from bench.diagnose.diagnose import believed_structure
from bench.diagnose.gauge import gauged, in_the_mean
from bench.diagnose.numbers import Structure, cause_of
from bench.diagnose.refit import Fit, force_at, refit
from sim.effects import effect
from sim.model import Model
from tests.bench.diagnose.small import measurement
from tests.truth.cases import draw_case

by_some_law = pytest.mark.parametrize(
    ("form", "own"),
    [
        ("creep", {"rate": 0.0002, "exponent": 2.5, "lasts": 1.3}),
        ("loss", {"rate": 0.02, "exponent": 1.2, "time_constant": 0.7}),
    ],
)


def damaged(seed: int, form: str, own: dict[str, float]) -> tuple[Prepared, Structure, Fit]:
    """Data of a staircase, the pad believed, and that with the damage."""
    case = draw_case(seed, (), protocol="staircase", rate_hz=200.0, jitter="none", position_noise_mm=0.0)
    m, believed = measurement(case), Model.from_dict(case.believed)
    p = prepare(m, np.ones(len(m.force_N), dtype=bool))
    pad = believed_structure(believed, p)
    structure = pad.with_cause(cause_of(effect("damage"), effect("damage").form(form), own))
    return p, pad, refit(p.full, structure, structure.x(pad.pad.x()), 0)


@by_some_law
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_rate_is_that_of_the_mean_and_the_force_as_it_was(seed: int, form: str, own: dict[str, float]) -> None:
    p, pad, fit = damaged(seed, form, own)
    again = gauged(p.full, fit)
    assert np.allclose(force_at(p.full, again.structure, again.x), force_at(p.full, fit.structure, fit.x), rtol=1e-9)
    # what is left of the stiffness, by the force against that of a pad that takes no harm, where it is pressed last
    whole, bare = force_at(p.full, fit.structure, fit.x), force_at(p.full, pad, fit.x[: len(pad.coordinates)])
    depth = p.full.position_mm
    last = np.flatnonzero(depth > 0.3 * depth.max())[-1]
    travel = float(np.sum(np.maximum(np.diff(np.maximum(depth[: last + 1], 0.0)), 0.0)))
    mean = -np.log(whole[last] / bare[last]) / travel
    stated = again.structure.values(again.x)[0]["rate"]
    assert stated == pytest.approx(mean, rel=0.1)


@by_some_law
@pytest.mark.parametrize("seed", [0, 1])
def test_its_deviation_is_that_of_the_mean_too(seed: int, form: str, own: dict[str, float]) -> None:
    p, _, fit = damaged(seed, form, own)
    fit = gauged(p.full, fit)
    at = fit.structure.of_cause(0)

    def stated(step: float) -> float:
        moved = replace(fit, x=fit.x + step * along)
        again = gauged(p.full, moved)
        return again.structure.values(again.x)[0]["rate"]

    rng = np.random.default_rng(seed)
    for _ in range(4):
        along = np.zeros(len(fit.x))
        along[at] = rng.normal(size=at.stop - at.start) * np.where(np.arange(at.stop - at.start) == 0, fit.x[at], 1.0)
        moves = abs(stated(1e-3) - stated(-1e-3)) / 2e-3
        std = np.sqrt(in_the_mean(p.full, fit, np.outer(along, along))[at.start, at.start])
        assert fit.structure.coordinates[at.start].value(std) == pytest.approx(moves, rel=0.01)
