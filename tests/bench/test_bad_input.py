"""What is said of bad input: one clear message on standard error, with the place and the cure, and the status."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.bench.run.benches import SHORT, bench_file, merged, run
from tests.bench.said import Said

SHIPPED = Path(__file__).parents[2] / "protocols"
MODEL: dict[str, Any] = {
    "pad": {
        "elastic": {"law": "exponential", "m": 2.24, "b": 0.69},
        "relaxation": {"shares": [0.25, 0.15], "rates": [4.0, 0.35]},
        "contact": "unilateral",
    }
}


def refused(said: Said, *patterns: str, status: int = 2) -> None:
    """One message, on standard error alone, that says all this."""
    assert said.status == status, said
    assert "Traceback" not in said.err and "Error" not in said.err, said.err
    assert len(said.err.splitlines()) <= 8 and said.err.startswith("padbench ")
    for pattern in patterns:
        assert re.search(pattern, said.err, re.M), said.err


STEP = "steps:\n  - {to: 1, speed: 10}\n"
BOMB = "a: &a [1,1,1,1,1,1,1,1,1,1]\n" + "".join(
    f"{name}: &{name} [{','.join(['*' + before] * 10)}]\n" for before, name in zip("abcdefg", "bcdefgh", strict=True)
)
PROTOCOLS = {
    "unknown key": (f"name: p\n{STEP}hold: 3\n", r"p\.yaml:4:1: hold: unknown key"),
    "nearly a key": ("name: p\nsteps:\n  - {to: 1, sped: 10}\n", r"p\.yaml:3:13: steps\[0\]\.sped: .*\n.*`speed`"),
    "wrong type": ("name: p\nsteps:\n  - {to: one, speed: 10}\n", r"p\.yaml:3:10: steps\[0\]\.to: .*number.*`one`"),
    "quoted": ("name: p\nsteps:\n  - {to: '1', speed: 10}\n", r"p\.yaml:3:10: .*number.*quotes"),
    "NaN": ("name: p\nsteps:\n  - {to: .nan, speed: 10}\n", r"p\.yaml:3:10: steps\[0\]\.to: .*finite"),
    "infinite": ("name: p\nsteps:\n  - {to: .inf, speed: 10}\n", r"p\.yaml:3:10: steps\[0\]\.to: .*finite"),
    "negative speed": ("name: p\nsteps:\n  - {to: 1, speed: -10}\n", r"p\.yaml:3:20: steps\[0\]\.speed: must be > 0"),
    "no speed": ("name: p\nsteps:\n  - {to: 1}\n", r"p\.yaml:3:5: steps\[0\]\.speed: is missing"),
    "no steps": ("name: p\nsteps: []\n", r"p\.yaml:2:8: steps: must not be empty"),
    "steps missing": ("name: p\n", r"p\.yaml:1:1: steps: is missing"),
    "empty": ("", r"p\.yaml: is empty\n.*name, steps"),
    "a list": ("- 1\n", r"p\.yaml:1:1: must be a mapping"),
    "depth and force": ("name: p\nsteps:\n  - {to: 1, to_force: 2, speed: 1}\n", r"p\.yaml:3:5: .*one of `to`"),
    "python tag": (f"name: !!python/object/apply:os.system ['true']\n{STEP}", r"p\.yaml:1:7: the tag .* not allowed"),
    "anchors": (BOMB, r"p\.yaml:\d+:\d+: more than \d+ values"),
    "unclosed": ("name: p\nsteps:\n  - {to: 1, speed: 10\n", r"p\.yaml:4:1: .*the end of the file\n.*line 3"),
    "tab": ("name: p\nsteps:\n\t- {to: 1, speed: 10}\n", r"p\.yaml:3:1: .*\n.*spaces"),
    "twice": (f"name: p\nname: q\n{STEP}", r"p\.yaml:2:1: name: this key is given twice\n.*line 1"),
    "deeper than its own limit": (f"name: p\nlimits: {{depth: 0.5}}\n{STEP}", r"p\.yaml:4:10: .*beyond limits\.depth"),
    "faster than the bench": ("name: p\nsteps:\n  - {to: 1, speed: 1000}\n", r"p\.yaml:3:20: .*limits\.speed 200 mm/s"),
    "force beyond its own limit": (
        "name: p\nlimits: {force: 2}\nsteps:\n  - {to_force: 3, speed: 1}\n", r"p\.yaml:4:16: .*beyond limits\.force 2",
    ),
    "no time for a name": ("name: ''\n" + STEP, r"p\.yaml:1:7: name:"),
}  # fmt: skip


@pytest.mark.parametrize("case", PROTOCOLS)
def test_a_protocol_that_cannot_be_run(padbench, case):
    text, message = PROTOCOLS[case]
    Path("p.yaml").write_text(text)
    refused(padbench("check", "p.yaml"), "^padbench check: ", message)
    refused(padbench("run", "p.yaml", "--out", "out"), message)
    assert not Path("out").exists()


BENCHES: dict[str, tuple[dict[str, Any], str]] = {
    "unknown key": ({"motor": {"drivr": "orca"}}, r"bench\.yaml:\d+:3: motor\.drivr: unknown key\n.*`driver`"),
    "unknown driver": ({"motor": {"driver": "orka"}}, r"bench\.yaml:\d+:11: motor\.driver: .*'orca'"),
    "negative limit": ({"limits": {"force": -1}}, r"bench\.yaml:\d+:10: limits\.force: must be > 0"),
    "a limit beyond the cell": ({"limits": {"force": 80}}, r"limits\.force: 80 N is beyond load_cell\.capacity 50 N\n"),
    "travel upside down": ({"limits": {"position": [3, -3]}}, r"limits\.position: .*3.*less than.*-3"),
    "travel beyond the stroke": ({"limits": {"position": [-50, 3]}}, r"limits\.position: .*beyond motor\.stroke"),
    "no truth": ({"simulation": None}, r"motor\.port: is simulated, but there is no `simulation` block"),
    "no such pad": ({"simulation": {"pad": "pads/x.yaml"}}, r"simulation\.pad: there is no file `pads/x\.yaml`"),
    "no limits": ({"limits": None}, r"bench\.yaml:1:1: limits: is missing"),
    "not a date": ({"load_cell": {"calibrated_on": "soon"}}, r"load_cell\.calibrated_on: .*date"),
}


@pytest.mark.parametrize("case", BENCHES)
def test_a_bench_that_cannot_be(padbench, tmp_path, case):
    changes, message = BENCHES[case]
    bench_file(tmp_path, **changes)
    refused(padbench("check", "quick", "--bench", "bench.yaml"), message)


MODELS: dict[str, tuple[dict[str, Any], str]] = {
    "shares over 1": ({"relaxation": {"shares": [0.7, 0.6]}}, r"pad\.relaxation\.shares: .*1\.3, more than 1"),
    "a negative rate": ({"relaxation": {"rates": [4.0, -0.3]}}, r"pad\.relaxation\.rates\[1\]: must be > 0, not -0\.3"),
    "rates that rise": ({"relaxation": {"rates": [0.3, 4.0]}}, r"pad\.relaxation\.rates: .*descend"),
    "a share without a rate": ({"relaxation": {"shares": [0.1]}}, r"pad\.relaxation: 1 shares but 2 rates"),
    "an unknown law": (
        {"elastic": {"law": "exponental"}},
        r"pad\.elastic\.law: there is no `exponental`\n.*`exponential`",
    ),
    "a law without its number": ({"elastic": {"b": None}}, r"pad\.elastic\.b: is missing"),
    "an unknown contact": (
        {"contact": "glued"},
        r"pad\.contact: must be `unilateral` or `bonded`, not the word `glued`",
    ),
}


@pytest.mark.parametrize("case", MODELS)
def test_a_model_that_cannot_be(padbench, case):
    changes, message = MODELS[case]
    Path("m.yaml").write_text(yaml.safe_dump({"pad": merged(MODEL["pad"], changes)}, sort_keys=False))
    refused(padbench("check", "quick", "--pad", "m.yaml"), r"m\.yaml:\d+:\d+: ", message)
    refused(padbench("simulate", "m.yaml", "--protocol", "quick", "--out", "x.csv"), message)
    assert not Path("x.csv").exists()


@pytest.mark.parametrize(
    ("effect", "message"),
    [
        ({"id": "fricton", "coulomb": 0.1}, "no effect 'fricton'; did you mean 'friction'"),
        ({"id": "friction"}, "needs 'coulomb' in N"),
        ({"id": "friction", "coulomb": -1}, "coulomb must be from 0 to"),
        ({"id": "friction", "form": "stribek", "coulomb": 1}, "no form 'stribek'"),
    ],
)
def test_an_effect_that_cannot_be(padbench, effect, message):
    Path("m.yaml").write_text(yaml.safe_dump(MODEL | {"effects": [effect]}, sort_keys=False))
    refused(padbench("check", "quick", "--pad", "m.yaml"), r"m\.yaml:\d+:\d+: effects\[0\]: ", message)


TABLES = {
    "empty": ("", r"d\.csv: is empty\n.*time_s,position_mm,force_N"),
    "one line": ("time_s,position_mm,force_N\n", r"d\.csv: has a header and no row"),
    "one row": ("time_s,position_mm,force_N\n0,0,0\n", r"d\.csv: .*single row"),
    "time goes back": (
        "time_s,position_mm,force_N\n0,0,0\n1,1,1\n0.5,2,2\n",
        r"d\.csv:4:1: time goes back: 0\.5 after 1",
    ),
    "time stands still": ("time_s,position_mm,force_N\n0,0,0\n0,1,1\n0,2,2\n", r"d\.csv: .*same time"),
    "other columns": ("a,b,c\n0,0,0\n1,1,1\n", r"d\.csv: has no column 'time_s'.*\n.*'a', 'b', 'c'.*--columns"),
    "words": ("time_s,position_mm,force_N\n0,0,0\n1,y,1\n", r"d\.csv:3:3: 'y' in column 'position_mm' is not a number"),
    "NaN": ("time_s,position_mm,force_N\n0,0,0\n1,1,nan\n", r"d\.csv:3:5: 'nan' in column 'force_N'"),
    "a short row": ("time_s,position_mm,force_N\n0,0,0\n1,1\n", r"d\.csv:3: 2 cells where the header has 3"),
}


@pytest.mark.parametrize("case", TABLES)
def test_a_table_that_holds_no_measurement(padbench, case):
    text, message = TABLES[case]
    Path("d.csv").write_text(text)
    said = padbench("fit", "d.csv", "--json", "-")
    refused(said, message)
    assert said.out == ""


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", r"is empty"),
        (b"junk" * 100, r"is not an MCAP file"),
        (b"\x89MCAP0\r\n" + b"\x00" * 300, r"holds no position sample"),
    ],
)
def test_a_recording_that_is_none(padbench, content, message):
    Path("r.mcap").write_bytes(content)
    refused(padbench("fit", "r.mcap"), r"r\.mcap: ", message)
    refused(padbench("recover", "r.mcap"), r"r\.mcap: holds nothing that could be recovered")


@pytest.mark.parametrize(
    ("words", "patterns"),
    [
        (("fit", "nothing.csv"), (r"nothing\.csv: does not exist",)),
        (("fit", "dota.csv"), (r"dota\.csv: does not exist", r"did you mean data\.csv\?")),
        (("fit", "."), (r"no run folder: it has no recording\.mcap",)),
        (("fit", "/dev/null"), (r"/dev/null: is no file",)),
        (("fit", "data.csv", "--method", "continous"), (r"--method: there is no method `continous`", "continuous")),
        (("fit", "data.csv", "--law", "exp"), (r"--law: there is no law `exp`", "exponential, power, polynomial")),
        (("fit", "data.csv", "--order", "two"), (r"--order: `two` is no order",)),
        (("fit", "data.csv", "--order", "0"), (r"--order: `0` is no order",)),
        (("fit", "data.csv", "--law", "power", "--degree", "3"), (r"--degree: the power law has no degree",)),
        (("fit", "data.csv", "--law", "polynomial", "--degree", "0"), (r"--degree: 0 is no degree",)),
        (("fit", "data.csv", "--columns", "nonsense"), (r"--columns: 'nonsense' is not WHAT=COLUMN",)),
        (("fit", "data.csv", "--columns", "tme=time_s"), (r"--columns: 'tme' is not known", "did you mean 'time'")),
        (("fit", "data.csv", "--columns", "time=t"), (r"data\.csv: has no column 't'", "time=time_s")),
        (("fit", "data.csv", "--units", "position=furlong"), (r"--units: 'furlong' is no unit of position",)),
        (("fit", "data.csv", "--units", "nonsense"), (r"--units: 'nonsense' is not WHAT=UNIT",)),
        (("fit", "data.csv", "--json", "no/such/fit.json"), (r"fit\.json: cannot be written: .* no/such",)),
        (("fit", "data.csv", "--write", "no/such/m.yaml"), (r"m\.yaml: cannot be written",)),
        (("fit", "data.csv", "--report", "."), (r"\.: is a folder",)),
        (("compare", "data.csv"), (r"one run alone compares with nothing",)),
        (("compare", "data.csv", "nothing"), (r"nothing: does not exist",)),
        (("report", "nothing"), (r"nothing: does not exist",)),
        (("report", "data.csv"), (r"data\.csv: is not a run folder", r"padbench fit FILE --report")),
        (("convert", "data.csv", "x.foo"), (r"x\.foo: ends neither in \.csv nor in \.mcap",)),
        (("convert", "data.csv", "data.csv"), (r"is an input of this command",)),
        (("recover", "nothing.mcap"), (r"nothing\.mcap: does not exist",)),
        (("simulate", "polyurethane", "--like", "nothing.csv", "--out", "x.csv"), (r"nothing\.csv: does not exist",)),
        (("simulate", "polyurethane", "--protocol", "air", "--out", "x.csv"), (r"air: presses no pad",)),
        (("simulate", "polyuretane", "--protocol", "quick", "--out", "x.csv"), (r"did you mean `polyurethane`\?",)),
        (("simulate", "polyurethane", "--protocol", "quick", "--out", "no/x.csv"), (r"there is no folder no",)),
        (("run", "quik"), (r"quik: there is no such file, and no shipped protocol", r"did you mean `quick`\?")),
        (("run", "quick", "--bench", "simulatd"), (r"no shipped bench", r"did you mean `simulated`\?")),
        (("run", "quick", "--pad", "silicon"), (r"no shipped pad", r"did you mean `silicone`\?")),
        (("run", "quick", "--operator", " "), (r"--operator: is empty",)),
        (("run", "quick", "--out", "full"), (r"full: is not empty", "no run overwrites another")),
        (("run", "quick", "--out", "data.csv"), (r"data\.csv: is a file, not a folder",)),
        (("run", "quick", "--out", "data.csv/sub"), (r"data\.csv/sub: cannot be made: data\.csv is a file", "--out")),
        (("run", "quick", "--out", "/proc/x"), (r"/proc/x: cannot be written", "--out")),
        (("check", "missing.yaml"), (r"missing\.yaml: there is no such file",)),
        (("emulate", "nope"), (r"no shipped bench of that name",)),
        (("check", "a_bench.yaml"), (r"a_bench\.yaml:\d+:1: is a bench", "wanted here: a protocol")),
        (("check", "quick", "--bench", "a_protocol.yaml"), (r"is a protocol", "wanted here: a bench")),
        (("check", "quick", "--pad", "a_bench.yaml"), (r"is a bench", "wanted here: a model")),
        (("check", "a_model.yaml"), (r"a_model\.yaml:\d+:1: is a model", "wanted here: a protocol")),
        (("fit", "short.csv"), (r"short\.csv: only 12 force samples can be fitted",)),
        (("fit", "data.csv", "--sample-time", "0.01"), (r"--sample-time: the continuous method", "noniterative")),
    ],
)  # fmt: skip
def test_what_is_not_there_or_makes_no_sense(padbench, csv, words, patterns):
    Path("data.csv").write_bytes(csv.read_bytes())
    Path("short.csv").write_bytes(b"\n".join(csv.read_bytes().split(b"\n")[:13]))
    for kind, folder, name in (
        ("bench", "benches/", "simulated"),
        ("protocol", "", "quick"),
        ("model", "pads/", "silicone"),
    ):
        Path(f"a_{kind}.yaml").write_bytes((SHIPPED / f"{folder}{name}.yaml").read_bytes())
    Path("full").mkdir()
    Path("full/notes.txt").write_text("mine")
    said = padbench(*words)
    refused(said, rf"^padbench {words[0]}: ", *patterns)
    assert said.out == "" or words[:1] == ("run",)
    assert not Path("runs").exists() and Path("full/notes.txt").read_text() == "mine"


@pytest.mark.parametrize("port", ["/dev/ttyNOTHING", "foo://bar", "socket://127.0.0.1:1"])
def test_a_port_that_is_not_there(padbench, tmp_path, port):
    bench = bench_file(tmp_path, simulation=None, motor={"port": port}, load_cell={"port": "/dev/ttyNOTHING2"})
    said = padbench("run", "quick", "--bench", bench, "--attended", "--out", "out")
    refused(said, rf"bench\.yaml:\d+:9: motor: cannot open port '{port}': ", "check 'port'")
    assert not Path("out").exists(), "nothing is left behind: the command can be given again"


def test_a_bench_that_is_half_real(padbench, tmp_path):
    bench = bench_file(tmp_path, motor={"port": "/dev/ttyUSB0"})
    said = padbench("run", "quick", "--bench", bench, "--attended")
    refused(said, r"bench\.yaml:\d+:9: motor\.port is real, and the other one is simulated", "--simulated")
    assert not Path("runs").exists()


@pytest.mark.skipif(not hasattr(os, "openpty"), reason="there are no pseudo-terminals here")
def test_a_device_that_does_not_answer(padbench, tmp_path):
    """A terminal with nobody at its other end."""

    pairs = [os.openpty() for _ in range(2)]
    try:
        ports = [{"port": os.ttyname(slave)} for _, slave in pairs]
        bench = bench_file(tmp_path, simulation=None, motor=ports[0], load_cell=ports[1])
        said = padbench("run", "quick", "--bench", bench, "--attended", "--out", "out")
        refused(said, r"bench\.yaml:\d+:\d+: load_cell: no answer to '.*' within \d+ ms", "baudrate")
        assert not Path("out").exists()
    finally:
        for end in (end for pair in pairs for end in pair):
            os.close(end)


def test_an_air_run_is_no_data_to_fit(padbench, tmp_path):
    air = {"name": "a", "approach": "none", "steps": [{"to": -0.5, "speed": 20, "hold": 0.1}], "finish": {"air": 0.1}}
    done = run(tmp_path, air)
    said = padbench("fit", done.folder, "--json", "-")
    refused(said, "was recorded in air: there is no pad in it")
    assert said.out == ""


def test_a_run_that_never_met_the_pad_is_no_data_to_fit(padbench, tmp_path):
    done = run(tmp_path, SHORT, simulation={"surface": 5}, limits={"position": [-2, 1]})
    refused(padbench("fit", done.folder), "has no touch-off")
    report = padbench("report", done.folder)
    assert report.status == 0 and "the run ended before the pad's surface was found" in report.out


SIZES = {
    "force": ((1, 1, 1e300), r"scaled\.csv: holds a force of [\d.]+e\+300 N"),
    "position": ((1, 1e200, 1), r"scaled\.csv: holds a position of 2e\+200 mm"),
    "time": ((1e200, 1, 1), r"scaled\.csv: holds a time of 9\.98e\+200 s"),
    "little force": ((1, 1, 1e-200), r"scaled\.csv: holds no force beyond [\d.]+e-200 N"),
}


@pytest.mark.parametrize(("scale", "said"), SIZES.values(), ids=SIZES)
@pytest.mark.parametrize(
    "command", ["fit scaled.csv --law power", "diagnose scaled.csv --model polyurethane",
                "simulate polyurethane --like scaled.csv --out out.csv", "compare scaled.csv scaled.csv"]
)  # fmt: skip
@pytest.mark.filterwarnings("ignore:overflow encountered:RuntimeWarning", "ignore:invalid value:RuntimeWarning")
def test_numbers_that_are_none_of_a_bench(padbench, tmp_path, command, scale, said):
    """What the reading and the search for stray samples warn of on the way is not what this is about."""
    t, x, f = scale
    rows = (
        f"{t * k / 50!r},{x * min(k / 100, 2.0)!r},{f * (min(k, 200) / 100 + 0.01 * (k * k % 7))!r}\n"
        for k in range(500)
    )
    (tmp_path / "scaled.csv").write_text("time_s,position_mm,force_N\n" + "".join(rows))
    refused(padbench(*command.split()), said, "units right")
    assert not (tmp_path / "out.csv").exists()
