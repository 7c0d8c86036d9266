"""The errors a person meets, and the exit status each ends with (docs/formats.md)."""

from __future__ import annotations

EXIT_DONE = 0
EXIT_NO = 1
EXIT_BAD_INPUT = 2
EXIT_LOST = 3
EXIT_DEFECT = 70


class PadbenchError(Exception):
    """Base of everything that is reported as one clear message, without a traceback."""

    status = EXIT_NO


class InputError(PadbenchError):
    """What a person gave us is wrong: names the place, what is wrong, and the cure.

    `place` is `file:line:column` where there is one, else the file or the argument.
    """

    status = EXIT_BAD_INPUT

    def __init__(self, place: str, message: str, cure: str = "") -> None:
        super().__init__(f"{place}: {message}" + (f"\n  {cure}" if cure else ""))
        self.place = place
        self.message = message
        self.cure = cure


class Refused(PadbenchError):
    """The answer is no: preflight predicts a limit crossed, contact where there should be air, …"""


class Stopped(PadbenchError):
    """A run ended before its protocol did; the data are kept. `cause` is the first thing that went wrong."""

    def __init__(self, cause: str) -> None:
        super().__init__(cause)
        self.cause = cause


def stop_of(interrupt: KeyboardInterrupt) -> str:
    """By what a command was stopped: a signal that says its name, or else Ctrl-C."""
    return str(interrupt) or "the operator (Ctrl-C)"
