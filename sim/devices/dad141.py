"""Flintec / H&B DAD 141.1 on its serial line: the ASCII protocol.

Sources: docs/devices.md 3.1 and 3.1.1; DAD 141.1 Technical Manual rev. 2.5 (H&B), chapters 9 and 10: forms of replies,
refusals, what needs an open calibration (CE), what takes effect after saving and restarting.

Not documented, and chosen here: replies end with CR LF; 1 ms passes before a reply; UR, NR, NT and TD are reported
like their neighbours; over-range shows as seven `o` (documented for the indication) in every string, under-range
as seven `u`; a string that is being sent is finished when a command stops the continuous output.
"""

from __future__ import annotations

from collections.abc import Callable, Container
from typing import TypeAlias

from sim.clock import Event
from sim.devices.amplifier import CONVERSIONS_PER_S, Amplifier
from sim.line import Line

REPLY_DELAY_S = 0.001
RESET_S = 0.4
BAUDRATES = (9600, 19200, 38400, 57600, 115200)
IDENTITY = "D:1410"
FIRMWARE = "V:0101"
SERIAL = "S+00147301"
_Number: TypeAlias = tuple[str, Callable[[], int], Callable[[int], None], Container[int], bool]
STEPS = (1, 2, 5, 10, 20, 50, 100, 200, 500)


