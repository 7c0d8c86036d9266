"""Forces that were felt earlier or later by chance: noise in fast moves, of a size that is told. Data of the
independent simulator."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from bench.diagnose import diagnose
from bench.diagnose.channel import faults
from bench.diagnose.data import prepare
from bench.diagnose.diagnose import believed_structure
from bench.diagnose.late_by_chance import late_by_chance_s
from bench.diagnose.numbers import cause_of
from bench.diagnose.refit import refit
from bench.diagnose.sieve import Sieve
from sim.effects import effect
from sim.model import Model
from tests.bench.diagnose.small import measurement
from tests.truth.cases import Case, draw_case

SEEDS = (0, 1, 4, 5)


def told_s(case: Case, id: str, **start: float) -> float:
    """Of a fit with a cause beside the believed pad."""
    m, believed = measurement(case), Model.from_dict(case.believed)
    prepared = prepare(m, faults(m.force_N).good)
    structure = believed_structure(believed, prepared).with_cause(cause_of(effect(id), effect(id).forms[0], start))
    fit = refit(prepared.full, structure, structure.x(structure.pad.x()), 25, 1e-8)
    return late_by_chance_s(prepared, fit)


@pytest.mark.parametrize("seeds", [SEEDS[:2], pytest.param(SEEDS[2:], marks=pytest.mark.long)])
def test_the_scatter_of_a_delay_is_told_beside_a_delay_and_beside_a_lag(seeds: tuple[int, ...]) -> None:
    ratios = []
    for seed in seeds:
        case = draw_case(seed, ("force_delay",), 1.5, "uneven", protocol="rich", rate_hz=400.0)
        scatter_s = 0.15 * case.truth.parameters["force_delay"]["delay"]
        ratios.append(told_s(case, "force_delay", delay=0.003) / scatter_s)
        ratios.append(told_s(case, "sensor_lag", time_constant=0.003) / scatter_s)
    assert np.median(ratios) == pytest.approx(1.0, abs=0.15) and min(ratios) > 0.6 and max(ratios) < 1.5, ratios


@pytest.mark.parametrize(
    "id", ["force_delay", *(pytest.param(id, marks=pytest.mark.long) for id in ("sensor_lag", "friction"))]
)
def test_what_is_late_by_a_rule_or_not_at_all_does_not_scatter(id: str) -> None:
    for seed in SEEDS:
        case = draw_case(seed, (id,), 1.5, protocol="rich", rate_hz=400.0, jitter="none")
        if case.truth.shapes[id] == "uneven":
            continue
        assert told_s(case, "force_delay", delay=0.003) == 0.0


@pytest.mark.long
def test_a_delay_that_scatters_is_explained_with_its_noise() -> None:
    said = []
    for seed in SEEDS[:3]:
        case = draw_case(seed, ("force_delay",), 1.5, "uneven", protocol="rich", rate_hz=400.0)
        d = diagnose(measurement(case), Model.from_dict(case.believed))
        names = [c.id for c in d.causes]
        beside = [a.id for a in d.causes[0].alternatives if not a.excluded] if names else []
        delay = d.causes[0].parameters.get("delay") if names[:1] == ["force_delay"] else None
        near = delay is not None and abs(delay.value / case.truth.parameters["force_delay"]["delay"] - 1.0) < 0.1
        said.append(d.verdict == "explained" and len(names) == 1 and (near or "force_delay" in beside))
    assert sum(said) >= 2, said


@pytest.mark.parametrize(("late_s", "delay_chi2", "first"), [
    (0.002, 104.0, "force_delay"),  # four fifths of a step between samples: it has waited
    (0.0005, 104.0, "sensor_lag"),  # as stamps scatter
    (0.002, 120.0, "sensor_lag"),  # it takes less than what smooths
])  # fmt: skip
def test_what_scatters_has_waited_and_no_filter_does(late_s: float, delay_chi2: float, first: str) -> None:
    size = SimpleNamespace(size=100)
    sieve = SimpleNamespace(
        short=size, prepared=SimpleNamespace(felt=SimpleNamespace(late_s=late_s), sample_s=0.0025, full=size)
    )
    costs = {"sensor_lag": 100.0, "force_delay": delay_chi2, "clock_skew": 110.0}
    ranked = [SimpleNamespace(id=id_, fit=SimpleNamespace(chi2=chi2)) for id_, chi2 in costs.items()]
    assert Sieve.late_first(sieve, SimpleNamespace(chi2=1000.0), ranked)[0].id == first
