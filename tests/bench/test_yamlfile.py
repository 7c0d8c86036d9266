"""YAML as people mean it, and one clear message for each way to get it wrong."""

from __future__ import annotations

from pathlib import Path

import pytest
from pydantic import BaseModel, ConfigDict

from bench.errors import InputError
from bench.yamlfile import MAX_BYTES, load, parse, read_yaml, validate


def data(text: str) -> object:
    return parse(text, Path("x.yaml")).data


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-3", 0.001),
        ("1E3", 1000.0),
        (".5", 0.5),
        ("5.", 5.0),
        ("-3", -3),
        ("010", 10),
        ("0x1F", 31),
        ("0o17", 15),
        ("on", "on"),
        ("off", "off"),
        ("yes", "yes"),
        ("No", "No"),
        ("true", True),
        ("False", False),
        ("~", None),
        ("null", None),
        ("none", "none"),
        ("1:30", "1:30"),
        ("1_000", "1_000"),
        ("2026-11-01", "2026-11-01"),
        ('"5"', "5"),
        ("'null'", "null"),
        ("<<", "<<"),
    ],
)
def test_scalars_mean_what_people_mean(text: str, value: object) -> None:
    read = data(f"key: {text}")
    assert read == {"key": value}
    assert type(read["key"]) is type(value)


def test_an_empty_value_is_nothing() -> None:
    assert data("key:\nother: 1") == {"key": None, "other": 1}


def test_small_aliases_are_welcome() -> None:
    assert data("a: &x {to: 1}\nb: [*x, *x]") == {"a": {"to": 1}, "b": [{"to": 1}, {"to": 1}]}


BOMB = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{b}: &{b} [*{a}, *{a}, *{a}, *{a}, *{a}, *{a}, *{a}, *{a}, *{a}]\n"
    for a, b in zip("abcdef", "bcdefg", strict=True)
)


@pytest.mark.parametrize(
    ("text", "place", "words"),
    [
        ("a: 1\nb: 2\na: 3\n", "x.yaml:3:1", "a: this key is given twice"),
        ("a: {to: 0,5, speed: 2}", "x.yaml:1:11", "a: `0,5`: numbers have a decimal point here"),
        ("a: {b: 1, c: {d: 1, d: 2}}", "x.yaml:1:21", "a.c.d: this key is given twice"),
        ("a: !!python/object/apply:os.system [echo]", "x.yaml:1:4", "tag"),
        ("a: !!float 3", "x.yaml:1:4", "tag"),
        ("a:\n  - 1\n  - .nan\n", "x.yaml:3:5", "a[1]: `.nan` is not a finite number"),
        ("a: -.inf", "x.yaml:1:4", "a: `-.inf` is not a finite number"),
        ("a: 1e999", "x.yaml:1:4", "a: `1e999` is too large a number"),
        ("a: " + "9" * 5000, "x.yaml:1:4", "too large a number"),
        ("a: 99999999999999999999", "x.yaml:1:4", "too large a number"),
        ("? [1, 2]\n: 3", "x.yaml:1:3", "a key must be a word"),
        ("true: 3", "x.yaml:1:1", "a key must be a word"),
        ("a:\n\t- 1\n", "x.yaml:2:1", "not valid YAML"),
        ("a: [1, 2\nb: 3\n", "x.yaml:2:2", "not valid YAML"),
        ("a: b: c", "x.yaml:1:5", "not valid YAML"),
        ("a: *nowhere", "x.yaml:1:4", "undefined alias"),
        ("a: 1\n---\nb: 2\n", "x.yaml:2:1", "a second document begins here"),
        ("a: 1\nb: \x07", "x.yaml:2:4", "U+0007"),
        ('a: "\\ud800"', "x.yaml:1:4", "half of a character"),
        ("[" * 5000, "x.yaml:1:51", "nested more than 50 deep"),
        ("a: &a [*a]", "x.yaml:1:4", "nested more than 50 deep"),
        ("a: [" + "1, " * 40_000 + "1]", "x.yaml:1:", "more than 30000 values"),
        (BOMB, "x.yaml:1:", "more than 30000 values"),
        ('a: "\\UFFFFFFFF"', "x.yaml", "not valid YAML"),
    ],
)
def test_what_is_refused_is_named_with_its_place(text: str, place: str, words: str) -> None:
    with pytest.raises(InputError) as caught:
        data(text)
    assert caught.value.place.startswith(place)
    assert words in caught.value.message
    assert caught.value.status == 2


