"""Runs the steps of a register map: writes in order, waits for bits, reads back."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, assert_never

from drivers.errors import DeviceFault, DeviceTimeout, DriverError, ReadbackError
from drivers.modbus import ModbusClient
from drivers.regmap import (
    AnyStep,
    Bit,
    Block,
    Check,
    Compare,
    LoadCellMap,
    MotorMap,
    PauseStep,
    Value,
    Wait,
    WriteBlock,
    WriteCoil,
    WriteRegister,
    Written,
)
from drivers.values import WordOrder, decode, encode
from drivers.wire import Exchange, Pause, Steps

Words = list[int] | list[bool]

RESET_S = 0.5
"""A fault code that was there as a wait began may be one that is just being reset: it counts after so long."""

STANDS_MM = 0.05
"""An axis that is on its way, and goes no further than that, stands still: more than an encoder's last digits."""


class Signals:
    """The values and bits of a map, and how to get them out of what a poll of a block returns."""

    def __init__(self, name: str, device: MotorMap | LoadCellMap, modbus: ModbusClient) -> None:
        self.name = name
        self.map = device
        self.modbus = modbus
        self.block_of_bit = {bit: device.block_of(item) for bit, item in device.bits.items()}
        self.bits: dict[str, bool] = {}
        """Every bit as it was read last."""

        self.words: dict[str, Words] = {}
        """Every block as it was read last."""

    def number(self, value: Value, block: Block, words: Words) -> float:
        """A value in base units (mm, mm/s, mm/s², N, s; or its plain number), out of the block it lies in."""
        at = value.address - block.address
        number = decode(words[at : at + value.words], value.type, self.map.word_order) * value.factor
        # The bit of the sign lies in the same block, and was taken from the same words.
        return -number if value.negative is not None and self.bits[value.negative] else number

    def raw(self, value: Value, block: Block, words: Words) -> int:
        """A value's whole number as it is in the device."""
        at = value.address - block.address
        return int(decode(words[at : at + value.words], value.type, self.map.word_order))

    def take_bits(self, block_name: str, words: Words) -> None:
        """Note all bits that lie in a block."""
        block = self.map.blocks[block_name]
        self.words[block_name] = words
        for bit, item in self.map.bits.items():
            if self.block_of_bit[bit] == block_name:
                self.bits[bit] = _bit_of(item, words[item.address - block.address])

    def poll(self, block_name: str) -> Exchange[Any]:
        """An exchange that reads a block; give its words to `take_bits`."""
        block = self.map.blocks[block_name]
        if block.table == "coil" or block.table == "discrete":
            return self.modbus.read_bits(block.table, block.address, block.count)
        return self.modbus.read_registers(block.table, block.address, block.count)

    def refresh(self, bits: Iterable[str], values: Iterable[str] = ()) -> Steps[None]:
        """Read the blocks that these bits and values lie in."""
        blocks = {self.block_of_bit[bit] for bit in bits} | {
            self.map.block_of(self.map.values[name]) for name in values
        }
        for block in self.map.blocks:
            if block in blocks:
                self.take_bits(block, (yield self.poll(block)))

    def code(self) -> int:
        """The device's own fault code as it was read last; 0 for none, or where the map has none."""
        value = self.map.values.get("fault") if isinstance(self.map, MotorMap) else None
        if value is None:
            return 0
        name = self.map.block_of(value) or ""
        return self.raw(value, self.map.blocks[name], self.words[name]) & 0xFFFF_FFFF if name in self.words else 0

    def position(self) -> float:
        """A motor's position as it was read last, mm, in the device's direction."""
        value = self.map.values["position"]
        name = self.map.block_of(value) or ""
        return self.number(value, self.map.blocks[name], self.words[name])

    def read_value(self, name: str) -> Steps[float]:
        """One value, read by itself, in base units."""
        value = self.map.values[name]
        words = yield self.modbus.read_registers(value.table, value.address, value.words)
        return decode(words, value.type, self.map.word_order) * value.factor

    def identify(self) -> Steps[dict[str, Any]]:
        """The values that the map names under `identify`, by name."""
        details: dict[str, Any] = {}
        for name in self.map.identify:
            details[name] = yield from self.read_value(name)
        return details


