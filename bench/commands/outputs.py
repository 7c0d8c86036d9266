"""Files that a command writes: declared with their option, and looked at in one place before the command begins."""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from bench.errors import InputError
from bench.shipped import KINDS, shipped_names

Kind = Literal["csv", "mcap", "json", "yaml", "html", "c"]

ENDINGS: dict[Kind, tuple[str, ...]] = {
    "csv": (".csv",),
    "mcap": (".mcap",),
    "json": (".json",),
    "yaml": (".yaml", ".yml"),
    "html": (".html", ".htm"),
    "c": (".h", ".hpp", ".c"),
}


@dataclass(frozen=True)
class Output:
    """One option that names a file to write.

    `kinds`: what is written; a file whose name ends as another kind does would deceive. `stdout`: `-` is standard
    output. `edits`: the option whose file may be named here too, to be edited.
    """

    name: str
    kinds: tuple[Kind, ...]
    stdout: bool
    edits: str


def add_output(
    parser: argparse._ActionsContainer,
    *flags: str,
    kinds: tuple[Kind, ...],
    stdout: bool = False,
    edits: str = "",
    **given: Any,
) -> None:
    """An argument that names a file to write, looked at by `check_outputs`."""
    action = parser.add_argument(*flags, **given)
    known = parser.get_default("outputs") or {}
    name = flags[0] if flags[0].startswith("-") else str(action.metavar or action.dest)
    parser.set_defaults(outputs={**known, action.dest: Output(name, kinds, stdout, edits)})


def add_json(parser: argparse._ActionsContainer, help: str) -> None:
    """`--json OUT`, which may be standard output."""
    add_output(parser, "--json", kinds=("json",), stdout=True, metavar="OUT", help=help)


def check_outputs(args: argparse.Namespace) -> None:
    """Whether the files to write may be written: said before the work whose results are to go there.

    Raises `InputError` where one cannot be made, is an input of the same command or another of its outputs, is a
    recording (never overwritten), or has the ending of another kind of file.
    """
    outputs: dict[str, Output] = getattr(args, "outputs", None) or {}
    seen: list[tuple[str, Path]] = []
    for dest, output in outputs.items():
        value = getattr(args, dest)
        if value is None or (output.stdout and str(value) == "-"):
            continue
        if str(value) == "-":
            raise InputError(output.name, "this does not go to standard output", "name a file")
        path = Path(value)
        must_be_writable(path)
        _must_end_well(output, path)
        _must_not_shadow(output, path)
        read = [file for name, file in _files(args) if name not in (*outputs, output.edits)]
        if any(_same(path, file) for file in read):
            raise InputError(output.name, f"{path} is an input of this command", "name another file to write")
        for name, other in seen:
            if _same(path, other):
                raise InputError(output.name, f"{path} is where {name} goes", "name a file for each")
        if _is_recording(path):
            raise InputError(output.name, f"{path} is a recording, which nothing overwrites", "name another file")
        seen.append((output.name, path))


def must_be_writable(path: Path) -> None:
    """Raises `InputError` where a file cannot be written."""
    if path.is_dir():
        raise InputError(str(path), "is a folder, not a file to write", "name a file in it")
    if not path.parent.is_dir():
        raise InputError(str(path), f"cannot be written: there is no folder {path.parent}", "make it, or name another")
    if not os.access(path if path.exists() else path.parent, os.W_OK):
        raise InputError(str(path), "cannot be written: permission denied", "name a place that is yours")


def _must_end_well(output: Output, path: Path) -> None:
    ending = path.suffix.lower()
    others = [end for kind, ends in ENDINGS.items() if kind not in output.kinds for end in ends]
    if ending in others:
        usual = " or ".join(ENDINGS[kind][0] for kind in output.kinds)
        raise InputError(output.name, f"{path}: what is written there is no {ending} file", f"let it end in {usual}")


def _must_not_shadow(output: Output, path: Path) -> None:
    """A file named as something shipped would from then on be taken for it, by every command given there."""
    for kind in KINDS:
        if path.name in shipped_names(kind):
            what = f"{path} is the name of a shipped {kind}, which stays as it is"
            raise InputError(output.name, what, "give the file an ending, or another name")


def _files(args: argparse.Namespace) -> Iterator[tuple[str, Path]]:
    """Everything on the command line that could be a file, by the name of its argument."""
    for name, value in vars(args).items():
        for given in value if isinstance(value, list) else [value]:
            if isinstance(given, str | Path) and str(given) and "\0" not in str(given):
                yield name, Path(given)


def _same(path: Path, other: Path) -> bool:
    try:
        if path.exists() and other.exists():
            return path.samefile(other)
        return path.resolve() == other.resolve()
    except OSError:  # a name that no file can have
        return False


def _is_recording(path: Path) -> bool:
    from bench.recording.reader import is_mcap

    return path.is_file() and is_mcap(path)
