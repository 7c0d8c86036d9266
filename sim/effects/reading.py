"""Numbers in the sentences of effects, as a person reads them.

Beside Python's own format specifications: `size` (3 digits, without the sign), `milli` (the size, times 1000),
`percent`, `force` (a value in newtons, in mN where it is small), and two words with a slash between, of which the
second is for values below zero: `{rate:rises/falls} by {rate:size} N`.
"""

from __future__ import annotations

import string
from collections.abc import Mapping
from typing import Any

SMALL_N = 0.5


def force(value_N: float, digits: int = 3) -> str:
    """A force for reading: mN where it is small."""
    return f"{1e3 * value_N:.{digits}g} mN" if abs(value_N) < SMALL_N else f"{value_N:.{digits}g} N"


class _Reading(string.Formatter):
    def format_field(self, value: Any, format_spec: str) -> str:
        if "/" in format_spec:
            return str(format_spec.split("/")[value < 0.0])
        if format_spec == "size":
            three = f"{abs(value):.3g}"
            return three if abs(value) < 1000.0 else f"{float(three):.0f}"
        if format_spec == "milli":
            return f"{1e3 * abs(value):.3g}"
        if format_spec == "percent":
            return f"{1e2 * abs(value):.3g} %"
        if format_spec == "force":
            return force(value)
        return str(super().format_field(value, format_spec))


def read(sentence: str, values: Mapping[str, float]) -> str:
    """The sentence with numbers in its `{name:how}` fields. Raises KeyError for a name that has no number."""
    return _Reading().vformat(sentence, (), values)
