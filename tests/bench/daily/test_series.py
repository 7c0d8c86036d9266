"""A series of pads: order, rests, skip, redo, leave, stop, and going on another day."""

from __future__ import annotations

import csv
import datetime
import io
import json
import re
import threading
from collections.abc import Callable
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import yaml

import sim.world
from bench import cli
from bench.config import Bench
from bench.daily import series as work
from bench.daily.series_file import load_series
from bench.daily.series_state import read_state
from bench.daily.series_table import rows
from bench.errors import InputError, Refused
from bench.preflight import check
from bench.recording import read_recording
from tests.bench.run.benches import AIR, SHORT, bench_file, protocol_file

PADS = [{"id": "pad-1", "thickness": 3.2}, {"id": "pad 2", "note": "soft"}, {"id": "pad-3"}]


def list_file(folder: Path, **changes: Any) -> Path:
    bench_file(folder)
    protocol_file(folder, SHORT)
    content = {"bench": "bench.yaml", "protocol": "protocol.yaml", "out": "out", "rest_s": 60, "operator": "Ada",
               "conditions": "21 °C", "samples": PADS}  # fmt: skip
    path = folder / "list.yaml"
    path.write_text(yaml.safe_dump({**content, **changes}, sort_keys=False))
    return path


class Clock:
    """Time that a test moves."""

    def __init__(self) -> None:
        self.now = datetime.datetime(2026, 11, 21, 9, 0, tzinfo=datetime.UTC)

    def rest(self, seconds: float, label: str) -> None:
        self.rests.append((label, seconds))
        self.now += datetime.timedelta(seconds=seconds)

    rests: list[tuple[str, float]]


class Bystander:
    """A progress that does something to the bench while it runs."""

    def __init__(self, during: Callable[[float], None]) -> None:
        self.tell = lambda bench_s, label: during(bench_s)


def person(answers: list[str], during: Callable[[int, float], None] = lambda turn, s: None, clock: Clock | None = None):
    """Answers in order; `during(turn, bench_s)` is called in every turn of the loop of run number `turn`."""
    said: list[str] = []
    fitted: list[str] = []
    turns = iter(range(100))

    @contextmanager
    def progress():
        turn = next(turns)
        yield Bystander(lambda bench_s: during(turn, bench_s))

    def ask(question: str, known: tuple[str, ...]) -> Any:
        said.append(question)
        answer = answers.pop(0)
        assert answer in known, (question, answer)
        return answer

    def analyse(folder: Path) -> None:
        fitted.append(folder.name)
        (folder / "report.html").touch()

    clock = clock or Clock()
    clock.rests = []
    made = work.Person(
        ask=ask, say=said.append, rest=clock.rest, analyse=analyse,
        progress=progress, now=lambda: clock.now,
    )  # fmt: skip
    return made, said, fitted


def go(path: Path, made: work.Person, redo: tuple[str, ...] = ()) -> tuple[bool, Any, Any]:
    series = load_series(path)
    state = read_state(series)
    preflight = check(series.protocol, series.bench, series.believed)
    return work.measure(series, preflight, state, made, redo), series, state


def stopping(in_turns: set[int]) -> Callable[[int, float], None]:
    """Somebody presses by hand: more force on the cell than is allowed, in these runs."""
    done: set[int] = set()

    def during(turn: int, bench_s: float) -> None:
        if turn in in_turns and turn not in done and bench_s > 1.0:
            done.add(turn)
            from bench.daily.loads import put_on

            put_on(sim.world._worlds["bench"], 30.0)

    return during


def statuses(path: Path) -> dict[str, Any]:
    kept = json.loads((path.parent / "out" / "series.json").read_text())
    return {pad_id: pad["status"] for pad_id, pad in kept["pads"].items()}


def test_all_pads_in_order_each_with_its_own_name_in_the_recording(tmp_path):
    path = list_file(tmp_path)
    made, _, fitted = person(["go"] * 6)
    whole, series, state = go(path, made)
    assert whole and fitted == ["pad-1", "pad-2", "pad-3"]
    assert statuses(path) == dict.fromkeys(("pad-1", "pad 2", "pad-3"), "done")
    second, first = (read_recording(tmp_path / "out" / name).run for name in ("pad-2", "pad-1"))
    assert json.loads(second["sample"]) == {"id": "pad 2", "note": "soft"}
    assert json.loads(first["sample"])["thickness"] == 3.2
    assert second["operator"] == "Ada" and second["conditions"] == "21 °C" and "pad 2 of series list" in second["note"]
    assert first["seed"] != second["seed"]  # another pad is another draw
    assert [row["status"] for row in rows(series, state)] == ["done"] * 3


