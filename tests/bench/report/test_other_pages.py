from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from bench.report import FitView, PlanView, write_comparison, write_plan
from bench.report.agreement import Entry, OfSample, agreement, by_sample, differ, lines
from bench.report.compare import comparison_page
from bench.report.planned import plan_page

from . import samples
from .html_check import check


@pytest.fixture(scope="module")
def fit() -> FitView:
    return samples.fit(samples.recording(200.0, 110.0))


def changed(fit: FitView, **values: float) -> FitView:
    json = samples.fit_json()
    for name, value in values.items():
        json["parameters"][name]["value"] = value
    return dataclasses.replace(fit, json=json)


def test_comparison_shows_every_run_and_where_they_differ(fit: FitView, tmp_path: Path) -> None:
    # m differs by ten standard deviations (0.0102), b by half of one (0.0021)
    other = changed(fit, m=2.3433, b=0.6904)
    write_comparison(tmp_path / "compare.html", [("first <day>", fit), ("second $day$", other)])
    page = (tmp_path / "compare.html").read_text(encoding="utf-8")
    assert len(page.encode()) < 2_000_000
    words = check(page).shown
    assert "first <day>" in words and "second $day$" in words
    assert "m N/mm no, spread 4.4 %" in words and "2.241 ± 0.010 2.343 ± 0.010" in words
    assert "b 1/mm yes, within their uncertainty 0.6893 ± 0.0021 0.6904 ± 0.0021" in words


def test_agreement_is_the_chi_square_test() -> None:
    def entries(*values: float) -> list[Entry]:
        return [Entry(i, value, 1.0, "N", False) for i, value in enumerate(values)]

    # two values with std 1: χ² = d²/2 on one degree of freedom; its 5 % point is 3.841, so d = 2.772
    assert agreement(entries(0.0, 2.75)).startswith("yes")
    assert agreement(entries(0.0, 2.79)).startswith("perhaps: equal ones scatter so far in 4.9 % of cases")
    # its 1 % point is 6.635, so d = 3.643
    assert agreement(entries(0.0, 3.60)).startswith("perhaps")
    assert agreement(entries(0.0, 3.68)).startswith("no")
    assert agreement(entries(0.0)) == ""
    # a surer value's own bar is hidden by its mark: 2.2 deviations of the other apart, beyond its 95 % bar
    other = Entry(1, 0.1686, 0.0085, "1", False)
    assert agreement([Entry(0, 0.149951, 0.000091, "1", False), other]).startswith("perhaps")
    undetermined = [Entry(0, 0.0, 1.0, "N", False), Entry(1, 50.0, 1.0, "N", True)]
    assert agreement(undetermined) == ""


def test_samples_are_held_against_the_scatter_of_their_repeats() -> None:
    """Two samples of two runs, a unit apart each: F = 2 d² on 1 and 2 degrees, whose 5 % point is 18.513 (d = 3.042)
    and whose 1 % point is 98.50 (d = 7.018)."""

    def told(d: float, std: float = 1e-6) -> tuple[list[OfSample], str]:
        values = [0.0, 1.0, d, d + 1.0]
        means, chance = by_sample([Entry(i, v, std, "N", False) for i, v in enumerate(values)], ["a", "a", "b", "b"])
        return means, differ(chance)

    assert told(3.0)[1] == "no further apart than repeats"
    assert told(3.1)[1].startswith("perhaps apart: repeats scatter so far in 4.")
    assert told(7.1)[1] == "further apart than repeats"
    assert told(7.1)[0] == [("a", 2, 0.5, pytest.approx(0.5)), ("b", 2, pytest.approx(7.6), pytest.approx(0.5))]
    # repeats that happen to lie close tell no more than the fits' own errors allow
    assert told(7.1, std=10.0)[1] == "no further apart than repeats"


