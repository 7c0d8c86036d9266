from __future__ import annotations

import itertools
import json
import random

import pytest
import serial
from pymodbus.client import ModbusSerialClient
from serial.serialutil import PortNotOpenError

from sim.model import Model
from sim.noise import GaussianNoise, generator
from sim.world import World, WorldSettings, lookup
from tests.sim.world_tools import DAD, FREE_AIR, IAI, ORCA, SPRING, Client, bench, framed


def test_a_port_of_nothing_says_what_there_is() -> None:
    with bench("here"):
        for url in ("sim://here/pump", "sim://elsewhere/motor", "sim://here"):
            with pytest.raises(serial.SerialException, match="sim://here/load_cell"):
                serial.serial_for_url(url)
    with pytest.raises(serial.SerialException, match="there is no simulated device") as caught:
        serial.serial_for_url("sim://here/motor")
    assert "sim://here/" not in str(caught.value).partition("there are")[2], "a world that is gone is not offered"


def test_reading_with_a_time_out_moves_virtual_time() -> None:
    with bench() as world:
        port = serial.serial_for_url("sim://test/motor", baudrate=115200, parity="E", timeout=0.5)
        port.write(framed("01 03 0156 0002"))
        assert port.out_waiting == 8
        assert port.read(9) == framed("01 03 04 00000000")
        assert world.clock.now() < 0.01
        start_s = world.clock.now()
        assert port.read(1) == b""
        assert world.clock.now() == pytest.approx(start_s + 0.5)
        port.timeout = 0
        assert port.read(1) == b""
        assert world.clock.now() == pytest.approx(start_s + 0.5)
        port.timeout = None
        port.write(framed("01 03 0156 0002"))
        port.flush()
        assert port.out_waiting == 0
        assert port.read(4) == framed("01 03 04 00000000")[:4]
        port.reset_input_buffer()
        assert port.in_waiting == 0


def test_opening_closing_and_sharing() -> None:
    with bench():
        first = serial.serial_for_url("sim://test/motor", exclusive=True)
        with pytest.raises(serial.SerialException, match="in use"):
            serial.serial_for_url("sim://test/motor")
        first.close()
        first.close()
        with pytest.raises(PortNotOpenError):
            first.write(b"x")
        with serial.serial_for_url("sim://test/motor") as second:
            assert second.in_waiting == 0


def test_what_cannot_be_simulated_is_said() -> None:
    model = Model.from_dict(FREE_AIR)
    with pytest.raises(ValueError, match="motor: no simulated device speaks to driver 'zaber'; there are orca, iai"):
        World(WorldSettings(name="x", model=model, motor=ORCA | {"driver": "zaber"}, load_cell=DAD))
    with pytest.raises(ValueError, match="load_cell: .*'registers'"):
        World(WorldSettings(name="x", model=model, motor=ORCA, load_cell=DAD | {"driver": "registers"}))
    with pytest.raises(ValueError, match="faults"):
        World(WorldSettings(name="x", model=model, motor=ORCA, load_cell=DAD, faults=[{"id": "crc"}]))


def test_a_register_map_of_a_known_name_gets_its_device() -> None:
    mapped = {"driver": "registers", "map": {"name": "iai", "link": {"baudrate": 9600}}, "stroke": (0.0, 50.0)}
    with bench(motor=mapped) as world:
        assert type(world.devices["motor"]).__name__ == "Iai"
        assert lookup("sim://test/motor").line.baudrate == 9600


def test_the_surface_is_above_the_probe_and_drawn_from_the_seed() -> None:
    model = Model.from_dict(SPRING)

    def surface(seed: int) -> float:
        return World(WorldSettings(name="x", model=model, motor=ORCA, load_cell=DAD, seed=seed)).surface_mm

    drawn = [surface(seed) for seed in range(40)]
    assert all(0.5 <= height <= 2.0 for height in drawn)
    assert len(set(drawn)) == 40
    assert max(drawn) - min(drawn) > 1.0
    assert surface(7) == drawn[7]
    assert World(WorldSettings(name="x", model=model, motor=ORCA, load_cell=DAD, surface=-0.25)).surface_mm == -0.25


def traffic(name: str, seed: int, **settings: object) -> list[tuple[float, bytes]]:
    """Half a second of a streamed motion into the spring with a running load cell: what came, and when."""
    with bench(name, model=SPRING, seed=seed, noise_force_N=0.01, noise_position_mm=0.0005, **settings) as world:
        motor, cell = Client(world, "motor"), Client(world, "load_cell")
        cell.port.write(b"SW\r")
        seen = []
        for k in range(100):
            micrometres = min(3000, 40 * k)
            motor.port.write(framed(f"01 64 1e {micrometres:08x}"))
            tick_s = 0.01 * (k + 1)
            while world.clock.now() < tick_s:
                world.clock.wait([motor.port, cell.port], tick_s)
                for client in (motor, cell):
                    data = client.port.read(4096)
                    if data:
                        seen.append((world.clock.now(), bytes(data)))
        assert world.plant.force_N > 5.0
        return seen


