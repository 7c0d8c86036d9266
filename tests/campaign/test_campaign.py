"""The judge is judged: intervals against the literature, the plan against its promise, flags against hand counts."""

from __future__ import annotations

import json

import numpy as np
import pytest

from bench.recording import read_recording
from bench.recording.types import Measurement
from sim.model import Model
from tests.truth.cases import draw_case
from tests.truth.effects import EFFECTS

from .__main__ import read
from .count import (
    Rate,
    found_or_alike,
    imitated,
    least_beside,
    out_of_family,
    right_listed,
    right_or_alike,
    spurious,
    stated,
    wrongs,
)
from .family import family_rmse_N
from .halves import half as half_of
from .judge import bounds, clean_rmse_N, score_flags, truth_of
from .plan import CATALOGUE, Item, plan
from .runs_told import told_by_runs
from .table import page


@pytest.mark.parametrize(
    "hits, n, low, high", [(5, 10, 0.2366, 0.7634), (0, 10, 0.0, 0.2775), (81, 263, 0.2553, 0.3662)]
)
def test_wilson_interval(hits, n, low, high):
    # The last is of Newcombe, Stat. Med. 17, 1998, 857-872, Table I.
    assert Rate(hits, n).interval() == pytest.approx((low, high), abs=1e-4)


def test_a_larger_campaign_holds_the_smaller():
    small, large = plan(3, 2, 1, 6, 8, 5), plan(3, 5, 2, 20, 30, 9)
    keys = [item.key for item in large]
    assert {item.key for item in small} < set(keys) and len(set(keys)) == len(keys)
    assert {item.key for item in plan(4, 2, 1, 6, 8, 5)}.isdisjoint(keys)


def test_a_plan_has_every_id_and_every_shape():
    most = max(len(EFFECTS[i].shapes) for i in CATALOGUE)
    items = [item for item in plan(1, most, 1, 4, 0, 0) if item.group == "single"]
    assert {(item.ids[0], item.shapes[0]) for item in items} == {(i, s) for i in CATALOGUE for s in EFFECTS[i].shapes}
    assert all(0.05 <= item.sizes[0] <= 2.5 for item in items) and len(items) == most * len(CATALOGUE)


def test_the_judge_half_has_cases_of_its_own():
    counts = (2, 1, 6, 8, 30)
    first, judge, both = (plan(3, *counts, half=half) for half in ("first", "judge", "both"))
    assert [item.key for item in plan(3, *counts)] == [item.key for item in first]
    keys = [item.key for item in both]
    assert set(keys) == {item.key for item in [*first, *judge]} and len(set(keys)) == len(keys)
    for items, half in ((first, "first"), (judge, "judge")):
        hidden = [item for item in items if item.group != "null"]
        assert all(
            shape in EFFECTS[id].of(half) for item in hidden for id, shape in zip(item.ids, item.shapes, strict=True)
        )
        assert {item.half for item in hidden} == {half}
        assert {item.group for item in items} == {"single", "large", "null", "pair", "outside"}
    outside = {item.ids[0] for item in judge if item.group == "outside"}
    assert outside == {id for id in EFFECTS if id not in CATALOGUE and EFFECTS[id].judge}
    assert [item.key for item in first if item.group == "null"] == [item.key for item in judge if item.group == "null"]
    most = max(len(EFFECTS[i].judge) for i in CATALOGUE)
    single = [item for item in plan(1, most, 0, 0, 0, 0, half="judge") if item.group == "single"]
    assert {(i.ids[0], i.shapes[0]) for i in single} == {(i, s) for i in CATALOGUE for s in EFFECTS[i].judge}
    item = next(item for item in judge if item.group == "outside")
    assert Item.from_json(json.loads(json.dumps(item.to_json()))) == item
    # Lines written before there were two halves are of the first.
    old = {name: value for name, value in first[0].to_json().items() if name != "half"}
    assert Item.from_json(old) == first[0] and half_of({"item": old}) == "first"


def test_a_line_brings_its_case_back():
    item = next(item for item in plan(1, 0, 0, 0, 3, 0) if item.group == "pair")
    again = Item.from_json(json.loads(json.dumps(item.to_json())))
    assert again == item
    first, second = item.case(), again.case()
    assert np.array_equal(first.force_N, second.force_N) and first.truth.ids == item.ids
    assert set(truth_of(first)["truth"]["alone"]) == set(item.ids)


