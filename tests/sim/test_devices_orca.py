from __future__ import annotations

import struct

import pytest

from sim.devices.orca import Orca
from sim.world import World
from tests.sim.world_tools import SPRING, Client, SPRING_N_mm, bench, framed

BYTE_S = 11 / 115200
NO_ERROR = 0


def stream(client: Client, code: int, value: int) -> tuple[int, int, int, int, int, int]:
    """One 0x64 exchange: position µm, force mN, power W, temperature °C, voltage mV, errors (docs/devices.md 1.2)."""
    reply = client.ask(framed("01 64" + struct.pack(">Bi", code, value).hex()))
    assert len(reply) == 19
    assert reply[:2] == b"\x01\x64"
    return struct.unpack(">iiHBHH", reply[2:-2])


def registers(client: Client, address: int, count: int = 1) -> list[int]:
    reply = bytes.fromhex(client.modbus(f"01 03 {address:04x} {count:04x}"))
    assert reply[:3] == bytes((1, 3, 2 * count))
    return list(struct.unpack(f">{count}H", reply[3:]))


def wide(client: Client, address: int) -> int:
    low, high = registers(client, address, 2)
    return int(struct.unpack(">i", struct.pack(">HH", high, low))[0])


def write(client: Client, address: int, *values: int) -> None:
    words = struct.pack(f">{len(values)}H", *values).hex()
    reply = client.modbus(f"01 10 {address:04x} {len(values):04x} {2 * len(values):02x} {words}")
    assert reply == bytes.fromhex(f"0110{address:04x}{len(values):04x}").hex(" ")


def orca(world: World) -> Orca:
    device = world.devices["motor"]
    assert isinstance(device, Orca)
    return device


# Requests of docs/devices.md 7.2 as they are on the wire, CRC included; replies laid out as in 1.2.
@pytest.mark.parametrize(
    ("request_", "reply"),
    [
        ("01 03 01 56 00 02 25 e7", "01 03 04 0000 0000"),
        ("01 06 00 03 00 03 39 cb", "01 06 0003 0003"),
        ("01 64 00 00 00 00 00 03 e4", "01 64 00000000 00000000 0000 1f 5dc0 0000"),
        ("01 68 01 50 01 a9 a0", "01 68 0000 001f 01 00000000 00000000 0000 1f 5dc0 0000"),
        ("01 69 00 03 01 00 00 00 03 bc d0", "01 69 03 00000000 00000000 0000 1f 5dc0 0000"),
        ("01 41 ff 00 00 09 89 68 00 50 25 28", "01 41 ff00 00098968 0050"),
    ],
)
def test_frames_of_the_manual(request_: str, reply: str) -> None:
    with bench() as world:
        assert Client(world, "motor").ask(bytes.fromhex(request_)).hex(" ") == framed(reply).hex(" ")


# docs/devices.md 6: 9 + 19 bytes of 8E1 at 115200 take 2674 µs; the motor waits 2000 µs in between.
def test_wire_time_of_a_stream_exchange_is_exact() -> None:
    with bench() as world:
        client = Client(world, "motor")
        client.port.write(bytes.fromhex("01 64 00 00 00 00 00 03 e4"))
        client.clock.wait([client.port], 1.0)
        assert client.port.in_waiting == 19
        assert client.clock.now() == pytest.approx(28 * BYTE_S + 0.002, abs=1e-9)
        assert pytest.approx(2674e-6, abs=0.5e-6) == 28 * BYTE_S


def test_position_command_moves_and_is_reported() -> None:
    with bench() as world:
        client = Client(world, "motor")
        assert client.ask(bytes.fromhex("01 64 1e 00 00 13 88 a6 b0"))[-4:-2] == b"\0\0"  # 5000 µm, no error
        client.sleep(0.3)
        position_um, force_mN, *_, errors = stream(client, 30, 5000)
        assert abs(position_um - 5000) <= 20
        assert abs(force_mN) < 1000
        assert errors == NO_ERROR
        assert registers(client, 317) == [3]
        assert abs(wide(client, 342) - 5000) <= 20
        assert wide(client, 30) == 5000
        client.ask(bytes.fromhex("01 64 1e ff ff ef 1f a6 3a"))  # -4321 µm
        client.sleep(0.3)
        assert abs(wide(client, 342) + 4321) <= 20


def test_any_other_code_is_sleep() -> None:
    with bench() as world:
        client = Client(world, "motor")
        stream(client, 30, 1000)
        assert world.plant.servo_on
        stream(client, 7, 0)
        assert registers(client, 317) == [1]
        assert not world.plant.servo_on


