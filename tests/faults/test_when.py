"""When faults strike, and that they disturb nothing else."""

from __future__ import annotations

import pytest

from bench.config import Simulation
from bench.errors import InputError
from sim.faults import KINDS, FaultError, fault_schema, read_faults
from sim.world import World
from tests.faults.faulty import bench_with, press
from tests.sim.world_tools import SPRING, Client, bench

BLOCK = 512


def struck(world: World) -> list[float]:
    return [strike.time_s for strike in world.site.struck]


def traffic(**settings: object) -> list[tuple[float, bytes]]:
    """What comes from both devices in half a second of bench time, and when."""
    with bench("traffic", model=SPRING, noise_force_N=0.01, noise_position_mm=5e-4, **settings) as world:
        motor, cell = Client(world, "motor"), Client(world, "load_cell")
        cell.port.write(b"SW\r")
        seen = []
        for k in range(40):
            frame = motor.modbus("01 03 01 56 00 02") if k % 2 else ""
            seen.append((world.clock.now(), frame.encode() + cell.port.read(4096)))
            cell.sleep(0.01)
        return seen


def test_a_fault_that_never_strikes_changes_no_byte():
    late = [{"kind": "bytes_corrupted", "device": "load_cell", "at_s": 1e6}]
    assert traffic(faults=late) == traffic()


def test_a_fault_of_one_device_leaves_the_noise_of_the_other():
    def motor_alone(faults: list[dict[str, object]]) -> list[bytes]:
        with bench("alone", noise_position_mm=5e-4, faults=faults) as world:
            motor = Client(world, "motor")
            return [motor.modbus("01 03 01 56 00 02").encode() for _ in range(50)]

    assert motor_alone([{"kind": "line_noise", "device": "load_cell", "rate_per_s": 50.0}]) == motor_alone([])


def test_the_same_seed_has_the_same_faults_and_another_has_others():
    noise = [{"kind": "bytes_corrupted", "device": "load_cell", "rate_per_s": 20.0}]
    assert traffic(faults=noise, seed=5) == traffic(faults=noise, seed=5)
    times = []
    for seed in (5, 6):
        with bench("t", faults=noise, seed=seed) as world:
            world.clock.wait((), 10.0)
            times.append(struck(world))
    assert times[0] != times[1]


def test_a_second_fault_does_not_move_the_first():
    one = {"kind": "late", "device": "motor", "rate_per_s": 2.0}
    two = {"kind": "force_spike", "rate_per_s": 7.0}
    with bench("a", faults=[one]) as world:
        world.clock.wait((), 20.0)
        alone = struck(world)
    with bench("b", faults=[one, two]) as world:
        world.clock.wait((), 20.0)
        assert [s.time_s for s in world.site.struck if s.kind == "late"] == alone


def test_the_rate_is_as_often_as_asked():
    with bench("rate", faults=[{"kind": "force_spike", "rate_per_s": 4.0}]) as world:
        world.clock.wait((), 500.0)
        count = len(struck(world))
    assert abs(count - 2000) < 5 * 2000**0.5, "a Poisson count"


def test_a_time_and_a_duration():
    with bench("at", model=SPRING, faults=[{"kind": "jam", "at_s": 0.25, "duration_s": 0.5}]) as world:
        for at_s, jammed in ((0.2, False), (0.3, True), (0.7, True), (0.8, False)):
            world.clock.wait((), at_s)
            assert world.plant.braked is jammed
        assert struck(world) == [0.25]


@pytest.mark.parametrize("step", ["steps[1]", 1])
def test_a_step_by_name_or_number(tmp_path, step):
    seen = press(tmp_path, bench_with([{"kind": "force_spike", "step": step, "after_s": 0.05, "by_N": 0.0}]))
    begins = next(mark.time_s for mark in seen.recording().steps if mark.name == "steps[1]")
    assert struck(seen.world) == [pytest.approx(begins + 0.05, abs=1e-6)]


