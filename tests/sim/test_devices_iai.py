from __future__ import annotations

import struct

import pytest

from sim.devices.iai import Iai
from sim.world import World
from tests.sim.world_tools import IAI, SPRING, Client, SPRING_N_mm, bench, framed

G_mm_s2 = 9806.65
LONG_STROKE = IAI | {"stroke": (0.0, 100.0)}


def registers(client: Client, address: int, count: int) -> list[int]:
    reply = bytes.fromhex(client.modbus(f"01 03 {address:04x} {count:04x}"))
    return list(struct.unpack(f">{count}H", reply[3:]))


def position_mm(client: Client) -> float:
    return float(struct.unpack(">i", struct.pack(">HH", *registers(client, 0x9000, 2)))[0] / 100.0)


def bit(client: Client, register: int, place: int) -> bool:
    return bool(registers(client, register, 1)[0] >> place & 1)


def coil(client: Client, address: int, on: bool) -> None:
    request = f"01 05 {address:04x} {'ff00' if on else '0000'}"
    assert client.modbus(request) == bytes.fromhex(request.replace(" ", "")).hex(" ")


def ready(client: Client) -> None:
    """Modbus in command, servo on, homed."""
    coil(client, 0x0427, True)
    coil(client, 0x0403, True)
    coil(client, 0x040B, False)
    coil(client, 0x040B, True)
    for _ in range(200):
        client.sleep(0.05)
        if bit(client, 0x9005, 4):
            return
    raise AssertionError("homing does not end")


def move(
    client: Client, target_mm: float, speed_mm_s: float = 100.0, flags: int = 0, push: int = 0, band: int = 10
) -> None:
    block = struct.pack(">iIIHHH", round(100 * target_mm), band, round(100 * speed_mm_s), 30, push, flags)
    assert client.modbus("01 10 9900 0009 12 " + block.hex()) == "01 10 99 00 00 09"


def alarm(client: Client) -> int:
    return registers(client, 0x9002, 1)[0]


def iai(world: World) -> Iai:
    device = world.devices["motor"]
    assert isinstance(device, Iai)
    return device


# Byte pairs of docs/devices.md 7.1.
@pytest.mark.parametrize(
    ("request_", "reply"),
    [
        (
            "01 10 99 00 00 07 0E 00 00 13 88 00 00 00 0A 00 00 27 10 00 1E 50 CF",
            "01 10 99 00 00 07 AF 57",
        ),
        (
            "01 10 99 00 00 09 12 00 00 13 88 00 00 07 D0 00 00 27 10 00 1E 00 B2 00 06 C3 77",
            "01 10 99 00 00 09 2E 93",
        ),
        (
            "01 10 99 00 00 09 12 00 00 03 E8 00 00 00 0A 00 00 27 10 00 1E 00 00 00 08 F3 A0",
            "01 10 99 00 00 09 2E 93",
        ),
        ("01 10 99 07 00 02 04 00 7F 00 06 C5 C5", "01 10 99 07 00 02 DE 95"),
        ("01 05 04 0C FF 00 4D 09", "01 05 04 0C FF 00 4D 09"),
        ("01 05 04 0C 00 00 0C F9", "01 05 04 0C 00 00 0C F9"),
        ("01 05 04 26 FF 00 6C C1", "01 05 04 26 FF 00 6C C1"),
        ("01 06 0D 03 00 01 BA A6", "01 06 0D 03 00 01 BA A6"),
        ("01 06 0D 00 10 00 86 A6", "01 06 0D 00 10 00 86 A6"),
        ("01 06 0D 00 10 08 87 60", "01 06 0D 00 10 08 87 60"),
    ],
)
def test_frames_of_the_manual(request_: str, reply: str) -> None:
    with bench(motor=IAI) as world:
        assert Client(world, "motor").ask(bytes.fromhex(request_)) == bytes.fromhex(reply)


# docs/devices.md 7.1 and 6: parameter 17 (5 ms) and 1 ms inside, 8 + 25 bytes of 8N1 at 38400 (8594 µs on the wire).
def test_reply_time_of_the_status_block() -> None:
    with bench(motor=IAI) as world:
        client = Client(world, "motor")
        client.port.write(framed("01 03 9000 000A"))
        client.clock.wait([client.port], 1.0)
        assert client.port.in_waiting == 25
        assert client.clock.now() == pytest.approx(330 / 38400 + 0.006, abs=1e-9)
        assert pytest.approx(8594e-6, abs=0.5e-6) == 330 / 38400


def test_writing_a_table_row_takes_longer() -> None:
    with bench(motor=IAI) as world:
        client = Client(world, "motor")
        client.port.write(framed("01 06 100A 001E"))
        client.clock.wait([client.port], 1.0)
        assert client.clock.now() == pytest.approx(160 / 38400 + 0.005 + 0.015, abs=1e-9)