def test_leaving_and_going_on_another_day(tmp_path):
    path = list_file(tmp_path)
    made, _, fitted = person(["go", "leave"])
    assert not go(path, made)[0]
    assert fitted == ["pad-1"] and statuses(path) == {"pad-1": "done"}
    made, said, fitted = person(["skip", "go", "go"])
    assert go(path, made)[0]
    assert fitted == ["pad-3"] and said[0] == "[1 of 3] pad-1: done"
    assert statuses(path) == {"pad-1": "done", "pad 2": "skipped", "pad-3": "done"}
    made, said, fitted = person([])
    assert go(path, made)[0] and not fitted


def test_a_run_that_was_measured_and_not_analysed_is_analysed_when_the_series_goes_on(tmp_path):
    """Killed between the end of the recording and that of its report: its figures are made up for, once."""
    path = list_file(tmp_path, samples=PADS[:1])
    made, _, _ = person(["go"])

    def killed(folder: Path) -> None:
        raise KeyboardInterrupt

    made.analyse = killed
    with pytest.raises(KeyboardInterrupt):
        go(path, made)
    assert statuses(path) == {"pad-1": "done"}
    made, said, fitted = person([])
    assert go(path, made)[0] and fitted == ["pad-1"] and any("not analysed" in text for text in said)
    made, said, fitted = person([])
    assert go(path, made)[0] and fitted == []


@pytest.mark.long
def test_two_series_on_one_list_do_not_measure_together(padbench, tmp_path, monkeypatch):
    """The second begins while the first measures its first pad."""
    path, begun, inside = list_file(tmp_path, samples=PADS[:1]), work.run_protocol, []
    protocol_file(tmp_path, AIR)

    def slow(*given, **options):
        monkeypatch.setattr(work, "run_protocol", begun)
        with pytest.raises(Refused, match="another series"), work.held(tmp_path / "out"):
            pytest.fail("two series have one folder")
        other = threading.Thread(target=lambda: inside.append(cli.main(["series", str(path), "--yes"])))
        other.start()
        other.join()
        return begun(*given, **options)

    monkeypatch.setattr(work, "run_protocol", slow)
    said = padbench("series", path, "--yes")
    assert inside == [1] and said.status == 0, said
    assert [child.name for child in (tmp_path / "out").iterdir() if child.is_dir()] == ["pad-1"]
    assert statuses(path) == {"pad-1": "done"}


@pytest.mark.long
def test_every_pad_is_fitted_with_the_structure_of_the_list(padbench, tmp_path):
    """Of its own this pad is found to have another: pads compare in one structure only."""
    path = list_file(tmp_path, samples=PADS[:1], law="power", order=1, contact="bonded")
    assert padbench("series", path, "--yes").status == 0
    fit = json.loads((tmp_path / "out/pad-1/fit.json").read_text())
    assert (fit["law"], fit["order"], fit["contact"]) == ("power", 1, "bonded")


@pytest.mark.parametrize("wrong", [{"law": "square"}, {"order": 0}, {"order": "two"}, {"contact": "glued"}])
def test_a_structure_that_is_none_is_refused_before_anything_is_measured(padbench, tmp_path, wrong):
    said = padbench("series", list_file(tmp_path, **wrong), "--yes")
    assert said.status == 2 and f"{next(iter(wrong))}:" in said.err and not (tmp_path / "out").exists()


def test_a_stopped_run_is_done_anew_from_its_beginning_and_both_are_kept(tmp_path):
    path = list_file(tmp_path, samples=PADS[:1])
    made, said, fitted = person(["go", "redo", "go"], stopping({0}))
    assert go(path, made)[0]
    assert fitted == ["pad-1_2"] and any("STOPPED: " in text for text in said)
    first, second = (read_recording(tmp_path / "out" / name) for name in ("pad-1", "pad-1_2"))
    assert first.result is not None and first.result["status"] == "stopped"
    assert second.result is not None and second.result["status"] == "done"
    assert [event.name for event in second.events].count("touch_off") == 1
    assert statuses(path) == {"pad-1": "done"}


