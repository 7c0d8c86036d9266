"""One figure of a check-up, with what it means and what to do where it is not as it should be."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Finding:
    """`ok` False: `means` says what it does to a measurement, `do` what to do about it. None: it could not be told."""

    check: str
    shown: str
    ok: bool | None = True
    means: str = ""
    do: str = ""

    def lines(self) -> list[str]:
        """For a terminal."""
        mark = {True: "ok     ", False: "LOOK   ", None: "unknown"}[self.ok]
        more = [f"          {text}" for text in (self.means, f"→ {self.do}" if self.do else "") if text]
        return [f"{mark}   {self.check}: {self.shown}", *more]


@dataclass
class Checkup:
    """All findings in order, and every figure behind them by group and name."""

    findings: list[Finding] = field(default_factory=list)
    figures: dict[str, dict[str, Any]] = field(default_factory=dict)

    def add(self, group: str, figures: dict[str, Any], findings: list[Finding]) -> None:
        """Take what one check came to."""
        self.figures.setdefault(group, {}).update(figures)
        self.findings += findings

    @property
    def well(self) -> bool:
        """Nothing that somebody must see to."""
        return all(finding.ok is not False for finding in self.findings)

    def to_json(self) -> dict[str, Any]:
        """Every figure, every finding."""
        return {"well": self.well, "figures": self.figures, "findings": [dict(vars(f)) for f in self.findings]}
