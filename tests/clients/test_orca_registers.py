"""Our addresses, modes and error bits of the Orca against the constants that the vendor ships in its package."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from drivers import orca_frames
from drivers.orca_frames import Mode, Register
from sim.devices import orca_registers
from tests.clients.emulated import needs

NAMES = {
    Register.COMMANDS: "CTRL_REG_0",
    Register.TUNING_COMMANDS: "CTRL_REG_1",
    Register.MODE: "CTRL_REG_3",
    Register.GAINS: "PC_PGAIN",
    Register.MAX_FORCE: "USER_MAX_FORCE",
    Register.COMMS_TIMEOUT: "USER_COMMS_TIMEOUT",
    Register.ZERO_MODE: "ZERO_MODE",
    Register.MODE_NOW: "MODE_OF_OPERATION",
    Register.MOTOR_STATUS: "MOTOR_STATUS",
    Register.POSITION: "SHAFT_POS_UM",
    Register.FORCE: "FORCE",
    Register.SERIAL_NUMBER: "SERIAL_NUMBER_LOW",
    Register.STATOR: "STATOR_CONFIG",
    Register.ERRORS: "ERROR_0",
    Register.LATCHED_ERRORS: "ERROR_1",
    Register.BAUDRATE: "MB_BAUD",
}
MODES = {
    Mode.SLEEP: "SLEEP",
    Mode.FORCE: "FORCE",
    Mode.POSITION: "POSITION",
    Mode.HAPTIC: "HAPTIC",
    Mode.KINEMATIC: "KINEMATIC",
    Mode.AUTO_ZERO: "AUTO_ZERO",
}
ERRORS = {
    0: "CONFIG_INVALID",
    5: "FORCE_CONTROL_CLIPPING",
    6: "MAX_TEMP_EXCEEDED",
    7: "MAX_FORCE_EXCEEDED",
    8: "MAX_POWER_EXCEEDED",
    9: "SHAFT_IMAGE_FAILED",
    10: "VOLTAGE_INVALID",
    11: "COMMS_TIMEOUT",
    13: "AUTO_ZERO_FAILED",
}


@pytest.fixture(scope="module")
def vendor() -> dict[str, int]:
    needs("pyorcasdk")
    script = "import json, pyorcasdk.orca_registers as v; print(json.dumps({k: x for k, x in vars(v).items() " + (
        "if type(x) is int}))"
    )
    done = subprocess.run([sys.executable, "-W", "ignore", "-c", script], capture_output=True, text=True, check=True)
    constants: dict[str, int] = json.loads(done.stdout)
    return constants


def test_the_driver_has_the_vendors_numbers(vendor: dict[str, int]) -> None:
    assert set(NAMES) == set(Register)
    assert {place: vendor[name] for place, name in NAMES.items()} == {place: int(place) for place in NAMES}
    assert {mode: vendor[f"CTRL_REG_3_{name}_MODE"] for mode, name in MODES.items()} == {m: int(m) for m in Mode}
    assert {bit: vendor[f"ERROR_0_{name}_Mask"] for bit, name in ERRORS.items()} == {bit: 1 << bit for bit in ERRORS}
    assert set(orca_frames.ERROR_BITS) == {*ERRORS, 12}  # bit 12: old firmware only
    assert vendor["CTRL_REG_1_PC_GAIN_APPLY_Mask"] == orca_frames.APPLY_GAINS
    assert vendor["MOTOR_STATUS_AUTO_ZERO_COMPLETE_Mask"] == orca_frames.AUTO_ZERO_DONE
    stators = {vendor[f"STATOR_CONFIG_{name.replace('-', '_')}"]: name for name in orca_frames.STATORS.values()}
    assert stators == orca_frames.STATORS


def test_the_emulator_has_the_vendors_numbers(vendor: dict[str, int]) -> None:
    ours = {name: value for name, value in vars(orca_registers).items() if name.isupper() and type(value) is int}
    both = {name for name in ours if name in vendor}
    assert len(both) > 40
    assert {name: ours[name] for name in both} == {name: vendor[name] for name in both}