def test_a_torn_line_is_left_out_and_the_last_of_a_key_counts(tmp_path):
    file = tmp_path / "out.jsonl"
    file.write_text('{"key": "a", "n": 1}\n{"key": "b", "n": 1}\n{"key": "a", "n": 2}\n{"key": "c", "n"')
    assert read(file) == [{"key": "a", "n": 2}, {"key": "b", "n": 1}]


def test_flags_are_counted_among_the_samples_that_were_read():
    case = draw_case(1, ("outliers",), 1.0, "single", rate_hz=200.0, own_clock=True, jitter="none", protocol="rich")
    true = np.flatnonzero(case.truth.flags["outlier"])
    kept = np.arange(4, len(case.force_N))  # the first four were not read
    there = np.isin(kept, true)
    said = np.flatnonzero(there)[1:].tolist() + np.flatnonzero(~there)[:3].tolist()  # one missed, three too many
    stamps = np.round(case.force_time_s[kept], 7)
    n = int(there.sum())
    assert score_flags(case, stamps, {"outliers": sorted(said)})["outliers"] == [n - 1, n + 2, n]


def test_of_a_channel_that_sticks_runs_longer_than_chance_makes_tell():
    force = np.array([0, 0, 1, 2, 2, 2, 2, 3, 4, 4, 5, 5, 5, 6], dtype=float)
    stuck = np.zeros(14, dtype=bool)
    stuck[[4, 5, 6, 9]] = True
    # runs of 4: all three repeats are stuck; with that of 3, by chance, 3 of 5, and with those of 2, 4 of 7
    assert np.flatnonzero(told_by_runs(force, stuck)).tolist() == [4, 5, 6]
    stuck[[11, 12]] = True  # now with runs of 3, 5 of 5; with those of 2, 6 of 7
    assert np.flatnonzero(told_by_runs(force, stuck)).tolist() == [4, 5, 6, 11, 12]
    stuck[1] = True  # all
    assert np.array_equal(told_by_runs(force, stuck), stuck)
    stuck[:] = False
    stuck[4] = True
    assert not told_by_runs(force, stuck).any()
    assert not told_by_runs(np.arange(14.0), stuck).any()


def test_of_a_coarse_channel_what_no_run_tells_is_not_asked_for():
    case = draw_case(201, ("stuck_samples",), 0.5, "single_repeats", noise_kind="quantised", noise_N=0.02)
    stamps = case.time_s if case.force_time_s is None else case.force_time_s
    counts = score_flags(case, stamps, {})
    there = int(case.truth.flags["stuck"].sum())
    assert counts["any"] == [0, 0, there] and there > 10
    assert counts["told"] == [0, 0, 0]


def test_a_model_is_held_against_the_force_without_noise(tmp_path):
    # The pad as it is, but for a bias that nobody told it of; the noise of 20 mN is not counted.
    how = {"protocol": "rich", "noise_kind": "white", "noise_N": 0.02, "position_noise_mm": 0.0, "jitter": "none"}
    case = draw_case(2, ("force_bias",), 1.0, "constant", **how)
    case.write(tmp_path)
    measurement = read_recording(tmp_path / "data.csv").measurement()
    model = Model.from_dict(case.truth.structure.model())
    bias_N = case.truth.parameters["force_bias"]["bias"]
    assert clean_rmse_N(case, measurement, model) == pytest.approx(abs(bias_N), rel=0.03)


def test_what_no_shape_of_a_family_makes_is_left():
    # A bias, as the family has it; and on it a sawtooth of the time that no bias has: half of its amplitude over √3.
    how = {"protocol": "rich", "noise_kind": "white", "noise_N": 0.02, "position_noise_mm": 0.0, "jitter": "none"}
    case = draw_case(2, ("force_bias",), 1.0, "constant", **how)
    stamps = case.time_s if case.force_time_s is None else case.force_time_s
    measurement = Measurement("case", case.time_s, case.position_mm, stamps, case.force_N)
    model = Model.from_dict(case.believed | {"effects": [{"id": "force_bias", "form": "constant", "bias": 0.01}]})
    saw_N = 0.1 * (stamps / 0.7 % 1.0)
    left = [family_rmse_N(measurement, case.truth.clean_N + more, model, "force_bias") for more in (0.0, saw_N)]
    assert left[0] < 0.002 and left[1] == pytest.approx(0.1 / np.sqrt(12.0), rel=0.1)
    assert family_rmse_N(measurement, case.truth.clean_N, model, "outliers") is None


