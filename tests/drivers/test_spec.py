"""What the bench file may say about its devices, and what the factory makes of it."""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import ValidationError

import drivers
from drivers.dad141 import Dad141
from drivers.errors import DriverError, PortError
from drivers.maps import shipped_map
from drivers.orca import Orca
from drivers.registers import RegisterMotor
from drivers.registers_cell import RegisterLoadCell
from drivers.spec import LoadCellSpec, MotorSpec
from tests.drivers.scripted import ManualClock

MOTOR: dict[str, Any] = {"driver": "orca", "port": "loop://", "stroke": (-20, 20)}
CELL: dict[str, Any] = {"driver": "dad141", "port": "loop://", "capacity": 50}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"driver": "orka"}, "no driver is called 'orka' .* did you mean 'orca'"),
        ({"driver": "dad141"}, "no driver is called 'dad141'"),
        ({"stroke": (5, 5)}, "lower end of the stroke"),
        ({"stroke": (float("nan"), 5)}, "finite"),
        ({"direction": 0}, "1 or -1"),
        ({"address": 0}, "greater than or equal to 1"),
        ({"baudrate": -1}, "greater than 0"),
        ({"moving_mass": 0}, "greater than 0"),
        ({"safe_state": "panic"}, "'release', 'hold' or 'retract'"),
        ({"driver": "registers"}, "needs 'map'"),
        ({"map": "some.yaml"}, "takes no 'map'"),
        ({"driver": "iai", "map": "some.yaml"}, "shipped map already"),
        ({"colour": "red"}, "Extra inputs"),
        ({"port": ""}, "at least 1 character"),
    ],
)
def test_motor_mistakes_are_told_in_plain_words(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        MotorSpec.model_validate(MOTOR | change)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"driver": "dad142"}, "did you mean 'dad141'"),
        ({"capacity": -1}, "greater than 0"),
        ({"scale": 0}, "greater than 0"),
        ({"unit": "lb"}, "'N', 'mN', 'kN', 'g' or 'kg'"),
        ({"decimals": 6}, "less than or equal to 5"),
        ({"rate": float("inf")}, "finite"),
    ],
)
def test_load_cell_mistakes_are_told_in_plain_words(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        LoadCellSpec.model_validate(CELL | change)


def test_checksum_off_survives_a_reader_that_makes_a_boolean_of_it() -> None:
    assert LoadCellSpec.model_validate(CELL | {"checksum": False}).checksum == "off"


@pytest.mark.parametrize(
    ("unit", "scale", "sign", "newtons"),
    [("N", 1.0, 1, 1.0), ("kg", 1.0, 1, 9.80665), ("g", 2.0, -1, -2 * 9.80665e-3), ("mN", 1.0, 1, 1e-3)],
)
def test_newtons_of_the_devices_number(unit: str, scale: float, sign: int, newtons: float) -> None:
    spec = LoadCellSpec.model_validate(CELL | {"unit": unit, "scale": scale, "sign": sign})
    assert spec.newtons_per_unit == pytest.approx(newtons)


@pytest.mark.parametrize(
    ("change", "kind", "byte_s", "gap_s"),
    [
        ({}, Orca, 11 / 19200, 0.002),
        ({"baudrate": 1_000_000}, Orca, 11 / 1_000_000, 80e-6),
        ({"baudrate": 1_000_000, "gap_us": 0, "parity": "N"}, Orca, 10 / 1_000_000, 0.0),
        ({"driver": "iai"}, RegisterMotor, 10 / 38400, 0.00175),
        ({"driver": "iai", "baudrate": 9600}, RegisterMotor, 10 / 9600, 3.5 * 10 / 9600),
        ({"driver": "iai", "map": {"link": {"stopbits": 2, "baudrate": 57600}}}, RegisterMotor, 11 / 57600, 0.00175),
    ],
)
def test_motors_are_opened_with_their_lines_settings(
    change: dict[str, Any], kind: type, byte_s: float, gap_s: float
) -> None:
    motor = drivers.open_motor(MotorSpec.model_validate(MOTOR | change), ManualClock())
    assert isinstance(motor, kind)
    assert motor.link.byte_s == pytest.approx(byte_s)
    assert motor.link.gap_s == pytest.approx(gap_s)
    motor.link.close()


@pytest.mark.parametrize(
    ("change", "kind", "byte_s"),
    [
        ({}, Dad141, 10 / 115200),
        ({"baudrate": 9600}, Dad141, 10 / 9600),
        ({"driver": "dad141_modbus"}, RegisterLoadCell, 0.0),
        ({"driver": "dad141_modbus", "map": {"link": {"transport": "rtu"}}}, RegisterLoadCell, 10 / 115200),
        (
            {"driver": "dad141_modbus", "baudrate": 9600, "map": {"link": {"transport": "rtu"}}},
            RegisterLoadCell,
            10 / 9600,
        ),
    ],
)
def test_load_cells_are_opened_with_their_lines_settings(change: dict[str, Any], kind: type, byte_s: float) -> None:
    cell = drivers.open_load_cell(LoadCellSpec.model_validate(CELL | change), ManualClock())
    assert isinstance(cell, kind)
    assert cell.link.byte_s == pytest.approx(byte_s)
    cell.link.close()


def test_a_map_may_come_as_a_file_or_as_its_content(tmp_path: Any) -> None:
    import yaml

    content = shipped_map("iai")
    file = tmp_path / "axis.yaml"
    file.write_text(yaml.safe_dump(content))
    for source in (str(file), content):
        spec = MotorSpec.model_validate(MOTOR | {"driver": "registers", "map": source})
        motor = drivers.open_motor(spec, ManualClock())
        assert isinstance(motor, RegisterMotor)
        assert motor.map.name == "iai"
        motor.link.close()


@pytest.mark.parametrize("source", ["no/such/map.yaml", {"name": "half a map", "device": "motor"}])
def test_a_map_that_cannot_be_used_is_a_driver_error(source: Any) -> None:
    spec = MotorSpec.model_validate(MOTOR | {"driver": "registers", "map": source})
    with pytest.raises(DriverError, match="register map of 'registers' cannot be used"):
        drivers.open_motor(spec, ManualClock())


def test_gains_that_do_not_fit_close_the_port_again() -> None:
    spec = MotorSpec.model_validate(MOTOR | {"gains": {"p": 1}})
    with pytest.raises(DriverError, match="gains of an Orca"):
        drivers.open_motor(spec, ManualClock())


def test_a_missing_port_names_the_device() -> None:
    with pytest.raises(PortError, match="load_cell: cannot open port"):
        drivers.open_load_cell(LoadCellSpec.model_validate(CELL | {"port": "/dev/nothing"}), ManualClock())
