"""YAML as people mean it: safe, one document, and every node's place kept for messages.

PyYAML reads the syntax, but not the meaning: its YAML 1.1 turns `1e-3` into a word, `on` into true, `1:30` into 90,
`010` into 8, and lets the second of two equal keys win in silence. Here scalars follow the YAML 1.2 core schema
(decimal `010` is ten), equal keys are an error, tags are refused, and size, nesting and what aliases expand to are
limited. NaN and infinity are refused everywhere: no file of ours has a use for them.
"""

from __future__ import annotations

import codecs
import json
import math
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import yaml
from pydantic import BaseModel, ValidationError
from yaml.composer import Composer
from yaml.parser import Parser
from yaml.reader import Reader
from yaml.resolver import BaseResolver
from yaml.scanner import Scanner

from bench.complaints import complaints
from bench.errors import InputError
from bench.places import Key, Places, spell

M = TypeVar("M", bound=BaseModel)

SAVE_AS = "save it as UTF-8"
MAX_BYTES = 1_000_000
MAX_DEPTH = 50
MAX_NODES = 30_000
"""Nodes after aliases are expanded; a spline law or a register map has some hundred."""

_SAFE_INT = 2**53
_INT = re.compile(r"[-+]?[0-9]+")
_HEX = re.compile(r"0x[0-9a-fA-F]+")
_OCT = re.compile(r"0o[0-7]+")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_NOT_FINITE = re.compile(r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)")
_WORDS: dict[str, bool | None] = {
    "": None,
    "~": None,
    **dict.fromkeys(("null", "Null", "NULL"), None),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
}
_SURROGATE = re.compile("[\ud800-\udfff]")


@dataclass(frozen=True)
class Document:
    """One YAML file as read: `data` (dicts, lists, str, int, float, bool, None), its `text`, and its `places`."""

    path: Path
    data: Any
    text: str
    places: Places = field(repr=False)

    def error(self, path: tuple[Key, ...], message: str, cure: str = "", *, at_key: bool = False) -> InputError:
        """An `InputError` at the node `path`, or at the nearest node above it that exists."""
        words = f"{spell(path)}: {message}" if path else message
        return InputError(self.places.place(path, at_key=at_key), words, cure)


class _Loader(Reader, Scanner, Parser, Composer, BaseResolver):
    """PyYAML's reader up to the node graph, with no constructors at all: nothing in a file can name code."""

    def __init__(self, text: str) -> None:
        Reader.__init__(self, text)
        Scanner.__init__(self)
        Parser.__init__(self)
        Composer.__init__(self)
        BaseResolver.__init__(self)
        self.depth = self.nodes = 0

    def compose_node(self, parent: Any, index: Any) -> Any:
        event: Any = self.peek_event()  # type: ignore[no-untyped-call]
        if getattr(event, "tag", None) is not None:
            raise _Refusal(event.start_mark, f"the tag `{event.tag}` is not allowed here", "write the value alone")
        self.depth += 1
        self.nodes += 1
        if self.nodes > MAX_NODES:
            raise _Refusal(event.start_mark, f"more than {MAX_NODES} values")
        if self.depth > MAX_DEPTH:
            raise _Refusal(event.start_mark, f"nested more than {MAX_DEPTH} deep")
        node = super().compose_node(parent, index)
        self.depth -= 1
        return node


class _Refusal(Exception):
    def __init__(self, mark: Any, message: str, cure: str = "", path: tuple[Key, ...] = ()) -> None:
        super().__init__(message)
        self.mark, self.message, self.cure, self.path = mark, message, cure, path