def test_a_pad_that_was_stopped_has_another_turn_another_day(tmp_path):
    path = list_file(tmp_path, samples=PADS[:2])
    made, _, fitted = person(["go", "leave"], stopping({0}))
    assert not go(path, made)[0] and statuses(path) == {"pad-1": "stopped"}
    made, _, fitted = person(["go", "go", "go", "go"])
    assert go(path, made)[0] and fitted == ["pad-1_2", "pad-2"]


def test_redo_of_one_that_is_done(tmp_path):
    path = list_file(tmp_path, samples=PADS[:2])
    made, _, _ = person(["go", "redo", "go", "go", "go"])
    assert go(path, made)[0]
    assert sorted(folder.name for folder in (tmp_path / "out").iterdir() if folder.is_dir()) == [
        "pad-1", "pad-1_2", "pad-2",
    ]  # fmt: skip
    made, _, fitted = person(["go", "go"])
    assert go(path, made, ("pad 2",))[0] and fitted == ["pad-2_2"]


def test_by_itself_it_tries_a_stopped_pad_once_more_and_goes_on(tmp_path):
    path = list_file(tmp_path, samples=PADS[:2])
    made, _, fitted = person(["go"] * 9, stopping({0, 1}))
    made.by_itself = True
    assert go(path, made)[0] and fitted == ["pad-2"]
    assert statuses(path) == {"pad-1": "stopped", "pad 2": "done"}


def test_ctrl_c_leaves_the_series_and_not_only_the_run(tmp_path):
    path = list_file(tmp_path)
    import os
    import signal

    sent = []

    def during(turn: int, bench_s: float) -> None:
        if bench_s > 0.5 and not sent:
            sent.append(os.kill(os.getpid(), signal.SIGINT))

    made, said, fitted = person(["go"], during)
    assert not go(path, made)[0] and not fitted
    assert statuses(path) == {"pad-1": "stopped"}


def test_a_pad_rests_since_it_was_mounted_or_last_touched(tmp_path, monkeypatch):
    path = list_file(tmp_path, samples=PADS[:1])
    series = load_series(path)
    monkeypatch.setattr(type(series.bench), "all_simulated", property(lambda bench: False))
    clock = Clock()
    made, _, _ = person([], clock=clock)
    pad, mounted = series.pads[0], clock.now
    assert work._rest(series, made, pad, mounted) == 60.0 and clock.rests == [("pad-1 rests", 60.0)]
    clock.now += datetime.timedelta(seconds=45)
    assert work._rest(series, made, pad, clock.now - datetime.timedelta(seconds=45)) == 60.0
    assert clock.rests[1] == ("pad-1 rests", 15.0)
    assert work._rest(series, made, pad, clock.now - datetime.timedelta(seconds=500)) == 500.0
    assert len(clock.rests) == 2


