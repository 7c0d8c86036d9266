"""`padbench status`: what it sees, and that it touches nothing."""

from __future__ import annotations

import json
import re
from typing import Any

import pytest

from sim.world import World
from tests.bench.daily.benches import in_the_world, mute
from tests.bench.run.benches import bench_file


@pytest.mark.parametrize("name", ["simulated", "simulated_iai", "simulated_modbus"])
def test_it_says_who_is_there_and_touches_nothing(padbench, monkeypatch, name):
    worlds = in_the_world(monkeypatch)
    said = padbench("status", name)
    assert said.status == 0, said
    assert re.search("motor +(ORCA|IAI)", said.out) and re.search("load cell +Flintec DAD 141.1", said.out)
    assert "nothing was moved" in said.out and not said.err
    plant = worlds[0].plant
    assert not plant.servo_on and abs(plant.position_mm) < 1e-9


def test_figures_alone_on_standard_output(padbench):
    said = padbench("status", "simulated", "--json", "-")
    figures = json.loads(said.out)
    assert said.status == 0 and figures["problems"] == []
    # What the simulation block of the shipped bench says: 10 mN of noise; and 549 lines of 21 characters a second.
    assert figures["load_cell"]["noise_N"] == pytest.approx(0.01, rel=0.15)
    assert figures["load_cell"]["rate_Hz"] == pytest.approx(115200 / 210, rel=0.01)
    assert figures["motor"]["position_mm"] == pytest.approx(0.0, abs=0.003)


@pytest.mark.parametrize(("key", "other"), [("load_cell", "ORCA"), ("motor", "Flintec")])
def test_a_device_that_is_silent_hides_nothing_of_the_other(padbench, monkeypatch, key, other):
    in_the_world(monkeypatch, mute(key))
    said = padbench("status", "simulated")
    assert said.status == 1 and re.search(f"problem +{key}: ", said.out) and other in said.out
    assert "Traceback" not in said.out + said.err


def test_an_axis_outside_of_its_limits_is_told(padbench, tmp_path):
    path = bench_file(tmp_path, limits={"position": [1, 6]})
    said = padbench("status", path)
    assert said.status == 1 and "outside limits.position [1, 6]" in said.out


def test_an_overload_is_told_and_looked_at(padbench, tmp_path, monkeypatch):
    from bench.daily.loads import put_on

    in_the_world(monkeypatch, lambda world: put_on(world, 60.0))
    said = padbench("status", "simulated")
    assert said.status == 1 and "overload" in said.out


def energised(world: World) -> None:
    """As the controller's own software would: an Orca's mode register (kinematic); by coils PMSL and SON of an IAI,
    serial drive and SVON of an SMC LEC.
    """
    motor: Any = world.devices["motor"]
    if world.settings.motor["driver"] == "orca":
        motor.write_registers(3, [5], 0.0)
        return
    for coil in (0x0427, 0x0403) if world.settings.motor["driver"] == "iai" else (0x30, 0x19):
        motor.write_bit(coil, True, 0.0)
    world.clock.wait([], 1.0)


@pytest.mark.parametrize("name", ["simulated", "simulated_iai", "simulated_smc_lec"])
@pytest.mark.parametrize("on", [False, True])
def test_whether_the_motor_is_energised(padbench, monkeypatch, name, on):
    worlds = in_the_world(monkeypatch, energised if on else lambda world: None)
    said = padbench("status", name, "--json", "-")
    assert json.loads(said.out)["motor"]["energised"] is on, said
    assert worlds[0].plant.servo_on is on, "and it was left so"
    said = padbench("status", name)
    assert ("ENERGISED" if on else "not energised") in said.out
