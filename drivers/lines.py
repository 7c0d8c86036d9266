"""Replies that are lines of ASCII: finding the one that answers, among lines of a stream that still come."""

from __future__ import annotations

from collections.abc import Callable


def first_line(answers: Callable[[bytes], object]) -> Callable[[bytearray], int]:
    """Length function of an exchange (see `drivers.wire.Exchange`) whose reply is the first line that `answers`.

    Lines end with CR, LF or both, which are not handed to `answers`; lines before the one that answers are deleted.
    """

    def length(buffer: bytearray) -> int:
        while buffer:
            end = next((index for index, byte in enumerate(buffer) if byte in b"\r\n"), None)
            if end is None:
                return 0
            after = end + 2 if buffer[end : end + 2] == b"\r\n" else end + 1
            if answers(bytes(buffer[:end])):
                return after
            del buffer[:after]
        return 0

    return length
