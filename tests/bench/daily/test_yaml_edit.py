"""Numbers put into a bench file: they are there, and nothing else has changed."""

from __future__ import annotations

import re

import pytest
import yaml

from bench.daily.yaml_edit import edit_file, edited, own_file
from bench.errors import InputError
from bench.shipped import find_file

NEW = {("load_cell", "scale"): "1.25", ("load_cell", "sign"): "-1", ("load_cell", "calibrated_on"): "2026-12-24"}


def lines_changed(before: str, after: str) -> set[str]:
    return set(after.splitlines()) - set(before.splitlines())


def test_a_shipped_bench_keeps_its_comments_and_lines(tmp_path):
    text = find_file("bench", "simulated").read_text("utf-8")
    after = edited(text, NEW, tmp_path / "b.yaml")
    assert lines_changed(text, after) == {"  scale: 1.25", "  sign: -1", "  calibrated_on: 2026-12-24"}
    assert len(after.splitlines()) == len(text.splitlines())
    assert re.findall("#.*", after) == re.findall("#.*", text)


CASES = {
    "block": ("load_cell:\n  scale: 1.0   # old\n  sign: 1\n  calibrated_on: 2020-01-01\n", "scale: 1.25   # old"),
    "flow": ("load_cell: {scale: 1.0, sign: 1}   # mine\n", "sign: -1, calibrated_on: 2026-12-24}   # mine"),
    "flow of several lines": ("load_cell: {scale: 1.0,   # s\n            sign: 1}\n", "scale: 1.25,   # s"),
    "missing keys": ("load_cell:\n  driver: dad141   # it\nlimits:\n  force: 2\n", "driver: dad141   # it"),
    "missing keys at the end": ("a: 1\nload_cell:\n  driver: dad141", "driver: dad141"),
    "missing keys, comment below": ("load_cell:\n  driver: dad141\n# limits\nlimits: {force: 2}\n", "# limits\nlimits"),
    "empty flow": ("load_cell: {}\n", "load_cell: {"),
    "missing block": ("a: 1   # one\n", "a: 1   # one"),
    "empty block": ("load_cell:\na: 1\n", "a: 1"),
    "null value": ("load_cell:\n  scale:\n  sign: null  # ?\n", "sign: -1  # ?"),
    "quoted keys": ("'load_cell':\n  \"scale\": 1.0\n", "\"scale\": 1.25"),
    "nested last value": ("load_cell:\n  map:\n    a: {b: 1}\n    c: 2\nlimits: {}\n", "    c: 2\n"),
    "CRLF": ("load_cell:\r\n  scale: 1.0\r\n  sign: 1\r\n  calibrated_on: null\r\n", "scale: 1.25\r\n"),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_what_is_set_is_set_and_the_rest_stays(case, tmp_path):
    text, stays = CASES[case]
    after = edited(text, NEW, tmp_path / "b.yaml")
    assert stays in after
    read, before = yaml.safe_load(after), yaml.safe_load(text)
    cell = read.pop("load_cell")
    assert (cell.pop("scale"), cell.pop("sign"), str(cell.pop("calibrated_on"))) == (1.25, -1, "2026-12-24")
    old = before.pop("load_cell", None) or {}
    assert cell == {key: value for key, value in old.items() if key not in ("scale", "sign", "calibrated_on")}
    assert read == before


@pytest.mark.parametrize(
    "text",
    ["a: &cell {scale: 1.0}\nload_cell: *cell\n", "load_cell: &c {scale: 1.0, sign: 1}\nother: *c\n", "load_cell: 5\n"],
)
def test_what_cannot_be_edited_alone_is_left_to_the_person(text, tmp_path):
    with pytest.raises(InputError, match=r"load_cell\.scale: 1\.25") as refusal:
        edited(text, NEW, tmp_path / "b.yaml")
    assert "by hand" in refusal.value.cure


def test_a_shipped_file_is_never_written(tmp_path):
    with pytest.raises(InputError, match="shipped bench"):
        own_file(find_file("bench", "simulated"), "simulated")
    mine = tmp_path / "simulated.yaml"
    mine.write_text("a: 1\n")
    assert own_file(mine, "simulated") == mine


def test_a_write_is_whole_or_not_at_all(tmp_path, monkeypatch):
    path = tmp_path / "b.yaml"
    path.write_text("load_cell: {scale: 1.0}\n")
    path.chmod(0o640)
    edit_file(path, {("load_cell", "scale"): "2.0"})
    assert path.read_text() == "load_cell: {scale: 2.0}\n" and path.stat().st_mode & 0o777 == 0o640

    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(OSError, match="No space"):
        edit_file(path, {("load_cell", "scale"): "3.0"})
    assert path.read_text() == "load_cell: {scale: 2.0}\n" and list(tmp_path.iterdir()) == [path]
