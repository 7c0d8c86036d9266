"""Two MT-SICS clients of others (labmcp-mettler-toledo, mettler-toledo-device) against the emulated balance."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.clients.emulated import BALANCE, ORCA, needs, run_client


def test_labmcp_weighs_tares_and_zeroes(tmp_path: Path) -> None:
    """Stable and dynamic weight, tare, preset tare, zero, identity; and a command that there is not."""
    needs("labmcp_mettler_toledo")
    script = r"""
import json, sys, time
from labmcp import InstrumentProtocolError, open_transport
from labmcp_mettler_toledo.driver import MTSICSBalance
transport = open_transport(f"serial://{sys.argv[1]}?baudrate=9600", write_termination="\r\n", read_termination="\r\n")
balance = MTSICSBalance(transport)
time.sleep(1.1)  # the emulated amplifier wants a second of standstill
stable, now = balance.weight(), balance.weight(stable=False)
preset = balance.preset_tare(12.5, "g")
with_tare = balance.weight(stable=False)
asked = balance.tare_value()
balance.clear_tare()
tare = balance.tare()
zero = balance.zero()
try:
    balance.display_weight()
    unknown = ""
except InstrumentProtocolError as error:
    unknown = str(error)
print(json.dumps({"stable": [stable.value, stable.unit, stable.stable], "now": [now.value, now.unit],
    "preset": preset.value, "with_tare": with_tare.value, "asked": asked.value, "tare": tare.value, "zero": zero,
    "identity": balance.identify(), "unknown": unknown, "reset": balance.reset()}))
"""
    said = run_client(tmp_path, (ORCA, BALANCE), "load_cell", script)
    assert said["stable"] == [0.0, "g", True]
    assert said["now"] == [0.0, "g"]
    assert (said["preset"], said["with_tare"], said["asked"]) == (12.5, -12.5, 12.5)
    assert (said["tare"], said["zero"]) == (0.0, True)
    assert said["identity"]["serial"] == said["reset"]
    assert "ES" in said["unknown"]


def test_mettler_toledo_device_weighs_and_zeroes(tmp_path: Path) -> None:
    needs("mettler_toledo_device")
    script = """
import json, sys
from mettler_toledo_device import MettlerToledoDevice
balance = MettlerToledoDevice(port=sys.argv[1])  # opens at 9600 baud and waits two seconds
print(json.dumps({"serial": balance.get_serial_number(), "data": balance.get_balance_data(),
                  "weight": balance.get_weight(), "stable": balance.get_weight_stable(),
                  "zero_stable": balance.zero_stable(), "zero": balance.zero(), "level": balance.get_mtsics_level()}))
"""
    said = run_client(tmp_path, (ORCA, BALANCE), "load_cell", script)
    assert said["weight"] == [0.0, "g", "S"]
    assert said["stable"] == [0.0, "g"]
    assert (said["zero_stable"], said["zero"]) == (True, "S")
    assert said["data"][-1] == "g"
    assert said["serial"]
    assert said["level"][0] == "0"


@pytest.mark.parametrize("garbage", [b"HELLO\r\n", b"S X\r\n"])
def test_a_plain_terminal_gets_es(tmp_path: Path, garbage: bytes) -> None:
    """What anybody may type: pyserial alone."""
    script = f"""
import json, sys, serial
with serial.Serial(sys.argv[1], 9600, timeout=3) as port:
    port.write({garbage!r})
    print(json.dumps(port.readline().decode()))
"""
    assert run_client(tmp_path, (ORCA, BALANCE), "load_cell", script) == "ES\r\n"
