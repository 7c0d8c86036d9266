"""Balances and weigh modules that speak MT-SICS (Mettler Toledo): continuous (`SIR`) or polled (`SI`).

Facts: docs/devices.md 3.2 and 7.4. Not confirmed there: how often a model sends (a configuration value, `rate`; asked
for by UPD, which not every model has), and how old its values are by its own filter (`timing.force_delay`).

These devices send the net value only, so the tare that they hold is asked for and added: what comes out is gross.
A tare that is set while they send changes the value unseen; it is asked for again at the end, and `stop` raises if it
changed. There is no checksum: a line that is not of the form is counted as a bad frame.
"""

from __future__ import annotations

import math
import re
from typing import Any, Literal

from drivers.dad141_lines import LineCutter
from drivers.errors import DeviceTimeout, ExceptionReply, FrameError, Overload, ReadbackError, UnexpectedReply
from drivers.lines import first_line
from drivers.loadcell import ForceSample, LoadCellIdentity
from drivers.polling import Polls
from drivers.timing import LineTimer
from drivers.wire import Exchange, Link, Pause, Steps

DEFAULT_BAUDRATE = 9600
REPLY_S = 0.5
POLL_TURNAROUND_S = 0.1
STANDSTILL_S = 15.0
"""How long the device may wait for a standstill before it answers S, T or Z."""

FIRST_LINE_S = 2.0
LINE_BYTES = 18
"""`S S `, ten characters of value, a space, a unit of one letter, CR LF; a longer unit adds its letters."""

ERRORS = {
    b"ES": "it does not know the command (syntax error)",
    b"ET": "it received something broken (transmission error): check baudrate and parity",
    b"EL": "it cannot do that (logical error)",
}
REFUSALS = {
    b"I": "not now (busy, or no standstill in time)",
    b"L": "wrong parameter",
    b"+": "overload",
    b"-": "underload",
}

_WEIGHT = re.compile(rb"S (?:([SD]) +([+-]?\d+(?:\.\d*)?) +(\S+)|([+-]|I)) *")
_TARE = re.compile(rb"TA A +([+-]?\d+(?:\.\d*)?) +(\S+) *")
_TEXT = re.compile(rb'\w+ A "([^"]*)".*')
_RATE = re.compile(rb'UPD A +"?(\d+(?:\.\d*)?)"? *')


