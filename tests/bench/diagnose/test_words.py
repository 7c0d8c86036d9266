"""What a person reads of a diagnosis."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from bench.diagnose.result import Number
from bench.diagnose.words import NAMES, headline, in_doubt, lines, name_of, percent, untold, verdict
from bench.report.diagnosis import diagnosis_page
from sim.effects import all_effects
from tests.bench.diagnose.small import PAD, made_up


def test_every_effect_has_a_name_of_its_own():
    named = [name_of(id) for id in all_effects()]
    assert set(NAMES) == set(all_effects())
    assert len(set(named)) == len(named)


def test_what_how_big_how_sure_and_what_to_check():
    said = "\n".join(lines(made_up()))
    first = said.splitlines()[0]
    assert first.startswith("explained by friction: error 52 mN → 16.8 mN")
    assert "noise 10 mN" in first
    assert "93 % of the error" in said and "80 % sure" in said
    assert "coulomb = 0.05 ± 0.004 N" in said
    assert "cannot exclude: backlash (97 % of the gain)" in said
    assert "check: grease the guide" in said
    assert "0.1 % of the force samples are flagged" in said
    assert "goes with the speed" in said and "course of the run" not in said, "only what passed is told"


def test_an_explanation_under_a_doubtful_name_is_one_that_can_be():
    d = made_up()
    assert verdict(d) == "What the model gets wrong is explained by friction"
    doubted = made_up(causes=[replace(d.causes[0], confidence=0.5)])
    assert verdict(doubted) == "What the model gets wrong can be explained by friction"
    assert lines(doubted)[0].startswith("explained, perhaps by friction: ")
    other = replace(d.causes[0], id="stress_softening", form="linear", parameters={}, confidence=0.95)
    said = lines(made_up(causes=[doubted.causes[0], other]))[0]
    assert said.startswith("explained by perhaps friction and stress softening: ")
    late = made_up(causes=[replace(d.causes[0], confidence=0.4, of_its_kind=0.98)])
    assert verdict(late) == "What the model gets wrong is explained by friction"


def test_where_depths_are_met_once_the_doubt_and_the_cure_are_told():
    assert "comes twice" not in "\n".join(lines(made_up()))
    said = "\n".join(lines(made_up(seen_once=True)))
    assert "no such name is more than 50 % sure" in said and "hold at 4 depths or more" in said


def test_numbers_that_the_data_hardly_tell_are_said_to_be_such():
    first = made_up().causes[0]
    assert untold(first) == ""
    wide = replace(
        first, parameters={**first.parameters, "reach": Number(0.3, "mm", 14.0), "none": Number(0.0, "1", 1.0)}
    )
    assert untold(wide) == "hardly told by these data: reach"
    assert untold(wide) in "\n".join(lines(made_up(causes=[wide])))
    for std, said in ((0.01, ""), (2.0, "hardly told by these data: phase")):
        assert untold(replace(first, parameters={"phase": Number(-1e-3, "rad", std)})) == said


def test_excluded_rivals_are_said_to_be_excluded_and_only_near_ones():
    d = made_up()
    near = replace(d.causes[0].alternatives[0], excluded=True)
    sure = replace(d.causes[0], confidence=0.95)
    said = "\n".join(lines(made_up(causes=[replace(sure, alternatives=[near])])))
    assert "excluded, though near: backlash" in said and "cannot exclude" not in said
    far = replace(near, gain_share=0.1)
    assert "backlash" not in "\n".join(lines(made_up(causes=[replace(sure, alternatives=[far])])))


def test_what_the_next_test_is_about_is_not_said_to_be_excluded():
    d = made_up()
    near = replace(d.causes[0].alternatives[0], excluded=True, gain_share=0.1)
    cause = replace(d.causes[0], alternatives=[near], confidence=0.5)
    said = "\n".join(lines(made_up(causes=[cause])))
    assert in_doubt(cause) == [near]
    assert "speak against it: backlash (10 % of the gain)" in said and "excluded" not in said
    assert in_doubt(replace(cause, confidence=0.95)) == []


def test_a_name_that_something_else_than_its_rivals_keeps_doubtful_says_what():
    d = made_up()
    assert "no surer" not in "\n".join(lines(d)) + diagnosis_page(d)
    why = "its gap is as far as it is sought here"
    doubted = made_up(causes=[replace(d.causes[0], confidence=0.125, doubt=why)])
    assert f"no surer, for {why}" in "\n".join(lines(doubted))
    assert f"cannot exclude: backlash (97 % of the gain); no surer, for {why}" in diagnosis_page(doubted)
    assert doubted.to_json()["causes"][0]["doubt"] == why


def test_two_causes_are_both_named():
    first = made_up().causes[0]
    second = replace(first, id="force_drift", form="linear", parameters={"rate": Number(1e-3, "N/s", float("nan"))})
    said = lines(made_up(causes=[first, second]))
    assert said[0].startswith("explained by friction and a drifting force:")
    assert any(line.strip() == "rate = 0.001 N/s" or line.strip().startswith("rate = 0.001 N/s") for line in said)


@pytest.mark.parametrize(
    ("changes", "pattern"),
    [
        (
            {"verdict": "consistent", "causes": []},
            "^consistent: the model explains .* noise; error 51 mN, noise 10 mN$",
        ),
        ({"verdict": "unexplained", "causes": [], "left": 1.0}, "^unexplained: no known cause"),
        ({"verdict": "unexplained", "left": 0.6}, "^unexplained: friction takes 40 % .* no known cause the rest"),
        ({"verdict": "unexplained", "left": 0.1}, "^unexplained: friction would take 90 % .* something else may"),
        (
            {"verdict": "consistent", "causes": [], "model_dict": {"pad": {"elastic": {"law": "none"}}}},
            "^consistent: the bench in free air",
        ),
    ],
)
def test_verdicts(changes, pattern):
    assert re.search(pattern, headline(made_up(**changes)))


def test_what_cannot_be_explained_is_not_left_at_that():
    said = lines(made_up(verdict="unexplained", causes=[], left=1.0))
    assert any("no cause that is known here" in line and "look at what remains" in line for line in said)
    said = lines(made_up(verdict="unexplained", left=0.1))
    assert any("another run" in line for line in said) and not any("no cause that is known" in line for line in said)


def test_errors_that_hardly_differ_are_told_apart():
    assert "10.104 mN → 10.079 mN" in headline(made_up(held_out_before=0.010104, held_out_after=0.010079))


@pytest.mark.parametrize(
    ("share", "said"), [(1.0, "100 %"), (0.999, "99.9 %"), (0.9996, "100 %"), (0.25, "25 %"), (0.0031, "0.31 %")]
)
def test_percent(share, said):
    assert percent(share) == said


def test_a_next_test_is_told_with_its_option():
    said = lines(made_up(next_protocol={"description": "Tells friction from backlash: slow ramps."}))[-1]
    assert "Tells friction from backlash" in said and "--next" in said


def test_numbers_that_were_not_fitted_are_left_out():
    d = made_up(causes=[replace(made_up().causes[0], form="stribeck", parameters={
        "coulomb": Number(0.05, "N", 0.004), "presliding": Number(0.001, "mm", float("nan"))})])  # fmt: skip
    fixed = {p.name for p in all_effects()["friction"].form("stribeck").parameters if p.fixed}
    said = "\n".join(lines(d))
    assert ("presliding" in said) == ("presliding" not in fixed)
    assert PAD["elastic"]["law"] == "exponential"


def test_several_causes_take_and_one_takes():
    friction = made_up().causes[0]
    both = [friction, replace(friction, id="sensor_lag")]
    assert "friction takes 40 %" in headline(made_up(verdict="unexplained", left=0.6))
    assert "friction and a lagging force sensor take 40 %" in headline(
        made_up(verdict="unexplained", left=0.6, causes=both)
    )


@pytest.mark.parametrize(
    ("share", "said"), [(0.0, "under 1 %"), (1.4e-13, "under 1 %"), (0.012, "1.2 %"), (0.3, "30 %")]
)
def test_a_rival_that_reaches_next_to_nothing(share, said):
    friction = made_up().causes[0]
    rival = replace(friction.alternatives[0], id="elastic_law", gain_share=share)
    found = "\n".join(lines(made_up(causes=[replace(friction, alternatives=[rival])])))
    assert f"cannot exclude: another elastic law ({said} of the gain)" in found
