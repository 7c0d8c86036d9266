"""Where each value of a file stands, by its path (`("steps", 2, "speed")`)."""

from __future__ import annotations

from dataclasses import dataclass, field

Key = str | int
Position = tuple[int, int]


@dataclass
class Places:
    """Line and column (from 1) of every value and of every key of one file."""

    file: str
    values: dict[tuple[Key, ...], Position] = field(default_factory=dict)
    keys: dict[tuple[Key, ...], Position] = field(default_factory=dict)

    def position(self, path: tuple[Key, ...], *, at_key: bool = False) -> Position | None:
        """Line and column of the node, or of the nearest one above it; None where nothing is known."""
        if at_key and path in self.keys:
            return self.keys[path]
        for length in range(len(path), -1, -1):
            if path[:length] in self.values:
                return self.values[path[:length]]
        return None

    def place(self, path: tuple[Key, ...], *, at_key: bool = False) -> str:
        """`file:line:column` of the node."""
        position = self.position(path, at_key=at_key)
        return self.file if position is None else f"{self.file}:{position[0]}:{position[1]}"

    def known_part(self, path: tuple[Key, ...]) -> tuple[Key, ...]:
        """The path without the elements that are not in the file (a validator's names of union members).

        The last element is kept in any case: it may be a key that is missing.
        """
        kept: tuple[Key, ...] = ()
        for i, key in enumerate(path):
            if (*kept, key) in self.values or i == len(path) - 1:
                kept = (*kept, key)
        return kept


def spell(path: tuple[Key, ...]) -> str:
    """`("steps", 2, "speed")` as a person writes it: `steps[2].speed`."""
    text = ""
    for key in path:
        if isinstance(key, int):
            text += f"[{key}]"
        else:
            text += f".{key}" if text else key
    return text