def test_an_error_on_data_held_out_is_one_of_the_family_or_not():
    # Of a floor of 12 mN 1.15 times is 13.8 mN, and √(13.8² − 12²) = 6.81.
    left = [line([GOOD], family_rmse_N=left_N) for left_N in (0.0068, 0.0069)]
    assert [out_of_family(own) for own in left] == [False, True] and not out_of_family(line([GOOD]))


def test_bound_of_a_bias_by_hand():
    # A constant beside a pad of known shape: never better than σ/√n, and near it since the air tells it.
    item = Item("single", ("force_bias",), ("constant",), (1.0,), 5, "white")
    case = item.case()
    bound = bounds(item, ["bias"])["bias"]
    least = case.truth.noise.std / np.sqrt(len(case.force_N))
    assert least <= bound < 5 * least


def line(said, hidden=("friction",), group="single", verdict="explained", **more):
    """A line with the causes said, each (id, value, std, alternatives not excluded)."""
    causes = [
        {
            "id": id,
            "parameters": {"coulomb": {"value": value, "std": std}},
            "confidence": 0.9,
            "alternatives": [{"id": a, "excluded": False} for a in others],
        }
        for id, value, std, others in said
    ]
    truth = {
        "parameters": {id: {"coulomb": 0.1} for id in hidden},
        "detectable": True,
        "alone": dict.fromkeys(hidden, True),
        "noise_N": 0.010,
        "misfit_N": 0.040,
        "floor_N": 0.012,
        "of_noise_power": 1.0,
        "chi2": 1e4,
        "faults": 0.0,
        "samples": 1000,
        "rate_hz": 100.0,
        "noise": "white",
        "protocol": "rich",
        "law": "Power",
        "contact": "bonded",
    }
    verdict = {"verdict": verdict, "causes": causes, "noise_floor": 0.011, "held_out_after": 0.0115, "left": 0.0}
    item = {"group": group, "ids": list(hidden), "shapes": ["a"] * len(hidden), "sizes": [1.0] * len(hidden)}
    flags = {"any": [0, 0, 0]}
    whole = {"key": f"{group}{said}", "code": "x", "item": item, "truth": truth, "said": verdict, "flags": flags}
    return whole | {"bounds": {}, "seconds": 1.0, "cpu_seconds": 1.0} | more


GOOD = ("friction", 0.105, 0.001, ())


@pytest.mark.parametrize(
    "case, wrong",
    [
        (line([GOOD]), []),
        (line([("friction", 0.12, 0.001, ())]), ["parameter off"]),
        (line([("friction", 0.12, 0.011, ())]), []),
        (line([("friction", 0.12, 0.04, ())]), ["deviation too wide"]),
        (line([("friction", 0.12, 0.04, ())], bounds={"coulomb": 0.03}), []),
        (line([("friction", 0.105, None, ())]), ["deviation too wide"]),
        (line([("backlash", 0.1, 0.001, ("friction",))]), ["wrong first"]),
        (line([GOOD, ("backlash", 0.1, 0.1, ())]), ["spurious second"]),
        (line([], verdict="consistent"), ["missed"]),
        (line([], verdict="unexplained"), ["missed", "unexplained"]),
        (line([], (), "null", "consistent"), []),
        (line([GOOD], (), "null"), ["false alarm"]),
        (line([GOOD], ("friction", "backlash"), "pair"), ["one of a pair missed"]),
        (line([GOOD], ("elsewhere",), "outside"), ["outside effect explained"]),
        (line([GOOD], ("elsewhere",), "outside", "unexplained"), []),
        (line([GOOD], flags={"any": [8, 8, 10]}), ["flags"]),
        (line([GOOD], error="Traceback\nValueError: no"), ["error"]),
    ],
)
def test_what_is_wrong_with_a_line(case, wrong):
    assert wrongs(case) == wrong


@pytest.mark.parametrize(
    "said, left_N, is_one",
    [
        ([GOOD], 0.019, True),
        ([GOOD], 0.021, False),
        ([GOOD, ("backlash", 0.1, 0.1, ())], 0.019, True),
        ([GOOD, ("backlash", 0.1, 0.1, ()), ("inertia", 0.1, 0.1, ())], 0.019, False),
        ([], 0.0, False),
    ],
)
def test_an_imitation_of_what_is_outside_the_catalogue(said, left_N, is_one):
    assert imitated(line(said, ("elsewhere",), "outside", clean_rmse_N=left_N)) is is_one
    assert not imitated(line(said, ("elsewhere",), "outside"))


