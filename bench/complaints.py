"""A validator's findings in plain words: one message that names file, line, field and cure."""

from __future__ import annotations

import difflib
import re
import types
import typing
from collections.abc import Iterator
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import BaseModel, Tag, ValidationError

from bench.errors import InputError
from bench.places import Key, Places, spell

MAX_LISTED = 5
_NUMBER = re.compile(r"[-+]?[0-9]*\.?[0-9]+([eE][-+]?[0-9]+)?")


class FieldError(ValueError):
    """Raised by a validator that knows the path of the field at fault, counted from the object it validates."""

    def __init__(self, path: tuple[Key, ...], message: str, cure: str = "") -> None:
        super().__init__(message)
        self.path, self.message, self.cure = path, message, cure


def complaints(error: ValidationError, cls: type[BaseModel], places: Places) -> InputError:
    """All that a validation found as one `InputError`: the first at its place, up to five more below it."""
    found = [_complaint(details, cls, places) for details in _without_echoes(error.errors(include_url=False))]
    # In the file's order, so that the first is the one a reader meets first.
    found.sort(key=lambda c: c[0] or (0, 0))
    _, place, message, cure = found[0]
    lines = [cure] if cure else []
    if len(found) > 1:
        lines.append(f"and {len(found) - 1} more:")
        lines += [f"  {place}: {message}" for _, place, message, _ in found[1 : 1 + MAX_LISTED]]
    return InputError(place, message, "\n  ".join(lines))


def _without_echoes(errors: list[Any]) -> list[Any]:
    """A misspelt key is unknown, and the right one missing: that is one mistake, told once."""
    unknown: dict[tuple[Key, ...], list[str]] = {}
    for details in errors:
        if details["type"] == "extra_forbidden":
            unknown.setdefault(details["loc"][:-1], []).append(str(details["loc"][-1]))
    return [
        details
        for details in errors
        if details["type"] != "missing"
        or not difflib.get_close_matches(str(details["loc"][-1]), unknown.get(details["loc"][:-1], []), 1, 0.5)
    ]


def _complaint(details: Any, cls: type[BaseModel], places: Places) -> tuple[tuple[int, int] | None, str, str, str]:
    loc: tuple[Key, ...] = details["loc"]
    raised = details.get("ctx", {}).get("error")
    cure = ""
    if isinstance(raised, FieldError):
        path, message, cure = (*_trimmed(loc, places), *raised.path), raised.message, raised.cure
    else:
        path = places.known_part(loc) if details["type"] == "missing" else _trimmed(loc, places)
        message = _wording(details)
    unknown = details["type"] == "extra_forbidden"
    if details["type"] in ("union_tag_invalid", "union_tag_not_found") and "discriminator" in details["ctx"]:
        path, message, cure = _untold(path, details["ctx"])
    elif unknown:
        cure = nearest(str(loc[-1]), known_keys(cls, loc[:-1]))
    if path:
        message = f"{spell(path)}: {message}"
    return places.position(path, at_key=unknown), places.place(path, at_key=unknown), message, cure


def _untold(path: tuple[Key, ...], ctx: Any) -> tuple[tuple[Key, ...], str, str]:
    """The key that says which of several forms is meant, where it says none of them, or is not there."""
    key = ctx["discriminator"].strip("'")
    if "tag" not in ctx:
        return (*path, key), "is missing", ""
    known = re.findall(r"'(\w+)'", ctx["expected_tags"])
    return (*path, key), f"there is no `{ctx['tag']}`", nearest(ctx["tag"], known)


def _trimmed(loc: tuple[Key, ...], places: Places) -> tuple[Key, ...]:
    path = places.known_part(loc)
    return path if path in places.values else path[:-1]