def test_direction_and_zero() -> None:
    with bench(motor={"direction": -1}) as world:
        client = Client(world, "motor")
        stream(client, 30, 2000)
        client.sleep(0.3)
        assert world.plant.position_mm == pytest.approx(-2.0, abs=0.02)
        assert abs(wide(client, 342) - 2000) <= 20
        client.modbus("01 06 0000 0004")  # zero position here
        assert registers(client, 0) == [0]  # clears itself
        assert abs(wide(client, 342)) <= 20


def test_refusals() -> None:
    with bench() as world:
        client = Client(world, "motor")
        assert client.modbus("01 03 03cc 0002") == "01 83 02"  # map ends at 972
        assert client.modbus("01 06 0156 0001") == "01 86 02"  # a status register
        assert client.modbus("01 68 03cd 01") == "01 e8 02"
        assert client.modbus("01 2b 0e 01 00") == "01 ab 01"
        assert client.modbus("02 03 0156 0002") == ""  # not its address
        assert client.ask(bytes.fromhex("01 03 01 56 00 02 25 e8")) == b""  # CRC
        assert client.modbus("01 08 0000") == "01 08 00 00"  # ping of the old handshake
        counters = registers(client, 464, 4)  # bus messages, errors, exceptions, own messages
        assert counters == [7, 1, 4, 6]


def test_wrong_baudrate_or_parity_hears_nothing() -> None:
    for options in ({"baudrate": 19200}, {"parity": "N"}):
        with bench() as world:
            assert Client(world, "motor", **options).modbus("01 03 0156 0002") == ""


def test_handshake_changes_the_rate_after_its_reply() -> None:
    with bench() as world:
        client = Client(world, "motor")
        assert client.modbus("01 41 ff00 000f4240 0050") == "01 41 ff 00 00 0f 42 40 00 50"
        assert client.modbus("01 03 0156 0002") == ""
        client.port.baudrate = 1_000_000
        assert wide(client, 482) == 1_000_000
        start_s = client.clock.now()
        client.port.write(framed("01 64 00 00000000"))
        client.clock.wait([client.port], start_s + 1.0)
        assert client.clock.now() - start_s == pytest.approx(28 * 11e-6 + 80e-6, abs=1e-9)
        assert len(client.port.read(100)) == 19
        assert client.modbus("01 41 0000 00000000 0000") == "01 41 00 00 00 01 c2 00 07 d0"
        client.port.baudrate = 115200
        assert wide(client, 482) == 115200


def test_watchdog_takes_the_force_away_until_sleep() -> None:
    with bench(model=SPRING, surface=0.5) as world:
        client = Client(world, "motor")
        write(client, 163, 100)  # USER_COMMS_TIMEOUT, ms
        write(client, 143, 0)  # SAFETY_DGAIN: no damping
        stream(client, 30, 1500)
        client.sleep(0.09)
        assert stream(client, 30, 1500)[-1] == NO_ERROR
        start_s = client.clock.now()
        client.sleep(0.0895)
        assert orca(world).errors == NO_ERROR
        assert world.plant.force_N == pytest.approx(1.0 * SPRING_N_mm, rel=0.05)
        client.sleep(0.2)
        assert client.clock.now() - start_s < 0.31
        position_um, force_mN, *_, errors = stream(client, 30, 1500)
        assert errors == 1 << 11
        assert force_mN == 0
        assert position_um < 1500  # the pad has pushed it out
        assert registers(client, 432, 2) == [1 << 11, 1 << 11]
        client.sleep(0.2)
        assert world.plant.force_N < 1.0  # a command does not bring the force back
        stream(client, 0, 0)
        assert registers(client, 432, 2) == [0, 1 << 11]  # the latched one only reports history
        client.modbus("01 06 0000 0002")
        assert registers(client, 432, 2) == [0, 0]
        stream(client, 30, 1500)
        client.sleep(0.08)
        assert world.plant.force_N > 5.0


def test_safety_damping_lets_go_slowly() -> None:
    with bench(model=SPRING, surface=0.5) as world:
        client = Client(world, "motor")
        write(client, 163, 50)
        write(client, 143, 5000)  # taken as 5 N·s/mm
        stream(client, 30, 1500)
        client.sleep(0.04)
        stream(client, 30, 1500)
        client.sleep(0.05)
        before_mm = world.plant.position_mm
        client.sleep(0.1)
        assert orca(world).errors == 1 << 11
        # a damper of 5 N·s/mm against a spring of 10 N/mm: e^-0.2 of the depth is left after 0.1 s
        assert world.plant.position_mm - 0.5 == pytest.approx((before_mm - 0.5) * 0.82, abs=0.05)


def test_without_a_time_out_there_is_no_watchdog() -> None:
    with bench() as world:
        client = Client(world, "motor")
        stream(client, 30, 1000)
        client.sleep(5.0)
        assert stream(client, 30, 1000)[-1] == NO_ERROR


