"""A load-cell amplifier that a register map describes; it is polled."""

from __future__ import annotations

import math

from drivers.errors import UnexpectedReply
from drivers.loadcell import ForceSample, LoadCellIdentity
from drivers.modbus import ModbusClient
from drivers.polling import Polls
from drivers.registers import HOST_SLACK_S
from drivers.regmap import LoadCellMap
from drivers.sequence import Signals
from drivers.wire import Exchange, Link, Steps

PLAUSIBLE = (1e-12, 1e12)
"""A reading that is not zero and lies outside of this has its words in the wrong order."""


class RegisterLoadCell:
    """One amplifier on a link, read as its map says. `gross` is multiplied by `newtons_per_unit`."""

    def __init__(
        self,
        link: Link,
        device: LoadCellMap,
        *,
        name: str = "load_cell",
        address: int = 1,
        newtons_per_unit: float = 1.0,
        capacity_N: float = math.inf,
        rate_hz: float | None = None,
    ) -> None:
        self.name = name
        self.link = link
        self.map = device
        self.rate_hz = rate_hz or device.poll_rate
        self._newtons_per_unit = newtons_per_unit
        self._capacity_N = capacity_N
        self._modbus = ModbusClient(
            link, address, transport=device.link.transport, turnaround_s=device.reply.turnaround_s + HOST_SLACK_S
        )
        self._signals = Signals(name, device, self._modbus)
        block_name = device.block_of(device.values["gross"])
        assert block_name is not None
        self._block_name = block_name
        self._block = device.blocks[block_name]
        self._polls = Polls(link, self._exchange, lambda: 1.0 / self.rate_hz)

    def connect(self) -> Steps[LoadCellIdentity]:
        """Read what the map names under `identify`, and one sample; raises where the number makes no sense."""
        details = yield from self._signals.identify()
        sample = yield self._exchange()
        shown = abs(sample.gross_N / self._newtons_per_unit)
        low, high = PLAUSIBLE
        if not math.isfinite(shown) or shown > high or 0.0 < shown < low:
            raise UnexpectedReply(
                self.name,
                f"the device shows {shown:g}, which is no force; its words may come in the other order "
                "(word_order in the register map)",
            )
        details |= {"map": self.map.name, "word_order": self.map.word_order, "flags": list(sample.flags)}
        return LoadCellIdentity(self.map.title or self.map.name, details)

    def start(self) -> Steps[None]:
        """Begin to poll with the next call of `samples`."""
        self._polls.begin()
        yield from ()

    def samples(self) -> list[ForceSample]:
        """New samples; submits the next poll when it is due and the last one is answered."""
        return self._polls.serve()

    def stop(self) -> Steps[None]:
        """Poll no more, and let the last poll be answered."""
        yield from self._polls.end()

    def latency_s(self) -> float:
        """Poll interval, and the exchange on the wire."""
        return 1.0 / self.rate_hz + self.link.wire_s(8 + 5 + 2 * self._block.count) + self.map.reply.turnaround_s

    def next_poll_s(self) -> float | None:
        """When the next poll is due; None while the last one is unanswered, or the port is lost."""
        return self._polls.next_s()

    def _exchange(self) -> Exchange[ForceSample | None]:
        return self._modbus.sample_registers(
            "input" if self._block.table == "input" else "holding",
            self._block.address,
            self._block.count,
            self._sample,
        )

    def _sample(self, words: list[int], time_s: float, received_s: float) -> ForceSample:
        signals = self._signals
        signals.take_bits(self._block_name, words)
        gross_N = signals.number(self.map.values["gross"], self._block, words) * self._newtons_per_unit
        overload = abs(gross_N) >= self._capacity_N or any(signals.bits[bit] for bit in self.map.overload)
        flags = tuple(bit for bit in self.map.flags if signals.bits[bit])
        return ForceSample(time_s, received_s, gross_N, (*flags, "overload") if overload else flags, overload)