class _Builder:
    """Turns nodes into plain data, noting where each one stands."""

    def __init__(self, places: Places) -> None:
        self.places = places
        self.nodes = 0

    def build(self, node: yaml.Node, path: tuple[Key, ...]) -> Any:
        self.nodes += 1
        if self.nodes > MAX_NODES:
            raise _Refusal(node.start_mark, f"more than {MAX_NODES} values, aliases expanded")
        if len(path) > MAX_DEPTH:
            raise _Refusal(node.start_mark, f"nested more than {MAX_DEPTH} deep (an alias inside itself?)")
        self.places.values[path] = (node.start_mark.line + 1, node.start_mark.column + 1)
        if isinstance(node, yaml.MappingNode):
            return self._mapping(node, path)
        if isinstance(node, yaml.SequenceNode):
            return [self.build(item, (*path, i)) for i, item in enumerate(node.value)]
        return _scalar(node, path)

    def _mapping(self, node: yaml.MappingNode, path: tuple[Key, ...]) -> dict[Key, Any]:
        data: dict[Key, Any] = {}
        before = ""
        for key_node, value_node in node.value:
            if _is_decimal_comma(before, key_node, value_node):
                number = f"{before},{key_node.value}"
                cure = f"write {before}.{key_node.value}"
                raise _Refusal(key_node.start_mark, f"`{number}`: numbers have a decimal point here", cure, path)
            before = value_node.value if isinstance(value_node, yaml.ScalarNode) else ""
            key = _scalar(key_node, path) if isinstance(key_node, yaml.ScalarNode) else None
            if isinstance(key, bool) or not isinstance(key, str | int):
                raise _Refusal(key_node.start_mark, "a key must be a word or a whole number", "", path)
            line, column = key_node.start_mark.line + 1, key_node.start_mark.column + 1
            if key in data:
                first = self.places.keys[(*path, key)][0]
                cure = f"it stands in line {first} already: keep one of the two"
                raise _Refusal(key_node.start_mark, "this key is given twice", cure, (*path, key))
            self.places.keys[(*path, key)] = (line, column)
            data[key] = self.build(value_node, (*path, key))
        return data


def _is_decimal_comma(before: str, key: yaml.Node, value: yaml.Node) -> bool:
    """Whether what stands after a comma is no key, but the rest of the number before it: `{to: 0,5, speed: 2}`."""
    empty = isinstance(value, yaml.ScalarNode) and value.value == "" and value.style is None
    digits = isinstance(key, yaml.ScalarNode) and key.style is None and key.value.isdigit()
    return empty and digits and before.lstrip("+-").isdigit()


def _scalar(node: yaml.Node, path: tuple[Key, ...]) -> Any:
    text: str = node.value
    if _SURROGATE.search(text):
        raise _Refusal(node.start_mark, "holds half of a character (a lone surrogate)", "", path)
    if getattr(node, "style", None) is not None:  # quoted or block: a word, whatever it looks like
        return text
    if text in _WORDS:
        return _WORDS[text]
    if _NOT_FINITE.fullmatch(text):
        raise _Refusal(node.start_mark, f"`{text}` is not a finite number", "give a number", path)
    for pattern, base in ((_INT, 10), (_HEX, 16), (_OCT, 8)):
        if pattern.fullmatch(text):
            value = int(text, base) if len(text) < 20 else _SAFE_INT + 1
            if abs(value) > _SAFE_INT:
                raise _Refusal(node.start_mark, f"`{text[:30]}` is too large a number", "", path)
            return value
    if _FLOAT.fullmatch(text):
        number = float(text)
        if not math.isfinite(number):
            raise _Refusal(node.start_mark, f"`{text[:30]}` is too large a number", "", path)
        return number
    return text


def read_text(path: Path) -> str:
    """Text of a file; raises `InputError` where there is none, it is a directory, no text, or over 1 MB."""
    try:
        with path.open("rb") as stream:
            raw = stream.read(MAX_BYTES + 1)
    except FileNotFoundError:
        raise InputError(str(path), "there is no such file") from None
    except IsADirectoryError:
        raise InputError(str(path), "is a directory, not a file") from None
    except (OSError, ValueError) as error:
        raise InputError(str(path), f"cannot be read: {getattr(error, 'strerror', None) or error}") from None
    if len(raw) > MAX_BYTES:
        raise InputError(str(path), f"is larger than {MAX_BYTES // 1_000_000} MB; that is no file of this kind")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        if raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
            raise InputError(str(path), "is UTF-16", SAVE_AS) from None
        raise InputError(f"{path}:{line}", f"is not text: byte 0x{raw[error.start]:02x} is no UTF-8", SAVE_AS) from None