def test_homing_takes_its_time_and_gives_the_frame() -> None:
    with bench(motor=IAI | {"stroke": (-2.0, 10.0)}) as world:
        client = Client(world, "motor")
        assert position_mm(client) == 0.0
        coil(client, 0x0427, True)
        coil(client, 0x0403, True)
        assert not bit(client, 0x9005, 4)
        coil(client, 0x040B, True)
        started_s = client.clock.now()
        assert bit(client, 0x9007, 11)  # GMHS
        assert bit(client, 0x9007, 5)  # MOVE
        lowest_mm = 0.0
        while not bit(client, 0x9005, 4):
            client.sleep(0.002)
            lowest_mm = min(lowest_mm, world.plant.position_mm)
            assert client.clock.now() - started_s < 1.0
        assert lowest_mm == pytest.approx(-2.0, abs=0.1)
        client.sleep(0.2)
        assert world.plant.position_mm == pytest.approx(0.0, abs=0.02)
        assert position_mm(client) == pytest.approx(0.0, abs=0.02)
        assert not bit(client, 0x9007, 5)


def test_move_goes_where_it_is_told_as_fast_as_told() -> None:
    with bench(motor=LONG_STROKE) as world:
        client = Client(world, "motor")
        ready(client)
        client.modbus("01 10 9900 0007 0E 00001388 0000000A 00002710 001E")  # 50 mm, 100 mm/s, 0.3 G
        client.sleep(0.25)
        assert not bit(client, 0x9005, 3)
        assert bit(client, 0x9007, 5)
        speed = struct.unpack(">i", struct.pack(">HH", *registers(client, 0x900A, 2)))[0]
        assert speed == pytest.approx(10_000, rel=0.02)
        client.sleep(0.5)
        assert bit(client, 0x9005, 3)  # PEND
        assert not bit(client, 0x9007, 5)
        assert position_mm(client) == pytest.approx(50.0, abs=0.02)
        duration_s = 50.0 / 100.0 + 100.0 / (0.3 * G_mm_s2)
        assert duration_s < 0.75


def test_incremental_move() -> None:
    with bench(motor=LONG_STROKE) as world:
        client = Client(world, "motor")
        ready(client)
        for expected_mm in (10.0, 20.0):
            client.ask(
                bytes.fromhex("01 10 99 00 00 09 12 00 00 03 E8 00 00 00 0A 00 00 27 10 00 1E 00 00 00 08 F3 A0")
            )
            client.sleep(0.4)
            assert position_mm(client) == pytest.approx(expected_mm, abs=0.02)


def test_direction() -> None:
    with bench(motor=IAI | {"direction": -1, "stroke": (-4.0, 4.0)}) as world:
        client = Client(world, "motor")
        ready(client)
        world.plant.advance(client.clock.now())
        _, path_mm, _ = world.plant.history(0.0)
        assert path_mm.max() < 0.1  # homes away from the pad
        move(client, 3.0)
        client.sleep(0.6)
        assert world.plant.position_mm == pytest.approx(-3.0, abs=0.02)


def test_refused_out_of_order() -> None:
    with bench(motor=IAI) as world:
        client = Client(world, "motor")
        start_mm = world.plant.position_mm
        coil(client, 0x0403, True)
        assert not bit(client, 0x9005, 12)  # PIO has the command
        coil(client, 0x0427, True)
        coil(client, 0x0403, False)
        move(client, 1.0)
        assert alarm(client) == 0x80  # servo off
        assert bit(client, 0x9005, 9)
        coil(client, 0x0403, True)
        coil(client, 0x0407, True)
        coil(client, 0x0407, False)
        assert alarm(client) == 0
        move(client, 1.0)
        assert alarm(client) == 0x83  # not homed
        move(client, 1.0)
        client.sleep(0.3)
        assert world.plant.position_mm == pytest.approx(start_mm, abs=0.01)
        detail = registers(client, 0x0500, 6)
        assert detail[3] == 0x83
        assert 0 < detail[5] < 1000 * client.clock.now()


def test_refused_values() -> None:
    with bench(motor=IAI) as world:
        client = Client(world, "motor")
        ready(client)
        home_mm = world.plant.position_mm
        for target_mm, speed_mm_s in ((50.0, 100.0), (1.0, 0.0), (1.0, 9000.0)):
            move(client, target_mm, speed_mm_s)
            assert alarm(client) == 0xA3
            coil(client, 0x0407, True)
            coil(client, 0x0407, False)
        assert world.plant.position_mm == pytest.approx(home_mm, abs=0.01)
        assert client.modbus("01 10 9900 0002 04 000F4240") == "01 90 03"  # 1000000 of ±999999
        assert client.modbus("01 03 9900 0002") == "01 83 02"  # write only
        assert client.modbus("01 03 900A 0020") == "01 83 02"
        assert client.modbus("01 06 9000 0001") == "01 86 02"
        assert client.modbus("01 05 0700 FF00") == "01 85 02"
        assert client.modbus("01 11") == "01 91 01"
        assert client.modbus("03 02 04A1 0014") == ""  # another axis


