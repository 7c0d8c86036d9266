"""Flintec / H&B DAD 141.1 load-cell amplifier, in its ASCII protocol: continuous (`SW`) or polled (`GW`).

The combined string is used in both, since it alone carries a checksum. Nothing is set up in the device: it is asked
how it is set. Facts: docs/devices.md 3.1 and 3.1.1. Not confirmed there, and treated so: the terminator of replies (CR
and CR LF are both taken), `ERR` as the text of a refusal, and what the strings show beyond the range (a full display,
or no number under a good checksum, counts as overload).
"""

from __future__ import annotations

import math
import re
from typing import Any, Literal

from drivers.dad141_filter import delay_s, output_interval_s
from drivers.dad141_lines import FULL_SCALE, LINE_SIZE, Combined, LineCutter, checksum, parse_combined
from drivers.errors import CrcError, DeviceTimeout, DriverError, ExceptionReply, Overload, UnexpectedReply
from drivers.lines import first_line
from drivers.loadcell import ForceSample, LoadCellIdentity
from drivers.polling import Polls
from drivers.timing import LineTimer
from drivers.wire import Exchange, Link, Pause, Steps

DEFAULT_BAUDRATE = 115200
REPLY_S = 0.4
"""Time-out for commands: the device's transmission delay can be set up to 255 ms."""

POLL_TURNAROUND_S = 0.05
FIRST_LINE_S = 0.5
BYTES_ON_WIRE = LINE_SIZE + 1

_VALUE = re.compile(rb"G(?:[+-]\d+(?:\.(\d*))?|[^\d+-]+)$")
_SETTING = re.compile(rb"([A-Z])[:+-]?(\d+)$")


