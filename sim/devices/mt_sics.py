"""A balance or weigh module that speaks MT-SICS (Mettler Toledo): docs/devices.md 3.2, 7.4.

Commands are lines of upper-case ASCII that end with CR LF (the CR may be missing), replies end with CR LF.

Not documented there, and chosen here: 2 ms pass before a reply; SIR sends 100 values a second where the wire carries
them (rates depend on the model; UPD says and sets it); S, T and Z wait 3 s for a standstill, then answer `I`; the
tare is forgotten by @; a line with bytes that are no ASCII (wrong baudrate or parity) answers ET; zero can be set
anywhere in the range; SR and other variants answer ES.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable

from sim.clock import Event
from sim.devices.amplifier import Amplifier
from sim.line import Line

REPLY_DELAY_S = 0.002
STABLE_WITHIN_S, LOOK_S = 3.0, 0.02
UPDATES_HZ = 100.0
SERIAL, MODEL = "B021002593", "WMS PadSim"
_WITH_PARAMETERS = ("TA", "UPD")
_NUMBER = re.compile(r"([+-]?\d+(?:\.\d*)?) +(\S+)")


class MtSics:
    """The device: one command at a time, and a stream while SIR is on. Values are net, in `unit`."""

    def __init__(self, line: Line, amplifier: Amplifier, *, unit: str = "g") -> None:
        self.line = line
        self.amplifier = amplifier
        self.unit = unit
        self.updates_Hz = UPDATES_HZ
        self.lines_sent = 0
        self.refuse: Callable[[float], int | None] | None = None
        """A fault: commands at a time are answered with `I` where this gives a number."""
        self._buffer = bytearray()
        self._pending: Event | None = None
        self._stream: Event | None = None
        line.device = self
        self._handlers: dict[str, Callable[[str, float], str | None]] = {
            "S": lambda argument, at_s: self._when_still("S", self._stable_value, at_s),
            "SI": self._send_now,
            "SIR": self._begin_stream,
            "T": lambda argument, at_s: self._when_still("T", self._tare, at_s),
            "TI": lambda argument, at_s: self._tare(at_s, "TI", "S" if amplifier.still(at_s) else "D"),
            "TA": self._tare_value,
            "TAC": self._clear_tare,
            "Z": lambda argument, at_s: self._when_still("Z", self._zero, at_s),
            "ZI": lambda argument, at_s: self._zero(at_s, "ZI", "S" if amplifier.still(at_s) else "D"),
            "UPD": self._update_rate,
            "@": self._reset,
        }
        self._texts = {
            "I1": '"0" "2.30" "2.20" "" ""',
            "I2": f'"{MODEL} {self._capacity():.3f} {unit}"',
            "I3": '"1.00 0.0.0.0"',
            "I4": f'"{SERIAL}"',
            "I10": '""',
            "I11": f'"{MODEL}"',
        }

    def _capacity(self) -> float:
        return self.amplifier.max_counts * 10.0**-self.amplifier.decimals

    # -- commands ------------------------------------------------------------------------------------------------

    def receive(self, data: bytes, at_s: float) -> None:
        """Take bytes; each command ends with a line feed."""
        self._buffer += data
        while (end := self._buffer.find(b"\n")) >= 0:
            line = bytes(self._buffer[:end]).rstrip(b"\r")
            del self._buffer[: end + 1]
            self._command(line, at_s)
        del self._buffer[:-128]

    def _command(self, line: bytes, at_s: float) -> None:
        if not line.isascii():
            self._reply("ET", at_s)
            return
        name, _, argument = line.decode("ascii").partition(" ")
        if self.refuse is not None and self.refuse(at_s) is not None:
            self._reply(f"{'S' if name in ('SI', 'SIR') else name} I", at_s)
            return
        if name in ("S", "SI", "SIR", "@"):
            self._end_stream()
        self._cancel_pending()
        handler = self._handlers.get(name)
        if handler is not None and (not argument or name in _WITH_PARAMETERS):
            reply = handler(argument.strip(), at_s)
        elif name == "I0":
            reply = "\r\n".join(f'I0 B 0 "{known}"' for known in (*self._handlers, *self._texts)) + '\r\nI0 A 0 "I0"'
        elif name in self._texts and not argument:
            reply = f"{name} A {self._texts[name]}"
        else:
            reply = "ES"
        if reply is not None:
            self._reply(reply, at_s)

    def _reply(self, text: str, at_s: float) -> float:
        return self.line.device_write(text.encode("ascii") + b"\r\n", at_s + REPLY_DELAY_S)

    def _when_still(self, name: str, act: Callable[[float, str, str], str], at_s: float) -> str | None:
        """Answer as soon as the weight stands still; `I` where it does not."""
        give_up_s = at_s + STABLE_WITHIN_S

        def look(now_s: float) -> None:
            self._pending = None
            beyond = self._beyond(now_s)
            if beyond:
                self._reply(f"{name} {beyond}", now_s)
            elif self.amplifier.still(now_s):
                self._reply(act(now_s, name, "S"), now_s)
            elif now_s >= give_up_s:
                self._reply(f"{name} I", now_s)
            else:
                self._pending = self.line.clock.schedule(now_s + LOOK_S, look)

        look(at_s)
        return None

    # -- values --------------------------------------------------------------------------------------------------

    def _beyond(self, at_s: float) -> str:
        beyond = self.amplifier.over_range(self.amplifier.gross(at_s))
        return "+" if beyond > 0 else "-" if beyond < 0 else ""

    def _number(self, counts: int) -> str:
        places = self.amplifier.decimals
        return f"{counts * 10.0**-places:10.{places}f} {self.unit}"

    def _value(self, at_s: float, status: str = "") -> str:
        gross = self.amplifier.gross(at_s)  # one conversion: what is beyond the range is what would be shown
        beyond = self.amplifier.over_range(gross)
        if beyond:
            return f"S {'+' if beyond > 0 else '-'}"
        still = "S" if self.amplifier.still(at_s) else "D"
        return f"S {status or still} {self._number(gross - self.amplifier.tare)}"

    def _stable_value(self, at_s: float, name: str, status: str) -> str:
        return self._value(at_s, status)

    def _send_now(self, argument: str, at_s: float) -> str:
        return self._value(at_s)

    def _begin_stream(self, argument: str, at_s: float) -> None:
        self._stream = self.line.clock.schedule(at_s + REPLY_DELAY_S, self._send_line)

    def _send_line(self, at_s: float) -> None:
        if self._stream is None:
            return
        free_s = self.line.device_write(self._value(at_s).encode("ascii") + b"\r\n", at_s)
        self.lines_sent += 1
        self._stream = self.line.clock.schedule(max(free_s, at_s + 1.0 / self.updates_Hz), self._send_line)

    def _end_stream(self) -> None:
        if self._stream is not None:
            self._stream.cancel()
            self._stream = None

    def _cancel_pending(self) -> None:
        if self._pending is not None:
            self._pending.cancel()
            self._pending = None

    # -- zero and tare -------------------------------------------------------------------------------------------

    def _tare(self, at_s: float, name: str, status: str) -> str:
        beyond = self._beyond(at_s)
        if beyond:
            return f"{name} {beyond}"
        self.amplifier.tare = self.amplifier.gross(at_s)
        self.amplifier.tared = True
        return f"{name} {status} {self._number(self.amplifier.tare)}"

    def _zero(self, at_s: float, name: str, status: str) -> str:
        beyond = self._beyond(at_s)
        if beyond:
            return f"{name} {beyond}"
        amplifier = self.amplifier
        amplifier.zero += amplifier.gross(at_s)
        amplifier.zeroed = True
        amplifier.reset_tare()
        return "Z A" if name == "Z" else f"{name} {status}"

    def _tare_value(self, argument: str, at_s: float) -> str:
        if argument:
            match = _NUMBER.fullmatch(argument)
            if match is None or match[2] != self.unit or float(match[1]) > self._capacity():
                return "TA L"
            self.amplifier.tare = round(float(match[1]) * 10**self.amplifier.decimals)
            self.amplifier.tared = True
        return f"TA A {self._number(self.amplifier.tare)}"

    def _clear_tare(self, argument: str, at_s: float) -> str:
        self.amplifier.reset_tare()
        return "TAC A"

    def _update_rate(self, argument: str, at_s: float) -> str:
        if argument:
            try:
                rate_Hz = float(argument)
            except ValueError:
                return "UPD L"
            if not (math.isfinite(rate_Hz) and 0.1 <= rate_Hz <= 1000.0):
                return "UPD L"
            self.updates_Hz = rate_Hz
            return "UPD A"
        return f"UPD A {self.updates_Hz:.1f}"

    def power_up(self, at_s: float) -> None:
        """The device starts anew: silent, without tare and zero."""
        self._end_stream()
        self._cancel_pending()
        self._buffer.clear()
        self.updates_Hz = UPDATES_HZ
        self.amplifier.reset_tare()
        self.amplifier.reset_zero()

    def _reset(self, argument: str, at_s: float) -> str:
        self.amplifier.reset_tare()
        self.updates_Hz = UPDATES_HZ
        return f"I4 A {self._texts['I4']}"