def test_stop_coil_and_pause() -> None:
    with bench(motor=LONG_STROKE) as world:
        client = Client(world, "motor")
        ready(client)
        move(client, 90.0)
        client.sleep(0.2)
        coil(client, 0x042C, True)
        client.sleep(0.2)
        stopped_mm = position_mm(client)
        assert 10.0 < stopped_mm < 60.0
        assert not bit(client, 0x9005, 3)
        client.sleep(0.2)
        assert position_mm(client) == pytest.approx(stopped_mm, abs=0.02)

        move(client, 90.0)
        client.sleep(0.1)
        coil(client, 0x040A, True)
        client.sleep(0.2)
        paused_mm = position_mm(client)
        assert paused_mm < 80.0
        assert bit(client, 0x9005, 5)
        coil(client, 0x040A, False)
        client.sleep(1.0)
        assert position_mm(client) == pytest.approx(90.0, abs=0.02)

        move(client, 0.0)
        client.sleep(0.1)
        coil(client, 0x040A, True)
        coil(client, 0x0407, True)  # alarm reset while paused cancels the way that is left
        coil(client, 0x0407, False)
        coil(client, 0x040A, False)
        client.sleep(1.0)
        assert position_mm(client) > 50.0


def test_servo_off_lets_go_and_forgets() -> None:
    with bench(motor=IAI, model=SPRING, surface=0.5) as world:
        client = Client(world, "motor")
        ready(client)
        move(client, 1.5)
        client.sleep(0.5)
        assert world.plant.force_N == pytest.approx(SPRING_N_mm, rel=0.02)
        coil(client, 0x0403, False)
        client.sleep(0.3)
        assert world.plant.force_N < 0.5
        assert not bit(client, 0x9005, 12)
        assert not bit(client, 0x9005, 3)


def test_position_table() -> None:
    with bench(motor=LONG_STROKE) as world:
        client = Client(world, "motor")
        row = struct.pack(">iIIiiHHHHH", 1200, 10, 20_000, 0, 0, 30, 30, 0, 0, 0)
        assert client.modbus("01 10 1010 000F 1E " + row.hex()) == "01 10 10 10 00 0f"  # row 1
        assert registers(client, 0x1010, 6) == [0, 1200, 0, 10, 0, 20_000]
        ready(client)
        client.modbus("01 06 0D03 0001")  # POSR
        coil(client, 0x040C, True)  # CSTR
        client.sleep(0.3)
        assert position_mm(client) == pytest.approx(12.0, abs=0.02)
        assert registers(client, 0x9014, 1) == [1]
        coil(client, 0x040C, False)
        client.modbus("01 06 9800 0002")  # POSR2 starts at once; row 2 is empty
        assert alarm(client) == 0xA2


def test_servo_and_start_by_the_control_register() -> None:
    with bench(motor=IAI) as world:
        client = Client(world, "motor")
        coil(client, 0x0427, True)
        client.modbus("01 06 0D00 1000")
        assert bit(client, 0x9005, 12)
        client.modbus("01 06 0D00 1008")  # table move, not homed
        assert alarm(client) == 0x81
        assert client.modbus("01 02 0100 0010") == "01 82 02"  # 010F does not exist
        reply = bytes.fromhex(client.modbus("01 02 0100 000F"))
        assert reply[2] == 2
        assert reply[3] & 1 << 3  # 0103 SV
        assert client.modbus("01 01 0403 0001") == "01 01 01 01"


def test_push_presses_with_the_limit_and_misses_without_anything_there() -> None:
    with bench(motor=IAI, model=SPRING, surface=0.5) as world:
        client = Client(world, "motor")
        ready(client)
        move(client, 0.0, 50.0, flags=1 << 1, push=20, band=500)  # push on by 5 mm with 20/255 of the force
        client.sleep(2.0)
        full_N = world.plant.settings.max_force_N
        assert world.plant.force_N == pytest.approx(20 / 255 * full_N, abs=0.5)
        assert bit(client, 0x9005, 3)  # PEND
        assert not bit(client, 0x9005, 11)
        assert bit(client, 0x9007, 10)  # PUSH
        client.modbus("01 10 9907 0002 04 000A 0002")  # half of it, on the fly
        client.sleep(0.5)
        assert world.plant.force_N == pytest.approx(10 / 255 * full_N, abs=0.5)
        before_mm = world.plant.position_mm
        move(client, 0.0)
        client.sleep(0.01)
        assert world.plant.position_mm <= before_mm + 0.02  # straight back, nothing wound up
        client.sleep(0.4)
        assert position_mm(client) == pytest.approx(0.0, abs=0.02)
        move(client, -10.0, 50.0, flags=1 << 1, push=50, band=300)
        client.sleep(2.0)
        assert position_mm(client) == pytest.approx(-7.0, abs=0.03)
        assert bit(client, 0x9005, 11)  # PSFL


def test_speed_change_under_way() -> None:
    with bench(motor=LONG_STROKE) as world:
        client = Client(world, "motor")
        ready(client)
        move(client, 90.0, 20.0)
        client.sleep(0.2)
        client.modbus("01 10 9904 0002 04 00003A98")  # 150 mm/s
        client.sleep(0.2)
        assert world.plant.speed_mm_s == pytest.approx(150.0, rel=0.02)
