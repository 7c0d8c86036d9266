"""Stamps of polled positions that may all be off together: a number of the run, as its surface is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.diagnose.data import prepare
from bench.diagnose.diagnose import believed_structure
from bench.diagnose.refit import force_at, refit
from sim.model import Model
from tests.bench.diagnose.small import measurement
from tests.truth.cases import draw_case


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("late_s", [-0.001, 0.0015])
def test_a_shift_of_all_stamps_is_found_within_its_doubt(seed: int, late_s: float) -> None:
    case = draw_case(seed, (), protocol="rate_sweep", rate_hz=1000.0, jitter="none", position_noise_mm=0.0)
    m, believed = measurement(case), Model.from_dict(case.believed)
    for doubt_s in (0.0, 0.004):
        early = replace(m, position_time_s=m.position_time_s - late_s, stamp_std_s=doubt_s)
        p = prepare(early, np.ones(len(m.force_N), dtype=bool))
        structure = believed_structure(believed, p)
        fit = refit(p.full, structure, structure.x(structure.pad.x()), 40, 1e-9)
        assert len(fit.of_run) == structure.tail
        # to first order: by some of the corners of the moves a sixth may be missing
        assert abs(structure.late_s(fit.x) - (late_s if doubt_s else 0.0)) < 0.2 * abs(late_s)


def test_where_it_stands_among_the_run_s_own_numbers() -> None:
    case = draw_case(0, (), protocol="staircase", rate_hz=200.0, jitter="none", position_noise_mm=0.0)
    m = replace(measurement(case), stamp_std_s=0.002, surface_std_mm=0.01, zero_std_N=0.003)
    p = prepare(m, np.ones(len(m.force_N), dtype=bool))
    structure = believed_structure(Model.from_dict(case.believed), p)
    assert [c.name for c in structure.coordinates[-structure.tail :]] == ["surface", "stamps", "zero"]
    x = structure.x(structure.pad.x(), tail=np.array([0.5, -1.5, 2.0]))
    told = structure.surface_mm(x), structure.late_s(x), structure.offset_N(x)
    assert told == pytest.approx((0.005, -0.003, 0.006))
    still = np.abs(p.full.speed_mm_s) == 0.0
    on_time = structure.x(structure.pad.x(), tail=np.array([0.5, 0.0, 2.0]))
    moved = force_at(p.full, structure, x) - force_at(p.full, structure, on_time)
    assert np.abs(moved[still]).max() < 0.1 * np.abs(moved).max()
