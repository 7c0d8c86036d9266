"""The vendor's own SDK (pyorcasdk) against the emulated Orca: read, modes, stream, kinematic motion, limits."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.clients.emulated import DAD, ORCA, needs, run_client

pytestmark = pytest.mark.usefixtures("_sdk")


@pytest.fixture
def _sdk() -> None:
    needs("pyorcasdk")


OPEN = """
import json, sys, time
import pyorcasdk as orca
motor = orca.Actuator("pad")
def good(error):
    if error:
        sys.exit(error.what())
def value(result):
    good(result.error)
    return result.value
good(motor.open_serial_port(sys.argv[1], 1000000, 80))
"""


def test_it_reads_what_the_motor_says(tmp_path: Path) -> None:
    script = """
print(json.dumps({
    "position": value(motor.get_position_um()), "force": value(motor.get_force_mN()),
    "errors": value(motor.get_errors()), "mode": int(value(motor.get_mode())),
    "baud": value(motor.read_wide_register_blocking(482)), "delay": value(motor.read_register_blocking(484)),
    "several": value(motor.read_multiple_registers_blocking(342, 8)), "voltage": value(motor.get_voltage_mV()),
}))
"""
    said = run_client(tmp_path, (ORCA, DAD), "motor", OPEN + script)
    assert said == {
        "position": 0,
        "force": 0,
        "errors": 0,
        "mode": 1,
        "baud": 1_000_000,
        "delay": 80,
        "several": [0] * 8,
        "voltage": 24000,
    }


def test_it_changes_modes_and_the_motor_confirms(tmp_path: Path) -> None:
    """`set_mode` writes register 3 and reads 317 back within 25 ms."""
    script = """
modes = []
for mode in (orca.MotorMode.PositionMode, orca.MotorMode.ForceMode, orca.MotorMode.HapticMode,
             orca.MotorMode.SleepMode):
    good(motor.set_mode(mode))
    modes.append(int(value(motor.get_mode())))
print(json.dumps(modes))
"""
    assert run_client(tmp_path, (ORCA, DAD), "motor", OPEN + script) == [3, 2, 4, 1]


def test_it_streams_positions_and_gets_them_back(tmp_path: Path) -> None:
    """A ramp of 2 mm in half a second by the SDK's own loop, then standing there."""
    script = """
good(motor.set_mode(orca.MotorMode.PositionMode))
motor.enable_stream()
begin = time.monotonic()
while (now := time.monotonic() - begin) < 1.0:
    motor.set_streamed_position_um(int(2000 * min(1.0, 2.0 * now)))
    motor.run()
data = motor.get_stream_data()
messages = value(motor.read_register_blocking(464))
print(json.dumps({"position": data.position, "errors": data.errors, "voltage": data.voltage,
                  "temperature": data.temperature, "messages": messages}))
"""
    said = run_client(tmp_path, (ORCA, DAD), "motor", OPEN + script)
    assert said["position"] == pytest.approx(2000, abs=20)
    assert (said["errors"], said["voltage"], said["temperature"]) == (0, 24000, 31)
    assert said["messages"] > 100


def test_it_runs_a_kinematic_motion_to_its_end(tmp_path: Path) -> None:
    """5 mm in 300 ms, smooth; the motor counts it, and says when it runs (register 319, bit 15)."""
    script = """
good(motor.set_kinematic_motion(2, 5000, 300, 20, 1, 0))
held = value(motor.read_multiple_registers_blocking(792, 6))
good(motor.set_mode(orca.MotorMode.KinematicMode))
time.sleep(1.2)  # entering the mode runs the home motion first
good(motor.trigger_kinematic_motion(2))
running = value(motor.read_register_blocking(319))
time.sleep(0.6)
print(json.dumps({"held": held, "running": running, "after": value(motor.read_register_blocking(319)),
                  "position": value(motor.get_position_um())}))
"""
    said = run_client(tmp_path, (ORCA, DAD), "motor", OPEN + script)
    assert said["held"] == [5000, 0, 300, 0, 20, 26]  # config 26: type 1, next id 3, not chained (docs/devices.md 1.5)
    assert said["running"] == 1 << 15 | 2
    assert said["after"] == 2
    assert said["position"] == pytest.approx(5000, abs=20)


def test_its_limits_and_gains_are_held(tmp_path: Path) -> None:
    script = """
good(motor.set_max_force(20000)); good(motor.set_max_temp(70)); good(motor.set_max_power(100))
good(motor.set_safety_damping(60)); good(motor.set_pctrl_tune_softstart(50))
motor.tune_position_controller(210, 5, 600, 20000, 0)
good(motor.set_mode(orca.MotorMode.PositionMode)); good(motor.zero_position()); good(motor.clear_errors())
print(json.dumps({"force": value(motor.read_wide_register_blocking(140)),
                  "registers": [value(motor.read_register_blocking(place)) for place in (139, 142, 143, 150)],
                  "gains": value(motor.read_multiple_registers_blocking(133, 6)),
                  "both": value(motor.read_write_multiple_registers_blocking(163, 1, 163, [200])),
                  "position": value(motor.get_position_um())}))
"""
    said = run_client(tmp_path, (ORCA, DAD), "motor", OPEN + script)
    assert said["force"] == 20000
    assert said["registers"] == [70, 100, 60, 50]
    assert (said["gains"][0], said["gains"][1], said["gains"][2]) == (210, 5, 600)
    assert said["both"] == [200]
    assert said["position"] == 0
