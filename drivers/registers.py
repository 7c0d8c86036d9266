"""A motor that a register map describes: no code a device, one YAML file (see `regmap`).

The device makes its own profiles; the bench polls. The motor's sign is the bench file's `direction`: positive is
into the pad for positions and forces, speeds and accelerations are magnitudes.
"""

from __future__ import annotations

from typing import Any, Literal

from drivers.errors import DriverError, ReadbackError
from drivers.modbus import ModbusClient
from drivers.motor import MotorIdentity, MotorLimits, MotorSample, SafeState
from drivers.regmap import MotorMap, Value, WriteBlock
from drivers.sequence import Sequencer, Signals, code_name, raw_number
from drivers.values import encode
from drivers.wire import Exchange, Link, Steps

HOST_SLACK_S = 0.02
"""Allowance for the host's own scheduling and the adapter, on top of the device's documented reply time."""

FAULT_BIT_SHIFT = 32
"""A sample's fault word: the device's own number below, the map's fault bits from here up."""


class RegisterMotor:
    """One axis on a link, driven as its map says."""

    kind: Literal["stream", "move"] = "move"

    def __init__(
        self, link: Link, device: MotorMap, *, name: str = "motor", address: int = 1, direction: int = 1
    ) -> None:
        self.name = name
        self.link = link
        self.map = device
        self.direction = direction
        self._modbus = ModbusClient(
            link,
            address,
            transport=device.link.transport,
            turnaround_s=device.reply.turnaround_s + HOST_SLACK_S,
            reply_delay_s=1e-3 * device.reply.delay_ms,
        )
        self._signals = Signals(name, device, self._modbus)
        self._written: dict[str, tuple[Value, list[int]]] = {}
        self._sequencer = Sequencer(self._signals, device.faults)
        name_of_block = device.block_of(device.values["position"])
        assert name_of_block is not None
        self._block_name = name_of_block
        self._block = device.blocks[name_of_block]
        self._others = [block for block in device.blocks if block != name_of_block]
        self._next_other = 0

    @property
    def has_watchdog(self) -> bool:
        """Whether the device stops by itself when the host is gone."""
        return "watchdog" in self.map.clamps

    @property
    def slowest_mm_s(self) -> float:
        """The slowest speed that a move can be told: the device's count, or the map's bound; 0 where it has neither."""
        fields = [field for step in self.map.move if isinstance(step, WriteBlock) for field in step.fields]
        speeds = [field for field in fields if field.variable == "speed"]
        return max((field.factor * (field.min or float(field.type != "f32")) for field in speeds), default=0.0)

    # -- identity and clamps -----------------------------------------------------------------------------------

    def connect(self) -> Steps[MotorIdentity]:
        """Read what the map names under `identify`, run its `connect` steps, and take one sample."""
        details = yield from self._signals.identify()
        yield from self._sequencer.run(self.map.connect, {})
        sample = yield self.read()
        yield from self._signals.refresh(self.map.bits)
        details |= {
            "map": self.map.name,
            "position_mm": sample.position_mm,
            "faults": list(self.fault_names(sample.fault)),
            "bits": sorted(bit for bit, state in self._signals.bits.items() if state),
        }
        return MotorIdentity(self.map.title or self.map.name, details)

    def prepare(self, limits: MotorLimits) -> Steps[dict[str, Any]]:
        """Write the clamps the map has registers for, and read them back; says so where there are none."""
        held: dict[str, Any] = {}
        low, high = sorted(position * self.direction for position in limits.position_mm)
        wanted = {
            "speed": limits.speed_mm_s,
            "acceleration": limits.acceleration_mm_s2,
            "force": limits.force_N,
            "position_low": low,
            "position_high": high,
            "watchdog": limits.watchdog_s,
        }
        for clamp, value_name in self.map.clamps.items():
            value = self.map.values[value_name]
            words = self._encoded(clamp, wanted[clamp] / value.factor, value_name)
            yield self._modbus.write_registers(value.address, words)
            back = yield self._modbus.read_registers(value.table, value.address, value.words)
            if back != words:
                raise ReadbackError(
                    self.name, f"{clamp}: wrote {words} to register {value.address:#06x}, the device holds {back}"
                )
            held[clamp] = wanted[clamp]
            self._written[clamp] = value, words
        held["not_clamped"] = sorted(wanted.keys() - self.map.clamps.keys())
        return held

    def held(self) -> Steps[None]:
        """The clamps once more."""
        for clamp, (value, words) in self._written.items():
            back = yield self._modbus.read_registers(value.table, value.address, value.words)
            if back != words:
                raise ReadbackError(
                    self.name,
                    f"the device has restarted: {clamp} is {back} in register {value.address:#06x}, no longer {words}",
                )

    def _encoded(self, what: str, counts: float, value_name: str) -> list[int]:
        value = self.map.values[value_name]
        try:
            return encode(counts, value.type, self.map.word_order)
        except ValueError as error:
            raise DriverError(self.name, f"{what}: {error}") from error

    # -- verbs -------------------------------------------------------------------------------------------------

    def energise(self) -> Steps[None]:
        """The map's `energise`."""
        yield from self._sequencer.run(self.map.energise, self.map.constants)

    def is_homed(self) -> Steps[bool]:
        """The map's bit `homed`; a device without one counts its position absolutely."""
        if "homed" not in self.map.bits:
            return True
        yield from self._signals.refresh(["homed"])
        return self._signals.bits["homed"]

    def home(self) -> Steps[None]:
        """The map's `home`."""
        if not self.map.home:
            raise DriverError(self.name, "the register map has no way to home this device; home it by its own means")
        yield from self._sequencer.run(self.map.home, self.map.constants)
        if not (yield from self.is_homed()):
            raise ReadbackError(self.name, "homing ended, but the device does not report that it is homed")

    def move(self, target_mm: float, speed_mm_s: float, acceleration_mm_s2: float) -> Steps[None]:
        """The map's `move`; the device has taken it when this returns. Refuses what the map's bounds do not allow."""
        variables = self._variables(target_mm, speed_mm_s, acceleration_mm_s2)
        yield from self._sequencer.run(self.map.move, variables)

    def as_written(self, target_mm: float, speed_mm_s: float, acceleration_mm_s2: float) -> tuple[float, float, float]:
        """The move that the device will make of it: target, speed, acceleration after rounding to its units.

        Raises `DriverError` where one of them is outside of what the device takes.
        """
        variables = self._variables(target_mm, speed_mm_s, acceleration_mm_s2)
        taken = dict(variables)
        for step in self.map.move:
            if isinstance(step, WriteBlock):
                for field in step.fields:
                    if field.variable in variables:
                        taken[field.variable] = raw_number(self.name, field, variables) * field.factor
        return taken["target"] * self.direction, taken["speed"], taken["acceleration"]

    def _variables(self, target_mm: float, speed_mm_s: float, acceleration_mm_s2: float) -> dict[str, float]:
        return {
            **self.map.constants,
            "target": target_mm * self.direction,
            "speed": speed_mm_s,
            "acceleration": acceleration_mm_s2,
        }

    def perform(self, action: str, **variables: float) -> Steps[None]:
        """One of the map's `actions`, with its variables in base units; `target` in the motor frame, mm.

        For what a bench does not need and a device can do (an alarm's reset, a push with a limited current). Raises
        `DriverError` for an action or variables that the map does not have, and as any steps do.
        """
        known = self.map.actions
        if action not in known:
            raise DriverError(self.name, f"the register map has no action {action!r} ({', '.join(known) or 'none'})")
        takes = known[action].takes
        if set(takes) != variables.keys():
            raise DriverError(self.name, f"the action {action!r} takes {', '.join(takes) or 'nothing'}, all of them")
        if "target" in variables:
            variables["target"] *= self.direction
        yield from self._sequencer.run(known[action].steps, {**self.map.constants, **variables})

    def stream(self, position_mm: float) -> Exchange[MotorSample]:
        """Not with this motor: it makes its own profiles; raises `DriverError`."""
        raise DriverError(self.name, "this motor makes its own profiles; it follows no stream of positions")

    def stop(self) -> Steps[None]:
        """The map's `stop`; a fault does not keep it from being tried."""
        yield from self._sequencer.run(self.map.stop, self.map.constants, faults_count=False)

    def safe_state(self, state: SafeState) -> Steps[dict[str, Any]]:
        """The map's `release` or `hold`, then `servo_on` read back."""
        release = state == "release"
        steps = self.map.release if release else self.map.hold
        yield from self._sequencer.run(steps, self.map.constants, faults_count=False)
        sample = yield self.read()
        yield from self._signals.refresh(self.map.bits)
        servo_on = self._signals.bits["servo_on"]
        if servo_on == release:
            raise ReadbackError(
                self.name, f"asked to {'release' if release else 'hold'}, the servo reads {'on' if servo_on else 'off'}"
            )
        return {
            "state": "release" if release else "hold",
            "servo_on": servo_on,
            "position_mm": sample.position_mm,
            "errors": list(self.fault_names(sample.fault)),
        }

    # -- samples -----------------------------------------------------------------------------------------------

    def read(self) -> Exchange[MotorSample]:
        """Position, and whatever of force, fault and `moving` the map has.

        Where bits lie in other blocks than the position, each call has one of those read along with the sample, in
        turn; a sample's `moving` and faults are then as old as that.
        """
        if self._others:
            self._read_along()
        return self._modbus.sample_registers(
            self._block.table if self._block.table == "input" else "holding",
            self._block.address,
            self._block.count,
            self._sample,
        )

    def _read_along(self) -> None:
        name = self._others[self._next_other]
        self._next_other = (self._next_other + 1) % len(self._others)
        exchange = self._signals.poll(name)
        parse = exchange.parse

        def parse_and_note(frame: bytes, sent_s: float, received_s: float) -> Any:
            words = parse(frame, sent_s, received_s)
            self._signals.take_bits(name, words)
            return words

        exchange.parse = parse_and_note
        self.link.submit(exchange)

    def _sample(self, words: list[int], time_s: float, received_s: float) -> MotorSample:
        signals, values = self._signals, self.map.values
        signals.take_bits(self._block_name, words)
        fault = 0
        force = None
        if "fault" in values:
            fault = signals.raw(values["fault"], self._block, words) & 0xFFFF_FFFF
        for index, bit in enumerate(self.map.faults):
            if signals.bits.get(bit):
                fault |= 1 << FAULT_BIT_SHIFT + index
        if "force" in values:
            force = signals.number(values["force"], self._block, words) * self.direction
        return MotorSample(
            time_s,
            received_s,
            signals.number(values["position"], self._block, words) * self.direction,
            force,
            fault,
            signals.bits.get("moving"),
        )

    def fault_names(self, fault: int) -> tuple[str, ...]:
        """The map's fault bits by name, and the device's own code with its meaning, where the map has it."""
        names = [bit for index, bit in enumerate(self.map.faults) if fault >> FAULT_BIT_SHIFT + index & 1]
        code = fault & 0xFFFF_FFFF
        if code:
            names.append(code_name(self.map, code))
        return tuple(names)
