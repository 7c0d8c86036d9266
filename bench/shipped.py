"""Protocols, benches and pads: a file, what comes with padbench by name, or the model that a run folder holds."""

from __future__ import annotations

import difflib
from importlib.resources import files
from pathlib import Path
from typing import Literal, get_args

from bench.errors import InputError

Kind = Literal["protocol", "bench", "pad"]
KINDS: tuple[Kind, ...] = get_args(Kind)
MODEL = "model.yaml"
"""What a run folder calls the model that was fitted."""

_FOLDERS: dict[Kind, str] = {"protocol": "", "bench": "benches", "pad": "pads"}


def shipped_names(kind: Kind) -> list[str]:
    """Names of what is shipped, in alphabetical order."""
    return sorted(path.stem for path in _folder(kind).glob("*.yaml"))


def find_shipped(kind: Kind, name: str) -> Path | None:
    """The shipped file of that name, or None."""
    return _folder(kind) / f"{name}.yaml" if name in shipped_names(kind) else None


def find_file(kind: Kind, name_or_path: str | Path) -> Path:
    """A file as given, or the shipped one of that name; raises `InputError` with the nearest shipped name."""
    name = str(name_or_path)
    path = Path(name)
    if not name.strip():
        raise InputError(kind, "no name was given", f"shipped: {', '.join(shipped_names(kind))}")
    if "\0" in name:
        raise InputError(kind, "a file name cannot hold a NUL character")
    if path.is_file():
        return path
    if kind == "pad" and (path / MODEL).is_file():  # what a run has fitted
        return path / MODEL
    found = find_shipped(kind, name)
    if found is not None:
        return found
    if path.exists() and not path.is_dir():  # a pipe, a terminal: reading it says what is wrong
        return path
    absent = f"there is no such file, and no shipped {kind} of that name"
    what = "is a directory, not a file" if path.is_dir() else absent
    raise InputError(name, what, _suggestion(kind, path))


def _suggestion(kind: Kind, path: Path) -> str:
    names = shipped_names(kind)
    word = path.stem.lower()
    begun = [name for name in names if word and name.startswith(word)]
    close = begun or difflib.get_close_matches(word, names, n=1, cutoff=0.5)
    guess = f"did you mean `{close[0]}`? " if close else ""
    return f"{guess}shipped: {', '.join(names)}"


def _folder(kind: Kind) -> Path:
    return Path(str(files("protocols"))) / _FOLDERS[kind]