class Sequencer:
    """Runs lists of steps with variables in base units."""

    def __init__(self, signals: Signals, faults: Iterable[str]) -> None:
        self.name = signals.name
        self.signals = signals
        self.modbus = signals.modbus
        self.order: WordOrder = signals.map.word_order
        self.faults = tuple(faults)

    def run(
        self, steps: Iterable[AnyStep], variables: Mapping[str, float], *, faults_count: bool = True
    ) -> Steps[None]:
        """One step after the other.

        Waiting ends with `DeviceFault` as soon as one of the map's fault bits is on or its fault code is not 0, unless
        `faults_count` is False (a device with a fault must still be stopped and released), and where a position that
        is to change stands still; with `DeviceTimeout` when time is up.
        """
        for step in steps:
            if isinstance(step, (WriteCoil, WriteRegister, WriteBlock)) and step.when:
                yield from self.signals.refresh(step.when)
                if any(self.signals.bits[bit] != state for bit, state in step.when.items()):
                    continue
            if isinstance(step, WriteCoil):
                yield self.modbus.write_coil(step.coil, step.to, repeatable=not step.edge)
            elif isinstance(step, WriteRegister):
                yield self.modbus.write_register(step.register_, step.to, repeatable=not step.edge)
            elif isinstance(step, WriteBlock):
                words = block_words(self.name, step.fields, variables, self.order)
                yield self.modbus.write_registers(step.registers, words, repeatable=not step.edge)
            elif isinstance(step, Wait):
                yield from self._wait(step, faults_count)
            elif isinstance(step, Check):
                yield from self.signals.refresh(step.check)
                self._report_fault(step.message, step.check)
            elif isinstance(step, Compare):
                yield from self._compare(step, variables)
            elif isinstance(step, PauseStep):
                yield Pause(step.pause_s)
            else:
                assert_never(step)

    def _wait(self, step: Wait, faults_count: bool) -> Steps[None]:
        clock = self.modbus.link.clock
        begun_s = clock.now()
        watched = [*step.wait, *(self.faults if faults_count else ())]
        also = ["position"] if step.stuck_s is not None else []
        if faults_count and isinstance(self.signals.map, MotorMap) and "fault" in self.signals.map.values:
            also.append("fault")
        standing: tuple[float, float] | None = None
        earlier: int | None = None
        while True:
            yield from self.signals.refresh(watched, also)
            bits, now_s = self.signals.bits, clock.now()
            if all(bits[bit] == state for bit, state in step.wait.items()):
                return
            if faults_count:
                code = self.signals.code()
                earlier = code if earlier is None else earlier
                self._look_at_faults(step, code if code != earlier or now_s - begun_s > RESET_S else 0)
            wrong = ", ".join(f"{bit} is {_word(bits[bit])}" for bit, state in step.wait.items() if bits[bit] != state)
            if step.stuck_s is not None:
                at_mm = self.signals.position()
                if standing is None or abs(at_mm - standing[1]) > STANDS_MM:
                    standing = now_s, at_mm
                elif now_s - standing[0] > step.stuck_s:
                    raise DeviceFault(
                        self.name,
                        f"{step.message}: its position has stood still at {at_mm:.2f} mm for {step.stuck_s:g} s, "
                        f"and {wrong}; something holds it, or it does not push",
                    )
            if now_s >= begun_s + step.within_s:
                raise DeviceTimeout(self.name, f"{step.message} within {step.within_s:g} s ({wrong})")
            yield Pause(step.every_s)

    def _look_at_faults(self, step: Wait, code: int) -> None:
        """Raise where a fault bit is on, or the device has a code to tell."""
        active = [bit for bit in self.faults if self.signals.bits[bit]]
        if code:
            active.append(code_name(self.signals.map, code))
        if active:
            raise DeviceFault(self.name, f"{step.message}: {', '.join(active)}", code, tuple(active))

    def _report_fault(self, message: str, wanted: Mapping[str, bool]) -> None:
        wrong = [bit for bit, state in wanted.items() if self.signals.bits[bit] != state]
        if wrong:
            raise DeviceFault(self.name, message, names=tuple(wrong))

    def _compare(self, step: Compare, variables: Mapping[str, float]) -> Steps[None]:
        wanted = variables[step.equals] if isinstance(step.equals, str) else step.equals
        held = yield from self.signals.read_value(step.readback)
        if abs(held - wanted) > step.tolerance:
            raise ReadbackError(self.name, f"{step.readback} should be {wanted:g}, the device holds {held:g}")


def code_name(device: MotorMap | LoadCellMap, code: int) -> str:
    """A device's own fault code, with its meaning where the map has it."""
    meaning = device.codes.get(code) if isinstance(device, MotorMap) else None
    return f"code {code:#06x}" + (f" ({meaning})" if meaning else "")


def raw_number(name: str, field: Written, variables: Mapping[str, float]) -> float:
    """What is written for a field, in counts; raises `DriverError` where that is outside of the map's bounds."""
    value = variables[field.variable] if field.variable is not None else field.to
    assert value is not None
    counts = value / (field.scale if field.variable is None else field.factor)
    if field.type != "f32":
        counts = round(counts)
    low, high = field.min, field.max
    if (low is not None and counts < low) or (high is not None and counts > high):
        what = field.variable or "a constant"
        raise DriverError(
            name,
            f"{what} {value:g} is {counts:g} in the device's unit, outside of what it takes "
            f"({'' if low is None else f'{low:g}'} to {'' if high is None else f'{high:g}'})",
        )
    return counts


def block_words(name: str, fields: Iterable[Written], variables: Mapping[str, float], order: WordOrder) -> list[int]:
    """The registers of one block write."""
    words: list[int] = []
    for field in fields:
        counts = raw_number(name, field, variables)
        try:
            words += encode(counts, field.type, order)
        except ValueError as error:
            raise DriverError(name, f"{field.variable or 'a constant'}: {error}") from error
    return words


def _bit_of(item: Bit, word: int | bool) -> bool:
    state = bool(word) if item.bit is None else bool(word >> item.bit & 1)
    return state == bool(item.true_when)


def _word(state: bool) -> str:
    return "on" if state else "off"
