"""Devices on pymodbus's own server, in a process of their own: an independent end of the wire for the drivers.

`python -m tests.drivers.modbus_server orca|iai|smc_lec|dad141_modbus|laumas_tlb` prints the port to open and serves
until its input ends. Framing, CRC and addressing are pymodbus's; behind them are registers with just enough behaviour
(modes, servo, homing, a position that follows) for a driver's conversations. Serial devices stand on a pair of
pseudo-terminals joined here.
"""

from __future__ import annotations

import asyncio
import logging
import os
import struct
import sys
import tty
from typing import Any

from pymodbus.constants import ExcCodes
from pymodbus.pdu import ModbusPDU
from pymodbus.server import ModbusSerialServer, ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice


def words_of(kind: str, value: float) -> list[int]:
    data = struct.pack(f">{kind}", value)
    return list(struct.unpack(f">{len(data) // 2}H", data))


class OrcaStreamReply(ModbusPDU):
    """Function 0x64, reply: 15 data bytes (docs/devices.md 1.2)."""

    function_code = 0x64
    rtu_frame_size = 19

    def __init__(self, position_um: int = 0, errors: int = 0) -> None:
        super().__init__()
        self.data = struct.pack(">iiHBHH", position_um, 0, 7, 31, 24000, errors)

    def encode(self) -> bytes:
        return self.data


class OrcaStream(ModbusPDU):
    """Function 0x64, request: command code and 32-bit value, high byte first."""

    function_code = 0x64
    rtu_frame_size = 9
    code = 0
    value = 0

    def decode(self, data: bytes) -> None:
        self.code, self.value = struct.unpack(">Bi", data)

    async def datastore_update(self, context: Any, device_id: int) -> ModbusPDU:
        await context.async_setValues(device_id, 6, 3, [{28: 2, 30: 3}.get(self.code, 1)])
        if self.code == 30:
            high, low = words_of("i", self.value)
            await context.async_setValues(device_id, 16, 342, [low, high])
        low, high = await context.async_getValues(device_id, 3, 342, 2)
        return OrcaStreamReply(struct.unpack(">i", struct.pack(">HH", high, low))[0])


def orca() -> SimDevice:
    registers = [0] * 973
    registers[406:411] = [42, 0, 7, 2, 2]
    registers[171], registers[317] = 2, 1
    registers[482:485] = [0x4240, 0x000F, 80]

    async def action(
        function: int, start: int, address: int, count: int, current: list[int], values: list[Any] | None
    ) -> ExcCodes | None:
        if values is not None and address == 3:
            current[317 - start] = values[0]
        return None

    return SimDevice(1, [SimData(0, values=registers, datatype=DataType.REGISTERS)], action=action)


class IaiState:
    """What an IAI's coils do, and the registers that tell of it; moves take their time by the event loop's clock."""

    def __init__(self) -> None:
        self.coils: dict[int, bool] = {}
        self.homed = False
        self.start = self.target = 0
        self.began_s = self.ends_s = 0.0

    def position(self) -> int:
        now_s = asyncio.get_running_loop().time()
        if now_s >= self.ends_s:
            return self.target
        share = (now_s - self.began_s) / (self.ends_s - self.began_s)
        return round(self.start + share * (self.target - self.start))

    def move(self, target: int, speed: int) -> None:
        self.start, self.target = self.position(), target
        self.began_s = asyncio.get_running_loop().time()
        self.ends_s = self.began_s + abs(target - self.start) / speed

    def coil(self, address: int, on: bool) -> None:
        rising = on and not self.coils.get(address, False)
        self.coils[address] = on
        if address == 0x040B and rising:
            self.homed = True
            self.move(0, 2000)
        if address == 0x042C and rising:
            self.target, self.ends_s = self.position(), 0.0
            self.coils[address] = False

    def status(self) -> list[int]:
        moving = asyncio.get_running_loop().time() < self.ends_s
        dss1 = self.coils.get(0x0403, False) << 12 | self.homed << 4 | (not moving) << 3
        dsse = self.coils.get(0x0427, False) << 8 | moving << 5
        return [*words_of("i", self.position()), 0, 0, 0, dss1, 0, dsse, 0, 0, 0, 0]


def iai() -> SimDevice:
    state = IaiState()

    async def action(
        function: int, start: int, address: int, count: int, current: list[int], values: list[Any] | None
    ) -> ExcCodes | None:
        if function == 5 and values is not None:
            state.coil(address, bool(values[0]))
        elif function == 16 and values is not None and address == 0x9900:
            if not (state.coils.get(0x0403) and state.homed):
                return ExcCodes.DEVICE_FAILURE
            target, _band, speed = struct.unpack(">iII", struct.pack(">6H", *values[:6]))
            state.move(target, speed)
        elif function == 3 and 0x9000 <= address <= 0x900B:
            current[0x9000 - start : 0x900C - start] = state.status()
        return None

    coils = [SimData(0x0400, values=[False] * 64, datatype=DataType.BITS)]
    inputs = [SimData(0x0100, values=[False] * 16, datatype=DataType.BITS)]
    holding = [
        SimData(0x9000, values=[0] * 12, datatype=DataType.REGISTERS),
        SimData(0x9900, values=[0] * 9, datatype=DataType.REGISTERS),
    ]
    unused = [SimData(0, values=[0], datatype=DataType.REGISTERS)]
    return SimDevice(1, (coils, inputs, holding, unused), action=action)


