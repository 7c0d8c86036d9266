"""Numbers put into a bench file where they stand, so that comments, order and layout stay as the person wrote them."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from bench.errors import InputError
from bench.shipped import shipped_names
from bench.yamlfile import parse, read_text

Values = Mapping[tuple[str, str], str]
"""By (block, key): the value as it is to be written."""


def edited(text: str, values: Values, path: Path) -> str:
    """The text with the values in place of what stood there, missing keys and blocks added.

    Only blocks of the top level and keys in them. Raises `InputError` where the edit would do anything else to the
    file than set these values (an anchor, an alias, a merged block): what comes out is read again and compared.
    """
    original = text
    wanted: dict[str, Any] = dict(parse(text, path).data)
    for (block, key), value in values.items():
        text = _set(text, block, key, value)
        inside = wanted.get(block)
        wanted[block] = {**(inside if isinstance(inside, dict) else {}), key: parse(value, path).data}
    blocks = parse(original, path).data
    same = all(isinstance(blocks.get(block), dict | None) for block, _ in values)
    try:
        same = same and parse(text, path).data == wanted
    except InputError:
        same = False
    if not same:
        lines = "; ".join(f"{block}.{key}: {value}" for (block, key), value in values.items())
        raise InputError(
            str(path), "is written in a way that cannot be edited line by line", f"put in by hand: {lines}"
        )
    return text


def _set(text: str, block: str, key: str, value: str) -> str:
    root = yaml.compose(text, yaml.SafeLoader)
    inside = _child(root, block)
    if inside is None:
        return f"{text}{'' if text.endswith(chr(10)) else chr(10)}{block}: {{{key}: {value}}}\n"
    if not isinstance(inside, yaml.MappingNode):  # `timing:` with nothing behind it
        return _between(text, inside, f" {{{key}: {value}}}")
    old = _child(inside, key)
    if old is not None:
        lead = "" if old.start_mark.index != old.end_mark.index else " "
        return _between(text, old, f"{lead}{value}")
    if inside.flow_style:
        end = inside.end_mark.index - 1
        before = text[:end].rstrip()
        comma = "" if before.endswith(("{", ",")) else ","
        return f"{before}{comma} {key}: {value}{text[end:]}"
    indent = " " * inside.value[0][0].start_mark.column
    last = max(node.end_mark.index for node in inside.value[-1])
    end = text.find("\n", last)
    if last > 0 and text[last - 1] == "\n":  # a block's end mark stands at the next line's beginning
        end = last - 1
    end = len(text) if end < 0 else end
    return f"{text[:end]}\n{indent}{key}: {value}{text[end:]}"


def _between(text: str, node: yaml.Node, value: str) -> str:
    return text[: node.start_mark.index] + value + text[node.end_mark.index :]


def _child(node: Any, key: str) -> Any:
    if not isinstance(node, yaml.MappingNode):
        return None
    return next((value for name, value in node.value if name.value == key), None)


def own_file(path: Path | None, name: str) -> Path:
    """The bench file, if it is the person's own; raises `InputError` for a shipped one, or where none may write."""
    if path is None or (path.stem in shipped_names("bench") and path.parent.name == "benches" and _in_package(path)):
        where = str(path) if path is not None else name
        raise InputError(where, "is a shipped bench, and stays as it is", "copy it, and name the copy")
    if not os.access(path, os.W_OK) or not os.access(path.parent, os.W_OK):
        raise InputError(str(path), "cannot be written: permission denied", "name a file that is yours")
    return path


def _in_package(path: Path) -> bool:
    from importlib.resources import files

    return path.resolve().is_relative_to(Path(str(files("protocols"))).resolve())


def edit_file(path: Path, values: Values) -> None:
    """Set the values in a file, at once or not at all. Raises `InputError` as `edited` does."""
    write_whole(path, edited(read_text(path), values, path))


def write_whole(path: Path, text: str) -> None:
    """Write a file so that whoever reads it sees the old or the new, never a part, also when the power goes."""
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "w", encoding="utf-8", newline="") as stream:
            stream.write(text)
            stream.flush()
            os.fsync(stream.fileno())
        Path(name).chmod(path.stat().st_mode & 0o777 if path.exists() else 0o644)
        Path(name).replace(path)
    except BaseException:
        with contextlib.suppress(OSError):
            Path(name).unlink()
        raise