def test_second_causes_and_alternatives():
    assert spurious(line([GOOD, ("backlash", 0.1, 0.1, ())])) and not spurious(line([GOOD]))
    assert right_listed(line([("backlash", 0.1, 0.1, ("friction",))])) and not right_listed(
        line([("backlash", 1, 1, ())])
    )
    wrong = line([("backlash", 0.1, 0.1, ("friction",))])
    assert right_or_alike(line([GOOD])) and right_or_alike(wrong | {"as_good": True})
    assert not right_or_alike(wrong | {"as_good": False})
    assert not right_or_alike(line([("backlash", 1, 1, ())]) | {"as_good": True})
    assert [s.near for s in stated(line([GOOD]))] == [True] and stated(line([("backlash", 0.1, 0.1, ())])) == []


def test_of_a_pair_one_may_be_listed_beside_one_that_fits_as_well():
    lines = [line([GOOD, ("force_delay", 0.1, 0.1, ("sensor_lag",))], ("friction", "sensor_lag"), "pair")] * 2
    lines = [lines[0] | {"alike": {"sensor_lag": "force_delay"}}, lines[1] | {"alike": {}}]
    assert [found_or_alike(own, "sensor_lag") for own in lines] == [True, False]
    rows = page(lines, "command").splitlines()
    at = next(k for k, row in enumerate(rows) if row.startswith("| both of a pair named"))
    shares = [[cell.strip() for cell in row.strip("|").split("|")][:3:2] for row in rows[at : at + 2]]
    assert shares == [["both of a pair named", "0.0 %"], ["… or listed beside one that fits as well", "50.0 %"]]


def test_the_page_counts():
    lines = [line([GOOD]), line([("backlash", 0.1, 0.001, ())]), line([], (), "null", "consistent")]
    text = page(lines, "command")
    row = next(row for row in text.splitlines() if row.startswith("| right cause first, single, detectable"))
    cells = [cell.strip() for cell in row.strip("|").split("|")]
    assert cells[1:] == ["≥ 97 %", "50.0 %", "9.5–90.5 %", "2", "no"]


def test_the_page_has_the_halves_side_by_side():
    judged = line([GOOD])
    judged["item"] |= {"half": "judge", "shapes": ["b"]}
    text = page([line([GOOD]), line([("backlash", 0.1, 0.001, ())]), judged], "command")
    part = text[text.index("## The two halves") : text.index("## By effect")]
    row = next(row for row in part.splitlines() if row.startswith("| right cause first, single, detectable"))
    cells = [cell.strip() for cell in row.strip("|").split("|")]
    assert cells[1:] == ["≥ 97 %", "50.0 %", "9.5–90.5 %", "2", "no", "100.0 %", "20.7–100.0 %", "1", "yes, open"]
    assert "## By effect, judge half" in text and "friction, b (judge)" in text and "friction, a (judge)" not in text


def test_pairs_go_by_what_is_seen_of_the_lesser():
    hidden = ("friction", "backlash")
    seen = [{"friction": 9e4, "backlash": least} for least in (50.0, 700.0, 800.0)]
    both = [GOOD, ("backlash", 0.1, 0.1, ())]
    lines = [line(said, hidden, "pair") for said in ([GOOD], both, [GOOD])]
    for own, beside in zip(lines, seen, strict=True):
        own["truth"] |= {"beside": beside}
    assert [least_beside(own) for own in lines] == [50.0, 700.0, 800.0]
    text = page(lines, "command")
    table = text[text.index("## Pairs") : text.index("## What was named first")]
    rows = [[cell.strip() for cell in row.strip("|").split("|")] for row in table.splitlines() if row.startswith("|")]
    assert rows[2:] == [["0–60", "1", "0", "0", "1", "0"], ["600–2000", "2", "1", "1", "1", "0"]]
    target = next(row for row in text.splitlines() if row.startswith("| … each seen beside the other"))
    assert [cell.strip() for cell in target.strip("|").split("|")][2:5] == ["50.0 %", "9.5–90.5 %", "2"]
    assert "## Pairs" not in page([line([GOOD])], "command")