class LecState:
    """What an LEC's coils and step data do, and the discrete inputs that tell of it (docs/devices.md 2.2)."""

    def __init__(self) -> None:
        self.coils = dict.fromkeys(range(0x10, 0x40), False)
        self.seton = False
        self.held = False
        self.start = self.target = 0
        self.began_s = self.ends_s = 0.0

    def now_s(self) -> float:
        return asyncio.get_running_loop().time()

    def position(self) -> int:
        if self.now_s() >= self.ends_s:
            return self.target
        share = (self.now_s() - self.began_s) / (self.ends_s - self.began_s)
        return round(self.start + share * (self.target - self.start))

    def move(self, target: int, speed_mm_s: int) -> None:
        self.start, self.target = self.position(), target
        self.began_s = self.now_s()
        self.ends_s = self.began_s + abs(target - self.start) / (100 * speed_mm_s)

    def coil(self, address: int, on: bool) -> None:
        rising = on and not self.coils[address]
        self.coils[address] = on
        if address == 0x30 or not self.coils[0x30]:
            return
        if address == 0x1C and rising and self.coils[0x19]:
            self.seton = True
            self.move(0, 20)
        if address == 0x18 and rising:
            self.target, self.ends_s = self.position(), 0.0

    def begin(self, step: list[int]) -> ExcCodes | None:
        mode, speed, target = struct.unpack(">HHi", struct.pack(">4H", *step[:4]))
        ready = self.coils[0x30] and self.coils[0x19] and self.seton and not self.coils[0x18]
        if not ready or mode != 1 or not speed:
            return ExcCodes.DEVICE_FAILURE
        self.move(target, speed)
        return None

    def inputs(self) -> list[bool]:
        busy = self.now_s() < self.ends_s
        return [False] * 8 + [busy, self.coils[0x19], self.seton, not busy] + [False] * 4


def smc_lec() -> SimDevice:
    state = LecState()
    step = [0] * 16

    async def action(
        function: int, start: int, address: int, count: int, current: list[int], values: list[Any] | None
    ) -> ExcCodes | None:
        if function == 5 and values is not None:
            state.coil(address, bool(values[0]))
        elif function == 16 and values is not None and address == 0x9102:
            step[:] = values
        elif function == 6 and values is not None and address == 0x9100:
            return state.begin(step)
        elif function == 2:
            current[0] = sum(on << place for place, on in enumerate(state.inputs()))  # 40h to 4Fh, as one word
        elif function == 3 and 0x9000 <= address <= 0x9005:
            current[0x9000 - start : 0x9006 - start] = [*words_of("i", state.position()), 0, 0, 0, 0]
        return None

    coils = [SimData(0x10, values=[False] * 48, datatype=DataType.BITS)]
    inputs = [SimData(0x40, values=[False] * 16, datatype=DataType.BITS)]
    holding = [
        SimData(0x9000, values=[0] * 6, datatype=DataType.REGISTERS),
        SimData(0x9100, values=[0] * 18, datatype=DataType.REGISTERS),
    ]
    unused = [SimData(0, values=[0], datatype=DataType.REGISTERS)]
    return SimDevice(1, (coils, inputs, holding, unused), action=action)


def laumas_tlb() -> SimDevice:
    """A pull of 1.25: 1250 without point and sign, the sign in bit 7 of the status, which also says stable (bit 11)."""
    words = [101, 31, 2020, 42, 0, 0, 1 << 7 | 1 << 11, *words_of("I", 1250), *words_of("I", 250), 0, 0, 0]
    return SimDevice(1, [SimData(0, values=words, datatype=DataType.REGISTERS)])


def dad141_modbus() -> SimDevice:
    return SimDevice(
        1,
        [
            SimData(0x202C, values=[*words_of("I", 1411), *words_of("I", 0x0101)], datatype=DataType.REGISTERS),
            SimData(0x2034, values=words_of("I", 42), datatype=DataType.REGISTERS),
            SimData(0x3500, values=[*words_of("f", 1.25), *words_of("f", 0.25), 0x0030], datatype=DataType.REGISTERS),
        ],
    )


def joined_terminals() -> tuple[str, str]:
    """Two pseudo-terminals whose masters are joined here; the names of both slaves."""
    loop = asyncio.get_running_loop()
    (first, first_slave), (second, second_slave) = os.openpty(), os.openpty()
    for descriptor in (first, first_slave, second, second_slave):
        tty.setraw(descriptor)
    loop.add_reader(first, lambda: os.write(second, os.read(first, 4096)))
    loop.add_reader(second, lambda: os.write(first, os.read(second, 4096)))
    return os.ttyname(first_slave), os.ttyname(second_slave)


async def main(name: str) -> None:
    logging.getLogger("pymodbus.logging").setLevel(logging.CRITICAL)
    devices = {"orca": orca, "iai": iai, "smc_lec": smc_lec, "laumas_tlb": laumas_tlb, "dad141_modbus": dad141_modbus}
    device = devices[name]()
    if name == "dad141_modbus":
        server: Any = ModbusTcpServer(device, address=("127.0.0.1", 0))
        await server.serve_forever(background=True)
        url = f"socket://127.0.0.1:{server.transport.sockets[0].getsockname()[1]}"
    else:
        ours, url = joined_terminals()
        custom = [OrcaStream] if name == "orca" else None
        server = ModbusSerialServer(device, port=ours, baudrate=115200, custom_pdu=custom)
        await server.serve_forever(background=True)
    print(url, flush=True)
    await asyncio.get_running_loop().run_in_executor(None, sys.stdin.read)
    await server.shutdown()


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1]))
