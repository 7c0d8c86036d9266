"""Bench files: the contract's example, contradictions, dry runs, and what is shipped."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench.config import load_bench, load_model, simulated
from bench.errors import InputError
from bench.schemas import schema
from bench.shipped import find_file, find_shipped, shipped_names
from tests.bench.run.benches import bench_file as changed_bench

REAL = """\
name: lab 2
motor: {driver: orca, port: /dev/ttyUSB0, baudrate: 115200, stroke: [-20, 20], safe_state: hold}
load_cell: {driver: dad141, port: /dev/ttyUSB1, baudrate: 115200, unit: N, scale: 1.0, sign: 1, capacity: 50}
limits: {force: 20, tension: 5, position: [-5, 6], speed: 200, acceleration: 5000}
timing: {force_delay: 0.002, measured_on: 2026-11-01}
"""


def bench_file(folder: Path, text: str) -> Path:
    path = folder / "b.yaml"
    path.write_text(text)
    return path


def spot(text: str, at: str) -> str:
    """`line:column` of a piece of the text."""
    before = text[: text.index(at)]
    return f"{before.count(chr(10)) + 1}:{len(before) - before.rfind(chr(10))}"


def refused(folder: Path, text: str) -> InputError:
    with pytest.raises(InputError) as caught:
        load_bench(bench_file(folder, text))
    return caught.value


def test_a_real_bench_and_its_dry_run(tmp_path: Path) -> None:
    bench = load_bench(bench_file(tmp_path, REAL))
    assert bench.simulation is None
    assert bench.sim_name is None
    assert bench.text == REAL
    assert str(bench.timing.measured_on) == "2026-11-01"
    dry = simulated(bench)
    assert dry.motor.port == "sim://lab-2/motor"
    assert dry.load_cell.port == "sim://lab-2/load_cell"
    assert dry.all_simulated
    assert dry.sim_name == "lab-2"
    assert (dry.motor.driver, dry.motor.baudrate, dry.limits) == (bench.motor.driver, 115200, bench.limits)
    assert dry.simulation is not None
    assert dry.pad_file == find_shipped("pad", "polyurethane")
    assert not bench.all_simulated


def test_a_simulated_bench_keeps_its_truth_in_a_dry_run() -> None:
    bench = load_bench("simulated")
    dry = simulated(bench)
    assert dry.simulation == bench.simulation
    assert dry.motor.port == bench.motor.port == "sim://bench/motor"
    assert dry.pad_file == bench.pad_file
    assert dry.text == bench.text


def test_the_pad_is_relative_to_the_bench_file(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text("pad: {elastic: {law: power, p: 2, q: 1}}\n")
    bench = load_bench(bench_file(tmp_path, REAL + "simulation: {pad: mine.yaml}\n"))
    assert bench.pad_file == tmp_path / "mine.yaml"
    error = refused(tmp_path, REAL + "simulation: {pad: yours.yaml}\n")
    assert error.place == f"{tmp_path / 'b.yaml'}:6:19"
    assert "there is no file `yours.yaml`" in error.message


def test_a_register_map_is_read_beside_the_bench_file(tmp_path: Path) -> None:
    text = REAL.replace("driver: dad141,", "driver: registers, map: amp.yaml,")
    assert "there is no file `amp.yaml`" in refused(tmp_path, text).message
    head = "name: amp\ndevice: load_cell\nblocks: {all: {address: 0x10, count: 2}}\n"
    (tmp_path / "amp.yaml").write_text(head + "values: {gross: {address: 0x10, type: f32}}\n")
    assert load_bench(bench_file(tmp_path, text)).load_cell.map == {
        "name": "amp",
        "device": "load_cell",
        "blocks": {"all": {"address": 16, "count": 2}},
        "values": {"gross": {"address": 16, "type": "f32"}},
    }
    wrong = "name: amp\ndevice: load_cell\nblocks: {all: {address: 0x10, cuont: 2}}\nvalues: {}\n"
    (tmp_path / "amp.yaml").write_text(wrong)
    error = refused(tmp_path, text)
    assert error.place == f"{tmp_path / 'amp.yaml'}:{spot(wrong, 'cuont')}"
    assert "did you mean `count`" in error.cure


@pytest.mark.parametrize(
    ("old", "new", "at", "words"),
    [
        (
            "position: [-5, 6]",
            "position: [-25, 6]",
            "[-25, 6]",
            "limits.position: [-25, 6] reaches beyond motor.stroke [-20, 20]",
        ),
        ("position: [-5, 6]", "position: [6, -5]", "[6, -5]", "limits.position: the first (6) must be less"),
        ("force: 20", "force: 60", "60", "limits.force: 60 N is beyond load_cell.capacity 50 N"),
        ("tension: 5", "tension: 70", "70", "limits.tension: 70 N is beyond load_cell.capacity 50 N"),
        ("stroke: [", "max_speed: 100, stroke: [", "200, acc", "limits.speed: 200 is more than motor.max_speed 100"),
        ("driver: orca", "driver: orka", "orka", "did you mean 'orca'"),
        ("safe_state: hold", "safe_state: fall", "fall", "must be `release`, `hold` or `retract`"),
        (
            "port: /dev/ttyUSB0",
            "port: sim://a/motor",
            "sim://",
            "motor.port: is simulated, but there is no `simulation`",
        ),
        ("capacity: 50", "capacity: -50", "-50", "load_cell.capacity: must be > 0, not -50"),
        ("speed: 200", "sped: 200", "sped", "limits.sped: unknown key"),
        ("force_delay: 0.002", "force_delay: 2", "2, mea", "timing.force_delay: must be < 1, not 2"),
        ("2026-11-01", "yesterday", "yesterday", "must be a date like 2026-11-01, not the word `yesterday`"),
        ("2026-11-01", "2026-13-01", "2026-13-01", "must be a date like 2026-11-01"),
        ("timing:", "simulation: {surface: above}\ntiming:", "above", "simulation.surface: must be `random`"),
        ("timing:", "simulation: {clock: wal}\ntiming:", "wal}", "simulation.clock: must be `virtual` or `wall`"),
    ],
)
def test_contradictions_and_mistakes(tmp_path: Path, old: str, new: str, at: str, words: str) -> None:
    assert old in REAL
    text = REAL.replace(old, new)
    error = refused(tmp_path, text)
    assert error.place == f"{tmp_path / 'b.yaml'}:{spot(text, at)}"
    assert words in error.message


@pytest.mark.parametrize("name", shipped_names("bench"))
def test_shipped_benches(name: str) -> None:
    bench = load_bench(name)
    assert bench.name == name
    assert bench.all_simulated
    assert bench.pad_file is not None
    assert bench.pad_file.stem == "polyurethane"


def test_no_shipped_file_names_the_host() -> None:
    for kind in ("protocol", "bench", "pad"):
        for name in shipped_names(kind):
            path = find_shipped(kind, name)
            assert path is not None
            text = path.read_text()
            assert "/home" not in text and "/work" not in text and "file:" not in text


def test_shipped_pads() -> None:
    gel, silicone = load_model("polyurethane"), load_model("silicone")
    # the paper's Table II, order 2
    assert gel.pad.parameters["m"] == pytest.approx(2.2445, rel=0.005)
    assert gel.pad.parameters["b"] == pytest.approx(0.6911, rel=0.005)
    assert len(gel.pad.relaxation.rates) == 2
    assert len(silicone.pad.relaxation.rates) == 1
    assert sum(silicone.pad.relaxation.shares) < 0.1 < sum(gel.pad.relaxation.shares)


def test_a_model_file_s_mistakes_have_their_place(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    path.write_text("pad:\n  elastic: {law: exponential, m: 2, c: 1}\n")
    with pytest.raises(InputError) as caught:
        load_model(path)
    assert caught.value.place.startswith(f"{path}:2:")
    path.write_text("pad:\n  elastic: {law: exponential, m: 2, b: 1}\neffects:\n  - {id: frictoin, coulomb: 1}\n")
    with pytest.raises(InputError, match="did you mean 'friction'") as caught:
        load_model(path)
    assert caught.value.place == f"{path}:4:5"


@pytest.mark.parametrize("kind", ["protocol", "bench", "model"])
def test_schemas_are_draft_07(kind: str) -> None:
    content = schema(kind)  # type: ignore[arg-type]
    assert content["$schema"] == "http://json-schema.org/draft-07/schema#"
    assert content["additionalProperties"] is False
    text = str(content)
    assert "prefixItems" not in text and "inf" not in text.replace("infinite", "")
    required = {"protocol": ["name", "steps"], "bench": ["name", "motor", "load_cell", "limits"], "model": ["pad"]}
    assert content["required"] == required[kind]


# -- ports that belong together ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("motor", "load_cell", "line", "words"),
    [
        ("/dev/null", "sim://bench/load_cell", "motor", "is real, and the other one is simulated"),
        ("sim://bench/motor", "/dev/null", "load_cell", "is real, and the other one is simulated"),
        ("sim://", "sim://bench/load_cell", "motor", "names no simulated bench"),
        ("sim://bench/motor", "sim://", "load_cell", "names no simulated bench"),
        ("sim://a/motor", "sim://b/load_cell", "load_cell", "another simulated bench"),
        ("sim://bench/motor", "sim://bench/loadcell", "load_cell", "no simulated device at sim://bench/loadcell"),
    ],
)
def test_ports_that_do_not_belong_together(padbench, tmp_path, motor, load_cell, line, words):
    """`check` and every command say so; as a dry run the bench works, whatever its ports."""
    path = changed_bench(tmp_path, motor={"port": motor}, load_cell={"port": load_cell})
    at = 1 + path.read_text().splitlines().index(f"  port: {motor if line == 'motor' else load_cell}")
    for command in (["check", "quick", "--bench", path], ["status", path]):
        said = padbench(*command)
        assert said.status == 2 and words in said.err and f"bench.yaml:{at}:" in said.err
    said = padbench("status", path, "--simulated")
    assert said.status == 0, said


def test_the_model_of_a_run_is_its_folder_s(tmp_path: Path) -> None:
    (tmp_path / "model.yaml").write_text(find_file("pad", "silicone").read_text("utf-8"), "utf-8")
    assert load_model(tmp_path) == load_model("silicone")
    (tmp_path / "model.yaml").unlink()
    with pytest.raises(InputError, match="is a directory, not a file"):
        load_model(tmp_path)
