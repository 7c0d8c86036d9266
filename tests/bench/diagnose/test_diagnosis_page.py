"""The page of a diagnosis: whole, self-contained, with the right view of the residual."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from bench.diagnose.result import Remainder
from bench.report.diagnosis import card, diagnosis_page, write_diagnosis
from bench.report.diagnosis_plots import residuals, view
from bench.report.diagnosis_views import Series, View, best_view
from tests.bench.diagnose.small import made_up
from tests.bench.report.html_check import check


def test_the_page_is_whole_and_says_everything(tmp_path):
    write_diagnosis(tmp_path / "d.html", made_up())
    page = (tmp_path / "d.html").read_text("utf-8")
    assert len(page) < 2_000_000
    words = check(page).shown
    for said in ("explained by friction", "0.0500 ± 0.0040 N", "93 %", "cannot exclude: backlash", "grease the guide",
                 "52 mN", "noise floor", "flagged", "goes with the speed", "cogging", "<made & up>",
                 "a <note> & more"):  # fmt: skip
        assert said in words, said


def test_the_same_diagnosis_gives_the_same_bytes():
    assert diagnosis_page(made_up()) == diagnosis_page(made_up())


@pytest.mark.parametrize(
    "changes",
    [
        {"verdict": "consistent", "causes": [], "ranking": [], "remainders": [], "rivals": []},
        {"verdict": "unexplained", "causes": [], "left": 1.0},
        {"held_out_before": 0.0, "held_out_after": 0.0, "noise_floor": 0.0},
        {"next_protocol": {"name": "n", "description": "Tells <a> from b.", "steps": []}},
        {"flags": {"outliers": np.ones(3, dtype=bool)}},
    ],
)
def test_pages_of_all_verdicts_are_whole(changes):
    check(diagnosis_page(made_up(**changes)))


def test_where_no_candidate_gains_there_are_no_shares_of_nothing():
    assert "than chance would" in diagnosis_page(made_up(ranking=[], causes=[]))
    assert "than chance would" not in diagnosis_page(made_up())


def test_long_data_stay_small():
    d = made_up()
    repeat = 200  # 400 000 samples
    time = np.arange(d.time_s.size * repeat) * 1e-3
    noise = 0.01 * np.random.default_rng(1).standard_normal(time.size)
    long = {name: np.tile(getattr(d, name), repeat) for name in ("position_mm", "before_N", "after_N", "counted")}
    page = diagnosis_page(replace(d, time_s=time, force_N=long["after_N"] + noise, flags={}, **long))
    assert len(page) < 2_000_000


def shown(residual: np.ndarray, **changes: object) -> str:
    """The name of the view chosen for a residual that stands on nothing but noise."""
    d = made_up()
    noise = 1e-3 * np.random.default_rng(2).standard_normal(residual.size)
    d = replace(d, force_N=d.before_N + residual + noise, causes=[], **changes)
    best = best_view(d)
    return best.name if best is not None else ""


def test_each_kind_of_residual_is_shown_against_what_makes_it():
    d = made_up()
    t, x = d.time_s, d.position_mm
    speed = np.gradient(x, t)
    cycle = np.floor(t / 4.0)
    assert shown(0.05 * np.sign(speed)) in ("depth and way", "speed")
    assert shown(0.03 * (x - x.mean()) ** 2) == "depth"
    assert shown(0.05 * np.sin(2 * np.pi * x / 0.08)) == "position"
    assert shown(0.05 * np.sin(2 * np.pi * 21.0 * t)) == "frequency"
    assert shown(0.02 * cycle * (x > 0.1)) == "cycle"


def test_ticks_of_a_logarithmic_axis_are_numbers():
    series = Series("", np.geomspace(0.7, 70.0, 9), np.linspace(0.0, 1.0, 9), np.zeros(9))
    drawn = view(View("speed", "speed, mm/s", 0.5, [series], logarithmic=True))
    assert "$" not in drawn
    assert {"1", "10", "50"} <= set(re.findall(r">\s*([0-9.]+)\s*<", drawn))


def test_noise_alone_has_no_view():
    assert shown(np.zeros(made_up().time_s.size)) == ""


def test_a_hum_stands_at_its_frequency():
    d = made_up()
    hum = 0.05 * np.sin(2 * np.pi * 21.0 * d.time_s)
    view = best_view(replace(d, force_N=d.before_N + hum, after_N=d.before_N + hum, causes=[]))
    assert view is not None
    [series] = view.series
    peak = int(np.argmax(series.before_N))
    assert series.x[peak] == pytest.approx(21.0, abs=0.06)
    assert series.before_N[peak] == pytest.approx(0.05, rel=0.2)  # a Hann window's peak, between two bins at worst
    assert series.after_N.max() < 1e-6


def test_a_question_ends_with_its_mark():
    d = made_up(verdict="consistent", causes=[], doubts=["the force is as noisy as it can be: is the screw dry?"])
    assert "is the screw dry?</p>" in card(d)


def test_where_no_cause_is_named_nothing_is_shown_twice():
    named, plain = (check(diagnosis_page(d)) for d in (made_up(), made_up(verdict="consistent", causes=[], flags={})))
    assert "after: with the causes named" in named.words and "before: as believed, refitted" in named.words
    for words in ("after: with the causes named", "before: as believed, refitted", "after", "before"):
        assert words not in plain.words, words
    assert "as believed, refitted" in plain.words and "with the causes named" not in plain.shown


@pytest.mark.parametrize(("p_value", "said"), [(0.0, "< 0.0001"), (1e-300, "< 0.0001"), (0.003, "0.003"), (0.4, "0.4")])
def test_the_chance_of_a_finding_is_never_said_to_be_none(p_value, said):
    told = Remainder("speed", p_value, 0.03, "goes with the speed", True)
    assert f'<td class="n">{said.replace("<", "&lt;")}</td>' in diagnosis_page(made_up(remainders=[told]))


def test_what_is_left_is_drawn_in_a_unit_of_its_own():
    """Newtons before and micronewtons after: one unit for both wrote 1e-5 over the legend."""
    told = made_up()
    left_N = 1e-5 * np.sign(told.force_N - told.after_N)
    plot = residuals(replace(told, before_N=told.before_N - 5.0, after_N=told.force_N - left_N, noise_floor=2e-5))
    assert ">residual, N<" in plot and ">residual, µN<" in plot
