"""The `padbench` command: parse, call, print. Everything heavy is imported by the command that needs it."""

from __future__ import annotations

import argparse
import contextlib
import difflib
import errno
import importlib
import io
import os
import re
import signal
import sys
import tempfile
import traceback
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, NoReturn

from bench.commands.outputs import check_outputs
from bench.errors import EXIT_BAD_INPUT, EXIT_DEFECT, EXIT_NO, PadbenchError, stop_of
from bench.one_thread import one_thread

COMMANDS = {
    "run": "run a protocol on a bench, fit the pad, write the report",
    "check": "validate a protocol and say what it will do, without moving anything",
    "fit": "fit the pad's model to recordings or CSV",
    "simulate": "simulate a model over a protocol, or over the motion of measured data",
    "report": "write a run's report page again",
    "compare": "several runs side by side",
    "convert": "MCAP to CSV and back",
    "recover": "make a whole recording of a torn one",
    "diagnose": "what a model gets wrong about measured data, and why",
    "export": "a fitted pad for other programs: C header for real-time loops, or JSON",
    "paper": "remake the paper's figures and tables, and say what comes out of its findings",
    "schema": "print the JSON schema of a protocol, bench or model file",
    "status": "look at a bench: identity, position, force, lines; moves nothing",
    "home": "home the axis and bring it inside its travel",
    "jog": "move the axis by a small step, or by keys, under a force cap",
    "tare": "read the load cell in air: mean, noise, drift",
    "release": "bring the motor to a state without force",
    "calibrate": "scale and sign of the load cell from dead weights, into the bench file",
    "doctor": "check a bench: rates, noise, hum, steps, delays; what is wrong and what to do",
    "series": "measure many pads from a list, with rests, and go on tomorrow",
    "emulate": "serve a simulated bench's devices on pseudo-terminals",
}
"""Commands in the order of `--help`; each is `bench/commands/<name>.py` with `arguments(parser)` and `main(args)`."""

EPILOG = """\
PROTOCOL, BENCH and MODEL are files, or names of shipped ones (`padbench check --list`).
Exit status: 0 done; 1 the answer is no, or the run was stopped (data kept); 2 bad input; 3 recovered with loss;
70 a defect of padbench. Software limits are no emergency stop: keep one in reach."""


NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)


class Formatter(argparse.RawDescriptionHelpFormatter):
    """Leaves room for the names of the commands, which stand further in than argparse counts on."""

    def add_arguments(self, actions: Iterable[argparse.Action]) -> None:
        """As argparse does, and two columns more."""
        super().add_arguments(actions)
        self._action_max_length += 2


class Parser(argparse.ArgumentParser):
    """Says what was meant, where a word is nearly right; an option is written in full."""

    def __init__(self, **given: Any) -> None:
        super().__init__(**given, allow_abbrev=False)

    def error(self, message: str) -> NoReturn:
        """One line and where help is; exit status 2."""
        message = message.removeprefix("argument ")
        for kind, words in (("int", "whole number"), ("float", "number")):
            message = re.sub(f"invalid {kind} value: ('.*')", rf"\1 is no {words}", message)
        self.exit(EXIT_BAD_INPUT, f"{self.prog}: {message}\n  see {self.prog} --help\n")

    def unknown(self, words: list[str]) -> NoReturn:
        """Refuse the words that this command knows nothing of."""
        word = next((word for word in words if word.startswith("-")), words[0])
        if not word.startswith("-"):
            self.error(f"'{word}' is one word too many")
        option = word.split("=")[0]
        self.error(f"there is no option {option}{_meant(option, self._option_string_actions)}")

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is None or value in action.choices:
            return
        known = list(action.choices)
        if action.dest == "command":
            raise argparse.ArgumentError(None, f"there is no command '{value}'{_meant(value, known)}")
        raise argparse.ArgumentError(action, f"'{value}' is none of {', '.join(known)}{_meant(value, known)}")


def _meant(word: str, known: Iterable[str]) -> str:
    near = difflib.get_close_matches(word, list(known), n=1)
    return f"; did you mean {near[0]}?" if near else ""