def test_files_that_are_none(tmp_path: Path) -> None:
    (tmp_path / "junk.yaml").write_bytes(b"\x89PNG\r\n\x1a\n\x00\x00")
    (tmp_path / "large.yaml").write_text("a: 1\n" + "# much\n" * (MAX_BYTES // 6))
    (tmp_path / "latin.yaml").write_bytes("a: 1\nb: 2\nname: café\n".encode("latin-1"))
    (tmp_path / "wide.yaml").write_bytes("name: café\n".encode("utf-16"))
    for name, at, words, cure in [
        ("missing.yaml", "", "no such file", ""),
        ("", "", "is a directory", ""),
        ("junk.yaml", ":1", "byte 0x89 is no UTF-8", "save it as UTF-8"),
        ("latin.yaml", ":3", "byte 0xe9 is no UTF-8", "save it as UTF-8"),
        ("wide.yaml", "", "is UTF-16", "save it as UTF-8"),
        ("large.yaml", "", "larger than 1 MB", ""),
    ]:
        with pytest.raises(InputError) as caught:
            read_yaml(tmp_path / name)
        assert words in caught.value.message and cure in caught.value.cure
        assert f"{tmp_path / name}{at}" == caught.value.place


def test_a_byte_order_mark_is_not_content(tmp_path: Path) -> None:
    (tmp_path / "bom.yaml").write_bytes(b"\xef\xbb\xbfa: 1\n")
    assert read_yaml(tmp_path / "bom.yaml").data == {"a": 1}


class Inner(BaseModel):
    model_config = ConfigDict(extra="forbid")
    speed: float
    count: int = 1
    flag: bool = False


class Outer(BaseModel):
    model_config = ConfigDict(extra="forbid")
    name: str
    parts: list[Inner]
    range: tuple[float, float] = (0.0, 1.0)


def complaint(text: str) -> InputError:
    with pytest.raises(InputError) as caught:
        validate(parse(text, Path("x.yaml")), Outer)
    return caught.value


@pytest.mark.parametrize(
    ("text", "place", "message", "cure"),
    [
        ("name: a\nparts:\n  - {speeed: 1}\n", "x.yaml:3:6", "parts[0].speeed: unknown key", "did you mean `speed`?"),
        ("name: a\nparts:\n  - {count: 1}\n", "x.yaml:3:5", "parts[0].speed: is missing", ""),
        ("name: a\nparts: []\nrnage: [0, 1]\n", "x.yaml:3:1", "rnage: unknown key", "did you mean `range`?"),
        (
            "name: a\nparts: [{speed: fast}]\n",
            "x.yaml:2:17",
            "parts[0].speed: must be a number, not the word `fast`",
            "",
        ),
        ("name: a\nparts: [{speed: '5'}]\n", "x.yaml:2:17", "must be a number, not the word `5`", ""),
        ("name: a\nparts: [{speed: true}]\n", "x.yaml:2:17", "must be a number, not true", ""),
        ("name: a\nparts: [{speed: nan}]\n", "x.yaml:2:17", "must be a number, not the word `nan`", ""),
        ("name: a\nparts: [{speed: }]\n", "x.yaml:2:16", "must be a number, not nothing", ""),
        ("name: a\nparts: [{speed: 1, count: 2.5}]\n", "x.yaml:2:27", "must be a whole number, not 2.5", ""),
        ("name: a\nparts: [{speed: 1, flag: yes}]\n", "x.yaml:2:26", "must be true or false, not the word `yes`", ""),
        ("name: a\nparts: {speed: 1}\n", "x.yaml:2:8", "parts: must be a list, not a mapping", ""),
        ("name: a\nparts: [1]\n", "x.yaml:2:9", "parts[0]: must be a mapping", ""),
        ("name: a\nparts: []\nrange: [1, 2, 3]\n", "x.yaml:3:8", "range: takes at most 2 values, not 3", ""),
        ("parts: []\n", "x.yaml:1:1", "name: is missing", ""),
        ("", "x.yaml", "is empty", "name, parts"),
        ("- 1\n", "x.yaml:1:1", "must be a mapping", ""),
        ("just words", "x.yaml:1:1", "must be a mapping", ""),
    ],
)
def test_validation_names_place_field_and_cure(text: str, place: str, message: str, cure: str) -> None:
    error = complaint(text)
    assert error.place == place
    assert message in error.message
    assert cure in error.cure


def test_the_first_is_named_and_the_others_listed() -> None:
    text = "name: 3\nparts:\n" + "".join(f"  - {{speed: w{i}}}\n" for i in range(9))
    error = complaint(text)
    assert error.message.startswith("name: must be a word, not 3")
    assert "and 9 more:" in error.cure
    assert error.cure.count("must be a number") == 5
    assert "x.yaml:3:13: parts[0].speed" in error.cure


def test_load_keeps_the_text(tmp_path: Path) -> None:
    path = tmp_path / "a.yaml"
    path.write_text("# why\nname: a\nparts: [{speed: 1e-3}]\n")
    thing, text = load(path, Outer)
    assert thing.parts[0].speed == 0.001
    assert text.startswith("# why")