class MtSics:
    """One balance on a link. Force in newtons: `newtons_per_unit` · (net + tare), in the unit that the device sends.

    `unit` is what the bench file says the device's number is in; a device that sends another one is refused.
    """

    def __init__(
        self,
        link: Link,
        *,
        name: str = "load_cell",
        unit: str = "g",
        newtons_per_unit: float = 9.80665e-3,
        capacity_N: float = math.inf,
        mode: Literal["continuous", "poll"] = "continuous",
        rate_hz: float | None = None,
    ) -> None:
        self.name = name
        self.link = link
        self.unit = unit
        self.mode = mode
        self.rate_hz = rate_hz
        self.lost_lines = 0
        self._newtons_per_unit = newtons_per_unit
        self._capacity_N = capacity_N
        self._tare: float | None = None
        self._updates_Hz: float | None = None
        self._cutter = LineCutter()
        self._timer = LineTimer()
        self._samples: list[ForceSample] = []
        self._polls = Polls(link, self._reading, self._interval_s)
        self._refused: bytes | None = None

    # -- set-up ------------------------------------------------------------------------------------------------

    def connect(self) -> Steps[LoadCellIdentity]:
        """End a stream that is still running, identify, ask for the tare and the update rate, take one reading.

        Raises `UnexpectedReply` where the device sends another unit than the bench file says.
        """
        yield from self._end_stream()
        serial = yield self._text("I4")
        details: dict[str, Any] = {"serial_number": serial}
        for key, command in (("model", "I2"), ("software", "I3"), ("level", "I1")):
            details[key] = yield from self._if_known(self._text(command))
        self._tare = yield from self._if_known(self._ask_tare())
        self._updates_Hz = yield from self._if_known(self._ask_rate())
        reading = yield self._reading()
        details |= {
            "unit": self.unit,
            "tare": self._tare,
            "update_rate": self._updates_Hz,
            "flags": list(reading.flags) if reading is not None else ["busy"],
        }
        return LoadCellIdentity("MT-SICS", details)

    def _if_known(self, exchange: Exchange[Any]) -> Steps[Any]:
        """What a device may not have: None where it refuses."""
        try:
            return (yield exchange)
        except (ExceptionReply, DeviceTimeout):
            return None

    def start(self) -> Steps[None]:
        """Continuous: have the device send by itself, wait for the first value. Poll: begin with the next call."""
        self._samples.clear()
        if self.mode == "poll":
            self._polls.begin()
            return
        self._cutter.clear()
        self._timer = LineTimer(1.0 / self.rate_hz if self.rate_hz else None)
        self._refused = None
        self.link.listener = self._listen
        yield _unanswered(b"SIR\r\n")
        end_s = self.link.clock.now() + FIRST_LINE_S
        while not self._samples:
            if self.link.broken is not None:
                raise self.link.broken
            if self._refused is not None:
                raise ExceptionReply(self.name, f"the device refuses continuous output (SIR): {ERRORS[self._refused]}")
            if self.link.clock.now() > end_s:
                raise DeviceTimeout(self.name, f"no value within {FIRST_LINE_S:g} s of asking for continuous output")
            yield Pause(0.005)

    def stop(self) -> Steps[None]:
        """End the stream, and see that the tare is still what it was; raises `ReadbackError` where it is not."""
        yield from self._polls.end()
        yield from self._end_stream()
        if self._tare is not None:
            tare = yield self._ask_tare()
            if tare != self._tare:
                raise ReadbackError(
                    self.name,
                    f"the device's tare was {self._tare:g} {self.unit} and is {tare:g} {self.unit}: somebody set it "
                    "meanwhile, and the forces since are wrong by as much",
                )

    def _end_stream(self) -> Steps[None]:
        """A single value ends the stream; behind the answer to the next question nothing of it can come any more."""
        self.link.listener = None
        self.lost_lines += self._timer.lost
        self._timer = LineTimer()
        self._cutter.clear()
        yield _unanswered(b"SI\r\n")
        yield self._text("I4")

    # -- zero, tare, standstill: for set-up by hand; a bench tares on the host ------------------------------------

    def stable(self) -> Steps[ForceSample]:
        """The value at a standstill (S). Raises `ExceptionReply` where there is none in time, `Overload` beyond."""
        sample = yield self._weight("S", STANDSTILL_S)
        if sample is None:
            raise ExceptionReply(self.name, "no standstill in time (S)")
        if sample.overload:
            raise Overload(self.name, "the weight is beyond the range")
        return sample  # type: ignore[no-any-return]  # the value of a yield is Any

    def zero(self, *, at_once: bool = False) -> Steps[None]:
        """Set the device's zero at a standstill (Z), or at once (ZI); its tare is cleared by that."""
        yield self._ask("ZI" if at_once else "Z", re.compile(rb"ZI [SD] *|Z A *"), STANDSTILL_S)
        self._tare = yield from self._if_known(self._ask_tare())

    def tare(self, *, at_once: bool = False) -> Steps[float]:
        """Set the device's tare at a standstill (T), or at once (TI); returns it in the device's unit."""
        command = "TI" if at_once else "T"
        pattern = re.compile(command.encode("ascii") + rb" [SD] +([+-]?\d+(?:\.\d*)?) +(\S+) *")
        match = yield self._ask(command, pattern, STANDSTILL_S)
        self._tare = float(match[1])
        return self._tare

    # -- samples -----------------------------------------------------------------------------------------------

    def samples(self) -> list[ForceSample]:
        """New samples, oldest first; in poll mode also submits the next poll when it is due."""
        if self._polls.running:
            self._samples += self._polls.serve()
        samples, self._samples = self._samples, []
        return samples

    def next_poll_s(self) -> float | None:
        """When the next poll is due; None when lines come by themselves, or the last poll is unanswered."""
        return self._polls.next_s()

    def latency_s(self) -> float:
        """Interval and wire: the age of the newest sample just before the next one comes."""
        return self._interval_s() + self.link.wire_s(LINE_BYTES)

    def _interval_s(self) -> float:
        if self.rate_hz is not None:
            return 1.0 / self.rate_hz
        wire_s = self.link.wire_s(LINE_BYTES + (4 if self.mode == "poll" else 0))
        return max(self._timer.interval_s or 0.0, 1.0 / self._updates_Hz if self._updates_Hz else 0.0, wire_s + 0.002)

    def _listen(self, data: bytes, received_s: float) -> None:
        """Take bytes of the stream. `S I` takes its place in it and gives no sample; broken lines are counted."""
        for line, behind in self._cutter.feed(data):
            if line in ERRORS:
                self._refused = line
                continue
            try:
                sample = self._sample(line, 0.0, received_s)
            except FrameError:
                self.link.traffic.bad_frames += 1
                self._timer.skip()
                continue
            if sample is None:
                self._timer.skip()
                continue
            # The stamp is that of the line's CR; the value was taken when the line began to be sent.
            (sent_s,) = self._timer.stamp([received_s - self.link.wire_s(behind)])
            sample.time_s = sent_s - self.link.wire_s(len(line) + 1)
            self._samples.append(sample)

    def _sample(self, line: bytes, time_s: float, received_s: float) -> ForceSample | None:
        """A reading, or None for `S I`; a value beyond the range has no number and stands as the capacity."""
        match = _WEIGHT.fullmatch(line)
        if match is None:
            raise FrameError(self.name, f"{line.decode('ascii', 'replace')!r} is no weight")
        if match[4] == b"I":
            return None
        if match[4] is not None:
            sign = math.copysign(1.0, self._newtons_per_unit) * (1.0 if match[4] == b"+" else -1.0)
            return ForceSample(time_s, received_s, sign * self._capacity_N, ("overload",), True)
        unit = match[3].decode("ascii", "replace")
        if unit != self.unit:
            raise UnexpectedReply(
                self.name, f"the device sends {unit}, the bench file says {self.unit}; set 'unit', or the device"
            )
        gross_N = (float(match[2]) + (self._tare or 0.0)) * self._newtons_per_unit
        overload = abs(gross_N) >= self._capacity_N
        words = (*(("stable",) if match[1] == b"S" else ()), *(("tared",) if self._tare else ()))
        return ForceSample(time_s, received_s, gross_N, (*words, "overload") if overload else words, overload)

    # -- exchanges ---------------------------------------------------------------------------------------------

    def _reading(self) -> Exchange[ForceSample | None]:
        return self._weight("SI", POLL_TURNAROUND_S)

    def _weight(self, command: str, turnaround_s: float) -> Exchange[ForceSample | None]:
        request = command.encode("ascii") + b"\r\n"
        wire_s = self.link.wire_s

        def parse(frame: bytes, sent_s: float, received_s: float) -> ForceSample | None:
            line = frame.rstrip(b"\r\n")
            self._raise_error(command, line)
            middle_s = 0.5 * (sent_s + wire_s(len(request)) + received_s - wire_s(len(frame)))
            return self._sample(line, min(middle_s, received_s - 1e-9), received_s)

        length = first_line(lambda line: line in ERRORS or line.startswith(b"S "))
        return Exchange(command, request, length, parse, turnaround_s + wire_s(LINE_BYTES + 4))

    def _text(self, command: str) -> Exchange[str]:
        return self._ask(command, _TEXT, REPLY_S, lambda match: match[1].decode("ascii", "replace"))

    def _ask_tare(self) -> Exchange[float]:
        return self._ask("TA", _TARE, REPLY_S, lambda match: float(match[1]))

    def _ask_rate(self) -> Exchange[float]:
        return self._ask("UPD", _RATE, REPLY_S, lambda match: float(match[1]))

    def _ask(
        self, command: str, pattern: re.Pattern[bytes], turnaround_s: float, convert: Any = lambda match: match
    ) -> Exchange[Any]:
        """A command and the line that answers it: one that begins with its name, or an error."""
        head = command.encode("ascii") + b" "

        def parse(frame: bytes, _sent_s: float, _received_s: float) -> Any:
            line = frame.rstrip(b"\r\n")
            self._raise_error(command, line)
            match = pattern.fullmatch(line)
            if match is None:
                raise UnexpectedReply(
                    self.name, f"the reply to {command} cannot be read: {line.decode('ascii', 'replace')!r}"
                )
            return convert(match)

        length = first_line(lambda line: line in ERRORS or line.startswith(head))
        repeatable = command not in ("T", "TI", "Z", "ZI")
        timeout_s = turnaround_s + self.link.wire_s(80)
        return Exchange(command, command.encode("ascii") + b"\r\n", length, parse, timeout_s, repeatable)

    def _raise_error(self, command: str, line: bytes) -> None:
        if line in ERRORS:
            raise ExceptionReply(self.name, f"the device refuses {command}: {ERRORS[line]}")
        status = line[len(command) + 1 :].strip()
        if not line.startswith(b"S ") and status in REFUSALS:
            if status in (b"+", b"-"):
                raise Overload(self.name, f"{command}: {REFUSALS[status]}")
            raise ExceptionReply(self.name, f"the device refuses {command}: {REFUSALS[status]}")


def _unanswered(request: bytes) -> Exchange[None]:
    return Exchange(request.decode("ascii").strip(), request, None, lambda _frame, _sent, _received: None, 0.0)
