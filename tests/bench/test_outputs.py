"""What a command writes is none of what it reads, no recording, and nothing that its name does not say."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
import yaml

from bench.shipped import find_file
from tests.bench.run.benches import bench_file
from tests.bench.said import AIR, FIT

MAGIC = b"\x89MCAP0\r\n"


@pytest.fixture
def lab(padbench, csv, tmp_path):
    """A folder with one file of each kind."""
    shutil.copy(csv, "good.csv")
    shutil.copy(find_file("pad", "polyurethane"), "m.yaml")
    Path("p.yaml").write_text(yaml.safe_dump(AIR), "utf-8")
    bench_file(tmp_path, name="b.yaml")
    Path("run3").mkdir()
    Path("run3/recording.mcap").write_bytes(MAGIC)
    Path("link.csv").symlink_to("good.csv")
    return padbench


def contents() -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in Path().rglob("*") if path.is_file()}


@pytest.mark.parametrize(
    "words",
    [
        "simulate m.yaml --like good.csv --out good.csv",
        "simulate m.yaml --like good.csv --out link.csv",
        "simulate m.yaml --like good.csv --out run3/../good.csv",
        "simulate m.yaml --like good.csv --out run3/recording.mcap",
        "simulate m.yaml --like good.csv --out -",
        "simulate m.yaml --like good.csv --out new.mcap",
        "fit good.csv --json good.csv",
        "fit good.csv --write good.csv",
        "fit good.csv --report good.csv",
        "fit good.csv --json run3/recording.mcap",
        "fit good.csv --write -",
        "fit good.csv --write new.json",
        "fit good.csv --json new --write new",
        "compare good.csv link.csv --out good.csv",
        "diagnose good.csv --model m.yaml --write m.yaml",
        "diagnose good.csv --model m.yaml --next m.yaml",
        "diagnose good.csv --model m.yaml --json run3/recording.mcap",
        "recover good.csv run3/recording.mcap",
        "convert good.csv run3/recording.mcap",
        "export m.yaml --to c --out m.yaml",
        "check p.yaml --plot p.yaml",
        "check p.yaml --bench b.yaml --plot b.yaml",
        "status b.yaml --json b.yaml",
        "doctor b.yaml --json b.yaml --yes",
    ],
)
def test_what_is_read_and_what_was_measured_are_not_overwritten(lab, words):
    before = contents()
    said = lab(*words.split(), *(FIT if words.startswith(("fit", "compare")) else ()))
    assert said.status == 2 and said.err.count("\n") <= 2, said
    assert contents() == before


@pytest.mark.parametrize(
    "words",
    [
        "doctor simulated --yes --write simulated",
        "fit good.csv --write polyurethane",
        "diagnose good.csv --model m.yaml --next quick",
        "check quick --plot run3/simulated",
    ],
)
def test_nothing_is_written_under_the_name_of_something_shipped(lab, words):
    before = contents()
    said = lab(*words.split())
    assert said.status == 2 and "is the name of a shipped" in said.err
    assert contents() == before


def test_the_default_bench_is_the_shipped_one_whatever_stands_there(lab):
    shipped = lab("check", "quick", "--bench", find_file("bench", "simulated"))
    Path("simulated").write_text("name: mine\n")
    assert lab("check", "quick") == shipped and shipped.status == 0
    assert lab("check", "quick", "--bench", "simulated").status == 2


def test_a_product_may_be_written_anew(lab):
    """A second time to the same place, beside a folder's recording, and where nothing stood."""
    for _ in range(2):
        said = lab("simulate", "m.yaml", "--like", "good.csv", "--out", "run3/simulated.csv")
        assert said.status == 0, said
    assert lab("export", "m.yaml", "--to", "json", "--out", "-").out.startswith("{")


def test_a_name_that_is_no_file_is_no_input(lab):
    """`quick` is a shipped protocol: a page of that name is nobody's input."""
    assert lab("check", "quick", "--plot", "quick.html").status == 0