def parser(command: str | None) -> tuple[Parser, Parser]:
    """The parser, and that of the command; only its own arguments are filled in, which keeps `--help` quick."""
    top = Parser(prog="padbench", description="Press a probe into something soft, and know what it is.",
                 epilog=EPILOG, formatter_class=Formatter)  # fmt: skip
    top.add_argument("--version", action="store_true", help="print the version")
    commands = top.add_subparsers(dest="command", metavar="COMMAND", title="commands")
    named = top
    for name, text in COMMANDS.items():
        sub = commands.add_parser(name, help=text, description=text[0].upper() + text[1:] + ".")
        if name == command:
            _module(name).arguments(sub)
            named = sub
    return top, named


def main(argv: list[str] | None = None) -> int:
    """Run one command; returns the exit status of docs/formats.md."""
    one_thread()
    words = sys.argv[1:] if argv is None else argv
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal that has no ± or µ shows something else
    command = next((word for word in words if not word.startswith("-")), None)
    top, named = parser(command)
    args, unknown = top.parse_known_args(words)
    if unknown:
        named.unknown(unknown)
    if args.version:
        from importlib.metadata import version

        print(f"padbench {version('padbench')}")
        return 0
    if args.command is None:
        top.print_help(sys.stderr)
        return EXIT_BAD_INPUT
    struck: list[_Ended] = []
    try:
        with _signals_end_it(struck):
            check_outputs(args)
            status = int(_module(args.command).main(args))
            sys.stdout.flush()  # what cannot be written is said here, not at the interpreter's end
            return status
    except PadbenchError as error:
        print(f"padbench {args.command}: {error}", file=sys.stderr)
        return error.status
    except KeyboardInterrupt as stop:
        return _stopped(args.command, stop)
    except BrokenPipeError:
        _give_up_output()
        return EXIT_NO
    except OSError as error:
        if error.filename is None and error.errno in NO_ROOM:
            return _no_room(args.command, error)
        if error.filename is None:
            return _defect(args.command, error)
        print(f"padbench {args.command}: {error.filename}: {error.strerror}", file=sys.stderr)
        return EXIT_BAD_INPUT
    except Exception as error:
        if struck:  # what was under way has made another error of it
            return _stopped(args.command, struck[0])
        return _defect(args.command, error)


def _stopped(command: str, stop: KeyboardInterrupt) -> int:
    print(f"padbench {command}: stopped by {stop_of(stop)}", file=sys.stderr)
    return EXIT_NO


class _Ended(KeyboardInterrupt):
    """One of a kind of its own: where the plain one strikes while a text is executed (as a dataclass is made), CPython
    ends the process by SIGINT, whatever status it returns."""


@contextlib.contextmanager
def _signals_end_it(struck: list[_Ended]) -> Iterator[None]:
    """Ctrl-C, SIGTERM and SIGHUP end a command with words and status 1, and are then in `struck`; a run itself has them
    end it softly."""

    def end(number: int, frame: object) -> None:
        name = signal.Signals(number).name
        struck.append(_Ended("" if name == "SIGINT" else f"signal {name}"))
        raise struck[-1]

    before = {}
    usual = (signal.SIG_DFL, signal.default_int_handler)
    with contextlib.suppress(ValueError):  # not in the main thread: there somebody else has them
        for name in ("SIGINT", "SIGTERM", "SIGHUP"):
            if hasattr(signal, name) and signal.getsignal(getattr(signal, name)) in usual:
                before[name] = signal.signal(getattr(signal, name), end)
    try:
        yield
    finally:
        for name, handler in before.items():
            signal.signal(getattr(signal, name), handler)


def _module(name: str) -> Any:
    return importlib.import_module(f"bench.commands.{name}")


def _give_up_output() -> None:
    """What standard output still holds goes nowhere, without a word at the interpreter's end."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _no_room(command: str, error: OSError) -> int:
    """Standard output goes where nothing can be written."""
    with contextlib.suppress(OSError, ValueError):
        _give_up_output()
    print(f"padbench {command}: what it says cannot be written: {error.strerror}", file=sys.stderr)
    return EXIT_BAD_INPUT


def _defect(command: str, error: Exception) -> int:
    """A defect of ours: a short message, and the traceback in a file that can be sent to us."""
    with tempfile.NamedTemporaryFile("w", prefix="padbench-", suffix=".log", delete=False) as log:
        log.write(f"padbench {' '.join(sys.argv[1:])}\n\n")
        traceback.print_exception(error, file=log)
    print(
        f"padbench {command}: this is a defect of padbench, not of your files: {type(error).__name__}: {error}\n"
        f"  details are in {Path(log.name)}",
        file=sys.stderr,
    )
    return EXIT_DEFECT


if __name__ == "__main__":
    sys.exit(main())