def test_one_seed_one_byte_stream() -> None:
    first = traffic("one", 3)
    assert sum(len(data) for _, data in first) > 10_000
    assert first == traffic("two", 3)
    assert first != traffic("three", 4)


def test_reading_one_channel_more_does_not_change_the_other() -> None:
    def force_lines(ask_motor: bool) -> bytes:
        with bench(noise_force_N=0.1, noise_position_mm=0.001) as world:
            motor, cell = Client(world, "motor"), Client(world, "load_cell")
            cell.port.write(b"SN\r")
            for _ in range(20):
                if ask_motor:
                    motor.port.write(framed("01 03 0156 0002"))
                cell.sleep(0.02)
            return bytes(cell.port.read(1 << 16))

    assert force_lines(True) == force_lines(False)


def test_generators_are_separate_and_blocks_do_not_show() -> None:
    draws = {purpose: GaussianNoise(generator(5, purpose), 1.0).draw() for purpose in ("position", "force")}
    assert len(set(draws.values())) == 2
    noise = GaussianNoise(generator(5, "force"), 2.0)
    values = [noise.draw() for _ in range(5000)]
    assert len(set(values)) == 5000
    assert sum(values) / 5000 == pytest.approx(0.0, abs=4 * 2.0 / 5000**0.5)
    assert GaussianNoise(generator(5, "force"), 0.0).draw() == 0.0
    with pytest.raises(ValueError, match="standard deviation"):
        GaussianNoise(generator(5, "force"), -1.0)


def test_truth_is_plain_and_whole() -> None:
    with bench(model=SPRING, surface=1.25, seed=9, noise_force_N=0.01) as world:
        truth = json.loads(json.dumps(world.truth()))
        assert truth["surface_mm"] == 1.25
        assert truth["seed"] == 9
        assert truth["noise"]["force_N"] == 0.01
        assert Model.from_dict(truth["model"]).to_dict() == Model.from_dict(SPRING).to_dict()


def test_a_blocking_pymodbus_client_works_on_the_wall_clock() -> None:
    with bench("wall", clock="wall", motor=ORCA | {"gap_us": 100}):
        client = ModbusSerialClient(
            "sim://wall/motor", baudrate=115200, parity="E", timeout=2.0, retries=0
        )  # the same call as for a real port
        assert client.connect()
        try:
            reply = client.read_holding_registers(482, count=2, device_id=1)
            assert reply.registers == [115200 & 0xFFFF, 115200 >> 16]
            assert client.write_registers(30, [1000, 0], device_id=1).count == 2
            assert client.write_register(3, 3, device_id=1).registers == [3]
            for _ in range(100):
                if client.read_holding_registers(342, count=1, device_id=1).registers[0] in range(980, 1021):
                    break
            else:
                raise AssertionError("the motor does not get there")
            refused = client.read_holding_registers(972, count=2, device_id=1)
            assert refused.isError()
            assert refused.exception_code == 2
        finally:
            client.close()


def test_pymodbus_moves_the_iai_on_the_wall_clock() -> None:
    with bench("wall", clock="wall", motor=IAI | {"baudrate": 115200, "stroke": (-0.5, 20.0)}):
        client = ModbusSerialClient("sim://wall/motor", baudrate=115200, parity="N", timeout=2.0, retries=0)
        assert client.connect()
        try:
            for coil in (0x0427, 0x0403, 0x040B):
                assert client.write_coil(coil, True, device_id=1).bits[0]

            def until(place: int) -> None:
                for _ in range(400):
                    if client.read_holding_registers(0x9005, count=1, device_id=1).registers[0] >> place & 1:
                        return
                raise AssertionError("it does not end")

            until(4)
            client.write_registers(0x9900, [0, 150, 0, 10, 0, 5000, 30], device_id=1)
            until(3)
            position = client.read_holding_registers(0x9000, count=2, device_id=1).registers
            assert position[0] == 0
            assert abs(position[1] - 150) <= 10
        finally:
            client.close()


def test_random_bytes_never_break_a_device() -> None:
    generate = random.Random(1)
    with bench(motor=IAI) as iai_world, bench("other") as world:
        clients = [Client(iai_world, "motor"), Client(world, "motor"), Client(world, "load_cell")]
        for client, _ in itertools.product(clients, range(300)):
            junk = generate.randbytes(generate.randrange(1, 40))
            if generate.random() < 0.5:  # well framed, senseless
                junk = framed((b"\x01" + junk).hex())
            client.port.write(junk)
            client.sleep(0.02)
            client.port.read(1 << 16)
        clients[2].command("SR")
        assert clients[1].modbus("01 08 0000") == "01 08 00 00"
