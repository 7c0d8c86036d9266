"""A pad that pulls the probe in before it touches: the run finds its surface all the same."""

from __future__ import annotations

import pytest
import yaml

from bench.shipped import find_file
from tests.bench.run.benches import run


@pytest.mark.parametrize("base", ["simulated", "simulated_iai", "simulated_balance"])
@pytest.mark.parametrize("form", ["exponential", pytest.param("van_der_waals", marks=pytest.mark.long)])
def test_the_surface_of_a_sticky_pad_is_found(tmp_path, base, form):
    pad = yaml.safe_load(find_file("pad", "polyurethane").read_text("utf-8"))
    sticky = {"id": "adhesion", "form": form, "pull_off": 0.15, "range": 0.1}
    file = tmp_path / "pad.yaml"
    file.write_text(yaml.safe_dump(pad | {"effects": [sticky]}), "utf-8")
    done = run(tmp_path, base=base, simulation={"pad": str(file)})
    assert done.outcome.cause is None
    touch = done.events("touch_off")[0].data
    assert touch["surface_mm"] == pytest.approx(done.world.surface_mm, abs=0.02)
    assert abs(touch["surface_mm"] - done.world.surface_mm) < 4.0 * touch["surface_std_mm"]
