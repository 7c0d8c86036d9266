"""Single keys from a terminal, without waiting for Enter and without ever blocking."""

from __future__ import annotations

import os
import select
import sys
import termios
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager

_MEANT = {
    "\x1b[A": "forth", "\x1b[C": "forth", "f": "forth", "\x1b[B": "back", "\x1b[D": "back", "b": "back",
    "+": "larger", "=": "larger", "-": "smaller", "q": "quit", "\x04": "quit",
}  # fmt: skip
_STEPS = ("\x1b[A", "\x1b[B", "\x1b[C", "\x1b[D")


@contextmanager
def terminal_keys(patience_s: float) -> Iterator[Callable[[], str | None]]:
    """A function that gives the meaning of the next key, or None after `patience_s`; the terminal is set back after.

    Keys pressed while a step was made are thrown away: an axis must not go on after the finger has left the key.
    """
    descriptor = sys.stdin.fileno()
    before = termios.tcgetattr(descriptor)

    def key() -> str | None:
        if not select.select([descriptor], [], [], patience_s)[0]:
            return None
        pressed = os.read(descriptor, 64).decode("ascii", "ignore")
        if not pressed:
            return "quit"
        return meaning(pressed)

    tty.setcbreak(descriptor)  # Ctrl-C stays Ctrl-C
    try:
        yield key
    finally:
        termios.tcsetattr(descriptor, termios.TCSADRAIN, before)


def meaning(pressed: str) -> str | None:
    """What a burst of characters asks for: its first known key; "quit" wherever a q is in it."""
    if "q" in pressed or "\x04" in pressed:
        return "quit"
    first = pressed[:3] if pressed[:3] in _STEPS else pressed[:1]
    return _MEANT.get(first)
