"""Measured data, where they are there: no fit may fail, and the page of docs can be made."""

from __future__ import annotations

import math
import os
from pathlib import Path

import pytest

from bench.identify import fit
from bench.identify.remainder import sentence
from docs import real_data
from docs.data_sets import SETS

ROOT = Path(__file__).parents[3]
DATA = Path(os.environ.get("PADBENCH_DATA", ROOT.parent / "shared" / "data"))

pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason="the measured data are not here")

FILES = [
    "meat_indentation_zwick/230403_230403-RDG1C.csv",
    "vhb4910/relax_stretch3d0.csv",
    "oca_adhesive_shear/shear_relaxation_1.csv",
    "muscle_ramp_hold/AvgRelaxed_10s.csv",
    "afm_relaxation_jpk/multi1.csv",
    "silicone_stretcher/cb7p5_ramps_v16.csv",
    "emps_linear_axis/emps_train.csv",
    "pneumatic_cylinder_friction/Circle_1bar.csv",
]


@pytest.mark.parametrize("name", FILES)
def test_a_fit_comes_out(name: str) -> None:
    path = DATA / name
    data = next(s for s in SETS if s.folder == path.parent.name)
    result = fit(data.read(path), law="power", order=2)
    numbers = [result.V, result.noise_floor, result.fit_percent, result.held_out_rmse]
    assert all(math.isfinite(v) for v in numbers) and result.noise_floor > 0
    assert sentence(result)
    if data.folder in ("meat_indentation_zwick", "vhb4910", "oca_adhesive_shear", "muscle_ramp_hold"):
        assert result.fit_percent > 80 and result.physical
    if data.folder in ("emps_linear_axis", "pneumatic_cylinder_friction"):
        assert "does not describe" in sentence(result)


@pytest.mark.long
def test_the_page_is_made(tmp_path: Path) -> None:
    (data,) = (s for s in SETS if s.folder == "muscle_ramp_hold")
    real_data.write(DATA, tmp_path, [data])
    page = (tmp_path / "real_data.md").read_text(encoding="utf-8")
    assert page.count("| `Avg") == 5 and "cascaded_tanks" in page
    (picture,) = (tmp_path / "img").iterdir()
    assert f"(img/{picture.name})" in page
    assert 5_000 < picture.stat().st_size < 300_000


def test_every_force_displacement_file_is_on_the_page() -> None:
    page = (ROOT / "docs" / "real_data.md").read_text(encoding="utf-8")
    for folder in sorted(p for p in DATA.iterdir() if p.is_dir()):
        if folder.name in real_data.LEFT_OUT:
            assert f"`{folder.name}`" in page
            continue
        for path in sorted(folder.glob("*.csv")):
            assert f"`{path.name}`" in page, path