def test_a_countdown_waits_as_long_as_it_says(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(work.time, "monotonic", lambda: now[0])
    monkeypatch.setattr(work.time, "sleep", lambda s: now.__setitem__(0, now[0] + s))
    told: list[float] = []
    work.wait(2.5, told.append)
    assert now[0] == pytest.approx(102.5) and told == [2.5, 1.5, 0.5]


def test_the_state_is_the_old_or_the_new_one_when_the_power_goes(tmp_path, monkeypatch):
    path = list_file(tmp_path)
    made, _, _ = person(["go", "leave"])
    go(path, made)
    before = (tmp_path / "out" / "series.json").read_text()
    made, _, _ = person(["skip"])
    monkeypatch.setattr("os.fsync", lambda descriptor: (_ for _ in ()).throw(OSError(5, "gone")))
    with pytest.raises(OSError, match="gone"):
        go(path, made)
    assert (tmp_path / "out" / "series.json").read_text() == before


def test_the_command_writes_table_and_csv(padbench, tmp_path, monkeypatch):
    path = list_file(tmp_path, samples=PADS[:2])
    parameters = {"m": {"value": 2.2, "unit": "N/mm", "std": 0.02}, "nu_1": {"value": 3.6, "unit": "1/s", "std": None}}
    about = {"law": "exponential", "order": 1, "contact": "unilateral", "rmse": 0.0098, "noise_floor": 0.01}
    fit = {**about, "fit_percent": 99.1, "undetermined": ["nu_1"], "parameters": parameters}

    def analysed(folder, **_):
        (folder / "fit.json").write_text(json.dumps(fit))
        return type("Results", (), {"lines": lambda self: ["fit: as told"]})()

    monkeypatch.setattr("bench.results.analyse", analysed)
    said = padbench("series", path, "--yes")
    assert said.status == 0 and re.search(r"^pad 2 +done +2\.200 ± 0\.020 +3\.6\d* +9\.8", said.out, re.M)
    table = list(csv.DictReader(io.StringIO((tmp_path / "out" / "series.csv").read_text())))
    assert [row["id"] for row in table] == ["pad-1", "pad 2"] and table[0]["m"] == "2.2" and table[0]["m_std"] == "0.02"
    assert table[0]["thickness"] == "3.2" and table[1]["undetermined"] == "nu_1" and table[1]["nu_1_std"] == ""
    again = padbench("series", path, "--yes", "--json", "-")
    assert json.loads(again.out)["complete"] is True and again.status == 0
    monkeypatch.setattr("sys.stdin", io.StringIO("x\nq\n"))
    assert padbench("series", path, "--redo", "pad-1").status == 1
    (tmp_path / "protocol.yaml").write_text((tmp_path / "protocol.yaml").read_text() + "# changed\n")
    changed = padbench("series", path, "--yes")
    assert changed.status == 2 and "not the one that this series began with" in changed.err
    assert padbench("series", path, "--yes", "--changed").status == 0


BAD: dict[str, tuple[dict[str, Any], str]] = {
    "unknown key": ({"sampels": []}, r"list\.yaml:\d+:1: sampels: unknown key\n.*`samples`"),
    "wrong type": ({"rest_s": "long"}, r"list\.yaml:\d+:9: rest_s: .*number"),
    "both": ({"rest_s": "long", "sampels": []}, r"and 1 more:\n.*sampels"),
    "no pads": ({"samples": []}, r"samples: must not be empty"),
    "no id": ({"samples": [{"note": "x"}]}, r"samples\[0\]\.id: is missing"),
    "twice": ({"samples": [{"id": "a b"}, {"id": "a-b"}]}, r"list\.yaml:\d+:\d+: samples\[1\]\.id: .*samples\[0\]"),
    "no bench": ({"bench": "nowhere.yaml"}, r"list\.yaml:1:8: bench: `nowhere\.yaml`: there is no such file"),
    "no protocol": ({"protocol": "stairs"}, r"list\.yaml:2:11: protocol: `stairs`: .*\n.*shipped"),
}


@pytest.mark.parametrize("case", BAD)
def test_a_list_that_cannot_be_meant(padbench, tmp_path, case):
    changes, message = BAD[case]
    said = padbench("series", list_file(tmp_path, **changes), "--yes")
    assert said.status == 2 and re.search(message, said.err), said.err
    assert "Traceback" not in said.err and not (tmp_path / "out").exists()


def test_files_of_a_list_are_relative_to_it(tmp_path):
    path = list_file(tmp_path)
    (tmp_path / "kept").mkdir()
    (tmp_path / "protocol.yaml").rename(tmp_path / "kept" / "stairs.yaml")
    (tmp_path / "lists").mkdir()
    listed = yaml.safe_load(path.read_text())
    bench = str((tmp_path / listed["bench"]).resolve())
    moved = tmp_path / "lists" / "list.yaml"
    moved.write_text(yaml.safe_dump(listed | {"bench": bench, "protocol": "../kept/stairs.yaml", "out": "../out/gels"}))
    series = load_series(moved)
    assert series.protocol.steps and series.out.resolve() == tmp_path / "out" / "gels"


def test_other_bad_input(padbench, tmp_path):
    missing = padbench("series", "nowhere.yaml")
    assert missing.status == 2 and "nowhere.yaml: there is no such file" in missing.err
    path = list_file(tmp_path)
    assert "there is no pad `x`" in padbench("series", path, "--redo", "x").err
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "series.json").write_text('{"pads": 3}')
    with pytest.raises(InputError, match="no state of a series"):
        read_state(load_series(path))


def test_a_stopped_pad_rests_again_before_it_is_done_anew(tmp_path, monkeypatch):
    path = list_file(tmp_path, samples=PADS[:1])
    monkeypatch.setattr(Bench, "all_simulated", property(lambda bench: False))
    clock = Clock()
    made, _, _ = person(["go", "redo", "go"], stopping({0}), clock)
    assert go(path, made)[0]
    assert clock.rests == [("pad-1 rests", 60.0), ("pad-1 rests", 60.0)]
    second = read_recording(tmp_path / "out" / "pad-1_2").run
    assert second["note"].startswith("left alone for 60 s")