@pytest.mark.parametrize(
    ("fault", "says"),
    [
        ({"device": "motor", "at_s": 1}, r"faults\[0\]\.kind: is missing; there are: bytes_lost"),
        ({"kind": "jamm", "at_s": 1}, r"faults\[0\]\.kind: there is no fault `jamm`; did you mean `jam`\?"),
        ({"kind": 3, "at_s": 1}, r"faults\[0\]\.kind: there is no fault `3`"),
        ({"kind": "silent", "at_s": 1}, r"faults\[0\]\.device: is missing; it is a fault of: motor, load_cell"),
        ({"kind": "jam", "device": "host", "at_s": 1}, r"device: `host` cannot have the fault `jam`"),
        ({"kind": "jam"}, r"faults\[0\]: nothing says when it strikes; give one of at_s, step, rate_per_s"),
        ({"kind": "jam", "at_s": 1, "step": 2}, r"faults\[0\]\.step: at_s and step are given"),
        ({"kind": "jam", "at_s": 1, "after_s": 2}, r"after_s: counts from the beginning of a step"),
        ({"kind": "jam", "at_s": -1}, r"at_s: -1 is less than 0"),
        ({"kind": "jam", "at_s": "soon"}, r"at_s: `soon` is not a number"),
        ({"kind": "jam", "rate_per_s": 0}, r"rate_per_s: 0 is not greater than 0"),
        ({"kind": "jam", "at_s": 1, "duration_s": 0}, r"duration_s: 0 is not greater"),
        ({"kind": "killed", "at_s": 1, "duration_s": 1}, r"duration_s: `killed` happens at once"),
        ({"kind": "jam", "step": 1.5}, r"step: `1.5` is no step"),
        ({"kind": "late", "device": "motor", "at_s": 1, "by": 2}, r"faults\[0\]\.by: `late` has no such param.*`by_s`"),
        ({"kind": "late", "device": "motor", "at_s": 1, "by_s": True}, r"by_s: `True` is not a number"),
        ({"kind": "late", "device": "motor", "at_s": 1, "by_s": 61}, r"by_s: 61 is outside 0 to 60 s"),
        ({"kind": "late", "device": "motor", "at_s": 1, "direction": "up"}, r"direction: there is no `up`"),
    ],
)
def test_what_cannot_be_is_said(fault, says):
    with pytest.raises(FaultError, match=says):
        read_faults([fault])


def test_a_wrong_fault_is_named_with_file_line_and_cure(tmp_path):
    import yaml

    from bench.config import load_bench
    from bench.shipped import find_file

    content = yaml.safe_load(find_file("bench", "simulated").read_text("utf-8"))
    content["simulation"]["faults"] = [{"kind": "jam", "at_s": 1}, {"kind": "silent", "at_s": 1, "device": "cell"}]
    path = tmp_path / "bench.yaml"
    path.write_text(yaml.safe_dump(content, sort_keys=False), "utf-8")
    line = path.read_text("utf-8").splitlines().index("    device: cell") + 1
    with pytest.raises(InputError) as caught:
        load_bench(path)
    assert str(caught.value).startswith(f"{path}:{line}:")
    assert "simulation.faults[1].device: `cell` cannot have the fault `silent`" in str(caught.value)
    assert "it is a fault of: motor, load_cell" in str(caught.value)


def test_a_fault_that_the_device_cannot_have(tmp_path):
    faulty = bench_with([{"kind": "foreign_requests", "device": "load_cell", "at_s": 1}], "simulated_modbus")
    with pytest.raises(InputError, match=r"faults\[0\]: on a network nobody hears"):
        press(tmp_path, faulty)


def test_the_schema_has_a_form_for_every_kind():
    forms = {form["properties"]["kind"]["const"]: form for form in fault_schema()["oneOf"]}
    assert set(forms) == set(KINDS)
    for name, kind in KINDS.items():
        assert {parameter.name for parameter in kind.parameters} <= set(forms[name]["properties"])
    assert Simulation.model_json_schema()["properties"]["faults"]["items"] == fault_schema()