def _wording(details: Any) -> str:
    kind: str = details["type"]
    ctx = details.get("ctx", {})
    given = _shown(details.get("input"))
    plain: dict[str, str] = {
        "missing": "is missing",
        "extra_forbidden": "unknown key",
        "float_type": f"must be a number, not {given}",
        "int_type": f"must be a whole number, not {given}",
        "int_from_float": f"must be a whole number, not {given}",
        "string_type": f"must be a word, not {given}",
        "bool_type": f"must be true or false, not {given}",
        "finite_number": f"must be a finite number, not {given}",
        "tuple_type": f"must be a list, not {given}",
        "list_type": f"must be a list, not {given}",
        "dict_type": f"must be a mapping of `key: value`, not {given}",
        "model_type": f"must be a mapping of `key: value`, not {given}",
        "date_type": f"must be a date like 2026-11-01, not {given}",
        "date_parsing": f"must be a date like 2026-11-01, not {given}",
        "date_from_datetime_parsing": f"must be a date like 2026-11-01, not {given}",
        "string_too_short": "must not be empty",
    }
    if kind in plain:
        return plain[kind]
    if kind in ("greater_than", "greater_than_equal", "less_than", "less_than_equal"):
        sign = {"greater_than": ">", "greater_than_equal": "≥", "less_than": "<", "less_than_equal": "≤"}[kind]
        bound = next(ctx[key] for key in ("gt", "ge", "lt", "le") if key in ctx)
        return f"must be {sign} {bound:g}, not {given}"
    if kind == "too_short":
        return "must not be empty" if ctx["min_length"] == 1 else f"needs at least {ctx['min_length']} values"
    if kind == "too_long":
        what = "characters" if isinstance(details.get("input"), str) else "values"
        return f"takes at most {ctx['max_length']} {what}, not {ctx['actual_length']}"
    if kind == "literal_error":
        return f"must be {ctx['expected'].replace(chr(39), '`')}, not {given}"
    if kind == "value_error":
        return str(ctx["error"])
    if kind == "string_pattern_mismatch":
        return f"{given} is no name: letters, digits, `_`, `-`, dots and spaces, not first"
    message: str = details["msg"]
    return message[0].lower() + message[1:]


def _shown(value: Any) -> str:
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, dict):
        return "a mapping"
    if isinstance(value, list):
        return f"a list of {len(value)}" if value else "an empty list"
    if isinstance(value, str):
        return f"the word `{value[:40]}`" + (" (leave out its quotes)" if _NUMBER.fullmatch(value) else "")
    return f"{value}"


def nearest(word: str, known: list[str]) -> str:
    """The cure for a word that is not known: the nearest that is, and all of them where they are few."""
    close = difflib.get_close_matches(word.lower(), [k.lower() for k in known], n=1, cutoff=0.5)
    guess = next((f"did you mean `{k}`? " for k in known if close and k.lower() == close[0]), "")
    return (guess + f"known here: {', '.join(known)}" if known else guess).strip()


def known_keys(cls: type[BaseModel], loc: tuple[Key, ...]) -> list[str]:
    """The keys that the object at `loc` may have; `loc` may hold a validator's names of union members."""
    candidates: list[Any] = [cls]
    for key in loc:
        candidates = [c for member in candidates for c in _step(member, key)] or candidates
    keys: dict[str, None] = {}
    for member in candidates:
        for model in _models(member):
            keys.update(dict.fromkeys(f.alias or name for name, f in model.model_fields.items()))
    return list(keys)


def _step(annotation: Any, key: Key) -> Iterator[Any]:
    """What `annotation` offers under `key`: a field, an item, or the union member of that name."""
    for member in _flat(annotation):
        bare, tag = member
        if isinstance(key, int) and get_origin(bare) in (list, tuple):
            yield get_args(bare)[0]
        elif get_origin(bare) is dict:
            yield get_args(bare)[1]
        elif isinstance(key, str) and (tag == key or getattr(bare, "__name__", None) == key):
            yield bare
        elif isinstance(bare, type) and issubclass(bare, BaseModel):
            for name, info in bare.model_fields.items():
                if key in (name, info.alias):
                    yield info.annotation


def _flat(annotation: Any, tag: str | None = None) -> Iterator[tuple[Any, str | None]]:
    """The members of a union, aliases and annotations opened, each with its tag."""
    if get_origin(annotation) is Annotated:
        bare, *extras = get_args(annotation)
        named = next((extra.tag for extra in extras if isinstance(extra, Tag)), tag)
        yield from _flat(bare, named)
    elif get_origin(annotation) in (Union, types.UnionType):
        for member in typing.get_args(annotation):
            yield from _flat(member)
    else:
        yield annotation, tag


def _models(annotation: Any) -> Iterator[type[BaseModel]]:
    for bare, _ in _flat(annotation):
        if isinstance(bare, type) and issubclass(bare, BaseModel):
            yield bare