def parse(text: str, path: Path) -> Document:
    """Text of one YAML document to data with places; `path` is only a name. Raises `InputError`."""
    places = Places(str(path))
    builder = _Builder(places)
    try:
        node = _Loader(text).get_single_node()
        data = None if node is None else builder.build(node, ())
    except _Refusal as refusal:
        line, column = refusal.mark.line + 1, refusal.mark.column + 1
        words = f"{spell(refusal.path)}: {refusal.message}" if refusal.path else refusal.message
        raise InputError(f"{path}:{line}:{column}", words, refusal.cure) from None
    except yaml.MarkedYAMLError as error:
        raise _syntax_error(error, path) from None
    except yaml.reader.ReaderError as error:
        line = text.count("\n", 0, error.position) + 1
        column = error.position - text.rfind("\n", 0, error.position)
        code = error.character if isinstance(error.character, int) else ord(error.character)
        raise InputError(f"{path}:{line}:{column}", f"is not text: it holds the character U+{code:04X}") from None
    except (yaml.YAMLError, ValueError, OverflowError, RecursionError) as error:
        raise InputError(str(path), f"is not valid YAML: {error}") from None
    return Document(path, data, text, places)


def _syntax_error(error: yaml.MarkedYAMLError, path: Path) -> InputError:
    mark = error.problem_mark or error.context_mark
    place = f"{path}:{mark.line + 1}:{mark.column + 1}" if mark is not None else str(path)
    problem = error.problem or error.context or "unreadable"
    cure = ""
    if "'\\t'" in problem:
        cure = "indent with spaces, not with tabs"
    elif "expected a single document" in (error.context or ""):
        problem, cure = "a second document begins here", "one file holds one document: remove the `---`"
    elif "mapping values are not allowed" in problem:
        cure = "a second `:` in one line: quote the text, or start a new line"
    elif error.context_mark is not None and error.context and error.context_mark.line != getattr(mark, "line", None):
        cure = f"it was found {error.context} that begins in line {error.context_mark.line + 1}"
    problem = problem.replace("'<stream end>'", "the end of the file")
    return InputError(place, f"is not valid YAML: {problem}", cure)


def read_yaml(path: str | Path) -> Document:
    """Read one YAML file. Raises `InputError` with `file:line:column` for whatever is wrong with it."""
    path = Path(path)
    return parse(read_text(path), path)


KINDS = {
    "protocol": ("steps",),
    "bench": ("motor", "load_cell"),
    "series' list": ("samples",),
    "model": ("pad",),
}
"""Files of ours, by the keys that tell them."""


def validate(document: Document, cls: type[M]) -> M:
    """The document as an object of `cls`; raises one `InputError` that names the first fault and lists the others.

    Validation is strict (a quoted "5" is no number, true is none either): the data go through JSON, where strictness
    still allows lists for tuples and words for dates.
    """
    if not isinstance(document.data, dict):
        what = "is empty" if document.data is None else "must be a mapping of `key: value` lines"
        raise document.error((), what, f"needed here: {', '.join(_required(cls)) or 'see padbench schema'}")
    wanted, own = next(((k, keys) for k, keys in KINDS.items() if set(keys) <= set(cls.model_fields)), ("", ()))
    if wanted and not any(key in document.data for key in own):
        for kind, keys in KINDS.items():
            if all(key in document.data for key in keys):
                raise document.error((), f"is a {kind}", f"wanted here: a {wanted} (with {' and '.join(own)})")
    try:
        return cls.model_validate_json(json.dumps(document.data), strict=True)
    except ValidationError as error:
        raise complaints(error, cls, document.places) from None


def load(path: str | Path, cls: type[M]) -> tuple[M, str]:
    """Read and validate a file; returns the object and the file's text, for the recording. Raises `InputError`."""
    document = read_yaml(path)
    return validate(document, cls), document.text


def _required(cls: type[BaseModel]) -> list[str]:
    return [f.alias or name for name, f in cls.model_fields.items() if f.is_required()]