def test_max_force_limits_the_push_and_is_an_error() -> None:
    with bench(model=SPRING, surface=0.5) as world:
        client = Client(world, "motor")
        write(client, 140, 4000, 0)  # USER_MAX_FORCE 4 N
        assert wide(client, 140) == 4000
        stream(client, 30, 3000)  # 25 N if it could
        client.sleep(1.0)
        _, force_mN, *_, errors = stream(client, 30, 3000)
        assert errors == 1 << 7
        assert force_mN == 4000
        assert world.plant.force_N == pytest.approx(4.0, abs=0.5)  # rail friction beside it
        stream(client, 30, 0)
        client.sleep(0.3)
        assert stream(client, 30, 0)[-1] == NO_ERROR
        assert registers(client, 433) == [1 << 7]


def test_force_mode_presses_with_the_force_commanded() -> None:
    with bench(model=SPRING, surface=0.5) as world:
        client = Client(world, "motor")
        assert client.ask(bytes.fromhex("01 64 1c 00 00 07 d0 d1 8a"))[-4:-2] == b"\0\0"  # 2000 mN
        client.sleep(1.0)
        _, force_mN, *_ = stream(client, 28, 2000)
        assert abs(force_mN - 2000) < 100
        assert world.plant.force_N == pytest.approx(2.0, abs=0.35)
        stream(client, 28, 0)
        client.sleep(1.0)
        assert world.plant.force_N < 0.35


def test_kinematic_mode_runs_home_then_what_is_triggered() -> None:
    with bench() as world:
        client = Client(world, "motor")
        write(client, 780, 1000, 0, 100, 0, 0, 0)  # motion 0: 1 mm in 100 ms
        write(client, 792, 5000, 0, 100, 0, 20, 26)  # motion 2 of docs/devices.md 1.5: 5 mm, smooth, after 20 ms
        client.modbus("01 06 0003 0005")
        assert registers(client, 319) == [1 << 15]
        client.sleep(0.2)
        assert registers(client, 317, 4)[2:] == [0, 1]
        assert abs(wide(client, 342) - 1000) <= 20
        client.modbus("01 06 0009 0002")
        begun_s = client.clock.now()
        client.sleep(0.07)
        assert registers(client, 319) == [2 | 1 << 15]
        assert client.clock.now() - begun_s < 0.09
        # half-way in time is half-way in space for both shapes, within the servo's lag
        assert 1500 < wide(client, 342) < 4500
        client.sleep(0.15)
        assert abs(wide(client, 342) - 5000) <= 20
        assert registers(client, 319, 2) == [2, 2]


def test_auto_zero_finds_the_retracted_end() -> None:
    with bench(motor={"stroke": (-3.0, 20.0)}) as world:
        client = Client(world, "motor")
        client.modbus("01 06 0003 0037")  # mode 55 while zero mode is manual
        assert registers(client, 317) == [1]
        write(client, 171, 2, 30, 3)  # enabled, 30 N, then position mode
        client.modbus("01 06 0003 0037")
        assert registers(client, 317) == [55]
        assert registers(client, 321) == [2]
        client.sleep(0.5)
        assert registers(client, 317) == [3]
        assert registers(client, 321)[0] & 3 == 1
        assert abs(wide(client, 342)) <= 20
        assert world.plant.position_mm == pytest.approx(-3.0, abs=0.02)


def test_auto_zero_that_finds_no_stop_is_error_13() -> None:
    with bench() as world:
        client = Client(world, "motor")
        write(client, 171, 2, 30_000)  # more force than the motor has
        client.modbus("01 06 0003 0037")
        client.sleep(11.0)
        assert registers(client, 317) == [1]
        assert registers(client, 432) == [1 << 13]


def test_speed_limit_makes_a_trapezoid_of_a_step() -> None:
    with bench() as world:
        client = Client(world, "motor")
        write(client, 153, 50, 1000, 1000)
        stream(client, 30, 10_000)
        client.sleep(0.1)
        assert world.plant.speed_mm_s == pytest.approx(50.0, rel=0.1)
        assert registers(client, 321)[0] & 4
        client.sleep(0.3)
        assert abs(stream(client, 30, 10_000)[0] - 10_000) <= 20


def test_position_noise_and_resolution() -> None:
    with bench(noise_position_mm=0.002) as world:
        client = Client(world, "motor")
        readings = [wide(client, 342) for _ in range(400)]
        mean = sum(readings) / len(readings)
        std = (sum((value - mean) ** 2 for value in readings) / len(readings)) ** 0.5
        # 2 µm of noise beside 1/sqrt(12) µm of rounding; 400 draws give it within 4 standard errors
        assert std == pytest.approx((4.0 + 1 / 12) ** 0.5, rel=4 / (2 * 400) ** 0.5)
