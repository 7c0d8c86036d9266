"""Diagnosis of measured data, where they are there; and the steps that docs/real_diagnosis.md is made by."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import savgol_filter

from bench.recording.types import Measurement
from docs import real_diagnosis
from docs.real_cases import LEARNT_SHARE, MOST_SAMPLES, averaged, cases, end_of_learning, first_part
from docs.real_outcome import Held, Outcome, outcome

ROOT = Path(__file__).parents[3]
DATA = Path(os.environ.get("PADBENCH_DATA", ROOT.parent / "shared" / "data"))

measured = pytest.mark.skipif(not DATA.is_dir(), reason="the measured data are not here")


def of(folder: str, name: str) -> Outcome:
    return outcome(folder, name, dict(cases(DATA, folder))[name])


def half_the_gap_N(held: Held) -> float:
    """Half of what the force differs by between the two ways of what was held out."""
    speed = np.gradient(held.position_mm, held.time_s)
    return float(0.5 * (np.median(held.force_N[speed > 0.3]) - np.median(held.force_N[speed < -0.3])))


@pytest.fixture(scope="module")
def example() -> Outcome:
    return of(*real_diagnosis.EXAMPLE)


@measured
@pytest.mark.long
def test_the_worked_example_gains_on_data_held_out(example: Outcome) -> None:
    assert example.diagnosis is not None and example.diagnosis.verdict == "explained"
    assert example.gain >= 0.3
    (held,) = example.held
    force = held.force_N[held.counted]
    # a plain pad law is a poor rival on a cylinder: the best constant force, known in hindsight, is a better one
    assert held.extended_N < 0.7 * force.std()


@measured
@pytest.mark.long
def test_the_worked_example_finds_the_friction_of_its_strokes(example: Outcome) -> None:
    assert example.diagnosis is not None
    friction = next(c for c in example.diagnosis.causes if c.id == "friction")
    (held,) = example.held
    assert friction.confidence > 0.7
    assert friction.parameters["coulomb"].value == pytest.approx(half_the_gap_N(held), rel=0.2)


@measured
@pytest.mark.long
def test_friction_is_found_where_the_law_that_fits_best_alone_is_one_that_no_pad_has() -> None:
    """The fit of a pad to a cylinder has e^60 over its way; from there no fit of a cause finds its way back."""
    found = of("pneumatic_cylinder_friction", "O-ring_3bar.csv")
    assert found.diagnosis is not None
    first, (held,) = found.diagnosis.causes[0], found.held
    assert first.id == "friction" and first.confidence > 0.7
    assert held.extended_N < 0.5 * held.force_N[held.counted].std()
    assert first.parameters["coulomb"].value == pytest.approx(half_the_gap_N(held), rel=0.2)


@measured
@pytest.mark.long
def test_an_axis_is_given_the_names_of_a_bench() -> None:
    found = of("emps_linear_axis", "emps_train.csv")
    assert found.diagnosis is not None
    names = {c.id for c in found.diagnosis.causes}
    assert {"inertia", "friction"} <= names and not names & set(real_diagnosis.PAD_EFFECTS)
    assert found.gain >= 0.3
    (held,) = found.held
    step_s = float(np.median(np.diff(held.time_s)))
    speed, change = (savgol_filter(held.position_mm, 21, 3, deriv=n, delta=step_s) for n in (1, 2))
    moves = np.abs(speed) > 1.0
    columns = np.stack([1e-3 * change, np.sign(speed), speed, np.ones_like(speed)], axis=1)[moves]
    (mass_kg, coulomb_N, _, _), *_ = np.linalg.lstsq(columns, held.force_N[moves], rcond=None)
    told = {c.id: c.parameters for c in found.diagnosis.causes}
    assert told["inertia"]["mass"].value == pytest.approx(mass_kg, rel=0.1)
    assert told["friction"]["coulomb"].value == pytest.approx(coulomb_N, rel=0.2)


@measured
@pytest.mark.long
def test_tanks_are_given_no_name_of_a_pad() -> None:
    found = of("cascaded_tanks", "cts.csv")
    assert found.diagnosis is not None and found.diagnosis.verdict == "unexplained"
    assert real_diagnosis.misnamed({found.folder: [found]}) == []
    assert not any(c.id in real_diagnosis.PAD_EFFECTS and c.confidence >= 0.8 for c in found.diagnosis.causes)


@measured
@pytest.mark.parametrize("name", ["fish_muscle.csv", "liquid_foam.csv"])
def test_moduli_are_refused_by_what_is_missing(name: str) -> None:
    found = of("relaxation_modulus_pyrheo", name)
    assert found.diagnosis is None
    assert "no column 'position_mm'" in found.refusal and "relaxation_modulus_Pa" in found.refusal
    assert "/" not in found.refusal.split(":")[0]


@measured
def test_every_file_is_on_the_page() -> None:
    page = (ROOT / "docs" / "real_diagnosis.md").read_text(encoding="utf-8")
    for folder in real_diagnosis.FOLDERS:
        for name, _ in cases(DATA, folder):
            assert f"`{name}`" in page, name


def test_verdicts_stand_before_what_the_authors_say() -> None:
    page = (ROOT / "docs" / "real_diagnosis.md").read_text(encoding="utf-8")
    assert 0 < page.index("## Verdicts, written before") < page.index("## What the authors say, set by set")


def press(n: int, from_mm: float = -1.0) -> Measurement:
    """Pressed in at one speed, to 2 mm; the force is the square of the depth."""
    time = np.arange(n) / 100.0
    depth = np.linspace(from_mm, 2.0, n)
    return Measurement("press", time, depth, time.copy(), np.maximum(depth, 0.0) ** 2)


@pytest.mark.parametrize(("from_mm", "of_what"), [(-1.0, "all"), (-8.0, "pressed")])
def test_what_is_learnt_is_the_beginning_and_reaches_the_pad(from_mm: float, of_what: str) -> None:
    m = press(3000, from_mm)
    until = end_of_learning(m)
    learnt = first_part(m, until)
    least = -np.inf if of_what == "all" else 0.0
    share = np.count_nonzero(learnt.position_mm > least) / np.count_nonzero(m.position_mm > least)
    assert share == pytest.approx(LEARNT_SHARE, abs=0.01)
    assert learnt.force_time_s.max() < until and learnt.position_time_s.max() < until


def test_long_files_are_averaged_and_short_ones_left() -> None:
    short, long = press(MOST_SAMPLES), press(3 * MOST_SAMPLES)
    assert averaged(short) is short
    thin = averaged(long)
    assert len(thin.force_N) == len(thin.position_mm) == MOST_SAMPLES
    assert thin.force_N.mean() == pytest.approx(long.force_N.mean())
    assert np.interp(thin.force_time_s[5], long.force_time_s, long.position_mm) == pytest.approx(thin.position_mm[5])
