"""Shares of cases with 95 % intervals (Wilson's), where several cases come from one draw too."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import sqrt
from typing import Any

Z = 1.959964


@dataclass(frozen=True)
class Rate:
    """`hits` of `of` cases, and the interval of the rate. With no case at all everything is open: 0 to 1."""

    label: str
    hits: int
    of: int
    low: float
    high: float

    @property
    def value(self) -> float:
        """The rate; NaN with no case."""
        return self.hits / self.of if self.of else float("nan")

    def __str__(self) -> str:
        if not self.of:
            return "no case"
        return f"{100 * self.value:.0f} % ({100 * self.low:.0f}–{100 * self.high:.0f} %), {self.hits} of {self.of}"

    def to_json(self) -> dict[str, Any]:
        """For findings.json."""
        return {"label": self.label, "hits": self.hits, "of": self.of, "low": self.low, "high": self.high}


def rate(label: str, draws: Iterable[tuple[int, int]]) -> Rate:
    """From (hits, cases) of each draw.

    Draws are independent, the starts within one are not: they share its noise. The interval is Wilson's with the cases
    reduced to as many as would scatter so between draws (the design effect, never below 1). Where all cases are hits,
    or none, that scatter is not to be seen, and the draws count instead of the cases.
    """
    pairs = [(h, n) for h, n in draws if n]
    hits, of = sum(h for h, _ in pairs), sum(n for _, n in pairs)
    if not of:
        return Rate(label, 0, 0, 0.0, 1.0)
    p = hits / of
    independent = float(len(pairs))
    if 0 < hits < of and len(pairs) > 1:
        between = sum((h - p * n) ** 2 for h, n in pairs) / of**2 * len(pairs) / (len(pairs) - 1)
        independent = of / max(1.0, between / (p * (1 - p) / of))
    return Rate(label, hits, of, *wilson(p, independent))


def wilson(p: float, n: float) -> tuple[float, float]:
    """Wilson's score interval of a share p of n cases (E. B. Wilson, J. Am. Stat. Assoc. 22, 1927)."""
    middle = (p + Z**2 / (2 * n)) / (1 + Z**2 / n)
    reach = Z / (1 + Z**2 / n) * sqrt(p * (1 - p) / n + Z**2 / (4 * n**2))
    return max(0.0, middle - reach), min(1.0, middle + reach)
