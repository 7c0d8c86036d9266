from __future__ import annotations

import struct

import pytest

from tests.sim.world_tools import DAD, SPRING, Client, bench, framed

TCP = DAD | {"driver": "dad141_modbus", "baudrate": None}
RTU = TCP | {"baudrate": 38400, "map": {"name": "dad141_modbus", "link": {"transport": "rtu", "parity": "N"}}}


class TcpClient(Client):
    """Modbus TCP by hand."""

    def pdu(self, text: str) -> bytes:
        pdu = bytes.fromhex(text)
        reply = self.ask(struct.pack(">HHHB", 7, 0, len(pdu) + 1, 1) + pdu)
        assert reply[:4] == b"\0\7\0\0"
        assert struct.unpack(">H", reply[4:6])[0] == len(reply) - 6
        return reply[7:]

    def read(self, address: int, count: int) -> bytes:
        reply = self.pdu(f"03 {address:04x} {count:04x}")
        assert reply[:2] == bytes((3, 2 * count))
        return reply[2:]


def test_combined_reads() -> None:
    with bench(load_cell=TCP, model=SPRING, surface=0.5) as world:
        client = TcpClient(world, "load_cell")
        world.plant.hold(0.7)
        client.sleep(1.0)
        gross, net, qualifier = struct.unpack(">iiH", client.read(0x3300, 5))
        assert (gross, net) == (2000, 2000)
        client.sleep(1.1)
        gross_f, net_f, qualifier = struct.unpack(">ffH", client.read(0x3500, 5))
        assert (gross_f, net_f) == pytest.approx((2.0, 2.0))
        assert qualifier == 0x0010  # no motion
        assert client.pdu("06 2061 0008") == bytes.fromhex("0620610008")  # set tare
        assert struct.unpack(">iiH", client.read(0x3300, 5)) == (2000, 0, 0x0030)
        assert struct.unpack(">ff", client.read(0x2000, 4)) == pytest.approx((2.0, 0.0))
        assert struct.unpack(">i", client.read(0x2118, 2)) == (2000,)


def test_identity_settings_and_refusals() -> None:
    with bench(load_cell=TCP) as world:
        client = TcpClient(world, "load_cell")
        assert struct.unpack(">i", client.read(0x202C, 2)) == (1410,)
        assert client.read(0x202E, 2) == b"\0\0\1\1"  # low word: minor, major
        assert client.pdu("10 2106 0002 04 00000003") == bytes.fromhex("1021060002")
        assert client.read(0x2106, 2) == b"\0\0\0\3"
        assert client.pdu("10 2106 0002 04 00000008") == bytes.fromhex("9003")
        assert client.pdu("03 2004 0002") == bytes.fromhex("8302")
        assert client.pdu("03 3300 0006") == bytes.fromhex("8302")
        assert client.pdu("06 2000 0001") == bytes.fromhex("8602")
        assert client.pdu("05 2000 FF00") == bytes.fromhex("8501")
        assert client.pdu("06 2061 0008") == bytes.fromhex("8604")  # not yet still


def test_over_range() -> None:
    with bench(load_cell=TCP | {"capacity": 1.0}, model=SPRING, surface=0.5) as world:
        client = TcpClient(world, "load_cell")
        world.plant.hold(0.655)
        client.sleep(1.0)
        assert struct.unpack(">iiH", client.read(0x3300, 5))[2] & 3 == 2


def test_the_same_map_over_rtu() -> None:
    with bench(load_cell=RTU) as world:
        client = Client(world, "load_cell")
        assert client.ask(framed("01 03 3300 0005")) == framed("01 03 0A 00000000 00000000 0000")
        start_s = client.clock.now()
        client.port.write(framed("01 03 3500 0005"))
        client.clock.wait([client.port], start_s + 1.0)
        assert client.clock.now() - start_s == pytest.approx(23 * 10 / 38400 + 0.002, abs=1e-9)
