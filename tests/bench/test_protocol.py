"""Protocol files: what they mean, and what is refused, with its place."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench.errors import InputError
from bench.protocol import Approach, DepthStep, ForceStep, Protocol, load_protocol
from bench.shipped import shipped_names
from bench.yamlfile import parse, validate

CONTRACT = """\
name: staircase
description: The paper's Fig. 5, up and down.
approach: {speed: 2, force: 0.05, retract: 0.5}
precondition: {to: 2.0, speed: 20, cycles: 5, rest: 10}
limits: {force: 15, depth: 3.5}
steps:
  - {to: 0.6, speed: 80, hold: 4}
  - {to_force: 5, speed: 2, hold: 4}
  - {block: cycle, repeat: 3, steps: [{to: 2.4, speed: 10}, {to: 0.0, speed: 10, hold: 1}]}
finish: {retract: 0.5, air: 3}
"""


def protocol(text: str) -> Protocol:
    return validate(parse(text, Path("p.yaml")), Protocol)


def steps(*lines: str, head: str = "name: p\n") -> str:
    return head + "steps:\n" + "".join(f"  - {line}\n" for line in lines)


def test_the_contract_s_example() -> None:
    read = protocol(CONTRACT)
    assert isinstance(read.approach, Approach)
    assert read.approach.retract == 0.5
    flat = list(read.flatten())
    assert [f.name for f in flat] == [
        "steps[0]",
        "steps[1]",
        *(f"steps[2].cycle[{k}].steps[{i}]" for k in range(3) for i in range(2)),
    ]
    assert flat[1].step == ForceStep(to_force=5, speed=2, hold=4, hold_mode="position")
    assert flat[-1].path == ("steps", 2, "steps", 1)
    assert flat[-1].step == DepthStep(to=0, speed=10, hold=1)


def test_what_is_left_out_has_the_contract_s_defaults() -> None:
    read = protocol(steps("{to: 1, speed: 2}"))
    assert (read.finish.retract, read.finish.air) == (0.5, 3.0)
    assert isinstance(read.approach, Approach)
    assert read.precondition is None
    assert not read.in_air
    assert protocol(steps("{to: -1, speed: 2}", head="name: p\napproach: none\n")).in_air


def test_blocks_nest() -> None:
    read = protocol(
        steps("{block: a, repeat: 2, steps: [{block: b, repeat: 2, steps: [{to: 1, speed: 1}]}, {to: 0, speed: 1}]}")
    )
    assert [f.name for f in read.flatten()] == [
        "steps[0].a[0].steps[0].b[0].steps[0]",
        "steps[0].a[0].steps[0].b[1].steps[0]",
        "steps[0].a[0].steps[1]",
        "steps[0].a[1].steps[0].b[0].steps[0]",
        "steps[0].a[1].steps[0].b[1].steps[0]",
        "steps[0].a[1].steps[1]",
    ]


def test_numbers_as_names_of_samples() -> None:
    read = protocol(steps("{to: 1, speed: 1}", head="name: p\nsample: {id: 0042, thickness: 8, age: 3}\n"))
    assert (read.sample.id, read.sample.age) == ("42", "3")


@pytest.mark.parametrize(
    ("text", "place", "words"),
    [
        ("name: p\nsteps: []\n", "p.yaml:2:8", "steps: must not be empty"),
        ("name: p\n", "p.yaml:1:1", "steps: is missing"),
        (steps("{to: 1, speed: -2}"), "p.yaml:3:20", "steps[0].speed: must be > 0, not -2"),
        (steps("{to: 1, speed: 0}"), "p.yaml:3:20", "steps[0].speed: must be > 0, not 0"),
        (steps("{to: .nan, speed: 1}"), "p.yaml:3:10", "steps[0].to: `.nan` is not a finite number"),
        (steps("{to: nan, speed: 1}"), "p.yaml:3:10", "steps[0].to: must be a number, not the word `nan`"),
        (steps("{to: 1}"), "p.yaml:3:5", "steps[0].speed: is missing"),
        (steps("{to: 1, speed: 1, hold: -1}"), "p.yaml:3:29", "steps[0].hold: must be ≥ 0, not -1"),
        (steps("{to: 1, speed: 1, hlod: 1}"), "p.yaml:3:23", "steps[0].hlod: unknown key"),
        (steps("{to: 1, to_force: 1, speed: 1}"), "p.yaml:3:5", "a step has one of `to` (a depth)"),
        (steps("{speed: 1}"), "p.yaml:3:5", "a step has one of `to` (a depth)"),
        (steps("rest"), "p.yaml:3:5", "a step has one of `to` (a depth)"),
        (steps("{to_force: -1, speed: 1}"), "p.yaml:3:16", "steps[0].to_force: must be > 0, not -1"),
        (steps("{to_force: 1, speed: 1, hold_mode: forse}"), "p.yaml:3:40", "must be `position` or `force`"),
        (steps("{block: a, repeat: 0, steps: [{to: 1, speed: 1}]}"), "p.yaml:3:24", "steps[0].repeat: must be ≥ 1"),
        (steps("{block: a, repeat: 2, steps: []}"), "p.yaml:3:34", "steps[0].steps: must not be empty"),
        (steps("{block: a, steps: [{to: 1, speed: no}]}"), "p.yaml:3:39", "steps[0].steps[0].speed: must be a number"),
        (steps("{block: a/b, steps: [{to: 1, speed: 1}]}"), "p.yaml:3:13", "is no name"),
        (
            steps("{block: a, repeat: 400, steps: [{block: b, repeat: 400, steps: [{to: 1, speed: 1}]}]}"),
            "p.yaml:3:56",
            "steps[0].steps[0].repeat: the steps are more than 100000",
        ),
        (
            steps("{to: 4, speed: 1}", head="name: p\nlimits: {depth: 3}\n"),
            "p.yaml:4:10",
            "4 mm is beyond limits.depth 3",
        ),
        (
            steps("{block: a, steps: [{to_force: 9, speed: 1}]}", head="name: p\nlimits: {force: 8}\n"),
            "p.yaml:4:35",
            "steps[0].steps[0].to_force: 9 N is beyond limits.force 8 N",
        ),
        (
            steps("{to: 1, speed: 1}", head="name: p\napproach: none at all\n"),
            "p.yaml:2:11",
            "approach: must be `none`",
        ),
        (
            steps("{to: 1, speed: 1}", head="name: p\napproach: {sped: 1}\n"),
            "p.yaml:2:12",
            "approach.sped: unknown key",
        ),
        (
            steps("{to: 1, speed: 1}", head="name: p\napproach: {force: 2}\nlimits: {force: 1}\n"),
            "p.yaml:2:19",
            "approach.force: 2 N is not under limits.force 1 N",
        ),
        (
            steps(
                "{to: 1, speed: 1}", head="name: p\nprecondition: {to: 4, speed: 1, cycles: 1}\nlimits: {depth: 3}\n"
            ),
            "p.yaml:2:20",
            "precondition.to: 4 mm is beyond",
        ),
        (steps("{to_force: 1, speed: 1}", head="name: p\napproach: none\n"), "p.yaml:4:16", "nothing to press"),
        (steps("{to: 1, speed: 1}", head="name: p\njerk: 5\n"), "p.yaml:2:7", "jerk: only an s_curve has a jerk"),
        (steps("{to: 1, speed: 1}", head="name: ../p\n"), "p.yaml:1:7", "name: the word `../p` is no name"),
        (
            steps("{to: 1, speed: 1}", head="name: p\nsample: {thickness: 0}\n"),
            "p.yaml:2:21",
            "sample.thickness: must be > 0",
        ),
    ],
)
def test_what_is_refused_is_named_with_its_place(text: str, place: str, words: str) -> None:
    with pytest.raises(InputError) as caught:
        protocol(text)
    assert words in caught.value.message
    assert caught.value.place == place


@pytest.mark.parametrize("name", ["stairs-case", "stair", "staircase.yml", "protocols/Staircase.yaml"])
def test_a_missing_file_suggests_the_nearest_shipped_name(name: str) -> None:
    with pytest.raises(InputError, match="did you mean `staircase`") as caught:
        load_protocol(name)
    assert caught.value.status == 2


def test_a_file_goes_before_a_shipped_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "quick").write_text(steps("{to: 1, speed: 1}", head="name: mine\n"))
    monkeypatch.chdir(tmp_path)
    assert load_protocol("quick").name == "mine"
    assert load_protocol("staircase").name == "staircase"


@pytest.mark.parametrize("name", ["", "a\0b", "."])
def test_names_that_are_none(name: str) -> None:
    with pytest.raises(InputError):
        load_protocol(name)


@pytest.mark.parametrize("name", shipped_names("protocol"))
def test_shipped_protocols_are_called_what_their_file_is(name: str) -> None:
    read = load_protocol(name)
    assert read.name == name
    assert read.description
    assert read.text.startswith("#")


def test_all_that_is_promised_is_shipped() -> None:
    promised = {"staircase", "sweep", "quick", "long_hold", "precondition", "rich", "air", "first_contact"}
    assert promised <= set(shipped_names("protocol"))