class Dad141:
    """One amplifier on a link. Forces in newtons: `newtons_per_unit` · 10^-decimals · counts of the display."""

    def __init__(
        self,
        link: Link,
        *,
        name: str = "load_cell",
        address: int | None = None,
        newtons_per_unit: float = 1.0,
        capacity_N: float = math.inf,
        mode: Literal["continuous", "poll"] = "continuous",
        rate_hz: float | None = None,
        decimals: int | None = None,
        strict: bool = True,
    ) -> None:
        self.name = name
        self.link = link
        self.address = address
        self.mode = mode
        self.strict = strict
        self.rate_hz = rate_hz
        self.decimals = decimals
        self.filter_delay_s = 0.0
        self.lost_lines = 0
        self._device_interval_s = output_interval_s(0, False, 0)
        self._newtons_per_unit = newtons_per_unit
        self._capacity_N = capacity_N
        self._newtons_per_count = math.nan
        self._cutter = LineCutter()
        self._timer = LineTimer()
        self._samples: list[ForceSample] = []
        self._polls = Polls(link, self._combined, self._interval_s)
        self._refused = False

    # -- set-up ------------------------------------------------------------------------------------------------

    def connect(self) -> Steps[LoadCellIdentity]:
        """End a stream that is still running, identify, and ask for decimals, filter and averaging."""
        self._quiet()
        if self.address is not None:
            yield self._ask(f"OP {self.address}", rb"OK$")
        kind = yield self._ask("ID", rb"D:(\d+)$")
        version = yield self._ask("IV", rb"V:(\d+)$")
        if self.decimals is None:
            self.decimals = yield from self._ask_decimals()
        settings: dict[str, int | None] = {}
        for command in ("FL", "FM", "UR"):
            settings[command] = yield from self._setting(command)
        setup = (settings["FL"] or 0, settings["FM"] == 1, settings["UR"] or 0)
        self.filter_delay_s = delay_s(*setup)
        self._device_interval_s = output_interval_s(*setup)
        self._newtons_per_count = self._newtons_per_unit * 10.0**-self.decimals
        details: dict[str, Any] = {
            "id": kind[1].decode(),
            "firmware": version[1].decode(),
            "decimals": self.decimals,
            "resolution_N": abs(self._newtons_per_count),
            "filter": settings["FL"],
            "filter_mode": settings["FM"],
            "update_rate": settings["UR"],
            "filter_delay_s": self.filter_delay_s,
            "checksum": "strict" if self.strict else "off",
        }
        return LoadCellIdentity("Flintec DAD 141.1", details)

    def _ask_decimals(self) -> Steps[int]:
        """Decimal places, counted in a reading, or (where the display is beyond its range) by the setting DP."""
        shown = yield self._ask("GG", _VALUE.pattern)
        if shown[0][-1:].isdigit() or shown[0].endswith(b"."):
            return len(shown[1] or b"")
        places = yield from self._setting("DP")
        if places is None or places > 5:
            raise Overload(self.name, f"the display shows {shown[0].decode('ascii', 'replace')!r}: out of range")
        return places

    def _setting(self, command: str) -> Steps[int | None]:
        """A numeric setting; None where the device does not tell, since the form of these replies is not documented."""
        try:
            match = yield self._ask(command, _SETTING.pattern)
        except (DeviceTimeout, ExceptionReply):
            return None
        # What is no setting is not told: two to the power of it would be beyond all bounds.
        return int(match[2]) if len(match[2]) <= 9 and int(match[2]) < 100 else None

    def start(self) -> Steps[None]:
        """Continuous: have the device send by itself, wait for the first good line. Poll: begin with the next call."""
        if math.isnan(self._newtons_per_count):
            raise DriverError(self.name, "connect first: the resolution is not known yet")
        self._samples.clear()
        if self.mode == "poll":
            self._polls.begin()
            return
        self._cutter.clear()
        self._timer = LineTimer(1.0 / self.rate_hz if self.rate_hz else None)
        self._refused = False
        self.link.listener = self._listen
        bad_before = self.link.traffic.bad_frames
        yield Exchange("SW", b"SW\r", None, lambda _frame, _sent, _received: None, 0.0)
        end_s = self.link.clock.now() + FIRST_LINE_S
        while not self._samples:
            if self.link.broken is not None:
                raise self.link.broken
            if self._refused:
                raise ExceptionReply(self.name, "the device refuses continuous output (SW)")
            if self.link.clock.now() > end_s:
                bad = self.link.traffic.bad_frames - bad_before
                if bad:
                    raise CrcError(
                        self.name,
                        f"{bad} lines came and none of them was good; check baudrate and cable, or, where this "
                        "device's checksum is of another kind, say 'checksum: off'",
                    )
                raise DeviceTimeout(self.name, f"no line within {FIRST_LINE_S:g} s of asking for continuous output")
            yield Pause(0.005)

    def stop(self) -> Steps[None]:
        """End continuous output by a command that changes nothing, and wait for its answer."""
        self._polls.forget()
        self._quiet()
        yield self._ask("ID", rb"D:(\d+)$")

    def _quiet(self) -> None:
        self.link.listener = None
        self.lost_lines += self._timer.lost
        self._timer = LineTimer()
        self._cutter.clear()

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
        """Interval, wire and filter: the age of the newest sample just before the next one comes."""
        return self._interval_s() + self.link.wire_s(BYTES_ON_WIRE) + self.filter_delay_s

    def _interval_s(self) -> float:
        if self.rate_hz is not None:
            return 1.0 / self.rate_hz
        fastest = self._device_interval_s
        if self.mode == "poll":
            return max(fastest, self.link.wire_s(BYTES_ON_WIRE + 3) + self.link.gap_s + 0.002)
        return max(fastest, self.link.wire_s(BYTES_ON_WIRE + 1), self._timer.interval_s or 0.0)

    def _listen(self, data: bytes, received_s: float) -> None:
        """Take bytes of the stream; a line that is no good is counted, and its place in the stream kept."""
        traffic = self.link.traffic
        good: list[Combined] = []
        arrivals: list[float] = []
        for line, behind in self._cutter.feed(data):
            reading = self._reading(line)
            if reading is not None:
                good.append(reading)
                arrivals.append(received_s - self.link.wire_s(behind))
            elif line == b"ERR":
                self._refused = True
            elif line != b"OK":
                traffic.bad_frames += 1
                self._collect(good, arrivals, received_s)
                good, arrivals = [], []
                self._timer.skip(max(1, round(len(line) / LINE_SIZE)))
        self._collect(good, arrivals, received_s)

    def _collect(self, good: list[Combined], arrivals: list[float], received_s: float) -> None:
        # The value was taken when its line began to be sent, and is as old as the filter makes it.
        delay_s = self.link.wire_s(BYTES_ON_WIRE) + self.filter_delay_s
        for reading, sent_s in zip(good, self._timer.stamp(arrivals), strict=True):
            self._samples.append(self._sample(reading, sent_s - delay_s, received_s))

    def _reading(self, line: bytes) -> Combined | None:
        reading = parse_combined(line, strict=self.strict)
        if reading is None and len(line) == LINE_SIZE and line[:1] == b"W":
            # A good checksum around something that is no number: the display beyond its range, `u` below it.
            try:
                genuine = int(line[17:], 16) == checksum(line[:17])
            except ValueError:
                genuine = False
            if genuine:
                sign = -1 if line[8:15].strip(b"-u") == b"" else 1
                return Combined(sign * FULL_SCALE, sign * FULL_SCALE, ("over_range",))
        return reading

    def _sample(self, reading: Combined, time_s: float, received_s: float) -> ForceSample:
        gross_N = reading.gross * self._newtons_per_count
        flags = reading.flags
        overload = abs(gross_N) >= self._capacity_N or abs(reading.gross) >= FULL_SCALE
        return ForceSample(time_s, received_s, gross_N, (*flags, "overload") if overload else flags, overload)

    # -- exchanges ---------------------------------------------------------------------------------------------

    def _combined(self) -> Exchange[ForceSample | None]:
        wire_s = self.link.wire_s

        def parse(frame: bytes, sent_s: float, received_s: float) -> ForceSample:
            line = frame.strip(b"\r\n")
            reading = self._reading(line)
            if reading is None:
                raise CrcError(self.name, f"the reply to GW has no valid checksum: {line.decode('ascii', 'replace')!r}")
            middle_s = 0.5 * (sent_s + wire_s(3) + received_s - wire_s(len(frame)))
            return self._sample(reading, middle_s - self.filter_delay_s, received_s)

        return self._line_exchange("GW", re.compile(rb"W.*$"), parse, POLL_TURNAROUND_S)

    def _ask(self, command: str, pattern: bytes) -> Exchange[re.Match[bytes]]:
        compiled = re.compile(pattern)

        def parse(frame: bytes, _sent_s: float, _received_s: float) -> re.Match[bytes]:
            match = compiled.search(frame.strip(b"\r\n"))
            if match is None:
                raise UnexpectedReply(self.name, f"the reply to {command} cannot be read")
            return match

        return self._line_exchange(command, compiled, parse, REPLY_S)

    def _line_exchange(
        self, command: str, pattern: re.Pattern[bytes], parse: Any, turnaround_s: float
    ) -> Exchange[Any]:
        """A command and the first line that answers it; lines of a stream that still come are skipped."""

        length = first_line(lambda line: line.endswith(b"ERR") or pattern.search(line))

        def parse_or_refuse(frame: bytes, sent_s: float, received_s: float) -> Any:
            if frame.strip(b"\r\n").endswith(b"ERR"):
                raise ExceptionReply(self.name, f"the device refuses {command!r}")
            return parse(frame, sent_s, received_s)

        timeout_s = turnaround_s + self.link.wire_s(BYTES_ON_WIRE + 1)
        return Exchange(command, f"{command}\r".encode("ascii"), length, parse_or_refuse, timeout_s)