def test_samples_without_repeats_or_names_are_not() -> None:
    entries = [Entry(i, float(i), 0.1, "N", False) for i in range(3)]
    for names in (["a", "b", "c"], ["a", "a", "a"], ["", "", ""], ["a", "a", ""]):
        assert by_sample(entries, names)[0] == []


def test_a_comparison_by_sample_in_page_and_terminal(fit: FitView) -> None:
    # two fits of each pad 0.002 apart, with errors of 0.0102; the pads 0.5 apart
    runs = [(f"run {i}", changed(fit, m=m)) for i, m in enumerate((2.240, 2.242, 2.740, 2.742))]
    words = check(comparison_page(runs, samples=["soft", "soft", "hard", "hard"])).shown
    assert "further apart than repeats" in words and "2.2410 ± 0.0072 (2)" in words
    said = lines([view.json for _, view in runs], ["soft", "soft", "hard", "hard"])
    assert any("soft 2.2410 ± 0.0072 (2), hard 2.7410 ± 0.0072 (2): further apart" in line for line in said)
    assert "By sample" not in check(comparison_page(runs)).shown
    assert not any("--law and --order" in line for line in said)
    mixed = [runs[0][1].json, {**runs[1][1].json, "order": 3}]
    assert "--law and --order" in lines(mixed, ["", ""])[-1]


def test_different_laws_and_missing_doubt_compare(fit: FitView) -> None:
    json = samples.fit_json(law="power", order=1, contact=None, noise_floor=None, undetermined=["p"])
    json["parameters"] = {"p": {"value": 3.0, "unit": "N/mm^q", "std": None}, "q": 1.0}
    other = dataclasses.replace(fit, json=json, elastic=None, relaxation=None)
    words = check(comparison_page([("a", fit), ("b", other), ("c", other)])).shown
    assert "power, 1 mode" in words and "(undetermined)" in words


def test_many_runs_compare(fit: FitView) -> None:
    page = comparison_page([(f"run {i}", changed(fit, m=2.2 + 0.001 * i)) for i in range(25)])
    assert len(page.encode()) < 2_000_000
    assert "20 more" in check(page).shown


def test_nothing_to_compare_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="no run"):
        write_comparison(tmp_path / "x.html", [])


def planned(**changes: object) -> PlanView:
    corner_t, corner_x, marks = samples.corners()
    t = np.arange(0.0, corner_t[-1], 0.005)
    x = np.interp(t, corner_t, corner_x)
    limits = {"force": (9.0, "N"), "depth": (3.5, "mm"), "speed": (200.0, "mm/s")}
    plan = PlanView(t, x, samples.response(t, x), marks, limits, facts={"Protocol": "staircase <1>"})
    return dataclasses.replace(plan, **changes)  # type: ignore[arg-type]


def test_a_plan_that_may_run(tmp_path: Path) -> None:
    write_plan(tmp_path / "plan.html", planned())
    page = (tmp_path / "plan.html").read_text(encoding="utf-8")
    seen = check(page)
    assert len(page.encode()) < 500_000
    assert "this protocol may run" in seen.shown and "staircase <1>" in seen.shown
    assert "goes 2.40 mm deep" in seen.shown
    assert "limit 9 N" in seen.words and "limit 3.5 mm" in seen.words and "expected force" in seen.words


def test_a_refused_plan_names_its_problem() -> None:
    page = plan_page(planned(problems=["steps[3]: the force would reach 10.7 N, over the limit of 9 N"]))
    words = check(page).shown
    assert "refuses" in words and "steps[3]: the force would reach 10.7 N" in words
    assert 'class="verdict bad"' in page


def test_a_plan_without_a_believed_pad() -> None:
    seen = check(plan_page(planned(expected_N=None)))
    assert "No pad model is believed" in seen.shown and "expected force" not in seen.words


def test_an_empty_plan_is_survived() -> None:
    check(plan_page(PlanView(np.empty(0), np.empty(0), problems=["steps: is empty"])))
