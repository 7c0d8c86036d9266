"""Inputs made worse: texts, bytes, and the trees behind YAML files."""

from __future__ import annotations

import json
import random
from typing import Any

WORDS = (
    "1e400", "-1e400", ".nan", ".inf", "-.inf", "NaN", "1e-400", "0", "-1", "1e9", "1e308", "9" * 30, "0x" + "f" * 30,
    "~", "true", "''", '""', "[]", "{}", "'\\0'", '"\\u0000"', '"\\ud800"', "!!python/object:os.system x", "&a *a",
    "*a", "<<", "? x", "- - - -", "[[[[[[", "{a: {a: {a: ", "|\n  x", ">-", "%YAML 9", "---", "...", "\t", "\0", "é",
    "\u2028", "\ufeff", "<script>alert(1)</script>", "../../../etc/passwd", "/dev/zero", "a" * 3000, "1_000", "1:30",
)  # fmt: skip

VALUES: tuple[Any, ...] = (
    None, True, False, 0, -1, 1, 3, 10**9, 2**53, 2**63, 10**30, 0.0, -0.0, 1e-320, 1e300, -1e300, 0.5, 100.0, "", "x",
    "none", "\u202e", "a" * 5000, "<b>", "../x", "\x7f", [], {}, [[]], [None], {"": None}, {"to": 1, "speed": 1},
    [1, 2, 3], [0, 1], [1, 0], [1e300, -1e300], {"a": {"b": {"c": {}}}},
)  # fmt: skip


def spoiled_bytes(data: bytes, pick: random.Random) -> bytes:
    """One to eight changes of any kind."""
    out = bytearray(data)
    for _ in range(pick.choice((1, 1, 1, 2, 3, 8))):
        at, size = pick.randrange(len(out) + 1), pick.choice((1, 1, 2, 4, 8, 40))
        what = pick.randrange(8)
        if what == 0 and out:
            out[at % len(out)] ^= 1 << pick.randrange(8)
        elif what == 1:
            out[at : at + size] = pick.randbytes(size)
        elif what == 2:
            del out[at : at + size]
        elif what == 3:
            out[at:at] = pick.randbytes(size)
        elif what == 4:
            out[at : at + size] = bytes([pick.choice((0, 0xFF, 0x7F, 0x80))]) * size
        elif what == 5:
            other = pick.randrange(len(out) + 1)
            out[at:at] = out[other : other + pick.choice((1, 8, 64, 500))]
        elif what == 6:
            del out[at:]
        else:
            out[at:at] = pick.choice(WORDS).encode("utf-8", "surrogatepass")
    return bytes(out)


def spoiled_tree(tree: Any, pick: random.Random) -> Any:
    """The tree with one place changed: a value, a key, an item more or less."""
    if not isinstance(tree, dict | list) or not tree or pick.random() < 0.1:
        return pick.choice(VALUES)
    if isinstance(tree, list):
        at = pick.randrange(len(tree))
        what = pick.randrange(6)
        if what == 0:
            return tree[:at] + tree[at + 1 :]
        if what == 1:
            return [*tree, tree[at]]
        return [*tree[:at], spoiled_tree(tree[at], pick), *tree[at + 1 :]]
    key = pick.choice(list(tree))
    what = pick.randrange(8)
    if what == 0:
        return {k: v for k, v in tree.items() if k != key}
    if what == 1:
        return {**tree, str(pick.choice(("", "to", "<<", "repeat", "name", "x" * 300))): pick.choice(VALUES)}
    return {**tree, key: spoiled_tree(tree[key], pick)}


def yaml_text(tree: Any, pick: random.Random) -> str:
    """The tree as YAML (JSON is some), now and then with a word in it that JSON has not."""
    text = json.dumps(tree, default=str)
    if pick.random() < 0.3:
        numbers = [i for i, c in enumerate(text) if c.isdigit()]
        if numbers:
            at = pick.choice(numbers)
            text = text[:at] + pick.choice(WORDS) + text[at + 1 :]
    return text
