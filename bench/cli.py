"""The `padbench` command: parse, call, print. Everything heavy is imported by the command that needs it."""

from __future__ import annotations

import argparse
import difflib
import importlib
import os
import sys
import tempfile
import traceback
from pathlib import Path
from typing import Any, NoReturn

from bench.errors import EXIT_BAD_INPUT, EXIT_DEFECT, EXIT_NO, PadbenchError

COMMANDS = {
    "run": "run a protocol on a bench, fit the pad, write the report",
    "check": "validate a protocol and say what it will do, without moving anything",
    "fit": "fit the pad's model to recordings or CSV",
    "simulate": "simulate a model over a protocol, or over the motion of measured data",
    "report": "write a run's report page again",
    "compare": "several runs side by side",
    "convert": "MCAP to CSV and back",
    "recover": "make a whole recording of a torn one",
    "export": "a fitted pad for other programs: C header for real-time loops, or JSON",
    "schema": "print the JSON schema of a protocol, bench or model file",
    "emulate": "serve a simulated bench's devices on pseudo-terminals",
}
"""Commands in the order of `--help`; each is `bench/commands/<name>.py` with `arguments(parser)` and `main(args)`."""

EPILOG = """\
PROTOCOL, BENCH and MODEL are files, or names of shipped ones (`padbench check --list`).
Exit status: 0 done; 1 the answer is no, or the run was stopped (data kept); 2 bad input; 3 recovered with loss;
70 a defect of padbench. Software limits are no emergency stop: keep one in reach."""


class Parser(argparse.ArgumentParser):
    """Says what was meant, where a word is nearly right."""

    def error(self, message: str) -> NoReturn:
        """One line and where help is; exit status 2."""
        if "invalid choice: '" in message:
            word = message.split("invalid choice: '")[1].split("'")[0]
            near = difflib.get_close_matches(word, COMMANDS, n=1)
            message = f"there is no command '{word}'" + (f"; did you mean '{near[0]}'?" if near else "")
        self.exit(EXIT_BAD_INPUT, f"{self.prog}: {message}\n  see {self.prog} --help\n")


def parser(command: str | None) -> argparse.ArgumentParser:
    """The parser; only the named command's own arguments are filled in, which keeps `--help` quick."""
    top = Parser(prog="padbench", description="Press a probe into something soft, and know what it is.",
                 epilog=EPILOG, formatter_class=argparse.RawDescriptionHelpFormatter)  # fmt: skip
    top.add_argument("--version", action="store_true", help="print the version")
    commands = top.add_subparsers(dest="command", metavar="COMMAND", title="commands")
    for name, text in COMMANDS.items():
        sub = commands.add_parser(name, help=text, description=text[0].upper() + text[1:] + ".")
        if name == command:
            _module(name).arguments(sub)
    return top


def main(argv: list[str] | None = None) -> int:
    """Run one command; returns the exit status of contracts.md."""
    words = sys.argv[1:] if argv is None else argv
    command = next((word for word in words if not word.startswith("-")), None)
    args = parser(command).parse_args(words)
    if args.version:
        from importlib.metadata import version

        print(f"padbench {version('padbench')}")
        return 0
    if args.command is None:
        parser(None).print_help()
        return EXIT_BAD_INPUT
    try:
        return int(_module(args.command).main(args))
    except PadbenchError as error:
        print(f"padbench {args.command}: {error}", file=sys.stderr)
        return error.status
    except KeyboardInterrupt:
        print(f"padbench {args.command}: stopped by the operator (Ctrl-C)", file=sys.stderr)
        return EXIT_NO
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return EXIT_NO
    except Exception as error:
        return _defect(args.command, error)


def _module(name: str) -> Any:
    return importlib.import_module(f"bench.commands.{name}")


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
