from __future__ import annotations

import math
import re
from typing import Any

import pytest

from sim.axis import BenchPlant
from tests.sim.world_tools import DAD, SPRING, Client, SPRING_N_mm, bench

BYTE_S = 10 / 115200


def press(plant: BenchPlant, client: Client, depth_mm: float) -> None:
    """Put the probe into a spring whose surface is at 0.5 mm, and wait until it stands."""
    plant.hold(0.5 + depth_mm)
    client.sleep(1.0)


def lines(client: Client, command: str, seconds: float) -> list[str]:
    client.port.write(command.encode() + b"\r")
    client.sleep(seconds)
    return client.port.read(1 << 20).decode().split("\r\n")


def checksum(text: str) -> str:
    """Two's complement of the sum of the characters (docs/devices.md 3.1.1)."""
    return f"{(256 - sum(map(ord, text)) % 256) % 256:02X}"


def spring(world_settings: dict[str, Any]) -> dict[str, Any]:
    return {"model": SPRING, "surface": 0.5} | world_settings


# The worked result of the manual: W+000100+00110001 gives AF.
def test_checksum_of_the_manual() -> None:
    assert checksum("W+000100+00110001") == "AF"


def test_identity_and_reports() -> None:
    with bench() as world:
        client = Client(world, "load_cell")
        replies = {
            "ID": "D:1410",
            "IV": "V:0101",
            "RS": "S+00147301",
            "GG": "G+000.000",
            "FL": "F+00000",
            "FM": "M+00000",
            "UR": "U+00000",
            "DP": "P+00003",
            "DS": "S+00001",
            "CM": "M+075000",
            "AD": "A:000",
            "BR": "B 115200",
            "DX": "X:001",
            "CE": "E+00017",
            "OP": "O:000",
        }
        assert {name: client.command(name) for name in replies} == replies
        assert client.ask(b"\nGG\r\n") == b"G+000.000\r\n"  # line feeds are ignored


def test_readings_with_tare() -> None:
    with bench(**spring({})) as world:
        client = Client(world, "load_cell")
        press(world.plant, client, 0.1)
        force_N = SPRING_N_mm * 0.1
        assert client.command("GG") == f"G+{force_N:07.3f}"
        client.sleep(1.1)
        client.command("GG")
        assert client.command("ST") == "OK"
        assert client.command("GT") == f"T+{force_N:07.3f}"
        press(world.plant, client, 0.2)
        assert client.command("GG") == f"G+{2 * force_N:07.3f}"
        assert client.command("GN") == f"N+{force_N:07.3f}"
        assert client.command("GS") == "S+002000"
        text = f"W+001000+0020000{4:X}"
        assert client.command("GW") == text + checksum(text)
        assert client.command("RT") == "OK"
        assert client.command("GN") == f"N+{2 * force_N:07.3f}"
        press(world.plant, client, -1.0)
        assert client.command("GN") == "N+000.000"


def test_tare_and_zero_are_refused_while_the_weight_moves() -> None:
    with bench(**spring({})) as world:
        client = Client(world, "load_cell")
        press(world.plant, client, 0.1)
        client.command("GG")
        assert client.command("ST") == "ERR"
        assert client.command("SZ") == "ERR"
        client.sleep(1.1)
        assert client.command("IS") == "S:001000"
        assert client.command("SZ") == "OK"
        assert client.command("GG") == "G+000.000"
        assert client.command("IS")[:5] in ("S:002", "S:003")
        assert client.command("RZ") == "OK"
        assert client.command("GG") == "G+001.000"


def test_refused() -> None:
    with bench() as world:
        client = Client(world, "load_cell")
        for command in ("XX", "gg", "FL 9", "FL x", "UR 8", "GG 1", "DP 2", "CM 100", "CS", "CE 5", "BR 4800"):
            assert client.command(command) == "ERR", command
        assert client.command("CE 17") == "OK"
        assert client.command("DP 2") == "OK"
        assert client.command("GG") == "G+0000.00"
        assert client.command("CS") == "OK"
        assert client.command("CE") == "E+00018"
        assert client.command("DP 3") == "ERR"  # closed again


