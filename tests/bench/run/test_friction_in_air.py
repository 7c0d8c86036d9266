"""Friction at the probe turns round with the motion: that is no touch, and no pad."""

from __future__ import annotations

import pytest
import yaml

from bench.shipped import find_file
from tests.bench.run.benches import Done, run


def with_friction(tmp_path, base: str, coulomb: float, **simulation) -> Done:
    pad = yaml.safe_load(find_file("pad", "polyurethane").read_text("utf-8"))
    file = tmp_path / "pad.yaml"
    file.write_text(yaml.safe_dump(pad | {"effects": [{"id": "friction", "coulomb": coulomb}]}), "utf-8")
    return run(tmp_path, base=base, simulation={"pad": str(file)} | simulation)


@pytest.mark.parametrize(
    "base",
    [
        "simulated",
        "simulated_iai",
        *(pytest.param(b, marks=pytest.mark.long) for b in ("simulated_smc_lec", "simulated_balance")),
    ],
)
@pytest.mark.parametrize("coulomb", [pytest.param(0.08, marks=pytest.mark.long), 0.3])
def test_the_surface_is_found_behind_friction(tmp_path, base, coulomb):
    done = with_friction(tmp_path, base, coulomb)
    assert done.outcome.cause is None
    tare, touch = done.events("tare")[0].data, done.events("touch_off")[0].data
    assert tare["friction_turns_N"] == pytest.approx(2.0 * coulomb, abs=0.03)
    assert touch["surface_mm"] == pytest.approx(done.world.surface_mm, abs=0.04)
    assert abs(touch["surface_mm"] - done.world.surface_mm) < 4.0 * touch["surface_std_mm"]
    # not told by half as it turns round
    assert touch["surface_std_mm"] < 0.03


def test_a_touch_is_told_beside_friction(tmp_path):
    """The pad begins 0.2 mm above where the probe stands."""
    done = with_friction(tmp_path, "simulated", 0.1, surface=-0.2)
    assert "already touches" in (done.outcome.cause or "")