class Dad141:
    """The device: parses commands, answers, and sends by itself while it is told to."""

    def __init__(self, line: Line, amplifier: Amplifier, address: int = 0) -> None:
        self.line = line
        self.amplifier = amplifier
        self.address = address
        self.open = address == 0
        self.transmit_delay_ms = 0
        self.calibration_open = False
        self.calibration_counter = 17
        self.lines_sent = 0
        self.refuse: Callable[[float], int | None] | None = None
        """A fault: commands at a time are answered with `ERR` where this gives a number."""
        self._buffer = bytearray()
        self._stream: Callable[[float], str] | None = None
        self._line_event: Event | None = None
        self._deaf_until_s = 0.0
        self._sent_output = True
        self._stored = {"AD": address, "BR": line.baudrate}
        line.device = self
        amplifier.on_output = self._on_output
        self._actions = self._action_table()
        self._numbers = self._number_table()

    # -- commands ----------------------------------------------------------------------------------------------

    def receive(self, data: bytes, at_s: float) -> None:
        """Take bytes; each command ends with CR, line feeds are ignored."""
        if at_s < self._deaf_until_s:
            return
        self._buffer += data
        while (end := self._buffer.find(b"\r")) >= 0:
            text = bytes(self._buffer[:end]).replace(b"\n", b"").decode("ascii", "replace")
            del self._buffer[: end + 1]
            if text:
                self._command(text, at_s)
        del self._buffer[:-64]

    def _command(self, text: str, at_s: float) -> None:
        name, argument = text[:2], text[2:].strip()
        if not self._listening(name, argument):
            return
        reply_s = at_s + REPLY_DELAY_S + self.transmit_delay_ms * 1e-3
        if self.refuse is not None and self.refuse(at_s) is not None:
            self._write("ERR", reply_s)
            return
        if name in _CONTINUOUS and not argument:
            self._halt_stream()
            self._stream = getattr(self, _CONTINUOUS[name])
            self._line_event = self.line.clock.schedule(reply_s, self._send_line)
            return
        if name in _GETS and (not argument or name == "ON"):
            self._halt_stream()
            form = getattr(self, _GETS[name])

            def send(now_s: float) -> None:
                self._write(form(now_s), now_s)

            self.line.clock.schedule(reply_s, send)
            return
        reply = self._reply(name, argument, at_s)
        if reply != "ERR":
            self._halt_stream()
        if reply:
            self._write(reply, reply_s)

    def _listening(self, name: str, argument: str) -> bool:
        """Bus selection: a device of address 0 is always open; others open with `OP n` and close with `CL`."""
        if name == "OP" and argument.isdigit():
            self.open = self.address == 0 or int(argument) == self.address
        if name == "ON":
            return argument == str(self.address)
        return self.open

    def _reply(self, name: str, argument: str, at_s: float) -> str:
        if name in self._actions and not argument:
            return self._actions[name](at_s)
        if name in self._numbers:
            return self._number(name, argument)
        if name == "OP":
            return "OK" if argument.isdigit() else f"O:{self.address:03d}" if not argument else "ERR"
        if name == "CE" and argument:
            self.calibration_open = argument == str(self.calibration_counter)
            return "OK" if self.calibration_open else "ERR"
        return "ERR"

    def _number(self, name: str, argument: str) -> str:
        form, get, put, allowed, protected = self._numbers[name]
        if not argument:
            return form.format(get())
        try:
            value = int(argument)
        except ValueError:
            return "ERR"
        if value not in allowed or (protected and not self.calibration_open):
            return "ERR"
        put(value)
        return "OK"

    def _action_table(self) -> dict[str, Callable[[float], str]]:
        amplifier = self.amplifier

        def done(act: Callable[[], None]) -> Callable[[float], str]:
            def run(at_s: float) -> str:
                act()
                return "OK"

            return run

        return {
            "ID": lambda at_s: IDENTITY,
            "IV": lambda at_s: FIRMWARE,
            "RS": lambda at_s: SERIAL,
            "IS": lambda at_s: f"S:{self._status(at_s):03d}000",
            "BR": lambda at_s: f"B {self._stored['BR']}",
            "CE": lambda at_s: f"E+{self.calibration_counter:05d}",
            "ST": lambda at_s: "OK" if amplifier.set_tare(at_s) else "ERR",
            "SZ": lambda at_s: "OK" if amplifier.set_zero(at_s) else "ERR",
            "RT": done(amplifier.reset_tare),
            "RZ": done(amplifier.reset_zero),
            "RM": self._reset_peak,
            "TH": self._hold,
            "WP": lambda at_s: "OK",
            "CS": self._save_calibration,
            "SR": self._restart,
            "CL": self._close,
        }

    def _number_table(self) -> dict[str, _Number]:
        """By command: form of the report, getter, setter, values allowed, whether an open calibration is needed."""
        amplifier = self.amplifier
        store = self._stored

        def attribute(name: str) -> tuple[Callable[[], int], Callable[[int], None]]:
            return (lambda: int(getattr(amplifier, name))), (lambda value: setattr(amplifier, name, value))

        table: dict[str, _Number] = {
            "FL": (
                "F+{:05d}",
                lambda: amplifier.filter_level,
                lambda v: amplifier.set_filter(level=v),
                range(9),
                False,
            ),
            "FM": (
                "M+{:05d}",
                lambda: int(amplifier.fir),
                lambda v: amplifier.set_filter(fir=bool(v)),
                range(2),
                False,
            ),
            "UR": (
                "U+{:05d}",
                lambda: amplifier.averaging,
                lambda v: amplifier.set_filter(averaging=v),
                range(8),
                False,
            ),
            "NR": ("R+{:05d}", *attribute("no_motion_counts"), range(1, 65536), False),
            "NT": ("T+{:05d}", *attribute("no_motion_ms"), range(1, 65536), False),
            "DP": ("P+{:05d}", lambda: amplifier.decimals, amplifier.set_decimals, range(6), True),
            "DS": ("S+{:05d}", *attribute("step"), STEPS, True),
            "CM": ("M{:+07d}", *attribute("max_counts"), range(1, 1_000_000), True),
            "CI": ("I{:+07d}", *attribute("min_counts"), range(-999_999, 1), True),
            "AD": ("A:{:03d}", lambda: store["AD"], lambda v: store.update(AD=v), range(256), False),
            "BR": ("B {}", lambda: store["BR"], lambda v: store.update(BR=v), BAUDRATES, False),
            "DX": ("X:{:03d}", lambda: int(not self.line.half_duplex), self._set_duplex, range(2), False),
            "TD": ("T:{:03d}", lambda: self.transmit_delay_ms, self._set_delay, range(256), False),
        }
        return table

    def _set_duplex(self, full: int) -> None:
        self.line.half_duplex = not full

    def _set_delay(self, delay_ms: int) -> None:
        self.transmit_delay_ms = delay_ms

    def _reset_peak(self, at_s: float) -> str:
        self.amplifier.peak = self.amplifier.valley = self.amplifier.gross(at_s)
        return "OK"

    def _hold(self, at_s: float) -> str:
        self.amplifier.held = self.amplifier.gross(at_s)
        return "OK"

    def _save_calibration(self, at_s: float) -> str:
        if not self.calibration_open:
            return "ERR"
        self.calibration_open = False
        self.calibration_counter += 1
        return "OK"

    def _close(self, at_s: float) -> str:
        self.open = self.address == 0
        return "OK"

    def _restart(self, at_s: float) -> str:
        """Warm start: address and baudrate as they were set take effect; silent for up to 400 ms."""

        def back(now_s: float) -> None:
            self.address = self._stored["AD"]
            self.open = self.address == 0
            self.line.set_device(self._stored["BR"], self.line.parity)

        self._deaf_until_s = at_s + RESET_S
        self.line.clock.schedule(self._deaf_until_s, back)
        self.amplifier.reset_tare()
        self.amplifier.reset_zero()
        self.calibration_open = False
        return "OK"

    def power_up(self, at_s: float) -> None:
        """The device starts anew: silent, without tare and zero."""
        self._halt_stream()
        self._buffer.clear()
        self.open = self.address == 0
        self.calibration_open = False
        self.amplifier.reset_tare()
        self.amplifier.reset_zero()

    # -- strings -----------------------------------------------------------------------------------------------

    def _decimal(self, letter: str, counts: int) -> str:
        beyond = self.amplifier.over_range(counts)
        if beyond:
            return letter + ("o" if beyond > 0 else "u") * 7
        digits = f"{counts:+07d}"
        places = self.amplifier.decimals
        return f"{letter}{digits[:-places]}.{digits[-places:]}" if places else letter + digits

    def _gross(self, at_s: float) -> str:
        return self._decimal("G", self.amplifier.gross(at_s))

    def _net(self, at_s: float) -> str:
        return self._decimal("N", self.amplifier.gross(at_s) - self.amplifier.tare)

    def _tare(self, at_s: float) -> str:
        return self._decimal("T", self.amplifier.tare)

    def _samples(self, at_s: float) -> str:
        return f"S{self.amplifier.gross(at_s) + self.amplifier.zero:+07d}"

    def _peak(self, at_s: float) -> str:
        return self._decimal("M", self.amplifier.peak)

    def _valley(self, at_s: float) -> str:
        return self._decimal("V", self.amplifier.valley)

    def _peak_to_peak(self, at_s: float) -> str:
        return self._decimal("O", self.amplifier.peak - self.amplifier.valley)

    def _held(self, at_s: float) -> str:
        return self._decimal("H", self.amplifier.held)

    def _combined(self, at_s: float) -> str:
        """`W`, net and gross without decimal point, two status nibbles, checksum (docs/devices.md 3.1.1)."""
        amplifier = self.amplifier
        gross = amplifier.gross(at_s)
        net = gross - amplifier.tare
        beyond = amplifier.over_range(gross)
        values = ("o" if beyond > 0 else "u") * 14 if beyond else f"{net:+07d}{gross:+07d}"
        text = f"W{values}0{self._status(at_s):X}"
        return f"{text}{-sum(text.encode()) & 0xFF:02X}"

    def _status(self, at_s: float) -> int:
        amplifier = self.amplifier
        return amplifier.still(at_s) | amplifier.zeroed << 1 | amplifier.tared << 2

    # -- sending -----------------------------------------------------------------------------------------------

    def _write(self, text: str, at_s: float) -> float:
        return self.line.device_write(text.encode() + b"\r\n", at_s)

    def _halt_stream(self) -> None:
        self._stream = None
        if self._line_event is not None:
            self._line_event.cancel()
            self._line_event = None

    def _send_line(self, at_s: float) -> None:
        """Start a string with the value of now; the next when the wire is free and there is another value."""
        if self._stream is None:
            return
        free_s = self._write(self._stream(at_s), at_s)
        self.lines_sent += 1
        schedule = self.line.clock.schedule
        if self.amplifier.running:
            self._sent_output = True
            self._line_event = schedule(free_s, self._wire_free)
        else:
            self._line_event = schedule(max(free_s, at_s + 1.0 / CONVERSIONS_PER_S), self._send_line)

    def _wire_free(self, at_s: float) -> None:
        self._line_event = None
        if not self._sent_output:
            self._send_line(at_s)

    def _on_output(self, at_s: float) -> None:
        self._sent_output = False
        if self._stream is not None and self._line_event is None:
            self._send_line(at_s)


_GETS = {
    "GG": "_gross",
    "GN": "_net",
    "ON": "_net",
    "GT": "_tare",
    "GS": "_samples",
    "GW": "_combined",
    "GM": "_peak",
    "GV": "_valley",
    "GO": "_peak_to_peak",
    "GH": "_held",
}
_CONTINUOUS = {
    "SG": "_gross",
    "SN": "_net",
    "SW": "_combined",
    "SM": "_peak",
    "SV": "_valley",
    "SO": "_peak_to_peak",
    "SH": "_held",
}