# docs/devices.md 6: 21 bytes at 115200 allow 549 lines a second, below the converter's 600.
def test_continuous_output_is_paced_by_the_wire() -> None:
    with bench(**spring({"noise_force_N": 0.01})) as world:
        client = Client(world, "load_cell")
        press(world.plant, client, 0.2)
        *got, rest = lines(client, "SW", 1.0)
        assert len(got) == pytest.approx(115200 / 210, abs=2)
        assert all(re.fullmatch(r"W\+\d{6}\+\d{6}0\d[0-9A-F]{2}", line) for line in got)
        assert all(checksum(line[:-2]) == line[-2:] for line in got)
        assert len(rest) < 21
        values = [int(line[8:15]) for line in got]
        mean = sum(values) / len(values)
        std = math.sqrt(sum((value - mean) ** 2 for value in values) / (len(values) - 1))
        assert mean == pytest.approx(2000, abs=4 * 10 / math.sqrt(len(values)))
        assert std == pytest.approx(10, rel=4 / math.sqrt(2 * len(values)))


# 11 bytes would allow 1047 a second.
def test_continuous_output_is_paced_by_the_converter() -> None:
    for averaging, rate in ((0, 600.0), (3, 75.0)):
        with bench() as world:
            client = Client(world, "load_cell")
            assert client.command(f"UR {averaging}") == "OK"
            got = lines(client, "SN", 2.0)
            assert len(got) - 1 == pytest.approx(2.0 * rate, abs=2)


def test_continuous_output_ends_at_a_valid_command_only() -> None:
    with bench() as world:
        client = Client(world, "load_cell")
        lines(client, "SG", 0.1)
        got = lines(client, "XX", 0.1)
        assert "ERR" in got
        assert got[-2] == "G+000.000"
        got = lines(client, "GN", 0.1)
        assert got[-2:] == ["N+000.000", ""]
        assert client.port.read(100) == b""
        assert lines(client, "GG", 0.1) == ["G+000.000", ""]


def test_a_line_has_the_force_of_its_start() -> None:
    with bench(**spring({})) as world:
        client = Client(world, "load_cell")
        plant = world.plant
        plant.hold(1.0)
        client.sleep(0.5)
        plant.profile(2.0, 50.0, 5000.0)
        client.port.write(b"SW\r")
        text, arrivals = b"", []
        for _ in range(12):
            client.clock.wait([client.port], client.clock.now() + 0.1)
            text += client.port.read(100)
            arrivals.append(client.clock.now())
        plant.advance(client.clock.now())
        time_s, _, force_N = plant.history(0.5)
        for line, arrival_s in zip(text.decode().split("\r\n"), arrivals, strict=False):
            k = min(range(len(time_s)), key=lambda k: abs(time_s[k] - (arrival_s - 21 * BYTE_S)))
            # a quarter of a substep (0.25 ms) at 50 mm/s and 10 N/mm, and rounding
            assert int(line[8:15]) / 1000.0 == pytest.approx(force_N[k], abs=0.5 * 0.25e-3 * 50 * 10 + 0.001)


# DAD 141.1 manual p. 36: settling to 0.1 % takes 55, 122, 242, 322, 482, 963 … ms.
@pytest.mark.parametrize(("level", "settling_ms"), [(1, 55), (2, 122), (3, 242), (5, 482)])
def test_iir_filter_settles_as_the_manual_says(level: int, settling_ms: float) -> None:
    with bench(**spring({})) as world:
        client = Client(world, "load_cell")
        assert client.command(f"FL {level}") == "OK"
        assert client.command("FL") == f"F+{level:05d}"
        amplifier = world.devices["load_cell"].amplifier  # type: ignore[attr-defined]
        step_s = client.clock.now()
        plant_force_N = 10.0
        amplifier.drift_N_s = 0.0
        amplifier.plant = _Weight(plant_force_N)
        settled_s = step_s
        while client.clock.now() < step_s + 1.5e-3 * settling_ms:
            client.clock.wait([], client.clock.now() + 1 / 600)
            if abs(amplifier.gross(client.clock.now()) - 10_000) > 10:
                settled_s = client.clock.now()
        assert settled_s - step_s == pytest.approx(settling_ms * 1e-3, rel=0.1)


class _Weight:
    """A weight that is put on the cell in an instant."""

    def __init__(self, force_N: float) -> None:
        self.force_N = force_N
        self.plant = self

    def advance(self, at_s: float) -> None: ...

    def sensed_force_N(self, at_s: float) -> float:
        return self.force_N

    def sample(self, dt_s: float, force_N: float) -> float:
        return force_N


