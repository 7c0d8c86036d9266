"""One measurement as a fit works on it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from ._kernel import Array

CHUNK = 32768  # samples whose derivatives are in memory at once


@dataclass(frozen=True)
class Run:
    """One measurement on its union grid; all arrays (n,).

    `dt_s`: time since the sample before, 0 for the first; `u`: depth over D; `y`: force over the force scale, 0
    where `weight` is 0; `weight`: what a sample counts in the cost (0: no force there, or history).
    """

    time_s: Array
    dt_s: Array
    u: Array
    y: Array
    weight: Array
    surface: int | None = None
    """Which of the problem's doubtful surfaces this run presses; None: its surface is certain."""
    past: int | None = None
    """Which of the problem's unknown pasts this run begins with; None: it begins at rest."""
    stamp_std_s: float = 0.0
    """By how much all its positions may be early or late against its forces, standard deviation."""
    late: int | None = None
    """Which of the problem's doubtful stamps are this run's; None: not estimated."""

    @property
    def size(self) -> int:
        """Samples of the union grid."""
        return len(self.dt_s)

    def chunks(self) -> Iterator[slice]:
        """Pieces small enough to hold their derivatives."""
        for start in range(0, self.size, CHUNK):
            yield slice(start, min(start + CHUNK, self.size))