# DAS 72.1 guide p. 39: FIR level 2 settles in 93 ms and puts out 300 values a second.
def test_fir_filter() -> None:
    with bench() as world:
        client = Client(world, "load_cell")
        client.command("FM 1")
        client.command("FL 2")
        amplifier = world.devices["load_cell"].amplifier  # type: ignore[attr-defined]
        assert len(lines(client, "SN", 1.0)) - 1 == pytest.approx(300, abs=2)
        amplifier.plant = _Weight(10.0)
        client.sleep(0.100)
        assert amplifier.gross(client.clock.now()) == 10_000


@pytest.mark.parametrize(("command", "gain"), [("UR 4", 1 / 4), ("FL 3", None)])
def test_averaging_and_filter_reduce_the_noise(command: str, gain: float | None) -> None:
    with bench(noise_force_N=0.1) as world:
        client = Client(world, "load_cell")
        client.command(command)
        client.sleep(1.0)
        values = [float(line[1:]) for line in lines(client, "SG", 8.0)[1:-2]]
        mean = sum(values) / len(values)
        std = math.sqrt(sum((value - mean) ** 2 for value in values) / len(values))
        if gain is None:  # 4 Hz of 300: far less, and strongly correlated
            assert 0.005 < std < 0.03
        else:
            assert std == pytest.approx(0.1 * gain, rel=4 / math.sqrt(2 * len(values)))


def test_range() -> None:
    with bench(load_cell=DAD | {"capacity": 2.0}, **spring({})) as world:
        client = Client(world, "load_cell")
        press(world.plant, client, 0.3)  # 150 %
        assert client.command("CM") == "M+003000"
        assert client.command("GG") == "G+003.000"
        press(world.plant, client, 0.31)
        assert client.command("GG") == "Gooooooo"
        assert client.command("GW").startswith("W" + "o" * 14)
        client.command("CE 17")
        client.command("CM 9000")
        press(world.plant, client, 0.8)
        assert client.command("GG") == "G+003.200"  # the input's end: 1.6 × capacity


@pytest.mark.parametrize(
    ("spec", "reading"),
    [
        ({"unit": "g"}, "G+0101.97"),
        ({"unit": "N", "sign": -1}, "G-001.000"),
        ({"unit": "N", "scale": 2.0}, "G+000.500"),
        ({"unit": "N", "decimals": 1}, "G+00001.0"),
        ({"unit": "kg", "decimals": 5}, "G+0.10197"),
        ({"unit": "mN", "decimals": 0}, "G+001000"),
    ],
)
def test_units(spec: dict[str, Any], reading: str) -> None:
    # 1 N is 101.972 g; a scale of 2 means that the bench doubles what the device says
    with bench(load_cell=DAD | spec, **spring({})) as world:
        client = Client(world, "load_cell")
        press(world.plant, client, 0.1)
        assert client.command("GG") == reading


def test_many_on_a_bus() -> None:
    with bench(load_cell=DAD | {"address": 3}) as world:
        client = Client(world, "load_cell")
        assert client.command("GG") == ""
        assert client.command("ON 3") == "N+000.000"
        assert client.command("ON 4") == ""
        assert client.command("OP 3") == "OK"
        assert client.command("GG") == "G+000.000"
        assert client.command("OP 5") == ""
        assert client.command("GG") == ""


def test_baudrate_takes_effect_after_restart() -> None:
    with bench() as world:
        client = Client(world, "load_cell")
        assert client.command("BR 9600") == "OK"
        assert client.command("WP") == "OK"
        assert client.command("ID") == "D:1410"
        assert client.command("SR") == "OK"
        assert client.command("ID") == ""  # it restarts
        client.sleep(0.4)
        client.port.baudrate = 9600
        assert client.command("ID") == "D:1410"


def test_reply_delay() -> None:
    with bench() as world:
        client = Client(world, "load_cell")
        client.command("TD 20")
        start_s = client.clock.now()
        client.port.write(b"GG\r")
        client.clock.wait([client.port], start_s + 1.0)
        # 1 ms is assumed, 20 ms is commanded; 3 bytes out and 11 back
        assert client.clock.now() - start_s == pytest.approx(14 * BYTE_S + 0.021, abs=1e-9)


def test_drift() -> None:
    with bench(drift_force_N_s=0.01) as world:
        client = Client(world, "load_cell")
        client.sleep(100.0)
        assert float(client.command("GG")[1:]) == pytest.approx(1.0, abs=0.002)


def test_wrong_baudrate_is_garbage() -> None:
    with bench() as world:
        client = Client(world, "load_cell", baudrate=9600)
        assert "D:1410" not in client.ask(b"ID\r").decode("latin-1")
